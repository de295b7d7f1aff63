"""Stiffness and break-away distribution of presliding, from slow reversals: linear least squares on Maxwell-slip elements.

    tau_f = sum k_i s_i(t) + offset,    s_i' = q' within [-Delta_i, Delta_i]

s_i: stretch of element i, a play operator of the position [rad or m]. Delta_i: distance at which it breaks away. With Delta_i
on a fixed grid this is linear in k_i >= 0 (V. Lampaert, J. Swevers, F. Al-Bender, IEEE TAC 47(4), 2002, for the elements;
D. D. Rizos, S. D. Fassois, Chaos 14(2), 2004, and IEEE TCST 17(1), 2009, for the regression and what it needs of the motion).
Neighbours on the grid are merged where that bends the virgin curve least, and their Delta_i are then set free, as in the
nonlinear regression of the same papers. On the virgin curve of a relaxed joint, k_i is the slope before less the slope after
the bend at Delta_i.

Where the start is not known to be relaxed, only samples count at which the stretch no longer depends on it: two runs, from all
elements stretched one way and all the other, have met. Standard errors allow for noise that is correlated in time (W. Newey,
K. West, Econometrica 55(3), 1987; the lag by D. Andrews, Econometrica 59(3), 1991).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.identification.dynamic._maxwell_regression import GRID, Fit, Found, choose, stretches
from backdrive.laws import GMS, Coulomb, Law, MaxwellSlip
from backdrive.logs.filters import low_pass

FEWEST = 10  # samples that anything is said from
COARSE = 5.0  # F/(K count) below which the encoder does not resolve presliding [count]
JITTER = 0.01  # noise of the position from which on it is mentioned, of the first break-away distance [-]
UNEXPLAINED = 0.2  # of the torque's variation from which on it is mentioned [-]
USED = 0.25  # of the samples at least are to count where the start is unknown [-]


@dataclass(frozen=True, kw_only=True)
class MaxwellEstimate:
    """Maxwell-slip elements as identified, the first to break away first.

    Attributes:
        stiffness: k_i [N.m/rad or N/m], (N,).
        breakaway: Delta_i [rad or m], (N,).
        share: k_i Delta_i over their sum [-], (N,).
        coulomb: sum of k_i Delta_i, friction once all slip [N.m or N]; a lower bound where `held`.
        offset: torque that is not friction [N.m or N].
        stiffness_error: standard errors of k_i [N.m/rad or N/m], (N,).
        breakaway_error: standard errors of Delta_i [rad or m], (N,); NaN for what never broke away.
        coulomb_error: standard error of `coulomb` [N.m or N].
        residual: root mean square of what is left [N.m or N].
        held: the last element never broke away for certain; its distance is what the motion reached.
        samples: how many counted.
        warnings: what to know before using it.
    """

    stiffness: tuple[float, ...]
    breakaway: tuple[float, ...]
    share: tuple[float, ...]
    coulomb: float
    offset: float
    stiffness_error: tuple[float, ...]
    breakaway_error: tuple[float, ...]
    coulomb_error: float
    residual: float
    held: bool
    samples: int
    warnings: tuple[str, ...] = ()

    def element(
        self, kind: Literal["maxwell-slip", "gms"] = "maxwell-slip", attraction: float | None = None
    ) -> MaxwellSlip | GMS:
        """Return the presliding element, to be carried by a rate law whose bound at rest is `coulomb`.

        Args:
            kind: `maxwell-slip` or `gms`.
            attraction: C of GMS, which slow reversals do not show [N.m/s or N/s].

        Raises:
            InvalidInput: another kind, or GMS without C.
        """
        if kind == "maxwell-slip":
            return MaxwellSlip(stiffness=self.stiffness, share=self.share)
        if kind != "gms" or attraction is None:
            raise InvalidInput(
                f"There is no element '{kind}' with attraction = {attraction} here.",
                remedy="Ask for 'maxwell-slip', or for 'gms' with an attraction in N.m/s.",
            )
        return GMS(stiffness=self.stiffness, share=self.share, attraction=attraction)

    def law(self) -> Law:
        """Return Coulomb friction of that size on Maxwell-slip elements."""
        return Law(
            rate=Coulomb(coulomb=self.coulomb),
            element=MaxwellSlip(stiffness=self.stiffness, share=self.share),
        )


def fit_maxwell(
    position: np.ndarray,
    torque: np.ndarray,
    *,
    dt: float,
    elements: int | None = None,
    relaxed: bool = False,
    count: float | None = None,
    reach: float | None = None,
    offset: bool = True,
    cutoff: float | None = None,
) -> MaxwellEstimate:
    """Identify Maxwell-slip elements from slow reversals.

    Args:
        position: q, [rad or m], (n,).
        torque: friction torque: what drives the joint less inertia and gravity [N.m or N], (n,). NaN: not measured.
        dt: sampling time [s].
        elements: N; None: as many as the noise bears out, 12 at most.
        relaxed: the elements are relaxed at the first sample, as after a decaying vibration.
        count: encoder step [rad or m]; None: judged from the position.
        reach: largest break-away distance to consider [rad or m]; None: as far as the motion shows.
        offset: a constant torque is part of the measurement.
        cutoff: corner of a low pass on the position, for positions that are noisier than their steps [Hz].

    Returns:
        The elements, with standard errors and warnings.

    Raises:
        InvalidInput: shapes do not match, or a position is not finite.
        NotIdentifiable: too few samples, or neither position nor torque changes.
    """
    q, y = _checked(position, torque, dt, elements)
    count = _count(q) if count is None else count
    if cutoff is not None:
        q = low_pass(q, cutoff, 1.0 / dt)
    said: list[str] = []
    use, top, relaxed = _window(q, relaxed, said)
    use = use & np.isfinite(y)
    if not np.all(np.isfinite(y)):
        said.append(f"{np.sum(~np.isfinite(y))} torques are not finite and were left out.")
    if np.sum(use) < FEWEST:
        raise NotIdentifiable(
            f"Only {np.sum(use)} samples say anything.", remedy="Record more reversals, or start relaxed."
        )
    top = top if reach is None else min(reach, top)
    moved = np.abs(np.diff(q))
    step = float(np.median(moved[moved > 0.0])) if count == 0.0 else 0.0
    low = min(max(3.0 * count, 2.0 * step, 1e-3 * top), 0.5 * top)
    grid = np.geomspace(low, 0.98 * top, GRID)
    fit = Fit(q, y, use, offset)
    spread = float(np.ptp(y[use]))
    free = fit.straight(spread, relaxed)
    k = fit.nonnegative(grid, free)
    found = choose(fit, grid, k[:GRID], low, top, free, elements)
    if elements is not None and found.k.size + (found.line is not None) < elements:
        said.append(f"The data bear out fewer elements than the {elements} asked for.")
    left = float(np.sqrt(found.power) / np.linalg.norm(y[use] - np.mean(y[use])))
    if left > UNEXPLAINED:
        said.append(f"{left:.0%} of the torque is not explained by presliding: is it friction alone?")
    return _estimate(found, q, top, count, low, said)


def _checked(position, torque, dt: float, elements: int | None) -> tuple[np.ndarray, np.ndarray]:
    q, y = np.asarray(position, dtype=np.float64), np.asarray(torque, dtype=np.float64)
    if q.ndim != 1 or q.shape != y.shape or not 0.0 < dt < np.inf:
        raise InvalidInput(
            f"position has the shape {q.shape}, torque {y.shape}, dt = {dt} s.",
            remedy="Give one joint, samples on one clock.",
        )
    if elements is not None and not 1 <= elements <= 32:
        raise InvalidInput(f"elements = {elements}.", remedy="Give 1 to 32, or None.")
    if not np.all(np.isfinite(q)):
        raise InvalidInput(
            f"position[{int(np.argmin(np.isfinite(q)))}] is not finite.",
            remedy="Cut the log there: the elements remember every motion.",
        )
    seen = y[np.isfinite(y)]
    if seen.size < FEWEST:
        raise NotIdentifiable(
            f"{seen.size} samples are too few.", remedy=f"Give at least {FEWEST}, better 500."
        )
    if np.ptp(q) == 0.0 or np.ptp(seen) == 0.0:
        what = "position" if np.ptp(q) == 0.0 else "torque"
        raise NotIdentifiable(f"The {what} is constant.", remedy="Move the joint to and fro until it slips.")
    return q, y


def _count(q: np.ndarray) -> float:
    """Return the encoder's step as far as the positions repeat, 0 where they do not."""
    steps = np.diff(np.unique(q))
    steps = steps[steps > 1e-9 * np.ptp(q)]
    return float(np.min(steps)) if steps.size < 0.3 * q.size else 0.0


