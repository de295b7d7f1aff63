"""Detect motors that drive several joints, from the residual of a fit that assumes one motor per joint.

Where motor k turns with dq_k + d dq_l, its friction F_k acts on joint l as well, d times, and reverses when the motor does:

    tau = Y theta + D' (F(D dq) + J D ddq),     D = 1 + d e_k e_l' = C^-1 of q_joint = C q_motor

The residual of joint l therefore follows F_k. For every ordered pair of joints, the residual of l is regressed on the part of
F_k that l's own columns do not explain. Cross-validation over blocks of the log selects the pairs that lower the squared
residual most. For these pairs, in both orders, the search finds the d with the smallest residuals of both joints. Bodies and
friction are refitted for each d. The best d is tested: on held-out blocks, the squared residuals must be smaller than without
the coupling. The test uses Student's distribution over the blocks, at a level corrected for the number of pairs. Blocks are
longer than the correlation of the residual.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import stdtrit

from backdrive.identification.arm_signals import ArmSignals
from backdrive.identification.arm_solve import Solution
from backdrive.identification.arm_terms import Rows, Terms, steps_of
from backdrive.identification.quality import JUDGED_BELOW
from backdrive.identification.regression import NORMAL
from backdrive.logs.filters import low_pass

FALSE = 0.01  # probability of a remark on an arm without couplings [-]
BLOCKS = 10  # number of blocks of the log
RIDGE = 1e-6  # ridge weight in the regression on a joint's own columns of unit length [-]
LEAST = 0.03  # least d with a remark [-]
# largest d of the search, and its steps, which are small since the loss has many local minima [-]
LARGEST, STEPS = 1.6, (0.2, 0.02)
WIDE = 0.05  # step of numerical derivatives with respect to d, wider than the local minima [-]
PAIRS, SUSPECT = 2, 2.0  # largest number of searched pairs, and their least gain [standard error]
FLOOR = 0.01  # least standard error of d, reached if friction follows no curve, as on simulated arms [-]
WILD = 3.0  # limit of the residuals in the test [standard deviation]


@dataclass(frozen=True, kw_only=True)
class CouplingGuess:
    """A motor that seems to drive another joint as well.

    Attributes:
        motor: number of the motor, which turns along with the other joint.
        joint: number of the other joint.
        value: d, turns of the motor per turn of the joint [-].
        error: its standard error [-].
    """

    motor: int
    joint: int
    value: float
    error: float

    def matrix(self, size: int) -> np.ndarray:
        """Return C of q_joint = C q_motor, (J, J)."""
        C = np.eye(size)
        C[self.motor, self.joint] = -self.value
        return C

    def sentence(self, names: Sequence[str]) -> str:
        """Return a remark for the user."""
        motor, joint = names[self.motor], names[self.joint]
        return (
            f"The motor of '{motor}' seems to turn with '{joint}' as well, by {self.value:.2f} +- "
            f"{NORMAL * self.error:.2g} of its motion: the residual follows that motor's friction "
            f"({100 * FALSE:.0f} % false alarms). Read the log with "
            f"--coupling FILE --coupling-side joint, whose matrix has {-self.value:.3g} in the row of '{motor}' and the column of "
            f"'{joint}', ones on its diagonal."
        )


def guess_coupling(
    rows: Rows, stretches: Sequence[ArmSignals], terms: Sequence[Terms], solution: Solution
) -> CouplingGuess | None:
    """Return the most significant coupling in the residual, or None.

    Args:
        rows: of the fit.
        stretches: signals from which the rows were built.
        terms: of every joint.
        solution: of the fit.
    """
    J = len(terms)
    if J < 2 or any(s.coupling is not None for s in stretches):
        return None
    searches = [
        Search(rows=rows, stretches=stretches, terms=terms, motor=motor, joint=joint)
        for motor, joint in _suspects(rows, terms, solution)
    ]
    results = [(one.gain(d), d, one) for one in searches if one.used.size >= 4 * BLOCKS for d in [one.best()]]
    if not results:
        return None
    _, d, best = max(results, key=lambda result: result[0])
    sure = best.unseen(d) > float(stdtrit(BLOCKS - 1, 1.0 - FALSE / (J * (J - 1))))
    guess = CouplingGuess(motor=best.motor, joint=best.joint, value=d, error=best.error(d))
    return guess if sure and abs(d) > max(LEAST, 3.0 * guess.error) else None


def _suspects(rows: Rows, terms: Sequence[Terms], solution: Solution) -> list[tuple[int, int]]:
    """Return pairs (motor, joint) in which the joint's residual may follow the motor's friction, and the reversed pairs."""
    J, moving = len(terms), rows.weight > 0
    friction = [
        own[:, : 2 * t.knots.size] @ x[: 2 * t.knots.size]
        for own, t, x in zip(rows.friction, terms, solution.own, strict=True)
    ]
    sizes: list[tuple[float, tuple[int, int]]] = []
    for joint in np.flatnonzero(np.count_nonzero(moving, axis=0) >= 4 * BLOCKS).tolist():
        used = moving[:, joint]
        own = np.hstack([rows.bodies[used, joint], rows.friction[joint][used]])
        motors = [k for k in range(J) if k != joint and moving[:, k].any()]
        both = np.column_stack([rows.torque[used, joint], *(friction[k][used] for k in motors)])
        left = both - own @ _coefficients(own, both)
        sizes += [(_unseen(left[:, 0], left[:, 1 + i]), (k, joint)) for i, k in enumerate(motors)]
    chosen = [pair for size, pair in sorted(sizes, reverse=True)[:PAIRS] if size > SUSPECT]
    return list(dict.fromkeys([*chosen, *((joint, motor) for motor, joint in chosen)]))


def _coefficients(own: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the coefficients of a regression of `other` on the columns of `own`, (p, ...)."""
    size = np.maximum(np.linalg.norm(own, axis=0), 1e-300)
    scaled = own / size
    gram = scaled.T @ scaled + RIDGE * np.eye(size.size)
    return np.linalg.solve(gram, scaled.T @ other) / size.reshape(-1, *[1] * (other.ndim - 1))


