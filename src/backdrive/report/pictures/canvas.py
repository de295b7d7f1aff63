"""The common style of all pictures: colours, fonts, axes, and the output as SVG and PNG.

Pictures use matplotlib's objects, never its global state. So window systems, user settings and other pictures cannot change
them, and the same data give the same bytes.
"""

from __future__ import annotations

import gc
import io
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from backdrive._files import write_whole
from backdrive.errors import InvalidInput, require


@dataclass(frozen=True, kw_only=True)
class Theme:
    """The colours of a picture, by what they mean.

    Attributes:
        ink: text and the friction curve.
        muted: axis text and secondary lines.
        grid: grid lines.
        paper: background.
        fitted: samples that the fit saw.
        held_out: samples that it did not see.
        band: confidence band.
        truth: a curve to compare with.
    """

    ink: str = "#1a1d21"
    muted: str = "#59636e"
    grid: str = "#dfe3e8"
    paper: str = "#ffffff"
    fitted: str = "#2a78b8"
    held_out: str = "#d9730d"
    band: str = "#6b7785"
    truth: str = "#00845a"


LIGHT = Theme()
DARK = Theme(
    ink="#eceff3",
    muted="#a9b3bf",
    grid="#333b45",
    paper="#14181d",
    fitted="#62b0ec",
    held_out="#f2a14b",
    band="#93a0af",
    truth="#35c796",
)
#: Placeholder colours, which `backdrive.report.pictures.svg` replaces by the CSS variables of the same names.
CSS = Theme(**{f.name: f"#0a0b{i:02x}" for i, f in enumerate(fields(Theme), start=16)})

FONT_SIZE = 10.5  # [pt]
WIDTH, HEIGHT = 324, 220  # one picture [pt]: its type is 10 px high on a phone 360 px wide
FEW = 120  # samples of which each is drawn large
SMALL = 284, 196  # one of three in a row [pt]
DASHED = (0, (4, 2.6))

_STYLE: dict[str, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "backdrive",
    "svg.image_inline": True,
    "path.simplify": False,
    "font.family": ["sans-serif"],
    "font.sans-serif": ["DejaVu Sans"],  # matplotlib's own; any other would be looked for, for each text
    "font.size": FONT_SIZE,
    "axes.linewidth": 0.8,
    "axes.labelsize": FONT_SIZE,
    "axes.titlesize": FONT_SIZE,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-4, 6),
    "xtick.major.size": 0,
    "ytick.major.size": 0,
    "xtick.major.pad": 7,
    "ytick.major.pad": 4,
    "lines.solid_capstyle": "round",
    "savefig.facecolor": "auto",
}


def require_matplotlib() -> None:
    """Say how to install matplotlib when it is absent.

    Raises:
        MissingExtra: names the extra.
    """
    require("matplotlib.figure", "Pictures and reports need", "report")


@contextmanager
def house_style() -> Iterator[None]:
    """Draw in the package's own style, independent of the user's matplotlib settings.

    Raises:
        MissingExtra: matplotlib is not installed.
    """
    require_matplotlib()
    import matplotlib

    with matplotlib.rc_context(), warnings.catch_warnings(), _old_objects_apart():
        warnings.simplefilter("ignore")  # a glyph that the font lacks is drawn as a box
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_STYLE)  # pyright: ignore[reportArgumentType, reportCallIssue]
        yield


@contextmanager
def _old_objects_apart() -> Iterator[None]:
    """Leave all objects that exist out of the searches for cycles of references, which the many parts of pictures cause."""
    if gc.get_freeze_count():  # somebody else does
        yield
        return
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


def axes_of(figure: Any, theme: Theme, rectangle: tuple[float, float, float, float] | None = None) -> Any:
    """Return axes with a light grid, no box, and the vertical axis' name above it.

    Args:
        figure: a matplotlib figure.
        theme: its colours.
        rectangle: left, bottom, width, height [pt] of the plotting area; the house's margins by default.
    """
    from backdrive.report.pictures.ticks import Bare, Ticks

    width, height = figure.get_size_inches() * 72.0
    left, bottom, w, h = rectangle or (44.0, 38.0, width - 54.0, height - 62.0)
    axes = figure.add_axes((left / width, bottom / height, w / width, h / height), axes_class=Bare)
    axes.set_facecolor("none")
    for side in ("top", "right", "left"):
        axes.spines[side].set_visible(False)
    axes.spines["bottom"].set_color(theme.muted)
    axes.spines["bottom"].set_position(("outward", 0.0))  # which the first tick would do
    Ticks(axes, grid=theme.grid, muted=theme.muted, ink=theme.ink, size=FONT_SIZE)
    return axes


def name_axes(axes: Any, theme: Theme, *, x: str, y: str) -> None:
    """Write the axes' names: the horizontal one below, the vertical one level and above, where a phone can read it."""
    from matplotlib.ticker import MaxNLocator

    axes.xaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 2.5, 5, 10]))
    axes.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 2.5, 5, 10]))
    axes.set_xlabel(x)
    axes.annotate(
        y,
        (0, 1),
        xycoords="axes fraction",
        xytext=(-38, 8),
        textcoords="offset points",
        color=theme.ink,
        fontsize=FONT_SIZE,
        annotation_clip=False,
    )


