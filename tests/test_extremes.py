"""Numbers beyond any measurement, in a log, a --map or an option, are refused by name; nothing overflows on the way."""

import sys

import numpy as np
import pytest

from backdrive.cli import main
from backdrive.errors import InvalidInput
from backdrive.logs.filters import low_pass
from backdrive.logs.log import Joint, Log
from backdrive.plans import ConstantVelocity, Sweep


def answer(monkeypatch, capsys, *words) -> tuple[int, str]:
    monkeypatch.setattr(sys, "argv", ["backdrive", *words])
    with pytest.raises(SystemExit) as ended:
        main()
    return ended.value.code, capsys.readouterr().err


@pytest.fixture
def columns() -> dict[str, np.ndarray]:
    t = np.arange(1500) / 500.0
    w = 2 * np.pi
    q, dq = 0.5 * np.sin(w * t), 0.5 * w * np.cos(w * t)
    return {"t": t, "q": q, "dq": dq, "tau": -0.15 * w * w * np.sin(w * t) + 2 * np.sign(dq)}


def written(folder, columns) -> str:
    np.savez(folder / "log.npz", **columns)
    return str(folder / "log.npz")


@pytest.mark.parametrize(
    ("column", "word"), [("t", "time"), ("q", "position"), ("dq", "velocity"), ("tau", "torque")]
)
@pytest.mark.parametrize("value", [1e305, -1e160])
def test_a_value_that_no_sensor_gives_is_named(columns, column, word, value, tmp_path, monkeypatch, capsys):
    columns[column][700] = value
    code, said = answer(monkeypatch, capsys, "inspect", written(tmp_path, columns))
    assert code == 2
    assert word in said and f"{value:g} at sample 700" in said


@pytest.mark.parametrize(
    ("mapping", "named"),
    [
        ("q=q[99999999999999999999]", "99999999999999999999"),
        ("q=q[0:99999999999999999999]", "99999999999999999999"),
        (f"q=q[{'9' * 5000}]", "is not a column index"),
        ("q=1e308*q", "1e+308"),
        ("tau=1e308*tau+1e308*tau", "1e+308"),
        ("tau=1e400*tau", "not finite"),
        ("tau=1e30*tau+1e61*tau", "1e+61"),
        ("t=1e-320*t", "e-32"),
        ("t=1e-310*index", "1e-310"),
        ("t=1e300*t", "1e+300"),
    ],
)
def test_a_factor_or_index_beyond_reason_is_named(columns, mapping, named, tmp_path, monkeypatch, capsys):
    code, said = answer(
        monkeypatch,
        capsys,
        "inspect",
        written(tmp_path, columns),
        "--map",
        "t=t," * ("t=" not in mapping) + mapping,
    )
    assert code == 2
    assert named in " ".join(said.split())  # lines are wrapped


def test_values_up_to_the_bound_are_reckoned_with(columns, tmp_path, monkeypatch, capsys):
    columns["tau"] *= 1e59
    columns["dq"] *= 1e-320
    code, said = answer(monkeypatch, capsys, "inspect", written(tmp_path, columns))
    assert code in (0, 1), said


def test_a_falling_clock_is_a_finding(columns, tmp_path, monkeypatch, capsys):
    columns["t"] = -columns["t"]
    code, said = answer(monkeypatch, capsys, "inspect", written(tmp_path, columns))
    assert (code, said) == (1, "")


@pytest.mark.parametrize(
    "options",
    [
        ["--center", "1e305"],
        ["--center=-1e308"],
        ["--lead-in", "1e305"],
        ["--stroke", "1e-320"],
        ["--top-speed", "1e-320"],
        ["--velocity-limit", "1e-320"],
        ["--stroke", "1e400"],
        ["--cycles", "99999999999999999999"],
    ],
)
def test_a_plan_beyond_reason_is_refused(options, tmp_path, monkeypatch, capsys):
    words = ["plan", "sweep", "--stroke", "0.5", "--top-speed", "1", *options, "-o", str(tmp_path / "plan")]
    code, said = answer(monkeypatch, capsys, *words)
    assert code == 2
    assert "internal" not in said
    assert not (tmp_path / "plan").exists()


@pytest.mark.parametrize(
    "options",
    [
        ["ramp", "--amplitude", "1e305", "--torque-rate", "1"],
        ["ramp", "--amplitude", "1e-320", "--torque-rate", "1"],
        ["ramp", "--amplitude", "5", "--torque-rate", "1e305"],
        ["ramp", "--amplitude", "5", "--torque-rate", "1", "--offset", "1e305"],
        ["sine-torque", "--amplitude", "1e305", "--frequency", "1"],
        ["sawtooth-torque", "--amplitude", "1e305", "--frequency", "1"],
        ["constant-velocity", "--stroke", "0.5", "--speeds", "1e305"],
        ["constant-velocity", "--stroke", "0.5", "--speeds", "0.1", "--pause", "1e305"],
    ],
)
def test_other_plans_too(options, tmp_path, monkeypatch, capsys):
    code, said = answer(monkeypatch, capsys, "plan", *options, "-o", str(tmp_path / "plan"))
    assert code == 2
    assert "internal" not in said


@pytest.mark.parametrize("gear", ["1e305", "1e-320", "1e400"])
def test_a_gear_beyond_reason_is_refused(columns, gear, tmp_path, monkeypatch, capsys):
    code, said = answer(monkeypatch, capsys, "inspect", written(tmp_path, columns), "--gear", gear)
    assert code == 2
    assert "gear" in said


def test_in_python_the_same_are_typed_errors():
    time = np.arange(10) / 100.0
    with pytest.raises(InvalidInput, match=r"torque of joint 'j' is 1e\+305 at sample 3"):
        Log(
            time=time,
            joints=(Joint(name="j"),),
            position=time,
            torque=np.where(np.arange(10) == 3, 1e305, 0.0),
        )
    with pytest.raises(InvalidInput, match="interval is"):
        Log(time=1e-318 * time, joints=(Joint(name="j"),), position=time).period  # noqa: B018
    with pytest.raises(InvalidInput, match="the filter would remove everything"):
        low_pass(time, 1e-320, 100.0)
    with pytest.raises(InvalidInput, match="center"):
        Sweep(stroke=0.5, top_speed=1.0, cycles=4, center=1e305)
    with pytest.raises(InvalidInput, match="speeds"):
        ConstantVelocity(stroke=0.5, speeds=(1e305,))


def test_infinities_stay_holes():
    time = np.arange(10) / 100.0
    log = Log(time=time, joints=(Joint(name="j"),), position=np.where(np.arange(10) == 3, np.inf, time))
    assert np.isinf(log.position[3, 0])
