"""Arguments of wrong types at every public function: an error in the package's words, never Python's own."""

from __future__ import annotations

import inspect
import warnings

import numpy as np
import pytest

from backdrive import (
    Axis,
    Drive,
    FrictionModel,
    Joint,
    Law,
    Log,
    Sweep,
    check,
    compare,
    forward,
    identify,
    load_model,
    read_log,
    read_logs,
    rollout,
    simulate,
    tune,
)
from backdrive.errors import BackdriveError, InvalidInput
from backdrive.laws import CoulombViscous
from backdrive.simulation.machines import machine

WRONG = (3, "x", None, [1, 2], {"a": 1}, float("nan"), -1, object(), np.zeros((2, 2)), True)
PLAN = Sweep(stroke=0.35, top_speed=2.0, cycles=2)
LAW = Law(rate=CoulombViscous(coulomb_positive=1.0, coulomb_negative=1.0))
AXIS, U, Q = Axis(law=LAW, inertia=0.7), np.zeros(8), np.linspace(0.0, 1.0, 20)
TUNE = {"stiffness": (8e4, 1.2e5), "inertia": (0.2, 0.4), "counts": 1e6, "top_speed": 3.0, "joints": 8}


@pytest.fixture(scope="module")
def log() -> Log:
    return simulate(machine("joint_1"), PLAN, rate=500.0)


@pytest.fixture(scope="module")
def model(log) -> FrictionModel:
    return identify(log).model


def refuse(call) -> None:
    """Call with every wrong value: whatever is not accepted is refused in the package's words."""
    for value in WRONG:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                call(value)
        except BackdriveError as error:
            assert str(error)
        except Exception as error:
            pytest.fail(f"{value!r}: {type(error).__name__}: {error}")


def options(function, *left_out: str) -> list[str]:
    names = list(inspect.signature(function).parameters)
    return [name for name in names if name not in left_out]


@pytest.mark.parametrize("name", options(identify, "logs"))
def test_identify(log, name):
    refuse(lambda value: identify(log, **{name: value}))


@pytest.mark.parametrize("name", options(read_log, "path"))
def test_read_log(log, tmp_path, name):
    np.savez(tmp_path / "log.npz", t=log.time, q=log.position, tau=log.torque)
    refuse(lambda value: read_log(tmp_path / "log.npz", **{"guarded": False, name: value}))


@pytest.mark.parametrize("name", ["joints", "rename", "top_speed", "alarm"])
def test_compare(model, name):
    refuse(lambda value: compare(model, model, **{name: value}))


@pytest.mark.parametrize("name", ["joint", "inertia", "seed", "rate", "torque_noise", "encoder_count"])
def test_simulate(model, name):
    short = Sweep(stroke=0.05, top_speed=2.0, cycles=1)
    refuse(lambda value: simulate(model, short, **{"inertia": 0.3, name: value}))


@pytest.mark.parametrize(
    "name", ["joint", "goal", "wish", "stroke", "effort", "noise", "interval", "seed", "limit"]
)
def test_tune(model, monkeypatch, name):
    from backdrive.tuning import propose

    def searched(*args, **more):
        raise InvalidInput("The arguments were accepted.", remedy="None is needed.")

    monkeypatch.setattr(propose, "_search_numbers", searched)
    refuse(lambda value: tune(model, **{**TUNE, name: value}))


@pytest.mark.parametrize(
    "name", ["position", "velocity", "log", "supply", "enabled", "temperature", "substeps", "workers", "dt"]
)
def test_forward(name):
    refuse(lambda value: forward(AXIS, U, **{"dt": 1e-3, name: value}))


@pytest.mark.parametrize("name", ["q", "dq", "load", "temperature", "workers", "dt"])
def test_rollout(name):
    motion = {} if name in ("q", "dq") else {"q": Q}
    refuse(lambda value: rollout(LAW, **{"dt": 1e-3, **motion, name: value}))


@pytest.mark.parametrize("name", ["time", "position", "velocity", "torque", "joints", "load", "temperature"])
def test_logs(log, name):
    channels = {"time": log.time, "position": log.position, "torque": log.torque}
    refuse(lambda value: Log(**{**channels, "joints": (Joint(name="a"),), name: value}))
    refuse(lambda value: Log.from_arrays(**{**channels, name: value}))


@pytest.mark.parametrize(
    "call",
    [
        identify,
        load_model,
        read_log,
        read_logs,
        check,
        lambda value: Joint(name=value),
        lambda value: Joint(name="a", unit=value),
        lambda value: Drive(law=value),
        lambda value: Drive(law="torque", gains=value),
        lambda value: Law(rate=value),
        lambda value: Axis(law=value, inertia=1.0),
        lambda value: Axis(law=LAW, inertia=value),
        lambda value: Sweep(stroke=value, top_speed=1.0, cycles=2),
        lambda value: Log.from_frame(value),
        lambda value: rollout(value, dt=1e-3, q=Q),
        lambda value: forward(value, U, dt=1e-3),
        lambda value: forward(AXIS, value, dt=1e-3),
        tune,
    ],
)
def test_what_is_passed_first(call):
    refuse(call)


@pytest.mark.parametrize("name", ["sample", "table", "summary", "loop", "save", "report", "joint"])
def test_models(model, tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)  # where a file may be called x
    refuse(getattr(model, name))
    refuse(lambda value: model.torque(value, 1.0))
    refuse(lambda value: model.torque(0, value))
    refuse(lambda value: compare(model, value))
    refuse(lambda value: simulate(value, PLAN))
    refuse(lambda value: simulate(model, value))


def test_the_message_names_argument_and_remedy(log):
    with pytest.raises(InvalidInput, match=r"cutoff = '10 Hz'\. Give a number, or None"):
        identify(log, cutoff="10 Hz")
    with pytest.raises(InvalidInput, match="An int is no path"):
        read_log(3)
    with pytest.raises(InvalidInput, match=r"Read it: `read_log|`read_log` makes one"):
        identify("log.csv")
