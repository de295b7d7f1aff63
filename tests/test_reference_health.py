"""What health checks measure, by brute force, and their thresholds from both sides.

The thresholds are those that the modules state; a log just below one and a log just above it are judged differently.
"""

import numpy as np
import pytest

from _synthetic import any_motion
from backdrive import Joint, Log, check
from backdrive.errors import UnhealthyLog
from backdrive.logs.health import gate, screen, time_slip, torque_sign
from backdrive.logs.health._exam import Exam
from backdrive.logs.health._jumps import jumps
from backdrive.logs.health._motion import _gain, _widths, motion, normal_equations, running
from backdrive.logs.health._runs import standstill_runs
from backdrive.logs.health._survey import survey
from backdrive.logs.health._velocity_fit import velocity_fit
from backdrive.logs.resolution import resolution, white_noise

RNG = np.random.default_rng(11)


def smooth(n=2000, dt=1e-3):
    t = dt * np.arange(n)
    return np.sin(2.0 * t) + 0.3 * np.sin(5.1 * t + 1.0)


def log_of(n=2000, dt=1e-3, unit="rad", **channels):
    if not {"position", "velocity"} & channels.keys():
        channels["position"] = smooth(n, dt)
    arrays = {name: np.asarray(x, dtype=float).reshape(n, -1) for name, x in channels.items()}
    width = next(iter(arrays.values())).shape[1]
    joints = tuple(Joint(name=f"j{k}", unit=unit) for k in range(width))
    return Log(time=dt * np.arange(n), joints=joints, **arrays)


def named(log, name, **options):
    return [f for f in check(log, **options) if f.name == name]


# ------------------------------------------------------------------------------- what checks measure


def test_running_means_are_convolutions():
    x = np.cumsum(RNG.standard_normal((200, 2)), axis=0) + 1e6
    for width in (1, 3, 7):
        box = np.ones(width) / width
        for j in range(2):
            wanted = x[:, j]
            for _ in range(3):
                wanted = np.convolve(wanted, box, mode="valid")
            assert running(x, width)[:, j] == pytest.approx(wanted, rel=1e-12)
    assert running(x, 7).shape == (200 - 18, 2)


def test_the_gain_of_running_means_is_what_white_noise_keeps_of_its_variance():
    impulse = np.zeros((400, 1))
    impulse[200] = 1.0
    for widths in ((3, 5), (7, 9)):
        answer = impulse
        for width in widths:
            answer = running(answer, width)
        assert _gain(*widths) == pytest.approx(float(np.sum(answer**2)), rel=1e-12)
    assert _widths(1e-3) == (11, 31)  # 10 ms and 30 ms, odd
    assert _widths(0.1) == (3, 3)
    assert _widths(2e-3) == (5, 15)


def test_white_noise_is_told_from_what_is_smooth():
    noise = 0.03 * RNG.standard_normal(40000)
    assert white_noise(noise) == pytest.approx(0.03, rel=0.03)
    assert white_noise(smooth(40000, 1e-4) * 10 + noise) == pytest.approx(0.03, rel=0.03)
    assert white_noise(np.zeros(2)) == 0.0
    assert white_noise(np.array([0.0, 1.0, 0.0])) == pytest.approx(2.0 / (0.6745 * np.sqrt(6.0)))


@pytest.mark.parametrize("step", [1e-5, 0.5, 3.7])
def test_the_resolution_is_the_greatest_common_step(step):
    counts = np.round(50 * np.sin(np.arange(500) / 20.0)).astype(int)
    assert resolution(step * counts + 0.2) == pytest.approx(step, rel=1e-6)
    uneven = np.array([0, 3, 5, 8, 11, 13, 21, 24, 29, 55]) * step  # no two neighbours one step apart
    assert resolution(uneven) == pytest.approx(step, rel=1e-6)
    assert resolution(RNG.standard_normal(500)) == 0.0
    assert resolution(np.full(9, 4.0)) == 0.0
    assert resolution(np.array([1.0, np.nan, 1.0, 1.5])) == pytest.approx(0.5)


def test_a_survey_is_what_a_loop_finds():
    n = 9000  # more than one piece
    x = np.round(np.cumsum(RNG.standard_normal((n, 3)), axis=0), 1)
    x[8185:8204, 1] = 7.0  # 19 equal ones across the pieces
    x[100:120, 2] = 3.0  # 20 equal ones
    x[5, 0] = np.nan
    s = survey(x)
    assert s.finite.tolist() == [False, True, True]
    for j in range(1, 3):
        column, change = x[:, j], np.diff(x[:, j])
        assert (s.low[j], s.high[j], s.step[j]) == (column.min(), column.max(), np.abs(change).max())
        assert s.equal[j] == np.mean(change == 0)
        excess = [min(abs(a), abs(b)) for a, b in zip(change, change[1:], strict=False) if a * b < 0]
        assert s.spike[j] == max(excess)
    assert s.long_run.tolist() == [False, False, True]
    empty = survey(np.zeros((0, 2)))
    assert empty.equal.tolist() == [0.0, 0.0] and empty.low.tolist() == [np.inf] * 2


