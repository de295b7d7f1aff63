"""Fig. 3.3 of Iwatani 2017: the encoder's displacement before break-away, while the actuator's force rises slowly."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.report.pictures.canvas import LIGHT, house_style, pretty_unit
from backdrive.simulation.joint import JointSimulation
from backdrive.simulation.open_loop import drive
from backdrive.thesis import _hand_guiding_plots as own
from backdrive.thesis.fig_3_4 import intercepts
from backdrive.thesis.outcome import Claim, Outcome
from backdrive.thesis.setups import RATIO, setups

PERIOD = 1e-3  # s
DURATION = 8.0  # of the ramp [s]
BEYOND = 1.04  # the ramp ends at this share of the Coulomb friction [-]
SILENT = 6.0  # force below which the thesis saw no displacement of Setup A [N]
COMPENSATOR = 1.2e6  # K of the thesis on Setup A [N/m]
PHASES = np.linspace(-0.5, 0.5, 201)[:-1] + 0.0025  # where within a count the joint rests [counts]


def ramp(plant: JointSimulation) -> dict[str, Any]:
    """Raise the actuator's force to a little beyond break-away, and return what happened.

    Args:
        plant: a joint without gravity.

    Returns:
        `force` [N.m or N] and `motor` [rad or m], the true position of the motor's side, (n,) each; `count`; `stiffness`.
    """
    top, _ = intercepts(plant.law.rate)
    time = PERIOD * np.arange(round(DURATION / PERIOD))
    force = BEYOND * top * time / DURATION
    target = np.stack([force, np.zeros_like(force)], axis=1)
    out, _ = drive(plant.replace(encoder_count=0.0), target, closed=False, period=PERIOD)
    return {
        "unit": plant.unit,
        "force": force,
        "motor": out[:, 0],
        "friction": top,
        "count": plant.encoder_count,
        "stiffness": plant.stiffness,
    }


def encoder_counts(motor: np.ndarray, count: float, phase: float = 0.0) -> np.ndarray:
    """Return displacement in counts that an encoder shows of a joint that rested at a phase within a count [counts]."""
    return np.floor(motor / count + phase + 0.5)


def first_force(found: dict[str, Any], phase: float = 0.0) -> float:
    """Return the force at which the encoder first moves [N.m or N]; that of the ramp's end if it does not."""
    moved = np.flatnonzero(encoder_counts(found["motor"], found["count"], phase) > 0)
    return float(found["force"][moved[0]] if moved.size else found["force"][-1])


def run(seed: int = 0, ratio: float = RATIO) -> Outcome:
    """Ramp the actuator's force on Setup A and on Joint 0 of Setup B.

    Args:
        seed: not used; nothing here is random.
        ratio: K_c by K [-].
    """
    del seed
    joints = setups(ratio)
    a, b = ramp(joints["setup_a"]), ramp(joints["joint_0"])
    stiff = ramp(joints["setup_a"].replace(stiffness=2.0 * COMPENSATOR))
    for found in (a, b, stiff):
        found["counts"] = encoder_counts(found["motor"], found["count"])
        found["first"] = first_force(found)
        found["silent"] = float(np.mean([first_force(found, phase) >= SILENT for phase in PHASES]))
    broke = b["force"] < 0.98 * b["friction"]
    presliding = float(b["counts"][broke].max())
    numbers = {
        "setup_a.first": a["first"],
        "setup_a.silent_share": a["silent"],
        "setup_a.stiff.first": stiff["first"],
        "setup_a.stiff.silent_share": stiff["silent"],
        "joint_0.first": b["first"],
        "joint_0.counts": presliding,
    }
    return Outcome(
        name="fig-3.3",
        title="Presliding displacement under a ramp of force",
        setting=(
            "The actuator's force rises in 8 s to 4 % beyond the Coulomb friction on the load's side. Setup A: K_c = 1.2e6 N/m, "
            "F_p = 12 N, counts of 5 um; Joint 0: K_c = 5e4 N.m/rad, F = 6.85 N.m, counts of 0.96 urad. The joint rests in the "
            "middle of a count; the share of all resting places is given beside it."
        ),
        claims=_claims(a, stiff, b, presliding),
        data={"setup_a": a, "setup_a_stiff": stiff, "joint_0": b},
        numbers=numbers,
    )


