"""Search over Fourier series for the motion of an arm with the most information on the wanted parameters, within the limits.

Several random starts are optimized, then the best is refined, by L-BFGS with exact gradients and quadratic penalties for the
limits. Since penalties allow small violations, the motion finally shrinks about its center until a strict check passes.

Swevers et al. 1997 (trajectory); Gautier, Khalil, Int. J. Robotics Research 11, 1992 (excitation); Fedorov 1972 (D-optimality).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.plans.arm import ArmPlan
from backdrive.plans.arm_bounds import ArmBounds
from backdrive.plans.arm_information import Information

HARMONICS = 12
PERIOD = 16.0  # about which the path's period lies [s]
SLOW, SLOW_SHARE, RAMP = (
    0.25,
    0.2,
    1.5,
)  # pace of the slow part [-], its share of the duration [-], change of pace [s]
STARTS, FIRST, LAST = 3, 30, 250  # starts, and rounds of a first and of the last search
SAMPLES = 20  # of the path per period of its fastest sine
WEAK, STRONG = 10.0, 200.0  # weight of what passes a limit
TRIES = 400  # number of random postures among which a center is chosen
SHRINK = 0.99  # of the amplitudes, until a strict check passes [-]
SHORTEST = 8.0  # s
GOOD = 0.5  # share of a limit that a random start uses


@dataclass(frozen=True, kw_only=True, eq=False)
class Search:
    """The settings of a search.

    Attributes:
        information: criterion.
        bounds: limits.
        duration: from rest to rest [s].
        center: about which the arm moves [rad or m], (J,); None: chosen.
        harmonics: sines a joint.
        seed: of the starts.
        progress: called with a sentence.
    """

    information: Information
    bounds: ArmBounds
    duration: float = 60.0
    center: np.ndarray | None = None
    harmonics: int = HARMONICS
    seed: int = 0
    progress: Callable[[str], None] = lambda sentence: None

    def run(self) -> ArmPlan:
        """Return the best plan found.

        Raises:
            InvalidInput: the duration is too short, or the center is beyond a limit.
            NotIdentifiable: no motion within the limits was found.
        """
        timed = timing(self.duration)
        random = np.random.default_rng(self.seed)
        centers = self._centers(random)
        best: tuple[float, np.ndarray] = (np.inf, np.empty(0))
        for i in range(STARTS):
            x = self._start(random, centers[i % len(centers)], timed["period"])
            self.progress(f"Searching a motion, start {i + 1} of {STARTS}")
            found = self._descend(x, timed["period"], WEAK, FIRST, f"start {i + 1} of {STARTS}")
            best = min(best, found, key=lambda pair: pair[0])
        _, x = self._descend(best[1], timed["period"], STRONG, LAST, "refining")
        plan = self._plan(x, timed)
        return self._shrunk(plan)

    def _centers(self, random: np.random.Generator) -> np.ndarray:
        """Return postures to begin about, (k, J)."""
        bounds = self.bounds
        if self.center is not None:
            self._refuse_center(self.center)
            return self.center[None]
        middle, half = 0.5 * (bounds.upper + bounds.lower), 0.5 * (bounds.upper - bounds.lower)
        q = middle + half * random.uniform(-0.6, 0.6, (TRIES, middle.size))
        q[0] = middle
        still = np.zeros_like(q)
        torque = bounds.robot.inverse_dynamics(q, still, still)
        good = np.all(bounds.shares(q, still, still, torque)[3] < 1.0, axis=1)
        if bounds.clearance is not None:
            needed = bounds.clearance.needed
            distance = bounds.clearance.distances(q, float(needed.max(initial=0.0)) + 0.1)
            good &= np.all(distance > 1.5 * needed, axis=1)
        if not good.any():
            raise NotIdentifiable(
                f"None of {TRIES} random postures keeps the limits of torque and distance.",
                remedy="Name one with --around, or correct the limits.",
            )
        return q[good][:STARTS]

    def _refuse_center(self, center: np.ndarray) -> None:
        """Raise an error for a center at which the arm cannot rest."""
        still = np.zeros((1, center.size))
        torque = self.bounds.robot.inverse_dynamics(center[None], still, still)
        share = self.bounds.shares(center[None], still, still, torque)[:, 0]
        for row, what in ((0, "is outside its range, less the margin"), (3, "needs more than its torque")):
            for j in np.flatnonzero(share[row] >= 1.0):
                raise InvalidInput(
                    f"Joint '{self.bounds.robot.joints[j]}': {center[j]:.4g} {what}.",
                    remedy="Give another posture with --around, or a smaller --reserve.",
                )
        if self.bounds.clearance is not None:
            spare, links = self.bounds.clearance.narrowest(center[None])
            if spare < 0.0:
                raise InvalidInput(
                    f"In the posture of --around, {links[0]} and {links[1]} are too near by {-1e3 * spare:.3g} mm.",
                    remedy="Give another posture, or a smaller --clearance.",
                )

    def _scale(self, period: float) -> np.ndarray:
        """Return an amplitude of each sine that is of the limits' size [rad or m], (J, m)."""
        w = 2.0 * np.pi / period * np.arange(1, self.harmonics + 1)
        half = 0.5 * (self.bounds.upper - self.bounds.lower)[:, None]
        reach = np.minimum(half, self.bounds.velocity[:, None] / w)
        return np.minimum(reach, self.bounds.acceleration[:, None] / w**2) / np.sqrt(self.harmonics)

    def _start(self, random: np.random.Generator, center: np.ndarray, period: float) -> np.ndarray:
        """Return a random multisine about a center that uses part of the limits, as variables of the search."""
        shape = (2, center.size, self.harmonics)
        x = np.concatenate([center, random.normal(size=shape).ravel()])
        q, dq, ddq = self._states(x, period)[:3]
        share = self.bounds.shares(q, dq, ddq, np.zeros_like(q))[1:3].max(axis=(0, 1))
        reach = np.abs(q - center).max(axis=0)
        room = np.minimum(self.bounds.upper - center, center - self.bounds.lower)
        factor = GOOD / np.maximum(share, reach / np.maximum(room, 1e-9))
        x[center.size :] = (x[center.size :].reshape(shape) * factor[None, :, None]).ravel()
        return x

    def _states(self, x: np.ndarray, period: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return position, velocity and acceleration over a period, (n, J), and the sines they are made of, (3, n, 2 m)."""
        J, m = self.bounds.lower.size, self.harmonics
        count = SAMPLES * m
        w = 2.0 * np.pi / period * np.arange(1, m + 1)
        turn = np.multiply.outer(period / count * np.arange(count), w)
        basis = np.stack(
            [
                np.hstack([np.sin(turn + k * np.pi / 2) * w**k, np.cos(turn + k * np.pi / 2) * w**k])
                for k in range(3)
            ]
        )
        weights = self._weights(x, period)
        q, dq, ddq = basis @ weights
        return q + x[:J], dq, ddq, basis

    def _weights(self, x: np.ndarray, period: float) -> np.ndarray:
        """Return amplitudes of the sines and then the cosines, (2 m, J)."""
        J, m = self.bounds.lower.size, self.harmonics
        scaled = x[J:].reshape(2, J, m) * self._scale(period)
        return scaled.transpose(0, 2, 1).reshape(2 * m, J)

    def _descend(
        self, x: np.ndarray, period: float, strength: float, rounds: int, where: str
    ) -> tuple[float, np.ndarray]:
        from scipy.optimize import minimize

        J, m, bounds = self.bounds.lower.size, self.harmonics, self.bounds
        scale, done = self._scale(period), 0

        def cost(x: np.ndarray) -> tuple[float, np.ndarray]:
            self.progress(f"Searching a motion, {where}, round {done + 1} of at most {rounds}")
            q, dq, ddq, basis = self._states(x, period)
            each = self.duration / q.shape[0] * 10.0  # noise below 5 Hz has ten independent values a second
            value, slope, torque, by_state = self.information.gradient(q, dq, ddq, each)
            extra, push = bounds.penalty(q, dq, ddq, torque, by_state)
            whole = slope + strength * push
            by_weight = np.einsum("snw,snj->wj", basis, whole).reshape(2, m, J).transpose(0, 2, 1) * scale
            by_center = whole[0].sum(axis=0) if self.center is None else np.zeros(J)
            return value + strength * extra, np.concatenate([by_center, by_weight.ravel()])

        def count(_: Any) -> None:
            nonlocal done
            done += 1

        found = minimize(
            cost,
            x,
            jac=True,
            method="L-BFGS-B",
            callback=count,
            options={"maxiter": rounds, "maxfun": 2 * rounds, "maxcor": 20},
        )
        return float(found.fun), found.x

    def _plan(self, x: np.ndarray, timed: dict[str, Any]) -> ArmPlan:
        J, robot = self.bounds.lower.size, self.bounds.robot
        sine, cosine = x[J:].reshape(2, J, self.harmonics) * self._scale(timed["period"])
        return ArmPlan(
            robot.joints,
            robot.units,
            tuple(x[:J].tolist()),
            tuple(map(tuple, sine.tolist())),
            tuple(map(tuple, cosine.tolist())),
            noise=tuple(self.information.noise.tolist()),
            purpose=self.information.purpose,
            **timed,
        )

    def _shrunk(self, plan: ArmPlan) -> ArmPlan:
        """Return the plan, reduced about its center until it keeps the limits."""
        for k in range(300):
            self.progress(f"Checking the motion, reduced to {SHRINK**k:.0%}")
            if not (passed := self.bounds.violations(plan)):
                return plan
            sine, cosine = (
                tuple(tuple(SHRINK * a for a in row) for row in rows) for rows in (plan.sine, plan.cosine)
            )
            plan = replace(plan, sine=sine, cosine=cosine)
        raise NotIdentifiable(
            f"No motion within the limits was found. {passed[0]}",
            remedy="Give another posture with --around, another --seed, or wider limits.",
        )


def timing(duration: float) -> dict[str, Any]:
    """Return period, periods, slow part and ramps of a plan of a duration [s].

    Raises:
        InvalidInput: it is too short.
    """
    if not duration >= SHORTEST:
        raise InvalidInput(
            f"A motion of {duration:g} s is too short.", remedy=f"Give --duration of at least {SHORTEST:g} s."
        )
    slow_time = SLOW_SHARE * duration
    path = (duration - 3.0 * RAMP - slow_time) + RAMP + SLOW * (RAMP + slow_time)
    periods = max(1, round(path / PERIOD))
    return {
        "period": path / periods,
        "periods": periods,
        "slow": SLOW,
        "slow_time": slow_time,
        "ramp": RAMP,
    }
