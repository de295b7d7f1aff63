"""The display of results: text for a terminal, a picture, and HTML for a notebook.

One `Face` a kind of result; text and HTML are made of it.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from backdrive._options import as_arguments
from backdrive.errors import InvalidInput, check_type
from backdrive.external.result import STATES, ForceEstimate
from backdrive.identification.drift.comparison import Comparison
from backdrive.identification.quality import grade
from backdrive.identification.result import Curve, Identification
from backdrive.model import FrictionModel, JointFriction
from backdrive.report import page
from backdrive.report.alike import both_ways
from backdrive.report.data import FACES as OF_DATA
from backdrive.report.face import Face
from backdrive.report.pictures import canvas
from backdrive.report.pictures.curve import curves
from backdrive.report.pictures.force import LEGEND, draw_force, force_legend
from backdrive.report.pictures.model_curve import model_curve
from backdrive.report.pictures.svg import compact
from backdrive.report.pictures.tuning import safe_region
from backdrive.report.words import count_of, esc, law_name, percent, plain, prose, quantity, with_error
from backdrive.tuning.tuning import Tuning

WARNINGS = 3  # shown before the others are counted
LINE = "\n"
LONGEST_NAME = 24  # of a joint that a table for a terminal keeps on one line [characters]
WORDS = ("moving", "reversing", "at rest")


def face(result: Any) -> Face:
    """Return the parts of a result that can be displayed.

    Raises:
        InvalidInput: it is no result.
    """
    check_type(
        result,
        tuple(FACES),
        "result",
        "Give what `identify`, `validate`, `compare`, `tune` or `estimate_force` returned, a log or a plan.",
    )
    return next(make(result) for kind, make in FACES.items() if isinstance(result, kind))


def text(result: Any, width: int = 80) -> str:
    """Return a result as plain text.

    Args:
        result: of `identify`, `compare`, `tune` or `estimate_force`, or a model.
        width: of a line [characters].
    """
    from rich.console import Console
    from rich.table import Table

    shown = face(result)
    rows = Table(box=None, padding=(0, 2, 0, 0), pad_edge=False)
    short = all(len(row[0]) <= LONGEST_NAME for row in shown.rows)
    for number, name in enumerate(shown.head):
        whole = number == 0 and short  # names of joints and parameters
        rows.add_column(name, justify="left" if name in TEXT else "right", overflow="fold", no_wrap=whole)
    for row in shown.rows:
        rows.add_row(*(_plain(cell) for cell in row))
    stream = io.StringIO()
    console = Console(file=stream, width=width, color_system=None, markup=False, highlight=False, emoji=False)
    console.print(shown.title)
    console.print(shown.lead)
    if shown.rows:
        console.print()
        console.print(rows)
    for sentence in _some(shown.warnings):
        console.print(f"! {_plain(prose(as_arguments(sentence)))}")
    return "\n".join(line.rstrip() for line in stream.getvalue().splitlines()) + "\n"


def picture(result: Any) -> Any:
    """Return the picture of a result as a matplotlib figure.

    Raises:
        InvalidInput: there is no picture of it.
        MissingExtra: matplotlib is not installed.
    """
    canvas.require_matplotlib()
    shown = face(result)
    if shown.figure is None:
        raise InvalidInput(
            f"There is no picture of this: {shown.title}.",
            remedy="`summary()` and `report(path)` show it as a table.",
        )
    with canvas.house_style():
        figure = shown.figure(canvas.LIGHT)
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    FigureCanvasAgg(figure)  # so that a notebook shows it
    return figure


def html(result: Any) -> str:
    """Return a result as HTML for a notebook, readable in light and dark, with its picture if matplotlib is installed."""
    from backdrive.errors import MissingExtra

    shown = face(result)
    cell = 'style="text-align:{};padding:.15rem .7rem .15rem 0"'
    head = "".join(
        f"<th {cell.format('left' if name in TEXT else 'right')}>{esc(name)}</th>" for name in shown.head
    )
    rows = "".join(
        "<tr>"
        + "".join(
            f"<td {cell.format('left' if name in TEXT else 'right')}>{esc(c).replace(LINE, '<br>')}</td>"
            for name, c in zip(shown.head, row, strict=False)
        )
        + "</tr>"
        for row in shown.rows
    )
    warnings = "".join(f"<li>{esc(prose(as_arguments(w)))}</li>" for w in _some(shown.warnings))
    image = ""
    if shown.figure is not None:
        try:
            with canvas.house_style():
                picture = compact(canvas.content(shown.figure(canvas.LIGHT), "svg"))
            data = base64.b64encode(picture).decode()
            image = (
                f'<img alt="{esc(plain(shown.title))}" style="max-width:100%;background:#fff" '
                f'src="data:image/svg+xml;base64,{data}">'
            )
        except MissingExtra as error:
            image = f"<p>{esc(str(error))}</p>"
    return (
        f'<div class="backdrive"><p><strong>{esc(shown.title)}</strong></p><p>{esc(shown.lead)}</p>'
        f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"
        f"{f'<ul>{warnings}</ul>' if warnings else ''}{image}</div>"
    )


def _plain(cell: str) -> str:
    return plain(cell)


def _friction(friction: JointFriction, curve: Curve, which: int) -> str:
    """Return friction at the slowest or fastest speed with its error, a line each direction where they differ."""
    seen = page.at_speeds(friction, curve)
    if not seen:
        return "-"
    speeds, pairs = seen[which]
    unit = canvas.pretty_unit(friction.joint.torque_unit)
    pairs = both_ways(pairs)
    signed = len(pairs) == 2
    values = [with_error(f if signed else abs(f), s, signed=signed) for f, s in pairs]
    return "\n".join([*values, f"{unit} at {speeds}"])


def _rows_of(model: FrictionModel, of: Sequence[Curve]) -> list[list[str]]:
    return [
        [
            f.joint.name,
            grade(f).word,
            _friction(f, curve, 0),
            _friction(f, curve, 1),
            percent(quality.residual if (quality := f.held_out or f.fitted) else None),
        ]
        for f, curve in zip(model.joints, of, strict=False)
    ]


HEAD = ("joint", "verdict", "low speed", "top speed", "residual")
TEXT = ("joint", "verdict", "why", "unit", "parameter", "symbol", "method")  # columns of words


def _some(sentences: Sequence[str]) -> list[str]:
    """Return the first sentences, and the number of the others."""
    unique = list(dict.fromkeys(sentences))
    more = len(unique) - WARNINGS
    return [*unique[:WARNINGS], *([f"{count_of(more, 'more remark')} in the report."] if more > 0 else [])]


def _laws(model: FrictionModel) -> str:
    """Return the laws of a model's joints in a sentence."""
    names = list(dict.fromkeys(law_name(f.law.name, f.law.rate) for f in model.joints))
    return f"Law: {'; '.join(names)}."


