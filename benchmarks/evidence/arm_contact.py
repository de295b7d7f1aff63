"""Contacts by a threshold for one false alarm an hour: how many come in free motion that nothing was tuned on, and steps noticed.

Threshold by state of motion, calibrated on hours of free motion of the same joints (its tail: generalised Pareto over a high
threshold), for one false contact an hour of all joints together. Judged on other free motion of 20 hours: at most 2 an hour. Steps
of 1.5 thresholds of the state, the joint moving, both ways: noticed within 50 ms, the estimator's lag included, in 95 %.

`joint`: one joint of `_independent`, its model identified from one sweep. `arm`: the six-axis arm of `_arm_scene`, its model
identified by `--method arm` from its free motion; each step is a wrench at the tool that pushes along one joint. `ur3`: a real
UR3 that nothing touches, contacts counted on id2 and prbs; the upper bound of the rate is Poisson's.

    python benchmarks/evidence/arm_contact.py [--short] [--only joint,arm,ur3] [--hours H] [--calibrate H] [--jobs 2] [--seed N]

`--short` judges minutes, not hours, of the arm, and falls short only where the exact interval of the rate lies above the limit.
`--hours` judges so many, `--calibrate` takes so many of the arm. A simulated hour of the arm takes some 30 s of one core, the
whole program a quarter of an hour.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from _common import Judge, data, first_seed, parser
from _contact_joint import BLOCK, LENGTH, NAME, free, identification, stepped
from scipy.stats import chi2

from backdrive import FrictionModel, Log, identify
from backdrive.external import ForceEstimate, Threshold, estimate_force
from backdrive.external.calibrate import Calibration, calibrate
from backdrive.external.contacts import half_bands, mark_contacts, with_contacts
from backdrive.external.estimate import CONTACTS as LEAST
from backdrive.external.result import STATES
from backdrive.logs.readers import read_log

HOURS = {False: (5.0, 20.0, 300), True: (1.0, 2.0, 60)}  # short -> of calibration, of judging, and steps
OF_THE_ARM = {False: (4.0, 20.0, 200), True: (0.1, 0.1, 10)}  # the same
RATE, MOST = 1.0, 2.0  # false contacts, wanted and allowed [1/h]
STEP, WITHIN, SHARE = 1.5, 0.05, 0.95  # thresholds, [s], of the steps


def poisson(count: int, hours: float, level: float = 0.95) -> tuple[float, float]:
    """Return the exact two-sided interval of a rate by its count [1/h]."""
    tail = 0.5 * (1.0 - level)
    low = 0.5 * chi2.ppf(tail, 2 * count) if count else 0.0
    return float(low / hours), float(0.5 * chi2.ppf(1.0 - tail, 2 * count + 2) / hours)


def one_estimate(model: FrictionModel, log: Log, how: dict) -> ForceEstimate:
    """Return an estimate as in the calibration."""
    return estimate_force(model, log, **how)


def thresholds(
    model: FrictionModel, hours: float, rng: np.random.Generator
) -> tuple[Calibration, ForceEstimate, dict]:
    """Return what hours of free motion calibrate, and how the estimates are made, by the command's own choice."""
    logs = [free(rng)]
    chosen = estimate_force(model, logs[0], free=logs, false_alarms=RATE).joints[0]
    how = {"method": chosen.method, "bandwidth": chosen.bandwidth}
    estimates = [one_estimate(model, logs.pop(), how)]
    while len(estimates) * BLOCK < hours * 3600.0:
        estimates.append(one_estimate(model, free(rng), how))
    calibration = calibrate([e.joints[0] for e in estimates])
    first = replace(estimates[0], joints=calibration.forces[:1], calibrations={NAME: calibration})
    return calibration, with_contacts(first, RATE), how


