"""What `tune` makes of friction that grows with the load: an interval wide enough for it, and a sentence."""

from dataclasses import replace

import pytest

from backdrive.errors import NotIdentifiable
from backdrive.laws import CoulombViscous, Growth, HaywardArmstrong, Law
from backdrive.logs.log import Joint
from backdrive.model import Estimate, JointFriction, Validity
from backdrive.tuning import facts_of

RATE = CoulombViscous(
    coulomb_positive=10.0, coulomb_negative=10.0, viscous_positive=3.0, viscous_negative=3.0
)


def known(growth=None, **terms):
    units = {"inertia": "kg.m^2", "gravity_sin": "N.m", "gravity_cos": "N.m"}
    return JointFriction(
        joint=Joint(name="j0", encoder_counts=1e6),
        law=Law(rate=RATE, element=HaywardArmstrong(stiffness=1e5), growth=growth),
        validity=Validity(velocity=(-1.0, 1.0)),
        dynamics={
            k: Estimate(value=v, unit=units.get(k, "1"), standard_error=0.0)
            for k, v in ({"inertia": 0.7} | terms).items()
        },
    )


def even(mu, carried):
    return Growth(load_driving=mu, load_driven=mu, load_carried=carried)


def test_the_interval_takes_in_what_the_load_does():
    facts = facts_of(known(even(0.05, 20.0), gravity_sin=0.0, gravity_cos=30.0))
    assert facts.friction == pytest.approx((0.9 - 0.1, 1.1 + 0.05))
    assert any("10 % below the curve, under 30 N.m 5 % above it" in note for note in facts.notes)
    bare = facts_of(known(Growth(load_driving=0.06, load_driven=0.04), gravity_sin=0.0, gravity_cos=30.0))
    assert bare.friction == pytest.approx((0.9, 1.1 + 0.15))
    assert facts_of(known()).friction == pytest.approx((0.9, 1.1))


def test_a_curve_that_is_mostly_load_is_refused():
    friction = known(even(0.4, 20.0), gravity_sin=0.0, gravity_cos=30.0)
    with pytest.raises(NotIdentifiable, match="less than a fifth"):
        facts_of(friction)
    assert facts_of(replace(friction, law=known().law)).friction[0] == pytest.approx(0.9)
