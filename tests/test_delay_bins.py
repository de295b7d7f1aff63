"""Sums that are taken once for many delays or blocks are those of one delay or block at a time."""

from dataclasses import replace

import numpy as np
import pytest

from backdrive.identification import curves, design
from backdrive.identification.delay import delay_signals
from backdrive.identification.delay_bins import DelayStretch, bins_at_delay
from backdrive.identification.motion_bins import bin_means
from backdrive.identification.signals import Signals
from backdrive.logs.filters import low_pass

RNG = np.random.default_rng(3)
RATE, N = 500.0, 4000
T = np.arange(N) / RATE


def stretch(**changes) -> Signals:
    q, dq, ddq, dddq = (
        sum(a * w**k * f(w * T + p) for a, w, p in ((0.8, 1.3, 0.2), (0.3, 4.1, 1.0), (0.05, 17.0, 2.0)))
        for k, f in enumerate((np.sin, np.cos, lambda x: -np.sin(x), lambda x: -np.cos(x)))
    )
    moving = np.abs(T - 5.0) > 0.2
    given = {
        "time": T,
        "position": q,
        "velocity": dq,
        "acceleration": ddq,
        "jerk": dddq,
        "torque": 0.3 * ddq + np.sign(dq) + 0.1 * RNG.standard_normal(N),
        "rate": RATE,
        "model_torque": np.cos(3.0 * T),
        "moving": moving,
        "sliding": moving & (np.abs(dq) > 0.1),
    }
    return Signals(**(given | changes))


def smooth(s: Signals) -> Signals:
    return replace(s, jerk=low_pass(s.jerk, 40.0, RATE))


@pytest.mark.parametrize("delay", [0.0, 0.0007, -0.0013, 0.004, 0.033, -0.31, 0.4])
@pytest.mark.parametrize("changes", [{}, {"position": None, "model_torque": None}])
def test_bins_along_any_delay(delay, changes):
    s = stretch(**changes)
    knots = 3.0 * np.array(curves.SHARES)
    got = bins_at_delay([DelayStretch(s, 0.02)], delay, knots)
    wanted = bin_means([delay_signals(smooth(s), delay)], knots, seconds=0.02)
    assert pytest.approx(wanted.X, abs=1e-6) == got.X
    assert np.array_equal(got.used, wanted.used)
    assert got.y == pytest.approx(wanted.y, rel=1e-12)
    assert got.speed == pytest.approx(wanted.speed, rel=1e-12)
    assert got.blocks == wanted.blocks
    still = bins_at_delay([DelayStretch(s, 0.02, np.empty(0))], delay, knots)
    rest = [k for k, name in enumerate(design.COLUMNS) if name != "jerk"] + list(range(6, got.X.shape[1]))
    assert np.array_equal(still.X[:, rest], got.X[:, rest])
    assert not still.X[:, design.COLUMNS.index("jerk")].any()


def test_sine_and_cosine_of_a_position_go_with_its_signals():
    s = stretch()
    assert np.array_equal(s.pull, [np.sin(s.position), np.cos(s.position)])
    assert s.pull[0] is s.pull[0]
    for part in (s.rows(slice(100, 900)), delay_signals(s, 0.0013), replace(s, position=-s.position)):
        assert np.array_equal(part.pull, [np.sin(part.position), np.cos(part.position)])
    assert stretch(position=None).pull is None


@pytest.mark.parametrize("both", [True, False])
def test_columns_of_one_candidate(both):
    s, knots = stretch(), 3.0 * np.array(curves.SHARES)
    given = {"dynamic": True, "gravity": True, "model_torque": True, "both_directions": True}
    option = design.candidates(knots, {"some": knots[[2, 5, 10]]}, symmetric=not both, **given)[0].with_term(
        "jerk"
    )
    stretches = [DelayStretch(s, 0.02)]
    every, own = (bins_at_delay(stretches, 0.003, knots, only) for only in (None, option))
    assert pytest.approx(every.X @ option.spread, abs=1e-12) == own.X


@pytest.mark.parametrize("width", [1, 2, 7, 10])
@pytest.mark.parametrize("rounded", [False, True])
def test_means_of_the_basis_are_those_of_its_samples(width, rounded):
    velocity = np.cumsum(RNG.standard_normal(50 * width)) * 0.05
    velocity = np.round(velocity, 1) if rounded else velocity  # on knots and at rest
    knots = np.array([0.1, 0.2, 0.5, 1.0])
    wanted = curves.basis(velocity, knots).reshape(-1, width, 8).mean(axis=1)
    assert curves.basis_means(velocity, knots, width) == pytest.approx(wanted, abs=1e-12)


@pytest.mark.parametrize("knots", [(0.0, 2.0), (0.2, 0.7, 2.0)])
@pytest.mark.parametrize("both", [True, False])
def test_torques_are_those_of_the_law_of_each_row(knots, both):
    knots = np.array(knots)
    form = curves.forms(knots, {"all": knots}, True)[1 if both else 0]
    rows = RNG.uniform(0.5, 3.0, (5, knots.size * (1 + both)))
    rows[3] = np.tile(np.linspace(0.05, 3.0, knots.size), 1 + both)  # it would start below zero
    velocity, row = np.r_[0.0, RNG.uniform(-2.5, 2.5, 199)], RNG.integers(0, 5, 200)
    wanted = np.array([curves.to_law(form, rows[i]).torque(v) for v, i in zip(velocity, row, strict=True)])
    assert curves.torques(form, rows, velocity, row) == pytest.approx(wanted, abs=1e-12)
