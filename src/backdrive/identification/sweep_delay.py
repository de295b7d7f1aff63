"""The delay of the drive, from the windows of a sweep.

A torque that acts d later than it was commanded adds -I d dddq to the apparent friction. At one speed the jerk of cycle n is
-(2 n V / (A N))^2 times the speed. Cycles that pass the same speed with different jerk thus separate d from friction. All terms
are fitted together: a curve for each direction, inertia, gravity, I d and, if significant, friction proportional to the load.

The noise of the drive moves the joint, and the servo responds. Measured acceleration and jerk are therefore correlated with the
error of the torque. Least squares would mistake the loop's lag for a delay (1 ms on a simulated joint). The desired motion is
not correlated with that noise. A low pass above the frequency of the last cycle gives nearly this motion, which serves as the
instrument.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from backdrive.identification import lateness, regression
from backdrive.identification.curves import basis
from backdrive.identification.delay import torque_between
from backdrive.identification.function_a import correct_pairs
from backdrive.identification.noise import noise_of
from backdrive.identification.residual import residual_of
from backdrive.identification.signals import Signals
from backdrive.identification.slip import KNOWN, LONG, SURE, coarse_delay, is_long
from backdrive.identification.sweep_windows import Windows, windows
from backdrive.identification.timing import Timing, torque_timing
from backdrive.logs import filters
from backdrive.logs.log import Log

SHARE = 0.3  # samples faster than this share of a cycle's peak speed are used [-]
SIGNIFICANT = 4.0  # least significance of a growth of friction with the load [standard error]
CORNER = 6.5  # cutoff frequency of the low pass, relative to the frequency of the fastest cycle [-]
TOLD = 0.5  # largest standard error of an estimated delay; up to `KNOWN` it must be long for sure [sampling interval]
PLAIN = (
    2.0  # largest distance of the delay from that of a command or a sample without a remark [standard error]
)
BEYOND = (
    2.5  # least distance of a delay from those of a command and a sample, if a shift agrees [standard error]
)
USUAL = 0.004  # standard deviation of the delays of drives, about which a sweep may tell little [s]
ROUNDS = 4  # number of iterations, in each of which the torque is shifted by the last estimate of d


def sweep_delay(stretches: Sequence[Signals], cycles: Windows, start: float = 0.0) -> tuple[float, float]:
    """Return the time from the middle of a command's interval to the torque's effect, and its standard error [s].

    The time is 0 for a command that acts at once and is held. It is minus half a sampling interval for a torque sampled with
    the position.

    Args:
        stretches: the log's signals, from `prepare`.
        cycles: of the sweep.
        start: initial delay of the search [s].

    Returns:
        Delay and standard error [s]; NaN if the sweep has fewer than three cycles or no position, if the inertia is not
        positive, or if the delay is longer than any that is sought: another cause lags then, such as friction that builds up.
    """
    nothing = float("nan"), float("nan")
    if cycles.peak.size < 3 or any(s.position is None for s in stretches):
        return nothing
    slow, fast = float(cycles.peak.min()), float(cycles.peak.max())
    knots = np.concatenate([[SHARE * slow], np.linspace(slow, fast, 2 * cycles.peak.size - 1)])
    length = float(np.min(cycles.time[:, 1] - cycles.time[:, 0]))
    parts = [_part(s, cycles, CORNER / length) for s in stretches]
    *loaded, grows = _solve(stretches, parts, knots, True, start)
    delay, error = loaded if grows else _solve(stretches, parts, knots, False, start)[:2]
    return (delay, error) if abs(delay) <= lateness.LATEST else nothing


def _solve(
    stretches: Sequence[Signals], parts: Sequence[Any], knots: np.ndarray, loaded: bool, start: float = 0.0
) -> tuple[float, float, bool]:
    """Return delay and standard error [s], and whether friction grows with the load."""
    delay, inverse, theta, y = start, np.zeros((1, 1)), np.zeros(2), []
    plain = regressors = [
        (_regressor(real, knots), _regressor(wanted, knots)) for _, real, wanted, _ in parts
    ]
    for k in range(ROUNDS):
        y = [torque_between(s, delay)[rows] for s, (rows, *_) in zip(stretches, parts, strict=True)]
        if k > 0 and loaded:  # the load follows from the last estimate of gravity and inertia
            regressors = [
                (_with_load(X, real, theta), _with_load(Z, wanted, theta))
                for (X, Z), (_, real, wanted, _) in zip(plain, parts, strict=True)
            ]
        moments = [(Z.T @ X, Z.T @ f) for (X, Z), f in zip(regressors, y, strict=True)]
        inverse = regression.invert(np.sum([m[0] for m in moments], axis=0))
        theta = inverse @ np.sum([m[1] for m in moments], axis=0)
        if not theta[0] > 0:
            return float("nan"), float("nan"), False
        delay -= float(theta[1] / theta[0])
    runs = [
        ((f - X @ theta)[a:b], real[1][a:b], Z[a:b].T)
        for (X, Z), (_, real, _, edges), f in zip(regressors, parts, y, strict=True)
        for a, b in edges
    ]
    # a cubic is removed as well, since the deviation of the curve from straight sections is not noise
    noise = noise_of([left for left, _, _ in runs], [v for _, v, _ in runs], degree=3)
    spread = sum(noise.covariance(z, i) for i, (_, _, z) in enumerate(runs))
    error = np.sqrt(np.diag(inverse @ spread @ inverse.T))
    grows = loaded and bool(theta[-2] > SIGNIFICANT * error[-2])
    return delay, float(error[1] / theta[0]), grows


def drive_delays(
    logs: Sequence[Log],
    joint: str,
    stretches: Sequence[Sequence[Signals]],
    timing: Timing | None,
    literal: bool,
    known_late: float | None = None,
) -> tuple[list[float], list[float], list[str]]:
    """Return for each log the time from the middle of a command's interval to the torque's effect [s] and its standard error
    [s], and remarks.
    """
    if known_late is not None:
        return [-0.5 / s[0].rate - known_late for s in stretches], [0.0] * len(stretches), []
    told: list[str | None] = [timing or "command"] * len(stretches)
    if timing is None and not literal:
        told = [torque_timing(s)[0] for s in stretches]
    delays = [-0.5 / s[0].rate if t == "sample" else 0.0 for s, t in zip(stretches, told, strict=True)]
    errors = [0.0] * len(stretches)
    open_ = [i for i, t in enumerate(told) if t is None]
    if not open_:
        return delays, errors, []
    period = 1.0 / stretches[open_[0]][0].rate
    cycles = [windows(logs[i], joint, logs[i].plan, stretches[i]) for i in open_]
    delay, error = _together([sweep_delay(stretches[i], c) for i, c in zip(open_, cycles, strict=True)])
    every = [s for i in open_ for s in stretches[i]]
    coarse = None if abs(delay) < LONG else coarse_delay(every)
    if coarse is not None:
        again = [sweep_delay(stretches[i], c, -coarse) for i, c in zip(open_, cycles, strict=True)]
        delay, error = _together(again)
    late = -delay  # delay of the logged torque behind the motion
    known = error < KNOWN * period and abs(delay) > SURE * error + period and coarse is None
    if not (error < TOLD * period or known or is_long(late, error, period, coarse)):
        odd = max(delay, -0.5 * period - delay) > BEYOND * error  # neither commanded nor sampled
        agreed = _with_shift(delay, error, every) if odd else None
        if agreed is None:
            used = _together([(delay, error), (0.0, max(USUAL, 0.5 * period))])
            if odd:
                used = 0.0, max(0.5 * period, abs(delay))  # it may be this, or none
            for i in open_:
                delays[i], errors[i] = used
            first, odd_delay = open_[0], (delay, error) if odd else None
            return delays, errors, [_doubt(logs[first], joint, stretches[first], cycles[0], used, odd_delay)]
        delay, error = agreed
    for i in open_:
        delays[i], errors[i] = delay, error
    near, far = sorted((abs(delay), abs(delay + 0.5 * period)))
    if near < PLAIN * error and far > SIGNIFICANT * error:
        return delays, errors, []  # either commanded or sampled, as usual
    if abs(delay) < error and late <= period:
        return delays, errors, []  # nothing worth saying was corrected
    amount = f"{1e3 * abs(delay):.2f} +- {1e3 * error:.2f} ms"
    how = f"was logged {1e3 * (late - 0.5 * period):.2f} +- {1e3 * error:.2f} ms after it acted"  # a sample, not a command
    if late <= period:
        way = "later" if delay >= 0.0 else "earlier"
        how = (
            f"acts {amount} {way} than a command that is held for one interval (the logged torque precedes the motion by half "
            "an interval more)"
        )
    return delays, errors, [f"The torque {how}; this delay was estimated from the motion and corrected."]


def _with_shift(delay: float, error: float, every: Sequence[Signals]) -> tuple[float, float] | None:
    """Return a poorly known delay and its standard error [s] after the shift of the torque that fits best; None if that is
    another, or short.

    Friction that builds up over a distance lags too, so the shift must be long beside such friction.
    """
    means = residual_of([(s, s.torque, s.torque, True) for s in every], means_alone=True)
    shift = None if means is None else lateness.delay(means)
    if means is None or shift is None:
        return None
    beside = lateness.delay_beside_distance(means) or shift
    if min(abs(shift[0]), abs(beside[0])) < LONG or abs(beside[0] + delay) > BEYOND * error:
        return None
    return _together([(delay, error), (-beside[0], 0.5 * means.period)])


def _doubt(
    log: Log,
    joint: str,
    stretches: Sequence[Signals],
    cycles: Windows,
    used: tuple[float, float],
    odd: tuple[float, float] | None,
) -> str:
    """Return the sentence on a torque of unknown timing, with the change of the curve at other timings.

    Args:
        log: with the torque.
        joint: its name.
        stretches: of the log.
        cycles: of the sweep.
        used: delay and standard error that are used [s].
        odd: those that fit best, if they are neither of a command nor of a sample.
    """
    about, half = log.select(joint).joints[0], 0.5 / stretches[0].rate
    taken, *others = (
        correct_pairs(stretches, cycles, rotary=about.unit == "rad", delay=delay)
        for delay in (used[0], *((odd[0],) if odd else (0.0, -half)))
    )
    change = np.max([[abs(c.F_pos - taken.F_pos), abs(c.F_neg - taken.F_neg)] for c in others], axis=(0, 1))
    worst = int(np.argmax(change))
    amount = f"by up to {change[worst]:.2g} {about.torque_unit}, at {taken.V[worst]:.3g} {about.unit}/s"
    if odd:
        late = -odd[0] - half
        return (
            f"The torque seems to come {1e3 * abs(late):.2g} +- {1e3 * odd[1]:.2g} ms {'later' if late > 0.0 else 'earlier'} than "
            "the motion, which does not show it clearly, so nothing was corrected. If it does, the curve is off "
            f"{amount} (--known delay={late:.2g})."
        )
    return (
        f"The motion does not show whether the torque was commanded or sampled with the position, and hardly its delay: "
        f"{1e3 * (-used[0] - half):.2g} +- {1e3 * used[1]:.2g} ms was taken. With a timing that you know (--torque-timing command "
        f"or sample), the curve moves {amount}."
    )


def _together(each: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Return the weighted mean of delays and its standard error [s]; infinite if no delay is known."""
    known = [(delay, error) for delay, error in each if np.isfinite(error) and error > 0.0]
    if not known:
        return float("inf"), float("inf")
    delays, errors = np.array(known).T
    weight = 1.0 / errors**2
    return float(weight @ delays / weight.sum()), float(1.0 / np.sqrt(weight.sum()))


