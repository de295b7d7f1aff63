"""Table 2.2: distance (2.17) of each posture's curve from that of posture (i)."""

from __future__ import annotations

from typing import Any

from backdrive.report.pictures.canvas import LIGHT, house_style
from backdrive.thesis import _sweep_plots as own
from backdrive.thesis._sweeps import (
    LOADS,
    METHODS,
    SETTING,
    TABLE_2_2,
    by_posture,
    posture_errors,
    truth_check,
)
from backdrive.thesis.outcome import Claim, Outcome

LOADED = LOADS[
    -1
]  # growth of Coulomb friction with the transmitted torque that comes nearest to the table [-]


def run(seed: int = 0) -> Outcome:
    """Return E_p of (2.17) by posture, without and with friction that grows with the load."""
    found, plain = {}, by_posture(seed)
    for mu in LOADS:
        runs = by_posture(seed, mu) if mu else plain
        for method in METHODS:
            found[mu, method] = posture_errors(runs, method)
    loaded = found[LOADED, "literal"]
    claims = [
        Claim(
            what="E_p of (2.17) by posture, friction independent of load",
            thesis=_row(TABLE_2_2),
            ours=f"{_row(found[0.0, 'literal'])} as printed, {_row(found[0.0, 'aligned'])} aligned",
            holds=None,
            why="The postures' inertia and gravity are not printed; these are assumed, in the order that the caption of "
            "Fig. 2.9 gives.",
        ),
        Claim(
            what=f"The same with {LOADED:g} N.m of friction a N.m of load",
            thesis=_row(TABLE_2_2),
            ours=_row(loaded),
            holds=None,
            why="Its order is that of the loads that were assumed. Warmth or position could drive the postures apart as well.",
        ),
    ]
    claims.append(truth_check(plain.values()))
    return Outcome(
        name="table-2.2",
        title="Distance of each posture's curve from that of posture (i)",
        setting=f"{SETTING} Joint 1, A = 20 deg; inertia and gravity of the postures are assumed.",
        claims=tuple(claims),
        data={"errors": found, "printed": TABLE_2_2},
        numbers={f"{name}_{m}_load_{mu:g}": E[name] for (mu, m), E in found.items() for name in TABLE_2_2},
    )


def _row(values: dict[str, float]) -> str:
    return ", ".join(f"{v:.2f}" for v in values.values()) + " %"


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
    colors = dict(zip(series, (LIGHT.ink, *own.SERIES), strict=False))
    with house_style():
        figure, axes = own.sheet(1, 1, height=260.0, width=520.0)
        a = axes[0, 0]
        own.bars(a, list(printed), series, colors)
        own.name(a, "", "posture P", "E_p(P, (i)) [%]")
        own.key(a, "upper left")
    return figure
