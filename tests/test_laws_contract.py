"""The contract of every rate law, and what every law as a whole promises: order of convergence, drift, the model file.

Each property says what it claims and for which parameters. `-m long` tries 10^5 cases of each on every rate law.
"""

from copy import copy
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings

from _laws import (
    CARRIED,
    EXAMPLES,
    JIT,
    Batch,
    batches,
    cube,
    law_of,
    many,
    survives_the_model_file,
)
from backdrive.laws import ELEMENTS, RATES, Coulomb, DeadZone, Law, kernels
from backdrive.laws.examples import ELEMENT_EXAMPLES, RATE_EXAMPLES

NAMES = sorted(RATES)
FORCES = ("force", "force.(s/length)^n")  # what scales a rate law


def speeds(b: Batch, random, n: int = 12) -> np.ndarray:
    """Velocities of both directions over all orders of magnitude, (B, n)."""
    way = random.choice([-1.0, 1.0], (b.dt.size, n))
    return way * 10.0 ** random.uniform(-9.0, 6.0, (b.dt.size, n))


def holds_at_rest(b: Batch, random):
    """At rest lo <= 0 <= hi and the viscous part is 0; all three are continuous there, from either side."""
    lo, hi, viscous = b.limits(np.zeros((b.dt.size, 1)))
    assert np.all(lo <= 0.0) and np.all(hi >= 0.0) and np.all(viscous == 0.0)
    near = b.limits(np.tile([[-1e-200, 1e-200]], (b.dt.size, 1)))
    np.testing.assert_allclose(near[0], np.tile(lo, 2), rtol=1e-9)
    np.testing.assert_allclose(near[1], np.tile(hi, 2), rtol=1e-9)
    np.testing.assert_allclose(near[2], 0.0, atol=1e-7)


def opposes_motion(b: Batch, random):
    """The torque never drives: lo <= 0 <= hi at every velocity, and tau v >= 0.

    For `makkar` where the peak rises more steeply than it falls (g_2 >= g_3), for `polyline` with positive torques that do not
    fall in the last section.
    """
    if b.laws[0].rate.NAME == "makkar":
        b = b.taken([law.rate.rise >= law.rate.fall for law in b.laws])
        if b is None:
            return
    v = speeds(b, random)
    lo, hi, _ = b.limits(v)
    assert np.all(lo <= 0.0) and np.all(hi >= 0.0)
    assert np.all(b.steady(v) * v >= -1e-12 * b.bound[:, None] * np.abs(v))


def is_odd(b: Batch, random):
    """Where the law is SYMMETRIC, the mirrored velocity under the mirrored load gives the mirrored torque to the last bit."""
    if b.laws[0].rate.SYMMETRIC:
        v = speeds(b, random)
        np.testing.assert_array_equal(b.steady(v), -b.steady(-v, load=-b.load))


def grows_with_its_torques(b: Batch, random):
    """Parameters that are torques, all scaled up together, never lower the torque at any velocity.

    For `makkar` where g_2 >= g_3, for `load-temperature` where none of them is negative.
    """
    if b.laws[0].rate.NAME == "makkar":
        b = b.taken([law.rate.rise >= law.rate.fall for law in b.laws])
        if b is None:
            return
    parameters = b.laws[0].rate.PARAMETERS
    grown = {}
    for key, law in b.unique.items():
        scale = 1.0 + 10.0 ** random.uniform(-6.0, 1.0)
        names = [k for k, p in parameters.items() if p.unit in FORCES]
        if any(np.any(np.array(getattr(law.rate, k)) < 0.0) for k in names):
            scale = 1.0
        value = {k: (scale * np.array(getattr(law.rate, k))).tolist() for k in names}
        grown[key] = Law(rate=replace(law.rate, **value))
    after = Batch([grown[id(law)] for law in b.laws], b.dp, b.dt, b.load, b.temperature)
    v = speeds(b, random)
    before = np.abs(b.steady(v))
    assert np.all(np.abs(after.steady(v)) >= before - 1e-12 * (before + b.bound[:, None]))


def keeps_a_nan(b: Batch, random):
    """A NaN velocity gives a NaN torque; so does an unknown load or temperature, where the law NEEDS it and only there."""
    v = speeds(b, random)
    nothing = np.full(b.dt.size, np.nan)
    assert np.all(np.isnan(b.steady(v * np.nan)))
    assert np.all(np.isnan(b.steady(v, temperature=nothing)) == ("temperature" in b.laws[0].rate.NEEDS))
    unknown = np.isnan(b.steady(v, load=np.full(b.load.shape, np.nan)))
    if "load" not in b.laws[0].rate.NEEDS:
        assert not np.any(unknown)
    else:
        grows = [
            any(x > 0 for k, x in law.rate.values().items() if "load" in k and "velocity" not in k)
            for law in b.laws
        ]
        assert np.all(unknown[grows])


def takes_the_largest_velocities(b: Batch, random):
    """Any finite increment gives a finite torque, from 5e-324 to 1.79e308."""
    dp = np.tile([1.79e308, -1.79e308, 5e-324, -5e-324, 0.0, -0.0], (b.dt.size, 1))
    assert np.all(np.isfinite(b.run(dp)[0]))


