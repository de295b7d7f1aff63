"""What health checks make of a clock, and what an examined log knows of itself: by hand, by brute force, from both sides."""

import numpy as np
import pytest

from _health import about, log_of, named, smooth
from backdrive.logs.health import gate, jitter, repeated_time, unsorted_time
from backdrive.logs.health._exam import Exam
from backdrive.logs.health._survey import survey
from backdrive.logs.resolution import resolution

N = 1000


def timed(time, **channels):
    time = np.asarray(time, dtype=float)
    channels = channels or {"position": smooth(time.size)}
    return log_of(time.size, time=time, **channels)


# ------------------------------------------------------------------------------------ stamps that repeat


def coarse(stamps_at, tick=5e-3, each=5, begin=50.0):
    """Stamps of a coarse clock, `each` samples on every stamp, at `begin` + `stamps_at` ticks."""
    return begin + np.repeat(tick * np.asarray(stamps_at, dtype=float), each)


def test_samples_sent_twice_are_counted_and_the_first_of_each_is_kept():
    time = 2.0 + 1e-3 * np.arange(N)
    time[[7, 8, 300]] = time[[6, 6, 299]]
    (found,) = named(timed(time), "repeated-time")
    assert about(found) == (None, None, "spoils", 3, [7, 8, 300], True)
    assert found.sentence == "3 samples repeat the stamp before, first at sample 7."
    assert "keeps the first of each" in found.remedy
    mended = gate(timed(time), repair=True)
    assert np.array_equal(mended.time, np.delete(time, [7, 8, 300]))
    assert np.array_equal(mended.position[:, 0], np.delete(smooth(N), [7, 8, 300]))
    assert mended.notes == ("3 samples that repeat a stamp were dropped.",)


@pytest.mark.parametrize(("twice", "words"), [(200, "first at sample 1"), (201, "201 of 1000 samples")])
def test_a_clock_is_coarse_where_more_than_a_fifth_of_its_stamps_repeat(twice, words):
    time = 1e-3 * np.arange(N)
    time[1 : 2 * twice : 2] = time[: 2 * twice : 2]
    (found,) = named(timed(time), "repeated-time")
    assert words in found.sentence and found.value == twice
    assert ("coarser than the sampling" in found.sentence) is (twice > 200)
    assert ("spreads" in found.remedy) is (twice > 200)


def test_a_log_of_one_stamp_cannot_be_mended():
    (found,) = named(timed(np.full(N, 3.0)), "repeated-time")
    assert about(found)[3:] == (N - 1, list(range(1, N)), False)


def test_no_stamp_repeats_on_a_good_clock():
    assert not named(timed(1e-3 * np.arange(N)), "repeated-time")


@pytest.mark.parametrize("jump_at", [20, 180])
@pytest.mark.parametrize(("ticks", "regular"), [(1.15, True), (1.25, False)])
def test_a_coarse_clock_is_regular_up_to_1_2_ticks_off_a_straight_line(jump_at, ticks, regular):
    """It loses time once, early or late, so that it is farthest off on either side of the line; the line by hand."""
    stamps, first = (
        np.arange(200.0),
        np.maximum(5.0 * np.arange(200) - 4.0, 0.0),
    )  # the first stamp comes once
    lost = (np.arange(200) >= jump_at).astype(float)
    fit = lambda y: np.polynomial.Polynomial.fit(first, y, 1).convert().coef  # noqa: E731
    off = lambda y: y - fit(y)[0] - fit(y)[1] * first  # noqa: E731
    plain, more = off(stamps), off(lost)
    stamps += lost * min(
        np.linspace(0.0, 6.0, 1201), key=lambda c: abs(np.abs(plain + c * more).max() - ticks)
    )
    assert np.abs(off(stamps)).max() == pytest.approx(ticks, abs=0.02)
    time, n = coarse(stamps)[4:], N - 4
    mended = repeated_time.repair(Exam(timed(time)), repeated_time.find(Exam(timed(time)))).log
    start, slope = fit(5e-3 * stamps)
    if regular:
        assert mended.time == pytest.approx(50.0 + start + slope * np.arange(n), abs=1e-9)
        assert mended.notes == (f"796 repeated stamps were replaced by a regular clock of {slope:.6g} s.",)
    else:
        assert mended.time[1::5] == pytest.approx(time[1::5], abs=1e-9) and mended.time[0] == time[0]
        inner = np.repeat(np.diff(time[1::5]) / 5.0, 5)
        assert np.diff(mended.time)[1:991] == pytest.approx(inner, abs=1e-9)
        assert np.diff(mended.time)[991:] == pytest.approx((time[-1] - time[0]) / 991, abs=1e-9)
        assert mended.notes == ("796 repeated stamps were spread evenly between their neighbours.",)


