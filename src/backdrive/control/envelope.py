"""The ranges of parameters for which the guarantees of the torque loop are valid. Construction refuses values outside.

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
from backdrive.parameters import Bound, check

PERIOD = Bound(5e-5, 2e-2, "s")
LIMIT = Bound(0.0, 1e5, "N.m or N")
TOP_SPEED = Bound(1e-3, 1e3, "rad/s or m/s")
COUNT = Bound(1e-9, 0.1, "rad or m")
SHARE = Bound(0.0, 1.0, "-")
STIFFNESS = Bound(0.0, 1e9, "N.m/rad or N/m")
INERTIA = Bound(1e-7, 1e5, "kg.m^2 or kg")
FRICTION = Bound(0.0, 1e5, "N.m or N")
RAMP = Bound(0.15, 60.0, "s")
HOLD = Bound(0.05, 2.0, "s")
FADE = Bound(10.0, 1e4, "1/s")
PATIENCE = Bound(0.005, 1.0, "s")
#: Ranges of the numbers in a joint's compensator and estimator.
OF_PARTS = {"share": SHARE, "friction": FRICTION, "inertia": INERTIA}
COARSEST = (
    0.1  # largest speed of one encoder step per shortest measuring window, relative to the top speed [-]
)


def check_contact(where: str, stiffness: Sequence[float] | float, count: float, friction: float) -> None:
    """Refuse a contact so stiff that one encoder step changes its torque by more than the whole friction.

    Args:
        where: first words of the message.
        stiffness: of the contact, of elements side by side [N.m/rad or N/m].
        count: encoder step [rad or m].
        friction: F [N.m or N].

    Raises:
        InvalidInput: K count > F.
    """
    K = float(np.sum(stiffness))
    check(where, {"stiffness": STIFFNESS}, {"stiffness": K})
    if friction > 0.0 and K * count > friction:
        raise InvalidInput(
            f"{where}: with stiffness K = {K:g} one encoder step of {count:g} moves the torque by {K * count:.3g}, more than the "
            f"friction of {friction:.3g}: such a compensator is a relay.",
            remedy="Give a smaller stiffness, or use a finer encoder.",
        )
