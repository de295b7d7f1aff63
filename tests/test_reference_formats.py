"""Archives, MATLAB, HDF5, Parquet, JSON and folders: what is read, what is left out and said, and what is refused."""

import json
import math
import struct
import zipfile
import zlib

import numpy as np
import pytest

from backdrive.errors import (
    FileTooLarge,
    ForbiddenContent,
    IncompleteFile,
    MissingExtra,
    ReadError,
)
from backdrive.logs.log import Drive
from backdrive.logs.readers import (
    hdf5,
    json_,
    mat,
    npz,
    parquet,
)
from backdrive.logs.readers.columns import ReadOptions
from backdrive.logs.readers.limits import Limits

OPTIONS = ReadOptions()
Q = np.arange(12.0).reshape(6, 2)


def limited(**limits):
    return ReadOptions(limits=Limits(**limits))


# ------------------------------------------------------------------------------------------------ JSON


def of_json(tmp_path, content, options=OPTIONS):
    path = tmp_path / "a.json"
    path.write_bytes(content if isinstance(content, bytes) else json.dumps(content).encode())
    return json_.read(str(path), options)


def test_nested_json_has_dotted_names_five_deep(tmp_path):
    deep = {
        "a": {"b": {"c": {"d": {"in": [1, 2], "e": {"out": [3, 4]}}}}, "x": 2},
        "flag": False,
        "none": None,
        "word": "w",
    }
    got = of_json(tmp_path, deep)
    assert {name: value.tolist() for name, value in got.arrays.items()} == {
        "a.b.c.d.in": [1, 2],
        "a.x": [2.0],
        "flag": [0.0],
    }
    assert of_json(tmp_path, {"a": [1, 2]}).notes == ()
    for odd in (["x"], [[1], [1, 2]], [[[1]]], [None, None, "x"], [{"a": 1}], [10**400], [1, [2]]):
        assert of_json(tmp_path, {"t": [1], "odd": odd}).notes == (
            "'odd' is not numbers of one shape and was left out.",
        ), odd
    holes = of_json(
        tmp_path, {"a": [None, 1, None], "b": [None, [1, 2], None], "c": [None], "d": [True, False]}
    )
    assert np.array_equal(holes.arrays["a"], [np.nan, 1, np.nan], equal_nan=True)
    assert np.array_equal(holes.arrays["b"], [[np.nan] * 2, [1, 2], [np.nan] * 2], equal_nan=True)
    assert holes.arrays["d"].tolist() == [1, 0] and np.isnan(holes.arrays["c"]).all()
    assert of_json(tmp_path, {"a": [1], "b": [2]}, limited(max_columns=2)).arrays.keys() == {"a", "b"}
    with pytest.raises(FileTooLarge, match="2 columns"):
        of_json(tmp_path, {"a": [1], "b": [2]}, limited(max_columns=1))


def test_samples_that_lack_something(tmp_path):
    keys = "abcdefg"
    got = of_json(tmp_path, [{key: k for key in keys} for k in range(3)] + [{"a": 3}])
    assert got.notes == ("Some samples lack b, c, d, e, f: NaN there.",)
    assert np.array_equal(got.arrays["g"], [0, 1, 2, np.nan], equal_nan=True) and got.arrays[
        "a"
    ].tolist() == [0, 1, 2, 3]
    late = [{"a": 1}] * 999 + [{"a": 1, "b": 2}] + [{"a": 1, "c": 3}] * 2001
    got = of_json(tmp_path, late)
    assert set(got.arrays) == {"a", "b"}  # the first thousand say which there are
    assert of_json(tmp_path, [{"a": k} for k in range(3)]).notes == ()
    for key in ("entries", "samples", "data"):
        assert of_json(tmp_path, {key: [{"a": 1}, {"a": 2}], "b": [1]}).arrays.keys() == {"a"}
        assert of_json(tmp_path, {key: [1, 2]}).arrays[key].tolist() == [1, 2]
    mixed = of_json(tmp_path, {"data": [{"a": 1}, 2], "b": [1]})
    assert set(mixed.arrays) == {"b"} and "'data' is not numbers" in mixed.notes[0]


