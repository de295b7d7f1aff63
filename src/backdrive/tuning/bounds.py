"""Bounds of all numbers of a joint and of all options, with an error that names the number out of bounds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from backdrive.errors import NotIdentifiable
from backdrive.parameters import NOT_NEGATIVE, POSITIVE, Bound, check

BOUNDS = {
    "coulomb": POSITIVE,
    "stiffness": POSITIVE,
    "inertia": POSITIVE,
    "top_speed": POSITIVE,
    "count": POSITIVE,
    "counts": POSITIVE,
    "friction": POSITIVE,
    "damping": POSITIVE,
    "contact": POSITIVE,
    "motor_share": Bound(0.0, 1.0, open_low=True, open_high=True),
    "noise": Bound(0.0, 1e3, "counts", open_high=True),
    "delay": Bound(0.0, 0.1, "s", open_high=True),
    "interval": Bound(1e-5, 0.05, "s"),
    "friction_error": Bound(0.0, 0.8, open_high=True),
    "temperature": Bound(-273.15, 1e3, "degC"),
    "stroke": POSITIVE,
    "trip_speed": POSITIVE,
    "limit": NOT_NEGATIVE,
    "duration": Bound(0.0, 30.0, "s", open_low=True),
    "joints": Bound(8, 2000),
    "seed": Bound(0, 2**53),
}


def check_numbers(where: str, **values: float | Sequence[float] | None) -> None:
    """Refuse numbers out of their bounds; see `parameters.check`.

    Args:
        where: first words of the message.
        values: numbers or intervals, by the names of `BOUNDS`; None: not given.
    """
    check(where, BOUNDS, {name: value for name, value in values.items() if value is not None})


def between(
    given: Any, known: tuple[float, float] | None, error: float, what: str, joint: str, notes: list[str]
) -> tuple[float, tuple[float, float]]:
    """Return a likely value and its interval.

    Args:
        given: from the user: the value, or its two ends; None: as `known`.
        known: from the model, value and standard error; None: it is not there.
        error: default relative error [-].
        what: name of the number.
        joint: name.
        notes: list to which assumptions are added.

    Raises:
        NotIdentifiable: neither the user nor the model gives it.
    """
    if given is None:
        if known is None:
            raise NotIdentifiable(
                f"Joint '{joint}': its {what} is not in the model.", remedy=f"Give --{what} LOW:HIGH."
            )
        value, spread = known
        if np.isfinite(spread) and spread > 0.0:
            half = min(1.96 * spread, 0.9 * value)
            return value, (value - half, value + half)
        given = value
    ends = np.atleast_1d(np.asarray(given, dtype=float))
    if ends.size == 2:
        return float(np.sqrt(abs(ends[0] * ends[1]))), (float(ends[0]), float(ends[1]))
    value = float(ends[0])
    notes.append(
        f"The {what} has no interval: an error of {100 * error:.0f} % is assumed (--{what} LOW:HIGH)."
    )
    return value, ((1.0 - error) * value, (1.0 + error) * value)