def _claims(
    a: dict[str, Any], stiff: dict[str, Any], b: dict[str, Any], presliding: float
) -> tuple[Claim, ...]:
    half = [np.searchsorted(found["force"], 0.5 * found["friction"]) for found in (a, b)]
    stretched = [
        float((f["motor"][k] - f["motor"][0]) * f["stiffness"] / f["force"][k])
        for f, k in zip((a, b), half, strict=False)
    ]
    ratio = [found["count"] * found["stiffness"] / found["friction"] for found in (a, b)]
    return (
        Claim(
            what="The measured displacement of Setup A is zero as long as the force is smaller than 6 N.",
            thesis="zero as long as the actuator force is smaller than 6 N",
            ours=(
                f"first count at {a['first']:.2f} N from the middle of a count; no displacement below 6 N from "
                f"{100 * a['silent']:.0f} % of resting places, with K_c = 2.4e6 N/m from {100 * stiff['silent']:.0f} %"
            ),
            gate="no displacement below 6 N from at least half of the resting places within a count",
            holds=a["silent"] >= 0.5,
            why_not=(
                "The first edge is between 0 and 1 count away, and one count corresponds to 6 N at 1.2e6 N/m. So the figure "
                "requires a joint that has just passed an edge, or a transmission twice as stiff as in the thesis."
            ),
            statement="3.3-silent",
        ),
        Claim(
            what="Joint 0 of Setup B shows presliding displacement under small torque.",
            thesis="significant presliding displacement under small actuator torque",
            ours=(
                f"first count at {b['first']:.3f} N.m, {100 * b['first'] / b['friction']:.1f} % of F; {presliding:.0f} counts "
                "before break-away"
            ),
            gate="first count below 2 % of F, at least 20 counts before break-away",
            holds=b["first"] < 0.02 * b["friction"] and presliding >= 20,
            statement="3.3-presliding",
        ),
        Claim(
            what="The setups differ by stiffness and resolution.",
            thesis="stiffness of the transmissions and resolution of the encoders",
            ours=f"K_c delta / F = {ratio[0]:.2f} on Setup A, {ratio[1]:.4f} on Joint 0",
            gate="a factor of at least 20",
            holds=ratio[0] > 20.0 * ratio[1],
        ),
        Claim(
            what="Before break-away the motor has moved by f/K_c, the closed form",
            ours=", ".join(f"{100 * (s - 1):+.2f} %" for s in stretched) + " off at half of the friction",
            gate="within 2 %",
            holds=max(abs(s - 1.0) for s in stretched) <= 0.02,
        ),
    )


def draw(outcome: Outcome) -> Any:
    """Return the figure: (a) Setup A with two transmissions, (b) Joint 0."""
    data = outcome.data
    panels = (
        (
            "(a) Setup A",
            (
                ("setup_a", "K_c = 1.2e6 N/m", LIGHT.fitted),
                ("setup_a_stiff", "K_c = 2.4e6 N/m", LIGHT.held_out),
            ),
        ),
        ("(b) Setup B, Joint 0", (("joint_0", "K_c = 5e4 N·m/rad", LIGHT.fitted),)),
    )
    with house_style():
        figure, axes = own.sheet(1, 2, width=688.0, height=270.0)
        for a, (title, entries) in zip(axes[0], panels, strict=False):
            unit = data[entries[0][0]]["unit"]
            force = pretty_unit("N" if unit == "m" else "N.m")
            for found, label, color in ((data[key], label, color) for key, label, color in entries):
                a.plot(found["force"], 1e6 * found["motor"], color=color, linewidth=0.9, linestyle=own.DASHED)
                a.plot(
                    found["force"],
                    1e6 * found["counts"] * found["count"],
                    color=color,
                    linewidth=1.5,
                    label=label,
                )
            first = data[entries[0][0]]
            a.axvline(first["friction"], color=LIGHT.muted, linewidth=0.8)
            a.annotate(
                "F", (first["friction"], 1.0), xycoords=("data", "axes fraction"), xytext=(-4, -3),
                textcoords="offset points", ha="right", va="top", color=LIGHT.muted,
            )  # fmt: skip
            a.set_ylim(-0.04 * _top(first), 1.25 * _top(first))
            unit = "µm" if unit == "m" else "µrad"
            own.name(a, title, f"actuator [{force}]", f"displacement [{unit}]")
            own.key(a, "upper left")
        axes[0, 1].plot([], [], color=LIGHT.fitted, linewidth=0.9, linestyle=own.DASHED, label="true")
        own.key(axes[0, 1], "upper left")
    return figure


def _top(found: dict[str, Any]) -> float:
    reached = 1e6 * found["friction"] / found["stiffness"]
    return max(2.2 * reached, 1.5e6 * found["count"]) if found["unit"] == "m" else 1.3 * reached
