"""Joint states byte by byte from their definitions: what a message holds, and ROS 1 bags and SQLite files around it."""

import bz2
import sqlite3
import struct
import sys

import numpy as np
import pytest

from _joint_states import STATE, state
from backdrive.errors import (
    FileTooLarge,
    ForbiddenContent,
    IncompleteFile,
    MappingError,
    ReadError,
    UnknownFormat,
)
from backdrive.logs.readers import bag, db3
from backdrive.logs.readers._jointstate import Gatherer
from backdrive.logs.readers.columns import ReadOptions
from backdrive.logs.readers.limits import Limits

OPTIONS = ReadOptions()
TRIPLES = ("position", "velocity", "effort")


def gathered(messages, received=None, ros1=False, **options):
    gatherer, notes = Gatherer(ros1=ros1), []
    gatherer.add(messages, [10**9 * k for k in range(len(messages))] if received is None else received)
    assert gatherer.count == len(messages)
    return gatherer.columns(ReadOptions(**options), notes)


# ------------------------------------------------------------------------------------------ messages

KINDS = [{"order": "<"}, {"order": ">"}, {"ros1": True}]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("alike", [True, False])
@pytest.mark.parametrize("frame", ["", "a", "abc", "abcd"])
def test_everything_that_messages_hold(kind, alike, frame):
    names = ("a", "bcd", "ef")
    stamps = [(5, 250_000_000), (7, 999_999_999), (6, 1)]
    numbers = np.arange(27.0).reshape(3, 3, 3) + 0.5  # message, channel, joint
    raws = [
        state(names, *numbers[k], stamp=stamps[k], frame=frame if alike else frame + "x" * k, **kind)
        for k in range(3)
    ]
    got = gathered(raws, ros1="ros1" in kind)
    assert got.arrays["time"].tolist() == [0.0, (2 * 10**9 + 749_999_999) / 1e9, 750_000_001 / 1e9]
    for i, channel in enumerate(TRIPLES):
        assert got.arrays[channel].tolist() == numbers[:, i].tolist()
    assert (got.joints, got.units) == (names, {"time": "s"})
    assert got.channels == {
        "time": "time",
        "position": "position",
        "velocity": "velocity",
        "effort": "torque",
    }
    assert got.notes == ("Time is counted from 5.250 s since 1970 (header stamps).",)


@pytest.mark.parametrize("alike", [True, False])
def test_stamps_are_signed_in_cdr_and_unsigned_in_ros_1(alike):
    for kind, first, seconds in (({}, -3, 3.5), ({"ros1": True}, 2**31 + 2, 1.5)):
        other = (first + int(seconds), 500_000_000)
        raws = [
            state("a", [1.0], stamp=(first, 0), **kind),
            state("a", [2.0], stamp=other, frame="" if alike else "x", **kind),
        ]
        got = gathered(raws, ros1=bool(kind))
        assert got.arrays["time"].tolist() == [0.0, seconds]
        assert got.notes == (f"Time is counted from {first:.3f} s since 1970 (header stamps).",)


@pytest.mark.parametrize("kind", [{}, {"ros1": True}])
def test_messages_of_one_driver_are_laid_out_once(kind):
    raws = [state("ab", [k, 2], [3, 4], [5, 6], stamp=(k, k), seq=k, **kind) for k in range(400)]
    calls = 0

    def count(frame, event, argument):
        nonlocal calls
        calls += event == "call" and frame.f_code.co_name != "<genexpr>"

    before = sys.getprofile()
    gatherer = Gatherer(ros1=bool(kind))
    sys.setprofile(count)
    try:
        gatherer.add(raws, range(400))
    finally:
        sys.setprofile(before)
    assert calls < 200  # of Python, for 400 messages
    assert gatherer.columns(OPTIONS, []).arrays["position"][:, 0].tolist() == list(range(400))


def test_without_stamps_the_time_of_recording_counts_to_the_nanosecond():
    for frames in (["", "", ""], ["", "x", "xy"]):
        raws = [state("a", [1.0], stamp=(0, 0), frame=frame) for frame in frames]
        got = gathered(raws, [17, 10**9 + 17, 3 * 10**9 + 22])
        assert got.arrays["time"].tolist() == [0.0, 1.0, 3.000000005]
        assert got.notes == (
            "The messages carry no time stamp: the time of recording was used, which jitters.",
            "Time is counted from 0.000 s since 1970 (header stamps).",
        )
    raws = [state("a", [1.0], stamp=(0, 0)), state("a", [1.0], stamp=(0, 7))]  # one stamp is enough
    assert gathered(raws, [5, 5]).arrays["time"].tolist() == [0.0, 7e-9]


