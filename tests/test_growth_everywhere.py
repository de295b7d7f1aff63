"""Friction that grows with the load, from logs to everything that runs a model: one law has it, and so have all."""

from dataclasses import replace

import numpy as np
import pytest

from backdrive.control.compensators.catalog import alg_fc, by_law
from backdrive.control.estimators.adaptive import AdaptiveFriction
from backdrive.control.estimators.external import ExternalForce
from backdrive.control.estimators.friction import FrictionEstimator
from backdrive.control.joint_loop import JointLoop
from backdrive.control.loop import Loop
from backdrive.engine import Axis, forward, rollout
from backdrive.identification import identify
from backdrive.identification.dynamics import predict
from backdrive.identification.signals import prepare
from backdrive.identification.validate import validate
from backdrive.laws import CoulombViscous, Decaying, Growth, HaywardArmstrong, Law, Polyline
from backdrive.model import load_model
from backdrive.plans import Sweep
from backdrive.simulation.machines import joint_1
from backdrive.simulation.open_loop import simulate

MU = 0.05
RATE = CoulombViscous(
    coulomb_positive=10.0, coulomb_negative=10.0, viscous_positive=3.0, viscous_negative=3.0
)
LAW = Law(
    rate=RATE,
    element=Decaying(stiffness=2e4, decay_rate=20.0),
    growth=Growth(load_driving=0.2, load_driven=0.1, load_carried=10.0),
)


@pytest.fixture(scope="module")
def plant():
    """The thesis' joint 1, whose friction grows by 5 % of the load that it carries."""
    joint = joint_1()
    return joint.replace(law=replace(joint.law, growth=Growth(load_driving=MU, load_driven=MU)))


def swept(plant, center, seed):
    plan = Sweep(np.deg2rad(20), 2.0, 8, center=np.deg2rad(center))
    return simulate(plant.replace(torque_noise=0.1), plan, seed=seed)


@pytest.fixture(scope="module")
def model(plant):
    return identify([swept(plant, center, k) for k, center in enumerate((-60, 0, 60))]).model


@pytest.mark.parametrize("load", [0.0, 15.0, 45.0, -30.0])
def test_a_model_identified_under_some_loads_knows_friction_under_others(plant, model, load, tmp_path):
    v = np.array([0.5, 1.0, 1.8, -0.5, -1.0, -1.8])
    # by hand: the curve of the joint without load, and 5 % of what it carries
    truth = joint_1().law.torque(v) + np.sign(v) * MU * abs(load)
    model.save(tmp_path / "m.json")
    for one in (model, load_model(tmp_path / "m.json")):
        assert one.torque("joint_1", v, load=load) == pytest.approx(truth, abs=0.15)
        pair = np.tile([load, -load], (v.size, 1))
        along = rollout(one, dq=v, dt=1e-3, load=pair)
        assert along == pytest.approx(one.torque("joint_1", v, load=load))
    carried = model.joint("joint_1").law.growth.load_carried
    assert carried > 10.0
    assert model.torque("joint_1", v) == pytest.approx(model.torque("joint_1", v, load=carried))


@pytest.mark.parametrize("load", [15.0, -45.0])
def test_a_compensator_and_an_estimator_of_that_model_have_it(model, load):
    law = model.joint("joint_1").law
    compensator = alg_fc(law, 5e4, share=0.8)
    T, v = 1e-3, 0.8
    loop = Loop(
        JointLoop(
            compensator=compensator,
            external=ExternalForce(inertia=1.0, friction=FrictionEstimator(law=compensator.friction.law)),
            limit=14.0, top_speed=3.0, encoder_count=1e-6, ramp=0.15,
        ),
        interval=T,
    )  # fmt: skip
    for way in (1.0, -1.0):
        for given in ("load", "known", None):
            loop.reset(np.zeros(1))
            loop.known[:] = load if given == "known" else 0.0
            if given == "load":
                loop.load = (load, -load)
            for k in range(600):
                loop.update(np.array([way * v * T * k]), np.zeros(1))
            wanted = model.torque("joint_1", way * v, load=None if given is None else load)
            assert loop.causes[0] == 0, (way, given, k)
            assert loop.friction[0] == pytest.approx(wanted, rel=2e-2)
            assert loop.torque[0] == pytest.approx(0.8 * wanted, rel=2e-2)


def test_what_the_model_predicts_is_what_a_log_of_another_posture_holds(plant, model):
    log = swept(plant, 30, 9)
    without = replace(model.joint("joint_1"), law=replace(model.joint("joint_1").law, growth=None))
    off = {}
    for name, friction in (("with", model.joint("joint_1")), ("without", without)):
        s = prepare(log, 0)[0]
        slides = np.abs(s.velocity) > 0.2
        error = (s.torque - predict(friction, s)) * np.sign(s.velocity)
        off[name] = abs(float(np.mean(error[slides])))
    assert off["with"] < 0.1 < 0.2 < off["without"]
    bare = replace(model, joints=(without,))
    name = "joint_1"
    assert validate(model, [log])[name].residual < validate(bare, [log])[name].residual


