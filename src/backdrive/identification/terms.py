"""The terms of a joint's inverse dynamics beside its friction: the one table of their names and units."""

from __future__ import annotations

from backdrive.logs.log import Joint

#: Term -> unit for a rotary and for a linear joint.
TERMS: dict[str, tuple[str, str]] = {
    "inertia": ("kg.m^2", "kg"),
    "time_slip": ("s", "s"),
    "delay": ("s", "s"),
    "offset": ("N.m", "N"),
    "gravity_sin": ("N.m", "N"),
    "gravity_cos": ("N.m", "N"),
    "model_torque": ("1", "1"),
    "transition": ("rad/s", "m/s"),
}
GRAVITY = ("gravity_sin", "gravity_cos")


def unit_of(term: str, joint: Joint) -> str:
    """Return the SI unit of a term for this joint."""
    rotary, linear = TERMS[term]
    return rotary if joint.unit == "rad" else linear
