"""`backdrive identify`: from logs to a model file and a report."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from backdrive.cli import _logs
from backdrive.cli._output import console as new_console
from backdrive.cli._output import echo

if TYPE_CHECKING:
    from backdrive.identification import Identification
    from backdrive.identification.timing import Timing


def command(
    logs: _logs.Logs,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="Model file to write (JSON).")] = None,
    report: Annotated[Path | None, typer.Option("--report", help="Report to write (one HTML file).")] = None,
    method: Annotated[
        str, typer.Option("--method", help="auto, sweep, constant-velocity, motion, ramp or arm.")
    ] = "auto",
    map: _logs.Map = None,
    joint: _logs.Joints = None,
    plan: _logs.PlanFiles = None,
    urdf: Annotated[Path | None, typer.Option("--urdf", help="Robot description, for a whole arm.")] = None,
    hold_out: Annotated[
        list[Path] | None, typer.Option("--hold-out", help="Log to judge on, not fitted; may be repeated.")
    ] = None,
    symmetric: Annotated[
        bool | None,
        typer.Option(
            "--symmetric/--by-direction",
            help="One curve for both directions, or one each.  [default: by data]",
        ),
    ] = None,
    gravity: Annotated[
        bool | None,
        typer.Option("--gravity/--no-gravity", help="Estimate gravity (motion).  [default: by data]"),
    ] = None,
    law: Annotated[
        str | None,
        typer.Option("--law", help="Only this law: coulomb-viscous or polyline.  [default: by data]"),
    ] = None,
    literal: Annotated[
        bool,
        typer.Option("--literal", help="The sweep exactly as printed in the thesis, without corrections."),
    ] = False,
    torque_timing: Annotated[
        str | None,
        typer.Option(
            "--torque-timing",
            help="The sweep's torque is a command (held from its sample on) or a sample (taken with the position).  "
            "[default: as the motion tells]",
        ),
    ] = None,
    payload: Annotated[
        str | None,
        typer.Option(
            "--payload",
            metavar="SIN:COS,...",
            help="Gravity of a known payload in each log, SIN sin q + COS cos q [N.m], 0 for none: 0,0,0,0:20,0:20,0:20.  Sweeps "
            "then tell friction where the motor lifts from friction where it is driven back.",
        ),
    ] = None,
    cutoff: Annotated[
        float | None, typer.Option("--cutoff", help="Low pass of the motion before differentiation [Hz].")
    ] = None,
    gate: Annotated[
        float,
        typer.Option("--gate", help="Exit with 1 where the unseen residual of a joint is above this [%]."),
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
    """Identify the friction of every joint that moves.

    Example: backdrive identify DATA_EMPS.mat --map "t=t,q=qm,tau=35.15*vir" --unit m -o model.json --report report.html
    """
    from backdrive.cli._progress import progress
    from backdrive.identification import identify

    _logs.check_targets([output], [*logs, *(hold_out or []), *(plan or []), urdf], drawn=[report])
    if not gate > 0:
        raise typer.BadParameter(f"--gate {gate}: give a positive percentage.")
    _logs.check_urdf(urdf)
    plans = _logs.plans_from(plan)
    options = {
        "map": map,
        "names": names,
        "units": unit,
        "gear": gear,
        "counts": counts,
        "format": format,
        "topic": topic,
    }
    with progress(quiet=as_json) as say:
        say("Reading")
        read = _logs.read(logs, **options)
        held = _logs.read(hold_out, **options) if hold_out else []
        result = identify(
            read,
            method=method,
            plan=plans,
            joints=joint,
            urdf=str(urdf) if urdf else None,
            held_out=held,
            symmetric=symmetric,
            gravity=gravity,
            law=law,
            literal=literal,
            timing=_timing(torque_timing),
            payloads=_payloads(payload),
            cutoff=cutoff,
            accept=accept or [],
            repair=repair,
            progress=say,
            reading={k: v for k, v in options.items() if v is not None},
        )
        if output:
            result.model.save(output)
        if report:
            from backdrive.report import write_report

            say("Drawing the report")
            write_report(result, report, command=shlex.join(["backdrive", *sys.argv[1:]]))
    bad = failing(result, gate)
    if as_json:
        _print_json(result, output, report, bad)
    else:
        _print_table(result, output, report)
    if bad:
        if not as_json:
            echo(f"Below the quality gate (not credible, or above {gate:g} %): {', '.join(bad)}.", err=True)
        raise typer.Exit(1)


def _timing(word: str | None) -> Timing | None:
    if word is None:
        return None
    from backdrive._catalog import lookup

    known: dict[str, Timing] = {"command": "command", "sample": "sample"}
    return lookup(word, known, "timing of the torque")


def _payloads(text: str | None) -> list[tuple[float, float]] | None:
    if text is None:
        return None
    from math import isfinite

    from backdrive.errors import InvalidInput

    found = []
    for word in text.split(","):
        try:
            sine, cosine = map(float, (word if ":" in word else f"{word}:{word}").split(":"))
        except ValueError:
            sine = cosine = float("nan")
        if not (isfinite(sine) and isfinite(cosine)) or (":" not in word and sine != 0.0):
            raise InvalidInput(
                f"--payload {word!r}: neither 0 nor SIN:COS.",
                remedy="A payload of 2 kg at 1 m that hangs level at q = 0 is 0:19.6.",
            )
        found.append((sine, cosine))
    return found


def failing(result: Identification, gate: float) -> list[str]:
    """Return the joints that are not credible, or whose unseen (or else fitted) residual is above the gate [%]."""
    from backdrive.identification.grade import credible

    bad = []
    for j in result.model.joints:
        quality = j.held_out or j.fitted
        if not credible(j) or (quality is not None and not quality.residual <= gate):
            bad.append(j.joint.name)
    return bad


def _print_json(result: Identification, output: Path | None, report: Path | None, bad: list[str]) -> None:
    import json

    from backdrive.cli._output import print_json
    from backdrive.model.file import encode

    print_json(
        {
            "ok": not bad,
            "below_gate": bad,
            "method": result.method,
            "reason": result.reason,
            "warnings": result.warnings,
            "notes": result.notes,
            "verdicts": {e.joint: e.verdict for e in result.evidence},
            "model": json.loads(encode(result.model)),
            "written": [str(p) for p in (output, report) if p],
        }
    )


def _print_table(result: Identification, output: Path | None, report: Path | None) -> None:
    from rich.markup import escape
    from rich.table import Table

    console = new_console()
    console.print(f"Method: {result.method} ({escape(result.reason)}).")
    table = Table(box=None, pad_edge=False)
    for heading in ("joint", "law", "residual fitted", "unseen"):
        table.add_column(heading, justify="left" if heading in ("joint", "law") else "right")
    for j in result.model.joints:
        table.add_row(
            escape(j.joint.name),
            j.law.rate.NAME,
            f"{j.fitted.residual:.1f} %" if j.fitted else "-",
            f"{j.held_out.residual:.1f} %" if j.held_out else "-",
        )
    console.print(table)
    for j, e in zip(result.model.joints, result.evidence):
        console.print(f"{escape(j.joint.name)}: {escape(e.verdict)}")
        for warning in j.warnings:
            console.print(f"  {escape(warning)}", style="yellow")
    for warning in result.warnings:
        console.print(escape(warning), style="yellow")
    for note in result.notes:
        console.print(escape(note), style="dim")
    for path in (output, report):
        if path:
            console.print(f"Wrote {escape(str(path))}")
