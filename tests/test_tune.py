"""`backdrive tune`: what it needs to know, what it chooses, its file, and what it says where it cannot."""

import json
from dataclasses import replace

import numba as nb
import numpy as np
import pytest
from typer.testing import CliRunner

from backdrive.cli import app
from backdrive.control import Loop
from backdrive.errors import InvalidInput, ModelFileError, NotIdentifiable
from backdrive.laws import Coulomb, CoulombViscous, HaywardArmstrong, Law, Polyline, Sigmoid
from backdrive.log import Joint
from backdrive.model import Estimate, FrictionModel, JointFriction, Validity
from backdrive.tune import facts_of, load_tunings, save_tunings, tune
from backdrive.tune.facts import curve_of
from backdrive.tune.goals import goal_of
from backdrive.tune.margins import least_breaking
from backdrive.tune.scenes import corners, drawn, likely, stated
from backdrive.tune.search import inverse, place, search

needs_jit = pytest.mark.skipif(nb.config.DISABLE_JIT, reason="simulates minutes of motion")
RATE = CoulombViscous(coulomb_positive=7.0, coulomb_negative=6.8, viscous_positive=3.0, viscous_negative=3.0)
FRICTION = JointFriction(
    joint=Joint(name="j0", unit="rad", encoder_counts=1e6),
    law=Law(rate=RATE, element=HaywardArmstrong(stiffness=1e5)),
    validity=Validity(velocity=(-1.0, 1.0)),
    standard_errors={"coulomb_positive": 0.05, "coulomb_negative": 0.05, "stiffness": 1e4},
    dynamics={"inertia": Estimate(value=0.7, unit="kg.m^2", standard_error=0.02)},
)


def knows(**changes):
    return replace(FRICTION, **changes)


def test_a_model_tells_values_and_intervals():
    facts = facts_of(FRICTION, motor_share=0.1)
    assert facts.coulomb == pytest.approx(6.9)
    assert facts.stiffness_interval == pytest.approx((1e5 - 1.96e4, 1e5 + 1.96e4))
    assert facts.inertia_interval == pytest.approx((0.7 - 0.0392, 0.7 + 0.0392))
    assert facts.friction == pytest.approx((0.9, 1.1))  # wider than the 1 % of the model
    assert facts.notes == ()


def test_uncertain_friction_of_the_model_widens_the_interval():
    vague = knows(standard_errors={"coulomb_positive": 1.0, "coulomb_negative": 1.0, "stiffness": 1e4})
    facts = facts_of(vague)
    assert facts.friction_error == pytest.approx(1.96 * np.hypot(0.5, 0.5) / 6.9, rel=1e-6)
    assert "within 20 %" in " ".join(facts.notes)


def test_a_model_without_intervals_is_tuned_with_assumed_ones_and_says_so():
    facts = facts_of(knows(standard_errors={}, dynamics={"inertia": Estimate(value=0.7, unit="kg.m^2")}))
    said = " ".join(facts.notes)
    assert facts.stiffness_interval == pytest.approx((8e4, 1.2e5))
    assert all(word in said for word in ("--friction-error", "--stiffness", "--inertia", "--motor-share"))


def test_what_nobody_knows_is_asked_for():
    with pytest.raises(NotIdentifiable, match="--stiffness LOW:HIGH"):
        facts_of(knows(law=Law(rate=RATE)))
    with pytest.raises(NotIdentifiable, match="--inertia LOW:HIGH"):
        facts_of(knows(dynamics={}))
    with pytest.raises(NotIdentifiable, match="--counts"):
        facts_of(knows(joint=Joint(name="j0", unit="rad")))
    with pytest.raises(NotIdentifiable, match="no Coulomb friction"):
        facts_of(knows(law=Law(rate=Coulomb(coulomb=0.0), element=HaywardArmstrong(stiffness=1e5))))


def test_a_coarse_encoder_softens_the_contact_and_a_coarser_one_is_refused_with_what_can_be_done():
    soft = facts_of(FRICTION, counts=1e4)  # 10 N.m a count at K_c
    assert soft.stiffest == pytest.approx(6.9 / 2.0 * 1e4)
    softer = facts_of(FRICTION, counts=5e3)
    assert softer.stiffest < 0.2 * softer.stiffness
    with pytest.raises(NotIdentifiable, match=r"too coarse.*more counts.*dead zone"):
        facts_of(FRICTION, counts=1e3)


@pytest.mark.parametrize(
    "change", [{"motor_share": 1.5}, {"delay": -1.0}, {"stiffness": (2e5, 1e5)}, {"interval": 0.0}]
)
def test_senseless_facts_are_refused(change):
    with pytest.raises(InvalidInput):
        facts_of(FRICTION, **change)


def test_a_curve_stands_for_a_law_that_carries_no_contact():
    rate = Sigmoid(**{n: p.typical for n, p in Sigmoid.PARAMETERS.items()})
    curve = curve_of(Law(rate=rate), 1.0, factor=1.1)
    v = np.array([-0.7, -0.2, 0.2, 0.7])
    assert isinstance(curve, Polyline)
    np.testing.assert_allclose(Law(rate=curve).torque(v), 1.1 * Law(rate=rate).torque(v), rtol=0.02)
    with pytest.raises(NotIdentifiable, match="no Coulomb friction at rest"):
        facts_of(knows(law=Law(rate=rate), standard_errors={}), stiffness=(8e3, 1.2e4))


