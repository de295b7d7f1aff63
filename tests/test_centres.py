"""Tests for excite/centres.py, identification/{sweep_fit,load_fit,sweep_delay}.py: unequal directions under gravity."""

import math
from dataclasses import replace
from itertools import combinations_with_replacement

import numpy as np
import pytest

from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.identification.dynamics import predict
from backdrive.identification.load_fit import payload_growth
from backdrive.identification.signals import prepare
from backdrive.identification.sweep import fit_sweeps, identify_sweep, sweep_knots
from backdrive.identification.sweep_delay import sweep_delay
from backdrive.identification.sweep_equations import GRAVITY, equations
from backdrive.identification.sweep_payload import identify_payload
from backdrive.identification.sweep_windows import windows
from backdrive.laws import GearLoad, Law, Polyline
from backdrive.plans import Sweep
from backdrive.plans.centres import (
    WORST_GAIN,
    choose_centers,
    condition,
    mean_cosine,
    noise_gain,
    sweeps_about,
    width_for,
)
from backdrive.plans.limits import JointLimits
from backdrive.simulation.machines import joint_1
from backdrive.simulation.open_loop import simulate

A, V = np.deg2rad(20), 2.0
SWEEP = Sweep(A, V, 6)


def within(half_degrees):
    half = math.radians(half_degrees) + 0.5 * A
    return JointLimits(lower=-half, upper=half)


# the choice


def test_the_noise_gain_is_that_of_least_squares():
    c = np.deg2rad([-60, 0, 60])
    X = np.column_stack([np.ones(3), np.sin(c), np.cos(c)])
    expected = np.sqrt(np.linalg.inv(X.T @ X)[0, 0])
    assert noise_gain(c) == pytest.approx(expected) == pytest.approx(np.sqrt(3.0))
    assert noise_gain(c + 0.7) == pytest.approx(expected)  # gravity turned is gravity again
    assert math.isinf(noise_gain([0.1]))
    assert math.isinf(noise_gain(np.deg2rad([-15, 15])))
    assert noise_gain([0.3, 0.3 + np.pi]) == pytest.approx(np.sqrt(0.5))
    assert noise_gain(np.deg2rad([-90, 88])) == pytest.approx(np.sqrt(0.5), abs=1e-3)
    assert math.isinf(noise_gain(np.deg2rad([-90, 87])))


@pytest.mark.parametrize("half", [25.0, 45.0, 60.0, 75.0])
def test_no_centers_inside_a_range_beat_the_bound(half):
    grid = np.deg2rad(np.linspace(-half, half, 7))
    bound = 1.0 / math.tan(np.deg2rad(half) / 2) ** 2
    for count in (3, 4):
        best = min(noise_gain(c) for c in combinations_with_replacement(grid, count))
        assert best * math.sqrt(count) >= bound * (1 - 1e-9)
        chosen = choose_centers(SWEEP, within(half), sweeps=count)
        assert chosen.noise_gain <= best * (1.0 + 1e-6 if count == 3 else 1.05)
    assert min(noise_gain(c) for c in combinations_with_replacement(grid, 4)) * 2.0 < 1.2 * bound


def test_as_few_sweeps_as_reach_the_gain():
    found = choose_centers(SWEEP, within(60))
    assert np.rad2deg(found.centers) == pytest.approx([-60, 0, 60])
    assert found.noise_gain == pytest.approx(np.sqrt(3.0))
    assert found.duration == pytest.approx(3 * SWEEP.duration)
    assert len(choose_centers(SWEEP, within(50)).plans) > 3
    wide = choose_centers(SWEEP, JointLimits())
    assert np.ptp(wide.centers) == pytest.approx(np.pi)
    assert wide.noise_gain == pytest.approx(np.sqrt(0.5))
    turned = choose_centers(Sweep(A, V, 6, center=1.0), JointLimits(lower=-3.0, upper=3.0))
    assert np.mean(turned.centers) == pytest.approx(1.0)


def test_no_stroke_passes_its_limits_by_rounding():
    for low, high in ((-1.3, 1.0), (-0.777777777777, 1.1111111111), (-math.pi, math.pi)):
        found = choose_centers(SWEEP, JointLimits(lower=low, upper=high))
        for plan in found.plans:
            assert low <= plan.position_range[0] < plan.position_range[1] <= high
    half_a_turn = choose_centers(SWEEP, within(90))
    assert len(half_a_turn.plans) == 2


