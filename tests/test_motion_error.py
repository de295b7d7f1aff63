"""White errors of a measured motion: found by what they are, and kept out of inertia and delay."""

import sys
from pathlib import Path

import numpy as np
import pytest

from _sines import RATE, sines
from backdrive import Joint, Log, identify
from backdrive.identification.motion_error import MotionError, mean_error, motion_error
from backdrive.identification.smoothing import smoothing
from backdrive.identification.whitening import Colour, whiten_both
from backdrive.logs.filters import low_pass

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks" / "evidence"))

import _independent as independent

INERTIA = 0.15


def log(seed=0, *, position=0.0, velocity=None, step=0.0, differenced=False):
    """Return a log under Coulomb and viscous friction, with noise of the motion."""
    rng = np.random.default_rng(100 + seed)
    t, q, v, a = sines(np.random.default_rng(seed), 12.0)
    tau = INERTIA * a + 1.5 * np.sign(v) + 0.8 * v + 0.05 * rng.standard_normal(t.size)
    read = q + position * rng.standard_normal(t.size)
    read = np.round(read / step) * step if step else read
    if differenced:
        motion = {"velocity": np.diff(read, prepend=2 * read[0] - read[1]) * RATE}
    elif velocity is not None:
        motion = {"velocity": v + velocity * rng.standard_normal(t.size)}
    else:
        motion = {"position": read}
    return Log(time=t, joints=(Joint(name="j", unit="rad"),), torque=tau, **motion)


def error_of(one: Log) -> MotionError:
    motion = one.velocity if one.position is None else one.position
    return motion_error(one, motion[:, 0], RATE)


@pytest.mark.parametrize("size", [1e-6, 1e-4, 1e-2])
def test_noise_of_a_position_is_measured(size):
    error = error_of(log(position=size))
    assert (error.orders, error.step) == (2, 0.0)
    assert error.size == pytest.approx(size, rel=0.1)


def test_noise_of_a_velocity_is_told_from_that_of_the_positions_below_it():
    error = error_of(log(velocity=5e-3))
    assert error.orders == 1 and error.size == pytest.approx(5e-3, rel=0.1)
    error = error_of(log(position=1e-4, differenced=True))
    assert error.orders == 2 and error.size == pytest.approx(1e-4, rel=0.1)


def test_rounding_is_taken_as_rounding_and_a_clean_motion_as_clean():
    error = error_of(log(step=1e-4))
    assert (error.size, error.step) == pytest.approx((1e-4 / 12.0**0.5, 1e-4))
    assert error_of(log(step=1e-5, position=1e-4)).size == pytest.approx(1e-4, rel=0.1)
    assert error_of(log()).size < 1e-12


def test_a_velocity_from_rounded_positions_has_their_steps():
    error = error_of(log(step=1e-3, differenced=True))
    assert error.orders == 2
    assert (error.size, error.step) == pytest.approx((1e-3 / 12.0**0.5, 1e-3), rel=0.1)


@pytest.mark.parametrize("share", [0.005, 0.05])
def test_lost_samples_are_no_noise(share):
    """A position goes on across a gap. Side by side, the samples looked noisy, and the inertia was up to twice as large."""
    one = log(2)
    kept = np.random.default_rng(0).random(len(one)) > share
    assert smoothing([one.rows(np.flatnonzero(kept))], "j").error.size < 1e-6


def test_the_error_of_a_log_that_is_held_out_does_not_count():
    calm, wild = log(1), log(2, position=1e-3)
    both = smoothing([calm], "j", held_out=[wild])
    assert both.error.size < 1e-12 and both.cutoff == smoothing([wild], "j").cutoff
    assert smoothing([calm, wild], "j").error.size == pytest.approx(1e-3 / 2.0**0.5, rel=0.1)


@pytest.mark.parametrize("noise", [0.0, 3e-5])
def test_corners_of_a_motion_are_no_noise_of_its_samples(noise):
    """A servo's acceleration jumps where friction changes its sign: above a tenth of 200 Hz that is more than rounding."""
    t, step, rng = np.arange(6000) / 200.0, 2.0 * np.pi / 2**20, np.random.default_rng(4)
    jumps = 8.0 * np.sign(np.sin(2.0 * np.pi * 0.71 * t + 0.3))
    q = np.cumsum(np.cumsum(jumps) / 200.0) / 200.0 + noise * rng.standard_normal(t.size)
    made = Log.from_arrays(time=t, position=step * np.round(q / step), torque=np.zeros(t.size))
    (name,) = made.names
    error = smoothing([made], name).error
    assert error.size > 1.5 * max(noise, step / 12.0**0.5) or noise
    assert error.of_sample == pytest.approx(max(noise, step / 12.0**0.5), rel=0.1)


