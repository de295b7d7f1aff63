"""`backdrive export`: a tuned loop or a friction model for firmware, simulators and robot descriptions."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from backdrive.cli import _joint_options, _logs
from backdrive.cli._output import echo, print_json
from backdrive.errors import InvalidInput

if TYPE_CHECKING:
    from backdrive.control.joint_loop import JointLoop
    from backdrive.model import FrictionModel
    from backdrive.tuning import Tuning

TARGETS = ("c", "mjcf", "urdf", "mujoco")


def command(
    model: Annotated[
        str, typer.Argument(metavar="MODEL.json", help="Model file made by `identify -o`, or preset:NAME.")
    ],
    tuning: Annotated[
        Path | None,
        typer.Option(
            "--tuning",
            metavar="FILE",
            help="Made by `tune -o`: export the whole loop with its limits.  [default: the laws alone]",
        ),
    ] = None,
    to: Annotated[
        str, typer.Option("--to", help="Target: c, mjcf, urdf, or mujoco (any law, as a callback in C).")
    ] = "c",
    robot: Annotated[
        Path | None,
        typer.Option(
            "--robot", metavar="FILE", help="Description that mjcf, urdf and mujoco put the friction into."
        ),
    ] = None,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Folder to write to.")] = Path(
        "."
    ),
    joint: _logs.Joints = None,
    name: Annotated[
        str | None,
        typer.Option(
            "--name", help="Prefix of the files and of every name in them.  [default: loop or friction]"
        ),
    ] = None,
    precision: Annotated[
        str, typer.Option("--precision", help="double or float (positions and times stay doubles).")
    ] = "double",
    top_speed: Annotated[
        list[str] | None,
        typer.Option(
            "--top-speed",
            help="Trip speed, above which the loop switches off, SPEED or JOINT=SPEED [rad/s or m/s].  [default: "
            "the tuning's]",
        ),
    ] = None,
    counts: Annotated[
        list[str] | None,
        typer.Option(
            "--counts", help="Encoder counts per rad or m, COUNTS or JOINT=COUNTS.  [default: the tuning's]"
        ),
    ] = None,
    beyond: Annotated[
        bool,
        typer.Option("--beyond", help="Export even if the share R exceeds what the model's errors support."),
    ] = False,
    dcmotor: Annotated[
        bool,
        typer.Option("--dcmotor", help="mjcf: write LuGre whole, as a passive dcmotor of MuJoCo 4."),
    ] = False,
    as_json: _logs.AsJson = False,
) -> None:
    """Write the tuned loop as C with bit-identical results, or a robot description with the identified friction.

    Example: backdrive export model.json --tuning tuning.json --to c -o firmware/

    Example: backdrive export preset:mx106/m6 --to c -o firmware/

    Example: backdrive export model.json --to mjcf --robot arm.xml -o simulated/

    Example: backdrive export model.json --to mujoco --robot arm.xml -o simulated/
    """
    if to not in TARGETS:
        raise InvalidInput(f"--to {to}.", remedy=f"Use {' or '.join(TARGETS)}.")
    if to == "mujoco":
        _callback(model, robot, output, joint, name, as_json)
        return
    if to != "c":
        _describe(model, to, robot, output, joint, name, dcmotor, as_json)
        return
    from backdrive import load_model
    from backdrive.export import export_laws, export_loop

    loaded = load_model(model)
    names = list(dict.fromkeys(loaded.joint(n).joint.name for n in joint)) if joint else None
    if tuning is None:
        laws = {n: loaded.joint(n).law for n in names or loaded.names}
        written = export_laws(
            laws, output, name=name or "friction", precision=precision, source=f"From {Path(model).name}."
        )
    else:
        from backdrive.tuning.tuning_file import load_tunings

        tunings = {t.joint: t for t in load_tunings(tuning)}
        tunings = {n: _tuning_of(tunings, n, tuning) for n in names or tunings}
        speeds = _joint_options.by_joint(top_speed, "--top-speed", "3", list(tunings), interval=False)
        per_unit = _joint_options.by_joint(counts, "--counts", "1043038", list(tunings), interval=False)
        loops = {}
        for n, each in tunings.items():
            count = 1.0 / per_unit[n] if n in per_unit else None
            loops[n] = each.loop(top_speed=speeds.get(n), encoder_count=count)
            if not beyond:
                _check_share(
                    loaded, n, loops[n], each.numbers["share"].limit if "share" in each.numbers else 1.0
                )
        written = export_loop(
            loops,
            _interval(list(tunings.values())),
            output,
            name=name or "loop",
            precision=precision,
            source=f"From {Path(model).name} and {tuning.name}.",
        )
    if as_json:
        print_json({"ok": True, "written": [str(p) for p in written]})
        return
    for path in written:
        echo(f"Wrote {path}")
    echo(
        f'Include "{written[0].name}" and compile with -ffp-contract=off for the same bits; '
        f"{written[0].stem}_selftest() tells whether they are."
    )


def _describe(
    model: str,
    to: str,
    robot: Path | None,
    output: Path,
    joint: list[str] | None,
    name: str | None,
    dcmotor: bool,
    as_json: bool,
) -> None:
    """Put the friction into a robot description."""
    if robot is None:
        raise InvalidInput(f"--to {to} without a robot description.", remedy="Name it: --robot FILE.")
    from backdrive import load_model
    from backdrive.export.simulators import export_description, target_of

    if target_of(robot) != to:
        raise InvalidInput(f"{robot} is no {to.upper()} file.", remedy=f"Say --to {target_of(robot)}.")
    written, simple = export_description(
        load_model(model), robot, output, joints=joint, name=name, dcmotor=dcmotor
    )
    if as_json:
        print_json({"ok": True, "written": [str(p) for p in written]})
        return
    for each in simple:
        lost = f"; lost: {', '.join(each.lost)}" if each.lost else ""
        if each.lugre is not None:
            words = ", ".join(f"{x:.4g}" for x in each.lugre)
            echo(f"{each.joint}: dcmotor lugre {words}, damping {each.damping:.4g}{lost}")
            continue
        echo(
            f"{each.joint}: friction {each.friction:.4g}, damping {each.damping:.4g}; off by up to {each.largest_error:.3g} "
            f"({each.rms_error:.2g} rms){lost}"
        )
    for path in written:
        echo(f"Wrote {path}")


def _callback(
    model: str, robot: Path | None, output: Path, joint: list[str] | None, name: str | None, as_json: bool
) -> None:
    """Write any law for MuJoCo."""
    if robot is None:
        raise InvalidInput("--to mujoco without a robot description.", remedy="Name it: --robot FILE.")
    from backdrive import load_model
    from backdrive.export.mujoco import export_mujoco

    source = f"From {Path(model).name}."
    written, placed, step = export_mujoco(
        load_model(model), robot, output, joints=joint, name=name or "friction", source=source
    )
    if as_json:
        print_json({"ok": True, "written": [str(p) for p in written], "timestep": step})
        return
    for each in placed:
        divided = f", which needs a step shorter than {each.steps * step:g} s" if each.steps > 1 else ""
        echo(f"{each.name}: {each.law.name}{divided}")
    echo(f"Step: {step:g} s")
    for path in written:
        echo(f"Wrote {path}")
    echo(f"{written[1].name} says how to compile it and how to set the callback, in C and in Python.")


def _tuning_of(tunings: dict[str, Tuning], name: str, path: Path) -> Tuning:
    if name not in tunings:
        raise InvalidInput(f"{path} holds no tuning of '{name}'.", remedy=f"It has {', '.join(tunings)}.")
    return tunings[name]


def _interval(tunings: list[Tuning]) -> float:
    intervals = sorted({t.interval for t in tunings})
    if len(intervals) > 1:
        raise InvalidInput(
            f"The joints were tuned for periods of {', '.join(f'{i:g}' for i in intervals)} s.",
            remedy="Tune them for one, or export them one by one (--joint).",
        )
    return intervals[0]


def _check_share(model: FrictionModel, name: str, loop: JointLoop, limit: float) -> None:
    """Refuse a share R that may compensate more than the friction, by the model's error or else by the tuning's limit."""
    from backdrive.tuning.facts import coulomb_error

    friction: Any = model.joint(name)
    coulomb = sum(friction.law.coulomb()) / 2.0
    error = coulomb_error(friction, coulomb) if coulomb > 0.0 else None
    if error is None:
        if loop.compensator.share > limit:
            raise InvalidInput(
                f"Joint '{name}': the loop compensates R = {loop.compensator.share:.3g} of the friction. The model states no "
                f"error, and the tuning supports up to R = {limit:.3g}.",
                remedy="Tune with a smaller --friction-error, or give --beyond.",
            )
        return
    if loop.compensator.share <= max(1.0 - error, 0.0):
        return
    raise InvalidInput(
        f"Joint '{name}': the loop compensates R = {loop.compensator.share:.3g} of the friction, but the model's "
        f"Coulomb friction is uncertain by {100 * error:.3g} % (95 %). Only up to R = {max(1.0 - error, 0.0):.3g} "
        f"is overcompensation excluded.",
        remedy="Identify from more data, tune with a larger --friction-error, or give --beyond.",
    )
