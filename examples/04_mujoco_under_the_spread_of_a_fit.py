"""Identify three joints, draw models that the data left as likely, and roll a MuJoCo arm out under each of them."""

from dataclasses import replace

import numpy as np

from backdrive import Sweep, identify
from backdrive.errors import MissingExtra
from backdrive.simulation import MujocoFriction
from backdrive.simulation.arm import mjcf
from backdrive.simulation.machines import machine
from backdrive.simulation.open_loop import simulate

NAMES = ("joint_0", "joint_1", "joint_2")
DRAWS, STEPS, STEP = 20, 1500, 1e-3

sweep = Sweep(stroke=0.35, top_speed=2.0, cycles=10)
joints = [machine(name).replace(torque_noise=2.0) for name in NAMES]
parts = [identify(simulate(joint, sweep, seed=0)).model for joint in joints]
model = replace(parts[0], joints=tuple(part.joints[0] for part in parts))

try:
    import mujoco
except ImportError as error:
    raise SystemExit(
        MissingExtra("This example needs mujoco.", remedy='pip install "backdrive[sim]"')
    ) from error

arm = mujoco.MjModel.from_xml_string(mjcf())
arm.opt.timestep, arm.opt.gravity[:] = STEP, 0.0
arm.dof_armature[:3] = [joint.motor_inertia for joint in joints]
arm.dof_damping[3:] = 5.0  # the wrist, which was not identified
push = np.array([9.0, -13.0, 4.5])  # N.m, for half a second


def roll(friction_model) -> np.ndarray:
    """Return where the hand comes to rest [m]."""
    data = mujoco.MjData(arm)
    friction = MujocoFriction(friction_model, arm, data)
    for k in range(STEPS):
        data.qfrc_applied[:3] = push if k < 500 else 0.0
        friction.step()
    return data.site("grip").xpos.copy()


ends = np.array([roll(drawn) for drawn in model.draw(DRAWS, seed=1)])
print(f"the hand comes to rest at {np.round(roll(model), 3)} m")
scatter, apart = 1e3 * ends.std(axis=0).max(), 1e3 * np.ptp(ends, axis=0).max()
print(f"{DRAWS} models as likely: {scatter:.1f} mm of scatter, at most {apart:.1f} mm apart")
