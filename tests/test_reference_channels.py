"""From columns to channels, worked by hand: sums, units, what is left out, and what is said of it."""

import re

import numpy as np
import pytest

from backdrive.errors import InvalidInput, MappingError
from backdrive.logs.log import Drive, Source
from backdrive.logs.readers import _channels, _expression
from backdrive.logs.readers.columns import Columns
from backdrive.logs.readers.mapping import to_log

T = 0.5 * np.arange(4)
Q = np.arange(8.0).reshape(4, 2)
DEG, RPM = np.pi / 180, np.pi / 30


def log_of(map=None, units=None, channels=None, drive=None, joints=(), notes=(), asked=None, **arrays):
    columns = Columns(
        arrays={"t": T, **arrays},
        units=units or {},
        channels=channels or {},
        drive=drive,
        joints=joints,
        notes=notes,
    )
    return to_log(columns, map=map, **(asked or {}))


def said(log):
    (note,) = [note for note in log.notes if note.startswith("Channels: ")]
    return note[len("Channels: ") : -1].split("; ")


# ------------------------------------------------------------------------------------------------ maps


@pytest.mark.parametrize(
    ("map", "wanted", "written"),
    [
        ("q=a", Q, "'a'"),
        ("q=-a", -Q, "-1*'a'"),
        ("q=a[1]", Q[:, 1:], "'a'[1:2]"),
        ("q=a[0:2]", Q, "'a'[0:2]"),
        ("q=b[1:3]", np.array([[1, 2], [5, 6], [9, 10], [13, 14]]), "'b'[1:3]"),
        ("q=2.5*a - one", 2.5 * Q - T[:, None], "2.5*'a' + -1*'one'"),
        ("q=one + a", Q + T[:, None], "'one' + 'a'"),
        ("q=one - a + 2*a", Q + T[:, None], "'one' + -1*'a' + 2*'a'"),
        ("q=-2*k*3*a", -18.0 * Q, "-6*k*'a'"),
        ("q=deg*a", DEG * Q, "deg*'a'"),
        ("q=2*rpm*k*a", 6.0 * RPM * Q, "2*rpm*k*'a'"),
        ("q=turned", Q, "'turned'"),
        ("q=0.123456789012*one", 0.123456789012 * T[:, None], "0.123456789*'one'"),
        ('q="with unit"', 1e-3 * Q, "'with unit' [mm]"),
        ("q=INT", np.array([[3.0], [1.0], [4.0], [1.0]]), "'INT'"),
        ("q=2*index", 2.0 * np.arange(4)[:, None], "2*'index'"),
    ],
)
def test_sums_of_a_map(map, wanted, written):
    log = log_of(
        map, {"with unit [mm]": "mm"}, a=Q, b=np.arange(16).reshape(4, 4), one=T, k=np.array([3.0]), turned=Q.T,
        int=np.array([3, 1, 4, 1]), **{"with unit [mm]": Q},
    )  # fmt: skip
    assert log.position == pytest.approx(wanted, rel=1e-14) and log.time.tolist() == T.tolist()
    assert said(log) == [f"position = {written}", "time = 't'"]
    assert log.torque is None and "No column was taken as torque" in log.notes[-1]


def test_columns_go_before_the_words_of_the_grammar():
    own = log_of("q=deg*one,dq=index", one=T, deg=np.array([7.0]), index=3.0 * T)
    assert own.position[:, 0] == pytest.approx(7.0 * T) and own.velocity[:, 0] == pytest.approx(3.0 * T)
    assert log_of("t=0.25*index", q=Q).time.tolist() == [0.0, 0.25, 0.5, 0.75]
    assert log_of("t=0.25*index,dq=q", q=Q).time.tolist() == [0.0, 0.25, 0.5, 0.75]
    assert log_of("t=index,q=b", b=np.zeros((7, 2)) + 1.0).time.tolist() == list(range(7))
    assert log_of("t=2*t + one,q=a", a=Q, one=T).time.tolist() == (3 * T).tolist()
    assert log_of("t=T,q=a", a=Q).time.tolist() == T.tolist()


