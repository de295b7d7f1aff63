"""Tests for plans/arm*.py, identification/arm_forecast.py and `backdrive plan arm`: a motion for a whole arm."""

import json
from dataclasses import replace

import numpy as np
import pytest

from _commands import called
from backdrive.errors import InvalidInput, ReadError, UnknownName
from backdrive.identification.arm import identify_arm
from backdrive.identification.arm_forecast import forecast_errors, signals_of
from backdrive.logs.log import Joint, Log
from backdrive.plans import ArmPlan, load_plan, plan_from_dict, plan_of, plan_to_dict
from backdrive.plans import arm_search as search
from backdrive.plans.arm_bounds import ArmBounds
from backdrive.plans.arm_collision import Clearance
from backdrive.plans.arm_information import Information
from backdrive.plans.arm_shapes import capsules, floor_at, read_shapes
from backdrive.plans.limits import read_limits
from backdrive.plans.tables import sample
from backdrive.robot import load_robot

pytest.importorskip("pinocchio")
pytest.importorskip("coal")

LINK = """<link name="l{i}"><inertial><origin xyz="0.15 0 0.02"/><mass value="{m}"/>
  <inertia ixx="0.01" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><origin xyz="0.15 0 0" rpy="0 1.5708 0"/><geometry>{shape}</geometry></collision></link>"""
JOINT = """<joint name="j{i}" type="revolute"><origin xyz="{x} 0 {z}"/><parent link="l{p}"/><child link="l{i}"/>
  <axis xyz="{axis}"/><limit lower="-2.6" upper="2.6" velocity="2" effort="{effort}"{more}/></joint>"""
CAN = '<cylinder radius="0.04" length="0.24"/>'


def description(more: str = ' acceleration="10"', shape: str = CAN) -> str:
    links = "".join(LINK.format(i=i, m=3.0 - i, shape=shape) for i in (1, 2))
    joints = JOINT.format(i=1, p=0, x=0, z=0.2, axis="0 0 1", effort=60, more=more)
    joints += JOINT.format(i=2, p=1, x=0.3, z=0.1, axis="0 1 0", effort=40, more=more)
    joints += JOINT.format(i=3, p=2, x=0.3, z=0, axis="0 1 0", effort=20, more=more)
    third = LINK.format(i=3, m=1.0, shape=shape)
    return f'<robot name="a"><link name="l0"/>{links}{third}{joints}</robot>'


