"""What other tools make of a joint's friction, beside this package, on joints that share nothing with either.

FloBaRoID and FIGAROH, as most papers, regress torque on acceleration, velocity, the sign of the velocity, one and the bodies'
columns, on filtered signals; FloBaRoID can leave out slow samples. These regressions are written out here with numpy and scipy, on
a low pass of 20 Hz. MuJoCo's own system identification (`mujoco.sysid`) runs itself, where it is installed (extra `bench`): it
starts at the second regression's result.

Fitted on one multisine, judged by the truth: the error of the friction at three speeds, relative to the friction. Then the torque
of another multisine, without its noise: RMS of the error relative to that of the friction, while moving and within 50 ms of a
reversal. Medians over the draws. Required: in no cell worse than the best of the others by more than a tenth of it and 0.2 % of
the friction.

    python benchmarks/evidence/other_tools.py [--short] [--seed N]
"""

from __future__ import annotations

import contextlib
import io
import warnings
from collections.abc import Callable

import numpy as np
from _common import Judge, first_seed, parser
from _independent import Joint, Logger, Record, multisine, record
from scipy.signal import butter, filtfilt

from backdrive import Log, identify, rollout

CUTOFF, DEAD = 20.0, 0.05  # of the low pass [Hz]; speed below which samples are left out [rad/s]
NEAR = 0.05  # of a reversal [s]
SPEEDS = (0.05, 0.3, 1.0)  # at which friction is compared [rad/s]
JOINTS = {
    "line": Joint(gravity=(2.0, 0.5)),
    "unequal directions": Joint(gravity=(2.0, 0.5), coulomb_negative=1.1),
    "Stribeck peak": Joint(gravity=(2.0, 0.5), peak=0.9, peak_speed=0.15),
    "slow presliding": Joint(gravity=(2.0, 0.5), width=5e-3),
}
LOGGERS = {"2^20 counts, 1 kHz": Logger(), "4096 counts, 200 Hz": Logger(rate=200.0, counts=4096.0)}
Fit = tuple[
    Callable[[np.ndarray], np.ndarray], Callable[[Record], np.ndarray]
]  # friction by speed; torque of a log


def signals(r: Record) -> tuple[np.ndarray, ...]:
    """Return position, velocity, acceleration and torque through the same low pass."""
    b, a = butter(4, CUTOFF / (0.5 * r.logger.rate))
    q, tau = filtfilt(b, a, r.position), filtfilt(b, a, r.torque)
    v = np.gradient(q, 1.0 / r.logger.rate)
    return q, v, np.gradient(v, 1.0 / r.logger.rate), tau


def columns(r: Record) -> np.ndarray:
    """Return the columns of a single axis: acceleration, gravity, one, velocity, sign."""
    q, v, a, _ = signals(r)
    return np.column_stack([a, np.sin(q), np.cos(q), np.ones_like(q), v, np.sign(v)])


def regression(r: Record, dead: float) -> Fit:
    """Return the fit of the regression, slow samples left out."""
    X, (_, v, _, tau) = columns(r), signals(r)
    used = np.abs(v) > dead
    x = np.linalg.lstsq(X[used], tau[used], rcond=None)[0]
    return lambda s: x[4] * s + x[5] * np.sign(s), lambda other: columns(other) @ x


def sysid(r: Record) -> Fit:
    """Return the fit of MuJoCo's system identification."""
    from _other_mujoco import fit, model_of

    X, (_, v, _, tau) = columns(r), signals(r)
    used = np.abs(v) > DEAD
    start = np.linalg.lstsq(X[used], tau[used], rcond=None)[0]
    with contextlib.redirect_stdout(io.StringIO()):
        friction, torque = model_of(fit(r.time, r.position, v, r.torque, start))
    return friction, lambda other: torque(*signals(other)[:3])


def has_sysid() -> bool:
    """Return whether MuJoCo's system identification is installed, and say so if not."""
    try:
        from mujoco import sysid as module
    except ImportError:
        module = None
    there = hasattr(module, "optimize")
    if not there:
        print("mujoco.sysid is not installed (extra `bench`): its rows are left out")
    return there


def of_log(r: Record) -> Log:
    """Return a record as the package takes it."""
    return Log.from_arrays(time=r.time, position=r.position, torque=r.torque)


