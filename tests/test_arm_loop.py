"""The loop of a whole arm: friction, gravity, walls and external force in one call, and what faults do to them."""

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest

from _arm_loops import TOP, T, arm_joints, arm_limits, arm_loop, arm_model, six_axis
from backdrive.control import Admittance, ArmJoint, ArmLoop
from backdrive.control.estimators.of_model import with_slow_sliding
from backdrive.errors import InvalidInput
from backdrive.laws import Law, Polyline
from backdrive.plans.limits import JointLimits
from backdrive.simulation.arm import Arm
from backdrive.simulation.arm_loop import guide_whole, polygon
from backdrive.simulation.hand import Hand
from backdrive.status import Status

pytest.importorskip("pinocchio")
pytest.importorskip("mujoco")
POSTURE = np.array([0.0, 0.5, -1.0, 0.0, 0.5, 0.0])


@pytest.fixture(scope="module")
def guided():
    return arm_loop()


def at_rest(loop, gravity=1.0):
    loop.reset(POSTURE, gravity=gravity)
    return loop


def moving(k, joint=None, speed=0.5):
    q = POSTURE.copy()
    joints = range(6) if joint is None else [joint]
    for j in joints:
        q[j] += speed * T * k
    return q


# ------------------------------------------------------------------------------------------------------------- gravity


def test_an_arm_at_rest_is_given_what_it_weighs(guided):
    loop, arm = at_rest(guided), Arm()
    status = loop.update(POSTURE, loop.torque)
    assert status == Status.OK
    assert loop.torque == pytest.approx(arm.weight, abs=1e-9)
    assert np.array_equal(loop.gravity, loop.torque)
    assert np.all(loop.drive == 0.0) and np.all(loop.compensation == 0.0)


def test_gravity_rises_from_nothing_where_nobody_held_the_arm(guided):
    loop, arm = at_rest(guided, gravity=0.0), Arm()
    given = []
    for _ in range(600):
        loop.update(POSTURE, loop.torque)
        given.append(loop.gravity[1])
    assert given[0] < 0.01 * arm.weight[1]
    assert np.diff(given).max() < 1.1 * arm.weight[1] * T / 0.5
    assert given[-1] == pytest.approx(arm.weight[1], rel=1e-9)


def test_a_stop_leaves_what_holds_gravity(guided):
    loop = at_rest(guided)
    for k in range(800):
        loop.update(moving(k), loop.torque)
    assert np.abs(loop.compensation).min() > 0.5
    loop.stop()
    for k in range(800, 1500):
        status = loop.update(moving(k), loop.torque)
    assert status == Status.STOPPED
    assert np.all(loop.compensation == 0.0)
    assert np.array_equal(loop.torque, loop.gravity)
    assert abs(loop.gravity[1]) > 5.0
    assert loop.acknowledge()
    loop.update(moving(1500), loop.torque)
    assert not np.any(loop.codes == Status.STOPPED)


# -------------------------------------------------------------------------------------------------------------- faults


def test_readings_that_are_none_leave_the_other_joints_as_they_were(guided):
    whole, faulty = at_rest(guided), at_rest(copy.deepcopy(guided))
    for k in range(700):
        q = moving(k)
        q[3] = POSTURE[3]
        whole.update(q, whole.torque)
        if 500 <= k < 550:
            q[3] = np.nan
        faulty.update(q, faulty.torque)
        assert np.all(np.isfinite(faulty.torque))
        others = [0, 1, 2, 4, 5]
        assert np.array_equal(whole.torque[others], faulty.torque[others])
        assert np.array_equal(whole.external[others], faulty.external[others])
        assert faulty.codes[3] == (Status.NOT_FINITE if 500 <= k < 550 else whole.codes[3])
    assert not any(faulty.causes)


def test_a_latch_takes_the_friction_in_time_and_gravity_after_the_brakes(guided):
    loop = at_rest(guided)
    for k in range(600):
        loop.update(moving(k), loop.torque)
    held, latched = loop.gravity[1], None
    for k in range(600, 2200):
        q = moving(600)
        q[1] = np.nan
        loop.update(q, loop.torque)
        if latched is None and loop.causes[1] is Status.NOT_FINITE:
            latched = k
        since = T * (k - latched) if latched else 0.0
        if 0.16 < since < 0.49:
            assert loop.compensation[1] == 0.0
            assert loop.torque[1] == pytest.approx(held, rel=1e-2)
        if since > 1.02:
            assert loop.torque[1] == 0.0
    assert latched is not None and latched < 600 + 110
    assert loop.codes[1] == Status.LATCHED
    assert set(loop.codes[[0, 2, 3, 4, 5]]) == {int(Status.STOPPED)}
    assert abs(loop.gravity[2]) > 3.0  # the others hold theirs