@pytest.fixture
def urdf(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(description())
    return path


@pytest.fixture
def brief(monkeypatch):
    """Search for a moment only."""
    for name, value in (("STARTS", 1), ("FIRST", 4), ("LAST", 8)):
        monkeypatch.setattr(search, name, value)


def small(**changes) -> ArmPlan:
    plan = ArmPlan(
        ("a", "b"),
        ("rad", "rad"),
        (0.2, -0.3),
        ((0.3, 0.1), (0.0, 0.2)),
        ((0.1, 0.0), (0.2, -0.1)),
        6.0,
        periods=3,
        slow_time=4.0,
        ramp=1.0,
    )
    return replace(plan, **changes)


def test_a_plan_begins_and_ends_at_rest_where_it_began_and_is_smooth():
    plan = small(start=2.0)
    t = 2.0 + np.array([0.0, plan.duration])
    assert np.allclose(plan.position(t), plan.home)
    assert np.allclose(plan.velocity(t), 0.0)
    assert np.allclose(plan.acceleration(t), 0.0)
    t = 2.0 + np.linspace(0.01, plan.duration - 0.01, 3000)
    h = 1e-5
    slope = (plan.position(t + h) - plan.position(t - h)) / (2 * h)
    assert np.allclose(slope, plan.velocity(t), atol=1e-7)
    slope = (plan.velocity(t + h) - plan.velocity(t - h)) / (2 * h)
    assert np.allclose(slope, plan.acceleration(t), atol=1e-6)
    (_, _), (begin, end) = plan.windows()
    slow = np.abs(plan.velocity(np.linspace(begin, end, 300))).max()
    assert slow <= plan.slow * np.abs(plan.series(np.linspace(0, 6, 300), 1)).max() * 1.001


def test_a_plan_of_one_joint_is_its_column():
    plan = small()
    one = plan_of(plan, "b")
    t = np.linspace(0, plan.duration, 50)
    assert np.array_equal(one.position(t), plan.position(t)[:, 1])
    assert np.array_equal(one.velocity(t), plan.velocity(t)[:, 1])
    low, high = one.position_range
    assert low <= one.position(t).min() <= one.position(t).max() <= high
    with pytest.raises(UnknownName, match="'c'"):
        plan.plan_of("c")


def test_a_plan_survives_its_file_and_a_damaged_one_is_refused():
    plan = small(noise=(0.1, 0.2), purpose=("friction",))
    data = json.loads(json.dumps(plan_to_dict(plan)))
    assert plan_from_dict(data) == plan
    assert sample(plan, 100.0).channels["position"].shape[1] == 2
    for change in (
        {"sine": [[0.1]]},
        {"units": ["rad", "in"]},
        {"period": 0.1},
        {"odd": 1},
        {"joints": ["a", "a"]},
    ):
        with pytest.raises(ReadError):
            plan_from_dict(data | change)


def test_gradients_of_information_limits_and_distances_are_those_of_difference_quotients(urdf):
    robot = load_robot(urdf)
    limits = list(read_limits(urdf).values())
    shapes, without = read_shapes(urdf, robot)
    low, high = np.full(3, -2.6), np.full(3, 2.6)
    clearance = Clearance.of(robot, [*shapes, floor_at(0.0)], low, high, 0.05)
    bounds = ArmBounds.of(robot, limits, friction=np.ones(3), clearance=clearance)
    assert not without
    assert len(clearance.pairs)
    random = np.random.default_rng(1)
    x, d, h = random.normal(size=(3, 9, 3)), random.normal(size=(3, 9, 3)), 1e-6
    x[1:] *= 3.0
    for purpose in (("friction", "inertia", "gravity"), ("friction",), ("payload", "force")):
        told = Information(robot=robot, noise=np.ones(3), transition=np.full(3, 0.1), purpose=purpose)
        value, slope, torque, by_state = told.gradient(*x, 2.0)
        assert value == pytest.approx(told.value(*x, 2.0))
        quotient = (told.value(*(x + h * d), 2.0) - told.value(*(x - h * d), 2.0)) / (2 * h)
        assert np.sum(slope * d) == pytest.approx(quotient, rel=1e-3, abs=1e-6)

    def penalty(y):
        tau = robot.inverse_dynamics(*y)
        return bounds.penalty(*y, tau, by_state)[0]

    total, slope = bounds.penalty(*x, torque, by_state)
    assert total > 0.0
    assert np.sum(slope * d) == pytest.approx((penalty(x + h * d) - penalty(x - h * d)) / (2 * h), rel=1e-3)


def test_the_command_plans_within_limits_says_errors_and_repeats_itself(urdf, tmp_path, brief):
    words = (
        "plan",
        "arm",
        "--urdf",
        urdf,
        "--duration",
        "12",
        "--rate",
        "100",
        "--draw",
        "none",
        "--floor",
        "-0.4",
        "--json",
    )
    done = called(*words, "-o", tmp_path / "one")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    plan = load_plan(tmp_path / "one" / "plan.json")
    assert plan.duration == pytest.approx(12.0)
    t = np.linspace(0, 12, 4000)
    assert np.abs(plan.position(t)).max() <= 2.6 * 0.9501
    assert np.abs(plan.velocity(t)).max() <= 2.0 * 0.9501
    assert np.abs(plan.acceleration(t)).max() <= 10.0 * 0.9501
    robot = load_robot(urdf)
    torque = robot.inverse_dynamics(plan.position(t), plan.velocity(t), plan.acceleration(t))
    assert np.all(np.abs(torque).max(axis=0) <= 0.9 * np.array([60, 40, 20]))
    errors = told["standard_errors"]
    assert {e["parameter"] for e in errors} >= {"coulomb", "viscous", "offset", "inertia", "mx"}
    assert all(e["standard_error"] > 0 for e in errors)
    assert any("noise" in note for note in told["notes"])
    called(*words, "-o", tmp_path / "two")
    assert (tmp_path / "one" / "plan.json").read_bytes() == (tmp_path / "two" / "plan.json").read_bytes()
    said = called(
        *words[:-1], "-o", tmp_path / "three", "--around", "j1=0.5,j2=0.3,j3=-0.5", "--noise", "j2=0.3"
    )
    assert said.returncode == 0, said.stderr
    assert "Standard errors to be expected" in said.stdout
    assert load_plan(tmp_path / "three" / "plan.json").center == (0.5, 0.3, -0.5)


def test_a_search_tells_more_than_where_it_began(urdf, brief):
    robot = load_robot(urdf)
    bounds = ArmBounds.of(robot, list(read_limits(urdf).values()), friction=np.ones(3))
    told = Information(
        robot=robot, noise=np.ones(3), transition=np.full(3, 0.1), purpose=("friction", "gravity")
    )
    steps: list[str] = []
    task = search.Search(information=told, bounds=bounds, duration=30.0, progress=steps.append)
    plan = task.run()
    timed = search.timing(30.0)
    random = np.random.default_rng(0)
    start = task._start(random, task._centers(random)[0], timed["period"])
    begun = told.value(*task._states(start, timed["period"])[:3], 1.0)
    s = np.linspace(0, plan.period, 160, endpoint=False)
    ended = told.value(*(plan.series(s, k) for k in range(3)), 1.0)
    assert ended < begun - 0.5  # so much smaller is the logarithm of a variance
    assert len(steps) > 8


def test_expected_errors_are_those_that_a_fit_of_white_noise_states(urdf):
    robot = load_robot(urdf)
    random = np.random.default_rng(3)
    sine, cosine = 0.35 * random.normal(size=(2, 3, 5)) / np.arange(1, 6)
    plan = ArmPlan(
        robot.joints,
        robot.units,
        (0.1, 0.4, -0.6),
        sine.tolist(),
        cosine.tolist(),
        8.0,
        periods=4,
        noise=(0.2, 0.15, 0.1),
    )
    expected = forecast_errors([signals_of(plan, robot)], robot, np.array(plan.noise), np.ones(3))
    t = np.arange(0.0, plan.duration, 0.005)
    q, dq, ddq = plan.position(t), plan.velocity(t), plan.acceleration(t)
    tau = robot.inverse_dynamics(q, dq, ddq) + 1.5 * np.sign(dq) + 0.5 * dq + 0.02 * ddq
    tau += np.array(plan.noise) * np.sqrt(200.0 / 10.0) * random.standard_normal(tau.shape)
    log = Log(time=t, joints=tuple(Joint(name=n) for n in robot.joints), position=q, torque=tau, plan=plan)
    _, evidence, _ = identify_arm(log, robot, held_out=[log.rows(slice(0, 800))])
    beside = {(p.joint, p.name): p for e in evidence for p in e.precision}
    assert len(beside) == len(expected)
    ratios = np.array([beside[p.joint, p.name].achieved / p.expected for p in expected if p.shows])
    assert np.mean((ratios > 1 / 1.5) & (ratios < 1.5)) >= 0.8
    friction = [p for p in beside.values() if p.of_friction]
    assert all(0.5 < p.achieved / p.expected < 2.0 for p in friction)
    alone = identify_arm(log.replace(plan=None), robot, held_out=[log.rows(slice(0, 800))])[1]
    assert all(p.expected > 0 for e in alone for p in e.precision)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--for", "speed"), "speed"),
        (("--around", "j1=0"), "j2, j3"),
        (("--around", "j1=0,j2=0,j4=1"), "j4"),
        (("--around", "j1=5,j2=0,j3=0"), "outside its range"),
        (("--box", "j1=1"), "JOINT=LOW:HIGH"),
        (("--box", "j1=-4:4"), "leave its range"),
        (("--limit", "j1.power=3"), "power"),
        (("--reserve", "0.7"), "margin"),
        (("--clearance", "-1"), "not a distance"),
        (("--noise", "loud"), "not a number"),
        (("--duration", "2"), "too short"),
        (("--friction", "100"), "friction"),
        (("--joint", "j9"), "j9"),
        (("--joint", "j1", "--joint", "j3"), "lies before one of them"),
        (("--frame", "flange"), "no frame"),
        (("--packages", "nowhere"), "no folder"),
        (("--stroke", "1"), "does not apply"),
    ],
)
def test_bad_input_names_itself_and_the_way_out(urdf, tmp_path, brief, words, message):
    done = called("plan", "arm", "--urdf", urdf, "-o", tmp_path / "out", "--draw", "none", *words)
    assert done.returncode == 2, done.stdout
    assert message in done.stderr
    assert not (tmp_path / "out").exists()


