"""Friction as a function of temperature, measured or virtual, from the log of a warm-up.

    tau_f(v, theta) = F(v) + theta G(v),    theta' = (P - theta) / T_th,    P = tau_f v

A joint warms by the heat of its friction: C dTheta/dt = eta P - h (Theta - ambient). The rise of temperature is therefore
eta/h times the friction's power P, low-passed with the time constant T_th = C/h. Without a sensor, eta/h cannot be separated
from the friction's sensitivity: twice the warming with half the sensitivity gives the same torques. The virtual temperature
theta is that low-passed power [W], and only T_th and the product G are identified. With a sensor, theta is its reading minus
a reference [degC]. To first order in theta, the friction at every knot of the curve is a straight line over theta.

For a given T_th the model is linear: T_th is found by a search, all other parameters by regression (variable projection:
Golub & Pereyra, SIAM J. Numer. Anal. 10, 1973). Virtual temperature in place of a sensor: Simoni, Beschi, Legnani, Visioli
(Robotica, 2018).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.identification import regression
from backdrive.identification.curves import basis
from backdrive.identification.drift.change import chance
from backdrive.identification.signals import Signals, prepare
from backdrive.laws import Law, Polyline
from backdrive.logs.log import Log

BIN = 0.05  # length of the bins over which samples are averaged [s]
SLOW = 0.03  # share of the top speed that every sample of a bin must exceed [-]
BLOCKS = 40  # number of blocks of time whose scores are taken as independent
LEAST_RISE = 2.0  # least span of a sensor's temperature [degC]
SURE = 0.01  # largest probability of a change with temperature by chance [-]
GRID = 24  # number of time constants on the grid
ROUNDS = 2  # number of iterations, in each of which the power follows from the last curve


@dataclass(frozen=True, kw_only=True, eq=False)
class Thermal:
    """A friction curve that depends on temperature.

    Attributes:
        velocity: knots [rad/s or m/s], (K,).
        cold: friction at the knots at theta = 0 [N.m or N], (K,).
        slope: G, derivative of the friction with respect to theta [N.m/degC or N/degC; virtual: N.m/W or N/W], (K,).
        covariance: of cold and slope together, (2 K, 2 K).
        time_constant: T_th of a virtual temperature and its standard error [s]; NaN with a sensor.
        reference: temperature at theta = 0 [degC]; NaN for a virtual one, which starts at 0.
        reached: range of theta in the log [degC or W].
        explained: share of the residual without temperature that the temperature explains [-].
        rms: root mean square of the residual [N.m or N].
    """

    velocity: np.ndarray
    cold: np.ndarray
    slope: np.ndarray
    covariance: np.ndarray
    time_constant: tuple[float, float]
    reference: float
    reached: tuple[float, float]
    explained: float
    rms: float

    @property
    def virtual(self) -> bool:
        """Whether theta is low-passed friction power [W] instead of a sensor's reading."""
        return bool(np.isnan(self.reference))

    def law(self, theta: float = 0.0) -> Law:
        """Return the curve at a temperature.

        Args:
            theta: reading minus `reference` [degC]; virtual: low-passed power [W].

        Raises:
            InvalidInput: friction would be negative there.
        """
        F = self.cold + theta * self.slope
        if not np.all(F > 0):
            raise InvalidInput(
                f"At theta = {theta:g} the curve's straight lines reach below zero.",
                remedy=f"The log covered {self.reached[0]:.3g} to {self.reached[1]:.3g}.",
            )
        return Law(rate=Polyline(velocity=tuple(self.velocity), positive=tuple(F), negative=tuple(F)))

    def error(self, theta: float = 0.0) -> np.ndarray:
        """Return standard errors of the knots at a temperature [N.m or N], (K,).

        Args:
            theta: as in `law`.
        """
        K = self.velocity.size
        one = np.hstack([np.eye(K), theta * np.eye(K)])
        return np.sqrt(np.maximum(np.diag(one @ self.covariance @ one.T), 0.0))


