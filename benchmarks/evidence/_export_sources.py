"""Exported parts and loops, with the C around them that the evidence calls."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from backdrive.control import JointLoop
from backdrive.control.admittance import Admittance
from backdrive.control.compensators import alg_fc2
from backdrive.control.compensators.compensator import Compensator
from backdrive.control.compensators.dither import Dither
from backdrive.control.compensators.extras import BristleObserver, DisturbanceObserver, Pulses
from backdrive.control.estimators.external import METHODS, ExternalForce
from backdrive.control.estimators.friction import FrictionEstimator, alg_fe, alg_fe2, ct, ha
from backdrive.control.estimators.level import Adaptation
from backdrive.control.estimators.sliding_mode import WAYS, MotionFilter
from backdrive.export import parts
from backdrive.export.parts import Part, PartsHeader
from backdrive.export.prelude import GUARD, INCLUDES
from backdrive.laws import ELEMENTS, RATES, Growth, Law, LuGre, Polyline, StribeckGauss, by_direction

T, COUNT = 1e-3, 1e-5
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
SPEEDS = np.geomspace(0.01, 2.0, 10)
TORQUES = 4.0 + 2.0 * np.exp(-SPEEDS / 0.05) + 0.8 * SPEEDS
CURVE = Law(
    rate=Polyline(velocity=tuple(SPEEDS), positive=tuple(TORQUES), negative=tuple(0.9 * TORQUES))
)  # polyline-10
LIMITS = dict(top_speed=2.5, limit=4.5, encoder_count=COUNT)

#: Runs the loop along rows of inputs: error, known, load of each joint; returns 6 numbers of each.
LOOP_DRIVER = """
#include "arm.h"
static arm_state state;
void set_up(void); void set_up(void) { arm_init(&state); }
void halt(void); void halt(void) { arm_stop(&state); }
void rest(const double *q); void rest(const double *q) { arm_reset(&state, q); }
int again(void); int again(void) { return arm_acknowledge(&state); }
int selftest(void); int selftest(void) { return arm_selftest(); }
void run(int n, const double *q, const REAL *u, const double *dt, const REAL *in, double *out);
void run(int n, const double *q, const REAL *u, const double *dt, const REAL *in, double *out) {
  for (int k = 0; k < n; k++) {
    for (int j = 0; j < ARM_JOINTS; j++) {
      arm_joint *g = &state.joint[j];
      g->error = in[3 * j];
      g->known = in[3 * j + 1];
      g->load = in[3 * j + 2];
    }
    arm_step(&state, q, u, dt[k]);
    for (int j = 0; j < ARM_JOINTS; j++) {
      const arm_joint *g = &state.joint[j];
      out[6 * j] = (double)g->torque;
      out[6 * j + 1] = (double)g->external;
      out[6 * j + 2] = (double)g->friction;
      out[6 * j + 3] = (double)g->level;
      out[6 * j + 4] = (double)g->cause;
      out[6 * j + 5] = (double)state.code[j];
    }
    q += ARM_JOINTS; u += ARM_JOINTS; in += 3 * ARM_JOINTS; out += 6 * ARM_JOINTS;
  }
}
"""


def compilers() -> dict[str, list[str]]:
    """Return gcc and clang as they are called; clang is that of the `ziglang` wheel where the system has none."""
    found = {}
    if shutil.which("gcc"):
        found["gcc"] = ["gcc"]
    if shutil.which("clang"):
        found["clang"] = ["clang"]
    else:
        try:
            import ziglang  # noqa: F401
        except ImportError:
            return found
        found["clang"] = [sys.executable, "-m", "ziglang", "cc", "-fno-sanitize=all"]
    return found


def library(source: Path, compiler: Sequence[str], *options: str) -> ctypes.CDLL:
    """Compile a C99 file without contraction, every warning an error, and load it."""
    target = source.with_name(
        source.stem
        + "_"
        + "".join(c for c in "".join([Path(compiler[0]).name, *options]) if c.isalnum())
        + ".so"
    )
    command = [
        *compiler,
        "-std=c99",
        "-ffp-contract=off",
        *WARNINGS,
        *options,
        "-shared",
        "-fPIC",
        "-o",
        str(target),
        str(source),
        "-lm",
    ]
    subprocess.run(command, check=True)
    return ctypes.CDLL(str(target))


def pointer(array: np.ndarray) -> ctypes.c_void_p:
    """Return where an array begins."""
    return ctypes.c_void_p(array.ctypes.data)


def every_law() -> dict[str, Law]:
    """Return every rate law, every element on Stribeck's curve, growth with the load, and a law by direction."""
    gauss = StribeckGauss(**StribeckGauss.EXAMPLE)
    laws = {name: Law(rate=rate(**rate.EXAMPLE)) for name, rate in RATES.items()}
    laws |= {f"gauss_{name}": Law(rate=gauss, element=e(**e.EXAMPLE)) for name, e in ELEMENTS.items()}
    laws["grown"] = Law(rate=CURVE.rate, growth=Growth(load_driving=0.1, load_driven=0.05, load_carried=2.0))
    laws["by_direction"] = Law(
        rate=by_direction(
            gauss, StribeckGauss(coulomb=3.0, breakaway=5.0, stribeck_velocity=0.1, viscous=0.5)
        )
    )
    laws["polyline_10"] = CURVE
    return {name.replace("-", "_"): law for name, law in laws.items()}


