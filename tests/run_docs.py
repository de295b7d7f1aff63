"""Run every example of README and docs: ```python blocks are executed, ```sh lines that start with `backdrive` are run.

Each file's blocks run in order in one folder of their own, so that a later block finds what an earlier one wrote. A block that
follows the line `<!-- not run: REASON -->` is left out, and the reason printed. The folder holds `log.csv`, a sweep of a simulated
joint: where a document speaks of your log, this one stands in.
"""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BLOCK = re.compile(r"(<!-- not run: (?P<reason>[^>]*) -->\n)?```(?P<kind>python|sh)\n(?P<body>.*?)```", re.S)


def run(command: list[str], folder: Path, what: str) -> None:
    """Run one command, and end the program where it fails."""
    environment = os.environ | {"BACKDRIVE_TRACEBACK": "1"}
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, env=environment)
    if done.returncode:
        print(f"{what} ended with {done.returncode}:\n{done.stdout}{done.stderr}")
        sys.exit(1)


def write_log(path: Path) -> None:
    """Write the log that stands in for the reader's own."""
    import numpy as np

    from backdrive.plans import Sweep
    from backdrive.simulation.machines import machine
    from backdrive.simulation.open_loop import simulate

    log = simulate(machine("joint_1"), Sweep(stroke=np.deg2rad(20.0), top_speed=2.0, cycles=10), seed=0)
    table = np.column_stack([log.time, log.need("position")[:, 0], log.need("torque")[:, 0]])
    np.savetxt(path, table, delimiter=",", header="time,q,tau", comments="")


def run_document(document: Path) -> int:
    """Run the blocks of a document and return how many ran."""
    ran = 0
    with tempfile.TemporaryDirectory() as scratch:
        if "log.csv" in document.read_text():
            write_log(Path(scratch, "log.csv"))
        for i, match in enumerate(BLOCK.finditer(document.read_text())):
            what = f"{document.relative_to(ROOT)}, block {i + 1}"
            if match["reason"]:
                print(f"{what}: not run: {match['reason']}")
            elif match["kind"] == "python":
                run([sys.executable, "-W", "error", "-c", match["body"]], Path(scratch), what)
                ran += 1
            else:
                text = match["body"].replace("\\\n", " ")
                for line in text.splitlines():
                    if line.startswith("backdrive "):
                        run(
                            [sys.executable, "-m", *shlex.split(line, comments=True)],
                            Path(scratch),
                            f"{what}: {line}",
                        )
                        ran += 1
    return ran


def run_example(example: Path) -> int:
    """Run a numbered example and return 1."""
    with tempfile.TemporaryDirectory() as scratch:
        run([sys.executable, "-W", "error", str(example)], Path(scratch), str(example.relative_to(ROOT)))
    return 1


def main() -> None:
    """Go through all documents and numbered examples, two at a time."""
    documents = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    with ThreadPoolExecutor(2) as two:
        ran = [
            *two.map(run_document, documents),
            *two.map(run_example, sorted((ROOT / "examples").glob("*.py"))),
        ]
    print(f"{sum(ran)} examples ran")


if __name__ == "__main__":
    main()
