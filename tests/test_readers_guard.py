"""Hostile files and dying children: the parent always answers, with a typed error and in time."""

import json
import os
import signal
import sqlite3
import subprocess
import sys
import threading
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks" / "evidence"))
from _log_files import WRITERS, motion, write_csv, write_mcap
from _reader_fuzz import fuzz

from backdrive.errors import (
    BackdriveError,
    FileTooLarge,
    ForbiddenContent,
    IncompleteFile,
    MappingError,
    ReaderCrash,
    ReadError,
    ReaderTimeout,
)
from backdrive.logs.readers import guard as guard_module
from backdrive.logs.readers import peek, read_columns, read_log
from backdrive.logs.readers.columns import Columns, ReadOptions, frames, plain, unframe
from backdrive.logs.readers.guard import Guard, default_guard
from backdrive.logs.readers.limits import MIB, Limits

SMALL = Limits(max_bytes=MIB)


def gone(pid: int, within: float = 5.0) -> bool:
    """Tell whether a process that is not our child ends in time."""
    until = time.monotonic() + within
    while time.monotonic() < until:
        try:
            state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
            if state == "Z":
                return True
            os.kill(pid, 0)
        except (OSError, ProcessLookupError):
            return True
        time.sleep(0.02)
    return False


# --- the child -------------------------------------------------------------------------------------------------------


def test_one_child_is_reused_from_file_to_file(log_file):
    with Guard() as guard:
        size = log_file.stat().st_size
        first = guard.read(log_file, "npz", ReadOptions(), size=size)
        pid = guard.pid
        second = guard.read(log_file, "npz", ReadOptions(), size=size)
        assert guard.pid == pid
        assert guard.restarts == 1
        assert np.array_equal(first.arrays["position"], second.arrays["position"])
    assert guard.pid is None
    assert gone(pid)


def test_a_child_that_dies_at_work_is_a_typed_error_and_is_replaced(log_file, slow_file):
    with Guard() as guard:
        guard.read(log_file, "npz", ReadOptions(), size=1000)
        pid = guard.pid
        killer = threading.Timer(0.1, os.kill, (pid, signal.SIGSEGV))
        killer.start()
        with pytest.raises(ReaderCrash, match="SIGSEGV"):
            guard.read(slow_file, "json_", ReadOptions(), size=slow_file.stat().st_size)
        killer.join()
        assert guard.read(log_file, "npz", ReadOptions(), size=1000).arrays
        assert guard.pid != pid


def test_a_child_that_died_while_idle_is_not_noticed(log_file):
    with Guard() as guard:
        for _ in range(2):
            guard.start()
            os.kill(guard.pid, signal.SIGKILL)
            time.sleep(0.05)
            assert guard.read(log_file, "npz", ReadOptions(), size=1000).arrays


def test_parsing_that_takes_too_long_is_a_typed_error_in_time(log_file, slow_file):
    limits = Limits(max_seconds=0.1)
    read_log(log_file)
    begun = time.monotonic()
    with pytest.raises(ReaderTimeout, match=r"longer than 0\.1 s"):
        read_log(slow_file, limits=limits)
    assert time.monotonic() - begun < 2.1
    assert len(read_log(log_file)) == len(motion()["time"])


def test_a_child_that_does_not_answer_at_all_is_given_up(log_file, monkeypatch):
    monkeypatch.setattr(guard_module, "_START_SECONDS", 0.2)
    with Guard() as guard:
        guard.start()
        os.kill(guard.pid, signal.SIGSTOP)
        with pytest.raises(ReaderTimeout):
            guard.read(log_file, "npz", ReadOptions(), size=1000)
        assert guard.pid is None


def test_a_child_that_hangs_is_ended_in_time(log_file, tmp_path):
    os.mkfifo(tmp_path / "never.json")  # nobody writes to it, so opening it takes for ever
    with Guard() as guard:
        begun = time.monotonic()
        with pytest.raises(ReaderTimeout):
            guard.read(tmp_path / "never.json", "json_", ReadOptions(limits=Limits(max_seconds=0.2)), size=0)
        assert time.monotonic() - begun < 2.2
        assert guard.read(log_file, "npz", ReadOptions(), size=1000).arrays


