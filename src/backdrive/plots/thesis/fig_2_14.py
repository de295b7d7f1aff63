"""Fig. 2.14: tracking errors of four compensations, and how they go with the damping ratio."""

from __future__ import annotations

from typing import Any

from backdrive.experiments import Outcome
from backdrive.plots.canvas import LIGHT, house_style
from backdrive.plots.thesis import _sweep_plots as own
from backdrive.plots.thesis.fig_2_13 import COLORS


def draw(outcome: Outcome) -> Any:
    """Return the figure: bars of E_s by joint, and below E_s by that of MO over the damping ratio of the PD."""
    errors, ratios = outcome.data["errors"], outcome.data["ratios"]
    with house_style():
        figure, axes = own.sheet(2, 4, width=760.0, height=420.0, sharey="row")
        for a in axes[0]:
            a.remove()
        top = figure.add_subplot(axes[0, 0].get_gridspec()[0, :])
        for side in ("top", "right", "left"):
            top.spines[side].set_visible(False)
        top.grid(True, color=LIGHT.grid, linewidth=0.7)
        top.tick_params(colors=LIGHT.muted, labelsize=own.SMALL)
        series = {case: [1e3 * e[case] for e in errors.values()] for case in COLORS}
        own.bars(top, [own.joint_title(joint) for joint in errors], series, COLORS)
        own.name(top, "(a) at a damping ratio of 0.5", y="E_s [mrad]")
        own.key(top, "upper right", 4)
        for i, (a, (joint, by_ratio)) in enumerate(zip(axes[1], ratios.items())):
            for case in ("MO", "MOL", "MOP"):
                relative = [e[case] / e["MO"] for e in by_ratio.values()]
                a.plot(
                    list(by_ratio),
                    relative,
                    "o-",
                    color=COLORS[case],
                    markersize=3,
                    linewidth=1.2,
                    label=case,
                )
            a.axvspan(0.5, 1.0, color=LIGHT.grid, alpha=0.45, zorder=0, linewidth=0)
            a.set_xlim(0.0, 1.02)
            own.name(
                a, f"(b) {own.joint_title(joint)}" if i == 0 else own.joint_title(joint), "damping ratio"
            )
        axes[1, 0].set_ylabel("E_s by that of MO", color=LIGHT.ink)
    return figure
