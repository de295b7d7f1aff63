"""Tests for identification/motion.py: the truth that was put in comes out, and unknowable things are said."""

import numpy as np
import pytest

from _synthetic import any_motion
from backdrive import identify
from backdrive.errors import NotIdentifiable
from backdrive.identification.curves import past_rise
from backdrive.identification.motion import identify_motion
from backdrive.identification.signals import prepare, turns
from backdrive.laws import Law, Polyline
from backdrive.logs.log import Joint, Log


def stribeck(v):
    return np.sign(v) * (4.0 + 2.0 * np.exp(-np.abs(v) / 0.1) + 1.5 * np.abs(v))


def test_coulomb_and_viscous_friction_come_back_as_that_law():
    log = any_motion(lambda v: 5.0 * np.sign(v) + 2.0 * v, inertia=0.8, offset=0.7)
    friction, evidence = identify_motion([log], "j1")
    law = friction.law.rate
    assert law.NAME == "coulomb-viscous"
    assert law.coulomb_positive == pytest.approx(5.0, abs=0.05)
    assert law.viscous_positive == pytest.approx(2.0, abs=0.05)
    assert friction.dynamics["inertia"].value == pytest.approx(0.8, abs=0.02)
    assert friction.dynamics["offset"].value == pytest.approx(0.7, abs=0.03)
    assert friction.held_out.residual < 5.0
    assert "good" in evidence.verdict


def test_a_constant_beside_the_curve_is_in_the_verdict():
    lop = any_motion(lambda v: np.where(v > 0.0, 1.3, -0.27) + 0.4 * v)
    _, evidence = identify_motion([lop], "j1", symmetric=True)
    assert "A constant 0.515 N.m was separated from friction: gravity, an offset" in evidence.verdict
    _, sound = identify_motion([any_motion(lambda v: 5.0 * np.sign(v) + 2.0 * v)], "j1", symmetric=True)
    assert "constant" not in sound.verdict


def test_standard_errors_are_neither_wild_nor_vain():
    law = [
        identify_motion(
            [any_motion(lambda v: 5.0 * np.sign(v) + 2.0 * v, noise=0.5, seed=s)], "j1", symmetric=True
        )[0]
        for s in range(12)
    ]
    values = np.array([f.law.rate.coulomb_positive for f in law])
    claimed = np.mean([f.standard_errors["coulomb_positive"] for f in law])
    assert 0.3 < values.std(ddof=1) / claimed < 3.0


def test_a_stribeck_curve_becomes_line_sections_close_to_it():
    friction, _ = identify_motion([any_motion(stribeck, seconds=60.0)], "j1")
    assert friction.law.rate.NAME == "polyline"
    v = np.linspace(0.05, 1.2, 50)
    np.testing.assert_allclose(friction.law.torque(v), stribeck(v), atol=0.25)


def test_direction_dependent_friction_is_found_and_the_bias_remark_made():
    log = any_motion(lambda v: np.where(v > 0, 6.0 + 1.0 * v, np.where(v < 0, -3.0 + 2.0 * v, 0.0)))
    friction, _ = identify_motion([log], "j1")
    np.testing.assert_allclose(friction.law.torque([0.5, -0.5]), [6.5, -4.0], atol=0.15)
    assert any("bias" in w for w in friction.warnings)


def test_gravity_is_found_where_it_is_and_not_where_it_is_not():
    dry = lambda v: 3.0 * np.sign(v) + v  # noqa: E731
    with_gravity, _ = identify_motion([any_motion(dry, gravity=(8.0, 2.0))], "j1")
    assert with_gravity.dynamics["gravity_sin"].value == pytest.approx(8.0, abs=0.1)
    assert with_gravity.dynamics["gravity_cos"].value == pytest.approx(2.0, abs=0.15)
    without, _ = identify_motion([any_motion(dry)], "j1", gravity=False)
    assert "gravity_sin" not in without.dynamics


