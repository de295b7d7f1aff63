"""An arm guided by hand: the hand's force in several runs, and the joints' positions within their ranges in the last one."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.plans.limits import JointLimits
from backdrive.report.pictures import canvas
from backdrive.report.pictures.canvas import DASHED, LIGHT, Theme
from backdrive.simulation.arm import ArmRecord

WIDTH, FORCE, RANGE = 640, 230, 300  # of the picture, of its parts [pt]
LANE = 0.42  # half of a joint's lane, in which its range lies


def save_guide(
    path: str | Path,
    records: Mapping[str, ArmRecord],
    limits: Mapping[str, JointLimits],
    theme: Theme = LIGHT,
) -> Path:
    """Draw runs of the same hand into an SVG or PNG file.

    Args:
        path: ends in .svg or .png.
        records: by name, at most three; the joints of the last are drawn.
        limits: of its joints, in their order.
        theme: colours.

    Raises:
        InvalidInput: there is no record, or there are more than can be told apart.
    """
    if not 1 <= len(records) <= 3:
        raise InvalidInput(f"{len(records)} runs.", remedy="Give one to three.")
    last = list(records.values())[-1]
    with canvas.house_style():
        figure = canvas.new_figure(theme, WIDTH, FORCE + RANGE)
        axes = canvas.axes_of(figure, theme, (54.0, RANGE + 38.0, WIDTH - 68.0, FORCE - 66.0))
        colors = (theme.held_out, theme.fitted, theme.truth)
        for color, (name, record) in zip(colors, records.items(), strict=False):
            size = np.linalg.norm(record.force, axis=1)
            label = f"{name}: mean {size.mean():.0f} N, at most {size.max():.0f} N"
            axes.plot(record.time, size, color=color, linewidth=1.2, label=label)
        axes.legend(
            loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=len(records), frameon=False, fontsize=9.5
        )
        axes.set_xlim(0.0, float(last.time[-1]))
        axes.set_ylim(bottom=0.0)
        canvas.name_axes(axes, theme, x="", y="hand's force [N]")

        axes = canvas.axes_of(figure, theme, (54.0, 40.0, WIDTH - 68.0, RANGE - 56.0))
        for j, (name, own) in enumerate(limits.items()):
            lane = -float(j)
            axes.axhline(lane + LANE, color=theme.muted, linewidth=0.8, linestyle=DASHED)
            axes.axhline(lane - LANE, color=theme.muted, linewidth=0.8, linestyle=DASHED)
            middle, size = 0.5 * (own.lower + own.upper), own.upper - own.lower
            place = lane + 2.0 * LANE * (last.load[:, j] - middle) / size
            axes.plot(last.time, place, color=theme.ink, linewidth=1.2)
            axes.text(0.005 * float(last.time[-1]), lane + 0.12, name, color=theme.muted, fontsize=9.5)
        axes.set_xlim(0.0, float(last.time[-1]))
        axes.set_ylim(0.4 - len(limits), 0.6)
        canvas.name_axes(axes, theme, x="time [s]", y="joints within their ranges (dashed)")
        axes.set_yticks([])
        return canvas.write(figure, path)
