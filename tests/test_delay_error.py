"""The stated error of a delay under noise that is correlated over longer than a bin."""

import numpy as np
from scipy.signal import lfilter

from backdrive import Joint, Log
from backdrive.identification.motion import identify_motion

RATE, SECONDS, COLOUR = 200.0, 30.0, 0.98


def _log(seed: int) -> Log:
    """Return a log without a delay: inertia, Coulomb and viscous friction, and noise as AR(1)."""
    rng = np.random.default_rng([5, seed])
    t = np.arange(0.0, SECONDS, 1.0 / RATE)
    q, v, a = np.zeros((3, t.size))
    for k in (1.0, 2.3, 4.1, 7.7, 13.1):
        w, phase = 2.0 * np.pi * 0.07 * k, rng.uniform(0.0, 2.0 * np.pi)
        q += np.sin(w * t + phase) / k
        v += w * np.cos(w * t + phase) / k
        a -= w**2 * np.sin(w * t + phase) / k
    white = rng.standard_normal(t.size) * 0.07 * np.sqrt(1.0 - COLOUR**2)
    torque = 0.12 * a + np.tanh(v / 0.01) + 0.3 * v + lfilter([1.0], [1.0, -COLOUR], white)
    return Log(time=t, joints=(Joint(name="joint", unit="rad"),), position=q[:, None], torque=torque[:, None])


def test_the_error_of_a_delay_covers_it_under_coloured_noise():
    slips = [
        identify_motion([_log(seed)], "joint", law="coulomb-viscous")[0].dynamics["time_slip"]
        for seed in range(20)
    ]
    z = np.array([slip.value / slip.standard_error for slip in slips])
    assert 0.6 < np.sqrt(np.mean(z**2)) < 1.3
    assert np.mean(np.abs(z) > 1.96) <= 0.15
