"""What a law misses counts in the errors of its parameters: slow samples that it does not hold for, and laws that do as well."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from backdrive import Joint, Log
from backdrive.identification.dynamic import misfit
from backdrive.identification.dynamic.choice import Candidate, Choice, ties
from backdrive.identification.dynamic.law_fit import fit_law
from backdrive.identification.dynamic.result import band
from backdrive.identification.dynamic.stretch import stretch
from backdrive.identification.signals import prepare

RATE, SECONDS = 250.0, 24.0
TRUTH = {"inertia": 0.3, "coulomb": 4.0, "viscous": 1.5}
REST = 1e-4  # bend to break-away [rad]


def recorded(noise: float, seed: int = 0, colour: float = 0.0, dip: float = 0.0):
    """Return a stretch of a joint; `dip`: its friction is so much weaker below 0.3 rad/s, which no straight line has [N.m]."""
    t = np.arange(0.0, SECONDS, 1.0 / RATE)
    w = 2.0 * np.pi * np.array([0.31, 0.83])
    q = 0.5 * np.sin(w[0] * t) + 0.1 * np.sin(w[1] * t)
    dq = np.gradient(q, t)
    ddq = np.gradient(dq, t)
    e = np.random.default_rng(seed).standard_normal(t.size)
    e = lfilter([np.sqrt(1.0 - colour**2)], [1.0, -colour], e)
    level = TRUTH["coulomb"] - dip * np.exp(-((dq / 0.3) ** 2))
    torque = TRUTH["inertia"] * ddq + level * np.sign(dq) + TRUTH["viscous"] * dq + noise * e
    log = Log(time=t, joints=(Joint(name="j"),), position=q[:, None], torque=torque[:, None])
    (signals,) = prepare(log, 0)
    return stretch(signals)


def line(one):
    return fit_law("coulomb-viscous", [one], terms=("inertia", "offset"), delay=False, begin=6, descend=1)


def test_the_change_without_slow_samples_is_that_of_a_second_fit():
    fit = line(recorded(1e-3, dip=0.5))
    found = fit.found
    (one,) = fit.problem.stretches
    slow = np.abs(one.velocity)[fit.problem.instants] <= 0.15
    weight = np.ones_like(found.weight)
    least = np.linalg.lstsq(found.jacobian, found.residual, rcond=None)[0]
    residual = found.residual - found.jacobian @ least  # that of least squares, which the change is exact for
    size = np.linalg.norm(found.jacobian, axis=0)
    told = misfit._shift(found.jacobian / size, residual, weight, fit.problem.instants, slow) / size
    again = -np.linalg.lstsq(found.jacobian[~slow], residual[~slow], rcond=None)[0]
    assert np.abs(told).max() > 0.0
    sure = told != 0.0
    np.testing.assert_allclose(told[sure], again[sure], rtol=0.1)  # a little is noise


def test_the_errors_cover_what_a_line_misses_of_a_dip_at_slow_speeds():
    fit = line(recorded(0.05, dip=1.0))
    wide = misfit.with_misfit(fit, fit)

    def off(one):
        return (
            abs(one.values["viscous_positive"] - TRUTH["viscous"]) / one.standard_errors["viscous_positive"]
        )

    assert off(fit) > 4.0  # that the motion repeats is in the error already
    assert off(wide) < 2.5
    assert wide.values == fit.values
    assert any("rests on the slowest" in s for s in wide.warnings)


@pytest.mark.parametrize("colour", [0.0, 0.95])
def test_noise_alone_hardly_widens_an_error(colour):
    grown = []
    for seed in range(12):
        fit = line(recorded(0.2, seed, colour))
        wide = misfit.with_misfit(fit, fit)
        grown += [wide.standard_errors[n] / fit.standard_errors[n] for n in fit.problem.names]
    assert np.mean(np.array(grown) > 1.1) < 0.2
    assert np.median(grown) == 1.0


def test_another_law_that_does_as_well_widens_what_both_tell():
    fit = line(recorded(0.2))
    other = replace(
        fit,
        name="other",
        values={**fit.values, "coulomb_positive": fit.values["coulomb_positive"] + 1.0, "offset": 0.3},
        unseen={"offset": "not told"},
    )
    free = np.ones(len(fit.problem.names), dtype=bool)
    apart, said = misfit.between(fit, fit, other, free)
    by_name = dict(zip(fit.problem.names, apart, strict=True))
    assert by_name["offset"] == 0.0  # the other does not tell it
    assert by_name["viscous_positive"] == 0.0
    assert len(said) == 1
    assert "'other' explains what was held out as well" in said[0]
    wide = misfit.with_misfit(fit, fit, [other])
    alone = misfit.with_misfit(fit, fit)
    slope = fit.problem.unknowns[fit.problem.names.index("coulomb_positive")].slope(
        fit.values["coulomb_positive"]
    )
    added = wide.standard_errors["coulomb_positive"] ** 2 - alone.standard_errors["coulomb_positive"] ** 2
    assert added == pytest.approx((slope * by_name["coulomb_positive"]) ** 2)
    assert added == pytest.approx(1.0, rel=0.3)  # of 1 N.m, by its logarithm
    assert wide.covariance is not None
    stated = wide.covariance.standard_errors()
    assert stated == pytest.approx({n: wide.standard_errors[n] for n in stated})
    at = np.array([0.2, 0.4])
    assert np.all(band(wide, at) > 0.8)
    assert np.all(band(fit, at) < 0.2)


def test_numbers_of_different_curves_are_not_compared():
    fit = line(recorded(0.2))
    other = fit_law("stribeck-gauss", list(fit.problem.stretches), terms=("inertia", "offset"), delay=False)
    free = np.ones(len(fit.problem.names), dtype=bool)
    apart, _ = misfit.between(fit, fit, other, free)
    by_name = dict(zip(fit.problem.names, apart, strict=True))
    assert by_name["coulomb_positive"] == 0.0
    assert by_name["inertia"] != 0.0


def test_laws_that_are_clearly_better_or_worse_are_no_tie():
    fit = line(recorded(0.2))

    def candidate(name, error, scatter=0.0, **more):
        windows = error**2 * (1.0 + scatter * np.array([1.0, -1.0, 1.0, -1.0, 0.5]))
        return Candidate(
            name=name,
            held_out=float(np.sqrt(windows.mean())),
            windows=windows,
            seconds=0.0,
            fit=replace(fit, name=name),
            **more,
        )

    listed = (
        candidate("one", 1.0, 0.2),
        candidate("alike", 1.001, 0.25),
        candidate("worse", 1.5, 0.2),
        candidate("hidden", 1.0, 0.2, shown=False),
        replace(candidate("failed", 1.0), fit=None, held_out=np.nan),
    )
    choice = Choice(joint="j", candidates=listed, chosen="one", reason="")
    assert [one.name for one in ties(choice)] == ["alike"]


def test_coloured_noise_alone_is_not_told_and_a_curve_that_it_hardly_hides_is():
    n = 4000
    v = np.sin(np.linspace(0.0, 50.0, n)) + 0.3 * np.sin(np.linspace(0.0, 170.0, n))
    J = np.stack([np.sign(v), v, np.ones(n)], axis=1)
    J /= np.linalg.norm(J, axis=0)
    slow, weight = np.abs(v) < np.quantile(np.abs(v), 0.2), np.ones(n)
    effect = np.sign(v) * slow  # of friction that is higher at slow speeds alone
    change = (
        np.linalg.lstsq(J, effect, rcond=None)[0] - np.linalg.lstsq(J[~slow], effect[~slow], rcond=None)[0]
    )
    means, beyond, found = [], [], []
    for k in range(60):
        e = lfilter([1.0], [1.0, -0.9], np.random.default_rng(100 + k).standard_normal(n))
        for size, into in ((0.0, beyond), (4.0, found)):
            y = e + size * effect
            left = J @ np.linalg.lstsq(J, y, rcond=None)[0] - y
            into.append(misfit._shift(J, left, weight, np.arange(n), slow) != 0.0)
        means.append(
            np.linalg.lstsq(J[~slow], e[~slow], rcond=None)[0] - np.linalg.lstsq(J, e, rcond=None)[0]
        )
    assert np.mean(beyond) < 0.06  # of a normal distribution, 1.2 % lie beyond
    told = np.abs(4.0 * change) > 5.0 * np.std(means, axis=0)
    assert told.any()
    assert np.mean(np.array(found)[:, told]) > 0.9


def test_friction_at_rest_is_not_told_where_the_fall_from_it_is_not():
    fit = fit_law(
        "stribeck-gauss", [recorded(0.2)], terms=("inertia", "offset"), delay=False, begin=6, descend=1
    )
    known = replace(fit, unseen={})
    hidden = replace(fit, unseen={"stribeck_velocity": "not told"})
    free = np.ones(len(fit.problem.names), dtype=bool)
    at = fit.problem.names.index("breakaway")
    assert not misfit.at_rest(known, free)[0].any()
    added, said = misfit.at_rest(hidden, free)
    slope = fit.problem.unknowns[at].slope(fit.values["breakaway"])
    assert np.sqrt(added[at, at]) * slope == pytest.approx(0.25 * fit.values["breakaway"])
    assert "'breakaway' is not identifiable from this motion (its error is 25 %)" in said["breakaway"]
    added[at, at] = 0.0
    assert not added.any()
