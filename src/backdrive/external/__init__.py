"""From a log to the external torque on each joint, and of a whole arm to the wrench at a frame, without a force sensor."""

from backdrive.external.estimate import estimate_force as estimate_force
from backdrive.external.result import Contact as Contact
from backdrive.external.result import ForceEstimate as ForceEstimate
from backdrive.external.result import JointForce as JointForce
from backdrive.external.result import Threshold as Threshold