def test_periods_gaps_and_pieces():
    log = log_of(position=smooth())
    time = log.time.copy()
    time[1000:] += 1.4e-3  # 2.4 periods: no gap
    time[1500:] += 1.6e-3  # 2.6 periods
    exam = Exam(log.replace(time=time))
    assert exam.period == pytest.approx(1e-3)
    assert exam.gaps.tolist() == [1500]
    assert exam.segments == exam.blocks == [slice(0, 1500), slice(1500, 2000)]
    (found,) = named(log.replace(time=time), "gaps")
    assert (found.value, found.where.tolist()) == (2, [1500])
    far = time.copy()
    far[700:] += 0.0999
    (found,) = named(log.replace(time=far), "gaps")
    assert (found.value, found.where.tolist()) == (102, [700, 1500])
    many = Exam(log_of(n=200_000, position=np.zeros(200_000)))
    assert sum(b.stop - b.start for b in many.blocks) == 65536
    assert (len(many.blocks), many.blocks[0].start, many.blocks[-1].stop) == (32, 0, 200_000)


def test_jitter_is_the_spread_of_the_interval_over_its_mean():
    for share, said in ((0.098, False), (0.102, True)):
        steps = 1e-3 * (1.0 + share * np.tile([1.0, -1.0], 1000))
        time = np.concatenate([[0.0], np.cumsum(steps)])[:2000]
        found = named(log_of(position=smooth()).replace(time=time), "jitter")
        assert bool(found) is said
        if said:
            assert found[0].value == pytest.approx(share, rel=1e-3)


# -------------------------------------------------------------------------------------- torque's sign


def viscous_log(share, n=8000, dt=2e-3):
    """A sine under inertia and viscous friction without noise: power over mean speed by the torque's scatter is `share`."""
    w = 2.0 * np.pi * 0.5
    t = dt * np.arange(n)
    v = np.cos(w * t)
    fast = np.abs(v) > 0.05 * np.quantile(np.abs(v), 0.99)
    a, v_ = -w * np.sin(w * t)[fast], v[fast]
    mean = np.mean(v_**2) / np.mean(np.abs(v_))  # for a coefficient of 1
    # mean b = share std(a - b v): of sines, to be solved for b
    b = share * np.std(a) / np.sqrt(mean**2 - share**2 * np.var(v_))
    return log_of(n, dt, position=np.sin(w * t) / w, torque=-w * np.sin(w * t) - b * v), b * mean


@pytest.mark.parametrize(("share", "said"), [(0.0485, False), (0.0515, True)])
def test_a_torque_of_inverted_sign_drives_with_a_twentieth_of_its_scatter(share, said):
    log, drives = viscous_log(share)
    found = named(log, "torque-sign")
    assert bool(found) is said
    mean, error, scatter = torque_sign.friction(Exam(log), 0)
    assert mean == pytest.approx(-drives, rel=0.02)
    assert mean / scatter == pytest.approx(-share, rel=0.02)
    assert error < 0.05 * abs(mean)


def test_and_four_standard_errors():
    assert torque_sign._certain((-0.401, 0.1, 1.0), -1) and not torque_sign._certain((-0.399, 0.1, 1.0), -1)
    assert torque_sign._certain((0.401, 0.1, 1.0), 1) and not torque_sign._certain((0.401, 0.1, 1.0), -1)


def test_the_friction_of_a_log_and_its_error_are_a_regression_without_one_fold_at_a_time():
    log = any_motion(lambda v: 3.0 * np.sign(v) + v, seconds=12.0, noise=1.5, seed=3)
    exam = Exam(log)
    m = motion(exam, 0, time_slip.REACH)
    assert m.terms.shape[1] == 8 and m.plain == 6  # wide: sine and cosine; and two of the second kind
    moving = np.abs(m.velocity) > 0.05 * np.quantile(np.abs(m.velocity), 0.99)
    X, y, fold, v = m.terms[moving, :6], m.torque[moving, time_slip.REACH], m.fold[moving], m.velocity[moving]

    def power(keep):
        theta = np.linalg.lstsq(X[keep], y[keep], rcond=None)[0]
        return np.mean((X[:, 1] * theta[1] + X[:, 2] * theta[2]) * v) / np.mean(np.abs(v))

    left = np.array([power(fold != f) for f in np.unique(fold)])
    mean, error, scatter = torque_sign.friction(exam, 0)
    assert len(left) == 12
    assert mean == pytest.approx(power(np.ones(y.size, bool)), rel=1e-6)
    assert error == pytest.approx(np.sqrt(11.0 / 12.0 * np.sum((left - left.mean()) ** 2)), rel=1e-5)
    assert scatter == pytest.approx(y.std(), rel=1e-9)
    gram, cross, power_ = normal_equations(X, y[:, None], fold)
    assert gram[3] == pytest.approx(X[fold == 3].T @ X[fold == 3])
    assert cross[5][:, 0] == pytest.approx(X[fold == 5].T @ y[fold == 5])
    assert power_[7] == pytest.approx(y[fold == 7] @ y[fold == 7])


def test_the_terms_of_a_motion_are_its_derivatives_filtered():
    """Far from reversals and at 0.2 Hz, running means of 40 ms leave sines as they are to 1e-3."""
    n, dt, w = 10000, 1e-3, 2.0 * np.pi * 0.2
    t = dt * np.arange(n)
    log = log_of(n, dt, position=0.2 * np.sin(w * t), torque=3.0 * np.cos(w * t))
    m = motion(Exam(log), 0, 20)
    assert m.plain == 5 and m.shifts.tolist() == list(range(-20, 21))
    inner = np.abs(m.velocity) > 0.05
    phase = np.arctan2(m.terms[:, 4] * w, m.velocity)  # of the position and the velocity themselves
    assert m.velocity[inner] == pytest.approx(0.2 * w * np.cos(phase)[inner], abs=2e-4)
    assert m.terms[inner, 0] == pytest.approx(-0.2 * w * w * np.sin(phase)[inner], abs=2e-4)
    assert m.terms[inner, 1] == pytest.approx(np.sign(m.velocity)[inner])
    assert m.terms[:, 3] == pytest.approx(1.0)
    assert m.terms[inner, 5] == pytest.approx((m.velocity * np.abs(m.velocity))[inner], abs=2e-4)
    for k in (0, 20, 40):  # a column is the torque so many samples later
        later = np.arctan2(np.sin(phase + w * dt * (k - 20)), np.cos(phase + w * dt * (k - 20)))
        assert m.torque[:, k] == pytest.approx(3.0 * np.cos(later), abs=4e-3)
    top = np.quantile(np.abs(0.2 * w * np.cos(w * t)), 0.99)
    # no sample below a tenth of the top speed within the 45 that the means reach
    assert np.abs(m.velocity[m.fast]).min() == pytest.approx(0.1 * top + 0.045 * 0.2 * w * w, abs=0.005)
    assert (np.bincount(m.fold).size, np.ptp(np.bincount(m.fold))) == (12, pytest.approx(0, abs=1))


