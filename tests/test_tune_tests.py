"""Tests of numbers end with the first failure, and parts of a score share the scenes they are read from."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from backdrive.tuning import goals, safety
from backdrive.tuning.goals import Goal
from backdrive.tuning.search import best_safe
from backdrive.tuning.wishes import Part


@pytest.fixture
def played(monkeypatch):
    """Scenes are numbers here; returns the list of those that are simulated."""
    every = []

    def evaluate(made, value):
        scenes = list(made)
        every.extend(scenes)
        return [value(scene) for scene in scenes]

    monkeypatch.setattr(goals, "evaluate", evaluate)
    monkeypatch.setattr(safety, "evaluate", evaluate)
    monkeypatch.setattr(safety, "energy", lambda record: -record)
    return every


def goal(**changes: Any) -> Goal:
    about: Any = SimpleNamespace(delay=0.0, interval=1e-3)
    made: dict[str, Any] = {
        "name": "track",
        "facts": about,
        "stroke": None,
        "ranges": {"share": (0.0, 1.0)},
        "parts": (),
        "score_on": [1.0, 2.0],
        "trial": lambda z, member, longest: z["share"] * member,
        "unrest": float,
        "test_on": [0.1, 0.2, 0.3, 0.4, 2.0, 0.5, 0.6, 0.7, 0.8],
        "words": "",
        "unit": "-",
        "calming": (),
    }
    return Goal(**made | changes)


def test_a_joint_that_does_not_rest_ends_the_test(played):
    one = goal()
    assert not one.rests({"share": 1.0})
    assert len(played) == 2 * goals.AT_ONCE  # the fifth fails
    assert one.rests({"share": 0.4}) and one.worst([{"share": 0.4}])[0] == pytest.approx(0.8)
    assert not one.rests({"share": np.nan})


def test_the_whole_test_ends_with_its_first_failure(played):
    trials = [
        *((0.1 + 1e-3 * i, 1.0) for i in range(20)),
        (0.6, 2.0),
        *((0.2 + 1e-3 * i, 1.0) for i in range(100)),
    ]
    assert not safety.rests(goal(), {"share": 1.0}, trials)
    assert len(played) == 2 * safety.AT_ONCE
    assert safety.rests(goal(), {"share": 0.5}, trials)
    assert safety.restless(goal(), {"share": 1.0}, trials) == [(0.6, 2.0)]


def test_a_trial_is_played_once(played):
    one, z = goal(), {"share": 0.5}
    trials = [(0.2, 1.0), (0.4, 1.0), (0.2, 1.0), (0.2, 2.0)]
    first = safety.play_trials(one, z, trials)
    assert first.tolist() == [[0.1, -0.1], [0.2, -0.2], [0.1, -0.1], [0.2, -0.2]] and len(played) == 3
    assert safety.play_trials(one, z, trials[::-1]).tolist() == first[::-1].tolist() and len(played) == 3
    safety.play_trials(one, z, trials[:1], longest=1e-4)  # another step, other numbers, another goal
    safety.play_trials(one, {"share": 0.6}, trials[:1])
    safety.play_trials(replace(one, unrest=lambda record: 2.0 * record), z, trials[:1])
    assert len(played) == 6
    assert safety.play_trials(one, z, []).shape == (0, 2)


def test_the_best_of_those_that_rest_is_found_by_few_tests(played):
    many, scores = [{"share": s} for s in (1.0, 0.4, 0.9, 0.3)], np.array([0.1, 0.5, 0.2, 0.4])
    assert best_safe(goal(), many, scores) == (3, 3)
    assert best_safe(goal(), many, scores, below=0.3) == (-1, 2)


def test_parts_of_one_scene_share_its_simulation(played):
    def scene(z, member):
        return z["share"] + 10.0 * member

    def another(z, member):
        return -z["share"]

    parts = [
        Part(name="a", scene=scene, value=lambda r: r, weight=2.0),
        Part(name="b", scene=another, value=lambda r: r, weight=3.0),
        Part(name="c", scene=scene, value=lambda r: 100.0 * r, unit=lambda: 4.0),
        Part(name="d", scene=scene, value=lambda r: np.nan, weight=0.0),
    ]
    one, many = goal(parts=parts), [{"share": 0.1}, {"share": 0.2}]
    wanted = [2.0 * (15.0 + s) - 3.0 * s + 25.0 * (15.0 + s) for s in (0.1, 0.2)]
    assert one.scores(many) == pytest.approx(wanted)
    assert len(played) == 2 * 2 * 2  # two scenes for two sets of numbers on two joints
    found = one.part_scores(many)
    assert list(found) == ["a", "b", "c", "d"] and found["c"] == pytest.approx([25.0 * 15.1, 25.0 * 15.2])
    assert np.all(found["d"] == np.inf)
