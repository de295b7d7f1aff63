"""The rules of plausibility: what is planted is remarked on, once, with its numbers, and nothing on a sound log."""

from dataclasses import replace

import numpy as np
import pytest

from _synthetic import any_motion, motion
from backdrive import identify
from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.identification import lateness, validate
from backdrive.identification import plausibility_residual as residual_rules
from backdrive.identification.alignment import best_lag, is_of_joint
from backdrive.identification.delay import LATE
from backdrive.identification.lateness import delay, delay_beside_distance
from backdrive.identification.names import same_names
from backdrive.identification.outliers import count_single
from backdrive.identification.plausibility_law import break_away, vague_level
from backdrive.identification.plausibility_numbers import certainty, delay_at_bound, unseen_presliding
from backdrive.identification.quality import grade
from backdrive.identification.remark import Case
from backdrive.identification.result import Curve
from backdrive.identification.signals import prepare
from backdrive.laws import Law, LuGre, StribeckGauss
from backdrive.logs.log import Joint, Log
from backdrive.model import Estimate
from backdrive.plans import Multisine


def dry(v):
    return 5.0 * np.sign(v) + 2.0 * v


def remarks(log, **options):
    friction = identify(log, method="motion", **options).model.joints[0]
    return grade(friction).level, friction.warnings


def half(log):
    return np.arange(len(log))[:, None] > len(log) // 2


@pytest.fixture(scope="module")
def sound():
    return any_motion(dry)


def test_a_sound_log_is_good(sound):
    assert remarks(sound)[0] == "good"


@pytest.mark.parametrize(
    ("plant", "words"),
    [
        (
            lambda log: log.torque + 1.0 * np.sin(9.0 * log.position),
            "Torque follows the position",
        ),
        (lambda log: log.torque * np.where(half(log), 1.3, 1.0), "changed midway"),
        (lambda log: log.torque + 3.0 * np.linspace(0.0, 1.0, len(log))[:, None], "drifts over the log"),
        (lambda log: np.round(log.torque / 3.0) * 3.0, "Torque is read in steps of 3 N.m"),
        (
            lambda log: log.torque + 60.0 * (np.arange(len(log))[:, None] % 150 == 7),
            "far off their neighbours",
        ),
    ],
)
def test_what_is_planted_is_remarked_on_first(sound, plant, words):
    _, sentences = remarks(sound.replace(torque=plant(sound)), accept=("outlier",))
    assert sum(words in s for s in sentences) == 1
    assert len(set(sentences)) == len(sentences)


@pytest.mark.parametrize(
    ("reach", "fastest", "said"),
    [
        (0.2, 0.45, None),
        (0.2, 0.58, "At 0.94 rad/s the curve is known to ± 2.7 N.m (53 % of the mean friction) only"),
        (0.6, 0.6, "The curve is known to ± 3 N.m (60 %) only"),
    ],
)
def test_a_curve_of_which_a_part_is_hardly_known_is_not_good(sound, reach, fastest, said):
    """Errors are twice the standard ones, by the mean friction: near rest, and growing towards the top speed."""
    result = identify(sound, method="motion")
    v = np.linspace(0.0, 1.0, 101)
    error = 0.5 * 5.0 * (reach + (fastest - reach) * np.maximum(v - 0.5, 0.0) / 0.5)
    error[v < 0.1], error[v > 0.97] = 9.0, 9.0  # unseen, and extrapolated
    curve = Curve(velocity=v, torque=np.full(101, 5.0), standard_error=error)
    friction = result.model.joints[0]
    friction = replace(friction, validity=replace(friction.validity, velocity=(-1.0, 1.0), lowest_speed=0.1))
    evidence = replace(result.evidence[0], curve=curve)
    remark = certainty(Case(friction=friction, evidence=evidence, logs=(sound,)))
    assert (remark is None) if said is None else (remark.severity == "care" and said in remark.sentence)


