"""Least squares for a payload and the gains of the drives, based on the model of the unloaded arm.

    tau_j = (1 + e_j) Y_j (beta + B phi) + own_j        of a log with the payload, and with phi = 0 of one without

Y_j are the base columns of the rigid bodies, and beta the base parameters of the unloaded arm. The payload's ten inertial
parameters phi, in its own frame, add B phi to them. e_j is the error of a drive's gain. `own` are the joint's other terms from
`identify`, in the drive's own unit. They may change as friction does from day to day: offset, motor inertia, level of the
curve, its sign, a viscous part, growth with the load. Without an unloaded log, beta has the covariance of the model. The gains
then scale the payload's part alone, since the model was identified with the same gains. If gains are fitted, products of
unknowns are linearized in Gauss-Newton steps; otherwise the error of the gains is propagated. Residuals are correlated:
standard errors are those of leaving out blocks (`identification.arm_errors`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from backdrive.external.payload_terms import DAY, OWN, corrections, of_the_day, own_prior
from backdrive.identification import regression, robust
from backdrive.identification.arm_errors import blocks_of, errors_of_fit
from backdrive.identification.arm_signals import ArmSignals
from backdrive.identification.arm_solve import spread_of
from backdrive.identification.arm_terms import Regressor, Rows, build, fill_load
from backdrive.identification.pseudo_inertia import about_center
from backdrive.model import ArmModel, JointFriction
from backdrive.robot import PER_LINK, Robot

ROUNDS = 8  # of Gauss and Newton's steps, reweighting and the load, at most
SETTLED = 1e-4  # change of the payload's torque relative to its noise that ends the iteration [-]
MISFIT = 1.5  # true variance relative to that of leaving out blocks: friction that follows no curve is in all blocks alike [-]
WILD = 2.0  # residuals beyond so many standard deviations count less (Huber)
FREE = 1e3  # prior standard deviation of unknown quantities [kg, kg.m]
EXACT = 1e-3  # relative standard deviation of a known mass [-]; standard deviation of a known center [m]
GYRATION = 0.2  # expected radius of a payload [m]
DRIFT = 0.03  # relative standard deviation of an offset without a stated error [-]
SURE = 1e-4  # of the bodies, likewise [-]


@dataclass(frozen=True, kw_only=True, eq=False)
class PriorKnowledge:
    """Prior knowledge, independent of the logs.

    Attributes:
        gain_error: standard deviation of each drive's relative gain error [-].
        seek: whether the gains are fitted; otherwise they are fixed, with that error.
        mass: of the payload [kg]; None: nothing.
        center: of its mass in the frame [m], (3,); None: nothing.
    """

    gain_error: float
    seek: bool = False
    mass: float | None = None
    center: np.ndarray | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class PayloadFit:
    """The fitted coefficients.

    Attributes:
        payload: m, m c and inertia about the frame's origin [kg, kg.m, kg.m^2], (10,).
        gains: relative gain errors e [-], (J,).
        covariance: of payload and gains, (10 + J, 10 + J).
        of_data: covariance of the payload if the gains were exact, (10, 10).
        told: share of the prior variance of the payload's inertia that the data removed [-], (6,).
        lever: torque of the payload on each joint, root mean square [N.m or N], (J,).
        residual: relative residual of the loaded log, RMS divided by the RMS torque [-], (J,).
        expected: the same of the model on its own data, if known [-], (J,).
    """

    payload: np.ndarray
    gains: np.ndarray
    covariance: np.ndarray
    of_data: np.ndarray
    told: np.ndarray
    lever: np.ndarray
    residual: np.ndarray
    expected: np.ndarray


@dataclass(eq=False)
class PayloadProblem:
    """Rows of the loaded log, and of the unloaded one where there is one, prepared once for several fits."""

    robot: Robot
    arm: ArmModel
    frictions: Sequence[JointFriction]
    adds: np.ndarray  # B, (b, 10)
    loaded: Sequence[ArmSignals]
    unloaded: Sequence[ArmSignals]

    def __post_init__(self):
        self.terms = [corrections(friction) for friction in self.frictions]
        self.both = bool(self.unloaded)
        self.width = OWN + (DAY if self.both else 0)
        self._sources = [Regressor(self.robot, s) for s in (self.loaded, self.unloaded) if s]
        self._rows = [build(source, self.terms) for source in self._sources]
        self.beta = self.robot.base.relation @ np.array(self.arm.parameters)
        whole = self.beta.size + len(self.frictions)
        stated = self.arm.covariance
        self.stated = np.array(stated) if stated is not None and len(stated) == whole else None
        self.rows = sum(int(np.count_nonzero(rows.weight)) for rows in self._rows[:1])

    def fit(self, known: PriorKnowledge) -> PayloadFit:
        """Return payload and gains."""
        return self._result(known, *self._solve(known))

    def shares_without_load(self) -> np.ndarray | None:
        """Return the share of each joint's torque in the unloaded log that the model explains [-], (J,), or None."""
        if not self.both:
            return None
        rows = self._rows[1]
        x = self._start(PriorKnowledge(gain_error=1.0))[0]
        fill_load(rows, self._sources[1], self.terms, x[: self.beta.size])
        left = rows.torque - self._predict(rows, x, False)
        return np.array([1.0 - _share(left, rows, j) ** 2 for j in range(len(self.terms))])

    def _level(self, J: int) -> np.ndarray:
        """Return where base parameters and offsets stand among the coefficients, (b + J,)."""
        b = self.beta.size
        return np.r_[:b, b + PER_LINK + J + self.width * np.arange(J)]

    def _solve(self, known: PriorKnowledge) -> tuple:
        """Return coefficients, normal equations by block, precision and gradient of the priors, and residuals."""
        J, b = len(self.terms), self.beta.size
        phi, gain = slice(b, b + PER_LINK), slice(b + PER_LINK, b + PER_LINK + J)
        x, inverse = self._start(known)
        mean, precision = x.copy(), np.zeros((x.size, x.size))
        if known.mass is not None:
            x[phi] = mean[phi]
        noise = np.array([self._scale(j) for j in range(J)])
        gram = inverse
        last = np.full(J, np.inf)
        weights, errors = [], []
        for _ in range(ROUNDS):
            self._refill(x, phi)
            mean[phi], spread = _payload_prior(x[phi], known)
            precision = inverse.copy()
            precision[phi, phi] = np.diag(spread**-2.0)
            predicted = [self._predict(rows, x, loaded) for rows, loaded in self._parts()]
            errors = [rows.torque - p for (rows, _), p in zip(self._parts(), predicted, strict=True)]
            noise = np.array([self._noise(errors, j, noise[j]) for j in range(J)])
            weights = [
                rows.weight * robust.huber_weights(e, WILD * noise) / noise**2
                for (rows, _), e in zip(self._parts(), errors, strict=True)
            ]
            gram, moment = precision, precision @ (mean - x)
            for (rows, loaded), w, e in zip(self._parts(), weights, errors, strict=True):
                for j in range(J):
                    X = self._slopes(rows, x, loaded, j)
                    gram = gram + (X * w[:, j, None]).T @ X
                    moment = moment + X.T @ (w[:, j] * e[:, j])
            if known.seek:
                x = x + regression.solve(gram, moment)
            else:
                free = np.r_[: gain.start, gain.stop : x.size]
                x[free] += regression.solve(gram[np.ix_(free, free)], moment[free])
            lever = self._lever(x[phi])
            if np.all(np.abs(lever - last) < SETTLED * noise):
                break
            last = lever
        blocks = self._blocks(x, weights, errors)
        return x, blocks, precision, precision @ (mean - x), errors

    def _result(
        self,
        known: PriorKnowledge,
        x: np.ndarray,
        blocks: regression.Blocks,
        precision: np.ndarray,
        pull: np.ndarray,
        errors: Sequence[np.ndarray],
    ) -> PayloadFit:
        J, b = len(self.terms), self.beta.size
        phi, gain = np.arange(b, b + PER_LINK), np.arange(b + PER_LINK, b + PER_LINK + J)
        fixed = np.setdiff1d(np.arange(x.size), gain)
        gram = blocks.gram.sum(axis=0) + precision
        exact = _covariance(blocks, precision, pull, fixed)
        covariance = exact.copy()
        if known.seek:
            covariance = _covariance(blocks, precision, pull, np.arange(x.size))
        if not known.seek:  # effect of an error of the gains on all other coefficients
            follow = np.zeros((x.size, J))
            follow[fixed] = -regression.invert(gram[np.ix_(fixed, fixed)], 1e-15) @ gram[np.ix_(fixed, gain)]
            follow[gain] = np.eye(J)
            covariance += known.gain_error**2 * follow @ follow.T
        both = np.r_[phi, gain]
        _, spread = _payload_prior(x[phi], known)
        return PayloadFit(
            payload=x[phi],
            gains=x[gain],
            covariance=covariance[np.ix_(both, both)],
            of_data=exact[np.ix_(phi, phi)],
            told=1.0 - np.diag(exact)[phi][4:] / spread[4:] ** 2,
            lever=self._lever(x[phi]),
            residual=np.array([_share(errors[0], self._rows[0], j) for j in range(J)]),
            expected=np.array([_relative_error(friction) for friction in self.frictions]),
        )

    def _parts(self) -> list[tuple[Rows, bool]]:
        return list(zip(self._rows, (True, False), strict=False))

    def _start(self, known: PriorKnowledge) -> tuple[np.ndarray, np.ndarray]:
        """Return the prior mean of all coefficients and its precision; the payload's prior is added in every round."""
        J, b = len(self.terms), self.beta.size
        x = np.zeros(b + PER_LINK + J + self.width * J)
        inverse = np.zeros((x.size, x.size))
        x[:b] = self.beta
        relation = self.robot.base.relation
        gains = np.arange(b + PER_LINK, b + PER_LINK + J)
        level = np.arange(b)
        if self.both:
            wide = (relation * spread_of(self.robot) ** 2) @ relation.T
        elif self.stated is not None:
            wide, level = MISFIT * self.stated, self._level(J)
        else:
            wide = (relation * (SURE * spread_of(self.robot)) ** 2) @ relation.T
        inverse[np.ix_(level, level)] = np.linalg.inv(wide)
        inverse[gains, gains] = max(known.gain_error, 1e-6) ** -2.0
        for j, friction in enumerate(self.frictions):
            own = np.arange(self.width) + b + PER_LINK + J + self.width * j
            x[own], spread = own_prior(friction, self.both)
            if not self.both:  # the model contains the offset's standard error
                spread[0] = FREE if self.stated is not None else DRIFT * spread[0]
            inverse[own, own] += spread**-2.0
        mass = known.mass or 1.0
        center = np.zeros(3) if known.center is None else known.center
        x[b], x[b + 1 : b + 4] = mass, mass * center
        return x, inverse

    def _body(self, x: np.ndarray, loaded: bool) -> np.ndarray:
        b = self.beta.size
        return self.adds @ x[b : b + PER_LINK] if loaded else np.zeros(b)

    def _gain(self, x: np.ndarray) -> np.ndarray:
        b = self.beta.size + PER_LINK
        return x[b : b + len(self.terms)]

    def _predict(self, rows: Rows, x: np.ndarray, loaded: bool) -> np.ndarray:
        b, J, added = self.beta.size, len(self.terms), self._body(x, loaded)
        scaled = rows.bodies @ (x[:b] + added if self.both else added)
        torque = rows.bodies @ (x[:b] + added) + self._gain(x) * scaled
        for j in range(J):
            own = b + PER_LINK + J + self.width * j
            torque[:, j] += self._own(rows, loaded, j) @ x[own : own + self.width]
        return torque

    def _slopes(self, rows: Rows, x: np.ndarray, loaded: bool, j: int) -> np.ndarray:
        """Return the derivatives of one joint's torque by all coefficients, (N, p)."""
        b, J, added = self.beta.size, len(self.terms), self._body(x, loaded)
        gain, Y = 1.0 + self._gain(x)[j], rows.bodies[:, j]
        X = np.zeros((len(Y), x.size))
        X[:, :b] = gain * Y if self.both else Y
        if loaded:
            X[:, b : b + PER_LINK] = gain * (Y @ self.adds)
        X[:, b + PER_LINK + j] = Y @ (x[:b] + added if self.both else added)
        own = b + PER_LINK + J + self.width * j
        X[:, own : own + self.width] = self._own(rows, loaded, j)
        return X

    def _own(self, rows: Rows, loaded: bool, j: int) -> np.ndarray:
        """Return the columns of a joint beside the bodies, (N, 6), or (N, 8) where an unloaded log is there."""
        return of_the_day(rows.friction[j], loaded) if self.both else rows.friction[j]

    def _refill(self, x: np.ndarray, phi: slice) -> None:
        for source, (rows, loaded) in zip(self._sources, self._parts(), strict=True):
            fill_load(rows, source, self.terms, x[: self.beta.size] + self._body(x, loaded))

    def _lever(self, payload: np.ndarray) -> np.ndarray:
        return np.sqrt(np.mean((self._rows[0].bodies @ (self.adds @ payload)) ** 2, axis=0))

    def _scale(self, j: int) -> float:
        return float(np.sqrt(np.mean(self._rows[0].torque[:, j] ** 2))) or 1.0

    def _noise(self, errors: Sequence[np.ndarray], j: int, before: float) -> float:
        error = np.concatenate([e[:, j] for e in errors])
        weight = np.concatenate([rows.weight[:, j] for rows in self._rows])
        if not np.any(weight > 0):
            return before
        return max(robust.robust_spread(error, weight), 1e-6 * self._scale(j))

    def _blocks(
        self, x: np.ndarray, weights: Sequence[np.ndarray], errors: Sequence[np.ndarray]
    ) -> regression.Blocks:
        """Return the normal equations of the step away from `x` by block of time, of all joints together."""
        grams, moments, counts = [], [], []
        for (rows, loaded), w, e in zip(self._parts(), weights, errors, strict=True):
            block = blocks_of(len(e), rows.rate)
            gram = np.zeros((block[-1] + 1, x.size, x.size))
            moment = np.zeros((block[-1] + 1, x.size))
            edges = np.searchsorted(block, np.arange(block[-1] + 2))
            for j in range(len(self.terms)):
                X = self._slopes(rows, x, loaded, j)
                for k in range(block[-1] + 1):
                    part = slice(edges[k], edges[k + 1])
                    weighted = X[part] * w[part, j, None]
                    gram[k] += weighted.T @ X[part]
                    moment[k] += weighted.T @ e[part, j]
            grams.append(gram)
            moments.append(moment)
            counts.append(np.bincount(block, weights=np.count_nonzero(w > 0, axis=1)))
        gram, moment, count = (np.concatenate(part) for part in (grams, moments, counts))
        return regression.Blocks(gram=gram, moment=moment, power=np.zeros(count.size), rows=count)


