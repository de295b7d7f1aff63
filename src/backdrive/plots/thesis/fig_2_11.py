"""Fig. 2.11: velocity and hand torque of Joints 0, 1, 2 and 4 over time."""

from __future__ import annotations

from typing import Any

from backdrive.experiments import Outcome
from backdrive.plots.canvas import LIGHT, house_style
from backdrive.plots.thesis import _sweep_plots as own

SHOWN = 4.0  # of time [s]


def draw(outcome: Outcome) -> Any:
    """Return the figure: a row a joint; velocity, torque of the firm hand, torque of the soft hand."""
    with house_style():
        figure, axes = own.sheet(4, 3, width=760.0, height=560.0, sharex=True)
        for row, (joint, hands) in zip(axes, outcome.data.items()):
            for a, (hand, column) in zip(row, (("firm", "velocity"), ("firm", "torque"), ("soft", "torque"))):
                d = hands[hand]
                part = d["time"] < d["time"][0] + SHOWN
                t = d["time"][part] - d["time"][0]
                for when, color, label in (
                    ("before", own.BEFORE, "none"),
                    ("after", own.AFTER, "compensated"),
                ):
                    a.plot(
                        *own.thin(t, d[f"{column}_{when}"][part], 6), color=color, linewidth=1.1, label=label
                    )
            own.name(row[0], own.joint_title(joint), y="velocity [rad/s]")
            own.name(row[1], "firm hand" if joint == "joint_0" else "", y="torque [N·m]")
            own.name(row[2], "soft hand, same speed" if joint == "joint_0" else "")
        for a in axes[-1]:
            a.set_xlabel("time [s]", color=LIGHT.ink)
        own.key(axes[0, 0], "lower left", 2, bbox_to_anchor=(0.25, 1.0))
    return figure
