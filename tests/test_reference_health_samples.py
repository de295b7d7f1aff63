"""Single samples far from their neighbours and integers of a wrong type: by loops, by hand, and from both sides."""

import numpy as np
import pytest

from _health import about, log_of, smooth
from backdrive.logs.health import gate, integer_wrap, outlier
from backdrive.logs.health._exam import Exam

# ------------------------------------------------------------------------------------ single samples


def spiked(base, at, size):
    x = base.copy()
    x[at] += size
    return x


def outliers(x, channel="torque", **more):
    log = log_of(n=x.size, **{channel: x}, **more)
    return [f.where.tolist() for f in outlier.find(Exam(log)) if f.channel == channel]


def flat_and_rough(n=2000, rough=0.2):
    """A slow ramp with a tremor of one size in its first half: excess `rough` there, none in the second; no resolution."""
    x = 0.5 * np.linspace(0.0, 1.0, n) ** 1.5
    k = np.arange(n // 2)
    x[: n // 2] += 0.5 * rough * (-1.0) ** k
    return x


@pytest.mark.parametrize(("factor", "found"), [(2.45, []), (2.55, [[1500]])])
def test_an_outlier_is_two_and_a_half_times_the_usual_excess(factor, found):
    assert outliers(spiked(flat_and_rough(), 1500, factor * 0.2)) == found
    assert outliers(spiked(flat_and_rough(), 1500, -factor * 0.2)) == found


@pytest.mark.parametrize(("factor", "found"), [(2.9, []), (3.1, [[700]])])
def test_and_three_times_the_steps_around_it(factor, found):
    """Within the tremor of 0.2: both steps of the spike are so many times as long as those around."""
    x = flat_and_rough()
    up = 0.1 if 700 % 2 else -0.1  # half a tremor below: the spike goes the way the sample went
    way = -np.sign(up)
    assert outliers(spiked(x, 700, way * (factor - 1.0) * 0.2)) == found


@pytest.mark.parametrize(("steps", "found"), [(4, []), (5, [[1200]])])
def test_and_more_than_four_steps_of_the_channel(steps, found):
    x = np.round(np.linspace(0.0, 40.0, 2000))
    assert outliers(0.25 * spiked(x, 1200, steps)) == found


@pytest.mark.parametrize(("share", "found"), [(0.0095, []), (0.0105, [[1200]])])
def test_and_a_hundredth_of_the_range(share, found):
    x = 10.0 * np.linspace(0.0, 1.0, 20000) ** 1.5
    assert outliers(spiked(x, 1200, 10.0 * share)) == found


@pytest.mark.parametrize(("size", "severity"), [(1.9, "warn"), (2.1, "spoils")])
def test_an_outlier_of_twice_the_range_of_all_others_spoils(size, severity):
    x = np.linspace(0.0, 1.0, 2000) ** 1.5
    (found,) = outlier.find(Exam(log_of(torque=spiked(x, 1200, size))))
    assert found.severity == severity
    assert found.value == pytest.approx(size, rel=1e-3)


@pytest.mark.parametrize(("factor", "found"), [(7.5, []), (8.6, [[1000]])])
def test_in_fast_motion_what_a_cubic_leaves_counts_for_a_position(factor, found):
    """Steps of 0.5 hide nothing: here is 8 times what the fourth difference is around, a step beside leaves two thirds."""
    k = np.arange(2000)
    x = 40.0 * np.sin(k / 80.0) + 0.1 * (-1.0) ** k
    around = 16 * 0.1 / 6  # of the tremor in |fourth difference| / 6
    here = factor * around - around
    assert outliers(spiked(x, 1000, here), "position") == found


def test_too_many_outliers_are_how_the_channel_is():
    """Of 2000 samples 12 may be unusual, and as many again may be outliers."""
    base = np.linspace(0.0, 1.0, 2000) ** 1.5
    rows = np.arange(100, 100 + 40 * 30, 40)
    for count, said in ((11, True), (26, False)):
        x = base.copy()
        x[rows[:count]] += 5.0
        assert bool(outliers(x)) is said


def test_the_first_and_the_last_sample_have_one_neighbour():
    """They are outliers beyond the range of all others by more than that range."""
    base = np.linspace(0.0, 1.0, 2000) ** 1.5
    for row, beyond in ((0, -1.0), (1999, 1.0)):
        for size, found in ((0.98, []), (1.02, [[row]])):
            x = base.copy()
            x[row] += beyond * size
            assert outliers(x) == found
    mended = outlier.repair(Exam(log_of(torque=x)), outlier.find(Exam(log_of(torque=x))))
    assert len(mended.log) == 1999


def test_outliers_are_replaced_by_the_mean_of_their_neighbours():
    base = np.linspace(0.0, 1.0, 2000) ** 1.5
    x = spiked(spiked(base, 300, 4.0), 900, -3.0)
    mended = gate(log_of(torque=x, position=smooth()), repair=True)
    wanted = base.copy()
    for row in (300, 900):
        wanted[row] = 0.5 * (base[row - 1] + base[row + 1])
    assert mended.torque[:, 0] == pytest.approx(wanted, abs=1e-12)


def test_a_velocity_by_whole_counts_of_the_encoder_has_no_outliers():
    count, dt = 1e-3, 1e-3
    q = count * np.cumsum(np.isin(np.arange(2000), [400, 900, 1500]))
    v = np.gradient(q, dt)
    v[400] += 0.2 * count / dt
    q_far = q.copy()
    q_far[900:] += 5 * count  # six counts: that is no single one
    assert outliers(v, "velocity", position=q) == []
    assert outliers(np.diff(q_far, prepend=0.0) / dt, "velocity", position=q_far) == [[900]]


def outliers_by_loops(x, position):
    """The definition sample by sample: beyond the usual excess, and beyond what the surroundings do."""
    n = len(x)
    change, bend = np.diff(x), np.abs(np.diff(x, 4)) / 6.0
    excess = [min(abs(a), abs(b)) if a * b < 0 else 0.0 for a, b in zip(change, change[1:], strict=False)]
    count = int(10 + 0.001 * len(excess))
    usual = sorted(excess)[len(excess) - 1 - count]
    get = lambda y, i: abs(y[i]) if 0 <= i < len(y) else 0.0  # noqa: E731
    rows = [i + 1 for i, e in enumerate(excess) if e > 2.5 * usual]
    if len(rows) > 2 * count:
        return []
    rest = np.ptp(np.delete(x, rows)) if rows else 0.0
    found = []
    for r in rows:
        size = min(get(change, r - 1), get(change, r))
        around = sorted(get(change, r - 1 + k) for k in (-3, -2, -1, 2, 3, 4))[-2]
        far = size > 3.0 * max(abs(x[r + 1] - x[r - 1]), around)
        if position:
            smooth_ = sorted(get(bend, r - 2 + k) for k in (-7, -6, -5, -4, -3, 3, 4, 5, 6, 7))[-2]
            here, beside = get(bend, r - 2), max(get(bend, r - 3), get(bend, r - 1))
            far = far or (here > 8.0 * smooth_ and here > 1.3 * beside)
        if far and size > 0.01 * rest and 0 < r < n - 1:
            found.append(r)
    return found


@pytest.mark.parametrize("channel", ["torque", "position"])
def test_outliers_are_those_of_the_definition(channel):
    seen = 0
    for seed in range(60):
        generator = np.random.default_rng(seed)
        k = np.arange(500)
        x = 20.0 * np.sin(k / generator.uniform(8.0, 60.0)) + 10.0 ** generator.uniform(
            -2, 0
        ) * generator.standard_normal(500)
        rows = generator.choice(np.arange(2, 498), 8, replace=False)
        x[rows] += 10.0 ** generator.uniform(-0.5, 1.3, 8) * generator.choice([-1.0, 1.0], 8)
        x[rows[0] + 1 if rows[0] < 490 else rows[0] - 1] += generator.normal(0.0, 3.0)  # another one nearby
        wanted = outliers_by_loops(x, channel == "position")
        assert outliers(x, channel) == ([wanted] if wanted else []), seed
        seen += len(wanted)
    assert seen > 100


def test_outliers_beside_a_gap_are_none():
    x = np.linspace(0.0, 1.0, 2000) ** 1.5
    time = 1e-3 * np.arange(2000)
    time[1200:] += 0.5
    for row, said in ((1199, False), (1200, False), (1198, True), (1201, True)):
        log = log_of(2000, torque=spiked(x, row, 5.0)).replace(time=time)
        assert bool(outlier.find(Exam(log))) is said


def test_outliers_are_told_with_the_largest_and_how_far_it_is_off():
    base = np.linspace(0.0, 1.0, 2000) ** 1.5
    x = spiked(spiked(spiked(base, 300, 0.4), 900, -0.7), 1500, 0.5)
    load = np.column_stack([base, x, base])
    log = log_of(position=np.column_stack([smooth()] * 3), load=load, model_torque=load)
    (found,) = outlier.find(Exam(log))
    away = 0.7 + 0.5 * (base[899] + base[901]) - base[900]
    assert about(found) == ("j1", "load", "warn", pytest.approx(away, rel=1e-12), [300, 900, 1500], True)
    assert found.sentence == (
        f"load of j1 has 3 single-sample outliers; the largest is {x[900]:.5g} at sample 900, {away:.3g} off its neighbours."
    )


@pytest.mark.parametrize("n", [9, 10, 11, 2000])
@pytest.mark.parametrize("up", [1.0, -1.0])
def test_an_end_is_an_outlier_beyond_all_others_by_more_than_their_range(n, up):
    """All others: the second sample and the last but one as well."""
    k = np.arange(n)
    x = np.sin(2.0 * np.pi * k / (n - 1.0))
    x = x / np.ptp(x[1:-1])
    high, low = x[1:-1].max(), x[1:-1].min()
    for row, beside in ((0, 1), (n - 1, n - 2)):
        for size, said in ((0.95, False), (1.05, True)):
            y = up * x
            y[row] = up * high + up * size if up > 0 else up * high - size
            found = outlier.find(Exam(log_of(n, torque=y)))
            assert [f.where.tolist() for f in found] == [[row]] * (said and n >= 10)
            if found:
                assert found[0].value == pytest.approx(abs(y[row] - y[beside]))
                mended = outlier.repair(Exam(log_of(n, torque=y)), found)
                assert mended.rows.tolist() == np.delete(k, row).tolist()
                assert mended.log.notes == ("1 outlier at the end of the log dropped.",)
            y[beside] = y[row] - 0.01 * up  # it is not alone
            assert outlier.find(Exam(log_of(n, torque=y))) == []
    assert high > low


@pytest.mark.parametrize(
    ("first", "starting", "said"), [(0.3, True, False), (0.3, False, True), (5.0, True, True)]
)
@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize("back", [False, True])
def test_a_start_from_rest_and_a_stop_are_no_outliers(first, starting, said, way, back):
    rate, n = 50.0, 150
    t = np.arange(n) / rate
    q = way * np.where(t < 0.3, t * t / 0.6, t - 0.15) if starting else way * t
    tau = way * (1.6 + 0.05 * np.sin(3.0 * t))
    tau[0] = way * first
    if back:
        q, tau = -q[::-1], tau[::-1]
    log = log_of(n, 1.0 / rate, position=q, torque=tau)
    found = [f.where.tolist() for f in outlier.find(Exam(log)) if f.channel == "torque"]
    assert found == ([[n - 1 if back else 0]] if said else [])


@pytest.mark.parametrize(("steps", "said"), [(4, False), (5, True)])
def test_and_by_more_than_four_steps_of_the_channel(steps, said):
    x = 0.5 * (np.arange(500) // 100 % 2)
    for row in (0, 499):
        for way in (1, -1):
            y = x.copy()
            y[row] = 0.5 + 0.5 * steps if way > 0 else -0.5 * steps
            assert bool(outlier.find(Exam(log_of(500, torque=y)))) is said


@pytest.mark.parametrize("row", [0, 1999])
def test_a_position_that_jumps_at_an_end_is_one_outlier(row):
    """A stale first sample lies within the travel, and made a speed of 100 rad/s of one sample."""
    x = np.sin(np.arange(2000) / 150.0)
    (found,) = outlier.find(Exam(log_of(position=spiked(x, row, -0.3 if x[row] > 0.0 else 0.3))))
    assert found.where.tolist() == [row] and found.repairable
    assert outlier.find(Exam(log_of(position=x))) == []


def test_an_outlier_inside_and_one_at_an_end_are_mended_together():
    base = np.linspace(0.0, 1.0, 2000) ** 1.5
    log = log_of(torque=spiked(spiked(spiked(base, 0, -8.0), 700, 5.0), 900, 6.0))
    mended = outlier.repair(Exam(log), outlier.find(Exam(log)))
    wanted = base.copy()
    wanted[[700, 900]] = 0.5 * (base[[699, 899]] + base[[701, 901]])
    assert mended.log.torque[:, 0] == pytest.approx(wanted[1:])
    assert mended.log.notes == (
        "torque of j0: 2 outliers replaced by the mean of the neighbours.", "1 outlier at the end of the log dropped.",
    )  # fmt: skip


@pytest.mark.parametrize(("count", "said"), [(150, True), (151, False)])
def test_of_a_long_log_twice_as_many_as_may_be_unusual_may_be_outliers(count, said):
    """Of 65 536 samples looked at 75 may be unusual, and 150 of all; here between the pieces looked at."""
    n = 200_000
    x = np.linspace(0.0, 1.0, n) ** 1.5 + 1e-3 * (-1.0) ** np.arange(n)
    starts = np.linspace(0, n - 2048, 32).astype(int)
    rows = (starts[:-1, None] + np.arange(2200, 4000, 300)).ravel()[:count]
    x[rows] += 5.0
    assert outliers(x) == ([rows.tolist()] if said else [])


@pytest.mark.parametrize(("n", "usual"), [(13, 11), (14, 11), (500, 11), (1003, 12)])
def test_ten_samples_and_one_in_a_thousand_may_be_unusual(n, usual):
    """The largest excess but so many is what is usual; with one spike fewer than that, spikes are outliers."""
    for spikes, said in ((usual - 1, True), (usual, False)):
        if 2 * spikes + 2 > n:
            continue
        x = np.linspace(0.0, 1.0, n) ** 1.5
        rows = np.linspace(4, n - 5, spikes).astype(int)
        if np.diff(rows).min() < 8:
            continue
        x[rows] += 5.0
        assert bool(outliers(x)) is said


def ticking(excess, counts, at=400, period=1e-3, channel="velocity"):
    """A position that moves by so many counts at a sample, and a velocity with such a peak there, in counts per period."""
    count, n = 2.0**-10, 2000
    q = count * np.cumsum(np.isin(np.arange(n), [900, 1200, 1500]).astype(float))
    q[max(at, 1) :] += count * counts
    v = 1e-6 * np.sin(np.arange(n) ** 2)  # no step of its own
    v[at] += excess * count / min(period, 1e-3)
    log = log_of(n, period, position=q, velocity=v)
    return [f for f in outlier.find(Exam(log)) if f.channel == channel]


@pytest.mark.parametrize("period", [1e-3, 5e-4, 4e-3])
@pytest.mark.parametrize("at", [1, 2, 400])
@pytest.mark.parametrize(
    ("excess", "counts", "said"),
    [
        (1.9, 1, False),
        (2.1, 1, True),
        (-1.9, -1, False),
        (-2.1, -1, True),
        (1.9, 0, True),
        (1.9, 2, True),
        (1.0, 1, False),
    ],
)
def test_a_peak_of_a_velocity_is_a_tick_of_one_count_if_it_is_below_two_counts_a_period(
    period, at, excess, counts, said
):
    assert bool(ticking(excess, counts, at, period)) is said


@pytest.mark.parametrize(("away", "said"), [(-2, True), (-1, False), (0, False), (1, False), (2, True)])
def test_the_count_is_to_be_seen_from_two_samples_before_to_one_after(away, said):
    """It moved between the sample `away` after the peak and the one before that."""
    count, n = 2.0**-10, 2000
    q = count * np.isin(np.arange(n), range(400 + away, n)) + count * (np.arange(n) > 1500)
    v = 1e3 * count * (np.arange(n) == 400) + 1e-6 * np.sin(np.arange(n) ** 2)
    assert (
        bool([f for f in outlier.find(Exam(log_of(n, position=q, velocity=v))) if f.channel == "velocity"])
        is said
    )


@pytest.mark.parametrize("channel", ["torque", "position", "second_encoder"])
def test_outliers_near_one_another_and_near_steps_are_those_of_the_definition(channel):
    """Every offset at which something else is near: each counts up to four steps, or seven bends, away."""
    for seed in range(150):
        generator = np.random.default_rng(1000 + seed)
        k = np.arange(120)
        x = generator.choice([0.0, 40.0]) * np.sin(
            k / generator.uniform(6.0, 30.0)
        ) + 0.05 * generator.standard_normal(120)
        rows = (30, 60, 90)
        for row in rows:
            size = 4.0 * 2.0 ** generator.uniform(-1.5, 1.5)
            x[row] += size
            for _ in range(3):
                x[row + generator.integers(-9, 10)] += size / 3.0 * generator.uniform(-1.0, 1.0)
            if generator.random() < 0.4:
                x[row + generator.integers(-5, 5) :] += size / 3.0 * generator.uniform(-1.5, 1.5)
        wanted = outliers_by_loops(x, channel != "torque")
        assert outliers(x, channel, **({"position": smooth(120)} if channel == "second_encoder" else {})) == (
            [wanted] if wanted else []
        ), seed


# --------------------------------------------------------------------------------- integers of a wrong type


def wrapped(x, count=1.0, channel="torque"):
    """Return what is found of values given in counts."""
    return integer_wrap.find(
        Exam(log_of(len(x), position=smooth(len(x)), **{channel: count * np.asarray(x, dtype=float)}))
    )


def swing(high, low=None, n=1000):
    """Whole numbers that swing between two values by leaps, and are never the same for long."""
    low = -high if low is None else low
    k = np.arange(n)
    return np.where(k // 50 % 2, high - (7 * k) % 11, low + (7 * k) % 11)


@pytest.mark.parametrize("bits", [16, 32])
@pytest.mark.parametrize("count", [1.0, 0.01, 3.0])
def test_a_wrong_type_is_told_with_its_period_and_its_rows_and_taken_off(bits, count):
    truth = swing(200)
    for shift in (0, 50):  # it begins above zero, or below
        x = np.roll(truth, shift)
        (found,) = wrapped(x % 2**bits, count)
        rows = np.flatnonzero(x < 0).tolist()
        assert about(found) == (
            "j0",
            "torque",
            "spoils",
            pytest.approx(count * 2.0**bits, rel=1e-12),
            rows,
            True,
        )
        assert found.sentence == (
            f"torque of j0 was read with the wrong integer type: {len(rows)} samples off by {count * 2.0**bits:.6g} "
            f"(2^{bits} steps), first at sample {rows[0]}."
        )
        assert f"signed {bits}-bit numbers" in found.remedy
        log = log_of(1000, position=smooth(1000), torque=count * (x % 2**bits))
        mended = gate(log, repair=True)
        assert mended.torque[:, 0] == pytest.approx(count * x, abs=count * 1e-6 * 2.0 ** (bits - 16))
        assert mended.notes == (
            f"torque of j0: {count * 2.0**bits:.6g} was taken off again at {len(rows)} wrapped samples.",
        )


@pytest.mark.parametrize(("high", "said"), [(12000, True), (13500, False)])
def test_a_leap_between_two_signs_may_be_two_fifths_of_the_period(high, said):
    """All values near zero or near the period: leaps of 24 000 or 27 000 of 65 536, where 26 214 may be left."""
    assert bool(wrapped(swing(high) % 65536)) is said


@pytest.mark.parametrize(
    ("value", "said"),
    [(16000, True), (16800, False), (48800, False), (49500, True), (-16000, True), (-16800, False)],
)
def test_near_zero_and_near_the_period_is_within_a_quarter(value, said):
    x = swing(6000) % 65536
    at = 470 if 0 < value < 32768 else 520  # where it is above zero, or below
    x[at : at + 10] = value + np.arange(10)
    assert bool(wrapped(x, 0.01)) is said


@pytest.mark.parametrize(("leap", "said"), [(3200, True), (3350, False)])
def test_a_sum_that_ran_over_may_leap_by_a_twentieth_of_the_period(leap, said):
    """Signed numbers that run through their whole range: what is left of a leap beyond the wrap is 3277 at most."""
    k = np.arange(400)
    x = 290 * k - 40000 + (k * k) % 7
    at = int(np.flatnonzero(x > 32767)[0])
    x[at:] += leap - (x[at] - x[at - 1])
    (*found,) = wrapped((x + 32768) % 65536 - 32768)
    assert bool(found) is said
    if said:
        assert found[0].where.tolist() == [k for k in range(400) if not -32768 <= x[k] < 32768]


@pytest.mark.parametrize(("top", "said"), [(1.28, True), (1.32, False)])
def test_all_values_stay_within_one_and_a_third_of_a_period(top, said):
    x = np.concatenate([swing(200) % 65536, np.linspace(200, -2000, 50).round() % 65536, np.full(5, 63000)])
    rise = np.linspace(63000, top * 65536, 200).round() + np.arange(200) % 3
    assert bool(wrapped(np.concatenate([x, rise, rise[::-1]]))) is said


@pytest.mark.parametrize(("levels", "said"), [(4, False), (5, True)])
def test_a_signal_of_four_values_switches_and_is_no_wrong_type(levels, said):
    x = (np.arange(600) * 7) % levels - 2
    assert bool(wrapped(x % 65536, 0.01)) is said


def test_the_step_is_that_of_the_small_values():
    """Of the large ones it is rounded: 0.01 in 42 949 672; here two small values are all there are."""
    truth = np.tile([0, 1, -1, -3, -6, -10, 0], 100)
    (found,) = wrapped(truth % 2**32, 0.01)
    assert found.value == pytest.approx(0.01 * 2.0**32, rel=1e-13)
    odd = np.where(truth == 1, 1.015, truth % 65536)  # unless they say something else
    (found,) = wrapped(odd)
    assert found.value == pytest.approx(65536.0, rel=1e-6)
    negative = np.tile([0, -1, -3, -6, -10, 20], 100)
    high = np.where(negative > 0, negative - 65536, negative)  # a period too low
    assert wrapped(high, 0.01)[0].value == pytest.approx(655.36, rel=1e-9)


def test_what_moves_by_small_steps_or_stands_is_no_wrong_type():
    assert wrapped(np.full(500, 65000)) == []
    assert wrapped(np.arange(500)) == []
    assert wrapped(np.arange(500) % 50 * 1.0) == []
    assert wrapped(np.where(np.arange(500) == 9, np.nan, swing(200, n=500) % 65536)) == []
    two = log_of(
        1000,
        position=np.column_stack([smooth(1000)] * 2),
        velocity=np.column_stack([smooth(1000), swing(99) % 65536]),
    )
    assert [(f.joint, f.channel) for f in integer_wrap.find(Exam(two))] == [("j1", "velocity")]
    for channel in ("drive_input", "external_torque", "load", "model_torque"):
        assert len(wrapped(swing(200) % 65536, 1.0, channel)) == 1
    assert wrapped(swing(200) % 65536, 1.0, "reference") == []


def between(period=65536.0, ramp=0, n=1000, low=-200.3, high=180.7):
    """Raw unsigned numbers that were resampled: no resolution, and `ramp` values between the levels at each crossing."""
    k = np.arange(n)
    truth = np.where(k // 100 % 2, low, high) + 30.0 * np.sin(0.1 * k**1.1)
    x = np.where(truth < 0, truth + period, truth)
    for turn in np.flatnonzero(np.diff(truth < 0)):
        if ramp:
            x[turn + 1 : turn + 1 + ramp] = np.linspace(x[turn], x[turn + 1 + ramp], ramp + 2)[1:-1]
    return truth, x


@pytest.mark.parametrize("ramp", [0, 1, 3])
@pytest.mark.parametrize("bits", [16, 32])
def test_numbers_resampled_after_the_fault_lose_what_lies_between_the_levels(ramp, bits):
    truth, x = between(2.0**bits, ramp)
    (found,) = wrapped(x)
    lost = set()
    side = [1 if v > 0.75 * 2.0**bits else -1 if v < 0.25 * 2.0**bits else 0 for v in x]
    for k in range(999):
        if side[k] != side[k + 1]:
            lost |= {k, k + 1}
    lost |= {k for k in range(1000) if side[k] == 0}
    rows = sorted(lost | {k for k in range(1000) if side[k] > 0})
    assert about(found) == ("j0", "torque", "spoils", 2.0**bits, rows, True)
    assert (
        f"{len(rows)} samples off by {2.0**bits:.6g} (2^{bits} steps), {len(lost)} of them between the levels and lost, first"
        in (found.sentence)
    )
    mended = integer_wrap.repair(Exam(log_of(1000, position=smooth(1000), torque=x)), [found])
    kept = [k for k in range(1000) if k not in lost]
    assert mended.rows.tolist() == kept and mended.log.torque[:, 0] == pytest.approx(truth[kept], abs=1e-5)
    assert mended.log.notes[-1] == f"{len(lost)} samples interpolated across a wrap were dropped."


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({}, True),
        ({"ramp": 3}, True),
        ({"ramp": 4}, False),  # no step is a fifth of the range
        ({"high": 200.0, "low": -6500.0}, True),
        ({"high": 200.0, "low": -6700.0}, False),  # the highest is below nine tenths
    ],
)
def test_which_resampled_numbers_are_taken_for_a_wrong_type(change, said):
    _, x = between(**change)
    if "low" in change:
        x = np.where(x > 30000, x.max() - (x - x[x > 30000].min()), x)
        x[x > 30000] += 65536.0 + change["low"] - x.max()
    assert bool(wrapped(x)) is said


@pytest.mark.parametrize(("value", "said"), [(-0.045, True), (-0.055, False), (1.0005, True), (1.002, False)])
def test_resampled_numbers_lie_between_zero_and_the_period_but_for_a_twentieth(value, said):
    _, x = between()
    x[150 if value > 0 else 50] = value * 65536.0
    assert bool(wrapped(x)) is said


@pytest.mark.parametrize(("share", "said"), [(0.049, True), (0.051, False)])
def test_a_twentieth_of_resampled_numbers_may_lie_between_the_levels(share, said):
    _, x = between()
    rows = np.linspace(1, 998, round(share * 1000)).astype(int)
    x[rows] = 65536.0 * np.linspace(0.26, 0.74, rows.size)
    assert bool(wrapped(x)) is said


def test_a_switch_between_zero_and_a_limit_is_no_number():
    truth, x = between()
    assert wrapped(np.where(truth < 0, x, 0.0)) == []
    assert wrapped(np.where(truth < 0, 65500.3, x)) == []
