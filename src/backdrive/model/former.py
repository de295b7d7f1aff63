"""Conversion of entries of former model files to the present schema."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from backdrive.laws import Growth
from backdrive.laws.base import Rate

if TYPE_CHECKING:
    from backdrive.model import Estimate

#: Growth of friction with the load was an entry of the dynamics: term -> its direction of power.
BOTH_WAYS = ("load_dependence", "load_friction")
TERMS = (*BOTH_WAYS, "load_carried", "load_driving", "load_driven")


def beside_the_law(rate: Rate, dynamics: Mapping[str, Estimate]) -> bool:
    """Return whether a growth in the dynamics belongs to the law.

    In a model of a drive the growth belongs to the axis: there the model is judged by motion, and the law computes the load
    itself.
    """
    return "load" not in rate.NEEDS and not any(name.startswith("drive.") for name in dynamics)


def growth_of(
    dynamics: Mapping[str, Estimate],
) -> tuple[Growth | None, dict[str, Estimate], dict[str, float]]:
    """Split dynamics terms into the growth with the load, the other terms, and the standard errors of the growth.

    Args:
        dynamics: by term; `load_dependence` about the load `load_carried`, or `load_friction`, alike in both directions of power;
            or `load_driving` and `load_driven`, from no load on.

    Raises:
        InvalidInput: a number is out of its bounds.
    """
    value = {name: dynamics[name] for name in TERMS if name in dynamics}
    rest = {name: estimate for name, estimate in dynamics.items() if name not in TERMS}
    ways = {name: value.get(name) for name in ("load_driving", "load_driven")}
    for name in BOTH_WAYS:
        if name in value:
            ways = {"load_driving": value[name], "load_driven": value[name]}
    if all(estimate is None for estimate in ways.values()):
        return None, rest, {}
    slopes = {name: 0.0 if estimate is None else estimate.value for name, estimate in ways.items()}
    carried = value["load_carried"].value if "load_carried" in value else 0.0
    errors = {name: estimate.standard_error for name, estimate in ways.items() if estimate is not None}
    return Growth(**slopes, load_carried=carried), rest, errors
