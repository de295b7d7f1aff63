"""Numbers that differ by direction: how much of the difference is kept, against closed forms of another kind."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from backdrive import identify
from backdrive.identification.dynamic.directions import average_directions
from backdrive.identification.dynamic.law_fit import fit_law
from backdrive.identification.dynamic.stretch import stretch
from backdrive.identification.signals import prepare
from backdrive.logs.log import Joint, Log
from backdrive.model import Covariance

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks" / "evidence"))

import _independent as independent

JOINT = independent.Joint(coulomb=1.5, viscous=0.4, inertia=0.15)
PAIR = "viscous_positive", "viscous_negative"


def log_of(seed, backwards=0.0, noise=0.15):
    """Return a log whose viscous friction is larger along -q by a share."""
    rng = np.random.default_rng(seed)
    made = independent.record(
        JOINT, independent.multisine(20.0, 2.0, rng), independent.Logger(rate=200.0, noise=noise), rng
    )
    slower = np.minimum(made.motion[1], 0.0)
    torque = made.torque + backwards * JOINT.viscous * slower
    return Log(
        time=made.time, joints=(Joint(name="joint"),), position=made.position[:, None], torque=torque[:, None]
    )


@pytest.fixture(scope="module")
def fit():
    stretches = [stretch(signals) for signals in prepare(log_of(0), "joint")]
    return fit_law("coulomb-viscous", stretches)


@pytest.mark.parametrize("apart", [0.0, 1.0, 2.5, 6.0])
def test_it_is_the_average_of_a_fit_with_and_without_a_difference(fit, apart):
    names = fit.covariance.names
    C = fit.covariance.array()
    i, j = (names.index(name) for name in PAIR)
    error = np.sqrt(C[i, i] + C[j, j] - 2.0 * C[i, j])
    given = replace(fit, values={**fit.values, PAIR[0]: 0.4, PAIR[1]: 0.4 + apart * error})
    found = average_directions(given)
    x = np.array([given.values[name] for name in names])
    # one viscous friction: least squares of all numbers in one number fewer
    alike = np.delete(np.eye(len(names)), j, axis=1)
    alike[j] += np.eye(len(names))[i][[k for k in range(len(names)) if k != j]]
    W = np.linalg.inv(C)
    cov = np.linalg.inv(alike.T @ W @ alike)
    tied, of_tied = alike @ cov @ alike.T @ W @ x, alike @ cov @ alike.T
    # how likely the difference is with and without one, by integration
    size = np.sqrt(np.mean(x[[i, j]] ** 2))
    at = np.linspace(-12.0 * size, 12.0 * size, 2_000_001)
    normal = lambda d, s: np.exp(-0.5 * (d / s) ** 2) / s  # noqa: E731
    some = np.sum(normal(apart * error - at, error) * normal(at, size)) * (at[1] - at[0]) / np.sqrt(2 * np.pi)
    p = normal(apart * error, error) / (normal(apart * error, error) + some)
    want = p * tied + (1.0 - p) * x
    variance = p * (np.diag(of_tied) + (tied - want) ** 2) + (1.0 - p) * (
        np.diag(C) + (x - want) ** 2
    )  # of a mixture
    np.testing.assert_allclose([found.values[name] for name in names], want, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose([found.standard_errors[name] for name in names], np.sqrt(variance), rtol=1e-5)
    assert found.law.rate.viscous_negative == found.values[PAIR[1]]
    assert (p > 0.9) == (apart < 2.0) and (p < 1e-3) == (apart > 4.0)


def test_without_a_covariance_or_a_pair_the_fit_stays(fit):
    bare = replace(fit, covariance=None)
    assert average_directions(bare) is bare
    names = [name for name in fit.covariance.names if name != PAIR[1]]
    rows = [fit.covariance.names.index(name) for name in names]
    few = replace(fit, covariance=Covariance.of(names, fit.covariance.array()[np.ix_(rows, rows)]))
    assert average_directions(few) is few


def test_directions_that_are_alike_get_about_one_number_and_others_keep_theirs():
    far = {True: [], False: []}
    for unlike, z in far.items():
        for seed in range(6):
            joint = identify(log_of(seed, 0.5 if unlike else 0.0), law="coulomb-viscous").model.joints[0]
            for name, truth in zip(PAIR, (0.4, 0.6 if unlike else 0.4), strict=True):
                z.append((getattr(joint.law.rate, name) - truth) / joint.standard_errors[name])
    assert all(np.sqrt(np.mean(np.square(z))) < 1.5 for z in far.values())
    free, asked = (
        identify(log_of(0), law="coulomb-viscous", symmetric=way).model.joints[0] for way in (None, False)
    )
    apart = [abs(j.law.rate.viscous_positive - j.law.rate.viscous_negative) for j in (free, asked)]
    assert apart[0] < 0.5 * apart[1]
    assert free.standard_errors[PAIR[0]] < 0.9 * asked.standard_errors[PAIR[0]]


def test_no_number_leaves_its_range(fit):
    names = [*PAIR, *(n for n in fit.covariance.names if n not in PAIR)]
    rows = [fit.covariance.names.index(name) for name in names]
    C = fit.covariance.array()[np.ix_(rows, rows)]
    C[:2], C[:, :2] = 0.0, 0.0
    C[:2, :2] = [[0.05**2, 0.9 * 0.05 * 0.02], [0.9 * 0.05 * 0.02, 0.02**2]]
    values = {**fit.values, PAIR[0]: 0.06, PAIR[1]: 0.01}  # the pull alone would make both negative
    given = replace(fit, values=values, covariance=Covariance.of(names, C))
    assert average_directions(given) is given
    bounded = identify(log_of(0), law="coulomb-viscous", bounds={"offset": (0.0095, 1.0)})
    assert bounded.model.joints[0].dynamics["offset"].value >= 0.0095


@pytest.mark.parametrize("backwards", [0.0, 0.1])
def test_the_curve_is_as_sure_as_its_numbers(backwards):
    result = identify(log_of(1, backwards), law="coulomb-viscous")
    curve, C = result.evidence[0].curve, result.model.joints[0].covariance
    names, matrix = list(C.names), C.array()
    for v, error in zip(curve.velocity, curve.standard_error, strict=True):
        if abs(v) > 0.5:
            row = np.zeros(len(names))
            row[names.index("coulomb_positive")] = 1.0  # of both directions, beside a constant torque
            row[names.index(PAIR[int(v < 0.0)])] = abs(v)
            assert error == pytest.approx(np.sqrt(row @ matrix @ row), rel=0.02)
