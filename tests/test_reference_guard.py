"""From a file to its columns: formats and folders, the pipe between the processes, and what the parsing one may use."""

import fcntl
import io
import json
import os
import resource
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from backdrive import errors
from backdrive.errors import (
    FileTooLarge,
    ForbiddenContent,
    MissingExtra,
    ReaderCrash,
    ReadError,
    ReaderTimeout,
    UnknownFormat,
)
from backdrive.logs.log import CHANNELS, Drive
from backdrive.logs.readers import _formats, _worker, columns, guard, peek, read_columns, read_log, read_logs
from backdrive.logs.readers.columns import Columns, ReadOptions
from backdrive.logs.readers.guard import Guard
from backdrive.logs.readers.limits import Limits

OPTIONS = ReadOptions()
Q = np.arange(12.0).reshape(6, 2)


# ------------------------------------------------------------------------------------- what goes on


@pytest.mark.parametrize(
    "kind", ["|b1", "|i1", "|u1", "<i2", ">i2", "<u4", ">i8", "<f4", ">f4", "<f8", ">f8", "<f2", "<f16"]
)
def test_numbers_of_every_type_go_on_as_plain_ones(kind):
    try:
        given = np.array([[0, 1], [1, 0]]).astype(kind)
    except TypeError:
        pytest.skip("this machine has no such type")
    got = columns.plain(given)
    assert got.tolist() == given.tolist() and got.flags.c_contiguous
    assert got.dtype.str == ("<f8" if kind in ("<f2", "<f16") else kind.replace(">", "<"))


def test_shapes_that_are_plain():
    for shape, wanted in (
        ((), (1,)),
        ((3,), (3,)),
        ((2, 3), (2, 3)),
        ((1, 3), (1, 3)),
        ((2, 1, 3), (2, 3)),
        ((1, 1, 4), (4,)),
        ((1, 1, 1), (1,)),
        ((2, 3, 2), None),
        ((2, 1, 3, 2), None),
        ((0, 2), (0, 2)),
    ):
        got = columns.plain(np.ones(shape))
        assert (None if got is None else got.shape) == wanted
    for odd in (
        np.array(["x"]),
        np.array([1j]),
        np.array([None]),
        np.array(["2024-01-01"], "M8[s]"),
        np.zeros(2, "V3"),
    ):
        assert columns.plain(odd) is None
    assert columns.plain(np.asfortranarray(Q)).flags.c_contiguous


def unframed(limits=Limits(), **changes):  # noqa: B008
    told = {
        "arrays": [["a", "<f8", [2]]],
        "units": {},
        "joints": [],
        "channels": {},
        "drive": None,
        "notes": [],
        **changes,
    }

    def receive(view):
        view[:] = bytes(range(len(view)))

    return columns.unframe(told, receive, limits)


def test_what_the_parsing_process_says_is_checked():
    drive = {"law": "voltage", "gains": {"k": 2}}
    channels = {"a": "time", **{name: name for name in CHANNELS}, "x": "evil"}
    got = unframed(
        drive=drive,
        channels=channels,
        units={"a\x1b": "d\x1b"},
        joints=["j\x1b"],
        notes=["n\x1b" + "x" * 2000] * 300,
    )
    assert (
        got.drive == Drive(law="voltage", gains={"k": 2.0})
        and got.units == {"a\\x1b": "d\\x1b"}
        and got.joints == ("j\\x1b",)
    )
    assert got.channels == {"a": "time", **{name: name for name in CHANNELS}}
    assert len(got.notes) == 200 and got.notes[0] == "n\\x1b" + "x" * 998
    assert got.arrays["a"].tobytes() == bytes(range(16)) and got.arrays["a"].shape == (2,)
    same = unframed(arrays=[["a", "<f8", [1]], ["a", "<i2", [2, 1]], ["a", "|u1", [0]]])
    assert [(k, v.shape, v.dtype.str) for k, v in same.arrays.items()] == [
        ("a", (1,), "<f8"),
        ("a'", (2, 1), "<i2"),
        ("a''", (0,), "|u1"),
    ]
    for law in ("torque", "velocity", "position", "voltage", "duty"):
        assert unframed(drive={"law": law, "gains": {}}).drive.law == law
    two = [["a", "<f8", [3]], ["b", "<i2", [2, 5]]]
    assert len(unframed(Limits(max_bytes=44, max_columns=2), arrays=two).arrays) == 2
    for limits in (Limits(max_bytes=43), Limits(max_columns=1)):
        with pytest.raises(FileTooLarge):
            unframed(limits, arrays=two)
    for odd in (
        [["a", "<f8", []]],
        [["a", "<f8", [1, 1, 1]]],
        [["a", "<f8", [2, -1]]],
        [["a", "<c8", [1]]],
        [["a", "<f8", [2], 1]],
    ):
        with pytest.raises(ReaderCrash, match="not a log"):
            unframed(arrays=odd)