def test_single_samples_are_outliers_and_friction_that_builds_up_is_none():
    error = 0.01 * np.random.default_rng(3).standard_normal(400)
    slides, friction = np.ones(400, dtype=bool), np.ones(400)
    assert count_single(error, slides, friction) == 0
    slides[100:107], error[100:109] = False, np.linspace(1.0, 0.2, 9)  # after a reversal; the last two slide
    assert count_single(error, slides, friction) == 0
    error[[30, 250, 399]] += 1.0  # nothing tells an outlier at the end from a step
    assert count_single(error, slides, friction) == 2
    error[251] += 1.0  # two in a row are no single one
    assert count_single(error, slides, friction) == 1


def test_known_torque_has_a_share_of_one(sound):
    known = 4.0 * np.sin(sound.position)
    level, sentences = remarks(sound.replace(torque=sound.torque + known, model_torque=0.6 * known))
    assert level == "care"
    assert "a share of 1.67" in sentences[0]


def test_a_share_is_named_where_no_errors_are_stated(sound):
    known = 4.0 * np.sin(2.9 * sound.time)[:, None]  # no gravity
    few = sound.replace(torque=sound.torque + known, model_torque=0.5 * known).rows(slice(0, 2000))
    friction = identify(few, method="motion", gravity=False).model.joints[0]
    assert np.isnan(friction.dynamics["model_torque"].standard_error)
    (sentence,) = (s for s in friction.warnings if "a share of" in s)
    assert "a share of 2 where" in sentence or "a share of 2.0" in sentence


def test_known_torque_of_the_opposite_sign(sound):
    known = 4.0 * np.sin(sound.position)
    torque = sound.torque + known
    _, sentences = remarks(sound.replace(torque=torque, model_torque=-known))
    assert "opposite sign" in sentences[0] and sentences[0].endswith("so friction is right.")
    _, sentences = remarks(sound.replace(torque=torque, model_torque=-0.6 * known))
    assert "opposite sign" in sentences[0] and "its size differs too" in sentences[0]


def test_the_motion_of_another_joint_explains_torque(sound):
    t = sound.time[:, None]
    position, acceleration = (
        np.sin(1.9 * t) + 0.5 * np.cos(4.7 * t),
        -np.sin(1.9 * t) - 3.06 * np.cos(4.7 * t),
    )
    joints, torque = (*sound.joints, Joint(name="wrist")), sound.need("torque")
    both = Log(
        time=sound.time,
        joints=joints,
        position=np.hstack([sound.need("position"), position]),
        torque=np.hstack([torque + 0.4 * acceleration, torque]),
    )
    first = identify(both, method="motion").model.joints[0]
    assert "Torque follows the acceleration of joint 'wrist'" in " ".join(first.warnings)
    alone = both.replace(torque=np.hstack([torque, torque]))
    assert not any("wrist" in s for s in identify(alone, method="motion").model.joints[0].warnings)


@pytest.mark.parametrize("hertz", [0.7, 5.0])
def test_a_small_pull_of_another_joint_is_told_but_not_sought_in_noise(sound, hertz, monkeypatch):
    w, t = 2.0 * np.pi * hertz, sound.time[:, None]
    position, own = 0.3 * np.sin(w * t), dry(0.3 * w * np.cos(w * t))
    torque = sound.need("torque")
    noise = 0.25 * np.random.default_rng(5).standard_normal(
        torque.shape
    )  # 0.11 N.m of a mean, 1.7 % of the friction
    pull = 0.02 * np.abs(dry(np.gradient(sound.need("position")[:, 0], sound.period))).mean()
    both = Log(
        time=sound.time,
        joints=(*sound.joints, Joint(name="wrist")),
        position=np.hstack([sound.need("position"), position]),
        torque=np.hstack([torque + noise - pull * np.sqrt(2.0) * np.sin(w * t), own]),
    )
    told = identify(both, method="motion").model.joints[0].warnings
    assert any("of joint 'wrist'" in sentence for sentence in told)
    monkeypatch.setattr(residual_rules, "other_joints", lambda case: pytest.fail("it is costly"))
    alone = both.replace(torque=np.hstack([torque + noise, own]))
    assert not any("wrist" in s for s in identify(alone, method="motion").model.joints[0].warnings)


