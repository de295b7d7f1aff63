"""Fig. 3.4 of Iwatani 2017: friction over velocity of both setups, identified by the procedure of its chapter 2."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.identification import Identification, identify
from backdrive.laws import Law
from backdrive.laws.base import Rate
from backdrive.plans import Sweep
from backdrive.report.pictures.canvas import LIGHT, house_style
from backdrive.simulation.joint import JointSimulation
from backdrive.simulation.open_loop import simulate
from backdrive.thesis import _hand_guiding_plots as own
from backdrive.thesis.outcome import Claim, Outcome
from backdrive.thesis.setups import BANDWIDTH, setups

STROKE = {"rad": float(np.deg2rad(20.0)), "m": 0.1}  # A, peak to peak [rad or m]
TOP = {"rad": 2.0, "m": 0.3}  # V [rad/s or m/s]
CYCLES = 10
SHOWN = 4000  # samples in the figure


def sweep_of(plant: JointSimulation, seed: int = 0) -> Identification:
    """Return what the sweep of chapter 2 finds on a simulated joint, each direction on its own (3.1).

    Args:
        plant: the joint.
        seed: of the actuator's noise.
    """
    sweep = Sweep(STROKE[plant.unit], TOP[plant.unit], cycles=CYCLES, joint=plant.name, unit=plant.unit)
    return identify(simulate(plant, sweep, seed=seed), method="sweep", symmetric=False)


def identify_rate(plant: JointSimulation, seed: int = 0) -> Rate:
    """Return the rate law that the sweep finds, for a compensator."""
    return sweep_of(plant, seed).model.joints[0].law.rate


def intercepts(rate: Rate) -> tuple[float, float]:
    """Return F_p and F_n of a rate law [N.m or N]."""
    slow = 1e-9 * np.array([1.0, -1.0])
    plus, minus = Law(rate=rate).torque(slow)
    return float(plus), float(-minus)


def run(seed: int = 0) -> Outcome:
    """Sweep and identify Setup A and Joints 0 to 2 of Setup B.

    Args:
        seed: of the actuators' noise.
    """
    panels: dict[str, Any] = {}
    numbers: dict[str, float] = {}
    for name, plant in setups().items():
        panels[name] = panel = _panel(plant, seed)
        (F_p, F_n), (T_p, T_n) = panel["intercepts"], panel["true_intercepts"]
        numbers |= {f"{name}.F_p": F_p, f"{name}.F_n": F_n, f"{name}.rms": panel["rms"]}
        numbers |= {f"{name}.true_F_p": T_p, f"{name}.true_F_n": T_n}
    return Outcome(
        name="fig-3.4",
        title="Identified friction over velocity, Setup A and Setup B",
        setting=(
            "Simulated joints, compliant, friction on the load's side. The sweep of chapter 2 with 10 cycles: Setup A 0.1 m and "
            "0.3 m/s, Setup B 20 degrees and 2 rad/s; encoder counts and commanded torque at 1 kHz. The servo of Setup B has a "
            f"bandwidth of {BANDWIDTH:g} rad/s. Curves of both directions apart (3.1), intercepts by extrapolation."
        ),
        claims=_claims(panels),
        data={"panels": panels},
        numbers=numbers,
    )


def _panel(plant: JointSimulation, seed: int) -> dict[str, Any]:
    found = sweep_of(plant, seed)
    evidence, law = found.evidence[0], found.model.joints[0].law
    thin = slice(None, None, max(1, evidence.samples.velocity.size // SHOWN))
    speed = TOP[plant.unit] * np.linspace(1e-6, 1.0, 100)
    velocity = np.concatenate([-speed[::-1], speed])
    curve, truth = law.torque(velocity), plant.law.torque(velocity)
    return {
        "unit": plant.unit,
        "samples_velocity": evidence.samples.velocity[thin].copy(),
        "samples_friction": evidence.samples.friction[thin].copy(),
        "velocity": velocity,
        "curve": curve,
        "truth": truth,
        "intercepts": intercepts(law.rate),
        "true_intercepts": intercepts(plant.law.rate),
        "rms": float(np.sqrt(np.mean((curve - truth) ** 2))),
    }


def _claims(panels: dict[str, Any]) -> tuple[Claim, ...]:
    errors = [
        max(abs(f - t) / t for f, t in zip(p["intercepts"], p["true_intercepts"], strict=False))
        for p in panels.values()
    ]
    pairs = "; ".join(
        f"{name} {p['intercepts'][0]:.2f}/{p['intercepts'][1]:.2f} ({p['true_intercepts'][0]:.2f}/"
        f"{p['true_intercepts'][1]:.2f})"
        for name, p in panels.items()
    )
    return (
        Claim(
            what="The intercepts F_p and F_n are those that are true.",
            ours=f"found (true), N or N.m: {pairs}",
            gate="within 4 %",
            holds=max(errors) < 0.04,
            why=(
                "On a curve that bends down, a line through the two slowest knots meets zero velocity above the truth; Setup A, "
                "which does not bend, has no such error."
            ),
        ),
        Claim(
            what="The curves are those that are true.",
            ours="RMS error "
            + ", ".join(f"{name} {p['rms']:.3f}" for name, p in panels.items())
            + " N or N.m",
            gate="below 0.05 of the Coulomb friction",
            holds=all(p["rms"] < 0.05 * min(p["true_intercepts"]) for p in panels.values()),
        ),
    )


def draw(outcome: Outcome) -> Any:
    """Return the figure: data, identified curve, truth and intercepts of four joints."""
    with house_style():
        figure, axes = own.sheet(2, 2, width=688.0, height=480.0)
        for a, letter, (joint, panel) in zip(axes.flat, "abcd", outcome.data["panels"].items(), strict=False):
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
