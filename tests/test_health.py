"""Tests for health/: every check finds what is planted, where it is planted, says a remedy, and leaves clean logs alone."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from _synthetic import any_motion, constant_runs
from backdrive import Joint, Log, check
from backdrive.errors import UnhealthyLog, UnknownName
from backdrive.health import CHECKS, gate


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
    with pytest.raises(UnhealthyLog, match=r"\[nan\].*--accept nan"):
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
