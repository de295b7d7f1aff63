"""What an estimator of external force brings along from a model: delay and noise of the torque, counts; by closed formulas."""

from dataclasses import replace

import numpy as np
import pytest

from backdrive import Joint, Log, identify
from backdrive.control.estimators.external import METHODS, ExternalForce
from backdrive.control.estimators.of_model import COUNT
from backdrive.control.estimators.series import on_time
from backdrive.errors import BackdriveError
from backdrive.model import TorqueChannel

M, F, B, DT, LATE, NOISE, COUNTS = 0.8, 1.0, 1.5, 2e-3, 0.011, 0.04, 50_000.0
W = np.array([0.7, 1.3, 2.9]) * 2.0 * np.pi
A = np.array([0.3, 0.2, 0.08])


def motor(t, push=0.0):
    """Return the torque of a motor along three sines while a hand pushes, in closed form."""
    dq, ddq = np.cos(np.outer(t, W)) @ (A * W), -np.sin(np.outer(t, W)) @ (A * W**2)
    return M * ddq + F * np.tanh(dq / 0.01) + B * dq - push


def hand(t):
    return 1.5 * np.sin(2.0 * t)


def log(seconds, late, push=None, seed=0):
    t = np.arange(0.0, seconds, DT)
    acted = t - late
    u = motor(acted, 0.0 if push is None else push(acted))
    u = u + NOISE * np.random.default_rng(seed).standard_normal(t.size)
    q = np.round(np.sin(np.outer(t, W)) @ A * COUNTS) / COUNTS
    joint = (Joint(name="j", encoder_counts=COUNTS),)
    return Log(time=t, position=q[:, None], torque=u[:, None], joints=joint)


@pytest.fixture(scope="module")
def model():
    return identify(log(20.0, LATE), accept=("time-slip",)).model


def test_delay_noise_and_counts_come_along(model):
    made = ExternalForce.from_model(model, "j")
    assert made.delay == pytest.approx(LATE, abs=5e-4)
    assert made.noise == pytest.approx(NOISE, rel=0.15)
    assert made.encoder_count == pytest.approx(1.0 / COUNTS)


def test_a_model_that_holds_none_gets_the_defaults(model):
    own = model.joints[0]
    dynamics = {k: v for k, v in own.dynamics.items() if k not in ("delay", "time_slip")}
    bare = replace(own, torque_channel=None, dynamics=dynamics, joint=Joint(name="j"), covariance=None)
    made = ExternalForce.from_model(replace(model, joints=(bare,)), "j")
    assert (made.delay, made.noise, made.encoder_count) == (0.0, None, COUNT)
    told = replace(bare, torque_channel=TorqueChannel(delay=0.004))
    made = ExternalForce.from_model(replace(model, joints=(told,)), "j")
    assert (made.delay, made.noise) == (0.004, None)


@pytest.mark.parametrize("method", [m for m in METHODS if m != "direct"])
def test_late_torque_is_taken_on_time(model, method):
    late = log(10.0, LATE, hand, seed=1)
    made = ExternalForce.from_model(model, "j", method=method, bandwidth=60.0)
    error = {}
    for name, one in (("carried", made), ("not", replace(made, delay=0.0))):
        force, _ = one.run(late.position[:, 0], late.torque[:, 0], DT)
        error[name] = np.sqrt(np.mean((force - hand(late.time - one.lag(DT)))[500:] ** 2))
    prompt = log(10.0, 0.0, hand, seed=1)  # the same hand, with torque that is never late
    force, _ = replace(made, delay=0.0).run(prompt.position[:, 0], prompt.torque[:, 0], DT)
    best = np.sqrt(np.mean((force - hand(late.time - made.lag(DT)))[500:] ** 2))
    assert error["carried"] < 0.4 * error["not"] and error["carried"] < 1.25 * best


@pytest.mark.parametrize("delay", [0.006, -0.003, 0.0, np.array([0.004, 0.0])])
def test_torque_on_time_is_the_torque_of_another_instant(delay):
    t = np.arange(2000) * DT
    u = np.column_stack([np.sin(3.0 * t), np.cos(2.0 * t)])
    acted = t[:, None] + np.broadcast_to(delay, 2)
    want = np.column_stack([np.sin(3.0 * acted[:, 0]), np.cos(2.0 * acted[:, 1])])
    got = on_time(u, delay, DT)
    assert got[10:-10] == pytest.approx(want[10:-10], abs=1e-4)
    assert got.flags.c_contiguous


def test_numbers_that_are_none_are_refused(model):
    made = ExternalForce.from_model(model, "j")
    for wrong in ({"delay": np.nan}, {"noise": -1.0}):
        with pytest.raises(BackdriveError, match=next(iter(wrong))):
            replace(made, **wrong)
