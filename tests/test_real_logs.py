"""The evidence programs on real logs: met where the logs are, and saying so where they are not."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

EVIDENCE = Path(__file__).resolve().parent.parent / "benchmarks" / "evidence"
NEED_LOGS = ("emps", "kuka", "screw_drives", "ur3")


def run(name: str, **environment: str) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, str(EVIDENCE / f"{name}.py")],
        capture_output=True,
        text=True,
        check=False,
        env={k: v for k, v in os.environ.items() if k != "BACKDRIVE_DATA"} | environment,
    )


@pytest.mark.parametrize("name", NEED_LOGS)
def test_absent_logs_are_said(name):
    done = run(name)
    assert done.returncode == 2, done.stdout + done.stderr
    assert "BACKDRIVE_DATA" in done.stdout


@pytest.mark.skipif("BACKDRIVE_DATA" not in os.environ, reason="real logs are absent")
@pytest.mark.parametrize("name", NEED_LOGS)
def test_evidence_is_met_on_real_logs(name):
    done = run(name, BACKDRIVE_DATA=os.environ["BACKDRIVE_DATA"])
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.rstrip().endswith("met")
