"""`backdrive validate`: judge a model on logs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from backdrive.cli import _logs
from backdrive.cli._output import console as new_console
from backdrive.cli._output import echo

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from backdrive.model import FrictionModel, Quality


def command(
    model: Annotated[
        str, typer.Argument(help="Model file made by `identify -o` or `fit -o`, or preset:NAME.")
    ],
    logs: _logs.Logs,
    map: _logs.Map = None,
    urdf: Annotated[
        Path | None, typer.Option("--urdf", help="Robot description, for the model of an arm.")
    ] = None,
    gate: Annotated[
        float, typer.Option("--gate", help="Exit with 1 where a joint's residual is above this [%].")
    ] = 50.0,
    names: _logs.Names = None,
    unit: _logs.Units = None,
    gear: _logs.Gear = None,
    counts: _logs.Counts = None,
    format: _logs.Format = None,
    topic: _logs.Topic = None,
    accept: _logs.Accept = None,
    repair: _logs.Repair = False,
    as_json: _logs.AsJson = False,
) -> None:
    """Compare measured with predicted torque, joint by joint; without torque, motion under the drive's input.

    Example: backdrive validate model.json other_log.csv
    """
    from backdrive import load_model
    from backdrive.cli._output import print_json
    from backdrive.cli._progress import progress
    from backdrive.identification import validate
    from backdrive.identification.options import healthy

    loaded = load_model(model)
    _logs.check_urdf(urdf)
    with progress(quiet=as_json) as say:
        say("Reading")
        read = _logs.read(
            logs, map=map, names=names, units=unit, gear=gear, counts=counts, format=format, topic=topic
        )
        say("Checking the logs")
        suspect: list[str] = []
        read = [healthy(log, accept or [], repair, suspect) for log in read]
        say("Predicting")
        if all(log.torque is None and log.drive_input is not None for log in read):
            from backdrive.identification import validate_motion

            by_motion = validate_motion(loaded, read)
            _show_motion(loaded, by_motion, gate, suspect, as_json)
            return
        qualities = validate(loaded, read, urdf=str(urdf) if urdf else None, remarks=suspect)
        suspect += [f"Joint '{name}': {said}" for name in qualities for said in loaded.joint(name).remarks()]
    bad = [name for name, q in qualities.items() if not q.residual <= gate]
    if as_json:
        rows = {
            name: {"residual_percent": q.residual, "residual_raw_percent": q.residual_raw, "rms": q.rms}
            for name, q in qualities.items()
        }
        print_json({"ok": not bad, "joints": rows, "below_gate": bad, "warnings": suspect})
    else:
        from rich.markup import escape
        from rich.table import Table

        table = Table(box=None, pad_edge=False)
        for heading in ("joint", "residual below 5 Hz", "raw", "rms", "samples"):
            table.add_column(heading, justify="left" if heading == "joint" else "right")
        for name, q in qualities.items():
            force = loaded.joint(name).joint.torque_unit
            table.add_row(
                escape(name),
                f"{q.residual:.1f} %",
                f"{q.residual_raw:.1f} %",
                f"{q.rms:.3g} {force}",
                str(q.samples),
            )
        new_console().print(table)
        for sentence in suspect:
            new_console().print(escape(sentence), style="yellow")
        if bad:
            echo(f"Above the gate of {gate:g} %: {', '.join(bad)}.", err=True)
    if bad:
        raise typer.Exit(1)


def _show_motion(
    model: FrictionModel,
    found: Mapping[str, Quality],
    gate: float,
    suspect: Sequence[str],
    as_json: bool,
) -> None:
    """Print how well the motion is predicted, and exit with 1 where it is above the gate."""
    from backdrive.cli._output import print_json

    bad = [name for name, q in found.items() if not q.residual <= gate]
    if as_json:
        rows = {
            name: {"motion_residual_percent": q.residual, "rms": q.rms, "samples": q.samples}
            for name, q in found.items()
        }
        print_json({"ok": not bad, "joints": rows, "below_gate": bad, "warnings": list(suspect)})
    else:
        for name, q in found.items():
            unit = model.joint(name).joint.unit
            echo(
                f"{name}: its motion from the drive's input is off by {q.residual:.2g} % ({q.rms:.3g} {unit} rms, "
                f"{q.samples} samples)."
            )
        for sentence in suspect:
            echo(sentence)
        if bad:
            echo(f"Above the gate of {gate:g} %: {', '.join(bad)}.", err=True)
    if bad:
        raise typer.Exit(1)
