"""What health checks make of positions and velocities: jumps, wraps, units, scale and delay, by loops and from both sides."""

import numpy as np
import pytest

from _health import about, log_of, named
from backdrive.logs.health import degrees, encoder_wrap, gate, position_jump, velocity_mismatch
from backdrive.logs.health._exam import Exam
from backdrive.logs.health._jumps import jumps
from backdrive.logs.health._velocity_fit import VelocityFit, velocity_fit
from backdrive.logs.resolution import white_noise

# ----------------------------------------------------------------------------------------------- jumps


def jumps_by_loops(x, resolution, gaps=()):
    """The definition step by step: row, size, slack and whether it is back at once."""
    change = np.diff(x)
    last = len(change) - 1
    near = lambda k: change[min(max(k, 0), last)]  # noqa: E731
    inside = [abs(c) for k, c in enumerate(change) if k + 1 not in gaps]
    brisk, usual = np.quantile(inside, 0.9), np.quantile(inside, 0.995)
    if brisk > 0:
        usual = min(usual, 4 * brisk)
    if usual == 0:
        return []
    found = []
    for k, c in enumerate(change):
        if abs(c) <= max(3 * usual, 6 * resolution) or k + 1 in gaps:
            continue
        before = (-6, -5, -4, -3) if k >= 6 else (7, 8, 9, 10)
        after = (3, 4, 5, 6) if k + 6 < len(change) else (-10, -9, -8, -7)
        around = [near(k + o) for o in (*before, *after)]
        size = c - np.median(around)
        if abs(size) <= 8 * max(np.median(np.abs(around)), resolution):
            continue
        beside = [near(k + o) - np.median(around) for o in (-1, 1)]
        back = any(b * size < 0 and abs(b) > 0.5 * abs(size) for b in beside)
        found.append((k + 1, size, max(around) - min(around) + 2 * resolution, back))
    return found


@pytest.mark.parametrize("count", [0.0, 0.125])
@pytest.mark.parametrize("with_gap", [False, True])
def test_jumps_are_those_of_the_definition(count, with_gap):
    seen, back = 0, 0
    for seed in range(60):
        generator = np.random.default_rng(seed)
        n, k = 500, np.arange(500)
        x = 10.0 * np.sin(k / generator.uniform(8.0, 80.0)) * (k < generator.choice([250, 500]))
        x += 10.0 ** generator.uniform(-4, -1) * generator.standard_normal(n)
        if seed % 3 == 0:
            x[100:400] = x[100]
        for row in (*generator.integers(1, n, 3), *generator.choice([1, 2, 3, 5, 496, 498, 499], 1)):
            size = 10.0 ** generator.uniform(-0.5, 1.5) * generator.choice([-1.0, 1.0])
            if generator.random() < 0.5:
                x[row:] += size
            else:
                x[row] += size
                x[row + 1 :] += size * generator.uniform(-0.8, 0.8)
        if count:
            x = count * np.rint(x / count)
        time = 1e-3 * k
        gap = int(generator.integers(150, 350)) if with_gap else n
        time[gap:] += 0.1
        x[gap:] += 2.0 * with_gap
        exam = Exam(log_of(n, time=time, position=x))
        wanted = jumps_by_loops(x, exam.quantum("position", 0), (gap,))
        got = jumps(exam, "position", 0)
        if not wanted:
            assert got is None, seed
            continue
        assert got is not None and got.rows.tolist() == [w[0] for w in wanted], seed
        assert got.sizes == pytest.approx([w[1] for w in wanted]), seed
        assert got.slack == pytest.approx([w[2] for w in wanted], abs=1e-12), seed
        assert got.glitch.tolist() == [w[3] for w in wanted], seed
        assert got.resolution == exam.quantum("position", 0)
        seen, back = seen + len(wanted), back + sum(w[3] for w in wanted)
    assert seen > 50 and back > 10


def test_where_nothing_can_jump():
    x = np.where(np.arange(1000) < 500, 0.0, 3.0)  # it stands, and never moves but once
    assert jumps(Exam(log_of(1000, position=x)), "position", 0) is None
    assert jumps(Exam(log_of(1000, position=x)), "torque", 0) is None
    x[3] = np.nan
    assert jumps(Exam(log_of(1000, position=x)), "position", 0) is None


