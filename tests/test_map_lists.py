"""`--map` for several joints: lists, ranges, patterns, factors one a joint; sides of a transmission; and their mistakes."""

import numpy as np
import pytest

from backdrive import Joint, Log, read_log
from backdrive.errors import InvalidInput, MappingError
from backdrive.logs.readers.columns import Columns
from backdrive.logs.readers.mapping import to_log

T = np.arange(6) * 0.1
RAW = {name: np.arange(6.0) + k for k, name in enumerate(("a", "b", "c"))}
Q = np.column_stack(list(RAW.values()))


def log_of(map: str | None, units: dict | None = None, joints: tuple = (), **arrays) -> Log:
    return to_log(Columns(arrays={"t": T, **arrays}, units=units or {}, joints=joints), map=map)


def test_lists_factors_offsets_and_division():
    log = log_of("t=t,q=2*a,-b+0.5,c/4,tau=(1,-2,4)*(a,b,c)/2", **RAW)
    assert np.allclose(log.position, Q * (2.0, -1.0, 0.25) + (0.0, 0.5, 0.0))
    assert np.allclose(log.torque, Q * (0.5, -1.0, 2.0))
    assert np.allclose(log_of("q=a-30*deg", **RAW).position[:, 0], RAW["a"] - np.pi / 6)
    assert np.allclose(log_of("q=0.5+a", **RAW).position[:, 0], RAW["a"] + 0.5)
    assert np.allclose(log_of("q=a/k", k=np.array([4.0]), **RAW).position[:, 0], RAW["a"] / 4)
    assert np.allclose(log_of("q=turn/4096*(a,b)", **RAW).position, Q[:, :2] * 2 * np.pi / 4096)


@pytest.mark.parametrize(
    ("text", "factors", "offsets"),
    [
        ("(a,b,c)+(0.1,-0.2,0.3)", 1.0, (0.1, -0.2, 0.3)),
        ("(0.1,-0.2,0.3)+(a,b,c)", 1.0, (0.1, -0.2, 0.3)),
        ("(1,-2,4)*(a,b,c)-(10,20,-30)*deg", (1.0, -2.0, 4.0), np.deg2rad((-10.0, -20.0, 30.0))),
        ("deg*(a,b,c)-deg*(10,20,-30)/2", np.pi / 180, np.deg2rad((-5.0, -10.0, 15.0))),
        ("2*(a,b,c)+(1,2,3)-0.5", 2.0, (0.5, 1.5, 2.5)),
        ("(a,b)+(1,2),c-(3)", 1.0, (1.0, 2.0, -3.0)),
    ],
)
def test_offsets_one_a_joint(text, factors, offsets):
    assert np.allclose(log_of(f"q={text}", **RAW).position, Q * factors + offsets)


def test_offsets_of_ranges_patterns_and_wide_columns():
    arrays = {f"x{i}_ang": RAW["a"] * i for i in (1, 2)}
    wanted = np.column_stack([RAW["a"] + 0.1, 2 * RAW["a"] + 0.2])
    for text in ("x1_ang..x2_ang+(0.1,0.2)", "*_ang+(0.1,0.2)", '"x*_ang"+(0.1,0.2)'):
        assert np.allclose(log_of(f"q={text}", **arrays).position, wanted), text
    wide = log_of("q=w+(0.1,0.2)", w=np.column_stack(list(arrays.values())))
    assert np.allclose(wide.position, wanted)
    assert any("'w' + (0.1,0.2)" in note for note in wide.notes)
    with pytest.raises(MappingError, match=r"offset 0\.1 states no unit"):
        log_of("q=d+(0.1,0)", {"d [deg]": "deg"}, **{"d [deg]": Q[:, :2]})


def test_a_column_with_a_slash_is_no_division():
    assert np.array_equal(log_of("q=m/2", **{"m/2": RAW["a"], "m": RAW["b"]}).position[:, 0], RAW["a"])
    assert np.array_equal(log_of("q=m/2", m=RAW["b"]).position[:, 0], RAW["b"] / 2)


def test_columns_with_a_slash_in_patterns_lists_and_ranges():
    arrays = {"m/1": RAW["a"], "m/2": RAW["b"], "m": RAW["c"], "/js/hip/p": RAW["a"], "/js/knee/p": RAW["b"]}
    wanted = Q[:, :2]
    for text, factor in (
        ("m/*", 1.0),
        ('"m/*"', 1.0),
        ("2*m/*/4", 0.5),
        ("m/1..m/2", 1.0),
        ("/js/*/p", 1.0),
        ("-/js/*/p/2", -0.5),
        ("deg*(/js/hip/p,/js/knee/p)", np.pi / 180),
        ("2*/js/hip/p,2*/js/knee/p", 2.0),
        ("*/p/2", 0.5),
    ):
        assert np.allclose(log_of(f"q={text}", **arrays).position, factor * wanted), text
    assert np.allclose(log_of("q=m/3", **arrays).position[:, 0], RAW["c"] / 3)


