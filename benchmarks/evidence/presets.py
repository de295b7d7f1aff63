"""Presets: every one loads, round-trips, and has the friction that its source's own formula gives.

BAM's formula is evaluated here in plain numpy from BAM's original files, Franka's sigmoid and the thesis' leaky clip (3.21a) from
the published numbers; nothing of `backdrive.laws` is used on that side.
"""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from _common import Judge, data, parser

from backdrive import load_model
from backdrive.laws import REFERENCE, kernels
from backdrive.model.file import encode
from backdrive.model.presets import names

FAMILIES = {
    "erob80-100": "erob80_100",
    "erob80-50": "erob80_50",
    "mx106": "mx106",
    "mx64": "mx64",
    "sts3215": "feetech_sts3215_7_4V",
    "xl320": "xl320",
}
SPEEDS = np.array([-12.0, -3.0, -1.0, -0.2, -1e-3, 1e-3, 0.05, 0.7, 2.0, 8.0])  # [rad/s]
TORQUES = np.array([-20.0, -3.0, -0.4, 0.0, 0.4, 1.0, 3.0, 20.0])  # of motor and environment [N.m]
CLOSE = 1e-12  # of the largest torque


def bam_friction(p: dict, v, motor, external):
    """Return BAM's friction torque opposing the motion, from the keys of its files [N.m].

    Duclusaud et al., arXiv:2410.08650: a budget of Coulomb, Stribeck and load terms, and viscous friction.
    """
    bow = np.exp(-(np.abs(v / p.get("dtheta_stribeck", np.inf)) ** p.get("alpha", 1.0)))
    one = p.get("load_friction_base", 0.0)
    fades = p.get("load_friction_stribeck", 0.0)

    def gears(m, e):
        return np.abs(e * external - m * motor)

    budget = p["friction_base"] + bow * p.get("friction_stribeck", 0.0)
    budget = budget + gears(p.get("load_friction_motor", one), p.get("load_friction_external", one))
    budget = budget + bow * gears(
        p.get("load_friction_motor_stribeck", fades), p.get("load_friction_external_stribeck", fades)
    )
    held = np.sign(motor) != np.sign(external)
    driving, driven = np.abs(external) < np.abs(motor), np.abs(external) > np.abs(motor)
    quadratic = p.get("load_friction_external_quad", 0.0) * external**2 * driving
    quadratic = quadratic + p.get("load_friction_motor_quad", 0.0) * motor**2 * driven
    budget = budget + bow * quadratic * held
    return budget * np.sign(v) + p["friction_viscous"] * v


def ours(law, v: float, motor: float, external: float) -> float:
    """Return the model's friction torque under a load [N.m]."""
    lo, hi, viscous = kernels.limits(law.rate.KIND, law.row(), v, (motor, external), REFERENCE)
    return (hi if v > 0 else lo) + viscous


def franka_friction(joint: int, v):
    """Return the friction torque of a joint of the Panda (1 to 7), Gaz et al. 2019 [N.m]."""
    phi_1 = (0.54615, 0.87224, 0.64068, 1.2794, 0.83904, 0.30301, 0.56489)[joint - 1]
    phi_2 = (5.1181, 9.0657, 10.136, 5.5903, 8.3469, 17.133, 10.336)[joint - 1]
    phi_3 = (0.039533, 0.025882, -0.04607, 0.036194, 0.026226, -0.021047, 0.0035526)[joint - 1]
    return phi_1 / (1 + np.exp(-phi_2 * (v + phi_3))) - phi_1 / (1 + np.exp(-phi_2 * phi_3))


def judge_files(judge: Judge) -> None:
    """Load, round-trip and read the provenance of every preset."""
    bad, loose, silent = [], [], []
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder, "copy.json")
        for name in names():
            model = load_model(f"preset:{name}")
            model.save(copy)
            if encode(load_model(copy)) != encode(model) or copy.read_bytes() != encode(model):
                bad.append(name)
            if not all(model.options.get(key) for key in ("title", "citation", "licence")):
                loose.append(name)
            silent += [
                name
                for j in model.joints
                if not any("range of velocity not published" in w for w in j.warnings)
            ]
    judge.that(f"{len(names())} presets load and round-trip bit by bit", not bad)
    judge.that("each has title, citation and licence", not loose)
    judge.that("each joint whose range of velocity was not published says so", not silent)


