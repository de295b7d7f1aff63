"""A population or a former model as the prior of a log: against closed forms, on drawn robots, and from the command line."""

import json
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from backdrive import Joint, Log, identify, load_model, read_log
from backdrive.cli import app
from backdrive.errors import InvalidInput, ModelFileError, UnknownName
from backdrive.fleet.population_file import Member, Population
from backdrive.identification.conjugate import conjugate
from backdrive.identification.prior import as_priors, combine, prior_of
from backdrive.laws import CoulombViscous, Law, Polyline
from backdrive.model import Covariance, FrictionModel, JointFriction, Validity

BETWEEN = np.array([[0.01, 0.004], [0.004, 0.01]])
WITHIN = 1e-4 * np.eye(2)
TONES = ((0.15, 0.8, 0.3), (0.35, 0.45, 1.1), (0.85, 0.15, 2.0))  # Hz, rad, rad


def pairs(matrix):
    return tuple(map(tuple, np.asarray(matrix).tolist()))


def member(**changes):
    given = {
        "type": "", "joint": "j1", "unit": "rad", "robots": 40, "left_out": (), "top_speed": 2.0,
        "mean": (float(np.log(3.0)), float(np.log(2.0))), "between": pairs(BETWEEN), "within": pairs(WITHIN),
    }  # fmt: skip
    return Member(**given | changes)


def population(**changes):
    return Population(members=(member(**changes),))


def log_of(constant, viscous, *, noise=0.8, seed=0, temperature=None):
    random, t = np.random.default_rng(seed), np.arange(1600) / 200.0
    q, dq, ddq = np.zeros((3, t.size))
    for hertz, amplitude, phase in TONES:
        w, shift = 2 * np.pi * hertz, phase + random.uniform(0.0, 6.0)
        q += amplitude * np.sin(w * t + shift)
        dq += amplitude * w * np.cos(w * t + shift)
        ddq -= amplitude * w * w * np.sin(w * t + shift)
    tau = (
        0.5 * ddq
        + constant * np.sign(dq)
        + viscous * dq
        + 4.0 * np.sin(q)
        + noise * random.standard_normal(t.size)
    )
    warm = {} if temperature is None else {"temperature": np.full((t.size, 1), temperature)}
    return Log.from_arrays(time=t, position=q[:, None], torque=tau[:, None], joints=["j1"], **warm)


def line_joint(values, C, **changes):
    names = ("coulomb_positive", "viscous_positive", "coulomb_negative", "viscous_negative")
    given = {
        "joint": Joint(name="j1"), "law": Law(rate=CoulombViscous(**dict(zip(names, map(float, values), strict=True)))),
        "standard_errors": dict(zip(names, np.sqrt(np.diag(C)).tolist(), strict=True)),
        "covariance": Covariance.of(names, np.asarray(C)), "validity": Validity(velocity=(-2.0, 2.0)),
    }  # fmt: skip
    return JointFriction(**given | changes)


def values(friction):
    rate = friction.law.rate
    return np.array(
        [rate.coulomb_positive, rate.viscous_positive, rate.coulomb_negative, rate.viscous_negative]
    )


def spd(random, n):
    root = random.standard_normal((n, n + 2))
    return root @ root.T


@pytest.fixture(scope="module")
def log():
    return log_of(3.3, 1.9, seed=1)


@pytest.fixture(scope="module")
def alone(log):
    return identify(log)


def test_the_update_is_the_precision_weighted_mean():
    random = np.random.default_rng(18)
    C, S, H = spd(random, 5), spd(random, 3), random.standard_normal((3, 5))
    theta, m = random.standard_normal(5), random.standard_normal(3)
    precision = np.linalg.inv(C) + H.T @ np.linalg.inv(S) @ H
    mean = np.linalg.solve(precision, np.linalg.solve(C, theta) + H.T @ np.linalg.solve(S, m))
    update = conjugate(theta, C, H, H @ theta, m, S)
    np.testing.assert_allclose(update.mean, mean, rtol=1e-9)
    np.testing.assert_allclose(update.covariance, np.linalg.inv(precision), rtol=1e-9)
    gap = m - H @ theta
    assert update.distance**2 == pytest.approx(gap @ np.linalg.solve(H @ C @ H.T + S, gap))
    assert update.degrees == 3


