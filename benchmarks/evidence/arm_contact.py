"""Contacts by a threshold for one false alarm an hour: how many come in free motion that nothing was tuned on, and steps noticed.

Threshold by state of motion, calibrated on hours of free motion of the same joint (its tail: generalised Pareto over a high
threshold), for one false contact an hour. Judged on other free motion of 20 hours: at most 2 an hour. Steps of force of 1.5
thresholds of the state, the joint moving, both ways: noticed within 50 ms, the estimator's lag included, in 95 %. Joint, friction,
integration and motion are those of `_independent`; the model is identified from one sweep by `backdrive.identify`.

    python benchmarks/evidence/arm_contact.py [--short] [--seed N]

`--short` judges fewer hours, and falls short only where the exact interval of the rate lies above the limit.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
from _common import Judge, first_seed, parser
from _contact_joint import BLOCK, LENGTH, NAME, free, identification, stepped
from scipy.stats import chi2

from backdrive import FrictionModel, Log, identify
from backdrive.external import ForceEstimate, Threshold, estimate_force
from backdrive.external.calibrate import Calibration, calibrate
from backdrive.external.contacts import half_bands, mark_contacts, with_contacts

HOURS = {False: (5.0, 20.0, 300), True: (1.0, 2.0, 60)}  # short -> of calibration, of judging, and steps
RATE, MOST = 1.0, 2.0  # false contacts, wanted and allowed [1/h]
STEP, WITHIN, SHARE = 1.5, 0.05, 0.95  # thresholds, [s], of the steps


def poisson(count: int, hours: float, level: float = 0.95) -> tuple[float, float]:
    """Return the exact two-sided interval of a rate by its count [1/h]."""
    tail = 0.5 * (1.0 - level)
    low = 0.5 * chi2.ppf(tail, 2 * count) if count else 0.0
    return float(low / hours), float(0.5 * chi2.ppf(1.0 - tail, 2 * count + 2) / hours)


def one_estimate(model: FrictionModel, log: Log, how: dict) -> ForceEstimate:
    """Return an estimate as in the calibration."""
    return estimate_force(model, log, **how)


def thresholds(
    model: FrictionModel, hours: float, rng: np.random.Generator
) -> tuple[Calibration, ForceEstimate, dict]:
    """Return what hours of free motion calibrate, and how the estimates are made, by the command's own choice."""
    logs = [free(rng)]
    chosen = estimate_force(model, logs[0], free=logs, false_alarms=RATE).joints[0]
    how = {"method": chosen.method, "bandwidth": chosen.bandwidth}
    estimates = [one_estimate(model, logs.pop(), how)]
    while len(estimates) * BLOCK < hours * 3600.0:
        estimates.append(one_estimate(model, free(rng), how))
    calibration = calibrate([e.joints[0] for e in estimates])
    first = replace(estimates[0], joints=calibration.forces[:1], calibrations={NAME: calibration})
    return calibration, with_contacts(first, RATE), how


def table(marks: tuple[Threshold, ...], halves: list[float], unit: str) -> None:
    """Print thresholds by state."""
    print(
        f"  {'joint':8s}{'state':12s}{'half band':>14s}{'threshold, bands':>18s}{'between':>16s}{'peaks':>7s}{'hours':>8s}"
    )
    for t, half in zip(marks, halves):
        ends = f"{t.interval[0]:.2f} {t.interval[1]:.2f}"
        print(
            f"  {t.joint:8s}{t.state:12s}{half:10.3f} {unit}{t.bands:18.2f}{ends:>16s}{t.peaks:7d}{t.hours:8.2f}"
        )


def false_contacts(
    model: FrictionModel,
    calibration: Calibration,
    marks: tuple[Threshold, ...],
    how: dict,
    hours: float,
    rng: np.random.Generator,
) -> tuple[int, float, np.ndarray]:
    """Return the contacts of unseen free motion, its hours, and the share within the bands by state."""
    count, duration, inside = 0, 0.0, np.zeros((3, 2))
    while duration < hours:
        e = one_estimate(model, free(rng), how)
        one = calibration.apply(e.joints[0])
        marked = mark_contacts(replace(e, joints=(one,)), marks)
        count += len(marked.contacts or ())
        duration += (one.time[-1] - one.time[0]) / 3600.0
        for state in range(3):
            part = one.state == state
            inside[state] += np.count_nonzero(part & ~one.outside), np.count_nonzero(part)
    return count, duration, inside[:, 0] / np.maximum(inside[:, 1], 1.0)


