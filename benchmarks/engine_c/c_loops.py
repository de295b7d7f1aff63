"""Friction loops in C, compiled on the spot, behind arguments like those of `backdrive.engine.Lanes.torque`."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np

SOURCES = [str(Path(__file__).with_name(name)) for name in ("loops.c", "lanes.c")]
FLAGS = ["-O3", "-march=native", "-ffp-contract=off", "-std=gnu11", "-shared", "-fPIC"]


def pointer(array: np.ndarray) -> ctypes.c_void_p:
    """Return where a contiguous array begins."""
    assert array.flags.c_contiguous
    return ctypes.c_void_p(array.ctypes.data)


class Loops:
    """The compiled loops.

    Attributes:
        compiler: its first line about itself.
        threaded: it has OpenMP, so that sets can be spread over threads.
    """

    def __init__(self, folder: Path):
        """Compile into a folder; ends the program with 2 where there is no compiler."""
        compiler = os.environ.get("CC") or shutil.which("gcc")
        if compiler is None:
            print("there is no gcc (or CC): nothing to compare with")
            raise SystemExit(2)
        os.environ.setdefault(
            "OMP_WAIT_POLICY", "passive"
        )  # its threads must not spin while others are measured
        said = subprocess.run([compiler, "--version"], capture_output=True, text=True, check=True)
        self.compiler = said.stdout.splitlines()[0]
        library = folder / "loops.so"
        for extra in (["-fopenmp"], []):
            command = [compiler, *FLAGS, *extra, "-o", str(library), *SOURCES, "-lm"]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            self.threaded = bool(extra)
            if done.returncode == 0:
                break
        else:
            raise SystemExit(done.stderr)
        self._library = ctypes.CDLL(str(library))

    def torque(self, name: str, rows, states: int, motion, dp, dt: float, load, threads: int) -> np.ndarray:
        """Return the torque of every row by the loop of a law, (L, n); from rest, on fresh memory."""
        out, state = np.empty((len(motion), dp.shape[1])), np.zeros((len(motion), states))
        getattr(self._library, f"{name.replace('-', '_')}_sets")(
            pointer(rows),
            ctypes.c_long(rows.shape[1]),
            pointer(state),
            ctypes.c_long(states),
            pointer(motion),
            pointer(dp),
            pointer(load),
            ctypes.c_double(dt),
            ctypes.c_long(dp.shape[1]),
            ctypes.c_long(len(motion)),
            ctypes.c_int(threads),
            pointer(out),
        )
        return out

    def side_by_side(self, name: str, rows, dp, dt: float) -> np.ndarray:
        """Return the torque of many rows along one motion, sixteen side by side, (L, n)."""
        out = np.empty((len(rows), dp.size))
        getattr(self._library, f"{name}_side_by_side")(
            pointer(rows),
            ctypes.c_long(rows.shape[1]),
            pointer(dp),
            ctypes.c_double(dt),
            ctypes.c_long(dp.size),
            ctypes.c_long(len(rows)),
            pointer(out),
        )
        return out

    def alg_fc2(self, numbers, q, dt: float) -> np.ndarray:
        """Return what algFC2 adds along encoder readings, (n,)."""
        out = np.empty(q.size)
        self._library.alg_fc2(
            pointer(numbers), pointer(q), ctypes.c_double(dt), ctypes.c_long(q.size), pointer(out)
        )
        return out

    def forward(self, row, inertia: float, proportional: float, derivative: float, reference, dt: float):
        """Return position, velocity and torque of a mass under LuGre friction and a PD position loop, (n, 3)."""
        out = np.empty((len(reference), 3))
        self._library.forward_lugre(
            pointer(row),
            ctypes.c_double(inertia),
            ctypes.c_double(proportional),
            ctypes.c_double(derivative),
            pointer(reference),
            ctypes.c_double(dt),
            ctypes.c_long(len(reference)),
            pointer(out),
        )
        return out
