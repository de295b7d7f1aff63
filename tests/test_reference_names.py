"""What names alone say: which column is which channel, which joints there are, and where a doubt remains."""

import pytest

from backdrive.logs.readers import _names, units

ALIASES = {
    "time": "time t timestamp timestamps mt times stamp time_stamp header_stamp sec secs seconds elapsed elapsed_time",
    "position": "position q pos positions mq qm actual_q joint_position theta qpos observation.state Actual_Q jointAngle",
    "velocity": "velocity dq vel qd qdot q_dot speed omega qvel actualVelocity",
    "torque": "torque tau effort torques force jointTorque",
    "reference": "reference q_ref target_q setpoint action goalPosition",
    "external_torque": "external_torque tau_ext",
    "model_torque": "model_torque tau_model",
    "second_encoder": "second_encoder link_encoder",
    "load": "load joint_load",
    "temperature": "temperature temp motor_temperatures",
    "drive_input": "drive_input",
}


def guess(names, stated=None, settled=(), **widths):
    return _names.guess(
        dict.fromkeys(names.split() if isinstance(names, str) else names, 1) | widths, stated or {}, settled
    )


@pytest.mark.parametrize(("channel", "words"), ALIASES.items())
def test_usual_names_mean_their_channel(channel, words):
    for word in words.split():
        got = guess([word])
        assert (
            dict(got.columns) == {channel: (word,)}
            and got.joints == ()
            and got.notes == ()
            and got.doubt == ""
        ), word
        if channel != "time" and "." not in word:
            numbered = guess(["t", f"{word}_2", f"{word}_1"])
            assert numbered.columns[channel] == (f"{word}_1", f"{word}_2"), word
            assert numbered.joints == (("joint_1", "joint_2") if channel in ("position", "velocity") else ())


@pytest.mark.parametrize(
    ("names", "joints"),
    [
        ("q1 q2", ("joint_1", "joint_2")),
        ("q_1 q_2", ("joint_1", "joint_2")),
        ("q_0 q_11 q_3", ("joint_0", "joint_3", "joint_11")),
        ("j1_q j2_q", ("joint_1", "joint_2")),
        ("j_1_q j_2_q", ("joint_1", "joint_2")),
        ("axis1_pos axis2_pos", ("joint_1", "joint_2")),
        ("motor_3_position", ("joint_3",)),
        ("servo4_q", ("joint_4",)),
        ("a5_q", ("joint_5",)),
        ("m6_q", ("joint_6",)),
        ("q_joint1 q_joint_2", ("joint_1", "joint_2")),
        ("q_axis7", ("joint_7",)),
        ("pos_m8", ("joint_8",)),
        ("q1234", ("joint_1234",)),
        ("q12345", None),
        ("b1_q", None),
        ("q_b1", None),
        ("1_q", None),
        ("q1x", None),
    ],
)
def test_numbers_of_joints_stand_where_people_put_them(names, joints):
    got = guess(f"t {names}")
    if joints is None:
        assert "position" not in got.columns and got.joints == ()
    else:
        numbers = [int("".join(c for c in name if c.isdigit())) for name in names.split()]
        wanted = tuple(name for _, name in sorted(zip(numbers, names.split(), strict=True)))
        assert got.columns["position"] == wanted and got.joints == joints


def test_time_is_never_numbered():
    assert "time" not in guess("t1 t2 q").columns and "time" not in guess("joint1_time q").columns
    assert guess("t1 time q").columns["time"] == ("time",)


@pytest.mark.parametrize(
    ("names", "stated", "found", "ending", "noted"),
    [
        ("q_deg", {}, "position", "deg", False),
        ("q_deg_s", {}, None, "", False),
        ("vel_rpm", {}, "velocity", "rpm", False),
        ("time_ms", {}, "time", "ms", False),
        ("tau_nm", {}, "torque", "nm", False),
        ("q_nm", {}, None, "", False),
        ("torque_a", {}, None, "", False),
        ("q", {"q": "deg"}, "position", "", False),
        ("q_deg", {"q_deg": "rad"}, "position", "", False),
        ("q", {"q": "rpm"}, None, "", True),
        ("torque", {"torque": "A"}, None, "", True),
        ("tau", {"tau": "odd"}, "torque", "", False),
        ("q_deg", {"q_deg": "A"}, None, "", False),
        ("temp_degc", {}, "temperature", "degc", False),
        ("force_n", {}, "torque", "n", False),
    ],
)
def test_units_have_to_be_those_of_the_channel(names, stated, found, ending, noted):
    got = guess(names, stated)
    assert dict(got.columns) == ({found: (names,)} if found else {})
    assert dict(got.units) == ({names: ending} if ending else {})
    unit = stated.get(names, "")
    channel = "tau" if names == "torque" else "position"
    assert got.notes == (
        (
            f"'{names}' is in {unit}, so it was not taken as {'torque' if channel == 'tau' else channel}; give its factor, "
            f'for example --map {channel}=FACTOR*"{names}".',
        )
        if noted
        else ()
    )
    assert guess(names, stated, settled=("position", "torque")).notes == ()


