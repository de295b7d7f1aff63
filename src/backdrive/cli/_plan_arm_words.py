"""The output of `backdrive plan arm`: the motion, the expected standard errors, and what the motion cannot identify."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from backdrive.cli._plan_request import Request
from backdrive.identification.arm_forecast import StandardError
from backdrive.plans.arm import ArmPlan
from backdrive.plans.base import torque_unit
from backdrive.plans.limits import JointLimits

NOISE, FRICTION = 0.01, 0.05  # of the torque limit, unless they are given [-]


@dataclass(frozen=True, kw_only=True, eq=False)
class ArmOutcome:
    """A plan of an arm, with its checks and predictions before the robot moves.

    Attributes:
        plan: that was chosen.
        limits: of its joints, without the margin.
        errors: standard errors to be expected.
        peaks: largest share of position, speed, acceleration and torque that each joint uses [-], (4, J).
        nearest: smallest distance of two links beyond the one required [m], and which links; None: not checked.
        notes: what was not checked, and what to watch.
    """

    plan: ArmPlan
    limits: dict[str, JointLimits]
    errors: list[StandardError]
    peaks: np.ndarray
    nearest: tuple[float, tuple[str, str]] | None
    notes: list[str]


def notes_of(request: Request, errors: Sequence[StandardError]) -> list[str]:
    """Return notes on what this motion cannot identify, and on what was assumed."""
    notes = []
    blind = [f"{e.name} of {e.joint}" for e in errors if not e.shows]
    if blind:
        notes.append(
            f"This motion hardly excites {len(blind)} of {len(errors)} parameters: {', '.join(blind)}. Their estimates will "
            f"stay near the values of the robot description."
        )
    notes.append(
        "No motion can separate a constant friction difference between directions from a torque offset, or single "
        "masses from their combinations. This one does not show friction at rest or above the planned speeds, nor "
        "temperature or wear."
    )
    if request.noise is None:
        notes.append(
            f"The torque noise below 5 Hz was assumed to be {100 * NOISE:g} % of the torque limit. The expected "
            f"errors are proportional to it: give --noise, the residual of an earlier identification."
        )
    if request.friction is None:
        notes.append(f"Friction was assumed to be {100 * FRICTION:g} % of the torque limit: give --friction.")
    if request.floor is None:
        notes.append(
            "Collisions were checked within the arm only: keep tables and people away, and give --floor HEIGHT."
        )
    return notes


def figures_of(outcome: ArmOutcome) -> list[dict[str, Any]]:
    """Return the figures of every joint's motion, in SI units."""
    t = outcome.plan.start + np.linspace(0.0, outcome.plan.duration, 20_000)
    q, dq, ddq = (getattr(outcome.plan, f)(t) for f in ("position", "velocity", "acceleration"))
    return [
        {
            "joint": name,
            "unit": outcome.plan.units[j],
            "kind": "arm",
            "duration": outcome.plan.duration,
            "begins_at": float(q[0, j]),
            "position": [float(q[:, j].min()), float(q[:, j].max())],
            "peak_velocity": float(np.abs(dq[:, j]).max()),
            "peak_acceleration": float(np.abs(ddq[:, j]).max()),
            "torque_share": float(outcome.peaks[3, j]),
        }
        for j, name in enumerate(outcome.plan.joints)
    ]


def errors_of(outcome: ArmOutcome) -> list[dict[str, Any]]:
    """Return the standard errors to be expected, SI."""
    return [
        {
            "joint": e.joint,
            "parameter": e.name,
            "unit": e.unit,
            "standard_error": e.expected,
            "shows": e.shows,
        }
        for e in outcome.errors
    ]


def show(outcome: ArmOutcome, written: Sequence[Path]) -> None:
    """Print the plan for a person."""
    from backdrive.cli._output import console as new_console
    from backdrive.cli._output import print_lines, table

    plan, console = outcome.plan, new_console()
    console.print(
        f"motion of {len(plan.joints)} joints for {', '.join(plan.purpose)}: {plan.duration:.4g} s, of which "
        f"{plan.slow_time:.3g} s are slow; a closed path of {plan.period:.4g} s, repeated {plan.periods} times"
    )
    rows = table(
        "joint", "begins at", "from", "to", "unit", "speed", "accel.", "torque used", text=("joint", "unit")
    )
    for f in figures_of(outcome):
        low, high = f["position"]
        rows.add_row(
            f["joint"],
            f"{f['begins_at']:.3f}",
            f"{low:.3f}",
            f"{high:.3f}",
            f["unit"],
            f"{f['peak_velocity']:.3g}",
            f"{f['peak_acceleration']:.3g}",
            f"{100 * f['torque_share']:.0f} %",
        )
    console.print(rows)
    if outcome.nearest is not None and math.isfinite(outcome.nearest[0]):
        spare, links = outcome.nearest
        console.print(
            f"Links keep their distance, narrowest {links[0]} and {links[1]}: {1e3 * spare:.3g} mm to spare."
        )
    console.print("Standard errors to be expected:")
    rows = table("joint", "Coulomb", "viscous", "offset", "motor inertia", "unit", text=("joint", "unit"))
    for name, unit in zip(plan.joints, plan.units, strict=False):
        own = {e.name: e for e in outcome.errors if e.joint == name}
        cells = [_cell(own[key]) for key in ("coulomb", "viscous", "offset", "inertia")]
        rows.add_row(
            name, *cells, f"{torque_unit(unit)}, s/{unit}, kg.m^2" if unit == "rad" else "N, s/m, kg"
        )
    console.print(rows)
    bodies = [e for e in outcome.errors if e.name not in ("coulomb", "viscous", "offset", "inertia")]
    rows = table("link of", "base parameters", text=("link of", "base parameters"))
    for name in plan.joints:
        cells = [f"{e.name} {_cell(e)} {e.unit}" for e in bodies if e.joint == name]
        if cells:
            rows.add_row(name, ", ".join(cells))
    console.print(rows)
    print_lines(console, outcome.notes, style="yellow")
    console.print(f"Wrote {', '.join(map(str, written))}")


def _cell(error: StandardError) -> str:
    return f"{error.expected:.2g}" if error.shows else "-"