def virtual_temperature(power: np.ndarray, interval: float, time_constant: float) -> np.ndarray:
    """Return the virtual temperature of a joint that starts at ambient temperature [W], (n,).

    Exact for a power that is constant within each interval.

    Args:
        power: of the friction, tau_f v [W], (n,).
        interval: sampling interval of the power [s].
        time_constant: T_th [s].
    """
    from scipy.signal import lfilter

    a = float(np.exp(-interval / time_constant))
    return np.asarray(lfilter([0.0, 1.0 - a], [1.0, -a], power))


def identify_thermal(
    log: Log, joint: str | int = 0, *, knots: Sequence[float] | None = None, virtual: bool | None = None
) -> Thermal:
    """Identify the dependence of a joint's friction on temperature, from the log of a warm-up that starts cold.

    Args:
        log: with torque and motion at several speeds, repeated while the joint warms.
        joint: name or column.
        knots: speeds of the curve [rad/s or m/s]; None: five shares of the top speed.
        virtual: use the low-passed friction power as temperature; None: only if the log has no temperature.

    Raises:
        NotIdentifiable: the temperature hardly changes, friction does not depend on it significantly, or a log without
            temperature has gaps.
        InvalidInput: the log holds no temperature, or the knots are not increasing speeds above zero.
    """
    from scipy.optimize import minimize_scalar

    stretches = prepare(log, joint)
    measured = all(s.temperature is not None for s in stretches)
    if virtual is None:
        virtual = not measured
    if not virtual and not measured:
        raise InvalidInput("The log holds no temperature.", remedy="Map it, or ask for a virtual one.")
    if len(stretches) > 1 and virtual:
        raise NotIdentifiable(
            f"The log has {len(stretches) - 1} gaps, in which the cooling of the joint is unknown.",
            remedy="Record the warm-up without gaps, or with a temperature.",
        )
    parts = [_bin(s) for s in stretches]
    v, a, q, tau, temperature = (np.concatenate([p[i] for p in parts]) for i in range(5))
    top = float(np.percentile(np.abs(v), 99.5))
    V = np.array(knots, dtype=float) if knots is not None else top * np.array([0.05, 0.2, 0.4, 0.7, 1.0])
    if V.ndim != 1 or V.size < 1 or not np.all(np.isfinite(V)) or np.any(np.diff(V) <= 0) or V[0] <= 0:
        raise InvalidInput(f"knots = {V.tolist()}.", remedy="Give increasing speeds above zero.")
    shape = basis(v, V)
    shape = shape[:, : V.size] + shape[:, V.size :]
    fast = np.concatenate([p[5] for p in parts]) > SLOW * top  # bins with a reversal are left out
    rest = np.column_stack([a, np.ones_like(v), np.sin(q), np.cos(q)])
    weight = fast.astype(float)
    if not virtual:
        reference = float(temperature[0])
        theta = temperature - reference
        return _solve(shape, rest, theta, tau, weight, V, (float("nan"), float("nan")), reference)
    interval = _width(stretches[0]) / stretches[0].rate
    plain = _least_squares(np.hstack([shape, rest]), tau, weight)
    power = (shape @ plain[: V.size]) * v
    length = interval * v.size
    best = float("nan")

    def cost(logarithm: float) -> float:
        theta = virtual_temperature(power, interval, float(np.exp(logarithm)))
        X = np.hstack([shape, theta[:, None] * shape, rest])
        return float(weight @ (tau - X @ _least_squares(X, tau, weight)) ** 2)

    for _ in range(ROUNDS):
        grid = np.log(np.geomspace(length / 100.0, 3.0 * length, GRID))
        i = int(np.clip(np.argmin([cost(x) for x in grid]), 1, GRID - 2))
        found: Any = minimize_scalar(
            cost, bounds=grid[[i - 1, i + 1]], method="bounded", options={"xatol": 1e-6}
        )
        best = float(np.exp(found.x))
        theta = virtual_temperature(power, interval, best)
        curve = _least_squares(np.hstack([shape, theta[:, None] * shape, rest]), tau, weight)
        power = (shape @ curve[: V.size] + theta * (shape @ curve[V.size : 2 * V.size])) * v
    theta = virtual_temperature(power, interval, best)
    error = _time_error(shape, rest, power, interval, best, tau, weight)
    return _solve(shape, rest, theta, tau, weight, V, (best, error), float("nan"))


