"""Fig. 3.9: time series while a hand guides three joints of Setup B."""

from __future__ import annotations

from typing import Any

from backdrive.experiments import Outcome
from backdrive.plots.canvas import house_style
from backdrive.plots.thesis import _guided_plots as own

ROWS = (
    ("position", "position [rad]"),
    ("velocity", "velocity [rad/s]"),
    ("command", "actuator [N·m]"),
    ("force", "external torque [N·m]"),
)


def draw(outcome: Outcome) -> Any:
    """Return the figure: a column a joint; position, velocity, actuator and external torque of the five cases."""
    with house_style():
        figure, axes = own.sheet(len(ROWS), len(outcome.data), width=960.0, height=620.0, sharex=True)
        for column, (joint, data) in zip(axes.T, outcome.data.items()):
            for a, (quantity, label) in zip(column, ROWS):
                own.lines(a, data["zoom"]["time"], data["zoom"]["cases"], quantity, step=3)
                own.name(
                    a, own.title(joint) if a is column[0] else "", "", label if joint == "joint_0" else ""
                )
            own.edges(column[-1], data["edges"])
            column[-1].set_xlim(data["edges"][0], data["edges"][-1])
            column[-1].set_xlabel("time [s]")
        own.key(axes[0, -1], "lower right", 5, bbox_to_anchor=(1.0, 1.0))
    return figure
