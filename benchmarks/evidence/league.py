"""Every compensator and every estimator on the same joints: what each achieves, as believed and where the joint is otherwise.

The rows are those of `backdrive reproduce league`. Cost: peak and RMS force of the hand and half the break-away, each by that of
the bare joint, and the price of shaking; the bare joint has 2.5. A second seed tells what of the order is chance.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from _common import Judge

from backdrive.experiments import league
from backdrive.experiments._league_joints import NOMINAL, SETTINGS, contenders

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


def main() -> None:
    """Run the league twice and judge its claims."""
    parser = argparse.ArgumentParser(description="The league of compensators and estimators.")
    parser.add_argument("--seeds", type=int, default=2)
    asked = parser.parse_args()
    judge, orders = Judge(), []
    for seed in range(asked.seeds):
        begun = time.perf_counter()
        outcome = league.run(seed)
        print(f"seed {seed}: {time.perf_counter() - begun:.0f} s")
        if seed == 0:
            show(outcome)
        for claim in outcome.claims:
            if claim.holds is None:
                print(f"  {claim.what}: {claim.ours}")
            else:
                judge.that(f"seed {seed}: {claim.what}: {claim.ours}", claim.holds)
        orders.append(league.overall(outcome.data["table"]))
    names = list(orders[0])
    if len(orders) > 1:
        ranks = np.array([np.argsort(np.argsort([o[n] for n in names])) for o in orders])
        print(f"rank correlation between seeds: {np.corrcoef(ranks)[0, 1]:.2f}")
    judge.end()


if __name__ == "__main__":
    main()