def test_gravity_that_drives_a_runaway_is_let_go_at_once(guided):
    for way in (1.0, -1.0):
        loop = at_rest(guided)
        for _ in range(100):
            loop.update(POSTURE, loop.torque)
        held = loop.gravity[1]
        q = POSTURE.copy()
        for _ in range(60):
            q[1] += way * 1.4 * TOP * T
            loop.update(q, loop.torque)
        assert loop.causes[1] is Status.OVERSPEED
        if way * held > 0.0:
            assert loop.gravity[1] == 0.0
        else:
            assert abs(loop.gravity[1]) > 0.5 * abs(held)


def test_others_go_on_where_a_latch_is_theirs_alone():
    loop = at_rest(arm_loop(together=False))
    for k in range(400):
        q = moving(k)
        q[5] = np.nan if k > 200 else q[5]
        loop.update(q, loop.torque)
    assert loop.codes[5] == Status.LATCHED
    assert np.all(loop.codes[:5] == Status.OK)


def test_a_new_zero_of_an_encoder_changes_no_weight(guided):
    loop = at_rest(guided)
    loop.update(POSTURE, loop.torque)
    before = loop.torque.copy()
    shifted = POSTURE + np.array([0.0, 0.7, 0.0, 0.0, 0.0, 0.0])
    for _ in range(300):
        loop.update(shifted, loop.torque)
    assert loop.codes[1] == Status.OK
    assert loop.torque == pytest.approx(before, abs=1e-6)
    assert loop.position == pytest.approx(POSTURE)


def test_nothing_is_raised_and_every_output_is_bounded(guided):
    loop, random = at_rest(guided), np.random.default_rng(0)
    effort = np.array([joint.limits.effort for joint in loop.joints.values()])
    strange = [
        None, "six", POSTURE[:5], np.zeros(7), np.full(6, np.inf), np.full(6, 1e300), -np.full(6, 1e308),
        np.zeros((6, 1)), [None] * 6, object(), 3.0,
    ]  # fmt: skip
    for k in range(3000):
        q = moving(k) + random.normal(0.0, 1e-3, 6)
        applied = loop.torque
        interval = None
        match random.integers(0, 8):
            case 0:
                q = strange[random.integers(len(strange))]
            case 1:
                applied = strange[random.integers(len(strange))]
            case 2:
                interval = [0.0, -1.0, np.nan, np.inf, 1e9, "soon", 2e-3][random.integers(7)]
            case 3:
                q[random.integers(6)] = random.choice([np.nan, 1e3, -1e200])
        status = loop.update(q, applied, interval)
        assert isinstance(status, Status)
        assert np.all(np.abs(loop.torque) <= effort)
        if k % 200 == 199:
            loop.acknowledge()
    assert loop.count == 3001 or loop.count >= 3000