def test_joints_stay_inside_the_intervals_and_series_springs_give_k_c():
    facts = facts_of(FRICTION)
    for m in [likely(facts), *corners(facts), *drawn(facts, 40, 0)]:
        assert facts.stiffness_interval[0] <= m.stiffness <= facts.stiffness_interval[1]
        assert facts.friction[0] <= m.friction <= facts.friction[1]
        assert 0.0 <= m.delay <= facts.delay
        assert 1.0 / m.transmission + 1.0 / m.bristle == pytest.approx(1.0 / m.stiffness)
    assert drawn(facts, 8, 3) == drawn(facts, 8, 3)


def test_places_in_the_unit_cube_go_there_and_back():
    ranges = {"share": (0.3, 0.9), "decay": (5.0, 500.0)}
    u = np.array([0.25, 0.75])
    np.testing.assert_allclose(inverse(ranges, place(ranges, u)), u)
    assert place(ranges, np.array([0.0, 0.5]))["decay"] == pytest.approx(50.0)


def test_bisection_finds_where_it_breaks():
    assert least_breaking(lambda x: x > 0.7, 0.0, 1.0, 12) == pytest.approx(0.7, abs=1e-3)
    assert least_breaking(lambda x: False, 0.0, 1.0) == np.inf


@needs_jit
def test_a_search_repeats_itself_and_is_safe(quick):
    facts = facts_of(FRICTION, motor_share=0.1)
    goal = goal_of("backdrive", facts, stated(facts))
    first, again = (search(goal, seed=2, width=8) for _ in range(2))
    assert first == again
    assert first.numbers is not None
    assert goal.worst([first.numbers])[0] <= 1.0
    assert first.score < 0.75 * goal.scores([{"share": 0.0, "stiffness": 0.5, "decay": 20.0}])[0]


@pytest.fixture
def quick(monkeypatch):
    """Close in with one size of step."""
    monkeypatch.setattr("backdrive.tune.search.STEPS", (0.1,))


@needs_jit
@pytest.mark.parametrize("goal", ["backdrive", "estimate", "admit"])
def test_a_tuning_runs_is_kept_and_respects_its_bounds(goal, tmp_path, quick):
    facts = facts_of(FRICTION, motor_share=0.2)
    tuning = tune(facts, goal, joints=16)
    path = save_tunings([tuning], tmp_path / "tuning.json")
    (kept,) = load_tunings(path)
    assert kept.compensator() == tuning.compensator()
    assert kept.external() == tuning.external()
    assert kept.admittance() == tuning.admittance()
    assert all(number.reason for number in kept.numbers.values())
    Loop([kept.loop()], interval=kept.interval).update(np.zeros(1), np.zeros(1))
    if goal == "backdrive":
        assert tuning["share"] <= 0.9 + 1e-9
        assert tuning["stiffness"] <= facts.stiffest * (1.0 + 1e-9)
        assert tuning.margins["at_rest"] == 1.0
        assert tuning.margins["cycle_by_bound"] <= 1.0
        assert tuning.margins["breakaway"] < tuning.margins["breakaway_bare"]
        assert tuning.margins["share_breaks"] > tuning["share"]
        assert kept.compensator(switching=True).friction.fast_decay == tuning["fast_decay"]
    elif goal == "admit":
        assert tuning["admittance_inertia"] >= tuning.numbers["admittance_inertia"].limit


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("{", "damaged"),
        ("[]", "not a tuning"),
        ('{"format": "backdrive-tuning", "schema": 9}', "schema"),
        ('{"format": "backdrive-tuning", "schema": 1, "joints": [{}]}', r"joints\[0\]"),
    ],
)
def test_a_damaged_tuning_is_refused_with_the_place(tmp_path, content, says):
    path = tmp_path / "tuning.json"
    path.write_text(content)
    with pytest.raises(ModelFileError, match=says):
        load_tunings(path)
    with pytest.raises(ModelFileError, match="Cannot read"):
        load_tunings(tmp_path / "absent.json")


def command(*words):
    """Return exit code and output of the command, as `main` would end it."""
    result = CliRunner().invoke(app, ["tune", *words])
    code = getattr(result.exception, "exit_code", result.exit_code) if result.exception else 0
    return code, result


@needs_jit
def test_command_writes_file_and_picture(tmp_path, quick):
    model, out, picture = (tmp_path / n for n in ("model.json", "tuning.json", "region.png"))
    FrictionModel(joints=(FRICTION,)).save(model)
    code, result = command(str(model), "--joints", "8", "-o", str(out), "--picture", str(picture), "--json")
    assert code == 0, result.output
    answer = json.loads(result.stdout)
    assert answer["ok"] and answer["joints"][0]["numbers"]["share"]["value"] == load_tunings(out)[0]["share"]
    assert picture.read_bytes()[:4] == b"\x89PNG"


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["--goal", "fly"], 2),
        (["--stiffness", "2e5:1e5"], 2),
        (["--stiffness", "soft"], 2),
        (["--counts", "1000"], 1),
        (["--picture", "region.pdf"], 2),
        (["--goal", "admit", "--picture", "region.png"], 2),
        (["--joints", "2"], 2),
        (["--joint", "nobody"], 2),
    ],
)
def test_command_refuses_what_makes_no_sense(tmp_path, words, code):
    model = tmp_path / "model.json"
    FrictionModel(joints=(FRICTION,)).save(model)
    assert command(str(model), *words)[0] == code
