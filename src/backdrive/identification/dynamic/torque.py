"""Torque given motion: the residuals of a law, with the other terms of the joint's dynamics and a common delay.

For a delay, the motion is shifted, since it is smooth, and not the torque, which may jump. The law is evaluated along
positions interpolated at the instants of the torque.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from backdrive.engine import Lanes, unlike
from backdrive.errors import NotIdentifiable
from backdrive.identification.delay import earlier
from backdrive.identification.dynamic.problem import Problem
from backdrive.identification.dynamic.search import SearchResult
from backdrive.identification.dynamic.stretch import Stretch, moving, with_error
from backdrive.identification.dynamic.unknowns import LawShape, Scales, Unknown
from backdrive.identification.terms import columns, unit_of
from backdrive.laws import DeadZone, Law

FEWEST = 50  # least number of samples for a fit
LONGEST_DELAY = 0.05  # longest delay of the search [s]
RESTS = 1e-3  # share of the top speed below which a joint is at rest [-]
KEPT = 1 << 17  # most samples of a stretch whose shifted motion is kept for the next prediction
DRAWS = 8  # number of random draws of the encoder's rounding error, for its part of the standard errors
# speed error of a low-passed encoder, pi sqrt(2)/3, in units of one step per sample times (bandwidth dt)^(3/2)
BLUR = 1.5
SLOW = 0.03  # share of the top speed below which a motion shows presliding and break-away [-]
#: Parameter that may be 0 -> least value that its error is compared with [scale of the parameter].
LOOSE = {"delay": 50.0, "offset": 1.0, "gravity_sin": 1.0, "gravity_cos": 1.0}


class TorqueProblem(Problem):
    """Residuals of measured torque for a law, rigid-body terms and a delay, for batches of parameter sets.

    Args:
        shape: shape of the law to fit.
        stretches: of one joint, any number.
        scales: typical sizes, which determine the ranges.
        terms: other terms of the dynamics to fit: `inertia`, `offset`, `gravity_sin`, `gravity_cos`.
        delay: fit the time by which torque was recorded later than motion.
        bounds: bounds of the user on the law's parameters, terms and delay, by name [SI].
        known: fixed terms of the dynamics, by name [SI].
        about: expected delay of the torque [s]; near its delayed reversals, samples do not count if friction jumps.
    """

    def __init__(
        self,
        shape: LawShape,
        stretches: Sequence[Stretch],
        scales: Scales,
        *,
        terms: Sequence[str] = (),
        delay: bool = False,
        bounds: Mapping[str, tuple[float, float]] | None = None,
        known: Mapping[str, float] | None = None,
        about: float = 0.0,
    ):
        self.stretches, self.terms = list(stretches), tuple(terms)
        self.known, self.about, bounds = dict(known or {}), about, dict(bounds or {})
        unknowns = shape.unknowns(scales, bounds)
        top = max(float(np.abs(s.acceleration).max()) for s in self.stretches)
        for term in self.terms:
            size = scales.force / max(top, 1e-12) if term == "inertia" else scales.force
            low, high = bounds.get(term, (0.0 if term == "inertia" else -1e3 * size, 1e3 * size))
            unknowns.append(
                Unknown(name=term, unit=unit_of(term, scales.unit), lower=low, upper=high, scale=size)
            )
        if delay:
            dt = max(s.dt for s in self.stretches)
            reach = max(LONGEST_DELAY, 2.0 * dt)
            low, high = bounds.get("delay", (-reach, reach))
            unknowns.append(Unknown(name="delay", unit="s", lower=low, upper=high, scale=dt))
        if shape.element.SET_VALUED:  # at rest its torque is undetermined
            self.stretches = [
                moving(s, max(2.0 * scales.slowest * s.dt * s.bandwidth, RESTS * scales.speed), about / s.dt)
                for s in self.stretches
            ]
        dt, band = max((s.dt, s.bandwidth) for s in self.stretches)
        self.count = scales.slowest * dt
        self.blur = max(BLUR * scales.slowest * band * dt * np.sqrt(band * dt), 1e-5 * scales.speed)
        self.regressors = [columns(s, (*self.terms, *self.known)) for s in self.stretches]
        self._moved: dict[
            tuple[int, float], tuple[np.ndarray, ...]
        ] = {}  # by stretch and delay, of the last prediction
        super().__init__(shape, unknowns)
        self.largest = max(float(np.abs(s.torque).max()) for s in self.stretches)
        if self.size < FEWEST:
            whole = sum(len(s.torque) for s in stretches)
            raise NotIdentifiable(
                f"Of {whole} samples {self.size} are left to fit {len(self.unknowns)} numbers to: rests, reversals "
                f"and held-out samples do not count.",
                remedy=f"At least {FEWEST} have to be left: record longer, better a minute of motion.",
            )

    @property
    def side_by_side(self) -> bool:
        """Whether the law has elements side by side to fit."""
        return any(name.startswith("stiffness[") for name in self.names)

    def series(self, records: Sequence[Stretch] | None = None) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return the measured torque [N.m or N] and the samples that count, (n,) each."""
        return [(s.torque, s.judged) for s in (self.stretches if records is None else records)]

    def predict(
        self,
        values: Sequence[Mapping[str, float]],
        records: Sequence[Stretch] | None = None,
        *,
        friction: bool = False,
    ) -> list[np.ndarray]:
        """Return the torque that parameter sets predict for every stretch [N.m or N], each (B, n)."""
        if records is None:
            pairs = list(zip(self.stretches, self.regressors, strict=True))
        else:
            pairs = [(s, columns(s, (*self.terms, *self.known))) for s in records]
        laws = [self.shape.law(v) for v in values]
        zones = None
        if self.shape.element is DeadZone:
            zones = np.array([v.get("threshold", self.shape.fixed.get("threshold", 0.0)) for v in values])
            laws = [Law(rate=law.rate) for law in laws]
        beta = np.array([[*(v[t] for t in self.terms), *self.known.values()] for v in values])
        rigid = self.shape.element.SET_VALUED
        delays, which = np.unique([v.get("delay", 0.0) for v in values], return_inverse=True)
        own, alike = unlike(laws, which)  # sets that differ by other terms alone have the same friction
        lanes = Lanes([laws[i] for i in own])
        predicted, kept = [], {}
        before = self._moved if records is None else {}
        for k, (s, X) in enumerate(pairs):
            moved = [before[k, d] if (k, d) in before else _late(s, X, d / s.dt, rigid) for d in delays]
            kept |= {(k, d): m for d, m in zip(delays, moved, strict=True) if len(s.dp) <= KEPT}
            dp, load = np.array([m[0] for m in moved]), np.array([m[1] for m in moved])
            warmth = np.tile(s.temperature, (len(delays), 1))  # a view would be compiled for again
            tau = lanes.torque(which[own], dp, s.dt, load, warmth)[alike]
            if zones is not None:
                tau *= _outside(dp[which] / s.dt, zones, self.blur)
            for j in range(len(delays) if len(X) and not friction else 0):
                mine = np.flatnonzero(which == j)
                for row, rest in zip(mine, beta[mine] @ moved[j][2], strict=True):
                    tau[row] += rest
            predicted.append(tau)
        self._moved = kept if records is None else self._moved
        return predicted

    def sort_elements(self, found: SearchResult) -> SearchResult:
        """Return the end of a search with its elements side by side sorted, the stiffest first.

        The torque does not depend on their order.
        """
        names = list(self.names)
        springs = [names.index(n) for n in names if n.startswith("stiffness[")]
        ratios = [names.index(n) for n in names if n.startswith("share[")]
        if len(springs) < 2 or len(ratios) != len(springs) - 1:
            return found
        order = np.argsort(-found.point[springs], kind="stable")
        T = np.eye(len(names))
        T[springs] = T[springs][order]
        if ratios:
            padded = np.vstack([np.eye(len(names))[ratios], np.zeros(len(names))])[order]
            T[ratios] = padded[:-1] - padded[-1]
        if np.array_equal(T, np.eye(len(names))):
            return found
        return replace(found, point=T @ found.point, jacobian=found.jacobian @ np.linalg.inv(T))

    def yardstick(self, unknown: Unknown) -> tuple[float, float]:
        """Return the smallest and the largest value that the error of an unknown is compared with [SI]."""
        if unknown.name not in LOOSE:
            return 0.0, np.inf
        most = np.inf if unknown.name == "delay" else max(self.largest, unknown.scale)
        return LOOSE[unknown.name] * unknown.scale, most

    def bracket(
        self, values: Mapping[str, float], record: Stretch, predicted: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return lower and upper limits between which the torque has no error [N.m or N], (n,) each.

        The instant of a reversal within the sampling interval is unknown. If friction jumps there, it may have any value
        between those before and after.
        """
        low, high = predicted.copy(), predicted.copy()
        if self.shape.element.SET_VALUED and len(predicted) > 2:
            way = np.sign(earlier(record.velocity, values.get("delay", 0.0) / record.dt))
            turns = np.flatnonzero(way[1:] != way[:-1])
            near = np.unique(np.clip(turns[:, None] + np.arange(-1, 3), 1, len(predicted) - 2))
            around = np.array([predicted[near - 1], predicted[near], predicted[near + 1]])
            low[near], high[near] = around.min(axis=0), around.max(axis=0)
        return low, high

    def encoder(self, point: np.ndarray, draws: int = DRAWS, seed: int = 0) -> np.ndarray:
        """Return the change of the residuals for random encoder rounding errors [N.m or N], (draws, m).

        The rounding errors of an encoder are errors of the motion, which the law converts to torque. Random errors, uniform
        within a step and low-passed like the motion, are added to it.

        Args:
            point: search coordinates, (P,).
            draws: number of draws.
            seed: of the draws.
        """
        if self.count == 0.0:
            return np.zeros((0, self.size))
        rng = np.random.default_rng(seed)
        at = [self.values(point)]
        before, changes = self.predict(at), []
        for _ in range(draws):
            after = self.predict(
                at, [with_error(s, self.count * (rng.uniform(size=len(s.dp)) - 0.5)) for s in self.stretches]
            )
            changes.append(
                np.concatenate(
                    [(x - y)[0, s.judged] for x, y, s in zip(after, before, self.stretches, strict=True)]
                )
            )
        return np.array(changes)


def _late(
    s: Stretch, X: np.ndarray, samples: float, rigid: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return increments, load and regressors of the motion to which a torque delayed by some samples belongs.

    A `rigid` law depends only on the velocity at the sample, so its increments are centered there. Other laws use the
    increment of the interval before the sample.
    """
    if samples == 0.0 and not rigid:
        return s.dp, s.load, X
    path = s.position if s.position is not None else np.cumsum(s.dp)
    path = earlier(path, samples)
    load = s.load if s.load.shape[0] == 1 else np.ascontiguousarray(earlier(s.load.T, samples).T)
    dp = np.gradient(path) if rigid else np.diff(path, prepend=path[:1])
    return dp, load, earlier(X, samples)


def _outside(velocity: np.ndarray, threshold: np.ndarray, blur: float) -> np.ndarray:
    """Return the factor of a dead zone on the torque, (B, n): 0 within the zone, 1 outside.

    A measured speed has an error and is known only at the samples. The edge of the dead zone is therefore smoothed, which
    also makes the torque differentiable with respect to the threshold.
    """
    width = np.hypot(1.5 * blur, 0.5 * np.gradient(velocity, axis=1))
    depth = 0.5 + 0.5 * np.clip((np.abs(velocity) - threshold[:, None]) / width, -1.0, 1.0)
    return depth * depth * (3.0 - 2.0 * depth)