def test_outputs_are_read_only_and_copies_are_independent(guided):
    loop = at_rest(guided)
    for k in range(300):
        loop.update(moving(k), loop.torque)
    for name in ("torque", "gravity", "compensation", "drive", "external", "friction", "codes", "position"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(loop, name)[0] = 1
    with pytest.raises(AttributeError):
        loop.torque = np.zeros(6)
    for twin in (copy.copy(loop), copy.deepcopy(loop), pickle.loads(pickle.dumps(loop))):
        q = moving(300)
        twin.update(q, loop.torque)
        assert twin.count == loop.count + 1
    before = loop.torque.copy()
    other = copy.deepcopy(loop)
    loop.update(moving(300), before)
    other.update(moving(300), before)
    assert np.array_equal(loop.torque, other.torque)


# --------------------------------------------------------------------------------------------------------------- walls


def test_a_wall_pushes_inwards_only_and_begins_before_its_place(guided):
    limits = guided.joints["joint_0"].limits
    edge = limits.upper - guided.joints["joint_0"].depth

    def wall(q, speed, side=1.0):
        loop = at_rest(guided)
        begin = POSTURE.copy()
        begin[0] = side * q - speed * T * 900
        loop.reset(begin, gravity=1.0)
        for k in range(900):
            at = begin.copy()
            at[0] += speed * T * (k + 1)
            loop.update(at, loop.torque)
        return loop.drive[0]

    assert wall(edge - 0.3, 0.0) == 0.0
    assert wall(edge + 0.05, 0.0) < -1.0
    assert wall(edge + 0.05, 0.0, side=-1.0) > 1.0
    assert wall(edge - 0.02, 1.0) < -1.0  # comes fast
    assert wall(edge + 0.05, -1.0) == 0.0  # leaves
    assert abs(wall(limits.upper + 0.5, 0.0)) <= limits.effort


def test_a_hand_that_pushes_on_stays_before_the_end_of_the_range():
    path, velocity = polygon([(0, 0, 0), (0, 0.3, 0)], dt=T, duration=0.8, interval=1.4, rounds=1, start=0.1)
    n = 1400
    arm = Arm()
    loop = arm_loop(limits=(-1.2, 0.35), changes={"margin": 0.15})
    joints = dict(loop.joints)
    free = JointLimits(name="other", effort=200.0)
    for name in ("joint_1", "joint_2", "joint_3", "joint_4", "joint_5"):
        own = joints[name]
        joints[name] = replace(own, limits=free.overridden(effort=own.limits.effort), margin=None)
    loop = ArmLoop(six_axis(), joints, interval=T)
    record = guide_whole(
        arm, path[:n], velocity[:n], hand=Hand(stiffness=400, damping=30), loop=loop,
        wrist=Hand(stiffness=20, damping=0.5),
    )  # fmt: skip
    assert record.load[:, 0].max() < 0.35
    assert record.load[:, 0].max() > 0.2
    assert not np.any(record.codes == Status.LATCHED)


# ---------------------------------------------------------------------------------------------------------- admittance


def test_a_virtual_mass_follows_the_hand_and_rests_without_one():
    joints = arm_joints()
    for name, own in joints.items():
        M, F = own.loop.external.inertia, max(own.loop.compensator.friction.law.coulomb())
        joints[name] = replace(
            own, threshold=0.2 * F, admittance=Admittance(
                inertia=M, viscosity=0.5 * F, proportional=1600.0 * M, derivative=56.0 * M, limit=40.0
            ),
        )  # fmt: skip
    loop, arm = ArmLoop(six_axis(), joints, interval=T), Arm()
    path, velocity = polygon([(0, 0, 0), (0, 0.12, 0)], dt=T, duration=0.7, interval=0.8, rounds=1, start=0.1)
    grip = np.ones(len(path))
    grip[900:] = 0.0
    record = guide_whole(
        arm, path, velocity, hand=Hand(stiffness=800, damping=40), wrist=Hand(stiffness=20, damping=0.5),
        loop=loop, grip=grip,
    )  # fmt: skip
    assert np.ptp(record.load[:, 0]) > 0.1
    assert not np.any(record.codes == Status.LATCHED)
    assert np.abs(np.diff(record.load[-100:], axis=0)).max() < 0.3 * T


# -------------------------------------------------------------------------------------------------------- construction


def test_joints_are_matched_by_name_not_by_order():
    joints = arm_joints()
    turned = dict(reversed(list(joints.items())))
    loop = ArmLoop(six_axis(), turned, interval=T)
    assert list(loop.joints) == list(joints)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (lambda j: j.pop("joint_3"), "joint_3"),
        (lambda j: j.update(joint_9=j["joint_3"]), "joint_9"),
        (lambda j: j.clear(), "joint_0, joint_1"),
    ],
)
def test_joints_that_are_missing_or_too_many_are_named(change, named):
    joints = arm_joints()
    change(joints)
    with pytest.raises(InvalidInput, match=named):
        ArmLoop(six_axis(), joints, interval=T)


def test_what_could_not_hold_is_refused_by_name():
    own = arm_joints()["joint_1"]
    with pytest.raises(InvalidInput, match="largest torque of the motor is inf"):
        ArmJoint(loop=own.loop, limits=JointLimits(name="joint_1"))
    with pytest.raises(InvalidInput, match="take all of the range"):
        ArmJoint(loop=own.loop, limits=own.limits.overridden(lower=-0.1, upper=0.1), margin=0.1)
    with pytest.raises(InvalidInput, match="margin"):
        ArmJoint(loop=own.loop, limits=own.limits, margin=np.nan)
    weak = arm_joints()
    weak["joint_1"] = replace(own, limits=own.limits.overridden(effort=50.0))
    with pytest.raises(InvalidInput, match="joint_1.*would not hold"):
        ArmLoop(six_axis(), weak, interval=T)
    with pytest.raises(InvalidInput, match="rigid-body parameters"):
        arm_loop(parameters=np.zeros(12))
    with pytest.raises(InvalidInput, match="coupling"):
        arm_loop(coupling=np.zeros((6, 6)))
    with pytest.raises(InvalidInput, match="brake"):
        arm_loop(brake=-1.0)
    with pytest.raises(InvalidInput, match="positions"):
        arm_loop().reset(np.zeros(5))


