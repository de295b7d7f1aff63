"""`backdrive tune`: what it needs to know, what it chooses, its file, and what it says where it cannot."""

import json
from dataclasses import replace
from functools import cache
from unittest import mock

import numba as nb
import numpy as np
import pytest
from typer.testing import CliRunner

from backdrive.cli import app
from backdrive.cli._tune_output import show_tuning
from backdrive.control import Loop
from backdrive.errors import InvalidInput, ModelFileError, NotIdentifiable
from backdrive.laws import Coulomb, CoulombViscous, HaywardArmstrong, Law, Polyline, Sigmoid
from backdrive.logs.log import Joint
from backdrive.model import Estimate, FrictionModel, JointFriction, Validity
from backdrive.tuning import facts_of, load_tunings, safety, save_tunings, tune
from backdrive.tuning import refine as refine_module
from backdrive.tuning.facts import curve_of, scale_rate
from backdrive.tuning.goals import Goal, goal_of
from backdrive.tuning.margins import least_breaking, with_value
from backdrive.tuning.members import corners, nominal, sample
from backdrive.tuning.propose import _rows, fixed_rule
from backdrive.tuning.reasons import edges, origin
from backdrive.tuning.safety import calm, ends, safe
from backdrive.tuning.scenes import usual_stroke
from backdrive.tuning.search import inverse, place, search

TAKEN = "Friction is taken to vary by up to 10 % from day to day (--friction-error)."
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


@cache
def tuned(goal):
    """Return a tuning, worked out once, that closes in with one size of step."""
    with mock.patch("backdrive.tuning.search.STEPS", (0.1,)):
        return tune(facts_of(FRICTION, motor_share=0.2), goal, joints=16)


def test_a_model_tells_values_and_intervals():
    facts = facts_of(FRICTION, motor_share=0.1)
    assert facts.coulomb == pytest.approx(6.9)
    assert facts.stiffness_interval == pytest.approx((1e5 - 1.96e4, 1e5 + 1.96e4))
    assert facts.inertia_interval == pytest.approx((0.7 - 0.0392, 0.7 + 0.0392))
    assert facts.friction == pytest.approx((0.9, 1.1))  # wider than the 1 % of the model
    assert facts.notes == (TAKEN,)


def test_uncertain_friction_of_the_model_widens_the_interval():
    vague = knows(standard_errors={"coulomb_positive": 1.0, "coulomb_negative": 1.0, "stiffness": 1e4})
    facts = facts_of(vague)
    assert facts.friction_error == pytest.approx(1.96 * np.hypot(0.5, 0.5) / 6.9, rel=1e-6)
    assert "uncertain by 20 %" in " ".join(facts.notes)


def test_a_model_without_intervals_is_tuned_with_assumed_ones_and_says_so():
    facts = facts_of(knows(standard_errors={}, dynamics={"inertia": Estimate(value=0.7, unit="kg.m^2")}))
    said = " ".join(facts.notes)
    assert facts.stiffness_interval == pytest.approx((8e4, 1.2e5))
    assert all(word in said for word in ("--friction-error", "--stiffness", "--inertia", "--motor-share"))


def test_what_nobody_knows_is_asked_for():
    with pytest.raises(NotIdentifiable, match=r"stiffness=\(LOW, HIGH\)"):
        facts_of(knows(law=Law(rate=RATE)))
    with pytest.raises(NotIdentifiable, match=r"inertia=\(LOW, HIGH\)"):
        facts_of(knows(dynamics={}))
    with pytest.raises(NotIdentifiable, match="`counts`"):
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
    ("change", "says"),
    [
        ({"motor_share": 1.5}, "motor_share = 1.5, it has to be above 0 and below 1"),
        ({"delay": np.nan}, "delay = nan s"),
        ({"stiffness": (2e5, 1e5)}, "stiffness = 200000:100000, its lower end"),
        ({"stiffness": (1.0, np.inf)}, "stiffness = 1:inf"),
        ({"interval": 1e-9}, "interval = 1e-09 s"),
        ({"noise": np.nan, "counts": 0.0}, "counts = 0, .*; noise = nan"),
        ({"temperature": (20.0, 10.0)}, "temperature = 20:10 degC"),
        ({"friction_error": -0.1}, "friction_error = -0.1"),
    ],
)
def test_senseless_facts_are_refused_by_their_names(change, says):
    with pytest.raises(InvalidInput, match=says) as caught:
        facts_of(FRICTION, **change)
    assert len(str(caught.value)) < 300