# -------------------------------------------------------------------------------------- a slip of time


@pytest.mark.parametrize("late", [7.0, -5.0, 12.4])
def test_a_slip_is_found_to_a_twentieth_of_a_sample(late):
    log = any_motion(lambda v: 2.0 * np.sign(v) + v, inertia=6.0, delay=late / 500.0, noise=0.02)
    slip = time_slip.estimate(Exam(log), 0)
    assert slip.samples == pytest.approx(late, abs=0.15)
    assert slip.error < 0.1
    (found,) = named(log, "time-slip")
    assert found.value == slip.samples
    mended = gate(log, repair=True)
    again = time_slip.estimate(Exam(mended), 0)
    assert again is None or abs(again.samples) < 0.6


def test_the_minimum_of_a_parabola_is_found_between_the_samples():
    shifts = np.arange(-5, 6)
    for at in (-2.3, 0.0, 1.49):
        assert time_slip._minimum(shifts, 3.0 + 2.0 * (shifts - at) ** 2) == pytest.approx(at)
    assert time_slip._minimum(shifts, (shifts - 9.0) ** 2) == 5.0


# ------------------------------------------------------------------------------ jumps, units, velocities


@pytest.mark.parametrize(("size", "found"), [(7.6, None), (8.5, [1000])])
def test_a_jump_is_eight_times_the_steps_around_it(size, found):
    step = 0.01
    x = step * np.arange(2000) * 1.0
    x[1000:] += size * step
    got = jumps(Exam(log_of(position=x + 1e-7 * RNG.standard_normal(2000))), "position", 0)
    assert (None if got is None else got.rows.tolist()) == found
    if got is not None:
        assert got.sizes[0] == pytest.approx(size * step, abs=1e-5)
        assert not got.glitch[0]


def test_velocity_and_position_are_compared_by_scale_and_delay():
    n, dt, late = 6000, 1e-3, 0.012
    t = dt * np.arange(n)
    q = np.sin(3.0 * t) + 0.4 * np.sin(7.0 * t)
    v = 1.3 * (3.0 * np.cos(3.0 * (t - late)) + 2.8 * np.cos(7.0 * (t - late)))
    fit = velocity_fit(Exam(log_of(n, dt, position=q, velocity=v)), 0)
    assert fit.scale == pytest.approx(1.0 / 1.3, rel=5e-3)
    assert fit.delay == pytest.approx(late, rel=2e-2)
    assert fit.residual < 0.01 < fit.plain
    assert fit.window == pytest.approx(0.1)
    moving = q[100:] - q[:-100]
    integral = np.convolve(v, np.ones(101), mode="valid") * dt - 0.5 * dt * (v[100:] + v[:-100])
    lone = integral @ moving / (integral @ integral)
    assert fit.plain == pytest.approx(
        np.sqrt(np.mean((moving - lone * integral) ** 2) / np.mean(moving**2)), rel=0.02
    )


@pytest.mark.parametrize(
    ("scale", "severities"),
    [
        (0.84, ["spoils"]),
        (0.86, ["warn"]),
        (0.97, ["warn"]),
        (0.99, []),
        (1.01, []),
        (1.03, ["warn"]),
        (1.14, ["warn"]),
        (1.16, ["spoils"]),
    ],
)
def test_a_velocity_off_by_2_percent_is_remarked_on_and_spoils_from_15_on(scale, severities):
    t = 1e-3 * np.arange(6000)
    log = log_of(6000, position=np.sin(3.0 * t), velocity=3.0 / scale * np.cos(3.0 * t))
    findings = [f for f in check(log) if f.severity != "note"]
    assert [f.severity for f in findings] == severities
    assert all(f.name == "velocity-mismatch" and f.repairable == (f.severity == "spoils") for f in findings)
    assert all(f.quantity == "scale" and f.value == pytest.approx(scale, rel=1e-3) for f in findings)


@pytest.mark.parametrize(("factor", "unit"), [(180.0 / np.pi, "rad"), (1000.0, "m")])
def test_a_position_in_the_larger_unit_is_within_12_percent_of_the_ratio(factor, unit):
    t = 1e-3 * np.arange(6000)
    for off, name in (
        (0.885, "degrees"),
        (0.875, "velocity-mismatch"),
        (1.115, "degrees"),
        (1.125, "velocity-mismatch"),
    ):
        log = log_of(6000, unit=unit, position=off * factor * np.sin(3.0 * t), velocity=3.0 * np.cos(3.0 * t))
        found = [f for f in check(log) if f.severity == "spoils"]
        assert [f.name for f in found] == [name]
    ok = log_of(6000, unit=unit, position=factor * np.sin(3.0 * t), velocity=3.0 * np.cos(3.0 * t))
    assert gate(ok, repair=True).position[:, 0] == pytest.approx(np.sin(3.0 * t))
    back = log_of(6000, unit=unit, position=np.sin(3.0 * t), velocity=factor * 3.0 * np.cos(3.0 * t))
    assert gate(back, repair=True).velocity[:, 0] == pytest.approx(3.0 * np.cos(3.0 * t))