def wavy(n=2000, step=0.01):
    """A position that moves by steps of nearly one size, so that no step is a multiple of another."""
    return step * (np.arange(n) + 5e-3 * np.sin(np.arange(n) ** 2))


def test_position_jumps_are_named_with_the_largest_and_the_first():
    x = np.column_stack([wavy(), wavy(), wavy()])
    x[700:, 1] += 0.3
    x[1500:, 1] -= 0.5
    x[900:, 2] += 1.0
    for unit in ("rad", "m"):
        found = position_jump.find(Exam(log_of(unit=unit, position=x, second_encoder=x[:, [0, 2, 0]])))
        assert [(f.joint, f.channel) for f in found] == [
            ("j1", "position"),
            ("j2", "position"),
            ("j1", "second_encoder"),
        ]
        assert about(found[0])[2:] == ("spoils", pytest.approx(0.5, abs=1e-3), [700, 1500], False)
        assert found[0].sentence == (
            f"position of j1 jumps 2 times, by up to {-found[0].value:.4g} {unit}, first at sample 700: no joint moves so fast."
        )
        assert "by up to 1 " in found[1].sentence and "jumps 1 time," in found[1].sentence


@pytest.mark.parametrize(("row", "said"), [(1, False), (2, True), (1998, True), (1999, False)])
def test_a_jump_beside_the_end_of_a_log_may_be_one_wrong_sample(row, said):
    x = wavy()
    x[row:] += 0.5
    assert bool(position_jump.find(Exam(log_of(position=x)))) is said


# ----------------------------------------------------------------------------------------------- wraps


def steady(jump_sizes, n=2000, unit="rad"):
    """A steady motion with such jumps at samples 300, 600 and so on."""
    x = wavy(n)
    for k, size in enumerate(jump_sizes):
        x[300 * (k + 1) :] += size
    return log_of(n, unit=unit, position=x)


@pytest.mark.parametrize("period", [2.0 * np.pi, np.pi, 4.0 * np.pi, 360.0])
def test_one_jump_of_a_turn_is_a_wrap_of_a_rotary_joint_only(period):
    log = steady([-period])
    (found,) = encoder_wrap.find(Exam(log))
    assert about(found) == ("j0", "position", "spoils", period, [300], True)
    assert found.sentence == (
        f"position of j0 wraps around 1 time by {period:.5g} rad{' (one turn)' if period == 2 * np.pi else ''}, "
        "first at sample 300."
    )
    assert not position_jump.find(Exam(log))
    assert not encoder_wrap.find(Exam(steady([-period], unit="m")))
    assert len(position_jump.find(Exam(steady([-period], unit="m")))) == 1


@pytest.mark.parametrize(("off", "wraps"), [(0.60e-3, True), (0.64e-3, False)])
def test_a_wrap_may_be_off_by_what_the_steps_around_it_differ(off, wraps):
    """Steps of 10 and 10.618 mrad in turn, which have no common measure: they differ by 0.618, and their median is 10.309."""
    x = np.concatenate([[0.0], np.cumsum(np.where(np.arange(1999) % 2, 0.010618, 0.010))])
    x[300:] += 2.0 * np.pi - 0.000309 + off  # the longer step
    assert bool(encoder_wrap.find(Exam(log_of(position=x)))) is wraps


@pytest.mark.parametrize(("share", "wraps"), [(0.019, True), (0.021, False)])
def test_a_wrap_may_be_off_by_a_fiftieth_at_most(share, wraps):
    """However much the steps around it differ: here by 0.4."""
    x = np.concatenate([[0.0], np.cumsum(np.where(np.arange(1999) % 2, 0.21, -0.2))])
    x += 1e-6 * np.sin(np.arange(2000) ** 2)
    x[301:] += np.pi * (1.0 + share) + 0.205  # the step of -200 mrad, where the median is 5
    found = encoder_wrap.find(Exam(log_of(position=x)))
    assert [f.where.tolist() for f in found] == ([[301]] if wraps else [])


