"""Picture of a motion plan: the command over time, and the parts from which the identification takes its samples."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.plans import ArmPlan, ConstantVelocity, InTurn, Sweep
from backdrive.plans.base import torque_unit
from backdrive.plans.limits import JointLimits
from backdrive.plans.stroke import SHARE
from backdrive.report.pictures import canvas, sizes
from backdrive.report.pictures.canvas import Theme
from backdrive.report.pictures.legend import corner_legend

WIDTH, PANEL, GAP = 640.0, 118.0, 34.0  # [pt]
_LEFT, _RIGHT, _TOP, _BOTTOM = 58.0, 14.0, 44.0, 40.0  # [pt]
_POINTS = 6000  # per curve, of which those are drawn that show its shape
_COLUMNS = 500  # over the width of a picture; a denser curve shows the extremes of each
_FEWEST = 50  # columns of one joint among several
_SHADE = 0.14  # opacity of the windows [-]
_NAMES = {
    "position": "position q",
    "velocity": "velocity dq",
    "acceleration": "acceleration ddq",
    "torque": "torque τ",
}
_BANDS = {  # of every other of which the window is shaded
    "sweep": "cycle",
    "constant-velocity": "run",
    "multisine": "period",
    "sine-torque": "period",
    "sawtooth-torque": "period",
    "ramp": "rise or fall",
}


def plan_figure(
    plan: Any, limits: Mapping[str, JointLimits] | None = None, theme: Theme = canvas.LIGHT
) -> Any:
    """Return a figure of a plan: position, velocity and acceleration, or torque, over time.

    Shaded bands are the windows of the plan, and thick strokes the samples that are used. Dashed lines are limits, if they are
    close enough to the motion to be seen.

    Args:
        plan: of one joint or of several in turn.
        limits: by joint name.
        theme: colours.

    Raises:
        MissingExtra: matplotlib is not installed.
        InvalidInput: joints of different units are in one plan.
    """
    if isinstance(plan, ArmPlan):
        return _arm_figure(plan, limits or {}, theme)
    single = plan.plans if isinstance(plan, InTurn) else (plan,)
    units = {one.unit for one in single}
    if len(units) > 1:
        raise InvalidInput(
            "Rotary and linear joints cannot share one picture.", remedy="Draw their plans separately."
        )
    unit = units.pop()
    panels = ("position", "velocity", "acceleration") if plan.commands == "position" else ("torque",)
    shown = {
        "position": unit,
        "velocity": f"{unit}/s",
        "acceleration": f"{unit}/s^2",
        "torque": torque_unit(unit),
    }
    tall = PANEL if len(panels) > 1 else 1.6 * PANEL
    top = _TOP + (28.0 if len(single) > 1 else 0.0)  # room for the legend and the joints' names
    height = top + _BOTTOM + len(panels) * tall + (len(panels) - 1) * GAP
    with canvas.house_style():
        figure = canvas.new_figure(theme, WIDTH, height)
        for row, panel in enumerate(panels):
            bottom = _BOTTOM + (len(panels) - 1 - row) * (tall + GAP)
            axes = canvas.axes_of(figure, theme, (_LEFT, bottom, WIDTH - _LEFT - _RIGHT, tall))
            _draw(axes, theme, plan, single, panel)
            _draw_limits(axes, theme, single, panel, limits or {})
            last = row == len(panels) - 1
            words = f"{_NAMES[panel]} [{canvas.pretty_unit(shown[panel])}]"
            canvas.name_axes(axes, theme, x="time [s]" if last else "", y=words)
            axes.set_xlim(plan.start - 0.01 * plan.duration, plan.start + 1.01 * plan.duration)
            if not last:
                canvas.hide_labels(axes)
        y = 1.0 - 12.0 / height
        figure.text(_LEFT / WIDTH, y, _title(plan, single), color=theme.ink, va="center", fontweight="bold")
        shaded = " or ".join(dict.fromkeys(_BANDS[one.kind] for one in single))
        if len(single) > 1:
            y -= 14.0 / height
        _key(figure, theme, (1.0 - _RIGHT / WIDTH, y), f"every other {shaded}")
    return figure


def _arm_figure(plan: ArmPlan, limits: Mapping[str, JointLimits], theme: Theme) -> Any:
    """Return a figure of a plan of a whole arm: every joint's position, and its speed as a share of its limit.

    The full pace and the slow part are shaded. Dashed lines are the ends of a joint's range, if they are near.
    """
    J = len(plan.joints)
    tall = 62.0
    height = _TOP + _BOTTOM + J * tall + (J - 1) * 0.4 * GAP
    t = plan.start + np.linspace(0.0, plan.duration, _POINTS)
    position = plan.position(t)
    with canvas.house_style():
        figure = canvas.new_figure(theme, WIDTH, height)
        for j, name in enumerate(plan.joints):
            bottom = _BOTTOM + (J - 1 - j) * (tall + 0.4 * GAP)
            axes = canvas.axes_of(figure, theme, (_LEFT, bottom, WIDTH - _LEFT - _RIGHT, tall))
            for begin, end in plan.windows():
                axes.axvspan(begin, end, facecolor=theme.band, alpha=_SHADE, linewidth=0, zorder=0)
            pick = _outline(t, position[:, j], plan.duration, tall)
            axes.plot(t[pick], position[pick, j], color=theme.ink, linewidth=1.2, zorder=3)
            _draw_limits(axes, theme, (plan.plan_of(name),), "position", limits)
            canvas.name_axes(axes, theme, x="time [s]" if j == J - 1 else "", y="")
            axes.set_xlim(plan.start - 0.01 * plan.duration, plan.start + 1.01 * plan.duration)
            axes.annotate(
                f"{name} [{canvas.pretty_unit(plan.units[j])}]",
                (0.0, 1.0),
                xycoords="axes fraction",
                xytext=(4, 2),
                textcoords="offset points",
                color=theme.muted,
                fontsize=canvas.FONT_SIZE - 1.5,
            )
            if j < J - 1:
                canvas.hide_labels(axes)
        y = 1.0 - 12.0 / height
        title = f"positions of {J} joints that move at once, {plan.duration:.4g} s"
        figure.text(_LEFT / WIDTH, y, title, color=theme.ink, va="center", fontweight="bold")
        _key(figure, theme, (1.0 - _RIGHT / WIDTH, y), "at full pace, then slowly")
    return figure


def picture(plan: Any, kind: str, limits: Mapping[str, JointLimits] | None = None) -> bytes:
    """Return a plan's picture as the content of a `png` or `svg` file; see `plan_figure` and `canvas.content`."""
    figure = plan_figure(plan, limits)
    with canvas.house_style():
        return canvas.content(figure, kind)


