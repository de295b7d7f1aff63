"""Fig. 4.10: the measured force and that on the virtual object, (4.19)."""

from __future__ import annotations

from typing import Any

from backdrive.experiments import Outcome
from backdrive.plots.canvas import house_style
from backdrive.plots.thesis import _sensorless_plots as own


def draw(outcome: Outcome) -> Any:
    """Return the figure: a row a case."""
    data, cases = outcome.data, outcome.data["cases"]
    t = data["time"]
    with house_style():
        figure, axes = own.sheet(len(cases), 1, height=480.0, sharex=True, sharey=True)
        for (a,), (case, series) in zip(axes, cases.items()):
            a.plot(t, series["sensor"], color=own.SENSOR, linewidth=1.0, label="force sensor")
            a.plot(t, series["virtual"], color=own.COLORS[case], linewidth=1.3, label="m q'' + b q'")
            own.level(a)
            distance = outcome.numbers[f"distance.{case}"]
            own.name(a, f"{case}: RMS distance {distance:.1f} N", y="force [N]")
            a.set_xlim(t[0], t[-1])
        low, high = axes[0, 0].get_ylim()
        axes[0, 0].set_ylim(low, high + 0.25 * (high - low))
        own.key(axes[0, 0], "upper right", 2)
        axes[-1, 0].set_xlabel("time [s]")
    return figure
