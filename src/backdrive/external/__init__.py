"""Estimate the external torque on each joint from a log, and for a whole arm the wrench at a frame, without a force sensor."""

from backdrive.external.estimate import estimate_force as estimate_force
from backdrive.external.payload import PayloadEstimate as PayloadEstimate
from backdrive.external.payload import estimate_payload as estimate_payload
from backdrive.external.result import Contact as Contact
from backdrive.external.result import ForceEstimate as ForceEstimate
from backdrive.external.result import JointForce as JointForce
from backdrive.external.result import Threshold as Threshold
