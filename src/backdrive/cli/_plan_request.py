"""The options of `backdrive plan`, and which of them mean something to which kind of plan."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path

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


@dataclass(frozen=True, kw_only=True)
class Request:
    """The options as they were given; None where nothing was."""

    kind: str
    joint: list[str] | None = None
    all_joints: bool = False
    urdf: Path | None = None
    unit: str | None = None
    hold: list[str] | None = None
    stroke: float | None = None
    stroke_deg: float | None = None
    top_speed: float | None = None
    top_speed_deg: float | None = None
    cycles: int | None = None
    center: float | None = None
    center_deg: float | None = None
    lead_in: float | None = None
    literal: bool = False
    speeds: str | None = None
    ramp_acceleration: float | None = None
    pause: float | None = None
    band: str | None = None
    period: float | None = None
    seed: int | None = None
    amplitude: float | None = None
    offset: float | None = None
    frequency: float | None = None
    rise: float | None = None
    torque_rate: float | None = None
    lower: float | None = None
    upper: float | None = None
    velocity_limit: float | None = None
    acceleration_limit: float | None = None
    torque_limit: float | None = None
    inertia: float | None = None
    gravity: float | None = None
    friction: float | None = None
    bias: float | None = None
    time_slip: float | None = None
    centres: str | None = None


def refuse_idle_options(request: Request) -> None:
    from backdrive.errors import InvalidInput

    common = {"kind", "joint", "all_joints", "urdf", "unit"}
    for field in fields(request):
        value = getattr(request, field.name)
        if value is None or value is False or field.name in common or field.name in KINDS[request.kind]:
            continue
        option = "--" + field.name.replace("_", "-")
        kinds = ", ".join(kind for kind, options in KINDS.items() if field.name in options)
        raise InvalidInput(
            f"{option} means nothing to a plan of the kind {request.kind}.", remedy=f"It belongs to: {kinds}."
        )
