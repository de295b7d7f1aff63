"""HDF5, which MATLAB's version 7.3 also is: groups become dotted names; links that leave the file are refused.

An HDF5 file can refer to another file by external links, external storage or virtual datasets. Its reader then returns the
bytes of that file (CVE-2026-1669 is such a case). A file of 1 kB can also declare terabytes. So every object is looked at
before its data are.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import numpy as np

from backdrive.errors import ForbiddenContent, IncompleteFile, ReadError, require
from backdrive.logs.readers._labels import LONGEST, MOST, holds_names, read_list
from backdrive.logs.readers.columns import Columns, ReadOptions, plain

if TYPE_CHECKING:
    import h5py

_DEEPEST = 16
_MATLAB_ONLY = ("#refs#", "#subsystem#")
_FILTERS = {
    1,
    2,
    3,
}  # deflate, shuffle, Fletcher-32 checksum: what is compiled in everywhere and loads no plug-in


def prepare() -> None:
    """Load what reading needs, ahead of the time limit.

    Raises:
        MissingExtra: h5py is not installed.
    """
    require("h5py", "Reading HDF5 and MATLAB 7.3 files needs", "hdf5")


def read(path: str, options: ReadOptions) -> Columns:
    """Read every numeric dataset of one or two dimensions.

    Raises:
        ForbiddenContent: it links to other files or by name, or needs a filter plug-in.
        FileTooLarge: it declares more than the limits allow.
        IncompleteFile: it ends before its content does.
        MissingExtra: h5py is not installed.
    """
    prepare()
    import h5py

    found: dict[str, h5py.Dataset] = {}
    lists: dict[str, h5py.Dataset] = {}
    left: list[str] = []
    notes: list[str] = []
    joints: tuple[str, ...] = ()
    arrays: dict[str, np.ndarray] = {}
    try:
        with h5py.File(path, "r", libver=("earliest", "latest"), locking=False) as file:
            _walk(file, "", found, lists, left, {file.id.__hash__()}, 0)
            options.limits.check_count(len(found) + len(lists), "datasets")
            declared = sum(_size_of(data) for data in found.values())
            options.limits.check_size(declared, os.path.getsize(path), "The file")
            for name, data in lists.items():
                words = data.asstr(errors="replace")[()]
                joints = read_list(words if isinstance(words, str) else list(words), name, notes) or joints
            for name, data in found.items():
                value = plain(data[()])
                if value is None or not value.size:
                    left.append(name)
                elif "MATLAB_class" in data.attrs and value.ndim == 2:
                    arrays[name] = (
                        value.T.squeeze() if 1 in value.shape else value.T
                    )  # MATLAB stores columns first
                    arrays[name] = np.atleast_1d(np.ascontiguousarray(arrays[name]))
                else:
                    arrays[name] = value
    except (OSError, KeyError, RuntimeError) as error:
        text = str(error)
        if "truncated" in text or "end of file" in text.lower() or "addr overflow" in text:
            raise IncompleteFile(
                f"The file is cut ({text[:200]}).", remedy="Copy or save it again."
            ) from error
        raise ReadError(f"The file is damaged ({text[:200]}).", remedy="Copy or save it again.") from error
    if not arrays:
        raise ReadError(
            "The file holds no numeric dataset of one or two dimensions.", remedy="Name another file."
        )
    if left:
        notes.append(f"Left out, not numbers in one or two dimensions: {', '.join(left[:20])}.")
    return Columns(arrays=arrays, joints=joints, notes=tuple(notes))


def _walk(
    group: h5py.Group,
    prefix: str,
    found: dict[str, Any],
    lists: dict[str, Any],
    left: list[str],
    seen: set[Any],
    depth: int,
) -> None:
    """Collect datasets of numbers and lists of joint names; a hard link back to a group already seen would never end."""
    import h5py

    if depth > _DEEPEST:
        raise ForbiddenContent(f"Groups are nested deeper than {_DEEPEST}.", remedy="Name another file.")
    for key in group:
        if depth == 0 and key in _MATLAB_ONLY:
            continue
        name = f"{prefix}{key}"
        link = group.get(key, getlink=True)
        if not isinstance(link, h5py.HardLink):
            kind = "another file" if isinstance(link, h5py.ExternalLink) else "another place by name"
            raise ForbiddenContent(
                f"'{name}' is a link to {kind}, which no log needs.",
                remedy="Save the data themselves in the file.",
            )
        item = group[key]
        if isinstance(item, h5py.Group):
            if item.id.__hash__() in seen:
                raise ForbiddenContent(
                    f"'{name}' leads to a group that was reached before.", remedy="Name another file."
                )
            seen.add(item.id.__hash__())
            _walk(item, f"{name}.", found, lists, left, seen, depth + 1)
        elif isinstance(item, h5py.Dataset):
            if _is_numeric(item, name):
                found[name] = item
            elif _may_be_names(item, name):
                lists[name] = item
            else:
                left.append(name)


def _is_numeric(data: h5py.Dataset, name: str) -> bool:
    """Tell whether a dataset is numbers; refuse storage outside the file and plug-ins."""
    if data.is_virtual or data.external:
        raise ForbiddenContent(
            f"'{name}' keeps its data in another file.", remedy="Save the data themselves in the file."
        )
    properties = data.id.get_create_plist()
    for i in range(properties.get_nfilters()):
        if properties.get_filter(i)[0] not in _FILTERS:
            raise ForbiddenContent(
                f"'{name}' is stored with filter {properties.get_filter(i)[0]}, which needs a plug-in.",
                remedy="Save it with gzip or no compression.",
            )
    matlab = data.attrs.get("MATLAB_class", b"")
    if data.attrs.get("MATLAB_empty", 0) or matlab in (b"char", b"cell", b"function_handle", b"struct"):
        return False
    return data.dtype.kind in "biuf" and data.shape is not None and data.ndim <= 2


def _may_be_names(data: h5py.Dataset, name: str) -> bool:
    """Return whether a dataset is a short list of text with the name of a list of joints."""
    import h5py

    text = h5py.check_string_dtype(data.dtype) is not None and "MATLAB_class" not in data.attrs
    return bool(
        text
        and holds_names(name)
        and data.shape is not None
        and data.ndim <= 1
        and data.size <= MOST
        and data.dtype.itemsize <= 4 * LONGEST
    )


def _size_of(data: h5py.Dataset) -> int:
    size = data.dtype.itemsize
    for length in data.shape:
        size *= int(length)
    return size
