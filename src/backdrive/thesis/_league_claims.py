"""The claims of the league: tiers, results on each joint, and the best estimator."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from backdrive.thesis._league_costs import Table, costs_of
from backdrive.thesis._league_joints import NOMINAL, contenders
from backdrive.thesis._league_methods import METHODS
from backdrive.thesis._league_tiers import in_words, significant_pairs, tiers
from backdrive.thesis.outcome import Claim
from backdrive.thesis.scatter import interval

DECAYING = ("P", "PD", "algFC2")
OTHERS = tuple(m.name for m in METHODS if m.guides and "decay" in m.ranges and m.name not in DECAYING)
GUIDES = tuple(m.name for m in METHODS if m.guides)
WITHOUT = ("MOP", "CD")  # contacts without decay


def guiding(table: Table, setting: str = "", joint: str = "") -> dict[str, np.ndarray]:
    """Return the costs of the methods that are meant for a joint moved by hand; as `costs_of`."""
    every = costs_of(table, setting, joint)
    return {name: every[name] for name in GUIDES}


def claims_of(table: Table, estimators: Sequence[dict[str, Any]]) -> tuple[Claim, ...]:
    """Return the claims of the league.

    Args:
        table: of all seeds.
        estimators: of `league_estimators.estimator_table`, one a seed.
    """
    nominal, other = guiding(table, NOMINAL.name), guiding(table)
    first = [set(tiers(costs)[0]) for costs in (nominal, other)]
    both = [name for name in GUIDES if name in first[0] & first[1]]
    tracking = {m: v for m, v in costs_of(table, NOMINAL.name, score="tracking").items()}
    return (
        Claim(
            what="Tiers for guiding by hand, as believed (mean cost over the joints; bare joint 1)",
            ours=in_words(nominal),
            holds=None,
            why="A tier contains the methods that are not separated from its first; their order within the tier has no meaning.",
        ),
        Claim(what="The same where the joint differs from the assumed one", ours=in_words(other), holds=None),
        Claim(
            what="Tiers for tracking at low gains, as believed (bare joint 1)",
            ours=in_words(tracking),
            holds=None,
        ),
        Claim(
            what="Which one to take for guiding by hand: first tier as believed and otherwise",
            thesis="algFC with dither (PD); algFC2 for guiding by hand",
            ours=", ".join(both) if both else "none is in both",
            holds=None,
        ),
        Claim(
            what="The purpose of the decay: the light touch after a dwell, relative to the bare joint, as believed",
            ours=in_words(
                {n: v for n, v in costs_of(table, NOMINAL.name, score="touch").items() if n in GUIDES}
            ),
            holds=None,
        ),
        *(_against(nominal, name) for name in DECAYING),
        *(_on(table, who.name) for who in contenders() if who.name in next(iter(table.values()))),
        _estimator(estimators),
    )


def _against(costs: dict[str, np.ndarray], name: str) -> Claim:
    """Return the claim on a method compared with the contacts without decay, over the seeds."""
    apart = significant_pairs(costs)
    words = {True: "less than", False: "not separated from"}
    return Claim(
        what=f"{name} against the contact without decay, as believed",
        thesis="PD is best (Figs. 3.8, 3.10)" if name == "PD" else "",
        ours="; ".join(
            f"more than {other} ({np.mean(costs[name] - costs[other]):+.3f})"
            if (other, name) in apart
            else f"{words[(name, other) in apart]} {other} ({np.mean(costs[name] - costs[other]):+.3f})"
            for other in WITHOUT
        ),
        holds=None,
    )


def _on(table: Table, joint: str) -> Claim:
    """Return whether the thesis' compensators, tuned, cost less than the bare joint on one joint."""
    costs = guiding(table, NOMINAL.name, joint)
    ends = {name: interval(costs[name]) for name in (*DECAYING, *OTHERS)}
    return Claim(
        what=f"{joint}: P, PD and algFC2, tuned, cost less than the bare joint",
        ours=", ".join(
            f"{name} {np.mean(costs[name]):.2f} [{a:.2f}, {b:.2f}]" for name, (a, b) in ends.items()
        ),
        gate="P, PD, algFC2: 95 % interval over the seeds below 1",
        holds=all(ends[name][1] < 1.0 for name in DECAYING),
    )


def _estimator(tables: Sequence[dict[str, Any]]) -> Claim:
    """Return the best estimator of the external force, by the mean over the seeds."""
    rms: dict[tuple[str, str], list[float]] = {}
    delay: dict[tuple[str, str], list[float]] = {}
    for table in tables:
        for r in table["rows"]:
            rms.setdefault((r["friction"], r["method"]), []).append(r["rms"])
            delay.setdefault((r["friction"], r["method"]), []).append(r["delay"])
    costs = {f"{f} with {m}": np.array(v) for (f, m), v in rms.items()}
    best = min(rms, key=lambda k: float(np.mean(rms[k])))
    plain = min((k for k in rms if k[0] == "none"), key=lambda k: float(np.mean(rms[k])))
    ratios = np.array(rms[best]) / np.array(rms[plain])
    return Claim(
        what=f"Best estimator of the external force, RMS by that of the hand's force, mean over the joints and {len(tables)} seeds",
        ours=f"{' with '.join(best)}: {np.mean(rms[best]):.2f}, delay {1e3 * np.mean(delay[best]):.0f} ms; "
        f"without a friction model at best {np.mean(rms[plain]):.2f} (ratio {ratios.min():.2f} to {ratios.max():.2f} "
        "over the seeds); lowest five: "
        + ", ".join(
            f"{k} {np.mean(costs[k]):.2f}" for k in sorted(costs, key=lambda k: np.mean(costs[k]))[:5]
        ),
        gate="a friction model halves the mean error, and lowers it on every seed",
        holds=bool(np.mean(rms[best]) < 0.5 * np.mean(rms[plain]) and ratios.max() < 1.0),
    )