@pytest.mark.parametrize(("span", "said"), [(24.9, False), (25.1, True)])
def test_a_joint_that_goes_to_and_fro_over_25_radians_is_suspected(span, said):
    t = 1e-3 * np.arange(20000)
    log = log_of(20000, position=0.5 * span * np.sin(0.5 * np.pi * t))
    assert bool(named(log, "degrees")) is said


# ------------------------------------------------------------------------------------------- the others


class Plan:
    stroke, duration = 2.0, 4.0


@pytest.mark.parametrize(
    ("stroke", "seconds", "count"),
    [(1.61, 3.61, 0), (1.59, 3.61, 1), (2.39, 3.61, 0), (2.41, 3.61, 1), (2.0, 3.59, 1), (1.5, 3.5, 2)],
)
def test_a_plan_is_followed_within_a_fifth_of_its_stroke_and_a_tenth_of_its_time(stroke, seconds, count):
    n = round(seconds * 1000) + 1
    x = 0.5 * stroke * np.sin(2.0 * np.pi * np.linspace(0.0, 1.0, n))
    assert len(named(log_of(n, position=x), "plan-mismatch", plan=Plan())) == count


def test_few_samples_are_19():
    for n, said in ((19, True), (20, False)):
        assert bool(named(log_of(n, position=smooth(n)), "few-samples")) is said


def test_a_channel_is_empty_when_more_than_half_of_it_is_missing():
    for holes, repairable in ((1000, True), (1001, False)):
        x = smooth()
        x[:holes] = np.nan
        found = [f for f in check(log_of(position=smooth(), torque=x)) if f.name == "nan"]
        assert [f.repairable for f in found] == [repairable]
        assert found[0].value == holes and found[0].where.tolist() == list(range(holes))


def test_repeated_stamps_are_dropped_or_spread():
    base = log_of(1000, position=smooth(1000))
    coarse = base.replace(time=np.floor(base.time * 200.0) / 200.0)  # 5 samples a stamp
    (found,) = named(coarse, "repeated-time")
    assert found.value == 800
    spread = gate(coarse, repair=True)
    assert len(spread) == 1000
    assert np.diff(spread.time) == pytest.approx(1e-3, rel=1e-3)
    for twice, kept in ((199, 801), (200, 800), (201, 1000)):
        time = base.time.copy()
        time[1 : 2 * twice : 2] = time[: 2 * twice : 2]
        mended = gate(base.replace(time=time), accept=["jitter"], repair=True)
        assert len(mended) == kept


def test_saturation_is_ten_samples_five_in_a_row_and_four_times_what_is_just_below():
    n, t = 4000, 1e-3 * np.arange(4000)
    q = np.sin(3.0 * t)

    def flat(count, below):
        x = 5.0 * np.sin(7.0 * t) * np.linspace(0.2, 0.9, n) + 1e-3 * np.sin(np.arange(n) * 1.7)
        x[1000 : 1000 + count] = 6.0
        x[2000 : 2000 + below] = 6.0 - 0.012 * np.linspace(0.2, 1.0, max(below, 1))[:below]
        return [f.where.size for f in named(log_of(n, position=q, torque=x), "saturation")]

    assert flat(9, 0) == []
    assert flat(12, 0) == [12]
    x = 5.0 * np.sin(7.0 * t)
    x[::300] = 6.0
    assert named(log_of(n, position=q, torque=x), "saturation") == []  # never in a row


def test_a_silent_torque_and_a_dead_channel_are_named():
    t = 1e-3 * np.arange(2000)
    (found,) = [
        f for f in check(log_of(position=np.sin(5.0 * t), torque=np.zeros(2000))) if f.severity == "spoils"
    ]
    assert (found.name, found.value) == ("silent-torque", 0.0)
    (found,) = [
        f
        for f in check(log_of(position=np.sin(5.0 * t), torque=np.full(2000, 2.5)))
        if f.severity == "spoils"
    ]
    assert (found.name, found.value) == ("stuck", 2.5)
    still = [
        f
        for f in check(log_of(position=np.full(2000, 1.0), torque=0.1 * RNG.standard_normal(2000)))
        if f.name == "no-motion"
    ]
    assert [f.severity for f in still] == ["spoils"]
    ramp = [f for f in check(log_of(position=np.full(2000, 1.0), torque=np.sin(t))) if f.name == "no-motion"]
    assert [f.severity for f in ramp] == ["note"]


def test_a_fault_of_one_joint_names_rows_of_the_log_as_it_was_given():
    """Rows that an earlier repair dropped do not shift what a later check names."""
    x, q = np.linspace(0.0, 1.0, 2000) ** 1.5, smooth()
    q[40] = np.nan
    x[900] += 9.0
    found = {f.name: f.where.tolist() for f in check(log_of(position=q, torque=x)) if f.where is not None}
    assert found["nan"] == [40] and found["outlier"] == [900]


# ---------------------------------------------------------------------------------- clocks out of order


