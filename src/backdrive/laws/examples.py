"""One worked example of every rate law and element: a joint of a small arm that resists with about 5 N.m.

The pictures of the docs, the contract tests and `backdrive laws` run on these, so that laws can be compared by eye.
"""

from __future__ import annotations

from backdrive.laws import (
    GMS,
    M1,
    M2,
    M3,
    M4,
    M5,
    M6,
    BlimanSorine,
    Coulomb,
    CoulombViscous,
    Dahl,
    DeadZone,
    Decaying,
    Degressive,
    Elastoplastic,
    GearLoad,
    HaywardArmstrong,
    Law,
    Leuven,
    LoadTemperature,
    LuGre,
    Makkar,
    MaxwellSlip,
    Polyline,
    ResetIntegrator,
    Rigid,
    Sigmoid,
    SmoothedGMS,
    StribeckGauss,
    StribeckLorentz,
    StribeckTustin,
    ViscoElastoplastic,
    XiongKikuuwe,
    XiongKikuuweMulti,
)
from backdrive.laws.base import Element, Rate

MANY = {"stiffness": (1.2e4, 5e3, 2e3), "share": (0.5, 0.3, 0.2)}

RATE_EXAMPLES: dict[str, Rate] = {
    r.NAME: r
    for r in (
        Coulomb(coulomb=5.0),
        CoulombViscous(
            coulomb_positive=5.0, coulomb_negative=4.0, viscous_positive=1.0, viscous_negative=2.0
        ),
        StribeckGauss(coulomb=4.0, breakaway=6.0, stribeck_velocity=0.05, viscous=1.0),
        StribeckTustin(coulomb=4.0, breakaway=6.0, stribeck_velocity=0.05, exponent=0.8, viscous=1.0),
        StribeckLorentz(coulomb=4.0, breakaway=6.0, stribeck_velocity=0.05, viscous=1.0),
        Makkar(stribeck=2.0, rise=100.0, fall=20.0, coulomb=4.0, steepness=100.0, viscous=1.0),
        Sigmoid(span=9.0, steepness=30.0, shift=0.005),
        Degressive(coulomb=4.0, growth=1.5, exponent=0.5),
        Polyline(velocity=(0.05, 0.2, 1.0), positive=(5.0, 4.5, 5.5), negative=(4.5, 4.0, 5.5)),
        M1(coulomb=4.0, viscous=1.0),
        M2(coulomb=4.0, viscous=1.0, stribeck=2.0, stribeck_velocity=0.05, exponent=1.5),
        M3(coulomb=4.0, viscous=1.0, load=0.1),
        M4(
            coulomb=4.0,
            viscous=1.0,
            stribeck=2.0,
            stribeck_velocity=0.05,
            exponent=1.5,
            load=0.1,
            load_stribeck=0.05,
        ),
        M5(
            coulomb=4.0,
            viscous=1.0,
            stribeck=2.0,
            stribeck_velocity=0.05,
            exponent=1.5,
            load_motor=0.15,
            load_external=0.05,
            load_stribeck_motor=0.06,
            load_stribeck_external=0.02,
        ),
        M6(
            coulomb=4.0,
            viscous=1.0,
            stribeck=2.0,
            stribeck_velocity=0.05,
            exponent=1.5,
            load_motor=0.15,
            load_external=0.05,
            load_stribeck_motor=0.06,
            load_stribeck_external=0.02,
            quadratic_external=0.004,
            quadratic_motor=0.008,
        ),
        LoadTemperature(
            coulomb=3.0,
            coulomb_load=0.05,
            stribeck_load=0.1,
            stribeck_velocity_load=0.1,
            stribeck=1.0,
            stribeck_temperature=0.05,
            stribeck_velocity=0.02,
            stribeck_velocity_temperature=0.001,
            viscous=0.5,
            viscous_temperature=3.0,
            thinning=20.0,
            exponent=1.3,
        ),
        GearLoad(coulomb=3.0, load=0.15, driving=0.1, driven=0.2, stribeck_velocity=0.05, viscous=1.0),
    )
}

ELEMENT_EXAMPLES: dict[str, Element] = {
    e.NAME: e
    for e in (
        Rigid(),
        DeadZone(threshold=0.01),
        Dahl(stiffness=1e4),
        BlimanSorine(distance=1e-3, ratio=0.3, overshoot=0.5),
        ResetIntegrator(stiffness=1e4, excess=0.2, damping=5.0),
        LuGre(stiffness=1e4, damping=20.0, fading=0.05),
        Elastoplastic(stiffness=1e4, damping=20.0, fading=0.05, elastic=0.7),
        HaywardArmstrong(stiffness=1e4),
        ViscoElastoplastic(stiffness=1e4, damping=20.0),
        XiongKikuuwe(stiffness=1e4, damping=20.0, lag=0.003),
        XiongKikuuweMulti(**MANY, damping_time=0.002, lag=0.003),
        Decaying(stiffness=1e4, decay_rate=20.0),
        MaxwellSlip(**MANY),
        Leuven(**MANY, sharpness=2.0, damping=5.0),
        GMS(**MANY, attraction=100.0),
        SmoothedGMS(stiffness=MANY["stiffness"], share=MANY["share"]),
    )
}


def example(name: str) -> Law:
    """Return the example of a law: a rate law by itself, an element under Gauss' Stribeck curve, or `rate+element`."""
    from backdrive._catalog import lookup

    rate, plus, carrier = name.partition("+")
    if plus:
        return Law(
            rate=lookup(rate, RATE_EXAMPLES, "rate law"),
            element=lookup(carrier, ELEMENT_EXAMPLES, "presliding element"),
        )
    known = RATE_EXAMPLES | ELEMENT_EXAMPLES
    found = lookup(name, known, "friction law")
    return (
        Law(rate=found)
        if isinstance(found, Rate)
        else Law(rate=RATE_EXAMPLES["stribeck-gauss"], element=found)
    )
