"""Laws fitted along a motion under coloured noise or a coarse encoder: the last fit sees to both, and states errors that hold."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from backdrive import identify
from backdrive.identification.dynamic import attenuation, colour, rounding, torque_task
from backdrive.identification.dynamic.attenuation import restore_inertia
from backdrive.identification.dynamic.colour import bins_of, whiten_noise
from backdrive.identification.dynamic.law_fit import fit_law
from backdrive.identification.dynamic.stretch import near_reversals, stretch, with_error
from backdrive.identification.signals import prepare
from backdrive.identification.whitening import Colour, neighbours
from backdrive.logs.log import Joint, Log

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks" / "evidence"))

import _independent as independent

TRUTH = independent.Joint(coulomb=1.5, viscous=0.4, inertia=0.15, gravity=(2.0, 0.5))
LAW = {"law": "coulomb-viscous", "symmetric": True}


VISCOUS = independent.Joint(coulomb=1.7, viscous=0.56, inertia=0.058)


def log_of(seed, colour=0.98, noise=0.08, rate=200.0, top=2.0, truth=TRUTH, **logger):
    rng = np.random.default_rng(seed)
    motion = independent.multisine(20.0, top, rng)
    made = independent.record(
        truth, motion, independent.Logger(rate=rate, noise=noise, colour=colour, **logger), rng
    )
    channels = {"position": made.position[:, None], "torque": made.torque[:, None]}
    return Log(time=made.time, joints=(Joint(name="joint"),), **channels)


def stretches_of(log):
    return [stretch(signals) for signals in prepare(log, "joint")]


@pytest.fixture
def fits(monkeypatch):
    """Return the fits before and after, as they are made."""
    made = []

    def keep(fit, seconds):
        made.append((fit, whiten_noise(fit, seconds)))
        return made[-1][1]

    monkeypatch.setattr(torque_task, "whiten_noise", keep)
    return made


def test_coloured_noise_is_whitened_and_errors_are_smaller_and_hold(fits):
    results = [identify(log_of(seed), **LAW) for seed in range(5)]
    used = [(a, b) for a, b in fits if b is not a]
    assert len(used) >= 3
    for first, second in used:
        assert second.standard_errors["coulomb_positive"] < 0.9 * first.standard_errors["coulomb_positive"]
        assert second.rms == pytest.approx(first.rms, rel=0.1) and second.samples == first.samples
    far = [
        (fit.values[name] - truth) / fit.standard_errors[name]
        for _, fit in fits
        for name, truth in (("coulomb_positive", 1.5), ("viscous_positive", 0.4), ("inertia", 0.15))
    ]
    assert np.sqrt(np.mean(np.square(far))) < 1.6
    curve = results[0].evidence[0].curve
    assert np.all(curve.standard_error[np.abs(curve.velocity) > 0.2] > 0.0)


@pytest.mark.parametrize(
    ("noisy", "share"), [({"colour": 0.98}, 0.9), ({"colour": 0.0, "noise": 0.05}, 0.95)]
)
def test_noise_is_whitened_beside_the_rounding_of_a_coarse_encoder(fits, noisy, share):
    for seed in range(6):
        identify(log_of(seed, counts=4096.0, **noisy), **LAW)
    used = [(a, b) for a, b in fits if b is not a]
    assert len(used) >= 3
    smaller = [b.standard_errors["coulomb_positive"] / a.standard_errors["coulomb_positive"] for a, b in used]
    assert np.median(smaller) < share
    far = [
        (fit.values[name] - truth) / fit.standard_errors[name]
        for _, fit in used
        for name, truth in (("coulomb_positive", 1.5), ("viscous_positive", 0.4), ("inertia", 0.15))
    ]
    assert np.sqrt(np.mean(np.square(far))) < 1.6


@pytest.mark.parametrize(
    ("about", "share"),
    [
        ({"counts": 4096.0}, 0.5),
        ({"counts": 1000.0, "rate": 1000.0}, 0.8),
        ({"counts": 4096.0, "rate": 1000.0, "top": 0.5}, 0.8),
    ],
)
def test_a_coarse_encoder_does_not_make_the_inertia_too_small(monkeypatch, about, share):
    made = []

    def keep(fit):
        made.append((fit, restore_inertia(fit)))
        return made[-1][1]

    monkeypatch.setattr(torque_task, "restore_inertia", keep)
    for seed in range(4):
        identify(log_of(seed, colour=0.0, noise=0.05, **about), **LAW)
    before, after = (np.array([pair[i].values["inertia"] for pair in made]) / 0.15 - 1.0 for i in (0, 1))
    assert before.mean() < -0.005
    assert abs(after.mean()) < share * abs(before.mean())
    far = [[(f.values["inertia"] - 0.15) / f.standard_errors["inertia"] for f in pair] for pair in made]
    first, last = np.sqrt(np.mean(np.square(far), axis=0))
    assert last < 0.8 * first


def test_an_interruption_of_the_last_fit_is_told(monkeypatch):
    run = colour.Search.run
    monkeypatch.setattr(colour.Search, "run", lambda *a, **k: replace(run(*a, **k), interrupted=True))
    fit = fit_law(
        "coulomb-viscous", stretches_of(log_of(3)), terms=("inertia", "offset", "gravity_sin", "gravity_cos")
    )
    monkeypatch.setattr(colour, "colour_of", lambda *a: Colour(0.9))
    with pytest.raises(KeyboardInterrupt):
        whiten_noise(replace(fit, found=replace(fit.found, interrupted=False)), 0.035)


def test_white_noise_leaves_the_fit_as_it_is(fits):
    identify(log_of(1, colour=0.0), **LAW)
    ((first, second),) = fits
    assert second is first


def test_a_profile_is_that_of_the_first_fit(fits):
    identify(log_of(2), **LAW, interval="profile")
    assert fits == []


def test_bins_hold_neighbouring_samples_alone():
    instants = np.array([0, 1, 2, 3, 4, 6, 7, 9, 10, 11, 12, 13, 14, 15, 100, 101, 102, 103])
    bins, average = bins_of(instants, 4)
    assert bins.tolist() == [0, 1, 2, 3, 25]  # of the second and the third, three samples of four
    residual = np.stack([np.ones(18), instants.astype(float)])
    assert average(residual)[0] == pytest.approx(np.sqrt([4, 3, 3, 4, 4]))
    assert average(residual)[1, 0] == pytest.approx((0 + 1 + 2 + 3) / 2.0)
    assert average(instants.astype(float))[2] == pytest.approx((9 + 10 + 11) / np.sqrt(3.0))


def test_the_correlation_of_neighbours():
    rng = np.random.default_rng(0)
    series = independent.noise(200_000, 1.0, 0.7, rng)
    assert neighbours(series, np.ones(series.size - 1, dtype=int)) == pytest.approx(0.7, abs=0.01)
    assert neighbours(series, np.full(series.size - 1, 2)) == 0.0
    assert neighbours(np.zeros(9), np.ones(8, dtype=int)) == 0.0


def test_a_coarse_encoder_does_not_make_a_torque_seem_early(monkeypatch):
    """Where viscous friction outweighs inertia, only the jerk tells a delay apart, and most of the jerk is rounding."""
    before, after = [], []

    def keep(fit):
        before.append(fit)
        after.append(restore_inertia(fit))
        return after[-1]

    monkeypatch.setattr(torque_task, "restore_inertia", keep)
    for seed in range(8):
        identify(log_of(seed, colour=0.0, noise=0.03, truth=VISCOUS, counts=4096.0), **LAW)
    errors = {
        name: np.array(
            [[(f.values[name] - truth) / f.standard_errors[name] for f in each] for each in (before, after)]
        )
        for name, truth in (("delay", 0.0), ("inertia", VISCOUS.inertia))
    }
    for z in errors.values():
        first, last = np.sqrt(np.mean(z**2, axis=1))
        assert first > 6.0 and last < 3.0, z


def test_a_late_torque_has_as_much_taken_from_the_inertia(monkeypatch):
    """False acceleration is delayed like the motion that a late torque is fitted to."""
    moved = {0.0: [], 0.04: []}
    far = []
    for late, share in moved.items():

        def keep(fit, share=share):
            one = restore_inertia(fit)
            share.append(one.values["inertia"] / fit.values["inertia"] - 1.0)
            return one

        monkeypatch.setattr(torque_task, "restore_inertia", keep)
        for seed in range(5):
            log = log_of(seed, colour=0.0, noise=0.05, counts=2048.0, late=late)
            joint = identify(log, **LAW).model.joints[0]
            far += [
                (joint.dynamics[name].value - truth) / joint.dynamics[name].standard_error
                for name, truth in (("delay", late), ("inertia", 0.15))
            ]
    assert np.mean(moved[0.0]) > 0.002
    assert np.mean(moved[0.04]) == pytest.approx(np.mean(moved[0.0]), rel=0.3)
    assert np.sqrt(np.mean(np.square(far))) < 3.0


@pytest.mark.parametrize("cutoff", [None, 8.0, 40.0])
def test_false_acceleration_is_low_passed_like_the_motion(cutoff):
    log, fine = (log_of(3, colour=0.0, noise=0.01, counts=counts) for counts in (4096.0, 2.0**30))
    ((_, coarse),), ((_, exact),) = (torque_task._stretches(one, "joint", cutoff) for one in (log, fine))
    step = 2.0 * np.pi / 4096.0
    inner = slice(100, -100)
    true = np.std((coarse.acceleration - exact.acceleration)[inner])
    draws = [with_error(exact, rounding._rounding(exact, step, phase)) for phase in (0.1, 0.4, 0.7)]
    drawn = np.sqrt(np.mean([np.var((one.acceleration - exact.acceleration)[inner]) for one in draws]))
    assert drawn == pytest.approx(true, rel=0.15)


def test_a_low_pass_near_reversals_does_not_make_the_torque_early(monkeypatch):
    made = []

    def keep(fit):
        made.append((fit, restore_inertia(fit)))
        return made[-1][1]

    monkeypatch.setattr(torque_task, "restore_inertia", keep)
    for seed in range(6):  # an exact encoder, and the usual cutoff
        identify(log_of(seed, colour=0.0, noise=0.03, truth=VISCOUS, counts=2.0**30), **LAW)
    far = [[fit.values["delay"] / fit.standard_errors["delay"] for fit in pair] for pair in made]
    first, last = np.sqrt(np.mean(np.square(far), axis=0))
    assert first > 2.0
    assert last < 1.5
    monkeypatch.setattr(attenuation, "REACH", 0.0)
    assert all(restore_inertia(fit) is fit for fit, _ in made)


def test_fast_numbers_are_told_away_from_reversals_and_others_by_all_samples():
    rng = np.random.default_rng(1)
    A, D, r = rng.standard_normal((300, 3)), rng.standard_normal((300, 2)), rng.standard_normal(300)
    clear = rng.uniform(size=300) < 0.6
    rows, Z = attenuation._instruments(A, D + A[:, :2], clear)
    assert rows is clear and not Z[~clear].any()
    both = np.linalg.lstsq(np.hstack([A, D + A[:, :2]])[clear], r[clear], rcond=None)[0]
    assert np.linalg.solve(Z.T @ Z, Z.T @ r) == pytest.approx(both[3:])
    whole = D - A @ np.linalg.lstsq(A, D, rcond=None)[0]
    few = np.zeros(300, dtype=bool)
    for count in (0, 1, 4):  # they tell nothing
        few[:count] = True
        rows, Z = attenuation._instruments(A, D, few)
        assert rows.all() and pytest.approx(whole) == Z
    rows, Z = attenuation._instruments(np.where(clear[:, None], A * [1.0, 1.0, 0.0], A), D, clear)
    both = np.linalg.lstsq(np.hstack([A[:, :2], D])[clear], r[clear], rcond=None)[0]
    assert np.linalg.solve(Z.T @ Z, Z.T @ r) == pytest.approx(
        both[2:]
    )  # what acts at reversals alone tells none
    rows, Z = attenuation._instruments(A[:, :0], D, clear)
    assert pytest.approx(np.where(clear[:, None], D, 0.0)) == Z


@pytest.mark.parametrize("law", ["coulomb-viscous+elastoplastic", "coulomb-viscous+maxwell-slip"])
def test_laws_that_reversals_tell_have_their_inertia_told_elsewhere(law):
    joint = identify(log_of(0, colour=0.0, noise=0.03, truth=VISCOUS), law=law, symmetric=True).model.joints[
        0
    ]
    delay, inertia = joint.dynamics["delay"], joint.dynamics["inertia"]
    assert abs(delay.value) < 4.0 * delay.standard_error
    assert abs(inertia.value - VISCOUS.inertia) < 4.0 * inertia.standard_error


def test_samples_near_reversals():
    s = stretches_of(log_of(0, colour=0.0))[0]
    velocity = np.repeat([1.0, -1.0, 1.0], [20, 30, 50])
    s = replace(s, dp=s.dt * velocity)
    assert np.flatnonzero(near_reversals(s, 3)).tolist() == [*range(17, 23), *range(47, 53)]
    assert np.flatnonzero(near_reversals(s, 3, late=5.0)).tolist() == [*range(22, 28), *range(52, 58)]
    assert not near_reversals(s, 0).any()
