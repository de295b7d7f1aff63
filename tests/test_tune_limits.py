"""What a tuning hands on to the loop: limit, top speed and encoder step, from a person or from the robot's description."""

from dataclasses import replace

import numpy as np
import pytest

from backdrive.cli import _joint_options
from backdrive.control import Loop
from backdrive.errors import InvalidInput, ModelFileError
from backdrive.laws import CoulombViscous, Decaying, Law
from backdrive.logs.log import Joint
from backdrive.model import Actuator, Estimate, JointFriction, Validity
from backdrive.tuning import load_tunings, save_tunings
from backdrive.tuning.facts import Facts, facts_of
from backdrive.tuning.propose import fixed_rule, tune, within
from backdrive.tuning.tuning import LOOP, Number, Tuning

RATE = CoulombViscous(coulomb_positive=7.0, coulomb_negative=7.0, viscous_positive=3.0, viscous_negative=3.0)
VALUES = dict.fromkeys(LOOP, 1.0) | {
    "share": 0.8,
    "stiffness": 5e4,
    "decay_rate": 20.0,
    "dither_share": 0.0,
    "filter_ratio": 2.0,
}
TUNING = Tuning(
    joint="elbow",
    unit="rad",
    goal="backdrive",
    rate=RATE,
    top_speed=1.0,
    inertia=0.7,
    interval=1e-3,
    encoder_count=1e-6,
    numbers={name: Number(symbol=name, value=x, unit="-", reason="It is one.") for name, x in VALUES.items()},
    scores={},
    margins={},
)
USUAL = 1.25 * 0.8 * (7.0 + 3.0 * 3.0)  # 1.25 R F(3 rad/s)
FACTS = Facts(
    name="elbow",
    unit="rad",
    rate=RATE,
    coulomb=7.0,
    stiffness=1e5,
    stiffness_interval=(8e4, 1.2e5),
    inertia=0.7,
    inertia_interval=(0.6, 0.8),
    count=1e-4,
    top_speed=1.0,
)


def test_the_fastest_speed_of_a_log_is_no_top_speed():
    with pytest.raises(InvalidInput, match=r"no top speed.*`top_speed` or `urdf`"):
        TUNING.loop()
    with pytest.raises(InvalidInput, match="no encoder count"):
        replace(TUNING, encoder_count=None).loop(top_speed=3.0)
    joint = TUNING.loop(top_speed=3.0)
    assert (joint.top_speed, joint.encoder_count) == (3.0, 1e-6)
    assert joint.limit == pytest.approx(USUAL)


def test_limits_come_along_and_through_the_file(tmp_path):
    kept = within(TUNING, 3.0, None, np.inf, 1.0)
    (read,) = load_tunings(save_tunings([kept], tmp_path / "tuning.json"))
    for tuning in (kept, read):
        joint = tuning.loop()
        assert (joint.top_speed, joint.encoder_count) == (3.0, 1e-6)
        assert joint.limit == tuning.limit == pytest.approx(USUAL)
        assert Loop(joint, interval=tuning.interval).update([0.0], [0.0]) == 0
    other = read.loop(top_speed=2.0)
    assert other.limit == pytest.approx(1.25 * 0.8 * (7.0 + 3.0 * 2.0))  # not that of another top speed
    assert read.loop(limit=5.0).limit == 5.0


def test_a_file_of_the_first_schema_is_read_and_asks_for_its_limits(tmp_path):
    path = save_tunings([TUNING], tmp_path / "tuning.json")
    text = path.read_text().replace('"schema": 2', '"schema": 1')
    for name in ("trip_speed", "limit", "encoder_count"):
        text = "\n".join(line for line in text.split("\n") if not line.startswith(f'   "{name}"'))
    path.write_text(text)
    (read,) = load_tunings(path)
    assert (read.trip_speed, read.limit, read.encoder_count) == (None, None, None)
    with pytest.raises(InvalidInput, match="no top speed"):
        read.loop()
    assert read.loop(top_speed=3.0, encoder_count=1e-6).limit == pytest.approx(USUAL)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"trip_speed": -1.0}, "trip_speed = -1"),
        ({"trip_speed": 5e3, "limit": 3.0}, "top_speed = 5000"),
        ({"limit": -2.0}, "limit = -2"),
        ({"encoder_count": 0.0}, "encoder_count = 0"),
    ],
)
def test_limits_of_a_file_are_looked_at(tmp_path, change, named):
    path = save_tunings([replace(TUNING, **change)], tmp_path / "tuning.json")
    with pytest.raises(ModelFileError, match=named):
        load_tunings(path)


