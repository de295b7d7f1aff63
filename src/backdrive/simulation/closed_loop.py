"""Compiled simulation of a joint, a hand, a controller and a torque loop. The record contains the true motion and the robot's
measurements.

At tick k the encoder is read. The kernel of the loop (`control.loop`) computes compensation and estimates, and the controller
its torque. Their sum acts until the next tick, shifted by the drive's delay. Between ticks the joint (`engine.axis`) is
integrated in steps of 10 to 20 us under the hand's force on its load, friction implicit. The loop's kernel is the same as on a
real robot.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import numpy as np

from backdrive._assembly import assemble
from backdrive.control import BareLoop, JointLoop, admittance, assembly, joint_loop, loop_kernel
from backdrive.control.admittance import Admittance
from backdrive.engine import axis as axis_
from backdrive.engine import servo as servo_
from backdrive.engine.cores import spread
from backdrive.engine.servo import Servo
from backdrive.errors import InvalidInput
from backdrive.laws import kernels
from backdrive.logs.log import Drive, Log
from backdrive.parameters import POSITIVE, Bound, WithBounds, check
from backdrive.simulation.hand import Hand, HandMotion
from backdrive.simulation.joint import JointSimulation
from backdrive.simulation.kernel import COLUMNS, encoder, run

SUBSTEP = 2e-5  # longest integration step [s]


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene(WithBounds):
    """A joint with its loop and controller, and a hand.

    Attributes:
        plant: the joint.
        motion: of the hand, which also sets the number of ticks.
        hand: its impedance; None for a hand that only pushes.
        loop: compensator and estimator; None for neither.
        controller: a `Servo` that follows `target`, an `Admittance`, `torque` for the torque that `target` holds, or None.
        target: reference position and velocity, or torque and an unused column, (n, 2); None: where the joint starts.
        period: of the loop [s].
        delay: of the drive beyond that of the plant [s].
        gravity_compensated: the command holds the joint's weight.
        ripple: amplitude of a torque that varies with the motor's position [N.m or N].
        ripple_cycles: of it [1/rad or 1/m, times 2 pi].
        encoder_noise: standard deviation of the reading beside its counts [rad or m].
        encoder_phase: where the zero lies within a count, -0.5 to 0.5; None: anywhere, by the seed.
        substep: longest integration step [s].
        fault: error added to the encoder's reading [rad or m] (NaN for no reading), and 1 where the loop misses its tick, (n,
            2); None: no fault. For NaN the controller uses the previous reading.
        seed: of noises and of the phase of the encoder's counts.
    """

    BOUNDS: ClassVar = {"period": POSITIVE, "delay": Bound(0.0, 1.0, "s", open_high=True)}

    plant: JointSimulation
    motion: HandMotion
    hand: Hand | None = None
    loop: JointLoop | None = None
    controller: Servo | Admittance | Literal["torque"] | None = None
    target: np.ndarray | None = None
    period: float = 1e-3
    delay: float = 0.0
    gravity_compensated: bool = True
    ripple: float = 0.0
    ripple_cycles: float = 0.0
    encoder_noise: float = 0.0
    encoder_phase: float | None = None
    substep: float = SUBSTEP
    fault: np.ndarray | None = None
    seed: int = 0

    def __post_init__(self):
        super().__post_init__()
        check("Scene", {"substep": Bound(0.0, self.period, "s", open_low=True)}, {"substep": self.substep})
        n = len(self.motion.position)
        for name, table in (("target", self.target), ("fault", self.fault)):
            if table is not None and np.shape(table) != (n, 2):
                raise InvalidInput(
                    f"{name} has the shape {np.shape(table)}.", remedy=f"Give ({n}, 2), as the hand's motion."
                )
        if isinstance(self.controller, Admittance) and (self.loop is None or self.loop.external is None):
            raise InvalidInput(
                "Admittance control needs an external force.", remedy="Give the loop an `ExternalForce`."
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class Record:
    """The record of a scene: every column (n,), SI units of the joint.

    Attributes:
        scene: what was played.
        time: of the ticks [s].
        reading: of the encoder.
        command: torque of the motor.
        compensation: of friction, a part of the command.
        estimate: of the external force.
        friction: friction according to the estimator.
        force: of the hand on the joint, true.
        sensed: the same by a force sensor.
        motor: true position of the motor's side.
        load: true position of the load.
        motor_velocity: true.
        load_velocity: true.
        wanted: position that the controller follows.
        status: of the loop.
        level: of the friction, as the loop has learned it [-].
    """

    scene: Scene = field(repr=False)
    time: np.ndarray
    reading: np.ndarray
    command: np.ndarray
    compensation: np.ndarray
    estimate: np.ndarray
    friction: np.ndarray
    force: np.ndarray
    sensed: np.ndarray
    motor: np.ndarray
    load: np.ndarray
    motor_velocity: np.ndarray
    load_velocity: np.ndarray
    wanted: np.ndarray
    status: np.ndarray
    level: np.ndarray

    def log(self) -> Log:
        """Return the log that a robot with a force sensor would have kept."""
        drive = None
        if isinstance(self.scene.controller, Servo):
            drive = Drive(law="position", gains=self.scene.controller.gains())
        return Log(
            time=self.time,
            joints=(self.scene.plant.as_joint(),),
            position=self.reading,
            torque=self.command,
            reference=self.wanted,
            external_torque=self.sensed,
            drive=drive,
        )


def play(
    scenes: Scene | Sequence[Scene],
    *,
    workers: int | None = None,
    one_kernel: bool = False,
    like: Sequence[Scene] = (),
) -> Any:
    """Simulate scenes and return their records.

    Args:
        scenes: one, or many, which are spread over the cores.
        workers: threads; None: one a core. The numbers do not depend on it.
        one_kernel: compile one kernel for all scenes with the same kind of law instead of one for each kind of loop. That is
            faster for a few short scenes; the numbers are the same.
        like: scenes that are not played, for whose parts the kernels are compiled too, so that several calls share one.

    Returns:
        A `Record`, or a list of them.
    """
    many = [scenes] if isinstance(scenes, Scene) else list(scenes)
    prepared = [prepare(scene) for scene in many]
    cases = [(scene, arguments) for scene, (arguments, _) in zip(many, prepared, strict=True)]
    groups: dict[object, list[tuple[Scene, tuple]]] = {}
    keys = [kind_of(case) if one_kernel else k for k, case in enumerate(cases)]
    for key, case in zip(keys, cases, strict=True):
        groups.setdefault(key, []).append(case)
    alike = [(scene, prepare(scene)[0]) for scene in like]
    compiled = {
        key: kernel_of(*group, *(case for case in alike if kind_of(case) == kind_of(group[0])))
        for key, group in groups.items()
    }
    kernels_of = [compiled[key] for key in keys]

    def work(first: int, last: int) -> None:
        for kernel, (arguments, _) in zip(kernels_of[first:last], prepared[first:last], strict=True):
            kernel(*arguments)

    spread(work, len(prepared), workers)
    records = []
    for scene, (arguments, sensor) in zip(many, prepared, strict=True):
        out = arguments[-1]
        columns = {name: out[:, i] for i, name in enumerate(COLUMNS)}
        records.append(
            Record(
                scene=scene,
                time=scene.period * np.arange(len(out)),
                sensed=columns["force"] + sensor,
                **columns,
            )
        )
    return records[0] if isinstance(scenes, Scene) else records


def kind_of(case: tuple[Scene, tuple]) -> tuple[int, int, bool]:
    """Return the kind of the joint's law: of its rate law and element, and whether it is plain."""
    law, row = case[0].plant.law, case[1][2]
    return law.rate.KIND, law.element.KIND, bool(kernels.plain(row[None, :1]))


