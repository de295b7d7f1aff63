"""Fig. 2.9: inertia and gravity of five postures, and the curves that were identified in them."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.experiments import Outcome
from backdrive.plots.canvas import LIGHT, house_style
from backdrive.plots.thesis import _sweep_plots as own


def draw(outcome: Outcome) -> Any:
    """Return the figure: (a) inertia and gravity, (b) curves as printed, (c) the same with load-dependent friction."""
    d = outcome.data
    v = np.linspace(1e-6, 2.0, 200)
    loads = list(d["curves"])
    with house_style():
        figure, axes = own.sheet(1, 3, height=270.0, width=760.0)
        a, second = axes[0, 0], axes[0, 0].twinx()
        x = np.arange(len(d["inertia"]))
        a.bar(x - 0.2, list(d["inertia"].values()), 0.37, color=LIGHT.fitted, zorder=2)
        second.bar(x + 0.2, list(d["gravity"].values()), 0.37, color=LIGHT.held_out, zorder=2)
        a.set_xticks(x, list(d["inertia"]))
        a.grid(False)
        own.name(a, "(a) postures", "posture", "inertia [kg·m²]")
        second.set_ylabel("gravity at the center [N·m]", color=LIGHT.held_out)
        a.yaxis.label.set_color(LIGHT.fitted)
        for side in ("top", "right", "left"):
            second.spines[side].set_visible(False)
        second.tick_params(colors=LIGHT.muted, labelsize=own.SMALL)
        panels = (
            (axes[0, 1], loads[0], "(b) friction"),
            (axes[0, 2], loads[-1], f"(c) growing {loads[-1]:g} by load"),
        )
        for panel, mu, title in panels:
            for color, (posture, curves) in zip(own.SERIES, d["curves"][mu].items()):
                panel.plot(v, curves["literal"].torque(v), color=color, linewidth=1.3, label=posture)
            panel.set_ylim(0.0, 20.0)
            own.name(panel, title, "velocity [rad/s]", "friction [N·m]")
        own.key(axes[0, 1], "lower right", 2)
    return figure
