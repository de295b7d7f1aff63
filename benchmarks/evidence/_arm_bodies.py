"""Rigid bodies of a chain of hinges by Newton and Euler in the axes of the world; shares nothing with the package.

    tau = M(q) a + h(q, v) + g(q),        M_ji = z_j . (n_i + (c_i - o_j) x f_i)

c_i, f_i, n_i: center, force and moment of everything that hinge i carries while it alone accelerates by one (composite bodies).
A body is a row: place of the hinge in the body before (3), its axis (3), mass, center (3), inertia about the center (9).
`against_mujoco` compares M, h + g and the Jacobian with MuJoCo's.
"""

from __future__ import annotations

import numpy as np
from numba import njit

PLACE, AXIS, MASS, CENTER, INERTIA, WIDTH = 0, 3, 6, 7, 10, 19
G = 9.81


# Vectors are rows of V, matrices of R, by number: a view of a row costs more than what is done with it.


@njit(error_model="numpy")
def _cross(V, a, b, out):
    V[out, 0] = V[a, 1] * V[b, 2] - V[a, 2] * V[b, 1]
    V[out, 1] = V[a, 2] * V[b, 0] - V[a, 0] * V[b, 2]
    V[out, 2] = V[a, 0] * V[b, 1] - V[a, 1] * V[b, 0]


@njit(error_model="numpy")
def _dot(V, a, b):
    return V[a, 0] * V[b, 0] + V[a, 1] * V[b, 1] + V[a, 2] * V[b, 2]


@njit(error_model="numpy")
def _turn(R, r, x, i, at, V, out):
    """Turn three numbers of row i of x by the matrix r into row `out` of V."""
    for m in range(3):
        V[out, m] = R[r, m, 0] * x[i, at] + R[r, m, 1] * x[i, at + 1] + R[r, m, 2] * x[i, at + 2]


@njit(error_model="numpy")
def workspace(J):
    """Return room for the terms of J bodies: rotations and inertias (2 J, 3, 3), vectors (13 J, 3), and a few rows."""
    return np.zeros((3 * J + 4, 3, 3)), np.zeros((13 * J + 12, 3))


@njit(error_model="numpy")
def kinematics(bodies, q, R, V):
    """Fill R[i] with the rotation of body i, V[i] with the place of its hinge, V[J + i] with the axis."""
    J = bodies.shape[0]
    own = 3 * J
    for i in range(J):
        s, c = np.sin(q[i]), np.cos(q[i])
        for m in range(3):
            for n in range(3):
                R[own, m, n] = bodies[i, AXIS + m] * bodies[i, AXIS + n] * (1.0 - c) + (c if m == n else 0.0)
        R[own, 0, 1] -= bodies[i, AXIS + 2] * s
        R[own, 1, 0] += bodies[i, AXIS + 2] * s
        R[own, 0, 2] += bodies[i, AXIS + 1] * s
        R[own, 2, 0] -= bodies[i, AXIS + 1] * s
        R[own, 1, 2] -= bodies[i, AXIS] * s
        R[own, 2, 1] += bodies[i, AXIS] * s
        if i == 0:
            for m in range(3):
                V[0, m] = bodies[0, PLACE + m]
                V[J, m] = bodies[0, AXIS + m]
                for n in range(3):
                    R[0, m, n] = R[own, m, n]
        else:
            _turn(R, i - 1, bodies, i, PLACE, V, i)
            for m in range(3):
                V[i, m] += V[i - 1, m]
                for n in range(3):
                    R[i, m, n] = (
                        R[i - 1, m, 0] * R[own, 0, n]
                        + R[i - 1, m, 1] * R[own, 1, n]
                        + R[i - 1, m, 2] * R[own, 2, n]
                    )
            _turn(R, i - 1, bodies, i, AXIS, V, J + i)