def _title(plan: Any, single: tuple[Any, ...]) -> str:
    kinds = sorted({one.kind for one in single})
    who = single[0].joint if len(single) == 1 else f"{len(single)} joints in turn"
    return f"{' and '.join(kinds)} of {who}, {plan.duration:.4g} s"


def _key(figure: Any, theme: Theme, corner: tuple[float, float], shaded: str) -> None:
    """Write a legend of the line styles that occur, and of what is shaded."""
    from matplotlib.patches import Patch

    named: dict[str, Any] = {shaded: Patch(facecolor=theme.band, alpha=_SHADE, linewidth=0)}
    for axes in figure.axes:
        for line in axes.get_lines():
            if not line.get_label().startswith("_"):
                named.setdefault(line.get_label(), line)
    corner_legend(figure, list(named.values()), list(named), corner, "center right", theme.muted)


def _draw(axes: Any, theme: Theme, plan: Any, single: tuple[Any, ...], panel: str) -> None:
    top = panel in ("position", "torque")
    for one in single:
        t = one.start + np.linspace(0.0, one.duration, _POINTS)
        t = np.unique(np.concatenate([t, one.windows().ravel()]))
        y, windows = getattr(one, panel)(t), one.windows()
        taken = _samples(one, t, y) if panel == "velocity" else None
        pick = _outline_with_edges(t, y, plan.duration, taken)
        t, y, taken = t[pick], y[pick], None if taken is None else taken[pick]
        for begin, end in windows[::2]:
            axes.axvspan(begin, end, facecolor=theme.band, alpha=_SHADE, linewidth=0, zorder=0)
        axes.plot(t, y, color=theme.ink if panel != "acceleration" else theme.muted, linewidth=1.2, zorder=3)
        if taken is not None:
            used = np.where(taken, y, np.nan)
            axes.plot(t, used, color=theme.fitted, linewidth=2.6, zorder=4, label="samples taken")
        if top and len(single) > 1:
            axes.annotate(
                one.joint,
                (one.start + 0.5 * one.duration, 1.0),
                xycoords=("data", "axes fraction"),
                xytext=(0, 22),
                textcoords="offset points",
                ha="center",
                color=theme.muted,
                fontsize=canvas.FONT_SIZE - 1.5,
            )
    low, high = axes.get_ylim()
    pad = 0.04 * (high - low)
    axes.set_ylim(low - pad, high + pad)