def test_swapped_samples_are_counted_and_sorted():
    base = log_of(1000, position=smooth(1000))
    order = np.arange(1000)
    order[[300, 301]] = order[[301, 300]]
    order[600:604] = order[600:604][::-1]
    (found,) = named(base.rows(order), "unsorted-time")
    assert found.where.tolist() == [301, 601, 602, 603]
    assert found.value == pytest.approx(1e-3)
    mended = gate(base.rows(order), repair=True)
    assert mended.time == pytest.approx(base.time) and np.array_equal(mended.position, base.position)
    assert any("6 samples out of order" in note for note in mended.notes)


def restarted(begin, length=600):
    """600 samples, then a clock that begins again at `begin` [s] for so many samples, the motion going on or not."""
    time = np.concatenate([1e-3 * np.arange(600), begin + 1e-3 * np.arange(length)])
    q = smooth(600 + length)
    return log_of(600 + length, position=q).replace(time=time)


@pytest.mark.parametrize("begin", [0.0, 0.2, 0.58, 0.59])
def test_a_clock_that_starts_again_begins_another_run(begin):
    log = restarted(begin)
    (found,) = named(log, "unsorted-time")
    assert found.where.tolist() == [600]
    assert found.value == pytest.approx(0.599 - begin)
    mended = gate(log, repair=True)  # the motion goes on: only the clock was set back
    assert np.diff(mended.time) == pytest.approx(1e-3)
    leaps = log.replace(position=np.r_[log.position[:600], log.position[600:] + 2.0])
    apart = gate(leaps, accept=["position-jump"], repair=True)
    assert np.diff(apart.time)[599] == pytest.approx(10e-3)  # four times what counts as a gap
    assert np.diff(np.delete(apart.time, 600))[:599] == pytest.approx(1e-3)


def test_two_samples_sent_late_begin_no_run():
    time = 1e-3 * np.arange(800)
    for late, rows in ((2, [400, 401]), (4, [400, 401, 402, 403])):
        moved = time.copy()
        moved[400 : 400 + late] -= 20.5e-3
        (found,) = named(log_of(800, position=smooth(800)).replace(time=moved), "unsorted-time")
        assert found.where.tolist() == rows


# ------------------------------------------------------------------------------- frozen, wrapped, lost


def noisy(n=4000, seed=5):
    t = 1e-3 * np.arange(n)
    generator = np.random.default_rng(seed)
    q = np.sin(3.0 * t)
    return q, 3.0 * np.cos(3.0 * t), 4.0 * np.sign(np.cos(3.0 * t)) + 0.2 * generator.standard_normal(n)


@pytest.mark.parametrize(("length", "found"), [(19, []), (20, [(1000, 1020)]), (150, [(1000, 1150)])])
def test_a_torque_with_noise_never_holds_a_value_for_20_samples(length, found):
    q, _, tau = noisy()
    tau[1000 : 1000 + length] = tau[1000]
    log = log_of(4000, position=q, torque=tau)
    assert [tuple(r) for r in standstill_runs(Exam(log), "torque", 0)] == found
    stuck = [f for f in check(log) if f.name == "stuck"]
    assert [f.where.tolist() for f in stuck] == [list(range(a + 1, b)) for a, b in found]
    if found:
        assert stuck[0].severity == ("spoils" if length > 41 else "warn") and stuck[0].value == length
        assert len(gate(log, accept=[], repair=True)) == 4000 - (length - 1)


def test_a_position_that_stood_while_the_velocity_went_on():
    q, v, _ = noisy()
    for start, length, said in ((1000, 100, True), (480, 90, False)):  # at the turning point nothing moves
        x = q.copy()
        x[start : start + length] = x[start]
        if not said:
            x[start : start + length] = q[start : start + length].mean()
            x = np.round(x, 4)
        got = standstill_runs(Exam(log_of(4000, position=x, velocity=v)), "position", 0)
        assert bool(got) is said
        if said:
            assert got == [(start, start + length)]


def test_a_torque_at_zero_is_silent_and_not_stuck():
    q, _, tau = noisy()
    tau[1000:1100] = 0.0
    found = {f.name: f for f in check(log_of(4000, position=q, torque=tau)) if f.severity != "note"}
    assert set(found) == {"silent-torque"}
    assert found["silent-torque"].where.tolist() == list(range(1000, 1100))


@pytest.mark.parametrize("bits", [16, 32])
@pytest.mark.parametrize("scale", [1.0, 0.01])
def test_an_integer_of_the_wrong_type_is_off_by_a_power_of_two(bits, scale):
    q, _, tau = noisy()
    counts = np.rint(tau / 0.01)
    wrong = np.mod(counts, 2.0**bits) * scale
    log = log_of(4000, position=q, torque=wrong)
    (found,) = [f for f in check(log) if f.severity == "spoils"]
    assert found.name == "integer-wrap"
    assert found.value == pytest.approx(2.0**bits * scale, rel=1e-9)
    assert found.where.tolist() == np.flatnonzero(counts < 0).tolist()
    assert gate(log, repair=True).torque[:, 0] == pytest.approx(
        counts * scale, abs=1e-5 * scale * 2.0 ** (bits - 16)
    )


@pytest.mark.parametrize(
    ("period", "unit"), [(2.0 * np.pi, "rad"), (np.pi, "rad"), (4.0 * np.pi, "rad"), (0.512, "m")]
)
def test_a_position_that_wraps_comes_back(period, unit):
    n = 4000
    t = 1e-3 * np.arange(n)
    truth = (5.0 if unit == "rad" else 0.6) * np.sin(2.0 * t) + (0.3 * t if unit == "rad" else 0.05 * t)
    if unit == "m":
        truth = 0.002 * np.rint(truth / 0.002)  # a counter of 256 steps
    log = log_of(n, unit=unit, position=np.mod(truth, period), reference=np.mod(truth, period))
    (found,) = [f for f in check(log) if f.severity == "spoils"]
    assert found.name == "encoder-wrap"
    assert found.value == pytest.approx(period, rel=1e-3)
    assert found.where.tolist() == (np.flatnonzero(np.diff(np.floor(truth / period + 1e-9))) + 1).tolist()
    mended = gate(log, repair=True)
    for channel in (mended.position, mended.reference):
        assert channel[:, 0] - channel[0, 0] == pytest.approx(truth - truth[0], abs=1e-9)


