"""Orthonormal bases of columns, and inverses of small matrices, without singular values where these are not needed."""

from __future__ import annotations

import numpy as np

CLEAR = 1e-5  # least ratio of the eigenvalues of a matrix that is solved without singular values [-]
ABSENT = 1e-13  # ratio of the eigenvalues below which a column depends on others [-]


def inverse_of(matrix: np.ndarray) -> np.ndarray | None:
    """Return the inverse of a positive definite matrix of one or two rows, (k, k); None if it is nearly singular, or larger."""
    if len(matrix) == 1:
        power = float(matrix[0, 0])
        return np.array([[1.0 / power]]) if power > 0.0 else None
    if len(matrix) > 2:
        return None
    (a, b), (_, d) = matrix.tolist()
    determinant = a * d - b * b
    if not determinant > CLEAR * (a + d) ** 2:
        return None
    return np.array([[d, -b], [-b, a]]) / determinant


def orthonormal(columns: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis of the space spanned by columns, (n, r).

    Directions of less than a millionth of the largest singular value are left out. Where all others are far above that, the
    eigenvectors of the products of the columns give the same space as singular values, in a fraction of the time.
    """
    scaled = columns / np.maximum(np.sqrt(np.einsum("nk,nk->k", columns, columns)), 1e-300)
    power, turned = np.linalg.eigh(scaled.T @ scaled)
    share = power / max(power[-1], 1e-300) if power.size else power
    kept = share > CLEAR
    if np.all(kept | (share < ABSENT)) and kept.any():
        basis = scaled @ (turned[:, kept] / np.sqrt(power[kept]))
        return basis @ (1.5 * np.eye(basis.shape[1]) - 0.5 * basis.T @ basis)  # removes what rounding left
    u, s, _ = np.linalg.svd(scaled, full_matrices=False)
    return u[:, s > 1e-6 * s[0]] if s.size else u