def test_a_child_that_hangs_ends_though_its_parent_was_killed(tmp_path):
    os.mkfifo(tmp_path / "never.json")
    text = (
        "import sys\n"
        "from backdrive.logs.readers.guard import default_guard\n"
        "from backdrive.logs.readers.columns import ReadOptions\n"
        "from backdrive.logs.readers.limits import Limits\n"
        "default_guard().start()\n"
        "print(default_guard().pid, flush=True)\n"
        "default_guard().read(sys.argv[1], 'json_', ReadOptions(limits=Limits(max_seconds=0.7)), size=0)\n"
    )
    with script(text, str(tmp_path / "never.json")) as process:
        pid = int(process.stdout.readline())
        time.sleep(0.5)
        process.kill()
    assert gone(pid)


def test_a_fifo_is_not_a_file(tmp_path):
    os.mkfifo(tmp_path / "a.csv")
    with pytest.raises(ReadError, match="it is a FIFO, not a file"):
        read_log(tmp_path / "a.csv")


def test_the_limit_follows_the_size_of_the_file():
    assert Limits().seconds_for(0) == pytest.approx(5.5)
    assert Limits().seconds_for(50_000_000) == pytest.approx(15.5)
    assert (
        Limits().memory_for(0)
        < Limits().memory_for(10 * MIB)
        < Limits().memory_for(10**12)
        == Limits().max_memory
    )


def test_memory_is_bounded(tmp_path):
    path = tmp_path / "a.json"
    path.write_text("[" + "{}," * 3_000_000 + "{}]")
    with pytest.raises(FileTooLarge, match="more memory than the limits allow"):
        read_log(path, limits=Limits(max_memory=64 * MIB))