def _turns(q: np.ndarray, least: float) -> np.ndarray:
    """Return the indices of reversals between which the position moves by at least `least`."""
    found, extreme, way = [], 0, 0
    for i in range(1, q.size):
        d = q[i] - q[extreme]
        if way == 0:
            if abs(q[i] - q[0]) >= least:
                way, extreme = (1 if q[i] > q[0] else -1), i
        elif d * way >= 0.0:
            extreme = i
        elif abs(d) >= least:
            found.append(extreme)
            way, extreme = -way, i
    return np.array(found, dtype=np.int64)


def _window(q: np.ndarray, relaxed: bool, said: list[str]) -> tuple[np.ndarray, float, bool]:
    """Return which samples count, up to which distance elements can be seen to break away, and if the start is relaxed."""
    far = float(np.max(np.abs(q - q[0])))
    if relaxed:
        return np.ones(q.size, dtype=bool), max(far, 0.5 * float(np.ptp(q))), True
    top = 0.49 * float(np.ptp(q))
    ends = [stretches(q, np.array([top]), start)[:, 0] for start in (1.0, -1.0)]
    known = np.abs(ends[0] - ends[1]) <= 1e-9 * top
    if np.mean(known) >= USED:
        return known, top, False
    said.append(
        "The motion does not come back far enough to forget how it began: the joint was taken to start relaxed."
    )
    return np.ones(q.size, dtype=bool), max(far, top), True


