"""What the pictures of chapter 2 share: a sheet of panels, their names, their colours."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.report.pictures import canvas
from backdrive.report.pictures.canvas import LIGHT

SMALL = canvas.FONT_SIZE - 1.5  # type of legends [pt]
SERIES = ("#b3261e", "#d9730d", "#00845a", "#2a78b8", "#5b3fa0")  # five of one kind, in order
BEFORE, AFTER = LIGHT.ink, LIGHT.fitted  # without and with something
DASHED = (0, (4, 2.6))


def sheet(
    rows: int, columns: int, *, width: float = 688.0, height: float = 300.0, **how: Any
) -> tuple[Any, Any]:
    """Return a figure and its panels, (rows, columns) axes.

    Args:
        rows: of panels.
        columns: of panels.
        width: of the sheet [pt].
        height: of the sheet [pt].
        **how: for matplotlib's `subplots`.
    """
    figure = canvas.new_figure(LIGHT, width, height)
    figure.set_layout_engine("constrained", w_pad=6 / 72, h_pad=6 / 72, wspace=0.03, hspace=0.05)
    axes = figure.subplots(rows, columns, squeeze=False, **how)
    for a in axes.flat:
        _dress(a)
    return figure, axes


def panel(figure: Any, place: Any) -> Any:
    """Return one more panel of a figure, at a place of its grid."""
    a = figure.add_subplot(place)
    _dress(a)
    return a


def _dress(a: Any) -> None:
    """Give a panel the look of the house."""
    a.set_facecolor("none")
    for side in ("top", "right", "left"):
        a.spines[side].set_visible(False)
    a.spines["bottom"].set_color(LIGHT.muted)
    a.grid(True, color=LIGHT.grid, linewidth=0.7)
    a.tick_params(colors=LIGHT.muted, labelcolor=LIGHT.muted, labelsize=SMALL)


def name(axes: Any, title: str = "", x: str = "", y: str = "") -> None:
    """Write a panel's title and the names of its axes, with units."""
    if title:
        axes.set_title(title, loc="left", color=LIGHT.ink, fontweight="bold", parse_math=False)
    axes.set_xlabel(x, color=LIGHT.ink)
    axes.set_ylabel(y, color=LIGHT.ink)


def key(axes: Any, where: str = "best", columns: int = 1, **how: Any) -> None:
    """Write the legend of a panel."""
    legend = axes.legend(
        loc=where,
        ncols=columns,
        fontsize=SMALL,
        labelcolor=LIGHT.ink,
        facecolor=LIGHT.paper,
        edgecolor="none",
        framealpha=0.85,
        handlelength=1.5,
        handletextpad=0.5,
        columnspacing=1.0,
        borderpad=0.2,
        **how,
    )
    legend.set_zorder(9)


def thin(x: np.ndarray, y: np.ndarray, step: int) -> tuple[np.ndarray, np.ndarray]:
    """Return every `step`-th sample, for lines that are smooth on the paper."""
    return x[::step], y[::step]


def joint_title(joint: str) -> str:
    """Return a joint's name as a title: `joint_1` becomes `Joint 1`."""
    return joint.replace("_", " ").capitalize()


def bars(axes: Any, groups: list[str], values: dict[str, list[float]], colors: dict[str, str]) -> None:
    """Draw groups of bars.

    Args:
        axes: to draw on.
        groups: names along the abscissa.
        values: name of a series -> one value a group; NaN draws a cross at the foot.
        colors: of the series.
    """
    n = len(values)
    width = 0.8 / n
    for i, (label, heights) in enumerate(values.items()):
        x = np.arange(len(groups)) + (i - 0.5 * (n - 1)) * width
        h = np.array(heights, dtype=np.float64)
        axes.bar(x, np.nan_to_num(h), 0.92 * width, color=colors[label], label=label, zorder=2)
        for lost in x[~np.isfinite(h)]:
            axes.annotate("×", (lost, 0), ha="center", va="bottom", color=colors[label])
    axes.set_xticks(np.arange(len(groups)), groups)
    axes.grid(False, axis="x")
