"""Coulomb friction through reversals, on a joint that is integrated here: its friction crosses zero over a range of speeds."""

import numpy as np
import pytest

from backdrive import Joint, Log, identify
from backdrive.identification import crossing_fit, crossing_noise
from backdrive.identification.crossing_noise import Noise, Whitener, huber_sum, noise_of
from backdrive.identification.crossing_search import Estimate
from backdrive.identification.signals import prepare
from backdrive.identification.smoothing import smoothing
from backdrive.identification.zero_crossing import (
    EDGE,
    FINE,
    REACH,
    Course,
    Passage,
    numerov,
    passages_of,
    stencil,
    triangle,
)

INERTIA, COULOMB, VISCOUS, WIDTH = 0.2, 1.5, 0.3, 0.03
STEP, RATE, SECONDS = 2e-4, 200.0, 30.0


def joint(rng, peak=0.0, rate=RATE):
    """Return positions and torque at a rate of a joint under a stiff servo."""
    n = round(SECONDS / STEP)
    t = np.arange(n) * STEP
    q_d = sum(np.sin(2.0 * np.pi * f * t + rng.uniform(0.0, 6.28)) / f for f in (0.2, 0.5, 0.9)) * 0.15
    v_d = np.gradient(q_d, STEP)
    a_d = np.gradient(v_d, STEP)
    q, v = q_d[0], v_d[0]
    every, rows = round(1.0 / (rate * STEP)), []
    stiffness, damping = INERTIA * 60.0**2, 2.0 * INERTIA * 60.0
    wanted = np.stack([q_d, v_d, a_d], axis=1).tolist()
    for k, (x, dx, ddx) in enumerate(wanted):
        level = COULOMB + peak * np.exp(-((v / 0.05) ** 2)) if peak else COULOMB
        friction = level * float(np.tanh(v / WIDTH)) + VISCOUS * v
        u = stiffness * (x - q) + damping * (dx - v) + INERTIA * ddx
        if k % every == 0:
            rows.append((q, u))
        v += STEP * (u - friction) / INERTIA
        q += STEP * v
    return np.array(rows).T


def log_of(q, u, rng, colour, size=0.1, rate=RATE):
    white, noise = size * rng.standard_normal(q.size), np.zeros(q.size)
    for k in range(1, q.size):
        noise[k] = colour * noise[k - 1] + np.sqrt(1.0 - colour**2) * white[k]
    count = 2.0 * np.pi / 2**20
    return Log(
        time=np.arange(q.size) / rate,
        joints=(Joint(name="joint", unit="rad"),),
        position=(count * np.round(q / count))[:, None],
        torque=(u + noise)[:, None],
    )


@pytest.fixture(scope="module")
def motion():
    return joint(np.random.default_rng(1))


def test_triangle_weighs_like_a_second_difference():
    """The second difference of a function is the triangle's mean of its second derivative."""
    h = 0.01
    fine = np.arange(0, 40 * FINE) * h / FINE
    for f, second in ((np.sin, lambda x: -np.sin(x)), (lambda x: x**3, lambda x: 6.0 * x)):
        at = fine[::FINE]
        differences = (f(at[2:]) - 2.0 * f(at[1:-1]) + f(at[:-2])) / h**2
        assert triangle(second(fine))[1:-1] == pytest.approx(differences, abs=2e-5)
        assert numerov(second(at))[1:-1] == pytest.approx(differences, abs=1e-9)


def test_triangle_of_a_jump_between_samples():
    fine = np.sign(np.arange(10 * FINE) - 4.5 * FINE)
    assert triangle(fine)[[2, 4, 5, 7]] == pytest.approx([-1.0, -0.75, 0.75, 1.0], abs=0.1)


def test_stencil_is_the_second_difference_of_a_delayed_series():
    from backdrive.identification.delay import earlier

    q = np.random.default_rng(2).standard_normal(80)
    for late in (0.0, 0.3, -1.6, 2.0):
        moved = earlier(q, late)
        k = 40
        assert stencil(late) @ q[k - REACH : k + REACH + 1] == pytest.approx(
            moved[k + 1] - 2.0 * moved[k] + moved[k - 1]
        )


