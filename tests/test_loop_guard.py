"""The guards of the torque loop: limits that cannot be left out, the watch, the latch, and no push without counts."""

import copy
import pickle

import numba as nb
import numpy as np
import pytest

from _loops import guarded
from backdrive.control import BareLoop, JointLoop, Loop, envelope, torque_limit
from backdrive.control.compensators import (
    Compensator,
    Dither,
    alg_fc,
    alg_fc2,
    disturbance_observer,
    impulsive,
    lugre_observer,
    mahvash_okamura,
)
from backdrive.control.compensators.extras import BristleObserver, DisturbanceObserver, Pulses
from backdrive.control.estimators.external import ExternalForce
from backdrive.control.estimators.friction import alg_fe
from backdrive.control.estimators.level import Adaptation
from backdrive.control.guard import window
from backdrive.errors import InvalidInput, LimitWarning
from backdrive.laws import CoulombViscous, HaywardArmstrong, Law, LuGre
from backdrive.parameters import check
from backdrive.status import Status

JIT = not nb.config.DISABLE_JIT
T, TOP, K = 1e-3, 3.0, 5e4
RATE = CoulombViscous(coulomb_positive=7.0, coulomb_negative=7.0, viscous_positive=3.0, viscous_negative=3.0)
FC = alg_fc(RATE, K, share=0.8)
GOOD = {"compensator": FC, "limit": 15.0, "top_speed": TOP, "encoder_count": 1e-6}
ONE = np.zeros(1)


def loop_of(compensator=FC, dt=T, **changes):
    return Loop(guarded(compensator, **({"top_speed": TOP} | changes)), interval=dt)


def run(loop, positions, applied=0.0, dt=None):
    """Return torque and status along positions, with the limit and the rate checked in every call."""
    joint, out = loop.joints[0], []
    before = loop.torque[0]
    for q in positions:
        code = loop.update(np.array([q]), np.array([applied]), dt)
        f = loop.torque[0]
        assert np.isfinite(f)
        assert abs(f) <= joint.limit
        assert abs(f - before) <= joint.normal_rate * (dt or loop.interval) * (1.0 + 1e-9) + 1e-12
        out.append((f, int(code)))
        before = f
    return np.array(out).T


def warmed(loop, speed=0.5, seconds=1.0, begin=0.0):
    """Run a loop at a speed until it gives all of its torque, and return where it is."""
    n = round(seconds / loop.interval)
    run(loop, begin + speed * loop.interval * np.arange(n))
    return begin + speed * loop.interval * (n - 1)


def observing(highest):
    """Return a LuGre observer that scales its friction up to a level."""
    learns = BristleObserver(adaptation=1.0, highest=highest)
    return lugre_observer(RATE, LuGre(stiffness=K, damping=20.0), learns, share=0.8)


# ----------------------------------------------------------------------------------------------------- construction


def test_limit_top_speed_and_count_are_asked_for():
    for missing in ("limit", "top_speed", "encoder_count"):
        with pytest.raises(TypeError, match=missing):
            JointLoop(**{k: v for k, v in GOOD.items() if k != missing})


