"""A known torque that is a constant, or gravity of the joint's own angle, beside an offset and gravity that are fitted."""

import numpy as np
import pytest

from _synthetic import any_motion
from backdrive import identify
from backdrive.identification.model_torque import LEFT_OUT, is_gravity

PULL = 6.0  # gravity of the joint [N.m]


@pytest.fixture(scope="module")
def hung():
    log = any_motion(lambda v: 1.5 * np.sign(v) + 0.4 * v)
    return log.replace(torque=log.need("torque") + PULL * np.sin(log.position))


def found(log, torque, **options):
    result = identify(log.replace(model_torque=torque), method="motion", **options)
    return result.model.joints[0], result.evidence[0].verdict


@pytest.mark.parametrize("options", [{}, {"delay": 0.0}, {"gravity": True}])
def test_gravity_that_is_known_is_fitted_in_its_place(hung, options):
    options = {"known": options} if "delay" in options else options
    friction, said = found(hung, PULL * np.sin(hung.position), **options)
    assert "model_torque" not in friction.dynamics
    assert LEFT_OUT in said and not friction.warnings
    assert friction.law.torque(1.0) == pytest.approx(1.9, rel=0.02)
    pull = friction.dynamics["gravity_sin"]
    assert pull.value == pytest.approx(PULL, abs=4.0 * pull.standard_error) and pull.standard_error < 0.02


@pytest.mark.parametrize(
    ("factor", "words"), [(1.5, "0.667 where 1 is meant"), (-1.0, "Read it with a minus")]
)
def test_a_wrong_size_shows_in_the_gravity_that_is_fitted(hung, factor, words):
    friction, _ = found(hung, factor * PULL * np.sin(hung.position))
    assert friction.dynamics["gravity_sin"].value == pytest.approx(PULL, rel=0.01)
    assert friction.law.torque(1.0) == pytest.approx(1.9, rel=0.02)
    assert any(words in sentence for sentence in friction.warnings)


def test_a_known_torque_where_there_is_no_gravity(hung):
    bare = hung.replace(torque=hung.torque - PULL * np.sin(hung.position))
    friction, _ = found(bare, PULL * np.sin(hung.position))
    assert friction.law.torque(1.0) == pytest.approx(1.9, rel=0.02)
    assert any("where 1 is meant" in sentence for sentence in friction.warnings)


@pytest.mark.parametrize("late", [0.01, 0.03])
def test_torque_later_than_the_positions_that_the_known_torque_is_of(hung, late):
    torque = np.interp(hung.time - late, hung.time, hung.torque[:, 0])[:, None]
    late_log = hung.replace(torque=torque)
    known = PULL * np.sin(hung.position)
    friction, _ = found(late_log, known, known={"delay": late}, accept=["time-slip"])
    assert friction.law.torque(1.0) == pytest.approx(1.9, rel=0.01)
    assert friction.dynamics["gravity_sin"].value == pytest.approx(PULL, rel=0.01)


def test_a_small_torque_of_another_axis_beside_large_gravity_is_not_left_out(hung):
    known = 100.0 * np.sin(hung.position) + np.sin(5.0 * hung.time[:, None])
    friction, said = found(hung.replace(torque=hung.torque + known), -known)
    assert LEFT_OUT not in said
    assert friction.law.torque(1.0) == pytest.approx(1.9, rel=0.02)
    assert friction.dynamics["model_torque"].value == pytest.approx(-1.0, abs=0.05)


def test_a_constant_torque_is_not_divided_with_the_offset(hung):
    level = np.full_like(hung.position, 5.0)
    friction, said = found(hung.replace(torque=hung.torque + 5.0), level)
    assert "model_torque" not in friction.dynamics and LEFT_OUT in said
    assert friction.dynamics["gravity_sin"].value == pytest.approx(PULL, rel=0.01)
    assert friction.dynamics["offset"].value == pytest.approx(5.0, abs=0.05)


def test_a_channel_of_zeros_changes_nothing(hung):
    friction, said = found(hung, np.zeros_like(hung.position))
    alone = identify(hung, method="motion").model.joints[0]
    assert "model_torque" not in friction.dynamics and LEFT_OUT not in said
    assert friction.law == alone.law and friction.dynamics == alone.dynamics


def test_a_share_beside_another_axis_is_estimated(hung):
    other = 3.0 * np.sin(5.0 * hung.time[:, None])
    friction, said = found(hung.replace(torque=hung.torque + other), other)
    share = friction.dynamics["model_torque"]
    assert share.value == pytest.approx(1.0, abs=4.0 * share.standard_error) and share.standard_error < 0.05
    assert LEFT_OUT not in said


def test_what_a_known_torque_is_made_of():
    q = np.linspace(-1.0, 2.0, 500)
    torque, other = 0.5 + 3.0 * np.sin(q) - 2.0 * np.cos(q), np.sign(np.sin(40.0 * q))
    halves = [q[:200], q[200:]], [torque[:200], torque[200:]], [other[:200], other[200:]]
    assert is_gravity(*halves)
    assert not is_gravity(None, *halves[1:])
    assert is_gravity(None, [np.full(500, 2.0)], [other])
    assert not is_gravity([q], [torque + 0.5 * np.sin(4.0 * q)], [other])
    assert not is_gravity([q], [1e3 * torque + 0.5 * np.sin(4.0 * q)], [other])
    assert is_gravity([q], [0.0 * q], [other])