def test_whitener_makes_the_dense_covariance_white():
    """Against the covariance that is written out: autoregression after Numerov's mean, rounding, and open rows."""
    n, noise, rounding, late = 40, Noise(0.9, 0.3), 2e-6, 0.3
    passage = Passage(
        measured=np.zeros(n),
        torque=np.zeros(n),
        corner=np.zeros(n),
        moving=np.ones(n, dtype=bool),
        rate=RATE,
        terms=(),
        noise=1e-6,
    )
    unsure = np.zeros(n)
    unsure[7] = 2.0
    whitener = Whitener(passage, noise, rounding, late / RATE, unsure)
    white = whitener(np.eye(n))
    lag = np.abs(np.subtract.outer(np.arange(n + 2), np.arange(n + 2)))
    torque = noise.innovation**2 / (1.0 - noise.correlation**2) * noise.correlation**lag
    mean = np.array([[numerov(row)[k + 1] for row in np.eye(n + 2)] for k in range(n)])
    weights, bends = stencil(late) * RATE**2 * rounding, np.zeros((n, n + 2 * REACH))
    for k in range(n):
        bends[k, k : k + 2 * REACH + 1] = weights
    dense = mean @ torque @ mean.T + bends @ bends.T + np.diag(unsure)
    after = white @ dense @ white.T
    inner = slice(12, n - 2)  # the first rows know no past
    assert after[inner, inner] == pytest.approx(np.eye(n)[inner, inner], abs=0.02)
    assert whitener.log_determinant == pytest.approx(np.linalg.slogdet(dense)[1], abs=0.4)


def test_clipped_residuals_count_linearly():
    assert huber_sum(np.array([1.0, -2.0])) == 5.0
    assert huber_sum(np.array([100.0])) < 500.0


def test_a_bristle_ends_bent_along_the_motion():
    course = Course(kind="bristle", width=1e-3)
    position = np.concatenate([np.linspace(0.0, 0.01, 200), np.linspace(0.01, 0.0, 200)])
    level = course.level(position, np.gradient(position, 1e-3))
    assert level[150] == pytest.approx(1.0, abs=1e-3)
    assert level[-1] == pytest.approx(-1.0, abs=1e-3)
    assert -1.0 < level[210] < 1.0


def stated(log, monkeypatch, without=False, **options):
    """Return Coulomb friction, its error, and the words of the result, with or without the fit through reversals."""
    with monkeypatch.context() as patch:
        if without:
            patch.setattr("backdrive.identification.motion_crossings.through_crossings", lambda *_: None)
            patch.setattr("backdrive.identification.dynamic.through.through_crossings", lambda *_: None)
        result = identify([log], law="coulomb-viscous", **options)
    friction = result.model.joints[0]
    return (
        friction.law.rate.coulomb_positive,
        friction.standard_errors["coulomb_positive"],
        result.evidence[0].verdict,
    )


@pytest.mark.parametrize(("options", "seed"), [({"method": "motion"}, 3), ({}, 4)])
def test_slow_noise_makes_reversals_tell(motion, monkeypatch, options, seed):
    log = log_of(*motion, np.random.default_rng(seed), 0.98)
    value, error, words = stated(log, monkeypatch, **options)
    _, plain, _ = stated(log, monkeypatch, without=True, **options)
    assert error < 0.85 * plain
    assert abs(value - COULOMB) < 3.5 * error
    assert crossing_fit.SAID in words


def test_errors_hold_over_draws(motion, monkeypatch):
    off = []
    for seed in range(10, 18):
        log = log_of(*motion, np.random.default_rng(seed), 0.98)
        value, error, _ = stated(log, monkeypatch, method="motion")
        off.append((value - COULOMB) / error)
    assert 0.4 < np.sqrt(np.mean(np.square(off))) < 1.8


@pytest.fixture(scope="module")
def late_logs():
    """Logs at 1 kHz whose torque comes 4 ms late, with so much slow noise that the inertia hardly tells it."""
    q, u = joint(np.random.default_rng(1), rate=1000.0)
    return [
        log_of(q[4:], u[:-4], np.random.default_rng(seed), 0.98, size=0.3, rate=1000.0) for seed in (0, 1, 6)
    ]