@pytest.mark.parametrize(
    ("options", "advice"),
    [({"method": "motion", "law": "coulomb-viscous"}, "polyline"), ({"law": "coulomb-viscous"}, "auto")],
)
def test_a_line_through_bent_friction_is_not_good(options, advice):
    """Friction that is smaller at low speeds; a line explains nine tenths of the torque."""
    bent = any_motion(lambda v: 2.0 * dry(v) - 5.0 * np.sign(v) * np.exp(-((v / 0.3) ** 2)))
    line = identify(bent, **options).model.joints[0]
    assert line.fitted.residual < 15.0
    assert line.verdict.grade == "care"
    assert "not that of this law" in line.warnings[0] and f"--law {advice}" in line.warnings[0]
    curve = identify(bent, method="motion").model.joints[0]
    assert curve.verdict.grade == "good" and not curve.warnings
    straight = identify(any_motion(dry), **options).model.joints[0]
    assert "of this law" not in " ".join(straight.warnings)


def test_levels_of_a_law_that_contradict_each_other_or_are_not_known(sound):
    line = identify(sound, method="motion", law="coulomb-viscous")
    friction, evidence = line.model.joints[0], line.evidence[0]
    peak = {"breakaway": 4.88, "coulomb": 5.0, "stribeck_velocity": 0.01, "viscous": 2.0}
    law = Law(rate=StribeckGauss(**peak))

    def said(errors):
        changed = replace(friction, law=law, standard_errors=dict(zip(peak, errors, strict=True)))
        case = Case(friction=changed, evidence=evidence)
        return [rule(case) for rule in (break_away, vague_level)]

    slight, known = said([0.01, 0.01, 0.002, 0.01])
    assert slight.severity == "note" and "(4.88 N.m) lies below Coulomb friction (5 N.m)" in slight.sentence
    assert known is None
    unsure, vague = said([0.1, 6.0, 60.0, 0.2])
    assert unsure is None
    assert (
        vague.severity == "care"
        and "coulomb 5 ± 6 N.m" in vague.sentence
        and "breakaway" not in vague.sentence
    )


def test_a_torque_at_its_limit_is_not_good(sound):
    torque = sound.need("torque")
    clipped = sound.replace(torque=np.minimum(torque, 0.6 * torque.max()))
    level, said = remarks(clipped)
    assert level == "care" and any("Torque is flat at" in s for s in said)


@pytest.mark.parametrize(("factor", "level"), [(1.0, "good"), (1.02, "good"), (1.1, "care")])
def test_a_velocity_of_another_clock_is_not_good(sound, factor, level):
    q = sound.need("position")
    velocity = np.gradient(q, sound.time, axis=0)
    found, said = remarks(sound.replace(velocity=factor * velocity))
    assert found == level
    assert any("differ by a factor of" in s for s in said) == (level == "care")


def test_a_curve_whose_error_nobody_knows_is_not_good(sound):
    """Four moves: the fit is close, and the torque may be far off."""
    few = sound.rows(slice(0, round(3.0 / sound.period)))
    one = identify(few, method="motion").model.joints[0]
    assert not one.standard_errors and one.fitted.residual < 0.1
    assert one.verdict.grade == "care"
    assert one.warnings[0].startswith("No standard errors are stated: the joint made only")
    assert " ".join(one.warnings).count("No standard errors") == 1


@pytest.mark.parametrize("joint", ["j1", "joint"])
def test_a_clock_that_is_not_its_plans(sound, joint):
    plan = Multisine(1.2, 0.15, 1.2, 10.0, periods=2, joint=joint)
    time = np.arange(round(plan.duration * 500)) / 500
    q, dq, ddq = (f(time)[:, None] for f in (plan.position, plan.velocity, plan.acceleration))
    tau = dry(dq) + 0.5 * ddq + 0.05 * np.random.default_rng(2).standard_normal(q.shape)
    log = Log(time=time, joints=sound.joints, position=q, torque=tau, plan=plan)
    assert not remarks(log)[1]
    level, sentences = remarks(log.replace(time=1.1 * time))
    assert level == "good"
    assert "1.100 times as long as its plan" in sentences[0]


