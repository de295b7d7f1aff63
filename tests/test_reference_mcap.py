"""MCAP byte by byte from its specification (mcap.dev/spec): records, chunks, and where a file that ends early was cut."""

import bz2
import struct
import zlib

import pytest

from _joint_states import STATE, state
from backdrive.errors import (
    FileTooLarge,
    IncompleteFile,
    MappingError,
    ReadError,
    UnknownFormat,
)
from backdrive.logs.readers import mcap
from backdrive.logs.readers._chunks import ChunkDamage, expand
from backdrive.logs.readers.columns import ReadOptions
from backdrive.logs.readers.limits import Limits

OPTIONS = ReadOptions()


def record(kind, content):
    return struct.pack("<BQ", kind, len(content)) + content


def text(word):
    return struct.pack("<I", len(word.encode())) + word.encode()


def schema(number, name):
    return record(3, struct.pack("<H", number) + text(name) + text("ros2msg") + text(""))


def channel(number, of, topic, encoding="cdr"):
    return record(4, struct.pack("<HH", number, of) + text(topic) + text(encoding) + struct.pack("<I", 0))


def message(raw, number=1, received=0):
    return record(5, struct.pack("<HIQQ", number, 0, received, 0) + raw)


def chunk(content, how="", size=None, packed=None):
    packed = content if packed is None else packed
    size = len(content) if size is None else size
    return record(
        6,
        struct.pack("<QQQI", 0, 0, size, zlib.crc32(content))
        + text(how)
        + struct.pack("<Q", len(packed))
        + packed,
    )


def states(count, first=0, number=1):
    return b"".join(message(state("a", [first + k], stamp=(first + k + 1, 0)), number) for k in range(count))


def file(path, *records, end=15):
    path.write_bytes(mcap.MAGIC + b"".join(records) + (record(end, b"") if end else b""))
    return str(path)


JS = schema(1, STATE) + channel(1, 1, "/js")


def test_topics_schemas_and_encodings_of_mcap(tmp_path):
    path = tmp_path / "a.mcap"
    wide = (
        schema(513, STATE) + channel(770, 513, "/js") + states(3, number=770)
    )  # both bytes of the numbers count
    for end in (15, 2):
        for part in (chunk(wide), wide):
            got = mcap.read(file(path, part, end=end), OPTIONS)
            assert got.arrays["position"][:, 0].tolist() == [0, 1, 2] and len(got.notes) == 1
    old = schema(1, "sensor_msgs/JointState") + channel(1, 1, "/js", "ros1")
    raw = state("a", [4.5], ros1=True, seq=9)
    assert mcap.read(file(path, old, message(raw)), OPTIONS).arrays["position"].tolist() == [[4.5]]
    others = (
        schema(1, STATE) + schema(2, "sensor_msgs/msg/Imu") + channel(1, 1, "/json", "json") + channel(2, 2, "/imu")
        + channel(3, 9, "/bare", "raw")
    )  # fmt: skip
    with pytest.raises(ReadError) as error:
        mcap.read(file(path, others, states(1), states(1, number=2), states(1, number=3)), OPTIONS)
    assert f"/json ({STATE}, json), /imu (sensor_msgs/msg/Imu, cdr), /bare (no schema, raw)." in str(
        error.value
    )
    with pytest.raises(ReadError, match="Topics: none"):
        mcap.read(file(path), OPTIONS)
    many = b"".join(channel(k, 9, f"/t{k}") for k in range(30))
    with pytest.raises(ReadError) as error:
        mcap.read(file(path, many), OPTIONS)
    assert "/t19 (no schema, cdr)." in str(error.value) and "/t20" not in str(error.value)
    with pytest.raises(ReadError) as error:
        mcap.read(file(path, JS, channel(2, 1, "/other")), OPTIONS)  # topics without any message
    assert "no sensor_msgs/JointState message" in str(error.value)


def test_topics_and_schemas_of_mcap_are_counted(tmp_path):
    path = tmp_path / "a.mcap"
    few, most = ReadOptions(limits=Limits(max_columns=3)), 3
    topics = [channel(2, 9, "/x"), channel(3, 9, "/y")]
    assert mcap.read(file(path, JS, *topics, states(1)), few).arrays["time"].size == 1
    with pytest.raises(FileTooLarge, match=f"{most + 1} topics"):
        mcap.read(file(path, JS, *topics, channel(4, 9, "/z"), states(1)), few)
    with pytest.raises(FileTooLarge, match=f"{most + 1} topics"):
        mcap.read(file(path, JS, *topics, channel(4, 1, "/js2"), states(1)), few)
    schemas = [schema(2, "b"), schema(3, "c")]
    assert mcap.read(file(path, JS, *schemas, schema(3, "c"), states(1)), few).arrays["time"].size == 1
    with pytest.raises(FileTooLarge, match=f"{most + 1} schemas"):
        mcap.read(file(path, JS, *schemas, schema(4, "d"), states(1)), few)


