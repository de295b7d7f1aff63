"""External force from an encoder: the observers against each other, their gains, and what they reach on a known force."""

import numba as nb
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from backdrive.control import BareLoop
from backdrive.control.estimators.external import METHODS, ExternalForce
from backdrive.control.estimators.friction import alg_fe, alg_fe2, ha
from backdrive.control.estimators.sliding_mode import MotionFilter
from backdrive.errors import InvalidInput
from backdrive.laws import Coulomb, CoulombViscous, Law
from backdrive.simulation import machine
from backdrive.simulation.closed_loop import Scene, play
from backdrive.simulation.hand import pushes
from backdrive.simulation.joint import JointSimulation

JIT = not nb.config.DISABLE_JIT
T = 1e-3
COUNT = 5e-6


def pushed(force, M=10.0, count=COUNT, T=T, torque=None):
    """Return readings and commands of a free mass under a force, exact between the ticks, (n,) each."""
    n, fine = force.size, 20
    h = T / fine
    u = np.zeros(n) if torque is None else torque
    between = np.interp(np.arange(n * fine) / fine, np.arange(n), force)
    a = (between + np.repeat(u, fine)) / M
    v = np.concatenate([[0.0], np.cumsum(h * a)])
    q = np.concatenate([[0.0], np.cumsum(h * 0.5 * (v[1:] + v[:-1]))])[:-1:fine]
    return (count * np.round(q / count) if count else q), u


def varying(n, T=T):
    """Return a step of 5 N and a sine of 3 N at 3 Hz, after 0.2 s."""
    t = np.arange(n) * T
    return np.where(t > 0.2, 5.0 + 3.0 * np.sin(6.0 * np.pi * t), 0.0)