@pytest.mark.parametrize("present", [(1, 0, 0), (0, 1, 0), (1, 0, 1), (0, 1, 1), (1, 1, 0)])
def test_arrays_that_no_message_has_are_no_channels(present):
    numbers = np.arange(12.0).reshape(2, 3, 2)
    raws = [
        state("ab", *(numbers[k, i] if present[i] else () for i in range(3)), stamp=(k + 1, 0))
        for k in range(2)
    ]
    for messages in (raws, [raws[0], raws[1] + b"\0" * 8]):  # alike, and read one by one
        got = gathered(messages)
        assert set(got.arrays) == {"time", *(c for c, there in zip(TRIPLES, present, strict=True) if there)}
        assert set(got.channels) == set(got.arrays)
        for i, channel in enumerate(TRIPLES):
            assert not present[i] or got.arrays[channel].tolist() == numbers[:, i].tolist()


def test_arrays_that_some_messages_lack_are_nan_there():
    raws = [
        state("ab", [1, 2], [3, 4], [5, 6], stamp=(1, 0)),
        state("ab", [7, 8], (), (), stamp=(2, 0)),
        state("ba", [9, 10], (), [11, 12], stamp=(3, 0)),
        state("ab", (), [13, 14], (), stamp=(4, 0)),
    ]
    got = gathered(raws)
    nan = [np.nan, np.nan]
    for channel, wanted in (
        ("position", [[1, 2], [7, 8], [10, 9], nan]),
        ("velocity", [[3, 4], nan, nan, [13, 14]]),
        ("effort", [[5, 6], nan, [12, 11], nan]),
    ):
        assert np.array_equal(got.arrays[channel], wanted, equal_nan=True), channel
    assert got.notes[:4] == (
        "The order of the joints changes from message to message: they were matched by name.",
        "1 of 4 messages have no position: NaN there.",
        "2 of 4 messages have no velocity: NaN there.",
        "2 of 4 messages have no effort: NaN there.",
    )
    assert not any("order of the joints" in note for note in gathered(raws[:2]).notes)
    none = Gatherer(ros1=False)
    none.add([], [])
    assert none.count == 0


def test_messages_that_cannot_be():
    good = state("ab", [1, 2], [3, 4], [5, 6])
    for wrong, said in (
        (good[:-1], "cut numbers"),
        (good[:30], "no joint state"),
        (good[:3], "encapsulation 0001"),
        (b"", "encapsulation"),
        (b"\0\2" + good[2:], "encapsulation 0002"),
        (b"\1\1" + good[2:], "encapsulation 0101"),
        (state("ab", [1, 2], [3], ()), "2 names and 1 numbers of velocity"),
        (state("ab", [1], (), ()), "2 names and 1 numbers of position"),
        (state("ab", [1, 2], (), [1, 2, 3]), "2 names and 3 numbers of effort"),
        (state("aa", [1, 2]), "names a joint twice: a, a"),
        (state("ab", (), (), [1, 2]), "neither position nor velocity"),
        (state("", (), (), ()), "name no joints"),
    ):
        with pytest.raises(ReadError, match=said):
            gathered([wrong])
    for at in (
        12,
        16 + 4,
        20 + 4,
    ):  # a length of 4 billion in place of a frame, of the number of names, of a name
        with pytest.raises(ReadError, match="no joint state"):
            gathered([good[:at] + b"\xff\xff\xff\x7f" + good[at + 4 :]])
    largest = state("a", [1.0], frame="x" * 1_048_000).ljust(1 << 20, b"\0")
    assert gathered([largest]).arrays["position"].tolist() == [[1.0]]
    with pytest.raises(ReadError, match=f"has {(1 << 20) + 1} bytes, too many"):
        gathered([largest + b"\0"])


