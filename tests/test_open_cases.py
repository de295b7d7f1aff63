"""Cases in which an answer was wrong with confidence, by the independent generator of the evidence: what is said of each now."""

from __future__ import annotations

import importlib.util
import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from backdrive import Joint, Log, identify, read_log
from backdrive.identification.quality import grade

GENERATOR = Path(__file__).parents[1] / "benchmarks" / "evidence" / "_independent.py"


@pytest.fixture(scope="module")
def made():
    """The independent generator: numpy and numba alone."""
    name = "independent_generator"
    about = importlib.util.spec_from_file_location(name, GENERATOR)
    assert about is not None and about.loader is not None
    module = importlib.util.module_from_spec(about)
    sys.modules[name] = module  # dataclasses look it up
    about.loader.exec_module(module)
    yield module
    del sys.modules[name]


def to_log(record) -> Log:
    return Log(
        time=record.time,
        joints=(Joint(name="j", unit="rad"),),
        position=record.position[:, None],
        torque=record.torque[:, None],
    )


def runs(made, joint, speeds, rng, **logger):
    """One log a run there and back, steady."""
    whole = made.record(joint, made.trapezoids(speeds, 3.0, 0.3), made.Logger(**logger), rng)
    logs = []
    for k in range(2 * len(speeds)):
        a, b = np.searchsorted(whole.time, [3.2 * k + 0.8, 3.2 * k + 2.9])
        part = whole.rows(slice(int(a), int(b)))
        logs.append(replace(part, time=part.time - part.time[0]))
    return logs


def test_noise_of_the_encoder_is_no_stick_slip(made):
    rng = np.random.default_rng(1)
    joint = made.Joint()
    logs = runs(made, joint, np.linspace(0.3, 1.5, 5), rng, rate=500.0)
    noisy = [replace(r, position=r.position + 1e-3 * rng.standard_normal(r.time.size)) for r in logs]
    (friction,) = identify([to_log(r) for r in noisy]).model.joints
    assert friction.method == "constant-velocity"
    assert not any("did not keep their speed" in w for w in friction.warnings)
    jerky = [
        replace(r, position=r.position + 0.008 * np.sin(40.0 * r.time)) for r in noisy
    ]  # truly stick-slip
    (friction,) = identify([to_log(r) for r in jerky], method="constant-velocity").model.joints
    assert any("did not keep their speed" in w for w in friction.warnings)


@pytest.mark.parametrize("center", [0.0, 0.9])
def test_gravity_is_tried_before_directions(made, center):
    rng = np.random.default_rng(2)
    joint = made.Joint(gravity=(4.0, 1.0))
    t = np.arange(200_000) * made.STEP
    lead = np.clip(t, 0.0, 1.0)
    q = center + 0.22 * np.sin(2.1 * t) * lead * lead * (3.0 - 2.0 * lead)
    record = made.record(joint, q, made.Logger(rate=500.0, noise=0.03), rng)
    result = identify(to_log(record), law="coulomb-viscous")
    (friction,) = result.model.joints
    assert "gravity_sin" in friction.dynamics
    rate: Any = friction.law.rate
    assert rate.coulomb_positive == rate.coulomb_negative == pytest.approx(1.5, rel=0.03)


def test_torque_late_but_found_is_remarked_not_graded(made):
    rng = np.random.default_rng(3)
    for late in (0.02, 0.05):
        record = made.record(made.Joint(), made.multisine(30.0, 2.0, rng), made.Logger(late=late), rng)
        (friction,) = identify(to_log(record), accept=("time-slip",)).model.joints
        assert friction.dynamics["time_slip"].value == pytest.approx(late, abs=1e-3)
        assert grade(friction).level == "good"
        told = [w for w in friction.warnings if "ms later than the motion" in w]
        assert len(told) == 1 and not any("Torque comes about" in w for w in friction.warnings)


def test_trapezoids_at_100_hz_keep_their_coulomb_friction(made):
    for seed in range(3):
        rng = np.random.default_rng(seed)
        joint = made.Joint(inertia=0.35, coulomb=2.1, viscous=0.35, offset=-0.1)
        motion = made.trapezoids(2.1 * np.arange(1, 7) / 6.0, 1.2, 0.2)
        record = made.record(joint, motion, made.Logger(rate=100.0, noise=0.08), rng)
        (friction,) = identify(to_log(record)).model.joints
        speeds = np.array([0.7, 1.3, 1.9])
        assert friction.law.torque(speeds) == pytest.approx(joint.sliding(speeds), rel=0.03)


@pytest.mark.parametrize("kind", ["sines", "sweeps", "runs"])
def test_a_lerobot_folder_with_several_episodes_is_one_identification(made, tmp_path, kind):
    pa, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    rng = np.random.default_rng(4)
    joint, logger = made.Joint(gravity=(2.0, 0.5), offset=0.1), made.Logger(rate=200.0, noise=0.03)
    if kind == "runs":
        records = runs(made, joint, np.linspace(0.3, 1.8, 6), rng, rate=200.0, noise=0.03)
    elif kind == "sweeps":
        records = [made.record(joint, made.sweep(c, 0.4, 1.5, 8), logger, rng) for c in (-1.2, 0.0, 1.2)]
    else:
        records = [made.record(joint, made.multisine(12.0, 2.0, rng), logger, rng) for _ in range(3)]
    (tmp_path / "meta").mkdir()
    (tmp_path / "data" / "chunk-000").mkdir(parents=True)
    for k, r in enumerate(records):
        content = {
            "observation.state": r.position.tolist(),
            "observation.effort": r.torque.tolist(),
            "timestamp": r.time - r.time[0],
            "frame_index": np.arange(r.time.size),
            "episode_index": np.full(r.time.size, k),
        }
        parquet.write_table(pa.table(content), tmp_path / "data" / "chunk-000" / f"episode_{k:06d}.parquet")
    features = {
        name: {"dtype": "float32", "names": ["j"]} for name in ("observation.state", "observation.effort")
    }
    (tmp_path / "meta" / "info.json").write_text(
        json.dumps({"codebase_version": "v2.1", "fps": 200, "features": features})
    )
    (friction,) = identify(read_log(str(tmp_path))).model.joints
    speeds = np.array([0.5, 0.9, 1.3])
    assert friction.law.torque(speeds) == pytest.approx(joint.sliding(speeds), rel=0.05)
    told = bool(friction.standard_errors)  # six moves tell no error
    assert told is (kind != "runs") and grade(friction).level == ("good" if told else "care")


