"""Rate laws that differ by direction: by their formulas in plain NumPy, in every kernel, along motions, in files and loops."""

from __future__ import annotations

import io
import json
import pickle
from typing import Any

import numpy as np
import pytest

from _kinds import FEW, PLAIN, of_a_kind
from _laws import CARRIED, JIT, Batch, Condition, batch, law_of
from backdrive.control.compensators.catalog import alg_fc
from backdrive.control.estimators.external import ExternalForce
from backdrive.control.estimators.friction import FrictionEstimator
from backdrive.control.joint_loop import JointLoop
from backdrive.control.loop import Loop
from backdrive.engine import Axis, DriveModel, forward, rollout
from backdrive.engine.tick import Tick
from backdrive.errors import InvalidInput, ModelFileError, UnknownName
from backdrive.identification import identify, validate
from backdrive.laws import (
    ELEMENTS,
    RATES,
    Coulomb,
    CoulombViscous,
    Degressive,
    Growth,
    HaywardArmstrong,
    Law,
    LuGre,
    Makkar,
    Polyline,
    Rigid,
    StribeckGauss,
    StribeckLorentz,
    StribeckTustin,
    by_direction,
    kernels,
    rate_law,
)
from backdrive.laws.examples import ELEMENT_EXAMPLES, RATE_EXAMPLES
from backdrive.logs.log import Drive, Joint, Log
from backdrive.model import Covariance, FrictionModel, JointFriction, Validity, load_model
from backdrive.model.file import decode, encode
from backdrive.report import write_report

ALIKE = [name for name, rate in RATES.items() if rate.SYMMETRIC]
V = np.array([-2.0, -0.3, -0.02, -1e-4, 1e-4, 0.02, 0.3, 2.0])
GAUSS = (
    StribeckGauss(coulomb=4.0, breakaway=5.5, stribeck_velocity=0.05, viscous=1.0),
    StribeckGauss(coulomb=3.0, breakaway=3.6, stribeck_velocity=0.1, viscous=1.8),
)
GROWTH = Growth(load_driving=0.2, load_driven=0.05, load_carried=3.0)
CASES = [
    GAUSS,
    (
        StribeckTustin(coulomb=4.0, breakaway=5.5, stribeck_velocity=0.05, exponent=0.7, viscous=1.0),
        StribeckTustin(coulomb=3.0, breakaway=3.6, stribeck_velocity=0.1, exponent=1.6, viscous=1.8),
    ),
    (
        StribeckLorentz(coulomb=4.0, breakaway=5.5, stribeck_velocity=0.05, viscous=1.0),
        StribeckLorentz(coulomb=3.0, breakaway=3.6, stribeck_velocity=0.1, viscous=1.8),
    ),
    (Degressive(coulomb=4.0, growth=1.5, exponent=0.5), Degressive(coulomb=3.0, growth=2.5, exponent=0.8)),
    (
        Makkar(stribeck=2.0, rise=100.0, fall=20.0, coulomb=4.0, steepness=100.0, viscous=1.0),
        Makkar(stribeck=1.0, rise=50.0, fall=10.0, coulomb=3.0, steepness=80.0, viscous=2.0),
    ),
]
pairs = pytest.mark.parametrize("pair", CASES, ids=lambda pair: pair[0].NAME)


def by_hand(one, v):
    """Bound and viscous torque against a motion of this speed, from the papers' formulas."""
    if isinstance(one, Makkar):
        peak = one.stribeck * (np.tanh(one.rise * v) - np.tanh(one.fall * v))
        return 0.0, peak + one.coulomb * np.tanh(one.steepness * v) + one.viscous * v
    if isinstance(one, Degressive):
        return one.coulomb, one.growth * v**one.exponent
    ratio = v / one.stribeck_velocity
    if isinstance(one, StribeckLorentz):
        left = 1.0 / (1.0 + ratio**2)
    else:
        left = np.exp(-(ratio ** getattr(one, "exponent", 2.0)))
    return one.coulomb + (one.breakaway - one.coulomb) * left, one.viscous * v