def test_the_publisher_with_the_most_numbers_is_taken_or_the_one_that_has_the_joints_asked_for():
    arm = [state("ab", [k, k], stamp=(k + 1, 0)) for k in range(3)]
    hand = [state("g", [10 * k], stamp=(k + 1, 0)) for k in range(7)]
    nobody = [state("", stamp=(1, 0))] * 2
    got = gathered([*arm, *hand, *nobody])  # 7 numbers against 6
    assert got.joints == ("g",) and got.arrays["position"][:, 0].tolist() == [10 * k for k in range(7)]
    assert (
        "Other messages of this topic name other joints and were left out: a, b (3); none (2)." in got.notes
    )
    got = gathered([*nobody, *hand[:5], *arm])  # 5 against 6
    assert got.joints == ("a", "b") and got.arrays["time"].size == 3
    assert "Other messages of this topic name other joints and were left out: none (2); g (5)." in got.notes
    for wanted, found in (
        (("a",), ("a", "b")),
        (("b", "a"), ("a", "b")),
        (("g",), ("g",)),
        (("a", "g"), ("g",)),
        (("z",), ("g",)),
    ):
        assert gathered([*arm, *hand], joints=wanted).joints == found
    assert not any("Other messages" in note for note in gathered(arm).notes)
    long = gathered([*(state(["x" * 299, "y" * 299], [1, 2]) for _ in range(2)), state(["z"], [1])])
    assert long.joints == ("x" * 299, "y" * 299) and "left out: z (1)." in long.notes[0]
    long = gathered([*hand, state(["x" * 299, "y" * 299], [1, 2])])
    assert f"left out: {'x' * 299}, {'y' * 199}." in long.notes[0]  # 500 characters


# ----------------------------------------------------------------------------------------- ROS 1 bags


def fields(**values):
    return b"".join(struct.pack("<I", len(k) + 1 + len(v)) + k.encode() + b"=" + v for k, v in values.items())


def entry(data=b"", **values):
    head = fields(**values)
    return struct.pack("<I", len(head)) + head + struct.pack("<I", len(data)) + data


def connection(number=1, topic=b"/js", kind=b"sensor_msgs/JointState"):
    return entry(fields(topic=topic, type=kind), op=b"\7", conn=struct.pack("<I", number), topic=topic)


def spoken(count, first=0, number=1, stamp=None):
    """Messages, recorded a second and 250 ms apart."""
    return b"".join(
        entry(
            state("a", [first + k], stamp=stamp or (first + k + 1, 0), ros1=True, seq=k), op=b"\2",
            conn=struct.pack("<I", number), time=struct.pack("<II", 8 + first + k, 250_000_000 * k),
        )
        for k in range(count)
    )  # fmt: skip


def packed(*records, how=b"none", size=None):
    content = b"".join(records)
    data = bz2.compress(content) if how == b"bz2" else content
    return entry(
        data, op=b"\5", compression=how, size=struct.pack("<I", len(content) if size is None else size)
    )


INDEX, INFO = entry(b"12345", op=b"\4"), entry(b"123", op=b"\6")


def ros(path, *parts, index=True, head=None):
    head = entry(b" " * 20, op=b"\3") if head is None else head
    path.write_bytes(
        bag.MAGIC
        + head
        + b"".join(parts)
        + (connection() + b"what follows does not matter" if index else b"")
    )
    return str(path)


def test_records_of_a_ros_1_bag(tmp_path):
    path = tmp_path / "a.bag"
    parts = [
        packed(connection(), spoken(2)),
        INDEX,
        INDEX,
        packed(spoken(2, 2), how=b"bz2"),
        INFO,
        packed(spoken(1, 4)),
    ]
    got = bag.read(ros(path, *parts), OPTIONS)
    assert got.arrays["position"][:, 0].tolist() == [0, 1, 2, 3, 4] and len(got.notes) == 1
    got = bag.read(
        ros(path, packed(connection(), spoken(3, stamp=(0, 0)))), OPTIONS
    )  # no stamp: time of recording
    assert got.arrays["time"].tolist() == [0.0, 1.25, 2.5]
    mixed = packed(
        connection(),
        connection(2, b"/imu", b"sensor_msgs/Imu"),
        spoken(2),
        spoken(9, number=2),
        entry(op=b"\4"),
    )
    assert bag.read(ros(path, mixed), OPTIONS).arrays["position"][:, 0].tolist() == [0, 1]
    with pytest.raises(ReadError, match=r"Topics: /imu \(sensor_msgs/Imu\)"):
        bag.read(ros(path, packed(connection(2, b"/imu", b"sensor_msgs/Imu"))), OPTIONS)
    two = packed(connection(), connection(2, b"/up"), spoken(2), spoken(3, 7, number=2))
    with pytest.raises(MappingError, match=r"/js \(2\), /up \(3\)"):
        bag.read(ros(path, two), OPTIONS)
    assert bag.read(ros(path, two), ReadOptions(topic="/up")).arrays["position"][:, 0].tolist() == [7, 8, 9]
    same = packed(
        connection(), connection(2), spoken(2), spoken(3, 2, number=2)
    )  # two publishers of one topic
    assert bag.read(ros(path, same), OPTIONS).arrays["time"].size == 5
    few = ReadOptions(limits=Limits(max_columns=2))
    assert (
        bag.read(ros(path, packed(connection(), connection(2, b"/x", b"y"), spoken(1))), few)
        .arrays["time"]
        .size
        == 1
    )
    for kind in (b"y", b"sensor_msgs/JointState"):
        three = packed(connection(), connection(2, b"/x", b"y"), connection(3, b"/z", kind), spoken(1))
        with pytest.raises(FileTooLarge, match="3 topics"):
            bag.read(ros(path, three), few)


