"""The picture of the league: tiers with their scatter, costs by joint and by setting, estimators."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

import numpy as np

from backdrive.report.pictures import canvas
from backdrive.report.pictures.canvas import LIGHT
from backdrive.thesis import _sweep_plots as own
from backdrive.thesis._league_claims import guiding
from backdrive.thesis._league_costs import Table
from backdrive.thesis._league_joints import NOMINAL, SETTINGS
from backdrive.thesis._league_tiers import tiers
from backdrive.thesis.outcome import Outcome
from backdrive.thesis.scatter import interval

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

COLORS = (*own.SERIES, "#8a5a2b", LIGHT.muted, LIGHT.ink)
MARKS = {"direct": "o", "momentum": "s", "extended": "^", "kalman": "D"}


def draw(outcome: Outcome) -> Figure:
    """Return the figure of the league.

    Args:
        outcome: of `league.run`.
    """
    table: Table = outcome.data["table"]
    nominal = guiding(table, NOMINAL.name)
    order = sorted(nominal, key=lambda name: float(np.mean(nominal[name])))
    figure = canvas.new_figure(LIGHT, 972.0, 700.0)
    figure.set_layout_engine("constrained", w_pad=6 / 72, h_pad=6 / 72, wspace=0.03, hspace=0.05)
    grid = figure.add_gridspec(2, 3, height_ratios=(1.0, 0.85))
    _tiers(own.panel(figure, grid[0, 0]), nominal, "as believed")
    _tiers(own.panel(figure, grid[0, 1]), guiding(table), "where the joint is otherwise")
    joints = list(next(iter(table.values())))
    by_joint = [guiding(table, NOMINAL.name, joint) for joint in joints]
    _heat(own.panel(figure, grid[0, 2]), by_joint, order, joints, "cost by joint, as believed")
    by_setting = [guiding(table, s.name) for s in SETTINGS]
    names = [s.name for s in SETTINGS]
    below = grid[1, :].subgridspec(1, 2, width_ratios=(1.3, 1.7))
    _heat(own.panel(figure, below[0]), by_setting, order, names, "cost by setting, bare joint: 1")
    _estimators(own.panel(figure, below[1]), outcome.data["estimators"][0]["rows"])
    return figure


def _tiers(axes: Axes, costs: dict[str, np.ndarray], words: str) -> None:
    """Draw mean costs with 95 % intervals over the seeds, a colour a tier."""
    at = 0
    for i, tier in enumerate(tiers(costs)):
        for name in tier:
            mean = float(np.mean(costs[name]))
            low, high = interval(costs[name])
            label = f"tier {i + 1}" if name == tier[0] else ""
            axes.plot(
                mean, at, "o", markersize=6, color=own.SERIES[i % len(own.SERIES)], label=label, zorder=3
            )
            axes.plot([low, high], [at, at], color=LIGHT.ink, lw=1.2)
            at += 1
    axes.set_yticks(range(at), [name for tier in tiers(costs) for name in tier])
    axes.invert_yaxis()
    _log_axis(axes.xaxis, [float(np.mean(c)) for c in costs.values()])
    axes.grid(False, axis="y")
    axes.axvline(1.0, color=LIGHT.ink, lw=0.8, ls=":")
    own.name(axes, f"tiers, {words}", "cost by the bare joint's, 95 % intervals")
    own.key(axes, "upper right")


def _log_axis(axis: Axis, values: list[float]) -> None:
    """Give an axis a scale of ratios, which tells 3.0 from 8.2 as well as 0.3 from 0.8, with plain numbers at it."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    axis.axes.set_xscale("log")
    ticks = (0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0, 20.0, 50.0, 100.0)
    low, high = 0.8 * min(values), 1.25 * max(*values, 1.0)
    axis.set_major_locator(FixedLocator([t for t in ticks if low <= t <= high]))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def _heat(
    axes: Axes, costs: list[dict[str, np.ndarray]], rows: list[str], columns: list[str], title: str
) -> None:
    values = np.array([[float(np.mean(column[name])) for column in costs] for name in rows])
    from matplotlib.colors import LogNorm

    positive = values[values > 0.0]
    far = max(2.0, float(positive.max(initial=1.0)), 1.0 / float(positive.min(initial=1.0)))
    axes.imshow(values, cmap="RdBu_r", norm=LogNorm(1.0 / far, far), aspect="auto")
    words = ["\n".join(textwrap.wrap(column.replace("_", " "), 9)) for column in columns]
    axes.set_xticks(range(len(columns)), words, fontsize=own.SMALL - 2.0)
    axes.set_yticks(range(len(rows)), rows)
    axes.grid(False)
    for i, row in enumerate(values):
        for j, value in enumerate(row):
            dark = value > 0.0 and abs(np.log(value)) > 0.65 * np.log(far)
            color = LIGHT.paper if dark else LIGHT.ink
            axes.text(j, i, f"{value:.2f}", ha="center", va="center", fontsize=own.SMALL - 1.5, color=color)
    own.name(axes, title)


def _estimators(axes: Axes, rows) -> None:
    names = list(dict.fromkeys(r["friction"] for r in rows))
    for i, name in enumerate(names):
        for r in rows:
            if r["friction"] == name:
                label = name if r["method"] == "direct" else None
                axes.scatter(
                    1e3 * r["delay"],
                    r["rms"],
                    20 + 300 * r["false"],
                    color=COLORS[i % len(COLORS)],
                    marker=MARKS[r["method"]],
                    alpha=0.8,
                    label=label,
                )
    for method, mark in MARKS.items():
        axes.scatter([], [], color=LIGHT.muted, marker=mark, label=method)
    title = "estimators of the external force; size: false contacts without a hand"
    own.name(axes, title, "delay [ms]", "error / force, root mean square")
    axes.set_ylim(0.0, 1.12 * max(r["rms"] for r in rows))
    own.key(axes, "lower right", 3)