@njit(error_model="numpy")
def terms(bodies, q, v, R, V, M, bias):
    """Fill M and bias = h + g. Uses R and V as room; R, V hold the kinematics afterwards."""
    J = bodies.shape[0]
    kinematics(bodies, q, R, V)
    O, Z, C, W, D, A, F, N = 0, J, 2 * J, 3 * J, 4 * J, 5 * J, 6 * J, 7 * J  # noqa: E741
    I = J  # noqa: E741  (inertias, behind the rotations)
    t, u, w = 13 * J, 13 * J + 1, 13 * J + 2
    T = 3 * J + 1
    for i in range(J):
        _turn(R, i, bodies, i, CENTER, V, C + i)
        for m in range(3):
            V[C + i, m] += V[O + i, m]
            for n in range(3):
                R[T, m, n] = 0.0
                for k in range(3):
                    R[T, m, n] += R[i, m, k] * bodies[i, INERTIA + 3 * k + n]
        for m in range(3):
            for n in range(3):
                R[I + i, m, n] = R[T, m, 0] * R[i, n, 0] + R[T, m, 1] * R[i, n, 1] + R[T, m, 2] * R[i, n, 2]
        # angular velocity W, angular acceleration D, acceleration A of the hinge, with gravity as an upward one
        if i == 0:
            for m in range(3):
                V[W, m] = v[0] * V[Z, m]
                V[D, m] = 0.0
                V[A, m] = G if m == 2 else 0.0
        else:
            _cross(V, W + i - 1, Z + i, t)
            for m in range(3):
                V[W + i, m] = V[W + i - 1, m] + v[i] * V[Z + i, m]
                V[D + i, m] = V[D + i - 1, m] + v[i] * V[t, m]
                V[u, m] = V[O + i, m] - V[O + i - 1, m]
            _cross(V, D + i - 1, u, t)
            _cross(V, W + i - 1, u, w)
            _cross(V, W + i - 1, w, u)
            for m in range(3):
                V[A + i, m] = V[A + i - 1, m] + V[t, m] + V[u, m]
        # force F and moment N about the center
        for m in range(3):
            V[u, m] = V[C + i, m] - V[O + i, m]
        _cross(V, D + i, u, t)
        _cross(V, W + i, u, w)
        _cross(V, W + i, w, u)
        for m in range(3):
            V[F + i, m] = bodies[i, MASS] * (V[A + i, m] + V[t, m] + V[u, m])
        _turn(R, I + i, V, W + i, 0, V, t)
        _cross(V, W + i, t, u)
        _turn(R, I + i, V, D + i, 0, V, t)
        for m in range(3):
            V[N + i, m] = V[t, m] + V[u, m]
    # moments of everything beyond, about the world's origin, and composite bodies
    f, n_, moment = 13 * J + 3, 13 * J + 4, 13 * J + 5
    center, d, total = 13 * J + 6, 13 * J + 7, 0.0
    whole = 3 * J + 2
    for m in range(3):
        V[f, m] = V[n_, m] = V[center, m] = 0.0
        for k in range(3):
            R[whole, m, k] = 0.0
    for i in range(J - 1, -1, -1):
        _cross(V, C + i, F + i, t)
        for m in range(3):
            V[f, m] += V[F + i, m]
            V[n_, m] += V[N + i, m] + V[t, m]
        _cross(V, O + i, f, t)
        for m in range(3):
            V[moment, m] = V[n_, m] - V[t, m]
        bias[i] = _dot(V, Z + i, moment)
        # the composite: inertia about its own center
        m_i = bodies[i, MASS]
        both = total + m_i
        share = m_i * total / both
        for m in range(3):
            V[d, m] = V[C + i, m] - V[center, m]
        square = _dot(V, d, d)
        for m in range(3):
            for k in range(3):
                R[whole, m, k] += R[I + i, m, k] + share * ((square if m == k else 0.0) - V[d, m] * V[d, k])
        for m in range(3):
            V[center, m] += m_i / both * V[d, m]
        total = both
        # one alone accelerates by one
        for m in range(3):
            V[u, m] = V[center, m] - V[O + i, m]
        _cross(V, Z + i, u, w)
        _turn(R, whole, V, Z + i, 0, V, moment)
        for m in range(3):
            V[w, m] *= total
        for j in range(i + 1):
            for m in range(3):
                V[u, m] = V[center, m] - V[O + j, m]
            _cross(V, u, w, t)
            for m in range(3):
                V[t, m] += V[moment, m]
            M[i, j] = M[j, i] = _dot(V, Z + j, t)


