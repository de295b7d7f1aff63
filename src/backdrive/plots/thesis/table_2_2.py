"""Table 2.2 as bars: what is printed beside what the simulated joint gives."""

from __future__ import annotations

from typing import Any

from backdrive.experiments import Outcome
from backdrive.plots.canvas import LIGHT, house_style
from backdrive.plots.thesis import _sweep_plots as own


def draw(outcome: Outcome) -> Any:
    """Return the figure: E_p by posture; one colour for the thesis, one a load dependence."""
    printed, errors = outcome.data["printed"], outcome.data["errors"]
    loads = sorted({mu for mu, _ in errors})
    series = {"thesis": list(printed.values())}
    series |= {
        f"friction growing {mu:g} by load" if mu else "friction": list(errors[mu, "literal"].values())
        for mu in loads
    }
    series["friction, aligned"] = list(errors[0.0, "aligned"].values())
    colors = dict(zip(series, (LIGHT.ink, *own.SERIES)))
    with house_style():
        figure, axes = own.sheet(1, 1, height=260.0, width=520.0)
        a = axes[0, 0]
        own.bars(a, list(printed), series, colors)
        own.name(a, "", "posture P", "E_p(P, (i)) [%]")
        own.key(a, "upper left")
    return figure