def test_which_topic_is_meant(tmp_path):
    two = JS + channel(2, 1, "/other") + channel(3, 1, "/empty") + states(2) + states(3, 10, number=2)
    path = file(tmp_path / "a.mcap", two)
    with pytest.raises(MappingError, match=r"/js \(2\), /other \(3\)\."):
        mcap.read(path, OPTIONS)
    assert mcap.read(path, ReadOptions(topic="/other")).arrays["position"][:, 0].tolist() == [10, 11, 12]
    assert mcap.read(path, ReadOptions(topic="/js")).arrays["position"][:, 0].tolist() == [0, 1]
    for absent in ("/empty", "/none"):
        with pytest.raises(
            MappingError, match=f"no joint states on '{absent}'. Topics with some: /js, /other."
        ):
            mcap.read(path, ReadOptions(topic=absent))
    with pytest.raises(MappingError, match="Topics with some: none"):
        mcap.read(file(tmp_path / "b.mcap", JS), ReadOptions(topic="/js"))
    one = file(tmp_path / "c.mcap", JS + channel(2, 1, "/empty") + states(2))
    assert mcap.read(one, OPTIONS).arrays["time"].size == 2


def test_times_of_recording_are_cut_at_the_last_of_64_bits(tmp_path):
    raws = [state("a", [1.0], stamp=(0, 0))] * 2
    path = file(tmp_path / "a.mcap", JS, message(raws[0], 1, 2**63 - 11), message(raws[1], 1, 2**64 - 1))
    assert mcap.read(path, OPTIONS).arrays["time"].tolist() == [0.0, 1e-8]


def test_records_that_are_too_short_are_no_messages(tmp_path):
    path = tmp_path / "a.mcap"
    got = mcap.read(file(path, JS, record(5, b"\1\0" + b"\0" * 19), states(2)), OPTIONS)
    assert got.arrays["position"][:, 0].tolist() == [0, 1]
    with pytest.raises(ReadError, match="no joint state"):
        mcap.read(file(path, JS, record(5, b"\1\0" + b"\0" * 24), states(2)), OPTIONS)
    assert (
        mcap.read(file(path, JS, states(1), record(7, b"xy"), states(1, 1)), OPTIONS).arrays["time"].size == 2
    )


def damaged(path, where, why, found, *records, **more):
    got = mcap.read(file(path, *records, **more), OPTIONS)
    size = path.stat().st_size
    assert got.arrays["time"].size == found
    assert got.notes[0] == (
        f"The file is cut or damaged at byte {where} of {size} ({why}): the {found} joint states in the complete chunks "
        "before it were read."
    )


def test_where_and_why_an_mcap_ends_early(tmp_path):
    path, first = tmp_path / "a.mcap", chunk(JS + states(2))
    at = 8 + len(first)
    damaged(path, at, "no end of data", 2, first, end=0)
    damaged(path, at, "no end of data", 2, first, b"\6" * 8, end=0)
    damaged(path, at, "an incomplete record", 2, first, b"\6" + struct.pack("<Q", 50) + b"x" * 49, end=0)
    damaged(path, at, "an incomplete record", 2, first, record(0, b"x"), states(1))
    for odd in (16, 127):
        damaged(path, at, "an incomplete record", 2, first, record(odd, b"x"), states(1))
    for kind in (1, 7, 14, 128, 255):  # of no concern here
        assert (
            len(
                mcap.read(file(path, first, record(kind, b"xyz"), chunk(states(1, 2))), OPTIONS).arrays[
                    "time"
                ]
            )
            == 3
        )
    damaged(
        path,
        at,
        "a text reaches beyond its record",
        2,
        first,
        record(6, struct.pack("<QQQII", 0, 0, 0, 0, 99)),
        chunk(states(1)),
    )
    wrong = record(3, b"\2\0" + struct.pack("<I", 3) + b"ab")
    damaged(path, at + len(wrong), "a text reaches beyond its record", 2, first, wrong, chunk(states(1)))
    end = record(15, b"")
    damaged(path, at + len(wrong), "a text reaches beyond its record", 2, first, wrong, end)
    exact = record(3, b"\2\0" + struct.pack("<I", 2) + b"ab")  # a schema that ends with its name
    assert len(mcap.read(file(path, first, exact, chunk(states(1, 2))), OPTIONS).notes) == 1
    latin = record(3, b"\2\0" + struct.pack("<I", 1) + b"\xff")
    for rest in ([chunk(states(1))], []):
        got = mcap.read(file(path, first, latin, *rest), OPTIONS)
        assert got.arrays["time"].size == 2 and "can't decode byte 0xff" in got.notes[0]
    with pytest.raises(IncompleteFile, match=f"byte 8 of {8 + 9}, before its first"):
        mcap.read(file(path, record(0, b""), end=0), OPTIONS)
    path.write_bytes(mcap.MAGIC[:-1] + b"x")
    with pytest.raises(UnknownFormat):
        mcap.read(str(path), OPTIONS)


