"""Fig. 3.7 of Iwatani 2017: position, velocity and force while a hand guides Setup A, under five compensators."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from backdrive.report.pictures.canvas import LIGHT, house_style
from backdrive.simulation.closed_loop import Record
from backdrive.thesis import _hand_guiding
from backdrive.thesis import _hand_guiding_plots as own
from backdrive.thesis._balance import balance
from backdrive.thesis._hand_guiding import CASES, PERIOD
from backdrive.thesis.fig_3_8 import CYCLES, SETTING, guidance
from backdrive.thesis.outcome import Claim, Outcome
from backdrive.thesis.setups import RATIO

THINNED = 10  # of the whole run one sample in so many is drawn
ZOOM = (10, 13)  # windows that are drawn in full
STILL = 1e-4  # speed below which the load stands still [m/s]


def run(seed: int = 0, ratio: float = RATIO) -> Outcome:
    """Guide Setup A for 30 cycles in each case.

    Args:
        seed: of the hand.
        ratio: K_c by K [-].
    """
    records = _hand_guiding.guide([(guidance(ratio), CYCLES, seed)])[0]
    found = _hand_guiding.peaks(records, CYCLES)
    lowest = np.argmin(np.stack([found[case] for case in CASES]), axis=0) == CASES.index("PD")
    speed = top_speeds(records)
    turned = {case: reversals(records[case]) for case in CASES}
    return Outcome(
        name="fig-3.7",
        title="Position, velocity, actuator force and external force, Setup A",
        setting=SETTING + f" {CYCLES} cycles.",
        claims=(*_claims(lowest, speed, turned), balance(records.values())),
        data=time_series(records),
        numbers={
            **{f"top_speed.{case}": float(value) for case, value in speed.items()},
            "windows_lowest": float(lowest.mean()),
        },
    )


def time_series(records: Mapping[str, Record]) -> dict[str, Any]:
    """Return what the figure draws: the whole run thinned, and some windows in full."""
    edges = _hand_guiding.BEGIN + _hand_guiding.CYCLE * np.arange(ZOOM[0], ZOOM[1] + 1)
    first, last = round(edges[0] / PERIOD), round(edges[-1] / PERIOD)
    return {
        "whole": _hand_guiding.series(records, THINNED),
        "zoom": _hand_guiding.series(records, 1, first, last),
        "edges": edges,
    }


def top_speeds(records: Mapping[str, Record]) -> dict[str, float]:
    """Return the mean of the largest speed of each window and direction, by case [rad/s or m/s]."""
    result = {}
    for case, record in records.items():
        v = _hand_guiding.windows(record.load_velocity, CYCLES)
        result[case] = float(0.5 * (v.max(axis=1).mean() - v.min(axis=1).mean()))
    return result


def reversals(record: Record) -> tuple[float, float, float]:
    """Return how long after a reversal of the load's velocity the peaks come [s], the compensation along the hand at the
    reversal [N.m or N], and the share of time at standstill [-].

    Means over all windows and both directions; a peak without a reversal before it in its window is left out.

    Args:
        record: of a case.
    """
    force = _hand_guiding.windows(record.sensed, CYCLES)
    effort = _hand_guiding.windows(record.compensation, CYCLES)
    speed = _hand_guiding.windows(record.load_velocity, CYCLES)
    late, along = [], []
    for way in (1.0, -1.0):
        for k in range(CYCLES):
            at = int(np.argmax(way * force[k]))
            before = np.flatnonzero(way * speed[k, : at + 1] <= STILL)
            if before.size:
                late.append(PERIOD * (at - before[-1]))
                along.append(way * effort[k, before[-1]])
    return float(np.mean(late)), float(np.mean(along)), float(np.mean(np.abs(speed) < STILL))


def _claims(
    lowest: np.ndarray, speed: dict[str, float], turned: dict[str, tuple[float, float, float]]
) -> tuple[Claim, ...]:
    return (
        Claim(
            what="The peaks of the force are smaller with PD through the experiment.",
            thesis="smaller through this experiment",
            ours=f"PD is the smallest of the five in {100 * lowest[:, 0].mean():.0f} % (+q) and "
            f"{100 * lowest[:, 1].mean():.0f} % (-q) of {len(lowest)} windows",
            gate="in more than half of them, each direction",
            holds=bool(np.all(lowest.mean(axis=0) > 0.5)),
            why_not="CD does what PD does, and by chance is the smallest as often.",
            statement="3.7-smallest",
        ),
        Claim(
            what="With C and CD the peaks appear at the reversals, where the compensation opposes the hand.",
            thesis="C and CD: at each velocity reversal",
            ours="; ".join(
                f"{case}: {1e3 * late:.0f} ms after, compensation along the hand at the reversal {along:+.1f} N, at standstill "
                f"{100 * rest:.0f} % of the time"
                for case, (late, along, rest) in turned.items()
            ),
            gate="with C and CD within 50 ms of the reversal, and the compensation against the hand",
            holds=all(turned[case][0] < 0.05 and turned[case][1] < 0.0 for case in ("C", "CD")),
            why=(
                "When the load stops, C keeps its torque, so the load rests until the hand overcomes friction and "
                "compensation. With CD, the dither breaks the load away earlier."
            ),
            statement="3.7-reversal",
        ),
        Claim(
            what="The velocity peaks are larger with C.",
            thesis="C larger than CD, P and PD",
            ours=", ".join(f"{case} {value:.3f}" for case, value in speed.items()) + " m/s",
            gate="C above CD, P and PD",
            holds=speed["C"] > max(speed["CD"], speed["P"], speed["PD"]),
            why="The compensation reverses at once when the joint breaks away.",
            statement="3.7-speed",
        ),
    )


ZOOMED = (
    ("position", "position [mm]", 1e3),
    ("velocity", "velocity [m/s]", 1.0),
    ("command", "actuator [N]", 1.0),
    ("force", "external [N]", 1.0),
)


def draw(outcome: Outcome) -> Any:
    """Return the figure: (a) external force through the whole run, a strip a case; (b) some windows in full."""
    whole, zoom, edges = outcome.data["whole"], outcome.data["zoom"], outcome.data["edges"]
    strips = len(whole["cases"])
    with house_style():
        figure, axes = own.sheet(
            strips + len(ZOOMED),
            1,
            width=760.0,
            height=880.0,
            height_ratios=[0.62] * strips + [1.1] * len(ZOOMED),
        )
        column = axes[:, 0]
        top = max(float(abs(c["force"]).max()) for c in whole["cases"].values())
        for a, (case, columns) in zip(column, whole["cases"].items(), strict=False):
            own.lines(a, whole["time"], {case: columns}, "force", linewidth=0.8)
            a.set_ylim(-1.1 * top, 1.1 * top)
            a.set_xlim(0.0, whole["time"][-1])
            a.axvspan(edges[0], edges[-1], color=LIGHT.grid, zorder=0, linewidth=0)
            a.set_yticks([-20, 0, 20])
            own.name(a, "", "", f"{case} [N]")
            a.tick_params(labelbottom=a is column[strips - 1])
        own.name(column[0], "(a) External force, 30 cycles", "", "NC [N]")
        own.name(column[strips - 1], "", "time [s]", "PD [N]")
        for a, (quantity, label, factor) in zip(column[strips:], ZOOMED, strict=False):
            own.lines(a, zoom["time"], zoom["cases"], quantity, factor=factor, step=3)
            a.set_xlim(edges[0], edges[-1])
            own.name(a, "", "", label)
            a.tick_params(labelbottom=a is column[-1])
        own.edges(column[-1], edges)
        own.name(column[strips], "(b) The shaded part", "", ZOOMED[0][1])
        own.name(column[-1], "", "time [s]", ZOOMED[-1][1])
        own.key(column[strips], "lower right", strips, bbox_to_anchor=(1.0, 1.0))
    return figure
