"""A page of its own for any result that can be displayed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from backdrive._files import write_whole
from backdrive.report import figures, sheet
from backdrive.report.joint import table, warnings_box
from backdrive.report.pictures import canvas, svg
from backdrive.report.show import face
from backdrive.report.words import esc, plain


def write_page(result: Any, path: str | Path, *, title: str | None = None) -> Path:
    """Write a result as a page of its own: its sentence, warnings, table and picture, in light and dark.

    Args:
        result: of `compare` or `tune`, or a model; `Identification.report` and `ForceEstimate.report` show more.
        path: of the file.
        title: of the page; None: it names the result.

    Raises:
        InvalidInput: `path` names no file.
        MissingExtra: matplotlib is not installed.
        WriteError: the file cannot be written.
    """
    from backdrive import __version__

    canvas.require_matplotlib()
    shown = face(result)
    title = shown.title if title is None else title
    head, rows = [esc(name) for name in shown.head], [[esc(cell) for cell in row] for row in shown.rows]
    parts = [
        f'<header><h1><bdi>{esc(title)}</bdi></h1><p class="lead">{esc(shown.lead)}</p>'
        f"{warnings_box(tuple(dict.fromkeys(shown.warnings)), 'Remarks')}</header>",
        f'<section class="summary">{table("", head, rows)}</section>' if rows else "",
    ]
    if shown.figure is not None:
        with canvas.house_style():
            figure = shown.figure(canvas.CSS)
            figure.patch.set_visible(False)
            parts.append(
                f"<section>{figures.figure(svg.inline(figure, 'p', plain(shown.title)), '')}</section>"
            )
    parts.append(f'<footer class="muted"><small>backdrive {__version__}</small></footer>')
    return write_whole(path, sheet.page(title, "\n".join(parts)))
