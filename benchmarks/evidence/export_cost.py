"""What a tick of exported C costs: instructions by callgrind, and code, constants and stack on a Cortex-M4F.

Instructions are those of gcc -O2 on this machine, in doubles, counted by the difference of two runs of unlike length along the
same motion (strokes with reversals and rests, at a speed where the joint slides). Sizes are those of arm-none-eabi-gcc -Os for a
Cortex-M4F, in floats, of `step` with all that it calls; the stack is the deepest chain of frames that the compiler states.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from _common import Judge, parser
from _export_sources import CURVE, LIMITS, T, parts_source

from backdrive.control import JointLoop
from backdrive.control.compensators import alg_fc2
from backdrive.control.estimators.external import ExternalForce
from backdrive.control.estimators.friction import alg_fe
from backdrive.export import export_loop, parts
from backdrive.laws import ELEMENTS, RATES, Coulomb, Law, LuGre, StribeckGauss

SHORT, LONG = 2_000, 6_000  # ticks of the two runs
GOALS = {"coulomb": 40.0, "algfe": 110.0, "gauss_lugre": 150.0, "m6": 350.0}  # [instructions a tick]


def motion(n: int) -> np.ndarray:
    """Return positions: strokes at up to 1 rad/s, with rests."""
    t = T * np.arange(n)
    q = 0.2 * np.sin(5.0 * t)
    rest = t % 2.0 > 1.7
    q[rest] = q[np.maximum.accumulate(np.where(rest, 0, np.arange(n)))[rest]]
    return np.round(q / 1e-5) * 1e-5


def instructions(folder: Path, source: str) -> float:
    """Return the instructions of one round of `tick()` in a program whose argument is the number of rounds."""
    (folder / "cost.c").write_text(source)
    program = folder / "cost"
    subprocess.run(
        ["gcc", "-std=c99", "-O2", "-ffp-contract=off", "-o", program, folder / "cost.c", "-lm"],
        check=True,
        cwd=folder,
    )
    totals = []
    for n in (SHORT, LONG):
        done = subprocess.run(
            ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", program, str(n)],
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        totals.append(int(re.search(r"Collected : (\d+)", done.stderr)[1]))  # type: ignore[index]
    return (totals[1] - totals[0]) / (LONG - SHORT)


def numbers(name: str, values: np.ndarray) -> str:
    return f"static const double {name}[{len(values)}] = {{{', '.join(map(repr, values.tolist()))}}};\n"


def program(head: str, body: str) -> str:
    """Return a program that runs `body` for k = 0 ... argument."""
    q = motion(LONG + 1)
    return (
        f"{head}\n#include <stdlib.h>\n{numbers('q', q)}{numbers('dp', np.diff(q, prepend=0.0))}volatile double sink;\n"
        f"int main(int argc, char **argv) {{\n  long n = argc > 1 ? atol(argv[1]) : 0;\n{body}\n  return 0;\n}}\n"
    )


def of_part(folder: Path, name: str, part: parts.Part) -> float:
    """Return the instructions of a part's step."""
    source, header = parts_source({name: part})
    given = {
        "q": "q[k]",
        "dp": "dp[k]",
        "dt": "1e-3",
        "t": "1e-3 * (double)k",
        "temp": "30.0",
        "level": "1.0",
        "idle": "0",
    }
    arguments = ", ".join(given.get(n, "0.5") for _, n in header.signature(name))
    step = header.steps[name]
    field = next((f[1] for f in step.fields if len(f) == 3), "")
    read = f".{field}" if field else ""
    state = f"bd_{name}"
    call = f"{state}_step(&s, {arguments}){read}"
    body = (
        f"  static {state}_state s;\n  {state}_reset(&s, 0.0);\n  for (long k = 0; k < n; k++) sink = {call};"
    )
    return instructions(folder, program(source, body))


def empty(folder: Path) -> float:
    """Return the instructions of a round that only reads the inputs."""
    return instructions(folder, program("", "  for (long k = 0; k < n; k++) sink = q[k] + dp[k];"))


def of_loop(folder: Path, joint: JointLoop) -> float:
    """Return the instructions of a tick of a defended loop of one joint."""
    export_loop({"a": joint}, T, folder, name="arm")
    body = (
        "  static arm_state s;\n  static const double u[1] = {0.5};\n  arm_init(&s);\n"
        "  for (long k = 0; k < n; k++) { arm_step(&s, q + k, u, 1e-3); sink = s.joint[0].torque; }"
    )
    return instructions(folder, program('#include "arm.h"', body))


