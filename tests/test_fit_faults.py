"""Tests for fitting/ against faults that a stranger found: wrong numbers without a word, and input that nobody heeded."""

import json
import os
import signal
import threading
from functools import cache

import numpy as np
import pytest
from typer.testing import CliRunner

from backdrive.cli import app
from backdrive.engine import Axis, forward, rollout
from backdrive.errors import InvalidInput, UnknownName
from backdrive.identification import identify, validate, validate_motion
from backdrive.identification.dynamic import stopping
from backdrive.identification.dynamic.choice import Candidate, choose
from backdrive.identification.dynamic.unknowns import LawShape, Scales
from backdrive.identification.smoothing import smoothing
from backdrive.laws import M3, Law, LuGre, StribeckGauss
from backdrive.logs.log import Drive, Joint, Log
from backdrive.logs.resolution import encoder_step
from backdrive.model import load_model

WAVES = ((0.8, 0.5, 0.0), (0.3, 1.7, 1.0), (0.05, 6.3, 2.0), (0.5, 0.21, 0.3))  # rad, rad/s, rad
INERTIA = 0.3


def motion(t):
    """Return position, velocity and acceleration of a smooth motion, (n,) each."""
    q = sum(a * np.sin(w * t + p) for a, w, p in WAVES)
    v = sum(a * w * np.cos(w * t + p) for a, w, p in WAVES)
    return q, v, sum(-a * w * w * np.sin(w * t + p) for a, w, p in WAVES)


def stribeck(v):
    return np.sign(v) * (1.0 + 0.6 * np.exp(-((v / 0.08) ** 2))) + 0.4 * v


@cache
def recorded(late=0.0, rate=500.0, counts=None, seconds=16.0, known_counts=True, noise=0.02) -> Log:
    """Return a log of a joint under gravity whose torque is `late` [s]."""
    t = np.arange(0.0, seconds, 1.0 / rate)
    q, v, a = motion(t - late)
    torque = INERTIA * a + stribeck(v) + 2.0 * np.sin(q) + 0.7 * np.cos(q) + 0.25
    torque = torque + noise * np.random.default_rng(1).standard_normal(t.size)
    position = motion(t)[0]
    if counts:
        position = np.round(position * counts) / counts
    joint = Joint(name="j", encoder_counts=counts if known_counts else None)
    return Log(time=t, joints=(joint,), position=position[:, None], torque=torque[:, None])


def rows(log, path, **columns):
    table = np.column_stack([log.time, log.position, log.torque, *columns.values()])
    np.savetxt(path, table, delimiter=",", header=",".join(["t", "q", "tau", *columns]), comments="")


def test_a_model_predicts_the_log_it_was_fitted_to_as_the_fit_does():
    log = recorded(late=0.03)
    result = identify(log, law="stribeck-gauss")
    (friction,) = result.model.joints
    quality = validate(result.model, [log])["j"]
    assert quality.rms == pytest.approx(friction.fitted.rms, rel=0.1)
    assert friction.dynamics["delay"].value == pytest.approx(0.03, abs=3e-4)
    assert 1e-6 < friction.dynamics["delay"].standard_error < 1e-3  # of one sign that jumps, it was 1e-10
    low, high = result.intervals["j"]["delay"]
    assert low - 1e-4 < 0.03 < high + 1e-4


def test_a_delay_of_a_law_without_state_is_that_of_the_instant_not_of_the_increment():
    result = identify(recorded(late=0.008), law="stribeck-gauss")
    assert result.model.joints[0].dynamics["delay"].value == pytest.approx(0.008, abs=1.5e-4)


@pytest.mark.parametrize("channel", ["load", "external_torque"])
def test_laws_of_load_see_the_motor_torque_and_their_model_predicts_with_load(channel):
    t = np.arange(0.0, 16.0, 2e-3)
    q, v, a = motion(t)
    carried = 5.0 * np.sin(q + 0.3 * t)
    torque = np.zeros_like(t)
    for _ in range(200):  # the load that friction depends on has the torque in it
        torque = INERTIA * a + carried + (1.0 + 0.15 * np.abs(torque + carried)) * np.sign(v) + 0.3 * v
    own = {"load": {"load": carried[:, None]}, "external_torque": {"external_torque": -carried[:, None]}}
    model = {"model_torque": carried[:, None]} if channel == "load" else {}
    log = Log(time=t, joints=(Joint(name="j"),), position=q, torque=torque, **own[channel], **model)
    result = identify(log, law="m3", gravity=False)
    law = result.model.joints[0].law.rate
    assert isinstance(law, M3)
    assert (law.load, law.coulomb) == pytest.approx((0.15, 1.0), rel=0.02)
    assert validate(result.model, [log])["j"].residual < 3.0
    with pytest.raises(InvalidInput, match="load"):
        validate(result.model, [Log(time=t, joints=log.joints, position=q, torque=torque, **model)])


