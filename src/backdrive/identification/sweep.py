"""The sweep identification of Iwatani 2017, chapter 2: friction from sines of one stroke and growing speed.

`function_a` is (2.7) as printed, `sweep_knots` adds corrections, and `identify_sweep` identifies a joint's friction from logs. See
`docs/theory/sweep.md`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.identification.curves import knot_names, widen_below
from backdrive.identification.evidence import evidence, parts_of
from backdrive.identification.function_a import SHARE, correct_pairs, function_a
from backdrive.identification.function_a import literal as literal_pairs
from backdrive.identification.quality import assess_parts
from backdrive.identification.result import JointEvidence
from backdrive.identification.settling import past_build_up
from backdrive.identification.signals import Signals, prepare, prepare_each
from backdrive.identification.smoothing import smoothing
from backdrive.identification.sweep_delay import drive_delays
from backdrive.identification.sweep_equations import ALL
from backdrive.identification.sweep_fit import SweepFit, fit
from backdrive.identification.sweep_knots import SweepKnots, sort_knots, to_polyline
from backdrive.identification.sweep_verdict import error_of_curve, verdict
from backdrive.identification.sweep_windows import find_windows, windows
from backdrive.identification.terms import estimates
from backdrive.identification.timing import Timing
from backdrive.identification.user_delay import describe
from backdrive.laws import Growth, Law
from backdrive.logs.log import Joint, Log
from backdrive.model import Covariance, JointFriction, Validity

__all__ = [
    "SweepKnots",
    "find_windows",
    "fit_sweeps",
    "function_a",
    "identify_sweep",
    "sweep_knots",
    "to_polyline",
]


def sweep_knots(
    log: Log,
    joint: str | int,
    plan: Any = None,
    *,
    literal: bool = False,
    c: float = SHARE,
    delay: float = 0.0,
) -> SweepKnots:
    """Return the velocity-friction pairs of a sweep.

    Args:
        log: with torque, and position or velocity.
        joint: name or column.
        plan: the sweep of the log; None: the log's own plan, or else the cycles are detected in the motion.
        literal: as printed: backward difference of the position, torque at the same index, no correction.
        c: share of a cycle's peak speed above which samples are used [-].
        delay: time from a torque sample to its effect, minus half a sampling interval [s].

    Raises:
        NotIdentifiable: no cycles are found, or fewer than two are usable.
        InvalidInput: the log holds no torque.
    """
    return pairs(log, joint, prepare(log, joint), plan, literal=literal, c=c, delay=delay)


def pairs(
    log: Log,
    joint: str | int,
    stretches: Sequence[Signals],
    plan: Any = None,
    *,
    literal: bool = False,
    c: float = SHARE,
    delay: float,
) -> SweepKnots:
    """Return the result of `sweep_knots` for a log with prepared signals."""
    cycles = windows(log, joint, log.plan if plan is None else plan, stretches)
    if literal:
        knots = literal_pairs(log.select(joint).on_joint_side(), cycles, c)
    else:
        rotary = log.joints[log.column(joint)].unit == "rad"
        knots = correct_pairs(stretches, cycles, rotary=rotary, c=c, delay=delay)
    return sort_knots(knots, joint, cycles, c)


def identify_sweep(
    logs: Sequence[Log],
    joint: str,
    *,
    literal: bool = False,
    symmetric: bool | None = None,
    timing: Timing | None = None,
    delay: float | None = None,
) -> tuple[JointFriction, JointEvidence]:
    """Identify one joint's friction from sweeps.

    With several sweeps, the last one is predicted by a fit to the others, if these determine the gravity at its center. Then all
    are fitted together.

    Args:
        logs: one sweep each, of the same joint; several centers separate gravity from unequal directions.
        joint: name.
        literal: the procedure as printed, without corrections and standard errors.
        symmetric: True: one curve for both directions; False: one each; None: one unless they clearly differ.
        timing: the torque is a `command`, held from its sample on, or a `sample`, taken with the position; None: detected from
            the motion. If the motion shows neither, the delay of the drive is estimated; if it is not determined either, a
            command is assumed, with a warning.
        delay: of the logged torque behind the motion, if it is known [s]: 0 for a sample, minus half a sampling interval for a
            command; None: as the timing says.

    Raises:
        InvalidInput: no log, or one without torque.
        NotIdentifiable: no cycles of a sweep are found, or fewer than two reach their speed.
    """
    if not logs:
        raise InvalidInput("There is no log to identify from.", remedy="Pass at least one.")
    about = logs[0].select(joint).on_joint_side().joints[0]
    stretches = prepare_each(logs, joint) if literal else _prepare(logs, joint)
    delays, errors, remarks = drive_delays(logs, joint, stretches, timing, literal, delay)
    each, late = _each(logs, joint, stretches, delays, errors)
    used = each
    if literal:
        used = [
            pairs(log, joint, s, literal=True, delay=d)
            for log, s, d in zip(logs, stretches, delays, strict=True)
        ]

    def fit_to(part: slice) -> tuple[JointFriction, SweepFit]:
        off = [] if literal else late[part]
        found = fit(used[part], unit=about.unit, name=about.name, symmetric=symmetric, late=off)
        slip = -0.5 / stretches[part][0][0].rate - delays[part][0], errors[part][0]
        friction = _friction(about, found, each[part], off, stretches[part], slip, literal)
        return replace(friction, warnings=(*friction.warnings, *remarks)), found

    friction, found = fit_to(slice(None))
    parts = [parts_of(friction, log, True) for log in stretches]
    friction = replace(friction, fitted=assess_parts(part for log in parts for part in log))
    if len(logs) > 1:
        before, others = fit_to(slice(0, -1))
        if others.tells(each[-1].center):
            parts[-1] = parts_of(before, stretches[-1], False)
            friction = replace(friction, held_out=assess_parts(parts[-1]))
    of_curve = error_of_curve(friction)
    if not literal:
        of_curve = widen_below(friction.law, friction.validity.lowest_speed or 0.0, of_curve)
    every = [part for log in parts for part in log]
    support = evidence(friction, every, of_curve, settled=[] if literal else past_build_up(every))
    said = verdict(friction, found) + ("" if delay is None else f" {describe(delay)}")
    return friction, replace(support, verdict=said)


def fit_sweeps(
    logs: Sequence[Log], joint: str, *, symmetric: bool | None = None, timing: Timing | None = None
) -> SweepFit:
    """Return the curve of one joint with the covariance of its knots, from sweeps about one or several centers.

    Args:
        logs: one sweep each, of the same joint.
        joint: name.
        symmetric: as in `identify_sweep`.
        timing: as in `identify_sweep`.

    Raises:
        InvalidInput: no log, or one without torque.
        NotIdentifiable: no cycles of a sweep are found, or fewer than two reach their speed.
    """
    if not logs:
        raise InvalidInput("There is no log to identify from.", remedy="Pass at least one.")
    stretches = _prepare(logs, joint)
    delays, errors, remarks = drive_delays(logs, joint, stretches, timing, False)
    each, late = _each(logs, joint, stretches, delays, errors)
    unit = logs[0].joints[logs[0].column(joint)].unit
    found = fit(each, unit=unit, name=joint, symmetric=symmetric, late=late)
    return replace(found, warnings=(*found.warnings, *remarks))


def _prepare(logs: Sequence[Log], joint: str) -> list[list[Signals]]:
    """Return the stretches of each sweep, low-passed as an encoder's errors ask for."""
    cutoff = smoothing(logs, joint).cutoff
    return prepare_each(logs, joint, cutoff=cutoff)


