"""Friction that grows with the load within the law: by its formula, in every kernel, along motions and tick by tick."""

from __future__ import annotations

import numpy as np
import pytest

from backdrive.engine import Axis, forward, rollout
from backdrive.engine.tick import Tick
from backdrive.errors import InvalidInput
from backdrive.laws import (
    REFERENCE,
    CoulombViscous,
    Dahl,
    GearLoad,
    Growth,
    HaywardArmstrong,
    Law,
    LuGre,
    Polyline,
    StribeckGauss,
    kernels,
)

MU_D, MU_B, L_0 = 0.2, 0.05, 10.0
GROWTH = Growth(load_driving=MU_D, load_driven=MU_B, load_carried=L_0)
RATE = CoulombViscous(coulomb_positive=5.0, coulomb_negative=4.0, viscous_positive=2.0, viscous_negative=1.0)
LAW = Law(rate=RATE, growth=GROWTH)


def by_hand(v, load, *, mu_d=MU_D, mu_b=MU_B, l_0=L_0):
    """Friction of RATE under a load, written down from the formula."""
    if v == 0.0:
        return 0.0
    mu = mu_d if load * v > 0.0 else mu_b
    coulomb, viscous = (5.0, 2.0) if v > 0.0 else (4.0, 1.0)
    return np.sign(v) * max(coulomb + mu * (abs(load) - l_0), 0.0) + viscous * v


@pytest.mark.parametrize("v", [-3.0, -0.1, 0.0, 0.1, 3.0])
@pytest.mark.parametrize("load", [-60.0, -10.0, -1.0, 1.0, 10.0, 60.0])
def test_the_torque_grows_by_what_the_formula_says(v, load):
    expected = by_hand(v, load)
    assert LAW.torque(v, load=load) == pytest.approx(expected, rel=1e-14, abs=1e-14)
    assert kernels.step(0, 0, LAW.row(), LAW.state(), v * 1e-3, 1e-3, (load, -load), 20.0) == pytest.approx(
        expected, rel=1e-12, abs=1e-14
    )


def test_the_load_is_the_negative_of_the_external_torque():
    v = np.array([1.0, -1.0])
    pair = np.array([[99.0, -20.0], [99.0, -20.0]])
    np.testing.assert_array_equal(LAW.torque(v, load=pair), LAW.torque(v, load=20.0))
    assert LAW.torque(1.0, load=np.array([99.0, -20.0])) == LAW.torque(1.0, load=20.0)


def test_without_a_load_the_curve_is_that_under_which_it_was_identified():
    v, bare = np.linspace(-2.0, 2.0, 9), Law(rate=RATE)
    for torque in (LAW.torque(v), LAW.torque(v, load=L_0), LAW.torque(v, load=-L_0)):
        np.testing.assert_array_equal(torque, bare.torque(v))
    assert LAW.coulomb() == bare.coulomb() == (5.0, 4.0)
    np.testing.assert_array_equal(LAW.phi(v), bare.phi(v))
    np.testing.assert_array_equal(rollout(LAW, dq=v, dt=1e-3), rollout(bare, dq=v, dt=1e-3))


def test_less_load_never_makes_friction_drive():
    steep = Growth(load_driving=0.9, load_driven=0.9, load_carried=L_0)
    assert Law(rate=RATE, growth=steep).torque(1.0, load=0.0) == 2.0  # the viscous part alone
    falling = Polyline(velocity=(1.0, 2.0), positive=(5.0, 2.0), negative=(5.0, 2.0))
    for v in (1.9, -1.9):
        law = Law(rate=falling, growth=steep)
        assert law.torque(v, load=0.0) == 0.0
        assert law.torque(v, load=L_0 + 1.0) == pytest.approx(np.sign(v) * (2.3 + 0.9))


def test_a_mass_is_held_within_the_grown_bounds():
    row, x, dt, m = LAW.row(), LAW.state(), 1e-3, 2.0
    for load, sign, bound in ((30.0, 1, 9.0), (30.0, -1, 5.0), (-30.0, 1, 6.0), (-30.0, -1, 8.0)):
        for share, held in ((0.999, True), (1.001, False)):
            free = sign * share * bound * dt / m
            v = kernels.solve(0, 0, row, x, free, dt, dt / m, (load, -load), 20.0)
            assert bool(v == 0.0) is held and v * sign >= 0.0


