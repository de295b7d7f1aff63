"""Tests for drift/: change, tracking, temperature, and how far a level may go."""

from dataclasses import replace

import numpy as np
import pytest

from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.identification import identify
from backdrive.identification.drift import (
    change_of,
    identify_thermal,
    passive_level,
    track,
    virtual_temperature,
)
from backdrive.identification.drift.change import chance, kind_of
from backdrive.identification.drift.curve_errors import REPEAT
from backdrive.laws import M1, M3, CoulombViscous, Growth, Law, Polyline
from backdrive.logs.log import Joint, Log
from backdrive.model import Covariance, JointFriction, Validity

V = np.linspace(0.2, 2.0, 10)


def friction(level=1.0, error=0.01, *, noise=None, unit="rad", direction=1.0, **changes):
    up = level * (9.0 + 3.0 * V) + (0 if noise is None else noise[:10])
    down = direction * level * (9.0 + 3.0 * V) + (0 if noise is None else noise[10:])
    if noise is None and direction == 1.0:
        down = up
    errors = {} if error is None else {"positive": (error,) * 10, "negative": (error,) * 10}
    return JointFriction(
        joint=Joint(name="a", unit=unit),
        law=Law(rate=Polyline(velocity=tuple(V), positive=tuple(up), negative=tuple(down))),
        validity=Validity(velocity=(-2.0, 2.0)),
        standard_errors=errors,
        **changes,
    )


# change


def test_chance_is_the_chi_square_distribution():
    draws = np.sum(np.random.default_rng(0).standard_normal((100_000, 7)) ** 2, axis=1)
    assert chance(9.0, 7) == pytest.approx(np.mean(draws > 9.0), abs=5e-3)
    assert np.isnan(chance(1.0, 0))


def line(coulomb, viscous, *, covariance=None, lowest=None, lopsided=0.0):
    """Return the friction of a joint by a straight line, with standard errors of 0.01 and 0.02."""
    law = CoulombViscous(
        coulomb_positive=coulomb,
        coulomb_negative=coulomb + lopsided,
        viscous_positive=viscous,
        viscous_negative=viscous,
    )
    errors = {name: 0.01 if "coulomb" in name else 0.02 for name in law.values()}
    return JointFriction(
        joint=Joint(name="a"),
        law=Law(rate=law),
        validity=Validity(velocity=(-2.0, 2.0), lowest_speed=lowest),
        standard_errors=errors,
        covariance=covariance,
    )


def test_a_line_that_is_equal_in_both_directions_is_tested_once():
    """Its numbers along +q and -q are the same ones: counted twice, noise would look like a change."""
    both = change_of(line(2.0, 0.5), line(2.02, 0.5))
    assert both.degrees == 2
    assert both.chi_square == pytest.approx(0.02**2 / (2 * (0.01 * REPEAT) ** 2), rel=1e-6)
    apart = change_of(line(2.0, 0.5, lopsided=0.1), line(2.02, 0.5, lopsided=0.1))
    assert apart.degrees == 4
    assert apart.chi_square == pytest.approx(2.0 * both.chi_square, rel=1e-6)


def test_correlations_of_a_model_count():
    """A level and a slope that are known better together than apart show a change that their errors alone do not."""
    names = ("coulomb_positive", "coulomb_negative", "viscous_positive", "viscous_negative")
    way = np.array([[1e-4, -1.8e-4], [-1.8e-4, 4e-4]])
    whole = Covariance(names=names, matrix=tuple(map(tuple, np.kron(way, np.ones((2, 2))).tolist())))
    alone = change_of(line(2.0, 0.5), line(2.03, 0.5))
    known = change_of(line(2.0, 0.5, covariance=whole), line(2.03, 0.5, covariance=whole))
    d = np.array([0.03, 0.0])
    assert known.degrees == 2
    assert known.chi_square == pytest.approx(d @ np.linalg.inv(2.0 * REPEAT**2 * way) @ d, rel=1e-6)
    assert alone.chi_square == pytest.approx(
        d @ np.linalg.inv(2.0 * REPEAT**2 * np.diag([1e-4, 4e-4])) @ d, rel=1e-6
    )


