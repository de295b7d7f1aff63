"""Commands of `backdrive fleet` that query its results: trend, drifted, sql, merge, page."""

from __future__ import annotations

import re
from datetime import date
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from backdrive.cli import _logs
from backdrive.cli._output import console as new_console
from backdrive.cli._output import echo, print_json, table
from backdrive.cli._progress import progress
from backdrive.cli._targets import check_targets
from backdrive.errors import InvalidInput

if TYPE_CHECKING:
    from backdrive.fleet.drift import Drift
    from backdrive.fleet.history import History
    from backdrive.fleet.population import Outlier

Results = Annotated[Path, typer.Option("-o", "--output", help="Folder of the results.")]
Rate = Annotated[float, typer.Option("--rate", help="Accepted share of false alarms among the joints named.")]
SHADES = "▁▂▃▄▅▆▇█"
LAST = 30  # days in the table of a trend


def trend(
    joint: Annotated[str, typer.Argument(metavar="ROBOT/JOINT", help="Whose history.")],
    output: Results,
    as_json: _logs.AsJson = False,
) -> None:
    """Show a joint's friction by day, and whether it has changed. The test takes all joints of the fleet into account.

    Example: backdrive fleet trend robot001/q1 -o results/
    """
    joints = _histories(output)
    known = {one.name: one for one in joints}
    if joint not in known:
        near = sorted(name for name in known if joint.lower() in name.lower())[:5] or sorted(known)[:5]
        there = f"There are: {', '.join(near)} ..." if near else "It holds no results."
        raise InvalidInput(f"There is no joint '{joint}' in {output}.", remedy=there)
    from backdrive.fleet.drift import drifts

    drift = next(one for one in drifts(joints) if one.history.name == joint)
    one = drift.history
    if as_json:
        print_json(_drift_row(drift) | {"days": _days(one)})
        return
    console = new_console()
    low, high = float(one.level.min()), float(one.level.max())
    scaled = [(x - low) / (high - low) if high > low else 0.0 for x in one.level[-80:]]
    console.print(f"{one.name}: {drift.sentence}", style="bold" if drift.named else None, soft_wrap=True)
    console.print("".join(SHADES[min(int(x * len(SHADES)), len(SHADES) - 1)] for x in scaled), soft_wrap=True)
    unit = "N.m" if one.unit == "rad" else "N"
    rows = table("day", f"level [{unit}]", "constant", "viscous", "degC", text=("day",))
    for row in _days(one)[-LAST:]:
        warm = "-" if row["temperature"] is None else f"{row['temperature']:.1f}"
        rows.add_row(row["day"], *(f"{row[name]:.4g}" for name in ("level", "constant", "viscous")), warm)
    console.print(rows)
    if one.left_out:
        console.print(f"{one.left_out} results were poor or had no valid day, and are left out.")


