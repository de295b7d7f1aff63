"""Estimators for a torque loop: compiled, nothing allocated per tick, a `Status` instead of an exception."""

from backdrive.estimate.adaptive import AdaptiveFriction as AdaptiveFriction
from backdrive.estimate.level import Adaptation as Adaptation
from backdrive.estimate.recursive import REGRESSORS as REGRESSORS
from backdrive.estimate.recursive import RecursiveLeastSquares as RecursiveLeastSquares
