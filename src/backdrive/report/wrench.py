"""The section on the wrench at a frame in the report of `backdrive estimate`."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.external.wrench import COMPONENTS, UNITS, WrenchEstimate
from backdrive.report.figures import drawing, figure, key
from backdrive.report.joint import table
from backdrive.report.pictures import canvas, sizes
from backdrive.report.words import NOTHING, esc, percent, quantity

BINS = 400  # of time, of which each shows its extremes
KEYS = ("line", "bare", "curve")  # of x, y and z


def wrench_section(wrench: WrenchEstimate) -> str:
    """Return the section on a wrench: its course over time, and a table.

    Args:
        wrench: at a frame.

    Raises:
        MissingExtra: matplotlib is not installed.
    """
    error = wrench.rms_error
    heads = ["", "RMS", "Largest", "Standard deviation", *([] if error is None else ["RMS error"])]
    rows = []
    for i, (name, unit) in enumerate(zip(COMPONENTS, UNITS, strict=False)):
        series = wrench.wrench[:, i]
        cells = [
            _rms(series),
            float(series[np.abs(series).argmax()]),
            float(np.median(wrench.deviation[:, i])),
        ]
        cells += [] if error is None else [float(error[i])]
        rows.append([name, *(f'<span class="n">{quantity(x, unit)}</span>' for x in cells)])
    with canvas.house_style():
        pictures = _picture(wrench, 0, "force") + _picture(wrench, 3, "moment")
    hidden = percent(100.0 * float(np.mean(wrench.singular))) if wrench.singular.size else NOTHING
    return (
        f'<section class="joint" id="wrench"><div class="head"><h2>Wrench at <bdi>{esc(wrench.frame)}</bdi></h2></div>'
        "<p>Force and moment about the frame's origin, along the axes of the base. For "
        f"{hidden} of the time the posture, or joints at rest, make a direction unobservable; the estimate is damped along it.</p>"
        f'<div class="grid pair">{pictures}</div>'
        f"{table('By component', heads, rows)}</section>"
    )


def _picture(wrench: WrenchEstimate, first: int, what: str) -> str:
    theme, unit = canvas.CSS, canvas.pretty_unit(UNITS[first])
    colours = (theme.fitted, theme.held_out, theme.ink)
    part = wrench.wrench[:, first : first + 3]

    def draw(axes: Any) -> None:
        for i in range(3):
            pick = sizes.extremes(part[:, i], BINS)
            t = wrench.time[pick] - wrench.time[0]
            axes.plot(t, part[pick, i], color=colours[i], linewidth=1.1)
        canvas.zero_line(axes, theme)
        canvas.name_axes(axes, theme, x="time from the first instant [s]", y=f"{what} [{unit}]")

    keys = "".join(key(kind, name) for kind, name in zip(KEYS, COMPONENTS[first : first + 3], strict=False))
    return figure(drawing(f"wrench-{what}", f"{what} at {wrench.frame}", draw)[0], keys)


def _rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(x**2)))
