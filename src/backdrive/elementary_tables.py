"""Numbers of the elementary functions, made with integers: powers of two, logarithms and pi in fixed point."""

from __future__ import annotations

from math import isqrt

BITS = 160  # of the integers
ONE, N = 1 << BITS, 128  # one in fixed point; entries of a table
LACK = 2.0**-64  # unit of what a power's double lacks, relative to it: at most 2^-54


def double(x: int, bits: int = BITS) -> float:
    """Return a fixed-point number as the nearest double."""
    return x / (1 << bits)


def parts(x: int, *places: int) -> list[float]:
    """Return a fixed-point number in doubles: each but the last cut at a binary place behind the point."""
    cut = []
    for place in places:
        unit = 1 << (BITS - place)
        whole = (x + unit // 2) // unit
        cut.append(whole / (1 << place))
        x -= whole * unit
    return [*cut, double(x)]


def powers() -> list[int]:
    """Return 2^(j/N) for j = 0 ... N - 1: the mantissa of the nearest double, and above it what that lacks, in LACK of it."""
    root = 2 * ONE
    for _ in range(N.bit_length() - 1):
        root = isqrt(root << BITS)
    table, power = [], ONE
    for _ in range(N):
        high = double(power)
        lack = round(double(((power - int(high * 2.0**BITS)) << BITS) // power) / LACK)
        table.append((lack << 52) + int(high * 2.0**52) - (1 << 52))
        power = power * root >> BITS
    return table


def logarithms() -> tuple[list[int], int]:
    """Return log(1 + j/N) for j = 0 ... N as fixed-point numbers, and log 2, the last of them."""
    table = [0]
    for j in range(N):  # log((N + j + 1)/(N + j)) = 2 artanh(1/(2 (N + j) + 1))
        n = 2 * (N + j) + 1
        term, total, k = 2 * ONE // n, 0, 1
        while term:
            total += term // k
            term //= n * n
            k += 2
        table.append(table[-1] + total)
    return table, table[-1]


def half_pi() -> int:
    """Return pi/2 as a fixed-point number (Machin, 1706)."""
    total = 0
    for factor, n in ((16, 5), (-4, 239)):
        term, k = factor * ONE // n, 1
        while term not in (0, -1):
            total += term // k if k % 4 == 1 else -(term // k)
            term //= n * n
            k += 2
    return total // 2
