"""Tests for log.py."""

import numpy as np
import pytest

from backdrive import Joint, Log
from backdrive.errors import InvalidInput, UnknownName

T = np.arange(5) * 0.1


def two_joints(**more) -> Log:
    q = np.arange(10.0).reshape(5, 2)
    return Log(time=T, joints=(Joint(name="a"), Joint(name="b", unit="m")), position=q, torque=-q, **more)


def test_a_log_cannot_be_changed():
    log = two_joints()
    with pytest.raises(ValueError, match="read-only"):
        log.position[0, 0] = 1.0
    with pytest.raises(AttributeError):
        log.time = T  # type: ignore[misc]


def test_one_column_may_be_given_flat():
    assert Log(time=T, joints=(Joint(name="a"),), velocity=T).velocity.shape == (5, 1)


def test_joints_are_chosen_by_name_and_number_in_the_order_asked():
    log = two_joints()
    assert log.select(["b", "a"]).names == ("b", "a")
    np.testing.assert_array_equal(log.select("b").position[:, 0], log.position[:, 1])
    assert log.select(1).joints[0].unit == "m"


def test_unknown_joint_is_answered_with_the_names():
    with pytest.raises(UnknownName, match="a, b"):
        two_joints().select("elbow")
    with pytest.raises(InvalidInput, match="no joint 7"):
        two_joints().select(7)


def test_between_takes_the_start_and_leaves_the_stop():
    np.testing.assert_allclose(two_joints().between(0.1, 0.3).time, [0.1, 0.2])


def test_motor_side_torque_is_brought_to_the_joint_once():
    log = two_joints().replace(
        joints=(Joint(name="a", torque_side="motor", gear_ratio=100.0), Joint(name="b", unit="m"))
    )
    joint = log.on_joint_side()
    np.testing.assert_array_equal(joint.torque, log.torque * [100.0, 1.0])
    np.testing.assert_array_equal(joint.on_joint_side().torque, joint.torque)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"position": np.zeros((4, 1))}, "shape"),
        ({"torque": T}, "needs position or velocity"),
        ({"position": T, "joints": ()}, "at least one joint"),
        ({"position": np.zeros((5, 2)), "joints": (Joint(name="a"), Joint(name="a"))}, "repeat"),
        ({"position": ["x"] * 5}, "not a number"),
    ],
)
def test_wrong_shapes_are_refused(arguments, said):
    with pytest.raises(InvalidInput, match=said):
        Log(**{"time": T, "joints": (Joint(name="a"),), **arguments})


def test_a_copy_with_another_plan_shares_its_arrays_and_a_writeable_one_is_copied():
    log = two_joints()
    assert log.replace(plan="a plan").position is log.position
    mine = np.zeros((5, 2))
    taken = log.replace(position=mine)
    mine[0, 0] = 7.0
    assert taken.position[0, 0] == 0.0
    view = mine[:]
    view.setflags(write=False)  # read-only, but mine can still be written
    taken = log.replace(position=view)
    mine[0, 0] = 8.0
    assert taken.position[0, 0] == 7.0
