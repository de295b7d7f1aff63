"""External torque and wrench of a whole arm against rigid bodies whose torque is exact, online and from a log."""

import tracemalloc
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pinocchio")

from _arm_force import (
    DT,
    MODEL,
    MOTORS,
    OFFSET,
    PUSH,
    ROBOT,
    SLIDING,
    TEXT,
    L,
    log_of,
    model_of,
    motion,
    text_of,
    torque_of,
)
from backdrive.control.estimators.arm import ArmForce
from backdrive.control.estimators.arm_bodies import with_masses
from backdrive.control.estimators.external import ExternalForce
from backdrive.control.estimators.sliding_mode import MotionFilter
from backdrive.errors import InvalidInput, NotIdentifiable, UnknownName
from backdrive.external import arm, estimate_force
from backdrive.laws import Growth
from backdrive.logs.log import Joint, Log
from backdrive.robot import parse_robot
from backdrive.status import Status

METHODS = ("direct", "momentum", "disturbance", "extended", "kalman")


@pytest.mark.parametrize("method", METHODS)
def test_a_wrench_that_stays_is_estimated_as_it_is(method):
    (q, dq, _), between = motion()
    wrench = np.array([12.0, -8.0, 20.0, 0.6, -0.4, 0.3])
    u, outside = torque_of(wrench, between)
    estimator = ArmForce.from_model(MODEL, ROBOT, method=method, bandwidth=L, frame="tip")
    if method == "direct":  # without friction there is no measure of how abruptly the joints may accelerate
        estimator = estimator.replace(filters=(MotionFilter.of_bandwidth(L, 8.0),) * 6)
    out = estimator.run(q, u, DT, velocity=dq[0])
    late = round(1e3 / L)  # of `direct` that is the most
    error = (out.force[500 + late :] - outside[500:-late]) / np.abs(outside).max(axis=0)
    assert np.abs(error).max() < (0.12 if method == "direct" else 0.02)
    good = ~out.singular[500:]
    assert good.mean() > 0.9
    error = np.abs(out.wrench[500:][good] - wrench) / np.array([20, 20, 20, 0.8, 0.8, 0.8])
    assert np.quantile(error, 0.95) < (0.4 if method == "direct" else 0.25)


@pytest.mark.parametrize("method", METHODS[1:])
def test_a_force_that_grows_steadily_is_followed_by_the_stated_lag(method):
    (q, _, _), between = motion(amplitude=0.0)
    t = np.arange(q.shape[0]) * DT
    u, _ = torque_of(np.zeros(6), between)
    ramp = np.outer(t, [5.0, 4.0, 3.0, 0.5, 0.4, 0.3])
    estimator = ArmForce.from_model(MODEL, ROBOT, method=method, bandwidth=L)
    # the joints rest while motor and environment balance: what the motor gives less is the environment's
    out = estimator.run(q, u - (ramp + 0.5 * DT * ramp[1] / DT), DT)
    late = (ramp[-1] - out.force[-1]) / (ramp[1] / DT)
    assert estimator.lag(DT) == pytest.approx(1.0 / L + DT, rel=1e-6)
    np.testing.assert_allclose(late, 1.0 / L, atol=1.5 * DT)


def test_momentum_and_disturbance_agree_and_friction_is_taken_off():
    (q, dq, _), between = motion()
    u, outside = torque_of(np.array([5.0, 0, 0, 0, 0, 0]), between)
    model = model_of(coulomb=0.7)
    u = u + 0.7 * np.sign(between[1])
    runs = [
        ArmForce.from_model(model, ROBOT, method=m, bandwidth=L).run(q, u, DT, velocity=dq[0])
        for m in ("momentum", "disturbance")
    ]
    np.testing.assert_allclose(runs[0].force, runs[1].force, atol=0.02)
    sliding = np.abs(dq[500:]) > 0.3
    error = np.abs(runs[0].force[500:] - outside[500:])
    assert np.quantile(error[sliding], 0.95) < 0.25
    assert np.abs(runs[0].friction[500:][sliding]).min() > 0.6


