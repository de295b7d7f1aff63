"""Every command of the package as a process of its own: what it is given, what it writes, how it is run and interrupted.

Inputs are written here by hand; what comes out is looked at as bytes. Nothing of the package is imported.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from _hostile_models import honest

OLD = b"old and whole\n" * 40
TUNED = (
    "preset:thesis/hp3j",
    "--joint",
    "joint_0",
    "--stiffness",
    "8e4:1.2e5",
    "--inertia",
    "0.6:0.8",
    "--joints",
    "8",
)
SWEEP = ("sweep", "--stroke-deg", "20", "--top-speed", "2", "--cycles", "3", "--joint", "j1", "--draw", "svg")
PLAN_FILES = ("plan.json", "plan.csv", "plan.npz", "trajectory.yaml", "plan.svg")


@dataclass(frozen=True)
class Done:
    """How a process ended: exit code (negative: the signal), what it printed, wall time [s], alive when a signal was sent."""

    code: int
    out: str
    err: str
    seconds: float
    alive: bool = True

    @property
    def tidy(self) -> bool:
        """No traceback, and no word of an internal error."""
        return not any(word in self.out + self.err for word in ("Traceback", "internal error", "Aborted!"))

    def __str__(self) -> str:
        said = " ".join((self.err or self.out).split())
        return f"code {self.code}, {self.seconds:.2f} s: {said[-160:]}"


@dataclass(frozen=True)
class Command:
    """A command line, and the names of the files that it writes into a folder."""

    words: Callable[[Path], Sequence[Any]]
    files: tuple[str, ...] = ()
    partial: bool = False  # documented to keep what is done when it is interrupted


@dataclass
class Bench:
    """A folder with inputs, a copy of the package with a compile cache of its own, and the means to run commands."""

    root: Path
    package: Path = field(init=False)
    seconds: dict[str, float] = field(default_factory=dict)

    def __post_init__(self):
        self.package = self.copy(self.root / "package")
        rng = np.random.default_rng(3)
        t = np.arange(3000) / 100.0
        q = sum(0.4 * np.sin(2.0 * np.pi * f * t + p) for f, p in ((0.1, 0.0), (0.23, 1.0), (0.41, 2.0)))
        dq, ddq = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
        tau = 1.5 * ddq + 5.0 * np.tanh(dq / 1e-3) + 2.0 * dq + 0.02 * rng.standard_normal(t.size)
        np.savetxt(self.log, np.column_stack([t, q, tau]), delimiter=",", header="t,q,tau", comments="")
        self.model.write_text(json.dumps(honest()))
        other = honest()
        other["joints"][0]["parameters"]["positive"]["value"] = [5.5, 6.5, 8.5]
        self.other.write_text(json.dumps(other))

    @property
    def log(self) -> Path:
        """A log of one joint."""
        return self.root / "log.csv"

    @property
    def model(self) -> Path:
        """A model file."""
        return self.root / "model.json"

    @property
    def other(self) -> Path:
        """Another model of the same joints."""
        return self.root / "other.json"

    def copy(self, to: Path) -> Path:
        """Copy the package, compiled kernels included, so that this tree's own cache takes no harm; return its root."""
        found = find_spec("backdrive")
        assert found is not None
        assert found.origin is not None
        shutil.copytree(Path(found.origin).parent, to / "backdrive")
        return to

    def environment(self, package: Path | None = None) -> dict[str, str]:
        """Return the environment of a command."""
        kept = {k: v for k, v in os.environ.items() if k not in ("NUMBA_CACHE_DIR", "BACKDRIVE_TRACEBACK")}
        return kept | {
            "PYTHONPATH": str(package or self.package),
            "HOME": str(self.root / "home"),
            "MPLCONFIGDIR": str(self.root / "matplotlib"),
            "COLUMNS": "200",
        }

    def start(self, words: Sequence[Any], package: Path | None = None, **more: Any) -> subprocess.Popen:
        """Start a command in a session of its own, as a terminal does."""
        return subprocess.Popen(
            [sys.executable, "-m", "backdrive", *map(str, words)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=self.root,
            env=self.environment(package),
            start_new_session=True,
            **more,
        )

    def run(
        self, words: Sequence[Any], *, package: Path | None = None, timeout: float = 60.0, **more: Any
    ) -> Done:
        """Run a command to its end; one that takes longer is killed, and its code is -9."""
        begun = time.perf_counter()
        process = self.start(words, package, **more)
        return finish(process, begun, timeout)

    def stop(self, words: Sequence[Any], after: float, number: int, *, timeout: float = 30.0) -> Done:
        """Run a command and send a signal to its group `after` seconds; `seconds` counts from the signal on."""
        process = self.start(words)
        time.sleep(after)
        begun, alive = time.perf_counter(), process.poll() is None
        with contextlib.suppress(ProcessLookupError):  # it has ended already
            os.killpg(process.pid, number)
        return replace(finish(process, begun, timeout), alive=alive)


def finish(process: subprocess.Popen, begun: float, timeout: float) -> Done:
    """Wait for a process, or kill its group."""
    try:
        out, err = process.communicate(timeout=timeout)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        out, err = process.communicate()
    return Done(process.returncode, out, err, time.perf_counter() - begun)


def commands(bench: Bench) -> dict[str, Command]:
    """Return every command of the package by name; each is given the folder to write to."""
    log, model, other = (bench.log, "--names", "elbow"), bench.model, bench.other
    return {
        "demo": Command(lambda f: ("demo", "--folder", f), ("model.json", "report.html")),
        "inspect": Command(lambda f: ("inspect", *log)),
        "plan": Command(lambda f: ("plan", *SWEEP, "-o", f), PLAN_FILES),
        "identify": Command(
            lambda f: ("identify", *log, "-o", f / "m.json", "--report", f / "r.html"), ("m.json", "r.html")
        ),
        "search": Command(
            lambda f: ("identify", *log, "--law", "coulomb-viscous", "-o", f / "m.json"), ("m.json",)
        ),
        "show": Command(lambda f: ("show", model, "--plot", f / "p.png"), ("p.png",)),
        "validate": Command(lambda f: ("validate", model, *log, "--gate", "1000")),
        "compare": Command(lambda f: ("compare", model, other)),
        "tune": Command(lambda f: ("tune", *TUNED, "-o", f / "t.json"), ("t.json",)),
        "laws": Command(lambda f: ("laws", "lugre", "--plot", f / "l.svg"), ("l.svg",)),
        "reproduce": Command(
            lambda f: ("reproduce", "fig-2.2", "--folder", f),
            ("index.html", "fig-2.2.png", "fig-2.2.svg"),
            partial=True,
        ),
    }


def prepare(folder: Path, command: Command) -> Path:
    """Make a folder that holds an old version of every file of a command."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in command.files:
        (folder / name).write_bytes(OLD)
    return folder


def half(folder: Path, command: Command, known: dict[str, bytes]) -> list[str]:
    """Return what is wrong in a folder: files that are neither old nor whole, and files that nobody asked for.

    Args:
        folder: that a command wrote to.
        command: which.
        known: the bytes of an undisturbed run by name.
    """
    wrong = [f"{p.name} was left" for p in folder.iterdir() if p.name not in command.files]
    for name in command.files:
        path = folder / name
        if not path.exists():
            wrong.append(f"{name} is gone")
        elif (content := path.read_bytes()) not in (OLD, known.get(name)) and not whole(name, content):
            wrong.append(f"{name} is half")
    return wrong


def whole(name: str, content: bytes) -> bool:
    """Return whether a file is complete, as its kind shows."""
    try:
        match Path(name).suffix:
            case ".json":
                return isinstance(json.loads(content), dict)
            case ".html":
                return content.startswith(b"<!DOCTYPE html>") and content.endswith(b"</html>\n")
            case ".png":
                return content.startswith(b"\x89PNG") and content.endswith(b"IEND\xaeB`\x82")
            case ".svg":
                return content.rstrip().endswith(b"</svg>")
    except ValueError:
        pass
    return False
