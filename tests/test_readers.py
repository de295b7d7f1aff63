"""Every reader: what another library wrote comes back, and what cannot be read is answered in words."""

import contextlib
import json
import os
import struct
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks" / "evidence"))
from _log_files import NAMES, WRITERS, motion, write_bag, write_mcap

from backdrive.errors import (
    IncompleteFile,
    InvalidInput,
    MappingError,
    MissingExtra,
    ReadError,
    UnhealthyLog,
    UnknownFormat,
    UnknownName,
)
from backdrive.logs.joint import digest
from backdrive.logs.readers import READERS, peek, read_columns, read_log, read_logs
from backdrive.logs.readers._jointstate import Gatherer
from backdrive.logs.readers.columns import ReadOptions
from backdrive.logs.readers.limits import Limits

DATA = os.environ.get("BACKDRIVE_DATA", "")
needs_data = pytest.mark.skipif(
    not Path(DATA, "emps").is_dir(), reason="BACKDRIVE_DATA does not name the real logs"
)
CASES = [(name, variant) for name, (_, _, count) in WRITERS.items() for variant in range(count)]


def written(folder: Path, name: str, variant: int = 0, log=None) -> Path:
    suffix, write, _ = WRITERS[name]
    path = folder / f"log{variant}{suffix}"
    write(path, log or motion(), variant)
    return path


def test_a_model_file_is_not_taken_for_a_log(tmp_path):
    path = tmp_path / "model.json"
    path.write_text('{"format": "backdrive-friction-model", "schema": 2, "joints": []}')
    with pytest.raises(ReadError, match="friction model.*backdrive show.*not a log"):
        read_log(path)


def test_every_format_has_a_writer_here():
    assert {form.name for form in READERS} == set(WRITERS)


@pytest.mark.parametrize(("name", "variant"), CASES)
def test_what_was_written_comes_back(tmp_path, name, variant):
    expected = motion()
    path = written(tmp_path, name, variant)
    log = read_log(path)
    joints = 1 if (name, variant) == ("json", 2) else 2
    scale = np.pi / 180 if (name, variant) == ("csv", 1) else 1.0
    tolerance = 2e-6 if name == "csv" or (name, variant) == ("parquet", 2) else 1e-12
    assert np.allclose(log.time - log.time[0], expected["time"], rtol=0, atol=max(tolerance, 1e-9))
    assert np.allclose(log.position, scale * expected["position"][:, :joints], rtol=0, atol=tolerance)
    assert np.allclose(log.velocity, scale * expected["velocity"][:, :joints], rtol=0, atol=tolerance)
    if joints == 2:
        assert np.allclose(log.torque, expected["effort"], rtol=0, atol=tolerance)
    assert log.sources[0].sha256 == digest(path)
    assert any(note.startswith("Channels: ") for note in log.notes)


@pytest.mark.parametrize("name", WRITERS)
def test_a_child_process_changes_nothing(tmp_path, name):
    path = written(tmp_path, name)
    guarded, plain = read_log(path), read_log(path, guarded=False)
    assert guarded.notes == plain.notes
    assert guarded.channels.keys() == plain.channels.keys()
    assert all(np.array_equal(guarded.channels[c], plain.channels[c]) for c in plain.channels)


@pytest.mark.parametrize("name", WRITERS)
def test_a_cut_file_gives_a_log_or_a_typed_error(tmp_path, name):
    path = written(tmp_path, name)
    whole = path.read_bytes()
    for share in (0.02, 0.3, 0.6, 0.9, 0.999):
        path.write_bytes(whole[: int(share * len(whole))])
        with contextlib.suppress(ReadError, MappingError):
            assert 0 < len(read_log(path, format=name)) <= len(motion()["time"])


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize("content", [b"", b"\x00" * 300, bytes(range(256)) * 8, b"hello, world\n" * 50])
def test_what_is_no_log_gives_a_typed_error(tmp_path, name, content):
    path = tmp_path / f"log{WRITERS[name][0]}"
    path.write_bytes(content)
    with pytest.raises(ReadError, match="log"):
        read_log(path)


@pytest.mark.parametrize(
    ("name", "module", "extra"),
    [("parquet", "pyarrow", "table"), ("hdf5", "h5py", "hdf5"), ("mcap", "zstandard", "ros")],
)
def test_a_missing_extra_is_named(tmp_path, monkeypatch, name, module, extra):
    path = written(tmp_path, name, 1)
    for loaded in [
        m for m in sys.modules if m.split(".")[0] == module or m == f"backdrive.logs.readers.{name}"
    ]:
        monkeypatch.delitem(sys.modules, loaded)
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtra, match=rf'pip install "backdrive\[{extra}\]"'):
        read_log(path, guarded=False)


