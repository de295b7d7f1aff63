"""Tests for cli/_interrupt.py: Ctrl-C ends a command with 130, even where Python's own interruption is swallowed or has to wait."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from backdrive.cli import main

ROOT = Path(__file__).parent.parent / "src"
SAID = "Interrupted; nothing half-written was left behind.\n"
BEGIN = """
import os, signal, sys, threading, time
signal.signal(signal.SIGINT, signal.default_int_handler)

def swallow():
    "Go on whatever is raised, as a callback of compiled code does."
    while True:
        try:
            time.sleep(60)
        except KeyboardInterrupt:
            pass

def interrupt(after=0.0):
    threading.Timer(after, os.kill, (os.getpid(), signal.SIGINT)).start()
"""


def run(program: str) -> subprocess.CompletedProcess:
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    return subprocess.run(
        [sys.executable, "-c", BEGIN + program],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=50,
    )


def test_a_swallowed_interruption_ends_the_command():
    done = run(
        "from backdrive import model\nfrom backdrive.cli import main\n"
        "def load(name):\n    interrupt()\n    swallow()\n"
        "model.load_model = load\nsys.argv = ['backdrive', 'show', 'x.json']\nmain()\n"
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", SAID)


def test_an_interruption_in_a_command_is_no_abortion():
    done = run(
        "from backdrive import model\nfrom backdrive.cli import main\n"
        "def load(name):\n    raise KeyboardInterrupt\n"
        "model.load_model = load\nsys.argv = ['backdrive', 'show', 'x.json']\nmain()\n"
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", SAID)


@pytest.mark.parametrize("kind", ["RuntimeError", "OSError"])
def test_what_fails_because_it_was_torn_out_of_its_work_is_no_internal_error(kind):
    done = run(
        "from backdrive import model\nfrom backdrive.cli import main\n"
        "def load(name):\n"
        "    try:\n        interrupt()\n        time.sleep(60)\n"
        f"    except KeyboardInterrupt:\n        raise {kind}('half compiled') from None\n"
        "model.load_model = load\nsys.argv = ['backdrive', 'show', 'x.json']\nmain()\n"
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", SAID)


def test_threads_at_work_are_not_waited_for():
    done = run(
        "from backdrive import model\nfrom backdrive.cli import main\nfrom backdrive.engine.cores import spread\n"
        "def load(name):\n    interrupt(0.2)\n    spread(lambda a, b: time.sleep(3600), 8, 2)\n"
        "model.load_model = load\nsys.argv = ['backdrive', 'show', 'x.json']\nmain()\n"
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", SAID)


def test_an_interruption_of_spread_work_cancels_what_has_not_begun():
    done = run(
        "from backdrive.engine.cores import spread\nbegun = []\n"
        "def work(a, b):\n    begun.append(a)\n    time.sleep(0.5)\n"
        "interrupt(0.1)\n"
        "try:\n    spread(work, 8, 2)\nexcept KeyboardInterrupt:\n    print(len(begun))\n"
    )
    assert (done.returncode, done.stdout) == (0, "2\n")


def test_no_parsing_process_is_left_behind():
    done = run(
        "from backdrive.cli import _interrupt\nfrom backdrive.logs.readers import guard\n"
        "with _interrupt.watch():\n"
        "    guard.default_guard().start()\n    print(guard.default_guard().pid, flush=True)\n    interrupt()\n    swallow()\n"
    )
    assert (done.returncode, done.stderr) == (130, SAID)
    assert ended(int(done.stdout))


def test_a_fit_that_is_interrupted_too_late_to_be_cut_short_says_130_all_the_same():
    done = run(
        "import types\nfrom backdrive import identification\n"
        "from backdrive.cli import _identify_tables, _logs, identify, main\n"
        "identify.check_targets = _logs.Reading.read = lambda *a, **k: []\n"
        "identification.identify = lambda *a, **k: types.SimpleNamespace(stopped=True, model=None)\n"
        "_identify_tables.show_tables = lambda *a: print('tables')\n"
        "identify.failing = lambda *a: ['joint']\n"
        "sys.argv = ['backdrive', 'identify', 'x.csv', '--law', 'auto']\nmain()\n"
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "tables\n", "")


def ended(pid: int) -> bool:
    """Wait for a process that was killed to be gone, which a busy machine may take a moment for."""
    for _ in range(200):
        try:
            if Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] in "ZX":
                return True
        except OSError:
            return True
        time.sleep(0.1)
    return False


def test_what_a_fit_keeps_is_given_time_and_a_second_interruption_is_not():
    done = run(
        "from backdrive.cli import _interrupt\nfrom backdrive.identification.dynamic import stopping\n"
        "with _interrupt.watch(), stopping.gently():\n"
        "    stopping.keep()\n    interrupt()\n    time.sleep(1.2)\n"
        "    try:\n        stopping.check()\n    except KeyboardInterrupt:\n        print('kept', flush=True)\n"
        "    interrupt()\n    swallow()\n"
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "kept\n", SAID)


def test_after_a_command_an_interruption_is_pythons_own_again(monkeypatch, capsys):
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        monkeypatch.setattr(sys, "argv", ["backdrive", "--version"])
        with pytest.raises(SystemExit) as ended:
            main()
        assert ended.value.code == 0
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, before)


def test_an_end_of_file_in_a_command_is_an_internal_error_and_no_abortion(monkeypatch, capsys):
    def load(name):
        raise EOFError("Ran out of input")

    monkeypatch.setattr("backdrive.model.load_model", load)
    monkeypatch.setattr(sys, "argv", ["backdrive", "show", "x.json"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 4
    said = capsys.readouterr().err
    assert "internal error: EOFError: Ran out of input" in said
    assert "Aborted" not in said
