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


@njit(error_model="numpy")
def _cross(a, b, out):
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@njit(error_model="numpy")
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(error_model="numpy")
def _turn(R, x, out):
    for i in range(3):
        out[i] = R[i, 0] * x[0] + R[i, 1] * x[1] + R[i, 2] * x[2]


@njit(error_model="numpy")
def workspace(J):
    """Return room for the terms of J bodies: rotations and inertias (2 J, 3, 3), vectors (13 J, 3), and a few rows."""
    return np.zeros((3 * J + 4, 3, 3)), np.zeros((13 * J + 12, 3))


@njit(error_model="numpy")
def kinematics(bodies, q, R, V):
    """Fill R[i] with the rotation of body i, V[i] with the place of its hinge, V[J + i] with the axis."""
    J = bodies.shape[0]
    for i in range(J):
        a, angle = bodies[i, AXIS : AXIS + 3], q[i]
        s, c = np.sin(angle), np.cos(angle)
        own = R[3 * J]
        for m in range(3):
            for n in range(3):
                own[m, n] = a[m] * a[n] * (1.0 - c) + (c if m == n else 0.0)
        own[0, 1] -= a[2] * s
        own[1, 0] += a[2] * s
        own[0, 2] += a[1] * s
        own[2, 0] -= a[1] * s
        own[1, 2] -= a[0] * s
        own[2, 1] += a[0] * s
        place = bodies[i, PLACE : PLACE + 3]
        if i == 0:
            for m in range(3):
                V[0, m] = place[m]
                V[J, m] = a[m]
                for n in range(3):
                    R[0, m, n] = own[m, n]
        else:
            before = R[i - 1]
            _turn(before, place, V[i])
            for m in range(3):
                V[i, m] += V[i - 1, m]
                for n in range(3):
                    R[i, m, n] = (
                        before[m, 0] * own[0, n] + before[m, 1] * own[1, n] + before[m, 2] * own[2, n]
                    )
            _turn(before, a, V[J + i])


@njit(error_model="numpy")
def terms(bodies, q, v, R, V, M, bias):
    """Fill M and bias = h + g. Uses R and V as room; R, V hold the kinematics afterwards."""
    J = bodies.shape[0]
    kinematics(bodies, q, R, V)
    O, Z, C, W, D, A, F, N = 0, J, 2 * J, 3 * J, 4 * J, 5 * J, 6 * J, 7 * J  # noqa: E741
    I = J  # noqa: E741  (inertias, behind the rotations)
    t, u, w = V[13 * J], V[13 * J + 1], V[13 * J + 2]
    T = R[3 * J + 1]
    for i in range(J):
        _turn(R[i], bodies[i, CENTER : CENTER + 3], V[C + i])
        for m in range(3):
            V[C + i, m] += V[O + i, m]
            for n in range(3):
                T[m, n] = 0.0
                for k in range(3):
                    T[m, n] += R[i, m, k] * bodies[i, INERTIA + 3 * k + n]
        for m in range(3):
            for n in range(3):
                R[I + i, m, n] = T[m, 0] * R[i, n, 0] + T[m, 1] * R[i, n, 1] + T[m, 2] * R[i, n, 2]
        # angular velocity W, angular acceleration D, acceleration A of the hinge, with gravity as an upward one
        if i == 0:
            for m in range(3):
                V[W, m] = v[0] * V[Z, m]
                V[D, m] = 0.0
                V[A, m] = G if m == 2 else 0.0
        else:
            _cross(V[W + i - 1], V[Z + i], t)
            for m in range(3):
                V[W + i, m] = V[W + i - 1, m] + v[i] * V[Z + i, m]
                V[D + i, m] = V[D + i - 1, m] + v[i] * t[m]
                u[m] = V[O + i, m] - V[O + i - 1, m]
            _cross(V[D + i - 1], u, t)
            _cross(V[W + i - 1], u, w)
            _cross(V[W + i - 1], w, u)
            for m in range(3):
                V[A + i, m] = V[A + i - 1, m] + t[m] + u[m]
        # force F and moment N about the center
        for m in range(3):
            u[m] = V[C + i, m] - V[O + i, m]
        _cross(V[D + i], u, t)
        _cross(V[W + i], u, w)
        _cross(V[W + i], w, u)
        for m in range(3):
            V[F + i, m] = bodies[i, MASS] * (V[A + i, m] + t[m] + u[m])
        _turn(R[I + i], V[W + i], t)
        _cross(V[W + i], t, u)
        _turn(R[I + i], V[D + i], t)
        for m in range(3):
            V[N + i, m] = t[m] + u[m]
    # moments of everything beyond, about the world's origin, and composite bodies
    f, n_, moment = V[13 * J + 3], V[13 * J + 4], V[13 * J + 5]
    center, total = V[13 * J + 6], 0.0
    whole = R[3 * J + 2]
    for m in range(3):
        f[m] = n_[m] = center[m] = 0.0
        for k in range(3):
            whole[m, k] = 0.0
    for i in range(J - 1, -1, -1):
        _cross(V[C + i], V[F + i], t)
        for m in range(3):
            f[m] += V[F + i, m]
            n_[m] += V[N + i, m] + t[m]
        _cross(V[O + i], f, t)
        for m in range(3):
            moment[m] = n_[m] - t[m]
        bias[i] = _dot(V[Z + i], moment)
        # the composite: inertia about its own center
        m_i, d = bodies[i, MASS], V[13 * J + 7]
        both = total + m_i
        share = m_i * total / both
        for m in range(3):
            d[m] = V[C + i, m] - center[m]
        square = _dot(d, d)
        for m in range(3):
            for k in range(3):
                whole[m, k] += R[I + i, m, k] + share * ((square if m == k else 0.0) - d[m] * d[k])
        for m in range(3):
            center[m] += m_i / both * d[m]
        total = both
        # one alone accelerates by one
        for m in range(3):
            u[m] = center[m] - V[O + i, m]
        _cross(V[Z + i], u, w)
        _turn(whole, V[Z + i], moment)
        for m in range(3):
            w[m] *= total
        for j in range(i + 1):
            for m in range(3):
                u[m] = center[m] - V[O + j, m]
            _cross(u, w, t)
            for m in range(3):
                t[m] += moment[m]
            M[i, j] = M[j, i] = _dot(V[Z + j], t)


@njit(error_model="numpy")
def tool_point(R, V, J, tool, out):
    """Fill `out` with the place of the tool; after `kinematics`."""
    _turn(R[J - 1], tool, out)
    for m in range(3):
        out[m] += V[J - 1, m]


@njit(error_model="numpy")
def push(R, V, J, tool, wrench, tau):
    """Fill tau with what a wrench at the tool, along the axes of the world, does to the joints: J^T w."""
    point, arm, moment = V[13 * J + 8], V[13 * J + 9], V[13 * J + 10]
    tool_point(R, V, J, tool, point)
    for i in range(J):
        for m in range(3):
            arm[m] = point[m] - V[i, m]
        _cross(arm, wrench[:3], moment)
        for m in range(3):
            moment[m] += wrench[3 + m]
        tau[i] = _dot(V[J + i], moment)


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
