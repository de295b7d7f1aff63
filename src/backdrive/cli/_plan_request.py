"""The options of `backdrive plan`, and the kinds of plan that each applies to."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from backdrive._catalog import lookup
from backdrive.errors import InvalidInput
from backdrive.plans import PLANS

_COMMON = ("joint", "all_joints", "urdf", "unit")

COMMON = {
    "position": (
        *(
            "stroke_deg",
            "center",
            "center_deg",
            "hold",
            "lead_in",
            "lower",
            "upper",
            "margin",
            "velocity_limit",
        ),
        *("acceleration_limit", "torque_limit", "inertia", "gravity", "friction"),
    ),
    "torque": ("torque_limit",),
}


#: Of a motion of a whole arm.
ARM = (
    *("purpose", "around", "box", "limit", "packages", "floor", "clearance", "reserve", "duration", "noise"),
    *("frame", "seed", "velocity_limit", "acceleration_limit", "torque_limit", "friction"),
)


def kinds() -> dict[str, tuple[str, ...]]:
    """Return the options that apply to each kind of plan, beside those common to all kinds."""
    return {plan.kind: (*COMMON[plan.commands], *plan.options) for plan in PLANS} | {"arm": ARM}


class Request(SimpleNamespace):
    """The options of the command by name; None where an option was not given."""

    def __getattr__(self, name: str) -> Any:  # for those that a program leaves out
        return None


def check_options(request: Request) -> None:
    """Refuse an unknown kind of plan, and options that do not apply to the kind."""
    known = kinds()
    lookup(request.kind, known, "kind of plan")
    for name, value in vars(request).items():
        if value is None or value is False or name in ("kind", *_COMMON, *known[request.kind]):
            continue
        others = ", ".join(kind for kind, options in known.items() if name in options)
        raise InvalidInput(
            f"--{name.replace('_', '-')} does not apply to a plan of the kind {request.kind}.",
            remedy=f"It belongs to: {others}.",
        )
