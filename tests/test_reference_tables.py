"""Tables of text as people and programs write them: each small table with what it says, read off by eye."""

import math
import sys

import numpy as np
import pytest

from backdrive.errors import FileTooLarge, ReadError, UnknownFormat
from backdrive.logs.readers import _dialect, csv_
from backdrive.logs.readers.columns import ReadOptions
from backdrive.logs.readers.limits import Limits


def sniffed(text, whole=True, encoding="utf-8"):
    return _dialect.sniff(text.encode(encoding), whole=whole)


def table(tmp_path, text, encoding="utf-8", **limits):
    path = tmp_path / "t.csv"
    path.write_bytes(text.encode(encoding) if isinstance(text, str) else text)
    return csv_.read(str(path), ReadOptions(limits=Limits(**limits)))


def rows(count, cut=",", first=0):
    return "".join(f"{first + k}{cut}{first + k}.5\n" for k in range(count))


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("t,q\n" + rows(6), {"delimiter": ",", "width": 2, "first": 1, "names": ("t", "q"), "regular": True}),
        ("t,q\n1,2\n", {"width": 2, "first": 1, "names": ("t", "q"), "regular": True}),
        ("1,2", {"width": 2, "first": 0, "names": ("column_1", "column_2"), "headless": True}),
        (rows(4, ";"), {"delimiter": ";", "first": 0, "names": ("column_1", "column_2"), "headless": True}),
        ("t;q\n0,5;1\n1,5;2\n", {"delimiter": ";", "comma": True, "regular": False, "width": 2}),
        ("t;q\n0,5;1.5\n1,5;2.5\n2,5;3.5\n", {"delimiter": ";", "comma": False, "width": 2}),
        ("t q\n0,5 1\n1,5 2\n", {"delimiter": " ", "comma": True}),
        ("  t   q \n 0   1\n 1   2\n", {"delimiter": " ", "width": 2, "names": ("t", "q")}),
        ("t\tq r\n0\t1\n1\t2\n", {"delimiter": "\t", "width": 2, "names": ("t", "q r")}),
        ("t|q\n0|1\n", {"delimiter": "|"}),
        ("t,q,\n0,1,\n1,2,\n2,3,\n", {"width": 3, "names": ("t", "q", "column_3"), "text": set()}),
        ("t,mode,q\n0,go,1\n1,go,2\n2,5,3\n", {"text": {1}, "regular": False, "width": 3}),
        ("t,q\n0,\n1,5\n2,nan\n3,4\n", {"text": set(), "regular": False}),
        ("# t q\n0 1\n1 2\n", {"first": 1, "names": ("t", "q"), "delimiter": " "}),
        ("#t,q\n0,1\n1,2\n", {"names": ("t", "q")}),
        ("// t, q\n0,1\n1,2\n", {"names": ("t", "q")}),
        ("%% t;q\n0;1\n1;2\n", {"names": ("t", "q")}),
        ("t, q\n0 1\n1 2\n", {"delimiter": " ", "names": ("t", "q")}),  # a header that is delimited otherwise
        ("t q\n0,1\n1,2\n", {"delimiter": ",", "names": ("t", "q")}),
        ("t,q,,\n0,1\n1,2\n", {"width": 2, "names": ("t", "q")}),
        ("t,q,r\n0,1\n1,2\n", {"width": 2, "names": ("column_1", "column_2"), "headless": True}),
        ("\n\nt,q\n\n0,1\n1,2\n", {"first": 4, "names": ("t", "q")}),
        ("note\nt,q\ns,deg\n0,1\n1,2\n", {"first": 3, "units": {"t": "s", "q": "deg"}, "names": ("t", "q")}),
        ("t,q\n[s],(deg)\n0,1\n1,2\n", {"units": {"t": "s", "q": "deg"}}),
        ("t,q,x\ns,,rpm\n0,1,2\n1,2,3\n", {"units": {"t": "s", "x": "rpm"}, "names": ("t", "q", "x")}),
        (",q\ns,deg\n0,1\n1,2\n", {"units": {"time": "s", "q": "deg"}, "names": ("time", "q")}),
        (",q\ndeg,s\n0,1\n1,2\n", {"units": {"column_1": "deg", "q": "s"}, "names": ("column_1", "q")}),
        (",q\n0,1\n1,2\n", {"units": {}, "names": ("column_1", "q")}),
        ("s,m\n0,1\n1,2\n", {"units": {}, "names": ("s", "m"), "first": 1}),  # alone it is a line of names
        ("5,6\ns,m\n0,1\n1,2\n2,3\n", {"units": {}, "names": ("s", "m"), "first": 2}),
        ("t [ms],q (deg),tau/Nm,x [odd]\n0,1,2,3\n", {"units": {"t [ms]": "ms", "q (deg)": "deg", "tau/Nm": "Nm"}}),
        ("t,q,q,q,,\n0,1,2,3,4,5\n", {"names": ("t", "q", "q#2", "q#3", "column_5", "column_6")}),
        ("run 7\n3,4\nby hand\nt,q\n0,1\n1,2\n2,3\n", {"first": 4, "names": ("t", "q")}),
        ("t,q\n0,1\n1,2\n2,3\nend of file\n", {"first": 1, "width": 2, "regular": False}),
        ("x\n1\n2\n3\n", {"width": 1, "names": ("x",), "first": 1}),
        ('"t","q, r"\n"0","1"\n"1","2"\n', {"names": ("t", "q, r"), "width": 2}),
        ("t,q\n0,1\n1,2\n2,3\n3 # odd,4\n", {"text": set(), "regular": False, "first": 1}),
        ("3,5\n4,5\n5,5\n", {"delimiter": ",", "comma": False, "width": 2, "headless": True}),
        ("0 1 2\n1 2 3\n2 3 4\n", {"delimiter": " ", "width": 3, "headless": True}),
        ("0, 1, 2\n1, 2, 3\n2, 3, 4\n", {"delimiter": ",", "width": 3, "headless": True}),
        ("t,q,\n0,1\n1,2\n2,3,7\n3,4\n4,5\n5,6\n", {"width": 2, "first": 1, "names": ("t", "q")}),
        ("a,b\n0,1,2\nt,q\n0,1\n1,2\n2,3\n", {"first": 3}),  # a longer row is none of the table
        ("a,b\n0,1,,\nt,q\n0,1\n1,2\n2,3\n", {"first": 3, "width": 2}),
    ],
)  # fmt: skip
def test_what_kind_of_table_it_is(text, wanted):
    for newline in ("\n", "\r\n", "\r"):
        found = sniffed(text.replace("\n", newline))
        for name, value in wanted.items():
            assert getattr(found, name) == value, (name, newline)
        assert found.encoding == "utf-8" and found.headless is wanted.get("headless", False)


