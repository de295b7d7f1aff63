"""Friction loops in C, compiled on the spot, behind the same arguments as `backdrive.engine.Lanes.torque`."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np

SOURCE = Path(__file__).with_name("loops.c")
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
            command = [compiler, *FLAGS, *extra, "-o", str(library), str(SOURCE), "-lm"]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            self.threaded = bool(extra)
            if done.returncode == 0:
                break
        else:
            raise SystemExit(done.stderr)
        self._library = ctypes.CDLL(str(library))

    def torque(self, name: str, lanes, motion, dp, dt: float, load, threads: int) -> np.ndarray:
        """Return the torque of every lane by the loop of a law, (L, n); from rest, on fresh memory."""
        out, states = np.empty((len(motion), dp.shape[1])), np.zeros((len(motion), lanes.states))
        getattr(self._library, f"{name.replace('-', '_')}_sets")(
            pointer(lanes.rows),
            ctypes.c_long(lanes.rows.shape[1]),
            pointer(states),
            ctypes.c_long(states.shape[1]),
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

    def forward(self, row, inertia: float, proportional: float, derivative: float, reference, dt: float):
        """Return position, velocity and torque of a mass under Stribeck friction and a PD position loop, (n, 3)."""
        out = np.empty((len(reference), 3))
        self._library.forward_stribeck(
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