@pytest.mark.parametrize(
    ("bad", "named"),
    [
        ({"limit": np.inf}, "limit = inf"),
        ({"limit": np.nan}, "limit = nan"),
        ({"limit": -1.0}, "limit = -1"),
        ({"limit": True}, "limit = True"),
        ({"limit": "20"}, "limit = '20'"),
        ({"top_speed": np.inf}, "top_speed = inf"),
        ({"top_speed": 0.0}, "top_speed = 0"),
        ({"top_speed": 2e3}, "top_speed = 2000"),
        ({"encoder_count": 0.0}, "encoder_count = 0"),
        ({"encoder_count": 1.0}, "encoder_count = 1"),
        ({"encoder_count": 4e-3, "compensator": alg_fc(RATE, 1e3)}, "tenth of the top speed"),
        ({"ramp": 0.1}, "ramp = 0.1"),
        ({"hold": 10.0}, "hold = 10"),
        ({"fade": 0.0}, "fade = 0"),
        ({"patience": 2.0}, "patience = 2"),
        ({"rate": 349.0}, "rate = 349"),
        ({"rate": np.inf}, "rate = inf"),
        ({"compensator": alg_fc(RATE, K, share=1.01)}, "share = 1.01"),
        ({"compensator": alg_fc(RATE, 1e10)}, "stiffness = 1"),
        ({"compensator": alg_fc(RATE, 1e8)}, "relay"),
        ({"external": ExternalForce(inertia=1e6)}, "inertia = 1"),
        ({"compensator": observing(1.3)}, r"share = 1\.04"),
    ],
)
def test_what_lies_outside_the_envelope_is_refused_by_name(bad, named):
    with pytest.raises(InvalidInput, match=named):
        JointLoop(**(GOOD | bad))


def test_a_level_that_makes_the_share_more_than_one_is_refused():
    external = ExternalForce(inertia=0.7, friction=alg_fe(RATE, K))
    learning = Adaptation(slowest=0.02, upper=1.3)
    with pytest.raises(InvalidInput, match=r"share = 1\.04"):
        JointLoop(**GOOD, external=external, adaptation=learning)


@pytest.mark.parametrize("interval", [0.0, 4e-5, 0.03, np.nan, np.inf, -T, True])
def test_a_period_outside_the_envelope_is_refused(interval):
    with pytest.raises(InvalidInput, match="interval"):
        Loop(JointLoop(**GOOD), interval=interval)


def test_what_the_envelope_states_is_what_it_takes_ends_included():
    """The table at the head of `control.envelope`, row by row."""
    stated = {
        "PERIOD": (5e-5, 2e-2), "LIMIT": (0.0, 1e5), "TOP_SPEED": (1e-3, 1e3), "COUNT": (1e-9, 0.1), "SHARE": (0.0, 1.0),
        "STIFFNESS": (0.0, 1e9), "INERTIA": (1e-7, 1e5), "FRICTION": (0.0, 1e5),
    }  # fmt: skip
    for name, (low, high) in stated.items():
        bounds = getattr(envelope, name)
        for value in (low, high):
            check("here", {"number": bounds}, {"number": value})
        for value in (0.999 * low if low else -1e-9, 1.001 * high):
            with pytest.raises(InvalidInput, match="number"):
                check("here", {"number": bounds}, {"number": value})
    for period in (5e-5, 2e-2):
        assert Loop(JointLoop(**GOOD), interval=period).interval == period


def test_a_loop_of_nothing_or_without_guards_is_refused():
    with pytest.raises(InvalidInput, match="no joint"):
        Loop([], interval=T)
    with pytest.raises(InvalidInput, match="no limits"):
        Loop([JointLoop(**GOOD), BareLoop(compensator=FC)], interval=T)


def test_a_slow_period_needs_a_finer_encoder_or_less():
    """The window is two periods where that is longer than 10 ms."""
    soft = GOOD | {"compensator": alg_fc(RATE, 2e3)}
    coarse = JointLoop(**(soft | {"encoder_count": 0.1 * TOP * 0.01}))
    assert window(T) == 0.01
    assert window(0.02) == 0.04
    Loop(coarse, interval=T)
    with pytest.raises(InvalidInput, match="tenth of the top speed"):
        JointLoop(**(soft | {"encoder_count": 0.101 * TOP * 0.01}))


