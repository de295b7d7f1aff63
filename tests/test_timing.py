"""Tests for identification/timing.py: a commanded torque is told from a sampled one, and neither biases the sweep."""

import numpy as np
import pytest

from backdrive import Log
from backdrive.identification import sweep_delay
from backdrive.identification.signals import prepare
from backdrive.identification.slip import coarse_delay
from backdrive.identification.sweep import identify_sweep
from backdrive.identification.timing import torque_timing
from backdrive.plans import Sweep
from backdrive.simulation.machines import joint_1
from backdrive.simulation.open_loop import simulate

SWEEP = Sweep(np.deg2rad(10.0), 2.0, 8)


@pytest.fixture(scope="module")
def commanded():
    return simulate(joint_1(), SWEEP, seed=3)


@pytest.fixture(scope="module")
def sampled(commanded):
    mean = 0.5 * (commanded.torque[1:] + commanded.torque[:-1])  # what acted around each sample
    return commanded.replace(torque=np.vstack([commanded.torque[:1], mean]))


def test_the_two_are_told_apart(commanded, sampled):
    period = commanded.period
    word, delay, error = torque_timing(prepare(commanded, 0))
    assert (word, pytest.approx(-0.5 * period, abs=0.2 * period)) == ("command", delay)
    assert 0.0 < error < 0.15 * period
    word, delay, _ = torque_timing(prepare(sampled, 0))
    assert (word, pytest.approx(0.0, abs=0.2 * period)) == ("sample", delay)


def test_neither_biases_the_curve_and_the_wrong_word_does(commanded, sampled):
    truth = joint_1().law.torque(1.8)
    for log in (commanded, sampled):
        friction, _ = identify_sweep([log], log.names[0])
        assert float(friction.law.torque(1.8)) == pytest.approx(float(truth), abs=0.06)
    wrong, _ = identify_sweep([sampled], sampled.names[0], timing="command")
    assert abs(float(wrong.law.torque(1.8)) - float(truth)) > 0.3


def test_a_motion_without_inertia_does_not_tell(commanded):
    v = np.gradient(commanded.position[:, 0], commanded.time)
    noise = np.random.default_rng(0).standard_normal(v.size)
    assert torque_timing(prepare(commanded.replace(torque=5.0 * np.sign(v) + 2.0 * v + noise), 0))[0] is None


@pytest.mark.parametrize("late", [0.002, 0.01])
def test_a_late_torque_is_no_sample_though_the_encoder_hides_the_jerk(late):
    rng, count = np.random.default_rng(1), 2.0 * np.pi / 2**17
    sweep = Sweep(np.deg2rad(40.0), 2.0, 10)
    t = np.arange(int(1000 * sweep.duration)) / 1000.0
    q, v = sweep.position(t - late), sweep.velocity(t - late)
    torque = (
        1.0 * np.gradient(v, t)
        + 10.0 * np.sin(q)
        + 5.0 * np.sign(v)
        + 3.0 * v
        + 0.3 * rng.standard_normal(t.size)
    )
    log = Log.from_arrays(time=t, position=count * np.round(sweep.position(t) / count), torque=torque)
    assert torque_timing(prepare(log, 0))[0] is None
    friction, _ = identify_sweep([log], log.names[0])
    speed = np.array(friction.law.rate.velocity)
    off = np.abs(np.array(friction.law.rate.positive) - 5.0 - 3.0 * speed)
    assert np.all(off < 4.0 * np.array(friction.standard_errors["positive"]))
    told = "ms later than", "ms after it acted"
    assert any("torque" in w and any(words in w for words in told) for w in friction.warnings)


def test_a_doubt_about_the_timing_names_its_effect_in_torque(commanded):
    noise = 10.0 * np.random.default_rng(0).standard_normal(len(commanded.time))
    log = commanded.replace(torque=commanded.torque + noise[:, None])
    friction, _ = identify_sweep([log], log.names[0])
    (doubt,) = (w for w in friction.warnings if "hardly its delay" in w)
    amount = float(doubt.split("moves by up to ")[1].split(" N.m, at ")[0])
    curves = [identify_sweep([log], log.names[0], timing=t)[0].law.torque(1.9) for t in ("command", "sample")]
    assert amount == pytest.approx(max(abs(float(c - friction.law.torque(1.9))) for c in curves), rel=0.25)
    assert "V^3" not in doubt


