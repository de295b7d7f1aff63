"""Fig. 2.13: saw-tooth tracking of Joints 0, 1, 2 and 4 over time with four compensations."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.experiments import Outcome
from backdrive.plots.canvas import LIGHT, house_style
from backdrive.plots.thesis import _sweep_plots as own

COLORS = {"NC": LIGHT.muted, "MO": "#b3261e", "MOL": "#d9730d", "MOP": "#2a78b8"}


def draw(outcome: Outcome) -> Any:
    """Return the figure: a row a joint; position left, error right."""
    with house_style():
        figure, axes = own.sheet(4, 2, width=760.0, height=620.0, sharex=True)
        for (left, right), (joint, d) in zip(axes, outcome.data.items()):
            left.plot(
                d["time"], d["wanted"], color=LIGHT.ink, linewidth=0.9, linestyle=own.DASHED, label="desired"
            )
            for case, color in COLORS.items():
                left.plot(d["time"], d[case], color=color, linewidth=0.9, label=case)
                right.plot(d["time"], 1e3 * (d["wanted"] - d[case]), color=color, linewidth=0.9, label=case)
            largest = 1e3 * float(np.abs(d["wanted"] - d["NC"]).max())
            right.set_ylim(-1.25 * largest, 1.25 * largest)
            own.name(left, own.joint_title(joint), y="position [rad]")
            own.name(right, y="error [mrad]")
        for a in axes[-1]:
            a.set_xlabel("time [s]", color=LIGHT.ink)
        own.key(axes[0, 0], "lower left", 5, bbox_to_anchor=(0.2, 1.0))
    return figure
