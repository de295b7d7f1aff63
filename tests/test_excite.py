"""Tests for excite/ and limits.py: motions in closed form, their limits, and the plan file."""

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from backdrive.errors import (
    BackdriveError,
    ForbiddenContent,
    InvalidInput,
    MissingExtra,
    ReadError,
    UnknownFormat,
    UnknownName,
)
from backdrive.plans import (
    PLANS,
    ConstantVelocity,
    Hold,
    InTurn,
    Multisine,
    SawtoothTorque,
    SineTorque,
    Sweep,
    TorqueRamp,
    check_limits,
    inertia_bias,
    load_plan,
    plan_from_dict,
    plan_of,
    plan_to_dict,
    save_plan,
    smallest_stroke,
    stroke_for_bias,
)
from backdrive.plans.limits import JointLimits, read_limits
from backdrive.plans.tables import csv_text, npz_bytes, sample, trajectory_yaml, yaml_number

DEG = math.pi / 180
SWEEP = Sweep(20 * DEG, 2.0, 10, center=0.4, start=1.5, joint="j1")
MOTIONS = {
    "sweep": SWEEP,
    "sweep of one cycle": Sweep(0.2, 1.0, 1),
    "sweep of two cycles": Sweep(0.2, 0.5, 2, start=-3.0),
    "linear sweep": Sweep(0.3, 0.4, 5, unit="m", lead_in=4.0),
    "constant velocity": ConstantVelocity(0.7, (0.05, 0.4, 1.0), center=-1.0, start=2.0),
    "constant velocity without rest": ConstantVelocity(0.7, (0.3,), pause=0.0),
    "multisine": Multisine(0.5, 0.2, 3.0, 5.0, center=0.1, start=0.7),
}
TORQUES = {
    "sine": SineTorque(3.0, 0.7, 4, offset=1.0, start=0.5),
    "saw-tooth": SawtoothTorque(3.0, 0.7, 4, rise=0.8, offset=-1.0, start=0.5),
    "ramp": TorqueRamp(8.0, 2.0, 2, offset=0.5, start=0.5),
}
motions = pytest.mark.parametrize("plan", MOTIONS.values(), ids=MOTIONS.keys())
torques = pytest.mark.parametrize("plan", TORQUES.values(), ids=TORQUES.keys())


def grid(plan, n: int, margin: float = 0.3) -> np.ndarray:
    return np.linspace(plan.start - margin, plan.start + plan.duration + margin, n)


def largest_jump(f, begin: float, end: float) -> float:
    """Zoom into the steepest place: a continuous function becomes flat there, a jump stays."""
    for _ in range(4):
        t = np.linspace(begin, end, 20001)
        steps = np.abs(np.diff(f(t)))
        i = int(np.argmax(steps))
        begin, end = t[i], t[i + 1]
    return float(steps[i])


# ---------------------------------------------------------------------------------------------- motions


@motions
def test_velocity_and_acceleration_are_the_derivatives(plan):
    t, h = grid(plan, 20011), 2e-5
    velocity = (plan.position(t + h) - plan.position(t - h)) / (2 * h)
    acceleration = (plan.velocity(t + h) - plan.velocity(t - h)) / (2 * h)
    np.testing.assert_allclose(plan.velocity(t), velocity, atol=1e-5 * plan.peak_velocity)
    np.testing.assert_allclose(plan.acceleration(t), acceleration, atol=3e-3 * plan.peak_acceleration)


@motions
def test_nothing_jumps(plan):
    begin, end = plan.start - 0.1, plan.start + plan.duration + 0.1
    assert largest_jump(plan.position, begin, end) < 1e-9
    assert largest_jump(plan.velocity, begin, end) < 1e-9
    assert largest_jump(plan.acceleration, begin, end) < 1e-6 * plan.peak_acceleration


@motions
def test_it_begins_and_ends_at_rest_at_home(plan):
    for t in (plan.start - 5.0, plan.start, plan.start + plan.duration, plan.start + plan.duration + 5.0):
        assert plan.position(t) == pytest.approx(plan.home, abs=1e-12)
        assert plan.velocity(t) == pytest.approx(0.0, abs=1e-9)
        assert plan.acceleration(t) == pytest.approx(0.0, abs=1e-6)


@motions
def test_range_and_peaks_are_what_is_said(plan):
    t = grid(plan, 200_001)
    low, high = plan.position_range
    q, v, a = plan.position(t), np.abs(plan.velocity(t)), np.abs(plan.acceleration(t))
    slack = 1e-3 * plan.stroke
    assert low - 1e-12 <= q.min() < low + slack
    assert high - slack < q.max() <= high + 1e-12
    assert 0.995 * plan.peak_velocity < v.max() <= plan.peak_velocity * (1 + 1e-9)
    assert 0.995 * plan.peak_acceleration < a.max() <= plan.peak_acceleration * (1 + 1e-9)


@motions
def test_shapes_follow_the_time(plan):
    t = np.linspace(0, 5, 6).reshape(2, 3)
    for f in (plan.position, plan.velocity, plan.acceleration):
        assert f(t).shape == (2, 3)
        assert np.ndim(f(1.0)) == 0
        np.testing.assert_array_equal(f(t)[1, 0], f(t[1, 0]))
        with pytest.raises(InvalidInput, match="NaN"):
            f([0.0, math.nan])


# ------------------------------------------------------------------------------------------------ sweep