def test_friction_that_follows_the_load_is_said_from_one_center(made):
    rng = np.random.default_rng(5)
    joint = made.Joint(gravity=(6.0, 2.0), load_growth=0.15)
    record = made.record(joint, made.sweep(0.9, 0.7, 1.5, 10), made.Logger(rate=500.0, noise=0.03), rng)
    (friction,) = identify(to_log(record)).model.joints
    assert grade(friction).level != "good" or any("load" in w for w in friction.warnings)
    plain = replace(joint, load_growth=0.0)
    record = made.record(plain, made.sweep(0.9, 0.7, 1.5, 10), made.Logger(rate=500.0, noise=0.03), rng)
    (friction,) = identify(to_log(record)).model.joints
    assert not any("depends on the load" in w for w in friction.warnings)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_sampled_torque_is_not_taken_for_a_command_by_its_reversals(made, seed):
    """The instant at which stiff friction changes sign was taken for half an interval, without any error."""
    rng = np.random.default_rng(seed)
    joint = made.Joint(inertia=0.155, coulomb=0.99, viscous=0.246, offset=0.05, width=1.06e-4)
    logger = made.Logger(rate=200.0, noise=0.058, counts=2.0**20)
    records = [made.record(joint, made.sweep(c, 0.3, 1.6, 6), logger, rng) for c in (-1.588, -0.388, 0.812)]
    (friction,) = identify([to_log(r) for r in records], method="sweep").model.joints
    slip = friction.dynamics["time_slip"]
    assert abs(slip.value) < 3.0 * slip.standard_error + 0.25 / logger.rate
    speeds = np.array([0.4, 1.4])
    slow, fast = 0.5 * (friction.law.torque(speeds) - friction.law.torque(-speeds))
    assert (fast - slow) / np.diff(speeds)[0] == pytest.approx(joint.viscous, rel=0.1)


@pytest.mark.parametrize(("width", "warming"), [(0.02, 0.0), (5e-4, -0.3)])
@pytest.mark.parametrize("seed", [0, 1])
def test_friction_that_builds_up_in_a_sweep_is_not_warming(made, width, warming, seed):
    rng = np.random.default_rng([7, seed])
    joint = made.Joint(width=width, warming=warming)
    record = made.record(joint, made.sweep(0.3, 0.35, 1.2, 10), made.Logger(rate=500.0, noise=0.08), rng)
    (friction,) = identify(to_log(record), method="sweep").model.joints
    assert any("Friction changes over the log" in w for w in friction.warnings) is bool(warming)
    assert not any("follows the position" in w for w in friction.warnings)


@pytest.mark.parametrize(("amplitude", "gravity"), [(0.2, (0.0, 0.0)), (0.5, (6.0, 2.0))])
def test_a_drift_in_a_sweep_is_not_cogging(made, amplitude, gravity):
    """Cycles grow faster one by one, so a curve of the speed takes up a part of the drift; the rest looked like a wave."""
    rng = np.random.default_rng(8)
    joint = made.Joint(gravity=gravity)
    record = made.record(joint, made.sweep(0.3, amplitude, 1.2, 10), made.Logger(rate=500.0, noise=0.08), rng)
    drift = 2.0 * np.linspace(0.0, 1.0, record.time.size)
    (friction,) = identify(to_log(replace(record, torque=record.torque + drift)), method="sweep").model.joints
    (said,) = [w for w in friction.warnings if "drifts over the log" in w]
    assert float(said.split("by ")[1].split()[0]) == pytest.approx(2.0, rel=0.2)
    assert not any("cogging" in w for w in friction.warnings)


def test_a_law_with_load_is_advised_where_the_log_holds_a_load_that_varies(made):
    rng = np.random.default_rng(9)
    joint = made.Joint(gravity=(6.0, 2.0), load_growth=0.15)
    record = made.record(joint, made.multisine(20.0, 1.5, rng), made.Logger(rate=250.0), rng)
    held = joint.gravity[0] * np.sin(record.position) + joint.gravity[1] * np.cos(record.position)
    said = {}
    for name, load in (("none", None), ("constant", np.full_like(held, 3.0)), ("held", held)):
        log = to_log(record)
        log = log if load is None else log.replace(load=load[:, None])
        (friction,) = identify(log, method="motion").model.joints
        (said[name],) = [w for w in friction.warnings if "depends on the load" in w]
    assert "--map load=COLUMN" in said["none"] and said["constant"] == said["none"]
    assert said["held"].endswith("use a law with load (--law m3).")


def test_friction_that_builds_up_is_not_called_a_load_where_none_varies(made):
    rng = np.random.default_rng([76, 7])
    joint = made.Joint(inertia=0.4, width=0.05)
    speeds = 1.5 * np.arange(1, 7) / 6.0
    record = made.record(joint, made.trapezoids(speeds, 1.2, 0.2), made.Logger(rate=500.0), rng)
    (friction,) = identify(to_log(record), method="motion").model.joints
    assert not any("--law m3" in w or "depends on the load" in w for w in friction.warnings)
