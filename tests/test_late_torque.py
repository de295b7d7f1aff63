"""Torque that comes late: found and corrected, however long it is against the motion, and judged on windows of whole periods."""

import numpy as np
import pytest

from backdrive import Joint, Log, identify
from backdrive.identification.dynamic.choice import windows
from backdrive.identification.motion_bins import Bins, block_count, moving_average, period_of
from backdrive.identification.signals import prepare
from backdrive.identification.whitening import Colour

RATE, INERTIA, COULOMB, VISCOUS = 1000.0, 0.15, 1.5, 0.4


def _log(times, position, velocity, acceleration, late, seed=0):
    noise = 0.05 * np.random.default_rng(seed).standard_normal(times.size)

    def torque(t):
        dq = velocity(t)
        return INERTIA * acceleration(t) + COULOMB * np.tanh(dq / 0.002) + VISCOUS * dq

    joint = Joint(name="j1", unit="rad")
    return Log(
        time=times,
        joints=(joint,),
        position=position(times)[:, None],
        torque=(torque(times - late) + noise)[:, None],
    )


def sines(late, seconds=20.0, slow=1.0):
    t = np.arange(round(seconds * RATE)) / RATE
    waves = [
        (0.8, slow * 2.0 * np.pi * 0.21, 0.3),
        (0.25, slow * 2.0 * np.pi * 0.57, 1.1),
        (0.1, slow * 2.0 * np.pi * 0.93, 2.0),
    ]
    return _log(
        t,
        lambda x: sum(a * np.sin(w * x + c) for a, w, c in waves),
        lambda x: sum(a * w * np.cos(w * x + c) for a, w, c in waves),
        lambda x: sum(-a * w * w * np.sin(w * x + c) for a, w, c in waves),
        late,
    )


@pytest.mark.parametrize("late", [-0.03, 0.0, 0.02, 0.05, 0.1])
def test_late_torque_of_a_motion_is_corrected(late):
    friction = identify(sines(late)).model.joints[0]
    slip = friction.dynamics["time_slip"]
    assert abs(slip.value - late) < 3.0 * slip.standard_error
    assert slip.standard_error < 2e-3
    assert friction.dynamics["inertia"].value == pytest.approx(INERTIA, rel=0.02)
    assert float(friction.law.torque(np.array([1.0]))[0]) == pytest.approx(COULOMB + VISCOUS, rel=0.02)
    assert bool(friction.warnings) == (abs(late) >= 0.02)


def test_a_delay_that_is_long_but_not_known_well_is_corrected_without_errors_of_friction():
    # a 5 kHz log tells the delay to a millisecond, which is five samples
    scene = sines(0.05)
    fine = np.arange(5 * len(scene.time)) / (5.0 * RATE)
    rng = np.random.default_rng(3)
    log = Log(
        time=fine,
        joints=scene.joints,
        position=np.interp(fine, scene.time, scene.position[:, 0])[:, None],
        torque=(np.interp(fine, scene.time, scene.torque[:, 0]) + 0.4 * rng.standard_normal(fine.size))[
            :, None
        ],
    )
    friction = identify(log, law="coulomb-viscous", method="motion").model.joints[0]
    slip = friction.dynamics["time_slip"]
    assert slip.value == pytest.approx(0.05, abs=3.0 * slip.standard_error + 1e-4)
    assert friction.dynamics["inertia"].value == pytest.approx(INERTIA, rel=0.03)
    assert slip.standard_error > 2.0 / (5.0 * RATE)
    assert not friction.standard_errors
    assert np.isnan(friction.dynamics["inertia"].standard_error)


def test_blocks_and_windows_last_a_period_of_the_motion():
    fast, slow = (
        period_of([s.moves for s in prepare(sines(0.0, seconds=60.0, slow=share), "j1")])
        for share in (1.0, 0.2)
    )
    assert slow == pytest.approx(5.0 * fast, rel=0.35)
    assert block_count(60.0) == block_count(60.0, 1.0) == 24
    assert block_count(600.0, 30.0) == 20
    assert block_count(60.0, slow) == max(8, int(60.0 / slow))
    assert sum(np.diff(m.astype(int)).clip(0).sum() for m in windows([60_000])) == 5
    assert sum(np.diff(m.astype(int)).clip(0).sum() for m in windows([60_000], slow * RATE)) < 5


def test_noise_of_opposite_neighbours_is_whitened():
    rng, share = np.random.default_rng(5), -0.7
    fresh = rng.standard_normal((4001, 2))
    moving = fresh[1:] + share * fresh[:-1]
    correlation = share / (1.0 + share**2)
    assert moving_average(correlation) == pytest.approx(share)
    used = np.ones(4000, dtype=bool)
    used[1000:1003] = False
    bins = Bins(X=moving[:, :1], y=moving[:, 1], used=used, speed=np.ones(4000), blocks=8)
    white = bins.whiten(Colour(correlation))
    for series, raw in ((white.X[:, 0], moving[:, 0]), (white.y, moving[:, 1])):
        assert series[used].std() == pytest.approx(raw.std(), rel=0.05)
        for lag in (1, 2, 3):
            assert abs(np.corrcoef(series[1003 + lag :], series[1003:-lag])[0, 1]) < 0.05
        assert np.array_equal(series[~used], raw[~used])
        assert series[1003] == pytest.approx(np.sqrt(1.0 + share**2) * raw[1003])  # anew after a gap


