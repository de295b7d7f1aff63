"""Sweeps from logs to friction: pairs and cycles by hand, the whole way by the sum of its parts, thresholds from both sides."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.identification import dynamics, sweep_delay
from backdrive.identification.function_a import correct_pairs, function_a, literal
from backdrive.identification.quality import assess
from backdrive.identification.signals import prepare
from backdrive.identification.sweep import find_windows, fit_sweeps, identify_sweep, sweep_knots
from backdrive.identification.sweep_fit import fit
from backdrive.identification.sweep_knots import SweepKnots, sort_knots
from backdrive.identification.sweep_verdict import error_of_curve, verdict
from backdrive.identification.sweep_windows import Windows, turning_points, windows
from backdrive.logs.log import Joint, Log
from backdrive.plans import InTurn, Sweep

A, V, RATE = np.deg2rad(20), 2.0, 250.0
PLAN = Sweep(A, V, 4)


def made(
    plan=PLAN,
    *,
    late=0.5 / RATE,
    gravity=(0.0, 0.0),
    noise=0.0,
    seed=0,
    rate=RATE,
    unit="rad",
    name="a",
    mu=0.0,
):
    """A log in closed form: friction 9 + 3 v and inertia 1.6, the torque that of an instant `late` after its sample."""
    t = np.arange(0.0, plan.start + plan.duration, 1.0 / rate)
    q, v, a = plan.position(t + late), plan.velocity(t + late), plan.acceleration(t + late)
    g = gravity[0] * np.sin(q) + gravity[1] * np.cos(q)
    torque = 1.6 * a + g + np.sign(v) * (9.0 + mu * np.abs(g + 1.6 * a)) + 3.0 * v
    torque += noise * np.random.default_rng(seed).standard_normal(t.size)
    return Log(
        time=t, joints=(Joint(name=name, unit=unit),), position=plan.position(t), torque=torque, plan=plan
    )


# ------------------------------------------------------------------------------------ pairs as printed

TIME = np.arange(10.0)
SPEED = np.array([0.0, 0.9, 1.0, -0.8, -1.0, 0.5, 1.7, 2.0, -1.6, -1.5])
TORQUE = np.array([9.0, 5.0, 7.0, -4.0, -6.0, 9.0, 8.0, 10.0, -7.0, 9.0])
CYCLES = np.array([[0.0, 5.0], [5.0, 10.0]])


def test_pairs_as_printed_on_a_handful_of_samples():
    """Peaks 1 and 2: fast enough are samples 1, 2 against 3, 4, and 6, 7 against 8."""
    V_n, F_n = function_a(TIME, SPEED, TORQUE, CYCLES, 2.0)
    assert V_n == pytest.approx([0.95, 1.85]) and F_n == pytest.approx([5.5, 8.0])
    V_n, F_n = function_a(TIME, SPEED, TORQUE, CYCLES, 2.0, c=0.9)  # 1, 2 against 4; 7 against none
    assert V_n == pytest.approx([0.95, 2.0]) and F_n[0] == pytest.approx(6.0) and np.isnan(F_n[1])
    V_n, _ = function_a(TIME, SPEED, TORQUE, CYCLES + [0.0, 1.0], 2.0)  # the end is not part of it
    assert V_n[0] == pytest.approx(0.95)
    assert function_a(TIME, SPEED, TORQUE, np.array([[1.0, 2.0]]), 0.9)[0].tolist() == [0.9]
    assert function_a(TIME, SPEED, TORQUE, CYCLES, 2.0, c=0.0)[0] == pytest.approx(
        [(0.0 + 0.9 + 1.0) / 3, (0.5 + 1.7 + 2.0) / 3]
    )
    for c in (-0.1, 1.0):
        with pytest.raises(InvalidInput, match="c = "):
            function_a(TIME, SPEED, TORQUE, CYCLES, 2.0, c=c)
    for wrong in (
        (TIME[:, None], SPEED[:, None], TORQUE[:, None]),
        (TIME, SPEED[:9], TORQUE),
        (TIME, SPEED, TORQUE[:9]),
    ):
        with pytest.raises(InvalidInput, match="Shapes"):
            function_a(*wrong, CYCLES, 2.0)


def test_pairs_of_a_log_as_printed_take_the_backward_difference():
    cycles = Windows(time=CYCLES, peak=np.array([1.0, 2.0]), from_plan=True)
    q = 3.0 + np.cumsum(np.r_[0.0, SPEED[1:]])
    by_position = Log(
        time=TIME, joints=(Joint(name="a"),), position=q, torque=TORQUE - 1.0, external_torque=np.ones(10)
    )
    by_velocity = by_position.replace(position=None, velocity=SPEED)
    for log in (by_position, by_velocity):
        got = literal(log, cycles)
        assert got.V_pos == pytest.approx([0.95, 1.85]) and got.V_neg == pytest.approx([0.95, 1.85])
        assert got.F_pos == pytest.approx([6.0, 9.0]) and got.F_neg == pytest.approx([5.0, 7.0])
        assert got.count_pos.tolist() == [2, 2] and got.count_neg.tolist() == [2, 1]
        assert np.isnan([*got.error_pos, *got.error_neg, got.center, *got.inertia, *got.slope]).all()
    assert literal(by_position, cycles, 0.9).count_neg.tolist() == [1, 0]
    # half the clock's rate, half the velocity
    slow = Log(time=2.0 * TIME, joints=(Joint(name="a"),), position=2.0 * q, torque=TORQUE)
    got = literal(slow, Windows(time=2.0 * CYCLES, peak=np.array([1.0, 2.0]), from_plan=True))
    assert got.V_pos == pytest.approx([0.95, 1.85])


# ------------------------------------------------------------------------------- pairs with corrections


def test_pairs_of_a_velocity_only_log_know_no_gravity():
    log = made()
    bare = log.replace(position=None, velocity=PLAN.velocity(log.time))
    got, whole = sweep_knots(bare, 0), sweep_knots(log, 0)
    assert np.isnan([got.center, *got.slope]).all() and got.level == 1.0
    assert got.F_pos == pytest.approx(9.0 + 3.0 * got.V_pos, abs=0.05) and got.inertia[0] == pytest.approx(
        1.6, rel=0.02
    )
    linear = sweep_knots(made(unit="m"), 0)
    assert np.isnan(linear.slope).all() and linear.center == pytest.approx(whole.center)
    (s,) = prepare(log, 0)
    inside = [
        (s.time >= a) & (s.time < b) & (d * s.velocity >= 0.8 * p)
        for (a, b), p in zip(PLAN.windows(), PLAN.speeds, strict=True)
        for d in (1, -1)
    ]
    assert whole.center == pytest.approx(np.mean([s.position[i].mean() for i in inside]), abs=1e-5)
    level = np.mean([np.cos(s.position[i] - whole.center).mean() for i in inside])
    assert whole.level == pytest.approx(level, abs=1e-5) and level < 0.999
    fast = sweep_knots(log, 0, c=0.9)
    assert np.all(fast.V_pos > whole.V_pos) and np.all(fast.count_pos < whole.count_pos)
    swing = PLAN.speeds * 2.0 * np.pi * 0.6 / np.diff(PLAN.windows(), axis=1)[:, 0]
    assert whole.swing == pytest.approx(swing)
    moved = sweep_knots(made(late=0.5 / RATE + 0.003), 0, delay=0.003)
    assert moved.F_pos == pytest.approx(whole.F_pos, abs=0.05) and moved.inertia[0] == pytest.approx(
        1.6, rel=0.02
    )


@pytest.mark.parametrize(("n", "kept"), [(4, False), (5, True)])
def test_a_window_needs_five_samples_in_a_direction(n, kept):
    plan = Sweep(A, V, 5)
    log = made(plan)
    cycle = plan.windows()[1]
    cycles = windows(log, 0, plan, prepare(log, 0))
    short = Windows(time=cycles.time.copy(), peak=cycles.peak, from_plan=True)
    (s,) = prepare(log, 0)
    slow = np.flatnonzero((s.time >= cycle[0]) & (-s.velocity >= 0.8 * plan.speeds[1]))
    short.time[1, 1] = s.time[slow[n - 1]] + 0.5 / RATE  # the cycle ends where so many are fast along -q
    got = correct_pairs([s], short, rotary=True)
    assert got.count_neg[1] == n and np.isfinite(got.F_neg[1]) is np.bool_(kept) and np.isfinite(got.F_pos[1])
    found = sort_knots(got, "a", short, 0.8)
    assert found.V.size == (5 if kept else 4)
    assert kept or (
        "of cycles 2 (0.8) (peak speed) too few samples reach 0.8 of the peak speed in both directions"
        in found.warnings[0]
    )


def test_pairs_are_merged_within_a_hundredth_of_the_top_speed():
    for apart, n in ((0.019, 2), (0.021, 3)):
        x = np.array([0.5, 2.0 - apart, 2.0])
        one = np.ones(3)
        knots = SweepKnots(
            V_pos=x, V_neg=x, F_pos=x, F_neg=x, error_pos=one, error_neg=one, count_pos=9 * one.astype(int),
            count_neg=9 * one.astype(int),
        )  # fmt: skip
        cycles = Windows(
            time=np.array([[0.0, 1.0], [1.0, 2.0], [2.0, 2.0]]), peak=x, from_plan=True, warnings=("before",)
        )
        got = sort_knots(knots, "a", cycles, 0.8)
        assert got.V.size == n and got.warnings[0] == "before" and len(got.warnings) == (2 if n == 2 else 1)
        assert (np.isfinite(got.swing).all() and got.swing[-1] < 1e-9) or n == 2
    nothing = replace(knots, F_pos=np.array([np.nan, 1.0, np.nan]))
    with pytest.raises(NotIdentifiable, match="1 of 3 cycles reach their speed"):
        sort_knots(nothing, "a", cycles, 0.8)
    two = sort_knots(replace(knots, F_pos=np.array([2.0, np.nan, 4.0])), "a", cycles, 0.8)
    assert two.V.tolist() == [0.5, 2.0]


# ------------------------------------------------------------------------------------------- cycles


def test_cycles_are_those_of_the_plan_that_was_followed():
    log = made()
    stretches = prepare(log, 0)
    got = windows(log, 0, PLAN, stretches)
    assert got.from_plan and got.warnings == () and np.array_equal(got.time, PLAN.windows())
    assert got.peak == pytest.approx([0.5, 1.0, 1.5, 2.0])
    shifted = log.replace(time=log.time + 40.0)  # the plan begins at the log's first instant
    got = windows(shifted, 0, PLAN, prepare(shifted, 0))
    assert got.from_plan and got.time == pytest.approx(PLAN.windows() + 40.0)
    later = Sweep(A, V, 4, start=3.0)
    got = windows(shifted, 0, later, prepare(shifted, 0))
    assert got.from_plan and got.time == pytest.approx(PLAN.windows() + 40.0)
    turn = InTurn((Sweep(A, V, 4, joint="b"), Sweep(A, V, 4, joint="a")))
    both = Log(time=np.arange(0.0, turn.duration, 1.0 / RATE), joints=(Joint(name="a"), Joint(name="b")),
               position=turn.position(np.arange(0.0, turn.duration, 1.0 / RATE))[:, ::-1],
               torque=np.ones((np.arange(0.0, turn.duration, 1.0 / RATE).size, 2)))  # fmt: skip
    for joint in ("a", "b"):
        got = windows(both, joint, turn, prepare(both, joint))
        assert got.from_plan and np.array_equal(got.time, turn.plan_of(joint).windows())
    other = windows(log, 0, InTurn((Sweep(A, V, 4, joint="x"),)), stretches)
    assert (
        not other.from_plan and other.warnings == () and other.time == pytest.approx(PLAN.windows(), abs=0.05)
    )
    free = windows(log, 0, None, stretches)
    assert (
        not free.from_plan
        and free.warnings == ()
        and free.peak == pytest.approx([0.5, 1.0, 1.5, 2.0], rel=0.03)
    )


@pytest.mark.parametrize("position", [True, False])
@pytest.mark.parametrize(("share", "follows"), [(0.145, True), (0.155, False)])
def test_a_plan_is_followed_within_015_of_its_stroke_or_top_speed(share, follows, position):
    log = made()
    if position:
        log = log.replace(position=log.position[:, 0] + share * A)
    else:
        log = log.replace(position=None, velocity=PLAN.velocity(log.time) + share * V)
    stretches = prepare(log, 0)
    if follows:
        assert windows(log, 0, PLAN, stretches).from_plan
    else:
        try:
            got = windows(log, 0, PLAN, stretches)
        except NotIdentifiable:
            return
        assert not got.from_plan and "did not follow the plan" in got.warnings[0]


def test_the_speed_of_a_cycle_is_the_mean_of_both_ways():
    """Steps of a quarter from a speed of four of them on; one way is off by more than a step's share, their mean is not."""
    speeds = np.repeat([1.0, 1.25, 1.5, 1.75, 2.0], 2)
    speeds[4:6] *= 1.04, 0.96
    log = strokes(speeds)
    assert len(find_windows(log, 0)) == 5
    found = windows(log, 0, None, prepare(log, 0)).peak
    assert found == pytest.approx([1.0, 1.25, 1.5, 1.75, 2.0], rel=0.02)


