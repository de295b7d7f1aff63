"""Identified friction in simulators: what each target expresses, what it costs in MuJoCo, and the way there and back.

- Every target (MJCF, MJCF with LuGre as a dcmotor, URDF, the callback in C): largest and root-mean-square error of the steady
  torque over the validity range, by running the target's own MuJoCo model at constant velocities, and by the target's formula
  written out here; both against what the sidecar says.
- Cost: a step of a chain of seven joints with the callback in C, by one with MuJoCo's own friction (frictionloss and damping),
  interleaved, medians of CPU time.
- Round trip: the exported joint is moved in the target under a controller, its log is identified, and what was exported must lie
  inside the stated 95 % intervals.

    python benchmarks/evidence/simulators.py [--short] [--seed N]
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
from _common import Judge, first_seed, parser

from backdrive import identify, load_model
from backdrive.errors import InvalidInput
from backdrive.export.mujoco import export_mujoco
from backdrive.export.simulators import export_description
from backdrive.laws import GMS, RATES, Law, LuGre, StribeckGauss
from backdrive.logs.log import Joint, Log
from backdrive.model import FrictionModel, Validity

TOP = 2.0  # end of the validity range [rad/s]
COSTS = 1.15
SEVEN = "abcdefg"
GAUSS = dict(coulomb=1.0, breakaway=1.4, stribeck_velocity=0.08, viscous=0.3)
M1 = dict(coulomb=1.0, viscous=0.3)
LAWS = {
    "Coulomb, viscous": Law(rate=RATES["m1"](**M1)),
    "Stribeck, LuGre": Law(rate=StribeckGauss(**GAUSS), element=LuGre(stiffness=3e3, damping=5.0)),
    "Stribeck, GMS-4": Law(
        rate=StribeckGauss(**GAUSS),
        element=GMS(stiffness=(3e3, 1e3, 5e2, 2e2), share=(0.4, 0.3, 0.2, 0.1), attraction=30.0),
    ),
}


def by_hand(name: str, v: np.ndarray) -> np.ndarray:
    """Return the steady torque of a law, from its formula."""
    if name == "Coulomb, viscous":
        return M1["coulomb"] * np.sign(v) + M1["viscous"] * v
    peak = (GAUSS["breakaway"] - GAUSS["coulomb"]) * np.exp(-((v / GAUSS["stribeck_velocity"]) ** 2))
    return (GAUSS["coulomb"] + peak) * np.sign(v) + GAUSS["viscous"] * v


def model(names: str, law: Law) -> FrictionModel:
    """Return a model of joints that were seen up to TOP."""
    preset = load_model("preset:mx106/m6")
    joints = [
        replace(
            preset.joints[0],
            joint=replace(preset.joints[0].joint, name=n, unit="rad"),
            law=law,
            validity=Validity(velocity=(-TOP, TOP)),
            covariance=None,
            standard_errors={},
        )
        for n in names
    ]
    return replace(preset, joints=tuple(joints))


def one_joint(step: float) -> str:
    """Return a rotor of 0.1 kg.m^2."""
    return (
        f'<mujoco><option timestep="{step}" gravity="0 0 0"/><worldbody><body><joint name="a" type="hinge" axis="0 0 1"/>'
        '<inertial pos="0 0 0" mass="1" diaginertia="0.1 0.1 0.1"/></body></worldbody>'
        '<actuator><motor name="drive" joint="a"/></actuator></mujoco>'
    )


URDF = (
    '<robot name="r"><link name="base"/><link name="l"><inertial><mass value="1"/>'
    '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    '<joint name="a" type="continuous"><axis xyz="0 0 1"/><parent link="base"/><child link="l"/></joint></robot>'
)


def chain() -> str:
    """Return an arm of seven joints."""
    text = "".join(
        f'<body pos="0 0 0.15"><joint name="{n}" type="hinge" axis="{"0 0 1" if i % 2 else "0 1 0"}"/>'
        f'<geom type="capsule" size="0.04" fromto="0 0 0 0 0 0.15" mass="{2.0 - 0.2 * i}"/>'
        for i, n in enumerate(SEVEN)
    )
    return (
        '<mujoco><option timestep="0.001"><flag contact="disable"/></option>'
        f"<worldbody>{text}{'</body>' * 7}</worldbody><actuator>"
        f"{''.join(f'<motor joint={chr(34)}{n}{chr(34)}/>' for n in SEVEN)}</actuator></mujoco>"
    )


class Callback:
    """The exported callback, compiled, in force as long as it is entered."""

    def __init__(self, source: Path):
        compiler = shutil.which("gcc") or shutil.which("cc")
        command = [compiler] if compiler else [sys.executable, "-m", "ziglang", "cc", "-fno-sanitize=all"]
        target = source.with_suffix(".so")
        include = Path(mujoco.__file__).parent / "include"
        options = ["-std=c99", "-O2", "-ffp-contract=off", "-shared", "-fPIC", "-isystem", str(include)]
        subprocess.run([*command, *options, str(source), "-o", str(target), "-lm"], check=True)
        self.library = ctypes.CDLL(str(target))
        kind = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)
        self.function = kind(("friction_passive", self.library))

    def __enter__(self):
        mujoco.set_mjcb_passive(self.function)

    def __exit__(self, *_):
        mujoco.set_mjcb_passive(None)


def steady(simulated: mujoco.MjModel, velocities: np.ndarray) -> np.ndarray:
    """Return the friction of a rotor so heavy that nothing slows it down, at velocities."""
    simulated.body_inertia[1] = 1e6
    mujoco.mj_setConst(simulated, mujoco.MjData(simulated))
    torque, h = [], simulated.opt.timestep
    for v in velocities:
        data = mujoco.MjData(simulated)
        data.qvel[0] = v
        mujoco.mj_step(simulated, data, round(1.0 / h))
        torque.append(-data.qfrc_passive[0] - data.qfrc_constraint[0] - data.qfrc_actuator[0])
    return np.array(torque)


def expressed(judge: Judge, folder: Path, short: bool) -> None:
    """Print and judge what each target expresses of each law."""
    speeds = np.geomspace(0.02, TOP, 5 if short else 12)
    velocities = np.concatenate([speeds, -speeds])
    grid = np.concatenate([np.linspace(1e-3 * TOP, TOP, 200), -np.linspace(1e-3 * TOP, TOP, 200)])
    print(
        "steady torque, error over the validity range [N.m]: run in the target | by its formula | said; lost"
    )
    for name, law in LAWS.items():
        truth = by_hand(name, velocities)
        print(f"  {name}")
        for target in ("mjcf", "dcmotor", "urdf", "callback"):
            place = folder / f"{name.replace(', ', '-')}-{target}"
            place.mkdir()
            source = place / ("arm.urdf" if target == "urdf" else "arm.xml")
            source.write_text(URDF if target == "urdf" else one_joint(5e-4))
            if target == "callback":
                written, _, _ = export_mujoco(model("a", law), source, place / "out")
                simulated = mujoco.MjModel.from_xml_path(str(written[2]))
                with Callback(written[1]):
                    error = np.abs(steady(simulated, velocities) - truth)
                print(f"    callback  {error.max():.4f} largest | - | 0; nothing")
                judge.that(
                    f"{name}, callback: largest error {error.max():.4f} N.m (at most 0.01)",
                    error.max() <= 0.01,
                )
                continue
            try:
                _, (simple,) = export_description(
                    model("a", law), source, place / "out", dcmotor=target == "dcmotor"
                )
            except InvalidInput:
                judge.that(f"{name}, {target}: refused, as a law that is no LuGre", "LuGre" not in name)
                continue
            simulated = mujoco.MjModel.from_xml_path(str(place / "out" / source.name))
            simulated.opt.timestep, simulated.opt.gravity[:] = 5e-4, 0.0
            run = np.abs(steady(simulated, velocities) - truth)
            if simple.lugre is None:
                formula = simple.friction * np.sign(grid) + simple.damping * grid
            else:
                _, _, Fc, Fs, vs = simple.lugre
                formula = (Fc + (Fs - Fc) * np.exp(-((grid / vs) ** 2))) * np.sign(
                    grid
                ) + simple.damping * grid
            left = formula - by_hand(name, grid)
            largest, rms = np.abs(left).max(), float(np.sqrt(np.mean(left**2)))
            lost = ", ".join(simple.lost) or "nothing"
            print(
                f"    {target:9s} {run.max():.4f} largest | {largest:.4f}, {rms:.4f} rms | {simple.largest_error:.4f}, "
                f"{simple.rms_error:.4f} rms; {lost}"
            )
            agrees = abs(largest - simple.largest_error) < 1e-6 and abs(rms - simple.rms_error) < 1e-6
            judge.that(f"{name}, {target}: what is said is what the formula leaves", agrees)
            judge.that(
                f"{name}, {target}: what runs is off by no more than said + 0.01", run.max() <= largest + 0.01
            )


def cost(judge: Judge, folder: Path, short: bool) -> None:
    """Judge the time of a step with the callback by that with MuJoCo's own friction."""
    (folder / "seven.xml").write_text(chain())
    law = LAWS["Stribeck, LuGre"]
    written, joints, _ = export_mujoco(model(SEVEN, law), folder / "seven.xml", folder / "cost")
    own, _ = export_description(model(SEVEN, law), folder / "seven.xml", folder / "own")
    ours, theirs = (mujoco.MjModel.from_xml_path(str(p)) for p in (written[2], own[0]))
    ours.opt.timestep = theirs.opt.timestep
    callback, steps = Callback(written[1]), 4000
    print(f"cost of a step, seven joints, {joints[0].law.name}:")
    rows: dict[str, list[float]] = {"callback in C": [], "MuJoCo's own": [], "damping alone": []}
    bare = mujoco.MjModel.from_xml_path(str(own[0]))
    bare.dof_frictionloss[:] = 0.0
    for _ in range(5 if short else 15):
        for name, simulated in (("callback in C", ours), ("MuJoCo's own", theirs), ("damping alone", bare)):
            data = mujoco.MjData(simulated)
            data.ctrl[:] = 1.6, -1.5, 1.7, -1.2, 1.3, -1.8, 1.5
            if name == "callback in C":
                mujoco.set_mjcb_passive(callback.function)
            begun = time.process_time()
            mujoco.mj_step(simulated, data, steps)
            rows[name].append((time.process_time() - begun) / steps * 1e6)
            mujoco.set_mjcb_passive(None)
            assert np.isfinite(data.qpos).all()
    medians = {name: float(np.median(times)) for name, times in rows.items()}
    print("  " + ", ".join(f"{name} {t:.2f} us" for name, t in medians.items()))
    judge.at_most(
        "callback by MuJoCo's own friction", medians["callback in C"] / medians["MuJoCo's own"], COSTS
    )


