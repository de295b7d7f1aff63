"""Faults of logs, each with the smallest size that must be found, and a way to plant it in a clean log by seed.

The size is said in terms of the log itself (its noise, its resolution, its range, its true motion), never in terms of what a
check looks at. `where` states all that is asked of a log and of the place in it beside the size; the program prints the share of
the clean logs that this admits, and in how many of those that could have the fault at all it is found.

A moving joint is one with a top speed (99 %) of 0.05 rad/s, not under a torque ramp. Steps: of the channel's resolution.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from _clean_logs import Clean
from _sample_faults import (
    Plant,
    Planted,
    coarse_clock,
    counter,
    dropped,
    minus_one,
    moves,
    overflow,
    sent_twice,
    set_back,
    single,
    slipped,
    some_channel,
    some_joint,
    some_row,
    spike,
    step_of,
    swapped,
    top_speed,
    turn,
    uneven,
    unsigned,
    wild_end,
    with_column,
)


@dataclass(frozen=True)
class Fault:
    """A kind of fault.

    Attributes:
        name: of the check that must name it.
        size: the smallest size that must be found, in words.
        plant: puts it into a clean log; None where the log cannot have it, or not under the conditions.
        where: the conditions, in words.
        share: of the logs that meet them, in which it must be found [-].
    """

    name: str
    size: str
    plant: Plant
    where: str = ""
    share: float = 0.99


def _window(clean: Clean, rng: np.random.Generator, j: int, length: int, good: np.ndarray) -> int | None:
    """Return a start such that all of start .. start + length are good rows."""
    total = np.concatenate([[0], np.cumsum(good)])
    starts = np.flatnonzero(total[length + 1 :] - total[: -length - 1] == length + 1)
    starts = starts[(starts > 60) & (starts < good.size - length - 60)]
    return int(rng.choice(starts)) if starts.size else None


def frozen(clean: Clean, rng: np.random.Generator, anywhere: bool = False) -> Planted | None:
    j, length = some_joint(clean, rng), 20
    channel = some_channel(clean, rng, "position", "velocity", "torque")
    if channel is None or not moves(clean, j) or len(clean.log) < 400:
        return None
    log, v = clean.log, clean.speed[:, j]
    x = np.array(log.channels[channel][:, j])
    good = np.abs(v) > 0.2 * top_speed(clean, j)
    asked = None if anywhere else channel
    if asked == "position":
        good &= np.abs(v) * length * log.period > 20 * step_of(x)
    if asked == "velocity":
        if "position" not in log.channels:
            return None
        # the frozen velocity must be wrong by 15 % of the top speed in the mean, and the position fine enough to show it
        change = np.abs(np.convolve(v, np.ones(length) / length, "full")[length - 1 :][: v.size] - v)
        counts = step_of(log.position[:, j])
        good &= (change > 0.15 * top_speed(clean, j)) & (change * length * log.period > 20 * counts)
        good &= (change > 5 * step_of(x)) & (change > counts / 1e-3)
    start = _window(clean, rng, j, length, good)
    if start is None:
        return None
    near = x[max(0, start - 100) : start + length + 100]
    if asked == "torque" and np.std(np.diff(near)) < 3 * step_of(x):
        return None  # what noise of a step or less does is no evidence
    x[start + 1 : start + length + 1] = x[start]
    if asked == "torque" and x[start] in (0.0, x.min(), x.max()):
        return None  # silent or saturated, by all that anyone could tell
    return Planted(with_column(log, channel, j, x), log.names[j], np.arange(start + 1, start + length + 1))


def dead(clean: Clean, rng: np.random.Generator, anywhere: bool = False) -> Planted | None:
    channel, j = some_channel(clean, rng, "position", "velocity", "torque"), some_joint(clean, rng)
    if channel is None or not moves(clean, j) or len(clean.log.channels) < 3:
        return None
    x = clean.log.channels[channel][:, j]
    level = x[some_row(clean, rng)]
    if channel == "torque" and level == 0:
        return None  # that is the next fault
    return Planted(with_column(clean.log, channel, j, np.full_like(x, level)), clean.log.names[j])


def silent(clean: Clean, rng: np.random.Generator, anywhere: bool = False) -> Planted | None:
    j = some_joint(clean, rng)
    x = np.array(clean.log.torque[:, j])
    if not moves(clean, j) or len(clean.log) < 400:
        return None
    good = np.abs(clean.speed[:, j]) > 0.2 * top_speed(clean, j)
    if not anywhere:
        good &= np.abs(x) > 10 * max(clean.torque_noise[j], step_of(x))
        good &= np.abs(x) > 10 * np.quantile(np.abs(np.diff(x)), 0.99)
    start = _window(clean, rng, j, 20, good)
    if start is None:
        return None
    x[start : start + 20] = 0
    return Planted(with_column(clean.log, "torque", j, x), clean.log.names[j], np.arange(start, start + 20))


def mute(clean: Clean, rng: np.random.Generator, anywhere: bool = False) -> Planted:
    j = some_joint(clean, rng)
    return Planted(with_column(clean.log, "torque", j, np.zeros(len(clean.log))), clean.log.names[j])


def clipped(clean: Clean, rng: np.random.Generator, anywhere: bool = False) -> Planted | None:
    j = some_joint(clean, rng)
    x = clean.log.torque[:, j]
    if np.ptp(x) == 0 or not moves(clean, j):
        return None
    limit = np.quantile(x, 0.95)
    rows = np.flatnonzero(x >= limit)
    runs = np.diff(np.flatnonzero(np.concatenate([[True], np.diff(rows) > 1, [True]])))
    if limit <= 0 or limit == x.max():
        return None
    if not anywhere and (
        np.std(np.diff(x)) < 2 * step_of(x)  # what noise of a step or less does at its end is no evidence
        or rows.size < 30
        or runs.max() < 10
        or limit > x.max() - 3 * clean.torque_noise[j]
    ):
        return None
    return Planted(with_column(clean.log, "torque", j, np.minimum(x, limit)), clean.log.names[j], rows)


def degrees_of(*channels: str) -> Plant:
    def plant(clean: Clean, rng: np.random.Generator, anywhere: bool = False) -> Planted | None:
        j = some_joint(clean, rng)
        present = clean.log.channels
        if not moves(clean, j) or "position" not in present or any(c not in present for c in channels):
            return None
        q = present["position"][:, j]
        if len(channels) == 1 and "velocity" not in present:
            return None
        if not anywhere and len(channels) == 1 and np.ptp(q) < 50 * step_of(q):
            return None
        if (
            not anywhere
            and len(channels) == 2
            and not (np.ptp(q) > np.radians(30) and abs(q[-1] - q[0]) < 0.5 * np.ptp(q))
        ):
            return None
        log = clean.log
        for channel in channels:
            log = with_column(log, channel, j, np.degrees(log.channels[channel][:, j]))
        return Planted(log, clean.log.names[j])

    return plant


def _velocity(change: Callable[[Clean, int, np.random.Generator, bool], np.ndarray | None]) -> Plant:
    def plant(clean: Clean, rng: np.random.Generator, anywhere: bool = False) -> Planted | None:
        j = some_joint(clean, rng)
        if not moves(clean, j) or not {"position", "velocity"} <= set(clean.log.channels):
            return None
        q = clean.log.position[:, j]
        if not anywhere and np.ptp(q) < 200 * step_of(q):
            return None
        v = change(clean, j, rng, anywhere)
        return None if v is None else Planted(with_column(clean.log, "velocity", j, v), clean.log.names[j])

    return plant


def _delayed(clean: Clean, j: int, rng: np.random.Generator, anywhere: bool) -> np.ndarray | None:
    by = int(np.ceil(max(0.04, 10 * clean.log.period) / clean.log.period))
    v = clean.log.velocity[:, j]
    late = np.concatenate([np.full(by, v[0]), v[:-by]])
    # what a delay leaves to see is the change of velocity within it
    return late if anywhere or np.std(late - v) > 0.05 * np.std(v) else None


def _foreign(clean: Clean, j: int, rng: np.random.Generator, anywhere: bool) -> np.ndarray | None:
    least = 0.0 if anywhere else 0.3 * top_speed(clean, j)
    others = [k for k in range(len(clean.log.joints)) if k != j and top_speed(clean, k) > least]
    if not others:
        return None
    v = clean.log.velocity[:, int(rng.choice(others))]
    alike = abs(np.corrcoef(v, clean.speed[:, j])[0, 1])
    return v if anywhere or alike < 0.7 else None


def inverted(clean: Clean, rng: np.random.Generator, anywhere: bool = False) -> Planted | None:
    j = some_joint(clean, rng)
    if not moves(clean, j):
        return None
    v = clean.speed[:, j]
    forth = np.mean(v[np.abs(v) > 0.1 * top_speed(clean, j)] > 0)
    if not anywhere and (clean.friction_share[j] < 0.3 or not 0.2 < forth < 0.8):
        return None
    return Planted(with_column(clean.log, "torque", j, -clean.log.torque[:, j]), clean.log.names[j])


def slip(clean: Clean, rng: np.random.Generator, anywhere: bool = False) -> Planted | None:
    log = clean.log
    if "position" not in log.channels or "torque" in clean.motion:
        return None
    by = max(2, int(np.ceil(6e-3 / log.period)))
    by = -by if clean.slip < 0 else by  # away from the half cycle that any controller has
    for j in rng.permutation(len(log.joints)).tolist():
        if moves(clean, j) and (anywhere or _worth(clean, j, by) > 0.03):
            keep = slice(max(by, 0), len(log) + min(by, 0))
            return Planted(
                with_column(log, "torque", j, np.roll(log.torque[:, j], by)).rows(keep), log.names[j]
            )
    return None


def _worth(clean: Clean, j: int, by: int) -> float:
    """Return what a shift is worth beyond all that inertia, friction and gravity could imitate, over the torque's scatter [1].

    By the true motion below about 10 Hz, away from reversals, and where the torque follows it to 4 % and is noisy by 20 % at
    most; 0 elsewhere.
    """
    v, tau = clean.speed[:, j], clean.log.torque[:, j]
    width = max(3, round(0.08 / clean.log.period))
    window = np.hanning(width + 2)[1:-1] / np.hanning(width + 2).sum()
    q, a = np.cumsum(v) * clean.log.period, np.gradient(v, clean.log.period)
    columns = [a, v, np.sign(v), np.ones_like(v), np.sin(q), np.cos(q), v * np.abs(v), tau]
    *terms, tau = (np.convolve(x, window, "same") for x in columns)
    terms = np.stack(terms, axis=1)
    terms /= np.sqrt(np.mean(terms**2, axis=0)) + 1e-12
    slow = np.abs(v) < 0.15 * top_speed(clean, j)
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


def short(clean: Clean, rng: np.random.Generator, anywhere: bool = False) -> Planted:
    k = some_row(clean, rng)
    return Planted(clean.log.rows(slice(k, k + 19)), None)


def held(clean: Clean, rng: np.random.Generator, anywhere: bool = False) -> Planted:
    log = clean.log
    still = {c: np.zeros((len(log), len(log.joints))) for c in ("position", "velocity") if c in log.channels}
    noise = rng.standard_normal(log.torque.shape) * clean.torque_noise
    return Planted(log.replace(torque=log.torque[:1] + noise, **still), log.names[0])


FAULTS: tuple[Fault, ...] = (
    Fault("few-samples", "19 samples", short),
    Fault("nan", "one sample", single(np.nan)),
    Fault("infinite", "one sample", single(np.inf)),
    Fault("unsorted-time", "two neighbours exchanged", swapped, "away from the ends"),
    Fault("unsorted-time", "clock set back by 50 samples", set_back, "away from the ends"),
    Fault("repeated-time", "one sample sent twice", sent_twice, "away from the ends"),
    Fault("repeated-time", "clock ticks every 3 to 10 samples", coarse_clock),
    Fault("jitter", "20 % of the interval", uneven),
    Fault("gaps", "5 samples", dropped, "away from the ends"),
    Fault(
        "integer-wrap",
        "one -1 read as 2^16-1 or 2^32-1, any scale",
        minus_one,
        "torque or velocity of 10 counts or more, at a sample within 3 counts and 1 % of the range of -1",
    ),
    Fault(
        "integer-wrap",
        "negative values read as unsigned",
        unsigned,
        "torque or velocity of 10 counts or more and of both signs",
    ),
    Fault(
        "integer-wrap",
        "16 bits run over, by 2 % or more",
        overflow,
        "torque without a resolution of its own, which crosses the limit by less than 3000 counts a sample",
    ),
    Fault(
        "encoder-wrap",
        "one turn, once",
        turn,
        "moving joint; range at most two turns, longest step a 12th of one",
    ),
    Fault(
        "encoder-wrap",
        "2^12, 2^16 or 2^20 counts, once",
        counter,
        "moving joint; range at most twice the counter's, longest step a 12th of it",
    ),
    Fault(
        "stuck",
        "20 samples in motion",
        frozen,
        "moving joint, 400 samples, above 20 % of top speed throughout; position: it moves by 20 steps meanwhile; velocity: "
        "a position beside it, off by 15 % of top speed and 5 steps in the mean and by 20 steps of position; torque: noise of "
        "3 steps, not at 0 or at its ends",
    ),
    Fault("stuck", "a dead channel", dead, "moving joint, three channels; torque not at 0"),
    Fault(
        "silent-torque",
        "20 samples in motion",
        silent,
        "moving joint, 400 samples, above 20 % of top speed and 10 times noise, step and long change (99 %) of torque throughout",
    ),
    Fault("silent-torque", "all samples", mute),
    Fault(
        "position-jump",
        "0.02 rad, and 15 of the longest steps",
        slipped,
        "moving joint; and 15 steps of resolution",
    ),
    Fault(
        "outlier",
        "one sample, 8 of the long steps (99.5 %), 5 % of range",
        spike,
        "moving joint, away from the ends; and 8 steps of resolution",
    ),
    Fault("outlier", "first or last sample, 3 ranges and 10 counts", wild_end, "a channel that changes"),
    Fault(
        "saturation",
        "5 % of the samples at the limit",
        clipped,
        "moving joint; 30 samples at a positive limit, 10 of them in a row, 3 times the noise below the highest; noise of 2 steps",
    ),
    Fault("no-motion", "nothing moves, torque noise only", held),
    Fault("degrees", "velocity", degrees_of("velocity"), "moving joint; range of position 50 steps"),
    Fault(
        "degrees",
        "position",
        degrees_of("position"),
        "moving joint with velocity; range of position 50 steps",
    ),
    Fault(
        "degrees",
        "position and velocity, stroke 30 deg",
        degrees_of("position", "velocity"),
        "moving joint that ends within half its range of where it began",
    ),
    Fault(
        "velocity-mismatch",
        "opposite sign",
        _velocity(lambda c, j, rng, anywhere: -c.log.velocity[:, j]),
        "moving joint; range of position 200 steps",
    ),
    Fault(
        "velocity-mismatch",
        "factor 1.25",
        _velocity(lambda c, j, rng, anywhere: 1.25 * c.log.velocity[:, j]),
        "moving joint; range of position 200 steps",
    ),
    Fault(
        "velocity-mismatch",
        "40 ms and 10 samples late",
        _velocity(_delayed),
        "moving joint; range of position 200 steps; changes velocity by 5 % of its scatter",
    ),
    Fault(
        "velocity-mismatch",
        "another joint's velocity",
        _velocity(_foreign),
        "moving joint; range of position 200 steps; the other's top speed 30 % of its own, correlation below 0.7",
    ),
    Fault(
        "torque-sign",
        "one joint, friction 30 % of the torque's scatter",
        inverted,
        "moving joint, 20 to 80 % of the motion in one direction",
    ),
    Fault(
        "time-slip",
        "2 samples and 6 ms, worth 3 % of the torque",
        slip,
        "moving joint under position control, away from its own slip; the 3 % beyond what inertia, friction, gravity and drag "
        "could imitate, below 10 Hz and away from reversals; these explain torque to 4 %, its noise at most 20 %",
    ),
)
