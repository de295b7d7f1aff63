"""`estimate_payload`: mass and center of what an arm carries, with intervals, and the gains of its drives.

A payload at a frame is a body of ten inertial parameters that the joints' torques are linear in. Its inertia is identifiable
only from large accelerations. The accuracy of the drives' gains often limits the mass more than the data do, so both errors
are reported. A known mass calibrates the gains instead. An unknown mass gives their ratios, if it loads three joints or more.
Gains and payload together: Gautier & Briot, J. Dyn. Sys. Meas. Control 136, 2014.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from backdrive._upper import Display
from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.external.explanation import ACCEPT, CHECK, EXPLAINED
from backdrive.external.gains import Gains, absolute_gains, gain_ratios
from backdrive.external.payload_fit import PayloadFit, PayloadProblem, PriorKnowledge
from backdrive.identification.arm_predict import arm_of, coupling_of_model, slip_in
from backdrive.identification.arm_signals import ArmSignals, prepare_arm
from backdrive.identification.pseudo_inertia import about_center, frame_change
from backdrive.identification.regression import NORMAL
from backdrive.logs.log import Log
from backdrive.model import FrictionModel
from backdrive.robot import Robot

GAIN_ERROR = 0.05  # standard deviation of a drive's gain: torque constants are specified to 10 % [-]
OPEN = 0.3  # standard deviation of a gain that is fitted [-]
TOLD = 0.8  # the inertia is reported if the data reduce its prior variance by at least this share [-]
FOREIGN = (
    3.0,
    0.2,
)  # a residual this many times the model's, and above this share of the torque, suggests another robot
UNLOADED = (
    0.9  # share of an unloaded log's torque, which nothing loads, that the model of its arm explains [-]
)
SLIGHT = 3.0  # standard errors below which a mass is not significant


@dataclass(frozen=True, kw_only=True, eq=False)
class PayloadEstimate(Display):
    """What an arm carries.

    Attributes:
        frame: of the center and the inertia.
        mass: [kg].
        mass_error: standard error, gains included [kg].
        mass_error_of_data: standard error if the gains were exact [kg].
        center: of mass in the frame [m], (3,).
        center_error: standard errors [m], (3,).
        inertia: about the center, along the frame's axes [kg.m^2], (3, 3); None where the motion does not show it.
        inertia_error: standard errors [kg.m^2], (3, 3); None likewise.
        limited_by: main cause of the mass's uncertainty: `gains`, `data`, or `nothing` if the mass was given.
        gains: of the drives.
        lever: torque of the payload by joint, root mean square [N.m or N].
        remarks: what a reader should know, in sentences.
    """

    frame: str
    mass: float
    mass_error: float
    mass_error_of_data: float
    center: np.ndarray
    center_error: np.ndarray
    inertia: np.ndarray | None
    inertia_error: np.ndarray | None
    limited_by: str
    gains: Gains
    lever: dict[str, float]
    remarks: tuple[str, ...] = ()

    @property
    def mass_interval(self) -> tuple[float, float]:
        """95 % interval of the mass [kg]."""
        return self.mass - NORMAL * self.mass_error, self.mass + NORMAL * self.mass_error

    def center_interval(self) -> np.ndarray:
        """Return the lower and upper ends of the center's 95 % intervals [m], (2, 3)."""
        return self.center + NORMAL * np.array([[-1.0], [1.0]]) * self.center_error

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, as `backdrive estimate --payload --json` prints them."""
        inertia, error = self.inertia, self.inertia_error
        return {
            "frame": self.frame,
            "mass": self.mass,
            "mass_interval": list(self.mass_interval),
            "mass_error": self.mass_error,
            "mass_error_of_data": self.mass_error_of_data,
            "center": self.center.tolist(),
            "center_error": self.center_error.tolist(),
            "inertia": None if inertia is None else inertia.tolist(),
            "inertia_error": None if error is None else error.tolist(),
            "limited_by": self.limited_by,
            "lever": self.lever,
            "gains": {
                "kind": self.gains.kind,
                "joints": {n: {"value": g.value, "error": g.error} for n, g in self.gains.by_joint.items()},
            },
        }


def estimate_payload(
    model: FrictionModel,
    log: Log,
    robot: str | Path | Robot,
    *,
    frame: str | None = None,
    unloaded: Log | None = None,
    known_mass: float | None = None,
    at: Sequence[float] | None = None,
    gain_error: float | None = None,
    accept: Sequence[str] = (),
) -> PayloadEstimate:
    """Return mass and center of an arm's payload, and the gains of its drives.

    Args:
        model: of the whole arm without the payload.
        log: with the payload, position and torque of all joints, in a motion with large accelerations.
        robot: path of the robot description that the model was identified with, or the robot.
        frame: link or site that the payload is fixed to; None: the last one of the last joint.
        unloaded: a log without the payload; the model's bodies and friction are then fitted anew, along with the payload.
        known_mass: of the payload, which then calibrates the gains [kg].
        at: known center of the payload in the frame [m], (3,).
        gain_error: standard deviation of each drive's relative gain error [-]; None: 0.05.
        accept: `torque-share` estimates from logs, too, whose torque the model does not explain.

    Raises:
        InvalidInput: model, log and robot do not fit, the model does not explain the logs, or a number is out of range.
        UnknownName: no such frame.
        NotIdentifiable: too little motion, or the payload's mass is not significant.
    """
    known = _prior_knowledge(known_mass, at, gain_error)
    accepted = ACCEPT in ((accept,) if isinstance(accept, str) else accept)
    arm, body = arm_of(model, robot)
    frame, placement, link = _frame(body, frame)
    adds = body.base.relation[:, 10 * link : 10 * link + 10] @ frame_change(placement)
    coupling = coupling_of_model(model, body)

    def signals(one: Log) -> list[ArmSignals]:
        return [s.shift(slip_in(model)) for s in prepare_arm(one, body, coupling=coupling)]

    problem = PayloadProblem(
        robot=body,
        arm=arm,
        frictions=[model.joint(name) for name in body.joints],
        adds=adds,
        loaded=signals(log),
        unloaded=[] if unloaded is None else signals(unloaded),
    )
    if problem.rows < 2 * (10 + len(body.joints)):
        raise NotIdentifiable(
            f"The log holds {problem.rows} rows of moving joints, too few for a payload.",
            remedy="Record some 20 s in which all joints move; at rest, friction hides the weight.",
        )
    remarks = _fit_remarks(body, problem.shares_without_load(), accepted)
    fit = problem.fit(known)
    remarks += _foreign(body, fit, accepted or unloaded is not None)
    if arm.covariance is None and unloaded is None:
        remarks.append(
            "The model contains no uncertainty of its bodies, so the interval does not include it: identify the "
            "model again, or give an unloaded log."
        )
    mass, error = float(fit.payload[0]), float(np.sqrt(fit.covariance[0, 0]))
    if known_mass is None and mass < SLIGHT * error:
        raise NotIdentifiable(
            f"The payload's mass is not significant: {mass:.3g} +- {NORMAL * error:.2g} kg.",
            remedy="Give a log in which the arm carries more, or moves its wrist and elbow up and down further.",
        )
    if known_mass is None:
        gains = gain_ratios(body.joints, problem.fit(PriorKnowledge(gain_error=OPEN, seek=True)))
    else:
        gains = absolute_gains(body.joints, fit)
    of_data = float(np.sqrt(fit.of_data[0, 0]))
    center, inertia = _center(fit), _inertia(fit)
    limited = "nothing" if known_mass is not None else "gains" if error**2 > 2.0 * of_data**2 else "data"
    if limited == "gains":
        remarks.append(
            f"The drives' gains limit the accuracy of the mass, not the data: with exact gains the error would be "
            f"{NORMAL * of_data:.2g} kg. A "
            "known mass calibrates them."
        )
    if inertia[0] is None:
        remarks.append("The motion does not show the payload's inertia about its center.")
    return PayloadEstimate(
        frame=frame,
        mass=mass,
        mass_error=0.0 if known_mass is not None else error,
        mass_error_of_data=0.0 if known_mass is not None else of_data,
        center=center[0],
        center_error=center[1],
        inertia=inertia[0],
        inertia_error=inertia[1],
        limited_by=limited,
        gains=gains,
        lever=dict(zip(body.joints, fit.lever.tolist(), strict=True)),
        remarks=(*remarks, *gains.remarks),
    )


def _prior_knowledge(
    mass: float | None, at: Sequence[float] | None, gain_error: float | None
) -> PriorKnowledge:
    """Return the prior knowledge after checking it."""
    if mass is not None and not 0.0 < mass < np.inf:
        raise InvalidInput(f"A known mass of {mass:g} kg.", remedy="Give a positive number [kg].")
    if gain_error is not None and not 0.0 <= gain_error < 1.0:
        raise InvalidInput(f"A gain error of {gain_error:g}.", remedy="Give a share, such as 0.05 for 5 %.")
    place = None if at is None else np.array(at, dtype=np.float64)
    if place is not None and (place.shape != (3,) or not np.all(np.isfinite(place))):
        raise InvalidInput(f"A center at {at}.", remedy="Give x, y, z in the frame [m], such as 0,0,0.05.")
    if mass is not None:
        return PriorKnowledge(gain_error=OPEN, seek=True, mass=mass, center=place)
    return PriorKnowledge(gain_error=GAIN_ERROR if gain_error is None else gain_error, center=place)


def _frame(robot: Robot, name: str | None) -> tuple[str, np.ndarray, int]:
    """Return a frame's name, its placement in the link that carries it, (4, 4), and the number of that link."""
    carried = [(n, robot.model.frames[robot.frame(n)]) for n in robot.frames]
    by_link = [(n, f, f.parentJoint if hasattr(f, "parentJoint") else f.parent) for n, f in carried]
    if name is None:
        last = [n for n, _, joint in by_link if joint == len(robot.joints)]
        name = last[-1] if last else robot.frames[-1]
    robot.frame(name)
    frame, joint = next((f, joint) for n, f, joint in by_link if n == name)
    if joint < 1:
        raise InvalidInput(
            f"The frame '{name}' does not move.",
            remedy=f"Name one that a joint carries, such as {robot.frames[-1]}.",
        )
    return name, np.array(frame.placement.homogeneous), joint - 1


