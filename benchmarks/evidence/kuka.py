"""KUKA KR300: two axes of a heavy industrial robot, fitted on one motion and judged on another.

Torques are measured on the motor side; multiplied by the gear ratios they act on the joints. Axis 1 turns about the
vertical: no gravity. While one axis moves the others pull on it; the file carries the authors' modelled torques of gravity,
inertia and Coriolis forces along the reference, which take that pull away.
"""

from __future__ import annotations

import numpy as np
from _common import Judge, data, parser

from backdrive.identification import identify, validate
from backdrive.identification.dynamics import predict
from backdrive.identification.quality import judge as quality
from backdrive.identification.signals import prepare
from backdrive.logs.readers import read_log

GEAR = (256.86, 267.43, 252.33, 221.0, 239.62, 154.32)
MAP = "t=rec.time_cont,q=deg*rec.act_pos_mot_deg,dq=deg*rec.act_vel_mot_deg_per_s,tau=rec.act_torque_abs_nm"
PULL = ",tau_model=tau_g_all+tau_a_all+tau_c_all"


def main() -> None:
    """Fit on A, judge on B."""
    parser(__doc__).parse_args()  # it takes seconds, shortened or not
    judge = Judge()
    cases = [("a6", MAP, 27.0), ("a1", MAP, 35.0), ("a1", MAP + PULL, 20.0)]
    for joint, mapping, limit in cases:
        a, b = (
            read_log(
                data("kuka_kr300", f"FF_{x}_0.8ms.mat"),
                map=mapping,
                names=[f"a{i}" for i in range(1, 7)],
                gear=GEAR,
            )
            for x in "AB"
        )
        result = identify(
            a, method="motion", joints=[joint], held_out=[b], gravity=False if joint == "a1" else None
        )
        friction = result.model.joints[0]
        said = (
            "with the modelled torques of the other axes" if mapping != MAP else "from its own motion alone"
        )
        print(f"axis {joint[1]} {said}: {friction.law.rate.NAME}")
        for name, e in friction.dynamics.items():
            print(f"    {name} = {e.value:.5g} +- {e.standard_error:.2g} {e.unit}")
        held = validate(result.model, [b])[joint]
        print(f"    fitted on A: {friction.fitted.residual:.1f} % (raw {friction.fitted.residual_raw:.1f} %)")
        print(
            f"    unseen B, while it moves: {held.residual:.1f} % (raw {held.residual_raw:.1f} %), {held.samples} samples"
        )
        everywhere = quality(
            [(s.torque, predict(friction, s), s.rate, np.ones(s.time.size, bool)) for s in prepare(b, joint)]
        )
        print(
            f"    unseen B, long rests included, where friction may be anything: {everywhere.residual:.1f} % "
            f"(raw {everywhere.residual_raw:.1f} %)"
        )
        judge.at_most(f"axis {joint[1]} {said}, unseen B while it moves", held.residual, limit, "%")
        judge.at_most(f"axis {joint[1]} {said}, unseen B altogether", everywhere.residual, limit, "%")
    judge.end()


if __name__ == "__main__":
    main()
