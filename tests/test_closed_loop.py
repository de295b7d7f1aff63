"""Joint, hand and loop together: energy, time, delay, encoder, faults; and that it is the loop a real robot would run."""

import numba as nb
import numpy as np
import pytest

from _loops import Bench
from backdrive.control import Admittance, BareLoop
from backdrive.control.compensators import Dither, alg_fc, alg_fc2
from backdrive.control.estimators.external import ExternalForce
from backdrive.control.estimators.friction import alg_fe, between_counts
from backdrive.engine.servo import Servo
from backdrive.errors import InvalidInput
from backdrive.laws import Coulomb, CoulombViscous, Law
from backdrive.simulation import machine
from backdrive.simulation.closed_loop import Scene, play
from backdrive.simulation.hand import Hand, along, minimum_jerk, pushes, sine, still, strokes
from backdrive.simulation.joint import JointSimulation
from backdrive.simulation.kernel import COLUMNS
from backdrive.simulation.machines import joint_0
from backdrive.status import Status

JIT = not nb.config.DISABLE_JIT
T = 1e-3
COARSE = 2e-5 if JIT else 5e-4
SECONDS = 1.5 if JIT else 0.06
HAND = Hand(stiffness=800.0, damping=40.0)
LIMITS = {"off": np.inf, "on": 1e12}  # of the torque [N] and of the time that a joint stands still [s]


def scene(dt=T, seconds=SECONDS, seed=1, **changes):
    """Return Setup A with PD under a hand."""
    plant = machine("setup_a")
    motion = strokes(
        dt, stroke=0.06, duration=0.6, count=max(1, round((seconds - 0.1) / 0.75)), start=0.02, seed=seed
    )
    V_W = between_counts(0.01, plant.encoder_count, dt)
    loop = BareLoop(
        compensator=alg_fc2(plant.law.rate, 1.2e6, V_W, dither=Dither(share=0.5), share=0.9),
        external=ExternalForce(inertia=10.0, friction=alg_fe(plant.law.rate, 1.2e6)),
        top_speed=2.0,
        patience=0.3,
    )
    return Scene(plant=plant, motion=motion, hand=HAND, loop=loop, period=dt, substep=COARSE).replace(
        **changes
    )


def compliant(**changes):
    law = Law(
        rate=CoulombViscous(
            coulomb_positive=4.0, coulomb_negative=3.0, viscous_positive=2.0, viscous_negative=1.5
        )
    )
    joint = JointSimulation(
        name="j",
        law=law,
        motor_inertia=0.3,
        load_inertia=0.7,
        stiffness=2e3,
        damping=1.0,
        friction_side="load",
    )
    return joint.replace(**changes)


