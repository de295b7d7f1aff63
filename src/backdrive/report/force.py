"""The report of `backdrive estimate`: remarks first, joints at a glance, contacts, each joint's force over time, figures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from backdrive.external import Contact, ForceEstimate, JointForce
from backdrive.external.calibrate import Calibration
from backdrive.external.contacts import half_bands
from backdrive.external.result import STATES
from backdrive.report.figures import drawing, figure, key
from backdrive.report.joint import table, warnings_box
from backdrive.report.pictures import canvas
from backdrive.report.pictures.force import draw_force, draw_friction
from backdrive.report.sheet import page
from backdrive.report.words import NOTHING, count_of, esc, number, percent, quantity
from backdrive.report.wrench import wrench_section

MOST = 200  # largest number of contacts in the page's list
BESIDE = 1.0  # least time that a contact's picture shows before and after it [s]
WORDS = {"moving": "moving", "reversing": "turning, starting, creeping", "rest": "at rest"}
TERMS = {
    "External torque": "Torque of the environment on the joint, for example of a hand; positive along +q.",
    "Band": "Contains the true torque 95 % of the time. At rest, friction balances any external torque up to the "
    "break-away torque, and the encoder does not show how much. So the band at rest is as wide as the friction of "
    "both directions together, plus 10 %.",
    "Threshold": "An estimate above this multiple of half the band counts as a contact. Free motion exceeds the "
    "threshold at the stated rate, as far as its length permits an estimate. The interval contains the level of "
    "that rate with 90 % confidence; the threshold may lie above it on purpose.",
    "Independent events": "Neighbouring samples are correlated; so many independent samples would give the same "
    "information.",
    "Acted on": "Share of the time in which zero lies outside the band. Where nothing touches the joint expect up to 5 %.",
}


def render_force(
    estimate: ForceEstimate, *, command: str, title: str | None = None, remarks: Sequence[str] | None = None
) -> str:
    """Return the report of an estimate as HTML; it names no address and runs no script.

    Args:
        estimate: of `estimate_force`.
        command: the command line that made it, to be copied.
        title: of the report; None: it names the joint or the number of joints.
        remarks: what is suspect, of log and estimate; None: the estimate's own.

    Raises:
        MissingExtra: matplotlib is not installed.
    """
    names = [one.joint.name for one in estimate.joints]
    title = title or f"External torque on {names[0] if len(names) == 1 else f'{len(names)} joints'}"
    with canvas.house_style():
        sections = [_joint(estimate, one, k) for k, one in enumerate(estimate.joints, start=1)]
    words = "".join(f"<dt>{esc(k)}</dt><dd>{esc(v)}</dd>" for k, v in TERMS.items())
    body = [
        _header(estimate, title, tuple(estimate.remarks if remarks is None else remarks)),
        _summary(estimate),
        _contacts(estimate),
        *([] if estimate.wrench is None else [wrench_section(estimate.wrench)]),
        *sections,
        '<section class="about" id="made-by"><h2>Where this comes from</h2><h3>The command that made it</h3>'
        f'<pre class="copy">{esc(command)}</pre><details><summary>What the words mean</summary><dl>{words}</dl></details>'
        "</section>",
    ]
    return page(title, "\n".join(body))


def write_force_report(
    estimate: ForceEstimate,
    path: str | Path,
    *,
    command: str,
    title: str | None = None,
    remarks: Sequence[str] | None = None,
) -> Path:
    """Write the report of an estimate, whole or not at all; see `render_force`."""
    from backdrive._files import write_whole

    return write_whole(path, render_force(estimate, command=command, title=title, remarks=remarks))


def _header(estimate: ForceEstimate, title: str, remarks: tuple[str, ...]) -> str:
    longest = max(estimate.joints, key=lambda one: one.time.size)
    facts = {
        "Joints": str(len(estimate.joints)),
        "Duration": f"{number(longest.time[-1] - longest.time[0])} s",
    }
    free = [c.duration for c in estimate.calibrations.values()]
    facts["Bands by"] = f"{number(max(free) / 60.0)} min of free motion" if free else "the model's residual"
    items = "".join(f"<div><dt>{esc(k)}</dt><dd>{esc(v)}</dd></div>" for k, v in facts.items())
    return (
        f'<header><h1><bdi>{esc(title)}</bdi></h1><p class="lead">{esc(_lead(estimate))}</p><dl class="facts">{items}</dl>'
        f"{warnings_box(remarks, 'Remarks')}</header>"
    )


def _lead(estimate: ForceEstimate) -> str:
    """Return one or two sentences on the torque that acted."""
    most = max(estimate.joints, key=lambda one: float(np.mean(one.outside)))
    acted = (
        f"Zero lies outside the 95 % band for {percent(100.0 * float(np.mean(most.outside)))} of the time"
        + ("." if len(estimate.joints) == 1 else f" on joint {most.joint.name}, where it does so most.")
    )
    if estimate.contacts is None:
        return acted
    count = count_of(len(estimate.contacts), "contact") if estimate.contacts else "No contact"
    return f"{count}, at thresholds for a false-alarm rate of {estimate.false_alarms:g}/h over all joints. {acted}"


def _summary(estimate: ForceEstimate) -> str:
    known = any(one.known is not None for one in estimate.joints)
    heads = ["Joint", "Largest", "at", "RMS", "Acted on", "Method", *(["RMS error"] if known else [])]
    rows = []
    for k, one in enumerate(estimate.joints, start=1):
        unit, largest = one.joint.torque_unit, int(np.argmax(np.abs(one.force)))
        cells = [
            quantity(float(one.force[largest]), unit),
            f"{number(float(one.time[largest]), 4)} s",
            quantity(float(np.sqrt(np.mean(one.force**2))), unit),
            percent(100.0 * float(np.mean(one.outside))),
            f"{esc(one.method)}, {number(one.bandwidth)} 1/s",
        ]
        if known:
            cells.append(NOTHING if one.rms_error is None else quantity(one.rms_error, unit))
        shown = "".join(
            f'<td data-label="{head}"><span class="n">{cell}</span></td>'
            for head, cell in zip(heads[1:], cells, strict=False)
        )
        rows.append(
            f'<tr><th scope="row" class="name"><a href="#joint-{k}"><bdi>{esc(one.joint.name)}</bdi></a></th>{shown}</tr>'
        )
    top = "".join(f'<th scope="col">{head}</th>' for head in heads)
    return f'<table class="summary"><thead><tr>{top}</tr></thead><tbody>{"".join(rows)}</tbody></table>'


def _contacts(estimate: ForceEstimate) -> str:
    if not estimate.contacts:
        return ""
    units = {one.joint.name: one.joint.torque_unit for one in estimate.joints}
    rows = []
    for c in estimate.contacts[:MOST]:
        largest = "<br>".join(
            f'<bdi>{esc(name)}</bdi> <span class="n">{quantity(force, units[name])}</span>'
            for name, force in c.forces.items()
        )
        rows.append([f"{c.begin:.3f} s", f"{number(c.end - c.begin)} s", largest])
    more = len(estimate.contacts) - MOST
    rest = f'<p class="muted">{esc(count_of(more, "more contact"))} are not listed.</p>' if more > 0 else ""
    return f'<section class="contacts" id="contacts">{table("Contacts", ["Begin", "For", "Largest torque"], rows)}{rest}</section>'


def _joint(estimate: ForceEstimate, one: JointForce, index: int) -> str:
    name, contacts = one.joint.name, [c for c in estimate.contacts or () if one.joint.name in c.forces]
    caption = key("line", "estimated") + key("band", "95 % band")
    caption += key("truth", "known") if one.known is not None else ""
    caption += key("contact", "contact") if contacts else ""
    caption += key("curve", "at rest (line at zero)") if np.any(one.state == STATES.index("rest")) else ""
    pictures = [figure(_picture(one, contacts, f"j{index}-force", f"External torque on {name}"), caption)]
    if contacts:
        largest = max(contacts, key=lambda c: abs(c.forces[name]))
        reach = max(BESIDE, largest.end - largest.begin)
        part = _rows(one, (one.time >= largest.begin - reach) & (one.time <= largest.end + reach))
        picture = _picture(part, contacts, f"j{index}-contact", f"Largest contact of {name}")
        pictures.append(figure(picture, "The contact with the largest torque."))

    def draw(axes: Any) -> None:
        draw_friction(axes, canvas.CSS, one)

    friction = drawing(f"j{index}-friction", f"Friction taken off, {name}", draw)[0]
    pictures.append(figure(friction, key("curve", "friction by the model, which was subtracted")))
    side = "".join(pictures[1:])
    return (
        f'<section class="joint" id="joint-{index}"><div class="head"><h2><bdi>{esc(name)}</bdi></h2></div>'
        f'<div class="grid pair"><div class="tables">{pictures[0]}{_figures(estimate, one)}</div>'
        f'<div class="tables">{side}</div></div></section>'
    )


def _picture(one: JointForce, contacts: Sequence[Contact], prefix: str, label: str) -> str:
    def draw(axes: Any) -> None:
        draw_force(axes, canvas.CSS, one, contacts)

    return drawing(prefix, label, draw)[0]


def _rows(one: JointForce, rows: np.ndarray) -> JointForce:
    """Return some of the samples of an estimate."""
    from dataclasses import replace

    names = ("time", "force", "friction", "lower", "upper", "state", "known", "contact")
    return replace(one, **{n: getattr(one, n)[rows] for n in names if getattr(one, n) is not None})


def _figures(estimate: ForceEstimate, one: JointForce) -> str:
    """Return a joint's error figures by state of motion, as a table."""
    unit, calibration = one.joint.torque_unit, estimate.calibrations.get(one.joint.name)
    thresholds = {t.state: t for t in estimate.thresholds if t.joint == one.joint.name}
    halves = half_bands(one)
    head = ["", *(WORDS[state] for state in STATES)]
    rows = [
        ["Share of the time", *(percent(100.0 * float(np.mean(one.state == k))) for k in range(len(STATES)))],
        ["Half the band", *(quantity(h, unit) for h in halves)],
    ]
    if one.known is not None:
        error = np.abs(one.force - one.known)
        inside = (one.known >= one.lower) & (one.known <= one.upper)
        within = [one.state == k for k in range(len(STATES))]
        rows.append(["RMS error", *(quantity(_rms(error[w]), unit) for w in within)])
        rows.append(["Known torque within the band", *(_share(inside[w]) for w in within)])
    if calibration is not None:
        rows += _of_calibration(calibration)
    if thresholds:
        ordered = [thresholds[state] for state in STATES]
        rows.append(["Threshold, bands", *(number(t.bands) for t in ordered)])
        rows.append(
            ["level between", *(f"{number(t.interval[0])} and {number(t.interval[1])}" for t in ordered)]
        )
        rows.append(
            ["Threshold", *(quantity(t.bands * h, unit) for t, h in zip(ordered, halves, strict=False))]
        )
        rows.append(["Peaks of free motion", *(str(t.peaks) if t.peaks else NOTHING for t in ordered)])
    cells = [[row[0], *(f'<span class="n">{cell}</span>' for cell in row[1:])] for row in rows]
    return f"<div>{table('By state of motion', head, cells)}</div>"


def _of_calibration(calibration: Calibration) -> list[list[str]]:
    bands = (calibration.moving, calibration.reversing)
    events = [NOTHING if b is None else f"{b.events:,.0f}".replace(",", "\u202f") for b in bands]
    shares = [
        NOTHING
        if b is None or np.isnan(b.held_out[0])
        else " to ".join(f"{100.0 * x:.0f} %" for x in b.held_out)
        for b in bands
    ]
    return [["Independent events", *events, NOTHING], ["Held-out fifth, within the band", *shares, NOTHING]]


def _rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(x**2))) if x.size else float("nan")


def _share(inside: np.ndarray) -> str:
    return percent(100.0 * float(inside.mean())) if inside.size else NOTHING