def test_a_motion_that_is_not_its_plans_or_began_at_another_instant(sound):
    plan = Multisine(1.2, 0.15, 1.2, 10.0, periods=2, joint="j1")
    time = np.arange(round((plan.duration + 3.0) * 500)) / 500
    inside = np.clip(time - 2.0, 0.0, plan.duration)
    q, dq, ddq = (f(inside)[:, None] for f in (plan.position, plan.velocity, plan.acceleration))
    tau = dry(dq) + 0.5 * ddq + 0.05 * np.random.default_rng(2).standard_normal(q.shape)
    log = Log(time=time, joints=sound.joints, position=q, torque=tau)
    for start in (0.0, 2.0, 2.02):  # 0 is no claim
        assert not [s for s in remarks(log.replace(plan=replace(plan, start=start)))[1] if "plan" in s]
    level, sentences = remarks(log.replace(plan=replace(plan, start=5.0)))
    assert level == "good" and any(s.startswith("The plan began 2.00 s after") for s in sentences)
    other = Multisine(1.2, 0.23, 1.9, 10.0, periods=2, seed=3, joint="j1")
    assert any("did not move as planned" in s for s in remarks(log.replace(plan=other))[1])
    with pytest.raises(NotIdentifiable, match="took 1.100 times as long"):
        best_lag(log.replace(time=1.1 * time), plan)


def test_a_plan_is_of_the_joint_that_it_names_or_of_the_only_one(sound):
    both = Log(
        time=sound.time, joints=(*sound.joints, Joint(name="wrist")), position=np.hstack([sound.position] * 2)
    )
    plan = Multisine(1.2, 0.15, 1.2, 10.0)
    assert is_of_joint(sound.replace(plan=plan), "j1")
    assert not is_of_joint(both.replace(plan=plan), "j1")
    assert is_of_joint(both.replace(plan=replace(plan, joint="wrist")), "wrist")


def test_names_that_were_made_up_match_by_order_alone():
    made = [Joint(name=f"joint_{i}", named=False) for i in (1, 2)]
    given = [Joint(name=name, named=True) for name in ("base", "arm")]
    assert same_names(given, given, "model", "logs") == []
    assert same_names(made[:1], made[:1], "model", "logs") == []
    assert "matched by their order" in same_names(made, made, "model", "logs")[0]
    with pytest.raises(InvalidInput, match="model: base, arm; logs: joint_1, joint_2"):
        same_names(given, made, "model", "logs")


def test_a_change_within_each_of_several_logs():
    logs = [any_motion(dry, seed=k, seconds=12.0, phase=3.0 * k) for k in range(3)]
    assert not identify(logs, method="motion").model.joints[0].warnings
    changed = [log.replace(torque=log.need("torque") * np.where(half(log), 1.2, 1.0)) for log in logs]
    assert any("changed midway" in s for s in identify(changed, method="motion").model.joints[0].warnings)


def test_known_torque_that_is_too_small_to_be_told(sound):
    known = 0.01 * np.sin(3.0 * sound.time[:, None])
    sentences = remarks(sound.replace(torque=sound.torque + 40.0 * known, model_torque=known))[1]
    assert any("it is too small to be told. Leave it out" in s for s in sentences)


def test_few_moves_tell_no_delay():
    time = np.arange(4000) / 500.0
    q = np.sin(0.7 * time)
    dq = 0.7 * np.cos(0.7 * time)
    tau = np.roll(dry(dq) + 8.0 * np.sin(3.0 * time), 30)  # a pull that the model does not know
    log = Log(time=time, joints=(Joint(name="j1"),), position=q, torque=tau)
    assert not any("ms later" in s or "ms earlier" in s for s in remarks(log)[1])


@pytest.mark.parametrize(("late", "said"), [(0.0, False), (0.04, True)])
def test_a_stribeck_peak_is_no_delay(late, said):
    rate, cycles = 500.0, 8
    phase = np.concatenate([np.arange(0.0, 1.0, 1.0 / (rate * 6.3 / n)) for n in range(1, cycles + 1)])
    q = -0.6 * np.cos(2.0 * np.pi * phase)
    dq = np.gradient(q) * rate
    tau = dry(dq) + 3.0 * np.sign(dq) * np.exp(-((dq / 0.6) ** 2)) + 0.3 * np.gradient(dq) * rate
    tau = np.roll(tau, round(late * rate)) + 0.1 * np.random.default_rng(1).standard_normal(tau.size)
    log = Log(time=np.arange(q.size) / rate, joints=(Joint(name="j1"),), position=q, torque=tau)
    result = identify(log, method="motion")
    case, known = result.evidence[0].residual, result.model.joints[0].delay
    found, left = (case and delay(case)) or (0.0, 1.0)
    found += known if abs(known) >= LATE else 0.0  # the residual is in step with it
    assert (abs(found - late) < 0.011) if said else (abs(found) < 0.011 or left > 0.96)


