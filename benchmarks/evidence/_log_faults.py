"""Faults of logs, each with the smallest size that must be found, and a way to plant it in a clean log by seed.

The size is said in terms of the log itself (its noise, its resolution, its range, its true motion), never in terms of what a check looks at.
Where a log cannot show a fault of that size (no velocity to be wrong, no friction to have a sign), the fault is not planted in it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from _clean_logs import Clean

from backdrive.log import Log


@dataclass(frozen=True)
class Planted:
    """A log with one fault.

    Attributes:
        log: the log.
        joint: the joint that has it; None for the clock.
        rows: rows that have it; None for all.
    """

    log: Log
    joint: str | None
    rows: np.ndarray | None = None


@dataclass(frozen=True)
class Fault:
    """A kind of fault.

    Attributes:
        name: of the check that must name it.
        size: the smallest size that must be found, in words.
        plant: puts it into a clean log; None where the log cannot show it.
    """

    name: str
    size: str
    plant: Callable[[Clean, np.random.Generator], Planted | None]


def _with(log: Log, channel: str, j: int, values: np.ndarray) -> Log:
    array = np.array(log.channels[channel])
    array[:, j] = values
    return log.replace(**{channel: array})


def _row(clean: Clean, rng: np.random.Generator, margin: float = 0.05) -> int:
    n = len(clean.log)
    return int(rng.integers(int(margin * n) + 2, n - int(margin * n) - 2))


def _joint(clean: Clean, rng: np.random.Generator) -> int:
    return int(rng.integers(len(clean.log.joints)))


def _channel(clean: Clean, rng: np.random.Generator, *names: str) -> str | None:
    present = [name for name in names if name in clean.log.channels]
    return str(rng.choice(present)) if present else None


def _step(x: np.ndarray) -> float:
    """Return the resolution of a quantised channel, from its levels; 0 for a continuous one."""
    levels = np.diff(np.unique(x))
    levels = levels[levels > 1e-9 * np.abs(x).max()]
    if not levels.size:
        return 0.0
    ratio = levels / levels.min()
    return float(levels.min()) if np.mean(np.abs(ratio - np.round(ratio)) < 0.02) > 0.98 else 0.0


def _top(clean: Clean, j: int) -> float:
    return float(np.quantile(np.abs(clean.speed[:, j]), 0.99))


def _moves(clean: Clean, j: int) -> bool:
    return "ramp" not in clean.motion and _top(clean, j) > 0.05


def swapped(clean: Clean, rng: np.random.Generator) -> Planted:
    k = _row(clean, rng)
    order = np.arange(len(clean.log))
    order[[k, k + 1]] = order[[k + 1, k]]
    return Planted(clean.log.rows(order), None, np.array([k, k + 1]))


def set_back(clean: Clean, rng: np.random.Generator) -> Planted:
    k = _row(clean, rng)
    time = np.array(clean.log.time)
    time[k:] -= 50 * clean.log.period
    return Planted(clean.log.replace(time=time), None, np.array([k]))


def sent_twice(clean: Clean, rng: np.random.Generator) -> Planted:
    k = _row(clean, rng)
    rows = np.insert(np.arange(len(clean.log)), k, k)
    return Planted(clean.log.rows(rows), None, np.array([k, k + 1]))


def coarse_clock(clean: Clean, rng: np.random.Generator) -> Planted:
    time = clean.log.time - clean.log.time[0]
    tick = clean.log.period * rng.uniform(3, 10)
    return Planted(clean.log.replace(time=np.floor(time / tick) * tick), None)


def uneven(clean: Clean, rng: np.random.Generator) -> Planted:
    steps = np.diff(clean.log.time).mean() * np.maximum(1 + 0.2 * rng.standard_normal(len(clean.log)), 0.05)
    return Planted(clean.log.replace(time=np.cumsum(steps)), None)


def dropped(clean: Clean, rng: np.random.Generator) -> Planted:
    k = _row(clean, rng)
    return Planted(
        clean.log.rows(np.delete(np.arange(len(clean.log)), np.arange(k, k + 5))), None, np.array([k])
    )


def _single(value: float) -> Callable[[Clean, np.random.Generator], Planted]:
    def plant(clean: Clean, rng: np.random.Generator) -> Planted:
        channel, j, k = (
            str(rng.choice(list(clean.log.channels))),
            _joint(clean, rng),
            int(rng.integers(len(clean.log))),
        )
        x = np.array(clean.log.channels[channel][:, j])
        x[k] = value
        return Planted(_with(clean.log, channel, j, x), clean.log.names[j], np.array([k]))

    return plant


def _counts(clean: Clean, rng: np.random.Generator) -> tuple[str, int, np.ndarray, float] | None:
    channel, j = _channel(clean, rng, "torque", "velocity"), _joint(clean, rng)
    assert channel is not None
    x = clean.log.channels[channel][:, j]
    if np.ptp(x) == 0:
        return None
    step = _step(x) or float(np.abs(x).max() / 10 ** rng.uniform(2.0, 4.0))
    counts = np.round(x / step)
    return (channel, j, counts, step) if np.unique(counts).size > 10 else None


def minus_one(clean: Clean, rng: np.random.Generator) -> Planted | None:
    found = _counts(clean, rng)
    if found is None:
        return None
    channel, j, counts, step = found
    bits = rng.choice([16, 32])
    near = np.flatnonzero(np.abs(counts[1:-1] + 1) <= 3 + 0.01 * np.ptp(counts)) + 1
    if not near.size:
        return None
    k = int(rng.choice(near))
    counts[k] = 2.0**bits - 1
    return Planted(_with(clean.log, channel, j, counts * step), clean.log.names[j], np.array([k]))


def unsigned(clean: Clean, rng: np.random.Generator) -> Planted | None:
    found = _counts(clean, rng)
    if found is None:
        return None
    channel, j, counts, step = found
    rows = np.flatnonzero(counts < 0)
    if not 0 < rows.size < counts.size:
        return None
    counts[rows] += 2.0 ** rng.choice([16, 32])
    return Planted(_with(clean.log, channel, j, counts * step), clean.log.names[j], rows)


def overflow(clean: Clean, rng: np.random.Generator) -> Planted | None:
    j = _joint(clean, rng)
    x = clean.log.torque[:, j]
    top = np.abs(x).max()
    if top == 0 or _step(x) > 0:
        return None  # a channel has one resolution
    counts = np.round(x / top * 32768 * rng.uniform(1.02, 1.3))
    wrapped = (counts + 32768) % 65536 - 32768
    # a wrap that crosses by one sample at a full jump of friction is no wrap that anyone could tell
    inside = np.abs(np.diff(counts)) < 3000
    rows = np.flatnonzero(wrapped != counts)
    crossing = np.flatnonzero(np.diff((wrapped != counts).astype(int)))
    if not rows.size or not crossing.size or not inside[crossing].all():
        return None
    return Planted(_with(clean.log, "torque", j, wrapped * top / 32768), clean.log.names[j], rows)


def _folded(clean: Clean, rng: np.random.Generator, period: Callable[[float], float]) -> Planted | None:
    j = _joint(clean, rng)
    if "position" not in clean.log.channels or not _moves(clean, j):
        return None
    q = clean.log.position[:, j]
    level = np.quantile(q, rng.uniform(0.2, 0.8))
    over = q > level
    rows = np.flatnonzero(np.diff(over.astype(int))) + 1
    size = period(_step(q))
    if not rows.size or size < 12 * np.abs(np.diff(q)).max() or np.ptp(q) > 2 * size:
        return None
    return Planted(_with(clean.log, "position", j, q - size * over), clean.log.names[j], rows)


def turn(clean: Clean, rng: np.random.Generator) -> Planted | None:
    return _folded(clean, rng, lambda step: 2 * np.pi)


def counter(clean: Clean, rng: np.random.Generator) -> Planted | None:
    return _folded(clean, rng, lambda step: step * 2.0 ** rng.choice([12, 16, 20]))


def slipped(clean: Clean, rng: np.random.Generator) -> Planted | None:
    j = _joint(clean, rng)
    if "position" not in clean.log.channels or not _moves(clean, j):
        return None
    q, k = np.array(clean.log.position[:, j]), _row(clean, rng)
    size = max(0.02, 15 * float(np.abs(np.diff(q)).max()), 15 * _step(q)) * rng.uniform(1, 1.3)
    q[k:] += size * rng.choice([-1, 1])
    return Planted(_with(clean.log, "position", j, q), clean.log.names[j], np.array([k]))


def spike(clean: Clean, rng: np.random.Generator) -> Planted | None:
    channel, j = str(rng.choice(list(clean.log.channels))), _joint(clean, rng)
    x = np.array(clean.log.channels[channel][:, j])
    if np.ptp(x) == 0 or not _moves(clean, j):
        return None
    size = max(6 * np.quantile(np.abs(np.diff(x)), 0.995), 0.05 * np.ptp(x), 8 * _step(x))
    k = _row(clean, rng)
    x[k] += size * rng.choice([-1, 1])
    return Planted(_with(clean.log, channel, j, x), clean.log.names[j], np.array([k]))


def wild_end(clean: Clean, rng: np.random.Generator) -> Planted | None:
    channel, j = str(rng.choice(list(clean.log.channels))), _joint(clean, rng)
    x = np.array(clean.log.channels[channel][:, j])
    if np.ptp(x) == 0:
        return None
    k = int(rng.choice([0, x.size - 1]))
    x[k] += rng.choice([-1, 1]) * max(3 * np.ptp(x), 10 * _step(x))
    return Planted(_with(clean.log, channel, j, x), clean.log.names[j], np.array([k]))


def _window(clean: Clean, rng: np.random.Generator, j: int, length: int, good: np.ndarray) -> int | None:
    """Return a start such that all of start .. start + length are good rows."""
    total = np.concatenate([[0], np.cumsum(good)])
    starts = np.flatnonzero(total[length + 1 :] - total[: -length - 1] == length + 1)
    starts = starts[(starts > 60) & (starts < good.size - length - 60)]
    return int(rng.choice(starts)) if starts.size else None


def frozen(clean: Clean, rng: np.random.Generator) -> Planted | None:
    j, length = _joint(clean, rng), 20
    channel = _channel(clean, rng, "position", "velocity", "torque")
    if channel is None or not _moves(clean, j) or len(clean.log) < 400:
        return None
    log, v = clean.log, clean.speed[:, j]
    x = np.array(log.channels[channel][:, j])
    good = np.abs(v) > 0.2 * _top(clean, j)
    if channel == "position":
        good &= np.abs(v) * length * log.period > 20 * _step(x)
    if channel == "velocity":
        if "position" not in log.channels:
            return None
        # the frozen velocity must be wrong by 15 % of the top speed in the mean, and the position fine enough to show it
        change = np.abs(np.convolve(v, np.ones(length) / length, "full")[length - 1 :][: v.size] - v)
        counts = _step(log.position[:, j])
        good &= (change > 0.15 * _top(clean, j)) & (change * length * log.period > 20 * counts)
        good &= change > 5 * _step(x)
    start = _window(clean, rng, j, length, good)
    if start is None:
        return None
    near = x[max(0, start - 100) : start + length + 100]
    if channel == "torque" and np.std(np.diff(near)) < 3 * _step(x):
        return None  # what noise of a step or less does is no evidence
    x[start + 1 : start + length + 1] = x[start]
    return Planted(_with(log, channel, j, x), log.names[j], np.arange(start + 1, start + length + 1))


def dead(clean: Clean, rng: np.random.Generator) -> Planted | None:
    channel, j = _channel(clean, rng, "position", "velocity", "torque"), _joint(clean, rng)
    if channel is None or not _moves(clean, j) or len(clean.log.channels) < 3:
        return None
    x = clean.log.channels[channel][:, j]
    level = x[_row(clean, rng)]
    if channel == "torque" and level == 0:
        return None  # that is the next fault
    return Planted(_with(clean.log, channel, j, np.full_like(x, level)), clean.log.names[j])


def silent(clean: Clean, rng: np.random.Generator) -> Planted | None:
    j = _joint(clean, rng)
    x = np.array(clean.log.torque[:, j])
    if not _moves(clean, j) or len(clean.log) < 400:
        return None
    good = (np.abs(clean.speed[:, j]) > 0.2 * _top(clean, j)) & (
        np.abs(x) > 10 * max(clean.torque_noise[j], _step(x))
    )
    good &= np.abs(x) > 10 * np.quantile(np.abs(np.diff(x)), 0.99)
    start = _window(clean, rng, j, 20, good)
    if start is None:
        return None
    x[start : start + 20] = 0
    return Planted(_with(clean.log, "torque", j, x), clean.log.names[j], np.arange(start, start + 20))


def mute(clean: Clean, rng: np.random.Generator) -> Planted:
    j = _joint(clean, rng)
    return Planted(_with(clean.log, "torque", j, np.zeros(len(clean.log))), clean.log.names[j])


def clipped(clean: Clean, rng: np.random.Generator) -> Planted | None:
    j = _joint(clean, rng)
    x = clean.log.torque[:, j]
    if np.ptp(x) == 0:
        return None
    limit = np.quantile(x, 0.95)
    if np.std(np.diff(x)) < 2 * _step(x):
        return None  # what noise of a step or less does at its end is no evidence
    rows = np.flatnonzero(x >= limit)
    runs = np.diff(np.flatnonzero(np.concatenate([[True], np.diff(rows) > 1, [True]])))
    if limit <= 0 or rows.size < 30 or runs.max() < 10 or limit > x.max() - 3 * clean.torque_noise[j]:
        return None
    return Planted(_with(clean.log, "torque", j, np.minimum(x, limit)), clean.log.names[j], rows)


def degrees_of(*channels: str) -> Callable[[Clean, np.random.Generator], Planted | None]:
    def plant(clean: Clean, rng: np.random.Generator) -> Planted | None:
        j = _joint(clean, rng)
        present = clean.log.channels
        if not _moves(clean, j) or "position" not in present or any(c not in present for c in channels):
            return None
        q = present["position"][:, j]
        if len(channels) == 1 and ("velocity" not in present or np.ptp(q) < 50 * _step(q)):
            return None
        if len(channels) == 2 and not (np.ptp(q) > np.radians(30) and abs(q[-1] - q[0]) < 0.5 * np.ptp(q)):
            return None
        log = clean.log
        for channel in channels:
            log = _with(log, channel, j, np.degrees(log.channels[channel][:, j]))
        return Planted(log, clean.log.names[j])

    return plant


def _velocity(
    change: Callable[[Clean, int, np.random.Generator], np.ndarray | None],
) -> Callable[[Clean, np.random.Generator], Planted | None]:
    def plant(clean: Clean, rng: np.random.Generator) -> Planted | None:
        j = _joint(clean, rng)
        if not _moves(clean, j) or not {"position", "velocity"} <= set(clean.log.channels):
            return None
        if np.ptp(clean.log.position[:, j]) < 200 * _step(clean.log.position[:, j]):
            return None
        v = change(clean, j, rng)
        return None if v is None else Planted(_with(clean.log, "velocity", j, v), clean.log.names[j])

    return plant


def _delayed(clean: Clean, j: int, rng: np.random.Generator) -> np.ndarray | None:
    by = int(np.ceil(max(0.04, 10 * clean.log.period) / clean.log.period))
    v = clean.log.velocity[:, j]
    late = np.concatenate([np.full(by, v[0]), v[:-by]])
    # what a delay leaves to see is the change of velocity within it
    return late if np.std(late - v) > 0.05 * np.std(v) else None


def _foreign(clean: Clean, j: int, rng: np.random.Generator) -> np.ndarray | None:
    others = [k for k in range(len(clean.log.joints)) if k != j and _top(clean, k) > 0.3 * _top(clean, j)]
    if not others:
        return None
    v = clean.log.velocity[:, int(rng.choice(others))]
    alike = abs(np.corrcoef(v, clean.speed[:, j])[0, 1])
    return v if alike < 0.7 else None


def inverted(clean: Clean, rng: np.random.Generator) -> Planted | None:
    j = _joint(clean, rng)
    if not _moves(clean, j) or clean.friction_share[j] < 0.3:
        return None
    v = clean.speed[:, j]
    forth = np.mean(v[np.abs(v) > 0.1 * _top(clean, j)] > 0)
    if not 0.2 < forth < 0.8:
        return None
    return Planted(_with(clean.log, "torque", j, -clean.log.torque[:, j]), clean.log.names[j])


def slip(clean: Clean, rng: np.random.Generator) -> Planted | None:
    log = clean.log
    if "position" not in log.channels or "torque" in clean.motion:
        return None
    by = max(2, int(np.ceil(6e-3 / log.period)))
    by = -by if clean.slip < 0 else by  # away from the half cycle that any controller has
    for j in rng.permutation(len(log.joints)).tolist():
        if _moves(clean, j) and _worth(clean, j, by) > 0.02:
            keep = slice(max(by, 0), len(log) + min(by, 0))
            return Planted(_with(log, "torque", j, np.roll(log.torque[:, j], by)).rows(keep), log.names[j])
    return None


def _worth(clean: Clean, j: int, by: int) -> float:
    """Return what a shift is worth beyond all that inertia, friction and gravity could imitate, over the torque's scatter [1].

    By the true motion below about 10 Hz, away from reversals, and where the torque follows it to 4 % and is noisy by 20 % at most; 0 elsewhere.
    """
    v, tau = clean.speed[:, j], clean.log.torque[:, j]
    width = max(3, round(0.08 / clean.log.period))
    window = np.hanning(width + 2)[1:-1] / np.hanning(width + 2).sum()
    q, a = np.cumsum(v) * clean.log.period, np.gradient(v, clean.log.period)
    columns = [a, v, np.sign(v), np.ones_like(v), np.sin(q), np.cos(q), v * np.abs(v), tau]
    *terms, tau = (np.convolve(x, window, "same") for x in columns)
    terms = np.stack(terms, axis=1)
    terms /= np.sqrt(np.mean(terms**2, axis=0)) + 1e-12
    slow = np.abs(v) < 0.15 * _top(clean, j)
    slow[: width + 1] = slow[-width - 1 :] = True
    rows = np.flatnonzero(np.convolve(slow, np.ones(2 * (abs(by) + width) + 1), "same") < 0.5)
    if rows.size < 300:
        return 0.0
    model = terms @ np.linalg.lstsq(terms[rows], tau[rows], rcond=None)[0]
    scatter = float(np.std(tau[rows]))
    if (
        np.std(tau[rows] - model[rows]) > 0.04 * scatter
        or np.std(clean.log.torque[rows, j] - tau[rows]) > 0.2 * scatter
    ):
        return 0.0
    change = (np.roll(model, by) - model)[rows]
    left = change - terms[rows] @ np.linalg.lstsq(terms[rows], change, rcond=None)[0]
    return float(np.std(left)) / scatter


def short(clean: Clean, rng: np.random.Generator) -> Planted:
    k = _row(clean, rng)
    return Planted(clean.log.rows(slice(k, k + 19)), None)


def held(clean: Clean, rng: np.random.Generator) -> Planted:
    log = clean.log
    still = {
        c: np.repeat(log.channels[c][:1], len(log), axis=0)
        for c in ("position", "velocity")
        if c in log.channels
    }
    noise = rng.standard_normal(log.torque.shape) * clean.torque_noise
    return Planted(log.replace(torque=log.torque[:1] + noise, **still), log.names[0])


FAULTS: tuple[Fault, ...] = (
    Fault("few-samples", "19 samples", short),
    Fault("nan", "one sample", _single(np.nan)),
    Fault("infinite", "one sample", _single(np.inf)),
    Fault("unsorted-time", "two neighbours exchanged", swapped),
    Fault("unsorted-time", "clock set back by 50 samples", set_back),
    Fault("repeated-time", "one sample sent twice", sent_twice),
    Fault("repeated-time", "clock ticks every 3 to 10 samples", coarse_clock),
    Fault("jitter", "20 % of the interval", uneven),
    Fault("gaps", "5 samples", dropped),
    Fault("integer-wrap", "one -1 read as 2^16-1 or 2^32-1, any scale", minus_one),
    Fault("integer-wrap", "negative values read as unsigned", unsigned),
    Fault("integer-wrap", "16 bits run over, by 2 % or more", overflow),
    Fault("encoder-wrap", "one turn, once", turn),
    Fault("encoder-wrap", "2^12, 2^16 or 2^20 counts, once", counter),
    Fault("stuck", "20 samples in motion, off by 20 counts or 15 % of top speed", frozen),
    Fault("stuck", "a dead channel", dead),
    Fault("silent-torque", "20 samples in motion", silent),
    Fault("silent-torque", "all samples", mute),
    Fault("position-jump", "0.02 rad, and 15 of the longest steps", slipped),
    Fault("outlier", "one sample, 6 of the long steps (99.5 %), 5 % of range", spike),
    Fault("outlier", "first or last sample, 3 ranges and 10 counts", wild_end),
    Fault("saturation", "5 % of the samples at the limit", clipped),
    Fault("no-motion", "nothing moves, torque noise only", held),
    Fault("degrees", "velocity", degrees_of("velocity")),
    Fault("degrees", "position", degrees_of("position")),
    Fault("degrees", "position and velocity, stroke 30 deg", degrees_of("position", "velocity")),
    Fault("velocity-mismatch", "opposite sign", _velocity(lambda c, j, rng: -c.log.velocity[:, j])),
    Fault("velocity-mismatch", "factor 1.25", _velocity(lambda c, j, rng: 1.25 * c.log.velocity[:, j])),
    Fault("velocity-mismatch", "40 ms and 10 samples late", _velocity(_delayed)),
    Fault("velocity-mismatch", "another joint's velocity", _velocity(_foreign)),
    Fault("torque-sign", "one joint, friction 30 % of the torque's scatter", inverted),
    Fault("time-slip", "2 samples and 6 ms, worth 2 % of the torque", slip),
)
