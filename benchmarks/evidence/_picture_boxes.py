"""Where the texts of a picture lie, as matplotlib draws them: which overlap, and which are cut at its edge."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

SLACK = 1.0  # that two boxes may share, for the empty rim of a glyph's box [pt]
Box = tuple[str, float, float, float, float]  # text, left, bottom, right, top [px]


def boxes_of(figure: Any) -> list[Box]:
    """Return text and box of everything that is written when the figure is drawn."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.text import Text

    written: list[Box] = []
    draw = Text.draw

    def record(text: Any, renderer: Any, *arguments: Any, **options: Any) -> Any:
        if text.get_visible() and text.get_text().strip():
            # not the window extent of an annotation, which holds its arrow
            box = Text.get_window_extent(text, renderer)
            written.append((text.get_text(), box.x0, box.y0, box.x1, box.y1))
        return draw(text, renderer, *arguments, **options)

    canvas = FigureCanvasAgg(figure)
    Text.draw = record  # type: ignore[method-assign]
    try:
        canvas.draw()
    finally:
        Text.draw = draw  # type: ignore[method-assign]
    return written


def faults_of(figure: Any) -> list[str]:
    """Return in sentences which texts overlap and which are cut."""
    written, slack = boxes_of(figure), SLACK * figure.dpi / 72.0
    width, height = figure.canvas.get_width_height()
    faults = []
    for i, (text, left, bottom, right, top) in enumerate(written):
        if left < -slack or bottom < -slack or right > width + slack or top > height + slack:
            faults.append(
                f"'{text}' is cut: {left:.0f} to {right:.0f} of {width}, {bottom:.0f} to {top:.0f} of {height}"
            )
        for other, x0, y0, x1, y1 in written[i + 1 :]:
            wide, high = min(right, x1) - max(left, x0), min(top, y1) - max(bottom, y0)
            if wide > slack and high > slack:
                faults.append(f"'{text}' and '{other}' overlap by {wide:.0f} x {high:.0f}")
    return faults


@contextmanager
def figures_made() -> Iterator[list[Any]]:
    """Collect every figure of the house that is made within this block."""
    from backdrive.report.pictures import canvas

    made: list[Any] = []
    new_figure = canvas.new_figure

    def collect(*arguments: Any, **options: Any) -> Any:
        made.append(new_figure(*arguments, **options))
        return made[-1]

    canvas.new_figure = collect
    try:
        yield made
    finally:
        canvas.new_figure = new_figure
