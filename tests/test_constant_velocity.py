"""Tests for identification/constant_velocity.py."""

import numpy as np
import pytest

from _synthetic import constant_runs
from backdrive import Joint, Log, identify
from backdrive.errors import NotIdentifiable
from backdrive.identification.constant_velocity import identify_constant_velocity
from backdrive.identification.runs import find_runs

SPEEDS = (0.02, 0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0, 1.3, 1.6, 2.0)


def bent(v):
    return np.sign(v) * (3.0 + 2.0 * np.exp(-abs(v) / 0.15) + abs(v))


def straight(v):
    return np.where(np.asarray(v) > 0, 3.0 + 0.5 * v, -2.0 + 0.8 * v)


def test_a_straight_line_suffices_where_the_truth_is_one():
    friction, evidence = identify_constant_velocity(constant_runs(straight, SPEEDS), "j1")
    assert "suffices" in evidence.verdict
    law = friction.law.rate
    assert law.NAME == "coulomb-viscous"
    np.testing.assert_allclose(
        [law.coulomb_positive, law.coulomb_negative, law.viscous_positive, law.viscous_negative],
        [3.0, 2.0, 0.5, 0.8],
        atol=0.02,
    )


def test_a_bent_curve_is_called_bent_and_followed():
    friction, evidence = identify_constant_velocity(constant_runs(bent, SPEEDS), "j1")
    assert "bent" in evidence.verdict
    v = np.array([0.05, 0.2, 0.6, 1.6])
    np.testing.assert_allclose(friction.law.torque(v), bent(v), atol=0.25)
    assert friction.held_out.residual < 8.0


def test_one_wild_sample_does_not_move_a_run():
    logs = constant_runs(straight, SPEEDS)
    torque = logs[0].torque.copy()
    torque[0] = -800.0
    expected = find_runs(logs[0], 0)[0].torque
    assert find_runs(logs[0].replace(torque=torque), 0)[0].torque == pytest.approx(expected, abs=0.02)


def test_plateaus_are_found_in_one_long_log():
    rate, levels = 200.0, (0.5, -0.5, 1.0, -1.0, 1.5, -1.5)
    v = np.concatenate(
        [np.r_[np.linspace(0, s, 100), np.full(400, s), np.linspace(s, 0, 100)] for s in levels]
    )
    log = Log(time=np.arange(v.size) / rate, joints=(Joint(name="j1"),), velocity=v, torque=straight(v))
    runs = find_runs(log, "j1")
    np.testing.assert_allclose([r.velocity for r in runs], levels, rtol=0.02)
    np.testing.assert_allclose([r.torque for r in runs], straight(np.array(levels)), atol=0.05)


def test_stick_slip_is_said():
    logs = constant_runs(straight, SPEEDS)
    jerky = np.tile([0.0, 0.0, 0.0, 0.08], 75)
    friction, _ = identify_constant_velocity([logs[0].replace(velocity=jerky), *logs[1:]], "j1")
    assert any("stick-slip" in w for w in friction.warnings)


def test_symmetric_gives_an_offset():
    friction, _ = identify_constant_velocity(
        constant_runs(lambda v: np.sign(v) * (3 + 0.5 * abs(v)), SPEEDS, offset=1.2), "j1", symmetric=True
    )
    assert friction.dynamics["offset"].value == pytest.approx(1.2, abs=0.02)


def test_gravity_is_not_taken_for_friction_that_pushes():
    logs = constant_runs(lambda v: np.sign(v) * (3 + 0.5 * abs(v)), SPEEDS, offset=30.0)
    friction, _ = identify_constant_velocity(logs, "j1")
    assert friction.dynamics["offset"].value == pytest.approx(30.0, abs=0.05)
    np.testing.assert_allclose(friction.law.torque([1.0, -1.0]), [3.5, -3.5], atol=0.05)


def test_gravity_that_turns_with_the_joint_is_seen_inside_the_runs():
    friction_at, logs = (lambda v: np.sign(v) * (3 + 0.5 * abs(v))), []
    for v in (0.2, 0.5, 1.0, 1.5, 2.0, -0.2, -0.5, -1.0, -1.5, -2.0):
        time = np.arange(300) * 0.5 / 300 / abs(v)
        q = v * time - np.sign(v) * 0.1
        tau = friction_at(v) + 20.0 * np.cos(q) + 5.0 * np.sin(q)
        logs.append(Log(time=time, joints=(Joint(name="j1"),), position=q, torque=tau))
    friction, _ = identify_constant_velocity(logs, "j1")
    assert friction.dynamics["gravity_cos"].value == pytest.approx(20.0, abs=0.01)
    np.testing.assert_allclose(friction.law.torque([1.0, -1.0]), [3.5, -3.5], atol=0.01)


