"""NumPy archives: a zip of `.npy` arrays, headers checked before anything is reserved, objects refused."""

from __future__ import annotations

import codecs
import io
import re
import zipfile
from typing import Any

import numpy as np

from backdrive.errors import FileTooLarge, ForbiddenContent, IncompleteFile, ReadError
from backdrive.logs.readers._labels import LONGEST, holds_names, read_list
from backdrive.logs.readers._labels import MOST as MOST_NAMES
from backdrive.logs.readers.columns import Columns, ReadOptions, plain

MOST = 10_000  # of a header [B]
PLAIN = re.compile(  # a header as numpy writes it for plain numbers
    rb"\{'descr': '([<|][biuf][1248])', 'fortran_order': (True|False), 'shape': \((\d{1,18}(?:, \d{1,18})*)?,?\), \} *\n"
)
PIECE = 1 << 16  # read at a time: larger buffers would each be mapped anew, page by page [B]


def prepare() -> None:
    """Load what names of members are decoded with."""
    codecs.lookup("cp437")


def read(path: str, options: ReadOptions) -> Columns:
    """Read every array of the archive.

    Raises:
        IncompleteFile: the archive's directory or an array is cut.
        FileTooLarge: the archive declares more than the limits allow.
        ForbiddenContent: an array holds pickled objects.
    """
    limits = options.limits
    try:
        archive = zipfile.ZipFile(path)
    except zipfile.BadZipFile as error:
        raise IncompleteFile(
            f"The archive has no directory ({error}).", remedy="Copy or save it again."
        ) from error
    with archive:
        members = [info for info in archive.infolist() if info.filename.endswith(".npy")]
        if not members:
            raise ReadError("The archive holds no .npy array.", remedy="Save it with numpy.savez.")
        limits.check_count(len(members), "arrays")
        size = sum(max(info.compress_size, 0) for info in members)
        limits.check_size(sum(info.file_size for info in members), size, "The archive")
        arrays: dict[str, np.ndarray] = {}
        notes: list[str] = []
        joints: tuple[str, ...] = ()
        for info in members:
            name = info.filename[: -len(".npy")]
            if info.flag_bits & 1:
                raise ForbiddenContent(f"Array '{name}' is encrypted.", remedy="Save it without a password.")
            try:
                with archive.open(info) as stream:
                    array = _array(stream, name, info.file_size)
            except (zipfile.BadZipFile, EOFError) as error:
                raise IncompleteFile(
                    f"Array '{name}' is damaged ({error}).", remedy="Save it again."
                ) from error
            if array.dtype.kind in "US" and array.size:
                joints = read_list(_words(array), name, notes) or joints
                continue
            value = plain(array)
            if value is None:
                notes.append(f"Array '{name}' is not one- or two-dimensional numbers and was left out.")
            else:
                arrays[name] = value
    return Columns(arrays=arrays, joints=joints, notes=tuple(notes))


def _words(array: np.ndarray) -> list[str]:
    """Return the words of an array of text; none where it holds what is no character."""
    try:
        words = array.tolist()
    except ValueError:
        return []
    return [word.decode(errors="replace") if isinstance(word, bytes) else word for word in words]


def _array(stream: Any, name: str, declared: int) -> np.ndarray:
    """Read one array, its size settled by its header before its bytes are fetched."""
    version = np.lib.format.read_magic(stream)
    if version not in ((1, 0), (2, 0)):
        raise ReadError(
            f"Array '{name}' has header version {version}.", remedy="Save it with a current numpy."
        )
    shape, fortran, dtype = _header(stream, version)
    if dtype.hasobject:
        raise ForbiddenContent(
            f"Array '{name}' holds pickled Python objects, which can run code.", remedy="Save plain numbers."
        )
    count = 1
    for length in shape:
        if length < 0:
            raise ReadError(f"Array '{name}' has shape {shape}.", remedy="Save it again.")
        count *= length
    if count * dtype.itemsize > declared:
        raise FileTooLarge(
            f"Array '{name}' claims shape {shape} but the archive holds {declared} bytes of it.",
            remedy="Save it again.",
        )
    names = dtype.kind in "US" and holds_names(name) and len(shape) == 1 and 0 < dtype.itemsize <= 4 * LONGEST
    if dtype.kind not in "biuf" and not (names and count <= MOST_NAMES):
        return np.empty(0, dtype)
    value = np.empty(count, dtype)
    if count:
        view, at = value.view(np.uint8).data, 0
        while at < len(view):
            got = stream.readinto(view[at : at + PIECE])
            if not got:
                raise IncompleteFile(
                    f"Array '{name}' ends after {at} of {len(view)} bytes.", remedy="Save it again."
                )
            at += got
    return value.reshape(shape, order="F" if fortran else "C")


def _header(stream: Any, version: tuple[int, int]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Return shape, order and element type of an array; only an unusual header is parsed as Python, which takes longer."""
    size = stream.read(2 if version == (1, 0) else 4)
    text = stream.read(int.from_bytes(size, "little"))
    usual = PLAIN.fullmatch(text) if len(text) <= MOST else None
    if usual is not None:
        shape = tuple(int(length) for length in usual[3].split(b", ")) if usual[3] else ()
        return shape, usual[2] == b"True", np.dtype(usual[1].decode())
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    return read(io.BytesIO(size + text), max_header_size=MOST)
