"""The interface between a fit and its search: names, bounds, residuals for batches of points, and scales of the errors.

There are two problems: torque given motion (`torque`), and motion given the drive's input (`motion_problem`). Each defines
the unknowns, the measurement and its prediction. This base class converts between search points and parameters, and computes
the residuals.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from backdrive.engine import Axis
from backdrive.errors import InvalidInput
from backdrive.identification.dynamic.search import SearchResult
from backdrive.identification.dynamic.unknowns import LawShape, Unknown
from backdrive.identification.noise import LONGEST


class Problem(ABC):
    """Residuals of a law on records of one joint, for batches of parameter sets.

    Args:
        shape: shape of the law to fit.
        unknowns: all estimated parameters, in the order of the search coordinates.
        start: starting point of parameters without a value, (P,); None: the middle of each range.

    Attributes:
        names: of the unknowns.
        lower: lower bounds [search coordinate], (P,).
        upper: upper bounds [search coordinate], (P,).
        STEP: step of the forward differences of a profile [search coordinate].
    """

    STEP: ClassVar[float] = 1e-5

    def __init__(self, shape: LawShape, unknowns: Sequence[Unknown], start: np.ndarray | None = None):
        self.shape, self.unknowns = shape, tuple(unknowns)
        self.names = tuple(u.name for u in self.unknowns)
        self.lower = np.array([float(u.inward(u.lower)) for u in self.unknowns])
        self.upper = np.array([float(u.inward(u.upper)) for u in self.unknowns])
        self.start = 0.5 * (self.lower + self.upper) if start is None else start

    @abstractmethod
    def series(self, records: Sequence[Any] | None = None) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return the measured signal and the samples that count, (n,) each, for other records or for the fitted ones."""

    @abstractmethod
    def predict(
        self,
        values: Sequence[Mapping[str, float]],
        records: Sequence[Any] | None = None,
        *,
        friction: bool = False,
    ) -> list[np.ndarray]:
        """Return the prediction of parameter sets for every record, each (B, n).

        Args:
            values: parameters by name, one mapping per parameter set.
            records: other records of the joint; None: the fitted ones.
            friction: return friction alone, without the other terms of the dynamics (fits of torque only).
        """

    @property
    def instants(self) -> np.ndarray:
        """Index of the sample of each residual, with records at least `noise.LONGEST` samples apart, (m,)."""
        counted = [counts for _, counts in self.series()]
        begin = np.cumsum([0, *(len(counts) + LONGEST for counts in counted[:-1])])
        return np.concatenate([b + np.flatnonzero(counts) for b, counts in zip(begin, counted, strict=True)])

    @property
    def size(self) -> int:
        """Number of residuals."""
        return sum(int(counts.sum()) for _, counts in self.series())

    def values(self, point: np.ndarray) -> dict[str, float]:
        """Return the parameters of a search point, by name."""
        # as `Unknown.outward` of each, in a tenth of the time
        log, scale, lower, upper = self._outward
        point = np.asarray(point)
        value = point * scale
        value[log] = np.exp(point[log])
        return dict(zip(self.names, np.clip(value, lower, upper).tolist(), strict=True))

    @cached_property
    def _outward(self) -> tuple[np.ndarray, ...]:
        """Which unknowns are searched by their logarithm, and scales and bounds of all, (P,) each."""
        log = np.array([u.log for u in self.unknowns], dtype=bool)
        rest = np.array([[u.scale, u.lower, u.upper] for u in self.unknowns], dtype=np.float64).reshape(-1, 3)
        return log, *rest.T

    def point(self, values: Mapping[str, float]) -> np.ndarray:
        """Return the search point of parameters by name; missing ones take their starting value."""
        given = [
            float(u.inward(values[u.name])) if u.name in values else s
            for u, s in zip(self.unknowns, self.start, strict=True)
        ]
        return np.array(given)

    def residuals(self, points: np.ndarray) -> np.ndarray:
        """Return predicted minus measured values for a batch of search points [unit of the measurement], (B, m)."""
        predicted = self.predict([self.values(p) for p in points])
        residual, begin = np.empty((len(points), sum(y.size for _, y in self._measurements))), 0
        for x, (rows, y) in zip(predicted, self._measurements, strict=True):
            part = residual[:, begin : begin + y.size]
            if isinstance(rows, slice):
                np.subtract(x[:, rows], y, out=part)
            else:
                for ahead, model in zip(part, x, strict=True):  # without a temporary array of full size
                    np.take(model, rows, out=ahead, mode="clip")  # the default mode would copy
                    ahead -= y
            begin += y.size
        return residual

    @cached_property
    def _measurements(self) -> list[tuple[np.ndarray | slice, np.ndarray]]:
        """The samples that count, a slice or (m,), and the signal measured there, (m,), of each record."""
        rows = [(y, np.flatnonzero(counts)) for y, counts in self.series()]
        whole = [index.size > 0 and index[-1] - index[0] + 1 == index.size for _, index in rows]
        return [
            (slice(index[0], index[-1] + 1) if all_ else index, y[index])
            for (y, index), all_ in zip(rows, whole, strict=True)
        ]

    def encoder(self, point: np.ndarray) -> np.ndarray:
        """Return the change of the residuals for random encoder rounding errors, one draw per row, (draws, m).

        By default, there are no draws.

        Args:
            point: search coordinates, (P,).
        """
        return np.zeros((0, self.size))

    def sort_elements(self, found: SearchResult) -> SearchResult:
        """Return the end of a search with interchangeable elements in a fixed order."""
        return found

    def yardstick(self, unknown: Unknown) -> tuple[float, float]:
        """Return the smallest and the largest value that the error of an unknown is compared with [SI]."""
        return 0.0, np.inf

    def bracket(
        self, values: Mapping[str, float], record: Any, predicted: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return lower and upper limits between which a measurement has no error, (n,) each; by default the prediction."""
        return predicted, predicted

    def axis_of(self, values: Mapping[str, float]) -> Axis:
        """Return the axis with law and drive for given parameter values.

        Raises:
            InvalidInput: torque was fitted, which does not determine an axis with its drive.
        """
        raise InvalidInput(
            "A fit of torque given motion does not identify an axis with a drive.",
            remedy="Use its `law` and `values`.",
        )
