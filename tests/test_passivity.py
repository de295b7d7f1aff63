"""docs/theory/stability.md, section 2, with decay: each step of the argument, the bound, and where it ends."""

import numba as nb
import numpy as np
import pytest

from backdrive.control.estimators import friction as friction_
from backdrive.control.estimators.friction import FrictionEstimator
from backdrive.laws import CoulombViscous, Decaying, Law
from backdrive.tuning import rules

JIT = not nb.config.DISABLE_JIT
SEEDS = range(12 if JIT else 2)
PIECES = 10  # straight pieces of a motion in a tick


def estimator(F, K, alpha, *, back=None, fast=None):
    law = Law(
        rate=CoulombViscous(coulomb_positive=F, coulomb_negative=F if back is None else back),
        element=Decaying(stiffness=K, decay_rate=alpha),
    )
    if fast is None:
        return FrictionEstimator(law=law)
    return FrictionEstimator(law=law, fast_decay=fast, switch_rate=50.0, threshold=5.0)


def run(made, dp, T):
    """Return the torque after each reading, and the decay rate of each tick."""
    c, p, x, s = made.row(), made.law.row(), made.law.state(), np.zeros(1)
    f, alpha = np.zeros(dp.size), np.zeros(dp.size)
    for k in range(dp.size):
        f[k] = friction_.tick(c, 0, p, x, s, 0, dp[k], T, (0.0, 0.0), 20.0)
        alpha[k] = p[-1]
    return f, alpha


def play(u, lo, hi):
    """Return what is left of a path that may stay behind by hi or ahead by -lo: the play, from 0."""
    s, before = np.zeros(u.size), 0.0
    for k in range(u.size):
        before = min(max(before, u[k] - hi), u[k] - lo)
        s[k] = before
    return s


def length(path, before=0.0):
    return np.abs(np.diff(path, prepend=before)).sum()


def motion(seed, n=600, size=1.0):
    """Return increments in PIECES a tick: walks, strokes and rests, from far below to far above a stretch of 1."""
    rng = np.random.default_rng(seed)
    parts, total = [], 0
    while total < n * PIECES:
        k = int(rng.integers(1, 8 * PIECES))
        scale = size * 10.0 ** rng.uniform(-2.0, 1.0)
        parts.append(np.full(k, scale * rng.standard_normal() / k) if rng.random() < 0.8 else np.zeros(k))
        total += k
    return np.concatenate(parts)[: n * PIECES].reshape(n, PIECES)


def energy(made, pieces, T, share, friction, delay=1, shape=play):
    """Return what a compensator, held for `delay` ticks, and an elastic friction (K_c, F_c, that backwards) gave by each tick.

    And the friction's slid path forwards and backwards, and the decay rates.
    """
    K_c, F_c, F_b = friction
    p = np.cumsum(pieces.ravel())
    slid = shape(p, -F_b / K_c, F_c / K_c)
    f_c = K_c * (p - slid)
    ds = np.diff(slid, prepend=0.0)
    taken = np.cumsum(np.where(ds > 0, F_c * ds, -F_b * ds)) + f_c**2 / (2.0 * K_c)
    dp = pieces.sum(axis=1)
    f, alpha = run(made, dp, T)
    held = np.concatenate([np.zeros(delay), f])[: f.size]
    ahead = np.cumsum(np.maximum(ds, 0.0))[PIECES - 1 :: PIECES]
    astern = np.cumsum(np.maximum(-ds, 0.0))[PIECES - 1 :: PIECES]
    return share * np.cumsum(held * dp) - taken[PIECES - 1 :: PIECES], ahead, astern, alpha


def bound(F, K, share, alpha, T):
    return share * F**2 / (2.0 * K) + 2.0 * share * F**2 / K * np.cumsum(alpha) * T


