"""`backdrive plan`: a motion that shows friction, checked against the joint's limits, as files a robot can be given."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from backdrive.cli import _logs
from backdrive.cli._output import echo

if TYPE_CHECKING:
    from backdrive.plans.limits import JointLimits


def _option(help: str, *names: str) -> Any:
    return typer.Option(*names, help=help, show_default=False)


def command(
    kind: Annotated[
        str, typer.Argument(help="sweep, constant-velocity, multisine, sine-torque, sawtooth-torque or ramp.")
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Folder to write to; made if absent.")
    ] = Path("plan"),
    joint: Annotated[
        list[str] | None, _option("Joint to move; may be repeated: one after the other.")
    ] = None,
    all_joints: Annotated[
        bool, typer.Option("--all-joints", help="All joints of --urdf, one after the other.")
    ] = False,
    urdf: Annotated[Path | None, _option("Robot description: joint names, units and limits.")] = None,
    unit: Annotated[str | None, _option("rad or m, without --urdf.  [default: rad]")] = None,
    hold: Annotated[
        list[str] | None, _option("NAME=POSITION where a joint waits or is held [rad or m]; may be repeated.")
    ] = None,
    stroke: Annotated[float | None, _option("Full stroke, peak to peak [rad or m].")] = None,
    stroke_deg: Annotated[float | None, _option("The same in degrees.")] = None,
    top_speed: Annotated[float | None, _option("Highest speed [rad/s or m/s].")] = None,
    top_speed_deg: Annotated[float | None, _option("The same in degrees per second.")] = None,
    cycles: Annotated[
        int | None, _option("Cycles, speeds or periods.  [default: 10; multisine 3, torques 5, ramp 2]")
    ] = None,
    center: Annotated[float | None, _option("Middle of the stroke [rad or m].  [default: 0]")] = None,
    center_deg: Annotated[float | None, _option("The same in degrees.")] = None,
    centres: Annotated[
        str | None,
        _option(
            "Several sweeps, to tell unequal directions from gravity: auto, how many, or centers in degrees: -60,0,60.",
            "--centres",
            "--centers",
        ),
    ] = None,
    lead_in: Annotated[float | None, _option("Time before the first cycle [s].")] = None,
    literal: Annotated[
        bool, typer.Option("--literal", help="The sweep as printed in the thesis: the acceleration jumps.")
    ] = False,
    speeds: Annotated[
        str | None, _option("Speeds of constant-velocity runs: 0.1,0.5,1 [rad/s or m/s].")
    ] = None,
    ramp_acceleration: Annotated[
        float | None, _option("Acceleration between the runs [rad/s^2 or m/s^2].")
    ] = None,
    pause: Annotated[float | None, _option("Rest between the runs [s].  [default: 0.2]")] = None,
    band: Annotated[str | None, _option("Lowest and highest frequency of a multisine: 0.1,2 [Hz].")] = None,
    period: Annotated[float | None, _option("Period of a multisine [s].")] = None,
    seed: Annotated[int | None, _option("Of the phases of a multisine.  [default: 0]")] = None,
    amplitude: Annotated[float | None, _option("Amplitude of a torque [N.m or N].")] = None,
    offset: Annotated[float | None, _option("Torque about which it swings [N.m or N].  [default: 0]")] = None,
    frequency: Annotated[float | None, _option("Of a swinging torque [Hz].")] = None,
    rise: Annotated[float | None, _option("Rising share of a saw-tooth.  [default: 0.5]")] = None,
    torque_rate: Annotated[float | None, _option("Slope of a torque ramp [N.m/s or N/s].")] = None,
    lower: Annotated[float | None, _option("Lowest position allowed [rad or m].")] = None,
    upper: Annotated[float | None, _option("Highest position allowed [rad or m].")] = None,
    velocity_limit: Annotated[float | None, _option("Greatest speed allowed [rad/s or m/s].")] = None,
    acceleration_limit: Annotated[
        float | None, _option("Greatest acceleration allowed [rad/s^2 or m/s^2].")
    ] = None,
    torque_limit: Annotated[float | None, _option("Greatest torque, on the joint side [N.m or N].")] = None,
    inertia: Annotated[float | None, _option("About the joint, to check the torque [kg.m^2 or kg].")] = None,
    gravity: Annotated[float | None, _option("Largest gravity torque on the stroke [N.m or N].")] = None,
    friction: Annotated[float | None, _option("Friction expected at the top speed [N.m or N].")] = None,
    bias: Annotated[
        float | None, _option("Error by inertia that is bearable [N.m or N].  [default: 0.1]")
    ] = None,
    time_slip: Annotated[
        float | None, _option("Between torque and velocity in the log [s].  [default: 0.001]")
    ] = None,
    rate: Annotated[float, typer.Option("--rate", help="Samples per second of CSV and NPZ [Hz].")] = 1000.0,
    ros_rate: Annotated[
        float, typer.Option("--ros-rate", help="Points per second of the trajectory [Hz].")
    ] = 100.0,
    draw: Annotated[str, typer.Option("--draw", help="Picture to write: png, svg or none.")] = "png",
    as_json: _logs.AsJson = False,
) -> None:
    """Plan a motion that shows friction, check it against the joint's limits, and write it for the robot.

    Writes plan.json (keep it beside the log), plan.csv, plan.npz, trajectory.yaml (ROS 2 JointTrajectory) and a picture.

    Example: backdrive plan sweep --stroke-deg 20 --top-speed 2 --cycles 10 --joint j1 -o plan/

    Example: backdrive plan sweep --stroke-deg 20 --top-speed 2 --centres auto --lower -1.4 --upper 1.4 -o plan/
    """
    from dataclasses import fields

    from backdrive.cli._plan_request import Request
    from backdrive.cli._plan_words import figures_of, notes_of
    from backdrive.cli._planning import build, single_plans

    options = locals()
    request = Request(**{f.name: options[f.name] for f in fields(Request)})
    if request.centres is not None:
        _several(request, output, rate, ros_rate, draw, as_json)
        return
    _logs.check_folder(output, _names(draw))
    plan, limits = build(request)
    contents = _contents(plan, limits, rate, ros_rate, draw)
    figures = [figures_of(one, limits[one.joint], request) for one in single_plans(plan)]
    notes = notes_of(plan, limits, request)
    written = _write({output / name: text for name, text in contents.items()})
    if as_json:
        from backdrive.cli._output import print_json
        from backdrive.plans import plan_to_dict

        print_json(
            {
                "ok": True,
                "plan": plan_to_dict(plan),
                "duration": plan.duration,
                "joints": figures,
                "notes": notes,
                "written": [str(p) for p in written],
            }
        )
    else:
        _print(plan, figures, notes, written)


def _several(request: Any, output: Path, rate: float, ros_rate: float, draw: str, as_json: bool) -> None:
    """Plan one sweep a center, each into a folder of its own."""
    from backdrive.cli._plan_centres import (
        build_centres,
        figures_of_centres,
        folders_of,
        notes_of_centres,
        sentence_of_centres,
    )
    from backdrive.cli._plan_request import refuse_idle_options
    from backdrive.cli._plan_words import figures_of, notes_of, table_of

    refuse_idle_options(request)
    _logs.check_folder(output, ("plan.json",))
    found, plans, limits = build_centres(request)
    folders = folders_of(found, output)
    for folder in folders:
        _logs.check_folder(folder, _names(draw))
    contents = [_contents(plan, limits, rate, ros_rate, draw) for plan in plans]
    figures = [figures_of(plan, limits[plan.joint], request) for plan in found.plans]
    notes = notes_of_centres(found, request) + notes_of(plans[0], limits, request)
    written = _write(
        {folder / name: text for folder, files in zip(folders, contents) for name, text in files.items()}
    )
    if as_json:
        from backdrive.cli._output import print_json
        from backdrive.plans import plan_to_dict

        print_json(
            {
                "ok": True,
                "plans": [plan_to_dict(plan) for plan in plans],
                **figures_of_centres(found),
                "joints": figures,
                "notes": notes,
                "folders": [str(p) for p in folders],
                "written": [str(p) for p in written],
            }
        )
        return
    echo(f"sweep of {figures[0]['joint']} about several centers")
    for line in table_of(figures):
        echo(f"  {line}")
    echo(sentence_of_centres(found))
    for note in notes:
        typer.secho(note, fg=typer.colors.YELLOW)
    echo(f"Wrote {len(contents[0])} files into each of {', '.join(str(p) for p in folders)}.")


def _contents(
    plan: Any, limits: dict[str, JointLimits], rate: float, ros_rate: float, draw: str
) -> dict[str, str | bytes]:
    """Return all files by name, so that nothing is written before everything is there."""
    import json

    from backdrive.errors import InvalidInput, MissingExtra
    from backdrive.plans import plan_to_dict
    from backdrive.plans.tables import csv_text, npz_bytes, sample, trajectory_yaml

    contents: dict[str, str | bytes] = {}
    if draw not in ("png", "svg", "none"):
        raise InvalidInput(f"--draw {draw} is no kind of picture.", remedy="Give png, svg or none.")
    if draw != "none":
        from backdrive.report.pictures.plan import picture

        try:
            contents[f"plan.{draw}"] = picture(plan, draw, limits)
        except MissingExtra as error:
            raise MissingExtra(error.message, remedy=f"{error.remedy} Or give --draw none.") from error
    table = sample(plan, rate)
    text = json.dumps(plan_to_dict(plan), indent=2, ensure_ascii=False) + "\n"
    return {
        "plan.json": text,
        "plan.csv": csv_text(table),
        "plan.npz": npz_bytes(table),
        "trajectory.yaml": trajectory_yaml(sample(plan, ros_rate)),
        **contents,
    }


def _names(draw: str) -> tuple[str, ...]:
    """Return the names of the files that are written."""
    picture = () if draw == "none" else (f"plan.{draw}",)
    return ("plan.json", "plan.csv", "plan.npz", "trajectory.yaml", *picture)


def _write(contents: dict[Path, str | bytes]) -> list[Path]:
    from backdrive._files import make_folder, write_together

    for folder in dict.fromkeys(path.parent for path in contents):
        make_folder(folder, "-o")
    return write_together(contents)


def _print(plan: Any, figures: list[dict[str, Any]], notes: list[str], written: list[Path]) -> None:
    from backdrive.cli._plan_words import table_of

    many = f"{len(figures)} joints in turn, {plan.duration:.4g} s with pauses"
    echo(f"{figures[0]['kind']} of {figures[0]['joint'] if len(figures) == 1 else many}")
    for line in table_of(figures):
        echo(f"  {line}")
    for note in notes:
        typer.secho(note, fg=typer.colors.YELLOW)
    echo(f"Wrote {', '.join(str(p) for p in written)}")
