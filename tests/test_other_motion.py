"""The motion of other joints at the means of a joint's residual: of the right log, not across gaps, and low-passed."""

import numpy as np
import pytest

from backdrive.identification.other_motion import CUTOFF, OtherMotion
from backdrive.identification.pipeline import identify
from backdrive.identification.residual import residual_of
from backdrive.identification.signals import prepare_each
from backdrive.logs.log import Joint, Log

RATE = 500.0


def two_joints(seed, begin=-1.0, end=40.0, frequency=5.1, travel=0.0, rate=RATE, pull=0.1, fast=0.0):
    """Return a log of joints a and b on a clock from 0; a moves from `begin` to `end`, and b's acceleration pulls at it."""
    rng, t = np.random.default_rng(seed), np.arange(int(25.0 * rate)) / rate
    on = np.clip(np.minimum(t - begin, end - t) / 0.5, 0.0, 1.0)
    a = on * on * (3.0 - 2.0 * on) * (0.8 * np.sin(1.7 * t) + 0.3 * np.sin(4.3 * t + 1.0))
    b = 0.5 * np.sin(frequency * t) + 0.2 * np.sin(2.3 * frequency * t + seed) + travel * np.sin(0.6 * t)
    b += fast * np.sin(2.0 * np.pi * 3.0 * CUTOFF * t)
    va, ab = np.gradient(a, t), np.gradient(np.gradient(b, t), t)
    of_a = 0.2 * np.gradient(va, t) + np.sign(np.where(np.abs(va) < 1e-4, 0.0, va)) + 0.3 * va
    of_a += pull * ab / np.std(ab) + 0.03 * rng.standard_normal(t.size)
    of_b = 0.2 * ab + np.sign(np.gradient(b, t)) + 0.02 * rng.standard_normal(t.size)
    return Log(
        time=t,
        joints=(Joint(name="a"), Joint(name="b")),
        position=np.stack([a, b], 1),
        torque=np.stack([of_a, of_b], 1),
    )


def residual(logs, joint="a"):
    parts = [(s, s.torque, s.torque, True) for each in prepare_each(logs, joint) for s in each]
    return residual_of(parts, means_alone=True).slides


def beside(logs):
    """Return the means at which the motion of b is known, and this motion."""
    ((about, means, series),) = OtherMotion(logs).beside(residual(logs), "a")
    assert about.name == "b"
    return means, series


def truth(log, time):
    """Return position, velocity and acceleration of joint b at instants, without a low pass, (3, n)."""
    b = log.position[:, 1]
    v = np.gradient(b, log.time)
    return np.stack([np.interp(time, log.time, x) for x in (b, v, np.gradient(v, log.time))])


def likeness(x, y):
    return [float(np.corrcoef(p, q)[0, 1]) for p, q in zip(x, y, strict=True)]


def said(logs, **options):
    joints = identify(logs, method="motion", **options).model.joints
    return " ".join(next(joint for joint in joints if joint.joint.name == "a").warnings)


@pytest.mark.parametrize("shift", [0.0, 100.0])
def test_means_belong_to_the_log_of_their_stretch(shift):
    """On the clock of the first log, the second one's joint begins to move only after the first one's has stopped."""
    first, second = two_joints(1, end=11.0), two_joints(2, begin=13.0, frequency=6.7)
    second = second.replace(time=second.time + shift)
    means, series = beside([first, second])
    for part, log in enumerate((first, second)):
        rows = means.part == part
        assert rows.any()
        assert min(likeness(series[:, rows], truth(log, means.time[rows]))) > 0.99
    assert "Torque follows the acceleration of joint 'b'" in said([first, second])


def test_a_log_without_a_mean_gets_none_of_another():
    still, moving = two_joints(1, frequency=5.1), two_joints(2, frequency=6.7)
    position = still.position.copy()
    position[:, 0] = 0.002 * np.sin(0.5 * still.time)
    logs = [still.replace(position=position), moving]
    means, series = beside(logs)
    assert np.unique(means.part).tolist() == [1]
    assert min(likeness(series, truth(moving, means.time))) > 0.99