def _of_model(model: FrictionModel) -> Face:
    return Face(
        title=f"Friction of {count_of(len(model.joints), 'joint')}",
        lead=_laws(model),
        head=HEAD,
        rows=_rows_of(model, [model_curve(f) for f in model.joints]),
        warnings=[w for f in model.joints for w in (*f.warnings, *f.remarks())],
        figure=lambda theme: curves(model, theme=theme),
    )


def _of_identification(result: Identification) -> Face:
    return Face(
        title=f"Friction of {count_of(len(result.model.joints), 'joint')}, by {result.method}",
        lead=f"{page.overall(result)} {_laws(result.model)}",
        head=HEAD,
        rows=_rows_of(result.model, [e.curve for e in result.evidence]),
        warnings=[*result.warnings, *(w for f in result.model.joints for w in f.warnings)],
        figure=lambda theme: curves(result.model, evidence=result.evidence, theme=theme),
    )


def _of_comparison(comparison: Comparison) -> Face:
    changed = comparison.joints_with_change
    lead = f"Changed: {', '.join(changed)}." if changed else "No joint changed beyond chance."
    first, second = comparison.models
    joints = {c.joint for c in comparison.changes}
    of_second = {c.before: c.joint for c in comparison.changes}
    both = replace(
        first,
        joints=tuple(
            replace(f, joint=replace(f.joint, name=of_second[f.joint.name]))
            for f in first.joints
            if f.joint.name in of_second
        ),
        arm=None,
        coupling=None,
        coupled=(),
    )
    truth = {f.joint.name: model_curve(f) for f in second.joints if f.joint.name in joints}
    return Face(
        title=f"Two models, {count_of(len(comparison.changes), 'joint')}",
        lead=lead if comparison.is_testable else "The test cannot decide whether friction has changed.",
        head=("joint", "up to", "distance +q", "distance -q", "verdict"),
        rows=[
            [c.joint, f"{c.top_speed:.3g}", *(quantity(d, c.unit) for d in c.distance), c.verdict]
            for c in comparison.changes
        ],
        warnings=[*(r for c in comparison.changes for r in c.remarks), *comparison.left_out],
        figure=(lambda theme: curves(both, truth=truth, names=("first", "second"), theme=theme))
        if set(both.names) == joints
        else None,
    )


