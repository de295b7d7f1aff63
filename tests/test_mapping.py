"""`--map`: the grammar, the units, and what a mistake is answered with."""

import numpy as np
import pytest

from backdrive import read_log
from backdrive.errors import InvalidInput, MappingError
from backdrive.logs.readers import units
from backdrive.logs.readers._expression import CHANNEL_OF, parse
from backdrive.logs.readers.columns import Columns
from backdrive.logs.readers.mapping import to_log

T = np.arange(5) * 0.1
Q = np.arange(10.0).reshape(5, 2)


def columns(**more) -> Columns:
    arrays = {
        "t": T,
        "pos": Q,
        "wide": np.vstack([T, 2 * T, 3 * T]),
        "K": np.array([2.0]),
        "amps [A]": Q + 1,
        **more,
    }
    return Columns(arrays=arrays, units={"amps [A]": "A"})


def test_every_channel_has_a_short_name_that_is_understood():
    for short, channel in CHANNEL_OF.items():
        assert list(parse(f"{short}=x")) == list(parse(f"{channel}=x")) == [channel]


def test_sums_factors_signs_and_columns():
    log = to_log(columns(), map="t=t,q=pos[1],tau=-2.5e-1*pos[0] + K*pos[1] - wide[2]", names="a")
    assert np.array_equal(log.position[:, 0], Q[:, 1])
    assert np.allclose(log.torque[:, 0], -0.25 * Q[:, 0] + 2 * Q[:, 1] - 3 * T)
    assert log.names == ("a",)


def test_ranges_and_turned_arrays():
    log = to_log(columns(), map="q=wide[0:2],dq=pos")
    assert np.array_equal(log.position, np.column_stack([T, 2 * T]))
    assert np.array_equal(log.velocity, Q)


def test_degrees_and_revolutions():
    log = to_log(columns(), map="q=deg*pos,dq=3*rpm*pos,qr=-deg*pos")
    assert np.allclose(log.position, np.deg2rad(Q))
    assert np.allclose(log.velocity, 3 * Q * 2 * np.pi / 60)
    assert np.allclose(log.reference, -np.deg2rad(Q))


def test_quoted_names_and_names_without_their_unit():
    for name in ('"amps [A]"', "amps"):
        log = to_log(columns(), map=f"q=pos,tau=0.1*{name}")
        assert np.allclose(log.torque, 0.1 * (Q + 1))


def test_the_sample_number_is_a_clock():
    given = Columns(arrays={"q": Q})
    assert np.allclose(to_log(given, map="t=0.008*index").time, 0.008 * np.arange(5))
    with pytest.raises(MappingError, match=r"t=0\.001\*index"):
        to_log(given)


def test_a_map_is_also_a_mapping():
    assert np.array_equal(to_log(columns(), map={"q": "pos", "tau": "2*pos"}).torque, 2 * Q)


def test_channels_that_the_map_leaves_out_are_found_by_name_and_none_leaves_them_out():
    given = columns(effort=3 * Q)
    assert np.array_equal(to_log(given, map="q=2*pos").torque, 3 * Q)
    assert to_log(given, map="q=2*pos,tau=none").torque is None


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("", "is empty"),
        ("x=pos", "'x' is not a channel.*known: t, q, dq"),
        ("q", "'=' is missing"),
        ("q=", "a column is missing"),
        ("q=2", "a column must follow"),
        ("q=2*", "a column is missing"),
        ("q=pos pos", "',' or '\\+' or '-' is missing"),
        ("q=pos[x]", "not a column index"),
        ("q=pos[2:1]", "j > i"),
        ("q=pos[0", "an index is written"),
        ("q=pos /0", "a division by 0"),
        ("q=pos //2", "a column is missing"),
        ("q=__import__('os')", "not understood"),
        ("q=(pos", "'\\)' or ',' is missing"),
        ("q=(pos,2)", "numbers or columns, and not both"),
        ("q=1e999*pos", "not finite"),
        ("q=pos,q=pos", "names 'position' twice"),
        ('q="pos', "not understood"),
    ],
)
def test_mistakes_of_grammar_say_where(text, match):
    with pytest.raises(MappingError, match=match):
        to_log(columns(), map=text)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("q=angle", "no column 'angle'.*Columns: t 5, pos 5x2, .*K 1"),
        ("q=poss", "Did you mean 'pos'"),
        ("q=pos[2]", r"has 2 columns, \[2\] is not there"),
        ("q=pos+wide", "has 3 columns, the terms before it 2"),
        ("q=pos,tau=wide", "different numbers of joints"),
        ("q=short", "has shape \\(3,\\), but the time has 5 samples"),
        ("q=pos*pos", "not a single number"),
        ("t=pos,q=pos", "Time has 2 columns"),
        ("q=pos,tau=amps", "is in A, which is not a unit of torque"),
        ("t=none,q=pos", "needs a time"),
    ],
)
def test_what_does_not_fit_the_file_is_answered_with_its_columns(text, match):
    with pytest.raises(MappingError, match=match):
        to_log(columns(short=np.zeros(3)), map=text)


def test_a_log_must_move():
    with pytest.raises(MappingError, match=r"No position or velocity was found.*Columns: t 5, x 5x2"):
        to_log(Columns(arrays={"t": T, "x": Q}), map="tau=x")


def test_a_stated_unit_and_a_factor_are_not_both_applied():
    given = Columns(arrays={"t": T, "angle": Q}, units={"angle": "deg"})
    assert np.allclose(to_log(given, map="q=deg*angle").position, np.deg2rad(Q))
    assert np.allclose(to_log(given, map="q=angle").position, np.deg2rad(Q))
    with pytest.raises(MappingError, match="stated in deg, not in rpm"):
        to_log(given, map="q=rpm*angle")