def literal(t: float, stroke: float, top_speed: float, cycles: int) -> tuple[float, float]:
    """(2.2)-(2.4), read off the page."""
    turn = 0.0
    for n in range(1, cycles + 1):
        duration = math.pi * stroke * cycles / (n * top_speed)
        if turn <= t < turn + duration:
            phase = 2 * n * top_speed / (stroke * cycles) * (t - turn)
            return stroke / 2 * (1 - math.cos(phase)), n * top_speed / cycles * math.sin(phase)
        turn += duration
    return 0.0, 0.0


def test_the_literal_sweep_is_the_printed_one():
    plan = Sweep(20 * DEG, 2.0, 10, center=10 * DEG, smooth=False)
    times = np.linspace(-0.5, 16.5, 3001)
    expected = np.array([literal(t, 20 * DEG, 2.0, 10) for t in times])
    np.testing.assert_allclose(plan.position(times), expected[:, 0], atol=1e-12)
    np.testing.assert_allclose(plan.velocity(times), expected[:, 1], atol=1e-12)


def test_the_duration_of_the_literal_sweep_is_that_of_the_thesis():
    plan = Sweep(20 * DEG, 2.0, 10, smooth=False)
    assert plan.duration == pytest.approx(16.06, abs=0.005)
    expected = math.pi * 20 * DEG * 10 / 2.0 * sum(1 / j for j in range(1, 11))
    assert plan.duration == pytest.approx(expected, rel=1e-12)
    assert replace(plan, lead_in=2.0).duration == pytest.approx(expected + 2.0, rel=1e-12)


def test_the_literal_sweep_jumps_in_acceleration():
    plan = Sweep(20 * DEG, 2.0, 10, smooth=False)
    turn = plan.windows()[4, 1]
    expected = 2 * 2.0**2 / (20 * DEG * 100) * (6**2 - 5**2)
    assert largest_jump(plan.acceleration, turn - 0.01, turn + 0.01) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("cycles", [1, 2, 3, 5, 10, 40, 200])
