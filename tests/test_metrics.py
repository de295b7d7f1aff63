import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from backdrive.errors import InvalidInput
from backdrive.identification.metrics import curve_distance, relative_curve_distance
from backdrive.identification.quality import judge
from backdrive.laws import CoulombViscous, Law, Polyline


def line(coulomb, viscous, negative=0.0):
    return Law(
        rate=CoulombViscous(
            coulomb_positive=coulomb,
            coulomb_negative=coulomb + negative,
            viscous_positive=viscous,
            viscous_negative=viscous,
        )
    )


def test_the_distance_of_two_lines_has_a_closed_form():
    # difference 1 + 2 v on [0, 2]: mean square = (1/2) int (1 + 2 v)^2 dv = (5^3 - 1) / 12
    expected = np.sqrt((5.0**3 - 1.0) / 12.0)
    assert curve_distance(line(3.0, 5.0), line(2.0, 3.0), 2.0) == pytest.approx(expected, rel=1e-14)
    size = np.sqrt((8.0**3 - 2.0**3) / 18.0)  # of 2 + 3 v
    relative = relative_curve_distance(line(3.0, 5.0), line(2.0, 3.0), 2.0)
    assert relative == pytest.approx(expected / size, rel=1e-14)


def test_the_direction_matters():
    first, second = line(3.0, 1.0, negative=2.0), line(3.0, 1.0)
    assert curve_distance(first, second, 1.0) == 0.0
    assert curve_distance(first, second, 1.0, direction=-1) == pytest.approx(2.0)


curves = st.lists(st.floats(-5, 20), min_size=4, max_size=4).map(
    lambda f: Law(rate=Polyline(velocity=(0.2, 0.5, 1.1, 1.9), positive=tuple(f), negative=tuple(f)))
)


@settings(max_examples=40, deadline=None)
@given(first=curves, second=curves, top=st.floats(0.05, 3.0))
def test_line_sections_are_integrated_exactly(first, second, top):
    v = np.unique(np.concatenate([np.linspace(0, top, 20001), [k for k in (0.2, 0.5, 1.1, 1.9) if k < top]]))
    middle = 0.5 * (v[1:] + v[:-1])
    difference = (first.torque(middle) - second.torque(middle)) ** 2
    expected = np.sqrt(np.sum(difference * np.diff(v)) / top)
    assert curve_distance(first, second, top) == pytest.approx(expected, rel=1e-5, abs=1e-9)
    assert curve_distance(first, second, top) == curve_distance(second, first, top)


def test_the_residual_is_relative_and_blind_to_fast_noise():
    t = np.arange(20000) / 1000.0
    tau = 10.0 * np.sin(2 * np.pi * 0.5 * t)
    everywhere = np.ones(t.size, dtype=bool)
    quality = judge([(tau, 0.9 * tau, 1000.0, everywhere)])
    assert (quality.residual, quality.residual_raw) == pytest.approx((10.0, 10.0), rel=1e-6)
    halves = judge(
        [
            (tau[:10000], 0.9 * tau[:10000], 1000.0, everywhere[:10000]),
            (tau[10000:], tau[10000:], 1000.0, everywhere[10000:]),
        ]
    )
    assert halves.residual_raw == pytest.approx(10.0 / np.sqrt(2.0), rel=1e-6)
    fast = tau + np.sin(2 * np.pi * 60.0 * t)
    quality = judge([(fast, tau, 1000.0, everywhere)])
    assert quality.residual < 0.5  # what is left comes from the ends
    assert quality.residual_raw == pytest.approx(100.0 / np.sqrt(101.0), rel=1e-3)
    assert np.isnan(judge([(np.zeros(100), np.zeros(100), 1000.0, np.ones(100, bool))]).residual_raw)


def test_bad_arguments_are_refused():
    with pytest.raises(InvalidInput, match="top_speed"):
        curve_distance(line(1, 1), line(1, 1), 0.0)
    with pytest.raises(InvalidInput, match="direction"):
        curve_distance(line(1, 1), line(1, 1), 1.0, direction=2)
