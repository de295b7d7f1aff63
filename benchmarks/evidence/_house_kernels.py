"""An edit of a kernel, one in each room that holds kernels, is seen by the next process that uses the cache of before."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

KERNEL = "from backdrive._jit import"


class Edit(NamedTuple):
    """One slip of the pen in a kernel, and a call that shows it.

    Attributes:
        file: below the package.
        before: text that stands there once.
        after: what takes its place.
        call: expression of the kernel, with the module as `m`; no number of it may be the same afterwards.
    """

    file: str
    before: str
    after: str
    call: str


EDITS = {
    "laws": Edit(
        "laws/rates/coulomb_viscous.py",
        "sigma_p * v",
        "10.0 * sigma_p * v",
        "m.limits(np.array([4.0, 1.5, 2.0, 0.3, 0.4]), 2.0, (0.0, 0.0), 20.0)[2]",
    ),
    "engine": Edit(
        "engine/drives.py",
        "r[k] + (t - k)",
        "r[k] + 2.0 * (t - k)",
        "m.input_at(np.array([1.0, 2.0]), 0.5, 0.0)",
    ),
    "control": Edit(
        "control/admittance.py",
        "T * tau_e) / (m + b * T)",
        "3.0 * T * tau_e) / (m + b * T)",
        "m.tick(np.array([1.0, 1.0, 5.0, 1.0, 9.0]), 0, np.zeros(3), 0, 2.0, 0.0, 0.1)",
    ),
    "simulation": Edit(
        "simulation/kernel.py",
        "count * np.floor(p / count + 0.5)",
        "count * np.floor(p / count)",
        "m.encoder(0.7, 1.0)",
    ),
}

#: The caller is a kernel in a file that is never edited: numba alone would hand out what it compiled of it before.
CALLER = """
import numpy as np
from backdrive._jit import jit
from {module} import {name} as kernel


class m:
    {name} = kernel


@jit
def caller({arguments}):
    return kernel({arguments})


m.{name} = staticmethod(caller)
print(float({call}))
"""


def rooms(package: Path) -> set[str]:
    """Return the rooms that hold kernels."""
    files = (f for f in package.rglob("*.py") if KERNEL in f.read_text())
    return {f.relative_to(package).parts[0] for f in files if f.parent != package}


def seen(package: Path, scratch: Path) -> Iterator[tuple[str, str, str, str]]:
    """Edit a copy of the package, a kernel a room, one after the other.

    Args:
        package: its sources; they stay as they are.
        scratch: an empty folder.

    Yields:
        Room, file, and the number before and after the edit; a number that could not be computed is the reason why.
    """
    copy, cache = scratch / "root" / "backdrive", scratch / "cache"
    shutil.copytree(package, copy, ignore=shutil.ignore_patterns("__pycache__"))
    for room, edit in EDITS.items():
        file = copy / edit.file
        text = file.read_text() if file.exists() else ""
        if text.count(edit.before) != 1:
            yield room, edit.file, "", f"'{edit.before}' does not stand there once"
            continue
        name = re.match(r"m\.(\w+)\(", edit.call)[1]
        arguments = re.search(rf"^def {name}\(([^)]*)\)", text, re.MULTILINE)[1]
        module = "backdrive." + edit.file.removesuffix(".py").replace("/", ".")
        caller = scratch / f"caller_{room}.py"
        caller.write_text(CALLER.format(module=module, name=name, arguments=arguments, call=edit.call))
        first = _run(caller, copy.parent, cache)
        again = _run(caller, copy.parent, cache)
        file.write_text(text.replace(edit.before, edit.after))
        edited = _run(caller, copy.parent, cache)
        yield room, edit.file, first if first == again else f"{first}, then {again}", edited


def _run(script: Path, path: Path, cache: Path) -> str:
    environment = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_")}
    environment |= {"PYTHONPATH": str(path), "NUMBA_CACHE_DIR": str(cache)}
    done = subprocess.run(
        [sys.executable, str(script)], env=environment, capture_output=True, text=True, check=False
    )
    return done.stdout.strip() or done.stderr.strip().rpartition("\n")[2]
