"""Laws fitted along a motion that an encoder rounds: what the rounding must not do to delay and inertia."""

import numpy as np
import pytest

from _sines import sines
from backdrive import Log, identify
from backdrive.identification.smoothing import FINE, SHARE, smoothing


def log(seed, step=1e-5, seconds=12.0, noise=0.05):
    """Three sines under Coulomb and viscous friction, no delay; rounded to an encoder's steps."""
    rng = np.random.default_rng(seed)
    t, q, v, a = sines(rng, seconds)
    tau = 0.15 * a + 1.5 * np.sign(v) + 0.8 * v + noise * rng.standard_normal(t.size)
    return Log.from_arrays(time=t, position=np.round(q / step) * step, torque=tau)


@pytest.mark.parametrize("seed", range(4))
def test_delay_and_inertia_lie_within_their_errors(seed):
    """On the seeds 0 to 3, the delay was 5 to 80 of its errors off where the steps were in the acceleration."""
    found = identify(log(seed), method="dynamic", law="coulomb-viscous").model.joints[0].dynamics
    for name, truth in (("delay", 0.0), ("inertia", 0.15)):
        assert abs(found[name].value - truth) < 3.5 * found[name].standard_error, name
    assert 1e-4 < found["delay"].standard_error < 1e-3  # white noise alone leaves 0.2 ms


def test_a_fit_sample_by_sample_is_smoothed_more():
    one = log(0, step=1e-4)
    name = one.joints[0].name
    usual, fine = (smoothing([one], name, share=share).cutoff or 100.0 for share in (SHARE, FINE))
    assert fine < usual <= 100.0