@pytest.mark.parametrize(
    ("words", "count", "after"),
    [(24, 12, 12), (36, 6, 6), (42, 3, 3), (45, 2, 1), (46, 2, 0), (0, 1, 0), (1, 1, 0), (30, 60, 0)],
)
def test_a_table_is_found_below_much_that_is_said(words, count, after):
    text = (
        "so it was said\n" * words
        + "".join(f"{k};{k};{k}\n" for k in range(count))
        + "and then no more\n" * after
    )
    found = sniffed(text)
    assert (found.delimiter, found.width, found.first) == (";", 3, words)


def test_the_last_sixty_lines_say_which_columns_are_words():
    def text(count):
        return "t,q\n" + "".join(
            f"{k},{'word' if 300 - 60 - count <= k < 300 - 60 else k}\n" for k in range(300)
        )

    for count in (59, 61, 150):
        assert sniffed(text(count)).text == set() and sniffed(text(count)).regular
    lines = ["t,q", *(f"{k},{'word' if k >= 300 - 31 else k}" for k in range(300))]
    assert sniffed("\n".join(lines)).text == {1}  # 31 of 60
    lines = ["t,q", *(f"{k},{'word' if k >= 300 - 29 else k}" for k in range(300))]
    assert sniffed("\n".join(lines)).text == set()


