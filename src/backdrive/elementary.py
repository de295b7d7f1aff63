"""Elementary functions of kernels: exp, pow, log, tanh, sin and cos with the same bits in plain Python and compiled.

The functions of C libraries differ in their last bit between machines, and from those of numba; a law that calls them would
differ too. The functions here use plain arithmetic on doubles, rounded operation by operation. So every compiler without
contraction gives the same bits, C included. Where the true value is a normal number, `decay` is within 0.9 units in its last
place, each other within 0.54: sin and cos up to 1e6 rad.

`decay`, which most laws call, needs no table, for reading one keeps compilers from several numbers at once. The others read
one of 128 powers or logarithms (`elementary_tables`), after P. T. P. Tang (ACM TOMS 15(2), 1989, and 16(4), 1990); sums of
two doubles follow T. J. Dekker (Numer. Math. 18, 1971). Series are Taylor's but for that of `decay`.
"""

from __future__ import annotations

from collections.abc import Callable
from math import factorial, inf, nan
from typing import Any

import numpy as np

from backdrive._jit import COMPILED, from_bits, leaf, to_bits
from backdrive._jit_memory import in_memory
from backdrive.elementary_tables import BITS, LACK, ONE, N, double, half_pi, logarithms, parts, powers

LARGEST = 709.782712893384  # exp of more is infinite
SMALLEST = -708.0  # and of less 0: results below 2e-308 are no normal numbers
FAR = -709.0  # exponent in its place: 2^k of it is 0
MOST = 2.0**50  # angle beyond which sin and cos are NaN; beyond 1e6 they are as exact as the angle is [rad]
NEAR = 0.125  # below which tanh is its series
MAGIC_BITS = 0x4338000000000000  # of MAGIC, 1.5 * 2^52: adding it rounds to an integer
COARSE = 1.5 * 2.0**35  # adding it rounds to 2^-17; square and cube of such a number below 1 are exact
BACK = 2.0**-100  # of a power that is taken 2^100 too large
TINY = 2.2250738585072014e-308  # smallest normal number
SPLIT = 134217729.0  # 2^27 + 1: parts a double into halves of 26 bits
MANTISSA, EXPONENT_OF_1 = (1 << 52) - 1, 1023 << 52
UPPER = 53  # place in the table of logarithms from which on a mantissa counts as half, above sqrt(2)

