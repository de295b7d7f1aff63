import numpy as np
import pytest

from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.identification.function_a import function_a
from backdrive.identification.regression import long_run
from backdrive.identification.signals import prepare
from backdrive.identification.sweep import find_windows, identify_sweep, sweep_knots, to_polyline
from backdrive.identification.sweep_equations import equations
from backdrive.identification.sweep_knots import SweepKnots, polyline_through, sort_knots
from backdrive.identification.sweep_windows import Windows, turning_points, windows
from backdrive.laws import CoulombViscous, Law, Polyline
from backdrive.logs.log import Joint, Log
from backdrive.plans import InTurn, Sweep, inertia_bias
from backdrive.simulation.machines import joint_1, setup_a
from backdrive.simulation.open_loop import drive, simulate

A, V = np.deg2rad(20), 2.0
PLAN = Sweep(A, V, 6)
LINE = Law(
    rate=CoulombViscous(
        coulomb_positive=9.0, coulomb_negative=9.0, viscous_positive=3.0, viscous_negative=3.0
    )
)


@pytest.fixture(scope="module")
def log():
    return simulate(joint_1(), PLAN, seed=4)


def made(plan=PLAN, *, rate=1000.0, inertia=1.6, friction=LINE, late=0.0, gravity=0.0, pause=0.0):
    """Return a noiseless log in closed form: the torque of a sample is that of an instant `late` after it."""
    t = np.arange(0.0, plan.start + plan.duration + pause, 1.0 / rate)
    torque = inertia * plan.acceleration(t + late) + friction.torque(plan.velocity(t + late))
    torque += gravity * np.cos(plan.position(t + late))
    return Log(time=t, joints=(Joint(name="a"),), position=plan.position(t), torque=torque, plan=plan)


# FunctionA


def test_function_a_on_a_handful_of_samples():
    time = np.arange(10.0)
    velocity = np.array([0.0, 0.9, 1.0, -0.8, -1.0, 0.5, 1.7, 2.0, -1.6, -1.5])
    torque = np.array([9.0, 5.0, 7.0, -4.0, -6.0, 9.0, 8.0, 10.0, -7.0, 9.0])
    V_n, F_n = function_a(time, velocity, torque, np.array([[0.0, 5.0], [5.0, 10.0]]), 2.0)
    # n = 1: peak 1, v >= 0.8: samples 1, 2; v <= -0.8: samples 3, 4. n = 2: peak 2, 1.6: samples 6, 7; 8
    assert pytest.approx([0.95, 1.85]) == V_n
    assert pytest.approx([(6.0 + 5.0) / 2, (9.0 + 7.0) / 2]) == F_n


def test_function_a_belongs_to_half_open_windows_and_admits_empty_sets():
    time = np.array([0.0, 1.0, 2.0])
    V_n, F_n = function_a(time, np.ones(3), np.ones(3), np.array([[0.0, 1.0], [5.0, 6.0]]), 1.0)
    assert np.all(np.isnan(F_n))
    assert V_n[0] == 1.0
    assert np.isnan(V_n[1])
    with pytest.raises(InvalidInput, match="share of the peak"):
        function_a(time, time, time, np.array([[0.0, 1.0]]), 1.0, c=1.0)
    with pytest.raises(InvalidInput, match="Shapes"):
        function_a(time, time[:2], time, np.array([[0.0, 1.0]]), 1.0)


def test_the_literal_pairs_are_function_a_of_the_backward_difference(log):
    p, f = log.position[:, 0], log.torque[:, 0]
    v = np.concatenate([[0.0], np.diff(p)]) * 1000.0
    expected = function_a(log.time, v, f, PLAN.windows(), V)
    knots = sweep_knots(log, 0, literal=True)
    assert knots.V_pos == pytest.approx(expected[0], rel=1e-9)
    assert pytest.approx(expected[1], rel=1e-9) == knots.F
    assert np.all(np.isnan(knots.error))


def test_the_mean_speed_of_a_window_is_below_its_peak():
    # mean of a sine above 0.8 of its peak: 0.6 / asin(0.6) = 0.9324
    knots = sweep_knots(made(), 0)
    assert knots.V / PLAN.speeds == pytest.approx(0.6 / np.arcsin(0.6), rel=2e-3)