def _estimate(found: Found, q, top, count, low, said: list[str]) -> MaxwellEstimate:
    """Return the result in words and numbers."""
    n, line = found.k.size, found.line
    k, d = (found.k, found.d) if line is None else (np.append(found.k, line), np.append(found.d, top))
    rest = np.zeros(found.cov.shape[0] - 2 * n)
    rest[: k.size - n] = top
    error = np.sqrt(np.maximum(np.diag(found.cov), 0.0))
    stiff = np.append(error[:n], error[2 * n : n + k.size])
    seen = np.append(np.where(error[n : 2 * n] > 0.0, error[n : 2 * n], np.nan), np.full(k.size - n, np.nan))
    total = float(k @ d)
    if not total > 0.0:
        raise NotIdentifiable(
            "The torque does not rise with the motion.", remedy="Check the sign of torque and position."
        )
    slope = np.concatenate([found.d, found.k, rest])
    estimate = MaxwellEstimate(
        stiffness=tuple(k.tolist()),
        breakaway=tuple(d.tolist()),
        share=tuple((k * d / total).tolist()),
        coulomb=total,
        offset=found.offset,
        stiffness_error=tuple(stiff.tolist()),
        breakaway_error=tuple(seen.tolist()),
        coulomb_error=float(np.sqrt(max(slope @ found.cov @ slope, 0.0))),
        residual=float(np.sqrt(found.power / found.samples)),
        held=bool(d[-1] > 0.95 * top),
        samples=found.samples,
    )
    return replace(estimate, warnings=(*said, *_warnings(estimate, q, top, count, low)))


def _warnings(found: MaxwellEstimate, q, top: float, count: float, low: float) -> list[str]:
    """Return what the motion did not show."""
    said = []
    if found.held:
        said.append(
            f"The motion never reached break-away: {found.share[-1]:.0%} of the torque still grew with the distance at "
            f"{top:.3g}, so the Coulomb torque is at least {found.coulomb:.3g} (or the torque depends on the position)."
        )
    if found.breakaway[0] < 1.05 * low:
        said.append(
            f"The first element breaks away below what is resolved ({low:.3g}): its stiffness is a lower bound."
        )
    counts = found.coulomb / (sum(found.stiffness) * count) if count > 0.0 else np.inf
    if counts < COARSE:
        said.append(
            f"The encoder is too coarse: the joint yields by F/K = {counts:.1f} counts before it slips, at least "
            f"{COARSE:g} are needed. The stiffnesses are little more than lower bounds."
        )
    jitter = float(np.median(np.abs(np.diff(q, 2)))) / 1.65  # standard deviation of white noise
    if jitter > JITTER * found.breakaway[0]:
        said.append(
            f"The position jitters by {jitter:.2g} from sample to sample, which eats into the stretch of an element that slips "
            f"at {found.breakaway[0]:.2g}: give a cutoff to smooth it."
        )
    turns = _turns(q, max(4.0 * count, 0.02 * float(np.ptp(q))))
    strokes = np.abs(np.diff(q[turns]))
    if turns.size == 0:
        said.append(
            "There is no reversal: only the virgin curve is seen, and nothing tells friction from a spring."
        )
    elif strokes.size < 2 or np.ptp(strokes) < 0.1 * np.max(strokes):
        stroke = float(np.max(strokes)) if strokes.size else float(np.ptp(q))
        said.append(
            f"All reversals are {stroke:.3g} apart: the distribution rests on the shape of one loop. Whether smaller motions "
            "follow it, inside the loop, is not seen; reverse at several amplitudes."
        )
    if found.samples < 20 * len(found.stiffness):
        said.append(f"{found.samples} samples are few for {len(found.stiffness)} elements: errors are rough.")
    if np.any(np.array(found.stiffness_error) > 0.5 * np.array(found.stiffness)):
        said.append("Some stiffnesses are known to 50 % at best: fewer elements would say as much.")
    return said
