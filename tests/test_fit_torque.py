"""A law from logs, torque given motion: what is found, what is said not to be seen, and how sure it is."""

from dataclasses import replace

import numpy as np
import pytest

from backdrive.engine import rollout
from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.identification.delay import earlier
from backdrive.identification.dynamic.covariance import inverse, search_covariance
from backdrive.identification.dynamic.fit import conclude
from backdrive.identification.dynamic.law_fit import fit_law
from backdrive.identification.dynamic.search import Search, screen
from backdrive.identification.dynamic.starts import scales, starts, with_less_delay
from backdrive.identification.dynamic.stretch import Stretch, stretch
from backdrive.identification.dynamic.torque import TorqueProblem
from backdrive.identification.dynamic.uncertainty import bootstrap, profile
from backdrive.identification.dynamic.unknowns import LawShape, shares
from backdrive.identification.signals import prepare
from backdrive.identification.slip import between_samples
from backdrive.laws import Law, MaxwellSlip, Polyline, StribeckGauss
from backdrive.laws.examples import example
from backdrive.logs.filters import low_pass
from backdrive.logs.log import Joint, Log

DT = 2e-3
INERTIA = 0.3
LATE = 3e-3  # s, of the torque
COUNT = 1e-6  # rad


def velocity(presliding: bool = True) -> np.ndarray:
    """Return a motion on a grid ten times finer than the log [rad/s]."""
    h = DT / 10
    pieces = [v * np.sin(2 * np.pi * np.arange(0, 0.8, h) / 0.8) for v in (0.05, 0.2, 0.6)]
    for stroke in (2e-3, 1e-3, 6e-4, 4e-4, 2.5e-4) if presliding else ():
        t = np.arange(0, 4 * stroke / 4e-3, h) * 4e-3 / (2 * stroke)
        pieces.append(np.where(t % 1.0 < 0.5, 4e-3, -4e-3))
    return low_pass(np.concatenate([np.zeros(500), *pieces, np.zeros(500)]), 20.0, 1 / h)


def recorded(law, *, v=None, noise=0.1, seed=0, late=LATE, load=None) -> Stretch:
    """Return what a fit sees of a log whose position is counted in steps and whose torque is late and noisy."""
    v = velocity() if v is None else v
    h = DT / 10
    q, a = np.cumsum(v) * h, np.gradient(v, h)
    at = np.arange(0, len(q), 10)
    then = np.maximum(at - round(late / h), 0)
    rng = np.random.default_rng(seed)
    moved = {"dq": v[then]} if law.element.SET_VALUED else {"q": q[then]}  # without a state: at the instant
    torque = rollout(law, **moved, dt=DT, load=load) + INERTIA * a[then]
    torque = torque + noise * rng.standard_normal(len(at))
    log = Log(
        time=at * h,
        joints=(Joint(name="j", encoder_counts=1 / COUNT),),
        position=(np.round(q[at] / COUNT) * COUNT)[:, None],
        torque=torque[:, None],
    )
    (signals,) = prepare(log, 0)
    return stretch(signals, load=load)


def fitted(shape, *logs, **options):
    options = {"counts": 1 / COUNT, "terms": ("inertia",), "begin": 8, "descend": 1} | options
    return fit_law(shape, list(logs), **options)


def off(fit, expected: dict[str, float]) -> dict[str, float]:
    """Return by how many standard errors each number is off."""
    return {k: abs(fit.values[k] - x) / fit.standard_errors[k] for k, x in expected.items()}


@pytest.mark.parametrize("name", ["stribeck-gauss", "lugre"])
def test_a_law_is_recovered_within_its_errors(name):
    law = example(name)
    found = fitted(law.name, recorded(law))
    expected = law.rate.values() | law.element.values() | {"inertia": INERTIA, "delay": LATE}
    if name == "lugre":  # a slow log without vibration
        assert set(found.unseen) <= {"damping", "fading"}
        expected = {k: x for k, x in expected.items() if k not in found.unseen}
    assert found.converged and found.rms == pytest.approx(0.1, rel=0.1)
    assert max(off(found, expected).values()) < 4.0
    for key, value in expected.items():
        low, high = found.interval(key)
        assert low < found.values[key] < high
        assert key == "delay" or high - low < 0.4 * abs(value)


