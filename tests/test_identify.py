"""Tests for identification/__init__.py, auto.py and validate.py: the right method, the right joints, the right refusals."""

from dataclasses import replace

import numpy as np
import pytest

from _synthetic import any_motion, constant_runs
from backdrive import Joint, Log, identify
from backdrive.errors import InvalidInput, NotIdentifiable, UnhealthyLog, UnknownName
from backdrive.identification import validate
from backdrive.identification.log_set import attach_plan
from backdrive.logs.log import Source
from backdrive.logs.readers import read_log
from backdrive.plans import InTurn, Sweep
from backdrive.simulation.machines import joint_0, joint_1
from backdrive.simulation.open_loop import simulate


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
    with pytest.raises(InvalidInput, match="no torque|map=.tau"):
        identify(two_joints().replace(torque=None))
    with pytest.raises(InvalidInput, match="urdf=.ROBOT"):
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
    assert "held out" in same.evidence[0].verdict
    assert "held out: poor" in other.evidence[0].verdict


def test_asking_for_both_directions_is_remembered():
    assert identify(any_motion(dry), symmetric=False).model.options["symmetric"] is False


def test_a_file_cannot_judge_itself():
    source = (Source(path="a.csv", sha256="ab"),)
    log = any_motion(dry).replace(sources=source)
    with pytest.raises(InvalidInput, match="also fitted"):
        identify(log, held_out=[any_motion(dry, seed=1).replace(sources=source)])


def test_a_file_is_fitted_once_and_its_parts_each(tmp_path):
    log = any_motion(dry, seconds=12.0)
    np.savez(tmp_path / "a.npz", t=log.time, q=log.position, tau=log.torque)
    whole = read_log(tmp_path / "a.npz")
    with pytest.raises(InvalidInput, match="are the same log"):
        identify([whole, whole])
    assert identify([whole.between(0.0, 5.9), whole.between(6.0, 12.0)]).model.joints


def test_one_plan_for_all_logs_or_one_each():
    log = any_motion(dry, seconds=2.0)
    plans = [Sweep(0.3, 1.0, 4, center=c) for c in (0.0, 1.0)]
    assert [one.plan.center for one in attach_plan([log, log], plans)] == [0.0, 1.0]
    assert [one.plan.center for one in attach_plan([log, log], plans[1])] == [1.0, 1.0]
    assert attach_plan([log], None) == [log]
    with pytest.raises(InvalidInput, match="2 plans for 3 logs"):
        attach_plan([log] * 3, plans)


@pytest.mark.parametrize(
    "option", [{"literal": True}, {"timing": "sample"}, {"urdf": "robot.urdf", "method": "motion"}]
)
def test_an_option_that_the_method_would_ignore_is_refused(option):
    with pytest.raises(InvalidInput, match="does not apply"):
        identify(any_motion(dry), **option)


def test_joints_in_another_order_are_brought_into_one_and_units_must_agree():
    log = two_joints()
    other = log.select(["wrist", "elbow", "shoulder"])
    both = identify([log, other]).model
    np.testing.assert_allclose(both.torque("elbow", 0.5), identify(log).model.torque("elbow", 0.5), rtol=0.01)
    a, b = any_motion(dry), any_motion(dry, unit="m")
    with pytest.raises(InvalidInput, match="in rad in one log and in m"):
        identify([a, b])


def test_the_environments_torque_counts():
    log = any_motion(dry)
    push = 3.0 * np.sin(np.arange(len(log)) / 700.0)[:, None]
    result = identify(log.replace(torque=log.torque - push, external_torque=push))
    assert float(result.model.torque(0, 0.5)) == pytest.approx(6.0, abs=0.1)
    assert result.model.joints[0].fitted.residual < 5.0


def test_nan_that_is_accepted_is_left_out():
    log = any_motion(dry)
    torque = log.torque.copy()
    torque[5000:5100] = np.nan
    result = identify(log.replace(torque=torque), accept=["nan"])
    assert float(result.model.torque(0, 0.5)) == pytest.approx(6.0, abs=0.15)


def test_a_term_that_cannot_be_predicted_is_an_error_and_not_left_out():
    log = any_motion(dry, gravity=(8.0, 2.0))
    model = identify(log).model
    blind = log.replace(position=None, velocity=np.gradient(log.position, log.time, axis=0))
    with pytest.raises(InvalidInput, match="gravity"):
        validate(model, [blind])


def test_what_is_suspect_in_the_log_is_among_the_warnings():
    log = any_motion(dry)
    result = identify(log.replace(position=log.position * 180 / np.pi, torque=log.torque))
    assert any("degrees" in w for w in result.warnings)


def test_joints_that_move_in_turn_are_cut_to_their_turns_whatever_the_clock():
    a, b = (Sweep(np.deg2rad(20.0), 2.0, 5, joint=name) for name in "ab")
    plan = InTurn((a, b))
    single = {"a": simulate(joint_0(), a, seed=0), "b": simulate(joint_1(), b, seed=0)}
    late, rate = 5.0, 1000
    n = round((late + plan.duration + 1.0) * rate)
    channels = {}
    for channel in ("position", "torque"):
        columns = []
        for name in "ab":
            x = getattr(single[name], channel)[:, 0]
            start = round((late + plan.plan_of(name).start) * rate)
            columns.append(np.r_[np.full(start, x[0]), x, np.full(n - start - x.size, x[-1])])
        channels[channel] = np.column_stack(columns)
    log = Log(time=np.arange(n) / rate, joints=(Joint(name="a"), Joint(name="b")), plan=plan, **channels)
    result = identify(log)
    assert result.method == "sweep"
    for name, plant in (("a", joint_0()), ("b", joint_1())):
        np.testing.assert_allclose(
            result.model.torque(name, [0.6, 1.5]), plant.law.torque(np.array([0.6, 1.5])), atol=0.12
        )


@pytest.mark.parametrize("rate", [500.0, 1000.0])
@pytest.mark.parametrize("known", [True, False])
def test_encoder_steps_lower_the_low_pass_of_any_motion_and_spare_the_inertia(rate, known):
    step = 5e-4
    fine = any_motion(lambda v: 1.5 * np.sign(v) + 0.8 * v, rate=rate, seed=1)
    joint = replace(fine.joints[0], encoder_counts=1.0 / step if known else None)
    coarse = fine.replace(position=step * np.round(fine.position / step), joints=(joint,))
    result = identify(coarse, method="motion")
    (friction,) = result.model.joints
    assert friction.dynamics["inertia"].value == pytest.approx(0.5, rel=0.01)  # it was 0.38 and 0.28
    assert friction.law.torque(np.array([0.5, -1.0])) == pytest.approx([1.9, -2.3], rel=0.01)
    assert "--cutoff" in result.evidence[0].verdict
    assert validate(result.model, [coarse])["j1"].residual == pytest.approx(friction.fitted.residual, rel=0.1)