def soft_log(width, late=0.0, ripple=0.0):
    """Return a log of a joint whose friction builds up over a distance [rad] after each reversal, torque late by a time [s]."""
    rate, z, friction = 500.0, 0.0, []
    t = np.arange(7500) / rate
    waves = ((0.06, 1.3, 0.3), (0.02, 3.6, 1.1), (0.008, 5.9, 2.0))
    q, dq, ddq = (sum(f(a, w, w * t + p) for a, w, p in waves) for f in (
        lambda a, w, x: a * np.sin(x), lambda a, w, x: a * w * np.cos(x), lambda a, w, x: -a * w * w * np.sin(x),
    ))  # fmt: skip
    for step in np.diff(q, prepend=q[0]):
        z = float(np.clip(z + step, -width, width))
        friction.append(1.5 * z / width)
    tau = np.array(friction) * (1.0 + ripple * np.sin(40.0 * q)) + 0.4 * dq + 0.15 * ddq
    tau = np.interp(t - late, t, tau) + 0.05 * np.random.default_rng(1).standard_normal(t.size)
    return Log(time=t, joints=(Joint(name="j1"),), position=q, torque=tau)


@pytest.mark.parametrize(
    ("width", "late", "said"), [(2e-3, 0.0, False), (4e-3, 0.0, False), (1e-4, 0.05, True)]
)
def test_friction_that_builds_up_over_a_distance_is_no_delay(width, late, said):
    result = identify(soft_log(width, late), method="motion")
    case, known = result.evidence[0].residual, result.model.joints[0].delay
    known = known if abs(known) >= LATE else 0.0  # the residual is in step with it
    assert delay(case)[0] + known > 0.014  # by a shift alone, both are late
    every = remarks(soft_log(width, late))[1]
    assert any("ms later" in s or "is hardly known" in s for s in every) is said
    assert delay_beside_distance(case)[0] + known == pytest.approx(late, abs=0.015)


def test_a_known_torque_that_hardly_differs_from_gravity_is_not_told_from_it(sound):
    known = 0.02 * np.sin(sound.position) + 0.001 * np.sin(3.0 * sound.position)
    level, sentences = remarks(sound.replace(torque=sound.torque + known, model_torque=known), gravity=True)
    assert level == "care"
    assert any("does not tell it from the other terms" in s for s in sentences)


def test_one_way_tells_no_friction_from_a_constant_torque():
    time = np.arange(4000) / 500.0
    dq = 1.0 + 0.5 * np.sin(2.0 * time)
    tau = dry(dq) + 0.3 * np.cos(2.0 * time) + 0.02 * np.random.default_rng(0).standard_normal(time.size)
    log = Log(time=time, joints=(Joint(name="j1"),), position=np.cumsum(dq) / 500.0, torque=tau)
    level, sentences = remarks(log)
    assert level == "care" and sum("in one direction only" in s for s in sentences) == 1


def test_two_delays_are_not_told_on_one_page(sound):
    late = sound.replace(torque=np.roll(sound.torque, round(0.05 / sound.period), axis=0))
    level, sentences = remarks(late, accept=("time-slip",))
    found = [s for s in sentences if "later than" in s or "earlier than" in s]
    assert len(found) <= 1 and (level == "care" or found)