@pytest.mark.parametrize(("times", "wraps"), [(2, False), (3, True)])
def test_three_jumps_of_one_size_wrap_whatever_the_size(times, wraps):
    log = steady([-1.7] * times, unit="m")
    found = encoder_wrap.find(Exam(log))
    assert bool(found) is wraps
    if wraps:
        assert found[0].value == pytest.approx(1.7, abs=1e-3) and found[0].where.tolist() == [300, 600, 900]
    mixed = encoder_wrap.find(Exam(steady([-1.7, -1.7, 1.7, -5.0], unit="m")))
    assert mixed[0].where.tolist() == [300, 600, 900]  # the other one is a jump
    assert position_jump.find(Exam(steady([-1.7, -1.7, 1.7, -5.0], unit="m")))[0].where.tolist() == [1200]


@pytest.mark.parametrize(
    ("off", "unit", "said"), [(8e-3, "rad", True), (12e-3, "rad", False), (0.0, "m", False)]
)
def test_one_turn_is_said_of_a_turn(off, unit, said):
    (found,) = encoder_wrap.find(Exam(steady([-2.0 * np.pi - off] * 3, unit=unit)))
    assert ("(one turn)" in found.sentence) is said


@pytest.mark.parametrize(
    ("bits", "stays", "back"),
    [(7, 0, 0), (8, 1, 0), (9, 1, 0), (12, 1, 1), (15, 1, 0), (16, 1, 1), (31, 1, 0), (32, 1, 1), (33, 0, 0)],
)
def test_a_counter_wraps_by_eight_to_32_bits_and_one_reading_by_12_16_or_32(bits, stays, back):
    count = 0.5
    x = count * np.floor(0.4 * np.arange(2000))
    away, alone = x.copy(), x.copy()
    away[1000:] += count * 2.0**bits
    alone[1000] += count * 2.0**bits
    for values, wraps, rows in ((away, stays, [1000]), (alone, back, [1000, 1001])):
        found = encoder_wrap.find(Exam(log_of(unit="m", position=values)))
        assert [f.where.tolist() for f in found] == [rows] * wraps
        if wraps:
            assert found[0].value == pytest.approx(count * 2.0**bits, rel=1e-9)


def test_the_period_that_explains_the_most_jumps_is_taken():
    (found,) = encoder_wrap.find(Exam(steady([-2 * np.pi, np.pi, -np.pi])))
    assert found.value == np.pi and found.where.tolist() == [600, 900]
    (found,) = encoder_wrap.find(Exam(steady([-2 * np.pi, np.pi])))
    assert found.value == 2 * np.pi and found.where.tolist() == [300]  # the first of the table


def test_a_wrap_of_either_encoder_is_unwrapped_and_the_reference_goes_with_the_position():
    t = 1e-3 * np.arange(4000)
    truth = 3.0 * t + 0.5 * np.sin(3.0 * t)
    other = np.mod(truth + 0.2, 2 * np.pi)
    log = log_of(4000, position=truth, second_encoder=other, reference=np.mod(truth, 2 * np.pi))
    mended = gate(log, repair=True)
    assert mended.second_encoder[:, 0] == pytest.approx(truth + 0.2) and np.array_equal(
        mended.position, log.position
    )
    assert np.array_equal(mended.reference, log.reference)
    assert mended.notes == ("second_encoder of j0 was unwrapped 1 time by 6.2832.",)
    log = log_of(4000, position=np.mod(truth, 2 * np.pi), reference=np.mod(truth, 2 * np.pi))
    assert gate(log, repair=True).notes == (
        "position of j0 was unwrapped 1 time by 6.2832.",
        "reference of j0 was unwrapped like its position.",
    )
    log = log_of(4000, position=np.mod(truth, 2 * np.pi), reference=truth)
    mended = gate(log, repair=True)
    assert np.array_equal(mended.reference, log.reference) and len(mended.notes) == 1
    both = np.column_stack([truth, np.mod(truth, 2 * np.pi)])
    mended = gate(log_of(4000, position=both), repair=True)
    assert mended.position == pytest.approx(np.column_stack([truth, truth]))


# ------------------------------------------------------------------------- what a velocity says of its position


