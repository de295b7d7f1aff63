"""A joint, a hand, a controller and what runs in its loop, together in compiled time: true motion beside what a robot would see.

At tick k the encoder is read, the loop's kernel (`control.loop`) gives compensation and estimates, the controller its torque;
their sum acts until the next tick, later by the drive's delay. Between ticks the joint (`engine.axis`) is integrated in steps of
10 to 20 us under the hand's force on its load, friction implicit. The kernel of the loop is the one that a real robot would run.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from backdrive._jit import jit
from backdrive.control import JointLoop, Unguarded, admittance, joint_loop, loop, table
from backdrive.control.admittance import Admittance
from backdrive.engine import axis as axis_
from backdrive.engine import servo as servo_
from backdrive.engine.cores import spread
from backdrive.engine.servo import Servo
from backdrive.errors import InvalidInput
from backdrive.logs.log import Drive, Log
from backdrive.simulation.hand import Hand, HandMotion
from backdrive.simulation.joint import SimulatedJoint
from backdrive.simulation.open_loop import TEMPERATURE, encoder

SUBSTEP = 2e-5  # longest integration step [s]
PUSH = 9  # place of the constant torque in the row of an axis
COLUMNS = (
    "reading", "command", "compensation", "estimate", "friction", "force", "motor", "load",
    "motor_velocity", "load_velocity", "wanted", "status", "level",
)  # fmt: skip


@jit
def run(
    j,
    law,
    p,
    x,
    s,
    loops,
    C,
    cp,
    cx,
    cs,
    E,
    ep,
    ex,
    es,
    g,
    kind,
    k_row,
    k_state,
    numbers,
    target,
    hand,
    noise,
    out,
):
    """Run one scene and fill `out` (n, 13), its columns as in `COLUMNS`.

    `law`: rate and element of the joint; C, ...: compensator; E, ...: estimator; `loops`: 1 where they run; `kind`: 0 no
    controller, 1 servo, 2 admittance; `numbers`: period, substeps, late, count, limit, K_h, B_h, ripple, cycles a unit, gravity
    compensated, phase of the encoder; `target` (n, 2); `hand` (n, 4): position, velocity, grip, push; `noise` (n, 4): of the
    actuator, of the encoder, what a fault adds to the reading, and whether the tick is missed.
    """
    T, substeps, late, count, limit = numbers[0], int(numbers[1]), int(numbers[2]), numbers[3], numbers[4]
    K_h, B_h, ripple, cycles, weightless, phase = (
        numbers[5],
        numbers[6],
        numbers[7],
        numbers[8],
        numbers[9],
        numbers[10],
    )
    h = T / substeps
    offset = j[PUSH]
    before = axis_.gravity(j, s[2])
    reading_before = encoder(s[0] + phase, count)
    n = target.shape[0]
    last = before
    passed = 0.0
    for k in range(n):
        passed += T
        read = encoder(s[0] + phase, count) + noise[k, 1] + noise[k, 2]
        reading = read if np.isfinite(read) else reading_before  # the controller holds on to what it has seen
        v = (reading - reading_before) / passed
        held = 0.0
        if weightless > 0.0:
            j[PUSH] = offset
            held = axis_.gravity(j, reading)
        f, code = 0.0, 0
        if loops > 0:
            g[table.APPLIED, 0] = last - held
            if kind == 1:
                g[table.ERROR, 0], g[table.SLOPE, 0] = target[k, 0] - reading, target[k, 1] - v
            if noise[k, 3] == 0.0:
                code = loop.joint(C, 0, cp, cx, cs, E, ep, ex, es, g, 0, read, passed)
            f = g[table.TORQUE, 0]
        command, wanted = last, target[k, 0]
        if noise[k, 3] == 0.0:
            u = 0.0
            if kind == 1:
                u = servo_.tick(k_row, 0, k_state, passed, target[k, 0], target[k, 1], reading, limit)
            elif kind == 2:
                u = admittance.tick(k_row, 0, k_state, 0, g[table.EXTERNAL, 0], reading, passed)
                wanted = k_state[0]
            command = min(max(u + f + held, -limit), limit)
            last, reading_before, passed = command, reading, 0.0
        elif kind == 2:
            wanted = k_state[0]
        force = hand[k, 2] * (K_h * (hand[k, 0] - s[2]) + B_h * (hand[k, 1] - s[3])) + hand[k, 3]
        out[k, 0], out[k, 1], out[k, 2] = read, command, f
        out[k, 3], out[k, 4], out[k, 5] = g[table.EXTERNAL, 0], g[table.FRICTION, 0], force
        out[k, 6], out[k, 7], out[k, 8], out[k, 9] = s[0], s[2], s[1], s[3]
        out[k, 10], out[k, 11], out[k, 12] = wanted, code, g[table.LEVEL, 0]
        following = k + 1 if k + 1 < n else k
        for i in range(substeps):
            behind = k - (late - i + substeps - 1) // substeps if late > i else k
            acting = (out[behind, 1] if behind >= 0 else before) + noise[k, 0]
            if ripple != 0.0:
                acting += ripple * np.sin(cycles * s[0])
            share = (i + 0.5) / substeps
            x_h = hand[k, 0] + share * (hand[following, 0] - hand[k, 0])
            v_h = hand[k, 1] + share * (hand[following, 1] - hand[k, 1])
            j[PUSH] = offset - (hand[k, 2] * (K_h * (x_h - s[2]) + B_h * (v_h - s[3])) + hand[k, 3])
            axis_.advance(j, s, law[0], law[1], p, x, acting, h, TEMPERATURE)


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """A joint, what runs on it, and a hand.

    Attributes:
        plant: the joint.
        motion: of the hand, which also sets the number of ticks.
        hand: its impedance; None for a hand that only pushes.
        loop: compensator and estimator; None for neither.
        controller: a `Servo` that follows `target`, an `Admittance`, or None.
        target: reference position and velocity, (n, 2); None for where the joint begins.
        period: of the loop [s].
        delay: of the drive beyond that of the plant [s].
        gravity_compensated: the command holds the joint's weight.
        ripple: amplitude of a torque that varies with the motor's position [N.m or N].
        ripple_cycles: of it [1/rad or 1/m, times 2 pi].
        encoder_noise: standard deviation of the reading beside its counts [rad or m].
        substep: longest integration step [s].
        fault: what a fault adds to the encoder's reading [rad or m] (NaN for no reading), and 1 where the loop misses its
            tick, (n, 2); None for none. The controller takes what is no number for the reading before.
        seed: of noises and of the phase of the encoder's counts.
    """

    plant: SimulatedJoint
    motion: HandMotion
    hand: Hand | None = None
    loop: JointLoop | None = None
    controller: Servo | Admittance | None = None
    target: np.ndarray | None = None
    period: float = 1e-3
    delay: float = 0.0
    gravity_compensated: bool = True
    ripple: float = 0.0
    ripple_cycles: float = 0.0
    encoder_noise: float = 0.0
    substep: float = SUBSTEP
    fault: np.ndarray | None = None
    seed: int = 0

    def __post_init__(self):
        n = len(self.motion.position)
        if not (0.0 < self.period < np.inf and 0.0 < self.substep <= self.period and 0.0 <= self.delay < 1.0):
            raise InvalidInput(
                f"period = {self.period} s, substep = {self.substep} s, delay = {self.delay} s.",
                remedy="The period is positive, the substep not longer, the delay below a second.",
            )
        if self.target is not None and np.shape(self.target) != (n, 2):
            raise InvalidInput(
                f"target has the shape {np.shape(self.target)}.",
                remedy=f"Give ({n}, 2), as the hand's motion.",
            )
        if self.fault is not None and np.shape(self.fault) != (n, 2):
            raise InvalidInput(
                f"fault has the shape {np.shape(self.fault)}.", remedy=f"Give ({n}, 2), as the hand's motion."
            )
        if isinstance(self.controller, Admittance) and (self.loop is None or self.loop.external is None):
            raise InvalidInput(
                "Admittance control needs an external force.", remedy="Give the loop an `ExternalForce`."
            )

    def replace(self, **changes: Any) -> Scene:
        """Return a copy with some fields changed."""
        return replace(self, **changes)


@dataclass(frozen=True, kw_only=True, eq=False)
class Record:
    """What happened in a scene: every column (n,), SI units of the joint.

    Attributes:
        scene: what was played.
        time: of the ticks [s].
        reading: of the encoder.
        command: torque of the motor.
        compensation: of friction, a part of the command.
        estimate: of the external force.
        friction: as the estimator takes it.
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


