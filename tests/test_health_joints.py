"""Health of logs of many joints: the accelerations of those that pull on a joint are seen, among any number of others."""

import numpy as np
import pytest

from backdrive import Log
from backdrive._memory import transpose
from backdrive.logs.health import check
from backdrive.logs.health._exam import Exam
from backdrive.logs.health._motion import motion

RATE, PULLED, PULLING = 500.0, 3, 17


def made(joints, late=0):
    """A log of joints of which one is pulled by another's acceleration more than by its own; its torque may be late."""
    rng, t = np.random.default_rng(7), np.arange(8000) / RATE
    w = rng.uniform(1.0, 7.0, (joints, 4))
    phase = rng.uniform(0.0, 6.3, (joints, 4))
    size = 0.4 / w
    q, dq, ddq = np.zeros((3, t.size, joints))
    for k in range(4):
        angle = np.outer(t, w[:, k]) + phase[:, k]
        q += size[:, k] * np.sin(angle)
        dq += size[:, k] * w[:, k] * np.cos(angle)
        ddq -= size[:, k] * w[:, k] ** 2 * np.sin(angle)
    torque = 0.5 * ddq + np.tanh(dq / 0.01) + 0.4 * dq
    if joints > PULLING:
        torque[:, PULLED] += 1.5 * ddq[:, PULLING]
    torque[:, PULLED] = np.roll(torque[:, PULLED], late)
    torque += 0.02 * rng.standard_normal(torque.shape)
    return Log.from_arrays(time=t, position=q, torque=torque)


@pytest.mark.parametrize("joints", [4, 13, 24])
def test_terms_are_those_of_the_joints_that_pull(joints):
    seen = motion(Exam(made(joints)), PULLED, 20)
    assert len(seen.others) == min(joints - 1, 12) and PULLED not in seen.others
    assert (PULLING in seen.others) == (joints > PULLING)
    assert seen.others == sorted(seen.others) and seen.terms.shape[1] == seen.plain + 2 + len(seen.others)


@pytest.mark.parametrize("shape", [(0, 3), (5, 0), (7, 1), (4096, 1), (1366, 3), (5000, 7), (100, 200)])
def test_a_transposed_copy_is_that_of_numpy(shape):
    x = np.arange(1.0 * shape[0] * shape[1]).reshape(shape)
    for array in (x, np.asfortranarray(x), x[::-1], np.broadcast_to(x[:1], shape) if shape[0] else x):
        copy = transpose(array)
        assert copy.flags.c_contiguous and np.array_equal(copy, array.T)


@pytest.mark.parametrize("joints", [1, 3, 40])
def test_columns_of_an_exam_are_those_of_its_log(joints):
    n = 3000  # more than one piece of forty joints
    log = Log.from_arrays(time=np.arange(n) / RATE, position=np.arange(1.0 * n * joints).reshape(n, joints))
    exam = Exam(log)
    for j in range(joints):
        column = exam.column("position", j)
        assert column.flags.c_contiguous and np.array_equal(column, log.position[:, j])


def test_a_slip_is_found_among_many_joints():
    late = [f for f in check(made(24, late=12)) if f.name == "time-slip"]
    assert [f.joint for f in late] == [made(24).names[PULLED]]
    assert late[0].value == pytest.approx(12.0, abs=0.3)
    assert not [f for f in check(made(24)) if f.name == "time-slip"]
