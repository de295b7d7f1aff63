"""The search of a fit through zero crossings: least squares of whitened samples, without what rounding adds to their products."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from backdrive.identification.crossing_noise import PROBES, Noise, Whitener, huber_sum, noise_of, slide
from backdrive.identification.noise import rare
from backdrive.identification.zero_crossing import LONGEST, REACH, Course, Kind, Passage, stencil

SPEEDS = (1e-3, 3e-3, 1e-2, 3e-2)  # widths of a crossing by speed that are tried [top speed]
BENDS = (1e-5, 3e-5, 1e-4, 3e-4, 1e-3)  # and of one by displacement [travel]
DELAYS = (-2.0, -1.0, 0.0, 1.0, 2.0)  # delays that are tried, by their spacing
SPACING = 0.1, 0.4  # least and largest spacing [sample]
BEST = 2  # number of the tried courses that are fitted for a round
ROUNDS, STEPS = 6, 4  # rounds, each with weights of its own, and Gauss-Newton steps in one
NUDGE = np.array(
    [0.02, 0.02, 0.01]
)  # of delay [sample], logarithm of the width, and elastic share for derivatives
LEAP = np.array([0.3, 0.4, 0.1])  # largest step of them
ELASTIC = 0.02, 0.95  # limits of the elastic share [-]
DAMPING = (1e-9, 1e-4, 1e-3, 1e-2, 0.1, 1.0)  # of a step, relative to a column, until the cost is lower
DONE = 0.02  # gain of a step below which a round ends [half a squared standard deviation]
DIAGONALS = 7  # number of the weights' diagonals over which a second difference reaches
FAST = ("inertia", "delay")  # told by fast changes


@dataclass(frozen=True, kw_only=True, eq=False)
class Estimate:
    """Numbers with their covariance.

    Attributes:
        names: `coulomb`, terms of `zero_crossing.TERMS`, `inertia`, `delay`.
        values: [SI], (p,).
        covariance: (p, p).
    """

    names: tuple[str, ...]
    values: np.ndarray
    covariance: np.ndarray

    def of(self, name: str) -> tuple[float, float]:
        """Return a number and its standard error."""
        k = self.names.index(name)
        return float(self.values[k]), float(np.sqrt(max(self.covariance[k, k], 0.0)))

    @property
    def errors(self) -> np.ndarray:
        """Standard errors, (p,)."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Weights:
    """Whiteners of all stretches, and the diagonals of the weights."""

    whiteners: list[Whitener]
    unsure: list[np.ndarray]
    diagonals: np.ndarray


@dataclass(frozen=True, kw_only=True, eq=False)
class _State:
    """A solution: linear coefficients at a point of delay [sample], logarithm of the width, and elastic share."""

    point: np.ndarray
    theta: np.ndarray
    cost: float
    X: np.ndarray
    A: np.ndarray
    residual: np.ndarray


