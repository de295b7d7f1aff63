"""Friction models: what was identified of a robot's joints, as an object, as a file, and as presets from publications."""

from backdrive.model.friction_model import ArmModel as ArmModel
from backdrive.model.friction_model import Estimate as Estimate
from backdrive.model.friction_model import FrictionModel as FrictionModel
from backdrive.model.friction_model import JointFriction as JointFriction
from backdrive.model.friction_model import Quality as Quality
from backdrive.model.friction_model import Validity as Validity
from backdrive.model.friction_model import load_model as load_model
