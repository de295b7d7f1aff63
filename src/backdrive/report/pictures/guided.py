"""Pictures of a joint that a hand moves: its force without and with compensation, and the estimate beside the sensor."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.report.pictures.canvas import Theme, name_axes, pretty_unit
from backdrive.simulation.hand_demo import SHOWN, GuidedDemo

EVERY = 4  # ticks of which one is drawn


def _line(
    axes: Any, time: np.ndarray, y: np.ndarray, color: str, width: float = 1.6, style: str = "-"
) -> None:
    shown = time <= SHOWN
    axes.plot(time[shown][::EVERY], y[shown][::EVERY], color=color, linewidth=width, linestyle=style)


def draw_forces(axes: Any, theme: Theme, demo: GuidedDemo) -> None:
    """Draw the hand's force over time, without and with compensation.

    Args:
        axes: to draw on.
        theme: its colours.
        demo: what is shown.
    """
    _line(axes, demo.bare.time, demo.bare.force, theme.held_out)
    _line(axes, demo.compensated.time, demo.compensated.force, theme.fitted)
    name_axes(axes, theme, x="time [s]", y=f"force of the hand [{pretty_unit(demo.unit)}]")


def draw_estimate(axes: Any, theme: Theme, demo: GuidedDemo) -> None:
    """Draw the force sensor and the estimate from the encoder over time, without compensation.

    Args:
        axes: to draw on.
        theme: its colours.
        demo: what is shown.
    """
    _line(axes, demo.bare.time, demo.bare.sensed, theme.held_out)
    _line(axes, demo.bare.time, demo.bare.estimate, theme.ink, 1.2)
    name_axes(axes, theme, x="time [s]", y=f"force of the hand [{pretty_unit(demo.unit)}]")
