"""External force on the EMPS axis, where it is known exactly: taken off the recorded motor force, as a hand would take it.

The EMPS (Janot, Gautier, Brunot, Nonlinear Benchmarks 2019) moves freely. Of its motor force a force f(t) is taken off, so that
motor and hand together do what the motor did alone: the motion is the recorded one, and f is known to the last digit. Identified on
the first half without f; estimated on the second, in blocks of 2 s of which every other one chooses the best setting and the
rest judge. All methods at equal lag and unit gain (the lag on a ramp, 1/L + T, is taken out), with no friction, Coulomb and
viscous friction, friction by direction, and the law that `identify --law auto` chooses. Forces: a square wave of +-15 N every
0.7 s, two sines, knocks of 80 ms, and slow pushes of up to 15 N.

    python benchmarks/evidence/known_force.py
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from _common import Judge, data, parser

from backdrive import FrictionModel, Log, identify, read_log
from backdrive.control.estimators.external import METHODS
from backdrive.external import estimate_force
from backdrive.laws import Coulomb, Law

GAIN = 35.15065188  # N/V
BLOCK = 2.0  # [s]
LIMIT = 1.2  # error of the default by that of the best
BANDWIDTHS = (5.0, 10.0, 20.0, 40.0, 80.0, 160.0, 320.0)


def forces(t: np.ndarray) -> dict[str, np.ndarray]:
    """Return the forces of a hand [N], (n,) each."""
    square = 15.0 * np.sign(np.sin(2.0 * np.pi * t / 1.4 + 0.3))
    knock = np.where(t % 1.5 < 0.08, 30.0 * np.sin(np.pi * (t % 1.5) / 0.08), 0.0)
    rise = np.clip(np.sin(0.9 * t), 0.0, 0.6) * 25.0
    return {
        "square wave": square,
        "two sines": 10.0 * np.sin(4.0 * t) + 6.0 * np.sin(17.0 * t + 1.0),
        "knocks": knock,
        "a light slow push": rise,
    }


def pushed(log: Log, force: np.ndarray) -> Log:
    """Return the log of an axis that a hand pushes with a force, its motion unchanged."""
    assert log.torque is not None
    return log.replace(torque=log.torque - force[:, None], external_torque=force[:, None])


def models(first: Log, short: bool) -> dict[str, FrictionModel]:
    """Return the models of the first half, by what they know of friction."""
    symmetric = identify(first, law="m1", symmetric=True).model
    found = {
        "none": without_friction(symmetric),
        "Coulomb and viscous": symmetric,
        "by direction": identify(first, law="coulomb-viscous", symmetric=False).model,
    }
    if not short:
        found["law chosen"] = identify(first, law="auto").model
    return found


def without_friction(model: FrictionModel) -> FrictionModel:
    """Return a model that knows everything but friction."""
    one = model.joints[0]
    bare = replace(one, law=Law(rate=Coulomb(coulomb=0.0)), standard_errors={}, covariance=None, at_bound=())
    return replace(model, joints=(bare,))


def rms(x: np.ndarray) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(x**2)))


def main() -> None:
    """Estimate by every method and friction model, and judge the default."""
    options = parser(__doc__)
    short = options.parse_args().short
    judge = Judge()
    log = read_log(data("emps", "DATA_EMPS.mat"), map=f"t=t,q=qm,tau={GAIN}*vir", units="m")
    half = len(log) // 2
    first, second = log.rows(slice(None, half)), log.rows(slice(half, None))
    t = second.time - second.time[0]
    known = forces(t)
    bandwidths = BANDWIDTHS[1::2] if short else BANDWIDTHS
    for name, model in models(first, short).items():
        print(f"\nfriction: {name}")
        for kind, force in known.items():
            recorded = pushed(second, force)
            errors: dict[tuple[str, float], tuple[float, float]] = {}
            for method in METHODS:
                for bandwidth in bandwidths:
                    one = estimate_force(model, recorded, method=method, bandwidth=bandwidth).joints[0]
                    errors[method, bandwidth] = by_blocks(one.time, one.force - one.known)
            print(
                f"  {kind}: RMS error [N] at equal lag, on the judging blocks; L = "
                + ", ".join(f"{b:g}" for b in bandwidths)
            )
            for method in METHODS:
                print(f"    {method:12s}" + "".join(f"{errors[method, b][1]:8.2f}" for b in bandwidths))
            best = min(errors, key=lambda key: errors[key][0])
            one = estimate_force(model, recorded).joints[0]
            default = by_blocks(one.time, one.force - one.known)[1]
            ratio = default / errors[best][1]
            sentence = (
                f"{name}, {kind}: the default ({one.method}, {one.bandwidth:.3g} 1/s) {default:.2f} N, the best of the choosing "
                f"blocks ({best[0]}, {best[1]:g} 1/s) {errors[best][1]:.2f} N: {ratio:.2f} of it (at most {LIMIT:g})"
            )
            judge.that(sentence, ratio <= LIMIT)
            moving = one.state < 2
            inside = (one.known >= one.lower) & (one.known <= one.upper)
            print(
                f"    inside the 95 % band: {100 * np.mean(inside[moving]):.1f} % moving, "
                f"{100 * np.mean(inside[~moving]) if (~moving).any() else float('nan'):.1f} % at rest"
            )
    judge.end()


def by_blocks(time: np.ndarray, error: np.ndarray) -> tuple[float, float]:
    """Return the RMS of an error on the blocks that choose and on those that judge."""
    block = ((time - time[0]) / BLOCK).astype(int) % 2
    return rms(error[block == 0]), rms(error[block == 1])


if __name__ == "__main__":
    main()