def test_positions_and_velocities_have_the_error_of_the_kind_with_more_samples():
    few, many = MotionError(size=1.0, orders=1), MotionError(size=0.1)
    assert mean_error([few, many, many], [10, 6, 6]) == many
    assert mean_error([], []) == MotionError()


@pytest.mark.parametrize("orders", [1, 2])
def test_the_mean_square_is_that_of_whitened_means_of_the_acceleration(orders):
    rng = np.random.default_rng(3)
    size, cutoff, width, correlation = 1e-4, 60.0, 10, 0.8
    x = low_pass(size * rng.standard_normal(400_000), cutoff, RATE)
    for _ in range(orders):
        x = np.convolve(x, np.array([-1.0, 8.0, 0.0, -8.0, 1.0]) * RATE / 12.0, mode="same")
    mean = x.reshape(-1, width).mean(axis=1)
    white = (mean[1:] - correlation * mean[:-1]) / np.sqrt(1.0 - correlation**2)
    error = MotionError(size=size, orders=orders)
    mean = mean[20:-20]
    products = np.mean(mean**2), np.mean(mean[1:] * mean[:-1])
    assert error.between_means(cutoff, RATE, width)[:2] == pytest.approx(products, rel=0.03)
    assert error.in_acceleration(cutoff, RATE) == pytest.approx(np.mean(x[100:-100] ** 2), rel=0.02)
    expected = np.mean(white[20:-20] ** 2)
    beside = Colour(correlation, tuple(np.array(error.between_means(cutoff, RATE, width)) / products[0]))
    both = whiten_both(mean[:, None], np.arange(mean.size), beside)
    assert error.in_acceleration(cutoff, RATE, width, beside) == pytest.approx(np.mean(both**2), rel=0.03)
    assert error.in_acceleration(cutoff, RATE, width, Colour(correlation)) == pytest.approx(
        expected, rel=0.02
    )


@pytest.mark.parametrize(
    "noise",
    [{"position": 1e-4}, {"position": 1e-3}, {"velocity": 0.02}, {"position": 1e-4, "differenced": True}],
)
@pytest.mark.parametrize("law", ["coulomb-viscous", None])
def test_noise_of_the_motion_does_not_draw_the_inertia_to_zero(noise, law):
    """The inertia was 0.15 to 0.002 with errors stated, or 0.04 with a position noise of 0.1 mrad."""
    one = log(1, **noise)
    assert "--cutoff" in smoothing([one], "j").note
    dynamics = identify(one, method="motion", law=law).model.joints[0].dynamics
    inertia = dynamics["inertia"]
    assert abs(inertia.value - INERTIA) < 3.5 * inertia.standard_error < 0.1 * INERTIA
    if "time_slip" in dynamics:
        assert abs(dynamics["time_slip"].value) < 4.0 * dynamics["time_slip"].standard_error


def test_a_sensor_that_is_too_noisy_for_the_motion_is_named():
    q = sines(np.random.default_rng(0), 12.0)[1]
    one = log(position=3e-3)
    still = one.replace(position=0.02 * q[:, None] + one.position - q[:, None])
    assert "position is too noisy" in smoothing([still], "j").warning


@pytest.mark.parametrize("counts", [8192.0, 2048.0])
def test_rounding_that_lasts_many_samples_is_no_white_noise(counts):
    """At 5 kHz a step of these encoders lasts tens of samples: the low pass goes below the frequency of the steps."""
    rng = np.random.default_rng(4)
    joint = independent.Joint(coulomb=1.2, viscous=0.3, inertia=0.15)
    logger = independent.Logger(rate=5000.0, noise=0.05, counts=counts)
    made = independent.record(joint, independent.multisine(30.0, 0.6, rng), logger, rng)
    channels = {"position": made.position[:, None], "torque": made.torque[:, None]}
    log = Log(time=made.time, joints=(Joint(name="joint"),), **channels)
    error = motion_error(log, log.need("position")[:, 0], 5000.0)
    assert error.step == pytest.approx(2.0 * np.pi / counts, rel=1e-3)
    assert error.size > 2.0 * error.step / 12.0**0.5
    found = identify(log, method="motion").model.joints[0]
    assert found.dynamics["inertia"].value == pytest.approx(0.15, rel=0.1)
