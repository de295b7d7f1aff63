"""The smallest bias that each figure of the thesis notices, when it is patched into what the figure measures.

A figure is run as it is, and then with the measured quantity times 1 + b: identified friction, the force of the hand as sensor and
record give it, displacement, tracking error, stroke. It notices b where a check of its own fails or a statement comes out
otherwise than the ledger says, with b and with -b. Found by bisection. Required: at most 5 % for what is identified or follows a
closed form, 20 % for forces of the hand, and nothing noticed without a bias. The patches live here; the product has no such option.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from types import ModuleType
from typing import Any
from unittest import mock

import numpy as np
from _common import Judge, parser

from backdrive.laws import Law
from backdrive.thesis import (
    _hand_guiding,
    _manual,
    _release_admittance,
    _release_compensation,
    _square,
    _sweeps,
    _tracking,
    fig_2_2,
    fig_3_3,
    fig_3_4,
    fig_3_6,
    fig_4_7,
    fig_4_8,
    fig_4_9,
)
from backdrive.thesis.ledger import disagreements, evaluate
from backdrive.tuning.facts import scale_rate

IDENTIFICATION, FORCE = 0.05, 0.20  # the largest bias that may go unnoticed [-]
STEPS = 3  # of the bisection
Patch = Callable[[float], Any]


def sensor(*modules: ModuleType) -> Patch:
    """Return a patch that scales the force of the hand in every record that these modules play."""

    def patch(bias: float) -> Any:
        stack = ExitStack()
        for module in modules:
            own = module.play

            def play(scenes: Any, *, own: Any = own, **more: Any) -> Any:
                records = own(scenes, **more)
                many = records if isinstance(records, list) else [records]
                wrong = [
                    replace(r, sensed=(1.0 + bias) * r.sensed, force=(1.0 + bias) * r.force) for r in many
                ]
                return wrong if isinstance(records, list) else wrong[0]

            stack.enter_context(mock.patch.object(module, "play", play))
        return stack

    return patch


def square(bias: float) -> Any:
    """Scale the force sensor of the arm's hand."""
    own = _square.lead_around

    def led(*given: Any, **more: Any) -> Any:
        guided = own(*given, **more)
        return replace(guided, sensed=(1.0 + bias) * guided.sensed)

    return mock.patch.object(_square, "lead_around", led)


def both_hands(bias: float) -> Any:
    """Scale the force sensor of the square and of single strokes."""
    stack = ExitStack()
    stack.enter_context(square(bias))
    stack.enter_context(sensor(_hand_guiding)(bias))
    return stack


def knots(bias: float) -> Any:
    """Scale the friction that every sweep of chapter 2 finds."""
    own = _sweeps.sweep_knots

    def sweep_knots(*given: Any, **more: Any) -> Any:
        found = own(*given, **more)
        more_friction = 0.5 * bias * (found.F_pos + found.F_neg)
        return replace(found, F_pos=found.F_pos + more_friction, F_neg=found.F_neg + more_friction)

    return mock.patch.object(_sweeps, "sweep_knots", sweep_knots)


def identification(bias: float) -> Any:
    """Scale the friction that the sweeps of chapters 3 and 4 find."""
    own = fig_3_4.sweep_of

    def sweep_of(*given: Any, **more: Any) -> Any:
        found = own(*given, **more)
        joint = found.model.joints[0]
        law = Law(rate=scale_rate(joint.law.rate, 1.0 + bias, 2.0), element=joint.law.element)
        return replace(found, model=replace(found.model, joints=(replace(joint, law=law),)))

    return mock.patch.object(fig_3_4, "sweep_of", sweep_of)


def displacement(module: ModuleType) -> Patch:
    """Return a patch that scales the motor's displacement."""

    def patch(bias: float) -> Any:
        own = module.drive

        def drive(*given: Any, **more: Any) -> Any:
            out, rest = own(*given, **more)
            out = np.array(out)
            out[:, 0] *= 1.0 + bias
            return out, rest

        return mock.patch.object(module, "drive", drive)

    return patch


def tracking(bias: float) -> Any:
    """Scale the tracking error."""
    own = _tracking.play

    def play(scenes: Any, **more: Any) -> Any:
        return [
            replace(r, reading=r.wanted - (1.0 + bias) * (r.wanted - r.reading)) for r in own(scenes, **more)
        ]

    return mock.patch.object(_tracking, "play", play)


def stroke(bias: float) -> Any:
    """Scale the stroke of the planned sweep."""
    own = fig_2_2.plan
    return mock.patch.object(fig_2_2, "plan", lambda A, **more: own((1.0 + bias) * A, **more))