def kernel_of(*cases: tuple[Scene, tuple]) -> Callable[..., None]:
    """Return `run`, compiled only for the parts that occur in scenes whose joints have the same law.

    Args:
        cases: scenes to be played, each with the arguments that `prepare` makes of it.
    """
    law, joint = cases[0][0].plant.law, loop_kernel.absent
    held = [arguments for scene, arguments in cases if scene.loop is not None]
    if held:
        C, P, _, _, E, PE, _, _ = zip(*(arguments[6:14] for arguments in held), strict=True)
        marks = [
            np.array([row[:1] for row in rows]) for rows in (P, PE)
        ]  # all that is asked of the laws' rows
        table = np.concatenate([arguments[14] for arguments in held])
        joint = assembly.of_joints(
            [np.array(C), marks[0], *held[0][8:10], np.array(E), marks[1], *held[0][12:14], table]
        )
    plain = kernels.plain(np.array([arguments[2][:1] for _, arguments in cases]))
    parts: dict[Any, Any] = {
        loop_kernel.joint: joint,
        axis_.advance: kernels.of_kinds(axis_.advance, law.rate.KIND, law.element.KIND, plain),
    }
    if not any(isinstance(scene.controller, Admittance) for scene, _ in cases):
        parts[admittance.tick] = admittance.absent
    return assemble(run, parts)


