"""Grid lines, tick labels and the name of the horizontal axis, drawn by one artist instead of five for each tick.

matplotlib makes a tick of two marks, a grid line and two labels, whose making and layout take half of the time of a small picture.
Where ticks are, and what is written there, stays with its locators and formatters. Minor ticks are not drawn.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import XAxis, YAxis
from matplotlib.path import Path
from matplotlib.text import Text
from matplotlib.transforms import IdentityTransform

from backdrive.report.pictures.renderer import PageRenderer

LINE = 0.7  # width of a grid line [pt]
BELOW, NAME = 15.0, 30.5  # from the lower edge to the base lines of the labels and of the name [pt]
LEFT, DOWN = 4.0, 4.0  # from the left edge to the labels' ends, from a grid line to their base line [pt]
ABOVE = 8.0  # from the upper edge to the base line of what is written above it [pt]
NEAR = 0.5  # outside of the range within which a tick counts as at its edge [px]
BEHIND = 0.5  # place in the order of drawing, as matplotlib's for an axis below the lines


class _Across(XAxis):
    """A horizontal axis that makes no ticks in order to clip them."""

    set_clip_path = Artist.set_clip_path


class _Up(YAxis):
    """A vertical axis that makes no ticks in order to clip them."""

    set_clip_path = Artist.set_clip_path


class Bare(Axes):
    """Axes whose ticks `Ticks` draws."""

    def _init_axis(self) -> None:  # overridden by projections, as by matplotlib's own
        self.xaxis, self.yaxis = _Across(self, clear=False), _Up(self, clear=False)
        for side, axis in (
            ("bottom", self.xaxis),
            ("top", self.xaxis),
            ("left", self.yaxis),
            ("right", self.yaxis),
        ):
            self.spines[side].register_axis(axis)

    def grid(self, *_: Any, **__: Any) -> None:
        """Do nothing: matplotlib's ticks are made as soon as anything is set for them, if only that they have no grid."""

    tick_params = grid


class Ticks(Artist):
    """The ticks of both axes.

    Args:
        axes: to draw on; those of matplotlib are hidden.
        grid: colour of the lines.
        muted: colour of the labels.
        ink: colour of the name.
        size: of the type [pt].

    Attributes:
        labelled: whether the horizontal axis has labels.
    """

    def __init__(self, axes: Any, *, grid: str, muted: str, ink: str, size: float):
        super().__init__()
        self.labelled = True
        self.grid, self.muted, self.ink, self.size = grid, muted, ink, size
        self.set_zorder(BEHIND)
        self._text = Text(fontsize=size, transform=IdentityTransform())
        axes.xaxis.set_visible(False)
        axes.yaxis.set_visible(False)
        axes.add_artist(self)
        self.set_clip_on(False)
        self._text.set_figure(axes.get_figure())

    def get_window_extent(self, renderer: Any = None) -> Any:
        """Return the box of the axes."""
        return self.axes.get_window_extent(renderer)  # type: ignore[union-attr]

    def draw(self, renderer: Any) -> None:
        """Draw the lines at once, then each label."""
        axes: Any = self.axes
        box, point = axes.bbox, renderer.points_to_pixels(1.0)
        columns, below, x_power = _marks(axes.xaxis, box.x0, box.x1)
        rows, beside, y_power = _marks(axes.yaxis, box.y0, box.y1)
        ends = [[(x, box.y0), (x, box.y1)] for x in columns] + [[(box.x0, y), (box.x1, y)] for y in rows]
        if ends:
            context = renderer.new_gc()
            context.set_foreground(self.grid)
            context.set_linewidth(LINE)
            codes = np.array([Path.MOVETO, Path.LINETO] * len(ends), dtype=Path.code_type)
            renderer.draw_path(context, Path(np.array(ends).reshape(-1, 2), codes), IdentityTransform())
            context.restore()
        if self.labelled:
            for x, word in zip(columns, below, strict=True):
                self._write(renderer, word, x, box.y0 - BELOW * point, "center", self.muted)
            self._write(renderer, x_power, box.x1, box.y0 - NAME * point, "right", self.muted)
        for y, word in zip(rows, beside, strict=True):
            self._write(renderer, word, box.x0 - LEFT * point, y - DOWN * point, "right", self.muted)
        self._write(renderer, y_power, box.x1, box.y1 + ABOVE * point, "right", self.muted)
        middle = 0.5 * (box.x0 + box.x1)
        self._write(renderer, axes.get_xlabel(), middle, box.y0 - NAME * point, "center", self.ink)

    def _write(self, renderer: Any, word: str, x: float, y: float, side: Any, color: str) -> None:
        if word and isinstance(renderer, PageRenderer) and "$" not in word:  # no formula
            renderer.write(word, x, renderer.height - y, self.size, color, side=side)
        elif word:
            self._text.update({"text": word, "position": (x, y), "ha": side, "color": color})
            self._text.draw(renderer)


def ticks_of(axes: Any) -> Ticks:
    """Return the ticks of axes that `canvas.axes_of` made."""
    return next(artist for artist in axes.artists if isinstance(artist, Ticks))


def _marks(axis: Any, least: float, most: float) -> tuple[list[float], list[str], str]:
    """Return where an axis' ticks lie [px], their labels, and the power of ten that belongs to all of them."""
    at = np.asarray(axis.get_majorticklocs(), dtype=float)
    if not at.size:
        return [], [], ""
    words = axis.get_major_formatter().format_ticks(at)
    both = np.column_stack([at, at])
    places = axis.axes.transData.transform(both)[:, 0 if axis.axis_name == "x" else 1]
    inside = (places >= least - NEAR) & (places <= most + NEAR)
    return (
        places[inside].tolist(),
        [word for word, seen in zip(words, inside, strict=True) if seen],
        axis.get_major_formatter().get_offset(),
    )
