"""The table of commands, with their names and help, and the errors that bypass the command line's parser."""

from __future__ import annotations

import functools
import importlib
from collections.abc import Callable
from typing import Any

import typer

from backdrive.cli._help import LINES, PlainCommand
from backdrive.cli._output import echo

#: Command name -> module that defines `command(...)`; a module is one file and one line here.
COMMANDS = (
    "demo",
    "inspect",
    "plan",
    "identify",
    "show",
    "validate",
    "compare",
    "estimate",
    "tune",
    "export",
    "laws",
    "reproduce",
)

#: Group name -> module that defines `COMMANDS` (name -> command) and `Group`, the class that parses the group's arguments.
GROUPS = ("fleet",)

#: Former name of a command -> its present name.
RENAMED = {"fit": "identify --law auto"}

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


class Carrier(Exception):
    """Carries an error past the command line's parser, which would print "Aborted!" and exit with 1 instead."""

    def __init__(self, error: BaseException):
        super().__init__(str(error))
        self.error = error


def _carry(command: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(command)
    def run(*arguments: Any, **options: Any) -> Any:
        try:
            return command(*arguments, **options)
        except (KeyboardInterrupt, EOFError, OSError) as error:
            raise Carrier(error) from error

    return run


@app.callback(invoke_without_command=True)
def _root(version: bool = typer.Option(False, "--version", help="Print the version and exit.")) -> None:
    if version:
        from backdrive import __version__

        echo(f"backdrive {__version__}")
        raise typer.Exit()


for _name in COMMANDS:
    app.command(_name, cls=PlainCommand, short_help=LINES[_name])(
        _carry(importlib.import_module(f"backdrive.cli.{_name}").command)
    )

for _name in GROUPS:
    _module = importlib.import_module(f"backdrive.cli.{_name}")
    _group = typer.Typer(
        cls=_module.Group,
        help=_module.HELP,
        short_help="Identify a fleet's logs; list joints whose friction changed.",
        epilog=_module.EXAMPLE,
        no_args_is_help=True,
        rich_markup_mode=None,
    )
    for _inner, _command in _module.COMMANDS.items():
        _group.command(_inner, cls=PlainCommand, short_help=LINES[_inner])(_carry(_command))
    app.add_typer(_group, name=_name)


def _rename(old: str, new: str) -> Callable[[], None]:
    def command() -> None:
        from backdrive.errors import OldName

        raise OldName(f"'backdrive {old}' has a new name.", remedy=f"Use 'backdrive {new}'.")

    return command


for _old, _new in RENAMED.items():
    app.command(
        _old,
        hidden=True,
        add_help_option=False,
        context_settings={"allow_extra_args": True, "ignore_unknown_options": True},
    )(_rename(_old, _new))