def prepare(scene: Scene) -> tuple[tuple, np.ndarray]:
    """Return the arguments of `run` for a scene, and the noise of its force sensor [N.m or N], (n,)."""
    plant, motion, T = scene.plant, scene.motion, scene.period
    n, law = len(motion.position), plant.law
    follows = scene.target is not None and scene.controller != "torque"
    begin = float(scene.target[0, 0]) if follows else float(motion.position[0])  # type: ignore[index]
    target = (
        np.zeros((n, 2)) if scene.target is None else np.ascontiguousarray(scene.target, dtype=np.float64)
    )
    if scene.target is None:
        target[:, 0] = begin
    rng = np.random.default_rng(scene.seed)
    phase = plant.encoder_count * (
        rng.uniform() - 0.5 if scene.encoder_phase is None else scene.encoder_phase
    )
    state = plant.at_rest(begin)
    reading = float(encoder(begin + phase, plant.encoder_count))
    substeps = int(np.ceil(T / scene.substep - 1e-9))
    controller = scene.controller
    kind, k_row, k_state = 0, np.zeros(admittance.ROW), np.zeros(admittance.STATES)
    if isinstance(controller, Servo):
        kind, k_row, k_state = 1, controller.row(), np.zeros(servo_.STATES)
        k_state[1] = reading
        if controller.integral > 0.0 and not scene.gravity_compensated:
            k_state[0] = float(plant.weight(state[2])) / controller.integral  # it had been holding the joint
    elif isinstance(controller, Admittance):
        kind, k_row, k_state = 2, controller.row(), controller.start(reading)
    elif controller == "torque":
        kind = 3
    rows = joint_loop.rows([scene.loop or BareLoop()], np.array([reading]), T)
    parts = [array[0] for array in rows[:-1]]
    noise = np.zeros((n, 4))
    noise[:, 0] = plant.torque_noise * rng.standard_normal(n)
    noise[:, 1] = scene.encoder_noise * rng.standard_normal(n)
    if scene.fault is not None:
        noise[:, 2:] = scene.fault
    hand = scene.hand or Hand(stiffness=0.0, damping=0.0)
    numbers = np.array(
        [
            T,
            substeps,
            round((plant.delay + scene.delay) / (T / substeps)),
            plant.encoder_count,
            plant.torque_limit,
            hand.stiffness,
            hand.damping,
            scene.ripple,
            scene.ripple_cycles,
            float(scene.gravity_compensated),
            phase,
        ]
    )
    arguments = (
        plant.row(),
        (law.rate.KIND, law.element.KIND),
        law.row(),
        law.state(),
        state,
        int(scene.loop is not None),
        *parts,
        rows[-1],
        kind,
        k_row,
        k_state,
        numbers,
        target,
        np.ascontiguousarray(np.stack([motion.position, motion.velocity, motion.grip, motion.push], axis=1)),
        noise,
        np.zeros((n, len(COLUMNS))),
    )
    return arguments, hand.noise * rng.standard_normal(n)
