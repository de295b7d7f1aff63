"""Every compensator and every estimator on the same joints: tiers, and whether another ten seeds say otherwise.

The rows are those of `backdrive reproduce league`. Cost: the hand's peak and RMS force by a stiff and a soft hand, its force in a
dwell, the light touch that moves the joint after one, each by the bare joint's in the same setting, and the price of shaking; the
bare joint has 1. Every method is tuned anew for every seed; two methods are separated where the paired differences over the seeds
say so at 5 % of all pairs together (Holm). Required: no pair that is separated by one set of seeds is separated the other way
round by the other, over all joints and on each; what is said of each joint holds on both sets.
"""

from __future__ import annotations

import time

import numpy as np
from _common import Judge, parser

from backdrive.control import BareLoop
from backdrive.control.joint_loop import BRISK, LATCH_TIME
from backdrive.simulation.closed_loop import play
from backdrive.thesis import league
from backdrive.thesis._league_claims import guiding
from backdrive.thesis._league_costs import Table, cost, costs_of
from backdrive.thesis._league_joints import EPISODES, NOMINAL, SETTINGS, contenders, scenes, scores
from backdrive.thesis._league_methods import METHODS
from backdrive.thesis._league_tiers import reversals, significant_pairs

APART = 10_000  # between the first seeds of the sets
LIMIT = 600.0  # s, of both sets on two idle cores
COLUMNS = (
    "touch",
    "dwell",
    "stiff_peak",
    "stiff_rms",
    "soft_peak",
    "soft_rms",
    "cycle",
    "fluctuation",
    "tracking",
)


def show(table: Table, joints: list[str]) -> None:
    """Print the means over the seeds of what every compensator achieved, joint by joint, and the costs by setting."""
    for joint in joints:
        print(
            f"\n{joint}, means over {len(table)} seeds, SI units"
            + "".join(f"{c:>12s}" for c in COLUMNS)
            + "   cost"
        )
        costs = costs_of(table, NOMINAL.name, joint)
        for method, values in costs.items():
            mean = {
                c: np.mean([rows[joint][method][NOMINAL.name][c] for rows in table.values()]) for c in COLUMNS
            }
            print(
                f"  {method:22s}" + "".join(f"{mean[c]:12.3g}" for c in COLUMNS) + f" {np.mean(values):6.2f}"
            )
    print("\nmean cost over the joints, by setting:")
    for i, setting in enumerate(SETTINGS):
        print(f"  {i + 1}: {setting.name}")
    every = [costs_of(table, setting.name) for setting in SETTINGS]
    for name in sorted(every[0], key=lambda n: float(np.mean(every[0][n]))):
        print(f"  {name:22s}" + "".join(f"{np.mean(costs[name]):7.2f}" for costs in every))


def compare(judge: Judge, tables: list[Table], joints: list[str]) -> None:
    """Judge whether the second set of seeds turns round what the first one separates."""
    cases = {
        "as believed": [guiding(t, NOMINAL.name) for t in tables],
        "otherwise": [guiding(t) for t in tables],
        "tracking": [costs_of(t, NOMINAL.name, score="tracking") for t in tables],
        "light touch": [costs_of(t, NOMINAL.name, score="touch") for t in tables],
    } | {f"{joint}, as believed": [guiding(t, NOMINAL.name, joint) for t in tables] for joint in joints}
    for name, (one, two) in cases.items():
        first, second = significant_pairs(one), significant_pairs(two)
        turned = reversals(one, two)
        judge.that(
            f"{name}: {len(first)} and {len(second)} of {len(one) * (len(one) - 1) // 2} pairs separated, {len(first & second)} by "
            f"both sets, turned round {turned}",
            not turned,
        )


def limited(judge: Judge, joints: int) -> None:
    """Judge what the torque loop's rate limit, F a millisecond, changes: cost, tracking error and peak force of every method."""
    worst, where = 0.0, "none"
    for who in contenders()[:joints]:
        bare = league.score(who, METHODS[0], [{}], NOMINAL, 0)[0]
        rate = max(3.0 * who.coulomb / LATCH_TIME, BRISK * who.coulomb)
        for method in METHODS:
            z, found = method.draw(1, 0)[0], []
            for each in (None, rate):
                loop = BareLoop(compensator=method.make(who, z), limit=3.0 * who.coulomb, rate=each)
                s = scores(who, dict(zip(EPISODES, play(scenes(who, loop, NOMINAL, 0)), strict=False)))
                found.append((cost(who, s, bare), s["tracking"], s["stiff_peak"]))
            change = float(np.max(np.abs(np.array(found[1]) / found[0] - 1.0)))
            if change > worst:
                worst, where = change, f"{method.name} on {who.name}"
    judge.at_most(f"largest change by the loop's rate of torque ({where})", 100.0 * worst, 0.1, "%")


def main() -> None:
    """Run the league on two sets of seeds and judge."""
    made = parser(__doc__)
    made.add_argument("--seeds", type=int, default=league.SEEDS, help="of each set")
    made.add_argument("--seed", type=int, default=0, help="the first")
    given = made.parse_args()
    seeds, budget, joints = (3, 3, 1) if given.short else (given.seeds, league.BUDGET, 4)
    judge, tables = Judge(), []
    begun, worked = time.perf_counter(), time.process_time()
    for first in (given.seed, given.seed + APART):
        outcome = league.run(first, seeds, budget, joints, say=lambda text: print(f"  {text}", flush=True))
        tables.append(outcome.data["table"])
        print(f"\nseeds from {first}: {outcome.setting}")
        for claim in outcome.claims:
            print(f"  {claim.what}:\n      {claim.ours}")
            if claim.holds is not None and not given.short:
                judge.that(f"{claim.what} ({claim.gate})", claim.holds)
    spent, cpu = time.perf_counter() - begun, time.process_time() - worked
    names = list(next(iter(tables[0].values())))
    show(tables[0], names)
    print("\nboth sets of seeds:")
    compare(judge, tables, names)
    limited(judge, 1 if given.short else 4)
    print(f"both sets: {spent:.0f} s, {cpu:.0f} s of processor time, half of which two idle cores take")
    judge.at_most(
        "time of both sets, the smaller of wall and half the processor time",
        min(spent, cpu / 2.0),
        LIMIT,
        "s",
    )
    judge.end()


if __name__ == "__main__":
    main()