def _part(s: Signals, cycles: Windows, corner: float):
    """Return the used samples, the measured and the low-passed motion there, and start and end of each run of samples."""
    wanted = filters.low_pass(s.position, min(corner, 0.2 * s.rate), s.rate)  # type: ignore[arg-type]
    motion = [wanted]
    for _ in range(3):
        motion.append(filters.derivative(motion[-1], 1.0 / s.rate))
    used = np.zeros(s.time.size, dtype=bool)
    for window, peak in zip(cycles.time, cycles.peak, strict=True):
        a, b = np.searchsorted(s.time, window)
        used[a:b] |= np.abs(motion[1][a:b]) >= SHARE * peak
    rows = np.flatnonzero(used)
    starts = np.concatenate([[0], np.flatnonzero(np.diff(rows) > 1) + 1, [rows.size]])
    edges = [(int(a), int(b)) for a, b in zip(starts, starts[1:], strict=False) if b > a]
    real = [m[rows] for m in (s.position, s.velocity, s.acceleration, s.jerk)]  # type: ignore[index]
    return rows, real, [m[rows] for m in motion], edges


def _regressor(motion: Sequence[np.ndarray], knots: np.ndarray) -> np.ndarray:
    q, v, a, j = motion
    return np.column_stack([a, -j, np.sin(q), np.cos(q), basis(v, knots)])


def _with_load(X: np.ndarray, motion: Sequence[np.ndarray], theta: np.ndarray) -> np.ndarray:
    """Return the regressor with columns for friction that grows with the load |g + L a|, from estimated gravity and inertia.

    The load's inertia L is less than that of the joint, so a second column is the derivative with respect to L.
    """
    q, v, a, _ = motion
    load = theta[0] * a + theta[2] * np.sin(q) + theta[3] * np.cos(q)
    return np.column_stack([X, np.sign(v) * np.abs(load), np.sign(v) * np.sign(load) * a])
