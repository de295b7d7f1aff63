"""Setup A and Setup B, on which all experiments of chapters 2 to 4 are run, and the choice of parameters that the thesis does
not print.

The parameters were fixed before any statement was judged, in this order:

1. What the thesis prints is taken as printed: counts, ratios, moving mass, F of Joints 0 to 2, K, alpha, R_d, V_W, T, no factor
   R in chapter 3, m, b, gains and filter of Setup A in chapter 4.
2. The thesis does not print the transmission's stiffness K_c; K is used. On Setup A the thesis calls K "close to the elasticity
   of the setup" (3.5.1) and "estimated as the compliance of the setup" (4.6.1). On Setup B it gives no other hint.
3. Joints 3 to 5, of which ratio and largest torque are printed, are assumed in proportion to these (`wrist`). All servos have
   the highest bandwidth without oscillation of any joint, since the thesis sets gains "as high as possible" (2.3.2).
4. The rest (inertias of either side, growth of friction with speed, F_p and F_n of Setup A, damping) is that of
   `simulation.machines`, estimated there from motors' data, and is the same for all figures.
5. A statement that is lost on these joints counts as lost. No figure has a joint of its own; `benchmarks/evidence/thesis_claims.py
   --stiffness` shows every statement over K_c/K.
"""

from __future__ import annotations

import numpy as np

from backdrive.engine.servo import Servo
from backdrive.simulation.joint import JointSimulation
from backdrive.simulation.machines import COUNTS, bent_curve, joint_0, joint_1, joint_2, setup_a

RATIO = 1.0  # K_c by K
RATIOS = (1.0, 1.1, 1.2, 1.5, 2.0)  # at which every statement is looked at
K_A, K_B = 1.2e6, 5e4  # K of the thesis [N/m], [N.m/rad]
WRIST = {
    3: (120.0, 34.2, 2.5e4),
    4: (100.0, 28.5, 2.0e4),
    5: (81.5, 23.3, 1.5e4),
}  # joint -> ratio, largest torque [N.m] (Table 2.1), K_c [N.m/rad] (assumed)
BANDWIDTH = 60.0  # of the arm's servos [rad/s]: at 80 Joint 0 oscillates
ROTOR = 1.66e-6  # of a 30 W motor [kg.m^2]
JOINTS = ("setup_a", "joint_0", "joint_1", "joint_2")


def setups(ratio: float = RATIO) -> dict[str, JointSimulation]:
    """Return Setup A and Joints 0 to 2 of Setup B as Fig. 3.2 draws them: compliant, with friction on the load's side.

    Args:
        ratio: K_c by K [-].
    """
    return dict(zip(JOINTS, [setup_a().replace(stiffness=ratio * K_A), *arm(ratio)[:3]], strict=False))


def arm(ratio: float = RATIO) -> tuple[JointSimulation, ...]:
    """Return Joints 0 to 5 of Setup B.

    Args:
        ratio: K_c by K [-], of Joints 0 to 2; the thesis prints no K of the others.
    """
    first = [
        make(compliant=True).replace(stiffness=ratio * K_B, friction_side="load")
        for make in (joint_0, joint_1, joint_2)
    ]
    return tuple(
        j.replace(servo=Servo.from_bandwidth(j.inertia, BANDWIDTH))
        for j in (*first, *(wrist(number) for number in WRIST))
    )


def wrist(number: int) -> JointSimulation:
    """Return Joint 3, 4 or 5 of the arm; all of it is assumed but ratio and largest torque.

    Friction in proportion to the torque as on Joint 0; rotor times the ratio squared and half as much for the wave generator;
    wrist, sensor and grip as 0.05 kg.m^2 and 2 N.m of weight.

    Args:
        number: 3, 4 or 5.
    """
    ratio, limit, stiffness = WRIST[number]
    motor, load, scale = 1.5 * ROTOR * ratio**2, 0.05, limit / 95.1
    return JointSimulation(
        name=f"joint_{number}",
        law=bent_curve(6.85 * scale, 5.0 * scale),
        motor_inertia=motor,
        load_inertia=load,
        stiffness=stiffness,
        damping=0.1 * np.sqrt(stiffness * motor),
        friction_side="load",
        gravity_cos=2.0,
        encoder_count=2.0 * np.pi / COUNTS / ratio,
        torque_limit=limit,
    )