def test_a_limit_that_no_watch_can_make_up_for_is_warned_of():
    """1.5 R F(top speed) = 1.5 * 0.8 * (7 + 3 * 3) = 19.2."""
    JointLoop(**(GOOD | {"limit": 19.2}))
    with pytest.warns(LimitWarning, match=r"1\.5 R F.* = 19\.2"):
        JointLoop(**(GOOD | {"limit": 19.3}))
    assert torque_limit(FC, TOP) == pytest.approx(1.25 * 0.8 * 16.0)
    flat = CoulombViscous(coulomb_positive=7.0, coulomb_negative=6.0)
    for waves, expected in ((0.0, 1.25 * 0.8 * 6.0), (0.1, (0.8 + 0.1) * 7.0), (0.9, 1.5 * 0.8 * 6.0)):
        dithering = alg_fc(flat, K, dither=Dither(share=waves), share=0.8)
        assert torque_limit(dithering, TOP) == pytest.approx(expected)


def test_no_share_is_one_unless_it_is_said():
    assert Compensator().share == alg_fc(RATE, K).share == alg_fc2(RATE, K, 0.01).share == 0.8
    assert mahvash_okamura(RATE, K).share == 0.8


# ------------------------------------------------------------------------------------------------------------- watch


@pytest.mark.parametrize("speed", [1.05, 1.3, 2.0, 5.0, 300.0])
@pytest.mark.parametrize("count", [1e-6, 1e-3])
def test_a_runaway_is_latched_whether_its_readings_are_near_or_far(speed, count):
    """Near: the window of speeds; far: two jumps of one direction and speed."""
    loop = loop_of(alg_fc(RATE, 2e3, share=0.8), encoder_count=count)
    q = warmed(loop)
    along = np.floor((q + speed * TOP * T * np.arange(1, 400)) / count) * count
    torque, codes = run(loop, along)
    first = int(np.flatnonzero(codes == Status.OVERSPEED)[0])
    assert first <= (20 if count == 1e-6 else 45 if speed < 1.1 else 20)
    assert np.all(codes[first + 1 :] == Status.LATCHED)
    assert np.all(torque[first + 21 :] == 0.0)  # limit/0.02 s
    falling = np.abs(np.diff(torque[first : first + 100]))
    assert falling[falling > 0.0][:-1] == pytest.approx(loop.joints[0].limit / 0.02 * T, rel=1e-6)
    assert loop.causes == (Status.OVERSPEED,)


@pytest.mark.parametrize("count", [1e-6, 2e-3, 3e-3])
def test_nine_tenths_of_the_top_speed_are_no_runaway(count):
    loop = loop_of(alg_fc(RATE, 2e3, share=0.8), encoder_count=count)
    t = T * np.arange(4000 if JIT else 300)
    q = 0.9 * TOP / 5.0 * np.sin(5.0 * t)
    _, codes = run(loop, np.floor(q / count) * count)
    assert Status.OVERSPEED not in codes
    assert Status.LATCHED not in codes
    assert Status.JUMP not in codes


def test_the_top_speed_itself_is_no_runaway_whatever_is_rounded():
    loop = loop_of(alg_fc(RATE, 2e3, share=0.8))
    _, codes = run(loop, TOP * T * np.arange(1, 2000 if JIT else 300))
    assert Status.OVERSPEED not in codes
    assert Status.LATCHED not in codes


@pytest.mark.parametrize("way", [2 * np.pi, -2 * np.pi, 0.05])
def test_a_wrap_is_a_jump_and_never_latched(way):
    loop = loop_of()
    q = warmed(loop)
    after = q + way + 0.5 * T * np.arange(1, 1200)
    _, codes = run(loop, after)
    assert np.flatnonzero(codes == Status.JUMP).tolist() == list(range(51))  # half the patience
    assert set(codes[51:]) == {Status.OK}
    assert loop.torque[0] == pytest.approx(0.8 * 8.5, rel=0.01)


def test_readings_that_fly_about_are_jumps_until_the_patience_ends():
    loop, rng = loop_of(patience=0.2), np.random.default_rng(0)
    q = warmed(loop)
    torque, codes = run(loop, q + rng.uniform(-3.0, 3.0, 500) * np.where(np.arange(500) % 2, 1.0, -1.0))
    latched = int(np.flatnonzero(codes == Status.LATCHED)[0])
    assert latched <= 260
    assert np.all(torque[latched + 160 :] == 0.0)


