"""The league: every compensator on every joint, tuned with the same budget, and judged on joints that differ from the assumed
ones.

The true joint differs from the compensator's data. It has more friction in slow motion, its own presliding stiffness, friction
on the far side of the transmission, torque ripple, noise, and one tick of delay. The integration step is 50 us. For each method
the same number of settings is drawn and simulated in the same scenes. The best setting by one cost is kept; the cost also
requires stability with 20 % less friction. It is then judged with other seeds and disturbances. All of this is repeated for
every seed, so the scatter over seeds includes the effect of the random settings. Comparisons of two methods use paired
differences (`_league_tiers`). The estimators are judged in `league_estimators`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from backdrive.control import BareLoop, JointLoop
from backdrive.simulation.closed_loop import play
from backdrive.thesis import _league_joints as joints_
from backdrive.thesis._league_claims import claims_of
from backdrive.thesis._league_costs import RESTLESS, Scores, Table, cost, costs_of, restless
from backdrive.thesis._league_joints import EPISODES, NOMINAL, SETTINGS, Contender, Setting
from backdrive.thesis._league_methods import METHODS, Method
from backdrive.thesis._league_plots import draw
from backdrive.thesis.league_estimators import estimator_table
from backdrive.thesis.outcome import Outcome

__all__ = ["BUDGET", "SEEDS", "draw", "run"]

BUDGET = 10  # settings that every method tries on every joint
SEEDS = 10
LESS = SETTINGS[2]
CALM = ("release", "knock")  # scenes that show restlessness


def best_settings(who: Contender, method: Method, budget: int, bare: Scores, seed: int) -> dict[str, float]:
    """Return the best of the settings that a method may try."""
    drawn = method.draw(budget, seed)
    if not method.guides:
        tried = score(who, method, drawn, NOMINAL, seed, ("tracking",))
        return drawn[int(np.argmin([t["tracking"] for t in tried]))]
    tried = score(who, method, drawn, NOMINAL, seed, EPISODES[:-1])
    scenes = [s for z in drawn for s in joints_.scenes(who, _loop(who, method, z), LESS, seed, CALM)]
    records = play(scenes)
    calm = [restless(who, joints_.shaking(who, *records[i : i + 2])) for i in range(0, len(records), 2)]
    return drawn[
        int(np.argmin([cost(who, t, bare) + RESTLESS * c for t, c in zip(tried, calm, strict=False)]))
    ]


def _loop(who: Contender, method: Method, z: Mapping[str, float]) -> JointLoop:
    return BareLoop(compensator=method.make(who, z), limit=3.0 * who.coulomb)


def score(
    who: Contender,
    method: Method,
    numbers: Sequence[Mapping[str, float]],
    setting: Setting,
    seed: int,
    names: Sequence[str] = EPISODES,
) -> list[dict[str, float]]:
    """Return the scores of a method with several settings of its numbers, in the scenes of these names."""
    records = play(
        [s for z in numbers for s in joints_.scenes(who, _loop(who, method, z), setting, seed, names)]
    )
    n = len(names)
    return [
        joints_.scores(who, dict(zip(names, records[i : i + n], strict=False)))
        for i in range(0, len(records), n)
    ]


def one_seed(seed: int, budget: int = BUDGET, joints: int = 4) -> dict[str, dict[str, Any]]:
    """Return the scores of every method on every joint in every setting, tuned anew."""
    result: dict[str, dict[str, Any]] = {}
    for who in joints_.contenders()[:joints]:
        bare = score(who, METHODS[0], [{}], NOMINAL, seed)[0]
        row: dict[str, Any] = {}
        for method in METHODS:
            numbers = best_settings(who, method, budget, bare, seed)
            scenes = [
                s for x in SETTINGS for s in joints_.scenes(who, _loop(who, method, numbers), x, seed + 1)
            ]
            records, n = play(scenes), len(EPISODES)
            row[method.name] = {
                setting.name: joints_.scores(
                    who, dict(zip(EPISODES, records[n * i : n * i + n], strict=False))
                )
                for i, setting in enumerate(SETTINGS)
            }
        result[who.name] = row
    return result


def run(
    seed: int = 0,
    seeds: int = SEEDS,
    budget: int = BUDGET,
    joints: int = 4,
    say: Callable[[str], None] = lambda sentence: None,
) -> Outcome:
    """Tune every compensator on every joint for every seed, judge it, and say which differ.

    Args:
        seed: the first; of noises, strokes and draws.
        seeds: how many, at least 2.
        budget: settings that every method tries.
        joints: how many, Setup A first.
        say: told what is going on.
    """
    table: Table = {}
    for i in range(seeds):
        say(f"The league, seed {i + 1} of {seeds}")
        table[seed + 100 * i] = one_seed(seed + 100 * i, budget, joints)
    say("The league, estimators")
    estimators = [estimator_table(seed + 100 * i, joints) for i in range(min(seeds, 2))]
    return Outcome(
        name="league",
        title="Which compensator, which estimator: all of them on the same joints",
        setting=(
            f"Setup A and Joints 0 to 2. For each of {seeds} seeds from {seed}, every method tries {budget} settings anew. The "
            "true joint has more break-away torque, a presliding stiffness, ripple, noise and delay, which the methods do not "
            "know. Hands of twice and half the stiffness, a dwell of the hand, a light touch after it; every setting against the "
            "bare joint of the same setting. Pairs are separated at 5 % of all together (paired t, Holm)."
        ),
        claims=claims_of(table, estimators),
        data={"table": table, "estimators": estimators},
        numbers={
            f"{name}/{words}": float(np.mean(values))
            for words, setting in (("as believed", NOMINAL.name), ("otherwise", ""))
            for name, values in costs_of(table, setting).items()
        },
    )
