"""Compiled kernels: general ones that select among all laws by integers, and faster ones for given laws (`of_kinds`).

A law is a row `p`: p[0] is the number m of rate-law parameters, p[1:1+m] the rate law's row, p[1+m:] the element's. If
friction grows with the load, p[0] is larger by 1/2, and the last of the m numbers are those of `growth`. If the rate law
differs by direction, p[0] is larger by 1/4, and its row occurs twice (`direction`). A rate law reads its row from p[1] on, an
element from p[e] on: a slice would take more time than the law. `rate` and `element` are the integers of their classes; `x`
is the element's state, followed by equal space for the trial steps of `solve`; `load` is the pair of motor-side and external
torque, a tuple, `temp` the temperature. `limits`, `step` and `solve` are the three kernels that a law offers.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable
from functools import cache
from typing import Any, TypeVar

import numpy as np

from backdrive._assembly import assemble
from backdrive._jit import by_python, choice, jit, ladder, leaf, specialise
from backdrive._types import Array, Pair
from backdrive.elementary import decay, decay_of_one
from backdrive.laws import ELEMENTS, RATES, REFERENCE, absent, growth
from backdrive.laws.base import MOST, Rows, kernels_of
from backdrive.laws.elements import none

F = TypeVar("F", bound=Callable[..., Any])

STEPS = 60  # of each phase of `solve`; curves of line sections need a handful
CLOSE = 1e-14  # relative residual of the balance at which `solve` ends
FASTEST = 1e100  # velocities are limited to this speed, so that nothing overflows [rad/s or m/s]


def among(classes: Iterable[type[Rows]]) -> int:
    """Return the set of some laws, as the bits of an integer."""
    return sum(1 << kind for kind in {c.KIND for c in classes})


#: Elements whose state is a row; of the others, those whose viscous part uses another motion than the joint's; and the rest.
WIDE = [c for c in ELEMENTS.values() if c.STATE_ROW]
MOVERS = [c for c in ELEMENTS.values() if c.SLIDER or c.ZONE]
PLAIN = [c for c in ELEMENTS.values() if c not in WIDE and c not in MOVERS]
#: Elements whose step hardly depends on the state: their files also have `ahead`, `weight`, `follow` and `torque`.
FOLLOWERS = [c for c in PLAIN if hasattr(sys.modules[c.__module__], "ahead")]
FOLLOWS = among(FOLLOWERS)
ROWS, MOVES, HOLDS = among(WIDE), among(MOVERS), among(c for c in ELEMENTS.values() if c.SET_VALUED)
DRIVES = among(c for c in RATES.values() if not c.RESISTS)  # rate laws whose viscous part may drive the joint
MARKED = True  # a law may grow with the load or differ by direction: p[0] may hold a fraction
curve = choice(kernels_of(RATES.values(), "limits"), absent.no_curve)
#: Variants of rate laws for one velocity at a time; the others suit vector instructions. Both give the same numbers.
ONE_AT_A_TIME = {
    module.limits: module.limits_of_one
    for module in (sys.modules[law.__module__] for law in RATES.values())
    if hasattr(module, "limits_of_one")
}
carry_row = choice(kernels_of(WIDE, "step"), absent.no_row)
carry_moving = choice(kernels_of(MOVERS, "step"), absent.no_motion)
carry_plain = choice(kernels_of(PLAIN, "step"), absent.no_torque)
look_ahead = choice(kernels_of(FOLLOWERS, "ahead"), absent.nothing_ahead)
weight = choice(kernels_of(FOLLOWERS, "weight"), absent.no_weight)
follow = choice(kernels_of(FOLLOWERS, "follow"), absent.no_state)
torque_of_states = choice(kernels_of(FOLLOWERS, "torque"), absent.no_torque_of_states)


@jit
def backward(rate: int, p: Array, place: int, v: float, load: Pair, temp: float):
    """Rate law of the numbers behind p[place]: (lo, hi, viscous)."""
    return curve(rate, (p[place:], v, load, temp))


@ladder
@by_python
def limits(rate: int, p: Array, v: float, load: Pair, temp: float):
    """Rate law at velocity v under a load: (lo, hi, viscous)."""
    return limits_of(rate, False, p, v, load, temp)


@ladder
def limits_of(rate: int, plain: bool, p: Array, v: float, load: Pair, temp: float):
    """Rate law at velocity v under a load: (lo, hi, viscous); `plain`: it neither grows with the load nor differs by direction."""
    lo, hi, viscous = curve(rate, (p, v, load, temp))
    if MARKED and not plain:
        m = int(p[0])
        if p[0] > m:
            more = p[0] - m
            if more != growth.MARK:
                place = m // 2 if more < growth.MARK else (m - growth.ROW) // 2
                lo, _, viscous_backward = backward(rate, p, place, v, load, temp)
                if v < 0.0:
                    viscous = viscous_backward
            if more >= growth.MARK:
                lo, hi = growth.grow_bounds(p, m + 1 - growth.ROW, v, load, lo, hi, viscous)
    return lo, hi, viscous


@ladder
def step(rate: int, element: int, p: Array, x: Array, dp: float, dt: float, load: Pair, temp: float):
    """Friction torque of one tick; `x` is advanced in place."""
    if abs(dp) >= FASTEST * dt:
        dp = slow(dp / dt) * dt
    v = dp / dt  # not computed for curves that see the motion of the slider alone
    return step_at(rate, element, False, p, x, x, v, dp, dt, load, temp)


@leaf
def begin(p: Array):
    """Return where the element's row begins. The mask tells the compiler that the index is not negative."""
    return 1 + (int(p[0]) & MOST)


