"""Every law against its printed equation, worked out here in plain Python: no line of the package takes part.

Closed forms where there are some, otherwise the implicit equation solved by bisection, or the differential equation
integrated with steps a thousand times as fine.
"""

from dataclasses import replace
from math import copysign, exp, inf, isnan, pi, sin, tanh

import numpy as np
import pytest

from _laws import follow
from backdrive.errors import InvalidInput
from backdrive.laws import (
    ELEMENTS,
    GMS,
    M1,
    M6,
    RATES,
    BlimanSorine,
    CoulombViscous,
    Dahl,
    DeadZone,
    Decaying,
    Elastoplastic,
    HaywardArmstrong,
    Law,
    Leuven,
    LoadTemperature,
    LuGre,
    MaxwellSlip,
    Polyline,
    ResetIntegrator,
    Rigid,
    SmoothedMaxwellSlip,
    StribeckGauss,
    StribeckLorentz,
    StribeckTustin,
    ViscoElastoplastic,
    XiongKikuuwe,
    XiongKikuuweMulti,
    kernels,
)
from backdrive.laws.examples import ELEMENT_EXAMPLES, RATE_EXAMPLES

SPEEDS = (0.0, 1e-7, 0.003, 0.01, 0.049, 0.05, 0.05000001, 0.12, 0.2, 0.37, 1.0, 1.7, 30.0)
LOADS = ((0.0, 0.0), (7.0, -3.0), (-3.0, 7.0), (2.0, 5.0), (-6.0, 4.0), (4.0, -4.0), (0.0, -8.0), (0.0, 3.0))


# ------------------------------------------------------------------------------------------- rate laws


def m_law(r, v, load):
    get = lambda name, other=0.0: getattr(r, name, other)  # noqa: E731
    m, x = load
    e = exp(-(abs(v / get("stribeck_velocity", 1.0)) ** get("exponent", 1.0)))
    K, S = get("load"), get("load_stribeck")
    F = r.coulomb + e * get("stribeck")
    F += abs(get("load_motor", K) * m - get("load_external", K) * x)
    F += e * abs(get("load_stribeck_motor", S) * m - get("load_stribeck_external", S) * x)
    if m * x < 0.0:
        F += e * (get("quadratic_external") * x**2 if abs(x) < abs(m) else 0.0)
        F += e * (get("quadratic_motor") * m**2 if abs(x) > abs(m) else 0.0)
    return F, F, r.viscous * v


def stribeck(r, v, exponent):
    s = r.coulomb + (r.breakaway - r.coulomb) * exp(-(abs(v / r.stribeck_velocity) ** exponent))
    return s, s, r.viscous * v


def polyline(r, v):
    """(2.8), (2.9), (3.1): interpolated between the knots, the outer sections go on."""

    def curve(F, speed):
        V = r.velocity
        k = next((k for k in range(len(V) - 2) if speed < V[k + 1]), len(V) - 2)
        return F[k] + (F[k + 1] - F[k]) / (V[k + 1] - V[k]) * (speed - V[k])

    up, down = curve(r.positive, 0.0), curve(r.negative, 0.0)
    return up, down, (curve(r.positive, v) - up if v >= 0.0 else down - curve(r.negative, -v))


def load_temperature(r, v, load, T):
    carried = abs(load[0] - load[1]) / 2.0
    fade = lambda scale: exp(-(abs(v / scale) ** r.exponent))  # noqa: E731
    s = r.coulomb + r.coulomb_load * carried + r.stribeck_load * carried * fade(r.stribeck_velocity_load)
    s += (r.stribeck + r.stribeck_temperature * T) * fade(
        max(r.stribeck_velocity + r.stribeck_velocity_temperature * T, 1e-9)
    )
    return max(s, 0.0), max(s, 0.0), (r.viscous + r.viscous_temperature * exp(-T / r.thinning)) * v


def gear_load(r, v, load):
    T = -load[1]
    e = exp(-((v / r.stribeck_velocity) ** 2))
    with_power = [r.coulomb + (r.load + e * s) * abs(T) for s in (r.driving, r.driven)]
    up, down = with_power if T > 0.0 else with_power[::-1]
    return up, down, r.viscous * v


