"""The report's page on a joint that a hand moves."""

from __future__ import annotations

from typing import Any

from backdrive.report.pictures import canvas, svg
from backdrive.report.pictures.canvas import pretty_unit
from backdrive.report.pictures.guided import draw_estimate, draw_forces
from backdrive.report.words import esc, number
from backdrive.simulation.hand_demo import GuidedDemo

LINE = '<path d="M1 5h18" stroke="var({})" stroke-width="2"/>'


def guided_section(demo: GuidedDemo) -> str:
    """Return the section: two pictures and what they say in numbers.

    Raises:
        MissingExtra: matplotlib is not installed.
    """
    unit = pretty_unit(demo.unit)
    without, with_ = demo.force
    saved = 100.0 * (1.0 - with_ / without)
    with canvas.house_style():
        pictures = [
            _picture(
                draw,
                demo,
                name,
                label,
                keys,
            )
            for draw, name, label, keys in (
                (
                    draw_forces,
                    "guided-force",
                    "Force of the hand without and with compensation",
                    (("--held-out", "without compensation"), ("--fitted", "with compensation")),
                ),
                (
                    draw_estimate,
                    "guided-estimate",
                    "Force sensor and estimate from the encoder",
                    (("--held-out", "force sensor"), ("--ink", "estimated from the encoder")),
                ),
            )
        ]
    return (
        '<section class="joint" id="guided"><div class="head"><h2>A hand moves the joint</h2></div>'
        f'<p class="lead">The hand needs {number(without)} {unit} (root mean square) to move the bare joint and '
        f"{number(with_)} {unit} with friction compensated: {saved:.0f} % less.</p>"
        f"<p>Without any force sensor, the hand's force is estimated from encoder and motor torque; what is wrong with "
        f"it is {100 * demo.error:.0f} % of the force itself.</p>{''.join(pictures)}"
        f'<p class="muted">Simulated: friction beyond a transmission that yields, an encoder with counts, a hand that varies '
        f"from stroke to stroke. Compensator: {esc('algFC with dither')}, R = 0.9, Iwatani 2017, (3.27).</p></section>"
    )


def _picture(draw: Any, demo: GuidedDemo, name: str, label: str, keys) -> str:
    figure = canvas.new_figure(canvas.CSS, 2 * canvas.WIDTH, canvas.HEIGHT)
    figure.patch.set_visible(False)
    draw(canvas.axes_of(figure, canvas.CSS), canvas.CSS, demo)
    legend = "".join(
        f'<span class="key"><svg viewBox="0 0 20 10" aria-hidden="true">{LINE.format(colour)}</svg>{esc(words)}</span> '
        for colour, words in keys
    )
    return f"<figure>{svg.inline(figure, name, label)}<figcaption>{legend}{esc(label)}.</figcaption></figure>"
