"""Chapter 3 of the thesis as experiments: peaks and their tests, short runs of every figure, and what each draws."""

import importlib

import numpy as np
import pytest
from scipy.stats import ttest_ind

from backdrive.thesis import (
    _hand_guiding,
    _release_compensation,
    _square,
    fig_3_3,
    fig_3_4,
    fig_3_6,
    fig_3_7,
    fig_3_8,
    fig_3_9,
    fig_3_10,
    fig_3_11,
)
from backdrive.thesis.ledger import disagreements, evaluate, missing
from backdrive.thesis.setups import RATIO, setups

SHORT = {
    fig_3_7: {"CYCLES": 3, "ZOOM": (0, 2)},
    fig_3_8: {"CYCLES": 4},
    fig_3_9: {"ROUNDS": 2, "ZOOM": (0, 1)},
    fig_3_10: {"ROUNDS": 2, "STROKES": 3, "PACES": {}},
    fig_3_11: {"SEEDS": 2},
}


@pytest.fixture
def outcome(monkeypatch):
    """Return a function that runs an experiment with few, short motions."""

    def run(module, seed=0):
        monkeypatch.setattr(_release_compensation, "AFTER", 1.2)
        for name, value in SHORT.get(module, {}).items():
            monkeypatch.setattr(module, name, value)
        return module.run(seed)

    return run


def drawn(name, outcome):
    figure = importlib.import_module(f"backdrive.thesis.{name}").draw(outcome)
    figure.canvas.draw()
    return figure


def test_peaks_are_taken_window_by_window():
    time = _hand_guiding.PERIOD * np.arange(
        round((_hand_guiding.BEGIN + 3 * _hand_guiding.CYCLE) / _hand_guiding.PERIOD)
    )
    cut = _hand_guiding.windows(time, 3)
    assert cut.shape == (3, 1500)
    np.testing.assert_allclose(cut[:, 0], [0.5, 2.0, 3.5])


def test_comparison_is_students_t_test():
    rng = np.random.default_rng(1)
    a, b = 10.0 + rng.standard_normal(30), 9.0 + 2.0 * rng.standard_normal(20)
    found, expected = _hand_guiding.compare(a, b), ttest_ind(a, b)
    assert found.t == pytest.approx(expected.statistic)
    assert found.p == pytest.approx(expected.pvalue)
    assert found.low < found.difference < found.high
    assert found.effect == pytest.approx(found.t * np.sqrt(1 / 30 + 1 / 20))
    assert _hand_guiding.compare(a, b) == found


def test_marks_are_those_of_the_thesis():
    assert [_hand_guiding.mark(p) for p in (5e-4, 5e-3, 0.03, 0.2)] == ["***", "**", "*", "ns"]


def test_the_five_cases_differ_as_the_thesis_says():
    cases = _square.guidances()["joint_0"].compensators()
    assert tuple(cases) == _hand_guiding.CASES
    decay = {case: getattr(c.friction.law.element, "decay_rate", None) for case, c in cases.items()}
    assert (decay["C"], decay["CD"], decay["P"], decay["PD"]) == (0.0, 0.0, 20.0, 20.0)
    assert [case for case, c in cases.items() if c.dither is not None] == ["CD", "PD"]


def test_one_setup_for_every_figure():
    """K_c = K, friction on the load's side, no factor R: fixed beforehand, whatever the figure."""
    plants = setups()
    for guidance in (fig_3_8.guidance(), *_square.guidances().values()):
        assert guidance.plant == plants[guidance.plant.name]
        assert guidance.plant.stiffness == RATIO * guidance.stiffness
        assert guidance.plant.friction_side == "load"
        assert guidance.share == 1.0
    assert _release_compensation.joint_0().plant == plants["joint_0"]
    assert _release_compensation.setup_a().plant == plants["setup_a"]
    assert setups(2.0)["setup_a"].stiffness == 2.4e6


@pytest.mark.parametrize("module", [fig_3_3, fig_3_4, fig_3_6])
def test_the_quick_figures_come_out_as_the_ledger_says(module):
    found = module.run()
    assert [c.what for c in found.claims if c.holds is False and not c.statement] == []
    assert disagreements(evaluate([found])) == ()
    assert missing([found.name], evaluate([found])) == ()
    drawn(module.__name__.rsplit(".", 1)[1], found)


def test_intercepts_of_setup_a_are_found():
    numbers = fig_3_4.run().numbers
    assert numbers["setup_a.F_p"] == pytest.approx(12.0, abs=0.05)
    assert numbers["setup_a.F_n"] == pytest.approx(8.0, abs=0.05)


def test_first_count_comes_with_half_a_count_of_stretch():
    numbers = fig_3_3.run().numbers
    assert numbers["setup_a.first"] == pytest.approx(0.5 * 5e-6 * 1.2e6, rel=0.01)
    assert numbers["joint_0.first"] < 0.1


@pytest.mark.parametrize("module", [fig_3_7, fig_3_8, fig_3_9, fig_3_10, fig_3_11])
def test_short_runs_say_and_draw_something(module, outcome):
    found = outcome(module)
    assert found.claims
    assert all(np.isfinite(value) for value in found.numbers.values())
    drawn(module.__name__.rsplit(".", 1)[1], found)


def test_dither_after_a_stop_makes_cd_light(outcome):
    numbers = outcome(fig_3_8).numbers
    assert numbers["mean.CD+"] < 0.8 * numbers["mean.C+"]
    assert numbers["mean.CD+"] == pytest.approx(numbers["mean.PD+"], rel=0.1)


def test_same_seed_same_numbers(outcome):
    first, again, other = outcome(fig_3_8), outcome(fig_3_8), outcome(fig_3_8, 1)
    assert first.numbers == again.numbers
    assert first.numbers != other.numbers


def test_switched_decay_rate_brings_joint_0_to_rest():
    found = _release_compensation.judge(_release_compensation.joint_0(), 10, 0)
    assert found["rest"]["alpha_N"] == 0 and found["rest"]["alpha_H"] == 10
    assert found["rest"]["algFC2"] >= 9  # as the claim of the experiment has it
    assert found["peak"]["algFC2"] < found["peak"]["alpha_H"]


def test_threshold_lies_between_counts():
    release = _release_compensation.setup_a()
    threshold = release.compensators()["algFC2"].friction.threshold
    assert threshold == pytest.approx(2.5 * release.plant.encoder_count / _release_compensation.PERIOD)
    assert release.threshold > release.boundary
