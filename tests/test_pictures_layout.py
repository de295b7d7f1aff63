"""Every picture is asked for the boxes of its own texts: none overlaps another, none is cut."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from _example_identification import example
from backdrive.plans import Sweep
from backdrive.report import render
from backdrive.report.pictures import canvas
from backdrive.report.pictures.curve import curves

pytest.importorskip("matplotlib")
sys.path.append(str(Path(__file__).parents[1] / "benchmarks" / "evidence"))

from _picture_boxes import faults_of, figures_made


def test_pictures_of_the_report():
    result = example(samples=600)
    with figures_made() as made:
        render(result, command="x")
    assert len(made) >= 5 * len(result.model.joints)
    with canvas.house_style():
        assert [fault for figure in made for fault in faults_of(figure)] == []


def test_curves_of_all_joints_in_both_themes():
    result = example(samples=600)
    for dark in (False, True):
        figure = curves(result.model, evidence=result.evidence, dark=dark)
        with canvas.house_style():
            assert faults_of(figure) == []


def test_a_plan():
    from backdrive.report.pictures.plan import picture

    with figures_made() as made:
        picture(Sweep(0.35, 2.0, cycles=6), "svg")
    with canvas.house_style():
        assert [fault for figure in made for fault in faults_of(figure)] == []


@pytest.mark.parametrize("name", ["stribeck-gauss+lugre", "m5", "polyline"])
def test_signatures_of_laws(name):
    from backdrive.laws.examples import example as law_of
    from backdrive.report.pictures.signatures import draw

    figure = draw(law_of(name))
    with canvas.house_style():
        assert faults_of(figure) == []


def test_what_overlaps_or_is_cut_is_named():
    with canvas.house_style():
        figure = canvas.new_figure(canvas.LIGHT)
        figure.text(0.5, 0.5, "one")
        figure.text(0.51, 0.5, "another")
        figure.text(0.97, 0.1, "beyond the edge")
        faults = faults_of(figure)
    assert len(faults) == 2
    assert "overlap" in faults[0]
    assert "cut" in faults[1]
    assert np.all([isinstance(fault, str) for fault in faults])