def test_a_jump_that_stays_is_named_and_one_that_comes_back_is_not():
    q, _, _ = noisy()
    for size, rows in ((0.5, [2000]), (-0.7, [2000])):
        x = q.copy()
        x[2000:] += size
        (found,) = [f for f in check(log_of(4000, position=x)) if f.severity == "spoils"]
        assert (found.name, found.where.tolist()) == ("position-jump", rows)
        assert found.value == pytest.approx(abs(size), rel=1e-3)
    x = q.copy()
    x[2000] += 0.5
    assert [f.name for f in check(log_of(4000, position=x)) if f.severity != "note"] == ["outlier"]
    for edge in (1, 3999):  # one sample alone at an end
        x = q.copy()
        x[edge:] += 0.5
        assert not named(log_of(4000, position=x), "position-jump")


def test_holes_in_the_clock_and_in_several_channels():
    q, v, tau = noisy(1000)
    time = 1e-3 * np.arange(1000)
    time[7] = np.nan
    log = log_of(1000, position=q, velocity=v, torque=tau).replace(time=time)
    (found,) = named(log, "nan")
    assert (found.where.tolist(), found.channel, found.value) == ([7], None, 1)
    assert len(gate(log, repair=True)) == 999
    v[:600], tau[[3, 9]] = np.inf, -np.inf
    found = {f.channel: f for f in named(log_of(1000, position=q, velocity=v, torque=tau), "infinite")}
    assert found["velocity"].value == 600 and found["torque"].where.tolist() == [3, 9]
    mended = gate(log_of(1000, position=q, velocity=v, torque=tau), repair=True)
    assert mended.velocity is None and len(mended) == 998
    tau[:] = np.nan
    assert not named(log_of(1000, position=q, torque=tau), "nan")[0].repairable
    holed = [np.where(np.arange(1000) < 600, np.nan, x) for x in (q, np.cos(q))]
    mended = gate(log_of(1000, position=holed[0], velocity=holed[1]), repair=True)  # one of them has to stay
    assert mended.velocity is None and mended.position[:, 0] == pytest.approx(q[600:])


def test_a_note_of_friction_that_cannot_be_seen():
    """Below 2 % of the torque's scatter, with three standard errors."""
    for share, said in ((0.0193, True), (0.0207, False)):
        log, _ = viscous_log(-share)
        assert bool(named(log, "no-friction")) is said
    noise = any_motion(lambda v: 0.0 * v, inertia=0.02, noise=3.0, seed=2)
    mean, error, scatter = torque_sign.friction(Exam(noise), 0)
    assert bool(named(noise, "no-friction")) is (abs(mean) + 3.0 * error < 0.02 * scatter)


def test_limits_are_flat_ends_and_not_peaks():
    t = 1e-3 * np.arange(4000)
    tau = 5.0 * np.sin(9.0 * t) + 0.05 * np.random.default_rng(1).standard_normal(4000)
    for top, low in ((4.0, -9.0), (9.0, -3.0), (3.5, -3.5)):
        clipped = np.clip(tau, low, top)
        found = {
            f.value: f.where.tolist()
            for f in named(log_of(4000, position=np.sin(3.0 * t), torque=clipped), "saturation")
        }
        wanted = {
            limit: np.flatnonzero(clipped == limit).tolist()
            for limit in (top, low)
            if np.any(clipped == limit)
        }
        assert found == wanted


def test_torque_stands_still_only_where_the_joint_moves():
    """By the position: in each third of the run; by the velocity: in nine tenths of it."""
    q, v, tau = noisy()
    tau[1000:1100] = tau[1000]
    for rest, by_position, by_velocity in (
        (0, True, True),
        (30, True, False),
        (60, False, False),
        (100, False, False),
    ):
        still, slow = q.copy(), v.copy()
        still[1000 : 1000 + rest] = still[1000]
        slow[1000 : 1000 + rest] = 0.0
        at = standstill_runs(Exam(log_of(4000, position=still, torque=tau)), "torque", 0)
        assert bool(at) is by_position
        assert (
            bool(standstill_runs(Exam(log_of(4000, velocity=slow, torque=tau)), "torque", 0)) is by_velocity
        )


def test_a_velocity_that_stood_while_the_position_left_the_straight_line():
    q, v, _ = noisy()
    for length, found in (
        (30, []),
        (200, [(500, 700)]),
    ):  # at 9 rad/s^2 the line is left by 5 % of the top speed after 0.03 s
        held = v.copy()
        held[500 : 500 + length] = held[500]
        assert standstill_runs(Exam(log_of(4000, position=q, velocity=held)), "velocity", 0) == found
    level = np.interp(
        1e-3 * np.arange(4000), [0.0, 1.0, 2.0, 4.0], [0.0, 1.0, 1.0, 0.0]
    )  # one speed for a second
    path = np.cumsum(level) * 1e-3
    assert standstill_runs(Exam(log_of(4000, position=path, velocity=level)), "velocity", 0) == []