def under_gravity(size, rng, noise):
    """Return logs of both directions at seven speeds under gravity, with a line of friction."""
    logs = []
    for v in [way * 0.3 * k for k in range(1, 8) for way in (1.0, -1.0)]:
        time = np.arange(1000) / 500.0
        q = v * time + rng.uniform(0.0, 2.0 * np.pi)
        tau = np.sign(v) * (3.0 + 0.5 * abs(v)) + size * np.sin(q) + noise * rng.standard_normal(1000)
        logs.append(Log(time=time, joints=(Joint(name="j1", unit="rad"),), position=q, torque=tau))
    return logs


def test_gravity_that_noise_hides_in_a_run_is_no_bend():
    """It explains a fiftieth of what varies within the runs, but many of them agree on it."""
    friction, evidence = identify_constant_velocity(under_gravity(0.08, np.random.default_rng(3), 0.4), "j1")
    assert friction.dynamics["gravity_sin"].value == pytest.approx(0.08, abs=0.03)
    assert "suffices" in evidence.verdict


def test_the_error_of_gravity_is_in_that_of_friction():
    rng, errors = np.random.default_rng(5), []
    for _ in range(40):
        friction, _ = identify_constant_velocity(under_gravity(5.0, rng, 0.2), "j1", law="coulomb-viscous")
        stated = friction.standard_errors["coulomb_positive"]
        errors.append((friction.law.rate.coulomb_positive - 3.0) / stated)
    assert 0.6 < np.sqrt(np.mean(np.square(errors))) < 1.4


def test_too_few_runs_are_refused_with_the_number_needed():
    with pytest.raises(NotIdentifiable, match="at least 4|At least 4"):
        identify_constant_velocity(constant_runs(straight, (1.0,)), "j1")


def test_a_start_and_an_encoders_noise_leave_a_run_what_it_is():
    rng = np.random.default_rng(0)
    time = np.arange(3000) * 1e-3
    logs = []
    for v in (0.1, 0.3, 0.6, 1.0, 2.0):
        for way in (1.0, -1.0):
            velocity = way * v * np.clip(time / 0.3, 0.0, 1.0)
            torque = 1.5 * way + 0.4 * velocity + 0.15 * np.gradient(velocity, time)
            position = np.cumsum(velocity) * 1e-3 + 1e-3 * rng.standard_normal(
                time.size
            )  # a third runs backwards
            noisy = torque + 0.05 * rng.standard_normal(time.size)
            logs.append(Log(time=time, joints=(Joint(name="a"),), position=position, torque=noisy))
    result = identify(logs)
    law = result.model.joints[0].law.rate
    assert result.method == "constant-velocity"
    assert (law.coulomb_positive, law.viscous_negative) == (
        pytest.approx(1.5, abs=0.01),
        pytest.approx(0.4, abs=0.01),
    )


def test_a_straight_line_is_not_sure_where_a_peak_begins():
    """A slowest speed alone shows the peak, so that a line suffices; its error there counts what it misses."""

    def peaked(v):
        return np.sign(v) * (3.0 + 0.4 * np.exp(-((v / 0.05) ** 2)) + 0.5 * np.abs(v))

    far = []
    for truth in (peaked, lambda v: np.sign(v) * (3.0 + 0.5 * np.abs(v))):
        _, evidence = identify_constant_velocity(
            constant_runs(truth, SPEEDS), "j1", symmetric=True, law="coulomb-viscous"
        )
        v, torque, error = evidence.curve.velocity, evidence.curve.torque, evidence.curve.standard_error
        at = np.argmin(np.abs(v - SPEEDS[0]))
        far.append(abs(torque[at] - truth(v[at])) / error[at])
        middle = np.argmin(np.abs(v - 0.6))
        assert error[middle] < 0.1 * error[at] or truth is not peaked
    assert max(far) < 2.5