@pairs
@pytest.mark.parametrize("growth", [None, GROWTH])
def test_each_direction_has_the_formula_with_numbers_of_its_own(pair, growth):
    law = Law(rate=by_direction(*pair), growth=None if pair[0].SMOOTH else growth)
    row, load = law.row(), 8.0
    more = [0.0, 0.0] if law.growth is None else [0.2 * (load - 3.0), 0.05 * (load - 3.0)]
    for v in V:
        lo, hi, viscous = kernels.limits(law.rate.KIND, row, v, (0.0, -load), 20.0)
        (up, slope_up), (down, slope_down) = (by_hand(one, abs(v)) for one in pair)
        assert (lo, hi) == pytest.approx((-down - more[1], up + more[0]), rel=1e-12)
        assert viscous == pytest.approx(slope_up if v > 0.0 else -slope_down, rel=1e-12)
        expected = up + more[0] + slope_up if v > 0.0 else -(down + more[1] + slope_down)
        assert law.torque(v, load=load) == pytest.approx(expected, rel=1e-12)
    assert law.torque(0.0) == 0.0


def conditions(count, seed):
    random = np.random.default_rng(seed)
    return [Condition.drawn(random.random(5).tolist()) for _ in range(count)], random


def same(law: Law) -> Law:
    """The law with each direction at the numbers of the symmetric one."""
    return Law(rate=by_direction(law.rate, law.rate), element=law.element, growth=law.growth)


@pytest.mark.parametrize("name", [*ALIKE, *(n for n in ELEMENTS if n != "none")])
def test_a_law_with_equal_directions_is_the_symmetric_law_to_the_last_bit(name):
    """Torque along random motions under random loads and temperatures, limits, `solve`, and with growth with the load."""
    made, random = conditions(60 if JIT else 3, 1)
    alike = [rate for rate in CARRIED if rate in ALIKE]
    laws = []
    for i in range(len(made)):
        rate = name if name in ALIKE else alike[i % len(alike)]
        law = law_of(name, rate, random.random(60).tolist())
        grows = i % 2 and "load" not in law.rate.NEEDS and not law.rate.SMOOTH
        laws.append(Law(rate=law.rate, element=law.element, growth=GROWTH if grows else None))
    b = batch(laws, made, random)
    other = Batch([same(law) for law in laws], b.dp, b.dt, b.load, b.temperature)
    np.testing.assert_array_equal(b.run(b.dp)[0], other.run(b.dp)[0])
    np.testing.assert_array_equal(b.limits(b.dp / b.dt[:, None]), other.limits(b.dp / b.dt[:, None]))
    for i in range(0, len(laws), 5):
        free, soft = float(random.normal()), 10.0 ** random.uniform(-4.0, 0.0)
        with np.errstate(all="ignore"):
            rest = tuple(b.load[i]), b.temperature[i]
            ends = [
                kernels.solve(
                    law.rate.KIND, law.element.KIND, law.row(), law.state(), free, 1e-3, soft, *rest
                )
                for law in (laws[i], same(laws[i]))
            ]
        np.testing.assert_array_equal(ends[0], ends[1])


@pytest.mark.parametrize(
    "pair",
    [pytest.param(pair, marks=() if pair[0].NAME in FEW else PLAIN, id=pair[0].NAME) for pair in CASES],
)
def test_the_mirrored_motion_meets_the_other_direction(pair):
    element = Rigid() if pair[0].SMOOTH else LuGre(stiffness=2e3, damping=1.0, fading=0.1)
    q = 0.02 * np.sin(np.arange(4000) * 5e-3) * np.linspace(0.1, 1.0, 4000)
    one, other = (Law(rate=by_direction(*ways), element=element) for ways in (pair, pair[::-1]))
    np.testing.assert_array_equal(rollout(one, q=q, dt=1e-3), -rollout(other, q=-q, dt=1e-3))


@pytest.mark.parametrize("element", of_a_kind(name for name in ELEMENTS if name != "none"))
def test_along_a_motion_and_tick_by_tick_the_numbers_are_the_same(element):
    law = Law(rate=by_direction(*GAUSS), element=ELEMENT_EXAMPLES[element], growth=GROWTH)
    n = 2000 if JIT else 50
    q = 0.01 * np.sin(np.arange(n) * 4e-3) + 1e-5 * np.random.default_rng(0).normal(size=n)
    load = np.tile([5.0, -5.0], (n, 1))
    along = rollout(law, q=q, dt=1e-3, load=load)
    tick = Tick(law, dt=1e-3)
    tick.load[:] = load[0]
    steps = np.diff(q, prepend=q[:1])
    one_by_one = [float(tick.tick(np.array([step]))[0]) for step in steps]
    np.testing.assert_array_equal(along, np.array(one_by_one))


