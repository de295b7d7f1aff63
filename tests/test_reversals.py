"""Noise that reversals add to an external torque, and bands where a force changes faster than the estimator follows."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from backdrive.external.bands import abrupt_changes
from backdrive.external.choose import Noise
from backdrive.external.contacts import score
from backdrive.external.result import JointForce
from backdrive.external.reversals import noise_of_reversals, turning_of
from backdrive.logs.log import Joint
from backdrive.model import Band, Bands

RATE = 500.0


def motion(turns: int, length: int = 50, apart: int = 400) -> tuple[np.ndarray, list[slice]]:
    """Return the states of a joint that reverses now and then, and the reversals."""
    state = np.zeros(turns * apart + apart, dtype=int)
    spans = [slice(apart * k, apart * k + length) for k in range(1, turns + 1)]
    for span in spans:
        state[span] = 1
    return state, spans


def friction(moving: float | None = 0.2, reversing: float | None = 4.0) -> SimpleNamespace:
    bands = Bands(
        moving=None if moving is None else Band(half_width=moving, samples=900),
        reversing=None if reversing is None else Band(half_width=reversing, samples=100),
    )
    return SimpleNamespace(bands=bands)


def stretch(n: int) -> SimpleNamespace:
    """Return a stretch that reverses every second sample of half of it."""
    v = np.ones(n)
    v[n // 2 :] = np.where(np.arange(n - n // 2) % 2, 1.0, -1.0)
    return SimpleNamespace(velocity=v, moving=np.ones(n, dtype=bool), rate=RATE)


def test_pulses_at_reversals_are_measured_whatever_force_acts():
    state, spans = motion(30)
    force = np.zeros(state.size)
    for span in spans:  # pulses of 20 ms: size 1.5, and a spectrum that they have for certain
        force[span.start + 20 : span.start + 30] += 1.5
    t = np.arange(state.size) / RATE
    share = np.mean(state == 1)
    within = np.zeros(50)
    within[20:30] = 1.5
    for push, near in ((0.0, 0.02), (np.sin(0.7 * t), 0.1), (2.0 * np.sign(np.sin(3.1 * t)), 0.4)):
        size, time = noise_of_reversals(friction(), [stretch(state.size)], [(force + push, state)])
        assert size == pytest.approx(np.sqrt(share * np.mean(within**2)), rel=near)
        if near < 0.2:  # jumps of a force within the reversals hide their time
            assert time == pytest.approx(0.5 * np.sum(within) ** 2 / np.sum(within**2) / RATE, rel=near)


def test_without_noise_of_their_own_reversals_add_none():
    state, _ = motion(30)
    t = np.arange(state.size) / RATE
    rng = np.random.default_rng(1)
    force = 2.0 * np.sign(np.sin(3.1 * t)) + 0.3 * rng.standard_normal(t.size)
    size, _ = noise_of_reversals(friction(), [stretch(t.size)], [(force, state)])
    assert size < 0.15


def test_with_few_reversals_the_model_tells_and_it_is_the_most():
    state, spans = motion(2)
    one = stretch(state.size)
    share = 0.5
    most = np.sqrt(share * (4.0**2 - 0.2**2)) / 1.96
    assert noise_of_reversals(friction(), [one], [(np.zeros(state.size), state)]) == (
        pytest.approx(most, rel=0.1),
        0.01,
    )
    many, spans = motion(30)
    force = np.zeros(many.size)
    for span in spans:
        force[span.start + 10 : span.start + 40] += 100.0
    one = stretch(many.size)
    assert noise_of_reversals(friction(), [one], [(force, many)])[0] == turning_of(friction(), [one])


@pytest.mark.parametrize("ends", [(4.0, 0.2), (None, 0.2), (0.2, None)])
def test_a_model_that_shows_no_more_at_reversals_adds_none(ends):
    assert turning_of(friction(*ends), [stretch(1000)]) == 0.0


def test_the_noise_of_reversals_has_its_power_and_its_time():
    plain = Noise(count=0.0, inertia=1.0, torque=0.1, misfit=0.2, correlation=0.1, cutoff=50.0, rate=RATE)
    more = replace(plain, turning=0.7, abrupt=0.03)
    f = np.linspace(0.0, 5000.0, 400001)
    added = more.spectrum(f) - plain.spectrum(f)
    assert np.trapezoid(added, f) == pytest.approx(0.7**2, rel=0.01)
    assert added[0] == pytest.approx(4.0 * 0.03 * 0.7**2)


def test_a_band_is_wider_where_the_force_jumps_and_nowhere_else():
    n, L = 2000, 20.0
    t = np.arange(n) / RATE
    true = np.where(t > 2.0, 3.0, 0.0)
    slow = 3.0 / (1.0 + np.exp(-(t - 2.0) * L * 2.0))
    quick = 3.0 / (1.0 + np.exp(-(t - 2.0) * L * 8.0))
    noise = 0.05 * np.random.default_rng(0).standard_normal(n)
    state = np.zeros(n, dtype=int)
    more = abrupt_changes(slow, quick + noise, state, L, RATE)
    near = np.abs(t - 2.0) < 2.0 / L
    error = np.abs(slow - true)
    assert np.mean(error[near] < 0.1) < 0.3 and np.mean(error[near] < more[near] + 0.1) > 0.7
    assert more[np.abs(t - 2.0) > 4.0 / L].max() < 0.2 and more[near].max() > 0.6
    state[900:1100] = 2
    assert np.all(abrupt_changes(slow, quick, state, L, RATE)[900:1100] == 0.0)


def test_contacts_do_not_see_the_band_of_abrupt_changes():
    more = np.array([0.0, 2.0, 0.0])
    one = JointForce(
        joint=Joint(name="j"),
        time=np.arange(3.0),
        force=np.array([1.0, -3.0, 4.0]),
        friction=np.zeros(3),
        lower=np.array([0.0, -6.0, 3.0]),
        upper=np.array([2.0, 0.0, 5.0]),
        state=np.zeros(3, dtype=np.int8),
        method="momentum",
        bandwidth=20.0,
        lag=0.05,
        abrupt=more,
    )
    assert score(one) == pytest.approx([1.0, 3.0, 4.0])
