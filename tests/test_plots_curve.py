"""Curves, residual pictures and terminal plots: what is computed for them, and that the files are what they claim."""

from __future__ import annotations

import math
from xml.etree import ElementTree

import numpy as np
import pytest

from _example_identification import HOSTILE, example, truths
from backdrive.errors import InvalidInput
from backdrive.laws import CoulombViscous, Law
from backdrive.report.pictures import residuals, sizes
from backdrive.report.pictures.curve import save_curves
from backdrive.report.pictures.directions import medians
from backdrive.report.pictures.model_curve import knots_of, largest_error, model_curve
from backdrive.report.pictures.terminal import plot_lines


@pytest.fixture(scope="module")
def result():
    return example(samples=600)


def test_largest_error_of_line_sections_is_interpolated(result):
    friction = result.model.joints[0]
    rate, errors = friction.law.rate, friction.standard_errors
    speed = np.linspace(rate.velocity[0], rate.velocity[-1], 40)
    expected = np.interp(speed, rate.velocity, errors["positive"])
    assert largest_error(friction, speed) == pytest.approx(expected, rel=1e-5)
    assert largest_error(friction, -speed) == pytest.approx(expected, rel=1e-5)


def test_largest_error_of_a_straight_line_adds_up_even_at_a_bound(result):
    friction = result.model.joints[4]
    v = np.array([-1.5, -0.1, 0.1, 1.5])
    error = friction.standard_errors["coulomb_positive"]
    assert largest_error(friction, v) == pytest.approx(error * (1.0 + np.abs(v)), rel=1e-5)
    assert np.isnan(largest_error(result.model.joints[2], v)).all()


def test_model_curve_covers_what_was_seen_and_not_rest(result):
    curve = model_curve(result.model.joints[0])
    low, high = result.model.joints[0].validity.velocity
    assert low <= curve.velocity.min() < 0 < curve.velocity.max() <= high
    assert np.all(np.diff(curve.velocity) > 0)
    assert curve.torque == pytest.approx(result.model.torque("joint_1", curve.velocity))


def test_knots(result):
    points = knots_of(result.model.joints[0])
    rate = result.model.joints[0].law.rate
    assert points.shape == (20, 2)
    assert points[-1] == pytest.approx((rate.velocity[-1], rate.positive[-1]))
    assert points[0] == pytest.approx((-rate.velocity[-1], -rate.negative[-1]))
    assert knots_of(result.model.joints[4]).shape == (0, 2)


def test_thinning_keeps_the_ends_and_the_worst():
    size = np.zeros(10_001)
    size[5003] = -9.0
    size[77] = np.nan
    kept = sizes.thin(size.size, 1500, keep=size)
    assert kept.size <= 1500
    assert {0, 5003, 10_000} <= set(kept)
    assert np.all(np.diff(kept) > 0)
    assert sizes.thin(7).tolist() == list(range(7))


@pytest.mark.parametrize(
    ("magnitude", "unit", "expected"),
    [
        (4e-4, "rad", "mrad"),
        (4e-6, "m", "µm"),
        (3.0, "N·m", "N·m"),
        (2e4, "N", "kN"),
        (0.0, "N", "N"),
        (math.nan, "m", "m"),
    ],
)
def test_scaled(magnitude, unit, expected):
    factor, scaled = sizes.readable(magnitude, unit)
    assert scaled == expected
    assert factor == {"m": 1e3, "µ": 1e6, "k": 1e-3}.get(expected.removesuffix(unit), 1.0)


def test_clock_keeps_blocks_of_one_log_and_lays_several_end_to_end():
    one = np.arange(10.0)
    blocks = np.concatenate([one[5:], one[:5]])
    laid, several = residuals.clock(blocks + 100.0)
    assert not several
    assert laid.tolist() == blocks.tolist()
    laid, several = residuals.clock(np.concatenate([one, one[:4] + 2.0]))
    assert several
    assert laid.tolist() == [*range(10), 9, 10, 11, 12]
    assert residuals.clock(np.empty(0))[0].size == 0


