"""Rigid bodies from a URDF, against closed forms, brute force and hostile files."""

import re
import sys

import numpy as np
import pytest

from backdrive.errors import (
    BackdriveError,
    FileTooLarge,
    ForbiddenContent,
    InvalidInput,
    MissingExtra,
    ReadError,
)
from backdrive.robot import PER_LINK, load_robot, parse_robot

G = 9.81


def link(name, mass=0.0, com="0 0 0", inertia=(0.0, 0.0, 0.0)):
    xx, yy, zz = inertia
    return (
        f'<link name="{name}"><visual><geometry><mesh filename="package://nowhere/{name}.dae"/></geometry></visual>'
        f'<inertial><mass value="{mass}"/><origin xyz="{com}"/>'
        f'<inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )


def joint(name, parent, child, axis="0 1 0", xyz="0 0 0", kind="revolute"):
    limit = '<limit effort="1" velocity="1" lower="-1" upper="1"/>' if kind != "continuous" else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}"/><axis xyz="{axis}"/>{limit}</joint>'
    )


def urdf(*parts):
    return f'<robot name="r">{"".join(parts)}</robot>'


PENDULUM = urdf(link("base"), link("rod", 2.0, "0 0 -0.3", (0.01, 0.05, 0.02)), joint("swing", "base", "rod"))
ARM = urdf(
    link("base"),
    link("l1", 4.0, "0.01 0.02 0.1", (0.03, 0.02, 0.04)),
    link("l2", 3.0, "0.2 0.01 -0.02", (0.01, 0.06, 0.05)),
    link("l3", 1.5, "0.05 -0.02 0.1", (0.02, 0.01, 0.015)),
    joint("turn", "base", "l1", "0 0 1", kind="continuous"),
    joint("lift", "l1", "l2", "0 1 0", "0 0.1 0.3"),
    joint("slide", "l2", "l3", "0 0 1", "0.4 0 0", kind="prismatic"),
)


@pytest.fixture
def arm():
    return parse_robot(ARM)


@pytest.fixture
def state(arm):
    return np.random.default_rng(1).uniform(-2, 2, (3, 50, len(arm.joints)))


def test_pendulum_matches_its_closed_form():
    robot = parse_robot(PENDULUM)
    q, dq, ddq = np.random.default_rng(0).uniform(-3, 3, (3, 20, 1))
    expected = (0.05 + 2.0 * 0.3**2) * ddq + 2.0 * G * 0.3 * np.sin(q)
    np.testing.assert_allclose(robot.inverse_dynamics(q, dq, ddq), expected, atol=1e-12)
    np.testing.assert_allclose(robot.inertia(q)[:, 0], np.full((20, 1), 0.05 + 2.0 * 0.3**2))
    np.testing.assert_allclose(robot.gravity(q), 2.0 * G * 0.3 * np.sin(q), atol=1e-12)
    np.testing.assert_allclose(robot.bias(q, dq), 0.0, atol=1e-12)


def test_regressor_times_parameters_is_inverse_dynamics(arm, state):
    expected = arm.inverse_dynamics(*state)
    Y = arm.regressor(*state)
    assert Y.shape == (50, 3, 30)
    np.testing.assert_allclose(Y @ arm.parameters, expected, atol=1e-11)


def test_inertia_bias_and_gravity_add_up(arm, state):
    q, dq, ddq = state
    M = arm.inertia(q)
    np.testing.assert_array_equal(M, np.swapaxes(M, 1, 2))
    assert np.all(np.linalg.eigvalsh(M) > 0)
    parts = np.einsum("nij,nj->ni", M, ddq) + arm.bias(q, dq) + arm.gravity(q)
    np.testing.assert_allclose(parts, arm.inverse_dynamics(q, dq, ddq), atol=1e-11)