def test_no_smooth_sweep_exceeds_the_acceleration_of_its_last_cycle(cycles):
    plan = Sweep(0.5, 1.5, cycles)
    expected = 2 * 1.5**2 / 0.5
    assert plan.peak_acceleration == expected
    edges = plan.windows()[:, 0]
    t = np.concatenate([np.linspace(e - 1, e + 1, 4001) for e in edges[:: max(1, cycles // 20)]])
    for lead_in in (None, min(math.pi / plan.frequencies[0], 1.5 * 0.5 / 1.5)):
        a = np.abs(replace(plan, lead_in=lead_in).acceleration(np.concatenate([t, grid(plan, 100_001)])))
        assert expected * (1 - 1e-4) < a.max() <= expected * (1 + 1e-9)


@pytest.mark.parametrize("plan", [SWEEP, Sweep(0.2, 0.5, 2), Sweep(0.3, 1.0, 25)])
def test_windows_hold_one_cycle_each_between_turning_points(plan):
    windows = plan.windows()
    assert windows.shape == (plan.cycles, 2)
    np.testing.assert_allclose(windows[1:, 0], windows[:-1, 1])
    np.testing.assert_allclose(plan.position(windows), plan.center - plan.stroke / 2, atol=1e-12)
    np.testing.assert_allclose(plan.velocity(windows), 0.0, atol=1e-12)
    assert windows[0, 0] == pytest.approx(plan.start + plan.lead_in)


@pytest.mark.parametrize("plan", [SWEEP, Sweep(0.2, 0.5, 2), Sweep(0.3, 1.0, 25)])
def test_samples_near_the_peaks_are_of_the_sine_itself(plan):
    """Where |v| >= 0.5 n V/N inside a window, position and acceleration are those of (2.2) with this n."""
    for n, (begin, end) in enumerate(plan.windows(), start=1):
        top, w = n * plan.top_speed / plan.cycles, 2 * n * plan.top_speed / (plan.stroke * plan.cycles)
        t = np.linspace(begin, end, 4001)
        v, x, a = plan.velocity(t), plan.position(t) - plan.center, plan.acceleration(t)
        near = np.abs(v) >= 0.5001 * top
        assert near[v > 0].any()
        assert near[v < 0].any()
        np.testing.assert_allclose(np.hypot(v, w * x)[near], top, rtol=1e-9)
        np.testing.assert_allclose(a[near], -(w**2) * x[near], atol=1e-7 * plan.peak_acceleration)
        assert np.abs(v).max() == pytest.approx(top, rel=1e-5)
    np.testing.assert_allclose(plan.speeds, plan.top_speed * np.arange(1, plan.cycles + 1) / plan.cycles)


def test_peak_torque_bounds_what_a_joint_needs():
    t = grid(SWEEP, 50_001)
    v, a, q = SWEEP.velocity(t), SWEEP.acceleration(t), SWEEP.position(t)
    needed = 1.6 * a + 30 * np.cos(q) + np.sign(v) * (9.56 + 3.5 * np.abs(v))
    assert np.abs(needed).max() <= SWEEP.peak_torque(1.6, gravity=30, friction=9.56 + 3.5 * 2.0)
    assert SWEEP.peak_torque(1.6) == pytest.approx(1.6 * np.abs(a).max(), rel=1e-4)


# ----------------------------------------------------------------------------------------------- stroke


def test_smallest_stroke_needs_exactly_the_torque():
    stroke = smallest_stroke(2.0, 1.6, 213.1, friction=15.0, gravity=30.0)
    assert Sweep(stroke, 2.0, 10).peak_torque(1.6, gravity=30.0, friction=15.0) == pytest.approx(213.1)
    with pytest.raises(InvalidInput, match=r"30.*213\.1"):
        smallest_stroke(2.0, 1.6, 213.1, friction=190.0, gravity=30.0)
    with pytest.raises(InvalidInput, match="torque_limit is 0"):
        smallest_stroke(2.0, 1.6, 0.0)


def function_a(plan: Sweep, inertia: float, slip: float, ratio: float) -> float:
    """(2.7) at the last cycle, by brute force: torque of pure inertia, recorded `slip` later than the velocity."""
    t = np.linspace(*plan.windows()[-1], 200_001)
    v, torque = plan.velocity(t), inertia * plan.acceleration(t + slip)
    return (torque[v >= ratio * plan.top_speed].mean() - torque[v <= -ratio * plan.top_speed].mean()) / 2


@pytest.mark.parametrize("degrees", [5, 10, 20, 50])
@pytest.mark.parametrize("ratio", [0.5, 0.8])
def test_inertia_bias_is_what_function_a_finds(degrees, ratio):
    plan = Sweep(degrees * DEG, 2.0, 10, smooth=False)
    found = function_a(plan, 1.6, 1e-3, ratio)
    assert inertia_bias(plan.stroke, 2.0, 1.6, 1e-3, ratio) == pytest.approx(found, rel=1e-3)
    if ratio == 0.8:
        assert found == pytest.approx(-3.73 * 1.6 * 2.0**3 * 1e-3 / plan.stroke**2, rel=2e-3)


def test_without_a_slip_inertia_does_not_matter():
    found = function_a(Sweep(20 * DEG, 2.0, 10, smooth=False), 1.6, 0.0, 0.8)
    assert found == pytest.approx(0.0, abs=1e-3)
    assert inertia_bias(0.35, 2.0, 1.6, 0.0) == 0.0


def test_stroke_for_bias_keeps_the_bias_below_the_wish():
    stroke = stroke_for_bias(2.0, 1.6, 0.1, 1e-3)
    found = abs(function_a(Sweep(stroke, 2.0, 10), 1.6, 1e-3, 0.8))
    assert 0.0999 < found < 0.1001
    assert abs(inertia_bias(stroke, 2.0, 1.6, 1e-3)) <= 0.1
    assert abs(inertia_bias(0.9 * stroke, 2.0, 1.6, 1e-3)) > 0.1
    with pytest.raises(InvalidInput, match="share c is 1"):
        stroke_for_bias(2.0, 1.6, 0.1, 1e-3, share=1.0)


# ------------------------------------------------------------------------------------- other motions


def test_runs_have_the_velocities_they_claim():
    plan = MOTIONS["constant velocity"]
    np.testing.assert_array_equal(plan.velocities, [0.05, -0.05, 0.4, -0.4, 1.0, -1.0])
    for (begin, end), expected in zip(plan.windows(), plan.velocities, strict=True):
        t = np.linspace(begin + 1e-9, end - 1e-9, 101)
        np.testing.assert_allclose(plan.velocity(t), expected, rtol=1e-9)
        np.testing.assert_allclose(plan.acceleration(t), 0.0, atol=1e-6)
        assert (end - begin) * abs(expected) > 0.2 * plan.stroke
        assert abs(plan.velocity(begin - 1e-3)) < abs(expected)


def test_too_fast_a_run_is_answered_with_the_stroke_it_needs():
    with pytest.raises(InvalidInput, match="at least") as caught:
        ConstantVelocity(0.3, (0.5, 2.0), ramp_acceleration=10.0)
    stroke = float(re.search(r"at least ([\d.]+) rad", str(caught.value))[1])
    assert ConstantVelocity(stroke, (0.5, 2.0), ramp_acceleration=10.0).stroke == stroke
    with pytest.raises(InvalidInput, match="lead_in"):
        ConstantVelocity(0.3, (0.5,), lead_in=0.01)


def test_a_multisine_holds_its_band_and_nothing_else():
    plan = Multisine(0.5, 0.5, 3.0, 4.0, periods=2, lead_in=4.0)
    t = plan.windows()[0, 0] + np.arange(1024) * (4.0 / 1024)
    spectrum = 2 * np.abs(np.fft.rfft(plan.velocity(t))) / t.size
    inside = np.arange(2, 13)
    np.testing.assert_array_equal(plan.harmonics, inside)
    np.testing.assert_allclose(spectrum[inside], spectrum[2], rtol=1e-9)
    assert np.delete(spectrum, inside).max() < 1e-9
    np.testing.assert_allclose(plan.position(t), plan.position(t + 4.0), atol=1e-12)


def crest_factors(plan):
    """Half range over root mean square of position and of velocity in a period: 1.41 for one sine."""
    t = plan.windows()[0, 0] + plan.period * np.arange(6400) / 6400.0
    signals = plan.position(t) - plan.center, plan.velocity(t)
    return [0.5 * np.ptp(x) / np.std(x) for x in signals[:1]] + [
        np.abs(signals[1]).max() / np.std(signals[1])
    ]


def test_the_phases_are_better_than_chance_and_always_the_same():
    plan = Multisine(0.5, 0.1, 2.0, 10.0, seed=3)
    assert plan.phases == Multisine(0.5, 0.1, 2.0, 10.0, seed=3).phases
    assert plan.phases != Multisine(0.5, 0.1, 2.0, 10.0, seed=4).phases
    rng = np.random.default_rng(0)
    chance = [crest_factors(replace(plan, phases=tuple(rng.uniform(-np.pi, np.pi, 20)))) for _ in range(20)]
    assert math.prod(crest_factors(plan)) < np.prod(chance, axis=1).min()
    one = Multisine(0.5, 1.0, 1.0, 1.0)
    np.testing.assert_allclose(crest_factors(one), math.sqrt(2), rtol=2e-3)


# ---------------------------------------------------------------------------------------------- torques


@torques
def test_torques_do_not_jump_and_begin_and_end_at_the_offset(plan):
    begin, end = plan.start - 0.1, plan.start + plan.duration + 0.1
    assert largest_jump(plan.torque, begin, end) < 1e-9
    np.testing.assert_allclose(plan.torque([begin, plan.start, end]), plan.offset, atol=1e-12)
    torque = plan.torque(grid(plan, 100_001))
    assert np.abs(torque).max() == pytest.approx(plan.largest_torque, rel=1e-4)
    assert torque.mean() == pytest.approx(plan.offset, abs=1e-3)
    assert plan.torque(np.zeros((2, 3))).shape == (2, 3)


@pytest.mark.parametrize(
    "plan", [replace(TORQUES["sine"], offset=0.0), replace(TORQUES["saw-tooth"], offset=0.0)]
)
def test_free_travel_is_the_second_integral_of_a_period(plan):
    begin, end = plan.windows()[0]
    t = np.linspace(begin, end, 200_001)
    step = t[1] - t[0]
    travel = np.cumsum(np.cumsum(plan.torque(t)) * step)[-1] * step / 1.7
    assert plan.free_travel(1.7) == pytest.approx(travel, rel=1e-3)


def test_a_ramp_goes_up_down_through_zero_and_back_at_its_rate():
    plan = TORQUES["ramp"]
    windows = plan.windows()
    np.testing.assert_allclose(plan.torque(windows[:, 0]) - 0.5, [0, 8, -8, 8, -8], atol=1e-9)
    np.testing.assert_allclose(plan.torque(windows[:, 1]) - 0.5, [8, -8, 8, -8, 0], atol=1e-9)
    for begin, end in windows:
        rate = np.diff(plan.torque(np.linspace(begin, end, 11))) / ((end - begin) / 10)
        np.testing.assert_allclose(np.abs(rate), 2.0, rtol=1e-9)
    assert windows[0, 0] == plan.start + plan.lead_in


def test_a_sawtooth_rises_as_long_as_it_says():
    torque = SawtoothTorque(1.0, 1.0, 1, rise=0.8).torque(np.arange(0, 1, 1e-4))
    assert np.mean(np.diff(torque) > 0) == pytest.approx(0.8, abs=1e-3)


# -------------------------------------------------------------------------------------------- bad input


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: Sweep(-0.35, 2.0, 10), "-0.35"),
        (lambda: Sweep(0.35, 0.0, 10), "top_speed is 0"),
        (lambda: Sweep(0.35, 2.0, 0), "cycles is 0"),
        (lambda: Sweep(0.35, 2.0, 2.5), "2.5"),  # type: ignore[arg-type]
        (lambda: Sweep(0.35, 2.0, True), "True"),
        (lambda: Sweep(0.35, math.nan, 10), "nan"),
        (lambda: Sweep("wide", 2.0, 10), "wide"),  # type: ignore[arg-type]
        (lambda: Sweep(0.35, 2.0, 10, lead_in=0.01), "0.01"),
        (lambda: Sweep(0.35, 2.0, 10, unit="deg"), "deg"),  # type: ignore[arg-type]
        (lambda: Sweep(0.35, 2.0, 10, joint="=1+1"), r"=1\+1"),
        (lambda: Sweep(0.35, 2.0, 10, joint="a\nb"), "a.*b"),
        (lambda: Sweep(0.35, 2.0, 10, joint=""), "''"),
        (lambda: ConstantVelocity(0.5, ()), "speeds"),
        (lambda: ConstantVelocity(0.5, (0.1, -0.2)), "-0.2"),
        (lambda: Multisine(0.5, 2.0, 1.0, 5.0), "2 to 1"),
        (lambda: Multisine(0.5, 0.1, 200.0, 5.0), "200 Hz"),
        (lambda: Multisine(0.5, 0.1, 2.0, 5.0, seed=-1), "-1"),
        (lambda: Multisine(0.5, 0.1, 2.0, 5.0, phases=(0.1,)), "1 numbers"),
        (lambda: SineTorque(1.0, 0.0, 3), "frequency is 0"),
        (lambda: SawtoothTorque(1.0, 1.0, 3, rise=1.0), "rise is 1"),
        (lambda: TorqueRamp(1.0, -2.0), "rate is -2"),
        (lambda: InTurn(()), "plans"),
        (lambda: InTurn((SWEEP, SWEEP)), "j1, j1"),
        (lambda: InTurn((SWEEP, TORQUES["ramp"])), "torques"),
        (lambda: InTurn((SWEEP,), pause=-1.0), "-1"),
        (lambda: sample(SWEEP, 0.0), "0.0 Hz"),
        (lambda: sample(SWEEP, 1e9), "17"),
        (lambda: JointLimits(lower=1.0, upper=-1.0), "1.0 to -1.0"),
        (lambda: JointLimits(velocity=-1.0), "-1.0"),
    ],
)
def test_invalid_plans_are_refused_by_name_and_value(make, named):
    with pytest.raises(InvalidInput, match=named):
        make()


# ---------------------------------------------------------------------------------------------- in turn


def test_in_turn_only_one_joint_moves_at_a_time():
    plans = (SWEEP, Sweep(0.3, 1.0, 3, joint="j2", center=-1.0), replace(MOTIONS["multisine"], joint="j3"))
    plan = InTurn(plans, held=(Hold(joint="j4", position=0.7),), pause=0.25, start=2.0)
    assert plan.joints == ("j1", "j2", "j3", "j4")
    t = grid(plan, 30_001)
    q, v, a = plan.position(t), plan.velocity(t), plan.acceleration(t)
    assert q.shape == v.shape == a.shape == (t.size, 4)
    moving = (np.abs(v) > 1e-9) | (np.abs(a) > 1e-6)
    assert moving.sum(axis=1).max() == 1
    assert moving.any(axis=0).tolist() == [True, True, True, False]
    np.testing.assert_allclose(q[[0, -1]], [[0.4, -1.0, 0.1, 0.7]] * 2, atol=1e-12)
    for k, (begin, end) in enumerate(plan.windows()):
        waits = (t < begin) | (t > end)
        np.testing.assert_allclose(q[waits, k], plan.home[k], atol=1e-12)
    assert plan.duration == pytest.approx(sum(p.duration for p in plans) + 2 * 0.25)
    assert plan.position(3.0).shape == (4,)


def test_the_plan_of_one_joint_lies_on_the_logs_clock():
    plan = InTurn((SWEEP, replace(SWEEP, joint="j2")), pause=0.5, start=2.0)
    second = plan_of(plan, "j2")
    assert second.start == pytest.approx(2.0 + SWEEP.duration + 0.5)
    t = np.linspace(second.start, second.start + second.duration, 101)
    np.testing.assert_array_equal(plan.position(t)[:, 1], second.position(t))
    later = replace(plan, start=10.0)
    np.testing.assert_allclose(plan_of(later, "j2").windows(), second.windows() + 8.0)
    assert plan_of(SWEEP, "whatever the log calls it") is SWEEP
    with pytest.raises(UnknownName, match="j1, j2"):
        plan_of(plan, "j7")


def test_torques_in_turn_leave_the_others_alone():
    plan = InTurn((replace(TORQUES["sine"], joint="a"), replace(TORQUES["ramp"], joint="b", offset=0.0)))
    t = grid(plan, 5001)
    torque = plan.torque(t)
    assert torque.shape == (t.size, 2)
    assert plan.commands == "torque"
    with pytest.raises(InvalidInput, match="torque plan"):
        plan.position(t)
    with pytest.raises(InvalidInput, match="positions"):
        InTurn((SWEEP,)).torque(t)


# ----------------------------------------------------------------------------------------------- limits


def refusal(plan, limits, **more) -> str:
    with pytest.raises(InvalidInput) as caught:
        check_limits(plan, limits, **more)
    return str(caught.value)


def number_after(words: str, text: str) -> float:
    return float(re.search(words + r" (-?[\d.e+]+)", text)[1])


def test_a_plan_within_its_limits_passes():
    check_limits(SWEEP, JointLimits())
    bound = JointLimits(
        lower=0.4 - 10 * DEG, upper=0.4 + 10 * DEG, velocity=2.0, acceleration=23.0, effort=60.0
    )
    check_limits(SWEEP, bound, inertia=1.6, gravity=10.0, friction=10.0)
    check_limits(TORQUES["ramp"], JointLimits(effort=8.5))


@pytest.mark.parametrize("plan", [SWEEP, ConstantVelocity(0.35, (0.5, 2.0)), Multisine(0.35, 0.2, 2, 5.0)])
def test_the_way_out_of_a_range_is_a_way_out(plan):
    plan = replace(plan, center=0.4)
    text = refusal(plan, JointLimits(lower=-1.0, upper=0.5))
    assert "upper limit of 0.5 rad" in text
    center = number_after("center that would do is", text)
    check_limits(replace(plan, center=center), JointLimits(lower=-1.0, upper=0.5))
    text = refusal(plan, JointLimits(lower=0.3, upper=3.0))
    check_limits(
        replace(plan, center=number_after("center that would do is", text)), JointLimits(lower=0.3, upper=3.0)
    )
    text = refusal(plan, JointLimits(lower=0.3, upper=0.5))
    assert number_after("largest stroke that would do is", text) == pytest.approx(0.2, rel=1e-3)


def test_the_way_out_of_each_limit_of_a_sweep_is_a_way_out():
    text = refusal(SWEEP, JointLimits(velocity=1.7654321))
    assert "2 rad/s" in text
    check_limits(
        replace(SWEEP, top_speed=number_after("top speed of at most", text)), JointLimits(velocity=1.7654321)
    )
    text = refusal(SWEEP, JointLimits(acceleration=17.654321))
    assert "22.92" in text
    stroke = number_after("smallest stroke that would do is", text)
    assert stroke == pytest.approx(2 * 4 / 17.654321, rel=1e-3)
    check_limits(replace(SWEEP, stroke=stroke), JointLimits(acceleration=17.654321))
    text = refusal(SWEEP, JointLimits(effort=50.0), inertia=1.6, gravity=30.0)
    stroke = number_after("smallest stroke that would do is", text)
    assert stroke == pytest.approx(smallest_stroke(2.0, 1.6, 50.0, gravity=30.0), rel=1e-3)
    check_limits(replace(SWEEP, stroke=stroke), JointLimits(effort=50.0), inertia=1.6, gravity=30.0)
    assert "No stroke is sufficient" in refusal(SWEEP, JointLimits(effort=20.0), inertia=1.6, gravity=30.0)


def test_the_ways_out_of_the_other_motions_are_ways_out():
    tone = Multisine(0.35, 0.2, 2, 5.0)
    for bound in (JointLimits(velocity=0.3), JointLimits(acceleration=1.0)):
        text = refusal(tone, bound)
        check_limits(
            replace(tone, stroke=number_after("stroke (?:of at most|that would do is)", text)), bound
        )
    runs, bound = ConstantVelocity(0.35, (0.5, 2.0)), JointLimits(acceleration=12.0)
    text = refusal(runs, bound)
    better = replace(
        runs,
        ramp_acceleration=number_after("acceleration of at most", text),
        stroke=number_after("room for it is", text),
        lead_in=None,
    )
    check_limits(better, bound)


def test_every_passed_limit_and_every_joint_is_named():
    limits = {
        "j1": JointLimits(name="j1", lower=-1, upper=0.1, velocity=1.0, acceleration=5.0),
        "j2": JointLimits(name="j2", velocity=0.5),
        "j3": JointLimits(name="j3", upper=0.2),
    }
    plan = InTurn((SWEEP, Sweep(0.3, 1.0, 3, joint="j2")), held=(Hold(joint="j3", position=0.3),))
    text = refusal(plan, limits)
    for words in (
        "'j1': the position",
        "'j1': the velocity",
        "'j1': the acceleration",
        "'j2': the vel",
        "'j3' would be held",
    ):
        assert words in text
    with pytest.raises(UnknownName, match="j1"):
        check_limits(plan, {"elsewhere": JointLimits()})
    with pytest.raises(InvalidInput, match="limits are in m"):
        check_limits(SWEEP, JointLimits(unit="m"))
    assert "above the limit of 5 N.m" in refusal(TORQUES["sine"], JointLimits(effort=3.9)).replace("3.9", "5")


URDF = """<?xml version="1.0"?>
<robot name="arm">
  <link name="base"/>
  <joint name="shoulder" type="revolute"><limit lower="-1.5" upper="2.5e0" velocity="2.16" effort="330"/></joint>
  <joint name="rail" type="prismatic"><limit lower="0" upper="0.8" velocity="0.5" effort="200" acceleration="3"/></joint>
  <joint name="wheel" type="continuous"><limit velocity="10" effort="5" lower="0" upper="0"/></joint>
  <joint name="soft" type="revolute"><limit lower="-3" upper="3" velocity="1" effort="1"/>
    <safety_controller soft_lower_limit="-2" soft_upper_limit="4" k_velocity="1"/></joint>
  <joint name="unstated" type="revolute"><limit lower="0" upper="0" velocity="0" effort="0"/></joint>
  <joint name="bare" type="revolute"/>
  <joint name="fixed" type="fixed"/>
  <joint name="finger" type="prismatic"><mimic joint="rail"/><limit lower="0" upper="1"/></joint>
  <transmission name="t"><joint name="shoulder"/></transmission>
</robot>"""


def written(tmp_path, text: str | bytes, name: str = "robot.urdf"):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def test_limits_are_read_from_a_urdf(tmp_path):
    found = read_limits(written(tmp_path, URDF))
    inf = math.inf
    assert list(found) == ["shoulder", "rail", "wheel", "soft", "unstated", "bare"]
    assert found["shoulder"] == JointLimits(
        name="shoulder", lower=-1.5, upper=2.5, velocity=2.16, effort=330.0
    )
    assert found["rail"] == JointLimits(
        name="rail", unit="m", lower=0, upper=0.8, velocity=0.5, effort=200.0, acceleration=3.0
    )
    assert (found["wheel"].lower, found["wheel"].upper, found["wheel"].velocity) == (-inf, inf, 10.0)
    assert (found["soft"].lower, found["soft"].upper) == (-2.0, 3.0)
    assert found["unstated"].finite_limits == found["bare"].finite_limits == ()
    assert found["shoulder"].overridden(velocity=1.0, effort=None).velocity == 1.0


@pytest.mark.parametrize(
    ("text", "error", "words"),
    [
        ("<robot>", ReadError, "well-formed"),
        ("", ReadError, "well-formed"),
        ("<sdf/>", UnknownFormat, "<sdf>"),
        ("<robot name='r'/>", ReadError, "no joint that moves"),
        (URDF.replace("2.16", "fast"), ReadError, "shoulder.*fast"),
        (URDF.replace("2.16", "${v}"), ReadError, "xacro"),
        (URDF.replace("2.16", "nan"), ReadError, "nan"),
        (URDF.replace("2.16", "-1"), ReadError, "negative velocity"),
        (URDF.replace("-1.5", "7"), ReadError, "7.0 above"),
        (URDF.replace("'rail'", "").replace('name="rail"', 'name="shoulder"'), ReadError, "twice"),
        (
            '<!DOCTYPE robot [<!ENTITY x SYSTEM "file:///etc/passwd">]>' + URDF[21:],
            ForbiddenContent,
            "DOCTYPE",
        ),
        ("<!DOCTYPE robot>" + URDF[21:], ForbiddenContent, "DOCTYPE"),
    ],
)
def test_bad_descriptions_are_refused(tmp_path, text, error, words):
    with pytest.raises(error, match=words):
        read_limits(written(tmp_path, text))


def test_an_absent_description_is_said_by_name(tmp_path):
    with pytest.raises(ReadError, match=r"nowhere\.urdf: No such file"):
        read_limits(tmp_path / "nowhere.urdf")


def test_reading_a_description_names_the_extra_it_needs(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "defusedxml", None)
    with pytest.raises(MissingExtra, match=r"backdrive\[arm\]"):
        read_limits(written(tmp_path, URDF))


def test_mutated_descriptions_give_limits_or_a_typed_error(tmp_path):
    rng = np.random.default_rng(1)
    good = URDF.encode()
    for _ in range(300):
        bad = bytearray(good)
        for _ in range(rng.integers(1, 6)):
            bad[rng.integers(len(bad))] = rng.integers(256)
        try:
            found = read_limits(written(tmp_path, bytes(bad[: rng.integers(1, len(bad) + 1)])))
        except BackdriveError:
            continue
        assert all(isinstance(limits, JointLimits) for limits in found.values())


# -------------------------------------------------------------------------------------------- plan file

size = st.floats(1e-3, 1e3, allow_nan=False)
place = st.floats(-1e3, 1e3, allow_nan=False)
name = st.text(st.characters(categories=("L", "N")), min_size=1, max_size=12)
common = {"start": place, "joint": name, "unit": st.sampled_from(["rad", "m"])}
count = st.integers(1, 50)
any_plan = st.one_of(
    st.builds(Sweep, size, size, count, center=place, smooth=st.booleans(), **common),
    st.builds(
        ConstantVelocity, size, st.lists(size, min_size=1, max_size=5).map(tuple), center=place, **common
    ),
    st.builds(SineTorque, size, size, count, offset=place, **common),
    st.builds(SawtoothTorque, size, size, count, rise=st.floats(0.01, 0.99), **common),
    st.builds(TorqueRamp, size, size, count, lead_in=size, **common),
    st.builds(
        Multisine, size, st.just(0.3), st.floats(1, 3), st.just(4.0), seed=count, periods=count, **common
    ),
)


@settings(max_examples=60, deadline=None)
@given(any_plan)
def test_a_plan_survives_its_file(plan):
    data = json.loads(json.dumps(plan_to_dict(plan)))
    assert (data["format"], data["schema"], data["kind"], data["unit"]) == (
        "backdrive-plan",
        1,
        plan.kind,
        plan.unit,
    )
    again = plan_from_dict(data)
    assert again == plan
    assert plan_from_dict(plan_to_dict(plan)) == plan
    np.testing.assert_array_equal(again.windows(), plan.windows())


def test_plans_in_turn_survive_their_file(tmp_path):
    held = (Hold(joint="gripper", position=0.01, unit="m"),)
    plan = InTurn((SWEEP, replace(MOTIONS["multisine"], joint="j2")), held=held, pause=0.3, start=1.0)
    path = save_plan(plan, tmp_path / "plan.json")
    assert load_plan(path) == plan
    moved = load_plan(path, start=4.0)
    np.testing.assert_allclose(moved.windows(), plan.windows() + 3.0)


def test_every_plan_has_its_own_kind():
    kinds = [cls.kind for cls in PLANS]
    assert len(set(kinds)) == len(PLANS) == 6


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"format": "something"}, UnknownFormat, "not a plan"),
        ({"schema": 2}, UnknownFormat, "schema 2"),
        ({"schema": True}, UnknownFormat, "True"),
        ({"kind": "sweeep"}, ReadError, "sweep"),
        ({"kind": None}, ReadError, "no kind"),
        ({"stroke": "wide"}, ReadError, "stroke"),
        ({"stroke": -1.0}, ReadError, "-1"),
        ({"cycles": 2.5}, ReadError, "cycles"),
        ({"colour": "red"}, ReadError, "colour"),
        ({"joint": "=cmd"}, ReadError, "=cmd"),
        ({"unit": "deg"}, ReadError, "unit"),
        ({"kind": "in-turn"}, ReadError, "damaged"),
    ],
)
def test_damaged_plans_are_refused(tmp_path, change, error, words):
    path = written(tmp_path, json.dumps({**plan_to_dict(SWEEP), **change}), "plan.json")
    with pytest.raises(error, match=words) as caught:
        load_plan(path)
    assert "plan.json" in str(caught.value)


