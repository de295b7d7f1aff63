"""Commands of `backdrive fleet` that edit its results: forget, rename."""

from __future__ import annotations

from typing import Annotated

import typer

from backdrive.cli._fleet_answers import Results
from backdrive.cli._output import echo
from backdrive.errors import InvalidInput


def forget(
    robot: Annotated[str, typer.Argument(help="Robot whose results are removed, under all its names.")],
    output: Results,
) -> None:
    """Remove a robot from the results. The next run identifies it again if its logs are still listed.

    Example: backdrive fleet forget robot007 -o results/
    """
    from backdrive.fleet.store import Store

    store = Store.open(output)
    with store.lock():
        echo(f"{store.forget(robot)} rows of {robot} were removed.")


def rename(
    pairs: Annotated[
        list[str], typer.Argument(metavar="OLD=NEW", help="Former and present name of a robot.")
    ],
    output: Results,
) -> None:
    """Record a robot's new name, so that both histories are joined. NEW=OLD undoes it.

    Example: backdrive fleet rename robot005=cell3 -o results/
    """
    from backdrive.fleet.renames import record_renames
    from backdrive.fleet.store import Store

    store = Store.open(output)
    names = {}
    for pair in pairs:
        old, sign, new = pair.partition("=")
        if not (old and sign and new) or old == new:
            raise InvalidInput(f"'{pair}' is not a pair of names.", remedy="Write OLD=NEW.")
        names[old] = new
    with store.lock():
        for sentence in record_renames(store, names):
            echo(sentence)
