"""Compiled loops of one law over groups of lanes, for elements with `ahead` (`laws.base.Element`) or without a state.

A lane is one parameter row on one of the motions. The groups advance in blocks of ticks, with three passes per block. First,
everything that does not depend on the state is evaluated lane by lane, several ticks per instruction. Then the states of a
group advance side by side, tick by tick: while one state waits for its own previous tick, the processor computes the others.
Finally the torques follow from the states, again several ticks per instruction. Set-valued friction has no state and needs
only one pass. The results are bit-identical to `kernels.step`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from backdrive._assembly import put_in
from backdrive._jit import specialise, widest
from backdrive.laws import kernels

BLOCK = 128  # ticks
LONGER = 4096  # ticks of a block without a state, of which the first-level cache holds the motion alone
ROW = BLOCK + 6  # not a power of two: reads would then wait for writes to addresses with the same last bits
TOGETHER = 8  # lanes whose states advance side by side; their work arrays for one block hardly exceed the first-level cache


def serves(element: int) -> bool:
    """Return whether the loop of this module can run an element."""
    return bool((kernels.HOLDS | kernels.FOLLOWS) >> element & 1)


def holds(element: int) -> bool:
    """Return whether an element has no state, so that its lanes gain nothing side by side, and one loop does for any number."""
    return bool(kernels.HOLDS >> element & 1)


def work() -> tuple[np.ndarray, ...]:
    """Return the work arrays of the loop: velocities of a block; a row of each lane for `ahead`, `weight` and the state.

    The rows of an array follow each other at a distance that the compiler knows.
    """
    return (np.empty(BLOCK), *(np.zeros(TOGETHER * ROW) for _ in range(4)))


@cache
def in_groups(rate: int, element: int, plain: bool, tame: bool, together: int) -> Callable:
    """Return the loop of one law over lanes; each lane is a parameter row on one of the motions.

    Args:
        rate: kind of the rate law.
        element: kind of the element.
        plain: the law neither grows with the load nor differs by direction.
        tame: no velocity exceeds `kernels.FASTEST`, so velocities need no check; without a state the check costs nothing.
        together: lanes of a group, at most TOGETHER.
    """
    moves = int(kernels.MOVES >> element & 1)  # a name alone: the other branch ends before types are inferred

    def stateless(which, P, X, motion, dp, dt, load, temp, V, A, B, C, Z, out):  # noqa: PLR0913  (a kernel's row)
        widest()
        loads, temps = load.shape[1] > 1, temp.shape[1] > 1
        for start in range(0, dp.shape[1], LONGER):
            stop = min(start + LONGER, dp.shape[1])
            for i in which:
                m, p, place = motion[i], P[i], 1 + int(P[i, 0])
                tau, moved = out[i, start:stop], dp[m, start:stop]
                loaded = load[m, start:stop] if loads else load[m]
                warm = temp[m, start:stop] if temps else temp[m]
                for k in range(moved.size):
                    v = kernels.slow(moved[k] / dt)
                    d = kernels.within(v, moved[k], dt)
                    at = k if loads else 0
                    pair, t = (loaded[at, 0], loaded[at, 1]), warm[k if temps else 0]
                    if moves:
                        _, tau[k] = kernels.step_one(rate, element, plain, p, place, 0.0, v, d, dt, pair, t)
                    else:  # the same, and half as long to compile
                        lo, hi, viscous = kernels.limits_of(rate, plain, p, v, pair, t)
                        tau[k] = kernels.carry_plain(element, (p, place, 0.0, lo, hi, d, dt))[1] + viscous

    def groups(which, P, X, motion, dp, dt, load, temp, V, A, B, C, Z, out):  # noqa: PLR0913  (a kernel's row)
        widest()
        loads, temps = load.shape[1] > 1, temp.shape[1] > 1
        for first in range(0, which.size, together):
            count = min(together, which.size - first)
            for start in range(0, dp.shape[1], BLOCK):
                stop, last = min(start + BLOCK, dp.shape[1]), -1
                for j in range(count):
                    i = which[first + j]
                    m, p, place = motion[i], P[i], 1 + int(P[i, 0])
                    tau, moved = out[i, start:stop], dp[m, start:stop]
                    loaded = load[m, start:stop] if loads else load[m]
                    warm = temp[m, start:stop] if temps else temp[m]
                    if m != last:
                        for k in range(moved.size):
                            V[k] = moved[k] / dt if tame else kernels.slow(moved[k] / dt)
                        last = m
                    row = j * ROW
                    a, b, c = A[row : row + ROW], B[row : row + ROW], C[row : row + ROW]
                    for k in range(moved.size):  # short loops, for each needs many registers
                        at = k if loads else 0
                        pair, t = (loaded[at, 0], loaded[at, 1]), warm[k if temps else 0]
                        a[k], b[k], tau[k] = kernels.bounds(rate, element, plain, p, V[k], pair, t)
                    for k in range(moved.size):
                        d = moved[k] if tame else kernels.within(V[k], moved[k], dt)
                        a[k], b[k] = kernels.look_ahead(element, (p, place, a[k], b[k], d))
                    for k in range(moved.size):
                        c[k] = kernels.weight(element, (p, place, V[k]))
                    Z[row] = X[i, 0]
                for k in range(stop - start):
                    for j in range(together):
                        at = j * ROW + k
                        Z[at + 1] = kernels.follow(element, (Z[at], A[at], B[at]))
                for j in range(count):
                    i = which[first + j]
                    p, place, row = P[i], 1 + int(P[i, 0]), j * ROW
                    z, c = Z[row : row + ROW], C[row : row + ROW]
                    tau = out[i, start:stop]
                    for k in range(tau.size):
                        tau[k] = (
                            kernels.torque_of_states(element, (p, place, z[k], z[k + 1], c[k], dt)) + tau[k]
                        )
                    X[i, 0] = z[tau.size]

    groups = put_in(
        stateless if holds(element) else groups, kernels.parts([rate], [element]) | kernels.ONE_AT_A_TIME
    )
    return specialise(groups, rate, element, int(plain), int(tame), together)
