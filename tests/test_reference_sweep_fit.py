"""From pairs of sweeps to a curve and what is not friction: cases solved by hand, thresholds from both sides, every field."""

import numpy as np
import pytest

from backdrive.identification.sweep_equations import GRAVITY, equations
from backdrive.identification.sweep_fit import REMEDY, fit
from backdrive.identification.sweep_knots import SweepKnots, polyline_through, to_polyline
from backdrive.identification.sweep_verdict import verdict
from backdrive.identification.terms import estimates
from backdrive.laws import Law, Polyline
from backdrive.logs.log import Joint
from backdrive.model import JointFriction, Quality, Validity

SPEEDS = np.array([0.5, 1.0, 1.5, 2.0])
NAN = float("nan")


def up(v):
    return 9.0 + 3.0 * v


def pairs(
    F_pos, F_neg, center=0.3, *, error=0.05, level=0.98, slope=(NAN, NAN), speeds=SPEEDS, warnings=(), **more
):
    """Pairs of one sweep: torque along +q and against -q as given, at the same speeds."""
    n = len(speeds)
    return SweepKnots(
        V_pos=np.array(speeds), V_neg=np.array(speeds), F_pos=np.array(F_pos, float), F_neg=np.array(F_neg, float),
        error_pos=np.full(n, error), error_neg=np.full(n, error), count_pos=np.full(n, 50), count_neg=np.full(n, 50),
        center=center, level=level, slope=slope, warnings=warnings, **more,
    )  # fmt: skip


def about(centers, weight, c=0.0, *, error=0.05, slopes=None, bend=0.0, **more):
    """Sweeps about centers under gravity a sin q + b cos q; directions differ by the constant 2 c and the bend."""
    found = []
    zigzag = bend * np.array([1.0, -1.0, 1.0, -1.0])
    for q in centers:
        g = 0.98 * (weight[0] * np.sin(q) + weight[1] * np.cos(q))
        # torque grows with sin(q - center) by this, whatever the stroke; only its mean has the level
        slope = (NAN, NAN) if slopes is None else (weight[0] * np.cos(q) - weight[1] * np.sin(q), slopes)
        found.append(
            pairs(
                up(SPEEDS) + c + zigzag + g, up(SPEEDS) - c - zigzag - g, q, error=error, slope=slope, **more
            )
        )
    return found


def rotary(knots, **more):
    return fit(knots, unit="rad", name="a", **more)


# ------------------------------------------------------------------------------------------ one posture


def test_one_posture_sets_the_half_sum_apart_as_an_offset():
    got = rotary([pairs(up(SPEEDS) + 1.5, up(SPEEDS) - 1.5, warnings=("so", "so"))])
    assert got.symmetric and got.law.velocity == pytest.approx(SPEEDS)
    assert got.law.positive == got.law.negative == pytest.approx(up(SPEEDS))
    assert set(got.terms) == {"offset"} and got.terms["offset"][0] == pytest.approx(1.5)
    # eight torques of equal error: the half sum of all, and of two at each knot
    assert got.terms["offset"][1] == pytest.approx(0.05 / np.sqrt(8.0))
    assert got.error_pos == pytest.approx(np.full(4, 0.05 / np.sqrt(2.0)))
    assert got.error_neg == pytest.approx(got.error_pos)
    assert got.covariance == pytest.approx(np.tile(0.05**2 / 2.0 * np.eye(4), (2, 2)), abs=1e-12)
    assert (got.condition, got.centers, got.warnings, got.notes, got.load) == (
        np.inf,
        (0.3,),
        ("so",),
        (),
        None,
    )
    assert np.isnan(got.noise_gain) and got.tells(9.0)
    forced = rotary([pairs(up(SPEEDS) + 1.5, up(SPEEDS) - 1.5)], symmetric=False)
    assert not forced.symmetric and forced.law.positive == pytest.approx(up(SPEEDS))
    assert forced.warnings == (
        "Joint 'a': offset unattributed: 1.5 N.m may be gravity, an offset of the torque signal or a constant "
        f"difference of the directions; it is given to the former two. {REMEDY}",
    )