@leaf
def slow(v: float):
    """Velocity v, at most FASTEST."""
    return (FASTEST if v > 0.0 else -FASTEST) if abs(v) > FASTEST else v


@leaf
def within(v: float, dp: float, dt: float):
    """Increment dp, or that of the largest velocity."""
    return v * dt if abs(v) >= FASTEST else dp


@ladder
def step_at(  # noqa: PLR0913  (a kernel's row)
    rate: int, element: int, plain: bool, p: Array, x: Array, y: Array, v: float, dp: float, dt: float, load: Pair, temp: float,
):  # fmt: skip
    """Friction torque of one tick from the state row x to y at a velocity v = dp/dt that is at most FASTEST."""
    e = begin(p)
    if ROWS and ROWS >> element & 1:
        lo, hi, viscous = bounds(rate, element, plain, p, v, load, temp)
        f = carry_row(element, (p, e, x, y, lo, hi, dp, dt)) + viscous
    else:
        y[0], f = step_one(rate, element, plain, p, e, x[0], v, dp, dt, load, temp)
    return f


@ladder
def step_one(  # noqa: PLR0913  (a kernel's row)
    rate: int, element: int, plain: bool, p: Array, e: int, z: float, v: float, dp: float, dt: float, load: Pair, temp: float,
):  # fmt: skip
    """State and friction torque after one tick of an element whose state is one number z; its row begins at p[e]."""
    lo, hi, viscous = bounds(rate, element, plain, p, v, load, temp)
    if MOVES and MOVES >> element & 1:
        z, f, moved = carry_moving(element, (p, e, z, lo, hi, dp, dt))
        viscous = limits_of(rate, plain, p, moved / dt, load, temp)[2]
    else:
        z, f = carry_plain(element, (p, e, z, lo, hi, dp, dt))
    return z, f + viscous


@ladder
def bounds(rate: int, element: int, plain: bool, p: Array, v: float, load: Pair, temp: float):
    """Bounds of an element at velocity v, and the viscous part. A viscous part that would drive narrows the bounds instead."""
    lo, hi, viscous = limits_of(rate, plain, p, v, load, temp)
    if DRIVES and DRIVES >> rate & 1 and not (MOVES | HOLDS) >> element & 1 and viscous * v < 0.0:
        weaker = min(abs(viscous), hi if v > 0.0 else -lo)
        if v > 0.0:
            hi -= weaker
            viscous += weaker
        else:
            lo += weaker
            viscous -= weaker
    return lo, hi, viscous


