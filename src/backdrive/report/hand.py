"""The report's page on a joint moved by a hand: the force without and with compensation, and its estimate beside the sensor."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.report.figures import drawing, figure, key
from backdrive.report.pictures import canvas
from backdrive.report.words import esc, number
from backdrive.simulation.hand_demo import SHOWN, HandDemo

EVERY = 4  # ticks of which one is drawn
SIZE = canvas.WIDTH, canvas.HEIGHT  # [pt]

Line = tuple[str, str, np.ndarray, float]  # kind of key, words, ordinates (n,), width [pt]


def hand_section(demo: HandDemo) -> str:
    """Return the section: two pictures and their figures.

    Raises:
        MissingExtra: matplotlib is not installed.
    """
    unit = canvas.pretty_unit(demo.unit)
    without, with_ = demo.force
    saved = 100.0 * (1.0 - with_ / without)
    forces: list[Line] = [
        ("bare", "without compensation", demo.bare.force, 1.6),
        ("compensated", "with compensation", demo.compensated.force, 1.6),
    ]
    estimate: list[Line] = [
        ("bare", "force sensor", demo.bare.sensed, 2.6),
        ("curve", "estimated from the encoder", demo.bare.estimate, 1.0),
    ]
    with canvas.house_style():
        pictures = _picture(demo, "guided-force", "Force of the hand without and with compensation", forces)
        pictures += _picture(demo, "guided-estimate", "Force sensor and estimate from the encoder", estimate)
    return (
        '<section class="joint" id="guided"><div class="head"><h2>A hand moves the joint</h2></div>'
        f'<p class="lead">The hand needs {number(without)} {unit} (root mean square) to move the bare joint and '
        f"{number(with_)} {unit} with friction compensated: {saved:.0f} % less.</p>"
        f"<p>Without any force sensor, the hand's force is estimated from encoder and motor torque; the error of "
        f"the estimate is {100 * demo.error:.0f} % of the force.</p>{pictures}"
        f'<p class="muted">Simulated: friction beyond a transmission that yields, an encoder with counts, a hand that varies '
        f"from stroke to stroke. Compensator: {esc('algFC with dither')}, R = 0.9, Iwatani 2017, (3.27).</p></section>"
    )


def _picture(demo: HandDemo, prefix: str, label: str, lines: list[Line]) -> str:
    theme, time = canvas.CSS, demo.bare.time
    colors = {"bare": theme.held_out, "compensated": theme.fitted, "curve": theme.ink}
    drawn = np.flatnonzero(time <= SHOWN)[::EVERY]

    def draw(axes: Any) -> None:
        for kind, _, y, width in lines:
            axes.plot(time[drawn], y[drawn], color=colors[kind], linewidth=width)
        canvas.name_axes(axes, theme, x="time [s]", y=f"force of the hand [{canvas.pretty_unit(demo.unit)}]")

    keys = "".join(key(kind, words) for kind, words, *_ in lines)
    return figure(drawing(prefix, label, draw, SIZE)[0], f"{keys}{esc(label)}.")