@pytest.mark.parametrize(
    ("names", "columns", "joints", "note"),
    [
        ("t q pos", {"position": ("q",)}, (), "Also called position, and not used: pos."),
        ("t pos q", {"position": ("q",)}, (), "Also called position, and not used: pos."),
        ("t q1 q", {"position": ("q",)}, (), "Also called position, and not used: q1."),
        (
            "t pos q1 q2",
            {"position": ("q1", "q2")},
            ("joint_1", "joint_2"),
            "Also called position, and not used: pos.",
        ),
        (
            "t q1 q_1 q2",
            {"position": ("q1", "q2")},
            ("joint_1", "joint_2"),
            "Also called position, and not used: q_1.",
        ),
        (
            "t q1 q2 tau1 tau3",
            {"position": ("q1", "q2")},
            ("joint_1", "joint_2"),
            "Columns of torque are numbered (1, 3), those of position (1, 2): left out.",
        ),
        (
            "t dq1 dq2 tau1",
            {"velocity": ("dq1", "dq2")},
            ("joint_1", "joint_2"),
            "No column was taken as torque: joint_2 has none (tau1 of joint_1 is there). Name its column, --map tau=tau1,COLUMN, "
            "or leave the joint out, --names joint_1.",
        ),
        (
            "t q1 q2 dq2 dq1 tau2 tau1",
            {"position": ("q1", "q2"), "velocity": ("dq1", "dq2"), "torque": ("tau1", "tau2")},
            ("joint_1", "joint_2"),
            None,
        ),
        ("t q tau1", {"position": ("q",), "torque": ("tau1",)}, (), None),
        ("t dq1 dq2 q", {"position": ("q",), "velocity": ("dq1", "dq2")}, (), None),
        (
            "t q "
            + " ".join(
                f"{w}"
                for w in [
                    "pos",
                    "positions",
                    "mq",
                    "qm",
                    "actual_q",
                    "q_measured",
                    "q_meas",
                    "measured_q",
                    "q_actual",
                ]
            ),
            {"position": ("q",)},
            (),
            "Also called position, and not used: pos, positions, mq, qm, actual_q, q_measured, q_meas, measured_q.",
        ),
    ],
)
def test_of_several_names_the_usual_one_is_taken(names, columns, joints, note):
    got = guess(names)
    assert dict(got.columns) == {"time": ("t",), **columns} and got.joints == joints
    assert got.notes == ((note,) if note else ())


