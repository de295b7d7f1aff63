"""`backdrive demo`: the whole way on a simulated joint, with no robot and no data at hand."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from backdrive.cli import _logs
from backdrive.cli._logs import AsJson
from backdrive.cli._output import console as new_console
from backdrive.cli._output import print_json, table
from backdrive.cli._progress import progress

SHOWN = (0.1, 0.25, 0.5, 0.75, 1.0)  # shares of the top speed in the table


def command(
    folder: Annotated[Path, typer.Option("--folder", help="Where report, model and log go.")] = Path(
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

    _logs.check_folder(folder, ("model.json", "report.html"))
    require_matplotlib()
    start = time.perf_counter()
    with progress(quiet=as_json) as say:
        say("Compiling (the first run takes a while)")
        import numpy as np

        from backdrive._files import make_folder, write_together
        from backdrive.identification import identify
        from backdrive.model.file import encode
        from backdrive.plans import Sweep
        from backdrive.report import render
        from backdrive.simulation.machines import machine
        from backdrive.simulation.open_loop import simulate

        plant = machine(joint)
        stroke, top_speed = (float(np.deg2rad(20.0)), 2.0) if plant.unit == "rad" else (0.1, 0.3)
        sweep = Sweep(stroke, top_speed, cycles=10, joint=plant.name, unit=plant.unit)
        say("Sweeping the simulated joint")
        log = simulate(plant, sweep, seed=seed)
        say("Identifying")
        result = identify(log)
        friction = result.model.joints[0]
        speeds = sweep.top_speed * np.array(SHOWN)
        truth, found = plant.law.torque(speeds), friction.law.torque(speeds)
        say("A hand moves the joint")
        from backdrive.report.hand import hand_section
        from backdrive.simulation.hand_demo import guided

        hand = guided(joint, friction.law, plant.inertia, seed)
        say("Drawing the report")
        page = render(
            result,
            command=f"backdrive demo --joint {joint} --seed {seed}",
            title=f"Demo: simulated joint {log.names[0]}",
            compare={log.names[0]: _curve(plant.law, sweep.top_speed)},
            more=[hand_section(hand)],
        )
        make_folder(folder, "--folder")
        model, report = write_together(
            {folder / "model.json": encode(result.model), folder / "report.html": page}
        )
    wall = time.perf_counter() - start
    rows = [
        {"speed": float(v), "truth": float(a), "identified": float(b), "error": float(b - a)}
        for v, a, b in zip(speeds, truth, found)
    ]
    if as_json:
        print_json(
            {
                "ok": True,
                "report": str(report),
                "model": str(model),
                "friction": rows,
                "hand": {"bare": hand.force[0], "compensated": hand.force[1], "estimate_error": hand.error},
            }
        )
        return
    _print(rows, friction.joint, report, wall, sweep.duration, hand)


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
        f"A hand needs {bare:.2f} {hand.unit} (RMS) to move the bare joint, {compensated:.2f} {hand.unit} with its friction "
        f"compensated; estimated without a sensor, its force is wrong by {100 * hand.error:.0f} %."
    )
    console.print(f"Open {report}")
