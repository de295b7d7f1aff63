"""The regressor of a single axis, the candidate models on it, and the choice among them by blocked cross-validation."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from backdrive.errors import NotIdentifiable
from backdrive.identification import curves, regression
from backdrive.identification.signals import Signals
from backdrive.identification.terms import GRAVITY, RIGID
from backdrive.identification.terms import columns as columns_of
from backdrive.logs import filters

#: Columns before the friction basis, in this order.
COLUMNS = ("inertia", "jerk", "offset", "gravity_sin", "gravity_cos", "model_torque")
LARGEST_SLIP = 0.02  # longest delay of the torque with a plausible cause, such as a clock offset [s]
TOLERANCE = 1.01  # largest loss of a simpler model on left-out blocks, relative to the best one [-]
GAIN = 1.5  # largest additional loss, summed over blocks, of a simpler model [standard error]
SURE = 2.0  # largest mean logarithm of the blocks' loss ratios of a simpler model [standard error]
UNSOUND = 2.0  # largest loss of a physically plausible model, relative to the best one [-]
VAGUE = 0.05  # largest standard error at a knot of an accepted curve, relative to the largest friction [-]
ROUNDING = 1e-12  # loss below which differences are rounding errors, relative to the torque's power [-]
MEAGRE = 1e-9  # least mean square of a determined column of the curve [-]


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidate:
    """A set of terms and a curve.

    Attributes:
        terms: names of the fitted columns of `COLUMNS`.
        form: the friction curve.
        spread: matrix from the candidate's coefficients to those of all columns, (p, r).
    """

    terms: tuple[str, ...]
    form: curves.Form
    spread: np.ndarray

    @property
    def size(self) -> int:
        """Number of coefficients."""
        return self.spread.shape[1]

    def with_term(self, term: str) -> Candidate:
        """Return the candidate with one more column, the last of its terms."""
        column = np.zeros(self.spread.shape[0])
        column[COLUMNS.index(term)] = 1.0
        return replace(
            self,
            terms=(*self.terms, term),
            spread=np.insert(self.spread, len(self.terms), column, axis=1),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Choice:
    """The chosen candidate with its fit.

    Attributes:
        candidate: the chosen candidate.
        coefficients: those of the terms, then the friction at the knots, (r,).
        covariance: of the coefficients, (r, r).
        left_out: coefficients without each block, (B, r).
        condition: of the regressor with columns of unit length [-].
    """

    candidate: Candidate
    coefficients: np.ndarray
    covariance: np.ndarray
    left_out: np.ndarray
    condition: float


class CandidateFit(NamedTuple):
    """A candidate fitted to all blocks, and how well it predicts those that were left out.

    Attributes:
        candidate: that was fitted.
        coefficients: fitted to all blocks, (r,).
        by_block: weighted squared error of each block, predicted without it, (B,).
        loss: mean squared error of these predictions.
    """

    candidate: Candidate
    coefficients: np.ndarray
    by_block: np.ndarray
    loss: float


def columns(s: Signals, knots: np.ndarray, rows: slice = slice(None)) -> np.ndarray:
    """Return all columns at full rate: `COLUMNS`, then the friction basis, (n, 6 + 2 k)."""
    s = s.rows(rows)
    return np.hstack([np.stack(head(s), axis=1), curves.basis(s.velocity, knots)])


def means(s: Signals, knots: np.ndarray, rows: slice, width: int) -> np.ndarray:
    """Return the means of all columns over bins of `width` samples, (n / width, 6 + 2 k)."""
    s = s.rows(rows)
    first = head(s, lambda x: filters.means(x, width))
    return np.hstack([np.stack(first, axis=1), curves.basis_means(s.velocity, knots, width)])


def head(s: Signals, linear: Callable[[np.ndarray], np.ndarray] = np.asarray) -> tuple[np.ndarray, ...]:
    """Return the columns of all terms but friction, (n,) each, or (m,) after a linear function that maps ones to ones."""
    acceleration = linear(s.acceleration)
    zero = np.zeros_like(acceleration)
    pull = (zero, zero) if s.pull is None else (linear(s.pull[0]), linear(s.pull[1]))
    known = zero if s.model_torque is None else linear(s.model_torque)
    return acceleration, -linear(s.jerk), zero + 1.0, *pull, known


def candidates(
    knots: np.ndarray,
    coarse: dict[str, np.ndarray],
    *,
    dynamic: bool,
    gravity: bool | None,
    model_torque: bool,
    both_directions: bool,
    symmetric: bool | None = None,
) -> list[Candidate]:
    """Return the models to compare, fewest coefficients first.

    Args:
        knots: of the fine basis [rad/s or m/s], (k,).
        coarse: name -> knots of a curve.
        dynamic: the inertia may be estimated.
        gravity: True: with gravity, False: without, None: both.
        model_torque: include the model torque.
        both_directions: the data cover both directions.
        symmetric: True or False to allow only that kind of curve.
    """
    head = ("inertia",) if dynamic else ()
    pulls = {True: [GRAVITY], False: [()], None: [(), GRAVITY]}[gravity]
    known = ("model_torque",) if model_torque else ()
    result = []
    for form in curves.forms(knots, coarse, both_directions):
        if symmetric is not None and form.symmetric != symmetric and both_directions:
            continue
        # with a curve for each direction, a constant is not identifiable
        constant = ("offset",) if form.symmetric and both_directions else ()
        for pull in pulls:
            terms = (*head, *pull, *known, *constant)
            head_size, size = len(COLUMNS), len(terms)
            spread = np.zeros((head_size + len(form.spread), size + form.spread.shape[1]))
            spread[[COLUMNS.index(term) for term in terms], range(size)] = 1.0
            spread[head_size:, size:] = form.spread
            result.append(Candidate(terms=terms, form=form, spread=spread))
    return sorted(result, key=lambda c: c.size)


def predict(candidate: Candidate, coefficients: np.ndarray, motion: Signals, row: np.ndarray) -> np.ndarray:
    """Return the torque of samples, each predicted by one of several fits [N.m or N], (n,); a term `jerk` is left out.

    Args:
        candidate: the fitted candidate.
        coefficients: of several fits, (B, r).
        motion: motion that belongs to the torque.
        row: index of the fit to use for each sample, (n,).
    """
    k = len(candidate.terms)
    torque = curves.torques(candidate.form, coefficients[:, k:], motion.velocity, row)
    rigid = [term for term in candidate.terms if term in RIGID]
    known = 0.0 if motion.model_torque is None else motion.model_torque  # as `head` takes it
    along: dict[str, Any] = dict(zip(rigid, columns_of(motion, rigid), strict=True)) | {"model_torque": known}
    for j, term in enumerate(candidate.terms):
        if term != "jerk":
            torque += coefficients[:, j].take(row) * along[term]
    return torque


def fit(blocks: regression.Blocks, candidate: Candidate, noise: float = 0.0) -> Choice:
    """Return a candidate fitted to all blocks.

    Args:
        blocks: normal equations of all columns.
        candidate: the chosen candidate.
        noise: mean square of the noise of the first column, as of `Blocks.without_noise`.
    """
    mapped = blocks.map_columns(candidate.spread)
    condition = regression.condition(mapped.whole[0])
    mapped = mapped.without_noise(noise) if noise else mapped
    theta, left_out = regression.solutions(mapped)
    covariance = regression.sandwich(mapped, theta)
    return Choice(
        candidate=candidate,
        coefficients=theta,
        covariance=covariance,
        left_out=left_out,
        condition=condition,
    )


def fits_of(blocks: regression.Blocks, options: list[Candidate]) -> list[CandidateFit]:
    """Return those candidates that the data determine, fitted, in their order.

    Raises:
        NotIdentifiable: no candidate is determined by the data.
    """
    total, power = max(float(blocks.rows.sum()), 1e-300), float(blocks.power.sum())
    fits: list[CandidateFit] = []
    vague: list[tuple[float, float]] = []
    used = int(np.count_nonzero(blocks.rows))
    for option in options:
        mapped = blocks.map_columns(option.spread)
        weight = mapped.whole[0].diagonal()
        k = len(option.terms)
        if not weight.min() > 0.0 or weight[k:].min() < MEAGRE * total:
            continue
        theta, left_out = regression.solutions(mapped)
        if len(option.form.knots) > 2:  # at a knot that the data hardly determine, a curve would oscillate
            unsure = _jackknife(theta[k:], left_out[:, k:], used) / max(np.abs(theta[k:]).max(), 1e-300)
            if unsure.max() > VAGUE:
                at = int(np.argmax(unsure))
                vague.append((float(unsure[at]), option.form.knots[at % option.form.knots.size]))
                continue
        by_block = regression.block_losses(mapped, left_out)
        fits.append(
            CandidateFit(option, theta, by_block, max(float(by_block.sum()), ROUNDING * power) / total)
        )
    if not fits and vague:
        unsure, speed = min(vague)
        raise NotIdentifiable(
            f"These data do not determine a friction curve of several sections: at {speed:.2g} rad/s or m/s it is uncertain by "
            f"{100.0 * unsure:.0f} % of the largest friction (at most {100.0 * VAGUE:.0f} %).",
            remedy="Fit Coulomb and viscous friction (--law coulomb-viscous), or record a longer motion at that speed.",
        )
    if not fits:
        raise NotIdentifiable(
            "These data do not determine a friction curve: the joint hardly moves.",
            remedy="Record a motion with both directions and several speeds (see `backdrive plan`).",
        )
    return fits


def simplest(blocks: regression.Blocks, options: list[Candidate]) -> Candidate:
    """Return the simplest candidate that predicts left-out blocks nearly as well as the best.

    Raises:
        NotIdentifiable: no candidate is determined by the data.
    """
    fits = fits_of(blocks, options)
    best = min(fits, key=lambda fit: fit.loss)
    sound = [fit for fit in fits if _plausible(fit.candidate, fit.coefficients)]
    if sound and min(fit.loss for fit in sound) <= UNSOUND * best.loss:
        fits, best = sound, min(sound, key=lambda fit: fit.loss)
    return next(
        fit.candidate
        for fit in fits
        if fit.loss <= TOLERANCE * best.loss + 1e-300 or _tie(fit.by_block, best.by_block)
    )


def _jackknife(theta: np.ndarray, left_out: np.ndarray, used: int) -> np.ndarray:
    """Return standard errors from the fits without each block, widened as those of `cluster_covariance`, (p,).

    Args:
        theta: fitted to all blocks, (p,).
        left_out: without each block, (B, p).
        used: number of blocks with data.
    """
    used, apart = max(used, 2), left_out - theta
    return np.sqrt(np.einsum("bp,bp->p", apart, apart) * (used - 1) / used) * regression.few(used)


def _tie(losses: np.ndarray, of_best: np.ndarray) -> bool:
    """Return whether the blocks' losses exceed those of the best model by no more than their scatter.

    A badly predicted block adds as much to the scatter of the differences as to their sum. A single block is thus never
    significant. In that case, the ratios of the losses distinguish the models.
    """
    worse, floor = losses - of_best, ROUNDING * max(float(of_best.sum()), 1e-300)
    ratio = np.log((losses + floor) / (of_best + floor))
    root = math.sqrt(losses.size)
    return bool(
        worse.sum() <= GAIN * root * float(worse.std(ddof=1))
        and ratio.mean() <= SURE * float(ratio.std(ddof=1)) / root
    )


def _plausible(option: Candidate, theta: np.ndarray) -> bool:
    """Return whether friction opposes motion at every knot and the inertia is not negative."""
    if "inertia" in option.terms and theta[option.terms.index("inertia")] < 0.0:
        return False
    curve, k = theta[len(option.terms) :], option.form.knots.size
    if option.form.symmetric:
        return bool(curve.min() >= 0.0)
    constant = 0.5 * (curve[0] - curve[k])
    lowest = min(curve[:k].min() - constant, curve[k:].min() + constant)
    return bool(lowest >= 0.0 or ("gravity_sin" not in option.terms and curve.min() >= 0.0))


def offset_apart(choice: Choice) -> Choice:
    """Return a choice without the constant in its two curves, if that is more likely a bias torque than friction.

    The data cannot separate the two. A constant beside a gravity term is more likely a remainder of gravity. A constant that
    would make friction drive the joint cannot be friction. In both cases, the directions get the same friction at rest, and
    the constant becomes the term `offset`.
    """
    candidate = choice.candidate
    t = len(candidate.terms)
    likely = "gravity_sin" in candidate.terms or float(choice.coefficients[t:].min()) < 0.0
    if candidate.form.symmetric or not likely:
        return choice
    k = candidate.form.knots.size
    row, curve = curves.constant_apart(k)
    head = np.eye(t, t + 2 * k)
    spread = np.vstack([head, np.r_[np.zeros(t), row], np.hstack([np.zeros((2 * k, t)), curve])])
    back = np.zeros((candidate.spread.shape[0], 1 + t + 2 * k))
    back[:, :t] = candidate.spread[:, :t]
    back[COLUMNS.index("offset"), t] = 1.0
    back[:, t + 1 :] = candidate.spread[:, t:]
    return replace(
        choice,
        candidate=replace(candidate, terms=(*candidate.terms, "offset"), spread=back),
        coefficients=spread @ choice.coefficients,
        covariance=spread @ choice.covariance @ spread.T,
        left_out=choice.left_out @ spread.T,
    )
