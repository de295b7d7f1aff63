"""Whose friction changes: against the truth of the generator, and statistics against closed forms."""

from datetime import date, timedelta

import numpy as np
import pytest

from backdrive.errors import InvalidInput, ModelFileError, UnknownName
from backdrive.fleet import autocorrelation, changes
from backdrive.fleet.drift import benjamini_hochberg, drifts
from backdrive.fleet.history import History, date_of, number_of
from backdrive.fleet.page import write_page
from backdrive.fleet.population import outliers
from backdrive.fleet.population_file import Member, Population
from backdrive.fleet.simulation import Event, FleetSimulation

DAYS = 150
EVENTS = (
    Event(kind="wear", robot=1, joint=0, day=80, size=0.25, length=70),
    Event(kind="exchange", robot=2, joint=0, day=50, size=-0.2),
    Event(kind="payload", robot=3, day=60, size=3.0),
)


def joints_of(fleet: FleetSimulation, **changes) -> list[History]:
    day = number_of(fleet.first) + np.arange(float(fleet.days))
    return [
        History(
            robot=fleet.name(r, 0), type="", joint="j1", unit="rad", day=day, speed=1.0, path=["log"] * fleet.days,
            **{"constant": fleet.truth(r, 0)[:, 0], "viscous": fleet.truth(r, 0)[:, 1],
               "temperature": fleet.temperature[r]} | changes,
        )
        for r in range(fleet.robots)
    ]  # fmt: skip


def thin(one: History, every: int) -> History:
    """Return a history of only every n-th day."""
    parts = ("day", "constant", "viscous", "temperature", "path")
    return History(**{**one.__dict__, **{name: getattr(one, name)[::every] for name in parts}})


@pytest.fixture(scope="module")
def fleet():
    return FleetSimulation(robots=40, days=DAYS, events=EVENTS, seed=3)


@pytest.fixture(scope="module")
def judged(fleet):
    return drifts(joints_of(fleet))


def test_wear_and_an_exchange_are_named_and_nothing_else(judged, fleet):
    assert [one.history.robot for one in judged if one.named] == ["robot001", "robot002"]
    wear, exchange = judged[1], judged[2]
    assert (wear.shape, exchange.shape) == ("ramp", "step")
    assert exchange.sure
    near = timedelta(
        days=4
    )  # one in twenty intervals misses the truth; benchmarks/evidence/fleet_drift.py counts them
    assert wear.interval[0] - near <= fleet.day(80) <= wear.interval[1] + near
    assert exchange.interval[0] <= fleet.day(50) <= exchange.interval[1]
    assert wear.size == pytest.approx(0.25, abs=4 * wear.error)
    assert exchange.size == pytest.approx(-0.2, abs=4 * exchange.error)
    assert wear.season == "temperature"
    assert judged[0].warmth == pytest.approx(-0.15 / 12, rel=0.15)
    assert "growing" in wear.sentence
    assert "stepped" in exchange.sentence


def test_many_ramps_do_not_hide_each_other():
    """The draws without a change are made of the joints' residuals, which a tenth of ramps must not inflate."""
    wear = [Event(kind="wear", robot=r, joint=0, day=80, size=0.15, length=70) for r in range(20)]
    fleet = FleetSimulation(robots=200, days=DAYS, events=wear, seed=21)
    named = np.array([one.named for one in drifts([thin(one, 3) for one in joints_of(fleet)])])
    assert named[:20].sum() >= 18
    assert named[20:].sum() <= 4


@pytest.mark.parametrize("every", [1, 3])
def test_the_correlation_is_that_from_day_to_day(every):
    quiet = [thin(one, every) for one in joints_of(FleetSimulation(robots=200, days=360, seed=5))]
    values = [np.log(one.level)[:, None] for one in quiet]
    design = [
        np.column_stack([np.ones(one.day.size), one.temperature - one.temperature.mean()]) for one in quiet
    ]
    estimates = [
        autocorrelation.correlation(one.day, v, d) for one, v, d in zip(quiet, values, design, strict=True)
    ]
    sizes = np.full(200, quiet[0].day.size)
    rho = autocorrelation.true_correlation(np.hstack(estimates), quiet[0].day, design[0], sizes, 0)
    assert np.median(rho) == pytest.approx(0.6, abs=0.1)