def table(marks: Sequence[Threshold], halves: Mapping[str, list[float]], unit: str) -> None:
    """Print thresholds by joint and state."""
    print(
        f"  {'joint':22s}{'state':10s}{'half band':>14s}{'threshold, bands':>18s}{'between':>16s}{'peaks':>7s}{'hours':>8s}"
    )
    for t in marks:
        half, ends = halves[t.joint][STATES.index(t.state)], f"{t.interval[0]:.2f} {t.interval[1]:.2f}"
        print(
            f"  {t.joint:22s}{t.state:10s}{half:10.3f} {unit}{t.bands:18.2f}{ends:>16s}{t.peaks:7d}{t.hours:8.2f}"
        )


def false_contacts(
    model: FrictionModel,
    calibration: Calibration,
    marks: tuple[Threshold, ...],
    how: dict,
    hours: float,
    rng: np.random.Generator,
) -> tuple[int, float, np.ndarray]:
    """Return the contacts of unseen free motion, its hours, and the share within the bands by state."""
    count, duration, inside = 0, 0.0, np.zeros((3, 2))
    while duration < hours:
        e = one_estimate(model, free(rng), how)
        one = calibration.apply(e.joints[0])
        marked = mark_contacts(replace(e, joints=(one,)), marks)
        count += len(marked.contacts or ())
        duration += (one.time[-1] - one.time[0]) / 3600.0
        for state in range(3):
            part = one.state == state
            inside[state] += np.count_nonzero(part & ~one.outside), np.count_nonzero(part)
    return count, duration, inside[:, 0] / np.maximum(inside[:, 1], 1.0)


def noticed(
    model: FrictionModel,
    calibration: Calibration,
    marks: tuple[Threshold, ...],
    how: dict,
    steps: int,
    rng: np.random.Generator,
) -> np.ndarray:
    """Return how late steps were noticed [s], infinite where never, (k,)."""
    height = STEP * marks[0].bands * (calibration.moving.half_width if calibration.moving else np.nan)
    lag = calibration.forces[0].lag
    late: list[float] = []
    while len(late) < steps:
        seed = int(rng.integers(2**31))
        dry, instants = stepped(np.random.default_rng(seed), 300.0, None)
        heights = height * rng.choice([-1.0, 1.0], instants.size)
        wet, _ = stepped(np.random.default_rng(seed), 300.0, heights)
        still = one_estimate(model, dry, how).joints[0]
        e = one_estimate(model, wet, how)
        marked = mark_contacts(replace(e, joints=(calibration.apply(e.joints[0]),)), marks)
        begins = np.array([c.begin for c in marked.contacts or ()]) + (0.0 if np.isnan(lag) else lag)
        for t in instants[
            still.state[np.searchsorted(still.time, instants).clip(0, still.time.size - 1)] == 0
        ]:
            after = begins[(begins >= t) & (begins < t + LENGTH)]
            late.append(float(after.min() - t) if after.size else np.inf)
    return np.array(late)


def conclude(judge: Judge, name: str, count: int, hours: float, short: bool) -> None:
    """Print and judge the rate of false contacts."""
    low, high = poisson(count, hours)
    rate = f"{count} false contacts in {hours:.2f} h, {count / hours:.2f} an hour (exactly {low:.2f} to {high:.2f})"
    judge.that(f"{name}: {rate}, at most {MOST:g}", (low if short else count / hours) <= MOST)


def conclude_steps(judge: Judge, name: str, late: np.ndarray) -> None:
    """Print and judge how late steps were noticed [s], infinite where never."""
    reached, hit = np.isfinite(late), int(np.count_nonzero(late <= WITHIN))
    print(
        f"  steps of {STEP:g} thresholds, moving: {np.median(late[reached]) * 1e3:.0f} ms in the median, "
        f"{np.count_nonzero(~reached)} of {late.size} never"
    )
    share = f"{hit} of {late.size} steps within {1e3 * WITHIN:.0f} ms, {100 * hit / late.size:.1f} %"
    judge.that(f"{name}: {share} (at least 95 %)", hit >= SHARE * late.size)


