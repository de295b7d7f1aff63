"""Directions that are equal: one number with the larger error stands for both."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

ALIKE = "both directions alike"
EQUAL = 1e-9  # largest relative difference of directions that count as equal [-]


def twins(rate: Any) -> dict[str, str]:
    """Return the parameters along +q that equal those along -q: name -> name.

    Args:
        rate: a rate law.
    """
    pairs = {n: n.replace("positive", "negative") for n in rate.PARAMETERS if "positive" in n}
    return {
        one: other
        for one, other in pairs.items()
        if other in rate.PARAMETERS
        and np.allclose(getattr(rate, one), getattr(rate, other), rtol=EQUAL, atol=0.0)
    }


def is_alike(rate: Any) -> bool:
    """Return whether a rate law with parameters for each direction has the same in both."""
    return (
        rate is not None
        and bool(twins(rate))
        and len(twins(rate)) == sum("positive" in n for n in rate.PARAMETERS)
    )


def both_ways(pairs: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return one magnitude with the larger error where both directions are equal; otherwise the pairs as they are.

    Args:
        pairs: friction and standard error of each direction [N.m or N]; an unknown error (NaN) stays unknown.
    """
    if len(pairs) == 2 and np.isclose(abs(pairs[0][0]), abs(pairs[1][0]), rtol=EQUAL, atol=0.0):
        return [(abs(pairs[0][0]), float(np.max([error for _, error in pairs])))]
    return list(pairs)


def larger(one: Any, other: Any) -> Any:
    """Return the larger of two standard errors, one number or one a knot; None where one is not recorded."""
    if one is None or other is None:
        return None
    error = np.maximum(one, other)
    return tuple(error.tolist()) if error.ndim else float(error)
