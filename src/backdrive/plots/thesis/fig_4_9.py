"""Fig. 4.9: an equilibrium in which the actuator pushes against friction and no external force is estimated."""

from __future__ import annotations

from typing import Any

from backdrive.experiments import Outcome
from backdrive.plots.canvas import LIGHT, house_style
from backdrive.plots.thesis import _sensorless_plots as own

FORCES = {
    "external": "estimated external force",
    "friction": "estimated friction",
    "command": "actuator force",
}
BARS = {"external": "external", "friction": "friction", "command": "actuator", "free": "actuator,\nlet go"}


def draw(outcome: Outcome) -> Any:
    """Return the figure: position and forces with HA over time, rest shaded; means at rest by estimator."""
    data = outcome.data
    t = data["time"]
    with house_style():
        figure, axes = own.sheet(4, 1, height=620.0)
        top, *rows = axes[:, 0]
        series = {
            "position": 1e3 * data["position"],
            "external": data["external"],
            "friction": data["friction"],
        }
        series["command"] = data["command"]
        for a, (what, values) in zip((top, rows[0], rows[1]), list(series.items())):
            own.shade(a, t, data["rest"])
            a.set_xlim(t[0], t[-1])
            color = own.COLORS["HA"] if what == "external" else LIGHT.ink
            a.plot(t, values, color=color, linewidth=1.2, label=FORCES.get(what))
        rows[1].plot(
            t,
            data["command"],
            color=own.COLORS["CT"],
            linewidth=1.4,
            linestyle=own.DASHED,
            label=FORCES["command"],
        )
        own.name(top, "(a) HA; shaded: at rest", y="position [mm]")
        for a in rows[:2]:
            own.level(a)
            own.name(a, y="force [N]")
            own.key(a, "upper right", 2)
            low, high = a.get_ylim()
            a.set_ylim(low, high + 0.3 * (high - low))
        own.name(rows[1], x="time [s]", y="force [N]")
        below = rows[2]
        cases = tuple(data["balance"]["external"])
        for i, case in enumerate(cases):
            heights = [data["balance"][what][case] for what in BARS]
            places = [k + 0.25 * (i - 1) for k in range(len(BARS))]
            below.bar(places, heights, 0.22, color=own.COLORS[case], label=case, zorder=2)
        below.set_xticks(range(len(BARS)), list(BARS.values()))
        below.grid(False, axis="x")
        own.name(below, "(b) mean magnitudes at rest", y="force [N]")
        own.key(below, "upper left", 3)
    return figure
