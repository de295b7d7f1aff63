"""Tests for engine/: torque along given motions, and forward dynamics against closed forms and the plain interpreter."""

import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from _kinds import of_a_kind
from backdrive.engine import Axis, DriveModel, Lanes, forward, rollout
from backdrive.engine.cores import spread
from backdrive.errors import ExtrapolationWarning, InvalidInput
from backdrive.laws import Coulomb, CoulombViscous, Law, kernels
from backdrive.laws.examples import ELEMENT_EXAMPLES, RATE_EXAMPLES, example
from backdrive.logs.log import Joint
from backdrive.model import FrictionModel, JointFriction, Validity

DT = 1e-3
MOTION = 0.05 * np.sin(2 * np.pi * 1.3 * DT * np.arange(400)) + 0.001 * np.sin(
    2 * np.pi * 17 * DT * np.arange(400)
)
FREE = Law(rate=Coulomb(coulomb=0.0))


def model(*laws):
    joints = [
        JointFriction(joint=Joint(name=f"j{i}"), law=law, validity=Validity(velocity=(-1.0, 1.0)))
        for i, law in enumerate(laws)
    ]
    return FrictionModel(joints=tuple(joints))


@pytest.mark.parametrize("name", of_a_kind([*RATE_EXAMPLES, *ELEMENT_EXAMPLES]))
def test_a_rollout_is_the_loop_of_steps(name):
    law = example(name)
    p, x = law.row(), law.state()
    expected = [
        kernels.step(law.rate.KIND, law.element.KIND, p, x, dp, DT, (3.0, -2.0), 35.0)
        for dp in np.diff(MOTION, prepend=MOTION[0])
    ]
    load = np.tile([3.0, -2.0], (len(MOTION), 1))
    got = rollout(law, q=MOTION, dt=DT, load=load, temperature=35.0)
    assert np.array_equal(got, expected)


@pytest.mark.parametrize(
    ("name", "shared", "fastest"),
    [
        *of_a_kind(RATE_EXAMPLES, True, 1.0),
        *of_a_kind(ELEMENT_EXAMPLES, False, 1.0),
        ("lugre", True, 1e120),
    ],
)
def test_sets_side_by_side_are_each_by_itself(name, shared, fastest):
    """Thirty-six lanes fill two groups of sixteen and a part of one, on one motion or on several, beyond all speeds too."""
    law, n = example(name), 36
    dp = np.diff([MOTION[:150] * scale for scale in (1.0, 0.3, -2.0, 3.0)], prepend=0.0, axis=1)
    dp[:, 50:60] *= fastest
    which = np.zeros(n, dtype=np.int64) if shared else np.arange(n) % 4
    load = np.tile([3.0, -2.0], (4, 150, 1)) * np.linspace(1.0, 0.5, 150)[:, None]
    lanes, alone = Lanes([law] * n), Lanes([law])
    if name != "polyline":  # whose row counts its knots
        lanes.rows[:, 1:4] *= np.linspace(0.9, 1.1, n)[:, None]
    state = np.zeros((n, lanes.states))
    with np.errstate(all="ignore"):
        got = lanes.torque(which, dp, DT, load, state=state, workers=1)
        for i in (0, 1, 2, 3, 15, 16, 35):
            alone.rows[0], x = lanes.rows[i], np.zeros((1, lanes.states))
            m = which[i : i + 1]
            expected = alone.torque(m, dp, DT, load, state=x, workers=1)[0]
            assert expected.tobytes() == got[i].tobytes()
            assert (
                x[0, : max(law.element.states(), 1)].tobytes()
                == state[i, : max(law.element.states(), 1)].tobytes()
            )


def test_a_torque_at_one_velocity_is_that_of_many():
    one = model(example("stribeck-gauss"), example("polyline"))
    for joint in ("j0", "j1", 0):
        for v in (0.3, -0.02, 0.0, 0.9):
            expected = float(one.torque(joint, np.array([v]))[0])
            assert [float(one.torque(joint, v)) for _ in range(3)] == [expected] * 3
        with pytest.warns(ExtrapolationWarning):
            one.torque(joint, 2.0)
    with pytest.raises(InvalidInput, match="NaN"):
        one.torque("j0", float("nan"))
    assert pickle.loads(pickle.dumps(one)) == one


def test_shapes_follow_the_motion_and_the_models():
    a, b = example("lugre"), example("gms")
    q = np.column_stack([MOTION, 2 * MOTION])
    assert rollout(a, q=MOTION, dt=DT).shape == (400,)
    assert rollout(a, q=q, dt=DT).shape == (400, 2)
    assert rollout([a, b, a], q=MOTION, dt=DT).shape == (3, 400)
    both = rollout([model(a, b), model(b, a)], q=q, dt=DT)
    assert both.shape == (2, 400, 2)
    assert np.array_equal(both[0], rollout(model(a, b), q=q, dt=DT))
    assert np.array_equal(both[1, :, 1], rollout(a, q=2 * MOTION, dt=DT))


