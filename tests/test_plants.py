import numpy as np
import pytest

from backdrive.engine import axis as plant
from backdrive.errors import InvalidInput, UnknownName
from backdrive.laws import CoulombViscous, Law, kernels
from backdrive.plans import Sweep, TorqueRamp
from backdrive.simulation import MACHINES, JointSimulation, Servo, machine
from backdrive.simulation.closed_loop import Scene, kernel_of, prepare
from backdrive.simulation.hand import still
from backdrive.simulation.kernel import COLUMNS
from backdrive.simulation.machines import bent_curve, joint_1
from backdrive.simulation.open_loop import drive, longest_step, simulate

FREE = Law(rate=CoulombViscous(coulomb_positive=0.0, coulomb_negative=0.0))
DRY = Law(rate=CoulombViscous(coulomb_positive=9.0, coulomb_negative=6.0))


def advance(joint, state, torque, h, steps):
    """Advance a state under a constant torque; return it after every step."""
    law, s = joint.law, np.array(state, dtype=float)
    row, p, x = joint.row(), law.row(), law.state()
    out = np.empty((steps, 5))
    step = kernels.of_kinds(plant.advance, law.rate.KIND, law.element.KIND)
    for i in range(steps):
        step(row, s, law.rate.KIND, law.element.KIND, p, x, torque, h, 20.0)
        out[i] = s
    return out


def constant(torque, n):
    return np.column_stack([np.full(n, torque), np.zeros(n)])


def test_a_frictionless_pendulum_keeps_its_energy():
    joint = JointSimulation(name="j", law=FREE, motor_inertia=0.4, load_inertia=1.2, gravity_cos=30.0)
    states = advance(joint, [1.0, 0.0, 1.0, 0.0, 0.0], 0.0, 5e-4, 8000)
    energy = 0.5 * 1.6 * states[:, 1] ** 2 + 30.0 * np.sin(states[:, 0])
    assert np.ptp(states[:, 0]) > 4.0
    assert np.abs(energy - 30.0 * np.sin(1.0)).max() < 2e-4


def test_two_masses_swing_at_their_own_frequency_and_keep_their_energy():
    M, L, K = 0.3, 1.3, 1e4
    joint = JointSimulation(name="j", law=FREE, motor_inertia=M, load_inertia=L, stiffness=K)
    h = 1e-5
    p, w, q, v, _ = advance(joint, [L / (M + L) * 1e-3, 0, -M / (M + L) * 1e-3, 0, 0], 0.0, h, 20000).T
    expected = np.sqrt(K * (1 / M + 1 / L))
    t = h * np.arange(1, p.size + 1)
    assert p - q == pytest.approx(1e-3 * np.cos(expected * t), abs=1e-6)
    energy = 0.5 * (M * w**2 + L * v**2 + K * (p - q) ** 2)
    assert energy == pytest.approx(np.full(p.size, 0.5 * K * 1e-6), rel=2e-3)


def test_damping_of_the_transmission_dissipates_only():
    joint = JointSimulation(
        name="j", law=FREE, motor_inertia=0.3, load_inertia=1.3, stiffness=1e4, damping=5.0
    )
    p, w, q, v, _ = advance(joint, [1e-3, 0, -1e-3, 0, 0], 0.0, 1e-4, 20000).T
    energy = 0.5 * (0.3 * w**2 + 1.3 * v**2 + 1e4 * (p - q) ** 2)
    assert energy[-1] < 1e-6 * energy[0]
    assert 0.3 * w + 1.3 * v == pytest.approx(np.zeros(p.size), abs=1e-12)  # momentum stays


