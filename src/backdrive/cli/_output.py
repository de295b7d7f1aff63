"""What all commands share: JSON or tables on the way out, and failures as one message with an exit code."""

from __future__ import annotations

import json
import math
import os
from typing import Any

import typer

from backdrive.errors import BackdriveError


def fail(error: Exception, *, as_json: bool) -> int:
    """Print an error and return its exit code.

    Args:
        error: anything; what is not a `BackdriveError` is an internal fault (4).
        as_json: print one JSON object on standard output instead of a sentence on standard error.
    """
    code = error.exit_code if isinstance(error, BackdriveError) else 4
    kind = type(error).__name__
    message = str(error) if isinstance(error, BackdriveError) else f"internal error: {kind}: {error}"
    if as_json:
        print_json({"ok": False, "error": {"kind": kind, "message": message}, "exit_code": code})
    else:
        typer.echo(f"backdrive: {message}", err=True)
    if code == 4:
        if os.environ.get("BACKDRIVE_TRACEBACK"):
            import traceback

            traceback.print_exception(error)
        elif not as_json:
            typer.echo("Set BACKDRIVE_TRACEBACK=1 to see where, and please report it.", err=True)
    return code


def print_json(value: Any) -> None:
    """Print one JSON document; numbers that are not finite become null."""
    typer.echo(json.dumps(_plain(value), indent=2, ensure_ascii=False))


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
