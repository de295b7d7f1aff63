"""The regression behind `maxwell`: stretches of play operators as columns, non-negative on a grid, then free distances."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from backdrive.engine import Lanes
from backdrive.errors import NotIdentifiable
from backdrive.laws import Coulomb, Law, MaxwellSlip

GRID = 48  # candidates of the break-away distance
MOST = 12  # elements that are chosen among when their number is not given
HELD = 0.02  # share of the torque's range from which on what never broke away is an element [-]
EXACT = 1e-6  # of the torque: what is below counts as explained [-]
NEGLIGIBLE = 1e-4  # share of the torque below which an element is left out [-]
PATIENCE = 3  # numbers of elements that may be worse before the search for a better one ends


def stretches(position: np.ndarray, breakaway: np.ndarray, start: float = 0.0) -> np.ndarray:
    """Return the stretch of elements along a motion, by the Maxwell-slip law at stiffness 1.

    Args:
        position: q [rad or m], (n,).
        breakaway: Delta_i [rad or m], (N,).
        start: stretch at the start, in units of Delta_i: 0 relaxed, 1 or -1 slipping [-].

    Returns:
        s_i [rad or m], (n, N).
    """
    lanes = Lanes(
        [Law(rate=Coulomb(coulomb=d), element=MaxwellSlip(stiffness=(1.0,), share=(1.0,))) for d in breakaway]
    )
    state = np.zeros((len(breakaway), lanes.states))
    state[:, 0] = start * np.asarray(breakaway)
    dp = np.diff(position, prepend=position[:1])[None]
    return lanes.torque(np.zeros(len(breakaway), dtype=np.int64), dp, 1.0, state=state, workers=1).T


@dataclass(frozen=True)
class Found:
    """A fit with a number of elements: k, Delta, then the straight line and the offset, with their covariance."""

    k: np.ndarray
    d: np.ndarray
    line: float | None
    offset: float
    cov: np.ndarray
    power: float
    worth: float  # samples that independent noise would have given
    samples: int


class Fit:
    """The regression: columns of stretches, one of the position for what never breaks away, and an offset."""

    def __init__(self, q: np.ndarray, y: np.ndarray, use: np.ndarray, offset: bool):
        self.q, self.use, self.y, self.offset = q, use, y[use], offset
        self.line = (q - q[0])[use]

    def _centred(self, x: np.ndarray) -> np.ndarray:
        return x - x.mean(axis=0) if self.offset else x

    def nonnegative(self, grid: np.ndarray, line: bool) -> np.ndarray:
        """Return k >= 0 on a grid of distances, and of the straight line."""
        from scipy.optimize import nnls

        X = stretches(self.q, grid)[self.use]
        X = np.column_stack([X, self.line]) if line else X
        _, R = np.linalg.qr(self._centred(np.column_stack([X, self.y])))
        A, b = np.split(R, [R.shape[1] - 1], axis=1)
        scale = np.maximum(np.linalg.norm(A, axis=0), 1e-300)
        return nnls(A / scale, b[:, 0], maxiter=50 * scale.size)[0] / scale

    def straight(self, spread: float, relaxed: bool) -> bool:
        """Return whether something never breaks away: a straight line beside the elements that counts."""
        top = max(float(np.ptp(self.line)), 1e-300) * (1.0 if relaxed else 0.49)
        k = self.nonnegative(np.geomspace(1e-2 * top, 0.98 * top, 24), True)
        return bool(k[-1] * np.ptp(self.line) > HELD * spread)

    def _columns(self, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return stretches and how they change with the distances: the sign at the last slip, 0 before the first."""
        if d.size == 0:
            return np.empty((self.y.size, 0)), np.empty((self.y.size, 0))
        s = stretches(self.q, d)
        slips = np.abs(s) >= d * (1.0 - 1e-12)
        last = np.maximum.accumulate(np.where(slips, np.arange(len(s))[:, None], -1), axis=0)
        signs = np.where(last >= 0, np.sign(np.take_along_axis(s, np.maximum(last, 0), axis=0)), 0.0)
        return s[self.use], signs[self.use]

    def refined(self, k: np.ndarray, d: np.ndarray, line: bool, low: float, top: float) -> Found:
        """Set the distances free, from a merged fit on the grid; line and offset follow linearly."""
        from scipy.optimize import least_squares

        n = k.size
        tail = np.column_stack(
            [self.line] * line + [np.ones(self.y.size)] * self.offset or [self.line[:, None][:, :0]]
        )
        Q, R = np.linalg.qr(tail)
        begin = np.log(np.concatenate([k, np.clip(d, low, top)]))
        kept: dict[bytes, tuple] = {}

        def solved(p):
            if p.tobytes() not in kept:
                kk, dd = np.exp(p[:n]), np.exp(p[n:])
                s, ds = self._columns(dd)
                r, J = self.y - s @ kk, np.hstack([s * kk, ds * (kk * dd)])
                kept.clear()
                kept[p.tobytes()] = (r - Q @ (Q.T @ r), Q @ (Q.T @ J) - J, kk, dd, s, ds, Q.T @ r)
            return kept[p.tobytes()]

        if n:
            lower = np.concatenate([begin[:n] - 20.0, np.full(n, np.log(low) - 1e-9)])
            upper = np.concatenate([begin[:n] + 7.0, np.full(n, np.log(top) + 1e-9)])
            begin = least_squares(
                lambda p: solved(p)[0],
                begin,
                jac=lambda p: solved(p)[1],  # type: ignore[arg-type]
                bounds=(lower, upper),
                x_scale="jac",
                max_nfev=40,
            ).x
        r, _, kk, dd, s, ds, turned = solved(begin)
        linear = np.linalg.solve(R, turned) if tail.shape[1] else np.zeros(1)
        if line and n and linear[0] <= 0.0:
            return self.refined(k, d, False, low, top)
        total = float(kk @ dd) + (float(linear[0]) * top if line else 0.0)
        weak = kk * dd < NEGLIGIBLE * total
        if np.any(weak) and (line or not np.all(weak)):
            return self.refined(kk[~weak], dd[~weak], line, low, top)
        order = np.argsort(dd)
        kk, dd, s, ds = kk[order], dd[order], s[:, order], ds[:, order]
        cov, worth = _sandwich(np.hstack([s, ds * kk, tail]), r)
        return Found(
            k=kk,
            d=dd,
            line=float(linear[0]) if line else None,
            offset=float(linear[-1]) if self.offset else 0.0,
            cov=cov,
            power=max(float(r @ r), EXACT**2 * float(self.y @ self.y)),
            worth=worth,
            samples=r.size,
        )


