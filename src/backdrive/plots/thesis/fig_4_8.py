"""Fig. 4.8: position and measured force under admittance control with three friction estimators, Setup A."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.experiments import Outcome
from backdrive.plots.canvas import LIGHT, house_style
from backdrive.plots.thesis import _sensorless_plots as own


def draw(outcome: Outcome) -> Any:
    """Return the figure: a column a case, position above, force below."""
    data, cases = outcome.data, outcome.data["cases"]
    t = data["time"]
    with house_style():
        figure, axes = own.sheet(2, len(cases), height=330.0, sharex=True, sharey="row")
        for column, (case, series) in enumerate(cases.items()):
            above, below = axes[:, column]
            above.plot(t, 1e3 * series["position"], color=LIGHT.ink, linewidth=1.3)
            below.plot(t, series["force"], color=own.COLORS[case], linewidth=1.0)
            own.level(below)
            peak = outcome.numbers[f"m = 2.{case}.peak"]
            for sign in (1.0, -1.0):
                below.axhline(sign * peak, color=LIGHT.muted, linewidth=0.9, linestyle=own.DASHED, zorder=1)
            own.name(above, case)
            own.name(below, x="time [s]")
        axes[0, 0].set_ylabel("position [mm]", color=LIGHT.ink)
        axes[1, 0].set_ylabel("force sensor [N]", color=LIGHT.ink)
        axes[1, 0].plot([], [], color=LIGHT.muted, linewidth=0.9, linestyle=own.DASHED, label="mean peak")
        own.key(axes[1, 0], "upper right")
        most = max(float(np.abs(series["force"]).max()) for series in cases.values())
        axes[1, 0].set_ylim(-1.1 * most, 1.35 * most)
    return figure
