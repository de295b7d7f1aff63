"""Fig. 3.10: mean and standard deviation of the peaks of the external torque, Setup B."""

from __future__ import annotations

from typing import Any

from backdrive.experiments import Outcome
from backdrive.plots.canvas import house_style
from backdrive.plots.thesis import _guided_plots as own


def draw(outcome: Outcome) -> Any:
    """Return the figure: a panel a joint, bars of five cases along +q and -q, with Student's t-test against PD."""
    panels = outcome.data["panels"]
    with house_style():
        figure, axes = own.sheet(1, len(panels), width=900.0, height=330.0)
        for a, (joint, panel) in zip(axes[0], panels.items()):
            own.peak_bars(a, panel)
            own.name(
                a, own.title(joint), "\n", "peak of the external torque [N·m]" if joint == "joint_0" else ""
            )
            a.tick_params(axis="x", labelsize=own.SMALL - 2.0)
    return figure
