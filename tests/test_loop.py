"""The fused tick of several joints: whatever comes in, it neither raises nor allocates, and what goes out stays bounded."""

import gc
import sys
import tracemalloc

import numba as nb
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from _kinds import of_a_kind
from _loops import Bench, guarded
from backdrive.control import Admittance, BareLoop, JointLoop, Loop, torque_limit
from backdrive.control.admittance import tick as admit
from backdrive.control.compensators import (
    Dither,
    alg_fc,
    alg_fc2,
    by_law,
    disturbance_observer,
    impulsive,
    lugre_observer,
    nothing,
)
from backdrive.control.compensators.extras import BristleObserver, DisturbanceObserver, Pulses
from backdrive.control.estimators.external import METHODS, ExternalForce
from backdrive.control.estimators.friction import alg_fe, alg_fe2
from backdrive.errors import InvalidInput
from backdrive.laws import Coulomb, CoulombViscous, Law, LuGre, StribeckGauss
from backdrive.laws.examples import ELEMENT_EXAMPLES, RATE_EXAMPLES
from backdrive.status import Status

JIT = not nb.config.DISABLE_JIT
T = 1e-3
K = 5e4
RATE = CoulombViscous(coulomb_positive=7.0, coulomb_negative=6.0, viscous_positive=3.0, viscous_negative=3.0)
DECAYING = alg_fe(RATE, K).law.element
LUGRE = LuGre(stiffness=K, damping=20.0)
TOP = 3.0  # rad/s
BOUND = 7.0 + 3.0 * TOP  # of the friction law up to the top speed


def compensators():
    """Return one of each kind, and the largest torque that it may give up to the top speed."""
    observer = DisturbanceObserver(inertia=0.7, limit=5.0)
    stribeck = StribeckGauss(coulomb=6.0, breakaway=7.0, stribeck_velocity=0.05, viscous=3.0)
    pulses = Pulses(height=9.0)
    bristle = BristleObserver(gain=1.0, adaptation=1.0)
    damping = 7.0 + 2.0 * 20.0 * TOP  # of a bristle in one tick
    return {
        "alg_fc": (alg_fc(RATE, K, share=1.0), BOUND),
        "PD": (alg_fc(RATE, K, dither=Dither(share=0.3), share=1.0), BOUND + 0.3 * 7.0),
        "alg_fc2": (
            alg_fc2(RATE, K, 0.005, dither=Dither(share=0.3, mode="reset"), share=1.0),
            BOUND + 0.3 * 7.0,
        ),
        "adaptive": (
            alg_fc(RATE, K, dither=Dither(share=0.5, mode="adaptive", count=1e-6), share=1.0),
            BOUND + 0.5 * 7.0,
        ),
        "pulses": (impulsive(RATE, K, pulses, share=1.0), BOUND + 9.0),
        "lugre": (lugre_observer(stribeck, LUGRE, bristle, share=0.66), 0.66 * 1.5 * (BOUND + damping)),
        "observer": (
            disturbance_observer(Law(rate=RATE, element=DECAYING), observer, share=1.0),
            BOUND + 5.0,
        ),
    }


def estimators():
    friction = alg_fe2(RATE, K, 0.005)
    return [ExternalForce(inertia=0.7, method=m, friction=friction, encoder_count=1e-6) for m in METHODS]


def arm(**changes):
    """Return a loop of one joint a compensator, its estimators in turn."""
    methods = estimators()
    joints = [
        guarded(
            c, external=methods[i % len(methods)], top_speed=TOP, **({"limit": 60.0, "rate": 1e9} | changes)
        )
        for i, (c, _) in enumerate(compensators().values())
    ]
    return Loop(joints, interval=T)


NAMES = tuple(compensators())
BOUNDS = np.array([bound for _, bound in compensators().values()])
J = len(NAMES)


def motion(n):
    """Return positions of all joints [rad], (n, J)."""
    t = T * np.arange(n)[:, None]
    return 0.3 * np.sin(3.0 * t + np.arange(J)) + 0.02 * np.sin(40.0 * t)


# ------------------------------------------------------------------------------------------------ nothing is raised