def strokes(speeds, size=A, shapes=None, rate=RATE, gap=0.0):
    """A position that goes to and fro: half periods of a cosine of a given peak speed, one after the other."""
    pieces, sign = [np.full(round(0.2 * rate), -0.5 * size)], -1.0
    for k, v in enumerate(speeds):
        stroke = size if np.isscalar(size) else size[k]
        n = round(0.5 * np.pi * stroke / v * rate)
        pieces.append(sign * 0.5 * stroke * np.cos(np.pi * np.arange(n) / n))
        sign = -sign
    x = np.concatenate([*pieces, np.full(round(0.2 * rate), pieces[-1][-1])])
    t = np.arange(x.size) / rate
    return Log(time=t, joints=(Joint(name="a"),), position=x, torque=np.ones(x.size))


@pytest.mark.parametrize(
    ("back", "count"),
    [
        ((1.0, 1.0, 1.0, 1.0), 4),
        ((1.0, 1.0, 1.07, 1.0), 4),
        ((1.0, 1.0, 1.14, 1.0), 2),
        ((1.0, 1.0, 0.86, 1.0), 2),
    ],
)
def test_both_ways_of_a_cycle_have_one_speed(back, count):
    log = strokes([s * f for s, b in zip((0.5, 1.0, 1.5, 2.0), back, strict=True) for f in (1.0, b)])
    assert len(find_windows(log, 0)) == count