def hide_labels(axes: Any) -> None:
    """Leave out the labels of the horizontal axis, which another picture below has."""
    from backdrive.report.pictures.ticks import ticks_of

    ticks_of(axes).labelled = False


def new_figure(theme: Theme, width: float = WIDTH, height: float = HEIGHT) -> Any:
    """Return an empty figure of a size in points."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width / 72.0, height / 72.0), dpi=72, facecolor=theme.paper)


def dots(
    axes: Any,
    theme: Theme,
    x: np.ndarray,
    y: np.ndarray,
    color: str,
    *,
    size: float = 2.4,
    alpha: float = 0.55,
    within: tuple[float, float] | None = None,
) -> None:
    """Draw many points; those outside a range are drawn as triangles at its edge.

    In a page all points are ONE path of zero-length strokes with round caps. This takes a tenth of the bytes of one element
    per point. The caller sets the axes' limits.

    Args:
        axes: to draw on.
        theme: the picture's.
        x: abscissas, (n,).
        y: ordinates, (n,).
        color: of the dots.
        size: their diameter [pt]; a few are drawn larger.
        alpha: their opacity [1].
        within: range of the ordinates that is shown; None: all are.
    """
    good = np.isfinite(x) & np.isfinite(y)
    if within is not None:
        for edge, marker, off in (
            (within[1], 6, y > within[1]),
            (within[0], 7, y < within[0]),
        ):  # caretup, caretdown
            at = np.flatnonzero(good & off)
            at = at[np.linspace(0, at.size - 1, min(at.size, FEW)).astype(int)] if at.size else at
            axes.plot(
                x[at], np.full(at.size, edge), linestyle="none", marker=marker, markersize=4.0, mew=0, color=color,
                alpha=0.8, zorder=2, clip_on=False,
            )  # fmt: skip
        good &= (y >= within[0]) & (y <= within[1])
    if not np.any(good):
        return
    if np.count_nonzero(good) <= FEW:
        size, alpha = 2.0 * size, 0.9
    if theme is not CSS:  # Agg does not draw strokes without length
        axes.plot(
            x[good],
            y[good],
            linestyle="none",
            marker="o",
            markersize=size,
            mew=0,
            color=color,
            alpha=alpha,
            zorder=2,
            clip_on=False,
        )
        return
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    vertices = np.repeat(np.column_stack([x[good], y[good]]), 2, axis=0)
    codes = np.tile([Path.MOVETO, Path.LINETO], len(vertices) // 2).astype(Path.code_type)
    axes.add_artist(  # not add_patch: working out its limits costs more than drawing it
        PathPatch(
            Path(vertices, codes),
            facecolor="none",
            edgecolor=color,
            linewidth=size,
            capstyle="round",
            alpha=alpha,
            zorder=2,
            clip_on=False,
        )
    )


def content(figure: Any, kind: str, scale: float = 2.0) -> bytes:
    """Return a figure as the content of a file.

    Args:
        figure: a matplotlib figure.
        kind: `png` or `svg`, or the name of a file that ends so.
        scale: pixels per point of a PNG [1].

    Raises:
        InvalidInput: another kind.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    stream, paper = io.BytesIO(), figure.get_facecolor()
    ending = kind.lower().rpartition(".")[2]
    if ending == "png":
        FigureCanvasAgg(figure).print_figure(
            stream, format="png", dpi=72 * scale, facecolor=paper, metadata={"Software": None}
        )
    elif ending == "svg":
        unsaid = dict.fromkeys(("Date", "Creator", "Format", "Type"))
        FigureCanvasSVG(figure).print_svg(stream, metadata=unsaid)
    else:
        raise InvalidInput(
            f"{kind}: a picture cannot be written as '{ending}'.", remedy="Name a .png or .svg file."
        )
    return stream.getvalue()


def write(figure: Any, path: str | Path, scale: float = 2.0) -> Path:
    """Write a figure as PNG or SVG by the file's ending, whole or not at all; see `content`."""
    return write_whole(path, content(figure, Path(path).name, scale))


def truth_line(axes: Any, theme: Theme, x: np.ndarray, y: np.ndarray) -> None:
    """Draw a curve to compare with, dashed."""
    axes.plot(x, y, color=theme.truth, linewidth=1.7, linestyle=DASHED, dash_capstyle="butt", zorder=5)


def zero_line(axes: Any, theme: Theme) -> None:
    """Draw the horizontal axis through zero."""
    axes.axhline(0.0, color=theme.muted, linewidth=0.7, zorder=1)


def markers(theme: Theme, size: float, edge: str, face: str = "") -> dict[str, Any]:
    """Return plot options for circles without a line.

    Args:
        theme: colours.
        size: diameter [pt].
        edge: colour of their edge.
        face: colour within; by default the paper's.
    """
    return {"ls": "none", "marker": "o", "markersize": size, "mfc": face or theme.paper, "mec": edge}


def pretty_unit(unit: str) -> str:
    """Return an SI unit in print: `kg.m^2` becomes `kg·m²`."""
    return unit.replace(".", "·").replace("^2", "²").replace("^3", "³").replace("degC", "°C")
