"""Identification against closed forms, brute force and textbook quantiles."""

import numpy as np
import pytest
from scipy import stats

from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.identification import curves, regression, robust, sweep_delay
from backdrive.identification.function_a import _curvature, _within, correct_pairs
from backdrive.identification.load_fit import growth, payload_growth
from backdrive.identification.regression import long_run
from backdrive.identification.signals import default_cutoff, prepare
from backdrive.identification.sweep import find_windows, sweep_knots
from backdrive.identification.sweep_equations import ALL, GRAVITY, equations
from backdrive.identification.sweep_fit import fit
from backdrive.identification.sweep_knots import SweepKnots, sort_knots
from backdrive.identification.sweep_payload import identify_payload
from backdrive.identification.sweep_windows import Windows, windows
from backdrive.identification.timing import torque_timing
from backdrive.logs.log import Joint, Log
from backdrive.model.covariance import errors_by_parameter
from backdrive.plans import Sweep

A, V = np.deg2rad(20), 2.0
PLAN = Sweep(A, V, 6)
F = (9.0, 3.0)  # N.m, N.m.s/rad


def friction(v, load=0.0, mu=0.0):
    return np.sign(v) * (F[0] + mu * np.abs(load)) + F[1] * v


def made(late, *, plan=PLAN, rate=500.0, inertia=1.6, gravity=(0.0, 0.0), mu=0.0, noise=0.0, seed=0):
    """Return a log in closed form: the torque of a sample is that of an instant `late` after it."""
    t = np.arange(0.0, plan.start + plan.duration, 1.0 / rate)
    q, v, a = plan.position(t + late), plan.velocity(t + late), plan.acceleration(t + late)
    g = gravity[0] * np.sin(q) + gravity[1] * np.cos(q)
    torque = inertia * a + g + friction(v, g + inertia * a, mu)
    torque += noise * np.random.default_rng(seed).standard_normal(t.size)
    return Log(time=t, joints=(Joint(name="a"),), position=plan.position(t), torque=torque, plan=plan)


def delay_of(log):
    s = prepare(log, 0)
    return sweep_delay.sweep_delay(s, windows(log, 0, log.plan, s))


# ------------------------------------------------------------------------------------- the drive's delay


@pytest.mark.parametrize("delay", [-1e-3, 0.4e-3, 2e-3, 5e-3, 11e-3])
def test_the_delay_of_a_drive_is_found_to_a_few_percent(delay):
    """From the middle of a command's interval: a torque sampled with the position has -T/2."""
    found, error = delay_of(made(0.5 / 500.0 + delay))
    assert found == pytest.approx(delay, rel=0.015, abs=1e-5)
    assert error < 2e-4


def test_the_error_of_the_delay_is_what_noise_does_to_it():
    delays, errors = np.array([delay_of(made(3e-3, noise=1.0, seed=k)) for k in range(20)]).T
    assert np.mean(delays) == pytest.approx(2e-3, abs=3 * delays.std() / np.sqrt(20))
    # 20 draws know a scatter to 16 %
    assert delays.std(ddof=1) / np.sqrt(np.mean(errors**2)) == pytest.approx(1.0, abs=0.35)


def by_hand(log):
    """Growth with the load over its standard error, by a regression on the wanted motion written out, and Newey-West sums.

    Four rounds: the torque is shifted by the delay that was found, the load is that of the round before.
    """
    (s,) = prepare(log, 0)
    cycles = windows(log, 0, log.plan, [s])
    slow, fast = cycles.peak.min(), cycles.peak.max()
    knots = np.concatenate([[0.3 * slow], np.linspace(slow, fast, 2 * cycles.peak.size - 1)])
    length = np.min(np.diff(cycles.time, axis=1))
    rows, real, wanted, edges = sweep_delay._part(s, cycles, 6.5 / length)

    def hat(v):
        x = np.abs(v)
        columns = np.empty((x.size, knots.size))
        for i in range(knots.size):
            columns[:, i] = np.interp(x, knots, np.eye(knots.size)[i])
        first, last = x < knots[0], x > knots[-1]
        for part, k in ((first, 0), (last, knots.size - 2)):  # the outer sections go on
            w = (x[part] - knots[k]) / (knots[k + 1] - knots[k])
            columns[part] = 0.0
            columns[part, k], columns[part, k + 1] = 1.0 - w, w
        return np.hstack([columns * (v > 0)[:, None], -columns * (v < 0)[:, None]])

    def matrix(motion, theta):
        q, v, a, j = motion
        X = np.column_stack([a, -j, np.sin(q), np.cos(q), hat(v)])
        if theta is None:
            return X
        load = theta[0] * a + theta[2] * np.sin(q) + theta[3] * np.cos(q)
        return np.column_stack([X, np.sign(v) * np.abs(load), np.sign(v) * np.sign(load) * a])

    theta, delay = None, 0.0
    for _ in range(4):
        y = np.interp(np.arange(s.time.size) - 0.5 - delay * s.rate, np.arange(s.time.size), s.torque)[rows]
        X, Z = matrix(real, theta), matrix(wanted, theta)
        size = np.linalg.norm(Z, axis=0)
        theta = np.linalg.solve((Z / size).T @ (X / size), (Z / size).T @ y) / size
        delay -= theta[1] / theta[0]
    left = y - X @ theta
    bread, meat = np.linalg.inv((Z / size).T @ (X / size)) / np.outer(size, size), 0.0
    for a, b in edges:
        z = Z[a:b] * left[a:b, None]
        lags = int(np.sqrt(b - a))
        meat = meat + z.T @ z
        for lag in range(1, lags + 1):
            product = z[lag:].T @ z[:-lag]
            meat = meat + (1.0 - lag / (lags + 1.0)) * (product + product.T)
    error = np.sqrt(np.diag(bread @ meat @ bread.T))
    return theta[-2] / error[-2], delay


