"""Mass and center of what an arm carries, and the gains of its drives, by the public door; bodies that exist."""

import json
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from backdrive.errors import InvalidInput, NotIdentifiable, UnknownName
from backdrive.logs.log import Joint, Log

pytest.importorskip("pinocchio")

from backdrive.cli import app
from backdrive.external import estimate_payload
from backdrive.identification.arm import identify_arm
from backdrive.identification.arm_physical import possible, standard_parameters
from backdrive.identification.arm_solve import spread_of
from backdrive.identification.pseudo_inertia import (
    about_center,
    frame_change,
    of_pseudo_inertia,
    pseudo_inertia,
)
from backdrive.model import FrictionModel
from backdrive.robot import parse_robot

NAMES = ("turn", "lift", "bend", "roll")
COULOMB, VISCOUS, MOTORS = (
    np.array([6.0, 7.0, 4.0, 1.0]),
    np.array([5.0, 6.0, 3.0, 0.5]),
    np.array([1.0, 1.0, 0.5, 0.1]),
)
MASS, CENTER = 2.5, np.array([0.03, -0.02, 0.06])


def link(name, mass, com, inertia):
    return (
        f'<link name="{name}"><inertial><mass value="{mass}"/><origin xyz="{com}"/><inertia ixx="{inertia[0]}" iyy="{inertia[1]}" '
        f'izz="{inertia[2]}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )


def joint(name, parent, child, axis, xyz, kind="revolute"):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><origin xyz="{xyz}" rpy="'
        f'{"0.2 0.4 -0.3" if kind == "fixed" else "0 0 0"}"/><axis xyz="{axis}"/>'
        '<limit effort="1" velocity="1" lower="-9" upper="9"/></joint>'
    )


def description(scale=1.0, payload=0.0):
    x, y, z = CENTER
    I = payload * 1e-3 * np.array([1.5, 1.2, 1.0])  # noqa: E741
    return (
        '<robot name="r"><link name="base"/>'
        + link("one", 5.0 * scale, "0.01 0.02 0.1", (0.03, 0.03, 0.03))
        + link("two", 4.0 * scale, "0.15 0.02 0", (0.02, 0.06, 0.06))
        + link("three", 2.5 * scale, "0.12 0 0.01", (0.01, 0.03, 0.03))
        + link("four", 1.0 * scale, "0.03 0.004 0", (0.002, 0.003, 0.003))
        + link("tool", payload, f"{x} {y} {z}", I)
        + joint("turn", "base", "one", "0 0 1", "0 0 0.2") + joint("lift", "one", "two", "0 -1 0", "0 0 0.15")
        + joint("bend", "two", "three", "0 -1 0", "0.3 0 0") + joint("roll", "three", "four", "1 0 0", "0.25 0 0")
        + joint("flange", "four", "tool", "1 0 0", "0.06 0 0.01", "fixed") + "</robot>"
    )  # fmt: skip


def multisine(random, seconds):
    """Return time, positions, velocities and accelerations of four joints, six tones each."""
    t = np.arange(round(100 * seconds)) / 100.0
    q, dq, ddq = np.zeros((3, t.size, 4))
    for j in range(4):
        for k in range(1, 7):
            w, a, p = (
                2 * np.pi * 0.1 * k * random.uniform(0.8, 1.2),
                random.uniform(0.03, 0.2),
                random.uniform(0, 6),
            )
            q[:, j] += a * np.sin(w * t + p)
            dq[:, j] += a * w * np.cos(w * t + p)
            ddq[:, j] -= a * w**2 * np.sin(w * t + p)
    return t, q, dq, ddq


