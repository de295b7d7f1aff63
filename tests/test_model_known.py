"""What identification tells a model beside law and dynamics, on logs whose truth is known."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from _synthetic import any_motion, constant_runs
from backdrive import identify
from backdrive.model.file import decode, encode

NOISE = 0.05


def friction(v):
    return 5.0 * np.sign(v) + 2.0 * v


def stated(joint) -> dict[str, float]:
    """The standard errors that a model states, by row of a covariance."""
    rows = {name: e.standard_error for name, e in joint.dynamics.items()}
    for name, errors in joint.standard_errors.items():
        many = isinstance(errors, tuple)
        rows |= {f"{name}[{i}]": e for i, e in enumerate(errors)} if many else {name: errors}
    return rows


@pytest.fixture(scope="module")
def of_motion():
    return identify(any_motion(friction, noise=NOISE, delay=2e-3, gravity=(3.0, 1.0)), method="motion").model


@pytest.fixture(scope="module")
def of_search():
    return identify(any_motion(friction, noise=NOISE, seconds=12.0), law="coulomb-viscous").model


@pytest.fixture(scope="module")
def of_runs():
    return identify(constant_runs(friction, [0.2, 0.5, 1.0, 2.0, 3.0]), method="constant-velocity").model


@pytest.mark.parametrize("kind", ["of_motion", "of_search", "of_runs"])
def test_the_standard_errors_are_those_of_the_covariance(kind, request):
    (joint,) = request.getfixturevalue(kind).joints
    errors = stated(joint)
    assert set(joint.covariance.names) <= set(errors)
    assert set(joint.law.rate.PARAMETERS) <= {name.partition("[")[0] for name in joint.covariance.names} | {
        "velocity"
    }
    for row, error in joint.covariance.standard_errors().items():
        assert errors[row] == pytest.approx(error, rel=1e-9)


def test_numbers_that_trade_against_each_other_are_correlated(of_motion, of_search):
    for model in (of_motion, of_search):
        covariance = model.joints[0].covariance
        names, matrix = covariance.names, covariance.array()
        a, b = names.index("coulomb_positive"), names.index("viscous_positive")
        assert matrix[a, b] < -0.3 * np.sqrt(matrix[a, a] * matrix[b, b])


def test_delay_noise_and_bands_are_those_of_the_log(of_motion):
    (joint,) = of_motion.joints
    channel, bands = joint.torque_channel, joint.bands
    assert channel.delay == pytest.approx(2e-3, abs=4 * channel.delay_error + 2e-4)
    assert channel.noise == pytest.approx(NOISE, rel=0.15)
    assert 0.0 < channel.long_run < NOISE
    assert bands.moving.half_width == pytest.approx(1.96 * NOISE, rel=0.25)
    assert bands.reversing.half_width >= 0.8 * bands.moving.half_width and bands.reversing.samples >= 20
    assert bands.rest is None
    assert 0.0 < joint.validity.lowest_speed < joint.validity.velocity[1]
    low, high = joint.validity.load
    assert 0.0 < joint.validity.nominal_load < max(-low, high)


def test_every_method_states_its_side_and_verdict(of_motion, of_search, of_runs):
    for model in (of_motion, of_search, of_runs):
        (joint,) = model.joints
        assert joint.friction_side == "joint" and joint.verdict.grade == "good"
        assert joint.verdict.text.startswith("Friction is")
        assert encode(decode(encode(model))) == encode(model)
    assert of_runs.joints[0].validity.lowest_speed == pytest.approx(0.2, rel=0.02)
    assert of_runs.joints[0].bands is None and of_runs.joints[0].torque_channel.delay is None


def test_names_are_told_from_those_that_were_made_up(tmp_path):
    from backdrive import read_log

    log = any_motion(friction, seconds=10.0)
    rows = np.column_stack([log.time, log.position, log.torque])
    path = tmp_path / "log.csv"
    np.savetxt(path, rows, delimiter=",", header="t,q,tau", comments="")
    assert read_log(path).joints[0].named is False
    assert read_log(path, names="elbow").joints[0].named is True
    assert replace(log.joints[0], named=True) == log.joints[0]  # the same joint, whoever named it


def test_limits_are_those_of_the_description(tmp_path):
    from backdrive.identification.supplement import supplement
    from backdrive.plans.limits import read_limits

    limit = '<limit lower="-1" upper="1" effort="40" velocity="2"/>'
    joint = f'<joint name="elbow" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>{limit}</joint>'
    path = tmp_path / "r.urdf"
    path.write_text(f'<robot name="r"><link name="a"/><link name="b"/>{joint}</robot>')
    log = any_motion(friction, noise=NOISE)
    log = log.replace(joints=(replace(log.joints[0], name="elbow"),))
    result = identify(log)
    known = supplement(result.model.joints[0], result.evidence[0], [log], read_limits(path))
    assert (known.actuator.torque_limit, known.actuator.trip_speed) == (40.0, 2.0)
    assert result.model.joints[0].actuator is None


def test_an_open_drive_has_a_gain_and_a_limit():
    from backdrive.engine import Axis, DriveModel
    from backdrive.identification.dynamic.motion_task import actuator_of
    from backdrive.laws import Coulomb, Law

    law = Law(rate=Coulomb(coulomb=1.0))
    motor = DriveModel(
        actuator="motor", gain=0.5, supply=24.0, torque_constant=2.0, resistance=4.0, limit=1.0
    )
    found = actuator_of(Axis(law=law, inertia=0.3, drive=motor))
    assert (found.gain, found.torque_limit, found.motor_inertia) == (6.0, 12.0, None)
    plain = actuator_of(
        Axis(law=law, inertia=0.3, load_inertia=1.0, stiffness=1e4, drive=DriveModel(controller="position"))
    )
    assert (plain.gain, plain.torque_limit, plain.motor_inertia) == (None, None, 0.3)
