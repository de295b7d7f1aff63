"""The compensators of the league, with their tuned parameters and ranges."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from backdrive.control.compensators import (
    Compensator,
    Dither,
    alg_fc,
    alg_fc2,
    aung,
    by_law,
    disturbance_observer,
    impulsive,
    lugre_observer,
    mahvash_okamura,
    nothing,
)
from backdrive.control.compensators.extras import BristleObserver, DisturbanceObserver, Pulses
from backdrive.control.estimators.friction import between_counts
from backdrive.laws import GMS, CoulombViscous, Decaying, Law, LuGre
from backdrive.thesis._league_joints import DT, Contender

Numbers = Mapping[str, float]
SHARE = {"share": (0.6, 1.0)}
SPRING = SHARE | {"stiffness": (0.1, 1.5)}  # of the believed stiffness of the transmission
LEAK = SPRING | {"decay": (5.0, 500.0)}
SINE = {"dither": (0.1, 1.0)}


@dataclass(frozen=True, kw_only=True)
class Method:
    """A compensator with numbers to be chosen.

    Attributes:
        name: short.
        words: what it is.
        ranges: of the numbers; those that span a factor of five or more are drawn in the logarithm.
        make: from a joint and numbers to the compensator.
        guides: it is meant for a joint that a hand moves, not for tracking alone.
    """

    name: str
    words: str
    ranges: Mapping[str, tuple[float, float]]
    make: Callable[[Contender, Numbers], Compensator]
    guides: bool = True

    def draw(self, count: int, seed: int) -> list[dict[str, float]]:
        """Return numbers drawn evenly over the ranges (Sobol), the middle of the ranges first."""
        from scipy.stats import qmc

        if not self.ranges:
            return [{}]
        ends = np.array(list(self.ranges.values()))
        u = qmc.Sobol(len(ends), rng=np.random.default_rng(seed)).random_base2(6)[:count]
        u[0] = 0.5
        found = []
        for row in u:
            values = {}
            for name, (low, high), x in zip(self.ranges, ends, row, strict=False):
                values[name] = float(
                    low * (high / low) ** x if high >= 5.0 * low > 0.0 else low + (high - low) * x
                )
            found.append(values)
        return found


def straight(who: Contender, viscous: bool) -> CoulombViscous:
    """Return the believed curve as Coulomb friction by direction, with the slope of a straight line or without."""
    law = Law(rate=who.rate)
    top = 2.0 if who.truth.unit == "rad" else 0.3
    v = np.linspace(0.05, 1.0, 40) * top
    low = law.torque(np.array([1e-3 * top, -1e-3 * top]))
    slope = (
        [float(np.polyfit(v, s * law.torque(s * v), 1)[0]) for s in (1.0, -1.0)] if viscous else [0.0, 0.0]
    )
    return CoulombViscous(
        coulomb_positive=float(low[0]),
        coulomb_negative=float(-low[1]),
        viscous_positive=max(slope[0], 0.0),
        viscous_negative=max(slope[1], 0.0),
    )


def _gms(who: Contender, z: Numbers) -> Compensator:
    K = z["stiffness"] * who.stiffness
    element = GMS(
        stiffness=(0.5 * K, 0.25 * K, 0.15 * K, 0.1 * K),
        share=(0.2, 0.25, 0.25, 0.3),
        attraction=20.0 * who.coulomb,
    )
    return by_law(Law(rate=who.rate, element=element), z["share"])


def _lugre(who: Contender, z: Numbers, adaptation: float) -> Compensator:
    K = z["stiffness"] * who.stiffness
    element = LuGre(
        stiffness=K, damping=z["damping"] * 2.0 * np.sqrt(K * who.truth.motor_inertia), fading=0.02
    )
    observer = BristleObserver(
        adaptation=adaptation / (who.coulomb * 0.02 * who.stroke) if adaptation else 0.0
    )
    return lugre_observer(who.rate, element, observer, z["share"])


def _pulses(who: Contender, z: Numbers) -> Compensator:
    pulses = Pulses(height=z["height"] * who.coulomb, tolerance=5.0 * who.count)
    return impulsive(who.rate, z["stiffness"] * who.stiffness, pulses, z["decay"], z["share"])


def _dob(who: Contender, z: Numbers) -> Compensator:
    law = Law(
        rate=who.rate, element=Decaying(stiffness=z["stiffness"] * who.stiffness, decay_rate=z["decay"])
    )
    observer = DisturbanceObserver(
        inertia=who.truth.inertia,
        bandwidth=z["bandwidth"],
        limit=0.5 * who.coulomb,
        gravity_sin=0.0,
        gravity_cos=0.0,
    )
    return disturbance_observer(law, observer, z["share"])


def _fc2(who: Contender, z: Numbers, dither: Dither | None) -> Compensator:
    return alg_fc2(
        who.rate,
        z["stiffness"] * who.stiffness,
        between_counts(z["threshold"] * who.count / DT, who.count, DT),
        z["decay"],
        z["fast"],
        dither=dither,
        share=z["share"],
    )


METHODS: tuple[Method, ...] = (
    Method(name="NC", words="no compensation", ranges={}, make=lambda who, z: nothing()),
    Method(
        name="MO",
        words="Mahvash-Okamura, Coulomb friction",
        ranges=SPRING,
        make=lambda who, z: mahvash_okamura(straight(who, False), z["stiffness"] * who.stiffness, z["share"]),
    ),
    Method(
        name="MOL",
        words="the same with a straight line",
        ranges=SPRING,
        make=lambda who, z: mahvash_okamura(straight(who, True), z["stiffness"] * who.stiffness, z["share"]),
    ),
    Method(
        name="MOP",
        words="the same with the identified curve (C)",
        ranges=SPRING,
        make=lambda who, z: mahvash_okamura(who.rate, z["stiffness"] * who.stiffness, z["share"]),
    ),
    Method(
        name="CD",
        words="MOP with dither",
        ranges=SPRING | SINE,
        make=lambda who, z: alg_fc(
            who.rate, z["stiffness"] * who.stiffness, 0.0, Dither(share=z["dither"]), z["share"]
        ),
    ),
    Method(
        name="P",
        words="algFC",
        ranges=LEAK,
        make=lambda who, z: alg_fc(who.rate, z["stiffness"] * who.stiffness, z["decay"], None, z["share"]),
    ),
    Method(
        name="PD",
        words="algFC with dither, the thesis' choice",
        ranges=LEAK | SINE,
        make=lambda who, z: alg_fc(
            who.rate, z["stiffness"] * who.stiffness, z["decay"], Dither(share=z["dither"]), z["share"]
        ),
    ),
    Method(
        name="PD reset",
        words="the same, the sine from phase zero",
        ranges=LEAK | SINE,
        make=lambda who, z: alg_fc(
            who.rate,
            z["stiffness"] * who.stiffness,
            z["decay"],
            Dither(share=z["dither"], mode="reset"),
            z["share"],
        ),
    ),
    Method(
        name="algFC2",
        words="decay that goes up in motion, with dither",
        ranges=LEAK | SINE | {"fast": (50.0, 500.0), "threshold": (2.0, 20.0)},
        make=lambda who, z: _fc2(who, z, Dither(share=z["dither"])),
    ),
    Method(
        name="Aung",
        words="dither of a few counts, visco-elastic contact",
        ranges=SPRING | {"damping": (0.02, 2.0)},
        make=lambda who, z: aung(
            who.rate,
            z["stiffness"] * who.stiffness,
            z["damping"] * 2.0 * np.sqrt(z["stiffness"] * who.stiffness * who.truth.motor_inertia),
            who.count,
            z["share"],
        ),
    ),
    Method(
        name="impulsive",
        words="algFC, and pulses where it is stuck off its reference",
        ranges=LEAK | {"height": (0.3, 2.0)},
        make=_pulses,
    ),
    Method(
        name="LuGre",
        words="LuGre observer",
        ranges=SPRING | {"damping": (0.02, 2.0)},
        make=lambda who, z: _lugre(who, z, 0.0),
    ),
    Method(
        name="adaptive",
        words="LuGre observer whose friction is scaled on-line",
        ranges=SPRING | {"damping": (0.02, 2.0), "adaptation": (0.01, 1.0)},
        make=lambda who, z: _lugre(who, z, z["adaptation"]),
    ),
    Method(name="GMS", words="generalised Maxwell slip", ranges=SPRING, make=_gms),
    Method(
        name="DOB",
        words="algFC with a disturbance observer",
        ranges=LEAK | {"bandwidth": (5.0, 100.0)},
        make=_dob,
        guides=False,
    ),
)