@pytest.mark.parametrize(
    ("speeds", "count"),
    [((0.5, 1.0, 1.5, 2.0), 4), ((0.5, 1.0, 1.53, 2.0), 4), ((0.5, 1.0, 1.7, 2.0), 2),
     ((2.0, 1.5, 1.0, 0.5), 0), ((1.0, 1.0, 1.0, 1.0), 0)],
)  # fmt: skip
def test_speeds_of_cycles_grow_by_equal_steps(speeds, count):
    log = strokes(np.repeat(speeds, 2))
    if count:
        found = find_windows(log, 0)
        assert len(found) == count
        half = [0.5 * np.pi * A / v for v in np.repeat(speeds, 2)]
        edges = 0.2 + np.r_[0.0, np.cumsum(half)]
        assert found == pytest.approx(np.column_stack([edges[:-1:2], edges[2::2]])[:count], abs=0.03)
    else:
        with pytest.raises(NotIdentifiable, match="equal stroke and growing speed"):
            find_windows(log, 0)


def to_and_fro(turns, speeds, profile, rate=RATE):
    """A position that goes from turn to turn, each way at a peak speed; `profile`: share of a way against share of its time."""
    pieces = [np.full(round(0.3 * rate), turns[0])]
    for a, b, v in zip(turns, turns[1:], speeds, strict=False):
        share, steepest = profile
        n = round(abs(b - a) * steepest / v * rate)
        pieces.append(a + (b - a) * share(np.arange(n) / n))
    x = np.concatenate([*pieces, np.full(round(0.3 * rate), turns[-1])])
    return Log(time=np.arange(x.size) / rate, joints=(Joint(name="a"),), position=x, torque=np.ones(x.size))