def test_the_numbers_do_not_depend_on_the_number_of_workers():
    laws = [example(name) for name in ELEMENT_EXAMPLES]
    one, many = (rollout(laws, q=MOTION, dt=DT, workers=w) for w in (1, 5))
    assert np.array_equal(one, many)


def test_velocities_do_as_well_as_positions():
    law = example("dahl")
    dq = np.diff(MOTION, prepend=MOTION[0]) / DT
    np.testing.assert_allclose(
        rollout(law, dq=dq, dt=DT), rollout(law, q=MOTION, dt=DT), rtol=1e-9, atol=1e-9
    )


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"dt": DT}, "either"),
        ({"q": MOTION, "dq": MOTION, "dt": DT}, "either"),
        ({"q": MOTION, "dt": 0.0}, "dt = 0"),
        ({"q": np.array([0.0, np.nan]), "dt": DT}, r"q\[1, 0\]|q\[1\] = nan"),
        ({"q": np.zeros((2, 2, 2)), "dt": DT}, "shape"),
        ({"q": np.zeros(0), "dt": DT}, "shape"),
        ({"q": MOTION, "dt": DT, "load": np.zeros(400)}, "load"),
        ({"q": MOTION, "dt": DT, "temperature": np.full(7, 20.0)}, "temperature"),
        ({"q": MOTION, "dt": DT, "workers": 0}, "workers"),
    ],
)
def test_a_rollout_names_what_is_wrong(arguments, named):
    with pytest.raises(InvalidInput, match=named):
        rollout(example("lugre"), **arguments)


def test_a_model_of_other_joints_is_refused():
    with pytest.raises(InvalidInput, match="2 joints, the motion 1"):
        rollout(model(FREE, FREE), q=MOTION, dt=DT)


def test_a_free_mass_under_a_constant_torque():
    motion = forward(Axis(law=FREE, inertia=2.0), np.full(1001, 3.0), dt=DT)
    t = DT * np.arange(1001)
    np.testing.assert_allclose(motion.position[0], 0.75 * t**2, atol=1e-12)
    np.testing.assert_allclose(motion.velocity[0], 1.5 * t, atol=1e-12)


def test_a_sliding_mass_stops_and_stays():
    """v0 = 1, F = 2, M = 1: stops after 0.5 s and 0.25 m, exactly still afterwards."""
    motion = forward(
        Axis(law=Law(rate=Coulomb(coulomb=2.0)), inertia=1.0), np.zeros(1001), dt=DT, velocity=1.0
    )
    assert motion.position[0, -1] == pytest.approx(0.25, abs=1e-3)
    assert np.all(motion.velocity[0, 502:] == 0.0)


def test_a_pendulum_keeps_its_energy():
    axis = Axis(law=FREE, inertia=0.01, gravity_sin=0.5)
    motion = forward(axis, np.zeros(20001), dt=DT, position=1.0)
    energy = 0.005 * motion.velocity[0] ** 2 - 0.5 * np.cos(motion.position[0])
    assert np.abs(energy - energy[0]).max() < 1e-3 * 0.5


def test_a_motor_reaches_its_no_load_speed():
    drive = DriveModel(actuator="motor", torque_constant=0.5, resistance=2.0, gain=6.0)
    motion = forward(Axis(law=FREE, inertia=0.01, drive=drive), np.ones(3001), dt=DT)
    assert motion.velocity[0, -1] == pytest.approx(12.0, rel=1e-9)
    assert motion.torque[0, 0] == pytest.approx(1.5)
    tau = 0.01 * 2.0 / 0.25
    np.testing.assert_allclose(
        motion.velocity[0], 12.0 * (1 - np.exp(-DT * np.arange(3001) / tau)), atol=0.04
    )


def test_a_saturating_motor_and_a_sagging_supply():
    drive = DriveModel(
        actuator="motor",
        torque_constant=0.5,
        resistance=2.0,
        supply=8.0,
        supply_resistance=1.0,
        saturation=0.25,
    )
    motion = forward(Axis(law=FREE, inertia=1.0, drive=drive), np.ones(2), dt=DT)
    i = 8.0 / 3.0
    assert motion.torque[0, 0] == pytest.approx(0.5 * i / (1 + 0.25 * i), rel=1e-12)
    measured = forward(Axis(law=FREE, inertia=1.0, drive=drive), np.ones(2), dt=DT, supply=np.full(2, 6.0))
    assert measured.torque[0, 0] == pytest.approx(0.5 * 2.0 / 1.5, rel=1e-12)