def test_columns_in_frames():
    given = Columns(
        arrays={"a": Q.T, "b": np.empty((0, 2))},
        units={"a": "deg"},
        joints=("x", "y"),
        channels={"a": "position"},
        drive=Drive(law="duty", gains={"k": 2.0}),
        notes=("n",),
    )
    head, *bodies = [bytes(part) for part in columns.frames(given)]
    assert int.from_bytes(head[:4], "little") == len(head) - 4
    assert json.loads(head[4:]) == {
        "arrays": [["a", "<f8", [2, 6]], ["b", "<f8", [0, 2]]],
        "units": {"a": "deg"},
        "joints": ["x", "y"],
        "channels": {"a": "position"},
        "drive": {"law": "duty", "gains": {"k": 2.0}},
        "notes": ["n"],
        "origin": {},
    }
    assert bodies == [Q.T.tobytes()]


# ------------------------------------------------------------------------------------- files and folders


@pytest.mark.parametrize(
    ("at", "kind"),
    [(0, "hdf5"), (512, "hdf5"), (1024, "hdf5"), (2048, "hdf5"), (1, "csv"), (511, "csv"), (4096, "csv")],
)
def test_where_hdf5_begins(tmp_path, at, kind):
    path = tmp_path / "a.csv"
    path.write_bytes(b" " * at + b"\x89HDF\r\n\x1a\n" + b"x" * 20)
    assert _formats.recognise(path).name == kind


