"""Common parts of the pictures of chapter 3: colours of the compensators, force peaks with deviations and tests, time series."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from backdrive.report.pictures.canvas import LIGHT, pretty_unit
from backdrive.thesis._hand_guiding import mark
from backdrive.thesis._sweep_plots import DASHED, SMALL, joint_title, key, name, panel, sheet

__all__ = [
    "COLORS", "DASHED", "SMALL", "edges", "joint_title", "key", "lines", "name", "panel", "peak_bars", "release", "sheet", "title",
]  # fmt: skip

COLORS = {
    "NC": "#6b7785", "C": "#2a78b8", "CD": "#5b3fa0", "P": "#d9730d", "PD": "#00845a",
    "alpha_N": "#2a78b8", "alpha_H": "#b3261e", "algFC2": "#00845a",
}  # fmt: skip
SIGNS = {"alpha_N": "α = α_N = 20 1/s", "alpha_H": "α = α_H = 500 1/s", "algFC2": "algFC2"}
GAP = 0.9  # between the groups of the two directions [bars]


def title(joint: str) -> str:
    """Return the title of a panel: `setup_a` becomes `Setup A`, `joint_1` becomes `Joint 1`."""
    return "Setup A" if joint == "setup_a" else joint_title(joint)


def lines(
    axes: Any, time: np.ndarray, cases: Mapping[str, Mapping[str, np.ndarray]], column: str, **how: Any
) -> None:
    """Draw a column of every case over time.

    Args:
        axes: to draw on.
        time: [s], (n,).
        cases: case -> columns.
        column: which.
        **how: `factor` of the ordinates, `step` between samples, and line properties.
    """
    factor, step = how.pop("factor", 1.0), how.pop("step", 1)
    for case, columns in cases.items():
        axes.plot(
            time[::step],
            factor * columns[column][::step],
            color=COLORS[case],
            label=SIGNS.get(case, case),
            **{"linewidth": 1.0, **how},
        )


def edges(axes: Any, times: np.ndarray) -> None:
    """Mark the windows from which peaks are taken."""
    for t in times:
        axes.axvline(t, color=LIGHT.ink, linewidth=0.8, linestyle=DASHED, zorder=1)


def release(axes: Any, time: float, label: str = "") -> None:
    """Mark the instant at which the hand lets go."""
    axes.axvline(time, color=LIGHT.ink, linewidth=0.8, linestyle=DASHED, zorder=1)
    if label:
        axes.annotate(
            label, (time, 0.0), xycoords=("data", "axes fraction"), xytext=(4, 3), textcoords="offset points",
            color=LIGHT.muted, fontsize=SMALL, va="bottom",
        )  # fmt: skip


def peak_bars(axes: Any, panel: Mapping[str, Any]) -> None:
    """Draw mean peaks with standard deviations, the cases along +q and then along -q, and the tests against PD.

    Args:
        axes: to draw on.
        panel: of `thesis._guided.bars`, with the force's `unit`, and `axis` where it is not `q`.
    """
    cases, mean, deviation = panel["cases"], panel["mean"], panel["deviation"]
    n = len(cases)
    top = float(np.max(mean + deviation))
    for side in (0, 1):
        x = np.arange(n) + side * (n + GAP)
        axes.bar(x, mean[:, side], 0.72, color=[COLORS[case] for case in cases], zorder=2)
        axes.errorbar(
            x,
            mean[:, side],
            deviation[:, side],
            fmt="none",
            ecolor=LIGHT.ink,
            elinewidth=1.1,
            capsize=3.0,
            zorder=3,
        )
        for i, case in enumerate(cases[:-1]):
            level = top * (1.06 + 0.1 * (n - 2 - i))
            foot = 0.025 * top
            axes.plot(
                [x[i], x[i], x[-1], x[-1]],
                [level - foot, level, level, level - foot],
                color=LIGHT.muted,
                linewidth=0.9,
            )
            sign = mark(panel["p"][case][side])
            axes.annotate(
                sign, (0.5 * (x[i] + x[-1]), level), xytext=(0, -1.5 if "*" in sign else 1.0),
                textcoords="offset points", ha="center", va="bottom", fontsize=SMALL - 1.5, color=LIGHT.ink,
            )  # fmt: skip
        axes.annotate(
            f"along {'+−'[side]}{panel.get('axis', 'q')}", (float(x.mean()), 0.0), xycoords=("data", "axes fraction"),
            xytext=(0, -20), textcoords="offset points", ha="center", va="top", fontsize=SMALL, color=LIGHT.ink,
        )  # fmt: skip
    axes.set_xticks([*np.arange(n), *(np.arange(n) + n + GAP)], [*cases, *cases])
    axes.grid(False, axis="x")
    axes.set_ylim(0.0, top * (1.12 + 0.1 * (n - 2)) * 1.04)
    axes.set_ylabel(f"peak [{pretty_unit(panel['unit'])}]", color=LIGHT.ink)
