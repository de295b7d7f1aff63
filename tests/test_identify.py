"""Tests for identification/__init__.py, auto.py and validate.py: the right method, the right joints, the right refusals."""

import numpy as np
import pytest

from _synthetic import any_motion, constant_runs
from backdrive import Joint, Log, identify
from backdrive.errors import InvalidInput, NotIdentifiable, UnhealthyLog, UnknownName
from backdrive.identification import validate


def dry(v):
    return 5.0 * np.sign(v) + 2.0 * v


def two_joints() -> Log:
    a, b = any_motion(dry, seconds=20.0), any_motion(lambda v: 2 * dry(v), seconds=20.0, seed=1, phase=3.0)
    still = np.full((len(a), 1), 0.3)
    return Log(
        time=a.time,
        joints=tuple(Joint(name=n) for n in ("shoulder", "elbow", "wrist")),
        position=np.hstack([a.position, b.position, still]),
        torque=np.hstack([a.torque, b.torque, 0.1 * a.torque]),
    )


def test_motion_is_chosen_for_motion_and_idle_joints_are_left_out_with_a_word():
    result = identify(two_joints())
    assert result.method == "motion"
    assert result.model.names == ("shoulder", "elbow")
    assert any("wrist" in w for w in result.warnings)
    assert float(result.model.torque("elbow", 0.5)) == pytest.approx(12.0, abs=0.2)


def test_constant_velocity_is_chosen_for_steady_runs():
    result = identify(constant_runs(dry, (0.1, 0.4, 0.8, 1.2, 1.6)))
    assert result.method == "constant-velocity"
    assert "one velocity" in result.reason


def test_the_joints_wanted_are_those_identified():
    assert identify(two_joints(), joints=["elbow"]).model.names == ("elbow",)
    with pytest.raises(UnknownName, match="shoulder, elbow, wrist"):
        identify(two_joints(), joints=["knee"])


def test_a_wanted_joint_that_rests_is_an_error():
    with pytest.raises((NotIdentifiable, UnhealthyLog)):
        identify(two_joints(), joints=["wrist"])


def test_unknown_method_no_log_no_torque_and_no_urdf_are_named():
    with pytest.raises(UnknownName, match="constant-velocity"):
        identify(two_joints(), method="constant")
    with pytest.raises(InvalidInput, match="no log"):
        identify([])
    with pytest.raises(InvalidInput, match="no torque|--map tau"):
        identify(two_joints().replace(torque=None))
    with pytest.raises(InvalidInput, match="--urdf"):
        identify(two_joints(), method="arm")
    with pytest.raises(InvalidInput, match="different joints"):
        identify([two_joints(), any_motion(dry)])


def test_nan_stops_the_run_unless_repaired():
    log = any_motion(dry)
    torque = log.torque.copy()
    torque[100] = np.nan
    spoiled = log.replace(torque=torque)
    with pytest.raises(UnhealthyLog, match="nan"):
        identify(spoiled)
    result = identify(spoiled, repair=True)
    assert float(result.model.torque(0, 0.5)) == pytest.approx(6.0, abs=0.15)
    assert any("NaN" in n or "nan" in n for n in result.notes)


def test_validate_judges_every_shared_joint():
    result = identify(two_joints())
    qualities = validate(result.model, [two_joints()])
    assert set(qualities) == {"shoulder", "elbow"}
    assert qualities["shoulder"].residual == pytest.approx(result.model.joints[0].fitted.residual, rel=1e-9)
    with pytest.raises(InvalidInput, match="share no joint"):
        validate(result.model, [any_motion(dry)])


def test_a_velocity_only_log_of_motion_is_identified_too():
    log = any_motion(dry)
    velocity = np.gradient(log.position, log.period, axis=0)
    result = identify(log.replace(position=None, velocity=velocity), method="motion")
    assert float(result.model.torque(0, 0.5)) == pytest.approx(6.0, abs=0.15)


def test_options_and_digests_are_remembered():
    result = identify(two_joints(), symmetric=True)
    assert result.model.options == {"method": "motion", "symmetric": True}


def test_a_law_can_be_asked_for():
    log = any_motion(lambda v: np.sign(v) * (4 + 2 * np.exp(-np.abs(v) / 0.1) + 1.5 * np.abs(v)))
    assert identify(log).model.joints[0].law.rate.NAME == "polyline"
    assert identify(log, law="coulomb-viscous").model.joints[0].law.rate.NAME == "coulomb-viscous"
    with pytest.raises(UnknownName, match="polyline"):
        identify(log, law="stribeck")


def test_held_out_logs_are_judged_by_every_method():
    runs = constant_runs(dry, (0.1, 0.4, 0.8, 1.2, 1.6))
    same = identify(runs, held_out=constant_runs(dry, (0.3, 1.0), seed=3))
    other = identify(runs, held_out=constant_runs(lambda v: 2 * dry(v), (0.3, 1.0), seed=3))
    assert same.model.joints[0].held_out.residual < 5.0 < 40.0 < other.model.joints[0].held_out.residual
    assert "held-out" in same.evidence[0].verdict


def test_asking_for_both_directions_is_remembered():
    assert identify(any_motion(dry), symmetric=False).model.options["symmetric"] is False
