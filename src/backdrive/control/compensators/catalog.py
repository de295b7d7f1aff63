"""The compensators by name: those of the thesis, those that it compares with, and further ones."""

from __future__ import annotations

from backdrive.control.compensators.compensator import SHARE, Compensator
from backdrive.control.compensators.dither import Dither
from backdrive.control.compensators.extras import BristleObserver, DisturbanceObserver, Pulses
from backdrive.control.estimators.friction import FrictionEstimator, alg_fe, alg_fe2
from backdrive.laws import Decaying, HaywardArmstrong, Law, LuGre, ViscoElastoplastic, with_element
from backdrive.laws.base import Rate


def nothing() -> Compensator:
    """Return no compensation (NC)."""
    return Compensator()


def mahvash_okamura(
    rate: Rate | Law, stiffness: float, share: float = SHARE, *, literal: bool = False
) -> Compensator:
    """Return Mahvash and Okamura's compensator with a rate law: Iwatani 2017, (2.22).

    The thesis calls it MO with Coulomb friction alone, (2.24), MOL with linear viscosity, (2.25), and MOP with an identified
    curve. The viscous part uses the encoder's velocity, as in (2.22b), while that of algFC, (3.27j), uses the slider's. If the
    curve rises, the default and the printed form both equal (2.22). If it falls, the printed form adds phi_0 < 0 to a contact
    that is not yet stretched, and so resists the start of a motion. By default the fall narrows the contact's bounds instead.
    This gives the same torque in sliding, and the estimated friction is passive.

    Args:
        rate: rate law, or the law whose rate law and growth with the load are taken.
        stiffness: K [N.m/rad or N/m].
        share: R [-].
        literal: use the printed form even if the curve falls.
    """
    element = (
        HaywardArmstrong(stiffness=stiffness)
        if literal
        else ViscoElastoplastic(stiffness=stiffness, damping=0.0)
    )
    friction = FrictionEstimator(law=with_element(rate, element), literal=literal)
    return Compensator(friction=friction, share=share)


def alg_fc(
    rate: Rate | Law,
    stiffness: float,
    decay_rate: float = 20.0,
    dither: Dither | None = None,
    share: float = SHARE,
) -> Compensator:
    """Return algFC, Iwatani 2017, (3.27): its variants C and CD if `decay_rate` is 0, otherwise P and PD.

    Args:
        rate: rate law, or the law whose rate law and growth with the load are taken.
        stiffness: K [N.m/rad or N/m].
        decay_rate: alpha [1/s].
        dither: for CD and PD.
        share: R of the friction, not of the dither [-].
    """
    return Compensator(friction=alg_fe(rate, stiffness, decay_rate), share=share, dither=dither)


def alg_fc2(
    rate: Rate | Law,
    stiffness: float,
    threshold: float,
    decay_rate: float = 20.0,
    fast_decay: float = 500.0,
    switch_rate: float = 10.0,
    dither: Dither | None = None,
    share: float = SHARE,
) -> Compensator:
    """Return algFC2, Iwatani 2017, (3.28) corrected: the decay rate goes up in motion.

    Args:
        rate: rate law, or the law whose rate law and growth with the load are taken.
        stiffness: K [N.m/rad or N/m].
        threshold: V_W, put between two counts [rad/s or m/s].
        decay_rate: alpha_N [1/s].
        fast_decay: alpha_H [1/s].
        switch_rate: r_W [1/s].
        dither: at rest.
        share: R [-].
    """
    estimator = alg_fe2(rate, stiffness, threshold, decay_rate, fast_decay, switch_rate)
    return Compensator(friction=estimator, share=share, dither=dither)


def aung(
    rate: Rate | Law,
    stiffness: float,
    damping: float,
    count: float,
    share: float = SHARE,
    frequency: float = 15.0,
) -> Compensator:
    """Return a compensator of three parts after Aung, Kikuuwe and Yamamoto (ASME JDSMC 137(5), 2015).

    At rest a dither of a few counts acts, in motion the rate law, and in between a visco-elastic contact.

    Args:
        rate: rate law, or the law whose rate law and growth with the load are taken.
        stiffness: K [N.m/rad or N/m].
        damping: B [N.m.s/rad or N.s/m].
        count: of the encoder [rad or m].
        share: R [-].
        frequency: of the dither [Hz].
    """
    law = with_element(rate, ViscoElastoplastic(stiffness=stiffness, damping=damping))
    dither = Dither(share=0.9, frequency=frequency, mode="adaptive", count=count, window=1.05 / frequency)
    return Compensator(friction=FrictionEstimator(law=law), share=share, dither=dither)


def impulsive(
    rate: Rate | Law, stiffness: float, pulses: Pulses, decay_rate: float = 20.0, share: float = SHARE
) -> Compensator:
    """Return algFC with pulses where the joint is stuck off its reference."""
    law = with_element(rate, Decaying(stiffness=stiffness, decay_rate=decay_rate))
    return Compensator(friction=FrictionEstimator(law=law), share=share, extra=pulses)


def lugre_observer(
    rate: Rate | Law, element: LuGre, observer: BristleObserver | None = None, share: float = SHARE
) -> Compensator:
    """Return the LuGre observer of Canudas de Wit and Lischinsky (1997), adaptive where its `adaptation` is not 0."""
    law = with_element(rate, element)
    return Compensator(friction=FrictionEstimator(law=law), share=share, extra=observer or BristleObserver())


def disturbance_observer(law: Law, observer: DisturbanceObserver, share: float = SHARE) -> Compensator:
    """Return a model with a disturbance observer for its error."""
    return Compensator(friction=FrictionEstimator(law=law), share=share, extra=observer)


def by_law(law: Law, share: float = SHARE, dither: Dither | None = None) -> Compensator:
    """Return a compensator by any law, GMS or LuGre for example."""
    return Compensator(friction=FrictionEstimator(law=law), share=share, dither=dither)