#: Coulomb friction by direction: as two numbers of the one law, and as one number of either of two.
TWO = Law(
    rate=CoulombViscous(coulomb_positive=5.0, coulomb_negative=4.0), element=HaywardArmstrong(stiffness=2e4)
)
BOTH = Law(rate=by_direction(Coulomb(coulomb=5.0), Coulomb(coulomb=4.0)), element=TWO.element)


@pytest.mark.parametrize("growth", [None, GROWTH])
def test_a_loop_and_a_joint_under_it_cannot_tell_two_forms_of_the_same_law(growth):
    made = []
    for law in (TWO, BOTH):
        law = Law(rate=law.rate, element=law.element, growth=growth)
        estimator = FrictionEstimator(law=law)
        loop = Loop(
            JointLoop(
                compensator=alg_fc(law, 5e4, share=0.8),
                external=ExternalForce(inertia=1.0, friction=estimator),
                limit=4.0, top_speed=3.0, encoder_count=1e-6, ramp=0.15,
            ),
            interval=1e-3,
        )  # fmt: skip
        loop.reset(np.zeros(1))
        torque = []
        for k in range(800):
            loop.update(np.array([0.3 * np.sin(4e-3 * k)]), np.array([2.0 * np.sin(7e-3 * k)]))
            torque.append([loop.torque[0], loop.friction[0], loop.external[0]])
        axis = Axis(law=law, inertia=1.0, gravity_cos=10.0)
        free = forward(axis, 10.0 + 9.0 * np.sin(np.arange(600) * 0.01), dt=1e-3)
        made.append((np.array(torque), free.position, free.velocity))
    for one, other in zip(*made, strict=True):
        np.testing.assert_array_equal(one, other)


def joint(law: Law, **more) -> JointFriction:
    return JointFriction(
        joint=Joint(name="j", encoder_counts=1e6), law=law, validity=Validity(velocity=(-2.0, 2.0)), **more
    )


def test_what_is_tuned_keeps_both_directions(tmp_path):
    from backdrive.model import Estimate
    from backdrive.tuning import facts_of

    inertia = {"inertia": Estimate(value=0.7, unit="kg.m^2", standard_error=0.01)}
    errors = {"coulomb": 0.1, "coulomb_backward": 0.2}
    law = Law(rate=by_direction(*GAUSS), element=HaywardArmstrong(stiffness=1e5))
    facts = facts_of(joint(law, dynamics=inertia, standard_errors=errors))
    assert facts.rate == law.rate
    assert facts.coulomb == pytest.approx(0.5 * (5.5 + 3.6))


def test_a_file_keeps_both_directions(tmp_path):
    law = Law(rate=by_direction(*GAUSS), element=LuGre(stiffness=1e4, damping=1.0, fading=0.1), growth=GROWTH)
    names = ("coulomb", "coulomb_backward", "viscous_backward")
    model = FrictionModel(
        joints=(
            joint(
                law,
                standard_errors={"coulomb": 0.1, "coulomb_backward": 0.2, "viscous_backward": 0.3},
                at_bound=("breakaway_backward",),
                covariance=Covariance.of(names, np.diag([0.01, 0.04, 0.09])),
            ),
        )
    )
    model.save(tmp_path / "m.json")
    read = load_model(tmp_path / "m.json")
    assert read.joints[0].law == law and type(read.joints[0].law.rate) is type(law.rate)
    assert read.joints[0].standard_errors == model.joints[0].standard_errors
    covariance = read.joints[0].covariance
    assert covariance is not None and covariance.names == names
    assert read.joints[0].at_bound == ("breakaway_backward",)
    np.testing.assert_array_equal(read.torque("j", V, load=9.0), law.torque(V, load=9.0))
    assert encode(read) == encode(model)
    table = read.torque("j", V) + read.torque("j", -V)
    assert np.abs(table).min() > 0.05  # no speed at which both directions resist alike