def test_units_that_are_stated_are_brought_to_si_and_factors_come_on_top():
    units = {"deg_": "deg", "rpm_": "rpm", "mm_": "mm", "amps": "A", "mnm": "mNm", "kelvin": "K", "ms": "ms"}
    arrays = dict.fromkeys(units, Q)
    assert log_of("q=deg_", units, **arrays).position == pytest.approx(DEG * Q)
    assert log_of("q=deg*deg_", units, **arrays).position == pytest.approx(DEG * Q)  # not twice
    assert log_of("q=100*deg_", units, **arrays).position == pytest.approx(100 * DEG * Q)
    assert log_of("q=a,dq=rpm*rpm_", units, a=Q, **arrays).velocity == pytest.approx(RPM * Q)
    assert log_of("q=a,tau=2*mnm", units, a=Q, **arrays).torque == pytest.approx(2e-3 * Q)
    assert log_of("q=a,temp=kelvin", units, a=Q, **arrays).temperature == pytest.approx(Q - 273.15)
    for factor in ("2*amps", "k*amps", "0.5*k*amps"):
        wanted = {"2": 2.0, "k": 3.0, "0": 1.5}[factor[0]] * Q
        assert log_of(f"q=a,tau={factor}", units, a=Q, k=np.array([[3.0]]), **arrays).torque == pytest.approx(
            wanted
        )
    for text, word in (
        ("q=a,tau=amps", "is in A, which is not a unit of torque"), ("q=a,tau=-amps", "is in A, which is not a unit of torque"),
        ("q=rpm_", "is in rpm, which is not a unit of position"), ("q=rpm*deg_", "is stated in deg, not in rpm"),
        ("q=a,dq=deg*rpm_", "is stated in rpm, not in deg"), ("q=ms", "is in ms, which is not a unit of position"),
    ):  # fmt: skip
        with pytest.raises(MappingError, match=word):
            log_of(text, units, a=Q, **arrays)


def test_the_position_says_whether_a_joint_turns_or_else_the_velocity():
    units = {"mm": "mm", "rad": "rad", "m_s": "m/s", "rad_s": "rad/s"}
    arrays = dict.fromkeys(units, Q + 1.0)
    for map, unit in (
        ("q=mm", "m"), ("q=rad", "rad"), ("dq=m_s", "m"), ("dq=rad_s", "rad"), ("q=mm,dq=rad_s", "m"), ("dq=rad_s,q=mm", "m"),
        ("q=rad,dq=m_s", "rad"), ("dq=m_s,q=rad", "rad"), ("q=plain", "rad"), ("q=plain,dq=m_s", "m"), ("q=plain,qr=mm", "rad"),
        ("q=deg*plain,dq=m_s", "rad"), ("dq=rpm*plain", "rad"), ("dq=rpm*plain,q=mm", "m"),
    ):  # fmt: skip
        assert [joint.unit for joint in log_of(map, units, plain=Q, **arrays).joints] == [unit] * 2, map
    both = log_of(units={"pos [mm]": "mm", "vel [rad/s]": "rad/s"}, **{"vel [rad/s]": Q, "pos [mm]": Q})
    assert both.joints[0].unit == "m" and both.position == pytest.approx(1e-3 * Q)


def test_a_name_that_ends_with_a_unit_is_not_believed_beside_a_map():
    for map, column, noted in (
        ("q=x_deg", "x_deg", "deg"), ("q=-x_deg", "x_deg", "deg"), ("dq=x_rpm", "x_rpm", "rpm"), ("dq=x_deg_s", "x_deg_s", "deg/s"),
        ("q=x_rad", "x_rad", ""), ("q=deg*x_deg", "x_deg", ""), ("q=k*x_deg", "x_deg", ""),
    ):  # fmt: skip
        log = log_of(map, **{column: Q, "k": np.array([1.0])})
        notes = [note for note in log.notes if "was taken as SI" in note]
        assert notes == (
            [f"'{column}' was taken as SI, as --map gives no factor, though its name ends with {noted}."]
            if noted
            else []
        )
    assert not any("was taken as SI" in note for note in log_of("t=t_deg,q=a", t_deg=T, a=Q).notes)
    (large,) = [note for note in log_of("q=2*x_deg", x_deg=Q).notes if "was taken as SI" in note]
    assert large == "'x_deg' was taken as SI, times 2, a large factor for the unit in its name."
    assert not any("was taken as SI" in note for note in log_of("q=0.0174532925*x_deg", x_deg=Q).notes)
    named = log_of("q=q_deg", q_deg=Q)  # what the name alone says is not applied
    assert named.position.tolist() == Q.tolist()


