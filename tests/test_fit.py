"""Tests for fitting/: `fit` and its command on simulated joints, the choice between laws, and bad input in words."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

import backdrive
from backdrive.cli import app
from backdrive.errors import InvalidInput, NotIdentifiable, UnknownName
from backdrive.identification import identify
from backdrive.identification.dynamic.choice import Candidate, choose, shortlist
from backdrive.laws import CoulombViscous, Law, LuGre, StribeckGauss
from backdrive.logs.log import Joint, Log
from backdrive.simulation import JointSimulation, Servo
from backdrive.simulation.open_loop import drive

RATE = 500.0


def target(seconds=16.0):
    """Slow triangles, small loops and a faster sine, (n, 2)."""
    t = np.arange(int(seconds * RATE)) / RATE
    v = 0.05 * np.tanh(8 * np.sin(2 * np.pi * t / 2.0))
    v = np.where(t > 5, 0.02 * np.tanh(8 * np.sin(2 * np.pi * t / 0.5)), v)
    v = np.where(t > 9, 0.9 * np.sin(2 * np.pi * 0.8 * (t - 9)), v)
    return np.column_stack([np.cumsum(v) / RATE, v])


def record(law, seed=0, motion=None, noise=0.05):
    joint = JointSimulation(
        name="elbow",
        law=law,
        motor_inertia=0.3,
        servo=Servo.from_bandwidth(0.3, 80.0),
        encoder_count=2e-6,
        torque_noise=noise,
    )
    out, _ = drive(joint, target() if motion is None else motion, closed=True, seed=seed, period=1 / RATE)
    return Log(
        time=np.arange(len(out)) / RATE, joints=(joint.as_joint(),), position=out[:, 0], torque=out[:, 1]
    )


CURVE = StribeckGauss(coulomb=4.0, breakaway=5.5, stribeck_velocity=0.05, viscous=1.0)


@pytest.fixture(scope="module")
def lugre_log():
    return record(Law(rate=CURVE, element=LuGre(stiffness=1e4, damping=10.0)))


@pytest.fixture(scope="module")
def chosen(lugre_log):
    return identify(lugre_log, law="coulomb-viscous,stribeck-gauss,lugre")


def test_the_law_of_the_joint_is_chosen_and_recovered(chosen):
    choice = chosen.choice("elbow")
    assert choice.chosen == "stribeck-gauss+lugre"
    law = chosen.model.joints[0].law
    assert law.rate.coulomb == pytest.approx(4.0, rel=0.03)
    assert law.rate.breakaway == pytest.approx(5.5, rel=0.03)
    assert law.element.stiffness == pytest.approx(1e4, rel=0.05)
    assert chosen.model.joints[0].dynamics["inertia"].value == pytest.approx(0.3, rel=0.05)


def test_the_table_has_every_law_and_the_reason_names_the_simpler_one(chosen):
    choice = chosen.choices[0]
    assert [c.name for c in choice.candidates] == [
        "coulomb-viscous",
        "stribeck-gauss",
        "stribeck-gauss+lugre",
    ]
    assert all(np.isfinite([c.error, c.held_out, c.aic]).all() for c in choice.candidates)
    assert min(c.aic for c in choice.candidates) == 0.0
    assert "stribeck-gauss+lugre" in choice.reason
    assert "simpler" in choice.reason


def test_a_richer_law_is_not_taken_where_it_is_not_worth_it():
    plain = Law(
        rate=CoulombViscous(
            coulomb_positive=4.0, coulomb_negative=3.0, viscous_positive=1.0, viscous_negative=1.0
        )
    )
    t = np.arange(int(12 * RATE)) / RATE
    q = 0.5 * np.sin(2 * np.pi * 0.4 * t)
    log = record(plain, motion=np.column_stack([q, np.gradient(q, 1 / RATE)]))
    result = identify(log, law="coulomb-viscous,stribeck-tustin")
    assert result.choices[0].chosen == "coulomb-viscous"
    assert "the simpler law is kept" in result.choices[0].reason
    law = result.model.joints[0].law.rate
    assert (law.coulomb_positive, law.coulomb_negative) == pytest.approx((3.5, 3.5), abs=0.1)
    assert result.model.joints[0].dynamics["offset"].value == pytest.approx(0.5, abs=0.1)
    assert any("'coulomb_negative' is taken to equal" in w for w in result.model.joints[0].warnings)
    given = {"offset": 0.0, "inertia": 0.3}
    known = identify(log, law="coulomb-viscous", gravity=False, known=given).model.joints[0]
    law = known.law.rate
    assert (law.coulomb_positive, law.coulomb_negative) == pytest.approx((4.0, 3.0), abs=0.1)
    assert (known.dynamics["offset"].value, known.dynamics["inertia"].value) == (0.0, 0.3)
    with pytest.raises(UnknownName, match="stiffness"):
        identify(log, law="coulomb-viscous", known={"stiffness": 1.0})


def test_the_model_is_saved_loaded_and_predicts_another_log(chosen, lugre_log, tmp_path):
    chosen.model.save(tmp_path / "m.json")
    again = backdrive.load_model(tmp_path / "m.json")
    assert again.joints[0].law == chosen.model.joints[0].law
    from backdrive.identification import validate

    t = np.arange(int(6 * RATE)) / RATE
    q = 0.1 * np.minimum(1, t) * np.sin(2 * np.pi * 0.5 * t)
    other = record(
        Law(rate=CURVE, element=LuGre(stiffness=1e4, damping=10.0)),
        3,
        np.column_stack([q, np.gradient(q, 1 / RATE)]),
    )
    quality = validate(again, [other])["elbow"]
    assert quality.residual < 6.0


def test_the_evidence_is_that_of_an_identification(chosen):
    evidence = chosen.evidence[0]
    assert evidence.curve.velocity.shape == evidence.curve.standard_error.shape
    assert np.all(np.isfinite(evidence.curve.standard_error))
    assert evidence.verdict


def two_joints(lugre_log, **changes):
    n = len(lugre_log)
    position = np.column_stack([lugre_log.position[:, 0], np.zeros(n)])
    torque = np.column_stack([lugre_log.torque[:, 0], 0.1 * np.random.default_rng(0).standard_normal(n)])
    return Log(
        time=lugre_log.time,
        joints=(lugre_log.joints[0], Joint(name="wrist")),
        position=changes.get("position", position),
        torque=changes.get("torque", torque),
    )


def test_a_joint_that_never_moves_is_named_and_the_other_delivered(lugre_log):
    result = identify(
        two_joints(lugre_log), law="coulomb-viscous", accept=["no-motion", "stuck", "no-friction"]
    )
    assert result.model.names == ("elbow",)
    assert any("wrist" in w for w in result.warnings)


def test_a_joint_asked_for_that_cannot_be_fitted_is_named_and_the_other_delivered(lugre_log):
    result = identify(
        two_joints(lugre_log),
        law="coulomb-viscous",
        joints=["elbow", "wrist"],
        accept=["no-motion", "stuck", "no-friction"],
    )
    assert result.model.names == ("elbow",)
    assert any("wrist" in w and "never moves" in w for w in result.warnings)


def test_no_motion_at_all_is_refused_in_words(lugre_log):
    still = lugre_log.replace(position=np.zeros(len(lugre_log)))
    with pytest.raises(NotIdentifiable, match="moves"):
        identify(still, law="coulomb-viscous", accept=["no-motion", "stuck", "no-friction"])


def test_constant_torque_is_refused_in_words(lugre_log):
    from backdrive.errors import BackdriveError

    with pytest.raises(BackdriveError, match="torque"):
        identify(
            lugre_log.replace(torque=np.full(len(lugre_log), 2.0)),
            law="coulomb-viscous",
            accept=["silent-torque", "stuck"],
        )


def test_twenty_samples_are_refused_in_words(lugre_log):
    with pytest.raises(NotIdentifiable, match="20 samples"):
        identify(lugre_log.rows(slice(4800, 4820)), law="coulomb-viscous")


def test_contradictory_bounds_are_refused_with_their_numbers(lugre_log):
    with pytest.raises(InvalidInput, match="5.*2.*coulomb_positive|coulomb_positive.*5.*2"):
        identify(lugre_log, law="coulomb-viscous", bounds={"coulomb_positive": (5.0, 2.0)})


def test_an_unknown_law_is_answered_with_near_ones(lugre_log):
    with pytest.raises(UnknownName, match="stribeck-gauss"):
        identify(lugre_log, law="stribeck-gaus")


def test_a_pair_that_makes_no_sense_says_why(lugre_log):
    with pytest.raises(InvalidInput, match="continuous and zero at rest"):
        identify(lugre_log, law="makkar+lugre")


def test_a_law_of_the_load_needs_the_load(lugre_log):
    with pytest.raises(NotIdentifiable, match="load"):
        identify(lugre_log, law="m3")


def test_a_search_that_does_not_come_to_rest_says_so(lugre_log):
    from backdrive.identification.dynamic import fit_law
    from backdrive.identification.dynamic.stretch import stretch
    from backdrive.identification.signals import prepare

    stretches = [stretch(s) for s in prepare(lugre_log, 0)]
    found = fit_law("m3", stretches, begin=2, descend=1, iterations=1)
    assert not found.converged
    assert any("did not converge" in w for w in found.warnings)


def test_the_same_seed_gives_the_same_numbers(lugre_log):
    a, b = (identify(lugre_log, law="stribeck-gauss", seed=4).model.joints[0].law for _ in range(2))
    assert a == b


def test_the_shortlist_follows_the_data():
    plain = shortlist("auto", presliding=False, load=False, warm=False)
    assert not any("+" in name for name in plain)
    assert set(shortlist("auto", presliding=True, load=True, warm=True)) > set(plain)
    assert shortlist("a, b", presliding=False, load=False, warm=False) == ["a", "b"]


def test_a_choice_takes_the_simplest_that_is_not_beaten_by_enough():
    def one(name, parameters, held_out):
        return Candidate(
            name=name, parameters=parameters, error=held_out, held_out=held_out, aic=0.0, seconds=0.0
        )

    laws = [one("a", 3, 1.0), one("b", 5, 0.8), one("c", 9, 0.795)]
    assert choose("j", laws, "N.m", 10.0).chosen == "b"
    assert choose("j", laws[:1], "N.m", 10.0).chosen == "a"


def test_the_command_writes_a_model_and_prints_the_table(lugre_log, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    table = np.column_stack([lugre_log.time, lugre_log.position, lugre_log.torque])
    np.savetxt("log.csv", table, delimiter=",", header="t,q,tau", comments="")
    run = CliRunner().invoke(
        app,
        [
            "identify",
            "log.csv",
            "--law",
            "coulomb-viscous,stribeck-gauss",
            "-o",
            "m.json",
            "--json",
            "--counts",
            "500000",
        ],
    )
    assert run.exit_code == 0, run.output
    document = json.loads(run.output)
    (choice,) = document["choices"].values()
    assert {x["law"] for x in choice["laws"]} == {"coulomb-viscous", "stribeck-gauss"}
    assert backdrive.load_model("m.json").joints[0].method.startswith("fit of")
    shown = CliRunner().invoke(
        app, ["identify", "log.csv", "--law", "stribeck-gauss", "--bound", "coulomb=1:9"]
    )
    assert shown.exit_code == 0, shown.output
    assert "stribeck_velocity" in shown.output


@pytest.mark.parametrize("bound", ["coulomb", "coulomb=3:1", "coulomb=a:b"])
def test_a_bound_that_is_none_is_refused(bound, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "log.csv").write_text("t,q,tau\n0,0,0\n")
    run = CliRunner().invoke(app, ["identify", "log.csv", "--law", "auto", "--bound", bound])
    assert run.exit_code != 0