def by_formula(r, v, load, T):
    """F_p, F_n and the viscous part of a rate law."""
    name = r.NAME
    if name == "coulomb":
        return r.coulomb, r.coulomb, 0.0
    if name == "coulomb-viscous":
        slope = r.viscous_positive if v > 0.0 else r.viscous_negative
        return r.coulomb_positive, r.coulomb_negative, slope * v
    if name in ("stribeck-gauss", "stribeck-tustin"):
        return stribeck(r, v, getattr(r, "exponent", 2.0))
    if name == "stribeck-lorentz":
        s = r.coulomb + (r.breakaway - r.coulomb) / (1.0 + (v / r.stribeck_velocity) ** 2)
        return s, s, r.viscous * v
    if name == "makkar":
        peak = r.stribeck * (tanh(r.rise * v) - tanh(r.fall * v))
        return 0.0, 0.0, peak + r.coulomb * tanh(r.steepness * v) + r.viscous * v
    if name == "sigmoid":
        at = lambda x: r.span / (1.0 + exp(-max(r.steepness * x, -700.0)))  # noqa: E731
        return 0.0, 0.0, at(v + r.shift) - at(r.shift)
    if name == "degressive":
        return r.coulomb, r.coulomb, copysign(r.growth * abs(v) ** r.exponent, v)
    if name == "polyline":
        return polyline(r, v)
    if name == "load-temperature":
        return load_temperature(r, v, load, T)
    if name == "gear-load":
        return gear_load(r, v, load)
    return m_law(r, v, load)


def more_rates():
    """The examples, and the branches that they do not reach: other exponents, few knots, cut curves."""
    yield from RATE_EXAMPLES.values()
    tustin = RATE_EXAMPLES["stribeck-tustin"]
    yield from (replace(tustin, exponent=n) for n in (0.5, 1.0, 1.05, 2.0, 2.1, 4.0))
    yield from (replace(RATE_EXAMPLES["degressive"], exponent=n) for n in (1.0, 0.525, 2.0 / 3.0))
    yield StribeckLorentz(coulomb=3.1, breakaway=7.3, stribeck_velocity=0.06, viscous=0.9)
    yield replace(RATE_EXAMPLES["m6"], load_external=0.0, load_motor=0.0)
    yield M1(coulomb=3.1, viscous=0.7)
    for only in (
        "load_motor",
        "load_external",
        "load_stribeck_motor",
        "load_stribeck_external",
        "quadratic_external",
    ):
        yield M6(coulomb=3.1, viscous=0.7, stribeck_velocity=0.05, **{only: 0.3})
    yield M6(coulomb=3.1, quadratic_motor=0.3, stribeck_velocity=0.05)
    yield replace(RATE_EXAMPLES["load-temperature"], stribeck=-9.0)
    yield replace(RATE_EXAMPLES["load-temperature"], stribeck_velocity=-1.0)
    yield Polyline(
        velocity=(0.05, 0.12, 0.2, 0.37, 1.0), positive=(5.0, 4, 4.2, 6, 5), negative=(3.0, 2, 9, 1, 7)
    )


@pytest.mark.parametrize("rate", list(more_rates()), ids=lambda r: r.NAME)
def test_every_rate_law_is_its_printed_equation(rate):
    assert type(rate) is RATES[rate.NAME]
    row = Law(rate=rate).row()
    loads = LOADS if rate.NEEDS else LOADS[:2]
    for v in (*SPEEDS, *(-s for s in SPEEDS)):
        for load in loads:
            for T in (20.0, -15.0, 60.0) if "temperature" in rate.NEEDS else (20.0,):
                lo, hi, viscous = kernels.limits(rate.KIND, row, v, load, T)
                assert (hi, -lo, viscous) == pytest.approx(by_formula(rate, v, load, T), rel=1e-9, abs=1e-12)


def test_a_polyline_of_one_knot_is_a_coulomb_torque_and_its_first_section_starts_no_lower_than_zero():
    one = Polyline(velocity=(0.3,), positive=(2.0,), negative=(3.0,))
    assert Law(rate=one).torque([0.1, 5.0, -0.1]) == pytest.approx([2.0, 2.0, -3.0])
    steep = Polyline(velocity=(0.1, 0.2), positive=(1.0, 3.0), negative=(1.0, 1.5))
    got = [
        kernels.limits(1, Law(rate=steep).row(), v, (0.0, 0.0), 20.0) for v in (0.04, 0.1, 0.15, -0.05, 0.0)
    ]
    # +q: the line through the knots meets -1 at rest: Phi = 10 v below the first knot; -q: 0.5 at rest, 5 v beyond
    expected = [(-0.5, 0.0, 0.4), (-0.5, 0.0, 1.0), (-0.5, 0.0, 2.0), (-0.5, 0.0, -0.25), (-0.5, 0.0, 0.0)]
    for one, wanted in zip(got, expected, strict=True):
        assert one == pytest.approx(wanted, abs=1e-12)
    other = Polyline(
        velocity=(0.1, 0.2), positive=(1.0, 1.5), negative=(2.0, 5.0)
    )  # -1 at rest along -q: 20 v there
    row = Law(rate=other).row()
    for v, wanted in ((-0.05, -1.0), (-0.1, -2.0), (-0.15, -3.5), (0.05, 0.25)):
        assert kernels.limits(1, row, v, (0.0, 0.0), 20.0)[2] == pytest.approx(wanted)