def test_elements_side_by_side_are_recovered_and_sorted():
    k, w = (2e3, 1.2e4, 5e3), (0.2, 0.5, 0.3)
    law = Law(rate=example("stribeck-gauss").rate, element=MaxwellSlip(stiffness=k, share=w))
    found = fitted(LawShape.from_name("maxwell-slip", count=3), recorded(law))
    assert isinstance(found.law.element, MaxwellSlip)
    assert found.law.element.stiffness == pytest.approx((1.2e4, 5e3, 2e3), rel=0.15)
    assert found.law.element.share == pytest.approx((0.5, 0.3, 0.2), abs=0.05)
    ratios = {"share[0]": np.log(2.5), "share[1]": np.log(1.5)}
    assert max(off(found, ratios).values()) < 4.0


def test_the_order_of_elements_does_not_change_the_torque():
    law = example("maxwell-slip")
    s = recorded(law)
    problem = TorqueProblem(
        LawShape.from_name(law.name, count=3), [s], scales([s], ("inertia",), "rad", None), terms=("inertia",)
    )
    search = Search(problem.residuals, problem.lower, problem.upper, loss="linear")
    values = {
        "stiffness[0]": 2e3,
        "stiffness[1]": 1.2e4,
        "stiffness[2]": 5e3,
        "share[0]": 0.4,
        "share[1]": 1.0,
    }
    found = search.run(
        problem.point(problem.values(starts(problem, scales([s], (), "rad", None), 1, 0)[0]) | values),
        iterations=0,
    )
    sorted_ = problem.sort_elements(found)
    assert problem.values(sorted_.point)["stiffness[0]"] == pytest.approx(1.2e4)
    again = problem.residuals(sorted_.point[None])
    assert again[0] == pytest.approx(found.residual, abs=1e-9)
    J = search.jacobian(sorted_.point, again[0])
    assert np.abs(J - sorted_.jacobian).max() < 1e-3 * np.abs(J).max()


def test_a_curve_is_fitted_at_knots_that_are_given():
    knots = (0.02, 0.1, 0.5)
    law = Law(rate=Polyline(velocity=knots, positive=(5.0, 4.5, 5.5), negative=(4.5, 4.0, 5.5)))
    with pytest.raises(InvalidInput, match="knots"):
        fitted("polyline", recorded(law))
    found = fitted(LawShape.from_name("polyline", count=3, fixed={"velocity": knots}), recorded(law))
    assert isinstance(found.law.rate, Polyline)
    assert found.law.rate.positive == pytest.approx((5.0, 4.5, 5.5), rel=0.02)
    assert found.law.rate.negative == pytest.approx((4.5, 4.0, 5.5), rel=0.02)


def test_the_threshold_of_a_dead_zone_is_found():
    law = example("dead-zone")
    found = fitted(law.name, recorded(law, v=velocity(presliding=False)))
    assert found.values["threshold"] == pytest.approx(0.01, rel=0.05)
    assert not found.unseen


def test_a_load_that_never_varies_is_named():
    law = example("m3")
    v = velocity(presliding=False)
    n = len(np.arange(0, len(v), 10))
    steady = np.tile([0.0, 5.0], (n, 1))
    found = fitted("m3", recorded(law, v=v, load=steady))
    assert "load" in found.unseen
    sentence = found.unseen["load"]
    assert "'load' is not identifiable from this motion" in sentence
    assert "coulomb" in sentence and "several loads" in sentence
    assert sentence in found.warnings