@pytest.mark.parametrize(("share", "differ"), [(0.029, False), (0.031, True)])
def test_directions_differ_from_three_hundredths_of_the_friction_on(share, differ):
    size = np.sqrt(np.mean(up(SPEEDS) ** 2))
    zigzag = 0.5 * share * size * np.array([1.0, -1.0, 1.0, -1.0])
    for unit in ("rad", "m"):
        got = fit([pairs(up(SPEEDS) + zigzag, up(SPEEDS) - zigzag, error=1e-3)], unit=unit, name="a")
        assert got.symmetric is not differ
        if differ:
            assert got.law.positive == pytest.approx(up(SPEEDS) + zigzag)
            assert got.law.negative == pytest.approx(up(SPEEDS) - zigzag)
    # one knot alone that differs: the mean of squares counts, not that of any other power
    size = np.sqrt(np.mean(up(SPEEDS) ** 2))
    one = np.array([0.0, 0.0, 0.0, share * size * 2.0])
    got = fit([pairs(up(SPEEDS) + 0.5 * one, up(SPEEDS) - 0.5 * one, error=1e-3)], unit="m", name="a")
    assert got.symmetric is not differ


@pytest.mark.parametrize(("times", "differ"), [(3.9, False), (4.1, True)])
def test_and_from_four_standard_errors_of_a_difference_on(times, differ):
    apart = 4.0  # between the directions at one knot, far more than a share of the friction
    error = apart / times / np.sqrt(2.0)
    one = np.array([0.0, 0.5 * apart, 0.0, 0.0])
    for sign in (1.0, -1.0):
        got = fit([pairs(up(SPEEDS) + sign * one, up(SPEEDS) - sign * one, error=error)], unit="m", name="a")
        assert got.symmetric is not differ


def test_a_linear_axis_gives_the_constant_to_the_friction_as_long_as_that_resists():
    one = fit([pairs(up(SPEEDS) + 1.5, up(SPEEDS) - 1.5, error=1e-3)], unit="m", name="a")
    assert one.terms == {} and one.law.positive == pytest.approx(up(SPEEDS) + 1.5)
    assert one.law.negative == pytest.approx(up(SPEEDS) - 1.5) and np.isnan(one.noise_gain)
    assert one.warnings == (
        "Joint 'a': offset unattributed: half the constant difference of the directions, 1.5 N, is given to the friction; "
        "an offset of the torque signal or a constant pull would look the same.",
    )
    # a pull of 12 is more than friction at the slowest knot: it is no friction
    pulled = fit([pairs(up(SPEEDS) + 12.0, up(SPEEDS) - 12.0)], unit="m", name="a", symmetric=False)
    assert pulled.terms["offset"][0] == pytest.approx(12.0) and pulled.law.negative == pytest.approx(
        up(SPEEDS)
    )
    assert "12 N may be gravity" in pulled.warnings[0] and pulled.warnings[0].endswith("the former two.")
    even = fit([pairs(up(SPEEDS) + 1.5, up(SPEEDS) - 1.5)], unit="m", name="a", symmetric=True)
    assert even.terms["offset"][0] == pytest.approx(1.5) and even.law.positive == pytest.approx(up(SPEEDS))
    assert even.warnings == ()


# -------------------------------------------------------------------------------------------- gravity


