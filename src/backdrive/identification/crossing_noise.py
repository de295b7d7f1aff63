"""The noise of a fit through zero crossings, and the transform that makes it white.

The torque's noise is an autoregression of first order, r_k = c r_(k-1) + e_k. Beside it stand the rounding of the positions, which
enters the acceleration through the weights of a second difference, and what sampling leaves open at each sample. Of r_k - c r_(k-1)
the covariance has a band of a few samples, whose Cholesky factor makes it white (Aitken 1935).
The noise is the likeliest one of what no column tells (restricted likelihood: Patterson & Thompson, Biometrika 58, 1971): slow
noise looks like a column now and then, and what a fit leaves of it seems faster than it is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky_banded, get_lapack_funcs

from backdrive.identification.zero_crossing import NUMEROV, REACH, Passage, stencil

CLIPPED = 2.5  # size beyond which a whitened residual counts linearly [standard deviation]
PROBES = 24  # random signs by which sums of the weights' diagonals are measured
STEPS = 10  # Newton's steps of a search for the noise
# distance of the points whose likelihoods are compared [area tangent of a correlation, logarithm of a size]
APART = np.array([0.05, 0.01])
FLAT = 0.02  # decrease of twice the logarithm of a likelihood that is not worth a step [-]
FARTHEST = 20.0  # longest step [APART]
SETTLED = 200  # rows after which the factor of a covariance that does not change has settled
MOST = 0.9999  # largest correlation of neighbouring samples [-]
(solve_triangular_band,) = get_lapack_funcs(("tbtrs",), dtype=np.float64)


@dataclass(frozen=True)
class Noise:
    """Noise of the torque.

    Attributes:
        correlation: of neighbouring samples [-].
        innovation: standard deviation of what is new in a sample [N.m or N].
    """

    correlation: float
    innovation: float


class Whitener:
    """Makes the noise of one stretch white, of unit variance.

    Args:
        passage: the stretch.
        noise: of its torque.
        rounding: of a position, by inertia [N.m.s^2 or N.s^2].
        delay: of the torque [s].
        unsure: further variance of each row [(N.m)^2 or N^2], (m,).
    """

    def __init__(self, passage: Passage, noise: Noise, rounding: float, delay: float, unsure: np.ndarray):
        self.noise = noise
        weights = stencil(delay * passage.rate) * passage.rate**2 * rounding
        ahead = np.convolve(np.trim_zeros(weights), [1.0, -noise.correlation]) / noise.innovation
        products = np.correlate(ahead, ahead, "full")[ahead.size - 1 :]
        products[:3] += np.correlate(NUMEROV, NUMEROV, "full")[2:]
        band = np.repeat(products[:, None], unsure.size, axis=1)
        more = unsure / noise.innovation**2
        band[0] += more
        band[0, 1:] += noise.correlation**2 * more[:-1]
        band[1, :-1] -= noise.correlation * more[:-1]
        self._factor = cholesky_banded(band, lower=True, overwrite_ab=True, check_finite=False)
        first = np.sqrt(1.0 - noise.correlation**2)  # row that nothing goes before
        scale = unsure.size * float(np.log(noise.innovation)) - float(np.log(first))
        self.log_determinant = 2.0 * (float(np.sum(np.log(self._factor[0]))) + scale)
        steady = np.repeat(products[:, None], min(SETTLED, unsure.size), axis=1)
        usual = float(cholesky_banded(steady, lower=True, overwrite_ab=True, check_finite=False)[0, -1])
        #: The same without the rounding, which depends on the delay: by it fits with different delays compare.
        self.beside_rounding = 2.0 * (float(np.sum(np.log(self._factor[0] / usual))) + scale)

    def __call__(self, X: np.ndarray) -> np.ndarray:
        """Return rows whose noise is white, (m, p)."""
        ahead = X / self.noise.innovation
        ahead[1:] -= self.noise.correlation / self.noise.innovation * X[:-1]
        ahead[0] *= np.sqrt(1.0 - self.noise.correlation**2)
        return solve_triangular_band(self._factor, ahead, uplo="L")[0]

    def times_weights(self, X: np.ndarray) -> np.ndarray:
        """Return the weights, the inverse covariance, times rows, (m, p)."""
        back = solve_triangular_band(self._factor, self(X), uplo="L", trans="T")[0] / self.noise.innovation
        result = back.copy()
        result[0] *= np.sqrt(1.0 - self.noise.correlation**2)
        result[:-1] -= self.noise.correlation * back[1:]
        return result

    def diagonals(self, size: int, count: int, rng: np.random.Generator) -> np.ndarray:
        """Return the sums of the main diagonal and those beside it of the weights, the inverse covariance, (count,).

        Args:
            size: number of rows.
            count: number of diagonals.
            rng: of random signs (M. F. Hutchinson, Commun. Stat. Simul. Comput. 19, 1990).
        """
        signs = rng.choice([-1.0, 1.0], size=(size, PROBES))
        weighted = self.times_weights(signs)
        return np.array([np.sum(weighted[lag:] * signs[: size - lag]) / PROBES for lag in range(count)])


def slide(weights: np.ndarray, series: np.ndarray) -> np.ndarray:
    """Return sums of the samples within REACH by weights, (2 REACH + 1,), of columns that go on REACH beyond, (m, p)."""
    size, used = len(series) - 2 * REACH, np.flatnonzero(weights)
    return np.sum([weights[k] * series[k : k + size] for k in used], axis=0)


def huber_sum(white: np.ndarray) -> float:
    """Return the sum of squares of whitened residuals, (m,), of which large ones count linearly (Huber)."""
    size = np.abs(white)
    return float(np.sum(np.where(size < CLIPPED, white**2, CLIPPED * (2.0 * size - CLIPPED))))


def noise_of(
    passages: Sequence[Passage],
    residuals: Sequence[np.ndarray],
    columns: Sequence[np.ndarray],
    unsure: Sequence[np.ndarray],
    rounding: float,
    delay: float,
    begin: Noise,
) -> Noise:
    """Return the noise under which the residuals of a fit are most likely, with large ones limited.

    Args:
        passages: stretches.
        residuals: of each, (m,).
        columns: that were fitted, (m, p) of each.
        unsure: further variance of each row [(N.m)^2 or N^2], (m,) of each.
        rounding: of a position, by inertia [N.m.s^2 or N.s^2].
        delay: of the torque [s].
        begin: about the noise.
    """
    size = np.sqrt(np.sum([np.sum(X**2, axis=0) for X in columns], axis=0))
    both = [np.column_stack([X / size, r]) for X, r in zip(columns, residuals, strict=True)]

    def unlikely(x: np.ndarray) -> float:
        noise, total, gram = _noise_at(x), 0.0, 0.0
        for passage, part, more in zip(passages, both, unsure, strict=True):
            whitener = Whitener(passage, noise, rounding, delay, more)
            white = whitener(part)
            total += huber_sum(white[:, -1]) + whitener.log_determinant
            gram = gram + white[:, :-1].T @ white[:, :-1]
        return total + float(np.linalg.slogdet(gram)[1])

    first = np.array([np.arctanh(min(begin.correlation, MOST)), np.log(begin.innovation)])
    return _noise_at(_lowest(unlikely, first))


def _lowest(function: Callable[[np.ndarray], float], x: np.ndarray) -> np.ndarray:
    """Return where a smooth function of two numbers is least, by Newton's steps with derivatives from differences, (2,)."""
    value = function(x)
    for _ in range(STEPS):
        before, after = ([function(x + way * side) for side in np.diag(APART)] for way in (-1.0, 1.0))
        slope = 0.5 * np.subtract(after, before)
        square = np.diag(np.add(after, before) - 2.0 * value)
        square[0, 1] = square[1, 0] = function(x + APART) - sum(after) + value
        bend, turn = np.linalg.eigh(square)
        along, bend = turn.T @ slope, np.maximum(np.abs(bend), FLAT)
        if 0.5 * float(np.sum(along**2 / bend)) < FLAT:
            break
        step = np.clip(turn @ (-along / bend), -FARTHEST, FARTHEST) * APART
        tried = ((function(x + part * step), part) for part in (1.0, 0.5, 0.25, 0.125))
        least, part = next((one for one in tried if one[0] < value), (value, 0.0))
        x, gain, value = x + part * step, value - least, least
        if gain < FLAT:
            break
    return x


def _noise_at(x: np.ndarray) -> Noise:
    return Noise(float(np.clip(np.tanh(x[0]), 0.0, MOST)), float(np.exp(x[1])))
