"""Scaling of numbers for a picture: a readable unit, and no more points than are visible."""

from __future__ import annotations

import numpy as np


def largest(x: np.ndarray) -> float:
    """Return the largest finite magnitude, 0 where there is none."""
    finite = np.abs(x[np.isfinite(x)])
    return float(finite.max()) if finite.size else 0.0


_PREFIXES = ((1e6, "µ", 1e-4), (1e3, "m", 1e-2), (1.0, "", 1e4), (1e-3, "k", 1e7), (1e-6, "M", np.inf))


def readable(magnitude: float, unit: str) -> tuple[float, str]:
    """Return the factor and the prefixed unit that bring a quantity to readable size.

    Args:
        magnitude: its largest magnitude [unit].
        unit: SI, e.g. `N·m`.
    """
    if not np.isfinite(magnitude) or magnitude == 0.0:
        return 1.0, unit
    for factor, prefix, below in _PREFIXES:
        if magnitude < below:
            return factor, f"{prefix}{unit}"
    return 1.0, unit


def thin(n: int, most: int = 1500, keep: np.ndarray | None = None) -> np.ndarray:
    """Return sorted indices of at most `most` of n samples, evenly spread, with some that must stay.

    Args:
        n: number of samples.
        most: samples to keep.
        keep: an importance, (n,): the samples with the twenty largest values stay, so that thinning never hides the worst.
    """
    if n <= most:
        return np.arange(n)
    extra = np.empty(0, dtype=np.intp)
    if keep is not None:
        importance = np.where(np.isfinite(keep), np.abs(keep), -1.0)
        extra = np.argsort(-importance, kind="stable")[:20]
    return np.unique(np.concatenate([np.linspace(0, n - 1, most - extra.size).astype(np.intp), extra]))


def extremes(x: np.ndarray, bins: int) -> np.ndarray:
    """Return sorted indices of the least and the largest sample of each of many equal stretches, for a line over time.

    Args:
        x: series, (n,); NaN counts as 0.
        bins: number of stretches.
    """
    if x.size <= 2 * bins:
        return np.arange(x.size)
    edges = np.linspace(0, x.size, bins + 1).astype(np.intp)
    plain = np.nan_to_num(x)
    picked = [0, x.size - 1]
    for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=False):
        part = plain[a:b]
        picked += [a + int(part.argmin()), a + int(part.argmax())]
    return np.unique(np.array(picked, dtype=np.intp))


def outline(x: np.ndarray, y: np.ndarray, most: int, off: float = 0.15) -> np.ndarray:
    """Return sorted indices of the points through which straight lines show a smooth curve, its turning points among them.

    Where the line through two points departs too far, its farthest point is added (Ramer 1972; Douglas and Peucker 1973).

    Args:
        x: abscissae, rising [pt], (n,).
        y: ordinates [pt], (n,).
        most: number of columns; a curve that needs more than two points a column is drawn by its `extremes`.
        off: largest distance of the line from the curve [pt].
    """
    turns = np.flatnonzero(np.diff(np.sign(np.diff(y))) != 0) + 1
    kept = {0, x.size - 1, *turns.tolist()}
    ends = sorted(kept)
    open_ = list(zip(ends, ends[1:], strict=False))
    while open_ and len(kept) <= 2 * most:
        a, b = open_.pop()
        if b - a < 2:
            continue
        rise = (y[b] - y[a]) / (x[b] - x[a]) if x[b] > x[a] else 0.0
        away = np.abs(y[a : b + 1] - y[a] - rise * (x[a : b + 1] - x[a])) / np.hypot(1.0, rise)
        middle = a + int(away.argmax())
        if away[middle - a] > off:
            kept.add(middle)
            open_ += [(a, middle), (middle, b)]
    return extremes(y, most) if open_ else np.array(sorted(kept), dtype=np.intp)
