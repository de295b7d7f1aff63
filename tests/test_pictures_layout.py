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
    for theme in (canvas.LIGHT, canvas.DARK):
        figure = curves(result.model, evidence=result.evidence, theme=theme)
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


def test_abbreviations_signs_and_what_fails_stand_below_a_figure_of_the_thesis():
    from backdrive.thesis import _sweep_plots
    from backdrive.thesis._footer import footer, texts_of
    from backdrive.thesis.outcome import Claim, Outcome

    claims = (
        Claim(what="The peak is smallest with PD.", ours="", holds=False),
        Claim(what="It holds", ours="", holds=True),
    )
    with canvas.house_style():
        figure, axes = _sweep_plots.sheet(1, 2)
        for label in ("NC", "C", "PD", "HA: elastoplastic", "DOB: RMS 3 N"):
            axes[0, 0].plot([0.0, 1.0], [0.0, 1.0], label=label)
        axes[0, 1].annotate("**", (0.5, 0.5))
        _sweep_plots.key(axes[0, 0])
        height = figure.get_size_inches()[1]
        footer(figure, Outcome(name="x", title="x", setting="x", claims=claims))
        assert faults_of(figure) == []
        assert figure.get_size_inches()[1] > height
        below = " ".join(text.get_text() for text in figure.texts)
    assert "NC: no compensation" in below
    assert "PD: P with dither" in below
    assert "DOB: disturbance observer" in below
    assert "HA" not in below  # its label says it
    assert "CT" not in below
    assert "** p < 1 %" in below
    assert "Does not hold here: The peak is smallest with PD." in below
    assert "It holds" not in below
    assert texts_of(figure)
