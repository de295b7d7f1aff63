"""Places where no regular file is: devices, FIFOs, sockets, folders, links, read-only and full disks."""

from __future__ import annotations

import os
import shutil
import socket
import stat
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path


def device(path: Path) -> str:
    """Make the node of a harmless device; where that is not allowed, a link to one."""
    try:
        os.mknod(path, stat.S_IFCHR | 0o666, os.makedev(1, 3))
        return "a device"
    except OSError:
        path.symlink_to("/dev/null")
        return "a device"


def device_link(path: Path) -> str:
    """Make a link to a device without end."""
    path.symlink_to("/dev/zero")
    return "a device"


def fifo(path: Path) -> str:
    """Make a FIFO."""
    os.mkfifo(path)
    return "a FIFO"


def fifo_link(path: Path) -> str:
    """Make a link to a FIFO."""
    os.mkfifo(path.with_name("a-fifo"))
    path.symlink_to("a-fifo")
    return "a FIFO"


def listener(path: Path) -> str:
    """Make a socket."""
    before = os.getcwd()
    os.chdir(path.parent)
    with socket.socket(socket.AF_UNIX) as made:
        made.bind(path.name)
    os.chdir(before)
    return "a socket"


def folder(path: Path) -> str:
    """Make a folder."""
    path.mkdir()
    return "a folder"


def ring(path: Path) -> str:
    """Make a link to itself."""
    path.symlink_to(path.name)
    return "link"


def dangling(path: Path) -> str:
    """Make a link to nothing."""
    path.symlink_to("nothing")
    return "does not exist"


def protected(path: Path) -> str:
    """Make a file that nobody may write."""
    path.write_bytes(b"mine")
    path.chmod(0o444)
    return "write-protected"


def huge(path: Path) -> str:
    """Make a file of a terabyte of holes."""
    with open(path, "wb") as stream:
        stream.truncate(1 << 40)
    return "than"  # larger than, more than


PLACES: dict[str, Callable[[Path], str]] = {
    "device": device,
    "link to a device": device_link,
    "FIFO": fifo,
    "link to a FIFO": fifo_link,
    "socket": listener,
    "folder": folder,
    "ring of links": ring,
    "link to nothing": dangling,
    "write-protected": protected,
}


def look(path: Path) -> tuple[int, int, int]:
    """Return kind and mode, device number and inode of what stands at a path."""
    found = os.lstat(path)
    return found.st_mode, found.st_rdev, found.st_ino


@contextmanager
def small_disk(at: Path) -> Iterator[bool]:
    """Mount a small disk in memory; False where that is not permitted."""
    at.mkdir()
    mounted = os.geteuid() == 0 and shutil.which("mount") is not None
    if mounted:
        done = subprocess.run(
            ["mount", "-t", "tmpfs", "-o", "size=256k", "tmpfs", str(at)], capture_output=True, check=False
        )
        mounted = done.returncode == 0
    try:
        yield mounted
    finally:
        if mounted:
            subprocess.run(["umount", str(at)], capture_output=True, check=False)


def fill(disk: Path) -> None:
    """Write to a disk until it is full."""
    handle = os.open(disk / "filler", os.O_WRONLY | os.O_CREAT)
    try:
        for size in (4096, 1):
            while True:
                try:
                    os.write(handle, b"x" * size)
                except OSError:
                    break
    finally:
        os.close(handle)


def protect_disk(at: Path) -> bool:
    """Make a mounted disk read-only; False where that fails."""
    done = subprocess.run(["mount", "-o", "remount,ro", str(at)], capture_output=True, check=False)
    return done.returncode == 0
