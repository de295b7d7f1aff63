"""From files to logs: what each format makes of small contents written here, and what names and maps make of columns."""

import json
import math
import zipfile

import numpy as np
import pytest

from backdrive.errors import ForbiddenContent, IncompleteFile, MappingError, ReadError, UnknownFormat
from backdrive.logs.readers import (
    _formats,
    _names,
    _shapes,
    hdf5,
    json_,
    mat,
    npz,
    parquet,
    read_log,
    read_logs,
)
from backdrive.logs.readers._expression import Column, parse
from backdrive.logs.readers.columns import Columns, ReadOptions
from backdrive.logs.readers.limits import Limits
from backdrive.logs.readers.mapping import to_log

T = 0.1 * np.arange(6)
Q = np.arange(12.0).reshape(6, 2)
OPTIONS = ReadOptions()


# ------------------------------------------------------------------------------------------------ JSON


def read_json(tmp_path, content):
    path = tmp_path / "a.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return json_.read(str(path), OPTIONS)


@pytest.mark.parametrize("key", [None, "entries", "samples", "data"])
def test_json_samples_become_columns(tmp_path, key):
    samples = [{"t": 0.5 * k, "q": [k, -k], **({"u": 2 * k} if k != 3 else {})} for k in range(6)]
    got = read_json(tmp_path, samples if key is None else {key: samples, "rate": 100})
    assert got.arrays["t"].tolist() == [0.5 * k for k in range(6)] and got.arrays["q"].shape == (6, 2)
    assert np.array_equal(got.arrays["u"], [0, 2, 4, np.nan, 8, 10], equal_nan=True)
    assert any("lack u" in note for note in got.notes)


def test_json_lists_nested_and_odd(tmp_path):
    deep = {"a": {"b": {"c": {"d": {"e": {"too": [1, 2]}, "in": [3, 4]}}}}}
    content = {"t": [0, 1, 2], "n": 7, "flag": True, "holes": [[1, 2], None, [3, 4]], "words": ["x"], "ragged": [[1], [1, 2], [1]],
               "cube": [[[1]]], "empty": [], **deep}  # fmt: skip
    got = read_json(tmp_path, content)
    assert got.arrays["n"].tolist() == [7.0] and got.arrays["flag"].tolist() == [1.0]
    assert np.array_equal(got.arrays["holes"], [[1, 2], [np.nan, np.nan], [3, 4]], equal_nan=True)
    assert got.arrays["a.b.c.d.in"].tolist() == [3, 4] and "a.b.c.d.e.too" not in got.arrays
    assert not {"words", "ragged", "cube", "empty"} & set(got.arrays)
    assert sum("left out" in note for note in got.notes) == 3


def test_json_that_is_cut_is_told_from_json_that_is_none(tmp_path):
    for text in ('{"t": [0, 1', '{"t": [0, 1], ', '[{"t": 1}, {"t"', "{"):
        with pytest.raises(IncompleteFile):
            read_json(tmp_path, text)
    for text in (
        '{"t": [0, oops, 2], "q": [1, 2, 3]}',
        "words",
        '{"t" 5}',
        "[1, 2]",
        '"a"',
        "{}",
        '{"a": "b"}',
        "[]",
        "[{}]",
    ):
        with pytest.raises(ReadError) as refused:
            read_json(tmp_path, text)
        assert not isinstance(refused.value, IncompleteFile), text


