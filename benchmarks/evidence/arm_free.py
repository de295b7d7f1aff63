"""UR3 that nothing touches: the torque that a model leaves on a motion it never saw, by friction model.

Everything comes from id1: rigid bodies, drives, offsets and friction, fitted anew with each friction model, by the same solver,
filters and priors. On id2 what remains of the measured torque is what an estimator of external force would take for a force.

Friction models: none (the bodies of the best law, its friction left out); Coulomb and viscous, a straight line by direction; the
same with friction in proportion to the load; the curve with eight knots by direction; that with load, which is what
`backdrive identify --method arm` gives and is judged. What the models are worth within id1 stands beside: the mean over its
four quarters, each held out once, of the torque left below 5 Hz.

RMS over all samples of id2, as measured and, beside it, below 5 Hz. Judged as measured, on the log's own samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from _common import Judge, parser
from ur3 import NAMES, description, read, row

from backdrive import identify
from backdrive.identification.arm import predict_arm
from backdrive.identification.arm_forecast import terms_along
from backdrive.identification.arm_signals import ArmSignals, prepare_arm
from backdrive.identification.arm_solve import Solution, solve_arm
from backdrive.identification.arm_terms import Regressor, Terms, build, fill_load
from backdrive.logs.filters import low_pass
from backdrive.logs.log import Log
from backdrive.robot import Robot, load_robot

MODELS = {  # straight lines or the curve, load friction
    "Coulomb and viscous": (True, False),
    "Coulomb, viscous and load": (True, True),
    "curve": (False, False),
    "curve and load": (False, True),
}
QUARTERS = 4
GATE = 0.9


def fitted(s: ArmSignals, robot: Robot, straight: bool, load: bool) -> tuple[list[Terms], Solution]:
    """Return terms and coefficients of a fit to the samples of a stretch that are to be fitted."""
    terms = terms_along([s], len(robot.joints))
    if straight:
        terms = [replace(t, knots=np.array([0.0, t.knots[-1]])) for t in terms]
    regressor = Regressor(robot, [s])
    rows = build(regressor, terms)
    solution = solve_arm(
        rows, robot, terms, lambda beta: fill_load(rows, regressor, terms, beta), np.full(len(terms), load)
    )
    return terms, solution


def left(
    s: ArmSignals, robot: Robot, terms: Sequence[Terms], solution: Solution
) -> tuple[np.ndarray, np.ndarray]:
    """Return what a fit leaves of the torque of a stretch, and its friction [N.m], each (n, J)."""
    bodies = Regressor(robot, [s]).bodies(0, solution.beta)
    rest, friction = s.torque - bodies, np.empty_like(bodies)
    for j, t in enumerate(terms):
        columns, own, n = (
            t.columns(s.velocity[:, j], s.acceleration[:, j], bodies[:, j]),
            solution.own[j],
            2 * t.knots.size,
        )
        rest[:, j] -= columns[:, n : n + 2] @ own[n : n + 2]
        friction[:, j] = columns[:, :n] @ own[:n] + columns[:, -1] * own[-1]
    return rest - friction, friction


def at_samples(rest: np.ndarray, s: ArmSignals, log: Log) -> np.ndarray:
    """Return what is left of the torque at a log's own samples [N.m], (n, J), joints in the order of `NAMES`."""
    assert log.torque is not None
    columns = [log.names.index(n) for n in NAMES]
    predicted = s.torque - rest
    every = [np.interp(log.time, s.time, predicted[:, j]) for j in range(predicted.shape[1])]
    return log.torque[:, columns] - np.stack(every, axis=1)


def rms(x: np.ndarray) -> np.ndarray:
    """Return the root mean square of every joint."""
    return np.sqrt(np.mean(x**2, axis=0))


def within(s: ArmSignals, robot: Robot, straight: bool, load: bool) -> np.ndarray:
    """Return the torque left below 5 Hz in quarters of a stretch that were held out in turn [N.m], (J,)."""
    n, seam, total = s.time.size, round(0.5 * s.rate), np.zeros(len(robot.joints))
    for k in range(QUARTERS):
        held = slice(k * n // QUARTERS, (k + 1) * n // QUARTERS)
        use = np.ones(n, dtype=bool)
        use[max(held.start - seam, 0) : held.stop + seam] = False
        rest, _ = left(s, robot, *fitted(replace(s, fitted=use), robot, straight, load))
        total += np.mean(low_pass(rest, 5.0, s.rate)[held] ** 2, axis=0)
    return np.sqrt(total / QUARTERS)


def main() -> None:
    """Fit on id1, judge on id2."""
    short = parser(__doc__).parse_args().short
    robot = load_robot(description()).without_tools(NAMES)
    seen, unseen = read("id1.mat"), read("id2.mat")
    (first,), (second,) = prepare_arm(seen, robot), prepare_arm(unseen, robot)
    print(
        "torque left on id2, everything from id1 [N.m], RMS as measured; below 5 Hz; within id1, held out, below 5 Hz"
    )
    print(" " * 36 + "".join(f"{n.removesuffix('_joint')[-7:]:>8s}" for n in NAMES))
    raw: dict[str, np.ndarray] = {}
    low: dict[str, np.ndarray] = {}
    inner: dict[str, np.ndarray] = {}
    for name, (straight, load) in MODELS.items():
        rest, friction = left(second, robot, *fitted(first, robot, straight, load))
        raw[name], low[name] = rms(at_samples(rest, second, unseen)), rms(low_pass(rest, 5.0, second.rate))
        if name == "curve and load":
            raw["none"] = rms(at_samples(rest + friction, second, unseen))
            low["none"] = rms(low_pass(rest + friction, 5.0, second.rate))
        if not short:
            inner[name] = within(first, robot, straight, load)
    for name in ("none", *MODELS):
        row(name, raw[name])
        row("  below 5 Hz", low[name])
        if name in inner:
            row("  within id1", inner[name])
    result = identify(seen, method="arm", urdf=str(description()), held_out=[unseen])
    assert unseen.torque is not None
    columns = [result.model.names.index(n) for n in unseen.names]
    error = unseen.torque - predict_arm(result.model, unseen, description())[:, columns]
    error = error[:, [unseen.names.index(n) for n in NAMES]]
    best, plain = rms(error), raw["Coulomb and viscous"]
    smooth = rms(low_pass(error, 5.0, 1.0 / unseen.period))
    row("identify --method arm", best)
    row("  below 5 Hz", smooth)
    row("best by Coulomb and viscous", best / plain)
    row("  below 5 Hz", smooth / low["Coulomb and viscous"])
    judge = Judge()
    better = int(np.sum(best < plain))
    judge.that(
        f"better than Coulomb and viscous on {better} of {len(NAMES)} joints (at least 5)", better >= 5
    )
    judge.at_most("mean of the ratios", float(np.mean(best / plain)), GATE)
    ratio = smooth / low["Coulomb and viscous"]
    print(f"  below 5 Hz: better on {int(np.sum(ratio < 1))} joints, mean of the ratios {np.mean(ratio):.3f}")
    if inner:
        mean = {name: float(np.mean(v / inner["Coulomb and viscous"])) for name, v in inner.items()}
        print(
            "  within id1, held out, mean of the ratios: "
            + ", ".join(f"{n} {v:.3f}" for n, v in mean.items())
        )
    judge.end()


if __name__ == "__main__":
    main()