@pytest.mark.parametrize(
    ("spoil", "place"),
    [
        (lambda j: j["parameters"].pop("viscous_backward"), r"\$.joints\[0\].parameters.*viscous_backward"),
        (
            lambda j: j["parameters"]["coulomb_backward"].update(value=-1.0),
            r"\$.joints\[0\].parameters.*coulomb_backward",
        ),
        (
            lambda j: j["parameters"]["coulomb_backward"].update(unit="N"),
            r"parameters.coulomb_backward: the unit",
        ),
        (lambda j: j["parameters"].update(huh=j["parameters"]["coulomb"]), "huh"),
        (lambda j: j["law"].update(rate="polyline-by-direction"), r"\$.joints\[0\].law"),
        (lambda j: j["law"].update(rate="stribeck-gaus-by-direction"), "stribeck-gaus"),
        (lambda j: j["law"].update(rate="stribeck-gauss-by-direction-by-direction"), r"\$.joints\[0\].law"),
        (lambda j: j["law"].update(rate="stribeck-gauss"), r"\$.joints\[0\].parameters"),
    ],
)
def test_a_damaged_file_is_refused_at_its_place(spoil, place):
    content = json.loads(encode(FrictionModel(joints=(joint(Law(rate=by_direction(*GAUSS))),))))
    spoil(content["joints"][0])
    with pytest.raises(ModelFileError, match=place):
        decode(json.dumps(content).encode())


def test_a_person_sees_both_directions():
    from rich.console import Console

    from backdrive.report.terminal import joint_tables

    console = Console(width=120, record=True, file=io.StringIO())
    for part in joint_tables(
        joint(Law(rate=by_direction(*GAUSS)), standard_errors={"coulomb_backward": 0.2})
    ):
        console.print(part)
    text = console.export_text()
    assert "stribeck-gauss, by direction" in text
    assert "coulomb, along \N{MINUS SIGN}q" in text and "3.00 ± 0.20" in text


@pytest.mark.parametrize("name", ALIKE)
def test_every_symmetric_law_has_a_form_by_direction(name):
    kind: Any = rate_law(f"{name}-by-direction")
    rate = kind(**kind.EXAMPLE)
    assert f"{name}-by-direction" == kind.NAME
    assert RATES[name].KIND == kind.KIND and RATES[name].NEEDS == kind.NEEDS
    assert not kind.SYMMETRIC and len(kind.PARAMETERS) == 2 * len(RATES[name].PARAMETERS)
    assert rate.forward == RATE_EXAMPLES[name] and type(rate.backward) is RATES[name]
    assert pickle.loads(pickle.dumps(rate)) == rate and rate.row().size == 2 * rate.forward.row().size
    assert by_direction(rate.forward, rate.backward) == rate


@pytest.mark.parametrize("name", sorted(set(RATES) - set(ALIKE)))
def test_a_law_with_both_directions_has_no_other_form(name):
    with pytest.raises(InvalidInput, match="already has parameters for each direction"):
        rate_law(f"{name}-by-direction")


def test_two_directions_are_of_one_class():
    with pytest.raises(InvalidInput, match="StribeckGauss and Coulomb"):
        by_direction(GAUSS[0], Coulomb(coulomb=1.0))
    with pytest.raises(InvalidInput, match="each direction"):
        by_direction(*[Polyline(velocity=(1.0,), positive=(1.0,), negative=(2.0,))] * 2)
    coulomb: Any = rate_law("coulomb-by-direction")
    with pytest.raises(InvalidInput, match="'coulomb_backward' = -1.0 is outside"):
        coulomb(coulomb=1.0, coulomb_backward=-1.0)
    with pytest.raises(UnknownName, match="stribeck-gauss"):
        rate_law("stribeck-gaus-by-direction")


# ------------------------------------------------------------------------------------------------ from logs


