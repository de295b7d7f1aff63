"""A simulated joint in closed loop, recorded as a real one would be.

At tick k the controller reads the encoder and commands u_k; what reaches the joint until the next tick is u_k, later by the
actuator's delay. The log holds the reading and the command of every tick.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive._jit import jit
from backdrive.engine import axis as axis_
from backdrive.engine import servo as servo_
from backdrive.errors import InvalidInput
from backdrive.logs.log import Drive, Log
from backdrive.simulation.joint import SimulatedJoint

SUBSTEP = 5e-4  # longest integration step [s]
DELAYED = 1e-4  # the same with a delay, which is rounded to whole steps [s]
TEMPERATURE = 20.0  # degC, of a simulated joint
PHASE = 0.25  # and longest step as a phase of the transmission's own oscillation [rad]


@jit
def encoder(p, count):
    """What an encoder of this resolution reads at position p."""
    if count > 0.0:
        return count * np.floor(p / count + 0.5)
    return p


@jit
def run(j, rate, element, p, x, s, g, c, limit, count, T, substeps, late, closed, target, noise, out):
    """Run the loop and fill `out` with position, command, and true velocity of motor and load at every tick.

    `j`, `s` are the joint and its state; `rate`, `element`, `p`, `x` its friction; `g`, `c` its servo and the servo's state.
    T is the period, cut into `substeps`; the torque comes `late` substeps after its command. `target` holds reference and
    its velocity where `closed`, otherwise the torque command and nothing; `noise` is added to the torque of every tick.
    """
    n = target.shape[0]
    h = T / substeps
    before = axis_.gravity(j, s[2])
    for k in range(n):
        reading = encoder(s[0], count)
        if closed:
            u = servo_.tick(g, 0, c, T, target[k, 0], target[k, 1], reading, limit)
        else:
            u = min(max(target[k, 0], -limit), limit)
        out[k, 0], out[k, 1], out[k, 2], out[k, 3] = reading, u, s[1], s[3]
        for i in range(substeps):
            behind = k - (late - i + substeps - 1) // substeps if late > i else k
            acting = out[behind, 1] if behind >= 0 else before
            axis_.advance(j, s, rate, element, p, x, acting + noise[k], h, TEMPERATURE)


def simulate(
    plant: SimulatedJoint,
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
            remedy="Give it one, for example servo=Servo.tuned(inertia, 100.0).",
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


def longest_step(plant: SimulatedJoint) -> float:
    """Return an integration step [s] whose halving moves an identified knot by less than 2e-4 N.m."""
    longest = DELAYED if plant.delay > 0 else SUBSTEP
    if plant.rigid:
        return longest
    return min(longest, PHASE / np.sqrt(plant.stiffness * (1 / plant.motor_inertia + 1 / plant.load_inertia)))


def drive(
    plant: SimulatedJoint,
    target: np.ndarray,
    *,
    closed: bool,
    seed: int = 0,
    period: float = 1e-3,
    substep: float | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Drive a simulated joint along sampled targets, and see also what no log shows.

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
    substeps = int(np.ceil(period / (longest_step(plant) if substep is None else substep) - 1e-9))
    h = period / substeps
    start = float(target[0, 0]) if closed else 0.0
    s = plant.at_rest(start)
    servo = plant.servo
    g = servo.row() if servo is not None else np.zeros(4)
    c = np.zeros(servo_.STATES)
    if closed:
        c[1] = encoder(start, plant.encoder_count)
        if g[2] > 0:
            c[0] = float(plant.gravity(s[2])) / g[2]  # it had been holding the joint
    noise = plant.torque_noise * np.random.default_rng(seed).standard_normal(len(target))
    law = plant.law
    out = np.zeros((len(target), 4))
    run(
        plant.row(),
        law.rate.KIND,
        law.element.KIND,
        law.row(),
        law.state(),
        s,
        g,
        c,
        plant.torque_limit,
        plant.encoder_count,
        period,
        substeps,
        round(plant.delay / h),
        closed,
        np.ascontiguousarray(target, dtype=np.float64),
        noise,
        out,
    )
    return out, s
