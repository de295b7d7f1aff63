"""Fig. 3.9 of Iwatani 2017: position, velocity and force while a hand leads the arm around a square in x and y."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.report.pictures.canvas import house_style
from backdrive.thesis import _hand_guiding_plots as own
from backdrive.thesis import _square
from backdrive.thesis._hand_guiding import CASES, PERIOD
from backdrive.thesis._square import AXES, BEGIN, INTERVAL, SETTING
from backdrive.thesis.fig_3_10 import ROUNDS
from backdrive.thesis.outcome import Claim, Outcome
from backdrive.thesis.setups import RATIO

ZOOM = (4, 5)  # squares that are drawn


def run(seed: int = 0, ratio: float = RATIO) -> Outcome:
    """Lead the arm around squares in each case.

    Args:
        seed: of the hand.
        ratio: K_c by K [-].
    """
    cases = _square.by_case(seed, ratio, ROUNDS)
    claims, numbers = [], {}
    for i, axis in enumerate(AXES):
        found = _square.peaks(cases, i, ROUNDS)
        lowest = np.argmin(np.stack([found[case] for case in CASES]), axis=0) == CASES.index("PD")
        share = lowest.mean(axis=0)
        numbers[f"{axis}.squares_lowest"] = float(lowest.mean())
        claims.append(
            Claim(
                what=f"Along {axis} the peaks of the external force are smaller with PD through the experiment.",
                thesis="the same features as Setup A",
                ours=f"PD is the smallest of the five in {100 * share[0]:.0f} % (+{axis}) and {100 * share[1]:.0f} % (-{axis}) "
                f"of {ROUNDS} squares",
                gate="in more than half of them, each direction",
                holds=bool(np.all(share > 0.5)),
                why_not="CD does what PD does, so that either is the smallest by chance.",
                statement="3.9-smallest",
            )
        )
    edges = BEGIN + 4 * INTERVAL * np.arange(ZOOM[0], ZOOM[1] + 1)
    part = slice(round(edges[0] / PERIOD), round(edges[-1] / PERIOD))
    return Outcome(
        name="fig-3.9",
        title="Position, velocity, force and path of the grip, Setup B",
        setting=f"{SETTING} {ROUNDS} squares.",
        claims=(*claims, _square.work_check(cases)),
        data={
            "time": PERIOD * np.arange(part.start, part.stop),
            "edges": edges,
            "cases": {
                case: {"position": g.grip[part], "velocity": g.velocity[part], "force": g.sensed[part]}
                for case, g in cases.items()
            },
        },
        numbers=numbers,
    )


ROWS = (
    ("position", "position [mm]", 1e3),
    ("velocity", "velocity [m/s]", 1.0),
    ("force", "external force [N]", 1.0),
)


def draw(outcome: Outcome) -> Any:
    """Return the figure: a column an axis, with position, velocity and external force; right the path of the grip."""
    data = outcome.data
    with house_style():
        figure, axes = own.sheet(3, 3, width=960.0, height=560.0)
        for column, (i, axis) in zip(axes.T, enumerate(AXES), strict=False):
            cases = {case: {k: v[:, i] for k, v in c.items()} for case, c in data["cases"].items()}
            for a, (quantity, label, factor) in zip(column, ROWS, strict=False):
                own.lines(a, data["time"], cases, quantity, factor=factor, step=3)
                a.set_xlim(data["edges"][0], data["edges"][-1])
                own.name(a, f"along {axis}" if a is column[0] else "", "", "" if i else label)
            own.edges(column[-1], data["edges"])
            column[-1].set_xlabel("time [s]")
        own.key(axes[0, 1], "lower right", 5, bbox_to_anchor=(1.0, 1.0))
        grid = axes[0, 2].get_gridspec()
        for a in axes[:, 2]:
            a.remove()
        plane = own.panel(figure, grid[:, 2])
        for case, c in data["cases"].items():
            x, y = 1e3 * c["position"][::5].T
            plane.plot(x, y, color=own.COLORS[case], linewidth=1.0)
        plane.set_aspect("equal", adjustable="box")
        own.name(plane, "path of the grip", "x [mm]", "y [mm]")
    return figure
