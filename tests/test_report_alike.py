"""Tests for alike.py and entries.py: equal directions are one number with the larger error."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from _example_identification import curve_of, example
from backdrive.laws import CoulombViscous, Law, Polyline
from backdrive.report import render
from backdrive.report.alike import both_ways, is_alike
from backdrive.report.entries import bounds, entries
from backdrive.report.pictures.directions import alike
from backdrive.report.terminal import joint_tables

pytest.importorskip("matplotlib")
KNOTS, CURVE = (0.1, 0.5, 1.9), (4.0, 4.5, 5.5)


def with_law(law, errors):
    one = example(("elbow",), samples=600)
    curve = curve_of(law, 2.0, 0.04)
    curve = replace(curve, standard_error=np.where(curve.velocity > 0, 0.03, 0.04))
    friction = replace(one.model.joints[0], law=law, standard_errors=errors, at_bound=())
    model = replace(one.model, joints=(friction,))
    return replace(one, model=model, evidence=(replace(one.evidence[0], curve=curve),))


def test_equal_directions_are_one_number_with_the_larger_error():
    law = Law(rate=Polyline(velocity=KNOTS, positive=CURVE, negative=CURVE))
    result = with_law(law, {"positive": (0.01, 0.05, 0.02), "negative": (0.03, 0.02, 0.02)})
    text = render(result, command="x")
    assert "3 knots, both directions alike" in text
    assert "line sections, both directions alike" in text
    assert "its two directions coincide" in text
    assert [e.values for e in entries(result.model.joints[0], knots=True)][1] == [
        "4.000 ± 0.030", "4.500 ± 0.050", "5.500 ± 0.020",
    ]  # fmt: skip
    table = text.partition('<table class="summary">')[2].partition("</table>")[0]
    assert table.count("±") == 2
    assert table.count("both directions alike") == 2
    assert "± 0.040" in table
    assert "+5" not in table
    assert len(list(joint_tables(result.model.joints[0]))) > 3


def test_unequal_directions_stay_two_numbers():
    text = render(example(("elbow",), samples=600), command="x")
    assert "alike" not in text
    assert "knots a direction" in text


def test_one_parameter_of_two_may_be_alike():
    rate = CoulombViscous(
        coulomb_positive=3.0, coulomb_negative=3.0, viscous_positive=1.0, viscous_negative=2.0
    )
    names = list(rate.PARAMETERS)
    result = with_law(Law(rate=rate), dict(zip(names, (0.1, 0.2, 0.3, 0.4), strict=True)))
    found = entries(result.model.joints[0], knots=False)
    assert found[0].name == "Coulomb friction, both directions alike"
    assert found[0].values == ["3.00 ± 0.20"]
    assert [e.both for e in found] == [True, False, False]
    assert not is_alike(rate)
    assert "<i>F</i><sub>p</sub> = <i>F</i><sub>n</sub>" in render(result, command="x")


def test_an_unknown_error_stays_unknown():
    assert both_ways([(2.0, 0.1), (-2.0, 0.3)]) == [(2.0, 0.3)]
    assert math.isnan(both_ways([(2.0, math.nan), (-2.0, 0.3)])[0][1])
    assert both_ways([(2.0, 0.1), (-2.1, 0.3)]) == [(2.0, 0.1), (-2.1, 0.3)]
    assert both_ways([(2.0, 0.1)]) == [(2.0, 0.1)]


def test_curves_that_reach_differently_far_are_two_lines():
    curve = curve_of(Law(rate=Polyline(velocity=KNOTS, positive=CURVE, negative=CURVE)), 2.0, 0.04)
    assert alike(curve)
    far = curve.velocity < 1.0
    assert not alike(
        replace(
            curve,
            velocity=curve.velocity[far],
            torque=curve.torque[far],
            standard_error=curve.standard_error[far],
        )
    )


def test_bounds_that_bind_nothing_are_left_out():
    assert bounds(1e-9, 1e6) == "> 0"
    assert bounds(-1e6, 1e6) == "free"
    assert bounds(0.0, 1e6) == "≥ 0"
    assert bounds(1e-9, 1e6, whole=True) == "1.00e−9 … 1.00e+06".replace("−9", "−09")
    assert bounds(0.02, 0.5) == "0.0200 … 0.500"
