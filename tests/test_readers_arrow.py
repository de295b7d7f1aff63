"""Large tables by Arrow: the same numbers as by blocks of lines, or none."""

import sys

import numpy as np
import pytest

from backdrive import read_log
from backdrive.logs.readers import _arrow, _blocks
from backdrive.logs.readers._dialect import Dialect

PLAIN = [f"{x:.17g}" for x in np.random.default_rng(0).normal(size=40) * 10.0 ** np.linspace(-30, 30, 40)]
SAME = ("-0", "5.", ".5", "1E-3", "nan", "inf", "-inf", "2.2250738585072011e-308", "4.9e-324", "9007199254740993", "1e23",
        "123456789012345678901234567890", " 2", "3 ", '"5"', "1.7976931348623159e308", "00012")  # fmt: skip
NONE = ("", "NULL", "NA", "true", "0x10", "1_0", "1.2.3", "--1", "7\x00", "word", "1,5")


def written(path, rows, delimiter=";", comma=False, end="\n", first=0, ahead=""):
    text = ahead + end.join(delimiter.join(row) for row in rows) + end
    path.write_bytes((text.replace(".", ",") if comma else text).encode())
    width = len(rows[0])
    return Dialect(
        encoding="utf-8",
        delimiter=delimiter,
        comma=comma,
        width=width,
        first=first,
        names=tuple(f"c{i}" for i in range(width)),
        units={},
        text=frozenset(),
        regular=True,
        headless=not first,
    )


@pytest.fixture(autouse=True)
def small(monkeypatch):
    monkeypatch.setattr(_arrow, "WORTH", 0)


def same(path, dialect):
    found, plain = _arrow.numbers(str(path), dialect), _blocks.numbers(str(path), dialect)
    assert found is not None
    assert plain is not None
    for one, other in zip(found, plain, strict=True):
        known = ~np.isnan(other)
        assert np.array_equal(np.isnan(one), ~known)
        assert one[known].tobytes() == other[known].tobytes()


@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize(("delimiter", "comma"), [(",", False), ("\t", False), (";", True), ("|", True)])
def test_every_number_is_that_of_the_blocks(tmp_path, delimiter, comma, end):
    rows = [PLAIN[k : k + 4] for k in range(0, 40, 4)]
    same(tmp_path / "a.csv", written(tmp_path / "a.csv", rows, delimiter, comma, end))
    ahead = f"# made by hand{end}a{delimiter}b{delimiter}c{delimiter}d{end}"
    same(tmp_path / "b.csv", written(tmp_path / "b.csv", rows, delimiter, comma, end, 2, ahead))


@pytest.mark.parametrize("cell", SAME)
def test_an_odd_number_is_that_of_the_blocks_too(tmp_path, cell):
    path = tmp_path / "a.csv"
    same(path, written(path, [["1.5", cell], ["2.5", "3"]]))


@pytest.mark.parametrize("cell", NONE)
def test_what_is_no_number_is_left_to_others(tmp_path, cell):
    path = tmp_path / "a.csv"
    assert _arrow.numbers(str(path), written(path, [["1.5", "2"], ["3.5", cell], ["4", "5"]])) is None


def test_uneven_rows_are_left_to_others(tmp_path):
    path = tmp_path / "a.csv"
    assert _arrow.numbers(str(path), written(path, [["1", "2"], ["3"], ["4", "5"]])) is None
    assert _arrow.numbers(str(path), written(path, [["1", "2"], ["3", "4", "5"]])) is None


def test_more_rows_than_a_block(tmp_path, monkeypatch):
    monkeypatch.setattr(_arrow, "_BLOCK", 256)
    rows = [[PLAIN[k % 40], PLAIN[(7 * k) % 40]] for k in range(500)]
    same(tmp_path / "a.csv", written(tmp_path / "a.csv", rows))


def test_blocks_of_empty_lines_hold_no_rows(tmp_path, monkeypatch):
    monkeypatch.setattr(_arrow, "_BLOCK", 256)
    path = tmp_path / "a.csv"
    dialect = written(path, [["1", "2"], ["3", "4"]])
    path.write_text("1;2\n" + 2000 * "\n" + "3;4\n" + 2000 * "\n")
    found = _arrow.numbers(str(path), dialect)
    assert found is not None
    assert [column.tolist() for column in found] == [[1.0, 3.0], [2.0, 4.0]]
    assert [column.tolist() for column in _blocks.numbers(str(path), dialect)] == [[1.0, 3.0], [2.0, 4.0]]


def test_small_files_and_other_encodings_are_left_to_others(tmp_path, monkeypatch):
    from dataclasses import replace

    path = tmp_path / "a.csv"
    dialect = written(path, [["1", "2"]])
    assert _arrow.numbers(str(path), replace(dialect, encoding="utf-16")) is None
    assert _arrow.numbers(str(path), replace(dialect, delimiter=" ")) is None
    assert _arrow.numbers(str(path), replace(dialect, delimiter=",", comma=True)) is None
    assert _arrow.numbers(str(path), replace(dialect, delimiter=" ", comma=True)) is None
    monkeypatch.setattr(_arrow, "WORTH", 1 << 26)
    assert _arrow.numbers(str(path), dialect) is None


def test_without_arrow_blocks_are_read(tmp_path, monkeypatch):
    path = tmp_path / "a.csv"
    dialect = written(path, [["1", "2"]])
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert _arrow.numbers(str(path), dialect) is None


def test_a_log_is_the_same_either_way(tmp_path, monkeypatch):
    path, t = tmp_path / "log.csv", np.arange(500) / 100.0
    table = np.column_stack([t, np.sin(t), np.cos(t), np.sign(np.cos(t))])
    np.savetxt(path, table, delimiter=",", header="t,q,dq,tau", comments="", fmt="%.17g")
    logs = []
    for worth in (0, 1 << 26):
        monkeypatch.setattr(_arrow, "WORTH", worth)
        logs.append(read_log(path, guarded=False))
    for name in ("time", "position", "velocity", "torque"):
        assert np.array_equal(getattr(logs[0], name), getattr(logs[1], name))
