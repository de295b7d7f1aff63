"""From a log to signals for regression: one joint, uniform clock, no gaps, derivatives computed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np

from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.identification.clock import EVEN, between_gaps, holes, uniform
from backdrive.logs import filters
from backdrive.logs.log import Log
from backdrive.logs.quantiles import median, quantile

SHORTEST = 50  # least number of samples of a stretch between gaps
BLUNT = 15.0  # cutoff frequency below which a low pass may blur the motion of a servo [Hz]
REST = 0.002  # share of the top speed below which a joint may be at rest [-]
REST_TIME = 0.25  # least length of a rest [s]
SLOW = 0.08  # share of the top speed below which a joint counts as sliding only in sustained motion [-]
SUSTAINED = 0.1  # least time to standstill, speed divided by acceleration, in sustained slow motion [s]
BEGUN = 0.02  # part of a move before which slow motion may precede break-away, relative to its distance [-]
SLIGHT = 0.02  # distance below which a move may be presliding alone, relative to a typical move [-]
# limits of a reversal's length on each side of the change of sign, which is one period of the cutoff frequency [s]
REVERSAL = (0.03, 0.05)
BLURRED = 0.5  # least length of a reversal on each side [period of the cutoff frequency]
CONTINUED = 2.0  # length of a stretch's ends that do not count as sliding [period of the cutoff frequency]
OF_A_MOVE = 0.25  # largest length of a reversal on each side, relative to the time between two reversals [-]
VARIES = 0.1  # least span of a varying load or temperature, relative to its largest magnitude [-]
SURELY = 0.1  # share of the top speed above which samples certainly slide [-]
SURELY_AFTER = 0.05  # time before and after a reversal in which samples do not certainly slide [s]


@dataclass(frozen=True, kw_only=True, eq=False)
class Signals:
    """Motion and torque of one joint between two gaps.

    Attributes:
        time: uniform instants [s], (n,).
        velocity: [rad/s or m/s], (n,).
        acceleration: [rad/s^2 or m/s^2], (n,).
        jerk: [rad/s^3 or m/s^3], (n,).
        torque: actuator torque on the joint side, not filtered [N.m or N], (n,).
        rate: sampling frequency [Hz].
        position: low-passed like the velocity [rad or m], (n,); None for a velocity-only log.
        model_torque: known torque of gravity and other axes [N.m or N], (n,); None if absent.
        moving: False in long rests, in which friction is undetermined, (n,).
        sliding: True if the joint moves steadily, away from reversals and brief slow motion, (n,); empty: same as `moving`.
        load: motor-side and external torque, for laws that depend on load [N.m or N], (n, 2); None if absent.
        temperature: [degC], (n,); None if absent.
        measured: position as it was measured [rad or m], (n,); None for a velocity-only log.
        lost: True where a sample was lost, and all is interpolated, (n,); None if none was.
        log: number of the log among the fitted ones; -1: of none of them.
    """

    time: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    jerk: np.ndarray
    torque: np.ndarray
    rate: float
    position: np.ndarray | None
    model_torque: np.ndarray | None
    moving: np.ndarray
    sliding: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    load: np.ndarray | None = None
    temperature: np.ndarray | None = None
    measured: np.ndarray | None = None
    lost: np.ndarray | None = None
    log: int = 0

    def __post_init__(self):
        if not self.sliding.size:
            object.__setattr__(self, "sliding", self.moving)

    def rows(self, part: slice) -> Signals:
        """Return the signals of some samples."""
        if part.indices(self.time.size) == (0, self.time.size, 1):
            return self
        arrays = {f.name: getattr(self, f.name) for f in fields(self)}
        cut = replace(self, **{k: v[part] for k, v in arrays.items() if isinstance(v, np.ndarray)})
        return cut.with_pull_of(self, part)

    def of_log(self, number: int) -> Signals:
        """Return the signals with the number of their log."""
        return self if number == self.log else replace(self, log=number).with_pull_of(self)

    @cached_property
    def moves(self) -> np.ndarray:
        """Times between reversals [s], (m,)."""
        return np.diff(turns(self.velocity[self.sliding])) / self.rate

    @property
    def pull(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Sine and cosine of the position, (n,) each, of a stretch of moderate length computed once; None without position."""
        kept = vars(self).get("_pull")
        if kept is None and self.position is not None:
            kept = np.sin(self.position), np.cos(self.position)
            if self.time.size <= filters.SHORT:
                vars(self)["_pull"] = kept
        return kept

    def with_pull_of(self, other: Signals, part: slice = slice(None)) -> Signals:
        """Return itself, with the sine and cosine of another's position if these are known and part of it is the same."""
        if (kept := vars(other).get("_pull")) is not None:
            vars(self)["_pull"] = kept[0][part], kept[1][part]
        return self


#: The latest stretches of a log of moderate length, since the choice of a method and the method both need them.
_last: WeakKeyDictionary[Log, tuple[tuple[str | int, float | None], tuple[Signals, ...]]] = (
    WeakKeyDictionary()
)