COSINE = (lambda u: 0.5 - 0.5 * np.cos(np.pi * u)), 0.5 * np.pi


def trapeze(r):
    """Speed that rises in the first r of the time and falls in the last r."""
    grid = np.linspace(0.0, 1.0, 4001)
    speed = np.minimum(1.0, np.minimum(grid, 1.0 - grid) / r)
    way = np.r_[0.0, np.cumsum(0.5 * (speed[1:] + speed[:-1]))]
    return (lambda u: np.interp(u, grid, way / way[-1])), 1.0 / (1.0 - r)


@pytest.mark.parametrize(("off", "count"), [(0.07, 4), (-0.07, 4), (0.13, 2), (-0.13, 2)])
def test_strokes_of_one_sweep_differ_by_less_than_a_tenth(off, count):
    turns = [-1.0, 1.0, -1.0, 1.0, -1.0, 1.0 + 2.0 * off, -1.0, 1.0, -1.0]
    log = to_and_fro(turns, np.repeat([0.5, 1.0, 1.5, 2.0], 2), COSINE)
    assert len(find_windows(log, 0)) == count
    longer = to_and_fro([-1.0, 1.0] * 4 + [-1.0, 2.0], [*np.repeat([0.5, 1.0, 1.5, 2.0], 2), 2.0], COSINE)
    assert len(find_windows(longer, 0)) == 4  # what follows does not matter