anything = st.one_of(
    st.floats(-2.0, 2.0), st.sampled_from([np.nan, np.inf, -np.inf, 0.0, 1e300, -1e300, 5e-324, 1e20])
)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@settings(max_examples=30 if JIT else 3)
@given(
    ticks=st.lists(
        st.tuples(
            st.lists(anything, min_size=J, max_size=J),
            st.lists(anything, min_size=J, max_size=J),
            st.one_of(st.none(), anything, st.sampled_from([T, 5 * T, -T, 1, 0, 10**400])),
        ),
        min_size=1,
        max_size=12,
    )
)
def test_whatever_comes_in_the_torque_is_finite_and_bounded_and_comes_back(ticks):
    loop = shared()
    loop.reset(np.zeros(J))
    for q, u, dt in ticks:
        status = loop.update(np.array(q), np.array(u), dt)
        assert isinstance(status, Status)
        assert np.isfinite(loop.torque).all()
        assert np.isfinite(loop.external).all()
        assert np.isfinite(loop.friction).all()
        assert np.all(np.abs(loop.torque) <= BOUNDS * (1.0 + 1e-9))
    for _ in range(300):
        loop.update(np.zeros(J), np.zeros(J))
    assert loop.acknowledge()
    for _ in range(700):
        loop.update(np.zeros(J), np.zeros(J))
    assert np.all(loop.codes == Status.OK)
    assert np.isfinite(loop.torque).all()


LOOPS = []


def shared():
    if not LOOPS:
        LOOPS.append(arm())
    return LOOPS[0]


@pytest.mark.parametrize(
    ("position", "applied", "interval", "expected"),
    [
        (np.zeros(J), np.zeros(J), None, Status.OK),
        (np.zeros(J, dtype=np.float32), np.zeros(J, dtype=int), T, Status.OK),
        ([0.0] * J, (0,) * J, np.float32(T), Status.OK),
        (np.zeros((J, 2))[:, 0], np.zeros(2 * J)[::2], np.array(T), Status.OK),
        (np.zeros(J - 1), np.zeros(J), None, Status.NOT_FINITE),
        (np.zeros(J), np.zeros(J + 1), None, Status.NOT_FINITE),
        (np.zeros(1), np.zeros(1), None, Status.NOT_FINITE),
        (np.zeros((J, J)), np.zeros(J), None, Status.NOT_FINITE),
        (0.0, np.zeros(J), None, Status.NOT_FINITE),
        (None, None, None, Status.NOT_FINITE),
        ("readings", "torques", "now", Status.NOT_FINITE),
        (["a"] * J, np.zeros(J), None, Status.NOT_FINITE),
        (np.zeros(J), np.zeros(J), "now", Status.NOT_FINITE),
        (np.zeros(J), np.full(J, np.nan), None, Status.NOT_FINITE),
        (np.zeros(J), np.zeros(J), 0, Status.BAD_INTERVAL),
        (np.zeros(J), np.zeros(J), 1, Status.BAD_INTERVAL),
        (np.zeros(J), np.zeros(J), -T, Status.BAD_INTERVAL),
        (np.zeros(J), np.zeros(J), np.nan, Status.BAD_INTERVAL),
        (np.zeros(J), np.zeros(J), np.inf, Status.BAD_INTERVAL),
        (np.zeros(J), np.zeros(J), 100.0 * T, Status.BAD_INTERVAL),
        (np.zeros(J), np.zeros(J), 20.1 * T, Status.BAD_INTERVAL),
        (np.zeros(J), np.zeros(J), 1.4 * T, Status.OK),
        (np.zeros(J), np.zeros(J), 19.9 * T, Status.LATE),
        (np.full(J, 1e3), np.zeros(J), None, Status.JUMP),
    ],
)
def test_odd_inputs_get_their_status(position, applied, interval, expected):
    loop = shared()
    loop.reset(np.zeros(J))
    loop.update(np.zeros(J), np.zeros(J))
    assert loop.update(position, applied, interval) == expected
    assert np.isfinite(loop.torque).all()
    assert loop.update(np.zeros(J), np.zeros(J)) == Status.OK


