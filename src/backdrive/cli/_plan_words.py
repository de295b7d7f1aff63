"""The output of `backdrive plan`: figures of the plan, what was not checked, and what to watch."""

from __future__ import annotations

import math
from typing import Any

from backdrive.cli._plan_request import Request
from backdrive.cli._planning import single_plans
from backdrive.plans import inertia_bias, smallest_stroke, stroke_for_bias
from backdrive.plans.base import phrase, torque_unit
from backdrive.plans.limits import JointLimits
from backdrive.plans.margins import margins, note

_BIAS, _SLIP = 0.1, 1e-3  # defaults of `--bias` [N.m or N] and `--time-slip` [s]


def figures_of(plan: Any, limits: JointLimits, request: Request) -> dict[str, Any]:
    """Return the figures of one joint's plan, in SI units."""
    figures: dict[str, Any] = {
        "joint": plan.joint,
        "unit": plan.unit,
        "kind": plan.kind,
        "duration": plan.duration,
    }
    inertia = request.inertia
    if plan.commands == "torque":
        figures |= {"largest_torque": plan.largest_torque, "torque_limit": limits.effort}
        if inertia is not None and plan.kind != "ramp":
            figures["free_travel"] = plan.free_travel(inertia)
        return figures
    figures |= {
        "position": list(plan.position_range),
        "margins": [_margin(left, request.margin) for left in margins(plan, limits)],
        "peak_velocity": plan.peak_velocity,
        "peak_acceleration": plan.peak_acceleration,
    }
    if inertia is not None:
        torque = {"friction": request.friction or 0.0, "gravity": request.gravity or 0.0}
        figures |= {"peak_torque": plan.peak_torque(inertia, **torque), "torque_limit": limits.effort}
        if plan.kind == "sweep":
            if math.isfinite(limits.effort):
                figures["smallest_stroke"] = smallest_stroke(plan.top_speed, inertia, limits.effort, **torque)
            slip = _SLIP if request.time_slip is None else request.time_slip
            bias = _BIAS if request.bias is None else request.bias
            figures |= {"bias": bias, "time_slip": slip}
            figures["stroke_for_bias"] = stroke_for_bias(plan.top_speed, inertia, bias, slip)
            figures["bias_at_this_stroke"] = inertia_bias(plan.stroke, plan.top_speed, inertia, slip)
    return figures


def _margin(left: float, kept: float | None) -> float | None:
    """Return the distance to an end of the range with what --margin keeps [rad or m]; None if the end is not known."""
    return left + (kept or 0.0) if math.isfinite(left) else None


def notes_of(plan: Any, limits: dict[str, JointLimits], request: Request) -> list[str]:
    """Return what was not checked, and what to watch."""
    single = single_plans(plan)
    if plan.commands == "torque":
        return [
            "A torque command does not bound the motion: begin with a small torque, and set limits of position and "
            "speed in the robot's controller."
        ]
    notes = []
    if request.inertia is None and any(math.isfinite(limits[p.joint].effort) for p in single):
        notes.append("The torque was not checked: give --inertia for that.")
    blind = [p.joint for p in single if not {"lower", "upper"} & set(limits[p.joint].finite_limits)]
    fast = [p.joint for p in single if not math.isfinite(limits[p.joint].velocity)]
    half = [p.joint for p in single if p.joint not in blind]
    below = [joint for joint in half if "lower" not in limits[joint].finite_limits]
    above = [joint for joint in half if "upper" not in limits[joint].finite_limits]
    for what, options, joints in (
        ("range", "--lower and --upper", blind),
        ("lower end of the range", "--lower", below),
        ("upper end of the range", "--upper", above),
        ("speed", "--velocity-limit", fast),
    ):
        if joints:
            names = "" if len(single) == 1 else f" of {', '.join(joints)}"
            notes.append(
                f"The {what}{names} was not checked, for no limit is known: give --urdf, or {options}."
            )
    if request.margin is None:
        notes += filter(None, (note(one, limits[one.joint]) for one in single))
    if request.literal:
        notes.append("As printed in the thesis, the acceleration jumps at the end of every cycle.")
    steep = [p for p in single if p.unit == "rad" and p.peak_acceleration > 500]
    steep = [p.joint for p in steep if not math.isfinite(limits[p.joint].acceleration)]
    if steep and request.inertia is None:
        notes.append(
            f"An acceleration above 500 rad/s^2 is unusual (is the stroke in degrees?): {', '.join(steep)}."
        )
    return notes


