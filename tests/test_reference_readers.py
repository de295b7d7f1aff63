"""Readers against files built byte by byte from the format's specification, and tables of units against their definitions."""

import dataclasses
import io
import math
import struct
import zlib
from dataclasses import replace

import msgspec
import numpy as np
import pytest

from backdrive import load_model
from backdrive.errors import FileTooLarge, InvalidInput, ModelFileError, ReadError, UnknownFormat
from backdrive.laws import CoulombViscous, Decaying, Law, MaxwellSlip, StribeckGauss
from backdrive.logs.log import Joint, Source
from backdrive.logs.readers import _dialect, bag, columns, csv_, mcap, units
from backdrive.logs.readers._chunks import ChunkDamage, expand
from backdrive.logs.readers.columns import Columns, ReadOptions, frames, header, plain, unframe
from backdrive.logs.readers.limits import GIB, MIB, Limits
from backdrive.model import ArmModel, Estimate, FrictionModel, JointFriction, Quality, Validity
from backdrive.model.file import decode, encode

# ------------------------------------------------------------------------------------------------ MCAP


def text(word):
    raw = word.encode()
    return struct.pack("<I", len(raw)) + raw


def record(kind, content):
    return struct.pack("<BQ", kind, len(content)) + content


def joint_state(position, seconds):
    """One JointState of joint `a`, plain CDR, little endian: stamp, frame, names, three arrays on 8-byte bounds."""
    body = struct.pack("<iI", seconds, 0) + struct.pack("<I", 1) + b"\0" + b"\0" * 3
    body += struct.pack("<I", 1) + struct.pack("<I", 2) + b"a\0" + b"\0" * 2
    body += struct.pack("<I", 1)
    body += b"\0" * (-len(body) % 8) + struct.pack("<d", position)
    body += struct.pack("<II", 0, 0)
    return b"\x00\x01\x00\x00" + body


def message(position, seconds, channel=1):
    return record(
        5, struct.pack("<HIQQ", channel, 0, seconds * 10**9, seconds * 10**9) + joint_state(position, seconds)
    )


DECLARED = record(
    3, struct.pack("<H", 7) + text("sensor_msgs/msg/JointState") + text("ros2msg") + text("")
) + record(4, struct.pack("<HH", 1, 7) + text("/js") + text("cdr") + struct.pack("<I", 0))


def chunk(content, checksum=None, size=None):
    """Chunk record: times, uncompressed size and CRC-32, compression, records (mcap.dev/spec, op 0x06)."""
    crc = zlib.crc32(content) if checksum is None else checksum
    size = len(content) if size is None else size
    return record(
        6, struct.pack("<QQQI", 0, 0, size, crc) + text("") + struct.pack("<Q", len(content)) + content
    )


def bag_of(path, *chunks, end=True):
    path.write_bytes(b"\x89MCAP0\r\n" + b"".join(chunks) + (record(15, struct.pack("<I", 0)) if end else b""))
    return str(path)


def positions(path, **limits):
    read = mcap.read(path, ReadOptions(limits=Limits(**limits)))
    return read.arrays["position"][:, 0].tolist(), read


def test_a_chunk_is_believed_by_its_crc_32(tmp_path):
    one, two, three = (DECLARED + message(1.5, 1), message(2.5, 2), message(3.5, 3))
    found, read = positions(bag_of(tmp_path / "a.mcap", chunk(one), chunk(two), chunk(three)))
    assert found == [1.5, 2.5, 3.5]
    assert read.arrays["time"].tolist() == [0.0, 1.0, 2.0]
    assert not any("damaged" in note for note in read.notes)
    for wrong in (zlib.crc32(two) ^ 1, zlib.crc32(one), zlib.adler32(two), 1):
        found, read = positions(bag_of(tmp_path / "b.mcap", chunk(one), chunk(two, wrong), chunk(three)))
        assert found == [1.5]
        assert any("a wrong checksum" in note for note in read.notes)
    flipped = bytearray(two)
    flipped[-12] ^= 4  # one bit of a number: the records are as well-formed as before
    found, _ = positions(bag_of(tmp_path / "c.mcap", chunk(one), chunk(bytes(flipped), zlib.crc32(two))))
    assert found == [1.5]
    found, _ = positions(bag_of(tmp_path / "d.mcap", chunk(one, 0), chunk(two, 0)))
    assert found == [1.5, 2.5]  # 0: no checksum was made


def test_what_all_chunks_hold_together_is_limited(tmp_path):
    parts = [DECLARED + message(0.5, 1), message(1.5, 2), message(2.5, 3), message(3.5, 4)]
    total = sum(len(p) for p in parts)
    path = bag_of(tmp_path / "a.mcap", *(chunk(p) for p in parts))
    assert positions(path, max_bytes=total)[0] == [0.5, 1.5, 2.5, 3.5]
    with pytest.raises(FileTooLarge, match="The chunks hold more"):
        positions(path, max_bytes=total - 1)
    lies = bag_of(tmp_path / "b.mcap", *(chunk(p, size=10**6) for p in parts))
    with pytest.raises(FileTooLarge, match="The chunks hold more"):
        positions(lies, max_bytes=4 * 10**6 - 1)


