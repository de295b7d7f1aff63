"""The options shared by all commands that read logs, and the code that reads the logs."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_type_hints

import typer

from backdrive._files import check_regular
from backdrive.cli._coupling import matrix_from
from backdrive.errors import InvalidInput, MappingError, ReadError

if TYPE_CHECKING:
    from backdrive.logs.log import Log

OF_ONE_CLOCK = "Both clocks begin at 0"  # in a note of a joined log

Logs = Annotated[
    list[Path],
    typer.Argument(
        help="Log files, or folders of them; several logs of the same joints are identified together."
    ),
]
Map = Annotated[
    str | None,
    typer.Option(
        "--map",
        help='Which columns are which channel: "t=t,q=q1..q6,tau=35.15*vir". Channels: t q dq tau qr u q2 tau_ext tau_model '
        "load temp wrench. Columns: lists, ranges, patterns (*_pos). Factors: numbers, deg, rpm, turn; they and offsets also one "
        "a joint: (2,-1)*(a,b)+(0.1,0).",
    ),
]
Joints = Annotated[list[str] | None, typer.Option("--joint", help="Only this joint; may be repeated.")]
Names = Annotated[str | None, typer.Option("--names", help="Names for the joints in column order: j1,j2,...")]
Units = Annotated[
    str | None, typer.Option("--unit", help="rad or m, one for all joints or one each: rad,rad,m.")
]
Gear = Annotated[
    str | None,
    typer.Option("--gear", help="Gear ratios of a torque measured on the motor side: 100,224,120."),
]
Counts = Annotated[
    str | None,
    typer.Option(
        "--counts",
        help="Encoder counts per rad or m at the joint, one or one each: 104300,233600. They tell the resolution only; "
        "to convert positions that are in counts: --map q=turn/4096*COLUMN.",
    ),
]
Format = Annotated[
    str | None,
    typer.Option(
        "--format",
        help="Reader to use, where the file does not tell: csv (.csv .tsv .txt .dat .asc .log), npz, parquet (.parquet .pq), "
        "mat, hdf5 (.h5 .hdf5), bag (ROS 1), db3 and mcap (ROS 2), json. A folder in LeRobot's layout tells itself.",
    ),
]
Topic = Annotated[str | None, typer.Option("--topic", help="Topic of the joint states in a bag.")]
MotorSide = Annotated[
    str | None,
    typer.Option(
        "--motor-side", help="Channels that --gear converts to the joint side: q,dq,tau.  [default: tau]"
    ),
]
Coupling = Annotated[
    Path | None,
    typer.Option(
        "--coupling",
        help="Matrix C of q_joint = C q_motor (CSV or JSON), where motors drive several joints; kept in the model.",
    ),
]
CouplingSide = Annotated[
    str | None,
    typer.Option(
        "--coupling-side",
        help="Side of the coupling that the log's channels refer to: motor, or joint where the controller resolves "
        "the coupling.  [default: motor]",
    ),
]
Join = Annotated[
    list[Path] | None,
    typer.Option(
        "--join",
        help="File whose columns belong to the log, interpolated onto its clock; may be repeated. Its own time: a second t= in "
        "--map.",
    ),
]
Accept = Annotated[
    list[str] | None,
    typer.Option("--accept", help="Accept this health finding and continue; may be repeated."),
]
Repair = Annotated[
    bool, typer.Option("--repair", help="Repair faults that have a safe repair; every repair is listed.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document.")]
Rename = Annotated[
    list[str] | None,
    typer.Option(
        "--rename",
        metavar="A=B",
        help="Joint A of the second side (the logs, the later model) is B of the first; may be repeated.",
    ),
]
PlanFile = Annotated[
    Path | None, typer.Option("--plan", help="plan.json, or its folder, that the log was recorded with.")
]
PlanFiles = Annotated[
    list[Path] | None,
    typer.Option(
        "--plan",
        help="plan.json of the logs, or its folder; may be repeated, one for each log in their order.",
    ),
]


Start = Annotated[
    str | None,
    typer.Option(
        "--start",
        help="Start of the plan in the log: seconds after the first sample, or auto, found from the motion.  "
        "[default: 0]",
    ),
]


@dataclass(frozen=True, kw_only=True)
class Reading:
    """How logs are read: the options shared by all commands that read logs; see `with_reading`."""

    map: Map = None
    names: Names = None
    unit: Units = None
    gear: Gear = None
    motor_side: MotorSide = None
    coupling: Coupling = None
    coupling_side: CouplingSide = None
    counts: Counts = None
    join: Join = None
    format: Format = None
    topic: Topic = None

    @property
    def inputs(self) -> list[Path]:
        """Files beside the logs."""
        return [*(self.join or []), *([self.coupling] if self.coupling else [])]

    def read(self, paths: Sequence[Path]) -> list[Log]:
        """Return the logs a command was given."""
        from backdrive.logs.readers import read_logs

        unit, count = words(self.unit), numbers(self.counts, "--counts")
        return read_logs(
            [str(p) for p in paths],
            map=self.map,
            names=words(self.names),
            units=unit[0] if unit and len(unit) == 1 else unit,
            gear=numbers(self.gear, "--gear"),
            counts=count[0] if count and len(count) == 1 else count,
            motor_side=self.motor_side,
            coupling=matrix_from(self.coupling),
            coupling_side=self.coupling_side,
            join=[str(p) for p in self.join or []],
            format=self.format,
            topic=self.topic,
        )

    def read_apart(self, paths: Sequence[Path]) -> list[Log]:
        """Return further logs, each with those joined files that cover the same time.

        Raises:
            InvalidInput: the clocks begin at zero, so a joined file cannot be assigned to a recording.
        """
        return [log for path in paths for log in (self._beside(path) if self.join else self.read([path]))]

    def _beside(self, path: Path) -> list[Log]:
        """Return the logs of a path, with the joined files if their times and columns match, otherwise without."""
        failure = InvalidInput(
            f"{path} and the joined files begin at 0 s: they may be of different recordings.",
            remedy="Log a clock that keeps running from one recording to the next, or leave out --hold-out.",
        )
        try:
            joined = self.read([path])
            if not any(OF_ONE_CLOCK in note for log in joined for note in log.notes):
                return joined
        except (MappingError, ReadError) as error:
            failure = error
        with suppress(MappingError):
            alone = replace(self, join=None).read([path])
            if all(log.torque is not None or log.drive_input is not None for log in alone):
                return alone
        raise failure

    def to_dict(self) -> dict[str, Any]:
        """Return the options that were given, as plain values."""
        given = {f.name: getattr(self, f.name) for f in fields(self) if getattr(self, f.name)}
        given |= {"units": given.pop("unit")} if "unit" in given else {}
        given |= {"join": [str(p) for p in self.join]} if self.join else {}
        return given | ({"coupling": matrix_from(self.coupling)} if self.coupling else {})


USUAL = Reading()


def with_reading(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options of `Reading` in the place of its parameter `reading`."""
    own = inspect.signature(command, eval_str=True)
    hints = get_type_hints(Reading, include_extras=True)
    options = [
        inspect.Parameter(f.name, inspect.Parameter.KEYWORD_ONLY, default=f.default, annotation=hints[f.name])
        for f in fields(Reading)
    ]
    parameters: list[inspect.Parameter] = []
    for parameter in own.parameters.values():
        parameters += (
            options
            if parameter.name == "reading"
            else [parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY)]
        )

    @functools.wraps(command)
    def run(**given: Any) -> None:
        reading = Reading(**{o.name: given.pop(o.name) for o in options if o.name in given})
        command(reading=reading, **given)

    run.__signature__ = own.replace(parameters=parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {p.name: p.annotation for p in parameters}
    return run


def start_from(text: str | None) -> float | Literal["auto"] | None:
    """Return the value of a --start option.

    Raises:
        InvalidInput: it is neither a number nor `auto`.
    """
    if text is None or text == "auto":
        return text
    try:
        return float(text)
    except ValueError as error:
        raise InvalidInput(
            f"--start {text}: neither seconds nor auto.",
            remedy="Give seconds after the log's first sample, such as 3.7.",
        ) from error


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


def files_of(model: str) -> list[Path]:
    """Return the file of a model, or none for a preset."""
    return [] if model.startswith("preset:") else [Path(model)]


def check_urdf(urdf: Path | None) -> None:
    """Refuse a robot description that is not a file or cannot be read on this machine; called before logs are read.

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
