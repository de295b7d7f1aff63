"""Simulated joints for judging a tuning: the likely one, those at the ends of the intervals, and random ones between."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from backdrive.laws import Law, ViscoElastoplastic
from backdrive.simulation.joint import JointSimulation
from backdrive.tuning.facts import Facts, curve_of


@dataclass(frozen=True, kw_only=True)
class Member:
    """One joint within the model's uncertainty.

    Attributes:
        friction: factor on it [-].
        stiffness: K_c, of transmission and contact in series [N.m/rad or N/m].
        contact: stiffness of the contact by that of the transmission [-].
        inertia: of both sides [kg.m^2 or kg].
        motor_share: of it, on the motor's side [-].
        damping: ratio of transmission and contact [-].
        delay: beyond the hold [s].
        temperature: [degC].
        seed: of the encoder's phase and noise.
    """

    friction: float
    stiffness: float
    contact: float
    inertia: float
    motor_share: float
    damping: float
    delay: float
    temperature: float
    seed: int = 0

    def plant(self, facts: Facts) -> JointSimulation:
        """Return it as a simulated joint."""
        motor = self.motor_share * self.inertia
        load = self.inertia - motor
        rate = curve_of(
            Law(rate=facts.rate), facts.top_speed, factor=self.friction, temperature=self.temperature
        )
        rest = self.bristle
        element = ViscoElastoplastic(stiffness=rest, damping=2.0 * self.damping * float(np.sqrt(rest * load)))
        return JointSimulation(
            name=facts.name,
            unit=facts.unit,  # type: ignore[arg-type]
            law=Law(rate=rate, element=element),
            motor_inertia=motor,
            load_inertia=load,
            stiffness=self.transmission,
            damping=2.0 * self.damping * float(np.sqrt(self.transmission * motor)),
            friction_side="load",
            encoder_count=facts.count,
            delay=self.delay,
        )

    @property
    def transmission(self) -> float:
        """Stiffness of the transmission alone [N.m/rad or N/m]."""
        return self.stiffness * (1.0 + 1.0 / self.contact)

    @property
    def bristle(self) -> float:
        """Stiffness of the friction's contact [N.m/rad or N/m]."""
        return self.stiffness * (1.0 + self.contact)


def nominal(facts: Facts) -> Member:
    """Return the likely joint."""
    return Member(
        friction=1.0,
        stiffness=facts.stiffness,
        contact=float(np.sqrt(facts.contact[0] * facts.contact[1])),
        inertia=facts.inertia,
        motor_share=facts.motor_share,
        damping=float(np.sqrt(facts.damping[0] * facts.damping[1])),
        delay=facts.delay,
        temperature=0.5 * sum(facts.temperature),
    )


def corners(facts: Facts) -> list[Member]:
    """Return the joints at the ends of the intervals of K_c and friction, and the likely one between them."""
    middle = nominal(facts)
    found = [middle]
    for i, K in enumerate(facts.stiffness_interval):
        for j, F in enumerate(facts.friction):
            end = {
                "friction": F,
                "stiffness": K,
                "inertia": facts.inertia_interval[(i + j) % 2],
                "damping": facts.damping[0],
                "temperature": facts.temperature[j],
                "contact": facts.contact[(i + j) % 2],
                "delay": facts.delay if i == j else 0.0,
            }
            found.append(replace(middle, **end, seed=1 + 2 * i + j))
    return found


def sample(facts: Facts, count: int, seed: int) -> list[Member]:
    """Return joints drawn evenly over all intervals at once (Sobol)."""
    from scipy.stats import qmc

    sampler = qmc.Sobol(8, rng=np.random.default_rng(seed))
    u = sampler.random_base2(max(1, int(np.ceil(np.log2(max(count, 2))))))[:count]

    def within(ends: Sequence[float], x: float) -> float:
        return float(ends[0] + (ends[1] - ends[0]) * x)

    share = facts.motor_share
    return [
        Member(
            friction=within(facts.friction, r[0]),
            stiffness=within(facts.stiffness_interval, r[1]),
            inertia=within(facts.inertia_interval, r[2]),
            motor_share=within((share / 1.5, min(1.5 * share, 0.95)), r[3]),
            damping=float(facts.damping[0] * (facts.damping[1] / facts.damping[0]) ** r[4]),
            delay=facts.delay * float(r[5]),
            temperature=within(facts.temperature, r[6]),
            contact=float(facts.contact[0] * (facts.contact[1] / facts.contact[0]) ** r[7]),
            seed=seed + i,
        )
        for i, r in enumerate(u)
    ]
