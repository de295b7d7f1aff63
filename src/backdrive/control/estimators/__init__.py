"""Estimators for a torque loop: compiled, nothing allocated per tick, a `Status` instead of an exception."""

from backdrive.control.estimators.adaptive import AdaptiveFriction as AdaptiveFriction
from backdrive.control.estimators.level import Adaptation as Adaptation
from backdrive.control.estimators.recursive import REGRESSORS as REGRESSORS
from backdrive.control.estimators.recursive import RecursiveLeastSquares as RecursiveLeastSquares
