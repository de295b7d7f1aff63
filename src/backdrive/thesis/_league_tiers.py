"""Tiers of methods that differ significantly over the seeds, by paired differences, Student's t and Holm's step-down over all
pairs.

S. Holm, Scand. J. Statist. 6, 65-70, 1979: with the probabilities of m pairs in rising order, the i-th (from 0) counts while it
and all before it are at most level/(m - i).
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations

import numpy as np

LEVEL = 0.05  # probability that scatter alone separates any pair [-]


def holm(p: np.ndarray, level: float = LEVEL) -> np.ndarray:
    """Return which of many probabilities count, by Holm's step-down, (m,).

    Args:
        p: two-sided, (m,).
        level: of all together [-].
    """
    order = np.argsort(p)
    passed = np.asarray(p)[order] <= level / (len(order) - np.arange(len(order)))
    first = int(np.argmin(passed)) if not passed.all() else len(order)
    result = np.zeros(len(order), dtype=bool)
    result[order[:first]] = True
    return result


def t_test(a: np.ndarray, b: np.ndarray) -> float:
    """Return the two-sided probability of a mean difference without one, by Student's t over the same seeds, (n,) each."""
    from scipy.special import stdtr

    d = np.asarray(a, dtype=np.float64) - np.asarray(b, dtype=np.float64)
    spread = float(d.std(ddof=1)) / np.sqrt(d.size)
    if spread == 0.0:
        return 1.0 if float(d.mean()) == 0.0 else 0.0
    return float(2.0 * stdtr(d.size - 1, -abs(float(d.mean())) / spread))


def significant_pairs(costs: Mapping[str, np.ndarray], level: float = LEVEL) -> set[tuple[str, str]]:
    """Return the pairs of which the first is significantly smaller than the second.

    Args:
        costs: name -> one a seed, (n,), n >= 2, the same seeds for all.
        level: as in `holm`.
    """
    pairs = list(combinations(costs, 2))
    p = np.array([t_test(costs[a], costs[b]) for a, b in pairs])
    return {
        (a, b) if np.mean(costs[a]) < np.mean(costs[b]) else (b, a)
        for (a, b), counts in zip(pairs, holm(p, level), strict=False)
        if counts
    }


def tiers(costs: Mapping[str, np.ndarray], level: float = LEVEL) -> list[list[str]]:
    """Return tiers, the best first. Each contains the best of the remaining methods and all that are not separated from it.

    Members of a tier are tied with its first; two of them may be separated from each other.

    Args:
        costs: as in `significant_pairs`.
        level: as in `holm`.
    """
    apart = significant_pairs(costs, level)
    left = sorted(costs, key=lambda name: float(np.mean(costs[name])))
    found = []
    while left:
        tier = [name for name in left if name == left[0] or (left[0], name) not in apart]
        found.append(tier)
        left = [name for name in left if name not in tier]
    return found


def in_words(costs: Mapping[str, np.ndarray], level: float = LEVEL) -> str:
    """Return tiers in words, ties as ties: `1: P 0.52 = PD 0.53; 2: MOP 0.61`."""
    return "; ".join(
        f"{i}: " + " = ".join(f"{name} {np.mean(costs[name]):.3f}" for name in tier)
        for i, tier in enumerate(tiers(costs, level), 1)
    )


def reversals(one: Mapping[str, np.ndarray], other: Mapping[str, np.ndarray]) -> list[tuple[str, str]]:
    """Return the pairs that two sets of seeds separate in opposite order."""
    second = significant_pairs(other)
    return sorted((a, b) for a, b in significant_pairs(one) if (b, a) in second)
