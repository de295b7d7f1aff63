"""Whether a model explains the torque of a log: joints in another order, another sign or another robot leave it unexplained.

The share of a joint's torque that the model explains is 1 - mean(estimate^2) / mean(torque^2), in motion. It is taken over
windows of a second, and the median of the windows decides: a hand that pushes in less than half of the motion does not change
it. Below zero the model is worse than none.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from backdrive.control.estimators.of_model import at_rest
from backdrive.errors import InvalidInput
from backdrive.external.alternatives import Instants, better_fit
from backdrive.external.calibrate import Calibration
from backdrive.external.result import STATES, JointForce
from backdrive.identification.signals import Signals
from backdrive.model import JointFriction

ACCEPT = "torque-share"  # name by which a log is accepted whose torque the model does not explain
EXPLAINED = 0.3  # least share of a joint's torque in motion that a model of the same robot explains [-]
BEYOND = 2.0  # half widths of the model's 95 % band that the estimate exceeds in most of the motion [-]
WIDER = 3.0  # half width of a band by free motion relative to that of the model, above which the model misses something [-]
WINDOW = 1.0  # [s]
FRICTION = 0.35  # difference of the friction from the model's that shows another robot [-]
SURE = 5.0  # and that many standard errors
LEAST = 16  # samples in motion
CHECK = (
    "Check the order of the joints (--names), the sign and unit of the torque, the zero of the positions, and that model "
    "and log belong to the same arm."
)


@dataclass(frozen=True, kw_only=True)
class Explanation:
    """What the model of one joint explains of a log.

    Attributes:
        joint: name.
        share: of the torque in motion [-]; negative where the model is worse than none.
        middle: the same, median of the windows [-].
        bands: median of the estimate in motion, in half widths of the model's band [-]; NaN for a model without bands.
    """

    joint: str
    share: float
    middle: float
    bands: float


def explain(one: JointForce, friction: JointFriction, stretches: Sequence[Signals]) -> Explanation | None:
    """Return what a model explains of a joint's torque in motion; None at rest, or for a model without friction.

    A model without friction, if that is intended, explains little of the torque.

    Args:
        one: the estimate.
        friction: of the model.
        stretches: of the log.
    """
    moving = one.state != STATES.index("rest")
    if not (one.state == 0).any() or moving.sum() < LEAST or not at_rest(friction.law) > 0.0:
        return None
    clock, torque = (np.concatenate([getattr(s, name) for s in stretches]) for name in ("time", "torque"))
    measured, left = np.interp(one.time[moving], clock, torque), one.force[moving]
    known = None if friction.bands is None else friction.bands.moving
    half = np.nan if known is None else known.half_width
    return Explanation(
        joint=one.joint.name,
        share=1.0 - float(np.mean(left**2)) / max(float(np.mean(measured**2)), 1e-12),
        middle=share_by_windows(one.time[moving], left, measured),
        bands=float(np.median(np.abs(one.force[one.state == 0]))) / half,
    )


def share_by_windows(time: np.ndarray, left: np.ndarray, measured: np.ndarray) -> float:
    """Return the median, over windows, of the share of a torque that is explained [-].

    Args:
        time: [s], (n,).
        left: torque that stays unexplained [N.m or N], (n,).
        measured: torque [N.m or N], (n,).
    """
    _, window = np.unique(np.floor(time / WINDOW), return_inverse=True)
    size = np.bincount(window, measured**2)
    return float(np.median(1.0 - np.bincount(window, left**2) / np.maximum(size, 1e-12)))


def check_shares(
    shares: Sequence[Explanation], instants: Callable[[], Instants], accepted: bool = False
) -> list[str]:
    """Return remarks on joints that the model explains poorly, and refuse a log of other joints or another robot.

    A force that acts all the time may leave as little explained. Such a log fits no other order or sign, and its friction is
    the model's.

    Args:
        shares: of the joints in motion.
        instants: makes motion and torque, where they are needed.
        accepted: remark instead of refusing.

    Raises:
        InvalidInput: another order or sign fits far better; or the model is worse than none, and friction differs; or most
            joints are hardly explained.
    """
    poor = [s for s in shares if min(s.share, s.middle) < EXPLAINED]
    beyond = [s for s in shares if s.bands > BEYOND and s not in poor]
    if not (poor or beyond):
        return []
    found = instants()
    other, reason = better_fit(found), ""
    said = ", ".join(f"{s.joint} {100 * min(s.share, s.middle):.0f} %" for s in poor or beyond)
    if other is not None:
        reason = f"{other[0].upper()}{other[1:]}."
    elif len([s for s in shares if s.share < EXPLAINED]) > 0.5 * max(len(shares), 1):
        reason = "These are most of the joints: the log may be of another robot, or order or sign of the joints differ."
    elif any(s.middle < 0.0 for s in shares):
        errors = {n: e for n, e in zip(found.estimator.joints, found.friction_errors(), strict=True)}
        differs = [
            f"{s.joint} by {100 * errors[s.joint][0]:+.0f} %"
            for s in shares
            if abs(errors[s.joint][0]) > max(FRICTION, SURE * errors[s.joint][1])
        ]
        if differs:
            reason = (
                f"Below 0 % it is worse than no model, and friction differs, too (of {', '.join(differs)}): the log may be of "
                f"another robot, or order or sign of the joints differ."
            )
    if reason and not accepted:
        raise InvalidInput(
            f"The model does not explain the torque in motion ({said}). {reason}",
            remedy=f"{CHECK} If all are right and forces act all the time, continue with --accept {ACCEPT}.",
        )
    if poor:
        return [
            f"The model explains little of the torque in motion ({said}): large forces act, or order or sign of the joints, "
            f"or the robot, differ. {reason or CHECK}"
        ]
    told = ", ".join(f"{s.joint} {s.bands:.1f}" for s in beyond)
    return [
        f"In half of the motion the estimate exceeds its 95 % band of the identification by the factor {told}: a force "
        f"acts all the time, such as a payload, or order of the joints, zeros, temperature or robot differ. {reason}".rstrip()
    ]


def check_free(frictions: Sequence[JointFriction], calibrations: Sequence[Calibration]) -> list[str]:
    """Return a remark where free motion, which nothing touched, does not fit the model: its bands are much wider.

    Args:
        frictions: of the model.
        calibrations: of the same joints by free motion.
    """
    told = []
    for friction, own in zip(frictions, calibrations, strict=True):
        known = None if friction.bands is None else friction.bands.moving
        if known is None or own.moving is None or not own.moving.half_width > WIDER * known.half_width:
            continue
        told.append(
            f"{own.joint} {own.moving.half_width:.3g} instead of {known.half_width:.3g} {friction.joint.torque_unit}"
        )
    if not told:
        return []
    return [
        f"The free motion does not fit the model: half the 95 % band in motion is {', '.join(told)} in the identification. "
        f"Another load, temperature, order of the joints or robot is likely, or something touched it. Identify again."
    ]
