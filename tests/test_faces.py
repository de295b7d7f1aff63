"""The public face: arrays and frames in, models compared, simulated, tuned, looped; results that show themselves."""

from __future__ import annotations

import json
import pickle
import re
from dataclasses import replace

import numpy as np
import pytest

import backdrive
from backdrive import FrictionModel, Log, Sweep, compare, identify, simulate, tune
from backdrive.control.loop import Loop
from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.external import PayloadEstimate, estimate_force
from backdrive.external.gains import Gains
from backdrive.identification import validate
from backdrive.identification.result import Identification
from backdrive.laws import CoulombViscous, Law
from backdrive.plans import ArmPlan, InTurn, SineTorque
from backdrive.simulation.machines import machine

PLAN = Sweep(stroke=0.35, top_speed=2.0, cycles=6)


@pytest.fixture(scope="module")
def log() -> Log:
    return simulate(machine("joint_1").replace(torque_noise=1.0), PLAN, seed=0)


@pytest.fixture(scope="module")
def result(log) -> Identification:
    return identify(log)


@pytest.fixture(scope="module")
def model(result) -> FrictionModel:
    return result.model


def test_twenty_names_matter():
    assert len(dir(backdrive)) <= 20
    assert {"compare", "simulate", "tune"} <= set(dir(backdrive))
    assert callable(backdrive.fit_motion)
    assert backdrive.DriveModel.__name__ == "DriveModel"


def test_arrays_and_frames_are_logs(log, model):
    pandas, polars, pyarrow = (pytest.importorskip(name) for name in ("pandas", "polars", "pyarrow"))
    q, tau = log.position[:, 0], log.torque[:, 0]
    columns = {"time": log.time, "position": q, "torque": tau}
    logs = [
        Log.from_arrays(log.time, position=q, torque=tau, joints="elbow"),
        Log.from_arrays(rate=1000, position=q.tolist(), torque=log.torque, joints=["elbow"]),
        Log.from_frame(columns, names="elbow"),
        Log.from_frame(pandas.DataFrame(columns), names="elbow"),
        Log.from_frame(pandas.DataFrame(columns).set_index("time"), names="elbow"),
        Log.from_frame(polars.DataFrame(columns), names="elbow"),
        Log.from_frame(pyarrow.table(columns), names="elbow"),
        Log.from_frame(
            pandas.DataFrame({"t": log.time, "a": q, "b": 2.0 * tau}), map="q=a,tau=0.5*b", names="elbow"
        ),
    ]
    for one in logs:
        assert one.names == ("elbow",)
        np.testing.assert_allclose(one.time, log.time, atol=1e-9)
        np.testing.assert_array_equal(one.position, log.position)
        np.testing.assert_allclose(one.torque, log.torque, rtol=1e-12)
    assert identify(pandas.DataFrame(columns)).model.names == ("joint_1",)
    instants = pandas.DataFrame({"q": q, "tau": tau}, index=pandas.to_datetime(log.time, unit="s"))
    np.testing.assert_allclose(Log.from_frame(instants).time, log.time - log.time[0], atol=1e-8)
    assert "left out" in " ".join(Log.from_frame(pandas.DataFrame({**columns, "word": "x"})).notes)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({}, "no channels"),
        ({"position": [1.0, 2.0]}, "exactly one of"),
        ({"time": [0.0, 1.0], "rate": 1.0, "position": [1.0, 2.0]}, "exactly one of"),
        ({"rate": 0.0, "position": [1.0]}, "rate = 0.0 Hz"),
        ({"rate": "fast", "position": [1.0]}, "'fast'"),
        ({"rate": 1.0, "position": "abc"}, "is a str"),
        ({"rate": 1.0, "position": np.zeros((2, 2, 2))}, r"shape \(2, 2, 2\)"),
        ({"rate": 1.0, "position": [[1.0], [2.0, 3.0]]}, "cannot be taken"),
        ({"rate": 1.0, "position": [1.0], "foo": [1.0]}, "no channel 'foo'"),
        ({"rate": 1.0, "position": [1.0], "joints": ["a", "b"]}, "2 joints"),
        ({"rate": 1.0, "position": [1.0], "joints": [3]}, "A joint is 3"),
    ],
)
def test_what_is_no_log_is_said_in_our_words(arguments, words):
    with pytest.raises(InvalidInput, match=words):
        Log.from_arrays(**arguments)


@pytest.mark.parametrize("wrong", ["log.csv", 3, None, [1, 2], []])
def test_what_is_no_log_is_not_identified(wrong):
    with pytest.raises(InvalidInput, match="no log"):
        identify(wrong)
    with pytest.raises(InvalidInput, match=r"no table|no column"):
        Log.from_frame(wrong if wrong else 3)


def test_a_joint_is_named_by_a_string(log):
    plain = Log(time=log.time, joints=("elbow",), position=log.position, torque=log.torque)
    assert plain.names == ("elbow",)
    assert plain.joints[0].unit == "rad"