@pytest.mark.parametrize("where", ["error", "slope", "known", "load", "temperature"])
def test_a_nan_beside_the_readings_is_survived(where):
    loop = shared()
    loop.reset(np.zeros(J))
    q = motion(60)
    for k, row in enumerate(q):
        getattr(loop, where)[:] = np.nan if 20 <= k < 30 else 20.0 if where == "temperature" else 0.0
        status = loop.update(row, np.zeros(J))
        assert (status == Status.NOT_FINITE) == (20 <= k < 30)
        assert np.isfinite(loop.torque).all()
    getattr(loop, where)[:] = 20.0 if where == "temperature" else 0.0


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of NumPy's scalars, without the compiler
@pytest.mark.parametrize("name", of_a_kind(sorted(ELEMENT_EXAMPLES)))
def test_every_law_survives_readings_beyond_all_measure(name):
    law = Law(rate=RATE_EXAMPLES["stribeck-gauss"], element=ELEMENT_EXAMPLES[name])
    joint = BareLoop(compensator=by_law(law), external=ExternalForce(inertia=1.0, method="extended"))
    loop = Bench(joint, interval=T)
    for q in (0.0, 1e308, -1e308, 1e308, np.inf, 0.0, 1e-3, 0.0):
        loop.update(np.array([q]), np.zeros(1))
        assert np.isfinite([loop.torque, loop.external, loop.friction]).all()
    for _ in range(50):
        loop.update(np.zeros(1), np.zeros(1))
    assert loop.codes[0] == Status.OK
    assert abs(loop.torque[0]) < 20.0


# ------------------------------------------------------------------------------------------------ faults of a sensor


def test_while_readings_are_missing_the_torque_fades_and_then_comes_back_slowly():
    loop, fade = arm(fade=80.0), 80.0
    slow = loop.joints[0].slow_rate
    q = motion(600)
    for k in range(400):
        loop.update(q[k], np.zeros(J))
    before = loop.torque.copy()
    for k in range(400, 450):
        assert loop.update(np.full(J, np.nan), np.zeros(J)) == Status.NOT_FINITE
        assert loop.torque == pytest.approx(
            before / (1.0 + fade * T) ** (k - 400), rel=1e-9
        )  # one is bridged
    assert np.abs(loop.torque).max() < 0.03 * np.abs(before).max()
    faded = np.abs(loop.torque)
    for k in range(450, 600):
        assert loop.update(q[k], np.zeros(J)) == Status.OK
        assert np.all(np.abs(loop.torque) <= (faded + slow * T * (k - 449)) * (1.0 + 1e-9))
    assert np.abs(loop.torque).max() > 3.0
    assert np.abs(loop.external).max() < 200.0


def test_the_other_joints_do_not_notice():
    """A joint whose encoder fails leaves torque and estimate of the others as they are, bit for bit."""
    sick, well = arm(), arm()
    q = motion(300 if JIT else 60)
    rng = np.random.default_rng(0)
    for loop in (sick, well):
        loop.reset(q[0])
    for k, row in enumerate(q):
        bad = row.copy()
        bad[2] = rng.choice([np.nan, np.inf, 50.0, row[2]])
        u = np.full(J, 0.1 * k)
        status = sick.update(bad, u)
        well.update(row, u)
        others = np.arange(J) != 2
        for name in ("torque", "external", "friction", "codes"):
            assert np.array_equal(getattr(sick, name)[others], getattr(well, name)[others])
        assert (status == Status.OK) == (bad[2] == row[2] and sick.causes[2] == Status.OK)


def single(top=TOP, method="direct", **changes):
    external = ExternalForce(inertia=0.7, method=method, friction=alg_fe2(RATE, K, 0.005))
    return Loop(
        guarded(
            alg_fc(RATE, K, share=0.9), **({"external": external, "top_speed": top, "rate": 1e4} | changes)
        ),
        interval=T,
    )


@pytest.mark.parametrize("jump", [1.0, 0.02, -0.2])
@pytest.mark.parametrize("method", METHODS)
def test_a_new_zero_of_the_encoder_is_taken_over_after_a_while(jump, method):
    """Neither torque nor estimate sees the jump, small ones included: no reading after it is taken for a motion."""
    n = 1000
    q = 0.2 * np.sin(3.0 * T * np.arange(n))
    runs = []
    for by in (0.0, jump):
        loop, out = single(method=method, patience=0.05), []
        shifted = q + np.where(np.arange(n) >= 200, by, 0.0)
        for k in range(n):
            loop.update(shifted[k : k + 1], np.zeros(1))
            out.append((loop.torque[0], loop.external[0], loop.codes[0]))
        runs.append(np.array(out))
    whole, broken = runs
    jumped = np.flatnonzero(broken[:, 2] == Status.JUMP)
    assert jumped[0] == 200
    assert np.all(np.diff(jumped) == 1)
    assert jumped.size * T == pytest.approx(0.025, abs=3 * T)  # half the patience
    assert np.all(np.abs(broken[200 : jumped[-1], 0]) <= np.abs(whole[200 : jumped[-1], 0]) + 1e-9)
    # what it missed meanwhile is a little motion, by which its own friction model is behind
    assert broken[-30:, 0] == pytest.approx(whole[-30:, 0], abs=0.1)
    assert np.abs(broken[:, 1]).max() < 2.0 * np.abs(whole[:, 1]).max() + 3.0