# --- text tables ---------------------------------------------------------------------------------------------------


def table(tmp_path: Path, text: str | bytes, suffix: str = ".csv") -> Path:
    path = tmp_path / f"table{suffix}"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


ROWS = [(0.0, 0.5, -1.25), (0.1, 0.75, -1.5), (0.2, 1.0, 2.0), (0.3, 1.5, 3.5)]


@pytest.mark.parametrize(
    ("head", "cut", "comma"),
    [
        ("time,q,tau\n", ",", False),
        ("time; q ;tau\n", ";", False),
        ("time\tq\ttau\n", "\t", False),
        ("time q tau\n", " ", False),
        ("time, q, tau\n", ", ", False),
        ("time|q|tau\n", "|", False),
        ("# time q tau\n", "   ", False),
        ("% time, q, tau\n", ",", False),
        ("time;q;tau\n", ";", True),
        ("time\tq\ttau\n", "\t", True),
        ("time q tau\n", " ", True),
        ('"time","q","tau"\n', ",", False),
        ("My rig\nrate: 10 Hz\n\ntime;q;tau\n", ";", False),
        ("a;1;2\nb;3\ntime;q;tau\ns;rad;Nm\n", ";", True),
        ("\ufefftime;q;tau\n", ";", True),
    ],
)
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_dialects(tmp_path, head, cut, comma, newline):
    text = head + "".join(
        cut.join(str(x) for x in row).replace(".", "," if comma else ".") + "\n" for row in ROWS
    )
    log = read_log(table(tmp_path, text.replace("\n", newline)))
    assert np.array_equal(np.column_stack([log.time, log.position, log.torque]), ROWS)


def test_quoted_decimal_commas(tmp_path):
    text = "time,q,tau\n" + "".join(",".join(f'"{x}"'.replace(".", ",") for x in row) + "\n" for row in ROWS)
    log = read_log(table(tmp_path, text))
    assert np.array_equal(np.column_stack([log.time, log.position, log.torque]), ROWS)


def test_a_table_without_header_asks_for_a_map(tmp_path):
    path = table(tmp_path, "".join(" ".join(map(str, row)) + "\n" for row in ROWS), ".txt")
    with pytest.raises(MappingError, match="column_1 4, column_2 4, column_3 4"):
        read_log(path)
    log = read_log(path, map="t=column_1,q=column_2,tau=-1*column_3")
    assert log.torque[:, 0].tolist() == [1.25, 1.5, -2.0, -3.5]


def test_a_drive_export_is_read_with_its_line_of_units(tmp_path):
    text = (
        "Date:;2020-07-09\r\nSubindex:;0x01;0x01\r\nPeriod:;12.800\r\n"
        ";Velocity actual value averaged;Torque actual value averaged\r\nms;rpm;%\r\n0.000;60;50.3\r\n12.800;-30;47.2\r\n"
    )
    path = table(tmp_path, text)
    log = read_log(path)
    assert log.time.tolist() == pytest.approx([0.0, 0.0128])
    assert log.velocity[:, 0].tolist() == pytest.approx([2 * np.pi, -np.pi])
    assert log.torque is None
    assert any("is in %" in note and "--map" in note for note in log.notes)
    log = read_log(path, map='tau=9.84e-5*"Torque actual value averaged"')
    assert log.torque[:, 0].tolist() == pytest.approx([9.84e-5 * 50.3, 9.84e-5 * 47.2])


def test_columns_of_a_ur_controller(tmp_path):
    names = [
        "timestamp",
        *(f"{c}_{j}" for c in ("target_q", "actual_q", "actual_qd", "actual_current") for j in range(6)),
    ]
    table_ = np.arange(3 * 25.0).reshape(3, 25)
    text = " ".join(names) + "\n" + "".join(" ".join(map(str, row)) + "\n" for row in table_)
    log = read_log(table(tmp_path, text))
    assert np.array_equal(log.position, table_[:, 7:13])
    assert np.array_equal(log.velocity, table_[:, 13:19])
    assert np.array_equal(log.reference, table_[:, 1:7])
    assert log.torque is None  # a current is no torque
    assert log.names == tuple(f"joint_{j}" for j in range(6))


