"""Tests for _files.py and all that goes through it: only regular files are replaced or read, whole, and nothing stays behind."""

from __future__ import annotations

import errno
import os
import re
import signal
import socket
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from backdrive import _files, load_model
from backdrive._files import check_writable, read_whole, write_together, write_whole
from backdrive.errors import FileTooLarge, InvalidInput, MissingExtra, ReadError, WriteError, install
from backdrive.logs.readers import read_log
from backdrive.plans import load_plan
from backdrive.plans.limits import read_limits
from backdrive.robot import load_robot
from backdrive.tuning import load_tunings

ROOT = os.geteuid() == 0


def device(path: Path) -> Path:
    """Make a harmless device node where the system allows it, else a link to one."""
    try:
        os.mknod(path, 0o20666, os.makedev(1, 3))
    except OSError:
        path.symlink_to("/dev/null")
    return path


def fifo(path: Path) -> Path:
    os.mkfifo(path)
    return path


def fifo_link(path: Path) -> Path:
    os.mkfifo(path.with_suffix(".fifo"))
    path.symlink_to(path.with_suffix(".fifo"))
    return path


def folder(path: Path) -> Path:
    path.mkdir()
    return path


def listener(path: Path) -> Path:
    before = os.getcwd()
    os.chdir(path.parent)  # names of sockets are short
    with socket.socket(socket.AF_UNIX) as made:
        made.bind(path.name)
    os.chdir(before)
    return path


def ring(path: Path) -> Path:
    path.symlink_to(path.name)
    return path


def dangling(path: Path) -> Path:
    path.symlink_to("nowhere")
    return path


STRANGE = {
    "a device": device,
    "a FIFO": fifo,
    "a folder": folder,
    "a socket": listener,
    "a FIFO.": fifo_link,
    "a link that leads to no file": ring,
    "does not exist": dangling,
}


def names(path: Path) -> list[str]:
    return sorted(p.name for p in path.iterdir())


def state(path: Path) -> tuple[int, int]:
    found = os.lstat(path)
    return found.st_mode, found.st_ino


@pytest.mark.parametrize("what", STRANGE)
def test_what_is_no_regular_file_is_never_replaced(tmp_path, what):
    path = STRANGE[what](tmp_path / "out.json")
    before, there = state(path), names(tmp_path)
    for refused in (lambda: write_whole(path, "new"), lambda: check_writable(path)):
        with pytest.raises(WriteError, match=what):
            refused()
    assert state(path) == before
    assert names(tmp_path) == there


READERS = {
    "model": load_model,
    "plan": load_plan,
    "limits": read_limits,
    "robot": load_robot,
    "tuning": load_tunings,
    "log": read_log,
}


@pytest.mark.parametrize("what", [w for w in STRANGE if w not in ("does not exist",)])
@pytest.mark.parametrize("reader", READERS)
def test_what_is_no_regular_file_is_never_read(tmp_path, reader, what):
    path = STRANGE[what](tmp_path / "in.json")
    done = []

    def read():
        with pytest.raises(ReadError, match=r"Cannot read|does not exist|holds no log"):
            READERS[reader](path)
        done.append(True)

    thread = threading.Thread(target=read, daemon=True)
    thread.start()
    thread.join(20.0)  # a FIFO without a writer holds whoever opens it, for ever
    assert done


@pytest.mark.parametrize("reader", READERS)
def test_endless_and_huge_files_are_refused_unread(tmp_path, reader):
    with pytest.raises(ReadError, match="device"):
        READERS[reader]("/dev/zero")
    huge = tmp_path / "huge.csv"
    with open(huge, "wb") as stream:
        stream.truncate(1 << 40)  # of holes: it takes no room, and half an hour to read
    with pytest.raises(ReadError, match=r"larger than|more than the limit"):
        READERS[reader](huge)


def test_a_bag_whose_part_is_a_fifo_does_not_hang(tmp_path):
    (tmp_path / "metadata.yaml").write_text("x")
    os.mkfifo(tmp_path / "bag_0.mcap")
    with pytest.raises(ReadError, match="a FIFO"):
        read_log(tmp_path)


