"""External torque on all joints of an arm, and the wrench at a frame: Iwatani 2017, (4.4), and the observers for n joints.

    tau_e = M(q) a + h(q, v) + g(q) + tau_f + offset - u

Methods, bandwidth and lag are defined as for one joint (`external`); the coupling of the joints is in `arm_kernel`.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import ClassVar

import numpy as np

from backdrive.control.estimators import arm_kernel as k
from backdrive.control.estimators.arm_bodies import ArmBodies
from backdrive.control.estimators.arm_tick import FULL, SINGULAR, ArmForceTick, ArmSeries
from backdrive.control.estimators.external import KNOWN
from backdrive.control.estimators.friction import FrictionEstimator
from backdrive.control.estimators.gains import lag as lag_of
from backdrive.control.estimators.of_model import ABRUPT, WIDTH, at_rest, contact, with_break_away
from backdrive.control.estimators.series import on_time
from backdrive.control.estimators.sliding_mode import MotionFilter
from backdrive.errors import InvalidInput
from backdrive.logs.joint import check_coupling
from backdrive.model import FrictionModel, JointFriction
from backdrive.parameters import POSITIVE, WithBounds
from backdrive.robot import Robot, load_robot

POSTURES = 200  # number of random reference postures
FAR = 10.0  # standard deviation of a direction relative to the median posture, above which it is damped [-]
SLOW = 5.0  # speed below which a joint counts as resting, relative to that within which friction changes sign [-]


@dataclass(frozen=True, kw_only=True, eq=False)
class ArmForce(WithBounds):
    """An estimator of the external torque on all joints of an arm; arrays in the order of `joints`.

    Attributes:
        bodies: rigid bodies.
        inertia: that each motor adds to its own joint [kg.m^2 or kg], (J,).
        offset: constant torque [N.m or N], (J,).
        friction: what is taken as friction, by joint.
        sliding: standard deviation of the estimate while a joint moves [N.m or N], (J,).
        resting: the same at rest, where friction is undetermined [N.m or N], (J,).
        slow: speed below which a joint counts as resting [rad/s or m/s], (J,).
        filters: of the encoders, for `direct`; empty: those of the bandwidth.
        method: `direct`, `momentum`, `disturbance`, `extended` or `kalman`.
        bandwidth: L [1/s].
        coupling: C of q_joint = C q_motor, one row for each joint. With it, all inputs, settings and estimates except the wrench
            are those of the motors. None: each motor drives its own joint.
        frame: at which a wrench is wanted; None: none. An arm of fewer than six joints shows only a part of it; the rest is
            set to zero, with a large standard deviation.
        force_rate: always None, since only estimators of single joints use it.
        delay: by which the torques of a log are recorded later than motion; `run` takes it out [s], (J,); empty: not at all. A
            loop passes torques as they act, so a tick does not.
    """

    BOUNDS: ClassVar = {"bandwidth": POSITIVE}
    CHOICES: ClassVar = {"method": k.METHODS}

    bodies: ArmBodies
    inertia: tuple[float, ...]
    offset: tuple[float, ...]
    friction: tuple[FrictionEstimator, ...]
    sliding: tuple[float, ...]
    resting: tuple[float, ...]
    slow: tuple[float, ...]
    filters: tuple[MotionFilter, ...] = ()
    method: str = "momentum"
    bandwidth: float = 50.0
    frame: str | None = None
    coupling: tuple[tuple[float, ...], ...] | None = None
    force_rate: float | None = field(default=None, repr=False)
    delay: tuple[float, ...] = ()

    def __post_init__(self):
        super().__post_init__()
        robot, J = self.bodies.robot, len(self.joints)
        for name in ("inertia", "offset", "friction", "sliding", "resting", "slow"):
            if len(getattr(self, name)) != J:
                raise InvalidInput(
                    f"{len(getattr(self, name))} of {name} for {J} joints ({', '.join(self.joints)}).",
                    remedy="Give one per joint.",
                )
        if self.delay and (len(self.delay) != J or not np.isfinite(self.delay).all()):
            raise InvalidInput(
                f"delay {self.delay} for {J} joints.", remedy="Give one finite number per joint, or none."
            )
        if self.frame is not None:
            robot.frame(self.frame)
        if self.coupling is not None:
            C = check_coupling(self.coupling, J)
            object.__setattr__(self, "coupling", tuple(map(tuple, C.tolist())))

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints, in the order of all arrays."""
        return self.bodies.robot.joints

    @classmethod
    def from_model(
        cls,
        model: FrictionModel,
        robot: str | Path | Robot,
        *,
        method: str = "momentum",
        bandwidth: float = 50.0,
        frame: str | None = None,
    ) -> ArmForce:
        """Return an estimator from a model of an arm: bodies, motors, offsets, friction and its growth, bands, delay of the torque.

        Args:
            model: of a whole arm (`identify --method arm --urdf`).
            robot: path of the description that the model was identified with, or the robot.
            method: as above.
            bandwidth: L [1/s].
            frame: at which a wrench is wanted: a link, a fixed tool or a site; None: none.

        Raises:
            InvalidInput: the model is not of an arm, or belongs to another description.
            UnknownName: there is no such frame; all are listed.
        """
        known = robot_of(model, robot)
        C = known.coupling_of(model.coupling, model.coupled or model.names)
        plain = C is None or np.array_equal(C, np.eye(len(known.joints)))
        frictions = [with_break_away(model.joint(name)) for name in known.joints]
        values = [{term: e.value for term, e in f.dynamics.items()} for f in frictions]
        bands = [deviations(f) for f in frictions]
        return cls(
            bodies=ArmBodies.of_model(model, known),
            inertia=tuple(v.get("inertia", 0.0) for v in values),
            offset=tuple(v.get("offset", 0.0) for v in values),
            friction=tuple(FrictionEstimator(law=contact(f)) for f in frictions),
            sliding=tuple(sliding for sliding, _ in bands),
            resting=tuple(resting for _, resting in bands),
            slow=tuple(SLOW * v.get("transition", 1e-3) for v in values),
            method=method,
            bandwidth=bandwidth,
            frame=frame,
            coupling=None if C is None or plain else tuple(map(tuple, C.tolist())),
            delay=tuple(f.delay for f in frictions),
        )

    def inertia_at(self, position: np.ndarray) -> np.ndarray:
        """Return the inertia of bodies and motors [kg.m^2 or kg], (J, J), at positions of the motors [rad or m], (J,)."""
        C = np.eye(len(self.joints)) if self.coupling is None else np.array(self.coupling)
        return C.T @ self.bodies.robot.inertia((C @ position)[None])[0] @ C + np.diag(self.inertia)

    def replace(self, **changes) -> ArmForce:
        """Return the same with other fields."""
        return replace(self, **changes)

    def lag(self, dt: float) -> float:
        """Return the lag of the estimate for a force that grows at a constant rate [s]; NaN for `direct`, whose filter is
        nonlinear.

        Args:
            dt: sampling time [s].
        """
        if self.method == "direct":
            return float("nan")
        gains = KNOWN[self.method].gains
        return 1.0 / self.bandwidth + dt if gains is None else lag_of(gains(self, dt)[:3]) * dt  # type: ignore[arg-type]

    def row(self, dt: float) -> np.ndarray:
        """Return the row that the kernel reads: 14 numbers, and ROW numbers for each joint."""
        J = len(self.joints)
        c = np.zeros(k.GLOBAL + k.ROW * J)
        c[k.METHOD], c[k.BAND], c[k.PERIOD] = k.METHODS.index(self.method), self.bandwidth, dt
        c[k.JOINTS], c[k.WRENCH] = J, self.frame is not None
        gains = KNOWN[self.method].gains
        if gains is not None:
            *c[k.GAINS : k.GAINS + 3], c[k.BAND] = gains(self, dt)  # type: ignore[arg-type]
        if self.frame is not None:
            c[k.DAMPING : k.DAMPING + FULL] = self.damping()
        filters = self.filters or self.default_filters()
        for j, own in enumerate(c[k.GLOBAL :].reshape(J, k.ROW)):
            own[: k.FRICTION] = filters[j].row()
            own[k.FRICTION : k.INERTIA] = self.friction[j].row()
            own[k.INERTIA :] = (
                self.inertia[j],
                self.offset[j],
                self.sliding[j],
                self.resting[j],
                self.slow[j],
            )
        return c

    def default_filters(self) -> tuple[MotionFilter, ...]:
        """Return filters with a lag of at most 1/L for accelerations up to ten times friction divided by inertia."""
        own = np.diag(self.inertia_at(np.zeros(len(self.joints))))
        follow = [
            ABRUPT * max(at_rest(f.law), 1e-9) / max(m, 1e-9) for f, m in zip(self.friction, own, strict=True)
        ]
        return tuple(MotionFilter.of_bandwidth(self.bandwidth, a) for a in follow)

    def damping(self) -> np.ndarray:
        """Return P, the inverse variance at ten times the deviations in the median posture [1/N^2, 1/(N.m)^2], (6,).

        With fewer than six joints, some directions are unobservable in every posture. The deviations are then those of the
        best observable force and moment.
        """
        assert self.frame is not None
        rng = np.random.default_rng(0)
        robot = self.bodies.robot
        q = rng.uniform(-np.pi, np.pi, (POSTURES, len(self.joints)))
        for j, one in enumerate(robot.ranges):
            if np.isfinite(one.upper - one.lower):
                q[:, j] = rng.uniform(one.lower, one.upper, POSTURES)
        jacobians = robot.jacobian(q, self.frame)
        turned = jacobians if self.coupling is None else jacobians @ np.array(self.coupling)
        weighted = turned / np.array(self.sliding)
        information = weighted @ np.swapaxes(weighted, 1, 2)
        size = np.median(np.einsum("nii->ni", information), axis=0)
        if len(self.joints) < FULL:
            best = np.repeat([size[:3].max(), size[3:].max()], 3)
            return np.where(best > 0.0, best, size.max()) / FAR**2
        least = 1e-12 * np.maximum(size, 1e-30)
        variance = np.median(np.einsum("nii->ni", np.linalg.inv(information + np.diag(least))), axis=0)
        return 1.0 / (FAR**2 * variance)

    def online(self, period: float) -> ArmForceTick:
        """Return the estimator's online form for a control loop.

        Args:
            period: of the loop [s].
        """
        return ArmForceTick(self, period)

    def run(
        self,
        position: np.ndarray,
        torque: np.ndarray,
        dt: float,
        velocity: np.ndarray | None = None,
        temperature: np.ndarray | None = None,
    ) -> ArmSeries:
        """Return external torque, friction and wrench along a log.

        Args:
            position: encoder readings [rad or m], (n, J).
            torque: commands of the ticks; command k acts after reading k, `delay` before it is recorded [N.m or N], (n, J).
            dt: sampling time [s].
            velocity: at the first reading [rad/s or m/s], (J,); None: the arm rests.
            temperature: of the joints [degC], (n, J); None: 20.

        Raises:
            InvalidInput: shapes that do not fit, or numbers that are not finite.
        """
        q, u = (np.ascontiguousarray(x, dtype=np.float64) for x in (position, torque))
        J = len(self.joints)
        if q.ndim != 2 or q.shape != u.shape or q.shape[1] != J or q.shape[0] == 0:
            raise InvalidInput(
                f"position {q.shape}, torque {u.shape} for {J} joints.",
                remedy=f"Give (n, {J}) each, in the order {', '.join(self.joints)}.",
            )
        if not (np.all(np.isfinite(q)) and np.all(np.isfinite(u))):
            raise InvalidInput("Position or torque hold NaN.", remedy="Repair the log (--repair).")
        u = on_time(u, np.array(self.delay or 0.0), dt)
        runner, n = self.online(dt), q.shape[0]
        out = np.empty((n, 3, J))
        wrenches = np.zeros((n if self.frame is not None else 0, FULL + FULL**2 + 1))
        runner.reset(q[0] if velocity is None else q[0] - dt * np.asarray(velocity), velocity)
        for i in range(n):
            runner.tick(q[i], u[max(i - 1, 0)], None, None if temperature is None else temperature[i])
            out[i, 0], out[i, 1], out[i, 2] = runner.force, runner.friction, runner.deviation
            if self.frame is not None:
                wrenches[i] = runner.wrench_row
        return ArmSeries(
            force=out[:, 0],
            friction=out[:, 1],
            deviation=out[:, 2],
            wrench=wrenches[:, :FULL],
            covariance=wrenches[:, FULL:-1].reshape(-1, FULL, FULL),
            singular=wrenches[:, -1] > SINGULAR,
        )


