"""Files: written atomically, read with a size limit; only regular files are accepted.

A file is written under a temporary name in the same folder, synced to the disk, and then renamed over the old file. So an
interruption never damages the old file. The writer holds a lock (flock) on its temporary file. The system releases it when the
process ends, for whatever reason. So the next writer in the folder can distinguish leftovers of killed processes, which it
removes, from files in use.

A link is followed: the file that it points to is replaced, and the link stays. A link that leads to no file is refused, as
are folders, devices, FIFOs, sockets and files that are write-protected. Mode and owner of the old file are kept.
"""

from __future__ import annotations

import contextlib
import errno
import os
import stat
from collections.abc import Mapping
from pathlib import Path

from backdrive.errors import FileTooLarge, ReadError, WriteError, check_path

try:
    import fcntl
except ImportError:  # no such locks: nothing is ever taken for a leftover
    fcntl = None

_HEAD, _TAIL = ".backdrive-", ".part"
_QUIET = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0) | getattr(os, "O_CLOEXEC", 0)
_TRIES = 10
_KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
    (stat.S_ISFIFO, "a FIFO"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISLNK, "a link that leads to no file"),
)
_FULL = {
    errno.ENOSPC: "the disk is full",
    errno.EDQUOT: "the disk quota is used up",
    errno.EFBIG: "the file would be larger than this system allows",
}


def write_whole(path: str | Path, content: str | bytes) -> Path:
    """Write a file whole or not at all, replacing an old one.

    Args:
        path: of the file; a link is followed.
        content: bytes, or text that is written as UTF-8.

    Raises:
        WriteError: the place is no regular file, its folder does not exist or cannot be written, or the disk is full.
    """
    check_path(path)
    return write_together({path: content})[0]


def write_together(contents: Mapping[str | Path, str | bytes] | Mapping[Path, str | bytes]) -> list[Path]:
    """Write several files: none is replaced before all of them are on the disk; otherwise as `write_whole`.

    Args:
        contents: path -> content.
    """
    with contextlib.ExitStack() as stack:
        parts = []
        for name, content in contents.items():
            with _translate_errors(name):
                part = _Part(_target(Path(name)))
                stack.callback(part.close)
                part.open()
                part.fill(content.encode() if isinstance(content, str) else content)
                parts.append(part)
        for name, part in zip(contents, parts, strict=True):
            with _translate_errors(name):
                os.replace(part.path, part.target)
        for folder, name in {
            part.target.parent: name for name, part in zip(contents, parts, strict=True)
        }.items():
            with _translate_errors(name):
                _sync_folder(folder)
    return [Path(name) for name in contents]


def check_writable(path: str | Path, *, make: bool = False) -> None:
    """Refuse a path that `write_whole` would refuse; called before a long computation. The disk may still become full later.

    Args:
        path: of a file that will be written.
        make: its folder will be made where it does not exist.

    Raises:
        WriteError: as `write_whole`.
    """
    with _translate_errors(path), contextlib.ExitStack() as stack:
        target = Path(path)
        while make and not os.path.lexists(target.parent):
            target = target.parent
        part = _Part(_target(target))
        stack.callback(part.close)
        part.open()


def set_aside(path: Path, folder: Path) -> Path:
    """Move a file to a folder of the same disk, and return where it is.

    Raises:
        WriteError: it cannot be moved.
    """
    with _translate_errors(path):
        os.replace(path, folder / path.name)
    return folder / path.name


def make_folder(folder: str | Path, option: str) -> Path:
    """Make a folder, and those above it, where it does not exist.

    Args:
        folder: its path.
        option: of the command that names it, for the remedy.

    Raises:
        WriteError: it cannot be made.
    """
    try:
        Path(folder).mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        raise WriteError(
            f"Cannot make the folder {folder}: {_reason(error)}.", remedy=f"Name another one with {option}."
        ) from error
    return Path(folder)


def read_whole(
    path: str | Path, most: int, *, error: type[ReadError] = ReadError, remedy: str = "Name another file."
) -> bytes:
    """Return the bytes of a regular file, without waiting and without reading more than `most`.

    Args:
        path: of the file; a link is followed.
        most: size beyond which it is refused [B].
        error: class of the error.
        remedy: of the error where the file is too large.

    Raises:
        ReadError: `error`: there is no such file, or it cannot be read, or it is a folder, a device, a FIFO or a socket.
        FileTooLarge: it is larger than `most`; or `error`, where that is another class than `ReadError`.
    """
    try:
        check_regular(path, error=error)  # first: opening some devices does something
        handle = os.open(path, os.O_RDONLY | _QUIET)
        try:
            _refuse_kind(path, os.fstat(handle), error)
            data = bytearray()
            while len(data) <= most and (block := os.read(handle, min(most + 1 - len(data), 1 << 20))):
                data += block
        finally:
            os.close(handle)
    except (OSError, ValueError) as cause:
        raise error(f"Cannot read {path}: {_reason(cause)}.", remedy="Check the path.") from cause
    if len(data) > most:
        kind = FileTooLarge if error is ReadError else error
        raise kind(f"{path} is larger than {most} bytes.", remedy=remedy)
    return bytes(data)


