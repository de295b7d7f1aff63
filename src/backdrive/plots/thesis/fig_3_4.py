"""Fig. 3.4: identified friction over velocity, Setup A and three joints of Setup B."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.experiments import Outcome
from backdrive.plots.canvas import LIGHT, house_style
from backdrive.plots.thesis import _guided_plots as own


def draw(outcome: Outcome) -> Any:
    """Return the figure: data, identified curve, truth and intercepts of four joints."""
    with house_style():
        figure, axes = own.sheet(2, 2, width=688.0, height=480.0)
        for a, letter, (joint, panel) in zip(axes.flat, "abcd", outcome.data["panels"].items()):
            linear = panel["unit"] == "m"
            a.plot(
                panel["samples_velocity"], panel["samples_friction"], linestyle="none", marker="o", markersize=1.6, mew=0,
                color=LIGHT.fitted, alpha=0.35, label="measured",
            )  # fmt: skip
            v = panel["velocity"]
            for side in (v < 0, v > 0):
                a.plot(
                    v[side],
                    panel["curve"][side],
                    color=LIGHT.ink,
                    linewidth=1.6,
                    label="identified" if side[-1] else "",
                )
                a.plot(
                    v[side], panel["truth"][side], color=LIGHT.truth, linewidth=1.4, linestyle=own.DASHED,
                    label="truth" if side[-1] else "",
                )  # fmt: skip
            _intercepts(a, panel, "N" if linear else "N·m")
            top = 1.25 * float(np.max(np.abs(panel["curve"])))
            a.set_ylim(-top, top)
            own.name(
                a,
                f"({letter}) {'' if linear else 'Setup B, '}{own.title(joint)}",
                f"velocity [{'m' if linear else 'rad'}/s]",
                f"friction [{'N' if linear else 'N·m'}]",
            )
        own.key(axes[0, 0], "lower right")
    return figure


def _intercepts(axes: Any, panel: dict[str, Any], unit: str) -> None:
    F_p, F_n = panel["intercepts"]
    true_p, true_n = panel["true_intercepts"]
    axes.plot(
        [0, 0],
        [F_p, -F_n],
        linestyle="none",
        marker="o",
        markersize=4.5,
        mfc=LIGHT.paper,
        mec=LIGHT.ink,
        zorder=5,
    )
    axes.annotate(
        f"F_p = {F_p:.2f} ({true_p:.2f}) {unit}\nF_n = {F_n:.2f} ({true_n:.2f}) {unit}", (0.02, 0.97), xycoords="axes fraction",
        ha="left", va="top", color=LIGHT.ink, fontsize=own.SMALL, parse_math=False,
    )  # fmt: skip
