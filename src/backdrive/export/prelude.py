"""The first part of every header: errors for compiler options that change results, and small functions."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from backdrive.export.function import Function
from backdrive.export.program import Program
from backdrive.export.values import LONG, WIDE, number

GUARD = """\
#if defined(__FAST_MATH__) || defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__ || defined(_M_FP_FAST)
#error "-ffast-math changes what these functions compute and drops their tests for NaN: compile without it"
#endif
#if defined(__cplusplus) && __cplusplus < 201703L && !defined(_MSC_VER)
#error "hexadecimal numbers need C99 or C++17"
#endif
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif
"""

INLINE = """\
/* What runs every tick is written out wherever it is called for speed; what is rare is there once for size. */
#if defined(__GNUC__) && defined(__OPTIMIZE_SIZE__)
#define {P}_INLINE static inline
#define {P}_APART static __attribute__((noinline, unused))
#elif defined(__GNUC__) && defined(__OPTIMIZE__)
#define {P}_INLINE static inline __attribute__((always_inline))
#define {P}_APART static inline
#else
#define {P}_INLINE static inline
#define {P}_APART static inline
#endif
"""

INCLUDES = "#include <math.h>\n#include <stdint.h>\n#include <string.h>\n"

HELPERS = {
    "least": "static inline {real} {p}_least({real} a, {real} b) {{ return b < a ? b : a; }}",
    "most": "static inline {real} {p}_most({real} a, {real} b) {{ return b > a ? b : a; }}",
    "least_wide": "static inline double {p}_least_wide(double a, double b) {{ return b < a ? b : a; }}",
    "most_wide": "static inline double {p}_most_wide(double a, double b) {{ return b > a ? b : a; }}",
    "to_bits": (
        "static inline int64_t {p}_to_bits(double x) {{\n  int64_t bits;"
        "\n  memcpy(&bits, &x, sizeof bits);\n  return bits;\n}}"
    ),
    "from_bits": (
        "static inline double {p}_from_bits(int64_t bits) {{\n  double x;"
        "\n  memcpy(&x, &bits, sizeof x);\n  return x;\n}}"
    ),
    "power_of_two": (
        "/* 2^k from k + 1.5 * 2^52. */\n"
        "static inline double {p}_power_of_two(double wide) {{\n  double x;\n  uint64_t bits;"
        "\n  memcpy(&bits, &wide, sizeof bits);\n  bits = (bits << 52) + UINT64_C(0x3ff0000000000000);"
        "\n  memcpy(&x, &bits, sizeof x);\n  return x;\n}}"
    ),
    "sinf_wide": (
        "static inline float {p}_sinf_wide(double x) {{\n"
        "  return sinf((float)(x - 0x1.921fb54442d18p+2 * floor(x * 0x1.45f306dc9c883p-3)));\n}}"
    ),
    "cosf_wide": (
        "static inline float {p}_cosf_wide(double x) {{\n"
        "  return cosf((float)(x - 0x1.921fb54442d18p+2 * floor(x * 0x1.45f306dc9c883p-3)));\n}}"
    ),
    "finite_wide": (
        "/* Whether a number is finite, from its bits: no optimisation takes this away. */\n"
        "static inline int {p}_finite_wide(double x) {{\n  uint64_t bits;\n  memcpy(&bits, &x, sizeof bits);\n"
        "  return (bits & UINT64_C(0x7ff0000000000000)) != UINT64_C(0x7ff0000000000000);\n}}"
    ),
    "finite": (
        "/* Whether a number is finite, from its bits: no optimisation takes this away. */\n"
        "static inline int {p}_finite({real} x) {{\n  {bits} bits;\n  memcpy(&bits, &x, sizeof bits);\n"
        "  return (bits & {mask}) != {mask};\n}}"
    ),
}


def helpers(program: Program, functions: Iterable[Function], more: Iterable[str] = ()) -> str:
    """Return the small functions that some functions need."""
    needed = set(more).union(*(f.helpers for f in functions))
    single = program.spelling.single
    mask = "UINT32_C(0x7f800000)" if single else "UINT64_C(0x7ff0000000000000)"
    words = {
        "p": program.prefix,
        "real": "float" if single else "double",
        "bits": "uint32_t" if single else "uint64_t",
        "mask": mask,
    }
    return "\n\n".join(HELPERS[name].format(**words) for name in HELPERS if name in needed)


def table(
    name: str, numbers: np.ndarray, kind: str = WIDE, single: bool = False, comments: tuple[str, ...] = ()
) -> str:
    """Return numbers as a constant array in C.

    Args:
        name: of the array.
        numbers: (n,) or (n, m).
        kind: of its elements.
        single: reals are floats.
        comments: of the numbers, as far as they go.
    """
    if numbers.dtype.kind == "i":
        kind = LONG
    type_ = "int64_t" if kind == LONG else "double" if kind == WIDE or not single else "float"
    if numbers.ndim == 2:
        rows = ",\n".join("  {" + ", ".join(number(x, kind, single) for x in row) + "}" for row in numbers)
        return f"static const {type_} {name}[{numbers.shape[0]}][{numbers.shape[1]}] = {{\n{rows}\n}};"
    cells = [number(x, kind, single) for x in numbers]
    lines = []
    for i, cell in enumerate(cells):
        comment = f" /* {comments[i]} */" if i < len(comments) and comments[i] else ""
        lines.append(f"  {cell}{',' if i + 1 < len(cells) else ''}{comment}")
    return f"static const {type_} {name}[{len(cells)}] = {{\n" + "\n".join(lines) + "\n};"


def tables(program: Program, functions: Iterable[Function]) -> str:
    """Return the tables of numbers that some functions read."""
    needed = set().union(*(f.tables for f in functions))
    return "\n\n".join(table(name, program.tables[name]) for name in sorted(needed))