def recorded(forward, backward, *, offset=0.0, stiffness=2e3, seed=0):
    """A log of a joint whose friction is LuGre's, without damping, integrated here step by step: no code of the fit has a part."""
    dt, z = 1e-3, 0.0
    t = np.arange(0.0, 40.0, dt)
    q = 0.5 * np.sin(0.69 * t) + 0.25 * np.sin(2.32 * t) + 0.02 * np.sin(8.17 * t)
    v = np.diff(q, prepend=q[0]) / dt
    friction = np.empty(t.size)
    for k, speed in enumerate(v):
        F_c, F_s, v_s, slope = forward if speed >= 0.0 else backward
        bound = F_c + (F_s - F_c) * np.exp(-((speed / v_s) ** 2))
        z += dt * (speed - stiffness * abs(speed) * z / bound)
        friction[k] = stiffness * z + slope * speed
    noise = 0.02 * np.random.default_rng(seed).standard_normal(t.size)
    torque = friction + 0.3 * np.gradient(np.gradient(q, dt), dt) + offset + noise
    return Log(time=t, joints=(Joint(name="j"),), position=q[:, None], torque=torque[:, None])


UP, DOWN = (4.0, 5.5, 0.05, 1.0), (3.0, 3.6, 0.1, 1.8)
PARAMETERS = ("coulomb", "breakaway", "stribeck_velocity", "viscous")
LAW = "stribeck-gauss+lugre"


@pytest.fixture(scope="module")
def differing():
    return recorded(UP, DOWN, offset=0.7)


@pytest.fixture(scope="module")
def result(differing):
    return identify(differing, law=LAW, gravity=False)


def test_where_directions_differ_the_data_ask_for_it_and_the_truth_comes_back(result, tmp_path):
    friction: Any = result.model.joints[0]
    assert result.choice().chosen == friction.law.name == "stribeck-gauss-by-direction+lugre"
    assert friction.law.element.stiffness == pytest.approx(2e3, rel=0.06)
    truth = dict(zip(PARAMETERS, UP, strict=True)) | {
        f"{n}_backward": x for n, x in zip(PARAMETERS, DOWN, strict=True)
    }
    covariance = friction.covariance
    for name, value in truth.items():
        error = friction.standard_errors[name]
        assert getattr(friction.law.rate, name) == pytest.approx(
            value, rel=0.025
        )  # the step of 1 ms is in it
        assert 0.0 < error < 0.05 * value
        assert covariance.standard_errors()[name] == pytest.approx(error)
        low, high = result.intervals["j"][name]
        assert low < getattr(friction.law.rate, name) < high
    assert friction.dynamics["offset"].value == pytest.approx(0.7, abs=0.03)
    assert friction.dynamics["inertia"].value == pytest.approx(0.3, rel=0.02)
    for v in (0.3, 0.8, -0.3, -0.8):
        F_c, F_s, v_s, slope = UP if v > 0.0 else DOWN
        bound = F_c + (F_s - F_c) * np.exp(-((v / v_s) ** 2))
        assert result.model.torque("j", v) == pytest.approx(np.sign(v) * bound + slope * v, rel=0.01)
    result.model.save(tmp_path / "m.json")
    assert load_model(tmp_path / "m.json").joints[0].law == friction.law
    write_report(result, tmp_path / "r.html", command="identify log.csv")
    assert "along \N{MINUS SIGN}q" in (tmp_path / "r.html").read_text(encoding="utf-8")


def test_the_log_of_a_fit_is_within_its_range(differing, result):
    assert not any("validity range" in said for said in validate(result.model, differing).remarks)


def test_asked_for_one_curve_there_is_one(differing, result):
    one: Any = identify(differing, law=LAW, gravity=False, symmetric=True)
    assert one.model.joints[0].law.name == LAW
    assert one.model.joints[0].held_out.rms > 3.0 * result.model.joints[0].held_out.rms
    assert one.model.options["symmetric"] is True


def test_a_tie_goes_to_the_symmetric_law_unless_directions_are_asked_for():
    log = recorded(UP, UP, seed=1)
    assert identify(log, law=LAW, gravity=False).choice().chosen == LAW
    both: Any = identify(log, law=LAW, gravity=False, symmetric=False).model.joints[0].law
    assert both.name == "stribeck-gauss-by-direction+lugre"
    for name in ("coulomb", "viscous"):
        assert getattr(both.rate, name + "_backward") == pytest.approx(getattr(both.rate, name), rel=0.02)