#: Figure -> what is wrong, its patch, the largest bias that may go unnoticed.
CASES: dict[str, tuple[str, Patch, float]] = {
    "fig-2.2": ("stroke", stroke, IDENTIFICATION),
    **{
        f"{name}": ("identified friction", knots, IDENTIFICATION)
        for name in ("fig-2.3", "fig-2.6", "fig-2.7", "fig-2.8", "fig-2.9", "table-2.2")
    },
    "fig-2.11": ("hand's force", sensor(_manual), FORCE),
    "fig-2.12": ("hand's force", sensor(_manual), FORCE),
    "fig-2.13": ("tracking error", tracking, IDENTIFICATION),
    "fig-2.14": ("tracking error", tracking, IDENTIFICATION),
    "fig-3.3": ("displacement", displacement(fig_3_3), IDENTIFICATION),
    "fig-3.4": ("identified friction", identification, IDENTIFICATION),
    "fig-3.6": ("displacement", displacement(fig_3_6), IDENTIFICATION),
    "fig-3.7": ("hand's force", sensor(_hand_guiding), FORCE),
    "fig-3.8": ("hand's force", sensor(_hand_guiding), FORCE),
    "fig-3.9": ("hand's force", square, FORCE),
    "fig-3.10": ("hand's force", both_hands, FORCE),
    "fig-3.11": ("hand's force", sensor(_release_compensation), FORCE),
    "fig-4.3": ("identified friction", identification, IDENTIFICATION),
    "fig-4.7": ("hand's force", sensor(fig_4_7), FORCE),
    "fig-4.8": ("hand's force", sensor(fig_4_8), FORCE),
    "fig-4.9": ("hand's force", sensor(fig_4_9), FORCE),
    "fig-4.10": ("hand's force", sensor(fig_4_8), FORCE),
    "fig-4.11": ("hand's force", sensor(_release_admittance), FORCE),
}
#: Figures whose runs are shortened, for every look takes them anew: constant -> value.
SHORTENED: dict[str, dict[str, Any]] = {
    "fig-3.9": {"ROUNDS": 6},
    "fig-3.10": {"ROUNDS": 6},
}
QUICK = ("fig-2.2", "fig-2.3", "fig-2.6", "fig-2.9", "table-2.2", "fig-3.3", "fig-3.4", "fig-3.6", "fig-3.8")


@contextmanager
def fresh() -> Iterator[None]:
    """Forget what figures share, before and after."""
    shared = (_manual.curves, _manual.by_hand, _tracking.by_joint, _square.by_case)
    for each in shared:
        each.cache_clear()
    yield
    for each in shared:
        each.cache_clear()


def speaks(name: str, patch: Patch, bias: float, seed: int) -> list[str]:
    """Return what a figure says is wrong: checks of its own that fail, statements that come out otherwise."""
    module = importlib.import_module(f"backdrive.thesis.{name.replace('-', '_').replace('.', '_')}")
    with fresh(), ExitStack() as stack:
        for constant, value in SHORTENED.get(name, {}).items():
            stack.enter_context(mock.patch.object(module, constant, value))
        if bias:
            stack.enter_context(patch(bias))
        outcome = module.run(seed=seed)
    failed = [c.what for c in outcome.claims if c.holds is False and not c.statement]
    return [*failed, *disagreements(evaluate([outcome]))]


def smallest(name: str, patch: Patch, largest: float, seed: int, steps: int) -> tuple[float, str]:
    """Return the smallest bias that is noticed with either sign, infinite where the largest is not, and what notices it."""

    def noticed(bias: float) -> str:
        words = []
        for sign in (1.0, -1.0):
            said = speaks(name, patch, sign * bias, seed)
            if not said:
                return ""
            words.append(said[0])
        return words[0]

    by = noticed(largest)
    if not by:
        return np.inf, "nothing"
    low, high = 0.0, largest
    for _ in range(steps):
        middle = 0.5 * (low + high)
        said = noticed(middle)
        if said:
            high, by = middle, said
        else:
            low = middle
    return high, by


def main() -> None:
    """Patch, look, judge."""
    made = parser(__doc__)
    made.add_argument("--only", nargs="*", default=[], help="names of figures")
    made.add_argument("--seed", type=int, default=0)
    given = made.parse_args()
    names = given.only or (QUICK if given.short else list(CASES))
    judge = Judge()
    for name in names:
        what, patch, largest = CASES[name]
        said = speaks(name, patch, 0.0, given.seed)
        judge.that(f"{name} as it is: {len(said)} checks or statements are off {said}", not said)
        least, by = smallest(name, patch, largest, given.seed, STEPS)
        judge.at_most(
            f"{name}, {what}: noticed from {100 * least:.2f} % on ('{by[:70]}')",
            100 * least,
            100 * largest,
            "%",
        )
    judge.end()


if __name__ == "__main__":
    main()