def test_growth_with_the_load_is_taken_from_four_standard_errors_on():
    """Noise from 1.6 to 2.8 N.m brings the growth from six to three of its standard errors, as counted by hand."""
    plan, seen = Sweep(A, V, 6, center=0.6), {}
    for noise in (1.6, 1.9, 2.05, 2.15, 2.3, 2.45, 2.5, 2.65, 2.7):
        log = made(2e-3, plan=plan, gravity=(12.0, 5.0), mu=0.03, noise=noise, seed=3)
        s = prepare(log, 0)
        cycles = windows(log, 0, plan, s)
        length = np.min(np.diff(cycles.time, axis=1))
        slow, fast = cycles.peak.min(), cycles.peak.max()
        knots = np.concatenate([[0.3 * slow], np.linspace(slow, fast, 2 * cycles.peak.size - 1)])
        delay, _, grows = sweep_delay._solve(s, [sweep_delay._part(s[0], cycles, 6.5 / length)], knots, True)
        ratio, by_rounds = by_hand(log)
        assert delay == pytest.approx(by_rounds, rel=1e-4)
        seen[ratio] = grows
    assert any(3.3 < r < 3.75 for r in seen) and any(4.25 < r < 4.7 for r in seen), sorted(seen)
    clear = {
        r: grows for r, grows in seen.items() if abs(r - 4.0) > 0.25
    }  # the two ways of errors differ by some percent
    assert len(clear) >= 4
    assert {r: r > 4.0 for r in clear} == clear


# ------------------------------------------------------------------------------------------ FunctionA


def test_the_error_of_a_pair_is_what_white_noise_does_to_a_short_window():
    """About 25 samples a window, of which some 9 are lost: without the correction errors would be a fifth too small."""
    plan = Sweep(A, V, 6)
    known, found = [], []
    for seed in range(120):
        log = made(0.0, plan=plan, rate=120.0, noise=0.7, seed=seed)
        knots = sweep_knots(log, 0, delay=-0.5 / 120.0)  # sampled, so that nothing is averaged
        found.append(np.r_[knots.F_pos, knots.F_neg])
        known.append(np.r_[knots.error_pos, knots.error_neg])
    scatter = np.std(found, axis=0, ddof=1)
    stated = np.sqrt(np.mean(np.square(known), axis=0))
    # inertia and curvature are shared; 120 draws know each scatter to 6.5 %, twelve of them together to 2 to 3 %
    student = (
        stats.t.ppf(0.99865, 16 + 10 - 2) / 3.0
    )  # 16 samples a window, and 10 of all windows, less a line
    assert np.sqrt(np.mean((student * scatter / stated) ** 2)) == pytest.approx(1.0, abs=0.08)


def test_curvature_is_exact_for_a_parabola_through_three_and_through_five():
    x = np.array([0.2, 0.5, 0.9, 1.2, 1.6, 2.1])
    for y, second in ((1.0 + x - 0.7 * x**2, -1.4), (2.0 * x, 0.0)):
        assert _curvature(x, y, np.full(6, 0.1)) @ y == pytest.approx(np.full(6, second), abs=1e-9)
    holes = np.array([0.2, 0.5, np.nan, 1.2, 1.6, 2.1])
    row = _curvature(x, 1.0 + x - 0.7 * holes**2, np.full(6, 0.1))
    good = np.isfinite(holes)
    assert (row @ np.where(good, 1.0 + x - 0.7 * x**2, 0.0))[good] == pytest.approx(np.full(5, -1.4))
    assert not row[2].any()
    sharp = np.array([9.0, 1.0, 1.0, 1.0, 1.0, 1.0])  # five smear the corner, three do not
    bend = _curvature(x, sharp, np.full(6, 1e-3)) @ sharp
    three = (
        2.0 * ((sharp[2] - sharp[1]) / (x[2] - x[1]) - (sharp[1] - sharp[0]) / (x[1] - x[0])) / (x[2] - x[0])
    )
    assert bend[:2] == pytest.approx([three, three])
    assert not _curvature(x[:2], x[:2], np.ones(2)).any()
    assert not _curvature(np.array([1.0, 1.0001, 2.0]), np.ones(3), np.ones(3)).any()
    for apart, bends in ((0.019, False), (0.021, True)):  # a hundredth of the top speed
        assert _curvature(np.array([0.5, 0.5 + apart, 2.0]), np.ones(3), np.ones(3)).any() == bends


