"""The command line: one command a file, everything heavy imported inside its command."""

from __future__ import annotations

import importlib
import os
import sys

import typer

from backdrive.cli._output import fail

#: Command name -> module that defines `command(...)`; a module is one file and one line here.
COMMANDS = (
    "demo",
    "inspect",
    "plan",
    "identify",
    "fit",
    "show",
    "validate",
    "compare",
    "tune",
    "laws",
    "reproduce",
)

app = typer.Typer(
    name="backdrive",
    help="Identify the friction of robot joints from ordinary logs.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="Example: backdrive identify log.csv -o model.json --report report.html",
)


@app.callback(invoke_without_command=True)
def _root(version: bool = typer.Option(False, "--version", help="Print the version and exit.")) -> None:
    if version:
        from backdrive import __version__

        typer.echo(f"backdrive {__version__}")
        raise typer.Exit()


for _name in COMMANDS:
    app.command(_name)(importlib.import_module(f"backdrive.cli.{_name}").command)


def main() -> None:
    """Run the command line; every failure becomes one message and an exit code (0, 1, 2, 3 or 4)."""
    for threads in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(threads, "1")  # small matrices: more threads only wait for each other
    try:
        sys.exit(_run())
    except BrokenPipeError:
        _silence()
        sys.exit(0)
    except OSError as error:  # standard output is full or gone: nothing more can be said there
        _silence()
        typer.echo(f"backdrive: cannot write: {error.strerror or error}.", err=True)
        sys.exit(2)


def _run() -> int:
    try:
        app()
    except KeyboardInterrupt:
        typer.echo("Interrupted; nothing half-written was left behind.", err=True)
        return 130
    except OSError:
        raise
    except Exception as error:
        return fail(error, as_json="--json" in sys.argv)
    return 0


def _silence() -> None:
    """Keep the interpreter from writing to a broken standard output once more as it ends."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
