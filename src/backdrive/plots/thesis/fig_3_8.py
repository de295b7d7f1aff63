"""Fig. 3.8: mean and standard deviation of the force peaks, Setup A."""

from __future__ import annotations

from typing import Any

from backdrive.experiments import Outcome
from backdrive.plots.canvas import house_style
from backdrive.plots.thesis import _guided_plots as own


def draw(outcome: Outcome) -> Any:
    """Return the figure: bars of five cases along +q and -q, with Student's t-test against PD."""
    with house_style():
        figure, axes = own.sheet(1, 1, width=480.0, height=330.0)
        own.peak_bars(axes[0, 0], outcome.data["panels"]["setup_a"])
        own.name(axes[0, 0], "Setup A", "\n", "peak of the external force [N]")
    return figure