def test_curves_are_not_compared_below_the_lowest_speed_of_either():
    """Below it a curve is extrapolated."""
    peak = 3.0 * np.exp(-((V / 0.3) ** 2))
    low = replace(
        friction(noise=np.r_[peak, peak]), validity=Validity(velocity=(-2.0, 2.0), lowest_speed=0.2)
    )
    high = replace(friction(), validity=Validity(velocity=(-2.0, 2.0), lowest_speed=0.85))
    assert change_of(low, friction()).is_significant
    assert change_of(low, high).probability > 0.99
    change = change_of(low, high)
    assert change.shape < 1e-5 and max(change.distance) < 1e-4 and change.lowest_speed == pytest.approx(1.0)
    with pytest.raises(InvalidInput, match="holds from .* and the comparison ends at 0.5 rad/s"):
        change_of(low, high, top_speed=0.5)


def test_a_difference_without_errors_is_not_called_none():
    """Errors of what does not act, or along +q alone."""
    m3 = Law(rate=M3(coulomb=2.0, load=0.1, viscous=0.5)), Law(rate=M3(coulomb=3.0, load=0.1, viscous=0.5))
    a, b = (replace(line(2.0, 0.5), law=law, standard_errors={"load": 0.01}) for law in m3)
    change = change_of(a, b)
    assert not change.is_testable and any("do not act" in remark for remark in change.remarks)
    one_way = {"coulomb_positive": 0.01, "viscous_positive": 0.02}
    a, b = (replace(line(2.0, 0.5, lopsided=more), standard_errors=one_way) for more in (0.1, 0.5))
    change = change_of(a, b)
    assert not change.is_testable and any("was not tested" in remark for remark in change.remarks)


def joint_with_peak(seed):
    """Return the friction that a motion of its own shows of a joint with a Stribeck peak of 0.6 N.m below 0.05 rad/s."""
    random, t = np.random.default_rng(seed), np.arange(15_000) / 500.0
    w, a = (
        2.0 * np.pi * np.array([0.07, 0.13, 0.31, 0.47, 0.83, 1.3]),
        np.array([1.0, 0.7, 0.35, 0.25, 0.15, 0.1]),
    )
    x = np.outer(t, w) + random.uniform(0.0, 2.0 * np.pi, 6)
    size = 1.0 / np.abs(np.cos(x) @ (a * w)).max()
    q, v, acceleration = size * np.sin(x) @ a, size * np.cos(x) @ (a * w), -size * np.sin(x) @ (a * w * w)
    tau = 0.4 * acceleration + np.tanh(v / 1e-3) * (2.0 + 0.6 * np.exp(-((v / 0.05) ** 2))) + 0.8 * v
    tau += 0.05 * random.standard_normal(t.size)
    log = Log(time=t, joints=(Joint(name="a"),), position=q[:, None], torque=tau[:, None])
    return identify(log, method="motion").model.joints[0]


def test_other_motion_is_no_change_of_a_joint_with_a_peak():
    """Some motions show the peak and some do not: the curve is then line sections, or a straight line that misses it."""
    changes = [change_of(joint_with_peak(2 * n), joint_with_peak(2 * n + 1)) for n in range(15)]
    assert sum(c.is_significant for c in changes) <= 1


def test_the_test_raises_as_many_false_alarms_as_it_says_where_the_errors_are_true():
    rng, found = np.random.default_rng(1), []
    for _ in range(150):
        a, b = (friction(noise=0.01 * REPEAT * rng.standard_normal(20)) for _ in range(2))
        found.append(change_of(a, b))
    assert np.mean([c.chi_square for c in found]) == pytest.approx(20.0, abs=1.5)
    assert found[0].degrees == 20
    assert np.mean([c.probability < 0.1 for c in found]) == pytest.approx(0.1, abs=0.06)
    z = [c.mean / c.mean_error for c in found]
    assert np.std(z) == pytest.approx(1.0, abs=0.15)


def test_a_change_is_said_with_its_size():
    found = change_of(friction(), friction(0.88, 0.2))
    assert found.is_significant
    assert found.mean == pytest.approx(-0.12, abs=1e-6)
    assert found.distance[0] == pytest.approx(
        0.12 * np.sqrt(np.mean((9 + 3 * np.linspace(0, 2, 10001)) ** 2)), rel=1e-3
    )
    assert found.relative == pytest.approx((0.12, 0.12))
    assert found.verdict.startswith("changed by -12")
    assert found.verdict.endswith("more than chance")
    assert kind_of(found) == "changed"
    assert "not changed beyond chance" in change_of(friction(), friction()).verdict