def recorded(simulated: mujoco.MjModel, seed: int, seconds: float) -> Log:
    """Return the log of a joint that a controller moves along sines of four frequencies."""
    random, h = np.random.default_rng(seed), simulated.opt.timestep
    data = mujoco.MjData(simulated)
    every = round(1e-3 / h)
    t = np.arange(int(seconds / h)) * h
    tones = zip(
        (0.11, 0.37, 0.9, 1.7), (1.1, 0.35, 0.12, 0.04), random.uniform(0, 2 * np.pi, 4), strict=False
    )
    wanted = sum(a * np.sin(2 * np.pi * f * t + p) for f, a, p in tones) * np.minimum(t / 2.0, 1.0)
    speed = np.gradient(wanted, h)
    q, torque, sent = [], [], 0.0
    for k in range(len(t)):
        if k % every == 0:
            q.append(data.qpos[0])
            sent = 200.0 * (wanted[k] - data.qpos[0]) + 8.0 * (speed[k] - data.qvel[0])
            torque.append(sent)
        data.qfrc_applied[0] = sent
        mujoco.mj_step(simulated, data)
    n = len(q)
    count = 2 * np.pi / 2**20
    return Log(
        time=np.arange(n) * 1e-3,
        joints=(Joint(name="a"),),
        position=np.round(np.array(q) / count)[:, None] * count,
        torque=(np.array(torque) + 0.02 * random.standard_normal(n))[:, None],
    )