def test_inside_a_window_only_the_acceleration_along_a_cubic_is_kept():
    n = 80
    t = np.linspace(3.0, 3.4, n)
    generator = np.random.default_rng(4)
    v = 2.0 - (t - 3.2) ** 2 + 0.01 * generator.standard_normal(n)
    z = generator.standard_normal((3, n)) + 5.0
    got = _within(z.copy(), v, t)
    base = np.column_stack([np.ones(n), v])
    free = lambda y: y - base @ np.linalg.lstsq(base, y, rcond=None)[0]  # noqa: E731
    s = t - t.mean()
    basis = np.column_stack([free(s), free(s**3)])
    assert got[0] == pytest.approx(free(z[0]), abs=1e-9)
    assert got[2] == pytest.approx(free(z[2]), abs=1e-9)
    assert got[1] == pytest.approx(basis @ np.linalg.lstsq(basis, free(z[1]), rcond=None)[0], abs=1e-7)


def test_pairs_of_a_straight_line_under_gravity_are_exact():
    plan = Sweep(A, V, 6, center=0.7)
    log = made(0.5e-3, plan=plan, rate=1000.0, gravity=(6.0, 14.0))
    s = prepare(log, 0)
    knots = correct_pairs(s, windows(log, 0, plan, s), rotary=True)
    g = 6.0 * np.sin(knots.center) + 14.0 * np.cos(knots.center)
    assert knots.center == pytest.approx(0.7, abs=1e-3)
    assert knots.F_pos == pytest.approx(9.0 + 3.0 * knots.V_pos + g * knots.level, abs=4e-3)
    assert knots.F_neg == pytest.approx(9.0 + 3.0 * knots.V_neg - g * knots.level, abs=4e-3)
    assert knots.inertia[0] == pytest.approx(1.6, rel=1e-3)
    assert knots.slope[0] == pytest.approx(6.0 * np.cos(0.7) - 14.0 * np.sin(0.7), rel=1e-2)
    inside = (s[0].velocity >= 0.8 * 2.0) & (s[0].time >= plan.windows()[-1][0])
    assert knots.count_pos[-1] == pytest.approx(inside.sum(), abs=1)
    assert knots.V_pos[-1] == pytest.approx(s[0].velocity[inside].mean(), rel=1e-4)


# -------------------------------------------------------------------------------------- the equations


def knots_at(
    center,
    up,
    down,
    *,
    speeds=(0.5, 1.0, 1.5, 2.0),
    error=0.05,
    level=0.98,
    slope=None,
    inertia=0.0,
    swing=0.0,
):
    """Pairs of one sweep about a center, friction `up` and `down` functions of speed, the torque of gravity in them."""
    x = np.array(speeds)
    return SweepKnots(
        V_pos=x, V_neg=x * 1.01, F_pos=up(x), F_neg=down(x * 1.01), error_pos=np.full(x.size, error),
        error_neg=np.full(x.size, 1.3 * error), count_pos=np.full(x.size, 50), count_neg=np.full(x.size, 40), center=center,
        level=level, swing=np.full(x.size, swing), inertia=(inertia, 0.01), slope=slope or (np.nan, np.nan),
    )  # fmt: skip


GRAV = np.array([7.0, 20.0])


def loaded_knots(centers, mu=0.0, c=0.4, payload=(0.0, 0.0), level=0.98, mu_b=None, **more):
    """F_p = 9 + 3 v + c, F_n = 9 + 3 v - c, gravity 7 sin q + 20 cos q, friction growing with it."""
    mu_b = mu if mu_b is None else mu_b
    found = []
    for q in centers:
        weight = GRAV + np.array(payload)
        g = level * (weight @ [np.sin(q), np.cos(q)])
        lifting, driven = (mu, mu_b) if g > 0.0 else (mu_b, mu)
        up = lambda v, g=g, m=lifting: 9.0 + 3.0 * v + c + m * abs(g) + g  # noqa: E731
        down = lambda v, g=g, m=driven: 9.0 + 3.0 * v - c + m * abs(g) - g  # noqa: E731
        slope = GRAV @ [np.cos(q), -np.sin(q)]
        found.append(knots_at(q, up, down, level=level, slope=(slope, 0.2), **more))
    return found