def test_curves_of_a_rate_law_at_many_speeds():
    rate = CoulombViscous(
        coulomb_positive=5.0, coulomb_negative=4.0, viscous_positive=1.0, viscous_negative=2.0
    )
    curves = rate.curves((0.0, 0.0), 20.0)
    for way, F, s in ((1.0, 5.0, 1.0), (-1.0, 4.0, 2.0)):
        speeds = [speed for speed, _, _ in curves[way]]
        assert (min(speeds), max(speeds)) == (1e-12, pytest.approx(1e6))
        assert np.diff(np.log10(speeds[1:])) == pytest.approx(15.0 / 60.0)  # 1e-9 to 1e6
        for speed, bound, viscous in curves[way]:
            assert (bound, viscous) == pytest.approx((F, s * speed))
    assert rate.span() == (pytest.approx((5.0, 5.0, 1.0)), pytest.approx((4.0, 4.0, 2.0)))
    falls = Polyline(velocity=(1.0, 2.0), positive=(3.0, 2.0), negative=(2.0, 2.5)).span()
    # +q: 4 at rest, falling with slope 1: at 1e6 nothing of it is left; -q: 1.5 at rest, rising by 0.5
    assert falls[0] == pytest.approx((4.0 - 1e6, 4.0, 0.0))
    assert falls[1] == pytest.approx((1.5, 1.5, 0.5))


# -------------------------------------------------------------------------------------------- elements


def root(f, low, high):
    """Bisection: f(low) <= 0 <= f(high)."""
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if f(middle) < 0.0 else (low, middle)
    return 0.5 * (low + high)


def fine(rates, x, path, steps=700):
    """Integrate dx/dpath = rates(x) with the classical Runge-Kutta method."""
    h = path / steps
    for _ in range(steps):
        a = rates(x)
        b = rates(x + 0.5 * h * a)
        c = rates(x + 0.5 * h * b)
        x = x + h / 6.0 * (a + 2.0 * b + 2.0 * c + rates(x + h * c))
    return x


def sign(x):
    return (x > 0.0) - (x < 0.0)


def lugre(e, x, lo, hi, dp, dt):
    """Backward Euler of z' = v - sigma_0 |v| z/s, in sigma_0 z."""
    s = hi if dp > 0.0 else -lo
    before, x[0] = x[0], (x[0] + e.stiffness * dp) / (1.0 + e.stiffness * abs(dp) / s)
    v = dp / dt
    damping = e.damping * (exp(-((v / e.fading) ** 2)) if e.fading > 0.0 else 1.0)
    return x[0] + damping * (x[0] - before) / (e.stiffness * dt), dp


def elastoplastic(e, x, lo, hi, dp, dt):
    s, way, before = (hi if dp > 0.0 else -lo), sign(dp), x[0]

    def alpha(f):
        ratio = abs(f) / s
        if sign(f) != way or ratio <= e.elastic:
            return 0.0
        return (
            0.5 + 0.5 * sin(pi * (ratio - (1.0 + e.elastic) / 2.0) / (1.0 - e.elastic))
            if ratio < 1.0
            else 1.0
        )

    if dp != 0.0:
        R = e.stiffness * abs(dp)
        step = lambda u: u - way * before - R * (1.0 - alpha(way * u) * u / s)  # noqa: E731
        x[0] = way * root(step, min(way * before, 0.0) - R, max(way * before, s) + R)
    damping = e.damping * (exp(-((dp / dt / e.fading) ** 2)) if e.fading > 0.0 else 1.0)
    return x[0] + damping * (x[0] - before) / (e.stiffness * dt), dp


def slider(K, alpha, x, lo, hi, dp, dt):
    """Backward Euler of K (p - q) in gsgn(lo, q' - alpha (p - q), hi); the viscous part sees q'."""
    before = x[0]
    x[0] = min(max((before + K * dp) / (1.0 + alpha * dt), lo), hi)
    slid = dp - (x[0] - before) / K
    if x[0] in (lo, hi):  # bounds that fall with speed throw the slider no further than the joint moves
        slid = min(max(slid, min(dp, 0.0)), max(dp, 0.0))
    return x[0], slid


