"""Tests for health/: every check finds what is planted, where it is planted, says a remedy, and leaves clean logs alone."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from _synthetic import any_motion, constant_runs
from backdrive import Joint, Log, check
from backdrive.errors import UnhealthyLog, UnknownName
from backdrive.logs.health import CHECKS, gate


def dry(v):
    return 5.0 * np.sign(v) + 2.0 * v


def clean(seed=0, **options) -> Log:
    log = any_motion(dry, seconds=20.0, seed=seed, **options)
    return log.replace(velocity=np.gradient(log.position, log.time, axis=0))


def changed(channel, change) -> Log:
    log = clean()
    values = getattr(log, channel).copy()
    change(values)
    return log.replace(**{channel: values})


def put(index, value):
    def change(values):
        values[index] = value

    return change


def moved_time(log: Log) -> Log:
    order = np.arange(len(log))
    order[300:320] = order[300:320][::-1]
    return log.rows(order)


def wrapped(log: Log) -> Log:
    return log.replace(position=np.mod(log.position * 4.0, 2 * np.pi), velocity=log.velocity * 4.0)


PLANTED = {
    "nan": lambda: changed("torque", put(100, np.nan)),
    "infinite": lambda: changed("position", put(100, np.inf)),
    "unsorted-time": lambda: moved_time(clean()),
    "repeated-time": lambda: clean().rows(np.r_[0:500, 499, 500:10000]),
    "gaps": lambda: clean().rows(np.r_[0:4000, 4200:10000]),
    "jitter": lambda: clean().replace(
        time=clean().time + 0.0009 * np.random.default_rng(0).uniform(-1, 1, len(clean()))
    ),
    "outlier": lambda: changed("torque", put(3000, 60.0)),
    "encoder-wrap": lambda: wrapped(clean()),
    "degrees": lambda: clean().replace(position=np.rad2deg(clean().position)),
    "stuck": lambda: changed("torque", put(slice(2000, 2600), 3.21)),
    "position-jump": lambda: changed("position", put(slice(5000, None), clean().position[5000:] + 0.5)),
    "silent-torque": lambda: clean().replace(torque=np.zeros((len(clean()), 1))),
    "torque-sign": lambda: clean().replace(torque=-clean().torque),
    "velocity-mismatch": lambda: clean().replace(velocity=-clean().velocity),
    "no-motion": lambda: clean().replace(
        position=np.full((len(clean()), 1), 0.3), velocity=np.zeros((len(clean()), 1))
    ),
    "few-samples": lambda: clean().rows(slice(0, 3)),
    "saturation": lambda: clean().replace(torque=np.clip(clean().torque, -5.5, 5.5)),
    "integer-wrap": lambda: clean().replace(torque=np.mod(np.rint(clean().torque * 100), 65536) / 100),
    "time-slip": lambda: clean(inertia=5.0).replace(torque=np.roll(clean(inertia=5.0).torque, 12, axis=0)),
}


@pytest.mark.parametrize("name", PLANTED)
def test_a_planted_fault_is_found_and_explained(name):
    found = {f.name: f for f in check(PLANTED[name]())}
    assert name in found, sorted(found)
    finding = found[name]
    assert len(finding.sentence) > 20
    assert len(finding.remedy) > 10
    assert finding.severity in ("note", "warn", "spoils")


def test_every_check_has_a_name_of_its_own_and_most_are_planted_above():
    names = [c.name for c in CHECKS]
    assert len(set(names)) == len(names)
    assert set(PLANTED) <= set(names)
    assert set(names) - set(PLANTED) <= {"no-friction", "plan-mismatch"}


@pytest.mark.parametrize("seed", range(5))
def test_clean_motion_is_clean(seed):
    assert [f.sentence for f in check(clean(seed, phase=7.0 * seed)) if f.severity != "note"] == []


def test_clean_constant_runs_are_clean():
    for log in constant_runs(dry, (0.2, 1.0)):
        assert [f.sentence for f in check(log) if f.severity != "note"] == []


@pytest.mark.parametrize(("channel", "row"), [("torque", 100), ("position", 7000)])
def test_the_place_is_named(channel, row):
    (finding,) = [f for f in check(changed(channel, put(row, np.nan))) if f.name == "nan"]
    assert row in finding.where


def test_repairs_bring_the_truth_back():
    truth = clean()
    wrapped_log = truth.replace(
        position=np.mod(truth.position * 4.0, 2 * np.pi), velocity=truth.velocity * 4.0
    )
    mended = gate(wrapped_log, repair=True)
    shift = mended.position - 4.0 * truth.position
    np.testing.assert_allclose(shift, shift[0, 0], atol=1e-9)
    mended = gate(truth.replace(torque=-truth.torque), repair=True)
    np.testing.assert_allclose(mended.torque, truth.torque)
    mended = gate(moved_time(truth), repair=True)
    np.testing.assert_allclose(mended.position, truth.position)
    assert mended.notes


def test_the_gate_stops_names_and_lets_accepted_pass():
    spoiled = changed("torque", put(100, np.nan))
    with pytest.raises(UnhealthyLog, match=r"\[nan\].*accept=\"nan\""):
        gate(spoiled)
    accepted = gate(spoiled, accept=["nan"])
    assert any("nan" in note for note in accepted.notes)
    with pytest.raises(UnknownName, match="torque-sign"):
        gate(clean(), accept=["torque-sine"])
    assert gate(clean()).notes == ()


@settings(max_examples=40, deadline=None)
@given(
    values=st.lists(st.floats(allow_nan=True, allow_infinity=True, width=32), min_size=0, max_size=60),
    period=st.floats(1e-6, 10.0),
)
def test_no_log_whatever_breaks_a_check(values, period):
    n = len(values)
    log = Log(
        time=period * np.arange(n),
        joints=(Joint(name="j"),),
        position=np.array(values).reshape(n, 1),
        torque=np.array(values[::-1]).reshape(n, 1),
    )
    for finding in check(log):
        assert finding.sentence


def two_joints(sign: float) -> Log:
    a, b = clean(1), clean(2, phase=3.0)
    return Log(
        time=a.time,
        joints=(Joint(name="a"), Joint(name="b")),
        position=np.hstack([a.position, b.position]),
        velocity=np.hstack([a.velocity, b.velocity]),
        torque=sign * np.hstack([a.torque, b.torque]),
    )


def test_a_fault_is_named_on_its_joint_alone():
    log = two_joints(1.0)
    torque = log.torque.copy()
    torque[:, 1] *= -1
    assert [(f.name, f.joint) for f in check(log.replace(torque=torque))] == [("torque-sign", "b")]
    assert {f.joint for f in check(two_joints(-1.0)) if f.name == "torque-sign"} == {"a", "b"}


def unsigned(values, bits, scale):
    """Read signed whole numbers as unsigned ones, in some unit."""
    counts = np.rint(values / scale).astype(np.int64)
    return (counts % 2**bits) * scale


@settings(max_examples=25, deadline=None)
@given(bits=st.sampled_from([16, 32]), scale=st.floats(1e-3, 0.05), seed=st.integers(0, 50))
def test_integers_of_a_wrong_type_come_back_exactly(bits, scale, seed):
    truth = clean(seed)
    expected = np.rint(truth.torque / scale) * scale
    wrong = truth.replace(torque=unsigned(truth.torque, bits, scale))
    names = {f.name for f in check(wrong) if f.severity != "note"}
    assert names == {"integer-wrap"}
    np.testing.assert_allclose(gate(wrong, repair=True).torque, expected, atol=1e-6)


def test_a_wrap_that_was_interpolated_loses_only_the_samples_between():
    truth = clean()
    raw = unsigned(truth.torque, 16, 0.01) / 0.01
    resampled = np.interp(truth.time[:-1] + 0.0007, truth.time, raw[:, 0])
    expected = np.interp(truth.time[:-1] + 0.0007, truth.time, np.rint(truth.torque[:, 0] / 0.01))
    wrong = truth.rows(slice(None, -1)).replace(torque=resampled)
    mended = gate(wrong, repair=True)
    assert 0.9 * len(wrong) < len(mended) < len(wrong)
    at = np.searchsorted(wrong.time, mended.time)
    np.testing.assert_allclose(mended.torque[:, 0], expected[at], atol=1e-6)


@settings(max_examples=25, deadline=None)
@given(row=st.integers(0, 9999), size=st.floats(60.0, 1e6), up=st.booleans())
def test_one_wild_sample_is_found_wherever_it_is_and_replaced(row, size, up):
    truth = clean()
    spoiled = changed("torque", put(row, truth.torque[row] + (size if up else -size)))
    (finding,) = [f for f in check(spoiled) if f.severity != "note"]
    assert finding.name == "outlier"
    assert finding.where.tolist() == [row]
    mended = gate(spoiled, repair=True)
    assert np.abs(mended.torque).max() < 1.5 * np.abs(truth.torque).max()


def test_gaps_jitter_and_saturation_warn_but_do_not_stop():
    for name in ("gaps", "jitter", "saturation"):
        assert {f.severity for f in check(PLANTED[name]()) if f.name == name} == {"warn"}
        gate(PLANTED[name]())


def test_two_runs_on_one_clock_are_not_interleaved():
    truth = clean()
    restarted = truth.replace(time=np.concatenate([truth.time[:6000], truth.time[:4000]]))
    (finding,) = [f for f in check(restarted) if f.name == "unsorted-time"]
    assert finding.where.tolist() == [6000]
    mended = gate(restarted, accept=["position-jump"], repair=True)
    assert np.all(np.diff(mended.time) > 0)
    np.testing.assert_allclose(mended.position, truth.position)


def test_a_shifted_torque_is_shifted_back():
    truth = clean(inertia=5.0)
    late = truth.replace(torque=np.roll(truth.torque, 12, axis=0)).rows(slice(12, None))
    (finding,) = [f for f in check(late) if f.name == "time-slip"]
    assert finding.value == pytest.approx(12.0, abs=1.0)
    mended = gate(late, repair=True)
    row = np.searchsorted(truth.time, mended.time[0] - 1e-9)
    shift = 12 - round(finding.value)
    expected = truth.torque[row - shift : row - shift + len(mended)]
    np.testing.assert_allclose(mended.torque, expected)


def test_frozen_samples_are_dropped_and_nothing_else():
    spoiled = PLANTED["stuck"]()
    mended = gate(spoiled, repair=True)
    assert len(mended) == len(spoiled) - 599  # the first of the 600 is a value that was measured
    assert not np.any(np.isin(mended.time, spoiled.time[2001:2600]))


def test_a_small_stroke_in_degrees_is_told_by_its_speed():
    t = np.arange(5000) * 1e-3
    q = np.deg2rad(10.0) * np.sin(2.0 * np.pi * 1.6 * t)
    tau = np.sign(np.gradient(q)) + 0.1 * np.sin(7.0 * t)
    right, wrong = (Log.from_arrays(time=t, position=x, torque=tau) for x in (q, np.rad2deg(q)))
    assert "degrees" not in {one.name for one in check(right)}
    (found,) = [one for one in check(wrong) if one.name == "degrees"]
    assert found.severity == "warn"
    assert "moves at 100" in found.sentence


def test_degrees_become_radians_again():
    truth = clean()
    mended = gate(PLANTED["degrees"](), repair=True)
    np.testing.assert_allclose(mended.position, truth.position, atol=1e-12)
    assert any("divided by 57.2958" in note for note in mended.notes)


def test_a_channel_of_nothing_but_nan_is_left_out_where_another_replaces_it():
    truth = clean()
    empty = truth.replace(velocity=np.full_like(truth.velocity, np.nan))
    mended = gate(empty, repair=True)
    assert mended.velocity is None
    assert len(mended) == len(truth)
    with pytest.raises(UnhealthyLog):
        gate(truth.replace(torque=np.full_like(truth.torque, np.nan)), repair=True)


def test_a_plan_that_was_not_run_is_named():
    class Plan:
        stroke = 10.0
        duration = 60.0

    named = [f for f in check(clean(), plan=Plan()) if f.name == "plan-mismatch"]
    assert {f.severity for f in named} == {"warn"}
    assert len(named) == 2


def test_a_torque_computed_without_friction_is_remarked():
    log = any_motion(lambda v: 0.0 * v, seconds=20.0, inertia=2.0)
    (found,) = [f for f in check(log) if f.name == "no-friction"]
    assert found.severity == "note" and "spring" not in found.sentence and "computed" in found.remedy


def test_ramps_of_a_joint_that_sticks_are_not_called_useless():
    time = np.arange(12000) / 250.0
    torque = 2.0 * np.sin(0.5 * time)
    noise = 0.01 * np.random.default_rng(3).standard_normal(time.size)
    log = Log(time=time, joints=(Joint(name="j1"),), position=torque / 1500.0, torque=torque + noise)
    (found,) = [f for f in check(log) if f.name == "no-friction"]
    assert "like a spring of 1.5e+03 N.m/rad" in found.sentence and "--method ramp" in found.remedy


real = pytest.mark.skipif("BACKDRIVE_DATA" not in os.environ, reason="real logs are absent")


def ur3(name: str) -> Log:
    from backdrive.logs.readers import read_log

    path = Path(os.environ["BACKDRIVE_DATA"]) / "ur3" / name
    return read_log(path, map="t=mt,q=mq,dq=mdq,tau=mtorque")


@real
@pytest.mark.parametrize("name", ["id1.mat", "id2.mat"])
def test_the_ur3_logs_have_all_six_efforts_inverted_and_no_other_fault(name):
    found = [f for f in check(ur3(name)) if f.severity != "note"]
    assert {f.name for f in found} == {"torque-sign"}
    assert len(found) == 6


@real
def test_the_servo_loads_are_unsigned_wherever_they_go_negative():
    wrapped_files = 0
    for path in sorted((Path(os.environ["BACKDRIVE_DATA"]) / "bam_xl330" / "raw").glob("*.json")):
        entries = json.loads(path.read_text())["entries"]
        channels = {
            k: np.array([e[k] for e in entries], float) for k in ("timestamp", "position", "speed", "load")
        }
        log = Log(
            time=channels["timestamp"],
            joints=(Joint(name="servo"),),
            position=channels["position"],
            velocity=channels["speed"],
            drive_input=channels["load"],
        )
        spoils = [f for f in check(log) if f.severity == "spoils"]
        expected = channels["load"] > 32767
        wrapped_files += bool(expected.any())
        assert [f.name for f in spoils] == ["integer-wrap"] * bool(expected.any())
        if spoils:
            np.testing.assert_array_equal(spoils[0].where, np.flatnonzero(expected))
            assert np.abs(gate(log, repair=True).drive_input).max() <= 885
    assert wrapped_files == 12


def test_the_how_to_lists_every_check():
    from pathlib import Path

    text = (Path(__file__).resolve().parent.parent / "docs" / "how-to" / "suspect-a-log.md").read_text()
    missing = [c.name for c in CHECKS if f"| `{c.name}` | {c.about} |" not in text]
    assert not missing
