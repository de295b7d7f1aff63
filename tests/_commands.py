"""The command line, in a process of its own or in this one: the same arguments, exit codes and texts, without another start."""

import contextlib
import io
import os
import subprocess
import sys
from unittest import mock

from backdrive.cli import main

ENVIRONMENT = {"NO_COLOR": "1", "COLUMNS": "200", "PYTHONIOENCODING": "utf-8"}


def started(*arguments, cwd=None, **environment) -> subprocess.CompletedProcess:
    """Run `backdrive ...` as a process."""
    return subprocess.run(
        [sys.executable, "-m", "backdrive", *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        cwd=cwd,
        env=os.environ | ENVIRONMENT | environment,
    )


def called(*arguments, **environment) -> subprocess.CompletedProcess:
    """Run `backdrive ...` in this process; what is raised beyond an exit is raised here."""
    words = ["backdrive", *map(str, arguments)]
    out, err = (io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True) for _ in range(2))
    code = 0
    with (
        mock.patch.object(sys, "argv", words),
        mock.patch.dict(os.environ, ENVIRONMENT | environment),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        try:
            main()
        except SystemExit as end:
            code = end.code or 0
    texts = [stream.buffer.getvalue().decode() for stream in (out, err)]
    return subprocess.CompletedProcess(words, code, *texts)