def test_a_plan_in_turn_inside_another_is_refused():
    data = plan_to_dict(InTurn((SWEEP,)))
    inner = {k: v for k, v in data.items() if k not in ("format", "schema")}
    with pytest.raises(ReadError, match="contains another"):
        plan_from_dict({**data, "plans": [inner]})
    for plans in (None, [], {}, ["x"], [None]):
        with pytest.raises(ReadError):
            plan_from_dict({**data, "plans": plans})
    for held in (None, "x", [1], [{"joint": "a"}]):
        with pytest.raises(ReadError):
            plan_from_dict({**data, "held": held})
    with pytest.raises(ReadError):
        plan_from_dict({**data, "pause": "long"})


@pytest.mark.parametrize(
    "content", [b"", b"{", b"[]", b"\xff\xfe", b"null", b"[" * 100_000, b'{"format": 1e999}']
)
def test_what_is_no_plan_is_refused(tmp_path, content):
    with pytest.raises(ReadError):
        load_plan(written(tmp_path, content, "plan.json"))
    with pytest.raises(ReadError, match="No such file"):
        load_plan(tmp_path / "none.json")


# ----------------------------------------------------------------------------------------------- tables

IN_TURN = InTurn((Sweep(0.3, 1.0, 2, joint="it's"), Sweep(0.2, 1.0, 2, joint="b", center=1.0)), start=7.0)


