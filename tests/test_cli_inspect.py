"""Tests for `backdrive inspect`."""

import json

import numpy as np
import pytest

from _commands import called, started
from _synthetic import any_motion
from backdrive.cli.inspect import PLAIN, small_plot


def inspect(*arguments):
    return called("inspect", *arguments)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("logs")
    log = any_motion(lambda v: 5.0 * np.sign(v) + 2.0 * v, seconds=20.0)
    np.savez(path / "good.npz", t=log.time, q=log.position, tau=log.torque)
    np.savez(path / "inverted.npz", t=log.time, q=log.position, tau=-log.torque)
    velocity = np.gradient(log.position, log.time, axis=0)
    np.savez(path / "degrees.npz", t=log.time, q=np.rad2deg(log.position), dq=velocity, tau=log.torque)
    torque = log.torque.copy()
    torque[50] = np.nan
    np.savez(path / "nan.npz", t=log.time, q=log.position, tau=torque)
    return path


def test_a_clean_log_is_shown_and_called_clean(folder):
    done = inspect(folder / "good.npz")
    assert done.returncode == 0, done.stdout + done.stderr
    assert started("inspect", folder / "good.npz").stdout == done.stdout
    for word in ("10000 samples", "500 Hz", "position", "rad", "torque", "N.m", "No faults found"):
        assert word in done.stdout


def test_json_holds_what_is_shown(folder):
    answer = json.loads(inspect(folder / "good.npz", "--json").stdout)
    (log,) = answer["logs"]
    assert answer["ok"]
    assert log["rate"] == pytest.approx(500.0)
    assert log["joints"][0]["channels"]["torque"]["unit"] == "N.m"
    assert len(log["sources"][0]["sha256"]) == 64
    assert log["findings"] == []


@pytest.mark.parametrize(
    ("name", "finding"), [("inverted", "torque-sign"), ("nan", "nan"), ("degrees", "degrees")]
)
def test_a_spoiled_log_is_exit_code_1_with_a_remedy(folder, name, finding):
    done = inspect(folder / f"{name}.npz", "--json")
    assert done.returncode == 1
    found = {f["name"]: f for f in json.loads(done.stdout)["logs"][0]["findings"]}
    assert found[finding]["remedy"]
    assert inspect(folder / f"{name}.npz", "--accept", finding).returncode == 0


def test_an_unknown_finding_to_accept_is_answered_with_the_known_ones(folder):
    done = inspect(folder / "good.npz", "--accept", "torque-sin")
    assert done.returncode == 2
    assert "torque-sign" in done.stderr


def test_small_plots_follow_the_values():
    assert small_plot(np.linspace(0, 1, 80), PLAIN, 8) == PLAIN
    assert small_plot(np.full(5, np.nan), PLAIN, 8).strip() == ""
    assert len(set(small_plot(np.ones(100), PLAIN, 8))) == 1
    assert small_plot(np.array([]), PLAIN, 8) == " "


@pytest.mark.parametrize("kind", ["swapped", "shuffled", "two runs"])
def test_rate_and_duration_are_those_of_stamps_in_order(folder, tmp_path, kind):
    log = np.load(folder / "good.npz")
    n = log["t"].size
    rows = np.arange(n)
    if kind == "swapped":
        rows = np.arange(n).reshape(-1, 2)[:, ::-1].ravel()
    elif kind == "shuffled":
        rows = np.random.default_rng(3).permutation(n)
    time = log["t"] % (log["t"][-1] / 2) if kind == "two runs" else log["t"][rows]
    np.savez(tmp_path / "log.npz", t=time, q=log["q"][rows], tau=log["tau"][rows])
    (about,) = json.loads(inspect(tmp_path / "log.npz", "--json").stdout)["logs"]
    assert any(f["name"] == "unsorted-time" for f in about["findings"])
    assert about["rate"] == pytest.approx(500.0, rel=1e-6)
    assert about["duration"] == pytest.approx(20.0, abs=0.03)
    assert about["longest_interval"] < 0.03 and about["jitter"] < 0.1