def single_joint(judge: Judge, short: bool, hours: float | None, seed: int) -> None:
    """Judge a single joint."""
    calibrating, judging, steps = HOURS[short]
    rng = np.random.default_rng(seed)
    begun = time.perf_counter()
    model = identify(identification(rng)).model
    calibration, reference, how = thresholds(model, calibrating, rng)
    marks, unit = reference.thresholds, reference.joints[0].joint.torque_unit
    print(
        f"\nsingle joint: {how['method']}, {how['bandwidth']:.3g} 1/s; free motion of {calibration.duration / 3600.0:.2f} h"
    )
    table(marks, {NAME: half_bands(calibration.forces[0])}, unit)
    for sentence in reference.remarks:
        print(f"  {sentence}")
    count, spent, shares = false_contacts(model, calibration, marks, how, hours or judging, rng)
    print(
        f"  unseen free motion within the 95 % band: {' '.join(f'{100 * s:.1f} %' for s in shares)} (moving, reversing, rest)"
    )
    conclude(judge, "joint", count, spent, short)
    conclude_steps(judge, "joint", noticed(model, calibration, marks, how, steps, rng))
    print(f"  {time.perf_counter() - begun:.0f} s")


def six_joints(
    judge: Judge, short: bool, given: tuple[float | None, float | None], seed: int, jobs: int
) -> None:
    """Judge the six-axis arm."""
    from _contact_arm import BLOCK as OF_ARM
    from _contact_arm import Cell, folder, free_forces, identified
    from _contact_arm import free as free_arm

    calibrating, judging, steps = OF_THE_ARM[short]
    calibrating, judging = given[0] or calibrating, given[1] or judging
    begun = time.perf_counter()
    with folder() as place:
        home = Path(place)
        identified(home, seed)
        first = Cell(home, {"least": LEAST}).forces(free_arm(seed + 1))[0]
        how = {"method": first.method, "bandwidth": first.bandwidth}
        blocks = max(2, round(calibrating * 3600.0 / OF_ARM))
        parts = list(free_forces(home, how, range(seed + 10, seed + 10 + blocks), jobs))
        bands = {one.joint.name: calibrate([p[j] for p in parts]) for j, one in enumerate(parts[0])}
        reference = with_contacts(ForceEstimate(joints=parts[0], calibrations=bands), RATE)
        marks = reference.thresholds
        halves = {name: half_bands(c.forces[0]) for name, c in bands.items()}
        print(
            f"\narm: {how['method']}, {how['bandwidth']:.3g} 1/s; free motion of "
            f"{max(c.duration for c in bands.values()) / 3600.0:.2f} h, {time.perf_counter() - begun:.0f} s"
        )
        table(marks, halves, "N.m")
        for sentence in reference.remarks:
            print(f"  {sentence}")
        count, spent = 0, 0.0
        blocks = max(1, round(judging * 3600.0 / OF_ARM))
        for joints in free_forces(home, how, range(seed + 10_000, seed + 10_000 + blocks), jobs):
            calibrated = tuple(bands[one.joint.name].apply(one) for one in joints)
            count += len(mark_contacts(ForceEstimate(joints=calibrated), marks).contacts or ())
            before, spent = spent, spent + (joints[0].time[-1] - joints[0].time[0]) / 3600.0
            if int(spent) > int(before):
                print(f"  {count} false contacts in {spent:.2f} h", flush=True)
        conclude(judge, "arm", count, spent, short)
        conclude_steps(judge, "arm", steps_of_arm(Cell(home, how), bands, marks, steps, seed + 50_000))
    print(f"  {time.perf_counter() - begun:.0f} s")