@pytest.mark.parametrize("stroke", [10.0, 20.0, 50.0])
def test_the_literal_error_is_what_a_slip_of_one_sample_makes(stroke):
    plan = Sweep(np.deg2rad(stroke), V, 6)
    rate, late = 20000.0, 1e-3  # so fine that a window's edges hardly matter
    expected = inertia_bias(
        plan.stroke, V, 1.6, late + 0.5 / rate
    )  # a backward difference is half a sample old
    fine = made(plan, rate=rate, late=late)
    knots = sweep_knots(fine, 0, literal=True)
    assert (knots.F - LINE.torque(knots.V))[-1] == pytest.approx(expected, abs=0.02)


def test_alignment_removes_the_error_of_the_commanded_torque():
    late = made(late=0.5e-3)  # a command is centered half a sample after its instant
    knots = sweep_knots(late, 0)
    assert pytest.approx(LINE.torque(knots.V), abs=2e-3) == knots.F
    literal = sweep_knots(late, 0, literal=True)
    assert np.abs(literal.F - LINE.torque(literal.V)).max() > 0.2
    delayed = sweep_knots(made(late=2.5e-3), 0, delay=2e-3)
    assert pytest.approx(LINE.torque(delayed.V), abs=2e-3) == delayed.F


def test_inertia_and_the_slope_of_gravity_are_found_inside_the_windows():
    plan = Sweep(A, V, 6, center=0.7)
    knots = sweep_knots(made(plan, gravity=30.0, late=0.5e-3), 0)
    assert knots.inertia[0] == pytest.approx(1.6, rel=1e-3)
    assert knots.slope[0] == pytest.approx(-30.0 * np.sin(0.7), rel=1e-3)
    assert knots.center == pytest.approx(0.7, abs=1e-3)
    assert knots.bias == pytest.approx(30.0 * np.cos(0.7) * knots.level, rel=1e-4)
    assert pytest.approx(LINE.torque(knots.V), abs=3e-3) == knots.F


def test_the_bend_of_the_curve_is_taken_out():
    v = np.linspace(0.0, 2.2, 200)
    bent = Law(
        rate=Polyline(velocity=tuple(v), positive=tuple(9 + 4 * v - v**2), negative=tuple(9 + 4 * v - v**2))
    )
    knots = sweep_knots(made(friction=bent, late=0.5e-3), 0)
    off = knots.F - (9 + 4 * knots.V - knots.V**2)
    assert np.abs(off).max() < 3e-3
    spread = np.var(2.0 * np.cos(np.linspace(-np.arcsin(0.6), np.arcsin(0.6), 1001)))
    assert spread > 8e-3  # what would have been left: half of f'' = -2 times this


def test_both_directions_have_their_own_velocity():
    slow = Law(rate=CoulombViscous(coulomb_positive=9.0, coulomb_negative=6.0, viscous_negative=2.0))
    knots = sweep_knots(made(friction=slow, late=0.5e-3), 0)
    assert knots.F_pos == pytest.approx(np.full(6, 9.0), abs=2e-3)
    assert knots.F_neg == pytest.approx(6.0 + 2.0 * knots.V_neg, abs=2e-3)
    law = to_polyline(knots, symmetric=False, constant=0.0)
    assert law.positive == pytest.approx([9.0] * 6, abs=2e-3)
    shifted = to_polyline(knots, symmetric=False, constant=1.0)
    assert shifted.positive == pytest.approx([8.0] * 6, abs=2e-3)
    assert np.array(shifted.negative) - law.negative == pytest.approx(np.ones(6))


def test_cycles_that_do_not_reach_their_speed_are_left_out_by_name():
    target = np.zeros((int(PLAN.duration * 1000), 2))
    t = 1e-3 * np.arange(len(target))
    slow = np.where(
        PLAN.velocity(t) > 1.2, 1.2, PLAN.velocity(t)
    )  # the fast cycles never reach 0.8 of their peak
    log = made()
    log = log.replace(position=np.cumsum(np.concatenate([slow, np.zeros(len(log) - t.size)])) * 1e-3)
    knots = sweep_knots(log, 0)
    assert knots.V.size == 4
    assert any("5 (1.67), 6 (2)" in w for w in knots.warnings)


