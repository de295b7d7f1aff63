"""Test vectors in a header: 64 ticks of a loop with faults, or of laws, and the outputs in Python.

`NAME_selftest()` runs them on the target. 0: all results are bit-identical. 1: the results agree within a tolerance, for
example because the compiler contracts products and sums, or because reals are floats. Negative: minus the number of the first
wrong vector, counted from 1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from backdrive.control.joint_loop import JointLoop
from backdrive.control.loop import Loop
from backdrive.engine.tick import Tick
from backdrive.export.values import PLACE, REAL, number
from backdrive.laws import Law

TICKS, SLOW = 64, 40  # number of vectors, and number of late ones at the start, which complete the ramp
LATE = 15.0  # periods of these
NOT_FINITE, JUMP, BAD, STOP, GO = (
    44,
    46,
    52,
    54,
    60,
)  # ticks of what goes wrong, of a stop and of the acknowledgement
PUSH, PULL = 0.3, 0.1  # of the limit: torque that acted, and gravity
SPEED = 0.2  # of the top speed
BEAT = (7.0, 11.0)  # ticks of two waves
PERIOD, SLOWEST, FASTEST = 1e-3, 1e-3, 1.0  # of the motion of laws [s, rad/s or m/s]
RESTS = 9  # every so many of its ticks stand still
TOLERANCE = {False: 1e-9, True: 2e-4}  # of the largest output, in doubles and in floats


def vectors(joints: Sequence[JointLoop], interval: float) -> dict[str, np.ndarray]:
    """Return inputs and outputs of all ticks.

    Args:
        joints: of the loop.
        interval: period [s].

    Returns:
        position, applied (64, J), interval (64,), torque, external, code (64, J), known (J,).
    """
    J = len(joints)
    k = np.arange(TICKS)
    times = np.where(k < SLOW, LATE * interval, interval)
    waves = np.sin(2.0 * np.pi * k / BEAT[0]) + 0.5 * np.sin(2.0 * np.pi * k / BEAT[1])
    position, applied = np.empty((TICKS, J)), np.empty((TICKS, J))
    for j, joint in enumerate(joints):
        moved = SPEED * joint.top_speed * waves * times * (1.0 + 0.1 * j)
        position[:, j] = np.round(np.cumsum(moved) / joint.encoder_count) * joint.encoder_count
        applied[:, j] = PUSH * joint.limit * np.cos(0.3 * k + j)
    position[NOT_FINITE] = np.nan
    position[JUMP] += 30.0 * np.array([joint.top_speed for joint in joints]) * interval
    applied[JUMP + 2, :] = np.nan
    times[BAD] = -interval
    known = np.array([PULL * joint.limit for joint in joints])
    loop = Loop(joints, interval=interval)
    loop.known = known
    out = {name: np.empty((TICKS, J)) for name in ("torque", "external", "code")}
    for i in range(TICKS):
        if i == STOP:
            loop.stop()
        if i == GO:
            loop.acknowledge()
        loop.update(position[i], applied[i], float(times[i]))
        out["torque"][i], out["external"][i], out["code"][i] = loop.torque, loop.external, loop.codes
    return {"position": position, "applied": applied, "interval": times, "known": known} | out


def rows(numbers: np.ndarray, kind: str, single: bool) -> str:
    """Return a table of numbers in braces."""
    if numbers.ndim == 1:
        return "{" + ", ".join(number(x, kind, single) for x in numbers) + "}"
    return "{\n" + ",\n".join("    " + rows(row, kind, single) for row in numbers) + "\n  }"


def selftest(joints: Sequence[JointLoop], interval: float, prefix: str, single: bool) -> str:
    """Return the function that runs the vectors, in C."""
    given = vectors(joints, interval)
    real, N = "float" if single else "double", f"{prefix.upper()}_JOINTS"
    scale = [
        max(np.abs(given[name][:, j]).max(), 1e-30)
        for j in range(len(joints))
        for name in ("torque", "external")
    ]
    tolerances = TOLERANCE[single] * np.reshape(scale, (-1, 2)).T
    code = given["code"].astype(int)
    codes = "{\n" + ",\n".join("    {" + ", ".join(map(str, row)) + "}" for row in code) + "\n  }"
    size = "double" if not single else "float"
    return f"""\
/* Run {TICKS} ticks and compare with what the loop gave where this file was made: 0 where every bit is the same, 1 where
   the numbers are within {TOLERANCE[single]:g} of the largest, else minus the number of the first vector that is wrong. */