def test_a_log_of_bam_by_its_definitions(tmp_path):
    """Duty in 1/885; 4096 counts a turn and a firmware gain of 256 make the duty per rad."""
    loads = [0, 885, -442, 65535 - 441, 32767, 929, 930, 65535]
    entries = [
        {
            "timestamp": 0.1 * k, "position": 0.2 * k, "speed": 2.0, "load": x, "goal_position": 1.0, "temp": 30,
            "torque_enable": k != 2,
        }
        for k, x in enumerate(loads)
    ]  # fmt: skip
    got = read_json(
        tmp_path, {"mass": 0.5, "length": 0.1, "kp": 32, "vin": 7.5, "motor": "xl", "entries": entries}
    )
    wanted = [0.0, 1.0, -442 / 885, -442 / 885, np.nan, 929 / 885, np.nan, -1 / 885]
    assert got.arrays["load"] == pytest.approx(np.array(wanted), nan_ok=True)
    assert got.drive.law == "duty"
    assert got.drive.gains == pytest.approx(
        {"kp": 32.0, "duty_per_rad": 32.0 * 4096 / (2 * math.pi) / 256 / 885, "supply": 7.5}
    )
    assert (got.joints, got.units["temp"], got.channels["load"], got.channels["speed"]) == (
        ("xl",),
        "degC",
        "drive_input",
        "velocity",
    )
    assert any("2 samples of load were read as the signed" in n for n in got.notes)
    assert any("2 samples of load lie beyond full duty" in n for n in got.notes)
    assert any("off in 1 samples" in n for n in got.notes)
    assert any("mass 0.5, length 0.1, motor xl (mass" in n for n in got.notes)
    plain = read_json(tmp_path, {"kq": 3, "entries": entries})
    assert plain.drive is None and plain.arrays["load"].tolist() == loads


# -------------------------------------------------------------------------------------- other formats


def test_files_are_told_by_their_first_bytes_and_then_by_their_suffix(tmp_path):
    heads = {
        "npz": b"PK\x03\x04", "parquet": b"PAR1", "hdf5": b"\x89HDF\r\n\x1a\n", "mat": b"MATLAB 5.0 MAT-file",
        "mcap": b"\x89MCAP0\r\n",
        "db3": b"SQLite format 3\x00", "bag": b"#ROSBAG V2.0",
    }  # fmt: skip
    for name, head in heads.items():
        path = tmp_path / "odd.csv"
        path.write_bytes(head + b"rest")
        assert _formats.recognise(path).name == name
    for at in (512, 1024, 2048):
        path.write_bytes(b"\x00" * at + heads["hdf5"])
        assert _formats.recognise(path).name == "hdf5"
    path.write_bytes(b"\x00" * 100 + heads["hdf5"])
    assert _formats.recognise(path).name == "csv"
    path.write_bytes(b"PK\x05\x06")
    assert _formats.recognise(path).name == "npz"
    for suffix, name in {
        ".JSON": "json",
        ".tsv": "csv",
        ".log": "csv",
        ".h5": "hdf5",
        ".pq": "parquet",
        ".bag": "bag",
    }.items():
        other = tmp_path / f"a{suffix}"
        other.write_text("1")
        assert _formats.recognise(other).name == name
    for name, said in (
        ("a.gz", "compressed"),
        ("a.zip", "compressed"),
        ("a.doc", "no known kind"),
        ("a", "no known kind"),
    ):
        other = tmp_path / name
        other.write_text("1")
        with pytest.raises(UnknownFormat, match=said):
            _formats.recognise(other)
    (tmp_path / "none.csv").write_bytes(b"")
    with pytest.raises(UnknownFormat, match="empty"):
        _formats.recognise(tmp_path / "none.csv")
    with pytest.raises(ReadError, match="cannot be opened"):
        _formats.recognise(tmp_path / "absent.csv")
    assert _formats.by_name("bag").module == "bag"