def fitted(q, v, t, window, pieces=None, stride=None):
    """Scale, delay, what is left, and what is left without the delay: least squares over windows, twice."""
    change, area, ends = [], [], []
    for piece in pieces or [slice(0, len(q))]:
        x, w, s = q[piece], v[piece], t[piece]
        path = np.concatenate([[0.0], np.cumsum(0.5 * (w[1:] + w[:-1]) * np.diff(s))])
        for start in range(0, len(x) - window, stride or max(1, window // 4)):
            change.append(x[start + window] - x[start])
            area.append(path[start + window] - path[start])
            ends.append(w[start + window] - w[start])
    d, X = np.array(change), np.column_stack([area, ends])
    keep = np.ones(d.size, bool)
    for _ in range(2):
        theta = np.linalg.lstsq(X[keep], d[keep], rcond=None)[0]
        left = d - X @ theta
        keep = np.abs(left) <= 4.0 * np.sqrt(np.mean(left[keep] ** 2))
    power = np.mean(d**2)
    lone = X[:, 0] @ d / (X[:, 0] @ X[:, 0])
    plain = np.sqrt(np.mean((d - lone * X[:, 0]) ** 2) / power)
    return theta[0], theta[1] / theta[0], np.sqrt(np.mean(left[keep] ** 2) / power), plain


@pytest.mark.parametrize(
    ("n", "dt", "window", "stride"),
    [(4000, 1e-3, 100, 25), (400, 0.02, 5, 1), (16384, 0.02, 5, 2), (24576, 0.012, 8, 3)],
)
@pytest.mark.parametrize("fault", ["none", "jump"])
def test_velocity_and_position_are_fitted_over_windows_of_a_tenth_of_a_second(n, dt, window, stride, fault):
    generator = np.random.default_rng(n)
    t = 3.0 + dt * np.arange(n)
    q = 5.0 * np.sin(0.9 * t) + 2.0 * np.sin(2.3 * t) + 0.02 * generator.standard_normal(n)
    v = 1.2 * (
        4.5 * np.cos(0.9 * (t - 0.02)) + 4.6 * np.cos(2.3 * (t - 0.02))
    ) + 0.1 * generator.standard_normal(n)
    if fault == "jump":
        q[n // 3 :] += 9.0
    fit = velocity_fit(Exam(log_of(n, time=t, position=q, velocity=v)), 0)
    assert fit.window == pytest.approx(window * dt)
    wanted = fitted(q, v, t, window, stride=stride)
    assert (fit.scale, fit.delay, fit.residual, fit.plain) == pytest.approx(wanted, rel=1e-6)


def test_windows_do_not_reach_across_gaps_and_pieces_of_ten_samples_are_left_out():
    n, dt = 600, 0.02
    t = dt * np.arange(n)
    generator = np.random.default_rng(2)
    edges = [0, 10, 21, 300, 310, n]
    for edge in edges[1:-1]:
        t[edge:] += 0.3
    q = 5.0 * np.sin(0.9 * t) + 0.1 * generator.standard_normal(n)
    v = 4.5 * np.cos(0.9 * t) + 0.5 * generator.standard_normal(n)
    fit = velocity_fit(Exam(log_of(n, time=t, position=q, velocity=v)), 0)
    pieces = [slice(a, b) for a, b in zip(edges, edges[1:], strict=False) if b - a > 10]
    assert (fit.scale, fit.delay, fit.residual, fit.plain) == pytest.approx(
        fitted(q, v, t, 5, pieces), rel=1e-6
    )


@pytest.mark.parametrize(("n", "told"), [(399, False), (400, True)])
def test_a_window_is_a_quarter_of_the_longest_piece_at_most(n, told):
    t = 1e-3 * np.arange(n)
    fit = velocity_fit(Exam(log_of(n, position=np.sin(9.0 * t), velocity=9.0 * np.cos(9.0 * t))), 0)
    assert (fit is not None) is told


def test_no_fit_without_position_velocity_or_clock():
    t = 1e-3 * np.arange(2000)
    q, v = np.sin(3.0 * t), 3.0 * np.cos(3.0 * t)
    assert (
        velocity_fit(Exam(log_of(position=q)), 0) is None
        and velocity_fit(Exam(log_of(velocity=v)), 0) is None
    )
    assert velocity_fit(Exam(log_of(position=q, velocity=v, time=np.zeros(2000))), 0) is None
    assert velocity_fit(Exam(log_of(position=q, velocity=np.full(2000, 0.5))), 0) is None
    assert velocity_fit(Exam(log_of(10, 0.02, position=q[:10], velocity=v[:10])), 0) is None


@pytest.mark.parametrize(("n", "longest"), [(3590, 0.3), (3610, 0.9)])
@pytest.mark.parametrize(
    ("counts", "window"), [(25.0, 0.1), (22.0, 0.3), (8.2, 0.3), (7.8, 0.9), (2.8, 0.9), (1.25, None)]
)
def test_windows_grow_threefold_until_24_counts_are_moved_and_half_of_that_has_to_do(
    n, longest, counts, window
):
    """So many counts in a tenth of a second; a sawtooth velocity without noise, of which only one count is known."""
    count = 1e-3
    t = 1e-3 * np.arange(n)
    v = 10.0 * counts * count * (1.0 + 1e-3 * np.sin(t))
    q = count * np.rint(10.0 * counts * (t - 1e-3 * np.cos(t)))
    fit = velocity_fit(Exam(log_of(n, position=q, velocity=v)), 0)
    if window is None or window > longest:
        half = counts * longest / 0.1 > 12.0
        assert (fit is not None) is half and (fit is None or fit.window == pytest.approx(longest))
    else:
        assert fit is not None and fit.window == pytest.approx(window)


@pytest.mark.parametrize(
    ("speed", "window"),
    [(0.63, 0.1), (0.57, 0.3), (0.36, 0.3), (0.33, 0.9), (0.21, 0.9), (0.11, 0.9), (0.09, None)],
)
def test_and_until_six_times_the_noise_that_adds_up_is_exceeded(speed, window):
    """Noise of 1 rad/s adds up to dt sqrt(m) in a window of m samples; half is enough in the longest."""
    t = 1e-3 * np.arange(4000)
    v = np.random.default_rng(4).standard_normal(4000)
    v /= white_noise(v)
    q = speed * t + 1e-7 * np.sin(np.arange(4000) ** 2)
    fit = velocity_fit(Exam(log_of(4000, position=q, velocity=v)), 0)
    assert (None if fit is None else pytest.approx(fit.window)) == window


@pytest.mark.parametrize(("steps", "window"), [(3.2, 0.1), (2.8, 0.9), (1.6, 0.9), (1.4, None)])
def test_and_three_steps_of_a_rounded_velocity(steps, window):
    """What rounding takes away grows with the window, so longer windows do not help; half is enough in the longest."""
    t = 1e-3 * np.arange(4000)
    q = steps * t + 1e-7 * np.sin(np.arange(4000) ** 2)
    v = 1.0 * (np.arange(4000) % 50 == 0)  # known to 1 rad/s
    fit = velocity_fit(Exam(log_of(4000, position=q, velocity=v)), 0)
    assert (None if fit is None else pytest.approx(fit.window)) == window


def test_a_velocity_whose_change_is_like_itself_tells_no_delay():
    """Of an exponential nobody can say whether it is late or larger."""
    t = 1e-3 * np.arange(4000)
    fit = velocity_fit(Exam(log_of(4000, position=1.1 * np.exp(t), velocity=np.exp(t))), 0)
    assert (fit.scale, fit.delay) == (pytest.approx(1.1, rel=1e-6), 0.0)


def test_a_velocity_that_only_trembles_has_nothing_to_do_with_the_motion():
    t = 1e-3 * np.arange(4000)
    tremble = 1e-3 * (-1.0) ** np.arange(4000)
    fit = velocity_fit(Exam(log_of(4000, position=5.0 * np.sin(3.0 * t), velocity=tremble)), 0)
    assert (fit.scale, fit.delay, fit.residual, fit.plain) == (0.0, 0.0, 1.0, 1.0)
    k = np.arange(41.0)
    fit = velocity_fit(
        Exam(log_of(41, 1.0, position=(k - 20.0) ** 2, velocity=1.0 + (k == 20.0))), 0
    )  # back as forth
    assert (fit.scale, fit.delay) == (0.0, 0.0)


# --------------------------------------------------------------------------- what is said of scale and delay


def said_of(check, period=1e-3, unit="rad", **fit):
    """Return what a check says of a joint whose velocity and position relate in a given way."""
    t = period * np.arange(500)
    exam = Exam(log_of(500, period, unit=unit, position=np.sin(t), velocity=np.cos(t)))
    exam.shared[velocity_fit, 0] = VelocityFit(
        **({"scale": 1.0, "delay": 0.0, "residual": 0.01, "plain": 0.5, "window": 0.1} | fit)
    )
    return check.find(exam)


@pytest.mark.parametrize(
    ("fit", "severity", "value"),
    [
        ({"residual": 0.41}, "spoils", 0.41),
        ({"residual": 0.39}, None, None),
        ({"residual": 0.41, "scale": -1.0}, "spoils", 0.41),
        ({"scale": -1.0}, "spoils", -1.0),
        ({"scale": -0.02}, "spoils", -0.02),
        ({"scale": 1.16, "delay": 1.0}, "spoils", 1.16),
        ({"scale": 1.14}, None, None),
        ({"scale": 0.84}, "spoils", 0.84),
        ({"scale": 0.86}, None, None),
        ({"delay": 0.026}, "warn", 0.026),
        ({"delay": -0.026}, "warn", -0.026),
        ({"delay": 0.024}, "note", 0.024),
        ({"delay": 0.026, "residual": 0.3, "plain": 0.46}, "warn", 0.026),
        ({"delay": 0.026, "residual": 0.3, "plain": 0.44}, "note", 0.026),
        ({"delay": 0.059, "period": 0.01}, "note", 0.059),
        ({"delay": 0.061, "period": 0.01}, "warn", 0.061),
        ({"delay": 0.0031}, "note", 0.0031),
        ({"delay": 0.0029}, None, None),
        ({"delay": -0.0145, "period": 0.01}, None, None),
        ({"delay": -0.0155, "period": 0.01}, "note", -0.0155),
    ],
)
def test_what_is_said_of_a_velocity(fit, severity, value):
    found = said_of(velocity_mismatch, **fit)
    assert [f.severity for f in found] == ([] if severity is None else [severity])
    if found:
        assert about(found[0]) == ("j0", "velocity", severity, value, None, severity != "note")
        assert ("No action is needed" in found[0].remedy) is (severity == "note")


@pytest.mark.parametrize(
    ("fit", "sentence"),
    [
        ({"residual": 0.437}, "is not the derivative of its position: 44 % of the motion is unexplained."),
        ({"scale": -0.75}, "has the opposite sign of its position's change (ratio -0.75)."),
        ({"scale": 2.345}, "is off by a factor: its position changes 2.35 times as fast."),
        ({"delay": 0.0304, "period": 2e-3}, "lags its position by 30.4 ms (15.2 samples)."),
        ({"delay": -0.0304, "period": 2e-3}, "leads its position by 30.4 ms (15.2 samples)."),
        ({"delay": 0.0124, "period": 2e-3}, "lags its position by 12.4 ms (6.2 samples), as a filter does."),
    ],
)
def test_a_velocity_is_described_by_its_numbers(fit, sentence):
    (found,) = said_of(velocity_mismatch, **fit)
    assert found.sentence == f"velocity of j0 {sentence}".replace("2.35", f"{2.345:.3g}")


@pytest.mark.parametrize(("ratio", "unit"), [(180.0 / np.pi, "rad"), (1000.0, "m")])
def test_units_are_told_by_their_ratio_whatever_the_sign(ratio, unit):
    small, large = ("rad", "degrees") if unit == "rad" else ("m", "millimetres")
    for channel, factor, value in (("position", ratio, ratio), ("velocity", 1.0 / ratio, ratio)):
        for off, said in ((0.879, False), (0.881, True), (1.119, True), (1.121, False), (-1.0, True)):
            found = said_of(degrees, unit=unit, scale=off * factor)
            assert bool(found) is said
            assert bool(said_of(velocity_mismatch, unit=unit, scale=off * factor)) is not said
            if said:
                assert about(found[0]) == ("j0", channel, "spoils", value, None, True)
                assert found[0].sentence == (
                    f"{channel} of j0 is in {large}: position changes {off * factor:.4g} times as fast as its velocity channel, "
                    f"and {large} over {small} are {factor:.4g}."
                )
                assert f"it turns {channel} into {small}" in found[0].remedy
        assert said_of(degrees, unit=unit, scale=factor, residual=0.39)
        assert not said_of(degrees, unit=unit, scale=factor, residual=0.41)


@pytest.mark.parametrize(("back", "said"), [(0.19, False), (0.21, True)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_spindle_that_turns_on_and_on_may_turn_as_far_as_it_likes(back, said, sign):
    """Forth, and back by so much of that."""
    forth = np.linspace(0.0, 40.0, 1500)
    x = sign * np.concatenate([forth, 40.0 - np.linspace(0.0, 40.0 * back, 500)])
    found = degrees.find(Exam(log_of(position=x)))
    assert bool(found) is said
    if said:
        assert about(found[0]) == ("j0", "position", "warn", 40.0, None, False)
        assert found[0].sentence == "j0 goes to and fro over 40 rad: that looks like degrees."


def test_nothing_is_said_of_the_stroke_without_a_position_and_each_joint_is_looked_at():
    t = 1e-3 * np.arange(4000)
    wide = 20.0 * np.sin(6.0 * t)
    assert not degrees.find(Exam(log_of(4000, velocity=wide)))
    three = np.column_stack([0.1 * wide, wide, wide])
    assert [f.joint for f in degrees.find(Exam(log_of(4000, position=three)))] == ["j1", "j2"]
    found = degrees.find(Exam(log_of(4000, unit="m", position=wide)))
    assert "over 40 m: that looks like millimetres" in found[0].sentence
    both = log_of(
        4000,
        position=np.column_stack([np.rad2deg(np.sin(3 * t)), wide]),
        velocity=np.column_stack([3 * np.cos(3 * t), 120.0 * np.cos(6.0 * t)]),
    )
    assert [(f.joint, f.severity) for f in degrees.find(Exam(both))] == [("j0", "spoils"), ("j1", "warn")]


def test_a_position_in_degrees_takes_its_reference_and_second_encoder_with_it():
    """Unless their stroke shows that they were converted: below a fifth of it, or five times as long."""
    t = 1e-3 * np.arange(4000)
    q, v = np.rad2deg(np.sin(3.0 * t)), 3.0 * np.cos(3.0 * t)
    for share, with_it in ((0.19, False), (0.21, True), (4.9, True), (5.1, False)):
        mended = gate(
            log_of(4000, position=q, velocity=v, reference=share * q, second_encoder=q), repair=True
        )
        factor = 180.0 / np.pi if with_it else 1.0
        assert mended.reference[:, 0] == pytest.approx(share * q / factor)
        assert mended.second_encoder[:, 0] == pytest.approx(np.sin(3.0 * t))
        assert mended.position[:, 0] == pytest.approx(np.sin(3.0 * t)) and np.array_equal(
            mended.velocity[:, 0], v
        )
        said = ["position", "reference", "second_encoder"] if with_it else ["position", "second_encoder"]
        assert mended.notes == tuple(f"{channel} of j0 was divided by 57.2958." for channel in said)
    back = gate(
        log_of(4000, position=np.sin(3 * t), velocity=np.rad2deg(v), reference=np.sin(3 * t)), repair=True
    )
    assert back.velocity[:, 0] == pytest.approx(v) and np.array_equal(back.reference[:, 0], np.sin(3 * t))


def test_a_velocity_that_contradicts_is_left_out_and_the_joints_are_named():
    t = 1e-3 * np.arange(4000)
    q = np.column_stack([np.sin(3.0 * t), np.sin(2.0 * t), np.sin(4.0 * t)])
    v = np.column_stack([-3.0 * np.cos(3.0 * t), 2.0 * np.cos(2.0 * t), 8.0 * np.cos(4.0 * t)])
    log = log_of(4000, position=q, velocity=v)
    assert [f.joint for f in named(log, "velocity-mismatch")] == ["j0", "j2"]
    mended = gate(log, repair=True)
    assert mended.velocity is None
    assert mended.notes == ("velocity was left out: it contradicts the position of j0, j2.",)
