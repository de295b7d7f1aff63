"""Exported C on its targets: the self-test by gcc, clang, on a Cortex-M4F in qemu and as WebAssembly in node; sanitizers; warnings.

Each target that is absent is named, and the program then ends with 2 where nothing else falls short.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from _common import Judge, parser
from _export_sources import WARNINGS, T, arm, compilers

from backdrive.export import export_laws, export_loop

SANITIZERS = ("-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all")
CORTEX = "-mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16"
TEST = '#include "arm.h"\nint main(void) { return arm_selftest() == EXPECTED ? 0 : 1; }\n'
SANITIZED = """\
#include "arm.h"
#include "laws.h"
int main(void) {
  static arm_state s;
  double q[ARM_JOINTS];
  REAL u[ARM_JOINTS];
  uint64_t word = 88172645463325252u;
  if (arm_selftest() != EXPECTED) return 1;
  arm_init(&s);
  for (long k = 0; k < 400000; k++) {
    for (int j = 0; j < ARM_JOINTS; j++) {
      word ^= word << 13; word ^= word >> 7; word ^= word << 17;
      q[j] = 0.3 * sin(1e-3 * (double)k) + ((word & 1023) == 0 ? (double)NAN : (word & 1023) == 1 ? 1e300 : 0.0);
      u[j] = (REAL)((word >> 20 & 1023) == 0 ? (double)INFINITY : 0.5);
    }
    arm_step(&s, q, u, (word & 4095) == 0 ? -1.0 : 1e-3);
    if ((word & 0xffff) == 0) arm_acknowledge(&s);
  }
  return 0;
}
"""
OTHER = '#include "arm.h"\nint other(void);\nint other(void) { return arm_selftest(); }\n'
BOTH = '#include "arm.h"\nint other(void);\nint main(void) { return other() == EXPECTED && arm_selftest() == EXPECTED ? 0 : 1; }\n'
BOARD = """\
#include "arm.h"
static void leave(int code) { /* semihosting: SYS_EXIT_EXTENDED */
  uint32_t block[2] = {0x20026u, (uint32_t)code};
  register uint32_t operation __asm__("r0") = 0x20u;
  register uint32_t *argument __asm__("r1") = block;
  __asm__ volatile("bkpt 0xab" : : "r"(operation), "r"(argument) : "memory");
  for (;;) {
  }
}
void reset(void);
void reset(void) {
  *(volatile uint32_t *)0xE000ED88u |= 0xFu << 20; /* the floating-point unit */
  __asm__ volatile("dsb\\n isb");
  leave(arm_selftest() == EXPECTED ? 0 : 1);
}
__attribute__((section(".vectors"), used)) static void (*const vectors[2])(void) = {(void (*)(void))0x20400000u, reset};
"""
MAP = """\
SECTIONS {
  . = 0x0;
  .text : { KEEP(*(.vectors)) *(.text*) *(.rodata*) *(.ARM.e*) }
  . = 0x20000000;
  .data : { *(.data*) *(.bss*) *(COMMON) }
}
"""
NODE = """\
const bytes = require('fs').readFileSync(process.argv[2]);
WebAssembly.instantiate(bytes, {}).then(({instance}) => {
  if (instance.exports._initialize) instance.exports._initialize();
  process.exit(instance.exports.selftest() === Number(process.argv[3]) ? 0 : 1);
});
"""


def run(*command: str | Path, folder: Path) -> subprocess.CompletedProcess:
    return subprocess.run(
        [str(c) for c in command], cwd=folder, capture_output=True, text=True, check=False, timeout=300
    )


def built(judge: Judge, what: str, folder: Path, *command: str) -> bool:
    """Compile and say whether that went without a warning."""
    done = run(*command, folder=folder)
    if done.returncode:
        print(done.stderr[:2000])
    judge.that(f"{what}: compiles without a warning", done.returncode == 0)
    return done.returncode == 0


def on_hosts(judge: Judge, folder: Path, expected: int, real: str, short: bool) -> None:
    """The compilers of this machine: standards, two translation units, sanitizers."""
    (folder / "test.c").write_text(TEST.replace("EXPECTED", str(expected)))
    (folder / "sanitized.c").write_text(SANITIZED.replace("EXPECTED", str(expected)).replace("REAL", real))
    (folder / "other.c").write_text(OTHER)
    (folder / "both.c").write_text(BOTH.replace("EXPECTED", str(expected)))
    (folder / "test.cpp").write_text(TEST.replace("EXPECTED", str(expected)).replace("arm.h", "arm.hpp"))
    for name, compiler in compilers().items():
        for standard in ("c99", "c11", "c17") if not short else ("c99",):
            for level in ("-O0", "-O2", "-O3"):
                what = f"{name} -std={standard} {level}, {real}"
                command = [
                    *compiler,
                    f"-std={standard}",
                    level,
                    "-ffp-contract=off",
                    *WARNINGS,
                    "-o",
                    "test",
                    "test.c",
                    "-lm",
                ]
                if built(judge, what, folder, *command):
                    judge.that(f"{what}: self-test", run(folder / "test", folder=folder).returncode == 0)
        command = [
            *compiler,
            "-std=c99",
            "-O2",
            "-ffp-contract=off",
            *WARNINGS,
            "-o",
            "both",
            "both.c",
            "other.c",
            "-lm",
        ]
        if built(judge, f"{name}, two translation units, {real}", folder, *command):
            judge.that(
                f"{name}, two translation units: self-tests",
                run(folder / "both", folder=folder).returncode == 0,
            )
        plus = {
            "gcc": ["g++"],
            "clang": [*compiler[:-1], "clang++"] if compiler == ["clang"] else [*compiler, "-x", "c++"],
        }[name]
        command = [
            *plus,
            "-std=c++17",
            "-O2",
            "-ffp-contract=off",
            *WARNINGS,
            "-o",
            "testpp",
            "test.cpp",
            "-lm",
        ]
        if built(judge, f"{name} -std=c++17, {real}", folder, *command):
            judge.that(f"{name} -std=c++17: self-test", run(folder / "testpp", folder=folder).returncode == 0)
        if name == "gcc" or compiler == ["clang"]:
            options = [*SANITIZERS, "-g", "-O1", "-ffp-contract=off"]
            if built(
                judge,
                f"{name}, sanitizers, {real}",
                folder,
                *compiler,
                "-std=c99",
                *options,
                "-o",
                "sane",
                "sanitized.c",
                "-lm",
            ):
                done = run(folder / "sane", folder=folder)
                judge.that(
                    f"{name}: address and undefined-behaviour sanitizers are silent over 4e5 ticks with faults",
                    done.returncode == 0 and not done.stderr,
                )
        contracted = [
            *compiler,
            "-std=gnu99",
            "-O3",
            "-march=native",
            "-ffp-contract=fast",
            "-o",
            "fma",
            "fma.c",
            "-lm",
        ]
        (folder / "fma.c").write_text(TEST.replace("== EXPECTED ? 0 : 1", ">= 0 ? 0 : 1"))
        if built(judge, f"{name}, products and sums contracted, {real}", folder, *contracted):
            judge.that(
                f"{name}, contracted: the self-test finds it within its tolerance",
                run(folder / "fma", folder=folder).returncode == 0,
            )


def on_cortex(judge: Judge, folder: Path, expected: int, real: str) -> list[str]:
    """A Cortex-M4F in qemu."""
    missing = [p for p in ("arm-none-eabi-gcc", "qemu-system-arm") if not shutil.which(p)]
    if missing:
        return missing
    (folder / "board.c").write_text(BOARD.replace("EXPECTED", str(expected)))
    (folder / "board.ld").write_text(MAP)
    options = f"-std=gnu99 -Os -ffp-contract=off {CORTEX} -nostartfiles -T board.ld"
    command = [
        "arm-none-eabi-gcc",
        *options.split(),
        "-o",
        "board.elf",
        "board.c",
        "-lm",
        "-lc",
        "-lgcc",
        "--specs=nosys.specs",
    ]
    if built(judge, f"arm-none-eabi-gcc, Cortex-M4F, {real}", folder, *command):
        machine = "qemu-system-arm -M mps2-an386 -nographic -semihosting-config enable=on,target=native -kernel board.elf"
        done = run(*machine.split(), folder=folder)
        judge.that(f"Cortex-M4F in qemu, {real}: self-test", done.returncode == 0)
    return []


def on_wasm(judge: Judge, folder: Path, expected: int, real: str) -> list[str]:
    """WebAssembly by the compiler of the `ziglang` wheel, in node."""
    missing = [] if shutil.which("node") else ["node"]
    try:
        import ziglang  # noqa: F401
    except ImportError:
        missing.append("ziglang (pip install ziglang)")
    if missing:
        return missing
    (folder / "wasm.c").write_text(
        '#include "arm.h"\nint selftest(void);\nint selftest(void) { return arm_selftest(); }\n'
    )
    (folder / "wasm.js").write_text(NODE)
    options = "-target wasm32-wasi -mexec-model=reactor -std=c99 -O2 -ffp-contract=off -Wl,--export=selftest -o test.wasm wasm.c"
    if built(judge, f"WebAssembly, {real}", folder, sys.executable, "-m", "ziglang", "cc", *options.split()):
        done = run("node", "wasm.js", "test.wasm", str(expected), folder=folder)
        judge.that(f"WebAssembly in node, {real}: self-test", done.returncode == 0)
        if done.returncode:
            print(done.stderr[:500])
    return []


def main() -> None:
    asked = parser(__doc__).parse_args()
    judge, missing = Judge(), [n for n in ("gcc", "clang") if n not in compilers()]
    with tempfile.TemporaryDirectory() as name:
        for precision, expected in (("double", 0), ("float", 1)):
            folder = Path(name) / precision
            loops = arm()
            export_loop(loops, T, folder, name="arm", precision=precision)
            export_laws(
                {n: j.compensator.friction.law for n, j in loops.items()},
                folder,
                name="laws",
                precision=precision,
            )
            on_hosts(judge, folder, expected, precision, asked.short)
            missing += on_cortex(judge, folder, expected, precision)
            missing += on_wasm(judge, folder, expected, precision)
    if missing and not judge.short:
        print(f"absent: {', '.join(dict.fromkeys(missing))}")
        sys.exit(2)
    judge.end()


if __name__ == "__main__":
    main()