@pytest.mark.parametrize(
    ("map", "words"),
    [
        ("q=nothing", "The file has no column 'nothing'. Columns: long 5, t 4, a 4x2, wide 4x3, "),
        ("q=wide + a", "--map q: 'a' has 2 columns, the terms before it 3."),
        ("q=a,tau=wide", r"different numbers of joints: {'position': 2, 'torque': 3}"),
        ("q=a[3]", r"--map q: 'a' has 2 columns, \[3\] is not there."),
        ("q=a[1:3]", r"--map q: 'a' has 2 columns, \[2\] is not there."),
        ("q=long", r"--map q: 'long' has shape \(5,\), but the time has 4 samples."),
        ("q=a,tau=a*one", r"--map tau: the factor 'a' is not a single number but has shape \(4, 2\)."),
        ("q=1.1e60*a", r"--map q: the factor of 'a' is 1.1e\+60."),
        ("q=-1e200*a", r"--map q: the factor of 'a' is -1e\+200."),
        ("q=huge", r"--map q: 'huge' holds 1e\+200, beyond"),
        ("q=-1*low", r"--map q: 'low' holds 1e\+200, beyond"),
        ("t=a,q=a", r"Time has 2 columns. Choose one, for example t=time\[0\]."),
        ("t=none,q=a", "--map t=none: a log needs a time."),
        (
            "dq=none",
            "No position or velocity was found: no column has a name that means position or velocity.",
        ),
        ("q=twin", "no column 'twin'"),
        ("q=wid", "Did you mean 'wide'"),
        ("t=wrong,q=a", "no column 'wrong'"),
    ],
)
def test_maps_that_do_not_fit(map, words):
    arrays = {
        "a": Q, "wide": np.ones((4, 3)), "one": T, "long": np.ones(5), "huge": np.array([0.0, 1.0, 1e200, np.nan]),
        "low": np.array([0.0, -1e200, np.inf, 1.0]), "Twin": T, "tWin": T,
    }  # fmt: skip
    with pytest.raises(MappingError) as caught:
        log_of(map, **arrays)
    assert re.search(words, caught.value.text)


def test_infinite_and_missing_numbers_go_through_a_map():
    log = log_of("q=a", a=np.array([np.nan, np.inf, -np.inf, 1.0]))
    assert np.array_equal(log.position[:, 0], [np.nan, np.inf, -np.inf, 1.0], equal_nan=True)
    assert log_of("q=1e60*a", a=0.5 * T).position[2, 0] == 0.5e60


def test_numbers_that_overflow_in_si_are_refused_as_they_stand():
    for column in ("q", "other"):
        with pytest.raises((InvalidInput, MappingError), match="beyond the largest valid number"):
            log_of(
                "q=other" if column == "other" else None,
                {column: "rev"},
                **{column: np.array([0.0, 1.0, 1.5e308, 2.0])},
            )
    single = np.array(
        [0.1, 0.2, 0.3, 0.4], dtype=np.float32
    )  # reckoned in double precision with a map and without
    for map in (None, "q=q"):
        assert log_of(map, {"q": "mm"}, q=single).position[:, 0] == pytest.approx(
            1e-3 * single.astype(float), rel=1e-14
        )
    assert np.isinf(log_of(units={"q": "mm"}, q=np.array([0.0, 1.0, np.inf, 2.0])).position[2, 0])


def test_a_name_that_was_meant_is_suggested_unless_it_is_endless():
    for length, hinted in ((120, True), (121, False)):
        with pytest.raises(MappingError) as error:
            log_of("q=" + "x" * 119, **{"x" * length: Q})
        assert ("Did you mean" in error.value.remedy) is hinted


