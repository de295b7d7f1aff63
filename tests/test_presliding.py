import numpy as np
import pytest

from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.identification.presliding import identify_ramp
from backdrive.identification.ramp import presliding
from backdrive.logs.log import Joint, Log
from backdrive.model import FrictionModel, load_model
from backdrive.plans import TorqueRamp
from backdrive.report.entries import entries
from backdrive.report.words import term
from backdrive.simulation.machines import joint_0, setup_a
from backdrive.simulation.open_loop import simulate

JOINT_0 = joint_0(compliant=True).replace(friction_side="load")


def ramp_log(torque, position, count=None, rate=1000.0):
    joint = Joint(name="a", encoder_counts=None if count is None else 1 / count)
    return Log(time=np.arange(len(torque)) / rate, joints=(joint,), position=position, torque=torque)


def triangle(peak, cycles=2, n=1000):
    quarter = np.linspace(0.0, peak, n, endpoint=False)
    one = np.concatenate([quarter, peak - quarter, -quarter, quarter - peak])
    return np.concatenate([np.zeros(300), np.tile(one, cycles), np.zeros(2)])


def test_joint_0_yields_by_its_transmission_and_breaks_away_at_its_coulomb_torque():
    log = simulate(JOINT_0, TorqueRamp(9.0, 2.0))
    friction, evidence = identify_ramp([log], "joint_0")
    stiffness = friction.dynamics["presliding_stiffness"]
    assert stiffness.value == pytest.approx(1e5, rel=2e-3)
    assert abs(stiffness.value - 1e5) < 4 * stiffness.standard_error < 2e3
    assert stiffness.unit == "N.m/rad"
    law, errors = friction.law.rate, friction.standard_errors
    for side in ("coulomb_positive", "coulomb_negative"):
        assert getattr(law, side) == pytest.approx(6.85, abs=0.03)
        assert abs(getattr(law, side) - 6.85) < 3 * errors[side] < 0.2
    assert friction.warnings == ()
    assert friction.at_bound == ()
    assert evidence.presliding.shape[1] == 2
    assert np.abs(evidence.presliding[:, 1]).max() == pytest.approx(9.0, abs=0.01)
    assert "It begins to slip (breaks away) at 6.85 N.m along +q and 6.85 N.m along -q" in evidence.verdict


def test_setup_a_hides_its_presliding_below_one_count():
    log = simulate(setup_a(), TorqueRamp(20.0, 4.0, unit="m"))
    friction, evidence = identify_ramp([log], "setup_a")
    assert friction.law.rate.coulomb_positive == pytest.approx(12.0, abs=0.15)
    assert friction.law.rate.coulomb_negative == pytest.approx(8.0, abs=0.15)
    bound = friction.dynamics["presliding_stiffness_bound"]
    assert bound.unit == "N/m"
    assert 1.2e6 < bound.value < 2.4e6  # the true stiffness is 2.4e6
    assert "presliding_stiffness" not in friction.dynamics
    assert any("below the encoder's resolution" in w for w in friction.warnings)
    assert "at least 1.79e+06 N/m" in evidence.verdict


def test_no_motion_up_to_6_newton_at_5_micrometres_is_the_thesis_stiffness():
    torque = np.concatenate([np.zeros(200), np.linspace(0.0, 6.0, 3000)])
    found = presliding([ramp_log(torque, np.zeros(torque.size), count=5e-6)], 0)
    assert not found.is_resolved
    assert found.bound == pytest.approx(1.2e6, rel=2e-3)


def test_a_bound_counts_one_more_count_than_was_seen():
    torque = np.linspace(0.0, 8.0, 4000)
    position = 1e-6 * np.floor(torque / 2.0)  # truly between 2e6 and, seen from here, anything above
    found = presliding([ramp_log(torque, position, count=1e-6)], 0)
    assert found.bound == pytest.approx(2e6, rel=1e-2)


def test_below_break_away_the_friction_is_only_bounded():
    log = simulate(JOINT_0, TorqueRamp(5.0, 2.0))
    friction, evidence = identify_ramp([log], "joint_0")
    assert friction.at_bound == ("coulomb_positive", "coulomb_negative")
    assert friction.law.rate.coulomb_positive == pytest.approx(5.0, abs=0.01)
    assert sum("did not break away" in w for w in friction.warnings) == 2
    assert "more than 5 N.m along +q" in evidence.verdict
    assert friction.dynamics["presliding_stiffness"].value == pytest.approx(1e5, rel=5e-3)
    assert friction.dynamics["hysteresis_width"].value < 1e-6


