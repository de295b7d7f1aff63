"""Torque of one joint and the terms that explain it, with the same filter, for checks of the torque.

The terms are made from lightly smoothed motion; then they and the torque pass the same three running means. This keeps linear
relations between them, and removes the noise of the torque.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from backdrive.logs.filters import deflections
from backdrive.logs.health._exam import Exam, once
from backdrive.logs.quantiles import quantile
from backdrive.logs.resolution import white_noise

#: Length of each running mean, and the fewest samples: before the terms are made, and after.
_LIGHT, _HEAVY, _FEWEST = 0.01, 0.03, 3
_FOLDS = 12
_EVEN = 1e-9  # range of the intervals below which they differ by rounding only [interval]
#: Most other joints whose accelerations are terms; with all of many, the cost would grow with the square of their number.
_OTHERS = 12
#: Below this share of the top speed, presliding and frictional lag dominate the friction.
SLOW = 0.1


@dataclass(frozen=True, eq=False)
class Motion:
    """A joint's torque and motion at m instants.

    Attributes:
        terms: acceleration, sign of velocity, velocity, one, and position (as sine and cosine where it is wide);
            then what only some questions need: velocity times its magnitude, the sign at low speed, and the accelerations
            of `others`, (m, p).
        plain: number of columns up to and including position.
        velocity: filtered velocity [rad/s or m/s], (m,).
        torque: filtered torque, column by column `shifts` samples later [N.m or N], (m, k).
        shifts: in samples, (k,).
        fast: True where the filters contain no slow motion and no reversal, (m,).
        noise: variance of the noise left in the filtered torque [(N.m)2 or N2].
        rough: variance of the noise left in its change from sample to sample, by central differences [(N.m)2 or N2].
        fold: number of the stretch of the log that each instant belongs to, (m,).
        others: columns of the other joints that accelerate; of many, those that go along with the torque most.
    """

    terms: np.ndarray
    plain: int
    velocity: np.ndarray
    torque: np.ndarray
    shifts: np.ndarray
    fast: np.ndarray
    noise: float
    rough: float
    fold: np.ndarray
    others: list[int]


@once
def motion(exam: Exam, j: int, reach: int) -> Motion | None:
    """Return a joint's torque and terms; None where torque or motion is missing or the log is too short.

    Args:
        exam: the log.
        j: column of the joint.
        reach: largest shift of torque against motion, both ways [sample].
    """
    own = _path(exam, j)
    if own is None or not exam.usable("torque", j):
        return None
    light, heavy = _widths(exam.period)
    every, shifts, skip = heavy // 2, np.arange(-reach, reach + 1), _skip(heavy)
    each, plain, top = _columns(exam, j, reach % skip, skip)
    terms, torque, fast, raws = (list[np.ndarray]() for _ in range(4))
    for number, raw in enumerate(exam.by_block("torque", j)):
        v = own[number][1]
        if not v.size:
            continue
        slow = np.concatenate([[0], np.cumsum(np.abs(v) < SLOW * top, dtype=np.int32)])
        raws.append(raw)
        smooth = running(running(raw, light), heavy)
        at = np.arange(reach, len(smooth) - reach, every)
        terms.append(sparse(each[number], heavy, reach, skip, v.size).T)
        if at.size:
            torque.append(np.lib.stride_tricks.sliding_window_view(smooth, shifts.size)[at - reach])
        fast.append(slow[at] == slow[at + 3 * heavy - 2])  # none of the samples that the means reach
    m = sum(part.shape[0] for part in terms)
    if m < 4 * _FOLDS:
        return None
    white = exam.noise("torque", j) if len(exam.blocks) == 1 else white_noise(*raws)
    columns, delayed = np.concatenate(terms), np.concatenate(torque)
    others = _other_joints(exam, j, reach, columns[:, :plain], delayed[:, reach])
    return Motion(
        terms=np.column_stack([columns, *(_pull(exam, k, reach) for k in others)]),
        plain=plain,
        velocity=columns[:, 2],
        torque=delayed,
        shifts=shifts,
        fast=np.concatenate(fast),
        noise=white**2 * _gain(light, heavy),
        rough=white**2 * _gain(light, heavy, change=True),
        fold=(np.arange(m) * _FOLDS) // m,
        others=others,
    )


@once
def _pull(exam: Exam, j: int, reach: int) -> np.ndarray:
    """Return a joint's acceleration at the instants of `motion`, as a term of other joints, (m,)."""
    path, heavy = _path(exam, j) or [], _widths(exam.period)[1]
    return np.concatenate([sparse(a[None], heavy, reach)[0] for _, _, a in path if a.size])