def test_reversals_tell_a_delay_that_the_inertia_does_not(late_logs, monkeypatch):
    """Stated errors hold for the delay and for Coulomb friction; without the reversals nothing is stated."""
    told = {}
    for without in (False, True):
        with monkeypatch.context() as patch:
            if without:
                patch.setattr("backdrive.identification.motion.slip_at_crossings", lambda slip, *_: slip)
            results = [identify([log], method="motion", law="coulomb-viscous") for log in late_logs]
        told[without] = [r.model.joints[0] for r in results if r.model.joints[0].standard_errors]
        said = [r for r in results if crossing_fit.TOLD in r.evidence[0].verdict]
        assert len(said) == (0 if without else len(told[without]))
    assert len(told[False]) >= len(told[True]) + 2
    for joint in told[False]:
        delay = joint.dynamics["time_slip"]
        assert abs(joint.delay - 0.004) < 3.5 * delay.standard_error
        assert delay.standard_error < 0.002
        error = joint.standard_errors["coulomb_positive"]
        assert abs(joint.law.rate.coulomb_positive - COULOMB) < 3.5 * error


@pytest.mark.parametrize("size", [0.13, 0.3])
def test_a_stribeck_peak_tells_no_delay_or_one_within_its_error(monkeypatch, size):
    """A course that is wrong is refused where the noise lets it be seen, and its delay is less sure elsewhere."""
    rng = np.random.default_rng(1)
    q, u = joint(rng, peak=1.0, rate=1000.0)
    before, found = crossing_fit.delay_at_crossings, []

    def listen(*given):
        found.append(before(*given))
        return found[-1]

    monkeypatch.setattr("backdrive.identification.motion_crossings.delay_at_crossings", listen)
    monkeypatch.setattr("backdrive.identification.slip.KNOWN", 1.0)
    log = log_of(q[4:], u[:-4], rng, 0.98, size=size, rate=1000.0)
    identify([log], method="motion", law="coulomb-viscous")
    if size < 0.2:
        assert found == [None]
    else:
        ((delay, error),) = found
        assert abs(delay - 0.004) < 3.0 * error


def test_every_fifth_sample_keeps_the_course(motion):
    """Of one sample in five, the columns are those of a log that was recorded so."""
    log = log_of(*motion, np.random.default_rng(3), 0.98)
    (whole,) = prepare(log, "joint", cutoff=20.0)
    (thin,) = passages_of([whole], ("viscous",), 1e-6, 5)
    assert thin.rate == pytest.approx(RATE / 5)
    assert np.array_equal(thin.measured, log.position[::5, 0])
    assert np.array_equal(thin.torque, numerov(log.torque[::5, 0]))


def test_white_noise_is_left_as_it_is(motion, monkeypatch):
    log = log_of(*motion, np.random.default_rng(3), 0.0)
    with_, without = (stated(log, monkeypatch, without=w, method="motion") for w in (False, True))
    assert with_ == without


def test_a_stribeck_peak_is_no_crossing_that_is_known(monkeypatch):
    """Friction at rest above Coulomb friction fits neither course: what is stated is no surer, or right."""
    rng = np.random.default_rng(4)
    log = log_of(*joint(rng, peak=1.0), rng, 0.98)
    value, error, words = stated(log, monkeypatch, method="motion")
    assert crossing_fit.SAID not in words or abs(value - COULOMB) < 3.5 * error


def test_the_noise_is_that_before_columns_took_a_part_of_it():
    """Slow noise about eight slow columns: of residuals alone the likeliest noise forgets in half its time."""
    rng, n = np.random.default_rng(5), 1500
    t = np.arange(n) / RATE
    X = np.column_stack(
        [np.ones(n), *(np.sin(2.0 * np.pi * f * t + f) for f in (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8))]
    )
    passage = Passage(
        measured=np.zeros(n + 2 * EDGE),
        torque=np.zeros(n + 2 * EDGE),
        corner=np.zeros(n + 2 * EDGE),
        moving=np.ones(n + 2 * EDGE, dtype=bool),
        rate=RATE,
        terms=(),
        noise=1e-9,
    )
    alone, beside = [], []
    for _ in range(12):
        e = np.zeros(n + 2)
        for k in range(1, n + 2):
            e[k] = 0.98 * e[k - 1] + rng.standard_normal()
        e = numerov(e)[1:-1]
        residual = e - X @ np.linalg.lstsq(X, e, rcond=None)[0]
        given = [passage], [residual]
        about = [np.zeros(n)], 1e-12, 0.0, Noise(0.97, 1.0)
        alone.append(1.0 - noise_of(*given, [X[:, :1] * rng.standard_normal((n, 1))], *about).correlation)
        beside.append(1.0 - noise_of(*given, [X], *about).correlation)
    assert np.mean(alone) > 0.03
    assert np.mean(beside) == pytest.approx(0.02, abs=0.006)


