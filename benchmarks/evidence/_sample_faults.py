"""Faults of the clock and of single samples, planted in clean logs; and what all plantings need.

Every function takes a clean log and a random generator and returns the log with one fault, or None where it cannot be put. With
`anywhere` it is put wherever it can be put at all; else only where the conditions hold that the table of faults states.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from _clean_logs import Clean

from backdrive.logs.log import Log


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


Plant = Callable[..., Planted | None]


def with_column(log: Log, channel: str, j: int, values: np.ndarray) -> Log:
    """Return the log with one joint's column (n,) of a channel replaced."""
    array = np.array(log.channels[channel])
    array[:, j] = values
    return log.replace(**{channel: array})


def some_row(clean: Clean, rng: np.random.Generator, margin: float = 0.05) -> int:
    """Return a row away from the ends."""
    n = len(clean.log)
    return int(rng.integers(int(margin * n) + 2, n - int(margin * n) - 2))


def some_joint(clean: Clean, rng: np.random.Generator) -> int:
    """Return a joint."""
    return int(rng.integers(len(clean.log.joints)))


def some_channel(clean: Clean, rng: np.random.Generator, *names: str) -> str | None:
    """Return one of these channels that the log has."""
    present = [name for name in names if name in clean.log.channels]
    return str(rng.choice(present)) if present else None


def step_of(x: np.ndarray) -> float:
    """Return the resolution of a quantised channel, from its levels; 0 for a continuous one."""
    levels = np.diff(np.unique(x))
    levels = levels[levels > 1e-9 * np.abs(x).max()]
    if not levels.size:
        return 0.0
    ratio = levels / levels.min()
    return float(levels.min()) if np.mean(np.abs(ratio - np.round(ratio)) < 0.02) > 0.98 else 0.0


def top_speed(clean: Clean, j: int) -> float:
    """Return a joint's top speed [rad/s]."""
    return float(np.quantile(np.abs(clean.speed[:, j]), 0.99))


def moves(clean: Clean, j: int) -> bool:
    """Return whether a joint really moves."""
    return "ramp" not in clean.motion and top_speed(clean, j) > 0.05


def swapped(clean: Clean, rng: np.random.Generator, anywhere: bool = False) -> Planted:
    k = some_row(clean, rng)
    order = np.arange(len(clean.log))
    order[[k, k + 1]] = order[[k + 1, k]]
    return Planted(clean.log.rows(order), None, np.array([k, k + 1]))


def set_back(clean: Clean, rng: np.random.Generator, anywhere: bool = False) -> Planted:
    k = some_row(clean, rng)
    time = np.array(clean.log.time)
    time[k:] -= 50 * clean.log.period
    return Planted(clean.log.replace(time=time), None, np.array([k]))


def sent_twice(clean: Clean, rng: np.random.Generator, anywhere: bool = False) -> Planted:
    k = some_row(clean, rng)
    rows = np.insert(np.arange(len(clean.log)), k, k)
    return Planted(clean.log.rows(rows), None, np.array([k, k + 1]))


def coarse_clock(clean: Clean, rng: np.random.Generator, anywhere: bool = False) -> Planted:
    time = clean.log.time - clean.log.time[0]
    tick = clean.log.period * rng.uniform(3, 10)
    return Planted(clean.log.replace(time=np.floor(time / tick) * tick), None)


def uneven(clean: Clean, rng: np.random.Generator, anywhere: bool = False) -> Planted:
    steps = np.diff(clean.log.time).mean() * np.maximum(1 + 0.2 * rng.standard_normal(len(clean.log)), 0.05)
    return Planted(clean.log.replace(time=np.cumsum(steps)), None)


def dropped(clean: Clean, rng: np.random.Generator, anywhere: bool = False) -> Planted:
    k = some_row(clean, rng)
    return Planted(
        clean.log.rows(np.delete(np.arange(len(clean.log)), np.arange(k, k + 5))), None, np.array([k])
    )


def single(value: float) -> Plant:
    def plant(clean: Clean, rng: np.random.Generator, anywhere: bool = False) -> Planted:
        channel, j, k = (
            str(rng.choice(list(clean.log.channels))),
            some_joint(clean, rng),
            int(rng.integers(len(clean.log))),
        )
        x = np.array(clean.log.channels[channel][:, j])
        x[k] = value
        return Planted(with_column(clean.log, channel, j, x), clean.log.names[j], np.array([k]))

    return plant


def _counts(clean: Clean, rng: np.random.Generator) -> tuple[str, int, np.ndarray, float] | None:
    channel, j = some_channel(clean, rng, "torque", "velocity"), some_joint(clean, rng)
    assert channel is not None
    x = clean.log.channels[channel][:, j]
    if np.ptp(x) == 0:
        return None
    step = step_of(x) or float(np.abs(x).max() / 10 ** rng.uniform(2.0, 4.0))
    counts = np.round(x / step)
    return (channel, j, counts, step) if np.unique(counts).size > 10 else None


