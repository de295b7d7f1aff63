"""Four signatures of a friction law in one picture: steady friction, presliding, stick-slip, frictional lag."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from backdrive._files import write_whole
from backdrive.laws import Law
from backdrive.report.pictures import _signature_data as data
from backdrive.report.pictures import canvas, sizes
from backdrive.report.pictures.canvas import Theme

WIDTH, HEIGHT = 688.0, 532.0  # [pt]
HEAD = 32.0  # above the panels, for the law's name [pt]
PANEL = WIDTH / 2.0, (HEIGHT - HEAD) / 2.0  # [pt]
LEFT, RIGHT, BELOW, ABOVE = 46.0, 14.0, 38.0, 40.0  # margins inside a panel [pt]
SMALL = canvas.FONT_SIZE - 1.5  # type of legends [pt]
SLOW, FAST = 0.005, 0.2  # mean speeds of the presliding motion by the scene's velocity
EDGE = 8.0  # where titles begin [pt]


def draw(law: Law, *, title: str = "", theme: Theme = canvas.LIGHT) -> Any:
    """Return a figure with the four signatures of a law of a rotary joint.

    Top left: steady torque at constant velocities. Top right: slow motion with nested reversals at two speeds. Bottom left: a
    mass pulled by a soft spring. Bottom right: a positive, oscillating velocity at two frequencies. Laws that depend on load
    or temperature are drawn for three values of it, at one speed and one frequency.

    Args:
        law: rate law and element with their values.
        title: bold, above; the law's name by default.
        theme: colours.

    Raises:
        MissingExtra: matplotlib is not installed.
    """
    size, cases = data.scene(law), data.conditions(law)
    with canvas.house_style():
        figure = canvas.new_figure(theme, WIDTH, HEIGHT)
        _head(figure, theme, title or law.name, _about(law, size, cases))
        _steady(figure, theme, law, cases)
        _presliding(figure, theme, law, size, cases)
        _pull(figure, theme, law, size, cases)
        _lag(figure, theme, law, size, cases)
    return figure


def picture(law: Law, kind: str, *, title: str = "", scale: float = 1.6) -> bytes:
    """Return the four signatures as the content of a `png` or `svg` file.

    Args:
        law: rate law and element with their values.
        kind: `png` or `svg`.
        title: bold, above; the law's name by default.
        scale: pixels per point of a PNG [1].

    Raises:
        MissingExtra: matplotlib is not installed.
        InvalidInput: another kind.
    """
    figure = draw(law, title=title)
    with canvas.house_style():
        return canvas.content(figure, kind, scale)


def save(path: str | Path, law: Law, *, title: str = "") -> Path:
    """Write the four signatures of a law as PNG or SVG, by the file's ending; see `picture`."""
    return write_whole(path, picture(law, Path(path).name, title=title))


def _colors(theme: Theme) -> tuple[str, str, str]:
    return theme.fitted, theme.held_out, theme.truth


def _about(law: Law, size: data.Scene, cases: list[data.Condition]) -> str:
    """Return the subtitle of a law's picture and the chosen conditions."""
    if len(cases) == 1:
        return law.name
    chosen = f"presliding at {1e3 * SLOW * size.velocity:g} mrad/s, lag at {data.FREQUENCIES[-1]:g} Hz"
    if "temperature" in law.rate.NEEDS:
        motor, external = data.CARRIED
        return f"motor {motor:g}, external {external:g} N·m; {chosen}".replace("-", "\u2212")
    return f"in colour: torque of the motor, of everything else; {chosen}"


def _head(figure: Any, theme: Theme, title: str, about: str) -> None:
    """Write the law's name and, if it says more, what stands behind it."""
    bold = figure.text(
        EDGE / WIDTH,
        1.0 - 16.0 / HEIGHT,
        title,
        color=theme.ink,
        fontweight="bold",
        fontsize=canvas.FONT_SIZE + 2.0,
        va="center",
        parse_math=False,
    )
    if about != title:
        from matplotlib.text import Annotation

        figure.add_artist(
            Annotation(
                about,
                (1, 0.5),
                xycoords=bold,
                xytext=(10, 0),
                textcoords="offset points",
                color=theme.muted,
                va="center",
                parse_math=False,
            )
        )


def _panel(
    figure: Any, theme: Theme, column: int, row: int, title: str, part: tuple[float, float] = (0.0, 1.0)
) -> Any:
    """Return axes in a panel, row 0 on top; `part` is the share of its height that they take, from below."""
    left, bottom = column * PANEL[0], (1 - row) * PANEL[1]
    height = PANEL[1] - BELOW - ABOVE
    box = (
        left + LEFT,
        bottom + BELOW + part[0] * height,
        PANEL[0] - LEFT - RIGHT,
        (part[1] - part[0]) * height,
    )
    axes = canvas.axes_of(figure, theme, box)
    x, y = (left + EDGE) / WIDTH, (bottom + PANEL[1] - 8.0) / HEIGHT
    if title:
        figure.text(x, y, title, color=theme.ink, fontweight="bold", va="center", parse_math=False)
    return axes


def _key(axes: Any, theme: Theme) -> None:
    """Write a legend of the lines that have a label above the plotting area, at its right, where it covers nothing."""
    axes.legend(
        loc="lower right",
        bbox_to_anchor=(1.015, 1.0),
        ncols=len(axes.get_legend_handles_labels()[1]),
        frameon=False,
        fontsize=SMALL,
        labelcolor=theme.muted,
        handlelength=1.3,
        handletextpad=0.4,
        columnspacing=0.9,
        borderpad=0.1,
        borderaxespad=0.2,
    )


def _line(axes: Any, xy: data.Curve, color: str, label: str, width: float = 1.5, **how: Any) -> None:
    axes.plot(*xy, color=color, label=label, linewidth=width, solid_joinstyle="round", **how)