@pytest.mark.parametrize(("times", "known"), [(3.9, False), (4.1, True), (-4.1, True)])
def test_gravity_is_seen_inside_a_stroke_from_four_standard_errors_on(times, known):
    q, bias, slope = 0.3, 2.0, 5.0
    got = rotary(
        [pairs(up(SPEEDS) + bias, up(SPEEDS) - bias, q, slope=(np.sign(times) * slope, slope / abs(times)))]
    )
    assert (set(got.terms) == set(GRAVITY)) is known and (set(got.terms) == {"offset"}) is not known
    if known:
        # level (s sin q + c cos q) = bias, s cos q - c sin q = slope
        s, c = np.array([[np.sin(q), np.cos(q)], [np.cos(q), -np.sin(q)]]) @ [
            bias / 0.98,
            np.sign(times) * slope,
        ]
        assert [got.terms[t][0] for t in GRAVITY] == pytest.approx([s, c])
        assert got.law.positive == pytest.approx(up(SPEEDS)) and got.condition == np.inf
        assert (
            got.warnings[0].startswith("Joint 'a' has one curve for both directions")
            and REMEDY in got.warnings[0]
        )
        assert got.tells(0.3) and got.tells(0.349) and not got.tells(0.351) and not got.tells(0.249)


@pytest.mark.parametrize(("times", "known"), [(3.9, False), (4.1, True)])
def test_and_from_center_to_center(times, known):
    # half sums of four pairs each: the error of their mean is that of one pair, e / sqrt(2), over sqrt(4)
    error = 0.05
    apart = times * error / np.sqrt(2.0) / 2.0
    knots = [pairs(up(SPEEDS), up(SPEEDS), -0.4), pairs(up(SPEEDS) + apart, up(SPEEDS) - apart, 0.9)]
    assert (set(rotary(knots).terms) == set(GRAVITY)) is known
    # of unequal errors the larger counts
    worse = [pairs(up(SPEEDS), up(SPEEDS), -0.4, error=2.0 * error), knots[1]]
    assert set(rotary(worse).terms) == {"offset"}
    asked = rotary(knots, symmetric=True)
    assert asked.symmetric and asked.warnings == ()


THREE = (-1.2, 0.4, 1.7)
WEIGHT = np.array([7.0, 20.0])


def test_three_centers_tell_unequal_directions_from_gravity():
    knots = about(THREE, WEIGHT, c=0.8, slopes=0.5)
    got = rotary(knots)
    assert not got.symmetric and got.law.positive == pytest.approx(up(SPEEDS) + 0.8)
    assert got.law.negative == pytest.approx(up(SPEEDS) - 0.8)
    eqs = equations(knots)
    _, covariance = eqs.solve("own", GRAVITY)
    assert [got.terms[t][0] for t in GRAVITY] == pytest.approx(WEIGHT) and set(got.terms) == set(GRAVITY)
    assert [got.terms[t][1] for t in GRAVITY] == pytest.approx(np.sqrt(np.diag(covariance)[8:10]))
    assert got.covariance == pytest.approx(covariance[:8, :8]) and got.condition == eqs.condition(
        "own", GRAVITY
    )
    assert got.error_pos == pytest.approx(np.sqrt(np.diag(covariance)[:4]))
    assert got.error_neg == pytest.approx(np.sqrt(np.diag(covariance)[4:8]))
    row = np.r_[np.full(4, 0.125), np.full(4, -0.125)]
    half_sum = 0.05 / np.sqrt(8.0)  # of one center
    assert got.noise_gain == pytest.approx(np.sqrt(row @ covariance[:8, :8] @ row) / half_sum)
    assert got.centers == THREE and got.warnings == () and got.tells(5.0)
    assert got.notes == (
        "Its centers separate the constant difference of the directions from gravity (condition "
        f"{got.condition:.0f}, noise gain {got.noise_gain:.2g}); an offset of the torque signal would look the same as such a "
        "difference.",
    )
    (F_p, a), (F_n, b) = got.constants()
    assert (F_p, F_n) == (pytest.approx(9.8), pytest.approx(8.2))
    row = np.array([2.0, -1.0, 0.0, 0.0])  # the first section, at rest
    assert a == pytest.approx(np.sqrt(row @ covariance[:4, :4] @ row))
    assert b == pytest.approx(np.sqrt(row @ covariance[4:8, 4:8] @ row))
    one = rotary(about(THREE, WEIGHT, c=0.8, slopes=0.5), symmetric=True)
    assert one.symmetric and one.law.positive == one.law.negative == pytest.approx(up(SPEEDS))
    assert set(one.terms) == {*GRAVITY, "offset"} and one.terms["offset"][0] == pytest.approx(0.8)
    assert np.isnan(one.noise_gain) and one.notes == () and one.warnings == ()


