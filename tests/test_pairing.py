"""Joints are paired by their names, whichever channels a `--map` names, in whatever order the columns stand."""

import numpy as np
import pytest

from backdrive.errors import MappingError
from backdrive.logs.readers.columns import Columns
from backdrive.logs.readers.mapping import to_log

NUMBER = {"arm": 1.0, "elbow": 2.0, "wrist": 3.0}


def columns(positions="arm elbow wrist", torques="wrist arm elbow", ending="effort"):
    """Columns whose numbers tell their joint: k for the position, 10 k for the torque."""
    ramp = np.arange(5.0)
    arrays = {"time": ramp}
    arrays |= {f"{name}_pos": NUMBER[name] + ramp for name in positions.split()}
    arrays |= {f"{name}_{ending}": 10.0 * NUMBER[name] + ramp for name in torques.split()}
    return Columns(arrays=arrays)


@pytest.mark.parametrize(
    ("asked", "names"),
    [
        (None, "arm elbow wrist"),
        ("tau=*_effort", "arm elbow wrist"),
        ("q=*_pos", "arm elbow wrist"),
        ("q=*_pos,tau=*_effort", "arm elbow wrist"),
        ("q=wrist_pos,arm_pos,elbow_pos", "wrist arm elbow"),
        ("q=wrist_pos,arm_pos,elbow_pos,tau=*_effort", "wrist arm elbow"),
        ("tau=elbow_effort,arm_effort,wrist_effort", "elbow arm wrist"),
        ("q=*_pos,tau=elbow_effort,arm_effort,wrist_effort", "elbow arm wrist"),
    ],
)
def test_columns_of_one_joint_come_together(asked, names):
    log = to_log(columns(), map=asked)
    wanted = [NUMBER[name] for name in names.split()]
    assert log.names == tuple(names.split())
    assert log.position[0].tolist() == wanted
    assert log.torque[0].tolist() == [10.0 * k for k in wanted]
    assert not any("lists" in note for note in log.notes)


def test_columns_that_no_name_tells_are_matched_by_pattern():
    log = to_log(columns(ending="I"), map="tau=0.5*(*_I)")
    assert log.names == ("arm", "elbow", "wrist") and log.torque[0].tolist() == [5.0, 10.0, 15.0]


def test_numbers_of_a_pattern_are_those_of_the_joints():
    ramp = np.arange(5.0)
    found = Columns(
        arrays={"t": ramp, "q2": ramp + 2, "q1": ramp + 1, "I2": 20 + ramp, "I1": 10 + ramp}, joints=()
    )
    log = to_log(found, map="tau=I*")
    assert log.position[0].tolist() == [1.0, 2.0] and log.torque[0].tolist() == [10.0, 20.0]


def test_lists_are_taken_as_they_are_and_remarked():
    log = to_log(columns(), map="q=arm_pos,elbow_pos,wrist_pos,tau=wrist_effort,arm_effort,elbow_effort")
    assert log.torque[0].tolist() == [30.0, 10.0, 20.0]
    assert (
        "By their columns' names, --map lists position of arm, elbow, wrist, and torque of wrist, arm, elbow."
        in log.notes
    )


def test_a_pattern_of_other_joints_is_refused():
    arrays = dict(columns().arrays) | {f"{name}_I": np.arange(5.0) for name in ("a", "b", "c")}
    with pytest.raises(
        MappingError, match="names of position names the joints arm, elbow, wrist, that of torque a, b, c"
    ):
        to_log(Columns(arrays=arrays), map="tau=*_I")


def test_patterns_of_different_joints_are_refused_beside_a_list_too():
    arrays = dict(columns().arrays) | {f"{name}_I": np.arange(5.0) for name in ("a", "b", "c")}
    with pytest.raises(
        MappingError,
        match="the pattern of torque names the joints wrist, arm, elbow, that of temperature a, b, c",
    ):
        to_log(Columns(arrays=arrays), map="q=wrist_pos,arm_pos,elbow_pos,tau=*_effort,temp=*_I")
