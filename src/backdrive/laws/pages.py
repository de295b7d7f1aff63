"""The documentation of a law, generated from the law: equation, parameters, claims and partners, as text.

The docstring of a law's file is the only place where its equation is explained. This module parses it for the docs and for
`backdrive laws`.
"""

from __future__ import annotations

import inspect
import re
import sys
from dataclasses import dataclass

import numpy as np

from backdrive._catalog import lookup
from backdrive.errors import InvalidInput
from backdrive.laws import ELEMENTS, FORMER, RATES, Law, examples, rate_law
from backdrive.laws.base import Element, Parameter, Rate, Rows
from backdrive.laws.direction import BEHIND, ByDirection

Kind = type[Rate] | type[Element]

_UNIT = re.compile(r"\s*\[[^\]]*\]")
_SHAPE = re.compile(r",\s*\([^)]*\)(?=\.?$)")


@dataclass(frozen=True, kw_only=True)
class Entry:
    """One line of a parameter table, as text.

    Attributes:
        name: argument of the class.
        symbol: as in the paper.
        meaning: description in the class; empty if the name is sufficient.
        unit: of a rotary joint, and of a linear one where that differs.
        bounds: smallest and largest admissible value.
        typical: a published value, or empty.
        source: of that value, or empty.
    """

    name: str
    symbol: str
    meaning: str
    unit: str
    bounds: str
    typical: str
    source: str


def find(name: str) -> Kind:
    """Return the class of a rate law or an element; the error for an unknown name lists similar ones."""
    return (
        rate_law(name)
        if name.endswith(BEHIND)
        else lookup(FORMER.get(name, name), {**RATES, **ELEMENTS}, "rate law or presliding element")
    )


def summary(kind: Kind) -> str:
    """Return a one-sentence summary of a law."""
    return (inspect.getdoc(kind) or "").split("\n\n")[0].replace("\n", " ")


def is_shared(kind: Kind) -> bool:
    """Whether several laws share the file, and so the equation, of this one."""
    return sum(c.__module__ == kind.__module__ for c in (*RATES.values(), *ELEMENTS.values())) > 1


def paragraphs(kind: Kind) -> list[tuple[str, bool]]:
    """Return the docstring of a law's file by paragraphs, each with whether it is an equation."""
    files = [kind.ONE, kind] if issubclass(kind, ByDirection) else [kind]
    text = "\n\n".join(inspect.cleandoc(sys.modules[one.__module__].__doc__ or "") for one in files)
    parts = [part for part in re.split(r"\n\s*\n", text) if part.strip()]
    return [
        (inspect.cleandoc(part), True)
        if all(line.startswith("    ") for line in part.splitlines())
        else (part, False)
        for part in parts
    ]


def equation(kind: Kind) -> str:
    """Return the equation of a law, as it is printed in its file."""
    return "\n\n".join(part for part, displayed in paragraphs(kind) if displayed)


def entries(kind: Kind) -> list[Entry]:
    """Return the parameter table of a law."""
    said = _meanings(kind)
    return [
        Entry(
            name=name,
            symbol=parameter.symbol,
            meaning=_meaning(said.get(name, ""), parameter.symbol),
            unit=unit(parameter),
            bounds=bounds(parameter),
            typical=_number(parameter.typical),
            source=parameter.source,
        )
        for name, parameter in kind.PARAMETERS.items()
    ]


def unit(parameter: Parameter) -> str:
    """Return a parameter's unit for a rotary joint, and for a linear one where that differs."""
    units = [parameter.unit_for(joint) for joint in ("rad", "m")]
    units = [{"1": "-", "1/N.m": "1/(N.m)"}.get(u, u) for u in dict.fromkeys(units)]
    return " or ".join(units) + (", each" if parameter.many else "")


def bounds(parameter: Parameter) -> str:
    """Return a parameter's bounds in words."""
    low, high = parameter.lower, parameter.upper
    if np.isfinite(low) and np.isfinite(high):
        return f"{_number(low)} to {_number(high)}"
    if np.isfinite(low):
        return f">= {_number(low)}"
    return f"<= {_number(high)}" if np.isfinite(high) else "free"


def _number(value: float | tuple[float, ...] | None) -> str:
    """Return numbers to four digits, with short exponents: 1e6 and 1e-9 instead of 1e+06 and 1e-09."""
    if value is None:
        return ""
    shown = (f"{x:.4g}" for x in (value if isinstance(value, tuple) else (value,)))
    return ", ".join(re.sub(r"e\+?(-?)0?(?=\d)", r"e\1", x) for x in shown)


def _meanings(kind: type[Rows]) -> dict[str, str]:
    """Return the descriptions of attributes in a class and its base classes, by name."""
    said: dict[str, str] = {}
    for ancestor in reversed(kind.__mro__):
        name = None
        for line in (
            inspect.cleandoc(ancestor.__dict__.get("__doc__") or "").partition("Attributes:")[2].splitlines()
        ):
            match = re.match(r" {4}(\w+): (.*)", line)
            if match:
                name = match[1]
                said[name] = match[2]
            elif name and line.strip():
                said[name] += f" {line.strip()}"
    return said


def _meaning(said: str, symbol: str) -> str:
    """Strip the unit, the shape and a leading symbol, which stand in columns of their own."""
    text = _SHAPE.sub("", _UNIT.sub("", said)).strip().rstrip(".")
    return text.removeprefix(symbol).lstrip(", ") if re.match(rf"{re.escape(symbol)}(,|$)", text) else text


def partners(kind: Kind) -> tuple[list[str], str]:
    """Return the names of possible partners of a law, and the reason that excludes others (empty if none is excluded)."""
    good: list[str] = []
    reason = ""
    others = examples.ELEMENT_EXAMPLES if issubclass(kind, Rate) else examples.RATE_EXAMPLES
    for name, other in others.items():
        own = kind(**kind.EXAMPLE)
        rate, element = (own, other) if issubclass(kind, Rate) else (other, own)
        try:
            Law(rate=rate, element=element)  # pyright: ignore[reportArgumentType]
        except InvalidInput as error:
            reason = error.message.partition(": ")[2]
        else:
            good.append(name)
    return good, reason


def facts(kind: Kind) -> list[str]:
    """Return sentences on the behaviour of a law, first those that the tests verify."""
    said = list(kind.CLAIMS)
    if issubclass(kind, Rate):
        if kind.SMOOTH:
            said.append("It is continuous and zero at rest: it cannot hold the joint permanently.")
        said.append(
            "Friction is equal in both directions."
            if kind.SYMMETRIC
            else "Friction may differ between the two directions."
        )
        if kind.NEEDS:
            said.append(f"Besides the velocity it needs: {', '.join(kind.NEEDS)}.")
        return said
    if kind.STEADY and not kind.SET_VALUED and not any("drift" in claim for claim in said):
        said.append(f"Vibration below break-away {'drifts' if kind.DRIFTS else 'does not drift'}.")
    if kind.STEADY:
        said.append("At constant velocity the torque converges to that of the rate law.")
    said.append(
        f"The viscous part of the rate law uses the velocity of the {'slider' if kind.SLIDER else 'joint'}."
    )
    if kind.SET_VALUED:
        said.append(
            "At rest the torque balances all others: `step` returns 0 there, and `solve` holds the joint."
        )
    return said