def test_reading_is_bounded_and_names_the_class_that_was_asked_for(tmp_path):
    path = tmp_path / "x"
    path.write_bytes(b"0123456789")
    assert read_whole(path, 10) == b"0123456789"
    with pytest.raises(FileTooLarge, match="larger than 9 bytes"):
        read_whole(path, 9)
    with pytest.raises(ReadError, match="null byte"):
        read_whole("a\0b", 9)
    with pytest.raises(WriteError, match="null byte"):
        write_whole("a\0b", "")


def test_a_link_stays_and_its_target_is_replaced(tmp_path):
    (tmp_path / "real").mkdir()
    target = tmp_path / "real" / "m.json"
    target.write_text("old")
    link, second = tmp_path / "link.json", tmp_path / "second.json"
    link.symlink_to("real/m.json")
    second.symlink_to("link.json")
    assert write_whole(second, "new") == second
    assert (link.is_symlink(), second.is_symlink(), target.read_text()) == (True, True, "new")
    assert names(tmp_path / "real") == ["m.json"]


def test_another_hard_link_keeps_the_old_content(tmp_path):
    (tmp_path / "a").write_text("old")
    os.link(tmp_path / "a", tmp_path / "b")
    write_whole(tmp_path / "a", "new")
    assert ((tmp_path / "a").read_text(), (tmp_path / "b").read_text()) == ("new", "old")


def test_mode_and_owner_of_the_old_file_stay_and_a_new_one_follows_the_umask(tmp_path):
    path = tmp_path / "m.json"
    path.write_text("old")
    os.chmod(path, 0o640)
    if ROOT:
        os.chown(path, 1234, 4321)
    before = os.stat(path)
    write_whole(path, "new")
    after = os.stat(path)
    assert (after.st_mode, after.st_uid, after.st_gid) == (before.st_mode, before.st_uid, before.st_gid)
    mask = os.umask(0o027)
    try:
        write_whole(tmp_path / "fresh", "new")
    finally:
        os.umask(mask)
    assert os.stat(tmp_path / "fresh").st_mode & 0o777 == 0o640


def test_a_write_protected_file_is_kept(tmp_path):
    path = tmp_path / "m.json"
    path.write_text("old")
    os.chmod(path, 0o444)
    with pytest.raises(WriteError, match="write-protected"):
        write_whole(path, "new")
    assert path.read_text() == "old"


@pytest.mark.parametrize(
    ("number", "said"),
    [(errno.ENOSPC, "disk is full"), (errno.EDQUOT, "quota"), (errno.EFBIG, "larger"), (errno.EIO, "error")],
)
def test_a_full_disk_is_called_that_and_the_old_files_are_whole(tmp_path, monkeypatch, number, said):
    old = [tmp_path / name for name in ("a", "b")]
    write_together(dict.fromkeys(old, "old"))
    real, written = os.write, []

    def write(handle, data):
        written.append(len(data))
        if len(written) > 1:
            raise OSError(number, os.strerror(number))
        return real(handle, data)

    monkeypatch.setattr(_files.os, "write", write)
    with pytest.raises(WriteError, match=said) as raised:
        write_together(dict.fromkeys(old, "new"))
    assert raised.value.exit_code == 2
    assert isinstance(raised.value, InvalidInput)
    assert [p.read_text() for p in old] == ["old", "old"]
    assert names(tmp_path) == ["a", "b"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no full device here")
def test_a_disk_that_is_really_full():
    handle = os.open("/dev/full", os.O_WRONLY)
    with pytest.raises(OSError, match="space") as raised:
        os.write(handle, b"x")
    os.close(handle)
    assert _files._reason(raised.value) == "the disk is full"


def test_file_and_folder_are_brought_to_the_disk_before_and_after_the_renaming(tmp_path, monkeypatch):
    done = []
    sync, rename = os.fsync, os.replace

    def synced(handle):
        done.append("folder" if os.path.isdir(f"/proc/self/fd/{handle}") else "file")
        sync(handle)

    def renamed(a, b):
        done.append("rename")
        rename(a, b)

    monkeypatch.setattr(_files.os, "fsync", synced)
    monkeypatch.setattr(_files.os, "replace", renamed)
    write_together({tmp_path / "a": "1", tmp_path / "b": "2"})
    assert done == ["file", "file", "rename", "rename", "folder"]


def test_none_of_several_is_replaced_before_all_are_written(tmp_path):
    (tmp_path / "a").write_text("old")
    (tmp_path / "b").mkdir()
    with pytest.raises(WriteError, match="b: it is a folder"):
        write_together({tmp_path / "a": "new", tmp_path / "b": "new"})
    assert (tmp_path / "a").read_text() == "old"
    assert names(tmp_path) == ["a", "b"]


def test_writability_of_a_folder_that_will_be_made(tmp_path):
    check_writable(tmp_path / "x" / "y" / "m.json", make=True)
    assert names(tmp_path) == []
    (tmp_path / "file").write_text("")
    with pytest.raises(WriteError, match="Not a directory"):
        check_writable(tmp_path / "file" / "y" / "m.json", make=True)
    with pytest.raises(WriteError, match="No such file"):
        check_writable(tmp_path / "x" / "m.json")


@pytest.mark.parametrize("interruption", [KeyboardInterrupt, MemoryError])
def test_an_interruption_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch, interruption):
    path = tmp_path / "m.json"
    path.write_text("old")

    def sync(handle):
        raise interruption

    monkeypatch.setattr(_files.os, "fsync", sync)
    with pytest.raises(interruption):
        write_whole(path, "new")
    assert path.read_text() == "old"
    assert names(tmp_path) == ["m.json"]


