"""The league as a picture: cost of every compensator by joint and by disturbance, and the estimators by error and delay."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from backdrive.experiments.league import cost, overall, worst
from backdrive.experiments.outcome import Outcome

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MARKS = {"direct": "o", "momentum": "s", "extended": "^", "kalman": "D"}


def draw(outcome: Outcome) -> Figure:
    """Return the figure of the league.

    Args:
        outcome: of `experiments.league.run`.
    """
    from matplotlib.figure import Figure

    table = outcome.data["table"]
    nominal, hard = overall(table), worst(table)
    order = sorted(nominal, key=lambda name: nominal[name])
    figure = Figure(figsize=(13.0, 9.0), layout="constrained")
    grid = figure.add_gridspec(2, 3, height_ratios=(1.0, 0.8))
    _joints(figure.add_subplot(grid[0, 0]), table, order)
    _settings(figure.add_subplot(grid[0, 1:]), table, order)
    _bars(figure.add_subplot(grid[1, 0]), order, nominal, hard)
    _estimators(figure.add_subplot(grid[1, 1:]), outcome.data["estimators"]["rows"])
    return figure


def _heat(axes: Axes, values: np.ndarray, rows: list[str], columns: list[str], title: str) -> None:
    axes.imshow(values, cmap="RdYlGn_r", vmin=0.5, vmax=3.0, aspect="auto")
    axes.set_xticks(range(len(columns)), columns, rotation=35, ha="right", fontsize=8)
    axes.set_yticks(range(len(rows)), rows, fontsize=8)
    for i, row in enumerate(values):
        for j, value in enumerate(row):
            axes.text(j, i, f"{value:.1f}", ha="center", va="center", fontsize=7)
    axes.set_title(title, fontsize=10)


def _joints(axes: Axes, table, order: list[str]) -> None:
    from backdrive.experiments._league_joints import NOMINAL, contenders

    joints = contenders()
    values = np.array(
        [
            [cost(who, (e := table[who.name][name])["scores"][NOMINAL.name], e["bare"]) for who in joints]
            for name in order
        ]
    )
    _heat(axes, values, order, [who.name for who in joints], "cost by joint, as believed (bare joint: 2.5)")


def _settings(axes: Axes, table, order: list[str]) -> None:
    from backdrive.experiments._league_joints import SETTINGS

    columns = [overall(table, setting.name) for setting in SETTINGS]
    values = np.array([[column[name] for column in columns] for name in order])
    _heat(
        axes,
        values,
        order,
        [setting.name for setting in SETTINGS],
        "mean cost where the joint is not what was believed",
    )


def _bars(axes: Axes, order: list[str], nominal, hard) -> None:
    at = np.arange(len(order))
    axes.barh(at + 0.2, [hard[name] for name in order], 0.4, color="0.75", label="worst setting")
    axes.barh(at - 0.2, [nominal[name] for name in order], 0.4, color="tab:blue", label="as believed")
    axes.axvline(2.5, color="k", lw=0.8, ls=":")
    axes.set_yticks(at, order, fontsize=8)
    axes.invert_yaxis()
    axes.set_xlabel("mean cost over the joints")
    axes.legend(fontsize=8, loc="lower right")


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
    axes.set_ylabel("RMS error / RMS force")
    axes.set_ylim(bottom=0.0)
    axes.set_title("estimators of the external force; size: false contacts without a hand", fontsize=10)
    axes.legend(fontsize=7, ncols=3, loc="lower right")