def solves_its_inclusion(b: Batch, random):
    """`none` and `dead-zone`: v + dt/m (gsgn(lo, v, hi) + viscous(v)) contains v_free, to 1e-9; a held mass rests exactly."""
    smooth = (
        np.abs(b.steady(np.tile([[-1e6, 1e6]], (b.dt.size, 1)))).max(axis=1)
        if b.laws[0].rate.SMOOTH
        else 0.0 * b.dt
    )
    for i in range(b.dt.size):
        law, load, soft = b.laws[i], tuple(b.load[i]), 10.0 ** random.uniform(-8.0, 0.0)
        v_free = random.choice([-1.0, 1.0]) * max(b.bound[i] * soft, 1e-9) * 10.0 ** random.uniform(-3.0, 3.0)
        zone = 0 if law.rate.SMOOTH else random.integers(0, 2)
        row = Law(rate=law.rate, element=DeadZone(threshold=1.0)).row() if zone else law.row()
        with np.errstate(all="ignore"):
            v = kernels.solve(
                law.rate.KIND, zone, row, np.zeros(2), v_free, 1e-3, soft, load, b.temperature[i]
            )
            lo, hi, viscous = kernels.limits(law.rate.KIND, row, v, load, b.temperature[i])
        bound = hi if v > 0.0 else lo
        slack = 1e-9 * (abs(v_free) + abs(v) + soft * (abs(bound) + abs(viscous))) + 1e-14 * soft * smooth[i]
        if v == 0.0:
            assert soft * lo - slack <= v_free <= soft * hi + slack
        else:
            assert abs(v + soft * (bound + viscous) - v_free) <= slack, (law, v_free, soft, v)


PROPERTIES = (
    holds_at_rest,
    opposes_motion,
    is_odd,
    grows_with_its_torques,
    keeps_a_nan,
    takes_the_largest_velocities,
    solves_its_inclusion,
)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("property_", PROPERTIES, ids=lambda f: f.__name__)
def test_every_rate_law(property_, name):
    @settings(max_examples=EXAMPLES)
    @given(drawn=batches(name))
    def holds(drawn):
        property_(*drawn)

    holds()


@pytest.mark.long
@pytest.mark.parametrize("name", NAMES)
def test_every_rate_law_at_length(name):
    for b, random in many(name):
        for property_ in PROPERTIES:
            property_(copy(b), random)


# ----------------------------------------------------------------------------------------------- the whole law


def laws_of(name: str, count: int, seed: int = 0):
    random = np.random.default_rng(seed)
    for _ in range(count):
        rate = name if name in RATES else CARRIED[random.integers(len(CARRIED))]
        yield law_of(name, rate, random.random(cube(name, rate)).tolist())


@pytest.mark.parametrize("name", [*RATES, *ELEMENTS])
def test_every_law_survives_the_model_file(name):
    survives_the_model_file(list(laws_of(name, 100 if JIT else 10)))


@pytest.mark.long
@pytest.mark.parametrize("name", [*RATES, *ELEMENTS])
def test_every_law_survives_the_model_file_at_length(name):
    for seed in range(4):
        survives_the_model_file(list(laws_of(name, 1000, seed)))


@pytest.mark.parametrize("name", ELEMENTS)
@pytest.mark.parametrize("rate", ["coulomb-viscous", "stribeck-gauss", "m6"])
def test_halving_the_step_halves_the_error(name, rate):
    """First order or better in the mean absolute error, on a smooth motion that resolves presliding.

    Torque is taken as held through a tick, so that jumps (`none` at rest, `reset-integrator` at break-away) count by the time
    for which they are misplaced. Against a step 64 times finer.
    """
    law = Law(rate=RATE_EXAMPLES[rate], element=ELEMENT_EXAMPLES[name])
    steps, levels, finest = 120 if JIT or law.element.SET_VALUED else 60, 3, 64
    T, amplitude = 0.6, 4e-3
    fine = []
    for level in [2**k for k in range(levels)] + [finest]:
        t = np.linspace(0.0, T, steps * level + 1)
        q = amplitude * (np.sin(2.0 * np.pi * 1.7 * t) + 0.4 * np.sin(2.0 * np.pi * 4.1 * t + 0.3))
        b = Batch([law], np.diff(q)[None, :], [T / steps / level], [[3.0, -1.0]], [30.0])
        fine.append(np.repeat(b.run()[0][0], finest // level))
    errors = [np.mean(np.abs(torque - fine[-1])) for torque in fine[:-1]]
    order = np.log2(errors[0] / errors[-1]) / (len(errors) - 1)
    assert order > 0.85, errors


@pytest.mark.parametrize("name", ELEMENTS)
def test_what_drifts_below_break_away_and_what_does_not(name):
    """A mass under 0.4 F + 0.2 F sin, below the elastic limit, ends where it was a cycle ago, unless the element DRIFTS."""
    law = Law(rate=Coulomb(coulomb=5.0), element=ELEMENT_EXAMPLES[name])
    assert law.element.STEADY or name in ("decaying", "dead-zone")
    dt, inertia, cycle, cycles = 1e-3, 0.1, 100, 20
    k = np.arange(cycle * cycles)
    torque = 5.0 * np.minimum(k / (5.0 * cycle), 1.0) * (0.4 + 0.2 * np.sin(2.0 * np.pi * k / cycle))
    p, x, v, q = law.row(), law.state(), 0.0, np.zeros(k.size + 1)
    for i in k:
        v = kernels.solve(
            law.rate.KIND,
            law.element.KIND,
            p,
            x,
            v + dt / inertia * torque[i],
            dt,
            dt / inertia,
            (0.0, 0.0),
            20.0,
        )
        kernels.step(law.rate.KIND, law.element.KIND, p, x, v * dt, dt, (0.0, 0.0), 20.0)
        q[i + 1] = q[i] + v * dt
    creep = (q[-1] - q[-1 - 10 * cycle]) / 10.0  # a cycle
    elastic = np.ptp(q[-cycle:])
    if law.element.DRIFTS:
        assert creep > 1e-3 * elastic > 0.0
    else:
        assert abs(creep) <= 1e-9 * max(elastic, 1e-6)
