"""Simulated joints, and those of the thesis ready to use."""

from backdrive.plants.joint import SimulatedJoint as SimulatedJoint
from backdrive.plants.servo import Servo as Servo
from backdrive.plants.thesis import MACHINES as MACHINES
from backdrive.plants.thesis import machine as machine
