"""The external torque on all joints of an arm along a log. The rigid bodies couple the joints, so they are estimated together.

    tau_e = M(q) ddq + h(q, dq) + g(q) + tau_f + offset - tau,        Iwatani 2017, (4.4)

All joints use the same method and bandwidth, so that their torques refer to the same instant and give a wrench. The bandwidth
is the median of those that suit the joints' noise.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from backdrive.control.estimators.arm import ArmForce
from backdrive.control.estimators.of_model import ABRUPT, WIDTH, at_rest, with_break_away
from backdrive.control.estimators.sliding_mode import MotionFilter
from backdrive.errors import NotIdentifiable
from backdrive.external.alternatives import Instants
from backdrive.external.arm_log import ArmLog, arm_log, at_motors, coupling_notes
from backdrive.external.bands import band, growth_of, states_along
from backdrive.external.choose import FASTEST, choose
from backdrive.external.explanation import LEAST, check_shares, explain
from backdrive.external.joint import (
    AUTO,
    SETTLED,
    noise_of,
    reference_torque,
    speed_along,
)
from backdrive.external.result import STATES, JointForce
from backdrive.external.temperature import along_stretches
from backdrive.external.wrench import WrenchEstimate, wrench_of
from backdrive.external.wrench_axes import Convention, doubt, wrench_at
from backdrive.identification.delay import earlier
from backdrive.laws import REFERENCE
from backdrive.logs.log import Log
from backdrive.model import FrictionModel
from backdrive.robot import Robot

SIMPLEST = "momentum"  # observer that is stable at every bandwidth chosen
UNSETTLED = 10.0  # ratio to the unsmoothed force above which an observer counts as unstable [-]
REST = STATES.index("rest")


class ArmEstimate:
    """Estimates along logs of one arm."""

    def __init__(
        self,
        model: FrictionModel,
        robot: str | Path | Robot,
        frame: str | None = None,
        accepted: bool = False,
    ):
        """Take the arm's parameters from the model.

        Args:
            model: of a whole arm.
            robot: path of its description, or the robot.
            frame: at which a wrench is wanted; None: none.
            accepted: estimate logs whose torque the model does not explain, too.

        Raises:
            InvalidInput: the model is not of an arm, or belongs to another description.
            UnknownName: there is no such frame.
        """
        self.accepted = accepted
        self.estimator = ArmForce.from_model(model, robot, frame=frame)
        self.frictions = tuple(with_break_away(model.joint(name)) for name in self.estimator.joints)
        J, coupling = len(self.frictions), self.estimator.coupling
        self._C = np.eye(J) if coupling is None else np.array(coupling)

    def forces(
        self, log: Log, method: str = AUTO, bandwidth: float | None = None, least: float = 0.0
    ) -> tuple[list[JointForce], list[str]]:
        """Return the external torque on every joint, in the order of the description, and remarks.

        Args:
            log: with position and torque of all joints.
            method: of the estimator; `auto`: by the noise of the log.
            bandwidth: L [1/s]; None: by the noise of the log.
            least: smallest bandwidth to choose [1/s].

        Raises:
            InvalidInput: a joint is missing or in another unit, positions are in degrees, or the log is of another robot.
            NotIdentifiable: the log is too short.
        """
        arm, remarks = arm_log(self.estimator, self.frictions, log), []
        warmth = [
            along_stretches(f, column, remarks)
            for f, column in zip(self.frictions, zip(*arm.stretches, strict=True), strict=True)
        ]
        warmths = list(zip(*warmth, strict=True))
        rate = arm.stretches[0][0].rate
        plain, by_noise = None, method == AUTO
        if by_noise or bandwidth is None:
            plain = self._parts(self._estimator(SIMPLEST, FASTEST * rate, arm), arm, warmths)
            chosen = self._choose(plain, arm, None if by_noise else method)
            method, bandwidth = chosen[0], bandwidth or max(chosen[1], min(least, FASTEST * rate))
        estimator = self._estimator(method, bandwidth, arm)
        parts = self._parts(estimator, arm, warmths)
        if by_noise and plain is not None and not _settles(parts, plain):
            method = SIMPLEST
            estimator = self._estimator(method, bandwidth, arm)
            parts = self._parts(estimator, arm, warmths)
        time = np.concatenate([p[0] for p in parts])
        if time.size < LEAST:
            raise NotIdentifiable(
                f"Every stretch of the log is over before an estimator of {bandwidth:.3g} 1/s has settled.",
                remedy="Give a larger --bandwidth, or a longer log.",
            )
        force, taken, state, warm = (np.concatenate([p[i] for p in parts]) for i in range(1, 5))
        if not np.isfinite(force).all():
            raise NotIdentifiable(
                f"At {rate:.0f} Hz a '{method}' observer of {bandwidth:.3g} 1/s does not settle on this arm.",
                remedy="Give a smaller --bandwidth, or --method momentum.",
            )
        carried = self._load_at_rest(arm, time, force, state)
        results, told = [], at_motors(self.estimator, log)
        remarks += coupling_notes(self.estimator, log)
        for j, friction in enumerate(self.frictions):
            if friction.verdict is not None and friction.verdict.grade in ("poor", "unknown"):
                remarks.append(
                    f"Joint '{friction.joint.name}': its model was graded as not credible or poor, "
                    f"so the force is equally unreliable."
                )
            lower, upper = band(
                friction, force[:, j], taken[:, j], state[:, j], remarks, warm[:, j], carried[:, j]
            )
            results.append(
                JointForce(
                    joint=friction.joint,
                    time=time,
                    force=force[:, j],
                    friction=taken[:, j],
                    lower=lower,
                    upper=upper,
                    state=state[:, j].astype(np.int8),
                    method=method,
                    bandwidth=float(bandwidth),
                    lag=estimator.lag(1.0 / rate),
                    known=reference_torque(told, friction.joint.name, time),
                    speed=speed_along([s[j] for s in arm.stretches], time),
                )
            )
            beyond = friction.extrapolation(np.concatenate([s[j].velocity for s in arm.stretches]))
            remarks += [beyond] if beyond else []
        shares = [
            explain(one, friction, [s[j] for s in arm.stretches])
            for j, (one, friction) in enumerate(zip(results, self.frictions, strict=True))
        ]
        remarks += check_shares(
            [s for s in shares if s is not None],
            lambda: Instants(self.estimator, self.frictions, arm.stretches),
            self.accepted,
        )
        return results, remarks

    def _load_at_rest(
        self, arm: ArmLog, time: np.ndarray, force: np.ndarray, state: np.ndarray
    ) -> np.ndarray:
        """Return the load of each joint at rest [N.m or N], 0 elsewhere, (n, J): friction at rest grows with it."""
        clock = np.concatenate([s[0].time for s in arm.stretches])
        carried = np.zeros_like(force)
        rest = np.flatnonzero((state == 2).any(axis=1))
        if rest.size:
            q = np.column_stack(
                [
                    np.interp(time[rest], clock, np.concatenate([s[j].position for s in arm.stretches]))  # type: ignore[misc]
                    for j in range(force.shape[1])
                ]
            )
            carried[rest] = self.estimator.bodies.robot.gravity(q @ self._C.T) @ self._C - force[rest]
        return np.where(state == 2, carried, 0.0)

    def wrench(
        self, log: Log, joints: Sequence[JointForce], axes: str = "frame"
    ) -> tuple[WrenchEstimate, list[str]]:
        """Return the wrench at the frame that explains the torques of the joints along a log, and remarks.

        Args:
            log: with a measured wrench, or without.
            joints: external torques.
            axes: along which a measured wrench is: `frame`, those of the frame itself, or `base`.
        """
        arm, frame = arm_log(self.estimator, self.frictions, log), str(self.estimator.frame)
        time = np.concatenate([s[0].time for s in arm.stretches])
        position = np.concatenate([np.column_stack([one.position for one in s]) for s in arm.stretches])  # type: ignore[misc]
        if log.wrench is None:
            estimate = wrench_of(self.estimator, time, position, joints)
            return estimate, estimate.remarks()
        clock, stated = joints[0].time, Convention(frame=frame, axes=axes)
        good, robot = np.isfinite(log.time), self.estimator.bodies.robot
        q = np.column_stack([np.interp(clock, time, column) for column in position.T]) @ self._C.T
        raw = np.column_stack([np.interp(clock, log.time[good], column[good]) for column in log.wrench.T])
        known = wrench_at(raw, robot, q, stated, frame)
        estimate = wrench_of(self.estimator, time, position, joints, known)
        said = doubt(estimate, raw, robot, q, stated)
        return estimate, [*estimate.remarks(), *([] if said is None else [said])]

    def widen(self, joints: Sequence[JointForce]) -> list[JointForce]:
        """Return the torques with bands that include the uncertainty of the friction's growth with the load."""
        results = []
        for one, friction in zip(joints, self.frictions, strict=True):
            moving = one.state != REST  # the band at rest includes it already
            more = WIDTH * growth_of(friction)[1] * np.where(moving, np.abs(one.force), 0.0)
            lower, upper = (
                one.force + side * np.hypot(side * (end - one.force), more)
                for side, end in ((-1.0, one.lower), (1.0, one.upper))
            )
            results.append(replace(one, lower=lower, upper=upper))
        return results

    def _estimator(self, method: str, bandwidth: float, arm: ArmLog) -> ArmForce:
        """Return the estimator of a method and bandwidth; the filters of `direct` follow this log's accelerations."""
        made = self.estimator.replace(method=method, bandwidth=bandwidth, frame=None)
        if method != "direct":
            return made
        inertia = np.diag(made.inertia_at(self._middle(arm)))
        filters = []
        for j, friction in enumerate(self.frictions):
            fastest = max(float(np.abs(s[j].acceleration).max()) for s in arm.stretches)
            by_friction = max(at_rest(friction.law), 1e-9) / max(float(inertia[j]), 1e-9)
            follow = fastest + min(by_friction, ABRUPT * fastest)
            filters.append(MotionFilter.of_bandwidth(bandwidth, max(follow, 1e-6)))
        return made.replace(filters=tuple(filters))

    def _middle(self, arm: ArmLog) -> np.ndarray:
        return np.array([np.mean(s.position) for s in arm.stretches[0]])  # type: ignore[arg-type]

    def _parts(
        self, estimator: ArmForce, arm: ArmLog, warmths: Sequence[Sequence[np.ndarray | None]]
    ) -> list[tuple[np.ndarray, ...]]:
        """Return time, force, friction, state and temperature of every stretch, settled and with the lag taken out."""
        parts = []
        for stretch, warm in zip(arm.stretches, warmths, strict=True):
            rate = stretch[0].rate
            dt, lags = 1.0 / rate, 1.0 / estimator.bandwidth
            # the torque between a reading and the next; its delay is the estimator's
            torque = np.column_stack([earlier(s.torque, -0.5, linear=True) for s in stretch])
            position = np.column_stack([s.position for s in stretch])  # type: ignore[misc]
            velocity = np.array([s.velocity[0] for s in stretch])
            degrees = np.column_stack(
                [
                    np.full(s.time.size, REFERENCE) if w is None else w
                    for s, w in zip(stretch, warm, strict=True)
                ]
            )
            out = estimator.run(position, torque, dt, velocity, degrees)
            lag = estimator.lag(dt)
            back = 0.0 if np.isnan(lag) else -lag * rate
            state = np.column_stack(
                [
                    states_along(f, s, estimator.bandwidth)
                    for s, f in zip(stretch, self.frictions, strict=True)
                ]
            )
            force, taken = (
                np.column_stack([earlier(x[:, j], back) for j in range(x.shape[1])])
                for x in (out.force, out.friction)
            )
            settled = int(np.ceil(SETTLED * (lags + dt) * rate))
            parts.append(tuple(x[settled:] for x in (stretch[0].time, force, taken, state, degrees)))
        return parts

    def _choose(
        self, plain: Sequence[tuple[np.ndarray, ...]], arm: ArmLog, method: str | None
    ) -> tuple[str, float]:
        """Return the method that suits the noise of most joints, and the median of their bandwidths [1/s]."""
        longest = max(range(len(plain)), key=lambda i: plain[i][0].size)
        inertia = np.diag(self.estimator.inertia_at(self._middle(arm)))
        force = plain[longest][1]
        if force.shape[0] < LEAST:
            raise NotIdentifiable("The log is too short.", remedy="Give a longer log.")
        picks = []
        for j, friction in enumerate(self.frictions):
            signals = [s[j] for s in arm.stretches]
            one = arm.log.select(friction.joint.name)
            noise = noise_of(friction, one, signals, float(inertia[j]))
            picks.append(choose(force[:, j], noise, method))
        most = Counter(name for name, _ in picks).most_common(1)[0][0]
        return most, float(np.median([L for _, L in picks]))


def _settles(parts: Sequence[tuple[np.ndarray, ...]], plain: Sequence[tuple[np.ndarray, ...]]) -> bool:
    """Return whether an observer's forces stay bounded, compared with the unsmoothed ones."""
    largest, usual = (max(float(np.abs(p[1]).max(initial=0.0)) for p in each) for each in (parts, plain))
    return largest <= UNSETTLED * usual
