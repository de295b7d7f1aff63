"""Fig. 4.8 of Iwatani 2017: sensorless admittance control of Setup A with three friction estimators."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from backdrive.control.admittance import Admittance
from backdrive.control.estimators.friction import NOTHING
from backdrive.control.estimators.sliding_mode import MotionFilter
from backdrive.report.pictures.canvas import LIGHT, house_style
from backdrive.simulation.closed_loop import Record, play
from backdrive.thesis import _sensorless_plots as own
from backdrive.thesis._balance import balance
from backdrive.thesis._hand_guiding import peaks
from backdrive.thesis._sensorless import (
    ADMITTANCE,
    CASCADE,
    CASES,
    LITERAL,
    PERIOD,
    PRINTED,
    REST,
    STROKE,
    admittance_scene,
    estimators,
    in_words,
    metronome,
    ran_away,
    rms,
    virtual_force,
)
from backdrive.thesis.fig_3_4 import identify_rate
from backdrive.thesis.outcome import Claim, Outcome
from backdrive.thesis.scatter import less
from backdrive.thesis.setups import RATIO, setups

SEEDS, CYCLES = 10, 8
FEW, SHORT = 2, 4  # seeds and cycles of the conditions beside
SHOWN = 6.0  # of the figure [s]

#: Condition -> virtual object, filter, delay [s].
CONDITIONS: dict[str, tuple[Admittance, MotionFilter, float]] = {
    "as printed": (PRINTED, LITERAL, 0.0),
    "m = 2, two filters": (ADMITTANCE, CASCADE, 0.0),
    "m = 1, two filters": (PRINTED, CASCADE, 0.0),
    "m = 2, filter as printed": (ADMITTANCE, LITERAL, 0.0),
    "as printed, one sample late": (PRINTED, LITERAL, PERIOD),
    "m = 2, two filters, one sample late, softer": (
        replace(ADMITTANCE, proportional=3e4, derivative=300.0),
        CASCADE,
        PERIOD,
    ),
}
CHOSEN, OURS = "as printed", "m = 2, two filters"
MANY = (CHOSEN, OURS)  # conditions with all hands

Records = Mapping[str, Sequence[Record]]  # case -> a record a seed


def admit(
    condition: str, seed: int, seeds: int, cycles: int, cases: Sequence[str] = CASES, ratio: float = RATIO
) -> dict[str, list[Record]]:
    """Return Setup A in the hand under admittance control, by case, one record a seed.

    Args:
        condition: of `CONDITIONS`.
        seed: of the first hand.
        seeds: number of hands.
        cycles: of the metronome.
        cases: CT, HA, P or `none`, which takes friction for nothing.
        ratio: K_c by K [-].
    """
    plant = setups(ratio)["setup_a"]
    friction = estimators(plant, identify_rate(plant, seed)) | {"none": NOTHING}
    admittance, filter_, delay = CONDITIONS[condition]
    motions = [metronome(cycles, seed + i) for i in range(seeds)]
    scenes = [
        admittance_scene(
            plant,
            motion,
            friction[case],
            seed + i,
            admittance=admittance,
            filter=filter_,
            delay=delay,
        )
        for case in cases
        for i, motion in enumerate(motions)
    ]
    records = iter(play(scenes))
    return {case: [next(records) for _ in motions] for case in cases}


def run(seed: int = 0, seeds: int = SEEDS, cycles: int = CYCLES, ratio: float = RATIO) -> Outcome:
    """Guide the admittance-controlled Setup A by hand with CT, HA and P.

    Args:
        seed: of the first of the hands.
        seeds: number of hands.
        cycles: of the metronome.
        ratio: K_c by K [-].
    """
    records = admit(CHOSEN, seed, seeds, cycles, ratio=ratio)
    found = {CHOSEN: _metrics(records, CHOSEN, cycles)}
    for name in CONDITIONS:
        if name != CHOSEN:
            n, long = (seeds, cycles) if name in MANY else (min(seeds, FEW), min(cycles, SHORT))
            found[name] = _metrics(admit(name, seed, n, long, ratio=ratio), name, long)
    numbers = {
        f"{name}.{case}.{what}": float(np.mean(value))
        for name, by in found.items()
        for case, measured in by.items()
        for what, value in measured.items()
        if what != "peaks"
    }
    return Outcome(
        name="fig-4.8",
        title="Admittance control of Setup A without a force sensor",
        setting=(
            f"Setup A in a hand of 800 N/m and 40 N s/m, strokes of 0.06 m to a metronome of 0.667 Hz, {cycles} cycles "
            "with each of "
            f"{seeds} hands. As printed: m = 1 kg, b = 15 N s/m, K_p = 1e5 N/m, K_d = 1e3 N s/m, filter G = 10, H = 2; "
            "no delay beyond "
            "the sampling; the estimator gets the command of the tick before. Peaks are the largest measured forces of each 1.5 s. "
            "Beside it m = 2 kg and two filters in a row, and one sample of delay more."
        ),
        claims=(*_claims(found), balance((r for runs in records.values() for r in runs), weightless=False)),
        data=_figure_data(records),
        numbers=numbers,
    )


def _metrics(records: Records, condition: str, cycles: int) -> dict[str, dict[str, np.ndarray]]:
    """Return what is measured of each case, every number a seed."""
    admittance = CONDITIONS[condition][0]
    measured = {}
    for case, runs in records.items():
        high = np.array([peaks({case: r}, cycles)[case] for r in runs])  # (seeds, cycles, 2)
        still = [np.abs(r.scene.motion.velocity) < 1e-9 for r in runs]
        measured[case] = {
            "peak": high.mean(axis=1),
            "peaks": high,
            "force": np.array([rms(r.force) for r in runs]),
            "criterion": np.array([rms(r.sensed - virtual_force(r, admittance)) for r in runs]),
            "command": np.array([rms(r.command[s]) for r, s in zip(runs, still, strict=False)]),
            "restless": np.array(
                [np.mean(np.abs(r.load_velocity[s]) > REST) for r, s in zip(runs, still, strict=False)]
            ),
            "apart": np.array([rms(r.load - p.load) for r, p in zip(runs, records["P"], strict=False)]),
            "away": np.array([ran_away(r) for r in runs]),
        }
    return measured


def _figure_data(records: Records) -> dict[str, Any]:
    some = next(iter(records.values()))[0]
    at = slice(0, round(SHOWN / PERIOD))
    return {
        "time": some.time[at],
        "cases": {
            case: {"position": 1.0 * runs[0].load[at], "force": 1.0 * runs[0].sensed[at]}
            for case, runs in records.items()
        },
    }


def _mean(found: Any, condition: str, what: str) -> dict[str, float]:
    return {case: float(np.mean(found[condition][case][what])) for case in CASES}


def _away(found: Any, condition: str) -> str:
    by = found[condition]
    return ", ".join(f"{case} {int(by[case]['away'].sum())} of {by[case]['away'].size}" for case in CASES)


def _claims(found: Any) -> tuple[Claim, ...]:
    chosen = found[CHOSEN]
    peak = {case: chosen[case]["peak"].mean(axis=1) for case in CASES}
    alike = {case: 100.0 * float(np.mean(chosen[case]["apart"])) / STROKE for case in ("CT", "HA")}
    restless = {c: 100 * x for c, x in _mean(found, CHOSEN, "restless").items()}
    near = {c: 100.0 * float(np.mean(found[OURS][c]["apart"])) / STROKE for c in ("CT", "HA")}
    own = {case: found[OURS][case]["peak"].mean(axis=1) for case in CASES}
    return (
        Claim(
            what="The external force is smallest with P.",
            thesis="the external force measured by the force sensor is smallest with the estimator P",
            ours=f"mean peaks {in_words(_mean(found, CHOSEN, 'peak'), 'N')}; ran away: {_away(found, CHOSEN)}",
            gate="P below CT and HA, 95 % interval of the paired difference",
            holds=less(peak["P"], peak["CT"]) and less(peak["P"], peak["HA"]),
            why_not=(
                "The filter as printed switches its acceleration by 100 N of this mass from tick to tick. This shakes the joint, "
                f"which moves {in_words(restless, '%', digits=0)} of the time between strokes. So HA never rests on a friction "
                "of the wrong sign."
            ),
            statement="4.8-smallest",
        ),
        Claim(
            what="With CT larger force is required than with P.",
            thesis="in the case CT, larger force is required",
            ours=f"mean peaks {in_words(_mean(found, CHOSEN, 'peak'), 'N')}",
            gate="95 % interval of the paired difference above zero",
            holds=less(peak["P"], peak["CT"]),
            statement="4.8-threshold",
        ),
        Claim(
            what="The positions are alike in the three cases.",
            thesis="the position trajectories are similar to each other",
            ours=f"RMS distance from P by the stroke: {in_words(alike, '%', ('CT', 'HA'))}",
            gate="below 10 %",
            holds=max(alike.values()) < 10.0,
            statement="4.8-alike",
        ),
        Claim(
            what="With m = 2 kg and two filters in a row P is smallest.",
            thesis="smallest with P (with m = 1, G = 10, H = 2)",
            ours=f"mean peaks {in_words(_mean(found, OURS, 'peak'), 'N')}, positions {in_words(near, '%', ('CT', 'HA'))} of "
            "the stroke from P; "
            f"ran away: {_away(found, OURS)}",
            gate="P below CT and HA, 95 % interval of the paired difference",
            holds=less(own["P"], own["CT"]) and less(own["P"], own["HA"]),
            why="CT lacks the friction at low speed; HA keeps the friction of the stroke before, which the hand has to undo.",
        ),
        *(
            Claim(
                what=f"{name}: the force of the hand.",
                ours=f"mean peaks {in_words(_mean(found, name, 'peak'), 'N')}; ran away: {_away(found, name)}",
                holds=None,
            )
            for name in CONDITIONS
            if name not in MANY
        ),
    )


def draw(outcome: Outcome) -> Any:
    """Return the figure: a column a case, position above, force below."""
    data, cases = outcome.data, outcome.data["cases"]
    t = data["time"]
    with house_style():
        figure, axes = own.sheet(2, len(cases), height=330.0, sharex=True, sharey="row")
        for column, (case, series) in enumerate(cases.items()):
            above, below = axes[:, column]
            above.plot(t, 1e3 * series["position"], color=LIGHT.ink, linewidth=1.3)
            below.plot(t, series["force"], color=own.COLORS[case], linewidth=1.0)
            own.level(below)
            peak = outcome.numbers[f"{CHOSEN}.{case}.peak"]
            for sign in (1.0, -1.0):
                below.axhline(sign * peak, color=LIGHT.muted, linewidth=0.9, linestyle=own.DASHED, zorder=1)
            own.name(above, case)
            own.name(below, x="time [s]")
        axes[0, 0].set_ylabel("position [mm]", color=LIGHT.ink)
        axes[1, 0].set_ylabel("force sensor [N]", color=LIGHT.ink)
        axes[1, 0].plot([], [], color=LIGHT.muted, linewidth=0.9, linestyle=own.DASHED, label="mean peak")
        own.key(axes[1, 0], "upper right")
        most = max(float(np.abs(series["force"]).max()) for series in cases.values())
        axes[1, 0].set_ylim(-1.1 * most, 1.35 * most)
    return figure
