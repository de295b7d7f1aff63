"""The unknowns of a fit by forward dynamics: parameters of the law, the axis and its drive, by name.

`inertia`, `gravity_sin`, ... are fields of `engine.Axis`, and `drive.resistance`, ... are those of `engine.DriveModel`.
`drive.proportional_factor` multiplies the drive's own gain in every log. `start.position[k]` and `start.velocity[k]` are added
to the initial state of log k. `shape.<name>` is the size of a function of time that is added to the drive's input. A range is
(lower, upper), (lower, upper, start), or (lower, upper, (from, to)), where starts are drawn between the last two. A positive
range that spans a factor of ten or more is searched in the logarithm.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from backdrive._catalog import lookup
from backdrive.engine import Axis, DriveModel
from backdrive.errors import InvalidInput
from backdrive.identification.dynamic.unknowns import LawShape, Scales, Unknown
from backdrive.identification.terms import unit_of
from backdrive.laws.direction import plain as without_direction

Range = Sequence[Any]
FACTOR = 3.0  # in a logarithmic range, starts are drawn within this factor of the given start [-]
SHARE = 0.25  # in a linear range, starts are drawn within this share of the range about the given start [-]
STEPS = 10.0  # length of a linear range [search coordinate]

OF_AXIS = [f.name for f in fields(Axis) if f.name not in ("law", "drive", "friction_side")]
OF_DRIVE = [f"drive.{f.name}" for f in fields(DriveModel) if f.name not in ("controller", "actuator", "hold")]
NAMES = (*OF_AXIS, *OF_DRIVE, "drive.proportional_factor", "start.position", "start.velocity")


@dataclass(frozen=True, kw_only=True, eq=False)
class Terms:
    """All unknowns, in the order of the search coordinates.

    Attributes:
        unknowns: the unknowns with their ranges.
        of_law: number of unknowns of the law, which come first.
        start: first starting point [search coordinate], (P,).
        lower: lower bound of drawn starting points [search coordinate], (P,).
        upper: upper bound of drawn starting points [search coordinate], (P,).
    """

    unknowns: tuple[Unknown, ...]
    of_law: int
    start: np.ndarray
    lower: np.ndarray
    upper: np.ndarray


def range_of(name: str, given: Range, unit: str) -> tuple[Unknown, tuple[float, float, float]]:
    """Return an unknown, and its start with the bounds of drawn starts [search coordinate].

    Args:
        name: of the unknown.
        given: the range, in a form that the module's docstring lists.
        unit: of the unknown.

    Raises:
        InvalidInput: the range is invalid.
    """
    remedy = "Give (lower, upper), (lower, upper, start) or (lower, upper, (from, to)), in SI units."
    try:
        low, high = float(given[0]), float(given[1])
        drawn = given[2] if len(given) == 3 else None
        inside = np.atleast_1d(np.asarray([low, high] if drawn is None else drawn, dtype=float))
    except (TypeError, ValueError, IndexError):
        raise InvalidInput(f"'{name}': {given!r} is not a range.", remedy=remedy) from None
    if len(given) > 3 or inside.size > 2 or not np.all(np.isfinite([low, high, *inside])):
        raise InvalidInput(f"'{name}': {given!r} is not a range.", remedy=remedy)
    if not low < high or inside.min() < low or inside.max() > high or inside[0] > inside[-1]:
        raise InvalidInput(
            f"'{name}' is to lie between {low:g} and {high:g} [{unit}] and to start from {inside.tolist()}.",
            remedy="Give a lower bound below the upper one and a start between them.",
        )
    log = low > 0.0 and high >= 10.0 * low
    u = Unknown(
        name=name, unit=unit, lower=low, upper=high, log=log, scale=1.0 if log else (high - low) / STEPS
    )
    if inside.size == 2:
        a, b = float(inside[0]), float(inside[1])
        start = float(np.sqrt(a * b)) if log else 0.5 * (a + b)
    else:
        start = float(inside[0])
        a, b = (
            (start / FACTOR, start * FACTOR)
            if log
            else (start - SHARE * (high - low), start + SHARE * (high - low))
        )
    return u, (float(u.inward(start)), float(u.inward(a)), float(u.inward(b)))


def assemble(
    shape: LawShape, scales: Scales, free: Mapping[str, Range], logs: int, courses: Sequence[str] = ()
) -> Terms:
    """Return all unknowns.

    Args:
        shape: shape of the law.
        scales: typical sizes, which determine ranges of the law's parameters that are not given.
        free: ranges of the law's parameters and of all other unknowns, by name.
        logs: number of logs.
        courses: names of the functions of time that may be added to the drive's input.

    Raises:
        UnknownName: `free` names something that neither law nor axis has.
        InvalidInput: a range is invalid, or a parameter is both fixed and estimated.
    """
    unknowns, boxes, used = [], [], set()
    for u in shape.unknowns(scales):
        plain = u.name.partition("[")[0]
        given = next((key for key in (u.name, plain, without_direction(plain)) if key in free), None)
        if given is not None:
            used.add(given)
            u, box = range_of(u.name, free[given], u.unit)
        else:
            start = 0.0 if u.ratio else np.clip(_size(shape, u, scales), u.lower, u.upper)
            at = float(u.inward(start))
            reach = 1.0 if u.ratio else np.log(10.0) if u.log else SHARE * min(u.upper / u.scale, 4.0)
            low, high = float(u.inward(u.lower)), float(u.inward(u.upper))
            box = (at, max(at - reach, low), min(at + reach, high))
        unknowns.append(u)
        boxes.append(box)
    of_law = len(unknowns)
    for name, given in free.items():
        if name in used:
            continue
        if name in shape.fixed:
            raise InvalidInput(f"'{name}' is held fixed and sought at once.", remedy="Drop one of the two.")
        plain, bracket, place = name.partition("[")
        known = {n: n for n in (*shape.rate.PARAMETERS, *shape.element.PARAMETERS, *NAMES)}
        known |= {f"shape.{n}": n for n in courses}
        lookup(plain, known, "number of the law, the axis or the drive")
        if plain.startswith("start."):
            places = [int(place[:-1])] if bracket and place[:-1].isdigit() else range(logs)
            each = [f"{plain}[{k}]" for k in places if k < logs]
        else:
            each = [plain]
        for n in each:
            u, box = range_of(n, given, unit_of(plain, scales.unit))
            unknowns.append(u)
            boxes.append(box)
    at = np.array(boxes).reshape(-1, 3)
    return Terms(unknowns=tuple(unknowns), of_law=of_law, start=at[:, 0], lower=at[:, 1], upper=at[:, 2])


def _size(shape: LawShape, u: Unknown, scales: Scales) -> float:
    """Return the start of a law's parameter without a given range: its typical size in these data."""
    parameter = {**shape.rate.PARAMETERS, **shape.element.PARAMETERS}[u.name.partition("[")[0]]
    typical = {"exponent": 1.0, "stribeck_velocity": 0.05 * scales.speed, "shift": 0.0}
    typical |= {"breakaway": 1.3 * scales.force, "stribeck": 0.3 * scales.force}
    if without_direction(u.name) in typical:
        return typical[without_direction(u.name)]
    if parameter.unit == "1":
        return 0.1 if parameter.upper > 1.0 else 0.5
    return (0.3 if parameter.unit == "force.s/length" else 1.0) * scales.of(parameter.unit)


def column(template: Axis | DriveModel, name: str, low: float, high: float) -> int:
    """Return the index of a field in the row that the kernels read.

    Args:
        template: axis or drive.
        name: of the field.
        low: a value of the field.
        high: another value of the field.
    """
    rows = [template.replace(**{name: value}).row() for value in (low, high)]
    return int(np.flatnonzero(rows[0] != rows[1])[0])
