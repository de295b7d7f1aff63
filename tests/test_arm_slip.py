"""Torque of an arm that is logged late or early: told by its bodies, kept in the model, and taken out where the model is used."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("pinocchio")

from backdrive.identification import arm_errors, arm_slip
from backdrive.identification.arm import identify_arm
from backdrive.identification.arm_predict import predict_arm, slip_in, validate_arm
from backdrive.identification.arm_terms import Rows
from backdrive.identification.delay import earlier
from backdrive.model import FrictionModel
from backdrive.robot import parse_robot
from test_coupled_arm import made
from test_payload import COULOMB, VISCOUS, description


def late(log, delay):
    """The log with torque as it was `delay` before."""
    samples = delay / log.period
    return log.replace(torque=np.ascontiguousarray(earlier(log.torque.T, samples).T))


@pytest.fixture(scope="module")
def robot():
    return parse_robot(description(1.1))


@pytest.mark.parametrize("delay", [0.02, -0.008])
def test_a_delay_is_told_kept_and_taken_out(robot, delay):
    log, fresh = late(made(1), delay), late(made(2), delay)
    frictions, _, arm = identify_arm(log, robot, held_out=[fresh])
    model = FrictionModel(joints=frictions, arm=arm)
    for j, friction in enumerate(frictions):
        slip = friction.dynamics["time_slip"]
        assert abs(slip.value - delay) < max(3.0 * slip.standard_error, 4e-4) and slip.unit == "s"
        assert friction.delay == slip.value == slip_in(model)
        v = np.array([-0.5, 0.3, 0.6])
        assert friction.law.torque(v) == pytest.approx(np.sign(v) * COULOMB[j] + VISCOUS[j] * v, rel=0.06)
    judged = validate_arm(model, [fresh], robot)
    wrong = replace(model, joints=tuple(_without_slip(f) for f in frictions))
    assert slip_in(wrong) == 0.0
    worse = validate_arm(wrong, [fresh], robot)
    assert all(judged[n].residual < worse[n].residual for n in model.names)
    inner = slice(200, -200)
    error, off = (
        np.abs(predict_arm(m, fresh, robot) - fresh.torque)[inner].mean(axis=0) for m in (model, wrong)
    )
    assert np.all(error < off)


def _without_slip(friction):
    return replace(friction, dynamics={k: v for k, v in friction.dynamics.items() if k != "time_slip"})


def test_torque_in_time_gets_no_delay(robot):
    frictions, _, _ = identify_arm(made(3), robot)
    assert "time_slip" not in frictions[0].dynamics and frictions[0].delay == 0.0


def rows_of(delay, noise, n=4000, J=4):
    """Rows whose torque is a body's a moment ago, beside an offset, in white noise."""
    rng, t = np.random.default_rng(5), np.arange(n) / 20.0
    shape = [sum(np.sin(w * t + p) for w, p in rng.uniform(0.5, 6.0, (5, 2))) for _ in range(J)]
    body = np.array([(x * 3.0) for x in shape]).T
    change = np.gradient(body, 1.0 / 20.0, axis=0)
    torque = body - delay * change + 0.3 + noise * rng.standard_normal((n, J))
    own = [np.column_stack([np.ones(n), np.zeros(n)]) for _ in range(J)]
    return Rows(
        bodies=body[:, :, None], friction=own, torque=torque, weight=np.ones((n, J)), rate=20.0
    ), change


def test_the_error_is_that_of_repetition():
    rows, change = rows_of(0.004, 0.2)
    block = arm_errors.blocks_of(len(rows.torque), rows.rate)
    got = arm_slip.slip_of(rows, change, block)
    # ordinary least squares of everything at once, all joints of one noise
    X = np.zeros((rows.torque.size, 4 * 2 + 1))
    for j in range(4):
        part = slice(j * 4000, (j + 1) * 4000)
        X[part, 2 * j], X[part, 2 * j + 1], X[part, 8] = rows.bodies[:, j, 0], 1.0, -change[:, j]
    theta, *_ = np.linalg.lstsq(X, rows.torque.T.ravel(), rcond=None)
    assert got.delay == pytest.approx(theta[8], rel=0.02) and got.delay == pytest.approx(
        0.004, abs=4.0 * got.error
    )
    plain = 0.2 * np.sqrt(np.linalg.inv(X.T @ X)[8, 8])
    assert 0.5 * plain < got.error < 2.0 * plain
    assert got.is_significant and not arm_slip.ArmSlip(delay=0.004, error=0.002).is_significant
    assert not arm_slip.ArmSlip(delay=0.2, error=1e-4).is_significant
    two = replace(rows, weight=rows.weight * [1.0, 1.0, 0.0, 0.0])
    assert arm_slip.slip_of(two, change, block) is None  # too few joints tell