def test_the_equations_of_pairs_solved_by_hand():
    knots = loaded_knots((-1.0, 0.1, 1.2))
    eqs = equations(knots)
    assert pytest.approx(1.005 * np.array([0.5, 1.0, 1.5, 2.0])) == eqs.V
    theta, covariance = eqs.solve("own", GRAVITY)
    assert theta[:8] == pytest.approx(np.r_[9.4 + 3.0 * eqs.V, 8.6 + 3.0 * eqs.V], abs=1e-8)
    assert theta[8:] == pytest.approx([7.0, 20.0, 0.0, 0.0], abs=1e-8)
    rows, weights = [], []  # written out: torque of a side, hat functions that go on beyond the outer knots
    for k in knots:
        for sign, speed, error in ((1.0, k.V_pos, k.error_pos), (-1.0, k.V_neg, k.error_neg)):
            for v, e in zip(speed, error, strict=True):
                i = int(np.clip(np.searchsorted(eqs.V, v, side="right") - 1, 0, 2))
                w = (v - eqs.V[i]) / (eqs.V[i + 1] - eqs.V[i])
                row = np.zeros(10)
                row[(0 if sign > 0 else 4) + i], row[(0 if sign > 0 else 4) + i + 1] = (
                    sign * (1.0 - w),
                    sign * w,
                )
                row[8:] = k.level * np.sin(k.center), k.level * np.cos(k.center)
                rows.append(row)
                weights.append(1.0 / e)
    condition = np.linalg.cond(np.array(rows))
    for k in knots:
        rows.append(np.r_[np.zeros(8), np.cos(k.center), -np.sin(k.center)])
        weights.append(1.0 / 0.2)
    X = np.array(rows) * np.array(weights)[:, None]
    assert covariance[:10, :10] == pytest.approx(np.linalg.inv(X.T @ X), rel=1e-6, abs=1e-12)
    assert eqs.condition("own", GRAVITY) == pytest.approx(condition, rel=1e-9)
    balanced, _ = eqs.solve("balanced", (*GRAVITY, "offset"))
    assert np.sum(balanced[:4] - balanced[4:8]) == pytest.approx(0.0, abs=1e-9)
    equal, _ = eqs.solve("equal", (*GRAVITY, "offset"))
    assert equal[:4] == pytest.approx(9.0 + 3.0 * eqs.V, abs=1e-8) and equal[10] == pytest.approx(
        0.4, abs=1e-8
    )
    assert eqs.determines("equal", (*GRAVITY, "offset"))
    assert not equations(knots[:1]).determines("own", (*GRAVITY, "offset"))
    assert ALL == ("gravity_sin", "gravity_cos", "offset", "load_dependence")


def test_the_mean_size_of_a_load_that_swings():
    eqs = equations(loaded_knots((0.3,), inertia=2.0, swing=3.0))  # a torque of inertia between -6 and 6
    for g in (0.0, 2.5, -5.9, 6.0, -9.0):
        even = np.linspace(-6.0, 6.0, 200001)
        assert eqs.load(np.full(8, g)) == pytest.approx(np.full(8, np.mean(np.abs(g + even))), abs=1e-4)


@pytest.mark.parametrize("mu", [0.05, 0.12])
def test_growth_with_gravity_is_found_from_the_postures(mu):
    knots = loaded_knots((-1.9, -0.4, 0.8, 1.6), mu=mu, error=1e-3)
    eqs = equations(knots)
    theta, _ = eqs.solve("own", GRAVITY)
    found = growth(eqs, "own", GRAVITY, theta)
    assert found is not None
    assert found.slope[0] == pytest.approx(mu, rel=1e-3)
    assert found.gravity == pytest.approx(GRAV, rel=1e-3)
    sizes = [0.98 * abs(GRAV @ [np.sin(q), np.cos(q)]) for q in (-1.9, -0.4, 0.8, 1.6)]
    assert found.carried == pytest.approx(np.mean(sizes), rel=1e-3)
    whole = fit(knots, unit="rad", name="a")
    assert whole.load is not None and whole.load[0] == pytest.approx(mu, rel=1e-3)
    at = 9.4 + mu * np.mean(sizes)  # the law is that under the gravity carried
    assert whole.law.positive == pytest.approx(tuple(at + 3.0 * np.array(whole.law.velocity)), rel=1e-3)


def test_growth_needs_four_standard_errors_and_a_hundredth_of_the_friction():
    for error, said in ((1e-3, True), (2.0, False)):
        eqs = equations(loaded_knots((-1.9, -0.4, 0.8, 1.6), mu=0.05, error=error))
        assert (growth(eqs, "own", GRAVITY, eqs.solve("own", GRAVITY)[0]) is not None) is said
    for target, said in ((4.2, True), (3.8, False)):
        low, high = 1e-3, 2.0  # of the torques' errors: the growth in its standard errors falls with them
        for _ in range(60):
            error = np.sqrt(low * high)
            eqs = equations(loaded_knots((-1.9, -0.4, 0.8, 1.6), mu=0.05, error=error))
            theta, covariance = eqs.with_load_growth(GRAV).solve("own", (*GRAVITY, "load_dependence"))
            low, high = (error, high) if theta[-1] > target * np.sqrt(covariance[-1, -1]) else (low, error)
        assert (growth(eqs, "own", GRAVITY, eqs.solve("own", GRAVITY)[0]) is not None) is said
    for scale, said in ((0.92, False), (1.08, True)):
        sizes = [0.98 * abs(GRAV @ [np.sin(q), np.cos(q)]) for q in (-1.9, -0.4, 0.8, 1.6)]
        level = 9.0 + 3.0 * 1.005 * 1.25  # mean friction without load
        mu = scale * 0.01 * level / np.ptp(sizes)
        eqs = equations(loaded_knots((-1.9, -0.4, 0.8, 1.6), mu=mu, error=1e-5))
        assert (growth(eqs, "own", GRAVITY, eqs.solve("own", GRAVITY)[0]) is not None) is said