def test_the_condition_is_that_of_the_equations_that_will_be_solved():
    for degrees in ((-60, 0, 60), (-30, 0, 30), (-90, 90)):
        logs = [
            simulate(joint_1(), Sweep(A, V, 6, center=np.deg2rad(c)), seed=i) for i, c in enumerate(degrees)
        ]
        found = equations([sweep_knots(log, 0) for log in logs]).condition("own", GRAVITY)
        assert condition(np.deg2rad(degrees), 6, A) == pytest.approx(found, rel=0.02)
    phase = np.linspace(np.arcsin(0.8), np.pi - np.arcsin(0.8), 10001)
    assert mean_cosine(A) == pytest.approx(np.cos(0.5 * A * np.cos(phase)).mean(), rel=1e-5)


def test_centers_that_will_not_do_are_named():
    with pytest.raises(InvalidInput, match="too near: over 20 deg"):
        sweeps_about(SWEEP, np.deg2rad([-10, 0, 10]))
    for centers in ((-60, 60), (-60, 60, -60), (300, 60)):
        with pytest.raises(InvalidInput, match="Two centers 120 deg apart cannot .* third center between"):
            sweeps_about(SWEEP, np.deg2rad(centers))
    with pytest.raises(InvalidInput, match="Two centers 20 deg apart cannot .* are the least"):
        sweeps_about(SWEEP, np.deg2rad([-10, 10]))
    with pytest.raises(InvalidInput, match="badly spread: over 120 deg"):
        sweeps_about(SWEEP, np.deg2rad([-60, -59, 60]))
    with pytest.raises(InvalidInput, match="half a turn .180 deg. apart: give three"):
        choose_centers(SWEEP, within(60), sweeps=2)
    with pytest.raises(InvalidInput, match="half a turn"):
        sweeps_about(SWEEP, [0.0])
    with pytest.raises(InvalidInput, match="10 deg apart"):
        choose_centers(SWEEP, within(5))
    with pytest.raises(InvalidInput, match="does not fit"):
        choose_centers(SWEEP, JointLimits(lower=-0.1, upper=0.1))
    with pytest.raises(InvalidInput, match="is linear"):
        choose_centers(Sweep(0.1, 0.3, 5, unit="m"), JointLimits(unit="m"))
    with pytest.raises(InvalidInput, match="1 centers"):
        choose_centers(SWEEP, JointLimits(), sweeps=1)
    assert noise_gain([-width_for(WORST_GAIN), 0.0, width_for(WORST_GAIN)]) == pytest.approx(
        WORST_GAIN, rel=1e-6
    )


# the fit


def uneven(**changes):
    rate = joint_1().law.rate
    down = tuple(np.array(rate.negative) - 2.06)
    law = Law(rate=Polyline(velocity=rate.velocity, positive=rate.positive, negative=down))
    return joint_1().replace(law=law, torque_noise=0.2, **changes)


def made(joint, degrees, seed=0, cycles=6):
    return [
        simulate(joint, Sweep(A, V, cycles, center=np.deg2rad(c)), seed=10 * seed + i)
        for i, c in enumerate(degrees)
    ]


def off(found, joint):
    v = np.array(found.law.velocity[:2])
    result = []
    for way, (value, _) in zip((1, -1), found.constants(), strict=True):
        F = way * joint.law.torque(way * v)
        result.append(value - (F[0] - v[0] * (F[1] - F[0]) / (v[1] - v[0])))
    return np.array(result)


def test_the_constants_come_with_their_errors_whatever_the_drive_s_delay():
    joint = uneven()
    for delay in (1.3e-3, 2.2e-3):
        found = fit_sweeps(made(joint.replace(delay=delay), (-60, 0, 60)), "joint_1")
        error = np.array([e for _, e in found.constants()])
        assert np.all(error < 0.03)
        assert np.all(np.abs(off(found, joint)) < 4 * error)
        assert 0.8 < found.noise_gain < 2.0
        said = next(w for w in found.warnings if "delay was estimated" in w)
        assert float(said.split()[3]) == pytest.approx(1e3 * delay, abs=0.25)
        assert np.sqrt(np.diag(found.covariance)) == pytest.approx(np.r_[found.error_pos, found.error_neg])