def _covariance(
    blocks: regression.Blocks, precision: np.ndarray, pull: np.ndarray, kept: np.ndarray
) -> np.ndarray:
    """Return the covariance of the kept coefficients, the others fixed, zero for these, (p, p)."""
    pick, covariance = np.ix_(kept, kept), np.zeros_like(precision)
    some = regression.Blocks(
        gram=blocks.gram[:, kept][:, :, kept],
        moment=blocks.moment[:, kept],
        power=blocks.power,
        rows=blocks.rows,
    )
    every = np.ones(kept.size, dtype=bool)
    covariance[pick] = errors_of_fit(some, precision[pick], pull[kept], every, MISFIT).covariance
    return covariance


def _payload_prior(payload: np.ndarray, known: PriorKnowledge) -> tuple[np.ndarray, np.ndarray]:
    """Return the prior mean and standard deviation of a payload, (10,) each: a body of some size about its center."""
    mean, spread = np.zeros(PER_LINK), np.full(PER_LINK, FREE)
    mass = known.mass if known.mass is not None else max(payload[0], 0.0)
    if known.mass is not None:
        mean[0], spread[0] = mass, EXACT * mass
    if known.center is not None:
        mean[1:4], spread[1:4] = mass * known.center, EXACT * max(mass, 1e-3)
    body = np.array([mass, *payload[1:4], *np.zeros(6)])
    if mass > 0.0:
        inertia = -about_center(body)
        mean[4:] = inertia[(0, 0, 1, 0, 1, 2), (0, 1, 1, 2, 2, 2)]
    spread[4:] = GYRATION**2 * mass + 1e-4
    return mean, spread


def _share(error: np.ndarray, rows: Rows, j: int) -> float:
    used = rows.weight[:, j] > 0
    power = float(np.sum(rows.torque[used, j] ** 2))
    return float(np.sqrt(np.sum(error[used, j] ** 2) / power)) if power > 0 else 0.0


def _relative_error(friction: JointFriction) -> float:
    quality = friction.held_out or friction.fitted
    return np.nan if quality is None else 0.01 * quality.residual