def error(estimator, n=3000 if JIT else 400):
    force = varying(n)
    q, u = pushed(force)
    return float(np.sqrt(np.mean((estimator.run(q, u, T)[0] - force)[n // 4 :] ** 2)))


def test_momentum_and_disturbance_observer_are_one():
    """For a constant inertia; De Luca's first-order observer and the filtered second difference, tick by tick."""
    rng = np.random.default_rng(0)
    n = 2000 if JIT else 100
    q, u = pushed(varying(n), torque=3.0 * rng.standard_normal(n))
    for bandwidth in (20.0, 100.0, 500.0):
        common = {"inertia": 10.0, "bandwidth": bandwidth, "friction": alg_fe(Coulomb(coulomb=2.0), 1e5)}
        r, y = (ExternalForce(method=m, **common).run(q, u, T)[0] for m in ("momentum", "disturbance"))
        assert np.abs(r - y).max() < 1e-9
        assert np.abs(r).max() > 1.0


@pytest.mark.parametrize("bandwidth", [20.0, 100.0, 400.0])
@pytest.mark.parametrize("dt", [4e-3, 1e-3, 1.25e-4])
def test_the_extended_observer_has_its_poles_in_one_place(bandwidth, dt):
    row = ExternalForce(inertia=3.0, method="extended", bandwidth=bandwidth).row(dt)
    gains = row[5:8] / np.array([1.0, dt, dt**2])
    A = np.array([[1.0, dt, dt**2 / 2.0], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])
    error_dynamics = (np.eye(3) - np.outer(gains, [1.0, 0.0, 0.0])) @ A
    b = np.exp(-row[4] * dt)
    # a threefold pole: its polynomial is exact where its roots are not
    assert np.poly(error_dynamics) == pytest.approx(np.poly([b, b, b]), rel=1e-9)


@pytest.mark.parametrize("method", METHODS[1:])
@pytest.mark.parametrize(("bandwidth", "dt"), [(5.0, 1e-3), (60.0, 1e-3), (200.0, 4e-3), (900.0, 1e-3)])
def test_a_bandwidth_means_the_same_lag_for_every_method(method, bandwidth, dt):
    """On a free mass under a force that grows by 3 N/s: q = 3 t^3/(6 M), without rounding; a force that stays has no error."""
    n = min(int((8.0 / bandwidth + 0.2) / dt), 6000 if JIT else 400)
    t = dt * np.arange(n)
    estimator = ExternalForce(inertia=2.0, method=method, bandwidth=bandwidth)
    assert estimator.lag(dt) == pytest.approx(1.0 / bandwidth + dt, rel=1e-8)
    if n * dt >= 8.0 / bandwidth:
        ramp, _ = estimator.run(3.0 * t**3 / 12.0, np.zeros(n), dt)
        assert t[-1] - ramp[-1] / 3.0 == pytest.approx(1.0 / bandwidth + dt, rel=0.02)
        steady, _ = estimator.run(3.0 * t**2 / 4.0, np.zeros(n), dt)
        assert steady[-1] == pytest.approx(3.0, rel=0.02)


def test_a_bandwidth_beyond_the_sampling_still_has_gains():
    for method in ("extended", "kalman"):
        estimator = ExternalForce(inertia=2.0, method=method, bandwidth=1e6)
        assert np.isfinite(estimator.row(T)).all()
        assert estimator.lag(T) == pytest.approx(T + 1e-6, rel=1e-6)


def test_the_filter_of_direct_follows_up_to_the_acceleration_it_was_made_for():
    t = T * np.arange(4000 if JIT else 300)
    for share in (0.25, 1.0):  # the acceleration grows slowly up to a share of 8 rad/s^2
        speed = share * 8.0 * t**2 / (2.0 * t[-1])
        q = np.concatenate([[0.0], np.cumsum(0.5 * T * (speed[1:] + speed[:-1]))])
        _, acceleration = MotionFilter.of_bandwidth(50.0, 8.0).run(q, T)
        late = t[-1] - acceleration[-1] / (share * 8.0 / t[-1])
        assert late <= 1.0 / 50.0 + 3.0 * T


@pytest.mark.parametrize("method", METHODS)
def test_a_joint_in_motion_begins_without_a_jump(method):
    """1 kg.m^2 at 2 rad/s, that its motor neither drives nor brakes."""
    n = 200
    q = 0.3 + 2.0 * T * np.arange(n)
    filter_ = MotionFilter.of_bandwidth(50.0, 8.0)
    estimator = ExternalForce(inertia=1.0, method=method, bandwidth=50.0, filter=filter_)
    force, _ = estimator.run(q, np.zeros(n), T, velocity=2.0)
    assert np.abs(force).max() < 1e-6


@pytest.mark.parametrize("method", METHODS)
def test_a_constant_offset_is_taken_off(method):
    q, u = np.zeros(50), np.full(50, 2.5)
    plain, _ = ExternalForce(inertia=1.0, method=method).run(q, u, T)
    moved, _ = ExternalForce(inertia=1.0, method=method, offset=-0.5).run(q, u + -0.5, T)
    assert moved[1:] == pytest.approx(plain[1:], abs=0.6) and moved[-1] == pytest.approx(plain[-1], abs=0.02)


@pytest.mark.parametrize("rate", [5.0, 50.0, 2000.0])
def test_the_kalman_gains_are_the_stationary_ones(rate):
    """Against the Riccati recursion iterated until it stands still, in SI."""
    M, dt = 10.0, T
    row = ExternalForce(inertia=M, method="kalman", force_rate=rate, encoder_count=COUNT).row(dt)
    A = np.array([[1.0, dt, dt**2 / 2.0], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])
    Q, R = np.diag([0.0, 0.0, (rate / M) ** 2 * dt]), COUNT**2 / 12.0
    P = np.diag([COUNT**2, 1.0, 1.0])
    gain = np.zeros(3)
    for _ in range(20000):
        P = A @ P @ A.T + Q
        gain = P[:, 0] / (P[0, 0] + R)
        P = P - np.outer(gain, P[0])
        P = 0.5 * (P + P.T)
    assert row[5:8] / np.array([1.0, dt, dt**2]) == pytest.approx(gain, rel=1e-6)


@pytest.mark.skipif(not JIT, reason="a long series")
def test_how_well_they_do_on_a_known_force():
    """M = 10 kg, 5 um, 1 ms, 5 N + 3 N at 3 Hz: the differencing observers pay for every count, L M count/T."""
    expected = {
        ("momentum", 50.0): 1.15,
        ("momentum", 100.0): 1.85,
        ("momentum", 200.0): 3.4,
        ("extended", 17.0): 1.64,
        ("extended", 34.0): 0.96,
        ("extended", 71.0): 0.54,
    }
    found = {k: error(ExternalForce(inertia=10.0, method=k[0], bandwidth=k[1])) for k in expected}
    for key, value in expected.items():
        assert found[key] == pytest.approx(value, rel=0.35), (key, found)
    best = error(ExternalForce(inertia=10.0, method="kalman", force_rate=8.0, encoder_count=COUNT))
    assert best < 0.6
    assert best < 1.05 * min(found.values())
    assert error(ExternalForce(inertia=10.0)) < 1.5


def test_one_count_moves_the_estimates_by_what_it_should():
    q, u = np.zeros(50), np.zeros(50)
    q[25:] = COUNT
    M, L = 10.0, 100.0
    y = ExternalForce(inertia=M, method="disturbance", bandwidth=L).run(q, u, T)[0]
    assert np.abs(y).max() == pytest.approx(L * M * COUNT / T / (1.0 + L * T), rel=1e-9)


@pytest.mark.parametrize("way", ["position", "velocity", "cascade"])
def test_direct_is_equation_4_5(way):
    """M a + g + tau_f - u, with the acceleration of the filter and the torque of the tick before."""
    rng = np.random.default_rng(1)
    n = 500 if JIT else 60
    q, u = pushed(varying(n) + 5.0, torque=2.0 * rng.standard_normal(n))
    known = rng.standard_normal(n)
    rate = CoulombViscous(
        coulomb_positive=3.0, coulomb_negative=2.0, viscous_positive=4.0, viscous_negative=4.0
    )
    filter_ = MotionFilter(way=way)
    estimator = ExternalForce(
        inertia=10.0, friction=ha(rate, 1e5), filter=filter_, gravity_sin=1.5, gravity_cos=-0.5
    )
    force, friction = estimator.run(q, u, T, known)
    law = ha(rate, 1e5).law
    from backdrive.engine import rollout

    expected_friction = rollout(law, q=q, dt=T)
    assert friction == pytest.approx(expected_friction, abs=1e-9)
    a = filter_.run(q, T)[1]
    g = 1.5 * np.sin(q) - 0.5 * np.cos(q) + known
    expected = 10.0 * a + g + friction
    assert force[1:] == pytest.approx((expected[1:] - u[:-1]), abs=1e-8)


def test_the_torque_is_that_of_the_tick_before():
    """An exact model under known torque alone sees no force; with the torque a tick off it sees one."""
    n = 400 if JIT else 60
    torque = 20.0 * np.sign(np.sin(np.arange(n) * 0.3))
    q, u = pushed(np.zeros(n), count=0.0, torque=torque)
    estimator = ExternalForce(inertia=10.0, method="extended", bandwidth=100.0)
    assert np.abs(estimator.run(q, u, T)[0]).max() < 1e-6
    for wrong in (np.roll(u, 1), np.roll(u, -1)):
        assert np.abs(estimator.run(q, wrong, T)[0]).max() > 0.1


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_force_along_q_is_positive(method, sign):
    """In motion with friction, by the hand, on a joint that the estimator's model fits."""
    law = Law(
        rate=CoulombViscous(
            coulomb_positive=3.0, coulomb_negative=2.0, viscous_positive=2.0, viscous_negative=2.0
        )
    )
    joint = JointSimulation(name="j", law=law, motor_inertia=2.0, encoder_count=1e-6)
    n = 500 if JIT else 120
    estimator = ExternalForce(
        inertia=2.0, friction=alg_fe(law.rate, 1e5), method=method, encoder_count=1e-6, force_rate=200.0
    )
    record = play(
        Scene(
            plant=joint,
            motion=pushes(np.full(n, sign * 8.0)),
            loop=BareLoop(external=estimator),
            substep=1e-4 if JIT else 1e-3,
        )
    )
    assert np.sign(record.motor[-1]) == sign
    if JIT:
        assert record.estimate[-100:].mean() == pytest.approx(sign * 8.0, rel=0.05)
    else:
        assert np.sign(record.estimate[-20:].mean()) == sign


def test_a_stuck_joint_hides_up_to_its_friction():
    """At rest P says 0 whatever pushes below break-away, and HA keeps what it held: both err by F at most."""
    joint = machine("setup_a")
    n = 800 if JIT else 60
    push = np.zeros(n)
    push[n // 4 :] = 6.0
    for friction in (alg_fe(joint.law.rate, 1.2e6), ha(joint.law.rate, 1.2e6)):
        record = play(
            Scene(
                plant=joint,
                motion=pushes(push),
                loop=BareLoop(external=ExternalForce(inertia=10.0, friction=friction)),
                substep=2e-5 if JIT else 2e-4,
            )
        )
        assert np.abs(record.estimate[n // 2 :] - 6.0).max() <= 12.0


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("dt", [4e-3, 1.25e-4])
def test_the_sampling_time_does_not_matter(method, dt):
    n = round((1.0 if JIT else 0.3) / dt)
    force = np.where(np.arange(n) * dt > 0.1, 6.0, 0.0)
    q, u = pushed(force, count=0.0, T=dt)
    estimate = ExternalForce(inertia=10.0, method=method, force_rate=100.0, encoder_count=1e-6).run(q, u, dt)[
        0
    ]
    assert estimate[-n // 10 :].mean() == pytest.approx(6.0, rel=0.03)


@settings(max_examples=30 if JIT else 3)
@given(
    method=st.sampled_from(METHODS),
    coulomb=st.floats(0.0, 20.0),
    seed=st.integers(0, 1000),
)
def test_mirrored_motion_mirrors_the_estimate(method, coulomb, seed):
    n = 200 if JIT else 40
    rng = np.random.default_rng(seed)
    q, u = np.cumsum(1e-5 * rng.standard_normal(n)), rng.standard_normal(n)
    estimator = ExternalForce(
        inertia=2.0, method=method, friction=alg_fe2(Coulomb(coulomb=coulomb), 1e5, 0.01), encoder_count=1e-6
    )
    there, back = estimator.run(q, u, T), estimator.run(-q, -u, T)
    assert there[0] == pytest.approx(-back[0], abs=1e-9)
    assert there[1] == pytest.approx(-back[1], abs=1e-9)


def test_bad_numbers_are_refused():
    for bad in (
        {"inertia": 0.0},
        {"bandwidth": -1.0},
        {"method": "guess"},
        {"gravity_sin": np.nan},
        {"force_rate": 0.0},
        {"offset": np.inf},
    ):
        with pytest.raises(InvalidInput):
            ExternalForce(**({"inertia": 1.0} | bad))
    with pytest.raises(InvalidInput):
        ExternalForce(inertia=1.0).run(np.zeros(5), np.zeros(4), T)
    with pytest.raises(InvalidInput):
        ExternalForce(inertia=1.0).run(np.zeros(0), np.zeros(0), T)
