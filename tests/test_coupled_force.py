"""External force of an arm whose motors drive several joints: exact torques of the motors, online, from a log and in the loop."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("pinocchio")

from _arm_force import DT, MODEL, MOTORS, OFFSET, PUSH, ROBOT, SLIDING, L, log_of, motion
from _arm_loops import arm_limits, arm_loop, arm_model, six_axis
from backdrive.control import ArmLoop
from backdrive.control.estimators.arm import ArmForce
from backdrive.errors import InvalidInput
from backdrive.external import estimate_force
from backdrive.logs.joint import coupling_between
from backdrive.logs.log import Log

C = np.eye(6)
C[4, 5], C[3, 5] = -0.8, 0.25  # the last motor moves two joints before its own
BACK = np.linalg.inv(C)
COUPLING = tuple(map(tuple, C.tolist()))


def motors_of(wrench, between, coulomb=0.0):
    """Return motor torques by Lagrange's equations in joints, brought to the motors, and what a wrench does to these."""
    q, dq, ddq = between
    outside = np.einsum("nij,ni->nj", ROBOT.jacobian(q, "tip"), np.broadcast_to(wrench, (len(q), 6)))
    bodies = ROBOT.inverse_dynamics(q, dq, ddq)
    p1, p2 = dq @ BACK.T, ddq @ BACK.T
    return (bodies - outside) @ C + MOTORS * p2 + OFFSET + coulomb * np.tanh(p1 / 1e-3), outside @ C


def coupled(model):
    return replace(model, coupling=COUPLING)


@pytest.mark.parametrize("method", ["momentum", "disturbance", "extended", "kalman"])
def test_motors_feel_a_wrench_and_name_it(method):
    (q, dq, _), between = motion()
    u, outside = motors_of(PUSH, between)
    estimator = ArmForce.from_model(coupled(MODEL), ROBOT, method=method, bandwidth=L, frame="tip")
    assert estimator.coupling == COUPLING
    out = estimator.run(q @ BACK.T, u, DT, velocity=dq[0] @ BACK.T)
    late = round(1e3 / L)
    error = (out.force[500 + late :] - outside[500:-late]) / np.abs(outside).max(axis=0)
    assert np.abs(error).max() < 0.03
    good = ~out.singular[500:]
    error = np.abs(out.wrench[500:][good] - PUSH) / np.array([20, 20, 20, 0.8, 0.8, 0.8])
    assert good.mean() > 0.8 and np.quantile(error, 0.95) < 0.3
    # inertia that the motors add to the joints alone, as without the matrix, is felt as a force
    alone = replace(estimator, coupling=None).run(q, u @ BACK, DT, velocity=dq[0])
    there = out.force[500 + late :] @ BACK
    worse = np.abs(alone.force[500 + late :] - outside[500:-late] @ BACK).mean(axis=0)
    assert np.any(worse > 2.0 * np.abs(there - outside[500:-late] @ BACK).mean(axis=0))


def test_inertia_of_bodies_and_motors_is_a_full_matrix():
    estimator = ArmForce.from_model(coupled(MODEL), ROBOT)
    p = np.array([0.1, 0.4, -0.3, 0.2, 0.5, -0.6])
    wanted = C.T @ ROBOT.inertia((C @ p)[None])[0] @ C + np.diag(MOTORS)
    assert estimator.inertia_at(p) == pytest.approx(wanted)
    with pytest.raises(InvalidInput, match="no invertible matrix"):
        replace(estimator, coupling=((1.0, 0.0), (0.0, 1.0)))


def test_a_log_of_coupled_joints_gives_torques_of_the_motors_and_the_wrench():
    plain = log_of(PUSH, n=6000)
    (q, _, _), between = motion(6000)
    push = 0.4 * PUSH
    u, outside = motors_of(push, between, coulomb=0.5)
    u += np.random.default_rng(0).normal(0.0, 0.02, u.shape)
    log = plain.replace(torque=u @ BACK, external_torque=outside @ BACK)
    result = estimate_force(
        coupled(SLIDING), log, robot=ROBOT, frame="tip", method="momentum", bandwidth=60.0
    )
    late = slice(500, -100)
    for j, one in enumerate(result.joints):
        moving = one.state[late] == 0
        assert one.known[late] == pytest.approx(np.interp(one.time, log.time, outside[:, j])[late], abs=1e-9)
        assert np.median(np.abs(one.force - one.known)[late][moving]) < 0.25
    (line,) = [x for x in result.remarks if "drive several joints" in x]
    assert "j3, j4, j5" in line
    clear = ~result.wrench.singular[late]
    assert np.median(np.abs(result.wrench.wrench[late][clear] - push), axis=0) == pytest.approx(
        np.zeros(6), abs=3.0
    )
    motors = Log(time=log.time, joints=log.joints, position=q @ BACK.T, torque=u).apply_coupling(COUPLING)
    same = estimate_force(coupled(SLIDING), motors, robot=ROBOT, method="momentum", bandwidth=60.0)
    assert same.joints[4].force == pytest.approx(result.joints[4].force, abs=1e-6)
    uncoupled = estimate_force(
        SLIDING, log, robot=ROBOT, method="momentum", bandwidth=60.0, accept="torque-share"
    )
    assert not [x for x in uncoupled.remarks if "drive several" in x]


def test_the_loop_knows_what_coupled_motors_add_to_each_other():
    """Along an exact motion of free joints nothing is felt; with the motors' inertia on their own joints alone, something is."""
    robot = six_axis()
    model = replace(arm_model(), coupling=COUPLING)
    inertia = np.array([one.dynamics["inertia"].value for one in model.joints])
    (q, _, _), (middle, dq, ddq) = motion(900)
    loop = ArmLoop.from_model(model, robot, interval=DT, limits=arm_limits(), share=0.0)
    order = [model.names.index(name) for name in robot.joints]
    u = robot.inverse_dynamics(middle, dq, ddq) @ C + inertia[order] * (ddq @ BACK.T)
    friction = np.array(
        [model.joint(name).law.torque(v) for name, v in zip(robot.joints, (dq @ BACK.T).T, strict=True)]
    ).T
    u += friction
    loop.reset(q[0] @ BACK.T)
    felt = np.zeros_like(q)
    for k in range(len(q)):
        loop.update(q[k] @ BACK.T, u[max(k - 1, 0)])
        felt[k] = loop.external
    turning = np.abs(dq @ BACK.T).min(axis=1) > 0.2
    steady = turning & (np.arange(len(q)) > 300)
    assert steady.sum() > 50
    cross = np.abs((BACK.T @ np.diag(inertia[order]) @ BACK - np.diag(inertia[order])) @ ddq.T).T
    for j in (3, 4, 5):
        assert np.median(np.abs(felt[steady, j])) < 0.35 * np.median(cross[steady, j]) + 0.02
    force = ArmForce.from_model(arm_model(), robot)
    with pytest.raises(InvalidInput, match="different couplings"):
        arm_loop(coupling=C, force=force)


def test_a_coupling_follows_the_names_and_is_of_all_joints():
    names = ROBOT.joints[::-1]
    turned = C[::-1, ::-1]
    assert np.array_equal(ROBOT.coupling_of(turned, names), C)
    assert (
        np.array_equal(coupling_between(turned, names, ROBOT.joints), C)
        and ROBOT.coupling_of(None, names) is None
    )
    with pytest.raises(InvalidInput, match="j5, too"):
        ROBOT.coupling_of(C[:5, :5], ROBOT.joints[:5])