def made(seed, payload=0.0, gains=(1.0,) * 4, seconds=25.0, noise=0.05, still=False):
    random = np.random.default_rng(seed)
    t, q, dq, ddq = multisine(random, seconds)
    q += (0.0, 0.5, -0.9, 0.3)
    if still:
        q, dq, ddq = np.tile(q[:1], (t.size, 1)), 0.0 * dq, 0.0 * ddq
    tau = parse_robot(description(payload=payload)).inverse_dynamics(q, dq, ddq) + MOTORS * ddq + 0.3
    tau = (tau + COULOMB * np.tanh(dq / 2e-3) + VISCOUS * dq) * gains + noise * random.standard_normal(
        q.shape
    )
    return Log(time=t, joints=tuple(Joint(name=n) for n in NAMES), position=q, torque=tau)


def model_of(log, robot):
    frictions, _, arm = identify_arm(log, robot)
    return FrictionModel(joints=frictions, arm=arm)


@pytest.fixture(scope="module")
def robot():
    return parse_robot(description(1.1))


@pytest.fixture(scope="module")
def bare():
    return made(1)


@pytest.fixture(scope="module")
def model(bare, robot):
    return model_of(bare, robot)


@pytest.fixture(scope="module")
def loaded():
    return made(2, MASS)


def test_mass_and_center_with_and_without_an_unloaded_log(model, bare, loaded, robot):
    for unloaded in (bare, None):
        result = estimate_payload(model, loaded, robot, frame="tool", unloaded=unloaded, gain_error=0.0)
        assert result.mass == pytest.approx(MASS, rel=0.02)
        assert result.center == pytest.approx(CENTER, abs=5e-3)
        low, high = result.mass_interval
        assert low < MASS < high and high - low < 0.4
        assert np.all(np.diff(result.center_interval(), axis=0) > 0)
        assert result.limited_by == "data" and result.frame == "tool"
        assert result.lever["lift"] > result.lever["roll"] > 0


def test_friction_of_another_day_leaves_the_mass(model, bare, loaded, robot):
    """A loaded log whose friction is a seventh larger than the unloaded one's."""
    moves = np.sign(np.gradient(loaded.position, axis=0))
    other = loaded.replace(torque=loaded.torque + 0.15 * COULOMB * moves)
    result = estimate_payload(model, other, robot, frame="tool", unloaded=bare, gain_error=0.0)
    low, high = result.mass_interval
    assert low < MASS < high and result.mass == pytest.approx(MASS, rel=0.02)


def test_it_says_when_gains_limit_it(model, bare, loaded, robot):
    result = estimate_payload(model, loaded, robot, frame="tool", unloaded=bare)
    assert result.limited_by == "gains" and any(
        "gains limit the accuracy of the mass" in r for r in result.remarks
    )
    assert result.mass_error > 3 * result.mass_error_of_data
    assert 0.01 * MASS < result.mass_error < 0.2 * MASS
    double = estimate_payload(model, loaded, robot, frame="tool", unloaded=bare, gain_error=0.1)
    assert double.mass == pytest.approx(result.mass) and double.mass_error == pytest.approx(
        2 * result.mass_error, rel=0.1
    )


def test_the_frame_is_that_of_the_center(model, bare, loaded, robot):
    at_tool, at_link = (
        estimate_payload(model, loaded, robot, frame=f, unloaded=bare, gain_error=0.0) for f in (None, "four")
    )
    assert at_tool.frame == "tool"
    assert at_tool.mass == pytest.approx(at_link.mass, rel=2e-3)
    q = np.zeros((1, 4))
    tool, four = robot.placement(q, "tool")[0], robot.placement(q, "four")[0]
    expected = np.linalg.inv(four) @ tool @ np.append(at_tool.center, 1.0)
    assert at_link.center == pytest.approx(expected[:3], abs=2e-3)


