"""`backdrive identify`: from logs to a model file and a report."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from backdrive.cli import _interrupt, _logs
from backdrive.cli._output import echo
from backdrive.cli._progress import progress
from backdrive.cli._targets import check_targets

if TYPE_CHECKING:
    from backdrive.identification import Identification


@_logs.with_reading
def command(
    logs: _logs.Logs,
    law: Annotated[
        str | None,
        typer.Option(
            "--law",
            help="Search any law: auto, a law, or several: stribeck-gauss,stribeck-gauss+lugre (see `backdrive laws`).  With "
            "--method motion or constant-velocity: only coulomb-viscous or polyline.  [default: a curve, by data]",
        ),
    ] = None,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="Model file to write (JSON).")] = None,
    report: Annotated[Path | None, typer.Option("--report", help="Report to write (one HTML file).")] = None,
    method: Annotated[
        str, typer.Option("--method", help="auto, sweep, constant-velocity, motion, ramp, arm or dynamic.")
    ] = "auto",
    reading: _logs.Reading = _logs.USUAL,
    joint: _logs.Joints = None,
    plan: _logs.PlanFiles = None,
    start: _logs.Start = None,
    urdf: Annotated[Path | None, typer.Option("--urdf", help="Robot description, for a whole arm.")] = None,
    hold_out: Annotated[
        list[Path] | None,
        typer.Option(
            "--hold-out",
            help="Log for judging the model, not used in the fit; may be repeated.  [default: parts of the fitted "
            "ones]",
        ),
    ] = None,
    symmetric: Annotated[
        bool | None,
        typer.Option(
            "--symmetric/--by-direction",
            help="One curve for both directions, or one for each.  [default: by data]",
        ),
    ] = None,
    gravity: Annotated[
        bool | None,
        typer.Option(
            "--gravity/--no-gravity", help="Estimate gravity (motion, dynamic).  [default: by data]"
        ),
    ] = None,
    literal: Annotated[
        bool,
        typer.Option("--literal", help="The sweep exactly as printed in the thesis, without corrections."),
    ] = False,
    torque_timing: Annotated[
        str | None,
        typer.Option(
            "--torque-timing",
            help="Timing of the sweep's torque: command (applied from its sample on) or sample (measured with the "
            "position).  "
            "[default: as the motion tells]",
        ),
    ] = None,
    payload: Annotated[
        str | None,
        typer.Option(
            "--payload",
            metavar="SIN:COS,...",
            help="Gravity of a known payload, one entry a log: SIN:COS of SIN sin q + COS cos q [N.m], or 0 without "
            "payload. For example 0,0,0,0:20,0:20,0:20.  Sweeps then separate friction while the motor lifts the load from "
            "friction while the load drives the motor.",
        ),
    ] = None,
    cutoff: Annotated[
        float | None,
        typer.Option(
            "--cutoff",
            help="Low pass of the motion before differentiation [Hz].  [default: by sampling rate and encoder]",
        ),
    ] = None,
    bound: Annotated[
        list[str] | None,
        typer.Option("--bound", help="Range of a parameter, NAME=LOW:HIGH in SI units; may be repeated."),
    ] = None,
    drive: Annotated[
        str | None,
        typer.Option(
            "--drive",
            help="Fit without torque, from the drive's input (--map u=...). Give the kind of input (torque, position, "
            "velocity, voltage or duty) and the drive's parameters: position,proportional=2000,derivative=60.",
        ),
    ] = None,
    known: Annotated[
        str | None,
        typer.Option(
            "--known",
            help="Parameters with known values, which are not fitted: inertia=0.5,offset=0 (for --law only), or the delay of the "
            "torque behind the motion in seconds: delay=0.004 (for any method but constant-velocity and ramp).",
        ),
    ] = None,
    interval: Annotated[
        str, typer.Option("--interval", help="Kind of the 95 % intervals: covariance, profile or bootstrap.")
    ] = "covariance",
    loss: Annotated[str, typer.Option("--loss", help="linear, huber or absolute.")] = "huber",
    step: Annotated[
        float | None,
        typer.Option(
            "--step",
            help="Longest integration step of a fit with --drive, and the period of a position controller in the drive [s].  "
            "[default: by the drive]",
        ),
    ] = None,
    seed: Annotated[int, typer.Option("--seed", help="Seed of a search's starting points.")] = 0,
    prior: Annotated[
        Path | None,
        typer.Option(
            "--prior",
            help="What is known before the log: population.json of `backdrive fleet merge`, or a model file with errors. The "
            "model combines both, unless they contradict each other (p < 0.01).",
        ),
    ] = None,
    prior_type: Annotated[
        str | None, typer.Option("--prior-type", help="Type of the robot, if the population has several.")
    ] = None,
    gate: Annotated[
        float,
        typer.Option("--gate", help="Exit with 1 if a joint's residual on held-out data is above this [%]."),
    ] = 50.0,
    accept: _logs.Accept = None,
    repair: _logs.Repair = False,
    as_json: _logs.AsJson = False,
) -> None:
    """Identify the friction of every joint that moves: a curve, or with --law any law, presliding included.

    Example: backdrive identify DATA_EMPS.mat --map "t=t,q=qm,tau=35.15*vir" --unit m -o model.json --report report.html

    A law: backdrive identify DATA_EMPS.mat --map "t=t,q=qm,tau=35.15*vir" --unit m --law auto -o model.json

    A robot of a fleet: backdrive identify log.csv --prior population.json -o model.json

    Without torque: backdrive identify log.csv --map u=goal --drive position,proportional=2000,derivative=60
    """
    from backdrive.cli import _identify_options as parse
    from backdrive.cli import _identify_tables as tables
    from backdrive.errors import ModelFileError
    from backdrive.identification import identify

    check_targets(
        [output],
        [*logs, *(hold_out or []), *(plan or []), *reading.inputs, urdf, prior],
        drawn=[report],
        pages=[report],
    )
    if not gate > 0:
        raise typer.BadParameter(f"--gate {gate}: give a positive percentage.")
    _logs.check_urdf(urdf)
    plans, begin = _logs.plans_from(plan), _logs.start_from(start)
    ranges = parse.bounds(bound)
    controller = parse.drive(drive, ranges)
    known_before = parse.prior(prior, prior_type)
    with progress(quiet=as_json) as say:
        say("Reading")
        read = reading.read(logs)
        held = reading.read_apart(hold_out or [])
        result = identify(
            read,
            method=method,
            plan=plans,
            start=begin,
            joints=joint,
            urdf=str(urdf) if urdf else None,
            held_out=held,
            symmetric=symmetric,
            gravity=gravity,
            law=law,
            literal=literal,
            timing=parse.timing(torque_timing),
            payloads=parse.payloads(payload),
            bounds=ranges,
            known=parse.numbers_by_name([known or ""], "--known"),
            drive=controller,
            loss=loss,
            interval=interval,  # type: ignore[arg-type]
            cutoff=cutoff,
            step=step,
            seed=seed,
            prior=known_before,
            accept=accept or [],
            repair=repair,
            progress=say,
            reading=reading.to_dict(),
        )
        if output:
            try:
                result.model.save(output)
            except ModelFileError:  # what is said of the result tells why
                if not as_json:
                    tables.show_tables(result, [])
                raise
        if report:
            from backdrive.report import write_report

            say("Drawing the report")
            write_report(result, report, command=shlex.join(["backdrive", *sys.argv[1:]]))
    bad = failing(result, gate)
    written = [str(p) for p in (output, report) if p]
    if as_json:
        tables.show_json(result, written, bad)
    else:
        tables.show_tables(result, written)
    if result.stopped:
        raise typer.Exit(_interrupt.CODE)
    if bad:
        if not as_json:
            echo(f"Below the quality gate (not credible, or above {gate:g} %): {', '.join(bad)}.", err=True)
        raise typer.Exit(1)


def failing(result: Identification, gate: float) -> list[str]:
    """Return the joints that are not credible, or whose residual is above the gate [%].

    The residual is that of held-out data if there are any.
    """
    from backdrive.identification.quality import grade

    bad = []
    for j in result.model.joints:
        quality = j.held_out or j.fitted
        above = quality is not None and not quality.residual <= gate
        if above or grade(j).word == "not credible":
            bad.append(j.joint.name)
    return bad
