"""`backdrive estimate`: the external torque on each joint, from a model and a log."""

from __future__ import annotations

import shlex
import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from backdrive.cli import _logs
from backdrive.cli._estimate_output import print_result
from backdrive.cli._output import echo, print_json
from backdrive.cli._payload import center_from, check_options, print_payload
from backdrive.cli._progress import progress
from backdrive.cli._targets import check_targets

COMPARED = (
    "tau_ext",
    "external_torque",
    "wrench",
)  # channels that are only compared, and that other logs need not hold


@_logs.with_reading
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
            "--bandwidth", help="Bandwidth L [1/s]; the estimate lags by 1/L.  [default: by the log's noise]"
        ),
    ] = None,
    urdf: Annotated[
        Path | None,
        typer.Option("--urdf", help="Robot description (URDF or MJCF) that a whole arm was identified with."),
    ] = None,
    frame: Annotated[
        str | None,
        typer.Option(
            "--frame",
            metavar="TOOL",
            help="Link, tool or site of it, at which the wrench is estimated, or that --payload is fixed to.",
        ),
    ] = None,
    wrench_axes: Annotated[
        str | None,
        typer.Option(
            "--wrench-axes",
            help="Axes of the log's own wrench (--map wrench=): frame (those of TOOL) or base.  [default: frame]",
        ),
    ] = None,
    payload: Annotated[
        bool, typer.Option("--payload", help="Mass and center of what the arm carries, instead of the force.")
    ] = False,
    unloaded: Annotated[
        Path | None,
        typer.Option("--unloaded", metavar="LOG", help="Log of the arm without its payload, for --payload."),
    ] = None,
    known_mass: Annotated[
        float | None,
        typer.Option(
            "--known-mass", metavar="KG", help="Known mass of the payload [kg]: calibrates the drives' gains."
        ),
    ] = None,
    at: Annotated[
        str | None,
        typer.Option("--at", metavar="X,Y,Z", help="Known center of the payload in TOOL [m]."),
    ] = None,
    gain_error: Annotated[
        float | None,
        typer.Option(
            "--gain-error", help="Standard deviation of each drive's gain, for --payload.  [default: 0.05]"
        ),
    ] = None,
    free: Annotated[
        list[Path] | None,
        typer.Option(
            "--free",
            metavar="FREE",
            help="Log of motion that nothing touched: calibrates bands and contacts; may be repeated.",
        ),
    ] = None,
    contact: Annotated[
        bool, typer.Option("--contact", help="List contacts; needs --free, preferably an hour or more of it.")
    ] = False,
    false_alarms: Annotated[
        float | None,
        typer.Option(
            "--false-alarms", help="False contacts of all joints together [1/h].  [default with --contact: 1]"
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
    report: Annotated[
        Path | None, typer.Option("--report", metavar="FILE", help="Report to write (one HTML file).")
    ] = None,
    reading: _logs.Reading = _logs.USUAL,
    accept: _logs.Accept = None,
    repair: _logs.Repair = False,
    as_json: _logs.AsJson = False,
) -> None:
    """Estimate the external torque on each joint, without a force sensor.

    A measured external torque (--map tau_ext=COLUMN), or a wrench measured at TOOL (--map "wrench=(fx,fy,fz,mx,my,mz)"), is not
    used in the estimate, but compared with it.

    Bands and contacts are calibrated by a log of free motion, best not the one that the model was identified from.
    A whole arm (`identify --method arm`) needs its description (--urdf); with --frame the table has the wrench there, too.

    With --payload: mass and center of what the arm carries, and the calibration of the drives' gains.

    Example: backdrive estimate model.json contact.csv --free free.csv --contact -o force.csv --report force.html
    """
    from backdrive import load_model
    from backdrive.errors import InvalidInput
    from backdrive.external import estimate_force, estimate_payload
    from backdrive.external.explanation import ACCEPT
    from backdrive.identification.repairs import healthy
    from backdrive.logs.readers._map_parts import without_channels

    if output is not None and output.suffix not in (".csv", ".parquet"):
        raise InvalidInput(
            f"{output}: a table is CSV or Parquet.", remedy="Let its name end in .csv or .parquet."
        )
    check_targets(
        [output],
        [
            log,
            *([unloaded] if unloaded else []),
            *(free or []),
            *_logs.files_of(model),
            *reading.inputs,
            urdf,
        ],
        drawn=[plot, report],
        pages=[report],
    )
    _logs.check_urdf(urdf)
    place = center_from(at)
    check_options(
        payload,
        urdf,
        {"--unloaded": unloaded, "--known-mass": known_mass, "--at": at, "--gain-error": gain_error},
        {
            "--joint": joint,
            "--free": free,
            "--contact": contact,
            "--method": None if method == "auto" else method,
            "--bandwidth": bandwidth,
            "--output": output,
            "--plot": plot,
            "--report": report,
            "--wrench-axes": wrench_axes,
        },
    )
    trusted = [ACCEPT] if ACCEPT in (accept or []) else []
    accept = [name for name in accept or [] if name != ACCEPT]
    if false_alarms is not None and not contact:
        raise InvalidInput("--false-alarms applies to contacts only.", remedy="Add --contact.")
    loaded = load_model(model)
    apart = replace(reading, map=without_channels(reading.map, COMPARED))
    with progress(quiet=as_json) as say:
        say("Reading")
        read = reading.read([log])
        if len(read) > 1:
            raise InvalidInput(f"{log} holds {len(read)} logs.", remedy="Give one file at a time.")
        say("Checking the log")
        suspect: list[str] = []
        sound = healthy(read[0], accept, repair, suspect)
        if payload:
            say("Estimating the payload")
            bare = apart.read_apart([unloaded]) if unloaded else []
            bare = [healthy(one, accept, repair, suspect) for one in bare]
            carried = estimate_payload(
                loaded,
                sound,
                str(urdf),
                frame=frame,
                unloaded=bare[0] if bare else None,
                known_mass=known_mass,
                at=place,
                gain_error=gain_error,
                accept=trusted,
            )
    if payload:
        print_payload(carried, suspect, as_json)
        return
    with progress(quiet=as_json) as say:
        untouched = [healthy(one, accept, repair, suspect) for one in apart.read_apart(free or [])]
        say("Estimating")
        result = estimate_force(
            loaded,
            sound,
            joints=joint,
            method=method,
            bandwidth=bandwidth,
            free=untouched,
            robot=urdf,
            frame=frame,
            wrench_axes=wrench_axes or "frame",
            false_alarms=(1.0 if false_alarms is None else false_alarms) if contact else None,
            accept=trusted,
        )
        suspect += result.remarks
        if output is not None:
            result.save(output)
        if plot is not None:
            from backdrive.report.pictures.force import save_force

            save_force(plot, result)
        if report is not None:
            from backdrive.report.force import write_force_report

            say("Drawing the report")
            write_force_report(
                result, report, command=shlex.join(["backdrive", *sys.argv[1:]]), remarks=suspect
            )
    if as_json:
        print_json({"ok": True} | result.to_dict() | {"warnings": suspect})
        return
    print_result(result, suspect)
    for path in (output, plot, report):
        if path is not None:
            echo(f"Wrote {path}.")
