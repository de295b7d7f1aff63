"""Joints are matched by their names in the data; where these are missing or differ, a person says which is which."""

import json

import numpy as np
import pytest

from _commands import called
from _synthetic import any_motion
from backdrive import load_model


def table(path, columns):
    names, values = zip(*columns.items(), strict=True)
    np.savetxt(path, np.column_stack(values), delimiter=",", header=",".join(names), comments="", fmt="%.9g")
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two joints of different friction, as tables of named, of otherwise named and of nameless joints."""
    path = tmp_path_factory.mktemp("names")
    logs = [
        any_motion(lambda v, c=c: c * np.sign(v) + 0.4 * v, seconds=12.0, rate=200.0, phase=p)
        for c, p in ((2.0, 0.0), (0.7, 3.0))
    ]
    (q1, t1), (q2, t2) = ((log.position[:, 0], log.torque[:, 0]) for log in logs)
    t = logs[0].time
    named = {"t": t, "elbow_pos": q1, "elbow_effort": t1, "wrist_pos": q2, "wrist_effort": t2}
    table(path / "named.csv", named)
    table(path / "other.csv", {k.replace("elbow", "a").replace("wrist", "b"): x for k, x in named.items()})
    swapped = {k: named[k] for k in ("t", "wrist_pos", "wrist_effort", "elbow_pos", "elbow_effort")}
    table(path / "swapped.csv", swapped)
    for name in ("named", "other", "swapped"):
        done = called("identify", path / f"{name}.csv", "-o", path / f"{name}.json", "--gate", "1e9")
        assert done.returncode == 0, done.stderr
    return path


def test_equal_data_is_unchanged_in_whatever_order_its_columns_stand(folder):
    done = called("compare", folder / "named.json", folder / "swapped.json", "--json")
    assert done.returncode == 0 and json.loads(done.stdout)["changed"] == []


def test_names_that_differ_are_refused_with_both_sides_until_a_person_says_which_is_which(folder):
    refused = called("compare", folder / "named.json", folder / "other.json")
    assert refused.returncode == 2
    for word in ("elbow", "wrist", "a, b", "--rename"):
        assert word in refused.stderr
    pairs = ("--rename", "a=elbow", "--rename", "b=wrist")
    done = called("compare", folder / "named.json", folder / "other.json", *pairs, "--json")
    assert done.returncode == 0 and set(json.loads(done.stdout)["joints"]) == {"elbow", "wrist"}
    crossed = ("--rename", "a=wrist", "--rename", "b=elbow")
    assert called("compare", folder / "named.json", folder / "other.json", *crossed).returncode == 1


def test_a_log_is_judged_by_the_joints_that_a_person_renames(folder):
    refused = called("validate", folder / "named.json", folder / "other.csv")
    assert refused.returncode == 2
    for word in ("elbow, wrist", "a, b", "--rename"):
        assert word in refused.stderr
    pairs = ("--rename", "a=elbow", "--rename", "b=wrist")
    done = called("validate", folder / "named.json", folder / "other.csv", *pairs, "--json")
    assert done.returncode == 0
    rows = json.loads(done.stdout)["joints"]
    assert all(row["residual_percent"] < 5.0 for row in rows.values()) and set(rows) == {"elbow", "wrist"}


@pytest.mark.parametrize("pair", ["a", "=elbow", "nobody=elbow", "a=wrist"])
def test_a_renaming_that_makes_no_sense_is_refused(folder, pair):
    more = () if pair != "a=wrist" else ("--rename", "b=wrist")
    done = called("validate", folder / "named.json", folder / "other.csv", "--rename", pair, *more)
    assert done.returncode == 2 and "--rename" in done.stderr


def coupled(folder, arm, still):
    """Write motors of two coupled joints, the second at rest where `still`, and return the arguments that read them."""
    matrix = np.array([[1.0, 0.0], [-0.5, 1.0]])
    (folder / "c.csv").write_text("1,0\n-0.5,1\n")
    q = np.column_stack([arm.position[:, 0], np.zeros(len(arm)) if still else 0.5 * arm.position[::-1, 0]])
    tau = np.column_stack([arm.torque[:, 0], np.zeros(len(arm)) if still else 0.5 * arm.torque[::-1, 0]])
    motors, forces = q @ np.linalg.inv(matrix).T, tau @ matrix
    columns = {"t": arm.time, "q1": motors[:, 0], "q2": motors[:, 1], "i1": forces[:, 0], "i2": forces[:, 1]}
    table(folder / "motors.csv", columns)
    return (folder / "motors.csv", "--map", "q=q1..q2,tau=i1..i2", "--coupling", folder / "c.csv")


def test_the_coupling_stays_where_a_joint_is_idle(tmp_path):
    arm = any_motion(lambda v: 2.0 * np.sign(v) + 0.4 * v, seconds=12.0, rate=200.0)
    arguments = coupled(tmp_path, arm, still=True)
    done = called(
        "identify",
        *arguments,
        "--accept",
        "silent-torque",
        "--accept",
        "no-motion",
        "-o",
        tmp_path / "m.json",
    )
    assert done.returncode == 0, done.stderr
    model = load_model(tmp_path / "m.json")
    assert len(model.names) == 1 and len(model.coupled) == 2 and model.coupled[0] == model.names[0]
    assert np.array(model.coupling).shape == (2, 2)


def test_held_out_logs_are_read_with_the_joined_file(tmp_path):
    log = any_motion(lambda v: 2.0 * np.sign(v) + 0.4 * v, seconds=24.0, rate=200.0)
    t, q, tau = log.time + 100.0, log.position[:, 0], log.torque[:, 0]
    half = len(log) // 2
    table(tmp_path / "first.csv", {"t": t[:half], "q": q[:half]})
    table(tmp_path / "second.csv", {"t": t[half:], "q": q[half:]})
    table(tmp_path / "drive.csv", {"t": t, "tau": tau})
    joined = ("--join", tmp_path / "drive.csv", "--hold-out", tmp_path / "second.csv")
    done = called("identify", tmp_path / "first.csv", *joined, "--json")
    assert done.returncode == 0, done.stderr
    # one whose clock begins at zero, as the joined file's would, is of no known recording
    table(tmp_path / "zero.csv", {"t": t[half:] - t[half], "q": q[half:]})
    table(tmp_path / "zero_drive.csv", {"t": t - t[0], "tau": tau})
    table(tmp_path / "zero_first.csv", {"t": t[:half] - t[0], "q": q[:half]})
    joined = ("--join", tmp_path / "zero_drive.csv", "--hold-out", tmp_path / "zero.csv")
    done = called("identify", tmp_path / "zero_first.csv", *joined)
    assert done.returncode == 2 and "begin at 0 s" in done.stderr


def test_a_number_in_brackets_is_a_joint_with_or_without_a_blank(tmp_path):
    log = any_motion(lambda v: 2.0 * np.sign(v), seconds=12.0, rate=200.0)
    for between in ("", " "):
        names = {f"position{between}[1]": log.position[:, 0], f"effort{between}[1]": log.torque[:, 0]}
        table(tmp_path / "log.csv", {"time": log.time, **names})
        done = called("inspect", tmp_path / "log.csv", "--json")
        assert done.returncode == 0, done.stderr
        (about,) = json.loads(done.stdout)["logs"]
        assert set(about["joints"][0]["channels"]) == {"position", "torque"}


def test_a_current_taken_for_torque_is_a_warning(tmp_path):
    log = any_motion(lambda v: 2.0 * np.sign(v), seconds=12.0, rate=200.0)
    table(
        tmp_path / "log.csv", {"t": log.time, "q": log.position[:, 0], "current_mA": 1e3 * log.torque[:, 0]}
    )
    asked = (tmp_path / "log.csv", "--map", "t=t,q=q,tau=current_mA")
    answer = json.loads(called("identify", *asked, "--json").stdout)
    (joint,) = answer["model"]["joints"]
    assert joint["verdict"]["grade"] == "care"
    assert [w for w in joint["warnings"] if "was taken as SI" in w]
    assert not any("was taken as SI" in w for w in answer["warnings"])  # said once
    factor = called("identify", asked[0], "--map", "t=t,q=q,tau=1*current_mA", "--json").stdout
    assert json.loads(factor)["model"]["joints"][0]["verdict"]["grade"] == "good"
    seen = called("inspect", *asked).stdout
    assert seen.count("was taken as SI") == 1 and "No faults found" not in seen