def test_archives_of_numpy(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(
        path,
        a=np.asfortranarray(Q),
        b=np.arange(5, dtype=np.int8),
        c=np.array("word"),
        d=np.zeros((2, 2, 2)),
        e=np.empty((0, 3)),
    )
    got = npz.read(str(path), OPTIONS)
    assert (
        np.array_equal(got.arrays["a"], Q)
        and got.arrays["b"].dtype == np.int8
        and got.arrays["e"].shape == (0, 3)
    )
    assert not {"c", "d"} & set(got.arrays) and sum("left out" in n for n in got.notes) == 2
    np.savez(path, a=np.array([{}], dtype=object))
    with pytest.raises(ForbiddenContent, match="pickled"):
        npz.read(str(path), OPTIONS)
    for shape, raw, error in (((4,), 3, IncompleteFile), ((4,), 5, None), ((100,), 4, ReadError)):
        stream = npz.np.lib.format
        with zipfile.ZipFile(path, "w") as archive, archive.open("a.npy", "w") as member:
            stream.write_array_header_1_0(member, {"descr": "<f8", "fortran_order": False, "shape": shape})
            member.write(np.arange(float(raw)).tobytes())
        if error is None:
            assert npz.read(str(path), OPTIONS).arrays["a"].tolist() == [0, 1, 2, 3]
        else:
            with pytest.raises(ReadError):
                npz.read(str(path), OPTIONS)
    big = np.zeros(400_000)
    np.savez(path, a=big + 1.5)
    assert np.array_equal(npz.read(str(path), OPTIONS).arrays["a"], big + 1.5)


def test_variables_of_matlab(tmp_path):
    from scipy.io import savemat

    path = tmp_path / "a.mat"
    content = {
        "q": Q,
        "t": T,
        "s": {"x": Q[:, 0], "in": {"y": 3.0}},
        "word": "abc",
        "flag": True,
        "none": np.empty((0, 0)),
    }
    for compressed in (False, True):
        savemat(path, content, do_compression=compressed, oned_as="column")
        got = mat.read(str(path), OPTIONS)
        assert np.array_equal(got.arrays["q"], Q) and got.arrays["t"].ravel().tolist() == T.tolist()
        assert got.arrays["s.x"].ravel().tolist() == Q[:, 0].tolist() and got.arrays["s.in.y"].tolist() == [
            3.0
        ]
        assert got.arrays["flag"].tolist() == [1] and not {"word", "none"} & set(got.arrays)
        assert "word" in got.notes[0] and "none" in got.notes[0]
        whole = path.read_bytes()
        for limits, fits in ((Limits(max_bytes=10**6), True), (Limits(max_bytes=200), False)):
            if not fits:
                with pytest.raises(ReadError):
                    mat.read(str(path), ReadOptions(limits=limits))
        path.write_bytes(whole[:-30])
        with pytest.raises(IncompleteFile, match="declares"):
            mat.read(str(path), OPTIONS)
    path.write_bytes(b"MATLAB 4" + b"\0" * 600)
    with pytest.raises(ReadError, match="version 5"):
        mat.read(str(path), OPTIONS)


def test_datasets_of_hdf5(tmp_path):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["q"], file["g/t"], file["g/deep/x"] = Q, T, np.arange(4, dtype=np.int16)
        file["word"], file["cube"], file["none"] = "abc", np.zeros((2, 2, 2)), np.empty((0, 2))
        file["m"] = Q
        file["m"].attrs["MATLAB_class"] = np.bytes_("double")
        file["row"] = T[None, :]
        file["row"].attrs["MATLAB_class"] = np.bytes_("double")
        file["text"] = np.array([[97]], dtype=np.uint16)
        file["text"].attrs["MATLAB_class"] = np.bytes_("char")
        file["gone"] = np.array([0.0, 0.0])
        file["gone"].attrs["MATLAB_empty"] = 1
    got = hdf5.read(str(path), OPTIONS)
    assert set(got.arrays) == {"q", "g.t", "g.deep.x", "m", "row"}
    assert (
        np.array_equal(got.arrays["q"], Q)
        and np.array_equal(got.arrays["m"], Q.T)
        and got.arrays["row"].shape == (6,)
    )
    assert all(name in got.notes[0] for name in ("word", "cube", "none", "text", "gone"))
    total = 2 * Q.nbytes + 2 * T.nbytes + 8
    for most, fits in ((total, True), (total - 1, False)):
        options = ReadOptions(limits=Limits(max_bytes=most))
        if fits:
            assert len(hdf5.read(str(path), options).arrays) == 5
        else:
            with pytest.raises(ReadError):
                hdf5.read(str(path), options)
    for make, said in (
        (lambda f: f.__setitem__("l", h5py.ExternalLink("b.h5", "/x")), "another file"),
        (lambda f: f.__setitem__("l", h5py.SoftLink("/q")), "by name"),
        (lambda f: f.__setitem__("g/loop", f["g"]), "reached before"),
    ):
        with h5py.File(path, "a") as file:
            make(file)
        with pytest.raises(ForbiddenContent, match=said):
            hdf5.read(str(path), OPTIONS)
        with h5py.File(path, "a") as file:
            del file["l" if "l" in file else "g/loop"]


def test_columns_of_parquet(tmp_path):
    pa = pytest.importorskip("pyarrow")
    from pyarrow import parquet as pq

    path = tmp_path / "a.parquet"
    table = pa.table(
        {
            "t": pa.array([5_000, 5_500, 7_000], pa.timestamp("ms")), "n": pa.array([1, None, 3], pa.int32()),
            "b": pa.array([True, False, True]),
            "v": pa.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]), "ragged": pa.array([[1.0], [1.0, 2.0, 3.0], [5.0, 6.0]]),
            "word": pa.array(["a", "b", "c"]), "f": pa.array([[1.0, 2.0]] * 3, pa.list_(pa.float32(), 2)),
        }
    )  # fmt: skip
    pq.write_table(table, path)
    got = parquet.read(str(path), OPTIONS)
    assert got.arrays["t"].tolist() == [0.0, 500.0, 2000.0] and got.units == {"t": "ms"}
    assert np.array_equal(got.arrays["n"], [1, np.nan, 3], equal_nan=True) and got.arrays["b"].tolist() == [
        True,
        False,
        True,
    ]
    assert got.arrays["v"].tolist() == [[1, 2], [3, 4], [5, 6]] and got.arrays["f"].shape == (3, 2)
    assert not {"ragged", "word"} & set(got.arrays) and len(got.notes) == 2
    for most, fits in ((3 * 7 * 8, True), (3 * 7 * 8 - 1, False)):  # rows times leaf columns times 8
        options = ReadOptions(limits=Limits(max_bytes=max(most, 1), ratio_floor=1, max_ratio=1e9))
        if not fits:
            with pytest.raises(ReadError):
                parquet.read(str(path), options)
    pq.write_table(table.slice(0, 0), path)
    with pytest.raises(ReadError, match="no rows"):
        parquet.read(str(path), OPTIONS)


