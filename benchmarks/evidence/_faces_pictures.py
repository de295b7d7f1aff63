"""Pictures of `faces`: every one is asked for the boxes of its own texts."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

from _common import Judge
from _picture_boxes import faults_of, figures_made


def pictures(judge: Judge, place: Path, short: bool, plant: bool) -> None:
    """Ask every picture for the boxes of its own texts."""
    print("pictures")
    from backdrive import Sweep, identify, read_log, simulate, tune
    from backdrive.external import estimate_force
    from backdrive.laws.examples import ELEMENT_EXAMPLES, RATE_EXAMPLES, example
    from backdrive.plans import ConstantVelocity, Multisine, SawtoothTorque, SineTorque, TorqueRamp
    from backdrive.report import render, show
    from backdrive.report.force import render_force
    from backdrive.report.hand import hand_section
    from backdrive.report.pictures import canvas, signatures
    from backdrive.report.pictures.plan import picture
    from backdrive.report.pictures.tuning import safe_region
    from backdrive.simulation.hand_demo import simulate_hand
    from backdrive.simulation.machines import machine

    sys.path.append(str(Path(__file__).parents[1]))
    import passivity_figure

    plant_of = machine("joint_1").replace(torque_noise=1.0)
    plan = Sweep(0.35, 2.0, cycles=6)
    log = simulate(plant_of, plan, seed=0)
    result = identify(log)
    model = result.model
    friction = model.joints[0].law

    stiff: dict[str, Any] = {"stiffness": (8e4, 1.2e5), "top_speed": 3.0, "joints": 8, "draw": True}
    tuning = tune(model, "joint_1", **stiff)
    others: list[Any] = [
        ConstantVelocity(0.5, (0.05, 0.2, 1.0)),
        Multisine(0.3, 0.1, 2.0, 10.0),
        SawtoothTorque(5.0, 0.5),
        SineTorque(5.0, 0.5),
        TorqueRamp(8.0, 2.0),
    ]

    def laws() -> None:
        for name in [*RATE_EXAMPLES, *ELEMENT_EXAMPLES][:: 8 if short else 1]:
            signatures.draw(example(name))

    kinds: dict[str, Any] = {
        "report": lambda: render(result, command="x"),
        "curve of a result": lambda: show.picture(result),
        "curve of a model": lambda: show.picture(model),
        "force": lambda: show.picture(estimate_force(model, log)),
        "report of the force": lambda: render_force(estimate_force(model, log), command="x"),
        "plan": lambda: picture(plan, "svg"),
        "other plans": lambda: [picture(other, "svg") for other in others],
        "safe region": lambda: safe_region(tuning),
        "hand": lambda: hand_section(simulate_hand("joint_1", friction, plant_of.inertia, 0)),
        "laws": laws,
        "passivity": passivity_figure.draw,
    }
    if (root := os.environ.get("BACKDRIVE_DATA")) and (emps := Path(root, "emps", "DATA_EMPS.mat")).exists():
        real = identify(read_log(emps, map="t=t,q=qm,tau=35.15*vir"))
        kinds["report of a real log"] = lambda: render(real, command="x")
        (place / "real.html").write_text(render(real, command="x"))
    for kind, draw in kinds.items():
        with canvas.house_style(), figures_made() as made:
            returned = draw()
            made += [returned] if kind == "safe region" else []
            if plant and kind == "plan":
                made[-1].text(0.5, 0.5, "planted")
                made[-1].text(0.5, 0.5, "fault")
            faults = [fault for figure in made for fault in faults_of(figure)]
        rest = f": {faults[0]}, {len(faults)} in all" if faults else ""
        judge.that(f"{kind}: {len(made)} pictures without overlaps and cuts{rest}", bool(made) and not faults)
    thesis(judge, short)


def thesis(judge: Judge, short: bool) -> None:
    """Ask the pictures of `reproduce`, the league's among them, for the boxes of their texts."""
    from importlib import import_module

    from backdrive.report.pictures import canvas
    from backdrive.thesis._footer import footer
    from backdrive.thesis.catalog import ENTRIES

    for entry in ENTRIES:
        if short and entry.name not in ("fig-2.3", "fig-3.8"):
            continue
        experiment = import_module(entry.module)
        few: dict[str, Any] = {"seeds": 2, "budget": 4, "joints": 1} if entry.name == "league" else {}
        outcome = experiment.run(seed=0, **few)
        with canvas.house_style():
            figure = experiment.draw(outcome)
            footer(figure, outcome)
            faults = faults_of(figure)
        rest = f": {faults[0]}, {len(faults)} in all" if faults else ""
        judge.that(f"{entry.name} without overlaps and cuts{rest}", not faults)