def test_warnings_of_the_model_are_passed_on():
    notes = facts_of(knows(warnings=("Directions were not told apart.",)), motor_share=0.1).notes
    assert notes == ("The model warns: Directions were not told apart.", TAKEN)


@pytest.mark.parametrize(
    ("length", "duration", "says"),
    [
        (np.inf, 0.5, "stroke = inf"),
        (1e6, 0.5, "as fast as"),
        (1e-5, 0.5, "presliding"),
        (0.1, np.inf, "duration = inf"),
        (0.1, 1e-3, "less than 20 intervals"),
    ],
)
def test_senseless_strokes_are_refused(length, duration, says):
    with pytest.raises(InvalidInput, match=says):
        usual_stroke(facts_of(FRICTION), length, duration)


@pytest.mark.parametrize(
    ("change", "options", "says"),
    [
        ({"inertia": 1e-9}, {}, "integration step"),
        ({}, {"joints": 100_000}, "joints = 100000"),
        ({}, {"seed": -1}, "seed = -1"),
    ],
)
def test_what_would_never_end_is_refused(change, options, says):
    with pytest.raises(InvalidInput, match=says):
        tune(facts_of(FRICTION, **change), **options)


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
    for m in [nominal(facts), *corners(facts), *sample(facts, 40, 0)]:
        assert facts.stiffness_interval[0] <= m.stiffness <= facts.stiffness_interval[1]
        assert facts.friction[0] <= m.friction <= facts.friction[1]
        assert 0.0 <= m.delay <= facts.delay
        assert 1.0 / m.transmission + 1.0 / m.bristle == pytest.approx(1.0 / m.stiffness)
    assert sample(facts, 8, 3) == sample(facts, 8, 3)


def test_places_in_the_unit_cube_go_there_and_back():
    ranges = {"share": (0.3, 0.9), "decay": (5.0, 500.0)}
    u = np.array([0.25, 0.75])
    np.testing.assert_allclose(inverse(ranges, place(ranges, u)), u)
    assert place(ranges, np.array([0.0, 0.5]))["decay"] == pytest.approx(50.0)


def test_friction_that_is_hardly_known_leaves_a_range_of_r():
    low, high = goal_of("backdrive", f := facts_of(FRICTION, friction_error=0.75), usual_stroke(f)).ranges[
        "share"
    ]
    assert 0.0 < low < high == pytest.approx(0.25)


def test_bisection_finds_where_it_breaks():
    assert least_breaking(lambda x: x > 0.7, 0.0, 1.0, 12) == pytest.approx(0.7, abs=1e-3)
    assert least_breaking(lambda x: False, 0.0, 1.0) == np.inf
    assert least_breaking(lambda x: 0.3 < x < 0.5, 0.0, 1.0, steps=12) == pytest.approx(0.3, abs=1e-3)


def test_grids_of_the_picture_hold_the_chosen_value():
    assert with_value((1.0, 2.0, 4.0), 2.2) == [1.0, 2.2, 4.0]
    assert with_value((1.0, 2.0, 4.0), 0.0) == [0.0, 2.0, 4.0]


@needs_jit
def test_numbers_are_taken_back_until_they_pass_the_whole_test_or_are_refused():
    facts = facts_of(FRICTION, motor_share=0.1, delay=3e-3)
    goal, members = goal_of("backdrive", facts, usual_stroke(facts)), sample(facts, 8, 0)
    goal = replace(goal, calming=[{"share": 0.6}, {"share": 0.7, "stiffness": 0.4}])  # in large steps
    begun = {"share": 0.85, "stiffness": 0.7, "decay": 20.0}
    assert {m.delay for m in ends(goal)} == set(np.linspace(0.0, 3e-3, 7))
    assert not safe(goal, begun, members)
    kept = calm(goal, begun, members)
    assert safe(goal, kept, members)
    assert kept["share"] < begun["share"]
    restless = replace(goal, unrest=lambda r: 2.0, calming=[{"share": 0.5}], test_on=[nominal(facts)])
    with pytest.raises(NotIdentifiable, match="Even with the largest reduction"):
        calm(restless, begun, [])


