"""Simulated joints, and those of the thesis ready to use."""

from backdrive.engine.servo import Servo as Servo
from backdrive.plants.joint import SimulatedJoint as SimulatedJoint
from backdrive.plants.thesis import MACHINES as MACHINES
from backdrive.plants.thesis import machine as machine
