"""External torques that a log holds, where they do not fit the estimate."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("pinocchio")

from _arm_force import PUSH, ROBOT, SLIDING, log_of
from backdrive.external import JointForce, estimate_force
from backdrive.external.comparison import doubts
from backdrive.logs.log import Joint


@pytest.fixture(scope="module")
def log():
    return log_of(PUSH, n=4000)


def about(log, known):
    estimate = estimate_force(
        SLIDING, replace(log, external_torque=known), robot=ROBOT, accept=("torque-share",)
    )
    return [line for line in estimate.remarks if "external torque differs" in line]


def test_a_known_torque_that_fits_is_not_remarked_on(log):
    assert not about(log, log.external_torque)


def test_a_sign_and_an_order_that_do_not_fit_are_named(log):
    turned = log.external_torque * np.array([1.0, -1.0, 1.0, 1.0, 1.0, 1.0])
    (said,) = about(log, turned)
    assert "Joint 'j1'" in said
    assert "its sign turned round" in said
    swapped = about(log, log.external_torque[:, [1, 0, 2, 3, 4, 5]])
    assert any("Joint 'j1'" in said and "joint 'j0'" in said for said in swapped)


def test_a_turned_sign_is_named_even_where_the_band_is_wide():
    t = np.arange(4000) / 100.0
    known = 3.0 * np.sin(t)
    force = JointForce(
        joint=Joint(name="j"),
        time=t,
        force=known,
        friction=0.0 * t,
        lower=known - 20.0,
        upper=known + 20.0,
        state=np.zeros(t.size, dtype=np.int8),
        method="momentum",
        bandwidth=50.0,
        lag=0.02,
        known=-known,
    )
    (said,) = doubts([force])
    assert "its sign turned round" in said
    assert not doubts([replace(force, known=known)])


def test_a_torque_of_the_wrong_sign_is_named_by_the_known_one(log):
    turned = replace(log, torque=log.torque * np.array([-1.0, 1.0, 1.0, 1.0, 1.0, 1.0]))
    (said,) = about(turned, log.external_torque)
    assert "Joint 'j0'" in said
    assert "check its order, sign" in said


def test_an_arm_at_rest_is_not_taken_for_another_robot(log):
    still = replace(log, position=np.tile(log.position[:1], (log.time.size, 1)))
    estimate = estimate_force(SLIDING, still, robot=ROBOT)
    assert all((one.state == 2).mean() > 0.9 for one in estimate.joints)
