"""What torque ramps show before a joint slides: stiffness, hysteresis and break-away (Iwatani 2017, 3.2.2, Fig. 3.3).

Below break-away a joint only stretches. How far, tells the stiffness of what lies between encoder and friction, provided that the
encoder resolves it; where it does not, only a lower bound of the stiffness can be given, torque over counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.identification.regression import long_run
from backdrive.identification.signals import spans
from backdrive.identification.sweep_windows import turning_points
from backdrive.logs import filters
from backdrive.logs.log import Log
from backdrive.logs.resolution import encoder_step, white_noise

CUTOFF = 20.0  # corner of the low pass on torque and position of a ramp [Hz]
BRANCH = 0.2  # a branch of a ramp covers at least this share of the whole torque range [-]
SLIPS = 30.0  # a joint slips when it moves so many times faster than at the start of the ramp [-]
FLICKER = 10.0  # and faster than so many counts in one period of the low pass [-]
RESOLVED = 5.0  # displacement before break-away from which on a stiffness is given [count]
START = 0.3  # share of a branch's torque, from its beginning, that gives the tangent [-]
VAGUE = 0.5  # a stiffness with a larger share of error is none [-]
LINE = 0.3  # share of a ramp before a slip by whose line the torque is read [-]
ROUNDING = 1e-6  # share of the range below which noise is what rounding leaves [-]
NOISE = 3.0  # standard deviations by which noise makes an extreme of the torque larger [-]
FEWEST = 100  # samples of a log that is taken for a ramp
RAMPED, HELD = (
    0.7,
    0.1,
)  # share of a log that ramps, and in which the joint sticks meanwhile, of such a log [-]
EDGE, STRAIGHT = (
    0.1,
    0.01,
)  # ends of a ramp that may be round [s], and how far off its line it may be by its range [-]
SHORTEST = 8  # a branch with fewer samples is left out


@dataclass(frozen=True, kw_only=True, eq=False)
class Branch:
    """A stretch of one ramp in which the joint sticks and the torque goes one way.

    Attributes:
        torque: [N.m or N], (n,).
        position: as read [rad or m], (n,).
        direction: 1 where the torque rises, -1 where it falls.
        break_away: torque at which the joint begins to slip at its end, and its uncertainty [N.m or N]; None where it does not.
    """

    torque: np.ndarray
    position: np.ndarray
    direction: int
    break_away: tuple[float, float] | None

    @property
    def secant(self) -> tuple[float, float]:
        """Compliance over the whole branch and its standard error [rad/N.m or m/N]."""
        return _compliance(self.torque, self.position)

    @property
    def tangent(self) -> tuple[float, float]:
        """Compliance at the beginning of the branch and its standard error [rad/N.m or m/N]."""
        change = np.maximum.accumulate(np.abs(self.torque - self.torque[0]))
        part = slice(0, max(8, int(np.searchsorted(change, START * change[-1]))))
        return _compliance(self.torque[part], self.position[part])

    def bound(self, count: float) -> float:
        """Return a stiffness that the joint certainly exceeds [N.m/rad or N/m].

        A reading that changes by n counts means a displacement below n + 1 counts.

        Args:
            count: resolution of the encoder [rad or m].
        """
        torque = np.abs(self.torque - self.torque[0])
        moved = np.maximum.accumulate(np.abs(self.position - self.position[0]))
        return float(np.max(torque / (moved + count)))


@dataclass(frozen=True, kw_only=True, eq=False)
class Presliding:
    """What the ramps of one joint show before it slides.

    Attributes:
        branches: in which it sticks, first to last.
        count: resolution of the position [rad or m].
        displacement: largest, before break-away [rad or m].
        stiffness: secant, and its standard error [N.m/rad or N/m]; None below the encoder's resolution.
        tangent: stiffness at the beginning of a branch, and its standard error [N.m/rad or N/m]; None likewise.
        bound: a stiffness that is certainly exceeded [N.m/rad or N/m].
        break_away: torque at which it began to slip, as measured, and its standard error: rising, falling [N.m or N]; None
            where it did not.
        largest: largest and smallest torque of the ramps [N.m or N].
        rest: torque before the first ramp [N.m or N].
        width: of the hysteresis at its middle torque [rad or m]; NaN without a loop free of slip.
        area: work lost in such a loop [J].
        slip_speed: speed from which on the joint is taken to slide [rad/s or m/s].
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
    def resolved(self) -> bool:
        """Whether the encoder resolves the displacement before break-away."""
        return self.stiffness is not None


