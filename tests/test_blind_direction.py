"""The direction of a wrench that an arm does not feel: postures whose direction follows from where the axes lie."""

import csv

import numpy as np
import pytest

pytest.importorskip("pinocchio")

from _arm_force import MODEL, PUSH, ROBOT, SLIDING, TEXT, L, log_of, model_of, text_of
from _commands import called
from backdrive.control.estimators.arm import ArmForce
from backdrive.external import estimate_force
from backdrive.external.directions import blind_directions, direction_words, usual_direction
from backdrive.external.figures import wrench_figures
from backdrive.external.result import JointForce
from backdrive.external.wrench import COMPONENTS, wrench_of
from backdrive.logs.log import Joint
from backdrive.robot import parse_robot

# all axes but the first lie in one plane or along y: a force along y through the first axis moves none of them
STRAIGHT = np.zeros(6), np.array([0.0, 1.0, 0.0]), np.array([0.02, 0.0, -0.58])
TILT = 0.7


def stretched():
    """Return a posture whose wrist lies on the line of shoulder and elbow, and the force along it, about the tip."""
    q = np.array([0.0, TILT, np.arctan2(0.03, 0.4) - 0.5 * np.pi, 0.3, 0.9, -0.3])
    force = np.array([np.sin(TILT), 0.0, np.cos(TILT)])
    wrist, tip = (ROBOT.placement(q[None], name)[0, :3, 3] for name in ("l4", "tip"))
    return q, force, np.cross(wrist - tip, force)


def estimate(q, model=MODEL, robot=ROBOT, n=50):
    """Return the wrench of an arm that stays in a posture, all its joints' bands alike."""
    estimator = ArmForce.from_model(model, robot, bandwidth=L, frame="tip")
    time = np.arange(n) * 1e-3
    zero = np.zeros(n)
    joints = [
        JointForce(
            joint=Joint(name=name),
            time=time,
            force=zero,
            friction=zero,
            lower=zero - 0.3,
            upper=zero + 0.3,
            state=np.zeros(n, dtype=np.int8),
            method="momentum",
            bandwidth=L,
            lag=0.0,
        )
        for name in robot.joints
    ]
    return wrench_of(estimator, time, np.tile(q, (n, 1)), joints)


@pytest.mark.parametrize("posture", [STRAIGHT, stretched()], ids=["straight", "stretched"])
def test_the_direction_is_that_of_the_axes(posture):
    q, force, moment = posture
    want = np.concatenate([force, moment])
    assert ROBOT.jacobian(q[None], "tip")[0].T @ want == pytest.approx(np.zeros(6), abs=1e-9)
    wrench = estimate(q)
    assert wrench.singular.all()
    root = np.sqrt(wrench.damping)
    for got in (wrench.blind[0], wrench.blind_direction):
        assert abs(got @ (want * root**2)) / np.linalg.norm(want * root) == pytest.approx(1.0, abs=0.02)
        assert np.linalg.norm(got * root) == pytest.approx(1.0)
    assert wrench_figures(wrench)["blind_direction"] == pytest.approx(wrench.blind_direction.tolist())
    (line,) = wrench.remarks()
    axis = "y" if force[1] else "(0.64, 0.00, 0.76)"
    assert f": force along {axis} of the base" in line and "100 % of the time" in line


def test_where_all_is_felt_no_direction_is_named():
    wrench = estimate(np.array([0.0, 0.0, 0.9, 0.3, 0.9, -0.3]))
    assert not wrench.singular.any() and np.isnan(wrench.blind).all()
    assert wrench.blind_direction is None and wrench.remarks() == []


def test_an_arm_of_few_joints_leaves_several_directions_and_names_none():
    short = parse_robot(text_of(3))
    wrench = estimate(np.zeros(3), model_of(short), short)
    assert wrench.singular.all() and wrench.blind_direction is None
    assert "3 joints can observe at most 3" in wrench.remarks()[0]


