"""Both directions of a friction curve against speed, enlarged to show asymmetry, curvature and band."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.identification.result import Curve, Samples
from backdrive.logs.log import Joint
from backdrive.report.pictures import canvas, sizes
from backdrive.report.pictures.canvas import Theme
from backdrive.report.pictures.curve import SIGMAS

ALIKE = 1e-3  # largest relative difference of directions that are drawn as one line: less than its width [-]
REACH = 0.9  # least share of the speeds of one direction that the other reaches, to be drawn so [-]
SIDES = ((1.0, "+q"), (-1.0, "\u2212q"))


def medians(speed: np.ndarray, friction: np.ndarray, most: int = 30) -> tuple[np.ndarray, np.ndarray]:
    """Return the median speed and friction of groups of equally many samples, (m,) and (m,).

    Groups of equal size are dense where samples are dense, so that curvature at low speed is resolved. A small number of
    samples is returned unchanged.
    """
    groups = min(most, speed.size // 15)
    if groups < 5:
        return speed, friction
    order = np.argsort(speed, kind="stable")
    parts = np.array_split(order, groups)
    return np.array([np.median(speed[p]) for p in parts]), np.array([np.median(friction[p]) for p in parts])


def draw_directions(
    axes: Any,
    theme: Theme,
    curve: Curve,
    joint: Joint,
    *,
    samples: Samples | None = None,
    truth: Curve | None = None,
) -> str:
    """Draw the magnitude of friction against speed, one line a direction, or one for both where they are alike.

    Args:
        axes: matplotlib axes.
        theme: colours.
        curve: with its standard errors.
        joint: for the units.
        samples: their medians are drawn as dots.
        truth: a second curve, dashed.

    Returns:
        The meaning of the dots: `samples`, `medians of the samples`, or an empty string.
    """
    v_factor, v_unit = sizes.readable(sizes.largest(curve.velocity), f"{joint.unit}/s")
    f_factor, f_unit = sizes.readable(sizes.largest(curve.torque), canvas.pretty_unit(joint.torque_unit))
    seen, middles, ends, dotted = [], [], [], ""
    same = alike(curve)
    for sign, label in SIDES:
        speed, torque, error = _one_way(curve, sign)
        if not speed.size:
            continue
        spread = SIGMAS * np.where(np.isfinite(error), error, 0.0)
        seen += [torque - np.minimum(spread, torque.max()), torque + np.minimum(spread, torque.max())]
        forward = sign > 0
        v, f, s = speed * v_factor, torque * f_factor, spread * f_factor
        if forward or not same:
            if np.any(s > 0):
                axes.fill_between(v, f - s, f + s, color=theme.band, alpha=0.3, linewidth=0, zorder=2)
            axes.plot(v, f, color=theme.ink if forward else theme.muted, linewidth=1.7, zorder=4)
            ends += [] if same else [(f[-1], label, theme.ink if forward else theme.muted)]
        if samples is not None:
            every_v, every_f = _branch(samples, sign)
            middle_v, middle_f = medians(every_v, every_f)
            middles.append(middle_f)
            if middle_v.size:
                dotted = (
                    "medians of the samples"
                    if dotted[:1] == "m" or middle_v.size < every_v.size
                    else "samples"
                )
            circles = canvas.markers(theme, 3.8, theme.fitted, theme.fitted if forward else "")
            axes.plot(middle_v * v_factor, middle_f * f_factor, markeredgewidth=1.0, zorder=3, **circles)
        if truth is not None:
            speed, torque, _ = _one_way(truth, sign)
            seen.append(torque)
            canvas.truth_line(axes, theme, speed * v_factor, torque * f_factor)
    every = np.concatenate([np.zeros(0), *seen]) * f_factor
    if every.size:
        low, high = float(every.min()), float(every.max())
        reach = 0.4 * (
            high - low
        )  # medians of reversals, where friction is passing from one side to the other, lie far off
        near = np.clip(np.concatenate([every, *(m * f_factor for m in middles)]), low - reach, high + reach)
        low, high = float(near.min()), float(near.max())
        low = min(low, high - 0.12 * abs(high)) if high else -1.0
        pad = 0.08 * (high - low) or 1.0
        axes.set_ylim(low - pad, high + pad)
        if low - pad < 0.0:
            canvas.zero_line(axes, theme)
        _label_ends(axes, ends, high - low + 2 * pad)
    top = sizes.largest(curve.velocity) * v_factor
    axes.set_xlim(-0.02 * top, 1.09 * top)
    canvas.name_axes(axes, theme, x=f"speed [{v_unit}]", y=f"friction, magnitude [{f_unit}]")
    return dotted


def alike(curve: Curve) -> bool:
    """Return whether friction has the same magnitude in both directions, over nearly the same speeds."""
    (there, one, _), (back, other, _) = (_one_way(curve, sign) for sign, _ in SIDES)
    if not (there.size and back.size and min(there[-1], back[-1]) > REACH * max(there[-1], back[-1])):
        return False
    near = np.interp(there, back, other)
    inside = (there >= back[0]) & (there <= back[-1])
    return bool(inside.any()) and np.allclose(one[inside], near[inside], rtol=ALIKE, atol=0.0)


def _one_way(curve: Curve, sign: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    side = curve.velocity * sign > 0
    speed, torque, error = sign * curve.velocity[side], sign * curve.torque[side], curve.standard_error[side]
    return (speed, torque, error) if sign > 0 else (speed[::-1], torque[::-1], error[::-1])


def _branch(samples: Samples, sign: float) -> tuple[np.ndarray, np.ndarray]:
    good = np.isfinite(samples.velocity) & np.isfinite(samples.friction) & (samples.velocity * sign > 0)
    return sign * samples.velocity[good], sign * samples.friction[good]


def _label_ends(axes: Any, ends: list[tuple[float, str, str]], height: float) -> None:
    """Write the direction at the right end of each line, apart from one another."""
    values = [end[0] for end in ends]
    apart = 0.1 * height
    if len(values) == 2 and abs(values[0] - values[1]) < apart:
        middle, up = 0.5 * sum(values), 1.0 if values[0] >= values[1] else -1.0
        values = [middle + 0.5 * up * apart, middle - 0.5 * up * apart]
    for (_, label, color), y in zip(ends, values, strict=False):
        axes.annotate(
            label,
            (1.0, y),
            xycoords=("axes fraction", "data"),
            xytext=(-2, 0),
            textcoords="offset points",
            color=color,
            ha="right",
            va="center",
            fontweight="bold",
        )