def test_a_time_of_recording_beyond_all_clocks_is_cut_and_arrays_of_messages_may_change_places(tmp_path):
    far = record(5, struct.pack("<HIQQ", 1, 0, 2**64 - 1, 0) + joint_state(4.0, 1))
    assert positions(bag_of(tmp_path / "a.mcap", chunk(DECLARED + far + message(5.0, 2))))[0] == [4.0, 5.0]

    def state(first, second, seconds):  # the same length, with the number in one array or in the other
        body = (
            struct.pack("<iI", seconds, 0)
            + struct.pack("<I", 1)
            + b"\0" * 4
            + struct.pack("<I", 1)
            + struct.pack("<I", 2)
            + b"a\0\0\0"
        )
        for value in (first, second):
            body += struct.pack("<I", value is not None)
            if value is not None:
                body += b"\0" * (-len(body) % 8) + struct.pack("<d", value)
        return b"\x00\x01\x00\x00" + body + struct.pack("<I", 0)

    both = [state(1.5, None, 1), state(None, 2.5, 2)]
    raws = b"".join(
        record(5, struct.pack("<HIQQ", 1, 0, k, k) + raw.ljust(max(map(len, both)), b"\0"))
        for k, raw in enumerate(both)
    )
    read = positions(bag_of(tmp_path / "b.mcap", chunk(DECLARED + raws)))[1]
    assert np.array_equal(read.arrays["position"][:, 0], [1.5, np.nan], equal_nan=True)
    assert np.array_equal(read.arrays["velocity"][:, 0], [np.nan, 2.5], equal_nan=True)


def test_records_outside_chunks_and_a_file_that_ends_early(tmp_path):
    loose = bag_of(tmp_path / "a.mcap", DECLARED, message(1.0, 1), chunk(message(2.0, 2)), message(3.0, 3))
    assert positions(loose)[0] == [1.0, 2.0, 3.0]
    cut = bag_of(
        tmp_path / "b.mcap", chunk(DECLARED + message(1.0, 1)), chunk(message(2.0, 2))[:-9], end=False
    )
    found, read = positions(cut)
    assert found == [1.0] and any("an incomplete record" in note for note in read.notes)
    whole = (tmp_path / "b.mcap").read_bytes()
    place = len(b"\x89MCAP0\r\n") + len(chunk(DECLARED + message(1.0, 1)))
    assert any(f"at byte {place} of {len(whole)}" in note for note in read.notes)
    open_end, read = positions(bag_of(tmp_path / "c.mcap", chunk(DECLARED + message(1.0, 1)), end=False))
    assert open_end == [1.0] and any("no end of data" in note for note in read.notes)
    short = chunk(message(2.0, 2))
    short = short[:9] + short[9:].replace(
        struct.pack("<Q", len(message(2.0, 2))), struct.pack("<Q", len(message(2.0, 2)) + 1)
    )
    found, read = positions(bag_of(tmp_path / "d.mcap", chunk(DECLARED + message(1.0, 1)), short))
    assert found == [1.0] and any("shorter than it declares" in note for note in read.notes)
    beyond = DECLARED + message(1.0, 1) + struct.pack("<BQ", 5, 400) + b"\0" * 30
    found, read = positions(bag_of(tmp_path / "e.mcap", chunk(DECLARED + message(0.0, 1)), chunk(beyond)))
    assert found == [0.0] and any("reaches beyond its chunk" in note for note in read.notes)
    path = tmp_path / "f.mcap"
    path.write_bytes(b"\x89MCAP1\r\n" + DECLARED)
    with pytest.raises(UnknownFormat):
        mcap.read(str(path), ReadOptions())
    for kind in (0, 16, 127):
        odd = bag_of(
            tmp_path / "g.mcap", chunk(DECLARED + message(1.0, 1)), record(kind, b"x"), chunk(message(2.0, 2))
        )
        assert positions(odd)[0] == [1.0]
    own = bag_of(
        tmp_path / "h.mcap", chunk(DECLARED + message(1.0, 1)), record(128, b"x"), chunk(message(2.0, 2))
    )
    assert positions(own)[0] == [1.0, 2.0]  # 0x80 and beyond belong to applications


# ----------------------------------------------------------------------------------------- ROS 1 bags


def ros_record(data, **fields):
    head = b"".join(
        struct.pack("<I", len(name) + 1 + len(value)) + name.encode() + b"=" + value
        for name, value in fields.items()
    )
    return struct.pack("<I", len(head)) + head + struct.pack("<I", len(data)) + data


