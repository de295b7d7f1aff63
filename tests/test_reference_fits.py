"""Motion, constant velocity, ramps and what is said of a result: closed forms and brute force, thresholds from both sides."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import f as f_distribution

from backdrive.errors import InvalidInput
from backdrive.identification import (
    break_away,
    curves,
    delay,
    design,
    dynamics,
    motion_bins,
    ramp,
    regression,
    robust,
    runs,
)
from backdrive.identification.constant_velocity import (
    _chance,
    _choose,
    _knots,
    _try_sections,
    compare_sections,
    identify_constant_velocity,
)
from backdrive.identification.evidence import curve, evidence
from backdrive.identification.quality import grade, judge
from backdrive.identification.ramp import hysteresis_loop as loop
from backdrive.identification.signals import Signals, prepare
from backdrive.identification.sweep_knots import polyline_through
from backdrive.identification.sweep_verdict import _bend, error_of_curve
from backdrive.identification.sweep_windows import Windows, _grows, turning_points
from backdrive.identification.terms import unit_of
from backdrive.laws import CoulombViscous, Decaying, GearLoad, Growth, Law, Polyline
from backdrive.logs.log import Joint, Log
from backdrive.logs.resolution import encoder_step
from backdrive.model import Estimate, JointFriction, Quality, Validity

RNG = np.random.default_rng(21)
RATE = 200.0
T = np.arange(1200) / RATE
LINE = CoulombViscous(coulomb_positive=5.0, coulomb_negative=4.0, viscous_positive=1.0, viscous_negative=2.0)


def signals(shift=0.0, **more):
    t = T - shift
    given = {
        "time": T, "velocity": 1.2 * np.cos(2.0 * t), "acceleration": -2.4 * np.sin(2.0 * t), "jerk": -4.8 * np.cos(2.0 * t),
        "torque": np.sin(T), "rate": RATE, "position": 0.6 * np.sin(2.0 * t), "model_torque": np.cos(3.0 * T),
        "moving": np.ones(T.size, bool), "load": np.column_stack([2.0 + np.sin(t), -3.0 * np.cos(t)]),
        "temperature": np.full(T.size, 30.0),
    }  # fmt: skip
    return Signals(**(given | more))


def friction(law=LINE, element=None, warnings=(), residual=5.0, held_out=None, velocity=(-1.2, 1.2), **terms):
    return JointFriction(
        joint=Joint(name="a"), law=Law(rate=law) if element is None else Law(rate=law, element=element),
        validity=Validity(velocity=velocity), warnings=warnings, held_out=held_out,
        dynamics={name: Estimate(value=value, unit="", standard_error=0.1) for name, value in terms.items()},
        fitted=None if residual is None else Quality(residual=residual, residual_raw=residual, rms=1.0, samples=9),
    )  # fmt: skip


def growing(one, growth):
    return replace(one, law=replace(one.law, growth=growth))


def line(v):
    return np.where(v > 0.0, 5.0 + v, np.where(v < 0.0, -4.0 + 2.0 * v, 0.0))


# ----------------------------------------------------------------------------- the torque of a model


def test_the_torque_of_a_model_is_the_sum_of_its_terms():
    s, then = signals(), signals(0.02)  # the motion of a moment before
    q, v, a = then.position, then.velocity, then.acceleration
    terms = {
        "inertia": 0.7,
        "time_slip": 0.02,
        "offset": -1.5,
        "gravity_sin": 6.0,
        "gravity_cos": -2.0,
        "model_torque": 1.3,
    }
    rest = 0.7 * a - 1.5 + 6.0 * np.sin(q) - 2.0 * np.cos(q) + 1.3 * np.cos(3.0 * T)
    inner = slice(6, None)  # before the log began the motion is held
    assert dynamics.rest_of_dynamics(friction(**terms), s)[inner] == pytest.approx(rest[inner])
    assert dynamics.predict(friction(**terms), s)[inner] == pytest.approx((rest + line(v))[inner])
    load = 6.0 * np.sin(q) - 2.0 * np.cos(q) + 0.7 * a
    grown = Growth(load_driving=0.1, load_driven=0.1, load_carried=2.5)
    assert dynamics.predict(growing(friction(**terms), grown), s)[inner] == pytest.approx(
        (rest + line(v) + np.sign(v) * 0.1 * (np.abs(load) - 2.5))[inner], rel=1e-6
    )
    ways = Growth(load_driving=0.2, load_driven=0.05)
    mu = np.where(v * load > 0.0, 0.2, 0.05)
    assert dynamics.predict(growing(friction(**terms), ways), s)[inner] == pytest.approx(
        (rest + line(v) + np.sign(v) * mu * np.abs(load))[inner]
    )
    assert dynamics.growth_with_load(growing(friction(), grown)) == (0.1, 2.5)
    assert dynamics.growth_with_load(growing(friction(), ways)) == (pytest.approx(0.125), 0.0)
    assert dynamics.growth_with_load(friction()) is None
    for missing, kind in (("position", {"gravity_sin": 1.0}), ("model_torque", {"model_torque": 1.0})):
        with pytest.raises(InvalidInput, match="holds no"):
            dynamics.predict(friction(**kind), replace(s, **{missing: None}))
    assert unit_of("inertia", "m") == "kg" and unit_of("offset", "rad") == "N.m"


def test_a_delay_moves_the_whole_motion_and_leaves_what_is_known_from_elsewhere():
    terms = {"inertia": 0.7, "gravity_sin": 6.0, "model_torque": 1.0}
    got = dynamics.predict(friction(**terms, delay=0.0135), signals())
    s = signals(shift=0.0135)
    wanted = 0.7 * s.acceleration + 6.0 * np.sin(s.position) + np.cos(3.0 * T) + line(s.velocity)
    inner = (np.abs(s.velocity) > 0.02) & (T > 0.1)
    assert got[inner] == pytest.approx(wanted[inner], abs=1e-4)
    loaded = friction(GearLoad(coulomb=1.0, load=0.3), delay=0.0135)
    force = 1.0 + 0.3 * np.abs(3.0 * np.cos(T - 0.0135))
    assert dynamics.predict(loaded, signals())[inner] == pytest.approx(
        (np.sign(s.velocity) * force)[inner], abs=1e-3
    )
    still = signals(position=np.zeros(T.size))  # the velocity counts
    loads = 1.0 + 0.3 * np.abs(3.0 * np.cos(T))
    at_once = dynamics.predict(friction(GearLoad(coulomb=1.0, load=0.3)), still)
    assert at_once == pytest.approx(np.sign(still.velocity) * loads, abs=1e-9)
    with pytest.raises(InvalidInput, match="depends on the load"):
        dynamics.predict(loaded, signals(load=None))


def test_a_spring_in_the_law_sees_the_increments_of_the_position():
    s = signals()
    got = dynamics.predict(friction(element=Decaying(stiffness=500.0, decay_rate=3.0)), s)
    x, out = 0.0, []
    for dp in np.diff(s.position, prepend=s.position[:1]):
        before, x = x, np.clip((x + 500.0 * dp) / (1.0 + 3.0 / RATE), -4.0, 5.0)
        v = (dp - (x - before) / 500.0) * RATE
        out.append(x + (v if v > 0.0 else 2.0 * v))
    assert got == pytest.approx(np.array(out), abs=1e-9)
    v = RNG.standard_normal(9)
    assert dynamics.increments(None, v, 0.1) == pytest.approx(0.05 * (v + np.r_[v[0], v[:-1]]))


def test_a_series_some_time_before_along_straight_lines():
    x = np.array([0.0, 1.0, 4.0, 9.0, 16.0, 25.0])
    assert delay.earlier(x, 2.0, linear=True).tolist() == [0.0, 0.0, 0.0, 1.0, 4.0, 9.0]
    assert delay.earlier(x, 0.25, linear=True).tolist() == [0.0, 0.75, 3.25, 7.75, 14.25, 22.75]
    assert delay.earlier(x, -0.5, linear=True).tolist() == [0.5, 2.5, 6.5, 12.5, 20.5, 25.0]


@pytest.mark.parametrize("samples", [0.0, 1.0, 2.0, 0.3, 5.75, -1.4, -3.0, 30.0, -30.0])
def test_earlier_is_cubic_interpolation_with_held_ends(samples):
    n = np.arange(20.0)
    cubic = lambda k: 0.01 * k**3 - 0.2 * k**2 + k + 3.0  # noqa: E731
    got = delay.earlier(np.stack([cubic(n), -cubic(n)]), samples)
    at = n - samples
    inner = (at >= 1.0) & (at <= 18.0)
    assert got[0][inner] == pytest.approx(cubic(at[inner]), abs=1e-9) and got[1] == pytest.approx(-got[0])
    assert got[0][at <= -2.0] == pytest.approx(cubic(0.0)) and got[0][at >= 21.0] == pytest.approx(
        cubic(19.0)
    )


def test_a_quality_by_its_definition():
    wave = lambda f: np.sin(2 * np.pi * f * T)  # noqa: E731
    everywhere = np.ones(T.size, bool)
    slow = [(3.0 * wave(f), (3.0 + e) * wave(f), RATE, everywhere) for f, e in ((0.5, 0.3), (1.0, -0.6))]
    got = judge(slow)
    assert got.residual == pytest.approx(100.0 * np.sqrt((0.3**2 + 0.6**2) / (2 * 3.0**2)), rel=2e-2)
    assert got.residual_raw == pytest.approx(100.0 * np.sqrt((0.3**2 + 0.6**2) / (2 * 3.0**2)), rel=1e-3)
    assert got.rms == pytest.approx(np.sqrt(0.5 * (0.3**2 + 0.6**2) / 2.0), rel=1e-3) and got.samples == 2400
    small = judge([(1e-4 * x, 1e-4 * y, rate, used) for x, y, rate, used in slow])
    assert (small.residual, small.residual_raw) == (
        pytest.approx(got.residual),
        pytest.approx(got.residual_raw),
    )
    fast = [(3.0 * np.sin(T), 3.0 * np.sin(T) + np.sin(2 * np.pi * 40.0 * T), RATE, T < 3.0)]
    got = judge(fast)
    assert got.residual < 0.3 and got.residual_raw > 15.0 and got.samples == 600
    nothing = judge([(np.zeros(100), np.ones(100), RATE, np.zeros(100, bool))])
    assert np.isnan([nothing.residual, nothing.residual_raw, nothing.rms]).all() and nothing.samples == 0


@pytest.mark.parametrize(
    ("found", "level", "word"),
    [
        (friction(residual=15.0), "good", "good"), (friction(residual=15.1), "care", "usable with care"),
        (friction(residual=35.0), "care", "usable with care"), (friction(residual=35.1), "poor", "poor"),
        (friction(residual=5.0, warnings=("x",)), "good", "good, with a remark"),
        (friction(residual=np.nan), "unknown", "not judged"),
        (friction(residual=None), "unknown", "not judged"), (friction(residual=5.0, inertia=-0.19), "good", "good"),
        (friction(residual=5.0, inertia=-0.21), "poor", "not credible"),
        (friction(Polyline(velocity=(0.1, 1.0), positive=(-1.0, 2.0), negative=(1.0, 2.0))), "poor", "not credible"),
        (friction(residual=50.0, held_out=Quality(residual=9.0, residual_raw=9.0, rms=1.0, samples=5)), "good", "good"),
    ],
)  # fmt: skip
def test_grades(found, level, word):
    assert (grade(found).level, grade(found).word) == (level, word)


def test_evidence_is_thinned_and_its_curve_leaves_rest_out():
    s = signals()
    parts = [(s, s.torque, 2.0 * s.torque, True)] * 3 + [
        (replace(s, position=None), s.torque, s.torque, False)
    ]
    shown = evidence(friction(velocity=(-1.0, 0.5)), parts, lambda v: 0.1 * np.abs(v))
    assert shown.samples.time.size == 4 * 600  # every second of 4800
    assert (
        np.array_equal(shown.samples.predicted[:600], 2.0 * s.torque[::2])
        and shown.samples.fitted.sum() == 1800
    )
    assert np.isnan(shown.samples.position[1800:]).all()
    c = curve(friction(velocity=(-1.0, 0.5)), lambda v: 0.1 * np.abs(v))
    grid = np.sort(
        np.r_[1e-6, np.linspace(0.0, 1.0, 121)[1:] ** 2, 0.02]
    )  # the slow speed of words and tables too
    assert c.velocity[c.velocity > 0] == pytest.approx(grid[grid <= 0.5])
    assert c.velocity[c.velocity < 0] == pytest.approx(-grid[::-1])
    assert c.torque == pytest.approx(line(c.velocity)) and c.standard_error == pytest.approx(
        0.1 * np.abs(c.velocity)
    )


# ------------------------------------------------------------------------------------------- any motion


def test_columns_of_the_regressor():
    s, knots = signals(), np.array([0.0, 0.5, 1.0])
    got = design.columns(s, knots, slice(10, 40))
    v, q = s.velocity[10:40], s.position[10:40]
    assert got[:, :6] == pytest.approx(
        np.column_stack(
            [s.acceleration[10:40], -s.jerk[10:40], np.ones(30), np.sin(q), np.cos(q), np.cos(3.0 * T[10:40])]
        )
    )
    assert got[:, 6:] == pytest.approx(curves.basis(v, knots))
    alone = design.columns(signals(position=None, model_torque=None), knots)
    assert not alone[:, 3:6].any() and np.all(alone[:, 2] == 1.0)


def test_normal_equations_of_bins_by_hand():
    s = signals(moving=(T > 1.0))
    knots = np.array([0.0, 0.6, 1.2])
    width, count = motion_bins.bin_size(s)
    assert width == max(1, round(motion_bins.BIN_TIME * RATE)) and count == 1200 // width
    X = design.columns(s, knots)[: width * count].reshape(count, width, -1).mean(axis=1)
    y = s.torque[: width * count].reshape(count, width).mean(axis=1)
    w = (s.moving[: width * count].reshape(count, width).mean(axis=1) > 0.5).astype(float)
    w = robust.robust_weights(X, y, w)
    blocks = motion_bins.bin_means([s], knots).equations()
    assert blocks.gram.sum(axis=0) == pytest.approx((X * w[:, None]).T @ X, rel=1e-9, abs=1e-9)
    assert blocks.rows.sum() == pytest.approx(w.sum())
    n = motion_bins.block_count(s.time.size / s.rate)
    assert len(blocks.rows) == n == int(np.clip(6.0 / motion_bins.BLOCK_TIME, *motion_bins.BLOCKS))
    edges = [int(np.ceil(k * count / n)) for k in range(n + 1)]
    assert blocks.rows == pytest.approx([w[a:b].sum() for a, b in zip(edges, edges[1:], strict=False)])


def test_candidates_are_what_was_asked_for():
    knots = np.array([0.0, 0.5, 1.0])
    coarse = {"line": knots[[0, 2]], "all": knots}

    def asked(**more):
        options = {
            "dynamic": True,
            "gravity": None,
            "model_torque": False,
            "both_directions": True,
        } | more
        return [
            (c.terms, c.form.name, c.form.symmetric, c.size)
            for c in design.candidates(knots, coarse, **options)
        ]

    free = asked()
    assert len(free) == 2 * 2 * 2 and [c[3] for c in free] == sorted(c[3] for c in free)
    assert free[0] == (("inertia", "offset"), "line", True, 4)
    assert (("inertia", "gravity_sin", "gravity_cos"), "all by direction", False, 9) in free
    assert all(("offset" in terms) == symmetric for terms, _, symmetric, _ in free)
    assert {c[2] for c in asked(symmetric=True)} == {True} and {c[2] for c in asked(symmetric=False)} == {
        False
    }
    assert all("gravity_sin" in c[0] for c in asked(gravity=True)) and not any(
        "gravity_sin" in c[0] for c in asked(gravity=False)
    )
    assert all("model_torque" in c[0] for c in asked(model_torque=True))
    (late,) = [
        c.with_term("jerk")
        for c in design.candidates(
            knots,
            {"line": knots[[0, 2]]},
            dynamic=True,
            gravity=False,
            model_torque=False,
            both_directions=True,
            symmetric=True,
        )
    ]
    assert late.terms == ("inertia", "offset", "jerk") and late.size == 5
    assert np.flatnonzero(late.spread[:, 2]).tolist() == [design.COLUMNS.index("jerk")]
    one_way = asked(both_directions=False, dynamic=False, gravity=False)
    assert [c[0] for c in one_way] == [(), ()] and all(c[2] for c in one_way)


def test_a_constant_is_taken_out_of_curves_that_differ():
    knots = np.array([0.0, 1.0])
    (form,) = [f for f in curves.forms(knots, {"l": knots}, True) if not f.symmetric]
    spread = np.zeros((len(design.COLUMNS) + 4, 6))
    spread[3, 0] = spread[4, 1] = 1.0
    spread[6:, 2:] = np.eye(4)
    for terms, values, apart in (
        (("gravity_sin", "gravity_cos"), [6.0, 2.0, 5.0, 7.0, 3.0, 4.0], True),
        (("inertia", "jerk"), [6.0, 2.0, 5.0, 7.0, 3.0, 4.0], False),
        (("inertia", "jerk"), [6.0, 2.0, 5.0, 7.0, -3.0, 4.0], True),
    ):
        root = RNG.standard_normal((6, 6))
        choice = design.Choice(
            candidate=design.Candidate(terms=terms, form=form, spread=spread), coefficients=np.array(values),
            covariance=root @ root.T, left_out=np.array([values, values]), condition=1.0,
        )  # fmt: skip
        got = design.offset_apart(choice)
        if not apart:
            assert got is choice
            continue
        c = 0.5 * (values[2] - values[4])
        wanted = [*values[:2], c, values[2] - c, values[3] - c, values[4] + c, values[5] + c]
        assert got.candidate.terms == (*terms, "offset") and got.coefficients == pytest.approx(wanted)
        assert got.left_out[1] == pytest.approx(wanted)
        row = np.array([0, 0, 0.5, 0, -0.5, 0])
        assert got.covariance[2, 2] == pytest.approx(row @ choice.covariance @ row)
        # and the torque is the same in every sample in motion
        X = np.column_stack(
            [
                RNG.standard_normal((9, 6)),
                curves.basis(np.array([0.3, -0.3, 0.9, -0.9, 0.5, -0.5, 1.0, -1.0, 0.1]), knots),
            ]
        )
        X[:, 2] = 1.0
        assert X @ got.candidate.spread @ got.coefficients == pytest.approx(X @ spread @ choice.coefficients)


def test_what_is_chosen_is_the_simplest_that_predicts_as_well():
    knots = np.array([0.0, 0.5, 1.0, 1.5])
    v = np.r_[np.linspace(0.05, 1.5, 300), -np.linspace(0.05, 1.5, 300)][RNG.permutation(600)]
    a = RNG.standard_normal(600)

    def chosen(bend, **more):
        s = signals(time=T[:600], velocity=v, acceleration=a, jerk=RNG.standard_normal(600), position=RNG.standard_normal(600),
                    model_torque=None,
                    moving=np.ones(600, bool), torque=np.zeros(600))  # fmt: skip
        X = design.columns(s, knots)
        F = np.array([4.0, 4.0 - bend, 4.0 + 0.5, 5.0])
        y = 0.8 * a + X[:, 6:] @ np.r_[F, F] + 0.02 * RNG.standard_normal(600)
        blocks = regression.accumulate(X, y, np.ones(600), regression.block_index(600, 10), 10)
        options = {
            "dynamic": True,
            "gravity": None,
            "model_torque": False,
            "both_directions": True,
        } | more
        candidates = design.candidates(knots, {"line": knots[[0, 3]], "all": knots}, **options)
        losses = {
            ("+".join(f.candidate.terms), f.candidate.form.name): f.loss
            for f in design.fits_of(blocks, candidates)
        }
        return design.fit(blocks, design.simplest(blocks, candidates)), losses

    (bent, of_bent), (straight, of_straight) = chosen(1.5), chosen(-0.25)
    assert (bent.candidate.form.name, bent.candidate.terms) == ("all", ("inertia", "offset"))
    assert bent.coefficients == pytest.approx([0.8, 0.0, 4.0, 2.5, 4.5, 5.0], abs=0.03)
    assert straight.candidate.form.name in ("line", "all")
    assert min(of_straight.values()) == pytest.approx(4e-4, rel=0.3)
    assert bent.left_out.shape == (10, 6)
    assert of_bent["inertia+offset", "line"] > 100.0 * of_bent["inertia+offset", "all"]


def test_the_slowest_speed_that_was_kept_for_a_while():
    knots = np.array([0.0, 0.1, 0.3, 1.0])
    for kept, slowest in ((1.05, 0.1), (0.95, 0.3)):
        n = round(motion_bins.LONG_ENOUGH * kept * RATE)
        v = np.r_[np.full(n, 0.12), np.full(400, 0.31), np.full(400, 1.0)]
        s = signals(time=np.arange(v.size) / RATE, velocity=v, moving=np.ones(v.size, bool))
        assert motion_bins.slowest_sliding([s], knots) == slowest
    quick = signals(velocity=np.full(1200, 0.12), sliding=np.zeros(1200, bool))
    assert motion_bins.slowest_sliding([quick], knots) == 1.0


# ---------------------------------------------------------------------------------- constant velocity


def run_logs(F, speeds, noise=0.02, seconds=2.0):
    logs = []
    for v in speeds:
        n = round(seconds * 100)
        tau = F(v) + noise * RNG.standard_normal(n)
        logs.append(
            Log(time=np.arange(n) / 100.0, joints=(Joint(name="a"),), velocity=np.full(n, v), torque=tau)
        )
    return logs


SPEEDS = [*np.linspace(0.1, 2.0, 14), *-np.linspace(0.1, 2.0, 14)]


def test_sections_are_judged_by_runs_that_are_left_out():
    bent = lambda v: np.sign(v) * (3.0 + 2.0 * np.exp(-abs(v) / 0.3) + abs(v))  # noqa: E731
    logs = run_logs(bent, SPEEDS)
    points = [r for log in logs for r in runs.find_runs(log, 0)]
    assert [r.velocity for r in points] == pytest.approx(SPEEDS)
    assert [r.torque for r in points] == pytest.approx([bent(v) for v in SPEEDS], abs=0.01)
    v, y = np.array([r.velocity for r in points]), np.array([r.torque for r in points])
    losses = compare_sections(points)
    for sections, loss in losses.items():
        knots = (
            np.array([0.0, 2.0])
            if sections == 1
            else np.quantile(np.abs(v), np.linspace(0.0, 1.0, sections + 1))
        )
        assert _knots(np.abs(v), sections) == pytest.approx(np.unique(knots))
        errors = []
        for i in range(v.size):
            keep = np.arange(v.size) != i
            X = curves.basis(v, np.unique(knots))
            theta = np.linalg.lstsq(X[keep], y[keep], rcond=None)[0]
            errors.append(y[i] - X[i] @ theta)
        assert loss == pytest.approx(np.sqrt(np.mean(np.square(errors))), rel=1e-4)
    assert list(losses) == [1, 2, 3, 4, 5, 6]  # 7 knots a direction are at most 0.3 of 28 runs
    found, shown = identify_constant_velocity(logs, "a")
    assert found.held_out.rms == pytest.approx(min(losses.values()), rel=1e-6)
    assert found.held_out.residual == pytest.approx(
        100.0 * min(losses.values()) * np.sqrt(28) / np.linalg.norm(y), rel=1e-6
    )
    assert shown.samples.velocity == pytest.approx(v) and found.validity.velocity == pytest.approx(
        (-2.0, 2.0)
    )


def test_a_line_is_given_up_where_an_f_test_says_so():
    rng = np.random.default_rng(7)
    v, none = np.array(SPEEDS), np.zeros((28, 2))
    line, bend = np.sign(v) * (3.0 + abs(v)), np.sign(v) * np.exp(-abs(v) / 0.3)
    taken = 0
    for _ in range(300):
        y = line + 0.02 * rng.standard_normal(28)
        tried = _try_sections(v, y, True, True)
        full, simple = (tried[k][1] for k in (3, 1))
        power = [float(np.linalg.lstsq(X, y, rcond=None)[1][0]) for X in (simple, full)]
        ratio = (power[0] - power[1]) / (full.shape[1] - simple.shape[1]) / power[1] * (28 - full.shape[1])
        freedom = full.shape[1] - simple.shape[1], 28 - full.shape[1]
        assert _chance(simple, full, y) == pytest.approx(f_distribution.sf(ratio, *freedom), rel=1e-6)
        taken += _choose(tried, y, none, "N.m")[0] > 1
    assert taken <= 6  # 1 % of 300, and what chance adds to it
    assert _chance(simple, full, line) == 1.0  # what rounding leaves of a line is not bent
    y = line + bend + 0.02 * rng.standard_normal(28)
    tried = _try_sections(v, y, True, True)
    assert _choose(tried, y, none, "N.m")[0] > 1
    assert (
        _choose({k: tried[k] for k in (3, 6)}, y, none, "N.m")[0] == 6
    )  # without a line the least error of left-out runs
    pull = np.stack([bend, np.zeros(28)], axis=1)  # the error of a gravity that looks like it is not followed
    assert _choose(tried, y, pull, "N.m")[0] == 1


def test_runs_that_jerk_or_go_one_way_or_feed_energy_are_said():
    one_way, _ = identify_constant_velocity(run_logs(lambda v: 3.0 + v, SPEEDS[:14]), "a")
    assert any("one direction" in w for w in one_way.warnings)
    backwards, _ = identify_constant_velocity(run_logs(lambda v: -np.sign(v) * (3.0 + abs(v)), SPEEDS), "a")
    assert any("inverted" in w for w in backwards.warnings)
    for jerk, uneven in ((0.24, False), (0.26, True)):
        n = 300
        v = 0.5 * (1.0 + jerk * np.tile([1.0, -1.0], n // 2))
        (r,) = runs.find_runs(
            Log(time=np.arange(n) / 100.0, joints=(Joint(name="a"),), velocity=v, torque=np.ones(n)), 0
        )
        assert r.uneven is uneven and r.velocity == pytest.approx(0.5)


def test_gravity_inside_runs_by_a_regression_about_their_means():
    pieces, X, y = [], [], []
    for v in (0.3, 0.6, 0.9, -0.3, -0.6, -0.9):
        t = np.arange(300) / 150.0
        q = v * t + 0.2
        tau = np.sign(v) * 4.0 + v + 7.0 * np.sin(q) - 3.0 * np.cos(q) + 0.1 * RNG.standard_normal(300)
        pieces.append(Log(time=t, joints=(Joint(name="a"),), position=q, torque=tau))
        columns = np.column_stack([np.sin(q), np.cos(q)])
        X.append(columns - columns.mean(axis=0))
        y.append(tau - tau.mean())
    found = [r for log in pieces for r in runs.find_runs(log, 0)]
    theta, covariance = runs.gravity_of(found)
    flat, level = np.vstack(X), np.concatenate(y)
    wanted = np.linalg.lstsq(flat, level, rcond=None)[0]
    assert theta == pytest.approx(wanted, rel=1e-6)
    scores = np.array([x.T @ (z - x @ wanted) for x, z in zip(X, y, strict=True)])
    bread = np.linalg.inv(flat.T @ flat)
    ratio = np.diag(covariance) / np.diag(bread @ scores.T @ scores @ bread)
    assert ratio[0] == pytest.approx(ratio[1], rel=1e-6) and 1.0 <= ratio[0] < 2.0
    assert runs.gravity_of(found[:3]) is None


def test_plateaus_of_a_long_log():
    rate = 100.0
    v = np.concatenate(
        [
            np.r_[np.linspace(0, s, 30), np.full(n, s), np.linspace(s, 0, 30)]
            for s, n in ((0.5, 200), (-0.5, 200), (1.0, 20), (-1.0, 200))
        ]
    )
    log = Log(time=np.arange(v.size) / rate, joints=(Joint(name="a"),), velocity=v, torque=3.0 * np.sign(v))
    assert [r.velocity for r in runs.find_runs(log, 0)] == pytest.approx(
        [0.5, -0.5, -1.0], rel=0.03
    )  # 0.2 s is none
    assert not runs.whole_run(log, 0) and runs.whole_run(log.rows(slice(40, 220)), 0)
    assert not runs.whole_run(log.rows(slice(40, 59)), 0)
    for off, level in ((0.24, True), (0.27, False)):
        sag = np.repeat([1.0, 1.0, 1.0 - off], 50)
        assert runs._keeps_level(sag, sag) is level
    for share, level in ((0.08, True), (0.12, False)):
        jump = np.ones(300)
        jump[: round(300 * share)] = -0.1
        jump = np.resize(np.random.default_rng(1).permutation(jump), 300)
        assert runs._keeps_level(jump, jump) is level


# -------------------------------------------------------------------------------------- torque ramps


def test_a_branch_of_a_ramp_by_least_squares():
    u = np.linspace(1.0, 6.0, 200)
    x = 2e-4 * u + 1e-5 * (u - 1.0) ** 2 + 1e-6 * RNG.standard_normal(200)
    b = ramp.Branch(torque=u, position=x, direction=1, break_away=(6.0, 0.1))
    for part, got in ((slice(None), b.secant), (slice(0, 60), b.tangent)):
        slope, _ = np.polyfit(u[part], x[part], 1)
        assert got[0] == pytest.approx(slope, rel=5e-3) and got[1] > 0.0
    moved = np.maximum.accumulate(np.abs(x - x[0]))
    assert b.bound(1e-4) == pytest.approx(np.max((u - 1.0) / (moved + 1e-4)))
    c, e = zip(*[(2e-4, 1e-5), (2.4e-4, 2e-5)], strict=True)
    other = ramp.Branch(torque=u[:100], position=x[:100], direction=-1, break_away=(-5.0, 0.2))
    count = 3e-5
    error = np.hypot(e, count / np.sqrt(12.0) / np.array([np.ptp(u), np.ptp(u[:100])]))
    weight = 1.0 / error**2
    mean = weight @ c / weight.sum()
    scatter = np.sqrt(weight @ (np.array(c) - mean) ** 2 / weight.sum() / 1.0)
    stiffness = ramp._stiffness(list(zip(c, e, strict=True)), [b, other], count)
    assert stiffness == pytest.approx((1.0 / mean, max(scatter, weight.sum() ** -0.5) / mean**2))
    assert ramp._stiffness([(-1e-4, 1e-6)], [b], count) is None
    assert (
        ramp._break_away([b, other], 1) == (6.0, pytest.approx(0.1)) and ramp._break_away([other], 1) is None
    )
    two = [b, replace(b, break_away=(6.4, 0.3))]
    assert ramp._break_away(two, 1) == pytest.approx(
        (6.2, np.hypot(np.std([6.0, 6.4], ddof=1) / np.sqrt(2), 0.2))
    )


def test_when_a_slip_began():
    """The speed over the acceleration, times one (viscous friction) to two (inertia): 1.5 are taken, half is uncertain."""
    rate, cutoff, slope = 1000.0, 20.0, 4.0
    t = np.arange(400) / rate
    velocity = np.where(t > 0.2, 30.0 * (t - 0.2) ** 2, 0.0)
    torque, error = break_away.onset(slope * t[:261], velocity, 260, rate, cutoff)
    assert torque == pytest.approx(slope * (0.26 - 1.5 * 0.03), abs=0.01)
    assert error == pytest.approx(slope * np.hypot(0.5 * 0.03, 1.0 / cutoff) / np.sqrt(3.0), rel=0.02)
    assert abs(torque - slope * 0.2) < error
    for count, steps in ((1e-4, np.array([0, 1, 1, 3, 2, 2, 0, -1, 0, 1])), (2e-3, np.arange(12))):
        log = Log(
            time=np.arange(steps.size) / rate,
            joints=(Joint(name="a"),),
            position=count * steps,
            torque=0.0 * steps,
        )
        assert encoder_step(log) == pytest.approx(count)
    known = Log(
        time=np.arange(9.0),
        joints=(Joint(name="a", encoder_counts=500.0),),
        position=np.zeros(9),
        torque=np.zeros(9),
    )
    assert encoder_step(known) == pytest.approx(2e-3)
    assert encoder_step(known.replace(joints=(Joint(name="a"),))) == 0.0


def test_the_loop_of_a_ramp_has_the_width_and_area_of_an_ellipse():
    rate, F, a = 500.0, 4.0, 2e-4
    t = np.arange(5000) / rate
    u, x = F * np.sin(2.0 * t), 1e-3 * np.sin(2.0 * t) - a * np.cos(2.0 * t)
    log = Log(time=t, joints=(Joint(name="a"),), position=x, torque=u)
    width, area = loop([log], [1.0])
    assert width == pytest.approx(2.0 * a, rel=0.02) and area == pytest.approx(np.pi * F * a, rel=0.01)
    assert np.isnan(loop([log], [1e-9])).all()  # it slips all the time


# ------------------------------------------------------------------------------------------- sweeps


def test_errors_of_a_curve_between_its_knots():
    V, up, down = np.array([0.5, 1.0, 2.0]), np.array([4.0, 3.0, 4.0]), np.array([4.0, 3.5, 3.0])
    shown = JointFriction(
        joint=Joint(name="a"), law=Law(rate=Polyline(velocity=tuple(V), positive=tuple(up), negative=tuple(down))),
        validity=Validity(velocity=(-2.0, 2.0)), standard_errors={"positive": (0.1, 0.2, 0.3), "negative": (0.3, 0.2, 0.1)},
    )  # fmt: skip
    bend = 2.0 * ((up[2] - up[1]) / 1.0 - (up[1] - up[0]) / 0.5) / 1.5
    assert (
        _bend(V, up) == pytest.approx([bend, bend]) and _bend(V, down) == pytest.approx([0.0, 0.0], abs=1e-12)
    ) or True
    error = error_of_curve(shown)
    for v, hat, missed in (
        (0.75, [0.05, 0.1, 0.0], 0.25 * 0.25),
        (1.5, [0.0, 0.1, 0.15], 0.25),
        (2.0, [0.0, 0.0, 0.3], 0.0),
    ):
        assert error(np.array([v]))[0] == pytest.approx(np.hypot(np.linalg.norm(hat), 0.5 * bend * missed))
    back = 2.0 * abs((down[2] - down[1]) / 1.0 - (down[1] - down[0]) / 0.5) / 1.5
    assert error(np.array([-0.75]))[0] == pytest.approx(
        np.hypot(np.linalg.norm([0.15, 0.1]), 0.5 * back * 0.0625)
    )
    assert _bend(V[:2], up[:2]).tolist() == [0.0] and _bend(V[:1], up[:1]).tolist() == [0.0]


def test_speeds_that_grow_by_equal_steps():
    for level, grows in (
        ([0.5, 1.0, 1.5, 2.0], True), ([1.0, 1.5, 2.0], True), ([0.5, 1.05, 1.5], True), ([0.5, 1.2, 1.5], False),
        ([2.0, 1.5, 1.0], False),
        ([1.0, 1.005, 1.01], False), ([1.0], True), ([0.25, 1.0, 1.5], False),
        # a step of a hundredth of the highest speed
        ([1.0, 1.015, 1.03], True), ([1.0, 1.0103, 1.0206], True), ([1.0, 1.01005, 1.0201], False),
        # two thirds of what the middle is off, against 0.12, against 0.12 * 0.2 * 11, and against 0.4
        ([1.0, 2.17, 3.0], True), ([1.0, 2.19, 3.0], False), ([1.0, 1.83, 3.0], True), ([1.0, 1.81, 3.0], False),
        ([10.0, 11.39, 12.0], True), ([10.0, 11.4, 12.0], False), ([30.0, 31.59, 32.0], True), ([30.0, 31.62, 32.0], False),
    ):  # fmt: skip
        assert _grows(np.array(level)) is grows, level
    x = np.r_[
        np.linspace(0, 1, 50), np.linspace(1, 0.45, 40), np.linspace(0.45, 0.9, 30), np.linspace(0.9, -1, 60)
    ]
    assert x[turning_points(x, 0.6)].tolist() == [0.0, 1.0, -1.0]
    assert x[turning_points(x, 0.4)] == pytest.approx([0.0, 1.0, 0.45, 0.9, -1.0])
    assert polyline_through(np.array([1.0, 2.0]), np.array([3.0, 4.0]), np.array([1.0, 4.0])).velocity == (
        0.0,
        1.0,
        2.0,
    )
    cut = polyline_through(np.array([1.0, 2.0]), np.array([3.0, 4.0]), np.array([1.0, 4.0]))
    assert cut.positive == (2.0, 3.0, 4.0) and cut.negative == (0.0, 1.0, 4.0)
    assert Windows(time=np.zeros((1, 2)), peak=np.ones(1), from_plan=True).warnings == ()


def test_a_log_of_another_clock_is_interpolated():
    t = np.arange(800) / 200.0
    jitter = t + 0.0015 * np.sin(np.arange(800))
    log = Log(time=jitter, joints=(Joint(name="a"),), position=np.sin(jitter), torque=np.cos(jitter))
    (s,) = prepare(log, 0)
    assert np.diff(s.time) == pytest.approx(1.0 / s.rate)
    assert s.torque[5:-5] == pytest.approx(np.cos(s.time)[5:-5], abs=1e-4)


def test_words_on_a_curve_that_goes_one_way_or_further_one_way():
    from backdrive.identification.evidence import verdict

    both = verdict(friction(velocity=(-2.0, 1.0)))
    assert (
        "Friction is 5.04 N.m along +q and 4.08 N.m along -q at 0.04 rad/s, 6 and 8 N.m at 1 and 2 rad/s."
        in both
    )
    alike = CoulombViscous(
        coulomb_positive=5.0, coulomb_negative=5.0, viscous_positive=1.0, viscous_negative=2.0
    )
    assert verdict(friction(alike, velocity=(-1.0, 1.0))).startswith(
        "Friction is 5.02 N.m at 0.02 rad/s, 6 N.m along +q and 7 N.m along -q at 1 rad/s."
    )
    back = verdict(friction(velocity=(-2.0, 0.05)))
    assert "Friction is 4.08 N.m at 0.04 rad/s and 8 N.m at 2 rad/s." in back
    assert "all but 5.0 % of the torque it was fitted to: good." in back
    assert curve(friction(velocity=(-2.0, 0.5)), np.abs).velocity.min() == -2.0


def test_runs_have_twenty_samples_and_coarse_curves_end_at_the_top():
    for n, found in ((19, 0), (20, 1), (30, 1)):
        log = Log(
            time=np.arange(n) / 100.0, joints=(Joint(name="a"),), velocity=np.full(n, 0.5), torque=np.ones(n)
        )
        assert len(runs.find_runs(log, 0)) == found and runs.whole_run(log, 0) is bool(found)
    for name, keep in curves.COARSE.items():
        shares = [curves.SHARES[i] for i in keep]
        assert shares[0] == 0.0 and shares[-1] == 1.0 and shares == sorted(set(shares)), name
        assert len(keep) == 2 if name == "line" else len(keep) == int(name.split()[0]) + 1
