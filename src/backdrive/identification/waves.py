"""Sine and cosine of many wave numbers over the same positions."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

AT_ONCE = 16  # wave numbers that are evaluated together
FITS = 500_000  # largest product of these and the positions; more is slow


def waves_at(
    position: np.ndarray, first: float, step: float, count: int
) -> Iterator[tuple[slice, np.ndarray, np.ndarray]]:
    """Yield slices of equally spaced wave numbers with sine and cosine of each wave, (w, n), valid until the next are taken.

    Each wave is the one before turned by the same angle, since sine and cosine take long.

    Args:
        position: [rad or m], (n,).
        first: wave number [rad/rad or rad/m].
        step: distance of the wave numbers.
        count: of the wave numbers.
    """
    size = min(count, AT_ONCE, max(FITS // position.size, 2))
    sine, cosine = np.empty((2, size, position.size))
    sine[0], cosine[0] = np.sin(first * position), np.cos(first * position)
    begun, turn = 1, (np.sin(step * position), np.cos(step * position))
    while begun < size:  # twice as many each time
        more = min(begun, size - begun)
        into = slice(begun, begun + more)
        sine[into] = sine[:more] * turn[1] + cosine[:more] * turn[0]
        cosine[into] = cosine[:more] * turn[1] - sine[:more] * turn[0]
        turn, begun = (2.0 * turn[0] * turn[1], turn[1] ** 2 - turn[0] ** 2), begun + more
    if size < count:
        turn = np.sin(size * step * position), np.cos(size * step * position)
    one, other = np.empty_like(sine), np.empty_like(sine)
    for at in range(0, count, size):
        rows = slice(at, min(at + size, count))
        if at:
            np.multiply(cosine, turn[0], out=one)
            np.multiply(sine, turn[0], out=other)
            sine *= turn[1]
            cosine *= turn[1]
            sine += one
            cosine -= other
        yield rows, sine[: rows.stop - at], cosine[: rows.stop - at]


def sums_by_place(position: np.ndarray, series: np.ndarray, width: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean positions of those that lie in the same interval, (m,), and the sums of their rows, (m, k).

    Args:
        position: [rad or m], (n,).
        series: a row for each position, (n, k).
        width: of the intervals [rad or m].
    """
    low = float(position.min())
    if not np.ptp(position) < width * min(position.size, np.iinfo(np.uint16).max):
        return position, series  # as many intervals as positions
    place = ((position - low) / width).astype(np.uint16)  # sorted by their digits
    order = np.argsort(place, kind="stable")
    first = np.flatnonzero(np.diff(place[order], prepend=-1))
    count = np.diff(first, append=place.size)
    return np.add.reduceat(position[order], first) / count, np.add.reduceat(series[order], first, axis=0)