def test_beside_gravity_a_constant_is_an_offset_and_the_total_is_the_same():
    one_way = lambda v: np.where(v > 0, 6.0 + 1.0 * v, np.where(v < 0, -3.0 + 3.0 * v, 0.0))  # noqa: E731
    friction, _ = identify_motion([any_motion(one_way, gravity=(8.0, 2.0))], "j1")
    np.testing.assert_allclose(friction.law.torque([1e-6, -1e-6]), [4.5, -4.5], atol=0.15)
    assert friction.dynamics["offset"].value == pytest.approx(1.5, abs=0.15)
    assert friction.held_out.residual < 5.0
    assert any("cannot tell" in w for w in friction.warnings)


@pytest.mark.parametrize("delay", [-0.004, 0.004])
def test_a_time_slip_of_the_torque_is_estimated_with_its_sign(delay):
    friction, _ = identify_motion([any_motion(lambda v: 2.0 * np.sign(v), inertia=3.0, delay=delay)], "j1")
    assert friction.dynamics["time_slip"].value == pytest.approx(delay, abs=0.0008)


def test_wild_samples_do_not_matter():
    log = any_motion(lambda v: 5.0 * np.sign(v) + 2.0 * v)
    torque = log.torque.copy()
    torque[::97] += 200.0
    friction, _ = identify_motion([log.replace(torque=torque)], "j1")
    assert float(friction.law.torque(0.5)) == pytest.approx(6.0, abs=0.15)


def test_nothing_is_interpolated_across_a_gap():
    log = any_motion(lambda v: 5.0 * np.sign(v) + 2.0 * v)
    cut = log.rows((log.time < 8.0) | (log.time > 12.0))
    friction, _ = identify_motion([cut], "j1")
    assert float(friction.law.torque(0.5)) == pytest.approx(6.0, abs=0.1)


def test_no_curve_is_fitted_below_sustained_sliding():
    def stretching(v):  # a spring at reversals looks like low friction at low speed
        return 5.0 * np.tanh(np.asarray(v) / 0.03) + 2.0 * np.asarray(v)

    quick = any_motion(stretching, seconds=40.0)
    friction, evidence = identify_motion([quick], "j1")
    lowest = friction.validity.lowest_speed
    assert lowest > 0.06 and min(k for k in friction.law.rate.values().get("velocity", (1.0,))) >= lowest
    assert friction.law.torque(1.0) == pytest.approx(7.0, abs=0.1)
    curve = evidence.curve
    rest, fast = (curve.standard_error[np.argmin(np.abs(curve.velocity - v))] for v in (1e-3, 1.0))
    assert rest > 0.2 * 5.0 and fast < 0.05  # there may be a peak that nothing shows
    slow = any_motion(stretching, seconds=40.0)
    time = 20.0 * slow.time  # the same way at a twentieth of the speed
    velocity = np.gradient(slow.position[:, 0], time)
    slow = slow.replace(time=time, torque=stretching(velocity))
    friction, _ = identify_motion([slow], "j1")
    assert friction.validity.lowest_speed < 0.05 * lowest


def test_a_moment_of_creeping_does_not_bend_a_line():
    """Slower samples than a line is fitted to are left out, even where all other motion is faster."""
    time = np.arange(0.0, 40.0, 0.002)
    fast = np.tanh(6.0 * np.sin(0.5 * np.pi * time)) * (1.0 + 0.3 * np.sin(time))
    creeping = np.clip(8.0 * np.abs(time - 21.0) - 0.8, 0.0, 1.0)  # for 0.2 s, amid a move
    velocity = fast * (0.02 + 0.98 * creeping**2 * (3.0 - 2.0 * creeping))
    torque = 5.0 * np.tanh(velocity / 0.02) + 2.0 * velocity + 0.3 * np.gradient(velocity, time)
    torque += 0.2 * np.random.default_rng(0).standard_normal(time.size)
    log = Log(time=time, joints=(Joint(name="j1"),), position=0.002 * np.cumsum(velocity), torque=torque)
    friction, _ = identify_motion([log], "j1", law="coulomb-viscous", gravity=False)
    law, errors = friction.law.rate, friction.standard_errors
    assert abs(law.coulomb_positive - 5.0) < 3.0 * errors["coulomb_positive"]
    assert abs(law.viscous_positive - 2.0) < 3.0 * errors["viscous_positive"]


