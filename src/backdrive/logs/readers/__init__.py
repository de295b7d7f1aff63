"""Joint logs from files: one format a file, all of them parsed in a guarded process, then mapped to a `Log`."""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from backdrive._arguments import FLAG, NAMES, PATHS, WORD, check_arguments, optional
from backdrive._documents import as_list
from backdrive._files import check_regular
from backdrive.errors import FileTooLarge, ReadError, UnknownFormat, check_path, check_type
from backdrive.logs.readers._formats import LEROBOT, READERS, SUFFIXES, Format, by_name, recognise

if TYPE_CHECKING:
    from backdrive.logs.log import Log
    from backdrive.logs.readers.columns import Columns
    from backdrive.logs.readers.limits import Limits

__all__ = ["READERS", "peek", "read_columns", "read_log", "read_logs"]

_BAGS = (".mcap", ".db3")
_INFO = Path("meta/info.json")  # describes a folder in LeRobot's layout
_MOST_FILES = 10_000
ARGUMENTS = {
    "format": optional(WORD),
    "topic": optional(WORD),
    "names": optional(NAMES),
    "join": PATHS,
    "guarded": FLAG,
}


def read_log(  # noqa: PLR0913  (its options are given by keyword)
    path: str | os.PathLike[str],
    *,
    map: str | Mapping[str, str] | None = None,
    format: str | None = None,
    topic: str | None = None,
    names: str | Sequence[str] | None = None,
    units: str | Sequence[str] | None = None,
    gear: float | Sequence[float] | None = None,
    counts: float | Sequence[float] | None = None,
    motor_side: str | Sequence[str] | None = None,
    coupling: Sequence[Sequence[float]] | None = None,
    coupling_side: str | None = None,
    join: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] = (),
    limits: Limits | None = None,
    guarded: bool = True,
) -> Log:
    """Read one log.

    Args:
        path: a file, or the folder of a ROS 2 bag or of LeRobot's episodes.
        map: which column is which channel, for example `t=t,q=qm,tau=35.15*vir`; channels that it does not
            mention are found by their usual names.
        format: name of a reader, if the file's first bytes and suffix do not tell.
        topic: of a bag that holds several joint-state topics.
        names: joint names; where the file names its joints they choose and order them.
        units: `rad`, `m` or `deg` for the joints, if the file does not say.
        gear: motor turns per joint turn [1]; says that torque is of the motor side, and brings it to the joint.
        counts: encoder counts per rad or m at the joint [1/rad or 1/m].
        motor_side: which of `q`, `dq`, `qr` and `tau` the gear brings to the joint; None: `tau`.
        coupling: C of q_joint = C q_motor, (J, J); the torque goes by its inverse transpose.
        coupling_side: side that the channels are of, `motor`, or `joint` where the controller resolves the coupling already.
        join: files whose columns are interpolated onto this one's clock.
        limits: what parsing may use.
        guarded: parse in another process. Without this, a malicious file can crash the calling process.

    Returns:
        The log in SI units; its notes list the use of every column.

    Raises:
        ReadError: or one of its children: the file cannot be read.
        MappingError: its columns are not recognized by their names; the message lists them.
        MissingExtra: an optional dependency is not installed.
    """
    check_path(path)
    check_arguments(ARGUMENTS, locals())
    if guarded:
        from backdrive.logs.readers import guard

        guard.default_guard().start()  # the child loads its libraries in parallel with this process
    from threading import Thread

    from backdrive.logs.joint import Source, digest
    from backdrive.logs.readers.mapping import to_log

    files, form = _files(Path(path), format)
    beside = [_files(Path(p), None) for p in ([join] if isinstance(join, (str, os.PathLike)) else join)]
    every = [*files, *(file for others, _ in beside for file in others)]
    _size(every, limits)  # before all bytes are hashed
    digests: list[str] = []

    def hash_all() -> None:
        with contextlib.suppress(OSError):  # a file that vanished is reported by its reader
            digests.extend(digest(file) for file in every)

    hashing = Thread(target=hash_all, daemon=True)
    hashing.start()  # hashing lets go of the interpreter, so it runs beside the parsing process
    try:
        columns = _parse(files, form, topic, limits, guarded, _name_tuple(names))
        parts = [(str(o[0]), _parse(o, kind, topic, limits, guarded)) for o, kind in beside]
    finally:
        hashing.join()
    if parts:
        from backdrive.logs.readers._join import side_by_side

        columns, map = side_by_side(columns, parts, map)
    sources = tuple(Source(path=str(file), sha256=value) for file, value in zip(every, digests, strict=True))
    return to_log(
        columns,
        map=map,
        names=names,
        units=units,
        gear=gear,
        counts=counts,
        motor_side=motor_side,
        coupling=coupling,
        coupling_side=coupling_side,
        sources=sources,
        owned=True,
    )


