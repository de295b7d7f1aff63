"""The torque residual of a model, in short means, and tests of what explains it: position, load, time.

A column explains the residual if an F test shows that its coefficient differs from zero. The test's covariance comes from the
scores of blocks of neighbouring means (Liang & Zeger 1986), so noise may be coloured. The terms of any single-axis model
(inertia, gravity, a line and a constant for each direction) are first removed from column and residual. A term that the model
omits for good reason therefore does not count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.special import fdtrc

from backdrive.identification.signals import Signals, surely_sliding
from backdrive.logs import filters
from backdrive.logs.resolution import resolution

MEAN = 0.01  # length of a mean [s]
BLOCK = 0.4  # length of a block of means [s]
FEWEST_BLOCKS = 8  # least number of blocks for a test, in excess of the number of columns
WILD = 8.0  # residual above which a sample is an outlier [standard deviation]
FINEST = 60.0  # largest wave number over position [rad/rad or rad/m]
APART = 0.05  # least part of a column that the other dynamics do not explain, relative to the column [-]
MOST = 4_000_000  # largest product of means and wave numbers in the search for a wave
Part = tuple[Signals, np.ndarray, np.ndarray, bool]  # as `evidence` takes it


@dataclass(frozen=True, kw_only=True)
class Explanation:
    """The part of a residual that some columns explain.

    Attributes:
        size: root mean square of the columns' contribution to the torque, including the part that other dynamics could
            explain [N.m or N].
        chance: probability that noise explains as much [-].
        coefficients: of the columns, in their order.
        beyond: root mean square without the part that other dynamics could explain [N.m or N].
        wave: wave number over position, if the columns are a wave [rad/rad or rad/m].
    """

    size: float
    chance: float
    coefficients: tuple[float, ...] = ()
    beyond: float = 0.0
    wave: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Residual:
    """Means of motion and torque of one joint.

    Attributes:
        time: [s], (n,).
        position: [rad or m], (n,); NaN if the log has none.
        velocity: [rad/s or m/s], (n,).
        acceleration: [rad/s^2 or m/s^2], (n,).
        torque: measured [N.m or N], (n,).
        friction: measured torque minus all terms of the dynamics but friction [N.m or N], (n,).
        predicted: torque by the model [N.m or N], (n,).
        known: model torque, of gravity and other axes [N.m or N], (n,); zero if the log has none.
        part: number of the stretch, (n,).
        moving: False in long rests, (n,).
        sliding: True away from rests and reversals, (n,).
        period: time between means [s].
        wild: share of single outliers among the samples [-].
        step: of the measured torque [N.m or N]; 0 without steps.
    """

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    torque: np.ndarray
    friction: np.ndarray
    predicted: np.ndarray
    known: np.ndarray
    part: np.ndarray
    moving: np.ndarray
    sliding: np.ndarray
    period: float
    wild: float
    step: float

    @property
    def torque_error(self) -> np.ndarray:
        """Measured minus predicted torque [N.m or N], (n,)."""
        return self.torque - self.predicted

    @cached_property
    def size(self) -> float:
        """Mean magnitude of the friction while the joint slides [N.m or N]; NaN if it never slides."""
        return float(np.mean(np.abs(self.friction[self.sliding]))) if self.sliding.any() else np.nan

    @cached_property
    def slides(self) -> Residual:
        """The means in which the joint slides."""
        series = {f.name: getattr(self, f.name) for f in fields(self)}
        return replace(self, **{k: x[self.sliding] for k, x in series.items() if isinstance(x, np.ndarray)})

    @cached_property
    def columns(self) -> np.ndarray:
        """Columns of all terms of a single-axis model, (n, p)."""
        way = np.sign(self.velocity)
        rows = [way, self.velocity, np.abs(self.velocity), np.ones_like(way), self.acceleration]
        if np.isfinite(self.position).all():
            rows += [np.sin(self.position), np.cos(self.position)]
        if np.any(self.known):
            rows.append(self.known)
        return np.stack(rows, axis=1)

    @cached_property
    def _basis(self) -> np.ndarray:
        """Return an orthonormal basis of the single-axis columns, (n, r)."""
        return orthonormal(self.columns)

    @cached_property
    def _error_apart(self) -> np.ndarray:
        """Return the residual without the part that the single-axis columns explain [N.m or N], (n,)."""
        return self._apart(self.torque_error)

    def _apart(self, columns: np.ndarray) -> np.ndarray:
        return columns - self._basis @ (self._basis.T @ columns)

    @cached_property
    def _blocks(self) -> np.ndarray:
        """Index of the first mean of each block, (B,)."""
        return np.arange(0, self.time.size, max(round(BLOCK / self.period), 1))

    def explain(self, *columns: np.ndarray) -> Explanation | None:
        """Return the explanation by columns in addition to the single-axis ones; None if the data do not suffice.

        Args:
            columns: one value per mean, (n,) each.
        """
        whole, k = np.stack(columns, axis=1), len(columns)
        B = self._blocks.size
        if B - k < FEWEST_BLOCKS:
            return None
        size, Z = np.linalg.norm(whole, axis=0), self._apart(whole)
        if not np.all(np.linalg.norm(Z, axis=0) > APART * size):
            return None  # the motion does not separate them from the other terms
        left = self._error_apart
        if k == 1:  # the common case, without the overhead of numpy
            power = float(Z[:, 0] @ Z[:, 0])
            if not power > 0.0:
                return None
            coefficients = Z.T @ left / power
        else:
            coefficients, _, rank, _ = np.linalg.lstsq(Z, left, rcond=1e-6)
            if rank < k:
                return None
        fit = Z @ coefficients
        scores = np.add.reduceat(Z * (left - fit)[:, None], self._blocks, axis=0)
        middle = scores.T @ scores * B / (B - 1)
        if not np.isfinite(middle).all():
            return None
        middle = np.linalg.pinv(middle) if k > 1 or middle[0, 0] == 0.0 else 1.0 / middle
        moment = Z.T @ fit
        wald = float(moment @ middle @ moment)
        chance = float(fdtrc(k, B - k, wald * (B - k) / (k * (B - 1))))
        return Explanation(
            size=float(np.sqrt(np.mean((whole @ coefficients) ** 2))),
            chance=chance,
            coefficients=tuple(coefficients.tolist()),
            beyond=float(np.sqrt(np.mean(fit**2))),
        )

    @cached_property
    def over_position(self) -> tuple[Explanation | None, Explanation | None]:
        """Explanations by the best wave of the torque over position, and of the friction, whose sign is that of the velocity."""
        of_torque, of_friction = self.waves(np.ones_like(self.velocity), np.sign(self.velocity))
        return of_torque, of_friction

    def waves(self, *factors: np.ndarray) -> list[Explanation | None]:
        """Return the explanation by the best wave over position, for each factor; None without sufficient positions.

        Args:
            factors: factors on the wave, such as the sign of the velocity, (n,) each.
        """
        none: list[Explanation | None] = [None] * len(factors)
        if self.time.size < 2 or not np.isfinite(self.position).all():
            return none
        span, top = float(np.ptp(self.position)), float(np.abs(self.velocity).max())
        finest = min(FINEST, 0.5 * np.pi / (self.period * max(top, 1e-12)))
        if not span > 0.0 or finest <= 2.0 * np.pi / span:
            return none
        step = max(0.5 * np.pi / span, finest * self.time.size / MOST)
        waves = np.arange(2.0 * np.pi / span, finest, step)
        if not waves.size:
            return none
        best = waves[np.argmax(self._powers(waves, step, np.array(factors)), axis=1)].tolist()
        return [
            self._explain_wave(wave, factor, waves.size) for wave, factor in zip(best, factors, strict=True)
        ]

    def _explain_wave(self, wave: float, factor: np.ndarray, tried: int) -> Explanation | None:
        """Return the explanation by a wave that is the best of several tried ones."""
        phase = wave * self.position
        result = self.explain(factor * np.sin(phase), factor * np.cos(phase))
        return result and replace(result, wave=wave, chance=min(result.chance * tried, 1.0))

    def _powers(self, waves: np.ndarray, step: float, factors: np.ndarray) -> np.ndarray:
        """Return the reduction of the squared residual by waves, in addition to the single-axis columns, (F, W).

        Args:
            waves: equally spaced wave numbers [rad/rad or rad/m], (W,).
            step: distance of the wave numbers.
            factors: factors on each wave, (F, n).
        """
        circling, turn = np.exp(1j * waves[0] * self.position), np.exp(1j * step * self.position)
        own, weight = np.column_stack([self._error_apart, self._basis]), factors**2
        both, double = (
            np.empty((2 * waves.size, self.time.size)),
            np.empty((len(factors), waves.size), complex),
        )
        for k in range(waves.size):
            both[2 * k], both[2 * k + 1] = np.imag(circling), np.real(circling)  # sine and cosine
            double[:, k] = weight @ (circling * circling)  # real part cos^2 - sin^2, imaginary part 2 sin cos
            circling *= turn
        sums = [both @ (factor[:, None] * own) for factor in factors]
        pair = np.reshape(sums, (len(factors), waves.size, 2, -1))
        moment, held = pair[..., 0], pair[..., 1:]
        whole, even, odd = weight.sum(axis=1)[:, None], np.real(double), np.imag(double)
        square = np.array([[whole - even, odd], [odd, whole + even]])
        gram = 0.5 * square.transpose(2, 3, 0, 1) - held @ held.swapaxes(-1, -2)
        inverse = np.linalg.pinv(gram, rcond=1e-6, hermitian=True)
        return np.einsum("fwi,fwij,fwj->fw", moment, inverse, moment)


def orthonormal(columns: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis of the space spanned by columns, (n, r)."""
    scaled = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    u, s, _ = np.linalg.svd(scaled, full_matrices=False)
    return u[:, s > 1e-6 * s[0]] if s.size else u