@pytest.mark.parametrize(
    ("raw", "cut"),
    [(b'{"t": [0, 1', True), (b'{"t": [0, 1]  ', True), (b'{"t": "ab', False), (b"", True), (b"[1, 2]xyz", False),
     (b"{'a': 1}", False),
     (b'{"a": 1, "b": oops, "c": 2}', False), (b"\xff\xff{", False), (b'[{"t": 1}, {"t"   ', True)],
)  # fmt: skip
def test_json_that_is_cut_ends_inside_a_value(tmp_path, raw, cut):
    with pytest.raises(ReadError, match="ends inside a value" if cut else "is not JSON") as error:
        of_json(tmp_path, raw)
    assert isinstance(error.value, IncompleteFile) is cut


def bam(**changes):
    loads = changes.pop("loads", [0, 885, 40000, 65535])
    entries = [
        {
            "timestamp": 0.1 * k,
            "position": 1.0 * k,
            "load": load,
            "goal_position": 2.0,
            "speed": 3.0,
            "temp": 30,
            "torque_enable": 1,
        }
        for k, load in enumerate(loads)
    ]
    for entry in entries:
        for key in changes.get("without", ()):
            entry.pop(key)
    return {"kp": 100, **changes.get("head", {}), "entries": entries}


def test_a_servo_of_bam_in_every_field(tmp_path):
    got = of_json(tmp_path, bam(loads=[0, 885, -885, 32767, 32768, 65535, 64651]))
    # signed 16 bit, in 1/885 of full; what is beyond 1.05 of full is none
    assert got.arrays["load"] == pytest.approx([0, 1, -1, np.nan, np.nan, -1 / 885, -1], nan_ok=True)
    assert got.notes[0].startswith("3 samples of load were read as the signed 16-bit")
    assert got.notes[1].startswith("2 samples of load lie beyond full duty") and len(got.notes) == 2
    assert got.channels == {
        "timestamp": "time", "position": "position", "speed": "velocity", "goal_position": "reference", "temp": "temperature",
        "load": "drive_input",
    }  # fmt: skip
    assert got.units == {
        "timestamp": "s",
        "position": "rad",
        "speed": "rad/s",
        "goal_position": "rad",
        "temp": "degC",
    }
    assert got.joints == ("joint_1",)
    assert got.drive == Drive(law="duty", gains=dict(got.drive.gains))
    assert dict(got.drive.gains) == pytest.approx(
        {"kp": 100.0, "duty_per_rad": 100 * 4096 / (2 * math.pi) / 256 / 885}
    )
    edge = of_json(tmp_path, bam(loads=[int(1.05 * 885), int(1.05 * 885) + 1, 0, 32767]))
    assert np.isnan(edge.arrays["load"]).tolist() == [False, True, False, True]
    plain = of_json(
        tmp_path,
        bam(
            loads=[1, 2],
            without=("speed", "temp", "torque_enable"),
            head={"vin": 7.5, "motor": "xl", "mass": 2},
        ),
    )
    assert plain.notes == ("Pendulum as recorded by BAM: mass 2, motor xl (mass in kg, length in m).",)
    assert (
        (plain.joints, plain.drive.gains["supply"]) == (("xl",), 7.5)
        and "speed" not in plain.channels
        and "temp" not in plain.units
    )
    assert "supply" not in of_json(tmp_path, bam(head={"vin": "x"})).drive.gains
    off = bam(loads=[1, 2, 3])
    off["entries"][1]["torque_enable"] = 0
    assert of_json(tmp_path, off).notes == ("The drive is off in 1 samples (torque_enable).",)
    for key in ("position", "load", "goal_position", "timestamp"):
        assert of_json(tmp_path, bam(without=(key,))).drive is None
    assert of_json(tmp_path, {**bam(), "kp": 1}).drive is not None
    none = bam()
    none.pop("kp")
    assert of_json(tmp_path, none).drive is None and of_json(tmp_path, bam()["entries"]).drive is None


