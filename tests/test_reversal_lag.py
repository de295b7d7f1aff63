"""A late torque is told by friction that turns late and at once; friction that builds up over a distance is not taken for one."""

import numpy as np
import pytest
from scipy.signal import lfilter

from _synthetic import any_motion
from backdrive import identify
from backdrive.engine import rollout
from backdrive.identification.quality import grade
from backdrive.identification.reversal_lag import turning_lag
from backdrive.laws import CoulombViscous, Law, LuGre

RATE = CoulombViscous(coulomb_positive=5.0, coulomb_negative=5.0, viscous_positive=2.0, viscous_negative=2.0)


def dry(v):
    return 5.0 * np.sign(v) + 2.0 * v


def lag_of(log):
    """The lag in the residual of a fit that takes the torque as it is."""
    (evidence,) = identify(log, method="motion", known={"delay": 0.0}).evidence
    return turning_lag(evidence.residual)


@pytest.mark.parametrize("delay", [0.04, 0.055, 0.1, 0.15, -0.04, -0.07])
@pytest.mark.parametrize("inertia", [0.01, 0.3])
def test_the_time_by_which_friction_turns_late_is_the_delay(delay, inertia):
    assert lag_of(any_motion(dry, inertia=inertia, delay=delay, noise=0.1)) == pytest.approx(delay, abs=0.004)


@pytest.mark.parametrize("delay", [0.0, 0.01, -0.01])
def test_friction_that_turns_in_time_tells_nothing(delay):
    assert lag_of(any_motion(dry, delay=delay, noise=0.1)) == 0.0


@pytest.mark.parametrize("stiffness", [30.0, 100.0, 300.0, 500.0, 700.0, 1e3, 1.4e3, 2e3, 3e3, 1e4])
def test_friction_that_builds_up_over_a_distance_is_no_delay(stiffness):
    """Half of it takes from 3 to 100 ms here."""
    log = any_motion(lambda v: 0.0 * v, noise=0.05)
    law = Law(rate=RATE, element=LuGre(stiffness=stiffness, damping=0.0))
    friction = rollout(law, dt=log.period, q=log.position[:, 0])
    assert lag_of(log.replace(torque=log.torque + friction[:, None])) == 0.0


@pytest.mark.parametrize("width", np.geomspace(3e-4, 0.03, 13))
def test_a_spring_that_slips_at_a_distance_is_no_delay(width):
    """It turns the fastest just before it slips."""
    log = any_motion(lambda v: 2.0 * v, noise=0.05)
    bent = np.zeros(len(log))
    for k, step in enumerate(np.diff(log.position[:, 0]).tolist(), 1):
        bent[k] = min(max(bent[k - 1] + step, -width), width)
    assert lag_of(log.replace(torque=log.torque + 5.0 * bent[:, None] / width)) == 0.0


@pytest.mark.parametrize("seconds", [0.02, 0.05, 0.1])
def test_a_low_pass_of_the_torque_turns_it_gradually(seconds):
    log = any_motion(dry, noise=0.05)
    gain = 1.0 - np.exp(-log.period / seconds)
    assert lag_of(log.replace(torque=lfilter([gain], [1.0, gain - 1.0], log.torque, axis=0))) == 0.0


def test_few_reversals_tell_nothing_and_straight_lines_through_slow_motion_as_much():
    log = any_motion(dry, delay=0.05)
    assert lag_of(log.rows(slice(0, 1500))) == 0.0
    still = np.abs(np.gradient(log.position[:, 0], log.period)) < 0.05
    held = np.interp(log.time, log.time[~still], log.position[~still, 0])
    assert lag_of(log.replace(position=held)) == pytest.approx(0.05, abs=0.01)


def test_a_light_joint_whose_torque_is_late_is_told_how_late_and_with_it_is_good():
    """The inertia tells nothing, and became negative: a remark on the sign of the torque was all that there was."""
    log = any_motion(dry, inertia=0.03, delay=0.045, noise=0.1)
    friction = identify(log, method="motion", accept=("time-slip",)).model.joints[0]
    (said,) = (s for s in friction.warnings if "at once and at every reversal" in s)
    assert "torque comes 44 ms later" in said and "--known delay=0.044" in said
    known = identify(log, method="motion", known={"delay": 0.044}, accept=("time-slip",)).model.joints[0]
    assert grade(known).level == "good" and not any("Check its sign" in s for s in known.warnings)
    assert known.dynamics["inertia"].value == pytest.approx(0.03, abs=0.01)