def round_trip(judge: Judge, folder: Path, seed: int, short: bool) -> None:
    """Judge whether what was exported comes back."""
    tries = 2 if short else 20
    print(
        f"round trip, {tries} logs of 30 s a target: share of exported numbers inside the stated 95 % interval"
    )
    for target in ("mjcf", "callback"):
        place = folder / f"trip-{target}"
        place.mkdir()
        (place / "arm.xml").write_text(one_joint(2e-4))
        if target == "mjcf":
            written, (simple,) = export_description(
                model("a", LAWS["Coulomb, viscous"]), place / "arm.xml", place / "out"
            )
            truth = (simple.friction, simple.damping)
            simulated = mujoco.MjModel.from_xml_path(str(written[0]))
            logs = [recorded(simulated, seed + k, 30.0) for k in range(tries)]
        else:
            law = Law(rate=RATES["m1"](**M1), element=LuGre(stiffness=3e3, damping=5.0))
            written, _, _ = export_mujoco(model("a", law), place / "arm.xml", place / "out")
            truth = (M1["coulomb"], M1["viscous"])
            simulated = mujoco.MjModel.from_xml_path(str(written[2]))
            with Callback(written[1]):
                logs = [recorded(simulated, seed + k, 30.0) for k in range(tries)]
        inside, total, worst = 0, 0, 0.0
        for log in logs:
            result = identify(log, method="motion", law="coulomb-viscous")
            friction = result.model.joint("a")
            numbers, errors = friction.law.rate.values(), friction.standard_errors
            for name, value in numbers.items():
                error = float(np.ravel(errors[name])[0])
                true = truth[0] if name.startswith("coulomb") else truth[1]
                inside += abs(value - true) <= 1.96 * error
                worst = max(worst, abs(value / true - 1.0))
                total += 1
        print(f"  {target}: {inside} of {total}, worst {100 * worst:.2f} % off")
        judge.that(f"{target}: {inside} of {total} inside (88 % wanted)", inside >= 0.88 * total)


def main() -> None:
    """Run the three parts."""
    made = parser(__doc__)
    made.add_argument("--seed", type=int, help="first seed; a fresh one by default")
    asked = made.parse_args()
    judge, seed = Judge(), first_seed(asked.seed)
    print(f"MuJoCo {mujoco.__version__}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        expressed(judge, folder, asked.short)
        cost(judge, folder, asked.short)
        round_trip(judge, folder, seed, asked.short)
    judge.end()


if __name__ == "__main__":
    main()
