"""The external torque on each joint over time, with its 95 % band, and the torque that is known where the log holds one."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from backdrive.external import ForceEstimate
from backdrive.report.pictures import canvas, sizes
from backdrive.report.pictures.canvas import LIGHT, Theme

WIDTH, HEIGHT = 640, 190  # of a joint [pt]


def save_force(path: str | Path, estimate: ForceEstimate, theme: Theme = LIGHT) -> Path:
    """Draw all joints, one below the other, into an SVG or PNG file.

    Args:
        path: ends in .svg or .png.
        estimate: of one or more joints.
        theme: colours.
    """
    with canvas.house_style():
        count = len(estimate.joints)
        figure = canvas.new_figure(theme, WIDTH, HEIGHT * count)
        for k, one in enumerate(estimate.joints):
            bottom = (count - 1 - k) * HEIGHT
            axes = canvas.axes_of(figure, theme, (44.0, bottom + 38.0, WIDTH - 58.0, HEIGHT - 74.0))
            pick = sizes.thin(one.time.size, keep=one.force)
            t = one.time[pick] - one.time[0]
            factor, unit = sizes.scaled(sizes.largest(one.force), canvas.pretty_unit(one.joint.torque_unit))
            force = one.force[pick] * factor
            if np.isfinite(one.lower).any():
                lower, upper = one.lower[pick] * factor, one.upper[pick] * factor
                axes.fill_between(t, lower, upper, color=theme.band, alpha=0.25, linewidth=0.0, zorder=1)
            axes.axhline(0.0, color=theme.muted, linewidth=0.8, zorder=2)
            axes.plot(t, force, color=theme.fitted, linewidth=1.1, zorder=4, label="estimated")
            if one.known is not None:
                canvas.truth_line(axes, theme, t, one.known[pick] * factor)
            resting = np.where(one.state[pick] == 2, 0.0, np.nan)
            axes.plot(t, resting, color=theme.ink, linewidth=2.4, zorder=3)
            title = f"{one.joint.name}: {one.method}, {one.bandwidth:.3g} 1/s; 95 % band grey, at rest a line"
            axes.set_title(title, loc="right", color=theme.ink, pad=8)
            canvas.name_axes(axes, theme, x="time [s]", y=f"external [{unit}]")
        return canvas.write(figure, path)
