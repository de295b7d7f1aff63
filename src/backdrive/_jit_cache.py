"""The compile cache on disk: tied to the sources of all kernels, checked for damage, and never a cause of failure.

Every file ends with a digest of its content, which numba's own reader ignores. So a truncated or altered file is detected
before it is unpickled or compiled. Other faults of the cache are an emptied cache, a folder in place of a file, another
owner, or a full or read-only disk. In all cases the cache is discarded and filled again, or functions are compiled in memory,
with one short note per process. The digest detects damage, not attacks: access for others is prevented by the ownership of
the folder.
"""

from __future__ import annotations

import hashlib
import os
import sys
import uuid
from collections.abc import Callable
from contextlib import contextmanager, suppress
from functools import cache
from typing import Any

from numba.core import caching

from backdrive._jit_inner import is_inner

SEAL = hashlib.sha256().digest_size  # bytes at the end of a file

_said: list[str] = []


class CacheDamage(Exception):
    """A file of the cache is not what was written."""


def note(what: str, outcome: str) -> None:
    """Report once per process, on standard error, that the cache could not be used.

    A Python warning is not used, since a filter may turn it into an error.
    """
    if not _said:
        _said.append(what)
        with suppress(OSError, ValueError, AttributeError):  # nobody listens
            what = "".join(c if c.isprintable() else f"\\x{ord(c):02x}" for c in what)
            print(f"backdrive: the compile cache {what}; {outcome}.", file=sys.stderr)


class _Files(caching.IndexDataCacheFile):
    """Numba's index and data files, each with a seal at its end."""

    _index_path: str
    _load_index: Callable[[], dict]  # pyright: ignore[reportIncompatibleMethodOverride]  (numba has no types)
    _data_path: Callable[[str], str]  # pyright: ignore[reportIncompatibleMethodOverride]  (numba has no types)

    def load(self, key):
        name = self._check_index().get(key)
        if name is None:
            return None
        try:
            _check_seal(self._data_path(name))
        except FileNotFoundError:  # the process that named it has not written it yet, or was killed before
            return None
        return self._load_data(name)  # type: ignore[attr-defined]

    def save(self, key, data):
        self._check_index()
        super().save(key, data)

    def _check_index(self) -> dict:
        with suppress(FileNotFoundError):
            _check_seal(self._index_path)
        return self._load_index()

    @contextmanager
    def _open_for_write(self, filepath):  # pyright: ignore[reportIncompatibleMethodOverride]  (numba has no types)
        temporary = f"{filepath}.tmp.{uuid.uuid4().hex[:16]}"
        try:
            with open(temporary, "wb") as stream:
                sealed = _Sealing(stream)
                yield sealed
                stream.write(sealed.digest.digest())
            os.replace(temporary, filepath)
        except BaseException:  # an interruption leaves nothing behind either
            with suppress(OSError):
                os.unlink(temporary)
            raise

    def discard(self) -> None:
        """Remove the index, and with it all that it names; an `OSError` where it cannot be removed."""
        folder, name = os.path.split(self._index_path)
        stem = name.removesuffix(".nbi") + "."
        for entry in os.listdir(folder):
            if entry.startswith(stem) and entry.endswith((".nbi", ".nbc")):
                path = os.path.join(folder, entry)
                with suppress(FileNotFoundError):  # another process was quicker
                    if os.path.isdir(path) and not os.path.islink(path):
                        os.rmdir(path)
                    else:
                        os.unlink(path)


class _Sealing:
    """A stream that is written to, and the digest of what was."""

    def __init__(self, stream):
        self._stream = stream
        self.digest = hashlib.sha256()

    def write(self, data) -> int:
        self.digest.update(data)
        return self._stream.write(data)


def _check_seal(path: str) -> None:
    with open(path, "rb") as stream:
        content = stream.read()
    if len(content) <= SEAL or hashlib.sha256(memoryview(content)[:-SEAL]).digest() != content[-SEAL:]:
        raise CacheDamage(f"{path} is damaged")


class _Stamp:
    """What is ours about numba's locators: the stamp, and that nobody else may write the folder."""

    stamp: str
    get_cache_path: Callable[[], str]

    def get_source_stamp(self):
        return self.stamp

    def ensure_cache_path(self):
        path = self.get_cache_path()
        try:
            os.makedirs(path, mode=0o700, exist_ok=True)
            if hasattr(os, "getuid") and os.stat(path).st_uid != os.getuid():
                raise OSError(f"{path} belongs to another user")
            super().ensure_cache_path()  # type: ignore[misc]
        except OSError as error:
            _unusable.setdefault(path, _reason_of(error))
            raise