STALL = """
import sys, time
from backdrive import _files
_files.os.fsync = lambda handle: (print("writing", flush=True), time.sleep(600))
_files.write_whole(sys.argv[1], "half")
"""


def test_what_a_killed_process_left_is_removed_and_what_a_living_one_writes_is_not(tmp_path):
    path = tmp_path / "m.json"
    writers = [
        subprocess.Popen([sys.executable, "-c", STALL, path], stdout=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    try:
        for writer in writers:
            assert writer.stdout.readline() == "writing\n"
        parts = names(tmp_path)
        assert len(parts) == 2
        writers[0].send_signal(signal.SIGKILL)
        writers[0].wait()
        write_whole(path, "whole")
        left = names(tmp_path)
        assert path.read_text() == "whole"
        assert len(left) == 2
        assert set(left) < {"m.json", *parts}
        writers[1].send_signal(signal.SIGKILL)
        writers[1].wait()
        check_writable(tmp_path / "other.json")
        assert names(tmp_path) == ["m.json"]
    finally:
        for writer in writers:
            writer.kill()
            writer.wait()
            writer.stdout.close()


def test_a_name_that_a_cleaner_has_seen_is_not_used_again(tmp_path, monkeypatch):
    """A cleaner that holds the lock of a file removes it by its name: what came to stand there since would go with it."""
    from backdrive import _files

    lock, seen = _files._lock, []

    def held_by_a_cleaner(handle):
        seen.append(names(tmp_path))
        return len(seen) > 1 and lock(handle)

    monkeypatch.setattr(_files, "_lock", held_by_a_cleaner)
    write_whole(tmp_path / "m.json", "whole")
    assert len(seen) == 2
    assert not set(seen[0]) & set(seen[1])
    assert names(tmp_path) == ["m.json"]


def test_many_writers_of_one_file_never_mix(tmp_path):
    path, wrong = tmp_path / "m.json", []
    contents = [bytes([i]) * 20_000 for i in range(4)]
    write_whole(path, contents[0])

    def write(content):
        try:
            for _ in range(15):
                write_whole(path, content)
                if read_whole(path, 1 << 20) not in contents:
                    wrong.append("mixed")
        except Exception as error:
            wrong.append(error)

    threads = [threading.Thread(target=write, args=(c,)) for c in contents]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == []
    assert names(tmp_path) == ["m.json"]


def test_files_that_only_look_like_leftovers_stay(tmp_path):
    os.mkfifo(tmp_path / ".backdrive-0123456789abcdef.part")
    (tmp_path / ".backdrive-notes").write_text("mine")
    write_whole(tmp_path / "m.json", "new")
    assert len(names(tmp_path)) == 3


def test_the_package_writes_through_one_door():
    """No other module opens a file for writing."""
    home = Path(_files.__file__).parent
    ways = re.compile(
        r"write_text\(|write_bytes\(|mkstemp|NamedTemporary|os\.replace|os\.rename|open\([^\n]*[\"'][wax]b?\+?[\"']"
    )
    found = {f.name for f in home.rglob("*.py") if ways.search(f.read_text())}
    # the pipe to the parent; compiled code; a temporary copy of what lies in an object store
    assert found == {"_files.py", "_worker.py", "_jit_cache.py", "objects.py"}


def test_the_hint_works_in_a_checkout_and_elsewhere():
    assert 'pip install "backdrive[report]"' in install("report")
    assert 'pip install ".[report]"' in install("report")
    home = Path(_files.__file__).parent
    by_hand = [f.name for f in home.rglob("*.py") if "pip install" in f.read_text() and f.name != "errors.py"]
    assert by_hand == []


LOG = "t,q,tau\n" + "".join(f"{i / 100},{i % 7},{i % 5}\n" for i in range(50))


@pytest.fixture
def command(monkeypatch, capsys, tmp_path):
    from backdrive.cli import main

    (tmp_path / "log.csv").write_text(LOG)

    def run(*words):
        monkeypatch.setattr(sys, "argv", ["backdrive", *map(str, words)])
        with pytest.raises(SystemExit) as stopped:
            main()
        said = capsys.readouterr()
        return stopped.value.code or 0, said.out, " ".join(said.err.split())

    return run


WRITERS = {
    "identify -o": lambda log, out: ("identify", log, "-o", out),
    "identify --report": lambda log, out: ("identify", log, "--report", out),
    "identify --law -o": lambda log, out: ("identify", log, "--law", "auto", "-o", out),
    "identify --law --report": lambda log, out: ("identify", log, "--law", "auto", "--report", out),
    "show --plot": lambda log, out: ("show", "preset:mx106/m1", "--plot", out),
    "laws --plot": lambda log, out: ("laws", "lugre", "--plot", out),
    "tune -o": lambda log, out: ("tune", "preset:thesis/hp3j", "-o", out),
    "tune --picture": lambda log, out: (
        *("tune", "preset:thesis/hp3j", "--joint", "joint_0", "--stiffness", "8e4:1.2e5", "--inertia"),
        *("0.6:0.8", "--joints", "8", "--picture", out),
    ),
}


@pytest.mark.parametrize("what", ["a device", "a FIFO", "a socket", "a folder"])
@pytest.mark.parametrize("writer", WRITERS)
def test_commands_refuse_a_strange_output_before_they_compute(command, tmp_path, monkeypatch, writer, what):
    monkeypatch.setattr("backdrive.cli._logs.Reading.read", lambda *_, **__: pytest.fail("began"))
    monkeypatch.setattr("backdrive.model.load_model", lambda *_: pytest.fail("began"))
    out = STRANGE[what](tmp_path / ("out.html" if "--report" in writer else "out.png"))
    before = state(out)
    code, _, err = command(*WRITERS[writer](tmp_path / "log.csv", out))
    assert code == 2
    assert what in err
    assert state(out) == before


@pytest.mark.parametrize("words", [("demo",), ("reproduce", "fig-2.2"), ("plan", "sweep")])
def test_folders_are_looked_at_before_anything_is_computed(command, tmp_path, monkeypatch, words):
    monkeypatch.setattr("backdrive.simulation.open_loop.simulate", lambda *_, **__: pytest.fail("began"))
    monkeypatch.setattr("backdrive.thesis.run.run_one", lambda *_, **__: pytest.fail("began"))
    option = "-o" if words[0] == "plan" else "--folder"
    for folder in (tmp_path / "log.csv", tmp_path / "log.csv" / "below", "/dev/null"):
        code, _, err = command(*words, option, folder)
        assert code == 2
        assert "Cannot write" in err
    name = {"demo": "model.json", "reproduce": "index.html", "plan": "plan.csv"}[words[0]]
    os.mkfifo(tmp_path / name)
    code, _, err = command(*words, option, tmp_path)
    assert code == 2
    assert "a FIFO" in err


@pytest.mark.parametrize(
    "writer", ["identify --report", "identify --law --report", "show --plot", "laws --plot"]
)
def test_a_missing_extra_is_found_before_anything_is_computed(command, tmp_path, monkeypatch, writer):
    monkeypatch.setattr("backdrive.cli._logs.Reading.read", lambda *_, **__: pytest.fail("began"))
    monkeypatch.setattr("backdrive.model.load_model", lambda *_: pytest.fail("began"))
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    out = tmp_path / ("out.html" if "--report" in writer else "out.svg")
    code, _, err = command(*WRITERS[writer](tmp_path / "log.csv", out))
    assert code == 2
    assert "matplotlib" in err
    assert names(tmp_path) == ["log.csv"]


@pytest.mark.parametrize("words", [("demo",), ("reproduce", "fig-2.2")])
def test_the_demo_and_the_book_find_a_missing_extra_first(command, tmp_path, monkeypatch, words):
    monkeypatch.setattr("backdrive.simulation.open_loop.simulate", lambda *_, **__: pytest.fail("began"))
    monkeypatch.setattr("backdrive.thesis.run.run_one", lambda *_, **__: pytest.fail("began"))
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    code, _, err = command(*words, "--folder", tmp_path / "new")
    assert code == 2
    assert 'pip install ".[report]"' in err
    assert names(tmp_path) == ["log.csv"]


def test_description_and_plan_are_looked_at_before_the_logs(command, tmp_path, monkeypatch):
    monkeypatch.setattr("backdrive.cli._logs.Reading.read", lambda *_, **__: pytest.fail("began"))
    os.mkfifo(tmp_path / "f")
    log = tmp_path / "log.csv"
    for words in (
        ("identify", log, "--urdf", tmp_path / "f"),
        ("identify", log, "--plan", tmp_path / "f"),
        ("inspect", log, "--plan", tmp_path / "f"),
        ("validate", "preset:mx106/m1", log, "--urdf", tmp_path / "f"),
    ):
        code, _, err = command(*words)
        assert code == 3
        assert "a FIFO" in err
    monkeypatch.setattr("backdrive.robot.require_pinocchio", lambda: _raise(MissingExtra("no pinocchio")))
    code, _, err = command("identify", log, "--urdf", log)
    assert code == 2
    assert "no pinocchio" in err


def _raise(error):
    raise error


def test_an_output_in_a_ring_of_links_is_one_sentence(command, tmp_path):
    ring(tmp_path / "out.json")
    code, _, err = command("identify", tmp_path / "log.csv", "-o", tmp_path / "out.json")
    assert code == 2
    assert "link" in err


def test_a_plan_is_replaced_as_a_whole(command, tmp_path, monkeypatch):
    words = ("plan", "sweep", "--stroke-deg", "20", "--cycles", "3", "--draw", "none", "-o", tmp_path / "p")
    assert command(*words, "--top-speed", "1")[0] == 0
    before = {p.name: p.read_bytes() for p in (tmp_path / "p").iterdir()}
    real, count = os.write, []

    def write(handle, data):
        count.append(1)
        if len(count) == 3:
            raise OSError(errno.ENOSPC, "No space left on device")
        return real(handle, data)

    monkeypatch.setattr(_files.os, "write", write)
    code, _, err = command(*words, "--top-speed", "2")
    assert code == 2
    assert "disk is full" in err
    assert {p.name: p.read_bytes() for p in (tmp_path / "p").iterdir()} == before


def test_a_limit_of_the_file_size_is_an_error_not_a_death(tmp_path):
    code = (
        "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))\n"
        "from backdrive import _files\n"
        "from backdrive.errors import WriteError\n"
        "try: _files.write_whole(sys.argv[1], 'x' * 5000)\n"
        "except WriteError as error: print(error)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, tmp_path / "m"], capture_output=True, text=True, check=True
    )
    assert "larger than this system allows" in done.stdout
    assert names(tmp_path) == []