def judge_bam(judge: Judge) -> None:
    """Compare the servos with BAM's original files."""
    root = data("presets", "bam_servos")
    files = sorted(root.glob("*/m?.json"))
    made = {name for name in names() if name.split("/")[0] in FAMILIES}
    wanted = {
        f"{family}/{f.stem}" for family, servo in FAMILIES.items() for f in (root / servo).glob("m?.json")
    }
    judge.that(
        f"there is a preset for each of BAM's {len(files)} files", made == wanted and len(made) == len(files)
    )
    digests, motors = True, True
    print("\n  largest difference to BAM's formula, relative to the largest torque")
    for family, servo in FAMILIES.items():
        row, worst = f"  {family:12s}", 0.0
        for file in sorted((root / servo).glob("m?.json")):
            original, model = json.loads(file.read_bytes()), load_model(f"preset:{family}/{file.stem}")
            v, motor, external = (a.ravel() for a in np.meshgrid(SPEEDS, TORQUES, TORQUES))
            expected = bam_friction(original, v, motor, external)
            got = np.array(
                [ours(model.joints[0].law, *point) for point in zip(v, motor, external, strict=False)]
            )
            difference = float(np.max(np.abs(got - expected)) / np.max(np.abs(expected)))
            worst, row = max(worst, difference), row + f" {file.stem} {difference:.1e}"
            digests &= model.sources[0].sha256 == hashlib.sha256(file.read_bytes()).hexdigest()
            dynamics = {k: e.value for k, e in model.joints[0].dynamics.items()}
            motor_terms = (("torque_constant", "kt"), ("resistance", "R"), ("inertia", "armature"))
            motors &= dynamics == {k: original[theirs] for k, theirs in motor_terms if theirs in original}
        print(row)
        judge.at_most(f"{family}", worst, CLOSE)
    judge.that("the digests are those of BAM's files", digests)
    judge.that("torque constant, resistance and inertia are BAM's", motors)


def judge_franka(judge: Judge) -> None:
    """Compare the Panda with the paper's formula."""
    model = load_model("preset:franka/panda")
    worst = max(
        float(np.max(np.abs(model.torque(i - 1, SPEEDS) - franka_friction(i, SPEEDS)))) for i in range(1, 8)
    )
    judge.at_most("Panda, difference to the paper's formula", worst, CLOSE, "N.m")


def judge_thesis(judge: Judge) -> None:
    """Compare the thesis' machines with (3.21a), over motion with a reversal and a rest."""
    alpha, dt, worst = 20.0, 1e-3, 0.0
    printed = {"hp3j": (5e4, (6.85, 9.56, 3.15)), "setup-a": (1.2e6, (6.0,))}
    for machine, (K, coulomb) in printed.items():
        for friction, F in zip(load_model(f"preset:thesis/{machine}").joints, coulomb, strict=False):
            p = 3 * F / K * np.interp(np.arange(300), [0, 100, 150, 250, 300], [0, 1, 0, 0.3, 0.3])
            law, x, q = friction.law, friction.law.state(), p[0]
            for before, now in zip(p, p[1:], strict=False):
                q = now - np.clip(K * (now - q) / (1 + dt * alpha), -F, F) / K
                got = kernels.step(
                    law.rate.KIND, law.element.KIND, law.row(), x, now - before, dt, (0.0, 0.0), REFERENCE
                )
                worst = max(worst, abs(got - K * (now - q)) / F)
    judge.at_most("thesis, difference to (3.21a) relative to F", worst, 1e-9)


def judge_command(judge: Judge) -> None:
    """Run the command line as a person would."""

    def show(*arguments: str):
        command = [sys.executable, "-m", "backdrive", "show", *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=False)

    shown, listed, wrong = show("preset:mx106/m6"), show("preset:"), show("preset:mx107/m6")
    judge.that(
        "`backdrive show preset:mx106/m6` prints it",
        shown.returncode == 0 and all(s in shown.stdout for s in ("torque constant", "0.1220", "Apache-2.0")),
    )
    judge.that(
        "`backdrive show preset:` lists all", all(f"preset:{name} " in listed.stdout for name in names())
    )
    judge.that(
        "an unknown preset is answered with the nearest",
        wrong.returncode == 2 and "Did you mean 'mx106/m6'?" in wrong.stderr,
    )


def main() -> None:
    """Judge all presets."""
    parser(__doc__).parse_args()  # it takes seconds, shortened or not
    judge = Judge()
    judge_files(judge)
    judge_bam(judge)
    judge_franka(judge)
    judge_thesis(judge)
    judge_command(judge)
    judge.end()


if __name__ == "__main__":
    main()
