"""What the pictures of chapter 4 share: colours of the estimators, a mark of the release."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.report.pictures.canvas import LIGHT
from backdrive.thesis._sweep_plots import DASHED, SMALL, key, name, sheet

__all__ = [
    "COLORS",
    "DASHED",
    "SENSOR",
    "SMALL",
    "THICK",
    "THIN",
    "key",
    "level",
    "name",
    "release",
    "shade",
    "sheet",
]

SENSOR = LIGHT.muted  # measured force
THICK, THIN = 1.4, 0.7  # lines of the sensor, which stands in front, and of an estimate
COLORS = {
    "CT": "#d9730d", "HA": "#b3261e", "P": "#2a78b8", "alpha_N": "#2a78b8", "alpha_H": "#b3261e", "algFE2": "#00845a",
}  # fmt: skip


def release(axes: Any, time: float, *, label: str = "") -> None:
    """Mark the instant at which the hand lets go [s]."""
    axes.axvline(time, color=LIGHT.muted, linewidth=0.9, linestyle=DASHED, zorder=1)
    if label:
        axes.annotate(
            label, (time, 1.0), xycoords=("data", "axes fraction"), xytext=(4, -2), textcoords="offset points",
            color=LIGHT.muted, fontsize=SMALL, va="top",
        )  # fmt: skip


def shade(axes: Any, time: np.ndarray, where: np.ndarray) -> None:
    """Shade the stretches of time in which something holds."""
    axes.fill_between(
        time,
        0.0,
        1.0,
        where=where,
        transform=axes.get_xaxis_transform(),
        color=LIGHT.grid,
        linewidth=0,
        zorder=0,
    )


def level(axes: Any) -> None:
    """Draw the line of zero."""
    axes.axhline(0.0, color=LIGHT.muted, linewidth=0.6, zorder=1)