def robot_of(model: FrictionModel, robot: str | Path | Robot) -> Robot:
    """Return the robot of an arm's model; joints of a tool that are not in the model are fixed.

    Args:
        model: of friction.
        robot: path of a description, or the robot.

    Raises:
        InvalidInput: the model is not of an arm, or belongs to another description.
    """
    if model.arm is None:
        raise InvalidInput(
            "This model is not of a whole arm.", remedy="Identify with --method arm --urdf ROBOT."
        )
    read = robot if isinstance(robot, Robot) else load_robot(robot)
    return read.for_model(model.names, model.arm.urdf_sha256, len(model.arm.parameters))


def deviations(friction: JointFriction) -> tuple[float, float]:
    """Return the standard deviations of the torque that a joint's model does not explain, in motion and at rest [N.m or N].

    At rest, the half-width of the band is at least the friction. Without bands, it is a tenth of the friction in motion.
    """
    size = max(at_rest(friction.law), 1e-6)
    half = 0.1 * size
    if friction.bands is not None:
        half = next(
            (b.half_width for b in (friction.bands.moving, friction.bands.reversing) if b is not None), half
        )
    return max(half, 1e-9) / WIDTH, max(half, size) / WIDTH


__all__ = ["ArmForce", "ArmForceTick", "ArmSeries", "robot_of"]
