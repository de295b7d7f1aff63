"""Names and units of the numbers in a law's row, for comments in C."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.laws import Law
from backdrive.laws.pages import unit

PARTS = ("rate", "element", "growth")
SMALL = 1e-3  # by which a parameter is changed, relative to it


def law_labels(law: Law) -> tuple[str, ...]:
    """Return the name, symbol and unit of each number in a law's row; empty for what is made of several.

    A number belongs to the parameter that changes it: what a row holds is known to the law alone.
    """
    row = law.row()
    labels: list[list[str]] = [[] for _ in row]
    for place in PARTS:
        part = getattr(law, place, None)
        if part is None:
            continue
        for name, parameter in part.PARAMETERS.items():
            for item in range(len(getattr(part, name))) if parameter.many else (None,):
                text = f"{name} {parameter.symbol}" + ("" if item is None else f", {item + 1}")
                for i in dependents(law, place, name, item):
                    labels[i].append(f"{text} [{unit(parameter).removesuffix(', each')}]")
    texts = [each[0] if len(each) == 1 else "" for each in labels]
    return ("numbers of the rate law", *texts[1:])


def dependents(law: Law, place: str, name: str, item: int | None) -> list[int]:
    """Return which numbers of a row follow a parameter, or one item of it; none where it cannot be changed alone."""
    row, part = law.row(), getattr(law, place)
    value = getattr(part, name)
    for factor in (1.0 + SMALL, 1.0 - SMALL):
        if item is None:
            moved = value * factor or SMALL
        else:
            moved = (*value[:item], value[item] * factor or SMALL, *value[item + 1 :])
        try:
            other = replace(law, **{place: replace(part, **{name: moved})}).row()
        except InvalidInput:
            continue
        if other.size == row.size:
            return np.flatnonzero(other != row).tolist()
    return []