def test_presliding_that_the_motion_does_not_show_is_named():
    found = fitted("lugre", recorded(example("stribeck-gauss"), v=velocity(presliding=False), noise=0.3))
    assert {"damping", "fading"} <= set(found.unseen)
    assert "vibration" in found.unseen["damping"]


def test_bounds_hold_and_contradictory_ones_are_refused():
    s = recorded(example("stribeck-gauss"), v=velocity(presliding=False))
    found = fitted("stribeck-gauss", s, bounds={"coulomb": (4.5, 5.0)})
    assert 4.5 <= found.values["coulomb"] <= 5.0
    assert "coulomb" in found.at_bound and any(
        "'coulomb' ended at the lower bound" in w for w in found.warnings
    )
    for asked in ((5.0, 4.0), (-2.0, -1.0)):
        with pytest.raises(InvalidInput, match="coulomb"):
            fitted("stribeck-gauss", s, bounds={"coulomb": asked})


@pytest.mark.parametrize(
    ("what", "says"), [("rest", "never moves"), ("constant", "same number"), ("short", "20 samples")]
)
def test_what_cannot_be_fitted_is_said_in_words(what, says):
    n = 20 if what == "short" else 500
    q = np.zeros(n) if what == "rest" else np.sin(0.05 * np.arange(n))
    torque = np.full(n, 2.0) if what == "constant" else np.random.default_rng(0).standard_normal(n)
    s = Stretch(
        dp=np.diff(q, prepend=q[:1]),
        position=q,
        acceleration=np.gradient(np.gradient(q, DT), DT),
        torque=torque,
        dt=DT,
        judged=np.ones(n, dtype=bool),
    )
    with pytest.raises(NotIdentifiable, match=says) as caught:
        fitted("coulomb", s)
    assert caught.value.remedy


@pytest.mark.parametrize("call", [4, 9, 19])
def test_an_interruption_keeps_the_best_so_far(call, monkeypatch):
    s = recorded(example("stribeck-gauss"), v=velocity(presliding=False))
    whole, calls = TorqueProblem.residuals, []

    def interrupted(self, points):
        calls.append(len(points))
        if len(calls) == call:
            raise KeyboardInterrupt
        return whole(self, points)

    monkeypatch.setattr(TorqueProblem, "residuals", interrupted)
    found = fitted("stribeck-gauss", s)
    assert found.interrupted and any("interrupted" in w for w in found.warnings)
    assert np.isfinite(found.rms) and found.rms < np.std(s.torque)


def test_an_interruption_before_anything_was_found_passes_on(monkeypatch):
    def interrupted(self, points):
        raise KeyboardInterrupt

    monkeypatch.setattr(TorqueProblem, "residuals", interrupted)
    with pytest.raises(KeyboardInterrupt):
        fitted("stribeck-gauss", recorded(example("stribeck-gauss"), v=velocity(presliding=False)))


def test_the_search_ends_where_scipy_does():
    from scipy.optimize import least_squares

    s = recorded(example("stribeck-gauss"), v=velocity(presliding=False))
    sizes = scales([s], ("inertia",), "rad", 1 / COUNT)
    problem = TorqueProblem(LawShape.from_name("stribeck-gauss"), [s], sizes, terms=("inertia",), delay=True)
    start = starts(problem, sizes, 1, 0)[0]
    ours = Search(problem.residuals, problem.lower, problem.upper, loss="linear").run(start)
    theirs = least_squares(
        lambda p: problem.residuals(p[None])[0], start, bounds=(problem.lower, problem.upper), x_scale="jac"
    )
    assert ours.converged
    assert ours.cost == pytest.approx(2 * theirs.cost, rel=1e-7)
    scale = np.sqrt(
        np.diag(search_covariance(ours.jacobian, ours.residual, ours.weight, np.ones(6, bool)).matrix)
    )
    assert np.abs((ours.point - theirs.x) / scale).max() < 0.05