@pytest.mark.parametrize(("share", "differ"), [(0.029, False), (0.031, True)])
def test_a_constant_difference_counts_where_the_centers_tell_it(share, differ):
    c = 0.5 * share * np.sqrt(np.mean(up(SPEEDS) ** 2))
    assert rotary(about(THREE, WEIGHT, c=c, error=1e-4)).symmetric is not differ


def test_close_centers_leave_the_constant_beside_gravity():
    """Within a tenth of a radian levels tell nothing; slopes of gravity do, and a constant is found beside it."""
    near = (0.30, 0.35, 0.40)
    knots = about(near, WEIGHT, c=0.8, slopes=1e-3, error=1e-3)
    assert equations(knots).condition("own", GRAVITY) > 500.0
    got = rotary(knots, symmetric=False)
    assert set(got.terms) == {*GRAVITY, "offset"} and got.terms["offset"][0] == pytest.approx(0.8, abs=1e-6)
    assert [got.terms[t][0] for t in GRAVITY] == pytest.approx(WEIGHT, rel=1e-6)
    assert got.law.positive == pytest.approx(up(SPEEDS)) and np.isnan(got.noise_gain)
    assert got.warnings[0].startswith("Joint 'a': offset unattributed:")
    even = rotary(knots)
    assert even.symmetric and set(even.terms) == {*GRAVITY, "offset"} and "has one curve" in even.warnings[0]
    # without slopes nothing tells the constant from gravity there
    level = rotary(about(near, WEIGHT, c=0.8, error=1e-3))
    assert set(level.terms) == set(GRAVITY) and level.symmetric


def test_no_gravity_at_distant_centers_is_a_vertical_axis():
    got = rotary(about(THREE, (0.0, 0.0), c=0.8, slopes=0.5), symmetric=False)
    assert set(got.terms) == set(GRAVITY) and [got.terms[t][0] for t in GRAVITY] == pytest.approx(
        [0.0, 0.0], abs=1e-9
    )
    assert (
        got.law.positive == pytest.approx(up(SPEEDS) + 0.8)
        and "separate the constant difference" in got.notes[0]
    )


SAME = "The gravity torque has the same size at all centers"


@pytest.mark.parametrize(
    ("less", "weight", "said"),
    [(0.04, 20.0, True), (0.06, 20.0, False), (0.0, 1.95, True), (0.0, 1.8, False)],
)
def test_centers_that_carry_one_weight_are_named(less, weight, said):
    """Sizes of gravity within a twentieth, and a tenth of the friction, which is 12.75 on average here."""
    q = 0.8
    other = np.pi - np.arccos((1.0 - less) * np.cos(q))  # where gravity is smaller by that share
    knots = about((-q, q, other), (0.0, weight), error=1e-4)
    got = rotary(knots)
    sizes = [note.split(f"{SAME}, ")[1].split(" N.m")[0] for note in got.notes if SAME in note]
    assert bool(sizes) is said
    assert all(float(size) == pytest.approx(weight * np.cos(q), rel=0.05) for size in sizes)
    assert got.load is None and not any(SAME in w for w in got.warnings)


# ----------------------------------------------------------------------------------- errors and edges


