"""What runs in a torque loop: compensation and estimation in one tick, admittance control."""

from backdrive.control.admittance import Admittance as Admittance
from backdrive.control.loop import JointLoop as JointLoop
from backdrive.control.loop import Loop as Loop