def turning(width, *, rate=200.0, seconds=1.4, warming=0.0, colour=0.0, seed=0):
    """Return a log of moves, each pair faster, whose friction builds up over a distance [rad] and changes by a share in all."""
    generator, fine = np.random.default_rng(seed), 20  # steps a sample, since friction builds up within a few
    step, blur = 1.0 / (rate * fine), np.ones(round(0.2 * rate)) / round(0.2 * rate)
    wanted = np.repeat(np.outer(np.arange(0.2, 1.3, 0.2), [1.0, -1.0]), round(seconds * rate))
    rough = np.convolve(wanted, blur, "same")
    dq = np.interp(np.arange(rough.size * fine) / fine, np.arange(rough.size), rough)
    q, z, friction = np.cumsum(dq) * step, 0.0, np.empty(dq.size)
    for k, move in enumerate(np.diff(q, prepend=0.0).tolist()):
        z = min(max(z + move, -width), width)
        friction[k] = 3.0 * z / width * (1.0 + warming * k / dq.size)
    tau = friction + 0.8 * dq + 0.3 * np.gradient(dq, step)
    noise = generator.standard_normal(rough.size)
    for k in range(1, noise.size):
        noise[k] = colour * noise[k - 1] + np.sqrt(1.0 - colour**2) * noise[k]
    time = np.arange(noise.size) / rate
    return Log(time=time, joints=(Joint(name="j1"),), position=q[::fine], torque=tau[::fine] + 0.1 * noise)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("width", "warming", "colour"), [(0.02, 0.0, 0.0), (1e-3, -0.3, 0.9)])
def test_friction_that_builds_up_is_not_warming(seed, width, warming, colour):
    sentences = remarks(turning(width, warming=warming, colour=colour, seed=seed))[1]
    assert any("Friction changes over the log" in s for s in sentences) is bool(warming), sentences


def test_a_torque_that_is_late_but_found_leaves_no_residual():
    late = any_motion(dry, delay=0.05)
    result = identify(late, method="motion", accept=("time-slip",))
    one = result.model.joints[0]
    assert one.delay == pytest.approx(0.05, abs=1e-3) and one.held_out.residual < 2.0  # %
    assert validate(result.model, [late])["j1"].residual < 2.0
    assert len(one.warnings) == 1 and "this delay was estimated and corrected" in one.warnings[0]


@pytest.mark.parametrize(("delay", "said"), [(0.008, False), (0.013, True)])
def test_a_delay_of_many_samples_that_was_found_is_remarked_not_graded(delay, said):
    level, sentences = remarks(any_motion(dry, delay=delay))
    assert level == "good" and any("this delay was estimated and corrected" in s for s in sentences) is said


@pytest.mark.parametrize(
    ("seconds", "form"), [(0.1, "{:.3g} ± "), (0.15, "of which {:.0f} ms were found and corrected")]
)
def test_a_delay_of_which_only_a_part_was_found_is_one_number(seconds, form):
    """A filter delays slow motion more than fast: the inertia shows less of it than the friction."""
    log = any_motion(dry, noise=0.02)
    torque = np.empty(len(log))
    state, gain = float(log.torque[0, 0]), 1.0 - np.exp(-log.period / seconds)
    for k, u in enumerate(log.torque[:, 0].tolist()):
        state += gain * (u - state)
        torque[k] = state
    one = identify(log.replace(torque=torque[:, None]), method="motion", accept=("time-slip",))
    known = one.model.joints[0].delay
    said = [s for s in one.model.joints[0].warnings if "later than" in s]
    assert len(said) == 1 and form.format(1e3 * known) in said[0]


@pytest.mark.parametrize(("slip", "told"), [(-0.008, True), (-0.004, False), (0.008, False), (0.015, False)])
def test_two_delays_that_contradict_each_other_are_one_remark_and_not_good(monkeypatch, sound, slip, told):
    """All terms tell 16 ms, as where friction builds up over a distance, and the inertia another delay."""
    monkeypatch.setattr(lateness, "delay", lambda res, *others: (0.016, 0.9))
    monkeypatch.setattr(lateness, "delay_beside_distance", lambda res, *others: None)
    result = identify(sound, method="motion")
    (friction,), (evidence,) = result.model.joints, result.evidence
    dynamics = friction.dynamics | {"time_slip": Estimate(value=slip, unit="s", standard_error=5e-4)}
    remark = residual_rules.delay(
        Case(friction=replace(friction, dynamics=dynamics, covariance=None), evidence=evidence)
    )
    assert (remark.severity == "care") is told
    said = "By the inertia, torque comes 8 ms earlier than motion; by all terms, about 16 ms later"
    assert (said in remark.sentence) is told