def test_the_distance_has_heavier_tails_with_few_robots():
    one = np.ones(1), np.eye(1), np.eye(1), np.ones(1), np.array([4.0]), np.eye(1)
    exact, five = conjugate(*one), conjugate(*one, robots=5)
    assert exact.p == pytest.approx(0.0339, rel=0.01)  # of |z| > 3 / sqrt 2
    assert five.p == pytest.approx(0.101, rel=0.01)  # of |t| > 3 / sqrt 2 with 4 degrees of freedom


@pytest.mark.parametrize("robots", [4, 6, 12, 40])
def test_intervals_hold_with_few_robots(robots):
    random = np.random.default_rng(robots)
    C, eye = np.array([[0.012, -0.005], [-0.005, 0.01]]), np.eye(2)
    held, errors, p = [], [], []
    for _ in range(2000):
        drawn = random.multivariate_normal(np.zeros(2), BETWEEN, robots)
        truth, log = (
            random.multivariate_normal(np.zeros(2), BETWEEN),
            random.multivariate_normal(np.zeros(2), C),
        )
        S = np.cov(drawn.T) * (1.0 + 1.0 / robots)
        update = conjugate(truth + log, C, eye, truth + log, drawn.mean(axis=0), S, robots)
        error = update.mean - truth
        held.append(np.abs(error) < 1.96 * np.sqrt(np.diag(update.covariance)))
        errors.append((error, log))
        p.append(update.p)
    assert 0.92 < np.mean(held) < 0.97
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    assert np.all(rms[0] < rms[1])
    assert np.mean(np.array(p) < 0.01) < 0.015


def test_a_log_and_its_population_are_combined_and_both_are_stated(log, alone, tmp_path):
    result = identify(log, prior=population())
    friction, before = result.model.joint("j1"), alone.model.joint("j1")
    prior = friction.prior
    assert prior.applied
    assert prior.p > 0.01
    assert prior.source == "population of 40 robots"
    assert [n.name for n in prior.numbers] == ["constant", "viscous"]
    # an independent closed form: the mean of both directions, precision-weighted
    A = 0.5 * np.array([[1.0, 0.0, 1.0, 0.0], [0.0, 1.0, 0.0, 1.0]])
    rows = ["coulomb_positive", "viscous_positive", "coulomb_negative", "viscous_negative"]
    own = [before.covariance.names.index(row) for row in rows]
    C = A @ before.covariance.array()[np.ix_(own, own)] @ A.T
    m = np.array([3.0, 2.0])
    S = (BETWEEN * (1 + 1 / 40) + WITHIN) * np.outer(m, m) * (39 / 36)  # of 40 robots
    P = np.linalg.inv(C) + np.linalg.inv(S)
    both = np.linalg.solve(P, np.linalg.solve(C, A @ values(before)) + np.linalg.solve(S, m))
    np.testing.assert_allclose(A @ values(friction), both, rtol=1e-6)
    np.testing.assert_allclose([n.combined for n in prior.numbers], both, rtol=1e-6)
    np.testing.assert_allclose([n.log for n in prior.numbers], A @ values(before), rtol=1e-9)
    np.testing.assert_allclose(
        [n.combined_error**2 for n in prior.numbers], np.diag(np.linalg.inv(P)), rtol=1e-5
    )
    assert prior.log_alone["coulomb_positive"][0] == before.law.rate.coulomb_positive
    assert friction.standard_errors["coulomb_positive"] < before.standard_errors["coulomb_positive"]
    # the whole covariance moves the other terms too
    assert friction.dynamics["offset"].value != before.dynamics["offset"].value
    assert "by the log" in result.evidence[0].verdict
    np.testing.assert_allclose(
        result.evidence[0].curve.torque, friction.law.torque(result.evidence[0].curve.velocity)
    )
    result.model.save(tmp_path / "m.json")
    assert load_model(tmp_path / "m.json").joint("j1").prior == prior
    assert json.loads((tmp_path / "m.json").read_text())["provenance"]["options"]["prior"] == [prior.source]
    assert "prior" not in alone.model.to_dict()["joints"][0]