def test_columns_are_told_the_longest_first_and_sixty_at_most():
    columns = Columns(
        arrays={"k": np.ones(1), "q": np.ones((2, 9)), "x" * 90: np.ones(5)}, units={"q": "deg"}
    )
    assert _channels.describe(columns) == f"q 2x9 [deg], {'x' * 80} 5, k 1"
    for count, more in ((60, ""), (61, " and 1 more"), (75, " and 15 more")):
        text = _channels.describe(Columns(arrays={f"c{i}": np.ones(3) for i in range(count)}))
        assert text == ", ".join(f"c{i} 3" for i in range(60)) + more


# ------------------------------------------------------------------------------------- without a map


def test_what_a_format_knows_is_taken_and_what_does_not_fit_is_noted():
    channels = {
        "when": "time",
        "where": "position",
        "force": "torque",
        "short": "velocity",
        "wide": "load",
        "gone": "reference",
    }
    columns = Columns(
        arrays={"when": T, "where": Q, "force": 2 * Q, "short": np.ones(3), "wide": np.ones((4, 3)), "q": Q + 9}, channels=channels,
        joints=("a", "b"), units={"where": "deg"}, notes=("first",),
    )  # fmt: skip
    log = to_log(columns, sources=(Source(path="x", sha256="y"),))
    assert (
        log.position == pytest.approx(DEG * Q)
        and log.torque == pytest.approx(2 * Q)
        and log.names == ("a", "b")
    )
    assert log.velocity is None and log.load is None and log.reference is None
    assert log.sources == (Source(path="x", sha256="y"),)
    assert log.notes == (
        "first",
        "Channels: time = 'when'; position = 'where' [deg]; torque = 'force'.",
        "'short' has another length than the time, so velocity was left out.",
        "'wide' has 3 columns where 2 are due: load left out.",
        "No unit is stated, so SI is taken: torque in N.m. Some drivers publish motor current as torque or effort.",
    )


def test_columns_side_by_side_and_what_is_said_of_them():
    log = log_of(
        units={"q1": "deg", "q2": "deg"}, q1=T, q2=2 * T, q3=3 * T, tau=Q[:, 0], temp=np.ones((4, 3))
    )
    assert log.position == pytest.approx(np.column_stack([DEG * T, 2 * DEG * T, 3 * T]))
    assert said(log) == ["time = 't'", "position = 'q1' to 'q3' [deg]", "temperature = 'temp'"]
    assert "'tau' has 1 columns where 3 are due: torque left out." in log.notes
    assert any(note == "No unit is stated, so SI is taken: temperature in degC." for note in log.notes)
    plain = log_of(dq=Q + 1, tau=Q, q=Q, q_ref=Q)
    (note,) = [note for note in plain.notes if "No unit" in note]
    for part in ("position in rad", "velocity in rad/s", "torque in N.m", "reference in rad"):
        assert part in note
    assert note.endswith(". Some drivers publish motor current as torque or effort.")
    linear = log_of(units={"q": "mm"}, q=Q, tau=Q)
    assert any("torque in N. Some" in note for note in linear.notes)


def test_the_inputs_of_a_drive_go_with_its_law():
    drive = Drive(law="duty", gains={"kp": 2.0})
    channels = {"t": "time", "a": "position", "u": "drive_input"}
    log = log_of(channels=channels, drive=drive, a=Q, u=0.5 * Q)
    assert log.drive == drive and log.drive_input.tolist() == (0.5 * Q).tolist()
    assert not any("No unit" in note for note in log.notes)
    assert log_of(channels={"t": "time", "a": "position"}, drive=drive, a=Q, u=Q).drive is None
    assert log_of("u=none", channels=channels, drive=drive, a=Q, u=Q).drive is None
    plain = log_of("u=u", q=Q, u=Q)
    assert plain.drive is None and any("SI is taken: position in rad." in note for note in plain.notes)