static inline int {prefix}_selftest(void) {{
  static const double position[{TICKS}][{N}] = {rows(given["position"], PLACE, single)};
  static const {real} applied[{TICKS}][{N}] = {rows(given["applied"], REAL, single)};
  static const double interval[{TICKS}] = {rows(given["interval"], PLACE, single)};
  static const {real} known[{N}] = {rows(given["known"], REAL, single)};
  static const {real} torque[{TICKS}][{N}] = {rows(given["torque"], REAL, single)};
  static const {real} external[{TICKS}][{N}] = {rows(given["external"], REAL, single)};
  static const int code[{TICKS}][{N}] = {codes};
  static const {real} tolerance[2][{N}] = {rows(tolerances, REAL, single)};
  {prefix}_state s;
  int exact = 1;
  {prefix}_init(&s);
  for (int j = 0; j < {N}; j++) s.joint[j].known = known[j];
  for (int i = 0; i < {TICKS}; i++) {{
    if (i == {STOP}) {prefix}_stop(&s);
    if (i == {GO}) {prefix}_acknowledge(&s);
    {prefix}_step(&s, position[i], applied[i], interval[i]);
    for (int j = 0; j < {N}; j++) {{
      {size} wrong_torque = s.joint[j].torque - torque[i][j];
      {size} wrong_external = s.joint[j].external - external[i][j];
      if (s.code[j] != code[i][j]) return -(i + 1);
      if (!({_abs(single)}(wrong_torque) <= tolerance[0][j])) return -(i + 1);
      if (!({_abs(single)}(wrong_external) <= tolerance[1][j])) return -(i + 1);
      exact &= memcmp(&s.joint[j].torque, &torque[i][j], sizeof torque[i][j]) == 0;
      exact &= memcmp(&s.joint[j].external, &external[i][j], sizeof external[i][j]) == 0;
    }}
  }}
  return exact ? 0 : 1;
}}"""


def law_vectors(laws: Mapping[str, Law], single: bool) -> dict[str, np.ndarray]:
    """Return a motion that begins slowly, rests, reverses and slides, loads and temperatures, and the torque of each law.

    Returns:
        dp, motor, external, temperature (64,), torque (J, 64), as floats where reals are floats.
    """
    k = np.arange(TICKS)
    round_ = np.float32 if single else np.float64
    waves = np.sin(2.0 * np.pi * k / BEAT[0]) + 0.5 * np.sin(2.0 * np.pi * k / BEAT[1])
    given = {
        "dp": np.where(k % RESTS, SLOWEST * (FASTEST / SLOWEST) ** (k / (TICKS - 1)) * waves * PERIOD, 0.0),
        "motor": 3.0 * np.sin(0.3 * k),
        "external": 2.0 * np.cos(0.2 * k),
        "temperature": 20.0 + 0.25 * k,
    }
    given = {name: numbers.astype(round_).astype(float) for name, numbers in given.items()}
    tick = Tick(list(laws.values()), dt=float(round_(PERIOD)))
    torque = np.empty((len(laws), TICKS))
    for i in k:
        tick.load[:] = given["motor"][i], given["external"][i]
        tick.temperature[:] = given["temperature"][i]
        torque[:, i] = tick.tick(np.full(len(laws), given["dp"][i]))
    return given | {"torque": torque}


def laws_selftest(laws: Mapping[str, Law], prefix: str, single: bool) -> str:
    """Return the function that runs the vectors of laws, in C; the laws by their names in C."""
    given = law_vectors(laws, single)
    real, J = "float" if single else "double", len(laws)
    tolerances = TOLERANCE[single] * np.maximum(np.abs(given["torque"]).max(axis=1), 1e-30)
    inputs = "\n".join(
        f"  static const {real} {name}[{TICKS}] = {rows(given[name], REAL, single)};"
        for name in ("dp", "motor", "external", "temperature")
    )
    states = "\n".join(f"  {prefix}_{name}_state state_{j};" for j, name in enumerate(laws))
    resets = "\n".join(f"  {prefix}_{name}_reset(&state_{j}, 0.0);" for j, name in enumerate(laws))
    steps = "\n".join(
        f"    got[{j}] = {prefix}_{name}_step(&state_{j}, dp[i], dt, motor[i], external[i], temperature[i]);"
        for j, name in enumerate(laws)
    )
    return f"""\
/* Run {TICKS} ticks of every law and compare with what it gave where this file was made: 0 where every bit is the same, 1 where
   the torque is within {TOLERANCE[single]:g} of its largest, else minus the number of the first vector that is wrong. */
static inline int {prefix}_selftest(void) {{
{inputs}
  static const {real} torque[{J}][{TICKS}] = {rows(given["torque"], REAL, single)};
  static const {real} tolerance[{J}] = {rows(tolerances, REAL, single)};
  const {real} dt = {number(PERIOD, REAL, single)};
{states}
  int exact = 1;
{resets}
  for (int i = 0; i < {TICKS}; i++) {{
    {real} got[{J}];
{steps}
    for (int j = 0; j < {J}; j++) {{
      {real} wrong = got[j] - torque[j][i];
      if (!({_abs(single)}(wrong) <= tolerance[j])) return -(i + 1);
      exact &= memcmp(&got[j], &torque[j][i], sizeof got[j]) == 0;
    }}
  }}
  return exact ? 0 : 1;
}}"""


def _abs(single: bool) -> str:
    return "fabsf" if single else "fabs"
