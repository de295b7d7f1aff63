"""What a prompt shows of a log and a result: a line by `repr`, the summary by `print`; frames state units in their names."""

import numpy as np
import pytest

from backdrive import Log, identify
from backdrive.errors import UnknownName

TIME = 0.002 * np.arange(6000)
ANGLE = 0.6 * np.sin(0.7 * TIME) + 0.3 * np.sin(2.3 * TIME + 1.0)
SPEED = 0.42 * np.cos(0.7 * TIME) + 0.69 * np.cos(2.3 * TIME + 1.0)
TORQUE = (
    4.0 * np.tanh(SPEED / 0.01) + 3.0 * SPEED + 0.05 * np.random.default_rng(1).standard_normal(TIME.size)
)


@pytest.fixture(scope="module")
def result():
    log = Log.from_arrays(time=TIME, position=ANGLE, torque=TORQUE)
    assert repr(log) == "<Log of joint_1: 6000 samples, 12 s; position, torque>"
    return identify(log, joints="joint_1")


def test_a_prompt_shows_a_line_and_print_the_summary(result):
    assert repr(result) == "<Identification of joint_1 by motion>"
    assert repr(result.model) == "<FrictionModel of joint_1>"
    for each in (result, result.model):
        assert str(each) == each.summary().rstrip()


def test_one_joint_may_be_named_by_a_plain_string(result):
    with pytest.raises(UnknownName, match="'elbow' is not a joint"):
        identify(Log.from_arrays(time=TIME, position=ANGLE, torque=TORQUE), joints="elbow")


def test_a_frame_may_state_its_units_in_the_names(result):
    frame = {"Zeit [ms]": 1e3 * TIME, "Position [deg]": np.rad2deg(ANGLE), "torque (Nm)": TORQUE}
    log = Log.from_frame(frame)
    assert np.allclose(log.time, TIME) and np.allclose(log.position[:, 0], ANGLE)
    stamped = Log.from_frame(
        {"time [ms]": (1e9 * TIME).astype("m8[ns]"), "q [deg]": np.rad2deg(ANGLE), "tau": TORQUE}
    )
    assert np.allclose(stamped.time, TIME)