# ------------------------------------------------------------------------------------------------ npz


def header_of(shape, descr="<f8", version=(1, 0), fortran=False):
    text = repr({"descr": descr, "fortran_order": fortran, "shape": shape}).encode()
    return b"\x93NUMPY" + bytes(version) + struct.pack("<H" if version == (1, 0) else "<I", len(text)) + text


def archive(path, stored=zipfile.ZIP_DEFLATED, **members):
    with zipfile.ZipFile(path, "w", stored) as zipped:
        for name, content in members.items():
            zipped.writestr(f"{name}.npy", content)
    return str(path)


def test_arrays_of_an_archive_are_their_headers_and_bytes(tmp_path):
    path, raw = tmp_path / "a.npz", Q.tobytes()
    for version in ((1, 0), (2, 0)):
        for fortran in (False, True):
            got = npz.read(
                archive(path, q=header_of((6, 2), version=version, fortran=fortran) + raw), OPTIONS
            )
            assert (
                got.arrays["q"].tolist() == Q.ravel().reshape((6, 2), order="F" if fortran else "C").tolist()
                and got.notes == ()
            )
    with pytest.raises(ReadError, match=r"header version \(3, 0\)"):
        npz.read(archive(path, q=header_of((6, 2), version=(3, 0)) + raw), OPTIONS)
    assert npz.read(archive(path, q=header_of((0, 2))), OPTIONS).arrays["q"].shape == (0, 2)
    words = npz.read(
        archive(path, q=header_of((2,), "<U4") + b"\0" * 32, t=header_of((1,)) + raw[:8]), OPTIONS
    )
    assert set(words.arrays) == {"t"} and words.notes == (
        "Array 'q' is not one- or two-dimensional numbers and was left out.",
    )
    with pytest.raises(
        IncompleteFile, match="Array 'q' ends after 40 of 96 bytes"
    ):  # told by the header to hold more
        npz.read(archive(path, q=header_of((12,)) + raw[:40]), OPTIONS)
    for shape in ((-1,), (2, -3)):
        with pytest.raises(ReadError, match="has shape"):
            npz.read(archive(path, q=header_of(shape) + raw), OPTIONS)
    with pytest.raises(FileTooLarge, match="claims shape"):
        npz.read(archive(path, q=header_of((30,)) + raw), OPTIONS)
    fits = len(header_of((20,)) + raw) // 8  # the header counts among the bytes that are there
    with pytest.raises(IncompleteFile):
        npz.read(archive(path, q=header_of((fits,)) + raw), OPTIONS)
    with zipfile.ZipFile(path, "w") as zipped:
        zipped.writestr("readme.txt", "x")
    with pytest.raises(ReadError, match="no .npy array"):
        npz.read(str(path), OPTIONS)
    path.write_bytes(b"PK\3\4" + b"x" * 50)
    with pytest.raises(IncompleteFile, match="no directory"):
        npz.read(str(path), OPTIONS)


def test_archives_are_limited_by_what_they_declare(tmp_path):
    path = tmp_path / "a.npz"
    one = header_of((6, 2)) + Q.tobytes()
    archive(path, zipfile.ZIP_STORED, a=one, b=one)
    assert len(npz.read(str(path), limited(max_bytes=2 * len(one), max_columns=2)).arrays) == 2
    with pytest.raises(FileTooLarge, match="The archive declares"):
        npz.read(str(path), limited(max_bytes=2 * len(one) - 1))
    with pytest.raises(FileTooLarge, match="2 arrays"):
        npz.read(str(path), limited(max_columns=1))
    assert len(npz.read(str(path), limited(ratio_floor=1, max_ratio=1.0)).arrays) == 2
    zeros = header_of((5000,)) + bytes(40000)
    archive(path, a=zeros)
    with pytest.raises(FileTooLarge, match="decompression bomb"):
        npz.read(str(path), limited(ratio_floor=1, max_ratio=2.0))
    raw = bytearray(archive(path, zipfile.ZIP_STORED, a=one) and path.read_bytes())
    raw[raw.index(b"NUMPY") + 100] ^= 1
    path.write_bytes(raw)
    with pytest.raises(IncompleteFile, match="Array 'a' is damaged"):
        npz.read(str(path), OPTIONS)
    raw = bytearray(archive(path, zipfile.ZIP_STORED, a=one) and path.read_bytes())
    raw[raw.index(b"PK\1\2") + 8] |= 1  # flag bit 0 of the directory: encrypted
    path.write_bytes(raw)
    with pytest.raises(ForbiddenContent, match="encrypted"):
        npz.read(str(path), OPTIONS)