def test_a_line_that_the_first_bytes_cut_is_not_looked_at():
    assert sniffed("t,q\n0,1\n1,x", whole=False).regular and not sniffed("t,q\n0,1\n1,x").regular
    assert sniffed("0,1\n1,x", whole=False).regular and sniffed("0,1,2,3", whole=False).width == 4
    assert sniffed("t,q\n0,1", whole=True).first == 1
    with pytest.raises(UnknownFormat):
        sniffed("t,q\n0,1", whole=False)


@pytest.mark.parametrize("text", ["", "only words here\nand there\n", "a,b\nc,d\n", ",,,\n,,,\n", "\n\n"])
def test_what_is_no_table(text):
    with pytest.raises(UnknownFormat, match="no table of numbers"):
        sniffed(text)


def test_encodings_are_told_by_their_first_bytes_or_their_zeros():
    text = "Zeit,Größe\n" + rows(40)
    for encoding, found in (
        ("utf-8", "utf-8"), ("utf-8-sig", "utf-8-sig"), ("utf-16", "utf-16"), ("utf-16-le", "utf-16-le"), ("latin-1", "latin-1")
    ):  # fmt: skip
        dialect = sniffed(text, encoding=encoding)
        assert dialect.encoding == found and dialect.names == ("Zeit", "Größe"), encoding
        assert _dialect.sniff(text.encode(encoding)[:-1], whole=False).encoding == found  # half a character
    big = b"\xfe\xff" + text.encode("utf-16-be")
    assert _dialect.sniff(big, whole=True).names == ("Zeit", "Größe")
    plain = b"t,q\n" + rows(400).encode()
    few, many = (
        b"\x1f" * int(0.004 * len(plain)),
        b"\1" * int(0.008 * len(plain)),
    )  # 1 in 200 is where text ends
    for odd, fine in ((few, True), (many, False), (b"\t\f" * 200, True), (b"\0", False)):
        raw = b"note: " + odd + b"\n" + plain
        if fine:
            assert _dialect.sniff(raw, whole=True).names == ("t", "q")
        else:
            with pytest.raises(UnknownFormat, match="binary"):
                _dialect.sniff(raw, whole=True)
    with pytest.raises(UnknownFormat, match="binary"):
        _dialect.sniff(bytes(range(256)) * 20, whole=True)
    for letters, fine in (
        (200, True),
        (900, False),
    ):  # of which no byte is 0, before 400 characters of numbers
        raw = ("ж" * letters + "\n" + "12,34\n" * 66).encode("utf-16-le")
        if fine:
            assert _dialect.sniff(raw, whole=True).encoding == "utf-16-le"
        else:
            with pytest.raises(UnknownFormat, match="binary"):
                _dialect.sniff(raw, whole=True)


def test_numbers_as_they_are_written():
    for cell, value in {
        "0": 0, "12": 12, "-1.5": -1.5, "+2.": 2, ".25": 0.25, "1e3": 1000, "-1.5E-2": -0.015, "007": 7,
    }.items():  # fmt: skip
        assert _dialect.number(cell, False) == (value, False) == _dialect.number(cell, True)
    for cell, value in {"1,5": 1.5, ",5": 0.5, "-3,25e2": -325.0, "4,": 4.0}.items():
        assert _dialect.number(cell, True) == (value, False)
    for cell in ("", "nan", "NaN", "NA", "n/a", "None", "NULL", "-", "-nan", "1.#QNAN", "#N/A"):
        value, comment = _dialect.number(cell, False)
        assert math.isnan(value) and comment is False
    for cell, value in {"inf": math.inf, "+Inf": math.inf, "-INF": -math.inf}.items():
        assert _dialect.number(cell, False) == (value, False)
    for cell, value in {"3 (was 4)": 3.0, "-2.5e1# off": -25.0, "7;": 7.0, "8/9": 8.0}.items():
        assert _dialect.number(cell, False) == (value, True)
    for cell in ("word", "1.2.3", "0x10", "1_000", "--1", "1e", "e5", ".", "5V"):
        assert _dialect.number(cell, False) is None