def test_a_known_payload_tells_lifting_from_being_driven_back():
    centers, extra = (-1.2, 0.3, 1.4), (3.0, 9.0)
    knots = loaded_knots(centers, 0.08, mu_b=0.03) + loaded_knots(centers, 0.08, mu_b=0.03, payload=extra)
    found = payload_growth(knots, [(0.0, 0.0)] * 3 + [extra] * 3)
    assert found.driving[0] == pytest.approx(0.08, abs=1e-4)
    assert found.driven[0] == pytest.approx(0.03, abs=1e-4)
    assert found.gravity == pytest.approx(GRAV, rel=1e-3)
    assert found.positive == pytest.approx(9.4 + 3.0 * found.velocity, abs=5e-3)
    assert found.negative == pytest.approx(8.6 + 3.0 * found.velocity, abs=5e-3)
    # written out: torque less the payload's, by the curves, the arm's gravity, growth with the whole load, and what the payload
    # seems to weigh more
    rows, weights = [], []
    delta = 0.5 * (found.driving[0] - found.driven[0])
    for k, p in zip(knots, [(0.0, 0.0)] * 3 + [extra] * 3, strict=True):
        way = np.array([np.sin(k.center), np.cos(k.center)]) * k.level
        for sign, V, error, first in ((1.0, k.V_pos, k.error_pos, 0), (-1.0, k.V_neg, k.error_neg, 4)):
            for v, e in zip(V, error, strict=True):
                row = np.zeros(12)
                row[first : first + 4] = sign * curves.hats(np.array([v]), found.velocity)[0]
                row[8:10], row[10], row[11] = way, sign * abs(way @ (found.gravity + p)), way @ p
                rows.append(row)
                weights.append(1.0 / e)
    X = np.array(rows)
    covariance = np.linalg.inv((X * np.array(weights)[:, None] ** 2).T @ X)
    deviation = np.sqrt(np.diag(covariance))
    assert found.gravity_error == pytest.approx(deviation[8:10] / (1.0 + delta), rel=1e-6)
    assert (found.error_pos, found.error_neg) == (pytest.approx(deviation[:4]), pytest.approx(deviation[4:8]))
    for (_, error), sign in ((found.driving, 1.0), (found.driven, -1.0)):
        assert error == pytest.approx(
            np.sqrt(covariance[10, 10] + covariance[11, 11] + 2.0 * sign * covariance[10, 11])
        )
    assert found.condition == pytest.approx(np.linalg.cond(X / np.linalg.norm(X, axis=0)))
    twice = payload_growth([*(k for k in knots), *(k for k in knots)], ([(0.0, 0.0)] * 3 + [extra] * 3) * 2)
    for name in ("driving", "driven"):
        assert getattr(twice, name)[1] == pytest.approx(getattr(found, name)[1] / np.sqrt(2.0), rel=1e-6)
    assert twice.error_pos == pytest.approx(found.error_pos / np.sqrt(2.0), rel=1e-6)
    with pytest.raises(NotIdentifiable, match="no gear does"):
        payload_growth(knots, [(0.0, 0.0)] * 3 + [(-3.0, -9.0)] * 3)


def test_what_pairs_hold_where_nothing_is_said():
    some = np.ones(2)
    bare = SweepKnots(
        V_pos=some,
        F_pos=some,
        V_neg=some,
        F_neg=some,
        error_pos=some,
        error_neg=some,
        count_pos=some,
        count_neg=some,
    )
    assert (
        bare.level == 1.0 and np.isnan([bare.center, *bare.inertia, *bare.slope]).all() and bare.swing is None
    )


def test_pairs_in_order_by_hand():
    """Merged by their counts, errors as of means, the inertia's swing as of a sine at 0.8 of its peak."""
    knots = SweepKnots(
        V_pos=np.array([1.0, 0.5, 1.002, 2.0, 3.0]), F_pos=np.array([4.0, 2.0, 6.0, 9.0, np.nan]),
        V_neg=np.array([1.0, 0.5, 1.002, 2.0, 3.0]), F_neg=np.array([4.0, 2.0, 6.0, 9.0, 1.0]),
        error_pos=np.array([0.1, 0.2, 0.3, 0.4, 0.1]), error_neg=np.array([0.1, 0.2, 0.3, 0.4, 0.1]),
        count_pos=np.array([10, 10, 30, 10, 9]), count_neg=np.array([10, 10, 10, 10, 9]),
    )  # fmt: skip
    cycles = Windows(time=np.array([[0.0, 2.0], [2.0, 5.0], [5.0, 9.0], [9.0, 10.0], [10.0, 11.0]]), peak=np.arange(1.0, 6.0),
                     from_plan=True)  # fmt: skip
    got = sort_knots(knots, "a", cycles, 0.8)
    assert got.V_pos == pytest.approx([0.5, (10.0 + 30.0 * 1.002) / 40.0, 2.0])
    assert got.F_pos == pytest.approx([2.0, 5.5, 9.0]) and got.F_neg == pytest.approx([2.0, 5.0, 9.0])
    merged = np.hypot(10.0 * 0.1, 30.0 * 0.3) / 40.0  # of a mean weighted by counts
    assert got.error_pos == pytest.approx([0.2, merged, 0.4])
    swing = np.arange(1.0, 6.0) * 2.0 * np.pi * 0.6 / np.array([2.0, 3.0, 4.0, 1.0, 1.0])
    assert got.swing == pytest.approx([swing[1], (10.0 * swing[0] + 30.0 * swing[2]) / 40.0, swing[3]])
    assert pytest.approx([2.0, 5.25, 9.0]) == got.F
    assert got.bias == pytest.approx(np.mean([0.0, 0.25, 0.0]))
    assert got.error[0] == pytest.approx(0.5 * np.hypot(got.error_pos[0], got.error_neg[0]))
    assert "5 (5)" in got.warnings[0] and "1 pairs" in got.warnings[1]