def drawn(seed):
    """Return R, K, F of a compensator that is claimed against K_c = F_c = 1, a decay rate and a sampling time."""
    rng = np.random.default_rng(seed)
    F = rng.uniform(0.3, 1.5)
    share = min(1.0, rng.uniform(0.5, 1.0) / F)
    return share, F * rng.uniform(0.2, 1.0), F, 10.0 ** rng.uniform(0.0, 3.0), 10.0 ** rng.uniform(-5.0, -2.0)


# ----------------------------------------------------------------------------------------------------------- the three steps


@pytest.mark.parametrize("seed", SEEDS)
def test_balance_of_a_tick_whose_torque_is_held(seed):
    _, K, F, alpha, T = drawn(seed)
    dp = motion(seed).sum(axis=1)
    f, _ = run(estimator(F, K, alpha), dp, T)
    before = np.concatenate([[0.0], f[:-1]])
    ds = dp - (f - before) / K - T * alpha * f / K
    np.testing.assert_allclose(f * ds, F * np.abs(ds), atol=1e-12)  # slides at its bound alone
    stored = (f**2 - before**2) / (2.0 * K)
    assert np.all(before * dp <= stored + F * np.abs(ds) + T * alpha * F**2 / K + 1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_shortest_path_is_the_slider_s(seed):
    rng = np.random.default_rng(seed)
    u = np.cumsum(motion(seed, n=60).ravel())
    s = play(u, -1.0, 1.0)
    for _ in range(20):
        g = np.clip(
            s + rng.uniform(0.1, 2.0) * np.cumsum(rng.standard_normal(u.size)) / 10.0, u - 1.0, u + 1.0
        )
        assert length(s) <= length(g) + 1e-12
    for narrower in (0.0, 0.3, 0.9):
        assert length(s) <= length(play(u, -narrower, narrower)) + 1e-12


@pytest.mark.parametrize("seed", SEEDS)
def test_slip_is_that_of_the_friction_and_what_leaked_at_most(seed):
    _, K, F, alpha, T = drawn(seed)
    pieces = motion(seed)
    p, dp = np.cumsum(pieces.ravel()), pieces.sum(axis=1)
    f, _ = run(estimator(F, K, alpha), dp, T)
    ds = dp - np.diff(f, prepend=0.0) / K - T * alpha * f / K
    assert np.abs(ds).sum() <= length(play(p, -1.0, 1.0)) + T * alpha * np.abs(f / K).sum() + 1e-9


# ----------------------------------------------------------------------------------------------------------------- the bound


@pytest.mark.parametrize("seed", SEEDS)
def test_bound_holds_whatever_the_motion_and_the_sampling_time(seed):
    share, K, F, alpha, T = drawn(seed)
    made = estimator(F, K, alpha)
    E, ahead, astern, rates = energy(made, motion(seed), T, share, (1.0, 1.0, 1.0))
    assert np.all(bound(F, K, share, rates, T) - (1.0 - share * F) * (ahead + astern) + 1e-9 >= E)


def test_creep_keeps_up_no_speed_at_which_sliding_takes_more_than_leaks():
    F, K, alpha, share = 7.0, 5e4, 20.0, 0.8
    v = rules.creep_speed(F, K, alpha, share)
    leak = bound(F, K, share, np.full(2, alpha), 1.0)
    assert (1.0 - share) * F * v == pytest.approx(leak[1] - leak[0])
    assert v == pytest.approx(0.0224, rel=1e-3)
    assert rules.creep_speed(F, K, alpha, 1.0) == np.inf


@pytest.mark.parametrize("seed", SEEDS)
def test_bound_holds_for_a_rate_that_switches(seed):
    share, K, F, alpha, T = drawn(seed)
    made = estimator(F, K, alpha, fast=25.0 * alpha)
    E, ahead, astern, rates = energy(made, motion(seed, size=20.0 * T), T, share, (1.0, 1.0, 1.0))
    assert rates.max() > rates.min()
    assert np.all(bound(F, K, share, rates, T) - (1.0 - share * F) * (ahead + astern) + 1e-9 >= E)


@pytest.mark.parametrize("seed", SEEDS)
def test_bound_holds_for_unequal_directions(seed):
    share, K, F, alpha, T = drawn(seed)
    back = np.random.default_rng(seed).uniform(0.3, 1.0)
    made = estimator(F, K, alpha, back=back * F)
    E, ahead, astern, rates = energy(made, motion(seed), T, share, (1.0, 1.0, back))
    taken = (1.0 - share * F) * (ahead + back * astern)
    assert np.all(bound(F, K, share, rates, T) - taken + 1e-9 >= E)


def test_bound_holds_for_several_joints_as_a_sum():
    T, total, limit = 1e-3, 0.0, 0.0
    for seed in range(3):
        share, K, F, alpha, _ = drawn(seed)
        E, ahead, astern, rates = energy(estimator(F, K, alpha), motion(seed), T, share, (1.0, 1.0, 1.0))
        total += E
        limit += bound(F, K, share, rates, T) - (1.0 - share * F) * (ahead + astern)
    assert np.all(total <= limit + 1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_bound_holds_for_friction_behind_the_transmission(seed):
    """The load q follows the encoder p by a stretch of its own; its friction is rigid, F_c = 1."""
    share, K, F, alpha, T = drawn(seed)
    pieces = motion(seed)
    p = np.cumsum(pieces.ravel())
    stretch = (
        2.0 * F / K * np.sin(np.linspace(0.0, 40.0, p.size)) * np.random.default_rng(seed).uniform(0.1, 1.0)
    )
    q = p - stretch
    f, rates = run(estimator(F, K, alpha), pieces.sum(axis=1), T)
    held = np.concatenate([[0.0], f[:-1]])
    ticks = slice(PIECES - 1, None, PIECES)
    slid = np.cumsum(np.abs(np.diff(q, prepend=0.0)))[ticks]
    E = share * np.cumsum(held * pieces.sum(axis=1)) - slid
    beyond = np.cumsum(np.abs(np.diff(play(stretch, -F / K, F / K), prepend=0.0)))[ticks]
    assert (beyond[-1] == 0.0) == (np.abs(stretch).max() <= F / K)
    limit = bound(F, K, share, rates, T) + share * F * beyond - (1.0 - share * F) * slid
    assert np.all(limit + 1e-9 >= E)


# --------------------------------------------------------------------------------------------------------------- where it ends


def strokes(amplitude, ticks, n=400):
    """Return increments of a triangle of an amplitude with so many ticks from end to end."""
    way = np.where(np.arange(n) // ticks % 2 == 0, 1.0, -1.0) * 2.0 * amplitude / ticks
    way[:ticks] *= 0.5
    return np.repeat(way[:, None] / PIECES, PIECES, axis=1)


@pytest.mark.parametrize(
    ("share", "K", "F", "amplitude"),
    [(0.9, 1.5, 1.0, 0.95), (1.0, 1.0, 1.25, 20.0)],
    ids=["it yields before the friction", "it gives more than the friction"],
)
def test_conditions_are_needed(share, K, F, amplitude):
    T = 1e-4
    E, *_, rates = energy(estimator(F, K, 5.0), strokes(amplitude, 40), T, share, (1.0, 1.0, 1.0))
    assert E.max() > 1.5 * bound(F, K, share, rates, T)[-1]


@pytest.mark.parametrize("K", [0.3, 1.0])
def test_two_ticks_gain_without_end_on_strokes_of_one(K):
    T, made, gained = 1e-3, estimator(1.0, K, 0.0), {}
    for delay in (1, 2):
        E, *_ = energy(made, strokes(0.9, 1, n=1200), T, 0.9, (1.0, 1.0, 1.0), delay=delay)
        gained[delay] = E[599], E[-1]
    assert gained[1][1] < 0.0
    assert gained[2][1] > 1.9 * gained[2][0] > 100.0 * bound(1.0, K, 0.9, np.zeros(1), T)[0]
