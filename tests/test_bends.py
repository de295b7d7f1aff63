"""Tests for identification/bends.py: what line sections miss of a bent curve is in the errors of their knots."""

import sys
from pathlib import Path

import numpy as np
import pytest

from backdrive import Joint, Log, identify
from backdrive.identification import curves
from backdrive.identification.bends import shortfall

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks" / "evidence"))

import _independent as independent


def test_what_the_best_sections_miss_of_a_parabola():
    knots, v = np.arange(9.0), np.linspace(0.0, 8.0, 8001)
    best = np.linalg.lstsq(curves.hats(v, knots), v**2, rcond=None)[0]
    assert (best - knots**2)[2:-2] == pytest.approx(-2.0 / 12.0, abs=0.02)
    assert shortfall(knots) @ knots**2 == pytest.approx(2.0 / 12.0)
    assert shortfall(knots) @ (3.0 + 0.5 * knots) == pytest.approx(0.0, abs=1e-12)
    uneven = np.array([0.1, 0.2, 0.4, 1.0, 2.0])
    assert np.all(np.abs(shortfall(uneven) @ uneven**2) <= np.max(np.diff(uneven)) ** 2 / 6.0 + 1e-12)


def identified(joint, seed):
    rng = np.random.default_rng(seed)
    made = independent.record(
        joint, independent.multisine(30.0, 2.0, rng), independent.Logger(rate=500.0, noise=0.05), rng
    )
    channels = {"position": made.position[:, None], "torque": made.torque[:, None]}
    log = Log(time=made.time, joints=(Joint(name="joint"),), **channels)
    return identify(log, method="motion", law="polyline").model.joints[0]


def test_the_errors_of_a_bent_curve_hold():
    joint = independent.Joint(coulomb=1.5, viscous=0.3, peak=0.8, peak_speed=0.2, inertia=0.2)
    far = []
    for seed in range(4):
        found = identified(joint, seed)
        truth = joint.sliding(np.array(found.law.rate.velocity))
        far += ((found.law.rate.positive - truth) / found.standard_errors["positive"]).tolist()
    assert np.sqrt(np.mean(np.square(far))) < 2.0
    assert np.max(found.standard_errors["positive"]) < 0.05 * 1.5