def drift(
    output: Results,
    since: Annotated[
        str | None,
        typer.Option("--since", metavar="DATE", help="Only changes whose begin may lie after this day."),
    ] = None,
    rate: Rate = 0.05,
    as_json: _logs.AsJson = False,
) -> None:
    """Name the joints whose friction has changed, the largest change first, robots unlike their siblings, and silent joints.

    Silent joints have no result of the last days, while others have; the date is that of the last one. The expected share of
    false alarms among the changed joints is at most --rate (Benjamini & Hochberg). Exits with 1 if a joint has changed or is
    unlike its siblings.

    Example: backdrive fleet drifted --since 2026-03-01 -o results/
    """
    first = _date(since, "--since") if since else None
    every, apart = _judge(output, rate, first)
    silent = _silent(output, every)
    named = sorted((one for one in every if one.named), key=lambda one: -abs(one.size))
    tested = sum(isfinite(one.p) for one in every)
    if as_json:
        print_json(
            {
                "ok": True,
                "tested": tested,
                "joints": len(every),
                "drifted": [_drift_row(one) for one in named],
                "unlike_siblings": [one.__dict__ | {"sentence": one.sentence} for one in apart],
                "silent": [
                    {
                        "joint": one.history.name,
                        "last": str(one.history.dates()[-1]),
                        "sentence": silent[one.history.name],
                    }
                    for one in every
                    if one.history.name in silent
                ],
            }
        )
    else:
        console = new_console()
        console.print(
            f"{len(named)} of {tested} joints have changed; {len(every) - tested} histories are too short to tell."
        )
        if named:
            rows = table("joint", "change", "since", "interval", "shape", "q", text=("joint", "shape"))
            for one in named:
                assert one.interval is not None
                rows.add_row(
                    one.history.name,
                    f"{100 * one.size:+.1f} %",
                    str(one.onset),
                    f"{one.interval[0]} to {one.interval[1]}",
                    one.shape if one.sure else f"{one.shape}?",
                    f"{one.q:.2g}",
                )
            console.print(rows)
        for one in apart:
            console.print(f"{one.robot}/{one.joint}: {one.sentence}", soft_wrap=True)
        for name, sentence in silent.items():
            console.print(f"{name}: {sentence}", soft_wrap=True)
    if named or apart:
        raise typer.Exit(1)


def sql(
    question: Annotated[
        str, typer.Argument(metavar="SELECT", help="Over the tables `results` and `failures`.")
    ],
    output: Results,
    most: Annotated[int, typer.Option("--most", min=1, help="Largest number of rows to print.")] = 1000,
    as_json: _logs.AsJson = False,
) -> None:
    """Run an SQL query (DuckDB). It can read the tables of the results and nothing else.

    Example: backdrive fleet sql "SELECT robot, avg(constant) FROM results GROUP BY robot" -o results/
    """
    from backdrive.fleet.query import run_query

    answer = run_query(output, question, most=most)
    if as_json:
        rows = [dict(zip(answer.names, map(_cell, row), strict=False)) for row in answer.rows]
        print_json({"ok": True, "rows": rows, "more": answer.more})
        return
    rows = table(*answer.names, text=answer.names)
    for row in answer.rows:
        rows.add_row(*(f"{v:.6g}" if isinstance(v, float) else str(v) for v in row))
    new_console().print(rows)
    if answer.more:
        echo(f"Only the first {most} rows; --most shows more.", err=True)


def merge(
    output: Results,
    population: Annotated[Path, typer.Option("--population", help="Document to write (JSON).")],
    model: Annotated[
        Path | None,
        typer.Option("--model", help="Model file of the mean robot; errors are the spread between robots."),
    ] = None,
    type: Annotated[str, typer.Option("--type", help="Type of the robots of --model.")] = "",
    without: Annotated[
        list[str] | None,
        typer.Option(
            "--without",
            metavar="ROBOT",
            help="Robot to leave out, whose next log is to be combined with the population; may be repeated.",
        ),
    ] = None,
) -> None:
    """Merge robots of a type to a population: the mean robot and the spread between robots.

    Example: backdrive fleet merge -o results/ --population population.json --model mean.json
    """
    from backdrive.fleet.population import merge as merged

    check_targets([population, model], [])
    result = merged(output, without=without or ())
    if model is not None:
        result.model(type).save(model)
    result.save(population)
    for one in result.members:
        spread = [100.0 * row[i] ** 0.5 for i, row in enumerate(one.between)]
        echo(
            f"{one.type or 'robots'}, {one.joint}: {one.robots} robots, spread "
            f"{spread[0]:.1f} % constant, {spread[1]:.1f} % viscous"
            + (f"; left out: {', '.join(one.left_out)}" if one.left_out else "")
        )