def kelvin(K, B, x, lo, hi, dp, dt):
    """f = K a + B a' in F sgn(v - a'), backward Euler, x = K a."""

    def excess(rate):  # of the torque that the stretch asks for over the largest that the slider gives
        return x[0] + K * dt * rate + B * rate

    rate = dp / dt
    f = min(max(excess(rate), lo), hi)
    size = abs(f - x[0]) / (K * dt + B) + abs(rate) + 1.0
    a = root(lambda r: excess(r) - f, -size, size)
    x[0] += K * dt * a
    return f


def xiong_kikuuwe(e, x, lo, hi, dp, dt):
    stiffness = e.stiffness if isinstance(e.stiffness, tuple) else (e.stiffness,)
    share = getattr(e, "share", (1.0,))
    time, lag = getattr(e, "damping_time", None), getattr(e, "lag", 0.0)
    n = len(stiffness)
    if lag > 0.0:
        if x[n] == 0.0 and x[n + 1] == 0.0:
            x[n : n + 2] = [hi, lo]
        x[n] = (lag * x[n] + dt * hi) / (lag + dt)  # t_d g' = s - g, backward Euler
        x[n + 1] = (lag * x[n + 1] + dt * lo) / (lag + dt)
        hi, lo = x[n], x[n + 1]
    total = 0.0
    for i in range(n):
        part = [x[i]]
        B = stiffness[i] * time if time is not None else e.damping
        total += kelvin(stiffness[i], B, part, share[i] * lo, share[i] * hi, dp, dt)
        x[i] = part[0]
    return total, dp


def gms(e, x, lo, hi, dp, dt):
    n, way, total = len(e.stiffness), sign(dp), 0.0
    s = hi if dp > 0.0 else -lo
    for i, (k, w) in enumerate(zip(e.stiffness, e.share, strict=True)):
        if way != 0.0 and x[n + i] == way:  # f' = C (w sgn(v) - f/s)
            slope, level = e.attraction / s, e.attraction * w * way
            x[i] = root(lambda f, i=i, a=slope, b=level: f - x[i] - dt * (b - a * f), -1e3, 1e3)
        elif way != 0.0:
            x[i], x[n + i] = x[i] + k * dp, 0.0
            if way * x[i] >= w * s:
                x[i], x[n + i] = way * w * s, way
        total += x[i]
    return total, dp


def smoothed_maxwell_slip(e, x, lo, hi, dp, dt):
    way, s = sign(dp), hi if dp > 0.0 else -lo

    def h(r):
        m = lambda y: 1.0 - tanh(e.sharpness * (y + e.margin)) / 2 + tanh(e.sharpness * (y - e.margin)) / 2  # noqa: E731
        g = lambda y: (1.0 + tanh(e.reversal * y)) / 2  # noqa: E731
        return m(r) * g(r) / (m(1.0) * g(1.0))

    for i, (k, w) in enumerate(zip(e.stiffness, e.share, strict=True)):
        if way:
            bound = w * s
            r, path = way * x[i] / bound, k * abs(dp) / bound
            x[i] = way * bound * root(lambda u, r=r, path=path: u - r - path * (1.0 - h(u) * u), -9.0, 9.0)
    return sum(x[: len(e.stiffness)]), dp


def leuven(e, x, lo, hi, dp, dt):
    way, s, n = sign(dp), hi if dp > 0.0 else -lo, len(e.stiffness)

    def pulled(dz):
        return [
            min(max(x[i] + k * dz, w * lo), w * hi)
            for i, (k, w) in enumerate(zip(e.stiffness, e.share, strict=True))
        ]

    dz = 0.0
    if way:

        def residual(u):
            F = way * sum(pulled(way * u)) / s
            return u - abs(dp) * (1.0 - copysign(abs(F) ** e.sharpness, F))

        dz = way * root(residual, 0.0, 1.0)
    x[:n] = pulled(dz)
    return sum(x[:n]) + e.damping * dz / dt, dp


