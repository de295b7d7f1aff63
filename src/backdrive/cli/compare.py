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
            help="Compare up to this lower speed [rad/s or m/s].  [default: as far as both hold]",
        ),
    ] = None,
    alarm: Annotated[
        float, typer.Option("--alarm", help="Probability of calling chance a change, a joint.")
    ] = 0.01,
    as_json: _logs.AsJson = False,
) -> None:
    """Compare two models joint by joint: distances (2.16) and (2.17) of their curves, and whether chance explains them.

    Exits with 0 where no joint changed, with 1 where one did, with 2 where nothing can be judged.

    Example: backdrive compare monday.json friday.json

    Example: backdrive compare folded.json stretched.json --joint elbow
    """
    from backdrive.identification.drift.change import change_of

    if top_speed is not None and not 0.0 < top_speed < float("inf"):
        raise InvalidInput(
            f"--top-speed {top_speed:g} is no speed.", remedy="Give a positive, finite number [rad/s or m/s]."
        )
    if not 0.0 < alarm < 1.0:
        raise InvalidInput(
            f"--alarm {alarm:g} is no probability.", remedy="Give one between 0 and 1, such as 0.01."
        )
    models = _load(first), _renamed(_load(second), rename or [])
    pairs, left_out = _pairs(*models, joint)
    try:
        changes = [
            change_of(models[0].joint(a), models[1].joint(b), top_speed=top_speed, alarm=alarm)
            for a, b in pairs
        ]
    except InvalidInput as error:
        raise InvalidInput(f"{first} and {second}: {error.message}", remedy=error.remedy) from error
    unjudged = None
    if not any(c.judged for c in changes):
        unjudged = InvalidInput(
            "Neither change nor its absence can be told.",
            remedy=next((r for c in changes for r in c.remarks if "standard errors" in r), ""),
        )
    _print_json(changes, left_out, unjudged) if as_json else _print_table(changes, left_out)
    if unjudged is not None:
        if as_json:
            raise typer.Exit(unjudged.exit_code)
        raise unjudged
    if any(c.changed for c in changes):
        raise typer.Exit(1)


def _load(name: str) -> FrictionModel:
    """Return a model; what is wrong with it is said with its name."""
    from backdrive import load_model

    try:
        return load_model(name)
    except ModelFileError as error:
        if name in error.message:
            raise
        raise ModelFileError(f"{name}: {error.message}", remedy=error.remedy) from error


def _renamed(model: FrictionModel, pairs: list[str]) -> FrictionModel:
    """Return a model with its joints under the names that a person gives them."""
    from dataclasses import replace

    from backdrive.identification.names import renamed

    if not pairs:
        return model
    joints = renamed([friction.joint for friction in model.joints], pairs)
    named = tuple(replace(friction, joint=joint) for friction, joint in zip(model.joints, joints))
    return replace(model, joints=named, coupling=None, coupled=())


def _pairs(
    first: FrictionModel, second: FrictionModel, joint: list[str] | None
) -> tuple[list[tuple[str, str]], list[str]]:
    """Return names of the joints to compare, and a sentence for every joint that only one model has."""
    from backdrive.identification.names import same_names

    if joint:
        words = [word.partition("=") for word in joint]
        pairs = [(first.joint(a).joint.name, second.joint(b or a).joint.name) for a, _, b in words]
        return list(dict.fromkeys(pairs)), []
    by_order = same_names(
        [j.joint for j in first.joints], [j.joint for j in second.joints], "first", "second"
    )
    common = [name for name in first.names if name in second.names]
    if not common:
        raise InvalidInput(
            f"The models have no joint in common: {', '.join(first.names)}, and {', '.join(second.names)}.",
            remedy=f"Say which is which: --rename {second.names[0]}={first.names[0]}, once for each.",
        )
    left_out = [
        *by_order,
        *(f"Joint '{n}' is only in the first model." for n in first.names if n not in common),
    ]
    left_out += [f"Joint '{n}' is only in the second model." for n in second.names if n not in common]
    return [(name, name) for name in common], left_out


def _print_json(changes: list[Change], left_out: list[str], unjudged: InvalidInput | None) -> None:
    from backdrive.identification.drift.change import REACH, kind_of

    rows = {
        c.joint: {
            "outcome": kind_of(c),
            "verdict": c.verdict,
            "top_speed": c.top_speed,
            "distance": {"positive": c.distance[0], "negative": c.distance[1], "unit": c.unit},
            "relative": {"positive": c.relative[0], "negative": c.relative[1]},
            "mean_change": c.mean,
            "mean_change_interval": [c.mean - REACH * c.mean_error, c.mean + REACH * c.mean_error],
            "chi_square": c.chi_square,
            "degrees_of_freedom": c.degrees,
            "probability": c.probability,
            "alarm": c.alarm,
            "remarks": c.remarks,
        }
        for c in changes
    }
    changed = [c.joint for c in changes if c.changed]
    document = {"ok": unjudged is None, "changed": changed, "joints": rows, "left_out": left_out}
    if unjudged is not None:
        error = {"kind": type(unjudged).__name__, "message": str(unjudged)}
        document |= {"error": error, "exit_code": unjudged.exit_code}
    print_json(document)


def _chance(change: Change) -> str:
    if not change.judged:
        return "-"
    return f"p = {change.probability:.2g}" if change.probability > 1e-12 else "p < 1e-12"


def _print_table(changes: list[Change], left_out: list[str]) -> None:
    headings = ("joint", "up to", "E +q", "E -q", "E_p +q", "E_p -q", "by chance")
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
        console.print(f"{c.joint}: {c.verdict}", style="bold" if c.changed else None, soft_wrap=True)
        print_lines(console, (f"  {remark}" for remark in c.remarks), style="yellow", soft_wrap=True)
    print_lines(console, left_out, style="yellow", soft_wrap=True)