def ros_state(position, seconds):
    body = struct.pack("<III", 0, seconds, 500_000_000) + struct.pack("<I", 0)
    body += struct.pack("<I", 1) + struct.pack("<I", 1) + b"a"
    return body + struct.pack("<I", 1) + struct.pack("<d", position) + struct.pack("<II", 0, 0)


def ros_field(**fields):
    return b"".join(struct.pack("<I", len(k) + 1 + len(v)) + k.encode() + b"=" + v for k, v in fields.items())


def ros_chunk(*records, size=None):
    content = b"".join(records)
    declared = struct.pack("<I", len(content) if size is None else size)
    return ros_record(content, op=b"\x05", compression=b"none", size=declared)


CONNECTION = ros_record(
    ros_field(topic=b"/js", type=b"sensor_msgs/JointState"),
    op=b"\x07",
    conn=struct.pack("<I", 3),
    topic=b"/js",
)


def ros_message(position, seconds):
    return ros_record(
        ros_state(position, seconds),
        op=b"\x02",
        conn=struct.pack("<I", 3),
        time=struct.pack("<II", seconds, 0),
    )


def ros_bag(path, *parts, index=True):
    path.write_bytes(
        b"#ROSBAG V2.0\n"
        + ros_record(b" " * 20, op=b"\x03")
        + b"".join(parts)
        + (CONNECTION if index else b"")
    )
    return str(path)


def test_a_ros_1_bag_byte_by_byte(tmp_path):
    parts = [
        ros_chunk(CONNECTION, ros_message(1.0, 5)),
        ros_chunk(ros_message(2.0, 6)),
        ros_chunk(ros_message(3.0, 8)),
    ]
    read = bag.read(ros_bag(tmp_path / "a.bag", *parts), ReadOptions())
    assert read.arrays["position"][:, 0].tolist() == [1.0, 2.0, 3.0]
    assert read.arrays["time"].tolist() == [0.0, 1.0, 3.0]
    assert not any("damaged" in note for note in read.notes)
    sizes = [len(CONNECTION + ros_message(1.0, 5)), len(ros_message(2.0, 6)), len(ros_message(3.0, 8))]
    for most, fits in ((sum(sizes), True), (sum(sizes) - 1, False)):
        options = ReadOptions(limits=Limits(max_bytes=most))
        if fits:
            assert bag.read(str(tmp_path / "a.bag"), options).arrays["time"].size == 3
        else:
            with pytest.raises(FileTooLarge):
                bag.read(str(tmp_path / "a.bag"), options)
    short = [parts[0], ros_chunk(ros_message(2.0, 6), size=sizes[1] + 1), parts[2]]
    read = bag.read(ros_bag(tmp_path / "b.bag", *short), ReadOptions())
    assert read.arrays["position"][:, 0].tolist() == [1.0]
    assert any(f"a chunk of {sizes[1]} bytes declares {sizes[1] + 1}" in note for note in read.notes)
    read = bag.read(ros_bag(tmp_path / "c.bag", *parts[:2], index=False), ReadOptions())
    assert read.arrays["time"].size == 2 and any("no index" in note for note in read.notes)


@pytest.mark.parametrize("length", [0, 9, 10**6])
def test_a_header_field_beyond_its_record_ends_a_ros_1_bag(tmp_path, length):
    good = ros_chunk(CONNECTION, ros_message(1.0, 5))
    bad = struct.pack("<I", 12) + struct.pack("<I", length) + b"op=\x05abcd" + struct.pack("<I", 0)
    path = ros_bag(tmp_path / "a.bag", good, bad, ros_chunk(ros_message(2.0, 6)))
    read = bag.read(path, ReadOptions())
    assert read.arrays["position"][:, 0].tolist() == [1.0]
    assert any("beyond its record" in note for note in read.notes)


def test_chunks_unpack_to_what_they_declare():
    import bz2

    raw = b"0123456789" * 500
    limits = Limits()
    for how in ("", "none"):
        assert expand(raw, how, 1, limits) == raw
    packed = bz2.compress(raw)
    assert expand(packed, "bz2", len(raw), limits) == raw
    with pytest.raises(FileTooLarge, match="holds more"):
        expand(packed, "bz2", len(raw) - 1, limits)
    with pytest.raises(ChunkDamage, match="damaged chunk"):
        expand(b"nonsense", "bz2", 10, limits)
    with pytest.raises(ChunkDamage, match="'zip'"):
        expand(raw, "zip", 10, limits)


# ---------------------------------------------------------------------------------------------- limits


