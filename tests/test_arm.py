"""Whole arms: recover what was put into a simulated arm of three joints, and the real UR3."""

import os
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.identification.arm import identify_arm, predict_arm, validate_arm
from backdrive.identification.arm_signals import hold_out_blocks, prepare_arm, resting
from backdrive.log import Joint, Log
from backdrive.model import FrictionModel, load_model
from backdrive.robot import parse_robot

RATE, SECONDS = 125.0, 40.0
COULOMB_P, COULOMB_N = np.array([4.0, 5.0, 2.0]), np.array([4.0, 5.0, 2.0])
VISCOUS_P, VISCOUS_N = np.array([2.0, 3.0, 1.0]), np.array([3.0, 3.0, 1.5])
MOTOR = np.array([0.0, 0.5, 0.2])
OFFSET = np.array([0.3, -0.5, 0.1])
LOAD = np.array([0.0, 0.1, 0.15])
NOISE = np.array([0.3, 0.3, 0.1])


def describe(m2=4.0, m3=2.0, com3="0.15 0.02 0", i2=0.08):
    def link(name, mass, com, i):
        return (
            f'<link name="{name}"><inertial><mass value="{mass}"/><origin xyz="{com}"/><inertia ixx="0.02" '
            f'iyy="{i}" izz="{i}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        )

    def joint(name, parent, child, axis, xyz):
        return (
            f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="{xyz}"/><axis xyz="{axis}"/>'
            '<limit effort="99" velocity="9" lower="-3" upper="3"/></joint>'
        )

    return (
        '<robot name="three"><link name="base"/>'
        + link("l1", 5.0, "0 0 0.1", 0.05)
        + link("l2", m2, "0.2 0 0.01", i2)
        + link("l3", m3, com3, 0.03)
        + joint("turn", "base", "l1", "0 0 1", "0 0 0")
        + joint("lift", "l1", "l2", "0 1 0", "0 0 0.3")
        + joint("bend", "l2", "l3", "0 1 0", "0.4 0.05 0")
        + "</robot>"
    )


TRUE, BELIEVED = describe(m2=5.0, m3=3.0, com3="0.2 0.03 0.02", i2=0.15), describe()
NAMES = parse_robot(BELIEVED).joints


def motion(seed):
    """Position, velocity and acceleration in closed form; quiet at both ends."""
    rng = np.random.default_rng(seed)
    t = np.arange(int(SECONDS * RATE)) / RATE
    q, dq, ddq = (np.zeros((t.size, 3)) for _ in range(3))
    for j in range(3):
        for f in rng.uniform(0.05, 0.6, 5):
            w, a, p = 2 * np.pi * f, rng.uniform(0.2, 0.4) / (1 + 2 * f), rng.uniform(0, 2 * np.pi)
            q[:, j] += a * np.sin(w * t + p)
            dq[:, j] += a * w * np.cos(w * t + p)
            ddq[:, j] -= a * w**2 * np.sin(w * t + p)
    return t, q, dq, ddq


def friction(dq):
    return np.where(dq > 0, COULOMB_P + VISCOUS_P * dq, -COULOMB_N + VISCOUS_N * dq)


@cache
def simulated(seed=1, noise=1.0, **changes) -> Log:
    t, q, dq, ddq = motion(seed)
    bodies = parse_robot(TRUE).inverse_dynamics(q, dq, ddq)
    tau = bodies + friction(dq) + np.sign(dq) * LOAD * np.abs(bodies) + MOTOR * ddq + OFFSET
    tau += noise * NOISE * np.random.default_rng(seed + 100).normal(size=tau.shape)
    return Log(time=t, joints=tuple(Joint(name=n) for n in NAMES), position=q, velocity=dq, torque=tau)


@pytest.fixture(scope="module")
def urdf(tmp_path_factory):
    path = tmp_path_factory.mktemp("urdf") / "three.urdf"
    path.write_text(BELIEVED)
    return path


@pytest.fixture(scope="module")
def found(urdf):
    return identify_arm(simulated(), urdf, held_out=[simulated(2)])


def curve(friction_of_joint, speeds):
    return friction_of_joint.law.torque(speeds)


def test_the_friction_that_was_put_in_comes_out(found):
    speeds = np.array([-0.8, -0.5, -0.2, 0.2, 0.5, 0.8])
    expected = friction(speeds[:, None] * np.ones(3))
    for j, (f, e) in enumerate(zip(found[0], found[1])):
        top = f.validity.velocity[1]
        inside = np.abs(speeds) < 0.9 * top
        error = curve(f, speeds) - expected[:, j]
        # the mean of both directions is friction; a constant difference is offset by convention
        even = 0.5 * (error - error[::-1])
        np.testing.assert_allclose(even[inside], 0.0, atol=0.03 * COULOMB_P[j])
        assert f.law.rate.NAME == "polyline"
        assert np.all(np.isfinite(e.curve.standard_error))


def test_the_rest_of_the_dynamics_comes_out(found):
    for j, f in enumerate(found[0]):
        d = f.dynamics
        if j == 2:
            assert d["inertia"].value == pytest.approx(
                MOTOR[j], abs=max(4 * d["inertia"].standard_error, 0.02)
            )
        if j:
            assert d["load_friction"].value == pytest.approx(LOAD[j], abs=0.02)
        else:
            assert "load_friction" not in d  # a vertical axis carries little, and has none
        asymmetry = 0.5 * (
            curve(f, 0.3) + curve(f, -0.3) - friction(np.full(3, 0.3))[j] - friction(np.full(3, -0.3))[j]
        )
        assert d["offset"].value + asymmetry == pytest.approx(
            OFFSET[j], abs=max(4 * d["offset"].standard_error, 0.05)
        )


def test_the_bodies_that_were_put_in_come_out(found):
    believed, true = parse_robot(BELIEVED), parse_robot(TRUE)
    relation = believed.base.relation
    beta, expected = relation @ np.array(found[2].parameters), relation @ true.parameters
    heavy = np.isin(believed.base.columns % 10, [1, 2, 3])  # first moments: gravity shows them well
    np.testing.assert_allclose(beta[heavy], expected[heavy], atol=0.03)


def test_the_inertia_of_motors_and_bodies_together_comes_out(found):
    """The first two motors cannot be told from their bodies: only the sum is determined."""
    believed, true = parse_robot(BELIEVED), parse_robot(TRUE)
    q = np.random.default_rng(8).uniform(-1, 1, (20, 3))
    zero = np.zeros_like(q)
    gravity = believed.regressor(q, zero, zero) @ np.array(found[2].parameters)
    for j, f in enumerate(found[0]):
        push = zero + np.eye(3)[j]
        own = (believed.regressor(q, zero, push) @ np.array(found[2].parameters) - gravity)[:, j]
        expected = true.inertia(q)[:, j, j] + MOTOR[j]
        np.testing.assert_allclose(own + f.dynamics["inertia"].value, expected, rtol=0.05, atol=0.02)


def test_unseen_motion_is_explained_up_to_the_noise(found):
    for f in found[0]:
        assert f.held_out.residual < 2.5
        assert f.fitted.samples == f.held_out.samples == int(SECONDS * RATE)
        assert f.method == "arm"


def test_without_noise_almost_everything_is_explained(urdf):
    result = identify_arm(simulated(3, 0.0), urdf, held_out=[simulated(2, 0.0)])
    for f in result[0]:
        assert (
            f.fitted.residual < 1.0
        )  # what is left are reversals: the sign is smooth in the model, sudden in truth
        assert f.held_out.residual < 2.5  # and speeds above those of the fit


def test_standard_errors_are_of_the_size_of_the_errors(urdf):
    z = []
    for seed in range(20, 28):
        for j, f in enumerate(identify_arm(simulated(seed), urdf, held_out=[simulated(2)])[0]):
            knots = np.array(f.law.rate.velocity[1:-1])
            both = 0.5 * (np.array(f.law.rate.positive) + np.array(f.law.rate.negative))[1:-1]
            expected = 0.5 * (COULOMB_P + COULOMB_N)[j] + 0.5 * (VISCOUS_P + VISCOUS_N)[j] * knots
            error = np.array(f.standard_errors["positive"][1:-1])
            z.append((both - expected) / error)
            assert np.all(error > 0)
    spread = np.sqrt(np.mean(np.concatenate(z) ** 2))
    assert 0.2 < spread < 2.0


def test_joints_are_matched_by_name_not_by_column(found, urdf):
    order = ["bend", "turn", "lift"]
    mixed = identify_arm(simulated().select(order), urdf, held_out=[simulated(2).select(order)])
    assert [f.joint.name for f in mixed[0]] == order
    assert [e.joint for e in mixed[1]] == order
    straight = {f.joint.name: f for f in found[0]}
    for f in mixed[0]:
        assert f.law.rate.positive == pytest.approx(
            straight[f.joint.name].law.rate.positive, rel=1e-6, abs=1e-9
        )
    np.testing.assert_allclose(mixed[2].parameters, found[2].parameters, rtol=1e-6, atol=1e-9)


def test_wrong_names_are_answered_with_both_lists(urdf):
    log = simulated().replace(joints=tuple(Joint(name=n) for n in ("j1", "j2", "j3")))
    with pytest.raises(InvalidInput, match=r"turn, lift, bend.*j1, j2, j3.*--names turn,lift,bend"):
        identify_arm(log, urdf)


def test_a_unit_that_does_not_fit_is_refused(urdf):
    log = simulated().replace(joints=tuple(Joint(name=n, unit="m") for n in NAMES))
    with pytest.raises(InvalidInput, match=r"'turn' is in m in the log and in rad"):
        identify_arm(log, urdf)


def test_motor_side_torque_is_brought_to_the_joint(found, urdf):
    def geared(log):
        joints = tuple(Joint(name=n, torque_side="motor", gear_ratio=50.0) for n in NAMES)
        return log.replace(joints=joints, torque=log.torque / 50.0)

    result = identify_arm(geared(simulated()), urdf, held_out=[geared(simulated(2))])
    assert result[0][1].law.rate.positive == pytest.approx(found[0][1].law.rate.positive, rel=1e-6)


def test_held_out_samples_are_never_fitted(urdf):
    robot = parse_robot(BELIEVED)
    (s,) = hold_out_blocks(prepare_arm(simulated(), robot))
    assert not np.any(s.fitted & s.held_out)
    assert np.mean(s.held_out) == pytest.approx(0.25, abs=0.01)
    starts = np.count_nonzero(np.diff(s.held_out.astype(int)) == 1) + int(s.held_out[0])
    assert starts == 2  # contiguous blocks, not scattered samples
    gap = np.flatnonzero(s.held_out)[:, None] - np.flatnonzero(s.fitted)[None, :]
    assert np.abs(gap).min() > 0.4 * s.rate
    ruined = simulated().torque.copy()
    ruined[s.held_out] = 1e3
    clean, spoiled = (
        identify_arm(log, urdf)[0][1] for log in (simulated(), simulated().replace(torque=ruined))
    )
    assert spoiled.held_out.residual > 50 > clean.held_out.residual
    assert clean.law.rate.positive == pytest.approx(spoiled.law.rate.positive, rel=0.05)


def test_a_held_out_log_does_not_move_the_fit(found, urdf):
    other = identify_arm(simulated(), urdf, held_out=[simulated(5)])
    assert other[2] == found[2]
    assert other[0][0].held_out != found[0][0].held_out


def test_inverted_torque_is_refused_naming_the_joint(urdf):
    log = simulated()
    with pytest.raises(NotIdentifiable, match=r"in lift: the torque's sign is inverted") as caught:
        identify_arm(log.replace(torque=log.torque * [1, -1, 1]), urdf)
    assert "--map tau=-COLUMN" in caught.value.remedy
    with pytest.raises(NotIdentifiable, match="turn, lift, bend"):
        identify_arm(log.replace(torque=-log.torque), urdf)


def test_wild_samples_hardly_matter(found, urdf):
    log = simulated()
    torque = log.torque.copy()
    at = np.random.default_rng(9).integers(0, len(log), 12)
    torque[at] += 40.0
    result = identify_arm(log.replace(torque=torque), urdf, held_out=[simulated(2)])
    for j, (dirty, clean) in enumerate(zip(result[0], found[0])):
        assert curve(dirty, 0.5) == pytest.approx(curve(clean, 0.5), abs=0.05 * COULOMB_P[j])


def test_torque_at_rest_tells_nothing_and_is_not_fitted(found, urdf):
    log = simulated()
    rest = 500
    position = np.concatenate([log.position, np.repeat(log.position[-1:], rest, axis=0)])
    held = log.torque[-1] + 3.0  # static friction holds any torque up to break-away
    torque = np.concatenate([log.torque, np.repeat(held[None], rest, axis=0)])
    longer = Log(time=np.arange(len(position)) / RATE, joints=log.joints, position=position, torque=torque)
    result = identify_arm(longer, urdf, held_out=[simulated(2)])
    for j, (f, g) in enumerate(zip(result[0], found[0])):
        assert curve(f, 0.5) == pytest.approx(curve(g, 0.5), abs=0.03 * COULOMB_P[j])
        assert f.dynamics["offset"].value == pytest.approx(g.dynamics["offset"].value, abs=0.1)


def test_resting_finds_long_rests_only():
    velocity = np.ones((1000, 1))
    velocity[300:310], velocity[600:700] = 0.0, 0.0
    marked = resting(velocity, np.array([1.0]), 125.0)[:, 0]
    assert not marked[:500].any()
    assert marked[600:700].all()
    assert marked.sum() < 140


def test_gaps_and_an_uneven_clock_are_survived(found, urdf):
    log = simulated()
    jitter = log.time + np.random.default_rng(3).uniform(-0.002, 0.002, len(log))
    t, q, *_ = motion(1)
    moved = np.stack([np.interp(jitter, t, q[:, j]) for j in range(3)], axis=1)
    uneven = log.replace(time=jitter, position=moved, velocity=None)
    keep = (log.time < 12) | (log.time > 14)
    result = identify_arm(uneven.rows(keep), urdf, held_out=[simulated(2)])
    for j, (f, g) in enumerate(zip(result[0], found[0])):
        assert curve(f, 0.5) == pytest.approx(curve(g, 0.5), abs=0.05 * COULOMB_P[j])
        assert f.held_out.residual < 4


def test_several_logs_are_one_identification(urdf):
    result = identify_arm([simulated(1), simulated(4)], urdf, held_out=[simulated(2)])
    assert result[0][0].fitted.samples == 2 * int(SECONDS * RATE)
    assert result[0][0].held_out.residual < 2.5


def test_a_joint_that_never_moves_is_said_to_be_unknown(urdf):
    log = simulated()
    _, q, dq, ddq = motion(1)
    for x in (q, dq, ddq):
        x[:, 0] = 0.0
    tau = parse_robot(TRUE).inverse_dynamics(q, dq, ddq) + friction(dq) * (dq != 0)
    result = identify_arm(log.replace(position=q, velocity=dq, torque=tau), urdf)
    assert "never moves" in result[0][0].warnings[0]
    assert curve(result[0][0], 1.0) == pytest.approx(0.0, abs=1e-9)
    assert curve(result[0][1], 0.5) == pytest.approx(COULOMB_P[1] + 0.5 * VISCOUS_P[1], rel=0.05)


def test_too_short_a_log_is_refused(urdf):
    with pytest.raises(NotIdentifiable, match="too few"):
        identify_arm(simulated().between(0, 2.0), urdf)
    with pytest.raises(NotIdentifiable, match="No stretch"):
        identify_arm(simulated().between(0, 0.5), urdf)


def test_missing_channels_are_named(urdf):
    with pytest.raises(InvalidInput, match=r"needs position.*--map q=COLUMN"):
        identify_arm(simulated().replace(position=None), urdf)
    with pytest.raises(InvalidInput, match=r"needs torque.*--map tau=COLUMN"):
        identify_arm(simulated().replace(torque=None), urdf)
    holed = simulated().torque.copy()
    holed[7, 1] = np.nan
    with pytest.raises(InvalidInput, match="NaN"):
        identify_arm(simulated().replace(torque=holed), urdf)


def test_a_saved_model_predicts_the_same(found, urdf, tmp_path):
    model = FrictionModel(joints=found[0], arm=found[2])
    model.save(tmp_path / "m.json")
    log = simulated(2)
    predicted = predict_arm(load_model(tmp_path / "m.json"), log.select(["lift", "bend", "turn"]), urdf)
    assert predicted.shape == log.torque.shape
    np.testing.assert_allclose(predicted, predict_arm(model, log, urdf), atol=1e-9)
    error = 100 * np.linalg.norm(predicted - log.torque, axis=0) / np.linalg.norm(log.torque, axis=0)
    qualities = validate_arm(model, [log], urdf)
    for j, f in enumerate(found[0]):
        assert qualities[f.joint.name] == f.held_out
        assert error[j] == pytest.approx(f.held_out.residual_raw, rel=0.01)


def test_another_description_is_refused(found, tmp_path):
    model = FrictionModel(joints=found[0], arm=found[2])
    other = tmp_path / "other.urdf"
    other.write_text(TRUE)
    with pytest.raises(InvalidInput, match="another robot description"):
        predict_arm(model, simulated(), other)
    with pytest.raises(InvalidInput, match="not of a whole arm"):
        predict_arm(replace(model, arm=None), simulated(), other)


def test_evidence_adds_up(found):
    for f, e in zip(found[0], found[1]):
        s = e.samples
        assert s.fitted.any() and not s.fitted.all()
        known = s.torque - s.friction
        moving = np.abs(s.velocity) > 0.3 * f.validity.velocity[1]
        np.testing.assert_allclose(
            (known + curve(f, s.velocity))[moving], s.predicted[moving], atol=0.2 * COULOMB_P.max()
        )
        assert "had not seen" in e.verdict


@pytest.mark.skipif("BACKDRIVE_DATA" not in os.environ, reason="the real logs are not here")
def test_the_real_ur3():
    import pinocchio
    from scipy.io import loadmat

    prefix = next(p for p in Path(pinocchio.__file__).parents if p.name == "cmeel.prefix")
    urdf = prefix / "share/example-robot-data/robots/ur_description/urdf/ur3_robot.urdf"
    names = [
        f"{n}_joint" for n in ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
    ]

    def read(name, sign):
        d = loadmat(Path(os.environ["BACKDRIVE_DATA"]) / "ur3" / f"{name}.mat")
        return Log(
            time=d["mt"][:, 0],
            joints=tuple(Joint(name=n) for n in names),
            position=d["mq"],
            torque=sign * d["mtorque"],
        )

    with pytest.raises(NotIdentifiable, match="inverted"):
        identify_arm(read("id1", 1), urdf)
    result = identify_arm(read("id1", -1), urdf, held_out=[read("id2", -1)])
    for f, limit in zip(result[0], (8, 8, 8.5, 9, 11.5, 11.5)):
        assert f.held_out.residual < limit
        assert f.fitted.residual < 7
