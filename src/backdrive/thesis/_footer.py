"""What stands below a picture of the thesis: its abbreviations and signs in words, and the claims that do not hold."""

from __future__ import annotations

import re
import textwrap
from typing import Any

from backdrive.report.pictures.canvas import LIGHT
from backdrive.thesis._sweep_plots import SMALL
from backdrive.thesis.outcome import Outcome

MEANINGS = {
    "NC": "no compensation",
    "MO": "contact alone, Iwatani 2017, (2.24)",
    "MOL": "contact and a straight line, (2.25)",
    "MOP": "contact and a polyline, (2.22)",
    "C": "contact that keeps its torque at rest, (3.27) with α = 0",
    "CD": "C with dither",
    "P": "decaying contact, α = 20 1/s",
    "PD": "P with dither",
    "CT": "dead zone of velocity, (4.17)",
    "HA": "Hayward and Armstrong's contact, (4.8)",
    "algFC2": "decaying contact whose rate switches, (3.28)",
    "algFE2": "estimator by the decaying contact whose rate switches, (4.20)",
    "GMS": "generalised Maxwell slip",
    "DOB": "disturbance observer",
    "K_c": "stiffness of the transmission (K: of the compensator)",
    "F_p": "friction along +q",
    "F_n": "friction along \u2212q",
}
STARS = "Brackets: test of means against PD; *** p < 0.1 %, ** p < 1 %, * p < 5 %, ns not significant."
TIERS = "Members of a tier are ties with its first. Costs are on a scale of ratios."
FAILS = "#b3261e"
LINE = 1.35  # height of a line by the size of its type
NARROW = 0.53  # mean width of a letter by the size of its type


def footer(figure: Any, outcome: Outcome) -> None:
    """Write below a figure what its abbreviations and signs mean and which of its claims do not hold; the sheet grows by that.

    Args:
        figure: drawn; one without a layout engine stays as it is.
        outcome: that it shows.
    """
    words = texts_of(figure)
    told = (
        abbreviations(words),
        signs(words),
        TIERS if any(word.startswith("tier ") for word in words) else "",
    )
    notes = [(text, LIGHT.muted) for text in told if text]
    notes += [
        (f"Does not hold here: {c.what.rstrip(chr(46))}.", FAILS) for c in outcome.claims if c.holds is False
    ]
    engine = figure.get_layout_engine()
    if not notes or engine is None:
        return
    width, height = figure.get_size_inches()
    letters = int((72.0 * width - 24.0) / (NARROW * SMALL))
    lines = [(line, color) for text, color in notes for line in textwrap.wrap(text, letters)]
    pitch = LINE * SMALL / 72.0
    below = pitch * len(lines) + 8.0 / 72.0
    figure.set_size_inches(width, height + below)
    engine.set(rect=(0.0, below / (height + below), 1.0, height / (height + below)))
    for i, (line, color) in enumerate(lines):
        at = (pitch * (len(lines) - i - 1) + 6.0 / 72.0) / (height + below)
        figure.text(
            12.0 / 72.0 / width,
            at,
            line,
            color=color,
            fontsize=SMALL,
            va="bottom",
            ha="left",
            parse_math=False,
        )


def texts_of(figure: Any) -> list[str]:
    """Return all that is written in a figure."""
    from matplotlib.text import Text

    figure.draw_without_rendering()  # ticks get their texts
    return [
        text.get_text().strip()
        for text in figure.findobj(Text)
        if text.get_visible() and text.get_text().strip()
    ]


def abbreviations(words: list[str]) -> str:
    """Return in words the abbreviations that stand among some texts, but for those that a text explains itself."""
    whole = set(words)
    explained = {match[1] for text in words for match in [re.match(r"(\w+): [a-z]", text)] if match}
    used = [
        a
        for a in MEANINGS
        if a not in explained and any(re.search(rf"(?<![\w-]){a}(?![\w'(-])", t) for t in whole)
    ]
    return "; ".join(f"{a}: {MEANINGS[a]}" for a in used) + ("." if used else "")


def signs(words: list[str]) -> str:
    """Return in words the marks of tests that stand among some texts."""
    return STARS if {"*", "**", "***", "ns"} & set(words) else ""
