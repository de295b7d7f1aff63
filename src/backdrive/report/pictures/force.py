"""The external torque on each joint over time, with its 95 % band, contacts, and the measured torque if the log holds it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from backdrive.external import Contact, ForceEstimate, JointForce
from backdrive.external.result import STATES
from backdrive.report.pictures import canvas, sizes
from backdrive.report.pictures.canvas import LIGHT, Theme
from backdrive.report.pictures.legend import corner_legend

WIDTH, HEIGHT = 640, 190  # of a joint [pt]
LEGEND = 16.0  # its height at the top [pt]
BINS = 500  # of time, of which each shows its extremes
EPOCH = 1e5  # instants beyond are drawn from the first one on [s]
MARGIN = 0.03  # to the right, by the duration [-]
THINNEST = 0.006  # width of a contact by that of the picture, at least [-]


def save_force(path: str | Path, estimate: ForceEstimate, theme: Theme = LIGHT) -> Path:
    """Draw all joints, one below the other, into an SVG or PNG file.

    Args:
        path: ends in .svg or .png.
        estimate: of one or more joints.
        theme: colours.
    """
    with canvas.house_style():
        count = len(estimate.joints)
        figure = canvas.new_figure(theme, WIDTH, HEIGHT * count + LEGEND)
        for k, one in enumerate(estimate.joints):
            bottom = (count - 1 - k) * HEIGHT
            axes = canvas.axes_of(figure, theme, (44.0, bottom + 38.0, WIDTH - 58.0, HEIGHT - 74.0))
            draw_force(axes, theme, one, estimate.contacts or ())
            title = f"{one.joint.name}: {one.method}, {one.bandwidth:.3g} 1/s"
            axes.set_title(title, loc="right", color=theme.ink, pad=8)
        force_legend(figure, theme, estimate)
        return canvas.write(figure, path)


def draw_force(axes: Any, theme: Theme, one: JointForce, contacts: Sequence[Contact] = ()) -> None:
    """Draw the estimate of a joint with its band, rests, contacts, and the known torque.

    Args:
        axes: matplotlib axes.
        theme: colours.
        one: the estimate.
        contacts: of the log; those of other joints are not drawn.
    """
    pick, begin, words = _clock(one)
    t = one.time[pick] - begin
    factor, unit = sizes.readable(sizes.largest(one.force), canvas.pretty_unit(one.joint.torque_unit))
    if np.isfinite(one.lower).any():
        lower, upper = one.lower[pick] * factor, one.upper[pick] * factor
        axes.fill_between(t, lower, upper, color=theme.band, alpha=0.25, linewidth=0.0, zorder=1)
    axes.axhline(0.0, color=theme.muted, linewidth=0.8, zorder=2)
    axes.plot(t, one.force[pick] * factor, color=theme.fitted, linewidth=1.1, zorder=4, label="estimated")
    if one.known is not None:
        canvas.truth_line(axes, theme, t, one.known[pick] * factor)
    resting = np.where(one.state[pick] == STATES.index("rest"), 0.0, np.nan)
    axes.plot(t, resting, color=theme.ink, linewidth=2.4, zorder=3)
    least = THINNEST * float(t[-1] - t[0])
    for contact in contacts:
        if one.joint.name in contact.forces and contact.begin <= one.time[-1] and contact.end >= one.time[0]:
            left, right = max(contact.begin, one.time[0]) - begin, min(contact.end, one.time[-1]) - begin
            axes.axvspan(
                left, max(right, left + least), color=theme.held_out, alpha=0.25, linewidth=0.0, zorder=0
            )
    axes.set_xlim(float(t[0]), float(t[-1]) + MARGIN * float(t[-1] - t[0]))
    canvas.name_axes(
        axes,
        theme,
        x=words,
        y=f"external torque [{unit}]" if one.joint.unit == "rad" else f"external force [{unit}]",
    )


def force_legend(figure: Any, theme: Theme, estimate: ForceEstimate) -> None:
    """Write at the top what lines, band and shading mean, of those that occur.

    Args:
        figure: with `LEGEND` points of room at its top.
        theme: colours.
        estimate: that is drawn.
    """
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    joints = estimate.joints
    handles: list[Any] = [Line2D([], [], color=theme.fitted, linewidth=1.1, label="estimated")]
    if any(np.isfinite(one.lower).any() for one in joints):
        handles.append(Patch(color=theme.band, alpha=0.25, linewidth=0, label="95 % band"))
    if any(one.known is not None for one in joints):
        handles.append(Line2D([], [], color=theme.truth, linestyle=canvas.DASHED, label="known"))
    if any(np.any(one.state == STATES.index("rest")) for one in joints):
        handles.append(Line2D([], [], color=theme.ink, linewidth=2.4, label="at rest"))
    if estimate.contacts:
        handles.append(Patch(color=theme.held_out, alpha=0.25, linewidth=0, label="contact"))
    width, height = figure.get_size_inches() * 72.0
    corner = 1.0 - 14.0 / width, 1.0 - 4.0 / height
    corner_legend(figure, handles, [h.get_label() for h in handles], corner, "upper right", theme.ink)


def draw_friction(axes: Any, theme: Theme, one: JointForce) -> None:
    """Draw the friction that was taken off, and where the joint rests.

    Args:
        axes: matplotlib axes.
        theme: colours.
        one: the estimate.
    """
    pick, begin, words = _clock(one, one.friction)
    t = one.time[pick] - begin
    factor, unit = sizes.readable(sizes.largest(one.friction), canvas.pretty_unit(one.joint.torque_unit))
    axes.axhline(0.0, color=theme.muted, linewidth=0.8, zorder=2)
    axes.plot(t, one.friction[pick] * factor, color=theme.ink, linewidth=1.1, zorder=4)
    resting = np.where(one.state[pick] == STATES.index("rest"), 0.0, np.nan)
    axes.plot(t, resting, color=theme.ink, linewidth=2.4, zorder=3)
    axes.set_xlim(float(t[0]), float(t[-1]) + MARGIN * float(t[-1] - t[0]))
    canvas.name_axes(axes, theme, x=words, y=f"friction [{unit}]")


def _clock(one: JointForce, series: np.ndarray | None = None) -> tuple[np.ndarray, float, str]:
    """Return which samples are drawn, the instant that is drawn at 0 [s], and the name of the axis."""
    begin = float(one.time[0]) if abs(one.time[0]) > EPOCH else 0.0
    words = f"time [s] from {begin:.3f} s on" if begin else "time [s]"
    return sizes.extremes(one.force if series is None else series, BINS), begin, words
