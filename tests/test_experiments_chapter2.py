"""The experiments of chapter 2: what they promise, on short runs."""

import importlib

import numpy as np
import pytest

from backdrive.simulation.machines import joint_0, joint_1, joint_2
from backdrive.thesis import _manual, _sweeps, _tracking
from backdrive.thesis.ledger import disagreements, evaluate
from backdrive.thesis.setups import wrist

SWEEPS = ("fig_2_2", "fig_2_3", "fig_2_8", "table_2_2")


@pytest.mark.parametrize("name", SWEEPS)
def test_a_sweep_experiment_holds_and_repeats(name):
    module = importlib.import_module(f"backdrive.thesis.{name}")
    first, again = module.run(seed=3), module.run(seed=3)
    assert disagreements(evaluate([first])) == ()
    assert [c.what for c in first.claims if c.holds is False and not c.statement] == []
    assert first.name == name.replace("_", "-", 1).replace("_", ".")
    assert dict(first.numbers) == dict(again.numbers)
    assert np.all(np.isfinite(list(first.numbers.values())))
    assert all(c.what and c.ours for c in first.claims)


@pytest.mark.parametrize("name", ["fig_2_2", "fig_2_3", "fig_2_9", "table_2_2"])
def test_a_picture_has_named_axes(name):
    outcome = importlib.import_module(f"backdrive.thesis.{name}").run()
    figure = importlib.import_module(f"backdrive.thesis.{name}").draw(outcome)
    assert figure.axes
    assert any("[" in a.get_ylabel() for a in figure.axes)


def test_the_postures_are_ordered_as_the_caption_says():
    inertia = [_sweeps.in_posture(name)[0].inertia for name in _sweeps.POSTURES]
    gravity = [
        float(joint.weight(np.deg2rad(center)))
        for joint, center in (_sweeps.in_posture(name) for name in _sweeps.POSTURES)
    ]
    assert inertia == sorted(inertia)
    assert np.argmax(gravity) == 1
    assert np.argmin(gravity) == 4


def test_an_actuator_too_weak_gives_no_curve_and_no_distance():
    weak = joint_1().replace(torque_limit=60.0)
    runs = {A: _sweeps.sweep(weak, A, seed=0) for A in (5.0, 50.0)}
    found = _sweeps.distances(runs, "literal")
    assert found[50.0] == 0.0
    assert not found[5.0] < 1.0  # NaN, or far off


def test_moving_by_hand_meets_the_gates_in_two_cycles():
    joints = (joint_0(), joint_1(), joint_2(), wrist(4))
    for moved, least in zip(
        _manual.move_by_hand(joints, seed=1, cycles=3), (60.0, 50.0, 60.0, 60.0), strict=True
    ):
        assert moved.reduction >= least
        assert moved.forward >= 40.0
        assert abs(moved.speed_change) <= 2.0
        assert moved.inertia_torque < moved.torques[1]
        assert np.all(moved.after.status == 0.0)


def test_the_soft_hand_that_keeps_the_speed_keeps_it(monkeypatch):
    monkeypatch.setattr(_manual, "CYCLES", 3)
    (moved,) = _manual.equally_fast([joint_2()], seed=0)
    assert abs(moved.speed_change) < 1.0
    assert moved.reduction < 60.0


def test_the_saw_teeth_go_up_and_down():
    target = _tracking.saw_teeth({0.5: 2})
    assert target[:, 0].max() == pytest.approx(_tracking.TOOTH, abs=1e-9)
    assert target[-1, 0] == pytest.approx(0.5 * _manual.PERIOD)
    assert np.diff(target[:, 0]) == pytest.approx(target[:-1, 1] * _manual.PERIOD)


def test_the_order_of_the_compensations_and_where_it_breaks():
    joint = joint_0()
    target = _tracking.saw_teeth({0.3: 1, 0.7: 2})
    good, bad = (
        {case: _tracking.error(r) for case, r in done.items()}
        for done in _tracking.track(
            [(joint, _tracking.pd(joint)), (joint, _tracking.pd(joint, ratio=0.05))], seed=0, target=target
        )
    )
    assert good["MOP"] < good["MOL"] < good["MO"] < good["NC"]
    assert not bad["MOP"] < bad["MOL"] < bad["MO"]


def test_the_four_cases_share_their_friction_at_rest():
    curve = _manual.curves(0)["joint_1"]
    laws = [c.friction.law for name, c in _tracking.compensators(curve).items() if name != "NC"]
    rest = [float(law.torque(1e-12)) for law in laws]
    assert rest == pytest.approx([rest[0]] * 3)
    slow, fast = (float(laws[1].torque(v)) for v in (1.0, 2.0))
    assert fast - slow == pytest.approx(_tracking.viscosity(curve))