def test_a_sweep_that_hardly_reaches_any_speed_is_refused():
    knots = pairs([np.nan, 1.0, np.nan], [np.nan, 3.0, np.nan])
    cycles = Windows(time=np.zeros((3, 2)), peak=np.arange(3.0), from_plan=True)
    with pytest.raises(NotIdentifiable, match="1 of 3 cycles reach their speed"):
        sort_knots(knots, "a", cycles, 0.8)


def pairs(V_pos, F_pos, count=10, **changes):
    n = len(V_pos)
    arrays = {"V_pos": V_pos, "V_neg": V_pos, "F_pos": F_pos, "F_neg": F_pos}
    arrays = {k: np.array(v, dtype=float) for k, v in arrays.items()} | {
        "error_pos": np.full(n, 0.1),
        "error_neg": np.full(n, 0.1),
        "count_pos": np.full(n, count),
        "count_neg": np.full(n, count),
    }
    return SweepKnots(**(arrays | changes))


def test_pairs_are_sorted_and_neighbours_merged():
    knots = pairs([1.0, 0.5, 1.001, 2.0], [4.0, 2.0, 6.0, 9.0], count_pos=np.array([10, 10, 30, 10]))
    cycles = Windows(time=np.zeros((4, 2)), peak=np.arange(4.0), from_plan=True)
    result = sort_knots(knots, "a", cycles, 0.8)
    assert np.all(np.diff(result.V) > 0)
    assert result.F_pos == pytest.approx([2.0, (10 * 4 + 30 * 6) / 40, 9.0])
    assert result.F_neg == pytest.approx([2.0, 5.0, 9.0])
    assert result.count_pos.tolist() == [10, 40, 10]
    assert "1 pairs of nearly equal speed were merged" in result.warnings[0]


def test_the_intercept_is_not_negative():
    law = polyline_through(np.array([1.0, 2.0]), np.array([1.0, 3.0]), np.array([2.0, 3.0]))
    assert law.velocity == (0.0, 1.0, 2.0)
    assert law.positive == (0.0, 1.0, 3.0)
    assert law.negative == pytest.approx((1.0, 2.0, 3.0))
    assert Law(rate=law).torque(0.5) == pytest.approx(0.5)
    kept = polyline_through(np.array([1.0, 2.0]), np.array([2.0, 3.0]), np.array([2.0, 3.0]))
    assert kept.velocity == (1.0, 2.0)


# standard errors


def test_long_run_covariance_is_bartletts():
    z = np.random.default_rng(1).standard_normal((2, 50)).cumsum(axis=1) * 0.3
    lags = int(np.sqrt(50))
    expected = z @ z.T
    for lag in range(1, lags + 1):
        product = z[:, lag:] @ z[:, :-lag].T
        expected += (1 - lag / (lags + 1)) * (product + product.T)
    assert long_run(z) == pytest.approx(expected, rel=1e-12)


def test_standard_errors_say_how_far_off_the_knots_are():
    joint = joint_1().replace(law=LINE, torque_noise=0.4)
    z = []
    for seed in range(12):
        knots = sweep_knots(simulate(joint, PLAN, seed=seed), 0)
        z.append((knots.F - LINE.torque(knots.V)) / knots.error)
    assert 0.6 < np.sqrt(np.mean(np.square(z))) < 1.7


# windows


@pytest.mark.parametrize("smooth", [True, False])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_windows_are_found_without_a_plan(smooth, sign):
    plan = Sweep(A, V, 8, smooth=smooth, start=0.7)
    log = simulate(joint_1(), plan, seed=2)
    log = log.replace(plan=None, position=sign * log.position, torque=sign * log.torque)
    found = find_windows(log, 0)
    assert found == pytest.approx(plan.windows(), abs=0.1)
    unknown = sweep_knots(log, 0)
    known = sweep_knots(log.replace(plan=plan), 0) if sign > 0 else None
    if known is not None:
        assert pytest.approx(known.F, abs=0.01) == unknown.F
        assert pytest.approx(known.V, rel=0.01) == unknown.V


