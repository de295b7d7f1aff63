"""The delay of the torque behind the motion where the user knows it: checked before the work, compared with the motion after it.

It is used as it is and has no error. What the motion shows by itself is estimated beside it, since a wrong delay spoils the
inertia and friction near reversals, but hardly the residual.
"""

from __future__ import annotations

from collections.abc import Mapping

from backdrive.errors import InvalidInput
from backdrive.identification.remark import SURE

LONGEST = 1.0  # largest size of a known delay [s]
CLOSE = 5e-4  # least difference from the motion's delay with a remark [s], or half a sampling interval if that is longer
WITHOUT = {
    "constant-velocity": "a late torque hardly changes means at constant speed",
    "ramp": "a torque ramp is slow against any delay",
}  # method -> reason why it takes no delay


def user_delay(known: Mapping[str, float], method: str) -> float | None:
    """Return the delay that the user knows [s]; None if none is given, or if the method is a search, which takes other names too.

    Args:
        known: values by name [SI].
        method: of the identification.

    Raises:
        InvalidInput: the method takes no delay, another name is given, or the delay is no plausible time.
    """
    if not known or method == "dynamic":
        return None
    others = [name for name in known if name != "delay"]
    if others:
        raise InvalidInput(
            f"'{others[0]}' cannot be known for a curve (method '{method}').",
            remedy="Leave it out, or search a law (--law auto), which takes it. A curve takes a known delay only.",
        )
    if method in WITHOUT:
        raise InvalidInput(
            f"The method '{method}' has no delay that could be known: {WITHOUT[method]}.",
            remedy="Leave --known delay out.",
        )
    delay = known["delay"]
    if not isinstance(delay, (int, float)) or not abs(delay) <= LONGEST:
        raise InvalidInput(
            f"delay = {delay!r} s is taken as known.",
            remedy=f"Give seconds, at most {LONGEST:g}: 4 ms are --known delay=0.004. It is positive where torque is logged after "
            "the motion.",
        )
    return float(delay)


def describe(delay: float) -> str:
    """Return a sentence that the delay [s] was not estimated."""
    return f"The delay of the torque is known, {1e3 * delay:.4g} ms, and was not estimated."


def contradiction(delay: float, shows: tuple[float, float], period: float) -> str:
    """Return a sentence on a known delay that the motion contradicts; empty if it does not.

    Args:
        delay: as known [s].
        shows: delay and standard error that the motion shows [s]; NaN or infinite if it shows none.
        period: sampling interval [s].
    """
    value, error = shows
    if not abs(value - delay) > SURE * error + max(CLOSE, 0.5 * period):
        return ""
    return (
        f"The delay of the torque is known as {1e3 * delay:.4g} ms, but the motion shows {1e3 * value:.3g} ± {1e3 * error:.2g} ms. "
        "Check its sign and unit (--known delay=SECONDS, positive where torque is logged after the motion), or leave it out."
    )