def _each(
    logs: Sequence[Log],
    joint: str,
    stretches: Sequence[Sequence[Signals]],
    delays: Sequence[float],
    errors: Sequence[float],
) -> tuple[list[SweepKnots], list[SweepKnots]]:
    """Return the pairs of each sweep, and those for a delay off by its standard error; the latter are empty without errors."""
    each = [pairs(log, joint, s, delay=d) for log, s, d in zip(logs, stretches, delays, strict=True)]
    if not any(errors):
        return each, []
    off = [d + e for d, e in zip(delays, errors, strict=True)]
    return each, [
        pairs(log, joint, s, delay=d) if e else k
        for log, s, d, e, k in zip(logs, stretches, off, errors, each, strict=True)
    ]


def _inertia(knots: Sequence[SweepKnots], late: Sequence[SweepKnots]) -> tuple[float, float]:
    """Return the inertia of several sweeps and its standard error, which includes that of their delay [kg.m^2 or kg].

    Late viscous friction is in phase with the acceleration.
    """
    weight = 1.0 / np.array([k.inertia[1] for k in knots]) ** 2
    share = weight / weight.sum()
    moved = share @ [b.inertia[0] - a.inertia[0] for a, b in zip(knots, late, strict=True)] if late else 0.0
    return float(share @ [k.inertia[0] for k in knots]), float(np.hypot(1.0 / np.sqrt(weight.sum()), moved))


def _friction(
    joint: Joint,
    found: SweepFit,
    knots: Sequence[SweepKnots],
    late: Sequence[SweepKnots],
    stretches: Sequence[Sequence[Signals]],
    slip: tuple[float, float],
    literal: bool,
) -> JointFriction:
    inertia = _inertia(knots, late)
    speeds = np.concatenate([s.velocity for log in stretches for s in log])
    errors: dict[str, Any] = {
        "positive": tuple(found.error_pos.tolist()),
        "negative": tuple(found.error_neg.tolist()),
    }
    growth, lowest = None, min(float(k.V.min()) for k in knots)
    names, rows = [*knot_names(len(found.law.velocity)), *ALL], list(range(len(found.with_terms)))
    if found.load is not None:
        names, rows = [*names[:-1], "load_driving", "load_driven"], [*rows, rows[-1]]  # one slope for both
        slope, error, carried = found.load
        growth = Growth(load_driving=slope, load_driven=slope, load_carried=carried)
        errors |= {"load_driving": error, "load_driven": error}
    return JointFriction(
        joint=joint,
        law=Law(rate=found.law, growth=growth),
        standard_errors={} if literal else errors,
        dynamics=estimates({"inertia": inertia, "time_slip": slip, **found.terms}, joint.unit),
        covariance=Covariance.of(names, found.with_terms[np.ix_(rows, rows)]),
        validity=Validity(velocity=(float(speeds.min()), float(speeds.max())), lowest_speed=lowest),
        method="sweep",
        warnings=found.warnings,
    )
