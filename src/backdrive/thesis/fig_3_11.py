"""Fig. 3.11 of Iwatani 2017: a hand moves a joint, holds it and lets go; the decay rate is low, high, or switched (algFC2)."""

from __future__ import annotations

from typing import Any

from backdrive.report.pictures.canvas import house_style
from backdrive.simulation.closed_loop import Record
from backdrive.thesis import _hand_guiding_plots as own
from backdrive.thesis._balance import balance
from backdrive.thesis._release_compensation import BEGIN, CASES, SEEDS, Release, joint_0, judge, setup_a
from backdrive.thesis.outcome import Claim, Outcome
from backdrive.thesis.scatter import clearly_less, less
from backdrive.thesis.setups import RATIO


def run(seed: int = 0, ratio: float = RATIO) -> Outcome:
    """Let go of Setup A and of Joint 0.

    Args:
        seed: of the first hand; the others follow.
        ratio: K_c by K [-].
    """
    first = 100 * seed
    found = {"setup_a": judge(setup_a(ratio), SEEDS, first), "joint_0": judge(joint_0(ratio), SEEDS, first)}
    numbers: dict[str, float] = {}
    for name, one in found.items():
        numbers |= {f"{name}.rest.{case}": float(n) for case, n in one["rest"].items()}
        numbers |= {f"{name}.peak.{case}": p for case, p in one["peak"].items()}
    return Outcome(
        name="fig-3.11",
        title="A hand moves the joint, holds it and lets go",
        setting=(
            "Joint 0: K_c = K = 5e4 N.m/rad, R_d = 0.2, V_W = 0.005 rad/s, a hand of 120 N.m/rad, 0.3 rad in 0.8 s. Setup A: "
            "K_c = K = 1.2e6 N/m, R_d = 0.5, V_W = 0.01 m/s, a hand of 800 N/m, 0.06 m in 0.7 s. Friction is on the load's "
            "side, its curve as identified. alpha_N = 20 1/s, alpha_H = 500 1/s, r_W = 10 1/s, V_W between two counts, no "
            "factor R, one tick of delay. The hand holds for 1 s and lets go. A joint counts as at rest if its load travels less "
            "than 2 counts in the last 0.5 s of 2 s. "
            f"With dither the motor's side goes on to swing by what the dither stretches. {SEEDS} hands."
        ),
        claims=(
            *(claim for name, one in found.items() for claim in _claims(name, one)),
            *(balance(one["records"].values()) for one in found.values()),
        ),
        data={name: _series(one) for name, one in found.items()},
        numbers=numbers,
    )


def _series(found: dict[str, Any]) -> dict[str, Any]:
    records: dict[str, Record] = found["records"]
    some = records[CASES[0]]
    return {
        "unit": found["release"].plant.unit,
        "time": some.time,
        "released": BEGIN + found["release"].duration + found["release"].hold,
        "cases": {
            case: {
                "position": r.reading,
                "velocity": r.load_velocity,
                "command": r.command,
                "force": r.scene.motion.grip * r.sensed,
            }
            for case, r in records.items()
        },
    }


def _rests(found: dict[str, Any]) -> str:
    return ", ".join(f"{case} {n}" for case, n in found["rest"].items()) + f" of {found['seeds']}"


def _peaks(found: dict[str, Any], unit: str) -> str:
    return ", ".join(f"{case} {p:.2f}" for case, p in found["peak"].items()) + f" {unit}"


def _claims(name: str, found: dict[str, Any]) -> tuple[Claim, ...]:
    of = "Setup A" if name == "setup_a" else "Joint 0"
    unit = "N" if name == "setup_a" else "N.m"
    rest, peaks, n = found["rest"], found["peaks"], found["seeds"]
    release: Release = found["release"]
    return (
        Claim(
            what=f"{of}: with algFC2 the force peaks are smaller than in the other cases.",
            thesis="smaller than the other cases",
            ours=_peaks(found, unit),
            gate="95 % interval of the paired difference below zero against both",
            holds=less(peaks["algFC2"], peaks["alpha_N"]) and less(peaks["algFC2"], peaks["alpha_H"]),
            why_not=(
                "At rest alpha = alpha_N in both, so algFC2 cannot make break-away easier. A joint that hunts with alpha_N has "
                "already broken away when the hand arrives."
            ),
            statement="3.11-peaks",
        ),
        Claim(
            what=f"{of}: with algFC2 the joint eventually is stationary.",
            thesis="eventually came to stationary",
            ours=f"at rest: {_rests(found)}",
            gate="at rest with at least nine hands of ten",
            holds=rest["algFC2"] >= 0.9 * n,
            why_not=(
                f"V_W = {release.threshold:g}, alpha_H F/K = {release.boundary:.3g} {release.plant.unit}/s. Where V_W "
                "is the larger, algFC2 is "
                "alpha_N again before the contact lets go of anything."
            ),
            statement="3.11-rest",
        ),
        Claim(
            what=f"{of}: with alpha_N the fluctuation continues.",
            thesis="the fluctuation continued",
            ours=f"at rest: {_rests(found)}",
            gate="at rest with at most one hand of ten",
            holds=rest["alpha_N"] <= 0.1 * n,
            statement="3.11-nominal",
        ),
        Claim(
            what=f"{of}: with alpha_H the force peaks are larger.",
            thesis="the force peaks were larger",
            ours=_peaks(found, unit),
            gate="by more than 5 % against alpha_N and algFC2, 95 % interval of the paired difference above zero",
            holds=clearly_less(peaks["alpha_N"], peaks["alpha_H"])
            and clearly_less(peaks["algFC2"], peaks["alpha_H"]),
            statement="3.11-high",
        ),
    )


def draw(outcome: Outcome) -> Any:
    """Return the figure: (a) Setup A, (b) Joint 0; position, velocity, actuator and external force."""
    columns = (
        ("setup_a", "(a) Setup A", "m", "N"),
        ("joint_0", "(b) Setup B, Joint 0", "rad", "N·m"),
    )
    with house_style():
        figure, axes = own.sheet(4, 2, width=820.0, height=620.0, sharex="col")
        for column, (joint, title, length, force) in zip(axes.T, columns, strict=False):
            data = outcome.data[joint]
            rows = (
                ("position", f"position [{'mm' if length == 'm' else 'rad'}]", 1e3 if length == "m" else 1.0),
                ("velocity", f"velocity [{length}/s]", 1.0),
                ("command", f"actuator [{force}]", 1.0),
                ("force", f"external [{force}]", 1.0),
            )
            for a, (quantity, label, factor) in zip(column, rows, strict=False):
                own.lines(a, data["time"], data["cases"], quantity, factor=factor, step=2)
                own.release(a, data["released"], "released" if a is column[0] else "")
                own.name(a, title if a is column[0] else "", "", label)
            column[-1].set_xlim(0.0, data["time"][-1])
            column[-1].set_xlabel("time [s]")
        own.key(axes[1, 1], "upper right")
    return figure
