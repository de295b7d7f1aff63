"""MATLAB files up to version 7.2: variables and nested structs, as dotted names.

The documentation of `scipy.io.loadmat` warns that damaged files may harm it; a changed byte can kill the interpreter. So the
sizes of all variables are checked first, and reading takes place in the guarded process.
"""

from __future__ import annotations

import os
import struct
import warnings
import zlib
from typing import cast

import numpy as np

from backdrive._documents import is_object
from backdrive.errors import IncompleteFile, ReadError
from backdrive.logs.readers._labels import MOST, holds_names, read_list
from backdrive.logs.readers.columns import Columns, ReadOptions, plain

_COMPRESSED = 15
_DEEPEST = 16


def prepare() -> None:
    """Load what reading needs, ahead of the time limit."""
    import scipy.io  # noqa: F401  # pyright: ignore[reportUnusedImport]


def read(path: str, options: ReadOptions) -> Columns:
    """Read every numeric variable; fields of structs are named `struct.field`.

    Raises:
        IncompleteFile: a variable is cut.
        FileTooLarge: a compressed variable declares more than the limits allow.
        MissingExtra: the file is version 7.3 (HDF5) and h5py is not installed.
    """
    with open(path, "rb") as stream:
        start = stream.read(520)
    if start[:8] == b"\x89HDF\r\n\x1a\n" or start[512:520] == b"\x89HDF\r\n\x1a\n":
        from backdrive.logs.readers import hdf5

        return hdf5.read(path, options)
    if not start.startswith(b"MATLAB 5.0"):
        raise ReadError(
            "This is not a MATLAB file of version 5 to 7.3.", remedy="Save it in MATLAB with -v7."
        )
    _check_sizes(path, options)

    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    try:
        with warnings.catch_warnings():
            warnings.simplefilter(
                "ignore"
            )  # duplicate variable names and the like are of no concern to a log
            content = loadmat(path, simplify_cells=True)
    except (MatReadError, EOFError, OSError) as error:
        raise IncompleteFile(
            f"A variable is cut or damaged ({error}).", remedy="Save the file again."
        ) from error
    arrays: dict[str, np.ndarray] = {}
    lists: dict[str, object] = {}
    left: list[str] = []
    for name, value in content.items():
        if not name.startswith("__") and name != "None":
            _walk(name, value, arrays, lists, left, 0)
    options.limits.check_count(len(arrays), "variables")
    notes: list[str] = []
    joints: tuple[str, ...] = ()
    for name, words in lists.items():
        joints = read_list(words, name, notes) or joints
    if left:
        notes.append(f"Left out, not numbers in one or two dimensions: {', '.join(left[:20])}.")
    return Columns(arrays=arrays, joints=joints, notes=tuple(notes))


def _walk(
    name: str,
    value: object,
    arrays: dict[str, np.ndarray],
    lists: dict[str, object],
    left: list[str],
    depth: int,
) -> None:
    if is_object(value):
        if depth >= _DEEPEST:
            left.append(name)
            return
        for field, inner in value.items():
            _walk(f"{name}.{field}", inner, arrays, lists, left, depth + 1)
        return
    if holds_names(name) and (words := _words(value)) is not None:
        lists[name] = words
        return
    if isinstance(value, (bool, int, float, np.generic, np.ndarray)):
        array = plain(np.asarray(value))
        if array is not None and array.size:
            arrays[name] = array
            return
    left.append(name)


def _words(value: object) -> object:
    """Return a row or a matrix of letters, or a cell of words, as words; None if it is none."""
    if isinstance(value, np.ndarray):
        array = cast(np.ndarray, value)
        return array.tolist() if array.dtype.kind in "UO" and array.size <= MOST else None
    return value if isinstance(value, str) else None


def _check_sizes(path: str, options: ReadOptions) -> None:
    """Add up what the variables declare, from their tags alone (MAT-File Format, level 5: data element tags)."""
    size = os.path.getsize(path)
    declared = 0
    with open(path, "rb") as stream:
        order = "<" if stream.read(128)[126:128] == b"IM" else ">"
        at = 128
        while at + 8 <= size:
            stream.seek(at)
            kind, length = struct.unpack(order + "II", stream.read(8))
            if kind >> 16:  # a small element carries its data in the tag
                at += 8
                continue
            if at + 8 + length > size:
                raise IncompleteFile(
                    f"A variable at byte {at} declares {length} bytes, but the file ends after {size - at - 8}.",
                    remedy="Copy or save the file again.",
                )
            if kind == _COMPRESSED:
                try:
                    tag = zlib.decompressobj().decompress(stream.read(min(length, 4096)), 8)
                except zlib.error as error:
                    raise ReadError(
                        f"A compressed variable is damaged ({error}).", remedy="Save it again."
                    ) from error
                if len(tag) == 8:
                    declared += struct.unpack(order + "II", tag)[1]
            else:
                declared += length
            options.limits.check_size(declared, size, "The file")
            at += 8 + length
