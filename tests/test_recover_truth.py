"""What goes into a simulated joint comes out of its log."""

import numpy as np
import pytest

from backdrive.identification import identify
from backdrive.identification.metrics import relative_curve_distance
from backdrive.identification.sweep import identify_sweep, sweep_knots
from backdrive.plans import Sweep, TorqueRamp
from backdrive.simulation import MACHINES, machine
from backdrive.simulation.machines import bent_curve, joint_1
from backdrive.simulation.open_loop import simulate

SWEEPS = {
    "setup_a": Sweep(0.1, 0.3, 6, unit="m"),
    "joint_0": Sweep(np.deg2rad(20), 2.0, 6),
    "joint_1": Sweep(np.deg2rad(20), 2.0, 6, center=0.4),
    "joint_2": Sweep(np.deg2rad(20), 2.0, 6, center=-0.5),
}


@pytest.mark.parametrize("name", MACHINES)
@pytest.mark.parametrize("planned", [True, False])
def test_every_machine_of_the_thesis_by_its_sweep(name, planned):
    joint, plan = machine(name), SWEEPS[name]
    log = simulate(joint, plan, seed=11)
    friction, _ = identify_sweep([log if planned else log.replace(plan=None)], name)
    for direction in (1, -1):
        off = relative_curve_distance(friction.law, joint.law, plan.top_speed, direction=direction)
        assert off < 0.01
    assert friction.dynamics["inertia"].value == pytest.approx(joint.inertia, rel=0.02)
    assert friction.fitted.residual < 12.0


@pytest.mark.parametrize(
    "change",
    [
        {"stiffness": 1e5, "damping": 17.0},
        {"stiffness": 1e5, "damping": 17.0, "friction_side": "load"},
        {"law": bent_curve(9.56, 7.0, stribeck=2.0)},
        {"torque_noise": 0.5},
        {"encoder_count": 1e-5},
        {"gravity_sin": 20.0, "gravity_cos": -15.0},
    ],
)
def test_joint_1_with_one_thing_changed(change):
    joint = joint_1().replace(**change)
    log = simulate(joint, Sweep(np.deg2rad(20), 2.0, 8), seed=3)
    knots = sweep_knots(log, 0)
    off = knots.F - joint.law.torque(knots.V)
    assert np.sqrt(np.mean(off**2)) < (0.03 if change.get("torque_noise", 0.0) < 0.2 else 0.06)
    assert knots.inertia[0] == pytest.approx(1.6, rel=0.01)


@pytest.mark.parametrize("rate", [250.0, 500.0, 2000.0])
def test_other_sampling_rates(rate):
    joint = joint_1()
    plan = Sweep(np.deg2rad(30), 1.5, 6)
    knots = sweep_knots(simulate(joint, plan, rate=rate, seed=5), 0)
    assert pytest.approx(joint.law.torque(knots.V), abs=0.05) == knots.F


def test_a_known_delay_is_taken_into_account():
    joint = joint_1().replace(delay=1e-3)
    log = simulate(joint, Sweep(np.deg2rad(20), 2.0, 6), seed=6)
    unaware, aware = sweep_knots(log, 0), sweep_knots(log, 0, delay=1e-3)
    assert pytest.approx(joint.law.torque(aware.V), abs=0.04) == aware.F
    assert np.abs(unaware.F - joint.law.torque(unaware.V)).max() > 0.2


def test_load_dependent_friction_shows_as_more_friction_where_gravity_is():
    joint = joint_1().replace(load_dependence=0.05)
    plan = Sweep(np.deg2rad(20), 1.0, 4)
    knots = sweep_knots(simulate(joint, plan, seed=7), 0)
    expected = joint.law.torque(knots.V) + 0.05 * 30.0 * np.cos(knots.center)
    assert pytest.approx(expected, abs=0.1) == knots.F


def test_the_front_door_takes_simulated_logs():
    joint = joint_1()
    log = simulate(joint, SWEEPS["joint_1"], seed=8)
    result = identify(log)
    assert result.method == "sweep"
    assert result.model.torque("joint_1", 1.0) == pytest.approx(joint.law.torque(1.0), abs=0.05)
    ramp = simulate(
        joint.replace(stiffness=1e5, damping=17.0, friction_side="load", gravity_cos=0.0),
        TorqueRamp(12.0, 3.0, 1),
    )
    result = identify(ramp)
    assert result.method == "ramp"
    assert result.model.joint("joint_1").law.rate.coulomb_positive == pytest.approx(9.56, abs=0.3)
