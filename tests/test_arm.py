"""Tests for plants/arm.py and arm_loop.py: a six-axis arm by MuJoCo with transmissions that yield and friction by the laws."""

import numpy as np
import pytest

from _loops import guarded
from backdrive.control.compensators import alg_fc, nothing
from backdrive.errors import InvalidInput
from backdrive.laws import Coulomb, Law
from backdrive.simulation.arm import Arm, hp3j, local_servos
from backdrive.simulation.arm_loop import guide, polygon
from backdrive.simulation.hand import Hand

pytest.importorskip("mujoco")
STILL = np.zeros(6)


def test_an_arm_that_carries_its_weight_rests_exactly():
    arm = Arm()
    before = arm.load.copy()
    for _ in range(100):
        arm.step(arm.weight, STILL)
    assert np.array_equal(arm.load, before)
    assert np.abs(arm.load_velocity).max() < 1e-15
    assert arm.weight[1] > 20.0  # the shoulder carries what lies before it
    assert arm.weight[0] == pytest.approx(0.0, abs=1e-9)  # the first axis is vertical


def test_friction_holds_a_push_below_it_and_yields_to_one_above():
    for push, moves in ((6.0, False), (8.0, True)):
        arm, pushed = Arm(), STILL.copy()
        pushed[0] = push
        before = arm.load[0]
        for _ in range(300):
            arm.step(arm.weight, pushed)
        assert (arm.load[0] - before > 1e-3) == moves


def test_without_friction_and_weight_a_free_swing_keeps_its_energy():
    joints = tuple(j.replace(law=Law(rate=Coulomb(coulomb=0.0)), damping=0.0) for j in hp3j())
    arm = Arm(joints)
    arm.load_velocity[:] = arm.motor_velocity[:] = [0.5, 0.3, -0.2, 0.1, 0.2, 0.0]

    def energy() -> float:
        arm.rigid(STILL)
        M = np.linalg.inv(arm.rigid(STILL)[0])
        v, w, d = arm.load_velocity, arm.motor_velocity, arm.motor - arm.load
        arm._mujoco.mj_energyPos(arm.model, arm.data)
        return float(
            0.5 * v @ M @ v
            + 0.5 * np.sum(arm._table[0] * w**2)
            + 0.5 * np.sum(arm._table[1] * d**2)
            + arm.data.energy[0]
        )

    begun, shape = energy(), float(np.abs(arm.weight).sum())
    for _ in range(200):
        arm.step(STILL, STILL)
    assert energy() == pytest.approx(begun, abs=0.01 * shape)


def test_halving_the_tick_of_the_rigid_bodies_changes_little():
    ends = []
    for period in (1e-3, 5e-4):
        arm, pushed = Arm(), STILL.copy()
        pushed[:3] = (12.0, 15.0, 8.0)
        for _ in range(round(0.3 / period)):
            arm.step(arm.weight, pushed, period)
        ends.append(arm.load.copy())
    assert np.abs(ends[0] - ends[1]).max() < 0.02 * np.abs(ends[0] - Arm().load).max()


def test_compensation_lets_a_hand_move_the_grip_with_less_force():
    path, velocity = polygon(
        [(0, 0, 0), (0, 0.08, 0)], dt=1e-3, duration=0.5, interval=0.6, rounds=1, start=0.1
    )
    found = {}
    for name in ("none", "P"):
        arm = Arm()
        loops = {}
        for j in range(3):
            rate = arm.joints[j].law.rate
            used = nothing() if name == "none" else alg_fc(rate, 5e4, share=0.9)
            loops[j] = guarded(used, top_speed=3.0, encoder_count=arm.joints[j].encoder_count)
        held = local_servos(arm.joints)
        record = guide(
            arm,
            path,
            velocity,
            hand=Hand(stiffness=800, damping=40),
            loops=loops,
            servos={j: held[j] for j in (3, 4, 5)},
        )
        found[name] = np.sqrt(np.mean(np.sum(record.force**2, axis=1)))
        assert np.ptp(record.load[:, 3:], axis=0).max() < 0.02  # the others are held
    assert found["P"] < 0.8 * found["none"]


def test_an_arm_that_does_not_fit_is_refused():
    with pytest.raises(InvalidInput, match="hinges"):
        Arm(hp3j()[:3])
    with pytest.raises(InvalidInput, match="yields"):
        Arm([j.replace(stiffness=np.inf) for j in hp3j()])
    with pytest.raises(InvalidInput, match="path"):
        guide(
            Arm(), np.zeros((5, 3)), np.zeros((5, 3)), hand=Hand(stiffness=1, damping=1), loops={}, servos={}
        )
