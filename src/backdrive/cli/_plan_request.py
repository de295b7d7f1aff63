"""The options of `backdrive plan`, and which of them mean something to which kind of plan."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from backdrive._catalog import lookup
from backdrive.errors import InvalidInput

_COMMON = ("joint", "all_joints", "urdf", "unit")

_MOTION = (
    "stroke",
    "stroke_deg",
    "center",
    "center_deg",
    "hold",
    "lead_in",
    "lower",
    "upper",
    "velocity_limit",
)
_MOTION += ("acceleration_limit", "torque_limit", "inertia", "gravity", "friction", "cycles")
_SPEED = ("top_speed", "top_speed_deg")
_TORQUE = ("amplitude", "offset", "cycles", "torque_limit")
#: Kind of plan -> the options that mean something to it, beside those that all have.
KINDS: dict[str, tuple[str, ...]] = {
    "sweep": (*_MOTION, *_SPEED, "literal", "bias", "time_slip", "centres"),
    "constant-velocity": (*_MOTION, *_SPEED, "speeds", "ramp_acceleration", "pause"),
    "multisine": (*_MOTION, "band", "period", "seed"),
    "sine-torque": (*_TORQUE, "frequency", "inertia"),
    "sawtooth-torque": (*_TORQUE, "frequency", "rise", "inertia"),
    "ramp": (*_TORQUE, "torque_rate", "lead_in"),
}


class Request(SimpleNamespace):
    """The options of the command by their names, as they were given; None where nothing was."""

    def __getattr__(self, name: str) -> Any:  # for those that a program leaves out
        return None


def check_options(request: Request) -> None:
    """Refuse a kind of plan that there is none of, and options that mean nothing to it."""
    lookup(request.kind, KINDS, "kind of plan")
    for name, value in vars(request).items():
        if value is None or value is False or name in ("kind", *_COMMON, *KINDS[request.kind]):
            continue
        kinds = ", ".join(kind for kind, options in KINDS.items() if name in options)
        raise InvalidInput(
            f"--{name.replace('_', '-')} means nothing to a plan of the kind {request.kind}.",
            remedy=f"It belongs to: {kinds}.",
        )