def test_coupled_motors_carry_what_their_joints_weigh():
    C = np.eye(6)
    C[4, 5] = 0.3  # motor 6 moves joint 5
    loop, alone = arm_loop(coupling=C), arm_loop()
    motors = np.linalg.solve(C, POSTURE)
    loop.reset(motors, gravity=1.0)
    alone.reset(POSTURE, gravity=1.0)
    loop.update(motors, loop.torque)
    alone.update(POSTURE, alone.torque)
    assert loop.position == pytest.approx(POSTURE)
    assert loop.torque == pytest.approx(C.T @ alone.torque)
    pushed = np.array([0.0, 0.0, 0.0, 0.0, 0.2, -0.1])  # a hand's torque on the joints
    for _ in range(500):
        loop.update(motors, loop.torque - C.T @ pushed)
    assert loop.external == pytest.approx(pushed, abs=1e-3)


# ---------------------------------------------------------------------------------------------------- identified arms


@pytest.fixture(scope="module")
def identified():
    return ArmLoop.from_model(
        arm_model(), six_axis(), interval=T, limits=arm_limits(), bandwidth=60.0, frame="grip"
    )


def test_a_push_on_an_arm_at_rest_is_the_wrench_at_its_grip(identified):
    loop = at_rest(identified)
    pushed = np.array([3.0, -2.0, 4.0, 0.1, 0.05, -0.08])
    jacobian = six_axis().jacobian(POSTURE[None], "grip")[0]
    outside = jacobian.T @ pushed
    for _ in range(600):
        loop.update(POSTURE, loop.torque - outside)
    assert loop.external == pytest.approx(outside, abs=0.02)
    assert loop.wrench == pytest.approx(pushed, rel=0.2, abs=0.05)
    assert loop.covariance.shape == (6, 6)
    assert isinstance(loop.singular, bool)
    with pytest.raises(ValueError, match="read-only"):
        loop.wrench[0] = 1.0
    for twin in (copy.deepcopy(loop), pickle.loads(pickle.dumps(loop))):
        twin.update(POSTURE, loop.torque - outside)
        assert twin.external == pytest.approx(loop.external, abs=1e-9)
        assert twin.wrench == pytest.approx(loop.wrench, rel=1e-6)


def test_bad_readings_of_one_joint_leave_the_estimate_finite(identified):
    loop = at_rest(identified)
    for k in range(900):
        q, applied = moving(k), loop.torque.copy()
        if 400 <= k < 460:
            q[2] = np.nan
        if k == 700:
            applied[4] = np.inf
        loop.update(q, applied)
        assert np.all(np.isfinite(loop.external))
        assert np.all(np.isfinite(loop.wrench))
    assert np.all(loop.codes == Status.OK)
    assert np.abs(loop.external[[0, 2]]).max() < 30.0


def test_friction_offsets_and_inertia_of_a_model_come_along(identified):
    for own, joint in zip(Arm().joints, identified.joints.values(), strict=True):
        assert joint.inertia == own.motor_inertia
        assert joint.loop.compensator.friction.law.rate == own.law.rate
        assert joint.loop.top_speed == TOP
        assert joint.loop.encoder_count == pytest.approx(own.encoder_count)
        assert 0.0 < joint.loop.limit < joint.limits.effort
    loop = at_rest(identified)
    loop.update(POSTURE, loop.torque)
    assert loop.torque == pytest.approx(Arm().weight, abs=1e-9)


def test_a_contact_stiffer_than_the_joints_own_compensates_less():
    """The share times the stiffness of the compensator's contact never exceeds the joint's own stiffness."""

    def of(**options):
        loop = ArmLoop.from_model(arm_model(), six_axis(), interval=T, limits=arm_limits(), **options)
        parts = [joint.loop.compensator for joint in loop.joints.values()]
        return np.array([(c.share, c.friction.law.element.stiffness) for c in parts]).T

    share, usual = of(share=0.8)  # the joints' own is unknown: 1 mrad
    assert share == pytest.approx(0.8)
    for bend, left in ((2e-3, 0.8), (1e-3, 0.8), (5e-4, 0.5), (2.5e-4, 0.25)):
        share, K = of(share=0.8, bend=bend)
        assert share == pytest.approx(left) and usual / K == pytest.approx(bend / 1e-3)
    share, K = of(share=0.8, contact=1e-4)
    assert share == pytest.approx(0.8) and K / usual == pytest.approx(5.0)  # half as stiff as the joints
    share, K = of(share=0.8, contact=1e-3, bend=5e-4)
    assert share == pytest.approx(0.5) and K / usual == pytest.approx(2.0)
    with pytest.raises(InvalidInput, match="contact = 0"):
        of(contact=0.0)


