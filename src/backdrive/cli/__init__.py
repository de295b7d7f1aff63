"""The command line: one command a file, everything heavy imported inside its command."""

from __future__ import annotations

import importlib
import sys

import typer

from backdrive.cli._output import fail

#: Command name -> module that defines `command(...)`; a module is one file and one line here.
COMMANDS = ("demo", "inspect", "plan", "identify", "show", "validate")

app = typer.Typer(
    name="backdrive",
    help="Identify, compensate and estimate the friction of robot joints.",
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
    try:
        app()
    except KeyboardInterrupt:
        typer.echo("Interrupted; nothing half-written was left behind.", err=True)
        sys.exit(130)
    except BrokenPipeError:
        sys.exit(0)
    except Exception as error:
        sys.exit(fail(error, as_json="--json" in sys.argv))