def test_a_held_mass_rests_exactly():
    joint = JointSimulation(name="j", law=DRY, motor_inertia=0.3, load_inertia=1.3, gravity_cos=5.0)
    start = joint.at_rest(0.2)
    states = advance(joint, start, 0.0, 5e-4, 2000)
    assert np.all(states[:, :4] == start[:4])
    noisy = joint.replace(torque_noise=0.3, gravity_cos=0.0)
    out, _ = drive(noisy, constant(4.0, 500), closed=False, seed=3)
    assert np.all(out[:, 0] == 0.0)
    assert np.all(out[:, 2:] == 0.0)


@pytest.mark.parametrize(("u", "breaks"), [(8.999, False), (9.001, True), (-5.999, False), (-6.001, True)])
def test_it_breaks_away_at_the_coulomb_torque_of_the_direction(u, breaks):
    joint = JointSimulation(name="j", law=DRY, motor_inertia=1.6)
    out, _ = drive(joint, constant(u, 200), closed=False)
    assert (out[-1, 2] != 0.0) == breaks
    assert out[-1, 2] * u >= 0.0


def test_a_sliding_mass_stops_where_it_must_and_does_not_chatter():
    joint = JointSimulation(name="j", law=DRY, motor_inertia=1.5)
    states = advance(joint, [0.0, 2.0, 0.0, 2.0, 0.0], 0.0, 1e-4, 6000)
    stops = 2.0 / (9.0 / 1.5)
    after = states[int(stops / 1e-4) + 2 :]
    assert after[:, 0] == pytest.approx(2.0**2 / (2 * 9.0 / 1.5), rel=1e-6)
    assert np.all(after[:, 1] == 0.0)
    assert np.all(after[:, 0] == after[0, 0])


def test_terminal_velocity_under_viscous_friction():
    law = Law(
        rate=CoulombViscous(
            coulomb_positive=3.0, coulomb_negative=2.0, viscous_positive=4.0, viscous_negative=5.0
        )
    )
    joint = JointSimulation(name="j", law=law, motor_inertia=0.5)
    for u, expected in ((7.0, 1.0), (-7.0, -1.0)):
        out, _ = drive(joint, constant(u, 5000), closed=False)
        assert out[-1, 2] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("stiffness", [np.inf, 1e5])
def test_friction_grows_with_the_transmitted_load(stiffness):
    """The bound is F + mu g, where the transmission carries gravity g."""
    joint = JointSimulation(
        name="j",
        law=DRY,
        motor_inertia=0.3,
        load_inertia=1.3,
        stiffness=stiffness,
        gravity_cos=40.0,
        load_dependence=0.1,
    )
    start = joint.at_rest(0.0)
    bound = 9.0 + 0.1 * 40.0
    for u, breaks in ((40.0 + bound - 1e-2, False), (40.0 + bound + 1e-2, True)):
        assert (advance(joint, start, u, 1e-4, 200)[-1, 1] > 0.0) == breaks


def test_friction_on_the_load_lets_the_encoder_see_the_transmission_yield():
    joint = JointSimulation(
        name="j",
        law=DRY,
        motor_inertia=0.06,
        load_inertia=0.65,
        stiffness=1e4,
        damping=20.0,
        friction_side="load",
    )
    states = advance(joint, joint.at_rest(0.0), 5.0, 1e-4, 4000)
    assert states[-1, 0] == pytest.approx(5.0 / 1e4, rel=1e-6)
    assert np.all(states[:, 2] == 0.0)
    on_motor = advance(joint.replace(friction_side="motor"), joint.at_rest(0.0), 5.0, 1e-4, 100)
    assert np.all(on_motor[:, 0] == 0.0)


@pytest.mark.parametrize("delay", [0.0, 0.3e-3, 1e-3, 2.5e-3])
def test_the_torque_comes_late_by_the_delay(delay):
    joint = JointSimulation(name="j", law=FREE, motor_inertia=2.0, delay=delay)
    target = constant(0.0, 40)
    target[10:] = 6.0, 0.0
    out, _ = drive(joint, target, closed=False)
    t = 1e-3 * np.arange(40)
    expected = 6.0 / 2.0 * np.maximum(0.0, t - 0.010 - delay)
    assert out[:, 2] == pytest.approx(expected, abs=1e-12)


