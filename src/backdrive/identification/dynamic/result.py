"""Conversion of a fitted law to a joint of a model, with the evidence for the report."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from backdrive.identification.curves import SHARES, widen_below
from backdrive.identification.delay import earlier
from backdrive.identification.dynamic.crossing import of_sliding, sliding_only
from backdrive.identification.dynamic.fit import Fit
from backdrive.identification.dynamic.stretch import Stretch
from backdrive.identification.dynamic.unknowns import shares
from backdrive.identification.evidence import evidence
from backdrive.identification.misses import misses_at
from backdrive.identification.motion_bins import LONG_ENOUGH, slowest_sliding
from backdrive.identification.quality import WHERE_SLIDING, judge
from backdrive.identification.result import JointEvidence
from backdrive.identification.signals import Signals
from backdrive.identification.terms import RIGID, estimates
from backdrive.laws import CoulombViscous
from backdrive.logs.log import Joint
from backdrive.model import Covariance, Estimate, JointFriction, Validity

DYNAMICS = (*RIGID, "delay")


def finish(
    joint: Joint,
    final: Fit,
    judged: Fit,
    pairs: Sequence[tuple[Signals, Stretch]],
    unseen: Sequence[tuple[Signals, Stretch]],
    masks: Sequence[np.ndarray],
    given: Mapping[str, Estimate],
    how: str = "torque given motion",
) -> tuple[JointFriction, JointEvidence]:
    """Return a joint's friction and its evidence, from a fit of torque.

    Args:
        joint: the joint.
        final: fit to all data.
        judged: fit without the held-out data.
        pairs: fitted signals and stretches.
        unseen: signals and stretches of held-out logs; empty: held-out windows of the fitted ones are judged.
        masks: held-out samples of each judged stretch, (n,).
        given: terms of the dynamics that were not fitted, by name.
        how: kind of the fit, for the name of the method.
    """
    stretches = [s for _, s in pairs]
    v = np.concatenate([s.velocity for s in stretches])
    ends = [float(end(s.velocity)) for s, _ in pairs for end in (np.min, np.max)]
    load = [s.load[:, 1] for s in stretches if s.load.shape[0] > 1]
    warmth = [s.temperature for s in stretches if s.temperature.size > 1]
    predicted = final.predict(stretches)
    sought = {t: (final.values[t], final.standard_errors[t]) for t in DYNAMICS if t in final.values}
    dynamics = estimates(sought, joint.unit) | dict(given)
    tests = [s for _, s in unseen]
    judges = tests or stretches
    slowest = slowest_sliding([s for s, _ in pairs], float(np.abs(v).max()) * np.array(SHARES))
    slowest = max(slowest, slowest_of(final))
    friction = JointFriction(
        joint=joint,
        law=final.law,
        standard_errors=errors(final),
        at_bound=tuple(sorted({n.partition("[")[0] for n in final.at_bound if n not in DYNAMICS})),
        dynamics=dynamics,
        covariance=law_covariance(final, dynamics),
        validity=Validity(
            velocity=(min(*ends, 0.0), max(*ends, 0.0)),
            load=_span(load),
            nominal_load=float(np.abs(np.concatenate(load)).mean()) if load else None,
            lowest_speed=slowest,
            temperature=_span(warmth),
        ),
        fitted=judge(
            (s.torque, tau, 1.0 / s.dt, s.judged)
            for s, tau in zip(sliding_only(final, stretches), predicted, strict=True)
        ),
        held_out=judge(
            (s.torque, tau, 1.0 / s.dt, s.judged & mask)
            for s, tau, mask in zip(sliding_only(judged, judges), judged.predict(judges), masks, strict=True)
        ),
        method=f"fit of {final.name}: {how}{WHERE_SLIDING if of_sliding(final) else ''}",
        warnings=final.warnings,
    )
    parts: list[tuple[Signals, np.ndarray, np.ndarray, bool]] = []
    series = zip(
        [*pairs, *unseen],
        [*predicted, *final.predict(tests)],
        [True] * len(pairs) + [False] * len(tests),
        strict=True,
    )
    for (signals, s), tau, seen in series:
        known = 0.0 if signals.model_torque is None else signals.model_torque
        rest = tau - final.predict([s], friction=True)[0] + known
        parts.append((signals, s.torque + known - rest, tau + known, seen))
    return friction, evidence(friction, parts, error_of_curve(final, slowest))


def error_of_curve(final: Fit, slowest: float) -> Callable[[np.ndarray], np.ndarray]:
    """Return the function from velocities to the standard error of the steady curve [N.m or N].

    That of a straight line counts what the line misses at a speed. Below the slowest sliding, a Stribeck peak is possible, unless
    the law describes one, or rest.

    Args:
        final: the fit.
        slowest: speed of sliding that was fitted [rad/s or m/s].
    """
    of_curve = partial(band, final)
    stretches = getattr(final.problem, "stretches", ())  # none of a fit of motion, which sees rest
    told = not final.law.element.SET_VALUED or any(name.startswith("breakaway") for name in final.values)
    if told or not stretches:
        return of_curve
    if isinstance(final.law.rate, CoulombViscous):
        late, begin = final.values.get("delay", 0.0), np.cumsum([0, *(len(s.torque) + 1 for s in stretches)])
        rows = [b + np.flatnonzero(s.judged) for b, s in zip(begin, stretches, strict=False)]
        velocity = [earlier(s.velocity, late / s.dt)[s.judged] for s in stretches]
        moves = (joined := np.concatenate(velocity)) != 0.0
        alike = final.law.rate.coulomb_positive == final.law.rate.coulomb_negative
        error = np.concatenate(final.errors())[moves]
        of_curve = misses_at(np.concatenate(rows)[moves], joined[moves], -error, slowest, alike).beside(
            of_curve
        )
    return widen_below(final.law, slowest, of_curve)


def slowest_of(final: Fit) -> float:
    """Return the speed from which on enough samples were fitted, of a fit to sliding alone [rad/s or m/s]; 0 of another one."""
    stretches = [s for s in getattr(final.problem, "stretches", ()) if s.only_sliding]
    if not stretches:
        return 0.0
    speeds = np.sort(np.concatenate([np.abs(s.velocity[s.judged]) for s in stretches]))
    return float(speeds[min(round(LONG_ENOUGH / stretches[0].dt), speeds.size // 2)])


def errors(final: Fit) -> dict[str, Any]:
    """Return the standard errors by parameter of the law: one number, or one per element."""
    found: dict[str, Any] = {}
    known = law_covariance(final)
    by_row = {} if known is None else known.standard_errors()
    for rows in (final.law.rate, final.law.element):
        for name, parameter in rows.PARAMETERS.items():
            if name in final.standard_errors:
                found[name] = final.standard_errors[name]
            elif parameter.many and name == "share":
                count = len(getattr(rows, name))
                found[name] = tuple(by_row.get(f"share[{i}]", float("nan")) for i in range(count))
            elif parameter.many:
                found[name] = tuple(
                    final.standard_errors.get(f"{name}[{i}]", float("nan"))
                    for i in range(len(getattr(rows, name)))
                )
    return found


def law_covariance(final: Fit, dynamics: Iterable[str] = ()) -> Covariance | None:
    """Return the covariance of the law's parameters and of terms of the dynamics; None if the fit has none.

    Args:
        final: the fit.
        dynamics: names of the terms.
    """
    sought, ties = final.covariance, final.problem.shape.ties
    if sought is None:
        return None
    row_of = dict(zip(sought.names, np.eye(len(sought.names)), strict=True))
    rows: dict[str, np.ndarray] = {}
    for part in (final.law.rate, final.law.element):
        for name, parameter in part.PARAMETERS.items():
            count = len(getattr(part, name)) if parameter.many else 0
            if parameter.many and name == "share":
                rows |= _share_rows(final, count, row_of)
                continue
            for one in [f"{name}[{i}]" for i in range(count)] or [name]:
                if ties.get(one, one) in row_of:
                    rows[one] = row_of[ties.get(one, one)]
    rows |= {name: row_of[name] for name in dynamics if name in row_of and name not in rows}
    spread = np.array(list(rows.values()))
    return Covariance.of(tuple(rows), spread @ sought.array() @ spread.T) if rows else None


def _share_rows(final: Fit, count: int, row_of: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the derivatives of shares with respect to the fit's parameters; empty if a ratio has no variance."""
    ratios = [f"share[{i}]" for i in range(count - 1)]
    if not ratios or any(name not in row_of for name in ratios):
        return {}
    part = np.array(shares([final.values[name] for name in ratios]))
    slopes = (np.diag(part) - np.outer(part, part))[:, :-1] @ np.array([row_of[name] for name in ratios])
    return {f"share[{i}]": row for i, row in enumerate(slopes)}


def band(final: Fit, velocity: np.ndarray) -> np.ndarray:
    """Return the standard error of the steady curve at velocities [N.m or N]."""
    if final.covariance is None:
        return np.full(velocity.shape, np.nan)
    problem, names = final.problem, final.covariance.names
    rows = [
        k for k, name in enumerate(names) if name in problem.names
    ]  # those of a drive do not move the curve
    centre, columns = final.law.torque(velocity), []
    for i in (problem.names.index(names[k]) for k in rows):
        moved = final.found.point.copy()
        step = -1e-5 if moved[i] + 1e-5 > problem.upper[i] else 1e-5
        moved[i] += step
        slope = problem.unknowns[i].slope(final.values[problem.names[i]])
        law = problem.shape.law(problem.values(moved))
        columns.append((law.torque(velocity) - centre) / (step * slope))
    J = np.array(columns).T
    C = final.covariance.array()[np.ix_(rows, rows)]
    return np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", J, C, J), 0.0))


def _span(series: list[np.ndarray]) -> tuple[float, float] | None:
    if not series:
        return None
    joined = np.concatenate(series)
    return float(joined.min()), float(joined.max())