def test_flipped_signs_keep_the_variance_that_the_base_took():
    day, draws = np.arange(180.0), np.random.default_rng(4)
    slow = np.column_stack([np.ones(180), np.cos(2 * np.pi * day / 365)])
    ratios = []
    for _ in range(200):
        one = changes.series(day, draws.standard_normal((180, 1)), slow, 0.0)
        W = changes.directions(one, changes.onsets(day, changes.GRID))
        flipped = changes.flip_signs(one.residual(), one.base, draws, 50)[:, 0]
        ratios.append(np.mean((W.T @ flipped) ** 2))
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.02)


def onset(size, shape, seed):
    """Date a change on day 120 of 180 of an AR(1) series with a standard deviation of 2 %."""
    day, ones = np.arange(180.0), np.ones((180, 1))
    noise = FleetSimulation.ar1_noise(np.random.default_rng(seed), (180,), 0.6)[:, None]
    ramp, step = changes.shapes(day, np.array([120.0]))
    return changes.date_change(changes.series(day, size * (ramp, step)[shape] + 0.02 * noise, ones, 0.6), 0)


def test_a_ramp_is_not_surely_a_step_and_intervals_hold_the_begin():
    ramps = [onset(0.05, 0, seed) for seed in range(100)]
    steps = [onset(0.05, 1, seed) for seed in range(100)]
    assert sum(one.sure and one.shape == "step" for one in ramps) <= 4
    assert sum(one.sure and one.shape == "ramp" for one in steps) <= 10
    for some in (ramps, steps):
        assert sum(one.interval[0] <= 120 <= one.interval[1] for one in some) >= 90


def test_since_names_later_changes_only(fleet):
    late = drifts(joints_of(fleet), since=fleet.day(65))
    assert [one.history.robot for one in late if one.named] == ["robot001"]


def test_siblings_stand_for_a_thermometer(fleet):
    blind = drifts(joints_of(fleet, temperature=np.full(DAYS, np.nan)))
    assert blind[0].season == "siblings"
    named = {one.history.robot for one in blind if one.named}
    assert {"robot001", "robot002"} <= named
    assert len(named) <= 3


def test_without_change_p_values_are_about_uniform():
    quiet = FleetSimulation(robots=300, days=120, seed=11)
    p = np.array([one.p for one in drifts(joints_of(quiet))])
    assert np.mean(p <= 0.1) < 0.17
    assert np.mean(p <= 0.5) == pytest.approx(0.5, abs=0.1)
    assert not any(one.named for one in drifts(joints_of(quiet), rate=0.01))


def test_short_histories_are_not_judged():
    short = FleetSimulation(robots=3, days=changes.LEAST - 1)
    result = drifts(joints_of(short))
    assert not any(np.isfinite(one.p) or one.named for one in result)
    assert "too short" in result[0].sentence
    with pytest.raises(InvalidInput, match="rate=2"):
        drifts([], rate=2.0)


def test_benjamini_hochberg_by_hand():
    q = benjamini_hochberg(np.array([0.01, 0.04, 0.03, 0.5]))
    assert q == pytest.approx([0.04, 0.16 / 3, 0.16 / 3, 0.5])


def test_whitening_leaves_white_noise():
    day = np.cumsum(np.random.default_rng(0).integers(1, 4, 400)).astype(float)
    draws, e = np.random.default_rng(1), np.zeros((400, 50))
    e[0] = draws.normal(size=50)
    for i in range(1, 400):
        carry = 0.7 ** (day[i] - day[i - 1])
        e[i] = carry * e[i - 1] + np.sqrt(1 - carry**2) * draws.normal(size=50)
    w = autocorrelation.whitener(day, 0.7)(e)
    assert np.mean(w[1:] * w[:-1]) / np.mean(w**2) == pytest.approx(0.0, abs=0.02)
    assert np.var(w[1:200]) == pytest.approx(np.var(w[200:]), rel=0.1)
    assert np.var(w) == pytest.approx(1 - 0.49, rel=0.05)


def test_single_wild_days_are_brought_near():
    values = np.random.default_rng(2).normal(size=(60, 1))
    values[30] = 100.0
    assert abs(autocorrelation.cut_outliers(values)[30, 0]) < 15.0
    assert np.array_equal(autocorrelation.cut_outliers(np.ones((20, 2))), np.ones((20, 2)))