def default_cutoff(rate: float) -> float:
    """Return the default cutoff frequency of the motion's low pass before differentiation [Hz].

    It is a tenth of the rate, or 0.15 of the rate up to `BLUNT`, and at most 100 Hz. A lower cutoff frequency would blur a
    servo's acceleration, which would look like friction.
    """
    return min(max(0.1 * rate, min(0.15 * rate, BLUNT)), 100.0)


def prepare(log: Log, joint: str | int, *, cutoff: float | None = None) -> list[Signals]:
    """Return the gap-free stretches of one joint.

    Args:
        log: with torque, and position or velocity.
        joint: name or column.
        cutoff: corner of the zero-phase low pass before differentiation [Hz]; None: `default_cutoff`.

    Raises:
        InvalidInput: the log holds no torque.
        NotIdentifiable: no stretch is long enough.
    """
    if (kept := _last.get(log)) is not None and kept[0] == (joint, cutoff):
        return list(kept[1])
    _last.clear()
    stretches = _prepare(log, joint, cutoff)
    if len(log) <= filters.SHORT:
        _last[log] = (joint, cutoff), tuple(stretches)
    return stretches


def prepare_each(logs: Sequence[Log], joint: str, *, cutoff: float | None = None) -> list[list[Signals]]:
    """Return the stretches of each log, which know the number of their log; otherwise as `prepare`."""
    return [[s.of_log(k) for s in prepare(log, joint, cutoff=cutoff)] for k, log in enumerate(logs)]


def _prepare(log: Log, joint: str | int, cutoff: float | None) -> list[Signals]:
    """Return the result of `prepare`, computed anew."""
    log.need("torque")
    log = _finite(log.select(joint).on_joint_side())
    if len(log) < SHORTEST:
        raise NotIdentifiable(
            f"The log has only {len(log)} samples.", remedy=f"At least {SHORTEST} are needed."
        )
    period = log.period
    if not period > 0:
        raise InvalidInput(
            f"The median sampling interval is {period} s.", remedy="Repair the time channel (--repair)."
        )
    speed = log.velocity
    if speed is None:  # over two samples: the least noise
        position = log.need("position")
        speed = (position[2:] - position[:-2]) / (2.0 * period)
    top = quantile(np.abs(speed).ravel(), 0.995)
    stretches = [
        _segment(log.rows(rows), period, cutoff, top) for rows in between_gaps(log.time, period, SHORTEST)
    ]
    if not stretches:
        raise NotIdentifiable(
            f"No stretch between gaps has {SHORTEST} samples.", remedy="Record without dropping samples."
        )
    return stretches


def _finite(log: Log) -> Log:
    """Return a log without rows of non-finite values, which become gaps."""
    motion = "velocity" if log.position is None else "position"
    good = np.isfinite(log.time) & np.isfinite(log.driving_torque[:, 0]) & np.isfinite(log.need(motion)[:, 0])
    if log.model_torque is not None:
        good &= np.isfinite(log.model_torque[:, 0])
    return log if good.all() else log.rows(good)


def _segment(log: Log, period: float, cutoff: float | None, top: float) -> Signals:
    stamped = log
    clock, log = uniform(log, period)
    mean = float(clock[-1] - clock[0]) / (clock.size - 1)
    if abs(mean - period) > EVEN * period:  # stamps that vary make the median of their intervals vary
        period = mean
    rate = 1.0 / period
    cutoff = cutoff or default_cutoff(rate)
    if log.position is not None:
        position = filters.low_pass(log.position[:, 0], cutoff, rate)
        velocity = filters.derivative(position, period)
    else:
        position, velocity = None, filters.low_pass(log.need("velocity")[:, 0], cutoff, rate)
    acceleration = filters.derivative(velocity, period)
    jerk = filters.derivative(acceleration, period)
    moving = mark_moving(velocity, rate, top)
    return Signals(
        time=clock,
        velocity=velocity,
        acceleration=acceleration,
        jerk=jerk,
        torque=log.driving_torque[:, 0],
        rate=rate,
        position=position,
        model_torque=None if log.model_torque is None else log.model_torque[:, 0],
        moving=moving,
        sliding=moving & _sliding(velocity, acceleration, rate, cutoff, top),
        load=_load(log),
        temperature=None if log.temperature is None else log.temperature[:, 0],
        measured=None if log.position is None else log.position[:, 0],
        lost=holes(stamped, clock, period),
    )


def _load(log: Log) -> np.ndarray | None:
    """Return the motor's torque and the external torque, (n, 2), for laws that depend on load; None if unknown."""
    if log.load is None and log.external_torque is None:
        return None
    external = -log.load[:, 0] if log.load is not None else log.need("external_torque")[:, 0]
    return np.column_stack([log.need("torque")[:, 0], external])


def varies(x: np.ndarray) -> bool:
    """Return whether a load or a temperature (n,) varies, so that a law may depend on it."""
    return bool(np.ptp(x) > VARIES * max(float(np.abs(x).max()), 1e-12))


