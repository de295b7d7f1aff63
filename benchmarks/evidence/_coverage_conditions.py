"""The conditions of `coverage`: how each log is made, and by which methods it is identified."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from _independent import Joint, Logger, Record, multisine, record, rested, sweep, trapezoids

COLOUR = 0.98  # of the coloured noise [-]
SECONDS = 30.0  # of a multisine
NAN_ROWS, NAN_OF = 16, 12_000

LINE = ("line", {"method": "motion", "law": "coulomb-viscous"})
CURVE = ("auto", {})
SEARCH = ("search", {"law": "coulomb-viscous"})


class Case(NamedTuple):
    """What is identified: logs that are given together.

    Attributes:
        records: one a log.
        joint: the truth.
    """

    records: list[Record]
    joint: Joint


@dataclass(frozen=True, kw_only=True)
class Condition:
    """One condition.

    Attributes:
        name: for the table.
        make: the case of a seed.
        methods: label and options of `identify`.
        expected: method that `auto` is to take.
        silent: nothing can be told here, and nothing may be.
    """

    name: str
    make: Callable[[np.random.Generator], Case]
    methods: tuple[tuple[str, dict[str, Any]], ...] = (CURVE, LINE, SEARCH)
    expected: str = "motion"
    silent: bool = False


def draw(rng: np.random.Generator, top: float) -> Joint:
    """Return a joint whose crossing of zero has a random width, without Stribeck peak: Coulomb and viscous are what they are."""
    coulomb = 10.0 ** rng.uniform(-0.3, 0.7)
    smooth = rng.random() < 0.5
    width = 10.0 ** (rng.uniform(-2.5, -1.5) if smooth else rng.uniform(-4.0, -2.5))
    pull = coulomb * rng.uniform(0.0, 3.0) * (rng.random() < 0.67)
    angle = rng.uniform(0.0, 2.0 * np.pi)
    return Joint(
        inertia=coulomb * rng.uniform(0.03, 0.3),
        coulomb=coulomb,
        viscous=coulomb / top * rng.uniform(0.1, 0.8),
        gravity=(float(pull * np.cos(angle)), float(pull * np.sin(angle))),
        offset=coulomb * rng.uniform(-0.2, 0.2),
        crossing="stribeck" if smooth else "elastoplastic",
        width=width,
    )


def logger(joint: Joint, rng: np.random.Generator, **options: Any) -> Logger:
    """Return a logger with noise of 3 to 10 % of the friction; without `colour` a coin decides."""
    colour = options.pop("colour", COLOUR if rng.random() < 0.5 else 0.0)
    return Logger(noise=joint.coulomb * rng.uniform(0.03, 0.1), colour=colour, **options)


def _sines(rng: np.random.Generator, **options: Any) -> Case:
    top = rng.uniform(1.0, 3.0)
    joint = draw(rng, top)
    motion = multisine(SECONDS, top, rng)
    return Case([record(joint, motion, logger(joint, rng, **options), rng)], joint)


def _holes(rng: np.random.Generator) -> Case:
    case = _sines(rng, rate=400.0)
    log = case.records[0]
    rows = rng.choice(log.time.size, NAN_ROWS * log.time.size // NAN_OF, replace=False)
    position, torque = log.position.copy(), log.torque.copy()
    position[rows], torque[rows] = np.nan, np.nan
    return Case([replace(log, position=position, torque=torque)], case.joint)


def _rests(rng: np.random.Generator) -> Case:
    top = rng.uniform(1.0, 3.0)
    joint = draw(rng, top)
    motion = rested(multisine(SECONDS, top, rng), 4, 8.0)
    return Case([record(joint, motion, logger(joint, rng), rng)], joint)


def _runs(speeds: int, rng: np.random.Generator) -> Case:
    top = rng.uniform(1.0, 3.0)
    joint = draw(rng, top)
    if rng.random() < 0.5:
        joint = replace(joint, gravity=(0.0, 0.0))
    each, seconds, rise = top * np.arange(1, speeds + 1) / speeds, 3.0, 0.3
    whole = record(joint, trapezoids(each, seconds, rise), logger(joint, rng), rng)
    logs = []
    for k in range(2 * speeds):
        begin = k * (seconds + 0.2) + 0.2 + 2.0 * rise
        a, b = np.searchsorted(whole.time, [begin, begin + seconds - 3.0 * rise])
        log = whole.rows(slice(int(a), int(b)))
        logs.append(replace(log, time=log.time - log.time[0]))
    return Case(logs, joint)


def _sweeps(centers: int, rng: np.random.Generator, **options: Any) -> Case:
    top = rng.uniform(1.0, 2.0)
    joint = draw(rng, top)
    at = rng.uniform(-0.5, 0.5) + 1.2 * (np.arange(centers) - 0.5 * (centers - 1))
    made = logger(joint, rng, **options)
    return Case([record(joint, sweep(c, 0.4, top, 8), made, rng) for c in at], joint)


def _few_moves(rng: np.random.Generator) -> Case:
    joint = draw(rng, 1.0)
    motion = trapezoids(np.array([0.6, 1.0]), 2.0)
    motion = motion[: round(0.75 * motion.size)]  # two moves one way, one the other
    return Case([record(joint, motion, logger(joint, rng, colour=COLOUR), rng)], joint)


def _open_delay(rng: np.random.Generator) -> Case:
    joint = replace(draw(rng, 0.3), inertia=0.002)
    motion = trapezoids(np.linspace(0.05, 0.3, 5), 5.0, 2.4)
    return Case([record(joint, motion, logger(joint, rng, colour=COLOUR), rng)], joint)


def _grid() -> list[Condition]:
    made = []
    for word, colour in (("white", 0.0), ("AR(0.98)", COLOUR)):
        for rate in (1000.0, 200.0):
            for late in (0.0, 0.001, 0.004):
                name = f"{word}, {rate:g} Hz, {1e3 * late:g} ms late"
                options = {"colour": colour, "rate": rate, "late": late}
                made.append(Condition(name=name, make=lambda rng, o=options: _sines(rng, **o)))
    return made


CONDITIONS = (
    *_grid(),
    Condition(name="4096 counts, 200 Hz", make=lambda rng: _sines(rng, rate=200.0, counts=4096.0)),
    Condition(
        name=f"{NAN_ROWS} NaN rows of {NAN_OF}",
        make=_holes,
        methods=tuple((label, {**options, "repair": True}) for label, options in (CURVE, LINE, SEARCH)),
    ),
    *(
        Condition(
            name=f"{n} constant speeds",
            make=lambda rng, n=n: _runs(n, rng),
            methods=(CURVE,),
            expected="constant-velocity",
        )
        for n in (4, 7, 16)
    ),
    Condition(name="long rests", make=_rests),
    Condition(name="sweep, one center", make=lambda rng: _sweeps(1, rng), methods=(CURVE,), expected="sweep"),
    Condition(
        name="sweeps, three centers", make=lambda rng: _sweeps(3, rng), methods=(CURVE,), expected="sweep"
    ),
    Condition(
        name="2 constant speeds (silence)",
        make=lambda rng: _runs(2, rng),
        methods=(CURVE,),
        expected="constant-velocity",
        silent=True,
    ),
    Condition(name="3 moves (silence)", make=_few_moves, methods=(CURVE, LINE), silent=True),
    Condition(name="delay open (silence)", make=_open_delay, methods=(CURVE, LINE), silent=True),
    Condition(
        name="sweep, one center, 4 ms late",
        make=lambda rng: _sweeps(1, rng, late=0.004),
        methods=(CURVE,),
        expected="sweep",
    ),
)