@njit(error_model="numpy")
def tool_point(R, V, J, tool, out):
    """Fill `out` with the place of the tool; after `kinematics`."""
    for m in range(3):
        out[m] = V[J - 1, m] + (
            R[J - 1, m, 0] * tool[0] + R[J - 1, m, 1] * tool[1] + R[J - 1, m, 2] * tool[2]
        )


@njit(error_model="numpy")
def push(R, V, J, tool, wrench, tau):
    """Fill tau with what a wrench at the tool, along the axes of the world, does to the joints: J^T w."""
    arm, force, moment = 13 * J + 9, 13 * J + 8, 13 * J + 10
    last = J - 1
    for m in range(3):
        V[force, m] = wrench[m]
    for i in range(J):
        for m in range(3):
            point = (R[last, m, 0] * tool[0] + R[last, m, 1] * tool[1] + R[last, m, 2] * tool[2]) + V[last, m]
            V[arm, m] = point - V[i, m]
        _cross(V, arm, force, moment)
        for m in range(3):
            V[moment, m] += wrench[3 + m]
        tau[i] = _dot(V, J + i, moment)


@njit(error_model="numpy")
def invert(M, L, out):
    """Fill `out` with the inverse of a positive definite matrix; L is room."""
    J = M.shape[0]
    for i in range(J):
        for j in range(i + 1):
            s = M[i, j]
            for k in range(j):
                s -= L[i, k] * L[j, k]
            L[i, j] = np.sqrt(s) if i == j else s / L[j, j]
    for c in range(J):
        for i in range(J):
            s = 1.0 if i == c else 0.0
            for k in range(i):
                s -= L[i, k] * out[k, c]
            out[i, c] = s / L[i, i]
        for i in range(J - 1, -1, -1):
            s = out[i, c]
            for k in range(i + 1, J):
                s -= L[k, i] * out[k, c]
            out[i, c] = s / L[i, i]


@njit(error_model="numpy")
def factor(M, L):
    """Fill the lower triangle of L with Cholesky's factor of a positive definite matrix, its diagonal inverted."""
    for i in range(M.shape[0]):
        for j in range(i + 1):
            s = M[i, j]
            for k in range(j):
                s -= L[i, k] * L[j, k]
            L[i, j] = 1.0 / np.sqrt(s) if i == j else s * L[j, j]


@njit(error_model="numpy")
def solve(L, x):
    """Solve in place a system that `factor` has factored."""
    J = x.size
    for i in range(J):
        for k in range(i):
            x[i] -= L[i, k] * x[k]
        x[i] *= L[i, i]
    for i in range(J - 1, -1, -1):
        for k in range(i + 1, J):
            x[i] -= L[k, i] * x[k]
        x[i] *= L[i, i]


def along(bodies: np.ndarray, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return M (n, J, J) and h + g (n, J) along a motion (n, J)."""
    n, J = q.shape
    M, bias = np.zeros((n, J, J)), np.zeros((n, J))
    R, V = workspace(J)
    for k in range(n):
        terms(bodies, q[k], v[k], R, V, M[k], bias[k])
    return M, bias


def against_mujoco(bodies: np.ndarray, tool: np.ndarray, xml: str, draws: int = 50) -> float:
    """Return the largest difference of M, h + g and J^T w from MuJoCo's, whose model has a site `tool`."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(xml)
    data, J = mujoco.MjData(model), bodies.shape[0]
    rng, worst, full = np.random.default_rng(0), 0.0, np.zeros((J, J))
    linear, angular = np.zeros((3, J)), np.zeros((3, J))
    R, V = workspace(J)
    for _ in range(draws):
        q, v, w = rng.uniform(-2, 2, J), rng.uniform(-3, 3, J), rng.normal(size=6)
        M, bias, tau = np.zeros((J, J)), np.zeros(J), np.zeros(J)
        terms(bodies, q, v, R, V, M, bias)
        push(R, V, J, tool, w, tau)
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, full)
        mujoco.mj_jacSite(model, data, linear, angular, model.site("tool").id)
        differences = (M - full, bias - data.qfrc_bias, tau - linear.T @ w[:3] - angular.T @ w[3:])
        worst = max(worst, *(float(np.abs(x).max()) for x in differences))
    return worst