def test_numbered_columns_come_in_the_order_of_their_numbers(tmp_path):
    order = [10, 2, 1, 3, 4, 5, 6, 7, 8, 9]
    text = (
        "t,"
        + ",".join(f"q{i}" for i in order)
        + "\n"
        + "0,"
        + ",".join(map(str, order))
        + "\n1,"
        + ",".join(map(str, order))
        + "\n"
    )
    log = read_log(table(tmp_path, text))
    assert log.position[0].tolist() == list(range(1, 11))
    assert log.names[-1] == "joint_10"


def test_a_place_for_every_joint(tmp_path):
    text = "__time,/js/knee/position,/js/knee/effort,/js/hip/position,/js/hip/effort\n0,1,2,3,4\n1,5,6,7,8\n"
    log = read_log(table(tmp_path, text))
    assert log.names == ("knee", "hip")
    assert log.position.tolist() == [[1, 3], [5, 7]]
    assert log.torque.tolist() == [[2, 4], [6, 8]]


def test_places_that_are_no_joints_leave_a_doubt(tmp_path):
    path = table(tmp_path, "time,raw.q,filtered.q\n0,1,2\n1,3,4\n")
    with pytest.raises(MappingError, match=r"'raw', 'filtered'.*Columns: time 2, raw\.q 2, filtered\.q 2"):
        read_log(path)
    assert read_log(path, map="q=filtered.q").position[:, 0].tolist() == [2, 4]


def test_measured_goes_before_desired(tmp_path):
    log = read_log(table(tmp_path, "time,desired.q,measured.q\n0,1,2\n1,3,4\n"))
    assert log.position[:, 0].tolist() == [2, 4]
    assert any("desired.q" in note for note in log.notes)


def test_units_in_names_are_converted_and_noted(tmp_path):
    text = "time [ms],q [deg],vel (rpm),tau [mNm],temperature [K]\n0,180,60,1500,300\n10,90,30,-1500,301\n"
    log = read_log(table(tmp_path, text))
    assert log.time.tolist() == pytest.approx([0, 0.01])
    assert log.position[:, 0].tolist() == pytest.approx([np.pi, np.pi / 2])
    assert log.velocity[:, 0].tolist() == pytest.approx([2 * np.pi, np.pi])
    assert log.torque[:, 0].tolist() == pytest.approx([1.5, -1.5])
    assert log.temperature[:, 0].tolist() == pytest.approx([26.85, 27.85])
    assert "position = 'q [deg]' [deg]" in " ".join(log.notes)
    assert not any("No unit is stated" in note for note in log.notes)


def test_lengths_make_a_linear_joint(tmp_path):
    log = read_log(table(tmp_path, "time,pos [mm],force [N]\n0,100,5\n1,200,6\n"))
    assert log.joints[0].unit == "m"
    assert log.position[:, 0].tolist() == pytest.approx([0.1, 0.2])


def test_gaps_words_and_uneven_lines_are_noted(tmp_path):
    rows = [f"{0.1 * i:.1f},{i},{i}" for i in range(30)]
    rows[4], rows[7], rows[9] = "0.4,,4", "0.7,seven,7", "0.9,9"
    rows[11] = "1.1,11,11 (was 12)"
    log = read_log(table(tmp_path, "time,q,tau\n" + "\n".join(rows) + "\n2.9,"))
    assert len(log) == 29
    assert np.isnan(log.position[[4, 7], 0]).all()
    assert log.torque[10, 0] == 11
    text = " ".join(log.notes)
    assert "2 uneven lines were dropped (line 11, 32)" in text
    assert "line 9: 'seven'" in text
    assert "line 13: '11 (was 12)'" in text


def test_columns_of_words_are_left_out_and_clocks_become_seconds(tmp_path):
    text = "time,state,q\n2026-01-02 10:00:00.5,run,1\n2026-01-02 10:00:01.0,run,2\n2026-01-02 10:00:01.5,stop,3\n"
    log = read_log(table(tmp_path, text))
    assert log.time.tolist() == [0.0, 0.5, 1.0]
    assert any("'state' holds words" in note for note in log.notes)


def test_repeated_names_are_told_apart(tmp_path):
    path = table(tmp_path, "time,q,q\n0,1,5\n1,2,6\n")
    assert [name for name, _, _ in peek(path)] == ["time", "q", "q#2"]
    assert read_log(path, map='q="q#2"').position[:, 0].tolist() == [5, 6]


def test_clocks_since_1970_leave_no_doubt_of_their_unit(tmp_path):
    log = read_log(table(tmp_path, "timestamp,q\n1700000000000,0\n1700000000005,1\n"))
    assert np.diff(log.time).tolist() == pytest.approx([0.005])
    assert any("ms since 1970" in note for note in log.notes)


