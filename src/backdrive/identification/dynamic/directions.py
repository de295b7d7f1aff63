"""The choice between a symmetric law and one with parameters for each direction, by option or by the residuals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.identification.dynamic.fit import Fit
from backdrive.identification.dynamic.unknowns import LawShape
from backdrive.identification.options import Options
from backdrive.laws.direction import BACKWARD, law_by_direction

ALIKE = ("_negative", "_positive")  # suffixes of parameters in laws with both directions


def name_by_direction(law: str) -> str:
    """Return the name of the law with parameters for each direction; the same name if it has them already."""
    shape = LawShape.from_name(law)
    return replace(shape, rate=law_by_direction(shape.rate)).name if shape.rate.SYMMETRIC else shape.name


def laws_to_try(laws: Sequence[str], symmetric: bool | None) -> list[str]:
    """Return the names of the laws to try, with parameters for each direction if the user asks for them."""
    return list(dict.fromkeys(map(name_by_direction, laws))) if symmetric is False else list(laws)


def terms_beside(shape: LawShape, terms: Sequence[str], options: Options) -> list[str]:
    """Return the terms fitted beside a law. A constant torque that Coulomb friction by direction can replace is left out."""
    kept = options.symmetric is not False or shape.tells_offset or "offset" in options.bounds
    return [term for term in terms if kept or term != "offset"]


def symmetric_shape(shape: LawShape) -> LawShape:
    """Return a shape with the same parameters in both directions.

    Raises:
        InvalidInput: the law's parameters are not two sets, one per direction.
    """
    if shape.rate.SYMMETRIC:
        return shape
    first = {name: name.removesuffix(BACKWARD).replace(*ALIKE) for name in shape.rate.PARAMETERS}
    ties = {name: one for name, one in first.items() if one != name}
    if 2 * len(ties) != len(shape.rate.PARAMETERS):
        raise InvalidInput(
            f"'{shape.rate.NAME}' differs by direction and has no symmetric form.",
            remedy="Leave `symmetric` out, or choose a law that is alike in both directions: stribeck-gauss.",
        )
    return replace(shape, ties=ties)


def gain(one: Fit, velocity: np.ndarray) -> float:
    """Return the relative decrease of the mean square with parameters for each direction, to first order [-].

    A parameter for one direction acts only during motion in that direction. Its derivatives are therefore those of the
    symmetric parameter during that motion, and zero otherwise.

    Args:
        one: fit of a symmetric law to torque.
        velocity: of the fitted samples [rad/s or m/s], (m,).
    """
    residual, jacobian = one.found.residual, one.found.jacobian
    names = one.problem.shape.rate.PARAMETERS
    of_rate = [i for i, name in enumerate(one.problem.names) if name in names]
    backward = jacobian[:, of_rate] * (velocity < 0.0)[:, None]
    A = np.hstack([jacobian, backward])
    A = A / np.maximum(np.linalg.norm(A, axis=0), 1e-300)
    left = residual - A @ np.linalg.lstsq(A, residual, rcond=1e-8)[0]
    square = float(residual @ residual)
    return 1.0 - float(left @ left) / square if square > 0.0 else 0.0
