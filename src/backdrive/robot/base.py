"""Base parameters: the combinations of inertial parameters that joint torques determine (Gautier & Khalil 1990)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

INDEPENDENT = 1e-9  # a column whose remainder is smaller than this share of the largest is a combination [-]


@dataclass(frozen=True, kw_only=True, eq=False)
class BaseParameters:
    """The combinations of standard parameters that joint torques determine: beta = relation @ theta.

    Found by a QR factorisation with column pivoting of the regressor at random states. With its columns divided into
    independent ones Y_1 and dependent ones Y_2 = Y_1 X, Y theta = Y_1 (theta_1 + X theta_2): so `relation` is the identity on
    `columns` and X on the others (Gautier 1991).

    Attributes:
        columns: the independent columns of the regressor, (b,).
        relation: from standard to base parameters, (b, 10 J).
    """

    columns: np.ndarray
    relation: np.ndarray

    @classmethod
    def of(cls, regressor: np.ndarray) -> BaseParameters:
        """Return the base parameters of a regressor at random states, (rows, 10 J)."""
        from scipy.linalg import qr, solve_triangular

        _, r, order = qr(regressor, mode="economic", pivoting=True)  # type: ignore[misc]
        size = np.abs(np.diag(r))
        rank = int(np.sum(size > INDEPENDENT * size[0])) if size[0] > 0 else 0
        relation = np.zeros((rank, regressor.shape[1]))
        relation[:, order[:rank]] = np.eye(rank)
        relation[:, order[rank:]] = solve_triangular(r[:rank, :rank], r[:rank, rank:])
        relation[np.abs(relation) < INDEPENDENT] = 0.0
        ascending = np.argsort(order[:rank])
        return cls(columns=order[:rank][ascending], relation=relation[ascending])

    def standard(self, beta: np.ndarray, nominal: np.ndarray, spread: np.ndarray) -> np.ndarray:
        """Return the standard parameters with these base parameters that are nearest to nominal ones.

        Args:
            beta: base parameters, (b,).
            nominal: standard parameters to stay near, (10 J,).
            spread: expected deviation of each, in its unit, (10 J,).

        Returns:
            theta with relation @ theta = beta and the least sum of ((theta - nominal) / spread)^2, (10 J,).
        """
        scaled = self.relation * spread
        step = np.linalg.lstsq(scaled, beta - self.relation @ nominal, rcond=None)[0]
        return nominal + spread * step