def test_a_curve_that_vanishes_at_zero_speed_is_compensated_as_slow_sliding_is():
    """The fit of an arm leaves zero speed open; a curve that rises from nothing would be a viscosity with a negative sign."""
    speeds, levels = (0.0, 0.05, 2.4), (0.0, 2.0, 3.0)
    curve = Law(rate=Polyline(velocity=speeds, positive=levels, negative=levels))
    known, bend = arm_model(), 1e-3
    model = replace(known, joints=tuple(replace(joint, law=curve) for joint in known.joints))
    loop = ArmLoop.from_model(model, six_axis(), interval=T, limits=arm_limits(), bend=bend)
    low, twice = np.interp((0.12, 0.24), speeds, levels)  # a twentieth of the top speed, and twice that
    rest = low - 2.0 * (twice - low)
    assert 1.9 < rest < 2.0
    for joint in loop.joints.values():
        law = joint.loop.compensator.friction.law
        assert law.torque(np.array([1e-9, -1e-9])) == pytest.approx([rest, -rest], rel=1e-6)
        assert law.element.stiffness == pytest.approx(rest / bend)
        assert law.torque(speeds[1:]) == pytest.approx(levels[1:])
    falling = model.joints[0].law.rate, (3.0, 2.0, 2.5)  # a Stribeck curve is left as it is
    stribeck = replace(
        model.joints[0], law=Law(rate=replace(falling[0], positive=falling[1], negative=falling[1]))
    )
    assert with_slow_sliding(stribeck) is stribeck


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"limits": None}, "largest speed"),
        ({"limits": arm_limits(effort=np.inf)}, "largest torque"),
        ({"frame": "nowhere"}, "nowhere"),
        ({"changes": {"joint_9": {}}}, "joint_9"),
        ({"changes": {"joint_1": {"margn": 0.1}}}, "margn"),
        ({"brake": np.nan}, "brake"),
        ({"share": 1.2}, "share"),
    ],
)
def test_what_a_model_and_a_description_do_not_say_is_asked_for(changes, named):
    options = {"interval": T, "limits": arm_limits()} | changes
    with pytest.raises(InvalidInput, match=named):
        ArmLoop.from_model(arm_model(), six_axis(), **options)


def test_the_coupling_of_a_model_comes_along_in_the_order_of_the_robot():
    model, C = arm_model(), np.eye(6)
    C[4, 5] = 0.3
    turned = replace(model, joints=model.joints[::-1], coupling=tuple(map(tuple, C[::-1, ::-1].tolist())))
    for each in (replace(model, coupling=tuple(map(tuple, C.tolist()))), turned):
        loop = ArmLoop.from_model(each, six_axis(), interval=T, limits=arm_limits())
        assert np.array_equal(loop.coupling, C)
        motors, pushed = np.linalg.solve(C, POSTURE), np.array([0.0, 0.0, 0.0, 0.1, 0.3, -0.2])
        loop.reset(motors, gravity=1.0)
        for _ in range(400):
            loop.update(motors, loop.torque - C.T @ pushed)
        assert loop.external == pytest.approx(pushed, abs=1e-3)


def test_a_model_of_another_arm_is_refused():
    model, robot = arm_model(), six_axis()
    assert model.arm is not None
    other = replace(model, arm=replace(model.arm, urdf_sha256="0" * 64))
    for wrong in (other, replace(model, arm=None)):
        with pytest.raises(InvalidInput):
            ArmLoop.from_model(wrong, robot, interval=T, limits=arm_limits())


def test_a_guided_run_is_drawn(tmp_path):
    pytest.importorskip("matplotlib")
    from backdrive.report.pictures.guide import save_guide

    path, velocity = polygon([(0, 0, 0), (0, 0.05, 0)], dt=T, duration=0.2, interval=0.2, rounds=1, start=0.1)
    loop = arm_loop()
    record = guide_whole(Arm(), path, velocity, hand=Hand(stiffness=400, damping=30), loop=loop)
    limits = {name: joint.limits for name, joint in loop.joints.items()}
    save_guide(tmp_path / "guide.svg", {"guided": record}, limits)
    assert "joint_5" in (tmp_path / "guide.svg").read_text()
    with pytest.raises(InvalidInput, match="0 runs"):
        save_guide(tmp_path / "none.svg", {}, limits)
    with pytest.raises(InvalidInput, match="a loop of 6 joints"):
        guide_whole(Arm(), path[:, :2], velocity, hand=Hand(stiffness=1, damping=1), loop=loop)