def test_a_robot_unlike_its_siblings_is_named(fleet):
    joints = joints_of(FleetSimulation(robots=20, days=30, seed=5))
    assert outliers(joints) == []
    strange = joints[4]
    joints[4] = History(**{**strange.__dict__, "constant": 1.5 * strange.constant})
    (one,) = outliers(joints)
    assert (one.robot, one.part) == ("robot004", "constant")
    assert one.ratio == pytest.approx(1.5, abs=0.2)


def member(**changes) -> Member:
    values = {
        "type": "ur", "joint": "j1", "unit": "rad", "robots": 9, "left_out": (), "top_speed": 2.0,
        "mean": (float(np.log(3.0)), float(np.log(2.0))), "between": ((0.01, 0.0), (0.0, 0.04)), "within": ((0.0, 0.0), (0.0, 0.0)),
    }  # fmt: skip
    return Member(**{**values, **changes})


def test_a_population_is_kept_sampled_and_a_prior(tmp_path):
    population = Population(members=(member(),))
    population.save(tmp_path / "p.json")
    again = Population.load(tmp_path / "p.json")
    assert again == population
    model = again.model("ur")
    assert model.torque("j1", 1.0) == pytest.approx(5.0)
    robots = again.sample(400, type="ur", seed=1)
    drawn = np.log([one.joint("j1").law.rate.coulomb_positive for one in robots])
    assert np.std(drawn) == pytest.approx(0.1, rel=0.15)
    with pytest.raises(UnknownName):
        again.model("kuka")
    # equal precision: the posterior is halfway, its variance half
    mean, covariance = member().posterior(3.0 * np.exp(0.2), 2.0, np.diag([0.01 * 9.0 * np.exp(0.4), 1e6]))
    assert np.log(mean[0] / 3.0) == pytest.approx(0.1, abs=1e-6)
    assert covariance[0, 0] / mean[0] ** 2 == pytest.approx(0.005, rel=1e-6)
    assert mean[1] == pytest.approx(2.0, rel=1e-3)
    with pytest.raises(InvalidInput):
        member().posterior(-1.0, 2.0, np.eye(2))
    (tmp_path / "bad.json").write_text('{"format": "x"}')
    with pytest.raises(ModelFileError):
        Population.load(tmp_path / "bad.json")


def test_the_page_holds_no_foreign_script_and_no_address(judged, tmp_path):
    hostile = judged[0].history
    wrong = type(judged[0])(
        history=History(**{**hostile.__dict__, "robot": "</script><script>alert(1)</script>"}), p=0.5
    )
    path = write_page(tmp_path / "f.html", [*judged, wrong], title="<b>")
    text = path.read_text()
    assert text.count("<script") == 2
    assert "alert(1)" in text
    assert "<script>alert" not in text
    assert "&lt;b&gt;" in text
    assert text.index("robot001/j1") < text.index("robot000/j1")
    assert "http" not in text.replace("http-equiv", "").replace("http://www.w3.org/2000/svg", "")


def test_dates():
    assert date_of(number_of(date(2026, 3, 31))) == date(2026, 3, 31)
    assert number_of(date(1970, 1, 2)) == 1


def test_the_mean_robot_has_the_covariance_between_robots():
    model = Population(members=(member(between=((0.01, 0.008), (0.008, 0.04))),)).model("ur")
    rate = [one.joint("j1").law.rate for one in model.draw(400, seed=2)]
    assert all(one.coulomb_positive == pytest.approx(one.coulomb_negative, rel=1e-6) for one in rate)
    drawn = np.array([(one.coulomb_positive, one.viscous_positive) for one in rate])
    assert np.corrcoef(drawn.T)[0, 1] == pytest.approx(0.4, abs=0.12)


def test_the_page_ranks_joints_without_results_after_the_changed(judged, tmp_path):
    silent = {judged[7].history.name: "no result since 2026-01-10: no later logs"}
    text = write_page(tmp_path / "f.html", judged, silent=silent).read_text()
    assert text.index("robot002/j1") < text.index("robot007/j1") < text.index("robot000/j1")
    assert '"k":3' in text
    assert "1 joints have no result of the last days" in text
    assert "overflow-y: scroll" in text