def test_a_name_that_looks_like_a_unit_is_taken_with_a_factor_of_one():
    stated = {"x/a": "a", "x/b": "b"}
    arrays = {"x/a": RAW["a"], "x/b": RAW["b"]}
    with pytest.raises(MappingError, match=r"'x/a' is in a, which is not a unit of position.*1 if the name"):
        log_of("q=x/*", stated, **arrays)
    log = log_of("q=1*x/*", stated, **arrays)
    assert np.allclose(log.position, Q[:, :2])
    assert any(
        "'x/a' was taken as SI, as its factor is 1, though its name says a" in note for note in log.notes
    )


def test_ranges():
    arrays = {f"j{i}_x": RAW["a"] + i for i in range(8, 12)}
    assert np.allclose(log_of("q=j8_x..j11_x", **arrays).position, RAW["a"][:, None] + (8, 9, 10, 11))
    padded = {f"I{i:02d}": RAW["a"] * i for i in (1, 2)}
    assert np.allclose(log_of("q=I01..I02", **padded).position[:, 1], 2 * RAW["a"])
    indexed = {f"x[{i}]": RAW["a"] * i for i in range(3)}
    for text in ("x[0]..x[2]", "x[0:3]", '"x[0]".."x[2]"', "x[0],x[1],x[2]"):
        assert np.allclose(log_of(f"q={text}", **indexed).position[:, 2], 2 * RAW["a"]), text


def test_patterns_name_the_joints_and_bring_channels_to_one_order():
    arrays = {"hip_ang": RAW["a"], "knee_ang": RAW["b"], "knee_i": 10 * RAW["b"], "hip_i": 10 * RAW["a"]}
    log = log_of("q=*_ang,tau=2**_i", **arrays)
    assert log.names == ("hip", "knee")
    assert all(joint.named for joint in log.joints)
    assert np.allclose(log.torque, 20 * log.position)
    assert log_of('q="/js/*/p"', **{"/js/hip/p": RAW["a"]}).names == ("hip",)
    assert log_of("q=ang*", ang1=RAW["a"], ang2=RAW["b"]).names == ("1", "2")


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("q=*_nothing", r"no column matches '\*_nothing'.*Columns: t, a, b"),
        ("q=(1,2)*(a,b,c)", "2 factors for 3 columns"),
        ("q=(1,2)*a", "2 factors for 1 columns"),
        ("q=(1,2)*(3,4)*(a,b)", "more than one list of factors"),
        ("q=(1,2)", "a list of factors or offsets needs columns"),
        ("q=(1,2)+(3,4)", "a list of factors or offsets needs columns"),
        ("q=(a,b,c)+(1,2)", "2 offsets for 3 columns"),
        ("q=a,b,c+(1,2,3)", "3 offsets for 1 columns"),
        ("q=(a,)", "a column is missing"),
        ("q=(a,(b,c))", "a column is missing"),
        ("q=(a,-b)", "a sign stands before the list"),
        ("q=nosuch_*", r"no column matches 'nosuch_\*'.*Columns: t, a, b"),
        ("q=2.5*nosuch_*,tau=a", r"no column matches 'nosuch_\*'"),
        ("q=deg*nosuch/*+0.1", r"no column matches 'nosuch/\*'"),
        ("q=turn/4096*nosuch_*", r"no column matches 'nosuch_\*'"),
        ("q=nosuch*(a,b)", "no column 'nosuch'"),
        ("q=nosuch*_x", r"no column matches 'nosuch\*_x'"),
        ("q=nosuch*a", "no column 'nosuch'"),
        ("q=a,t=nosuch*index", "no column 'nosuch'"),
        ("q=a*", "since 'a' is a column itself"),
        ("q=deg*", "since 'deg' is a factor"),
        ("q=nosuch_1..nosuch_3", "no column 'nosuch_1'"),
        ("q=x3..x1", "runs backwards"),
        ("q=x1..x3", "no column 'x2'"),
        ("q=x1..y3", "differ in more than one number"),
        ("q=x1..", "a range ends with a column"),
        ("q=x1..x99999", "more than 4096"),
        ("q=x1..x9999999999", "no number of a column"),
        ("q=a/0", "division by 0"),
        ("q=a/zero", "is 0, and nothing can be divided"),
        ("q=a,b,tau=c,a,b", "different numbers of joints"),
        ("q=x*,tau=pre*", "names the joints 1, 3, that of torque 1"),
        ("t=a..b", "differ in more than one number"),
        ("q=1e300*1e300*a", "not finite"),
    ],
)
def test_mistakes_name_the_value(text, match):
    arrays = {**RAW, "x1": T, "x3": T, "pre1": T, "zero": np.array([0.0])}
    with pytest.raises(MappingError, match=match):
        log_of(text, **arrays)


