"""Tests for laws/: what every rate law promises, and the set-valued element."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from backdrive.errors import InvalidInput, UnknownName
from backdrive.laws import ELEMENTS, RATES, CoulombViscous, Law, Polyline, element, kernels, rate_law
from backdrive.laws.examples import ELEMENT_EXAMPLES, RATE_EXAMPLES

EXAMPLES = RATE_EXAMPLES
LOAD = (0.0, 0.0)


def test_every_rate_law_has_an_example():
    assert set(RATE_EXAMPLES) == set(RATES)
    assert set(ELEMENT_EXAMPLES) == set(ELEMENTS)


@pytest.mark.parametrize("name", RATES)
class TestEveryRateLaw:
    def test_friction_opposes_motion(self, name):
        v = np.linspace(-5, 5, 101)
        assert np.all(Law(rate=EXAMPLES[name]).torque(v) * v >= 0)

    def test_limits_add_up_to_the_steady_torque(self, name):
        law = Law(rate=EXAMPLES[name])
        for v in (-3.0, -0.1, 0.1, 3.0):
            lo, hi, viscous = kernels.limits(law.rate.KIND, law.row(), v, LOAD, 20.0)
            assert float(law.torque(v)) == (hi if v > 0 else lo) + viscous

    def test_the_viscous_part_vanishes_at_rest(self, name):
        lo, hi, viscous = kernels.limits(EXAMPLES[name].KIND, Law(rate=EXAMPLES[name]).row(), 0.0, LOAD, 20.0)
        assert viscous == 0.0
        assert lo <= 0.0 <= hi

    def test_nan_stays_nan(self, name):
        law = Law(rate=EXAMPLES[name])
        assert np.isnan(law.torque(np.nan))
        assert np.isnan(kernels.solve(law.rate.KIND, 0, law.row(), np.zeros(2), np.nan, 0.1, 0.1, LOAD, 20.0))

    def test_values_and_parameters_have_the_same_names(self, name):
        assert list(EXAMPLES[name].values()) and set(EXAMPLES[name].values()) == set(RATES[name].PARAMETERS)

    @settings(max_examples=200, deadline=None)
    @given(v_free=st.floats(-50, 50), dt_over_m=st.floats(1e-6, 1.0))
    def test_solve_satisfies_its_inclusion(self, name, v_free, dt_over_m):
        law = Law(rate=EXAMPLES[name])
        v = kernels.solve(law.rate.KIND, 0, law.row(), np.zeros(2), v_free, dt_over_m, dt_over_m, LOAD, 20.0)
        lo, hi, viscous = kernels.limits(law.rate.KIND, law.row(), v, LOAD, 20.0)
        needed = (v_free - v) / dt_over_m - viscous  # what the set-valued part must supply
        slack = 1e-13 * (abs(v_free) / dt_over_m + 100.0)
        if v > 0:
            assert abs(needed - hi) <= slack
        elif v < 0:
            assert abs(needed - lo) <= slack
        else:
            assert lo - slack <= needed <= hi + slack


def test_polyline_is_the_thesis_function_written_out():
    """(2.8)-(2.9) with |v| in (2.9g), by hand."""
    V, F = [0.5, 1.0, 2.0], [3.0, 4.0, 4.5]
    law = Law(rate=Polyline(velocity=V, positive=F, negative=F))
    B = [(F[1] - F[0]) / (V[1] - V[0]), (F[2] - F[1]) / (V[2] - V[1])]
    expected = {
        0.25: F[0] - B[0] * 0.25,
        0.75: F[0] + B[0] * 0.25,
        1.5: F[1] + B[1] * 0.5,
        3.0: F[2] + B[1] * 1.0,
    }
    for v, torque in expected.items():
        assert float(law.torque(v)) == pytest.approx(torque, abs=1e-14)
        assert float(law.torque(-v)) == pytest.approx(-torque, abs=1e-14)


@pytest.mark.parametrize("name", RATES)
def test_the_direction_dependent_form_is_intercepts_and_a_continuous_rest(name):
    """(3.1): f in gsgn(-F_n, v, F_p) + Phi(v), Phi(0) = 0."""
    law = Law(rate=EXAMPLES[name])
    forwards, backwards = law.coulomb()
    assert float(law.torque(1e-15)) == pytest.approx(forwards, abs=1e-7)
    assert float(law.torque(-1e-15)) == pytest.approx(-backwards, abs=1e-7)
    assert float(law.phi(0.0)) == 0.0
    np.testing.assert_allclose(law.phi([1e-15, -1e-15]), 0.0, atol=1e-7)
    np.testing.assert_allclose(law.torque([1.0, -1.0]), law.phi([1.0, -1.0]) + [forwards, -backwards])


def test_a_mass_below_break_away_stays_exactly_at_rest():
    law = Law(rate=EXAMPLES["coulomb-viscous"])
    assert kernels.solve(0, 0, law.row(), np.zeros(2), 4.999e-3, 1e-3, 1e-3, LOAD, 20.0) == 0.0
    assert kernels.solve(0, 0, law.row(), np.zeros(2), 5.001e-3, 1e-3, 1e-3, LOAD, 20.0) > 0.0


@pytest.mark.parametrize(
    ("bad", "named"),
    [
        ({"coulomb_positive": -1.0, "coulomb_negative": 1.0}, "coulomb_positive"),
        ({"coulomb_positive": 1.0, "coulomb_negative": float("nan")}, "coulomb_negative"),
        ({"coulomb_positive": [1.0, 2.0], "coulomb_negative": 1.0}, "coulomb_positive"),
    ],
)
def test_a_value_outside_its_bounds_is_named(bad, named):
    with pytest.raises(InvalidInput, match=named):
        CoulombViscous(**bad)


def test_polyline_refuses_unsorted_and_uneven_knots():
    with pytest.raises(InvalidInput, match="strictly increase"):
        Polyline(velocity=(1.0, 0.5), positive=(1.0, 1.0), negative=(1.0, 1.0))
    with pytest.raises(InvalidInput, match="same number"):
        Polyline(velocity=(1.0, 2.0), positive=(1.0,), negative=(1.0, 1.0))


def test_unknown_names_are_answered_with_the_known_ones():
    with pytest.raises(UnknownName, match="polyline"):
        rate_law("polylin")
    with pytest.raises(UnknownName, match="none"):
        element("lugrey")
