"""Simulated joints, and those of the thesis ready to use."""

from backdrive.engine.servo import Servo as Servo
from backdrive.simulation.joint import JointSimulation as JointSimulation
from backdrive.simulation.machines import MACHINES as MACHINES
from backdrive.simulation.machines import machine as machine
from backdrive.simulation.mujoco_friction import MujocoFriction as MujocoFriction
