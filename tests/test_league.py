"""Tests for experiments/league.py: the same budget for every method, the same numbers for the same seed, scores that make sense."""

import numpy as np
import pytest
from scipy.stats import ttest_rel

from backdrive.control.estimators.external import ExternalForce
from backdrive.thesis import _league_costs as costs_
from backdrive.thesis import _league_joints as joints_
from backdrive.thesis import league
from backdrive.thesis._league_claims import claims_of
from backdrive.thesis._league_methods import METHODS
from backdrive.thesis._league_tiers import holm, reversals, t_test, tiers
from backdrive.thesis.league_estimators import models, record_logs, score_estimator


@pytest.fixture(scope="module")
def setup_a():
    return joints_.contenders()[0]


def test_every_method_draws_within_its_ranges_the_same_for_the_same_seed():
    for method in METHODS:
        drawn = method.draw(12, 0)
        assert drawn == method.draw(12, 0)
        assert len(drawn) == (12 if method.ranges else 1)
        for name, (low, high) in method.ranges.items():
            assert all(low <= z[name] <= high for z in drawn)


def test_every_method_makes_a_compensator_for_every_joint():
    for who in joints_.contenders():
        for method in METHODS:
            row = method.make(who, method.draw(1, 0)[0]).row(1e-3)
            assert np.all(np.isfinite(row))


def test_a_compensated_joint_needs_less_force_and_scores_repeat(setup_a):
    by_name = {method.name: method for method in METHODS}
    bare = league.score(setup_a, by_name["NC"], [{}], joints_.NOMINAL, 0)[0]
    z = {"share": 0.8, "stiffness": 0.4, "decay": 20.0}
    p = league.score(setup_a, by_name["P"], [z], joints_.NOMINAL, 0)[0]
    assert league.score(setup_a, by_name["P"], [z], joints_.NOMINAL, 0)[0] == p
    assert p["stiff_rms"] < 0.85 * bare["stiff_rms"]
    assert costs_.cost(setup_a, bare, bare) == pytest.approx(1.0, abs=0.01)
    assert costs_.cost(setup_a, p, bare) < 0.95
    assert bare["cycle"] < setup_a.count
    assert bare["energy"] == 0.0


def test_a_friction_model_lowers_the_error_of_the_estimate(setup_a):
    logs = record_logs(setup_a, 0)
    errors = {}
    for name in ("none", "algFE"):
        estimator = ExternalForce(inertia=setup_a.truth.inertia, friction=models(setup_a)[name])
        errors[name] = score_estimator(setup_a, estimator, *logs)
    assert errors["algFE"]["rms"] < 0.6 * errors["none"]["rms"]
    assert errors["algFE"]["false"] < errors["none"]["false"]


SCORES = (
    "touch",
    "dwell",
    "stiff_peak",
    "stiff_rms",
    "soft_peak",
    "soft_rms",
    "cycle",
    "fluctuation",
    "tracking",
)


def table_of(factor):
    """Return a table of four seeds; `factor(joint, method, setting, seed)` scales the forces of the bare joint."""
    bare = dict.fromkeys(SCORES, 1.0) | {"cycle": 0.0, "fluctuation": 0.0}
    calm = ("cycle", "fluctuation")
    return {
        seed: {
            who.name: {
                m.name: {
                    s.name: {
                        k: v if k in calm else v * factor(who.name, m.name, s.name, seed)
                        for k, v in bare.items()
                    }
                    for s in joints_.SETTINGS
                }
                for m in METHODS
            }
            for who in joints_.contenders()
        }
        for seed in range(4)
    }


def test_each_setting_stands_against_the_bare_joint_of_the_same_setting():
    """Where all joints need twice the force in a setting, nobody's cost changes."""
    noise = joints_.SETTINGS[1].name
    twice = table_of(lambda who, m, s, seed: (2.0 if s == noise else 1.0) * (0.5 if m == "P" else 1.0))
    for setting in ("", noise, joints_.NOMINAL.name):
        costs = costs_.costs_of(twice, setting)
        assert costs["NC"] == pytest.approx(1.0)
        assert costs["P"] == pytest.approx(0.5)


def test_a_claim_about_a_joint_hangs_on_that_joint():
    rows = [
        {"friction": f, "method": "kalman", "rms": r, "delay": 0.0} for f, r in (("none", 1.0), ("CT", 0.4))
    ]

    def verdicts(worse):
        made = table_of(
            lambda who, m, s, seed: 1.0 if m == "NC" else (1.1 if (who, m) == worse else 0.5) + 0.01 * seed
        )
        claims = claims_of(made, [{"rows": rows}])
        return {c.what.split(":")[0]: c.holds for c in claims if "cost less than the bare joint" in c.what}

    assert set(verdicts(None).values()) == {True}
    assert verdicts(("joint_1", "PD")) == {
        "setup_a": True,
        "joint_0": True,
        "joint_1": False,
        "joint_2": True,
    }


def test_holm_steps_down_and_stops():
    assert list(holm(np.array([0.04, 0.001, 0.02]))) == [True, True, True]
    assert list(holm(np.array([0.04, 0.001, 0.03]))) == [
        False,
        True,
        False,
    ]  # 0.03 > 0.05/2, and what follows it
    assert not holm(np.array([0.5, 0.02, 0.9])).any()


def test_tiers_hold_ties_and_reversals_are_seen():
    rng = np.random.default_rng(0)
    seeds = rng.standard_normal(10)
    one = {
        "a": seeds,
        "b": seeds + 0.01 * rng.standard_normal(10),
        "c": seeds + 5.0 + 0.1 * rng.standard_normal(10),
    }
    assert tiers(one) == [sorted(("a", "b"), key=lambda n: one[n].mean()), ["c"]]
    assert t_test(one["a"], one["c"]) == pytest.approx(ttest_rel(one["a"], one["c"]).pvalue)
    assert reversals(one, one) == []
    assert ("a", "c") in reversals(one, one | {"c": seeds - 5.0 + 0.1 * rng.standard_normal(10)})