def test_a_fault_that_lasts_is_latched_and_its_cause_kept():
    loop = loop_of()
    q = warmed(loop)
    _, codes = run(loop, np.full(120, np.nan))
    assert set(codes[:100]) == {Status.NOT_FINITE}
    assert set(codes[102:]) == {Status.LATCHED}
    assert loop.causes == (Status.NOT_FINITE,)
    torque, codes = run(loop, q + 0.5 * T * np.arange(300))
    assert set(codes) == {Status.LATCHED}
    assert np.all(torque[200:] == 0.0)


def test_a_latch_takes_no_longer_than_its_time_and_falls_no_faster():
    """A fault of 20 ms patience leaves torque standing when it latches: limit/0.15 s."""
    loop = loop_of(patience=0.02, fade=10.0)
    warmed(loop)
    torque, codes = run(loop, np.full(300, np.nan))
    first = int(np.flatnonzero(codes == Status.LATCHED)[0])
    assert torque[first] > 4.0
    falling = -np.diff(torque[first : first + 30])
    assert falling == pytest.approx(loop.joints[0].latch_rate * T, rel=1e-6)
    assert np.all(torque[first + 150 :] == 0.0)


def test_ticks_of_forty_milliseconds_are_latched_by_their_own_time():
    loop = loop_of()
    q = warmed(loop)
    codes = [int(loop.update(np.array([q]), ONE, 0.04)) for _ in range(12)]
    assert codes[:5] == [Status.BAD_INTERVAL] * 5
    assert codes[-1] == Status.LATCHED
    assert loop.causes == (Status.BAD_INTERVAL,)


@pytest.mark.parametrize("pause", [0.025, 0.5, 1e6])
def test_one_pause_however_long_is_a_passing_fault_and_no_jump(pause):
    loop = loop_of()
    q = warmed(loop)
    assert loop.update(np.array([q]), ONE, pause) == Status.BAD_INTERVAL
    q += 0.9 * TOP * min(pause, 1.0)
    _, codes = run(loop, q + 0.5 * T * np.arange(1, 300))
    assert set(codes) == {Status.OK}


def test_passing_faults_make_up_for_themselves_and_frequent_ones_add_up():
    """Good ticks take a quarter of a bad one's time off: one bad in six is borne, one in three is not."""
    for every, borne in ((6, True), (3, False)):
        loop = loop_of()
        q = warmed(loop)
        along = q + 0.5 * T * np.arange(1, 1500)
        along[::every] = np.nan
        _, codes = run(loop, along)
        assert (Status.LATCHED in codes) is not borne


def test_acknowledging_gives_the_torque_back_slowly():
    loop = loop_of()
    q = warmed(loop)
    run(loop, np.full(300, np.nan))
    assert loop.torque[0] == 0.0
    loop.acknowledge()
    torque, codes = run(loop, q + 0.5 * T * np.arange(1, 800))
    assert set(codes) == {Status.OK}
    grown = loop.joints[0].slow_rate * T * np.arange(1, 800)
    assert np.all(torque <= grown * (1.0 + 1e-9))
    assert torque[-1] == pytest.approx(0.8 * 8.5, rel=0.01)


@pytest.mark.parametrize("every", [1, 7, 100])
def test_who_acknowledges_for_ever_does_not_drive_a_runaway(every):
    loop = loop_of()
    q = warmed(loop)
    for k in range(1, 800):
        q += 1.5 * TOP * T
        run(loop, [q])
        if k % every == 0:
            assert loop.acknowledge() is False or k < 40
        if k > 60:
            assert loop.torque[0] == 0.0
    assert loop.causes == (Status.OVERSPEED,)
    run(loop, np.full(50, q))
    assert loop.acknowledge() is True
    assert loop.causes == (Status.OK,)


