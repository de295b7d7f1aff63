"""Every compensator and every estimator on the same joints: what each achieves, as believed and where the joint is otherwise.

The rows are those of `backdrive reproduce league`. Cost: peak and RMS force of the hand and half the break-away, each by that of
the bare joint, and the price of shaking; the bare joint has 2.5. Every method tries eight settings, so that much of one seed's
order is chance: what is judged holds on every joint for every seed, or on the mean over the seeds, as the row says.
"""

from __future__ import annotations

import time

import numpy as np
from _common import Judge, parser

from backdrive.control import Unguarded
from backdrive.control.joint_loop import BRISK, LATCH_TIME
from backdrive.simulation.closed_loop import play
from backdrive.thesis import league
from backdrive.thesis._league_joints import NOMINAL, SETTINGS, contenders, scenes, scores

COLUMNS = ("breakaway", "peak", "rms", "cycle", "fluctuation", "energy", "tracking")


def show(outcome) -> None:
    """Print what every compensator achieved, joint by joint, and every estimator."""
    table = outcome.data["table"]
    for who in contenders():
        unit = "N.m, rad" if who.truth.unit == "rad" else "N, m"
        print(f"\n{who.name} [{unit}, J]" + "".join(f"{c:>12s}" for c in COLUMNS) + "   cost")
        for name, entry in table[who.name].items():
            s = entry["scores"][NOMINAL.name]
            cost = league.cost(who, s, entry["bare"])
            numbers = ", ".join(f"{k} {v:.3g}" for k, v in entry["numbers"].items())
            print(f"  {name:22s}" + "".join(f"{s[c]:12.3g}" for c in COLUMNS) + f" {cost:6.2f}   {numbers}")
    every = [league.overall(table, setting.name) for setting in SETTINGS]
    print("\nmean cost over the joints, by setting:")
    for i, setting in enumerate(SETTINGS):
        print(f"  {i + 1}: {setting.name}")
    for name in sorted(every[0], key=lambda n: every[0][n]):
        print(f"  {name:22s}" + "".join(f"{costs[name]:7.2f}" for costs in every))
    print(
        "\nestimators, means over the joints: RMS and error at rest by the RMS force, delay, false contacts"
    )
    for r in sorted(outcome.data["estimators"]["rows"], key=lambda r: r["rms"]):
        print(
            f"  {r['friction']:8s} {r['method']:10s} {r['rms']:6.2f} {r['standstill']:6.2f} {1e3 * r['delay']:5.0f} ms "
            f"{100 * r['false']:5.1f} %"
        )


def limited(judge: Judge, joints: int) -> None:
    """Judge what the torque loop's rate limit, F a millisecond, changes: cost, tracking error and peak force of every method."""
    worst, where = 0.0, "none"
    for who in contenders()[:joints]:
        bare = league.judged(who, league.METHODS[0], [{}], NOMINAL, 0)[0]
        rate = max(3.0 * who.coulomb / LATCH_TIME, BRISK * who.coulomb)
        for method in league.METHODS:
            z, found = method.draw(1, 0)[0], []
            for each in (None, rate):
                loop = Unguarded(compensator=method.make(who, z), limit=3.0 * who.coulomb, rate=each)
                s = scores(who, play(scenes(who, loop, NOMINAL, 0)))
                found.append((league.cost(who, s, bare), s["tracking"], s["peak"]))
            change = float(np.max(np.abs(np.array(found[1]) / found[0] - 1.0)))
            if change > worst:
                worst, where = change, f"{method.name} on {who.name}"
    judge.at_most(f"largest change by the loop's rate of torque ({where})", 100.0 * worst, 0.1, "%")


def main() -> None:
    """Run the league for several seeds and judge its claims."""
    made = parser(__doc__)
    made.add_argument("--seeds", type=int, default=4)
    asked = made.parse_args()
    judge, orders, each, dithered, estimated = Judge(), [], [], [], []
    for seed in range(1 if asked.short else asked.seeds):
        begun = time.perf_counter()
        outcome = league.run(seed)
        print(f"seed {seed}: {time.perf_counter() - begun:.0f} s")
        if seed == 0:
            show(outcome)
        for claim in outcome.claims:
            verdict = (
                "" if claim.holds is None else " (holds)" if claim.holds else " (does not hold for this seed)"
            )
            print(f"  {claim.what}: {claim.ours}{verdict}")
        table, rows = outcome.data["table"], outcome.data["estimators"]["rows"]
        orders.append(league.overall(table))
        each.append(league.by_joint(table))
        dithered.append(min(orders[-1][name] for name in ("PD", "PD reset", "algFC2")))
        estimated.append(min(r["rms"] for r in rows) / min(r["rms"] for r in rows if r["friction"] == "none"))
    print(f"\njudged over {len(orders)} seeds")
    if len(orders) > 1:
        ranks = np.array([np.argsort(np.argsort(list(o.values()))) for o in orders])
        apart = np.corrcoef(ranks)[np.triu_indices(len(orders), 1)]
        print(f"  rank correlation of the orders of two seeds: {apart.min():.2f} to {apart.max():.2f}")
    for names, limit in ((league.DECAYING, 1.0), (league.OTHERS, 1.12)):
        worst, name, joint, seed = max(
            (costs[name][joint] / costs["NC"][joint], name, joint, seed)
            for seed, costs in enumerate(each)
            for name in names
            for joint in costs[name]
        )
        judge.at_most(
            f"{', '.join(names)}: cost by the bare joint's, on the worst joint and seed ({name}, {joint}, seed {seed})",
            worst,
            limit,
        )
    MOP, CD = (float(np.mean([o[name] for o in orders])) for name in ("MOP", "CD"))
    best = float(np.mean(dithered))
    judge.that(
        f"best of PD, PD reset, algFC2, mean over joints and seeds: {best:.2f} (below MOP {MOP:.2f} and CD {CD:.2f})",
        best < min(MOP, CD),
    )
    judge.at_most(
        "best estimator's error by the best one's without a friction model, mean over seeds",
        float(np.mean(estimated)),
        0.5,
    )
    judge.at_most("the same, worst seed", max(estimated), 0.6)
    limited(judge, 1 if asked.short else 4)
    judge.end()


if __name__ == "__main__":
    main()
