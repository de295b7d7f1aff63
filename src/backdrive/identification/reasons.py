"""Why a fit by motion states no standard errors: too little data, too few moves, a delay that is not known."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from backdrive.identification.design import LARGEST_SLIP
from backdrive.identification.evidence import sentences
from backdrive.identification.motion_bins import Bins, moves
from backdrive.identification.signals import Signals
from backdrive.identification.slip import Slip
from backdrive.model import Estimate, JointFriction

LEAST_FREEDOM = 3  # least number of degrees of freedom for standard errors
LEAST_MOVES = 6  # least number of moves for standard errors
KNOWN_SHARE = (
    0.1  # largest relative standard error of a known delay that may be longer than any plausible one [-]
)


def reasons(bins: Bins, friction: JointFriction, stretches: Sequence[Signals], slip: Slip) -> tuple[str, ...]:
    """Return the reasons why standard errors are unknown; empty if they are known."""
    unknowns = len(friction.standard_errors) + len(friction.dynamics)
    freedom, count = int(np.count_nonzero(bins.used)) - unknowns, moves(stretches)
    late = reason_of_delay(slip, friction.dynamics.get("time_slip"))
    return sentences(
        (freedom < LEAST_FREEDOM, "there is hardly more data than unknowns"),
        (count < LEAST_MOVES, f"the joint made only {count} moves"),
        (late, late),
    )


def reason_of_delay(slip: Slip, late: Estimate | None) -> str:
    """Return why the delay allows no standard errors, or an empty string if it does.

    Args:
        slip: the delay of the torque.
        late: the delay that was fitted with the friction; None: none was.
    """
    error = slip.error if late is None else max(slip.error, late.standard_error)
    if math.isinf(error):
        known = "is not determined by the motion"
    elif error > slip.least:
        known = f"is known to {1e3 * error:.2g} ms only"
    elif late is not None and is_vague(late.value, late.standard_error):
        known = f"is hardly known, {1e3 * late.value:.3g} ± {1e3 * error:.2g} ms"
    else:
        return ""
    return f"the delay of the torque {known}; give it where it is known (--known delay=...)"


def is_vague(delay: float, error: float) -> bool:
    """Return whether a delay may be longer than any with a plausible cause, and is not known to a tenth: friction is not, then.

    Args:
        delay: that was estimated [s].
        error: its standard error [s].
    """
    return error > KNOWN_SHARE * abs(delay) and abs(delay) + 2.0 * error >= LARGEST_SLIP
