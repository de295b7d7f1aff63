"""The timing of a sampled torque at low rates, where the low pass of the motion rings over several samples after a reversal."""

import sys
from pathlib import Path

import numpy as np
import pytest

from backdrive.identification.signals import prepare
from backdrive.identification.sweep import identify_sweep
from backdrive.identification.timing import torque_timing
from backdrive.logs.log import Joint, Log

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks" / "evidence"))

from _verdicts_scenes import scene


def as_log(made):
    columns = {"position": made.position[:, None], "torque": made.torque[:, None]}
    return Log(time=made.time, joints=(Joint(name="joint"),), **columns)


@pytest.fixture(scope="module")
def logs():
    return [as_log(one) for seed in range(8) for one in scene(seed, "sweeps", rate=100.0).logs()]


def test_no_sampled_torque_is_taken_for_a_command(logs):
    words, delays, errors = zip(*(torque_timing(prepare(log, 0)) for log in logs), strict=True)
    assert "command" not in words
    assert np.sqrt(np.mean((np.array(delays) / np.array(errors)) ** 2)) < 1.6


def test_what_the_motion_does_not_tell_is_estimated_with_its_error(logs):
    unsure = [log for log in logs if torque_timing(prepare(log, 0))[0] is None][:6]
    assert len(unsure) == 6
    for log in unsure:
        slip = identify_sweep([log], "joint")[0].dynamics["time_slip"]
        assert abs(slip.value) < 4.0 * slip.standard_error and slip.standard_error > 0.0


def test_a_few_bins_tell_nothing(logs):
    short = logs[0].rows(slice(300, 360))
    assert torque_timing(prepare(short, 0))[0] is None