def read_logs(paths: str | os.PathLike[str] | Sequence[str | os.PathLike[str]], **options: Any) -> list[Log]:
    """Read several logs: files, or folders of files of one kind; takes the options of `read_log`.

    Raises:
        ReadError: a folder holds no log, or logs of several kinds, or there are several logs and a file to join.
    """
    given = as_list(paths)
    for path in given:
        check_path(path)
    if not given:
        raise ReadError("No log was named.", remedy="Name at least one file or folder.")
    files = [file for path in given for file in _expand(Path(path), options.get("format"))]
    if options.get("join") and len(files) > 1:
        raise ReadError(
            f"{len(files)} logs and a file to join: it is not known to which log it belongs.",
            remedy="Name one log and its --join, or read them one by one in Python: read_log(path, join=...).",
        )
    if len(files) == 1:
        return [read_log(files[0], **options)]
    from backdrive.logs.readers.fork_server import child_a_file

    with child_a_file():
        return [read_log(file, **options) for file in files]


def read_columns(
    path: str | os.PathLike[str],
    *,
    format: str | None = None,
    topic: str | None = None,
    limits: Limits | None = None,
    guarded: bool = True,
) -> Columns:
    """Return a file's columns unchanged, without mapping them to channels.

    Raises:
        ReadError: or one of its children.
        MissingExtra: an optional dependency is not installed.
    """
    files, form = _files(Path(path), format)
    return _parse(files, form, topic, limits, guarded)


def peek(path: str | os.PathLike[str], **options: Any) -> list[tuple[str, tuple[int, ...], str]]:
    """Return the name, shape and element type of every column; takes the options of `read_columns`.

    Raises:
        ReadError: or one of its children.
        MissingExtra: an optional dependency is not installed.
    """
    columns = read_columns(path, **options)
    return [(name, value.shape, value.dtype.name) for name, value in columns.arrays.items()]


def _parse(
    files: list[Path],
    form: Format,
    topic: str | None,
    limits: Limits | None,
    guarded: bool,
    joints: tuple[str, ...] = (),
) -> Columns:
    from backdrive.logs.readers.columns import ReadOptions
    from backdrive.logs.readers.limits import Limits

    resolved = [str(file.resolve()) for file in files]
    options = ReadOptions(topic=topic, joints=joints, parts=tuple(resolved[1:]), limits=limits or Limits())
    size = _size(files, limits)
    try:
        if guarded:
            from backdrive.logs.readers import guard

            return guard.default_guard().read(resolved[0], form.module, options, size=size)
        from backdrive.logs.readers._worker import parse

        return parse(resolved[0], form.module, options)
    except ReadError as error:
        raise type(error)(
            f"{files[0]}: {error.message}", remedy=error.remedy, path=str(files[0])
        ) from error.__cause__


def _size(files: list[Path], limits: Limits | None) -> int:
    """Return how many bytes the files of a log have together, and refuse too many.

    Raises:
        FileTooLarge: more than the limits allow.
        ReadError: a file is gone.
    """
    from backdrive.logs.readers.limits import Limits

    check_type(
        Limits() if limits is None else limits,
        Limits,
        "Limits",
        "Give backdrive.logs.readers.limits.Limits(...), or None.",
    )
    size, most = sum(check_regular(file).st_size for file in files), (limits or Limits()).max_file_bytes
    if size > most:
        raise FileTooLarge(
            f"{files[0]} has {size} bytes, more than the limit of {most}.",
            remedy="Cut it, or read it in Python with limits=Limits(max_file_bytes=...).",
        )
    return size


