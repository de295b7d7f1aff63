"""Motions that make friction visible inside a joint's limits, and the plan that a log is later linked to."""

from __future__ import annotations

from backdrive.excite.base import Plan as Plan
from backdrive.excite.checks import check_limits as check_limits
from backdrive.excite.constant_velocity import ConstantVelocity as ConstantVelocity
from backdrive.excite.in_turn import Held as Held
from backdrive.excite.in_turn import InTurn as InTurn
from backdrive.excite.in_turn import plan_of as plan_of
from backdrive.excite.multisine import Multisine as Multisine
from backdrive.excite.plan_file import PLANS as PLANS
from backdrive.excite.plan_file import load_plan as load_plan
from backdrive.excite.plan_file import plan_from_dict as plan_from_dict
from backdrive.excite.plan_file import plan_to_dict as plan_to_dict
from backdrive.excite.plan_file import save_plan as save_plan
from backdrive.excite.stroke import inertia_bias as inertia_bias
from backdrive.excite.stroke import smallest_stroke as smallest_stroke
from backdrive.excite.stroke import stroke_for_bias as stroke_for_bias
from backdrive.excite.sweep import Sweep as Sweep
from backdrive.excite.torque import SawtoothTorque as SawtoothTorque
from backdrive.excite.torque import SineTorque as SineTorque
from backdrive.excite.torque import TorqueRamp as TorqueRamp