def reset(e, x, lo, hi, dp, dt):
    before, bound = x[0], hi if dp > 0.0 else lo
    trial = before + e.stiffness * dp
    way = sign(dp)
    if not way and x[0] in (lo, hi):
        return x[0], dp  # it has given, and does not hold again before the joint turns
    if way and way * trial >= way * bound:
        x[0] = bound
        held = way * max(way * (bound - before), 0.0) / e.stiffness  # the path on which it still held
        more = held / dp * e.excess * bound + e.damping * held / dt
        if e.stiffness * abs(dp) < 1e-4 * abs(bound):
            more = e.excess * bound
        return bound + way * min(way * more, way * e.excess * bound), dp
    x[0] = trial
    most = (1.0 + e.excess) * trial + e.damping * dp / dt
    return min(max(most, (1.0 + e.excess) * lo), (1.0 + e.excess) * hi), dp


def bliman_sorine(e, x, lo, hi, dp, dt):
    bound, way = (hi if dp > 0.0 else lo), sign(dp)
    if way:
        for i, scale in enumerate((e.ratio * e.distance, e.distance)):
            x[i] = fine(lambda y, scale=scale: (bound - y) / scale, x[i], abs(dp))
    return (1.0 + e.overshoot) * x[0] - e.overshoot * x[1], dp


def dahl(e, x, lo, hi, dp, dt):
    s, way = (hi if dp > 0.0 else -lo), sign(dp)
    x[0] = fine(lambda f: e.stiffness * (way - f / s), x[0], abs(dp)) if way else x[0]
    return x[0], dp


def maxwell_slip(e, x, lo, hi, dp, dt):
    n = len(e.stiffness)
    x[:n] = [min(max(f + k * dp, w * lo), w * hi) for f, k, w in zip(x, e.stiffness, e.share, strict=False)]
    return sum(x[:n]), dp


def dead_zone(e, x, lo, hi, dp, dt):
    inside = abs(dp) <= e.threshold * dt
    return (0.0, 0.0) if inside else (hi if dp > 0.0 else lo, dp)


STEPS = {
    Rigid: lambda e, x, lo, hi, dp, dt: (hi if dp > 0.0 else lo if dp < 0.0 else 0.0, dp),
    DeadZone: dead_zone,
    Dahl: dahl,
    BlimanSorine: bliman_sorine,
    ResetIntegrator: reset,
    LuGre: lugre,
    Elastoplastic: elastoplastic,
    HaywardArmstrong: lambda e, x, *rest: slider(e.stiffness, 0.0, x, *rest),
    Decaying: lambda e, x, *rest: slider(e.stiffness, e.decay_rate, x, *rest),
    ViscoElastoplastic: xiong_kikuuwe,
    XiongKikuuwe: xiong_kikuuwe,
    XiongKikuuweMulti: xiong_kikuuwe,
    MaxwellSlip: maxwell_slip,
    Leuven: leuven,
    GMS: gms,
    SmoothedMaxwellSlip: smoothed_maxwell_slip,
}
CARRIERS = {
    "sides": CoulombViscous(
        coulomb_positive=5.0, coulomb_negative=3.0, viscous_positive=1.0, viscous_negative=2.0
    ),
    "curve": StribeckGauss(coulomb=4.0, breakaway=6.0, stribeck_velocity=0.05, viscous=1.0),
    "small": CoulombViscous(coulomb_positive=1.0, coulomb_negative=0.5),
    "falls": Polyline(velocity=(0.05, 0.2, 0.9), positive=(6.0, 4.0, 5.0), negative=(3.0, 2.5, 2.3)),
}


def motion(dt):
    """Creeping, break-away, sliding, reversals of many sizes, rests, on the way back too, (n,)."""
    generator = np.random.default_rng(3)
    some = np.repeat(generator.standard_normal(14), 4) * 10.0 ** np.repeat(
        generator.uniform(-2.3, 0.7, 14), 4
    )
    some = np.r_[np.full(6, 0.11), some, 0.0, 0.0, np.full(8, 0.9), -0.05, 0.0, np.full(5, -0.3)]
    return 4e-4 * some * (dt / 1e-3) ** 0.5


@pytest.mark.parametrize("carrier", CARRIERS)
@pytest.mark.parametrize("name", sorted(ELEMENTS))
def test_every_element_is_its_printed_equation(name, carrier):
    element, rate = ELEMENT_EXAMPLES[name], CARRIERS[carrier]
    for dt in (1e-3, 4e-3):
        dp, x, expected = motion(dt), [0.0] * 64, []
        for step in dp.tolist():
            v = step / dt
            up, down, viscous = by_formula(rate, v, (0.0, 0.0), 20.0)
            slides = type(element) in (DeadZone, HaywardArmstrong, Decaying)
            if viscous * v < 0.0 and not (slides or type(element) is Rigid):  # it narrows the bounds
                weaker = min(abs(viscous), up if v > 0.0 else down)
                up, down = (up - weaker, down) if v > 0.0 else (up, down - weaker)
                viscous += copysign(weaker, v)
            f, slid = STEPS[type(element)](element, x, -down, up, step, dt)
            if slides:
                viscous = by_formula(rate, slid / dt, (0.0, 0.0), 20.0)[2]
            expected.append(f + viscous)
        got = follow(Law(rate=rate, element=element), dp, dt)
        assert got == pytest.approx(np.array(expected), rel=1e-7, abs=1e-8)


