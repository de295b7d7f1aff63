"""External force estimated where there is none: the EMPS axis and a UR3 that nothing touches, by friction model.

What an estimator of external force says in free motion is its error, and most of that is friction that the model does not know.
Each row is the root mean square of the estimate on a log (or half of one) that the model was not fitted to, in % of the RMS of the
friction itself, so that 100 % is about what an estimator without a friction model says.

EMPS (A. Janot, M. Gautier, M. Brunot, Workshop on Nonlinear System Identification Benchmarks, 2019): every law is fitted by
`backdrive.identify` to the first 12.4 s with mass, offset and delay, and judged on the second. Best law: the one of the fit's own
choice between presliding laws. Every fit has a constant force beside the friction, so that "by direction" adds unequal viscous
friction only.

UR3: rigid bodies, inertia of drives, offsets and friction come from the other log. What the own joint's inertia and friction do
not explain goes into the estimator as known; the accelerations in it are filtered without delay, which a robot could not do, while
the own joint's go through the estimator. Best law: the curve of the arm's model with friction that grows with the load. The plainer
laws are least squares on what the rest of the model leaves of the same log; by direction they gain nothing here, since the
model has offsets already.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from _common import Judge, data, parser
from ur3 import NAMES, description, read

from backdrive import identify
from backdrive.control.estimators.external import ExternalForce
from backdrive.control.estimators.friction import NOTHING, FrictionEstimator
from backdrive.control.estimators.sliding_mode import MotionFilter
from backdrive.identification.arm_predict import torque_parts
from backdrive.identification.arm_signals import ArmSignals, prepare_arm
from backdrive.identification.arm_terms import Regressor
from backdrive.identification.dynamic import LawFit
from backdrive.laws import CoulombViscous, Law
from backdrive.logs.readers import read_log
from backdrive.model import FrictionModel
from backdrive.robot import Robot, load_robot

FORCE = 35.15065188  # force constant of the EMPS [N/V]
START = 0.5  # of a log, which the observers need to settle [s]
RICH = ("coulomb-viscous+dahl", "coulomb-viscous+lugre", "coulomb-viscous+maxwell-slip")
MODELS = ("none", "symmetric", "by direction", "best law")
METHODS: dict[str, dict[str, Any]] = {
    "kalman": {"method": "kalman", "force_rate": 50.0, "encoder_count": 1e-6},
    "direct": {"method": "direct"},
    "direct, faster": {"method": "direct", "filter": MotionFilter(gain=400.0, second_gain=4000.0)},
}
MEAN = {
    ("id1.mat", "id2.mat"): 15.0,
    ("id2.mat", "id1.mat"): 18.0,
}  # log of the model, log that is judged: limit [%]
ARM: dict[str, dict[str, Any]] = {
    "kalman": {"method": "kalman", "force_rate": 20.0, "encoder_count": 1e-4},
    "direct": {"method": "direct", "filter": MotionFilter(gain=400.0, second_gain=4000.0)},
}


def rms(x: np.ndarray) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(x**2)))


def emps(judge: Judge) -> None:
    """Fit to the first half and estimate on the second."""
    log = read_log(data("emps", "DATA_EMPS.mat"), map=f"t=t,q=qm,tau={FORCE}*vir", units="m")
    half = len(log) // 2
    first, second = log.rows(slice(None, half)), log.rows(slice(half, None))
    assert second.position is not None
    assert second.torque is not None
    q, u = second.position[:, 0], second.torque[:, 0]
    plain = {
        name: identify(first, law=law, symmetric=symmetric).choice()
        for name, law, symmetric in zip(MODELS[1:], ("m1", "coulomb-viscous"), (True, False), strict=False)
    }
    chosen = identify(first, law=RICH).choice()
    fits: dict[str, LawFit] = {}
    for name, choice in (plain | {MODELS[3]: chosen}).items():
        best = choice.candidate().fit
        assert best is not None
        fits[name] = best
    laws = {"none": NOTHING} | {name: FrictionEstimator(law=f.law) for name, f in fits.items()}
    fits["none"] = fits["symmetric"]
    found: dict[str, dict[str, float]] = {}
    size = 0.0
    for name in MODELS:
        values = fits[name].values
        offset = np.full(q.size, values.get("offset", 0.0))
        found[name] = {}
        for method, how in METHODS.items():
            estimator = ExternalForce(inertia=values["inertia"], friction=laws[name], **how)
            force, friction = estimator.run(q, u, second.period, offset)
            found[name][method] = rms(force[round(START / second.period) :])
            size = rms(friction) if name == MODELS[3] else size
    print(f"EMPS, second half; RMS of the estimated force [N] and in % of the friction's {size:.1f} N")
    print(f"  {'':14s}" + "".join(f"{m:>22s}" for m in METHODS))
    for name, row in found.items():
        print(f"  {name:14s}" + "".join(f"{v:12.2f} N {100 * v / size:6.1f} %" for v in row.values()))
    print(f"  best law: {chosen.chosen}")
    share = {name: 100 * row["kalman"] / size for name, row in found.items()}
    judge.that(
        "EMPS, kalman: each richer model leaves less: "
        + " > ".join(f"{share[m]:.1f}" for m in MODELS)
        + " %",
        all(share[a] > share[b] for a, b in zip(MODELS, MODELS[1:], strict=False)),
    )
    judge.at_most("EMPS, kalman, symmetric", share["symmetric"], 7.0, "% of the friction")
    judge.at_most("EMPS, kalman, by direction", share["by direction"], 5.5, "% of the friction")
    judge.at_most("EMPS, kalman, best law", share["best law"], 5.0, "% of the friction")
    direct = {name: 100 * row["direct, faster"] / size for name, row in found.items()}
    judge.that(
        "EMPS, direct: each richer model leaves less: "
        + " > ".join(f"{direct[m]:.1f}" for m in MODELS)
        + " %",
        all(direct[a] > direct[b] for a, b in zip(MODELS, MODELS[1:], strict=False)),
    )
    judge.at_most("EMPS, direct, faster filter, best law", direct["best law"], 15.0, "% of the friction")


def plainer(residual: np.ndarray, velocity: np.ndarray, transition: float) -> dict[str, Law]:
    """Return Coulomb and viscous friction alike in both directions, and by direction, by least squares."""
    way = np.tanh(velocity / transition)
    up, down = np.maximum(way, 0.0), np.minimum(way, 0.0)
    ahead, back = np.maximum(velocity, 0.0), np.minimum(velocity, 0.0)
    F, B = np.linalg.lstsq(np.stack([way, velocity], axis=1), residual, rcond=None)[0]
    sides = np.linalg.lstsq(np.stack([up, down, ahead, back], axis=1), residual, rcond=None)[0]

    def law(*values: float) -> Law:
        F_p, F_n, B_p, B_n = (max(float(v), 0.0) for v in values)
        return Law(
            rate=CoulombViscous(
                coulomb_positive=F_p, coulomb_negative=F_n, viscous_positive=B_p, viscous_negative=B_n
            )
        )

    return {"symmetric": law(F, F, B, B), "by direction": law(*sides)}


def between(x: np.ndarray) -> np.ndarray:
    """Return the mean of each sample and the next, which is what acted in the interval after it."""
    return 0.5 * (x + np.append(x[1:], x[-1]))


def known_parts(arm: FrictionModel, robot: Robot, s: ArmSignals) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return rigid bodies, inertia of drives and offset; friction that grows with the load; the curve; (n, J) each."""
    assert arm.arm is not None
    frictions = [arm.joint(name) for name in robot.joints]
    whole, rest = torque_parts(s, robot, arm.arm, frictions)
    bodies = Regressor(robot, [s]).bodies(0, robot.base.relation @ np.array(arm.arm.parameters))
    grown = np.empty_like(rest)
    for j, friction in enumerate(frictions):
        value = {name: e.value for name, e in friction.dynamics.items()}
        way = np.tanh(s.velocity[:, j] / value["transition"])
        slope = friction.law.growth.mean if friction.law.growth else 0.0
        grown[:, j] = slope * np.abs(bodies[:, j]) * way
    return rest - grown, grown, whole - rest


