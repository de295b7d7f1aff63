"""The delay of an arm's torque behind its motion, one for all joints: they share a bus and a controller.

    tau(t) = bodies(t - d) + rest  ~  bodies - d bodies' + rest

The bodies' torque determines d while a joint slides. Friction does not, since it lags after reversals even if d is zero. Each
joint's own columns are regressed out of the logged torque and of the derivative of the bodies' torque (Frisch, Waugh, Lovell).
The remainders give d for each joint, and a mean weighted by the noise. Its standard error is the larger of the scatter between
blocks of time and the scatter between joints. On arms with gears this is some milliseconds. A filter of the torque is thus
detected, but seldom a delay of one sample. The torque is shifted by d repeatedly, until no delay remains.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import binary_dilation

from backdrive.identification import regression, robust
from backdrive.identification.arm_errors import blocks_of
from backdrive.identification.arm_signals import ArmSignals
from backdrive.identification.arm_terms import Regressor, Rows, Terms, build, steps_of
from backdrive.identification.quality import JUDGED_BELOW
from backdrive.identification.user_delay import contradiction
from backdrive.logs.filters import derivative, low_pass

ROUNDS = 4  # largest number of shifts of the torque
SURE = 4.0  # least significance of a delay [standard error]
LONGEST = 0.05  # longest delay of the search [s]
EXACT = 5e-3  # largest standard error of a known delay [s]
FEWEST = 3  # least number of joints whose bodies' torque determines the delay
RIDGE = 1e-6  # ridge weight in the regression on a joint's own columns of unit length [-]
# share of the top speed below which friction may lag [-], and margin in time about such slow samples [s]
SLOW, SETTLE = 0.05, 0.3
TELLS = 1e-3  # least part of the derivative of the bodies' torque that the other columns do not explain [-]


@dataclass(frozen=True, kw_only=True)
class ArmSlip:
    """A delay of the torque.

    Attributes:
        delay: of the torque behind the motion [s]; negative if the log holds torque before it acts.
        error: its standard error [s].
    """

    delay: float
    error: float

    @property
    def is_significant(self) -> bool:
        """Whether the delay differs significantly from zero, or is known without an error."""
        if self.error == 0.0:
            return True
        return abs(self.delay) > SURE * self.error and self.error < EXACT and abs(self.delay) < LONGEST


def seek_slip(regressor: Regressor, terms: Sequence[Terms], beta: np.ndarray) -> ArmSlip | None:
    """Return the delay determined by the bodies' torque; None if fewer than three joints determine it.

    Args:
        regressor: of the stretches.
        terms: of every joint.
        beta: base parameters, (b,).
    """
    rows, stretches, step = build(regressor, terms), regressor.stretches, steps_of(regressor.stretches)
    bodies = [derivative(regressor.bodies(s, beta), 1.0 / x.rate) for s, x in enumerate(stretches)]
    change = np.concatenate(
        [low_pass(b, JUDGED_BELOW, x.rate)[::step] for b, x in zip(bodies, stretches, strict=True)]
    )
    slides = np.concatenate([_slides(x, terms)[::step] for x in stretches])
    rows = replace(rows, weight=rows.weight * slides)
    block = blocks_of(len(rows.torque), rows.rate)
    total, left = 0.0, None
    for _ in range(ROUNDS):
        moved = [low_pass(x.shift(total).torque, JUDGED_BELOW, x.rate)[::step] for x in stretches]
        left = slip_of(replace(rows, torque=np.concatenate(moved)), change, block)
        if left is None:
            return None
        total += left.delay
        if abs(total) > LONGEST or abs(left.delay) < 0.1 * left.error:
            break
    return None if left is None else ArmSlip(delay=total, error=left.error)


def with_delay(
    slip: ArmSlip | None, delay: float | None, period: float
) -> tuple[ArmSlip | None, tuple[str, ...]]:
    """Return a known delay in place of the estimate, and a warning if the estimate contradicts it.

    Args:
        slip: as estimated; None if the motion does not determine it.
        delay: as known [s]; None if it is not.
        period: sampling interval [s].
    """
    if delay is None:
        return slip, ()
    told = slip is not None and slip.error < EXACT
    wrong = contradiction(delay, (slip.delay, slip.error), period) if slip is not None and told else ""
    return ArmSlip(delay=delay, error=0.0), (wrong,) if wrong else ()


def _slides(s: ArmSignals, terms: Sequence[Terms]) -> np.ndarray:
    """Return a mask of samples away from slow motion, at which each joint slides steadily in one direction, (n, J)."""
    slow = np.abs(s.velocity) < SLOW * np.array([t.top for t in terms])
    around = round(SETTLE * s.rate)
    return np.logical_not(binary_dilation(slow, structure=np.ones((2 * around + 1, 1))))


def slip_of(rows: Rows, change: np.ndarray, block: np.ndarray) -> ArmSlip | None:
    """Return the remaining delay of the torque in the rows, to first order.

    Args:
        rows: of all joints.
        change: derivative of the bodies' torque, filtered like the rows [N.m/s or N/s], (N, J).
        block: number of the block of each row, (N,).
    """
    each, power, scores = [], [], []
    for j, friction in enumerate(rows.friction):
        used = rows.weight[:, j] > 0
        own = np.hstack([rows.bodies[used, j], friction[used, :-1]])
        if np.count_nonzero(used) < 4 * own.shape[1]:
            continue
        own = own / np.maximum(np.linalg.norm(own, axis=0), 1e-300)
        both = np.column_stack([change[used, j], rows.torque[used, j]])
        fitted = np.linalg.solve(own.T @ own + RIDGE * np.eye(own.shape[1]), own.T @ both)
        z, y = (both - own @ fitted).T
        told = float(z @ z)
        if not told > TELLS**2 * float(both[:, 0] @ both[:, 0]):
            continue
        delay = -float(z @ y) / told
        weight = max(robust.robust_spread(y + delay * z), 1e-300) ** -2.0
        each.append(delay)
        power.append(weight * told)
        sums = [np.bincount(block[used], weight * z * x, block[-1] + 1) for x in (y, z)]
        scores.append(np.array(sums))
    if len(each) < FEWEST:
        return None
    share, delays = np.array(power) / np.sum(power), np.array(each)
    mean = float(share @ delays)
    of_y, of_z = np.sum(scores, axis=0)
    blocks = regression.cluster_covariance(np.array([[1.0 / np.sum(power)]]), (of_y + mean * of_z)[:, None])
    joints = float(share @ (delays - mean) ** 2) / (len(each) - 1)
    return ArmSlip(delay=mean, error=float(np.sqrt(max(blocks[0, 0], joints))))
