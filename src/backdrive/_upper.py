"""Access to a module of a higher layer, by name and on demand: the display of results is defined there."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

from backdrive.errors import InvalidInput, check_path
from backdrive.parameters import whole

PAGES = (".html", ".htm")  # endings of the name of a page


def upper(module: str, name: str) -> Any:
    """Return a member of a module that imports the one that asks for it.

    Args:
        module: below the package, `model.file`.
        name: of the member.
    """
    return getattr(importlib.import_module(f"backdrive.{module}"), name)


def check_page(path: str | Path) -> None:
    """Refuse the name of a file that says that it is no HTML page; a name without an ending is left as it is.

    Raises:
        InvalidInput: it is no path, or ends otherwise than in .html or .htm.
    """
    check_path(path)
    ending = Path(path).suffix
    if ending and ending.lower() not in PAGES:
        hint = "; print the page to PDF from a browser" if ending.lower() == ".pdf" else ""
        raise InvalidInput(f"{path}: a report is an HTML page.", remedy=f"Let its name end in .html{hint}.")


class Display:
    """Base class of results that can be displayed.

    `summary` gives text, `plot` a picture, `report` a page; a notebook shows HTML. `print` shows the summary.
    """

    def summary(self, width: int = 80) -> str:
        """Return a summary as plain text.

        Args:
            width: of a line [characters].
        """
        return upper("report.show", "text")(self, whole("width", width, 20))

    def plot(self) -> Any:
        """Return a picture as a matplotlib figure, which shows itself in a notebook and has `savefig`.

        Raises:
            MissingExtra: matplotlib is not installed.
        """
        return upper("report.show", "picture")(self)

    def report(self, path: str | Path, *, title: str | None = None) -> Path:
        """Write a page that shows the result: one HTML file with its table, warnings and picture.

        Args:
            path: of the file.
            title: of the page; None: it names the result.

        Raises:
            InvalidInput: `path` names no file, or one that is no HTML page.
            MissingExtra: matplotlib is not installed.
            WriteError: the file cannot be written.
        """
        check_page(path)
        return upper("report.result_page", "write_page")(self, path, title=title)

    def __str__(self) -> str:
        return self.summary().rstrip()

    def _repr_html_(self) -> str:
        return upper("report.show", "html")(self)
