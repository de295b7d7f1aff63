"""Closed forms, limits and special cases of the laws, each written out by hand, and equations solved by brute force."""

from dataclasses import replace

import numpy as np
import pytest

from _laws import JIT, follow
from backdrive.errors import UnknownName
from backdrive.laws import (
    GMS,
    BlimanSorine,
    Coulomb,
    CoulombViscous,
    Dahl,
    DeadZone,
    Decaying,
    Elastoplastic,
    HaywardArmstrong,
    Law,
    Leuven,
    LuGre,
    MaxwellSlip,
    Polyline,
    ResetIntegrator,
    SmoothedGMS,
    SmoothedMaxwellSlip,
    StribeckGauss,
    ViscoElastoplastic,
    XiongKikuuwe,
    XiongKikuuweMulti,
    kernels,
)
from backdrive.laws import element as element_law
from backdrive.laws.base import Rate
from backdrive.laws.elements.maxwell_slip import Parallel
from backdrive.laws.examples import example

F, K = 5.0, 1e4
RATE: Rate = Coulomb(coulomb=F)
STRIBECK = StribeckGauss(coulomb=4.0, breakaway=6.0, stribeck_velocity=0.05, viscous=1.0)
RANDOM = np.random.default_rng(5)
#: A motion with presliding, sliding, nested reversals and pauses.
WANDER = np.cumsum(RANDOM.normal(0.0, 1e-4, 400)) * np.repeat(RANDOM.random(40) < 0.9, 10)
VELOCITIES = np.concatenate([-np.geomspace(1e-6, 1e3, 40), [0.0], np.geomspace(1e-6, 1e3, 40)])


def along(element, dp, dt=1e-3, rate=RATE, **other):
    return follow(Law(rate=rate, element=element), dp, dt, **other)


def bisected(residual, low, high):
    """Root of a function that is <= 0 at `low` and >= 0 at `high`."""
    for _ in range(200):
        middle = 0.5 * (low + high)
        if residual(middle) > 0.0:
            high = middle
        else:
            low = middle
    return 0.5 * (low + high)


# ----------------------------------------------------------------------------------------------- bristles


def test_dahl_is_an_exponential_of_the_path_whatever_the_ticks():
    for ticks in (1, 7, 300):
        dp = np.full(ticks, 1e-3 / ticks)
        there = along(Dahl(stiffness=K), dp)
        np.testing.assert_allclose(there, F * (1.0 - np.exp(-K * np.cumsum(dp) / F)), rtol=1e-12)
        back = along(Dahl(stiffness=K), np.concatenate([dp, -dp]))[ticks:]
        np.testing.assert_allclose(back, -F + (there[-1] + F) * np.exp(-K * np.cumsum(dp) / F), rtol=1e-11)


def test_bliman_sorine_peaks_where_its_equation_says_and_twice_after_a_reversal():
    e, eta, b = 1e-3, 0.3, 0.5
    step = 2e-8 if JIT else 2e-7
    s = step * np.arange(1, round(8e-3 / step) + 1)
    virgin = along(BlimanSorine(distance=e, ratio=eta, overshoot=b), np.full(s.size, step))
    np.testing.assert_allclose(
        virgin, F * ((1 + b) * (1 - np.exp(-s / (eta * e))) - b * (1 - np.exp(-s / e))), rtol=1e-9
    )
    r = (1 + b) / (eta * b)
    peak = F * (1 + b * (1 - eta) * r ** (-eta / (1 - eta)))
    assert virgin.max() == pytest.approx(peak, rel=1e-6)
    assert s[virgin.argmax()] == pytest.approx(e * eta / (1 - eta) * np.log(r), abs=step)
    reversal = along(
        BlimanSorine(distance=e, ratio=eta, overshoot=b), np.concatenate([[1.0], np.full(s.size, -step)])
    )
    assert reversal.min() == pytest.approx(-(2.0 * peak - F), rel=1e-6)


def test_a_reset_integrator_breaks_away_at_its_excess_and_gives_no_energy_back_that_it_did_not_take():
    element = ResetIntegrator(stiffness=K, excess=0.2)
    stick = along(element, np.full(50, 1e-5))  # break-away is after 50 ticks of 1e-5
    np.testing.assert_allclose(stick, 1.2 * K * 1e-5 * np.arange(1, 51), rtol=1e-12)
    assert along(element, np.full(52, 1e-5))[-1] == F
    across = along(element, [4.9e-4, 4e-5])  # a quarter of the tick still held
    assert across[-1] == pytest.approx(F * (1.0 + 0.2 / 4.0))
    shaken = np.concatenate([[5e-4], np.tile([-1e-6, 1e-6], 500)])
    assert np.sum(along(element, shaken)[1:] * shaken[1:]) >= 0.0