def test_a_log_unlike_its_siblings_keeps_its_numbers(alone, log):
    far = population(mean=(float(np.log(6.0)), float(np.log(2.0))))
    result = identify(log, prior=far)
    friction, before = result.model.joint("j1"), alone.model.joint("j1")
    assert not friction.prior.applied
    assert friction.prior.p < 0.01
    assert friction.prior.numbers[0].combined > friction.prior.numbers[0].log  # stated, but not used
    assert replace(friction, prior=None, warnings=(), verdict=None) == replace(
        before, warnings=(), verdict=None
    )
    assert any("unlike its siblings" in sentence for sentence in friction.warnings)
    assert "The numbers are the log's alone." in result.evidence[0].verdict


def test_two_hundred_robots_are_estimated_better_with_their_population():
    random = np.random.default_rng(7)
    prior = as_priors(population())[0]
    C = np.kron(np.array([[1.0, 0.3], [0.3, 1.0]]), np.array([[0.09, -0.05], [-0.05, 0.05]]))
    root = np.linalg.cholesky(C)
    errors, p = [], []
    for _ in range(200):
        truth = np.tile(np.exp(random.multivariate_normal(np.log([3.0, 2.0]), BETWEEN + WITHIN)), 2)
        before = line_joint(np.maximum(truth + root @ random.standard_normal(4), 0.0), C)
        after = combine(before, prior)
        p.append(after.prior.p)
        sigma = np.sqrt(np.diag(after.covariance.array()))
        errors.append([values(before) - truth, values(after) - truth, (values(after) - truth) / sigma])
    one, both, scaled = np.transpose(errors, (1, 0, 2))
    rms = [np.sqrt(np.mean(e**2, axis=0)) for e in (one, both)]
    assert np.all(rms[1] < 0.9 * rms[0])
    assert 0.90 < np.mean(np.abs(scaled) < 1.96) < 0.99
    assert np.mean(np.array(p) < 0.01) < 0.03


