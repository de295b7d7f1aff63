"""The safe region of a compensator: share of friction against stiffness and decay rate against delay, with the chosen numbers
and the thesis'.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.report.pictures.canvas import LIGHT, Theme, axes_of, house_style, name_axes, new_figure, write
from backdrive.tuning.tuning import Tuning

WIDTH, HEIGHT = 640.0, 334.0  # [pt]
LEVELS = (
    1.0,
    10.0,
)  # limits relative to the allowed motion at rest: below the first the joint rests, below the second it hums
WORDS = ("comes to rest", "hums, up to 10 times what is allowed", "more, or does not stop")


def draw(tuning: Tuning, path: str | Path, theme: Theme = LIGHT) -> Path:
    """Write the picture of a tuning's safe region.

    Args:
        tuning: with its region.
        path: PNG or SVG.
        theme: colours.

    Raises:
        InvalidInput: the region was not worked out.
        MissingExtra: matplotlib is not installed.
    """
    if not tuning.region:
        raise InvalidInput(
            f"The tuning of '{tuning.joint}' for '{tuning.goal}' has no safe region.",
            remedy="It is computed for --goal backdrive and track, with --picture.",
        )
    with house_style():
        return write(safe_region(tuning, theme), path)


def safe_region(tuning: Tuning, theme: Theme = LIGHT) -> Any:
    """Return the figure of a tuning's safe region.

    Args:
        tuning: with its region.
        theme: colours.
    """
    region = tuning.region
    figure = new_figure(theme, WIDTH, HEIGHT)
    left = axes_of(figure, theme, (48, 110, 248, 180))
    right = axes_of(figure, theme, (376, 110, 248, 180))
    springs, shares = np.array(region["springs"]), np.array(region["shares"])
    _tiles(left, theme, springs, shares, np.array(region["by_share"], dtype=float))
    low, high = region["stiffness_interval"]
    left.axvspan(low, high, color=theme.band, alpha=0.18, linewidth=0)
    left.axhline(region["largest_share"], color=theme.ink, linewidth=1.0, linestyle=":")
    name_axes(
        left, theme, x="stiffness K over that of the contact, K_c", y="share of friction R, with the chosen α"
    )
    decays, delays = np.array(region["decays"]), 1e3 * np.array(region["delays"])
    _tiles(right, theme, delays, decays, np.array(region["by_delay"], dtype=float).T, rising=True)
    right.set_yscale("log")
    R, K, alpha, delay = region["chosen"]
    name_axes(right, theme, x="delay [ms]", y="decay rate α [1/s], with the chosen R and K")
    from matplotlib.ticker import FixedLocator, NullLocator, ScalarFormatter

    right.yaxis.set_major_locator(FixedLocator([2, 5, 20, 50, 200, 500]))
    right.yaxis.set_major_formatter(ScalarFormatter())
    right.yaxis.set_minor_locator(NullLocator())
    marks = _marks(theme)
    right.plot([1e3 * delay], [alpha], clip_on=False, zorder=5, **marks["chosen"])
    left.plot([K], [R], clip_on=False, zorder=5, **marks["chosen"])
    R, K, alpha = region["thesis"][:3]
    left.plot([min(K, left.get_xlim()[1])], [R], clip_on=False, zorder=4, **marks["thesis"])
    right.plot([1e3 * delay], [alpha], clip_on=False, zorder=4, **marks["thesis alpha"])
    _legend(figure, theme, tuning)
    return figure


def _edges(x: np.ndarray, *, rising: bool = False) -> np.ndarray:
    """Return the edges of the tiles around values, halfway between neighbours (in the logarithm where `rising`)."""
    y = np.log(x) if rising else x
    middle = 0.5 * (y[1:] + y[:-1])
    edges = np.concatenate([[1.5 * y[0] - 0.5 * y[1]], middle, [1.5 * y[-1] - 0.5 * y[-2]]])
    return np.exp(edges) if rising else edges


def _colors(theme: Theme) -> list[str]:
    return [theme.truth, "#f2c14e", theme.held_out]


def _tiles(
    axes: Any, theme: Theme, x: np.ndarray, y: np.ndarray, z: np.ndarray, rising: bool = False
) -> None:
    from matplotlib.colors import BoundaryNorm, ListedColormap

    colors = ListedColormap(_colors(theme))
    level = np.digitize(np.where(np.isfinite(z), z, np.inf), LEVELS, right=True).astype(float)
    axes.pcolormesh(
        _edges(x),
        _edges(y, rising=rising),
        level,
        cmap=colors,
        norm=BoundaryNorm([-0.5, 0.5, 1.5, 2.5], 3),
        alpha=0.55,
        edgecolor=theme.paper,
        linewidth=0.5,
    )
    axes.set_xlim(_edges(x)[[0, -1]])
    axes.set_ylim(_edges(y, rising=rising)[[0, -1]])


def _marks(theme: Theme) -> dict[str, dict[str, Any]]:
    """Return the marker of the chosen numbers, and those of the thesis', hollow and larger, so that neither hides the other."""
    hollow = {"mfc": "none", "mec": theme.ink, "ls": "none"}
    return {
        "chosen": {"marker": "o", "color": theme.ink, "ms": 6, "ls": "none"},
        "thesis": {"marker": "D", "mew": 1.4, "ms": 11, **hollow},
        "thesis alpha": {"marker": "s", "mew": 1.0, "ms": 8, **hollow},
    }


def _legend(figure: Any, theme: Theme, tuning: Tuning) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    marks = _marks(theme)
    entries: list[Any] = [
        Patch(facecolor=c, alpha=0.55, label=w) for c, w in zip(_colors(theme), WORDS, strict=False)
    ]
    R, chosen, alpha = tuning.region["chosen"][:3]
    K = tuning.region["thesis"][1]
    beyond = f" (K = {K:.2g} K_c, beyond)" if tuning.region["springs"][-1] < K else ""
    entries += [
        Patch(facecolor=theme.band, alpha=0.18, label="where K_c may lie, by its error"),
        Line2D([], [], color=theme.ink, linewidth=1.0, linestyle=":", label="least friction, by its error"),
        Line2D(
            [], [], label=f"chosen: R = {R:.2f}, K = {chosen:.2f} K_c, α = {alpha:.3g}/s", **marks["chosen"]
        ),
        Line2D([], [], label=f"the thesis' R and K{beyond}", **marks["thesis"]),
        Line2D([], [], label="the thesis' α, with the chosen R and K", **marks["thesis alpha"]),
    ]
    legend = figure.legend(
        handles=entries, loc="lower center", ncol=2, frameon=False, fontsize=9.5, columnspacing=3
    )
    for text in legend.get_texts():
        text.set_color(theme.ink)
    figure.text(
        0.012,
        0.985,
        f"{tuning.joint}: at rest after a knock, the worst of the ends of all intervals",
        color=theme.ink,
        fontsize=11,
        va="top",
    )