def minus_one(clean: Clean, rng: np.random.Generator, anywhere: bool = False) -> Planted | None:
    found = _counts(clean, rng)
    if found is None:
        return None
    channel, j, counts, step = found
    bits = rng.choice([16, 32])
    far = np.inf if anywhere else 3 + 0.01 * np.ptp(counts)
    near = np.flatnonzero(np.abs(counts[1:-1] + 1) <= far) + 1
    if not near.size:
        return None
    k = int(rng.choice(near))
    counts[k] = 2.0**bits - 1
    return Planted(with_column(clean.log, channel, j, counts * step), clean.log.names[j], np.array([k]))


def unsigned(clean: Clean, rng: np.random.Generator, anywhere: bool = False) -> Planted | None:
    found = _counts(clean, rng)
    if found is None:
        return None
    channel, j, counts, step = found
    rows = np.flatnonzero(counts < 0)
    if not 0 < rows.size < counts.size:
        return None
    counts[rows] += 2.0 ** rng.choice([16, 32])
    return Planted(with_column(clean.log, channel, j, counts * step), clean.log.names[j], rows)


def overflow(clean: Clean, rng: np.random.Generator, anywhere: bool = False) -> Planted | None:
    j = some_joint(clean, rng)
    x = clean.log.torque[:, j]
    top = np.abs(x).max()
    if top == 0 or step_of(x) > 0:
        return None  # a channel has one resolution
    counts = np.round(x / top * 32768 * rng.uniform(1.02, 1.3))
    wrapped = (counts + 32768) % 65536 - 32768
    # a wrap that crosses by one sample at a full jump of friction is no wrap that anyone could tell
    inside = np.abs(np.diff(counts)) < 3000
    rows = np.flatnonzero(wrapped != counts)
    crossing = np.flatnonzero(np.diff((wrapped != counts).astype(int)))
    if not rows.size or not (anywhere or (crossing.size and inside[crossing].all())):
        return None
    return Planted(with_column(clean.log, "torque", j, wrapped * top / 32768), clean.log.names[j], rows)


def _folded(
    clean: Clean, rng: np.random.Generator, period: Callable[[float], float], anywhere: bool
) -> Planted | None:
    j = some_joint(clean, rng)
    if "position" not in clean.log.channels or not moves(clean, j):
        return None
    q = clean.log.position[:, j]
    level = np.quantile(q, rng.uniform(0.2, 0.8))
    over = q > level
    rows = np.flatnonzero(np.diff(over.astype(int))) + 1
    size = period(step_of(q))
    if not rows.size or size == 0:
        return None
    if not anywhere and (size < 12 * np.abs(np.diff(q)).max() or np.ptp(q) > 2 * size):
        return None
    return Planted(with_column(clean.log, "position", j, q - size * over), clean.log.names[j], rows)


def turn(clean: Clean, rng: np.random.Generator, anywhere: bool = False) -> Planted | None:
    return _folded(clean, rng, lambda step: 2 * np.pi, anywhere)


def counter(clean: Clean, rng: np.random.Generator, anywhere: bool = False) -> Planted | None:
    return _folded(clean, rng, lambda step: step * 2.0 ** rng.choice([12, 16, 20]), anywhere)


def slipped(clean: Clean, rng: np.random.Generator, anywhere: bool = False) -> Planted | None:
    j = some_joint(clean, rng)
    if "position" not in clean.log.channels or not moves(clean, j):
        return None
    q, k = np.array(clean.log.position[:, j]), some_row(clean, rng)
    size = max(0.02, 15 * float(np.abs(np.diff(q)).max()), 15 * step_of(q)) * rng.uniform(1, 1.3)
    q[k:] += size * rng.choice([-1, 1])
    return Planted(with_column(clean.log, "position", j, q), clean.log.names[j], np.array([k]))


def spike(clean: Clean, rng: np.random.Generator, anywhere: bool = False) -> Planted | None:
    channel, j = str(rng.choice(list(clean.log.channels))), some_joint(clean, rng)
    x = np.array(clean.log.channels[channel][:, j])
    if np.ptp(x) == 0 or not moves(clean, j):
        return None
    size = max(8 * np.quantile(np.abs(np.diff(x)), 0.995), 0.05 * np.ptp(x), 8 * step_of(x))
    k = some_row(clean, rng)
    x[k] += size * rng.choice([-1, 1])
    return Planted(with_column(clean.log, channel, j, x), clean.log.names[j], np.array([k]))


def wild_end(clean: Clean, rng: np.random.Generator, anywhere: bool = False) -> Planted | None:
    channel, j = str(rng.choice(list(clean.log.channels))), some_joint(clean, rng)
    x = np.array(clean.log.channels[channel][:, j])
    if np.ptp(x) == 0:
        return None
    k = int(rng.choice([0, x.size - 1]))
    x[k] += rng.choice([-1, 1]) * max(3 * np.ptp(x), 10 * step_of(x))
    return Planted(with_column(clean.log, channel, j, x), clean.log.names[j], np.array([k]))