# ------------------------------------------------------------------------------------------------------------ physics


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_joint_left_alone_loses_what_friction_takes(sign):
    """Pushed, let go, and coasting: kinetic and elastic energy fall by friction and transmission damping alone."""
    plant, n = compliant(), round((2.0 if JIT else 0.3) / T)
    push = np.zeros(n)
    push[: n // 5] = 20.0 * sign
    r = play(Scene(plant=plant, motion=pushes(push), substep=COARSE))
    twist = r.motor - r.load
    energy = 0.5 * (0.3 * r.motor_velocity**2 + 0.7 * r.load_velocity**2 + 2e3 * twist**2)
    v = r.load_velocity
    coulomb, viscous = (4.0, 2.0) if sign > 0 else (3.0, 1.5)
    power = coulomb * np.abs(v) + viscous * v**2 + 1.0 * (r.motor_velocity - v) ** 2
    lost = T * np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]))])
    after = slice(n // 5 + 1, None)
    balance = energy[after] + lost[after]
    assert np.abs(r.force[after]).max() == 0.0
    assert np.abs(r.command).max() == 0.0
    assert np.ptp(balance) < 0.01 * energy[after][0]
    if JIT:
        assert energy[-1] < 0.02 * energy[after][0]  # it came to rest


def test_a_rigid_joint_coasts_as_far_as_its_energy_lasts():
    plant = JointSimulation(name="j", law=Law(rate=Coulomb(coulomb=5.0)), motor_inertia=2.0)
    push = np.zeros(800)
    push[:200] = 15.0
    r = play(Scene(plant=plant, motion=pushes(push), substep=1e-4))
    stop = np.flatnonzero(r.motor_velocity[200:] == 0.0)
    assert stop.size
    # the push ends between two ticks, over the last of which it falls to zero
    v, x = r.motor_velocity[201], r.motor[201]
    assert r.motor[-1] - x == pytest.approx(2.0 * v**2 / (2.0 * 5.0), rel=0.01)
    assert np.ptp(r.motor[-50:]) == 0.0


def test_halving_the_step_changes_little():
    results = [play(scene(substep=h)) for h in (COARSE, COARSE / 2.0)]
    for name, size in (("motor", 0.06), ("force", 15.0)):
        a, b = (getattr(r, name) for r in results)
        assert np.sqrt(np.mean((a - b) ** 2)) < 0.02 * size


@pytest.mark.parametrize("ticks", [0, 1, 2, 5])
def test_a_delay_shifts_the_torque_by_whole_ticks(ticks):
    plant = JointSimulation(name="j", law=Law(rate=Coulomb(coulomb=0.0)), motor_inertia=1.0)
    target = np.zeros((40, 2))
    target[10:, 0] = 1e-3
    servo = Servo(proportional=100.0, derivative=0.0)
    r = play(
        Scene(plant=plant, motion=still(40), target=target, controller=servo, delay=ticks * T, substep=1e-4)
    )
    assert np.flatnonzero(r.command)[0] == 10
    assert np.flatnonzero(r.motor_velocity)[0] == 11 + ticks
    assert r.motor_velocity[11 + ticks] == pytest.approx(0.1 * T, rel=1e-6)


def test_the_encoder_counts():
    r = play(scene())
    assert r.reading / 5e-6 == pytest.approx(np.round(r.reading / 5e-6), abs=1e-6)
    assert np.abs(r.reading - r.motor).max() <= 5e-6 * (1.0 + 1e-9)
    noisy = play(scene(encoder_noise=1e-5))
    assert np.std(noisy.reading - noisy.motor) > 0.5e-5


def test_gravity_is_held_where_it_is_asked_for():
    plant = JointSimulation(name="j", law=Law(rate=Coulomb(coulomb=1.0)), motor_inertia=1.0, gravity_cos=30.0)
    for held in (True, False):
        r = play(Scene(plant=plant, motion=still(100), gravity_compensated=held, substep=1e-4))
        assert (np.abs(r.motor).max() < 1e-6) == held


@pytest.mark.skipif(not JIT, reason="long scenes")
def test_the_sampling_rate_does_not_change_what_happens():
    """0.25 to 8 kHz: the same hand meets the same joint with the same compensator (P on Joint 0, K_c = 2 K)."""
    plant, results = joint_0(compliant=True), {}
    hand = Hand(stiffness=120.0, damping=6.0)
    for rate in (250.0, 1000.0, 2000.0, 8000.0):
        dt = 1.0 / rate
        motion = sine(dt, amplitude=0.25, frequency=0.5, cycles=1)
        loop = BareLoop(compensator=alg_fc(plant.law.rate, 5e4, share=0.9))
        r = play(Scene(plant=plant, motion=motion, hand=hand, loop=loop, period=dt))
        results[rate] = np.sqrt(np.mean(r.force**2)), np.abs(r.force).max(), np.ptp(r.load)
    bare = play(Scene(plant=plant, motion=sine(T, amplitude=0.25, frequency=0.5, cycles=1), hand=hand))
    for rate, values in results.items():
        assert values == pytest.approx(results[1000.0], rel=0.12), (rate, results)
        assert values[0] < 0.8 * np.sqrt(np.mean(bare.force**2))


@pytest.mark.skipif(not JIT, reason="long scenes")
@pytest.mark.parametrize("alpha", [0.0, 20.0])
@pytest.mark.parametrize("R", [0.6, 0.9])
def test_what_is_let_go_moves_on_by_no_more_than_the_bound(alpha, R):
    """K = K_c/2, one tick of delay: half-amplitude at most r_c/(1 - R) with r_c = F_c/K_c; in fact it comes to rest."""
    plant = joint_0(compliant=True)
    rate, stretch = Coulomb(coulomb=6.85), 6.85 / plant.stiffness
    plant = plant.replace(law=Law(rate=rate))
    push = np.zeros(3000)
    push[100:130] = 9.0
    loop = BareLoop(compensator=alg_fc(rate, 0.5 * plant.stiffness, alpha, share=R))
    r = play(Scene(plant=plant, motion=pushes(push), loop=loop, delay=T, substep=COARSE))
    assert np.ptp(r.load) > 1e-3
    rest = slice(-500, None)
    assert 0.5 * np.ptp(r.motor[rest]) <= stretch / (1.0 - R)
    assert 0.5 * np.ptp(r.load[rest]) <= 0.02 * stretch


# --------------------------------------------------------------------------------------------------- the same numbers


def same(a, b):
    names = ("reading", "command", "compensation", "estimate", "force", "sensed", "motor", "load", "status")
    return all(np.array_equal(getattr(a, n), getattr(b, n), equal_nan=True) for n in names)


def test_the_same_seed_gives_the_same_numbers_on_any_number_of_threads():
    scenes = [scene(seed=s, encoder_noise=1e-6).replace(seed=s) for s in range(4)]
    alone, two, again = (play(scenes, workers=w) for w in (1, 2, 3))
    for a, b, c in zip(alone, two, again, strict=True):
        assert same(a, b)
        assert same(a, c)
    assert not same(alone[0], alone[1])
    assert same(play(scenes[2]), alone[2])


def test_one_kernel_for_each_kind_of_law_gives_the_same_numbers():
    first = scene()
    other = machine("setup_a")
    rate = CoulombViscous(
        coulomb_positive=12.0, coulomb_negative=8.0, viscous_positive=20.0, viscous_negative=30.0
    )
    other = other.replace(law=Law(rate=rate, element=other.law.element))
    scenes = [
        first,
        first.replace(plant=other),
        first.replace(loop=None),
        first.replace(plant=other, loop=None),
    ]
    each, together = play(scenes), play(scenes, one_kernel=True)
    assert all(same(a, b) for a, b in zip(each, together, strict=True))
    assert not same(each[0], each[1])


def test_without_limits_the_loop_gives_what_an_endless_limit_gives():
    """Guards that are off are not compiled; with one that is on, though out of reach, all of them are."""
    s = scene()
    n = len(s.motion.position)
    readings, missed = np.zeros(n), np.arange(n) % 7 == 3
    readings[n // 3 : n // 3 + 5] = np.nan
    readings[n // 2] = np.inf
    fault = faulty(n, readings, missed)
    ways = {
        name: s.loop.replace(top_speed=np.inf, patience=np.inf, limit=limit, hold=limit)
        for name, limit in LIMITS.items()
    }
    off, on = (play(s.replace(loop=loop, fault=fault)) for loop in ways.values())
    assert {Status.OK, Status.NOT_FINITE, Status.LATE} <= set(off.status.tolist())
    for name in COLUMNS:
        assert np.array_equal(getattr(off, name), getattr(on, name), equal_nan=True), name


def test_a_kernel_for_other_scenes_too_gives_the_same_numbers():
    first = scene()
    bare = first.replace(loop=BareLoop(compensator=alg_fc(first.plant.law.rate, 1.2e6)))
    assert same(play(bare), play(bare, like=[first, first.replace(loop=None)]))
    dithered = bare.replace(loop=BareLoop(compensator=alg_fc(first.plant.law.rate, 1.2e6, dither=Dither())))
    adaptive = first.loop.replace(
        compensator=alg_fc(first.plant.law.rate, 1.2e6, dither=Dither(mode="adaptive")), hold=0.5
    )
    mass = Admittance(inertia=2.0, viscosity=15.0, proportional=1e5, derivative=1e3, limit=200.0)
    assert same(play(dithered), play(dithered, like=[first.replace(loop=adaptive, controller=mass)]))


def test_the_loop_is_the_one_that_a_robot_would_run():
    """`Loop`, fed with what the robot has seen, gives the torque and the estimate of the simulation, bit for bit."""
    r = play(scene())
    loop = Bench(r.scene.loop, interval=T)
    loop.reset(r.reading[:1])
    applied = np.concatenate([[0.0], r.command[:-1]])
    for k in range(r.time.size):
        assert loop.update(r.reading[k : k + 1], applied[k : k + 1]) == r.status[k]
        assert loop.torque[0] == r.compensation[k]
        assert loop.external[0] == r.estimate[k]
        assert loop.friction[0] == r.friction[k]


def test_a_record_is_a_log_of_a_robot_with_a_force_sensor():
    r = play(scene(hand=Hand(stiffness=800.0, damping=40.0, noise=0.1)))
    log = r.log()
    assert np.array_equal(log.position[:, 0], r.reading)
    assert np.array_equal(log.torque[:, 0], r.command)
    assert np.array_equal(log.external_torque[:, 0], r.sensed)
    assert np.std(r.sensed - r.force) == pytest.approx(0.1, rel=0.3)


def test_admittance_follows_its_virtual_mass():
    plant = machine("setup_a")
    estimator = ExternalForce(inertia=10.0, friction=alg_fe(plant.law.rate, 1.2e6))
    admittance = Admittance(inertia=2.0, viscosity=15.0, proportional=1e5, derivative=1e3, limit=200.0)
    r = play(
        Scene(
            plant=plant,
            motion=strokes(T, stroke=0.06, duration=0.7, count=2, start=0.02),
            hand=HAND,
            loop=BareLoop(external=estimator),
            controller=admittance,
            substep=COARSE,
        )
    )
    assert np.isfinite(r.motor).all()
    if JIT:
        assert np.abs(r.wanted - r.motor).max() < 5e-3
        assert np.ptp(r.motor) > 0.03
        assert np.abs(r.force).max() < 25.0


# ---------------------------------------------------------------------------------------------------------------- faults


def faulty(n, readings=None, missed=None):
    fault = np.zeros((n, 2))
    if readings is not None:
        fault[:, 0] = readings
    if missed is not None:
        fault[:, 1] = missed
    return fault


def bound(record):
    """Return what the friction law of the compensator gives at most, with its share and dither."""
    compensator = record.scene.loop.compensator
    law, top = compensator.friction.law, record.scene.loop.top_speed
    largest = max(abs(float(law.torque(v))) for v in (top, -top))
    return compensator.share * largest + (
        compensator.dither.share * max(law.coulomb()) if compensator.dither else 0.0
    )


def test_missing_readings_let_the_torque_fade_and_the_joint_stays_a_joint():
    s = scene()
    n = len(s.motion.position)
    at = slice(n // 3, n // 3 + n // 10)
    readings = np.zeros(n)
    readings[at] = np.nan
    r = play(s.replace(fault=faulty(n, readings)))
    assert np.all(r.status[at] == Status.NOT_FINITE)
    assert np.all(r.status[at.stop :] == Status.OK)
    for name in ("command", "compensation", "estimate", "motor", "load", "force"):
        assert np.isfinite(getattr(r, name)).all()
    held = np.abs(r.compensation[at])
    # one bad reading is bridged, then it fades
    assert held == pytest.approx(held[0] * 1.05 ** -np.arange(held.size), rel=1e-9)
    assert np.abs(r.compensation).max() <= bound(r)


def test_a_new_zero_leaves_the_joint_at_peace():
    s = scene(seconds=2.4 if JIT else 0.06)
    n = len(s.motion.position)
    readings = np.where(np.arange(n) < n // 2, 0.0, 0.3)
    r, whole = play(s.replace(fault=faulty(n, readings))), play(s)
    jumped = np.flatnonzero(r.status == Status.JUMP)
    assert jumped[0] == n // 2
    if JIT:
        assert jumped.size * T == pytest.approx(0.15, abs=3 * T)  # half the patience
        assert np.all(r.status[jumped[-1] + 1 :] == Status.OK)
        assert np.abs(r.force).max() < 1.6 * np.abs(whole.force).max()
    assert np.abs(r.compensation).max() <= bound(r)


def test_a_missed_tick_holds_the_command_and_the_next_runs_with_the_time_that_passed():
    s = scene()
    n = len(s.motion.position)
    missed = np.arange(n) % 5 != 0
    r, five, whole = play(s.replace(fault=faulty(n, missed=missed))), play(scene(dt=5 * T)), play(s)
    held = np.flatnonzero(missed[1:]) + 1
    assert np.all(r.command[held] == r.command[held - 1])
    assert set(r.status[~missed]) <= {Status.OK, Status.LATE}
    assert np.abs(r.compensation).max() <= bound(r)
    if JIT:
        force = [np.sqrt(np.mean(x.force**2)) for x in (r, five, whole)]
        assert force[0] == pytest.approx(force[2], rel=0.35)


def test_too_much_compensation_stays_within_its_own_bound():
    s = scene()
    compensator = s.loop.compensator.replace(share=1.3, dither=None)
    r = play(s.replace(loop=BareLoop(compensator=compensator, top_speed=0.6)))
    assert np.abs(r.compensation).max() <= bound(r) * (1.0 + 1e-9)
    assert np.isfinite(r.motor).all()


def test_a_saturated_drive_is_told_apart_from_a_hand():
    """The estimator takes what was applied, not what was asked for: no phantom force where the drive is at its limit."""
    plant = machine("setup_a").replace(torque_limit=15.0)
    target = np.zeros((round(0.6 / T) if JIT else 40, 2))
    target[5:, 0] = 0.05
    estimator = ExternalForce(
        inertia=10.0, friction=alg_fe(plant.law.rate, 1.2e6), method="disturbance", bandwidth=60.0
    )
    r = play(
        Scene(
            plant=plant,
            motion=still(len(target)),
            target=target,
            controller=Servo(proportional=5e3, derivative=300.0),
            loop=BareLoop(external=estimator),
            substep=COARSE,
        )
    )
    assert np.abs(r.command).max() == 15.0
    if JIT:
        moving = np.abs(r.load_velocity) > 0.02
        assert np.abs(r.estimate[moving][50:]).mean() < 2.0


# ----------------------------------------------------------------------------------------------------------------- hand


def test_strokes_are_minimum_jerk_between_marks():
    motion = strokes(T, stroke=0.1, duration=0.5, count=4, variation=0.0, start=0.1)
    assert motion.marks == pytest.approx((0.1, 0.85, 1.6, 2.35))
    assert motion.position.max() == pytest.approx(0.1)
    assert np.gradient(motion.position, T) == pytest.approx(motion.velocity, abs=2e-3)
    assert np.abs(motion.velocity).max() == pytest.approx(1.875 * 0.1 / 0.5, rel=1e-3)
    share, rate = minimum_jerk(np.array([-1.0, 0.0, 0.5, 1.0, 2.0]))
    assert share == pytest.approx([0.0, 0.0, 0.5, 1.0, 1.0])
    assert rate == pytest.approx([0.0, 0.0, 1.875, 0.0, 0.0])


def test_people_vary_and_seeds_repeat():
    a, b, c = (strokes(T, stroke=0.1, duration=0.6, count=10, seed=s) for s in (0, 0, 1))
    assert np.array_equal(a.position, b.position)
    assert not np.array_equal(a.position, c.position)
    assert np.diff(a.marks).min() > 0.5


def test_a_hand_lets_go_and_pushes():
    motion = along(np.linspace(0.0, 1.0, 100), np.full(100, 10.0))
    gone = motion.release(0.05, T)
    assert gone.grip[49:51].tolist() == [1.0, 0.0]
    assert np.array_equal(pushes(np.ones(5), 0.2).push, np.ones(5))
    assert still(3, 0.4).grip.tolist() == [0.0] * 3
    r = play(scene(motion=motion.release(0.05, T), loop=None))
    assert np.all(r.force[50:] == 0.0)
    wave = sine(T, amplitude=0.2, frequency=0.5, cycles=2)
    assert np.ptp(wave.position) == pytest.approx(0.4, rel=1e-5)
    assert np.gradient(wave.position, T)[1:-1] == pytest.approx(wave.velocity[1:-1], abs=1e-4)


def test_bad_scenes_are_refused():
    good = scene()
    n = len(good.motion.position)
    for bad in (
        {"period": 0.0},
        {"substep": 1.0},
        {"delay": -T},
        {"target": np.zeros((n - 1, 2))},
        {"fault": np.zeros((n, 3))},
        {
            "loop": None,
            "controller": Admittance(inertia=1.0, viscosity=1.0, proportional=1.0, derivative=1.0, limit=1.0),
        },
    ):
        with pytest.raises(InvalidInput):
            good.replace(**bad)
    for bad in ({"stiffness": -1.0}, {"noise": np.nan}):
        with pytest.raises(InvalidInput):
            Hand(**({"stiffness": 1.0, "damping": 1.0} | bad))
    with pytest.raises(InvalidInput):
        strokes(T, stroke=0.1, duration=0.9)
