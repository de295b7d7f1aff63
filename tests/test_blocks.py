"""Tests for logs/readers/_blocks.py: every number rounded as Python rounds it, whatever the block it stands in."""

import random
import struct

import numpy as np
import pytest

from backdrive.logs.readers import _blocks
from backdrive.logs.readers._dialect import sniff


def columns(tmp_path, text):
    path = tmp_path / "table.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    raw = path.read_bytes()
    return _blocks.numbers(str(path), sniff(raw[: 1 << 16], whole=len(raw) < 1 << 16))


def cell(draw: random.Random) -> str:
    kind = draw.randrange(4)
    if kind == 0:
        value = struct.unpack("d", draw.randbytes(8))[0]
        return repr(value) if abs(value) < 1e300 else "0.5"
    if kind == 1:
        return f"{draw.uniform(-10, 10):.{draw.randrange(1, 25)}f}"
    if kind == 2:
        return str(draw.randrange(10 ** draw.randrange(1, 30)))
    return f"{draw.uniform(-1, 1) * 10 ** draw.uniform(-8, 8):.18e}"


@pytest.mark.parametrize("block", [64, 1000, 1 << 16])
def test_every_number_is_that_of_float(tmp_path, monkeypatch, block):
    monkeypatch.setattr(_blocks, "_BLOCK", block)
    draw = random.Random(7)
    rows = [[cell(draw) for _ in range(5)] for _ in range(2000)]
    want = np.array([[float(x) for x in row] for row in rows])
    for cut, point, end in (
        (",", ".", "\n"),
        (";", ",", "\r\n"),
        ("\t", ".", "\n"),
        ("  ", ".", "\n"),
        (",", ".", "\r"),
    ):
        lines = [cut.join(x.replace(".", point) for x in row) for row in rows]
        got = columns(tmp_path, end.join([cut.join("tabcd"), *lines]) + end)
        assert got is not None
        assert np.array_equal(np.array(got).T, want)
        assert all(column.flags.c_contiguous for column in got)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "latin-1"])
def test_encodings(tmp_path, encoding):
    got = columns(
        tmp_path,
        "tä,q\n".encode(encoding)
        + "".join(f"{k},{k}.5\n" for k in range(9)).encode(
            encoding.replace("utf-16", "utf-16-le").replace("-sig", "")
        ),
    )
    assert got is not None
    assert got[1].tolist() == [k + 0.5 for k in range(9)]


def test_what_json_does_not_know_is_read_all_the_same(tmp_path):
    rows = "".join(f"{k},1\n" for k in range(20))
    for odd, value in (
        ("+1", 1.0),
        (".5", 0.5),
        ("1.", 1.0),
        ("007", 7.0),
        ("1e400", np.inf),
        ("nan", np.nan),
        ('"3"', 3.0),
    ):
        got = columns(tmp_path, f"t,q\n{rows}{odd},{odd}\n\n{rows}{rows}{rows}{rows}")
        assert got is not None and got[0].size == 101
        assert np.array_equal(got[1][20], value, equal_nan=True)
    for zero in ("-0", "-0.0", "-0e5"):
        got = columns(tmp_path, f"t,q\n{rows}1,{zero}\n{zero},1\r\n{rows}")
        assert got is not None
        assert np.signbit(got[1][20]) and np.signbit(got[0][21])


@pytest.mark.parametrize(
    "odd", ["1],[2,3", "1,2,3", "1", "1,x", "1,null", "1,true", '1,"a"', "[1,2]", "1,{}", "1,é"]
)
def test_what_is_no_row_of_numbers_is_left_to_the_careful_way(tmp_path, odd):
    rows = "".join(f"{k},1\n" for k in range(200))
    assert columns(tmp_path, f"t,q\n{rows}{odd}\n{rows}") is None


def test_a_line_without_end_does_not_take_quadratic_time(tmp_path, monkeypatch):
    monkeypatch.setattr(_blocks, "_BLOCK", 1 << 10)
    joined = []
    path = tmp_path / "t.csv"
    path.write_bytes(b"t,q\n" + b"1,2\n" * 20 + b"1," * 500_000)
    dialect = sniff(path.read_bytes()[: 1 << 16], whole=False)
    joined = [len(block) for block in _blocks._blocks(str(path), dialect)]
    assert len(joined) == 2 and joined[1] > 990_000
