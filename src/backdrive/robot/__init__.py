"""Rigid bodies of a robot, from URDF or MJCF: inertia, gravity, regressors, frames and Jacobians."""

from backdrive.robot.base import BaseParameters as BaseParameters
from backdrive.robot.bodies import PARAMETERS as PARAMETERS
from backdrive.robot.bodies import PER_LINK as PER_LINK
from backdrive.robot.bodies import Range as Range
from backdrive.robot.bodies import Robot as Robot
from backdrive.robot.bodies import require_pinocchio as require_pinocchio
from backdrive.robot.description import load_robot as load_robot
from backdrive.robot.description import parse_robot as parse_robot
