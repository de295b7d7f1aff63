"""Write a file whole or not at all."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from backdrive.errors import InvalidInput


def write_whole(path: str | Path, content: str | bytes) -> Path:
    """Write `content` to a temporary name beside `path`, then rename it into place.

    Raises:
        InvalidInput: the folder does not exist or cannot be written.
    """
    path = Path(path)
    data = content.encode() if isinstance(content, str) else content
    try:
        handle, temporary = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    except OSError as error:
        raise InvalidInput(
            f"Cannot write {path}: {error.strerror}.", remedy="Name a folder that exists and can be written."
        ) from error
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
        mask = os.umask(0)
        os.umask(mask)
        os.chmod(temporary, 0o666 & ~mask)
        os.replace(temporary, path)
    except BaseException as error:
        if os.path.exists(temporary):
            os.unlink(temporary)
        if isinstance(error, OSError):
            raise InvalidInput(
                f"Cannot write {path}: {error.strerror}.", remedy="Name a file, not a folder."
            ) from error
        raise
    return path