def test_saturation_is_not_frozen_and_a_dead_channel_neither():
    q, _, tau = noisy()
    tau = np.clip(tau, -3.9, 3.9)
    assert standstill_runs(Exam(log_of(4000, position=q, torque=tau)), "torque", 0) == []
    assert standstill_runs(Exam(log_of(4000, position=q, torque=np.full(4000, 2.0))), "torque", 0) == []


def test_a_second_encoder_that_stands_and_a_dead_velocity():
    q, v, _ = noisy()
    stuck_ = q.copy()
    stuck_[800:1000] = stuck_[800]
    found = [
        f for f in check(log_of(4000, position=q, velocity=v, second_encoder=stuck_)) if f.severity != "note"
    ]
    assert {f.channel for f in found} == {"second_encoder"}
    (dead,) = [
        f for f in check(log_of(4000, position=q, velocity=np.full(4000, 0.2))) if f.severity != "note"
    ]
    assert (dead.name, dead.channel, dead.value, dead.repairable) == ("stuck", "velocity", 0.2, True)
    assert gate(log_of(4000, position=q, velocity=np.full(4000, 0.2)), repair=True).velocity is None
    (dead,) = [
        f for f in check(log_of(4000, position=np.full(4000, 0.2), velocity=v)) if f.severity != "note"
    ]
    assert (dead.name, dead.channel, dead.severity, dead.repairable) == ("stuck", "position", "spoils", False)
    trembling = log_of(
        4000, position=np.full(4000, 0.2), velocity=1e-3 * np.random.default_rng(1).standard_normal(4000)
    )
    assert not [f for f in check(trembling) if f.name == "stuck"]


def test_the_span_of_a_plan_is_that_of_the_nearest_joint():
    t = np.linspace(0.0, 2.0 * np.pi, 4000)
    both = log_of(4000, position=np.column_stack([0.4 * np.sin(t), 0.7 * np.sin(t)]))
    (found,) = named(both, "plan-mismatch", plan=Plan())
    assert (found.joint, found.value) == ("j1", pytest.approx(1.4, rel=1e-5))


def test_a_coarse_clock_with_a_jump_is_spread_between_its_stamps():
    stamps = np.repeat(np.r_[np.arange(100) * 5e-3, 0.8 + np.arange(100) * 5e-3], 5)
    log = log_of(1000, position=smooth(1000)).replace(time=stamps)
    mended = gate(log, accept=["gaps", "jitter"], repair=True)
    assert mended.time[:495] == pytest.approx(1e-3 * np.arange(495))
    assert mended.time[500:995] == pytest.approx(0.8 + 1e-3 * np.arange(495))
    interval = (stamps[995] - stamps[0]) / 995
    assert mended.time[995:] == pytest.approx(stamps[995] + interval * np.arange(5))


def test_a_reference_that_wraps_is_unwrapped_from_its_first_value():
    t = 1e-3 * np.arange(4000)
    truth = 5.0 * np.sin(2.0 * t) + 0.4
    log = log_of(4000, position=np.mod(truth, 2 * np.pi), reference=np.mod(truth + 0.01, 2 * np.pi))
    mended = gate(log, repair=True)
    assert mended.reference[0, 0] == pytest.approx(0.41) and mended.position[0, 0] == pytest.approx(0.4)
    assert mended.reference[:, 0] == pytest.approx(truth + 0.01, abs=1e-9)


def test_jumps_are_three_times_nearly_all_steps_and_six_counts():
    """Where the encoder moves by single counts, six of them are no jump and seven are."""
    n, count = 4000, 1e-3
    q = count * np.floor(0.3 * np.arange(n))
    for counts, found in ((6, None), (9, [2000])):
        x = q.copy()
        x[2000:] += counts * count
        got = jumps(Exam(log_of(n, position=x)), "position", 0)
        assert (None if got is None else got.rows.tolist()) == found


def test_changes_and_samples_of_a_channel_are_absolute_and_by_piece():
    x = smooth()
    time = 1e-3 * np.arange(2000)
    time[900:] += 1.0
    exam = Exam(log_of(position=x).replace(time=time))
    assert exam.changes("position", 0) == pytest.approx(np.abs(np.r_[np.diff(x[:900]), np.diff(x[900:])]))
    assert exam.sample("position", 0) == pytest.approx(x) and exam.column("position", 0).flags.c_contiguous
    assert not exam.usable("torque", 0) and exam.usable("position", 0)
    assert [name for _, name in exam] == ["j0"]
    assert np.isnan(Exam(log_of(2, position=np.zeros(2)).rows(slice(0, 1))).period)


def test_the_gate_says_what_it_lets_pass():
    q, _, tau = noisy()
    tau[[500, 900]] = np.nan
    log = log_of(4000, position=q, torque=tau)
    with pytest.raises(UnhealthyLog) as stopped:
        gate(log)
    assert "--repair, or --accept nan" in stopped.value.remedy
    kept, left = screen(log, accept=["nan"])
    assert len(kept) == 4000 and any(note.startswith("Accepted [nan]") for note in kept.notes) and left == []
    mended, left = screen(log, repair=True)
    assert len(mended) == 3998 and [f.name for f in left] == []
    assert gate(log_of(4000, position=q), repair=True).notes == ()
    as_dict = check(log)[0].to_dict()
    assert (as_dict["count"], as_dict["where"], as_dict["value"], as_dict["repairable"]) == (
        2,
        [500, 900],
        2.0,
        True,
    )