class CrossingFit:
    """A fit with one kind of course.

    Args:
        passages: stretches.
        kind: of the course.
        noise: standard deviation of a position [rad or m].
        first: fit without the reversals.
        begin: about the noise of the torque.
    """

    def __init__(self, passages: Sequence[Passage], kind: Kind, noise: float, first: Estimate, begin: Noise):
        self.passages, self.noise, self.first = passages, noise, first
        self.kind: Kind = kind
        self.rate, self.about = passages[0].rate, begin
        self.inertia, self.coulomb = first.of("inertia")[0], first.of("coulomb")[0]
        self.y = np.concatenate([p.torque[p.rows] for p in passages])
        self.size = 2 if kind == "speed" else 3
        tried = [(self._unlikely_at(p), k, p) for k, p in enumerate(self._points())]
        #: How unlikely the log is with each course and delay that is tried, its number, and its point; the likeliest first.
        self.starts = sorted(tried, key=lambda start: start[:2])

    def search(self) -> CrossingFit:
        """Return the fit after all rounds, begun at the most likely of the courses and delays that are tried.

        Raises:
            LinAlgError: the noise cannot be made white.
        """
        begin, tried = (self.about, self.inertia, self.coulomb), []
        for _, k, point in self.starts[:BEST]:
            self.about, self.inertia, self.coulomb = begin
            self._rounds(point, 2)
            tried.append((self.unlikely, k, self.state.point, (self.about, self.inertia, self.coulomb)))
        _, _, point, (self.about, self.inertia, self.coulomb) = min(tried, key=lambda t: t[:2])
        self._rounds(point, ROUNDS)
        return self

    def _points(self) -> list[np.ndarray]:
        late, error = (x * self.rate for x in self.first.of("delay"))
        spacing = float(np.clip(error, *SPACING))
        if self.kind == "speed":
            top = max(float(np.abs(p.motion(late / self.rate).velocity).max()) for p in self.passages)
            shapes = [[np.log(share * top)] for share in SPEEDS]
        else:
            travel = max(float(np.ptp(p.measured)) for p in self.passages)
            shapes = [[np.log(share * travel), 0.6] for share in BENDS]
        return [np.array([late + d * spacing, *shape]) for shape in shapes for d in DELAYS]

    def _course(self, point: np.ndarray) -> tuple[float, Course]:
        elastic = float(point[2]) if self.size > 2 else 0.0
        return float(point[0] / self.rate), Course(
            kind=self.kind, width=float(np.exp(point[1])), elastic=elastic
        )

    def _columns(self, point: np.ndarray) -> np.ndarray:
        return np.vstack([p.columns(*self._course(point)) for p in self.passages])

    def _unsure(self, point: np.ndarray) -> list[np.ndarray]:
        return [p.unsure(*self._course(point), self.coulomb, self.inertia) for p in self.passages]

    def _whiteners(self, point: np.ndarray, unsure: Sequence[np.ndarray]) -> list[Whitener]:
        # of whole samples, where rounding is largest: between two samples it is smaller, and weights of that would draw a fit there
        rounding, delay = self.inertia * self.noise, float(np.round(point[0])) / self.rate
        return [
            Whitener(p, self.about, rounding, delay, more)
            for p, more in zip(self.passages, unsure, strict=True)
        ]

    def _weights(self, point: np.ndarray, rng: np.random.Generator) -> _Weights:
        unsure = self._unsure(point)
        whiteners = self._whiteners(point, unsure)
        each = [w.diagonals(more.size, DIAGONALS, rng) for w, more in zip(whiteners, unsure, strict=True)]
        return _Weights(whiteners=whiteners, unsure=unsure, diagonals=np.sum(each, axis=0))

    def _white(self, whiteners: Sequence[Whitener], X: np.ndarray) -> np.ndarray:
        ends = np.cumsum([p.torque[p.rows].size for p in self.passages])[:-1]
        return np.vstack([w(part) for w, part in zip(whiteners, np.split(X, ends), strict=True)])

    def _unlikely_at(self, point: np.ndarray) -> float:
        """Return how unlikely the log is with a course, with the inertia held."""
        whiteners = self._whiteners(point, self._unsure(point))
        X = self._columns(point)
        white = self._white(whiteners, np.column_stack([X[:, :-1], self.y - self.inertia * X[:, -1]]))
        A, b = white[:, :-1], white[:, -1]
        theta = np.linalg.lstsq(A.T @ A, A.T @ b, rcond=1e-12)[0]
        return huber_sum(b - A @ theta) + sum(w.beside_rounding for w in whiteners)

    def _product(self, one: np.ndarray, other: np.ndarray, weights: _Weights) -> float:
        """Return the weighted product of two errors of rounding that stencils make of the positions."""
        c, middle = np.correlate(one, other, "full"), one.size - 1
        sides = [c[middle + k] + (c[middle - k] if k else 0.0) for k in range(DIAGONALS)]
        return float(np.dot(sides, weights.diagonals)) * (self.noise * self.rate**2) ** 2

    def _solve(self, point: np.ndarray, weights: _Weights) -> _State:
        """Return the linear coefficients at a point, and the cost without what rounding adds to it."""
        X = self._columns(point)
        white = self._white(weights.whiteners, np.column_stack([X, self.y]))
        A, b = white[:, :-1], white[:, -1]
        bend = stencil(float(point[0]))
        false = self._product(bend, bend, weights)
        gram = A.T @ A
        size = np.sqrt(np.diag(gram))
        gram[-1, -1] -= false
        theta = np.linalg.lstsq(gram / np.outer(size, size), A.T @ b / size, rcond=1e-12)[0] / size
        residual = b - A @ theta
        cost = float(residual @ residual) - theta[-1] ** 2 * false
        return _State(point=point, theta=theta, cost=cost, X=X, A=A, residual=residual)

    def _normal(self, state: _State, weights: _Weights) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the normal equations of all numbers with and without rounding, and the gradient, (P, P), (P, P) and (P,)."""
        theta = state.theta
        F = np.hstack([state.A, self._white(weights.whiteners, self._changes(state.point, theta))])
        false = self._bends(state)
        gram, gradient = F.T @ F, F.T @ state.residual
        true, at = gram.copy(), (state.A.shape[1] - 1, state.A.shape[1])  # of inertia and delay
        for i, one in enumerate(false):
            for j, other in enumerate(false):
                true[at[i], at[j]] -= self._product(one, other, weights)
            gradient[at[i]] += theta[-1] * self._product(one, false[0], weights)
        return gram, true, gradient

    def _changes(self, point: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """Return the derivatives of the torque with respect to the point, (m, 2) or (m, 3)."""
        columns = []
        for i in range(self.size):
            ends = [self._inside(point + way * NUDGE[i] * np.eye(self.size)[i]) for way in (1.0, -1.0)]
            change = (self._columns(ends[0]) - self._columns(ends[1])) @ theta
            columns.append(change / (ends[0][i] - ends[1][i]))
        return np.column_stack(columns)

    def _inside(self, point: np.ndarray) -> np.ndarray:
        """Return a point with its delay and elastic share within their limits."""
        limits = np.array([(-LONGEST, LONGEST), (-np.inf, np.inf), ELASTIC])[: self.size]
        return np.clip(point, limits[:, 0], limits[:, 1])

    def _rounds(self, point: np.ndarray, rounds: int) -> None:
        """Fit from a point; the result is in `state`, `unlikely`, `gram`, `true` and `inertia`."""
        rng = np.random.default_rng(0)
        for left in range(rounds - 1, -1, -1):
            weights = self._weights(point, rng)
            state = self._solve(point, weights)
            for _ in range(STEPS):
                self.gram, self.true, gradient = self._normal(state, weights)
                after = self._step(state, gradient, weights)
                if after is None:
                    break
                gain, state = state.cost - after.cost, after
                if gain < DONE:
                    break
            point = state.point
            self.coulomb = max(float(state.theta[0]), 1e-3 * self.coulomb)
            self.inertia = max(float(state.theta[-1]), 1e-3 * self.inertia)
            self.state, self.weights = state, weights
            self.unlikely = huber_sum(state.residual) + sum(w.beside_rounding for w in weights.whiteners)
            if left:
                ends = np.cumsum([u.size for u in weights.unsure])[:-1]
                plain, columns = np.split(self.y - state.X @ state.theta, ends), np.split(state.X, ends)
                delay = self._course(point)[0]
                rounding = self.inertia * self.noise
                unsure, before = self._unsure(point), self.about
                self.about = noise_of(self.passages, plain, columns, unsure, rounding, delay, before)
                if self.about == before:
                    break

    def _step(self, state: _State, gradient: np.ndarray, weights: _Weights) -> _State | None:
        """Return the state after a Gauss-Newton step that lowers the cost; None if none does."""
        size = np.sqrt(np.diag(self.gram))
        value, vector = np.linalg.eigh(self.true / np.outer(size, size))
        along = vector.T @ (gradient / size)
        for damping in DAMPING:
            step = (vector @ (along / (np.maximum(value, 0.0) + damping))) / size
            leap = np.clip(step[-self.size :], -LEAP[: self.size], LEAP[: self.size])
            after = self._solve(self._inside(state.point + leap), weights)
            if after.cost <= state.cost:
                return after
        return None

    def _bends(self, state: _State) -> tuple[np.ndarray, np.ndarray]:
        """Return the weights of the positions' rounding in the columns of inertia and delay."""
        ends = [stencil(float(state.point[0] + way * NUDGE[0])) for way in (1.0, -1.0)]
        return stencil(float(state.point[0])), (ends[0] - ends[1]) / (2.0 * NUDGE[0]) * state.theta[-1]

    def estimate(self) -> Estimate:
        """Return the numbers with their covariance, in the order of the first fit."""
        size = np.sqrt(np.diag(self.gram))
        inverse = np.linalg.pinv(self.true / np.outer(size, size), rcond=1e-10) / np.outer(size, size)
        kept = slice(0, self.state.theta.size + 1)
        unit = np.ones(self.state.theta.size + 1)
        unit[-1] = 1.0 / self.rate
        unit = unit * self._few()[kept]
        covariance = (inverse @ self._scatter() @ inverse)[kept, kept] * np.outer(unit, unit)
        values = np.append(self.state.theta, self.state.point[0] / self.rate)
        return replace(self.first, values=values, covariance=covariance)

    def _few(self) -> np.ndarray:
        """Return factors on the standard errors, so that three of them hold what three of normal errors do, (P,).

        A variance that changes by the share s where the noise's correlation changes by its standard error has 2 / s^2 degrees of
        freedom (Satterthwaite, Biometrics Bulletin 2, 1946).
        """
        found, state, variances = self.about, self.state, []
        columns = np.hstack([state.X, self._changes(state.point, state.theta)]) / np.sqrt(np.diag(self.gram))
        false = (self.gram - self.true) / np.sqrt(np.outer(np.diag(self.gram), np.diag(self.gram)))
        error = np.sqrt((1.0 - found.correlation**2) / len(columns))
        steps = [-error, min(error, 0.5 * (1.0 - found.correlation))]
        for step in steps:
            correlation = found.correlation + step
            self.about = replace(found, correlation=correlation)
            F = self._white(self._whiteners(state.point, self.weights.unsure), columns)
            variances.append(np.maximum(np.diag(np.linalg.pinv(F.T @ F - false, rcond=1e-10)), 1e-12))
        self.about = found
        share = np.log(variances[1] / variances[0]) * error / (steps[1] - steps[0])
        return rare(2.0 / np.maximum(share**2, 1e-12))

    def _scatter(self) -> np.ndarray:
        """Return the covariance of the gradient, (P, P).

        That of the products of columns and residual counts the rounding in both as if these were independent. It is the same: with
        A = S'W S_0, what that adds is inertia^2 s^4 tr(A_i A_j) for inertia and delay, which random signs give.
        """
        rng, state = np.random.default_rng(0), self.state
        bends, total = self._bends(state), np.zeros((2, 2))
        for whitener, unsure in zip(self.weights.whiteners, self.weights.unsure, strict=True):
            signs = rng.choice([-1.0, 1.0], size=(unsure.size + 2 * REACH, PROBES))
            of_both = [whitener.times_weights(slide(bend, signs)) for bend in bends]
            wide = [np.pad(u, ((2 * REACH, 2 * REACH), (0, 0))) for u in of_both]
            back = [slide(bends[0][::-1], u) for u in wide]  # A' z
            ahead = [slide(bend[::-1], wide[0]) for bend in bends]  # A z
            total += [[np.sum(one * other) / PROBES for other in ahead] for one in back]
        scale = (state.theta[-1] * (self.noise * self.rate**2) ** 2) ** 2
        fast = slice(state.theta.size - 1, state.theta.size + 1)
        scatter = self.gram.copy()
        scatter[fast, fast] += 0.5 * scale * (total + total.T)
        return scatter
