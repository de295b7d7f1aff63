"""The report's first page, with verdict and overview of all joints, and its last page, with command, files and options."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np

from backdrive.identification.quality import FAIR, GOOD, grade
from backdrive.identification.result import Curve, Identification
from backdrive.model import FrictionModel, JointFriction
from backdrive.report.alike import ALIKE, both_ways
from backdrive.report.joint import chip, table, warnings_box
from backdrive.report.pictures.canvas import pretty_unit
from backdrive.report.pictures.sizes import readable
from backdrive.report.words import (
    NOTHING,
    count_of,
    esc,
    number,
    percent,
    plain,
    prose,
    sentence,
    with_error,
)

#: Terms in the report and their meaning.
TERMS = {
    "Residual": "100 |measured − predicted torque| / |measured torque|, in 2-norms over the evaluated samples. Both "
    "torques are low-passed at 5 Hz without phase shift if the sampling rate permits; the raw residual is not "
    "filtered.",
    "Held out": "Data that the fit did not see: contiguous blocks or other files.",
    "± and the band": "One standard error in the tables, two in the pictures. They cover the noise of the data, not "
    "errors of the model's form: those show as structure in the residual.",
    "Verdict": f"Good up to {GOOD:g} % residual, usable with care up to {FAIR:g} %, poor above; held-out data "
    f"decide if there are any.",
    "Signs": "Friction is positive for positive velocity and resists motion. Units are SI.",
}


def overall(result: Identification) -> str:
    """Return the verdict on the whole result in a sentence or two."""
    joints = result.model.joints
    order = ("good", "care", "poor", "unknown")
    grades = sorted((grade(j) for j in joints), key=lambda g: order.index(g.level))
    levels, words = {g.level for g in grades}, ["good" if g.level == "good" else g.word for g in grades]
    each = [f"{words.count(w)} {'is' if words.count(w) == 1 else 'are'} {w}" for w in dict.fromkeys(words)]
    if len(joints) == 1:
        said = f"The result is {grades[0].word}."
    elif len(each) == 1:
        said = f"All {len(joints)} joints are {words[0]}."
    else:
        said = f"Of {len(joints)} joints, {', '.join(each[:-1])} and {each[-1]}."
    n = len(result.warnings) + sum(len(j.warnings) for j in joints)
    if not n:
        return said
    if levels == {"good"}:
        return f"{said} There {'is' if n == 1 else 'are'} {count_of(n, 'remark')}; none lowers the grade."
    return f"{said} Read {count_of(n, 'warning')} before using the numbers."


def header(result: Identification, title: str) -> str:
    """Return title, verdict, warnings on the whole result, and the basic facts."""
    model = result.model
    logs = count_of(len(model.sources), "log file") if model.sources else "not recorded"
    facts = {
        "Method": result.method,
        "Joints": str(len(model.joints)),
        "From": logs,
        "By": f"backdrive {model.version}".strip(),
    }
    items = "".join(f"<div><dt>{esc(k)}</dt><dd>{esc(v)}</dd></div>" for k, v in facts.items())
    good = all(grade(j).level == "good" for j in model.joints)
    heading = "Remarks on the whole" if good else "Warnings on the whole result"
    why = f"Why this method: {result.reason}"
    reason = f'<p class="muted">{esc(prose(sentence(why)))}</p>' if result.reason else ""
    return (
        f'<header><h1><bdi>{esc(title)}</bdi></h1><p class="lead">{esc(overall(result))}</p>'
        f'<dl class="facts">{items}</dl>{reason}'
        f"{warnings_box(result.warnings, heading)}</header>"
    )


def error_at(curve: Curve, velocity: float) -> float:
    """Return the curve's standard error at a velocity, from its own direction [N.m or N]; NaN when unknown."""
    side = curve.velocity > 0 if velocity > 0 else curve.velocity < 0
    if not np.any(side):
        return math.nan
    return float(np.interp(velocity, curve.velocity[side], curve.standard_error[side]))


def at_speeds(friction: JointFriction, curve: Curve) -> list[tuple[str, list[tuple[float, float]]]]:
    """Return low and top speed in words, each with (friction, standard error) per direction that was seen.

    Args:
        friction: of the joint.
        curve: its curve, for the standard errors.
    """
    ways, result = friction.speeds_by_way, []
    for which in (0, 1) if ways else ():
        at = {way: speeds[which] for way, speeds in ways.items()}
        pairs = [(float(friction.law.torque(way * v)), error_at(curve, way * v)) for way, v in at.items()]
        result.append(
            (f"{' and '.join(dict.fromkeys(map(number, at.values())))} {friction.joint.unit}/s", pairs)
        )
    return result


