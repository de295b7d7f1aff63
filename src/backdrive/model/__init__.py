"""Friction models: the results of an identification as an object and as a file, and presets from publications."""

from backdrive.model.covariance import Covariance as Covariance
from backdrive.model.friction_model import ArmModel as ArmModel
from backdrive.model.friction_model import FrictionModel as FrictionModel
from backdrive.model.friction_model import load_model as load_model
from backdrive.model.hardware import Actuator as Actuator
from backdrive.model.hardware import TorqueChannel as TorqueChannel
from backdrive.model.joint_friction import Estimate as Estimate
from backdrive.model.joint_friction import JointFriction as JointFriction
from backdrive.model.joint_friction import Validity as Validity
from backdrive.model.prior import Prior as Prior
from backdrive.model.prior_comparison import PriorComparison as PriorComparison
from backdrive.model.prior_comparison import PriorNumber as PriorNumber
from backdrive.model.quality import Band as Band
from backdrive.model.quality import Bands as Bands
from backdrive.model.quality import Quality as Quality
from backdrive.model.quality import Verdict as Verdict