def play(scenes: Scene | Sequence[Scene], *, workers: int | None = None) -> Any:
    """Play scenes and return what happened in each.

    Args:
        scenes: one, or many, which are spread over the cores.
        workers: threads; None: one a core. The numbers do not depend on it.

    Returns:
        A `Record`, or a list of them.
    """
    many = [scenes] if isinstance(scenes, Scene) else list(scenes)
    prepared = [_prepared(scene) for scene in many]

    def work(first: int, last: int) -> None:
        for arguments, _ in prepared[first:last]:
            run(*arguments)

    spread(work, len(prepared), workers)
    records = []
    for scene, (arguments, sensor) in zip(many, prepared):
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


def _prepared(scene: Scene) -> tuple[tuple, np.ndarray]:
    plant, motion, T = scene.plant, scene.motion, scene.period
    n, law = len(motion.position), plant.law
    begin = float(motion.position[0]) if scene.target is None else float(scene.target[0, 0])
    target = (
        np.zeros((n, 2)) if scene.target is None else np.ascontiguousarray(scene.target, dtype=np.float64)
    )
    if scene.target is None:
        target[:, 0] = begin
    rng = np.random.default_rng(scene.seed)
    phase = plant.encoder_count * (rng.uniform() - 0.5)
    state = plant.at_rest(begin)
    reading = float(encoder(begin + phase, plant.encoder_count))
    substeps = int(np.ceil(T / scene.substep - 1e-9))
    controller = scene.controller
    kind, k_row, k_state = 0, np.zeros(admittance.ROW), np.zeros(admittance.STATES)
    if isinstance(controller, Servo):
        kind, k_row, k_state = 1, controller.row(), np.zeros(servo_.STATES)
        k_state[1] = reading
    elif isinstance(controller, Admittance):
        kind, k_row, k_state = 2, controller.row(), controller.start(reading)
    rows = joint_loop.rows([scene.loop or Unguarded()], np.array([reading]), T)
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