def judged(arm: FrictionModel, robot: Robot, seen: ArmSignals, s: ArmSignals, method: str) -> np.ndarray:
    """Return RMS of the estimate by joint and model, and of the friction in the last column [N.m], (J, 5)."""
    bare, grown, curve = known_parts(arm, robot, s)
    residual = seen.torque - known_parts(arm, robot, seen)[0]
    own = np.mean([np.diagonal(m) for m in robot.inertia(s.position[::25])], axis=0)
    out, skip = np.empty((own.size, 5)), round(START * s.rate)
    for j, name in enumerate(robot.joints):
        friction = arm.joint(name)
        inertia = float(own[j]) + max(friction.dynamics["inertia"].value, 0.0)
        laws = {"none": NOTHING.law, "best law": replace(friction.law, growth=None)}  # `grown` has its growth
        laws |= plainer(residual[:, j], seen.velocity[:, j], friction.dynamics["transition"].value)
        for i, model in enumerate(MODELS):
            known = (
                bare[:, j] + (grown[:, j] if model == "best law" else 0.0) - inertia * s.acceleration[:, j]
            )
            estimator = ExternalForce(
                inertia=inertia, friction=FrictionEstimator(law=laws[model]), **ARM[method]
            )
            acted, meanwhile = between(s.torque[:, j]), np.roll(between(known), 1)
            force, _ = estimator.run(s.position[:, j], acted, 1.0 / s.rate, meanwhile)
            out[j, i] = rms(force[skip:-1])
        out[j, 4] = rms(curve[:, j] + grown[:, j])
    return out