def test_a_latch_with_torque_left_is_not_taken_back():
    loop = loop_of(patience=0.02, fade=10.0)
    warmed(loop)
    run(loop, np.full(25, np.nan))
    assert loop.torque[0] > 1.0
    assert loop.acknowledge() is False
    assert loop.causes == (Status.NOT_FINITE,)


# ------------------------------------------------------------------------------------------------------ limit and rate


def test_a_reversal_takes_the_time_that_the_rate_allows():
    """From +R F to -R F at 0.1 F a millisecond, where it is asked for."""
    loop = loop_of(rate=700.0)
    q = warmed(loop)
    torque, _ = run(loop, q - 0.5 * T * np.arange(1, 60))
    rate = loop.joints[0].normal_rate
    assert rate == 700.0
    assert loop_of().joints[0].normal_rate == 1000.0 * 7.0
    steps = -np.diff(torque)
    assert steps.max() <= rate * T * (1.0 + 1e-9)
    assert np.count_nonzero(steps > 0.99 * rate * T) >= 12
    assert torque[-1] == pytest.approx(-0.8 * 8.5, rel=0.02)


def test_dither_that_is_switched_in_a_tick_is_smoothed():
    loop = loop_of(alg_fc(RATE, K, dither=Dither(share=0.9), share=0.8), encoder_count=1e-5)
    rng, q = np.random.default_rng(1), 0.0
    for _ in range(2000 if JIT else 200):
        q += rng.choice([0.0, 1e-5, -1e-5, 3e-4])
        run(loop, [q])


def test_what_comes_back_after_a_gap_does_not_step():
    """A gap of 60 ms in a reversal: the torque that is due has the other sign."""
    loop = loop_of()
    q = warmed(loop)
    run(loop, np.full(60, np.nan))
    torque, _ = run(loop, q - 0.5 * T * np.arange(60, 400))
    slow = loop.joints[0].slow_rate * T
    assert np.all(np.diff(np.abs(torque)) <= slow * (1.0 + 1e-9))


def test_at_the_start_the_torque_grows_slowly():
    loop = loop_of()
    torque, _ = run(loop, 0.5 * T * np.arange(600))
    assert np.all(torque <= loop.joints[0].slow_rate * T * np.arange(1, 601) * (1.0 + 1e-9))
    assert torque[-1] == pytest.approx(0.8 * 8.5, rel=0.01)


def test_stop_ramps_down_whatever_the_joint_does_and_a_latch_is_faster():
    loop = loop_of()
    q = warmed(loop)
    loop.stop()
    torque, codes = run(loop, q + 0.3 * np.sin(3.0 * T * np.arange(600)))
    assert set(codes) == {Status.STOPPED}
    assert np.all(torque[500:] == 0.0)
    assert np.all(
        np.abs(torque) <= np.maximum(6.9 - loop.joints[0].slow_rate * T * np.arange(600), 0.0) + 1e-9
    )
    loop.acknowledge()
    q = warmed(loop, begin=q)
    loop.stop()
    run(loop, np.full(150, np.nan))
    assert loop.codes[0] == Status.LATCHED
    run(loop, np.full(100, np.nan))
    assert loop.torque[0] == 0.0


# ------------------------------------------------------------------------------------------------ no counts, no push


def standing_compensators():
    model = Law(rate=RATE, element=HaywardArmstrong(stiffness=K))
    observer = DisturbanceObserver(inertia=0.7, bandwidth=40.0, limit=12.0)
    return {
        "decaying": alg_fc(RATE, K, 20.0),
        "slow": alg_fc(RATE, K, 0.1),
        "rigid": alg_fc(RATE, K, 0.0),
        "MO": mahvash_okamura(RATE, K),
        "algFC2": alg_fc2(RATE, K, 0.005, 0.0),
        "observer": disturbance_observer(model, observer),
        "pulses": impulsive(RATE, K, Pulses(height=9.0), 0.0),
    }


