"""What one identification states, number by number, against the truth and the oracle."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from _coverage_conditions import CONDITIONS, Case
from _coverage_oracle import Oracle, Terms, oracle

from backdrive import Joint, Log, identify
from backdrive.errors import BackdriveError, InvalidInput, UnknownName
from backdrive.laws import CoulombViscous

NORMAL = 1.959964  # half width of a 95 % interval where only a standard error is stated [standard error]
CROSSED = 3.0  # widths of a smooth crossing of zero, below which its level is no sliding friction [-]
KINDS = ("jump", "sliding", "crossing", "exact")  # in the order of `Number`
WAYS = ("positive", "negative")
REFUSED = {"line": "motion", "search": "dynamic"}  # method of a label whose log was refused
QUANTITIES = {
    "auto": ("curve",),
    "line": ("coulomb", "viscous", "curve"),
    "search": ("coulomb", "viscous"),
}


class Number(NamedTuple):
    """One stated number.

    Attributes:
        condition: its name.
        method: that ran, and the label of the options.
        quantity: `coulomb`, `viscous` or `curve`.
        log: tells the numbers of one log from those of others.
        error: stated less true [unit].
        width: half of the stated 95 % interval; NaN: it cannot tell [unit].
        least: half of the oracle's [unit].
        sliding: the same by rows where the joint slides for sure [unit].
        crossing: the same with the true crossing of zero known [unit].
        exact: that of the oracle with an exact encoder [unit].
    """

    condition: str
    method: str
    quantity: str
    log: int
    error: float
    width: float
    least: float
    sliding: float
    crossing: float
    exact: float

    @property
    def told(self) -> bool:
        """Whether an interval was stated."""
        return math.isfinite(self.width)


def to_log(record: Any) -> Log:
    """Return a record as a log, with the joint that was logged beside it."""
    both = [record] if record.other is None else [record, record.other]
    names = {"position": "position", "torque": "torque", "velocity": "velocity", "model_torque": "known"}
    columns = {channel: [getattr(one, name) for one in both] for channel, name in names.items()}
    channels: dict[str, Any] = {
        channel: np.stack(series, axis=1)
        for channel, series in columns.items()
        if all(x is not None for x in series)
    }
    joints = tuple(Joint(name=name, unit="rad") for name in ("joint", "other")[: len(both)])
    return Log(time=record.time, joints=joints, **channels)


def numbers(condition: int, seed: int, searches: bool) -> list[Number]:
    """Return every number that the methods of a condition state of the log of a seed."""
    about = CONDITIONS[condition]
    case = about.make(np.random.default_rng([13, condition, seed]))
    logs = [to_log(record) for record in case.records]
    made: list[Number] = []
    for label, options in about.methods:
        if label == "search" and not searches:
            continue
        try:
            result = identify(logs, **options)
        except (InvalidInput, UnknownName):
            raise
        except BackdriveError:
            method = _named(REFUSED.get(label, about.expected), label)
            made += [Number(about.name, method, q, seed, *[math.nan] * 6) for q in QUANTITIES[label]]
            continue
        method = _named(result.method, label)
        made += [Number(about.name, method, q, seed, *rest) for q, *rest in _stated(result, case)]
    return made


def _named(method: str, label: str) -> str:
    return method if label == "auto" else f"{method}, {label}"


def _terms(result: Any, case: Case) -> Terms:
    friction = result.model.joints[0]
    rate = friction.law.rate
    if isinstance(rate, CoulombViscous):
        knots = np.array([0.0, max(abs(v) for v in friction.validity.velocity)])
        at_rest = rate.coulomb_positive == rate.coulomb_negative
        symmetric = at_rest and rate.viscous_positive == rate.viscous_negative
    else:
        knots, symmetric = np.array(rate.velocity), rate.positive == rate.negative
        at_rest = rate.positive[0] == rate.negative[0]
    offset = "offset" in friction.dynamics
    runs = result.method == "constant-velocity"
    alike = at_rest and offset and not symmetric  # the data cannot tell a constant from friction by direction
    used = knots.size * (1 if symmetric else 2) + offset - alike
    return Terms(
        knots=knots,
        symmetric=symmetric,
        alike=alike,
        gravity="gravity_sin" in friction.dynamics,
        offset=offset and (symmetric or alike),
        inertia=not runs,
        flanks=result.method == "sweep",
        freedom=len(case.records) - used if runs else math.inf,
    )


def _stated(result: Any, case: Case) -> Iterator[tuple[Any, ...]]:
    """Return quantity, error, stated half width and those of the oracles of `KINDS`, of every number."""
    friction, joint = result.model.joints[0], case.joint
    rate, terms = friction.law.rate, _terms(result, case)
    bounds = [oracle(case.records, terms, kind) for kind in KINDS]
    # by direction a constant torque cannot be told from friction: where no offset is stated it is in the friction
    constant = 0.0 if terms.symmetric or "offset" in friction.dynamics else _bias(case, terms.gravity)
    intervals = result.intervals.get(friction.joint.name, {})
    if isinstance(rate, CoulombViscous):
        for way, word in enumerate(WAYS):
            for name, truth, edges in (
                ("coulomb", joint.coulomb + (1 - 2 * way) * constant, [b.curve[way, 0] for b in bounds]),
                ("viscous", joint.viscous, [b.viscous[way] for b in bounds]),
            ):
                full = f"{name}_{word}"
                value = getattr(rate, full)
                yield name, value - truth, _half(full, friction, intervals), *edges
        if intervals:
            return  # a search states its parameters; the curve is made of them
        yield from _line_at_top(result, joint, bounds, constant)
        return
    for way, word in enumerate(WAYS):
        errors = friction.standard_errors.get(word)
        for i, speed in enumerate(rate.velocity):
            if joint.crossing == "stribeck" and speed < CROSSED * joint.width:
                continue
            sign = 1.0 if way == 0 else -1.0
            truth = sign * (float(joint.sliding(np.array([sign * max(speed, 1e-9)]))[0]) + constant)
            half = NORMAL * errors[i] if errors is not None else math.nan
            yield "curve", getattr(rate, word)[i] - truth, half, *(b.curve[way, i] for b in bounds)


def _bias(case: Case, gravity: bool) -> float:
    """Return the mean torque that is no friction, without that of gravity where gravity is stated."""
    if gravity:
        return case.joint.offset
    sin, cos = case.joint.gravity
    position = np.concatenate([record.position for record in case.records])
    return case.joint.offset + float(np.nanmean(sin * np.sin(position) + cos * np.cos(position)))


def _line_at_top(
    result: Any, joint: Any, bounds: Sequence[Oracle], constant: float
) -> Iterator[tuple[Any, ...]]:
    """Return the same for a straight line's value at its fastest knot."""
    curve = result.evidence[0].curve
    for way, sign in enumerate((1.0, -1.0)):
        at = int(np.argmax(sign * curve.velocity))
        truth = float(joint.sliding(curve.velocity[at : at + 1])[0]) + constant
        half = NORMAL * float(curve.standard_error[at])
        if sign * curve.velocity[at] > 0.0:
            yield "curve", float(curve.torque[at]) - truth, half, *(b.curve[way, -1] for b in bounds)


def _half(name: str, friction: Any, intervals: Any) -> float:
    """Return half of a parameter's 95 % interval: as stated, or by its standard error."""
    if name in intervals:
        low, high = intervals[name]
        return 0.5 * (high - low)
    error = friction.standard_errors.get(name, math.nan)
    return NORMAL * error if error > 0.0 else math.nan
