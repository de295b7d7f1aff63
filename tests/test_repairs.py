"""Repairs are kept where unseen blocks are explained better with them, or where nothing can be identified without."""

import numpy as np
import pytest

from _commands import called
from _synthetic import any_motion
from backdrive import Joint, Log, identify
from backdrive.errors import UnhealthyLog
from backdrive.logs.health import check

FRICTION = 1.5


def sliding_log(seconds=20.0):
    """Return 10,000 samples of a joint at 500 Hz with Coulomb and viscous friction."""
    return any_motion(lambda v: FRICTION * np.sign(v) + 0.4 * v, seconds=seconds)


def lagging_log():
    """Return a clean log at 100 Hz of a slow joint under gravity, whose friction builds up over 25 mrad after each reversal.

    That lag in distance looks like 140 ms between torque and motion.
    """
    rate, n = 1000, 40_000
    t = np.arange(n) / rate
    q = 0.3 * np.sin(1.3 * t) + 0.12 * np.sin(3.7 * t + 1.0)
    v = np.gradient(q, t)
    bristle, friction = 0.0, np.zeros(n)
    for k in range(1, n):
        bristle = min(max(bristle + q[k] - q[k - 1], -0.025), 0.025)
        friction[k] = FRICTION * bristle / 0.025
    rng = np.random.default_rng(4)
    torque = 0.01 * np.gradient(v, t) + friction + 8.0 * np.sin(q) + 0.02 * rng.standard_normal(n)
    return Log(time=t[::10], joints=(Joint(name="a"),), position=np.round(q[::10], 5), torque=torque[::10])


def test_a_repair_that_helps_is_kept_and_said():
    late = sliding_log()
    late = late.replace(torque=np.roll(late.torque, 12, axis=0))
    with pytest.raises(UnhealthyLog, match="time-slip"):
        identify(late)
    result = identify(late, repair=True)
    assert any("was shifted by -12 samples" in note for note in result.notes)
    assert not any("undone" in w for w in result.warnings)
    assert result.model.joints[0].law.rate.values()["coulomb_positive"] == pytest.approx(FRICTION, rel=0.02)


def test_friction_that_lags_by_a_distance_is_no_late_torque():
    assert check(lagging_log()) == []


def test_a_repair_that_does_not_help_is_undone_and_said(tmp_path):
    log = sliding_log()
    late = log.replace(torque=np.roll(log.torque, 4, axis=0))  # the fit seeks a delay of 8 ms by itself
    assert [f.severity for f in check(late)] == ["warn"]
    result, plain = identify(late, repair=True), identify(late)
    (undone,) = [w for w in result.warnings if "[time-slip]" in w]
    assert "The repair was undone, for it does not help" in undone
    assert "% of held-out torque stays unexplained; without it" in undone
    assert not any("shifted" in note or "Accepted" in note for note in result.notes)
    assert result.model.joints[0].law == plain.model.joints[0].law
    np.savez(tmp_path / "late.npz", t=late.time, q=late.position, tau=late.torque)
    preview = called("inspect", tmp_path / "late.npz").stdout
    assert "--repair would do this:" in preview
    assert "The repair was undone" in preview
    assert "shifted by" not in preview
    assert "The repair was undone" in called("inspect", tmp_path / "late.npz", "--repair").stdout


def test_what_is_needed_is_repaired_though_the_residual_cannot_tell():
    log = sliding_log()
    torque = -np.array(log.torque)
    torque[2000] = np.nan
    result = identify(log.replace(torque=torque), repair=True)
    assert result.model.joints[0].law.rate.values()["coulomb_positive"] == pytest.approx(FRICTION, rel=0.02)
    assert not any("undone" in w for w in result.warnings)
