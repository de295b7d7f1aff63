"""Fig. 2.2: desired position and velocity over time, with the instants T_n."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.experiments import Outcome
from backdrive.plots.canvas import LIGHT, house_style
from backdrive.plots.thesis import _sweep_plots as own


def draw(outcome: Outcome) -> Any:
    """Return the figure: position above, velocity below, cycles marked."""
    data = outcome.data["literal"]
    t, windows = data["time"], data["windows"]
    edges = np.append(windows[:, 0], windows[-1, 1])
    with house_style():
        figure, axes = own.sheet(2, 1, height=330.0, sharex=True)
        (top,), (below,) = axes
        top.plot(*own.thin(t, np.rad2deg(data["position"]), 5), color=LIGHT.ink, linewidth=1.4)
        below.plot(*own.thin(t, data["velocity"], 5), color=LIGHT.ink, linewidth=1.4)
        for (begin, end), speed in zip(windows, data["speeds"]):
            for sign in (1, -1):
                below.plot(
                    [begin, end], [sign * speed] * 2, color=LIGHT.fitted, linewidth=1.0, linestyle=own.DASHED
                )
        for a in (top, below):
            for n, edge in enumerate(edges, start=1):
                a.axvline(edge, color=LIGHT.muted, linewidth=0.6, zorder=1)
                if a is top:
                    a.annotate(
                        f"T{n}", (edge, 1.0), xycoords=("data", "axes fraction"), xytext=(0, 2),
                        textcoords="offset points", ha="center", color=LIGHT.muted, fontsize=own.SMALL,
                    )  # fmt: skip
        own.name(top, y="position p_d [deg]")
        own.name(below, x="time [s]", y="velocity v_d [rad/s]")
        below.plot([], [], color=LIGHT.fitted, linewidth=1.0, linestyle=own.DASHED, label="±nV/N")
        own.key(below, "lower left")
    return figure