def test_lines_are_split_into_cells():
    for line, cut, wanted in (
        (" a , b ", ",", ["a", "b"]), ("a,,b,", ",", ["a", "", "b", ""]), ('"a,b", c', ",", ["a,b", "c"]),
        ("", ",", [""]),
        ("  a   b ", " ", ["a", "b"]), (' "a b"  c ', " ", ["a b", "c"]),
        ("a\tb c", "\t", ["a", "b c"]), ('x;"y;z"', ";", ["x", "y;z"]),
    ):  # fmt: skip
        assert _dialect.cells(line, cut) == wanted


# ----------------------------------------------------------------------------------------- whole files


def test_holes_words_and_comments_are_told_cell_by_cell(tmp_path):
    lines = [f"{k},{10 * k},{-k}" for k in range(40)]
    lines[2], lines[3], lines[4], lines[5] = "2,,-2", "3,bad,-3", "4,40 (was 50),-4", '5,"50",-5'
    lines[6], lines[7], lines[8], lines[9] = "6,no,-6", "7,nope,-7", "8,1_0,-8", "9,١,-9"
    got = table(tmp_path, "t,q,tau\n" + "\n".join(lines) + "\n")
    nan = np.nan
    assert np.array_equal(
        got.arrays["q"], [0, 10, nan, nan, 40, 50, nan, nan, nan, nan, *range(100, 400, 10)], equal_nan=True
    )
    assert got.arrays["t"].tolist() == list(range(40)) and got.arrays["tau"].tolist() == [
        -float(k) for k in range(40)
    ]
    assert got.notes == (
        "Column 'q' is no plain number in 6 cells (line 5: 'bad'; line 6: '40 (was 50)'; line 8: 'no').",
    )
    long = table(tmp_path, "t,q\n" + rows(9) + "9," + "w" * 60 + "\n" + rows(9, first=10))
    assert long.notes == (f"Column 'q' is no plain number in 1 cells (line 11: '{'w' * 40}').",)
    odd = table(tmp_path, "t,q\n" + rows(9) + "9,1.2.3\n" + rows(9, first=10))
    assert np.isnan(odd.arrays["q"][9])
    assert odd.notes == ("Column 'q' is no plain number in 1 cells (line 11: '1.2.3').",)


def test_columns_of_words_are_left_out_and_dates_are_times(tmp_path):
    got = table(
        tmp_path,
        "when,mode,q\n" + "".join(f"2024-03-0{1 + k}T10:00:00.250,{'go' * (k + 1)},{k}\n" for k in range(4)),
    )
    assert set(got.arrays) == {"when", "q"} and got.arrays["when"].tolist() == [86400.0 * k for k in range(4)]
    assert got.notes == ("Column 'mode' holds words or no plain numbers ('go') and was left out.",)
    mixed = "2024-03-01T10:00:00,0\n2024-03-01T10:00:01+00:00,1\n2024-03-01T10:00:02,2\n"
    got = table(tmp_path, "when,q\n" + mixed)
    assert set(got.arrays) == {"q"} and "'when' holds words" in got.notes[0]
    both = table(
        tmp_path,
        "a,b,q\n" + "".join(f"2024-03-01T10:00:0{k},x,{k}\n" for k in range(4)) + "2024-03-01T10:00:09,y\n",
    )
    assert both.arrays["a"].tolist() == [0, 1, 2, 3] and both.arrays["q"].tolist() == [0, 1, 2, 3]


