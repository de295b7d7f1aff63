"""The contract of every presliding element, under every rate law that it can carry: random parameters, motions and ticks.

Each property says what it claims and for which parameters. `-m long` tries 10^5 cases of each on every element.
"""

from copy import copy

import numpy as np
import pytest
from hypothesis import given, settings

from _laws import EXAMPLES, JIT, LANES, TICKS, Batch, batches, many
from backdrive.laws import ELEMENTS, Coulomb, Law

ALL = sorted(ELEMENTS)


def reaches_the_rate_law(b: Batch, random):
    """At a constant velocity every element ends at the rate law's torque, to 1e-9 of it.

    Two do not (STEADY is False): `decaying` ends at min(F, K v/alpha) plus the viscous part, `dead-zone` at 0 inside it.
    """
    lag = np.maximum(b.value("lag"), b.bound / b.value("attraction", np.inf))
    rate = b.value("decay_rate")
    b.dt = np.maximum(
        b.dt, np.maximum(lag, np.divide(1.0, rate, where=rate > 0.0, out=np.zeros_like(rate))) / 5.0
    )
    speed = np.maximum(10.0 ** random.uniform(-4.0, 2.0, b.dt.size), b.stretch / b.dt / 4.0)
    v = speed * random.choice([-1.0, 1.0], b.dt.size)
    viscous = b.limits(v[:, None])[2, :, 0]
    expected = b.steady(v[:, None])[:, 0]
    if b.laws[0].element.NAME == "decaying":
        coulomb = expected - viscous
        held = np.divide(b.value("stiffness") * speed, rate, where=rate > 0.0, out=np.full_like(rate, np.inf))
        expected = np.sign(v) * np.minimum(np.abs(coulomb), held) + viscous
    if b.laws[0].element.NAME == "dead-zone":
        expected = np.where(speed <= b.value("threshold"), 0.0, expected)
    torque, _ = b.run(np.tile((v * b.dt)[:, None], (1, 250)))
    slack = 1e-9 * (b.bound + np.abs(viscous)) + 1e-13 * b.value("damping") * speed
    assert np.all(np.abs(torque[:, -1] - expected) <= slack)


def yields_no_work(b: Batch, random):
    """No motion that begins at rest gets work out of friction.

    For `lugre`, `elastoplastic` and `gms` where `advice` is empty (the bound on sigma_1; bounds that do not change with
    speed), for `hayward-armstrong` and `decaying` where the viscous part does not fall with speed. `bliman-sorine` only
    promises it of closed cycles.
    """
    element = b.laws[0].element
    if element.NAME == "bliman-sorine":
        return
    b = b.taken(~b.advised() & ~(b.falls & element.SLIDER))
    if b is None:
        return
    torque, _ = b.run()
    work = np.cumsum(torque * b.dp, axis=1)
    assert np.all(work >= -1e-9 * np.cumsum(np.abs(torque * b.dp), axis=1))


def yields_no_work_in_a_cycle(b: Batch, random):
    """A smooth closed motion takes work in every cycle, once the torque repeats, where `advice` is empty."""
    b = b.taken(~b.advised())
    if b is None:
        return
    n, lanes = (60 if JIT else 40), b.dt.size
    phase = 2.0 * np.pi * np.arange(n + 1) / n
    height, shift = random.normal(size=(3, lanes, 1)), 6.3 * random.random((3, lanes, 1))
    q = sum(height[k] / (k + 1) * np.sin((k + 1) * phase + shift[k]) for k in range(3))
    cycle = np.diff(q, axis=1) * (b.stretch * 10.0 ** random.uniform(-1.0, 2.0, lanes))[:, None]
    torque, _ = b.run(np.tile(cycle, (1, 3)))
    last, before = torque[:, -n:], torque[:, -2 * n : -n]
    repeats = np.abs(last - before).max(axis=1) <= 1e-11 * b.bound
    work = last[repeats] * cycle[repeats]
    assert np.all(work.sum(axis=1) >= -1e-9 * np.abs(work).sum(axis=1))


def is_odd(b: Batch, random):
    """Where the rate law is SYMMETRIC, the mirrored motion under the mirrored load gives the mirrored torque to the last bit."""
    b = b.taken([law.rate.SYMMETRIC for law in b.laws])
    if b is not None:
        np.testing.assert_array_equal(b.run()[0], -b.run(-b.dp, load=-b.load)[0])