def test_a_single_wild_reading_costs_a_tick():
    loop, q = single(), 0.2 * np.sin(3.0 * T * np.arange(300))
    codes, torque = [], []
    for k in range(300):
        wild = 0.5 if k in (100, 150, 151) else 0.0
        loop.update(q[k : k + 1] + wild, np.zeros(1))
        codes.append(int(loop.codes[0]))
        torque.append(loop.torque[0])
    assert set(np.flatnonzero(codes)) == {100, 150, 151}
    assert np.abs(np.diff(torque[10:])).max() < 0.35  # of two in a row one fades


def test_a_late_tick_is_run_with_the_time_that_passed():
    """One tick of 5 ms and five of 1 ms say the same velocity, viscous friction and, nearly, the same decay."""
    results = []
    for ticks in (1, 5):
        loop, q = single(ramp=0.15), 0.0
        for _ in range(60):
            for _ in range(ticks):
                q += 0.5 * 5 * T / ticks
                status = loop.update(np.array([q]), np.zeros(1), 5 * T / ticks)
                assert status == (Status.OK if ticks == 5 else Status.LATE)
        results.append(loop.torque[0])
    assert results[0] == pytest.approx(results[1], rel=1e-6)
    assert results[0] == pytest.approx(0.9 * (7.0 + 3.0 * 0.5), rel=0.01)


@pytest.mark.parametrize("method", METHODS)
def test_estimates_stay_calm_over_missing_and_uneven_ticks(method):
    """A free mass under a constant force, read at uneven times, with holes: no estimate runs away."""
    rng = np.random.default_rng(1)
    external = ExternalForce(inertia=2.0, method=method, bandwidth=60.0, encoder_count=1e-6)
    loop, t, out = Bench(BareLoop(external=external), interval=T), 0.0, []
    for k in range(1500 if JIT else 100):
        dt = T * rng.choice([1.0, 1.0, 1.0, 0.6, 2.0, 5.0])
        t += dt
        q = 1e-6 * np.round(0.5 * 1.5 * t * t / 1e-6)
        if k % 200 in range(100, 120):
            q = np.nan
        loop.update(np.array([q]), np.zeros(1), dt)
        out.append(loop.external[0])
    if JIT:
        assert np.abs(out).max() < 12.0
        assert np.median(out[800:]) == pytest.approx(3.0, rel=0.1)


def test_the_first_reading_is_where_the_joint_rests():
    """Without `reset` too: a joint that stands at 1.2 rad has not come there in a tick."""
    loop = single()
    for _ in range(50):
        assert loop.update(np.array([1.2]), np.zeros(1)) == Status.OK
        assert loop.torque[0] == 0.0
        assert abs(loop.external[0]) < 1e-9


def test_saturation_says_so():
    loop = single(limit=4.0)
    codes = set()
    for k in range(800):
        codes.add(loop.update(np.array([1e-3 * k]), np.zeros(1)))
        assert abs(loop.torque[0]) <= 4.0
    assert codes == {Status.OK, Status.SATURATED}
    assert loop.torque[0] == 4.0


def test_the_worst_status_is_returned():
    loop = Loop([guarded(alg_fc(RATE, K), limit=1.0, top_speed=TOP)] * 3, interval=T)
    loop.update(np.zeros(3), np.zeros(3))
    assert loop.update(np.array([2e-3, np.nan, 0.0]), np.zeros(3)) == Status.NOT_FINITE
    assert list(loop.codes) == [Status.SATURATED, Status.NOT_FINITE, Status.OK]