def test_limits_are_what_they_say():
    limits = Limits()
    assert (limits.max_file_bytes, limits.max_bytes, limits.max_memory) == (
        16 * 1024**3,
        2 * 1024**3,
        2 * 1024**3,
    )
    assert (limits.max_ratio, limits.ratio_floor, limits.max_columns, limits.slowest) == (
        250.0,
        64 * 1024**2,
        4096,
        5e6,
    )
    assert (GIB, MIB) == (2**30, 2**20)
    assert limits.seconds_for(10**7) == pytest.approx(0.5 + 2.0 + 5.0)
    assert Limits(max_seconds=0.1).seconds_for(10**7) == 0.1
    assert limits.memory_for(10**6) == 256 * 2**20 + 40 * 10**6
    assert limits.memory_for(10**9) == 2 * 2**30
    small = Limits(max_bytes=10**6, ratio_floor=1000, max_ratio=10.0, max_columns=3)
    for declared, size, fits in ((10**6, 10**6, True), (10**6 + 1, 10**7, False), (1000, 1, True), (1001, 1, False),
                                 (5000, 500, True), (5001, 500, False), (5000, 0, False)):  # fmt: skip
        if fits:
            small.check_size(declared, size, "It")
        else:
            with pytest.raises(FileTooLarge):
                small.check_size(declared, size, "It")
    small.check_count(3, "columns")
    with pytest.raises(FileTooLarge):
        small.check_count(4, "columns")
    for name in (
        "max_file_bytes",
        "max_bytes",
        "max_memory",
        "max_ratio",
        "max_columns",
        "slowest",
        "max_seconds",
    ):
        with pytest.raises(InvalidInput, match=name):
            Limits(**{name: 0})


# ------------------------------------------------------------------------------------------- the pipe


def sent(content):
    stream = io.BytesIO(b"".join(bytes(part) for part in frames(content)))
    length = int.from_bytes(stream.read(4), "little")
    told = msgspec.json.decode(stream.read(length))

    def receive(view):
        view[:] = stream.read(len(view))

    return unframe(told, receive, Limits()), stream.read()


def test_columns_come_through_the_pipe_as_they_went_in():
    arrays = {
        "a": np.arange(6.0).reshape(2, 3).T,
        "b": np.array([1, 2], dtype=np.int16),
        "c": np.empty((0, 2)),
    }
    got, rest = sent(Columns(arrays=arrays, units={"a": "deg"}, joints=("x",), channels={"a": "position", "b": "evil"},
                             notes=("one",)))  # fmt: skip
    assert rest == b""
    for name, value in arrays.items():
        assert got.arrays[name].dtype == value.dtype and np.array_equal(got.arrays[name], value)
    assert (got.units, got.joints, got.channels, got.notes) == (
        {"a": "deg"},
        ("x",),
        {"a": "position"},
        ("one",),
    )
    assert header({"k": 1}) == b"\x08\x00\x00\x00" + b'{"k": 1}'
    assert columns.clean("a\x1b[31m\u202eb") == "a\\x1b[31m\\u202eb" and columns.clean("x" * 400) == "x" * 300


def test_what_comes_through_the_pipe_is_limited_to_the_byte():
    told = {
        "arrays": [["a", "<f8", [3, 4]], ["b", "<i2", [5]]], "units": {}, "joints": [], "channels": {}, "drive": None, "notes": [],
    }  # fmt: skip
    for most, fits in ((3 * 4 * 8 + 5 * 2, True), (3 * 4 * 8 + 5 * 2 - 1, False)):
        if fits:
            got = unframe(
                told, lambda view: view.__setitem__(slice(None), bytes(len(view))), Limits(max_bytes=most)
            )
            assert got.arrays["a"].shape == (3, 4)
        else:
            with pytest.raises(FileTooLarge):
                unframe(told, lambda view: None, Limits(max_bytes=most))
    for wrong in ([["a", "|O8", [1]]], [["a", "<f8", [1, 2, 3]]], [["a", "<f8", [-1]]], [["a", "<f8"]]):
        with pytest.raises(ReadError):
            unframe({**told, "arrays": wrong}, lambda view: None, Limits())


def test_plain_arrays():
    assert plain(np.array(3.0)).shape == (1,)
    assert plain(np.zeros((1, 4, 1, 2))).shape == (4, 2)
    assert (
        plain(np.zeros((2, 2, 2))) is None
        and plain(np.array(["a"])) is None
        and plain(np.array([1j])) is None
    )
    assert (
        plain(np.array([1.5], dtype=">f8")).dtype.str == "<f8"
        and plain(np.array([1.5], dtype=">f8"))[0] == 1.5
    )
    assert plain(np.array([1.5], dtype=np.float16)).dtype.str == "<f8"
    assert plain(np.array([2**63 - 1], dtype=np.int64))[0] == 2**63 - 1


# ---------------------------------------------------------------------------------------------- units

