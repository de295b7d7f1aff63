"""From a log to signals that can be regressed on: one joint, uniform clock, gap-free, differentiated once and for all."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from weakref import WeakKeyDictionary

import numpy as np

from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.logs import filters
from backdrive.logs.log import Log

GAP = 3.5  # an interval of so many periods is a gap; nothing is interpolated across it [period]
SHORTEST = 50  # a segment between gaps with fewer samples is left out [sample]
BLUNT = 15.0  # corner of the low pass below which motion of a servo may be lost [Hz]
REST = 0.002  # below this share of the top speed a joint is taken to rest [-]
REST_TIME = 0.25  # when it does so for longer than this [s]
SLOW = 0.08  # below this share of the top speed a joint slides only where it keeps its velocity [-]
SUSTAINED = 0.1  # for so long, at its acceleration [s]
BEGUN = 0.02  # and after this share of the distance between two reversals, since it may break away before that [-]
SLIGHT = 0.02  # a move shorter than this share of a usual one may be presliding alone [-]
REVERSAL = (
    0.03,
    0.05,
)  # a reversal lasts one period of the low pass's corner before and after the velocity changes sign, within these limits [s]
BLURRED = 0.5  # and at least this part of that period [-]
CONTINUED = 2.0  # so many such periods at the ends of a stretch do not count as sliding [-]
OF_A_MOVE = 0.25  # but for no larger share of the time between two reversals [-]
SURELY = 0.1  # share of the top speed above which residuals are tested for their cause [-]
SURELY_AFTER = 0.05  # and so long after and before reversals [s]


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
        model_torque: torque known from elsewhere [N.m or N], (n,); None if absent.
        moving: False where the joint rests so long that its friction may be anything, (n,).
        sliding: True where the joint moves, does not reverse just before or after, and is not briefly slow, (n,): there
            friction is that of sliding; empty: same as `moving`.
        load: motor-side and external torque, for laws that depend on load [N.m or N], (n, 2); None if absent.
        temperature: [degC], (n,); None if absent.
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

    def __post_init__(self):
        if not self.sliding.size:
            object.__setattr__(self, "sliding", self.moving)

    def rows(self, part: slice) -> Signals:
        """Return some of the samples."""
        arrays = {k: v[part] for k, v in vars(self).items() if isinstance(v, np.ndarray)}
        return replace(self, **arrays)


#: The last stretches of a log of moderate length that is in use: the choice of a method looks at them before the method does.
_last: WeakKeyDictionary[Log, tuple[tuple[str | int, float | None], tuple[Signals, ...]]] = (
    WeakKeyDictionary()
)


def default_cutoff(rate: float) -> float:
    """Return the corner frequency that motion is low-passed at before differentiation [Hz].

    A tenth of the rate, or 0.15 of it up to `BLUNT`: a lower corner would blur a servo's acceleration, which would look like
    friction.
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


def _prepare(log: Log, joint: str | int, cutoff: float | None) -> list[Signals]:
    """Return what `prepare` does."""
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
    speed = log.velocity if log.velocity is not None else filters.derivative(log.need("position"), period)
    top = np.quantile(np.abs(speed).ravel(), 0.995)
    stretches = [
        _segment(log.rows(rows), period, cutoff, top) for rows in between_gaps(log.time, period, SHORTEST)
    ]
    if not stretches:
        raise NotIdentifiable(
            f"No stretch between gaps has {SHORTEST} samples.", remedy="Record without dropping samples."
        )
    return stretches


def between_gaps(time: np.ndarray, period: float, least: int) -> list[slice]:
    """Return the stretches without a gap.

    Args:
        time: instants [s], (n,).
        period: sampling interval [s].
        least: samples that a stretch must have.
    """
    cuts = np.flatnonzero(np.diff(time) > GAP * period) + 1
    bounds = [0, *cuts.tolist(), time.size]
    return [slice(a, b) for a, b in zip(bounds, bounds[1:], strict=False) if b - a >= least]


def _finite(log: Log) -> Log:
    """Leave out rows with a value that is not finite: they become gaps."""
    motion = "velocity" if log.position is None else "position"
    good = np.isfinite(log.time) & np.isfinite(log.driving_torque[:, 0]) & np.isfinite(log.need(motion)[:, 0])
    if log.model_torque is not None:
        good &= np.isfinite(log.model_torque[:, 0])
    return log if good.all() else log.rows(good)