@pytest.mark.parametrize("seconds", [1.0])
def test_a_stiff_wrong_sign_only_brakes(seconds):
    """Readings of the wrong sign turn the compensator into more friction: bounded, and it never drives the joint."""
    loop, q, power = single(), 0.2 * np.sin(3.0 * T * np.arange(round(seconds / T))), []
    for k in range(1, q.size):
        loop.update(-q[k : k + 1], np.zeros(1))
        power.append(loop.torque[0] * (q[k] - q[k - 1]))
        assert abs(loop.torque[0]) <= 0.9 * BOUND
    assert np.sum(power) < 0.0
    assert np.max(power) < 1e-3


# --------------------------------------------------------------------------------------------- no allocation, no state


@pytest.mark.skipif(not JIT, reason="plain Python makes an object of every number")
def test_nothing_is_allocated():
    loop = arm()
    rows, u = list(motion(1000)), np.zeros(J)
    bad = np.full(J, np.nan)

    def run():
        for row in rows:
            loop.update(row, u)
        for row in rows[:100]:
            loop.update(row, u, 2e-3)
            loop.update(bad, u)

    run()
    gc.collect()
    gc.disable()
    try:
        before = sys.getallocatedblocks()
        run()
        assert abs(sys.getallocatedblocks() - before) < 20
        tracemalloc.start()
        run()
        first = tracemalloc.get_traced_memory()
        run()
        second = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    finally:
        gc.enable()
    assert second[0] - first[0] < 2000
    assert second[1] - first[0] < 4000  # what one call holds while it runs, not 2000 of them


def torques(loop, q, u):
    """Return the torques along positions while a torque acts."""
    out = np.empty(q.shape)
    for k, row in enumerate(q):
        loop.update(row, np.full(row.size, u))
        out[k] = loop.torque
    return out


def test_reset_forgets_everything():
    loop, q = arm(), motion(120)
    runs = []
    for _ in range(2):
        loop.reset(q[0])
        runs.append(torques(loop, q, 0.5))
        loop.update(np.full(J, np.nan), np.zeros(J))
    assert np.array_equal(*runs)


def test_joints_run_together_as_they_run_alone():
    loop, q = arm(), motion(40)
    alone = []
    for j, (compensator, _) in enumerate(compensators().values()):
        one = Loop(
            guarded(compensator, external=estimators()[j % 5], top_speed=TOP, limit=60.0, rate=1e9),
            interval=T,
        )
        alone.append(torques(one, q[:, j : j + 1], 0.3)[:, 0])
    assert np.array_equal(torques(loop, q, 0.3), np.array(alone).T)


# ------------------------------------------------------------------------------------------------- admittance control


def test_admittance_is_equation_4_6():
    """m q_d'' + b q_d' = tau_e, implicit in b: a constant force gives the exact steady velocity tau_e/b."""
    a = Admittance(inertia=1.0, viscosity=15.0, proportional=0.0, derivative=0.0, limit=1.0)
    row, s = a.row(), a.start(0.3)
    v = 0.0
    for _ in range(1000):
        before = s[0]
        assert admit(row, 0, s, 0, 3.0, 0.3, T) == 0.0
        v = (v + T * 3.0) / (1.0 + 15.0 * T)
        assert s[1] == pytest.approx(v, rel=1e-12)
        assert s[0] - before == pytest.approx(T * v, rel=1e-9)
    assert s[1] == pytest.approx(0.2, rel=1e-5)


def test_admittance_holds_its_limit():
    a = Admittance(inertia=1.0, viscosity=15.0, proportional=1e5, derivative=1e3, limit=50.0)
    row, s = a.row(), a.start(0.0)
    assert admit(row, 0, s, 0, 0.0, 1.0, T) == -50.0
    good = {"inertia": 1.0, "viscosity": 1.0, "proportional": 1.0, "derivative": 1.0, "limit": 1.0}
    for bad in ({"inertia": 0.0}, {"viscosity": -1.0}, {"limit": np.nan}, {"limit": np.inf}, {"limit": 0.0}):
        with pytest.raises(InvalidInput):
            Admittance(**(good | bad))


def test_a_friction_free_loop_gives_nothing():
    loop = Loop(JointLoop(limit=0.0, top_speed=TOP, encoder_count=1e-6), interval=T)
    for k in range(20):
        assert loop.update(np.array([1e-3 * k]), np.zeros(1)) == Status.OK
        assert loop.torque[0] == 0.0
    assert Coulomb(coulomb=0.0).coulomb == 0.0
    assert torque_limit(nothing(), TOP) == 0.0
