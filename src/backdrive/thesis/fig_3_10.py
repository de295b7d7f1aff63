"""Fig. 3.10 of Iwatani 2017: force peaks of a hand that guides three joints of Setup B, under five compensators."""

from __future__ import annotations

from typing import Any

from backdrive.report.pictures.canvas import house_style
from backdrive.simulation.hand import Hand
from backdrive.thesis import _guided
from backdrive.thesis import _guided_plots as own
from backdrive.thesis._guided import Guidance
from backdrive.thesis.fig_3_4 import identified
from backdrive.thesis.fig_3_8 import claims
from backdrive.thesis.outcome import Claim, Outcome
from backdrive.thesis.setups import JOINTS, K_B, RATIO, setups

CYCLES = 30  # of the figure
ARM = JOINTS[1:]
SETTING = (
    "Joints 0, 1 and 2 of Setup B (simulated), each on its own by single strokes: the thesis moves them together along a square. "
    "Friction on the load's side, F = 6.85, 9.56 and 3.15 N.m, K_c = K = 5e4 N.m/rad, one tick of delay, gravity compensated. Hand "
    "of 120 N.m/rad and 6 N.m.s/rad, strokes of 0.2 rad in 0.7 s every 0.75 s, 5 % variation, sensor noise 0.02 N.m. "
    "Compensators as "
    "printed: alpha = 20 1/s, dither 15 Hz with R_d = 0.3, no factor R, curve as identified by the sweep."
)


def guidance(name: str, ratio: float = RATIO) -> Guidance:
    """Return a joint of Setup B and a hand of 120 N.m/rad and 6 N.m.s/rad.

    Args:
        name: `joint_0`, `joint_1` or `joint_2`.
        ratio: K_c by K [-].
    """
    plant = setups(ratio)[name]
    return Guidance(
        plant=plant,
        rate=identified(plant),
        stiffness=K_B,
        hand=Hand(stiffness=120.0, damping=6.0, noise=0.02),
        stroke=0.2,
        dither=0.3,
        share=1.0,
    )


def run(seed: int = 0, ratio: float = RATIO) -> Outcome:
    """Guide each joint for 30 cycles in each case.

    Args:
        seed: of the hand.
        ratio: K_c by K [-].
    """
    played = _guided.guide([(guidance(name, ratio), CYCLES, seed) for name in ARM])
    judged: list[Claim] = []
    panels, numbers = {}, {}
    for name, records in zip(ARM, played):
        found = _guided.peaks(records, CYCLES)
        panels[name] = {"unit": "N.m", **_guided.bars(found, seed)}
        judged += claims(found, "N.m", "3.10", seed, name)
        numbers |= {f"{name}.PD{s}": float(v) for s, v in zip(_guided.SIDES, _guided.means(found)[-1])}
    return Outcome(
        name="fig-3.10",
        title="Mean and standard deviation of the force peaks, Setup B",
        setting=SETTING + f" {CYCLES} cycles.",
        claims=tuple(judged),
        data={"panels": panels},
        numbers=numbers,
    )


def draw(outcome: Outcome) -> Any:
    """Return the figure: a panel a joint, bars of five cases along +q and -q, with Student's t-test against PD."""
    panels = outcome.data["panels"]
    with house_style():
        figure, axes = own.sheet(1, len(panels), width=900.0, height=330.0)
        for a, (joint, panel) in zip(axes[0], panels.items()):
            own.peak_bars(a, panel)
            own.name(
                a, own.title(joint), "\n", "peak of the external torque [N·m]" if joint == "joint_0" else ""
            )
            a.tick_params(axis="x", labelsize=own.SMALL - 2.0)
    return figure