def test_friction_that_grows_sees_what_the_environment_carries():
    (q, dq, _), between = motion()
    growth = Growth(load_driving=0.1, load_driven=0.1)
    u, outside = torque_of(np.array([0.0, 0, 60.0, 0, 0, 0]), between)
    dq_, ddq_ = between[1:]
    carried = ROBOT.inverse_dynamics(between[0], dq_, ddq_) - outside
    u = u + np.sign(dq_) * (0.5 + 0.1 * np.abs(carried))
    errors = []
    for law in (growth, None):
        model = model_of(coulomb=0.5, growth=law)
        out = ArmForce.from_model(model, ROBOT, method="extended", bandwidth=L).run(q, u, DT, velocity=dq[0])
        sliding = np.abs(dq[400:-100, 1]) > 0.3  # for a while
        errors.append(np.sqrt(np.mean((out.force[500:, 1] - outside[483:-17, 1])[sliding] ** 2)))
    assert errors[0] < 0.2 * errors[1]


def test_a_singular_posture_says_so_and_stays_finite():
    q = np.zeros((400, 6))
    q[:, :] = [0.0, 0.0, 0.0, 0.3, 0.0, -0.3]  # the wrist is straight, axes 4 and 6 are one line
    out = ArmForce.from_model(MODEL, ROBOT, bandwidth=L, frame="tip").run(q, np.zeros((400, 6)), DT)
    assert out.singular.all()
    assert np.all(np.isfinite(out.wrench))
    bent = q.copy()
    bent[:, 2], bent[:, 4] = 0.9, 0.9
    good = ArmForce.from_model(MODEL, ROBOT, bandwidth=L, frame="tip").run(bent, np.zeros((400, 6)), DT)
    assert not good.singular.any()
    variance = np.diagonal(out.covariance[-1]).max() / np.diagonal(good.covariance[-1]).max()
    assert variance > 5.0


def test_bad_readings_give_a_status_and_leave_the_results():
    running = ArmForce.from_model(MODEL, ROBOT, bandwidth=L, frame="tip").online(DT)
    q, u = np.full(6, 0.4), np.zeros(6)
    for _ in range(50):
        assert running.tick(q, u) is Status.OK
    force, wrench = running.force.copy(), running.wrench.copy()
    assert np.abs(force).max() > 1.0  # nothing holds the weight: something else does
    assert running.tick(q * np.nan, u) is Status.NOT_FINITE
    assert running.tick(q, u, interval=0.0) is Status.BAD_INTERVAL
    np.testing.assert_array_equal(running.force, force)
    np.testing.assert_array_equal(running.wrench, wrench)
    assert running.tick(q, u) is Status.OK
    running.reset()
    assert not running.force.any()


def test_no_reading_raises_and_a_jump_is_not_believed():
    running = ArmForce.from_model(MODEL, ROBOT, bandwidth=L, frame="tip").online(DT)
    q, u = np.full(6, 0.4), np.zeros(6)
    assert running.tick(q * np.nan, u) is Status.NOT_FINITE
    for _ in range(50):
        assert running.tick(q, u) is Status.OK
    force = running.force.copy()
    assert running.tick(np.zeros(5), u) is Status.NOT_FINITE
    assert running.tick(q, u, temperature=np.zeros(3)) is Status.NOT_FINITE
    assert running.tick(None, u) is Status.NOT_FINITE
    assert running.tick(q + 1e9, u) is Status.JUMP
    np.testing.assert_array_equal(running.force, force)
    assert running.tick(q, u) is Status.OK
    assert running.force == pytest.approx(force, rel=0.1, abs=1.0)
    told = [running.tick(q + 7.0, u) for _ in range(100)]
    assert told[0] is Status.JUMP and told[-1] is Status.OK and np.abs(running.force).max() < 500.0


def test_a_tick_keeps_no_memory():
    running = ArmForce.from_model(MODEL, ROBOT, method="extended", bandwidth=L, frame="tip").online(DT)
    q, u = np.full(6, 0.4), np.zeros(6)
    for _ in range(100):
        running.tick(q, u)
    tracemalloc.start()
    before = tracemalloc.take_snapshot()
    for _ in range(1000):
        running.tick(q, u)
    after = tracemalloc.take_snapshot()
    tracemalloc.stop()
    grown = sum(x.size_diff for x in after.compare_to(before, "filename") if "backdrive" in str(x.traceback))
    assert grown < 2000


