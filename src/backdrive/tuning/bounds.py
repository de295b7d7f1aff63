"""Within what every number has to lie that is known of a joint or asked for, and the refusal that names the one that does not."""

from __future__ import annotations

from collections.abc import Sequence

from backdrive.errors import InvalidInput
from backdrive.parameters import NOT_NEGATIVE, POSITIVE, Bound, fault

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


def check(where: str, **values: float | Sequence[float] | None) -> None:
    """Refuse numbers out of their bounds, each by its name and with its rule.

    Args:
        where: what the message begins with.
        values: numbers or intervals, by the names of `BOUNDS`; None: not given.

    Raises:
        InvalidInput: one or more are out of their bounds.
    """
    wrong = [
        words
        for name, value in values.items()
        if value is not None and (words := fault(name, value, BOUNDS[name]))
    ]
    if wrong:
        raise InvalidInput(f"{where}: {'; '.join(wrong)}.", remedy="Numbers are in SI units of the joint.")
