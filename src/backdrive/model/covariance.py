"""The covariance of the identified parameters: one matrix for law and dynamics of a joint, with named rows."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from backdrive._documents import is_several
from backdrive.errors import InvalidInput

MOST_ROWS = 200  # of a matrix; a file of larger ones would not be read
MOST_VARIANCE = 1e60  # a parameter with a larger variance is undetermined and has no row
ROUNDING = 1e-6  # of correlations, and of standard errors beside the matrix [-]
AGAIN = "Correct it there, or identify again."


@dataclass(frozen=True, kw_only=True)
class Covariance:
    """Covariance of a joint's numbers.

    Attributes:
        names: of the rows: parameters of rate law, element and growth, `name[i]` where a parameter has several values, and terms
            of the dynamics. Numbers without a row have no known covariance.
        matrix: symmetric, in products of the numbers' units, one row a name.
    """

    names: tuple[str, ...]
    matrix: tuple[tuple[float, ...], ...]

    def __post_init__(self):
        size = len(self.names)
        if not 0 < size <= MOST_ROWS:
            raise InvalidInput(f"The covariance has {size} rows.", remedy=f"It has 1 to {MOST_ROWS}.")
        if len(set(self.names)) < size:
            raise InvalidInput("The covariance names a row twice.", remedy=AGAIN)
        if len(self.matrix) != size or any(len(row) != size for row in self.matrix):
            raise InvalidInput(
                f"The covariance of {size} numbers is not of {size} rows and columns.", remedy=AGAIN
            )
        check_covariance(self.array())

    @classmethod
    def of(cls, names: Sequence[str], matrix: np.ndarray) -> Covariance | None:
        """Return the covariance of the parameters with a known variance; None if no valid matrix remains.

        Args:
            names: of the rows.
            matrix: (k, k); NaN or infinite where something is not determined.
        """
        variance = np.diag(matrix)
        known = np.flatnonzero(np.isfinite(variance) & (variance > 0.0) & (variance < MOST_VARIANCE))
        if not 0 < known.size <= MOST_ROWS:
            return None
        part = matrix[np.ix_(known, known)]
        part = 0.5 * (part + part.T)
        with suppress(InvalidInput):  # rounding errors of a nearly singular matrix
            return cls(
                names=tuple(names[i] for i in known.tolist()),
                matrix=tuple(tuple(row) for row in part.tolist()),
            )

    def array(self) -> np.ndarray:
        """Return the matrix, (k, k)."""
        return np.array(self.matrix, dtype=np.float64)

    def standard_errors(self) -> dict[str, float]:
        """Return the roots of the diagonal by name of the row."""
        return dict(zip(self.names, np.sqrt(np.diag(self.array())).tolist(), strict=True))

    def of_numbers(self, errors: Mapping[str, Any]) -> Covariance | None:
        """Return the covariance of the rows that belong to a joint's numbers; None if there is no such row.

        Args:
            errors: standard errors by parameter and term, one number or one a value; NaN where unknown.

        Raises:
            InvalidInput: a standard error is not that of the matrix; the message names the row.
        """
        kept: list[int] = []
        for i, (row, own) in enumerate(self.standard_errors().items()):
            stated: Any = errors.get(row)
            if row.endswith("]") and (indexed := re.fullmatch(r"(\w+)\[(\d{1,5})\]", row, re.ASCII)):
                values, index = errors.get(indexed[1]), int(indexed[2])
                stated = values[index] if is_several(values) and index < len(values) else None
            if stated is None or is_several(stated):
                continue
            if not math.isnan(stated) and abs(stated - own) > ROUNDING * max(stated, own):
                raise InvalidInput(
                    f"The standard error of '{row}' is {stated:g}, and {own:g} by its covariance.",
                    remedy="Give those of the covariance, or no covariance.",
                )
            kept.append(i)
        if len(kept) in (0, len(self.names)):
            return self if kept else None
        matrix = tuple(tuple(self.matrix[i][j] for j in kept) for i in kept)
        return Covariance(names=tuple(self.names[i] for i in kept), matrix=matrix)


def check_covariance(matrix: np.ndarray) -> None:
    """Refuse an invalid covariance matrix.

    Raises:
        InvalidInput: it is not finite, not symmetric, or not positive semidefinite beyond rounding.
    """
    if not np.all(np.isfinite(matrix)):
        raise InvalidInput("The covariance holds numbers that are not finite.", remedy=AGAIN)
    variance = np.diag(matrix)
    if np.any(variance < 0.0):
        raise InvalidInput("The covariance has a negative variance.", remedy=AGAIN)
    deviation = np.sqrt(variance)
    scale = np.where(deviation > 0.0, deviation, np.finfo(float).tiny)
    with np.errstate(over="ignore"):
        correlation = matrix / scale[:, None] / scale
    if np.any(np.abs(correlation) > 1.0 + ROUNDING):
        raise InvalidInput("The covariance holds a correlation beyond 1.", remedy=AGAIN)
    if np.any(np.abs(correlation - correlation.T) > ROUNDING):
        raise InvalidInput("The covariance is not symmetric.", remedy=AGAIN)
    if np.linalg.eigvalsh(correlation)[0] < -ROUNDING * len(matrix):
        raise InvalidInput("The covariance is not positive semidefinite.", remedy=AGAIN)


def errors_by_parameter(names: Sequence[str], matrix: np.ndarray) -> dict[str, Any]:
    """Return the roots of a covariance's diagonal by parameter and term: one number, or as many as there are rows `name[i]`.

    Args:
        names: of the rows, those of a parameter in their order.
        matrix: (k, k).
    """
    errors: dict[str, Any] = {}
    for row, error in zip(names, np.sqrt(np.maximum(np.diag(matrix), 0.0)).tolist(), strict=True):
        name, bracket, _ = row.partition("[")
        errors[name] = (*errors.get(name, ()), error) if bracket else error
    return errors
