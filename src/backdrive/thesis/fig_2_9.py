"""Fig. 2.9: identified curves of Joint 1 in five postures; Iwatani 2017, 2.4.3."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.report.pictures.canvas import LIGHT, house_style
from backdrive.thesis import _sweep_plots as own
from backdrive.thesis._sweeps import (
    LOADS,
    METHODS,
    POSTURES,
    SETTING,
    by_posture,
    in_posture,
    number_list,
    posture_errors,
    truth_check,
)
from backdrive.thesis.outcome import Claim, Outcome


def run(seed: int = 0) -> Outcome:
    """Sweep Joint 1 over 20 degrees in the five postures, without and with friction that grows with the load."""
    runs = {mu: by_posture(seed, mu) for mu in LOADS}
    plain = runs[0.0]
    worst = {m: max(posture_errors(plain, m).values()) for m in METHODS}
    carried = {name: _gravity(name) for name in POSTURES}
    spread = [max(posture_errors(runs[mu], "aligned").values()) for mu in LOADS]
    inertia = {name: POSTURES[name][0] for name in POSTURES}
    claims = (
        Claim(
            what="Inertia and gravity in the postures, which the thesis orders: inertia from (i) to (v), gravity from (v) to (ii)",
            ours=f"{number_list(inertia.values())} kg.m^2; {number_list(carried.values())} N.m",
            holds=None,
            why="So chosen: the thesis gives the order and no numbers.",
        ),
        Claim(
            what="The curves of all postures, as printed",
            ours=f"at most {worst['literal']:.2f} % apart",
            holds=None,
            why="Inertia and gravity of the postures are not printed, and these are assumed.",
        ),
        Claim(
            what="The same, aligned",
            ours=f"at most {worst['aligned']:.3f} %",
            gate="at most 0.5 %",
            holds=worst["aligned"] <= 0.5,
        ),
        Claim(
            what="The same with friction that grows with the transmitted torque",
            ours=f"{number_list(spread, '.2f')} % for {number_list(LOADS, 'g')} N.m a N.m",
            holds=None,
            why="Friction of gears grows with the load they carry. Warmth and position, which are not looked at, could drive the "
            "postures apart as well.",
        ),
    )
    claims = (*claims, truth_check(plain.values()))
    return Outcome(
        name="fig-2.9",
        title="Identified curves of Joint 1 by posture",
        setting=f"{SETTING} Joint 1, A = 20 deg. Inertia and gravity of the postures are assumed, in the thesis' order.",
        claims=claims,
        data={
            "curves": {mu: {name: r.curves for name, r in done.items()} for mu, done in runs.items()},
            "inertia": inertia,
            "gravity": carried,
        },
        numbers={f"worst_{m}": worst[m] for m in METHODS}
        | {f"worst_load_{mu:g}": s for mu, s in zip(LOADS, spread, strict=False)},
    )


def _gravity(name: str) -> float:
    """Return the torque of gravity at the center of the stroke [N.m]."""
    joint, center = in_posture(name)
    return float(joint.weight(np.deg2rad(center)))


def draw(outcome: Outcome) -> Any:
    """Return the figure: (a) inertia and gravity, (b) curves as printed, (c) the same with load-dependent friction."""
    d = outcome.data
    v = np.linspace(1e-6, 2.0, 200)
    loads = list(d["curves"])
    with house_style():
        figure, axes = own.sheet(1, 3, height=270.0, width=760.0)
        a, second = axes[0, 0], axes[0, 0].twinx()
        x = np.arange(len(d["inertia"]))
        a.bar(x - 0.2, list(d["inertia"].values()), 0.37, color=LIGHT.fitted, zorder=2)
        second.bar(x + 0.2, list(d["gravity"].values()), 0.37, color=LIGHT.held_out, zorder=2)
        a.set_xticks(x, list(d["inertia"]))
        a.grid(False)
        own.name(a, "(a) postures", "posture", "inertia [kg·m²]")
        second.set_ylabel("gravity at the center [N·m]", color=LIGHT.held_out)
        a.yaxis.label.set_color(LIGHT.fitted)
        for side in ("top", "right", "left"):
            second.spines[side].set_visible(False)
        second.tick_params(colors=LIGHT.muted, labelsize=own.SMALL)
        panels = (
            (axes[0, 1], loads[0], "(b) friction"),
            (axes[0, 2], loads[-1], f"(c) growing {loads[-1]:g} by load"),
        )
        for panel, mu, title in panels:
            for color, (posture, curves) in zip(own.SERIES, d["curves"][mu].items(), strict=False):
                panel.plot(v, curves["literal"].torque(v), color=color, linewidth=1.3, label=posture)
            panel.set_ylim(0.0, 20.0)
            own.name(panel, title, "velocity [rad/s]", "friction [N·m]")
        own.key(axes[0, 1], "lower right", 2)
    return figure