def test_beside_the_way_back_lies_a_better_point_that_passes_too(monkeypatch):
    """A border in R and alpha: less R costs the hand more than a faster decay does."""
    facts = facts_of(FRICTION, motor_share=0.1)
    goal = goal_of("backdrive", facts, usual_stroke(facts))
    cost = lambda z: 1.0 - z["share"] + 0.01 * np.log(z["decay"])  # noqa: E731
    monkeypatch.setattr(Goal, "scores", lambda self, many: np.array([cost(z) for z in many]))
    monkeypatch.setattr(safety, "trials", lambda goal, members: [("joint", 1.0), ("another", 1.0)])
    monkeypatch.setattr(refine_module, "trials", safety.trials)

    def unrest(goal, z, tried, longest=0.0):
        border = {"joint": 0.8, "another": 0.84}  # the second is met where the first has been left behind
        return [t for t in tried if z["share"] > border[t[0]] * (z["decay"] / 20.0) ** 0.05]

    monkeypatch.setattr(safety, "restless", unrest)
    monkeypatch.setattr(refine_module, "restless", unrest)
    begun = {"share": 0.85, "stiffness": 0.7, "decay": 20.0}
    back, better = calm(goal, begun, []), refine_module.refine(goal, begun, [], 0)
    assert not unrest(goal, better, [("joint", 1.0), ("another", 1.0)])
    assert cost(better) < cost(back) - 0.005
    assert better["decay"] > back["decay"] == 20.0
    passing = {"share": 0.7, "stiffness": 0.7, "decay": 20.0}
    assert refine_module.refine(goal, passing, [], 0) == passing


@pytest.mark.parametrize(
    ("border", "kept"), [(0.84, 0.85 * 0.5**0.25), (0.6, 0.85 * 0.5**0.75), (0.43, 0.425), (0.9, 0.85)]
)
def test_the_last_step_back_is_halved_twice(monkeypatch, border, kept):
    facts = facts_of(FRICTION, motor_share=0.1)
    goal = replace(goal_of("backdrive", facts, usual_stroke(facts)), calming=[{"share": 0.5}])
    monkeypatch.setattr(safety, "trials", lambda goal, members: [("joint", 1.0)])
    monkeypatch.setattr(
        safety, "restless", lambda goal, z, tried, longest=0.0: [t for t in tried if z["share"] > border]
    )
    found = calm(goal, {"share": 0.85, "stiffness": 0.7, "decay": 20.0}, [])
    assert found == pytest.approx({"share": kept, "stiffness": 0.7, "decay": 20.0})


@needs_jit
def test_the_fixed_rule_is_proposed_where_it_is_safe_and_better():
    facts = facts_of(FRICTION, motor_share=0.1, counts=1e7)
    goal, members = goal_of("track", facts, usual_stroke(facts)), sample(facts, 8, 0)
    poor = {"share": 0.35, "stiffness": 0.2, "decay": 100.0}
    rows = _rows(facts, "track", goal, poor, members, 0)
    assert rows["fixed rule"]["safe"] and not rows["thesis"]["safe"]
    assert rows["chosen"]["numbers"] == fixed_rule(facts)
    assert "From the fixed rule" in origin(fixed_rule(facts), None, "share", "")
    assert "from 0.5 to 0.35" in origin(poor, {**poor, "share": 0.5}, "share", "")


@needs_jit
def test_a_search_repeats_itself_and_is_safe(quick):
    facts = facts_of(FRICTION, motor_share=0.1)
    goal = goal_of("backdrive", facts, usual_stroke(facts), wish="light")
    first, again = (search(goal, seed=2, width=8) for _ in range(2))
    assert first == again
    assert first.numbers is not None
    assert goal.worst([first.numbers])[0] <= 1.0
    assert first.score < 0.75 * goal.scores([{"share": 0.0, "stiffness": 0.5, "decay": 20.0}])[0]


def test_numbers_at_an_end_of_their_range_are_named():
    facts = facts_of(FRICTION, motor_share=0.1)
    goal = goal_of("backdrive", facts, usual_stroke(facts))
    low, high = goal.ranges["decay"]
    inside = {name: float(np.sqrt(a * b)) for name, (a, b) in goal.ranges.items()}
    assert edges(goal, inside) == []
    (said,) = edges(goal, inside | {"decay": low})
    assert "alpha_N" in said and "lower end" in said
    assert "upper end" in edges(goal, inside | {"decay": high})[0]


def test_a_wish_that_there_is_not_is_answered_with_those_that_there_are():
    facts = facts_of(FRICTION, motor_share=0.1)
    with pytest.raises(InvalidInput, match="even, light, touch, calm"):
        goal_of("backdrive", facts, usual_stroke(facts), wish="soft")


