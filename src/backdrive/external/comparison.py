"""Comparison of a log's external torques with the estimated ones: a warning where they do not fit, and what would fit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from backdrive.external.result import STATES, JointForce

SHARE = 0.25  # least unexplained share of the known torque's power before anything is reported [-]
CLEAR = 0.1  # largest unexplained share by which another sign or joint fits [-]
BEYOND = 2.0  # and the error must exceed the half width of the 95 % band so many times [-]
TURNED = 2.0  # least such share where the torque of the other sign fits, whatever the band [-]
_REST = STATES.index("rest")  # where friction, and so the estimate, may be anything


def doubts(joints: Sequence[JointForce]) -> list[str]:
    """Return a warning for each joint whose known external torque does not fit the estimate.

    The known torque is compared as it is, with its sign turned round, and with the estimates of the other joints.

    Args:
        joints: estimates of one log.
    """
    return [said for one in joints if one.known is not None and (said := _doubt(one, joints)) is not None]


def _doubt(one: JointForce, joints: Sequence[JointForce]) -> str | None:
    known = np.asarray(one.known)
    good = np.isfinite(known) & (one.state != _REST)
    power = float(np.mean(known[good] ** 2)) if good.any() else 0.0
    own = _mean_square(one.force, known, good)
    half = 0.5 * (one.upper - one.lower)[good]
    band = float(np.sqrt(np.nanmean(half**2))) if np.isfinite(half).any() else 0.0
    turned = _mean_square(-one.force, known, good)
    opposite = own > TURNED * power and turned < CLEAR * power and power > 0.0
    if not opposite and not (power > 0.0 and own > SHARE * power and own > (BEYOND * band) ** 2):
        return None
    start = (
        f"Joint '{one.joint.name}': the log's external torque differs from the estimate by "
        f"{np.sqrt(own):.3g} {one.joint.torque_unit}, {100 * np.sqrt(own / power):.0f} % of its size"
    )
    others = {"its sign turned round": -one.force}
    for other in joints:
        if other is not one and other.force.size == known.size and other.joint.unit == one.joint.unit:
            others[f"that of joint '{other.joint.name}'"] = other.force
    errors = {name: _mean_square(force, known, good) for name, force in others.items()}
    best = min(errors, key=errors.__getitem__)
    if errors[best] < CLEAR * power:
        return f"{start}; it fits {best}: check the mapping of tau_ext."
    return f"{start}: check its order, sign, unit and frame, and the sign and unit of the joint's torque."


def _mean_square(force: np.ndarray, known: np.ndarray, good: np.ndarray) -> float:
    """Return the mean square of the difference [(N.m)^2 or N^2]."""
    return float(np.mean((force[good] - known[good]) ** 2)) if good.any() else 0.0
