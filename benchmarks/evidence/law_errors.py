"""Stated 95 % intervals of a law's parameters where the law is not quite that of the joint, by an independent generator.

The joints (`_independent.py`) have a Stribeck peak, and cross zero by an elastoplastic bristle or a smooth curve; no law of the
package is exactly that. `identify` is asked for Stribeck's law, and to choose one (`auto`). Of every parameter that is stated with
an error, and means the same in both: the share of truths inside the 95 % interval, and the share beyond three stated errors. The
same of the curve that `identify` finds by motion, and of a straight line, from the lowest speed that it states on: of slow speeds,
below a tenth of the top one, and others.

Not counted: a law whose break-away friction is said to be impossible, and numbers that are said not to be identifiable.

    python benchmarks/evidence/law_errors.py --jobs 8
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import multiprocessing
from collections import Counter, defaultdict
from dataclasses import replace
from typing import Any

import numpy as np
from _common import Judge, first_seed, parser
from _coverage_cells import to_log
from _coverage_conditions import draw, logger
from _independent import Record, multisine, record

from backdrive import identify
from backdrive.errors import BackdriveError

INSIDE, BEYOND = 0.80, 0.10  # least share inside the 95 % interval, largest share beyond three errors
WHOLE = 120  # logs of a whole run
FEWEST = 30  # numbers below which a row is not judged
SLOW = 0.1  # below this share of the top speed a speed is slow [-]
CROSSED = 4.0  # widths of a smooth crossing of zero, below which its level is no sliding friction [-]
SECONDS, RATES = 30.0, (200.0, 500.0, 1000.0)
CURVES = {"curve by motion": {"method": "motion"}, "curve of a line": {"law": "coulomb-viscous"}}
LAWS = ("stribeck-gauss", "auto", *CURVES)


def made(seed: int) -> Record:
    """Return the log of a joint with a Stribeck peak."""
    rng = np.random.default_rng([29, seed])
    top = rng.uniform(1.0, 3.0)
    joint = draw(rng, top)
    peak = joint.coulomb * rng.uniform(0.2, 0.7)
    joint = replace(joint, peak=peak, peak_speed=top * 10.0 ** rng.uniform(-1.5, -0.7))
    rate = float(rng.choice(RATES))
    return record(joint, multisine(SECONDS, top, rng), logger(joint, rng, rate=rate), rng)


def numbers(job: tuple[int, str]) -> tuple[str, str, list[tuple[str, float, float]]]:
    """Return what was asked for, what came of it, and name, error and half of the interval of every number."""
    seed, law = job
    log = made(seed)
    joint = log.joint
    if law in CURVES:
        return law, *of_curve(log, CURVES[law])
    try:
        result = identify(to_log(log), law=law)
    except BackdriveError as error:
        return law, f"refused: {error.message[:40]}", []
    friction = result.model.joints[0]
    if any("physically impossible" in said for said in friction.warnings):
        return law, "said to be impossible", []
    rate: Any = friction.law.rate
    truth = {"coulomb": joint.coulomb, "viscous": joint.viscous, "inertia": joint.inertia}
    if rate.NAME.startswith("stribeck"):
        truth |= {"breakaway": joint.coulomb + joint.peak}
    if rate.NAME == "stribeck-gauss":
        truth |= {"stribeck_velocity": joint.peak_speed}
    if rate.NAME not in ("stribeck-gauss", "stribeck-tustin"):
        truth = {"inertia": joint.inertia}  # other numbers mean something else
    silent = {name for name in truth if any(f"'{name}' is not identifiable" in w for w in friction.warnings)}
    values = {**friction.law.rate.values(), "inertia": friction.dynamics["inertia"].value}
    intervals = result.intervals[friction.joint.name]
    found = []
    for name, true in truth.items():
        if name in silent or name not in intervals:
            continue
        low, high = intervals[name]
        half = high - values[name] if true > values[name] else values[name] - low
        found.append((name, float(values[name] - true), float(half)))
    return law, f"{rate.NAME}+{friction.law.element.NAME}", found


def of_curve(log: Record, options: dict[str, str]) -> tuple[str, list[tuple[str, float, float]]]:
    """Return the curve's law, and name, error and half of the interval of every speed."""
    joint = log.joint
    try:
        result = identify(to_log(log), **options)
    except BackdriveError as error:
        return f"refused: {error.message[:40]}", []
    friction, curve = result.model.joints[0], result.evidence[0].curve
    lowest = friction.validity.lowest_speed or 0.0
    if joint.crossing == "stribeck":
        lowest = max(lowest, CROSSED * joint.width)
    constant = 0.0 if "offset" in friction.dynamics else joint.offset
    found, top = [], float(np.abs(curve.velocity).max())
    for velocity, torque, error in zip(curve.velocity, curve.torque, curve.standard_error, strict=True):
        if abs(velocity) >= max(lowest, 1e-9) and np.isfinite(error):
            true = float(joint.sliding(np.array([velocity]))[0]) + constant
            name = "slow speeds" if abs(velocity) < SLOW * top else "other speeds"
            found.append((name, float(torque - true), 1.96 * float(error)))
    return friction.law.rate.NAME, found


def main() -> None:
    """Identify every log, print the tables, judge them."""
    options = parser(__doc__)
    options.add_argument("--logs", type=int, default=WHOLE, help="logs")
    options.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes")
    options.add_argument("--seed", type=int, help="first seed; a fresh one by default")
    asked = options.parse_args()
    count = min(asked.logs, 6) if asked.short else asked.logs
    first, judge = first_seed(asked.seed), Judge()
    jobs = [(first + k, law) for k in range(count) for law in LAWS]
    rows: dict[tuple[str, str], list[tuple[float, float]]] = defaultdict(list)
    outcome: dict[str, Counter[str]] = defaultdict(Counter)
    numbers(jobs[0])  # compiles before the processes part
    with multiprocessing.get_context("fork").Pool(asked.jobs) as pool:
        for law, what, found in pool.imap_unordered(numbers, jobs):
            outcome[law][what] += 1
            for name, error, half in found:
                rows[law, name].append((error, half))
    for law, counts in outcome.items():
        print(f"{law}: {', '.join(f'{n} {what}' for what, n in counts.most_common())}")
    for (law, name), row in sorted(rows.items()):
        error, half = np.array(row).T
        inside, beyond = np.mean(np.abs(error) <= half), np.mean(np.abs(error) > 3.0 / 1.96 * half)
        sentence = f"{law}, {name}: {100 * inside:.0f} % of {len(row)} inside, {100 * beyond:.0f} % beyond three errors"
        if len(row) < FEWEST:
            print(f"        {sentence} (too few to judge)")
        else:
            judge.that(
                f"{sentence} (at least {100 * INSIDE:.0f} %, at most {100 * BEYOND:.0f} %)",
                bool(inside >= INSIDE and beyond <= BEYOND),
            )
    judge.end()


if __name__ == "__main__":
    main()