def is_bounded_at_any_speed(b: Batch, random):
    """At 1 ms, from creeping to 1e6 rad/s and back with reversals on the way, nothing overflows or grows.

    Beyond the viscous part the torque is within the largest bound F, times 1 + a for `reset-integrator` and 1 + 2 b for
    `bliman-sorine`; damping of a bristle adds 2 sigma_1 F/(sigma_0 dt) at most. The slider's viscous part is within that of
    the joint, or of alpha F/K.
    """
    speed = np.geomspace(1e-6, 1e6, TICKS // 2)
    way = np.where(random.random(b.dp.shape) < 0.3, -1.0, 1.0)
    b.dt = np.full(b.dt.size, 1e-3)
    b.dp = 1e-3 * way * np.concatenate([speed, speed[::-1]])
    torque, state = b.run()
    most = b.bound * (
        2.0 + b.value("excess") + 2.0 * b.value("overshoot")
    )  # 2: falling sections take F off at most
    if b.laws[0].element.NAME in ("lugre", "elastoplastic", "leuven"):
        most = most + 2.0 * b.value("damping") * b.bound / (b.value("stiffness", 1.0, np.min) * 1e-3)
    viscous = b.viscous()
    if b.laws[0].element.NAME == "decaying":
        leak = (b.value("decay_rate") * b.bound / b.value("stiffness"))[:, None]
        viscous = np.maximum(
            np.abs(viscous), np.abs(b.limits(np.hstack([leak, -leak]))[2]).max(axis=1)[:, None]
        )
    assert np.all(np.abs(torque) <= 1.000001 * (most[:, None] + np.abs(viscous)))
    assert np.all(np.isfinite(state))


def keeps_a_nan(b: Batch, random):
    """A NaN increment gives a NaN torque, a NaN or infinite v_free a NaN velocity."""
    b.dp = np.where(np.arange(TICKS) == TICKS // 2, np.nan, b.dp)
    assert np.all(np.isnan(b.run()[0][:, TICKS // 2]))
    for i in range(min(b.dt.size, LANES)):
        for v_free in (np.nan, np.inf):
            assert np.isnan(b.solve(i, b.fresh()[i], v_free, 1e-3))


def takes_the_largest_increments(b: Batch, random):
    """The largest and smallest finite increments give finite torques, and so do the ticks after them."""
    huge = random.choice([1.79e308, -1.79e308, 5e-324, -5e-324], b.dp.shape)
    b.dp = np.where(random.random(b.dp.shape) < 0.2, huge, b.dp)
    torque, state = b.run()
    assert np.all(np.isfinite(torque))
    assert np.all(np.isfinite(state))


def grows_with_the_coulomb_torque(b: Batch, random):
    """From rest at a constant velocity, a larger Coulomb torque never gives a smaller torque, at any tick."""
    levels = {}
    for key, law in b.unique.items():
        F = 10.0 ** random.uniform(-2.0, 2.0)
        grown = F * (1.0 + 10.0 ** random.uniform(-6.0, 1.0))
        levels[key] = [Law(rate=Coulomb(coulomb=f), element=law.element) for f in (F, grown)]
    speed = b.stretch * 10.0 ** random.uniform(-2.0, 1.0, b.dt.size)
    motion = np.tile((random.choice([-1.0, 1.0], b.dt.size) * speed)[:, None], (1, TICKS))
    torque = []
    for k in (0, 1):
        laws = [levels[id(law)][k] for law in b.laws]
        level = Batch(laws, motion, b.dt, b.load, b.temperature)
        torque.append(np.abs(level.run()[0]))
    assert np.all(torque[1] >= torque[0] - 1e-12 * level.bound[:, None])


def solves_what_it_steps(b: Batch, random):
    """`solve` ends where `step` says: v + dt/m step(v dt) = v_free to 1e-9, and it leaves the state as it is.

    Where friction jumps (a slipping element of `gms` or a bristle of `reset-integrator` at rest), v is where it jumps: the
    residual changes sign within 1e-9 of it. For rate laws with a Coulomb torque at rest in both directions. Set-valued
    elements are in test_laws_contract.py.
    """
    if b.laws[0].element.SET_VALUED:
        return
    _, states = b.run()
    lo, hi, _ = b.limits(np.zeros((b.dt.size, 1)))[:, :, 0]
    for i in np.flatnonzero((lo < 0.0) & (hi > 0.0)):
        soft = 10.0 ** random.uniform(-8.0, 0.0)
        far = max(b.bound[i] * soft, b.stretch[i] / b.dt[i], 1e-9)
        v_free = random.choice([-1.0, 1.0]) * far * 10.0 ** random.uniform(-3.0, 3.0)
        x, before = states[i].copy(), states[i, : b.states].copy()
        v = b.solve(i, x, v_free, soft)
        assert np.array_equal(x[: b.states], before)

        def residual(u, i=i, soft=soft, v_free=v_free):
            return u + soft * b.step(i, states[i].copy(), u * b.dt[i]) - v_free

        scale = abs(v_free) + soft * b.bound[i] + abs(v)
        if abs(residual(v)) > 1e-9 * scale:
            near = max(1e-9 * abs(v), 1e-12 * scale)
            around = [residual(v - near), residual(v), residual(v + near)]
            assert min(around) <= 0.0 <= max(around), (b.laws[i], v_free, soft, before)


PROPERTIES = (
    reaches_the_rate_law,
    yields_no_work,
    yields_no_work_in_a_cycle,
    is_odd,
    is_bounded_at_any_speed,
    keeps_a_nan,
    takes_the_largest_increments,
    grows_with_the_coulomb_torque,
    solves_what_it_steps,
)


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("property_", PROPERTIES, ids=lambda f: f.__name__)
def test_every_element(property_, name):
    @settings(max_examples=EXAMPLES)
    @given(drawn=batches(name))
    def holds(drawn):
        property_(*drawn)

    holds()


@pytest.mark.long
@pytest.mark.parametrize("name", ALL)
def test_every_element_at_length(name):
    for b, random in many(name):
        for property_ in PROPERTIES:
            property_(copy(b), random)