# ------------------------------------------------------------------------------------------ channels


@pytest.mark.parametrize(
    ("start", "step", "seconds"),
    [(1.7e18, 1e6, 1e-3), (1.7e15, 1e3, 1e-3), (1.7e12, 1.0, 1e-3), (1.7e9, 1e-3, None), (0.0, 1.0, None), (7.9e17, 1e6, None),
     (8.1e17, 1e6, 1e-3), (4.9e18, 1e6, 1e-3), (5.1e18, 1e6, None), (8.1e14, 1e3, 1e-3), (7.9e14, 1e3, None), (8.1e11, 1.0, 1e-3)],
)  # fmt: skip
def test_clocks_that_count_from_1970_become_seconds(start, step, seconds):
    time = (
        (start + step * np.arange(6))
        if start < 1e15
        else np.array([int(start) + k * int(step) for k in range(6)])
    )
    log = to_log(Columns(arrays={"time": time, "q": Q}))
    steps = np.diff(log.time)
    assert steps == pytest.approx(np.full(5, step if seconds is None else seconds), rel=1e-3)
    assert bool(log.time[0] == 0.0) is (seconds is not None or start == 0.0)


def test_arrays_are_turned_so_that_time_comes_first():
    assert _shapes.orient(np.zeros(5), 5).shape == (5, 1) and _shapes.orient(np.zeros(4), 5) is None
    assert _shapes.orient(np.zeros((5, 2)), 5).shape == (5, 2) and _shapes.orient(
        np.zeros((2, 5)), 5
    ).shape == (5, 2)
    assert _shapes.orient(np.zeros((2, 3)), 5) is None
    for shape, n, joints in (
        ((5,), 5, 1),
        ((4,), 5, 0),
        ((5, 2), 5, 2),
        ((3, 5), 5, 3),
        ((2, 3), 5, 0),
        ((5, 5), 5, 5),
    ):
        assert _shapes.extent(shape, n) == joints


