"""Write the presets, published friction parameters as model files: src/backdrive/model/presets/*/*.json.

    python benchmarks/make_presets.py

The parameters of BAM's servos are read from `presets/bam_servos` in the folder that BACKDRIVE_DATA names, and left as they are
where it is absent; the others stand here. A file that would differ only in the version that made it is left alone.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from dataclasses import replace
from pathlib import Path

import numpy as np

from backdrive import __version__
from backdrive._files import write_whole
from backdrive.laws import Coulomb, Decaying, Law, Sigmoid, rate_law
from backdrive.logs.log import Joint, Source
from backdrive.model import Estimate, FrictionModel, JointFriction, Validity
from backdrive.model.file import decode, encode

HOME = Path(__file__).resolve().parent.parent / "src" / "backdrive" / "model" / "presets"
TAU = 2.0 * math.pi

# Folder of BAM's parameters -> preset family and what the servo is.
SERVOS = {
    "erob80_100": ("erob80-100", "ZeroErr eRob80, 100:1 harmonic drive"),
    "erob80_50": ("erob80-50", "ZeroErr eRob80, 50:1 harmonic drive"),
    "feetech_sts3215_7_4V": ("sts3215", "Feetech STS3215 servo, 7.4 V"),
    "mx106": ("mx106", "Robotis Dynamixel MX-106 servo"),
    "mx64": ("mx64", "Robotis Dynamixel MX-64 servo"),
    "xl320": ("xl320", "Robotis Dynamixel XL-320 servo"),
}
IN_PAPER = ("erob80_100", "erob80_50", "mx106", "mx64")

# BAM's keys -> ours. `alpha` is the exponent of Stribeck's curve there and the decay rate in the thesis.
COMMON = {"friction_base": "coulomb", "friction_viscous": "viscous"}
STRIBECK = {
    "friction_stribeck": "stribeck",
    "dtheta_stribeck": "stribeck_velocity",
    "alpha": "exponent",
}
DIRECTIONAL = {
    "load_friction_motor": "load_motor",
    "load_friction_external": "load_external",
    "load_friction_motor_stribeck": "load_stribeck_motor",
    "load_friction_external_stribeck": "load_stribeck_external",
}
QUADRATIC = {
    "load_friction_motor_quad": "quadratic_motor",  # times tau_m^2, where the external torque is the greater
    "load_friction_external_quad": "quadratic_external",  # times tau_e^2, where it is the smaller
}
KEYS = {
    "m1": COMMON,
    "m2": COMMON | STRIBECK,
    "m3": COMMON | {"load_friction_base": "load"},
    "m4": COMMON | STRIBECK | {"load_friction_base": "load", "load_friction_stribeck": "load_stribeck"},
    "m5": COMMON | STRIBECK | DIRECTIONAL,
    "m6": COMMON | STRIBECK | DIRECTIONAL | QUADRATIC,
}
MOTOR = {
    "kt": ("torque_constant", "N.m/A"),
    "R": ("resistance", "ohm"),
    "armature": ("inertia", "kg.m^2"),
}
NOT_FRICTION = {"q_offset": "offset of the test bench's position [rad]"}
LABELS = {"model", "actuator"}
QUADRATIC_BOUND = 0.01  # of BAM's search [1/(N.m)]
SLOW_SINE = round(math.pi / 2, 4)  # speed of sin(t) pi/2, the slow part of BAM's recording `sin_sin` [rad/s]

BAM_PAPER = (
    "M. Duclusaud, G. Passault, V. Padois, O. Ly, Extended Friction Models for the Physics Simulation of Servo Actuators, "
    "arXiv:2410.08650, 2024"
)
BAM_RANGE = (
    f"range of velocity not published: {SLOW_SINE:g} rad/s is the speed of the slow sine (sin(t) pi/2) in the recordings that "
    "BAM fits to, and its faster motions are not counted."
)
NO_LOAD_RANGE = "range of the load not published; without a load the friction of this law is the smallest."


def bam(folder: Path) -> dict[str, FrictionModel]:
    """Return the presets of BAM's servos by name.

    Args:
        folder: `bam_servos`, with a folder a servo and a file a model.
    """
    made = {}
    for servo, (family, title) in SERVOS.items():
        for file in sorted((folder / servo).glob("m?.json")):
            data = file.read_bytes()
            made[f"{family}/{file.stem}"] = bam_model(
                json.loads(data), data, servo, f"{title}, BAM's M{file.stem[1]}"
            )
    return made


def bam_model(content: dict, data: bytes, servo: str, title: str) -> FrictionModel:
    """Return the preset of one of BAM's files."""
    kind = content["model"]
    keys = KEYS[kind]
    strange = set(content) - set(keys) - set(MOTOR) - set(NOT_FRICTION) - LABELS
    missing = set(keys) - set(content)
    if strange or missing:
        raise SystemExit(f"{servo}/{kind}: {sorted(strange)} unknown, {sorted(missing)} missing")
    rate = rate_law(kind)(**{ours: content[theirs] for theirs, ours in keys.items()})
    warnings = [BAM_RANGE] + ([NO_LOAD_RANGE] if rate.NEEDS else [])
    warnings += [
        f"{ours} ended at the upper bound of BAM's search, {QUADRATIC_BOUND:g} 1/(N.m)."
        for theirs, ours in QUADRATIC.items()
        if theirs in content and content[theirs] > 0.9999 * QUADRATIC_BOUND
    ]
    friction = JointFriction(
        joint=Joint(name=content["actuator"]),
        law=Law(rate=rate),
        dynamics={
            name: Estimate(value=content[key], unit=unit)
            for key, (name, unit) in MOTOR.items()
            if key in content
        },
        validity=Validity(velocity=(-SLOW_SINE, SLOW_SINE)),
        method="published",
        warnings=tuple(warnings),
    )
    path = f"bam/params/{servo}/{kind}.json"
    options = {
        "title": title,
        "citation": BAM_PAPER + ("" if servo in IN_PAPER else "; this servo in the repository only"),
        "origin": f"https://github.com/Rhoban/bam, {path}",
        "licence": "Apache-2.0",
        "changes": "keys renamed, units added; values as they are",
        "keys": {ours: theirs for theirs, ours in keys.items()}
        | {name: key for key, (name, _) in MOTOR.items() if key in content},
        "remarks": [
            "torque_constant, resistance and inertia are the motor's, seen behind the gear; inertia is without the load",
            *(
                f"{key} = {content[key]!r} left out: {what}"
                for key, what in NOT_FRICTION.items()
                if key in content
            ),
        ],
    }
    source = Source(path=path, sha256=hashlib.sha256(data).hexdigest())
    return FrictionModel(joints=(friction,), sources=(source,), options=options, version=__version__)