# ------------------------------------------------------------------------------------- gaps and jitter


def test_gaps_are_counted_with_the_samples_that_are_missing():
    steps = np.full(N - 1, 2e-3)
    steps[[99, 499, 799]] = 8e-3, 0.242, 6e-3  # 3, 120 and 2 samples are missing
    time = 7.0 + np.concatenate([[0.0], np.cumsum(steps)])
    (found,) = named(timed(time), "gaps")
    assert about(found) == (None, None, "warn", 125, [100, 500, 800], False)
    assert found.sentence == "3 gaps, 125 samples missing; the longest is 0.242 s before sample 500."
    assert not named(timed(2e-3 * np.arange(N)), "gaps")


@pytest.mark.parametrize(("long", "gap"), [(4.9e-3, False), (5.1e-3, True)])
def test_a_gap_is_measured_by_the_longer_of_the_usual_intervals(long, gap):
    """A fifth of all intervals is 2 ms, so the ninth of ten is, though the median is 1 ms."""
    steps = np.where(np.arange(N - 1) % 5 == 0, 2e-3, 1e-3)
    steps[502] = long
    exam = Exam(timed(np.concatenate([[0.0], np.cumsum(steps)])))
    assert exam.period == pytest.approx(1e-3)
    assert exam.gaps.tolist() == ([503] if gap else [])


def test_jitter_leaves_gaps_and_repetitions_aside():
    steps = 1e-3 * (1.0 + 0.2 * np.tile([1.0, -1.0, 0.0], 333))
    plain = np.array(steps)
    steps[[60, 400]] = 0.5, 0.03
    steps[[63, 403]] = 0.0
    rest = np.delete(plain, [60, 400, 63, 403])
    (found,) = jitter.find(Exam(timed(np.concatenate([[0.0], np.cumsum(steps)]))))
    share = rest.std() / rest.mean()
    assert about(found) == (None, None, "warn", pytest.approx(share, rel=1e-9), None, False)
    assert f"varies by {100 * share:.0f} %" in found.sentence
    assert "(standard deviation over mean, 0.8 to 1.2 ms)" in found.sentence


@pytest.mark.parametrize(("intervals", "said"), [(9, False), (10, True)])
def test_jitter_is_told_from_ten_intervals_on(intervals, said):
    steps = np.zeros(30)
    steps[:intervals] = np.where(np.arange(intervals) % 2, 1e-3, 2e-3)
    assert bool(jitter.find(Exam(timed(np.concatenate([[0.0], np.cumsum(steps)]))))) is said


# --------------------------------------------------------------------------------- a clock that goes back


def joined(*runs):
    return np.concatenate([np.asarray(run, dtype=float) for run in runs])


def late(time):
    exam = Exam(timed(time))
    (found,) = unsorted_time.find(exam)
    return found


@pytest.mark.parametrize(
    ("before", "after", "restarts"),
    [
        (np.arange(600), 597 + np.arange(600), True),  # 3 stamps of each on 3 periods: 6 > 1.5 * 3 + 1
        (np.arange(600), 598 + np.arange(600), False),  # 4 of them are no more than 4
        (np.arange(600), 596.5 + np.arange(600), False),  # 6 on 3.5 periods
        (np.arange(600), 595.5 + np.arange(600), True),  # 8 on 4.5 periods
        (np.arange(600), 300 + 1.5 * np.arange(300), True),  # 5 stamps where one clock has 3
        (np.arange(600), 300 + 2.5 * np.arange(300), False),  # 7 where one clock has 5
        (np.arange(600), np.arange(5), True),  # a run of five: 10 stamps on 5 periods
        (np.arange(3), np.arange(600), True),
        ([*range(398), 398.3, 399], [398.2, 398.9, *range(400, 600)], False),  # 4 on 1.8 periods
        ([*range(398), 398.3, 398.6, 399], [398.2, 398.9, *range(400, 600)], True),  # 5
        ([*range(300), 299.5], [100.0, 350.0, *range(351, 600)], False),
    ],
)
def test_a_run_begins_where_more_stamps_share_a_time_than_one_clock_gives(before, after, restarts):
    """More than four stamps of both, and more than one and a half times as many as one clock has there, plus one."""
    time = joined(before, after)
    found = late(time)
    if restarts:
        assert found.where.tolist() == [len(before)]
        assert "2 runs were joined" in found.sentence and "its own file" in found.remedy
    else:
        assert found.where.tolist() == [k for k in range(time.size) if time[k] < time[:k].max(initial=-1.0)]
        assert f"{found.where.size} sample" in found.sentence and "Sort by time" in found.remedy
    assert found.value == pytest.approx(-np.diff(time).min())