def spans(mask: np.ndarray) -> np.ndarray:
    """Return first index and end index (exclusive) of every stretch of True, (k, 2)."""
    if not mask.size:
        return np.zeros((0, 2), dtype=np.intp)
    change = np.flatnonzero(mask[1:] != mask[:-1]) + 1
    first, last = [0] * bool(mask[0]), [mask.size] * bool(mask[-1])
    return np.concatenate([first, change, last]).astype(np.intp).reshape(-1, 2)


def mark_moving(velocity: np.ndarray, rate: float, top: float) -> np.ndarray:
    """Return a mask of the samples that are not part of a long rest, (n,).

    Args:
        velocity: [rad/s or m/s], (n,).
        rate: sampling frequency [Hz].
        top: top speed of the joint [rad/s or m/s].
    """
    resting = np.abs(velocity) < REST * top
    moving = np.ones(velocity.size, dtype=bool)
    for start, stop in spans(resting):
        if stop - start > REST_TIME * rate:
            moving[start:stop] = False
    return moving


def _sliding(
    velocity: np.ndarray, acceleration: np.ndarray, rate: float, cutoff: float, top: float
) -> np.ndarray:
    """Return a mask of the samples at which the joint slides steadily, (n,).

    About a reversal a joint sticks, deflects elastically, and breaks away, which no function of the velocity describes. The
    low pass also blurs the motion there.
    """
    speed = np.abs(velocity)
    bounds, way, of_move = _ways(velocity)
    length = np.diff(bounds)
    whole, usual = np.repeat(of_move, length), _usual(of_move)
    begun = (way > BEGUN * whole) & (whole > SLIGHT * usual)
    steady = (speed >= SLOW * top) | ((np.abs(acceleration) * SUSTAINED < speed) & begun)
    lasting = max(float(np.clip(1.0 / cutoff, *REVERSAL)), BLURRED / cutoff)
    reach = np.ceil(np.minimum(lasting * rate, OF_A_MOVE * length)).astype(int)
    first, last = bounds[:-1] + reach, bounds[1:] - reach  # of the samples that are not near a reversal
    first[0], last[-1] = 0, velocity.size  # the ends of a log are not reversals
    for begin, end in zip(last[:-1].tolist(), first[1:].tolist(), strict=True):
        steady[begin:end] = False
    end = math.ceil(CONTINUED / cutoff * rate)  # near an end, the low pass lacks data
    steady[:end] = steady[max(steady.size - end, 0) :] = False
    return steady


def _ways(velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the samples of reversals with both ends, (k + 1,), the distance of each sample since the last reversal, (n,), and
    that of each move, (k,) [rad or m times rate].
    """
    way = np.zeros(velocity.size + 1)
    bounds = np.concatenate([[0], turns(velocity) + 1, [velocity.size]])
    np.cumsum(np.abs(velocity), out=way[1:])
    length = np.diff(bounds)
    since = np.repeat(way[bounds[:-1]], length)
    return bounds, np.subtract(way[1:], since, out=since), np.diff(way[bounds])


def turns(velocity: np.ndarray) -> np.ndarray:
    """Return the indices of the last samples before the sign of a velocity changes, (k,); one zero on the way is no rest."""
    sign = (velocity > 0.0).view(np.int8) - (velocity < 0.0).view(
        np.int8
    )  # an eighth of the memory of `np.sign`
    if np.count_nonzero(sign) < sign.size:
        across = np.flatnonzero((sign[:-2] == -sign[2:]) & (sign[1:-1] == 0) & (sign[2:] != 0))
        sign[across + 1] = sign[across]
    return np.flatnonzero(sign[1:] != sign[:-1])


def way_since_reversal(s: Signals) -> tuple[np.ndarray, float]:
    """Return the distance since the last reversal, (n,), and the median distance between two reversals [rad or m]."""
    return since_reversal(s.velocity, s.rate)


def since_reversal(velocity: np.ndarray, rate: float) -> tuple[np.ndarray, float]:
    """Return the distance since the last reversal, (n,), and the median distance between two reversals [rad or m].

    Noise of the encoder makes thousands of reversals in a rest, so moves of hardly any distance do not count in the median.

    Args:
        velocity: [rad/s or m/s], (n,).
        rate: sampling frequency [Hz].
    """
    _, way, of_move = _ways(velocity)
    way /= rate
    moved = of_move[of_move >= SLIGHT * _usual(of_move)]
    return way, median(moved) / rate


def _usual(of_move: np.ndarray) -> float:
    """Return the mean distance of a move, weighted by distance, in the unit of the moves, (k,)."""
    return float(np.sum(of_move**2)) / max(float(of_move.sum()), 1e-300)


def surely_sliding(s: Signals, top: float) -> np.ndarray:
    """Return a mask of the samples that certainly slide, (n,), so that reversals do not contribute to the torque residual.

    For a fit, the margins about reversals are shorter in short moves (`OF_A_MOVE`); here they are not.

    Args:
        s: motion.
        top: top speed of the joint [rad/s or m/s].
    """
    inside = s.sliding & (np.abs(s.velocity) > SURELY * top)
    reach = round(SURELY_AFTER * s.rate)
    for turn in turns(s.velocity).tolist():
        inside[max(turn + 1 - reach, 0) : turn + 1 + reach] = False
    return inside
