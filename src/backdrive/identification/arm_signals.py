"""From logs of a whole arm to uniform, gap-free, differentiated signals of all joints in the robot's order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.identification.clock import between_gaps
from backdrive.identification.delay import earlier
from backdrive.identification.signals import SHORTEST
from backdrive.logs import filters
from backdrive.logs.joint import coupling_between
from backdrive.logs.log import Log
from backdrive.robot import Robot

MOTION_CUTOFF = 20.0  # cutoff frequency of the position's low pass before differentiation [Hz]
WORK_RATE = 125.0  # largest sampling rate after thinning, well above the cutoff frequency [Hz]
SHORTEST_TIME = 1.0  # length below which a stretch between gaps is left out [s]
REST = 0.01  # share of the top speed below which a joint may be at rest [-]
REST_TIME = 0.2  # least length of a rest [s]
SETTLE = 0.1  # margin about a rest in which the filter affects the torque [s]
BLOCKS = 8  # number of blocks of the logs if none is held out
EVERY = 4  # the last of this many blocks is held out
SEAM = 0.5  # margin on both sides of a held-out block that is not fitted, since filters mix samples there [s]


@dataclass(frozen=True, kw_only=True, eq=False)
class ArmSignals:
    """Motion and torque of all joints between two gaps, in the robot's order.

    If motors drive several joints, velocity, acceleration and torque are those of the motors, on which friction and motor
    inertia act. Otherwise they are those of the joints.

    Attributes:
        time: uniform instants [s], (n,).
        position: of the joints, low-passed [rad or m], (n, J).
        velocity: [rad/s or m/s], (n, J).
        acceleration: [rad/s^2 or m/s^2], (n, J).
        torque: actuator plus external torque, low-passed only for the thinning [N.m or N], (n, J).
        rate: sampling frequency [Hz].
        fitted: mask of the fitted samples, (n,).
        held_out: mask of the held-out samples, (n,); no sample is in both masks.
        coupling: C of q_joint = C q_motor, in the robot's order, (J, J); None: each motor drives its joint.
        log: number of the log among the fitted ones; -1: of none of them.
    """

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    torque: np.ndarray
    rate: float
    fitted: np.ndarray
    held_out: np.ndarray
    coupling: np.ndarray | None = None
    log: int = 0

    def shift(self, delay: float) -> ArmSignals:
        """Return signals with the torque shifted earlier by a delay [s], to compensate the delay in a log."""
        if delay == 0.0:
            return self
        return replace(self, torque=np.ascontiguousarray(earlier(self.torque.T, -delay * self.rate).T))

    def at_motors(self, coupling: np.ndarray) -> ArmSignals:
        """Return signals with velocity, acceleration and torque converted from joints to motors."""
        back = np.linalg.inv(coupling).T
        return replace(
            self,
            velocity=self.velocity @ back,
            acceleration=self.acceleration @ back,
            torque=self.torque @ coupling,
            coupling=coupling,
        )


def prepare_arm(
    log: Log, robot: Robot, *, cutoff: float = MOTION_CUTOFF, coupling: np.ndarray | None = None
) -> list[ArmSignals]:
    """Return the gap-free stretches of a log, with all samples marked as fitted.

    Args:
        log: with position and torque of all the robot's joints, matched by name.
        robot: the description.
        cutoff: low pass of the position before differentiation [Hz].
        coupling: coupling matrix in the robot's order, (J, J), for a log without one.

    Raises:
        InvalidInput: a channel or joint is missing, not finite or in another unit.
        NotIdentifiable: no stretch is long enough.
    """
    for channel, column in (("position", "q"), ("torque", "tau")):
        if getattr(log, channel) is None:
            raise InvalidInput(
                f"The identification of an arm needs {channel}, and the log has none.",
                remedy=f"Name the channel, for example --map {column}=COLUMN.",
            )
    order = robot.order_in(log.names)
    for joint, unit in zip((log.joints[i] for i in order), robot.units, strict=True):
        if joint.unit != unit:
            raise InvalidInput(
                f"Joint '{joint.name}' is in {joint.unit} in the log and in {unit} in the URDF.",
                remedy="Correct the unit (--unit) or the names (--names).",
            )
    assert log.position is not None
    assert log.torque is not None
    if not (np.all(np.isfinite(log.position)) and np.all(np.isfinite(log.torque))):
        raise InvalidInput("Position or torque hold NaN.", remedy="Repair the log (--repair).")
    period = log.period
    if not period > 0 or np.any(np.diff(log.time) <= 0):
        raise InvalidInput("Time does not increase.", remedy="Repair the time channel (--repair).")
    least = max(SHORTEST, round(SHORTEST_TIME / period))
    stretches = [_stretch(log, order, rows, period, cutoff) for rows in between_gaps(log.time, period, least)]
    if not stretches:
        raise NotIdentifiable(
            f"No stretch between gaps lasts {least * period:.3g} s.",
            remedy="Record without dropping samples.",
        )
    known = coupling_between(log.coupling, log.names, robot.joints) if log.coupling is not None else coupling
    return stretches if known is None else [s.at_motors(known) for s in stretches]


def _stretch(log: Log, order: np.ndarray, rows: slice, period: float, cutoff: float) -> ArmSignals:
    """Return one stretch on a uniform, thinned clock, processed joint by joint to limit memory."""
    from scipy.interpolate import CubicSpline

    time = log.time[rows]
    n = round((time[-1] - time[0]) / period) + 1
    clock = time[0] + period * np.arange(n)
    even = n == time.size and float(np.max(np.abs(clock - time))) < 0.01 * period
    rate = 1.0 / period
    factor = max(1, int(np.ceil(rate / WORK_RATE - 1e-6)))
    work = clock[::factor]
    position, velocity, acceleration, torque = (np.empty((work.size, order.size)) for _ in range(4))
    assert log.position is not None
    assert log.torque is not None
    for j, column in enumerate(order):
        joint = log.joints[column]
        gear = joint.gear_ratio if joint.torque_side == "motor" else 1.0
        q, tau = log.position[rows, column], gear * log.torque[rows, column]
        if log.external_torque is not None:
            tau = tau + log.external_torque[rows, column]
        if not even:
            # a spline, since linear interpolation between jittered samples would cause accelerations
            q = CubicSpline(time, q)(np.clip(clock, time[0], time[-1]))
            tau = np.interp(clock, time, tau)
        smooth = filters.low_pass(q, cutoff, rate)
        dq = filters.derivative(smooth, period)
        position[:, j], velocity[:, j] = smooth[::factor], dq[::factor]
        acceleration[:, j] = filters.derivative(dq, period)[::factor]
        torque[:, j] = (filters.low_pass(tau, 0.4 * rate / factor, rate) if factor > 1 else tau)[::factor]
    return ArmSignals(
        time=work,
        position=position,
        velocity=velocity,
        acceleration=acceleration,
        torque=torque,
        rate=rate / factor,
        fitted=np.ones(work.size, dtype=bool),
        held_out=np.zeros(work.size, dtype=bool),
    )


def hold_out_all(stretches: Sequence[ArmSignals]) -> list[ArmSignals]:
    """Return the stretches of a held-out log, with no sample fitted and all samples held out."""
    return [
        replace(s, fitted=np.zeros_like(s.fitted), held_out=np.ones_like(s.held_out), log=-1)
        for s in stretches
    ]


def hold_out_blocks(stretches: Sequence[ArmSignals]) -> list[ArmSignals]:
    """Return the stretches with a quarter of the samples held out, in contiguous blocks with margins around them."""
    total = sum(s.time.size for s in stretches)
    result, first = [], 0
    for s in stretches:
        index = first + np.arange(s.time.size)
        block = index * BLOCKS // total
        held = block % EVERY == EVERY - 1
        seam = round(SEAM * s.rate)
        near = np.convolve(held, np.ones(2 * seam + 1), mode="same") > 0.5
        result.append(replace(s, fitted=~near, held_out=held))
        first += s.time.size
    return result


def resting(velocity: np.ndarray, top: np.ndarray, rate: float) -> np.ndarray:
    """Return a mask of long rests, in which friction is undetermined, with a margin for the filter, (n, J).

    Args:
        velocity: [rad/s or m/s], (n, J).
        top: top speed of each joint [rad/s or m/s], (J,).
        rate: sampling frequency [Hz].
    """
    from scipy.ndimage import binary_dilation, binary_opening

    slow = np.abs(velocity) < REST * top
    length, margin = max(round(REST_TIME * rate), 1), max(round(SETTLE * rate), 1)
    padded = np.pad(slow, ((length, length), (0, 0)), mode="edge")  # a rest may continue beyond the stretch
    still = binary_opening(padded, structure=np.ones((length, 1)))[length:-length]
    return binary_dilation(still, structure=np.ones((2 * margin + 1, 1)))