@pytest.mark.parametrize("speed", [0.01, 0.05, 0.1, 0.15])
def test_the_damping_of_a_bristle_fades_as_the_square_of_speed(speed):
    """From rest over one tick: sigma_0 z + sigma_1 exp(-(v/v_d)^2) z', z = dp/(1 + sigma_0 dp/F)."""
    F, K, sigma_1, v_d, dt = 5.0, 1e4, 30.0, 0.06, 1e-3
    rate = CoulombViscous(coulomb_positive=F, coulomb_negative=F)
    for cls in (LuGre, Elastoplastic):
        torque = {
            fading: follow(
                Law(rate=rate, element=cls(stiffness=K, damping=sigma_1, fading=fading)), [speed * dt], dt
            )[0]
            for fading in (0.0, v_d)
        }
        z = follow(Law(rate=rate, element=cls(stiffness=K)), [speed * dt], dt)[0] / K
        assert torque[0.0] == pytest.approx(K * z + sigma_1 * z / dt)
        assert torque[v_d] == pytest.approx(K * z + sigma_1 * exp(-((speed / v_d) ** 2)) * z / dt)
        if cls is LuGre:
            assert z == pytest.approx(speed * dt / (1.0 + K * speed * dt / F))


def test_slipping_elements_are_attracted_by_the_rate_law_at_their_own_pace():
    """At constant speed after the bound has fallen from s_0 to s: f = s + (s_0 - s) exp(-C t/s), sum w = 1."""
    rate = StribeckGauss(coulomb=4.0, breakaway=6.0, stribeck_velocity=0.05)
    C, dt, v = 80.0, 1e-5, 0.06
    law = Law(rate=rate, element=GMS(stiffness=(1e4, 1e3), share=(0.7, 0.3), attraction=C))
    slow, fast = np.full(4000, 1e-4 * 0.05), np.full(6000, v * dt)
    torque = follow(law, np.r_[slow, fast], dt)
    s_0, s = torque[3999], 4.0 + 2.0 * exp(-((v / 0.05) ** 2))
    assert s_0 == pytest.approx(4.0 + 2.0 * exp(-((5e-6 / dt / 0.05) ** 2)), rel=1e-6)
    t = dt * np.arange(1, 6001)
    assert torque[4000:] == pytest.approx(s + (s_0 - s) * np.exp(-C * t / s), rel=2e-4)


def test_an_elements_state_and_advice_are_counted():
    counts = {
        "none": 0, "dead-zone": 0, "dahl": 1, "bliman-sorine": 2, "reset-integrator": 1, "lugre": 1, "elastoplastic": 1,
        "hayward-armstrong": 1, "visco-elastoplastic": 1, "xiong-kikuuwe": 3, "xiong-kikuuwe-multi": 5, "decaying": 1,
        "maxwell-slip": 3, "leuven": 3, "gms": 6, "smoothed-maxwell-slip": 3,
    }  # fmt: skip
    assert {name: e.states() for name, e in ELEMENT_EXAMPLES.items()} == counts
    flat = CoulombViscous(coulomb_positive=4.0, coulomb_negative=4.0)
    for name in ("bliman-sorine", "gms", "lugre", "elastoplastic"):
        assert ELEMENT_EXAMPLES[name].advice(flat) == ""
    assert "may create energy" in ELEMENT_EXAMPLES["bliman-sorine"].advice(CARRIERS["curve"])
    assert "create a little energy" in ELEMENT_EXAMPLES["gms"].advice(CARRIERS["curve"])