def presliding(logs: Sequence[Log], joint: str | int) -> Presliding:
    """Return what torque ramps show of a joint before it slides.

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
    found = [_branches(log, count) for log in singles]
    branches = [b for each, _, _ in found for b in each]
    if not branches:
        raise NotIdentifiable(
            f"Joint '{joint}': there is no stretch in which the torque ramps and the joint sticks.",
            remedy="Record it along `backdrive plan ramp`, slowly, from rest.",
        )
    displacement = max(float(np.ptp(b.position)) for b in branches)
    resolved = displacement >= RESOLVED * count
    stiffness = _stiffness([b.secant for b in branches], branches, count) if resolved else None
    if resolved and (stiffness is None or not stiffness[1] <= VAGUE * stiffness[0]):
        raise NotIdentifiable(
            f"Joint '{joint}': it moves by {displacement:.3g} before it slides, and not as a spring does: this is no torque ramp.",
            remedy="Record it along `backdrive plan ramp`, slowly, from rest; or use --method motion.",
        )
    width, area = hysteresis_loop(singles, [speed for _, speed, _ in found])
    ends = [_ends(log.driving_torque[:, 0]) for log in singles]
    return Presliding(
        branches=tuple(branches),
        count=count,
        displacement=displacement,
        stiffness=stiffness,
        tangent=_stiffness([b.tangent for b in branches], branches, count) if resolved else None,
        bound=max(b.bound(count) for b in branches),
        break_away=(_break_away(branches, 1), _break_away(branches, -1)),
        largest=(max(high for _, high in ends), min(low for low, _ in ends)),
        rest=float(np.mean([rest for _, _, rest in found])),
        width=width,
        area=area,
        slip_speed=max(speed for _, speed, _ in found),
    )


def is_ramp(log: Log, joint: str | int) -> bool:
    """Return whether a joint's torque goes to and fro in straight lines, and the joint slips at their end at most.

    Args:
        log: any.
        joint: name or column.
    """
    if log.torque is None or log.position is None:
        return False
    single = log.select(joint).on_joint_side()
    torque, position = single.driving_torque[:, 0], single.need("position")[:, 0]
    if len(single) < FEWEST or not np.isfinite([torque, position]).all() or not np.ptp(torque) > 0.0:
        return False
    smooth, rate, _ = _smooth(single)
    turns = turning_points(smooth, BRANCH * float(np.ptp(smooth)))
    if turns.size < 2 or np.diff(turns).sum() < RAMPED * len(single):
        return False
    off = []
    for a, b in zip(turns, turns[1:]):
        inner = slice(a + round(EDGE * rate), max(b - round(EDGE * rate), a + 1))
        if inner.stop - inner.start < SHORTEST:
            return False  # no ramp is so short
        time = np.arange(inner.stop - inner.start)
        off.append(smooth[inner] - np.polyval(np.polyfit(time, smooth[inner], 1), time))
    if np.sqrt(np.mean(np.concatenate(off) ** 2)) > STRAIGHT * np.ptp(smooth) + white_noise(torque):
        return False
    count = encoder_step(single) or 3.0 * white_noise(position)
    branches = _branches(single, count)[0]
    held = sum(b.torque.size for b in branches)
    slips = any(b.break_away is not None for b in branches)
    return held > HELD * len(single) and (slips or len(branches) > 2)


def _branches(log: Log, count: float) -> tuple[list[Branch], float, float]:
    """Return the branches of one log, the speed from which on it slips, and the torque before the first ramp."""
    torque, position = log.driving_torque[:, 0], log.need("position")[:, 0]
    smooth, rate, cutoff = _smooth(log)
    turns = turning_points(smooth, BRANCH * float(np.ptp(smooth)))
    if turns.size < 2:
        return [], 0.0, float(torque[0])
    velocity = filters.derivative(filters.low_pass(position, cutoff, rate), log.period)
    first = slice(turns[0], turns[0] + max(2, (turns[1] - turns[0]) // 10))
    slips = max(SLIPS * float(np.median(np.abs(velocity[first]))), FLICKER * count * cutoff)
    stuck = np.abs(velocity) < slips
    for start, stop in spans(~stuck):
        if np.ptp(position[start:stop]) < RESOLVED * count:
            stuck[start:stop] = True  # a count that flickers is no slip
    settle = round(rate / cutoff)  # as long as the low pass lets a slip shine into its neighbourhood
    result = []
    for a, b in zip(turns, turns[1:]):
        for start, stop in a + spans(stuck[a : b + 1]):
            after, before = start > a or not stuck[max(a - 1, 0)], stop <= b
            first, last = start + settle * after, stop - settle * before
            if last - first < SHORTEST or np.ptp(smooth[first:last]) < 0.5 * BRANCH * np.ptp(smooth):
                continue
            inside = slice(first, last)
            result.append(
                Branch(
                    torque=smooth[inside],
                    position=position[inside],
                    direction=1 if smooth[b] > smooth[a] else -1,
                    break_away=_onset(torque[a : stop + 1], velocity, stop, rate, cutoff) if before else None,
                )
            )
    return result, slips, float(torque[: turns[0] + 1].mean())


def _ends(torque: np.ndarray) -> tuple[float, float]:
    """Return the smallest and the largest torque but for its noise [N.m or N]."""
    low, high, noise = float(torque.min()), float(torque.max()), NOISE * white_noise(torque)
    if noise < ROUNDING * (high - low):
        return low, high
    return min(low + noise, 0.5 * (low + high)), max(high - noise, 0.5 * (low + high))


def _smooth(log: Log) -> tuple[np.ndarray, float, float]:
    """Return the low-passed torque of a log's only joint [N.m or N], (n,), its sampling rate and the corner [Hz]."""
    rate = 1.0 / log.period
    cutoff = min(CUTOFF, 0.1 * rate)
    return filters.low_pass(log.driving_torque[:, 0], cutoff, rate), rate, cutoff