def _other_joints(exam: Exam, j: int, reach: int, terms: np.ndarray, torque: np.ndarray) -> list[int]:
    """Return the columns `Motion.others`, given a joint's own terms (m, p) and its torque (m,)."""
    movers = [k for k, _ in exam if _path(exam, k) is not None]
    others = np.array([k for k in movers if k != j], dtype=int)
    if others.size <= _OTHERS:
        return others.tolist()
    left = torque - terms @ np.linalg.solve(solvable(terms.T @ terms), terms.T @ torque)
    along = np.abs(_directions(exam, tuple(movers), reach) @ left)[np.array(movers) != j]
    return np.sort(others[np.argsort(along)[-_OTHERS:]]).tolist()


@once
def _directions(exam: Exam, joints: tuple[int, ...], reach: int) -> np.ndarray:
    """Return the accelerations of joints at the instants of `motion`, of unit length, (J, m)."""
    pulls = np.array([_pull(exam, k, reach) for k in joints])
    return pulls / np.maximum(np.sqrt(np.einsum("jm,jm->j", pulls, pulls)), 1e-150)[:, None]


def _columns(exam: Exam, j: int, first: int, skip: int) -> tuple[list[np.ndarray], int, float]:
    """Return a joint's own terms of `Motion` by block before the heavy means, (p, n) each, how many are plain, its top speed.

    Args:
        exam: the log.
        j: column of the joint.
        first: of each block's samples.
        skip: distance of those that are taken [sample].
    """
    own = _path(exam, j) or []
    all_q, all_v = (np.concatenate([p[k] for p in own]) for k in (0, 1))
    top = max(quantile(np.abs(all_v), 0.99), 1e-12)
    middle, span = 0.5 * float(all_q.min() + all_q.max()), float(np.ptp(all_q))
    wide = exam.log.joints[j].unit == "rad" and span > 0.5
    parts: list[np.ndarray] = []
    plain = 0
    for q, v, a in ((x[first::skip] for x in series) for series in own):
        way, size, angle = np.sign(v), np.abs(v), q - middle
        columns = [a, way, v, np.ones_like(v)]
        columns += [np.sin(angle), np.cos(angle)] if wide else [angle] if span > 0 else []
        plain = len(columns)
        columns += [v * size, way * np.exp(size / (-0.05 * top))]
        parts.append(np.array(columns))
    return parts, plain, top


def bent(exam: Exam, j: int, reach: int, widths: np.ndarray) -> np.ndarray:
    """Return the deflection of a bristle at the instants of `motion`, as a share of the distance at which it slips, (m, w).

    Args:
        exam: the log.
        j: column of the joint.
        reach: as `motion` was called with it [sample].
        widths: distances [rad or m], (w,).
    """
    heavy = _widths(exam.period)[1]
    parts: list[np.ndarray] = []
    for q, _, _ in _path(exam, j) or []:
        if not q.size:
            continue
        parts.append(sparse(deflections(q, widths).T, heavy, reach).T)
    return np.concatenate(parts)


def _widths(period: float) -> tuple[int, int]:
    """Return the odd lengths of the light and the heavy running means [sample]."""
    return max(_FEWEST, round(_LIGHT / period)) | 1, max(_FEWEST, round(_HEAVY / period)) | 1


@once
def _path(exam: Exam, j: int) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]] | None:
    """Return lightly smoothed position, velocity and acceleration of a joint by block; blocks too short for it are empty."""
    source = "position" if exam.usable("position", j) else "velocity"
    if not exam.usable(source, j) or not exam.period > 0:
        return None
    light, heavy = _widths(exam.period)
    out: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    none = np.empty(0)
    for block, x in zip(exam.blocks, exam.by_block(source, j), strict=True):
        if block.stop - block.start < 3 * (light + heavy) + 12:
            out.append((none, none, none))
            continue
        t, steps = exam.log.time[block] - exam.log.time[block.start], exam.steps[block.start : block.stop - 1]
        if source == "velocity":
            x = np.concatenate([[0.0], np.cumsum(0.5 * (x[1:] + x[:-1]) * np.diff(t))])
        q, even = running(x, light), np.ptp(steps) < _EVEN * exam.period
        s = float(t[-1]) / (t.size - 1) if even else running(t, light)
        v = np.gradient(q, s)
        out.append((q, v, np.gradient(v, s)))
    return out if any(q.size for q, _, _ in out) else None