@pytest.mark.parametrize(
    ("start", "stated", "changed"),
    [(-1.7e12, {}, 1e-3), (1.7e12, {"t": "s"}, None), (1.7e12, {"t": "ms"}, None), (7.999e11, {}, None), (8.001e11, {}, 1e-3),
     (4.99e12, {}, 1e-3), (5.01e12, {}, None), (7.99e14, {}, None), (8.01e14, {}, 1e-6), (4.99e15, {}, 1e-6), (5.01e15, {}, None)],
)  # fmt: skip
def test_clocks_since_1970_are_told_by_their_first_number(start, stated, changed):
    time = start + np.array([0.0, 1e9, 2e9, 4e9]) * (1.0 if abs(start) < 1e13 else 1e3) * 5.0
    log = to_log(Columns(arrays={"t": time, "q": Q}, units=stated))
    notes = [note for note in log.notes if "since 1970" in note]
    if changed is None:
        assert (
            log.time.tolist() == pytest.approx((time * (1e-3 if stated.get("t") == "ms" else 1.0)).tolist())
            and not notes
        )
    else:
        assert log.time == pytest.approx((time - time[0]) * changed, rel=1e-12)
        word = {1e-3: "ms", 1e-6: "us"}[changed]
        assert notes == [f"'t' counts {word} since 1970; time is in s since the first sample."]
    nano = np.array([1_700_000_000_000_000_000, 1_700_000_000_000_000_001, 1_700_000_000_000_000_003])
    log = to_log(Columns(arrays={"t": nano, "q": Q[:3]}))
    assert log.time.tolist() == pytest.approx([0.0, 1e-9, 3e-9], rel=1e-12)


@pytest.mark.parametrize("name", ["velocity", "torque", "external_torque", "temperature"])
def test_zeros_throughout_are_no_measurement(name):
    column, zero = (
        {"velocity": "dq", "torque": "tau", "external_torque": "tau_ext", "temperature": "temp"}[name],
        np.zeros((4, 2)),
    )
    one = zero.copy()
    one[3, 1] = 1e-9
    note = f"The {name} is exactly zero throughout: taken as not measured."
    log = log_of(q=Q, **{column: zero})
    assert getattr(log, name) is None and log.notes.count(note) == 1
    for kept in (log_of(q=Q, **{column: one}), log_of(f"{column}={column}", q=Q, **{column: zero})):
        assert getattr(kept, name) is not None and note not in kept.notes
    still = log_of(q=zero + [1.0, 5.0], **{column: zero})  # two joints that stand at different places
    assert (getattr(still, name) is None) is (name != "velocity")
    assert getattr(log_of(q=np.column_stack([T, 0 * T]), **{column: zero}), name) is None  # one of two moves
    assert getattr(log_of(q=np.column_stack([T, T]), **{column: zero}), name) is None
    if name != "velocity":
        assert getattr(log_of(dq=Q, **{column: zero}), name) is None
    else:
        assert log_of(dq=zero).velocity is not None


# ------------------------------------------------------------------------------------------- options


def test_names_choose_order_or_name():
    def names(wanted, joints=("a", "b", "c")):
        log = log_of(
            joints=joints, asked={"names": wanted}, q=np.arange(12.0).reshape(4, 3), tau=np.ones((4, 3))
        )
        return log.names, log.position[0].tolist(), log.torque.shape

    assert names(None) == (("a", "b", "c"), [0, 1, 2], (4, 3))
    assert names(None, ()) == (("joint_1", "joint_2", "joint_3"), [0, 1, 2], (4, 3))
    assert names(None, ("a", "b")) == (("joint_1", "joint_2", "joint_3"), [0, 1, 2], (4, 3))
    assert names("c, a") == (("c", "a"), [2, 0], (4, 2))
    assert names(["b"]) == (("b",), [1], (4, 1))
    assert names("x,y , z") == (("x", "y", "z"), [0, 1, 2], (4, 3))
    with pytest.raises(
        InvalidInput, match=r"2 names \(x, y\) for 3 joints. Give one name a joint. The file names a, b, c."
    ):
        names("x,y")
    with pytest.raises(InvalidInput, match=r"Give one name a joint.$"):
        names("x,y", ())