def test_the_first_five_restarts_are_named_and_all_runs_counted():
    found = late(np.tile(2.0 * np.arange(100), 8))
    assert about(found) == (None, None, "spoils", 198.0, list(range(100, 800, 100)), True)
    assert found.sentence == (
        "The clock jumps back by up to 198 s, at sample 100, 200, 300, 400, 500: 8 runs were joined, or the clock was set."
    )


@pytest.mark.parametrize(("runs", "restarts"), [(201, True), (202, False)])
def test_nobody_joins_more_than_201_runs(runs, restarts):
    found = late(np.tile(np.arange(10.0), runs))
    assert ("runs were joined" in found.sentence) is restarts
    assert found.where.size == (200 if restarts else 9 * 201)


def test_samples_out_of_order_are_named_and_sorted():
    time = 5.0 + 1e-3 * np.arange(N)
    order = np.arange(N)
    order[[300, 302]] = order[[302, 300]]
    log = timed(time).rows(order)
    (found,) = named(log, "unsorted-time")
    assert about(found) == (None, None, "spoils", pytest.approx(1e-3), [301, 302], True)
    assert found.sentence == "2 samples are out of order, by up to 0.001 s, first at sample 301."
    mended = gate(log, repair=True)
    assert np.array_equal(mended.time, time) and np.array_equal(mended.position[:, 0], smooth(N))
    assert mended.notes == ("2 samples out of order were sorted by time.",)


def test_a_clock_that_only_goes_back_has_no_period_and_cannot_be_mended():
    (found,) = named(timed(-1e-3 * np.arange(N)), "unsorted-time")
    assert about(found)[3:] == (pytest.approx(1e-3), list(range(1, N)), False)
    assert not unsorted_time.find(Exam(timed([1.0])))
    assert not unsorted_time.find(Exam(timed([0.0, 1.0, 1.0])))


def test_joined_runs_are_moved_one_behind_the_other_and_sorted_within():
    """Three runs; in the second two samples are swapped, in the third one comes late; the motion goes on at the first seam."""
    clock = 1e-3 * np.arange(400)
    swapped, behind = clock.copy(), clock.copy()
    swapped[[200, 201]] = swapped[[201, 200]]
    behind[100] = -1e-3
    q = smooth(1200)
    q[800:] += 1.0
    log = timed(joined(2.0 + clock, 2.0 + swapped, 2.0 + behind), position=q)
    found = unsorted_time.find(Exam(log))
    assert found[0].where.tolist() == [400, 800]
    mended = unsorted_time.repair(Exam(log), found)
    pause = 4 * 2.5e-3  # four gaps
    last = 2.799 + pause + 1e-3 + clock
    wanted = joined(2.0 + clock, 2.4 + clock, [2.799 + pause], np.delete(last, 100))
    assert mended.log.time == pytest.approx(wanted, abs=1e-9)
    order = np.arange(1200)
    order[[600, 601]] = 601, 600
    order[800:901] = [900, *range(800, 900)]
    assert mended.rows is not None and mended.rows.tolist() == order.tolist()
    assert np.array_equal(mended.log.position[:, 0], q[order])
    assert mended.log.notes == (
        "2 runs with a restarted clock were moved behind the run before. 103 samples out of order were sorted by time.",
    )


@pytest.mark.parametrize("channel", ["position", "velocity"])
@pytest.mark.parametrize("start", [3, 400])
@pytest.mark.parametrize(("times", "goes_on"), [(2.9, True), (3.1, False)])
def test_motion_goes_on_where_the_seam_is_up_to_three_times_the_steps_around(channel, start, times, goes_on):
    x = np.zeros((800, 2))
    x[:, 0] = 0.01 * np.arange(800)
    x[start:, 1] = 1.0
    x[:, 1] += 0.5 * np.arange(800)
    x[start:, 0] += 0.01 * (times - 1.0)
    log = timed(joined(np.arange(start), np.arange(800 - start)), **{channel: x})
    mended = unsorted_time.repair(Exam(log), unsorted_time.find(Exam(log))).log
    assert mended.time[start] - mended.time[start - 1] == pytest.approx(1.0 if goes_on else 10.0)


