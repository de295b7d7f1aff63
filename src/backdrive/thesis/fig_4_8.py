"""Fig. 4.8 of Iwatani 2017: sensorless admittance control of Setup A with three friction estimators."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from backdrive.control.admittance import Admittance
from backdrive.control.estimators.friction import NOTHING
from backdrive.control.estimators.sliding_mode import MotionFilter
from backdrive.engine.servo import Servo
from backdrive.report.pictures.canvas import LIGHT, house_style
from backdrive.simulation.closed_loop import Record, Scene, play
from backdrive.simulation.hand import still
from backdrive.simulation.machines import setup_a
from backdrive.thesis import _sensorless_plots as own
from backdrive.thesis._guided import SIDES, compare, peaks
from backdrive.thesis._sensorless import (
    ADMITTANCE,
    CASCADE,
    CASES,
    LITERAL,
    PERIOD,
    REST,
    STROKE,
    admitted,
    estimators,
    in_words,
    metronome,
    ran_away,
    ranks,
    rms,
    virtual_force,
)
from backdrive.thesis.fig_3_4 import identified
from backdrive.thesis.outcome import Claim, Outcome

SEEDS, CYCLES = 6, 30
FEW, SHORT = 2, 8  # seeds and cycles of the conditions beside
PRINTED = Admittance(inertia=1.0, viscosity=15.0, proportional=1e5, derivative=1e3, limit=600.0)
SHOWN = 6.0  # of the figure [s]

#: Condition -> virtual object, filter, delay [s].
CONDITIONS: dict[str, tuple[Admittance, MotionFilter, float]] = {
    "m = 2": (ADMITTANCE, CASCADE, 0.0),
    "m = 1": (PRINTED, CASCADE, 0.0),
    "m = 2, filter as printed": (ADMITTANCE, LITERAL, 0.0),
    "m = 1, filter as printed": (PRINTED, LITERAL, 0.0),
    "m = 1.5": (replace(PRINTED, inertia=1.5), CASCADE, 0.0),
    "m = 1, softer": (replace(PRINTED, proportional=3e4, derivative=300.0), CASCADE, 0.0),
    "m = 2, one sample late": (ADMITTANCE, CASCADE, PERIOD),
    "m = 2, one sample late, softer": (
        replace(ADMITTANCE, proportional=3e4, derivative=300.0),
        CASCADE,
        PERIOD,
    ),
}
CHOSEN, LITERALLY = "m = 2", "m = 2, filter as printed"

Records = Mapping[str, Sequence[Record]]  # case -> a record a seed


def admit(
    condition: str, seed: int, seeds: int, cycles: int, cases: Sequence[str] = CASES
) -> dict[str, list[Record]]:
    """Return Setup A in the hand under admittance control, by case, one record a seed.

    Args:
        condition: of `CONDITIONS`.
        seed: of the first hand.
        seeds: number of hands.
        cycles: of the metronome.
        cases: CT, HA, P or `none`, which takes friction for nothing.
    """
    plant = setup_a()
    friction = estimators(plant, identified(plant, seed)) | {"none": NOTHING}
    admittance, filter_, delay = CONDITIONS[condition]
    motions = [metronome(cycles, seed + i) for i in range(seeds)]
    scenes = [
        admitted(
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


def run(seed: int = 0, seeds: int = SEEDS, cycles: int = CYCLES) -> Outcome:
    """Guide the admittance-controlled Setup A by hand with CT, HA and P.

    Args:
        seed: of the first of the hands.
        seeds: number of hands.
        cycles: of the metronome.
    """
    short = min(cycles, SHORT)
    records = admit(CHOSEN, seed, seeds, cycles)
    found = {CHOSEN: _measured(records, CHOSEN, cycles)}
    for name in CONDITIONS:
        if name != CHOSEN:
            found[name] = _measured(admit(name, seed, min(seeds, FEW), short), name, short)
    bare = {name: _without_model(name, seed, min(seeds, FEW), short) for name in (CHOSEN, LITERALLY)}
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
            f"{seeds} hands. Virtual object 2 kg, 15 N s/m; K_p = 1e5 N/m, K_d = 1e3 N s/m; cascade filter, no delay beyond the "
            "sampling; the estimator gets the command of the tick before. Peaks are the largest measured forces of "
            "each 1.5 s. Beside it: "
            "m = 1 kg and the filter as printed, and one sample of delay more."
        ),
        claims=_claims(found, seeds, bare, _controller_alone(seed)),
        data=_shown(records),
        numbers=numbers,
    )


def _without_model(condition: str, seed: int, seeds: int, cycles: int) -> float:
    """Return the mean peak of the hand's force where the estimator takes friction for nothing [N]."""
    runs = admit(condition, seed, seeds, cycles, ("none",))["none"]
    return float(np.mean([peaks({"none": r}, cycles)["none"] for r in runs]))


def _controller_alone(seed: int) -> tuple[float, float]:
    """Return the RMS command of the position controller on a given motion with one sample of delay and without [N]."""
    plant, motion = setup_a(), metronome(2, seed)
    servo = Servo(proportional=ADMITTANCE.proportional, derivative=ADMITTANCE.derivative)
    target = np.stack([motion.position, motion.velocity], axis=1)
    late, prompt = play(
        [
            Scene(
                plant=plant,
                motion=still(len(motion.position)),
                controller=servo,
                target=target,
                delay=delay,
                seed=seed,
            )
            for delay in (PERIOD, 0.0)
        ]
    )
    return rms(late.command), rms(prompt.command)