@pytest.mark.parametrize("name", sorted(standing_compensators()))
@pytest.mark.parametrize("flicker", [0.0, 1e-6])
def test_without_counts_there_is_no_push(name, flicker):
    """A frozen encoder, or one that flickers by a count, under a hand and a reference: below 5 % within the hold time."""
    compensator = standing_compensators()[name]
    loop = loop_of(compensator)
    loop.error[0] = 1e-2
    q = warmed(loop)
    pushed = abs(loop.torque[0])
    assert pushed > 1.0
    n = 3000 if JIT else 1200
    torque, codes = run(loop, q + flicker * (np.arange(n) % 2), applied=5.0)
    hold = round(loop.joints[0].hold / T)
    count = 0.8 * K * flicker
    assert np.abs(torque[hold:]).max() <= 0.05 * pushed + 1.5 * count
    assert (
        name == "algFC2" or Status.NO_MOTION in codes[:hold]
    )  # which lets go before the joint is taken to stand
    assert set(codes[hold + 10 :]) == {Status.OK}
    assert loop.causes == (Status.OK,)


def test_dither_goes_on_while_the_joint_stands_and_stays_below_its_share():
    loop = loop_of(alg_fc(RATE, K, 0.0, Dither(share=0.3), 0.8))
    q = warmed(loop)
    torque, _ = run(loop, np.full(2000, q))
    late = torque[600:]
    assert np.abs(late).max() == pytest.approx(0.3 * 7.0, rel=0.01)
    assert late.min() < -1.9


def test_noise_of_one_step_to_either_side_is_no_motion():
    loop, rng = loop_of(mahvash_okamura(RATE, K)), np.random.default_rng(0)
    q = warmed(loop)
    torque, _ = run(loop, q + 1e-6 * rng.integers(-1, 2, 3000 if JIT else 800))
    assert np.abs(torque[520:]).max() < 0.05 * 6.8 + 2.0 * 0.8 * K * 1e-6


def test_adaptive_dither_does_not_grow_without_counts():
    growing = Dither(share=0.9, frequency=15.0, mode="adaptive", count=1e-6, growth=0.02)
    loop = loop_of(alg_fc(RATE, K, 20.0, growing, 0.8))
    q = warmed(loop)
    torque, _ = run(loop, np.full(4000 if JIT else 1500, q))
    late = np.abs(torque[600:])
    assert late.max() <= 0.9 * 7.0 * 0.02 * 9.0  # of 0.07 s each within the hold time, not of 4 s


def test_after_standing_the_first_counts_bring_it_back():
    loop = loop_of(mahvash_okamura(RATE, K))
    q = warmed(loop)
    run(loop, np.full(1500, q))
    torque, codes = run(loop, q - 0.5 * T * np.arange(1, 200))
    assert set(codes) == {Status.OK}
    assert np.all(torque <= 1e-9)
    assert torque[-1] == pytest.approx(-0.8 * 8.5, rel=0.01)


# ------------------------------------------------------------------------------------------------------ outputs, copies


def test_what_is_written_as_a_whole_arrives():
    loop = loop_of()
    for name, value in (("error", 0.1), ("slope", [0.2]), ("known", np.array([3.0])), ("temperature", 30.0)):
        setattr(loop, name, value)
        assert getattr(loop, name)[0] == np.ravel(value)[0]
    loop.load = [[1.0, 2.0]]
    assert loop.load.tolist() == [[1.0, 2.0]]
    assert loop.update(ONE, ONE) == Status.OK
    with pytest.raises(AttributeError):
        loop.torque = np.ones(1)


class Hostile:
    """A reading that raises whatever is asked of it."""

    def __len__(self):
        raise RuntimeError

    def __float__(self):
        raise ZeroDivisionError


