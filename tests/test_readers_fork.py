"""A child a file from one server: answers as ever, a hostile file's child dies alone, and nothing outlives its parent."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks" / "evidence"))
from _log_files import WRITERS, motion, write_npz

from backdrive.errors import FileTooLarge, ForbiddenContent, ReaderCrash, ReadError, ReaderTimeout
from backdrive.logs.readers import guard, read_columns, read_log, read_logs
from backdrive.logs.readers.columns import ReadOptions
from backdrive.logs.readers.fork_server import ForkServer, child_a_file
from backdrive.logs.readers.limits import MIB, Limits

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="processes are looked at in /proc")


@pytest.fixture
def server():
    with ForkServer() as server:
        yield server


def children(pid: int) -> list[int]:
    try:
        return [int(n) for n in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    except OSError:  # it has ended
        return []


def wait_for(what, seconds: float = 10.0):
    until = time.monotonic() + seconds
    while not (answer := what()) and time.monotonic() < until:
        time.sleep(0.01)
    return answer


def gone(pid: int) -> bool:
    """Tell whether a process ends in time; one that nobody has waited for yet has ended."""

    def ended() -> bool:
        try:
            return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
        except OSError:
            return True

    return bool(wait_for(ended, 5.0))


@pytest.mark.parametrize("name", WRITERS)
def test_answers_are_those_of_the_reused_child(tmp_path, server, name):
    suffix, write, _ = WRITERS[name]
    path = tmp_path / f"a{suffix}"
    write(path, motion(), 0)
    usual = read_columns(path)
    with guard.use(server):
        forked = [read_columns(path) for _ in range(2)]
    for columns in forked:
        assert list(columns.arrays) == list(usual.arrays)
        assert all(np.array_equal(columns.arrays[k], v, equal_nan=True) for k, v in usual.arrays.items())
        assert (columns.units, columns.joints, columns.notes) == (usual.units, usual.joints, usual.notes)
    assert server.restarts == 1
    if sys.platform == "linux":
        assert len(os.listdir(f"/proc/{server.pid}/task")) == 1  # a thread would not survive a fork
        assert children(server.pid) == []


def test_errors_are_typed_and_leave_the_server(tmp_path, log_file, server):
    np.savez(tmp_path / "pickled.npz", q=np.array([{"a": 1}], object))
    (tmp_path / "deep.json").write_text("[" * 200_000)
    (tmp_path / "large.json").write_text("[" + "{}," * 3_000_000 + "{}]")
    with guard.use(server):
        with pytest.raises(ForbiddenContent, match="pickled"):
            read_log(tmp_path / "pickled.npz")
        with pytest.raises(ForbiddenContent, match="nested"):
            read_log(tmp_path / "deep.json")
        with pytest.raises(FileTooLarge, match="more memory than the limits allow"):
            read_log(tmp_path / "large.json", limits=Limits(max_memory=64 * MIB))
        with pytest.raises(ReadError):
            read_log(tmp_path / "none.npz")
        assert len(read_log(log_file)) == len(motion()["time"])
    assert server.restarts == 1


@LINUX
@pytest.mark.parametrize("number", [signal.SIGSEGV, signal.SIGKILL])
def test_a_child_that_dies_dies_alone(log_file, slow_file, server, number):
    server.read(log_file, "npz", ReadOptions(), size=1000)
    pid = server.pid

    def kill():
        for child in wait_for(lambda: children(pid)):
            os.kill(child, number)

    killer = threading.Thread(target=kill)
    killer.start()
    with pytest.raises(ReaderCrash, match=number.name):
        server.read(slow_file, "json_", ReadOptions(), size=slow_file.stat().st_size)
    killer.join()
    assert server.read(log_file, "npz", ReadOptions(), size=1000).arrays
    assert (server.pid, server.restarts) == (pid, 1)


@LINUX
def test_each_file_has_a_child_of_its_own(slow_file, server):
    server.start()
    pid, seen, done = server.pid, set(), threading.Event()

    def watch():
        while not done.wait(0.01):
            seen.update(children(pid))

    watcher = threading.Thread(target=watch)
    watcher.start()
    limits = Limits(max_seconds=60.0)
    for _ in range(2):
        server.read(slow_file, "json_", ReadOptions(limits=limits), size=slow_file.stat().st_size)
    done.set()
    watcher.join()
    assert len(seen) == 2
    assert server.pid == pid


@LINUX
def test_a_child_that_hangs_is_ended_in_time_with_its_server(tmp_path, log_file, server):
    os.mkfifo(tmp_path / "never.json")  # nobody writes to it, so opening it takes for ever
    server.read(log_file, "npz", ReadOptions(), size=1000)
    seen: list[int] = []
    pid = server.pid
    watcher = threading.Thread(target=lambda: seen.extend(wait_for(lambda: children(pid))))
    watcher.start()
    begun = time.monotonic()
    with pytest.raises(ReaderTimeout, match="0.3 s"):
        server.read(tmp_path / "never.json", "json_", ReadOptions(limits=Limits(max_seconds=0.3)), size=0)
    assert time.monotonic() - begun < 5.0
    watcher.join()
    assert seen
    assert all(gone(child) for child in seen)
    assert server.read(log_file, "npz", ReadOptions(), size=1000).arrays
    assert server.restarts == 2


@LINUX
def test_a_server_that_died_while_idle_is_replaced(log_file, server):
    for _ in range(2):
        server.start()
        os.kill(server.pid, signal.SIGKILL)
        assert gone(server.pid)
        assert server.read(log_file, "npz", ReadOptions(), size=1000).arrays


@LINUX
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_all_end_with_the_parent(tmp_path, log_file, number):
    os.mkfifo(tmp_path / "never.json")
    text = (
        "import signal, sys\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "from backdrive.logs.readers import read_log\n"
        "from backdrive.logs.readers.columns import ReadOptions\n"
        "from backdrive.logs.readers.fork_server import child_a_file\n"
        "with child_a_file() as server:\n"
        "    read_log(sys.argv[1])\n"
        "    print(server.pid, flush=True)\n"
        "    server.read(sys.argv[2], 'json_', ReadOptions(), size=0)\n"
    )
    command = [sys.executable, "-c", text, str(log_file), str(tmp_path / "never.json")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        pid = int(process.stdout.readline())
        below = wait_for(lambda: children(pid))
        os.kill(process.pid, number)
        assert process.wait(10) != 0
    assert below
    assert all(gone(one) for one in (pid, *below))


def test_several_files_are_read_by_a_child_each(tmp_path, monkeypatch):
    for name in ("a", "b"):
        write_npz(tmp_path / f"{name}.npz", motion())
    used = []
    original = ForkServer.read
    monkeypatch.setattr(
        ForkServer, "read", lambda self, *a, **k: (used.append(a), original(self, *a, **k))[1]
    )
    assert len(read_logs(tmp_path)) == len(used) == 2
    assert len(read_logs(tmp_path / "a.npz")) == 1
    assert len(used) == 2
    with child_a_file() as server:
        assert guard.default_guard() is server
    assert guard.default_guard() is not server


def test_nothing_is_left_behind_or_warned_about(log_file):
    text = (
        "import sys\nfrom backdrive.logs.readers import read_log\n"
        "from backdrive.logs.readers.fork_server import child_a_file\n"
        "with child_a_file() as server:\n    read_log(sys.argv[1])\n    print(server.pid)\n"
    )
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", text, str(log_file)], capture_output=True, text=True, check=True
    )
    assert done.stderr == ""
    assert gone(int(done.stdout))