@pytest.mark.parametrize(("steps_off", "goes_on"), [(-5, True), (-6, False), (5, True), (6, False)])
def test_six_samples_on_either_side_of_a_seam_count(steps_off, goes_on):
    """A seam of five steps, and one step of two so many steps before or after it."""
    x = 0.01 * np.arange(800)
    x[400:] += 0.04
    x[400 + steps_off :] += 0.01
    log = timed(joined(np.arange(400), np.arange(400)), position=x)
    mended = unsorted_time.repair(Exam(log), unsorted_time.find(Exam(log))).log
    assert mended.time[400] - mended.time[399] == pytest.approx(1.0 if goes_on else 10.0)


# ---------------------------------------------------------------------------------- what an exam computes


def test_an_empty_log_has_no_period_no_gap_and_no_segment():
    exam = Exam(timed([], position=np.zeros(0)))
    assert np.isnan(exam.period) and exam.gaps.size == 0 and exam.segments == []
    one = Exam(timed([0.0], position=np.zeros(1)))
    assert np.isnan(one.period) and not one.usable("position", 0)
    two = Exam(timed([0.0, 0.5], position=np.zeros(2)))
    assert two.period == 0.5 and two.usable("position", 0)
    assert Exam(timed([0.0, 0.0, 0.5, 0.2], position=np.zeros(4))).period == 0.5  # of intervals above zero


def test_the_period_is_the_median_of_all_intervals_and_in_a_long_log_of_some():
    steps = np.where(np.arange(400) % 2, 3e-3, 1e-3)
    exam = Exam(timed(np.concatenate([[0.0], np.cumsum(steps)])))
    assert exam.period == pytest.approx(2e-3)
    many = np.where(np.arange(3 * 65536) % 3, 2e-3, 1e-3)  # of three intervals one is looked at
    assert Exam(timed(np.concatenate([[0.0], np.cumsum(many)]))).period == pytest.approx(1e-3)


def test_the_usual_interval_of_a_long_log_is_that_of_some():
    many = np.where(np.arange(3 * 65536) % 3, 1e-3, 3e-3)
    many[1000] = 2.6e-3
    assert Exam(timed(np.concatenate([[0.0], np.cumsum(many)]))).gaps.size == 0


@pytest.mark.parametrize(("n", "count"), [(65536, 1), (65537, 32), (200_000, 32)])
def test_blocks_are_32_pieces_of_2048_rows_spread_over_a_long_log_and_cut_at_gaps(n, count):
    starts = np.linspace(0, n - 2048, 32).astype(int) if count > 1 else np.array([0])
    length = 2048 if count > 1 else n
    assert Exam(timed(1.0 * np.arange(n))).blocks == [slice(int(s), int(s) + length) for s in starts]
    if n < 200_000:
        return
    time = 1.0 * np.arange(n)
    rows = [
        int(starts[3]),
        int(starts[5]) + 1,
        int(starts[5]) + 700,
        int(starts[7]) + 2047,
        int(starts[9]) + 2048,
    ]
    for row in rows:
        time[row:] += 100.0
    exam = Exam(timed(time))
    assert exam.gaps.tolist() == rows
    inside = np.zeros(n, bool)
    for s in starts:
        inside[s : s + length] = True
    got = np.zeros(n, int)
    for block in exam.blocks:
        got[block] += 1
        assert block.stop > block.start and not set(rows) & set(range(block.start + 1, block.stop))
    assert np.array_equal(got, inside.astype(int)) and len(exam.blocks) == 32 + 3
    edges = [0, *rows, n]
    assert exam.segments == [slice(a, b) for a, b in zip(edges, edges[1:], strict=False)]


def test_of_a_long_log_one_column_is_kept_at_a_time():
    for n, kept in ((65536, True), (65537, False)):
        exam = Exam(timed(1.0 * np.arange(n), position=np.zeros((n, 2)), torque=np.ones((n, 2))))
        first = exam.column("position", 0)
        assert np.shares_memory(first, exam.column("position", 0))
        assert exam.column("torque", 0)[5] == 1.0
        assert np.shares_memory(exam.column("position", 0), first) is kept


# ---------------------------------------------------------------------------------------- the resolution


