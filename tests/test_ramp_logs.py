"""Torque ramps as they are logged: printed with six decimals, noisy, in one direction, and not named by a plan."""

import numpy as np
import pytest

from backdrive import Joint, Log, identify
from backdrive.identification.ramp import _elastic, _to_and_fro
from backdrive.identification.ramp_branches import Branch
from backdrive.logs.health import check
from backdrive.logs.resolution import resolution

BREAK, STIFF, VISCOUS, RATE = 1.5, 750.0, 2.0, 500.0
COUNT = 2.0 * np.pi / 2**17  # no whole number of millionths


def yielding(torque):
    """Return the position under a slow torque: a spring that slips at break-away, against viscous friction, (n,)."""
    slid, position = 0.0, np.zeros(torque.size)
    for k, u in enumerate(torque.tolist()):
        held = min(max(u, -BREAK), BREAK)
        slid += (u - held) / VISCOUS / RATE
        position[k] = slid + held / STIFF
    return position


def ramp_log(torque, *, noise=0.0, decimals=6, seed=3):
    rng = np.random.default_rng(seed)
    torque = np.asarray(torque)
    position = np.round(COUNT * np.round(yielding(torque) / COUNT), decimals)
    measured = torque + noise * rng.standard_normal(torque.size)
    return Log(
        time=np.arange(torque.size) / RATE, joints=(Joint(name="a"),), position=position, torque=measured
    )


def breaking_out(torque, inertia=0.3):
    """Return the position under a torque: a spring that holds up to break-away, then inertia and viscous friction, (n,)."""
    slid, speed, position, steps = 0.0, 0.0, np.zeros(torque.size), 20
    for k, u in enumerate(torque.tolist()):
        for _ in range(steps):
            if abs(u) > BREAK or speed * u > 0.0:
                pull = u - np.sign(u) * BREAK - VISCOUS / 10 * speed
                speed += pull / inertia / RATE / steps
                speed = speed if speed * u > 0.0 else 0.0
            else:
                speed = 0.0
            slid += speed / RATE / steps
        position[k] = slid + min(max(u, -BREAK), BREAK) / STIFF
    return position


@pytest.mark.parametrize("slope", [0.2, 1.0])
def test_inertia_that_delays_the_slide_is_no_friction(slope):
    torque = corners(0.0, 1.9, -1.9, 0.0, slope=slope)
    noise = 0.02 * np.random.default_rng(2).standard_normal(torque.size)
    log = Log(
        time=np.arange(torque.size) / RATE,
        joints=(Joint(name="a"),),
        position=COUNT * np.round(breaking_out(torque) / COUNT),
        torque=torque + noise,
    )
    friction = identify(log, method="ramp").model.joints[0]
    for side in ("coulomb_positive", "coulomb_negative"):
        assert getattr(friction.law.rate, side) == pytest.approx(BREAK, rel=0.015)
        assert friction.standard_errors[side] < 0.03 * BREAK


def corners(*heights, slope=0.1):
    parts = [np.full(round(RATE), heights[0])]
    for low, high in zip(heights, heights[1:], strict=False):
        parts.append(np.linspace(low, high, round(abs(high - low) / slope * RATE), endpoint=False))
    return np.concatenate(parts)


def test_positions_printed_with_decimals_keep_the_encoder_s_step():
    position = ramp_log(corners(0.0, 1.8)).position[:, 0]
    assert resolution(position) == pytest.approx(COUNT, rel=1e-3)
    wide = COUNT * np.arange(0, 40000, 7)
    assert resolution(np.round(wide, 6)) == pytest.approx(7 * COUNT, rel=1e-4)
    smooth = np.random.default_rng(1).standard_normal(4000)
    assert resolution(np.round(smooth, 6)) == pytest.approx(1e-6, rel=1e-6)  # their own last decimal


@pytest.mark.parametrize("noise", [0.005, 0.1])
def test_ramps_both_ways_are_a_ramp_whatever_the_noise(noise):
    log = ramp_log(corners(0.0, 1.8, -1.8, 0.0), noise=noise)
    assert [f.name for f in check(log) if f.severity != "note"] == []
    result = identify(log)
    friction = result.model.joints[0]
    assert result.method == "ramp"
    law, errors = friction.law.rate, friction.standard_errors
    for side in ("coulomb_positive", "coulomb_negative"):
        assert getattr(law, side) == pytest.approx(BREAK, abs=0.03)
        assert abs(getattr(law, side) - BREAK) < 4.0 * errors[side]
    assert friction.dynamics["presliding_stiffness"].value == pytest.approx(STIFF, rel=0.03)
    assert friction.dynamics["presliding_stiffness_tangent"].value == pytest.approx(STIFF, rel=0.06)
    assert "begins to slip (breaks away)" in result.evidence[0].verdict


def test_noise_of_the_torque_makes_no_joint_stiffer():
    """The share of noise in a short beginning of a branch is large: a regression of position on torque is 3 to 10 % too stiff."""
    values = [
        identify(ramp_log(corners(0.0, 1.3, -1.3, 0.0), noise=0.2, seed=seed))
        .model.joints[0]
        .dynamics["presliding_stiffness_tangent"]
        .value
        for seed in range(6)
    ]
    assert np.mean(values) == pytest.approx(STIFF, rel=0.02)


def test_below_break_away_noise_is_no_friction():
    friction = identify(ramp_log(corners(0.0, 1.3, -1.3, 0.0), noise=0.1)).model.joints[0]
    assert friction.at_bound == ("coulomb_positive", "coulomb_negative")
    assert friction.law.rate.coulomb_positive == pytest.approx(1.3, abs=0.06)


