"""A log without positions: gravity along the integrated velocity keeps the inertia right, and is no part of the model."""

import re

import numpy as np
import pytest

from _sines import RATE, sines
from backdrive import Joint, Log, identify
from backdrive.identification import validate
from backdrive.identification.path import PAUSE, along_path, without_gravity
from backdrive.identification.signals import prepare

WEIGHT = np.array([3.0, -2.0])  # of sin q and cos q


def log(seed=0, *, seen=("velocity",), weight=WEIGHT, unit="rad", keep=slice(None), known=False):
    """Return a log under Coulomb and viscous friction and gravity, with the channels that are seen."""
    rng = np.random.default_rng(100 + seed)
    t, q, v, a = sines(np.random.default_rng(seed), 20.0)
    pull = weight @ np.stack([np.sin(q), np.cos(q)])
    tau = 0.5 * a + 1.5 * np.sign(v) + 0.8 * v + pull + 0.05 * rng.standard_normal(t.size)
    motion = {"position": q, "velocity": v}
    more = {"model_torque": pull[keep]} if known else {}
    joints = (Joint(name="j", unit=unit),)
    return Log(time=t[keep], joints=joints, torque=tau[keep], **{k: motion[k][keep] for k in seen}, **more)


@pytest.mark.parametrize("seed", range(3))
def test_gravity_does_not_spoil_the_inertia_of_a_log_without_positions(seed):
    result = identify(log(seed), method="motion")
    one, of = result.model.joints[0], result.evidence[0]
    inertia = one.dynamics["inertia"]
    assert inertia.value == pytest.approx(0.5, abs=4.0 * inertia.standard_error)
    assert inertia.standard_error < 2e-3
    assert one.law.torque([-1.0, 1.0]) == pytest.approx([-2.3, 2.3], rel=0.01)
    assert one.verdict.grade == "care"
    size = float(re.search(r"no position: gravity of up to ([\d.]+) N\.m", one.warnings[0])[1])
    assert size == pytest.approx(np.hypot(*WEIGHT), rel=0.01) and of.unplaced == pytest.approx(size, rel=0.01)
    errors = one.covariance.standard_errors()
    assert errors["inertia"] == pytest.approx(inertia.standard_error)
    assert not {"gravity_sin", "gravity_cos"} & {*one.dynamics, *errors}


def test_the_model_says_how_far_off_it_is_without_gravity():
    """Its offset is gravity's mean, and its bands hold what it does not predict."""
    given = log()
    result = identify(given, method="motion")
    one = result.model.joints[0]
    pull = WEIGHT @ np.stack([np.sin(q := sines(np.random.default_rng(0), 20.0)[1]), np.cos(q)])
    assert one.dynamics["offset"].value == pytest.approx(pull.mean(), abs=0.05)
    assert np.isnan(one.dynamics["offset"].standard_error)
    spread = np.quantile(np.abs(pull - pull.mean()), 0.95)
    assert one.bands.moving.half_width == pytest.approx(spread, rel=0.1)
    assert validate(result.model, [given])["j"].rms == pytest.approx(pull.std(), rel=0.1)
    assert "counts gravity along the integrated velocity" in result.evidence[0].verdict
    assert result.evidence[0].residual is not None and one.held_out.residual < 1.0  # %


def test_with_positions_and_without_gravity_nothing_is_left_out():
    seen = identify(log(seen=("position",)), method="motion")
    assert [seen.model.joints[0].dynamics[k].value for k in ("gravity_sin", "gravity_cos")] == pytest.approx(
        WEIGHT, rel=0.02
    )
    level = identify(log(weight=0.0 * WEIGHT), method="motion")
    for result in (seen, level):
        assert "no position" not in " ".join(result.model.joints[0].warnings)
        assert result.evidence[0].unplaced == 0.0
    one, of = level.model.joints[0], level.evidence[0]
    assert without_gravity(one, of, prepare(log(), "j")) == (one, of)


def test_a_path_is_the_motion_from_where_the_log_began():
    q = prepare(log(seen=("position", "velocity")), "j")[0].position
    gap = np.delete(np.arange(20000), np.arange(8000, 8000 + round(0.5 * PAUSE * RATE)))
    first, second = along_path(prepare(log(keep=gap), "j"), True)
    assert first.position == pytest.approx(q[:8000] - q[0], abs=2e-4)
    assert second.position == pytest.approx(q[8050:] - q[0], abs=2e-3)


@pytest.mark.parametrize("why", ["position", "another log or unit", "known torque", "long gap"])
def test_a_path_is_not_taken_where_it_is_not_needed_or_not_known(why):
    gap = np.delete(np.arange(20000), np.arange(8000, 8000 + round(2.0 * PAUSE * RATE)))
    made = {"position": {"seen": ("position",)}, "known torque": {"known": True}, "long gap": {"keep": gap}}
    stretches = prepare(log(**made.get(why, {})), "j")
    assert along_path(stretches, "another" not in why) == stretches


def test_several_logs_and_sliders_stay_as_they_were():
    for logs in ([log(0), log(1)], [log(unit="m")]):
        result = identify(logs, method="motion")
        assert "no position" not in " ".join(result.model.joints[0].warnings)