def test_a_position_loop_holds_against_friction_with_the_error_that_friction_allows():
    """P control, F = 1, K_p = 100: the axis stops wherever |100 e| <= 1."""
    drive = DriveModel(controller="position", proportional=100.0, derivative=2.0)
    axis = Axis(law=Law(rate=Coulomb(coulomb=1.0)), inertia=0.1, drive=drive)
    motion = forward(axis, np.full(4000, 0.3), dt=DT)
    assert motion.velocity[0, -1] == 0.0
    assert abs(100.0 * (0.3 - motion.position[0, -1])) <= 1.0


def test_velocity_loop_and_delay():
    drive = DriveModel(controller="velocity", proportional=50.0, integral=200.0)
    axis = Axis(
        law=Law(rate=CoulombViscous(coulomb_positive=1.0, coulomb_negative=1.0)), inertia=0.1, drive=drive
    )
    motion = forward(axis, np.full(4000, 0.7), dt=DT)
    assert motion.velocity[0, -1] == pytest.approx(0.7, abs=1e-6)
    ramp = DT * np.arange(100.0)
    late = forward(Axis(law=FREE, inertia=1.0, drive=DriveModel(delay=0.0105)), ramp, dt=DT)
    np.testing.assert_allclose(late.torque[0], np.maximum(ramp - 0.0105, 0.0), atol=1e-15)
    held = forward(Axis(law=FREE, inertia=1.0, drive=DriveModel(hold=True)), ramp, dt=DT, substeps=4)
    assert np.array_equal(held.torque[0], ramp)


def test_lanes_on_several_logs_with_switches():
    axes = [Axis(law=FREE, inertia=m) for m in (1.0, 2.0, 4.0)]
    inputs = np.array([np.ones(11), 2 * np.ones(11)])
    motion = forward(axes, inputs, dt=DT, log=[0, 1, 1], enabled=np.array([np.ones(11), np.zeros(11)]))
    assert motion.velocity[0, -1] == pytest.approx(0.01)
    assert np.all(motion.velocity[1:] == 0.0)


def motions(names):
    """Return the motion of an axis under each law, as hexadecimal digits."""
    drive = DriveModel(controller="position", proportional=2000.0, derivative=50.0, delay=0.0015)
    rows = []
    for name in names:
        axis = Axis(law=example(name), inertia=0.5, drive=drive, gravity_cos=3.0, load_inertia=0.3)
        rows.append(forward(axis, MOTION[:60] * 20, dt=DT, substeps=2).position.tobytes().hex())
    return rows


def test_forward_is_the_same_without_the_compiler():
    names = ["stribeck-gauss", "lugre", "gms", "m6"]
    run = f"from test_engine import motions\nprint(*motions({names}))"
    plain = subprocess.run(
        [sys.executable, "-c", run],
        capture_output=True,
        text=True,
        check=True,
        cwd=Path(__file__).parent,
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
    )
    assert plain.stdout.split() == motions(names)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"inertia": 0.0}, "inertia"),
        ({"stiffness": 100.0}, "elastic transmission"),
        ({"gravity_sin": np.nan}, "gravity_sin"),
        ({"friction_side": "left"}, "friction_side"),
    ],
)
def test_an_axis_that_cannot_be_is_refused(change, named):
    with pytest.raises(InvalidInput, match=named):
        Axis(**({"law": FREE, "inertia": 1.0} | change))


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"controller": "fuzzy"}, "controller"),
        ({"resistance": 0.0}, "resistance"),
        ({"proportional": -1.0}, "proportional"),
    ],
)
def test_a_drive_that_cannot_be_is_refused(change, named):
    with pytest.raises(InvalidInput, match=named):
        DriveModel(**change)


def test_forward_names_what_is_wrong():
    axis = Axis(law=FREE, inertia=1.0)
    with pytest.raises(InvalidInput, match="finite"):
        forward(axis, np.array([0.0, np.inf]), dt=DT)
    with pytest.raises(InvalidInput, match="substeps"):
        forward(axis, np.zeros(5), dt=DT, substeps=0)
    with pytest.raises(InvalidInput, match="existing input"):
        forward(axis, np.zeros((2, 5)), dt=DT, log=[2])
    with pytest.raises(InvalidInput, match="supply"):
        forward(axis, np.zeros(5), dt=DT, supply=np.zeros(4))


def test_work_is_done_once_whatever_the_workers():
    for workers in (1, 2, 7):
        seen = np.zeros(10)

        def work(first, last, seen=seen):
            seen[first:last] += 1

        spread(work, 10, workers)
        assert np.all(seen == 1)
