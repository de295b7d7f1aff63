"""The league's cost: the hand's force with a compensator relative to the bare joint in the same setting."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from backdrive.thesis._league_joints import SETTINGS, Contender, contenders

FORCES = ("stiff_peak", "stiff_rms", "soft_peak", "soft_rms", "dwell", "touch")
RESTLESS = 0.4  # weight of restlessness, beside the mean relative force [-]

Scores = Mapping[str, float]
#: seed -> joint -> method -> setting -> scores
Table = dict[int, dict[str, dict[str, dict[str, dict[str, float]]]]]


def restless(who: Contender, found: Scores) -> float:
    """Return the penalty for motion at rest: 1 for a limit cycle of 2 % of the stroke, or of a tenth after release."""
    return min(found["cycle"] / (0.02 * who.stroke), 5.0) + min(
        found["fluctuation"] / (0.1 * who.stroke), 5.0
    )


def cost(who: Contender, found: Scores, bare: Scores) -> float:
    """Return the cost to minimise: the mean of the hand's forces relative to the bare joint, plus restlessness; 1 for the
    bare joint.

    Args:
        who: the joint.
        found: scores of a method.
        bare: scores of the bare joint in the same setting.
    """
    return float(np.mean([found[name] / bare[name] for name in FORCES])) + RESTLESS * restless(who, found)


def costs_of(table: Table, setting: str = "", joint: str = "", score: str = "") -> dict[str, np.ndarray]:
    """Return the cost of every method by seed, (seeds,), each setting against the bare joint of the same setting.

    Args:
        table: of seeds.
        setting: one; empty: the mean over all but the believed one.
        joint: one; empty: the mean over all.
        score: one of the scores by the bare joint's, `tracking`; empty: `cost`.
    """
    settings = [setting] if setting else [s.name for s in SETTINGS[1:]]
    result: dict[str, list[float]] = {}
    for rows in table.values():
        joints = [who for who in contenders() if who.name in rows and joint in ("", who.name)]
        for method in rows[joints[0].name]:
            each = []
            for who in joints:
                for name in settings:
                    found, bare = rows[who.name][method][name], rows[who.name]["NC"][name]
                    each.append(found[score] / bare[score] if score else cost(who, found, bare))
            result.setdefault(method, []).append(float(np.mean(each)))
    return {method: np.array(values) for method, values in result.items()}
