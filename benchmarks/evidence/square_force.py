"""A square wave of force on a simulated joint: what `auto` takes, beside the best method and bandwidth of a grid.

The joint shares nothing with the package (`_independent`): its own friction with a Stribeck peak, own integration, counts, noise.
A model is identified from free motion; another free motion calibrates (`--free`). Then a hand pushes with a square wave while the
joint moves. The grid holds every method at bandwidths from 5 to 640 1/s; the best is that of the error itself, which no user knows.
Joint, speed of motion, rate, noise, height and period of the force are drawn by seed.

    python benchmarks/evidence/square_force.py
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from _common import Judge, first_seed, parser
from _independent import STEP, TURN, Joint, Logger, Record, multisine, record

from backdrive import Joint as Named
from backdrive import Log, identify
from backdrive.control.estimators.external import METHODS
from backdrive.external import JointForce, estimate_force

CASES = 16
LIMIT = 1.2  # median of the error of `auto` by that of the best of the grid
BANDWIDTHS = (5.0, 10.0, 20.0, 40.0, 80.0, 160.0, 320.0, 640.0)
SECONDS, EDGE = (
    16.0,
    1.5,
)  # of a log, and of its ends, where the joint starts and stops, that are not judged [s]
INSIDE = (0.9, 0.99)  # share of the force within its band, pooled over the cases


@dataclass(frozen=True, kw_only=True)
class Case:
    """A joint, how it is logged and moved, and the hand."""

    joint: Joint
    logger: Logger
    top: float
    height: float
    period: float

    def __str__(self) -> str:
        """Describe the case in a line."""
        j, g = self.joint, self.logger
        return (
            f"I {j.inertia:.2g}, F {j.coulomb:.2g}, top {self.top:.2g} rad/s, {g.rate:.0f} Hz, {g.counts:.0f} counts, "
            f"noise {g.noise:.2g}, {self.height:.2g} N.m every {self.period:.2g} s"
        )


def case(rng: np.random.Generator) -> Case:
    """Return a drawn case."""
    coulomb = np.exp(rng.uniform(np.log(0.5), np.log(6.0)))
    joint = Joint(
        inertia=float(coulomb * np.exp(rng.uniform(np.log(0.03), np.log(0.3)))),
        coulomb=float(coulomb),
        viscous=float(coulomb * rng.uniform(0.1, 0.6)),
        peak=float(coulomb * rng.uniform(0.1, 0.5)),
        peak_speed=float(rng.uniform(0.03, 0.2)),
        gravity=(float(coulomb * rng.uniform(0.0, 1.0)), 0.0),
        offset=float(coulomb * rng.uniform(-0.1, 0.1)),
        crossing=("elastoplastic", "stribeck")[int(rng.integers(2))],
        ripple=(float(rng.uniform(0.0, 0.04)), 11.0),
    )
    logger = Logger(
        rate=(500.0, 1000.0)[int(rng.integers(2))],
        noise=float(coulomb * np.exp(rng.uniform(np.log(0.005), np.log(0.1)))),
        colour=float(rng.choice([0.0, 0.5])),
        counts=float(2.0 ** rng.integers(15, 21)),
    )
    return Case(
        joint=joint,
        logger=logger,
        top=float(np.exp(rng.uniform(np.log(0.3), np.log(4.0)))),
        height=float(coulomb * np.exp(rng.uniform(np.log(0.3), np.log(2.0)))),
        period=float(rng.uniform(0.6, 2.4)),
    )


def log_of(one: Record, force: np.ndarray | None = None) -> Log:
    """Return a record as a log."""
    joints = (Named(name="j", encoder_counts=one.logger.counts / TURN),)
    known = None if force is None else force[:, None]
    return Log(
        time=one.time,
        position=one.position[:, None],
        torque=one.torque[:, None],
        external_torque=known,
        joints=joints,
    )


def logs(one: Case, rng: np.random.Generator) -> tuple[Log, Log, Log]:
    """Return free motion to identify, free motion to calibrate, and the log with the hand."""
    ways = [multisine(SECONDS, share * one.top, rng) for share in (1.2, 1.0, 1.0)]
    t = np.arange(ways[2].size) * STEP
    push = one.height * np.sign(np.sin(TURN * t / one.period + rng.uniform(0.0, TURN)))
    first, second = (log_of(record(one.joint, q, one.logger, rng)) for q in ways[:2])
    pushed = record(one.joint, ways[2], one.logger, rng, push=push)
    every = round(1.0 / (one.logger.rate * STEP))
    return first, second, log_of(pushed, push[::every][: pushed.time.size])


def relative_error(one: JointForce, height: float) -> float:
    """Return the RMS error by the height of the force [-], without the ends."""
    inner = (one.time > EDGE) & (one.time < SECONDS - EDGE)
    return float(np.sqrt(np.mean((one.force - one.known)[inner] ** 2))) / height


def inside(one: JointForce) -> np.ndarray:
    """Return whether the force is within its band, of the samples in motion."""
    judged = (one.time > EDGE) & (one.time < SECONDS - EDGE) & (one.state < 2)
    return ((one.known >= one.lower) & (one.known <= one.upper))[judged]


def main() -> None:
    """Draw cases, estimate by `auto` and by the grid, and judge the medians."""
    options = parser(__doc__)
    options.add_argument("--seed", type=int, default=None)
    options.add_argument("--cases", type=int, default=CASES)
    asked = options.parse_args()
    seed, judge = first_seed(asked.seed), Judge()
    ratios: dict[str, list[float]] = {"without --free": [], "with --free": []}
    covered: dict[str, list[np.ndarray]] = {name: [] for name in ratios}
    for k in range(4 if asked.short else asked.cases):
        rng = np.random.default_rng(seed + k)
        one = case(rng)
        free, other, pushed = logs(one, rng)
        model = identify(free).model
        errors = {}
        for method in METHODS:
            for bandwidth in BANDWIDTHS:
                tried = estimate_force(model, pushed, method=method, bandwidth=bandwidth).joints[0]
                errors[method, bandwidth] = relative_error(tried, one.height)
        best = min(errors, key=lambda key: errors[key])
        print(f"{seed + k}: {one}\n    best {100 * errors[best]:.1f} % ({best[0]}, {best[1]:g} 1/s)", end="")
        for name, more in (("without --free", []), ("with --free", [other])):
            auto = estimate_force(model, pushed, free=more).joints[0]
            error = relative_error(auto, one.height)
            ratios[name].append(error / errors[best])
            covered[name].append(inside(auto))
            print(
                f"; {name} {100 * error:.1f} % ({auto.method}, {auto.bandwidth:.3g} 1/s), {ratios[name][-1]:.2f}, "
                f"in band {100 * covered[name][-1].mean():.0f} %",
                end="",
            )
        print(flush=True)
    for name, values in ratios.items():
        judge.at_most(
            f"{name}: median of auto by best (highest {max(values):.2f})", float(np.median(values)), LIMIT
        )
        share = float(np.mean([x.mean() for x in covered[name]]))
        judge.that(
            f"{name}: {100 * share:.1f} % within the band (90 to 99 %)", INSIDE[0] <= share <= INSIDE[1]
        )
    judge.end()


if __name__ == "__main__":
    main()
