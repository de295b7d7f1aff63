"""The friction curve: measured samples, the identified curve with its confidence band, its knots, and the truth if known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from backdrive.identification.result import Curve, JointEvidence, Samples
from backdrive.logs.log import Joint
from backdrive.model import FrictionModel
from backdrive.report.pictures import canvas, sizes
from backdrive.report.pictures.canvas import Theme
from backdrive.report.pictures.legend import curve_legend, joint_title
from backdrive.report.pictures.model_curve import knots_of, model_curve

SIGMAS = 2.0  # half width of the band in standard errors


@dataclass(frozen=True, kw_only=True)
class CurveDrawing:
    """Facts on a drawn curve for its caption.

    Attributes:
        samples: number of dots.
        beyond: samples outside the picture's range.
        half_width: largest half width of the band [N.m or N]; NaN without a band.
    """

    samples: int
    beyond: int
    half_width: float


def draw_curve(
    axes: Any,
    theme: Theme,
    curve: Curve,
    joint: Joint,
    *,
    samples: Samples | None = None,
    knots: np.ndarray | None = None,
    truth: Curve | None = None,
    most: int = 1500,
) -> CurveDrawing:
    """Draw a friction curve.

    Args:
        axes: matplotlib axes.
        theme: colours.
        curve: with its standard errors.
        joint: for the units.
        samples: measured friction against velocity.
        knots: velocity and torque of the points that define the curve, (k, 2).
        truth: a second curve, dashed.
        most: dots at most.
    """
    v_factor, v_unit = sizes.readable(sizes.largest(curve.velocity), f"{joint.unit}/s")
    spread = SIGMAS * curve.standard_error
    low, high = _range(curve, spread, samples, truth)
    f_factor, f_unit = sizes.readable(max(abs(low), abs(high)), canvas.pretty_unit(joint.torque_unit))
    shown = beyond = 0
    if samples is not None:
        seen = np.isfinite(samples.friction) & np.isfinite(samples.velocity)
        beyond = int(np.count_nonzero(seen & ((samples.friction < low) | (samples.friction > high))))
        pick = sizes.thin(samples.time.size, most)
        shown = int(np.count_nonzero(seen[pick]))
        for fitted, color in ((True, theme.fitted), (False, theme.held_out)):
            part = pick[samples.fitted[pick] == fitted]
            x, y = samples.velocity[part] * v_factor, samples.friction[part] * f_factor
            canvas.dots(axes, theme, x, y, color, within=(low * f_factor, high * f_factor))
    for side in (curve.velocity < 0, curve.velocity > 0):
        v, f, s = curve.velocity[side] * v_factor, curve.torque[side] * f_factor, spread[side] * f_factor
        if np.any(np.isfinite(s)):
            axes.fill_between(v, f - s, f + s, color=theme.band, alpha=0.38, linewidth=0, zorder=3)
        axes.plot(v, f, color=theme.ink, linewidth=1.6, zorder=4)
    _standstill(axes, theme, curve, v_factor, f_factor)
    if truth is not None:
        for side in (truth.velocity < 0, truth.velocity > 0):
            canvas.truth_line(axes, theme, truth.velocity[side] * v_factor, truth.torque[side] * f_factor)
    if knots is not None and len(knots):
        ends = sizes.largest(curve.velocity) * (1.0 + 1e-9)
        knots = knots[np.abs(knots[:, 0]) <= ends]  # the other knots lie outside the range of the data
        circles = canvas.markers(theme, 4.2, theme.ink)
        axes.plot(knots[:, 0] * v_factor, knots[:, 1] * f_factor, markeredgewidth=1.1, zorder=6, **circles)
    canvas.zero_line(axes, theme)
    axes.set_ylim(low * f_factor, high * f_factor)
    left, right = _velocities(curve, samples)
    pad = 0.035 * (right - left)
    axes.set_xlim((left - pad) * v_factor, (right + pad) * v_factor)
    canvas.name_axes(axes, theme, x=f"velocity [{v_unit}]", y=f"friction [{f_unit}]")
    return CurveDrawing(
        samples=shown,
        beyond=beyond,
        half_width=sizes.largest(spread) if np.any(np.isfinite(spread)) else np.nan,
    )


def _standstill(axes: Any, theme: Theme, curve: Curve, v_factor: float, f_factor: float) -> None:
    """At rest the torque may have any value between the branches: join them by a thin vertical line."""
    back, forth = curve.torque[curve.velocity < 0], curve.torque[curve.velocity > 0]
    if back.size and forth.size:
        axes.plot(
            [0.0, 0.0], [back[-1] * f_factor, forth[0] * f_factor], color=theme.ink, linewidth=0.8, zorder=4
        )


def _velocities(curve: Curve, samples: Samples | None) -> tuple[float, float]:
    parts = [curve.velocity, np.zeros(1)]
    if samples is not None:
        parts.append(samples.velocity)
    every = np.concatenate(parts)
    every = every[np.isfinite(every)]
    low, high = float(every.min()), float(every.max())
    return (low, high) if high > low else (-1.0, 1.0)


def _range(
    curve: Curve, spread: np.ndarray, samples: Samples | None, truth: Curve | None
) -> tuple[float, float]:
    """Return axis limits that contain the curve, its band and the samples without the most extreme 1 %."""
    band = np.where(np.isfinite(spread), spread, 0.0)
    parts = [curve.torque, np.zeros(1)]
    height = sizes.largest(curve.torque)
    parts += [np.clip(curve.torque + s * band, -2.5 * height, 2.5 * height) for s in (-1, 1)]
    if truth is not None:
        parts.append(truth.torque)
    if samples is not None:
        friction = samples.friction[np.isfinite(samples.friction)]
        if friction.size:
            parts.append(np.percentile(friction, [0.5, 99.5]))
    every = np.concatenate(parts)
    every = every[np.isfinite(every)]
    low, high = float(every.min()), float(every.max())
    if high == low:
        return -1.0, 1.0
    pad = 0.08 * (high - low)
    return low - pad, high + pad


def save_curves(
    path: str | Path,
    model: FrictionModel,
    *,
    evidence: Sequence[JointEvidence] = (),
    truth: Mapping[str, Curve] | None = None,
    dark: bool = False,
    scale: float = 2.0,
) -> Path:
    """Write one picture with the friction curve of every joint, PNG or SVG by the file's suffix.

    Args:
        path: ending in `.png` or `.svg`.
        model: its joints are drawn side by side, at most three in a row.
        evidence: measured samples and curves, by joint; without it, the model's own curve is drawn.
        truth: curves to compare with, by joint.
        dark: light on dark.
        scale: pixels per point of a PNG [1].

    Raises:
        InvalidInput: another suffix, or the folder cannot be written.
        MissingExtra: matplotlib is not installed.
    """
    with canvas.house_style():
        return canvas.write(
            curves(model, evidence=evidence, truth=truth, theme=canvas.DARK if dark else canvas.LIGHT),
            path,
            scale,
        )


def curves(
    model: FrictionModel,
    *,
    evidence: Sequence[JointEvidence] = (),
    truth: Mapping[str, Curve] | None = None,
    theme: canvas.Theme = canvas.LIGHT,
    names: tuple[str, str] = ("identified", "truth"),
) -> Any:
    """Return the figure that `save_curves` writes; `names`: of the curve, and of the one to compare with."""
    shown = {e.joint: e for e in evidence}
    columns = min(3, len(model.joints))
    rows = -(-len(model.joints) // columns)
    title = 20.0 if len(model.joints) > 1 else 0.0
    width, height = canvas.WIDTH + 30.0, canvas.HEIGHT + 14.0 + title
    with canvas.house_style():
        figure = canvas.new_figure(theme, columns * width, rows * height)
        for i, friction in enumerate(model.joints):
            left, bottom = (i % columns) * width, (rows - 1 - i // columns) * height
            box = (left + 50.0, bottom + 40.0, width - 68.0, height - 66.0 - title)
            axes = canvas.axes_of(figure, theme, box)
            found = shown.get(friction.joint.name)
            curve = found.curve if found else model_curve(friction)
            knots = knots_of(friction)
            true = (truth or {}).get(friction.joint.name)
            draw_curve(
                axes,
                theme,
                curve,
                friction.joint,
                samples=found.samples if found else None,
                knots=knots,
                truth=true,
            )
            if i == 0:
                curve_legend(axes, theme, found, curve, true is not None, bool(len(knots)), names)
            if title:
                joint_title(figure, theme, friction.joint.name, left + 12.0, bottom + height - 18.0)
        return figure
