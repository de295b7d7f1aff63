"""Torque and motion shifted by whole samples: from different messages or buffers, or from the wrong tick."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from backdrive.logs.health._exam import Exam, once
from backdrive.logs.health._finding import (
    Changes,
    Finding,
    Repair,
    check,
    columns_of,
    keep_rows,
    with_columns,
)
from backdrive.logs.health._motion import bent, jackknife, motion, normal_equations, solvable
from backdrive.logs.health.jitter import LIMIT

#: Largest slip that is sought [sample].
REACH = 20
#: Smaller slips may come from the controller or from frictional lag: in samples, and in seconds.
SAMPLES, SECONDS = 1.5, 3e-3
#: A velocity without a position may come out of a filter: in samples, and in seconds.
_FILTER_SAMPLES, _FILTER_SECONDS = 8.0, 40e-3
#: A slip must exceed this many standard errors, reduce the misfit to this share, and leave at most this part of the torque
#: unexplained. If the slip removes nearly all of the misfit, fewer standard errors suffice.
_SURE, _LEFT, _CLEAR, _MISFIT = 6.0, 0.45, 0.2, 0.25
_LEAST = 2.0
#: Effect of a slip, as a share of the torque's scatter, above which it is reported; above the second it spoils a fit.
_WORTH, _SPOILS = 0.015, 0.05
#: If a single shift of the whole log is the cause, a spoiling slip leaves at most this share of the misfit [1].
_ONE_SHIFT = 0.1
#: Distances by which friction itself may lag after a reversal, as shares of the range [1].
_DISTANCES = (0.005, 0.01, 0.02, 0.03, 0.05, 0.08, 0.12, 0.2)
#: With such friction, at least this share of a real slip remains [1].
_REAL = 0.5
#: Fewest instants; and time constants of a low pass that a slip may be instead, by the slip [1].
_FEWEST, _LAGS = 100, (0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6)
#: A low pass explains torque better than a shift if it reduces the misfit further by this many standard errors.
_BETTER = 3.0
#: Only a shift reduces the misfit below this share [1].
_EXACT = 0.01
#: Share of sample-to-sample noise in the torque above which no timing is estimated [1].
_NOISY = 0.3


@dataclass(frozen=True)
class Slip:
    """Slip of torque behind motion.

    Attributes:
        samples: by how much torque comes late [sample].
        error: its standard error [sample].
        left: mean square misfit with the slip corrected, divided by that without, noise excluded [1].
        misfit: RMS torque that is unexplained with the slip corrected, divided by the torque's standard deviation [1].
        effect: RMS torque due to the slip, divided by the torque's standard deviation [1].
    """

    samples: float
    error: float
    left: float
    misfit: float
    effect: float


@check("time-slip", "torque and motion shifted by whole samples")
def find(exam: Exam) -> Iterator[Finding]:
    """Report torques that are explained far better by the motion some samples earlier or later.

    The torque is regressed on acceleration, friction and position at each shift; reversals, where friction itself lags,
    are left out. The standard error comes from leaving out one stretch of the log at a time. A log that moves in one direction
    only shows too few changes of torque to time them. Friction that builds up over a distance is not a slip, although it looks
    like one in a slow joint under gravity. If a low pass explains the torque clearly better than any shift, no shift can repair it.
    """
    for j, joint in exam:
        slip = estimate(exam, j)
        if slip is None or not _certain(exam, j, slip) or _by_distance(exam, j, slip):
            continue
        way = "late" if slip.samples > 0 else "early"
        spoils = slip.effect > _SPOILS
        one, lag = not spoils or slip.left <= _ONE_SHIFT, _by_low_pass(exam, j, slip)
        late = abs(slip.samples)
        yield Finding(
            joint=joint,
            channel="torque",
            severity="spoils" if spoils else "warn",
            sentence=(
                f"torque of {joint} comes {late:.1f} samples ({1e3 * late * exam.period:.1f} ms) {way} against its motion "
                f"(standard error {slip.error:.1g}); its effect is {100 * slip.effect:.1f} % of the torque"
                + (
                    "."
                    if one and not lag
                    else f", and a low pass of {1e3 * lag:.0f} ms explains it better than any shift."
                    if lag
                    else f", {100 * slip.left:.0f} % of which no shift removes: it is not constant over the log."
                )
            ),
            remedy=f"Shift torque by {round(late)} samples (--repair does), or record both from one message."
            if one and not lag
            else "Record torque without its low pass, or with a higher bandwidth: no shift can repair it."
            if lag
            else "Record torque and position from one message; or keep the part before the slip began.",
            value=slip.samples,
            repairable=one and not lag,
        )


def _certain(exam: Exam, j: int, slip: Slip) -> bool:
    known = exam.usable("position", j)
    samples, seconds = (SAMPLES, SECONDS) if known else (_FILTER_SAMPLES, _FILTER_SECONDS)
    large = abs(slip.samples) >= max(samples, seconds / exam.period) and abs(slip.samples) < REACH - 1
    errors = abs(slip.samples) / max(slip.error, 1e-12)
    sure = (errors > _SURE and slip.left < _LEFT) or (errors > _LEAST and slip.left < _CLEAR)
    return large and sure and slip.misfit < _MISFIT and slip.effect > _WORTH


def _by_distance(exam: Exam, j: int, slip: Slip) -> bool:
    """Return whether a slip almost vanishes if friction may also lag by a distance."""
    m = motion(exam, j, REACH)
    if slip.left < _EXACT or m is None:
        return False
    span = float(np.ptp(exam.sample("position" if exam.usable("position", j) else "velocity", j)))
    least, samples = np.inf, slip.samples
    for bristle in bent(exam, j, REACH, span * np.array(_DISTANCES)).T:
        terms = np.column_stack([m.terms, bristle])
        misfit = _misfits(terms, m.torque)
        if misfit.min() < least:
            least, samples = float(misfit.min()), _minimum(m.shifts, misfit)
    return samples / slip.samples < _REAL


def _by_low_pass(exam: Exam, j: int, slip: Slip) -> float:
    """Return the time constant of a low pass that explains late torque clearly better than any shift [s]; 0 where none does.

    Torque before a low pass of first order is what was logged plus the time constant times its rate. So both are told by the same
    terms at the same instants. What noise adds by the rate does not count against the low pass.
    """
    m = motion(exam, j, REACH)
    if m is None or slip.samples <= 0.0:
        return 0.0
    y, lags = m.torque[m.fast], slip.samples * np.array(_LAGS)
    change = 0.5 * (y[:, REACH + 1] - y[:, REACH - 1])
    before = y[:, [REACH]] + change[:, None] * lags
    whole, left = _without(m.terms[m.fast], np.concatenate([y, before], axis=1), m.fold[m.fast])
    lag = _minimum(lags, whole[y.shape[1] :])
    further = [_bottom(x[: y.shape[1]]) - _bottom(x[y.shape[1] :]) for x in (whole, *left)]
    noise = y.shape[0] * m.rough * lag**2
    clear = further[0] + noise > _BETTER * jackknife(np.array(further[1:]))
    return lag * exam.period if clear else 0.0


@once
def estimate(exam: Exam, j: int) -> Slip | None:
    """Return the slip of a joint's torque; None where the motion does not tell."""
    m = motion(exam, j, REACH)
    if m is None or m.fast.sum() < _FEWEST or not _reverses(m.velocity[m.fast]):
        return None
    steps = exam.steps if exam.steps.max() < 2 * exam.period else exam.steps[exam.steps < 2 * exam.period]
    if np.std(steps) > LIMIT * exam.period:
        return None  # timing cannot be estimated with an uneven clock
    if not exam.noise("torque", j) < _NOISY * np.std(exam.sample("torque", j)):
        return None  # the kicks of a controller on a coarse encoder hide any timing
    y = m.torque[m.fast]
    if np.unique(m.fold[m.fast]).size < 4:
        return None
    misfit, others = _without(m.terms[m.fast], y, m.fold[m.fast])
    best = _minimum(m.shifts, misfit)
    left = np.array([_minimum(m.shifts, x) for x in others])
    # the part that noise alone leaves is not evidence
    now, then = misfit[REACH] / y.shape[0], misfit.min() / y.shape[0]
    noise = min(0.5 * m.noise, 0.9 * then)
    variance = float(np.var(y[:, REACH]))
    if not now > noise:
        return None
    left_over, effect = np.sqrt(then / variance), np.sqrt((now - then) / variance)
    return Slip(best, jackknife(left), float((then - noise) / (now - noise)), float(left_over), float(effect))