def test_lugre_and_the_elastoplastic_bristle_are_their_differential_equations():
    from scipy.integrate import solve_ivp

    s0, s1, b = 1e4, 20.0, 0.7
    q = lambda t: 2e-3 * np.sin(9.0 * t) + 1e-3 * np.sin(23.0 * t)  # noqa: E731
    dq = lambda t: 1.8e-2 * np.cos(9.0 * t) + 2.3e-2 * np.cos(23.0 * t)  # noqa: E731

    def bound(v):
        return 4.0 + 2.0 * np.exp(-((v / 0.05) ** 2))

    def share(z, v):
        ratio = s0 * z * np.sign(v) / bound(v)
        return np.where(
            ratio <= b,
            0.0,
            np.where(ratio >= 1, 1.0, 0.5 + 0.5 * np.sin(np.pi * (ratio - 0.5 * (1 + b)) / (1 - b))),
        )

    n = 40000 if JIT else 4000
    t = np.linspace(0.0, 1.0, n + 1)
    for element, slides in (
        (LuGre(stiffness=s0, damping=s1), lambda z, v: 1.0),
        (Elastoplastic(stiffness=s0, damping=s1, elastic=b), share),
    ):

        def rate(t, z, slides=slides):
            v = dq(t)
            return v - slides(z, v) * s0 * abs(v) * z / bound(v)

        z = solve_ivp(rate, (0.0, 1.0), [0.0], rtol=1e-9, atol=1e-14, t_eval=t[1:], max_step=1e-3).y[0]
        v = dq(t[1:])
        expected = s0 * z + s1 * rate(t[1:], z) + v
        torque = along(element, np.diff(q(t)), 1.0 / n, rate=STRIBECK)
        assert np.max(np.abs(torque - expected)) < 150.0 / n  # first order


def test_lugre_of_1995_has_advice_and_creates_energy():
    """Canudas de Wit et al. 1995, Table I: sigma_2 = 0.4, where 158 is needed. Stretched slowly, then pulled on fast."""
    law = Law(
        rate=StribeckGauss(coulomb=1.0, breakaway=1.5, stribeck_velocity=1e-3, viscous=0.4),
        element=LuGre(stiffness=1e5, damping=np.sqrt(1e5)),
    )
    assert "viscous >= 158.1" in law.element.advice(law.rate)
    p, x, none, gained = law.row(), law.state(), (0.0, 0.0), 0.0
    for _ in range(200):
        kernels.step(law.rate.KIND, law.element.KIND, p, x, 5e-7, 1e-3, none, 20.0)
    stored = x[0] ** 2 / 2e5
    for _ in range(50):
        gained -= 1e-7 * kernels.step(law.rate.KIND, law.element.KIND, p, x, 1e-7, 1e-6, none, 20.0)
    assert gained > 3.0 * stored


def test_gms_creates_energy_where_its_advice_says_so():
    """GMS: load fast, let the torque grow in slow slipping, unload: (F_s - F_c)^2/(2 k) a cycle."""
    rate = StribeckGauss(coulomb=1.0, breakaway=3.0, stribeck_velocity=0.01)
    element = GMS(stiffness=(1e4,), share=(1.0,), attraction=1e3)
    slow = np.full(2000, 1e-10)  # 2 s at 1e-7 rad/s
    cycle = np.concatenate([np.full(4, 5e-5), slow, np.full(20, -1e-5 - 1e-8)])
    motion = np.tile(cycle, 3)
    work = (along(element, motion, 1e-3, rate=rate) * motion)[-cycle.size :].sum()
    assert abs(cycle.sum()) < 1e-12
    assert work == pytest.approx(-(2.0**2) / 2e4, rel=0.1)
    assert element.advice(rate)
    assert not element.advice(RATE)


# ----------------------------------------------------------------------------------------------- springs and sliders


def test_maxwell_slip_repeats_its_virgin_curve_at_twice_the_size():
    """Masing's rule; the virgin curve is a polyline with a bend where an element begins to slip."""
    element = MaxwellSlip(**Parallel.EXAMPLE)
    k, w = np.array(Parallel.EXAMPLE["stiffness"]), np.array(Parallel.EXAMPLE["share"])
    s = np.arange(1, 301) * 5e-6
    virgin = along(element, np.full(300, 5e-6))
    np.testing.assert_allclose(virgin, np.minimum(np.outer(s, k), F * w).sum(axis=1), rtol=1e-12)
    turned = along(element, np.concatenate([np.full(300, 5e-6), np.full(600, -5e-6)]))
    np.testing.assert_allclose(turned[300:][1::2], virgin[-1] - 2.0 * virgin, rtol=1e-9, atol=1e-9)
    inner = along(element, np.concatenate([np.full(300, 5e-6), np.full(80, -5e-6), np.full(80, 5e-6)]))
    assert inner[-1] == pytest.approx(virgin[-1], abs=1e-9)  # a nested loop closes