@pytest.mark.parametrize(("r", "sine"), [(0.495, False), (0.45, True), (0.25, True), (0.17, False)])
def test_cycles_are_sines_by_the_time_that_they_are_fast(r, sine):
    """(1 - 1.6 r) / (0.6435 (1 - r)) of a sine's time above 0.8 of the peak: 0.64, 0.79, 1.24 and 1.36."""
    log = to_and_fro([-3.0, 3.0] * 4 + [-3.0], np.repeat([0.5, 1.0, 1.5, 2.0], 2), trapeze(r))
    if sine:
        assert len(find_windows(log, 0)) == 4
    else:
        with pytest.raises(NotIdentifiable):
            find_windows(log, 0)


def test_turning_points_by_hand():
    x = np.array([0.0, 0.0, 1.0, 2.0, 2.0, 1.5, 2.5, 3.0, 1.0, 0.0, 0.2, 0.1, -1.0, 4.0, 4.0])
    assert turning_points(x, 1.0).tolist() == [1, 7, 12, 13]
    assert turning_points(x, 0.4).tolist() == [1, 4, 5, 7, 12, 13]
    assert turning_points(np.ones(5), 0.1).tolist() == [] and turning_points(-x, 1.0).tolist() == [
        1,
        7,
        12,
        13,
    ]
    assert turning_points(np.array([0.0, 1.0]), 2.0).tolist() == []
    assert turning_points(np.array([3.0, 0.0, 1.0, 2.0]), 1.5).tolist() == [0, 1, 3]


def test_cycles_are_sought_in_velocity_and_in_the_longest_stretch_too():
    log = made()
    bare = log.replace(position=None, velocity=PLAN.velocity(log.time))
    assert find_windows(bare, 0) == pytest.approx(PLAN.windows(), abs=0.06)
    early = log.between(0.0, 1.2)
    joined = Log(
        time=np.r_[early.time, log.time + 9.0], joints=log.joints, position=np.r_[early.position, log.position],
        torque=np.r_[early.torque, log.torque],
    )  # fmt: skip
    assert find_windows(joined, 0) == pytest.approx(PLAN.windows() + 9.0, abs=0.05)


# ----------------------------------------------------------------------------------------- the whole way

CENTERS = (-1.1, 0.2, 1.3)


@pytest.fixture(scope="module")
def three():
    return [
        made(Sweep(A, V, 4, center=c), gravity=(6.0, 14.0), noise=0.05, seed=k) for k, c in enumerate(CENTERS)
    ]