@pytest.mark.parametrize("plan", [SWEEP, IN_TURN], ids=["one", "in turn"])
def test_the_table_is_the_plan(plan):
    table = sample(plan, 250.0)
    t = plan.start + table.time
    np.testing.assert_allclose(np.diff(table.time), 1 / 250, rtol=1e-9)
    assert 0 <= table.time[-1] - plan.duration < 1 / 250
    for channel, values in table.channels.items():
        np.testing.assert_array_equal(values, getattr(plan, channel)(t).reshape(t.size, -1))


def test_csv_read_back_equals_the_closed_form():
    table = sample(IN_TURN, 100.0)
    lines = csv_text(table).splitlines()
    assert lines[0] == "time,it's.q,it's.dq,it's.ddq,b.q,b.dq,b.ddq"
    numbers = np.array([[float(x) for x in line.split(",")] for line in lines[1:]])
    t = 7.0 + np.arange(len(numbers)) / 100
    np.testing.assert_allclose(numbers[:, 0], t - 7.0, atol=1e-9)
    for joint in range(2):
        for k, f in enumerate((IN_TURN.position, IN_TURN.velocity, IN_TURN.acceleration)):
            np.testing.assert_allclose(numbers[:, 1 + 3 * joint + k], f(t)[:, joint], atol=1e-9)
    assert "-0," not in lines[1]