def test_one_element_side_by_side_is_that_element_to_the_last_bit():
    one = {"stiffness": (K,), "share": (1.0,)}
    same = [
        (HaywardArmstrong(stiffness=K), MaxwellSlip(**one)),
        (HaywardArmstrong(stiffness=K), ViscoElastoplastic(stiffness=K)),
        (ViscoElastoplastic(stiffness=K, damping=20.0), XiongKikuuwe(stiffness=K, damping=20.0)),
        (ViscoElastoplastic(stiffness=K, damping=20.0), XiongKikuuweMulti(**one, damping_time=20.0 / K)),
        (XiongKikuuwe(stiffness=K, damping=20.0, lag=0.01), XiongKikuuweMulti(**one, damping_time=20.0 / K, lag=0.01)),
        (MaxwellSlip(**Parallel.EXAMPLE), XiongKikuuweMulti(**Parallel.EXAMPLE)),
    ]  # fmt: skip
    for a, b in same:
        rate = replace(STRIBECK, viscous=0.0)
        assert along(a, WANDER, rate=rate).tobytes() == along(b, WANDER, rate=rate).tobytes()


def test_xiong_and_kikuuwe_are_one_another_written_out():
    """Kikuuwe et al. 2006: f = clip(K e + B de/dt), then e from f; Xiong et al. 2013: a' = (f - K a)/B by backward Euler."""
    B, dt = 20.0, 1e-3
    e = a = 0.0
    for dp, torque in zip(WANDER, along(ViscoElastoplastic(stiffness=K, damping=B), WANDER, dt), strict=True):
        f = np.clip(K * (e + dp) + B * dp / dt, -F, F)
        e = (f + B / dt * e) / (K + B / dt)
        g = np.clip(K * (a + dp) + B * dp / dt, -F, F)
        a = (B * a + dt * g) / (B + K * dt)
        assert f == pytest.approx(torque, abs=1e-11)
        assert g == pytest.approx(torque, abs=1e-11)


def test_decaying_without_decay_is_hayward_and_armstrong():
    for rate in (
        RATE,
        CoulombViscous(
            coulomb_positive=5.0, coulomb_negative=4.0, viscous_positive=1.0, viscous_negative=2.0
        ),
    ):
        expected = along(HaywardArmstrong(stiffness=K), WANDER, rate=rate)
        np.testing.assert_allclose(
            along(Decaying(stiffness=K, decay_rate=0.0), WANDER, rate=rate), expected, atol=1e-11
        )


def test_a_decaying_spring_fades_at_its_rate_and_is_viscous_below_its_threshold():
    alpha, dt = 20.0, 1e-3
    torque = along(Decaying(stiffness=K, decay_rate=alpha), np.concatenate([[4e-4], np.zeros(100)]), dt)
    np.testing.assert_allclose(torque, 4.0 / (1.0 + alpha * dt) ** np.arange(1, 102), rtol=1e-12)
    for v in (0.5, 2.0):  # of alpha F/K
        slow = along(Decaying(stiffness=K, decay_rate=alpha), np.full(3000, v * alpha * F / K * dt), dt)
        assert slow[-1] == pytest.approx(min(F, v * F))


def test_gms_under_a_constant_bound_is_maxwell_slip_and_follows_at_once_with_a_huge_attraction():
    for attraction in (1.0, 1e9):
        expected = along(MaxwellSlip(**Parallel.EXAMPLE), WANDER)
        np.testing.assert_allclose(
            along(GMS(**Parallel.EXAMPLE, attraction=attraction), WANDER), expected, atol=1e-11
        )
    v = 0.03 * (1.5 + np.sin(0.02 * np.arange(1000)))
    torque = along(GMS(**Parallel.EXAMPLE, attraction=1e9), v * 1e-3, rate=STRIBECK)
    expected = Law(rate=STRIBECK).torque(v)
    np.testing.assert_allclose(torque[100:], expected[100:], rtol=1e-6)


def test_the_name_of_before_still_leads_to_the_smoothed_law():
    assert element_law("smoothed-gms") is SmoothedMaxwellSlip is SmoothedGMS
    assert example("coulomb+smoothed-gms").name == "coulomb+smoothed-maxwell-slip"
    with pytest.raises(UnknownName, match="smoothed-lugre"):
        element_law("smoothed-lugre")


def test_smoothed_maxwell_slip_nears_maxwell_slip_as_it_is_sharpened():
    expected = along(MaxwellSlip(**Parallel.EXAMPLE), WANDER)
    worst = [
        np.max(
            np.abs(
                along(SmoothedMaxwellSlip(**Parallel.EXAMPLE, sharpness=s, margin=m, reversal=100.0), WANDER)
                - expected
            )
        )
        for s, m in ((50.0, 0.9), (400.0, 0.98), (3000.0, 0.997))
    ]
    assert worst[0] > worst[1] > worst[2]
    assert worst[2] < 0.005 * F


