"""A delay of the torque that the user knows: used as it is by every method that has one, and compared with the motion."""

import numpy as np
import pytest

from backdrive import Joint, Log, identify
from backdrive.errors import InvalidInput
from backdrive.identification.arm_slip import ArmSlip, with_delay
from backdrive.identification.options import Options

RATE, LATE, INERTIA, COULOMB, VISCOUS = 1000.0, 0.004, 0.15, 1.5, 0.4
SPEED = np.array([0.3, 0.8, 1.3])
WAVES = ((0.8, 1.32, 0.3), (0.25, 3.58, 1.1), (0.1, 5.84, 2.0))


def log(motion, seconds=20.0, late=LATE):
    t = np.arange(round(seconds * RATE)) / RATE
    velocity, acceleration = (motion(t - late, order) for order in (1, 2))
    noise = 0.05 * np.random.default_rng(0).standard_normal(t.size)
    torque = INERTIA * acceleration + COULOMB * np.tanh(velocity / 0.002) + VISCOUS * velocity + noise
    joint = Joint(name="j1", unit="rad")
    return Log(time=t, joints=(joint,), position=motion(t, 0)[:, None], torque=torque[:, None])


def sines(t, order):
    return sum(a * w**order * np.sin(w * t + c + 0.5 * np.pi * order) for a, w, c in WAVES)


def friction_of(known, **others):
    return identify(log(sines), known=known, **others).model.joints[0]


def error(friction):
    return np.abs(friction.law.torque(SPEED) - COULOMB - VISCOUS * SPEED).max()


@pytest.mark.parametrize("method", ["auto", "motion"])
def test_a_known_delay_is_used_as_it_is(method):
    result = identify(log(sines), method=method, known={"delay": LATE})
    friction = result.model.joints[0]
    slip = friction.dynamics["time_slip"]
    assert (result.method, slip.value, slip.standard_error) == ("motion", LATE, 0.0)
    assert result.model.options["known"] == {"delay": LATE}
    assert "The delay of the torque is known, 4 ms" in result.evidence[0].verdict
    assert not friction.warnings
    assert error(friction) < 1.2 * error(friction_of({})) + 1e-3
    assert friction.dynamics["inertia"].value == pytest.approx(INERTIA, rel=0.01)
    assert friction.standard_errors


@pytest.mark.parametrize("wrong", [0.0, -LATE, 0.02, 1.0])
def test_a_wrong_known_delay_is_remarked(wrong):
    friction = friction_of({"delay": wrong})
    assert friction.dynamics["time_slip"].value == wrong
    assert friction.verdict.grade != "good"
    assert "but the motion shows 3.86" in " ".join(friction.warnings)


def test_zero_is_known_where_torque_is_on_time():
    friction = identify(log(sines, late=0.0), known={"delay": 0}).model.joints[0]
    assert friction.dynamics["time_slip"].value == 0.0
    assert not friction.warnings


def test_a_sweep_takes_a_known_delay():
    edges, top, stroke = np.cumsum([0.0, *(2.0 * np.pi * 0.4 * 8 / (n * 2.0) for n in range(1, 9))]), 2.0, 0.4

    def cycles(t, order):
        n = np.clip(np.searchsorted(edges, t, side="right"), 1, 8)
        w = n * top / 8 / stroke
        wave = w**order * np.sin(w * (t - edges[n - 1]) + 0.5 * np.pi * (order - 1))
        return stroke * np.where((t >= 0.0) & (t < edges[-1]), wave, -1.0 if order == 0 else 0.0)

    record = log(cycles, seconds=float(edges[-1]))
    friction = identify(record, method="sweep", known={"delay": LATE}).model.joints[0]
    slip = friction.dynamics["time_slip"]
    assert (slip.value, slip.standard_error) == (pytest.approx(LATE), 0.0)
    assert not any("delay" in w or "commanded" in w for w in friction.warnings)
    assert error(friction) < 0.02
    wrong = identify(record, method="sweep", known={"delay": -0.01}).model.joints[0]
    assert "but the motion shows" in wrong.warnings[0]


def test_an_arm_takes_a_known_delay_and_compares_it():
    found = ArmSlip(delay=0.004, error=2e-4)
    assert with_delay(found, None, 1e-3) == (found, ())
    assert with_delay(found, 0.004, 1e-3) == (ArmSlip(delay=0.004, error=0.0), ())
    slip, wrong = with_delay(found, 0.0, 1e-3)
    assert slip.is_significant
    assert "known as 0 ms, but the motion shows 4 ± 0.2 ms" in wrong[0]
    assert with_delay(None, 0.01, 1e-3)[1] == ()


@pytest.mark.parametrize(
    ("method", "known", "says"),
    [
        ("constant-velocity", {"delay": 0.0}, "hardly changes means at constant speed"),
        ("ramp", {"delay": 0.0}, "slow against any delay"),
        ("motion", {"inertia": 0.1}, "'inertia' cannot be known for a curve"),
        ("motion", {"delay": 4.0}, "0.004"),
        ("motion", {"delay": float("nan")}, "taken as known"),
    ],
)
def test_what_cannot_be_known_is_refused(method, known, says):
    with pytest.raises(InvalidInput, match=says):
        Options(known=known).applicable(method)


def test_timing_and_delay_are_not_both_known():
    with pytest.raises(InvalidInput, match="Give one"):
        Options(known={"delay": 0.0}, timing="sample").applicable("sweep")
