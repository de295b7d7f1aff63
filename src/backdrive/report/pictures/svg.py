"""A figure as SVG, inside an HTML page or in a file of its own."""

from __future__ import annotations

import re
from html import escape
from typing import Any

_DOT = re.compile(r"M(\S+ \S+)L\1(?=M|$)")
_D = re.compile(r' d="([^"]*)"')
_WAY = re.compile("[MLCQz]")
#: Letter of a path as matplotlib writes it -> itself, with places for the points that follow it.
_POINTS = {
    "M": "M%.1f %.1f",
    "L": "L%.1f %.1f",
    "Q": "Q" + " ".join(4 * ["%.1f"]),
    "C": "C" + " ".join(6 * ["%.1f"]),
    "z": "z",
}
_WHOLE, _ZERO = re.compile(r"\.0(?!\d)"), re.compile(r"-0(?![\d.])")


def inline(figure: Any, prefix: str, label: str) -> str:
    """Return a figure as an `<svg>` element for an HTML page.

    It contains no address, since HTML needs no namespace. Colours are the page's CSS variables, the font is the page's, and
    text remains text. All identifiers begin with `prefix`, so that one page can contain several figures.

    Args:
        figure: drawn in the theme `canvas.CSS`.
        prefix: unique in the page, an identifier.
        label: what the picture shows, for those who do not see it.
    """
    from backdrive.report.pictures.renderer import PageRenderer

    width, height = figure.get_size_inches() * 72.0
    renderer = PageRenderer(width, height, prefix)
    figure.draw(renderer)
    box = f"0 0 {width:g} {height:g}"
    return f'<svg viewBox="{box}" role="img" aria-label="{escape(label)}">{renderer.body}</svg>'


def compact(picture: bytes) -> bytes:
    """Return an SVG file whose paths are as short as those of `inline`, for a notebook that holds it whole."""
    return _D.sub(lambda d: f' d="{_path(d[1])}"', picture.decode()).encode()


def _path(d: str) -> str:
    """Shorten a path: a tenth of a point is finer than any screen, and `h0` is a stroke without length."""
    numbers = tuple(map(float, _WAY.sub(" ", d).split()))
    short = "".join(map(_POINTS.__getitem__, _WAY.findall(d))) % numbers  # all at once: there are many
    short = _ZERO.sub("0", _WHOLE.sub("", short))
    return _DOT.sub(r"M\1h0", short) if "L" in short else short