DEG, TURN = math.pi / 180.0, 2.0 * math.pi
UNITS = {
    "s": ("time", 1.0), "ms": ("time", 1e-3), "us": ("time", 1e-6), "µs": ("time", 1e-6), "ns": ("time", 1e-9),
    "min": ("time", 60.0), "h": ("time", 3600.0), "rad": ("angle", 1.0), "mrad": ("angle", 1e-3), "deg": ("angle", DEG),
    "°": ("angle", DEG), "degrees": ("angle", DEG), "rev": ("angle", TURN), "turns": ("angle", TURN),
    "rad/s": ("angle rate", 1.0), "mrad/s": ("angle rate", 1e-3), "deg/s": ("angle rate", DEG), "°/s": ("angle rate", DEG),
    "dps": ("angle rate", DEG), "rpm": ("angle rate", TURN / 60.0), "1/min": ("angle rate", TURN / 60.0),
    "rps": ("angle rate", TURN), "m": ("length", 1.0), "mm": ("length", 1e-3), "cm": ("length", 1e-2), "um": ("length", 1e-6),
    "m/s": ("speed", 1.0), "mm/s": ("speed", 1e-3), "cm/s": ("speed", 1e-2), "mm/min": ("speed", 1e-3 / 60.0),
    "Nm": ("torque", 1.0), "N·m": ("torque", 1.0), "N.m": ("torque", 1.0), "mNm": ("torque", 1e-3), "kNm": ("torque", 1e3),
    "Ncm": ("torque", 1e-2), "N": ("force", 1.0), "mN": ("force", 1e-3), "kN": ("force", 1e3), "MN": ("force", 1e6),
    "A": ("raw", 1.0), "%": ("raw", 1.0), "counts": ("raw", 1.0), "degree/s": ("angle rate", DEG),
    "rev/min": ("angle rate", TURN / 60),
    "sec": ("time", 1.0), "secs": ("time", 1.0), "second": ("time", 1.0), "seconds": ("time", 1.0), "usec": ("time", 1e-6),
    "nsec": ("time", 1e-9), "millis": ("time", 1e-3), "rads": ("angle", 1.0), "radians": ("angle", 1.0), "degs": ("angle", DEG),
    "degree": ("angle", DEG), "revs": ("angle", TURN), "turn": ("angle", TURN), "rad/sec": ("angle rate", 1.0),
    "deg/sec": ("angle rate", DEG), "degrees/s": ("angle rate", DEG), "rev/s": ("angle rate", TURN), "n*m": ("torque", 1.0),
    "n-m": ("torque", 1.0), "mN*m": ("torque", 1e-3), "N.cm": ("torque", 1e-2),
    "msec": ("time", 1e-3), "turn/s": ("angle rate", TURN), "Newton meter": ("torque", 1.0), "mN.m": ("torque", 1e-3),
}  # fmt: skip


@pytest.mark.parametrize("word", UNITS)
def test_units_are_their_definitions(word):
    kind, factor = UNITS[word]
    for spelt in (word, f"[{word}]", f" ({word}) "):
        unit = units.parse(spelt)
        assert (unit.kind, unit.offset) == (kind, 0.0)
        assert unit.factor == pytest.approx(factor, rel=1e-12)


def test_temperatures_have_an_offset():
    for word, zero, hundred in (
        ("K", 273.15, 373.15),
        ("kelvin", 273.15, 373.15),
        ("Celsius", 0.0, 100.0),
        ("C", 0.0, 100.0),
        ("degC", 0.0, 100.0),
        ("°F", 32.0, 212.0),
        ("°C", 0.0, 100.0),
        ("degF", 32.0, 212.0),
    ):
        unit = units.parse(word)
        assert unit.kind == "temperature"
        assert unit.factor * zero + unit.offset == pytest.approx(0.0, abs=1e-9)
        assert unit.factor * hundred + unit.offset == pytest.approx(100.0)
    assert units.parse("furlong") is None and units.parse("") is None


def test_names_with_units():
    for name, parts in {
        "q [deg]": ("q", "deg"), "tau (N.m)": ("tau", "N.m"), "q/rad": ("q", "rad"), "q": ("q", ""), "[deg]": ("[deg]", ""),
        "x [thing]": ("x [thing]", ""), "ratio/1": ("ratio/1", ""), "/rad": ("/rad", ""),
        "x" * 121 + " [deg]": ("x" * 121 + " [deg]", ""),
        "a b (mm) ": ("a b", "mm"), "v (deg/s)": ("v", "deg/s"),
    }.items():  # fmt: skip
        assert units.split(name) == parts, name
    for name, parts in {
        "pos_deg": ("pos", "deg"), "vel_deg_per_s": ("vel", "deg/s"), "time_ms": ("time", "ms"), "tau_Nm": ("tau", "nm"),
        "x_m_s": ("x", "m/s"), "_deg": ("_deg", ""), "load_percent": ("load", "%"), "deg": ("deg", ""), "q_rad_s": ("q", "rad/s"),
        "y" * 120 + "_deg": ("y" * 120 + "_deg", ""),
    }.items():  # fmt: skip
        assert units.split_suffix(name) == parts, name