def test_torque_that_comes_late_is_corrected_though_its_delay_is_not_known_to_an_interval(commanded):
    t, tau = commanded.time, commanded.torque[:, 0]
    noise = 4.5 * np.random.default_rng(1).standard_normal(t.size)
    late = commanded.replace(torque=(np.interp(t - 0.05, t, tau) + noise)[:, None])
    friction, evidence = identify_sweep([late], late.names[0])
    assert "ms after it acted; this delay was estimated" in " ".join([*friction.warnings, evidence.verdict])
    slip, period = friction.dynamics["time_slip"], commanded.period
    assert slip.standard_error > 0.5 * period
    assert slip.value == pytest.approx(0.05 - 0.5 * period, abs=3.0 * slip.standard_error)
    (said,) = (w for w in (*friction.warnings, evidence.verdict) if "ms after it acted" in w)
    told = said.split("was logged ")[1].split(" ms")[0].split(" +- ")
    assert [1e-3 * float(x) for x in told] == pytest.approx([slip.value, slip.standard_error], abs=1e-5)
    assert float(friction.law.torque(1.8)) == pytest.approx(float(joint_1().law.torque(1.8)), abs=0.6)


@pytest.mark.parametrize("late", [0.0, 0.005])
def test_the_error_of_the_inertia_of_a_light_joint_includes_that_of_the_delay(late):
    """Late viscous friction is in phase with the acceleration."""
    sweep = Sweep(0.6, 1.4, 12)
    t = np.arange(int(1000 * sweep.duration)) / 1000.0
    q, before = sweep.position(t), sweep.position(t - late)
    v = np.gradient(before, t)
    torque = 0.127 * np.gradient(v, t) + 2.6 * np.sign(v) + 2.2 * v
    torque += 0.02 * np.random.default_rng(5).standard_normal(t.size)
    friction, _ = identify_sweep([Log.from_arrays(time=t, position=q, torque=torque)], "joint_1")
    inertia, slip = (friction.dynamics[name] for name in ("inertia", "time_slip"))
    assert abs(inertia.value - 0.127) < 3.0 * inertia.standard_error < 0.06
    assert abs(slip.value - late) < 3.0 * slip.standard_error


def test_a_vague_delay_is_corrected_if_a_shift_of_the_torque_agrees_and_stated_if_none_does(
    commanded, monkeypatch
):
    t, tau = commanded.time, commanded.torque[:, 0]
    noise = 15.0 * np.random.default_rng(2).standard_normal(t.size)
    late = commanded.replace(torque=(np.interp(t - 0.03, t, tau) + noise)[:, None])
    stretches = prepare(late, 0)
    assert coarse_delay(stretches) is None  # so much noise hides the shift from its own test
    friction, _ = identify_sweep([late], late.names[0])
    slip = friction.dynamics["time_slip"]
    assert slip.value == pytest.approx(0.03 - 0.5 * commanded.period, abs=3.0 * slip.standard_error)
    assert 0.0 < slip.standard_error < 0.005
    monkeypatch.setattr(sweep_delay, "_with_shift", lambda *_: None)
    friction, _ = identify_sweep([late], late.names[0])
    (odd,) = (w for w in friction.warnings if "nothing was corrected" in w)
    stated = float(odd.split("come ")[1].split(" +- ")[0])
    assert stated == pytest.approx(30.0, abs=3.0)
    known = float(odd.split("--known delay=")[1].split(")")[0])
    amount = float(odd.split("off by up to ")[1].split(" N.m")[0])
    curves = [identify_sweep([late], late.names[0], delay=d)[0].law.torque(1.9) for d in (None, known)]
    assert amount == pytest.approx(abs(float(curves[0] - curves[1])), rel=0.3)
    assert friction.dynamics["time_slip"].standard_error > 0.01  # as likely as none