def test_a_robust_loss_bears_spikes():
    s = recorded(example("stribeck-gauss"), v=velocity(presliding=False))
    torque = s.torque.copy()
    torque[::50] += 20.0 * np.sign(s.velocity[::50])
    s = replace(s, torque=torque)
    plain, robust = (fitted("stribeck-gauss", s, loss=loss) for loss in ("linear", "huber"))
    assert abs(robust.values["breakaway"] - 6.0) < 0.1 < abs(plain.values["breakaway"] - 6.0)


def line(n=3000, sigma=0.2, seed=0):
    rng = np.random.default_rng(seed)
    X = np.stack([np.ones(n), np.linspace(-1, 1, n), np.sin(np.linspace(0, 60, n))], axis=1)
    y = X @ [1.0, 2.0, -1.0] + sigma * rng.standard_normal(n)
    b = np.linalg.lstsq(X, y, rcond=None)[0]
    return X, y, b, X @ b - y


def test_profile_and_bootstrap_agree_with_the_covariance_of_a_line():
    X, y, b, r = line()
    cov = search_covariance(X, r, np.ones(len(r)), np.ones(3, bool))
    error = np.sqrt(np.diag(cov.matrix))
    plain = np.sqrt(np.diag(np.linalg.inv(X.T @ X))) * 0.2
    assert np.all(error > 0.95 * plain) and np.all(error < 1.3 * plain)

    def cost(at: float) -> float:
        left = y - at * X[:, 1]
        rest = X[:, [0, 2]]
        return float(np.sum((left - rest @ np.linalg.lstsq(rest, left, rcond=None)[0]) ** 2))

    low, high = profile(b[1], cost, float(r @ r), float(r @ r) / (len(r) - 3), error[1], -10.0, 10.0)
    assert (high - b[1], b[1] - low) == pytest.approx((1.96 * plain[1],) * 2, rel=0.05)
    drawn = bootstrap(X, r, np.ones(len(r)), np.ones(3, bool))
    assert drawn == pytest.approx(plain, rel=0.3)


def test_a_profile_that_never_rises_ends_at_the_bounds():
    assert profile(0.0, lambda at: 1.0, 1.0, 1.0, 0.1, -2.0, 3.0) == pytest.approx((-2.0, 3.0), abs=0.1)


def test_errors_that_stay_on_one_side_and_errors_of_the_motion_widen_the_covariance():
    X, _, _, r = line()
    free, w = np.ones(3, bool), np.ones(len(r))
    alone = search_covariance(X, r, w, free).matrix
    slow = np.repeat(np.random.default_rng(1).standard_normal(60), 50) * 0.2
    assert search_covariance(X, slow, w, free).matrix[0, 0] > 10 * alone[0, 0]
    moved = np.random.default_rng(2).standard_normal((8, 1)) * X[:, 0]
    assert search_covariance(X, r, w, free, inputs=moved).matrix[0, 0] > 10 * alone[0, 0]


def test_what_does_not_act_has_no_finite_error():
    X, _, _, r = line()
    X = np.concatenate([X, np.zeros((len(r), 1)), X[:, :1]], axis=1)
    cov = search_covariance(X, r, np.ones(len(r)), np.ones(5, bool))
    assert cov.matrix[3, 3] == np.inf
    assert cov.matrix[0, 0] > 1e6 * cov.matrix[1, 1]  # two of them act alike
    assert inverse(np.eye(2)) == pytest.approx(np.eye(2))


def test_a_series_is_moved_between_samples():
    x = np.sin(0.1 * np.arange(100))
    for d in (0.0, 1.7, -2.4, 3.0):
        assert earlier(x, d)[5:-5] == pytest.approx(np.sin(0.1 * (np.arange(100) - d))[5:-5], abs=1e-5)
    assert np.all(earlier(x, 500.0) == x[0])
    assert np.all(earlier(x, -500.0) == pytest.approx(x[-1]))