# -------------------------------------------------------------------------------------------- tables


def table(tmp_path, content, encoding="utf-8"):
    path = tmp_path / "t.csv"
    path.write_bytes(content.encode(encoding))
    return csv_.read(str(path), ReadOptions())


@pytest.mark.parametrize("cut", [",", ";", "\t", "|", " "])
def test_tables_of_every_delimiter(tmp_path, cut):
    rows = [["t", "q", "tau"], *([f"{0.5 * k}", f"{-k}", f"{k}e-3"] for k in range(9))]
    got = table(tmp_path, "\n".join(cut.join(row) for row in rows) + "\n")
    assert list(got.arrays) == ["t", "q", "tau"]
    assert got.arrays["t"].tolist() == [0.5 * k for k in range(9)]
    assert got.arrays["q"].tolist() == [-k for k in range(9)]
    assert got.arrays["tau"].tolist() == pytest.approx([1e-3 * k for k in range(9)])
    assert got.notes == ()


def test_tables_as_people_write_them(tmp_path):
    comma = table(tmp_path, "t;q;tau\ns;deg;Nm\n" + "".join(f"{k},5;{k},25;-{k},125\n" for k in range(6)))
    assert comma.arrays["q"].tolist() == [k + 0.25 for k in range(6)] and comma.units == {
        "t": "s",
        "q": "deg",
        "tau": "Nm",
    }
    bare = table(tmp_path, "".join(f"{k},{k + 1}\n" for k in range(5)))
    assert list(bare.arrays) == ["column_1", "column_2"] and "no header" in bare.notes[0]
    above = table(
        tmp_path, "Made by a rig\n\nrate 100\nt [s],q [rad]\n" + "".join(f"{k},{k}\n" for k in range(8))
    )
    assert list(above.arrays) == ["t [s]", "q [rad]"] and above.units == {"t [s]": "s", "q [rad]": "rad"}
    assert above.arrays["t [s]"].tolist() == list(range(8))
    lone = table(tmp_path, "run 7\n3,4\nby hand\nt,q\n" + "".join(f"{k},{k}\n" for k in range(9)))
    assert list(lone.arrays) == ["t", "q"] and lone.arrays["t"].tolist() == list(range(9))
    twice = table(tmp_path, "# t,q,q\n" + "".join(f"{k},{k},{2 * k}\n" for k in range(5)))
    assert list(twice.arrays) == ["t", "q", "q#2"] and twice.arrays["q#2"].tolist() == [0, 2, 4, 6, 8]
    wide = table(tmp_path, "t,q\n" + "".join(f"{k},{k}\n" for k in range(20)) + "20,2", "utf-16")
    assert wide.arrays["t"].tolist() == list(range(21))


def test_holes_words_and_uneven_lines(tmp_path):
    got = table(tmp_path, "t,q,mode\n0,1,go\n1,,go\n2,nan,halt\n3,4,go\n4,inf,go\n")
    assert np.array_equal(got.arrays["q"], [1, np.nan, np.nan, 4, np.inf], equal_nan=True)
    assert "mode" not in got.arrays and any("holds words" in note for note in got.notes)
    got = table(tmp_path, "t,q\n" + "".join(f"{k},{k}\n" for k in range(30)) + "30")
    assert got.arrays["t"].size == 30 and any("last line is cut" in note for note in got.notes)
    lines = [f"{k},{k}" for k in range(60)]
    lines[20] = "20,20,20,7"
    got = table(tmp_path, "t,q\n" + "\n".join(lines) + "\n")
    assert got.arrays["t"].size == 59 and any(
        "1 uneven lines were dropped (line 22)" in note for note in got.notes
    )
    for k in range(0, 60, 2):
        lines[k] = "1,2,3,4"
    with pytest.raises((ReadError, UnknownFormat)):
        table(tmp_path, "t,q\n" + "\n".join(lines[:40]) + "\n")
    got = table(tmp_path, "when,q\n" + "".join(f"2024-03-01T10:00:0{k}.500,{k}\n" for k in range(6)))
    assert got.arrays["when"].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]


