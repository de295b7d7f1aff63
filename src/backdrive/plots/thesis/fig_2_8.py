"""Fig. 2.8: distance of each curve from that of A = 50 deg, bars by joint and stroke."""

from __future__ import annotations

from typing import Any

from backdrive.experiments import Outcome
from backdrive.plots.canvas import house_style
from backdrive.plots.thesis import _sweep_plots as own


def draw(outcome: Outcome) -> Any:
    """Return the figure: as printed left, aligned right, on one logarithmic scale."""
    with house_style():
        figure, axes = own.sheet(1, 2, height=250.0, sharey=True)
        for a, (method, found) in zip(axes[0], outcome.data["distances"].items()):
            strokes = [A for A in next(iter(found.values())) if A != 50.0]
            series = {f"A = {A:g} deg": [by_stroke[A] for by_stroke in found.values()] for A in strokes}
            own.bars(a, [own.joint_title(j) for j in found], series, dict(zip(series, own.SERIES)))
            a.set_yscale("log")
            a.minorticks_off()
            own.name(a, {"literal": "as printed", "aligned": "aligned"}[method])
        axes[0, 0].set_ylabel("E(A, 50 deg) [N·m]")
        own.key(axes[0, 1], "upper right", 2)
    return figure
