"""The display of logs, plans, validations and payloads; that of other results is in `show`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from backdrive.external.payload import PayloadEstimate
from backdrive.identification.regression import NORMAL
from backdrive.identification.validation import Validation
from backdrive.logs.log import Log, channel_unit
from backdrive.plans import ArmPlan, InTurn, Plan
from backdrive.report.face import Face
from backdrive.report.pictures import canvas
from backdrive.report.pictures.log import log_figure
from backdrive.report.pictures.plan import plan_figure
from backdrive.report.words import count_of, percent, quantity

SHOWN = ("position", "velocity", "torque", "drive_input")  # channels in the table of a log
AXES = "xyz"
OF_TORQUE = (
    "The residual is the RMS of measured minus predicted torque relative to that of the measured torque, both low-passed at 5 Hz "
    "where the sampling allows; raw: without the low pass."
)
OF_MOTION = (
    "The residual is the RMS error of the position relative to the RMS of the position about its mean."
)


def _range(values: np.ndarray, unit: str) -> str:
    """Return the least and the largest finite value with their unit."""
    good = values[np.isfinite(values)]
    if not good.size:
        return "-"
    shown = "" if unit == "1" else f" {canvas.pretty_unit(unit)}"
    return f"{good.min():.3g} … {good.max():.3g}{shown}"


def of_log(log: Log) -> Face:
    """Return the parts of a log: a row a joint, with the range of its main channels."""
    rate = 1.0 / log.period if log.period > 0 else float("nan")
    channels = [name for name in SHOWN if name in log.channels]
    others = [name for name in log.channels if name not in channels]
    more = f"; also {', '.join(others)}" if others else ""
    return Face(
        title=f"Log of {count_of(len(log.joints), 'joint')}",
        lead=f"{count_of(len(log), 'sample')} in {log.duration:.4g} s, {rate:.4g} Hz{more}.",
        head=("joint", *(name.replace("_", " ") for name in channels)),
        rows=[
            [joint.name, *(_range(log.channels[name][:, j], channel_unit(name, joint)) for name in channels)]
            for j, joint in enumerate(log.joints)
        ],
        warnings=log.notes,
        figure=(lambda theme: log_figure(log, theme)) if len(log) > 1 else None,
    )


def of_plan(plan: Any) -> Face:
    """Return the parts of a plan: a row a joint, with its range and its largest speed, or its largest torque."""
    single: list[Any] = [plan]
    if isinstance(plan, InTurn):
        single = list(plan.plans)
    elif isinstance(plan, ArmPlan):
        single = [plan.plan_of(name) for name in plan.joints]
    units = {one.unit for one in single}
    moves = plan.commands == "position"
    kinds = " and ".join(sorted({one.kind for one in single}))
    return Face(
        title=f"Plan of {count_of(len(single), 'joint')}: {kinds}",
        lead=f"{plan.duration:.4g} s, commands {plan.commands}. "
        + (
            "`plan.position(time)` and `plan.velocity(time)` give the motion at a time."
            if moves
            else "`plan.torque(time)` gives the torque at a time."
        )
        + " A controller's limits of position, speed and torque must stay active while it follows the plan.",
        head=("joint", "begins", *(("range", "top speed") if moves else ("torque",))),
        rows=[[one.joint, f"{one.start:.4g} s", *_of_one(one)] for one in single],
        figure=(lambda theme: plan_figure(plan, theme=theme))
        if len(units) == 1 or isinstance(plan, ArmPlan)
        else None,
    )


def _of_one(plan: Any) -> list[str]:
    """Return range and top speed of a motion, or the range of a torque, by its course."""
    t = plan.start + np.linspace(0.0, plan.duration, 6000)
    if plan.commands == "torque":
        return [_range(plan.torque(t), "N.m" if plan.unit == "rad" else "N")]
    speed = float(np.abs(plan.velocity(t)).max())
    return [_range(plan.position(t), plan.unit), quantity(speed, f"{plan.unit}/s")]


def of_validation(result: Validation) -> Face:
    """Return the parts of a validation: a row a joint, with its residuals."""
    worst = max(result, key=lambda name: result[name].residual, default="")
    moved = result.quantity == "motion"
    return Face(
        title=f"A model on logs, {count_of(len(result), 'joint')}",
        lead=f"Predicted: {result.quantity}. Largest residual: {percent(result[worst].residual)}, {worst}. "
        + (OF_MOTION if moved else OF_TORQUE)
        if worst
        else "No joint was judged.",
        head=("joint", "residual", *(() if moved else ("raw",)), "rms", "samples"),
        rows=[
            [
                name,
                percent(q.residual),
                *(() if moved else (percent(q.residual_raw),)),
                quantity(q.rms, result.units[name]),
                str(q.samples),
            ]
            for name, q in result.items()
        ],
        warnings=result.remarks,
    )


def of_payload(payload: PayloadEstimate) -> Face:
    """Return the parts of a payload: mass, center, inertia and gains, each with its 95 % interval."""
    known = payload.mass_error == 0.0
    low, high = payload.mass_interval
    rows = [["mass", f"{payload.mass:.4g} kg", "as given" if known else f"{low:.4g} … {high:.4g} kg"]]
    rows += [
        [f"center {axis}", f"{value:.4g} m", f"{a:.4g} … {b:.4g} m"]
        for axis, value, a, b in zip(AXES, payload.center, *payload.center_interval(), strict=True)
    ]
    for i, axis in enumerate(
        AXES if payload.inertia is not None and payload.inertia_error is not None else ""
    ):
        assert payload.inertia is not None
        assert payload.inertia_error is not None
        half = NORMAL * payload.inertia_error[i, i]
        value = payload.inertia[i, i]
        rows.append(
            [f"inertia {axis}{axis}", f"{value:.3g} kg·m²", f"{value - half:.3g} … {value + half:.3g} kg·m²"]
        )
    what = "gain" if payload.gains.kind == "absolute" else "gain ratio"
    rows += [
        [
            f"{what} {name}",
            f"{g.value:.4g}",
            f"{g.value - NORMAL * g.error:.4g} … {g.value + NORMAL * g.error:.4g}",
        ]
        for name, g in payload.gains.by_joint.items()
    ]
    limited = (
        "" if payload.limited_by == "nothing" else f" Its accuracy is limited by the {payload.limited_by}."
    )
    return Face(
        title=f"Payload at {payload.frame}",
        lead=f"{payload.mass:.4g} kg.{limited} The center is given in the frame {payload.frame}. Each interval "
        "holds the true value with a probability of 95 %; gains of the drives are listed where the logs show them.",
        head=("parameter", "value", "95 %"),
        rows=rows,
        warnings=payload.remarks,
    )


FACES: dict[type, Callable[[Any], Face]] = {
    Log: of_log,
    Plan: of_plan,
    InTurn: of_plan,
    ArmPlan: of_plan,
    Validation: of_validation,
    PayloadEstimate: of_payload,
}
