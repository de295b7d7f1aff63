"""Parts of torque ramps in which a joint sticks: their compliance, and the torque at which the joint starts to slip."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from backdrive.identification.break_away import COUNTED, EDGE, SETTLED, SHORTEST, line, onset, overcome
from backdrive.identification.regression import long_run
from backdrive.identification.signals import spans
from backdrive.identification.sweep_windows import turning_points
from backdrive.logs import filters
from backdrive.logs.log import Log

CUTOFF = 20.0  # cutoff frequency of the low pass on torque and position of a ramp [Hz]
BRANCH = 0.2  # least torque range of a ramp, relative to the whole torque range [-]
SLIPS = 30.0  # least speed of a slip, relative to that at the start of the log, or in a quiet tenth of its ramps [-]
QUIET = 0.25  # share of the tenths of all ramps that are quieter [-]
FLICKER = 10.0  # least speed of a slip [count per period of the low pass]
RESOLVED = 5.0  # least displacement before break-away that determines a stiffness [count]
GRID = 400  # about the number of samples at which the begin of the first ramp is sought
LATEST = 0.8  # latest such begin, relative to the ramp's end [-]
CLEARER = 0.8  # largest sum of squares of a rest and a line, relative to that of a line [-]
START = 0.3  # first part of a branch's torque range, which gives the tangent stiffness [-]


@dataclass(frozen=True, kw_only=True, eq=False)
class Branch:
    """A part of one ramp in which the joint sticks and the torque changes in one direction.

    Attributes:
        torque: [N.m or N], (n,).
        position: as measured [rad or m], (n,).
        direction: 1 for rising torque, -1 for falling torque.
        break_away: torque at the start of the slip that ends the branch, and its uncertainty [N.m or N]; None without a slip.
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
        """Compliance at the start of the branch and its standard error [rad/N.m or m/N]."""
        change = np.maximum.accumulate(np.abs(self.torque - self.torque[0]))
        part = slice(0, max(8, int(np.searchsorted(change, START * change[-1]))))
        return _compliance(self.torque[part], self.position[part])

    def bound(self, count: float) -> float:
        """Return a lower bound of the stiffness [N.m/rad or N/m].

        If the reading changes by n counts, the displacement is below n + 1 counts.

        Args:
            count: resolution of the encoder [rad or m].
        """
        torque = np.abs(self.torque - self.torque[0])
        moved = np.maximum.accumulate(np.abs(self.position - self.position[0]))
        return float(np.max(torque / (moved + count)))


def branches_of(log: Log, count: float) -> tuple[list[Branch], float, float]:
    """Return the branches of one log, the speed above which the joint slips, and the torque before the first ramp."""
    torque, position = log.driving_torque[:, 0], log.need("position")[:, 0]
    smooth, rate, cutoff = low_pass_torque(log)
    turns = ramp_turns(smooth, BRANCH, EDGE * rate)
    if turns.size < 2:
        return [], 0.0, float(torque[0])
    velocity = filters.derivative(filters.low_pass(position, cutoff, rate), log.period)
    tenths = [part for a, b in pairwise(turns) for part in np.array_split(np.abs(velocity[a:b]), 10)]
    low = int(turning_points(smooth, BRANCH * float(np.ptp(smooth)))[0])
    start = np.median(np.abs(velocity[low : low + max(2, (int(turns[1]) - low) // 10)]))
    quiet = np.quantile([np.median(part) for part in tenths if part.size], QUIET)
    creeps = float(min(start, quiet))  # as a log begins the joint may ring, and later it slides
    slips = max(SLIPS * creeps, FLICKER * count * cutoff)
    stuck = np.abs(velocity) < slips
    for start, stop in spans(~stuck):
        if np.ptp(position[start:stop]) < RESOLVED * count:
            stuck[start:stop] = True  # an encoder reading that toggles is not a slip
    settle = round(rate / cutoff)  # time over which the low pass spreads a slip
    result = []

    def slip_of(begin: int, at: int, turn: int, stuck: slice) -> tuple[float, float]:
        least = max(SETTLED * float(np.ptp(position[stuck])), COUNTED * count)
        ramp = line(torque, smooth, (begin, turn), rate)
        return overcome(torque, ramp, position, (begin, at, turn), least, rate) or onset(
            torque[begin : at + 1], velocity, at, rate, cutoff
        )

    for a, b in zip(turns, turns[1:], strict=False):
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
                    break_away=slip_of(a, stop, b, inside) if before else None,
                )
            )
    return result, slips, _before(torque, smooth, turns, rate)


def ramp_turns(smooth: np.ndarray, branch: float, edge: float) -> np.ndarray:
    """Return the samples at which ramps begin and end, (k,); a rest before the first one is none of it.

    Args:
        smooth: low-passed torque [N.m or N], (n,).
        branch: least range of a ramp, relative to that of the torque [-].
        edge: shortest rest that counts [sample].
    """
    turns = turning_points(smooth, branch * float(np.ptp(smooth)))
    if turns.size < 2:
        return turns
    every = max(1, int(turns[1]) // GRID)
    y = smooth[: int(turns[1]) + 1 : every]
    time = np.arange(y.size, dtype=float)
    bent = np.maximum(
        time - time[: int(LATEST * y.size) + 1, None], 0.0
    )  # a level, and a line from each sample on
    bent -= bent.mean(axis=1, keepdims=True)
    off = y - y.mean()
    left = off @ off - (bent @ off) ** 2 / np.maximum(np.sum(bent**2, axis=1), 1e-300)
    at = int(np.argmin(left))
    if left[at] < CLEARER * left[0] and at * every > turns[0] + edge:
        turns = turns.copy()
        turns[0] = at * every
    return turns


def _before(torque: np.ndarray, smooth: np.ndarray, turns: np.ndarray, rate: float) -> float:
    """Return the torque before the first ramp [N.m or N]: the mean before it, or the start of the ramp's line."""
    first = line(torque, smooth, (int(turns[0]), int(turns[1])), rate) if turns[0] < EDGE * rate else None
    return float(torque[: turns[0] + 1].mean() if first is None else first.at(turns[:1])[0])


def low_pass_torque(log: Log) -> tuple[np.ndarray, float, float]:
    """Return the low-passed torque of a log's only joint [N.m or N], (n,), its sampling rate and the cutoff frequency [Hz]."""
    rate = 1.0 / log.period
    cutoff = min(CUTOFF, 0.1 * rate)
    return filters.low_pass(log.driving_torque[:, 0], cutoff, rate), rate, cutoff


def _compliance(torque: np.ndarray, position: np.ndarray) -> tuple[float, float]:
    """Return the compliance of one branch, the slope of position over torque, and its standard error [rad/N.m or m/N].

    Both have noise, which would bias a regression of either on the other. Time has no noise and is correlated with both, so it
    is the instrumental variable (Durbin, Revue de l'Institut International de Statistique 22, 1954).
    """
    u, x, t = torque - torque.mean(), position - position.mean(), np.linspace(-1.0, 1.0, torque.size)
    power = float(t @ u)
    if power == 0.0:
        return 0.0, np.inf
    c = float(t @ x) / power
    left = x - c * u
    return c, float(np.sqrt(long_run((t * left)[None])[0, 0])) / abs(power)