def test_units_bring_columns_to_si():
    arrays = {"t": 1e3 * T, "q": Q, "dq": Q, "tau": Q, "temp": Q}
    units = {"t": "ms", "q": "deg", "dq": "rpm", "tau": "mNm", "temp": "K"}
    log = to_log(Columns(arrays=arrays, units=units))
    assert log.time == pytest.approx(T) and log.position == pytest.approx(np.deg2rad(Q))
    assert log.velocity == pytest.approx(Q * 2.0 * np.pi / 60.0) and log.torque == pytest.approx(1e-3 * Q)
    assert log.temperature == pytest.approx(Q - 273.15)
    assert to_log(Columns(arrays={"t": T, "q": Q}, units={"q": "mm"})).joints[0].unit == "m"
    assert to_log(Columns(arrays={"t": T, "dq": Q}, units={"dq": "m/s"})).joints[0].unit == "m"
    assert to_log(Columns(arrays={"t": T, "v": Q}), map="dq=v").joints[0].unit == "rad"


def test_what_is_zero_throughout_was_not_measured():
    zero = np.zeros_like(Q)
    log = to_log(Columns(arrays={"t": T, "q": Q, "dq": zero, "tau": zero, "temp": zero, "tau_ext": zero}))
    assert (
        log.velocity is None
        and log.torque is None
        and log.temperature is None
        and log.external_torque is None
    )
    assert sum("exactly zero" in note for note in log.notes) == 4
    still = to_log(Columns(arrays={"t": T, "q": zero, "dq": zero, "tau": zero}))
    assert still.velocity is not None and still.torque is None
    asked = to_log(Columns(arrays={"t": T, "q": Q, "tau": zero}), map="tau=tau")
    assert asked.torque is not None


@pytest.mark.parametrize(
    ("names", "found", "joints"),
    [
        (["time", "q", "dq", "tau"], {"time": ("time",), "position": ("q",), "velocity": ("dq",), "torque": ("tau",)}, ()),
        (["t", "q2", "q10", "q1"], {"time": ("t",), "position": ("q1", "q2", "q10")}, ("joint_1", "joint_2", "joint_10")),
        (["t", "joint_1_pos", "joint_2_pos"], {"time": ("t",), "position": ("joint_1_pos", "joint_2_pos")}, ("joint_1", "joint_2")),
        (["t", "pos_j3", "pos_j4"], {"time": ("t",), "position": ("pos_j3", "pos_j4")}, ("joint_3", "joint_4")),
        (["t", "position", "q"], {"time": ("t",), "position": ("position",)}, ()),
        (["t", "q1", "q2", "tau1"], {"time": ("t",), "position": ("q1", "q2")}, ("joint_1", "joint_2")),
        (["t", "left.q", "right.q"], {"time": ("t",), "position": ("left.q", "right.q")}, ("left", "right")),
        (["t", "a.state.q", "a.cmd.q"], {"time": ("t",)}, ()),
        (["t", "elbow/q", "elbow/tau"], {"time": ("t",), "position": ("elbow/q",), "torque": ("elbow/tau",)}, ("elbow",)),
        (["t", "jointPosition"], {"time": ("t",), "position": ("jointPosition",)}, ()),
        (["t", "q_deg"], {"time": ("t",), "position": ("q_deg",)}, ()),
        (["t", "x", "y"], {"time": ("t",)}, ()),
        (["t", "q12345"], {"time": ("t",)}, ()),
        (["t", "q[0]", "q[1]"], {"time": ("t",), "position": ("q[0]", "q[1]")}, ("joint_0", "joint_1")),
    ],
)  # fmt: skip
def test_names_that_leave_no_doubt(names, found, joints):
    got = _names.guess(dict.fromkeys(names, 1), {})
    assert (dict(got.columns), got.joints) == (found, joints)


def test_names_in_doubt_and_notes():
    assert "several places" in _names.guess(dict.fromkeys(["t", "a.state.q", "a.cmd.q"], 1), {}).doubt
    got = _names.guess(dict.fromkeys(["t", "q1", "q2", "tau1", "position"], 1), {})
    assert got.columns["position"] == ("position",)
    assert any("not used: q1, q2" in note for note in got.notes)
    amps = _names.guess(dict.fromkeys(["t", "q", "torque"], 1), {"torque": "A"})
    assert "torque" not in amps.columns and any("is in A" in note for note in amps.notes)
    some = _names.guess(dict.fromkeys(["t", "a.q", "b.q", "a.tau"], 1), {})
    assert some.joints == ("a", "b") and any(
        "torque: b has none (a.tau of a is there)" in n for n in some.notes
    )
    assert _names.guess({"t": 1, "q_deg": 1}, {}).units == {"q_deg": "deg"}
    assert _names.bare("ActualQ [x]") == "actual_q_x"


