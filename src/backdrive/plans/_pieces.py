"""`Pieces`: a function of time in polynomial pieces, with its derivatives, at rest before the first and after the last."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


class Pieces:
    """A piecewise polynomial of at most fifth order.

    Args:
        edges: instants at which pieces begin and, the last one, end [s], (k + 1,), ascending.
        coefficients: ascending powers of the time since the piece began, (k, 6).
    """

    def __init__(self, edges: np.ndarray, coefficients: np.ndarray):
        self.edges = edges
        self._orders = [coefficients]
        for _ in range(2):
            c = self._orders[-1]
            self._orders.append(np.column_stack([c[:, 1:] * np.arange(1, c.shape[1]), np.zeros(len(c))]))

    @classmethod
    def through(cls, knots: Sequence[tuple[float, float, float, float]]) -> Pieces:
        """Return quintics through knots (t, y, dy, ddy): y is continuous to its second derivative.

        Knots on a straight line are joined by a straight line, so rest and constant speed are preserved.
        """
        t, y, v, a = np.array(knots, dtype=np.float64).T
        keep = np.concatenate([[True], np.diff(t) > 0])  # a piece of no duration is none
        t, y, v, a = t[keep], y[keep], v[keep], a[keep]
        d, h = np.diff(t), np.diff(y)
        v0, v1, a0, a1 = v[:-1], v[1:], a[:-1], a[1:]
        straight = (
            (v0 == v1) & (a0 == 0) & (a1 == 0) & (np.abs(h - v0 * d) <= 1e-9 * (np.abs(h) + np.abs(v0 * d)))
        )
        high = np.array(
            [
                (20 * h - (8 * v1 + 12 * v0) * d - (3 * a0 - a1) * d**2) / (2 * d**3),
                (-30 * h + (14 * v1 + 16 * v0) * d + (3 * a0 - 2 * a1) * d**2) / (2 * d**4),
                (12 * h - 6 * (v1 + v0) * d + (a1 - a0) * d**2) / (2 * d**5),
            ]
        )
        high = np.where(straight, 0.0, high)
        return cls(t, np.column_stack([y[:-1], v0, a0 / 2, *high]))

    @classmethod
    def linear(cls, times: np.ndarray, values: np.ndarray) -> Pieces:
        """Return straight lines between values (k + 1,) at times (k + 1,) [s]."""
        times, values = np.asarray(times, dtype=np.float64), np.asarray(values, dtype=np.float64)
        coefficients = np.zeros((times.size - 1, 6))
        coefficients[:, 0] = values[:-1]
        coefficients[:, 1] = np.diff(values) / np.diff(times)
        return cls(times, coefficients)

    def __call__(self, t: np.ndarray, order: int = 0) -> np.ndarray:
        """Return the function or a derivative.

        Args:
            t: instants [s], any shape.
            order: 0, 1 or 2.
        """
        first, last = self.edges[0], self.edges[-1]
        i = np.clip(np.searchsorted(self.edges, t, side="right") - 1, 0, self.edges.size - 2)
        c = self._orders[order][i]
        x = np.clip(t, first, last) - self.edges[i]
        y = c[..., 5]
        for k in (4, 3, 2, 1, 0):
            y = y * x + c[..., k]
        return y if order == 0 else np.where((t >= first) & (t < last), y, 0.0)
