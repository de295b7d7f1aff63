"""A joint's friction as tables and a small plot for the terminal."""

from __future__ import annotations

import json
from collections.abc import Iterator
from itertools import zip_longest
from typing import Any

from backdrive._visible import visible
from backdrive.identification.quality import grade
from backdrive.model import FrictionModel, JointFriction
from backdrive.report.entries import Entry, entries
from backdrive.report.words import (
    dynamics,
    law_name,
    number,
    percent,
    prose,
    quantity,
    term,
    with_error,
)


def joint_tables(friction: JointFriction, *, width: int = 80, unicode: bool = True) -> Iterator[Any]:
    """Yield tables and plot of one joint, as objects that `rich` prints.

    Args:
        friction: of the joint.
        width: of the terminal [characters].
        unicode: the terminal can draw Braille dots.
    """
    from rich.padding import Padding
    from rich.text import Text

    element = friction.law.element.NAME
    law = law_name(friction.law.rate.NAME, friction.law.rate) + (
        "" if element == "none" else f", carried by {element}"
    )
    title = Text()
    title.append(visible(friction.joint.name).replace("\n", " "), style="bold")
    title.append(
        f"  {grade(friction).word}",
        style={"good": "green", "poor": "red"}.get(grade(friction).level, "yellow"),
    )
    yield title
    yield Text(f"  {law}" + (f"; method {visible(friction.method)}" if friction.method else ""), style="dim")
    for sentence in (*friction.warnings, *friction.remarks()):
        yield Padding(Text(f"! {visible(prose(sentence))}", style="yellow"), (0, 0, 0, 2), expand=False)
    for table in (_parameters(friction), _knots(friction), _dynamics(friction), _quality(friction)):
        if table is not None:
            yield Padding(table, (1, 0, 0, 2), expand=False)
    yield Padding(Text(_validity(friction)), (1, 0, 0, 2), expand=False)
    if (table := _beside(friction)) is not None:
        yield Padding(table, (1, 0, 0, 2), expand=False)
    lines = _plot(friction, max(min(width - 16, 64), 24), unicode)
    yield Padding(Text("\n".join(lines)), (1, 0, 1, 2), expand=False)


def _new_table(*columns: tuple[str, str]) -> Any:
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False, header_style="dim")
    for name, justify in columns:
        table.add_column(name, justify=justify, overflow="fold")  # pyright: ignore[reportArgumentType]
    return table


def _parameters(friction: JointFriction) -> Any:
    table = _new_table(
        ("parameter", "left"), ("value ± std. error", "right"), ("unit", "left"), ("bounds", "left")
    )
    for each in entries(friction, knots=False):
        table.add_row(each.name, each.values[0], each.unit, f"{each.bounds}{_flag(each)}")
    return table if table.row_count else None


def _dynamics(friction: JointFriction) -> Any:
    table = _new_table(("other dynamics", "left"), ("value ± std. error", "right"), ("unit", "left"))
    for name, estimate in dynamics(friction):
        value = with_error(estimate.value, estimate.standard_error)
        table.add_row(visible(term(name)), value, visible(estimate.unit))
    return table if table.row_count else None


def _flag(entry: Entry) -> str:
    return ", at its bound" if entry.at_bound else ""


def _knots(friction: JointFriction) -> Any:
    many = entries(friction, knots=True)
    table = _new_table(*((f"{each.name} [{each.unit}]{_flag(each)}", "right") for each in many))
    for knot in zip_longest(*(each.values for each in many), fillvalue=""):
        table.add_row(*knot)
    return table if many else None


def _quality(friction: JointFriction) -> Any:
    if friction.fitted is None and friction.held_out is None:
        return None
    table = _new_table(
        ("quality", "left"),
        ("residual < 5 Hz", "right"),
        ("raw", "right"),
        ("RMS", "right"),
        ("samples", "right"),
    )
    for words, quality in (("fitted", friction.fitted), ("held out", friction.held_out)):
        if quality is not None:
            rms = quantity(quality.rms, friction.joint.torque_unit)
            table.add_row(
                words, percent(quality.residual), percent(quality.residual_raw), rms, str(quality.samples)
            )
    return table