def test_the_parts_of_a_bag_that_was_split(tmp_path):
    one = file(tmp_path / "a.mcap", JS, states(2), end=0)
    two = file(tmp_path / "b.mcap", JS, states(3, 2))
    got = mcap.read(one, ReadOptions(parts=(two,)))
    assert got.arrays["position"][:, 0].tolist() == [0, 1, 2, 3, 4]
    assert "(no end of data): the 2 joint states" in got.notes[0] and len(got.notes) == 2
    cut = file(tmp_path / "c.mcap", end=0)
    assert mcap.read(cut, ReadOptions(parts=(two,))).arrays["time"].size == 3
    last = file(tmp_path / "d.mcap", JS, end=0)
    with pytest.raises(IncompleteFile, match=f"byte {8 + len(JS)} of {8 + len(JS)}, before"):
        mcap.read(cut, ReadOptions(parts=(last,)))
    own = file(
        tmp_path / "e.mcap", schema(1, "x") + channel(1, 1, "/js") + states(2)
    )  # numbers are each file's own
    assert mcap.read(two, ReadOptions(parts=(own,))).arrays["time"].size == 3


@pytest.mark.parametrize("how", ["bz2", "lz4", "zstd"])
def test_compressed_chunks_hold_what_they_declare(how):
    raw = b"0123456789" * 500
    if how == "bz2":
        pack = bz2.compress
    elif how == "lz4":
        pack = pytest.importorskip("lz4.frame").compress
    else:
        pack = pytest.importorskip("zstandard").ZstdCompressor().compress
    packed = pack(raw)
    assert expand(packed, how, len(raw), Limits()) == raw
    assert expand(packed, how, len(raw) + 9, Limits()) == raw
    with pytest.raises(FileTooLarge, match="holds more|unpacks to 5000"):
        expand(packed, how, len(raw) - 1, Limits())
    with pytest.raises(ChunkDamage, match="a damaged chunk: "):
        expand(b"nonsense" * 9, how, 10, Limits())
    small = Limits(ratio_floor=1, max_ratio=2.0)
    assert expand(pack(b"x"), how, 2 * len(pack(b"x")), small) == b"x"
    for limits in (small, Limits(max_bytes=len(raw) - 1)):
        with pytest.raises(FileTooLarge, match="A chunk declares"):
            expand(packed, how, len(raw), limits)


def test_packed_chunks_of_mcap_are_unpacked(tmp_path):
    content = JS + states(4)
    part = chunk(content, "bz2", packed=bz2.compress(content))
    assert mcap.read(file(tmp_path / "a.mcap", part), OPTIONS).arrays["position"][:, 0].tolist() == [
        0,
        1,
        2,
        3,
    ]
    damaged(
        tmp_path / "a.mcap",
        8 + len(part),
        "a chunk is compressed with 'zip', which is not known",
        4,
        part,
        chunk(b"x", "zip"),
    )


def test_what_follows_the_records_of_a_chunk_is_none_of_them(tmp_path):
    content = JS + states(2)
    head = struct.pack("<QQQI", 0, 0, len(content), zlib.crc32(content)) + text("")
    odd = record(6, head + struct.pack("<Q", len(content)) + content + b"beyond")
    assert mcap.read(file(tmp_path / "a.mcap", odd), OPTIONS).arrays["position"][:, 0].tolist() == [0, 1]