@pytest.mark.parametrize(
    ("names", "columns", "joints", "notes"),
    [
        (
            "t a.q b.q a.tau b.tau",
            {"time": ("t",), "position": ("a.q", "b.q"), "torque": ("a.tau", "b.tau")},
            ("a", "b"),
            (),
        ),
        ("t b/q a/q", {"time": ("t",), "position": ("b/q", "a/q")}, ("b", "a"), ()),
        (
            "t a.q b.q a.tau",
            {"time": ("t",), "position": ("a.q", "b.q")},
            ("a", "b"),
            (
                "No column was taken as torque: b has none (a.tau of a is there). Name its column, --map tau=a.tau,COLUMN, "
                "or leave the joint out, --names a.",
            ),
        ),
        ("t a.pos a.q b.q", {"time": ("t",), "position": ("a.q", "b.q")}, ("a", "b"), ()),
        ("stamp t a.q b.q", {"time": ("t",), "position": ("a.q", "b.q")}, ("a", "b"), ()),
        ("/js/t /js/a/q /js/b/q", {"time": ("/js/t",), "position": ("/js/a/q", "/js/b/q")}, ("a", "b"), ()),
        (
            "top.t top.x.t top.x.a.q top.x.b.q",
            {"time": ("top.x.t",), "position": ("top.x.a.q", "top.x.b.q")},
            ("a", "b"),
            (),
        ),
        ("a.q b.q", {"position": ("a.q", "b.q")}, ("a", "b"), ()),
        ("t a.q", {"time": ("t",), "position": ("a.q",)}, ("a",), ()),
        ("t x.y.a.q", {"time": ("t",), "position": ("x.y.a.q",)}, ("a",), ()),
        ("a.t a.q", {"time": ("a.t",), "position": ("a.q",)}, (), ()),
        ("x.t x.a.q", {"time": ("x.t",), "position": ("x.a.q",)}, (), ()),
        (
            "t q a.q a.tau",
            {"time": ("t",), "position": ("q",)},
            (),
            ("Not used, in other places of the file: a.q, a.tau.",),
        ),
        (
            "t q " + " ".join(f"a{k}.tau" for k in range(10)),
            {"time": ("t",), "position": ("q",)},
            (),
            ("Not used, in other places of the file: " + ", ".join(f"a{k}.tau" for k in range(8)) + ".",),
        ),
        (
            "t a.dq b.tau",
            {"time": ("t",), "velocity": ("a.dq",)},
            ("a",),
            ("Not used, in other places of the file: b.tau.",),
        ),
        ("t a.dq1 a.dq2", {"time": ("t",), "velocity": ("a.dq1", "a.dq2")}, ("joint_1", "joint_2"), ()),
        ("t a.tau", {"time": ("t",)}, (), ("Not used, in other places of the file: a.tau.",)),
        (
            "t elbow.q[0] elbow.q[1]",
            {"time": ("t",), "position": ("elbow.q[0]", "elbow.q[1]")},
            ("joint_0", "joint_1"),
            (),
        ),
    ],
)
def test_places_of_a_file_are_joints_where_that_is_clear(names, columns, joints, notes):
    got = guess(names)
    assert (dict(got.columns), got.joints, got.notes, got.doubt) == (columns, joints, notes, "")


def test_a_place_with_several_joints_is_no_joint():
    assert guess("t", **{"a.q": 2}).joints == () and guess("t", **{"a.q": 1}).joints == ("a",)
    for names, widths in (
        ("t a.q b.q", {"a.q": 2}),
        ("t b.q", {"a.dq": 3}),
        ("t a.q1 a.q2 b.q1 b.q2", {}),
        ("t x.a.q y.b.q", {}),
        ("t x.a.q y.a.q", {}),
        ("t a.q Filtered.q", {}),
        ("t a.q b.q", {"b.tau": 2}),
    ):
        got = guess(names, **widths)
        assert dict(got.columns) == {"time": ("t",)} and got.joints == () and got.units == {}
        assert got.doubt.startswith("several places hold positions or velocities: '")
    assert guess("stamp t x.q_deg cmd.q").columns == {"time": ("t",)}
    assert guess("a.q cmd.q").columns == {}
    for word in [
        "desired",
        "measured",
        "actual",
        "target",
        "command",
        "cmd",
        "ref",
        "state",
        "raw",
        "filtered",
        "meas",
        "goal",
        "error",
        "sim",
        "model",
        "input",
        "output",
    ]:
        assert (
            guess(f"t a.theta {word}.theta").doubt
            == f"several places hold positions or velocities: 'a', '{word}'"
        )
    many = guess([f"p{k}.x{k}.q" for k in range(12)])
    assert many.doubt == "several places hold positions or velocities: " + ", ".join(
        f"'p{k}/x{k}'" for k in range(10)
    )


def test_long_names_are_nobodys_abbreviation():
    place = "x" * (units.LONGEST - 2)
    assert guess(["t", f"{place}.q"]).columns["position"] == (f"{place}.q",)
    assert "position" not in guess(["t", f"x{place}.q"]).columns
    for bare, split, ended in (("x", units.split, " [deg]"), ("x", units.split_suffix, "_deg")):
        fits = bare * (120 - len(ended))
        assert split(fits + ended) == (fits, "deg") and split(bare + fits + ended) == (
            bare + fits + ended,
            "",
        )


@pytest.mark.parametrize(
    ("name", "compared"),
    [
        ("ActualQ [x]", "actual_q_x"),
        ("motorTorque", "motor_torque"),
        ("__a--b__", "a_b"),
        ("Q1", "q1"),
        ("aB2C", "a_b2c"),
        ("", ""),
    ],
)
def test_names_are_compared_in_lower_case_with_words_joined(name, compared):
    assert _names.bare(name) == compared


def test_millinewtons_in_any_capitals():
    for word, factor in (("mN", 1e-3), ("mn", 1e-3), ("Mn", 1e-3), ("MN", 1e6), ("mNewton", 1e-3)):
        assert units.parse(word) == units.Unit("force", factor)