def test_missing_limits_and_meshes_are_named(tmp_path, brief):
    path = tmp_path / "bare.urdf"
    path.write_text(description(more="", shape='<mesh filename="package://x/y.stl"/>'))
    words = ("plan", "arm", "--urdf", path, "-o", tmp_path / "out", "--draw", "none", "--duration", "10")
    done = called(*words)
    assert done.returncode == 2
    assert "acceleration of j1, j2, j3 (--acceleration-limit)" in done.stderr
    done = called(*words, "--acceleration-limit", "8")
    assert done.returncode == 0, done.stderr
    told = " ".join(done.stdout.split())
    assert (
        "Meshes of l1, l2, l3 were not read: give the folder" in told
        and "Capsules from joint to joint replace them" in told
    )
    done = called(*words, "--acceleration-limit", "8", "--packages", tmp_path)
    assert done.returncode != 0
    assert "no mesh 'package://x/y.stl'" in done.stderr
    assert called("plan", "arm").returncode == 2


def test_a_plan_of_other_joints_is_refused_for_an_arm(urdf):
    with pytest.raises(InvalidInput, match="The plan moves a, b"):
        signals_of(small(), load_robot(urdf))


def test_capsules_stand_in_for_links_whose_meshes_are_not_read(tmp_path):
    path = tmp_path / "bare.urdf"
    path.write_text(description(shape='<mesh filename="package://x/y.stl"/>'))
    robot = load_robot(path)
    shapes, without = read_shapes(path, robot)
    assert shapes == [] and without == ["l1", "l2", "l3"]
    rods, bare = capsules(robot, [*without, "l0"])
    assert [rod.link for rod in rods] == ["l1", "l2", "l3"] and bare == ["l0"]
    for rod, m, length in zip(
        rods, (2.0, 1.0, 1.0), (np.hypot(0.3, 0.1), 0.3, 2.0 * np.hypot(0.15, 0.02)), strict=True
    ):
        along = rod.placement[:3, 2]
        turning = along @ np.diag([0.01, 0.05, 0.05]) @ along
        assert rod.geometry.radius == pytest.approx(np.sqrt(2.0 * turning / m))
        assert 2.0 * rod.geometry.halfLength == pytest.approx(length)
        assert rod.placement[:3, 3] == pytest.approx(0.5 * length * along)
    folded = Clearance.of(robot, rods, np.full(3, -2.6), np.full(3, 2.6), 0.02)
    assert folded.narrowest(np.array([[0.0, 0.0, 0.0]]))[0] > 0.0 or not len(folded.pairs)


