"""Tests for cli/compare.py: two model files, joint by joint, as a stranger would ask."""

import json
import sys

import numpy as np
import pytest

from backdrive.cli import main
from backdrive.laws import Law, Polyline
from backdrive.logs.log import Joint
from backdrive.model import FrictionModel, JointFriction, Validity
from backdrive.model.file import encode

V = tuple(np.linspace(0.2, 2.0, 6))


def joint(name="elbow", level=1.0, error=0.02, unit="rad"):
    F = tuple(level * (9.0 + 3.0 * np.array(V)))
    errors = {} if error is None else {"positive": (error,) * 6, "negative": (error,) * 6}
    return JointFriction(
        joint=Joint(name=name, unit=unit),
        law=Law(rate=Polyline(velocity=V, positive=F, negative=F)),
        validity=Validity(velocity=(-2.0, 2.0)),
        standard_errors=errors,
    )


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    files = {
        "a": [joint(), joint("wrist")],
        "b": [joint(), joint("wrist", 0.88)],
        "same": [joint(level=1.0005)],
        "plain": [joint(error=None)],
        "half": [joint("elbow", error=None), joint("wrist", 0.88)],
        "slide": [joint(unit="m")],
        "other": [joint("hip")],
        "huge": [joint(level=1e307)],
    }
    for name, joints in files.items():
        (tmp_path / f"{name}.json").write_bytes(encode(FrictionModel(joints=tuple(joints))))
    (tmp_path / "broken.json").write_text("{")
    unit = json.loads((tmp_path / "same.json").read_text())
    unit["joints"][0]["parameters"]["positive"]["unit"] = "N"
    (tmp_path / "unit.json").write_text(json.dumps(unit))

    def call(*words: str):
        monkeypatch.setattr(sys, "argv", ["backdrive", "compare", *words])
        with pytest.raises(SystemExit) as caught:
            main()
        captured = capsys.readouterr()
        return int(caught.value.code or 0), captured.out, captured.err

    return call


def test_every_joint_gets_a_verdict_and_a_change_an_exit_code(run):
    code, out, _ = run("a.json", "b.json")
    assert code == 1
    assert "elbow: not changed beyond chance" in out
    assert "wrist: changed by -12.0 +- " in out
    assert "12.00 %" in out
    code, out, _ = run("a.json", "b.json", "--joint", "elbow")
    assert code == 0
    assert "wrist" not in out


def test_json_has_distances_intervals_and_the_test(run):
    code, out, _ = run("a.json", "b.json", "--json")
    found = json.loads(out)
    assert code == 1
    assert found["changed"] == ["wrist"]
    wrist = found["joints"]["wrist"]
    assert wrist["outcome"] == "changed"
    assert wrist["relative"]["positive"] == pytest.approx(0.12)
    low, high = wrist["mean_change_interval"]
    assert low < -0.12 < high < -0.11
    assert wrist["probability"] < 1e-6
    assert wrist["degrees_of_freedom"] == 6


def test_joints_that_only_one_model_has_are_named(run):
    code, out, _ = run("a.json", "same.json")
    assert code == 0
    assert "'wrist' is only in the first model" in out
    code, out, _ = run("a.json", "other.json", "--joint", "elbow=hip")
    assert code == 0
    assert "hip: not changed" in out


def test_a_joint_without_intervals_is_named_beside_those_with(run):
    code, out, _ = run("a.json", "half.json")
    assert code == 1
    assert "cannot be tested" in out
    assert "second model has no standard errors" in out


def test_without_standard_errors_there_are_distances_and_no_verdict(run):
    code, out, err = run("b.json", "plain.json")
    assert code == 2
    assert "0.00 %" in out
    assert "cannot be tested" in out
    assert "The test cannot decide whether friction has changed" in err
    code, out, err = run("b.json", "plain.json", "--json")
    found = json.loads(out)
    assert (code, found["ok"], found["exit_code"]) == (2, False, 2)
    assert "cannot be tested" in found["joints"]["elbow"]["verdict"]
    assert found["joints"]["elbow"]["distance"]["positive"] == 0.0
    assert "second model has no standard errors" in found["error"]["message"]


def test_a_joint_named_twice_is_compared_once(run):
    code, out, _ = run("a.json", "b.json", "-j", "elbow", "-j", "elbow")
    assert code == 0
    assert out.count("elbow: ") == 1


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        ("a.json slide.json", 2, "a.json and slide.json: Joint 'elbow' is in rad in one model"),
        ("a.json unit.json", 3, "unit.json: "),
        ("a.json huge.json", 3, "huge.json: $.joints[0].parameters"),
        ("a.json other.json", 2, "no joint in common"),
        ("a.json b.json --joint knee", 2, "knee"),
        ("a.json b.json --alarm 2", 2, "--alarm 2 is no probability"),
        ("a.json b.json --top-speed -1", 2, "--top-speed -1 is no speed"),
        ("a.json b.json --top-speed 0", 2, "--top-speed 0"),
        ("a.json b.json --top-speed nan", 2, "--top-speed nan"),
        ("a.json b.json --top-speed 100", 2, "both models hold up to 2 rad/s"),
        ("a.json broken.json", 3, "broken.json"),
        ("a.json nowhere.json", 3, "nowhere.json"),
    ],
)
def test_bad_input_is_named(run, words, code, said):
    found, out, err = run(*words.split())
    assert found == code
    assert said in err
    assert "Traceback" not in out + err
    found, out, _ = run(*words.split(), "--json")
    assert found == code
    assert json.loads(out)["ok"] is False
