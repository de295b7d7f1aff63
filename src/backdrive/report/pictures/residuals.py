"""The model's residual against time, velocity and position; and the presliding loop."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from backdrive.identification.result import Samples
from backdrive.logs.log import Joint
from backdrive.report.pictures import canvas, sizes
from backdrive.report.pictures.canvas import Theme

AGAINST = ("time", "velocity", "position")


@dataclass(frozen=True, kw_only=True)
class Scale:
    """The common vertical range of a joint's residual pictures.

    Attributes:
        limit: half of the range [N.m or N].
        beyond: number of samples outside it.
        worst: the largest magnitude [N.m or N].
    """

    limit: float
    beyond: int
    worst: float


def common_scale(samples: Samples) -> Scale:
    """Return a range that shows all samples, or, where a few lie far off, all but those."""
    size = np.abs(samples.residual)
    size = size[np.isfinite(size)]
    if not size.size or not size.max():
        return Scale(limit=1.0, beyond=0, worst=0.0)
    worst, usual = float(size.max()), float(np.percentile(size, 95.0))
    limit = 1.06 * worst if worst <= 4.0 * usual or not usual else 3.0 * usual
    return Scale(limit=limit, beyond=int(np.count_nonzero(size > limit)), worst=worst)


def clock(time: np.ndarray) -> tuple[np.ndarray, bool]:
    """Return the time axis of a picture and whether logs were laid end to end.

    The samples of several logs are concatenated, each with its own clock. If the clocks overlap, the logs are drawn one after
    the other. Pieces of one log, which do not overlap, keep their time.
    """
    if time.size < 2:
        return time - (time[0] if time.size else 0.0), False
    starts = np.concatenate([[0], np.flatnonzero(np.diff(time) < 0) + 1, [time.size]])
    pieces = [(time[a], time[b - 1]) for a, b in zip(starts[:-1], starts[1:], strict=False)]
    ordered = sorted(pieces)
    if all(before[1] <= after[0] for before, after in zip(ordered[:-1], ordered[1:], strict=False)):
        return time - np.min(time), False
    laid, offset = np.empty_like(time), 0.0
    for (first, last), a, b in zip(pieces, starts[:-1], starts[1:], strict=False):
        laid[a:b] = time[a:b] - first + offset
        offset += last - first
    return laid, True


def middle(x: np.ndarray, y: np.ndarray, bins: int = 24) -> tuple[np.ndarray, np.ndarray]:
    """Return the median of y in equal intervals of x that hold enough samples, (m,) and (m,).

    A correct model leaves this median at zero; a systematic deviation shows structure that the model lacks.
    """
    good = np.isfinite(x) & np.isfinite(y)
    x, y = x[good], y[good]
    if x.size < 4 * bins or x.min() == x.max():
        return np.empty(0), np.empty(0)
    edges = np.linspace(x.min(), x.max(), bins + 1)
    home = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, bins - 1)
    enough = [i for i in range(bins) if np.count_nonzero(home == i) >= max(8, x.size // 500)]
    centres = 0.5 * (edges[:-1] + edges[1:])
    return centres[enough], np.array([np.median(y[home == i]) for i in enough])


def draw_residual(
    axes: Any, theme: Theme, samples: Samples, joint: Joint, against: str, scale: Scale
) -> bool:
    """Draw measured minus predicted torque.

    Args:
        axes: matplotlib axes.
        theme: colours.
        samples: of the joint.
        joint: for the units.
        against: `time`, `velocity` or `position`.
        scale: the common vertical range.

    Returns:
        Whether a line of medians was drawn.
    """
    unit = {"time": "s", "velocity": f"{joint.unit}/s", "position": joint.unit}[against]
    x, note = np.asarray(getattr(samples, against), dtype=np.float64), ""
    if against == "time":
        x, laid = clock(x)
        note = ", logs end to end" if laid else ""
    finite = x[np.isfinite(x)]
    factor, unit = (1.0, unit) if against == "time" else sizes.readable(sizes.largest(x), unit)
    f_factor, f_unit = sizes.readable(scale.limit, canvas.pretty_unit(joint.torque_unit))
    residual = samples.residual
    pick = sizes.thin(samples.time.size, keep=residual)
    for fitted, color in ((True, theme.fitted), (False, theme.held_out)):
        part = pick[samples.fitted[pick] == fitted]
        ends = (-scale.limit * f_factor, scale.limit * f_factor)
        canvas.dots(
            axes, theme, x[part] * factor, residual[part] * f_factor, color, size=2.0, alpha=0.6, within=ends
        )
    axes.axhline(0.0, color=theme.muted, linewidth=0.8, zorder=3)
    median = np.empty(0)
    if against != "time":
        centre, median = middle(x, residual)
        axes.plot(centre * factor, median * f_factor, color=theme.ink, linewidth=1.5, zorder=4)
    axes.set_ylim(-scale.limit * f_factor, scale.limit * f_factor)
    if finite.size:
        left, right = float(finite.min()), float(finite.max())
        pad = 0.03 * (right - left) or 1.0
        axes.set_xlim((left - pad) * factor, (right + pad) * factor)
    canvas.name_axes(axes, theme, x=f"{against} [{unit}]{note}", y=f"residual [{f_unit}]")
    return bool(median.size)


def draw_presliding(axes: Any, theme: Theme, loop: np.ndarray, joint: Joint, most: int = 1500) -> None:
    """Draw the torque of a ramp against the small displacement before the joint slides.

    Args:
        axes: matplotlib axes.
        theme: colours.
        loop: displacement [rad or m] and torque [N.m or N] in the order of time, (n, 2).
        joint: for the units.
        most: points at most.
    """
    loop = loop[np.all(np.isfinite(loop), axis=1)]
    loop = loop[sizes.thin(len(loop), most)]
    x_factor, x_unit = sizes.readable(sizes.largest(loop[:, 0]), joint.unit)
    f_factor, f_unit = sizes.readable(sizes.largest(loop[:, 1]), canvas.pretty_unit(joint.torque_unit))
    axes.plot(loop[:, 0] * x_factor, loop[:, 1] * f_factor, color=theme.fitted, linewidth=1.4, zorder=3)
    canvas.zero_line(axes, theme)
    word = "torque" if joint.unit == "rad" else "force"
    canvas.name_axes(axes, theme, x=f"displacement [{x_unit}]", y=f"{word} [{f_unit}]")
