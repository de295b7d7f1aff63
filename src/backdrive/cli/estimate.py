"""`backdrive estimate`: the external torque on each joint, from a model and a log."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from backdrive.cli import _logs
from backdrive.cli._output import console as new_console
from backdrive.cli._output import echo, print_json, print_lines, table
from backdrive.cli._progress import progress

if TYPE_CHECKING:
    from backdrive.external import ForceEstimate, JointForce


@_logs.shared
def command(
    model: Annotated[str, typer.Argument(help="Model file made by `identify -o`, or preset:NAME.")],
    log: Annotated[
        Path, typer.Argument(metavar="LOG", help="Log file of the same joints, with position and torque.")
    ],
    joint: _logs.Joints = None,
    method: Annotated[
        str,
        typer.Option(
            "--method",
            help="auto, direct, momentum, disturbance, extended or kalman; auto: by the log's noise.",
        ),
    ] = "auto",
    bandwidth: Annotated[
        float | None,
        typer.Option(
            "--bandwidth", help="L [1/s]: the estimate follows 1/L late.  [default: by the log's noise]"
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="FILE", help="Write the series to FILE, ending in .csv or .parquet."
        ),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option("--plot", metavar="FILE", help="Draw them into FILE, ending in .svg or .png."),
    ] = None,
    reading: _logs.Reading = _logs.USUAL,
    accept: _logs.Accept = None,
    repair: _logs.Repair = False,
    as_json: _logs.AsJson = False,
) -> None:
    """Estimate the external torque on each joint, without a force sensor.

    Where the log holds that torque (--map tau_ext=COLUMN), it is left out of the estimate and compared with it.

    Example: backdrive estimate model.json contact.csv -o force.csv --plot force.png
    """
    from backdrive import load_model
    from backdrive.errors import InvalidInput
    from backdrive.external import estimate_force
    from backdrive.identification.repairs import healthy

    if output is not None and output.suffix not in (".csv", ".parquet"):
        raise InvalidInput(
            f"{output}: a table is CSV or Parquet.", remedy="Let its name end in .csv or .parquet."
        )
    _logs.check_targets([output], [log, *_logs.files_of(model), *reading.inputs], drawn=[plot])
    loaded = load_model(model)
    with progress(quiet=as_json) as say:
        say("Reading")
        read = reading.read([log])
        if len(read) > 1:
            raise InvalidInput(f"{log} holds {len(read)} logs.", remedy="Give one file at a time.")
        say("Checking the log")
        suspect: list[str] = []
        sound = healthy(read[0], accept or [], repair, suspect)
        say("Estimating")
        result = estimate_force(loaded, sound, joints=joint, method=method, bandwidth=bandwidth)
        suspect += result.remarks
        if output is not None:
            result.save(output)
        if plot is not None:
            from backdrive.report.pictures.force import save_force

            save_force(plot, result)
    if as_json:
        rows = {j.joint.name: _figures(j) for j in result.joints}
        print_json({"ok": True, "joints": rows, "warnings": suspect})
        return
    _print(result, suspect)
    for path in (output, plot):
        if path is not None:
            echo(f"Wrote {path}.")


def _figures(one: JointForce) -> dict[str, Any]:
    """Return what the command says of a joint, in SI."""
    import numpy as np

    largest = int(np.argmax(np.abs(one.force)))
    return {
        "method": one.method,
        "bandwidth": one.bandwidth,
        "lag": None if np.isnan(one.lag) else one.lag,
        "unit": one.joint.torque_unit,
        "rms": float(np.sqrt(np.mean(one.force**2))),
        "largest": float(one.force[largest]),
        "time_of_largest": float(one.time[largest]),
        "share_outside_band": float(np.mean(one.outside)),
        "rms_error": one.rms_error,
    }


def _print(result: ForceEstimate, remarks: list[str]) -> None:
    """Print a line a joint, and the remarks."""
    console = new_console()
    known = any(j.known is not None for j in result.joints)
    headings = ["joint", "method", "bandwidth", "rms", "largest", "at", "acted on"]
    rows = table(*headings, *(["error, rms"] if known else []), text=("joint", "method"))
    for one in result.joints:
        f, unit = _figures(one), one.joint.torque_unit
        cells = [
            one.joint.name,
            one.method,
            f"{one.bandwidth:.3g} 1/s",
            f"{f['rms']:.3g} {unit}",
            f"{f['largest']:.3g} {unit}",
            f"{f['time_of_largest']:.4g} s",
            f"{100 * f['share_outside_band']:.0f} % of the time",
        ]
        rows.add_row(
            *cells, *([f"{one.rms_error:.3g} {unit}" if one.rms_error is not None else ""] if known else [])
        )
    console.print(rows)
    print_lines(console, remarks, style="yellow")