def test_a_channel_of_nothing_but_zeros_was_not_measured(tmp_path):
    log = read_log(table(tmp_path, "time,q,dq,effort\n0,1,0,0\n1,2,0,0\n"))
    assert log.velocity is None
    assert log.torque is None
    assert sum("exactly zero" in note for note in log.notes) == 2


def test_uneven_tables_are_refused(tmp_path):
    rows = ["1,2,3", "1,2", "1", "1,2,3,4"] * 10
    with pytest.raises(ReadError, match="lines do not have"):
        read_log(table(tmp_path, "time,q,tau\n" + "\n".join(rows)))


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "latin-1", "utf-8-sig"])
def test_encodings(tmp_path, encoding):
    log = read_log(table(tmp_path, "time;Ärger;q [°]\n0;1;180\n1;2;90\n".encode(encoding)))
    assert log.position[:, 0].tolist() == pytest.approx([np.pi, np.pi / 2])


# --- archives, MATLAB, HDF5, Parquet, JSON ---------------------------------------------------------------------------


def test_structs_become_dotted_names(tmp_path):
    path = written(tmp_path, "mat", 2)
    names = {name: shape for name, shape, _ in peek(path)}
    assert names == {
        "rec.time": (40,),
        "rec.position": (40, 2),
        "rec.velocity": (40, 2),
        "rec.effort": (40, 2),
    }
    assert any(
        "rec.cell, rec.robot" in note or "rec.robot, rec.cell" in note for note in read_log(path).notes
    )


def test_arrays_with_time_along_the_second_axis_are_turned(tmp_path):
    log = motion()
    np.savez(tmp_path / "a.npz", t=log["time"], q=log["position"].T, tau=log["effort"].T, q0=np.zeros(2))
    read = read_log(tmp_path / "a.npz")
    assert np.array_equal(read.position, log["position"])
    assert np.array_equal(read.torque, log["effort"])


def test_matlab_seven_three_is_recognised_under_its_usual_suffix(tmp_path):
    path = written(tmp_path, "hdf5", 1)
    moved = path.with_suffix(".mat")
    path.rename(moved)
    for options in ({}, {"format": "mat"}):
        assert np.array_equal(read_log(moved, **options).position, motion()["position"])


def test_a_table_of_lerobot(tmp_path):
    import pyarrow as pa
    from pyarrow import parquet

    log = motion(20)
    columns = {
        "observation.state": pa.array(log["position"].tolist(), pa.list_(pa.float32(), 2)),
        "action": pa.array(log["velocity"].tolist(), pa.list_(pa.float32(), 2)),
        "timestamp": pa.array(log["time"], pa.float32()),
        "episode_index": pa.array([0] * 20),
        "task": pa.array(["x"] * 20),
    }
    parquet.write_table(pa.table(columns), tmp_path / "episode.parquet")
    read = read_log(tmp_path / "episode.parquet", units="deg")
    assert np.allclose(read.position, np.deg2rad(log["position"]), atol=1e-7)
    assert np.allclose(read.reference, np.deg2rad(log["velocity"]), atol=1e-7)
    assert "Converted from degrees, as asked: position, reference." in read.notes


def test_missing_cells_of_a_table_are_nan(tmp_path):
    import pyarrow as pa
    from pyarrow import parquet

    columns = {
        "time": pa.array([0, 10, 20], pa.timestamp("ms")),
        "q": pa.array([1, None, 3]),
        "ragged": pa.array([[1], [], [2]]),
    }
    parquet.write_table(pa.table(columns), tmp_path / "a.parquet")
    log = read_log(tmp_path / "a.parquet")
    assert log.time.tolist() == pytest.approx([0, 0.01, 0.02])
    assert np.isnan(log.position[1, 0])
    assert any("'ragged'" in note for note in log.notes)


def test_a_servo_log_of_bam(tmp_path):
    entries = [
        {"position": 0.0, "speed": 0.1, "load": load, "temp": 30, "timestamp": 0.005 * i, "goal_position": 0.2,
         "input_volts": 7.3, "torque_enable": i < 2}
        for i, load in enumerate((885, 65536 - 177, 0))
    ]  # fmt: skip
    content = {"mass": 0.49, "length": 0.1, "kp": 200, "vin": 7.4, "motor": "xl330", "entries": entries}
    path = tmp_path / "servo.json"
    path.write_text(json.dumps(content))
    log = read_log(path)
    assert log.drive_input[:, 0].tolist() == pytest.approx([1.0, -0.2, 0.0])
    assert log.drive.law == "duty"
    assert log.drive.gains["kp"] == 200
    assert log.drive.gains["supply"] == 7.4
    # firmware: duty = error * kp * (4096 / 2 pi) / (256 * 885)
    assert log.drive.gains["duty_per_rad"] == pytest.approx(200 * 4096 / 2 / np.pi / 256 / 885)
    assert log.names == ("xl330",)
    assert "mass 0.49, length 0.1" in " ".join(log.notes)


