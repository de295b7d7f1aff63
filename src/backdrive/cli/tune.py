"""`backdrive tune`: parameters of compensation, estimation and admittance control, chosen and checked."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from backdrive.cli import _joint_options, _logs
from backdrive.cli._output import echo, print_json
from backdrive.cli._progress import progress
from backdrive.cli._targets import check_targets
from backdrive.cli._tune_output import show_controller, show_tuning
from backdrive.errors import BackdriveError, InvalidInput

if TYPE_CHECKING:
    from backdrive.tuning import Tuning


def command(
    model: Annotated[str, typer.Argument(help="Model file made by `identify -o`, or preset:NAME.")],
    goal: Annotated[str, typer.Option("--goal", help="backdrive, track, estimate or admit.")] = "backdrive",
    joint: _logs.Joints = None,
    wish: Annotated[
        str,
        typer.Option(
            "--wish",
            help="Preference of the person who moves the joint, for --goal backdrive: light, touch, calm, or even "
            "(some of each).",
        ),
    ] = "even",
    output: Annotated[Path | None, typer.Option("-o", "--output", help="File to write (JSON).")] = None,
    picture: Annotated[
        Path | None, typer.Option("--picture", help="Safe region to draw (PNG or SVG).")
    ] = None,
    stiffness: Annotated[
        list[str] | None,
        typer.Option(
            "--stiffness",
            help="K_c that the encoder sees before break-away, LOW:HIGH [N.m/rad or N/m]; with several joints JOINT=LOW:HIGH, "
            "once for each.  [default: of the law's element]",
        ),
    ] = None,
    inertia: Annotated[
        list[str] | None,
        typer.Option(
            "--inertia",
            help="Inertia of motor and load, LOW:HIGH or JOINT=LOW:HIGH [kg.m^2 or kg].  [default: the model's]",
        ),
    ] = None,
    motor_share: Annotated[
        list[str] | None,
        typer.Option(
            "--motor-share",
            help="Share of the inertia on the motor side, SHARE or JOINT=SHARE.  [default: 0.15]",
        ),
    ] = None,
    counts: Annotated[
        list[str] | None,
        typer.Option(
            "--counts",
            help="Encoder counts per rad or m at the joint, COUNTS or JOINT=COUNTS.  [default: the model's]",
        ),
    ] = None,
    top_speed: Annotated[
        list[str] | None,
        typer.Option(
            "--top-speed",
            help="Trip speed, above which the loop switches off until reset, SPEED or JOINT=SPEED [rad/s or m/s].  "
            "[default: of --urdf; without either the loop requires it]",
        ),
    ] = None,
    limit: Annotated[
        list[str] | None,
        typer.Option(
            "--limit",
            help="Limit of the compensating torque, LIMIT or JOINT=LIMIT [N.m or N].  [default: 1.25 R F(top "
            "speed), at most the effort "
            "of --urdf]",
        ),
    ] = None,
    urdf: Annotated[
        Path | None, typer.Option("--urdf", help="Robot description, for top speed and limit by joint.")
    ] = None,
    noise: Annotated[
        float, typer.Option("--noise", help="Standard deviation of an encoder reading [counts].")
    ] = 0.0,
    interval: Annotated[
        float, typer.Option("--interval", help="Sampling time of the torque loop [s].")
    ] = 1e-3,
    delay: Annotated[
        float | None,
        typer.Option("--delay", help="Longest delay from command to torque [s].  [default: one interval]"),
    ] = None,
    friction_error: Annotated[
        float | None,
        typer.Option(
            "--friction-error", help="Largest relative error of friction from day to day.  [default: 0.1]"
        ),
    ] = None,
    temperature: Annotated[
        str | None, typer.Option("--temperature", help="LOW:HIGH [degC].  [default: what the model has seen]")
    ] = None,
    stroke: Annotated[
        float | None,
        typer.Option("--stroke", help="Stroke of the hand, end to end [rad or m].  [default: 0.15 or 0.06]"),
    ] = None,
    duration: Annotated[float, typer.Option("--duration", help="Duration of a stroke [s].")] = 0.5,
    dither: Annotated[
        bool, typer.Option("--dither/--no-dither", help="Propose dither where it is safe.")
    ] = True,
    joints: Annotated[
        int, typer.Option("--joints", help="Number of joints drawn from the intervals for the check.")
    ] = 200,
    seed: Annotated[int, typer.Option("--seed", help="Seed of the search and of the drawn joints.")] = 0,
    as_json: _logs.AsJson = False,
) -> None:
    """Choose K, R, decay rates, dither, filter and admittance for a joint, and report their stability margins.

    Example: backdrive tune preset:thesis/hp3j --joint joint_0 --stiffness 8e4:1.2e5 --inertia 0.6:0.8 --top-speed 3 -o tuning.json
    """
    from backdrive import load_model
    from backdrive.tuning import facts_of, save_tunings, tune
    from backdrive.tuning.bounds import check_numbers
    from backdrive.tuning.scenes import usual_stroke
    from backdrive.tuning.wishes import check_wish

    warm: Any = None if temperature is None else _joint_options.ends(temperature, "--temperature", "20:45")
    warm = (warm, warm) if isinstance(warm, float) else warm
    shared: dict[str, Any] = {
        "noise": noise,
        "delay": delay,
        "interval": interval,
        "friction_error": friction_error,
        "temperature": warm,
    }
    check_wish(wish)
    check_numbers("tune", **shared, stroke=stroke, duration=duration, joints=joints, seed=seed)
    check_targets([output, picture], _logs.files_of(model))
    loaded = load_model(model)
    names = list(dict.fromkeys(loaded.joint(name).joint.name for name in joint or loaded.names))
    if picture is not None and (
        picture.suffix.lower() not in (".png", ".svg") or goal not in ("backdrive", "track") or len(names) > 1
    ):
        raise InvalidInput(
            f"--picture {picture} --goal {goal} of {len(names)} joints: no picture of that.",
            remedy="Name a .png or .svg file and one joint (--joint); the safe region is that of --goal backdrive or track.",
        )
    own = {
        "stiffness": _joint_options.by_joint(stiffness, "--stiffness", "8e4:1.2e5", names),
        "inertia": _joint_options.by_joint(inertia, "--inertia", "0.6:0.8", names),
        "motor_share": _joint_options.by_joint(motor_share, "--motor-share", "0.15", names, interval=False),
        "counts": _joint_options.by_joint(counts, "--counts", "1043038", names, interval=False),
    }
    guards = _joint_options.guards(
        _joint_options.by_joint(top_speed, "--top-speed", "3", names, interval=False),
        _joint_options.by_joint(limit, "--limit", "20", names, interval=False),
        urdf,
        names,
    )
    found: list[Tuning] = []
    refused: dict[str, BackdriveError] = {}
    with progress(quiet=as_json) as say:
        for k, name in enumerate(names):
            among = f", joint {k + 1} of {len(names)}" if len(names) > 1 else ""
            of_joint: dict[str, Any] = {option: values.get(name) for option, values in own.items()}
            try:
                facts = facts_of(loaded.joint(name), **shared, **of_joint)
                found.append(
                    tune(
                        facts,
                        goal,
                        wish=wish,
                        stroke=usual_stroke(facts, stroke, duration),
                        joints=joints,
                        seed=seed,
                        draw=picture is not None,
                        dither=dither,
                        **guards[name],
                        say=lambda sentence, who=name + among: say(f"{who}: {sentence}"),
                    )
                )
            except BackdriveError as error:
                refused[name] = error
        if refused and not found:
            _refuse(refused, as_json)
        if picture is not None:
            from backdrive.report.pictures.tuning import draw

            say("Drawing")
            draw(found[0], picture)
        if output is not None:
            save_tunings(found, output)
    written = [str(p) for p in (output, picture) if p]
    if as_json:
        from backdrive.tuning.tuning_file import plain

        without = {name: error.text for name, error in refused.items()}
        print_json(
            {"ok": not refused, "joints": [plain(t) for t in found], "refused": without, "written": written}
        )
    else:
        for tuning in found:
            show_tuning(tuning)
        for path in written:
            echo(f"Wrote {path}")
        show_controller(model, output)
        for error in refused.values():
            echo(f"backdrive: {error.text}", err=True)
    if refused:
        raise typer.Exit(1)


def _refuse(refused: dict[str, BackdriveError], as_json: bool) -> None:
    """Raise the error of a single joint; of several, print all errors but the last and raise that one."""
    *others, last = refused.values()
    for error in others:
        if not as_json and error.text != last.text:
            echo(f"backdrive: {error.text}", err=True)
    raise last