def test_the_bounds_on_a_bristles_damping_are_barabanovs_and_the_faded_one():
    """sigma_2 >= sigma_1 (F_s - F_c)/F_c, or v_d <= 4 sqrt(2 e) F_c/sigma_1."""
    sigma_1, F_c, F_s = 30.0, 4.0, 6.0
    needed, fades = sigma_1 * (F_s - F_c) / F_c, 4.0 * np.sqrt(2.0 * np.e) * F_c / sigma_1
    for viscous, fading, fine_ in (
        (1.0001 * needed, 0.0, True), (0.9999 * needed, 0.0, False), (0.0, 0.9999 * fades, True),
        (0.0, 1.0001 * fades, False), (0.0, 0.0, False),
    ):  # fmt: skip
        rate = StribeckGauss(coulomb=F_c, breakaway=F_s, stribeck_velocity=0.05, viscous=viscous)
        assert (LuGre(stiffness=1e4, damping=sigma_1, fading=fading).advice(rate) == "") is fine_


def test_a_leaking_spring_that_does_not_hold_what_the_viscous_part_takes_off_is_said():
    """min(F, K v/alpha) + viscous(v) < 0 with viscous = -k v: from K/alpha < k on."""
    falls = Polyline(
        velocity=(1.0, 2.0), positive=(3.0, 2.0), negative=(3.0, 2.0)
    )  # F = 4 - v, below 4 rad/s
    stiff, soft = Decaying(stiffness=1e4, decay_rate=20.0), Decaying(stiffness=10.0, decay_rate=20.0)
    rising = CoulombViscous(coulomb_positive=4.0, coulomb_negative=4.0, viscous_positive=1.0)
    assert soft.advice(rising) == ""
    assert "subtracts" in soft.advice(falls)
    assert "at the velocity" in stiff.advice(falls)  # beyond 8 rad/s, where the line has fallen below -4


def dahl_from_rest(v, dt):
    """Torque of Dahl's bristle under `sides` after one tick from rest."""
    F = 5.0 if v > 0.0 else -3.0
    return F * (1.0 - exp(-1e4 * v * dt / F)) + by_formula(CARRIERS["sides"], v, (0.0, 0.0), 20.0)[2]


def test_a_held_mass_moves_as_the_bisected_balance_says():
    """v + dt/m f(v dt) = v_free, f of a law by its equation: here of a rigid Stribeck curve and of Dahl's bristle."""
    rate, soft, dt = CARRIERS["curve"], 2e-3, 1e-3
    law, bristle = Law(rate=rate), Law(rate=CARRIERS["sides"], element=Dahl(stiffness=1e4))
    for v_free in (0.013, -0.02, 0.3, -1.5, 0.0119, -0.0121, 0.0):
        got = kernels.solve(rate.KIND, 0, law.row(), law.state(), v_free, dt, soft, (0.0, 0.0), 20.0)
        held, a = abs(v_free) <= soft * 6.0, abs(v_free)

        def rigid(v, a=a):
            F, _, viscous = by_formula(rate, v, (0.0, 0.0), 20.0)
            return v + soft * (F + viscous) - a

        def presliding(v, v_free=v_free):
            return v + soft * dahl_from_rest(v, dt) - v_free

        wanted = 0.0 if held else root(rigid, 0.0, 9.0)
        assert got == pytest.approx(copysign(wanted, v_free), rel=1e-9, abs=1e-12)
        got = kernels.solve(0, 2, bristle.row(), bristle.state(), v_free, dt, soft, (0.0, 0.0), 20.0)
        assert got == pytest.approx(root(presliding, -9.0, 9.0), rel=1e-8, abs=1e-12)
    assert isnan(kernels.solve(rate.KIND, 0, law.row(), law.state(), inf, dt, soft, (0.0, 0.0), 20.0))


def test_what_weakens_with_speed_narrows_the_bounds_under_an_element_without_slider():
    """Sliding at v = 2 on F = 4 - v: a bristle carries 2 at most, and no viscous part is added to it."""
    falls = Polyline(velocity=(1.0, 2.0), positive=(3.0, 2.0), negative=(3.0, 2.5))
    law = Law(rate=falls, element=MaxwellSlip(stiffness=(1e3,), share=(1.0,)))
    for v, expected in ((2.0, 2.0), (-2.0, -2.5), (5.0, -1.0 + 0.0), (1.0, 3.0)):
        torque = follow(law, np.full(40, v * 1e-2), 1e-2)
        assert torque[-1] == pytest.approx(expected, abs=1e-9)


# ------------------------------------------------------------------------------------------ parameters


