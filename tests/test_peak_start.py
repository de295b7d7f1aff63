"""A wide Stribeck peak with a late torque: Coulomb and viscous friction with more delay are a local minimum of the fit."""

import numpy as np
import pytest

from backdrive.identification import identify
from backdrive.identification.dynamic.peak_start import peak_start
from backdrive.identification.dynamic.starts import guess, scales
from backdrive.identification.dynamic.stretch import stretch
from backdrive.identification.dynamic.torque import TorqueProblem
from backdrive.identification.dynamic.unknowns import LawShape
from backdrive.identification.signals import prepare
from backdrive.logs.log import Joint, Log

TRUTH = {"coulomb": 1.0, "breakaway": 2.0, "stribeck_velocity": 1.345, "viscous": 2.3}


def late_sweep(seed: int = 0, late: int = 1, rate: float = 200.0) -> Log:
    """Return a log of strokes of 0.4 rad at growing speeds up to 4.5 rad/s, with torque that is late by some samples."""
    q, v, a = [np.zeros(0)], [np.zeros(0)], [np.zeros(0)]
    for top in 4.5 * np.arange(1, 13) / 12:
        n = round(0.4 * np.pi / top * rate)
        x, w = 2.0 * np.pi * np.arange(n) / n, 2.0 * np.pi * rate / n
        q.append(-0.2 * np.cos(x)), v.append(0.2 * w * np.sin(x)), a.append(0.2 * w * w * np.cos(x))
    q, v, a = np.concatenate(q), np.concatenate(v), np.concatenate(a)
    peak = (TRUTH["breakaway"] - TRUTH["coulomb"]) * np.exp(-((v / TRUTH["stribeck_velocity"]) ** 2))
    tau = 0.1 * a + 5.0 * np.sin(q) + 0.3 + np.sign(v) * (TRUTH["coulomb"] + peak) + TRUTH["viscous"] * v
    tau = np.r_[np.full(late, tau[0]), tau[: tau.size - late]]
    tau += 0.02 * np.random.default_rng(seed).standard_normal(tau.size)
    return Log(
        time=np.arange(q.size) / rate, joints=(Joint(name="a"),), position=q[:, None], torque=tau[:, None]
    )


@pytest.mark.parametrize("seed", range(3))
def test_a_wide_peak_is_not_taken_for_a_delay(seed):
    friction = identify(late_sweep(seed), law="stribeck-gauss").model.joints[0]
    for name, value in TRUTH.items():
        assert getattr(friction.law.rate, name) == pytest.approx(value, rel=0.05)
    assert friction.dynamics["delay"].value == pytest.approx(0.005, abs=5e-4)
    assert friction.dynamics["inertia"].value == pytest.approx(0.1, rel=0.01)


def problem_of(law: str, **options):
    """Return the problem of a fit to the log, and its first starting point."""
    parts = [stretch(s) for s in prepare(late_sweep(), 0)]
    terms = ("inertia", "offset", "gravity_sin", "gravity_cos")
    sizes = scales(parts, terms, "rad", None)
    problem = TorqueProblem(LawShape.from_name(law).beside(terms), parts, sizes, terms=terms, **options)
    return problem, guess(problem, sizes)


@pytest.mark.parametrize("law", ["stribeck-gauss", "stribeck-gauss-by-direction"])
def test_the_start_is_near_the_truth(law):
    problem, values = problem_of(law, delay=True)
    found = peak_start(problem, values)
    assert found is not None
    assert found["delay"] == pytest.approx(0.005, abs=1e-9)
    assert found["coulomb"] + found["viscous"] * 4.0 == pytest.approx(1.0 + 2.3 * 4.0, rel=0.05)
    assert found["breakaway"] == pytest.approx(2.0, rel=0.1)
    assert found["inertia"] == pytest.approx(0.1, rel=0.1)
    assert found["breakaway_backward"] == found["breakaway"]


def test_laws_without_a_peak_have_no_such_start():
    assert peak_start(*problem_of("coulomb-viscous", delay=True)) is None
