"""Fig. 3.6: displacement of Setup A by dither alone, in counts of the encoder."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.experiments import Outcome
from backdrive.plots.canvas import LIGHT, house_style
from backdrive.plots.thesis import _guided_plots as own


def draw(outcome: Outcome) -> Any:
    """Return the figure: dither above, displacement below; a column a transmission."""
    with house_style():
        figure, axes = own.sheet(2, len(outcome.data), width=760.0, height=340.0, sharex=True, sharey="row")
        for column, (label, found) in zip(axes.T, outcome.data.items()):
            count, place = found["count"], found["shown"]
            column[0].plot(found["time"], found["dither"], color=LIGHT.ink, linewidth=1.2)
            column[1].plot(
                found["time"],
                found["motor"] / count,
                color=LIGHT.muted,
                linewidth=0.9,
                linestyle=own.DASHED,
                label="true",
            )
            column[1].step(
                found["time"],
                found["counts"][place],
                where="post",
                color=LIGHT.fitted,
                linewidth=1.3,
                label="encoder",
            )
            own.name(column[0], label)
            own.name(column[1], "", "time [s]")
            column[1].set_yticks(np.arange(-3, 4))
        own.name(axes[0, 0], next(iter(outcome.data)), "", "dither [N]")
        own.name(axes[1, 0], "", "time [s]", "displacement [counts of 5 µm]")
        axes[0, 0].set_xlim(0.0, 0.5)
        own.key(axes[1, 0], "upper right", 2)
    return figure