# ------------------------------------------------------------------------------------------ MATLAB


def element(kind, content):
    return struct.pack("<II", kind, len(content)) + content + b"\0" * (-len(content) % 8 if kind != 15 else 0)


def matrix(name, numbers):
    """An array element of MAT-File Format, level 5: flags (class double), dimensions, name, real part."""
    name = name.encode()
    parts = (
        element(6, struct.pack("<II", 6, 0))
        + element(5, struct.pack("<ii", 1, len(numbers)))
        + element(1, name)
    )
    return element(14, parts + element(9, np.array(numbers, "<f8").tobytes()))


def mat_file(path, *elements):
    path.write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\1IM" + b"".join(elements))
    return str(path)


def packed(whole):
    return element(15, zlib.compress(whole))


def test_variables_of_matlab_byte_by_byte(tmp_path):
    path, one, two = tmp_path / "a.mat", matrix("q", [1.0, 2.0, 3.0]), matrix("tau", [4.0, 5.0])
    for elements in ((one, two), (packed(one), packed(two)), (one, packed(two))):
        got = mat.read(mat_file(path, *elements), OPTIONS)
        assert (
            got.arrays["q"].ravel().tolist() == [1, 2, 3]
            and got.arrays["tau"].ravel().tolist() == [4, 5]
            and got.notes == ()
        )
        declared = len(one) - 8 + len(two) - 8  # bytes that the tags of both declare
        assert len(mat.read(str(path), limited(max_bytes=declared, max_columns=2)).arrays) == 2
        with pytest.raises(FileTooLarge, match="The file declares"):
            mat.read(str(path), limited(max_bytes=declared - 1))
        with pytest.raises(FileTooLarge, match="2 variables"):
            mat.read(str(path), limited(max_columns=1))
        ratio = declared / path.stat().st_size
        assert len(mat.read(str(path), limited(ratio_floor=1, max_ratio=1.01 * ratio)).arrays) == 2
        with pytest.raises(FileTooLarge, match="bomb"):
            mat.read(str(path), limited(ratio_floor=1, max_ratio=0.99 * ratio))
    for missing in (1, 9, len(two) - 8):
        whole = mat_file(path, one, two) and path.read_bytes()
        path.write_bytes(whole[:-missing])
        at = 128 + len(one)
        with pytest.raises(IncompleteFile) as error:
            mat.read(str(path), OPTIONS)
        assert error.value.message == (
            f"A variable at byte {at} declares {len(two) - 8} bytes, but the file ends after {len(two) - 8 - missing}."
        )
    path.write_bytes((mat_file(path, one, two) and path.read_bytes())[: 128 + len(one) + 5])
    with pytest.raises(IncompleteFile, match="cut or damaged"):  # less than a tag is left
        mat.read(str(path), OPTIONS)
    with pytest.raises(ReadError, match="A compressed variable is damaged"):
        mat.read(mat_file(path, element(15, b"nonsense" * 4)), OPTIONS)
    path.write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + b"\1\0MI" + struct.pack(">II", 14, 500))
    with pytest.raises(IncompleteFile, match="byte 128 declares 500 bytes, but the file ends after 0"):
        mat.read(str(path), OPTIONS)