def test_a_ramp_one_way_tells_nothing_of_the_other():
    result = identify(ramp_log(corners(0.0, 1.8), noise=0.02))
    friction = result.model.joints[0]
    assert result.method == "ramp"
    assert friction.law.rate.coulomb_positive == pytest.approx(BREAK, abs=0.03)
    assert friction.law.rate.coulomb_negative == friction.law.rate.coulomb_positive
    assert np.isnan(friction.standard_errors["coulomb_negative"])
    assert any("was not ramped along -q" in w for w in friction.warnings)
    assert "-q" not in result.evidence[0].verdict


def test_a_sweep_above_its_pivot_is_no_ramp():
    """Gravity that falls while Coulomb friction holds makes a torque of straight lines: but the joint slides all along them."""
    rate, stroke = 100.0, 0.3
    times = [2.0 * np.pi * stroke * 6 / (n * 2.0) for n in range(1, 7)]
    cycles = [-stroke * np.cos(2.0 * np.pi * np.arange(round(t * rate)) / round(t * rate)) for t in times]
    q = np.concatenate([np.full(50, -stroke), *cycles, [-stroke]])
    v = np.gradient(q) * rate
    torque = np.tanh(v / 0.01) + 0.2 * v + 0.1 * np.gradient(v) * rate - 1.4 * np.sin(q)
    torque += 0.04 * np.random.default_rng(1).standard_normal(q.size)
    log = Log(time=np.arange(q.size) / rate, joints=(Joint(name="a"),), position=q, torque=torque)
    result = identify(log)
    assert result.method == "sweep"
    assert result.model.torque("a", 1.0) == pytest.approx(1.2, rel=0.05)


def test_a_slide_that_turns_back_is_a_motion_and_slips_at_the_ends_of_ramps_are_not():
    t = np.arange(4000) / 1000.0
    rest, one = np.zeros(1000), np.sin(2.0 * np.pi * np.arange(2000) / 1000.0)
    to_and_fro = np.concatenate([rest, 0.3 * one, rest])
    assert _to_and_fro(to_and_fro, 0.05, 1e-3)
    stroke = 0.15 * (1.0 - np.cos(np.pi * np.clip(t - 1.0, 0.0, 0.5) / 0.5))
    back = -0.15 * (1.0 - np.cos(np.pi * np.clip(t - 2.5, 0.0, 0.5) / 0.5))
    assert not _to_and_fro(stroke + back, 0.05, 1e-3)  # it rests for a second in between
    rebound = 0.02 * np.exp(-np.maximum(t - 1.5, 0.0) / 0.02) * (t >= 1.5)
    assert not _to_and_fro(stroke + rebound, 0.05, 1e-3)
    assert not _to_and_fro(np.zeros(4000), 0.05, 1e-3)


def test_a_branch_in_which_the_encoder_shows_nothing_does_not_spoil_the_stiffness():
    random, count = np.random.default_rng(1), 1e-6
    up, down = np.linspace(0.0, 0.7, 2000), np.linspace(0.09, -0.08, 60)
    spring = Branch(
        torque=up, position=up / 3000.0 + 1e-6 * random.standard_normal(2000), direction=1, break_away=None
    )
    still = Branch(torque=down, position=2e-6 * (down < 0.0), direction=-1, break_away=None)
    assert still.secant[0] < 0.0  # it moved by two counts against the torque
    resolved, stiffness, elastic = _elastic([still, spring], count)
    assert resolved and elastic
    assert stiffness[0] == pytest.approx(3000.0, rel=0.01)


@pytest.mark.parametrize("rest", [0.3, 0.8, 1.2, 6.0])
@pytest.mark.parametrize("seed", [2, 4, 6])
def test_a_rest_before_the_first_ramp_is_none_of_it(rest, seed):
    torque = np.r_[np.zeros(round(rest * RATE)), corners(0.0, 1.8, -1.8, 0.0)[round(RATE) :]]
    log = ramp_log(torque, noise=0.01, seed=seed)
    found = identify(log)
    friction = found.model.joints[0]
    assert friction.method == "ramp"
    assert friction.law.rate.coulomb_positive == pytest.approx(BREAK, rel=0.02)
    assert friction.law.rate.coulomb_negative == pytest.approx(BREAK, rel=0.02)
    assert friction.dynamics["offset"].value == pytest.approx(0.0, abs=0.01)


def test_a_joint_that_rings_as_the_log_begins_still_breaks_away():
    """The speed at the begin of the first ramp is no creep there."""
    torque = corners(0.0, 1.8, -1.8, 0.0)
    t = np.arange(torque.size) / RATE
    ringing = 0.0005 * np.exp(-t / 2.0) * np.cos(2.0 * np.pi * 11.0 * t)
    position = COUNT * np.round((yielding(torque) + ringing) / COUNT)
    shaken = Log(time=t, joints=(Joint(name="a"),), position=position, torque=torque)
    friction = identify(shaken, method="ramp").model.joints[0]
    assert friction.law.rate.coulomb_negative == pytest.approx(BREAK, rel=0.03)
    assert not any("did not break away along -q" in said for said in friction.warnings)


def test_noise_raises_no_lower_bound():
    """Of 80,000 samples the largest is four standard deviations off."""
    log = ramp_log(corners(0.0, 1.2, -1.2, 0.0, slope=0.03), noise=0.1)
    friction = identify(log, method="ramp").model.joints[0]
    assert 1.1 < friction.law.rate.coulomb_positive <= 1.2
    assert 1.1 < friction.law.rate.coulomb_negative <= 1.2
