"""Exported C, compiled by the C compiler of the `ziglang` wheel with every warning an error, and called from here."""

from __future__ import annotations

import ctypes
import subprocess
import sys
from pathlib import Path

import numpy as np

from backdrive.export.parts import Part, PartsHeader
from backdrive.export.prelude import GUARD, INCLUDES

WARNINGS = [
    "-Wall",
    "-Wextra",
    "-Wpedantic",
    "-Wconversion",
    "-Wdouble-promotion",
    "-Wshadow",
    "-Wno-unused-function",
    "-Werror",
]
ZIG = (sys.executable, "-m", "ziglang")


def compiled(
    folder: Path, source: str, name: str = "code.c", standard: str = "c99", options: tuple[str, ...] = ()
) -> Path:
    """Write a source file, compile it to a shared library and return that."""
    (folder / name).write_text(source)
    target = folder / f"{name}.so"
    compiler = "c++" if name.endswith("pp") else "cc"
    command = [
        *ZIG,
        compiler,
        f"-std={standard}",
        "-O1",
        "-ffp-contract=off",
        "-fno-sanitize=all",
        *WARNINGS,
        *options,
    ]
    done = subprocess.run(
        [*command, "-shared", "-fPIC", "-o", target, folder / name],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[:3000]
    return target


def runs(parts: dict[str, Part], prefix: str = "bd", single: bool = False) -> str:
    """Return a source file with a function `run_NAME(n, inputs, out)` of each part: a row of inputs a tick, a number out."""
    header = PartsHeader(parts, prefix, single)
    source = [INCLUDES, GUARD, header.text()]
    for name in parts:
        inputs = header.signature(name)
        arguments = ", ".join(f"({t})in[k * {len(inputs)} + {i}]" for i, (t, _) in enumerate(inputs))
        step, full = header.steps[name], f"{prefix}_{name}"
        fields = [f for f in step.fields if len(f) == 3] if step.result.endswith("_result") else []
        kept = [f"out[k * {len(fields)} + {i}] = (double)r.{f[1]};" for i, f in enumerate(fields)] or [
            "out[k] = (double)r;"
        ]
        source.append(
            f"void run_{name}(int n, const double *in, double *out);\n"
            f"void run_{name}(int n, const double *in, double *out) {{\n  {full}_state s;\n  {full}_reset(&s, 0.0);\n"
            f"  for (int k = 0; k < n; k++) {{\n    {step.result} r = {full}_step(&s, {arguments});\n    {' '.join(kept)}\n  }}\n}}"
        )
    return "\n".join(source)


def run(library: Path, name: str, inputs: np.ndarray, results: int = 1) -> np.ndarray:
    """Return what a part gives for rows of inputs, (n, results)."""
    function = getattr(ctypes.CDLL(str(library)), f"run_{name}")
    inputs = np.ascontiguousarray(inputs, dtype=np.float64)
    out = np.empty((len(inputs), results))
    pointer = ctypes.POINTER(ctypes.c_double)
    function(len(inputs), inputs.ctypes.data_as(pointer), out.ctypes.data_as(pointer))
    return out