def check_regular(path: str | Path, *, error: type[ReadError] = ReadError) -> os.stat_result:
    """Return the state of a regular file without opening it, or raise an error if it is not a regular file.

    Args:
        path: of the file; a link is followed.
        error: class of the error.

    Raises:
        ReadError: `error`: there is no such file, or it is a folder, a device, a FIFO or a socket.
    """
    try:
        found = os.stat(path)
    except (OSError, ValueError) as cause:
        raise error(f"Cannot read {path}: {_reason(cause)}.", remedy="Check the path.") from cause
    _refuse_kind(path, found, error)
    return found


def _refuse_kind(path: str | Path, found: os.stat_result, error: type[ReadError]) -> None:
    if not stat.S_ISREG(found.st_mode):
        raise error(f"Cannot read {path}: it is {_kind(found)}, not a file.", remedy="Name a file.")


def _kind(found: os.stat_result) -> str:
    return next((word for test, word in _KINDS if test(found.st_mode)), "no regular file")


def _reason(error: OSError | ValueError) -> str:
    if not isinstance(error, OSError):
        return str(error)
    return _FULL.get(error.errno or 0) or error.strerror or str(error)


@contextlib.contextmanager
def _translate_errors(path: str | Path):
    """Convert errors of the system to an error that names the file and a remedy."""
    try:
        yield
    except (OSError, ValueError) as error:
        if isinstance(error, WriteError):
            raise
        number = error.errno if isinstance(error, OSError) else None
        remedy = "Name a folder that exists and can be written."
        if number in _FULL:
            remedy = "Nothing was replaced; make room, or name a file on another disk."
        raise WriteError(f"Cannot write {path}: {_reason(error)}.", remedy=remedy) from error


def _target(path: Path) -> Path:
    """Return the file that is to be replaced, links followed; refuse what is no regular file or is write-protected."""
    target = Path(os.path.realpath(path)) if path.is_symlink() else path
    try:
        found = os.lstat(target)
    except FileNotFoundError:
        if target != path:
            raise WriteError(
                f"Cannot write {path}: it is a link to {target}, which does not exist.",
                remedy=f"Name {target} itself, or remove the link.",
            ) from None
        return target
    if not stat.S_ISREG(found.st_mode):
        raise WriteError(f"Cannot write {path}: it is {_kind(found)}.", remedy="Name a file.")
    if not found.st_mode & 0o222:
        raise WriteError(
            f"Cannot write {path}: it is write-protected.", remedy="Allow writing, or name another file."
        )
    # opening asks the system, which also knows of foreign links in shared folders and of protected disks
    os.close(os.open(path, os.O_WRONLY | _QUIET))
    return target


class _Part:
    """A temporary file beside its target: locked as long as it is open, and gone once it is closed or renamed."""

    def __init__(self, target: Path):
        self.target = target
        self.path = self._new_path()
        self.handle = -1

    def _new_path(self) -> Path:
        return self.target.parent / f"{_HEAD}{os.urandom(8).hex()}{_TAIL}"

    def open(self) -> None:
        """Create it with the mode and owner of the target, and lock it."""
        _remove_leftovers(self.target.parent)
        old = os.lstat(self.target) if self.target.is_file() else None
        mode = 0o666 if old is None else stat.S_IMODE(old.st_mode) & 0o777
        for _ in range(_TRIES):
            self.handle = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | _QUIET, mode)
            # whoever cleans up may have taken it for a leftover before it was locked: then once more, and under another name, for
            # the old one may be about to be removed
            if _lock(self.handle) and os.fstat(self.handle).st_nlink:
                break
            self.close()
            self.path = self._new_path()
        else:
            raise OSError(errno.EAGAIN, "other processes keep removing its temporary file")
        if old is not None:
            with contextlib.suppress(OSError):
                if (old.st_uid, old.st_gid) != (os.geteuid(), os.getegid()):
                    os.fchown(self.handle, old.st_uid, old.st_gid)
            with contextlib.suppress(OSError):
                os.fchmod(self.handle, mode)

    def fill(self, data: bytes) -> None:
        """Write all bytes and bring them to the disk."""
        view = memoryview(data)
        while view:
            view = view[os.write(self.handle, view) :]
        os.fsync(self.handle)

    def close(self) -> None:
        """Remove it, unless it was renamed, and let go of it."""
        with contextlib.suppress(OSError):
            os.unlink(self.path)
        handle, self.handle = self.handle, -1
        if handle >= 0:
            os.close(handle)


def _lock(handle: int) -> bool:
    """Lock a file for as long as it is open; True also where the disk knows no locks."""
    if fcntl is None:
        return True
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        return error.errno not in (errno.EWOULDBLOCK, errno.EACCES)
    return True


def _remove_leftovers(folder: Path) -> None:
    """Remove the temporary files of processes that were killed; those of living ones are locked and stay."""
    if fcntl is None:
        return
    with contextlib.suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if not (entry.name.startswith(_HEAD) and entry.name.endswith(_TAIL)):
                continue
            with contextlib.suppress(OSError):
                if not entry.is_file(follow_symlinks=False):
                    continue
                handle = os.open(entry.path, os.O_RDONLY | os.O_NOFOLLOW | _QUIET)
                try:
                    fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    os.unlink(entry.path)
                finally:
                    os.close(handle)


def _sync_folder(folder: Path) -> None:
    """Bring the new names of a folder to the disk, where the system can."""
    try:
        handle = os.open(folder, os.O_RDONLY | getattr(os, "O_DIRECTORY", 0))
    except OSError:  # a folder that one may write to but not list
        return
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP, errno.EROFS):
            raise
    finally:
        os.close(handle)