def test_shares_add_up_and_starts_lie_in_bounds():
    assert sum(shares([3.0, -2.0])) == pytest.approx(1.0)
    s = recorded(example("gms"))
    sizes = scales([s], ("inertia",), "rad", 1 / COUNT)
    problem = TorqueProblem(LawShape.from_name("gms"), [s], sizes, terms=("inertia",), delay=True)
    points = starts(problem, sizes, 20, 1)
    assert np.all(points >= problem.lower) and np.all(points <= problem.upper)
    best = screen(Search(problem.residuals, problem.lower, problem.upper), points, 3)
    assert len(best) == 3 and np.all(np.isfinite(problem.residuals(best)))


def test_a_fit_predicts_other_logs():
    law = Law(rate=StribeckGauss(coulomb=4.0, breakaway=6.0, stribeck_velocity=0.05, viscous=1.0))
    found = fitted(law.name, recorded(law, v=velocity(presliding=False)))
    other = recorded(law, v=1.2 * velocity(presliding=False), seed=5)
    (tau,) = found.predict([other])
    moving = np.abs(other.velocity) > 0.05
    assert np.sqrt(np.mean((tau - other.torque)[moving] ** 2)) < 0.15
    assert conclude(found.problem, found.found).values == pytest.approx(found.values)


def test_sets_that_share_their_friction_get_the_torque_that_each_gets_alone():
    law = example("stribeck-gauss")
    found = fitted(law.name, recorded(law, v=velocity(presliding=False)))
    point = found.found.point
    points = point + 0.01 * np.vstack([np.zeros(point.size), np.eye(point.size), np.eye(point.size)[::-1]])
    together = found.problem.residuals(points)
    assert np.array_equal(together, [found.problem.residuals(one[None])[0] for one in points])


def test_the_error_of_a_delay_counts_what_lies_between_samples():
    """Of one jump of the acceleration, a sixth of a squared interval; of many that tell alike, so much less."""
    jumps = np.zeros((200, 1))
    for many in (1, 4, 25):
        jumps[:many, 0] = (-1.0) ** np.arange(many)
        X = np.hstack([jumps, np.r_[np.zeros(100), np.ones(100)][:, None]])
        assert between_samples(X, 0, DT) == pytest.approx(DT**2 / (6.0 * many))
        spread = np.repeat(X, 5, axis=0)  # by a low pass, over as many samples as a bin has
        assert between_samples(spread, 0, DT, 5) == pytest.approx(DT**2 / (6.0 * many))
    law = Law(rate=StribeckGauss(coulomb=4.0, breakaway=6.0, stribeck_velocity=0.05, viscous=1.0))
    found = fitted(law.name, recorded(law, v=velocity(presliding=False), noise=1e-6))
    kept = found.found.jacobian * np.sqrt(found.found.weight)[:, None]
    least = np.sqrt(between_samples(kept, found.problem.names.index("delay"), DT, round(0.01 / DT)))
    assert found.standard_errors["delay"] == pytest.approx(least, rel=0.2)


@pytest.mark.parametrize(
    ("law", "about", "delays"),
    [
        ("coulomb-viscous+lugre", 0.02, {0.0, 0.01}),
        ("coulomb-viscous+lugre", 0.0, set()),
        ("coulomb-viscous", 0.02, set()),
    ],
)
def test_friction_that_builds_up_over_a_distance_may_be_what_looks_late(law, about, delays):
    record = recorded(example("stribeck-gauss"))
    sizes = scales([record], ("inertia",), "rad", 1.0 / COUNT)
    problem = TorqueProblem(
        LawShape.from_name(law), [record], sizes, terms=("inertia",), delay=True, about=about
    )
    points = with_less_delay(problem, starts(problem, sizes, 12, 0))
    assert {round(problem.values(point)["delay"], 9) for point in points} == delays
