"""`backdrive validate`: judge a model on logs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from backdrive.cli import _logs
from backdrive.cli._output import console as new_console
from backdrive.cli._output import echo, print_json, print_lines, table
from backdrive.cli._progress import progress

if TYPE_CHECKING:
    from collections.abc import Mapping

    from backdrive.model import FrictionModel


@_logs.with_reading
def command(
    model: Annotated[
        str, typer.Argument(help="Model file made by `identify -o` or `fit -o`, or preset:NAME.")
    ],
    logs: _logs.Logs,
    reading: _logs.Reading = _logs.USUAL,
    urdf: Annotated[
        Path | None, typer.Option("--urdf", help="Robot description, for the model of an arm.")
    ] = None,
    rename: _logs.Rename = None,
    gate: Annotated[
        float, typer.Option("--gate", help="Exit with 1 where a joint's residual is above this [%].")
    ] = 50.0,
    accept: _logs.Accept = None,
    repair: _logs.Repair = False,
    as_json: _logs.AsJson = False,
) -> None:
    """Compare measured with predicted torque, joint by joint; for logs without torque, compare the motion under the drive's
    input.

    Example: backdrive validate model.json other_log.csv
    """
    from backdrive import load_model
    from backdrive.identification import validate, validate_motion
    from backdrive.identification.names import rename_joints
    from backdrive.identification.repairs import healthy

    loaded = load_model(model)
    _logs.check_urdf(urdf)
    with progress(quiet=as_json) as say:
        say("Reading")
        read = reading.read(logs)
        read = [log.replace(joints=rename_joints(log.joints, rename or [])) for log in read]
        say("Checking the logs")
        suspect: list[str] = []
        read = [healthy(log, accept or [], repair, suspect) for log in read]
        say("Predicting")
        by_motion = all(
            log.torque is None and (log.drive_input is not None or log.reference is not None) for log in read
        )
        if by_motion:
            qualities = validate_motion(loaded, read)
        else:
            qualities = validate(loaded, read, urdf=str(urdf) if urdf else None, remarks=suspect)
            suspect += [
                f"Joint '{name}': {remark}" for name in qualities for remark in loaded.joint(name).remarks()
            ]
    bad = [name for name, q in qualities.items() if not q.residual <= gate]
    if as_json:
        rows = {name: _figures(q, by_motion) for name, q in qualities.items()}
        print_json({"ok": not bad, "joints": rows, "below_gate": bad, "warnings": suspect})
    else:
        _print(loaded, qualities, suspect, by_motion)
        if bad:
            echo(f"Above the gate of {gate:g} %: {', '.join(bad)}.", err=True)
    if bad:
        raise typer.Exit(1)


def _figures(quality: Any, by_motion: bool) -> dict[str, Any]:
    if by_motion:
        return {"motion_residual_percent": quality.residual, "rms": quality.rms, "samples": quality.samples}
    return {
        "residual_percent": quality.residual,
        "residual_raw_percent": quality.residual_raw,
        "rms": quality.rms,
    }


def _print(model: FrictionModel, qualities: Mapping[str, Any], suspect: list[str], by_motion: bool) -> None:
    """Print how well the torque, or else the motion, of each joint is predicted."""
    console = new_console()
    joints = [(model.joint(name).joint, q) for name, q in qualities.items()]
    if by_motion:
        sentences = (
            f"{joint.name}: its motion from the drive's input is off by {q.residual:.3g} % ({q.rms:.3g} {joint.unit} rms, "
            f"{q.samples} samples)."
            for joint, q in joints
        )
        print_lines(console, sentences, soft_wrap=True)
    else:
        rows = table("joint", "residual below 5 Hz", "raw", "rms", "samples", text=("joint",))
        for joint, q in joints:
            rms = f"{q.rms:.3g} {joint.torque_unit}"
            rows.add_row(joint.name, f"{q.residual:.1f} %", f"{q.residual_raw:.1f} %", rms, str(q.samples))
        console.print(rows)
    print_lines(console, suspect, style="yellow")
