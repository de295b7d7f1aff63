"""The clock of a log: its stretches without a gap, and the even instants of each."""

from __future__ import annotations

import numpy as np

from backdrive.logs.log import Log

GAP = 3.5  # sampling interval above which there is a gap, without interpolation across it [period]
EVEN = 1e-6  # largest deviation of a clock that is taken as it is [sampling interval]
SMOOTHER = 0.25  # largest roughness of a motion at even instants, relative to that at its stamps, for which these are late [-]
LOST = 0.6  # distance from all stamps at which an instant has no sample of its own [sampling interval]
LATEST = 2.0  # largest error of stamps about even instants, and interval: more is a lost sample [sampling interval]


def between_gaps(time: np.ndarray, period: float, least: int) -> list[slice]:
    """Return the stretches without a gap.

    Args:
        time: instants [s], (n,).
        period: sampling interval [s].
        least: samples that a stretch must have.
    """
    cuts = np.flatnonzero(np.diff(time) > GAP * period) + 1
    bounds = [0, *cuts.tolist(), time.size]
    return [slice(a, b) for a, b in zip(bounds, bounds[1:], strict=False) if b - a >= least]


def uniform(log: Log, period: float) -> tuple[np.ndarray, Log]:
    """Return a uniform clock, and the log interpolated onto it if its own clock is not uniform.

    Stamps that vary about even instants may be those of the samples, or only late: which of them shows in the motion. Which
    instants got no sample of their own, `holes` tells.
    """
    n = round(log.duration / period) + 1
    clock = log.time[0] + period * np.arange(n)
    if n == len(log) and (off := float(np.max(np.abs(clock - log.time)))) < 0.05 * period:
        return log.time if off < EVEN * period else clock, log
    even = np.linspace(log.time[0], log.time[-1], len(log))
    longest = max(float(np.max(np.abs(even - log.time))), float(np.max(np.diff(log.time))))
    if longest < LATEST * period and stamps_vary_alone(log, even):
        return even, log.replace(time=even)
    channels = {k: _between(k, log.time, v[:, 0], clock)[:, None] for k, v in log.channels.items()}
    return clock, log.replace(time=clock, wrench=None, **channels)


def _between(name: str, time: np.ndarray, x: np.ndarray, clock: np.ndarray) -> np.ndarray:
    """Return a channel at the instants of a clock; a position on a cubic, since a chord has no acceleration but at its ends."""
    if name != "position" or not (np.diff(time) > 0.0).all():
        return np.interp(clock, time, x)
    from scipy.interpolate import CubicSpline

    return CubicSpline(time, x)(clock)


def holes(log: Log, clock: np.ndarray, period: float) -> np.ndarray | None:
    """Return where a clock (m,) has no sample of a log nearby, (m,); None where it has one everywhere.

    Args:
        log: that was interpolated onto the clock.
        clock: instants [s], ascending, (m,).
        period: sampling interval [s].
    """
    if clock.size == len(log):
        return None
    after = np.searchsorted(log.time, clock).clip(1, len(log) - 1)
    far = np.minimum(np.abs(log.time[after] - clock), np.abs(log.time[after - 1] - clock)) > LOST * period
    return far if far.any() else None


def stamps_vary_alone(log: Log, clock: np.ndarray) -> bool:
    """Return whether a motion is far smoother at even instants than at its stamps: the samples were even, and the stamps late.

    Args:
        log: of one joint, of as many samples as the clock.
        clock: even instants [s], (n,).
    """
    motion = log.need("velocity" if log.position is None else "position")[:, 0]
    rough = [float(np.sum(np.diff(x, 3) ** 2)) for x in (motion, np.interp(clock, log.time, motion))]
    return rough[0] < SMOOTHER * rough[1]
