"""What the classes of the laws hold: places in the rows, bounds of parameters, what is promised of each, and what is advised."""

import re
from dataclasses import fields, replace
from itertools import pairwise

import numpy as np
import pytest

from backdrive.errors import InvalidInput
from backdrive.laws import (
    ELEMENTS,
    GMS,
    M6,
    RATES,
    BlimanSorine,
    Coulomb,
    CoulombViscous,
    Decaying,
    GearLoad,
    Law,
    Leuven,
    LoadTemperature,
    LuGre,
    MaxwellSlip,
    Polyline,
    SmoothedMaxwellSlip,
    StribeckGauss,
    ViscoElastoplastic,
    XiongKikuuwe,
    XiongKikuuweMulti,
)
from backdrive.laws.examples import ELEMENT_EXAMPLES, RATE_EXAMPLES

EXAMPLES = RATE_EXAMPLES | ELEMENT_EXAMPLES
FREE = (-np.inf, np.inf)
UP = (0.0, np.inf)
STIFF, SPEED, RATIO = (1e-9, np.inf), (1e-9, 1e6), (0.0, 2.0)
M5 = {
    "coulomb": UP, "viscous": UP, "stribeck": UP, "stribeck_velocity": SPEED, "exponent": (0.1, 4.0), "load_motor": RATIO,
    "load_external": RATIO, "load_stribeck_motor": RATIO, "load_stribeck_external": RATIO,
}  # fmt: skip
STRIBECK = {"coulomb": UP, "breakaway": UP, "stribeck_velocity": SPEED, "viscous": UP}
PARTS = {"stiffness": STIFF, "share": (0.0, 1.0)}

#: What every parameter may be, in the order of the row: positive stiffnesses, growth with the load up to 2, speeds up to 1e6.
BOUNDS = {
    "coulomb": {"coulomb": UP},
    "coulomb-viscous": {"coulomb_positive": UP, "coulomb_negative": UP, "viscous_positive": UP, "viscous_negative": UP},
    "stribeck-gauss": STRIBECK,
    "stribeck-tustin": {**{k: STRIBECK[k] for k in list(STRIBECK)[:3]}, "exponent": (0.1, 4.0), "viscous": UP},
    "stribeck-lorentz": STRIBECK,
    "makkar": {"stribeck": UP, "rise": (1e-6, 1e9), "fall": (1e-6, 1e9), "coulomb": UP, "steepness": (1e-6, 1e9), "viscous": UP},
    "sigmoid": {"span": UP, "steepness": (1e-6, 1e9), "shift": (-1e6, 1e6)},
    "degressive": {"coulomb": UP, "growth": UP, "exponent": (0.05, 1.0)},
    "polyline": {"velocity": UP, "positive": FREE, "negative": FREE},
    "m1": {"coulomb": UP, "viscous": UP},
    "m2": {k: M5[k] for k in list(M5)[:5]},
    "m3": {"coulomb": UP, "viscous": UP, "load": RATIO},
    "m4": {**{k: M5[k] for k in list(M5)[:5]}, "load": RATIO, "load_stribeck": RATIO},
    "m5": M5,
    "m6": {**M5, "quadratic_external": UP, "quadratic_motor": UP},
    "load-temperature": {
        "coulomb": UP, "coulomb_load": RATIO, "stribeck_load": RATIO, "stribeck_velocity_load": SPEED, "stribeck": FREE,
        "stribeck_temperature": FREE, "stribeck_velocity": (-1e6, 1e6), "stribeck_velocity_temperature": FREE, "viscous": UP,
        "viscous_temperature": UP, "thinning": (0.1, 1e4), "exponent": (0.1, 4.0),
    },
    "gear-load": {"coulomb": UP, "load": RATIO, "driving": RATIO, "driven": RATIO, "stribeck_velocity": SPEED, "viscous": UP},
    "none": {},
    "dead-zone": {"threshold": (0.0, 1e6)},
    "dahl": {"stiffness": STIFF},
    "bliman-sorine": {"distance": (1e-12, 1e3), "ratio": (1e-3, 0.999), "overshoot": (0.0, 10.0)},
    "reset-integrator": {"stiffness": STIFF, "excess": (0.0, 10.0), "damping": UP},
    "lugre": {"stiffness": STIFF, "damping": UP, "fading": (0.0, 1e6)},
    "elastoplastic": {"stiffness": STIFF, "damping": UP, "fading": (0.0, 1e6), "elastic": (0.0, 0.99)},
    "hayward-armstrong": {"stiffness": STIFF},
    "visco-elastoplastic": {"stiffness": STIFF, "damping": UP},
    "xiong-kikuuwe": {"stiffness": STIFF, "damping": (1e-12, np.inf), "lag": (0.0, 10.0)},
    "xiong-kikuuwe-multi": {**PARTS, "damping_time": (0.0, 10.0), "lag": (0.0, 10.0)},
    "decaying": {"stiffness": STIFF, "decay_rate": (0.0, 1e6)},
    "maxwell-slip": PARTS,
    "leuven": {**PARTS, "sharpness": (0.5, 50.0), "damping": UP},
    "gms": {**PARTS, "attraction": STIFF},
    "smoothed-maxwell-slip": {**PARTS, "sharpness": (1.0, 1e4), "margin": (0.1, 0.999), "reversal": (1.0, 1e4)},
}  # fmt: skip


