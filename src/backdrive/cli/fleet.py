"""`backdrive fleet`: identify many logs and find the joints whose friction is changing."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from backdrive.cli import _fleet_answers as answers
from backdrive.cli import _fleet_edits as edits
from backdrive.cli import _logs
from backdrive.cli._fleet_progress import fleet_progress
from backdrive.cli._output import console as new_console
from backdrive.cli._output import echo, print_json, table
from backdrive.cli._progress import progress

if TYPE_CHECKING:
    from backdrive.fleet.run import Outcome

EXAMPLE = "Example: backdrive fleet run logs/ -o results/"
HELP = "Identify the logs of a fleet, and tell whose friction is changing: backdrive fleet logs/ -o results/"


class Group(TyperGroup):
    """Treats a first argument that is not a command as the logs of a run: `backdrive fleet DIR -o results/`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Put `run` in front where no command is named."""
        if args and args[0] not in self.commands and args[0] not in ("-h", "--help"):
            args = ["run", *args]
        return super().parse_args(ctx, args)


@_logs.with_reading
def run(
    source: Annotated[
        list[str],
        typer.Argument(
            metavar="DIR|GLOB|MANIFEST",
            help="Folder, pattern in quotes, CSV with a column `path`, or s3://bucket/folder.",
        ),
    ],
    output: answers.Results,
    workers: Annotated[
        int | None,
        typer.Option("--workers", min=1, help="Processes on this machine.  [default: one a processor]"),
    ] = None,
    cluster: Annotated[
        str | None, typer.Option("--cluster", help="A Dask scheduler to use instead: tls://host:8786.")
    ] = None,
    tls_ca: Annotated[
        str | None, typer.Option("--tls-ca", help="Certificate of its authority (PEM).")
    ] = None,
    tls_cert: Annotated[
        str | None, typer.Option("--tls-cert", help="Certificate of this client (PEM).")
    ] = None,
    tls_key: Annotated[str | None, typer.Option("--tls-key", help="Key of this client (PEM).")] = None,
    insecure: Annotated[bool, typer.Option("--insecure", help="Allow plain tcp to another host.")] = False,
    shard: Annotated[
        str, typer.Option("--shard", help="Only shard i of n shards of the logs, for job arrays: 3/16.")
    ] = "1/1",
    batch: Annotated[int, typer.Option("--batch", min=1, help="Largest number of logs in one task.")] = 64,
    retry: Annotated[bool, typer.Option("--retry", help="Try again the logs that failed.")] = False,
    again: Annotated[
        list[str] | None,
        typer.Option("--again", metavar="ROBOT", help="Identify this robot again; may be repeated."),
    ] = None,
    reading: _logs.Reading = _logs.USUAL,
    law: Annotated[str | None, typer.Option("--law", help="As in `backdrive identify`.")] = None,
    method: Annotated[str, typer.Option("--method", help="As in `backdrive identify`.")] = "auto",
    symmetric: Annotated[
        bool | None,
        typer.Option("--symmetric/--by-direction", help="As in `backdrive identify`.  [default: by data]"),
    ] = None,
    accept: _logs.Accept = None,
    repair: _logs.Repair = False,
    as_json: _logs.AsJson = False,
) -> None:
    """Identify every log that is not done yet; `run` may be left out.

    Logs that fail are listed with the reason. Run the command again at any time, also after Ctrl-C: finished logs are kept.
    Exits with 1 if every log of this run failed.

    Example: backdrive fleet logs/ -o results/
    """
    from backdrive.fleet.cluster import Credentials
    from backdrive.fleet.run import run_fleet

    part = _shard(shard)
    given = reading.to_dict()
    if given.get("join"):
        raise typer.BadParameter("--join belongs to one log; a fleet has many.")
    chosen = {"method": method, "law": law, "symmetric": symmetric, "accept": accept or [], "repair": repair}
    with fleet_progress(quiet=as_json) as say:
        outcome = run_fleet(
            source,
            output,
            reading=given,
            identification={
                name: value for name, value in chosen.items() if value not in (None, [], False, "auto")
            },
            workers=workers,
            cluster=cluster,
            credentials=Credentials(authority=tls_ca, certificate=tls_cert, key=tls_key),
            insecure=insecure,
            shard=part,
            batch=batch,
            retry=retry,
            again=again or [],
            progress=say,
        )
    if as_json:
        from dataclasses import asdict

        print_json({"ok": True} | asdict(outcome))
    else:
        _tell(outcome, output)
    if outcome.done and outcome.failed == outcome.done:
        raise typer.Exit(1)


def _tell(outcome: Outcome, output: Path) -> None:
    rate = f", {outcome.done / outcome.seconds:.3g} a second" if outcome.done else ""
    echo(
        f"{outcome.logs} logs: {outcome.done} done in {outcome.seconds:.1f} s{rate}, {outcome.kept} were done before."
    )
    if outcome.failed:
        echo(f"{outcome.failed} of them failed: backdrive fleet status -o {output} says why.")
    for sentence in outcome.sentences:
        echo(sentence)


def _shard(text: str) -> tuple[int, int]:
    try:
        index, count = (int(part) for part in text.split("/"))
        if 1 <= index <= count:
            return index, count
    except ValueError:
        pass
    raise typer.BadParameter(f"--shard {text}: give i/n with 1 <= i <= n, such as 3/16.")


def status(output: answers.Results, as_json: _logs.AsJson = False) -> None:
    """Summarize the results: robots, logs, days, joints without recent results, and the failed logs with their reasons.

    Example: backdrive fleet status -o results/
    """
    from backdrive.fleet.status import status as status_of

    summary = status_of(output)
    if as_json:
        print_json(summary)
        return
    console = new_console()
    for sentence in summary["sentences"]:
        console.print(sentence, soft_wrap=True)
    if summary["silent"]:
        console.print(
            f"{len(summary['silent'])} joints have no recent result, while others have: backdrive fleet drifted -o {output} "
            "names them.",
            soft_wrap=True,
        )
    if summary["failures"]:
        rows = table("logs", "failure", "for example", text=("failure", "for example"))
        for one in summary["failures"]:
            rows.add_row(str(one["logs"]), one["kind"], f"{one['path']}: {one['message']}")
        console.print(rows)


def simulate(
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for the logs.")],
    robots: Annotated[int, typer.Option("--robots", min=1, help="Number of robots.")] = 20,
    joints: Annotated[int, typer.Option("--joints", min=1, help="Joints of each.")] = 1,
    days: Annotated[int, typer.Option("--days", min=1, help="Length of the history.")] = 60,
    seconds: Annotated[
        float, typer.Option("--seconds", min=0.1, max=1e5, help="Length of a log [s].")
    ] = 20.0,
    rate: Annotated[float, typer.Option("--rate", min=1.0, max=1e5, help="Samples a second [Hz].")] = 200.0,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of all random numbers.")] = 0,
) -> None:
    """Write the logs of a simulated fleet to try things on: wear, a new gear, a payload, a broken and a renamed robot.

    Example: backdrive fleet simulate -o logs/
    """
    from backdrive.errors import InvalidInput
    from backdrive.fleet.simulation import example

    if not seconds * rate >= 100.0:
        raise InvalidInput(f"{seconds:g} s at {rate:g} Hz.", remedy="Give a log of at least 100 samples.")
    fleet = example(robots=robots, joints=joints, days=days, seed=seed)
    with progress() as say:
        count = 0
        for path in fleet.write(output, seconds=seconds, rate=rate):
            count += 1
            say(f"{count} of {robots * days} logs, {path.name}")
    echo(f"{count} logs of {robots} robots in {output}.")
    for event in fleet.events:
        echo(f"{fleet.name(event.robot, event.day)}: {event.kind} from {fleet.day(event.day)} on.")


#: Name -> what it does.
COMMANDS = {
    "run": run,
    "status": status,
    "trend": answers.trend,
    "drifted": answers.drift,
    "sql": answers.sql,
    "page": answers.page,
    "merge": answers.merge,
    "rename": edits.rename,
    "forget": edits.forget,
    "simulate": simulate,
}
