"""Fig. 3.7: time series while a hand guides Setup A."""

from __future__ import annotations

from typing import Any

from backdrive.experiments import Outcome
from backdrive.plots.canvas import LIGHT, house_style
from backdrive.plots.thesis import _guided_plots as own

ZOOMED = (
    ("position", "position [mm]", 1e3),
    ("velocity", "velocity [m/s]", 1.0),
    ("command", "actuator [N]", 1.0),
    ("force", "external [N]", 1.0),
)


def draw(outcome: Outcome) -> Any:
    """Return the figure: (a) external force through the whole run, a strip a case; (b) some windows in full."""
    whole, zoom, edges = outcome.data["whole"], outcome.data["zoom"], outcome.data["edges"]
    strips = len(whole["cases"])
    with house_style():
        figure, axes = own.sheet(
            strips + len(ZOOMED),
            1,
            width=760.0,
            height=880.0,
            height_ratios=[0.62] * strips + [1.1] * len(ZOOMED),
        )
        column = axes[:, 0]
        top = max(float(abs(c["force"]).max()) for c in whole["cases"].values())
        for a, (case, columns) in zip(column, whole["cases"].items()):
            own.lines(a, whole["time"], {case: columns}, "force", linewidth=0.8)
            a.set_ylim(-1.1 * top, 1.1 * top)
            a.set_xlim(0.0, whole["time"][-1])
            a.axvspan(edges[0], edges[-1], color=LIGHT.grid, zorder=0, linewidth=0)
            a.set_yticks([-20, 0, 20])
            own.name(a, "", "", f"{case} [N]")
            a.tick_params(labelbottom=a is column[strips - 1])
        own.name(column[0], "(a) External force, 30 cycles", "", "NC [N]")
        own.name(column[strips - 1], "", "time [s]", "PD [N]")
        for a, (quantity, label, factor) in zip(column[strips:], ZOOMED):
            own.lines(a, zoom["time"], zoom["cases"], quantity, factor=factor, step=3)
            a.set_xlim(edges[0], edges[-1])
            own.name(a, "", "", label)
            a.tick_params(labelbottom=a is column[-1])
        own.edges(column[-1], edges)
        own.name(column[strips], "(b) The shaded part", "", ZOOMED[0][1])
        own.name(column[-1], "", "time [s]", ZOOMED[-1][1])
        own.key(column[strips], "lower right", strips, bbox_to_anchor=(1.0, 1.0))
    return figure
