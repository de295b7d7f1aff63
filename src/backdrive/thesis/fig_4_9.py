"""Fig. 4.9 of Iwatani 2017: with HA inside, an admittance-controlled joint comes to rest with its actuator pushing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from backdrive.report.pictures.canvas import LIGHT, house_style
from backdrive.simulation.closed_loop import Record, play
from backdrive.simulation.machines import setup_a
from backdrive.thesis import _sensorless_plots as own
from backdrive.thesis._sensorless import (
    CASES,
    PERIOD,
    REST,
    admitted,
    estimators,
    in_words,
    metronome,
)
from backdrive.thesis.fig_3_4 import identified
from backdrive.thesis.outcome import Claim, Outcome

SEEDS, CYCLES = 6, 6
PAUSE = 1.5  # between the beginnings of strokes [s]
HOLD, FREE = 1.0, 2.0  # at the end [s]
DWELL = 0.1  # for which a joint has not moved when it counts as resting [s]
SHOWN = 6.0  # of the figure [s]
MEASURES = ("external", "command", "friction", "balance", "free")


def run(seed: int = 0, seeds: int = SEEDS, cycles: int = CYCLES) -> Outcome:
    """Guide the admittance-controlled Setup A with pauses at both ends, and look at it at rest.

    Args:
        seed: of the first of the hands.
        seeds: number of hands.
        cycles: back and forth.
    """
    plant = setup_a()
    friction = estimators(plant, identified(plant, seed))
    motions = [metronome(cycles, seed + i, hold=HOLD, free=FREE, interval=PAUSE) for i in range(seeds)]
    records = iter(
        play([admitted(plant, m, friction[c], seed + i) for c in CASES for i, m in enumerate(motions)])
    )
    runs: Mapping[str, Sequence[Record]] = {case: [next(records) for _ in motions] for case in CASES}
    found = {case: np.array([_measure(r) for r in runs[case]]) for case in CASES}
    means = {m: {c: float(found[c][:, i].mean()) for c in CASES} for i, m in enumerate(MEASURES)}
    record = runs["HA"][0]
    at = slice(0, round(SHOWN / PERIOD))
    rest = resting(record)
    return Outcome(
        name="fig-4.9",
        title="Equilibrium of admittance control with a friction that never lets go",
        setting=(
            "Setup A under the admittance control of Fig. 4.8 (m = 2 kg, b = 15 N s/m, cascade filter), guided with a "
            "stroke every "
            f"{PAUSE:g} s, {cycles} cycles with each of {seeds} hands, held and let go. At rest: slower than 0.1 mm/s "
            f"for {DWELL:g} s."
        ),
        claims=_claims(found, means),
        data={
            "time": record.time[at],
            "position": 1.0 * record.load[at],
            "external": 1.0 * record.estimate[at],
            "friction": 1.0 * record.friction[at],
            "command": 1.0 * record.command[at],
            "rest": rest[at],
            "balance": means,
        },
        numbers={f"{m}.{c}": x for m, by in means.items() for c, x in by.items()},
    )


def resting(record: Record) -> np.ndarray:
    """Return when the load has not moved for a while, (n,)."""
    n = round(DWELL / PERIOD)
    slow = np.cumsum(np.concatenate([[0], np.abs(record.load_velocity) < REST]))
    rest = np.zeros(record.time.size, dtype=bool)
    rest[n - 1 :] = slow[n:] - slow[:-n] == n
    return rest


def _measure(record: Record) -> tuple[float, ...]:
    """Return the numbers of `MEASURES`: mean magnitudes at rest in the hand, and of the command without the hand [N]."""
    grip = record.scene.motion.grip > 0.0
    rest = resting(record)
    held = rest & grip & (record.time > 1.0)
    free = rest & ~grip & (record.time > record.time[grip][-1] + 1.0)
    size = [np.abs(x[held]).mean() for x in (record.estimate, record.command, record.friction)]
    balance = np.abs(record.friction - record.command)[held].mean()
    alone = np.abs(record.command[free]).mean() if free.any() else np.nan
    return (*map(float, size), float(balance), float(alone))


def _claims(found: dict[str, np.ndarray], means: dict[str, dict[str, float]]) -> tuple[Claim, ...]:
    column = {m: {c: found[c][:, i] for c in CASES} for i, m in enumerate(MEASURES)}
    external, command, balance = column["external"]["HA"], column["command"]["HA"], column["balance"]["HA"]
    return (
        Claim(
            what="With HA the estimated external force is almost zero at rest while the actuator's is not.",
            thesis="the estimated external force is almost zero in the static friction state, friction and actuator force are not",
            ours=(
                f"HA at rest in the hand: external {means['external']['HA']:.2f} N, actuator "
                f"{means['command']['HA']:.1f} N, friction "
                f"{means['friction']['HA']:.1f} N"
            ),
            gate="external below 0.5 N, actuator above 2 N, with every hand",
            holds=bool(external.max() < 0.5 and command.min() > 2.0),
            why="The virtual object rests where the estimate is zero, and there the estimated friction is what the actuator gives.",
        ),
        Claim(
            what="Estimated friction and actuator force balance, (4.18).",
            thesis="tau_e = tau - tau_c = 0",
            ours=f"they differ by {means['balance']['HA']:.3f} N",
            gate="below 0.5 N with every hand",
            holds=bool(balance.max() < 0.5),
        ),
        Claim(
            what="It does not end when the hand lets go.",
            ours=f"actuator without a hand {in_words(means['free'], 'N', digits=2)}",
            gate="HA above 1 N in the mean",
            holds=means["free"]["HA"] > 1.0,
            why="Nothing moves and nothing is estimated, so that nothing changes.",
        ),
        Claim(
            what="With P the actuator's force fades at rest.",
            ours=f"actuator at rest in the hand {in_words(means['command'], 'N', digits=2)}",
            gate="P below 0.5 N with every hand",
            holds=bool(column["command"]["P"].max() < 0.5),
            why=(
                "The estimated friction leaks at 20 1/s; what is left of the actuator's force is then taken for an "
                "external one, which "
                "moves the virtual object until it is gone."
            ),
        ),
    )


FORCES = {
    "external": "estimated external force",
    "friction": "estimated friction",
    "command": "actuator force",
}
BARS = {"external": "external", "friction": "friction", "command": "actuator", "free": "actuator,\nlet go"}


def draw(outcome: Outcome) -> Any:
    """Return the figure: position and forces with HA over time, rest shaded; means at rest by estimator."""
    data = outcome.data
    t = data["time"]
    with house_style():
        figure, axes = own.sheet(4, 1, height=620.0)
        top, *rows = axes[:, 0]
        series = {
            "position": 1e3 * data["position"],
            "external": data["external"],
            "friction": data["friction"],
        }
        series["command"] = data["command"]
        for a, (what, values) in zip((top, rows[0], rows[1]), list(series.items())):
            own.shade(a, t, data["rest"])
            a.set_xlim(t[0], t[-1])
            color = own.COLORS["HA"] if what == "external" else LIGHT.ink
            a.plot(t, values, color=color, linewidth=1.2, label=FORCES.get(what))
        rows[1].plot(
            t,
            data["command"],
            color=own.COLORS["CT"],
            linewidth=1.4,
            linestyle=own.DASHED,
            label=FORCES["command"],
        )
        own.name(top, "(a) HA; shaded: at rest", y="position [mm]")
        for a in rows[:2]:
            own.level(a)
            own.name(a, y="force [N]")
            own.key(a, "upper right", 2)
            low, high = a.get_ylim()
            a.set_ylim(low, high + 0.3 * (high - low))
        own.name(rows[1], x="time [s]", y="force [N]")
        below = rows[2]
        cases = tuple(data["balance"]["external"])
        for i, case in enumerate(cases):
            heights = [data["balance"][what][case] for what in BARS]
            places = [k + 0.25 * (i - 1) for k in range(len(BARS))]
            below.bar(places, heights, 0.22, color=own.COLORS[case], label=case, zorder=2)
        below.set_xticks(range(len(BARS)), list(BARS.values()))
        below.grid(False, axis="x")
        own.name(below, "(b) mean magnitudes at rest", y="force [N]")
        own.key(below, "upper left", 3)
    return figure
