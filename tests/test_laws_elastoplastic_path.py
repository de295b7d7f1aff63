"""The elastoplastic bristle along a path, against an integration in small steps and against what has a closed form."""

import numpy as np
import pytest

from backdrive.laws.elements.elastoplastic_path import elastoplastic_level

WIDTH = 0.01


def integrated(path, elastic, parts=400):
    """z/z_s of Dupont's equation by the midpoint rule, so many parts a step."""
    z, level = 0.0, [0.0]
    for step in np.diff(path) / WIDTH:
        for _ in range(parts):
            middle = z
            for _ in range(2):
                middle = z + 0.5 * slope(middle, np.sign(step), elastic) * step / parts
            z += slope(middle, np.sign(step), elastic) * step / parts
        level.append(z)
    return np.array(level)


def slope(z, way, elastic):
    if z * way <= elastic:
        return 1.0
    w = min((abs(z) - elastic) / (1.0 - elastic), 1.0)
    return 1.0 - (0.5 + 0.5 * np.sin(np.pi * (w - 0.5))) * abs(z)


@pytest.mark.parametrize("elastic", [0.0, 0.3, 0.7, 0.95])
def test_a_path_with_reversals_bends_it_as_small_steps_do(elastic):
    path = WIDTH * np.array(
        [0.0, 0.4, 0.9, 1.7, 1.65, 2.6, 2.2, 0.3, 0.3, -0.2, -3.0, -3.01, -4.0, -3.4, -5.0]
    )
    assert elastoplastic_level(path, WIDTH, elastic) == pytest.approx(integrated(path, elastic), abs=3e-4)


@pytest.mark.parametrize("elastic", [0.0, 0.7, 0.95])
def test_only_the_way_counts_and_not_how_it_is_sampled(elastic):
    path = 3.0 * WIDTH * np.sin(np.linspace(0.0, 9.0, 4001))
    turns = [0, *np.flatnonzero(np.diff(np.sign(np.diff(path)))) + 1, len(path) - 1]
    fine = elastoplastic_level(path, WIDTH, elastic)
    assert elastoplastic_level(path[turns], WIDTH, elastic) == pytest.approx(fine[turns], abs=2e-4)


def test_below_its_share_it_is_a_spring_and_far_away_it_slides():
    path = WIDTH * np.array([0.0, 0.5, -0.6, 0.1, 0.69, 100.0, 99.0, 98.5, -100.0])
    level = elastoplastic_level(path, WIDTH, 0.7)
    assert level[:5] == pytest.approx(path[:5] / WIDTH, rel=1e-12)
    assert level[[5, 8]].tolist() == [1.0, -1.0]
    assert level[6:8] == pytest.approx([0.0, -0.5], abs=1e-12)
