"""Numbers that compiled code reads from memory, where it would otherwise make them anew in every round of a loop.

A loop over several numbers per instruction has no room in registers for the coefficients of a polynomial. A compiler that knows
their values then fills a register with each of them in every round. If it does not know them, it fills them once before the loop,
and every multiplication reads its coefficient from there. That matters on processors without AVX-512.
"""

from __future__ import annotations

import hashlib
import struct
from contextlib import suppress
from typing import Any

from backdrive._jit import COMPILED


class Coefficient(float):
    """A number of a table in memory."""

    table: tuple[float, ...]
    place: int


def in_memory(*numbers: float) -> list[float]:
    """Return numbers that compiled code reads from memory; for everything else they are floats.

    Args:
        numbers: what a kernel uses together, for they stand side by side.
    """
    if not _KNOWN:
        return list(numbers)
    result: list[float] = []
    for place, value in enumerate(numbers):
        number = Coefficient(value)
        number.table, number.place = numbers, place
        result.append(number)
    return result


def _teach() -> None:
    """Tell numba what such a number is: a double, loaded from a table that the optimiser takes for one that may change."""
    from llvmlite import ir
    from numba import float64
    from numba.core import types
    from numba.core.imputils import lower_cast, lower_constant
    from numba.core.typeconv.castgraph import Conversion
    from numba.extending import models, register_model, typeof_impl

    class CoefficientType(types.Type):
        def can_convert_to(self, typingctx, other):
            return Conversion.safe if other == float64 else None

    kind = CoefficientType(name="coefficient")

    @register_model(CoefficientType)
    class _(models.PrimitiveModel):
        def __init__(self, dmm, fe_type):
            super().__init__(dmm, fe_type, ir.DoubleType())

    @typeof_impl.register(Coefficient)
    def _(value, context):
        return kind

    @lower_cast(CoefficientType, types.Float)
    def _(context, builder, fromty, toty, value):
        return value

    @lower_constant(CoefficientType)
    def _(context, builder, ty, number):
        table = number.table
        bits = struct.pack(f"<{len(table)}d", *table)
        name = f"backdrive_memory_{hashlib.sha256(bits).hexdigest()[:16]}"
        held: Any = builder.module.globals.get(name)
        if held is None:
            content = ir.ArrayType(ir.DoubleType(), len(table))
            held = ir.GlobalVariable(builder.module, content, name)
            held.linkage = "linkonce_odr"  # seen from other modules, where it might change
            held.initializer = ir.Constant(content, list(table))
        whole = ir.IntType(32)
        return builder.load(builder.gep(held, [whole(0), whole(number.place)], inbounds=True))


_KNOWN = False
if COMPILED:
    with suppress(ImportError, AttributeError, TypeError):  # numba has moved: slower, no less right
        _teach()
        _KNOWN = True
