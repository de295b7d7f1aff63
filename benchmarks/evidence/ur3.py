"""UR3: six joints fitted on one exciting motion and judged on another one.

The description comes from the package `example-robot-data`. The logs' effort has the opposite sign of torque on the joint:
read as it stands, friction would push. The program first shows that this is noticed, then reads it the right way round.
Everything that was chosen (knots, filters, priors) was chosen by cross-validation within id1; id2 is only judged.
"""

from __future__ import annotations

import sys
import time
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from _common import Judge, data, parser

from backdrive.errors import BackdriveError
from backdrive.identification import identify, validate
from backdrive.identification.arm import identify_arm, predict_arm
from backdrive.logs.log import Joint
from backdrive.logs.readers import read_log

NAMES = [f"{n}_joint" for n in ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")]
LIMITS = (8.0, 8.0, 8.5, 9.0, 11.5, 11.5)
MAP = "t=mt,q=mq,dq=mdq,tau={sign}mtorque"
URDF = "share/example-robot-data/robots/ur_description/urdf/ur3_robot.urdf"


def description() -> Path:
    """Return the path of the UR3's URDF in the installed package, or end with 2."""
    found = find_spec("pinocchio")
    roots = [Path(sys.prefix), *(Path(found.origin).parents if found and found.origin else ())]
    for root in roots:
        if (root / URDF).exists():
            return root / URDF
    print("the UR3's description is absent: pip install example-robot-data")
    sys.exit(2)


def read(name: str, sign: str = "-"):
    return read_log(data("ur3", name), map=MAP.format(sign=sign), names=NAMES)


def bag(name: str):
    """Read a bag of the same arm, whose joints have other names and whose effort has the same sign."""
    log = read_log(data("ur3", name))
    assert log.torque is not None
    return log.replace(joints=tuple(Joint(name=n) for n in NAMES), torque=-log.torque)


def row(label: str, values) -> None:
    print(f"  {label:34s}" + "".join(f"{v:8.2f}" for v in values))


def main() -> None:
    """Fit on id1, judge on id2."""
    short = parser(__doc__).parse_args().short
    urdf = description()
    seen, unseen = read("id1.mat"), read("id2.mat")
    judge = Judge()
    try:
        identify(read("id1.mat", ""), method="arm", urdf=str(urdf))
        judge.that("effort as it stands is recognised as inverted", False)
    except BackdriveError as error:
        print(f"read as it stands: {error}")
        judge.that("effort as it stands is recognised as inverted", "sign" in str(error))
    start = time.perf_counter()
    result = identify(seen, method="arm", urdf=str(urdf), held_out=[unseen])
    took = time.perf_counter() - start
    joints = result.model.joints
    held = validate(result.model, [unseen], urdf=str(urdf))
    print(
        f"\nresidual [%] of {seen.duration:.0f} s fitted (id1) and {unseen.duration:.0f} s unseen (id2), in {took:.1f} s"
    )
    print(" " * 36 + "".join(f"{n.removesuffix('_joint')[-7:]:>8s}" for n in NAMES))
    row("id1, fitted, below 5 Hz", [f.fitted.residual for f in joints])
    row("id2, unseen, below 5 Hz", [held[n].residual for n in NAMES])
    row("id2, unseen, raw", [held[n].residual_raw for n in NAMES])
    row("at most", LIMITS)
    row(
        "load friction [% of torque]",
        [100 * f.law.growth.mean if f.law.growth else 0 for f in joints],
    )
    if not short:
        plain = identify_arm(seen, urdf, held_out=[unseen], load_friction=False)[0]
        row("id2 without load friction", [f.held_out.residual for f in plain])
        swapped = identify_arm(unseen, urdf, held_out=[seen])[0]
        row("id2 fitted, id1 judged", [f.held_out.residual for f in swapped])
    print("\nother days of an arm of the same kind (nothing is required here):")
    for name in () if short else ("arm_1.bag", "arm_2.bag"):
        log = bag(name)
        other = validate(result.model, [log], urdf=str(urdf))
        row(f"{name}, unseen, below 5 Hz", [other[n].residual for n in NAMES])
    own = np.linalg.norm(predict_arm(result.model, unseen, urdf) - unseen.torque, axis=0)
    raw = 100 * own / np.linalg.norm(unseen.torque, axis=0)
    print()
    for n, limit in zip(NAMES, LIMITS, strict=False):
        judge.at_most(f"{n}, unseen, below 5 Hz", held[n].residual, limit, "%")
    judge.that(
        "raw residuals agree with a sum over the file's own samples",
        all(abs(r - held[n].residual_raw) < 0.5 for r, n in zip(raw, NAMES, strict=False)),
    )
    judge.end()


if __name__ == "__main__":
    main()
