"""`backdrive estimate --urdf --frame` on a log of a whole arm."""

import json

import numpy as np
import pytest

pytest.importorskip("pinocchio")

from _arm_force import PUSH, ROBOT, SLIDING, TEXT, log_of
from _commands import called

NAMES = ",".join(ROBOT.joints)
MAP = "t=t,q=q0..q5,tau=u0..u5,tau_ext=e0..e5"


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("arm")
    log = log_of(PUSH, n=4000)
    rng = np.random.default_rng(0)
    columns = [
        log.time,
        *log.position.T,
        *log.torque.T,
        *(log.external_torque + rng.normal(0, 1e-3, log.torque.shape)).T,
    ]
    heading = ["t", *(f"{c}{i}" for c in "que" for i in range(6))]
    np.savetxt(
        folder / "log.csv", np.column_stack(columns), delimiter=",", header=",".join(heading), comments=""
    )
    SLIDING.save(folder / "arm.json")
    (folder / "arm.xml").write_text(TEXT)
    return folder


def command(folder, *more):
    return called("estimate", folder / "arm.json", folder / "log.csv", "--map", MAP, "--names", NAMES, *more)


def test_a_wrench_is_printed_saved_and_given_as_json(files, tmp_path):
    done = command(
        files, "--urdf", files / "arm.xml", "--frame", "tip", "-o", tmp_path / "f.csv", "--bandwidth", "60"
    )
    assert done.returncode == 0, done.stderr
    assert "wrench at tip" in done.stdout
    assert "mz" in done.stdout
    assert "tip_mz [N.m]" in (tmp_path / "f.csv").read_text().splitlines()[0]
    told = json.loads(command(files, "--urdf", files / "arm.xml", "--frame", "tip", "--json").stdout)
    assert told["wrench"]["frame"] == "tip"
    assert len(told["wrench"]["rms_error"]) == 6
    assert told["joints"]["j1"]["rms_error"] < 1.0


def test_what_is_missing_is_named(files):
    for more, words in (
        ((), "--urdf"),
        (("--urdf", files / "arm.xml", "--frame", "hand"), "no frame 'hand'"),
        (("--urdf", files / "gone.urdf"), "gone.urdf"),
    ):
        done = command(files, *more)
        assert done.returncode != 0
        assert words in done.stderr