def page(
    output: Results,
    target: Annotated[Path, typer.Option("--page", help="HTML file to write.")] = Path("fleet.html"),
    reports: Annotated[
        int,
        typer.Option(
            "--reports",
            min=0,
            help="Number of joints, the worst first, whose last log gets a report beside the page.",
        ),
    ] = 0,
    rate: Rate = 0.05,
) -> None:
    """Write a page of the fleet that needs no network: a picture a joint, the worst first, its history on a click.

    Example: backdrive fleet page -o results/ --page fleet.html
    """
    from backdrive.fleet.page import write_page
    from backdrive.fleet.status import status

    check_targets([target], [], pages=[target])
    with progress() as say:
        say("Judging the joints")
        every, apart = _judge(output, rate, None)
        summary = status(output)
        links = _reports(output, target, every, reports, say)
        write_page(
            target,
            every,
            apart,
            silent=summary["silent"],
            sentences=summary["sentences"],
            reports=links,
            title=f"Fleet {output.name}",
        )
    echo(f"{len(every)} joints in {target}.")


def _histories(output: Path) -> list[History]:
    from backdrive.fleet.history import histories
    from backdrive.fleet.store import Store

    return histories(Store.open(output).table())


def _judge(output: Path, rate: float, since: date | None) -> tuple[list[Drift], list[Outlier]]:
    from backdrive.fleet.drift import drifts
    from backdrive.fleet.population import outliers

    joints = _histories(output)
    return drifts(joints, rate=rate, since=since), outliers(joints, rate=rate)


def _silent(output: Path, every: list[Drift]) -> dict[str, str]:
    from backdrive.fleet.silence import silent_joints
    from backdrive.fleet.store import Store

    store = Store.open(output)
    return silent_joints([one.history for one in every], store.table(failures=True), store.table())


def _date(text: str, option: str) -> date:
    try:
        return date.fromisoformat(text)
    except ValueError as error:
        raise InvalidInput(f"{option} {text} is no date.", remedy="Write it as 2026-03-31.") from error


def _drift_row(one: Drift) -> dict[str, Any]:
    names = ("p", "q", "named", "part", "shape", "sure", "size", "error", "season", "warmth", "sentence")
    dates = {
        "onset": one.onset and str(one.onset),
        "interval": one.interval and [str(day) for day in one.interval],
    }
    return {"joint": one.history.name} | {name: getattr(one, name) for name in names} | dates


def _days(one: History) -> list[dict[str, Any]]:
    columns = zip(one.dates(), one.level, one.constant, one.viscous, one.temperature, one.path, strict=False)
    return [
        {"day": str(d), "level": float(x), "constant": float(c), "viscous": float(v), "path": path}
        | {"temperature": float(T) if isfinite(T) else None}
        for d, x, c, v, T, path in columns
    ]


def _cell(value: Any) -> Any:
    return value if value is None or isinstance(value, (bool, int, float, str, list, dict)) else str(value)


def _reports(output: Path, target: Path, every: list[Drift], count: int, say: Any) -> dict[str, str]:
    """Write reports of the last logs of the worst joints beside the page; return their relative paths by joint."""
    if count <= 0:
        return {}
    from backdrive._files import make_folder
    from backdrive.errors import BackdriveError
    from backdrive.fleet.store import Store
    from backdrive.fleet.work import local_copy
    from backdrive.identification import identify
    from backdrive.logs.readers import read_log
    from backdrive.report import write_report

    options = Store.open(output).options
    folder = make_folder(target.parent / f"{target.stem}-reports", "--page")
    links: dict[str, str] = {}
    for one in sorted((one for one in every if one.named), key=lambda one: -abs(one.size))[:count]:
        name, path = one.history.name, one.history.path[-1]
        file = f"{re.sub(r'[^A-Za-z0-9._-]+', '_', name)[:80]}-{len(links)}.html"
        say(f"Report of {name}")
        try:
            with local_copy(path) as place:
                log = read_log(place, **options.get("reading", {}))
            result = identify(log, **options.get("identification", {}))
            write_report(result, folder / file, command=f"backdrive identify {path}")
        except BackdriveError as error:
            echo(f"No report of {name}: {error.text}", err=True)
            continue
        links[name] = f"{folder.name}/{file}"
    return links