MJCF = """<mujoco model="a"><compiler angle="radian"/>
<default><geom contype="1"/><default class="seen"><geom contype="0" conaffinity="0"/></default></default>
<worldbody><geom type="plane" size="1 1 0.1"/>
 <body name="l1" pos="0 0 0.2"><joint name="j1" axis="0 0 1" range="-2.6 2.6" actuatorfrcrange="-60 60"/>
  <inertial pos="0.15 0 0.02" mass="2" diaginertia="0.01 0.05 0.05"/>
  <geom type="cylinder" fromto="0.03 0 0 0.27 0 0" size="0.04"/><geom class="seen" type="mesh" mesh="nice"/>
  <body name="l2" pos="0.3 0 0.1"><joint name="j2" axis="0 1 0" range="-2.6 2.6" actuatorfrcrange="-40 40"/>
   <inertial pos="0.15 0 0.02" mass="1" diaginertia="0.01 0.05 0.05"/>
   <frame pos="0.1 0 0"><geom type="box" size="0.1 0.03 0.02" pos="0.05 0 0"/></frame>
   <body name="l3" pos="0.3 0 0"><joint name="j3" axis="0 1 0" range="-2.6 2.6" actuatorfrcrange="-20 20"/>
    <inertial pos="0.15 0 0.02" mass="1" diaginertia="0.01 0.05 0.05"/>
    <geom type="capsule" size="0.04 0.1" pos="0.15 0 0" euler="0 1.5707963 0"/><geom type="mesh" mesh="hand"/>
    <geom type="ellipsoid" size="0.05 0.04 0.03"/><geom type="sphere" size="0.05"/>
</body></body></body></worldbody></mujoco>"""