def test_uneven_lines_are_dropped_and_named(tmp_path):
    def made(odd, count=60, fill="7,7,7"):
        lines = [fill if k in odd else f"{k},{k}.5" for k in range(count)]
        return table(tmp_path, "t,q\n" + "\n".join(lines) + "\n")

    for odd, told in (
        ((20,), "1 uneven lines were dropped (line 22)."), ((2, 4), "2 uneven lines were dropped (line 4, 6)."),
        ((2, 3, 4, 5, 6), "5 uneven lines were dropped (line 4, 5, 6, 7, 8)."),
        ((2, 3, 4, 5, 6, 7), "6 uneven lines were dropped (line 4, 5, 6, 7, 8, ...)."),
        ((59,), "The last line is cut and was dropped."),
        ((3, 59), "2 uneven lines were dropped (line 5, 61)."),
    ):  # fmt: skip
        got = made(odd)
        assert got.arrays["t"].tolist() == [k for k in range(60) if k not in odd]
        assert [note for note in got.notes if "dropped" in note] == [told]
    assert made((20,), fill="20,20.5,,").arrays["t"].size == 60  # empty cells beyond the last are none
    assert len(made(tuple(range(2, 13)), 60).arrays["t"]) == 49
    assert len(made(tuple(range(2, 14)), 60).arrays["t"]) == 48  # one line in five
    with pytest.raises(ReadError, match="13 of 60 lines do not have 2 cells"):
        made(tuple(range(2, 15)), 60)
    assert made((2,), 5).arrays["t"].tolist() == [0, 1, 3, 4]  # one is forgiven in a short table
    with pytest.raises(ReadError, match="2 of 8 lines do not have 2 cells"):
        made((2, 4), 8)
    blank = table(tmp_path, "t,q,u\n0,1,5\n\n1,2,5\n  \n2,3,5\n3,4,5\n4")
    assert blank.arrays["t"].tolist() == [0, 1, 2, 3] and blank.notes == (
        "The last line is cut and was dropped.",
    )


def test_a_table_that_turns_irregular_far_below(tmp_path):
    text = "t,q\n" + rows(8000)
    assert len(text) > 1 << 16
    assert table(tmp_path, text).arrays["t"].size == 8000
    for odd, size in (("8000,\n", 8001), ("8000,x\n", 8001), ("8000\n", 8000), ("8000,1,2\n", 8000)):
        got = table(tmp_path, text + odd + rows(3, first=8001))
        assert got.arrays["t"].size == size + 3
    narrow = table(tmp_path, "a b\n" + "".join(f"{k} {k}\n" for k in range(9000)) + "9 9 # said\n")
    assert narrow.arrays["a"].size == 9000 and "The last line is cut" in narrow.notes[0]
    latin = table(tmp_path, text.encode() + "8000,1 # ä\n".encode("latin-1"))
    assert latin.arrays["t"].size == 8001
    wide = table(tmp_path, "t q r\n" + "0 1\n1 2\n2 3\n")
    assert list(wide.arrays) == ["column_1", "column_2"]


def test_what_becomes_of_a_file(tmp_path):
    assert table(tmp_path, "t,q\n" + rows(3), max_columns=2).arrays["q"].tolist() == [0.5, 1.5, 2.5]
    with pytest.raises(FileTooLarge, match="3 columns"):
        table(tmp_path, "0,1,2\n1,2,3\n", max_columns=2)
    for empty in (b"", b"\n \t\r\n", b"\0" * 9):
        with pytest.raises(UnknownFormat, match="The file is empty"):
            table(tmp_path, empty)
    bare = table(tmp_path, "0,1,\n1,2,\n2,3,\n")
    assert bare.notes[0] == "The table has no header: its columns are called column_1, column_2 and so on."
    assert list(bare.arrays) == ["column_1", "column_2", "column_3"]
    got = table(tmp_path, "t,,q\n0,,1\n1,,2\n")  # a column without name and numbers
    assert list(got.arrays) == ["t", "q"] and got.notes == ()
    assert list(table(tmp_path, "t,,q\n0,,1\n1,5,2\n").arrays) == ["t", "column_2", "q"]
    comma = table(tmp_path, "t;q\ns;deg\n0,5;1\n1,5;2,25\n2,5;x\n3,5;4\n")
    assert comma.arrays["t"].tolist() == [0.5, 1.5, 2.5, 3.5] and comma.units == {"t": "s", "q": "deg"}
    assert np.array_equal(comma.arrays["q"], [1, 2.25, np.nan, 4], equal_nan=True)
    quoted = table(tmp_path, 't,q\n"0","1"\n"1","2"\n')
    assert quoted.arrays["q"].tolist() == [1, 2]
    assert table(tmp_path, "t\tq\n0\t1\n1\t\n2\t3\n").arrays["t"].tolist() == [0, 1, 2]
    assert table(tmp_path, "t q\n0 1\n1 x\n2  3\n").arrays["t"].tolist() == [0, 1, 2]