def test_npz_read_back_equals_the_closed_form(tmp_path):
    with np.load(written(tmp_path, npz_bytes(sample(IN_TURN, 100.0)), "plan.npz")) as stored:
        assert stored["joints"].tolist() == ["it's", "b"]
        assert stored["units"].tolist() == ["rad", "rad"]
        np.testing.assert_array_equal(stored["velocity"], IN_TURN.velocity(7.0 + stored["time"]))


#: What a YAML 1.1 reader takes for a float, and what for an integer.
FLOAT = re.compile(r"[-+]?(?:[0-9][0-9_]*)\.[0-9_]*(?:[eE][-+][0-9]+)?$")
INT = re.compile(r"(?:0|[1-9][0-9]*)$")


def parse_trajectory(text: str):
    """Read the YAML by hand: joint names, times (n,) and the fields of the points, each (n, J)."""
    head, _, body = text.partition("points:\n")
    names = [line[3:-1].replace("''", "'") for line in head.splitlines() if line.startswith("- '")]
    times, fields = [], {}
    for line in body.splitlines():
        key, _, value = line[2:].partition(": ")
        if key == "time_from_start":
            sec, nanosec = re.fullmatch(r"\{sec: (\S+), nanosec: (\S+)\}", value).groups()
            assert INT.match(sec)
            assert INT.match(nanosec)
            times.append(int(sec) + 1e-9 * int(nanosec))
        else:
            words = value[1:-1].split(", ")
            assert all(FLOAT.match(w) for w in words)
            fields.setdefault(key, []).append([float(w) for w in words])
    return names, np.array(times), {key: np.array(rows) for key, rows in fields.items()}