def test_a_factor_and_a_unit_in_the_name_are_not_both_applied():
    stated = {"q [deg]": "deg", "T [ms]": "ms", "i [mA]": "mA"}
    arrays = {"q [deg]": RAW["a"], "T [ms]": 1e3 * T, "i [mA]": RAW["b"]}
    for time in ('0.001*"T [ms]"', '"T [ms]"/1000', '"T [ms]"'):
        assert np.allclose(log_of(f"t={time},q=q", stated, **arrays).time, T), time
    log = log_of('t=T,q=q,tau=0.0025*"i [mA]"', stated, **arrays)
    assert np.allclose(log.torque[:, 0], 0.0025 * RAW["b"])
    with pytest.raises(MappingError, match=r"stated in deg and has a factor.*0\.0174533\*"):
        log_of("t=T,q=2*q", stated, **arrays)
    assert np.allclose(log_of("t=T,q=2*deg*q", stated, **arrays).position[:, 0], 2 * np.deg2rad(RAW["a"]))


def test_positions_of_the_motor_side():
    given = Columns(arrays={"t": T, "q": Q, "dq": Q, "tau": Q})
    log = to_log(given, gear=(100, 50, -2), motor_side="q,tau")
    assert np.allclose(log.position, Q / (100, 50, -2)) and np.allclose(log.torque, Q * (100, 50, -2))
    assert np.array_equal(log.velocity, Q)
    only = to_log(given, gear=100, motor_side=["q"])
    assert np.array_equal(only.torque, Q) and np.allclose(only.position, Q / 100)
    for wrong, match in (
        ("q,temp", "'temp' is no channel"),
        ("", "no channel"),
        ("qr", "reference is not in the log"),
    ):
        with pytest.raises(InvalidInput, match=match):
            to_log(given, gear=100, motor_side=wrong)
    with pytest.raises(InvalidInput, match="no gear ratio"):
        to_log(given, motor_side="q")


def test_coupled_motors():
    matrix = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -0.5, 2.0]])
    joints = tuple(Joint(name=n) for n in "abc")
    log = Log(time=T, joints=joints, position=Q, velocity=Q, torque=Q).apply_coupling(matrix)
    assert np.allclose(log.position, Q @ matrix.T) and np.allclose(log.torque @ matrix, Q)
    assert np.allclose((log.torque * log.velocity).sum(axis=1), (Q * Q).sum(axis=1))  # power is kept
    assert log.select(["c", "a", "b"]).coupling == ((0.0, -0.5, 2.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    assert log.select("a").coupling is None
    with pytest.raises(InvalidInput, match="already"):
        log.apply_coupling(matrix)
    for wrong in (np.ones((3, 3)), np.eye(2), np.full((3, 3), np.nan), [[1, 2], [3]], "x"):
        with pytest.raises(InvalidInput, match="no invertible matrix of 3"):
            Log(time=T, joints=joints, position=Q).apply_coupling(wrong)


@pytest.mark.parametrize(
    ("name", "asked", "doubted"),
    [
        ("current [mA]", '0.8*"current [mA]"', True),  # a constant for one A
        ("current [mA]", '0.0008*"current [mA]"', False),
        ("current_mA", "0.8*current_mA", True),
        ("current_mA", "0.8e-3*current_mA", False),
        ("tau_mNm", "tau_mNm", True),
        ("tau_mNm", "0.001*100*tau_mNm", False),
    ],
)
def test_a_factor_that_is_large_for_the_unit_in_a_name_is_doubted(tmp_path, name, asked, doubted):
    rows = "\n".join(f"{0.01 * k},{np.sin(0.1 * k)},{1000 * np.cos(0.1 * k)}" for k in range(60))
    (tmp_path / "a.csv").write_text(f"time,q,{name}\n{rows}\n")
    log = read_log(tmp_path / "a.csv", map=f"tau={asked}")
    assert any("was taken as SI" in note for note in log.notes) is doubted


def test_counts_in_a_name_and_turns_a_count_are_no_contradiction(tmp_path):
    (tmp_path / "a.csv").write_text(
        "time,position [counts]\n" + "\n".join(f"{k},{9 * k}" for k in range(60)) + "\n"
    )
    log = read_log(tmp_path / "a.csv", map='q=turn/3600*"position [counts]"')
    assert log.position[40, 0] == pytest.approx(40 * 9 * 2.0 * np.pi / 3600)


def test_a_torque_in_mnm_is_found_by_its_name(tmp_path):
    (tmp_path / "a.csv").write_text(
        "time,q,tau_mNm\n" + "\n".join(f"{k},{9 * k},{k}" for k in range(60)) + "\n"
    )
    assert read_log(tmp_path / "a.csv").torque[40, 0] == pytest.approx(0.04)