def _outline(t: np.ndarray, y: np.ndarray, duration: float, tall: float = PANEL) -> np.ndarray:
    """Return indices of the points of a curve y(t) that are drawn in a panel over a duration [s] and so tall [pt]."""
    wide = (WIDTH - _LEFT - _RIGHT) / duration
    columns = max(round(_COLUMNS * float(t[-1] - t[0]) / duration), _FEWEST)
    return sizes.outline(wide * t, tall / max(float(np.ptp(y)), 1e-300) * y, columns)


def _outline_with_edges(
    t: np.ndarray, y: np.ndarray, duration: float, taken: np.ndarray | None
) -> np.ndarray:
    """Return the same with the ends of the samples that are marked, (n,), if there are any."""
    edges = np.empty(0, dtype=np.intp) if taken is None else np.flatnonzero(np.diff(taken.astype(int)))
    return np.union1d(_outline(t, y, duration), np.concatenate([edges, edges + 1]))


def _samples(plan: Any, t: np.ndarray, v: np.ndarray) -> np.ndarray | None:
    """Return where the identification takes samples, (n,), or None where it takes all."""
    if not isinstance(plan, (Sweep, ConstantVelocity)):
        return None
    windows = plan.windows()
    least = SHARE * np.abs(plan.speeds if isinstance(plan, Sweep) else plan.velocities)
    home = np.clip(np.searchsorted(windows[:, 0], t, side="right") - 1, 0, len(windows) - 1)
    return (np.abs(v) >= least[home]) & (t >= windows[home, 0]) & (t <= windows[home, 1])


def _draw_limits(
    axes: Any, theme: Theme, single: tuple[Any, ...], panel: str, limits: Mapping[str, JointLimits]
) -> None:
    low, high = axes.get_ylim()
    reach = 0.6 * (high - low)
    for one in single:
        bound = limits.get(one.joint)
        if bound is None:
            continue
        both = {
            "position": (bound.lower, bound.upper),
            "velocity": (-bound.velocity, bound.velocity),
            "acceleration": (-bound.acceleration, bound.acceleration),
            "torque": (-bound.effort, bound.effort),
        }[panel]
        for value in both:
            if np.isfinite(value) and low - reach <= value <= high + reach:
                ends = (one.start, one.start + one.duration)
                axes.plot(
                    ends,
                    (value, value),
                    color=theme.held_out,
                    linewidth=1.2,
                    linestyle=(0, (5, 3)),
                    zorder=2,
                    label="limit",
                )
                low_now, high_now = axes.get_ylim()
                pad = 0.06 * (high - low)
                axes.set_ylim(min(low_now, value - pad), max(high_now, value + pad))