def test_windows_survive_noise_dwell_approach_and_what_follows():
    plan = Sweep(A, V, 5)
    t = np.arange(0.0, plan.duration, 1e-3)
    q = plan.position(t)
    edges = np.searchsorted(t, plan.windows()[:, 1])
    pieces, last = [np.linspace(-1.5, q[0], 1500), np.full(400, q[0])], 0
    for e in edges:  # rest of varying length at every turn
        pieces += [q[last:e], np.full(50 + 40 * (e % 7), q[min(e, q.size - 1)])]
        last = e
    pieces += [q[last:], np.linspace(q[-1], 0.8, 900), np.linspace(0.8, 0.2, 700)]
    position = np.concatenate(pieces)
    position += 2e-4 * np.random.default_rng(0).standard_normal(position.size)
    log = Log(
        time=1.7e9 + 1e-3 * np.arange(position.size),
        joints=(Joint(name="a"),),
        position=position,
        torque=np.zeros(position.size),
    )
    found = find_windows(log, 0)
    assert len(found) == 5
    speed = np.abs(np.gradient(position, 1e-3))
    for n, (a, b) in enumerate(found, start=1):
        inside = (log.time >= a) & (log.time < b)
        assert np.quantile(speed[inside], 0.9) > 0.5 * n * V / 5
        assert np.ptp(position[inside]) == pytest.approx(A, rel=0.02)


def test_other_motions_are_no_sweep():
    t = np.arange(0.0, 12.0, 1e-3)
    motions = {
        "chirp of one speed": np.sin(2 * np.pi * (0.2 * t + 0.06 * t**2)) / (0.2 + 0.12 * t),
        "one frequency": np.sin(4.0 * t),
        "saw-tooth of growing speed": 0.3 * np.abs(np.mod(0.2 * t + 0.03 * t**2, 2.0) - 1.0),
        "many frequencies": sum(np.sin(0.7 * k * t + k**2) / k for k in range(1, 8)),
        "ramp": 0.1 * t,
        "rest": np.zeros_like(t),
    }
    for name, q in motions.items():
        log = Log(time=t, joints=(Joint(name="a"),), position=q, torque=np.zeros_like(t))
        with pytest.raises(NotIdentifiable, match="equal stroke and growing speed"):
            pytest.fail(f"{name}: {find_windows(log, 0)}")


def test_a_plan_that_was_not_followed_is_not_believed(log):
    other = Sweep(A, 1.0, 9, center=0.5)
    cycles = windows(log, 0, other, prepare(log, 0))
    assert not cycles.from_plan
    assert cycles.time == pytest.approx(PLAN.windows(), abs=0.1)
    knots = sweep_knots(log.replace(plan=other), 0)
    assert any("did not follow the plan" in w for w in knots.warnings)


def test_a_plan_may_begin_at_the_log_s_first_instant(log):
    late = log.replace(time=log.time + 1.7e9)
    cycles = windows(late, 0, PLAN, prepare(late, 0))
    assert cycles.from_plan
    assert pytest.approx(sweep_knots(log, 0).F, abs=0.01) == sweep_knots(late, 0).F


def test_turning_points_are_extremes_a_stroke_apart():
    x = np.array([0.0, 0.1, 0.05, 1.0, 0.9, 1.1, 0.0, 0.2, 0.1, 0.9])
    assert turning_points(x, 0.5).tolist() == [0, 5, 6, 9]
    assert turning_points(np.zeros(5), 0.5).size == 0


def test_joints_moved_in_turn_each_have_their_sweep():
    first, second = joint_1(), joint_1().replace(name="other", law=LINE, gravity_cos=0.0)
    plans = InTurn((Sweep(A, V, 4, joint="joint_1"), Sweep(A, V, 4, joint="other")), pause=0.3)
    t = np.arange(0.0, plans.plans[-1].start + plans.plans[-1].duration, 1e-3)
    columns = []
    for joint, plan in zip((first, second), plans.plans, strict=True):
        target = np.column_stack([plan.position(t), plan.velocity(t)])
        columns.append(drive(joint, target, closed=True)[0])
    log = Log(
        time=t,
        joints=(first.as_joint(), second.as_joint()),
        position=np.column_stack([c[:, 0] for c in columns]),
        torque=np.column_stack([c[:, 1] for c in columns]),
        plan=plans,
    )
    for joint in (first, second):
        knots = sweep_knots(log, joint.name)
        assert pytest.approx(joint.law.torque(knots.V), abs=0.03) == knots.F
        assert not knots.warnings


