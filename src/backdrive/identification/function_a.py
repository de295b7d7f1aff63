"""FunctionA: from the cycles of a sweep to velocity-friction pairs (Iwatani 2017, (2.7)), as printed and corrected.

The corrected version uses torque and velocity of the same instant and a separate mean velocity for each direction. Windows
without enough samples are left out. A regression on the variation of the torque inside the windows removes the contributions
of inertia and gravity from a window's mean. The effect of the curve's bend is removed too. See `docs/theory/sweep.md`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.identification import regression
from backdrive.identification.delay import torque_between
from backdrive.identification.noise import noise_of
from backdrive.identification.signals import Signals
from backdrive.identification.sweep_knots import MERGED, SweepKnots
from backdrive.identification.sweep_windows import Windows
from backdrive.logs.log import Log

SHARE = 0.8  # c of (2.7): samples faster than this share of a cycle's peak speed are used [-]
SHARP = 3.0  # least difference of two parabolas' curvatures at a sharp bend [standard error]
LEAST = 5  # least number of samples per window and direction


def function_a(
    time: np.ndarray,
    velocity: np.ndarray,
    torque: np.ndarray,
    windows: np.ndarray,
    top_speed: float,
    c: float = SHARE,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the pairs (V_n, F_n) exactly as Iwatani 2017, (2.7), prints them.

    Args:
        time: instants [s], (I,).
        velocity: [rad/s or m/s], (I,).
        torque: of the actuator [N.m or N], (I,).
        windows: first and last instant of each cycle [s], (N, 2).
        top_speed: V [rad/s or m/s].
        c: share of a cycle's peak speed above which samples are used [-].

    Returns:
        V_n [rad/s or m/s] and F_n [N.m or N], (N,) each; NaN where a set is empty.

    Raises:
        InvalidInput: the arrays differ in size, or c is outside [0, 1).
    """
    t, v, f = (np.asarray(x, dtype=np.float64) for x in (time, velocity, torque))
    if not (t.ndim == 1 and t.shape == v.shape == f.shape):
        raise InvalidInput(f"Shapes {t.shape}, {v.shape}, {f.shape}.", remedy="Give three arrays (I,).")
    pairs = [_level(t, v, f, w, top_speed * (n + 1) / len(windows), c) for n, w in enumerate(windows)]
    V, up, down = np.array(pairs).reshape(-1, 5)[:, :3].T
    return V, 0.5 * (up - down)


def _level(t, v, f, window, peak: float, c: float) -> tuple[float, float, float, int, int]:
    """Return V_n, F_sn+, F_sn- and the numbers of samples along +q and -q."""
    if not 0.0 <= c < 1.0:
        raise InvalidInput(f"c = {c}.", remedy="Give a share of the peak speed in [0, 1).")
    inside = (t >= window[0]) & (t < window[1])
    up, down = inside & (v >= c * peak), inside & (v <= -c * peak)
    mean = lambda x, part: float(x[part].mean()) if part.any() else np.nan  # noqa: E731
    return mean(v, up), mean(f, up), mean(f, down), int(up.sum()), int(down.sum())


def literal(log: Log, cycles: Windows, c: float = SHARE) -> SweepKnots:
    """Return the pairs as printed: backward difference of the position, torque at the same index, V_n of one direction.

    Args:
        log: of one joint, with torque.
        cycles: of the sweep.
        c: share of a cycle's peak speed above which samples are used [-].

    Returns:
        One pair per cycle, unsorted; NaN where a set is empty.
    """
    f = log.driving_torque[:, 0]
    if log.position is not None:
        v = np.diff(log.position[:, 0], prepend=log.position[0, 0]) / log.period
    else:
        v = log.velocity[:, 0]  # type: ignore[index]
    rows = [_level(log.time, v, f, w, peak, c) for w, peak in zip(cycles.time, cycles.peak, strict=True)]
    V, up, down, count_up, count_down = np.array(rows).T
    none = np.full(V.size, np.nan)
    return SweepKnots(
        V_pos=V,
        F_pos=up,
        V_neg=V,
        F_neg=-down,
        error_pos=none,
        error_neg=none,
        count_pos=count_up.astype(int),
        count_neg=count_down.astype(int),
    )


