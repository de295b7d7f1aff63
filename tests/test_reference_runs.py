"""Runs at constant velocity from end to end: every number by brute force, thresholds and words from both sides."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from backdrive.errors import NotIdentifiable
from backdrive.identification.constant_velocity import identify_constant_velocity
from backdrive.identification.evidence import verdict
from backdrive.identification.runs import find_runs, gravity_of, whole_run, without_gravity
from backdrive.logs.log import Joint, Log

SPEEDS = [*np.linspace(0.1, 2.0, 10), *-np.linspace(0.1, 2.0, 10)]


def runs(F, speeds=SPEEDS, noise=0.0, n=200, gravity=None, unit="rad", uneven=()):
    generator, logs = np.random.default_rng(8), []
    for k, v in enumerate(speeds):
        t = 10.0 * k + np.arange(n) / 100.0
        velocity = np.full(n, float(v))
        if k in uneven:
            velocity *= 1.0 + 0.3 * np.tile([1.0, -1.0], n // 2)
        tau = F(v) + noise * generator.standard_normal(n)
        more = {"velocity": velocity}
        if gravity is not None:
            q = v * (t - t[0]) + 0.1 * k
            more, tau = {"position": q}, tau + gravity[0] * np.sin(q) + gravity[1] * np.cos(q)
        logs.append(Log(time=t, joints=(Joint(name="a", unit=unit),), torque=tau, **more))
    return logs


def uneven_line(v):
    return 5.0 + 2.0 * v if v > 0 else -4.0 + 3.0 * v


def fitted_line(y, symmetric):
    v = np.array(SPEEDS)
    X = np.column_stack([v > 0, v * (v > 0), -1.0 * (v < 0), v * (v < 0)])
    if symmetric:
        X = np.column_stack([np.sign(v), v, np.ones(v.size)])
    theta = np.linalg.lstsq(X, y, rcond=None)[0]
    hat = X @ np.linalg.pinv(X)
    left = (y - X @ theta) / (1.0 - np.diag(hat))
    return theta, y - X @ theta, left, X


def test_runs_on_two_lines_come_back_with_every_number():
    logs = runs(uneven_line, noise=0.3)
    one = [find_runs(log, 0)[0] for log in logs]
    y, within = np.array([r.torque for r in one]), np.array([r.error for r in one])
    theta, left, unseen, X = fitted_line(y, False)
    found, shown = identify_constant_velocity(logs, "a", law="coulomb-viscous")
    assert list(found.law.rate.values().values()) == pytest.approx(
        [theta[0], theta[2], theta[1], theta[3]], rel=1e-5
    )
    assert found.fitted.rms == pytest.approx(np.sqrt(np.mean(left**2)), rel=1e-5)
    assert found.held_out.rms == pytest.approx(np.sqrt(np.mean(unseen**2)), rel=1e-4)
    assert found.fitted.residual == pytest.approx(100.0 * np.linalg.norm(left) / np.linalg.norm(y), rel=1e-5)
    assert found.fitted.residual_raw == found.fitted.residual and found.held_out.samples == 20
    assert found.dynamics == {} and found.validity.velocity == pytest.approx((-2.0, 2.0))
    assert (found.method, len(found.warnings)) == ("constant-velocity", 1)
    assert found.warnings[0].startswith("A constant bias torque (gravity, cable")
    bread = np.linalg.inv(X.T @ X)
    student = 2.028 / 1.96  # 36 degrees of freedom: 16 of the means, and 20 of the noise within the runs
    power = (left @ left + 20.0 * np.mean(within**2)) / 36.0
    error = np.sqrt(np.diag(bread) * power) * student
    assert found.standard_errors["coulomb_positive"] == pytest.approx(error[0], rel=1e-3)
    assert found.standard_errors["viscous_negative"] == pytest.approx(error[3], rel=1e-3)
    s = shown.samples
    assert s.time.tolist() == [10.0 * k for k in range(20)] and np.isnan(s.position).all() and s.fitted.all()
    assert (
        s.velocity == pytest.approx(SPEEDS)
        and s.torque == pytest.approx(y)
        and s.friction == pytest.approx(y)
    )
    assert s.predicted == pytest.approx(y - left, rel=1e-5) and shown.joint == "a"
    assert (
        shown.verdict.startswith(verdict(found)) and "A straight line per direction suffices" in shown.verdict
    )
    positive = shown.curve.velocity > 0
    band = np.sqrt(shown.curve.standard_error[positive])
    assert band.min() > 0.0 and shown.curve.torque[positive] == pytest.approx(
        theta[0] + theta[1] * shown.curve.velocity[positive], rel=1e-5
    )


def test_runs_that_differ_by_more_than_noise_count_by_their_scatter_alone():
    shifts = dict(zip(SPEEDS, 0.3 * np.random.default_rng(4).standard_normal(len(SPEEDS)), strict=True))
    logs = runs(lambda v: uneven_line(v) + shifts[v], noise=0.3)
    y = np.array([find_runs(log, 0)[0].torque for log in logs])
    _, left, _, X = fitted_line(y, False)
    found, _ = identify_constant_velocity(logs, "a", law="coulomb-viscous")
    student = 2.120 / 1.96  # 16 degrees of freedom
    error = np.sqrt(np.diag(np.linalg.inv(X.T @ X)) * (left @ left) / 16) * student
    assert found.standard_errors["coulomb_positive"] == pytest.approx(error[0], rel=1e-3)


@pytest.mark.parametrize("correlation", [0.0, 0.9])
def test_the_error_of_a_run_s_mean_is_that_of_correlated_noise(correlation):
    random, n, stated = np.random.default_rng(2), 4000, []
    for _ in range(30):
        e = lfilter([np.sqrt(1.0 - correlation**2)], [1.0, -correlation], random.standard_normal(n))
        t = np.arange(n) / 1000.0
        log = Log(time=t, joints=(Joint(name="a"),), torque=2.0 + 0.5 * e, velocity=np.ones(n))
        stated.append(find_runs(log, 0)[0].error)
    wanted = 0.5 * np.sqrt((1.0 + correlation) / (1.0 - correlation) / n)
    assert np.mean(stated) == pytest.approx(wanted, rel=0.08)


def test_one_curve_leaves_an_offset_and_friction_that_would_push_too():
    logs = runs(uneven_line, noise=0.1)
    y = np.array([find_runs(log, 0)[0].torque for log in logs])
    theta, left, unseen, _ = fitted_line(y, True)
    found, shown = identify_constant_velocity(logs, "a", symmetric=True, law="coulomb-viscous")
    assert found.dynamics["offset"].value == pytest.approx(theta[2], rel=1e-5) and found.warnings == ()
    assert list(found.law.rate.values().values()) == pytest.approx(
        [theta[0], theta[0], theta[1], theta[1]], rel=1e-5
    )
    assert found.dynamics["offset"].unit == "N.m" and 0.0 < found.dynamics["offset"].standard_error < 0.5
    assert shown.samples.friction == pytest.approx(y - theta[2], rel=1e-5)
    assert found.held_out.rms == pytest.approx(np.sqrt(np.mean(unseen**2)), rel=1e-4)
    assert found.fitted.rms == pytest.approx(np.sqrt(np.mean(left**2)), rel=1e-4)
    pulled = runs(lambda v: np.sign(v) * 2.0 + v + 6.0, noise=0.01, unit="m")
    found, _ = identify_constant_velocity(pulled, "a", law="coulomb-viscous")
    assert (
        found.dynamics["offset"].value == pytest.approx(6.0, abs=0.02)
        and found.dynamics["offset"].unit == "N"
    )
    assert found.law.torque(np.array([1.0, -1.0])) == pytest.approx([3.0, -3.0], abs=0.02)
    assert found.warnings[0].startswith("Friction at rest was taken as equal in both directions")
    assert 0.0 < found.dynamics["offset"].standard_error < 0.02
    held = runs(lambda v: np.sign(v) * 2.0 + v + 1.5, noise=0.01)  # less than friction: it stays in it
    assert identify_constant_velocity(held, "a", law="coulomb-viscous")[0].dynamics == {}


def bent(v):
    return np.sign(v) * (3.0 + 2.0 * np.exp(-abs(v) / 0.3) + abs(v))


def test_what_is_said_of_a_bent_curve():
    dense = [*np.linspace(0.1, 2.0, 14), *-np.linspace(0.1, 2.0, 14)]
    logs = runs(bent, dense, noise=0.02)
    found, shown = identify_constant_velocity(logs, "a")
    sections = len(found.law.rate.velocity) - 1
    line = identify_constant_velocity(logs, "a", law="coulomb-viscous")[0]
    assert shown.verdict.endswith(
        f"{sections} line sections per direction predict left-out runs to {found.held_out.rms:.3g} N.m rms, a straight line per "
        f"direction to {line.held_out.rms:.3g} N.m: the curve is bent."
    )
    only, shown = identify_constant_velocity(logs, "a", law="polyline")
    assert only.law.rate.NAME == "polyline" and "line sections per direction were fitted." in shown.verdict
    straight = identify_constant_velocity(runs(uneven_line, noise=0.05), "a")
    assert straight[0].law.rate.NAME == "coulomb-viscous"
    assert straight[1].verdict.endswith(
        f"predicts left-out runs significantly better than its {straight[0].held_out.rms:.3g} N.m rms."
    )
    for n, enough in ((3, False), (4, True)):
        if enough:
            identify_constant_velocity(runs(uneven_line, [0.5, 1.0, -0.5, -1.0][:n]), "a", symmetric=True)
        else:
            with pytest.raises(NotIdentifiable, match=f"{n} constant-velocity runs are too few"):
                identify_constant_velocity(runs(uneven_line, [0.5, 1.0, -0.5][:n]), "a")
    jerky = identify_constant_velocity(runs(uneven_line, uneven=(2, 14)), "a")[0]
    assert f"2 runs at up to {abs(SPEEDS[14]):.3g} rad/s did not keep their speed" in jerky.warnings[0]
    with pytest.raises(
        NotIdentifiable, match="4 runs .* do not determine a curve for each.* at least 10 runs"
    ):
        identify_constant_velocity(runs(uneven_line, [0.5, 1.0, -0.5, -1.0]), "a", law="polyline")
    three = [0.3, 0.5, 1.0, -0.3, -0.5, -1.0]
    with pytest.raises(NotIdentifiable, match="at least 7 runs .* in both directions; or .*`symmetric`"):
        identify_constant_velocity(runs(uneven_line, three), "a")
    identify_constant_velocity(runs(uneven_line, three), "a", symmetric=True)
    identify_constant_velocity(runs(uneven_line, [*three, 0.7]), "a")


def test_gravity_inside_runs_is_taken_off_and_given_back():
    logs = runs(uneven_line, noise=0.05, gravity=(7.0, -3.0), n=300)
    found, shown = identify_constant_velocity(logs, "a")
    value, covariance = gravity_of([r for log in logs for r in find_runs(log, 0)])
    error = np.sqrt(np.diag(covariance))
    for i, name in enumerate(("gravity_sin", "gravity_cos")):
        e = found.dynamics[name]
        assert (e.value, e.standard_error, e.unit) == (
            pytest.approx(value[i]),
            pytest.approx(error[i]),
            "N.m",
        )
    assert value == pytest.approx([7.0, -3.0], abs=0.05)
    assert found.law.torque(np.array([0.5, 1.5, -1.0])) == pytest.approx([6.0, 8.0, -7.0], abs=0.06)
    mean = [np.mean(log.torque) for log in logs]
    assert shown.samples.torque == pytest.approx(mean, abs=0.1)
    bare = [find_runs(without_gravity(log, 0, value), 0)[0].torque for log in logs]
    assert shown.samples.friction == pytest.approx(bare) and shown.samples.predicted == pytest.approx(
        mean, abs=0.1
    )
    line = runs(uneven_line, gravity=(0.0, 0.0), n=300, unit="m")
    assert identify_constant_velocity(line, "a")[0].dynamics == {} and find_runs(line[0], 0)[0].pull is None
    (r,) = find_runs(logs[3], 0)
    q, tau = logs[3].position[:, 0], logs[3].torque[:, 0]
    assert r.pull == pytest.approx((np.sin(q).mean(), np.cos(q).mean())) and r.start == 30.0
    columns = np.stack([np.sin(q) - np.sin(q).mean(), np.cos(q) - np.cos(q).mean(), tau - tau.mean()])
    assert r.within == pytest.approx(columns @ columns.T)


@pytest.mark.parametrize(("share", "seen"), [(0.24, False), (0.26, True)])
def test_gravity_must_explain_a_quarter_of_what_varies_within_runs(share, seen):
    found = []
    for k in range(4):
        turn = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
        unequal = 0.4 * (-1) ** k  # the runs do not agree on it: it is not sure either
        other = np.sqrt((1.0 - share) / share - unequal**2) * np.sin(9.0 * turn)  # orthogonal to the sine
        found += find_runs(
            Log(
                time=np.arange(400) / 100.0 + 9.0 * k,
                joints=(Joint(name="a"),),
                position=turn,
                torque=(1.0 + unequal) * np.sin(turn) + other,
            ),
            0,
        )
    assert (gravity_of(found) is not None) is seen
    assert gravity_of([replace(r, within=None) for r in found[:1]] + found[1:]) is None
    flat = [replace(r, within=np.zeros((3, 3))) for r in found]
    assert gravity_of(flat) is None


def test_plateaus_last_and_keep_their_level():
    rate = 100.0

    def count(*parts):
        v = np.concatenate([np.asarray(p, float) for p in parts])
        t = np.arange(v.size) / rate
        return len(find_runs(Log(time=t, joints=(Joint(name="a"),), velocity=v, torque=np.ones(v.size)), 0))

    rest = np.zeros(60)
    for n, found in ((62, 1), (54, 0)):  # steady where 0.3 s around are level, and that for 0.3 s
        assert count(rest, np.full(n, 1.0), rest, np.full(200, -1.0), rest) == 1 + found
    for slow, found in ((0.02, 1), (0.001, 0)):
        assert count(rest, np.full(200, slow), rest, np.full(200, -1.0), rest) == 1 + found
    for slow, found in ((0.003, 0), (0.007, 1)):  # of the top speed, without a rest around
        assert count(np.full(200, 1.0), np.full(200, slow), np.full(200, -1.0)) == 2 + found
    for drift, found in ((0.14, 1), (0.2, 0)):
        assert (
            count(
                rest, np.linspace(1.0 - 0.5 * drift, 1.0 + 0.5 * drift, 200), rest, np.full(200, -1.0), rest
            )
            == 1 + found
        )
    for ripple, found in ((0.075, 1), (0.09, 0)):
        zigzag = 1.0 + ripple * np.tile([1.0, -1.0], 100)
        assert count(rest, zigzag, rest, np.full(200, -1.0), rest) == 1 + found
    slow = np.r_[
        np.zeros(12), np.full(8, 1.0), np.zeros(12), np.full(8, -1.0), np.zeros(12)
    ]  # at 10 Hz three samples are enough
    log = Log(
        time=np.arange(slow.size) / 10.0, joints=(Joint(name="a"),), velocity=slow, torque=np.ones(slow.size)
    )
    assert len(find_runs(log, 0)) == 2
    assert count(np.r_[np.full(25, 1.0), np.full(25, -1.0)]) == 0  # shorter than two plateaus
    assert not whole_run(Log(time=np.arange(40) / rate, joints=(Joint(name="a"),), velocity=np.zeros(40)), 0)
    assert whole_run(
        Log(time=np.arange(40) / rate, joints=(Joint(name="a"),), position=np.arange(40) / rate), 0
    )
    scarce = Log(
        time=np.arange(40) / rate,
        joints=(Joint(name="a"),),
        velocity=np.where(np.arange(40) < 19, 1.0, np.nan),
        torque=np.ones(40),
    )
    assert not whole_run(scarce, 0) and find_runs(scarce, 0) == []
    holed = np.where(np.arange(40) % 9 == 0, np.nan, 1.0)
    assert whole_run(Log(time=np.arange(40) / rate, joints=(Joint(name="a"),), velocity=holed), 0)


def test_runs_that_the_noise_of_an_encoder_hides_are_runs():
    rate, n = 500.0, 1500
    t = np.arange(n) / rate
    rng = np.random.default_rng(0)
    noise = 2e-3 * rng.standard_normal((10, n))
    logs = [
        Log(
            time=t,
            joints=(Joint(name="a"),),
            position=speed * np.where(t < 0.3, t * t / 0.6, t - 0.15) + noise[k],
            torque=np.sign(speed) * np.full(n, 1.5) + 0.05 * rng.standard_normal(n),
        )
        for k, speed in enumerate(np.outer((0.05, 0.1, 0.15, 0.2, 0.25), (1.0, -1.0)).ravel())
    ]
    assert all(whole_run(log, 0) for log in logs)
    found = [run.velocity for log in logs for run in find_runs(log, 0)]
    assert np.allclose(found, np.outer((0.05, 0.1, 0.15, 0.2, 0.25), (1.0, -1.0)).ravel(), rtol=0.06)
    to_and_fro = 0.002 * np.sin(20.0 * t) + 0.005 * t + noise[0]  # moves by no more than noise and drifts
    assert not whole_run(logs[0].replace(position=0.05 * np.sin(20.0 * t) + 0.005 * t + noise[0]), 0)
    assert not whole_run(logs[0].replace(position=to_and_fro), 0)
