"""The 95 % band about an estimate, by state of motion, as the model alone tells it."""

from __future__ import annotations

import numpy as np

from backdrive.control.estimators.of_model import at_rest
from backdrive.identification.bands import REVERSAL, states
from backdrive.identification.signals import Signals
from backdrive.model import JointFriction

SLACK = 0.1  # of the friction, by which the band at rest is wider than friction alone, at most [-]
CREEP = 0.05  # of the model's top speed, below which friction is not that of sliding: the joint starts, stops or turns [-]
BLUR = 2.0  # lags after a reversal, in which what an estimator makes of it fades to a twentieth


def states_along(friction: JointFriction, s: Signals, bandwidth: float) -> np.ndarray:
    """Return the state of every sample of an estimate, 0 moving, 1 reversing, 2 at rest, (n,).

    A joint that starts, stops or creeps counts as reversing, for as long as an estimator remembers it; so does the end of a
    stretch, since nobody knows whether it turns right after.

    Args:
        friction: of the model.
        s: motion.
        bandwidth: of the estimator [1/s].
    """
    lag = 1.0 / bandwidth
    state = states(s, REVERSAL + lag, REVERSAL + BLUR * lag, CREEP * friction.validity.speeds[1])
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
) -> tuple[np.ndarray, np.ndarray]:
    """Return the ends of the 95 % band, (n,) each; a state that the model has no band of has the widest that it has.

    In motion: within it the model held 95 % of the measured torque. At rest: friction may be anything within its bounds.

    Args:
        friction: of the model.
        force: external torque [N.m or N], (n,).
        taken: friction that was taken off [N.m or N], (n,).
        state: of motion, (n,).
        remarks: list that a sentence is added to where the model holds no band.
        temperature: for laws that depend on it [degC], (n,); None: 20.
    """
    known = friction.bands
    widths = [
        np.nan if b is None else b.half_width
        for b in ((None, None) if known is None else (known.moving, known.reversing))
    ]
    if np.isnan(widths).all():
        remarks.append(
            f"Joint '{friction.joint.name}': the model holds no bands: identify it again for bands in motion, or give free "
            "motion (--free)."
        )
    else:
        widths = [np.nanmax(widths) if np.isnan(w) else w for w in widths]
    half = np.where(state == 0, widths[0], widths[1])
    lower, upper = force - half, force + half
    rest = state == 2
    forwards, backwards = _bounds(friction, temperature)
    slack = SLACK * 0.5 * (forwards + backwards)
    slack = np.minimum(slack, widths[1]) if np.isfinite(widths[1]) else slack
    below, above = (np.broadcast_to(x, force.shape)[rest] for x in (backwards + slack, forwards + slack))
    lower[rest] = (force - taken)[rest] - below
    upper[rest] = (force - taken)[rest] + above
    return lower, upper


def _bounds(
    friction: JointFriction, temperature: np.ndarray | None
) -> tuple[np.ndarray | float, np.ndarray | float]:
    """Return the friction's bounds at rest, along +q and along -q; of a law of temperature at each instant.

    No friction is seen at zero speed: a curve that falls towards it may do so by extrapolation. The line through its values at a
    low speed and at twice that counts too where it meets zero speed higher.
    """
    law, low = friction.law, CREEP * friction.validity.speeds[1]
    if law.rate.SMOOTH:
        return at_rest(law), at_rest(law)
    warmth = None if temperature is None or "temperature" not in law.rate.NEEDS else temperature
    speeds = np.array([1e-12, low, 2.0 * low])[:, None] * np.ones(1 if warmth is None else warmth.size)
    shared = None if warmth is None else np.broadcast_to(warmth, speeds.shape)
    ends = []
    for way in (1.0, -1.0):
        curve = way * law.torque(way * speeds, temperature=shared)
        ends.append(np.maximum(curve[0], 2.0 * curve[1] - curve[2]))
    return ends[0], ends[1]
