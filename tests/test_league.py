"""Tests for experiments/league.py: the same budget for every method, the same numbers for the same seed, scores that make sense."""

import numpy as np
import pytest

from backdrive.control.estimators.external import ExternalForce
from backdrive.thesis import _league_joints as joints_
from backdrive.thesis import league
from backdrive.thesis._league_methods import METHODS
from backdrive.thesis.league_estimators import judged, models, recorded


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
    bare = league.judged(setup_a, by_name["NC"], [{}], joints_.NOMINAL, 0)[0]
    z = {"share": 0.8, "stiffness": 0.4, "decay": 20.0}
    p = league.judged(setup_a, by_name["P"], [z], joints_.NOMINAL, 0)[0]
    assert league.judged(setup_a, by_name["P"], [z], joints_.NOMINAL, 0)[0] == p
    assert p["rms"] < 0.85 * bare["rms"]
    assert league.cost(setup_a, bare, bare) == pytest.approx(2.5, abs=0.01)
    assert league.cost(setup_a, p, bare) < 2.3
    assert bare["cycle"] < setup_a.count
    assert bare["energy"] == 0.0


def test_a_friction_model_lowers_the_error_of_the_estimate(setup_a):
    logs = recorded(setup_a, 0)
    errors = {}
    for name in ("none", "algFE"):
        estimator = ExternalForce(inertia=setup_a.truth.inertia, friction=models(setup_a)[name])
        errors[name] = judged(setup_a, estimator, *logs)
    assert errors["algFE"]["rms"] < 0.6 * errors["none"]["rms"]
    assert errors["algFE"]["false"] < errors["none"]["false"]


def test_a_claim_about_every_joint_hangs_on_every_joint():
    bare = {"peak": 2.0, "rms": 1.0, "breakaway": 3.0, "cycle": 0.0, "fluctuation": 0.0, "tracking": 1.0}
    half = bare | {"peak": 1.0, "rms": 0.5}
    rows = [
        {"friction": f, "method": "kalman", "rms": r, "delay": 0.0} for f, r in (("none", 1.0), ("CT", 0.4))
    ]

    def verdict(worse):
        table = {
            who.name: {
                m.name: {
                    "scores": {
                        s.name: bare | {"peak": 2.2}
                        if (who.name, m.name) == worse
                        else bare
                        if m.name == "NC"
                        else half
                        for s in joints_.SETTINGS
                    },
                    "bare": bare,
                }
                for m in METHODS
            }
            for who in joints_.contenders()
        }
        claims = league._claims(table, {"rows": rows})
        return next(c for c in claims if "on every joint" in c.what).holds

    assert verdict(None) is True
    assert verdict(("joint_1", "PD")) is False  # whose mean over the joints is far below the bare joint's