@pytest.mark.parametrize("suffix", [".gz", ".bz2", ".xz", ".zst", ".zip", ".7z", ".GZ"])
def test_compressed_files_are_told_from_unknown_ones(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    path.write_bytes(b"x")
    with pytest.raises(UnknownFormat, match="is compressed"):
        _formats.recognise(path)


CSV = "t,q\n0,1\n1,2\n2,4\n"


def test_folders_hold_logs_of_one_kind_bags_or_nothing(tmp_path):
    (tmp_path / "b10.csv").write_text(CSV)
    (tmp_path / "b9.csv").write_text(CSV.replace("4", "5"))
    (tmp_path / "B.CSV").write_text(CSV)
    (tmp_path / "notes.md").write_text("x")
    (tmp_path / "sub.csv").mkdir()
    read = [log.sources[0].path.rpartition("/")[2] for log in read_logs(str(tmp_path), guarded=False)]
    assert read == ["B.CSV", "b9.csv", "b10.csv"]
    assert len(read_logs([tmp_path / "b9.csv", tmp_path], guarded=False)) == 4
    other = tmp_path / "other"
    other.mkdir()
    (other / "x.json").write_text(json.dumps({"t": [0, 1], "q": [1, 2]}))
    assert read_log(other, guarded=False).position[:, 0].tolist() == [1, 2]  # the only one
    assert peek(other, guarded=False) == [("t", (2,), "int64"), ("q", (2,), "int64")]
    empty = tmp_path / "empty"
    empty.mkdir()
    for deed in (read_logs, read_log):
        with pytest.raises(UnknownFormat, match=r"holds no log. Suffixes that are looked for: .npz .parquet"):
            deed(empty, guarded=False)
    (empty / "metadata.yaml").write_text("x")
    with pytest.raises(ReadError, match="no .mcap or .db3 beside it"):
        read_log(empty, guarded=False)
    for name in ("r2", "r10"):
        (tmp_path / "bags" / name).mkdir(parents=True)
        (tmp_path / "bags" / name / "metadata.yaml").write_text("x")
        (tmp_path / "bags" / name / "x.mcap").write_bytes(b"\x89MCAP0\r\n")
    from backdrive.logs.readers import _expand

    assert [p.name for p in _expand(tmp_path / "bags", None)] == ["r2", "r10"]
    with pytest.raises(ReadError, match="No log was named"):
        read_logs([])


def test_the_size_of_a_file_is_limited_before_it_is_read(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(CSV)
    for read in (read_log, read_columns):
        read(path, guarded=False, limits=Limits(max_file_bytes=len(CSV)))
        with pytest.raises(
            FileTooLarge, match=f"has {len(CSV)} bytes, more than the limit of {len(CSV) - 1}"
        ):
            read(path, guarded=False, limits=Limits(max_file_bytes=len(CSV) - 1))
    os.truncate(path, 0)
    with pytest.raises(UnknownFormat, match="is empty"):
        read_log(path, guarded=False)


def test_an_error_names_the_file_and_keeps_its_cause(tmp_path):
    path = tmp_path / "a.json"
    path.write_text("{'a'}")
    with pytest.raises(ReadError) as error:
        read_columns(path, guarded=False)
    assert error.value.message.startswith(f"{path}: This is not JSON") and isinstance(
        error.value.__cause__, ValueError
    )
    assert error.value.data == {"path": str(path)} and error.value.remedy.startswith("Save it again")


def test_names_are_listed_with_or_without_blanks(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t,q1,q2\n0,1,2\n1,2,3\n")
    for names in ("x, y", ["x", "y"], ("x", "y")):
        assert read_log(path, guarded=False, names=names).names == ("x", "y")


# -------------------------------------------------------------------------------------- the processes


@pytest.mark.parametrize(
    ("raised", "seen", "words"),
    [
        (MemoryError(), FileTooLarge, "more memory than the limits allow"),
        (RecursionError(), ForbiddenContent, "is nested too deeply"),
        (FileNotFoundError(2, "x", "gone.csv"), ReadError, "gone.csv does not exist"),
        (ValueError("x" * 400), ReadError, f"cannot be read as json (ValueError: {'x' * 300})."),
        (errors.UnknownFormat("as it was", remedy="so"), UnknownFormat, "as it was"),
        (MissingExtra("as it was", remedy="so"), MissingExtra, "as it was"),
    ],
)
def test_whatever_goes_wrong_in_a_reader_is_a_typed_error(monkeypatch, raised, seen, words):
    from backdrive.logs.readers import json_

    def fail(path, options):
        raise raised

    monkeypatch.setattr(json_, "read", fail)
    with pytest.raises(seen) as error:
        _worker.parse("a.json", "json_", OPTIONS)
    assert type(error.value) is seen and words in error.value.message
    assert error.value is raised or error.value.__cause__ is raised


CHILD = """
import json, os, sys
out = os.fdopen(os.dup(1), "wb", buffering=0)
def answer(content, more=b"", length=None):
    raw = content if isinstance(content, bytes) else json.dumps(content).encode()
    out.write((len(raw) if length is None else length).to_bytes(4, "little") + raw + more)
line = json.loads(sys.stdin.readline())
"""
GOOD = {"arrays": [["a", "<f8", [1]]], "units": {}, "joints": [], "channels": {}, "drive": None, "notes": []}


def answered(monkeypatch, text, limits=Limits()):  # noqa: B008
    """What the parent makes of a child that answers as `text` has it."""
    monkeypatch.setattr(guard, "_START", CHILD + text)
    with Guard() as one:
        try:
            return one.read("x", "json_", ReadOptions(limits=limits), size=0), one
        finally:
            assert one.pid is None or text.endswith("stay")


READY = "answer({'ready': True})\n"


def test_answers_of_a_child_are_believed_as_far_as_they_can_be(monkeypatch):
    stay = "import time; time.sleep(9) # stay"
    got, one = answered(monkeypatch, READY + f"answer({GOOD!r}, b'\\0' * 8)\n" + stay)
    assert got.arrays["a"].tolist() == [0.0] and one.restarts == 1
    for text, kind, words in (
        ("answer(b'', length=(1 << 26) + 1)", ReaderCrash, "answered nonsense"),
        ("answer(b'nonsense')", ReaderCrash, "answered nonsense"),
        ("answer([1])", ReaderCrash, "answered nonsense"),
        ("answer(b'[' * 100000)", ReaderCrash, "answered nonsense"),
        (READY + "answer({'arrays': 5})", ReaderCrash, "not a log"),
        (READY + f"answer({GOOD!r}, b'1234'); sys.exit(3)", ReaderCrash, "died (exit code 3)"),
        ("sys.exit(5)", ReaderCrash, "died (exit code 5)"),
        ("os.kill(os.getpid(), 11)", ReaderCrash, "died (SIGSEGV)"),
    ):
        with pytest.raises(kind) as error:
            answered(monkeypatch, text)
        assert words in error.value.message, text


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("ReadError", ReadError),
        ("ForbiddenContent", ForbiddenContent),
        ("MissingExtra", MissingExtra),
        ("MappingError", errors.MappingError),
        ("InvalidInput", errors.InvalidInput),
        ("BackdriveError", ReadError),
        ("annotations", ReadError),
        ("visible", ReadError),
        ("WriteErrors", ReadError),
        ("__name__", ReadError),
        (None, ReadError),
    ],
)
def test_only_known_errors_of_a_child_are_raised(monkeypatch, name, kind):
    said = {"error": name, "message": "m\x1b" + "x" * 3000, "remedy": "r\x1b" + "y" * 3000}
    for before in ("", READY):
        with pytest.raises(errors.BackdriveError) as error:
            answered(monkeypatch, before + f"answer({said!r})\nimport time; time.sleep(9) # stay")
        assert type(error.value) is kind
        assert error.value.message == "m\\x1b" + "x" * 1998 and error.value.remedy == "r\\x1b" + "y" * 1998


def test_a_child_that_is_slow_is_given_up_in_time(monkeypatch):
    limits = Limits(max_seconds=0.2)
    begun = time.monotonic()
    with pytest.raises(ReaderTimeout, match=r"longer than 0.2 s, the limit for 0 bytes"):
        answered(monkeypatch, READY + "import time; time.sleep(9)", limits)
    with pytest.raises(ReaderTimeout):  # header and bytes together
        answered(monkeypatch, READY + f"answer({GOOD!r}, b'1234'); import time; time.sleep(9)", limits)
    assert time.monotonic() - begun < 5.0


def test_a_child_is_told_all_of_a_request_and_little_of_the_environment(monkeypatch, tmp_path):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setenv("SECRET", "x")
    text = READY + (
        "notes = [json.dumps(line), json.dumps(dict(os.environ)), json.dumps(sys.argv[1:])]\n"
        f"answer({{**{GOOD!r}, 'notes': notes}}, b'\\0' * 8)\nimport time; time.sleep(9) # stay"
    )
    monkeypatch.setattr(columns, "clean", lambda text, longest=300: text)
    options = ReadOptions(topic="/t", joints=("j",), parts=("p",), limits=Limits(max_columns=7))
    monkeypatch.setattr(guard, "_START", CHILD + text)
    with Guard() as one:
        line, environment, arguments = map(json.loads, one.read("/x/y", "json_", options, size=9).notes)
    assert (line["path"], line["module"], line["size"], line["topic"], line["joints"], line["parts"]) == (
        "/x/y",
        "json_",
        9,
        "/t",
        ["j"],
        ["p"],
    )
    assert (
        line["limits"]["max_columns"] == 7
        and "SECRET" not in environment
        and environment["TMPDIR"] == str(tmp_path)
    )
    for name, value in (
        ("OPENBLAS_NUM_THREADS", "1"),
        ("OMP_NUM_THREADS", "1"),
        ("MKL_NUM_THREADS", "1"),
        ("LC_ALL", "C.UTF-8"),
        ("ARROW_DEFAULT_MEMORY_POOL", "system"),
    ):
        assert environment[name] == value
    home = os.path.dirname(os.path.dirname(errors.__file__))
    paths = [path for path in sys.path if path]
    assert json.loads(arguments[0]) == paths + [home] * (home not in paths)


def test_a_child_finds_the_package_that_its_parent_has(monkeypatch, tmp_path):
    home = os.path.dirname(os.path.dirname(errors.__file__))
    (tmp_path / "backdrive").mkdir()
    (tmp_path / "backdrive" / "__init__.py").write_text(
        "raise SystemExit(7)"
    )  # another one, further down the path
    path = tmp_path / "a.json"
    path.write_text('{"t": [0, 1]}')
    rest = [place for place in sys.path if place and place != home]
    for places in ([home, str(tmp_path), *rest], ["", home, str(tmp_path), *rest]):
        monkeypatch.setattr(sys, "path", places)
        with Guard() as one:
            assert one.read(path, "json_", OPTIONS, size=20).arrays["t"].tolist() == [0, 1]
    monkeypatch.setattr(
        sys, "path", [place for place in rest if not os.path.isdir(os.path.join(place, "backdrive"))]
    )
    with Guard() as one:  # not on the path at all
        assert one.read(path, "json_", OPTIONS, size=20).arrays["t"].tolist() == [0, 1]


def test_a_guard_that_is_forgotten_leaves_its_child_alone(monkeypatch):
    one = Guard()
    one.start()
    process, pid = one._process, one.pid
    one.start()
    assert one.pid == pid and one.restarts == 1
    if hasattr(fcntl, "F_GETPIPE_SZ"):  # large arrays in fewer turns
        assert fcntl.fcntl(process.stdout.fileno(), fcntl.F_GETPIPE_SZ) == 1 << 20
    one.forget()
    assert one.pid is None and process.stdin.closed and process.stdout.closed
    os.kill(pid, 0)  # it is there
    os.kill(pid, signal.SIGKILL)
    os.waitpid(pid, 0)
    one.kill()
    one.close()  # of none: nothing happens
    one.start()
    other = one._process
    one.kill()
    assert other.wait(5) == -signal.SIGKILL
    one.start()
    assert one.pid not in (None, other.pid) and one.restarts == 3
    one.close()
    monkeypatch.setattr(sys, "executable", "/nonexistent")
    with pytest.raises(ReaderCrash, match="cannot be started"):
        one.start()


def test_the_worker_answers_line_by_line(tmp_path):
    """Spoken to as the guard does: ready, then the columns or an error; what a library prints is not among the answers."""
    good, bad = tmp_path / "a.json", tmp_path / "b.json"
    good.write_text('{"t": [0, 1], "q": [2, 3]}')
    bad.write_text("nonsense")
    limits = {"max_columns": 5, "max_seconds": 20.0, "max_memory": 100 << 20}
    lines = [
        {
            "path": str(path),
            "module": module,
            "size": 30,
            "topic": None,
            "joints": [],
            "parts": [],
            "limits": limits,
        }
        for path, module in ((good, "json_"), (bad, "json_"), (good, "csv_"), (good, "json_"))
    ]
    code = """
import json, os, resource, signal, sys
signal.signal(signal.SIGALRM, signal.SIG_IGN)
from backdrive import errors
from backdrive.logs.readers import _worker, csv_, json_
read = json_.read
def told(where):
    left = signal.getitimer(signal.ITIMER_REAL)[0]
    used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize() if os.path.exists("/proc") else 0
    state = [where, left, list(_worker._parsing), signal.getsignal(signal.SIGALRM) == signal.SIG_DFL,
             signal.getsignal(signal.SIGINT) == signal.SIG_IGN, resource.getrlimit(resource.RLIMIT_FSIZE) == (0, 0),
             resource.getrlimit(resource.RLIMIT_AS)[0] - used if used else 100 << 20]
    sys.stderr.write(json.dumps(state) + "\\n")
def loud(path, options):
    os.write(1, b"noise")
    print("noise", flush=True)
    told("read")
    return read(path, options)
def missing():
    raise errors.MissingExtra("no csv", remedy="get it")
json_.read, json_.prepare, csv_.prepare = loud, lambda: told("prepare"), missing
_worker.main()
"""
    sent = "".join(json.dumps(line) + "\n" for line in lines).encode()
    done = subprocess.run([sys.executable, "-c", code], input=sent, capture_output=True, check=True)
    stream = io.BytesIO(done.stdout)

    def head():
        return json.loads(stream.read(int.from_bytes(stream.read(4), "little")))

    for line in lines:
        if line["module"] == "csv_":
            assert head() == {"error": "MissingExtra", "message": "no csv", "remedy": "get it"}
            continue
        assert head() == {"ready": True}
        told = head()
        if line["path"] == str(bad):
            assert told["error"] == "ReadError" and "not JSON" in told["message"]
            assert told["remedy"].startswith("Save it again")
        else:
            assert [array[:2] for array in told["arrays"]] == [["t", "<i8"], ["q", "<i8"]]
            assert np.frombuffer(stream.read(32), "<i8").tolist() == [0, 1, 2, 3]
    assert stream.read() == b""
    states = [json.loads(state) for state in done.stderr.splitlines()]
    assert [state[0] for state in states] == ["prepare", "read"] * 3
    for k, (where, left, parsing, alarm, interrupt, bounded, room) in enumerate(states):
        assert alarm and interrupt and bounded is (k > 0)
        if where == "read":  # the kernel's alarm a second behind the limit
            assert (
                20.5 < left <= 21.0
                and parsing == [str(bad if k == 3 else good)]
                and 60 << 20 < room <= 100 << 20
            )
        else:
            assert left == 0.0 and parsing == []


def test_what_the_worker_gives_up():
    code = (
        "import resource, signal, sys, os\nfrom backdrive.logs.readers import _worker\n"
        "_worker.lock(); _worker._bound_memory(_worker._memory_bound(64 << 20))\n"
        "used = int(open('/proc/self/statm').read().split()[0]) * resource.getpagesize() if os.path.exists('/proc') else 0\n"
        "print(resource.getrlimit(resource.RLIMIT_CORE), resource.getrlimit(resource.RLIMIT_FSIZE), sys.dont_write_bytecode)\n"
        "soft, hard = resource.getrlimit(resource.RLIMIT_AS)\nprint(soft - used if used else 64 << 20, hard)\n"
        "_worker._bound_memory(_worker._memory_bound(32 << 20))\nprint(soft - resource.getrlimit(resource.RLIMIT_AS)[0])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    first, second, third = done.stdout.splitlines()
    assert first == "(0, 0) (0, 0) True"
    more, hard = map(int, second.split())
    assert 56 << 20 < more <= 64 << 20 and hard == resource.getrlimit(resource.RLIMIT_AS)[1]
    assert 24 << 20 < int(third) <= 32 << 20


def test_the_worker_may_do_at_import_what_no_file_may(tmp_path):
    for parsing, refused in (("", False), ("_worker._parsing.append('x');", True)):
        code = "import os; from backdrive.logs.readers import _worker; _worker.lock(); "
        code += f"{parsing} os.rename({str(tmp_path / 'a')!r}, 'b')"
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
        assert ("ForbiddenContent: The file led its parser to os.rename." in done.stderr) is refused
        assert ("FileNotFoundError" in done.stderr) is not refused