def _name_tuple(names: str | Sequence[str] | None) -> tuple[str, ...]:
    parts = names.split(",") if isinstance(names, str) else names or ()
    return tuple(str(name).strip() for name in parts)


def _files(path: Path, format: str | None) -> tuple[list[Path], Format]:
    """Return the files of one log: several only for a bag that was split, or a folder of episodes."""
    if path.is_dir():
        files = _folder_files(path)
        if not files:
            found = _expand(path, format)
            if len(found) > 1:
                raise ReadError(
                    f"{path} holds {len(found)} logs.", remedy="Read them with read_logs, or name one."
                )
            return _files(found[0], format)
    else:
        if not path.exists():
            raise ReadError(f"{path} does not exist.", remedy="Check the name.")
        files = [path]
    for file in files:
        check_regular(file)
    if path.is_dir() and files[0] == path / _INFO:
        return files, LEROBOT
    return files, by_name(format) if format is not None else recognise(files[0])


def _folder_files(folder: Path) -> list[Path]:
    """Return the files of a folder that is one log, a bag or LeRobot's episodes; nothing if it is neither."""
    if not (folder / _INFO).is_file():
        return _bag_files(folder)
    files = sorted(islice(folder.glob("data/**/*.parquet"), _MOST_FILES + 1), key=_natural_path)
    if len(files) > _MOST_FILES:
        raise FileTooLarge(
            f"{folder} holds more than {_MOST_FILES} Parquet files.",
            remedy="Name those that you want, or copy some to a folder of their own.",
        )
    return [folder / _INFO, *files]


def _bag_files(folder: Path) -> list[Path]:
    """Return the parts of a ROS 2 bag in order, or nothing if the folder is no bag."""
    if not (folder / "metadata.yaml").exists():
        return []
    for suffix in _BAGS:
        files = sorted(folder.glob(f"*{suffix}"), key=_natural)
        if files:
            return files
    raise ReadError(
        f"{folder} has a metadata.yaml but no .mcap or .db3 beside it.",
        remedy="Decompress the bag's files first, or copy them too.",
    )


def _expand(path: Path, format: str | None) -> list[Path]:
    """Return the logs of a folder, in natural order; a file or a bag stands for itself."""
    if not path.is_dir() or _folder_files(path):
        return [path]
    suffixes = SUFFIXES if format is None else dict.fromkeys(by_name(format).suffixes)
    by_suffix: dict[str, list[Path]] = {}
    for file in path.iterdir():
        if file.is_file() and file.suffix.lower() in suffixes and not file.name.startswith("."):
            by_suffix.setdefault(file.suffix.lower(), []).append(file)
    if len(by_suffix) > 1:
        counted = ", ".join(f"{len(files)} {suffix}" for suffix, files in sorted(by_suffix.items()))
        raise ReadError(
            f"{path} holds logs of several kinds: {counted}.",
            remedy="Name the files, or the kind: --format (in Python format=).",
        )
    if not by_suffix:
        bags = sorted((sub for sub in path.iterdir() if sub.is_dir() and _folder_files(sub)), key=_natural)
        if bags:
            return bags
        raise UnknownFormat(
            f"{path} holds no log. Suffixes that are looked for: {' '.join(SUFFIXES)}.",
            remedy="Name the folder that directly holds the files.",
        )
    return sorted(next(iter(by_suffix.values())), key=_natural)


def _natural_path(path: Path) -> list[list[tuple[int, int, str]]]:
    return [_natural(Path(part)) for part in path.parts]


def _natural(path: Path) -> list[tuple[int, int, str]]:
    return [(1, int(part), "") if part.isdigit() else (0, 0, part) for part in re.split(r"(\d+)", path.name)]