def test_what_is_odd_about_limits_is_noted():
    def notes(speed, limit, effort=np.inf, fastest=1.0):
        return " ".join(within(TUNING, speed, limit, effort, fastest).notes)

    assert "is not sufficient for a loop" in notes(None, None)
    assert notes(3.0, None) == ""
    assert "the loop switches off" in notes(3.0, None, fastest=2.8)
    assert "clips the compensation" in notes(3.0, 2.0)
    assert "1.5 R F(top speed)" in notes(3.0, 100.0)
    assert within(TUNING, 3.0, None, 9.0, 1.0).limit == 9.0


def test_an_encoder_too_coarse_for_the_trip_speed_is_refused_before_the_search():
    with pytest.raises(InvalidInput, match="tenth of the top speed"):
        tune(FACTS, trip_speed=0.05)


@pytest.mark.parametrize("least", [0.9, 0.6])
def test_no_proposal_begins_above_the_least_friction(least):
    assert fixed_rule(FACTS.replace(friction=(least, 1.1)))["share"] == min(0.8, least)


URDF = """<robot name="r"><link name="a"/><link name="b"/><link name="c"/>
<joint name="elbow" type="revolute"><parent link="a"/><child link="b"/>
<limit lower="-1" upper="1" velocity="2.5" effort="40"/></joint>
<joint name="wrist" type="continuous"><parent link="b"/><child link="c"/></joint></robot>"""


def test_top_speed_and_effort_of_the_robot_description_are_taken_unless_said(tmp_path):
    path = tmp_path / "r.urdf"
    path.write_text(URDF)
    found = _joint_options.guards({}, {"elbow": 7.0}, path, ["elbow", "wrist"])
    assert found["elbow"] == {"trip_speed": 2.5, "limit": 7.0, "effort": 40.0}
    assert found["wrist"] == {"trip_speed": None, "limit": None, "effort": np.inf}
    assert _joint_options.guards({"elbow": 1.0}, {}, path, ["elbow"])["elbow"]["trip_speed"] == 1.0
    assert _joint_options.guards({"elbow": 1.0}, {}, None, ["elbow"]) == {
        "elbow": {"trip_speed": 1.0, "limit": None}
    }
    with pytest.raises(InvalidInput, match=r"no joint 'knee'.*elbow, wrist.*`top_speed`"):
        _joint_options.guards({}, {}, path, ["knee"])


def test_what_the_model_knows_of_its_actuator_limits_the_loop():
    known = replace(FACTS, trip_speed=3.0, effort=5.0)
    tuning = tune(known, "track", joints=8)
    assert (tuning.trip_speed, tuning.limit) == (3.0, 5.0)
    assert tune(known, "backdrive", joints=8, trip_speed=2.0).trip_speed == 2.0
    law = Law(rate=RATE, element=Decaying(stiffness=1e5, decay_rate=20.0))
    friction = JointFriction(
        joint=Joint(name="elbow", encoder_counts=1e4),
        law=law,
        validity=Validity(velocity=(-1.0, 1.0)),
        dynamics={"inertia": Estimate(value=0.7, unit="kg.m^2")},
        actuator=Actuator(torque_limit=5.0, trip_speed=3.0),
    )
    facts = facts_of(friction)
    assert (facts.effort, facts.trip_speed) == (5.0, 3.0)
    bounded = within(TUNING, facts.trip_speed, None, facts.effort, 1.0)
    assert bounded.limit == 5.0
