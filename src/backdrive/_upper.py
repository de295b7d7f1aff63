"""Access to a module of a higher layer, by name and on demand: the display of results is defined there."""

from __future__ import annotations

import importlib
from typing import Any


def upper(module: str, name: str) -> Any:
    """Return a member of a module that imports the one that asks for it.

    Args:
        module: below the package, `model.file`.
        name: of the member.
    """
    return getattr(importlib.import_module(f"backdrive.{module}"), name)


class Display:
    """Base class of results that can be displayed: text by `summary`, a picture by `plot`, a page by `report`, and HTML in a
    notebook.
    """

    def summary(self, width: int = 80) -> str:
        """Return a summary as plain text.

        Args:
            width: of a line [characters].
        """
        return upper("report.show", "text")(self, width)

    def plot(self) -> Any:
        """Return a picture as a matplotlib figure, which shows itself in a notebook and has `savefig`.

        Raises:
            MissingExtra: matplotlib is not installed.
        """
        return upper("report.show", "picture")(self)

    def _repr_html_(self) -> str:
        return upper("report.show", "html")(self)