def test_gravity_is_the_slope_of_potential_energy(arm, state):
    q, zero = state[0], np.zeros_like(state[0])
    power = (arm.inverse_dynamics(q, zero, zero) * state[1]).sum(axis=1)

    def energy(q):  # heights of the three centres of mass, by hand
        lift, slide = q[:, 1], q[:, 2]
        z2 = 0.3 - 0.2 * np.sin(lift) - 0.02 * np.cos(lift)
        z3 = 0.3 - 0.45 * np.sin(lift) + (slide + 0.1) * np.cos(lift)
        return G * (3.0 * z2 + 1.5 * z3)

    step = 1e-6
    expected = (energy(q + step * state[1]) - energy(q - step * state[1])) / (2 * step)
    np.testing.assert_allclose(power, expected, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("text", [PENDULUM, ARM])
def test_base_parameters_are_as_many_as_the_brute_force_rank(text):
    robot = parse_robot(text)
    J = len(robot.joints)
    state = np.random.default_rng(5).normal(size=(3, 300, J))
    stacked = robot.regressor(*state).reshape(-1, PER_LINK * J)
    singular = np.linalg.svd(stacked, compute_uv=False)
    expected = int(np.sum(singular > 1e-10 * singular[0]))
    assert robot.base.columns.size == expected
    assert np.linalg.matrix_rank(stacked[:, robot.base.columns]) == expected


def test_base_relation_keeps_the_torque(arm, state):
    theta = np.random.default_rng(2).normal(size=arm.parameters.size)
    Y = arm.regressor(*state)
    base = arm.base
    np.testing.assert_allclose(Y[:, :, base.columns] @ (base.relation @ theta), Y @ theta, atol=1e-9)
    np.testing.assert_array_equal(base.relation[:, base.columns], np.eye(base.columns.size))


def test_standard_parameters_have_the_base_parameters_asked_for_and_stay_near(arm):
    rng = np.random.default_rng(3)
    truth = arm.parameters + rng.normal(size=arm.parameters.size)
    beta, spread = arm.base.relation @ truth, rng.uniform(0.5, 2.0, truth.size)
    found = arm.base.standard(beta, arm.parameters, spread)
    np.testing.assert_allclose(arm.base.relation @ found, beta, atol=1e-10)
    cost = [np.sum(((theta - arm.parameters) / spread) ** 2) for theta in (found, truth)]
    assert cost[0] < cost[1]
    np.testing.assert_allclose(
        arm.base.standard(arm.base.relation @ arm.parameters, arm.parameters, spread),
        arm.parameters,
        atol=1e-10,
    )


def test_units_and_a_joint_without_limits(arm, state):
    assert arm.joints == ("turn", "lift", "slide")
    assert arm.units == ("rad", "rad", "m")
    limited = parse_robot(
        ARM.replace('"continuous"', '"revolute"').replace(
            '0 0 1"/></joint>', '0 0 1"/><limit effort="1" velocity="1"/></joint>', 1
        )
    )
    np.testing.assert_allclose(arm.inverse_dynamics(*state), limited.inverse_dynamics(*state), atol=1e-11)


def test_joints_are_matched_by_name(arm):
    np.testing.assert_array_equal(arm.order_in(["slide", "camera", "turn", "lift"]), [2, 3, 0])
    with pytest.raises(
        InvalidInput, match=r"lift, slide.*turn, lift, slide.*\(turn, j2, j3\).*names=.turn,lift,slide"
    ):
        arm.order_in(["turn", "j2", "j3"])
    with pytest.raises(InvalidInput, match=r"3 joints.*the log has 2.*`fixed`"):
        arm.order_in(["turn", "lift"])


def test_a_tool_beyond_the_logged_joints_is_held(arm):
    held = arm.without_tools(["lift", "turn"])
    assert held.joints == ("turn", "lift")
    q, dq, ddq = np.random.default_rng(4).normal(size=(3, 10, 2))
    still = [np.hstack([x, np.zeros((10, 1))]) for x in (q, dq, ddq)]
    expected = arm.inverse_dynamics(*still)[:, :2]
    np.testing.assert_allclose(held.inverse_dynamics(q, dq, ddq), expected, atol=1e-11)
    assert arm.without_tools(["turn", "slide"]) is arm  # 'lift' carries 'slide'
    assert arm.without_tools(["turn", "lift", "other"]) is arm  # 'other' may be 'slide' by another name


def test_bad_states_are_refused(arm, state):
    with pytest.raises(InvalidInput, match=r"\(50, 2\).*3 joints"):
        arm.gravity(state[0][:, :2])
    with pytest.raises(InvalidInput, match="NaN"):
        arm.gravity(np.full((2, 3), np.nan))


def test_meshes_are_not_looked_for(tmp_path):
    path = tmp_path / "r.urdf"
    path.write_text(ARM)
    assert load_robot(path).sha256 == parse_robot(ARM).sha256


FORBIDDEN = [
    '<!DOCTYPE robot SYSTEM "http://127.0.0.1/x.dtd"><robot name="r"><link name="a"/></robot>',
    '<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]><robot name="r"><link name="&x;"/></robot>',
    '<!DOCTYPE r [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]><robot name="&b;"><link name="a"/></robot>',
]
ring = joint("j1", "a", "b") + joint("j2", "b", "a")
DAMAGED = [
    "",
    "not xml",
    ARM[:400],
    "<sdf/>",
    urdf(),
    urdf(link("a")),
    urdf(link("base"), link("a"), link("b"), ring),
    urdf(link("a"), link("a"), link("b"), joint("j", "a", "b")),
    urdf(link("a"), link("b"), link("c"), joint("j", "a", "b")),
    urdf(link("a"), link("b"), joint("j", "a", "nowhere")),
    urdf(link("a"), link("b"), link("c"), joint("j", "a", "c"), joint("k", "b", "c")),
    urdf(link("a"), link("b", 1.0), joint("j", "a", "b", kind="floating")),
    urdf(link("a"), link("b", 1.0), joint("j", "a", "b", kind="warp")),
    ARM.replace('mass value="3.0"', 'mass value="nan"'),
    ARM.replace('mass value="3.0"', 'mass value="heavy"'),
    ARM.replace("0 0.1 0.3", "0 inf 0.3"),
    ARM.replace('mass value="3.0"', 'mass value="-3.0"'),
]


@pytest.mark.parametrize("text", FORBIDDEN)
def test_a_document_type_is_refused(text):
    with pytest.raises(ForbiddenContent):
        parse_robot(text)


@pytest.mark.parametrize("text", DAMAGED)
def test_a_damaged_description_gives_a_typed_error(text, capfd):
    with pytest.raises(ReadError) as caught:
        parse_robot(text)
    assert caught.value.remedy


def test_a_mass_and_a_moment_below_nothing_are_refused_with_the_link():
    heavy = urdf(link("a"), link("b", 1.0), joint("j", "a", "b"))
    assert parse_robot(heavy).joints == ("j",)
    for wrong in (
        heavy.replace('mass value="1.0"', 'mass value="-1.0"'),
        re.sub(r'iyy="[^"]*', 'iyy="-0.1', heavy),
    ):
        assert wrong != heavy
        with pytest.raises(ReadError, match=r"link '[ab]'.*less than nothing"):
            parse_robot(wrong)


def test_too_long_a_chain_is_refused_before_anything_recurses_along_it():
    links = [link(f"l{i}") for i in range(2000)]
    joints = [joint(f"j{i}", f"l{i}", f"l{i + 1}") for i in range(1999)]
    with pytest.raises(FileTooLarge):
        parse_robot(urdf(*links, *joints))


def test_mutated_descriptions_never_escape_as_something_else(capfd):
    rng = np.random.default_rng(6)
    source = np.frombuffer(ARM.encode(), dtype=np.uint8)
    outcomes = set()
    for _ in range(300):
        data = source.copy()
        at = rng.integers(0, data.size, rng.integers(1, 4))
        data[at] = rng.integers(32, 127, at.size)
        try:
            parse_robot(data.tobytes())
            outcomes.add("read")
        except BackdriveError:
            outcomes.add("refused")
    assert outcomes == {"read", "refused"}


def test_a_missing_file_says_so(tmp_path):
    with pytest.raises(ReadError, match=r"gone\.urdf"):
        load_robot(tmp_path / "gone.urdf")


@pytest.mark.parametrize("module", ["pinocchio", "defusedxml.ElementTree"])
def test_without_the_extra_the_error_names_it(module, monkeypatch):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtra, match=r'pip install "backdrive\[arm\]"'):
        parse_robot(ARM)