def test_maps_by_their_grammar():
    got = parse('t=0.001*index, q=-deg*a.b[1:3] + 2*k*"odd name"[0] - c,tau=none,dq=+v')
    assert got["torque"] is None
    ((time,),), ((first, second, third),), ((speed,),) = got["time"], got["position"], got["velocity"]
    assert (time.factor, time.columns) == (0.001, (Column("index"),))
    assert (first.factor, first.factors) == (-1.0, (("deg", False),))
    assert first.columns == (Column("a.b", slice(1, 3)),)
    assert (second.factor, second.factors) == (2.0, (("k", False),))
    assert second.columns == (Column("odd name", slice(0, 1)),)
    assert (third.factor, third.columns[0].index, speed.factor) == (-1.0, None, 1.0)
    assert parse("q=2*-3*x")["position"][0][0].factor == -6.0
    for text, place in (("q=a b", 5), ("x=a", 1), ("q=a[2:2]", 9), ("q=$", 3), ("q=a,dq=", 8), ("q=2", 4)):
        with pytest.raises(MappingError, match=f"at position {place} of"):
            parse(text)


def test_terms_of_a_map_are_checked_against_the_columns():
    columns = Columns(arrays={"t": T, "a": Q, "k": np.array([3.0]), "one": T}, units={"a": "deg"})
    log = to_log(columns, map="q=one + 2*one,tau=k*one")
    assert log.position[:, 0] == pytest.approx(3.0 * T) and log.torque[:, 0] == pytest.approx(3.0 * T)
    wide = to_log(columns, map="q=a,tau=one + 0*a").torque  # one column beside two counts for both
    assert wide == pytest.approx(np.column_stack([T, T]))
    assert to_log(columns, map="q=2*a").position == pytest.approx(2.0 * np.deg2rad(Q))
    assert to_log(columns, map="q=a[1]").position[:, 0] == pytest.approx(np.deg2rad(Q[:, 1]))
    constant = to_log(columns, map="q=one,tau=k").torque
    assert constant[:, 0].tolist() == [3.0] * 6
    with pytest.raises(MappingError, match=r"\[2\] is not there"):
        to_log(columns, map="q=a[2]")
    with pytest.raises(MappingError, match="which is not a unit of torque"):
        to_log(columns, map="q=one,tau=a[0]")
    amps = Columns(arrays={"t": T, "q": Q, "i": Q + 1.0}, units={"i": "A"})
    assert to_log(amps, map="q=q,tau=1.5*i").torque == pytest.approx(1.5 * (Q + 1.0))


# ------------------------------------------------------------------------------------------- folders


def test_folders_of_logs_are_read_in_natural_order(tmp_path):
    for k in (10, 2, 1):
        (tmp_path / f"run{k}.csv").write_text(
            "t,q,tau\n" + "".join(f"{0.1 * i},{k + i},{i}\n" for i in range(5))
        )
    (tmp_path / ".hidden.csv").write_text("junk")
    logs = read_logs(tmp_path, guarded=False)
    assert [log.position[0, 0] for log in logs] == [1.0, 2.0, 10.0]
    with pytest.raises(ReadError, match="holds 3 logs"):
        read_log(tmp_path, guarded=False)
    (tmp_path / "a.json").write_text("{}")
    with pytest.raises(ReadError, match="several kinds: 3 .csv, 1 .json"):
        read_logs(tmp_path, guarded=False)
    assert len(read_logs(tmp_path, guarded=False, format="csv")) == 3
    big = tmp_path / "run1.csv"
    size = big.stat().st_size
    assert len(read_log(big, guarded=False, limits=Limits(max_file_bytes=size))) == 5
    with pytest.raises(ReadError, match="more than the limit"):
        read_log(big, guarded=False, limits=Limits(max_file_bytes=size - 1))
    for wrong in (tmp_path / "absent.csv", tmp_path / "run1.csv" / "x"):
        with pytest.raises(ReadError, match="does not exist"):
            read_log(wrong, guarded=False)
