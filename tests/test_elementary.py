"""Elementary functions against mpmath, at their edges, and bit for bit between plain Python and compiled code, with every law."""

import math
import os
import subprocess
import sys

import mpmath
import numpy as np
import pytest

from backdrive import elementary
from backdrive._jit import COMPILED
from backdrive.laws import ELEMENTS, RATES, Law, kernels
from backdrive.laws.examples import ELEMENT_EXAMPLES, RATE_EXAMPLES

MANY = 3000 if COMPILED else 300
NORMAL = 2.3e-308
ONE = {  # name -> units in the last place that are admitted, and arguments
    "exp": (
        0.54,
        lambda r, n: [
            *r.uniform(-708.0, 709.78, n),
            *r.uniform(-708.0, -690.0, n),
            *r.normal(size=n),
            *tiny(r, n),
            709.7827,
            -708.0,
        ],
    ),
    "log": (
        0.54,
        lambda r, n: [*10.0 ** r.uniform(-307, 308, n), *abs(1.0 + tiny(r, n)), *r.uniform(0.5, 2, n)],
    ),
    "tanh": (0.54, lambda r, n: [*r.uniform(-23.0, 23.0, n), *r.uniform(-0.3, 0.3, n), *tiny(r, n)]),
    "sin": (
        0.54,
        lambda r, n: [*r.uniform(-1e6, 1e6, n), *r.uniform(-7, 7, n), *tiny(r, n), *quarters(r, n)],
    ),
    "cos": (
        0.54,
        lambda r, n: [*r.uniform(-1e6, 1e6, n), *r.uniform(-7, 7, n), *tiny(r, n), *quarters(r, n)],
    ),
}


def tiny(r, n):
    return r.normal(size=n) * 10.0 ** r.uniform(-12, 0, n)


def quarters(r, n):
    return [*np.round(r.uniform(-6e5, 6e5, n)) * (0.5 * np.pi), *(0.25 * np.pi + r.uniform(-0.02, 0.02, n))]


def off(value, truth):
    """Return by how many units in the last place a value is off its truth."""
    return float(abs(mpmath.mpf(float(value)) - truth) / mpmath.mpf(float(np.spacing(abs(float(truth))))))


@pytest.mark.parametrize("name", ONE)
def test_one_argument_is_right_to_the_last_place(name):
    limit, arguments = ONE[name]
    with mpmath.workprec(160):
        for x in arguments(np.random.default_rng(1), MANY):
            truth = getattr(mpmath, name)(mpmath.mpf(float(x)))
            if abs(truth) > NORMAL:
                assert off(getattr(elementary, name)(float(x)), truth) <= limit, x


def test_decay_is_within_a_unit_in_the_last_place():
    r = np.random.default_rng(4)
    arguments = [*r.uniform(-708.0, 0.0, MANY), *-abs(r.normal(size=MANY)), *-abs(tiny(r, MANY))]
    with mpmath.workprec(160):
        for x in [*arguments, *r.uniform(-0.36, -0.33, MANY)]:  # the last: where most is lost
            assert off(elementary.decay(float(x)), mpmath.exp(mpmath.mpf(float(x)))) <= 0.9, x


@pytest.mark.parametrize("x", [0.0, -0.0, -5e-324, -708.0, -708.0000001, -708.8, -1e308, -math.inf, math.nan])
def test_decay_at_its_edges(x):
    with np.errstate(under="ignore"):
        expected = float(np.exp(x)) if x >= -708.0 or math.isnan(x) else 0.0
    assert same(elementary.decay(x), expected)
    assert same(elementary.decay_of_one(x), expected)


def test_one_decay_is_that_of_many():
    x = [*-np.random.default_rng(3).uniform(0.0, 720.0, MANY), *-(10.0 ** np.linspace(-320.0, 3.0, MANY))]
    assert all(same(elementary.decay_of_one(float(y)), elementary.decay(float(y))) for y in x)


def test_power_is_right_to_the_last_place():
    r = np.random.default_rng(2)
    pairs = [
        *zip(10.0 ** r.uniform(-6, 6, MANY), r.uniform(-50, 50, MANY), strict=True),
        *zip(r.uniform(0, 3, MANY), r.uniform(0.1, 4, MANY), strict=True),
        *zip(1.0 + tiny(r, MANY) * 1e-3, r.uniform(-1e6, 1e6, MANY), strict=True),
    ]
    with mpmath.workprec(160):
        for x, y in pairs:
            truth = mpmath.power(float(x), float(y))
            if NORMAL < truth < 1.79e308:
                assert off(elementary.pow(float(x), float(y)), truth) <= 0.54, (x, y)


