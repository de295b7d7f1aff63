"""The choice between a symmetric law and one with parameters for each direction, by option or by the residuals.

A law that has parameters for each direction from the start may have more than the data tell apart. Its numbers x, with the
covariance C and the differences d = D x of the directions, are then averaged with those without a difference (Kass & Raftery, JASA
90, 1995; Buckland, Burnham & Augustin, Biometrics 53, 1997):

    x - p u,   u = C D' V^-1 d,   V = D C D',
    C - p C D' V^-1 D C + p (1 - p) u u'

p: probability that there is none, where both are as likely before the log is seen, and a difference is then about as large as the
numbers themselves, with the variance T:  p / (1 - p) = sqrt(|V + T| / |V|) exp((d' (V + T)^-1 d - d' V^-1 d) / 2).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.identification.dynamic.fit import Fit, with_numbers
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


def average_directions(fit: Fit) -> Fit:
    """Return a fit whose directions differ no more than the data tell; the same fit where a range does not allow it.

    Args:
        fit: with its covariance.
    """
    covariance = fit.covariance
    if covariance is None or fit.at_bound or fit.interrupted:
        return fit
    names = list(covariance.names)
    pairs = [(n, n.replace(*ALIKE)) for n in names if n.endswith(ALIKE[0]) and n.replace(*ALIKE) in names]
    if not pairs:
        return fit
    x, C = np.array([fit.values[n] for n in names]), covariance.array()
    D = np.array([[(n == b) - (n == a) for n in names] for a, b in pairs], dtype=float)
    d, V, T = D @ x, D @ C @ D.T, np.diag([0.5 * (fit.values[a] ** 2 + fit.values[b] ** 2) for a, b in pairs])
    both = V + T
    if not (np.linalg.eigvalsh(V)[0] > 0.0 and np.all(np.diag(T) > 0.0)):
        return fit
    log_odds = 0.5 * (np.linalg.slogdet(both)[1] - np.linalg.slogdet(V)[1])
    log_odds += 0.5 * (d @ np.linalg.solve(both, d) - d @ np.linalg.solve(V, d))
    p = 1.0 / (1.0 + math.exp(-max(log_odds, -500.0)))
    pull = np.linalg.solve(V, D @ C).T
    u = pull @ d
    matrix = C - p * pull @ D @ C + p * (1.0 - p) * np.outer(u, u)
    return with_numbers(fit, names, x - p * u, matrix, np.sqrt(np.diag(matrix))) or fit


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
