"""A line fitted through reversals: where a joint lags behind there, only sliding counts."""

import numpy as np
import pytest

from backdrive import Joint, Log, identify
from backdrive.identification import validate
from backdrive.identification.quality import grade

RATE = 500.0


def log_of(lag, seed=0, peak=0.0, noise=0.1):
    """A log of a joint whose friction follows the sign of its velocity over so long a way [rad], with a Stribeck peak [N.m]."""
    t = np.arange(round(16.0 * RATE)) / RATE
    w = 2.0 * np.pi * np.array([0.23, 0.61, 1.3])
    size, phase = np.array([0.6, 0.2, 0.08]), np.random.default_rng(seed).uniform(0.0, 6.0, 3)
    q, v, a = ((size * w**k * np.sin(np.outer(t, w) + phase + k * np.pi / 2)).sum(axis=1) for k in range(3))
    z = np.empty(t.size)
    z[0] = np.sign(v[0])
    for k in range(1, t.size):  # a brush that bends over the way
        z[k] = np.sign(v[k]) + (z[k - 1] - np.sign(v[k])) * (
            np.exp(-abs(q[k] - q[k - 1]) / lag) if lag else 0.0
        )
    level = 2.0 + peak * np.exp(-((v / 0.3) ** 2))
    tau = 0.2 * a + level * z + 0.5 * v + noise * np.random.default_rng(seed + 9).standard_normal(t.size)
    return Log(time=t, joints=(Joint(name="a"),), position=q[:, None], torque=tau[:, None])


@pytest.mark.parametrize("lag", [0.0, 1e-3])
def test_coulomb_friction_is_that_of_sliding(lag):
    found = identify(log_of(lag), law="coulomb-viscous").model.joints[0]
    values = found.law.rate.values()
    assert values["coulomb_positive"] == pytest.approx(2.0, abs=0.01)
    assert values["viscous_positive"] == pytest.approx(0.5, abs=0.012)


@pytest.mark.parametrize("law", ["coulomb-viscous", "stribeck-gauss"])
def test_a_law_of_the_velocity_is_judged_where_it_holds(law):
    """About reversals, where the joint bends, it is neither fitted nor judged: break-away is not near zero there."""
    model = identify(log_of(2e-3), law=law).model
    found = model.joints[0]
    assert found.held_out is not None and found.held_out.residual < 5.0
    assert found.law.torque(0.3) == pytest.approx(2.15, abs=0.04)  # a peak that is not there has any form
    again = validate(model, log_of(2e-3))["a"]
    assert again.rms == pytest.approx(found.fitted.rms, rel=0.1)


@pytest.mark.parametrize("seed", [0, 2])
def test_a_peak_is_not_lost_to_the_crossing_of_zero(seed):
    found = identify(log_of(2e-3, seed=seed, peak=1.0, noise=0.03), law="stribeck-gauss").model.joints[0]
    values = found.law.rate.values()
    assert values["coulomb"] == pytest.approx(2.0, abs=0.1)
    assert values["breakaway"] == pytest.approx(3.0, abs=0.2)
    assert grade(found).level == "good"


def test_a_joint_that_breaks_away_at_nothing_is_not_good():
    found = identify(log_of(0.0), law="stribeck-gauss", bounds={"breakaway": (1e-3, 0.1)}).model.joints[0]
    assert (
        found.warnings[0].startswith("Break-away friction") and "physically impossible" in found.warnings[0]
    )
    assert grade(found).level == "care"


def test_a_law_that_breaks_away_at_nothing_is_not_chosen():
    """Friction that changes its sign over a range of speeds is fitted best by a law with hardly any friction at rest."""
    t = np.arange(round(16.0 * RATE)) / RATE
    w = 2.0 * np.pi * np.array([0.13, 0.31])
    q = (np.array([0.3, 0.1]) * np.sin(np.outer(t, w))).sum(axis=1)
    v = np.gradient(q, t)
    noise = 0.02 * np.random.default_rng(4).standard_normal(t.size)
    tau = 0.2 * np.gradient(v, t) + 2.0 * np.tanh(v / 0.03) + 0.5 * v + noise
    log = Log(time=t, joints=(Joint(name="a"),), position=q[:, None], torque=tau[:, None])
    names = "coulomb-viscous", "stribeck-gauss+hayward-armstrong"
    found = identify(log, law=names)
    (choice,) = found.choices
    tried = {c.name: c for c in choice.candidates}
    assert tried[names[1]].held_out < tried[names[0]].held_out
    assert "impossible: break-away below Coulomb friction" in tried[names[1]].remark
    assert choice.chosen == names[0]
    assert found.model.joints[0].law.rate.values()["coulomb_positive"] == pytest.approx(2.0, abs=0.04)


def test_a_line_is_sure_only_from_the_speed_on_at_which_it_was_fitted():
    result = identify(log_of(2e-3, peak=1.0, noise=0.03), law="coulomb-viscous")
    found, curve = result.model.joints[0], result.evidence[0].curve
    lowest, v = found.validity.lowest_speed, np.abs(curve.velocity)
    assert 0.08 * v.max() <= lowest < 0.2 * v.max()
    truth = 2.0 + np.exp(-((v / 0.3) ** 2)) + 0.5 * v
    z = (np.abs(curve.torque) - truth) / curve.standard_error
    assert np.abs(z).max() < 4.0
    assert curve.standard_error[np.argmin(v)] > 0.2 * 2.0  # at rest, a peak is possible
    peaked = identify(log_of(2e-3, peak=1.0, noise=0.03), law="stribeck-gauss").evidence[0].curve
    assert peaked.standard_error[np.argmin(np.abs(peaked.velocity))] < 0.3  # the law describes it
