"""Legends, and the joint name of a friction curve that is drawn outside a report, where it has no caption."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.identification.result import Curve, JointEvidence
from backdrive.report.pictures import canvas
from backdrive.report.pictures.canvas import Theme


def curve_legend(
    axes: Any,
    theme: Theme,
    evidence: JointEvidence | None,
    curve: Curve,
    truth: bool,
    knots: bool,
    names: tuple[str, str] = ("identified", "truth"),
) -> None:
    """Write the legend of a friction curve into the empty corner, upper left.

    Args:
        axes: that the curve is drawn on.
        theme: colours.
        evidence: whose samples are drawn, if any.
        curve: drawn.
        truth: a true curve is drawn, too.
        knots: knots are drawn, too.
        names: of the curve, and of the one to compare with.
    """
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    def dot(color: str, label: str):
        return Line2D([], [], linestyle="none", marker="o", markersize=4, color=color, label=label)

    handles: list[Any] = []
    if evidence is not None:
        seen = evidence.samples.fitted
        handles += [dot(theme.fitted, "measured")] if np.any(seen) else []
        handles += [dot(theme.held_out, "measured, held out")] if not np.all(seen) else []
    handles.append(Line2D([], [], color=theme.ink, linewidth=1.6, label=names[0]))
    if np.any(np.isfinite(curve.standard_error)):
        handles.append(Patch(color=theme.band, alpha=0.38, linewidth=0, label="±2 standard errors"))
    if knots:
        handles.append(Line2D([], [], label="knots", **canvas.markers(theme, 4.2, theme.ink)))
    if truth:
        handles.append(
            Line2D([], [], color=theme.truth, linewidth=1.7, linestyle=canvas.DASHED, label=names[1])
        )
    legend = axes.legend(
        handles=handles,
        loc="upper left",
        facecolor=theme.paper,
        edgecolor="none",
        framealpha=0.9,
        fontsize=canvas.FONT_SIZE - 1.5,
        labelcolor=theme.ink,
        handlelength=1.6,
        borderaxespad=0.2,
        labelspacing=0.35,
    )
    legend.set_zorder(9)


def corner_legend(
    figure: Any, handles: list[Any], labels: list[str], corner: tuple[float, float], place: str, color: str
) -> None:
    """Write a legend in one line and without a frame at a corner of a figure, above its pictures.

    Args:
        figure: of matplotlib.
        handles: what is named.
        labels: their words.
        corner: of the figure, shares of its width and height [-].
        place: part of the legend that lies there, such as `upper right`.
        color: of the words.
    """
    figure.legend(
        handles,
        labels,
        loc=place,
        bbox_to_anchor=corner,
        ncols=len(handles),
        frameon=False,
        labelcolor=color,
        fontsize=canvas.FONT_SIZE - 1.5,
        handlelength=1.6,
        borderpad=0,
        borderaxespad=0,
    )


def joint_title(figure: Any, theme: Theme, name: str, x: float, y: float) -> None:
    """Write a joint's name above its picture, at x and y [pt], as plain text whatever it holds."""
    width, height = figure.get_size_inches() * 72.0
    short = name if len(name) <= 40 else f"{name[:39]}…"
    plain = "".join(c if c.isprintable() else "\ufffd" for c in short)
    figure.text(x / width, y / height, plain, color=theme.ink, fontweight="bold", parse_math=False)
