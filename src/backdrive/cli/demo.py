"""`backdrive demo`: all steps on a simulated joint, without a robot and without data."""

from __future__ import annotations

import json
import shlex
import time
from pathlib import Path
from typing import Annotated

import typer

from backdrive.cli._logs import AsJson
from backdrive.cli._output import console as new_console
from backdrive.cli._output import echo, print_json, table
from backdrive.cli._progress import progress
from backdrive.cli._targets import check_folder

FILES = ("log.csv", "plan.json", "model.json", "report.html")
SHOWN = (0.1, 0.25, 0.5, 0.75, 1.0)  # shares of the top speed in the table


def command(
    folder: Annotated[Path, typer.Option("--folder", help="Folder for report, model and log.")] = Path(
        "backdrive-demo"
    ),
    joint: Annotated[
        str, typer.Option("--joint", help="Which simulated joint: joint_0, joint_1, joint_2 or setup_a.")
    ] = "joint_1",
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of the noise.")] = 0,
    as_json: AsJson = False,
) -> None:
    """Sweep a simulated joint of the thesis' manipulator, identify it, compare with the truth, and let a hand move it.

    Example: backdrive demo
    """
    from backdrive.report.pictures.canvas import require_matplotlib

    check_folder(folder, FILES)
    require_matplotlib()
    start = time.perf_counter()
    with progress(quiet=as_json) as say:
        say("Compiling (the first run takes a while)")
        import numpy as np

        from backdrive._files import make_folder, write_together
        from backdrive.identification import identify
        from backdrive.model.file import encode
        from backdrive.plans import Sweep, plan_to_dict
        from backdrive.report import render
        from backdrive.simulation.machines import machine
        from backdrive.simulation.open_loop import simulate

        plant = machine(joint)
        stroke, top_speed = (float(np.deg2rad(20.0)), 2.0) if plant.unit == "rad" else (0.1, 0.3)
        sweep = Sweep(stroke, top_speed, cycles=10, joint=plant.name, unit=plant.unit)
        say("Sweeping the simulated joint", 0.15)
        log = simulate(plant, sweep, seed=seed)
        say("Identifying", 0.25)
        result = identify(log)
        friction = result.model.joints[0]
        speeds = sweep.top_speed * np.array(SHOWN)
        truth, found = plant.law.torque(speeds), friction.law.torque(speeds)
        say("A hand moves the joint", 0.45)
        from backdrive.report.hand import hand_section
        from backdrive.simulation.hand_demo import simulate_hand

        hand = simulate_hand(joint, friction.law, plant.inertia, seed)
        say("Drawing the report", 0.9)
        page = render(
            result,
            command=f"backdrive demo --joint {joint} --seed {seed}",
            title=f"Demo: simulated joint {log.names[0]}",
            compare={log.names[0]: _curve(plant.law, sweep.top_speed)},
            more=[hand_section(hand)],
        )
        make_folder(folder, "--folder")
        plan = json.dumps(plan_to_dict(sweep), indent=2, ensure_ascii=False) + "\n"
        contents = (_csv(log), plan, encode(result.model), page)
        path, plan_path, model, report = write_together(
            {folder / name: text for name, text in zip(FILES, contents, strict=False)}
        )
    wall = time.perf_counter() - start
    rows = [
        {"speed": float(v), "truth": float(a), "identified": float(b), "error": float(b - a)}
        for v, a, b in zip(speeds, truth, found, strict=False)
    ]
    if as_json:
        print_json(
            {
                "ok": True,
                "report": str(report),
                "model": str(model),
                "log": str(path),
                "plan": str(plan_path),
                "friction": rows,
                "hand": {"bare": hand.force[0], "compensated": hand.force[1], "estimate_error": hand.error},
            }
        )
        return
    _print(rows, friction.joint, report, wall, sweep.duration, hand)
    _print_next(path, plan_path, model, hand)


def _csv(log) -> str:
    """Return a log of one joint as a table of time, position and torque."""
    rows = zip(log.time, log.position[:, 0], log.torque[:, 0], strict=False)
    return "t,q,tau\n" + "".join(f"{t:.9g},{q:.12g},{tau:.9g}\n" for t, q, tau in rows)


def _print_next(log: Path, plan: Path, model: Path, hand) -> None:
    saved = 100.0 * (1.0 - hand.force[1] / hand.force[0])
    softest, stiffest = (f"{share * hand.stiffness:g}" for share in (0.8, 1.2))
    echo("The same from the log alone, as with your own robot:")
    echo(f"  backdrive identify {shlex.quote(str(log))} --plan {shlex.quote(str(plan))} \\")
    echo("    -o model.json --report report.html")
    echo(f"Compensation took {saved:.0f} % of the force off the hand. Find your compensator:")
    echo(f"  backdrive tune {shlex.quote(str(model))} \\")
    echo(f"    --stiffness {softest}:{stiffest} --top-speed {hand.top_speed:g} -o tuning.json")
    echo("and write it as C for your controller:")
    echo(f"  backdrive export {shlex.quote(str(model))} \\")
    echo("    --tuning tuning.json --to c -o firmware/")


def _curve(law, top: float):
    import numpy as np

    from backdrive.identification import Curve

    speed = top * np.linspace(1e-6, 1.0, 80)
    velocity = np.concatenate([-speed[::-1], speed])
    return Curve(
        velocity=velocity, torque=law.torque(velocity), standard_error=np.full(velocity.size, np.nan)
    )


def _print(rows: list[dict], joint, report: Path, wall: float, duration: float, hand) -> None:
    console = new_console()
    console.print(f"A simulated joint was swept for {duration:.1f} s and identified ({wall:.1f} s in all).")
    speeds = table(f"speed [{joint.unit}/s]", f"true friction [{joint.torque_unit}]", "identified", "error")
    for row in rows:
        speeds.add_row(
            f"{row['speed']:.2f}", f"{row['truth']:.3f}", f"{row['identified']:.3f}", f"{row['error']:+.3f}"
        )
    console.print(speeds)
    bare, compensated = hand.force
    console.print(
        f"A hand needs {bare:.2f} {hand.unit} (RMS) to move the bare joint, and {compensated:.2f} {hand.unit} with its "
        f"friction compensated. The estimate of its force without a sensor is wrong by {100 * hand.error:.0f}%."
    )
    console.print(f"Open {report}")