def test_gears_and_counts_go_with_their_joints():
    log = log_of(
        joints=("a", "b"), asked={"names": "b,a", "gear": [10.0, -2.0], "counts": (4.0, 8.0)}, q=Q, tau=Q
    )
    assert log.torque == pytest.approx(Q[:, ::-1] * [10.0, -2.0])
    assert [joint.gear_ratio for joint in log.joints] == [10.0, -2.0]
    assert [joint.encoder_counts for joint in log.joints] == [4.0, 8.0]
    one = log_of(asked={"gear": 3}, q=Q, tau=Q)
    assert one.torque == pytest.approx(3.0 * Q) and [joint.encoder_counts for joint in one.joints] == [
        None,
        None,
    ]
    none = log_of(q=Q, tau=Q)
    assert [(j.gear_ratio, j.torque_side, j.unit) for j in none.joints] == [(1.0, "joint", "rad")] * 2
    for good in (1e-15, 1e15, -1e15, [1.0, -1e-15]):
        assert log_of(asked={"gear": good}, q=Q).joints[0].gear_ratio in (1e-15, 1e15, -1e15, 1.0)
    for what in ("gear", "counts"):
        for wrong, words in (
            ([1, 2, 3], "does not fit 2 joints"), ([], "does not fit 2 joints"), ("x", "does not fit 2 joints"),
            (0, "does not fit 2 joints"), ([1, 0], "does not fit"), (np.nan, "does not fit"), ([1, np.inf], "does not fit"),
            ([[1, 2]], "does not fit"), (1e16, "implausible"), (1e-16, "implausible"), (-1e16, "implausible"),
            ([1.0, 2e15], "implausible"),
        ):  # fmt: skip
            with pytest.raises(InvalidInput, match=f"^{what} .*{words}"):
                log_of(asked={what: wrong}, q=Q)


def test_units_of_joints_that_the_file_does_not_state():
    arrays = {"q": Q, "dq": Q + 1, "q_ref": Q + 2, "second_encoder": Q + 3, "tau": Q + 4}
    log = log_of(asked={"units": "deg"}, **arrays)
    for name, value in (
        ("position", Q),
        ("velocity", Q + 1),
        ("reference", Q + 2),
        ("second_encoder", Q + 3),
    ):
        assert getattr(log, name) == pytest.approx(DEG * value)
    assert log.torque == pytest.approx(Q + 4) and [joint.unit for joint in log.joints] == ["rad", "rad"]
    assert "Converted from degrees, as asked: position, reference, second_encoder, velocity." in log.notes
    mixed = log_of(asked={"units": " deg , m"}, q=Q)
    assert mixed.position == pytest.approx(Q * [DEG, 1.0]) and [j.unit for j in mixed.joints] == ["rad", "m"]
    assert log_of(units={"q": "rad"}, asked={"units": "deg"}, q=Q).position == pytest.approx(
        Q
    )  # stated goes first
    asked = log_of("q=a", asked={"units": "deg"}, a=Q, dq=Q)
    assert asked.position == pytest.approx(Q) and asked.velocity == pytest.approx(DEG * Q)
    for units in ("rad", ["m", "rad"]):
        log = log_of(asked={"units": units}, q=Q)
        assert log.position.tolist() == Q.tolist() and not any("degrees" in note for note in log.notes)
    assert [j.unit for j in log_of(units={"q": "mm"}, asked={"units": "rad"}, q=Q).joints] == ["rad", "rad"]
    for wrong in ("inch", ["m"] * 3, "rad,m,deg", "rad,inch"):
        with pytest.raises(InvalidInput, match="do not fit 2 joints"):
            log_of(asked={"units": wrong}, q=Q)


