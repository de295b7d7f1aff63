"""The command line: one command a file, everything heavy imported inside its command."""

from __future__ import annotations

import gc
import os
import sys
from typing import Any

from backdrive._blas import VARIABLES
from backdrive.cli import _interrupt

OBJECTS = 50_000  # new objects between two searches for garbage: imports and compiling make many that stay


def main() -> None:
    """Run the command line.

    Every failure becomes one message and an exit code: 0 to 4, or 130 after Ctrl-C.
    """
    os.environ.update(dict.fromkeys(VARIABLES, "1"))  # nothing is loaded yet
    gc.set_threshold(OBJECTS, 20, 50)
    with _interrupt.watch():
        try:
            code = _run()
            if code == _interrupt.CODE:  # the command has kept and reported its partial result
                _interrupt.leave(said=True)
        except KeyboardInterrupt:
            _interrupt.leave()
        except BrokenPipeError:
            _silence()
            code = 0
        except OSError as error:  # standard output is full or gone: nothing more can be said there
            if _interrupt.signal_came():
                _interrupt.leave()
            _silence()
            print(f"backdrive: cannot write: {error.strerror or error}.", file=sys.stderr)
            code = 2
    sys.exit(code)


def _run() -> int:
    from backdrive.cli._app import Carrier, app
    from backdrive.cli._output import fail, is_usage, refuse
    from backdrive.errors import BackdriveError

    try:
        code = app(standalone_mode=False)
        sys.stdout.flush()
        return code if isinstance(code, int) else 0
    except Carrier as held:
        if not isinstance(held.error, Exception) or isinstance(held.error, OSError):
            raise held.error from None
        error = held.error
    except OSError:
        raise
    except Exception as failure:
        error = failure
    if not isinstance(error, BackdriveError) and _interrupt.signal_came():
        raise KeyboardInterrupt from None
    if is_usage(error):
        return refuse(error)
    return fail(error, as_json="--json" in sys.argv)


def _silence() -> None:
    """Keep the interpreter from writing to a broken standard output once more as it ends."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def __getattr__(name: str) -> Any:
    if name != "app":
        raise AttributeError(f"module 'backdrive.cli' has no attribute '{name}'")
    from backdrive.cli._app import app

    return app