@pytest.mark.parametrize("late", [True, False])
def test_stamps_that_vary_are_told_from_samples_that_do(late):
    """Interpolation onto an even clock is right for the latter; of the former it made noise of the position."""
    log, jitter = any_motion(dry, rate=200.0, seconds=20.0), np.random.default_rng(4)
    time = log.time + 0.15 * log.period * jitter.standard_normal(len(log))
    if not late:
        log = log.replace(position=np.interp(time, log.time, log.position[:, 0]))
        log = log.replace(torque=np.interp(time, log.time, log.torque[:, 0]))
    (signals,) = prepare(log.replace(time=time), "j1")
    off = signals.velocity - motion(signals.time)[1]
    assert np.sqrt(np.mean(off[20:-20] ** 2)) < 2e-3  # rad/s; 0.016 of late stamps that are believed


def test_another_load_in_one_of_several_logs():
    logs = [any_motion(dry, inertia=j, seed=k, phase=3.0 * k) for k, j in enumerate((0.5, 0.7))]
    said = identify(logs, method="motion").model.joints[0].warnings
    assert sum("Inertia or gravity differs between the logs" in sentence for sentence in said) == 1


def test_one_speed_a_log_on_a_coarse_encoder_is_no_other_load():
    """The slowest log tells no inertia: beside it, a factor for each other log is as large as the inertia itself."""
    rng, count, logs = np.random.default_rng(0), 2.0 * np.pi / 2**17, []
    for speed in (0.05, 0.1, 0.2, 0.3, 0.4, 0.6):
        rise, level = (
            np.arange(0.0, speed, 0.004),
            np.full(round(1000.0 / speed), speed),
        )  # 4 rad/s2, about a rad
        move = np.concatenate([np.zeros(300), rise, level, rise[::-1]])
        dq = np.concatenate([move, -move, np.zeros(300)])
        q = 0.001 * np.cumsum(dq)
        torque = 1000.0 * np.gradient(dq) + 50.0 * np.sin(q - 0.5) + 5.0 * np.tanh(dq / 1e-4) + 3.0 * dq
        torque += 0.3 * rng.standard_normal(q.size)
        time = 0.001 * np.arange(q.size)
        logs.append(Log.from_arrays(time=time, position=count * np.round((q - 0.5) / count), torque=torque))
    (one,) = identify(logs, method="motion").model.joints
    assert one.dynamics["inertia"].value == pytest.approx(1.0, abs=0.03)
    assert not [sentence for sentence in one.warnings if "differs between the logs" in sentence]


def test_fine_cogging(sound):
    sentences = remarks(sound.replace(torque=sound.torque + 0.5 * np.sin(70.0 * sound.position)))[1]
    assert any("Torque follows the position every 0.09" in s for s in sentences)


@pytest.mark.parametrize(("speeds", "said"), [((0.1, 0.3, 1.0, 2.0), False), ((0.1, 0.15, 1.5, 2.0), True)])
def test_speeds_at_which_the_joint_hardly_moved(speeds, said):
    moves = np.concatenate([np.r_[np.full(700, v), np.full(700, -v)] for v in speeds] * 2)
    dq = np.convolve(moves, np.ones(20) / 20, "same")
    tau = dry(dq) + 0.3 * np.gradient(dq) * 500.0 + 0.05 * np.random.default_rng(2).standard_normal(dq.size)
    log = Log(
        time=np.arange(dq.size) / 500.0,
        joints=(Joint(name="j1"),),
        position=np.cumsum(dq) / 500.0,
        torque=tau,
    )
    assert any("hardly moved at speeds between 0.1" in s for s in remarks(log)[1]) is said


def test_a_delay_at_the_end_of_its_range_is_not_good(sound):
    result = identify(sound, method="motion")
    ended = replace(
        result.model.joints[0], dynamics={"delay": Estimate(value=0.05, standard_error=np.nan, unit="s")}
    )
    case = Case(friction=ended, evidence=result.evidence[0])
    assert delay_at_bound(case).severity == "care" and "50 ms" in delay_at_bound(case).sentence
    assert delay_at_bound(replace(case, known_delay=0.05)) is None