def test_the_length_of_a_log_is_that_of_its_time():
    long = np.arange(10.0)
    log = to_log(Columns(arrays={"t": T, "q": Q, "dq": long, "x": long}))
    assert len(log.time) == 4 and log.velocity is None
    assert (
        len(to_log(Columns(arrays={"t": T[None, :], "q": Q.T})).time) == 4
    )  # a time that lies along the other axis
    with pytest.raises(
        MappingError,
        match=r"No column has a name that means time.*t=0.001\*index for a 1 kHz log. Columns: q 4x2",
    ):
        to_log(Columns(arrays={"q": Q}))
    with pytest.raises(MappingError, match="name that means time"):
        to_log(Columns(arrays={"x": Q}), map="t=index")
    log = to_log(Columns(arrays={"a": Q, "dq": long}), map="t=index,q=a")
    assert len(log.time) == 4 and log.velocity is None  # what the map names goes first
    assert len(to_log(Columns(arrays={"a [deg]": Q}), map="t=index,q=a").time) == 4
    assert len(to_log(Columns(arrays={"a": Q}), map="t=index,dq=a").time) == 4
    assert len(to_log(Columns(arrays={"t": T, "index": long, "q": long}), map="t=index").time) == 10
    single = to_log(Columns(arrays={"t": np.array([1.0]), "a": np.array([2.0])}), map="t=t,q=a,tau=3*a")
    assert single.position.tolist() == [[2.0]] and single.torque.tolist() == [[6.0]]


# ------------------------------------------------------------------------------------------ the grammar


@pytest.mark.parametrize(
    ("text", "place", "words"),
    [
        ("q=a,x=b", 5, "'x' is not a channel"), ("q", 2, "'=' is missing after 'q'"), ("q a", 3, "'=' is missing"),
        ("q=a b", 5, "',' or '+' or '-' is missing before 'b'"), ("q=3", 4, "a column must follow the number"),
        ("q=3 b", 5, "a column must follow"), ("q=2*", 5, "a column is missing"), ("q=a+,", 5, "a column is missing"),
        ("q=a[1", 6, "an index is written"), ("q=a[2:2]", 9, "an index is written"), ("q=a[3:2]", 9, "an index is written"),
        ("q=a[b]", 5, "'b' is not a column index"), ("q=a[1.0]", 5, "'1.0' is not a column index"),
        ("q=a[1234567890]", 5, "'1234567890' is not"), ("q= $x", 4, "'$x' is not understood"),
        ("q=a   %bcdefghijklmnop", 7, "'%bcdefghijkl' is not understood"), ("q=1e400*a", 9, "a factor is not finite"),
        ('1="a"', 1, "'1' is not a channel"), ("q=a[" + "1" * 50 + "]", 5, f"'{'1' * 40}' is not"),
        ("q=2a", 3, "'2a' is not understood"),
    ],
)  # fmt: skip
def test_where_a_map_does_not_follow_the_grammar(text, place, words):
    with pytest.raises(MappingError) as error:
        _expression.parse(text)
    assert error.value.message.startswith(f"--map: {words}") and error.value.message.endswith(
        f"at position {place} of '{text}'."
    )


def test_terms_of_a_map_as_they_are_written():
    def terms(text):
        (found,) = _expression.parse(text).values()
        (one,) = found
        return [
            (t.factor, tuple(n for n, _ in t.factors), t.columns[0].name, t.columns[0].index) for t in one
        ]

    assert terms("q=a") == [(1.0, (), "a", None)]
    assert terms('q=-"a b"') == [(-1.0, (), "a b", None)]
    assert terms("q=+a-b") == [(1.0, (), "a", None), (-1.0, (), "b", None)]
    assert terms("q=--a") == [(1.0, (), "a", None)] and terms("q=a - -b")[1][0] == 1.0
    assert terms("q=2*k*.5*-deg*a.b/c#2[3]") == [(-1.0, ("k", "deg"), "a.b/c#2", slice(3, 4))]
    assert terms("q=a[0:12]") == [(1.0, (), "a", slice(0, 12))]
    assert terms("q=a[123456789]")[0][3] == slice(123456789, 123456790)
    assert terms("  q = 1.5e-3 * a  ") == [(0.0015, (), "a", None)]
    assert terms('q="k 1"*a') == [(1.0, ("k 1",), "a", None)]
    assert _expression.parse("tau=none , q=nonesuch")["torque"] is None
    assert _expression.parse({"q": "a", "tau": "2*b"}) == _expression.parse("q=a,tau=2*b")
    assert _expression.parse("q=a,")["position"] == _expression.parse("q=a")["position"]
    for text in ("", " ", {}):
        with pytest.raises(MappingError, match="`map` is empty"):
            _expression.parse(text)
    with pytest.raises(MappingError, match="names 'position' twice"):
        _expression.parse("q=a,position=b")