@needs_jit
def test_what_a_hand_feels_falls_and_rises_as_it_must():
    """A slower decay leaves more standing, more of R takes force from the hand and lets the joint coast further."""
    facts = facts_of(FRICTION, motor_share=0.1)
    goal = goal_of("backdrive", facts, usual_stroke(facts))
    many = [
        {"share": R, "stiffness": 0.5, "decay": a}
        for R, a in ((0.8, 2.0), (0.8, 100.0), (0.4, 100.0), (0.0, 20.0))
    ]
    felt = goal.part_scores(many)
    assert felt["standing"][0] > 5.0 * felt["standing"][1]
    assert felt["force"][1] < felt["force"][2] < 1.0
    assert felt["coast"][1] > felt["coast"][2]
    assert [felt[k][3] for k in ("force", "touch", "coast")] == pytest.approx([1.0, 1.0, 1.0], rel=0.02)
    assert felt["standing"][3] == 0.0


@pytest.fixture
def quick(monkeypatch):
    """Close in with one size of step."""
    monkeypatch.setattr("backdrive.tuning.search.STEPS", (0.1,))


@needs_jit
@pytest.mark.parametrize("goal", ["backdrive", "estimate", "admit"])
def test_a_tuning_runs_is_kept_and_respects_its_bounds(goal, tmp_path):
    facts, tuning = facts_of(FRICTION, motor_share=0.2), tuned(goal)
    (kept,) = load_tunings(save_tunings([tuning], tmp_path / "tuning.json"))
    with pytest.raises(ModelFileError, match="there twice"):
        load_tunings(save_tunings([tuning, tuning], tmp_path / "twice.json"))
    assert kept.compensator() == tuning.compensator()
    assert kept.external() == tuning.external()
    assert all(number.reason for number in kept.numbers.values())
    assert kept.rate == RATE
    Loop([kept.loop(top_speed=3.0)], interval=kept.interval).update(np.zeros(1), np.zeros(1))
    assert all(row["safe"] for name, row in tuning.scores["rows"].items() if name in ("chosen", "none"))
    if goal == "backdrive":
        assert kept.admittance() == tuning.admittance()
        assert tuning["share"] <= 0.9 + 1e-9
        assert tuning["stiffness"] <= facts.stiffest * (1.0 + 1e-9)
        assert tuning.margins["at_rest"] == 1.0
        assert tuning.margins["cycle_by_bound"] <= 1.0
        assert tuning.margins["breakaway"] < tuning.margins["breakaway_bare"]
        assert tuning.margins["share_breaks"] > tuning["share"]
        assert tuning.margins["delay_breaks"] > facts.delay
        assert tuning.margins["delay_searched"] == pytest.approx(0.012)
        assert tuning["dither_share"] == 0.0 or tuning.margins["dither_motor"] > tuning.margins["cycle"]
        assert kept.compensator(switching=True).friction.fast_decay == tuning["fast_decay"]
        return
    assert not {"dither_share", "fast_decay", "threshold"} & set(tuning.numbers)
    if goal == "estimate":
        with pytest.raises(InvalidInput, match="has no 'admittance_inertia'"):
            kept.admittance()
    else:
        assert tuning["admittance_inertia"] >= tuning.numbers["admittance_inertia"].limit
        assert kept.external().friction.law.rate == scale_rate(RATE, 0.9, 1.0)


@needs_jit
def test_what_is_printed_says_units_and_dither(capsys):
    show_tuning(tuned("backdrive"))
    said = " ".join(capsys.readouterr().out.split())
    assert "without dither: 100 % come to rest" in said
    assert ("With the dither, at rest" in said) == (tuned("backdrive")["dither_share"] > 0.0)
    assert "all rest" in said
    assert "standing: remaining torque after a stop, relative to F" in said
    assert "With algFC2" in said


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("{}", "not a tuning"),
        ('{"format": "backdrive-tuning", "schema": 9}', "schema"),
        ('{"format": "backdrive-tuning", "schema": true}', "schema"),
        ('{"format": "backdrive-tuning", "schema": 1, "joints": 5}', r"\$.joints"),
        ('{"format": "backdrive-tuning", "schema": 1, "joints": []}', r"\$.joints"),
        ('{"format": "backdrive-tuning", "schema": 1, "joints": [{}]}', r"joints\[0\]"),
    ],
)
def test_a_damaged_tuning_is_refused_with_the_place(tmp_path, content, says):
    path = tmp_path / "tuning.json"
    path.write_text(content)
    with pytest.raises(ModelFileError, match=says):
        load_tunings(path)
    for absent in (tmp_path / "absent.json", "/dev/zero"):
        with pytest.raises(ModelFileError, match="Cannot read"):
            load_tunings(absent)