def test_sweeps_about_three_centers_are_the_sum_of_their_parts(three):
    found, shown = identify_sweep(three, "a", timing="command")
    knots = [sweep_knots(log, "a") for log in three]
    one = fit(knots, unit="rad", name="a")
    assert found.law.rate == one.law and found.warnings == one.warnings and found.method == "sweep"
    assert found.standard_errors == {
        "positive": pytest.approx(one.error_pos),
        "negative": pytest.approx(one.error_neg),
    }
    weight = np.array([k.inertia[1] for k in knots]) ** -2.0
    value = {name: e.value for name, e in found.dynamics.items()}
    error = {name: e.standard_error for name, e in found.dynamics.items()}
    assert value["inertia"] == pytest.approx(weight @ [k.inertia[0] for k in knots] / weight.sum())
    assert error["inertia"] == pytest.approx(weight.sum() ** -0.5) and value["inertia"] == pytest.approx(
        1.6, rel=0.02
    )
    assert (value["time_slip"], error["time_slip"]) == (pytest.approx(-0.5 / RATE), 0.0)
    for term, (v, e) in one.terms.items():
        assert (value[term], error[term]) == (v, e)
    assert value["gravity_sin"] == pytest.approx(6.0, abs=0.2) and value["gravity_cos"] == pytest.approx(
        14.0, abs=0.2
    )
    assert {n: e.unit for n, e in found.dynamics.items()} == {
        n: {"inertia": "kg.m^2", "time_slip": "s"}.get(n, "N.m") for n in found.dynamics
    }
    stretches = [s for log in three for s in prepare(log, "a")]
    speeds = np.concatenate([s.velocity for s in stretches])
    assert found.validity.velocity == (speeds.min(), speeds.max())
    off = np.concatenate([(s.torque - dynamics.predict(found, s))[s.sliding] for s in stretches])
    assert found.fitted.rms == pytest.approx(np.sqrt(np.mean(off**2))) and found.fitted.samples == off.size
    # the last sweep is judged by the fit to the others where these tell its gravity: two centers do not
    assert found.held_out is None and shown.samples.fitted.all()
    assert shown.verdict == verdict(found, one) and shown.joint == "a"
    known = np.abs(shown.curve.velocity) >= found.validity.lowest_speed
    band = error_of_curve(found)(shown.curve.velocity)
    assert shown.curve.standard_error[known] == pytest.approx(band[known])
    assert shown.curve.standard_error.max() > 0.2 * found.law.torque(found.validity.lowest_speed)
    torque = np.concatenate([s.torque for s in stretches])
    stride = -(-torque.size // 4000)
    rest = np.concatenate([dynamics.rest_of_dynamics(found, s)[::stride] for s in stretches])
    assert shown.samples.torque - shown.samples.friction == pytest.approx(rest)
    fitted = fit_sweeps(three, "a", timing="command")
    assert (
        fitted.law == one.law
        and fitted.covariance == pytest.approx(one.covariance)
        and fitted.terms == one.terms
    )
    forced = identify_sweep(three, "a", timing="command", symmetric=True)[0]
    assert forced.law.rate.positive == forced.law.rate.negative and "offset" in forced.dynamics
    assert fit_sweeps(three, "a", timing="command", symmetric=False).symmetric is False


def test_the_last_sweep_is_judged_by_the_others_where_they_tell_its_gravity(three):
    again = made(Sweep(A, V, 4, center=CENTERS[1]), gravity=(6.0, 14.0), noise=0.05, seed=9)
    logs = [three[0], three[1], again]
    found, shown = identify_sweep(logs, "a", timing="command")
    before, _ = identify_sweep(logs[:2], "a", timing="command")
    (s,) = prepare(again, "a")
    assert found.held_out == assess(before, [s]) and found.held_out.samples == np.count_nonzero(s.sliding)
    assert found.fitted == assess(found, [s for log in logs for s in prepare(log, "a")])
    unseen = ~shown.samples.fitted
    assert 0.3 < unseen.mean() < 0.37 and not unseen[: unseen.size // 2].any()
    n = int(unseen.sum())
    stride = -(-sum(x.time.size for log in logs for x in prepare(log, "a")) // 4000)
    assert shown.samples.predicted[-n:] == pytest.approx(dynamics.predict(before, s)[::stride])
    assert identify_sweep(three[:1], "a", timing="command")[0].held_out is None


def test_the_literal_way_knows_no_errors(three):
    found, shown = identify_sweep(three[1:2], "a", literal=True)
    knots = sweep_knots(three[1], "a", literal=True)
    by_hand = literal(three[1], windows(three[1], "a", three[1].plan, prepare(three[1], "a")))
    assert pytest.approx(by_hand.F) == knots.F and found.law.rate.velocity == pytest.approx(knots.V)
    assert found.law.rate.positive == pytest.approx(knots.F) and found.standard_errors == {}
    assert np.isnan(shown.curve.standard_error).all() and "standard errors" not in shown.verdict
    assert found.dynamics["inertia"].value == pytest.approx(sweep_knots(three[1], "a").inertia[0])
    assert found.dynamics["time_slip"].value == pytest.approx(-0.5 / RATE)


def test_growth_with_the_load_becomes_the_laws():
    logs = [
        made(Sweep(A, V, 4, center=c), gravity=(6.0, 20.0), noise=0.01, seed=k, mu=0.1)
        for k, c in enumerate((-1.9, -0.4, 0.8, 1.6))
    ]
    found, _ = identify_sweep(logs, "a", timing="command")
    one = fit([sweep_knots(log, "a") for log in logs], unit="rad", name="a")
    assert one.load is not None
    growth, errors = found.law.growth, found.standard_errors
    assert growth is not None and growth.load_driving == growth.load_driven == one.load[0]
    assert (
        errors["load_driving"] == errors["load_driven"] == one.load[1] and growth.load_carried == one.load[2]
    )
    assert one.load[0] == pytest.approx(0.1, rel=0.05)


def test_a_torque_sampled_with_the_position_is_taken_as_such():
    log = made(late=0.0)
    sampled = identify_sweep([log], "a", timing="sample")[0]
    assert sampled.dynamics["time_slip"].value == pytest.approx(0.0, abs=1e-12)
    assert sampled.law.torque(np.array([0.7, 1.7])) == pytest.approx([11.1, 14.1], abs=0.05)
    told = identify_sweep([log], "a")[0]
    assert told.dynamics["time_slip"].value == pytest.approx(0.0, abs=1e-12) and told.law == sampled.law
    wrong = identify_sweep([log], "a", timing="command")[0]
    assert wrong.dynamics["time_slip"].value == pytest.approx(-0.5 / RATE) and wrong.law != told.law


def test_a_delay_of_the_drive_is_estimated_and_said():
    late = [made(late=0.5 / RATE + 0.004, noise=0.02, seed=k) for k in range(2)]
    found, _ = identify_sweep(late, "a")
    slip = found.dynamics["time_slip"]
    assert slip.value == pytest.approx(-0.5 / RATE - 0.004, abs=2e-4) and 0.0 < slip.standard_error < 2e-4
    assert any(w.startswith(f"The torque acts {-1e3 * slip.value - 2.0:.2f} +- {1e3 * slip.standard_error:.2f} ms later")
               for w in found.warnings)  # fmt: skip
    delay, error = -slip.value - 0.5 / RATE, slip.standard_error
    knots = [sweep_knots(log, "a", delay=delay) for log in late]
    off = [sweep_knots(log, "a", delay=delay + error) for log in late]
    one = fit(knots, unit="rad", name="a", late=off)
    assert found.standard_errors["positive"] == pytest.approx(one.error_pos, rel=1e-6)
    assert np.all(one.error_pos > fit(knots, unit="rad", name="a").error_pos)
    fitted = fit_sweeps(late, "a")
    assert (
        fitted.covariance == pytest.approx(one.covariance, rel=1e-6, abs=1e-12) and len(fitted.warnings) == 1
    )


def delays_of(monkeypatch, found, told=None, coarse=None, from_coarse=(), agreed=None, **more):
    """Return what is taken for the delays of logs of 250 and 500 Hz, whose torque's timing is not told unless `told`.

    From `coarse` on, `from_coarse` is estimated; `agreed` is what a shift of the torque makes of a vague delay.
    """
    monkeypatch.setattr(sweep_delay, "_with_shift", lambda delay, error, every: agreed)
    monkeypatch.setattr(
        sweep_delay, "torque_timing", lambda s: ((told or [None] * len(found))[int(s[0].time[0])], 0.0, 0.0)
    )
    monkeypatch.setattr(sweep_delay, "coarse_delay", lambda stretches: coarse)
    monkeypatch.setattr(
        sweep_delay,
        "sweep_delay",
        lambda s, cycles, start=0.0: (from_coarse if start else found)[int(s[0].time[0])],
    )
    monkeypatch.setattr(sweep_delay, "windows", lambda log, joint, plan, s: None)
    monkeypatch.setattr(sweep_delay, "_doubt", lambda *_: "The motion does not show which.")
    stretches = [[SimpleNamespace(rate=RATE * (1 + k), time=np.array([float(k)]))] for k in range(len(found))]
    logs = [SimpleNamespace(plan=None)] * len(found)
    options = {"timing": None, "literal": False} | more
    return sweep_delay.drive_delays(logs, "a", stretches, options["timing"], options["literal"])


NONE = (float("nan"), float("nan"))
USUAL = 0.004  # standard deviation of delays about which a sweep tells nothing [s]


def test_delays_of_several_sweeps_are_averaged_by_their_errors(monkeypatch):
    delays, errors, said = delays_of(monkeypatch, [(2e-3, 2e-4), (3e-3, 4e-4), NONE, (9.0, 0.0)])
    assert delays == pytest.approx([2.2e-3] * 4) and errors == pytest.approx([1e-4 * np.sqrt(3.2)] * 4)
    assert said[0].startswith("The torque acts 2.20 +- 0.18 ms later than a command")
    delays, errors, _ = delays_of(monkeypatch, [NONE, (2e-3, 2e-4), NONE], ["command", None, "sample"])
    assert delays == pytest.approx([0.0, 2e-3, -0.5 / RATE / 3.0]) and errors == pytest.approx(
        [0.0, 2e-4, 0.0]
    )
    for more, wanted in (
        ({"timing": "command"}, [0.0, 0.0]), ({"timing": "sample"}, [-0.5 / RATE, -0.25 / RATE]),
        ({"literal": True}, [0.0, 0.0]), ({"timing": "sample", "literal": True}, [-0.5 / RATE, -0.25 / RATE]),
    ):  # fmt: skip
        assert delays_of(monkeypatch, [(2e-3, 2e-4)] * 2, **more) == (pytest.approx(wanted), [0.0, 0.0], [])
    assert delays_of(monkeypatch, [NONE, NONE], ["command", "sample"])[0] == pytest.approx(
        [0.0, -0.25 / RATE]
    )
    # half a sampling interval is as vague as it may be
    for error, told in ((0.49 / RATE, True), (0.51 / RATE, False)):
        delays, errors, said = delays_of(monkeypatch, [(2e-3, error)])
        share = USUAL**2 / (USUAL**2 + error**2)  # what is usual counts as another estimate, of zero
        otherwise = [pytest.approx(2e-3 * share)], [pytest.approx(error * share**0.5)]
        assert (delays, errors) == (([2e-3], [pytest.approx(error)]) if told else otherwise)
        assert ("does not show" in said[0]) is not told and len(said) == 1
    delays, errors, said = delays_of(monkeypatch, [NONE])
    assert (delays, errors) == ([0.0], [pytest.approx(USUAL)]) and "does not show" in said[0]


def test_a_long_delay_is_sought_from_the_coarse_one_and_taken_where_the_two_agree(monkeypatch):
    vague = 2.2 / RATE
    for fine, error, taken in (
        (-0.052, vague, True), (-0.052, 0.011, False), (-0.2, vague, False), (0.05, vague, False), (-0.052, 0.4 / RATE, True),
    ):  # fmt: skip
        for first in (NONE, (-0.03, vague)):
            delays, errors, _ = delays_of(monkeypatch, [first], coarse=0.05, from_coarse=[(fine, error)])
            otherwise = [0.0], [pytest.approx(abs(fine))]  # it may be this, or none
            assert (delays, errors) == (([fine], [pytest.approx(error)]) if taken else otherwise)
    # no shift explains the torque better
    assert delays_of(monkeypatch, [(-0.052, vague)])[:2] == ([0.0], [pytest.approx(0.052)])
    assert delays_of(monkeypatch, [(-0.052, vague)], agreed=(-0.05, 1e-3))[:2] == ([-0.05], [1e-3])
    for delay, odd in (
        (-0.5 / RATE - 0.024, False),
        (-0.5 / RATE - 0.026, True),
        (0.024, False),
        (0.026, True),
    ):
        delays, errors, _ = delays_of(monkeypatch, [(delay, 0.01)], agreed=(1.0, 1.0))
        share = USUAL**2 / (USUAL**2 + 0.01**2)
        usual = [pytest.approx(delay * share)], [pytest.approx(0.01 * share**0.5)]
        assert (delays, errors) == (([1.0], [1.0]) if odd else usual)
    assert delays_of(monkeypatch, [(-0.01, 1e-4)], coarse=0.05, from_coarse=[(9.0, 1e-4)])[0] == [-0.01]


def test_a_delay_is_not_told_by_two_cycles_or_without_position():
    for plan, bare in ((Sweep(A, V, 2), False), (PLAN, True)):
        log = made(plan)
        if bare:
            log = log.replace(position=None, velocity=plan.velocity(log.time))
        stretches = prepare(log, 0)
        assert np.isnan(sweep_delay.sweep_delay(stretches, windows(log, 0, plan, stretches))).all()
    log = made()
    pushed = log.replace(torque=-log.torque)  # no inertia is negative
    assert np.isnan(sweep_delay.sweep_delay(prepare(pushed, 0), windows(log, 0, PLAN, prepare(log, 0)))).all()
    three = made(Sweep(A, V, 3), late=0.5 / RATE + 0.004)
    assert sweep_delay.sweep_delay(prepare(three, 0), windows(three, 0, three.plan, prepare(three, 0)))[
        0
    ] == pytest.approx(0.004, rel=0.05)


def test_the_delay_is_found_where_jerk_is_a_hundred_thousand_times_the_speed():
    """At 32 Hz the low pass of the motion at 100 Hz costs a tenth of it."""
    plan, delay = Sweep(0.02, 2.0, 4), 2e-3
    log = made(plan, late=0.5e-3 + delay, rate=1000.0)
    found, _ = sweep_delay.sweep_delay(prepare(log, 0), windows(log, 0, plan, prepare(log, 0)))
    assert found == pytest.approx(delay, rel=0.1)


def test_a_sweep_without_a_log_is_refused():
    for call in (lambda: identify_sweep([], "a"), lambda: fit_sweeps([], "a")):
        with pytest.raises(InvalidInput, match="There is no log"):
            call()