def test_what_matlab_saves_besides_numbers(tmp_path):
    from scipy.io import savemat

    path, deep = tmp_path / "a.mat", {"x": 1.0}
    for _ in range(17):
        deep = {"s": deep}
    content = {
        "q": Q,
        "word": "abc",
        "z": 1j,
        "cube": np.zeros((2, 2, 2)),
        "n": np.int16(7),
        "none": np.empty((0, 3)),
        "s": {"a": {"b": 2.0}},
    }
    savemat(path, content)
    got = mat.read(str(path), OPTIONS)
    assert set(got.arrays) == {"q", "n", "s.a.b"} and got.arrays["n"].tolist() == [7]
    assert got.notes == ("Left out, not numbers in one or two dimensions: word, z, cube, none.",)
    savemat(path, {f"w{k}": "x" for k in range(25)} | {"q": Q})
    assert (
        mat.read(str(path), OPTIONS)
        .notes[0]
        .endswith("dimensions: " + ", ".join(f"w{k}" for k in range(20)) + ".")
    )
    for levels, fits in ((15, True), (16, True), (17, False)):
        deep = {"x": 1.0}
        for _ in range(levels - 1):
            deep = {"s": deep}
        savemat(path, {"d": deep, "q": Q}, long_field_names=True)
        got = mat.read(str(path), OPTIONS)
        assert (f"d{'.s' * (levels - 1)}.x" in got.arrays) is fits
        assert fits or got.notes[0].endswith(f": d{'.s' * 16}.")


# ------------------------------------------------------------------------------------------ HDF5


def test_groups_links_and_sizes_of_hdf5(tmp_path):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["#refs#/x"], file["#subsystem#/x"], file["a/#refs#/y"] = Q, Q, Q[:, 0]
        file["q"], file["s"] = Q, 3.0
        for name, value in (
            ("m", Q),
            ("row", Q[:1]),
            ("column", Q[:, :1]),
            ("one", Q[:1, :1]),
            ("flat", Q[:, 0]),
        ):
            file[f"m/{name}" if name != "m" else "full"] = value
            file[f"m/{name}" if name != "m" else "full"].attrs["MATLAB_class"] = np.bytes_("double")
        file.create_dataset("z", data=Q, compression="gzip", shuffle=True, fletcher32=True)
    got = hdf5.read(str(path), OPTIONS)
    assert (
        set(got.arrays) == {"a.#refs#.y", "q", "s", "full", "m.row", "m.column", "m.one", "m.flat", "z"}
        and got.notes == ()
    )
    assert got.arrays["full"].tolist() == Q.T.tolist() and got.arrays["m.row"].tolist() == [0, 1]
    assert got.arrays["m.column"].tolist() == Q[:, 0].tolist() and got.arrays["m.one"].tolist() == [0.0]
    assert (
        got.arrays["m.flat"].tolist() == Q[:, 0].tolist()
        and got.arrays["s"].tolist() == [3.0]
        and got.arrays["z"].tolist() == Q.tolist()
    )
    assert len(hdf5.read(str(path), limited(max_columns=9)).arrays) == 9
    with pytest.raises(FileTooLarge, match="9 datasets"):
        hdf5.read(str(path), limited(max_columns=8))
    for kind in ("char", "cell", "function_handle", "struct"):
        with h5py.File(path, "w") as file:
            file["q"], file["x"] = Q, Q
            file["x"].attrs["MATLAB_class"] = np.bytes_(kind)
        got = hdf5.read(str(path), OPTIONS)
        assert set(got.arrays) == {"q"} and got.notes == (
            "Left out, not numbers in one or two dimensions: x.",
        )
    with h5py.File(path, "w") as file:
        for k in range(25):
            file[f"w{k:02d}"] = "x"
        file["q"] = np.zeros((0, 2))
    with pytest.raises(ReadError, match="no numeric dataset"):
        hdf5.read(str(path), OPTIONS)
    with h5py.File(path, "a") as file:
        file["r"] = Q
    assert (
        hdf5.read(str(path), OPTIONS)
        .notes[0]
        .endswith(": " + ", ".join(f"w{k:02d}" for k in range(20)) + ".")
    )
    for depth, fits in ((16, True), (17, False)):
        with h5py.File(path, "w") as file:
            file["/".join("g" * depth) + "/q"] = Q
        if fits:
            assert list(hdf5.read(str(path), OPTIONS).arrays) == [".".join("g" * depth) + ".q"]
        else:
            with pytest.raises(ForbiddenContent, match="deeper than 16"):
                hdf5.read(str(path), OPTIONS)
    with h5py.File(path, "w") as file:
        file.create_dataset("x", data=Q, compression="lzf")
    with pytest.raises(ForbiddenContent, match="filter 32000, which needs a plug-in"):
        hdf5.read(str(path), OPTIONS)
    with h5py.File(path, "w") as file:
        file["a/q"] = Q
        file["b"] = file["a"]
    with pytest.raises(ForbiddenContent, match="'b' leads to a group that was reached before"):
        hdf5.read(str(path), OPTIONS)
    with h5py.File(path, "w", libver="latest") as file:
        file["q"] = Q
    assert hdf5.read(str(path), OPTIONS).arrays["q"].tolist() == Q.tolist()


