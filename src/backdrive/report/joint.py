"""The report's page on one joint."""

from __future__ import annotations

from itertools import zip_longest
from typing import Any

from backdrive.identification.dynamic.choice import Choice
from backdrive.identification.dynamic.unknowns import LawShape
from backdrive.identification.quality import grade
from backdrive.identification.result import Curve, JointEvidence
from backdrive.laws import Rigid
from backdrive.model import JointFriction, Quality
from backdrive.report import figures
from backdrive.report.alike import ALIKE
from backdrive.report.entries import FREE, Entry, entries
from backdrive.report.pictures.canvas import pretty_unit
from backdrive.report.words import (
    NOTHING,
    count_of,
    dynamics,
    esc,
    law_name,
    number,
    percent,
    prose,
    quantity,
    symbol,
    term,
    with_error,
)


def chip(friction: JointFriction) -> str:
    """Return the grade of a joint as a small label."""
    g = grade(friction)
    return f'<span class="chip {g.level}">{g.word}</span>'


def table(caption: str, head: list[str], rows: list[list[str]]) -> str:
    """Return a table; cells are HTML, the first of a row is its heading."""
    top = "".join(f'<th scope="col">{cell}</th>' for cell in head)
    body = "".join(
        f'<tr><th scope="row">{row[0]}</th>{"".join(f"<td>{cell}</td>" for cell in row[1:])}</tr>'
        for row in rows
    )
    named = f"<caption>{caption}</caption>" if caption else ""
    return f"<table>{named}<thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>"


def warnings_box(sentences: tuple[str, ...], heading: str) -> str:
    """Return the warnings on a result as a box, or nothing if there are none."""
    if not sentences:
        return ""
    items = "".join(f"<li>{esc(prose(sentence))}</li>" for sentence in sentences)
    return f'<div class="warn" role="note"><b>{esc(heading)}</b><ul>{items}</ul></div>'


def joint_section(
    friction: JointFriction,
    evidence: JointEvidence,
    truth: Curve | None,
    index: int,
    choice: Choice | None = None,
) -> str:
    """Return everything about one joint.

    Args:
        friction: its model.
        evidence: what supports it.
        truth: a curve to compare with.
        index: from 1; names the section and prefixes its pictures.
        choice: the laws that were tried, where a search was made.
    """
    prefix, good = f"j{index}", grade(friction).level == "good"
    left = figures.torque_course(friction, evidence, f"{prefix}-torque")
    left += figures.friction_curve(friction, evidence, truth, f"{prefix}-curve")
    left += figures.enlargement(friction, evidence, truth, f"{prefix}-two")
    right = (
        _quality(friction)
        + _laws(choice, friction)
        + _parameters(friction)
        + _dynamics(friction)
        + _validity(friction)
    )
    if evidence.presliding is not None and len(evidence.presliding):
        right += figures.presliding(friction, evidence.presliding, f"{prefix}-pre")
    return (
        f'<section class="joint" id="joint-{index}">'
        f'<div class="head"><h2><bdi>{esc(friction.joint.name)}</bdi></h2>{chip(friction)}</div>'
        f'<p class="lead">{esc(prose(evidence.verdict))}</p>'
        f"{warnings_box(friction.warnings, 'Remarks' if good else 'Warnings on this joint')}"
        f'<div class="grid pair"><div class="tables">{left}</div><div class="tables">{right}</div></div>'
        f"{figures.residual_row(friction, evidence, f'{prefix}-r')}</section>"
    )


def _quality(friction: JointFriction) -> str:
    fitted, held = friction.fitted, friction.held_out

    def row(words: str, show: Any) -> list[str]:
        return [words, *(f'<span class="n">{show(q) if q else NOTHING}</span>' for q in (fitted, held))]

    def rms(q: Quality) -> str:
        return quantity(q.rms, friction.joint.torque_unit)

    rows = [
        row("Residual below 5 Hz", lambda q: percent(q.residual)),
        row("Residual, raw", lambda q: percent(q.residual_raw)),
        row("RMS, raw", rms),
        row("Samples", lambda q: _thousands(q.samples)),
    ]
    note = (
        ""
        if held
        else '<p class="muted"><small>No data were held out: the residual is that of the fitted data.</small></p>'
    )
    return f"<div>{table('How well it explains torque', ['', 'Fitted', 'Held out'], rows)}{note}</div>"


def _laws(choice: Choice | None, friction: JointFriction) -> str:
    """Return a table of the candidate laws with their errors on fitted and on held-out data; the selected law is in bold."""
    if choice is None:
        return ""
    rows = []
    for law in choice.candidates:
        name = f"<b>{esc(law.name)}</b>" if law.name == choice.chosen else esc(law.name)
        remark = f"<br><small>{esc(prose(law.remark))}</small>" if law.remark else ""
        errors = (quantity(error, choice.unit) for error in (law.held_out, law.error))
        rows.append(
            [
                name + remark,
                *(f'<span class="n">{error}</span>' for error in errors),
                str(law.parameters or NOTHING),
            ]
        )
    why = f'<p class="muted"><small>{esc(prose(choice.reason))}</small></p>'
    head = ["Law", "Compared, held out", "Compared, fitted", "Parameters"]
    note = f'<p class="muted"><small>{_measures(choice, friction)}</small></p>'
    return f"<div>{table('Candidate laws, the selected one in bold', head, rows)}{why}{note}</div>"


