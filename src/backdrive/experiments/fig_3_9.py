"""Fig. 3.9 of Iwatani 2017: position, velocity and torque while a hand guides three joints of Setup B."""

from __future__ import annotations

import numpy as np

from backdrive.experiments import _guided
from backdrive.experiments._guided import CASES
from backdrive.experiments.fig_3_7 import time_series
from backdrive.experiments.fig_3_10 import ARM, CYCLES, SETTING, guidance
from backdrive.experiments.outcome import Claim, Outcome


def run(seed: int = 0) -> Outcome:
    """Guide Joints 0, 1 and 2 for 30 cycles in each case.

    Args:
        seed: of the hand.
    """
    played = _guided.guide([(guidance(name), CYCLES, seed) for name in ARM])
    claims, data, numbers = [], {}, {}
    for name, records in zip(ARM, played):
        found = _guided.peaks(records, CYCLES)
        lowest = np.argmin(np.stack([found[case] for case in CASES]), axis=0) == CASES.index("PD")
        share = lowest.mean(axis=0)
        data[name] = time_series(records)
        numbers[f"{name}.windows_lowest"] = float(lowest.mean())
        claims.append(
            Claim(
                what=f"{name}: the peaks of the external torque are smaller with PD through the experiment.",
                thesis="the same features as Setup A",
                ours=f"PD is the smallest of the five in {100 * share[0]:.0f} % (+q) and {100 * share[1]:.0f} % (-q) "
                f"of {CYCLES} windows",
                gate="in more than half of them, each direction",
                holds=bool(np.all(share > 0.5)),
            )
        )
    return Outcome(
        name="fig-3.9",
        title="Position and external torque, Setup B",
        setting=SETTING + f" {CYCLES} cycles.",
        claims=tuple(claims),
        data=data,
        numbers=numbers,
    )