# ----------------------------------------------------------------------------------------- regression


@pytest.mark.parametrize("count", [12, 20, 40, 80])
def test_the_sandwich_is_liang_and_zegers_widened_as_students_distribution(count):
    generator = np.random.default_rng(count)
    n, p = 30 * count, 3
    X = generator.standard_normal((n, p)) * [1.0, 20.0, 0.05]
    y = (
        X @ [1.0, -0.5, 40.0]
        + np.repeat(generator.standard_normal(count), 30)
        + 0.3 * generator.standard_normal(n)
    )
    w = generator.uniform(0.2, 1.0, n)
    blocks = regression.accumulate(X, y, w, regression.block_index(n, count), count)
    theta = regression.solve(blocks.gram.sum(0), blocks.moment.sum(0))
    W = X * w[:, None]
    bread = np.linalg.inv(W.T @ X)
    assert theta == pytest.approx(bread @ W.T @ y, rel=1e-8)
    left = y - X @ theta
    scores = np.array([W[k * 30 : k * 30 + 30].T @ left[k * 30 : k * 30 + 30] for k in range(count)])
    student = stats.t.ppf(0.975, count - 1) / stats.norm.ppf(0.975)
    expected = bread @ scores.T @ scores @ bread * count / (count - 1) * student**2
    assert regression.sandwich(blocks, theta) == pytest.approx(expected, rel=0.03)  # the factor itself to 1 %
    assert regression.sandwich(blocks, theta) / expected == pytest.approx(
        np.full((p, p), (regression.sandwich(blocks, theta) / expected)[0, 0]), rel=1e-6
    )
    assert blocks.power[3] == pytest.approx(w[90:120] @ y[90:120] ** 2)
    assert blocks.rows[3] == pytest.approx(w[90:120].sum())
    assert regression.condition(blocks.gram.sum(0)) == pytest.approx(
        np.linalg.cond(np.sqrt(w)[:, None] * X / np.linalg.norm(np.sqrt(w)[:, None] * X, axis=0)), rel=1e-6
    )


def test_columns_of_very_different_size_are_solved_and_judged_alike():
    """In other units a coefficient and its error are the same in these units."""
    generator = np.random.default_rng(1)
    X = generator.standard_normal((600, 3))
    y = X @ [1.0, -0.5, 2.0] + generator.standard_normal(600)
    unit = np.array([1e6, 1.0, 1e-6])
    index = regression.block_index(600, 20)
    plain, other = (regression.accumulate(Z, y, np.ones(600), index, 20) for Z in (X, X * unit))
    theta, scaled = (regression.solve(b.gram.sum(0), b.moment.sum(0)) for b in (plain, other))
    assert scaled * unit == pytest.approx(theta, rel=1e-6)
    wanted = regression.sandwich(plain, theta)
    assert regression.sandwich(other, scaled) * np.outer(unit, unit) == pytest.approx(wanted, rel=1e-6)
    assert regression.condition(other.gram.sum(0)) == pytest.approx(regression.condition(plain.gram.sum(0)))


def test_hubers_weights_by_hand():
    residual, w = np.array([-3.0, -1.0, 0.5, 0.2, 10.0, 0.0, 7.0]), np.array([1.0, 1, 1, 1, 1, 1, 0])
    spread = 1.4826 * np.median([3.0, 1.0, 0.5, 0.2, 10.0, 0.0])
    expected = [min(1.0, 1.345 * spread / max(abs(r), 1e-300)) for r in residual]
    assert robust.robust_spread(residual, w) == pytest.approx(spread)
    assert robust.huber_weights(residual, robust.HUBER * spread) == pytest.approx(expected)
    assert robust.robust_weights(np.ones((4, 1)), np.zeros(4), np.ones(4)).tolist() == [1.0] * 4
    assert robust.robust_spread(residual, np.zeros(7)) == 0.0
    assert regression.block_index(10, 3).tolist() == [0, 0, 0, 0, 1, 1, 1, 2, 2, 2]


