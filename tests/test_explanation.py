"""Logs of other joints or another robot are refused, and pushed ones are not."""

import numpy as np
import pytest

pytest.importorskip("pinocchio")

from _arm_force import PUSH, ROBOT, SLIDING, log_of
from backdrive.errors import InvalidInput, NotIdentifiable, UnknownName
from backdrive.external import estimate_force
from backdrive.logs.readers._map_parts import without_channels

HOW = {"robot": ROBOT, "method": "momentum", "bandwidth": 60.0}


def renamed(a, b):
    names = list(ROBOT.joints)
    names[a], names[b] = names[b], names[a]
    return tuple(names)


@pytest.mark.parametrize("pair", [(1, 2), (3, 4)])
def test_two_joints_in_each_others_place_are_named(pair):
    log = log_of(0.0 * PUSH, n=4000, names=renamed(*pair))
    with pytest.raises(
        InvalidInput, match=rf"[Ww]ith j{pair[0]} and j{pair[1]} in each other's place.*torque-share"
    ):
        estimate_force(SLIDING, log, **HOW)
    estimate = estimate_force(SLIDING, log, accept=("torque-share",), **HOW)
    assert any("in each other's place" in line for line in estimate.remarks)


def test_a_joint_of_the_other_sign_is_named():
    log = log_of(0.0 * PUSH, n=4000)
    sign = np.array([1.0, 1.0, -1.0, 1.0, 1.0, 1.0])
    with pytest.raises(InvalidInput, match="sign of j2 turned round"):
        estimate_force(SLIDING, log.replace(torque=log.torque * sign), **HOW)


def test_a_force_that_acts_all_the_time_is_estimated_with_a_remark():
    estimate = estimate_force(SLIDING, log_of(PUSH, n=4000), **HOW)
    assert any("explains little of the torque" in line for line in estimate.remarks)
    free = estimate_force(SLIDING, log_of(0.0 * PUSH, n=4000), **HOW)
    assert not any("explains" in line or "exceeds its 95 %" in line for line in free.remarks)


def test_free_motion_of_another_robot_gets_a_remark_and_its_file_is_named():
    log, quiet = log_of(0.0 * PUSH, n=4000), log_of(0.0 * PUSH, n=4000, seed=1)
    assert not any(
        "does not fit" in line for line in estimate_force(SLIDING, log, free=[quiet], **HOW).remarks
    )
    heavy = quiet.replace(torque=quiet.torque + np.array([0.0, 4.0, 0.0, 0.0, 0.0, 0.0]))
    remarks = estimate_force(SLIDING, log, free=[heavy], **HOW).remarks
    assert any("The free motion does not fit the model" in line and "j1" in line for line in remarks)
    with pytest.raises(NotIdentifiable, match="Free motion, a log: "):
        estimate_force(SLIDING, log, free=[quiet.rows(np.arange(quiet.time.size) < 40)], **HOW)
    with pytest.raises(UnknownName, match="torque-share"):
        estimate_force(SLIDING, log, accept=("all",), **HOW)


def test_free_motion_needs_no_channels_that_are_only_compared():
    text = 't=t,q=q1..q6,tau=(2,-1)*(a,b), wrench=(fx,fy), tau_ext="a,tau=b",temp=c'
    assert without_channels(text, ("tau_ext", "wrench")) == "t=t,q=q1..q6,tau=(2,-1)*(a,b),temp=c"
    assert without_channels("tau_ext=a", ("tau_ext",)) is None
    assert without_channels(None, ("tau_ext",)) is None
