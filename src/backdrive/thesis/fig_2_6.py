"""Fig. 2.6: measured torque and identified curves of Joint 1 for several strokes; Iwatani 2017, 2.4.2."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.plans import inertia_bias
from backdrive.report.pictures.canvas import LIGHT, house_style
from backdrive.thesis import _sweep_plots as own
from backdrive.thesis._sweeps import (
    CYCLES,
    METHODS,
    SETTING,
    STROKES,
    TOP_SPEED,
    SweepRun,
    by_stroke,
    distances,
    number_list,
)
from backdrive.thesis.outcome import Claim, Outcome
from backdrive.thesis.setups import RATIO, arm


def run(seed: int = 0, ratio: float = RATIO) -> Outcome:
    """Sweep Joint 1 over 5 to 50 degrees and return torque over velocity beside the identified curves."""
    joint = arm(ratio)[1]
    runs = by_stroke(seed, [joint])[joint.name]
    width = {A: _width(r) for A, r in runs.items()}
    E = {method: distances(runs, method) for method in METHODS}
    literal, aligned = ({A: E[m][A] for A in STROKES[:-1]} for m in METHODS)
    top = {
        A: float(r.knots["literal"].F[-1] - joint.law.torque(r.knots["literal"].V[-1]))
        for A, r in runs.items()
    }
    swing = (
        (2.0 * TOP_SPEED / np.deg2rad(5.0)) ** 2 * joint.load_inertia / joint.stiffness
    )  # (w/w_c)^2, last cycle of 5 deg
    expected = {A: inertia_bias(np.deg2rad(A), TOP_SPEED, joint.inertia, 1e-3) for A in STROKES}
    claims = (
        Claim(
            what="A smaller stroke broadens the measured curves",
            thesis="smaller A, broader",
            ours=f"width {number_list(width.values())} N.m for A = {number_list(width, 'g')} deg",
            gate="falls with A",
            holds=bool(np.all(np.diff(list(width.values())) < 0)),
            statement="2.6-broader",
            why="The width is due to inertia, whose torque is largest at the turning points.",
        ),
        Claim(
            what="A smaller stroke perturbs the curve that (2.7) as printed gives",
            thesis="perturbed",
            ours=f"E(A, 50 deg) {number_list(literal.values())} N.m for A = {number_list(literal, 'g')} deg",
            gate="falls with A",
            holds=bool(np.all(np.diff(list(literal.values())) < 0)),
            statement="2.6-perturbed",
        ),
        Claim(
            what="The perturbation is inertia, seen through one tick of misalignment",
            ours=f"error at top speed {number_list(top.values(), '+.2f')} N.m; "
            f"formula {number_list(expected.values(), '+.2f')} N.m",
            gate="within 0.1 N.m for A >= 20 deg",
            holds=bool(all(abs(top[A] - expected[A]) < 0.1 for A in STROKES if A >= 20.0)),
            why="A backward difference gives the velocity half a tick before its sample, and the commanded torque acts on "
            "average half a tick after it. Together this is one tick, -3.7 I V^3 T/A^2 at the top speed.",
        ),
        Claim(
            what="With velocity and torque on the same instant the curve no longer depends on the stroke, from 10 deg on",
            ours=f"E(A, 50 deg) {number_list(aligned.values())} N.m",
            gate="at most 0.05 N.m from 10 deg on",
            holds=bool(max(E for A, E in aligned.items() if A >= 10.0) <= 0.05),
            why="At 5 deg the load swings further than the motor, whose speed is measured: 1/(1 - (w/w_c)^2) = "
            f"{1.0 / (1.0 - swing):.3f} times as far on a transmission with K_c = {joint.stiffness:g} N.m/rad.",
        ),
    )
    return Outcome(
        name="fig-2.6",
        title="Measured torque and identified curves of Joint 1 by stroke",
        setting=f"{SETTING} Joint 1, the mean of both directions (gravity) taken out.",
        claims=claims,
        data={
            f"{A:g}": {
                "velocity": np.gradient(r.position, r.log.period),
                "torque": r.torque - r.knots["aligned"].bias,
                "curves": r.curves,
            }
            for A, r in runs.items()
        },
        numbers={f"E_{m}_{A:g}deg": E[m][A] for m in METHODS for A in STROKES},
    )


def _width(run: SweepRun) -> float:
    """Return how far the last cycle's torque under positive acceleration lies above that under negative [N.m]."""
    v = np.gradient(run.position, run.log.period)
    a = np.gradient(v, run.log.period)
    last = run.log.time >= run.log.plan.windows()[CYCLES - 1, 0]
    middle = last & (np.abs(v) < 0.5 * TOP_SPEED)
    return float(run.torque[middle & (a > 0)].mean() - run.torque[middle & (a < 0)].mean())


def draw(outcome: Outcome) -> Any:
    """Return the figure: measured loops behind the curve of (2.7), as printed and aligned."""
    v = np.linspace(1e-6, 2.0, 120)
    both = np.concatenate([-v[::-1], v])
    with house_style():
        figure, axes = own.sheet(2, 3, height=400.0, sharex=True, sharey=True)
        for a, (stroke, d) in zip(axes.flat, outcome.data.items(), strict=False):
            every = max(1, d["velocity"].size // 6000)
            a.plot(
                d["velocity"][::every],
                d["torque"][::every],
                color=LIGHT.band,
                linewidth=0.35,
                label="measured",
            )
            for method, color in (("literal", LIGHT.held_out), ("aligned", LIGHT.fitted)):
                if method in d["curves"]:
                    label = {"literal": "as printed", "aligned": "aligned"}[method]
                    a.plot(both, d["curves"][method].torque(both), color=color, linewidth=1.5, label=label)
            a.set(xlim=(-2.1, 2.1), ylim=(-60, 60))
            own.name(a, f"A = {stroke} deg")
        last = axes.flat[5]
        last.axis("off")
        handles, labels = axes.flat[0].get_legend_handles_labels()
        last.legend(handles, labels, loc="center", frameon=False, labelcolor=LIGHT.ink)
        for a in (axes[1, 0], axes[1, 1], axes[0, 2]):
            a.set_xlabel("velocity [rad/s]", color=LIGHT.ink)
            a.tick_params(labelbottom=True)
        for a in axes[:, 0]:
            a.set_ylabel("torque [N·m]", color=LIGHT.ink)
    return figure