def test_means_of_held_out_logs_do_not_count():
    first, second = two_joints(1), two_joints(2, frequency=6.7)
    parts = [(s, s.torque, s.torque, True) for (s,) in prepare_each([first, second], "a")]
    parts[1] = (parts[1][0].of_log(-1), *parts[1][1:])
    res = residual_of(parts, means_alone=True).slides
    ((_, means, series),) = OtherMotion([first]).beside(res, "a")
    assert np.unique(res.part).tolist() == [0, 1] and np.unique(means.part).tolist() == [0]
    assert min(likeness(series, truth(first, means.time))) > 0.99
    assert "Torque follows the acceleration of joint 'b'" in said([first], held_out=[second])


def test_nothing_is_low_passed_across_gaps():
    """At each gap the position of b jumps, which looked like a large acceleration for a tenth of a second."""
    whole = two_joints(1, travel=6.0)
    keep = np.ones(len(whole), dtype=bool)
    for begin in np.linspace(2.0, 23.0, 8)[1:-1]:
        keep &= ~((whole.time > begin) & (whole.time < begin + 0.5))
    torn = whole.rows(keep)
    means, series = beside([torn])
    assert np.unique(means.part).size == 7
    assert min(likeness(series, truth(whole, means.time))) > 0.99
    assert "Torque follows the acceleration of joint 'b'" in said([torn])


def test_means_in_a_gap_of_the_other_joint_alone_do_not_count():
    whole = two_joints(1)
    position = whole.position.copy()
    lost = (whole.time > 9.0) & (whole.time < 11.0)
    position[lost, 1] = np.nan
    logs = [whole.replace(position=position)]
    means, series = beside(logs)
    every = residual(logs).time
    assert np.array_equal(means.time, every[(every <= 9.002) | (every >= 11.0)])
    assert min(likeness(series, truth(whole, means.time))) > 0.99


def test_short_pieces_between_gaps_do_not_count():
    whole = two_joints(1)
    position = whole.position.copy()
    lost = (whole.time > 10.0) & (whole.time < 14.0) & (np.arange(len(whole)) % 30 < 5)
    position[lost, 1] = np.nan
    means, _ = beside([whole.replace(position=position)])
    assert not ((means.time > 10.1) & (means.time < 13.9)).any()
    assert (means.time < 10.0).any() and (means.time > 14.1).any()


@pytest.mark.parametrize("channel", ["position", "velocity"])
def test_motion_between_kept_samples_is_interpolated(channel):
    """At 5000 Hz, every 25th sample is kept; the last one before a mean is off by up to 5 ms of motion."""
    log = two_joints(1, rate=5000.0)
    if channel == "velocity":
        log = log.replace(position=None, velocity=np.gradient(log.position, log.time, axis=0))
        b = log.velocity[:, 1]
    else:
        b = log.position[:, 1]
    means, series = beside([log])
    found = series[1] if channel == "velocity" else series[0]
    inside = (means.time > 1.0) & (means.time < 24.0)
    error = (found - np.interp(means.time, log.time, b))[inside]
    assert float(np.abs(error).max()) < 2e-3 * float(np.ptp(b))
    assert channel == "position" or not series[0].any()


def test_motion_faster_than_the_low_pass_does_not_count():
    slow, quick = two_joints(1), two_joints(1, fast=0.02)
    quick = quick.replace(torque=slow.torque)
    (means, without), (_, found) = beside([slow]), beside([quick])
    inside = (means.time > 1.0) & (means.time < 24.0)
    assert float(np.std(truth(quick, means.time)[2])) > 10.0 * float(np.std(without[2]))
    assert np.abs(found - without)[2, inside].max() < 0.05 * float(np.std(without[2]))


def test_the_low_pass_is_a_tenth_of_a_slow_rate():
    rate = 50.0  # the cutoff is then 5 Hz
    log, t = two_joints(1, rate=rate), np.arange(int(25.0 * rate)) / rate
    position = log.position.copy()
    position[:, 1] += 0.02 * np.sin(2.0 * np.pi * 10.0 * t)
    (means, without), (_, found) = beside([log]), beside([log.replace(position=position)])
    inside = (means.time > 1.0) & (means.time < 24.0)
    assert np.abs(found - without)[2, inside].max() < 0.1 * float(np.std(without[2]))