def test_whole_models_are_compared(model):
    same = compare(model, model)
    assert same.joints_with_change == ()
    assert same.is_testable
    friction = model.joints[0]
    rate = friction.law.rate
    stronger = replace(
        rate, positive=tuple(1.2 * x for x in rate.positive), negative=tuple(1.2 * x for x in rate.negative)
    )
    later = replace(model, joints=(replace(friction, law=Law(rate=stronger)),))
    changed = compare(model, later)
    assert changed.joints_with_change == ("joint_1",)
    assert changed.changes[0].mean == pytest.approx(0.2, abs=0.01)
    other = replace(later, joints=(replace(later.joints[0], joint=replace(friction.joint, name="elbow")),))
    assert compare(model, other, rename={"elbow": "joint_1"}).joints_with_change == ("joint_1",)
    assert compare(model, other, joints={"joint_1": "elbow"}).joints_with_change == ("elbow",)
    with pytest.raises(InvalidInput, match="no joint in common"):
        compare(model, other)
    nameless = [replace(friction, joint=replace(friction.joint, name=n, named=False)) for n in ("a", "b")]
    pair = replace(model, joints=tuple(nameless))
    with pytest.raises(InvalidInput, match=r"names are missing.*first: a, b; second: a, b"):
        compare(pair, pair)
    assert len(compare(pair, pair, joints=["a", "b"]).changes) == 2
    assert len(compare(pair, pair, rename={"a": "b", "b": "a"}).changes) == 2
    alone = replace(model, joints=(replace(friction, joint=replace(friction.joint, named=False)),))
    assert "taken as the same one" in compare(alone, alone).left_out[0]
    assert not compare(alone, alone, joints=["joint_1"]).left_out
    together = replace(pair, coupling=((1.0, 0.0), (0.5, 1.0)), coupled=())
    assert (
        "Motors drive several joints of the second model" in compare(pair, together, joints=["a"]).left_out[0]
    )
    assert not compare(together, together, joints=["a"]).left_out
    with pytest.raises(InvalidInput, match="A dict is no friction model"):
        compare(model, {})
    with pytest.raises(InvalidInput, match="no probability"):
        compare(model, model, alarm=2.0)


def test_a_model_is_simulated_as_it_was_identified(model):
    log = simulate(model, PLAN, inertia=0.3, seed=3)
    again = identify(log).model
    v = np.array([0.4, 1.0, 1.8])
    np.testing.assert_allclose(again.torque(0, v), model.torque(0, v), rtol=0.02)
    bare = replace(model, joints=(replace(model.joints[0], dynamics={}, actuator=None, covariance=None),))
    with pytest.raises(NotIdentifiable, match="inertia"):
        simulate(bare, PLAN)
    two = replace(
        model,
        joints=(model.joints[0], replace(model.joints[0], joint=replace(model.joints[0].joint, name="b"))),
    )
    with pytest.raises(InvalidInput, match="2 joints"):
        simulate(two, PLAN, inertia=0.3)
    assert simulate(two, PLAN, inertia=0.3, joint="b").names == ("b",)
    with pytest.raises(InvalidInput, match="An int is no friction model"):
        simulate(3, PLAN)


@pytest.fixture(scope="module")
def tuning(model):
    return tune(model, stiffness=1e5, inertia=0.3, counts=1e6, top_speed=3.0, joints=8, dither=False)


def test_a_tuned_loop_has_its_limits(model, tuning):
    loop = model.loop(tuning)
    assert isinstance(loop, Loop)
    assert loop.interval == tuning.interval
    assert loop.joints[0].limit == tuning.limit
    assert model.loop([tuning], limit={"joint_1": 1.0}).joints[0].limit == 1.0
    for wrong, words in (
        ({"tunings": []}, "needs tunings"),
        ({"tunings": [tuning, tuning]}, "one joint"),
        ({"tunings": replace(tuning, joint="other")}, "of joint 'other'"),
        ({"tunings": tuning, "period": 2e-3}, "not 0.002 s"),
        ({"tunings": tuning, "speed": 1.0}, "no 'speed'"),
    ):
        with pytest.raises(InvalidInput, match=words):
            model.loop(**wrong)
    with pytest.raises(InvalidInput, match="tune has no argument 'foo'"):
        tune(model, foo=1)
    with pytest.raises(InvalidInput, match="no friction model"):
        tune(3)


def results(log, result, model, tuning):
    motion = identify(log, method="motion").model
    return [result, model, compare(model, model), tuning, estimate_force(motion, log)]


