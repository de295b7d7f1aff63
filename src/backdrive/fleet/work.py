"""The work of one worker: reading, health checks, identification and validation of a batch of logs, with one file of rows as
result.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from time import process_time
from typing import TYPE_CHECKING, Any

from backdrive.errors import BackdriveError, ReadError
from backdrive.fleet.entries import printable

if TYPE_CHECKING:
    from backdrive.fleet.batches import Batch
    from backdrive.fleet.entries import LogEntry
    from backdrive.identification import Identification

UNREAD = "unread:"  # in the place of a digest, before the path of a log without one
MOST_TEXT = 2000  # of a message or a warning [characters]


def tag_of(options: Mapping[str, Any]) -> str:
    """Return the digest of options, version and schema that identifies a result."""
    import hashlib

    from backdrive import __version__
    from backdrive.fleet.schema import VERSION

    text = json.dumps([options, __version__, VERSION], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def do_batch(batch: Batch, options: Mapping[str, Any], folder: str) -> dict[str, Any]:
    """Identify a batch and write its rows.

    Args:
        batch: the logs.
        options: `reading` as `read_log` takes it, `identification` as `identify` does.
        folder: of the results.

    Returns:
        Number of logs with results, number of failed logs, and processor time [s].

    Raises:
        WriteError: the rows cannot be written.
    """
    from backdrive.fleet.store import write_rows

    begun, tag = process_time(), tag_of(options)
    rows: list[dict[str, Any]] = []
    failed = 0
    for entry in batch.entries:
        of_log = do_log(entry, options)
        failed += any("failure" in row for row in of_log)
        rows += [row | {"tag": tag} for row in of_log]
    write_rows(Path(folder), batch.month, batch.name, rows)
    return {"done": len(batch.entries), "failed": failed, "seconds": process_time() - begun}


def do_log(entry: LogEntry, options: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the rows of a log: one for each joint, or one with the reason of the failure."""
    if entry.fault:
        return [
            failure(entry, "ReadError", entry.fault, "Check the file, or correct the line of the manifest.")
        ]
    digest = ""
    try:
        with local_copy(entry.place) as path, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                result = _identify_log(path, options)
            except Exception:
                digest = _digest(path) if entry.size else ""  # empty files are no copies of each other
                raise
            digest = result.model.sources[0].sha256
            check_for_changes(entry)
        return [
            _about(entry, digest) | row_of(result, number, entry)
            for number in range(len(result.model.joints))
        ]
    except BackdriveError as error:
        return [failure(entry, type(error).__name__, error.message, error.remedy, digest)]
    except Exception as error:  # an internal fault in one log must not stop the others
        return [
            failure(entry, "InternalError", f"{type(error).__name__}: {error}", "Please report it.", digest)
        ]


def failure(entry: LogEntry, kind: str, message: str, remedy: str = "", digest: str = "") -> dict[str, Any]:
    """Return the row of a log that has no result."""
    return _about(entry, digest or UNREAD + entry.path) | {
        "joint": "",
        "failure": kind,
        "message": plain(message, entry)[:MOST_TEXT],
        "remedy": plain(remedy, entry)[:MOST_TEXT],
    }


def plain(message: str, entry: LogEntry) -> str:
    """Return a message that is the same wherever the log was read: only the file's name, without its folder or that of a
    local copy.
    """
    import tempfile

    name = Path(entry.place).name
    message = message if entry.fault else message.replace(str(Path(entry.place)), name)
    copies = f"{re.escape(tempfile.gettempdir())}/backdrive-[^/\\s]+/"
    return printable(re.sub(copies, "", message))


def _about(entry: LogEntry, digest: str) -> dict[str, Any]:
    from backdrive import __version__

    columns = asdict(entry)
    del columns["fault"], columns["file"]
    return columns | {"digest": digest, "version": __version__}


@contextlib.contextmanager
def local_copy(place: str) -> Iterator[str]:
    """Yield the path of a log on this machine.

    Args:
        place: its path, or its address in an object store.
    """
    if "://" not in place:
        yield place
        return
    from backdrive.fleet.objects import fetch
    from backdrive.logs.readers.limits import Limits

    with fetch(place, Limits().max_file_bytes) as copy:
        yield str(copy)


