"""A known torque that is a constant, or gravity of the joint's own angle, beside an offset and gravity that are fitted."""

import numpy as np
import pytest

from _synthetic import any_motion
from backdrive import identify
from backdrive.identification.model_torque import AS_ONE, as_gravity

PULL = 6.0  # gravity of the joint [N.m]


@pytest.fixture(scope="module")
def hung():
    log = any_motion(lambda v: 1.5 * np.sign(v) + 0.4 * v)
    return log.replace(torque=log.need("torque") + PULL * np.sin(log.position))


def found(log, torque, **options):
    result = identify(log.replace(model_torque=torque), method="motion", **options)
    return result.model.joints[0], result.evidence[0].verdict


@pytest.mark.parametrize("options", [{}, {"known": {"delay": 0.0}}, {"gravity": True}])
def test_gravity_that_is_known_is_left_out_of_what_remains(hung, options):
    friction, said = found(hung, PULL * np.sin(hung.position), **options)
    share = friction.dynamics["model_torque"]
    assert share.value == 1.0 and np.isnan(share.standard_error)
    assert AS_ONE in said and not friction.warnings
    assert friction.law.torque(1.0) == pytest.approx(1.9, rel=0.02)
    if "gravity_sin" in friction.dynamics:
        rest = friction.dynamics["gravity_sin"]
        assert abs(rest.value) < 4.0 * rest.standard_error


@pytest.mark.parametrize(
    ("factor", "words"), [(1.5, "0.667 where 1 is meant"), (-1.0, "Read it with a minus")]
)
def test_a_wrong_size_shows_in_the_gravity_that_remains(hung, factor, words):
    friction, _ = found(hung, factor * PULL * np.sin(hung.position))
    rest = friction.dynamics["gravity_sin"]
    assert rest.value == pytest.approx((1.0 - factor) * PULL, abs=4.0 * rest.standard_error)
    assert rest.standard_error < 0.02
    assert any(words in sentence for sentence in friction.warnings)


def test_a_constant_torque_is_not_halved_with_the_offset(hung):
    level = np.full_like(hung.position, 5.0)
    friction, said = found(hung.replace(torque=hung.torque + 5.0), level)
    assert friction.dynamics["model_torque"].value == 1.0 and AS_ONE in said
    assert friction.dynamics["gravity_sin"].value == pytest.approx(PULL, rel=0.01)
    assert abs(friction.dynamics["offset"].value) < 0.05


def test_a_channel_of_zeros_changes_nothing(hung):
    friction, said = found(hung, np.zeros_like(hung.position))
    alone = identify(hung, method="motion").model.joints[0]
    assert "model_torque" not in friction.dynamics and AS_ONE not in said
    assert friction.law == alone.law and friction.dynamics == alone.dynamics


def test_a_share_beside_another_axis_is_estimated(hung):
    other = 3.0 * np.sin(5.0 * hung.time[:, None])
    friction, said = found(hung.replace(torque=hung.torque + other), other)
    share = friction.dynamics["model_torque"]
    assert share.value == pytest.approx(1.0, abs=4.0 * share.standard_error) and share.standard_error < 0.05
    assert AS_ONE not in said


def test_what_a_known_torque_is_made_of():
    q = np.linspace(-1.0, 2.0, 500)
    torque = 0.5 + 3.0 * np.sin(q) - 2.0 * np.cos(q)
    halves = [q[:200], q[200:]], [torque[:200], torque[200:]]
    assert as_gravity(*halves) == pytest.approx((0.5, 3.0, -2.0), abs=1e-6)
    assert as_gravity(None, halves[1]) is None
    assert as_gravity(None, [np.full(9, 2.0)]) == pytest.approx((2.0, 0.0, 0.0))
    assert as_gravity([q], [torque + 0.5 * np.sin(4.0 * q)]) is None
    assert as_gravity([q], [0.0 * q]) == (0.0, 0.0, 0.0)