@pytest.mark.parametrize("told", [True, False])
def test_encoder_steps_lower_the_low_pass_and_spare_the_inertia(told):
    log = recorded(rate=1000.0, counts=651.9, known_counts=told)
    result = identify(log, law="stribeck-gauss")
    (friction,) = result.model.joints
    assert friction.dynamics["inertia"].value == pytest.approx(INERTIA, rel=0.03)
    assert friction.law.rate.breakaway == pytest.approx(1.6, rel=0.1)  # stated: 1.5 +- 0.2
    assert any("--cutoff" in note for note in result.notes)
    assert result.model.options["settings"]["j"]["cutoff"] < 30.0


def test_a_fine_encoder_leaves_the_low_pass_alone_and_a_hopeless_one_is_said():
    assert smoothing([recorded(counts=1e6)], "j").cutoff is None
    slow = recorded(rate=1000.0)
    creep = 20.0 / 651.9 * np.sin(0.3 * slow.time)
    coarse = slow.replace(position=np.round(creep * 651.9) / 651.9)
    assert "--cutoff" in smoothing([coarse], "j").warning
    assert encoder_step(coarse) == pytest.approx(1 / 651.9)
    assert encoder_step(slow) == 0.0


def test_break_away_is_bounded_by_the_friction_that_was_seen():
    shape = LawShape.from_name("stribeck-gauss")
    upper = {u.name: u.upper for u in shape.unknowns(Scales(force=1.0, speed=1.0, length=1e-3, most=3.0))}
    assert upper["breakaway"] == 3.0
    asked = shape.unknowns(Scales(force=1.0, speed=1.0, length=1e-3, most=3.0), {"breakaway": (1.0, 9.0)})
    assert {u.name: u.upper for u in asked}["breakaway"] == 9.0


def test_a_refit_that_explains_the_log_worse_is_not_taken(monkeypatch):
    from backdrive.identification.dynamic import torque_task

    whole, calls = torque_task.fit_law, []

    def spoiled(*args, **options):
        calls.append(("begin_at" in options, all(s.only_sliding for s in args[1])))
        if "begin_at" in options:
            options = options | {"bounds": {"breakaway": (40.0, 41.0)}}
        return whole(*args, **options)

    monkeypatch.setattr(torque_task, "fit_law", spoiled)
    (friction,) = identify(recorded(), law="stribeck-gauss").model.joints
    # a law of velocity is fitted to everything and to sliding alone, first without the windows that judge it, then with them
    assert calls == [(False, False), (False, True), (True, False), (True, True)]
    assert friction.law.rate.breakaway < 2.0
    assert any("held-out windows" in w for w in friction.warnings)


def test_presliding_that_the_log_does_not_show_is_not_chosen():
    result = identify(recorded(), law="stribeck-gauss,stribeck-gauss+lugre")
    assert result.choice().chosen == "stribeck-gauss"
    one = {"error": 1.0, "aic": 0.0, "seconds": 0.0}
    plain = Candidate(name="a", parameters=3, held_out=1.0, **one)
    blind = Candidate(name="a+b", parameters=5, held_out=0.5, shown=False, **one)
    assert choose("j", [plain, blind], "N.m", 1.0).chosen == "a"
    assert choose("j", [blind], "N.m", 1.0).chosen == "a+b"


