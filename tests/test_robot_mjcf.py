"""Rigid bodies and frames from MJCF and URDF, against MuJoCo's own numbers, and descriptions that leave things out."""

import numpy as np
import pytest

pytest.importorskip("pinocchio")

from backdrive.errors import FileTooLarge, ForbiddenContent, ReadError, UnknownName
from backdrive.plans.limits import read_limits
from backdrive.robot import load_robot, parse_robot

ARM = """
<mujoco model="bench">
  <compiler angle="degree" eulerseq="XyZ"/>
  <option gravity="0.3 0 -9.7"/>
  <default>
    <joint axis="0 1 0" range="-100 100"/>
    <default class="heavy"><geom density="4000"/><default class="round"><geom type="sphere" size="0.05"/></default></default>
  </default>
  <asset><mesh name="shell" file="nowhere.stl"/></asset>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <body name="table" pos="0 0 0.4" quat="0.9 0.1 0.2 0.3">
      <geom type="box" size="0.2 0.2 0.1"/>
      <body name="turret" pos="0.1 0 0.1" euler="20 -30 40">
        <joint name="turn" axis="0.2 0.1 1" pos="0.02 -0.01 0" ref="15"/>
        <geom type="cylinder" size="0.07 0.1" pos="0.01 0 0.05"/>
        <frame pos="0 0.1 0.05" axisangle="1 2 0 35" childclass="heavy">
          <geom type="capsule" fromto="0 0 0 0.1 0.05 0.2" size="0.03"/>
          <geom class="round" pos="0 0.02 0"/>
          <body name="beam" pos="0 0 0.2" xyaxes="1 0.2 0 0 1 0.3">
            <joint name="lift"/>
            <joint name="roll" axis="1 0 0"/>
            <inertial pos="0.1 0.02 0.03" mass="2.5" quat="0.7 0.1 -0.3 0.2" diaginertia="0.02 0.03 0.04"/>
            <geom type="mesh" mesh="shell"/>
            <site name="elbow" pos="0.2 0 0" zaxis="1 1 0.2"/>
            <body name="rail" pos="0.3 0 0" zaxis="1 0 0.5">
              <joint name="slide" type="slide" axis="1 1 0" ref="0.1" range="-1 1"/>
              <geom type="ellipsoid" size="0.05 0.08 0.1" euler="10 20 30" mass="0.7"/>
              <geom type="box" fromto="0 0 0 0.05 0.1 0" size="0.03"/>
              <body name="tool" pos="0 0.05 0.2" quat="0 1 0 0">
                <inertial pos="0 0 0.1" mass="0.4" fullinertia="0.01 0.012 0.008 0.001 0.002 -0.001"/>
                <site name="tip" pos="0 0 0.2"/>
              </body>
            </body>
          </body>
        </frame>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
LINK = '<link name="{}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'


def states(robot, n=30):
    return np.random.default_rng(2).uniform(-1.5, 1.5, (3, n, len(robot.joints)))


def test_mjcf_is_mujocos_own():
    mujoco = pytest.importorskip("mujoco")
    shell = "<mesh name='shell' vertex='0 0 0 1 0 0 0 1 0 0 0 1'/>"  # MuJoCo opens the file, we do not
    truth = mujoco.MjModel.from_xml_string(ARM.replace('<mesh name="shell" file="nowhere.stl"/>', shell))
    data, robot = mujoco.MjData(truth), parse_robot(ARM)
    assert robot.joints == ("turn", "lift", "roll", "slide")
    assert robot.units == ("rad", "rad", "rad", "m")
    q, dq, ddq = states(robot)
    M, h, g = robot.inertia(q), robot.bias(q, dq), robot.gravity(q)
    tau = robot.inverse_dynamics(q, dq, ddq)
    places = {name: (robot.placement(q, name), robot.jacobian(q, name)) for name in ("elbow", "tip")}
    full, linear, angular = np.zeros((4, 4)), np.zeros((3, 4)), np.zeros((3, 4))
    for k in range(q.shape[0]):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[k], 0.0 * dq[k], ddq[k]
        mujoco.mj_forward(truth, data)
        np.testing.assert_allclose(g[k], data.qfrc_bias, atol=1e-9)
        data.qvel[:] = dq[k]
        mujoco.mj_forward(truth, data)
        np.testing.assert_allclose(h[k] + g[k], data.qfrc_bias, atol=1e-9)
        mujoco.mj_fullM(truth, data, full)
        np.testing.assert_allclose(M[k], full, atol=1e-9)
        np.testing.assert_allclose(tau[k], full @ ddq[k] + data.qfrc_bias, atol=1e-9)
        for name, (placed, jacobian) in places.items():
            site = mujoco.mj_name2id(truth, mujoco.mjtObj.mjOBJ_SITE, name)
            np.testing.assert_allclose(placed[k, :3, 3], data.site_xpos[site], atol=1e-9)
            np.testing.assert_allclose(placed[k, :3, :3].ravel(), data.site_xmat[site], atol=1e-9)
            mujoco.mj_jacSite(truth, data, linear, angular, site)
            np.testing.assert_allclose(jacobian[k], np.vstack([linear, angular]), atol=1e-9)


def test_the_simulated_arm_reads_as_a_robot():
    mujoco = pytest.importorskip("mujoco")
    from backdrive.simulation.arm import mjcf

    truth = mujoco.MjModel.from_xml_string(mjcf())
    data, robot = mujoco.MjData(truth), parse_robot(mjcf())
    q, dq, _ = states(robot, 5)
    for k in range(5):
        data.qpos[:], data.qvel[:] = q[k], dq[k]
        mujoco.mj_forward(truth, data)
        bias = robot.bias(q[k], dq[k])[0] + robot.gravity(q[k])[0]
        np.testing.assert_allclose(bias, data.qfrc_bias, atol=1e-9)
    assert {"grip", "flange", "swivel"} <= set(robot.frames)
    assert len(robot.remarks) == 1
    assert "states no range of joint_0" in robot.remarks[0]


def test_a_jacobian_is_the_slope_of_its_placement():
    robot = parse_robot(ARM)
    q, dq, _ = states(robot)
    step = 1e-6
    after, before = (robot.placement(q + s * step * dq, "tip") for s in (1.0, -1.0))
    slope = (after - before) / (2.0 * step)
    turning = slope[:, :3, :3] @ np.swapaxes(robot.placement(q, "tip")[:, :3, :3], 1, 2)
    velocity = np.einsum("nij,nj->ni", robot.jacobian(q, "tip"), dq)
    np.testing.assert_allclose(velocity[:, :3], slope[:, :3, 3], atol=1e-7)
    np.testing.assert_allclose(velocity[:, 3:], turning[:, [2, 0, 1], [1, 2, 0]], atol=1e-7)


def test_frames_are_links_tools_and_sites_and_an_unknown_one_lists_them():
    robot = parse_robot(ARM)
    assert robot.frames == ("table", "turret", "beam", "rail", "tool", "elbow", "tip")
    with pytest.raises(UnknownName, match=r"no frame 'hand'.*table, turret.*tip"):
        robot.jacobian(np.zeros((1, 4)), "hand")


def test_ranges_of_mjcf_are_in_radians_and_missing_ones_are_named():
    robot = parse_robot(ARM.replace('range="-1 1"/>', 'actuatorfrcrange="-50 40"/>'))
    assert robot.ranges[0].upper == pytest.approx(np.deg2rad(100.0))
    assert (robot.ranges[3].lower, robot.ranges[3].effort) == (-100.0, 40.0)  # of the default class, in m
    bare = parse_robot(ARM.replace('range="-100 100"', "").replace('range="-1 1"', ""))
    assert "states no range of turn, lift, roll, slide" in bare.remarks[0]


def urdf(*parts):
    return f'<robot name="r">{"".join(parts)}</robot>'


def hinge(name, parent, child, more="", kind="revolute"):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0.1 0 0"/><axis xyz="0 1 0"/>{more}</joint>'
    )


def test_an_undeclared_world_a_fixed_tool_and_missing_limits_are_met():
    text = urdf(
        LINK.format("arm"),
        '<link name="tool"/>',
        hinge("j", "world", "arm"),
        hinge("mount", "arm", "tool", kind="fixed"),
    )
    robot = parse_robot(text)
    assert robot.joints == ("j",)
    assert robot.frames == ("world", "arm", "tool")
    np.testing.assert_allclose(robot.placement(np.zeros(1), "tool")[0, :3, 3], [0.2, 0.0, 0.0])
    assert "states no range of j" in robot.remarks[0]
    assert robot.ranges[0].upper == np.inf
    stated = parse_robot(
        text.replace("<axis", '<limit lower="-1" upper="2" effort="30" velocity="3"/><axis', 1)
    )
    assert (stated.ranges[0].lower, stated.ranges[0].upper, stated.ranges[0].effort) == (-1.0, 2.0, 30.0)
    assert not stated.remarks


def test_joints_that_move_nothing_heavy_are_named():
    robot = parse_robot(
        urdf(
            LINK.format("a"),
            '<link name="b"/>',
            '<link name="c"/>',
            hinge("j", "world", "a"),
            hinge("k", "a", "b"),
            hinge("l", "b", "c", kind="continuous"),
        )
    )
    assert any("No link that k, l moves has an <inertial>" in r for r in robot.remarks)


def test_a_held_finger_keeps_frames_and_ranges():
    robot = parse_robot(ARM).without_tools(["turn", "lift", "roll"])
    assert robot.joints == ("turn", "lift", "roll")
    assert len(robot.ranges) == 3
    assert robot.jacobian(np.zeros((1, 3)), "tip").shape == (1, 6, 3)


BODY = '<mujoco><worldbody><body name="b"><joint name="j"/><geom size="0.1"/>{}</body></worldbody></mujoco>'
DAMAGED = {
    "mass would come from a mesh": BODY.format('<geom type="mesh" mesh="m"/>'),
    "is free": BODY.replace('<joint name="j"/>', "<freejoint/>"),
    "'j' is ball": BODY.replace('name="j"', 'name="j" type="ball"'),
    "no joint has": BODY.replace('<joint name="j"/>', ""),
    "called 'j'": BODY.format('<joint name="j"/>'),
    "generates bodies": BODY.format('<composite type="cable"/>'),
    "closes a chain": BODY.replace("<worldbody>", '<equality><connect body1="b"/></equality><worldbody>'),
    "class 'x'": BODY.format('<geom class="x"/>'),
    "has no length": BODY.replace('name="j"', 'name="j" axis="0 0 0"'),
    "pos is 'a b c'": BODY.format('<geom size="1" pos="a b c"/>'),
    "by quat and euler": BODY.format('<geom size="1" quat="1 0 0 0" euler="0 0 0"/>'),
    "settotalmass": BODY.replace("<worldbody>", '<compiler settotalmass="3"/><worldbody>'),
    "lacks its mass": BODY.format('<inertial pos="0 0 0"/>'),
}


@pytest.mark.parametrize("words", DAMAGED)
def test_a_damaged_mjcf_gives_a_typed_error(words):
    with pytest.raises(ReadError, match=words) as caught:
        parse_robot(DAMAGED[words])
    assert caught.value.remedy


def test_a_mesh_beside_an_inertial_or_without_mass_is_passed_over():
    inertial = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    mesh = '<geom type="mesh" mesh="m"/>'
    assert parse_robot(BODY.format(mesh + inertial)).parameters[0] == 1.0
    assert parse_robot(BODY.format(mesh.replace("/>", ' mass="0"/>'))).parameters[0] > 0.0


def test_mjcf_names_no_other_file_and_is_no_deeper_than_an_arm():
    with pytest.raises(ForbiddenContent, match="includes"):
        parse_robot(BODY.format('<include file="/etc/passwd"/>'))
    with pytest.raises(ForbiddenContent):
        parse_robot("<!DOCTYPE mujoco>" + BODY)
    with pytest.raises(FileTooLarge):
        parse_robot(BODY.format("<body>" * 2001 + "</body>" * 2001))


def test_limits_are_read_from_mjcf(tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(ARM)
    limits = read_limits(path)
    assert list(limits) == ["turn", "lift", "roll", "slide"]
    assert limits["lift"].upper == pytest.approx(np.deg2rad(100.0))
    assert limits["slide"].unit == "m"


def test_a_file_is_told_by_what_it_holds(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(ARM)
    assert load_robot(path).name == "bench"
