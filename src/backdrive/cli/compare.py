"""`backdrive compare`: has a joint's friction changed between two models, two postures or two days?"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from backdrive.cli import _logs
from backdrive.cli._output import console as new_console
from backdrive.cli._output import print_json, print_lines, table
from backdrive.errors import InvalidInput, ModelFileError

if TYPE_CHECKING:
    from backdrive.identification.drift.change import Change
    from backdrive.identification.drift.comparison import Comparison
    from backdrive.model import FrictionModel


def command(
    first: Annotated[str, typer.Argument(metavar="A.json", help="Earlier model file, or preset:NAME.")],
    second: Annotated[str, typer.Argument(metavar="B.json", help="Later model file, or preset:NAME.")],
    joint: Annotated[
        list[str] | None,
        typer.Option(
            "--joint", "-j", metavar="NAME", help="Only this joint; NAME=OTHER where B calls it OTHER."
        ),
    ] = None,
    rename: _logs.Rename = None,
    top_speed: Annotated[
        float | None,
        typer.Option(
            "--top-speed",
            help="Compare up to this speed only [rad/s or m/s].  [default: as far as both models are valid]",
        ),
    ] = None,
    alarm: Annotated[
        float, typer.Option("--alarm", help="Probability of a false alarm, for each joint.")
    ] = 0.01,
    as_json: _logs.AsJson = False,
) -> None:
    """Compare two models joint by joint: the distances of their curves, and whether noise explains them.

    Exits with 0 if no joint changed, with 1 if one did, with 2 if none did but a joint cannot be tested.

    Example: backdrive compare monday.json friday.json

    Example: backdrive compare folded.json stretched.json --joint elbow
    """
    from backdrive.identification.drift.comparison import compare

    if top_speed is not None and not 0.0 < top_speed < float("inf"):
        raise InvalidInput(
            f"--top-speed {top_speed:g} is no speed.", remedy="Give a positive, finite number [rad/s or m/s]."
        )
    if not 0.0 < alarm < 1.0:
        raise InvalidInput(
            f"--alarm {alarm:g} is no probability.", remedy="Give one between 0 and 1, such as 0.01."
        )
    models = _load(first), _load(second)
    joints = {a: b or a for a, _, b in (word.partition("=") for word in joint or ())}
    try:
        comparison = compare(
            *models,
            joints=joints or None,
            rename=_names(models[1], rename or []),
            top_speed=top_speed,
            alarm=alarm,
        )
    except InvalidInput as error:
        if "no joint in common" in error.message or "--rename" in error.message or "matched" in error.message:
            raise
        raise InvalidInput(f"{first} and {second}: {error.message}", remedy=error.remedy) from error
    unjudged = None
    if not comparison.joints_with_change and (untold := comparison.joints_without_test):
        remarks = (r for c in comparison.changes for r in c.remarks if "standard errors" in r)
        of = "" if len(untold) == len(comparison.changes) else f" of {', '.join(untold)}"
        unjudged = InvalidInput(
            f"The test cannot decide whether friction{of} has changed.", remedy=next(remarks, "")
        )
    if as_json:
        _print_json(comparison, unjudged)
    else:
        _print_table(list(comparison.changes), list(comparison.left_out))
    if unjudged is not None:
        if as_json:
            raise typer.Exit(unjudged.exit_code)
        raise unjudged
    if comparison.joints_with_change:
        raise typer.Exit(1)


def _names(model: FrictionModel, pairs: list[str]) -> dict[str, str]:
    """Return old name -> new name of pairs OLD=NEW, after they were checked."""
    from backdrive.identification.names import rename_joints

    rename_joints([friction.joint for friction in model.joints], pairs)
    return {old.strip(): new.strip() for old, _, new in (pair.partition("=") for pair in pairs)}


def _load(name: str) -> FrictionModel:
    """Return a model; an error message names the model."""
    from backdrive import load_model

    try:
        return load_model(name)
    except ModelFileError as error:
        if name in error.message:
            raise
        raise ModelFileError(f"{name}: {error.message}", remedy=error.remedy) from error


def _print_json(comparison: Comparison, unjudged: InvalidInput | None) -> None:
    document = {"ok": unjudged is None, **comparison.to_dict()}
    if unjudged is not None:
        error = {"kind": type(unjudged).__name__, "message": str(unjudged)}
        document |= {"error": error, "exit_code": unjudged.exit_code}
    print_json(document)


def _chance(change: Change) -> str:
    if not change.is_testable:
        return "-"
    return f"p = {change.probability:.2g}" if change.probability > 1e-12 else "p < 1e-12"


def _print_table(changes: list[Change], left_out: list[str]) -> None:
    headings = ("joint", "up to", "distance +q", "-q", "relative +q", "-q", "by chance")
    rows = table(*headings, text=("joint",), no_wrap=True)
    for c in changes:
        rows.add_row(
            c.joint,
            f"{c.top_speed:.3g}",
            *(f"{d:.3g} {c.unit}" for d in c.distance),
            *(f"{100.0 * r:.2f} %" for r in c.relative),
            _chance(c),
        )
    console = new_console()
    console.print(rows)
    for c in changes:
        console.print(f"{c.joint}: {c.verdict}", style="bold" if c.is_significant else None, soft_wrap=True)
        print_lines(console, (f"  {remark}" for remark in c.remarks), style="yellow", soft_wrap=True)
    print_lines(console, left_out, style="yellow", soft_wrap=True)