def test_equal_directions_count_once_and_opposite_changes_are_a_change_of_shape():
    assert change_of(friction(), friction(0.9)).degrees == 10
    tilted = friction(direction=1.05)
    tilted = replace(tilted, law=Law(rate=replace(tilted.law.rate, positive=tuple(0.95 * (9 + 3 * V)))))
    own = friction(noise=1e-9 * np.arange(20))  # a curve for each direction
    found = change_of(own, tilted)
    assert found.is_significant
    assert "changed shape by 5" in found.verdict


def test_where_one_model_has_one_curve_for_both_directions_their_mean_is_compared():
    apart = np.r_[np.ones(10), -np.ones(10)]
    for pair in ((friction(), friction(noise=apart)), (friction(noise=apart), friction())):
        found = change_of(*pair)
        assert not found.is_significant
        assert found.chi_square == pytest.approx(0.0, abs=1e-12)
        assert "mean of both directions" in found.remarks[0]
    less = change_of(friction(), friction(0.9, noise=apart))
    assert less.is_significant
    assert less.mean == pytest.approx(-0.1, abs=1e-6)
    assert less.shape == pytest.approx(0.1, abs=1e-6)
    assert not change_of(friction(), friction()).remarks
    rng, found = np.random.default_rng(5), []
    for _ in range(100):
        common, own = (0.01 * REPEAT * rng.standard_normal(n) for n in (10, 20))
        found.append(change_of(friction(noise=np.r_[common, common]), friction(noise=apart + own)))
    assert found[0].degrees == 10
    assert np.mean([c.chi_square for c in found]) == pytest.approx(10.0, abs=1.5)
    assert np.std([c.mean / c.mean_error for c in found]) == pytest.approx(1.0, abs=0.2)


def test_a_covariance_takes_the_place_of_the_errors():
    common = 0.3**2 * np.ones((20, 20)) + 1e-4 * np.eye(20)
    rng, counts = np.random.default_rng(2), np.zeros(2)
    root = np.linalg.cholesky(common) * REPEAT
    for _ in range(60):
        a, b = (friction(error=0.3, noise=root @ rng.standard_normal(20)) for _ in range(2))
        counts += [change_of(a, b, covariances=(common, common)).probability < 0.05, False]
    assert counts[0] <= 9
    bent = friction(error=0.3, noise=0.2 * np.r_[np.linspace(-1, 1, 10), np.linspace(-1, 1, 10)])
    flat = friction(error=0.3, noise=np.zeros(20) + 1e-9 * np.r_[np.ones(10), np.zeros(10)])
    assert not change_of(flat, bent).is_significant  # as if the knots were independent
    assert change_of(flat, bent, covariances=(common, common)).is_significant
    with pytest.raises(InvalidInput, match="covariance of the shape"):
        change_of(flat, bent, covariances=(np.eye(3), None))


def test_laws_of_any_kind_are_compared_by_their_curves():
    line = JointFriction(
        joint=Joint(name="a"),
        law=Law(rate=M1(coulomb=9.0, viscous=3.0)),
        validity=Validity(velocity=(-1.5, 1.5)),
        standard_errors={"coulomb": 0.05, "viscous": 0.05},
    )
    found = change_of(line, friction())
    assert not found.is_significant
    assert found.degrees == 2
    assert found.top_speed == 1.5
    assert change_of(line, friction(1.1)).is_significant
    assert change_of(line, friction(), top_speed=1.2).top_speed == 1.2
    with pytest.raises(InvalidInput, match=r"hold up to 1.5 rad/s .* extrapolates"):
        change_of(line, friction(), top_speed=1.9)


