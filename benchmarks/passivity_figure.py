"""The picture of docs/theory/stability.md: energy that three compensators give to a joint with elastic friction, and the bound.

python benchmarks/passivity_figure.py draws docs/figures/passivity.png.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

F_C, K_C, ALPHA, T, PIECES = 7.0, 5e4, 20.0, 1e-3, 10  # of the thesis' Joint 0
TARGET = Path(__file__).parents[1] / "docs" / "figures" / "passivity.png"
INSIDE = ("R F = 0.8 F_c, K = 0.8 K_c", 0.8, 0.8, "#1b6ca8")  # label, R F/F_c, K/K_c, colour
EARLY = ("R F = 0.8 F_c, K = 2.5 K_c: yields first", 0.8, 2.5, "#c4622d")
STRONG = ("R F = 1.2 F_c, K = 0.8 K_c: gives more", 1.2, 0.8, "#7a4a9e")
#: Title, amplitude by the friction's stretch, frequency [Hz], pairs.
MOTIONS = (
    ("within the friction's stretch: 0.95 of it, 30 Hz", 0.95, 30.0, (INSIDE, EARLY)),
    ("sliding: 20 stretches, 4 Hz", 20.0, 4.0, (INSIDE, STRONG)),
)


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


def main() -> None:
    """Draw it."""
    t = np.arange(0.0, 1.0 + 1e-9, T / PIECES)
    time = t[PIECES::PIECES]
    first = 0.8 * F_C**2 / (0.8 * K_C)
    bound = 1e3 * (first / 2.0 + 2.0 * ALPHA * first * time)
    figure, both = plt.subplots(1, 2, figsize=(8.4, 3.6), layout="constrained")
    for axes, (title, amplitude, frequency, pairs) in zip(both, MOTIONS, strict=False):
        p = F_C / K_C * amplitude * np.sin(2.0 * np.pi * frequency * t)
        for label, share, stiffness, colour in pairs:
            axes.plot(time, 1e3 * energy(p, share, stiffness), color=colour, label=label, lw=1.6)
        axes.plot(time, bound, "k--", lw=1.2, label="bound of the first")
        axes.set(xlabel="time [s]", title=title, xlim=(0.0, 1.0), ylim=(-40.0, 110.0))
        axes.title.set_size(10)
        axes.legend(frameon=False, loc="upper left", fontsize=8.5)
        axes.spines[["top", "right"]].set_visible(False)
    both[0].set_ylabel("energy given to the joint [mJ]")
    figure.savefig(TARGET, dpi=150)
    print(f"wrote {TARGET}")


if __name__ == "__main__":
    main()