@pytest.mark.parametrize("name", BOUNDS)
def test_every_parameter_has_its_place_and_its_bounds(name):
    cls = (RATES | ELEMENTS)[name]
    assert {k: (p.lower, p.upper) for k, p in cls.PARAMETERS.items()} == BOUNDS[name]
    assert list(cls.PARAMETERS) == list(BOUNDS[name])
    assert {f.name for f in fields(cls)} == set(BOUNDS[name])
    assert EXAMPLES[name].values() == {k: getattr(EXAMPLES[name], k) for k in BOUNDS[name]}
    for key, parameter in cls.PARAMETERS.items():
        value = EXAMPLES[name].values()[key]
        assert isinstance(value, tuple) is parameter.many
        with pytest.raises(InvalidInput, match="sequence of numbers" if parameter.many else "one number"):
            replace(EXAMPLES[name], **{key: 1.0 if parameter.many else [1.0]})
        low, high = BOUNDS[name][key]
        for bound, beyond in ((low, -1.0), (high, 1.0)):
            if np.isfinite(bound) and parameter.many and key != "share":
                wrong = (value[0], bound + beyond * max(abs(bound) * 1e-9, 1e-12), *value[2:])
                with pytest.raises(InvalidInput):
                    replace(EXAMPLES[name], **{key: wrong})


def test_the_names_of_the_laws_are_counted_and_their_kinds_apart():
    assert set(BOUNDS) == {*RATES, *ELEMENTS}
    together = [{"coulomb", "coulomb-viscous"}, {"m1", "m2", "m3", "m4", "m5", "m6"},
                {"xiong-kikuuwe", "xiong-kikuuwe-multi"}]  # fmt: skip
    for family in (RATES, ELEMENTS):
        kinds = {}
        for name, cls in family.items():
            kinds.setdefault(cls.KIND, set()).add(name)
        assert sorted(kinds) == list(range(len(kinds)))
        assert all(len(names) == 1 or names in together for names in kinds.values())


