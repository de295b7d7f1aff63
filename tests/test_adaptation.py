"""The level of friction learned in the loop: what it finds, when it stands still, and that it stays within its bounds."""

from dataclasses import replace

import numba as nb
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from _loops import Bench
from backdrive.control import BareLoop
from backdrive.control.compensators import alg_fc, disturbance_observer, lugre_observer
from backdrive.control.compensators.extras import DisturbanceObserver
from backdrive.control.estimators import Adaptation
from backdrive.control.estimators.external import METHODS, ExternalForce
from backdrive.control.estimators.friction import alg_fe
from backdrive.control.estimators.level import adapt, learn
from backdrive.errors import InvalidInput
from backdrive.identification.drift import passive_level
from backdrive.laws import CoulombViscous, Law, LuGre, Sigmoid, StribeckGauss
from backdrive.simulation.closed_loop import Scene, play
from backdrive.simulation.hand import Hand, strokes
from backdrive.simulation.machines import joint_0

JIT = not nb.config.DISABLE_JIT
T, M, K = 1e-3, 0.7, 5e4
RATE = CoulombViscous(coulomb_positive=7.0, coulomb_negative=7.0, viscous_positive=3.0, viscous_negative=3.0)
ADAPTS = Adaptation(slowest=0.02, time=0.3)


def joint(adaptation=ADAPTS, method="direct", **changes):
    external = ExternalForce(inertia=M, method=method, friction=alg_fe(RATE, K), encoder_count=1e-6)
    return BareLoop(
        compensator=alg_fc(RATE, K, share=0.9), external=external, adaptation=adaptation, **changes
    )


def driven(loop, level, seconds, push=lambda t: 0.0, size=0.3):
    """Drive a joint along a sine by the torque that it takes at a level of friction, and return the loop's levels, (n,)."""
    t = T * np.arange(round(seconds / T))
    q, v = size * np.sin(2.0 * t), 2.0 * size * np.cos(2.0 * t)
    u = -4.0 * M * q + level * np.sign(v) * (7.0 + 3.0 * np.abs(v)) * (size > 0.0) - push(t)
    loop.reset(q[:1])
    found, q = np.empty(t.size), np.round(q / 1e-6) * 1e-6
    for k in range(t.size):
        loop.update(q[k : k + 1], u[k - 1 : k] if k else u[:1])
        found[k] = loop.level[0]
    return found


LOOPS = {}


def shared(name, make=joint):
    if name not in LOOPS:
        LOOPS[name] = Bench(make(), interval=T)
    return LOOPS[name]


@pytest.mark.parametrize("method", METHODS)
def test_the_level_is_found_whatever_estimates_the_force(method):
    found = driven(shared(method, lambda: joint(method=method)), 0.8, 4.0 if JIT else 1.0)
    if JIT:
        assert found[-1] == pytest.approx(0.8, abs=0.06)  # the dead zone is 0.05 F
    assert np.all(np.diff(found) <= 1e-3)


def test_at_rest_and_below_the_slowest_speed_nothing_is_learned():
    assert np.ptp(driven(shared("direct"), 0.5, 0.5, push=lambda t: 3.0 + 0.0 * t, size=0.0)) == 0.0
    assert np.ptp(driven(shared("direct"), 0.5, 0.3, size=0.005)) == 0.0


def test_who_pushes_harder_than_any_level_would_explain_teaches_nothing():
    assert np.ptp(driven(shared("direct"), 1.0, 0.5, push=lambda t: 12.0 + 0.0 * t)) == 0.0


def test_a_light_hand_moves_the_level_no_further_than_its_bounds():
    light = shared("light", lambda: joint(replace(ADAPTS, time=0.01, lower=0.8)))
    found = driven(light, 1.0, 2.0 if JIT else 0.7, push=lambda t: 1.5 * np.sign(np.cos(2.0 * t)))
    assert found.min() < 0.9 or not JIT
    assert found.min() >= 0.8 and found.max() <= 1.0


def test_the_level_scales_compensation_and_friction():
    fixed = shared("fixed", lambda: joint(None))
    still = shared("still", lambda: joint(Adaptation(slowest=1e9, start=0.6)))
    for loop in (fixed, still):
        loop.reset(np.zeros(1))
    assert still.level[0] == 0.6 and fixed.level[0] == 1.0
    for k in range(200):
        q = np.array([1e-3 * k])
        for loop in (fixed, still):
            loop.update(q, np.zeros(1))
        assert still.torque[0] == pytest.approx(0.6 * fixed.torque[0], abs=1e-12)
        assert still.friction[0] == pytest.approx(0.6 * fixed.friction[0], abs=1e-12)
        lifted = fixed.external[0] - still.external[0]
        assert lifted == pytest.approx(0.4 * fixed.friction[0], abs=1e-9)


