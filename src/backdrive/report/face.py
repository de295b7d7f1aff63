"""The parts of a result that can be displayed, of which text, HTML and pages are made."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from backdrive.report.pictures import canvas


@dataclass(frozen=True, kw_only=True)
class Face:
    """The parts of a result that can be displayed.

    Attributes:
        title: what it is.
        lead: the answer in a sentence or two.
        head: of the table.
        rows: of the table.
        warnings: warnings and remarks, the most important first.
        figure: returns the picture in a theme; None: there is none.
    """

    title: str
    lead: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    warnings: Sequence[str] = ()
    figure: Callable[[canvas.Theme], Any] | None = None
