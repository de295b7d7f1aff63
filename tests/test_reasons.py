"""Tests for identification/reasons.py: a delay that is hardly known keeps the errors of friction unsaid."""

import math

import pytest

from backdrive.identification.reasons import reason_of_delay
from backdrive.identification.slip import Slip
from backdrive.model import Estimate


def late(delay: float, error: float) -> Estimate:
    return Estimate(value=delay, unit="s", standard_error=error)


@pytest.mark.parametrize(
    ("delay", "error", "words"),
    [
        (-0.018, 0.002, "is hardly known, -18 ± 2 ms"),  # 22 ms within two errors, and not known to a tenth
        (-0.018, 0.0017, ""),
        (0.012, 0.002, ""),
        (0.012, 0.0021, "is known to 2.1 ms only"),  # two samples
        (0.0, math.inf, "is not determined by the motion"),
    ],
)
def test_a_delay_that_may_be_longer_than_any_plausible_one_is_hardly_known(delay, error, words):
    said = reason_of_delay(Slip(delay=delay, error=1e-4, period=1e-3), late(delay, error))
    assert words in said and bool(words) == bool(said)


def test_without_a_fitted_delay_that_of_the_search_counts():
    assert not reason_of_delay(Slip(delay=0.0, error=1e-4, period=1e-3), None)
    assert "5 ms only" in reason_of_delay(Slip(delay=0.0, error=5e-3, period=1e-3), None)