def test_the_log_holds_what_a_robot_would_record():
    plan = Sweep(np.deg2rad(20), 2.0, 3)
    joint = joint_1().replace(torque_limit=40.0)
    log = simulate(joint, plan, seed=1)
    count = joint.encoder_count
    assert log.position / count == pytest.approx(np.round(log.position / count), abs=1e-4)
    assert np.abs(log.torque).max() == 40.0
    assert log.reference[:, 0] == pytest.approx(plan.position(log.time))
    assert log.plan is plan
    assert log.drive.law == "position"
    assert log.drive.gains["proportional"] == joint.servo.proportional
    assert log.joints[0].encoder_counts == pytest.approx(1 / count)
    assert log.sources == ()
    again = simulate(joint, plan, seed=1)
    assert np.all(again.torque == log.torque)
    assert np.any(simulate(joint, plan, seed=2).torque != log.torque)


def test_a_torque_plan_goes_straight_to_the_actuator():
    plan = TorqueRamp(3.0, 5.0, 1)
    log = simulate(joint_1().replace(servo=None, gravity_cos=0.0), plan)
    assert log.torque[:, 0] == pytest.approx(plan.torque(log.time))
    assert log.reference is None
    assert log.drive.law == "torque"
    assert np.all(log.position == 0.0)


def test_a_plan_that_begins_later_is_recorded_from_the_start_of_the_clock():
    plan = Sweep(np.deg2rad(20), 2.0, 2, start=1.5)
    log = simulate(joint_1(), plan)
    assert log.time[0] == 0.0
    assert log.time[-1] == pytest.approx(1.5 + plan.duration, abs=1e-3)
    early = log.between(0.0, 1.4)
    assert np.ptp(early.position) < 1e-5  # the servo holds it against gravity from the first tick on


def test_the_servo_tracks():
    log = simulate(joint_1(compliant=True), Sweep(np.deg2rad(20), 2.0, 5), seed=0)
    assert np.abs(log.position - log.reference).max() < 3e-3


def test_the_servo_does_not_wind_up():
    joint = joint_1().replace(torque_limit=12.0, gravity_cos=0.0, torque_noise=0.0)
    target = np.zeros((2500, 2))
    target[:1500, 0] = np.minimum(1.0, np.arange(1500) / 200)  # faster than the torque allows
    target[1500:, 0] = 1.0
    out, _ = drive(joint, target, closed=True)
    assert np.abs(out[:, 1]).max() == 12.0
    assert out[:, 0].max() < 1.25


@pytest.mark.parametrize("compliant", [False, True])
def test_halving_the_step_changes_next_to_nothing(compliant):
    joint = joint_1(compliant=compliant).replace(torque_noise=0.0, encoder_count=0.0)
    plan = Sweep(np.deg2rad(20), 2.0, 4)
    step = longest_step(joint)
    logs = [simulate(joint, plan, substep=h) for h in (step, step / 2, step / 16)]
    coarse, fine = (np.sqrt(np.mean((log.position - logs[2].position) ** 2)) for log in logs[:2])
    assert coarse < 2e-6
    assert fine < 0.75 * coarse
    assert np.sqrt(np.mean((logs[0].torque - logs[1].torque) ** 2)) < 2e-2


@pytest.mark.parametrize("compliant", [False, True])
def test_the_loop_is_the_same_without_the_compiler(compliant):
    joint = joint_1(compliant=compliant)
    target = np.zeros((25, 2))
    target[:, 0] = 1e-3 * np.arange(25) ** 2 * 1e-2
    scene = Scene(
        plant=joint, motion=still(25), controller=joint.servo, target=target, gravity_compensated=False, substep=5e-4
    )  # fmt: skip
    results = []
    known = kernel_of((scene, prepare(scene)[0]))
    for loop in (known, getattr(known, "py_func", known)):
        arguments, _ = prepare(scene.replace(seed=1))
        loop(*arguments)
        results.append((arguments[-1], arguments[4]))
    for compiled, plain in zip(*results, strict=True):
        assert compiled == pytest.approx(plain, rel=1e-12, abs=1e-15)
    assert np.any(results[0][0][:, COLUMNS.index("motor_velocity")] != 0.0)