def test_a_known_mass_calibrates_the_gains_and_an_unknown_one_their_ratios(robot):
    gains = (1.0, 1.0, 1.1, 1.0)
    bare, loaded = made(3, gains=gains), made(4, 3.0, gains=gains)
    model = model_of(bare, robot)
    known = estimate_payload(model, loaded, robot, frame="tool", unloaded=bare, known_mass=3.0)
    assert known.gains.kind == "absolute" and known.limited_by == "nothing" and known.mass_error == 0.0
    assert known.gains.by_joint["bend"].value == pytest.approx(1.1, abs=0.02)
    assert known.gains.by_joint["lift"].value == pytest.approx(1.0, abs=0.02)
    assert any("'bend'" in r and "10 % too large" in r for r in known.remarks)
    at = estimate_payload(model, loaded, robot, frame="tool", unloaded=bare, known_mass=3.0, at=CENTER)
    assert at.center == pytest.approx(CENTER, abs=2e-3)
    ratios = estimate_payload(model, loaded, robot, frame="tool", unloaded=bare)
    assert ratios.gains.kind == "ratio" and ratios.gains.by_joint["bend"].value == pytest.approx(
        1.1, abs=0.04
    )
    assert any("only a known mass determines it" in r for r in ratios.remarks)


def test_a_light_payload_claims_nothing_of_the_gains(model, robot):
    result = estimate_payload(model, made(5, 0.6), robot, frame="tool")
    assert result.gains.kind == "none" and not result.gains.by_joint
    assert any("gains are not reported" in r for r in result.remarks)
    assert result.inertia is None and any("does not show the payload's inertia" in r for r in result.remarks)


def test_what_is_no_payload_is_refused_and_another_robot_is_named(model, bare, loaded, robot):
    with pytest.raises(NotIdentifiable, match="not significant"):
        estimate_payload(model, made(6), robot, frame="tool")
    with pytest.raises(NotIdentifiable, match="rows of moving joints"):
        estimate_payload(model, made(7, MASS, still=True), robot, frame="tool")
    other = loaded.replace(torque=loaded.torque[:, ::-1].copy())
    with pytest.raises(UnknownName, match="nowhere"):
        estimate_payload(model, loaded, robot, frame="nowhere")
    with pytest.raises(InvalidInput, match="does not move"):
        estimate_payload(model, loaded, robot, frame="base")
    for wrong in ({"known_mass": -1.0}, {"gain_error": 2.0}, {"at": (0.0, 1.0)}):
        with pytest.raises(InvalidInput):
            estimate_payload(model, loaded, robot, frame="tool", **wrong)
    with pytest.raises(InvalidInput, match="whole arm"):
        estimate_payload(replace(model, arm=None), loaded, robot)
    with pytest.raises(InvalidInput, match="does not explain the log.*torque-share"):
        estimate_payload(model, other, robot, frame="tool")


def test_a_payload_from_logs_in_another_order_is_refused(model, bare, loaded, robot):
    order = [0, 2, 1, 3]
    swapped = [
        one.replace(torque=one.torque[:, order], position=one.position[:, order]) for one in (loaded, bare)
    ]
    with pytest.raises(InvalidInput, match=r"does not explain the unloaded log.*lift.*--names|`names`"):
        estimate_payload(model, swapped[0], robot, frame="tool", unloaded=swapped[1])
    result = estimate_payload(model, loaded, robot, frame="tool", unloaded=bare)
    assert not any("unloaded log (" in line for line in result.remarks)


def test_the_command(tmp_path, model, bare, loaded, robot):
    paths = {name: tmp_path / f"{name}.csv" for name in ("bare", "loaded")}
    for (_, path), log in zip(paths.items(), (bare, loaded), strict=True):
        header = "t," + ",".join(f"q{j}" for j in range(4)) + "," + ",".join(f"tau{j}" for j in range(4))
        np.savetxt(
            path,
            np.column_stack([log.time, log.position, log.torque]),
            delimiter=",",
            header=header,
            comments="",
        )
    (tmp_path / "arm.urdf").write_text(description(1.1))
    model.save(tmp_path / "m.json")
    usual = ["estimate", str(tmp_path / "m.json"), str(paths["loaded"]), "--names", ",".join(NAMES)]
    urdf = ["--urdf", str(tmp_path / "arm.urdf")]
    done = CliRunner().invoke(app, [*usual, *urdf, "--payload", "--unloaded", str(paths["bare"]), "--json"])
    assert done.exit_code == 0, done.output
    payload = json.loads(done.stdout)["payload"]
    assert payload["mass"] == pytest.approx(MASS, rel=0.03) and payload["limited_by"] == "gains"
    done = CliRunner().invoke(
        app, [*usual, *urdf, "--payload", "--known-mass", "2.5", "--at", "0.03,-0.02,0.06"]
    )
    assert done.exit_code == 0 and "gain of lift" in done.output and "as given" in done.output
    for wrong in (
        ["--known-mass", "2"],
        ["--gain-error", "0"],
        [*urdf, "--payload", "--contact"],
        [*urdf, "--payload", "--method", "kalman"],
        ["--payload"],
        [*urdf, "--payload", "--at", "1,2"],
    ):
        done = CliRunner().invoke(app, [*usual, *wrong])
        assert done.exit_code != 0


