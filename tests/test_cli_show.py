"""`backdrive show`: tables, a plot, JSON, pictures; and every failure as one message with its exit code."""

from __future__ import annotations

import io
import json
import re
import sys

import numpy as np
import pytest

from _example_identification import HOSTILE, example
from backdrive.cli import main
from backdrive.cli.show import _spell_out
from backdrive.model.file import decode, encode


@pytest.fixture(scope="module")
def result():
    return example(samples=300)


@pytest.fixture
def model(result, tmp_path):
    path = tmp_path / "model.json"
    result.model.save(path)
    return path


@pytest.fixture
def show(monkeypatch, capsys):
    def run(*arguments):
        monkeypatch.setenv("COLUMNS", "100")
        monkeypatch.setattr(sys, "argv", ["backdrive", "show", *map(str, arguments)])
        with pytest.raises(SystemExit) as stopped:
            main()
        said = capsys.readouterr()
        return stopped.value.code or 0, said.out, said.err

    return run


def test_tables_show_the_model(show, model, result):
    code, out, _ = show(model)
    assert code == 0
    for name in result.model.names:
        assert f"\n{name}  " in f"\n{out}"
    friction = result.model.joints[0]
    knots = [line for line in out.splitlines() if re.match(r"\s*\d\S+ +\d\S+ ± ", line)]
    for v, f, s in zip(
        friction.law.rate.velocity,
        friction.law.rate.positive,
        friction.standard_errors["positive"],
        strict=True,
    ):
        digits = 2 if s >= 0.1 else 3
        row = next(line for line in knots if float(line.split()[0]) == pytest.approx(v))
        assert f"{f:.{digits}f} ± {s:.{digits}f}" in row
    assert "≥ 0, at its bound" in out
    assert "kg.m^2" in out
    assert f"{friction.held_out.residual:.2f} %" in out
    assert "valid for" in out
    assert "beyond, it extrapolates" in out
    assert "not judged" in out
    assert "! viscous_negative ended at its lower bound" in out
    assert sum("\u2800" < c < "\u28ff" for c in out) > 300
    for source in result.model.sources:
        assert source.sha256 in out
    assert '"map": "t=t,q=qm,tau=35.15*vir"' in out


def test_one_joint(show, model):
    code, out, _ = show(model, "--joint", "joint_4", "-j", "joint_4")
    assert code == 0
    assert out.count("quality") == 1
    assert "joint_1" not in out
    assert "velocity [m/s]" in out


def test_json_is_the_file_and_the_curve(show, model, result):
    code, out, _ = show(model, "--json")
    document = json.loads(out)
    assert code == 0
    assert document["ok"] is True
    assert document["model"] == json.loads(model.read_text())
    assert encode(decode(json.dumps(document["model"]).encode())) == model.read_bytes()
    assert list(document["curves"]) == list(result.model.names)
    for name, curve in document["curves"].items():
        expected = result.model.torque(name, np.array(curve["velocity"]))
        assert len(curve["velocity"]) == 21
        assert curve["torque"] == pytest.approx(expected.tolist())
    assert document["curves"]["joint_4"]["torque_unit"] == "N"
    assert document["curves"]["joint_4"]["velocity_unit"] == "m/s"
    assert document["curves"]["joint_3"]["standard_error"] == [None] * 21
    assert min(document["curves"]["joint_1"]["standard_error"]) > 0


@pytest.mark.parametrize("suffix", ["svg", "png"])
def test_plot(show, model, tmp_path, suffix):
    picture = tmp_path / f"curves.{suffix}"
    code, out, _ = show(model, "--joint", "joint_5", "--plot", picture)
    assert code == 0
    assert out.splitlines()[-1] == f"Wrote {picture}."
    assert picture.read_bytes()[:8] == {"svg": b"<?xml ve", "png": b"\x89PNG\r\n\x1a\n"}[suffix]


def test_failures_are_one_message(show, model, tmp_path):
    damaged = tmp_path / "damaged.json"
    damaged.write_bytes(model.read_bytes()[:-40])
    other = tmp_path / "other.json"
    other.write_text("{}")
    cases = [
        ((tmp_path / "none.json",), 3, "none.json"),
        ((damaged,), 3, "damaged"),
        ((other,), 3, "not a friction model"),
        ((model, "--joint", "knee"), 2, "'knee'"),
        ((model, "--plot", tmp_path / "x.pdf"), 2, "x.pdf"),
        ((model, "--plot", tmp_path / "no" / "x.png"), 2, "Cannot write"),
    ]
    for arguments, code, words in cases:
        got, out, err = show(*arguments)
        assert got == code
        assert words in err
        assert "Traceback" not in err
        assert out == ""
    got, out, err = show(damaged, "--json")
    assert got == 3
    assert json.loads(out)["exit_code"] == 3
    assert err == ""


def test_hostile_names_reach_the_terminal_as_text(show, tmp_path):
    path = tmp_path / "model.json"
    example(HOSTILE, samples=300).model.save(path)
    code, out, _ = show(path)
    assert code == 0
    assert "<script>alert(1)</script>" in out
    assert not {"\x1b", "\x00", "\u202e"} & set(out)
    code, out, _ = show(path, "--json")
    assert list(json.loads(out)["curves"]) == list(HOSTILE)


def test_a_terminal_without_signs_loses_none():
    raw = io.BytesIO()
    stream = io.TextIOWrapper(raw, encoding="ascii")
    _spell_out(stream)
    stream.write("\u22120.012 ± 0.011 ≥ 0 ⣀")
    stream.flush()
    assert raw.getvalue() == b"-0.012 +/- 0.011 >= 0 ?"
