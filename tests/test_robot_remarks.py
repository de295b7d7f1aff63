"""What a description lacks or cannot mean: links without mass, axes of zero, joints that follow others, xacro."""

import pytest

pytest.importorskip("pinocchio")

from backdrive.errors import ReadError
from backdrive.robot import parse_robot

INERTIAL = (
    '<inertial><mass value="1"/><inertia ixx="{0}" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
)


PLAIN = INERTIAL.format(0.1)


def urdf(first=PLAIN, axis="0 0 1", more="", names=("a", "b"), top=""):
    def joint(name, parent, child):
        return (
            f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/><origin xyz="0 0 1"/>'
            f'<axis xyz="{axis}"/><limit lower="-1" upper="1" velocity="1" effort="1"/>{more}</joint>'
        )

    return (
        f'<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">{top}<link name="l0"/><link name="l1">{first}</link>'
        f'<link name="l2">{INERTIAL.format(0.1)}</link>{joint(names[0], "l0", "l1")}{joint(names[1], "l1", "l2")}</robot>'
    )


def test_a_link_without_mass_and_an_inertia_of_no_body_get_a_remark():
    assert parse_robot(urdf()).remarks == ()
    (said,) = parse_robot(urdf(first="")).remarks
    assert "that a moves" in said and "has no mass" in said
    (said,) = parse_robot(urdf(first=INERTIAL.format(0.5))).remarks
    assert "link of a" in said and "sum of the two others" in said


def test_joints_that_follow_others_get_a_remark():
    assert "follows a" in parse_robot(urdf(more='<mimic joint="a"/>')).remarks[0]
    body = '<body><joint name="{0}" range="-1 1"/><geom size="1"/>'
    text = f"<mujoco><worldbody>{body.format('x')}{body.format('y')}</body></body></worldbody>"
    assert parse_robot(text + "</mujoco>").remarks == ()
    tied = parse_robot(text + '<equality><joint joint1="y" joint2="x"/></equality></mujoco>')
    assert "ties y" in tied.remarks[0]


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ({"axis": "0 0 0"}, "axis of joint 'a' is '0 0 0'"),
        ({"top": '<xacro:property name="x" value="1"/>'}, "xacro"),
        ({"top": '<x:include xmlns:x="http://x" filename="f"/>'}, "xacro"),
        ({"axis": "0 0 ${pi}"}, "xacro"),
        ({"names": ("a", "a")}, "two joints are called 'a'"),
    ],
)
def test_what_is_no_description_is_refused(how, words):
    with pytest.raises(ReadError) as caught:
        parse_robot(urdf(**how))
    assert words in str(caught.value)