# --- bags ------------------------------------------------------------------------------------------------------------


def cdr(names, *arrays, stamp=(5, 0), order="<") -> bytes:
    """Serialise a joint state by hand, independently of the other library."""
    out = bytearray(b"\x00\x01\x00\x00" if order == "<" else b"\x00\x00\x00\x00")

    def align(n):
        out.extend(b"\x00" * (-(len(out) - 4) % n))

    def text(value):
        align(4)
        raw = value.encode() + b"\x00"
        out.extend(struct.pack(order + "I", len(raw)) + raw)

    out.extend(struct.pack(order + "iI", *stamp))
    text("")
    align(4)
    out.extend(struct.pack(order + "I", len(names)))
    for name in names:
        text(name)
    for array in arrays:
        align(4)
        out.extend(struct.pack(order + "I", len(array)))
        if len(array):
            align(8)
            out.extend(struct.pack(f"{order}{len(array)}d", *array))
    return bytes(out)


def mcap_of(path: Path, raws, topics=None, kind="sensor_msgs/msg/JointState") -> Path:
    from mcap.writer import Writer

    with open(path, "wb") as stream:
        writer = Writer(stream)
        writer.start("ros2", "test")
        schema = writer.register_schema(kind, "ros2msg", b"")
        channels = {
            topic: writer.register_channel(topic, "cdr", schema) for topic in dict.fromkeys(topics or ["/js"])
        }
        for i, raw in enumerate(raws):
            writer.add_message(
                channels[topics[i] if topics else "/js"], 10**9 * (i + 1), raw, 10**9 * (i + 1)
            )
        writer.finish()
    return path


def test_joints_are_matched_by_name_when_their_order_changes(tmp_path):
    raws = [
        cdr(("a", "b"), (1, 2), (3, 4), (5, 6), stamp=(0, 0)),
        cdr(("b", "a"), (20, 10), (40, 30), (60, 50), stamp=(1, 500_000_000)),
        cdr(("a", "b"), (100, 200), (300, 400), (500, 600), stamp=(2, 0)),
    ]
    log = read_log(mcap_of(tmp_path / "a.mcap", raws))
    assert log.names == ("a", "b")
    assert log.time.tolist() == [0.0, 1.5, 2.0]  # header stamps, not the time of recording
    assert log.position.tolist() == [[1, 2], [10, 20], [100, 200]]
    assert log.torque.tolist() == [[5, 6], [50, 60], [500, 600]]
    assert any("matched by name" in note for note in log.notes)
    assert read_log(tmp_path / "a.mcap", names="b").position[:, 0].tolist() == [2, 20, 200]


def test_empty_arrays_are_absent_channels(tmp_path):
    log = read_log(mcap_of(tmp_path / "a.mcap", [cdr(("a",), (i,), (), (), stamp=(i, 0)) for i in range(3)]))
    assert log.velocity is None
    assert log.torque is None
    assert log.position[:, 0].tolist() == [0, 1, 2]


def test_an_array_missing_from_some_messages_is_nan_there(tmp_path):
    raws = [
        cdr(("a",), (1,), (1,), (1,)),
        cdr(("a",), (2,), (), (2,), stamp=(6, 0)),
        cdr(("a",), (3,), (3,), (3,), stamp=(7, 0)),
    ]
    log = read_log(mcap_of(tmp_path / "a.mcap", raws))
    assert np.array_equal(log.velocity[:, 0], [1, np.nan, 3], equal_nan=True)
    assert any("1 of 3 messages have no velocity" in note for note in log.notes)


def test_ragged_arrays_are_refused(tmp_path):
    with pytest.raises(ReadError, match="2 names and 1 numbers of velocity"):
        read_log(mcap_of(tmp_path / "a.mcap", [cdr(("a", "b"), (1, 2), (3,), ())]))