def test_the_trajectory_read_back_equals_the_closed_form():
    names, t, fields = parse_trajectory(trajectory_yaml(sample(IN_TURN, 50.0)))
    assert names == ["it's", "b"]
    np.testing.assert_allclose(fields["positions"], IN_TURN.position(7.0 + t), atol=1e-11)
    np.testing.assert_allclose(fields["velocities"], IN_TURN.velocity(7.0 + t), atol=1e-11)
    np.testing.assert_allclose(fields["accelerations"], IN_TURN.acceleration(7.0 + t), atol=1e-11)
    np.testing.assert_allclose(fields["velocities"][-1], 0.0, atol=1e-12)


def test_a_controllers_quintics_between_the_points_follow_the_plan():
    """joint_trajectory_controller joins points by quintics: at 100 Hz it leaves the plan by micrometres at most."""
    _, t, fields = parse_trajectory(trajectory_yaml(sample(SWEEP, 100.0)))
    q, v, a = (fields[k][:, 0] for k in ("positions", "velocities", "accelerations"))
    h = np.diff(t)
    middle = (q[:-1] + q[1:]) / 2 + h / 32 * (5 * v[:-1] - 5 * v[1:]) + h**2 / 64 * (a[:-1] + a[1:])
    np.testing.assert_allclose(middle, SWEEP.position(SWEEP.start + t[:-1] + h / 2), atol=2e-6)


