"""Picture of a log: motion on the left and torque on the right over time, a row a joint."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.logs.log import Log, channel_unit
from backdrive.report.pictures import canvas, sizes
from backdrive.report.pictures.canvas import Theme
from backdrive.report.words import plain

ROW, GAP = 92.0, 36.0  # height of a row and between rows [pt]
LEFT, RIGHT, TOP, BOTTOM = 46.0, 10.0, 34.0, 40.0  # margins [pt]
MOST = 12  # joints that are drawn
BINS = 700  # of a line, each drawn by its least and largest sample
NAMES = {"position": "q", "velocity": "dq", "torque": "τ", "drive_input": "input"}


def log_figure(log: Log, theme: Theme = canvas.LIGHT) -> Any:
    """Return a figure of a log: position (or velocity) and torque (or the drive's input) of its first twelve joints.

    Args:
        log: of two samples or more.
        theme: colours.

    Raises:
        MissingExtra: matplotlib is not installed.
    """
    pairs = (("position", "velocity"), ("torque", "drive_input"))
    shown = [next((c for c in pair if c in log.channels), None) for pair in pairs]
    channels = [c for c in shown if c is not None]
    rows = min(len(log.joints), MOST)
    width, height = 2.0 * canvas.WIDTH, TOP + BOTTOM + rows * ROW + (rows - 1) * GAP
    wide = (width - len(channels) * (LEFT + RIGHT)) / len(channels)
    order = np.argsort(log.time, kind="stable")
    order = order[np.isfinite(log.time[order])]
    with canvas.house_style():
        figure = canvas.new_figure(theme, width, height)
        for j, joint in enumerate(log.joints[:rows]):
            bottom = BOTTOM + (rows - 1 - j) * (ROW + GAP)
            for k, channel in enumerate(channels):
                box = (LEFT + k * (wide + LEFT + RIGHT), bottom, wide, ROW)
                axes = canvas.axes_of(figure, theme, box)
                values = log.channels[channel][order, j]
                factor, unit = sizes.readable(
                    sizes.largest(values), canvas.pretty_unit(channel_unit(channel, joint))
                )
                pick = sizes.extremes(values, BINS)
                color = theme.ink if k == 0 else theme.fitted
                axes.plot(log.time[order][pick], factor * values[pick], color=color, linewidth=1.0, zorder=3)
                last = j == rows - 1
                canvas.name_axes(
                    axes,
                    theme,
                    x="time [s]" if last else "",
                    y=f"{NAMES[channel]} [{unit}], {_short(joint.name)}",
                )
                if not last:
                    canvas.hide_labels(axes)
    return figure


def _short(name: str) -> str:
    """Return a joint's name, at most 40 characters, without what matplotlib would read as a formula."""
    short = plain(name if len(name) <= 40 else f"{name[:39]}…")
    return short.replace("$", r"\$")