def test_gravity_and_offset_that_one_posture_cannot_tell_apart_are_named():
    t = np.arange(0.0, 12.0, 2e-3)
    q, v, a = 0.02 * np.sin(2.0 * t), 0.04 * np.cos(2.0 * t), -0.08 * np.sin(2.0 * t)
    noise = 0.02 * np.random.default_rng(0).standard_normal(t.size)
    log = Log(time=t, joints=(Joint(name="j"),), position=q, torque=INERTIA * a + stribeck(v) + noise)
    result = identify(log, law="m1", gravity=True)
    said = " ".join(result.model.joints[0].warnings)
    assert "'offset' is not identifiable" in said
    assert "'gravity_cos' is not identifiable" in said
    assert "'inertia' is not identifiable" in said


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"loss": "foo"}, "loss"),
        ({"seed": -1}, "seed"),
        ({"loss": "absolute", "interval": "profile"}, "bootstrap"),
        ({"cutoff": 0.0}, "cutoff"),
        ({"known": {"inertia": float("nan")}}, "inertia = nan"),
        ({"known": {"inertia": -5.0}}, "inertia = -5"),
        ({"known": {"inertia": 0.3}, "bounds": {"inertia": (0.1, 0.2)}}, "known.*bounded"),
        ({"bounds": {"nosuch": (0.0, 1.0)}}, "'nosuch' is bounded"),
        ({"bounds": {"drive.resistance": (1.0, 2.0)}}, "'drive.resistance' is bounded"),
        ({"bounds": {"coulomb": 5}}, "two numbers"),
        ({"law": ","}, "No law is named"),
        ({"law": Law(rate=StribeckGauss(coulomb=1, breakaway=1, stribeck_velocity=1, viscous=0))}, "Name it"),
        ({"drive": "torque"}, "Drive"),
    ],
)
def test_what_makes_no_sense_is_refused_before_the_fit(options, says):
    with pytest.raises(InvalidInput, match=says):
        identify(recorded(), law=options.pop("law", "m1"), **options)


def test_bounds_of_the_rest_of_the_dynamics_are_heeded_and_intervals_stay_in_them():
    bounds = {"inertia": (0.1, 0.2), "delay": (0.0, 0.01)}
    result = identify(recorded(), law="stribeck-gauss", bounds=bounds)
    assert result.model.joints[0].dynamics["inertia"].value == pytest.approx(0.2)
    for name, (low, high) in bounds.items():
        ends = result.intervals["j"][name]
        assert low <= ends[0] <= ends[1] <= high
    assert result.model.options["bounds"] == {"inertia": [0.1, 0.2], "delay": [0.0, 0.01]}