_unusable: dict[str, str] = {}  # folder that cannot hold a cache -> why


@cache
def _classes(stamp: str) -> type:
    """Return the class of caches whose files carry a stamp."""
    ours = {"stamp": stamp}
    locators: Any = [
        type(
            name, (_Stamp, getattr(caching, name, None) or getattr(caching, f"_{name}")), ours
        )  # older: private
        for name in ("UserProvidedCacheLocator", "InTreeCacheLocator", "UserWideCacheLocator")
    ]

    class Implementation(caching.CompileResultCacheImpl):
        _locator_classes = locators

        def get_filename_base(self, fullname, abiflags):
            return super().get_filename_base(fullname, abiflags) + ".sealed"

    class Cache(caching.FunctionCache):
        _impl_class = Implementation
        _impl: Any
        _cache_file: _Files
        _cache_path: str
        disable: Callable[[], None]  # pyright: ignore[reportIncompatibleMethodOverride]  (numba has no types)

        def __init__(self, py_func):
            super().__init__(py_func)
            self._cache_file = _Files(
                cache_path=self._cache_path,
                filename_base=self._impl.filename_base,
                source_stamp=self._impl.locator.get_source_stamp(),
            )

        def _index_key(
            self, sig, codegen
        ):  # numba's own differs from process to process where a cell holds a kernel
            code, cells = self._py_func.__code__, self._py_func.__closure__ or ()  # type: ignore[attr-defined]
            closed = "\n".join(
                [f"inner: {is_inner(self._py_func)}", *(_label(cell.cell_contents) for cell in cells)]
            )
            marks = hashlib.sha256(code.co_code).hexdigest(), hashlib.sha256(closed.encode()).hexdigest()
            return sig, codegen.magic_tuple(), marks

        def load_overload(self, sig, target_context):
            try:
                return super().load_overload(sig, target_context)
            except Exception as error:
                self._start_anew(error)
                return None

        def save_overload(self, sig, data):
            try:
                super().save_overload(sig, data)
            except (OSError, CacheDamage) as error:
                self._start_anew(error, lambda: super(Cache, self).save_overload(sig, data))
            except (
                Exception
            ):  # numba has nothing whole to write, as after an interruption: it stays in memory
                pass

        def _start_anew(self, error: Exception, then: Callable[[], None] = lambda: None) -> None:
            """Discard the cache of this function; if that fails, do not use its cache again."""
            outcome = "it is filled again"
            try:
                self._cache_file.discard()
                self._impl.locator.ensure_cache_path()
                then()
            except Exception:
                self.disable()
                outcome = "compiling in memory"
            note(_reason(error, self._cache_path), outcome)

    return Cache


def _label(value: Any) -> str:
    """Return what tells the value of a cell from others, the same in every process."""
    source = getattr(value, "py_func", None)
    return repr(value) if source is None else f"{source.__module__}.{source.__qualname__}"


def _reason(error: Exception, path: str) -> str:
    return f"in {path} " + (
        "is damaged" if isinstance(error, CacheDamage) else f"cannot be used ({_reason_of(error)})"
    )


def _reason_of(error: Exception) -> str:
    return (isinstance(error, OSError) and error.strerror) or str(error) or type(error).__name__


def _holds_cache(path: str, by: Any) -> bool:
    """Return whether an unusable folder holds a cache of ours, for which another folder is now filled the first time."""
    if os.path.exists(by._cache_file._index_path):
        return False
    with suppress(OSError):
        return any(entry.endswith((".nbi", ".nbc")) and ".sealed" in entry for entry in os.listdir(path))
    return False


def cache_of(function: Callable, stamp: str) -> Any:
    """Return a cache for a function, or None where there is no place for one.

    Args:
        function: plain, to be compiled.
        stamp: says which sources there are; an entry with another stamp is not used.
    """
    try:
        found = _classes(stamp)(function)
    except (RuntimeError, OSError):  # no locator found a folder
        found = None
    asked = os.environ.get("NUMBA_CACHE_DIR")
    for path, why in _unusable.items():
        # a tree that others own is nothing to speak of, but one that held a cache is, once: when another is filled for it
        if found is None or (asked and os.path.dirname(path) == asked) or _holds_cache(path, found):
            note(
                f"in {path} cannot be used ({why})",
                f"using {found.cache_path}" if found else "compiling in memory",
            )
            break
    return found