def noticed(
    model: FrictionModel,
    calibration: Calibration,
    marks: tuple[Threshold, ...],
    how: dict,
    steps: int,
    rng: np.random.Generator,
) -> tuple[int, int, np.ndarray]:
    """Return how many steps were noticed in time, of how many, and how late those were that were noticed at all [s]."""
    height = STEP * marks[0].bands * (calibration.moving.half_width if calibration.moving else np.nan)
    lag = calibration.forces[0].lag
    late: list[float] = []
    total = 0
    while total < steps:
        seed = int(rng.integers(2**31))
        dry, instants = stepped(np.random.default_rng(seed), 300.0, None)
        heights = height * rng.choice([-1.0, 1.0], instants.size)
        wet, _ = stepped(np.random.default_rng(seed), 300.0, heights)
        still = one_estimate(model, dry, how).joints[0]
        e = one_estimate(model, wet, how)
        marked = mark_contacts(replace(e, joints=(calibration.apply(e.joints[0]),)), marks)
        begins = np.array([c.begin for c in marked.contacts or ()]) + (0.0 if np.isnan(lag) else lag)
        for t in instants[
            still.state[np.searchsorted(still.time, instants).clip(0, still.time.size - 1)] == 0
        ]:
            after = begins[(begins >= t) & (begins < t + LENGTH)]
            late.append(float(after.min() - t) if after.size else np.inf)
            total += 1
    delays = np.array(late)
    return int(np.count_nonzero(delays <= WITHIN)), total, delays


def single_joint(judge: Judge, short: bool, seed: int) -> None:
    """Judge a single joint."""
    calibrating, judging, steps = HOURS[short]
    rng = np.random.default_rng(seed)
    begun = time.perf_counter()
    model = identify(identification(rng)).model
    calibration, reference, how = thresholds(model, calibrating, rng)
    marks, unit = reference.thresholds, reference.joints[0].joint.torque_unit
    print(
        f"\nsingle joint: {how['method']}, {how['bandwidth']:.3g} 1/s; free motion of {calibration.duration / 3600.0:.2f} h"
    )
    table(marks, half_bands(calibration.forces[0]), unit)
    for sentence in reference.remarks:
        print(f"  {sentence}")
    count, hours, shares = false_contacts(model, calibration, marks, how, judging, rng)
    low, high = poisson(count, hours)
    print(
        "  unseen free motion within the 95 % band: "
        + ", ".join(f"{100 * s:.1f} %" for s in shares)
        + " (moving, reversing, rest)"
    )
    rate = f"{count} false contacts in {hours:.1f} h, {count / hours:.2f} an hour (exactly {low:.2f} to {high:.2f})"
    judge.that(f"single joint: {rate}, at most {MOST:g}", (low if short else count / hours) <= MOST)
    hit, total, delays = noticed(model, calibration, marks, how, steps, rng)
    seen = np.isfinite(delays)
    print(
        f"  steps of {STEP:g} thresholds, moving: {np.median(delays[seen]) * 1e3:.0f} ms in the median, "
        f"{np.count_nonzero(~seen)} of {total} never"
    )
    judge.that(
        f"single joint: {hit} of {total} steps within {1e3 * WITHIN:.0f} ms, {100 * hit / total:.1f} % (at least 95 %)",
        hit >= SHARE * total,
    )
    print(f"  {time.perf_counter() - begun:.0f} s")


def main() -> None:
    """Judge."""
    options = parser(__doc__)
    options.add_argument("--seed", type=int, help="first seed")
    given = options.parse_args()
    judge = Judge()
    single_joint(judge, given.short, first_seed(given.seed))
    judge.end()


if __name__ == "__main__":
    main()
