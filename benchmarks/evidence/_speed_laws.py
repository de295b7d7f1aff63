"""Laws of `speed`, ours and as the C loops read them: rows composed from the parameters, not from the package's rows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from backdrive.laws import GMS, Decaying, Law, LuGre, MaxwellSlip, Polyline, StribeckGauss
from backdrive.laws.examples import example

KNOTS = 10
CURVE = StribeckGauss(coulomb=4.0, breakaway=6.0, stribeck_velocity=0.05, viscous=1.0)
LINES = Polyline(
    velocity=tuple(np.linspace(0.02, 1.0, KNOTS).tolist()),
    positive=tuple((5.0 + np.cos(np.arange(KNOTS))).tolist()),
    negative=tuple((4.5 + np.sin(np.arange(KNOTS))).tolist()),
)


@dataclass(frozen=True)
class Case:
    """A law and its loop in C.

    Attributes:
        name: as printed.
        law: ours.
        loop: name of the C function.
        row: what it reads, (P,).
    """

    name: str
    law: Law
    loop: str
    row: np.ndarray


def parallel(count: int) -> dict[str, tuple[float, ...]]:
    """Return stiffnesses and shares of elements side by side."""
    return {"stiffness": tuple(1.2e4 / k for k in range(1, count + 1)), "share": (1.0 / count,) * count}


def gauss(law: Law, *element: float) -> np.ndarray:
    """Return the row of a Stribeck curve and of an element on it as the C loops read it."""
    r = law.rate.values()
    return np.array([0.0, r["coulomb"], r["breakaway"], r["stribeck_velocity"], 2.0, r["viscous"], *element])


def lines(rate: Polyline) -> np.ndarray:
    """Return the row of line sections: N, knots, and by direction intercept, torques and slopes."""
    V, row = np.array(rate.velocity), [float(len(rate.velocity)), *rate.velocity]
    for F in (np.array(rate.positive), np.array(rate.negative)):
        slopes = np.diff(F) / np.diff(V)
        row += [float(F[0] - slopes[0] * V[0]), *F.tolist(), *slopes.tolist()]
    return np.array(row)


def cases() -> list[Case]:
    """Return the laws whose single rollouts are compared."""
    coulomb, m6 = example("coulomb-viscous"), example("m6")
    c, m = coulomb.rate.values(), m6.rate.values()
    made = [
        Case("Coulomb", coulomb, "coulomb-viscous", np.array([0.0, *c.values()])),
        Case("Stribeck", Law(rate=CURVE), "stribeck-gauss", gauss(Law(rate=CURVE))),
        Case("polyline-10", Law(rate=LINES), "polyline", lines(LINES)),
    ]
    bristle = Law(rate=CURVE, element=LuGre(stiffness=1e4, damping=20.0, fading=0.05))
    made.append(Case("LuGre", bristle, "lugre", gauss(bristle, 1e4, 20.0, 0.05)))
    for count in (4, 10):
        many = parallel(count)
        law = Law(rate=CURVE, element=GMS(**many, attraction=100.0))
        made.append(
            Case(f"GMS-{count}", law, "gms", gauss(law, count, *many["stiffness"], *many["share"], 100.0))
        )
    slip = Law(rate=CURVE, element=MaxwellSlip(**many))
    made.append(Case("Maxwell-10", slip, "maxwell-slip", gauss(slip, 10, *many["stiffness"], *many["share"])))
    leak = Law(rate=LINES, element=Decaying(stiffness=1e4, decay_rate=20.0))
    made.append(
        Case("decaying+polyline", leak, "decaying-polyline", np.array([1e4, 20.0, *lines(LINES).tolist()]))
    )
    names = ("coulomb", "stribeck", "stribeck_velocity", "exponent", "viscous", "load_motor", "load_external")
    names += ("load_stribeck_motor", "load_stribeck_external", "quadratic_external", "quadratic_motor")
    made.append(Case("M6", m6, "m6", np.array([0.0, *(m[n] for n in names)])))
    return made