def test_a_hysteresis_loop_has_the_width_and_area_of_its_spring_and_slider():
    """u = k1 x + clip(k2 (x - s), -F, F): the loop of amplitude X loses 4 F (X - F / k2)."""
    k1, k2, F, X = 2e4, 8e4, 1.0, 1e-4
    x = triangle(X)
    slider, force = 0.0, np.zeros(x.size)
    for i, value in enumerate(x):
        force[i] = np.clip(k2 * (value - slider), -F, F)
        slider = value - force[i] / k2
    found = presliding([ramp_log(k1 * x + force, x, count=1e-8)], 0)
    assert found.area == pytest.approx(4 * F * (X - F / k2), rel=0.02)
    assert found.width == pytest.approx(2 * F / k1, rel=0.02)
    assert found.tangent[0] == pytest.approx(k1 + k2, rel=0.02)
    assert found.stiffness[0] < 0.7 * (k1 + k2)
    assert found.break_away == (None, None)


def test_the_encoder_s_step_is_read_off_the_positions():
    torque = triangle(5.0)
    log = ramp_log(torque, 1e-6 * np.round(torque / 1e5 / 1e-6))
    found = presliding([log], 0)
    assert found.count == pytest.approx(1e-6)
    assert found.stiffness[0] == pytest.approx(1e5, rel=5e-3)
    noisy = ramp_log(torque, torque / 1e5 + 2e-7 * np.random.default_rng(0).standard_normal(torque.size))
    assert presliding([noisy], 0).count == pytest.approx(3 * 2e-7, rel=0.1)


def test_torque_noise_shifts_the_break_away_by_no_more_than_itself():
    log = simulate(JOINT_0.replace(torque_noise=0.1), TorqueRamp(9.0, 2.0), seed=2)
    friction, _ = identify_ramp([log], "joint_0")
    assert friction.law.rate.coulomb_positive == pytest.approx(6.85, abs=0.2)
    assert friction.dynamics["presliding_stiffness"].value == pytest.approx(1e5, rel=1e-2)


def test_a_torque_held_before_the_ramp_is_named():
    log = simulate(JOINT_0, TorqueRamp(9.0, 2.0, offset=1.0))
    friction, _ = identify_ramp([log], "joint_0")
    law = friction.law.rate
    assert friction.dynamics["offset"].value == pytest.approx(1.0, abs=1e-6)
    assert law.coulomb_positive + 1.0 == pytest.approx(6.85, abs=0.05)
    assert law.coulomb_negative - 1.0 == pytest.approx(6.85, abs=0.05)
    assert any("taken for gravity or offset" in w for w in friction.warnings)


def test_several_ramps_are_one_result():
    logs = [simulate(JOINT_0.replace(torque_noise=0.05), TorqueRamp(9.0, 2.0, 1), seed=s) for s in range(3)]
    together, _ = identify_ramp(logs, "joint_0")
    assert together.dynamics["presliding_stiffness"].value == pytest.approx(1e5, rel=5e-3)


def test_bad_input_is_named():
    log = simulate(JOINT_0, TorqueRamp(5.0, 5.0, 1))
    with pytest.raises(InvalidInput, match="no log"):
        identify_ramp([], "a")
    with pytest.raises(InvalidInput, match="torque and position"):
        identify_ramp([log.replace(torque=None)], "joint_0")
    with pytest.raises(NotIdentifiable, match="ramps and the joint sticks"):
        identify_ramp([log.replace(torque=np.zeros(len(log)))], "joint_0")


def test_a_model_of_ramps_with_noise_is_saved_and_loaded(tmp_path):
    log = simulate(JOINT_0, TorqueRamp(9.0, 2.0))
    noise = 0.01 * np.random.default_rng(1).standard_normal(len(log))
    friction, _ = identify_ramp([log.replace(torque=log.torque + noise[:, None])], "joint_0")
    assert all(type(value) is float for value in (*friction.validity.load, *friction.validity.velocity))
    FrictionModel(joints=(friction,)).save(tmp_path / "m.json")
    assert load_model(tmp_path / "m.json").joints[0].validity == friction.validity


def test_the_onset_of_slip_is_not_called_coulomb_friction():
    friction, _ = identify_ramp([simulate(JOINT_0, TorqueRamp(9.0, 2.0))], "joint_0")
    names = [entry.name for entry in entries(friction, knots=False)]
    assert any(name.startswith("onset of slip") for name in names)
    assert not any("Coulomb" in name for name in names)
    assert {term(name) for name in friction.dynamics} >= {
        "presliding stiffness, secant up to the slip",
        "presliding stiffness, where a branch begins",
    }