def test_hdf5_that_another_program_has_locked_is_read(tmp_path):
    h5py, fcntl = pytest.importorskip("h5py"), pytest.importorskip("fcntl")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["q"] = Q
    with open(tmp_path / "a.h5", "rb") as other:
        fcntl.flock(other, fcntl.LOCK_EX)
        assert hdf5.read(str(tmp_path / "a.h5"), OPTIONS).arrays["q"].tolist() == Q.tolist()


def test_hdf5_that_is_cut_or_damaged(tmp_path):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["q"] = np.arange(5000.0)
    whole = path.read_bytes()
    path.write_bytes(whole[:-100])
    with pytest.raises(IncompleteFile, match="The file is cut"):
        hdf5.read(str(path), OPTIONS)
    path.write_bytes(b"\x89HDF\r\n\x1a\n" + b"\xff" * 300)
    with pytest.raises(ReadError, match="damaged"):
        hdf5.read(str(path), OPTIONS)


# ------------------------------------------------------------------------------------------ Parquet


def test_types_of_parquet(tmp_path):
    pa = pytest.importorskip("pyarrow")
    from decimal import Decimal

    from pyarrow import parquet as pq

    path = tmp_path / "a.parquet"
    start = 1_700_000_000_000_000_000
    data = {
        "stamp": (pa.array([start, start + 1, None, start + 5], pa.timestamp("ns")), [0, 1, np.nan, 5], "ns"),
        "gap": (pa.array([None, 7, 8, 9], pa.duration("us")), [np.nan, 0, 1, 2], "us"),
        "late": (pa.array([3, 4, 5, 8], pa.timestamp("s")), [0, 1000, 2000, 5000], "ms"),  # the format has no seconds
        "dec": (pa.array([Decimal("1.5"), None, Decimal("2.5"), Decimal("3")], pa.decimal128(5, 2)), [1.5, np.nan, 2.5, 3], ""),
        "i": (pa.array([1, 2, None, 4], pa.int64()), [1, 2, np.nan, 4], ""),
        "b": (pa.array([True, None, False, True]), [1, np.nan, 0, 1], ""),
        "f": (pa.array([1.5, 2.5, 3.5, 4.5], pa.float32()), [1.5, 2.5, 3.5, 4.5], ""),
        "fixed": (pa.array([[1, 2]] * 4, pa.list_(pa.int32(), 2)), [[1, 2]] * 4, ""),
        "list": (pa.array([[k, k + 0.5] for k in range(4)]), [[k, k + 0.5] for k in range(4)], ""),
        "large": (pa.array([[k] for k in range(4)], pa.large_list(pa.float64())), [[0], [1], [2], [3]], ""),
        "ragged": (pa.array([[1.0], [2.0, 3.0, 4.0], [5.0, 6.0], [7.0, 8.0]]), None, ""),
        "uneven": (pa.array([[1.0], [2.0], [3.0], [4.0, 5.0]]), None, ""),
        "words": (pa.array([["a"], ["b"], ["c"], ["d"]]), None, ""),
        "holes": (pa.array([[1.0], None, [2.0], [3.0]]), None, ""),
        "word": (pa.array(list("abcd")), None, ""),
    }  # fmt: skip
    table = pa.table({name: column for name, (column, _, _) in data.items()})
    for group in (4, 1):  # in one piece and in several
        pq.write_table(table, path, row_group_size=group)
        got = parquet.read(str(path), OPTIONS)
        for name, (_, wanted, unit) in data.items():
            assert (name in got.arrays) is (wanted is not None), name
            assert wanted is None or np.array_equal(got.arrays[name].astype(float), wanted, equal_nan=True), (
                name
            )
            assert got.units.get(name, "") == unit
        assert [note.split("'")[1] for note in got.notes] == ["ragged", "uneven", "words", "holes", "word"]
    assert got.notes[-1] == "Column 'word' (string) is not numbers and was left out."
    leaves = len(data)
    assert len(parquet.read(str(path), limited(max_columns=leaves)).arrays) == 10
    with pytest.raises(FileTooLarge, match=f"{leaves} columns"):
        parquet.read(str(path), limited(max_columns=leaves - 1))
    twice = pa.Table.from_arrays([pa.array([1.0]), pa.array([2.0])], names=["a", "a"])
    pq.write_table(twice, path)
    assert {k: v.tolist() for k, v in parquet.read(str(path), OPTIONS).arrays.items()} == {
        "a": [1.0],
        "a#2": [2.0],
    }


