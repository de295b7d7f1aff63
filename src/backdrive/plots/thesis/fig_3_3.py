"""Fig. 3.3: presliding displacement of Setup A and of Joint 0 over a slowly rising force."""

from __future__ import annotations

from typing import Any

from backdrive.experiments import Outcome
from backdrive.plots.canvas import LIGHT, house_style, pretty_unit
from backdrive.plots.thesis import _guided_plots as own


def draw(outcome: Outcome) -> Any:
    """Return the figure: (a) Setup A with two transmissions, (b) Joint 0."""
    data = outcome.data
    panels = (
        (
            "(a) Setup A",
            (
                ("setup_a", "K_c = 2.4e6 N/m", LIGHT.fitted),
                ("setup_a_soft", "K_c = 1.2e6 N/m", LIGHT.held_out),
            ),
        ),
        ("(b) Setup B, Joint 0", (("joint_0", "K_c = 1e5 N·m/rad", LIGHT.fitted),)),
    )
    with house_style():
        figure, axes = own.sheet(1, 2, width=688.0, height=270.0)
        for a, (title, entries) in zip(axes[0], panels):
            unit = data[entries[0][0]]["unit"]
            force = pretty_unit("N" if unit == "m" else "N.m")
            for found, label, color in ((data[key], label, color) for key, label, color in entries):
                a.plot(found["force"], 1e6 * found["motor"], color=color, linewidth=0.9, linestyle=own.DASHED)
                a.plot(
                    found["force"],
                    1e6 * found["counts"] * found["count"],
                    color=color,
                    linewidth=1.5,
                    label=label,
                )
            first = data[entries[0][0]]
            a.axvline(first["friction"], color=LIGHT.muted, linewidth=0.8)
            a.annotate(
                "F", (first["friction"], 1.0), xycoords=("data", "axes fraction"), xytext=(-4, -3),
                textcoords="offset points", ha="right", va="top", color=LIGHT.muted,
            )  # fmt: skip
            a.set_ylim(-0.04 * _top(first), 1.25 * _top(first))
            unit = "µm" if unit == "m" else "µrad"
            own.name(a, title, f"actuator [{force}]", f"displacement [{unit}]")
            own.key(a, "upper left")
        axes[0, 1].plot([], [], color=LIGHT.fitted, linewidth=0.9, linestyle=own.DASHED, label="true")
        own.key(axes[0, 1], "upper left")
    return figure


def _top(found: dict[str, Any]) -> float:
    reached = 1e6 * found["friction"] / found["stiffness"]
    return max(2.2 * reached, 1.5e6 * found["count"]) if found["unit"] == "m" else 1.3 * reached
