"""Keyword arguments that a function does not have: an error that names the nearest one, at every public door."""

import numpy as np
import pytest

from backdrive import FrictionModel, Log, Sweep, check, compare, identify, simulate, tune
from backdrive.errors import InvalidInput, UnknownName
from backdrive.identification import validate
from backdrive.laws import CoulombViscous, Law
from backdrive.logs.joint import Joint
from backdrive.model import JointFriction, Validity
from backdrive.simulation.machines import machine

T = 0.01 * np.arange(50)
LOG = Log.from_arrays(T, position=np.sin(T), torque=np.cos(T))
PLAN = Sweep(stroke=0.35, top_speed=2.0, cycles=2)
LAW = Law(rate=CoulombViscous(coulomb_positive=3.0, coulomb_negative=3.0))
FRICTION = JointFriction(
    joint=Joint(name="joint_1"), law=LAW, method="motion", validity=Validity(velocity=(-2.0, 2.0))
)
MODEL = FrictionModel(joints=(FRICTION,))


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: identify(LOG, foo=1), r"identify has no argument 'foo'\. It has logs, law, method"),
        (lambda: identify(LOG, metod="motion"), "Did you mean 'method'"),
        (lambda: check(LOG, plans=PLAN), "check has no argument 'plans'. Did you mean 'plan'"),
        (lambda: compare(MODEL, MODEL, rename_=1), "Did you mean 'rename'"),
        (lambda: validate(MODEL, LOG, udrf="x"), "Did you mean 'urdf'"),
        (lambda: tune(MODEL, stifness=1e5), "tune has no argument 'stifness'. Did you mean 'stiffness'"),
        (lambda: simulate(MODEL, PLAN, noise=1), "simulate has no argument 'noise'. Did you mean 'torque_noise'"),
        (lambda: simulate(machine("joint_1"), PLAN, noise=1), "Did you mean 'torque_noise'"),
        (lambda: Log.from_frame({"t": T, "q": T}, unit="deg"), "from_frame has no argument 'unit'. Did you mean 'units'"),
    ],
)  # fmt: skip
def test_an_unknown_keyword_is_answered_with_the_nearest(call, words):
    with pytest.raises(UnknownName, match=words):
        call()


def test_a_simulated_joint_takes_its_own_fields_too():
    quiet = simulate(machine("joint_1"), PLAN, torque_noise=0.0)
    loud = simulate(machine("joint_1"), PLAN, torque_noise=5.0)
    assert not np.array_equal(quiet.torque, loud.torque)


@pytest.mark.parametrize("inertia", [-1, 0.0, float("inf")])
def test_the_inertia_is_checked_before_the_servo_is_made_of_it(inertia):
    with pytest.raises(InvalidInput, match=r"inertia \[kg\.m\^2 or kg\] is"):
        simulate(MODEL, PLAN, inertia=inertia)


@pytest.mark.parametrize("goal", ["back", 3, None])
def test_the_goal_is_checked_before_the_data_of_the_joint(goal):
    with pytest.raises(InvalidInput, match="There is no goal"):
        tune(MODEL, goal=goal)
