"""Options that every command that reads logs shares, and the reading itself."""

from __future__ import annotations

from collections.abc import Sequence
from os.path import realpath
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from backdrive._files import check_regular, check_writable
from backdrive.errors import InvalidInput

if TYPE_CHECKING:
    from backdrive.logs.log import Log

Logs = Annotated[
    list[Path],
    typer.Argument(help="Log files, or folders of them; several of the same joints are one identification."),
]
Map = Annotated[
    str | None,
    typer.Option(
        "--map",
        help='Which column is which channel: "t=t,q=qm,tau=35.15*vir". Channels: t q dq tau qr u q2 tau_ext tau_model '
        "load temp. Factors: numbers, deg, rpm.",
    ),
]
Joints = Annotated[list[str] | None, typer.Option("--joint", help="Only this joint; may be repeated.")]
Names = Annotated[str | None, typer.Option("--names", help="Names for the joints in column order: j1,j2,...")]
Units = Annotated[
    str | None, typer.Option("--unit", help="rad or m, one for all joints or one each: rad,rad,m.")
]
Gear = Annotated[
    str | None,
    typer.Option(
        "--gear", help="Gear ratios; says that the torque is measured on the motor side: 100,224,120."
    ),
]
Counts = Annotated[
    str | None,
    typer.Option(
        "--counts", help="Encoder counts per rad or m at the joint, one or one each: 104300,233600."
    ),
]
Format = Annotated[
    str | None, typer.Option("--format", help="Reader to use, where the file's name does not tell.")
]
Topic = Annotated[str | None, typer.Option("--topic", help="Topic of the joint states in a bag.")]
Accept = Annotated[
    list[str] | None, typer.Option("--accept", help="Go on in spite of this health finding; may be repeated.")
]
Repair = Annotated[
    bool, typer.Option("--repair", help="Mend what can be mended honestly; every repair is listed.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document.")]
PlanFile = Annotated[
    Path | None, typer.Option("--plan", help="plan.json, or its folder, that the log was recorded with.")
]
PlanFiles = Annotated[
    list[Path] | None,
    typer.Option(
        "--plan",
        help="plan.json, or its folder, that the logs were recorded with; may be repeated: one a log, in their order.",
    ),
]


def words(text: str | None) -> list[str] | None:
    """Split a comma-separated option."""
    return [w.strip() for w in text.split(",") if w.strip()] if text else None


def numbers(text: str | None, option: str) -> list[float] | None:
    """Split a comma-separated option into numbers.

    Raises:
        InvalidInput: one of them is none.
    """
    try:
        return [float(w) for w in words(text) or []] or None
    except ValueError as error:
        raise InvalidInput(
            f"{option} {text}: not a list of numbers.", remedy="For example 100,224,120."
        ) from error


def check_targets(
    outputs: Sequence[Path | None], inputs: Sequence[Path | None], *, drawn: Sequence[Path | None] = ()
) -> None:
    """Refuse, before anything long begins, outputs that cannot be written or that would overwrite something.

    Args:
        outputs: files that a command will write; those that end in .png or .svg are pictures.
        inputs: files that it reads.
        drawn: further outputs, with pictures in them.

    Raises:
        InvalidInput: an output is an input or another output.
        WriteError: an output cannot be written; see `backdrive._files.check_writable`.
        MissingExtra: an output needs matplotlib, which is not installed.
    """
    taken = {realpath(p): p for p in inputs if p is not None}
    wanted = [p for p in (*outputs, *drawn) if p is not None]
    for path in wanted:
        if realpath(path) in taken:
            raise InvalidInput(
                f"Cannot write {path}: it is also {taken[realpath(path)]}.", remedy="Name another file."
            )
        check_writable(path)
        taken[realpath(path)] = path
    if any(path in drawn or path.suffix.lower() in (".png", ".svg") for path in wanted):
        from backdrive.report.pictures.canvas import require_matplotlib

        require_matplotlib()


def files_of(model: str) -> list[Path]:
    """Return the file of a model, or none for a preset."""
    return [] if model.startswith("preset:") else [Path(model)]


def check_folder(folder: Path, files: Sequence[str]) -> None:
    """Refuse, before anything long begins, a folder that cannot be made or in which files cannot be written.

    Args:
        folder: made later where it does not exist.
        files: names of files that will be written there.

    Raises:
        WriteError: see `backdrive._files.check_writable`.
    """
    for name in files:
        check_writable(folder / name, make=True)


def check_urdf(urdf: Path | None) -> None:
    """Refuse, before logs are read, a robot description that is no file, or that nothing can read here.

    Raises:
        ReadError: it is no file.
        MissingExtra: pinocchio is not installed.
    """
    if urdf is None:
        return
    from backdrive.robot import require_pinocchio

    check_regular(urdf)
    require_pinocchio()


def plan_from(path: Path | None):
    """Return the plan of a --plan option, a file or the folder that holds its plan.json; or None."""
    if path is None:
        return None
    from backdrive.plans import load_plan

    return load_plan(path / "plan.json" if path.is_dir() else path)


def plans_from(paths: Sequence[Path] | None):
    """Return the plan of --plan options: None, one for all logs, or a list of one a log."""
    plans = [plan_from(path) for path in paths or []]
    return plans if len(plans) > 1 else next(iter(plans), None)


def read(
    paths: Sequence[Path],
    *,
    map: str | None = None,
    names: str | None = None,
    units: str | None = None,
    gear: str | None = None,
    counts: str | None = None,
    format: str | None = None,
    topic: str | None = None,
) -> list[Log]:
    """Read the logs a command was given."""
    from backdrive.logs.readers import read_logs

    unit, count = words(units), numbers(counts, "--counts")
    return read_logs(
        [str(p) for p in paths],
        map=map,
        names=words(names),
        units=unit[0] if unit and len(unit) == 1 else unit,
        gear=numbers(gear, "--gear"),
        counts=count[0] if count and len(count) == 1 else count,
        format=format,
        topic=topic,
    )
