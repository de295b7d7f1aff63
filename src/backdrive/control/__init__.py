"""The parts of a torque loop: compensation and estimation for joints or a whole arm in one tick, and admittance control."""

from backdrive.control.admittance import Admittance as Admittance
from backdrive.control.arm_joint import ArmJoint as ArmJoint
from backdrive.control.arm_loop import ArmLoop as ArmLoop
from backdrive.control.joint_loop import BareLoop as BareLoop
from backdrive.control.joint_loop import JointLoop as JointLoop
from backdrive.control.joint_loop import torque_limit as torque_limit
from backdrive.control.loop import Loop as Loop
