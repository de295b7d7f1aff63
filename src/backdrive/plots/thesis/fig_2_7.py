"""Fig. 2.7: identified curves of Joints 0 to 2, a colour a stroke."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.experiments import Outcome
from backdrive.plots.canvas import LIGHT, house_style
from backdrive.plots.thesis import _sweep_plots as own


def draw(outcome: Outcome) -> Any:
    """Return the figure: as printed above, aligned below, the true curve dashed."""
    v = np.linspace(1e-6, 2.0, 200)
    curves, truth = outcome.data["curves"], outcome.data["truth"]
    with house_style():
        figure, axes = own.sheet(2, 3, height=400.0, sharex=True, sharey="col")
        for row, method in enumerate(("literal", "aligned")):
            for column, (joint, by_stroke) in enumerate(curves.items()):
                a = axes[row, column]
                for color, (stroke, found) in zip(own.SERIES, by_stroke.items()):
                    if method in found:
                        a.plot(
                            v,
                            found[method].torque(v),
                            color=color,
                            linewidth=1.3,
                            label=f"A = {stroke:g} deg",
                        )
                a.plot(
                    v,
                    truth[joint].torque(v),
                    color=LIGHT.ink,
                    linewidth=1.0,
                    linestyle=own.DASHED,
                    label="put in",
                )
                a.set_ylim(bottom=0.0)
                word = {"literal": "as printed", "aligned": "aligned"}[method]
                own.name(a, f"{own.joint_title(joint)}, {word}", "velocity [rad/s]" if row else "")
            axes[row, 0].set_ylabel("friction [N·m]", color=LIGHT.ink)
        own.key(axes[0, 0], "lower right")
    return figure