@pytest.mark.parametrize("cls", [*RATES.values(), *ELEMENTS.values()], ids=lambda c: c.NAME)
def test_bounds_of_parameters_belong_to_what_is_admitted(cls):
    example = (RATE_EXAMPLES | ELEMENT_EXAMPLES)[cls.NAME]
    for name, parameter in cls.PARAMETERS.items():
        if parameter.many:
            continue
        for bound, beyond in ((parameter.lower, -1.0), (parameter.upper, 1.0)):
            if np.isfinite(bound):
                assert getattr(replace(example, **{name: bound}), name) == bound
                with pytest.raises(InvalidInput, match=f"'{name}'"):
                    replace(example, **{name: bound + beyond * max(1e-9 * abs(bound), 1e-300)})
        for wild in (np.nan, np.inf, [1.0, 2.0], None):
            with pytest.raises((InvalidInput, TypeError)):
                replace(example, **{name: wild})


def test_what_is_not_given_is_not_there():
    neutral = {
        "exponent": {"stribeck-tustin": 1.0, "degressive": 0.5, "m2": 1.0, "m4": 1.0, "m5": 1.0, "m6": 1.0,
                     "load-temperature": 1.3},
        "stribeck_velocity": 1.0, "stribeck_velocity_load": 1.0, "thinning": 20.0, "ratio": 0.5, "overshoot": 0.5, "elastic": 0.7,
        "decay_rate": 20.0, "margin": 0.95, "reversal": 10.0,
        "sharpness": {"leuven": 2.0, "smoothed-maxwell-slip": 100.0}, "damping": {"xiong-kikuuwe": 1.0},
    }  # fmt: skip
    for cls in (*RATES.values(), *ELEMENTS.values()):
        for name in cls.PARAMETERS:
            if hasattr(cls, name) and not callable(getattr(cls, name)):
                wanted = neutral.get(name, 0.0)
                wanted = wanted.get(cls.NAME, 0.0) if isinstance(wanted, dict) else wanted
                assert getattr(cls, name) == wanted, (cls.NAME, name)


def test_units_of_parameters_for_a_rotary_and_a_linear_joint():
    def unit(cls, name, joint):
        return cls.PARAMETERS[name].unit_for(joint)

    assert unit(Dahl, "stiffness", "rad") == "N.m/rad"
    assert unit(Dahl, "stiffness", "m") == "N/m"
    assert unit(M6, "quadratic_motor", "rad") == "1/(N.m)"
    assert unit(M6, "quadratic_motor", "m") == "1/N"
    assert unit(StribeckTustin, "viscous", "rad") == "N.m.s/rad"
    assert unit(StribeckTustin, "stribeck_velocity", "m") == "m/s"
    assert unit(LoadTemperature, "stribeck_temperature", "rad") == "N.m/degC"


def test_shares_and_knots_are_checked():
    many = {"stiffness": (1e4, 1e3), "share": (0.6, 0.4)}
    for wrong in (
        {"share": (0.6, 0.4 + 2e-6)}, {"share": (0.6,)}, {"share": (1.0,)}, {"stiffness": ()},
        {"stiffness": (1.0,) * 33, "share": (1.0 / 33,) * 33},
    ):  # fmt: skip
        with pytest.raises(InvalidInput):
            MaxwellSlip(**many | wrong)
    assert MaxwellSlip(stiffness=(1.0,) * 32, share=(1.0 / 32,) * 32).states() == 32
    assert MaxwellSlip(**many | {"share": (0.6, 0.4 + 0.9e-6)}).share[1] > 0.4
    for V, up, down in (((1.0, 1.0), (1.0, 2.0), (1.0, 2.0)), ((1.0, 2.0), (1.0,), (1.0, 2.0)), ((), (), ())):
        with pytest.raises(InvalidInput):
            Polyline(velocity=V, positive=up, negative=down)


def test_the_peak_of_bliman_and_sorines_break_away_is_the_printed_one():
    """F (1 + b (1 - eta) r^(-eta/(1 - eta))), r = (1 + b)/(eta b), after e eta/(1 - eta) ln r."""
    e = ELEMENT_EXAMPLES["bliman-sorine"]
    r = (1.0 + e.overshoot) / (e.ratio * e.overshoot)
    peak = 1.0 + e.overshoot * (1.0 - e.ratio) * r ** (-e.ratio / (1.0 - e.ratio))
    at = e.distance * e.ratio / (1.0 - e.ratio) * np.log(r)
    dp = np.full(6000, 1e-6)
    torque = follow(Law(rate=CoulombViscous(coulomb_positive=5.0, coulomb_negative=5.0), element=e), dp, 1e-3)
    assert torque.max() == pytest.approx(5.0 * peak, rel=1e-6)
    assert 1e-6 * (torque.argmax() + 1) == pytest.approx(at, abs=1e-6)
