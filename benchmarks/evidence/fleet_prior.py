"""A population as the prior of short noisy logs: error and intervals of the combination, and robots unlike their siblings.

Robots are drawn from the population, each with one log. The population's own numbers are known, or those of 12 robots that were
drawn from it. The log alone, the combination and the truth are compared.
"""

from __future__ import annotations

import numpy as np
from _common import Judge, first_seed, parser

from backdrive import Log, identify
from backdrive.errors import BackdriveError
from backdrive.fleet.population_file import Member, Population

MEAN = np.log([3.0, 2.0])  # of Coulomb [N.m] and viscous friction [N.m.s/rad]
BETWEEN = np.array([[0.01, 0.004], [0.004, 0.01]])
WITHIN = 1e-4 * np.eye(2)
TONES = ((0.15, 0.8, 0.3), (0.35, 0.45, 1.1), (0.85, 0.15, 2.0))  # Hz, rad, rad


def log_of(truth: np.ndarray, draws: np.random.Generator) -> Log:
    """Return a log of 8 s at 200 Hz with 0.8 N.m of noise, of a joint with inertia and gravity."""
    t = np.arange(1600) / 200.0
    q, dq, ddq = np.zeros((3, t.size))
    for hertz, amplitude, phase in TONES:
        w, shift = 2 * np.pi * hertz, phase + draws.uniform(0.0, 6.0)
        q += amplitude * np.sin(w * t + shift)
        dq += amplitude * w * np.cos(w * t + shift)
        ddq -= amplitude * w * w * np.sin(w * t + shift)
    tau = 0.5 * ddq + truth[0] * np.sign(dq) + truth[1] * dq + 4.0 * np.sin(q)
    tau += 0.8 * draws.standard_normal(t.size)
    return Log.from_arrays(time=t, position=q[:, None], torque=tau[:, None], joints=["j1"])


def population(mean: np.ndarray, between: np.ndarray, robots: int) -> Population:
    """Return a population of one joint."""
    a, b, c = (tuple(np.asarray(x).tolist()) for x in (mean, between[0], between[1]))
    of = Member(
        type="", joint="j1", unit="rad", robots=robots, left_out=(), top_speed=2.0, mean=a, between=(b, c),
        within=((1e-4, 0.0), (0.0, 1e-4)),
    )  # fmt: skip
    return Population(members=(of,))


def robots(judge: Judge, what: str, prior: Population, seed: int, count: int) -> None:
    """Identify drawn robots with and without the prior, and judge errors and intervals."""
    draws = np.random.default_rng(seed)
    rows, left_out, p = [], 0, []
    for _ in range(count):
        truth = np.exp(draws.multivariate_normal(MEAN, BETWEEN + WITHIN))
        try:
            comparison = identify(log_of(truth, draws), prior=prior).model.joints[0].prior
        except BackdriveError:
            comparison = None
        if comparison is None:  # no errors by the log alone
            left_out += 1
            continue
        p.append(comparison.p)
        for n, true in zip(comparison.numbers, truth, strict=True):
            final = (n.combined, n.combined_error) if comparison.applied else (n.log, n.log_error)
            rows.append((n.log - true, n.log_error, final[0] - true, final[1]))
    table = np.array(rows).reshape(-1, 2, 4)
    alone, both = (np.sqrt(np.mean(table[:, :, i] ** 2, axis=0)) for i in (0, 2))
    held = [100 * np.mean(np.abs(table[:, :, i]) < 1.96 * table[:, :, i + 1]) for i in (0, 2)]
    print(
        f"  {what}: {len(table)} robots, {left_out} logs without errors; p < 0.01 in {np.mean(np.array(p) < 0.01):.1%}"
    )
    print(f"  95 % intervals of the log alone hold {held[0]:.1f} %")
    for i, part in enumerate(("constant", "viscous")):
        judge.at_most(f"{what}, {part}: rms error relative to the log alone", both[i] / alone[i], 1.0)
    judge.that(f"{what}: 95 % intervals hold {held[1]:.1f} % (90 to 99)", 90.0 <= held[1] <= 99.0)
    judge.that(
        f"{what}: not less often than those of the log alone by more than 2 %", held[1] > held[0] - 2.0
    )


def unlike(judge: Judge, seed: int, count: int) -> None:
    """Judge how many robots with 1.6 times the friction of their siblings are named and left alone."""
    draws, named = np.random.default_rng(seed), 0
    for _ in range(count):
        truth = 1.6 * np.exp(draws.multivariate_normal(MEAN, WITHIN))
        comparison = identify(log_of(truth, draws), prior=population(MEAN, BETWEEN, 40)).model.joints[0].prior
        named += comparison is None or not comparison.applied
    judge.that(f"of {count} robots with 1.6 times the friction, {named} are not pulled", named >= 0.9 * count)


def main() -> None:
    """Run all comparisons."""
    options = parser(__doc__)
    options.add_argument("--seed", type=int)
    given = options.parse_args()
    seed, judge = first_seed(given.seed), Judge()
    count = 60 if given.short else 200
    robots(judge, "known population", population(MEAN, BETWEEN, 40), seed, count)
    few = np.random.default_rng(seed + 1).multivariate_normal(MEAN, BETWEEN, 12)
    robots(judge, "population of 12 robots", population(few.mean(axis=0), np.cov(few.T), 12), seed + 2, count)
    unlike(judge, seed + 3, count // 10)
    judge.end()


if __name__ == "__main__":
    main()
