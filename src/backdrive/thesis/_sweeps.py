"""Sweeps of the thesis' joints, and the curves that are identified from them: chapter 2, sections 2.3 and 2.4.

Every sweep is the printed trajectory (2.2) up to 2 rad/s in 10 cycles, at 1 kHz, followed by the joint's own servo. Curves are
identified twice: `literal`, as (2.7) prints it, and `aligned`, with torque and velocity at the same instant, and without the
effects of inertia and gravity in a window (`identification.function_a`).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from backdrive.errors import NotIdentifiable
from backdrive.identification.metrics import curve_distance, relative_curve_distance
from backdrive.identification.sweep import SweepKnots, sweep_knots, to_polyline
from backdrive.laws import Law
from backdrive.logs.log import Log
from backdrive.plans import Sweep
from backdrive.simulation import JointSimulation
from backdrive.simulation.open_loop import simulate
from backdrive.thesis.outcome import Claim
from backdrive.thesis.setups import RATIO, arm

TOP_SPEED, CYCLES = 2.0, 10  # V [rad/s], N; 2.4.2
STROKES = (5.0, 10.0, 20.0, 30.0, 50.0)  # A [deg]
REFERENCE_STROKE = 50.0  # reference stroke of the comparison [deg]
RATE = 1000.0  # of controller and log [Hz]
METHODS = ("literal", "aligned")

#: Posture -> inertia [kg.m^2], M L g [N.m], angle of the center of mass above the horizontal [deg]. Assumed: from folded to
#: stretched upwards, with inertia smallest in (i) and largest in (v), gravity largest in (ii) and smallest in (v), as the
#: caption of Fig. 2.9 says.
POSTURES = {
    "(i)": (1.0, 30.0, 0.0),
    "(ii)": (1.2, 34.0, 0.0),
    "(iii)": (1.4, 36.0, 55.0),
    "(iv)": (1.6, 38.0, 63.0),
    "(v)": (1.9, 42.0, 80.0),
}
TABLE_2_2 = {"(ii)": 1.28, "(iii)": 2.82, "(iv)": 3.09, "(v)": 3.95}  # printed [%]
LOADS = (0.0, 0.01, 0.03)  # growth of Coulomb friction with the transmitted torque [-]

SETTING = (
    "Simulated compliant joints of the arm, with friction on the load's side. The printed trajectory (2.2) with V = 2 rad/s and "
    "N = 10, a PID of 60 rad/s at 1 kHz, and an encoder of 65 536 counts a motor turn. Joint 1 has actuator noise of 0.1 N.m."
)


@dataclass(frozen=True, kw_only=True, eq=False)
class SweepRun:
    """One sweep of one joint and what was identified from it.

    Attributes:
        joint: that was swept.
        stroke: A [deg].
        log: of the sweep.
        knots: the pairs by method.
        curves: the curve by method; a method without all cycles is left out.
    """

    joint: JointSimulation
    stroke: float
    log: Log
    knots: dict[str, SweepKnots]
    curves: dict[str, Law]

    @property
    def position(self) -> np.ndarray:
        """Encoder reading [rad], (n,)."""
        q = self.log.position
        return np.zeros(0) if q is None else q[:, 0]

    @property
    def torque(self) -> np.ndarray:
        """Commanded torque [N.m], (n,)."""
        return self.log.driving_torque[:, 0]

    @property
    def peak_torque(self) -> float:
        """Largest torque that the servo asked for [N.m]."""
        return float(np.abs(self.torque).max())


def plan(stroke: float, center: float = 0.0, cycles: int = CYCLES) -> Sweep:
    """Return the printed trajectory.

    Args:
        stroke: A [deg].
        center: of the stroke [deg].
        cycles: N.
    """
    return Sweep(np.deg2rad(stroke), TOP_SPEED, cycles, center=np.deg2rad(center), smooth=False)


def sweep(joint: JointSimulation, stroke: float, *, seed: int, center: float = 0.0) -> SweepRun:
    """Sweep a joint and identify its friction, both ways.

    Args:
        joint: to be swept.
        stroke: A [deg].
        seed: of the actuator's noise.
        center: of the stroke [deg].
    """
    log = simulate(joint, plan(stroke, center), seed=seed, rate=RATE)
    knots: dict[str, SweepKnots] = {}
    for method in METHODS:
        try:
            knots[method] = sweep_knots(log, 0, literal=method == "literal")
        except NotIdentifiable:
            continue
    curves = {m: Law(rate=to_polyline(k)) for m, k in knots.items() if k.V.size == CYCLES}
    return SweepRun(joint=joint, stroke=stroke, log=log, knots=knots, curves=curves)


def identify_curve(joint: JointSimulation, *, seed: int) -> Law:
    """Return the curve for a compensator: aligned, from a stroke of 20 degrees."""
    return sweep(joint, 20.0, seed=seed).curves["aligned"]


def by_stroke(
    seed: int, joints: Iterable[JointSimulation] | None = None, strokes: Iterable[float] = STROKES
) -> dict[str, dict[float, SweepRun]]:
    """Return sweeps by joint and stroke [deg]; Joints 0 to 5 by default."""
    chosen = arm() if joints is None else joints
    return {
        joint.name: {stroke: sweep(joint, stroke, seed=1000 * seed + int(stroke)) for stroke in strokes}
        for joint in chosen
    }


def distances(runs: dict[float, SweepRun], method: str) -> dict[float, float]:
    """Return E(A, 50 deg) of (2.16) by stroke [N.m]; NaN where a curve was not obtained."""
    last = runs[REFERENCE_STROKE].curves.get(method)
    found = {}
    for stroke, run in runs.items():
        law = run.curves.get(method)
        if law is None or last is None:
            found[stroke] = float("nan")
        else:
            found[stroke] = curve_distance(law, last, TOP_SPEED)
    return found


def in_posture(
    posture: str, load_dependence: float = 0.0, ratio: float = RATIO
) -> tuple[JointSimulation, float]:
    """Return Joint 1 in a posture, and the center of its stroke [deg]."""
    inertia, weight, angle = POSTURES[posture]
    joint = arm(ratio)[1]
    return (
        joint.replace(
            load_inertia=inertia - joint.motor_inertia, gravity_cos=weight, load_dependence=load_dependence
        ),
        angle,
    )


def by_posture(seed: int, load_dependence: float = 0.0, ratio: float = RATIO) -> dict[str, SweepRun]:
    """Return sweeps of Joint 1 over 20 degrees in the five postures."""
    found = {}
    for i, name in enumerate(POSTURES):
        joint, center = in_posture(name, load_dependence, ratio)
        found[name] = sweep(joint, 20.0, seed=1000 * seed + i, center=center)
    return found


def posture_errors(runs: dict[str, SweepRun], method: str) -> dict[str, float]:
    """Return E_p(P, (i)) of (2.17) by posture [%]."""
    first = runs["(i)"].curves[method]
    return {
        name: 100.0 * relative_curve_distance(runs[name].curves[method], first, TOP_SPEED)
        for name in TABLE_2_2
    }


def truth_check(runs: Iterable[SweepRun]) -> Claim:
    """Return the claim that aligned curves for strokes from 10 deg on agree with the true ones, up to 1.8 rad/s.

    Args:
        runs: sweeps.
    """
    v = np.linspace(0.2, 1.8, 200)
    errors = []
    for run in runs:
        if run.stroke >= 10.0:
            true = run.joint.law.torque(v)
            errors.append(
                float(np.sqrt(np.mean((run.curves["aligned"].torque(v) - true) ** 2) / np.mean(true**2)))
            )
    return Claim(
        what="The aligned curves agree with the true ones",
        ours=f"at most {100 * max(errors):.2f} % RMS off, {len(errors)} sweeps",
        gate="at most 1.5 %",
        holds=max(errors) <= 0.015,
    )


def number_list(values: Iterable[float], form: str = ".3g") -> str:
    """Return numbers as a list in words: `1.2, 0.3, 0.1`."""
    return ", ".join(format(v, form) for v in values)