@pytest.mark.parametrize("size", [0.0, 10.0, 300.0])
@pytest.mark.parametrize("length", [1, 150])
def test_bursts_of_torque_leave_inertia_and_delay_alone(size, length):
    rng, t = np.random.default_rng(1), np.arange(0.0, 40.0, 0.002)
    q = 0.8 * np.sin(2.0 * np.pi * 0.3 * t) + 0.3 * np.sin(2.0 * np.pi * 1.1 * t + 1.0)
    v = np.gradient(q, t)
    tau = 0.4 * np.gradient(v, t) + 2.0 * np.tanh(v / 0.005) + 1.5 * v + 2.0 * np.sin(q) + 0.3
    tau += 0.02 * rng.standard_normal(t.size)
    for first in rng.integers(t.size - 150, size=5).tolist():
        tau[first : first + length] += size
    friction = identify(
        Log.from_arrays(time=t, position=q, torque=tau), method="motion", accept=["outlier"]
    ).model.joints[0]
    found = friction.dynamics
    assert found["inertia"].value == pytest.approx(0.4, abs=5e-4) and found["inertia"].standard_error < 2e-4
    assert found["time_slip"].value == pytest.approx(0.0, abs=1e-4)
    assert found["gravity_sin"].value == pytest.approx(2.0, abs=0.01)


def chirp(late, count=2.0 * np.pi / 2**17, seed=0):
    """A small chirp about the horizontal, on an encoder whose steps are a fifth of the acceleration."""
    t, amplitude, begin, end, seconds = np.arange(30_000) / RATE, 0.15, 0.1, 1.0, 30.0
    slope = (end - begin) / seconds

    def motion(t):
        phase, w = 2.0 * np.pi * (begin * t + 0.5 * slope * t**2), 2.0 * np.pi * (begin + slope * t)
        q = amplitude * np.sin(phase)
        return q, amplitude * w * np.cos(phase), -(w**2) * q + 2.0 * np.pi * slope * amplitude * np.cos(phase)

    q, dq, ddq = motion(t - late)
    torque = ddq + 10.0 * np.sin(q) + 5.0 * np.tanh(dq / 1e-4) + 3.0 * dq
    torque = torque + 0.3 * np.random.default_rng(seed).standard_normal(t.size)
    joint = Joint(name="j1", unit="rad")
    seen = np.round(motion(t)[0] / count) * count
    return Log(time=t, joints=(joint,), position=seen[:, None], torque=torque[:, None])


@pytest.mark.parametrize("late", [0.0, 0.004, 0.02, 0.06])
def test_a_delay_in_a_sweep_on_a_coarse_encoder_is_told_and_no_other(late):
    result = identify(chirp(late))
    friction = result.model.joints[0]
    said, slip = " ".join(friction.warnings), friction.dynamics["time_slip"]
    assert result.method == "sweep" and "earlier than" not in said
    assert ("after it acted" in said) == (late > 0.01) and ("seems to come" in said) == (late == 0.004)
    assert abs(slip.value - late) < 3.0 * slip.standard_error
    assert friction.dynamics["inertia"].value == pytest.approx(1.0, abs=0.04)
    speed = np.array(friction.law.rate.velocity)
    off = np.abs(np.array(friction.law.rate.positive) - 5.0 - 3.0 * speed)
    assert np.all(off < 4.0 * np.array(friction.standard_errors["positive"]))


@pytest.mark.parametrize(
    ("seed", "rate", "delay"), [(51, 500.0, 0.048), (55, 1e3, 0.048), (133, 500.0, 0.082)]
)
def test_a_light_joint_does_not_hide_a_long_delay(seed, rate, delay):
    """The jerk tells next to no delay there: a first fit alone would take the torque as in time."""
    rng = np.random.default_rng(seed)
    rng.choice([200.0, 500.0, 1000.0])
    t = np.arange(int(rate * rng.uniform(8.0, 30.0))) / rate
    q, dq, ddq = np.zeros((3, t.size))
    lowest = 10.0 ** rng.uniform(-1.0, 0.3)
    for f in lowest * np.array([1.0, 2.3, 4.1])[: rng.integers(1, 4)]:
        w, phase, size = 2.0 * np.pi * f, rng.uniform(0.0, 6.28), rng.uniform(0.3, 1.0) / f
        q += size * np.sin(w * t + phase)
        dq += size * w * np.cos(w * t + phase)
        ddq -= size * w * w * np.sin(w * t + phase)
    rng.uniform(), rng.choice(3)
    top = np.abs(dq).max()
    torque = rng.uniform(0.01, 1.0) * ddq / np.abs(ddq).std() + rng.uniform(0.3, 3.0) * np.tanh(
        200.0 * dq / top
    )
    torque += rng.uniform() * dq / top
    if rng.random() < 0.5:
        torque += rng.uniform(0.0, 3.0) * np.sin(q)
    late = round(delay * rate)
    inside = slice(late + 1, -late - 1)
    torque = np.roll(torque, late)[inside]
    torque += rng.uniform(0.01, 0.2) * rng.standard_normal(torque.size)
    log = Log.from_arrays(time=t[inside], position=np.round(q[inside] * 1305.0) / 1305.0, torque=torque)
    found = identify(log, method="motion").model.joints[0].dynamics["time_slip"]
    assert found.value == pytest.approx(delay, abs=3e-3)