def _steady(figure: Any, theme: Theme, law: Law, cases: list[data.Condition]) -> None:
    """Draw the steady torque at constant velocities over the logarithm of the speed."""
    axes = _panel(figure, theme, 0, 0, "Steady friction")
    v, symmetric = data.speeds(law), law.rate.SYMMETRIC
    for case, color in zip(cases, _colors(theme) if len(cases) > 1 else (theme.ink,), strict=False):
        label = case.label or (law.element.NAME if symmetric else "along +q")
        _line(axes, (v, data.steady(law, v, case)), color, label)
        if not symmetric:
            label = f"{case.label} along \u2212q".strip()
            _line(axes, (v, -data.steady(law, -v, case)), color, label, 1.3, linestyle=canvas.DASHED)
    if not law.element.STEADY:
        _line(axes, (v, law.torque(v)), theme.muted, "rate law alone", 1.2, linestyle=(0, (1.2, 1.8)))
    axes.set_xscale("log")
    axes.set_ylim(bottom=0.0)
    axes.set_ylim(top=1.06 * axes.get_ylim()[1])
    _name(axes, theme, "speed [rad/s]", "friction [N·m]", log=True)
    if len(axes.get_lines()) > 1:
        _key(axes, theme)


def _presliding(figure: Any, theme: Theme, law: Law, size: data.Scene, cases: list[data.Condition]) -> None:
    """Torque over position along nested reversals."""
    axes = _panel(figure, theme, 1, 0, "Presliding with reversals")
    reach = max(abs(turn) for turn in data.TURNS) * size.stretch
    factor, unit = sizes.readable(reach, "rad")
    if len(cases) > 1:
        runs = [(c, SLOW, c.label, color, 1.5) for c, color in zip(cases, _colors(theme), strict=False)]
    else:
        slow, fast = (f"{s * size.velocity * 1e3:g} mrad/s" for s in (SLOW, FAST))
        runs = [(cases[0], SLOW, slow, theme.fitted, 2.8), (cases[0], FAST, fast, theme.held_out, 1.1)]
    for case, speed, label, color, width in runs:
        position, torque = data.presliding(law, speed * size.velocity, case)
        _line(axes, (position * factor, torque), color, label, width)
    canvas.zero_line(axes, theme)
    _name(axes, theme, f"position [{unit}]", "friction [N·m]")
    _key(axes, theme)


def _pull(figure: Any, theme: Theme, law: Law, size: data.Scene, cases: list[data.Condition]) -> None:
    """Torque of the spring and position of the mass over time."""
    title = f"{data.INERTIA:g} kg·m² pulled through {size.spring:g} N·m/rad at {1e3 * size.speed:g} mrad/s"
    upper = _panel(figure, theme, 0, 1, title, (0.56, 1.0))
    lower = _panel(figure, theme, 0, 1, "", (0.0, 0.4))
    factor, unit = sizes.readable(size.speed * size.duration, "rad")
    time, end = data.spring_end(law)
    for case, color in zip(cases, _colors(theme) if len(cases) > 1 else (theme.fitted,), strict=False):
        position = data.pull(law, case)
        _line(upper, (time, size.spring * (end - position)), color, case.label, 1.3)
        _line(lower, (time, position * factor), color, "" if len(cases) > 1 else "mass", 1.3)
    _line(lower, (time, end * factor), theme.muted, "spring's end", 1.1, linestyle=canvas.DASHED)
    upper.set_ylim(bottom=min(0.0, upper.get_ylim()[0]))
    for axes in (upper, lower):
        axes.set_xlim(0.0, size.duration)
    _name(upper, theme, "", "spring [N·m]", few=True)
    _name(lower, theme, "time [s]", f"position [{unit}]", few=True)
    canvas.hide_labels(upper)
    _key(lower, theme)
    if len(cases) > 1:
        _key(upper, theme)


def _lag(figure: Any, theme: Theme, law: Law, size: data.Scene, cases: list[data.Condition]) -> None:
    """Draw torque over a positive, oscillating velocity, on the steady curve."""
    axes = _panel(figure, theme, 1, 1, "Frictional lag")
    if len(cases) > 1:
        for case, color in zip(cases, _colors(theme), strict=False):
            _line(axes, data.lag(law, data.FREQUENCIES[-1], case), color, case.label, 1.3)
    else:
        v = size.velocity * np.linspace(0.1, 2.1, 81)
        _line(axes, (v, data.steady(law, v, cases[0])), theme.ink, "steady", 4.0, alpha=0.25)
        for frequency, color in zip(data.FREQUENCIES, (theme.fitted, theme.held_out), strict=False):
            _line(axes, data.lag(law, frequency, cases[0]), color, f"{frequency:g} Hz", 1.4)
    low, high = axes.get_ylim()
    least = 0.2 * max(abs(low), abs(high))  # a curve that is nearly level is drawn nearly level
    if high - low < least:
        axes.set_ylim(0.5 * (low + high - least), 0.5 * (low + high + least))
    _name(axes, theme, "velocity [rad/s]", "friction [N·m]")
    _key(axes, theme)


def _name(axes: Any, theme: Theme, x: str, y: str, *, log: bool = False, few: bool = False) -> None:
    """Write the axes' names and choose their ticks."""
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter, NullLocator

    canvas.name_axes(axes, theme, x=x, y=y)
    if few:
        axes.yaxis.set_major_locator(MaxNLocator(3, steps=[1, 2, 2.5, 5, 10]))
    if log:
        plain: Callable[[float, int], str] = lambda value, _: f"{value:g}"  # noqa: E731
        axes.xaxis.set_major_locator(LogLocator(10.0))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.xaxis.set_major_formatter(FuncFormatter(plain))
