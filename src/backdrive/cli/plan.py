"""`backdrive plan`: a motion for identifying friction, checked against the joint's limits and written for a robot."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from backdrive._files import make_folder, write_together
from backdrive._visible import visible
from backdrive.cli import _logs
from backdrive.cli._lines import wrap
from backdrive.cli._output import echo, print_json
from backdrive.cli._targets import check_folder
from backdrive.errors import InvalidInput, MissingExtra

_OUTPUT = ("output", "rate", "ros_rate", "draw", "as_json")  # options that do not affect the motion


# Panels of the help, by kind of plan
EVERY = "Every plan"
POSITION = "A position over time: sweep, constant-velocity, multisine"
SWEEP = "Only sweep"
CONSTANT = "Only constant-velocity"
MULTISINE = "Only multisine"
TORQUE = "A torque over time: sine-torque, sawtooth-torque, ramp"
ARM = "Only arm: all joints at once"
LIMITS = "Limits"
CHECK = "Check of the torque, and of the error due to inertia"


def _option(panel: str, help: str, *names: str) -> Any:
    return typer.Option(*names, help=help, show_default=False, rich_help_panel=panel)


def command(
    kind: Annotated[
        str,
        typer.Argument(
            help="sweep, constant-velocity, multisine, sine-torque, sawtooth-torque, ramp, or arm: all joints at once."
        ),
    ],
    output: Annotated[
        Path,
        typer.Option("-o", "--output", rich_help_panel=EVERY, help="Folder to write to; made if absent."),
    ] = Path("plan"),
    joint: Annotated[
        list[str] | None, _option(EVERY, "Joint to move; may be repeated: one after the other.")
    ] = None,
    all_joints: Annotated[
        bool,
        typer.Option(
            "--all-joints", rich_help_panel=EVERY, help="All joints of --urdf, one after the other."
        ),
    ] = False,
    urdf: Annotated[Path | None, _option(EVERY, "Robot description: joint names, units and limits.")] = None,
    unit: Annotated[str | None, _option(EVERY, "rad or m, without --urdf.  [default: rad]")] = None,
    hold: Annotated[
        list[str] | None,
        _option(POSITION, "NAME=POSITION at which a joint is held [rad or m]; may be repeated."),
    ] = None,
    stroke: Annotated[float | None, _option(POSITION, "Full stroke, peak to peak [rad or m].")] = None,
    stroke_deg: Annotated[float | None, _option(POSITION, "The same in degrees.")] = None,
    top_speed: Annotated[float | None, _option(POSITION, "Highest speed [rad/s or m/s].")] = None,
    top_speed_deg: Annotated[float | None, _option(POSITION, "The same in degrees per second.")] = None,
    cycles: Annotated[
        int | None,
        _option(POSITION, "Cycles, speeds or periods.  [default: 10; multisine 3, torques 5, ramp 2]"),
    ] = None,
    slow: Annotated[
        int | None,
        _option(
            SWEEP,
            "Extra slow cycles at the start of a sweep, each half as fast as the next, for the Stribeck range.",
        ),
    ] = None,
    center: Annotated[
        float | None, _option(POSITION, "Middle of the stroke [rad or m].  [default: 0]")
    ] = None,
    center_deg: Annotated[float | None, _option(POSITION, "The same in degrees.")] = None,
    centres: Annotated[
        str | None,
        _option(
            SWEEP,
            "Several sweeps, to separate unequal directions from gravity: auto, a number, or centers in degrees: "
            "-60,0,60.",
            "--centres",
            "--centers",
        ),
    ] = None,
    lead_in: Annotated[float | None, _option(POSITION, "Time before the first cycle [s].")] = None,
    literal: Annotated[
        bool,
        typer.Option(
            "--literal",
            rich_help_panel=SWEEP,
            help="The sweep as printed in the thesis: the acceleration jumps.",
        ),
    ] = False,
    speeds: Annotated[
        str | None, _option(CONSTANT, "Speeds of constant-velocity runs: 0.1,0.5,1 [rad/s or m/s].")
    ] = None,
    ramp_acceleration: Annotated[
        float | None, _option(CONSTANT, "Acceleration between the runs [rad/s^2 or m/s^2].")
    ] = None,
    pause: Annotated[float | None, _option(CONSTANT, "Rest between the runs [s].  [default: 0.2]")] = None,
    band: Annotated[
        str | None, _option(MULTISINE, "Lowest and highest frequency of a multisine: 0.1,2 [Hz].")
    ] = None,
    period: Annotated[float | None, _option(MULTISINE, "Period of a multisine [s].")] = None,
    seed: Annotated[int | None, _option(MULTISINE, "Seed of a multisine's phases.  [default: 0]")] = None,
    amplitude: Annotated[float | None, _option(TORQUE, "Amplitude of a torque [N.m or N].")] = None,
    offset: Annotated[
        float | None, _option(TORQUE, "Torque about which it swings [N.m or N].  [default: 0]")
    ] = None,
    frequency: Annotated[float | None, _option(TORQUE, "Of a swinging torque [Hz].")] = None,
    rise: Annotated[float | None, _option(TORQUE, "Rising share of a saw-tooth.  [default: 0.5]")] = None,
    torque_rate: Annotated[float | None, _option(TORQUE, "Slope of a torque ramp [N.m/s or N/s].")] = None,
    lower: Annotated[float | None, _option(LIMITS, "Lowest position allowed [rad or m].")] = None,
    upper: Annotated[float | None, _option(LIMITS, "Highest position allowed [rad or m].")] = None,
    margin: Annotated[
        float | None,
        _option(
            LIMITS,
            "Distance that the motion keeps from either end of the range [rad or m].  [default: none is reached; sweeps "
            "by --centres keep 2 % of the stroke]",
        ),
    ] = None,
    velocity_limit: Annotated[float | None, _option(LIMITS, "Greatest speed allowed [rad/s or m/s].")] = None,
    acceleration_limit: Annotated[
        float | None, _option(LIMITS, "Greatest acceleration allowed [rad/s^2 or m/s^2].")
    ] = None,
    torque_limit: Annotated[
        float | None, _option(LIMITS, "Greatest torque, on the joint side [N.m or N].")
    ] = None,
    inertia: Annotated[
        float | None, _option(CHECK, "Inertia about the joint, to check the torque [kg.m^2 or kg].")
    ] = None,
    gravity: Annotated[
        float | None, _option(CHECK, "Largest gravity torque on the stroke [N.m or N].")
    ] = None,
    friction: Annotated[
        float | None, _option(CHECK, "Friction expected at the top speed [N.m or N].")
    ] = None,
    bias: Annotated[
        float | None, _option(CHECK, "Accepted friction error due to inertia [N.m or N].  [default: 0.1]")
    ] = None,
    time_slip: Annotated[
        float | None,
        _option(CHECK, "Time shift between torque and velocity in the log [s].  [default: 0.001]"),
    ] = None,
    purpose: Annotated[
        str | None,
        _option(
            ARM,
            "What a motion of the whole arm has to identify: friction,inertia,gravity,payload,force.  [default: the "
            "first three]",
            "--for",
        ),
    ] = None,
    around: Annotated[
        list[str] | None,
        _option(ARM, "JOINT=POSITION,... about which the arm moves [rad or m].  [default: chosen]"),
    ] = None,
    box: Annotated[
        list[str] | None, _option(ARM, "JOINT=LOW:HIGH,... that the arm does not leave [rad or m].")
    ] = None,
    limit: Annotated[
        list[str] | None,
        _option(
            ARM, "JOINT.WHAT=NUMBER,... of lower, upper, velocity, acceleration, torque; may be repeated."
        ),
    ] = None,
    packages: Annotated[
        Path | None,
        _option(ARM, "Folder in which package:// of the description's meshes begins, for self-collision."),
    ] = None,
    floor: Annotated[
        float | None, _option(ARM, "Height that links do not go below, above the base [m].")
    ] = None,
    clearance: Annotated[
        float | None, _option(ARM, "Distance that links keep from each other [m].  [default: 0.02]")
    ] = None,
    reserve: Annotated[
        float | None, _option(ARM, "Share of every limit that the arm leaves unused.  [default: 0.05]")
    ] = None,
    duration: Annotated[float | None, _option(ARM, "Of the arm's motion [s].  [default: 60]")] = None,
    noise: Annotated[
        str | None,
        _option(ARM, "Expected torque residual below 5 Hz: a number or JOINT=NUMBER,... [N.m or N]."),
    ] = None,
    frame: Annotated[
        str | None, _option(ARM, "Of the description, where a force acts.  [default: the last]")
    ] = None,
    rate: Annotated[
        float, typer.Option("--rate", rich_help_panel=EVERY, help="Samples per second of CSV and NPZ [Hz].")
    ] = 1000.0,
    ros_rate: Annotated[
        float,
        typer.Option("--ros-rate", rich_help_panel=EVERY, help="Points per second of the trajectory [Hz]."),
    ] = 100.0,
    draw: Annotated[
        str, typer.Option("--draw", rich_help_panel=EVERY, help="Picture to write: png, svg or none.")
    ] = "png",
    as_json: _logs.AsJson = False,
) -> None:
    """Plan a motion for identifying friction, check it against the joint's limits, and write it for the robot.

    Writes plan.json (keep it beside the log), plan.csv, plan.npz, trajectory.yaml (ROS 2 JointTrajectory) and a picture.

    Example: backdrive plan sweep --stroke-deg 20 --top-speed 2 --cycles 10 --joint j1 -o plan/

    Example: backdrive plan arm --urdf ur5.urdf --acceleration-limit 8 --packages /opt/ros/share -o plan/

    Example: backdrive plan sweep --stroke-deg 20 --top-speed 2 --centres auto --lower -1.4 --upper 1.4 -o plan/
    """
    options = {name: value for name, value in locals().items() if name not in _OUTPUT}
    if kind == "arm":
        _plan_arm(options, output, rate, ros_rate, draw, as_json)
        return
    from backdrive.cli import _plan_centres as several
    from backdrive.cli._plan_request import Request
    from backdrive.cli._plan_words import figures_of, notes_of, table_of
    from backdrive.cli._planning import build, single_plans
    from backdrive.plans import plan_to_dict

    request = Request(**options)
    check_folder(output, ("plan.json",) if centres else _names(draw))
    if centres is None:
        plan, limits = build(request)
        plans, singles, folders, notes = [plan], single_plans(plan), [output], []
        document = {"plan": plan_to_dict(plan), "duration": plan.duration}
        in_turn = f"{len(singles)} joints in turn, {plan.duration:.4g} s with pauses"
        title = f"{kind} of {singles[0].joint if len(singles) == 1 else in_turn}"
        summary, place = "", f"Wrote {', '.join(str(output / name) for name in _names(draw))}"
    else:
        sweeps, plans, limits = several.build_centres(request)
        singles, folders = tuple(sweeps.plans), several.folders_of(sweeps, output)
        for folder in folders:
            check_folder(folder, _names(draw))
        notes = several.notes_of_centres(sweeps, request)
        document = {"plans": [plan_to_dict(one) for one in plans], **several.figures_of_centres(sweeps)}
        document["folders"] = [str(p) for p in folders]
        title = f"sweep of {singles[0].joint} about several centers"
        summary = several.sentence_of_centres(sweeps)
        place = f"Wrote {len(_names(draw))} files into each of {', '.join(str(p) for p in folders)}."
    contents = [_contents(one, limits, rate, ros_rate, draw) for one in plans]
    figures = [figures_of(one, limits[one.joint], request) for one in singles]
    notes += notes_of(plans[0], limits, request)
    for folder in folders:
        make_folder(folder, "-o")
    written = write_together(
        {
            folder / name: text
            for folder, files in zip(folders, contents, strict=False)
            for name, text in files.items()
        }
    )
    if as_json:
        rest = {"joints": figures, "notes": notes, "written": [str(p) for p in written]}
        print_json({"ok": True, **document, **rest})
        return
    echo(title)
    for line in table_of(figures):
        echo(f"  {line}")
    if summary:
        echo(summary)
    for note in notes:
        typer.secho(wrap(visible(note), sys.stdout), fg=typer.colors.YELLOW)
    echo(place)


def _plan_arm(
    options: dict[str, Any], output: Path, rate: float, ros_rate: float, draw: str, as_json: bool
) -> None:
    """Plan a motion of the whole arm and write it."""
    from backdrive.cli._plan_arm import plan_arm
    from backdrive.cli._plan_arm_words import errors_of, figures_of, show
    from backdrive.cli._plan_request import Request
    from backdrive.cli._progress import progress
    from backdrive.plans import plan_to_dict

    check_folder(output, _names(draw))
    with progress(quiet=as_json) as say:
        outcome = plan_arm(Request(**options), say)
        say("Drawing the plan")
        files = _contents(outcome.plan, outcome.limits, rate, ros_rate, draw)
    make_folder(output, "-o")
    written = write_together({output / name: text for name, text in files.items()})
    if not as_json:
        show(outcome, written)
        return
    print_json(
        {
            "ok": True,
            "plan": plan_to_dict(outcome.plan),
            "duration": outcome.plan.duration,
            "joints": figures_of(outcome),
            "standard_errors": errors_of(outcome),
            "notes": outcome.notes,
            "written": [str(p) for p in written],
        }
    )


def _contents(
    plan: Any, limits: dict[str, Any], rate: float, ros_rate: float, draw: str
) -> dict[str, str | bytes]:
    """Return all files by name, so that nothing is written before all of them are computed."""
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
