"""The input of the plausibility rules for one joint, and the remark that a rule returns."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from backdrive.identification.other_motion import OtherMotion
from backdrive.identification.residual import Residual
from backdrive.identification.result import JointEvidence
from backdrive.logs.log import Log
from backdrive.logs.resolution import encoder_step
from backdrive.model import JointFriction

SURE = 3.0  # least significance of a difference [standard error]
EARLY = 0.8  # least possible break-away torque, relative to Coulomb friction [-]
SHARE = 0.05  # least difference, relative to the value itself or to the friction [-]
ONE_WAY_ONLY = "The joint moved in one direction only: friction and a constant torque cannot be separated."
NO_ERRORS = "No standard errors are stated: "  # what a sentence with the reasons begins with
Severity = Literal["poor", "unknown", "care", "note"]


@dataclass(frozen=True, kw_only=True)
class Remark:
    """The result of a rule.

    Attributes:
        severity: the best grade that the remark allows; a `note` does not change the grade.
        sentence: the text, with numbers.
    """

    severity: Severity
    sentence: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """The data of one joint that the rules check.

    Attributes:
        friction: of one joint.
        evidence: of the same joint.
        logs: fitted logs.
        known_delay: of the torque behind the motion, if the user knows it [s].
        others: motion of all joints of the logs; None: unknown.
    """

    friction: JointFriction
    evidence: JointEvidence
    logs: Sequence[Log] = ()
    known_delay: float | None = None
    others: OtherMotion | None = None

    @property
    def residual(self) -> Residual | None:
        """Residual of the model in short means; None if the method has none."""
        return self.evidence.residual

    @cached_property
    def count(self) -> float:
        """The encoder's step [rad or m]; 0 if the positions have no steps."""
        name = self.friction.joint.name
        return max((encoder_step(log, name) for log in self.logs), default=0.0)

    @property
    def unit(self) -> str:
        """Unit of torques."""
        return self.friction.joint.torque_unit

    def value(self, term: str) -> tuple[float, float]:
        """Return value and standard error of a term; NaN if the model lacks the term."""
        estimate = self.friction.dynamics.get(term)
        return (math.nan, math.nan) if estimate is None else (estimate.value, estimate.standard_error)
