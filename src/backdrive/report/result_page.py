"""A page of its own for any result that can be displayed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from backdrive._files import write_whole
from backdrive.report import figures, sheet
from backdrive.report.joint import warnings_box
from backdrive.report.pictures import canvas, svg
from backdrive.report.show import Face, face
from backdrive.report.words import esc, plain

WIDE = 1.3  # a picture wider than this many ordinary ones has the whole width of the page [-]
LONG = 24  # a cell longer than this may break over lines [characters]


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
    parts = [
        f'<header><h1><bdi>{esc(title)}</bdi></h1><p class="lead">{esc(shown.lead)}</p>'
        f"{warnings_box(tuple(dict.fromkeys(shown.warnings)), 'Remarks')}</header>",
        _table(shown),
    ]
    if shown.figure is not None:
        with canvas.house_style():
            figure = shown.figure(canvas.CSS)
            figure.patch.set_visible(False)
            wide = 72.0 * figure.get_size_inches()[0] > WIDE * canvas.WIDTH
            picture = figures.figure(svg.inline(figure, "p", plain(shown.title)), "")
        kind = ' class="wide" tabindex="0"' if wide else ""
        parts.append(f"<section{kind}>{picture}</section>")
    parts.append(f'<footer class="muted"><small>backdrive {__version__}</small></footer>')
    return write_whole(path, sheet.page(title, "\n".join(parts)))


def _table(shown: Face) -> str:
    """Return the table of a result; on a phone each cell stands below its heading."""
    if not shown.rows:
        return ""
    head = "".join(f'<th scope="col">{esc(name)}</th>' for name in shown.head)
    rows = ""
    for name, *others in shown.rows:
        cells = [
            f'<td data-label="{esc(label)}"><span class="{"long" if len(cell) > LONG else "n"}">{esc(cell)}</span></td>'
            for label, cell in zip(shown.head[1:], others, strict=True)
        ]
        rows += (
            f'<tr><th scope="row" class="name"><span class="n">{esc(name)}</span></th>{"".join(cells)}</tr>'
        )
    return f'<section class="summary"><table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></section>'
