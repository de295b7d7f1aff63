"""The terms of a joint's inverse dynamics other than friction: one table of their names and units, and their columns."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from backdrive.errors import NotIdentifiable
from backdrive.identification.signals import Signals
from backdrive.model import Estimate

#: Term -> unit for a rotary and for a linear joint, including parameters of an axis with its drive and of the initial state.
TERMS: dict[str, tuple[str, str]] = {
    "inertia": ("kg.m^2", "kg"),
    "time_slip": ("s", "s"),
    "delay": ("s", "s"),
    "offset": ("N.m", "N"),
    "gravity_sin": ("N.m", "N"),
    "gravity_cos": ("N.m", "N"),
    "model_torque": ("1", "1"),
    "transition": ("rad/s", "m/s"),
    "load_inertia": ("kg.m^2", "kg"),
    "stiffness": ("N.m/rad", "N/m"),
    "damping": ("N.m.s/rad", "N.s/m"),
    "load_dependence": ("1", "1"),
    "drive.delay": ("s", "s"),
    "drive.filter_time": ("s", "s"),
    "drive.supply": ("V", "V"),
    "drive.torque_constant": ("N.m/A", "N/A"),
    "drive.resistance": ("ohm", "ohm"),
    "drive.supply_resistance": ("ohm", "ohm"),
    "drive.saturation": ("1/A", "1/A"),
    "drive.proportional_factor": ("1", "1"),
    "start.position": ("rad", "m"),
    "start.velocity": ("rad/s", "m/s"),
    "presliding_stiffness": ("N.m/rad", "N/m"),
    "presliding_stiffness_bound": ("N.m/rad", "N/m"),
    "presliding_stiffness_tangent": ("N.m/rad", "N/m"),
    "hysteresis_width": ("rad", "m"),
    "hysteresis_area": ("J", "J"),
}
GRAVITY = ("gravity_sin", "gravity_cos")
RIGID = ("inertia", "offset", *GRAVITY)  # terms that are linear in their parameter


def unit_of(term: str, unit: str) -> str:
    """Return the SI unit of a term for a joint in `rad` or `m`; `SI` for terms that are not in the table."""
    rotary, linear = TERMS.get(term, ("SI", "SI"))
    return rotary if unit == "rad" else linear


def estimates(values: Mapping[str, tuple[float, float]], unit: str) -> dict[str, Estimate]:
    """Return values of terms as the estimates of a model.

    Args:
        values: term -> value and standard error [SI].
        unit: of the joint, `rad` or `m`.
    """
    return {
        term: Estimate(value=float(value), unit=unit_of(term, unit), standard_error=float(error))
        for term, (value, error) in values.items()
    }


def column(motion: Any, term: str) -> np.ndarray:
    """Return the regressor column of a term of `RIGID`, (n,).

    Args:
        motion: any object with `acceleration`, `torque` and `position`.
        term: one of `RIGID`.

    Raises:
        NotIdentifiable: gravity is to be fitted without positions.
    """
    if term == "inertia":
        return motion.acceleration
    if term == "offset":
        return np.ones_like(motion.torque)
    if motion.position is None:
        raise NotIdentifiable(
            "Gravity is sought, but the log holds no position.",
            remedy="Record the position, or leave gravity out.",
        )
    if isinstance(motion, Signals) and motion.pull is not None:
        return motion.pull[GRAVITY.index(term)]
    return np.sin(motion.position) if term == "gravity_sin" else np.cos(motion.position)


def columns(motion: Any, terms: Iterable[str]) -> np.ndarray:
    """Return the regressor columns of some terms of `RIGID`, one per row, (k, n)."""
    rows = [column(motion, term) for term in terms]
    return np.array(rows).reshape(len(rows), len(motion.torque))
