"""Fourteen tables of real-world shapes, one command each, to the same model.

One log of three joints by an independent generator is written in every shape into a temporary folder; `backdrive identify` reads
each by one command, and its model must predict the friction that the plain table does. The command's syntax, beyond today's:

    channel = columns [, columns ...]     joints one after another; a comma before `name=` begins the next channel
    columns = sum of terms                q=deg*base,-deg*arm+0.3,hand/2     a number alone is an offset,
              (0.1,-0.2,0.3) are offsets one a joint
    term    = [factor * | / ...] column   tau=2.5*I1..I3   t=tick/1000       * and / bind alike, from the left
    column  = name | "any name" | name1..name9 (a range) | *_position (a glob, in the file's order; what the star matches
              names the joint) | (a,b,c) (a list)
    factor  = number | deg | rpm | turn (2 pi) | (2.5,-1.2,0.4) (one a joint) | a column with a single number

    --join FILE          columns of another file, interpolated onto the first one's clock; may be repeated
    --motor-side q,tau   which channels `--gear` brings to the joint (positions are divided by it, torques multiplied);
                         default: tau, as it is today
    --coupling FILE      matrix C (CSV or JSON) of q_joint = C q_motor; torque by the inverse transpose; kept in the model
    --start SECONDS      where in the log the plan begins, or `auto`: by the motion

A factor in the command replaces the unit in the column's name: 0.001*"Zeit [ms]" is seconds, once. By themselves: NAME_joint_pos,
`name` beside lists, position[1] (joint 1, no unit), LeRobot folders, PlotJuggler's paths.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from _common import Judge, parser
from _independent import Joint, Logger, multisine, record
from _tables_files import TABLES, Data, Table

from backdrive import Joint as LogJoint
from backdrive import Log, Sweep, identify, load_model
from backdrive.plans import save_plan

CLOSE = 0.02  # of the friction: torques joined from another clock are interpolated [-]
RATE, SECONDS, NOISE = 200.0, 20.0, 0.02
STROKE, TOP, CYCLES = 0.8, 1.5, 8  # of the planned sweep [rad, rad/s, -]


def three_joints() -> Data:
    """Return the log that is written as thirteen tables."""
    rng = np.random.default_rng(1307)
    made = []
    for coulomb, gravity in ((1.5, (0.0, 0.0)), (0.8, (1.0, 0.5)), (0.4, (0.3, 0.0))):
        joint = Joint(coulomb=coulomb, viscous=0.3 * coulomb, inertia=0.1 * coulomb, gravity=gravity)
        made.append(
            record(joint, multisine(SECONDS, 2.0, rng), Logger(rate=RATE, noise=NOISE * coulomb), rng)
        )
    position = np.column_stack([r.position for r in made])
    return Data(made[0].time, position, np.column_stack([r.torque for r in made]))


def one_sweep(folder: Path) -> tuple[Data, Log]:
    """Return a sweep whose plan lies in a folder, and its log with the plan on time."""
    rng = np.random.default_rng(1308)
    plan = Sweep(stroke=STROKE, top_speed=TOP, cycles=CYCLES)
    save_plan(plan, folder / "plan.json")
    t = np.arange(round(plan.duration / 1e-4)) * 1e-4
    made = record(Joint(), plan.position(t), Logger(rate=RATE, noise=NOISE), rng)
    joints = (LogJoint(name="joint_1", unit="rad"),)
    log = Log(
        time=made.time, joints=joints, position=made.position[:, None], torque=made.torque[:, None], plan=plan
    )
    return Data(made.time, made.position[:, None], made.torque[:, None]), log


def curves(model) -> np.ndarray:
    """Return the friction of every joint at three speeds both ways [N.m], (J, 6)."""
    rows = []
    for friction in model.joints:
        top = min(abs(v) for v in friction.validity.velocity)
        rows.append(friction.law.torque(top * np.array([-0.9, -0.5, -0.2, 0.2, 0.5, 0.9])))
    return np.array(rows)


def command(table: Table, data: Data, folder: Path) -> tuple[str, Path]:
    """Write a table, run its command, and return what it printed where it failed, and the model's path."""
    arguments = table.write(data, folder)
    model = folder / "model.json"
    shown = " ".join(f"'{a}'" if {"*", " ", '"', "("} & set(a) else a for a in arguments)
    print(f"{table.name}: backdrive identify {shown.replace(str(folder) + '/', '')}", flush=True)
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    ran = subprocess.run(
        [sys.executable, "-m", "backdrive", "identify", *arguments, "-o", str(model), "--gate", "100"],
        capture_output=True,
        text=True,
        env=environment,
        check=False,
    )
    return "" if model.exists() else " ".join((ran.stderr or ran.stdout).split())[:240], model


def compare(judge: Judge, table: Table, path: Path, wanted: np.ndarray) -> None:
    """Judge a model against the one of the plain table."""
    model = load_model(path)
    got = curves(model)
    if got.shape != wanted.shape:
        judge.that(f"{table.name}: {len(got)} joints ({', '.join(model.names)}) for {len(wanted)}", False)
        return
    scale = np.abs(wanted).mean(axis=1, keepdims=True)
    off = float(np.max(np.abs(got - wanted) / scale))
    judge.at_most(f"{table.name}: friction off by", 100.0 * off, 100.0 * CLOSE, "%")
    if table.names:
        judge.that(f"{table.name}: joints are {', '.join(model.names)}", tuple(model.names) == table.names)


def main() -> None:
    """Write, read and judge every table."""
    made = parser(__doc__)
    made.add_argument("--only", default="", help="tables whose name holds this")
    asked = made.parse_args()
    judge = Judge()
    data = three_joints()
    joints = tuple(LogJoint(name=f"joint_{k + 1}", unit="rad") for k in range(3))
    plain = curves(
        identify(Log(time=data.time, joints=joints, position=data.position, torque=data.torque)).model
    )
    for table in TABLES:
        if asked.only not in table.name:
            continue
        with tempfile.TemporaryDirectory() as scratch:
            folder = Path(scratch)
            own, wanted = data, plain
            if table.swept:
                own, log = one_sweep(folder)
                wanted = curves(identify(log).model)
            failed, model = command(table, own, folder)
            if failed:
                judge.that(f"{table.name}: {failed}", False)
            else:
                compare(judge, table, model, wanted)
    judge.end()


if __name__ == "__main__":
    main()