def test_what_a_ros_1_bag_is_refused_for(tmp_path):
    path = tmp_path / "a.bag"
    secret = entry(b"", op=b"\3", encryptor=b"rosbag/AesCbcEncryptor")
    with pytest.raises(ForbiddenContent, match="encrypted"):
        bag.read(ros(path, packed(connection(), spoken(1)), head=secret), OPTIONS)
    open_ = entry(b"", op=b"\3", encryptor=b"")
    assert bag.read(ros(path, packed(connection(), spoken(1)), head=open_), OPTIONS).arrays["time"].size == 1
    path.write_bytes(b"#ROSBAG V1.2\n" + b"\0" * 50)
    with pytest.raises(UnknownFormat, match="format 2.0"):
        bag.read(str(path), OPTIONS)


def test_where_and_why_a_ros_1_bag_ends_early(tmp_path):
    path, first, more = tmp_path / "a.bag", packed(connection(), spoken(2)), packed(spoken(1, 2))
    at = len(bag.MAGIC) + len(entry(b" " * 20, op=b"\3")) + len(first)
    zero = fields(op=b"\5") + struct.pack("<I", 0)
    left = fields(op=b"\5") + struct.pack("<I", 4)
    for odd, why in (
        (entry(b"xx", op=b"\1"), "an unknown record"),
        (entry(b"xx", no=b"\5"), "an unknown record"),
        (struct.pack("<I", 10**6) + b"x" * 40, "an incomplete record"),
        (struct.pack("<I", 0) + struct.pack("<I", 10**6), "an incomplete record"),
        (
            struct.pack("<I", len(zero)) + zero + struct.pack("<I", 0),
            "a header field reaches beyond its record",
        ),
        (
            struct.pack("<I", len(left)) + left + struct.pack("<I", 0),
            "a header field reaches beyond its record",
        ),
        (entry(b"xx", op=b"\5", compression=b"none"), "b'size'"),
        (entry(b"xx", op=b"\5", size=b"\2\0\0\0"), "b'compression'"),
        (
            entry(b"xx", op=b"\5", compression=b"zip", size=b"\2\0\0\0"),
            "a chunk is compressed with 'zip', which is not known",
        ),
        (packed(b"\xff\0\0\0" + b"x" * 20), "a record reaches beyond its chunk"),
        (packed(b"\0\0\0\0" + b"\1\0\0\0"), "a record reaches beyond its chunk"),
        (packed(spoken(1, 2), size=5), None),
    ):
        got = bag.read(ros(path, first, odd, more), OPTIONS)
        if why is None:
            why = f"a chunk of {len(spoken(1, 2))} bytes declares 5"
        assert got.arrays["position"][:, 0].tolist() == [0, 1]
        assert got.notes[0].startswith(
            f"The file is cut or damaged at byte {at} of {path.stat().st_size} ({why}): the 2 joint"
        ), why
    for cut in (1, 5, len(more) - 1):
        got = bag.read(ros(path, first, more[:-cut], index=False), OPTIONS)
        assert got.arrays["time"].size == 2 and f"damaged at byte {at} of" in got.notes[0]
    whole = bag.read(ros(path, first, more, index=False), OPTIONS)
    assert (
        whole.arrays["time"].size == 3
        and f"at byte {at + len(more)} of {at + len(more)} (no index)" in whole.notes[0]
    )
    got = bag.read(ros(path, first, entry(b"xx", op=b"\4") + struct.pack("<I", 0), index=False), OPTIONS)
    assert got.arrays["time"].size == 2 and "an incomplete record" in got.notes[0]
    with pytest.raises(IncompleteFile, match=rf"byte {at - len(first)} of \d+, before its first"):
        bag.read(ros(path, first[:-1], index=False), OPTIONS)


# -------------------------------------------------------------------------------------------- SQLite


def base_of(
    path, topics, messages, made="CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id, timestamp, data)"
):
    path.unlink(missing_ok=True)
    base = sqlite3.connect(path)
    base.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name, type, serialization_format)")
    base.execute(made)
    base.executemany("INSERT INTO topics VALUES(?, ?, ?, ?)", topics)
    base.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)", messages)
    base.commit()
    base.close()
    return str(path)