def correct_pairs(
    stretches: Sequence[Signals], cycles: Windows, *, rotary: bool, c: float = SHARE, delay: float = 0.0
) -> SweepKnots:
    """Return the pairs with velocity and torque of the same instant, corrected for inertia, gravity and the curve's bend.

    Within each window and direction, the mean of the torque and its part proportional to the velocity are removed. The
    remainder is regressed on the acceleration (inertia) and, on a rotary joint, on the position (the slope of gravity). Both
    terms may differ by direction, since friction grows with the load. Their coefficients are estimated from all windows
    together, and their contribution to the mean of a window is subtracted.

    Args:
        stretches: the log's signals, as `signals.prepare` returns them.
        cycles: of the sweep.
        rotary: whether the joint is rotary, so that gravity depends on the position.
        c: share of a cycle's peak speed above which samples are used [-].
        delay: time from a torque sample to its effect, minus half a sampling interval [s].

    Returns:
        One pair per cycle, unsorted; NaN where a direction has fewer than `LEAST` samples.
    """
    with_position = all(s.position is not None for s in stretches)
    columns = [_columns(s, delay) for s in stretches]
    x = np.concatenate(columns, axis=1)  # time, velocity, torque, acceleration, position
    groups = [
        _rows(x[0], d * x[1], w, c * peak)
        for w, peak in zip(cycles.time, cycles.peak, strict=True)
        for d in (1, -1)
    ]
    used = [g for g in groups if g.size >= LEAST]
    center = float(np.mean([x[4, g].mean() for g in used])) if used and with_position else np.nan
    terms = x[3:4] if not (rotary and with_position) else np.stack([x[3], np.sin(x[4] - center)])
    both, k = np.vstack([terms, np.sign(x[1]) * terms]), 2 * len(terms)
    inside = {}
    for g in used:
        z = _within(np.vstack([x[2], terms])[:, g], x[1, g], x[0, g])
        inside[id(g)] = np.vstack([z, np.sign(x[1, g]) * z[1:]])
    gram = sum((z[1:] @ z[1:].T for z in inside.values()), np.zeros((k, k)))
    moment = sum((z[1:] @ z[0] for z in inside.values()), np.zeros(k))
    theta = regression.solve(gram, moment)
    # the residual uses the measured acceleration, since torque and acceleration share the servo's response to noise
    noise = noise_of([x[2, g] - theta @ both[:, g] for g in used], [x[1, g] for g in used])
    spread = sum((noise.covariance(inside[id(g)][1:], i) for i, g in enumerate(used)), np.zeros((k, k)))
    errors = {
        id(g): noise.covariance(np.full((1, g.size), 1.0 / g.size), i)[0, 0] for i, g in enumerate(used)
    }
    rows = []
    for g in groups:
        if g.size < LEAST:
            rows.append((np.nan, np.nan, np.nan, g.size, np.zeros(k), np.nan))
            continue
        mean = both[:, g].mean(axis=1)
        F = x[2, g].mean() - theta @ mean
        rows.append((x[1, g].mean(), F, errors[id(g)], g.size, mean, x[1, g].var()))
    inverse = regression.invert(gram)
    covariance = inverse @ spread @ inverse
    V, F, count, variance = (np.array([row[i] for row in rows]).reshape(-1, 2) for i in (0, 1, 3, 5))
    V, F = V * (1, -1), F * (1, -1)
    error = np.sqrt([row[2] + row[4] @ covariance @ row[4] for row in rows]).reshape(-1, 2)
    for way in range(2):
        bend = np.eye(len(V)) - 0.5 * variance[:, way, None] * _curvature(V[:, way], F[:, way], error[:, way])
        known = np.isfinite(F[:, way])
        F[known, way] = bend[np.ix_(known, known)] @ F[known, way]
        error[known, way] = np.sqrt(bend[np.ix_(known, known)] ** 2 @ error[known, way] ** 2)
    deviation = np.sqrt(np.diag(covariance))
    return SweepKnots(
        V_pos=V[:, 0],
        F_pos=F[:, 0],
        V_neg=V[:, 1],
        F_neg=F[:, 1],
        error_pos=error[:, 0],
        error_neg=error[:, 1],
        count_pos=count[:, 0].astype(int),
        count_neg=count[:, 1].astype(int),
        center=center,
        level=float(np.mean([np.cos(x[4, g] - center).mean() for g in used])) if with_position else 1.0,
        inertia=(float(theta[0]), float(deviation[0])),
        slope=(float(theta[1]), float(deviation[1])) if k > 2 else (float("nan"), float("nan")),
    )