def test_degrees_are_refused_and_joints_that_are_held_are_named(bare, robot):
    with pytest.raises(InvalidInput, match="look like degrees.*deg"):
        identify_arm(bare.replace(position=np.rad2deg(10.0 * bare.position)), robot)
    frictions, _, _ = identify_arm(bare.select(NAMES[:3]), robot)
    assert any("roll is not in the log: it is held at 0" in line for f in frictions for line in f.warnings)


def test_the_model_keeps_how_sure_its_bodies_are(tmp_path, model):
    from backdrive import load_model

    model.save(tmp_path / "m.json")
    assert load_model(tmp_path / "m.json").arm == model.arm
    with pytest.raises(InvalidInput, match="rows and columns"):
        replace(model.arm, covariance=((1.0, 0.0),))


def test_a_pseudo_inertia_is_that_of_points():
    random = np.random.default_rng(0)
    points, masses = random.standard_normal((5, 3)), random.uniform(0.1, 1.0, 5)

    def parameters(points):
        inertia = sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, points, strict=True))
        return np.array([masses.sum(), *(masses @ points), *inertia[(0, 0, 1, 0, 1, 2), (0, 1, 1, 2, 2, 2)]])

    here = parameters(points)
    assert of_pseudo_inertia(pseudo_inertia(here)) == pytest.approx(here)
    G = np.eye(4)
    G[:3, :3], G[:3, 3] = np.linalg.qr(random.standard_normal((3, 3)))[0], random.standard_normal(3)
    if np.linalg.det(G[:3, :3]) < 0:
        G[:3, 0] *= -1
    assert frame_change(G) @ here == pytest.approx(parameters(points @ G[:3, :3].T + G[:3, 3]))
    middle = masses @ points / masses.sum()
    central = parameters(points - middle)
    assert about_center(here)[0, 1] == pytest.approx(central[5]) and about_center(here)[
        2, 2
    ] == pytest.approx(central[9])


def test_bodies_that_exist_give_the_same_torques(robot):
    random, spread = np.random.default_rng(3), spread_of(robot)
    rows = []
    for row in robot.parameters.reshape(-1, 10):
        L = np.linalg.cholesky(pseudo_inertia(row)) @ (np.eye(4) + 0.4 * random.standard_normal((4, 4)))
        rows.append(of_pseudo_inertia(L @ L.T))
    beta, sure = robot.base.relation @ np.concatenate(rows), 1e-6 * np.eye(robot.base.columns.size)
    theta, distance = standard_parameters(robot, beta, spread, sure)
    assert not possible(robot.base.standard(beta, robot.parameters, spread), spread).all()
    assert possible(theta, spread).all() and distance == 0.0
    assert robot.base.relation @ theta == pytest.approx(beta, abs=1e-10)
    theta, distance = standard_parameters(robot, -beta, spread, sure)
    assert distance > 1.0 and robot.base.relation @ theta == pytest.approx(-beta, abs=1e-10)
    theta, distance = standard_parameters(robot, -beta, spread, 1e6 * sure * np.sum(beta**2))
    assert possible(theta, spread).all() and 0.0 < distance <= 1.0
