"""Stiffness, hysteresis and break-away of a joint, from torque ramps (Iwatani 2017, 3.2.2, Fig. 3.3).

Below break-away a joint only deflects. The deflection gives the stiffness between encoder and friction, if the encoder
resolves it. Otherwise only a lower bound of the stiffness is known: torque divided by counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.identification.break_away import EDGE, SHORTEST, STRAIGHT
from backdrive.identification.ramp_branches import (
    BRANCH,
    CUTOFF,
    RESOLVED,
    Branch,
    branches_of,
    low_pass_torque,
    ramp_turns,
)
from backdrive.identification.signals import spans
from backdrive.identification.sweep_windows import turning_points
from backdrive.logs import filters
from backdrive.logs.log import Log
from backdrive.logs.resolution import channel_noise, encoder_step, white_noise

VAGUE = 0.5  # largest relative standard error of a stiffness [-]
ROUNDING = 1e-6  # noise below which it counts as rounding error, relative to the range of the torque [-]
NOISE = 3.0  # contribution of noise to an extreme of the torque [standard deviation]
FEWEST = 100  # least number of samples of a log of ramps
RAMPED = 0.7  # least share of ramps in a log of ramps [-]
BACK = 0.2  # largest travel back within one slide, relative to that ahead [-]
CLEARLY = 1.2  # deviation of means from lines, relative to the largest of a ramp, for none [-]
HELD = 0.1  # least share of a log of ramps in which the joint sticks [-]


@dataclass(frozen=True, kw_only=True, eq=False)
class Presliding:
    """The presliding of one joint on torque ramps.

    Attributes:
        branches: parts of ramps in which the joint sticks, in order.
        count: resolution of the position [rad or m].
        displacement: largest displacement before break-away [rad or m].
        stiffness: secant stiffness and its standard error [N.m/rad or N/m]; None below the encoder's resolution.
        tangent: stiffness at the start of a branch and its standard error [N.m/rad or N/m]; None below that resolution.
        bound: lower bound of the stiffness [N.m/rad or N/m].
        break_away: torque at the start of a slip, as measured, and its standard error, for rising and for falling torque
            [N.m or N]; None without a slip.
        largest: largest and smallest torque of the ramps [N.m or N].
        rest: torque before the first ramp [N.m or N].
        width: of the hysteresis loop at its middle torque [rad or m]; NaN without a closed loop free of slip.
        area: work lost in that loop [J].
        slip_speed: speed above which the joint counts as sliding [rad/s or m/s].
    """

    branches: tuple[Branch, ...]
    count: float
    displacement: float
    stiffness: tuple[float, float] | None
    tangent: tuple[float, float] | None
    bound: float
    break_away: tuple[tuple[float, float] | None, tuple[float, float] | None]
    largest: tuple[float, float]
    rest: float
    width: float
    area: float
    slip_speed: float

    @property
    def is_resolved(self) -> bool:
        """Whether the encoder resolves the displacement before break-away."""
        return self.stiffness is not None


def presliding(logs: Sequence[Log], joint: str | int) -> Presliding:
    """Return the presliding of a joint from torque ramps.

    Args:
        logs: with torque and position, each a ramp up, down and back.
        joint: name or column.

    Raises:
        InvalidInput: a log holds no torque or no position.
        NotIdentifiable: the torque does not go up and down, or the joint slides all the time.
    """
    singles = [log.select(joint).on_joint_side() for log in logs]
    for log in singles:
        if log.torque is None or log.position is None:
            raise InvalidInput(
                f"Joint '{joint}': a ramp needs torque and position.", remedy="Name the channels with --map."
            )
    count = max(encoder_step(log) or 3.0 * white_noise(log.need("position")[:, 0]) for log in singles)
    found = [branches_of(log, count) for log in singles]
    branches = [b for each, _, _ in found for b in each]
    if not branches:
        raise NotIdentifiable(
            f"Joint '{joint}': there is no stretch in which the torque ramps and the joint sticks.",
            remedy="Record it along `backdrive plan ramp`, slowly, from rest.",
        )
    displacement = max(float(np.ptp(b.position)) for b in branches)
    _, stiffness, elastic = _elastic(branches, count)
    clear = _with_displacement(branches, count)
    if not elastic:
        raise NotIdentifiable(
            f"Joint '{joint}': it moves by {displacement:.3g} before it slides, but not like a spring: this is not "
            f"a torque ramp.",
            remedy="Record it along `backdrive plan ramp`, slowly, from rest; or use --method motion.",
        )
    width, area = hysteresis_loop(singles, [speed for _, speed, _ in found])
    ends = [_ends(log) for log in singles]
    return Presliding(
        branches=tuple(branches),
        count=count,
        displacement=displacement,
        stiffness=stiffness,
        tangent=_stiffness([b.tangent for b in clear], clear, count) if clear else None,
        bound=max(b.bound(count) for b in branches),
        break_away=(_break_away(branches, 1), _break_away(branches, -1)),
        largest=(max(high for _, high in ends), min(low for low, _ in ends)),
        rest=float(np.mean([rest for _, _, rest in found])),
        width=width,
        area=area,
        slip_speed=float(max(speed for _, speed, _ in found)),
    )


def is_ramp(log: Log, joint: str | int) -> bool:
    """Return whether a joint's torque moves up and down in straight lines, and the joint slips only at their ends.

    Args:
        log: any log.
        joint: name or column.
    """
    if log.torque is None or log.position is None:
        return False
    single = log.select(joint).on_joint_side()
    torque, position = single.driving_torque[:, 0], single.need("position")[:, 0]
    finite = np.isfinite(torque).all() and np.isfinite(position).all()
    if len(single) < FEWEST or not finite or not np.ptp(torque) > 0.0:
        return False
    noise = channel_noise(single, "torque", 0) if single.external_torque is None else white_noise(torque)
    if not _may_ramp(torque, noise, single.period):
        return False
    smooth, rate, _ = low_pass_torque(single)
    edge, span = EDGE * rate, float(np.ptp(smooth))
    far = STRAIGHT * span + noise
    if not _are_straight(smooth, turning_points(smooth, BRANCH * span), edge, far, but_first=True):
        return False  # sooner known than a rest before the first one
    turns = ramp_turns(smooth, BRANCH, edge)
    if np.diff(turns).sum() < RAMPED * len(single) or not _are_straight(smooth, turns, edge, far):
        return False
    count = encoder_step(single) or 3.0 * white_noise(position)
    branches, slip_speed, _ = branches_of(single, count)
    if _to_and_fro(position, slip_speed, single.period):
        return False
    held = sum(b.torque.size for b in branches)
    slips = any(b.break_away is not None for b in branches)
    return held > HELD * len(single) and (slips or len(branches) > 2) and _elastic(branches, count)[2]


def _are_straight(
    smooth: np.ndarray,
    turns: np.ndarray,
    edge: float,
    far: float,
    but_first: bool = False,
    shortest: int = SHORTEST,
) -> bool:
    """Return whether a torque is straight between its turns, of which there are two at least and none too close together.

    Args:
        smooth: low-passed torque [N.m or N], (n,).
        turns: samples at which ramps begin and end, (k,).
        edge: what counts as a turn to either side of it [sample].
        far: largest RMS deviation from lines [N.m or N].
        but_first: leave out the first ramp, before which there may be a rest.
        shortest: least number of samples between what counts as two turns.
    """
    if turns.size < 2:
        return False
    inner = [slice(a + round(edge), max(b - round(edge), a + 1)) for a, b in pairwise(turns.tolist())]
    left = sum(part.stop - part.start for part in inner) * far**2
    for part in inner[but_first:]:
        if part.stop - part.start < shortest:
            return False
        left -= _off_line(smooth[part])
        if left < 0.0:
            return False
    return True


def _may_ramp(torque: np.ndarray, noise: float, period: float) -> bool:
    """Return whether a torque may move in straight lines, by its low-passed means.

    Args:
        torque: [N.m or N], (n,).
        noise: of the torque from sample to sample [N.m or N].
        period: sampling interval [s].
    """
    smooth, rate = filters.low_pass_means(torque, min(CUTOFF, 0.1 / period), 1.0 / period)
    span = float(np.ptp(smooth))
    turns, far = turning_points(smooth, BRANCH * span), CLEARLY * (STRAIGHT * span + noise)
    return _are_straight(smooth, turns, max(EDGE * rate - 1.0, 0.0), far, but_first=True, shortest=2)


def _off_line(x: np.ndarray) -> float:
    """Return the sum of the squared deviations of a series (n,) from its line."""
    time, left = np.arange(x.size) - 0.5 * (x.size - 1), x - x.mean()
    left -= time @ left / (time @ time) * time
    return float(left @ left)


def _to_and_fro(position: np.ndarray, slip_speed: float, period: float) -> bool:
    """Return whether a joint turns back while it slides, as it does in a motion, and not at the end of a ramp.

    Args:
        position: [rad or m], (n,).
        slip_speed: above which it slides [rad/s or m/s].
        period: sampling interval [s].
    """
    velocity = filters.derivative(filters.low_pass(position, min(CUTOFF, 0.1 / period), 1.0 / period), period)
    sliding = np.abs(velocity) >= slip_speed
    for start, stop in spans(~sliding):
        if (stop - start) * period < EDGE and start > 0 and stop < sliding.size:
            sliding[start:stop] = True  # a turn, too short for a rest
    for start, stop in spans(sliding):
        along = velocity[start:stop] * period
        ways = float(along[along > 0.0].sum()), -float(along[along < 0.0].sum())
        if min(ways) > BACK * max(ways):
            return True
    return False


def _elastic(branches: Sequence[Branch], count: float) -> tuple[bool, tuple[float, float] | None, bool]:
    """Return whether the encoder resolves the presliding displacement, the secant stiffness, and whether it may be elastic."""
    resolved = _with_displacement(branches, count)
    stiffness = _stiffness([b.secant for b in resolved], resolved, count) if resolved else None
    return (
        bool(resolved),
        stiffness,
        not resolved or (stiffness is not None and stiffness[1] <= VAGUE * stiffness[0]),
    )


def _with_displacement(branches: Sequence[Branch], count: float) -> list[Branch]:
    """Return the branches whose displacement the encoder resolves, so that they determine a stiffness."""
    return [b for b in branches if float(np.ptp(b.position)) >= RESOLVED * count]


def _ends(log: Log) -> tuple[float, float]:
    """Return the smallest and the largest torque without the contribution of noise [N.m or N]: of many samples one is far off."""
    torque = log.driving_torque[:, 0]
    low, high, noise = float(torque.min()), float(torque.max()), white_noise(torque)
    if NOISE * noise < ROUNDING * (high - low):
        return low, high
    smooth, rate, cutoff = low_pass_torque(log)
    low, high, left = float(smooth.min()), float(smooth.max()), NOISE * noise * (2.0 * cutoff / rate) ** 0.5
    return min(low + left, 0.5 * (low + high)), max(high - left, 0.5 * (low + high))


def _break_away(branches: Sequence[Branch], direction: int) -> tuple[float, float] | None:
    found = [b.break_away for b in branches if b.direction == direction and b.break_away is not None]
    if not found:
        return None
    torque, blur = np.array(found).T
    scatter = float(np.std(torque, ddof=1) / np.sqrt(torque.size)) if torque.size > 1 else 0.0
    return float(torque.mean()), float(np.hypot(scatter, blur.mean()))


def _stiffness(
    compliances: Sequence[tuple[float, float]], branches: Sequence[Branch], count: float
) -> tuple[float, float] | None:
    """Return the stiffness from all branches and its standard error; None if their mean compliance is not positive."""
    c = np.array([value for value, _ in compliances])
    spans = np.array([float(np.ptp(b.torque)) for b in branches])
    error = np.hypot([e for _, e in compliances], count / np.sqrt(12.0) / spans)
    weight = 1.0 / np.maximum(error, 1e-300) ** 2
    mean = float(weight @ c / weight.sum())
    if mean <= 0:
        return None
    scatter = float(np.sqrt(weight @ (c - mean) ** 2 / weight.sum() / max(c.size - 1, 1)))
    return 1.0 / mean, max(scatter, float(1.0 / np.sqrt(weight.sum()))) / mean**2


def hysteresis_loop(logs: Sequence[Log], slips: Sequence[float]) -> tuple[float, float]:
    """Return width [rad or m] and area [J] of the last closed hysteresis loop without slip; NaN if there is none.

    Iwatani 2017, Fig. 3.3.

    Args:
        logs: of one joint, torque ramps.
        slips: speed above which the joint slips, one per log [rad/s or m/s].
    """
    width, area = float("nan"), float("nan")
    for log, limit in zip(logs, slips, strict=True):
        u, rate, cutoff = low_pass_torque(log)
        x = filters.low_pass(log.position[:, 0], cutoff, rate)  # type: ignore[index]
        speed = np.abs(filters.derivative(x, log.period))
        turns = turning_points(u, BRANCH * float(np.ptp(u)))
        for a, b, c in zip(turns[1:], turns[2:], turns[3:], strict=False):
            if np.any(speed[a:c] >= limit) or abs(abs(u[b] - u[a]) / abs(u[c] - u[b]) - 1.0) > 0.1:
                continue
            middle = 0.5 * (u[a] + u[b])
            crossings = []
            for branch in (slice(a, b), slice(b, c)):
                rising = np.argsort(u[branch], kind="stable")
                crossings.append(np.interp(middle, u[branch][rising], x[branch][rising]))
            width = float(abs(crossings[1] - crossings[0]))
            loop_u, loop_x = np.append(u[a:c], u[a]), np.append(x[a:c], x[a])
            area = float(abs(np.sum(0.5 * (loop_u[1:] + loop_u[:-1]) * np.diff(loop_x))))
    return width, area