def test_shapes_of_an_mjcf_are_those_that_mujoco_has(tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(MJCF)
    robot = load_robot(path)
    shapes, without = read_shapes(path, robot)
    assert without == ["l3"] and [s.link for s in shapes] == ["l1", "l2", "l3", "l3", "l3"]
    mujoco = pytest.importorskip("mujoco")
    bare = MJCF.replace('<geom class="seen" type="mesh" mesh="nice"/>', "").replace(
        '<geom type="mesh" mesh="hand"/>', ""
    )
    model = mujoco.MjModel.from_xml_string(bare)
    data = mujoco.MjData(model)
    for q in np.random.default_rng(0).uniform(-1.5, 1.5, (5, 3)):
        data.qpos[:] = q
        mujoco.mj_forward(model, data)
        for k, shape in enumerate(shapes):
            placed = robot.placement(q[None], shape.link)[0] @ np.linalg.inv(
                robot.model.frames[robot.frame(shape.link)].placement.homogeneous
            )
            here = placed @ shape.placement
            assert here[:3, 3] == pytest.approx(data.geom_xpos[k + 1], abs=1e-6)
            turned = here[:3, :3].T @ data.geom_xmat[k + 1].reshape(3, 3)
            assert np.abs(turned[2, 2]) == pytest.approx(1.0, abs=1e-6)
    sizes = model.geom_size[1:]
    cylinder, box, capsule, ellipsoid, sphere = (s.geometry for s in shapes)
    assert (cylinder.radius, cylinder.halfLength) == pytest.approx(sizes[0][:2])
    assert np.ravel(box.halfSide) == pytest.approx(sizes[1])
    assert (capsule.radius, capsule.halfLength) == pytest.approx(sizes[2][:2])
    assert np.ravel(ellipsoid.radii) == pytest.approx(sizes[3]) and sphere.radius == pytest.approx(0.05)


def test_the_command_plans_by_an_mjcf(tmp_path, brief):
    path = tmp_path / "arm.xml"
    path.write_text(MJCF)
    words = ("plan", "arm", "--urdf", path, "-o", tmp_path / "out", "--draw", "none", "--duration", "10")
    done = called(*words, "--acceleration-limit", "8")
    assert done.returncode == 2 and "velocity of j1, j2, j3 (--velocity-limit)" in done.stderr
    done = called(*words, "--acceleration-limit", "8", "--velocity-limit", "2")
    assert done.returncode == 0, done.stderr
    assert "Meshes of l3 were not read" in " ".join(done.stdout.split())
    plan = load_plan(tmp_path / "out" / "plan.json")
    time = np.arange(0.0, plan.duration, 0.01)
    q = plan.position(time)
    assert np.abs(q).max() < 2.6 and np.abs(plan.velocity(time)).max() <= 2.0
    robot = load_robot(path)
    shapes, _ = read_shapes(path, robot)
    apart = Clearance.of(robot, shapes, np.full(3, -2.6), np.full(3, 2.6), 0.02)
    assert apart.narrowest(q)[0] > -1e-6