def test_least_squares_would_take_the_loop_for_a_delay_and_the_instrument_does_not():
    joint = joint_1().replace(torque_noise=0.2, delay=1.3e-3)
    found = []
    for seed in range(6):
        log = simulate(joint, Sweep(A, V, 10, center=-1.0), seed=seed)
        s = prepare(log, 0)
        found.append(sweep_delay(s, windows(log, 0, log.plan, s)))
    delay, error = np.array(found).T
    assert delay.mean() == pytest.approx(1.3e-3, abs=0.1e-3)
    assert 0.5 < delay.std() / error.mean() < 2.0
    few = Sweep(A, V, 2)
    log = simulate(joint, few)
    s = prepare(log, 0)
    assert np.isnan(sweep_delay(s, windows(log, 0, few, s))).all()


def test_two_centers_half_a_turn_apart_will_do_and_two_near_ones_will_not():
    joint = uneven()
    found = fit_sweeps(made(joint, (-90, 90)), "joint_1")
    assert np.abs(off(found, joint)).max() < 0.06
    assert found.condition < 10
    for degrees in ((-15, 15), (0,), (0, 10, 20)):
        refused = fit_sweeps(made(joint, degrees), "joint_1", symmetric=False)
        said = " ".join(refused.warnings)
        for words in ("offset unattributed", "half a turn", "another posture", "axis is vertical"):
            assert words in said
        assert np.isnan(refused.noise_gain)


@pytest.mark.parametrize("degrees", [(-90, 87), (-30, 144), (-60, 60)])
@pytest.mark.parametrize("symmetric", [None, False])
def test_two_centers_leave_the_constant_alone_and_bend_no_curve(degrees, symmetric):
    joint = uneven()
    found = fit_sweeps(made(joint, degrees), "joint_1", symmetric=symmetric)
    v = np.array(found.law.velocity)
    mean = 0.5 * (np.array(found.law.positive) + found.law.negative)
    truth = 0.5 * (joint.law.torque(v) - joint.law.torque(-v))
    assert mean == pytest.approx(truth, abs=0.05)
    uneven_part = np.array(found.law.positive) - found.law.negative
    assert np.ptp(uneven_part) < 0.15  # the true difference does not change with speed
    assert found.terms["gravity_cos"][0] == pytest.approx(30.0, abs=0.1)
    assert not found.tells(0.5)
    assert found.tells(np.deg2rad(degrees[0]))
    assert any("half a turn from the first" in w for w in found.warnings)


def test_centers_half_a_turn_apart_say_that_growth_is_not_seen():
    found = fit_sweeps(made(uneven(), (0, 180)), "joint_1")
    assert any("has the same size at all centers" in note for note in found.notes)
    assert not any(
        "has the same size at all centers" in n
        for n in fit_sweeps(made(uneven(), (-60, 0, 60)), "joint_1").notes
    )


def test_a_vertical_axis_is_attributed_where_the_centers_show_that_there_is_no_gravity():
    joint = uneven(gravity_cos=0.0)
    found = fit_sweeps(made(joint, (-60, 0, 60)), "joint_1")
    assert np.abs(off(found, joint)).max() < 0.06
    assert abs(found.terms["gravity_cos"][0]) < 0.05


def test_growth_with_the_load_shows_by_posture():
    joint = uneven(load_dependence=0.05)
    found = fit_sweeps(made(joint, (-60, 0, 60)), "joint_1")
    value, error, carried = found.load
    assert value == pytest.approx(0.05, abs=0.01)
    assert error < 0.005
    assert carried == pytest.approx(20.0, abs=0.3)
    v = np.array(found.law.velocity)
    assert np.array(found.law.positive) == pytest.approx(joint.law.torque(v) + 0.05 * carried, abs=0.1)
    (note,) = (note for note in found.notes if f"Friction grows by {value:.4f} +-" in note)
    assert f"of which {value * carried:.2g} +- " in note and " N.m are this growth" in note
    # what the load adds inside the windows is not taken for noise: the scatter over seeds is 0.030 N.m
    assert 0.030 < max(found.error_pos) < 0.037  # few independent samples widen it by a tenth
    assert fit_sweeps(made(uneven(), (-60, 0, 60)), "joint_1").load is None