def test_the_error_of_the_delay_adds_what_it_moves():
    base = [pairs(up(SPEEDS) + 1.5, up(SPEEDS) - 1.5)]
    moved = [pairs(up(SPEEDS) + 1.6, up(SPEEDS) - 1.4)]  # by 0.1 against motion in both directions
    without, with_ = rotary(base), rotary(base, late=moved)
    assert with_.law == without.law
    assert with_.covariance - without.covariance == pytest.approx(np.full((8, 8), 0.01))
    assert with_.error_pos == pytest.approx(np.sqrt(0.05**2 / 2.0 + 0.01))
    assert with_.terms["offset"] == pytest.approx(without.terms["offset"])


def test_pairs_without_errors_make_a_curve_without_errors():
    none = pairs(up(SPEEDS) + 1.5, up(SPEEDS) - 1.5, error=NAN)
    got = rotary([none])
    assert got.law.positive == pytest.approx(up(SPEEDS)) and got.terms["offset"][0] == pytest.approx(1.5)
    assert (
        np.isnan([*got.error_pos, *got.error_neg, got.terms["offset"][1]]).all()
        and np.isnan(got.covariance).all()
    )
    three = rotary(
        [
            pairs(up(SPEEDS) + g, up(SPEEDS) - g, q, error=NAN)
            for q, g in zip(THREE, (1.0, 5.0, -2.0), strict=True)
        ]
    )
    assert three.load is None and np.isnan(three.error_pos).all()
    g = [0.98 * (WEIGHT @ [np.sin(q), np.cos(q)]) for q in (-1.9, -0.4, 0.8, 1.6)]
    grown = [
        pairs(up(SPEEDS) + 0.3 * abs(x) + x, up(SPEEDS) + 0.3 * abs(x) - x, q, error=NAN)
        for q, x in zip((-1.9, -0.4, 0.8, 1.6), g, strict=True)
    ]
    assert rotary(grown).load is None  # without errors no growth is significant


def test_a_first_section_that_reaches_below_zero_is_cut_off_with_a_word():
    steep = np.array([1.0, 3.0, 5.0, 7.0])  # 4 v - 1
    got = rotary([pairs(steep, steep)])
    assert got.law.velocity == (0.0, *SPEEDS) and got.law.positive == pytest.approx((0.0, *steep))
    assert got.warnings == (
        "Joint 'a': the first section of the curve reaches below zero at rest, where it was cut off.",
    )
    e = 0.05 / np.sqrt(2.0)
    assert got.error_pos == pytest.approx([e * np.sqrt(5.0), e, e, e, e])  # 2 F_1 - F_2
    assert got.covariance.shape == (10, 10) and got.covariance[0, 1] == pytest.approx(2.0 * e * e)
    (F_p, a), _ = got.constants()
    assert F_p == pytest.approx(0.0, abs=1e-9) and a == pytest.approx(e * np.sqrt(5.0))


def test_growth_with_the_load_stands_beside_the_terms():
    """mu 0.1 under |g|: the law is that under the mean weight carried, in one curve as in two."""
    mu, centers = 0.1, (-1.9, -0.4, 0.8, 1.6)
    g = [0.98 * (WEIGHT @ [np.sin(q), np.cos(q)]) for q in centers]
    for c, symmetric in ((0.8, False), (0.0, True)):
        knots = [
            pairs(up(SPEEDS) + c + mu * abs(x) + x, up(SPEEDS) - c + mu * abs(x) - x, q, error=1e-3)
            for q, x in zip(centers, g, strict=True)
        ]
        got = rotary(knots)
        carried = np.mean(np.abs(g))
        assert got.symmetric is symmetric and got.load is not None
        assert got.load[0] == pytest.approx(mu, rel=1e-4) and got.load[2] == pytest.approx(carried, rel=1e-4)
        assert got.law.positive == pytest.approx(up(SPEEDS) + c + mu * carried, rel=1e-4)
        assert got.law.negative == pytest.approx(up(SPEEDS) - c + mu * carried, rel=1e-4)
        assert "load_dependence" not in got.terms and got.notes[0].startswith("Friction grows by 0.1000 +- ")
        assert f"under {carried:.3g} N.m" in got.notes[0] and not any(SAME in n for n in got.notes)
        eqs = equations(knots).with_load_growth(WEIGHT)
        curves, kept = (
            ("equal", (*GRAVITY, "offset", "load_dependence"))
            if symmetric
            else ("own", (*GRAVITY, "load_dependence"))
        )
        _, covariance = eqs.solve(curves, kept)
        assert got.load[1] == pytest.approx(np.sqrt(covariance[-1, -1]), rel=1e-3)
        at = np.hstack([np.eye(8), np.zeros((8, 3)), np.full((8, 1), carried)])
        assert got.covariance == pytest.approx(at @ covariance @ at.T, rel=1e-3, abs=1e-10)


