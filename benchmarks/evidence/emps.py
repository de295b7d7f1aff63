"""The EMPS ball-screw axis: the benchmark's own four parameters, and a friction curve that predicts better.

Benchmark: A. Janot, M. Gautier, M. Brunot, "Data set and reference models of EMPS", Workshop on Nonlinear System
Identification Benchmarks, 2019. Its recipe: 4th-order Butterworth at 100 Hz, zero phase, on the position; central
differences; the first 49 samples dropped; force and every regressor decimated by 10 through an 8th-order Chebyshev-I filter.
"""

from __future__ import annotations

import numpy as np
from _common import Judge, data, parser
from scipy.signal import butter, cheby1, filtfilt, sosfiltfilt

from backdrive.identification import curves, design, identify, regression
from backdrive.identification.signals import Signals
from backdrive.logs.readers import read_log

PUBLISHED = {"M": 95.1089, "Fv": 203.5034, "Fc": 20.3935, "offset": -3.1648}
FORCE = 35.15065188  # force constant that the data set gives [N/V]
DROP, FACTOR, BLOCKS = 49, 10, 10
UNSEEN = {True: 2.75, False: 3.25}  # with the jerk column, which is a time slip, and without [%]


def recipe(position: np.ndarray, force: np.ndarray, period: float) -> Signals:
    """Differentiate as the benchmark does."""
    b, a = butter(4, 100.0, fs=1 / period)
    smooth = filtfilt(b, a, position, padlen=3 * (len(b) - 1))
    velocity = np.gradient(smooth, period)
    acceleration = np.gradient(velocity, period)
    n = position.size
    return Signals(
        time=period * np.arange(n),
        velocity=velocity,
        acceleration=acceleration,
        jerk=np.gradient(acceleration, period),
        torque=force,
        rate=1 / period,
        position=None,
        model_torque=None,
        moving=np.ones(n, dtype=bool),
    )


def decimate(columns: np.ndarray) -> np.ndarray:
    """Decimate by 10 as MATLAB does: the last sample is kept."""
    kept = columns[DROP:]
    smooth = sosfiltfilt(cheby1(8, 0.05, 0.8 / FACTOR, output="sos"), kept, axis=0, padlen=24)
    n = len(smooth)
    return smooth[FACTOR - (FACTOR * -(-n // FACTOR) - n) - 1 :: FACTOR]


def relative(error: np.ndarray, y: np.ndarray) -> float:
    """Relative error [%]."""
    return 100 * float(np.linalg.norm(error) / np.linalg.norm(y))


def main() -> None:
    """Compute everything from the log and judge it."""
    parser(__doc__).parse_args()  # it takes seconds, shortened or not
    judge = Judge()
    log = read_log(data("emps", "DATA_EMPS.mat"), map=f"t=t,q=qm,tau={FORCE}*vir", units="m")
    s = recipe(log.position[:, 0], log.torque[:, 0], log.period)
    sign, one = np.sign(s.velocity), np.ones_like(s.velocity)
    y = decimate(s.torque)

    print(f"the benchmark's recipe ({y.size} samples after decimation)")
    X = decimate(np.stack([s.acceleration, s.velocity, sign, one], axis=1))
    theta = np.linalg.lstsq(X, y, rcond=None)[0]
    for (name, expected), value in zip(PUBLISHED.items(), theta, strict=False):
        off = 100 * abs(value / expected - 1)
        judge.at_most(f"{name} = {value:.4f}, published {expected}, off by", off, 0.1, "%")
    error = relative(y - X @ theta, y)
    judge.at_most(
        f"relative error {error:.4f} %, published 4.0834 %, differs by", abs(error - 4.0834), 0.004, "%"
    )
    up, down = s.velocity > 0, s.velocity < 0
    X = decimate(np.stack([s.acceleration, s.velocity * up, s.velocity * down, up, -1.0 * down], axis=1))
    error = relative(y - X @ np.linalg.lstsq(X, y, rcond=None)[0], y)
    judge.at_most(
        f"by direction {error:.4f} %, published 3.1117 %, differs by", abs(error - 3.1117), 0.003, "%"
    )

    print(f"curves on the same signals, {BLOCKS} contiguous blocks held out in turn")
    top = float(np.percentile(np.abs(s.velocity), 99.9))
    knots = top * np.array(curves.SHARES)
    X = decimate(design.columns(s, knots))
    block = regression.block_index(y.size, BLOCKS)
    blocks = regression.accumulate(X, y, np.ones(y.size), block, BLOCKS)
    coarse = {name: knots[list(keep)] for name, keep in curves.COARSE.items()}
    for slip in (False, True):
        options = design.candidates(
            knots, coarse, dynamic=True, gravity=False, model_torque=False, both_directions=True
        )
        if slip:
            options += [option.with_term("jerk") for option in options]
        choice = design.fit(blocks, design.simplest(blocks, options))
        left_out = np.concatenate(
            [
                y[block == b] - X[block == b] @ choice.candidate.spread @ t
                for b, t in enumerate(choice.left_out)
            ]
        )
        name = f"{choice.candidate.form.name}, {'with' if slip else 'without'} a time slip of the torque"
        error = relative(left_out, y)
        if slip:
            inertia, jerk = (
                choice.coefficients[choice.candidate.terms.index(t)] for t in ("inertia", "jerk")
            )
            print(f"    estimated slip of the force behind the motion: {1e3 * jerk / inertia:.2f} ms")
        judge.at_most(f"curve of {name}, unseen", error, UNSEEN[slip], "%")

    print("the whole pipeline, `identify` with its defaults")
    result = identify(log)
    friction = result.model.joints[0]
    print(f"    {result.method}; {friction.law.rate.NAME}")
    print(
        f"    residual below 5 Hz: fitted {friction.fitted.residual:.2f} %, unseen {friction.held_out.residual:.2f} %"
    )
    print(
        f"    raw: fitted {friction.fitted.residual_raw:.2f} %, unseen {friction.held_out.residual_raw:.2f} %"
    )
    inertia = friction.dynamics["inertia"]
    print(f"    mass {inertia.value:.3f} +- {inertia.standard_error:.3f} kg")
    judge.at_most("unseen residual below 5 Hz", friction.held_out.residual, 4.0, "%")
    judge.end()


if __name__ == "__main__":
    main()
