"""The parameters of a joint's law, ready for a table."""

from __future__ import annotations

import math
from typing import NamedTuple

from backdrive.model import JointFriction
from backdrive.report.alike import ALIKE, larger, twins
from backdrive.report.words import number, term, with_error

FREE = "free"  # a parameter without bounds
TINY, HUGE = 1e-9, 1e6  # bounds of a search that restrict no joint


def bounds(lower: float, upper: float, *, whole: bool = False) -> str:
    """Return a parameter's range in words.

    Args:
        lower: smallest admissible value.
        upper: largest one.
        whole: keep also bounds that only keep a search from zero and infinity.
    """
    if not whole:
        lower, upper = -math.inf if lower <= -HUGE else lower, math.inf if upper >= HUGE else upper
        if 0.0 < lower <= TINY and upper == math.inf:
            return "> 0"
    if math.isfinite(lower) and math.isfinite(upper):
        return f"{number(lower)} … {number(upper)}"
    if math.isfinite(lower):
        return f"≥ {number(lower)}"
    return f"≤ {number(upper)}" if math.isfinite(upper) else FREE


class Entry(NamedTuple):
    """A parameter of a law, ready for a table.

    Attributes:
        name: in words.
        symbol: of the papers.
        unit: SI, as a model file writes it.
        bounds: its range in words.
        at_bound: the estimate lies at one of them.
        values: with their standard errors; one, or one a knot.
        both: it holds for both directions, which are equal.
    """

    name: str
    symbol: str
    unit: str
    bounds: str
    at_bound: bool
    values: list[str]
    both: bool = False


def entries(friction: JointFriction, *, knots: bool) -> list[Entry]:
    """Return the parameters of a joint's law: those that are one number, or those with one a knot.

    Directions that are equal are one entry, with the larger error.
    """
    result = []
    for part in friction.law.parts:
        equal = twins(part)
        for name, parameter in part.PARAMETERS.items():
            if parameter.many != knots or name in equal.values():
                continue
            value, error = getattr(part, name), friction.standard_errors.get(name)
            words, mark, names = term(name), parameter.symbol, {name}
            if friction.method == "ramp":  # it ends where the joint begins to slip
                words = words.replace("Coulomb friction", "onset of slip")
            if name in equal:
                other = equal[name]
                error = larger(error, friction.standard_errors.get(other))
                words = f"{words.removesuffix('along +q').strip() or 'friction'}, {ALIKE}"
                mark, names = f"{mark} = {part.PARAMETERS[other].symbol}", {name, other}
            at_bound = not names.isdisjoint(friction.at_bound)
            values = value if knots else (value,)
            given = error if isinstance(error, (list, tuple)) else (None if knots else error,)
            errors = [*given, *[None] * len(values)]
            result.append(
                Entry(
                    name=words,
                    symbol=mark,
                    unit=parameter.unit_for(friction.joint.unit),
                    bounds=bounds(parameter.lower, parameter.upper, whole=at_bound),
                    at_bound=at_bound,
                    values=[with_error(*pair) for pair in zip(values, errors, strict=False)],
                    both=name in equal,
                )
            )
    return result
