"""Coulomb friction from its crossing of zero, where the torque's noise is slower than a reversal.

Before and after a reversal, friction differs by twice Coulomb friction. Where the noise changes little meanwhile, that difference
tells Coulomb friction better than all that goes before, if friction's course through zero is known. Here it is learned from the
log: a function of the speed, or a bristle, by width and elastic share (`zero_crossing`). Least squares of whitened samples
(`crossing_noise`) give all terms. Positions are rounded, so that the acceleration and what a delay makes of it have errors of known
size: their products are taken out of the normal equations (W. Fuller, Measurement Error Models, 1987, Sec. 1.2), with weights that
do not depend on what is fitted.

The result counts only if noise alone is left about the crossings. If it then contradicts a fit without the reversals (`agreement`),
one of the two is wrong, and the log does not say which: the numbers stay those of that fit, and their errors include what lies
between. Inertia and delay stay those of that fit: what a course has wrong looks like them first. Only a delay that the motion
does not tell is taken from the reversals, which do not need inertia for it.

An autoregression of first order is one again in every k-th sample, where rounding matters less by k squared. So that many samples
are used as keep it small.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from math import ceil

import numpy as np

from backdrive.identification.agreement import agree
from backdrive.identification.crossing_noise import Noise
from backdrive.identification.crossing_search import FAST, CrossingFit, Estimate
from backdrive.identification.signals import Signals, spans
from backdrive.identification.zero_crossing import KINDS, LONGEST, TERMS, Course, Passage, passages_of

ENOUGH = 20_000  # largest number of samples that are used: more are slow
ALIKE = 1e-3  # largest relative difference of two sampling rates [-]
SLOW = 0.1  # least time in which the noise forgets [s]: faster noise leaves a reversal nothing to tell of Coulomb friction
SLOWER = 2.0  # the same, by the interval of the samples that are used, for the delay [-]
COARSEST = 0.005  # about the longest interval of the samples that are used, unless all are [s]
FINE = 0.1  # largest error of a second difference from the positions' rounding, by inertia, relative to Coulomb friction [-]
SURE = 5.0  # least Coulomb friction and inertia of the first fit [standard error]
LAGS = 4, 12  # distances at which the noise is first looked at [sample]
FAR = 0.1  # how much less likely than the other a kind of course is at first that is not searched, twice its logarithm a sample [-]
MISSED = 1.4  # largest mean square of the whitened residuals near crossings [-]
NEAR, BESIDE = 0.999, 3  # level below which a sample is near a crossing, and samples beside
MISTAKEN = 0.015  # error of a delay that a wrong course makes, by the time that a crossing takes [-]
WORTH = 0.9  # largest standard error of Coulomb friction, relative to that of the first fit [-]

SAID = "The noise is slower than the reversals, so Coulomb friction was fitted through them."
APART = "A fit through the reversals tells other numbers, so the standard errors include what lies between the two."
TOLD = "The inertia hardly tells the delay of the torque, so it was fitted at the reversals."


def through_crossings(
    stretches: Sequence[Signals], noise: float, first: Estimate
) -> tuple[Estimate, str] | None:
    """Return numbers of a joint whose friction is a straight line, equal in both directions, by a fit through its reversals.

    Args:
        stretches: of one joint.
        noise: standard deviation of a measured position [rad or m].
        first: fit without the reversals.

    Returns:
        The numbers in the order of the first ones, and what is to be said of them; None where the log does not allow such a fit, or
        where it tells no more than the first one.
    """
    fit = _search(stretches, noise, first, SLOW)
    if fit is None or not _leaves_noise(fit):
        return None
    found = fit.estimate()
    if not found.errors[0] < WORTH * first.errors[0]:
        return None
    return (_beside(found, first), SAID) if _agrees(found, first) else (_between(found, first), APART)


def delay_at_crossings(
    stretches: Sequence[Signals], noise: float, first: Estimate
) -> tuple[float, float] | None:
    """Return the delay of the torque that the reversals tell and its standard error [s].

    Args:
        stretches: of one joint.
        noise: standard deviation of a measured position [rad or m].
        first: fit without the reversals, which tells the delay poorly.

    Returns:
        None where the log does not allow a fit through its reversals, or contradicts it.
    """
    fit = _search(stretches, noise, first, None)
    if fit is None or not (_leaves_noise(fit) and _agrees(fit.estimate(), first)):
        return None
    crossings = [last - begin for begin, last in spans(_near(fit))]
    delay, error = fit.estimate().of("delay")
    return delay, float(np.hypot(error, MISTAKEN * np.mean(crossings) / fit.rate))


def _search(
    stretches: Sequence[Signals], noise: float, first: Estimate, slow: float | None
) -> CrossingFit | None:
    """Return the likeliest fit; None where the log does not allow one, or its noise forgets faster than in a time [s]."""
    terms = tuple(name for name in first.names if name not in ("coulomb", *FAST))
    if not stretches or first.names != ("coulomb", *terms, *FAST) or not set(terms) <= set(TERMS):
        return None
    rate, late = stretches[0].rate, first.of("delay")[0]
    coulomb, inertia = first.of("coulomb"), first.of("inertia")
    samples = sum(s.time.size for s in stretches)
    sure = coulomb[0] > SURE * coulomb[1] and inertia[0] > SURE * inertia[1]
    alike = noise > 0.0 and all(abs(s.rate / rate - 1.0) < ALIKE for s in stretches)
    if not (sure and alike):
        return None
    rough = 6.0**0.5 * inertia[0] * noise * rate**2 / (FINE * coulomb[0])
    coarsest = max(1, round(COARSEST * rate))
    every = max(1, ceil(rough**0.5), ceil(samples / ENOUGH)) if slow else coarsest
    if every > coarsest or rough > every**2 or abs(late) * rate > (LONGEST - 1.0) * every:
        return None
    passages = passages_of(stretches, terms, noise, every)
    slow = SLOWER * every / rate if slow is None else slow
    if not passages or (begin := _first_noise(passages, first, slow)) is None:
        return None
    with np.errstate(all="ignore"), suppress(np.linalg.LinAlgError):
        fits = [CrossingFit(passages, kind, noise, first, begin) for kind in KINDS]
        least = min(fit.starts[0][0] for fit in fits)
        found = [fit.search() for fit in fits if fit.starts[0][0] < least + FAR * samples / every]
        return min(found, key=lambda fit: fit.unlikely)
    return None


def _agrees(found: Estimate, first: Estimate) -> bool:
    """Return whether a fit does not contradict the first one."""
    return agree(found.values - first.values, first.errors, found.errors, np.isin(found.names, FAST))


def _leaves_noise(fit: CrossingFit) -> bool:
    """Return whether a fit leaves noise alone about the crossings."""
    near = _near(fit)
    return bool(near.any()) and float(np.mean(fit.state.residual[near] ** 2)) < MISSED


def _near(fit: CrossingFit) -> np.ndarray:
    """Say which samples are near a crossing, (n,)."""
    return np.convolve(np.abs(fit.state.X[:, 0]) < NEAR, np.ones(2 * BESIDE + 1), mode="same") > 0


def _beside(found: Estimate, first: Estimate) -> Estimate:
    """Return an estimate with the inertia and delay of the first one."""
    fast = np.isin(found.names, FAST)
    slow = ~fast
    covariance = found.covariance * np.outer(slow, slow) + first.covariance * np.outer(fast, fast)
    return replace(found, values=np.where(fast, first.values, found.values), covariance=covariance)


def _between(found: Estimate, first: Estimate) -> Estimate:
    """Return the first estimate with the difference of another one in its errors, but in those of inertia and delay."""
    moved = np.where(np.isin(found.names, FAST), 0.0, found.values - first.values)
    return replace(first, covariance=first.covariance + np.outer(moved, moved))


def _first_noise(passages: Sequence[Passage], first: Estimate, slow: float) -> Noise | None:
    """Return the noise about the first fit where the joint slides; None if it forgets faster than in a time [s]."""
    course = Course(kind="speed", width=1e-12)
    theta = _linear(first)
    products, counts = np.zeros(2), np.zeros(2)
    for passage in passages:
        residual = passage.torque[passage.rows] - passage.columns(first.of("delay")[0], course) @ theta
        speed = np.abs(passage.motion(first.of("delay")[0]).velocity[passage.rows])
        used = (speed > 0.1 * speed.max()) & passage.moving[passage.rows]
        size = 3.0 * 1.4826 * np.median(np.abs(residual[used])) if used.any() else 0.0
        residual = np.clip(residual, -size, size)
        for k, lag in enumerate(LAGS):
            both = used[lag:] & used[:-lag]
            products[k] += float(residual[lag:][both] @ residual[:-lag][both])
            counts[k] += np.count_nonzero(both)
    if not counts.min() > 0 or not products.min() > 0.0:
        return None
    near, far = products / counts
    correlation = min(float((far / near) ** (1.0 / (LAGS[1] - LAGS[0]))), 0.999)
    if correlation <= np.exp(-1.0 / (slow * passages[0].rate)):
        return None
    variance = near / correlation ** LAGS[0]
    return Noise(correlation, float(np.sqrt(variance * (1.0 - correlation**2))))


def _linear(estimate: Estimate) -> np.ndarray:
    """Return the coefficients of the columns."""
    return estimate.values[: estimate.names.index("delay")]
