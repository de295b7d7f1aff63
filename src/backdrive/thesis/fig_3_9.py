"""Fig. 3.9 of Iwatani 2017: position, velocity and torque while a hand guides three joints of Setup B."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.report.pictures.canvas import house_style
from backdrive.thesis import _guided
from backdrive.thesis import _guided_plots as own
from backdrive.thesis._guided import CASES
from backdrive.thesis.fig_3_7 import time_series
from backdrive.thesis.fig_3_10 import ARM, CYCLES, SETTING, guidance
from backdrive.thesis.outcome import Claim, Outcome
from backdrive.thesis.setups import RATIO


def run(seed: int = 0, ratio: float = RATIO) -> Outcome:
    """Guide Joints 0, 1 and 2 for 30 cycles in each case.

    Args:
        seed: of the hand.
        ratio: K_c by K [-].
    """
    played = _guided.guide([(guidance(name, ratio), CYCLES, seed) for name in ARM])
    claims, data, numbers = [], {}, {}
    for name, records in zip(ARM, played):
        found = _guided.peaks(records, CYCLES)
        lowest = np.argmin(np.stack([found[case] for case in CASES]), axis=0) == CASES.index("PD")
        share = lowest.mean(axis=0)
        data[name] = time_series(records)
        numbers[f"{name}.windows_lowest"] = float(lowest.mean())
        claims.append(
            Claim(
                what=f"{name}: the peaks of the external torque are smaller with PD through the experiment.",
                thesis="the same features as Setup A",
                ours=f"PD is the smallest of the five in {100 * share[0]:.0f} % (+q) and {100 * share[1]:.0f} % (-q) "
                f"of {CYCLES} windows",
                gate="in more than half of them, each direction",
                holds=bool(np.all(share > 0.5)),
                why="CD does what PD does, so that either is the smallest by chance.",
                statement="3.9-smallest",
            )
        )
    return Outcome(
        name="fig-3.9",
        title="Position and external torque, Setup B",
        setting=SETTING + f" {CYCLES} cycles.",
        claims=tuple(claims),
        data=data,
        numbers=numbers,
    )


ROWS = (
    ("position", "position [rad]"),
    ("velocity", "velocity [rad/s]"),
    ("command", "actuator [N·m]"),
    ("force", "external torque [N·m]"),
)


def draw(outcome: Outcome) -> Any:
    """Return the figure: a column a joint; position, velocity, actuator and external torque of the five cases."""
    with house_style():
        figure, axes = own.sheet(len(ROWS), len(outcome.data), width=960.0, height=620.0, sharex=True)
        for column, (joint, data) in zip(axes.T, outcome.data.items()):
            for a, (quantity, label) in zip(column, ROWS):
                own.lines(a, data["zoom"]["time"], data["zoom"]["cases"], quantity, step=3)
                own.name(
                    a, own.title(joint) if a is column[0] else "", "", label if joint == "joint_0" else ""
                )
            own.edges(column[-1], data["edges"])
            column[-1].set_xlim(data["edges"][0], data["edges"][-1])
            column[-1].set_xlabel("time [s]")
        own.key(axes[0, -1], "lower right", 5, bbox_to_anchor=(1.0, 1.0))
    return figure