def test_a_tool_frame_and_the_order_of_the_joints_are_the_robots():
    shuffled = model_of(joints=tuple(reversed(MODEL.joints)))
    estimator = ArmForce.from_model(shuffled, ROBOT, frame="tip")
    assert estimator.joints == ROBOT.joints
    assert estimator.inertia == tuple(MOTORS)


def test_what_does_not_fit_is_named(tmp_path):
    with pytest.raises(UnknownName, match=r"no frame 'hand'.*tip"):
        ArmForce.from_model(MODEL, ROBOT, frame="hand")
    with pytest.raises(InvalidInput, match=r'method="arm"'):
        ArmForce.from_model(model_of(arm=None), ROBOT)
    other = parse_robot(
        '<mujoco><worldbody><body><joint name="x"/><geom size="1"/></body></worldbody></mujoco>'
    )
    with pytest.raises(InvalidInput, match=r"another robot description"):
        ArmForce.from_model(MODEL, other)
    with pytest.raises(InvalidInput, match=r"\(10, 5\).*6 joints"):
        ArmForce.from_model(MODEL, ROBOT).run(np.zeros((10, 5)), np.zeros((10, 5)), DT)
    with pytest.raises(InvalidInput, match=r"bandwidth"):
        ArmForce.from_model(MODEL, ROBOT, bandwidth=-1.0)
    with pytest.raises(InvalidInput, match="period"):
        ArmForce.from_model(MODEL, ROBOT).online(0.0)
    assert not list(Path(tmp_path).iterdir())


def test_fewer_than_six_joints_tell_the_part_of_a_wrench_that_they_feel():
    short = parse_robot(text_of(4))
    q = np.tile([0.2, 0.5, 0.7, 0.3], (400, 1))
    jacobian = short.jacobian(q[:1], "tip")[0]
    wrench = np.array([12.0, -8.0, 20.0, 0.5, -1.0, 0.3])
    torque = short.gravity(q) + OFFSET[:4] - jacobian.T @ wrench
    out = ArmForce.from_model(model_of(short), short, bandwidth=L, frame="tip").run(q, torque, DT)
    assert jacobian.T @ out.wrench[-1] == pytest.approx(jacobian.T @ wrench, abs=0.1)
    directions = np.linalg.svd(jacobian)[0]
    seen, hidden = (
        np.einsum("in,ij,jn->n", part, out.covariance[-1], part) for part in np.split(directions, [4], axis=1)
    )
    assert out.singular.all() and hidden.min() > 10.0 * seen.min() and np.isfinite(out.covariance).all()
    log = Log(
        time=np.arange(400) * DT, position=q, torque=torque, joints=tuple(Joint(name=n) for n in short.joints)
    )
    told = estimate_force(model_of(short), log, robot=short, frame="tip", method="momentum", bandwidth=L)
    assert any("4 joints can observe at most 4 of its 6 components" in line for line in told.remarks)


def test_one_door_for_joints_and_arms():
    assert isinstance(ExternalForce.from_model(MODEL, ROBOT, method="extended"), ArmForce)
    assert isinstance(ExternalForce.from_model(model_of(arm=None), "j1"), ExternalForce)
    with pytest.raises(InvalidInput, match=r"whole arm.*'j1'.*ArmForce"):
        ExternalForce.from_model(MODEL, "j1")