def test_what_cannot_be_judged_is_named():
    found = change_of(friction(error=None), friction())
    assert not found.is_testable
    assert kind_of(found) == "not judged"
    assert "first model has no standard errors" in found.remarks[0]
    with pytest.raises(InvalidInput, match="in rad in one model"):
        change_of(friction(), friction(unit="m"))
    with pytest.raises(InvalidInput, match="both directions"):
        change_of(friction(), replace(friction(), validity=Validity(velocity=(0.0, 2.0))))
    with pytest.raises(InvalidInput, match="alarm = 1"):
        change_of(friction(), friction(), alarm=1.0)
    for speed in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(InvalidInput, match="no speed to compare up to"):
            change_of(friction(), friction(), top_speed=speed)
    assert "Neither model has" in change_of(friction(error=None), friction(error=None)).remarks[0]


@pytest.mark.filterwarnings("error")
def test_what_is_not_finite_is_refused():
    for pair in (
        (friction(), friction(1e307)),
        (friction(1e307), friction(1e307)),
        (friction(0.0), friction()),
    ):
        with pytest.raises(InvalidInput, match="zero, or too large"):
            change_of(*pair)
    assert not change_of(friction(), friction(error=1e200)).is_testable


def test_curves_that_hold_under_different_loads_are_brought_to_one():
    def under(carried, mu=0.05):
        found = friction(noise=np.full(20, mu * carried))
        growth = Growth(load_driving=mu, load_driven=mu, load_carried=carried)
        return replace(found, law=replace(found.law, growth=growth))

    assert not change_of(under(20.0), under(5.0)).is_significant
    assert "brought to the first one's load, 20 N.m" in change_of(under(20.0), under(5.0)).remarks[0]
    bare = replace(friction().law, growth=Growth(load_driving=0.05, load_driven=0.05))
    assert not change_of(under(20.0), replace(friction(), law=bare)).is_significant
    one = change_of(under(20.0), friction())
    assert one.is_significant
    assert "may explain the difference" in one.remarks[0]


# tracking


def test_a_constant_level_and_a_wandering_one():
    rng = np.random.default_rng(3)
    t = np.arange(15.0)
    alarms = [
        track(t, 10 + rng.standard_normal(15), np.ones(15), alarm=0.05).is_significant for _ in range(200)
    ]
    assert np.mean(alarms) <= 0.1
    inside = []
    for _ in range(60):
        true = np.cumsum(rng.standard_normal(15))
        found = track(t, true + rng.standard_normal(15), np.ones(15))
        inside.append(np.abs(found.level - true) < 1.96 * found.error)
    assert 0.85 < np.mean(inside) < 0.99
    drifting = track(t, 10 - 0.5 * t + 0.5 * rng.standard_normal(15), np.full(15, 0.5))
    assert drifting.is_significant
    assert drifting.slope[0] == pytest.approx(-0.5, abs=0.1)
    assert "has changed by -" in drifting.verdict
    assert "no significant change" in track(t, np.full(15, 3.0), np.ones(15)).verdict


def test_the_smoother_is_least_squares():
    rng = np.random.default_rng(4)
    t = np.cumsum(0.5 + rng.uniform(size=6))
    y, s, q = rng.standard_normal(6), 0.5 + rng.uniform(size=6), 0.7
    from backdrive.identification.drift.tracking import _smooth

    _, level, variance = _smooth(t, y, s, q)
    D = np.diff(np.eye(6), axis=0) / np.sqrt(q * np.diff(t))[:, None]
    H = np.diag(1 / s**2) + D.T @ D
    assert level == pytest.approx(np.linalg.solve(H, y / s**2))
    assert variance == pytest.approx(np.diag(np.linalg.inv(H)))


def test_rows_that_cannot_be_tracked_are_named():
    with pytest.raises(InvalidInput, match="at least three"):
        track([0, 1], [1, 2], [1, 1])
    with pytest.raises(InvalidInput, match="standard error"):
        track([0, 1, 2], [1, 2, 3], [1, 0, 1])
    with pytest.raises(InvalidInput, match="in order"):
        track([0, 2, 1], [1, 2, 3], [1, 1, 1])


# temperature


def test_the_virtual_temperature_is_the_thermal_equation():
    C, eta, h, dt = 500.0, 1.0, 2.0, 0.1
    power = np.abs(np.sin(0.01 * np.arange(4000))) * 10
    theta, x = np.zeros(4000), 0.0
    for k in range(1, 4000):
        for _ in range(50):  # Euler in small steps
            x += dt / 50 * (eta * power[k - 1] - h * x) / C
        theta[k] = x
    assert eta / h * virtual_temperature(power, dt, C / h) == pytest.approx(theta, abs=2e-3)