def check_for_changes(entry: LogEntry) -> None:
    """Refuse a local file that has changed since it was listed: it is still being written.

    Raises:
        ReadError: it has.
    """
    if "://" in entry.path:
        return
    state = os.stat(entry.place)
    if f"{state.st_size}:{state.st_mtime_ns}" != entry.stamp:
        raise ReadError(f"{entry.path} changed while it was read.", remedy="Run again when it is written.")


def _digest(path: str) -> str:
    from backdrive._files import check_regular
    from backdrive.logs.joint import digest

    check_regular(path)
    try:
        return digest(path)
    except OSError as error:
        raise ReadError(f"Cannot read {path}: {error.strerror}.", remedy="Allow reading it.") from error


def _identify_log(path: str, options: Mapping[str, Any]) -> Identification:
    """Return the result of a log; it is read in a process of its own, so that no log affects the next."""
    from backdrive.identification import identify
    from backdrive.logs.readers import read_log
    from backdrive.logs.readers.fork_server import child_a_file

    with child_a_file():
        log = read_log(path, **options.get("reading", {}))
    return identify(log, **options.get("identification", {}))


def row_of(result: Identification, number: int, entry: LogEntry) -> dict[str, Any]:
    """Return the columns of a joint's result.

    Args:
        result: of a log.
        number: of the joint in it.
        entry: the log.
    """
    import numpy as np

    from backdrive.model.prior import line_of

    friction = result.model.joints[number]
    top = max(min(-friction.validity.velocity[0], friction.validity.velocity[1]), 0.0)
    top = top if top > 0 else max(abs(v) for v in friction.validity.velocity)
    constant, viscous = line_of(friction.law, top)
    numbers: dict[str, tuple[Any, Any]] = {
        e: (v.value, v.standard_error) for e, v in friction.dynamics.items()
    }
    for rows in friction.law.parts:
        for name, parameter in rows.PARAMETERS.items():
            value = getattr(rows, name)
            error = friction.standard_errors.get(name)
            if parameter.many:
                errors = error if isinstance(error, Sequence) else [None] * len(value)
                numbers |= {
                    f"{name}[{i}]": (v, e) for i, (v, e) in enumerate(zip(value, errors, strict=True))
                }
            else:
                numbers[name] = (value, error)
    quality = friction.held_out or friction.fitted
    validity = friction.validity.temperature
    matrix = friction.covariance
    said = [*result.warnings, *friction.warnings]
    return {
        "joint": friction.joint.name,
        "unit": friction.joint.unit,
        "method": result.method,
        "law": friction.law.name,
        "parameters": [
            {"name": name, "value": _number(value), "error": _number(error)}
            for name, (value, error) in sorted(numbers.items())
        ],
        "covariance_names": list(matrix.names) if matrix else None,
        "covariance": [x for row in matrix.matrix for x in row] if matrix else None,
        "constant": _number(constant),
        "constant_error": _error(friction.standard_errors, "coulomb"),
        "viscous": _number(viscous),
        "viscous_error": _error(friction.standard_errors, "viscous"),
        "top_speed": _number(top),
        "temperature": _number(np.mean(validity)) if validity else None,
        "residual": _number(quality.residual) if quality else None,
        "rms": _number(quality.rms) if quality else None,
        "grade": friction.verdict.grade if friction.verdict else "unknown",
        "verdict": friction.verdict.text[:MOST_TEXT] if friction.verdict else "",
        "warnings": [plain(sentence, entry)[:MOST_TEXT] for sentence in dict.fromkeys(said)],
    }


def _number(value: Any) -> float | None:
    """Return a finite number or None."""
    import math

    return float(value) if value is not None and math.isfinite(float(value)) else None


def _error(errors: Mapping[str, Any], name: str) -> float | None:
    """Return the standard error of the mean of both directions, for fully correlated errors, the worst case."""
    both = [errors.get(f"{name}_{way}") for way in ("positive", "negative")]
    values = [v for v in map(_number, both) if v is not None]
    return sum(values) / len(values) if values else None