def every_part() -> dict[str, Part]:
    """Return estimators, compensators, filters and an admittance."""
    lugre = FrictionEstimator(
        law=Law(rate=StribeckGauss(**StribeckGauss.EXAMPLE), element=LuGre(**LuGre.EXAMPLE))
    )
    fc2 = alg_fc2(CURVE, 8e3, 0.0155, 20.0, 500.0, 10.0, None, 0.8)
    compensators = {
        "algfc2": fc2,
        **{
            f"dither_{m}": Compensator(
                friction=alg_fe(CURVE, 8e3), dither=Dither(mode=m, count=COUNT, frequency=23.0)
            )
            for m in ("fixed", "reset", "adaptive")
        },
        "pulses": Compensator(friction=alg_fe(CURVE, 8e3), extra=Pulses(height=3.0)),
        "bristle_observer": Compensator(friction=lugre, extra=BristleObserver(gain=0.1, adaptation=0.01)),
        "disturbance_observer": Compensator(
            friction=alg_fe(CURVE, 8e3), extra=DisturbanceObserver(inertia=0.5, limit=4.0)
        ),
    }
    made = {n: parts.of_compensator(c, T) for n, c in compensators.items()}
    for m in METHODS:
        made[f"external_{m}"] = parts.of_external(
            ExternalForce(inertia=0.5, friction=ha(CURVE, 8e3), method=m, gravity_sin=2.0, offset=0.1), T
        )
    made |= {
        n: parts.of_friction(f)
        for n, f in {"ct": ct(CURVE, 0.0155), "algfe2": fc2.friction, "lugre": lugre}.items()
    }
    made |= {f"filter_{w}": parts.of_filter(MotionFilter(way=w)) for w in WAYS}
    admittance = Admittance(inertia=0.4, viscosity=2.0, proportional=500.0, derivative=20.0, limit=9.0)
    return made | {"admittance": parts.of_admittance(admittance)}


def arm() -> dict[str, JointLoop]:
    """Return four joints with everything that a loop offers."""
    lugre = FrictionEstimator(
        law=Law(rate=StribeckGauss(**StribeckGauss.EXAMPLE), element=LuGre(**LuGre.EXAMPLE))
    )
    adaptive = Dither(share=0.2, frequency=23.0, mode="adaptive", count=COUNT)
    fc2 = alg_fc2(CURVE, 8e3, 0.0155, 20.0, 500.0, 10.0, None, 0.8)
    kalman = ExternalForce(inertia=0.5, friction=alg_fe(CURVE, 8e3), method="kalman", bandwidth=40.0)
    switching = ExternalForce(inertia=0.5, friction=alg_fe2(CURVE, 8e3, 0.0155), method="momentum")
    direct = ExternalForce(
        inertia=0.5, friction=ha(CURVE, 8e3), method="direct", gravity_sin=2.0, gravity_cos=0.3
    )
    return {
        "a": JointLoop(compensator=fc2, external=kalman, **LIMITS),
        "b": JointLoop(compensator=fc2, **LIMITS),
        "c": JointLoop(
            compensator=Compensator(friction=alg_fe(CURVE, 8e3), share=0.7, dither=adaptive),
            external=switching,
            adaptation=Adaptation(slowest=0.02, upper=1.1),
            **LIMITS,
        ),
        "d": JointLoop(compensator=Compensator(friction=lugre, share=0.7), external=direct, **LIMITS),
    }


def parts_source(named: dict[str, Part], single: bool = False) -> tuple[str, PartsHeader]:
    """Return C with `run_NAME(n, in, out)` of each part: a row of inputs a tick, its numbers out."""
    header = PartsHeader(named, "bd", single)
    source = [INCLUDES, GUARD, header.text()]
    for name in named:
        inputs = header.signature(name)
        step, full = header.steps[name], f"bd_{name}"
        arguments = ", ".join(f"({t})in[{i}]" for i, (t, _) in enumerate(inputs))
        fields = [f[1] for f in step.fields if len(f) == 3]
        kept = [f"out[{i}] = (double)r.{f};" for i, f in enumerate(fields)] or ["out[0] = (double)r;"]
        head = f"void run_{name}(int n, const double *in, double *out)"
        source.append(
            f"{head};\n{head} {{\n  {full}_state s;\n  {full}_reset(&s, 0.0);\n  for (int k = 0; k < n; k++) {{\n"
            f"    {step.result} r = {full}_step(&s, {arguments});\n    {' '.join(kept)}\n"
            f"    in += {len(inputs)}; out += {max(len(fields), 1)};\n  }}\n}}"
        )
    return "\n".join(source) + "\n", header