def _measures(choice: Choice, friction: JointFriction) -> str:
    """Return what the errors of the candidate laws measure, and how those of the result differ."""
    if choice.unit != friction.joint.torque_unit:
        return (
            "Compared: RMS of the simulated motion under the drive, of fits that had not seen what was held out. "
            "\u201cRMS, raw\u201d above: torque by the selected law."
        )
    presliding = any(LawShape.from_name(law.name).element is not Rigid for law in choice.candidates)
    where = "" if presliding else " (held out: sliding alone)"
    return (
        f"Compared: RMS, rests and reversals included{where}, of fits that had not seen what was held out; every "
        "held-out window counts alike. \u201cRMS, raw\u201d above: all samples of the selected law, or sliding alone if "
        "it was fitted to sliding alone."
    )


def _thousands(count: float) -> str:
    return f"{count:,.0f}".replace(",", "\u202f")


def _parameters(friction: JointFriction) -> str:
    rows = [
        [
            f"{esc(each.name)} {symbol(each.symbol)}",
            f'<span class="n">{each.values[0]}</span> '
            f'<span class="n muted">{_unit(each.unit)}</span>{_flag(each)}',
            f'<span class="n">{each.bounds}</span>',
        ]
        for each in entries(friction, knots=False)
    ]
    element = friction.law.element.NAME
    carried = "" if element == "none" else f", carried by {element}"
    law = f"Law: {esc(law_name(friction.law.rate.NAME, friction.law.rate))}{esc(carried)}"
    top = f'<div class="caption">{law}</div>'
    if rows:
        top = table(law, ["Parameter", "Value ± standard error", "Bounds"], rows)
    return f"<div>{top}{_knots(friction)}</div>"


def _unit(unit: str) -> str:
    """Return a unit as HTML; nothing for a number without one."""
    return "" if unit == "1" else esc(pretty_unit(unit))


def _flag(entry: Entry) -> str:
    return ' <span class="flag">at its bound</span>' if entry.at_bound else ""


def _knots(friction: JointFriction) -> str:
    many = entries(friction, knots=True)
    if not many:
        return ""
    head = [
        f'{esc(each.name)} {symbol(each.symbol)} <span class="n">[{esc(pretty_unit(each.unit))}]</span>{_flag(each)}'
        for each in many
    ]
    knots = list(zip_longest(*(each.values for each in many), fillvalue=NOTHING))
    rows = [[f'<span class="n">{value}</span>' for value in knot] for knot in knots]
    limits = "; ".join(f"{each.name}: {each.bounds}" for each in many if each.bounds != FREE)
    where = f", {ALIKE}" if any(each.both for each in many) else " a direction"
    note = f'<p class="muted"><small>Bounds: {esc(limits)}.</small></p>' if limits else ""
    return (
        f"<details open><summary>{count_of(len(knots), 'knot')}{where}, ± standard errors</summary>"
        f"{table('', head, rows)}{note}</details>"
    )


def _dynamics(friction: JointFriction) -> str:
    if not friction.dynamics:
        return ""
    rows = []
    for name, estimate in dynamics(friction):
        rows.append(
            [
                esc(term(name)),
                f'<span class="n">{with_error(estimate.value, estimate.standard_error)}</span> '
                f'<span class="n muted">{_unit(estimate.unit)}</span>',
            ]
        )
    return table("Other dynamics, estimated together with friction", ["Term", "Value ± standard error"], rows)


def _validity(friction: JointFriction) -> str:
    joint, validity = friction.joint, friction.validity

    def span(pair: tuple[float, float] | None, unit: str) -> str:
        if pair is None:
            return '<span class="muted">not recorded</span>'
        return f'<span class="n">{number(pair[0])} to {number(pair[1])}</span> <span class="n muted">{unit}</span>'

    rows = [
        ["Velocity", span(validity.velocity, f"{joint.unit}/s")],
        ["Transmitted load", span(validity.load, pretty_unit(joint.torque_unit))],
        ["Temperature", span(validity.temperature, "°C")],
    ]
    if joint.torque_side == "motor":
        rows.append(["Torque measured", f"on the motor side, gear ratio {number(joint.gear_ratio, 5)}"])
    if joint.encoder_counts:
        rows.append(["Encoder", f"{_thousands(joint.encoder_counts)} counts per {joint.unit}"])
    return table("Range of validity; beyond it the model extrapolates", ["", "Range of the data"], rows)