def ur3(judge: Judge, ways: int) -> None:
    """Identify on one log and estimate on the other, one way or both."""
    robot = load_robot(description()).without_tools(NAMES)
    logs = {name: read(name) for name in ("id1.mat", "id2.mat")}
    signals = {name: prepare_arm(log, robot)[0] for name, log in logs.items()}
    for (seen, unseen), limit in list(MEAN.items())[:ways]:
        arm = identify(logs[seen], method="arm", urdf=str(description())).model
        for method in ARM:
            table = judged(arm, robot, signals[seen], signals[unseen], method)
            share = 100 * table[:, :4] / table[:, 4:]
            print(
                f"\nUR3, model of {seen}, judged on {unseen}, {method}: RMS of the estimate in % of the friction's"
            )
            print(" " * 24 + "".join(f"{m:>14s}" for m in MODELS) + "  friction [N.m]  best law [N.m]")
            for name, row, values in zip(robot.joints, share, table, strict=False):
                print(
                    f"  {name:22s}"
                    + "".join(f"{v:14.1f}" for v in row)
                    + f"{values[4]:16.2f}{values[3]:16.2f}"
                )
            print(f"  {'mean':22s}" + "".join(f"{v:14.1f}" for v in share.mean(axis=0)))
            where = f"UR3, {unseen}, {method}"
            judge.at_most(
                f"{where}: symmetric by none, worst joint", float((share[:, 1] / share[:, 0]).max()), 0.35
            )
            better = int(np.sum(share[:, 3] < share[:, 1]))
            judge.that(
                f"{where}: best law below symmetric on {better} of {len(share)} joints (at least 5)",
                better >= 5,
            )
            gain = float(share[:, 2].mean() - share[:, 1].mean())
            judge.that(
                f"{where}: two directions change the mean by {gain:+.2f} points (at most 1)", abs(gain) < 1.0
            )
            judge.at_most(f"{where}: best law, mean of the joints", float(share[:, 3].mean()), limit, "%")
            judge.at_most(f"{where}: best law, worst joint", float(share[:, 3].max()), 21.0, "%")


def main() -> None:
    """Print the tables and judge them."""
    short = parser(__doc__).parse_args().short
    judge = Judge()
    emps(judge)
    ur3(judge, 1 if short else 2)
    judge.end()


if __name__ == "__main__":
    main()