# the whole way


def test_what_an_identification_says(log):
    friction, evidence = identify_sweep([log], "joint_1")
    assert friction.method == "sweep"
    assert friction.law.torque(1.0) == pytest.approx(joint_1().law.torque(1.0), abs=0.05)
    assert friction.dynamics["inertia"].value == pytest.approx(1.6, rel=2e-3)
    assert friction.dynamics["inertia"].unit == "kg.m^2"
    assert friction.dynamics["offset"].value == pytest.approx(30.0, rel=5e-3)
    assert friction.held_out is None
    assert friction.fitted.residual < 3.0
    assert friction.validity.velocity == pytest.approx((-2.0, 2.0), abs=0.05)
    assert len(friction.standard_errors["positive"]) == len(friction.law.rate.velocity) == 6
    assert evidence.samples.time.size <= 4000
    assert np.all(np.isfinite(evidence.curve.standard_error))
    assert "A constant 29.9 N.m was separated" in evidence.verdict
    assert not friction.warnings


def test_several_sweeps_judge_the_last_one_unseen():
    logs = [simulate(joint_1(), Sweep(A, V, 4), seed=seed) for seed in range(3)]
    friction, evidence = identify_sweep(logs, "joint_1")
    assert friction.held_out.samples == pytest.approx(0.78 * len(logs[2]), rel=0.05)  # where it slides
    assert friction.held_out.residual < 4.0
    seen = evidence.samples.fitted
    assert 0.6 < seen.mean() < 0.7
    assert "torque that was held out" in evidence.verdict
    alone, _ = identify_sweep(logs[:1], "joint_1")
    ratio = np.array(friction.standard_errors["positive"]) / alone.standard_errors["positive"]
    assert np.median(ratio) == pytest.approx(1 / np.sqrt(3), rel=0.25)


def test_the_literal_identification_knows_no_errors(log):
    friction, evidence = identify_sweep([log], "joint_1", literal=True)
    knots = sweep_knots(log, 0, literal=True)
    assert friction.law.rate.positive == pytest.approx(tuple(knots.F))
    assert friction.law.rate.negative == friction.law.rate.positive
    assert friction.standard_errors == {}
    assert np.all(np.isnan(evidence.curve.standard_error))


def test_one_posture_leaves_the_constant_unattributed(log):
    friction, _ = identify_sweep([log], "joint_1", symmetric=False)
    assert any("offset unattributed: 29.9 N.m" in w for w in friction.warnings)
    up, down = np.array(friction.law.rate.positive), np.array(friction.law.rate.negative)
    assert np.mean(up - down) == pytest.approx(0.0, abs=1e-9)


def test_gravity_of_a_wide_stroke_about_one_center_is_right():
    """Level and slope are those of one sine; the slope lay off by the mean of cos(q - center), here 2 %."""
    plan = Sweep(1.1, V, 8, center=0.7)
    found, _ = identify_sweep([made(plan, gravity=30.0, late=0.5e-3)], "a", timing="command")
    assert found.dynamics["gravity_cos"].value == pytest.approx(30.0, rel=2e-3)
    assert found.dynamics["gravity_sin"].value == pytest.approx(0.0, abs=0.06)
    assert "gravity holds that and any offset" in found.warnings[0]


def test_a_linear_axis_gives_the_constant_to_the_friction():
    log = simulate(setup_a(), Sweep(0.1, 0.3, 5, unit="m"), seed=0)
    friction, _ = identify_sweep([log], "setup_a")
    expected = setup_a().law.torque(np.array([0.2, -0.2]))
    assert friction.law.torque(np.array([0.2, -0.2])) == pytest.approx(expected, abs=0.1)
    assert any("is given to the friction" in w for w in friction.warnings)
    assert "offset" not in friction.dynamics
    equal, _ = identify_sweep([log], "setup_a", symmetric=True)
    assert equal.dynamics["offset"].value == pytest.approx(2.0, abs=0.05)
    assert friction.dynamics["inertia"].value == pytest.approx(10.0, rel=0.02)


