"""Compiled loop of axes in lockstep: eight of them take each step together, and so does the search of their velocities.

A velocity that is implicit in the friction takes a handful of evaluations of the law, each of which waits for the one before. One
axis alone leaves the processor idle meanwhile; here each instruction of the search works on all eight. Axes whose search has
ended wait for the others. The search is that of `laws.kernels.solve`, and the numbers are those of `forward.lanes`, bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from backdrive._assembly import put_in
from backdrive._jit import ladder, leaf, specialise
from backdrive.engine import axis as axis_
from backdrive.engine import drives
from backdrive.engine.loops import COLUMNS, column
from backdrive.laws import kernels

WIDTH = 8  # axes, a row of vector registers


class Step(NamedTuple):
    """Numbers of the axes during one step, (WIDTH,) each.

    Attributes:
        free: velocity after the step without friction.
        by_mass: time step by mass.
        motor, external: the pair of loads.
        temp: temperature.
        state: of the friction element.
        toward: direction of motion, 1 or -1.
        speed: trial speed.
        close: residual at which the search ends.
        live: 1 while the search goes on.
        low, low_excess: a speed at which friction is too weak, and its residual.
        high, high_excess: a speed at which friction is too strong, infinite until one is known.
        stride: factor of the next stride while no such speed is known.
        side: end of the bracket that the last trial replaced.
        velocity: result.
        tried: 1 where the last trial was at the result.
        after: state after that trial.
    """

    free: np.ndarray
    by_mass: np.ndarray
    motor: np.ndarray
    external: np.ndarray
    temp: np.ndarray
    state: np.ndarray
    toward: np.ndarray
    speed: np.ndarray
    close: np.ndarray
    live: np.ndarray
    low: np.ndarray
    low_excess: np.ndarray
    high: np.ndarray
    high_excess: np.ndarray
    stride: np.ndarray
    side: np.ndarray
    velocity: np.ndarray
    tried: np.ndarray
    after: np.ndarray


def serves(element: int, rows: np.ndarray) -> bool:
    """Return whether the loop of this module can run laws with an element, from their parameter rows (L, P)."""
    return not kernels.ROWS >> element & 1 and rows.shape[1] <= COLUMNS and kernels.plain(rows)


def work() -> tuple[np.ndarray, Step]:
    """Return the work arrays of the loop."""
    return np.zeros((COLUMNS, WIDTH)), Step(*np.zeros((len(Step._fields), WIDTH)))


@ladder
def begin_search(holds: int, rate: int, element: int, place: int, Q: Any, N: Any, h: float):
    """Evaluate the law at rest: where the mass is not held, the direction of motion and a first speed."""
    for w in range(WIDTH):
        free, by_mass, pair = N.free[w], N.by_mass[w], (N.motor[w], N.external[w])
        toward = 1.0 if free > 0.0 else -1.0
        rest, held = toward * 0.0, False
        if holds:
            lo, hi, viscous = kernels.limits_of(rate, True, column(Q, w), 0.0, pair, N.temp[w])
            held = by_mass * lo <= free <= by_mass * hi
            friction = (hi if toward > 0.0 else lo) + viscous
        else:
            _, friction = kernels.step_one(
                rate, element, True, column(Q, w), place, N.state[w], rest, rest * h, h, pair, N.temp[w]
            )
        excess = (0.0 - toward * free) + toward * by_mass * friction
        sound = abs(free) < np.inf and (held or abs(excess) < np.inf)
        speed = abs(excess)
        N.velocity[w] = 0.0 if sound else np.nan
        N.live[w] = 1.0 if sound and not held and excess != 0.0 else 0.0
        N.toward[w] = -toward if excess > 0.0 else toward
        N.speed[w], N.close[w] = speed, kernels.CLOSE * (abs(free) + speed)
        N.low[w], N.low_excess[w], N.high[w], N.high_excess[w] = 0.0, -speed, np.inf, np.inf
        N.stride[w], N.side[w], N.tried[w] = 2.0, 0.0, 0.0


@ladder
def try_speeds(holds: int, rate: int, element: int, place: int, Q: Any, N: Any, h: float, n: int):
    """Evaluate the law at the trial speeds, the n-th ones, and choose the next ones, without a branch."""
    for w in range(WIDTH):
        free, pair, toward, speed = N.free[w], (N.motor[w], N.external[w]), N.toward[w], N.speed[w]
        v, z = toward * speed, 0.0
        if holds:
            lo, hi, viscous = kernels.limits_of(rate, True, column(Q, w), v, pair, N.temp[w])
            friction = (hi if toward > 0.0 else lo) + viscous
        else:
            at = kernels.slow(v)
            z, friction = kernels.step_one(
                rate, element, True, column(Q, w), place, N.state[w], at, at * h, h, pair, N.temp[w]
            )
        excess = (speed - toward * free) + toward * N.by_mass[w] * friction
        # all numbers first, so that no branch stands around a load
        low, low_excess, high, high_excess = N.low[w], N.low_excess[w], N.high[w], N.high_excess[w]
        stride, side, live, velocity = N.stride[w], N.side[w], N.live[w] > 0.0, N.velocity[w]
        tried, after, smallest = N.tried[w], N.after[w], N.close[w]
        strong = excess > 0.0
        unknown = high == np.inf and not strong
        strides = unknown and n < kernels.STEPS
        share = kernels.remainder(excess, high_excess if strong else low_excess)
        low, high = low if strong else speed, speed if strong else high
        less = share * (low_excess if strong else high_excess)
        low_excess, high_excess = (
            (less if side > 0.0 else low_excess) if strong else excess,
            excess if strong else (less if side < 0.0 else high_excess),
        )
        secant = high - high_excess * (high - low) / (high_excess - low_excess)
        following = secant if n < 2 * kernels.STEPS else 0.5 * (low + high)
        close = abs(excess) <= smallest
        ends = live and (close or (not strides and not low < following < high))
        N.velocity[w] = toward * (speed if close else secant) if ends else velocity
        N.tried[w] = 1.0 if ends and close else tried
        N.after[w] = z if ends else after
        N.live[w] = 1.0 if live and not ends else 0.0
        N.speed[w] = speed - stride * excess if strides else following
        N.stride[w] = 2.0 * stride if unknown else stride
        N.side[w] = 1.0 if strong else (side if strides else -1.0)
        N.low[w], N.low_excess[w], N.high[w], N.high_excess[w] = low, low_excess, high, high_excess


@leaf
def searches(N: Any):
    """Return the number of axes whose search goes on."""
    count = 0
    for w in range(WIDTH):
        count += 1 if N.live[w] > 0.0 else 0
    return count


@leaf
def end_search(N: Any, w: int):
    """Velocity of an axis at the end, where the search has not ended by itself too."""
    if N.live[w] > 0.0:
        N.velocity[w] = N.toward[w] * (
            N.high[w] - N.high_excess[w] * (N.high[w] - N.low[w]) / (N.high_excess[w] - N.low_excess[w])
        )
    return N.velocity[w]


@ladder
def keep_state(rate: int, element: int, p: Any, x: Any, N: Any, w: int, v: float, h: float):
    """Advance the state of an axis by a step at the velocity v; the last trial was this step, as a rule."""
    if N.tried[w] > 0.0 and v * h / h == v:
        N.state[w] = N.after[w]
    else:
        x[0], pair = N.state[w], (N.motor[w], N.external[w])
        kernels.step(rate, element, p, x, v * h, h, pair, N.temp[w])
        N.state[w] = x[0]


@cache
def in_lockstep(rate: int, element: int, place: int) -> Callable:
    """Return the loop of one law over lanes; a lane is one axis driven by one of the inputs, as for `forward.lanes`.

    Args:
        rate: kind of the rate law; all its rows have the same length.
        element: kind of the element.
        place: where the row of the element begins.
    """
    holds = int(kernels.HOLDS >> element & 1)  # a name alone: the other branch ends before types are inferred

    def lockstep(first, last, J, D, P, X, S, C, log, r, supply, enabled, temp, dt, substeps, out, Q, N):  # noqa: PLR0913  (a kernel's row)
        supplies, switches, temps = supply.shape[1] > 1, enabled.shape[1] > 1, temp.shape[1] > 1
        h = dt / substeps
        for begin in range(first, last, WIDTH):
            count = min(WIDTH, last - begin)
            for w in range(WIDTH):
                i = begin + min(w, count - 1)
                for n in range(P.shape[1]):
                    Q[n, w] = P[i, n]
                N.free[w], N.by_mass[w], N.motor[w], N.external[w] = 0.0, h, 0.0, 0.0
                N.state[w], N.temp[w] = X[i, 0], temp[log[i], 0]
            for i in range(begin, begin + count):
                drives.begin(D[i], C[i], r[log[i]], S[i, 0], dt)
            for k in range(r.shape[1]):
                for part in range(substeps):
                    for w in range(count):
                        i = begin + w
                        m = log[i]
                        on, volts = enabled[m, k if switches else 0], supply[m, k if supplies else 0]
                        u = drives.torque_at(
                            D[i], C[i], r[m], k + part / substeps, on, volts, S[i, 0], S[i, 1], h, dt
                        )
                        if part == 0:
                            out[i, k, 0], out[i, k, 1], out[i, k, 2] = S[i, 0], S[i, 1], u
                        free, by_mass, wider, pair = axis_.drift(J[i], S[i], u, h)
                        N.free[w], N.by_mass[w] = axis_.narrow(free, by_mass, wider), by_mass
                        N.motor[w], N.external[w] = pair
                        N.temp[w] = temp[m, k if temps else 0]
                    begin_search(holds, rate, element, place, Q, N, h)
                    for n in range(3 * kernels.STEPS):
                        if searches(N) == 0:
                            break
                        try_speeds(holds, rate, element, place, Q, N, h, n)
                    for w in range(count):
                        i = begin + w
                        v = end_search(N, w)
                        if not holds:
                            keep_state(rate, element, P[i], X[i], N, w, v, h)
                        axis_.arrive(J[i], S[i], v, h)
            for w in range(count):
                X[begin + w, 0] = N.state[w]

    lockstep = put_in(lockstep, kernels.parts([rate], [element], plain=True))
    return specialise(lockstep, rate, element, place)