def test_results_show_themselves(log, result, model, tuning, tmp_path):
    for one in results(log, result, model, tuning):
        text = one.summary()
        assert max(map(len, text.splitlines())) <= 80
        assert "joint_1" in text
        page = one._repr_html_()
        assert page.count("<div") == page.count("</div>") == 1
        assert "joint_1" in page
        assert not re.search(r"<script|https?://(?!www\.w3\.org)", page)
        if one is not tuning:
            figure = one.plot()
            assert hasattr(figure, "savefig")
            figure.savefig(tmp_path / "picture.png")
            assert "data:image/svg+xml;base64" in page
    for one in results(log, result, model, tuning):
        page = one.report(tmp_path / "report.html").read_text()
        assert page.startswith("<!DOCTYPE html>")
        assert "joint_1" in page
        assert one is tuning or "<svg" in page
        assert not re.search(r"<script|https?://", page)
    assert (
        "<h1><bdi>Monday &lt;b&gt;</bdi></h1>"
        in model.report(tmp_path / "m.html", title="Monday <b>").read_text()
    )


def test_a_tuning_computes_its_picture_when_it_is_asked_for(tuning):
    assert not tuning.region
    assert hasattr(tuning.plot(), "savefig")
    assert not tuning.region  # the tuning itself does not change
    with pytest.raises(InvalidInput, match="read from a file"):
        replace(tuning, facts=None).plot()
    with pytest.raises(InvalidInput, match="no picture of 'joint_1' for 'estimate'"):
        replace(tuning, goal="estimate").plot()


PAYLOAD = PayloadEstimate(
    frame="joint_1", mass=2.0, mass_error=0.1, mass_error_of_data=0.01, center=np.ones(3), center_error=0.1 * np.ones(3),
    inertia=np.eye(3), inertia_error=0.1 * np.eye(3), limited_by="gains", gains=Gains(kind="none", by_joint={}, remarks=()),
    lever={"joint_1": 3.0}, remarks=("A remark.",),
)  # fmt: skip
ARM = ArmPlan(("joint_1", "b"), ("rad", "m"), (0.0, 0.0), ((0.1,), (0.1,)), ((0.0,), (0.0,)), 10.0, periods=3)
MIXED = InTurn((replace(PLAN, joint="joint_1"), Sweep(0.1, 0.5, 2, joint="b", unit="m")))
RAMP = SineTorque(amplitude=2.0, cycles=2, frequency=0.5, joint="joint_1")


@pytest.mark.parametrize("kind", ["log", "validation", "payload", "plan", "arm", "mixed", "torque"])
def test_data_and_validations_show_themselves(kind, log, model, tmp_path):
    one = {
        "log": log.select(0).with_note("A <note>."),
        "validation": validate(model, log) if kind == "validation" else None,
        "payload": PAYLOAD,
        "plan": replace(PLAN, joint="joint_1"),
        "arm": ARM,
        "mixed": MIXED,
        "torque": RAMP,
    }[kind]
    text, page = one.summary(), one._repr_html_()
    assert max(map(len, text.splitlines())) <= 80
    assert str(one) == text.rstrip()
    assert "joint_1" in text
    assert "joint_1" in page
    assert "<note>" not in page
    json.dumps(one.to_dict(), allow_nan=False)
    assert "joint_1" in one.report(tmp_path / "page.html").read_text()
    if kind in ("validation", "payload", "mixed"):
        with pytest.raises(InvalidInput, match="no picture of this"):
            one.plot()
    else:
        one.plot().savefig(tmp_path / "picture.png")


def test_a_validation_is_still_a_dict(model, log):
    result = validate(model, log)
    assert dict(result) == result
    assert result == validate(model, [log])
    assert pickle.loads(pickle.dumps(result)).units == {"joint_1": "N.m"}
    with pytest.raises(InvalidInput, match="no log"):
        validate(model, 3)


@pytest.mark.parametrize("name", ["r.pdf", "r.PDF", "r.png", "r.json"])
def test_a_report_is_html(model, result, tmp_path, name):
    for one in (model, result):
        with pytest.raises(InvalidInput, match="a report is an HTML page"):
            one.report(tmp_path / name)
    assert not list(tmp_path.iterdir())
    assert model.report(tmp_path / "r.HTM").exists()


def test_results_become_plain_values(log, result, model, tuning):
    for one in results(log, result, model, tuning):
        json.dumps(one.to_dict())
    assert result.to_dict()["verdicts"]["joint_1"].startswith("good")
    assert model.to_dict()["joints"][0]["name"] == "joint_1"


def test_hostile_names_are_quoted(model):
    name = "<img src=x>\x1b[31m"
    odd = replace(model, joints=(replace(model.joints[0], joint=replace(model.joints[0].joint, name=name)),))
    assert "<img src=x>" not in odd._repr_html_()
    assert "\x1b" not in odd.summary()


def test_a_law_alone_can_be_simulated_too():
    joint = machine("joint_1").replace(
        law=Law(rate=CoulombViscous(coulomb_positive=3.0, coulomb_negative=3.0))
    )
    assert len(simulate(joint, PLAN)) > 1000
