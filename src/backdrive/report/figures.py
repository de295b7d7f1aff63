"""The report's pictures as inline SVG, each with its caption."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from backdrive.identification.result import Curve, JointEvidence, Samples
from backdrive.model import JointFriction
from backdrive.report.pictures import canvas, curve, directions, model_curve, residuals, svg, torque
from backdrive.report.words import count_of, esc, number, plain, quantity

_KEYS = {
    "fitted": '<circle cx="10" cy="5" r="3.4" fill="var(--fitted)"/>',
    "held-out": '<circle cx="10" cy="5" r="3.4" fill="var(--held-out)"/>',
    "curve": '<path d="M1 5h18" stroke="var(--ink)" stroke-width="2"/>',
    "bare": '<path d="M1 5h18" stroke="var(--held-out)" stroke-width="2"/>',
    "compensated": '<path d="M1 5h18" stroke="var(--fitted)" stroke-width="2"/>',
    "band": '<path d="M1 5h18" stroke="var(--band)" stroke-opacity=".38" stroke-width="9"/>',
    "contact": '<path d="M5 5h10" stroke="var(--held-out)" stroke-opacity=".38" stroke-width="9"/>',
    "line": '<path d="M1 5h18" stroke="var(--fitted)" stroke-width="2"/>',
    "knot": '<circle cx="10" cy="5" r="3.4" fill="var(--paper)" stroke="var(--ink)" stroke-width="1.4"/>',
    "forth": '<circle cx="4" cy="5" r="2.6" fill="var(--fitted)" stroke="var(--fitted)"/>'
    '<circle cx="14" cy="5" r="2.6" fill="var(--paper)" stroke="var(--fitted)"/>',
    "truth": '<path d="M1 5h18" stroke="var(--truth)" stroke-width="2.2" stroke-dasharray="5 3.2"/>',
}


def key(kind: str, words: str) -> str:
    """Return an entry of a legend as HTML: a small drawing of its kind, and words."""
    return f'<span class="key"><svg viewBox="0 0 20 10" aria-hidden="true">{_KEYS[kind]}</svg>{esc(words)}</span> '


def drawing(
    prefix: str,
    label: str,
    draw: Callable[[Any], Any],
    size: tuple[float, float] = (canvas.WIDTH, canvas.HEIGHT),
) -> tuple[str, Any]:
    """Return a picture as `<svg>`, and what its `draw` returns.

    Args:
        prefix: of identifiers, unique in the page.
        label: description of the picture for screen readers.
        draw: on axes.
        size: width and height [pt].
    """
    sheet = canvas.new_figure(canvas.CSS, *size)
    sheet.patch.set_visible(False)
    result = draw(canvas.axes_of(sheet, canvas.CSS))
    return svg.inline(sheet, prefix, plain(label)), result


def figure(picture: str, caption: str) -> str:
    """Return a picture with its caption as HTML."""
    return f"<figure>{picture}<figcaption>{caption}</figcaption></figure>"


def _sample_keys(samples: Samples, fitted: str, held_out: str) -> str:
    keys = key("fitted", fitted) if np.any(samples.fitted) else ""
    return keys + (key("held-out", held_out) if not np.all(samples.fitted) else "")


def torque_course(friction: JointFriction, evidence: JointEvidence, prefix: str) -> str:
    """Return measured and predicted torque over time, or nothing if the samples are not a time series."""
    samples, joint = evidence.samples, friction.joint
    if not torque.has_course(samples):
        return ""
    sheet = canvas.new_figure(canvas.CSS, canvas.WIDTH, torque.HEIGHT)
    sheet.patch.set_visible(False)
    begin, end, whole = torque.draw_torque(sheet, canvas.CSS, samples, joint)
    picture = svg.inline(sheet, prefix, plain(f"Measured and predicted torque over time, joint {joint.name}"))
    measured = "torque of the drive" if friction.method.endswith("drive's input") else "measured"
    caption = key("line", measured) + key("curve", "predicted by the model")
    if end - begin < whole:
        which = "held-out stretch" if not np.all(samples.fitted) else "stretch"
        caption += f"<br>The lower picture shows the {which} with the median residual, "
        caption += f"{number(end - begin)} of {number(whole)}\u00a0s."
    return figure(picture, caption)


def friction_curve(friction: JointFriction, evidence: JointEvidence, truth: Curve | None, prefix: str) -> str:
    """Return the friction curve over the measured samples."""
    name, unit = friction.joint.name, friction.joint.torque_unit
    knots = model_curve.knots_of(friction)

    def draw(axes: Any) -> curve.CurveDrawing:
        return curve.draw_curve(
            axes,
            canvas.CSS,
            evidence.curve,
            friction.joint,
            samples=evidence.samples,
            knots=knots,
            truth=truth,
        )

    picture, drawn = drawing(prefix, f"Friction against velocity, joint {name}", draw)
    caption = (
        _sample_keys(evidence.samples, "measured, fitted", "measured, held out") if drawn.samples else ""
    )
    caption += key("curve", "identified")
    if np.isfinite(drawn.half_width):
        caption += key("band", "±2 standard errors")
    caption += key("knot", "knots") if len(knots) else ""
    caption += key("truth", "truth") if truth is not None else ""
    if np.isfinite(drawn.half_width):
        caption += f"<br>The band is at most ±{quantity(drawn.half_width, unit, 2)}."
        lowest, widest = friction.validity.lowest_speed, int(np.nanargmax(evidence.curve.standard_error))
        if lowest and abs(evidence.curve.velocity[widest]) < lowest:
            slowest = quantity(lowest, f"{friction.joint.unit}/s", 2)
            caption += f" Below {slowest} the log holds too little sliding, so the band widens."
    else:
        caption += "<br>No band: the standard errors are not known."
    if drawn.beyond:
        caption += f" {esc(count_of(drawn.beyond, 'sample lies', 'samples lie'))} beyond the picture: triangles at its edge."
    if truth is not None:
        rms, worst = distance(evidence.curve, truth)
        caption += f" Against the truth: RMS {quantity(rms, unit, 2)}, at most {quantity(worst, unit, 2)}."
    return figure(picture, caption)


def enlargement(friction: JointFriction, evidence: JointEvidence, truth: Curve | None, prefix: str) -> str:
    """Return both directions of the curve against speed, enlarged."""

    def draw(axes: Any) -> str:
        return directions.draw_directions(
            axes, canvas.CSS, evidence.curve, friction.joint, samples=evidence.samples, truth=truth
        )

    label = f"Magnitude of friction against speed, both directions, joint {friction.joint.name}"
    picture, dotted = drawing(prefix, label, draw)
    both = np.any(evidence.curve.velocity < 0) and np.any(evidence.curve.velocity > 0)
    words = (
        "its two directions coincide"
        if directions.alike(evidence.curve)
        else "its two directions over one another"
    )
    caption = f"The same curve enlarged, {words}." if both else "The same curve enlarged."
    return figure(
        picture,
        (key("forth", f"{dotted}, +q and \u2212q") if dotted else "") + f"<br>{caption}",
    )


def distance(found: Curve, truth: Curve) -> tuple[float, float]:
    """Return the root mean square and the largest difference of two curves where both are known [N.m or N].

    The directions are compared apart, because a friction curve jumps at rest.
    """
    differences = []
    for sign in (-1.0, 1.0):
        a, b = found.velocity * sign > 0, truth.velocity * sign > 0
        if not (np.any(a) and np.any(b)):
            continue
        v, known = found.velocity[a], truth.velocity[b]
        inside = (v >= known.min()) & (v <= known.max())
        differences.append(found.torque[a][inside] - np.interp(v[inside], known, truth.torque[b]))
    every = np.concatenate([np.empty(0), *differences])
    if not every.size:
        return float("nan"), float("nan")
    return float(np.sqrt(np.mean(every**2))), float(np.max(np.abs(every)))


def residual_row(friction: JointFriction, evidence: JointEvidence, prefix: str) -> str:
    """Return the residual against time, velocity and position, with one common scale."""
    samples, joint = evidence.samples, friction.joint
    if not np.any(np.isfinite(samples.residual)):
        return '<p class="muted">The result carries no samples, so there is no residual to show.</p>'
    scale = residuals.common_scale(samples)
    pictures, absent, median = [], [], False
    for against in residuals.AGAINST:
        values = getattr(samples, against)
        values = values[np.isfinite(values)]
        if not values.size or (against == "time" and values.min() == values.max()):
            absent.append(against)
            continue

        def draw(axes: Any, against: str = against) -> bool:
            return residuals.draw_residual(axes, canvas.CSS, samples, joint, against, scale)

        label = f"Residual torque against {against}, joint {joint.name}"
        picture, told = drawing(f"{prefix}-{against}", label, draw, canvas.SMALL)
        pictures.append(f"<figure>{picture}</figure>")
        median = median or told
    caption = _sample_keys(samples, "fitted", "held out")
    caption += key("curve", "median of equal intervals") if median else ""
    caption += (
        "<br>Measured minus predicted torque. A good model leaves noise around zero; a curved median line shows friction "
        "that the model misses."
    )
    if scale.beyond:
        caption += (
            f" {esc(count_of(scale.beyond, 'sample lies', 'samples lie'))} beyond the scale, "
            f"up to {quantity(scale.worst, joint.torque_unit)}: triangles at its edge."
        )
    caption += _period(friction, evidence)
    if "time" in absent:
        caption += (
            " Each sample summarizes a whole log, so there is nothing to show against time and position."
        )
    elif "position" in absent:
        caption += " The log holds no position."
    return f'<h3>Residual</h3><div class="grid residuals">{"".join(pictures)}</div><p class="legend">{caption}</p>'


CHANCE = 1e-3  # largest probability that noise alone explains a wave that is reported [-]


def _period(friction: JointFriction, evidence: JointEvidence) -> str:
    """Return a sentence on the position period found in the residual, or on its absence."""
    wave = None if evidence.residual is None else evidence.residual.slides.over_position[0]
    if wave is None or not wave.wave:
        return ""
    if not wave.chance <= CHANCE:
        return " No period of position stands out of the noise."
    joint = friction.joint
    period = 2.0 * np.pi / wave.wave
    turns = f", {number(wave.wave)} a turn" if joint.unit == "rad" else ""
    return (
        f" Against position, a wave with a period of {quantity(period, joint.unit)}{turns} stands out: "
        f"{quantity(wave.size, joint.torque_unit)} (RMS)."
    )


def presliding(friction: JointFriction, loop: np.ndarray, prefix: str) -> str:
    """Return the presliding loop of a torque ramp."""

    def draw(axes: Any) -> None:
        residuals.draw_presliding(axes, canvas.CSS, loop, friction.joint)

    picture, _ = drawing(
        prefix, f"Torque against displacement before sliding, joint {friction.joint.name}", draw
    )
    words = "Torque against displacement during a ramp, before the joint slides. The slope is the presliding stiffness."
    return figure(picture, words)