def test_tables_of_parquet_are_limited_by_their_footer(tmp_path):
    pa = pytest.importorskip("pyarrow")
    from pyarrow import parquet as pq

    path = tmp_path / "a.parquet"
    table = pa.table({"a": np.zeros(4000), "b": np.arange(4000.0)})
    pq.write_table(table, path, compression="none", use_dictionary=False)
    meta = pq.ParquetFile(path).metadata.row_group(0)
    stored = meta.column(0).total_uncompressed_size + meta.column(1).total_uncompressed_size
    assert stored > 4000 * 2 * 8 and len(parquet.read(str(path), limited(max_bytes=stored)).arrays) == 2
    for most in (stored - 1, 4000 * 2 * 8 - 1):
        with pytest.raises(FileTooLarge, match="The table declares"):
            parquet.read(str(path), limited(max_bytes=most))
    size = path.stat().st_size
    assert len(parquet.read(str(path), limited(ratio_floor=1, max_ratio=1.0)).arrays) == 2
    pq.write_table(pa.table({"a": np.zeros(40000)}), path)  # packed, it declares rows only
    size, rows = path.stat().st_size, 40000 * 8
    assert parquet.read(str(path), limited(max_bytes=rows, ratio_floor=rows)).arrays["a"].size == 40000
    with pytest.raises(FileTooLarge, match="The table declares"):
        parquet.read(str(path), limited(max_bytes=rows - 1))
    with pytest.raises(FileTooLarge, match="bomb"):
        parquet.read(str(path), limited(ratio_floor=1, max_ratio=0.9 * rows / size))
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(IncompleteFile, match="The footer cannot be read"):
        parquet.read(str(path), OPTIONS)
    pq.write_table(pa.table({"a": np.arange(1000.0)}), path, use_dictionary=False)
    raw = bytearray(path.read_bytes())
    raw[30:600] = b"\xff" * 570
    path.write_bytes(raw)
    with pytest.raises(IncompleteFile, match="A page is damaged"):
        parquet.read(str(path), OPTIONS)


@pytest.mark.parametrize(("reader", "library"), [(hdf5, "h5py"), (parquet, "pyarrow.parquet")])
def test_a_reader_without_its_library_names_the_extra(monkeypatch, reader, library):
    import sys

    reader.prepare()
    monkeypatch.setitem(sys.modules, library, None)
    for deed in (reader.prepare, lambda: reader.read("absent", OPTIONS)):
        with pytest.raises(MissingExtra, match="is not installed"):
            deed()