# Joint 1 to 7: phi_1 [N.m], phi_2 [s/rad], phi_3 [rad/s].
FRANKA = (
    (0.54615, 5.1181, 0.039533),
    (0.87224, 9.0657, 0.025882),
    (0.64068, 10.136, -0.04607),
    (1.2794, 5.5903, 0.036194),
    (0.83904, 8.3469, 0.026226),
    (0.30301, 17.133, -0.021047),
    (0.56489, 10.336, 0.0035526),
)
# What the authors' exciting trajectory 1 (gen_params.txt, harmonics of 0.15 pi rad/s) reaches in both directions, cut [rad/s].
FRANKA_SPEEDS = (1.38, 1.15, 1.40, 1.16, 1.36, 1.43, 1.52)


def franka() -> dict[str, FrictionModel]:
    """Return the preset of the Franka Emika Panda by name."""
    joints = tuple(
        JointFriction(
            joint=Joint(name=f"panda_joint{i}"),
            law=Law(rate=Sigmoid(span=span, steepness=steepness, shift=offset)),
            validity=Validity(velocity=(-speed, speed)),
            method="published",
            warnings=(
                f"range of velocity not published with the parameters: {speed:g} rad/s is what the authors' exciting trajectory "
                "1 reaches in both directions.",
            ),
        )
        for i, ((span, steepness, offset), speed) in enumerate(zip(FRANKA, FRANKA_SPEEDS, strict=False), 1)
    )
    options = {
        "title": "Franka Emika Panda, seven joints, sigmoid",
        "citation": "C. Gaz, M. Cognetti, A. Oliva, P. Robuffo Giordano, A. De Luca, Dynamic identification of the Franka Emika "
        "Panda robot with retrieval of feasible parameters using penalty-based optimization, IEEE Robotics and Automation "
        "Letters 4(4), 2019",
        "origin": "https://github.com/marcocognetti/FrankaEmikaPandaDynModel, matlab/dyn_model_panda/get_FrictionTorque.m",
        "licence": "numbers published in the paper; no text or code of it is contained",
        "changes": "units added; values as they are",
        "keys": {"span": "phi_1", "steepness": "phi_2", "shift": "phi_3"},
        "remarks": ["the joints are named as in the maker's robot description"],
    }
    return {"franka/panda": FrictionModel(joints=joints, options=options, version=__version__)}


THESIS = (
    "M. Iwatani, Identification, Compensation and Estimation of Joint Friction of Robotic Manipulators, PhD thesis, "
    "Kyushu University, 2017"
)
THESIS_LICENCE = "numbers published in the thesis; no text of it is contained"
DECAY_RATE = 20.0  # alpha, Secs. 3.5.1 and 3.5.2 [1/s]
DESIGNED = "decay_rate is a design parameter of the compensator (Sec. 3.4.3), not a property of the joint."