@pytest.mark.parametrize(("share", "told"), [(0.9e-4, False), (1.1e-4, True)])
def test_unknowns_are_determined_from_a_ten_thousandth_of_the_largest_singular_value_on(share, told):
    terms, low, high = (*GRAVITY, "offset"), 1e-6, 1.0
    for _ in range(60):  # the distance of two centers at which the ratio is that
        apart = np.sqrt(low * high)
        eqs = equations(about((0.3, 0.3 + apart), WEIGHT, slopes=0.5))
        X = (eqs.X @ eqs.spread("equal", terms)) * eqs.weight[:, None]
        singular = np.linalg.svd(X / np.linalg.norm(X, axis=0), compute_uv=False)
        low, high = (apart, high) if singular[-1] < share * singular[0] else (low, apart)
    assert eqs.determines("equal", terms) is told


def test_equations_where_errors_or_centers_are_missing():
    """Without a center gravity is taken at zero; an error of zero is taken for a tenth of the median."""
    knots = pairs(up(SPEEDS), up(SPEEDS), NAN, error=0.2)
    mixed = SweepKnots(**{**vars(knots), "error_pos": np.array([0.2, 0.0, NAN, 0.01])})
    eqs = equations([mixed])
    assert 1.0 / eqs.weight == pytest.approx([0.2, 0.02, 0.02, 0.02, 0.2, 0.2, 0.2, 0.2])
    assert eqs.X[:, 8:10] == pytest.approx(np.tile([0.0, 0.98], (8, 1))) and np.all(eqs.X[:, 10] == 1.0)
    assert np.unique(equations([pairs(up(SPEEDS), up(SPEEDS), error=NAN)]).weight).size == 1
    swung = SweepKnots(**{**vars(knots), "swing": np.array([1.0, 2.0, 3.0, 4.0]), "inertia": (1.5, 0.1)})
    assert equations([swung]).swing == pytest.approx([1.5, 3.0, 4.5, 6.0] * 2)
    for inertia in ((-1.5, 0.1), (NAN, NAN)):
        assert not equations([SweepKnots(**{**vars(swung), "inertia": inertia})]).swing.any()
    # speeds within a hundredth of the top share a knot
    close = [
        pairs(up(SPEEDS), up(SPEEDS)),
        pairs(up(SPEEDS), up(SPEEDS), speeds=SPEEDS + [0.019, -0.019, 0.021, 0.019]),
    ]
    assert pytest.approx([0.5095, 0.9905, 1.5, 1.521, 2.0095]) == equations(close).V
    # half a turn apart one direction of gravity is not seen, and need not be told
    assert equations(about((0.3, 0.3 + np.pi), WEIGHT)).condition("own", GRAVITY) < 10.0
    assert equations(about((0.3, 1.3), WEIGHT)).condition("own", GRAVITY) == np.inf


# ----------------------------------------------------------------------------------- sections and words


