"""Within what the promises of the torque loop hold. Outside, construction refuses.

| | from | to | |
|---|---|---|---|
| period | 0.05 ms | 20 ms | |
| limit of torque | 0 | 1e5 N.m or N | 0 gives nothing |
| top speed | 1e-3 | 1e3 rad/s or m/s | |
| encoder step | 1e-9 | 0.1 rad or m | at most 0.1 top speed in 10 ms |
| share R | 0 | 1 | times the highest level that is learned |
| stiffness K | 0 | 1e9 N.m/rad or N/m | one encoder step moves the torque by F at most |
| inertia | 1e-7 | 1e5 kg.m^2 or kg | |
| friction F | 0 | 1e5 N.m or N | |
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from backdrive.errors import InvalidInput

Range = tuple[float, float, str]  # least, largest, unit

PERIOD: Range = (5e-5, 2e-2, "s")
LIMIT: Range = (0.0, 1e5, "N.m or N")
TOP_SPEED: Range = (1e-3, 1e3, "rad/s or m/s")
COUNT: Range = (1e-9, 0.1, "rad or m")
SHARE: Range = (0.0, 1.0, "-")
STIFFNESS: Range = (0.0, 1e9, "N.m/rad or N/m")
INERTIA: Range = (1e-7, 1e5, "kg.m^2 or kg")
FRICTION: Range = (0.0, 1e5, "N.m or N")
RAMP: Range = (0.15, 60.0, "s")
HOLD: Range = (0.05, 2.0, "s")
FADE: Range = (10.0, 1e4, "1/s")
PATIENCE: Range = (0.005, 1.0, "s")
COARSEST = 0.1  # speed of one encoder step in the shortest window of speeds, by the top speed [-]


def check(where: str, **values: tuple[float, Range]) -> None:
    """Refuse numbers outside their ranges, each by its name.

    Args:
        where: what the message begins with.
        values: number and range, by name.

    Raises:
        InvalidInput: one or more are outside, or no numbers.
    """
    wrong = [
        f"{name} = {value} has to lie within {low:g} and {high:g} {unit}"
        for name, (value, (low, high, unit)) in values.items()
        if not (_is_number(value) and low <= value <= high)
    ]
    if wrong:
        raise InvalidInput(
            f"{where}: {'; '.join(wrong)}.",
            remedy="Numbers are in SI units of the joint; outside these ranges the loop promises nothing.",
        )


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)


def check_contact(where: str, stiffness: Sequence[float] | float, count: float, friction: float) -> None:
    """Refuse a contact so stiff that one encoder step moves its torque by more than all of the friction.

    Args:
        where: what the message begins with.
        stiffness: of the contact, of elements side by side [N.m/rad or N/m].
        count: encoder step [rad or m].
        friction: F [N.m or N].

    Raises:
        InvalidInput: K count > F.
    """
    K = float(np.sum(stiffness))
    check(where, stiffness=(K, STIFFNESS))
    if friction > 0.0 and K * count > friction:
        raise InvalidInput(
            f"{where}: with stiffness K = {K:g} one encoder step of {count:g} moves the torque by {K * count:.3g}, more than the "
            f"friction of {friction:.3g}: such a compensator is a relay.",
            remedy="Give a smaller stiffness, or use a finer encoder.",
        )