def summary(result: Identification) -> str:
    """Return all joints in one table; on a phone each row becomes a block."""
    rows = []
    remarks = "Remarks" if all(grade(j).level == "good" for j in result.model.joints) else "Warnings"
    for index, (friction, evidence) in enumerate(
        zip(result.model.joints, result.evidence, strict=False), start=1
    ):
        seen = at_speeds(friction, evidence.curve)
        largest = max((abs(f) for _, pairs in seen for f, _ in pairs), default=0.0)
        factor, unit = readable(largest, pretty_unit(friction.joint.torque_unit))
        cells = []
        for label, (speeds, pairs) in zip(("Friction, low speed", "Friction, top speed"), seen, strict=False):
            one = both_ways(pairs)
            both = len(one) < len(pairs)
            lines = "<br>".join(
                f'<span class="n">{with_error(factor * f, factor * s, signed=not both)}</span>'
                for f, s in one
            )
            at = f'<small class="n">{unit} at {speeds}</small>'
            at += f'<br><small class="n">{ALIKE}</small>' if both else ""
            cells.append(f'<td data-label="{label}">{lines or NOTHING}<br>{at}</td>')
        for label, quality in (
            ("Residual, fitted", friction.fitted),
            ("Residual, held out", friction.held_out),
        ):
            shown = percent(quality.residual if quality else None)
            cells.append(f'<td data-label="{label}"><span class="n">{shown}</span></td>')
        n = len(friction.warnings)
        count = (
            f'<td class="count" data-label="{remarks}"><a href="#joint-{index}">{n}</a></td>'
            if n
            else '<td class="none muted">none</td>'
        )
        rows.append(
            f'<tr><th scope="row" class="name"><a href="#joint-{index}"><bdi>{esc(_short(friction.joint.name))}</bdi>'
            f'</a></th><td class="verdict">{chip(friction)}</td>{"".join(cells)}{count}</tr>'
        )
    heads = (
        "Joint",
        "Verdict",
        "Friction at low speed",
        "at top speed",
        "Residual, fitted",
        "held out",
        remarks,
    )
    top = "".join(f'<th scope="col">{h}</th>' for h in heads)
    return f'<table class="summary"><thead><tr>{top}</tr></thead><tbody>{"".join(rows)}</tbody></table>'


def _short(name: str, most: int = 60) -> str:
    return name if len(name) <= most else f"{name[: most - 1]}…"


def provenance(result: Identification, command: str) -> str:
    """Return the command, the files with their digests, the options, the model itself and the glossary."""
    model = result.model
    files = [[f"<code>{esc(s.path)}</code>", f"<code>{esc(s.sha256)}</code>"] for s in model.sources]
    where = table("", ["File", "sha256"], files) if files else '<p class="muted">No file is recorded.</p>'
    if len(files) > 6:
        where = f"<details><summary>{count_of(len(files), 'file')} with digests</summary>{where}</details>"
    options = ""
    if model.options:
        shown = [[esc(k), f"<code>{esc(_value(v))}</code>"] for k, v in sorted(model.options.items())]
        options = f"<h3>Options</h3>{table('', ['Option', 'Value'], shown)}"
    words = "".join(f"<dt>{esc(k)}</dt><dd>{esc(v)}</dd>" for k, v in TERMS.items())
    return (
        f'<section class="about" id="made-by"><h2>Where this comes from</h2>'
        f'<h3>The command that made it</h3><pre class="copy">{esc(command)}</pre>'
        f"<h3>Files read</h3>{where}{options}"
        f"{_arm(model)}<p>Made by backdrive {esc(model.version)}, method {esc(result.method)}.</p>"
        f"{_model_file(model)}"
        f"<details><summary>What the words mean</summary><dl>{words}</dl></details></section>"
    )


def _arm(model: FrictionModel) -> str:
    if model.arm is None:
        return ""
    return (
        f"<p>The rigid bodies belong to the robot description with sha256 <code>{esc(model.arm.urdf_sha256)}</code>; "
        f"the condition number of the fit is {number(model.arm.condition)}.</p>"
    )


def _model_file(model: FrictionModel) -> str:
    from backdrive.model.file import encode

    try:
        text = encode(model).decode()
    except (UnicodeEncodeError, TypeError):  # a path or an option that JSON cannot hold
        return '<p class="muted">The model contains a name or an option that cannot be written to a model file.</p>'
    return (
        '<details class="screen"><summary>The model file: copy it, save it as model.json</summary>'
        f'<pre class="file copy">{esc(text)}</pre></details>'
    )


def _value(value: Any) -> str:
    if isinstance(value, str):
        return value
    try:
        return json.dumps(value, ensure_ascii=False, sort_keys=True)
    except (TypeError, ValueError):
        return plain(value)