def test_without_presliding_a_constant_torque_is_left_to_the_directions(differing):
    only: Any = {"law": "stribeck-gauss", "gravity": False, "symmetric": False}
    friction: Any = identify(differing, **only).model.joints[0]
    rate = friction.law.rate
    assert "offset" not in friction.dynamics
    assert (rate.coulomb, rate.coulomb_backward) == pytest.approx((4.7, 2.3), rel=0.06)
    kept: Any = identify(differing, **only, bounds={"offset": (-2.0, 2.0)}).model.joints[0]
    assert kept.law.rate.coulomb == kept.law.rate.coulomb_backward == pytest.approx(3.5, rel=0.03)
    assert kept.dynamics["offset"].value == pytest.approx(1.2, rel=0.06)
    assert any("'coulomb_backward' is taken to equal 'coulomb'" in w for w in kept.warnings)


def test_a_law_of_two_directions_can_be_held_symmetric(differing):
    only: Any = {"gravity": False, "symmetric": True}
    rate: Any = identify(differing, law="coulomb-viscous", **only).model.joints[0].law.rate
    assert rate.coulomb_positive == rate.coulomb_negative and rate.viscous_positive == rate.viscous_negative
    with pytest.raises(InvalidInput, match="no symmetric form"):
        identify(differing, law="sigmoid", **only)


def test_a_range_holds_for_both_directions(differing):
    """Sliding friction is 4.7 N.m one way and 2.3 the other, both out of range: each ends at the bound that is nearer to it.

    Backwards that, and a range of its own, holds where break-away is bounded as well: left free, it goes below Coulomb with a wide
    Stribeck curve, and the law follows the low friction within the range of its Coulomb friction.
    """
    asked: Any = {"law": "stribeck-gauss", "symmetric": False, "gravity": False}
    both: Any = identify(differing, bounds={"coulomb": (3.0, 4.0)}, **asked).model.joints[0]
    assert 3.0 <= both.law.rate.coulomb_backward <= both.law.rate.coulomb <= 4.0
    assert both.law.rate.coulomb == pytest.approx(4.0) and "coulomb" in both.at_bound
    assert both.law.rate.breakaway_backward < both.law.rate.coulomb_backward
    held = {"coulomb": (3.0, 4.0), "breakaway": (4.0, 9.0)}
    both = identify(differing, bounds=held, **asked).model.joints[0]
    assert (both.law.rate.coulomb, both.law.rate.coulomb_backward) == pytest.approx((4.0, 3.0))
    assert {"coulomb", "coulomb_backward"} <= set(both.at_bound)
    own = {"coulomb": (3.0, 4.0), "coulomb_backward": (1.0, 9.0), "breakaway_backward": (2.6, 9.0)}
    one: Any = identify(differing, bounds=own, **asked).model.joints[0]
    assert 1.0 < one.law.rate.coulomb_backward < 3.0
    with pytest.raises(InvalidInput, match="'viscosity' is bounded"):
        identify(differing, bounds={"viscosity": (0.0, 1.0)}, **asked)


def test_a_joint_under_its_drive_shows_both_directions_too():
    t = np.arange(0.0, 8.0, 2e-3)
    goal = 0.6 * np.sin(2.0 * t) + 0.2 * np.sin(8.0 * t)
    gains: Any = {"proportional": 60.0, "derivative": 3.0}
    law = Law(rate=CoulombViscous(coulomb_positive=1.2, coulomb_negative=0.7, viscous_positive=0.4))
    axis = Axis(law=law, inertia=0.05, drive=DriveModel(controller="position", **gains))
    log = Log(
        time=t,
        joints=(Joint(name="j"),),
        position=forward(axis, goal, dt=2e-3).position.T,
        drive_input=goal[:, None],
        drive=Drive(law="position", gains=gains),
    )
    asked: Any = {"law": "m1", "gravity": False, "symmetric": False, "delay": False}
    rate: Any = identify(log, **asked).model.joints[0].law.rate
    assert rate.NAME == "m1-by-direction"
    assert (rate.coulomb, rate.coulomb_backward) == pytest.approx((1.2, 0.7), rel=0.02)
    assert rate.viscous == pytest.approx(0.4, rel=0.03)
    assert rate.viscous_backward == pytest.approx(0.0, abs=0.01)