@needs_jit
@pytest.mark.parametrize(
    ("place", "value", "says"),
    [
        ("numbers/share/value", 5.0, r"'j0'.*numbers.share.value = 5, it has to be"),
        ("numbers/stiffness/value", 10**400, "damaged"),
        ("numbers/fast_decay", None, "numbers.fast_decay is missing"),
        ("unit", "deg", r"\$.joints\[0\].unit"),
        ("goal", "bogus", r"\$.joints\[0\].goal"),
        ("interval", 0.0, "interval = 0 s"),
        ("interval", float("nan"), "damaged"),
        ("inertia", -1.0, "inertia = -1"),
        ("joint", None, "joint"),
        ("seed", float("inf"), "damaged"),
        ("rate/name", "bogus", "bogus"),
    ],
)
def test_a_tuning_that_makes_no_sense_is_refused_with_joint_and_key(tmp_path, place, value, says):
    path = save_tunings([tuned("backdrive")], tmp_path / "tuning.json")
    document = json.loads(path.read_text())
    *way, last = place.split("/")
    at = document["joints"][0]
    for key in way:
        at = at[key]
    if value is None:
        del at[last]
    else:
        at[last] = value
    path.write_text(json.dumps(document))
    with pytest.raises(ModelFileError, match=says):
        load_tunings(path)


def command(*words):
    """Return exit code and output of the command, as `main` would end it."""
    result = CliRunner().invoke(app, ["tune", *words])
    code = getattr(result.exception, "exit_code", result.exit_code) if result.exception else 0
    return code, result


@needs_jit
def test_command_writes_file_and_picture(tmp_path, quick, monkeypatch):
    monkeypatch.setattr("backdrive.tuning.margins.SHARES", (0.6, 0.8, 1.0))
    monkeypatch.setattr("backdrive.tuning.margins.SPRINGS", (0.25, 0.5, 1.0))
    monkeypatch.setattr("backdrive.tuning.margins.DECAYS", (5.0, 20.0, 500.0))
    model, out, picture = (tmp_path / n for n in ("model.json", "tuning.json", "region.png"))
    FrictionModel(joints=(FRICTION,)).save(model)
    code, result = command(str(model), "--joints", "8", "-o", str(out), "--picture", str(picture), "--json")
    assert code == 0, result.output
    answer = json.loads(result.stdout)
    assert answer["joints"][0]["region"]["delays"][-1] > 1.5e-3
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
        (["--seed", "-1"], 2),
        (["--motor-share", "0.1:0.2"], 2),
        (["--inertia", "elbow=0.7"], 2),
        (["--stiffness", "8e4:1e5", "--stiffness", "1e5:1.2e5"], 2),
        (["--joint", "nobody"], 2),
    ],
)
def test_command_refuses_what_makes_no_sense(tmp_path, words, code):
    model = tmp_path / "model.json"
    FrictionModel(joints=(FRICTION,)).save(model)
    assert command(str(model), *words)[0] == code


def test_the_model_is_not_overwritten_and_an_example_is_of_its_option(tmp_path):
    model = tmp_path / "model.json"
    FrictionModel(joints=(FRICTION,)).save(model)
    kept = model.read_bytes()
    code, result = command(str(model), "-o", str(model))
    assert code == 2 and "Cannot write" in str(result.exception)
    assert model.read_bytes() == kept
    assert "--inertia 0.6:0.8" in command(str(model), "--inertia", "light")[1].exception.text


@needs_jit
def test_several_joints_have_numbers_of_their_own_and_one_does_not_stop_the_others(tmp_path, quick):
    model, out = tmp_path / "model.json", tmp_path / "tuning.json"
    joints = [knows(joint=Joint(name=f"j{i}", unit="rad", encoder_counts=1e6)) for i in range(3)]
    FrictionModel(joints=tuple(joints)).save(model)
    words = [str(model), "--joint", "j0", "--joint", "j1", "--joint", "j0", "--joints", "8"]
    for wrong in (["--counts", "1e6"], ["--picture", str(tmp_path / "region.png")]):
        assert command(*words, *wrong)[0] == 2
    code, result = command(*words, "--counts", "j1=1e3", "--counts", "j0=2e6", "-o", str(out))
    assert code == 1
    assert "'j1': its encoder is too coarse" in result.stderr
    assert [tuning.joint for tuning in load_tunings(out)] == ["j0"]
