"""What a process and all that it starts use: processor time and memory, looked at many times a second."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path

TICK = os.sysconf("SC_CLK_TCK")
PAGE = os.sysconf("SC_PAGE_SIZE")


@dataclass
class Use:
    """Of a tree of processes.

    Attributes:
        wall: [s].
        code: exit code of the root.
        output: of it, both streams.
        processor: of all processes together [s].
        parent: largest resident memory of the root [B].
        worker: largest of the other processes [B].
        course: instant [s] and the largest resident memory of any worker then [B].
    """

    wall: float = 0.0
    code: int = -1
    output: str = ""
    processor: float = 0.0
    parent: int = 0
    worker: int = 0
    course: list[tuple[float, int]] = field(default_factory=list)


def processes() -> dict[int, tuple[int, float, int]]:
    """Return parent, processor time [s] and resident memory [B] of every process, from /proc."""
    table = {}
    for name in os.listdir("/proc"):
        if name.isdigit():
            try:
                rest = Path(f"/proc/{name}/stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            table[int(name)] = (int(rest[1]), sum(map(int, rest[11:13])) / TICK, int(rest[21]) * PAGE)
    return table


def tree(root: int, table: dict[int, tuple[int, float, int]]) -> set[int]:
    """Return a process and all below it."""
    members = {root}
    while more := {pid for pid, (parent, *_) in table.items() if parent in members} - members:
        members |= more
    return members


def watch(*command: object, interval: float = 0.2) -> Use:
    """Run a command and see what it uses."""
    begun, before = time.perf_counter(), _of_children()
    process = subprocess.Popen(
        [str(part) for part in command], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    use, spent = Use(), {}
    lines: list[str] = []
    assert process.stdout is not None
    reader = threading.Thread(target=lambda: lines.extend(process.stdout), daemon=True)
    reader.start()
    while process.poll() is None:
        table = processes()
        for pid in tree(process.pid, table):
            _, seconds, memory = table.get(pid, (0, 0.0, 0))
            spent[pid] = max(seconds, spent.get(pid, 0.0))
            if pid == process.pid:
                use.parent = max(use.parent, memory)
            else:
                use.worker = max(use.worker, memory)
        others = [table[p][2] for p in tree(process.pid, table) if p != process.pid and p in table]
        use.course.append((time.perf_counter() - begun, max(others, default=0)))
        time.sleep(interval)
    reader.join()
    use.wall, use.code, use.output = time.perf_counter() - begun, process.returncode, "".join(lines)
    # processes that live for some ms are seen only by whoever waits for them: with theirs
    use.processor = max(sum(spent.values()), _of_children() - before)
    return use


def _of_children() -> float:
    """Return the processor time of all that this process, or one that it waited for, has waited for [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def fleet(*arguments: object) -> Use:
    """Run `backdrive fleet ...` and see what it uses."""
    return watch(sys.executable, "-m", "backdrive", "fleet", *arguments)