@pytest.mark.parametrize(
    "element", [HaywardArmstrong(stiffness=1e4), Dahl(stiffness=1e4), LuGre(stiffness=1e4)]
)
def test_a_presliding_element_builds_up_to_the_grown_bounds(element):
    law = Law(rate=RATE, element=element, growth=GROWTH)
    n = 4000
    for way in (1.0, -1.0):
        for load in (40.0, -40.0):
            pair = np.tile([load, -load], (n, 1))
            torque = rollout(law, dq=np.full(n, way * 0.01), dt=1e-3, load=pair)
            assert torque[-1] == pytest.approx(by_hand(way * 0.01, load), rel=1e-6)


def test_candidates_with_and_without_growth_roll_out_as_each_alone():
    rng = np.random.default_rng(3)
    dq, load = rng.normal(size=200), rng.normal(size=(200, 2)) * 30.0
    other = Law(rate=RATE, growth=Growth(load_driving=0.3, load_driven=0.3))
    laws = [LAW, Law(rate=RATE), other, Law(rate=GearLoad(coulomb=1.0, load=0.1))]
    for loads in (None, load):
        together = rollout(laws, dq=dq, dt=1e-3, load=loads)
        for law, torque in zip(laws, together, strict=True):
            np.testing.assert_array_equal(torque, rollout(law, dq=dq, dt=1e-3, load=loads))


def test_a_tick_without_a_load_has_the_curve_and_with_one_the_growth():
    tick = Tick([LAW, Law(rate=RATE)], dt=1e-3)
    assert tick.tick(np.full(2, 1e-3)).tolist() == [7.0, 7.0]
    tick.load[:] = (0.0, -40.0)
    assert tick.tick(np.full(2, 1e-3)) == pytest.approx([13.0, 7.0])


def test_an_axis_whose_law_grows_is_one_with_the_same_load_dependence():
    """A rigid joint: bounds wider by mu |c| are the law's own growth, and Coulomb friction mu |c| beside it."""
    rate = StribeckGauss(coulomb=2.0, breakaway=3.0, stribeck_velocity=0.1, viscous=1.0)
    inside = Law(rate=rate, growth=Growth(load_driving=0.1, load_driven=0.1))
    common = {"inertia": 0.3, "load_inertia": 0.7, "gravity_cos": 15.0, "offset": 0.5}
    u = 14.0 + 12.0 * np.sin(np.linspace(0.0, 20.0, 4000))
    a = forward(Axis(law=inside, **common), u, dt=1e-3)
    b = forward(Axis(law=Law(rate=rate), load_dependence=0.1, **common), u, dt=1e-3)
    assert np.ptp(a.position) > 0.5
    np.testing.assert_allclose(a.position, b.position, atol=1e-9)
    still = forward(Axis(law=Law(rate=rate), **common), u, dt=1e-3)
    assert np.abs(a.position - still.position).max() > 0.01


def test_an_axis_driven_back_holds_less_where_only_lifting_grows():
    law = Law(rate=RATE, growth=Growth(load_driving=0.5, load_driven=0.0))
    axis = Axis(law=law, inertia=1.0, gravity_cos=20.0)  # lifting from 25 + 10, letting down from 20 - 4
    for torque, moves in ((34.5, 0), (35.5, 1), (16.5, 0), (15.5, -1)):
        end = forward(axis, np.full(50, torque), dt=1e-3).velocity[0, -1]
        assert np.sign(end) == moves


def test_temperature_reaches_the_law():
    from backdrive.laws import LoadTemperature

    law = Law(rate=LoadTemperature(coulomb=1.0, viscous=2.0, viscous_temperature=3.0, thinning=20.0))
    assert law.torque(1.0) == pytest.approx(1.0 + 2.0 + 3.0 * np.exp(-REFERENCE / 20.0))
    warm = law.torque(np.array([1.0, 1.0]), temperature=np.array([0.0, 40.0]))
    np.testing.assert_allclose(warm, [6.0, 3.0 + 3.0 * np.exp(-2.0)])


@pytest.mark.parametrize(
    ("rate", "growth", "says"),
    [
        (GearLoad(coulomb=1.0), GROWTH, "grows with the load by itself"),
        (RATE, 0.1, "growth of a law is a float"),
    ],
)
def test_a_growth_that_makes_no_sense_is_refused(rate, growth, says):
    with pytest.raises(InvalidInput, match=says):
        Law(rate=rate, growth=growth)


@pytest.mark.parametrize("load", [np.zeros(3), np.zeros((3, 2))])
def test_loads_of_another_shape_are_refused(load):
    with pytest.raises(InvalidInput, match="shape"):
        LAW.torque(np.ones(4), load=load)


def test_the_bounds_of_the_numbers_are_checked():
    with pytest.raises(InvalidInput, match="load_carried"):
        Growth(load_driving=0.1, load_driven=0.1, load_carried=-1.0)
    assert Growth(load_driving=0.3, load_driven=0.1).mean == pytest.approx(0.2)