def test_a_description_may_be_named_by_a_plain_string(tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(TEXT)
    assert isinstance(ExternalForce.from_model(MODEL, str(path)), ArmForce)


def test_links_get_a_mass_where_no_joint_feels_it():
    theta = ROBOT.parameters.copy()
    theta[0] = -2.0  # the first link only turns about a vertical axis: nobody feels its mass
    made = with_masses(ROBOT, theta)
    np.testing.assert_allclose(ROBOT.base.relation @ made, ROBOT.base.relation @ theta, atol=1e-8)
    assert made[::10].min() > 0.0
    rail = parse_robot(
        '<mujoco><worldbody><body><joint name="x" type="slide"/><geom size="1"/></body></worldbody></mujoco>'
    )
    with pytest.raises(NotIdentifiable, match=r"negative mass.*x"):
        with_masses(rail, -rail.parameters)


def test_a_log_gives_torques_and_the_wrench_at_a_frame(tmp_path):
    log = log_of(PUSH)
    estimate = estimate_force(SLIDING, log, robot=ROBOT, frame="tip", method="extended", bandwidth=60.0)
    assert [j.joint.name for j in estimate.joints] == list(ROBOT.joints)
    for one in estimate.joints:
        assert one.known is not None
        moving = one.state == 0
        assert np.sqrt(np.mean((one.force - one.known)[moving] ** 2)) < 0.1
    wrench = estimate.wrench
    assert wrench is not None
    good = ~wrench.singular & np.all([j.state == 0 for j in estimate.joints], axis=0)
    assert good.sum() > 500
    error = (wrench.wrench - PUSH)[good]
    assert np.sqrt(np.mean(error[:, :3] ** 2)) < 2.0
    assert np.sqrt(np.mean((error / wrench.deviation[good]) ** 2)) < 1.5
    np.testing.assert_allclose(np.median(wrench.known[good], axis=0), PUSH, rtol=0.06)  # type: ignore[index]
    estimate.save(tmp_path / "force.csv")
    heading = (tmp_path / "force.csv").read_text().splitlines()[0]
    assert "j0_force [N.m]" in heading
    assert "tip_fx [N],tip_fx_sd [N]" in heading
    assert heading.endswith("tip_singular")


def test_the_method_and_its_bandwidth_are_one_for_the_whole_arm():
    estimate = estimate_force(SLIDING, log_of(PUSH), robot=ROBOT)
    assert len({(j.method, j.bandwidth) for j in estimate.joints}) == 1
    assert estimate.wrench is None


def test_free_motion_calibrates_the_bands_of_an_arm():
    free = [log_of(np.zeros(6), seed=3)]
    estimate = estimate_force(
        SLIDING, log_of(PUSH), robot=ROBOT, frame="tip", method="momentum", bandwidth=60.0, free=free
    )
    assert set(estimate.calibrations) == set(ROBOT.joints)
    for one in estimate.joints:
        assert one.known is not None
        moving = one.state == 0
        inside = (one.lower <= one.known) & (one.known <= one.upper)
        assert inside[moving].mean() > 0.6  # a torque that follows the posture is late, too
        assert np.median((one.upper - one.lower)[moving]) < 0.5  # the model's own is 0.6


def test_logs_that_are_not_of_this_arm_are_refused():
    log = log_of(PUSH, n=3000)
    with pytest.raises(InvalidInput, match=r"whole arm.*urdf"):
        estimate_force(SLIDING, log)
    with pytest.raises(InvalidInput, match=r"sign turned round|most of the joints"):
        estimate_force(SLIDING, log.replace(torque=-log.torque), robot=ROBOT)
    order = ("j1", "j0", "j3", "j2", "j5", "j4")
    with pytest.raises(InvalidInput, match=r"order or sign of the joints differ"):
        estimate_force(SLIDING, log_of(PUSH, n=3000, names=order), robot=ROBOT)
    with pytest.raises(InvalidInput, match=r"'j0'.*look like degrees"):
        estimate_force(SLIDING, log.replace(position=np.rad2deg(log.position)), robot=ROBOT)
    with pytest.raises(InvalidInput, match=r"Not in the log: j1"):
        estimate_force(SLIDING, log.select("j0"), robot=ROBOT)
    with pytest.raises(UnknownName, match="one of|One of"):
        estimate_force(SLIDING, log, robot=ROBOT, frame="gripper")
    bad = log.torque.copy()
    bad[500:520, 2] = np.nan
    estimate = estimate_force(SLIDING, log.replace(torque=bad), robot=ROBOT, bandwidth=60.0)
    assert np.all(np.isfinite(estimate.joint("j2").force))


def test_an_observer_that_runs_away_is_not_chosen():
    usual = [(np.arange(5.0), np.ones((5, 6)))]
    away = [(np.arange(5.0), np.full((5, 6), 1e6)), (np.arange(2.0), np.full((2, 6), np.nan))]
    assert arm._settles(usual, usual)
    assert not arm._settles(away[:1], usual)
    assert not arm._settles(away[1:], usual)