#: a table as compiled code reads it fastest, or as plain Python does
_table: Callable[..., Any] = np.array if COMPILED else list
LOGARITHMS, LOG_2 = logarithms()
POWERS = _table(powers())
LOGS = _table([[*parts(x - (LOG_2 if j >= UPPER else 0), 41), N / (N + j)] for j, x in enumerate(LOGARITHMS)])
BY_STEP = double((N << 2 * BITS) // LOG_2)
STEP_HIGH, STEP_LOW = parts(LOG_2 // N, 41)  # 17 bits of a count times 34 of the first are exact
# of e^r for |r| <= log(2)/2 behind r^3/6: the largest error is the least (Remez, 1934), 6e-18
SERIES = (
    0.04166666666661246, 0.008333333333391636, 0.0013888888923720985, 0.00019841269643900577,
    2.4801512218295423e-05, 2.7557517548373976e-06, 2.762388064715861e-07, 2.5009202143917747e-08,
)  # fmt: skip
MAGIC, BY_LOG_2, LOG_2_HIGH, LOG_2_LOW, HALF, SIXTH, E4, E5, E6, E7, E8, E9, E10, E11 = in_memory(
    6755399441055744.0, double((1 << 2 * BITS) // LOG_2), *parts(LOG_2, 41), 0.5, 1.0 / 6.0, *SERIES
)
BY_HALF_PI = double((ONE << BITS) // half_pi())
PI_1, PI_2, PI_3, PI_4 = parts(half_pi(), 32, 64, 96)
S3 = -1 / 6
#: of the sine behind r^3, and of the cosine behind r^2
WAVES: list[list[float]] = _table(
    [[(-1) ** (n // 2) / factorial(n) for n in range(first, first + 16, 2)] for first in (5, 4)]
)
T3, T5, T7, T9 = -1 / 3, 2 / 15, -17 / 315, 62 / 2835
T11, T13, T15, T17 = -1382 / 155925, 21844 / 6081075, -929569 / 638512875, 6404582 / 10854718875


@leaf
def product(a: float, b: float):
    """Return a b as a sum of two doubles, the first of them the rounded product."""
    wide = SPLIT * a
    a1 = wide - (wide - a)
    a2 = a - a1
    wide = SPLIT * b
    b1 = wide - (wide - b)
    b2 = b - b1
    p = a * b
    return p, ((a1 * b1 - p) + a1 * b2 + a2 * b1) + a2 * b2


@leaf
def integer_of(wide: float, count: float):
    """Return `count`, a whole number, as an integer; from wide = count + MAGIC, for not all vectors have an instruction for it."""
    return to_bits(wide) - MAGIC_BITS


@leaf
def double_of(whole: int):
    """Return an integer below 2^51 as a double, the same way."""
    return from_bits(whole + MAGIC_BITS) - MAGIC


@leaf
def reduce_exponent(x: float):
    """Return k, the mantissa of a power, what it lacks, and r with exp(x) = 2^floor(k/N) mantissa (1 + lack) e^r."""
    wide = x * BY_STEP + MAGIC
    count = wide - MAGIC
    k = integer_of(wide, count)
    entry = POWERS[k & (N - 1)]
    mantissa, lack = entry & MANTISSA, double_of(entry >> 52) * LACK
    r = (x - count * STEP_HIGH) - count * STEP_LOW
    return k, mantissa, lack, r


@leaf
def beyond_one(lack: float, r: float):
    """Return (1 + lack) e^r - 1 for a small r."""
    square = r * r
    return lack + r + square * (0.5 + r * (1.0 / 6.0)) + square * square * (1.0 / 24.0 + r * (1.0 / 120.0))


@leaf
def exponential(x: float, low: float):
    """Return a scale S and t with exp(x + low) = S (1 + t), and the factor that S still lacks; SMALLEST <= x <= LARGEST."""
    k, mantissa, lack, r = reduce_exponent(x)
    t = beyond_one(lack, r + low)
    exponent = k >> 7
    rest = 1.0
    if exponent > 1023:
        exponent, rest = 1023, 2.0
    elif exponent < -900:  # or S t is no normal number
        exponent, rest = exponent + 100, BACK
    return from_bits(mantissa + ((exponent + 1023) << 52)), t, rest


@leaf
def power_of_two(wide: float):
    """Return 2^k, or 0 for k = -1023, from wide = k + MAGIC, whose last bits are k."""
    return from_bits((to_bits(wide) << 52) + EXPONENT_OF_1)


@leaf
def exp_below(x: float):
    """Return e^x for SMALLEST <= x <= 0, and 0 for FAR."""
    wide = x * BY_LOG_2 + MAGIC
    count = wide - MAGIC
    high, low = x - count * LOG_2_HIGH, count * LOG_2_LOW  # the first exact
    r = high - low
    square = r * r
    even = HALF + square * (E4 + square * (E6 + square * (E8 + square * E10)))
    odd = SIXTH + square * (E5 + square * (E7 + square * (E9 + square * E11)))
    return (1.0 + (high + (square * (even + r * odd) - low))) * power_of_two(wide)


@leaf
def decay(x: float):
    """Return e^x for x <= 0; 0 below -708. Of arithmetic alone, so that a compiler takes several numbers at once."""
    return exp_below(FAR if x < SMALLEST else x)


@leaf
def decay_of_one(x: float):
    """Return `decay` of a single number: where it is 1 or 0, nothing waits for it."""
    return 1.0 if x == 0.0 else 0.0 if x < SMALLEST else exp_below(x)


@leaf
def exp(x: float):
    """Return e^x; 0 below -708."""
    inside = SMALLEST <= x <= LARGEST
    S, t, rest = exponential(x if inside else 0.0, 0.0)
    value = (S + S * t) * rest
    return value if inside else 0.0 if x < SMALLEST else inf if x > LARGEST else nan


@leaf
def logarithm(x: float, halvings: int):
    """Return log(x/2^halvings) as a sum of two doubles, for positive normal x."""
    bits = to_bits(x)
    j = (((bits & MANTISSA) >> 44) + 1) >> 1
    m = from_bits((bits & MANTISSA) | EXPONENT_OF_1)
    k = (bits >> 52) - (1023 - (1 if j >= UPPER else 0)) - halvings
    c = 1.0 + j * (1.0 / N)
    d = m - c  # exact
    row = LOGS[j]
    high, low, by_c = row[0], row[1], row[2]
    q = d * by_c
    whole, part = product(q, c)
    lack = ((d - whole) - part) * by_c  # q + lack = d/c
    begin = k * LOG_2_HIGH + high  # exact
    first = begin + q
    second = (begin - first) + q if begin != 0.0 else 0.0
    square, square_low = product(q, q)
    total = first - 0.5 * square
    second += (first - total) - 0.5 * square
    series = 1.0 / 7.0 + q * (-1.0 / 8.0 + q * (1.0 / 9.0))
    series = 1.0 / 3.0 + q * (-0.25 + q * (0.2 + q * (-1.0 / 6.0 + q * series)))
    second += lack * (1.0 - q) - 0.5 * square_low + (k * LOG_2_LOW + low) + q * square * series
    sum_ = total + second
    return sum_, (total - sum_) + second


@leaf
def normal(x: float):
    """Return x as a normal number and how often it was doubled for that, or 1 where x is not positive and finite."""
    tiny = x < TINY
    y = x * 18014398509481984.0 if tiny else x  # 2^54
    return y if 0.0 < y < inf else 1.0, 54 if tiny else 0


@leaf
def log(x: float):
    """Return the natural logarithm; -inf at 0, NaN below."""
    y, halvings = normal(x)
    value = logarithm(y, halvings)[0]
    return value if 0.0 < x < inf else -inf if x == 0.0 else inf if x == inf else nan


@leaf
def pow(x: float, y: float):
    """Return x^y for x >= 0; NaN for a negative x. Without a branch that does something, for several x in one instruction."""
    base, halvings = normal(x)
    first, second = logarithm(base, halvings)
    wild = not abs(y) * abs(first) <= 800.0 or x == 1.0
    exponent = 0.0 if wild else y
    whole, part = product(exponent, first)
    part += exponent * second
    inside = SMALLEST <= whole <= LARGEST
    S, t, rest = exponential(whole if inside else 0.0, part if inside else 0.0)
    value = (S + S * t) * rest
    if y == 0.0 or x == 1.0:
        return 1.0
    if not (x >= 0.0 and abs(y) <= inf):
        return nan
    if x == 0.0 or x == inf:  # noqa: PLR1714
        return inf if (x > 0.0) == (y > 0.0) else 0.0
    if wild or not inside:
        return inf if (y > 0.0) == (first > 0.0) else 0.0
    return value


@leaf
def tanh(x: float):
    """Return the hyperbolic tangent."""
    size = abs(x)
    if size < NEAR:
        z = x * x
        series = T11 + z * (T13 + z * (T15 + z * T17))
        value = x + x * z * (T3 + z * (T5 + z * (T7 + z * (T9 + z * series))))
        return value if value != 0.0 else x  # -0 stays
    if not size < 22.0:
        return (1.0 if x > 0.0 else -1.0) if size >= 22.0 else nan
    S, t, _ = exponential(-2.0 * size, 0.0)
    high = S + S * t
    low = (S - high) + S * t
    above, below = 1.0 - high, 1.0 + high
    above_low, below_low = ((1.0 - above) - high) - low, ((1.0 - below) + high) + low
    q = above / below
    whole, part = product(q, below)
    value = q + (((above - whole) - part) + above_low - q * below_low) / below
    return value if x > 0.0 else -value


@leaf
def quarter_turns(x: float):
    """Return the number of quarter turns nearest to an angle, and the rest of it as a sum of two doubles."""
    count = (x * BY_HALF_PI + MAGIC) - MAGIC
    r = x - count * PI_1  # exact, as is each product
    w = count * PI_2
    first = r - w
    low = (r - first) - w
    w = count * PI_3
    second = first - w
    low += (first - second) - w
    low -= count * PI_4
    total = second + low
    return int(count), total, (second - total) + low


@leaf
def wave(k: int, r: float, low: float):
    """Return the sine of r + low and k quarter turns, |r| <= pi/4. Without a branch: no processor foretells the quarter."""
    even = k & 1 == 0
    row = WAVES[k & 1]
    z = r * r
    coarse = (r + COARSE) - COARSE
    fine = (r - coarse) + low
    square, more = coarse * coarse, fine * (2.0 * coarse + fine)  # the first exact; (r + low)^2 is their sum
    cube = square * coarse  # exact
    sixth = cube * S3
    lack = ((4.0 * sixth + cube) + 2.0 * sixth) * S3  # of it, the sums exact
    of_sine = lack + (coarse * more + fine * z) * S3
    of_cosine = z * ((square - z) + more) * (1.0 / 12.0) - 0.5 * more
    begin = r if even else 1.0
    second = sixth if even else -0.5 * square
    first = begin + second
    fourth = z * z
    series = (row[2] + z * row[3]) + fourth * ((row[4] + z * row[5]) + fourth * (row[6] + z * row[7]))
    series = row[0] + (z * row[1] + fourth * series)
    rest = ((begin - first) + second) + (low + of_sine if even else of_cosine)
    value = first + (rest + fourth * begin * series)
    return -value if k & 2 else value


@leaf
def sin(x: float):
    """Return the sine of an angle; NaN beyond MOST."""
    if not abs(x) <= MOST:
        return nan
    k, r, low = quarter_turns(x)
    value = wave(k, r, low)
    return value if value != 0.0 else x  # -0 stays


@leaf
def cos(x: float):
    """Return the cosine of an angle; NaN beyond MOST."""
    if not abs(x) <= MOST:
        return nan
    k, r, low = quarter_turns(x)
    return wave(k + 1, r, low)
