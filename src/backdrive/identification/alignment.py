"""The start of a plan in its log, given or found by correlation, and the speed at which the plan was run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isfinite
from typing import Any, Literal

import numpy as np

from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.identification.sweep_windows import turning_points
from backdrive.logs.log import Log

ALIKE = 0.8  # least correlation of planned and measured velocity [-]
# least distance of a second start, relative to the plan, and its least correlation, relative to the best [-]
APART, EQUAL = 0.05, 0.98
OFF = 0.02  # relative deviation of the duration from the plan above which there is a remark [-]
MOST = 1 << 19  # largest number of grid points for the lag

FEWEST_REVERSALS = 4  # least number of reversals that motion and plan have in common
OVERLAP = 0.7  # least number of common reversals, relative to the larger number in motion and plan [-]
STROKES = (0.1, 0.2, 0.3)  # tried least strokes between reversals, relative to the travel [-]
UNEVEN = 0.1  # largest RMS deviation of the reversals' instants, relative to the mean time between two [-]

Start = float | Literal["auto"]


@dataclass(frozen=True, kw_only=True)
class Tempo:
    """The ratio of a motion to its plan.

    Attributes:
        duration: duration of the motion by the log's clock, divided by the plan's [-].
        stroke: stroke of the motion divided by the plan's [-]; negative if the motion has the opposite direction.
    """

    duration: float
    stroke: float


def with_plan(log: Log, plan: Any, start: Start) -> Log:
    """Return a log linked to its plan, shifted to the instant at which the plan was run.

    Args:
        log: with position or velocity.
        plan: an object of `backdrive.plans`.
        start: seconds after the first sample, or `auto` [s].

    Raises:
        InvalidInput: the start is not a time within the log, or the plan does not command positions.
        NotIdentifiable: the planned motion correlates with the measured one at no lag.
    """
    if plan is None:
        raise InvalidInput("--start was given without a plan.", remedy="Give --plan (in Python plan=).")
    if start == "auto":
        lag, alike, other = best_lag(log, plan)
        told = f"by the motion (correlation {alike:.3f})"
        if other is not None:
            told += (
                f"; it would fit as well at {other:.4g} s, so that --start SECONDS must say which is meant"
            )
    else:
        lag, told = _seconds(start), "as asked"
    if not -plan.duration < lag < log.duration:
        raise InvalidInput(
            f"A plan of {plan.duration:.6g} s that begins at {lag:g} s lies outside the log of {log.duration:.6g} s.",
            remedy="Give seconds after the first sample, or auto.",
        )
    begin = float(log.time[0]) + lag
    return log.replace(plan=replace(plan, start=begin)).with_note(
        f"The plan begins {lag:.4g} s after the first sample, {told}."
    )


def best_lag(log: Log, plan: Any) -> tuple[float, float, float | None]:
    """Return the time from a log's first sample to the start of its plan [s], and the correlation of the velocities there [-].

    The third value is another time at which the plan fits as well, or None. The log may contain the motion twice.

    The lag maximizes the cross-correlation of planned and measured velocity, summed over the joints of the plan. If the plan
    has one joint and the log does not name it, the joint that correlates best is used.

    Raises:
        InvalidInput: the plan does not command positions, or the log has no clock.
        NotIdentifiable: even at the best lag, the velocities hardly correlate.
    """
    lag, alike, other = closest_lag(log, plan)
    if not alike >= ALIKE:
        took, remedy = (
            "",
            "Link the log to the plan that was run, give --start SECONDS, or leave the plan out.",
        )
        own = next((name for name in log.names if is_of_joint(log.replace(plan=plan), name)), None)
        ran = None if own is None else tempo(log, own, plan)
        if ran is not None and abs(ran.duration - 1.0) > OFF:
            took = f". By the log's clock the motion took {ran.duration:.3f} times as long as the plan"
            remedy = "Correct the clock (--map t=FACTOR*COLUMN), plan the speed that was run, or leave the plan out."
        raise NotIdentifiable(
            f"The log does not contain the motion of its plan: the velocities correlate by {max(alike, 0.0):.2f} "
            f"at most{took}.",
            remedy=remedy,
        )
    return lag, alike, other


def closest_lag(log: Log, plan: Any) -> tuple[float, float, float | None]:
    """Return the same as `best_lag`, however little the velocities correlate.

    Raises:
        InvalidInput: the plan does not command positions, or the log has no clock.
    """
    from scipy.signal import correlate  # a slow import, which few logs need

    if getattr(plan, "commands", "") != "position":
        raise InvalidInput(
            "The start of a torque plan cannot be found from the motion.", remedy="Give --start SECONDS."
        )
    step = max(log.period, (log.duration + plan.duration) / MOST) if len(log) > 1 else 0.0
    if not step > 0.0:
        raise InvalidInput(
            "The log has no clock that runs.", remedy="Correct its time, or give --start SECONDS."
        )
    instants = np.arange(int(plan.duration / step) + 1) * step
    planned = np.reshape(replace(plan, start=0.0).velocity(instants), (instants.size, -1))
    columns = _columns(log, plan)
    measured = {c: _velocity(log, c, step) for c in {c for pairs in columns for c, _ in pairs}}
    best, other = (0.0, -1.0), None
    for pairs in columns:
        product = sum(correlate(measured[c], planned[:, p], mode="full", method="fft") for c, p in pairs)
        product = np.asarray(product)
        at = int(np.argmax(product))
        apart = np.abs(np.arange(product.size) - at) > APART * instants.size
        rival = int(np.argmax(np.where(apart, product, -np.inf)))
        lag = at - (instants.size - 1)
        rows = slice(max(lag, 0), min(lag + instants.size, len(measured[pairs[0][0]])))
        same = slice(rows.start - lag, rows.stop - lag)
        energy = (
            sum(np.sum(measured[c][rows] ** 2) for c, _ in pairs),
            sum(np.sum(planned[same, p] ** 2) for _, p in pairs),
        )
        whole = sum(np.sum(planned[:, p] ** 2) for _, p in pairs)
        size = float(np.sqrt(energy[0] * max(energy[1], 0.5 * whole)))
        alike = float(product[at]) / size if size > 0.0 else 0.0
        if alike > best[1]:
            best = ((lag + _vertex(product, at)) * step, alike)
            equal = apart.any() and product[rival] > EQUAL * product[at]
            other = (rival - (instants.size - 1)) * step if equal else None
    return (*best, other)


def likeness(log: Log, joint: str, plan: Any) -> float:
    """Return the correlation of the planned and the measured velocity of a joint, at the start that the plan has [-].

    Args:
        log: with position or velocity.
        joint: name.
        plan: of this joint, an object of `backdrive.plans` that commands positions.
    """
    own = log.select(joint)
    step = max(own.period, (own.duration + plan.duration) / MOST)
    measured = _velocity(own, 0, step)
    planned = np.ravel(plan.velocity(own.time[0] + step * np.arange(measured.size)))
    size = float(np.sqrt((measured @ measured) * (planned @ planned)))
    return float(measured @ planned) / size if size > 0.0 else 0.0


def is_of_joint(log: Log, joint: str) -> bool:
    """Return whether a log's plan is of one joint, and of this one: by its name, or as the only joint of the log.

    Plans that nobody named are of `joint`, and logs whose columns name no joint of `joint_1`.

    Args:
        log: linked to a plan.
        joint: a name in the log.
    """
    name = getattr(log.plan, "joint", None)
    return name is not None and (name == joint or log.names == (joint,))


def tempo(log: Log, joint: str, plan: Any) -> Tempo | None:
    """Return the ratio of a joint's motion to its plan; None if the reversals of the two do not match.

    Reversals are compared one by one, for any delay. If one side has more of them, the best-fitting overlap counts.

    Args:
        log: with position or velocity.
        joint: name.
        plan: of this joint, an object of `backdrive.plans`.
    """
    if getattr(plan, "commands", "") != "position" or not log.period > 0.0:
        return None
    own = log.select(joint)
    step = max(own.period, plan.duration / MOST)
    instants = np.arange(int(plan.duration / step) + 1) * step
    wanted = np.asarray(replace(plan, start=0.0).position(instants))
    actual = np.cumsum(_velocity(own, 0, step)) * step
    for share in STROKES:
        ran = _compare(_reversals(wanted, step, share), _reversals(actual, step, share))
        if ran is not None:
            return ran
    return None


def _compare(wanted: np.ndarray, actual: np.ndarray) -> Tempo | None:
    """Return the ratio of two series of reversals; None if they do not match.

    Args:
        wanted: instants [s] and positions of the plan's reversals, (2, n).
        actual: instants [s] and positions of the motion's reversals, (2, k).
    """
    n, k = wanted.shape[1], actual.shape[1]
    least, best = UNEVEN, None
    for shift in range(1 - k, n):
        (a, p), (b, q) = wanted[:, max(shift, 0) : shift + k], actual[:, max(-shift, 0) : n - shift]
        if a.size < max(FEWEST_REVERSALS, OVERLAP * max(n, k)):
            continue
        ratio, begin = np.polyfit(a, b, 1)
        strokes = np.diff(q) / np.diff(p)
        size = float(np.median(strokes))
        late = np.sqrt(np.mean((b - begin - ratio * a) ** 2)) / np.mean(np.diff(b))
        uneven = max(float(late), float(np.median(np.abs(strokes / size - 1.0))))
        if uneven < least:
            least, best = uneven, Tempo(duration=float(ratio), stroke=size)
    return best


def _reversals(position: np.ndarray, step: float, share: float) -> np.ndarray:
    """Return instants [s] and positions of the turns between strokes of at least a share of the travel, (2, n)."""
    turns = turning_points(position, share * float(np.ptp(position)))[1:-1]
    return np.stack([step * turns, position[turns]])


def _columns(log: Log, plan: Any) -> list[list[tuple[int, int]]]:
    """Return alternative assignments of columns of the log to columns of the plan's velocity."""
    names: Sequence[str] = getattr(plan, "joints", (getattr(plan, "joint", ""),))
    pairs = [(log.names.index(name), i) for i, name in enumerate(names) if name in log.names]
    if pairs:
        return [pairs]
    if len(names) == 1:
        return [[(column, 0)] for column in range(len(log.names))]
    raise InvalidInput(
        f"The plan is of {', '.join(names)}, the log of {', '.join(log.names)}.",
        remedy="Name the log's joints as the plan has them (--names), or give --start SECONDS.",
    )


def _velocity(log: Log, column: int, step: float) -> np.ndarray:
    """Return a joint's velocity on a uniform grid from the first sample on, (n,); zeros if it is unknown."""
    channel = log.position if log.position is not None else log.need("velocity")
    usable = np.isfinite(channel[:, column]) & np.isfinite(log.time)
    time, where = np.unique(log.time[usable], return_index=True)
    if time.size < 2:
        return np.zeros(2)
    grid = log.time[0] + np.arange(int(log.duration / step) + 1) * step
    values = np.interp(grid, time, channel[usable, column][where])
    return np.gradient(values, step) if log.position is not None else values


def _vertex(values: np.ndarray, at: int) -> float:
    """Return the distance of a parabola's vertex, through three samples, from the middle one [sample]."""
    if not 0 < at < len(values) - 1:
        return 0.0
    before, top, after = values[at - 1 : at + 2]
    bend = before - 2.0 * top + after
    return float(0.5 * (before - after) / bend) if bend < 0.0 else 0.0


def _seconds(start: object) -> float:
    if isinstance(start, (int, float)) and not isinstance(start, bool) and isfinite(start):
        return float(start)
    raise InvalidInput(f"start = {start!r}.", remedy="Give seconds after the log's first sample, or auto.")