def test_directions_are_called_by_force_moment_and_axis():
    one = np.ones(6)
    words = {
        "force along x of the base": [2, 0, 0, 0, 0, 0],
        "moment along -z of the base": [0.1, 0, 0, 0, 0, -1],
        "force along (0.71, 0.71, 0.00) of the base": [1, 1, 0, 0, 0.1, 0],
        "force along y of the base together with a moment along -x (2 N.m per N)": [0, -1, 0, 2, 0, 0],
    }
    for want, direction in words.items():
        assert direction_words(np.array(direction, dtype=float), one) == want
    assert direction_words(np.array([1.0, 0, 0, 0, 0, 1.0]), np.array([1.0] * 3 + [1e4] * 3)).startswith(
        "moment along z"
    )


def test_the_usual_direction_is_that_of_most():
    rng = np.random.default_rng(0)
    damping = np.array([1.0, 1.0, 1.0, 100.0, 100.0, 100.0])
    covariance = np.tile(np.diag(0.1 / damping), (30, 1, 1))
    covariance[:, 2, 2] = 1.0
    covariance += 1e-4 * np.diag(rng.uniform(size=6) / damping)
    many = blind_directions(covariance, damping)
    many[:3] = [0.0, 0.0, 0.0, 0.1, 0.0, 0.0]
    direction, share = usual_direction(many, damping)
    assert direction == pytest.approx([0, 0, 1, 0, 0, 0], abs=1e-6) and share == pytest.approx(0.9)


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_the_table_holds_the_covariance(tmp_path, ending):
    SLIDING.save(tmp_path / "arm.json")
    (tmp_path / "arm.xml").write_text(TEXT)
    log = log_of(PUSH, n=4000)
    heading = ",".join(["t", *(f"{c}{i}" for c in "qu" for i in range(6))])
    rows = np.column_stack([log.time, log.position, log.torque])
    np.savetxt(tmp_path / "log.csv", rows, delimiter=",", header=heading, comments="", fmt="%.17g")
    out = tmp_path / f"force.{ending}"
    options = ["--map", "t=t,q=q0..q5,tau=u0..u5", "--names", ",".join(ROBOT.joints), "--frame", "tip"]
    more = ["--urdf", tmp_path / "arm.xml", "--method", "extended", "--bandwidth", "60", "-o", out]
    done = called("estimate", tmp_path / "arm.json", tmp_path / "log.csv", *options, *more)
    assert done.returncode == 0, done.stderr
    table = columns_of(out)
    wrench = estimate_force(
        SLIDING,
        log.replace(external_torque=None),
        robot=ROBOT,
        frame="tip",
        method="extended",
        bandwidth=60.0,
    ).wrench
    back = np.empty_like(wrench.covariance)
    for i, a in enumerate(COMPONENTS):
        for j, b in enumerate(COMPONENTS[i:], i):
            unit = {0: "N^2", 1: "N^2.m", 2: "N^2.m^2"}[a.startswith("m") + b.startswith("m")]
            back[:, i, j] = back[:, j, i] = table[f"tip_cov_{a}_{b} [{unit}]"]
    assert sum("_cov_" in name for name in table) == 21
    scale = np.sqrt(np.einsum("nii,njj->nij", wrench.covariance, wrench.covariance))
    assert np.abs((back - wrench.covariance) / scale).max() < 1e-6
    assert np.linalg.eigvalsh(back).min() > 0.0
    assert table["tip_fx_sd [N]"] ** 2 == pytest.approx(table["tip_cov_fx_fx [N^2]"], rel=1e-6)


def columns_of(path):
    """Return the columns of a table by name."""
    if path.suffix == ".parquet":
        parquet = pytest.importorskip("pyarrow.parquet")
        table = parquet.read_table(path)
        return {name: table[name].to_numpy() for name in table.column_names}
    with path.open() as file:
        names, *rows = csv.reader(file)
    return dict(zip(names, np.array(rows, dtype=float).T, strict=True))
