"""Fig. 4.10 of Iwatani 2017: the measured force beside that on the virtual object, m q'' + b q', (4.19)."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.report.pictures.canvas import house_style
from backdrive.thesis import _sensorless_plots as own
from backdrive.thesis._balance import balance
from backdrive.thesis._sensorless import CASES, PERIOD, in_words, lag, rms, virtual_force
from backdrive.thesis.fig_4_8 import CHOSEN, CONDITIONS, CYCLES, MANY, OURS, SEEDS, SHOWN, admit
from backdrive.thesis.outcome import Claim, Outcome
from backdrive.thesis.scatter import interval, less
from backdrive.thesis.setups import RATIO


def run(seed: int = 0, seeds: int = SEEDS, cycles: int = CYCLES, ratio: float = RATIO) -> Outcome:
    """Compare the force sensor with (4.19) in the runs of Fig. 4.8.

    Args:
        seed: of the first of the hands.
        seeds: number of hands.
        cycles: of the metronome.
        ratio: K_c by K [-].
    """
    found: dict[str, dict[str, dict[str, np.ndarray]]] = {}
    shown, sensed = {}, []
    at = slice(0, round(SHOWN / PERIOD))
    for name in MANY:
        admittance, filter_, _ = CONDITIONS[name]
        records = admit(name, seed, seeds, cycles, ratio=ratio)
        pairs = {c: [(r, virtual_force(r, admittance, filter_)) for r in runs] for c, runs in records.items()}
        found[name] = {
            "distance": {c: np.array([rms(r.sensed - f) for r, f in pairs[c]]) for c in CASES},
            "lag": {c: np.array([lag(f, r.sensed) for r, f in pairs[c]]) for c in CASES},
            "force": {c: np.array([rms(r.sensed) for r, _ in pairs[c]]) for c in CASES},
        }
        if name == CHOSEN:
            sensed = [r for runs in records.values() for r in runs]
            shown = {
                c: {"sensor": 1.0 * r.sensed[at], "virtual": 1.0 * f[at]} for c, ((r, f), *_) in pairs.items()
            }
    numbers = {
        f"{name}.{what}.{c}": float(values[c].mean())
        for name, by in found.items()
        for what, values in by.items()
        for c in CASES
    }
    return Outcome(
        name="fig-4.10",
        title="Measured force and force on the virtual object, Setup A",
        setting=(
            f"The runs of Fig. 4.8, {cycles} cycles with each of {seeds} hands: as printed, and with m = 2 kg and two "
            "filters in a row. "
            "Velocity and acceleration in (4.19) come from the encoder through the same filter."
        ),
        claims=(*_claims(found), balance(sensed, weightless=False)),
        data={"time": PERIOD * np.arange(len(next(iter(shown.values()))["sensor"])), "cases": shown},
        numbers=numbers,
    )


def _claims(found: dict[str, dict[str, dict[str, np.ndarray]]]) -> tuple[Claim, ...]:
    means = {
        name: {what: {c: float(v[c].mean()) for c in CASES} for what, v in by.items()}
        for name, by in found.items()
    }
    printed, ours = found[CHOSEN], found[OURS]
    late = {c: 1e3 * means[CHOSEN]["lag"][c] for c in CASES}
    late_ours = {c: 1e3 * means[OURS]["lag"][c] for c in CASES}
    near, near_ours = printed["distance"], ours["distance"]
    share = {c: 100.0 * means[OURS]["distance"][c] / means[OURS]["force"][c] for c in CASES}
    return (
        Claim(
            what="The measured force is closest to (4.19) with P.",
            thesis="the magnitude of the measured force is closer to the trajectories of the value of (4.19) with the estimator P",
            ours=f"RMS distance {in_words(means[CHOSEN]['distance'], 'N', digits=2)}",
            gate="P below CT and HA, 95 % interval of the paired difference",
            holds=less(near["P"], near["CT"]) and less(near["P"], near["HA"]),
            why_not="(4.19) through the printed filter is the filter's noise, m times 10 m/s^2, and the joint shakes in all "
            "three (Fig. 4.8).",
            statement="4.10-closer",
        ),
        Claim(
            what="(4.19) is late in all three.",
            thesis="we can see phase lags in (4.19) due to the filter in Q in all three conditions",
            ours=f"{in_words(late, 'ms', digits=0)}; with m = 2 kg and two filters in a row {in_words(late_ours, 'ms', digits=0)}",
            gate="mean above one tick in all three, 95 % interval",
            holds=all(interval(printed["lag"][c])[0] > PERIOD for c in CASES),
            statement="4.10-lag",
        ),
        Claim(
            what="With m = 2 kg and two filters in a row the measured force is closest to (4.19) with P.",
            ours=f"RMS distance {in_words(means[OURS]['distance'], 'N', digits=2)}, by the RMS force "
            f"{in_words(share, '%', digits=0)}",
            gate="P below CT and HA, 95 % interval of the paired difference",
            holds=less(near_ours["P"], near_ours["CT"]) and less(near_ours["P"], near_ours["HA"]),
        ),
    )


def draw(outcome: Outcome) -> Any:
    """Return the figure: a row a case."""
    data, cases = outcome.data, outcome.data["cases"]
    t = data["time"]
    with house_style():
        figure, axes = own.sheet(len(cases), 1, height=480.0, sharex=True, sharey=True)
        for (a,), (case, series) in zip(axes, cases.items(), strict=False):
            a.plot(t, series["sensor"], color=own.SENSOR, linewidth=own.THICK, zorder=3, label="force sensor")
            a.plot(t, series["virtual"], color=own.COLORS[case], linewidth=own.THIN, label="m q'' + b q'")
            own.level(a)
            distance = outcome.numbers[f"{CHOSEN}.distance.{case}"]
            own.name(a, f"{case}: RMS distance {distance:.1f} N", y="force [N]")
            a.set_xlim(t[0], t[-1])
        low, high = axes[0, 0].get_ylim()
        axes[0, 0].set_ylim(low, high + 0.25 * (high - low))
        own.key(axes[0, 0], "upper right", 2)
        axes[-1, 0].set_xlabel("time [s]")
    return figure
