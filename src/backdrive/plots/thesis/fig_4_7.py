"""Fig. 4.7: the force of a hand, measured and estimated, Setup A without actuator force."""

from __future__ import annotations

from typing import Any

from backdrive.experiments import Outcome
from backdrive.plots.canvas import LIGHT, house_style
from backdrive.plots.thesis import _sensorless_plots as own

NAMES = {"CT": "CT: dead zone", "HA": "HA: elastoplastic", "P": "P: proposed"}


def draw(outcome: Outcome) -> Any:
    """Return the figure: position, then each estimate on the measured force."""
    data = outcome.data
    t = data["time"]
    with house_style():
        figure, axes = own.sheet(4, 1, height=560.0, sharex=True)
        top = axes[0, 0]
        top.plot(t, 1e3 * data["position"], color=LIGHT.ink, linewidth=1.3)
        own.name(top, y="position [mm]")
        own.release(top, data["released"], label="hand lets go")
        for (a,), case in zip(axes[1:], NAMES):
            a.plot(t, data["sensor"], color=own.SENSOR, linewidth=1.0, label="force sensor")
            a.plot(t, data["estimates"][case], color=own.COLORS[case], linewidth=1.1, label=NAMES[case])
            own.level(a)
            own.release(a, data["released"])
            own.name(a, y="force [N]")
            own.key(a, "upper right", 2)
        low = min(float(e.min()) for e in [data["sensor"], *data["estimates"].values()])
        high = max(float(e.max()) for e in [data["sensor"], *data["estimates"].values()])
        for (a,) in axes[1:]:
            a.set_ylim(1.05 * low, 1.25 * high)
        axes[-1, 0].set_xlim(t[0], t[-1])
        own.name(axes[-1, 0], x="time [s]", y="force [N]")
    return figure