def warm(minutes=15.0, fade=0.006, noise=0.1, rate=50.0, settles=200.0):
    t = np.arange(int(60 * minutes * rate)) / rate
    top = 1.0 - 0.8 * np.cos(2 * np.pi * t / 20.0)
    v = top * np.sin(np.cumsum(2.0 * top / 0.8) / rate)
    rise = np.zeros(t.size)
    for _ in range(4):
        tau = np.sign(v) * (7.0 * (1 - fade * rise) + 3.0 * (1 - 2 * fade * rise) * np.abs(v))
        rise = 3.0 * virtual_temperature(tau * v, 1 / rate, settles)
    torque = tau + 0.7 * np.gradient(v, t) + noise * np.random.default_rng(0).standard_normal(t.size)
    return Log(
        time=t,
        joints=(Joint(name="a"),),
        position=(np.cumsum(v) - 0.5 * v) / rate,
        torque=torque,
        temperature=20.0 + rise,
    ), rise


@pytest.fixture(scope="module")
def warm_log():
    return warm()


def test_a_warm_up_gives_the_curve_at_every_temperature(warm_log):
    log, rise = warm_log
    found = identify_thermal(log)
    assert not found.virtual
    assert found.cold == pytest.approx(7.0 + 3.0 * found.velocity, abs=0.05)
    assert found.slope == pytest.approx(-0.006 * (7.0 + 6.0 * found.velocity), abs=0.004)
    assert found.explained > 0.5
    end = found.law(rise[-1])
    assert end.torque(1.0) == pytest.approx(7 * (1 - 0.006 * rise[-1]) + 3 * (1 - 0.012 * rise[-1]), abs=0.05)
    assert np.all(found.error(10.0) < 0.05)
    with pytest.raises(InvalidInput, match="below zero"):
        found.law(1000.0)


def test_without_a_sensor_the_friction_s_power_takes_its_place(warm_log):
    log, rise = warm_log
    found = identify_thermal(log.replace(temperature=None))
    assert found.virtual
    assert found.time_constant[0] == pytest.approx(200.0, rel=0.06)
    assert 3.0 * found.reached[1] == pytest.approx(rise.max(), rel=0.05)
    assert found.slope / 3.0 == pytest.approx(-0.006 * (7.0 + 6.0 * found.velocity), abs=0.005)


def test_logs_that_are_no_warm_up_are_refused(warm_log):
    log, _ = warm_log
    with pytest.raises(InvalidInput, match="no temperature"):
        identify_thermal(log.replace(temperature=None), virtual=False)
    with pytest.raises(NotIdentifiable, match="changes by"):
        identify_thermal(log.replace(temperature=np.full(len(log), 20.0)))
    same, _ = warm(minutes=6.0, fade=0.0)
    with pytest.raises(NotIdentifiable, match="does not change significantly"):
        identify_thermal(same.replace(temperature=None))
    with pytest.raises(InvalidInput, match="increasing speeds"):
        identify_thermal(log, knots=[1.0, 0.5])


# the loop


def test_the_largest_level_takes_no_more_than_friction_does():
    law = Law(
        rate=CoulombViscous(
            coulomb_positive=7.0, coulomb_negative=6.0, viscous_positive=3.0, viscous_negative=2.0
        )
    )
    warm_one = Law(
        rate=CoulombViscous(
            coulomb_positive=5.0, coulomb_negative=4.5, viscous_positive=1.0, viscous_negative=1.9
        )
    )
    level = passive_level(law, warm_one, gain=0.9, top_speed=2.0)
    v = np.concatenate([np.linspace(1e-6, 2, 999), -np.linspace(1e-6, 2, 999)])
    share = 0.9 * level * law.torque(v) / warm_one.torque(v)
    assert share.max() == pytest.approx(1.0, abs=1e-6)
    assert passive_level(law, warm_one, gain=0.9, top_speed=2.0, margin=0.5) < level
    with pytest.raises(InvalidInput, match="does not exceed its margin"):
        passive_level(law, warm_one, gain=0.9, top_speed=2.0, margin=5.0)
    with pytest.raises(InvalidInput, match="gain = 0"):
        passive_level(law, warm_one, gain=0.0, top_speed=2.0)