def of_cortex(judge: Judge, folder: Path, joint: JointLoop) -> None:
    """Size and stack of the loop on a Cortex-M4F, in floats."""
    export_loop({"a": joint}, T, folder, name="arm", precision="float")
    (folder / "cortex.c").write_text(
        '#include "arm.h"\nint tick(arm_state *s, const double *q, const float *u, double dt) { return arm_step(s, q, u, dt); }\n'
    )
    options = "-std=c99 -Os -ffp-contract=off -mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16"
    command = [
        "arm-none-eabi-gcc",
        *options.split(),
        "-ffunction-sections",
        "-fdata-sections",
        "-fstack-usage",
        "-fcallgraph-info=su",
        "-c",
        "cortex.c",
        "-o",
        "cortex.o",
    ]
    subprocess.run(command, check=True, cwd=folder)
    sizes = subprocess.run(
        ["arm-none-eabi-size", "cortex.o"], capture_output=True, text=True, check=True, cwd=folder
    )
    text = int(sizes.stdout.splitlines()[1].split()[0])
    frames = dict(
        re.findall(r'title: "([^"]+)" label: "[^"]*\\n(\d+) bytes', (folder / "cortex.ci").read_text())
    )
    edges = re.findall(r'sourcename: "([^"]+)" targetname: "([^"]+)"', (folder / "cortex.ci").read_text())

    def depth(name: str) -> int:
        return int(frames.get(name, 0)) + max((depth(b) for a, b in edges if a == name), default=0)

    print("Cortex-M4F, floats, -Os")
    judge.at_most("code and constants of the defended loop, self-test apart", text, 3 * 1024, "bytes")
    judge.at_most("stack", depth("tick"), 128, "bytes")


def main() -> None:
    asked = parser(__doc__).parse_args()
    missing = [name for name in ("gcc", "valgrind") if not shutil.which(name)]
    if missing:
        print(f"absent: {', '.join(missing)}")
        sys.exit(2)
    judge = Judge()
    fc2 = alg_fc2(CURVE, 8e3, 0.0155, 20.0, 500.0, 10.0, None, 0.8)
    kalman = ExternalForce(inertia=0.5, friction=alg_fe(CURVE, 8e3), method="kalman", bandwidth=40.0)
    guarded = JointLoop(compensator=fc2, **LIMITS)
    estimating = JointLoop(compensator=fc2, external=kalman, **LIMITS)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        nothing = empty(folder)
        print(f"instructions a tick, gcc -O2, doubles (an empty round takes {nothing:.1f}, taken off)")
        judge.at_most(
            "algFC2 with polyline-10 and the defended loop", of_loop(folder, guarded) - nothing, 250
        )
        judge.at_most(
            "algFC2 with polyline-10 alone",
            of_part(folder, "fc2", parts.of_compensator(fc2, T)) - nothing,
            130,
        )
        print(f"  the loop with a Kalman estimator: {of_loop(folder, estimating) - nothing:.0f}")
        gauss = StribeckGauss(**StribeckGauss.EXAMPLE)
        laws = {
            "coulomb": parts.of_law(Law(rate=Coulomb(coulomb=5.0))),
            "algfe": parts.of_friction(alg_fe(CURVE, 8e3)),
            "gauss_lugre": parts.of_law(Law(rate=gauss, element=LuGre(**LuGre.EXAMPLE))),
            "m6": parts.of_law(Law(rate=RATES["m6"](**RATES["m6"].EXAMPLE))),
        }
        for each, part in laws.items():
            judge.at_most(each, of_part(folder, each, part) - nothing, GOALS[each])
        if not asked.short:
            others = {n: Law(rate=r(**r.EXAMPLE)) for n, r in RATES.items()}
            others |= {f"gauss+{n}": Law(rate=gauss, element=e(**e.EXAMPLE)) for n, e in ELEMENTS.items()}
            for each, law in others.items():
                label = re.sub(r"\W", "_", each)
                print(f"  {each}: {of_part(folder, label, parts.of_law(law)) - nothing:.0f}")
        if shutil.which("arm-none-eabi-gcc"):
            of_cortex(judge, folder, guarded)
        else:
            judge.that("arm-none-eabi-gcc is absent: size and stack were not measured", False)
    judge.end()


if __name__ == "__main__":
    main()