@pytest.mark.parametrize("ros1", [False, True])
def test_messages_are_decoded_as_another_library_wrote_them(ros1):
    from rosbags.typesys import Stores, get_typestore

    rng = np.random.default_rng(5)
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    state, header = store.types["sensor_msgs/msg/JointState"], store.types["std_msgs/msg/Header"]
    clock = store.types["builtin_interfaces/msg/Time"]
    serialise = store.serialize_ros1 if ros1 else store.serialize_cdr
    for _ in range(60):  # names and frames of every length move the alignment of the numbers
        joints, count = int(rng.integers(1, 6)), int(rng.integers(1, 4))
        names = [f"{'n' * int(rng.integers(9))}{j}" for j in range(joints)]
        frame = "f" * int(rng.integers(9))
        expected = rng.standard_normal((3, count, joints))
        present = [True, *(rng.random(2) < 0.7)]
        raws = []
        for k in range(count):
            head = header(**({"seq": k} if ros1 else {}), stamp=clock(sec=k, nanosec=500), frame_id=frame)
            arrays = [expected[c, k] if present[c] else np.empty(0) for c in range(3)]
            message = state(header=head, name=names, position=arrays[0], velocity=arrays[1], effort=arrays[2])
            raws.append(bytes(serialise(message, "sensor_msgs/msg/JointState")))
        gatherer = Gatherer(ros1=ros1)
        gatherer.add(raws, range(count))
        columns = gatherer.columns(ReadOptions(), [])
        assert columns.joints == tuple(names)
        assert columns.arrays["time"].tolist() == list(range(count))
        for c, channel in enumerate(("position", "velocity", "effort")):
            assert (channel in columns.arrays) == present[c]
            assert not present[c] or np.array_equal(columns.arrays[channel], expected[c])


def test_messages_of_either_byte_order(tmp_path):
    raws = [cdr(("a", "b"), (1, 2), (3, 4), (5, 6), stamp=(i, 0), order=">") for i in range(3)]
    assert read_log(mcap_of(tmp_path / "a.mcap", raws)).torque.tolist() == [[5, 6]] * 3


def test_another_publisher_on_the_topic_is_left_out_and_named(tmp_path):
    arm = [cdr(("a", "b"), (i, 2), (3, 4), (5, 6), stamp=(i, 0)) for i in range(6)]
    hand = [cdr(("grip",), (i,), (1,), (1,), stamp=(i, 0)) for i in range(6)]
    path = mcap_of(tmp_path / "a.mcap", [m for pair in zip(arm, hand, strict=True) for m in pair])
    log = read_log(path)
    assert log.names == ("a", "b")
    assert len(log) == 6
    assert any("grip (6)" in note for note in log.notes)
    assert read_log(path, names=["grip"]).position[:, 0].tolist() == list(range(6))


def test_several_topics_ask_for_a_choice(tmp_path):
    raws = [cdr(("a",), (i,), (), (), stamp=(i, 0)) for i in range(4)]
    path = mcap_of(tmp_path / "a.mcap", raws, ["/left", "/right", "/left", "/left"])
    with pytest.raises(MappingError, match=r"/left \(3\), /right \(1\)"):
        read_log(path)
    assert len(read_log(path, topic="/left")) == 3
    with pytest.raises(MappingError, match="no joint states on '/up'"):
        read_log(path, topic="/up")


def test_a_bag_without_joint_states_names_its_topics(tmp_path):
    with pytest.raises(ReadError, match=r"/js \(sensor_msgs/msg/Imu"):
        read_log(mcap_of(tmp_path / "a.mcap", [b"\x00\x01\x00\x00" * 4], kind="sensor_msgs/msg/Imu"))


def test_without_stamps_the_time_of_recording_is_used_and_noted(tmp_path):
    log = read_log(mcap_of(tmp_path / "a.mcap", [cdr(("a",), (i,), (), (), stamp=(0, 0)) for i in range(3)]))
    assert log.time.tolist() == [0, 1, 2]
    assert any("no time stamp" in note for note in log.notes)


def _counted(path: Path) -> int:
    """Count messages with the format's own library, up to where it gives up."""
    from mcap.exceptions import McapError
    from mcap.records import Message
    from mcap.stream_reader import StreamReader

    count = 0
    with open(path, "rb") as stream, contextlib.suppress(McapError, struct.error):
        for record in StreamReader(stream).records:
            count += isinstance(record, Message)
    return count


@pytest.mark.parametrize("variant", range(3))
def test_a_cut_mcap_gives_every_complete_chunk(tmp_path, variant):
    path = tmp_path / "a.mcap"
    write_mcap(path, motion(400), variant)
    whole = path.read_bytes()
    for share in (0.3, 0.55, 0.8):
        path.write_bytes(whole[: int(share * len(whole))])
        expected = _counted(path)
        log = read_log(path)
        assert expected > 50
        assert len(log) == expected
        assert np.array_equal(log.position, motion(400)["position"][:expected])
        assert any(f"the {expected} joint states in the complete chunks" in note for note in log.notes)
    path.write_bytes(whole[:300])
    with pytest.raises(IncompleteFile, match="before its first complete joint state"):
        read_log(path)