@pytest.mark.parametrize(
    ("apart", "step"),
    [
        ([1.0] * 30 + [2.035], 1.0),  # a multiple may be off by 2 % of itself
        ([1.0] * 30 + [2.045], 0.0),
        ([1.0] * 30 + [3.055], 1.0),
        ([1.0] * 30 + [3.065], 0.0),
        ([1.0] * 30 + [5.095], 1.0),  # and a long one by a tenth of a step
        ([1.0] * 30 + [5.105], 0.0),
        ([1.0] * 30 + [9.095], 1.0),
        ([1.0] * 30 + [9.105], 0.0),
        ([1.0] * 60 + [7.25], 1.0),  # of sixty steps one may be anything
        ([1.0] * 40 + [7.25], 0.25),  # of forty it is taken seriously
        ([1.0, 1.0, 1.0, 0.9e5 + 0.5], 0.5),
        ([1.0, 1.0, 1.0, 1.1e5 + 0.5], 1.0),  # too long to tell
        ([1.0] * 5 + [1.0 + 1.0 / 32.0] * 5, 1.0 / 32.0),
        ([1.0, 1.1, 1.111], 0.0),  # 0.011 is less than a 64th of the smallest
        ([1.0, 1.0, 1.5], 0.5),
    ],
)
def test_a_resolution_divides_nearly_all_steps(apart, step):
    values = np.concatenate([[0.0], np.cumsum(apart)])
    assert resolution(values) == pytest.approx(step, abs=1e-9)
    assert resolution(-values) == pytest.approx(step, abs=1e-9)


@pytest.mark.parametrize(
    ("levels", "step"),
    [
        ([-1.5, -1.0 - 1e-11, -1.0], 0.5),
        ([0.0, 0.5, 1.0, 1.0 + 1e-11], 0.5),
        ([-1.0, -1e-11, 0.0], 1.0),
        ([0.0, 1e-11, 1.0], 1.0),
        ([1.0, 1.0 + 1e-11], 0.0),
        ([3e-11, 0.0, 6e-11], 3e-11),
        ([2e3, 2e3 + 1e-8, 2e3 + 4.0], 4.0),
        ([2.0], 0.0),
        ([], 0.0),
        ([np.nan, 1.0, np.inf, 1.25], 0.25),
    ],
)
def test_what_rounding_leaves_between_equal_values_is_no_step(levels, step):
    assert resolution(np.array(levels)) == pytest.approx(step, rel=1e-6)


def test_of_many_values_four_thousand_tell_the_resolution():
    values = 0.5 * (np.arange(8192) % 7)
    values[1::2] += 0.125
    assert resolution(values) == 0.5 and resolution(values[:8190]) == 0.125


# -------------------------------------------------------------------------------------------- the survey


def test_a_survey_sees_a_fault_wherever_its_pieces_end():
    """Features of one column each, at every row around the 8192nd and the last one."""
    n = 8192 + 55
    at = np.arange(8160, 8224)
    base = np.linspace(0.0, 1.0, n)[:, None] + np.zeros((1, at.size))
    k = np.arange(at.size)
    for length, long in ((19, False), (20, True)):
        x = base.copy()
        for j, row in enumerate(at):
            x[row : row + length, j] = x[row, j]
        s = survey(x)
        assert np.all(s.long_run == long)
        assert s.equal == pytest.approx((length - 1) / (n - 1))
    x = base.copy()
    x[at, k] = 5.0
    s = survey(x)
    assert np.all(s.high == 5.0) and s.spike == pytest.approx(5.0 - x[at + 1, k])
    assert s.step == pytest.approx(5.0 - x[at - 1, k])
    assert np.all(survey(-x).low == -5.0)
    x = base.copy()
    for j, row in enumerate(at):
        x[row:, j] += 3.0
    assert survey(x).step == pytest.approx(3.0 + 1.0 / (n - 1)) and np.all(survey(x).spike == 0.0)
    x = base.copy()
    x[at, k] = np.nan
    assert not survey(x).finite.any() and survey(base).finite.all()


@pytest.mark.parametrize("n", [1, 2, 3, 8193])
def test_a_survey_of_a_few_samples_and_of_one_beyond_a_piece(n):
    x = np.zeros((n, 1))
    x[-1] = 2.0
    s = survey(x)
    assert (s.low[0], s.high[0]) == (0.0 if n > 1 else 2.0, 2.0)
    assert s.step[0] == (2.0 if n > 1 else 0.0) and s.spike[0] == 0.0
    assert s.equal[0] == (n - 2) / (n - 1) if n > 1 else s.equal[0] == 0.0
    assert s.long_run[0] == (n > 20)