def test_a_torque_is_written_as_effort():
    names, t, fields = parse_trajectory(trajectory_yaml(sample(TORQUES["ramp"], 10.0)))
    assert (names, list(fields)) == (["joint"], ["effort"])
    np.testing.assert_allclose(fields["effort"][:, 0], TORQUES["ramp"].torque(0.5 + t), atol=1e-11)
    assert csv_text(sample(TORQUES["ramp"], 10.0)).startswith("time,joint.tau\n0,0.5\n")


@settings(max_examples=200)
@given(st.floats(allow_nan=False, allow_infinity=False))
def test_yaml_numbers_are_floats_to_every_reader(x):
    assert FLOAT.match(yaml_number(x))
    assert float(yaml_number(x)) == x


@pytest.mark.parametrize("value", [1e308, -1e308, 10**13, 10**400, float("nan"), float("inf"), "x"])
@pytest.mark.parametrize("key", ["stroke", "top_speed", "center", "lead_in", "start"])
def test_numbers_that_no_plan_holds_are_refused_with_the_place(tmp_path, key, value):
    document = plan_to_dict(Sweep(0.3, 1.0, cycles=3)) | {key: value}
    (tmp_path / "plan.json").write_text(json.dumps(document))
    with pytest.raises(ReadError, match=key if value != "x" else "damaged"):
        load_plan(tmp_path / "plan.json")


@pytest.mark.parametrize("key", ["stroke", "top_speed"])
def test_a_stroke_or_speed_of_nothing_is_refused(tmp_path, key):
    document = plan_to_dict(Sweep(0.3, 1.0, cycles=3)) | {key: 1e-308}
    (tmp_path / "plan.json").write_text(json.dumps(document))
    with pytest.raises(ReadError, match=key):
        load_plan(tmp_path / "plan.json")


def test_a_plan_nested_too_deep_is_refused(tmp_path):
    for levels in (500, 950, 100_000):
        (tmp_path / "plan.json").write_text(
            '{"format": "backdrive-plan", "schema": 1, "kind": "sweep", "stroke": '
            + "[" * levels
            + "]" * levels
            + "}"
        )
        with pytest.raises(ReadError):
            load_plan(tmp_path / "plan.json")