@jit
def solve(
    rate: int, element: int, p: Array, x: Array, v_free: float, dt: float, dt_over_m: float, load: Pair, temp: float,
):  # fmt: skip
    """Velocity of a mass after a step, implicit in the friction; `x` is not changed.

    It solves v + dt/m friction(v dt) = v_free, where v_free is the velocity after a step without friction. For set-valued
    friction, v + dt/m (gsgn(lo, v, hi) + viscous(v)) contains v_free. If friction jumps at rest (a slipping element of GMS, a
    bristle of the reset integrator after break-away), v may lie next to the jump. Call `step` with v dt to advance the state.
    """
    return _balance(rate, element, p, x, v_free, dt, dt_over_m, load, temp)[0]


@leaf
def solve_step(
    rate: int, element: int, p: Array, x: Array, v_free: float, dt: float, dt_over_m: float, load: Pair, temp: float,
):  # fmt: skip
    """Velocity that `solve` finds; the state is advanced in place, as `step` does with v dt."""
    v, tried, z = _balance(rate, element, p, x, v_free, dt, dt_over_m, load, temp)
    if HOLDS and HOLDS >> element & 1:
        return v
    if not (tried and v * dt / dt == v):
        step(rate, element, p, x, v * dt, dt, load, temp)
    elif ROWS and ROWS >> element & 1:  # the last trial was this step
        for i in range(x.size // 2):
            x[i] = x[x.size // 2 + i]
    else:
        x[0] = z
    return v


@leaf
def _balance(  # noqa: PLR0912  (a kernel calls little; its row)
    rate: int, element: int, p: Array, x: Array, v_free: float, dt: float, dt_over_m: float, load: Pair, temp: float,
) -> tuple[float, bool, float]:  # fmt: skip
    """Velocity that `solve` finds, whether the last trial was at it, and the state after that trial where that is a number."""
    if HOLDS and HOLDS >> element & 1:
        lo, hi, _ = limits(rate, p, 0.0, load, temp)
        if dt_over_m * lo <= v_free <= dt_over_m * hi:
            return 0.0, False, 0.0
    toward, close = 1.0, 0.0  # at rest any direction serves; a fixed one does not wait for v_free
    if HOLDS and HOLDS >> element & 1 and not v_free > 0.0:
        toward = -1.0
    free, pull = toward * v_free, toward * dt_over_m
    # a: a speed at which friction is too weak; b: a speed at which it is too strong, infinite until one is known
    a, excess_a, b, excess_b = 0.0, 0.0, np.inf, np.inf
    speed, growth_of_b, side = 0.0, 2.0, 0
    for k in range(-1, 3 * STEPS):
        friction, z = _friction_at(rate, element, p, x, speed, toward, dt, load, temp)
        excess = (speed - free) + pull * friction
        if k < 0:  # at rest: the direction of motion, and a first speed
            if excess == 0.0 or not np.isfinite(excess):
                return 0.0 if excess == 0.0 else np.nan, False, 0.0
            if excess > 0.0:
                toward, free, pull = -toward, -free, -pull
            speed = abs(excess)
            excess_a, close = -speed, CLOSE * (abs(v_free) + speed)
            continue
        if abs(excess) <= close:
            return toward * speed, True, z
        if excess > 0.0:
            if side > 0:
                excess_a *= remainder(excess, excess_b)
            b, excess_b = speed, excess
            side = 1
        else:
            if side < 0:
                excess_b *= remainder(excess, excess_a)
            a, excess_a = speed, excess
            if b == np.inf:
                speed -= growth_of_b * excess
                growth_of_b *= 2.0
                if k < STEPS:
                    continue
            side = -1
        # regula falsi, exact for a straight line, with less of the residual at an end that stays (`remainder`); then bisection
        speed = b - excess_b * (b - a) / (excess_b - excess_a) if k < 2 * STEPS else 0.5 * (a + b)
        if not a < speed < b:
            break
    return toward * (b - excess_b * (b - a) / (excess_b - excess_a)), False, 0.0


@leaf
def remainder(after: float, before: float):
    """Share of the residual that counts at an end of a bracket that stays (N. Anderson, A. Bjorck, BIT 13, 1973)."""
    share = 1.0 - after / before  # of the residuals at the other end
    return share if share > 0.0 else 0.5


@ladder
def _friction_at(
    rate: int, element: int, p: Array, x: Array, speed: float, toward: float, dt: float, load: Pair, temp: float,
):  # fmt: skip
    """Friction at a trial speed in a direction, and the state after it; a row stands in `x`."""
    z, v = 0.0, slow(toward * speed)
    if HOLDS and HOLDS >> element & 1:
        lo, hi, viscous = limits(rate, p, toward * speed, load, temp)
        friction = (hi if toward > 0.0 else lo) + viscous
    elif ROWS and ROWS >> element & 1:
        friction = step_at(rate, element, False, p, x, x[x.size // 2 :], v, v * dt, dt, load, temp)
    else:
        z, friction = step_one(rate, element, False, p, begin(p), x[0], v, v * dt, dt, load, temp)
    return friction, z


@jit
def steady(rate: int, p: Array, v: Array, load: Array, temp: Array, out: Array):
    """Fill `out` with the steady friction torque at the velocities `v` (n,), under loads (n, 2) or (1, 2); 0 at v = 0."""
    loads, temps = load.shape[0] > 1, temp.size > 1
    for i in range(v.size):
        j = i if loads else 0
        lo, hi, viscous = limits(rate, p, v[i], (load[j, 0], load[j, 1]), temp[i if temps else 0])
        out[i] = none.step(p, 0, 0.0, lo, hi, v[i], 1.0)[1] + viscous


@cache
def steady_of(rate: int, plain: bool = False) -> Callable[..., Any]:
    """Return the steady friction torque of a rate law at one velocity, without a load and at 20 degC: f(p, v)."""
    steady = of_kinds(steady_at, rate, plain=plain)

    def at(p: Array, v: float):
        return steady(rate, p, v)

    return specialise(at, rate, int(plain))


@jit
def steady_at(rate: int, p: Array, v: float):
    """Return the steady friction torque at one velocity, without a load and at 20 degC."""
    lo, hi, viscous = limits(rate, p, v, (0.0, 0.0), REFERENCE)
    return none.step(p, 0, 0.0, lo, hi, v, 1.0)[1] + viscous


def plain(rows: np.ndarray) -> bool:
    """Return whether no law of these rows (L, P) grows with the load or differs by direction."""
    return bool((rows[:, 0] == np.floor(rows[:, 0])).all())


def parts(rates: Iterable[int], elements: Iterable[int] = (), plain: bool = False) -> dict[Any, Any]:
    """Return the replacements by which `assemble` fits a kernel to these kinds of rate laws and elements.

    Args:
        rates: kinds.
        elements: kinds.
        plain: no law grows with the load or differs by direction.
    """
    laws, which = (sorted({int(kind) for kind in kinds}) for kinds in (rates, elements))
    sets = [("ROWS", ROWS, which), ("MOVES", MOVES, which), ("HOLDS", HOLDS, which), ("DRIVES", DRIVES, laws)]
    result: dict[Any, Any] = {curve: tuple(laws)}
    if which:
        steps = carry_row, carry_moving, carry_plain
        result |= {kernel: tuple(which) for kernel in (*steps, look_ahead, weight, follow, torque_of_states)}
    for name, kinds, among_them in sets:
        inside = {kinds >> kind & 1 for kind in among_them}
        if len(inside) == 1:  # all bits or none, so that no kind has to be looked up
            result[__name__, name] = -inside.pop()
    if plain:
        result[__name__, "MARKED"] = False
    return result


def of_kinds(
    kernel: F, rates: int | Iterable[int], elements: int | Iterable[int] = (), plain: bool = False
) -> F:
    """Return a kernel with the same arguments for these laws only, which compiles and runs faster.

    It evaluates them at one velocity at a time.

    Args:
        kernel: a kernel of this module, or one that calls such kernels.
        rates: kind of the rate law, or of several.
        elements: kind of the element, or of several; none for a kernel that needs none.
        plain: no law grows with the load or differs by direction.
    """
    sets = ([kinds] if isinstance(kinds, int) else kinds for kinds in (rates, elements))
    return _of_kinds(kernel, *(tuple(sorted({int(kind) for kind in kinds})) for kinds in sets), plain)


@cache
def _of_kinds(kernel: Any, rates: tuple[int, ...], elements: tuple[int, ...], plain: bool) -> Any:
    return assemble(kernel, parts(rates, elements, plain) | ONE_AT_A_TIME | {decay: decay_of_one})