def _width(s: Signals) -> int:
    """Return the number of samples per bin."""
    return max(1, round(BIN * s.rate))


def _bin(s: Signals) -> list[np.ndarray]:
    width = _width(s)
    count = s.time.size // width
    position = np.zeros_like(s.time) if s.position is None else s.position
    temperature = np.zeros_like(s.time) if s.temperature is None else s.temperature
    columns = (s.velocity, s.acceleration, position, s.torque, temperature)
    bins = [c[: width * count].reshape(count, width) for c in columns]
    least = np.where(np.ptp(np.sign(bins[0]), axis=1) > 0, 0.0, np.abs(bins[0]).min(axis=1))
    return [*(b.mean(axis=1) for b in bins), least]


def _least_squares(X: np.ndarray, y: np.ndarray, w: np.ndarray) -> np.ndarray:
    return regression.solve(X.T @ (w[:, None] * X), X.T @ (w * y))


def _sandwich(X: np.ndarray, tau: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    blocks = regression.accumulate(X, tau, weight, regression.block_index(tau.size, BLOCKS), BLOCKS)
    theta = blocks.solution()
    return theta, regression.sandwich(blocks, theta)


def _time_error(shape, rest, power, interval, T, tau, weight) -> float:
    """Return the standard error of the time constant, with all other parameters refitted [s]."""
    K, step = shape.shape[1], 1e-3 * T
    theta = virtual_temperature(power, interval, T)
    X = np.hstack([shape, theta[:, None] * shape, rest])
    found = _least_squares(X, tau, weight)
    moved = virtual_temperature(power, interval, T + step) - virtual_temperature(power, interval, T - step)
    X = np.column_stack([X, (shape @ found[K : 2 * K]) * moved / (2.0 * step)])
    return float(np.sqrt(max(_sandwich(X, tau, weight)[1][-1, -1], 0.0)))


def _solve(shape, rest, theta, tau, weight, V, time_constant, reference) -> Thermal:
    K = V.size
    span = float(theta.min()), float(theta.max())
    if np.isfinite(reference) and not np.ptp(theta) > LEAST_RISE:
        raise NotIdentifiable(
            f"The temperature changes by {np.ptp(theta):.2g} degC in this log.",
            remedy="Begin with a cold joint, and record until it is warm.",
        )
    X = np.hstack([shape, theta[:, None] * shape, rest])
    found, covariance = _sandwich(X, tau, weight)
    slope, spread = found[K : 2 * K], covariance[K : 2 * K, K : 2 * K]
    if not chance(float(slope @ np.linalg.pinv(spread, rcond=1e-10) @ slope), K) < SURE:
        raise NotIdentifiable(
            "In this log, friction does not change significantly with temperature.",
            remedy="Begin with a cold joint, and record until it is warm.",
        )
    left = weight * (tau - X @ found)
    plain = np.hstack([shape, rest])
    before = weight * (tau - plain @ _least_squares(plain, tau, weight))
    return Thermal(
        velocity=V,
        cold=found[:K],
        slope=slope,
        covariance=covariance[: 2 * K, : 2 * K],
        time_constant=time_constant,
        reference=reference,
        reached=span,
        explained=float(1.0 - (left @ left) / max(before @ before, 1e-300)),
        rms=float(np.sqrt(left @ left / max(weight.sum(), 1.0))),
    )
