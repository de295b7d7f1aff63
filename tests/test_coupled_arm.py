"""Motors that drive several joints: the arm's fit with their matrix, and its remark where nobody gave one."""

import numpy as np
import pytest

from backdrive.errors import InvalidInput
from backdrive.logs.joint import coupling_between
from backdrive.logs.log import Joint, Log

pytest.importorskip("pinocchio")

from backdrive.identification import identify
from backdrive.identification.arm import identify_arm
from backdrive.identification.arm_predict import predict_arm, validate_arm
from backdrive.logs.readers import read_log
from backdrive.model import FrictionModel
from backdrive.robot import parse_robot
from test_payload import COULOMB, MOTORS, NAMES, VISCOUS, description, multisine

COUPLED = np.eye(4)
COUPLED[2, 3] = 0.6  # the motor of `roll` moves `bend`, too


def made(seed, coupling=None, side="joint", seconds=30.0):
    random = np.random.default_rng(seed)
    C = np.eye(4) if coupling is None else coupling
    t, q, dq, ddq = multisine(random, seconds)
    D = np.linalg.inv(C).T
    m, dm, ddm = q @ D, dq @ D, ddq @ D
    tau = parse_robot(description()).inverse_dynamics(q, dq, ddq) @ C
    tau += MOTORS * ddm + 0.3 + COULOMB * np.tanh(dm / 2e-3) + VISCOUS * dm
    tau += (0.1, 0.1, 0.05, 0.03) * random.standard_normal(q.shape)
    joints = tuple(Joint(name=n) for n in NAMES)
    if side == "motor":
        return Log(time=t, joints=joints, position=m, torque=tau)
    return Log(time=t, joints=joints, position=q, torque=tau @ np.linalg.inv(C))


@pytest.fixture(scope="module")
def robot():
    return parse_robot(description(1.1))


@pytest.fixture(scope="module")
def untold(robot):
    return identify_arm(made(1, COUPLED), robot, held_out=[made(2, COUPLED)])


def residuals(frictions):
    return np.array([f.held_out.residual for f in frictions])


def remarks(frictions):
    return [w for f in frictions for w in f.warnings if "seems to turn with" in w]


def test_a_coupling_is_named_with_its_value_and_the_option(untold):
    frictions, _, _ = untold
    (remark,) = remarks(frictions)
    assert "The motor of 'bend' seems to turn with 'roll' as well" in remark
    assert "--coupling FILE --coupling-side joint" in remark and "1 % false alarms" in remark
    assert float(remark.split("whose matrix has ")[1].split()[0]) == pytest.approx(0.6, abs=0.03)
    assert any("seems to turn with" in w for w in frictions[2].warnings)


def test_nothing_is_named_where_nothing_is_coupled(robot):
    assert remarks(identify_arm(made(3), robot)[0]) == []


def test_with_the_matrix_friction_and_inertia_are_the_motors(robot, untold):
    for side in ("joint", "motor"):
        seen, unseen = (made(s, COUPLED, side).apply_coupling(COUPLED.tolist(), side) for s in (1, 2))
        frictions, _, arm = identify_arm(seen, robot, held_out=[unseen])
        assert np.all(residuals(frictions) < 5.0) and np.all(residuals(frictions)[2:] < 3.0)
        assert np.all(residuals(untold[0])[2:] > 2.0 * residuals(frictions)[2:])
        assert remarks(frictions) == []
        for j in (2, 3):
            v = np.array([-0.5, 0.2, 0.6])
            assert frictions[j].law.torque(v) == pytest.approx(
                np.sign(v) * COULOMB[j] + VISCOUS[j] * v, rel=0.06
            )
        assert frictions[2].dynamics["inertia"].value == pytest.approx(MOTORS[2], abs=0.1)
    model = FrictionModel(joints=frictions, arm=arm, coupling=tuple(map(tuple, COUPLED.tolist())))
    fresh = made(4, COUPLED)  # whose log says nothing of a coupling: the model does
    predicted = predict_arm(model, fresh, robot)
    error = np.sqrt(np.mean((predicted - fresh.torque)[100:-100] ** 2, axis=0))
    assert np.all(error < (0.5, 0.5, 0.3, 0.2))
    assert all(q.residual < 8.0 for q in validate_arm(model, [fresh], robot).values())


def test_the_model_of_a_log_keeps_the_matrix(tmp_path, robot):
    (tmp_path / "arm.urdf").write_text(description(1.1))
    log = made(1, COUPLED, "joint").apply_coupling(COUPLED.tolist(), "joint")
    model = identify(log, method="arm", urdf=str(tmp_path / "arm.urdf")).model
    assert np.array_equal(model.coupling, COUPLED)


def test_a_file_of_joints_is_left_as_it_is_and_remembers_the_matrix(tmp_path):
    log = made(1, COUPLED, seconds=3.0)
    header = "t," + ",".join(f"q{j}" for j in range(4)) + "," + ",".join(f"tau{j}" for j in range(4))
    table = np.column_stack([log.time, log.position, log.torque])
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header=header, comments="", fmt="%.17g")
    matrix = COUPLED.tolist()
    read = read_log(tmp_path / "a.csv", coupling=matrix, coupling_side="joint")
    assert np.array_equal(read.position, log.position) and np.array_equal(read.coupling, COUPLED)
    brought = read_log(tmp_path / "a.csv", coupling=matrix)
    assert np.allclose(brought.position, log.position @ COUPLED.T)
    with pytest.raises(InvalidInput, match="motor or joint"):
        read_log(tmp_path / "a.csv", coupling=matrix, coupling_side="gear")
    with pytest.raises(InvalidInput, match="no coupling"):
        read_log(tmp_path / "a.csv", coupling_side="joint")


def test_the_matrix_in_another_order_and_of_other_joints():
    order = [3, 2, 0, 1]
    names = [NAMES[i] for i in order]
    assert np.array_equal(coupling_between(COUPLED[order], names, NAMES), COUPLED)
    assert np.array_equal(coupling_between(COUPLED, NAMES, NAMES[:2]), np.eye(2))
    with pytest.raises(InvalidInput, match="roll"):
        coupling_between(COUPLED, NAMES, NAMES[:3])
