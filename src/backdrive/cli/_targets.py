"""Files that a command will write, checked before any long computation: place, name and kind."""

from __future__ import annotations

from collections.abc import Sequence
from os.path import realpath
from pathlib import Path

from backdrive._files import check_writable
from backdrive._upper import check_page
from backdrive.errors import InvalidInput


def check_targets(
    outputs: Sequence[Path | None],
    inputs: Sequence[Path | None],
    *,
    drawn: Sequence[Path | None] = (),
    pages: Sequence[Path | None] = (),
) -> None:
    """Refuse outputs that cannot be written or that would overwrite an input; called before any long computation.

    Args:
        outputs: files that a command will write; those that end in .png or .svg are pictures.
        inputs: files that it reads.
        drawn: further outputs, with pictures in them.
        pages: those of the outputs that are HTML pages.

    Raises:
        InvalidInput: an output is an input or another output, or a page's name is that of another kind of file.
        WriteError: an output cannot be written; see `backdrive._files.check_writable`.
        MissingExtra: an output needs matplotlib, which is not installed.
    """
    for page in pages:
        if page is not None:
            check_page(page)
    taken = {realpath(p): p for p in inputs if p is not None}
    wanted = [p for p in (*outputs, *drawn) if p is not None]
    for path in wanted:
        if realpath(path) in taken:
            raise InvalidInput(
                f"Cannot write {path}: it is also {taken[realpath(path)]}.", remedy="Name another file."
            )
        check_writable(path)
        taken[realpath(path)] = path
    if any(path in drawn or path.suffix.lower() in (".png", ".svg") for path in wanted):
        from backdrive.report.pictures.canvas import require_matplotlib

        require_matplotlib()


def check_folder(folder: Path, files: Sequence[str]) -> None:
    """Refuse a folder that cannot be created or written to; called before any long computation.

    Args:
        folder: made later where it does not exist.
        files: names of files that will be written there.

    Raises:
        WriteError: see `backdrive._files.check_writable`.
    """
    for name in files:
        check_writable(folder / name, make=True)
