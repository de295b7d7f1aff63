"""The matrix of a --coupling option."""

from __future__ import annotations

import json
from pathlib import Path

from backdrive._files import read_whole
from backdrive.errors import ReadError

MOST_MATRIX = 1 << 20  # of a coupling's file [B]


def matrix_from(path: Path | None) -> list[list[float]] | None:
    """Return the matrix of a --coupling option, from rows of CSV or a JSON list of lists; or None.

    Raises:
        ReadError: the file cannot be read, or holds no matrix.
    """
    if path is None:
        return None
    text = read_whole(path, MOST_MATRIX).decode("utf-8-sig", errors="replace")
    try:
        if text.lstrip().startswith("["):
            rows = json.loads(text)
        else:
            rows = [
                line.replace(",", " ").replace(";", " ").split() for line in text.splitlines() if line.strip()
            ]
        return [[float(x) for x in row] for row in rows]
    except (ValueError, TypeError, RecursionError) as error:
        raise ReadError(
            f"{path} holds no matrix of numbers ({str(error)[:200]}).",
            remedy="Write the matrix C of q_joint = C q_motor, one line for each joint (1,0,0), or as JSON ([[1,0],[0.5,1]]).",
        ) from error