def _reverses(velocity: np.ndarray) -> bool:
    """Return whether a velocity has both signs."""
    return bool(velocity.min() < 0.0 < velocity.max())


def _misfit(gram: np.ndarray, cross: np.ndarray, power: np.ndarray) -> np.ndarray:
    """Return the squared misfit (..., k) by normal equations: x'x (..., p, p), x'y (..., p, k) and y'y (..., k)."""
    return np.maximum(power - np.sum(cross * np.linalg.solve(gram, cross), axis=-2), 0.0)


def _without(terms: np.ndarray, torque: np.ndarray, fold: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the squared misfit of each column of torque (m, k) by terms (m, p), (k,), and without each fold, (f, k)."""
    gram, cross, power = normal_equations(terms, torque, fold)
    g, c, p = solvable(gram.sum(axis=0)), cross.sum(axis=0), power.sum(axis=0)
    return _misfit(g, c, p), _misfit(g - gram, c - cross, p - power)


def _misfits(terms: np.ndarray, torque: np.ndarray) -> np.ndarray:
    """Return the squared misfit of each column of torque (m, k) by terms (m, p), (k,)."""
    return _misfit(solvable(terms.T @ terms), terms.T @ torque, np.sum(torque**2, axis=0))


def _minimum(shifts: np.ndarray, misfit: np.ndarray) -> float:
    """Return the shift of least misfit, by a parabola through the three lowest."""
    k = int(np.argmin(misfit))
    if k in (0, misfit.size - 1):
        return float(shifts[k])
    before, here, after = misfit[k - 1 : k + 2]
    bend = before - 2 * here + after
    return float(shifts[k] + 0.5 * (before - after) / bend)


def _bottom(misfit: np.ndarray) -> float:
    """Return the least misfit between evenly spaced ones, by a parabola through the three lowest."""
    k = int(np.argmin(misfit))
    if k in (0, misfit.size - 1):
        return float(misfit[k])
    before, here, after = misfit[k - 1 : k + 2]
    return float(here - 0.125 * (before - after) ** 2 / max(before - 2 * here + after, 1e-300))


@find.mend_with
def repair(exam: Exam, findings: Sequence[Finding]) -> Repair:
    """Shift torque by whole samples; rows that get none, at the ends and at gaps, are dropped."""
    log = exam.log
    n = len(log)
    keep = np.ones(n, bool)
    changes: Changes = {}
    notes: list[str] = []
    for finding, _, j, _ in columns_of(exam, findings):
        by = round(finding.value)
        source = np.arange(n) + by
        changes["torque", j] = exam.column("torque", j)[np.clip(source, 0, n - 1)]
        for segment in exam.segments:
            keep[segment] &= (source[segment] >= segment.start) & (source[segment] < segment.stop)
        notes.append(f"torque of {finding.joint} was shifted by {-by} samples.")
    return keep_rows(
        with_columns(log, changes, notes),
        keep,
        "Rows at the ends that lost their torque by the shift were dropped.",
    )