def table_of(figures: list[dict[str, Any]]) -> list[str]:
    """Return a table: a line per figure for one plan; for several, a line per plan, and the common figures once."""
    if len(figures) == 1:
        return _align(_rows(figures[0]))
    columns = _columns(figures)
    wides = [max(map(len, column)) for column in columns]
    lines = []
    for cells in zip(*columns, strict=False):
        line = [
            f"{c:<{w}}" if i == 0 else f"{c:>{w}}" for i, (c, w) in enumerate(zip(cells, wides, strict=False))
        ]
        lines.append("  ".join(line).rstrip())
    alike = len({f["joint"] for f in figures}) == 1
    return lines + _align(_bias_rows(figures[0]) if alike else [])


def _align(rows: list[tuple[str, str]]) -> list[str]:
    wide = max((len(label) for label, _ in rows), default=0)
    return [f"{label:<{wide}}  {value}" for label, value in rows]


def _rows(f: dict[str, Any]) -> list[tuple[str, str]]:
    """Return labels and values of a joint's figures."""
    unit, newton = f["unit"], torque_unit(f["unit"])
    rows = [("joint", f["joint"]), ("duration", f"{f['duration']:.4g} s")]
    if "position" in f:
        low, high = f["position"]
        degrees = f" ({math.degrees(low):.4g} to {math.degrees(high):.4g} deg)" if unit == "rad" else ""
        rows += [
            ("range", f"{low:.4g} to {high:.4g} {unit}" + degrees),
            *_margin_rows(f["margins"], unit),
            ("top speed", phrase(f["peak_velocity"], f"{unit}/s")),
            ("peak acceleration", f"{f['peak_acceleration']:.4g} {unit}/s^2"),
        ]
    for key, label in (("largest_torque", "largest torque"), ("peak_torque", "peak torque")):
        if key in f:
            of = f" of {f['torque_limit']:.4g}" if math.isfinite(f["torque_limit"]) else ""
            rows.append((label, f"{f[key]:.4g}{of} {newton}"))
    if "free_travel" in f:
        rows.append(("travel in a period without friction", phrase(f["free_travel"], unit)))
    if "smallest_stroke" in f:
        rows.append(("smallest stroke for the torque", phrase(f["smallest_stroke"], unit, 1)))
    return rows + _bias_rows(f)


def _margin_rows(margins: list[float | None], unit: str) -> list[tuple[str, str]]:
    """Return label and value of the distances to the known ends of the range."""
    ends = zip(margins, ("below", "above"), strict=True)
    words = [f"{phrase(max(left, 0.0), unit)} {side}" for left, side in ends if left is not None]
    return [("margin to the limits", ", ".join(words))] if words else []


def _bias_rows(f: dict[str, Any]) -> list[tuple[str, str]]:
    """Return labels and values of the friction error that inertia causes, where inertia is known."""
    if "stroke_for_bias" not in f:
        return []
    unit, newton, slip = f["unit"], torque_unit(f["unit"]), f"{1e3 * f['time_slip']:g} ms slip"
    return [
        (f"bias by inertia, {slip}", f"{f['bias_at_this_stroke']:.3g} {newton} at the top speed"),
        (f"stroke for less than {f['bias']:g} {newton}", phrase(f["stroke_for_bias"], unit, 1)),
    ]


def _columns(figures: list[dict[str, Any]]) -> list[list[str]]:
    """Return a heading, its unit and a cell a joint for every column of the table of several joints."""
    unit = figures[0]["unit"]
    newton = torque_unit(unit)
    columns = [
        ["joint", "", *(f["joint"] for f in figures)],
        ["time", "[s]", *(f"{f['duration']:.1f}" for f in figures)],
    ]
    if "position" in figures[0]:
        for i, heading in enumerate(("from", "to")):
            columns.append([heading, f"[{unit}]", *(f"{f['position'][i]:.3f}" for f in figures)])
    shown = (
        ("peak_velocity", "speed", f"{unit}/s"),
        ("peak_acceleration", "accel.", f"{unit}/s^2"),
        ("peak_torque", "torque", newton),
        ("largest_torque", "torque", newton),
        ("torque_limit", "of", newton),
        ("smallest_stroke", "least stroke", unit),
    )
    for key, heading, of in shown:
        if all(math.isfinite(f.get(key, math.inf)) for f in figures):
            columns.append([heading, f"[{of}]", *(f"{f[key]:.4g}" for f in figures)])
    return columns
