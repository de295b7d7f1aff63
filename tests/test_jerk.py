"""The jerk that is clear of encoder errors: moments of quick motion are kept, and a delay that they alone tell is found."""

import numpy as np
import pytest

from backdrive.identification.jerk import BANDS, clear_jerk
from backdrive.identification.motion import identify_motion
from backdrive.identification.motion_error import MotionError
from backdrive.identification.signals import default_cutoff, prepare
from backdrive.logs.filters import low_pass
from backdrive.logs.log import Joint, Log

RATE, STEP = 1000.0, 2.0 * np.pi / 2**20
T = np.arange(round(20.0 * RATE)) / RATE
LEAD = 1.0  # length of the motion's rise and fall, at whose ends the acceleration jumps [s]


def motion(quick: bool) -> np.ndarray:
    """Return a slow motion, which rises from rest and falls to rest if it is to have quick moments."""
    q = np.sin(1.3 * T + 0.3) + 0.3 * np.sin(3.1 * T)
    rise = np.clip(np.minimum(T, T[-1] - T) / LEAD, 0.0, 1.0)
    return q * rise * rise * (3.0 - 2.0 * rise) if quick else q


def log_of(seed: int, quick: bool, late: float = 0.0) -> Log:
    rng = np.random.default_rng(seed)
    q = motion(quick)
    v = np.gradient(q, T)
    a = np.gradient(v, T)
    white = rng.standard_normal(T.size)
    noise = np.zeros(T.size)
    for k in range(1, T.size):
        noise[k] = 0.98 * noise[k - 1] + np.sqrt(1.0 - 0.98**2) * white[k]
    torque = 0.013 * a + np.sign(v) + 0.3 * v
    torque = np.interp(T - late, T, torque) + 0.03 * noise
    return Log(
        time=T, joints=(Joint(name="j", unit="rad"),), position=np.round(q / STEP) * STEP, torque=torque
    )


def test_encoder_errors_are_left_out_and_a_quick_moment_is_kept():
    (quick,), (calm,) = (prepare(log_of(0, one), "j") for one in (True, False))
    cutoff = default_cutoff(RATE)
    kept, plain = clear_jerk(quick, MotionError.of_steps(STEP), cutoff), low_pass(quick.jerk, BANDS[-1], RATE)
    at = slice(round((LEAD - 0.01) * RATE), round((LEAD + 0.01) * RATE))
    assert kept[at].min() == pytest.approx(plain[at].min(), rel=0.2)
    inside = slice(2000, -2000)  # away from the log's ends
    kept, low, plain = (
        x[inside]
        for x in (
            clear_jerk(calm, MotionError.of_steps(STEP), cutoff),
            *(low_pass(calm.jerk, f, RATE) for f in (5.0, 80.0)),
        )
    )
    assert np.std(kept - low) < 0.1 * np.std(plain - low)


def test_without_an_encoder_step_all_bands_are_kept():
    (s,) = prepare(log_of(0, True), "j")
    plain = low_pass(s.jerk, BANDS[-1], RATE)
    assert clear_jerk(s, MotionError(), default_cutoff(RATE)) == pytest.approx(plain, abs=1e-9)


def test_a_delay_that_a_moment_tells_is_stated():
    """After a plain low pass alone, six of these eight logs leave the delay open."""
    found = []
    for seed in range(8):
        friction, _ = identify_motion([log_of(seed, True, 0.003)], "j", law="coulomb-viscous", gravity=False)
        if friction.standard_errors:
            slip = friction.dynamics["time_slip"]
            found.append((slip.value - 0.003) / slip.standard_error)
    assert len(found) >= 5 and np.abs(found).max() < 4.0
