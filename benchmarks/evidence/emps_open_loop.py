"""The EMPS ball-screw axis let go for 24.8 s: position simulated from the drive's voltage alone, no feedback.

Benchmark: A. Janot, M. Gautier, M. Brunot, "Data set and reference models of EMPS", Workshop on Nonlinear System
Identification Benchmarks, 2019. Force = 35.15 N/V times the voltage; M a = force - friction - offset. An axis without feedback
integrates every error of force twice, held back by friction alone, so that half a newton too much (0.3 % of the peak) is 2.5 mm
more every second; what friction is worth shows in millimetres.

Sought with every law: mass, offset, delay of the force (0 or more), what the velocity of the first sample lacks (1 mm/s at most),
and a drift of the offset in proportion to time: the force that the axis needs moves by about half a newton over the log, alike
in both directions (amplifier and motor warm up), which no friction law can do. The chosen law is judged without that drift too.
Starts come from a regression on the force, no table of numbers; a presliding element starts on its rate law's fit.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
from _common import Judge, data, parser
from scipy.signal import butter, sosfiltfilt

from backdrive.engine import Axis, DriveModel
from backdrive.identification.dynamic.motion import MotionFit, MotionLog, fit_motion
from backdrive.identification.dynamic.unknowns import LawShape
from backdrive.laws import M1, Law
from backdrive.logs.readers import read_log

FORCE = 35.15065188  # force constant that the data set gives [N/V]
HALF = 12.4  # s
LIMITS = {True: (1.7, 1.7), False: (2.25, 6.6)}  # whole log and second half, with the drift and without [mm]

OTHERS = {
    "inertia": (80.0, 110.0),
    "offset": (-10.0, 10.0),
    "drive.delay": (0.0, 0.02),
    "start.velocity": (-1e-3, 1e-3),
}
DRIFT = {"shape.drift": (-0.3, 0.3)}
DRY = {"coulomb": (1.0, 60.0), "viscous": (10.0, 800.0)}
STRIBECK = {**DRY, "breakaway": (1.0, 80.0), "stribeck_velocity": (1e-3, 0.2)}
BRISTLE = {"stiffness": (1e4, 1e8), "damping": (1.0, 1e4)}
LAWS = {
    "coulomb": ({"coulomb": (1.0, 100.0)}, {}),
    "m1": (DRY, {}),
    "stribeck-gauss": (STRIBECK, {}),
    "degressive": ({"coulomb": (0.01, 60.0), "growth": (1.0, 2000.0), "exponent": (0.05, 1.5)}, {}),
    "stribeck-gauss+lugre": (STRIBECK | BRISTLE, {"fading": 0.01}),
    "stribeck-gauss+elastoplastic": (STRIBECK | BRISTLE, {"fading": 0.01, "elastic": 0.7}),
    "stribeck-gauss+maxwell-slip": (STRIBECK | {"stiffness": (1e4, 1e8)}, {}),
    "coulomb-viscous": (
        {f"{n}_{way}": DRY[n] for n in ("coulomb", "viscous") for way in ("positive", "negative")},
        {},
    ),
    "coulomb-viscous+dahl": (
        {f"{n}_{way}": DRY[n] for n in ("coulomb", "viscous") for way in ("positive", "negative")}
        | {"stiffness": (1e4, 1e8)},
        {},
    ),
}
CHOSEN = "coulomb-viscous"
ENDS: dict[
    tuple[str, str, bool], dict[str, float]
] = {}  # of fits, for laws that carry a presliding element on top


def logs() -> tuple[MotionLog, MotionLog, MotionLog]:
    """Return the whole log and its halves."""
    log = read_log(data("emps", "DATA_EMPS.mat"), map=f"t=t,q=qm,tau={FORCE}*vir", units="m")
    assert log.position is not None
    assert log.torque is not None
    q, force, dt = log.position[:, 0], log.torque[:, 0], log.period
    v = np.gradient(sosfiltfilt(butter(4, 100.0, fs=1.0 / dt, output="sos"), q), dt)
    k = round(HALF / dt)

    def part(at: slice) -> MotionLog:
        drift = dt * np.arange(len(q))
        return MotionLog(
            position=q[at], drive_input=force[at], dt=dt, velocity=v[at], shapes={"drift": drift[at]}
        )

    return part(slice(None)), part(slice(k)), part(slice(k, None))


def starts(log: MotionLog) -> dict[str, float]:
    """Return starts for every law by least squares on the force, below 5 Hz."""
    v = log.velocity
    assert v is not None
    acceleration, way = np.gradient(v, log.dt), np.sign(v)
    columns = np.stack([acceleration, v * (v > 0), v * (v < 0), way, np.ones_like(v)], axis=1)
    slow = butter(2, 5.0, fs=1.0 / log.dt, output="sos")
    inside = slice(200, -200)
    X, y = (
        sosfiltfilt(slow, columns, axis=0)[inside],
        sosfiltfilt(slow, log.drive_input)[inside],
    )
    M, b_p, b_n, F, o = np.linalg.lstsq(X, y, rcond=None)[0]
    b = 0.5 * (b_p + b_n)
    return {
        "inertia": M,
        "offset": o,
        "coulomb": F,
        "coulomb_positive": F + o,
        "coulomb_negative": F - o,
        "viscous": b,
        "viscous_positive": b_p,
        "viscous_negative": b_n,
        "breakaway": 1.1 * F,
        "stribeck_velocity": 0.02,
        "growth": b,
        "exponent": 0.95,
        "stiffness": 1e6,
        "damping": 100.0,
        "drive.delay": 1e-3,
        "start.velocity[0]": 0.0,
        "shape.drift": 0.0,
    }


def fit(name: str, log: MotionLog, *, drift: bool) -> tuple[MotionFit, float]:
    """Return the fit of a law to a log and its CPU seconds."""
    ranges, fixed = LAWS[name]
    begin = starts(log)
    begin |= ENDS.get((name.partition("+")[0], log.name, drift), {})
    if name == "coulomb":
        begin["coulomb"] += 0.08 * begin["viscous"]
    free = OTHERS | (DRIFT if drift else {}) | ranges
    if "coulomb_positive" in ranges:  # two directions of their own hold the offset
        del free["offset"]
    axis = Axis(law=Law(rate=M1(coulomb=0.0)), inertia=95.0, drive=DriveModel())
    shape, spent = LawShape.from_name(name, count=1, fixed=fixed), time.process_time()
    found = fit_motion([log], shape, axis=axis, free=free, unit="m", begin=1, begin_at=begin, iterations=25)
    ENDS[name, log.name, drift] = dict(found.values)
    return found, time.process_time() - spent


def judged(name: str, *, drift: bool, parts) -> tuple[float, float, MotionFit]:
    """Fit to the whole log and to its first half, print a row, and return both errors [mm] and the first fit."""
    whole, first, second = parts
    found, cpu = fit(name, whole, drift=drift)
    early, _ = fit(name, first, drift=drift)
    unseen = 1e3 * float(np.sqrt(np.mean(early.errors([second])[0] ** 2)))
    print(
        f"  {name:30s} {'yes' if drift else 'no':>5s} {len(found.values):7d} {1e3 * found.rms:9.2f} {1e3 * early.rms:9.2f}"
        f" {unseen:9.2f} {cpu:6.0f}",
        flush=True,
    )
    return 1e3 * found.rms, unseen, found


def main() -> None:
    """Print what each law adds and judge the chosen one."""
    made = parser(__doc__)
    made.add_argument("names", nargs="*", help="laws beside the chosen one; all where none is given")
    asked = made.parse_args()
    judge, parts = Judge(), logs()
    parts = tuple(
        replace(log, name=name)
        for log, name in zip(parts, ("whole", "first half", "second half"), strict=False)
    )
    print(
        f"{len(parts[0].position)} samples; root mean square error of the position [mm]; second half: from the fit to the first"
    )
    print(f"  {'law':30s} drift numbers     whole     first    second  CPU s")
    rows: dict[bool, tuple[float, float, MotionFit]] = {}
    for name in asked.names or ([CHOSEN] if asked.short else LAWS):
        row = judged(name, drift=True, parts=parts)
        if name == CHOSEN:
            rows[True] = row
    for drift in (True, False):
        if drift not in rows:
            rows[drift] = judged(CHOSEN, drift=drift, parts=parts)
    for drift, (whole, unseen, found) in rows.items():
        how = f"{CHOSEN}, {'with' if drift else 'without'} a free drift of the force"
        print(f"\n{how}, all 24.8 s:")
        for name, value in found.values.items():
            error = found.standard_errors[name]
            said = f"+- {error:.2g}" if np.isfinite(error) else "at the end of its range"
            print(f"    {name:22s} {value:10.4g} {said}")
        judge.at_most(f"{how}: whole log from the voltage", whole, LIMITS[drift][0], "mm")
        judge.at_most(f"{how}: second half from the fit to the first", unseen, LIMITS[drift][1], "mm")
        judge.that(f"{how}: a delay of 0 or more", found.values["drive.delay"] >= 0.0)
    judge.end()


if __name__ == "__main__":
    main()
