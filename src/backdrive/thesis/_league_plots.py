"""The picture of the league: tiers with their scatter, costs by joint and by setting, estimators."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

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

MARKS = {"direct": "o", "momentum": "s", "extended": "^", "kalman": "D"}


def draw(outcome: Outcome) -> Figure:
    """Return the figure of the league.

    Args:
        outcome: of `league.run`.
    """
    from matplotlib.figure import Figure

    table: Table = outcome.data["table"]
    nominal = guiding(table, NOMINAL.name)
    order = sorted(nominal, key=lambda name: float(np.mean(nominal[name])))
    figure = Figure(figsize=(13.5, 9.5), layout="constrained")
    grid = figure.add_gridspec(2, 3, height_ratios=(1.0, 0.85))
    _tiers(figure.add_subplot(grid[0, 0]), nominal, "as believed")
    _tiers(figure.add_subplot(grid[0, 1]), guiding(table), "where the joint is otherwise")
    joints = list(next(iter(table.values())))
    by_joint = [guiding(table, NOMINAL.name, joint) for joint in joints]
    _heat(figure.add_subplot(grid[0, 2]), by_joint, order, joints, "cost by joint, as believed")
    by_setting = [guiding(table, s.name) for s in SETTINGS]
    names = [s.name for s in SETTINGS]
    _heat(figure.add_subplot(grid[1, 0]), by_setting, order, names, "cost by setting (bare joint: 1)")
    _estimators(figure.add_subplot(grid[1, 1:]), outcome.data["estimators"][0]["rows"])
    return figure


def _tiers(axes: Axes, costs: dict[str, np.ndarray], words: str) -> None:
    """Draw mean costs with 95 % intervals over the seeds, a colour a tier."""
    at = 0
    for i, tier in enumerate(tiers(costs)):
        for name in tier:
            mean = float(np.mean(costs[name]))
            low, high = interval(costs[name])
            label = f"tier {i + 1}" if name == tier[0] else ""
            axes.plot(mean, at, "o", markersize=6, color=f"C{i % 10}", label=label, zorder=3)
            axes.plot([low, high], [at, at], color="k", lw=1.2)
            at += 1
    axes.set_yticks(range(at), [name for tier in tiers(costs) for name in tier], fontsize=8)
    axes.invert_yaxis()
    _log_axis(axes.xaxis, [float(np.mean(c)) for c in costs.values()])
    axes.grid(True, axis="x", color="0.9", lw=0.7)
    axes.set_axisbelow(True)
    axes.axvline(1.0, color="k", lw=0.8, ls=":")
    axes.set_xlabel("cost by the bare joint's [-], scale of ratios; lines: 95 % intervals")
    axes.set_title(f"tiers, {words}: members of a tier are ties with its first", fontsize=9)
    axes.legend(fontsize=7, loc="upper right")


def _log_axis(axis: Axis, values: list[float]) -> None:
    """Give an axis a scale of ratios, which tells 3.0 from 8.2 as well as 0.3 from 0.8, with plain numbers at it."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    axis.axes.set_xscale("log")
    ticks = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
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
    axes.set_xticks(range(len(columns)), columns, rotation=35, ha="right", fontsize=7)
    axes.set_yticks(range(len(rows)), rows, fontsize=8)
    for i, row in enumerate(values):
        for j, value in enumerate(row):
            dark = value > 0.0 and abs(np.log(value)) > 0.65 * np.log(far)
            color = "white" if dark else "black"
            axes.text(j, i, f"{value:.2f}", ha="center", va="center", fontsize=7, color=color)
    axes.set_title(title, fontsize=10)


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
                    color=f"C{i}",
                    marker=MARKS[r["method"]],
                    alpha=0.8,
                    label=label,
                )
    for method, mark in MARKS.items():
        axes.scatter([], [], color="0.4", marker=mark, label=method)
    axes.set_xlabel("delay [ms]")
    axes.set_ylabel("error / force, both root mean square (RMS)")
    axes.set_ylim(bottom=0.0)
    axes.set_title("estimators of the external force; size: false contacts without a hand", fontsize=10)
    axes.legend(fontsize=7, ncols=3, loc="lower right")
