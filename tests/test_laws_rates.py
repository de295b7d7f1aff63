"""Special cases, published values and printed equations of the rate laws, each by hand."""

import numpy as np
import pytest

from _laws import follow
from backdrive.laws import (
    M1,
    M2,
    M3,
    M4,
    M5,
    M6,
    RATES,
    CoulombViscous,
    Degressive,
    GearLoad,
    Law,
    LoadTemperature,
    Makkar,
    Polyline,
    Sigmoid,
    StribeckGauss,
    StribeckLorentz,
    StribeckTustin,
    kernels,
)

VELOCITIES = np.concatenate([-np.geomspace(1e-6, 1e3, 40), [0.0], np.geomspace(1e-6, 1e3, 40)])


def same(a, b, load=(0.0, 0.0), temperature=20.0):
    dp = VELOCITIES * 1e-3
    np.testing.assert_allclose(
        follow(Law(rate=a), dp, 1e-3, load=load, temperature=temperature),
        follow(Law(rate=b), dp, 1e-3, load=load, temperature=temperature),
        rtol=1e-12,
    )


@pytest.mark.parametrize("load", [(0.0, 0.0), (7.0, -3.0), (-3.0, 7.0), (4.0, 2.0)])
def test_each_load_dependent_law_is_the_next_with_zeros(load):
    slide, curve = (
        {"coulomb": 4.0, "viscous": 1.0},
        {"stribeck": 2.0, "stribeck_velocity": 0.05, "exponent": 1.5},
    )
    both = {"load": 0.1, "load_stribeck": 0.05}
    each = {
        "load_motor": 0.1,
        "load_external": 0.1,
        "load_stribeck_motor": 0.05,
        "load_stribeck_external": 0.05,
    }
    same(
        M1(**slide),
        CoulombViscous(
            coulomb_positive=4.0, coulomb_negative=4.0, viscous_positive=1.0, viscous_negative=1.0
        ),
    )
    same(M1(**slide), M2(**slide), load)
    same(M1(**slide), M3(**slide), load)
    same(M2(**slide, **curve), M4(**slide, **curve), load)
    same(M3(**slide, load=0.1), M4(**slide, load=0.1), load)
    same(M4(**slide, **curve, **both), M5(**slide, **curve, **each), load)
    same(M5(**slide, **curve, **each), M6(**slide, **curve, **each), load)
    same(
        M2(**slide, **curve),
        StribeckTustin(coulomb=4.0, breakaway=6.0, stribeck_velocity=0.05, exponent=1.5, viscous=1.0),
    )
    tilted = M6(**slide, **curve, quadratic_external=0.01, quadratic_motor=0.02)
    added = {(7.0, -3.0): 0.01 * 9.0, (-3.0, 7.0): 0.02 * 9.0}.get(load, 0.0)
    lo, hi, _ = kernels.limits(tilted.KIND, Law(rate=tilted).row(), 0.0, load, 20.0)
    assert (lo, hi) == pytest.approx((-6.0 - added, 6.0 + added))


def test_special_cases_of_the_rate_laws_are_one_another():
    gauss = {"coulomb": 4.0, "breakaway": 6.0, "stribeck_velocity": 0.05, "viscous": 1.0}
    line = CoulombViscous(
        coulomb_positive=4.0, coulomb_negative=4.0, viscous_positive=1.0, viscous_negative=1.0
    )
    same(StribeckGauss(**gauss), StribeckTustin(**gauss, exponent=2.0))
    same(StribeckGauss(**gauss | {"breakaway": 4.0}), line)
    same(StribeckLorentz(**gauss | {"breakaway": 4.0}), line)
    same(Degressive(coulomb=4.0, growth=1.0, exponent=1.0), line)
    same(Polyline(velocity=(0.5, 2.0), positive=(4.5, 6.0), negative=(4.5, 6.0)), line)
    hot = LoadTemperature(coulomb=4.0, stribeck=2.0, stribeck_velocity=0.05, viscous=1.0, exponent=2.0)
    same(GearLoad(coulomb=4.0, viscous=1.0, load=0.2, driving=0.1), line)
    same(StribeckGauss(**gauss), hot, load=(0.0, 0.0), temperature=55.0)
    at = Law(rate=StribeckLorentz(**gauss)).torque([0.0 + 1e-12, 0.05, 5e3])
    np.testing.assert_allclose(at, [6.0, 5.05, 5004.0], rtol=1e-9)