def test_growth_is_told_from_a_delay_where_inertia_outweighs_gravity():
    joint = joint_1().replace(load_dependence=0.05, torque_noise=0.2, delay=1.3e-3)
    friction, _ = identify_sweep(made(joint, (-82, 0, 82)), "joint_1")
    assert friction.dynamics["time_slip"].value == pytest.approx(-1.8e-3, abs=0.3e-3)
    growth = friction.law.growth
    assert growth.load_driving == growth.load_driven == pytest.approx(0.05, abs=0.002)
    v = np.array(friction.law.rate.velocity)
    carried = growth.load_carried
    assert friction.law.torque(v) == pytest.approx(joint.law.torque(v) + 0.05 * carried, abs=0.15)


def test_a_posture_that_was_not_swept_is_predicted_with_the_growth():
    joint = joint_1().replace(load_dependence=0.05, torque_noise=0.1)
    friction, _ = identify_sweep(made(joint, (-60, 0, 60)), "joint_1")
    assert 15.0 < friction.law.growth.load_carried < 30.0
    without = replace(friction.law, growth=None)
    for center in (-30, 25):
        s = prepare(made(joint, (center,), seed=9)[0], 0)[0]
        slides = np.abs(s.velocity) > 0.2
        off = [
            float(np.mean(((s.torque - predict(f, s)) * np.sign(s.velocity))[slides]))
            for f in (friction, replace(friction, law=without))
        ]
        assert abs(off[0]) < 0.1
        assert abs(off[1]) > 0.2


def test_lifting_and_being_driven_back_need_a_known_payload():
    rate = GearLoad(coulomb=8.0, load=0.02, driving=0.06, driven=0.01, stribeck_velocity=1e3, viscous=2.0)
    joint = joint_1().replace(law=Law(rate=rate))
    knots, payloads = [], []
    for weight in (0.0, 20.0):
        logs = made(joint.replace(gravity_cos=30.0 + weight), (-60, 0, 60), seed=int(weight))
        knots += [sweep_knots(log, 0) for log in logs]
        payloads += [(0.0, weight)] * 3
    found = payload_growth(knots, payloads)
    assert found.driving[0] == pytest.approx(0.08, abs=0.005)
    assert found.driven[0] == pytest.approx(0.03, abs=0.005)
    assert found.gravity == pytest.approx([0.0, 30.0], abs=0.1)
    logs = [
        log
        for w in (0.0, 20.0)
        for log in made(joint.replace(gravity_cos=30.0 + w), (-60, 0, 60), seed=int(w))
    ]
    friction, shown = identify_payload(logs, "joint_1", payloads, timing="command")
    assert friction.law.growth.load_driving == found.driving[0]
    assert friction.dynamics["inertia"].value == pytest.approx(
        1.6, abs=0.06
    )  # what accelerates loads the gear too
    assert "of the load while the motor lifts it" in shown.verdict
    other = prepare(made(joint, (-30,), seed=9)[0], 0)[0]
    slides = np.abs(other.velocity) > 0.2
    off = ((other.torque - predict(friction, other)) * np.sign(other.velocity))[slides]
    assert abs(np.mean(off)) < 0.1
    with pytest.raises(NotIdentifiable, match="which no gear does"):  # sine and cosine swapped
        identify_payload(logs, "joint_1", [(c, s) for s, c in payloads], timing="command")
    with pytest.raises(InvalidInput, match="2 payloads for 6 logs"):
        identify_payload(logs, "joint_1", payloads[:2])
    with pytest.raises(InvalidInput, match="same payload"):
        payload_growth(knots[:3], payloads[:3])
    with pytest.raises(InvalidInput, match="payloads for 6 sweeps"):
        payload_growth(knots, payloads[:2])
    with pytest.raises(NotIdentifiable, match="three distant centers"):
        payload_growth([knots[1], knots[4]], [payloads[1], payloads[4]])


def test_rounding_does_not_choose_between_arrangements_that_mirror_each_other(monkeypatch):
    from backdrive.plans import centres

    places = centres._arrangements(0.0, 0.5, 9)
    truth = {tuple(c): centres.noise_gain(c) for c in places}
    for seed in range(5):
        jitter = np.random.default_rng(seed).permutation(len(places)) * 1e-15
        gains = {c: g * (1.0 + j) for (c, g), j in zip(truth.items(), jitter, strict=True)}
        monkeypatch.setattr(centres, "noise_gain", lambda c, gains=gains: gains[tuple(c)])
        _, best = centres._best(places)
        assert (best.count(-0.5), best.count(0.0), best.count(0.5)) == (2, 4, 3)