def running(x: np.ndarray, width: int) -> np.ndarray:
    """Return x (n, ...) after three running means of odd length `width`; 3 (width - 1) / 2 rows are lost at each end."""
    offset = x[0]  # so that rounding errors at standstill are not mistaken for motion
    x = x - offset
    for _ in range(3):
        x = _window_sums(x, width)
    x /= float(width) ** 3
    x += offset
    return x


def _window_sums(x: np.ndarray, width: int) -> np.ndarray:
    """Return the sums of an odd number of neighbouring samples, (n - width + 1, ...), from sums of 1, 2, 4, ... of them."""
    count, size = len(x) - width + 1, 2
    total, at = x[:count], 1
    while size <= width:
        x = x[: len(x) - size // 2] + x[size // 2 :]
        if width & size:
            total, at = total + x[at : at + count], at + size
        size *= 2
    return total


def sparse(x: np.ndarray, width: int, reach: int, skip: int = 1, size: int | None = None) -> np.ndarray:
    """Return what `running` makes of rows (k, n) at the instants of `motion`, (k, m): half a width apart, none within `reach` of
    the ends.

    The samples of each half width are weighted by what they count in every window that they are part of; then windows add up.

    Args:
        x: all samples of each row, or those `skip` apart from number `reach` modulo `skip` on.
        width: of each running mean [sample].
        reach: as `motion` was called with it [sample].
        skip: a divisor of half the width [sample].
        size: number of all samples; None: that of the given ones.
    """
    offset, whole = x[:, :1], _weights(width)
    # the middle of a window is three half widths from its begin, so it is among those that are taken
    weights, step, begin = whole[::skip], width // 2 // skip, reach // skip
    parts, room = -(-weights.size // step), (size or x.shape[1]) - whole.size + 1 - 2 * reach
    m = max(-(-room // (width // 2)), 0)
    held = np.empty((x.shape[0], (m + parts - 1) * step))
    reached = x[:, begin : begin + held.shape[1]]
    np.subtract(reached, offset, out=held[:, : reached.shape[1]])
    held[:, reached.shape[1] :] = 0.0
    share = np.zeros(parts * step)
    share[: weights.size] = weights / weights.sum()
    sums = (share.reshape(parts, step) @ held.reshape(-1, step).T).reshape(parts, len(x), -1)
    total = sums[0, :, :m] + offset
    for k in range(1, parts):
        total += sums[k, :, k : k + m]
    return total


@lru_cache(maxsize=16)
def _skip(width: int) -> int:
    """Return the distance of the samples that tell what three running means of a width leave, a divisor of half of it [sample].

    With a sixth of the width, what folds back is below a thousandth of what was there; a sign jumps up to half the distance early
    or late.
    """
    return max(k for k in range(1, max(width // 6, 1) + 1) if width // 2 % k == 0)


@lru_cache(maxsize=16)
def _weights(width: int) -> np.ndarray:
    """Return the weights of three running means of a width, (3 width - 2,)."""
    one = np.ones(width) / width
    return np.convolve(np.convolve(one, one), one)


@lru_cache(maxsize=16)
def _gain(*widths: int, change: bool = False) -> float:
    """Return the variance of unit white noise after the running means, or of its change from sample to sample."""
    kernel = np.ones(1)
    for width in widths:
        kernel = np.convolve(kernel, _weights(width))
    if change:
        kernel = np.convolve(kernel, [0.5, 0.0, -0.5])
    return float(kernel @ kernel)


def jackknife(estimates: np.ndarray) -> float:
    """Return the standard error of an estimate from those without one stretch of the log each, (f,)."""
    return float(np.sqrt((estimates.size - 1) / estimates.size * np.sum((estimates - estimates.mean()) ** 2)))


def normal_equations(
    x: np.ndarray, y: np.ndarray, fold: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the normal equations of y (m, k) on x (m, p) by fold: x'x (f, p, p), x'y (f, p, k), y'y (f, k).

    Args:
        x: regressor, (m, p).
        y: right-hand sides, (m, k).
        fold: that each row belongs to, ascending, (m,).
    """
    p, first = x.shape[1], np.flatnonzero(np.diff(fold, prepend=-1))
    both = np.concatenate([x, y], axis=1)
    edges = [*first.tolist(), fold.size]
    products = np.stack([x[a:b].T @ both[a:b] for a, b in zip(edges, edges[1:], strict=False)])
    return products[..., :p], products[..., p:], np.add.reduceat(y**2, first, axis=0)


def solvable(gram: np.ndarray) -> np.ndarray:
    """Return normal equations (p, p) that can be solved where terms are alike or zero, with a billionth more on the diagonal."""
    return gram + np.diag(np.maximum(1e-9 * np.diag(gram), 1e-300))
