"""The noise that reversals add to an external torque: its size and duration, from the log itself, or from the model.

At a reversal friction changes sign, at an instant and over a distance that no model knows exactly, so the estimate is disturbed
for a short time. A force of the environment does not know when a joint reverses. So what the estimate departs from the line
through both sides of a reversal, beyond what it departs in windows of the same length in steady motion, is this noise:

    sigma^2 = mean r^2 (reversals) - mean r^2 (windows),     tau = (sum (int r dt)^2)/(2 sum int r^2 dt), likewise less the windows

The spectrum of first-order noise of this size and correlation time has the same power and the same value at zero frequency.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from backdrive.control.estimators.of_model import WIDTH
from backdrive.identification.bands import states
from backdrive.identification.signals import Signals
from backdrive.model import JointFriction

ABRUPT = 0.01  # correlation time of the residual near a reversal, where the log shows none [s]
FEWEST = 4  # reversals and windows below which the model's numbers are taken
BESIDE = 0.01  # length of the steady motion on each side whose mean the line passes through [s]
MOVING, REVERSING = 0, 1


def noise_of_reversals(
    friction: JointFriction, stretches: Sequence[Signals], plain: Sequence[tuple[np.ndarray, np.ndarray]]
) -> tuple[float, float]:
    """Return the RMS noise of reversals, averaged over the whole log [N.m or N], and its correlation time [s].

    Args:
        friction: of a model, which tells the noise where the log has too few reversals.
        stretches: of the log.
        plain: by stretch, the force estimated without smoothing [N.m or N] and the state of motion, (n,) each.
    """
    rate = stretches[0].rate
    departures: list[np.ndarray] = []
    others: list[np.ndarray] = []
    for force, state in plain:
        spans = _spans(state == REVERSING)
        steady = _spans(state == MOVING)
        beside = max(round(BESIDE * rate), 1)
        for first, last in spans:
            if first and last < force.size and state[first - 1] == state[last] == MOVING:
                departures.append(_departure(force, first, last, beside))
        lengths = [last - first for first, last in spans]
        others += [
            _departure(force, at, at + length, beside)
            for length in lengths
            for begin, end in steady
            for at in range(begin + beside, end - length - beside + 1, length)
        ]
    most = turning_of(friction, stretches)
    if len(departures) < FEWEST or len(others) < FEWEST:
        return most, ABRUPT
    power, long = (a - b for a, b in zip(_moments(departures, rate), _moments(others, rate), strict=True))
    share = float(np.mean(np.concatenate([state for _, state in plain]) == REVERSING))
    if power <= 0.0:
        return 0.0, ABRUPT
    size = float(np.sqrt(share * power))
    time = (
        max(0.5 * long / power, 1.0 / rate) if long > 0.0 else ABRUPT
    )  # a few jumps of the force may hide it
    return min(size, most) if most > 0.0 else size, time


def turning_of(friction: JointFriction, stretches: Sequence[Signals]) -> float:
    """Return the RMS torque residual near reversals by the model, averaged over the whole log [N.m or N].

    As if it were normally distributed. The model's sign of friction is right, or wrong for a short time, so this may be more than
    twice too large.

    Args:
        friction: of a model.
        stretches: of the log.
    """
    bands = friction.bands
    if bands is None or bands.moving is None or bands.reversing is None:
        return 0.0
    more = max(bands.reversing.half_width**2 - bands.moving.half_width**2, 0.0) / WIDTH**2
    share = np.mean(np.concatenate([states(s)[s.moving] for s in stretches]) == REVERSING)
    return float(np.sqrt(share * more)) if np.isfinite(share) else 0.0


def _spans(inside: np.ndarray) -> np.ndarray:
    """Return first and last plus one of every run of True, (m, 2)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]]).astype(np.int8)))
    return edges.reshape(-1, 2)


def _departure(force: np.ndarray, first: int, last: int, beside: int) -> np.ndarray:
    """Return what a force departs in a window from the line through the means on both sides [N.m or N]."""
    before, after = force[max(first - beside, 0) : first].mean(), force[last : last + beside].mean()
    return force[first:last] - np.linspace(before, after, last - first)


def _moments(parts: Sequence[np.ndarray], rate: float) -> tuple[float, float]:
    """Return the mean square of departures, and their squared integrals by the whole time, of one time [s]."""
    samples = sum(part.size for part in parts)
    return (
        float(sum(np.sum(part**2) for part in parts)) / samples,
        float(sum(np.sum(part) ** 2 for part in parts)) / (samples * rate),
    )
