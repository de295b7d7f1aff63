"""The torque residual of a model, in short means, and tests of what explains it: position, load, time.

A column explains the residual if an F test shows that its coefficient differs from zero. The test's covariance comes from the
scores of blocks of neighbouring means (Liang & Zeger 1986), so noise may be coloured. The terms of any single-axis model
(inertia, gravity, a line and a constant for each direction) are first removed from column and residual. A term that the model
omits for good reason therefore does not count.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.special import fdtrc

from backdrive.identification.curves import basis
from backdrive.identification.outliers import count_single
from backdrive.identification.projection import CLEAR, inverse_of, orthonormal
from backdrive.identification.signals import Signals, surely_sliding
from backdrive.identification.waves import sums_by_place, waves_at
from backdrive.logs import filters
from backdrive.logs.quantiles import median, quantile
from backdrive.logs.resolution import resolution

MEAN = 0.01  # length of a mean [s]
BLOCK = 0.4  # length of a block of means [s]
FEWEST_BLOCKS = 8  # least number of blocks for a test, in excess of the number of columns
OUTLYING = 3.0  # the same of a mean
FINEST = 100.0  # largest number of waves over the range of positions
APART = 0.05  # least part of a column that the other dynamics do not explain, relative to the column [-]
LINE = 2  # number of knots of a straight line
TURN = 0.25  # largest phase of the shortest wave between means that count as one in the search [rad]
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
        span: range of the columns' contribution [N.m or N].
    """

    size: float
    chance: float
    coefficients: tuple[float, ...] = ()
    beyond: float = 0.0
    wave: float = 0.0
    span: float = 0.0


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
        settled: True where it slides and friction no longer builds up, (n,); `sliding` if that is nowhere.
        period: time between means [s].
        wild: share of single outliers among the samples [-].
        step: of the measured torque [N.m or N]; 0 without steps.
        knots: speeds of the fitted curve [rad/s or m/s], (k,); empty for a line.
        log_of: number of the log of each stretch, by `part`; -1: of no fitted log.
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
    settled: np.ndarray
    period: float
    wild: float
    step: float
    knots: tuple[float, ...] = ()
    log_of: tuple[int, ...] = ()

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
        """The means in which the joint slides and friction no longer builds up."""
        return self.where(self.settled)

    @cached_property
    def is_near(self) -> np.ndarray:
        """Which means hardly differ more from the model than most, (n,)."""
        error = np.abs(self._error_apart)
        return error <= OUTLYING * 1.4826 * median(error)

    @cached_property
    def near(self) -> Residual:
        """The means that hardly differ more from the model than most."""
        return self.where(self.is_near)

    def where(self, mask: np.ndarray) -> Residual:
        """Return the means at a mask, (n,)."""
        series = {f.name: getattr(self, f.name) for f in fields(self)}
        return replace(self, **{k: x[mask] for k, x in series.items() if isinstance(x, np.ndarray)})

    @cached_property
    def columns(self) -> np.ndarray:
        """Columns of all terms of a single-axis model, (n, p).

        A curve that was fitted has taken up what it can of any other cause, so its knots are among them. In a sweep a drift of
        the torque looks like friction over the speed, for each cycle is later and faster than the one before.
        """
        way = np.sign(self.velocity)
        rows = [way, self.velocity, np.abs(self.velocity), np.ones_like(way)]
        if len(self.knots) > LINE:  # lines are among these
            rows = list(basis(self.velocity, np.array(self.knots)).T)
        rows.append(self.acceleration)
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

    def explain_each(
        self, *groups: Sequence[np.ndarray] | np.ndarray, least: float = 0.0, smallest: float = 0.0
    ) -> list[Explanation | None]:
        """Return the explanation by each group of columns beside the single-axis ones; None if the data do not suffice.

        Args:
            groups: columns, one value per mean, (n,) each.
            least: part beyond other dynamics below which there is no test, and the result is None [N.m or N].
            smallest: what a column alone explains, below which likewise [N.m or N].
        """
        whole = np.array([column for group in groups for column in group])
        apart, at = whole - (whole @ self._basis) @ self._basis.T, 0
        size, beyond = (np.sqrt(np.einsum("kn,kn->k", x, x)) for x in (whole, apart))
        separate = beyond > APART * size  # else the motion does not tell them from the other terms
        alone = np.abs(apart @ self._error_apart) * size > smallest * beyond**2 * math.sqrt(self.time.size)
        worth, results = (separate & alone).tolist(), list[Explanation | None]()
        for group in groups:
            rows = slice(at, at := at + len(group))
            usable = all((separate if len(group) > 1 else worth)[rows])
            usable = usable and self._blocks.size - len(group) >= FEWEST_BLOCKS
            results.append(self._test(whole[rows], apart[rows], least) if usable else None)
        return results

    def _test(self, whole: np.ndarray, Z: np.ndarray, least: float) -> Explanation | None:
        """Return the explanation by columns, one per row, (k, n); `Z` is their part beside the single-axis columns, (k, n)."""
        k, B, left = len(whole), self._blocks.size, self._error_apart
        inverse = inverse_of(Z @ Z.T)
        if inverse is not None:
            coefficients = inverse @ (Z @ left)
        else:
            coefficients, _, rank, _ = np.linalg.lstsq(Z.T, left, rcond=1e-6)
            if rank < k:
                return None
        fit = coefficients @ Z
        beyond = math.sqrt(fit @ fit / fit.size)
        if beyond < least:
            return None
        scores = np.add.reduceat(Z * (left - fit), self._blocks, axis=1)
        middle = scores @ scores.T * (B / (B - 1))
        if not np.isfinite(middle).all():
            return None
        inverse = inverse_of(middle)
        moment = Z @ fit
        wald = float(moment @ (np.linalg.pinv(middle) if inverse is None else inverse) @ moment)
        chance = float(fdtrc(k, B - k, wald * (B - k) / (k * (B - 1))))
        total = coefficients @ whole
        return Explanation(
            size=math.sqrt(total @ total / total.size),
            chance=chance,
            coefficients=tuple(coefficients.tolist()),
            beyond=beyond,
            span=float(np.ptp(total)),
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
        if not span > 0.0:
            return none
        finest = min(2.0 * np.pi * FINEST / span, 0.5 * np.pi / (self.period * max(top, 1e-12)))
        if finest <= 2.0 * np.pi / span:
            return none
        step = max(0.5 * np.pi / span, finest * self.time.size / MOST)
        waves = np.arange(2.0 * np.pi / span, finest, step)
        if not waves.size:
            return none
        best = waves[np.argmax(self._powers(waves, step, np.array(factors)), axis=1)].tolist()
        phases = [wave * self.position for wave in best]
        pairs = [(f * np.sin(x), f * np.cos(x)) for f, x in zip(factors, phases, strict=True)]
        return [  # each wave is the best of several tried ones
            one and replace(one, wave=wave, chance=min(one.chance * waves.size, 1.0))
            for wave, one in zip(best, self.explain_each(*pairs), strict=True)
        ]

    def _powers(self, waves: np.ndarray, step: float, factors: np.ndarray) -> np.ndarray:
        """Return the reduction of the squared residual by waves, in addition to the single-axis columns, (F, W).

        Args:
            waves: equally spaced wave numbers [rad/rad or rad/m], (W,).
            step: distance of the wave numbers.
            factors: factors on each wave, (F, n).
        """
        W, n, F = waves.size, self.time.size, len(factors)
        own = np.column_stack([self._error_apart, self._basis])
        both = np.reshape(factors[..., None] * own, (F, n, -1)).swapaxes(0, 1).reshape(n, -1)
        count, held = both.shape[1], np.column_stack([both, (factors**2).T])
        position, held = sums_by_place(self.position, held, TURN / waves[-1])
        both, weight = held[:, :count], held[:, count:].T
        sums, square = np.empty((2, W, count)), np.empty((2, F, W))
        for rows, sine, cosine in waves_at(position, waves[0], step, W):
            sums[0, rows], sums[1, rows] = sine @ both, cosine @ both
            square[0, :, rows], square[1, :, rows] = weight @ (sine * sine).T, weight @ (sine * cosine).T
        pair = sums.reshape(2, W, F, -1).transpose(2, 1, 0, 3)
        moment, held = pair[..., 0], pair[..., 1:]
        of_sine, mixed = square
        gram = np.array([[of_sine, mixed], [mixed, weight.sum(axis=1)[:, None] - of_sine]]).transpose(
            2, 3, 0, 1
        )
        gram = gram - held @ held.swapaxes(-1, -2)
        (a, b), (_, d), (u, v) = gram[..., 0, :].T, gram[..., 1, :].T, moment.T
        determinant = a * d - b * b
        clear = determinant > CLEAR * (a + d) ** 2
        powers = (d * u * u - 2.0 * b * u * v + a * v * v) / np.where(clear, determinant, 1.0)
        if not clear.all():
            inverse = np.linalg.pinv(gram, rcond=1e-6, hermitian=True)
            powers = np.where(clear, powers, np.einsum("fwi,fwij,fwj->wf", moment, inverse, moment))
        return powers.T


def residual_of(
    parts: Sequence[Part],
    settled: Sequence[np.ndarray] = (),
    *,
    means_alone: bool = False,
    knots: tuple[float, ...] = (),
) -> Residual | None:
    """Return the residual of a model in short means; None without samples.

    Args:
        parts: signals, measured friction, predicted torque [N.m or N] and whether they were fitted.
        settled: where friction no longer builds up, a mask for each of the first parts, (n,) each.
        means_alone: leave `wild` and `step` at 0, which need each sample.
        knots: speeds of the fitted curve [rad/s or m/s], (k,); empty for a line.
    """
    masks_of = [*settled, *[None] * (len(parts) - len(settled))]
    masks_of = [mask for part, mask in zip(parts, masks_of, strict=True) if part[0].time.size]
    parts = [part for part in parts if part[0].time.size]
    if not parts:
        return None
    top = max(quantile(np.abs(s.velocity), 0.995) for s, *_ in parts)
    columns: list[list[Any]] = []
    far, count = 0, 0
    for number, (s, friction, predicted, _) in enumerate(parts):
        slides = settles = surely_sliding(s, top)
        if (mask := masks_of[number]) is not None:
            settles = slides & mask
        position = np.full(s.time.size, np.nan) if s.position is None else s.position
        series = (s.time, position, s.velocity, s.acceleration, s.torque, friction, predicted)
        width = max(1, round(MEAN * s.rate))
        n = s.time.size // width
        means = [filters.means(x, width) for x in series]
        masks = [x[: n * width].reshape(n, width).all(axis=1) for x in (s.moving, slides, settles)]
        known = np.broadcast_to(0.0, n) if s.model_torque is None else filters.means(s.model_torque, width)
        columns.append([*means, known, np.full(n, number, dtype=np.int32), *masks])
        if not means_alone and slides.any():
            far += count_single(s.torque - predicted, slides, friction)
            count += int(np.count_nonzero(slides))
    joined = [
        np.concatenate(each) if len(each) > 1 else each[0] for each in map(list, zip(*columns, strict=True))
    ]
    rate = median(np.array([s.rate for s, *_ in parts]))
    if not joined[-1].any():
        joined[-1] = joined[-2]
    names = (f.name for f in fields(Residual))  # the arrays come first, as above
    return Residual(
        **dict(zip(names, joined, strict=False)),
        period=max(1, round(MEAN * rate)) / rate,
        knots=knots,
        log_of=tuple(s.log for s, *_ in parts),
        wild=far / count if count else 0.0,
        step=0.0 if means_alone else min(resolution(s.torque) for s, *_ in parts),
    )
