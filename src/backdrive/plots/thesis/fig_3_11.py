"""Fig. 3.11: a hand moves Setup A and Joint 0, holds them and lets go, with three decay rates."""

from __future__ import annotations

from typing import Any

from backdrive.experiments import Outcome
from backdrive.plots.canvas import house_style
from backdrive.plots.thesis import _guided_plots as own


def draw(outcome: Outcome) -> Any:
    """Return the figure: (a) Setup A, (b) Joint 0; position, velocity, actuator and external force."""
    columns = (
        ("setup_a", "(a) Setup A", "m", "N"),
        ("joint_0", "(b) Setup B, Joint 0, K_c = 1.1 K", "rad", "N·m"),
    )
    with house_style():
        figure, axes = own.sheet(4, 2, width=820.0, height=620.0, sharex="col")
        for column, (joint, title, length, force) in zip(axes.T, columns):
            data = outcome.data[joint]
            rows = (
                ("position", f"position [{'mm' if length == 'm' else 'rad'}]", 1e3 if length == "m" else 1.0),
                ("velocity", f"velocity [{length}/s]", 1.0),
                ("command", f"actuator [{force}]", 1.0),
                ("force", f"external [{force}]", 1.0),
            )
            for a, (quantity, label, factor) in zip(column, rows):
                own.lines(a, data["time"], data["cases"], quantity, factor=factor, step=2)
                own.release(a, data["released"], "released" if a is column[0] else "")
                own.name(a, title if a is column[0] else "", "", label)
            column[-1].set_xlim(0.0, data["time"][-1])
            column[-1].set_xlabel("time [s]")
        own.key(axes[1, 1], "upper right")
    return figure