def counted(path, asked):
    """Read a table; return its columns and how often Python was called where `asked` says so."""
    calls = 0

    def count(frame, event, argument):
        nonlocal calls
        calls += event == "call" and asked(frame.f_code)

    before = sys.getprofile()
    sys.setprofile(count)
    try:
        return csv_.read(str(path), ReadOptions()).arrays, calls
    finally:
        sys.setprofile(before)


def test_regular_lines_are_not_read_cell_by_cell(tmp_path):
    """A log of an hour has millions of cells."""
    path = tmp_path / "t.csv"
    path.write_text("t,q\n" + rows(3000))
    found, calls = counted(path, lambda code: code.co_filename == csv_.__file__)
    assert found["t"].size == 3000 and calls < 100
    for cut, point in ((",", "."), (" ", "."), (";", ",")):
        lines = [f"{k}{cut}{k}{point}5" for k in range(3000)]
        lines[1500] = f"1500{cut}nan"
        path.write_text(f"t{cut}q\n" + "\n".join(lines))
        found, calls = counted(path, lambda code: code.co_name == "number")
        assert found["q"][2999] == 2999.5 and np.isnan(found["q"][1500]) and calls < 100


@pytest.mark.parametrize(
    ("cells", "q"),
    [
        ("{t:.3f};{q:.6f};{tau}", "1,970447"),  # a decimal comma in one column only
        ('{t:.3f},{q:.6f},"{tau}"', "1,970447"),
        ("{t:.3f}\t{q:.6f}\t{tau}", "0,970"),
    ],
)
def test_a_decimal_comma_in_one_column_is_one(tmp_path, cells, q):
    rows = "\n".join(cells.format(t=0.005 * k, q=0.1 + 0.01 * k, tau=q) for k in range(30))
    separator = cells[7]
    got = table(tmp_path, separator.join(("t", "q", "tau")) + "\n" + rows + "\n")
    assert got.arrays["tau"].tolist() == [float(q.replace(",", "."))] * 30 and got.arrays["q"][2] == 0.12


@pytest.mark.parametrize("tau", ["1,970", "1,970.447", "1 970.5", "1.970,4"])
def test_numbers_with_thousands_parted_are_not_cut_short(tmp_path, tau):
    rows = "\n".join(f"{0.005 * k:.3f};{0.1 + 0.01 * k:.6f};{tau}" for k in range(30))
    got = table(tmp_path, "t;q;tau\n" + rows + "\n")
    assert got.arrays.keys() == {"t", "q"}
    assert got.notes == (f"Column 'tau' holds words or no plain numbers ('{tau}') and was left out.",)


def test_rows_that_end_with_a_delimiter_keep_their_header(tmp_path):
    got = table(tmp_path, "t,q,tau\n" + "\n".join(f"{k},{k}.5,-{k}," for k in range(30)) + "\n")
    assert got.arrays.keys() == {"t", "q", "tau"} and got.arrays["tau"][3] == -3.0 and got.notes == ()