JOINTS = (1, "/js", STATE, "cdr")


def rows(count, first=0, topic=1):
    return [
        (topic, 10**9 * (first + k), state("a", [first + k], stamp=(first + k + 1, 0))) for k in range(count)
    ]


def test_joint_states_of_a_database(tmp_path):
    path, other = tmp_path / "a.db3", tmp_path / "b.db3"
    one = base_of(
        path, [JOINTS, (2, "/imu", "sensor_msgs/msg/Imu", "cdr")], [*rows(3)[::-1], *rows(2, topic=2)]
    )
    assert db3.read(one, OPTIONS).arrays["position"][:, 0].tolist() == [
        0,
        1,
        2,
    ]  # in the order of their times
    two = base_of(other, [JOINTS], rows(2, 3))
    got = db3.read(one, ReadOptions(parts=(two,)))
    assert got.arrays["position"][:, 0].tolist() == [0, 1, 2, 3, 4] and len(got.notes) == 1
    unstamped = [(1, 10**9 * k + 5, state("a", [k], stamp=(0, 0))) for k in range(3)]
    assert db3.read(base_of(path, [JOINTS], unstamped), OPTIONS).arrays["time"].tolist() == [0.0, 1.0, 2.0]
    for wrong in ((1, "/js", STATE, "json"), (1, "/js", "sensor_msgs/msg/Imu", "cdr")):
        with pytest.raises(ReadError, match=rf"Topics: /js \({wrong[2]}\)"):
            db3.read(base_of(path, [wrong], rows(2)), OPTIONS)
    many = base_of(path, [JOINTS], rows(4100))  # more than are fetched at once
    assert db3.read(many, OPTIONS).arrays["position"][:, 0].tolist() == list(range(4100))


def test_databases_that_are_refused(tmp_path):
    path = tmp_path / "a.db3"
    for raw, said in (
        (None, "not bytes"),
        ("text", "not bytes"),
        (b"\x28\xb5\x2f\xfd" + b"x" * 9, "one by one"),
    ):
        with pytest.raises(ReadError, match=said):
            db3.read(base_of(path, [JOINTS], [(1, 1, raw)]), OPTIONS)
    with pytest.raises(ReadError, match="not bytes"):
        db3.read(base_of(path, [JOINTS], [*rows(1), (1, 10**10, "text")]), OPTIONS)
    for table in ("topics", "messages"):
        path.unlink(missing_ok=True)
        base = sqlite3.connect(path)
        base.execute(f"CREATE TABLE {table}(id)")
        base.commit()
        base.close()
        with pytest.raises(ReadError, match="not a ROS 2 bag"):
            db3.read(str(path), OPTIONS)
    path.write_bytes(b"SQLite format 3\0" + b"\xff" * 2000)
    with pytest.raises(IncompleteFile, match="The database is damaged"):
        db3.read(str(path), OPTIONS)
    good = base_of(tmp_path / "b.db3", [JOINTS], rows(3))
    got = db3.read(good, ReadOptions(parts=(str(path), good)))
    assert got.arrays["time"].size == 3 and "the 3 joint states before that were read" in got.notes[0]


def test_a_database_is_asked_for_nothing_but_its_rows(tmp_path, monkeypatch):
    asked, connect = [], sqlite3.connect

    class Watched(sqlite3.Connection):
        def execute(self, sql, *more):
            asked.append(sql)
            if "sqlite_master" in sql:  # set before anything is read
                settings = [
                    sqlite3.Connection.execute(self, f"PRAGMA {name}").fetchone()
                    for name in ("trusted_schema", "cell_size_check")
                ]
                assert settings == [(0,), (1,)]
            if sql.startswith(("SELECT id", "SELECT timestamp")):
                assert self.getlimit(sqlite3.SQLITE_LIMIT_LENGTH) == 1 << 27
                for deed in (
                    "PRAGMA user_version",
                    "ATTACH ':memory:' AS x",
                    "SELECT abs(1)",
                    "DELETE FROM topics",
                ):
                    with pytest.raises(sqlite3.DatabaseError):
                        sqlite3.Connection.execute(self, deed)
            return sqlite3.Connection.execute(self, sql, *more)

    path = base_of(tmp_path / "a.db3", [JOINTS], rows(2))
    monkeypatch.setattr(sqlite3, "connect", lambda *args, **more: connect(*args, factory=Watched, **more))
    assert db3.read(path, OPTIONS).arrays["time"].size == 2
    assert sum(sql.startswith("SELECT timestamp") for sql in asked) == 1