def _validity(friction: JointFriction) -> str:
    unit, validity = friction.joint.unit, friction.validity
    ranges = [(validity.velocity, f"{unit}/s", "")]
    ranges += [(validity.load, friction.joint.torque_unit, "load ")] if validity.load else []
    ranges += [(validity.temperature, "degC", "temperature ")] if validity.temperature else []
    said = [f"{what}{number(pair[0])} to {number(pair[1])} {u}" for pair, u, what in ranges if pair]
    return f"valid for {', '.join(said)}; beyond, it extrapolates"


#: Values that a model may hold beside law and dynamics: owner, field, label, unit.
BESIDE = (
    ("validity", "lowest_speed", "lowest speed of the data", "speed"),
    ("validity", "nominal_load", "mean load of the data", "force"),
    ("joint", "encoder_counts", "encoder counts", "count"),
    ("torque_channel", "delay", "delay of the torque", "s"),
    ("torque_channel", "noise", "noise of the torque", "force"),
    ("torque_channel", "long_run", "noise of the mean over 1 s", "force"),
    ("actuator", "torque_limit", "torque limit", "force"),
    ("actuator", "trip_speed", "trip speed", "speed"),
    ("actuator", "gain", "drive gain", "gain"),
    ("actuator", "motor_inertia", "motor inertia", "inertia"),
)


def _beside(friction: JointFriction) -> Any:
    unit, force = friction.joint.unit, friction.joint.torque_unit
    inertia = "kg.m^2" if unit == "rad" else "kg"
    units = {"speed": f"{unit}/s", "force": force, "count": f"1/{unit}", "gain": force, "inertia": inertia}
    table = _new_table(("further values", "left"), ("value", "right"), ("unit", "left"))
    for owner, field, label, kind in BESIDE:
        value = getattr(getattr(friction, owner), field, None)
        if value is not None:
            error = getattr(friction.torque_channel, "delay_error", None) if field == "delay" else None
            table.add_row(label, with_error(value, error), units.get(kind, kind))
    for state in ("moving", "reversing", "rest"):
        band = getattr(friction.bands, state, None)
        if band is not None:
            words = f"95 % of torque within, {state} ({band.samples} samples)"
            table.add_row(words, f"± {number(band.half_width)}", force)
    if friction.covariance is not None:
        table.add_row("covariance matrix of", str(len(friction.covariance.names)), "parameters")
    return table if table.row_count else None


def _plot(friction: JointFriction, width: int, unicode: bool) -> list[str]:
    from backdrive.report.pictures.model_curve import model_curve
    from backdrive.report.pictures.terminal import plot_lines

    curve = model_curve(friction)
    branches = [(curve.velocity[s], curve.torque[s]) for s in (curve.velocity < 0, curve.velocity > 0)]
    return plot_lines(
        [b for b in branches if b[0].size],
        x_unit=f"{friction.joint.unit}/s",
        y_unit=friction.joint.torque_unit,
        width=width,
        braille=unicode,
    )


def provenance_lines(model: FrictionModel) -> list[str]:
    """Return where a model comes from, a line a fact."""
    lines = [f"made by backdrive {visible(model.version) or '(version not recorded)'}"]
    lines += [f"from {visible(s.path)}  sha256 {visible(s.sha256)}" for s in model.sources]
    if model.options:
        lines.append(
            f"options {visible(json.dumps(dict(sorted(model.options.items())), default=str, ensure_ascii=False))}"
        )
    if model.arm is not None:
        lines.append(
            f"rigid bodies of the arm with sha256 {visible(model.arm.urdf_sha256)}, condition {number(model.arm.condition)}"
        )
    return lines
