"""Motions for identifying friction within a joint's limits, and the plan objects that logs are linked to."""

from __future__ import annotations

from backdrive.plans.arm import ArmPlan as ArmPlan
from backdrive.plans.base import KINDS
from backdrive.plans.base import Plan as Plan
from backdrive.plans.checks import check_limits as check_limits
from backdrive.plans.constant_velocity import ConstantVelocity as ConstantVelocity
from backdrive.plans.in_turn import Hold as Hold
from backdrive.plans.in_turn import InTurn as InTurn
from backdrive.plans.in_turn import plan_of as plan_of
from backdrive.plans.multisine import Multisine as Multisine
from backdrive.plans.plan_file import load_plan as load_plan
from backdrive.plans.plan_file import plan_from_dict as plan_from_dict
from backdrive.plans.plan_file import plan_to_dict as plan_to_dict
from backdrive.plans.plan_file import save_plan as save_plan
from backdrive.plans.stroke import inertia_bias as inertia_bias
from backdrive.plans.stroke import smallest_stroke as smallest_stroke
from backdrive.plans.stroke import stroke_for_bias as stroke_for_bias
from backdrive.plans.sweep import Sweep as Sweep
from backdrive.plans.torque import SawtoothTorque as SawtoothTorque
from backdrive.plans.torque import SineTorque as SineTorque
from backdrive.plans.torque import TorqueRamp as TorqueRamp

#: Every plan of a single joint. A plan is one file and its line above.
PLANS = tuple(KINDS.values())
