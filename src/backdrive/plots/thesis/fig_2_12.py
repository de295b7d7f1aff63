"""Fig. 2.12: mean magnitudes of velocity and hand torque, bars by joint."""

from __future__ import annotations

from typing import Any

from backdrive.experiments import Outcome
from backdrive.plots.canvas import LIGHT, house_style
from backdrive.plots.thesis import _sweep_plots as own

ROWS = ("firm hand", "soft hand, same speed")


def draw(outcome: Outcome) -> Any:
    """Return the figure: velocities above, torques below, by kind of hand; the part of inertia in lighter bars."""
    colors = {"none": own.BEFORE, "compensated": own.AFTER, "of that, inertia": LIGHT.held_out}
    with house_style():
        figure, axes = own.sheet(2, 2, height=420.0, sharex="col", sharey="row")
        for column, row in enumerate(ROWS):
            found = outcome.data[row]
            groups = [own.joint_title(joint) for joint in found]
            speeds = {"none": [d["speeds"][0] for d in found.values()]}
            speeds["compensated"] = [d["speeds"][1] for d in found.values()]
            torques = {"none": [d["torques"][0] for d in found.values()]}
            torques["compensated"] = [d["torques"][1] for d in found.values()]
            torques["of that, inertia"] = [d["inertia"] for d in found.values()]
            own.bars(axes[0, column], groups, speeds, colors)
            own.bars(axes[1, column], groups, torques, colors)
            own.name(axes[0, column], row.capitalize())
            for i, (before, after) in enumerate(zip(torques["none"], torques["compensated"])):
                axes[1, column].annotate(
                    f"−{100 * (1 - after / before):.0f} %",
                    (i, max(before, after)),
                    xytext=(0, 3),
                    textcoords="offset points",
                    ha="center",
                    color=LIGHT.ink,
                    fontsize=own.SMALL,
                )
        axes[0, 0].set_ylabel("V_s [rad/s]", color=LIGHT.ink)
        axes[1, 0].set_ylabel("F_s [N·m]", color=LIGHT.ink)
        own.key(axes[1, 0], "upper right")
    return figure