def test_several_threads_may_read(log_file):
    found = []
    threads = [threading.Thread(target=lambda: found.append(len(read_log(log_file)))) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [len(motion()["time"])] * 4


def script(text: str, *arguments: str) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-W", "error", "-c", text, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


READ = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # though it may be ignored here
from backdrive.logs.readers import guard, read_log
read_log(sys.argv[1])
print(guard.default_guard().pid, flush=True)
"""


def test_nothing_is_left_behind_or_warned_about(log_file):
    process = script(READ, str(log_file))
    out, err = process.communicate(timeout=30)
    assert process.returncode == 0
    assert err == ""
    assert gone(int(out))


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_the_child_ends_with_its_parent(log_file, slow_file, number):
    process = script(
        READ + "print('again', flush=True); read_log(sys.argv[2])", str(log_file), str(slow_file)
    )
    with process:
        pid = int(process.stdout.readline())
        assert process.stdout.readline() == "again\n"
        time.sleep(0.05)
        os.killpg(process.pid, number) if number == signal.SIGINT else process.kill()
        assert process.wait(10) != 0
        assert ("KeyboardInterrupt" in process.stderr.read()) == (number == signal.SIGINT)
    assert gone(pid)


def test_a_fork_gets_a_child_of_its_own(log_file):
    text = READ + (
        "import os\n"
        "pid = os.fork()\n"
        "read_log(sys.argv[1])\n"
        "print(guard.default_guard().pid, flush=True)\n"
        "if pid: sys.exit(os.waitpid(pid, 0)[1])\n"
    )
    process = script(text, str(log_file))
    out, err = process.communicate(timeout=30)
    assert err == ""
    assert process.returncode == 0
    before, *after = map(int, out.split())
    assert len(set(after)) == 2
    assert before in after


@pytest.mark.parametrize(
    "deed",
    [
        "import subprocess; subprocess.run(['true'])",
        "import os; os.remove('x')",
        "import pickle; pickle.loads(b'cos\\nsystem\\n.')",
    ],
)
def test_a_parser_may_not_be_led_to_other_deeds(deed):
    text = f"from backdrive.logs.readers import _worker as w; w.lock(); w._parsing.append('x'); {deed}"
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=False)
    assert "ForbiddenContent: The file led its parser to" in done.stderr


def test_a_parser_may_not_write_files(tmp_path):
    write = f"f = open({str(tmp_path / 'x')!r}, 'w'); f.write('x'); f.close()"
    text = f"from backdrive.logs.readers import _worker as w; w.lock(); {write}"
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=False)
    assert "File too large" in done.stderr
    assert (tmp_path / "x").read_bytes() == b""


# --- what comes back through the pipe --------------------------------------------------------------------------------


def sent(columns: Columns, limits: Limits = Limits()) -> Columns:  # noqa: B008
    raw = b"".join(bytes(part) for part in frames(columns))
    length = int.from_bytes(raw[:4], "little")
    at = 4 + length

    def receive(view):
        nonlocal at
        view[:] = raw[at : at + len(view)]
        at += len(view)

    received = unframe(json.loads(raw[4 : 4 + length]), receive, limits)
    assert at == len(raw)
    return received


def test_every_plain_type_survives_the_pipe():
    arrays = {
        kind: np.array([[0, 1], [1, 1]]).astype(kind)
        for kind in ("?", "i1", "u1", "<i2", "<u4", "<i8", "<u8", "<f4", "<f8")
    }
    arrays["empty"] = np.empty((0, 3))
    back = sent(
        Columns(arrays=arrays, units={"i1": "deg"}, joints=("a",), channels={"i1": "position"}, notes=("n",))
    )
    assert all(
        np.array_equal(back.arrays[k], v) and back.arrays[k].dtype == v.dtype for k, v in arrays.items()
    )
    assert (back.units, back.joints, back.channels, back.notes) == (
        {"i1": "deg"},
        ("a",),
        {"i1": "position"},
        ("n",),
    )


def test_what_is_no_plain_number_does_not_enter_the_pipe():
    assert plain(np.array(["a"])) is None
    assert plain(np.array([1j])) is None
    assert plain(np.zeros((2, 3, 4))) is None
    assert plain(np.float64(3)).shape == (1,)
    assert plain(np.zeros((5, 1, 2))).shape == (5, 2)
    assert plain(np.arange(3, dtype=">f8")).dtype.str == "<f8"
    assert plain(np.zeros(3, np.float16)).dtype.str == "<f8"


GOOD = {"arrays": [["a", "<f8", [1]]], "units": {}, "joints": [], "channels": {}, "drive": None, "notes": []}


@pytest.mark.parametrize(
    "change",
    [
        {"arrays": [["a", "|O", [1]]]},
        {"arrays": [["a", "<f8", [-1]]]},
        {"arrays": [["a", "<f8", [1, 2, 3]]]},
        {"arrays": [["a", "<f8", "x"]]},
        {"arrays": [["a", "<f8"]]},
        {"arrays": 7},
        {"units": None},
        {"drive": {"law": "magic", "gains": {}}},
        {"drive": {"law": "duty", "gains": {"k": "x"}}},
        {"notes": 3},
    ],
)
def test_a_hostile_answer_is_not_believed(change):
    with pytest.raises(ReaderCrash, match="not a log"):
        unframe({**GOOD, **change}, lambda view: None, Limits())


def test_an_answer_may_not_be_larger_than_the_limits():
    with pytest.raises(FileTooLarge):
        unframe({**GOOD, "arrays": [["a", "<f8", [1 << 40]]]}, lambda view: None, Limits())
    with pytest.raises(FileTooLarge):
        unframe({**GOOD, "arrays": [["a", "<f8", [1]]] * 10}, lambda view: None, Limits(max_columns=9))


def test_names_cannot_steer_a_terminal(tmp_path):
    np.savez(tmp_path / "a.npz", **{"t": np.arange(3.0), "q\x1b[31m": np.arange(3.0)})
    assert [name for name, _, _ in peek(tmp_path / "a.npz")] == ["t", r"q\x1b[31m"]
    with pytest.raises(MappingError) as caught:
        read_log(tmp_path / "a.npz")
    assert "\x1b" not in str(caught.value)


# --- hostile files ---------------------------------------------------------------------------------------------------


def npy(header: bytes, data: bytes = b"") -> bytes:
    header = header.ljust(118) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + data


def archive(path: Path, content: bytes, **options) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as zipped:
        zipped.writestr("q.npy", content, **options)
    return path


def test_pickles_are_refused(tmp_path):
    np.savez(tmp_path / "a.npz", q=np.array([{"a": 1}], object))
    with pytest.raises(ForbiddenContent, match="pickled Python objects"):
        read_log(tmp_path / "a.npz")


@pytest.mark.parametrize(
    ("header", "error"),
    [
        (b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }", FileTooLarge),
        (b"{'descr': '<f8', 'fortran_order': False, 'shape': (-5,), }", ReadError),
        (b"{'descr': '|O', 'fortran_order': False, 'shape': (1,), }", ForbiddenContent),
        (b"{'descr': '<f8', 'fortran_order': False, 'shape': __import__('os'), }", ReadError),
        (b"{'descr': [('a','<f8')], 'fortran_order': False, 'shape': (1,), }", BackdriveError),
    ],
)
def test_headers_of_arrays_are_checked_first(tmp_path, header, error):
    with pytest.raises(error):
        read_log(archive(tmp_path / "a.npz", npy(header, b"\x00" * 16)))


def test_a_zip_bomb_is_refused(tmp_path):
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (20000000,), }"
    path = archive(tmp_path / "a.npz", npy(header, b"\x00" * 160_000_000))
    assert path.stat().st_size < 200_000
    with pytest.raises(FileTooLarge, match="decompression bomb"):
        read_log(path)


def hdf5(path: Path) -> Path:
    import h5py

    with h5py.File(path, "w") as file:
        file["t"] = np.arange(4.0)
        file["q"] = np.arange(4.0)
    return path


@pytest.mark.parametrize("how", ["external link", "soft link", "external storage", "virtual", "loop"])
def test_hdf5_may_not_lead_elsewhere(tmp_path, how):
    import h5py

    secret = tmp_path / "secret.bin"
    secret.write_bytes(b"secret!!" * 4)
    other, path = hdf5(tmp_path / "other.h5"), hdf5(tmp_path / "a.h5")
    with h5py.File(path, "a") as file:
        if how == "external link":
            file["x"] = h5py.ExternalLink(str(other), "/q")
        elif how == "soft link":
            file["x"] = h5py.SoftLink("/q")
        elif how == "external storage":
            file.create_dataset("x", (4,), "f8", external=[(str(secret), 0, 32)])
        elif how == "virtual":
            layout = h5py.VirtualLayout((4,), "f8")
            layout[:] = h5py.VirtualSource(str(other), "q", (4,))
            file.create_virtual_dataset("x", layout)
        else:
            file["group/inner"] = file["/"]
    with pytest.raises(ForbiddenContent, match=r"'x'|'group"):
        read_log(path)


def test_hdf5_may_not_declare_terabytes(tmp_path):
    import h5py

    with h5py.File(hdf5(tmp_path / "a.h5"), "a") as file:
        file.create_dataset("x", (10**12,), "f8", chunks=(1000,))
    assert (tmp_path / "a.h5").stat().st_size < 20_000
    with pytest.raises(FileTooLarge, match="MiB"):
        read_log(tmp_path / "a.h5")


@pytest.mark.parametrize("name", ["parquet", "mat", "npz", "hdf5"])
def test_declared_sizes_are_bounded(tmp_path, name):
    suffix, write, _ = WRITERS[name]
    path = tmp_path / f"a{suffix}"
    write(path, {key: np.zeros_like(value) for key, value in motion(30_000).items()}, 1)
    with pytest.raises(FileTooLarge):
        read_log(path, limits=SMALL)
    with pytest.raises(FileTooLarge, match="bomb"):
        read_log(path, limits=Limits(ratio_floor=1000, max_ratio=0.5))
    assert read_columns(path).arrays


def test_a_chunk_may_not_unpack_to_more_than_it_declares(tmp_path):
    import zstandard

    path = tmp_path / "a.mcap"
    write_mcap(path, motion(), 1)
    raw = path.read_bytes()
    at = raw.index(b"zstd") - 4 - 4 - 8  # uncompressed size, checksum, length of the name
    declared = int.from_bytes(raw[at : at + 8], "little")
    assert zstandard.frame_content_size(raw[raw.index(b"zstd") + 12 :]) == declared
    path.write_bytes(raw[:at] + (declared - 10).to_bytes(8, "little") + raw[at + 8 :])
    with pytest.raises(FileTooLarge, match=f"unpacks to {declared}"):
        read_log(path)
    path.write_bytes(raw[:at] + (1 << 50).to_bytes(8, "little") + raw[at + 8 :])
    with pytest.raises(FileTooLarge):
        read_log(path)


def test_a_database_with_a_view_in_place_of_its_messages_is_refused(tmp_path):
    base = sqlite3.connect(tmp_path / "a.db3")
    base.execute("CREATE TABLE topics(id, name, type, serialization_format)")
    base.execute("INSERT INTO topics VALUES(1, '/js', 'sensor_msgs/msg/JointState', 'cdr')")
    endless = "WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x+1 FROM c) "
    endless += "SELECT x AS id, 1 AS topic_id, x AS timestamp, x AS data FROM c"
    base.execute(f"CREATE VIEW messages AS {endless}")
    base.commit()
    base.close()
    with pytest.raises(ReadError, match="not a ROS 2 bag"):
        read_log(tmp_path / "a.db3")


def test_json_without_end_is_refused(tmp_path):
    (tmp_path / "a.json").write_text("[" * 200_000)
    with pytest.raises(ForbiddenContent, match="nested too deeply"):
        read_log(tmp_path / "a.json")


def test_text_that_would_take_a_careless_pattern_for_ever(tmp_path):
    for text in (
        "1" * 50_000,
        " " * 60_000 + "x",
        "t," + "[" * 60_000 + "\n0,1\n1,2\n",
        "t,q" + " " * 60_000 + "(\n0,1\n1,2\n",
    ):
        (tmp_path / "a.csv").write_text(text)
        begun = time.monotonic()
        with pytest.raises(BackdriveError):
            read_log(tmp_path / "a.csv")
        assert time.monotonic() - begun < 2.0


def test_too_many_columns_are_refused(tmp_path):
    np.savez(tmp_path / "a.npz", **{f"x{i}": np.zeros(2) for i in range(50)})
    with pytest.raises(FileTooLarge, match="50 arrays"):
        read_log(tmp_path / "a.npz", limits=Limits(max_columns=40))


def test_a_file_larger_than_allowed_is_not_opened(tmp_path):
    write_csv(tmp_path / "a.csv", motion())
    with pytest.raises(FileTooLarge, match="more than the limit of 100"):
        read_log(tmp_path / "a.csv", limits=Limits(max_file_bytes=100))


def test_an_encrypted_bag_is_refused(tmp_path):
    fields = b"".join(
        len(f).to_bytes(4, "little") + f for f in (b"op=\x03", b"encryptor=rosbag/AesCbcEncryptor")
    )
    (tmp_path / "a.bag").write_bytes(
        b"#ROSBAG V2.0\n" + len(fields).to_bytes(4, "little") + fields + b"\x00" * 4
    )
    with pytest.raises(ForbiddenContent, match="encrypted"):
        read_log(tmp_path / "a.bag")


@pytest.mark.parametrize("name", WRITERS)
def test_damaged_files_never_bring_anything_but_typed_errors(name):
    found = fuzz(name, 60, seed=3)
    assert (found["untyped"], found["hangs"], found["parent_deaths"], found["examples"]) == (0, 0, 0, [])
    assert sum(found["counts"].values()) == 60


def test_truncated_means_truncated(tmp_path):
    for name in ("npz", "parquet", "mat", "mcap", "db3", "bag", "json", "hdf5"):
        suffix, write, _ = WRITERS[name]
        path = tmp_path / f"a{suffix}"
        write(path, motion(), 0)
        path.write_bytes(path.read_bytes()[: 600 if name == "mat" else int(0.4 * path.stat().st_size)])
        try:
            log = read_log(path)
        except IncompleteFile:
            continue
        assert name == "mcap"  # gives what it can
        assert any("cut or damaged" in note for note in log.notes)


def test_the_shared_guard_is_one():
    assert default_guard() is default_guard()