def _onset(
    torque: np.ndarray, velocity: np.ndarray, at: int, rate: float, cutoff: float
) -> tuple[float, float]:
    """Return the torque when a slip began, by the line of the ramp before it, and the uncertainty of that.

    Under a rising torque the speed grows with the square of the time since the slip began where inertia holds it back, and with
    that time itself where viscous friction does: the time lies between one and two times the speed over the acceleration.

    Args:
        torque: as measured, from the beginning of the ramp to the sample at which the slip is seen [N.m or N], (n,).
        velocity: of the whole log [rad/s or m/s].
        at: sample of it at which the slip is seen.
        rate: of sampling [Hz].
        cutoff: of the low pass on the position [Hz].
    """
    acceleration = (velocity[min(at + 1, velocity.size - 1)] - velocity[at - 1]) * rate / 2.0
    lag = min(abs(velocity[at]) / max(abs(acceleration), 1e-300), 2.0 / cutoff)
    before = torque[-max(round(LINE * torque.size), SHORTEST) :]
    time = (np.arange(before.size) - (before.size - 1)) / rate
    slope, level = np.polyfit(time, before, 1)
    left = before - level - slope * time
    blur = abs(slope) * np.hypot(0.5 * lag, 1.0 / cutoff) / np.sqrt(3.0)
    return float(level - 1.5 * slope * lag), float(np.hypot(blur, 2.0 * np.std(left) / np.sqrt(before.size)))


def _break_away(branches: Sequence[Branch], direction: int) -> tuple[float, float] | None:
    found = [b.break_away for b in branches if b.direction == direction and b.break_away is not None]
    if not found:
        return None
    torque, blur = np.array(found).T
    scatter = float(np.std(torque, ddof=1) / np.sqrt(torque.size)) if torque.size > 1 else 0.0
    return float(torque.mean()), float(np.hypot(scatter, blur.mean()))


def _compliance(torque: np.ndarray, position: np.ndarray) -> tuple[float, float]:
    """Return position over torque of one branch, and its standard error [rad/N.m or m/N].

    Both have noise, which a regression of either on the other would take for compliance or stiffness; time has none, and both
    follow it: it is the instrument (Durbin, Revue de l'Institut International de Statistique 22, 1954).
    """
    u, x, t = torque - torque.mean(), position - position.mean(), np.linspace(-1.0, 1.0, torque.size)
    power = float(t @ u)
    if power == 0.0:
        return 0.0, np.inf
    c = float(t @ x) / power
    left = x - c * u
    return c, float(np.sqrt(long_run((t * left)[None])[0, 0])) / abs(power)


def _stiffness(
    compliances: Sequence[tuple[float, float]], branches: Sequence[Branch], count: float
) -> tuple[float, float] | None:
    """Return the stiffness by all branches; None where they do not agree on a sign."""
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
    """Return width [rad or m] and area [J] of the last closed hysteresis loop without slip; NaN where there is none.

    Iwatani 2017, Fig. 3.3.

    Args:
        logs: of one joint, torque ramps.
        slips: speed from which on the joint slips, a log [rad/s or m/s].
    """
    width, area = float("nan"), float("nan")
    for log, limit in zip(logs, slips):
        u, rate, cutoff = _smooth(log)
        x = filters.low_pass(log.position[:, 0], cutoff, rate)  # type: ignore[index]
        speed = np.abs(filters.derivative(x, log.period))
        turns = turning_points(u, BRANCH * float(np.ptp(u)))
        for a, b, c in zip(turns[1:], turns[2:], turns[3:]):
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