def _uniform(log: Log, period: float) -> tuple[np.ndarray, Log]:
    """Interpolate onto a uniform clock where the log's own is not."""
    n = round(log.duration / period) + 1
    clock = log.time[0] + period * np.arange(n)
    if n == len(log) and np.max(np.abs(clock - log.time)) < 0.05 * period:
        return clock, log
    channels = {k: np.interp(clock, log.time, v[:, 0])[:, None] for k, v in log.channels.items()}
    return clock, log.replace(time=clock, wrench=None, **channels)


def _segment(log: Log, period: float, cutoff: float | None, top: float) -> Signals:
    clock, log = _uniform(log, period)
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
    )


def _load(log: Log) -> np.ndarray | None:
    """Return the motor's torque, without what the environment adds, and the external one (n, 2): what laws of load see."""
    if log.load is None and log.external_torque is None:
        return None
    external = -log.load[:, 0] if log.load is not None else log.need("external_torque")[:, 0]
    return np.column_stack([log.need("torque")[:, 0], external])


def spans(mask: np.ndarray) -> np.ndarray:
    """Return first and past-last index of every stretch of True, (k, 2)."""
    return np.flatnonzero(np.diff(np.r_[False, mask, False].astype(np.int8))).reshape(-1, 2)


def mark_moving(velocity: np.ndarray, rate: float, top: float) -> np.ndarray:
    """Return the samples that are not part of a long rest, (n,).

    Args:
        velocity: [rad/s or m/s], (n,).
        rate: sampling frequency [Hz].
        top: speed of the joint [rad/s or m/s].
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
    """Mark the samples whose friction is that of sliding.

    About a reversal a joint sticks, bends what is elastic in it, and breaks away, which no function of the velocity describes;
    and the low pass of the motion blurs it.
    """
    speed = np.abs(velocity)
    bounds, way, whole = _ways(velocity)
    turns, length = bounds[1:-1], np.diff(bounds)
    usual = np.sum(whole * speed) / max(
        float(speed.sum()), 1e-300
    )  # of a move, by the way that each is part of
    begun = (way > BEGUN * whole) & (whole > SLIGHT * usual)
    steady = (speed >= SLOW * top) | ((np.abs(acceleration) * SUSTAINED < speed) & begun)
    lasting = max(float(np.clip(1.0 / cutoff, *REVERSAL)), BLURRED / cutoff)
    reach = np.minimum(lasting * rate, OF_A_MOVE * length)
    reach = np.repeat(reach, length)
    index = np.arange(velocity.size)
    since = index - np.repeat(bounds[:-1], length) if turns.size else index + velocity.size
    until = np.repeat(bounds[1:], length) - 1 - index if turns.size else velocity.size + index
    since[: bounds[1]] = velocity.size  # neither end of a log is a reversal
    until[bounds[-2] :] = velocity.size
    from_end = np.minimum(index, index[::-1])  # but the low pass has no data beyond the end
    return steady & (since >= reach) & (until >= reach) & (from_end >= CONTINUED / cutoff * rate)


def _ways(velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return where the joint reverses, both ends included; its way since then and of the whole move [rad or m times rate], (n,)."""
    bounds = np.r_[0, np.flatnonzero(np.diff(np.sign(velocity)) != 0) + 1, velocity.size]
    length, way = np.diff(bounds), np.r_[0.0, np.cumsum(np.abs(velocity))]
    return bounds, way[1:] - np.repeat(way[bounds[:-1]], length), np.repeat(np.diff(way[bounds]), length)


def way_since_reversal(s: Signals) -> tuple[np.ndarray, float]:
    """Return how far the joint has gone since its last reversal (n,), and the median way between two of them [rad or m]."""
    bounds, way, whole = _ways(s.velocity)
    return way / s.rate, float(np.median(whole[bounds[:-1]])) / s.rate


def surely_sliding(s: Signals, top: float) -> np.ndarray:
    """Return the samples that certainly slide, (n,), where reversals do not contribute to the torque residual.

    A fit may spare short moves a part of the time about their reversals (`OF_A_MOVE`); here nothing is spared.

    Args:
        s: motion.
        top: speed of the joint [rad/s or m/s].
    """
    inside = s.sliding & (np.abs(s.velocity) > SURELY * top)
    reach, way = round(SURELY_AFTER * s.rate), np.sign(s.velocity)
    for turn in np.flatnonzero(way[1:] != way[:-1]).tolist():
        inside[max(turn + 1 - reach, 0) : turn + 1 + reach] = False
    return inside
