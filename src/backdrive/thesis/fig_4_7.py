"""Fig. 4.7 of Iwatani 2017: three estimates of the force of a hand that moves Setup A without any actuator force."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.control.estimators.external import ExternalForce
from backdrive.control.estimators.friction import FrictionEstimator
from backdrive.control.estimators.sliding_mode import MotionFilter
from backdrive.report.pictures.canvas import LIGHT, house_style
from backdrive.simulation.closed_loop import Record, Scene, play
from backdrive.thesis import _sensorless_plots as own
from backdrive.thesis._balance import balance
from backdrive.thesis._sensorless import (
    CASCADE,
    CASES,
    HAND_A,
    INERTIA,
    LITERAL,
    PERIOD,
    REST,
    estimators,
    in_words,
    lag,
    metronome,
    rms,
)
from backdrive.thesis.fig_3_4 import identify_rate
from backdrive.thesis.outcome import Claim, Outcome
from backdrive.thesis.scatter import less
from backdrive.thesis.setups import RATIO, setups

SEEDS, CYCLES = 10, 8
HOLD, FREE = 2.0, 2.0  # at the end [s]
SETTLE = 1.0  # after the hand has let go, before an estimate is read [s]
SHOWN = 4.5  # of the strokes, before the hold [s]
MEASURES = ("rms", "lag", "held", "slow", "moving", "after")
FILTERS = {"cascade": CASCADE, "literal": LITERAL}


def run(seed: int = 0, seeds: int = SEEDS, cycles: int = CYCLES, ratio: float = RATIO) -> Outcome:
    """Move Setup A by hand and estimate the hand's force from the same log with CT, HA and P.

    Args:
        seed: of the first of the hands.
        seeds: number of hands.
        cycles: of the metronome.
        ratio: K_c by K [-].
    """
    plant = setups(ratio)["setup_a"]
    friction = estimators(plant, identify_rate(plant, seed))
    motions = [metronome(cycles, seed + i, hold=HOLD, free=FREE) for i in range(seeds)]
    records = play([Scene(plant=plant, motion=m, hand=HAND_A, seed=seed + i) for i, m in enumerate(motions)])
    found = {
        name: {
            case: np.array([_measure(r, _estimate(r, friction[case], filter_)) for r in records])
            for case in CASES
        }
        for name, filter_ in FILTERS.items()
    }  # filter -> case -> (seeds, measures)
    force = float(np.mean([rms(r.force[r.scene.motion.grip > 0.0]) for r in records]))
    means = {
        name: {m: {c: float(v[c][:, i].mean()) for c in CASES} for i, m in enumerate(MEASURES)}
        for name, v in found.items()
    }
    numbers = {
        f"{name}.{m}.{c}": x for name, v in means.items() for m, by in v.items() for c, x in by.items()
    }
    return Outcome(
        name="fig-4.7",
        title="External force of a hand on Setup A, estimated without actuator force",
        setting=(
            f"Setup A, moved by a hand of 800 N/m and 40 N s/m: {cycles} cycles of 0.06 m to a metronome of 0.667 Hz, "
            "held for 2 s, "
            f"let go; {seeds} hands. K = 1.2e6 N/m, M = 10 kg, alpha = 20 1/s, V = 0.01 m/s put half a count above two counts. The "
            "friction curve is identified, the filter of the acceleration as printed (G = 10, H = 2). RMS force of the "
            f"hand {force:.1f} N; sensor with 0.2 N of noise."
        ),
        claims=(*_claims(found, means), balance(records)),
        data=_figure_data(records[0], friction),
        numbers=numbers,
    )


def _estimate(record: Record, friction: FrictionEstimator, filter_: MotionFilter) -> np.ndarray:
    external = ExternalForce(inertia=INERTIA, friction=friction, filter=filter_)
    return external.run(record.reading, record.command, PERIOD)[0]


def _measure(record: Record, estimate: np.ndarray) -> tuple[float, ...]:
    """Return the numbers of `MEASURES` for one log."""
    grip, speed = record.scene.motion.grip > 0.0, np.abs(record.load_velocity)
    error, begun = estimate - record.sensed, record.time > 0.5
    two_counts = 2.5 * record.scene.plant.encoder_count / PERIOD
    free = record.time > record.time[grip][-1] + SETTLE
    return (
        rms(error[grip]),
        lag(estimate[grip], record.sensed[grip]),
        rms(error[grip & begun & (speed < REST)]),
        rms(error[grip & (speed >= REST) & (speed < two_counts)]),
        rms(error[grip & (speed >= two_counts)]),
        float(np.mean(np.abs(estimate[free] - record.force[free]))),
    )


def _figure_data(record: Record, friction: dict[str, FrictionEstimator]) -> dict[str, Any]:
    grip = record.scene.motion.grip > 0.0
    released = float(record.time[grip][-1])
    at = record.time > released - HOLD - 0.5 - SHOWN
    return {
        "time": record.time[at] - record.time[at][0],
        "released": released - record.time[at][0],
        "position": record.load[at].copy(),
        "sensor": record.sensed[at].copy(),
        "estimates": {case: _estimate(record, friction[case], LITERAL)[at] for case in CASES},
    }


def _claims(found: dict[str, dict[str, np.ndarray]], means: dict[str, Any]) -> tuple[Claim, ...]:
    def column(name: str, measure: str) -> dict[str, np.ndarray]:
        return {case: found[name][case][:, MEASURES.index(measure)] for case in CASES}

    error, late, after = (column("literal", measure) for measure in ("rms", "lag", "after"))
    ours, ours_late, ours_after = (means["cascade"][measure] for measure in ("rms", "lag", "after"))
    printed = means["literal"]
    return (
        Claim(
            what="The estimate of P is the closest to the force sensor.",
            thesis="the curve in the estimator P is the closest to the curve of the force sensor",
            ours=f"RMS error {in_words(printed['rms'], 'N')}; with two filters in a row {in_words(ours, 'N')}",
            gate="P below CT and HA, 95 % interval of the paired difference",
            holds=less(error["P"], error["CT"]) and less(error["P"], error["HA"]),
            why="CT has no friction at low speed, and HA keeps the full friction at rest.",
            statement="4.7-closest",
        ),
        Claim(
            what="The estimate of CT is late.",
            thesis="the response of the estimator was delayed due to the dead zone",
            ours=(
                f"lag {in_words({c: 1e3 * x for c, x in printed['lag'].items()}, 'ms')}; with two filters in a row "
                f"{in_words({c: 1e3 * x for c, x in ours_late.items()}, 'ms')}"
            ),
            gate="later than P, 95 % interval of the paired difference",
            holds=less(late["P"], late["CT"]),
            why="What P lags by is the filter of the acceleration.",
            statement="4.7-late",
        ),
        Claim(
            what="With HA an error stays after the motion has stopped.",
            thesis="in the estimator HA, there is steady state error in the estimation after the motion stops",
            ours=(
                f"mean error after the hand has let go {in_words(printed['after'], 'N', digits=2)}; with two filters in a row "
                f"{in_words(ours_after, 'N', digits=2)}"
            ),
            gate="HA above P, 95 % interval of the paired difference",
            holds=less(after["P"], after["HA"]),
            why="HA holds its spring where it stopped; the spring of P leaks at 20 1/s.",
            statement="4.7-steady",
        ),
        Claim(
            what="The three where the hand holds the joint at rest.",
            ours=f"RMS error with the joint held at rest, two filters in a row {in_words(means['cascade']['held'], 'N')}",
            holds=None,
            why=(
                "CT and P estimate the friction of a stuck joint as zero, while its true friction may have any value up to the "
                "Coulomb force. CT drops to zero at once, P with its decay rate."
            ),
        ),
    )


NAMES = {"CT": "CT: dead zone", "HA": "HA: elastoplastic", "P": "P: proposed"}


def draw(outcome: Outcome) -> Any:
    """Return the figure: position, then each estimate on the measured force."""
    data = outcome.data
    t = data["time"]
    with house_style():
        figure, axes = own.sheet(4, 1, height=560.0, sharex=True)
        top = axes[0, 0]
        top.plot(t, 1e3 * data["position"], color=LIGHT.ink, linewidth=1.3)
        own.name(top, y="position [mm]")
        own.release(top, data["released"], label="hand lets go")
        for (a,), case in zip(axes[1:], NAMES, strict=False):
            a.plot(t, data["sensor"], color=own.SENSOR, linewidth=own.THICK, zorder=3, label="force sensor")
            a.plot(t, data["estimates"][case], color=own.COLORS[case], linewidth=own.THIN, label=NAMES[case])
            own.level(a)
            own.release(a, data["released"])
            own.name(a, y="force [N]")
            own.key(a, "upper right", 2)
        low = min(float(e.min()) for e in [data["sensor"], *data["estimates"].values()])
        high = max(float(e.max()) for e in [data["sensor"], *data["estimates"].values()])
        for (a,) in axes[1:]:
            a.set_ylim(1.05 * low, 1.25 * high)
        axes[-1, 0].set_xlim(t[0], t[-1])
        own.name(axes[-1, 0], x="time [s]", y="force [N]")
    return figure
