"""Fig. 4.3: identified friction over velocity, Setup A and Joint 0 of Setup B."""

from __future__ import annotations

from typing import Any

from backdrive.experiments import Outcome
from backdrive.plots.canvas import LIGHT, dots, house_style
from backdrive.plots.thesis import _sensorless_plots as own

TITLES = {"setup_a": "(a) Setup A", "joint_0": "(b) Setup B, Joint 0"}


def draw(outcome: Outcome) -> Any:
    """Return the figure: samples, the identified curve, the true one dashed."""
    with house_style():
        figure, axes = own.sheet(1, 2, height=300.0)
        for a, (joint, panel) in zip(axes[0], outcome.data["panels"].items()):
            length, force = ("m", "N") if panel["unit"] == "m" else ("rad", "N·m")
            dots(
                a,
                LIGHT,
                panel["samples_velocity"],
                panel["samples_friction"],
                own.SENSOR,
                size=1.6,
                alpha=0.25,
            )
            a.plot([], [], "o", color=own.SENSOR, markersize=3, label="samples")
            a.plot(panel["velocity"], panel["curve"], color=LIGHT.fitted, linewidth=1.8, label="identified")
            a.plot(
                panel["velocity"],
                panel["truth"],
                color=LIGHT.ink,
                linewidth=1.0,
                linestyle=own.DASHED,
                label="put in",
            )
            own.level(a)
            own.name(a, TITLES[joint], f"velocity [{length}/s]", f"friction [{force}]")
            own.key(a, "upper left")
    return figure