def test_what_is_promised_of_every_law():
    """As the heads of their files say: which need a load, which are smooth at rest, which drift, slide, hold, reach the curve."""
    needs = {name: ("load",) for name in ("m3", "m4", "m5", "m6", "gear-load")}
    needs |= {"load-temperature": ("load", "temperature")}
    ties = {
        "coulomb-viscous": {"coulomb_negative": "coulomb_positive"},
        "polyline": {"negative[0]": "positive[0]"},
    }
    for name, rate in RATES.items():
        assert needs.get(name, ()) == rate.NEEDS
        assert rate.SMOOTH is (name in ("makkar", "sigmoid"))
        assert rate.SYMMETRIC is (name not in ("coulomb-viscous", "polyline", "sigmoid"))
        assert ties.get(name, {}) == rate.TIES
    drift = {"dahl", "bliman-sorine", "lugre", "decaying", "leuven"}
    for name, element in ELEMENTS.items():
        assert element.DRIFTS is (name in drift)
        assert element.SLIDER is (name in ("hayward-armstrong", "decaying"))
        assert element.SET_VALUED is (name in ("none", "dead-zone"))
        assert element.STEADY is (name not in ("dead-zone", "decaying"))


def test_rows_of_the_laws():
    """[m, the rate law's m numbers, the element's]: families share one layout, what a member has not is neutral in it."""

    def row(law):
        return law.row().tolist()

    gauss = StribeckGauss(coulomb=1.0, breakaway=2.0, stribeck_velocity=3.0, viscous=4.0)
    assert row(gauss) == [1.0, 2.0, 3.0, 4.0]
    assert row(Coulomb(coulomb=1.5)) == [1.5, 1.5, 0.0, 0.0]
    assert row(RATES["m1"](coulomb=1.5, viscous=2.5)) == [1.5, 0.0, 1.0, 1.0, 2.5, *[0.0] * 6]
    assert row(RATES["m3"](coulomb=1.5, load=0.3)) == [1.5, 0.0, 1.0, 1.0, 0.0, 0.3, 0.3, *[0.0] * 4]
    m4 = RATES["m4"](
        coulomb=1.5, stribeck=2.5, stribeck_velocity=3.5, exponent=0.5, load=0.3, load_stribeck=0.4
    )
    assert row(m4) == [1.5, 2.5, 3.5, 0.5, 0.0, 0.3, 0.3, 0.4, 0.4, 0.0, 0.0]
    m6 = M6(coulomb=1.5, load_motor=0.1, load_external=0.2, load_stribeck_motor=0.3, load_stribeck_external=0.4,
            quadratic_external=0.5, quadratic_motor=0.6)  # fmt: skip
    assert row(m6) == [1.5, 0.0, 1.0, 1.0, 0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
    lines = Polyline(velocity=(1.0, 2.0), positive=(3.0, 4.5), negative=(5.0, 5.0))
    knots = [1.0, *[np.inf] * 5]
    assert row(lines) == [6.0, 1.5, 5.0, *knots, *[1.0, 3.0, 1.5] * 7, *[1.0, 5.0, 0.0] * 7]
    cut = Polyline(velocity=(2.0, 3.0, 5.0), positive=(1.0, 3.0, 4.0), negative=(4.0, 4.0, 4.0))
    knots = [2.0, 3.0, *[np.inf] * 4]
    forward = [0.0, 0.0, 0.5, 2.0, 1.0, 2.0, *[3.0, 3.0, 0.5] * 5]  # what would start below 0 starts at 0
    assert row(cut)[:9] == [6.0, 0.0, 4.0, *knots]
    assert row(cut)[9:30] == forward
    assert row(Polyline(velocity=(2.0,), positive=(3.0,), negative=(1.0,)))[:4] == [6.0, 3.0, 1.0, 2.0]
    assert row(ViscoElastoplastic(stiffness=4.0, damping=2.0)) == [4.0, 0.5]
    assert row(XiongKikuuwe(stiffness=4.0, damping=2.0, lag=3.0)) == [1.0, 4.0, 1.0, 0.5, 3.0]
    many = {"stiffness": (7.0, 8.0), "share": (0.25, 0.75)}
    head = [2.0, 7.0, 8.0, 0.25, 0.75]
    for cls, more in (
        (MaxwellSlip, {}), (Leuven, {"sharpness": 3.0, "damping": 2.0}), (GMS, {"attraction": 3.0}),
        (SmoothedMaxwellSlip, {"sharpness": 50.0, "margin": 0.5, "reversal": 3.0}),
        (XiongKikuuweMulti, {"damping_time": 0.5, "lag": 2.0}),
    ):  # fmt: skip
        assert row(cls(**many, **more)) == head + list(more.values())
        assert (cls(**many, **more).many()) == head
    assert Law(rate=gauss, element=MaxwellSlip(**many)).row().tolist() == [4.0, *row(gauss), *head]
    for name, e in ELEMENT_EXAMPLES.items():
        n = {"gms": 6, "bliman-sorine": 2, "none": 0, "dead-zone": 0}.get(name, 1)
        n = {"leuven": 3, "maxwell-slip": 3, "smoothed-maxwell-slip": 3, "xiong-kikuuwe-multi": 5}.get(
            name, n
        )
        n = 3 if name == "xiong-kikuuwe" else n
        assert e.states() == n
        assert Law(rate=gauss, element=e).state().tolist() == [0.0] * 2 * max(n, 1)


class Asked(CoulombViscous):
    """A rate law that keeps what it is asked for."""

    def curves(self, load, temperature):
        asked.append((load, temperature))
        return super().curves(load, temperature)


asked: list = []


def test_advice_is_for_no_load_at_20_degrees_where_nothing_else_is_said():
    rate = Asked(coulomb_positive=5.0, coulomb_negative=4.0)
    loaded = ((3.0, -2.0), 55.0)
    for e in ELEMENT_EXAMPLES.values():
        asked.clear()
        assert e.advice(rate) == e.advice(rate, *loaded) == ""
        assert set(asked[:1]) <= {((0.0, 0.0), 20.0)} and set(asked[1:]) <= {loaded}
    asked.clear()
    rate.span()
    rate.span(*loaded)
    assert asked == [((0.0, 0.0), 20.0), loaded]
    assert {type(e) for e in ELEMENT_EXAMPLES.values() if type(e).advice is not ELEMENTS["none"].advice} == {
        BlimanSorine, GMS, LuGre, ELEMENTS["elastoplastic"], Decaying,
    }  # fmt: skip


def test_the_span_of_a_law_is_that_under_its_load_at_its_temperature():
    """F = 3 + (0.15 + e S)|T| at the slowest and at the fastest motion, S = 0.1 driving and 0.2 driven."""
    gear = RATE_EXAMPLES["gear-load"]
    assert gear.span((0.0, -10.0)) == (
        pytest.approx((3.0 + 1.5, 3.0 + 2.5, 1.0)), pytest.approx((3.0 + 1.5, 3.0 + 3.5, 1.0))
    )  # fmt: skip
    assert isinstance(gear, GearLoad)
    warm = LoadTemperature(
        coulomb=3.0, stribeck=-1.0, stribeck_temperature=0.05, viscous=0.5, viscous_temperature=2.0
    )
    for T, peak in ((20.0, 0.0), (40.0, 1.0), (60.0, 2.0)):
        slope = 0.5 + 2.0 * np.exp(-T / 20.0)
        for way in warm.span(temperature=T):
            assert way == pytest.approx((3.0, 3.0 + peak, slope))


def test_advice_is_given_where_the_bounds_of_one_direction_change_with_speed():
    """S_b alone bends the bound of the direction in which the load drives the motor back."""
    half = replace(RATE_EXAMPLES["gear-load"], driving=0.0)
    for name, e in ELEMENT_EXAMPLES.items():
        if isinstance(e, (BlimanSorine, GMS)):
            assert e.advice(half) == "", name
            for load in ((0.0, -10.0), (0.0, 10.0)):
                assert name.split("+")[-1] in e.advice(half, load), name


def test_advice_on_a_bristles_damping_says_what_it_needs():
    """sigma_1 (F_s - F_c)/F_c = 30 (6 - 4)/4 = 15 and 4 sqrt(2 e) F_c/sigma_1 = 1.24354; a law that is flat needs nothing."""
    for name in ("lugre", "elastoplastic"):
        bristle = replace(ELEMENT_EXAMPLES[name], damping=30.0, fading=0.0)
        curve = StribeckGauss(coulomb=4.0, breakaway=6.0, stribeck_velocity=0.05)
        said = bristle.advice(curve)
        assert "damping = 30 needs viscous >= 15 or 0 < fading <= 1.24354 " in said and f"'{name}'" in said
        assert replace(bristle, damping=0.0).advice(curve) == ""
        assert bristle.advice(replace(curve, breakaway=4.0)) == ""
        assert bristle.advice(replace(curve, breakaway=4.0 * (1.0 + 1e-9))) != ""
        assert "viscous >= inf or 0 < fading <= 0 " in bristle.advice(replace(curve, coulomb=0.0))
        up = CoulombViscous(coulomb_positive=4.0, coulomb_negative=6.0)
        assert bristle.advice(up) == ""  # each way by itself is flat
    for e in (ELEMENT_EXAMPLES["gms"], ELEMENT_EXAMPLES["bliman-sorine"]):
        for breakaway, quiet in (
            (4.0, True),
            (4.0 * (1.0 + 1e-13), True),
            (4.0 * (1.0 + 1e-11), False),
            (3.0, False),
        ):
            rate = StribeckGauss(coulomb=4.0, breakaway=breakaway, stribeck_velocity=0.05)
            assert (e.advice(rate) == "") is quiet


def test_advice_on_a_leaking_spring_names_the_slowest_speed():
    """It carries min(F, K v/alpha) at v; along +q F = 3 and the viscous part is -v. Looked at: 1e-12, 1e-9 * 10^(k/4)."""
    falls = Polyline(velocity=(1.0, 2.0), positive=(2.0, 1.0), negative=(3.0, 3.5))
    grid = [1e-12, *(1e-9 * 10.0 ** (k / 4.0) for k in range(61))]
    for K, alpha in ((10.0, 20.0), (100.0, 20.0), (10.0, 0.0)):
        carried = [min(3.0, K * v / alpha) if alpha > 0.0 else 3.0 for v in grid]
        v, f = next((v, f) for v, f in zip(grid, carried, strict=True) if f - v < 0.0)
        said = Decaying(stiffness=K, decay_rate=alpha).advice(falls)
        numbers = re.search(
            r"carries (\S+) at the velocity (\S+), where the falling curve subtracts (\S+):", said
        )
        assert numbers and [float(x) for x in numbers.groups()] == pytest.approx([f, v, v], rel=1e-3)
    backwards = Polyline(velocity=(1.0, 2.0), positive=(3.0, 3.5), negative=(2.0, 1.0))
    assert "at the velocity -1e-12," in Decaying(stiffness=10.0).advice(backwards)
    assert Decaying(stiffness=10.0).advice(RATE_EXAMPLES["coulomb-viscous"]) == ""


def test_the_shares_of_elements_side_by_side_add_up_to_one():
    for off, fine in (
        (0.0, True),
        (0.9999e-6, True),
        (1.0001e-6, False),
        (-0.9999e-6, True),
        (-1.0001e-6, False),
    ):
        made = {"stiffness": (1.0, 2.0), "share": (0.5, 0.5 + off)}
        if fine:
            assert MaxwellSlip(**made).share[1] == 0.5 + off
        else:
            with pytest.raises(InvalidInput, match="add up to"):
                MaxwellSlip(**made)


def test_the_speeds_at_which_a_law_is_looked_at():
    speeds = [speed for speed, _, _ in Coulomb(coulomb=1.0).curves((0.0, 0.0), 20.0)[1.0]]
    assert len(speeds) == 62 and speeds[:2] == [1e-12, 1e-9]
    assert [b / a for a, b in pairwise(speeds[1:])] == pytest.approx([10.0**0.25] * 60)
