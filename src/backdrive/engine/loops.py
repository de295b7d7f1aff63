"""Compiled loops of one law along motions: one lane at a time in blocks of ticks, or sixteen lanes interleaved.

A lane is one parameter row on one of the motions. A loop compiled for one law is as fast as hand-written code; a loop that
selects among all laws in every tick takes up to four times as long. A law's loop is compiled at its first use and cached on
disk. Both kinds of loop give bit-identical results to `kernels.step`.

In a block, the limits of many ticks are evaluated first with vector instructions; then the element's state is advanced tick
by tick. If there are enough lanes, sixteen are interleaved instead (structure of arrays), so that every instruction works on
several lanes. The caller supplies the work arrays, since compiled code does not allocate.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from backdrive._assembly import put_in
from backdrive._jit import ladder, specialise, widest
from backdrive.laws import kernels

BLOCK = 64  # ticks
LANES = 16  # lanes that are interleaved
WIDTH = 8  # lanes of the innermost loop
COLUMNS = 16  # largest length of a row in an interleaved loop
FEWEST = 16  # smallest number of lanes for an interleaved loop


def work() -> tuple[np.ndarray, ...]:
    """Return the work arrays of a loop: limits and motion of a block; rows, states, torque and motion of lanes."""
    return (
        np.empty((4, BLOCK)),
        np.zeros((COLUMNS, LANES)),
        np.empty(LANES),
        np.empty((2, BLOCK, LANES)),
    )


@cache
def one_by_one(rate: int, element: int, plain: bool, sections: int, tame: bool) -> Callable:
    """Return the loop of one law over lanes, one after the other; each lane is a parameter row on one of the motions.

    Args:
        rate: kind of the rate law.
        element: kind of the element.
        plain: the law neither grows with the load nor differs by direction.
        sections: number of sections of the element's row, as a constant; 0: the loop reads it from the row.
        tame: no velocity exceeds `kernels.FASTEST`, so velocities need no check.
    """
    # names alone: the compiler leaves out the other branches before it looks at types
    rows, moves = int(kernels.ROWS >> element & 1), int(kernels.MOVES >> element & 1)

    def lanes(which, P, X, motion, dp, dt, load, temp, W, Q, Z, T, out):  # noqa: PLR0913  (a kernel's row)
        widest()
        loads, temps = load.shape[1] > 1, temp.shape[1] > 1
        lo, hi, viscous, slid = W[0], W[1], W[2], W[3]
        for i in which:
            m = motion[i]
            p, x = P[i], X[i]
            place = 1 + int(p[0])
            if sections and int(p[place]) != sections:
                continue  # tells the compiler the number of loop rounds
            for start in range(0, dp.shape[1], BLOCK):
                stop = min(start + BLOCK, dp.shape[1])
                tau, moved = out[i, start:stop], dp[m, start:stop]
                loaded = load[m, start:stop] if loads else load[m]
                warm = temp[m, start:stop] if temps else temp[m]
                for k in range(moved.size):
                    j = k if loads else 0
                    pair, t = (loaded[j, 0], loaded[j, 1]), warm[k if temps else 0]
                    v = moved[k] / dt if tame else kernels.slow(moved[k] / dt)
                    lo[k], hi[k], still = kernels.bounds(rate, element, plain, p, v, pair, t)
                    if not moves:
                        viscous[k] = still
                z = x[0]
                for k in range(moved.size):
                    d = moved[k] if tame else kernels.within(kernels.slow(moved[k] / dt), moved[k], dt)
                    if rows:
                        tau[k] = kernels.carry_row(element, (p, place, x, x, lo[k], hi[k], d, dt))
                    elif moves:
                        z, tau[k], slid[k] = kernels.carry_moving(element, (p, place, z, lo[k], hi[k], d, dt))
                    else:
                        z, tau[k] = kernels.carry_plain(element, (p, place, z, lo[k], hi[k], d, dt))
                if not rows:
                    x[0] = z
                for k in range(moved.size):
                    if moves:
                        j = k if loads else 0
                        pair, t = (loaded[j, 0], loaded[j, 1]), warm[k if temps else 0]
                        tau[k] += kernels.limits_of(rate, plain, p, slid[k] / dt, pair, t)[2]
                    else:
                        tau[k] += viscous[k]

    lanes = put_in(lanes, kernels.parts([rate], [element]) | kernels.ONE_AT_A_TIME)
    return specialise(lanes, rate, element, int(plain), sections, int(tame))


@ladder
def column(Q: Any, j: int) -> Any:
    """Return a column of a table with COLUMNS rows as a tuple, which kernels index like a row."""
    return (
        Q[0, j], Q[1, j], Q[2, j], Q[3, j], Q[4, j], Q[5, j], Q[6, j], Q[7, j],
        Q[8, j], Q[9, j], Q[10, j], Q[11, j], Q[12, j], Q[13, j], Q[14, j], Q[15, j],
    )  # fmt: skip


@cache
def lane_loop(rate: int, element: int, place: int, tame: bool, shared: bool) -> Callable:
    """Return the interleaved loop of one law over lanes, for an element whose state is one number.

    Args:
        rate: kind of the rate law; all its rows have the same length.
        element: kind of the element.
        place: where the row of the element begins.
        tame: no velocity exceeds `kernels.FASTEST`, so velocities need no check.
        shared: all lanes are on the same motion.
    """

    def side_by_side(which, P, X, motion, dp, dt, load, temp, W, Q, Z, T, out):  # noqa: PLR0913, PLR0912  (a kernel's row)
        widest()
        loads, temps = load.shape[1] > 1, temp.shape[1] > 1
        V, D = W[0], W[1]
        U, E = T[0], T[1]
        for first in range(0, which.size, LANES):
            count = min(LANES, which.size - first)
            for j in range(LANES):
                i = which[first + min(j, count - 1)]
                Z[j] = X[i, 0]
                for r in range(P.shape[1]):
                    Q[r, j] = P[i, r]
            m = motion[which[first]]
            for start in range(0, dp.shape[1], BLOCK):
                size = min(BLOCK, dp.shape[1] - start)
                if shared:
                    for k in range(size):
                        D[k] = dp[m, start + k]
                        V[k] = D[k] / dt if tame else kernels.slow(D[k] / dt)
                else:
                    for j in range(LANES):
                        moved = dp[motion[which[first + min(j, count - 1)]]]
                        for k in range(size):
                            E[k, j] = moved[start + k]
                for half in range(
                    0, LANES, WIDTH
                ):  # WIDTH fits the vector registers: the compiler unrolls the loop over w and hoists constants
                    for k in range(size):
                        for w in range(WIDTH):
                            j = half + w
                            if shared:
                                d, v, on = D[k], V[k], m
                            else:
                                d, on = E[k, j], motion[which[first + min(j, count - 1)]]
                                v = d / dt if tame else kernels.slow(d / dt)
                            if not tame:
                                d = kernels.within(v, d, dt)
                            at = start + k if loads else 0
                            p = column(Q, j)
                            pair, t = (load[on, at, 0], load[on, at, 1]), temp[on, start + k if temps else 0]
                            Z[j], U[k, j] = kernels.step_one(
                                rate, element, True, p, place, Z[j], v, d, dt, pair, t
                            )
                for j in range(count):
                    tau = out[which[first + j], start : start + size]
                    for k in range(size):
                        tau[k] = U[k, j]
            for j in range(count):
                X[which[first + j], 0] = Z[j]

    side_by_side = put_in(side_by_side, kernels.parts([rate], [element]))
    return specialise(side_by_side, rate, element, place, int(tame), int(shared))
