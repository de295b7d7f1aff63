"""A matplotlib renderer that writes a figure as the inside of an `<svg>` element of an HTML page.

Coordinates have a tenth of a point, finer than any screen; colours are the page's CSS variables; the font is the page's, and text
remains text. matplotlib's own SVG has namespaces, a style sheet and six decimals, and takes longer to shorten than to write anew.
"""

from __future__ import annotations

from dataclasses import fields
from html import escape
from typing import Any

import numpy as np
from matplotlib.backend_bases import RendererBase
from matplotlib.colors import to_hex
from matplotlib.path import Path

from backdrive.report.pictures.canvas import CSS

_VARIABLES = {getattr(CSS, f.name): f"var(--{f.name.replace('_', '-')})" for f in fields(CSS)}
_ANCHOR = {"left": "start", "center": "middle", "right": "end"}
#: Code of a path -> its letter with places for the points that follow it, and their number.
_LETTERS = {
    Path.MOVETO: ("M%g %g", 1),
    Path.LINETO: ("L%g %g", 1),
    Path.CURVE3: ("Q%g %g %g %g", 2),
    Path.CURVE4: ("C%g %g %g %g %g %g", 3),
}
DOWN = np.array([1.0, -1.0])  # ordinates of a figure are measured upwards
_STRAIGHT = {int(Path.MOVETO): "M%g %g", int(Path.LINETO): "L%g %g"}


class PageRenderer(RendererBase):
    """The elements of a figure, as strings.

    Args:
        width: of the figure [pt].
        height: of it [pt].
        prefix: of identifiers, unique in the page.
    """

    def __init__(self, width: float, height: float, prefix: str):
        super().__init__()
        self.width, self.height, self._prefix = width, height, prefix
        self._parts: list[str] = []
        self._names: dict[str, str] = {}

    @property
    def body(self) -> str:
        """Everything that was drawn."""
        return "".join(self._parts)

    def get_canvas_width_height(self) -> tuple[float, float]:
        """Return the figure's size [pt]."""
        return self.width, self.height

    def draw_path(self, gc: Any, path: Any, transform: Any, rgbFace: Any = None) -> None:
        """Write a path; nothing if it has no colour."""
        style, d = _style(gc, rgbFace), self._path(path, transform)
        if style != "fill:none" and d:
            self._parts.append(f'<path d="{d}"{self._clip(gc)} style="{style}"></path>')

    def draw_markers(
        self, gc: Any, marker_path: Any, marker_trans: Any, path: Any, trans: Any, rgbFace: Any = None
    ) -> None:
        """Write a marker once, and where it is used."""
        at = self._points(trans.transform(path.vertices))
        at = at[np.isfinite(at).all(axis=1)].tolist()
        style, marker = _style(gc, rgbFace), marker_path.cleaned(marker_trans, curves=True)
        if not at or style == "fill:none":
            return
        if len(at) == 1:
            self._parts.append(f'<path d="{_string(marker, at[0])}"{self._clip(gc)} style="{style}"></path>')
            return
        d = _string(marker, (0.0, 0.0))
        name = self._define(f'<path id="%s" d="{d}" style="{style}"></path>')
        uses = "".join(f'<use href="#{name}" x="{x:g}" y="{y:g}"></use>' for x, y in at)
        self._parts.append(f"<g{self._clip(gc)}>{uses}</g>")

    def draw_text(
        self,
        gc: Any,
        x: float,
        y: float,
        s: str,
        prop: Any,
        angle: float,
        ismath: Any = False,
        mtext: Any = None,
    ) -> None:
        """Write a text at its anchor; a formula as its outlines."""
        if ismath:
            super().draw_text(gc, x, y, s, prop, angle, ismath)
            return
        side, size = "left", prop.get_size_in_points()
        if mtext and angle == 0.0:  # where the text belongs, whatever the width of the page's font
            x, side = mtext.get_transform().transform(mtext.get_unitless_position())[0], mtext.get_ha()
        bold = prop.get_weight() in ("bold", "semibold", "heavy", 700)
        clear, clip = gc.get_alpha() if gc.get_forced_alpha() else gc.get_rgb()[3], self._clip(gc)
        self.write(
            s, x, y, size, to_hex(gc.get_rgb()), side=side, angle=angle, bold=bold, opacity=clear, clip=clip
        )

    def write(
        self,
        word: str,
        x: float,
        y: float,
        size: float,
        color: str,
        *,
        side: str = "left",
        angle: float = 0.0,
        bold: bool = False,
        opacity: float = 1.0,
        clip: str = "",
    ) -> None:
        """Write a text whose base line is y from above [pt]."""
        style = [
            f"font-size:{size:g}px",
            f"text-anchor:{_ANCHOR[side]}",
            f"fill:{_VARIABLES.get(color, color)}",
        ]
        style += ["font-weight:bold"] if bold else []
        style += [f"opacity:{opacity:g}"] if opacity != 1.0 else []
        at = f'x="{_round(x):g}" y="{_round(y):g}"'
        turned = f' transform="rotate({-angle:g} {_round(x):g} {_round(y):g})"' if angle else ""
        self._parts.append(f'<text{clip} style="{";".join(style)}" {at}{turned}>{escape(word)}</text>')

    def draw_image(self, gc: Any, x: float, y: float, im: Any, transform: Any = None) -> None:
        """Refuse: the house's pictures have no pixels."""
        raise NotImplementedError("a picture of a page has lines and texts, no pixels")

    def _points(self, vertices: np.ndarray) -> np.ndarray:
        """Return vertices as they are written [pt], (n, 2)."""
        return np.round(np.array([0.0, self.height]) + DOWN * vertices, 1) + 0.0

    def _path(self, path: Any, transform: Any) -> str:
        return _string(path.cleaned(transform, remove_nans=True, curves=True), (0.0, self.height))

    def _clip(self, gc: Any) -> str:
        """Return the reference to what a path is clipped to, which is written once."""
        path, transform = gc.get_clip_path()
        if path is not None:
            d = self._path(path, transform)
        elif (box := gc.get_clip_rectangle()) is not None:
            (x0, y1), (x1, y0) = self._points(np.array([[box.x0, box.y0], [box.x1, box.y1]])).tolist()
            d = f"M{x0:g} {y0:g}H{x1:g}V{y1:g}H{x0:g}z"
        else:
            return ""
        name = self._define(f'<clipPath id="%s"><path d="{d}"></path></clipPath>')
        return f' clip-path="url(#{name})"'

    def _define(self, element: str) -> str:
        """Return the name of an element that is written once, with a place for its name."""
        if element not in self._names:
            self._names[element] = f"{self._prefix}-{len(self._names)}"
            self._parts.append(f"<defs>{element.replace('%s', self._names[element])}</defs>")
        return self._names[element]


