"""A delay that the loss of the fit supports: kept where it is least, moved where it is not, and no better known than it rises."""

import sys

import numpy as np
import pytest

from backdrive import Joint, Log
from backdrive.identification import curves, design
from backdrive.identification.delay_bins import DelayStretch
from backdrive.identification.delay_profile import _losses, refine_delay
from backdrive.identification.motion import identify_motion
from backdrive.identification.signals import Signals
from backdrive.identification.whitening import WHITE

RATE, LATE, NOISE = 500.0, 0.003, 0.5
T = np.arange(10_000) / RATE
KNOTS = 3.0 * np.array(curves.SHARES)
GIVEN = {"dynamic": True, "gravity": False, "model_torque": False, "both_directions": True}
LINE = design.candidates(KNOTS, {"line": KNOTS[[0, 10]]}, symmetric=True, **GIVEN)[0]
WAVES = ((0.8, 1.3, 0.2), (0.3, 4.1, 1.0), (0.05, 17.0, 2.0))


def motion(t: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return position, velocity, acceleration and jerk of three waves, (n,) each."""
    shapes = (np.sin, np.cos, lambda x: -np.sin(x), lambda x: -np.cos(x))
    return tuple(sum(a * w**k * f(w * t + p) for a, w, p in WAVES) for k, f in enumerate(shapes))


def stretches(seed: int, inertia: float = 0.3) -> list[DelayStretch]:
    q, v, a, jerk = motion(T)
    _, late_v, late_a, _ = motion(T - LATE)
    torque = inertia * late_a + np.sign(late_v) + 0.4 * late_v
    torque += NOISE * np.random.default_rng(seed).standard_normal(T.size)
    s = Signals(
        time=T, position=q, velocity=v, acceleration=a, jerk=jerk, torque=torque, rate=RATE, model_torque=None,
        moving=np.ones(T.size, dtype=bool), sliding=np.abs(v) > 0.2,
    )  # fmt: skip
    return [DelayStretch(s, 0.02)]


def spread(inertia: float = 0.3) -> float:
    """Return the standard error of the delay under white noise, by the columns of its own model [s]."""
    _, v, a, jerk = motion(T)
    slides = np.abs(v) > 0.2
    X = np.column_stack([a, np.ones_like(v), np.sign(v), v, inertia * jerk])[slides]
    return NOISE * float(np.sqrt(np.linalg.inv(X.T @ X)[-1, -1]))


@pytest.mark.parametrize("seed", range(4))
def test_a_delay_at_a_wrong_root_is_moved_to_the_minimum(seed):
    delay, error = refine_delay(stretches(seed), KNOTS, LINE, LATE + 0.0015, 2.0 * spread(), WHITE)
    assert abs(delay - LATE) < 4.0 * spread()
    assert error == 2.0 * spread()


@pytest.mark.parametrize("away", [5.0, 8.0, 12.0, 20.0, 33.0])
def test_a_delay_many_errors_away_ends_within_one_of_them(monkeypatch, away):
    def losses(stretches, knots, candidate, delays, colour):
        return 0.82 * (delays - away) ** 2

    monkeypatch.setattr("backdrive.identification.delay_profile._losses", losses)
    delay, error = refine_delay([], KNOTS, LINE, 0.0, 1.0, WHITE)
    assert abs(delay - away) <= 1.0 and error == pytest.approx(1.0)


def test_an_error_that_is_too_small_is_enlarged_to_that_of_the_noise():
    errors = [refine_delay(stretches(seed), KNOTS, LINE, LATE, 0.3 * spread(), WHITE)[1] for seed in range(8)]
    assert np.median(errors) == pytest.approx(spread(), rel=0.3)


def test_a_delay_without_inertia_is_not_supported():
    delay, error = refine_delay(stretches(0, inertia=0.0), KNOTS, LINE, 0.01, 1e-4, WHITE)
    assert error > 20e-4 or abs(delay - LATE) < 3.0 * error


def test_without_noise_a_delay_is_not_supported():
    alike = _losses(stretches(0), KNOTS, LINE, np.full(3, LATE), WHITE)
    assert alike.min() > 100.0 and alike == pytest.approx(alike[0], rel=1e-6)  # many bins, each by its noise
    silent = [each.with_sliding(np.zeros(T.size, dtype=bool)) for each in stretches(0)]
    assert refine_delay(silent, KNOTS, LINE, LATE, 1e-4, WHITE) == (LATE, np.inf)


def test_a_loss_that_changes_by_rounding_moves_no_delay():
    """The acceleration's error of each delay is another one, and its product with the noise makes minima that mean nothing."""
    away = LATE + 0.0015, 2.0 * spread()
    fine, coarse = (
        refine_delay(stretches(0), KNOTS, LINE, *away, WHITE, false=(size, 0.0, 0.0, 0.0))
        for size in (1e-6, 1.0)
    )
    assert abs(fine[0] - LATE) < 4.0 * spread()
    assert coarse == away


def test_delays_hold_under_slow_noise_and_rounding(monkeypatch):
    """At 1 kHz, with 20 bits a turn, delays were moved to such minima: up to five stated errors away."""
    rate, late = 1000.0, 0.004
    t = np.arange(round(20.0 * rate)) / rate
    monkeypatch.setattr(sys.modules[__name__], "WAVES", (*WAVES[:2], (0.05, 9.0, 2.0)))
    q, *_ = motion(t)
    _, v, a, _ = motion(t - late)
    count, off = 2.0 * np.pi / 2**20, []
    for seed in range(10):
        rng, wander = np.random.default_rng(seed), np.zeros(t.size)
        white = 0.06 * np.sqrt(1.0 - 0.98**2) * rng.standard_normal(t.size)
        for k in range(1, t.size):
            wander[k] = 0.98 * wander[k - 1] + white[k]
        log = Log(
            time=t,
            joints=(Joint(name="j", unit="rad"),),
            position=count * np.round(q / count),
            torque=0.15 * a + np.sign(v) + 0.4 * v + wander,
        )
        slip = identify_motion([log], "j", law="coulomb-viscous", gravity=False)[0].dynamics["time_slip"]
        off.append((slip.value - late) / slip.standard_error)
    assert np.sqrt(np.mean(np.square(off))) < 1.8


@pytest.mark.parametrize("late", [0.002, 0.005, 0.008])
def test_a_jump_between_two_samples_does_not_tell_where(late):
    """Where jumps alone told the delay, it ended at half a sample, with an error of a twentieth."""
    rate, fine = 100.0, 1e-4
    t = np.arange(0.0, 20.0, fine)
    rise = np.clip(np.minimum(t - 1.0, 19.0 - t), 0.0, 1.0)
    q = 0.8 * np.sin(1.3 * t) * rise**2 * (3.0 - 2.0 * rise)
    v = np.gradient(q, fine)
    torque = 0.26 * np.gradient(v, fine) + 0.9 * np.sign(v) + 0.2 * v
    at = np.arange(0, t.size, round(1.0 / (rate * fine)))
    rng, wander = np.random.default_rng(1), np.zeros(at.size)
    for k in range(1, at.size):
        wander[k] = 0.99 * wander[k - 1] + 0.141 * rng.standard_normal()
    measured = torque[np.maximum(at - round(late / fine), 0)] + 0.03 * wander
    log = Log(time=t[at], joints=(Joint(name="j", unit="rad"),), position=q[at], torque=measured)
    slip = identify_motion([log], "j", law="coulomb-viscous", gravity=False)[0].dynamics["time_slip"]
    assert abs(slip.value - late) < 3.0 * slip.standard_error < 3.0 / rate
    assert slip.standard_error > 0.05 / rate