def test_cells():
    for cell, comma, value in (
        ("1.5", False, 1.5),
        ("-2e3", False, -2000.0),
        (".5", False, 0.5),
        ("1,5", True, 1.5),
        ("+3", True, 3.0),
    ):
        assert _dialect.number(cell, comma) == (value, False)
    for cell in ("", "NaN", "n/a", "null", "-"):
        assert math.isnan(_dialect.number(cell, False)[0])
    assert _dialect.number("-inf", False) == (-math.inf, False) and _dialect.number("INF", False) == (
        math.inf,
        False,
    )
    assert _dialect.number("3.5 # odd", False) == (3.5, True)
    for cell in ("word", "1.2.3", "0x10", "1_000", "١"):
        assert _dialect.number(cell, False) is None
    assert _dialect.number("1,5", False) is None or _dialect.number("1,5", False)[1]
    assert _dialect.cells('a,"b,c", d', ",") == ["a", "b,c", "d"] and _dialect.cells(" 1   2 ", " ") == [
        "1",
        "2",
    ]
    for raw in (b"\x00\x01\x02" * 50, b"only words here\nand there\n"):
        with pytest.raises(UnknownFormat):
            _dialect.sniff(raw, whole=True)


# ------------------------------------------------------------------------------------------ model file


def full_model():
    law = Law(
        rate=StribeckGauss(coulomb=4.0, breakaway=6.5, stribeck_velocity=0.05, viscous=1.25),
        element=Decaying(stiffness=1e4, decay_rate=21.0),
    )
    first = JointFriction(
        joint=Joint(name="a", unit="rad", torque_side="motor", gear_ratio=-50.0, encoder_counts=4096.5), law=law,
        validity=Validity(velocity=(-1.5, 2.5), load=(-3.0, 4.0), temperature=(15.0, 45.0)),
        standard_errors={"coulomb": 0.25, "viscous": math.nan, "stiffness": 30.0}, at_bound=("breakaway", "decay_rate"),
        dynamics={"inertia": Estimate(value=0.7, unit="kg.m^2", standard_error=0.01), "offset": Estimate(value=-1.0, unit="N.m")},
        fitted=Quality(residual=3.5, residual_raw=7.25, rms=0.4, samples=1234),
        held_out=Quality(residual=math.nan, residual_raw=8.0, rms=0.5, samples=99), method="sweep", warnings=("mind", "this"),
    )  # fmt: skip
    second = JointFriction(
        joint=Joint(name="b", unit="m"),
        law=Law(
            rate=CoulombViscous(coulomb_positive=1.0, coulomb_negative=2.0),
            element=MaxwellSlip(stiffness=(9.0, 8.0), share=(0.5, 0.5)),
        ),
        validity=Validity(velocity=(-1.0, 1.0)), standard_errors={"share": (0.1, math.nan)},
    )  # fmt: skip
    return FrictionModel(
        joints=(first, second), arm=ArmModel(urdf_sha256="ab" * 32, parameters=tuple(float(k) for k in range(20)), condition=77.0),
        sources=(Source(path="x.csv", sha256="cd" * 32),), options={"method": "sweep", "symmetric": True}, version="9.8.7",
    )  # fmt: skip


def same(a, b):
    """Whether two models are one, NaN equal to NaN."""
    if not isinstance(a, FrictionModel):
        return repr(a) == repr(b)
    parts = [[getattr(m, f.name) for f in dataclasses.fields(m) if f.init] for m in (a, b)]
    return repr(parts[0]) == repr(parts[1])


def test_a_model_file_says_everything_in_si():
    document = msgspec.json.decode(encode(full_model()))
    assert (document["format"], document["schema"]) == ("backdrive-friction-model", 2)
    a, b = document["joints"]
    assert (a["name"], a["unit"], a["torque_side"], a["gear_ratio"], a["encoder_counts"]) == (
        "a",
        "rad",
        "motor",
        -50.0,
        4096.5,
    )
    assert a["law"] == {"rate": "stribeck-gauss", "element": "decaying"}
    assert a["parameters"]["coulomb"] == {
        "value": 4.0, "unit": "N.m", "standard_error": 0.25, "lower": 0.0, "upper": None, "at_bound": False,
    }  # fmt: skip
    assert (
        a["parameters"]["breakaway"]["at_bound"] is True
        and a["parameters"]["viscous"]["standard_error"] is None
    )
    assert (
        a["element_parameters"]["stiffness"]["unit"] == "N.m/rad"
        and a["element_parameters"]["decay_rate"]["at_bound"] is True
    )
    assert b["parameters"]["viscous_positive"]["unit"] == "N.s/m" and b["element_parameters"]["share"][
        "standard_error"
    ] == [0.1, None]
    assert a["validity"] == {
        "velocity": [-1.5, 2.5], "load": [-3.0, 4.0], "temperature": [15.0, 45.0], "lowest_speed": None, "nominal_load": None,
    }  # fmt: skip
    assert list(a["dynamics"]) == ["inertia", "offset"] and a["dynamics"]["offset"]["standard_error"] is None
    assert a["fitted"] == {"residual_percent": 3.5, "residual_raw_percent": 7.25, "rms": 0.4, "samples": 1234}
    assert a["held_out"]["residual_percent"] is None and b["fitted"] is None
    assert (a["method"], a["warnings"], b["method"], b["warnings"]) == ("sweep", ["mind", "this"], "", [])
    assert document["arm"] == {
        "urdf_sha256": "ab" * 32,
        "parameters": [float(k) for k in range(20)],
        "condition": 77.0,
    }
    assert document["provenance"] == {
        "backdrive": "9.8.7", "sources": [{"path": "x.csv", "sha256": "cd" * 32}],
        "options": {"method": "sweep", "symmetric": True},
    }  # fmt: skip
    assert encode(full_model()).endswith(b"}\n") and b'\n  "format"' in encode(full_model())


