"""The picture of docs/theory/stability.md: energy that three compensators give to a joint with elastic friction, and the bound.

python benchmarks/passivity_figure.py draws docs/figures/passivity.png.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from backdrive.report.pictures import canvas
from backdrive.report.pictures.canvas import LIGHT

F_C, K_C, ALPHA, T, PIECES = 7.0, 5e4, 20.0, 1e-3, 10  # of the thesis' Joint 0
TARGET = Path(__file__).parents[1] / "docs" / "figures" / "passivity.png"
# label, R F/F_c, K/K_c, colour
INSIDE = ("weaker and softer than friction: R F = 0.8 F_c, K = 0.8 K_c", 0.8, 0.8, LIGHT.fitted)
EARLY = ("stiffer, yields before friction: R F = 0.8 F_c, K = 2.5 K_c", 0.8, 2.5, LIGHT.held_out)
STRONG = ("stronger than friction: R F = 1.2 F_c, K = 0.8 K_c", 1.2, 0.8, "#5b3fa0")
BOUND = "bound of the energy of the first"
SYMBOLS = (
    "R F: largest torque of the compensator, K: its stiffness; F_c, K_c: torque and stiffness of friction"
)
#: Title, amplitude by the friction's stretch, frequency [Hz], pairs.
MOTIONS = (
    ("no sliding: 0.95 of the stretch, 30 Hz", 0.95, 30.0, (INSIDE, EARLY)),
    ("sliding: 20 stretches, 4 Hz", 20.0, 4.0, (INSIDE, STRONG)),
)
RANGE = (-80.0, 80.0)  # of the energy [mJ]
WIDTH, HEIGHT, LEGEND = 640.0, 330.0, 88.0  # [pt]


def energy(p: np.ndarray, share: float, stiffness: float) -> np.ndarray:
    """Return the energy that compensator, held for a tick, and friction gave by each tick [J]."""
    stretch, slider, f, given, taken, out = F_C / K_C, 0.0, 0.0, 0.0, 0.0, []
    for k in range(PIECES, p.size, PIECES):
        for i in range(k - PIECES, k):
            after = min(max(slider, p[i + 1] - stretch), p[i + 1] + stretch)
            taken += F_C * abs(after - slider)
            slider = after
        given += share * f * (p[k] - p[k - PIECES])
        bound = F_C
        f = min(max((f + stiffness * K_C * (p[k] - p[k - PIECES])) / (1.0 + T * ALPHA), -bound), bound)
        out.append(given - taken - K_C * (p[k] - slider) ** 2 / 2.0)
    return np.array(out)


def draw() -> Any:
    """Return the figure, in the style of the house."""
    t = np.arange(0.0, 1.0 + 1e-9, T / PIECES)
    time = t[PIECES::PIECES]
    first = 0.8 * F_C**2 / (0.8 * K_C)
    bound = 1e3 * (first / 2.0 + 2.0 * ALPHA * first * time)
    lines: dict[str, Any] = {}
    with canvas.house_style():
        figure = canvas.new_figure(LIGHT, WIDTH, HEIGHT)
        for i, (title, amplitude, frequency, pairs) in enumerate(MOTIONS):
            left = 48.0 + 0.5 * WIDTH * i
            box = (left, LEGEND + 40.0, 0.5 * WIDTH - 64.0, HEIGHT - LEGEND - 88.0)
            axes = canvas.axes_of(figure, LIGHT, box)
            canvas.zero_line(axes, LIGHT)
            p = F_C / K_C * amplitude * np.sin(2.0 * np.pi * frequency * t)
            for label, share, stiffness, color in pairs:
                shown = 1e3 * energy(p, share, stiffness)
                lines[label] = axes.plot(time, shown, color=color, linewidth=1.7)[0]
            style = {"color": LIGHT.ink, "linewidth": 1.2, "linestyle": canvas.DASHED}
            lines[BOUND] = axes.plot(time, bound, **style)[0]
            axes.set(xlim=(0.0, 1.0), ylim=RANGE)
            canvas.name_axes(axes, LIGHT, x="time [s]", y="energy given to the joint [mJ]")
            figure.text(
                (left - 38.0) / WIDTH,
                1.0 - 12.0 / HEIGHT,
                title,
                color=LIGHT.ink,
                fontweight="bold",
                va="center",
            )
        legend = {label: lines[label] for label in (INSIDE[0], EARLY[0], STRONG[0], BOUND)}
        small = canvas.FONT_SIZE - 1.0
        figure.legend(
            list(legend.values()),
            list(legend),
            loc="lower left",
            bbox_to_anchor=(10.0 / WIDTH, 26.0 / HEIGHT),
            frameon=False,
            labelcolor=LIGHT.ink,
            fontsize=small,
            borderpad=0,
            borderaxespad=0,
        )
        figure.text(10.0 / WIDTH, 10.0 / HEIGHT, SYMBOLS, color=LIGHT.muted, fontsize=small, va="center")
    return figure


def main() -> None:
    """Draw it."""
    with canvas.house_style():
        canvas.write(draw(), TARGET)
    print(f"wrote {TARGET}")


if __name__ == "__main__":
    main()