def uneven():
    rate = joint_1().law.rate
    V_n = np.array(rate.velocity)
    down = tuple(np.array(rate.negative) - 2.06 - 0.3 * V_n)
    return joint_1().replace(
        law=Law(rate=Polyline(velocity=rate.velocity, positive=rate.positive, negative=down))
    )


def test_three_centers_tell_unequal_directions_from_gravity():
    joint = uneven()
    logs = [simulate(joint, Sweep(A, V, 5, center=np.deg2rad(c)), seed=i) for i, c in enumerate((-60, 0, 60))]
    friction, shown = identify_sweep(logs, "joint_1")
    V_n = np.array(friction.law.rate.velocity)
    assert friction.law.torque(V_n) == pytest.approx(joint.law.torque(V_n), abs=0.05)
    assert friction.law.torque(-V_n) == pytest.approx(joint.law.torque(-V_n), abs=0.05)
    assert friction.dynamics["gravity_cos"].value == pytest.approx(30.0, abs=0.02)
    assert friction.dynamics["gravity_sin"].value == pytest.approx(0.0, abs=0.02)
    assert "separate the constant difference of the directions from gravity" in shown.verdict
    assert not friction.warnings
    assert friction.held_out is None  # two centers do not tell the gravity at the third


@pytest.mark.parametrize(
    ("centers", "expected"),
    [((-60, 0, 60), 10.0), ((-30, 0, 30), 62.0), ((-15, 15), np.inf), ((0,), np.inf)],
)
def test_the_condition_of_telling_gravity_apart(centers, expected):
    V_n = np.linspace(0.19, 1.87, 10)
    F = np.full(10, 10.0)
    knots = [pairs(V_n, F, center=np.deg2rad(c), level=0.994) for c in centers]
    found = equations(knots).condition("own", ("gravity_sin", "gravity_cos"))
    assert found == pytest.approx(expected, rel=0.1) or (np.isinf(expected) and found > 500)


def test_bad_input_is_named(log):
    with pytest.raises(InvalidInput, match="no log"):
        identify_sweep([], "joint_1")
    with pytest.raises(InvalidInput, match="no torque"):
        identify_sweep([log.replace(torque=None)], "joint_1")
    with pytest.raises(NotIdentifiable, match="equal stroke"):
        identify_sweep([log.replace(plan=None).between(0.0, 2.0)], "joint_1")


def test_slow_cycles_see_a_peak_that_the_others_pass_over():
    """Friction 4 N.m above sliding at rest, which falls within 0.1 rad/s: a sweep from 0.33 rad/s on knows nothing of it."""
    plan = Sweep(A, V, 6, slow=4)
    assert plan.speeds == pytest.approx(V / 6 * np.r_[1 / 16, 1 / 8, 1 / 4, 1 / 2, 1:7])
    t = np.arange(0.0, plan.duration, 1e-3)
    v = plan.velocity(t)
    friction = np.sign(v) * (9.0 + 4.0 * np.exp(-((v / 0.1) ** 2))) + 3.0 * v
    log = Log(
        time=t,
        joints=(Joint(name="a"),),
        position=plan.position(t),
        torque=1.6 * plan.acceleration(t) + friction,
        plan=plan,
    )
    found, _ = identify_sweep([log], "a")
    for speed in (0.03, 0.08, 0.3, 1.0):
        expected = 9.0 + 4.0 * np.exp(-((speed / 0.1) ** 2)) + 3.0 * speed
        assert found.law.torque(speed) == pytest.approx(expected, rel=0.06)
    assert np.abs(plan.acceleration(t)).max() < plan.peak_acceleration * (1.0 + 1e-9)
    with pytest.raises(InvalidInput, match=r"Sweep\.slow is 9"):
        Sweep(A, V, 6, slow=9)