def test_lost_samples_tell_nothing_of_a_reversal(motion):
    """What is interpolated where a sample was lost has no noise of its own, and friction does not cross zero on a chord."""
    rng = np.random.default_rng(3)
    q, u = motion
    log = log_of(q, u, rng, 0.98)
    kept = np.sort(rng.choice(np.arange(len(log)), len(log) - 60, replace=False))
    kept[[0, -1]] = 0, len(log) - 1
    holes = log.rows(kept)
    (stretch,) = prepare(holes, "joint")
    assert stretch.lost is not None and stretch.lost.sum() == len(log) - np.unique(kept).size
    assert (
        stretch.lost[np.setdiff1d(np.arange(len(log)), kept)].all() and prepare(log, "joint")[0].lost is None
    )
    errors = [smoothing([x], "joint").error.size for x in (log, holes)]
    assert errors[1] == pytest.approx(errors[0])  # a chord is no noise of the encoder
    (passage,) = passages_of([stretch], (), 1e-6)
    assert not passage.moving[stretch.lost].any() and passage.moving.mean() > 0.8
    whole, rest = (identify(x, method="motion", law="coulomb-viscous") for x in (log, holes))
    for result in (whole, rest):
        assert crossing_fit.SAID in result.evidence[0].verdict
    one, other = (r.model.joints[0] for r in (whole, rest))
    error = one.standard_errors["coulomb_positive"]
    assert abs(one.law.rate.coulomb_positive - other.law.rate.coulomb_positive) < 1.5 * error
    assert other.standard_errors["coulomb_positive"] < 1.3 * error


def test_two_fits_that_contradict_each_other_leave_the_first_with_their_difference(motion):
    """Samples in which friction builds up make the fit without reversals as wrong as a false course makes the other."""
    log = log_of(*motion, np.random.default_rng(3), 0.98)
    stretches = prepare(log, "joint")
    names = ("coulomb", "viscous", "inertia", "delay")
    errors = np.array([0.01 * COULOMB, 0.03 * VISCOUS, 0.02 * INERTIA, 1e-3])
    right = np.array([COULOMB, VISCOUS, INERTIA, 0.0])
    noise = smoothing([log], "joint").error.of_sample
    told = {}
    for word, off in (("right", 0.0), ("wrong", 0.1 * COULOMB)):
        first = Estimate(names=names, values=right - [off, 0.0, 0.0, 0.0], covariance=np.diag(errors**2))
        found = crossing_fit.through_crossings(stretches, noise, first)
        assert found is not None
        told[word] = (first, *found)
    _, found, said = told["right"]
    assert said == crossing_fit.SAID and found.errors[0] < errors[0]
    first, found, said = told["wrong"]
    assert said == crossing_fit.APART and np.array_equal(found.values, first.values)
    assert abs(found.values[0] - COULOMB) < 1.2 * found.errors[0] < 0.13 * COULOMB
    assert np.array_equal(found.errors[2:], errors[2:])


@pytest.mark.parametrize("begin", [(0.0, 0.0), (1.2, -0.3), (0.1, 0.6), (2.3, -0.1)])
def test_the_likeliest_noise_is_found_from_anywhere(begin):
    """A likelihood that bends more and more away from its peak at (2.3, -0.1), with both numbers correlated."""

    def unlikely(x):
        a, b = (x[0] - 2.3) / 0.06, (x[1] + 0.1) / 0.009
        square = a**2 - 0.8 * a * b + b**2
        return 7e3 + 40.0 * (np.sqrt(1.0 + square / 20.0) - 1.0)

    asked = []
    found = crossing_noise._lowest(lambda x: asked.append(x) or unlikely(x), np.array(begin))
    near = begin == (2.3, -0.1)
    assert unlikely(found) < 7e3 + (0.02 if near else 0.5) and len(asked) <= (6 if near else 60)


def test_a_likelihood_that_is_flat_to_one_side_ends_the_search():
    """A correlation below zero counts as zero, so that nothing changes there."""
    found = crossing_noise._lowest(
        lambda x: 100.0 * max(x[0], 0.0) ** 2 + 1e4 * (x[1] - 0.03) ** 2, np.array([0.2, 0.0])
    )
    assert 100.0 * max(found[0], 0.0) ** 2 + 1e4 * (found[1] - 0.03) ** 2 < 0.05
