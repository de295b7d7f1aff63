"""Torques and wrench of a whole arm without a force sensor, on an independent six-axis arm, by what the model knows.

Twenty arms are drawn (`_arm_scene`: two-mass joints, counts, torque that acts late, elastoplastic friction with a Stribeck peak,
ripple, growth with the transmitted torque). Each is identified by `identify --method arm` from free motion, calibrated on other
free motion, and pushed at the tool while it moves, turns and rests. Shown: RMS of the wrench by method, friction model and state;
the same with friction 20 % too large, inertia 5 % too large, and a payload nobody knows of. Judged: coverage of the 95 % bands, the
width at rest, and the order of the thesis' friction estimators (algFE, CT, HA; Iwatani 2017, Sec. 4.6) on the arm whose friction
is compensated and that a soft hand moves.

    python benchmarks/evidence/arm_force.py [--short] [--bands] [--seed N] [--arms N]
"""

from __future__ import annotations

from collections import defaultdict

import numpy as np
from _arm_force_cells import (
    METHODS,
    STATES,
    covered,
    errors_of,
    estimated,
    logs_of,
    models_of,
    nominal_of,
    thesis_of,
    wrong_models,
)
from _common import Judge, parser

SEEDS = 20
EVENTS = 200  # of calibration a state


class Sums:
    """Sums of squared errors by cell and state."""

    def __init__(self):
        self.cells: dict[str, dict[str, np.ndarray]] = defaultdict(lambda: {s: np.zeros(3) for s in STATES})

    def add(self, cell: str, errors: dict[str, tuple[float, float, int]]) -> None:
        """Add the errors of a log."""
        for state, three in errors.items():
            self.cells[cell][state] += three

    def table(self) -> None:
        """Print RMS of force [N] and moment [N.m] by state."""
        print(
            f"\nRMS of the wrench, force [N] and moment [N.m]:\n{'':48}" + "".join(f"{s:>18}" for s in STATES)
        )
        for cell, states in self.cells.items():
            row = [np.sqrt(states[s][:2] / max(states[s][2], 1)) for s in STATES]
            print(f"{cell:48}" + "".join(f"{f:11.2f} {m:6.2f}" for f, m in row), flush=True)

    def force(self, cell: str, state: str) -> float:
        """Return the RMS of the force [N]."""
        total, _, count = self.cells[cell][state]
        return float(np.sqrt(total / max(count, 1)))


def main() -> None:
    """Draw arms, estimate, and judge."""
    options = parser(__doc__)
    options.add_argument("--seed", type=int, default=500, help="of the first arm")
    options.add_argument("--arms", type=int, default=None, help="how many")
    options.add_argument(
        "--bands", action="store_true", help="bands alone, without tables and friction estimators"
    )
    asked = options.parse_args()
    judge, sums, tables = Judge(), Sums(), not asked.bands
    arms = asked.arms or (1 if asked.short else SEEDS)
    inside: dict[str, list[tuple[int, int, float, float]]] = defaultdict(list)
    thesis: dict[str, list[np.ndarray]] = defaultdict(list)
    for seed in range(asked.seed, asked.seed + arms):
        logs = logs_of(seed, asked.short)
        nominal = nominal_of(logs)
        for name, model in models_of(nominal).items() if tables else ():
            for method in METHODS:
                sums.add(
                    f"{name}, {method}", errors_of(estimated(model, logs, logs.contact, method), logs.contact)
                )
        for name, model in wrong_models(nominal).items() if tables else ():
            sums.add(name, errors_of(estimated(model, logs, logs.contact), logs.contact))
        if tables:
            sums.add(
                "payload of 1 kg, unknown", errors_of(estimated(nominal, logs, logs.loaded), logs.loaded)
            )
        calibrated = estimated(nominal, logs, logs.contact, free=[logs.free])
        for _, state, count, within, width, events in covered(calibrated, logs.contact, logs.arm):
            inside[state].append((count, within, width, events))
        for name, three in thesis_of(logs, nominal, seed).items() if tables else ():
            thesis[name].append(three)
        so_far = (f"{s} {100 * sum(x[1] for x in r) / sum(x[0] for x in r):.1f} %" for s, r in inside.items())
        print(f"arm {seed} done; inside so far: {', '.join(so_far)}", flush=True)
    if tables:
        sums.table()
    print("\nbands of 95 % at the nominal model, pooled over joints and arms:")
    for state in STATES:
        count, within, width, events = np.array(inside[state]).T
        share = within.sum() / count.sum()
        least, most = 100 * np.min(within / count), 100 * np.max(within / count)
        print(
            f"  {state}: {100 * share:.1f} % of {count.sum():.0f} samples, by arm and joint {least:.0f} to {most:.0f} %"
        )
        print(
            f"    width by friction at rest {np.median(width):.2f}; independent events of calibration {events.sum():.0f}"
        )
        if state == "rest":
            judge.that(f"rest: {100 * share:.1f} % inside (at least 95)", share >= 0.95)
            judge.at_most("rest: median width by the friction at rest", float(np.median(width)), 2.2)
        else:
            judge.that(f"{state}: {100 * share:.1f} % inside (90 to 99)", 0.90 <= share <= 0.99)
            if not asked.short:
                judge.that(
                    f"{state}: {events.sum():.0f} independent events (at least {EVENTS})",
                    events.sum() >= EVENTS,
                )
    if not tables:
        judge.end()
    print(
        "\ncompensated arm moved by a hand: RMS of force held [N], of torques held, and after hands off [N.m]:"
    )
    mean = {name: np.mean(rows, axis=0) for name, rows in thesis.items()}
    for name, three in mean.items():
        print(f"  {name:6} {three[0]:6.2f} {three[1]:6.2f} {three[2]:6.2f}")
    judge.that(
        "held, moved and let go: algFE's torques are no worse than CT's", mean["algFE"][1] <= mean["CT"][1]
    )
    judge.that("... and CT's no worse than HA's", mean["CT"][1] <= mean["HA"][1])
    judge.that(
        "after hands off HA keeps the largest offset", mean["HA"][2] > max(mean["algFE"][2], mean["CT"][2])
    )
    print()
    judge.that(
        "moving: the curve with load is no worse than without friction, by every method",
        all(
            sums.force(f"curve and load, {m}", "moving") < sums.force(f"none, {m}", "moving") for m in METHODS
        ),
    )
    judge.end()


if __name__ == "__main__":
    main()
