"""Fig. 2.6: torque of Joint 1 over velocity and identified curves, a panel a stroke."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.experiments import Outcome
from backdrive.plots.canvas import LIGHT, house_style
from backdrive.plots.thesis import _sweep_plots as own


def draw(outcome: Outcome) -> Any:
    """Return the figure: measured loops behind the curve of (2.7), as printed and aligned."""
    v = np.linspace(1e-6, 2.0, 120)
    both = np.concatenate([-v[::-1], v])
    with house_style():
        figure, axes = own.sheet(2, 3, height=400.0, sharex=True, sharey=True)
        for a, (stroke, d) in zip(axes.flat, outcome.data.items()):
            every = max(1, d["velocity"].size // 6000)
            a.plot(
                d["velocity"][::every],
                d["torque"][::every],
                color=LIGHT.band,
                linewidth=0.35,
                label="measured",
            )
            for method, color in (("literal", LIGHT.held_out), ("aligned", LIGHT.fitted)):
                if method in d["curves"]:
                    label = {"literal": "as printed", "aligned": "aligned"}[method]
                    a.plot(both, d["curves"][method].torque(both), color=color, linewidth=1.5, label=label)
            a.set(xlim=(-2.1, 2.1), ylim=(-60, 60))
            own.name(a, f"A = {stroke} deg")
        last = axes.flat[5]
        last.axis("off")
        handles, labels = axes.flat[0].get_legend_handles_labels()
        last.legend(handles, labels, loc="center", frameon=False, labelcolor=LIGHT.ink)
        for a in (axes[1, 0], axes[1, 1], axes[0, 2]):
            a.set_xlabel("velocity [rad/s]", color=LIGHT.ink)
            a.tick_params(labelbottom=True)
        for a in axes[:, 0]:
            a.set_ylabel("torque [N·m]", color=LIGHT.ink)
    return figure
