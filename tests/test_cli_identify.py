"""Tests for the commands identify, validate and demo, as processes and in this one: exit codes, JSON, files."""

import json

import numpy as np
import pytest

from _commands import called, started
from _synthetic import any_motion
from backdrive.plans import load_plan
from backdrive.simulation.machines import joint_1
from backdrive.simulation.open_loop import simulate


def dry(v):
    return 5.0 * np.sign(v) + 2.0 * v


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("logs")
    for name, seed in (("a", 0), ("b", 1)):
        log = any_motion(dry, seconds=15.0, seed=seed, phase=20.0 * seed)
        np.savez(path / f"{name}.npz", t=log.time, q=log.position, tau=log.torque)
    done = started("identify", path / "a.npz", "-o", path / "m.json", "--report", path / "r.html")
    assert done.returncode == 0, done.stdout + done.stderr
    return path


def test_identify_writes_model_and_report(folder):
    model = json.loads((folder / "m.json").read_text())
    assert model["joints"][0]["parameters"]["coulomb_positive"]["value"] == pytest.approx(5.0, abs=0.1)
    assert len(model["provenance"]["sources"][0]["sha256"]) == 64
    assert "<html" in (folder / "r.html").read_text()


def test_json_is_one_document(folder):
    done = called("identify", folder / "a.npz", "--json")
    answer = json.loads(done.stdout)
    assert answer["ok"]
    assert answer["method"] == "motion"
    assert done.returncode == 0


def test_validate_judges_and_gates(folder):
    done = started("validate", folder / "m.json", folder / "b.npz", "--json")
    assert done.returncode == 0, done.stdout + done.stderr
    assert next(iter(json.loads(done.stdout)["joints"].values()))["residual_percent"] < 5.0
    assert called("validate", folder / "m.json", folder / "b.npz", "--gate", "0.001").returncode == 1


def test_below_the_gate_is_exit_code_1_and_files_are_written_all_the_same(folder, tmp_path):
    done = started("identify", folder / "a.npz", "-o", tmp_path / "m.json", "--gate", "0.0001")
    assert done.returncode == 1
    assert "quality gate" in done.stderr
    assert (tmp_path / "m.json").exists()


def test_what_is_not_credible_is_below_the_gate(folder, tmp_path):
    log = any_motion(dry, seconds=15.0)
    fast = 3000.0 * log.position  # no machine is as fast
    np.savez(tmp_path / "fast.npz", t=log.time, q=fast, tau=log.torque)
    done = called("identify", tmp_path / "fast.npz", "--gate", "90")
    assert done.returncode == 1
    assert "not credible" in done.stdout and "quality gate" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (["identify"], 2, "LOGS|logs"),
        (["identify", "{a}", "--method", "magic"], 2, "constant-velocity"),
        (["identify", "{a}", "--joint", "knee"], 2, "joint"),
        (["identify", "{a}", "--map", "tau=nothing"], 2, "nothing"),
        (["identify", "{a}", "-o", "{folder}/no/such/m.json"], 2, "Cannot write"),
        (["identify", "{folder}/none.npz"], 3, "none.npz"),
        (["identify", "{folder}/garbage.npz"], 3, "garbage.npz"),
        (["validate", "{folder}/r.html", "{a}"], 3, "no friction model"),
        (["identify", "{a}", "--gear", "x"], 2, "--gear"),
        (["identify", "{a}", "--payload", "5"], 2, "neither 0 nor SIN:COS"),
        (["identify", "{a}", "--payload", "0:nan"], 2, "neither 0 nor SIN:COS"),
        (["identify", "{a}", "--payload", "0:2"], 2, "payloads"),
    ],
)
def test_failures_are_one_sentence_and_an_exit_code(folder, arguments, code, said):
    import re

    (folder / "garbage.npz").write_bytes(b"PK\x03\x04 nonsense")
    done = called(*(a.format(a=folder / "a.npz", folder=folder) for a in arguments))
    assert done.returncode == code, done.stdout + done.stderr
    assert "Traceback" not in done.stderr + done.stdout
    assert re.search(said, done.stderr)
    as_json = called(*(a.format(a=folder / "a.npz", folder=folder) for a in arguments), "--json")
    assert as_json.returncode == code


@pytest.mark.parametrize("name", ["demo", "inspect", "plan", "identify", "show", "validate"])
def test_every_command_explains_itself_with_an_example(name):
    done = called(name, "--help")
    assert done.returncode == 0
    assert f"Example: backdrive {name}" in " ".join(done.stdout.split())
    assert "--json" in done.stdout


def test_plans_are_named_one_a_log_by_file_or_folder(tmp_path):
    logs = []
    for name, center in (("one", "-1.047"), ("two", "1.047")):
        options = ("--center", center, "--stroke-deg", 20, "--top-speed", 2, "--cycles", 3)
        done = called("plan", "sweep", *options, "-o", tmp_path / name, "--draw", "none")
        assert done.returncode == 0, done.stdout + done.stderr
        plan = load_plan(tmp_path / name / "plan.json")
        log = simulate(joint_1(), plan)
        np.savez(tmp_path / f"{name}.npz", t=log.time, q=log.position, tau=log.torque)
        logs.append(tmp_path / f"{name}.npz")
    plans = ("--plan", tmp_path / "one", "--plan", tmp_path / "two" / "plan.json")
    done = called("identify", *logs, *plans, "--method", "sweep", "-o", tmp_path / "m.json")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "did not follow" not in done.stdout
    kept = json.loads((tmp_path / "m.json").read_text())["provenance"]["options"]["plan"]
    assert [round(p["center"], 3) for p in kept] == [-1.047, 1.047]


@pytest.mark.parametrize("name", ["r.pdf", "r.PNG", "r.json"])
def test_a_report_that_is_no_page_is_refused_before_the_work(tmp_path, name):
    # neither the log nor the model exists: what is read first would be missed first
    for words in (
        ("identify", tmp_path / "no.csv", "--report", tmp_path / name),
        ("estimate", tmp_path / "no.json", tmp_path / "no.csv", "--report", tmp_path / name),
        ("fleet", "page", "-o", tmp_path / "no", "--page", tmp_path / name),
    ):
        done = called(*words)
        assert done.returncode == 2
        assert "a report is an HTML page. Let its name end in .html" in " ".join(done.stderr.split())
    assert ("from a browser" in done.stderr) is name.endswith("pdf")
    assert not list(tmp_path.iterdir())


def test_demo_compares_with_the_truth(tmp_path):
    done = started("demo", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    rows = json.loads(done.stdout)["friction"]
    assert max(abs(r["error"]) for r in rows) < 0.1
    assert (tmp_path / "backdrive-demo" / "report.html").exists()
    hand = json.loads(done.stdout)["hand"]
    assert hand["compensated"] < 0.7 * hand["bare"]
    assert "A hand moves the joint" in (tmp_path / "backdrive-demo" / "report.html").read_text()
    again = started("demo", "--json", cwd=tmp_path)
    assert json.loads(again.stdout)["friction"] == rows