def _sandwich(X: np.ndarray, r: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the covariance of least squares under correlated noise, and how many independent samples it is worth."""
    n, p = X.shape
    scale = np.linalg.norm(X, axis=0)
    scale[scale == 0.0] = 1.0
    Z = X / scale
    scores = Z * r[:, None]
    power = np.maximum(np.sum(scores**2, axis=0), 1e-300)
    rho = np.clip(np.sum(scores[1:] * scores[:-1], axis=0) / power, -0.97, 0.999)
    weight = power**2
    top = np.sum(weight * 4.0 * rho**2 / ((1.0 - rho) ** 6 * (1.0 + rho) ** 2))
    alpha = top / np.sum(weight / (1.0 - rho) ** 4)
    lag = int(min(1.1447 * (alpha * n) ** (1.0 / 3.0), n // 5))
    meat = scores.T @ scores
    for i in range(1, lag + 1):
        part = scores[i:].T @ scores[:-i]
        meat += (1.0 - i / (lag + 1.0)) * (part + part.T)
    bread = np.linalg.pinv(Z.T @ Z, rcond=1e-12, hermitian=True)
    cov = bread @ meat @ bread * n / max(n - p, 1)
    now = float(r @ r)
    auto = now
    for i in range(1, lag + 1):
        auto += 2.0 * (1.0 - i / (lag + 1.0)) * float(r[i:] @ r[:-i])
    worth = n * now / auto if auto > now > 0.0 else float(n)
    return cov / scale / scale[:, None], max(worth, 5.0)


def _merged(k: np.ndarray, d: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Merge neighbours, the pair first that bends the virgin curve least, until n are left; torque and stiffness stay."""
    k, d = k[k > 0.0], d[k > 0.0]
    while k.size > n:
        bend = k[1:] * k[:-1] / (k[1:] + k[:-1]) * np.diff(d)
        i = int(np.argmin(bend))
        both = k[i] + k[i + 1]
        d[i] = (k[i] * d[i] + k[i + 1] * d[i + 1]) / both
        k[i] = both
        k, d = np.delete(k, i + 1), np.delete(d, i + 1)
    return k, d


def choose(fit: Fit, grid, k, low: float, top: float, line: bool, wanted: int | None) -> Found:
    """Return the fit with the number of elements wanted, or that Schwarz' criterion prefers."""
    seen = int(np.sum(k > 0.0))
    if seen == 0 and not line:
        raise NotIdentifiable(
            "The torque does not resist the motion.", remedy="Check the sign of torque and position."
        )
    if seen == 0:
        return fit.refined(np.array([]), np.array([]), True, low, top)
    if wanted is not None:
        n = max(wanted - int(line), 1)
        return fit.refined(*_merged(k, grid, n), line, low, top)
    largest = min(seen, MOST)
    tries = {largest: fit.refined(*_merged(k, grid, largest), line, low, top)}
    worth, best, least = tries[largest].worth, largest, np.inf
    for n in range(1, largest + 1):
        if n not in tries:
            tries[n] = fit.refined(*_merged(k, grid, n), line, low, top)
        score = worth * np.log(tries[n].power) + 2 * tries[n].k.size * np.log(worth)
        if score < least:
            best, least = n, score
        elif n >= best + PATIENCE:
            break
    return tries[best]