def test_validation_names_the_joints_that_have_no_partner(sound):
    other = replace(sound, joints=(Joint(name="a"), Joint(name="b")), **{
        name: np.column_stack([getattr(sound, name)] * 2) for name in ("position", "torque")
    })  # fmt: skip
    model = identify(other, method="motion").model
    again = replace(other, joints=(Joint(name="a"), Joint(name="c")))
    (said,) = validate(model, [again]).remarks
    assert "b of the model, c of the logs" in said and "--rename" in said


def test_a_delay_beside_another_cause_is_in_doubt():
    late = any_motion(dry, delay=0.05)
    level, sentences = remarks(
        late.replace(torque=late.torque + 0.4 * np.sin(9.0 * late.position)), accept=("time-slip",)
    )
    assert level == "care" and "What else is said below may look like a delay." in sentences[0]
    assert any("follows the position" in s for s in sentences)


@pytest.mark.parametrize(("counts", "said"), [(4096, True), (2**20, False)])
def test_an_encoder_too_coarse_for_the_stiffness(sound, counts, said):
    step = 2.0 * np.pi / counts
    read = sound.replace(position=step * np.round(sound.position / step))
    result = identify(sound, method="motion")
    law = replace(
        result.model.joints[0].law, element=LuGre(stiffness=5.0 / 1e-3)
    )  # friction builds up over 1 mrad
    case = Case(friction=replace(result.model.joints[0], law=law), evidence=result.evidence[0], logs=[read])
    remark = unseen_presliding(case)
    assert (remark is not None and remark.severity == "care") is said
    assert unseen_presliding(replace(case, friction=result.model.joints[0])) is None


def test_a_drift_is_told_by_its_whole_range():
    log = any_motion(dry)
    drift = log.replace(torque=log.torque + 4.0 * (log.time / log.time[-1])[:, None])
    (said,) = [w for w in identify(drift, method="motion").model.joints[0].warnings if "drifts" in w]
    assert float(said.split("by ")[1].split(" ")[0]) == pytest.approx(4.0, rel=0.1)


def test_little_friction_beside_a_large_inertia_lacks_no_torque():
    """The encoder's steps in the acceleration, by the inertia, are no torque that is missing."""
    t = np.arange(1600) / 100.0
    w = 2.0 * np.pi * np.array([0.13, 0.41, 0.9])
    q = np.sin(np.outer(t, w)) @ np.array([0.9, 0.4, 0.2])
    v, a = np.cos(np.outer(t, w)) @ (w * [0.9, 0.4, 0.2]), -np.sin(np.outer(t, w)) @ (w**2 * [0.9, 0.4, 0.2])
    noise = 0.005 * np.random.default_rng(1).standard_normal(t.size)
    tau = 0.5 * a + 0.15 * np.tanh(v / 0.01) + 0.04 * v + noise
    step = 2.0 * np.pi / 4096
    log = Log(
        time=t, joints=(Joint(name="a"),), position=step * np.round(q / step)[:, None], torque=tau[:, None]
    )
    assert not any("slow torque" in said for said in identify(log).model.joints[0].warnings)


def test_the_band_widens_below_the_lowest_speed_that_is_told():
    t = np.arange(6000) / 200.0
    w, phase = 2.0 * np.pi * np.array([0.07, 0.161, 0.287, 0.539, 0.917]), np.arange(5.0)
    q, v, a = (
        (w ** (k - 1) * np.sin(np.outer(t, w) + phase + k * np.pi / 2)).sum(axis=1)[:, None] for k in range(3)
    )
    tau = dry(v) + 0.5 * a + 0.05 * np.random.default_rng(2).standard_normal(v.shape)
    result = identify(Log(time=t, joints=(Joint(name="j1"),), position=q, torque=tau), method="motion")
    curve, low = result.evidence[0].curve, result.model.joints[0].validity.lowest_speed
    assert low is not None
    speed, error = np.abs(curve.velocity), curve.standard_error
    assert error[speed < 0.9 * low].min() > 3.0 * error[(speed >= low) & (speed < 2.0 * low)].max()
