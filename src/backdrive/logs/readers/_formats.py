"""Which reader a file belongs to: by its first bytes, then by its suffix."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from backdrive.errors import ReadError, UnknownFormat


@dataclass(frozen=True)
class Format:
    """One kind of log file.

    Attributes:
        name: what a person writes as `format=`.
        module: of `backdrive.logs.readers`; it offers `read(path, options) -> Columns`, and `prepare()` if it needs
            libraries that take long to load.
        suffixes: of file names, lower case.
        magic: (offset, bytes) that begin every such file; none for text.
    """

    name: str
    module: str
    suffixes: tuple[str, ...]
    magic: tuple[tuple[int, bytes], ...] = ()


#: Every format that can be read: one file and one line each.
READERS: tuple[Format, ...] = (
    Format("npz", "npz", (".npz",), ((0, b"PK\x03\x04"), (0, b"PK\x05\x06"))),
    Format("parquet", "parquet", (".parquet", ".pq"), ((0, b"PAR1"),)),
    Format(
        "hdf5", "hdf5", (".h5", ".hdf5"), tuple((at, b"\x89HDF\r\n\x1a\n") for at in (0, 512, 1024, 2048))
    ),
    Format("mat", "mat", (".mat",), ((0, b"MATLAB 5.0 MAT-file"),)),
    Format("mcap", "mcap", (".mcap",), ((0, b"\x89MCAP0\r\n"),)),
    Format("db3", "db3", (".db3",), ((0, b"SQLite format 3\x00"),)),
    Format("bag", "bag", (".bag",), ((0, b"#ROSBAG V"),)),
    Format("json", "json_", (".json",)),
    Format("csv", "csv_", (".csv", ".tsv", ".txt", ".dat", ".asc", ".log")),
)

#: A folder in LeRobot's layout, told by its `meta/info.json` and by no suffix.
LEROBOT = Format("lerobot", "lerobot", ())

SUFFIXES: dict[str, Format] = {suffix: form for form in READERS for suffix in form.suffixes}


def by_name(name: str) -> Format:
    """Return a format by the name a person wrote.

    Raises:
        UnknownName: lists the known formats.
    """
    from backdrive._catalog import lookup

    return lookup(name, {form.name: form for form in READERS}, "log format")


def recognise(path: Path) -> Format:
    """Return the format of a file.

    Raises:
        UnknownFormat: neither its first bytes nor its suffix belong to a reader.
        ReadError: it is empty or cannot be opened.
    """
    try:
        with open(path, "rb") as stream:
            head = stream.read(4096)
    except OSError as error:
        raise ReadError(
            f"{path} cannot be opened: {error.strerror}.", remedy="Name a file that you can read."
        ) from error
    if not head:
        raise UnknownFormat(f"{path} is empty.", remedy="Record the log again, or name another file.")
    for form in READERS:
        if any(head[at : at + len(magic)] == magic for at, magic in form.magic):
            return form
    form = SUFFIXES.get(path.suffix.lower())
    if form is None and path.suffix.lower() in (".gz", ".bz2", ".xz", ".zst", ".zip", ".7z"):
        raise UnknownFormat(f"{path} is compressed.", remedy="Unpack it first.")
    if form is None:
        known = ", ".join(f"{form.name} ({' '.join(form.suffixes)})" for form in READERS)
        raise UnknownFormat(
            f"{path} is of no known kind.",
            remedy=f"Name it: --format NAME (in Python format=). Known: {known}.",
        )
    return form
