"""The options of `backdrive plan`, and which of them mean something to which kind of plan."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path

COMMON = {
    "position": (
        *("stroke_deg", "center", "center_deg", "hold", "lead_in", "lower", "upper", "velocity_limit"),
        *("acceleration_limit", "torque_limit", "inertia", "gravity", "friction"),
    ),
    "torque": ("torque_limit",),
}


def kinds() -> dict[str, tuple[str, ...]]:
    """Return the options that mean something to a kind of plan, by kind, beside those that all have."""
    from backdrive.plans import PLANS

    return {plan.kind: (*COMMON[plan.commands], *plan.options) for plan in PLANS}


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
    known = kinds()
    for field in fields(request):
        value = getattr(request, field.name)
        if value is None or value is False or field.name in common or field.name in known[request.kind]:
            continue
        option = "--" + field.name.replace("_", "-")
        others = ", ".join(kind for kind, options in known.items() if field.name in options)
        raise InvalidInput(
            f"{option} means nothing to a plan of the kind {request.kind}.",
            remedy=f"It belongs to: {others}.",
        )