def steps_of_arm(
    cell: Any, bands: Mapping[str, Calibration], marks: tuple[Threshold, ...], steps: int, seed: int
) -> np.ndarray:
    """Return how late steps of a wrench were noticed [s], infinite where never, (k,)."""
    from _contact_arm import LENGTH as FOR
    from _contact_arm import stepped as stepped_arm

    names = list(bands)
    levels = {t.joint: t.bands for t in marks if t.state == "moving"}
    heights = np.array(
        [STEP * levels[n] * (m.half_width if (m := bands[n].moving) else np.nan) for n in names]
    )
    late: list[float] = []
    while len(late) < steps:
        dry, wet, wanted = stepped_arm(seed, 120.0, heights)
        seed += 10
        still = cell.forces(dry)
        pushed = tuple(bands[one.joint.name].apply(one) for one in cell.forces(wet))
        begins = np.array(
            [c.begin for c in mark_contacts(ForceEstimate(joints=pushed), marks).contacts or ()]
        )
        begins += 0.0 if np.isnan(pushed[0].lag) else pushed[0].lag
        for t, j in wanted:
            at = min(int(np.searchsorted(still[j].time, t)), still[j].time.size - 1)
            if still[j].state[at] == 0:
                after = begins[(begins >= t) & (begins < t + FOR)]
                late.append(float(after.min() - t) if after.size else np.inf)
    return np.array(late)


def ur3() -> None:
    """Count the contacts of a UR3 that nothing touches.

    The torque of prbs is another quantity than that of id1 and id2 (its wrists carry next to no friction), so that its own halves
    identify and calibrate each other.
    """
    from ur3 import NAMES, description
    from ur3 import read as read_ur3

    robot = str(description())
    first, second = read_ur3("id1.mat"), read_ur3("id2.mat")
    model = identify(first, method="arm", urdf=robot).model
    slow = read_log(data("ur3", "prbs.mat"), map="t=time,q=q,dq=d_q,tau=m_torque", names=NAMES)
    cases = {
        "id2, model and calibration by id1": [(model, second, first)],
        "id2, model by id1, halves calibrate each other": [(model, a, b) for a, b in halves_of(second)],
        "prbs, model and calibration by the other half": [
            (identify(b, method="arm", urdf=robot).model, a, b) for a, b in halves_of(slow)
        ],
    }
    for words, runs in cases.items():
        count, hours, parts = 0, 0.0, []
        for known, log, untouched in runs:
            e = estimate_force(
                known, log, robot=robot, free=[untouched], false_alarms=RATE, method="momentum"
            )
            count += len(e.contacts or ())
            hours += (e.joints[0].time[-1] - e.joints[0].time[0]) / 3600.0
            parts.append(e)
        bound = f"at most {poisson(count, hours, 0.9)[1]:.0f} an hour (95 %, Poisson)"
        print(f"\nUR3, {words}: {count} contacts in {hours * 60.0:.2f} min, {bound}")
        table(parts[-1].thresholds, {j.joint.name: half_bands(j) for j in parts[-1].joints}, "N.m")
        for sentence in parts[-1].remarks:
            print(f"  {sentence}")


def halves_of(log: Log) -> list[tuple[Log, Log]]:
    """Return each half of a log with the other."""
    middle = len(log) // 2
    a, b = log.rows(slice(None, middle)), log.rows(slice(middle, None))
    return [(a, b), (b, a)]


def main() -> None:
    """Judge."""
    options = parser(__doc__)
    options.add_argument("--seed", type=int, help="first seed")
    options.add_argument("--only", default="joint,arm,ur3", help="which of joint, arm, ur3")
    options.add_argument("--hours", type=float, help="of unseen free motion")
    options.add_argument("--calibrate", type=float, help="hours of free motion that calibrate the arm")
    options.add_argument("--jobs", type=int, default=1, help="processes")
    given = options.parse_args()
    which, judge, seed = given.only.split(","), Judge(), first_seed(given.seed)
    if "joint" in which:
        single_joint(judge, given.short, given.hours, seed)
    if "arm" in which:
        six_joints(judge, given.short, (given.calibrate, given.hours), seed, given.jobs)
    if "ur3" in which:
        ur3()
    judge.end()


if __name__ == "__main__":
    main()