def package(r: Record, law: str | None) -> Fit:
    """Return the package's fit."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        result = identify(of_log(r), law=law) if law else identify(of_log(r))
        model = result.model
        joint = model.joints[0]

    def torque(other: Record) -> np.ndarray:
        q, _, a, _ = signals(other)
        rest = {k: e.value for k, e in joint.dynamics.items()}
        known = rest.get("inertia", 0.0) * a + rest.get("offset", 0.0)
        known += rest.get("gravity_sin", 0.0) * np.sin(q) + rest.get("gravity_cos", 0.0) * np.cos(q)
        return known + rollout(joint.law, dt=1.0 / other.logger.rate, q=q)

    def friction(s: np.ndarray) -> np.ndarray:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return np.array([float(model.torque(joint.joint.name, float(x))) for x in s])

    return friction, torque


METHODS: dict[str, Callable[[Record], Fit]] = {
    "regression": lambda r: regression(r, 0.0),
    "regression, |v| > 0.05 rad/s": lambda r: regression(r, DEAD),
    "backdrive identify": lambda r: package(r, None),
    "backdrive identify --law auto": lambda r: package(r, "auto"),
}
QUANTITIES = (*(f"friction at {s:g} rad/s" for s in SPEEDS), "torque moving", "torque reversing")


def errors(fit: Fit, joint: Joint, unseen: Record) -> list[float]:
    """Return the errors of a fit by the friction [-]."""
    friction, torque = fit
    result = []
    for speed in SPEEDS:
        both = np.array([speed, -speed])
        found, true = friction(both), joint.sliding(both)
        # a constant torque goes to friction or offset: the mean of the directions cannot be told and is not compared
        result.append(abs(found[0] - found[1] - true[0] + true[1]) / (true[0] - true[1]))
    v = unseen.motion[1]
    turns = np.flatnonzero(np.diff(np.sign(v)) != 0)
    reach = round(NEAR * unseen.logger.rate)
    near = np.zeros(v.size, dtype=bool)
    for k in turns:
        near[max(k - reach, 0) : k + reach] = True
    inside = np.zeros(v.size, dtype=bool)
    inside[v.size // 20 : -v.size // 20] = True
    size = np.sqrt(np.mean(joint.sliding(v[inside]) ** 2))
    wrong = torque(unseen) - unseen.clean
    return [*result, *(float(np.sqrt(np.mean(wrong[part & inside] ** 2)) / size) for part in (~near, near))]


def main() -> None:
    """Draw, fit, judge."""
    options = parser(__doc__)
    options.add_argument("--seed", type=int)
    given = options.parse_args()
    seed, draws = first_seed(given.seed), 1 if given.short else 5
    judge = Judge()
    if has_sysid():
        METHODS["MuJoCo's sysid"] = sysid
    loggers, joints = (dict(list(d.items())[: 1 if given.short else None]) for d in (LOGGERS, JOINTS))
    for what, logger in loggers.items():
        for name, joint in joints.items():
            table: dict[str, list[list[float]]] = {method: [] for method in METHODS}
            for k in range(draws):
                rng = np.random.default_rng([seed, k])
                seen, unseen = (record(joint, multisine(20.0, 1.5, rng), logger, rng) for _ in range(2))
                for method, make in METHODS.items():
                    table[method].append(errors(make(seen), joint, unseen))
            print(f"\n{name}, {what}: median error by the friction, %", flush=True)
            print(" " * 32 + "".join(f"{q.replace('friction at ', ''):>18s}" for q in QUANTITIES))
            median = {m: 100.0 * np.median(np.array(rows), axis=0) for m, rows in table.items()}
            for method, row in median.items():
                print(f"  {method:30s}" + "".join(f"{x:18.2f}" for x in row))
            others, ours = (
                np.array([row for m, row in median.items() if m.startswith("backdrive") == own])
                for own in (False, True)
            )
            for q, best, own in zip(QUANTITIES, others.min(axis=0), ours.min(axis=0), strict=True):
                judge.that(f"{name}, {what}, {q}: {own:.2f} % (others {best:.2f} %)", own <= 1.1 * best + 0.2)
    judge.end()


if __name__ == "__main__":
    main()
