"""docs/theory/stability.md by statement: properties on random motions, formulas against eigenvalues, bounds in simulation."""

from dataclasses import replace

import numba as nb
import numpy as np
import pytest

from backdrive.control import BareLoop
from backdrive.control.compensators import Dither
from backdrive.laws import Coulomb, Decaying, HaywardArmstrong, Law, kernels
from backdrive.simulation.closed_loop import play
from backdrive.tuning import members as members_
from backdrive.tuning import rules, scenes
from backdrive.tuning.facts import Facts
from backdrive.tuning.goals import compensator

JIT = not nb.config.DISABLE_JIT
needs_jit = pytest.mark.skipif(not JIT, reason="simulates seconds of motion")
T, K, F = 1e-3, 5e4, 7.0
STEPS = 2000 if JIT else 100


def walk(seed, n=STEPS, size=2e-4):
    """Return increments of a motion that rests, creeps, runs and turns back [rad]."""
    rng = np.random.default_rng(seed)
    scale = size * 10.0 ** rng.uniform(-3.0, 0.0, n // 20 + 1).repeat(20)[:n]
    scale[rng.random(n) < 0.1] = 0.0
    return scale * (
        np.where(rng.random(n // 20 + 1) < 0.5, -1.0, 1.0).repeat(20)[:n] + rng.standard_normal(n)
    )


def along(element, increments, *, start=0.0, coulomb=F, dt=T):
    """Return the torque of a contact along increments, from a torque at the start."""
    law = Law(rate=Coulomb(coulomb=coulomb), element=element)
    p, x = law.row(), law.state()
    x[0] = start
    return np.array(
        [kernels.step(law.rate.KIND, law.element.KIND, p, x, dp, dt, (0.0, 0.0), 20.0) for dp in increments]
    )


# ------------------------------------------------------------------------------------------------------ the contact, D2


@pytest.mark.parametrize("alpha", [0.0, 5.0, 20.0, 500.0])
@pytest.mark.parametrize("seed", range(3))
def test_contraction_whatever_the_start_two_contacts_come_together_at_the_decay_rate(seed, alpha):
    dp = walk(seed)
    one, other = (along(Decaying(stiffness=K, decay_rate=alpha), dp, start=s) for s in (F, -0.6 * F))
    apart = np.abs(np.concatenate([[1.6 * F], one - other]))
    assert np.all(apart[1:] <= apart[:-1] / (1.0 + T * alpha) + 1e-12)


@pytest.mark.parametrize("alpha", [0.0, 5.0, 20.0, 500.0])
@pytest.mark.parametrize("seed", range(3))
def test_passivity_the_contact_stores_no_more_than_it_was_given_less_what_leaks(seed, alpha):
    dp = walk(seed)
    f = along(Decaying(stiffness=K, decay_rate=alpha), dp)
    stored = np.concatenate([[0.0], f**2]) / (2.0 * K)
    assert np.all(np.diff(stored) <= f * dp - T * alpha * f**2 / K + 1e-15)


@pytest.mark.parametrize("dt", [1e-4, 1e-3, 4e-3])
@pytest.mark.parametrize("v", [1e-4, 1e-3, 5e-3, 0.2])
def test_constant_velocity_gives_the_lesser_of_coulomb_torque_and_a_damper_of_any_sampling_time(v, dt):
    f = along(Decaying(stiffness=K, decay_rate=20.0), np.full(round(1.0 / dt), v * dt), dt=dt)
    assert f[-1] == pytest.approx(min(F, K * v / 20.0), rel=1e-6)
    assert (v > rules.threshold_speed(F, K, 20.0)) == (f[-1] > 0.999 * F)


def test_quantisation_one_count_moves_the_torque_by_k_delta():
    element, count = Decaying(stiffness=K, decay_rate=20.0), 1e-6
    assert along(element, [count])[0] == pytest.approx(rules.quantum(K, count, 20.0, T))


# ------------------------------------------------------------------------------------------ contact against friction, D3


def pair_work(dp, real, believed, share):
    """Return the work that a joint with compensation has taken at most and at the end, from rest and relaxed [J]."""
    K_c, F_c = real
    k, f = believed
    friction = along(HaywardArmstrong(stiffness=K_c), dp, coulomb=F_c)
    added = share * along(HaywardArmstrong(stiffness=k), dp, coulomb=f)
    before = np.concatenate([[0.0], (friction - added)[:-1]])
    return np.cumsum(0.5 * (before + friction - added) * dp)  # exact where neither slides within the tick


@pytest.mark.parametrize("seed", range(20 if JIT else 2))
def test_without_decay_friction_and_compensation_are_passive_if_neither_torque_nor_stretch_is_less(seed):
    rng = np.random.default_rng(100 + seed)
    K_c, F_c = 1e5, 7.0
    f = F_c * rng.uniform(0.5, 1.1)
    share = min(1.0, F_c / f) * rng.uniform(0.5, 1.0)
    k = f * K_c / F_c * rng.uniform(0.2, 1.0)  # F/K >= F_c/K_c
    dp = walk(seed, size=4.0 * F_c / K_c).repeat(20) / 20.0
    work = pair_work(dp, (K_c, F_c), (k, f), share)
    assert work.min() >= -1e-3 * F_c**2 / K_c


def test_a_contact_that_yields_before_the_joint_puts_energy_in():
    K_c, F_c = 1e5, 7.0
    amplitude = 0.7 * F_c / K_c  # between the two presliding distances
    dp = np.diff(amplitude * np.sin(2.0 * np.pi * np.arange(4001) / 800.0))
    assert pair_work(dp, (K_c, F_c), (3.0 * K_c, F_c), 0.9)[-1] < -0.5 * 0.9 * F_c * amplitude
    assert pair_work(dp, (K_c, F_c), (0.7 * K_c, F_c), 0.9)[-1] > -1e-6


# ------------------------------------------------------------------------------------------------- stuck and linear, D4


def random_linear(rng):
    M = 10.0 ** rng.uniform(-2, 0.5)
    K_c = M * (10.0 ** rng.uniform(2, 3.5)) ** 2
    return (
        M,
        2.0 * 10.0 ** rng.uniform(-3, 0) * np.sqrt(K_c * M),
        K_c,
        K_c * rng.uniform(0.0, 1.5),
        10.0 ** rng.uniform(0, 3),
    )


def test_routh_s_inequality_tells_what_the_eigenvalues_tell():
    rng = np.random.default_rng(0)
    agreed, stable = 0, 0
    for _ in range(3000):
        numbers = random_linear(rng)
        rightmost = np.roots(rules.presliding(*numbers)).real.max()
        if abs(rightmost) < 1e-6 * abs(np.roots(rules.presliding(*numbers))).max():
            continue  # on the border within rounding
        agreed += (rules.routh(*numbers) > 0.0) == (rightmost < 0.0)
        stable += rightmost < 0.0
    assert agreed > 2950
    assert 300 < stable < 2900


def sampled(delay, *, damping=0.01, decay=100.0, ratio=0.6, period=T):
    M, L, K_t, K_b = 0.3, 0.4, 1.3e5, 4e5
    D_t, D_b = 2 * damping * np.sqrt(K_t * M), 2 * damping * np.sqrt(K_b * L)
    gain = ratio / (1 / K_t + 1 / K_b)
    return rules.spectral_radius(M, L, (K_t, D_t), (K_b, D_b), gain, decay, delay, period)


def test_a_tick_of_delay_stabilises_what_is_unstable_without():
    assert sampled(0.0) > 1.0 > sampled(1e-3)
    assert sampled(8e-3, decay=20.0) > 1.0  # too much of it


def test_sampled_eigenvalues_approach_those_of_the_characteristic_polynomial():
    M, D, K_c, gain, alpha, h = 0.06, 8.0, 1e5, 6e4, 50.0, 2e-6
    rightmost = np.roots(rules.presliding(M, D, K_c, gain, alpha)).real.max()
    radius = rules.spectral_radius(M, 1.0, (K_c, D), (1e12, 1e6), gain, alpha, 0.0, h)
    assert np.log(radius) / h == pytest.approx(rightmost, rel=0.02)


@needs_jit
def test_the_simulated_joint_hums_where_the_sampled_presliding_is_unstable():
    M, L = 0.3, 0.4
    for decay, hums in ((20.0, False), (200.0, True)):
        facts, member = joint(damping=0.01, delay=0.0, count=1e-9)
        member = replace(member, inertia=M + L, motor_share=M / (M + L))
        springs = [(k, 2 * 0.01 * np.sqrt(k * m)) for k, m in ((member.transmission, M), (member.bristle, L))]
        gain = 0.7 * 0.7 * facts.stiffness
        radius = rules.spectral_radius(M, L, springs[0], springs[1], gain, decay, 0.0, T)
        loop = BareLoop(compensator=compensator(facts, {"share": 0.7, "stiffness": 0.7, "decay": decay}))
        swing = scenes.amplitude(play(scenes.knock(facts, member, loop, scenes.FINE)))
        assert (radius > 1.0) == hums
        assert (swing > 1e-6) == hums


# ----------------------------------------------------------------------------------------------------- limit cycles, D5


def joint(*, damping=0.05, delay=T, count=1e-6, friction=1.0):
    facts = Facts(
        name="j",
        unit="rad",
        rate=Coulomb(coulomb=F),
        coulomb=F,
        stiffness=1e5,
        stiffness_interval=(8e4, 1.2e5),
        inertia=0.71,
        inertia_interval=(0.6, 0.8),
        motor_share=0.06 / 0.71,
        count=count,
        top_speed=1.0,
    )
    return facts, replace(members_.nominal(facts), damping=damping, delay=delay, friction=friction)


def knocked(z, dither=None, length=2.5, **changes):
    facts, member = joint(**changes)
    loop = BareLoop(compensator=compensator(facts, z, dither))
    return facts, member, play(scenes.knock(facts, member, loop, scenes.FINE, length))


@needs_jit
@pytest.mark.parametrize("share", [0.5, 0.8, 0.9])
@pytest.mark.parametrize("stiffness", [0.5, 1.0, 1.5, 2.0])
def test_no_limit_cycle_beyond_its_bound_even_with_a_contact_too_stiff(share, stiffness):
    facts, member, record = knocked({"share": share, "stiffness": stiffness, "decay": 20.0}, damping=0.1)
    assert scenes.amplitude(record) <= scenes.bound_of(facts, member, share)
    if stiffness < 0.8:
        assert scenes.amplitude(record) <= 2.0 * facts.count


@needs_jit
def test_with_more_torque_than_friction_takes_a_joint_does_not_stop():
    facts, _, record = knocked({"share": 1.05, "stiffness": 0.5, "decay": 20.0})
    assert scenes.amplitude(record) > 1e3 * facts.count
    assert rules.limit_cycle(F, 1e5, 1.05) == np.inf


@needs_jit
@pytest.mark.parametrize("dither", [0.05, 0.15])
def test_dither_sways_the_motor_by_its_stuck_response(dither):
    z, sine = {"share": 0.7, "stiffness": 0.5, "decay": 20.0}, Dither(share=dither, mode="reset")
    facts, member, record = knocked(z, sine)
    M = 0.06
    damping = 2.0 * member.damping * np.sqrt(member.transmission * M)
    sway = rules.dither_sway(dither * F, 15.0, M, damping, member.stiffness, 0.35e5, 20.0, 1.5e-3)
    assert scenes.amplitude(record) == pytest.approx(sway, rel=0.1, abs=facts.count)
    assert scenes.amplitude(record) <= rules.limit_cycle(F, member.stiffness, 0.7 + dither) + facts.count
    assert dither < rules.sticking_dither(0.7, 0.5e5, 8e4)


def test_a_joint_stops_no_later_than_the_push_says():
    assert rules.stopping_time(0.0, 0.03) == pytest.approx(0.03)
    assert rules.stopping_time(0.9, 0.03) == pytest.approx(0.03 * 1.9 / 0.1)
    assert rules.stopping_time(1.0, 0.03) == np.inf