def _of_tuning(tuning: Tuning) -> Face:
    force = "N.m" if tuning.unit == "rad" else "N"
    lead = "No trip speed was given; the loop requires one."
    if tuning.trip_speed is not None and tuning.limit is not None:
        lead = (
            f"The compensator gives at most {tuning.limit:.3g} {force}, and switches off once the joint is faster "
            f"than "
            f"{tuning.trip_speed:.3g} {tuning.unit}/s."
        )
    return Face(
        title=f"{tuning.joint}, for {tuning.goal}",
        lead=lead,
        head=("parameter", "symbol", "value", "unit", "why"),
        rows=[[name, n.symbol, f"{n.value:.4g}", n.unit, n.reason] for name, n in tuning.numbers.items()],
        warnings=tuning.notes,
        figure=(lambda theme: safe_region(tuning, theme)) if tuning.region else None,
    )


def _of_force(estimate: ForceEstimate) -> Face:
    rows = []
    for one in estimate.joints:
        half = 0.5 * (one.upper - one.lower)
        unit = one.joint.torque_unit
        bands = [
            quantity(float(np.nanmedian(half[one.state == k])), unit)
            if np.isfinite(half[one.state == k]).any()
            else "-"
            for k in range(len(STATES))
        ]
        peak = float(np.nanmax(np.abs(one.force))) if np.isfinite(one.force).any() else float("nan")
        rows.append([one.joint.name, one.method, quantity(peak, unit), *bands])
    contacts = "" if estimate.contacts is None else f" {count_of(len(estimate.contacts), 'contact')}."
    return Face(
        title=f"External force on {count_of(len(estimate.joints), 'joint')}",
        lead=f"{estimate.joints[0].time.size} samples.{contacts}",
        head=("joint", "method", "largest", *(f"half band, {word}" for word in WORDS)),
        rows=rows,
        warnings=estimate.remarks,
        figure=lambda theme: _force_figure(estimate, theme),
    )


def _force_figure(estimate: ForceEstimate, theme: canvas.Theme) -> Any:
    n, height = len(estimate.joints), canvas.HEIGHT
    width, titled = 2.0 * canvas.WIDTH, len(estimate.joints) > 1
    figure = canvas.new_figure(theme, width, n * height + LEGEND)
    for i, one in enumerate(estimate.joints):
        bottom = (n - 1 - i) * height
        axes = canvas.axes_of(figure, theme, (50.0, bottom + 40.0, width - 66.0, height - 70.0))
        draw_force(axes, theme, one, [c for c in estimate.contacts or () if one.joint.name in c.joints])
        if titled:
            axes.set_title(plain(one.joint.name), loc="right", color=theme.ink, pad=8, parse_math=False)
    force_legend(figure, theme, estimate)
    return figure


FACES: dict[type, Callable[[Any], Face]] = {
    Identification: _of_identification,
    FrictionModel: _of_model,
    Comparison: _of_comparison,
    Tuning: _of_tuning,
    ForceEstimate: _of_force,
    **OF_DATA,
}
