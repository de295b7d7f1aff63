"""What the external force and the wrench of a six-axis arm cost in a loop, beside inverse dynamics of pinocchio and MuJoCo.

One Python call a tick: six joints with a friction law that grows with the load, an observer, and the wrench at the tool with its
covariance. In the same process, by turns, so that the machine's other work falls on all alike: the tick, the calls of pinocchio
that it makes, pinocchio's `rnea` and MuJoCo's `mj_inverse`. The median of what remains of a tick beside its calls is judged.

    python benchmarks/evidence/arm_tick.py
"""

from __future__ import annotations

import gc
import time
import tracemalloc
from collections.abc import Callable

import numpy as np
from _arm_scene import JOINTS, NAMES, TICK, Arm
from _common import Judge, parser

from backdrive.control.estimators.arm import ArmForce
from backdrive.control.estimators.arm_tick import ArmForceTick
from backdrive.laws import Growth, Law, Polyline
from backdrive.logs.log import Joint
from backdrive.model import ArmModel, Band, Bands, Estimate, FrictionModel, JointFriction, Validity
from backdrive.robot import Robot, parse_robot, require_pinocchio

LIMIT = 5.0  # on top of pinocchio's calls [us]
METHODS = ("direct", "momentum", "disturbance", "extended", "kalman")
BURST = 20  # calls of one kind in a row, timed one by one


def model_of(robot: Robot) -> FrictionModel:
    """Return a model of the arm: a curve of five knots that grows with the load on each joint."""
    speeds = (0.0, 0.02, 0.1, 0.5, 1.5)
    frictions = []
    for name, row in zip(robot.joints, JOINTS, strict=False):
        curve = tuple(float(row[3] + row[6] * np.exp(-((v / row[7]) ** 2)) + row[5] * v) for v in speeds)
        rate = Polyline(velocity=speeds, positive=curve, negative=curve)
        frictions.append(
            JointFriction(
                joint=Joint(name=name),
                law=Law(rate=rate, growth=Growth(load_driving=float(row[10]), load_driven=float(row[10]))),
                validity=Validity(velocity=(-1.5, 1.5)),
                dynamics={
                    "inertia": Estimate(value=float(row[0]), unit="kg.m^2"),
                    "offset": Estimate(value=0.0, unit="N.m"),
                    "transition": Estimate(value=2e-3, unit="rad/s"),
                },
                bands=Bands(moving=Band(half_width=0.05 * float(row[3]), samples=1000)),
            )
        )
    arm = ArmModel(urdf_sha256=robot.sha256, parameters=tuple(robot.parameters), condition=1.0)
    return FrictionModel(joints=tuple(frictions), arm=arm)


def timed(call: Callable[[], object], into: list[int]) -> None:
    """Time a burst of calls, one by one [ns]."""
    clock = time.perf_counter_ns
    for _ in range(BURST):
        begun = clock()
        call()
        into.append(clock() - begun)


def alternated(calls: dict[str, Callable[[], object]], rounds: int) -> dict[str, np.ndarray]:
    """Return the times of calls that take turns [us]."""
    times: dict[str, list[int]] = {name: [] for name in calls}
    gc.disable()
    for _ in range(rounds):
        for name, call in calls.items():
            timed(call, times[name])
    gc.enable()
    return {name: np.array(t[BURST:]) / 1e3 for name, t in times.items()}


def allocated(running: ArmForceTick, q: np.ndarray, u: np.ndarray) -> int:
    """Return the bytes of Python's that 1000 ticks leave behind."""
    tracemalloc.start()
    before = tracemalloc.take_snapshot()
    for _ in range(1000):
        running.tick(q, u)
    after = tracemalloc.take_snapshot()
    tracemalloc.stop()
    return max(
        sum(x.size_diff for x in after.compare_to(before, "filename") if "backdrive" in str(x.traceback)), 0
    )


def main() -> None:
    """Measure every method with a wrench, and judge what remains beside pinocchio."""
    rounds = 300 if parser(__doc__).parse_args().short else 3000
    judge, arm = Judge(), Arm()
    robot = parse_robot(arm.mjcf())
    assert robot.joints == NAMES
    model, pin = model_of(robot), require_pinocchio()
    rng = np.random.default_rng(0)
    q, v, a, u = rng.uniform(-1.0, 1.0, (4, 6))
    data = robot.model.createData()
    beside: dict[str, Callable[[], object]] = {
        "nothing": lambda: None,
        "pinocchio rnea": lambda: pin.rnea(robot.model, data, q, v, a),
    }
    try:
        import mujoco
    except ImportError:
        print("MuJoCo is absent: its inverse dynamics are not measured")
    else:
        other = mujoco.MjModel.from_xml_string(arm.mjcf())
        own = mujoco.MjData(other)
        own.qpos[:], own.qvel[:], own.qacc[:] = q, v, a
        beside["MuJoCo mj_inverse"] = lambda: mujoco.mj_inverse(other, own)  # type: ignore[attr-defined]
    for method in METHODS:
        running = ArmForce.from_model(model, robot, method=method, bandwidth=50.0, frame="tool").online(TICK)
        running.reset(q)
        positions = q + 1e-4 * np.cumsum(rng.standard_normal((512, 6)), axis=0)
        step = iter(range(10**9))
        calls = {
            "tick": lambda r=running, p=positions, s=step: r.tick(p[next(s) & 511], u),
            "its calls of pinocchio": running.bodies_only,
        }
        times = alternated(calls | beside, rounds)
        none = float(np.median(times["nothing"]))
        middle = {name: float(np.median(t)) - none for name, t in times.items()}
        late = {name: float(np.quantile(t, 0.99)) - none for name, t in times.items()}
        row = ", ".join(
            f"{name} {middle[name]:.2f} ({late[name]:.2f})" for name in times if name != "nothing"
        )
        print(f"{method}: median (99 %) [us]: {row}")
        judge.at_most(
            f"{method}: on top of pinocchio's calls",
            middle["tick"] - middle["its calls of pinocchio"],
            LIMIT,
            "us",
        )
        judge.at_most(f"{method}: bytes kept by 1000 ticks", allocated(running, q, u), 2000.0)
    judge.end()


if __name__ == "__main__":
    main()
