"""`backdrive fit`: friction laws from logs, presliding included, and which of them to use."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from backdrive.cli import _interrupt, _logs
from backdrive.cli._output import console as new_console
from backdrive.cli._output import echo

if TYPE_CHECKING:
    from backdrive.identification.dynamic import FitResult


def command(
    logs: _logs.Logs,
    law: Annotated[
        str,
        typer.Option(
            "--law",
            help="auto, a law, or several: stribeck-gauss,stribeck-gauss+lugre (see `backdrive laws`).",
        ),
    ] = "auto",
    output: Annotated[Path | None, typer.Option("-o", "--output", help="Model file to write (JSON).")] = None,
    report: Annotated[Path | None, typer.Option("--report", help="Report to write (one HTML file).")] = None,
    map: _logs.Map = None,
    joint: _logs.Joints = None,
    hold_out: Annotated[
        list[Path] | None,
        typer.Option("--hold-out", help="Log to judge on, not fitted.  [default: every third window]"),
    ] = None,
    gravity: Annotated[
        bool | None,
        typer.Option("--gravity/--no-gravity", help="Seek gravity.  [default: where the joint turns]"),
    ] = None,
    bound: Annotated[
        list[str] | None,
        typer.Option("--bound", help="Range of a parameter, NAME=LOW:HIGH in SI units; may be repeated."),
    ] = None,
    drive: Annotated[
        str | None,
        typer.Option(
            "--drive",
            help="Fit without torque, from the drive's input (--map u=...): torque, position, velocity, voltage or duty, and "
            "its numbers: position,proportional=2000,derivative=60.",
        ),
    ] = None,
    known: Annotated[
        str | None,
        typer.Option("--known", help="What is known and not sought: inertia=0.5,offset=0."),
    ] = None,
    interval: Annotated[
        str, typer.Option("--interval", help="Kind of the 95 % intervals: covariance, profile or bootstrap.")
    ] = "covariance",
    loss: Annotated[str, typer.Option("--loss", help="linear, huber or absolute.")] = "huber",
    cutoff: Annotated[
        float | None,
        typer.Option(
            "--cutoff",
            help="Low pass of the motion before differentiation [Hz].  [default: by sampling rate and encoder]",
        ),
    ] = None,
    step: Annotated[
        float | None,
        typer.Option(
            "--step", help="Longest integration step of a fit with --drive [s].  [default: by the drive]"
        ),
    ] = None,
    gate: Annotated[
        float,
        typer.Option("--gate", help="Exit with 1 where the unseen residual of a joint is above this [%]."),
    ] = 50.0,
    seed: Annotated[int, typer.Option("--seed", help="Of the starts of the search.")] = 0,
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
    """Fit friction laws to every joint that moves, and say which to use.

    Example: backdrive fit DATA_EMPS.mat --map "t=t,q=qm,tau=35.15*vir" --unit m --law auto -o model.json

    Without torque: backdrive fit log.csv --map u=goal --drive position,proportional=2000,derivative=60
    """
    from backdrive.cli._progress import progress
    from backdrive.cli.identify import failing
    from backdrive.identification.dynamic import fit

    _logs.check_targets([output], [*logs, *(hold_out or [])], drawn=[report])
    if not gate > 0:
        raise typer.BadParameter(f"--gate {gate}: give a positive percentage.")
    bounds = _bounds(bound)
    controller = _drive(drive, bounds)
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
        result = fit(
            read,
            law,
            joints=joint,
            held_out=held,
            gravity=gravity,
            bounds=bounds,
            loss=loss,
            interval=interval,  # type: ignore[arg-type]
            drive=controller,
            known=_numbers_of(known, "--known"),
            cutoff=cutoff,
            step=step,
            accept=accept or [],
            repair=repair,
            seed=seed,
            reading={k: v for k, v in options.items() if v is not None},
            progress=say,
        )
        if output:
            result.model.save(output)
        if report:
            from backdrive.report import write_report

            say("Drawing the report")
            write_report(result, report, command=shlex.join(["backdrive", *sys.argv[1:]]))
    written = [str(p) for p in (output, report) if p]
    bad = failing(result, gate)
    if as_json:
        _print_json(result, written, bad)
    else:
        _print_tables(result, written)
    if result.stopped:
        raise typer.Exit(_interrupt.CODE)
    if bad:
        if not as_json:
            echo(f"Below the quality gate (not credible, or above {gate:g} %): {', '.join(bad)}.", err=True)
        raise typer.Exit(1)


def _bounds(words: list[str] | None) -> dict[str, tuple[float, float]]:
    from backdrive.errors import InvalidInput

    found = {}
    for word in words or []:
        name, _, ends = word.partition("=")
        low, colon, high = ends.partition(":")
        try:
            found[name.strip()] = (float(low), float(high))
        except ValueError as error:
            raise InvalidInput(
                f"--bound {word}: not NAME=LOW:HIGH.", remedy="For example --bound stiffness=1e3:1e5."
            ) from error
        if not colon or not found[name.strip()][0] < found[name.strip()][1]:
            raise InvalidInput(
                f"--bound {word}: the lower end is not below the upper one.",
                remedy="Give the lower end first: NAME=LOW:HIGH.",
            )
    return found


def _drive(words: str | None, bounds: dict[str, tuple[float, float]]):
    """Return the drive of the engine that a person names, or None."""
    if words is None:
        return None
    from backdrive.identification.dynamic.drive_of_log import model_of, sought_of
    from backdrive.logs.log import Drive

    law, _, gains = words.partition(",")
    return model_of(Drive(law=law.strip(), gains=_numbers_of(gains, "--drive")), sought_of(bounds))  # type: ignore[arg-type]


def _numbers_of(words: str | None, option: str) -> dict[str, float]:
    from backdrive.errors import InvalidInput

    found = {}
    for word in (words or "").split(","):
        name, _, value = word.partition("=")
        try:
            if name.strip():
                found[name.strip()] = float(value)
        except ValueError as error:
            raise InvalidInput(
                f"{option} {word}: not NAME=NUMBER.", remedy="For example inertia=0.5,gravity_sin=2."
            ) from error
    return found


def _print_json(result: FitResult, written: list[str], bad: list[str]) -> None:
    import json

    from backdrive.cli._output import print_json
    from backdrive.model.file import encode

    print_json(
        {
            "ok": not bad,
            "below_gate": bad,
            "interrupted": result.stopped,
            "warnings": result.warnings,
            "notes": result.notes,
            "intervals": result.intervals,
            "choices": {
                c.joint: {
                    "chosen": c.chosen,
                    "reason": c.reason,
                    "unit": c.unit,
                    "laws": [
                        {
                            "law": x.name,
                            "parameters": x.parameters,
                            "error_fitted": x.error,
                            "error_held_out": x.held_out,
                            "aic": x.aic,
                            "seconds": x.seconds,
                            "remark": x.remark,
                        }
                        for x in c.candidates
                    ],
                }
                for c in result.choices
            },
            "model": json.loads(encode(result.model)),
            "written": written,
        }
    )


def _print_tables(result: FitResult, written: list[str]) -> None:
    from rich.markup import escape
    from rich.table import Table

    console = new_console()
    for choice, friction in zip(result.choices, result.model.joints):
        unit = choice.unit
        table = Table(box=None, pad_edge=False, title=escape(choice.joint), title_justify="left")
        table.add_column("law", no_wrap=True)
        for heading in ("numbers", f"fitted [{unit}]", f"unseen [{unit}]", "AIC", "s"):
            table.add_column(heading.replace("[", r"\["), justify="right")
        table.add_column("remark")
        for c in choice.candidates:
            style = "bold" if c.name == choice.chosen else None
            table.add_row(
                c.name,
                str(c.parameters or "-"),
                f"{c.error:.3g}",
                f"{c.held_out:.3g}",
                f"{c.aic:.0f}",
                f"{c.seconds:.1f}",
                escape(c.remark),
                style=style,
            )
        console.print(table)
        console.print(escape(choice.reason))
        console.print(_numbers(friction, result.intervals.get(choice.joint, {})))
        for warning in friction.warnings:
            console.print(f"  {escape(warning)}", style="yellow")
    for warning in result.warnings:
        console.print(escape(warning), style="yellow")
    for note in result.notes:
        console.print(escape(note), style="dim")
    for path in written:
        console.print(f"Wrote {escape(path)}")


def _numbers(friction, intervals):
    from rich.table import Table

    table = Table(box=None, pad_edge=False)
    for heading in ("number", "value", "standard error", "95 % interval", "unit"):
        table.add_column(heading, justify="left" if heading in ("number", "unit") else "right")

    def add(name: str, value: float, error: float, unit: str, sought: str) -> None:
        ends = ""
        if sought in intervals and not sought.startswith("share"):
            low, high = intervals[sought]
            ends = f"{low:.4g} to {high:.4g}"
        table.add_row(name.replace("[", r"\["), f"{value:.4g}", f"{error:.2g}", ends, unit)

    for rows in (friction.law.rate, friction.law.element):
        for name, parameter in rows.PARAMETERS.items():
            value, error = getattr(rows, name), friction.standard_errors.get(name, float("nan"))
            values = value if parameter.many else (value,)
            spread = error if isinstance(error, (tuple, list)) else [error] * len(values)
            for i, (v, e) in enumerate(zip(values, spread)):
                label = f"{name}[{i}]" if parameter.many else name
                add(label, v, e, parameter.unit_for(friction.joint.unit), label)
    for name, e in friction.dynamics.items():
        add(name, e.value, e.standard_error, e.unit, name)
    return table