def test_the_command_has_a_gate_and_keeps_what_was_asked(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    log = recorded()
    rows(log, "log.csv")
    rows(log.replace(torque=np.random.default_rng(0).standard_normal(len(log))), "noise.csv")
    asked = ["--law", "m1", "--known", "offset=0.25", "--bound", "coulomb=0.1:9", "--json"]
    good = CliRunner().invoke(app, ["identify", "log.csv", *asked, "-o", "m.json", "--cutoff", "20"])
    assert good.exit_code == 0, good.output
    assert json.loads(good.output)["ok"] is True
    options = load_model("m.json").options
    assert options["known"] == {"offset": 0.25} and options["bounds"] == {"coulomb": [0.1, 9.0]}
    assert options["cutoff"] == 20.0
    bad = CliRunner().invoke(app, ["identify", "noise.csv", "--law", "m1", "--json"])
    assert bad.exit_code == 1
    assert json.loads(bad.output)["below_gate"] == ["joint_1"]


def test_an_interruption_is_raised_once_and_where_a_search_can_bear_it():
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with stopping.gently():
            with pytest.raises(KeyboardInterrupt):  # nothing was found that could be kept
                os.kill(os.getpid(), signal.SIGINT)
            assert not stopping.keeping()
            stopping.keep()
            assert stopping.keeping()
            os.kill(os.getpid(), signal.SIGINT)
            with pytest.raises(KeyboardInterrupt):
                stopping.check()
            stopping.check()
        assert not stopping.keeping()
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize("moment", ["after the first law", "in the refit", "in a profile"])
def test_an_interruption_keeps_the_laws_that_were_fitted(moment):
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    words = {
        "after the first law": "fitting stribeck-gauss",
        "in the refit": "everything",
        "in a profile": "profile",
    }

    def say(sentence):
        if words[moment] in sentence and threading.current_thread() is threading.main_thread():
            os.kill(os.getpid(), signal.SIGINT)

    try:
        kind = "profile" if moment == "in a profile" else "covariance"
        result = identify(recorded(), law="m1,stribeck-gauss", interval=kind, progress=say)
    finally:
        signal.signal(signal.SIGINT, before)
    assert result.stopped and any("interrupted" in w for w in result.warnings)
    assert any("interrupted" in w for w in result.model.joints[0].warnings)
    tried = [c.name for c in result.choice().candidates]
    assert tried == (["m1"] if moment == "after the first law" else ["m1", "stribeck-gauss"])


@pytest.fixture(scope="module")
def driven():
    t = 1e-3 * np.arange(2400)
    given = 2.0 * np.sin(3.0 * t) + np.sin(11.0 * t)
    law = Law(rate=StribeckGauss(coulomb=1.0, breakaway=1.5, stribeck_velocity=0.05, viscous=0.4))
    drive = Drive(law="velocity", gains={"proportional": 20.0})
    from backdrive.identification.dynamic.drive_stretch import model_of

    axis = Axis(law=law, inertia=0.05, drive=model_of(drive))
    fine = forward(axis, np.interp(np.arange(0, 2400, 0.05), np.arange(2400), given), dt=5e-5)
    position = fine.position[0, ::20]
    log = Log(time=t, joints=(Joint(name="j"),), position=position, drive_input=given, drive=drive)
    return log, identify(log, law="stribeck-gauss", gravity=False, known={"offset": 0.0})


def test_a_quick_drive_is_integrated_finely(driven):
    _, result = driven
    law = result.model.joints[0].law.rate
    assert law.breakaway == pytest.approx(1.5, rel=0.04)  # at a step of 1 ms: 1.64
    assert result.model.options["settings"]["j"]["step"] < 3e-4


def test_a_model_of_a_driven_joint_holds_its_drive_and_is_judged(driven, tmp_path, monkeypatch):
    log, result = driven
    result.model.save(tmp_path / "m.json")
    again = load_model(tmp_path / "m.json")
    own = again.options["settings"]["j"]
    assert own["drive"]["controller"] == "velocity" and own["motion"]["unit"] == "rad"
    assert own["motion"]["held_out"] < 1e-3
    assert again.joints[0].dynamics["drive.proportional"].value == 20.0
    assert again.joints[0].held_out is not None
    with pytest.raises(InvalidInput, match="no torque"):
        validate(again, [log])
    assert validate_motion(again, [log])["j"].rms < 1e-3
    monkeypatch.chdir(tmp_path)
    table = np.column_stack([log.time, log.position, log.drive_input])
    np.savetxt("log.csv", table, delimiter=",", header="t,q,u_in", comments="")
    asked = ["validate", "m.json", "log.csv", "--names", "j", "--map", "t=t,q=q,u=u_in", "--json"]
    run = CliRunner().invoke(app, asked)
    assert run.exit_code == 0, run.output
    assert json.loads(run.output)["joints"]["j"]["motion_residual_percent"] < 1.0


def test_moments_without_a_drive_are_said(driven):
    log, _ = driven
    off = log.with_note("The drive is off in 12 samples (torque_enable).")
    result = identify(off, law="m1", gravity=False, known={"offset": 0.0, "inertia": 0.05}, step=1e-3)
    assert any("on throughout" in w for w in result.warnings)


def test_a_slow_clock_is_said():
    log = recorded()
    result = identify(log.replace(time=50.0 * log.time), law="m1", accept=["degrees"])
    assert any("samples a second" in w for w in result.warnings)
    slower = identify(log.replace(time=1e3 * log.time), method="motion", accept=["degrees"])
    told = [*slower.warnings, *slower.model.joints[0].warnings]
    assert sum("0.001*COLUMN for milliseconds" in w for w in told) == 1
    assert sum("samples a second" in w for w in told) == 1


LAW = Law(
    rate=StribeckGauss(coulomb=1.0, breakaway=1.5, stribeck_velocity=0.05, viscous=0.4),
    element=LuGre(stiffness=1e4, damping=20.0, fading=0.05),
)
AXIS = Axis(law=LAW, inertia=0.05)


@pytest.mark.parametrize(
    "call",
    [
        lambda: forward(AXIS, np.zeros(9), dt=1e-3, position=np.nan),
        lambda: forward(AXIS, np.zeros((3, 9)), dt=1e-3),
        lambda: forward([LAW], np.zeros(9), dt=1e-3),
        lambda: rollout(LAW.rate, q=np.zeros(9), dt=1e-3),
        lambda: rollout("lugre", q=np.zeros(9), dt=1e-3),
        lambda: rollout(LAW, q=np.zeros(9), dt="a"),
        lambda: rollout(LAW, q="abc", dt=1e-3),
        lambda: Law(rate=LAW.element),
        lambda: Law(rate=LAW.rate, element=LAW.rate),
    ],
)
def test_wrong_kinds_of_arguments_are_answered_in_words(call):
    with pytest.raises(InvalidInput):
        call()


def test_a_law_that_was_not_tried_is_answered_with_those_that_were():
    with pytest.raises(UnknownName, match="m1"):
        identify(recorded(), law="m1").choice().candidate("nope")
