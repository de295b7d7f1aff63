"""Exponential, power and sine of jax arrays in doubles, from short chains of operations that jax's compiler can vectorize.

Jax's own exponential is one long chain, and its power is a call for every number. Two exponentials took two thirds of LuGre's
time. Here exp(x) = 2^k e^r with k = round(x/log 2) and |r| <= log(2)/2. The factor is e^r = (R + r)/(R - r), where R = r
coth(r/2) is a series in r^2, evaluated by pairs of its terms (G. Estrin, 1960). The division is the last operation, because a
result that ends with a division is not computed again for each use. log(x) = k log 2 + 2 artanh((m - 1)/(m + 1)) with m within
[sqrt(1/2), sqrt(2)]. The sine is a Taylor series on half a turn.

All errors are a few units in the last place. For exp(x), x <= 0, this place is that of the larger of the result and 1. For a
power it is that of |y log x| times the result, and for a sine that of the angle.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from math import factorial, log, nan, pi
from types import SimpleNamespace
from typing import Any

from backdrive.elementary import MAGIC, MAGIC_BITS

#: Exponents whose powers a compiler of arrays makes of products, quotients and roots.
ROOTS = (-1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 3.0)
EXPONENT, SIGN = 52, 63  # bits behind the exponent and behind the sign of a double
PI_LOW = 1.2246467991473532e-16  # what the double of pi lacks
ROOT_HALF_BITS = 0x3FE6A09E667F3BCD  # sqrt(1/2)
LOG_2 = log(2.0)
MOST = 708.0  # exponents beyond it are cut, so that results lie within 3e-308 and 3e307
#: Of R in r^2; the next term is below 2e-17.
R = [2.0, 1 / 6, -1 / 360, 1 / 15120, -1 / 604800, 1 / 23950080, -691 / 653837184000]
#: Of (sin r)/r in r^2 up to a quarter of a turn; the next term is below 2e-17.
SINE = [(-1) ** n / factorial(2 * n + 1) for n in range(12)]
ARTANH = [2.0 / (2 * n + 1) for n in range(11)]  # of (2/z) artanh(z) in z^2


def polynomial(coefficients: Sequence[float], x: Any) -> Any:
    """Return c_0 + c_1 x + c_2 x^2 ..., by pairs, so that few operations wait for one another."""
    terms: list[Any] = list(coefficients)
    while len(terms) > 1:
        pairs = [terms[i] + terms[i + 1] * x for i in range(0, len(terms) - 1, 2)]
        terms = pairs + terms[len(terms) // 2 * 2 :]
        x = x * x
    return terms[0]


@cache
def of_jax() -> SimpleNamespace:
    """Return `exp`, `power` and `sin` for float64 arrays of jax, with derivatives."""
    import jax
    from jax import lax
    from jax import numpy as jnp

    def bits(x: Any) -> Any:
        return lax.bitcast_convert_type(x, jnp.int64)

    def double(b: Any) -> Any:
        return lax.bitcast_convert_type(b, jnp.float64)

    def natural_log(x: Any) -> Any:
        k = (bits(x) - ROOT_HALF_BITS) >> EXPONENT
        m = double(bits(x) - (k << EXPONENT))
        z = (m - 1.0) / (m + 1.0)
        return (double(k + MAGIC_BITS) - MAGIC) * LOG_2 + z * polynomial(ARTANH, z * z)

    @jax.custom_jvp
    def exp(x: Any) -> Any:
        x = jnp.clip(x, -MOST, MOST)
        k = lax.round(x * (1.0 / LOG_2), lax.RoundingMethod.TO_NEAREST_EVEN)
        r = x - k * LOG_2
        even = polynomial(R, r * r)
        return double(bits(even + r) + (bits(k + MAGIC) << EXPONENT)) / (even - r)

    @exp.defjvp
    def _exp(at: tuple, along: tuple) -> tuple[Any, Any]:
        value = exp(*at)
        return value, value * along[0]

    @jax.custom_jvp
    def power(x: Any, y: Any) -> Any:
        return exp(y * jnp.where(x > 0.0, natural_log(x), nan))

    @power.defjvp
    def _power(at: tuple, along: tuple) -> tuple[Any, Any]:
        (x, y), value = at, power(*at)
        return value, y * power(x, y - 1.0) * along[0] + value * jnp.log(x) * along[1]

    @jax.custom_jvp
    def sin(x: Any) -> Any:
        k = lax.round(x * (1.0 / pi), lax.RoundingMethod.TO_NEAREST_EVEN)
        r = x - k * pi - k * PI_LOW
        return double(bits(r * polynomial(SINE, r * r)) ^ (bits(k + MAGIC) << SIGN))

    @sin.defjvp
    def _sin(at: tuple, along: tuple) -> tuple[Any, Any]:
        return sin(*at), sin(at[0] + 0.5 * pi) * along[0]

    return SimpleNamespace(exp=exp, power=power, sin=sin)


def wide(xp: Any, numbers: Sequence[Any]) -> SimpleNamespace | None:
    """Return the functions here where they are faster than the library's own: for jax arrays in doubles."""
    doubles = all(getattr(n, "dtype", "float64") == "float64" for n in numbers)
    return of_jax() if xp.__name__ == "jax.numpy" and doubles else None


def exponential(xp: Any, x: Any) -> Any:
    """Return e^x of an array."""
    functions = wide(xp, (x,))
    return functions.exp(x) if functions else xp.exp(x)


def power(xp: Any, x: Any, y: Any) -> Any:
    """Return x^y of arrays, or of an array and a number, for x > 0; NaN for x < 0."""
    functions = None if isinstance(y, float) and y in ROOTS else wide(xp, (x, y))
    return functions.power(x, y) if functions else x**y


def sine(xp: Any, x: Any) -> Any:
    """Return the sine of an array of angles."""
    functions = wide(xp, (x,))
    return functions.sin(x) if functions else xp.sin(x)
