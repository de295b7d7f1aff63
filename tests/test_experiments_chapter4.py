import dataclasses
import importlib

import numpy as np
import pytest

from backdrive.simulation.hand import still
from backdrive.thesis import (
    _release_admittance,
    _sensorless,
    fig_4_3,
    fig_4_7,
    fig_4_8,
    fig_4_9,
    fig_4_10,
    fig_4_11,
)
from backdrive.thesis._sensorless import CASES, PERIOD, lag, metronome, ranks, rms, then
from backdrive.thesis.ledger import disagreements, evaluate, missing, of

SHORT = {
    "fig_4_3": lambda seed: fig_4_3.run(seed, cycles=2),
    "fig_4_7": lambda seed: fig_4_7.run(seed, seeds=2, cycles=3),
    "fig_4_8": lambda seed: fig_4_8.run(seed, seeds=2, cycles=3),
    "fig_4_9": lambda seed: fig_4_9.run(seed, seeds=1, cycles=2),
    "fig_4_10": lambda seed: fig_4_10.run(seed, seeds=2, cycles=2),
    "fig_4_11": lambda seed: fig_4_11.run(seed, seeds=2),
}


@pytest.fixture(scope="module")
def outcomes():
    return {name: run(0) for name, run in SHORT.items()}


@pytest.mark.parametrize("name", SHORT)
def test_every_statement_of_the_ledger_is_computed(outcomes, name):
    found = outcomes[name]
    assert missing([found.name], evaluate([found])) == ()
    assert set(evaluate([found])) <= {s.name for s in of(found.name)}
    assert all(np.isfinite(x) for x in found.numbers.values())


def test_what_is_clear_in_a_short_run_comes_out_as_the_ledger_says(outcomes):
    came_out = evaluate(outcomes.values())
    for name in ("4.7-steady", "4.8-smallest", "4.8-alike", "4.9-equilibrium", "4.11-rest", "4.11-equal"):
        assert name not in disagreements({name: came_out[name]})


@pytest.mark.parametrize("name", ["fig_4_3", "fig_4_7", "fig_4_9"])
def test_the_same_seed_gives_the_same_numbers(outcomes, name):
    again = SHORT[name](0)
    assert dict(again.numbers) == dict(outcomes[name].numbers)
    assert again.claims == outcomes[name].claims


@pytest.mark.parametrize("name", SHORT)
def test_every_outcome_is_drawn(outcomes, name):
    pytest.importorskip("matplotlib")
    from backdrive.report.pictures import canvas

    figure = importlib.import_module(f"backdrive.thesis.{name}").draw(outcomes[name])
    assert len(figure.axes) >= 2
    assert all(a.get_xlabel() or a.get_ylabel() or a.get_title(loc="left") for a in figure.axes)
    assert canvas.content(figure, "png", 0.5).startswith(b"\x89PNG")


def test_lag_is_the_delay_that_was_put_in():
    t = PERIOD * np.arange(2000)
    early = np.sin(2 * np.pi * t) + 0.3 * np.sin(9.0 * t)
    late = np.concatenate([np.full(23, early[0]), early[:-23]])
    assert lag(late, early) == pytest.approx(0.023)


def test_ranks_counts_runs_in_which_the_order_is_strict():
    values = {
        "P": np.array([1.0, 1.0, 2.0]),
        "CT": np.array([2.0, 1.0, 3.0]),
        "HA": np.array([3.0, 4.0, 4.0]),
    }
    assert ranks(values) == 2
    both = {
        case: np.stack([x, np.array([3.0, 4.0, 5.0]) if case == "P" else x], axis=1)
        for case, x in values.items()
    }
    assert ranks(both) == 0


def test_a_hand_that_holds_and_lets_go():
    motion = then(still(10, 0.2).replace(grip=np.ones(10)), hold=0.02, free=0.03)
    assert motion.position == pytest.approx(np.full(60, 0.2))
    assert motion.grip.tolist() == [1.0] * 30 + [0.0] * 30
    assert metronome(1, 3, hold=0.1).velocity[-50:] == pytest.approx(np.zeros(50))


def test_thresholds_lie_between_counts():
    plant = _release_admittance.axis().plant
    friction = _sensorless.estimators(plant, plant.law.rate)
    assert set(friction) == set(CASES)
    counts = friction["CT"].law.row()[-1] * PERIOD / plant.encoder_count
    assert counts == pytest.approx(2.5)
    setting = _release_admittance.joint_0()
    fast = setting.estimators()["algFE2"]
    assert fast.threshold * PERIOD / setting.plant.encoder_count == pytest.approx(1.5)


def test_a_heavier_virtual_object_is_only_that():
    setting = _release_admittance.joint_0()
    heavier = setting.with_mass(0.5)
    assert heavier.admittance == dataclasses.replace(setting.admittance, inertia=0.5)
    assert rms(np.array([3.0, 4.0])) == pytest.approx(np.sqrt(12.5))
    assert rms(np.empty(0)) == 0.0