def test_a_chunk_with_a_wrong_checksum_ends_the_bag(tmp_path):
    path = mcap_of(tmp_path / "a.mcap", [cdr(("a",), (i,), (), (), stamp=(i, 0)) for i in range(100)])
    write_mcap(path, motion(400), 1)
    raw = bytearray(path.read_bytes())
    raw[len(raw) // 2] ^= 0x55
    path.write_bytes(raw)
    log = read_log(path)
    assert 0 < len(log) < 400
    assert any("cut or damaged" in note for note in log.notes)


def test_a_cut_bag_of_ros_one_gives_its_complete_chunks(tmp_path, monkeypatch):
    path = tmp_path / "a.bag"
    write_bag(path, motion(40), 0)
    whole = path.read_bytes()
    path.write_bytes(whole + whole[13 + 4096 :][: len(whole) // 3])  # a second chunk, cut
    log = read_log(path)
    assert len(log) == 40
    path.write_bytes(whole[: len(whole) // 3])
    with pytest.raises(IncompleteFile, match="before its first complete joint state"):
        read_log(path)


def test_a_bag_folder_is_one_log_with_its_parts_in_order(tmp_path):
    folder = tmp_path / "bag"
    folder.mkdir()
    (folder / "metadata.yaml").write_text("rosbag2_bagfile_information: {}\n")
    for i in (10, 2, 1):
        mcap_of(
            folder / f"bag_{i}.mcap",
            [cdr(("a",), (10 * i + k,), (), (), stamp=(10 * i + k, 0)) for k in range(3)],
        )
    log = read_log(folder)
    assert log.position[:, 0].tolist() == [10, 11, 12, 20, 21, 22, 100, 101, 102]
    assert len(log.sources) == 3
    assert len(read_logs(folder)) == 1
    assert len(read_logs(tmp_path)) == 1


def test_names_of_joints_choose_and_order(tmp_path):
    path = written(tmp_path, "bag")
    assert read_log(path).names == NAMES
    log = read_log(path, names=("elbow", "shoulder"))
    assert np.array_equal(log.position, motion()["position"][:, ::-1])
    assert read_log(path, names="left,right").names == ("left", "right")
    with pytest.raises(InvalidInput, match="The file names shoulder, elbow"):
        read_log(path, names="wrist")


# --- files and folders -----------------------------------------------------------------------------------------------


def test_a_folder_is_read_in_natural_order(tmp_path):
    for name in ("10", "2", "n10", "1"):
        (tmp_path / f"{name}.csv").write_text("time,q\n0,1\n1,2\n")
    (tmp_path / "LICENSE").write_text("free")
    logs = read_logs(tmp_path)
    assert [Path(log.sources[0].path).stem for log in logs] == ["1", "2", "10", "n10"]
    with pytest.raises(ReadError, match="holds 4 logs"):
        read_log(tmp_path)
    (tmp_path / "a.json").write_text("{}")
    with pytest.raises(ReadError, match=r"several kinds: 4 \.csv, 1 \.json"):
        read_logs(tmp_path)
    assert len(read_logs([tmp_path / "1.csv", tmp_path / "2.csv"])) == 2
    assert len(read_logs(tmp_path, format="csv")) == 4


def test_what_cannot_be_opened_is_said(tmp_path):
    with pytest.raises(ReadError, match="does not exist"):
        read_log(tmp_path / "nothing.csv")
    with pytest.raises(UnknownFormat, match="holds no log"):
        read_logs(tmp_path)
    (tmp_path / "a.xyz").write_text("time,q\n0,1\n1,2\n")
    with pytest.raises(UnknownFormat, match=r"Known: npz \(\.npz\)"):
        read_log(tmp_path / "a.xyz")
    assert len(read_log(tmp_path / "a.xyz", format="csv")) == 2
    with pytest.raises(UnknownName, match="Known: npz, parquet"):
        read_log(tmp_path / "a.xyz", format="xlsx")
    (tmp_path / "a.csv.gz").write_bytes(b"\x1f\x8b\x08")
    with pytest.raises(UnknownFormat, match="Unpack it first"):
        read_log(tmp_path / "a.csv.gz")
    with pytest.raises(ReadError, match="No log was named"):
        read_logs([])


def test_content_counts_more_than_the_suffix(tmp_path):
    path = written(tmp_path, "npz").rename(tmp_path / "log.csv")
    assert len(read_log(path)) == len(motion()["time"])


def test_columns_as_the_file_has_them(tmp_path):
    columns = read_columns(written(tmp_path, "csv", 1))
    assert columns.units["position_0"] == "deg"
    assert columns.arrays["position_0"][1] == pytest.approx(np.sin(0.01), abs=1e-6)


def test_real_errors_are_of_the_package():
    assert issubclass(ReadError, Exception)
    assert not issubclass(ReadError, UnhealthyLog)
    with pytest.raises(InvalidInput, match="max_bytes"):
        Limits(max_bytes=0)


# --- real logs -------------------------------------------------------------------------------------------------------

KUKA = (
    "t=rec.time_cont,q=deg*rec.act_pos_mot_deg,dq=deg*rec.act_vel_mot_deg_per_s,tau=rec.act_torque_abs_nm,"
    "q2=deg*rec.act_pos_se_deg,tau_model=tau_g_all+tau_a_all+tau_c_all"
)


@needs_data
@pytest.mark.parametrize(
    ("name", "options", "n", "joints", "period"),
    [
        ("emps/DATA_EMPS.mat", {"map": "t=t,q=qm,tau=gtau*vir,qr=qg,u=vir", "units": "m"}, 24841, 1, 1e-3),
        ("ur3/id1.mat", {}, 5200, 6, 8e-3),
        ("ur3/prbs.mat", {}, 7499, 6, 8e-3),
        ("ur3/arm_1.bag", {}, 1872, 6, 8e-3),
        ("kuka_kr300/FF_A_0.8ms.mat", {"map": KUKA}, 2501, 6, 4e-3),
    ],
)
def test_real_logs(name, options, n, joints, period):
    log = read_log(Path(DATA, name), **options)
    assert log.torque.shape == (n, joints)
    assert log.period == pytest.approx(period, rel=0.01)
    assert np.isfinite(log.position).all()


@needs_data
def test_a_real_bag_is_what_another_reader_says_it_is():
    from rosbags.highlevel import AnyReader

    path = Path(DATA, "ur3/arm_2.bag")
    log = read_log(path)
    with AnyReader([path]) as bag:
        states = [
            bag.deserialize(raw, c.msgtype)
            for c, _, raw in bag.messages([c for c in bag.connections if c.topic == "/arm"])
        ]
    stamps = np.array([s.header.stamp.sec * 10**9 + s.header.stamp.nanosec for s in states])
    assert np.array_equal(log.time, (stamps - stamps[0]) / 1e9)
    assert np.array_equal(log.position, [s.position for s in states])
    assert np.array_equal(log.velocity, [s.velocity for s in states])
    assert np.array_equal(log.torque, [s.effort for s in states])
    assert log.names == tuple(states[0].name)


@needs_data
def test_folders_of_real_runs():
    drives = [Path(DATA, f"screw_drives/driveNo{i}/steady_state/0.096kg") for i in (1, 2, 3)]
    logs = read_logs(drives, map='tau=9.84e-5*"Torque actual value averaged"')
    assert len(logs) == 108
    assert {len(log) for log in logs} == {500}
    for log in logs:  # the file's name is the speed that was commanded, in rpm, n for the other direction
        speed = float(Path(log.sources[0].path).stem.replace("n", "-"))
        assert abs(np.median(log.velocity)) * 30 / np.pi == pytest.approx(abs(speed), rel=0.02, abs=1.1)
    edited = [log for log in logs if any("was " in note for note in log.notes)]
    assert len(edited) == 3
    servos = read_logs(Path(DATA, "bam_xl330/raw"))
    assert len(servos) == 16
    for log in servos:  # the firmware's law, duty = clip(gain * error), where the drive is on
        duty = np.clip(log.drive.gains["duty_per_rad"] * (log.reference - log.position), -1, 1)
        on = log.drive_input != 0
        assert np.median(np.abs(duty - log.drive_input)[on]) < 0.03


def test_a_word_in_the_first_row_is_no_header(tmp_path):
    path = tmp_path / "log.csv"
    rows = [f"{0.001 * k:.3f},{0.1 * k:.3f},{'OFF' if k % 50 == 0 else 0.5}" for k in range(200)]
    path.write_text("\n".join(["t,q,tau", *rows]) + "\n")
    log = read_log(path)
    assert len(log.time) == 200 and np.isnan(log.torque[0, 0]) and log.torque[1, 0] == 0.5