def test_medians_by_intervals_and_by_groups():
    rng = np.random.default_rng(1)
    x = rng.uniform(-2, 2, 20_000)
    centre, middle = residuals.middle(x, np.sin(x) + 0.1 * rng.standard_normal(x.size))
    assert centre.size == 24
    assert middle == pytest.approx(np.sin(centre), abs=0.02)
    assert residuals.middle(x[:10], x[:10])[0].size == 0
    speed, friction = medians(np.abs(x), 2.0 * np.abs(x))
    assert speed.size == 30
    assert friction == pytest.approx(2.0 * speed)
    assert medians(x[:20], x[:20])[0].tolist() == x[:20].tolist()


def test_scale_leaves_out_only_the_far_off():
    samples = example(("a",), samples=1000).evidence[0].samples
    size = np.abs(samples.residual)
    scale = residuals.common_scale(samples)
    assert scale.beyond == 0
    assert scale.limit > size.max() == scale.worst
    predicted = samples.predicted.copy()
    predicted[400] += 100.0 * size.max()
    wild = residuals.common_scale(type(samples)(**(vars(samples) | {"predicted": predicted})))
    assert wild.beyond == 1
    assert wild.limit < 3.0 * size.max() < wild.worst


def test_pictures_are_files_of_their_kind(result, tmp_path):
    drawn = save_curves(
        tmp_path / "one.png", result.model, evidence=result.evidence, truth=truths(result)
    ).read_bytes()
    assert drawn.startswith(b"\x89PNG")
    dark = save_curves(tmp_path / "dark.png", result.model, dark=True).read_bytes()
    assert dark != drawn
    hostile = example(HOSTILE, samples=300)
    root = ElementTree.parse(save_curves(tmp_path / "six.SVG", hostile.model)).getroot()
    words = "".join(root.itertext())
    assert "<script>alert(1)</script>" in words  # as text
    assert not [e for e in root.iter() if str(e.tag).endswith(("script", "img"))]
    assert words.count("friction [N·m]") == 5
    again = save_curves(tmp_path / "again.svg", hostile.model).read_bytes()
    assert again == (tmp_path / "six.SVG").read_bytes()
    with pytest.raises(InvalidInput, match=r"png or \.svg"):
        save_curves(tmp_path / "six.pdf", hostile.model)


def test_dots_are_visible_in_a_png(result, tmp_path):
    from matplotlib.image import imread

    bare = imread(save_curves(tmp_path / "a.png", result.model))
    full = imread(save_curves(tmp_path / "b.png", result.model, evidence=result.evidence))

    def blue(image):
        return np.count_nonzero(image[..., 2] - image[..., 0] > 0.2)

    assert blue(bare) == 0
    assert blue(full) > 300


def test_terminal_plot_of_a_diagonal():
    x = np.linspace(-1.0, 1.0, 5)
    lines = plot_lines([(x, x)], x_unit="rad/s", y_unit="N.m", width=9, height=9, braille=False)
    assert lines[0].strip() == "N.m"
    drawn = [line[4:].ljust(9) for line in lines[1:-1]]
    assert [line.index("*") for line in drawn] == list(range(8, -1, -1))
    assert drawn[4] == "----*----"
    assert lines[1].startswith("  1")
    assert lines[-1].split() == ["-1", "0", "1", "rad/s"]
    braille = plot_lines([(x, x)], x_unit="rad/s", y_unit="N.m", width=9, height=9)
    dotted = [line[4:] for line in braille[1:-1]]
    assert all("\u2800" < line[8 - i] < "\u28ff" for i, line in enumerate(dotted))
    assert not any(
        c > "\u2800" for i, line in enumerate(dotted) for j, c in enumerate(line) if abs(8 - i - j) > 1
    )
    assert plot_lines([(np.full(3, np.nan), x[:3])], x_unit="", y_unit="") == []


def test_terminal_plot_of_a_flat_curve():
    lines = plot_lines(
        [(np.array([0.1, 1.0]), np.array([2.0, 2.0]))], x_unit="rad/s", y_unit="N.m", width=20, height=5
    )
    assert lines[1].startswith("  2 │ ")
    assert "\u2809" in lines[1]


def test_a_law_without_known_errors_has_no_band(result):
    friction = result.model.joints[4]
    bare = type(friction)(
        joint=friction.joint,
        law=Law(rate=CoulombViscous(coulomb_positive=1, coulomb_negative=1)),
        validity=friction.validity,
    )
    assert np.isnan(model_curve(bare).standard_error).all()
