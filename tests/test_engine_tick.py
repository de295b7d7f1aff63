"""Tests for engine/tick.py: joints of different laws side by side, one tick at a time."""

import numpy as np
import pytest

from backdrive.engine import rollout
from backdrive.engine.tick import Tick
from backdrive.errors import InvalidInput
from backdrive.laws.examples import example
from backdrive.status import Status

DT = 1e-3
NAMES = ("coulomb-viscous", "stribeck-gauss", "lugre", "hayward-armstrong", "maxwell-slip", "gms", "m6")
LAWS = [example(name) for name in NAMES]
SPEED = np.linspace(0.5, 2.0, len(LAWS))
Q = 0.05 * np.sin(2 * np.pi * DT * np.outer(np.arange(200), SPEED))
DP = np.diff(Q, axis=0, prepend=Q[:1])


def run(tick, increments):
    return np.array([tick.tick(row).copy() for row in increments])


def test_a_tick_is_a_sample_of_the_rollout():
    tick = Tick(LAWS, dt=DT)
    got = run(tick, DP)
    for j, law in enumerate(LAWS):
        assert np.array_equal(got[:, j], rollout(law, q=Q[:, j], dt=DT))
    assert np.all(tick.codes == Status.OK)
    tick.reset()
    assert np.array_equal(run(tick, DP), got)


def test_load_and_temperature_are_written_in_place():
    laws = [example("m6"), example("load-temperature")]
    tick = Tick(laws, dt=DT)
    tick.load[:], tick.temperature[:] = [3.0, -2.0], 45.0
    got = run(tick, DP[:, :2])
    load = np.tile([3.0, -2.0], (len(Q), 1))
    for j, law in enumerate(laws):
        assert np.array_equal(got[:, j], rollout(law, q=Q[:, j], dt=DT, load=load, temperature=45.0))


def test_nothing_is_allocated():
    tick = Tick(LAWS, dt=DT)
    assert tick.tick(DP[1]) is tick.torque
    assert tick.tick(DP[2]) is tick.torque


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("joint", range(len(LAWS)))
def test_a_joint_that_is_not_finite_leaves_the_others_right(joint, bad):
    tick, whole = Tick(LAWS, dt=DT), Tick(LAWS, dt=DT)
    others = np.arange(len(LAWS)) != joint
    for k, row in enumerate(DP[:60]):
        broken = row.copy()
        if 20 <= k < 25:
            broken[joint] = bad
        held, expected = tick.torque[joint], whole.tick(row)
        got = tick.tick(broken)
        assert np.array_equal(got[others], expected[others])
        assert np.all(tick.codes[others] == Status.OK)
        if 20 <= k < 25:
            assert got[joint] == held
        assert tick.codes[joint] == (Status.NOT_FINITE if 20 <= k < 25 else Status.OK)
    assert np.all(np.isfinite(tick.torque))


def test_a_load_that_is_not_finite_holds_the_joint_that_feels_it():
    tick = Tick(LAWS, dt=DT)
    run(tick, DP[:10])
    held = tick.torque.copy()
    tick.load[:] = np.nan
    tick.tick(DP[10])
    assert tick.codes.tolist() == [Status.OK] * 6 + [Status.NOT_FINITE]
    assert tick.torque[6] == held[6]
    assert np.all(tick.torque[:6] != held[:6])


def test_a_row_of_another_length_moves_nothing():
    tick = Tick(LAWS, dt=DT)
    run(tick, DP[:10])
    held = tick.torque.copy()
    assert np.array_equal(tick.tick(np.zeros(3)), held)
    assert np.all(tick.codes == Status.NOT_FINITE)


@pytest.mark.parametrize(("laws", "dt"), [([], DT), (LAWS, 0.0), (LAWS, np.nan), (LAWS, np.inf)])
def test_what_cannot_tick_is_refused(laws, dt):
    with pytest.raises(InvalidInput, match="laws, dt"):
        Tick(laws, dt=dt)