def test_hats_and_bases_by_interpolation():
    knots = np.array([0.2, 0.5, 1.0, 1.8])
    F_k = np.array([3.0, 1.0, 4.0, 2.0])
    for speed, wanted in (
        (0.2, 3.0),
        (0.35, 2.0),
        (0.5, 1.0),
        (0.75, 2.5),
        (1.0, 4.0),
        (1.4, 3.0),
        (1.8, 2.0),
        (2.6, 0.0),
        (0.05, 4.0),
    ):
        assert curves.hats(np.array([speed]), knots)[0] @ F_k == pytest.approx(wanted)
        both = curves.basis(np.array([speed, -speed]), knots) @ np.r_[F_k, 2.0 * F_k]
        assert both == pytest.approx([wanted, -2.0 * wanted])
    assert curves.hats(np.array([3.0, 9.0]), np.array([1.0])).tolist() == [[1.0], [1.0]]
    row, without = curves.constant_apart(4)
    both = np.r_[F_k + 0.7, F_k - 0.7]
    assert row @ both == pytest.approx(0.7) and without @ both == pytest.approx(np.r_[F_k, F_k])


def test_errors_of_a_fitted_form_are_those_of_its_covariance():
    generator = np.random.default_rng(2)
    root = generator.standard_normal((6, 6))
    covariance = root @ root.T
    fine = np.array([0.0, 0.5, 1.0])
    form = curves.forms(fine, {"two": fine}, both_directions=True)[1]
    error = curves.error_of_curve(form, covariance)
    for v, row in (
        (0.25, [0.5, 0.5, 0, 0, 0, 0]),
        (-1.0, [0, 0, 0, 0, 0, 1.0]),
        (-0.75, [0, 0, 0, 0, 0.5, 0.5]),
    ):
        assert error(np.array([v]))[0] == pytest.approx(np.sqrt(np.array(row) @ covariance @ row))
    line = curves.forms(np.array([0.0, 2.0]), {"line": np.array([0.0, 2.0])}, both_directions=True)[1]
    four = covariance[:4, :4]
    law = curves.to_law(line, np.array([3.0, 5.0, 2.0, 6.0]))

    def errors_of(law):
        names, rows = curves.sensitivity(line, law)
        return errors_by_parameter(names, rows @ four @ rows.T)

    errors = errors_of(law)
    assert law.rate.values() == pytest.approx(
        {"coulomb_positive": 3.0, "coulomb_negative": 2.0, "viscous_positive": 1.0, "viscous_negative": 2.0}
    )
    assert errors["coulomb_negative"] == pytest.approx(np.sqrt(four[2, 2]))
    for values, viscous in (
        ([3.0, 3.1, 2.0, 2.1], True),
        ([0.1, 3.0, 2.0, 6.0], True),
        ([3.0, 5.0, 6.1, 6.0], False),  # falling: no viscosity
        ([5.1, 5.0, 2.0, 6.0], False),
        ([3.0, 5.0, -0.1, 6.0], False),
        ([-0.1, 5.0, 2.0, 6.0], False),
    ):
        law = curves.to_law(line, np.array(values))
        stated = errors_of(law)
        assert (law.rate.NAME == "coulomb-viscous") is viscous
        if not viscous:
            assert law.rate.positive == tuple(values[:2]) and law.rate.negative == tuple(values[2:])
            assert stated == {
                name: pytest.approx(np.sqrt(np.diag(four)[part]))
                for name, part in (("positive", slice(0, 2)), ("negative", slice(2, 4)))
            }
    slope = np.array([-0.5, 0.5])
    assert errors["viscous_negative"] == pytest.approx(np.sqrt(slope @ four[2:, 2:] @ slope))


# ----------------------------------------------------------------------------------- signals and timing


def test_signals_are_the_derivatives_of_the_position():
    t = 2e-3 * np.arange(3000)
    q = 0.7 * np.sin(3.0 * t)
    log = Log(time=t, joints=(Joint(name="a"),), position=q, torque=np.cos(t))
    (s,) = prepare(log, 0)
    inner = slice(200, -200)
    assert s.rate == pytest.approx(500.0)
    assert s.position[inner] == pytest.approx(q[inner], abs=1e-5)
    assert s.velocity[inner] == pytest.approx(2.1 * np.cos(3.0 * t)[inner], abs=1e-4)
    assert s.acceleration[inner] == pytest.approx(-6.3 * np.sin(3.0 * t)[inner], abs=1e-3)
    assert s.jerk[inner] == pytest.approx(-18.9 * np.cos(3.0 * t)[inner], abs=1e-2)
    assert default_cutoff(500.0) == 50.0 and default_cutoff(4000.0) == 100.0
    time = t.copy()
    time[1000:] += 2.4 * 2e-3  # 3.4 periods: interpolated
    time[2000:] += 2.6 * 2e-3  # 3.6 periods: a gap
    pieces = prepare(log.replace(time=time), 0)
    assert [p.time.size for p in pieces] == [2002, 1000]
    short = log.rows(np.r_[0:49, 200:250, 400:3000])
    assert [p.time.size for p in prepare(short, 0)] == [50, 2600]