def test_load_and_temperature_enter_as_printed():
    value = {
        "coulomb": 3.0, "coulomb_load": 0.05, "stribeck_load": 0.1, "stribeck_velocity_load": 0.1, "stribeck": 1.0,
        "stribeck_temperature": 0.05, "stribeck_velocity": 0.02, "stribeck_velocity_temperature": 0.001, "viscous": 0.5,
        "viscous_temperature": 3.0, "thinning": 20.0, "exponent": 1.3,
    }  # fmt: skip
    load, T, v = 6.0, 35.0, 0.03
    expected = (
        3.0 + 0.05 * load + 0.1 * load * np.exp(-((v / 0.1) ** 1.3))
        + (1.0 + 0.05 * T) * np.exp(-((v / (0.02 + 0.001 * T)) ** 1.3)) + (0.5 + 3.0 * np.exp(-T / 20.0)) * v
    )  # fmt: skip
    law = Law(rate=LoadTemperature(**value))
    assert follow(law, [v * 1e-3], 1e-3, load=(8.0, -4.0), temperature=T)[0] == pytest.approx(expected)


def test_published_curves():
    """Franka Emika Panda, joint 3 (Gaz et al. 2019): plateaus 0.3938 and 0.2469 N.m; Makkar's peak is below g_1 + g_4."""
    panda = Law(rate=Sigmoid(span=0.64068, steepness=10.136, shift=-0.04607))
    np.testing.assert_allclose(panda.torque([100.0, -100.0]), [0.3938, -0.2469], atol=5e-5)
    v = np.linspace(0.0, 0.2, 20001)
    curve = Law(
        rate=Makkar(stribeck=0.25, rise=100.0, fall=10.0, coulomb=0.1, steepness=100.0, viscous=0.01)
    ).torque(v)
    assert curve.max() == pytest.approx(0.2883, abs=5e-5)
    assert v[curve.argmax()] == pytest.approx(0.0202, abs=1e-4)


def test_a_polyline_whose_first_section_starts_below_zero_is_continuous_at_rest_and_never_drives():
    steep = Law(rate=Polyline(velocity=(0.1, 0.2), positive=(1.0, 3.0), negative=(1.0, 1.5)))
    assert steep.coulomb() == (0.0, 0.5)
    np.testing.assert_allclose(
        steep.torque([1e-9, 0.05, 0.1, 0.2, -0.05]), [1e-8, 0.5, 1.0, 3.0, -0.75], atol=1e-12
    )


@pytest.mark.parametrize("external", [-8.0, 8.0])
def test_gear_load_holds_more_where_the_load_is_lifted_or_lowered(external):
    """Break-away F_c + (K + S)|T|, S by the direction of power; far above v_s both directions slide alike."""
    law = Law(rate=GearLoad(coulomb=1.0, load=0.2, driving=0.1, driven=0.3, stribeck_velocity=0.05))
    lo, hi, _ = kernels.limits(law.rate.KIND, law.row(), 0.0, (0.0, external), 20.0)
    driving, driven = 1.0 + 0.3 * 8.0, 1.0 + 0.5 * 8.0
    assert (lo, hi) == pytest.approx((-driven, driving) if external < 0.0 else (-driving, driven))
    sliding = [follow(law, [v], 1e-3, load=(0.0, external))[0] for v in (1.0, -1.0)]
    np.testing.assert_allclose(sliding, [2.6, -2.6])


@pytest.mark.parametrize(
    "rate", [rate for rate in RATES.values() if rate.RESISTS], ids=lambda rate: rate.NAME
)
def test_the_viscous_part_of_a_law_that_resists_never_drives(rate):
    """For parameters anywhere within their bounds, under any load: then kernels need not look."""
    random = np.random.default_rng(11)
    for _ in range(20):
        values = {}
        for name, parameter in rate.PARAMETERS.items():
            low, high = max(parameter.lower, -10.0), min(parameter.upper, 10.0)
            values[name] = float(random.choice([low, random.uniform(low, high)]))
        row = Law(rate=rate(**values)).row()
        for v in VELOCITIES:
            load, temperature = tuple(random.uniform(-9.0, 9.0, 2)), random.uniform(-20.0, 90.0)
            assert not kernels.limits(rate.KIND, row, v, load, temperature)[2] * v < 0.0