def _measured(records: Records, condition: str, cycles: int) -> dict[str, dict[str, np.ndarray]]:
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
            "command": np.array([rms(r.command[s]) for r, s in zip(runs, still)]),
            "restless": np.array([np.mean(np.abs(r.load_velocity[s]) > REST) for r, s in zip(runs, still)]),
            "apart": np.array([rms(r.load - p.load) for r, p in zip(runs, records["P"])]),
            "away": np.array([ran_away(r) for r in runs]),
        }
    return measured


def _shown(records: Records) -> dict[str, Any]:
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


def _claims(
    found: Any, seeds: int, bare: Mapping[str, float], alone: tuple[float, float]
) -> tuple[Claim, ...]:
    chosen = found[CHOSEN]
    sides = [{case: float(chosen[case]["peak"][:, i].mean()) for case in CASES} for i in range(2)]
    spread = [{case: float(chosen[case]["peaks"][:, :, i].std(ddof=1)) for case in CASES} for i in range(2)]
    ordered = ranks({case: chosen[case]["peak"] for case in CASES})
    tests = [
        f"{worse} - {better} {side} {c.difference:.1f} N [{c.low:.1f}, {c.high:.1f}], d = {c.effect:.1f}, p {_p(c.p)}"
        for better, worse in (("P", "CT"), ("CT", "HA"))
        for i, side in enumerate(SIDES)
        for c in [compare(chosen[worse]["peaks"][:, :, i].ravel(), chosen[better]["peaks"][:, :, i].ravel())]
    ]
    alike = {case: 100.0 * float(np.mean(chosen[case]["apart"])) / STROKE for case in ("CT", "HA")}
    close = ranks({case: chosen[case]["criterion"] for case in CASES})
    one, both = "m = 1", "m = 1, filter as printed"
    printed, late = LITERALLY, "m = 2, one sample late"
    soft = "m = 2, one sample late, softer"
    return (
        Claim(
            what="The force that the hand needs is smallest with P.",
            thesis="the external force measured by the force sensor is smallest with P; larger force is required with CT and HA",
            ours=(
                f"mean peaks along +q {in_words(sides[0], 'N')}, along -q {in_words(sides[1], 'N')} (standard deviations "
                f"{in_words(spread[0], 'N')}; {in_words(spread[1], 'N')}); {'; '.join(tests)}"
            ),
            gate="P < CT < HA in both directions with every hand",
            holds=ordered == seeds,
            why="CT lacks the friction at low speed; HA keeps the friction of the stroke before, which the hand has to undo.",
        ),
        Claim(
            what="What the hand feels is closest to the virtual object with P.",
            thesis="closer with P (Fig. 4.10)",
            ours=f"RMS of force less (4.19) {in_words(_mean(found, CHOSEN, 'criterion'), 'N')}",
            gate="P < CT < HA with every hand",
            holds=close == seeds,
        ),
        Claim(
            what="The positions are alike in the three cases.",
            thesis="the position trajectories are similar to each other",
            ours=f"RMS distance from P by the stroke: {in_words(alike, '%', ('CT', 'HA'))}; none ran away",
            gate="below 10 %",
            holds=max(alike.values()) < 10.0,
            why="HA is the farthest: the joint lags behind the hand by the force that it lacks.",
        ),
        Claim(
            what="With the printed m = 1 kg HA runs away and P is still the smallest.",
            thesis="m = 1.0, chosen as small as possible without oscillation",
            ours=(
                f"ran away: {_away(found, one)}; peaks {in_words(_mean(found, one, 'peak'), 'N')}. With m = 1.5 kg: "
                f"{_away(found, 'm = 1.5')}; with m = 1 kg and softer gains: {_away(found, 'm = 1, softer')}"
            ),
            holds=None,
            why=(
                "Softer gains (K_p = 3e4 N/m, K_d = 300 N s/m) do not help and 1.5 kg is heavy enough: it is the light "
                "virtual object, not "
                "the position controller. Joint and hand differ from the thesis', and so does the smallest m."
            ),
        ),
        Claim(
            what="With the filter as printed HA is no worse than P.",
            thesis="G = 10, H = 2",
            ours=(
                f"m = 2: peaks {in_words(_mean(found, printed, 'peak'), 'N')}; m = 1: "
                f"{in_words(_mean(found, both, 'peak'), 'N')}; RMS "
                f"command between strokes {in_words(_mean(found, printed, 'command'), 'N')} (cascade "
                f"{in_words(_mean(found, CHOSEN, 'command'), 'N')}), joint moving there "
                f"{in_words({c: 100 * x for c, x in _mean(found, printed, 'restless').items()}, '%', digits=0)} of the time"
            ),
            holds=None,
            why=(
                "Its acceleration switches by 100 N of this mass from tick to tick, which shakes the joint. So it "
                "never sticks, and HA "
                "never rests on a friction of the wrong sign. A dither alone it is not: without a friction model the same filter "
                f"needs {bare[LITERALLY]:.1f} N, the cascade {bare[CHOSEN]:.1f} N."
            ),
        ),
        Claim(
            what="With one sample of delay more all of them diverge.",
            ours=f"ran away: {_away(found, late)}; RMS force {in_words(_mean(found, late, 'force'), 'N', digits=0)}",
            gate="all",
            holds=all(found[late][case]["away"].all() for case in CASES),
            why=(
                "The printed gains leave no room for it: the same position controller alone, on a given motion and without any "
                f"estimate, gives {alone[0]:.0f} N RMS with one sample of delay and {alone[1]:.0f} N without. With K_p "
                "= 3e4 N/m and "
                f"K_d = 300 N s/m the delay is borne: peaks {in_words(_mean(found, soft, 'peak'), 'N')}."
            ),
        ),
    )


def _p(p: float) -> str:
    return "< 0.001" if p < 1e-3 else f"= {p:.2g}"


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
            peak = outcome.numbers[f"m = 2.{case}.peak"]
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
