"""A simulated joint that follows a plan without a hand, recorded like a real joint.

At tick k the controller reads the encoder and commands u_k. This torque acts on the joint until the next tick, shifted by the
actuator's delay. The log holds the reading and the command of every tick.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.logs.log import Drive, Log
from backdrive.simulation.closed_loop import Scene, kernel_of, prepare
from backdrive.simulation.hand import still
from backdrive.simulation.joint import JointSimulation
from backdrive.simulation.kernel import COLUMNS

SUBSTEP = 5e-4  # longest integration step [s]
DELAYED = 1e-4  # the same with a delay, which is rounded to whole steps [s]
SEEN = ("reading", "command", "motor_velocity", "load_velocity")
PHASE = 0.25  # and longest step as a phase of the transmission's own oscillation [rad]


def simulate(
    plant: JointSimulation,
    plan: Any,
    *,
    seed: int = 0,
    rate: float = 1000.0,
    substep: float | None = None,
) -> Log:
    """Drive a simulated joint along a plan and record it.

    Args:
        plant: the joint; its servo follows a motion plan, a torque plan goes straight to the actuator.
        plan: an object of `backdrive.plans`.
        seed: of the actuator's noise.
        rate: of controller and log [Hz].
        substep: longest step of the integration [s]; None: `longest_step(plant)`.

    Returns:
        A log of one joint: time, encoder position, commanded torque and, for a motion plan, the reference.

    Raises:
        InvalidInput: the plan needs a servo and the joint has none, or rate or substep are not positive.
    """
    if not (0 < rate < np.inf and (substep is None or 0 < substep < np.inf)):
        raise InvalidInput(f"rate = {rate} Hz, substep = {substep} s.", remedy="Both must be positive.")
    closed = plan.commands == "position"
    if closed and plant.servo is None:
        raise InvalidInput(
            f"Simulated joint '{plant.name}' has no servo to follow a motion with.",
            remedy="Give it one, for example servo=Servo.from_bandwidth(inertia, 100.0).",
        )
    T = 1.0 / rate
    first = min(0.0, plan.start)
    time = first + T * np.arange(int(np.floor((plan.start + plan.duration - first) * rate + 1e-9)) + 1)
    target = np.zeros((time.size, 2))
    if closed:
        target[:, 0], target[:, 1] = plan.position(time), plan.velocity(time)
    else:
        target[:, 0] = plan.torque(time)
    out, _ = drive(plant, target, closed=closed, seed=seed, period=T, substep=substep)
    servo = plant.servo
    gains = servo.gains() if closed and servo is not None else {}
    return Log(
        time=time,
        joints=(plant.as_joint(),),
        position=out[:, 0],
        torque=out[:, 1],
        reference=target[:, 0] if closed else None,
        drive_input=target[:, 0],
        drive=Drive(law="position" if closed else "torque", gains=gains),
        plan=plan,
    )


def longest_step(plant: JointSimulation) -> float:
    """Return an integration step [s] whose halving moves an identified knot by less than 2e-4 N.m."""
    longest = DELAYED if plant.delay > 0 else SUBSTEP
    if plant.rigid:
        return longest
    return min(longest, PHASE / np.sqrt(plant.stiffness * (1 / plant.motor_inertia + 1 / plant.load_inertia)))


def drive(
    plant: JointSimulation,
    target: np.ndarray,
    *,
    closed: bool,
    seed: int = 0,
    period: float = 1e-3,
    substep: float | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Drive a simulated joint along sampled targets, and return true quantities that a log does not contain.

    Args:
        plant: the joint.
        target: reference position and velocity where `closed`, otherwise torque command in the first column, (n, 2).
        closed: the servo follows the target.
        seed: of the actuator's noise.
        period: of controller and log [s].
        substep: longest step of the integration [s]; None: `longest_step(plant)`.

    Returns:
        Encoder position, commanded torque, true velocity of motor and of load at every tick, (n, 4); and the state at
        the end, (5,).
    """
    longest = longest_step(plant) if substep is None else substep
    scene = Scene(
        plant=plant,
        motion=still(len(target)),
        controller=plant.servo if closed else "torque",
        target=np.asarray(target, dtype=np.float64),
        period=period,
        gravity_compensated=False,
        encoder_phase=0.0,
        substep=min(longest, period),
        seed=seed,
    )
    arguments, _ = prepare(scene)
    kernel_of((scene, arguments))(*arguments)
    state, record = arguments[4], arguments[-1]
    return record[:, [COLUMNS.index(name) for name in SEEN]], state