def test_an_advance_is_the_same_without_the_compiler():
    joint = joint_1(compliant=True).replace(load_dependence=0.05, friction_side="load")
    states = []
    known = kernels.of_kinds(plant.advance, joint.law.rate.KIND, joint.law.element.KIND)
    for step in (known, getattr(known, "py_func", known)):
        s = np.array([0.1, 1.0, 0.1, 0.5, 3.0])
        for _ in range(20):
            step(joint.row(), s, 1, 0, joint.law.row(), np.zeros(2), 20.0, 1e-4, 20.0)
        states.append(s)
    assert states[0] == pytest.approx(states[1], rel=1e-12)


def test_machines_of_the_thesis():
    counts = {"setup_a": 5e-6, "joint_0": 9.587e-7, "joint_1": 4.280e-7, "joint_2": 7.990e-7}
    coulomb = {"setup_a": 12.0, "joint_0": 6.85, "joint_1": 9.56, "joint_2": 3.15}
    growth = {"setup_a": 40.0, "joint_0": 5.0, "joint_1": 7.0, "joint_2": 2.5}
    limit = {"joint_0": 95.1, "joint_1": 213.1, "joint_2": 114.1}
    for name in MACHINES:
        joint = machine(name)
        assert joint.encoder_count == pytest.approx(counts[name], rel=1e-3)
        assert joint.law.torque(1e-12) == pytest.approx(coulomb[name], rel=1e-9)
        assert joint.law.torque(2.0) - joint.law.torque(1e-12) == pytest.approx(growth[name], rel=1e-9)
        assert joint.torque_limit == limit.get(name, 600.0)
    assert machine("joint_1").inertia == pytest.approx(1.6)
    assert machine("setup_a").law.torque(-1e-12) == pytest.approx(-8.0)
    with pytest.raises(UnknownName, match="joint_0, joint_1, joint_2"):
        machine("joint_9")


def test_the_bent_curve_bends():
    law = bent_curve(9.56, 7.0)
    low, high = (np.diff(law.torque(np.array(pair)))[0] for pair in ((0.1, 0.2), (1.8, 1.9)))
    assert 0.0 < high < 0.3 * low
    dips = bent_curve(9.56, 7.0, stribeck=2.0)
    assert dips.torque(0.1) < dips.torque(1e-9) == pytest.approx(11.56)


@pytest.mark.parametrize(
    "change",
    [
        {"motor_inertia": 0.0},
        {"load_inertia": -1.0},
        {"stiffness": -5.0},
        {"stiffness": 1e5, "load_inertia": 0.0},
        {"torque_noise": np.nan},
        {"gravity_cos": np.inf},
        {"friction_side": "both"},
        {"unit": "deg"},
        {"delay": -1e-3},
    ],
)
def test_bad_values_are_named(change):
    with pytest.raises(InvalidInput, match="JointSimulation 'joint_1'"):
        joint_1().replace(**change)


def test_bad_runs_are_refused():
    plan = Sweep(0.3, 2.0, 2)
    with pytest.raises(InvalidInput, match="no servo"):
        simulate(joint_1().replace(servo=None), plan)
    for bad in ({"rate": 0.0}, {"substep": -1.0}, {"rate": np.nan}):
        with pytest.raises(InvalidInput, match="positive"):
            simulate(joint_1(), plan, **bad)
    with pytest.raises(InvalidInput, match="derivative"):
        Servo(proportional=1.0, derivative=-1.0)