@pytest.mark.parametrize(
    ("position", "interval"),
    [(Hostile(), None), (ONE, Hostile()), (np.array([1.0 + 2.0j]), None), (None, T / 10)],
)
def test_whatever_raises_is_no_reading_and_the_rate_holds(position, interval):
    loop = loop_of(rate=400.0)
    warmed(loop)
    loop.stop()
    for _ in range(5):
        before = loop.torque[0]
        assert isinstance(loop.update(position, ONE, interval), Status)
        step = 400.0 * (interval if isinstance(interval, float) else T)
        assert abs(loop.torque[0] - before) <= step * (1.0 + 1e-9)


def test_nobody_writes_into_what_the_loop_gives():
    loop = loop_of()
    warmed(loop)
    command = loop.torque
    for output in (command, loop.external, loop.friction, loop.level, loop.codes):
        with pytest.raises(ValueError, match="read-only"):
            output += 1
    with pytest.raises(ValueError, match="read-only"):
        command += 10.0


@pytest.mark.parametrize("how", [copy.copy, copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
@pytest.mark.parametrize("state", ["running", "latched", "stopped"])
def test_a_copy_is_a_loop_of_its_own_in_the_same_state(how, state):
    loop = loop_of(external=ExternalForce(inertia=0.7, friction=alg_fe(RATE, K)))
    q = warmed(loop)
    if state == "latched":
        run(loop, np.full(130, np.nan))
    elif state == "stopped":
        loop.stop()
    other = how(loop)
    assert other.count == loop.count
    assert other.causes == loop.causes
    along = q + 0.4 * T * np.arange(1, 80)
    one = run(loop, along)
    before = loop.torque.copy()
    two = run(other, along)
    assert np.array_equal(one, two)
    run(other, np.full(50, np.nan))
    assert np.array_equal(loop.torque, before)


@pytest.mark.parametrize("bad", [[np.nan], [np.inf], [0.0, 0.0], [], 0.0])
def test_reset_refuses_what_is_no_position_and_leaves_the_loop_as_it_was(bad):
    loop = loop_of()
    q = warmed(loop)
    before = loop.torque.copy()
    with pytest.raises(InvalidInput, match="positions"):
        loop.reset(bad)
    assert np.array_equal(loop.torque, before)
    assert loop.update(np.array([q]), ONE) == Status.OK


def test_the_count_tells_a_watchdog_that_nobody_calls():
    loop = loop_of()
    assert loop.count == 0
    loop.update(ONE, ONE)
    loop.update("nonsense", ONE)
    loop.reset(ONE)
    loop.update(ONE, ONE, np.nan)
    assert loop.count == 3
    assert loop.count == 3


def test_a_dither_is_below_half_the_rate():
    with pytest.raises(
        InvalidInput, match=r"frequency = 500 Hz is not below half the rate of the loop, 500 Hz"
    ):
        loop_of(alg_fc(RATE, K, dither=Dither(frequency=500.0)))
    loop_of(alg_fc(RATE, K, dither=Dither(frequency=500.0)), dt=5e-4)


def far(begin, place):
    """Return the last torque of a loop that knows gravity, and the external force, along half a radian from a place on."""
    heavy = ExternalForce(inertia=2.0, friction=FC.friction, gravity_sin=5.0, gravity_cos=3.0)
    loop = loop_of(external=heavy)
    loop.reset(np.full(1, begin))
    f, _ = run(loop, place + 5e-4 * np.arange(3000))
    return f[-1], loop.external[0]


def test_half_a_million_turns_away_a_loop_works_as_near():
    near, away = far(0.0, 0.0), far(3e6, 3e6)
    assert near[0] == pytest.approx(6.8, abs=0.01)
    assert away[0] == pytest.approx(near[0], abs=0.01)
    assert np.isfinite(away[1])


@pytest.mark.parametrize("place", [1.2e15, 1e17])
def test_where_no_sine_is_known_the_torque_ends_at_zero(place):
    """Sines hold up to 2^50 rad; a loop cannot begin beyond 1e12."""
    assert far(0.0, place) == (0.0, 0.0)
    with pytest.raises(InvalidInput, match=r"positions reaches .* Give numbers, each between -1e12 and 1e12"):
        far(place, place)
