"""The 95 % band about an estimate, by state of motion, from the model alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import maximum_filter1d

from backdrive.control.estimators.of_model import CREEP, WIDTH, break_away
from backdrive.identification.bands import REVERSAL, states
from backdrive.identification.signals import Signals, mark_moving
from backdrive.model import JointFriction

SPREAD = 0.05  # standard deviation of break-away relative to friction: default without a band, and largest value [-]
ONE_SIDED = 1.645  # standard deviations to the end of a one-sided 95 % band, such as that of friction at rest
BLUR = 2.0  # time after a reversal in which the estimator's response to it decays to 5 % [lag]
FASTER = 4.0  # ratio of the bandwidths of the estimator that shows what the estimate misses, and of the estimate [-]
AROUND = 1.0  # time before and after, over which that is applied [lag]
MEDIAN = 0.6745  # median of |x| of a normal distribution [standard deviation]


def states_along(friction: JointFriction, s: Signals, bandwidth: float) -> np.ndarray:
    """Return the state of every sample of an estimate, 0 moving, 1 reversing, 2 at rest, (n,).

    A joint that starts, stops or creeps counts as reversing, for the settling time of the estimator. So does the end of a
    stretch, since the joint may reverse right after it.

    Args:
        friction: of the model.
        s: motion.
        bandwidth: of the estimator [1/s].
    """
    lag, top = 1.0 / bandwidth, friction.validity.speeds[1]
    s = replace(
        s, moving=s.moving & mark_moving(s.velocity, s.rate, top)
    )  # also where a log shows no motion at all
    state = states(s, REVERSAL + lag, REVERSAL + BLUR * lag, CREEP * top)
    end = state[-int(np.ceil((REVERSAL + lag) * s.rate)) :]
    end[end == 0] = 1
    return state


def band(
    friction: JointFriction,
    force: np.ndarray,
    taken: np.ndarray,
    state: np.ndarray,
    remarks: list[str],
    temperature: np.ndarray | None = None,
    carried: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the ends of the 95 % band, (n,) each; a state without a band in the model gets the widest band of the model.

    In motion, the band contained 95 % of the measured torque in the identification. At rest, friction is undetermined up to
    break-away; the uncertainty of break-away is that of friction in motion and of its growth with the load.

    Args:
        friction: of the model.
        force: external torque [N.m or N], (n,).
        taken: friction that was subtracted [N.m or N], (n,).
        state: of motion, (n,).
        remarks: list that a sentence is added to where the model holds no band.
        temperature: for laws that depend on it [degC], (n,); None: 20.
        carried: load under which friction at rest grows [N.m or N], (n,); None: none.
    """
    known = friction.bands
    widths = [
        np.nan if b is None else b.half_width
        for b in ((None, None) if known is None else (known.moving, known.reversing))
    ]
    if np.isnan(widths).all():
        remarks.append(
            f"Joint '{friction.joint.name}': the model has no bands: identify it again for bands in motion, or give "
            f"free motion (--free)."
        )
    else:
        widths = [np.nanmax(widths) if np.isnan(w) else w for w in widths]
    half = np.where(state == 0, widths[0], widths[1])
    lower, upper = force - half, force + half
    rest = state == 2
    load = np.zeros(force.shape) if carried is None else np.abs(carried)
    growth, error = growth_of(friction)
    spread, free = _spread(friction), force - taken
    ends = [
        np.broadcast_to(end, force.shape) + growth * load + ONE_SIDED * np.hypot(spread, error * load)
        for end in break_away(friction, temperature)
    ]
    lower[rest] = (free - ends[1])[rest]
    upper[rest] = (free + ends[0])[rest]
    return lower, upper


def abrupt_changes(
    force: np.ndarray, faster: np.ndarray, state: np.ndarray, bandwidth: float, rate: float
) -> np.ndarray:
    """Return by how much half the band is wider where the force changes faster than the estimator follows [N.m or N], (n,).

    A band from free motion or from the identification holds the noise of the estimate, not what the estimator smooths away from
    a force. A faster estimator shows that: half the band grows by what the two differ beyond their usual difference in this
    state of motion, for one lag before and after. At rest the band stays as wide as friction's bounds.

    Args:
        force: external torque, its lag removed [N.m or N], (n,).
        faster: the same by an estimator `FASTER` times as fast, (n,).
        state: of motion, (n,).
        bandwidth: of the estimator [1/s].
        rate: sampling frequency [Hz].
    """
    difference = np.abs(faster - force)
    more = np.zeros(force.shape)
    for k in (0, 1):
        inside = state == k
        if inside.any():
            usual = WIDTH / MEDIAN * np.median(difference[inside])
            more[inside] = np.maximum(difference[inside] - usual, 0.0)
    more = maximum_filter1d(more, 1 + 2 * round(AROUND * rate / bandwidth))
    return np.where(state == 2, 0.0, more)


def growth_of(friction: JointFriction) -> tuple[float, float]:
    """Return the growth of friction with the load and its standard error, as far as known [-]."""
    growth, error = friction.law.growth, friction.standard_errors.get("load_driving", 0.0)
    return 0.0 if growth is None else max(growth.mean, 0.0), error if np.isfinite(error) else 0.0


def _spread(friction: JointFriction) -> float:
    """Return the standard deviation of break-away [N.m or N]: that of friction about its curve while the joint slides."""
    most = SPREAD * 0.5 * float(sum(break_away(friction)))
    moving = None if friction.bands is None else friction.bands.moving
    return most if moving is None else min(moving.half_width / WIDTH, most)