# ----------------------------------------------------------------------------------------------- implicit steps


@pytest.mark.parametrize("seed", range(300 if JIT else 20))
def test_implicit_steps_solve_their_equations(seed):
    """State and pull anywhere, also beyond the bound and against the motion, by bisection of the printed equation."""
    random = np.random.default_rng(seed)
    start = random.uniform(-1.5, 1.5) * F
    R = F * 10.0 ** random.uniform(-4.0, 4.0)  # the pull in torque, along +q
    b = random.uniform(0.0, 0.99)

    def share(r):
        return (
            0.0
            if r <= b
            else 1.0
            if r >= 1.0
            else 0.5 + 0.5 * np.sin(np.pi * (r - 0.5 * (1.0 + b)) / (1.0 - b))
        )

    law = Law(rate=RATE, element=Elastoplastic(stiffness=K, elastic=b))
    x = np.array([start, 0.0])
    kernels.step(law.rate.KIND, law.element.KIND, law.row(), x, R / K, 1e-3, (0.0, 0.0), 20.0)
    expected = bisected(
        lambda u: u - start - R * (1.0 - share(u / F) * u / F), min(start, F) - R, max(start, F) + R
    )
    assert x[0] == pytest.approx(expected, abs=1e-9 * F)

    sharp, m, c = (
        10.0 ** random.uniform(0.5, 3.0),
        random.uniform(0.3, 0.99),
        10.0 ** random.uniform(0.5, 2.0),
    )

    def gate(r):
        return (1.0 - 0.5 * np.tanh(sharp * (r + m)) + 0.5 * np.tanh(sharp * (r - m))) * (
            0.5 + 0.5 * np.tanh(c * r)
        )

    law = Law(
        rate=RATE,
        element=SmoothedMaxwellSlip(stiffness=(K,), share=(1.0,), sharpness=sharp, margin=m, reversal=c),
    )
    x = np.array([start, 0.0])
    kernels.step(law.rate.KIND, law.element.KIND, law.row(), x, R / K, 1e-3, (0.0, 0.0), 20.0)
    r, u, path = start / F, x[0] / F, R / F
    assert u - r - path * (1.0 - gate(u) / gate(1.0) * u) == pytest.approx(0.0, abs=1e-9 * (1.0 + path))
    assert min(r, 1.0) <= u <= max(r, 1.0)

    n, k, w = (
        10.0 ** random.uniform(-0.3, 1.69),
        K * 10.0 ** random.uniform(-1.0, 1.0, 3),
        random.dirichlet([1.0, 1.0, 1.0]),
    )
    law = Law(rate=RATE, element=Leuven(stiffness=tuple(k), share=tuple(w), sharpness=n))
    x = np.concatenate([random.uniform(-1.0, 1.0, 3) * w * F, np.zeros(3)])
    start, path = x[:3].copy(), R / K

    def hysteresis(dz):
        return np.clip(start + k * dz, -w * F, w * F)

    def slid(dz):
        r = hysteresis(dz).sum() / F
        return dz - path * (1.0 - np.sign(r) * abs(r) ** n)

    kernels.step(law.rate.KIND, law.element.KIND, law.row(), x, path, 1e-3, (0.0, 0.0), 20.0)
    expected = hysteresis(bisected(slid, 0.0, 2.0 * path))
    np.testing.assert_allclose(x[:3], expected, atol=1e-9 * F)


def test_a_mass_under_more_than_break_away_starts_also_in_a_dead_zone():
    law = Law(rate=RATE, element=DeadZone(threshold=0.01))
    v = 0.0
    for _ in range(1000):
        v = kernels.solve(
            law.rate.KIND,
            law.element.KIND,
            law.row(),
            np.zeros(2),
            v + 1e-3 * 5.05,
            1e-3,
            1e-3,
            (0.0, 0.0),
            20.0,
        )
    assert v == pytest.approx(0.05)


def test_falling_sections_narrow_the_bounds_of_what_is_carried():
    """Otherwise they would be a negative damping of the spring: here, of a joint that vibrates without sliding."""
    falling = Polyline(velocity=(0.05, 0.2), positive=(5.0, 4.0), negative=(5.0, 4.0))
    q = 1e-4 * np.sin(0.3 * np.arange(2000))
    for element in (MaxwellSlip(**Parallel.EXAMPLE), LuGre(stiffness=K), HaywardArmstrong(stiffness=K)):
        assert np.sum(along(element, np.diff(q), rate=falling) * np.diff(q)) >= -1e-12
    sliding = along(MaxwellSlip(**Parallel.EXAMPLE), np.full(200, 0.2e-3), rate=falling)
    assert sliding[-1] == pytest.approx(4.0)
