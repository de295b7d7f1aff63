"""Fig. 2.3: velocity and torque of a sweep over time, one cycle enlarged, and torque over velocity."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.experiments import Outcome
from backdrive.plots.canvas import LIGHT, house_style
from backdrive.plots.thesis import _sweep_plots as own


def draw(outcome: Outcome) -> Any:
    """Return the figure: (a) the whole sweep, (b) one cycle with its windows, (c) torque over velocity with the pairs."""
    d = outcome.data
    t, v, f, used = d["time"], d["velocity"], d["torque"], d["used"]
    n = int(d["shown"])
    begin, end = d["windows"][n - 1]
    cycle = (t >= begin) & (t < end)
    threshold = d["share"] * d["speeds"][n - 1]
    with house_style():
        figure, axes = own.sheet(2, 3, height=360.0, width=760.0, width_ratios=(1.2, 1.0, 1.1))
        for row, y, label in ((0, v, "velocity [rad/s]"), (1, f, "torque [N·m]")):
            whole, one = axes[row, 0], axes[row, 1]
            whole.plot(*own.thin(t, y, 4), color=LIGHT.muted, linewidth=0.7)
            one.plot(t[cycle], y[cycle], color=LIGHT.muted, linewidth=0.9)
            for sign, color in ((1, LIGHT.fitted), (-1, LIGHT.held_out)):
                part = used == sign
                whole.plot(t[part], y[part], ".", color=color, markersize=1.2, rasterized=True)
                one.plot(t[part & cycle], y[part & cycle], ".", color=color, markersize=2.0, rasterized=True)
            own.name(whole, "(a) whole sweep" if row == 0 else "", "time [s]" if row else "", label)
            own.name(one, f"(b) cycle n = {n}" if row == 0 else "", "time [s]" if row else "")
        for sign in (1, -1):
            axes[0, 1].axhline(sign * threshold, color=LIGHT.ink, linewidth=0.8, linestyle=own.DASHED)
        axes[0, 1].annotate(
            "cnV/N",
            (end, threshold),
            xytext=(0, 3),
            textcoords="offset points",
            ha="right",
            fontsize=own.SMALL,
        )
        for sign, F in ((1, d["F_pos"][n - 1]), (-1, -d["F_neg"][n - 1])):
            axes[1, 1].axhline(F, color=LIGHT.ink, linewidth=0.8, linestyle=own.DASHED)
            axes[1, 1].annotate(
                "F⁺" if sign > 0 else "F⁻",
                (end, F), xytext=(0, 3), textcoords="offset points", ha="right", fontsize=own.SMALL,
            )  # fmt: skip
        for a in axes[:, 2]:
            a.remove()
        plane = figure.add_subplot(axes[0, 0].get_gridspec()[:, 2])
        plane.grid(True, color=LIGHT.grid, linewidth=0.7)
        for side in ("top", "right", "left"):
            plane.spines[side].set_visible(False)
        plane.tick_params(colors=LIGHT.muted, labelsize=own.SMALL)
        plane.plot(*own.thin(v, f, 2), ",", color=LIGHT.band, rasterized=True)
        for sign, color, label in (
            (1, LIGHT.fitted, "used, along +q"),
            (-1, LIGHT.held_out, "used, along −q"),
        ):
            plane.plot(
                v[used == sign],
                f[used == sign],
                ".",
                color=color,
                markersize=1.5,
                label=label,
                rasterized=True,
            )
        V = np.concatenate([d["V"], -d["V"]])
        plane.plot(
            V,
            np.concatenate([d["F_pos"], -d["F_neg"]]),
            "o",
            color=LIGHT.paper,
            mec=LIGHT.ink,
            ms=5,
            label="averages",
        )
        own.name(plane, "(c) torque over velocity", "velocity [rad/s]", "torque [N·m]")
        own.key(plane, "upper left")
    return figure