def test_a_reading_that_is_not_believed_teaches_nothing():
    loop = shared("direct")
    driven(loop, 0.8, 0.5)
    before = loop.level[0]
    for q, dt in ((np.nan, None), (1e9, None), (0.0, -1.0)):
        loop.update(np.array([q]), np.array([3.0]), dt)
        assert loop.level[0] == before


@pytest.mark.skipif(not JIT, reason="a scene of 3 s")
def test_in_a_scene_the_record_shows_the_level():
    plant = joint_0(compliant=True)
    plant = plant.replace(
        law=Law(
            rate=CoulombViscous(
                coulomb_positive=5.0, coulomb_negative=5.0, viscous_positive=2.0, viscous_negative=2.0
            )
        )
    )
    motion = strokes(T, stroke=0.4, duration=0.7, count=4)
    adaptation = Adaptation(
        slowest=0.05,
        time=0.3,
        upper=passive_level(Law(rate=RATE), plant.law, gain=0.9, top_speed=2.0),
        start=0.7,
    )
    hand = Hand(stiffness=300.0, damping=20.0)
    record = play(Scene(plant=plant, motion=motion, hand=hand, loop=joint(adaptation)))
    assert record.level[0] == 0.7
    assert np.all((record.level >= 0.5) & (record.level <= adaptation.upper))
    assert np.ptp(record.level) > 0.0
    still = play(Scene(plant=plant, motion=motion, hand=hand, loop=joint(None)))
    assert np.all(still.level == 1.0)


@settings(max_examples=200 if JIT else 20)
@given(
    level=st.floats(0.5, 1.0),
    f=st.floats(-20.0, 20.0),
    force=st.floats(allow_nan=True, allow_infinity=True),
    slid=st.floats(0.0, 0.1),
)
def test_a_tick_stays_within_the_bounds_and_learns_only_what_friction_may_do(level, f, force, slid):
    found = learn(level, f, force, slid, T, 0.3, 0.05, 3.5, 0.35, 0.5, 1.0)
    assert 0.5 <= found <= 1.0
    if found != level:
        assert slid >= 0.05
        assert abs(force) <= 0.5 * abs(f) + 0.35
        assert found == adapt(level, f, level * f - force, T, 0.3, 3.5, 0.35, 0.5, 1.0)
        assert np.sign(found - level) == -np.sign(force * f)  # a force along the motion: friction is less


def test_settings_are_checked():
    for name, wrong in {
        "slowest": 0.0,
        "settle": 0.0,
        "time": np.nan,
        "lower": 0.0,
        "upper": 0.4,
        "start": 1.2,
        "floor": -1.0,
        "dead_zone": -1.0,
    }.items():
        with pytest.raises(InvalidInput, match=f"{name} = {wrong:g}|{name}={wrong}.*lower <= start"):
            Adaptation(**({"slowest": 0.1} | {name: wrong}))
    smooth = Law(rate=Sigmoid(span=2.0, steepness=50.0))
    with pytest.raises(InvalidInput, match="no Coulomb torque"):
        Adaptation(slowest=0.1).row(smooth)
    assert Adaptation(slowest=0.1, floor=1.0, dead_zone=0.1).row(smooth)[3:5] == (1.0, 0.1)
    assert Adaptation(slowest=0.1).row(Law(rate=RATE))[3:5] == pytest.approx((3.5, 0.35))


def test_words_for_numbers_and_margins_below_zero_are_refused():
    with pytest.raises(InvalidInput, match="'a'"):
        Adaptation(slowest="a")
    with pytest.raises(InvalidInput, match="margin = -5"):
        passive_level(RATE, RATE, gain=0.9, top_speed=1.0, margin=-5.0)
    assert passive_level(RATE, Law(rate=RATE), gain=0.9, top_speed=1.0) == pytest.approx(1.0 / 0.9)


def test_what_it_cannot_go_with_is_refused():
    with pytest.raises(InvalidInput, match="estimated external force"):
        BareLoop(compensator=alg_fc(RATE, K), adaptation=ADAPTS)
    external = ExternalForce(inertia=M, friction=alg_fe(RATE, K))
    observer = disturbance_observer(Law(rate=RATE), DisturbanceObserver(inertia=M, limit=1.0))
    stribeck = StribeckGauss(coulomb=6.0, breakaway=7.0, stribeck_velocity=0.05, viscous=3.0)
    bristle = lugre_observer(stribeck, LuGre(stiffness=K, damping=20.0))
    for compensator in (observer, bristle):
        with pytest.raises(InvalidInput, match="adapts by itself"):
            BareLoop(compensator=compensator, external=external, adaptation=ADAPTS)