@pytest.mark.parametrize(
    ("late", "severity"),
    [
        (2.5e-3, None),
        (3.5e-3, "note"),
        (-3.5e-3, "note"),
        (24e-3, "note"),
        (26.5e-3, "warn"),
        (-26.5e-3, "warn"),
    ],
)
def test_a_velocity_that_lags_is_as_a_filter_up_to_25_ms(late, severity):
    t = 1e-3 * np.arange(8000)
    move = lambda x: np.sin(3.0 * x) + 0.2 * np.sin(11.0 * x)  # noqa: E731
    v = 3.0 * np.cos(3.0 * (t - late)) + 2.2 * np.cos(11.0 * (t - late))
    found = named(log_of(8000, position=move(t), velocity=v), "velocity-mismatch")
    assert [f.severity for f in found] == ([] if severity is None else [severity])
    if found:
        assert found[0].value == pytest.approx(late, rel=0.05) and found[0].quantity == "delay"
        way = "lags" if late > 0 else "leads"
        by = 1e3 * abs(found[0].value)
        assert f"{way} its position by {by:.3g} ms ({by:.1f} samples)" in found[0].sentence
        assert found[0].repairable is (severity == "warn")


@pytest.mark.parametrize(("speed", "window"), [(0.04, 0.1), (0.015, 0.3), (0.005, 0.9)])
def test_windows_of_velocity_grow_until_24_counts_were_moved(speed, window):
    n, count = 20000, 1e-4
    t = 1e-3 * np.arange(n)
    slow = speed * (1.0 + 0.2 * np.sin(1.3 * t))
    q = count * np.rint(np.cumsum(slow) * 1e-3 / count)
    fit = velocity_fit(Exam(log_of(n, position=q, velocity=slow)), 0)
    assert fit.window == pytest.approx(window) and fit.scale == pytest.approx(1.0, abs=0.02)


def test_one_driver_has_one_sign():
    """Where all joints that tell are inverted, and they are several, those that do not tell are turned with them."""
    dry = any_motion(lambda v: 5.0 * np.sign(v) + v, seconds=16.0)
    other = any_motion(lambda v: 4.0 * np.sign(v) + v, seconds=16.0, seed=3, phase=2.0)
    n = len(dry)
    one_way, hum = (
        0.3 * dry.time,
        3.0 + 0.3 * np.random.default_rng(2).standard_normal(n),
    )  # friction or gravity

    def names(*signs):
        log = Log(
            time=dry.time, joints=tuple(Joint(name=name) for name in "abc"),
            position=np.column_stack([dry.position, other.position, one_way]),
            torque=np.column_stack([signs[0] * dry.torque, signs[1] * other.torque, hum]),
        )  # fmt: skip
        return "".join(f.joint for f in named(log, "torque-sign"))

    assert [names(1, 1), names(-1, 1), names(1, -1), names(-1, -1)] == ["", "a", "b", "abc"]


def test_directions_have_a_tenth_of_the_samples_each():
    n, dt = 12000, 2e-3
    t = dt * np.arange(n)
    for share, told in ((0.085, False), (0.115, True)):  # back for so much of the time, at the same speed
        back = (t % 2.0) < 2.0 * share
        v = np.convolve(np.where(back, -1.0, 1.0), np.ones(9) / 9.0, "same") * (1.0 + 0.2 * np.sin(7.0 * t))
        log = log_of(n, dt, position=np.cumsum(v) * dt, torque=3.0 * np.sign(v) + 0.5 * np.gradient(v, dt))
        assert (torque_sign.friction(Exam(log), 0) is not None) is told


@pytest.mark.parametrize(("bits", "name"), [(12, "encoder-wrap"), (16, "encoder-wrap"), (14, "outlier")])
def test_a_single_reading_off_by_a_counters_range_is_a_wrap(bits, name):
    count = 1e-3
    q = count * np.rint(smooth() / count)
    q[700] += count * 2.0**bits
    (found,) = [f for f in check(log_of(position=q, unit="m")) if f.severity != "note"]
    assert found.name == name
    if name == "encoder-wrap":
        assert found.value == pytest.approx(count * 2.0**bits) and found.where.tolist() == [700, 701]
        assert np.abs(gate(log_of(position=q, unit="m"), repair=True).position).max() < 1.4


def test_a_rounded_signal_that_stands_and_then_jumps_was_frozen():
    """Smooth and rounded to 0.05: it comes out of a level stretch as it went in, unless by more than six steps."""
    t = 1e-3 * np.arange(4000)
    tau = 0.05 * np.rint(3.0 * np.sin(2.0 * t) / 0.05)
    for length, found in ((30, []), (300, [(1500, 1800)])):
        x = tau.copy()
        x[1500 : 1500 + length] = x[1500]
        got = [
            r for r in standstill_runs(Exam(log_of(4000, position=np.sin(3.0 * t), torque=x)), "torque", 0)
        ]
        assert [(a, b) for a, b in got if a <= 1500 < b and b >= 1790] == (
            [(got[0][0], got[0][1])] if found else []
        )
        assert bool(got) is bool(found)


def test_repairs_say_what_they_did():
    q, v, tau = noisy()
    wrapped = np.mod(np.rint(tau / 0.01), 65536.0) * 0.01
    cases = {
        "taken off again at": log_of(4000, position=q, torque=wrapped),
        "multiplied by -1": viscous_log(0.5)[0],
        "was left out: it contradicts": log_of(4000, position=q, velocity=-v),
        "divided by 57.2958": log_of(4000, position=np.rad2deg(q), velocity=v),
        "replaced by the mean": log_of(4000, position=q, torque=tau + 90.0 * (np.arange(4000) == 900)),
        "was unwrapped": log_of(4000, position=np.mod(9.0 * q, 2 * np.pi)),
    }
    for words, log in cases.items():
        assert any(words in note for note in gate(log, repair=True).notes), words
