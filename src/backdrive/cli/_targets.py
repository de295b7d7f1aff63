"""Files that a command will write, checked before any long computation: place, name and kind."""

from __future__ import annotations

from collections.abc import Sequence
from os.path import realpath
from pathlib import Path

from backdrive._files import check_writable
from backdrive._upper import check_page
from backdrive.errors import InvalidInput

PICTURES = ".html", ".png", ".svg"  # kinds of results that are never read
#: How a result begins that may be replaced by a newer one, and the number of bytes in which that stands.
RESULTS, BEGIN = (b'"backdrive-friction-model"', b'"backdrive-tuning"'), 200


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
        InvalidInput: an output is an input, another output or a file in a folder that is read, unless it is an earlier result;
            or a page's name is that of another kind of file.
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
        _spare_folders(path, inputs)
        check_writable(path)
        taken[realpath(path)] = path
    if any(path in drawn or path.suffix.lower() in (".png", ".svg") for path in wanted):
        from backdrive.report.pictures.canvas import require_matplotlib

        require_matplotlib()


def _spare_folders(path: Path, inputs: Sequence[Path | None]) -> None:
    """Refuse to write over a file in a folder that is read, unless it is a result or a picture."""
    whole = Path(realpath(path))
    within = [p for p in inputs if p is not None and p.is_dir() and Path(realpath(p)) in whole.parents]
    if not within or not whole.is_file() or whole.suffix.lower() in PICTURES:
        return
    if whole.suffix.lower() == ".json":
        with whole.open("rb") as file:
            begin = file.read(BEGIN)
        if any(kind in begin for kind in RESULTS):
            return
    raise InvalidInput(
        f"Cannot write {path}: it is in the folder {within[0]}, which is read.", remedy="Name another file."
    )


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