def test_a_name_that_ends_with_degrees_is_not_taken_as_radians_in_silence():
    given = Columns(arrays={"t": T, "act_deg": Q, "q_deg": Q})
    log = to_log(given, map="q=act_deg")
    assert np.array_equal(log.position, Q)
    assert any("its name ends with deg" in note for note in log.notes)
    assert np.allclose(to_log(given).position, np.deg2rad(Q))


def test_motor_side_torque_is_brought_to_the_joint():
    log = to_log(columns(), map="q=pos,tau=2*pos", gear=(100.0, -50.0), counts=4096)
    assert np.array_equal(log.torque, 2 * Q * [100, -50])
    assert [joint.torque_side for joint in log.joints] == ["joint", "joint"]
    assert [joint.gear_ratio for joint in log.joints] == [100.0, -50.0]
    assert log.joints[1].encoder_counts == 4096
    assert any("gear ratio" in note for note in log.notes)
    assert np.array_equal(log.on_joint_side().torque, log.torque)


def test_units_of_joints():
    assert [j.unit for j in to_log(columns(), map="q=pos", units="m").joints] == ["m", "m"]
    assert [j.unit for j in to_log(columns(), map="q=pos", units="rad,m").joints] == ["rad", "m"]
    log = to_log(Columns(arrays={"t": T, "q": Q, "dq": Q}), units=["deg", "m"])
    assert np.allclose(log.position, Q * [np.pi / 180, 1])
    assert [j.unit for j in log.joints] == ["rad", "m"]


MISFITS = [
    {"units": "furlong"},
    {"units": ["m"] * 3},
    {"gear": [1, 2, 3]},
    {"gear": 0},
    {"gear": "x"},
    {"counts": float("nan")},
    {"names": "a,b,c"},
    {"names": "a,a"},
]


@pytest.mark.parametrize("options", MISFITS)
def test_options_that_do_not_fit_the_joints(options):
    with pytest.raises(InvalidInput):
        to_log(columns(), map="q=pos", **options)


def test_nothing_is_mapped_in_silence():
    log = to_log(columns(dq=Q, velocity_filtered=Q, torque=Q, tau=2 * Q), map="q=pos")
    text = " ".join(log.notes)
    assert "position = 'pos'" in text
    assert "velocity = 'dq'" in text
    assert "Also called torque, and not used: tau" in text
    assert "No unit is stated, so SI is taken: velocity in rad/s, torque in N.m" in text


def test_a_single_joint_is_called_as_its_columns_are(tmp_path):
    rows = "\n".join(f"{0.01 * i:.2f},{0.1 * i:.2f},{1.0 + i}" for i in range(30))
    path = tmp_path / "one.csv"
    path.write_text(f"time,elbow.q,elbow.tau\n{rows}\n")
    assert read_log(path).names == ("elbow",)


def test_german_headers_and_inverse_units_are_understood(tmp_path):
    path = tmp_path / "messung.csv"
    rows = [f"{2.0 * i:.1f};{i},5;{60.0 * i:.0f};-{i},25" for i in range(9)]
    header = "Zeit [ms];Winkel [°];Drehzahl [min^-1];Drehmoment [Nm]"
    path.write_text("\n".join([header, *(row.replace(".", ",") for row in rows)]) + "\n", encoding="latin-1")
    log = read_log(path)
    assert np.allclose(log.time[1:] - log.time[:-1], 0.002)
    assert np.allclose(log.position[:, 0], np.deg2rad(np.arange(9) + 0.5))
    assert np.allclose(log.velocity[:, 0], 2 * np.pi * np.arange(9))
    assert np.allclose(log.torque[:, 0], -(np.arange(9) + 0.25))


@pytest.mark.parametrize(
    ("text", "kind", "factor"),
    [
        ("min^-1", "angle rate", 2 * np.pi / 60),
        ("U/min", "angle rate", 2 * np.pi / 60),
        ("rad s^-1", "angle rate", 1.0),
        ("m·s⁻¹", "speed", 1.0),
        ("n-m", "torque", 1.0),
    ],
)
def test_inverse_units(text, kind, factor):
    unit = units.parse(text)
    assert unit is not None and unit.kind == kind and np.isclose(unit.factor, factor)
    assert units.parse("s^-1") is None  # of what?


def test_an_offset_without_a_unit_beside_a_column_with_one_is_refused():
    columns = Columns(arrays={"time": np.arange(5.0), "q1 [deg]": np.arange(5.0)}, units={"q1 [deg]": "deg"})
    assert "position = 'q1 [deg]' [deg]" in " ".join(to_log(columns, map='t=time,q="q1 [deg]"').notes)
    with pytest.raises(MappingError, match="the offset -10 states no unit"):
        to_log(columns, map='t=time,q="q1 [deg]"-10')
    for given in ('deg*"q1 [deg]"-10*deg', '"q1 [deg]"-10*deg'):
        log = to_log(columns, map=f"t=time,q={given}")
        np.testing.assert_allclose(log.position[:, 0], np.deg2rad(np.arange(5.0) - 10.0))


def test_patterns_leave_out_the_unit_and_say_when_a_star_multiplies():
    columns = Columns(
        arrays={"time": np.arange(5.0), "q1 [deg]": np.arange(5.0), "q2 [deg]": np.arange(5.0) ** 2}
    )
    assert to_log(columns, map="t=time,q=q*").names == ("1", "2")
    columns = Columns(arrays={name: np.arange(5.0) for name in ("time", "q", "tau", "tau2")})
    with pytest.raises(MappingError, match="multiplies here, since 'tau' is a column itself"):
        to_log(columns, map="t=time,q=q,tau=tau*/2")
