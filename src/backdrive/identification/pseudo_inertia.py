"""The ten inertial parameters of a body as a symmetric matrix, which is positive definite exactly for physical bodies.

    P = [[S, h], [h', m]],     S = tr(I)/2 - I,     h = m c

I is the inertia about the frame's origin, h the first moment, m the mass. A body of positive density has P > 0. Conversely,
every P > 0 belongs to such a body (Traversaro, Brossette, Escande, Nori, IROS 2016; Wensing, Kim, Slotine, RA-L 3, 2018). P is
linear in the parameters. In another frame it is G P G', with the homogeneous transform G of the frame.
"""

from __future__ import annotations

import numpy as np

#: Derivative of P with respect to each parameter, in pinocchio's order m, mx, my, mz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz; (10, 4, 4).
BASIS = np.zeros((10, 4, 4))
BASIS[0, 3, 3] = 1.0
for _i in range(3):
    BASIS[1 + _i, _i, 3] = BASIS[1 + _i, 3, _i] = 1.0
for _row, (_i, _j) in enumerate(((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)), 4):
    if _i == _j:
        BASIS[_row, :3, :3] = 0.5 * np.eye(3)
        BASIS[_row, _i, _i] = -0.5
    else:
        BASIS[_row, _i, _j] = BASIS[_row, _j, _i] = -1.0


def pseudo_inertia(parameters: np.ndarray) -> np.ndarray:
    """Return the matrix P of every body, (..., 4, 4).

    Args:
        parameters: m, mx, my, mz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz of each body [kg, kg.m, kg.m^2], (..., 10).
    """
    return np.tensordot(parameters, BASIS, axes=1)


def of_pseudo_inertia(matrix: np.ndarray) -> np.ndarray:
    """Return the ten parameters of a body from its matrix P, (10,)."""
    S = matrix[:3, :3]
    inertia = np.trace(S) * np.eye(3) - S
    rows, columns = (0, 0, 1, 0, 1, 2), (0, 1, 1, 2, 2, 2)
    return np.array([matrix[3, 3], *matrix[:3, 3], *inertia[rows, columns]])


def frame_change(placement: np.ndarray) -> np.ndarray:
    """Return the matrix that converts a body's parameters from one frame to another, (10, 10).

    Args:
        placement: homogeneous transform of the body's frame in the other one, (4, 4).
    """
    return np.column_stack([of_pseudo_inertia(placement @ basis @ placement.T) for basis in BASIS])


def about_center(parameters: np.ndarray) -> np.ndarray:
    """Return the inertia about the body's center of mass [kg.m^2], (3, 3).

    Args:
        parameters: ten parameters of a body with nonzero mass.
    """
    P = pseudo_inertia(parameters)
    h, m = P[:3, 3], P[3, 3]
    S = P[:3, :3] - np.outer(h, h) / m
    return np.trace(S) * np.eye(3) - S