def _columns(s: Signals, delay: float) -> np.ndarray:
    position = np.full(s.time.size, np.nan) if s.position is None else s.position
    return np.stack([s.time, s.velocity, torque_between(s, delay), s.acceleration, position])[:, 1:-1]


def _rows(time: np.ndarray, velocity: np.ndarray, window: np.ndarray, least: float) -> np.ndarray:
    a, b = np.searchsorted(time, window)
    return a + np.flatnonzero(velocity[a:b] >= least)


def _curvature(V: np.ndarray, F: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Return the matrix from pairs to the curve's second derivative at each pair, (N, N).

    It is that of the parabola through the nearest five pairs, or three pairs if the curve bends too sharply for five.
    """
    result = np.zeros((V.size, V.size))
    order = np.flatnonzero(np.isfinite(F))[np.argsort(V[np.isfinite(F)])]
    n = order.size
    if n < 3 or np.any(np.diff(V[order]) < MERGED * V[order[-1]]):
        return result
    few, many = (_parabolas(V, order, width) for width in (3, min(5, n)))
    apart, noise = (few - many) @ F[order], (few - many) * error[order]
    sharp = np.abs(apart) > SHARP * np.sqrt((noise**2).sum(axis=1))
    result[np.ix_(order, order)] = np.where(sharp[:, None], few, many)
    return result


def _parabolas(V: np.ndarray, order: np.ndarray, width: int) -> np.ndarray:
    """Return the rows from sorted pairs to the second derivative of the parabola through the pairs nearest to each, (n, n).

    Args:
        V: velocities of all pairs, (N,).
        order: the pairs by velocity, (n,).
        width: number of pairs that a parabola passes.
    """
    n = order.size
    near = np.clip(np.arange(n) - width // 2, 0, n - width)[:, None] + np.arange(width)
    x = V[order][near]
    x = x - x.mean(axis=1, keepdims=True)
    size = np.ptp(x, axis=1)[:, None]
    powers = (x / size)[:, :, None] ** np.array([2, 1, 0])
    rows = np.zeros((n, n))
    np.put_along_axis(rows, near, 2.0 * np.linalg.pinv(powers)[:, 0] / size**2, axis=1)
    return rows


def _within(z: np.ndarray, v: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Return the rows z, torque, acceleration and others, without their mean and slope over velocity, (r, n).

    Near a velocity peak the acceleration is a cubic in time. Only its projection on that cubic is kept: time is the instrument
    of a two-stage regression. Noise of the twice differentiated position would otherwise bias the inertia towards zero.
    """
    v = v - v.mean()
    t = (t - t.mean()) / max(float(np.ptp(t)), 1e-300)
    z = np.vstack([z, t, t**3])
    z -= z.mean(axis=1, keepdims=True)
    z -= np.outer(z @ v, v) / max(float(v @ v), 1e-300)
    line, cubic = z[-2], z[-1]
    line /= max(float(np.sqrt(line @ line)), 1e-300)
    cubic -= (cubic @ line) * line
    cubic /= max(float(np.sqrt(cubic @ cubic)), 1e-300)
    z[1] = (z[1] @ line) * line + (z[1] @ cubic) * cubic
    return z[:-2]
