"""Kernels for KIND numbers that no law has: they return NaN."""

from __future__ import annotations

import numpy as np

from backdrive._jit import leaf
from backdrive._types import Array, Pair


@leaf
def no_curve(p: Array, v: float, load: Pair, temp: float):
    """Rate law of an unused number."""
    return np.nan, np.nan, np.nan


@leaf
def no_row(p: Array, e: int, x: Array, y: Array, lo: float, hi: float, dp: float, dt: float):
    """Element of a number that no class has."""
    return np.nan


@leaf
def no_torque(p: Array, e: int, z: float, lo: float, hi: float, dp: float, dt: float):
    """Element of a number that no class has."""
    return z, np.nan


@leaf
def no_motion(p: Array, e: int, z: float, lo: float, hi: float, dp: float, dt: float):
    """Element of a number that no class has, and the motion under it."""
    return z, np.nan, np.nan


@leaf
def nothing_ahead(p: Array, e: int, lo: float, hi: float, dp: float):
    """`ahead` of an element that does not offer it."""
    return np.nan, np.nan


@leaf
def no_weight(p: Array, e: int, v: float):
    """`weight` of an element that does not offer it."""
    return np.nan


@leaf
def no_state(z: float, a: float, b: float):
    """`follow` of an element that does not offer it."""
    return np.nan


@leaf
def no_torque_of_states(p: Array, e: int, z: float, after: float, c: float, dt: float):
    """`torque` of an element that does not offer it."""
    return np.nan
