"""Measured and predicted torque over time: the whole log as a strip, and below it an enlarged part."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.identification.result import Samples
from backdrive.logs.log import Joint
from backdrive.report.pictures import canvas, sizes
from backdrive.report.pictures.canvas import Theme
from backdrive.report.pictures.residuals import clock

STRETCHES = 8  # of equal length, of which one is enlarged
FEWEST = 40  # samples of a stretch
BINS = 150  # of the strip, each drawn by its least and largest sample
GAP = 4.0  # steps of time from which on a line is interrupted [-]
HEIGHT = 262.0  # of the whole picture [pt]
STRIP = 44.0  # height of the strip [pt]


def has_course(samples: Samples) -> bool:
    """Return whether the samples are a time series with both torques."""
    both = np.isfinite(samples.torque) & np.isfinite(samples.predicted) & np.isfinite(samples.time)
    return int(np.count_nonzero(both)) >= FEWEST and float(np.ptp(samples.time[both])) > 0.0


def stretch_of(time: np.ndarray, residual: np.ndarray, fitted: np.ndarray) -> tuple[float, float]:
    """Return start and end of the part to enlarge: the part with the median residual, among held-out parts if there are any.

    Args:
        time: from `clock` [s], (n,).
        residual: measured minus predicted torque [N.m or N], (n,).
        fitted: False where held out, (n,).
    """
    edges = np.linspace(float(time.min()), float(time.max()), STRETCHES + 1)
    home = np.clip(np.searchsorted(edges, time, side="right") - 1, 0, STRETCHES - 1)
    held_out = [k for k in range(STRETCHES) if np.count_nonzero((home == k) & ~fitted) >= FEWEST]
    every = [k for k in range(STRETCHES) if np.count_nonzero(home == k) >= FEWEST]
    if not (held_out or every):
        return float(edges[0]), float(edges[-1])
    ordered = sorted(held_out or every, key=lambda k: float(np.nanmean(residual[home == k] ** 2)))
    k = ordered[(len(ordered) - 1) // 2]
    return float(edges[k]), float(edges[k + 1])


def _lines(time: np.ndarray, torque: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Return a line with a gap wherever the samples have one."""
    after = np.flatnonzero(np.diff(time) > step) + 1
    return np.insert(time, after, np.nan), np.insert(torque, after, np.nan)


def draw_torque(figure: Any, theme: Theme, samples: Samples, joint: Joint) -> tuple[float, float, float]:
    """Draw both torques: the strip above, the stretch below.

    Args:
        figure: an empty figure, `canvas.WIDTH` wide and `HEIGHT` high [pt].
        theme: colours.
        samples: of the joint.
        joint: for the units.

    Returns:
        Begin and end of the stretch, and the length of the whole [s].
    """
    time, laid = clock(samples.time)
    order = np.argsort(time, kind="stable")
    order = order[np.isfinite(samples.torque[order] + samples.predicted[order])]
    time, measured, predicted = time[order], samples.torque[order], samples.predicted[order]
    begin, end = stretch_of(time, measured - predicted, samples.fitted[order])
    inside = (time >= begin) & (time <= end)
    size = max(sizes.largest(measured), sizes.largest(predicted))
    factor, unit = sizes.readable(size, canvas.pretty_unit(joint.torque_unit))
    width, height = figure.get_size_inches() * 72.0
    strip = canvas.axes_of(figure, theme, (44.0, height - STRIP - 26.0, width - 54.0, STRIP))
    part = canvas.axes_of(figure, theme, (44.0, 38.0, width - 54.0, height - STRIP - 108.0))
    step = GAP * float(np.median(np.diff(time)))
    for axes, rows, widths in (
        (strip, np.ones(time.size, dtype=bool), (2.2, 0.7)),
        (part, inside, (3.2, 1.0)),
    ):
        for y, color, line in ((measured, theme.fitted, widths[0]), (predicted, theme.ink, widths[1])):
            pick = sizes.extremes(y[rows], BINS if axes is strip else 3 * BINS)
            gap = max(step, GAP * float(np.ptp(time[rows])) / BINS) if axes is strip else step
            t, f = _lines(time[rows][pick], y[rows][pick] * factor, gap)
            axes.plot(t, f, color=color, linewidth=line, zorder=3)
        canvas.zero_line(axes, theme)
    strip.axvspan(begin, end, facecolor=theme.band, alpha=0.30, linewidth=0, zorder=1)
    word = "torque" if joint.unit == "rad" else "force"
    canvas.name_axes(strip, theme, x="", y=f"{word} [{unit}], the whole")
    canvas.name_axes(
        part, theme, x=f"time [s]{', logs end to end' if laid else ''}", y=f"{word} [{unit}], the shaded part"
    )
    strip.yaxis.get_major_locator().set_params(nbins=2)
    part.set_xlim(begin, end)
    strip.set_xlim(float(time[0]), float(time[-1]))
    return begin, end, float(time[-1] - time[0])