def test_another_log_is_judged_when_given():
    dry = lambda v: 5.0 * np.sign(v) + 2.0 * v  # noqa: E731
    good, _ = identify_motion([any_motion(dry)], "j1", held_out=[any_motion(dry, seed=5, phase=40.0)])
    other, _ = identify_motion([any_motion(dry)], "j1", held_out=[any_motion(lambda v: 2 * dry(v), seed=5)])
    assert good.held_out.residual < 5.0 < 40.0 < other.held_out.residual


def test_an_inverted_torque_is_said():
    log = any_motion(lambda v: 5.0 * np.sign(v) + 2.0 * v)
    inverted = log.replace(torque=-log.torque)
    result = identify(inverted, method="motion", accept=("torque-sign", "no-friction"))
    assert "inverted" in result.model.joints[0].warnings[0]
    assert "not credible" in result.evidence[0].verdict


def test_a_joint_at_rest_is_not_identified():
    log = any_motion(lambda v: np.sign(v))
    still = log.replace(position=np.zeros(len(log)))
    with pytest.raises(NotIdentifiable):
        identify_motion([still], "j1")


def test_the_same_log_gives_the_same_numbers():
    log = any_motion(stribeck)
    first, second = (identify_motion([log], "j1")[0] for _ in range(2))
    assert first.law == second.law


def test_a_slow_start_is_no_slow_sliding():
    time = np.arange(5000) / 500.0
    into = np.clip(time - 1.0, 0.0, 4.0)
    position = 0.5 * into**3 * (1.0 - 0.15 * into)
    torque = np.random.default_rng(0).standard_normal(time.size)
    (stretch,) = prepare(Log(time=time, joints=(Joint(name="j1"),), position=position, torque=torque), "j1")
    travelled = (position - position[0]) / position[-1]
    assert not stretch.sliding[travelled < 0.004].any()
    assert stretch.sliding[(travelled > 0.03) & (travelled < 0.9)].all()


@pytest.mark.parametrize(
    ("velocity", "before"),
    [
        ([1.0, 0.0, -1.0], [1]),  # a sample right at the reversal
        ([-1.0, 0.0, 1.0, 0.0, -1.0], [1, 3]),
        ([1.0, 0.0, 0.0, -1.0], [0, 2]),  # a rest
        ([1.0, 0.0, 1.0], [0, 1]),
        ([2.0, -1.0], [0]),
        ([1.0], []),
        ([], []),
    ],
)
def test_a_reversal_counts_once_even_where_a_sample_hits_it(velocity, before):
    assert turns(np.array(velocity)).tolist() == before


@pytest.mark.parametrize(
    ("level", "slowest"),
    [
        ((0.16, 0.23, 0.36, 0.35, 0.33), 0.02),  # the first two are of elastic parts at reversals
        ((0.45, 0.40, 0.36, 0.35, 0.33), 0.005),  # a Stribeck peak
        ((0.01, 0.02, 0.04, 0.4, 2.0), 0.005),  # viscous friction alone
        ((0.36, 0.36, 0.36, 0.5, 0.9), 0.005),
    ],
)
def test_a_steep_rise_from_rest_is_no_sliding(level, slowest):
    law = Law(rate=Polyline(velocity=(0.005, 0.01, 0.02, 0.2, 1.0), positive=level, negative=level))
    assert past_rise(law, 0.001) == slowest
    assert past_rise(law, 0.3) == 0.3
