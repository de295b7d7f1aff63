"""Fig. 4.11: position and measured force with three decay rates, Setup A and Joint 0."""

from __future__ import annotations

from typing import Any

from backdrive.experiments import Outcome
from backdrive.plots.canvas import LIGHT, house_style
from backdrive.plots.thesis import _sensorless_plots as own

TITLES = {"setup_a": "(a) Setup A", "joint_0": "(b) Setup B, Joint 0"}
NAMES = {"alpha_N": "α = 20 1/s", "alpha_H": "α = 500 1/s", "algFE2": "algFE2"}


def draw(outcome: Outcome) -> Any:
    """Return the figure: a column a machine; position above, force below."""
    with house_style():
        figure, axes = own.sheet(2, 2, height=400.0, sharex="col")
        for column, (machine, title) in enumerate(TITLES.items()):
            data = outcome.data[machine]
            above, below = axes[:, column]
            factor, unit, force = (1e3, "mm", "N") if data["unit"] == "m" else (1.0, "rad", "N·m")
            for case, series in data["cases"].items():
                how: dict[str, Any] = {"color": own.COLORS[case], "linewidth": 1.4, "label": NAMES[case]}
                if case == "algFE2":
                    how["linestyle"] = own.DASHED
                above.plot(data["time"], factor * series["position"], **how)
                below.plot(data["time"], series["force"], **(how | {"linewidth": 1.0}))
            low, high = above.get_ylim()
            above.set_ylim(low, high + 0.15 * (high - low))
            own.release(above, data["released"], label="hand lets go")
            own.release(below, data["released"])
            own.level(below)
            own.name(above, title, y=f"position [{unit}]")
            own.name(below, x="time [s]", y=f"force sensor [{force}]")
            below.set_xlim(0.3, data["time"][-1])
        own.key(axes[0, 0], "lower right")
        for a in axes.flat:
            a.yaxis.label.set_color(LIGHT.ink)
    return figure