def same(a, b):
    return (math.isnan(a) and math.isnan(b)) or (a == b and math.copysign(1.0, a) == math.copysign(1.0, b))


@pytest.mark.parametrize("name", ["exp", "tanh", "sin", "cos"])
@pytest.mark.parametrize("x", [0.0, -0.0, math.inf, -math.inf, math.nan, 5e-324, -5e-324])
def test_edges_are_those_of_numpy(name, x):
    with np.errstate(invalid="ignore"):
        assert same(getattr(elementary, name)(x), float(getattr(np, name)(x)))


def test_exp_ends_at_the_largest_number_and_at_zero():
    assert elementary.exp(709.782712893384) == pytest.approx(math.exp(709.782712893384), rel=1e-15)
    assert elementary.exp(709.7827128933841) == math.inf
    assert elementary.exp(-708.1) == 0.0


@pytest.mark.parametrize("x", [0.0, 5e-324, 1e-310, 1.0, math.inf])
def test_log_at_its_edges(x):
    expected = -math.inf if x == 0.0 else math.log(x)
    assert elementary.log(x) == expected or elementary.log(x) == pytest.approx(expected, rel=3e-16)


@pytest.mark.parametrize("x", [0.0, 5e-324, 0.5, 1.0, 2.0, math.inf])
@pytest.mark.parametrize("y", [0.0, 0.5, -1.0, 2.0, math.inf, -math.inf, 1e300])
def test_power_at_its_edges(x, y):
    with np.errstate(divide="ignore", over="ignore"):
        expected = float(np.power(x, y))
    value = elementary.pow(x, y)
    assert value == expected or value == pytest.approx(expected, rel=3e-16)


def test_what_has_no_answer_is_not_a_number():
    assert math.isnan(elementary.log(-1.0))
    assert math.isnan(elementary.pow(-1.0, 2.5))
    assert math.isnan(elementary.pow(math.nan, 2.0))
    assert math.isnan(elementary.sin(1e16))
    assert elementary.sin(1e12) == pytest.approx(math.sin(1e12), abs=1e-3)


def bits() -> str:
    """Return the bits of every function on some arguments and of every law along a motion, as text."""
    r, lines = np.random.default_rng(3), []
    for name, (_, arguments) in ONE.items():
        for x in arguments(r, 40):
            lines.append(getattr(elementary, name)(float(x)).hex())
    lines += [elementary.decay(float(x)).hex() for x in -(10.0 ** r.uniform(-9, 2.9, 99))]
    lines += [
        elementary.pow(float(a), float(b)).hex()
        for a, b in zip(10.0 ** r.uniform(-6, 6, 99), r.uniform(-40, 40, 99), strict=True)
    ]
    dp = np.cumsum(r.normal(size=60)) * 3e-5
    for rate, one in RATES.items():
        for element in [None] if one.SMOOTH else ELEMENTS:
            made = {} if element is None else {"element": ELEMENT_EXAMPLES[element]}
            law = Law(rate=RATE_EXAMPLES[rate], **made)
            p, x = law.row(), law.state()
            torque = [
                float(kernels.step(law.rate.KIND, law.element.KIND, p, x, d, 1e-3, (0.3, -0.2), 31.0)).hex()
                for d in dp.tolist()
            ]
            lines.append(f"{law.name} {' '.join(torque)}")
    return "\n".join(lines)


@pytest.mark.skipif(not COMPILED, reason="compares compiled code with plain, and starts from compiled")
def test_every_function_and_law_has_the_same_bits_in_plain_python():
    code = "import test_elementary; print(test_elementary.bits())"
    plain = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
        cwd=os.path.dirname(__file__),
        capture_output=True,
        text=True,
        check=True,
    ).stdout.splitlines()
    compiled = bits().splitlines()
    assert len(plain) == len(compiled) > 100
    different = [b.split()[0] for a, b in zip(plain, compiled, strict=True) if a != b]
    assert different == []