def not_printed(speed: str, symbols: str, figure: str) -> str:
    """Return the warning that only slow motion is covered."""
    return (
        f"range of velocity not published: {speed} is the threshold V_W of Sec. 3.6.2, below which the thesis counts a motion as "
        f"slow; {symbols} drawn in {figure} and not printed, so growth with speed is missing."
    )


def setup_a() -> FrictionModel:
    """Return what is printed of Setup A, a ball-screw axis with a timing belt."""
    friction = JointFriction(
        joint=Joint(name="setup_a", unit="m", encoder_counts=4000 / 0.02),
        law=Law(rate=Coulomb(coulomb=6.0), element=Decaying(stiffness=1.2e6, decay_rate=DECAY_RATE)),
        dynamics={"inertia": Estimate(value=10.0, unit="kg")},
        validity=Validity(velocity=(-0.01, 0.01)),
        method="published",
        warnings=(
            "coulomb is a lower bound, not an identified value: no displacement is seen below 6 N (Sec. 3.2.2), which at 1.2e6 N/m "
            "is one count of the encoder; the identified F_p and F_n, unequal, are not printed.",
            not_printed("0.01 m/s", "F_p, F_n and Phi(v) are", "Fig. 3.4(a)"),
            DESIGNED,
        ),
    )
    options = {
        "title": "Setup A of Iwatani 2017, ball screw and timing belt: a lower bound",
        "citation": THESIS,
        "licence": THESIS_LICENCE,
        "printed": {
            "coulomb": "Sec. 3.2.2: no displacement below 6 N",
            "stiffness": "Secs. 3.5.1 and 4.6.1: K = 1.2e6 N/m",
            "decay_rate": "Secs. 3.5.1 and 4.6.1: alpha = 20.0 1/s",
            "inertia": "Sec. 4.6.1: 10.0 kg, close to the mass of the moving part",
            "encoder_counts": "Sec. 3.2.1: 4000 counts a rotation, lead of the ball screw 0.02 m",
            "velocity": "Sec. 3.6.2: V_W = 0.01 m/s",
        },
    }
    return FrictionModel(joints=(friction,), options=options, version=__version__)


def hp3j() -> FrictionModel:
    """Return what is printed of Setup B, the three joints from the base of a MOTOMAN-HP3J."""
    joints = tuple(
        JointFriction(
            joint=Joint(name=f"joint_{i}", gear_ratio=ratio, encoder_counts=65536 * ratio / TAU),
            law=Law(rate=Coulomb(coulomb=coulomb), element=Decaying(stiffness=5e4, decay_rate=DECAY_RATE)),
            validity=Validity(velocity=(-0.005, 0.005)),
            method="published",
            warnings=(not_printed("0.005 rad/s", "Phi(v) is", "Fig. 3.4(b)"), DESIGNED),
        )
        for i, (coulomb, ratio) in enumerate(((6.85, 100.0), (9.56, 224.0), (3.15, 120.0)))
    )
    options = {
        "title": "Yaskawa MOTOMAN-HP3J of Iwatani 2017 (Setup B), joints 0 to 2, harmonic drives",
        "citation": THESIS,
        "licence": THESIS_LICENCE,
        "printed": {
            "coulomb": "Sec. 3.5.2: F_p = F_n = 6.85, 9.56, 3.15 N.m; Sec. 4.7.2: 6.85 N.m for joint 0",
            "stiffness": "Secs. 3.5.2 and 4.7.2: K = 50000 N.m/rad (Sec. 2.5: 10000 N.m/rad, without decay)",
            "decay_rate": "Sec. 3.5.2: alpha = 20 1/s",
            "gear_ratio": "Sec. 3.2.1 and Table 2.1: 100, 224, 120",
            "encoder_counts": "Sec. 3.2.1: 65536 counts a rotation of the motor",
            "velocity": "Sec. 3.6.2: V_W = 0.005 rad/s",
        },
    }
    return FrictionModel(joints=joints, options=options, version=__version__)


def thesis() -> dict[str, FrictionModel]:
    """Return the presets of the thesis' machines by name."""
    return {"thesis/hp3j": hp3j(), "thesis/setup-a": setup_a()}


def write(name: str, model: FrictionModel, home: Path = HOME) -> bool:
    """Write one preset; return whether there was something to write."""
    path = home / f"{name}.json"
    if path.exists():
        old = decode(path.read_bytes(), str(path))
        if encode(replace(model, version=old.version)) == path.read_bytes():
            return False
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, encode(model))
    return True


def main() -> None:
    """Write all presets that can be made."""
    made = franka() | thesis()
    folder = Path(os.environ.get("BACKDRIVE_DATA", "."), "presets", "bam_servos")
    if folder.is_dir():
        made |= bam(folder)
    else:
        print("BAM's parameters are absent: their presets stay as they are")
    for name, model in made.items():
        assert all(np.isfinite(f.law.row()).all() for f in model.joints)
        print(f"{'wrote' if write(name, model) else 'same '} {name}")


if __name__ == "__main__":
    main()