def test_the_log_tells_the_load_where_the_model_does_not():
    s = prepare(simulate(joint_1(), Sweep(0.3, 1.0, 3), seed=1), 0)[0]
    n = s.velocity.size
    law = replace(LAW, element=HaywardArmstrong(stiffness=1e6))
    friction = replace(joint_friction(law), dynamics={})
    with_load = replace(s, load=np.tile([0.0, -40.0], (n, 1)))
    grown = predict(friction, with_load) - predict(
        replace(friction, law=replace(law, growth=None)), with_load
    )
    slides = np.abs(s.velocity) > 0.3
    expected = np.where(s.velocity > 0.0, 0.2, -0.1) * 30.0
    assert np.abs(grown - expected)[slides].max() < 1e-6
    assert np.array_equal(predict(friction, s), predict(replace(friction, law=replace(law, growth=None)), s))


def joint_friction(law):
    from backdrive.logs.log import Joint
    from backdrive.model import JointFriction, Validity

    return JointFriction(
        joint=Joint(name="j", encoder_counts=1e6), law=law, validity=Validity(velocity=(-2.0, 2.0))
    )


def test_an_external_force_along_a_log_is_not_taken_for_growth():
    """A joint lifts l at 0.5 rad/s without anybody's hand: 10 + 1.5 + 0.2 (l - 10) N.m of friction."""
    T, n = 1e-3, 2000
    q = 0.5 * T * np.arange(n)
    for known, gravity in ((np.full(n, 30.0), 0.0), (None, 30.0)):
        carried = 30.0 if known is not None else 30.0 * np.cos(q)
        wanted = np.broadcast_to(11.5 + 0.2 * (carried - 10.0), n)
        estimator = ExternalForce(
            inertia=1.0,
            friction=FrictionEstimator(law=LAW),
            method="momentum",
            bandwidth=50.0,
            gravity_cos=gravity,
        )
        force, friction = estimator.run(q, carried + wanted, T, known)
        assert friction[-1] == pytest.approx(wanted[-1], rel=1e-2)
        assert force[-1] == pytest.approx(0.0, abs=0.2)
    torque = np.full(n, 45.5)
    _, friction = ExternalForce(inertia=1.0, friction=FrictionEstimator(law=LAW)).run(q, torque, T)
    assert friction[-1] == pytest.approx(11.5, rel=1e-2)  # nobody says what it carries: as identified


def test_an_adapted_level_multiplies_the_growth_too():
    adaptive = AdaptiveFriction(LAW, interval=1e-3, floor=1.0)
    bare = AdaptiveFriction(replace(LAW, growth=None), interval=1e-3, floor=1.0)
    for k in range(300):
        adaptive.load[:] = (0.0, -30.0)
        for one in (adaptive, bare):
            one.tick(np.array([5e-4 * k]), np.array([np.nan]))
            one.tick(np.array([5e-4 * k]), np.array([15.5 if one is adaptive else 11.5]))
    assert adaptive.torque[0] - bare.torque[0] == pytest.approx(4.0, rel=0.05)


def test_a_compensator_by_any_law_takes_its_growth():
    assert alg_fc(LAW, 1e4).friction.law.growth == by_law(LAW).friction.law.growth == LAW.growth
    assert alg_fc(LAW, 1e4).friction.law.rate == alg_fc(RATE, 1e4).friction.law.rate == RATE
    assert alg_fc(RATE, 1e4).friction.law.growth is None


def test_what_is_tuned_takes_its_share_of_the_growth():
    from backdrive.tuning import facts_of

    growth = Growth(load_driving=0.1, load_driven=0.02)
    friction = joint_friction(Law(rate=RATE, element=HaywardArmstrong(stiffness=1e5), growth=growth))
    assert facts_of(friction, inertia=0.7).growth == growth
    polyline = Polyline(velocity=(0.1, 1.0), positive=(1.0, 2.0), negative=(1.0, 2.0))
    assert growth.scale(0.5) == Growth(load_driving=0.05, load_driven=0.01)
    assert Law(rate=polyline, growth=growth.scale(0.5)).torque(0.1, load=20.0) == pytest.approx(2.0)


def test_the_plant_itself_moves_by_the_growth(plant):
    axis = Axis(law=LAW, inertia=1.0, gravity_cos=40.0)
    heavy = forward(axis, np.full(300, 40.0 + 10.0 + 0.5 * 6.0), dt=1e-3).velocity[0, -1]
    light = forward(axis.replace(law=replace(LAW, growth=None)), np.full(300, 53.0), dt=1e-3).velocity[0, -1]
    assert abs(heavy) < 0.05 < light