def _fit_remarks(robot: Robot, shares: np.ndarray | None, accepted: bool) -> list[str]:
    """Return a remark if the model explains an unloaded log poorly; refuse one that it hardly explains.

    Args:
        robot: the arm.
        shares: explained share of the torque of each joint [-], (J,); None without an unloaded log.
        accepted: remark instead of refusing.
    """
    poor = (
        [(name, s) for name, s in zip(robot.joints, shares, strict=True) if s < UNLOADED]
        if shares is not None
        else []
    )
    if not poor:
        return []
    said = ", ".join(f"{name} {100 * s:.0f} %" for name, s in poor)
    if min(s for _, s in poor) < EXPLAINED and not accepted:
        raise InvalidInput(
            f"The model does not explain the unloaded log (of the torque in motion {said}; below 0 % it is worse than no "
            f"model): order or sign of the joints, or the robot, differ.",
            remedy=f"{CHECK} To continue anyway, --accept {ACCEPT}.",
        )
    return [
        f"The model explains only a part of the torque of the unloaded log ({said}), and the payload is as uncertain as that: "
        f"another order of the joints, tool, temperature or robot is likely. {CHECK}"
    ]


def _foreign(robot: Robot, fit: PayloadFit, accepted: bool) -> list[str]:
    """Return a warning if a payload does not explain the log, for example because the robot is another one; refuse a log of
    which hardly anything is explained, unless it is accepted.
    """
    times, share = FOREIGN
    worse = [
        f"{name} {100 * left:.0f} %, {100 * stated:.0f} % when it was identified"
        for name, left, stated in zip(robot.joints, fit.residual, fit.expected, strict=True)
        if left > max(times * np.nan_to_num(stated, nan=share / times), share)
    ]
    if not worse:
        return []
    said = f"A payload does not explain the log ({'; '.join(worse)} of the torque remains unexplained)."
    if 1.0 - np.max(fit.residual) ** 2 < EXPLAINED and not accepted:
        raise InvalidInput(said, remedy=f"{CHECK} To continue anyway, --accept {ACCEPT}.")
    return [
        f"{said} The cause may be another order of the joints, another robot, another tool, or a contact."
    ]


def _center(fit: PayloadFit) -> tuple[np.ndarray, np.ndarray]:
    """Return the center and its standard errors [m], (3,) each."""
    mass, center = fit.payload[0], fit.payload[1:4] / fit.payload[0]
    slope = np.column_stack([-center, np.eye(3)]) / mass
    return center, np.sqrt(np.diag(slope @ fit.covariance[:4, :4] @ slope.T))


def _inertia(fit: PayloadFit) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Return the inertia about the center and its standard errors [kg.m^2], (3, 3) each; None where nothing shows it."""
    if fit.told.min() < TOLD:
        return None, None
    value, step = about_center(fit.payload), 1e-6 * np.maximum(np.abs(fit.payload), 1e-3)
    slope = np.array([(about_center(fit.payload + d) - value).ravel() for d in np.diag(step)]) / step[:, None]
    error = np.sqrt(np.einsum("ik,ij,jk->k", slope, fit.covariance[:10, :10], slope)).reshape(3, 3)
    if np.any(np.diag(error) > 0.5 * np.diag(value)):
        return None, None
    return value, error