def _blocks(n: int) -> np.ndarray:
    return np.arange(n) * BLOCKS // n


def _unseen(error: np.ndarray, shape: np.ndarray) -> float:
    """Return the reduction of the squared error on held-out blocks by `shape` [standard error]."""
    block = _blocks(error.size)
    product = np.bincount(block, shape * error, BLOCKS)
    power = np.bincount(block, shape**2, BLOCKS)
    factor = (product.sum() - product) / np.maximum(power.sum() - power, 1e-300)
    return _certainty(factor * product - 0.5 * factor**2 * power)


def _certainty(gain: np.ndarray) -> float:
    """Return the mean over blocks divided by its standard error [-]."""
    spread = float(gain.std(ddof=1))
    return float(gain.mean()) / spread * np.sqrt(gain.size) if spread > 0.0 else 0.0


@dataclass(eq=False, kw_only=True)
class Search:
    """Residuals of a motor and of the joint that it may turn along with, as functions of d."""

    rows: Rows
    stretches: Sequence[ArmSignals]
    terms: Sequence[Terms]
    motor: int
    joint: int

    def __post_init__(self):
        weight = self.rows.weight
        self.used = np.flatnonzero((weight[:, self.motor] > 0) & (weight[:, self.joint] > 0))
        self.step = steps_of(self.stretches)

    def pieces(self, d: float) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return columns and torque of the motor and of the joint for a given d."""
        rows, used, motor, joint = self.rows, self.used, self.motor, self.joint
        along = []
        for s in self.stretches:
            turns, speeds = (x[:, motor] + d * x[:, joint] for x in (s.velocity, s.acceleration))
            columns = self.terms[motor].columns(turns, speeds, None)[:, :-1]
            along.append(low_pass(columns, JUDGED_BELOW, s.rate)[:: self.step])
        own = np.hstack([rows.bodies[used, motor], np.concatenate(along)[used]])
        other = np.hstack(
            [rows.bodies[used, joint] - d * rows.bodies[used, motor], rows.friction[joint][used, :-1]]
        )
        return [
            (own, rows.torque[used, motor]),
            (other, rows.torque[used, joint] - d * rows.torque[used, motor]),
        ]

    def errors(self, d: float) -> list[np.ndarray]:
        """Return the residuals of motor and joint."""
        return [y - X @ _coefficients(X, y) for X, y in self.pieces(d)]

    def loss(self, d: float) -> float:
        """Return the sum of the logarithms of both mean squared residuals."""
        return sum(float(np.log(np.mean(e**2))) for e in self.errors(d))

    def gain(self, d: float) -> float:
        """Return the decrease of the loss by d."""
        return self.loss(0.0) - self.loss(d)

    def best(self) -> float:
        """Return the d with the least loss."""
        middle, reach = 0.0, LARGEST
        for step in STEPS:
            tried = np.arange(middle - reach, middle + reach + 0.5 * step, step)
            middle, reach = float(tried[np.argmin([self.loss(d) for d in tried])]), step
        ends = (middle - reach, middle + reach)
        return float(minimize_scalar(self.loss, bounds=ends, method="bounded", options={"xatol": 1e-3}).x)  # type: ignore[arg-type]

    def unseen(self, d: float) -> float:
        """Return the reduction of the squared residuals on held-out blocks by d [standard error]."""
        gain, block = np.zeros(BLOCKS), _blocks(self.used.size)
        for (X, y), (X0, y0) in zip(self.pieces(d), self.pieces(0.0), strict=True):
            scale = float(np.mean((y0 - X0 @ _coefficients(X0, y0)) ** 2))
            for b in range(BLOCKS):
                out, kept = block == b, block != b
                after = y[out] - X[out] @ _coefficients(X[kept], y[kept])
                before = y0[out] - X0[out] @ _coefficients(X0[kept], y0[kept])
                most = WILD**2 * scale
                gain[b] += float(np.sum(np.minimum(before**2, most) - np.minimum(after**2, most))) / scale
        return _certainty(gain)

    def error(self, d: float) -> float:
        """Return the standard error of d, from the scatter of the blocks' slopes and a lower limit (`FLOOR`) [-]."""
        block = _blocks(self.used.size)
        size = [np.mean(e**2) for e in self.errors(d)]
        low, high, here = (
            np.sum(
                [np.bincount(block, e**2 / v, BLOCKS) for e, v in zip(self.errors(at), size, strict=True)],
                axis=0,
            )
            for at in (d - WIDE, d + WIDE, d)
        )
        bend = float(np.sum(high + low - 2.0 * here)) / WIDE**2
        slopes = (high - low) / (2.0 * WIDE)
        scatter = float(np.sqrt(np.sum((slopes - slopes.mean()) ** 2))) / bend if bend > 0.0 else np.inf
        return float(np.hypot(scatter, FLOOR))
