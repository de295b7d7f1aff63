"""The change of a torque with the delay of its motion is that between two delays."""

from dataclasses import replace

import numpy as np
import pytest

from backdrive.identification import curves, design
from backdrive.identification.delay_bins import DelayStretch, bins_at_delay
from backdrive.identification.delay_slope import NEAR, bins_near, change_with_delay, response_by_one
from backdrive.identification.signals import Signals
from backdrive.identification.slip import fit
from test_delay_bins import RATE, stretch

KNOTS = 3.0 * np.array(curves.SHARES)


def option(symmetric: bool, *more: str) -> design.Candidate:
    given = {"dynamic": True, "gravity": True, "model_torque": False, "both_directions": True}
    made = design.candidates(KNOTS, {"some": KNOTS[[0, 6, 10]]}, symmetric=symmetric, **given)[-1]
    for term in more:
        made = made.with_term(term)
    return made


@pytest.mark.parametrize("delay", [0.0, 0.0007, -0.0013, 0.033, -0.31])
@pytest.mark.parametrize("symmetric", [True, False])
@pytest.mark.parametrize("position", [True, False])
def test_the_change_is_that_between_two_delays(delay, symmetric, position):
    s = stretch() if position else stretch(position=None)
    along, one = (
        [DelayStretch(s, 0.02), DelayStretch(s.rows(slice(0, 1500)), 0.02)],
        option(symmetric, "jerk"),
    )
    theta = np.random.default_rng(1).uniform(0.5, 2.0, one.size)
    apart = 0.05 / RATE
    before, after = (bins_at_delay(along, delay + sign * apart, KNOTS, one) for sign in (-1, 1))
    if not position:  # there is no gravity without one
        gravity = [k for k, term in enumerate(one.terms) if term.startswith("gravity")]
        assert not before.X[:, gravity].any()
    wanted = (after.X - before.X) @ theta / (2.0 * apart)
    off = (change_with_delay(along, delay, one, theta) - wanted)[before.used]
    assert np.sqrt(np.mean(off**2)) < 0.01 * np.sqrt(np.mean(wanted[before.used] ** 2))


@pytest.mark.parametrize("change", [NEAR / RATE, -NEAR / RATE])
def test_bins_of_a_near_delay_give_its_fits(change):
    along, one, at = [DelayStretch(stretch(), 0.02)], option(True), 0.0006
    bins, other = (bins_at_delay(along, delay, KNOTS) for delay in (at, at + change))
    begin = fit(bins.map_columns(one.spread))
    near = bins_near(bins, at, at + change, along, one, begin)
    assert near is not None and near.X is bins.X
    wanted, got, before = (fit(x.map_columns(one.spread)) for x in (other, near, bins))
    assert np.abs(got - wanted).max() < 0.02 * np.abs(before - wanted).max()


def test_bins_with_another_torque_keep_the_sums_of_their_columns():
    bins = bins_at_delay([DelayStretch(stretch(), 0.02)], 0.0, KNOTS)
    y = np.random.default_rng(2).standard_normal(bins.y.size)
    assert "every" not in vars(bins.with_torque(y))
    gram = bins.every.gram
    made, fresh = bins.with_torque(y), replace(bins, y=y).every
    assert vars(made)["every"].gram is gram and made.every.rows == pytest.approx(fresh.rows)
    assert made.every.moment == pytest.approx(fresh.moment) and made.every.power == pytest.approx(fresh.power)


def test_bins_of_a_far_delay_or_another_mask_are_not_at_hand():
    along, one = [DelayStretch(stretch(), 0.02)], option(True)
    bins = bins_at_delay(along, 0.0, KNOTS)
    theta = fit(bins.map_columns(one.spread))
    assert bins_near(bins, 0.0, 1.1 * NEAR / RATE, along, one, theta) is None
    for at, delay in ((0.49, 0.51), (-0.51, -0.49)):  # sliding moves by whole samples
        assert bins_near(bins, at / RATE, delay / RATE, along, one, theta) is None


def late_stretch(n: int, late: float, rng) -> Signals:
    """Return a stretch of n samples of a light joint whose torque is late by a time [s]."""
    t, phase = np.arange(n) / RATE, rng.uniform(0.0, 6.0, 3)
    sines = (0.8, 1.3), (0.3, 4.1), (0.02, 17.0)

    def along(at):
        return [
            sum(a * w**k * f(w * at + p) for (a, w), p in zip(sines, phase, strict=True))
            for k, f in enumerate((np.sin, np.cos, lambda x: -np.sin(x), lambda x: -np.cos(x)))
        ]

    (q, dq, ddq, dddq), (_, before, pushed, _) = along(t), along(t - late)
    return Signals(
        time=t,
        position=q,
        velocity=dq,
        acceleration=ddq,
        jerk=dddq,
        torque=0.3 * pushed + np.sign(before) + 0.3 * before + 0.02 * rng.standard_normal(n),
        rate=RATE,
        model_torque=None,
        moving=np.ones(n, bool),
        sliding=np.abs(dq) > 0.1,
    )


@pytest.mark.parametrize("samples", [5000, 100, 40])
def test_the_response_of_the_jerk_knows_where_stretches_end(samples):
    rng, one = np.random.default_rng(4), option(True, "jerk")
    along = [DelayStretch(late_stretch(samples, 0.002, rng), 0.02) for _ in range(10_000 // samples)]
    inertia, jerk = one.terms.index("inertia"), one.terms.index("jerk")
    found = []
    for delay in (0.0, 0.002):
        bins = bins_at_delay(along, delay, KNOTS, one)
        theta = fit(bins)
        found.append(theta[jerk] / theta[inertia])
        share = response_by_one(bins, along, theta, inertia, jerk)
    assert share == pytest.approx((found[0] - found[1]) / 0.002, rel=0.07)
    theta[jerk] += 5.0  # what the jerk's own coefficient says is not asked
    assert response_by_one(bins, along, theta, inertia, jerk) == pytest.approx(share)


def test_bins_fewer_than_blocks_keep_the_sums_of_their_columns():
    bins = bins_at_delay([DelayStretch(stretch(), 0.02)], 0.0, KNOTS)
    few = replace(bins, X=bins.X[:9], y=bins.y[:9], used=np.ones(9, bool), speed=bins.speed[:9], blocks=20)
    assert few.every.gram.shape[0] == 20
    made, fresh = few.with_torque(few.y + 1.0), replace(few, y=few.y + 1.0).every
    assert made.every.moment == pytest.approx(fresh.moment) and made.every.power == pytest.approx(fresh.power)