def residual_of(parts: Sequence[Part]) -> Residual | None:
    """Return the residual of a model in short means; None without samples.

    Args:
        parts: signals, measured friction, predicted torque [N.m or N] and whether they were fitted.
    """
    parts = [part for part in parts if part[0].time.size]
    if not parts:
        return None
    top = max(np.quantile(np.abs(s.velocity), 0.995) for s, *_ in parts)
    columns: list[list[Any]] = []
    far, count = 0, 0
    for number, (s, friction, predicted, _) in enumerate(parts):
        slides = surely_sliding(s, top)
        known = np.zeros_like(s.torque) if s.model_torque is None else s.model_torque
        position = np.full(s.time.size, np.nan) if s.position is None else s.position
        series = (s.time, position, s.velocity, s.acceleration, s.torque, friction, predicted, known)
        width = max(1, round(MEAN * s.rate))
        n = s.time.size // width
        means = [filters.means(x, width) for x in series]
        masks = [x[: n * width].reshape(n, width).all(axis=1) for x in (s.moving, slides)]
        columns.append([*means, np.full(n, number), *masks])
        error = (s.torque - predicted)[slides]
        if error.size:
            error = np.abs(error - np.median(error))
            off = error > WILD * 1.4826 * np.median(error)
            beside = off[1:] & off[:-1]
            off[1:] &= ~beside
            off[:-1] &= ~beside
            far += int(np.count_nonzero(off))
            count += error.size
    names = (
        "time",
        "position",
        "velocity",
        "acceleration",
        "torque",
        "friction",
        "predicted",
        "known",
        "part",
    )
    joined = [np.concatenate(each) for each in zip(*columns, strict=True)]
    rate = float(np.median([s.rate for s, *_ in parts]))
    return Residual(
        **dict(zip((*names, "moving", "sliding"), joined, strict=True)),
        period=max(1, round(MEAN * rate)) / rate,
        wild=far / count if count else 0.0,
        step=min(resolution(s.torque) for s, *_ in parts),
    )
