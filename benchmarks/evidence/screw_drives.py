"""Three screw drives, 108 constant-velocity runs: is the friction curve bent, or does a straight line suffice?

One command a drive. Each run is left out in turn and predicted from the others; the rms of those errors is compared with that of a
straight line per direction.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

from _common import Judge, data, parser

from backdrive.identification.constant_velocity import compare_sections
from backdrive.identification.runs import find_runs
from backdrive.logs.readers import read_logs

TORQUE = 9.84e-5  # motor torque of one percent [N.m]
MAP = f't=time,dq=rpm*"Velocity actual value averaged",tau={TORQUE}*"Torque actual value averaged"'
BENT = {1: True, 2: False, 3: True}


def main() -> None:
    """Run the command on every drive and judge what it says."""
    parser(__doc__).parse_args()  # it takes seconds, shortened or not
    judge = Judge()
    total = 0
    for drive, bent in BENT.items():
        folder = data("screw_drives", f"driveNo{drive}", "steady_state", "0.096kg")
        with tempfile.TemporaryDirectory() as scratch:
            model = Path(scratch, "model.json")
            command = ["identify", str(folder), "--map", MAP, "-o", str(model), "--repair", "--json"]
            done = subprocess.run(
                [sys.executable, "-m", "backdrive", *command], capture_output=True, text=True, check=False
            )
            print(f"drive {drive}: backdrive identify FOLDER --map '{MAP}' -o model.json --repair")
            if done.returncode:
                judge.that(
                    f"drive {drive}: the command ended with {done.returncode}: {done.stdout}{done.stderr}",
                    False,
                )
                continue
            answer = json.loads(done.stdout)
        logs = read_logs([folder], map=MAP)
        runs = [run for log in logs for run in find_runs(log, 0)]
        total += len(runs)
        verdict = next(iter(answer["verdicts"].values()))
        print(f"    method {answer['method']} ({answer['reason']}), {len(runs)} runs")
        print(f"    {verdict}")
        rms = compare_sections(runs)
        print(
            "    sections per direction -> rms of left-out runs [N.m]: ",
            {k: f"{v:.3g}" for k, v in rms.items()},
        )
        says_line = "suffices" in verdict
        if bent:
            best = min(rms.values())
            judge.that(
                f"drive {drive}: a curve beats the line ({best:.3g} against {rms[1]:.3g} N.m)", best < rms[1]
            )
            judge.that(f"drive {drive}: the command says that the curve is bent", not says_line)
        else:
            judge.that(f"drive {drive}: the command says that a straight line suffices", says_line)
    judge.that(f"{total} runs of 108 used", total == 108)
    judge.end()


if __name__ == "__main__":
    main()