def _round(x: float) -> float:
    return round(x, 1) + 0.0  # no -0


def _string(path: Any, origin: tuple[float, float]) -> str:
    """Return the commands of a path, whose ordinates are measured downwards from an origin."""
    codes = path.codes
    kept = codes != Path.STOP
    codes, points = codes[kept], np.round(np.array(origin) + DOWN * path.vertices[kept], 1) + 0.0
    if not codes.size:
        return ""
    dots = codes.size % 2 == 0 and np.all(codes[::2] == Path.MOVETO) and np.all(codes[1::2] == Path.LINETO)
    if dots and np.array_equal(points[::2], points[1::2]):  # strokes without length
        return "M%g %gh0" * (codes.size // 2) % tuple(points[::2].ravel().tolist())
    if np.all(codes <= Path.LINETO):
        return "".join(map(_STRAIGHT.__getitem__, codes.tolist())) % tuple(points.ravel().tolist())
    made, numbers, i = [], [], 0
    while i < codes.size:
        if codes[i] == Path.CLOSEPOLY:
            made.append("z")
            i += 1
            continue
        word, count = _LETTERS[codes[i]]
        made.append(word)
        numbers += points[i : i + count].ravel().tolist()
        i += count
    return "".join(made) % tuple(numbers)


def _style(gc: Any, face: Any) -> str:
    """Return the style of a path, without what is the default."""
    alpha, style = gc.get_alpha(), []
    forced = gc.get_forced_alpha()
    if face is None:
        style.append("fill:none")
    else:
        color = to_hex(face[:3])
        style += [f"fill:{_VARIABLES.get(color, color)}"]
        style += [f"fill-opacity:{face[3]:g}"] if len(face) == 4 and face[3] != 1.0 and not forced else []
    if forced and alpha != 1.0:
        style.append(f"opacity:{alpha:g}")
    if width := gc.get_linewidth():
        rgb = gc.get_rgb()
        color = to_hex(rgb[:3])
        style.append(f"stroke:{_VARIABLES.get(color, color)}")
        style += [f"stroke-opacity:{rgb[3]:g}"] if not forced and len(rgb) == 4 and rgb[3] != 1.0 else []
        style += [f"stroke-width:{width:g}"] if width != 1.0 else []
        offset, dashes = gc.get_dashes()
        style += [f"stroke-dasharray:{','.join(f'{d:g}' for d in dashes)}"] if dashes is not None else []
        style += [f"stroke-dashoffset:{offset:g}"] if dashes is not None and offset else []
        style += [f"stroke-linejoin:{gc.get_joinstyle()}"] if gc.get_joinstyle() != "miter" else []
        cap = {"projecting": "square"}.get(gc.get_capstyle(), gc.get_capstyle())
        style += [f"stroke-linecap:{cap}"] if cap != "butt" else []
    return ";".join(style)