def test_long_rests_are_marked_and_short_ones_are_not():
    t = 2e-3 * np.arange(4000)
    v = np.sin(t)
    v[500:624] = 0.0  # 0.248 s
    v[1000:1127] = 0.0  # 0.254 s
    (s,) = prepare(Log(time=t, joints=(Joint(name="a"),), velocity=v, torque=v), 0, cutoff=245.0)
    assert s.moving[500:624].all()
    assert not s.moving[1000:1127].any() and s.moving.sum() >= 4000 - 127 - 3


@pytest.mark.parametrize(("share", "word"), [(0.5, "command"), (0.0, "sample"), (0.29, "command"), (0.21, "sample"), (1.0, None),
                                             (-0.3, None), (0.78, None)])  # fmt: skip
def test_a_torque_is_a_command_or_a_sample_by_a_quarter_of_an_interval(share, word):
    found, delay, error = torque_timing(prepare(made(share / 500.0, noise=0.02), 0))
    assert (found, delay) == (word, pytest.approx(-share / 500.0, abs=0.03 / 500.0))
    assert 0.0 < error < 0.15 / 500.0


def test_long_run_of_one_row():
    z = np.random.default_rng(3).standard_normal((1, 90)).cumsum(axis=1)
    lags = int(np.sqrt(90))
    expected = sum(
        max(1.0 - abs(i - j) / (lags + 1.0), 0.0) * z[0, i] * z[0, j] for i in range(90) for j in range(90)
    )
    assert long_run(z)[0, 0] == pytest.approx(expected, rel=1e-12)


def test_two_cycles_are_a_sweep_and_one_is_none():
    for cycles, found in ((2, True), (1, False)):
        plan = Sweep(A, V, 2)
        log = made(0.0, plan=plan)
        begin, end = plan.windows()[0][0], plan.windows()[cycles - 1][1]
        log = log.between(max(begin - 0.05, 0.0), end + 0.02).replace(plan=None)
        if found:
            assert find_windows(log, 0) == pytest.approx(plan.windows(), abs=0.1)
        else:
            with pytest.raises(NotIdentifiable, match="equal stroke"):
                find_windows(log, 0)


def test_the_whole_way_with_a_known_payload():
    """Three centers, each with a small and a large weight; friction that grows by mu of the load, lifting and driven back alike."""
    mu = 0.06
    logs, payloads = [], []
    for k, center in enumerate((-1.0, 0.2, 1.3)):
        for extra in ((1.5, 4.0), (3.0, 13.0)):
            gravity = (3.0 + extra[0], 11.0 + extra[1])
            plan = Sweep(A, V, 4, center=center)
            logs.append(made(0.5 / 500.0, plan=plan, gravity=gravity, mu=mu, noise=0.02, seed=k))
            payloads.append(extra)
    friction_, shown = identify_payload(logs, "a", payloads, timing="command")
    value = {name: e.value for name, e in friction_.dynamics.items()}
    wanted = {"inertia": 1.6, "time_slip": -0.001, "gravity_sin": 3.0, "gravity_cos": 11.0}
    for name, truth in wanted.items():
        assert value[name] == pytest.approx(truth, rel=0.02, abs=2e-5), name
    grown = friction_.law.growth.values()
    assert (grown["load_driving"], grown["load_driven"]) == (
        pytest.approx(mu, abs=0.004),
        pytest.approx(mu, abs=0.004),
    )
    assert friction_.law.torque([0.6, 1.8, -1.2]) == pytest.approx([10.8, 14.4, -12.6], abs=0.1)
    assert friction_.fitted.residual < 5.0 and friction_.validity.velocity == pytest.approx(
        (-2.0, 2.0), abs=0.02
    )
    assert f"{grown['load_driving']:.4f} +- " in shown.verdict and friction_.fitted.samples == sum(
        np.count_nonzero(s.sliding) for log in logs[::2] for s in prepare(log, "a")
    )
    for wrong, said in (
        ((logs, payloads[:5]), "5 payloads for 6"),
        ((logs, [(0.0, 0.0)] * 6), "same payload"),
    ):
        with pytest.raises(InvalidInput, match=said):
            identify_payload(wrong[0], "a", wrong[1])


def test_signals_carry_what_is_known_beside_the_motion():
    log = made(0.0)
    n = len(log)
    known = log.replace(model_torque=np.arange(n), temperature=30.0 + np.arange(n), load=2.0 * np.arange(n))
    (s,) = prepare(known, 0)
    assert np.array_equal(s.model_torque, np.arange(n)) and np.array_equal(s.temperature, 30.0 + np.arange(n))
    assert np.array_equal(s.load, np.column_stack([log.torque[:, 0], -2.0 * np.arange(n)]))
    pushed = log.replace(external_torque=np.full(n, 1.5))
    (s,) = prepare(pushed, 0)
    assert np.array_equal(s.load[:, 1], np.full(n, 1.5)) and s.torque == pytest.approx(log.torque[:, 0] + 1.5)
    (s,) = prepare(log, 0)
    assert s.load is None and s.temperature is None and s.model_torque is None
    holed = np.where(np.arange(n) % 100 == 7, np.nan, np.arange(n))
    (s,) = prepare(log.replace(model_torque=holed), 0)  # rows left out, and interpolated as the clock asks
    assert np.isfinite(s.model_torque).all() and s.time.size == n
