"""Fig. 4.10 of Iwatani 2017: the measured force beside that on the virtual object, m q'' + b q', (4.19)."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.report.pictures.canvas import house_style
from backdrive.thesis import _sensorless_plots as own
from backdrive.thesis._guided import compare
from backdrive.thesis._sensorless import CASES, LITERAL, PERIOD, in_words, lag, ranks, rms, virtual_force
from backdrive.thesis.fig_4_8 import CHOSEN, CONDITIONS, CYCLES, SEEDS, SHOWN, admit
from backdrive.thesis.outcome import Claim, Outcome

SHORT = 8  # cycles with the filter as printed


def run(seed: int = 0, seeds: int = SEEDS, cycles: int = CYCLES) -> Outcome:
    """Compare the force sensor with (4.19) in the runs of Fig. 4.8.

    Args:
        seed: of the first of the hands.
        seeds: number of hands.
        cycles: of the metronome.
    """
    admittance = CONDITIONS[CHOSEN][0]
    records = admit(CHOSEN, seed, seeds, cycles)
    virtual = {case: [virtual_force(r, admittance) for r in runs] for case, runs in records.items()}
    pairs = {case: list(zip(runs, virtual[case])) for case, runs in records.items()}
    distance = {case: np.array([rms(r.sensed - f) for r, f in pairs[case]]) for case in CASES}
    delay = {case: np.array([lag(f, r.sensed) for r, f in pairs[case]]) for case in CASES}
    forced = {case: np.array([rms(r.sensed) for r, _ in pairs[case]]) for case in CASES}
    printed = admit("m = 2, filter as printed", seed, min(seeds, 2), min(cycles, SHORT))
    literal = {
        case: float(np.mean([rms(r.sensed - virtual_force(r, admittance, LITERAL)) for r in runs]))
        for case, runs in printed.items()
    }
    at = slice(0, round(SHOWN / PERIOD))
    numbers = {f"distance.{c}": float(distance[c].mean()) for c in CASES}
    numbers |= {f"lag.{c}": float(delay[c].mean()) for c in CASES}
    numbers |= {f"force.{c}": float(forced[c].mean()) for c in CASES}
    numbers |= {f"literal.distance.{c}": literal[c] for c in CASES}
    return Outcome(
        name="fig-4.10",
        title="Measured force and force on the virtual object, Setup A",
        setting=(
            f"The runs of Fig. 4.8: m = 2 kg, b = 15 N s/m, {cycles} cycles with each of {seeds} hands. Velocity and "
            "acceleration in (4.19) "
            "come from the encoder through the cascade filter."
        ),
        claims=_claims(distance, delay, forced, literal),
        data={
            "time": records["P"][0].time[at],
            "cases": {
                case: {"sensor": 1.0 * runs[0].sensed[at], "virtual": 1.0 * virtual[case][0][at]}
                for case, runs in records.items()
            },
        },
        numbers=numbers,
    )


def _claims(
    distance: dict[str, np.ndarray],
    delay: dict[str, np.ndarray],
    forced: dict[str, np.ndarray],
    literal: dict[str, float],
) -> tuple[Claim, ...]:
    n = distance["P"].size
    ordered = ranks(distance)
    mean = {c: float(distance[c].mean()) for c in CASES}
    share = {c: 100.0 * float(np.mean(distance[c] / forced[c])) for c in CASES}
    late = {c: 1e3 * float(delay[c].mean()) for c in CASES}
    tests = ""
    if n > 1:
        near, far = compare(distance["CT"], distance["P"]), compare(distance["HA"], distance["CT"])
        tests = (
            f"; CT - P {near.difference:.2f} N [{near.low:.2f}, {near.high:.2f}], HA - CT {far.difference:.2f} N "
            f"[{far.low:.2f}, {far.high:.2f}]"
        )
    return (
        Claim(
            what="The measured force is closest to (4.19) with P.",
            thesis="the magnitude of the measured force is closer to the trajectories of (4.19) with P",
            ours=f"RMS distance {in_words(mean, 'N', digits=2)}; in this order with {ordered} of {n} hands{tests}",
            gate="P < CT < HA with every hand",
            holds=ordered == n,
            why=f"By the RMS force that is {in_words(share, '%', digits=0)}: the virtual object is not reached with any of them.",
        ),
        Claim(
            what="(4.19) is late in all three.",
            thesis="phase lags in (4.19) due to the filter in Q in all three conditions",
            ours=f"{in_words(late, 'ms', digits=0)}",
            gate="above 5 ms in every run",
            holds=min(float(delay[c].min()) for c in CASES) > 5e-3,
            why="Part of it is the filter; the rest is the force that the hand builds up before the joint breaks away.",
        ),
        Claim(
            what="With the filter as printed the order of P and HA is lost.",
            thesis="G = 10, H = 2",
            ours=f"RMS distance {in_words(literal, 'N', digits=1)}, (4.19) through the same filter",
            holds=None,
            why="(4.19) then is the filter's noise, m times 10 m/s^2, and the joint shakes in all three (Fig. 4.8).",
        ),
    )


def draw(outcome: Outcome) -> Any:
    """Return the figure: a row a case."""
    data, cases = outcome.data, outcome.data["cases"]
    t = data["time"]
    with house_style():
        figure, axes = own.sheet(len(cases), 1, height=480.0, sharex=True, sharey=True)
        for (a,), (case, series) in zip(axes, cases.items()):
            a.plot(t, series["sensor"], color=own.SENSOR, linewidth=1.0, label="force sensor")
            a.plot(t, series["virtual"], color=own.COLORS[case], linewidth=1.3, label="m q'' + b q'")
            own.level(a)
            distance = outcome.numbers[f"distance.{case}"]
            own.name(a, f"{case}: RMS distance {distance:.1f} N", y="force [N]")
            a.set_xlim(t[0], t[-1])
        low, high = axes[0, 0].get_ylim()
        axes[0, 0].set_ylim(low, high + 0.25 * (high - low))
        own.key(axes[0, 0], "upper right", 2)
        axes[-1, 0].set_xlabel("time [s]")
    return figure