def test_a_model_file_gives_back_what_it_was_given():
    model = full_model()
    read = decode(encode(model))
    assert (
        read.names == ("a", "b")
        and read.joints[0].law == model.joints[0].law
        and read.joints[1].law == model.joints[1].law
    )
    for name in ("joint", "validity", "at_bound", "method", "warnings"):
        assert [getattr(j, name) for j in read.joints] == [getattr(j, name) for j in model.joints]
    first, second = read.joints
    assert first.standard_errors == {"coulomb": 0.25, "stiffness": 30.0}  # unknown stays unsaid
    assert second.standard_errors["share"][0] == 0.1 and math.isnan(second.standard_errors["share"][1])
    assert same(first.dynamics, dict(model.joints[0].dynamics)) and same(first.fitted, model.joints[0].fitted)
    assert same(first.held_out, model.joints[0].held_out) and second.fitted is None
    assert (read.arm, read.sources, dict(read.options), read.version) == (
        model.arm,
        model.sources,
        dict(model.options),
        "9.8.7",
    )
    assert encode(read) == encode(model)


@pytest.mark.parametrize(
    ("change", "place"),
    [
        (lambda d: d["joints"][0]["parameters"]["coulomb"].update(unit="N"), "coulomb"),
        (lambda d: d["joints"][0]["parameters"].pop("viscous"), "viscous"),
        (lambda d: d["joints"][0]["parameters"].update(odd={"value": 1.0, "unit": "1"}), "odd"),
        (lambda d: d["joints"][0]["parameters"]["coulomb"].update(value=-1.0), "coulomb"),
        (lambda d: d["joints"][0]["element_parameters"]["stiffness"].update(value=[1.0]), "stiffness"),
        (lambda d: d["joints"][0]["dynamics"]["inertia"].update(value=[1.0]), "inertia"),
        (lambda d: d["joints"][0]["dynamics"]["inertia"].update(standard_error=[1.0]), "inertia"),
        (lambda d: d.update(schema=3), "schema"),
        (lambda d: d.update(schema=0), "schema"),
        (lambda d: d.update(joints=[]), "distinct"),
        (lambda d: d["joints"].append(d["joints"][0]), "distinct"),
        (lambda d: d["joints"][0]["law"].update(rate="unknown"), "unknown"),
        (lambda d: d["joints"][0].update(gear_ratio=0.0), "gear"),
    ],
)  # fmt: skip
def test_a_damaged_model_file_is_refused_with_the_place(change, place):
    document = msgspec.json.decode(encode(full_model()))
    change(document)
    with pytest.raises(ModelFileError) as refused:
        decode(msgspec.json.encode(document))
    assert place in f"{refused.value} {getattr(refused.value, 'remedy', '')}"


def test_a_model_file_has_10_million_bytes_at_most(tmp_path):
    path = tmp_path / "m.json"
    for size, said in ((10_000_001, "larger than 10000000 bytes"), (10_000_000, "")):
        with open(path, "wb") as stream:
            stream.truncate(size)  # of zeros, which take no room
        with pytest.raises(ModelFileError) as refused:
            load_model(path)
        assert ("larger than" in str(refused.value)) is bool(said) and said in str(refused.value)


def test_a_model_answers_by_name_and_by_place():
    model = full_model()
    assert model.joint("b") is model.joint(1) is model.joints[1]
    assert model.torque("b", [0.5, -0.5]) == pytest.approx([1.0, -2.0])
    with pytest.raises(InvalidInput, match="NaN or infinite"):
        model.torque("a", [0.0, np.inf])
    for wrong in (2, -1, "c"):
        with pytest.raises(InvalidInput):
            model.joint(wrong)
    numbered = FrictionModel(joints=tuple(replace(model.joints[0], joint=Joint(name=n)) for n in ("1", "0")))
    assert numbered.joint(1).joint.name == "1"  # a name comes before a place
    curves = model.table(5)
    assert curves["a"]["velocity"].tolist() == [-1.5, -0.5, 0.5, 1.5, 2.5]
    assert curves["b"]["torque"] == pytest.approx([-2.0, -2.0, 0.0, 1.0, 1.0])
    assert model.table()["a"]["velocity"].size == 21