def test_knots_are_compared_at_those_of_the_prior():
    random = np.random.default_rng(3)
    names = [f"{way}[{i}]" for way in ("positive", "negative") for i in range(3)]

    def joint(V, torque, C, top):
        spread = np.sqrt(np.diag(C)).tolist()
        return JointFriction(
            joint=Joint(name="j1"), law=Law(rate=Polyline(velocity=V, positive=torque[:3], negative=torque[3:])),
            standard_errors={"positive": tuple(spread[:3]), "negative": tuple(spread[3:])},
            covariance=Covariance.of(names, C), validity=Validity(velocity=(-top, top)),
        )  # fmt: skip

    C, S = 0.01 * spd(random, 6), 0.01 * spd(random, 6)
    own, other = (5.0, 4.5, 5.5, 4.8, 4.4, 5.4), (5.1, 4.6, 5.2, 5.0, 4.5, 5.3)
    log, former = joint((0.1, 0.5, 1.0), own, C, 1.0), joint((0.2, 0.8, 1.5), other, S, 1.5)
    near = prior_of(former).within(-1.0, 1.0)  # the knot at 1.5 is beyond the log
    assert near.names == ("friction at 0.2", "friction at 0.8", "friction at -0.2", "friction at -0.8")
    after = combine(log, near)
    W = np.array([[0.75, 0.25, 0.0], [0.0, 0.4, 0.6]])
    H, kept = np.kron(np.eye(2), W), [0, 1, 3, 4]
    P = np.linalg.inv(C) + H.T @ np.linalg.inv(S[np.ix_(kept, kept)]) @ H
    mean = np.linalg.solve(
        P, np.linalg.solve(C, own) + H.T @ np.linalg.solve(S[np.ix_(kept, kept)], np.array(other)[kept])
    )
    rate = after.law.rate
    np.testing.assert_allclose([*rate.positive, *rate.negative], mean, rtol=1e-6)
    np.testing.assert_allclose(after.covariance.array(), np.linalg.inv(P), rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(
        np.square([*after.standard_errors["positive"], *after.standard_errors["negative"]]),
        np.diag(np.linalg.inv(P)), rtol=1e-5,
    )  # fmt: skip


def test_a_former_model_is_a_prior_of_each_direction(alone):
    C = np.diag([0.04, 0.01, 0.04, 0.01])
    first, second = line_joint((3.0, 2.0, 3.2, 2.2), C), line_joint((3.4, 2.2, 3.0, 2.0), C)
    after = combine(second, prior_of(first))
    np.testing.assert_allclose(values(after), 0.5 * (values(first) + values(second)), rtol=1e-6)
    np.testing.assert_allclose(np.diag(after.covariance.array()), 0.5 * np.diag(C), rtol=1e-6)
    assert prior_of(alone.model.joint("j1")).slopes


def test_a_population_says_nothing_about_the_difference_of_the_directions():
    C = np.diag([0.04, 0.01, 0.04, 0.01])
    before = line_joint((3.5, 2.2, 2.9, 2.4), C)
    after = combine(before, as_priors(population())[0])
    np.testing.assert_allclose(values(after)[:2] - values(after)[2:], [0.6, -0.2], atol=1e-9)


def test_a_smaller_range_of_speeds_is_compared_and_a_much_smaller_one_is_not():
    prior = as_priors(population(top_speed=3.0))[0]
    C = np.diag([0.04, 0.01, 0.04, 0.01])
    near = prior.within(-2.0, 2.0)
    assert np.abs(near.velocity).max() == pytest.approx(2.0)
    whole = combine(line_joint((3.4, 2.2, 3.0, 2.0), C), prior)
    part = combine(line_joint((3.4, 2.2, 3.0, 2.0), C), near)
    np.testing.assert_allclose(values(part), values(whole), rtol=1e-9)  # of lines it makes no difference
    assert prior.within(-1.0, 1.0) is None
    result = identify(log_of(3.0, 2.0, seed=2), prior=population(top_speed=9.0))
    assert result.model.joint("j1").prior is None
    assert any("the prior ends at 9 rad/s" in sentence for sentence in result.warnings)


def test_the_population_is_taken_at_the_temperature_of_the_log():
    warm = population(temperature=20.0, warmth=(-0.02, -0.01))
    result = identify(log_of(3.0 * np.exp(-0.4), 2.0 * np.exp(-0.2), seed=3, temperature=40.0), prior=warm)
    numbers = result.model.joint("j1").prior.numbers
    assert numbers[0].prior == pytest.approx(3.0 * np.exp(-0.4))
    assert numbers[1].prior == pytest.approx(2.0 * np.exp(-0.2))


def test_priors_that_do_not_fit_are_refused(log):
    with pytest.raises(InvalidInput, match="prior = 3"):
        identify(log, prior=3)
    with pytest.raises(InvalidInput, match="prior = 'population.json'"):
        identify(log, prior="population.json")
    with pytest.raises(InvalidInput, match="2 priors of joint 'j1'"):
        identify(log, prior=[*population().priors(), *population().priors()])
    with pytest.raises(InvalidInput, match=r"is in rad, and in m in the prior"):
        identify(log, prior=population(unit="m"))
    with pytest.raises(InvalidInput, match="is no prior"):
        identify(log, prior=load_model("preset:mx106/m6"))
    with pytest.raises(InvalidInput, match="does not apply to the method 'ramp'"):
        identify(log, prior=population(), method="ramp")
    two = Population(members=(member(type="a"), member(type="b")))
    with pytest.raises(InvalidInput, match="2 types: 'a', 'b'"):
        identify(log, prior=two)
    assert identify(log, prior=two.priors("a")).model.joint("j1").prior.source.endswith("of type a")
    both = Population(members=(member(joint="x"), member(joint="y")))
    with pytest.raises(InvalidInput, match="The prior is of x, y, the logs of j1"):
        identify(log, prior=both)
    assert identify(log, prior=population(joint="q1")).model.joint("j1").prior is not None  # the only joint


def test_a_log_is_not_counted_twice(log, alone, tmp_path):
    with pytest.raises(InvalidInput, match=r"holds this very log, which would count twice"):
        identify(log, prior=alone.model)  # without files the numbers themselves tell
    paths = []
    for k in range(3):
        paths.append(str(tmp_path / f"log{k}.npz"))
        one = log_of(3.0, 2.0, seed=k)
        np.savez(paths[-1], t=one.time, q=one.position, tau=one.torque)
    first, second, third = map(read_log, paths)
    one = identify(first).model
    both = identify(second, prior=one).model
    assert both.joints[0].prior.logs == (first.sources[0].sha256,)
    with pytest.raises(InvalidInput, match=r"log0\.npz"):
        identify([first, third], prior=one)
    both.save(tmp_path / "both.json")
    for twice in (first, second):  # a chain of priors, through a file
        with pytest.raises(InvalidInput, match="count twice"):
            identify(twice, prior=load_model(tmp_path / "both.json"))
    assert identify(third, prior=load_model(tmp_path / "both.json")).model.joints[0].prior.applied
    held = replace(population(), logs=(first.sources[0].sha256[:16],))
    held.save(tmp_path / "p.json")
    with pytest.raises(InvalidInput, match=r"population of 40 robots.*log0\.npz"):
        identify(first, prior=Population.load(tmp_path / "p.json"))
    assert identify(second, prior=held).model.joints[0].prior.logs == ()
    apart = identify(first, prior=replace(population(mean=(2.0, 0.7)), logs=held.logs[:0])).model
    assert not apart.joints[0].prior.applied


def test_the_command_line_takes_a_population_or_a_model(log, tmp_path):
    run, path = CliRunner().invoke, str(tmp_path / "log.npz")
    np.savez(path, t=log.time, q=log.position, tau=log.torque)
    population().save(tmp_path / "p.json")
    given = ["identify", path, "--prior", str(tmp_path / "p.json")]
    done = run(app, [*given, "-o", str(tmp_path / "m.json")])
    assert done.exit_code == 0, done.output
    assert "by the prior" in done.output
    assert load_model(tmp_path / "m.json").joints[0].prior.applied
    document = json.loads(run(app, [*given, "--json"]).output)
    assert document["model"]["joints"][0]["prior"]["numbers"][0]["name"] == "constant"
    identify(log_of(3.3, 1.9, seed=5)).model.save(tmp_path / "former.json")
    assert run(app, ["identify", path, "--prior", str(tmp_path / "former.json")]).exit_code == 0
    assert isinstance(run(app, [*given, "--prior-type", "kuka"]).exception, UnknownName)
    with_model = run(
        app, ["identify", path, "--prior", str(tmp_path / "former.json"), "--prior-type", "kuka"]
    )
    assert "is no population" in str(with_model.exception)
    assert "without a prior" in str(run(app, ["identify", path, "--prior-type", "kuka"]).exception)
    (tmp_path / "bad.json").write_text("{}")
    assert isinstance(
        run(app, ["identify", path, "--prior", str(tmp_path / "bad.json")]).exception, ModelFileError
    )


def test_a_population_of_the_former_schema_is_read(tmp_path):
    population().save(tmp_path / "p.json")
    document = json.loads((tmp_path / "p.json").read_text())
    document["schema"] = 1
    for one in document["members"]:
        del one["temperature"], one["warmth"]
    (tmp_path / "old.json").write_text(json.dumps(document))
    assert Population.load(tmp_path / "old.json") == population()


def test_a_model_of_several_joints_names_those_without_a_prior():
    former = FrictionModel(joints=(line_joint((3.0, 2.0, 3.0, 2.0), np.diag([0.04, 0.01, 0.04, 0.01])),))
    assert [prior.joint for prior in as_priors(former)] == ["j1"]