def test_sections_through_pairs_are_equal_or_by_direction():
    knots = SweepKnots(
        V_pos=np.array([0.9, 2.1]), V_neg=np.array([1.1, 1.9]), F_pos=np.array([5.0, 11.0]), F_neg=np.array([3.0, 5.0]),
        error_pos=np.ones(2), error_neg=np.ones(2), count_pos=np.ones(2), count_neg=np.ones(2),
    )  # fmt: skip
    even = to_polyline(knots)
    assert even.velocity == (1.0, 2.0) and even.positive == even.negative == (4.0, 8.0)
    # 5 v + 0.5 along +q and 2.5 v + 0.25 along -q, less the constant and with it
    apart = to_polyline(knots, symmetric=False, constant=0.5)
    assert apart.positive == pytest.approx((5.0, 10.0)) and apart.negative == pytest.approx((3.25, 5.75))
    assert to_polyline(knots, symmetric=False).positive == pytest.approx((5.5, 10.5))
    at_rest = polyline_through(np.array([0.0, 1.0]), np.array([-1.0, 2.0]), np.array([1.0, 2.0]))
    assert at_rest.velocity == (0.0, 1.0) and at_rest.positive == (-1.0, 2.0)


def shown(found, joint=None, errors=True):
    m = len(found.law.velocity)
    return JointFriction(
        joint=joint or Joint(name="a"), law=Law(rate=found.law), validity=Validity(velocity=(-2.0, 2.0)),
        standard_errors={"positive": (0.1,) * m, "negative": (0.1,) * m} if errors else {},
        dynamics=estimates({k: v for k, v in found.terms.items() if k == "offset"}, "rad"),
        fitted=Quality(residual=5.0, residual_raw=5.0, rms=1.0, samples=9),
    )  # fmt: skip


EXPLAINS = "The model explains all but 5.0 % of the torque it was fitted to: good."


def test_the_words_of_a_sweep():
    even = rotary([pairs(up(SPEEDS) + 1.5, up(SPEEDS) - 1.5)])
    apart = "A constant 1.5 N.m was separated from friction: gravity, an offset of the torque signal or unequal directions."
    knots = "Its 4 knots have standard errors up to 0.035 N.m."
    below = "Below 0.5 rad/s friction is unknown."
    assert (
        verdict(shown(even), even)
        == f"Friction is 10.5 N.m at 0.5 rad/s and 15 N.m at 2 rad/s. {knots} {below} {apart} {EXPLAINS}"
    )
    assert verdict(shown(even, errors=False), even) == (
        f"Friction is 10.5 N.m at 0.5 rad/s and 15 N.m at 2 rad/s. {apart} {EXPLAINS}"
    )
    for constant, said in ((0.44, False), (0.46, True), (-0.46, True)):  # three hundredths of 15
        found = rotary([pairs(up(SPEEDS) + constant, up(SPEEDS) - constant)])
        assert ("was separated" in verdict(shown(found), found)) is said
    told = rotary(about(THREE, WEIGHT, c=0.8, slopes=0.5))
    (p, _), (n, _) = told.constants()
    said = verdict(shown(told), told)
    assert said.startswith(
        "Friction is 11.3 N.m along +q and 9.7 N.m along -q at 0.5 rad/s, 15.8 and 14.2 N.m at 2 rad/s. Its 4 knots have "
        f"standard errors up to {max(told.error_pos.max(), told.error_neg.max()):.2g} N.m. Below 0.5 rad/s friction is "
        "unknown: a straight line from there meets rest at 9.8 and 8.2 N.m, a Stribeck peak would lie above it."
    )
    assert p > n and "was separated" not in said and said.endswith(f"{told.notes[0]} {EXPLAINS}")
    line = fit([pairs(up(SPEEDS) + 1.5, up(SPEEDS) - 1.5, error=1e-3)], unit="m", name="a")
    said = verdict(shown(line, Joint(name="a", unit="m")), line)
    assert said.startswith("Friction is 12 N along +q and 9 N along -q at 0.5 m/s, 16.5 and 13.5 N at 2 m/s.")
    assert "meets rest" not in said
    bent = rotary(about(THREE, WEIGHT, bend=0.6))
    assert isinstance(bent.law, Polyline) and not bent.symmetric
