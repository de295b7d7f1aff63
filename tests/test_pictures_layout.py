"""Every picture is asked for the boxes of its own texts: none overlaps another, none is cut."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from _example_identification import example
from backdrive.plans import ArmPlan, InTurn, Multisine, Sweep, TorqueRamp
from backdrive.plans.limits import JointLimits
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


def texts(figure):
    from matplotlib.text import Text

    return " | ".join(text.get_text() for text in figure.findobj(Text))


def arm():
    sine, cosine = ((0.3, 0.1), (0.0, 0.2)), ((0.1, 0.0), (0.2, -0.1))
    return ArmPlan(
        ("a", "b"), ("rad", "rad"), (0.2, -0.3), sine, cosine, 6.0, periods=3, slow_time=4.0, ramp=1.0
    )


@pytest.mark.parametrize(
    ("plan", "shaded"),
    [
        (Sweep(0.35, 2.0, cycles=6), "every other cycle"),
        (TorqueRamp(8.0, 2.0), "every other rise or fall"),
        (
            InTurn((Sweep(0.35, 2.0, cycles=6, joint="a"), Multisine(0.3, 0.1, 2.0, 10.0, joint="b"))),
            "every other cycle or period",
        ),
        (arm(), "at full pace, then slowly"),
    ],
)
def test_a_plan_names_its_axes_and_its_shaded_windows(plan, shaded):
    from backdrive.report.pictures.plan import plan_figure

    limits = {n: JointLimits(name=n, lower=-0.2, upper=0.2, velocity=2.5, effort=9.0) for n in ("a", "joint")}
    figure = plan_figure(plan, limits)
    with canvas.house_style():
        assert faults_of(figure) == []
    assert shaded in texts(figure)
    assert any(
        name in texts(figure) for name in ("position q [rad]", "torque τ [N·m]", "positions of 2 joints")
    )


@pytest.mark.parametrize(
    "plan",
    [
        Sweep(0.35, 2.0, cycles=10),
        Sweep(0.35, 2.0, cycles=30, slow=2),
        Sweep(0.35, 2.0, cycles=10, smooth=False),
        Multisine(0.3, 0.1, 5.0, 10.0),
        InTurn(tuple(Sweep(0.35, 2.0, cycles=10, joint=f"j{i}") for i in range(6))),
        arm(),
    ],
    ids=["sweep", "slow sweep", "printed sweep", "multisine", "six joints", "arm"],
)
def test_a_plan_in_a_notebook_is_small_and_keeps_its_peaks(plan):
    from backdrive.report.pictures.plan import plan_figure

    assert len(plan._repr_html_().encode()) < 120_000
    if isinstance(plan, InTurn | type(arm())):
        return
    t = np.linspace(plan.start, plan.start + plan.duration, 6000)
    for axes, panel in zip(plan_figure(plan).axes, ("position", "velocity", "acceleration"), strict=True):
        y, line = getattr(plan, panel)(t), axes.get_lines()[0]
        assert line.get_ydata().max() >= y.max() and line.get_ydata().min() <= y.min()
        # between its points the line departs by less than about a point of 568
        aside = plan.duration / 568 * np.linspace(-1.0, 1.0, 81)
        off = np.min([np.abs(np.interp(t + x, *line.get_data()) - y) for x in aside], axis=0)
        assert off.max() < 0.015 * np.ptp(y)


def test_the_samples_taken_begin_and_end_where_they_do():
    from backdrive.report.pictures.plan import _samples, plan_figure

    plan = Sweep(0.35, 2.0, cycles=6)
    line = next(x for x in plan_figure(plan).axes[1].get_lines() if x.get_label() == "samples taken")
    t = np.linspace(plan.start, plan.start + plan.duration, 60_000)
    taken = _samples(plan, t, plan.velocity(t))
    drawn = np.interp(t, line.get_xdata(), np.isfinite(line.get_ydata())) > 0.5
    assert np.mean(taken != drawn) < 0.002


def test_the_safe_region_names_its_symbols_in_words():
    from backdrive.report.pictures.tuning import safe_region

    region = {
        "springs": [0.2, 0.6, 1.0], "shares": [0.6, 0.8, 1.0], "by_share": np.ones((3, 3)),
        "decays": [2.0, 20.0, 200.0], "delays": [0.0, 1e-3, 2e-3], "by_delay": 20.0 * np.ones((3, 3)),
        "stiffness_interval": [0.8, 1.2], "largest_share": 0.9, "chosen": [0.7, 0.7, 5.6, 1e-3],
        "thesis": [1.0, 2.5, 20.0, 1e-3],
    }  # fmt: skip
    for theme in (canvas.LIGHT, canvas.DARK):
        with canvas.house_style():
            figure = safe_region(SimpleNamespace(region=region, joint="j1"), theme)
            assert faults_of(figure) == []
    for words in ("share of friction R", "stiffness K over that of the contact, K_c", "decay rate α [1/s]"):
        assert words in texts(figure)


def test_the_energy_of_a_compensator_stays_within_its_axes():
    sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))
    import passivity_figure

    figure = passivity_figure.draw()
    with canvas.house_style():
        assert faults_of(figure) == []
    for axes in figure.axes:
        low, high = axes.get_ylim()
        drawn = np.concatenate([line.get_ydata() for line in axes.get_lines()])
        assert low <= drawn.min() < drawn.max() <= high
    assert "largest torque of the compensator" in texts(figure)


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
