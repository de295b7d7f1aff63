"""The combination of a joint's result with a prior: what is known from its siblings, or from a former model.

The model then holds the combined numbers, and `JointFriction.prior` both sides and their distance. A result that contradicts
its prior keeps its own numbers, with a remark. Since the numbers move by a few standard errors at most, the residual hardly
changes; residual and samples of the evidence are those of the log alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.identification.conjugate import Update, conjugate
from backdrive.identification.evidence import verdict
from backdrive.identification.result import JointEvidence
from backdrive.logs.joint import Source
from backdrive.logs.log import Log
from backdrive.model import Covariance, FrictionModel, JointFriction, Prior, PriorComparison, PriorNumber
from backdrive.model.prior import DIGITS, each_way
from backdrive.model.sample import law_numbers, law_with

UNLIKELY = 0.01  # p-value below which a log contradicts its prior and is not combined with it [-]
SAME = 1e-6  # distance of log and prior below which they are the same data [-]
STEP = 1e-5  # of a parameter for a derivative, relative to it [-]
COLUMNS = ("log", "log_error", "prior", "prior_error", "combined", "combined_error")
SPEEDS = 4  # in each direction at which the curve of a law without knots is a prior


def as_priors(given: Any) -> tuple[Prior, ...]:
    """Return priors by joint from what `identify` takes.

    Args:
        given: None, a `Prior`, several, a friction model with errors, or a population (which has `priors()`).

    Raises:
        InvalidInput: it is none of these, has two priors of one joint, or a model without errors.
    """
    if given is None:
        return ()
    if isinstance(given, FrictionModel):
        given = [prior_of(joint, given.sources) for joint in given.joints]
    elif hasattr(given, "priors"):
        given = given.priors()
    priors = (
        (given,) if isinstance(given, Prior) else tuple(given) if isinstance(given, (list, tuple)) else ()
    )
    if not priors or not all(isinstance(prior, Prior) for prior in priors):
        raise InvalidInput(
            f"prior = {given!r:.60}.",
            remedy="Give a population (`fleet.merge`), a friction model with errors, or objects of `model.Prior`.",
        )
    names = [prior.joint for prior in priors]
    for name in names:
        if names.count(name) > 1:
            raise InvalidInput(
                f"There are {names.count(name)} priors of joint '{name}'.", remedy="Give one of each joint."
            )
    return priors


def prior_of(friction: JointFriction, sources: Sequence[Source] = ()) -> Prior:
    """Return a joint's identified friction as a prior: lines of Coulomb and viscous friction, else torques at knots or speeds.

    Args:
        friction: of the joint.
        sources: files that it was identified from.

    Raises:
        InvalidInput: the model has no errors.
    """
    rate, (low, high) = friction.law.rate, friction.validity.velocity
    unit, slopes = friction.joint.torque_unit, ()
    if rate.NAME == "coulomb-viscous" and low < 0.0 < high:
        velocity, weights = each_way(min(-low, high))
        names = tuple(f"{part}_{way}" for way in ("positive", "negative") for part in ("coulomb", "viscous"))
        units, slopes = (
            tuple(rate.PARAMETERS[name].unit_for(friction.joint.unit) for name in names),
            (0, 1, 0, 1),
        )
    else:
        speeds = np.asarray(
            getattr(rate, "velocity", np.geomspace(friction.speeds[0], friction.speeds[1], SPEEDS))
        )
        velocity = np.concatenate([speeds, -speeds])
        velocity = velocity[(velocity >= low) & (velocity <= high)]
        weights = np.diag(np.sign(velocity))
        names = tuple(f"friction at {v:.3g}" for v in velocity)
        units = (unit,) * velocity.size
    if not _has_errors(friction):
        raise InvalidInput(
            f"Joint '{friction.joint.name}': the model has no standard errors, so it is no prior.",
            remedy="Give one that was identified from a log; presets hold published values without errors.",
        )
    theta, C, rows = estimate(friction)
    H = weights @ _jacobian(friction, rows, theta, velocity)
    return Prior(
        joint=friction.joint.name,
        unit=friction.joint.unit,
        source=f"model of '{friction.joint.name}'" + (f", {friction.method}" if friction.method else ""),
        names=names,
        units=units,
        velocity=velocity,
        weights=weights,
        mean=weights @ friction.law.torque(velocity),
        covariance=H @ C @ H.T,
        slopes=tuple(map(bool, slopes)),
        logs=tuple(s.sha256 for s in sources) + (friction.prior.logs if friction.prior else ()),
    )


def with_priors(
    friction: Sequence[JointFriction],
    evidence: Sequence[JointEvidence],
    priors: Sequence[Prior],
    logs: Sequence[Log],
    warnings: list[str],
) -> tuple[list[JointFriction], list[JointEvidence]]:
    """Return friction and evidence of every joint after its prior; joints without one are named in `warnings`.

    Raises:
        InvalidInput: the priors are of other joints or another unit, or hold one of these logs.
    """
    if not priors:
        return list(friction), list(evidence)
    by_name = {prior.joint: prior for prior in priors}
    if len(priors) == len(friction) == 1:  # the only joint, whatever it is called
        by_name = {friction[0].joint.name: priors[0]}
    if not any(one.joint.name in by_name for one in friction):
        raise InvalidInput(
            f"The prior is of {', '.join(by_name)}, the logs of {', '.join(one.joint.name for one in friction)}.",
            remedy="Name the joints alike (--names), or leave the prior out.",
        )
    results = []
    for one, each in zip(friction, evidence, strict=True):
        prior, name = by_name.get(one.joint.name), one.joint.name
        if prior is None:
            warnings.append(f"The prior does not contain joint '{name}': its numbers are the log's alone.")
            results.append((one, each))
            continue
        if prior.unit != one.joint.unit:
            raise InvalidInput(
                f"Joint '{name}' is in {one.joint.unit}, and in {prior.unit} in the prior.",
                remedy="Read the log with the unit of the prior (--unit).",
            )
        if not _has_errors(one):
            warnings.append(
                f"Joint '{name}': the log alone gives no standard errors, so it cannot be weighed against the prior: the numbers "
                "are the log's alone."
            )
            results.append((one, each))
            continue
        near = prior.at(_temperature(logs, name)).within(*one.validity.velocity)
        if near is None:
            warnings.append(
                f"Joint '{name}': the prior ends at {np.abs(prior.velocity).max():.3g} {prior.unit}/s, and the log moves from "
                f"{one.validity.velocity[0]:.3g} to {one.validity.velocity[1]:.3g}: the numbers are the log's alone."
            )
            results.append((one, each))
            continue
        after = combine(one, near)
        _independent(after, near, logs)
        results.append((after, _after(each, one, after)))
    both = tuple(map(list, zip(*results, strict=True)))
    return both[0], both[1]


def combine(friction: JointFriction, prior: Prior) -> JointFriction:
    """Return a joint's result after a prior, which `prior` in it describes.

    Args:
        friction: by the log alone.
        prior: of what the log shows (`Prior.within`).

    Raises:
        InvalidInput: the combination is beyond the range of the law.
    """
    theta, C, rows = estimate(friction)
    H = prior.weights @ _jacobian(friction, rows, theta, prior.velocity)
    h = prior.weights @ friction.law.torque(prior.velocity)
    update = conjugate(theta, C, H, h, prior.mean, prior.covariance, prior.robots)
    applied = update.p >= UNLIKELY
    after = _with_numbers(friction, rows, update) if applied else friction
    errors = [np.sqrt(np.diag(M)) for M in (H @ C @ H.T, prior.covariance, H @ update.covariance @ H.T)]
    both = h + H @ (update.mean - theta)
    columns = (h, errors[0], prior.mean, errors[1], both, errors[2])
    return replace(
        after,
        prior=PriorComparison(
            source=prior.source,
            applied=applied,
            distance=update.distance,
            degrees=update.degrees,
            p=update.p,
            numbers=tuple(
                PriorNumber(name=name, unit=unit, **dict(zip(COLUMNS, map(float, values), strict=True)))
                for name, unit, *values in zip(prior.names, prior.units, *columns, strict=True)
            ),
            log_alone={
                row: (value, error)
                for row, value, error in zip(rows, theta.tolist(), np.sqrt(np.diag(C)).tolist(), strict=True)
            }
            if applied
            else {},
            logs=prior.logs if applied and prior.robots is None else (),
        ),
    )


def _independent(friction: JointFriction, prior: Prior, logs: Sequence[Log]) -> None:
    """Refuse a prior that holds one of the logs, which would count it twice."""
    held = {digest[:DIGITS] for digest in prior.logs}
    again = [s.path for log in logs for s in log.sources if s.sha256[:DIGITS] in held]
    assert friction.prior is not None
    if again or friction.prior.distance < SAME:
        raise InvalidInput(
            f"Joint '{friction.joint.name}': the prior ({prior.source}) holds "
            f"{again[0] if again else 'this very log'}, which would count twice.",
            remedy="Give a prior from other logs: a population merged without this robot (`fleet merge --without ROBOT`), or the "
            "model of an earlier log; or leave it out.",
        )


def estimate(friction: JointFriction) -> tuple[np.ndarray, np.ndarray, tuple[str, ...]]:
    """Return a joint's numbers with known errors, (m,), their covariance, (m, m), and the names of its rows."""
    names, values, *_ = law_numbers(friction.law)
    known = dict(zip(names, values.tolist(), strict=True)) | {
        k: e.value for k, e in friction.dynamics.items()
    }
    if friction.covariance is not None:
        rows, C = friction.covariance.names, friction.covariance.array()
    else:
        errors: dict[str, float] = {}
        for name, error in friction.standard_errors.items():
            several = isinstance(error, (list, tuple))
            errors |= {f"{name}[{i}]": e for i, e in enumerate(error)} if several else {name: error}
        errors = {name: e for name, e in errors.items() if e > 0.0 and np.isfinite(e)}
        rows, C = tuple(errors), np.diag(np.square(list(errors.values())))
    return np.array([known[row] for row in rows]), C, rows


def _has_errors(friction: JointFriction) -> bool:
    """Return whether standard errors of a joint's law are known."""
    return any(row in law_numbers(friction.law)[0] for row in estimate(friction)[2])


def _jacobian(
    friction: JointFriction, rows: Sequence[str], theta: np.ndarray, velocity: np.ndarray
) -> np.ndarray:
    """Return the derivative of friction at velocities, (n,), by the joint's numbers, (n, m); 0 for terms of the dynamics."""
    names, values, *_ = law_numbers(friction.law)
    J = np.zeros((velocity.size, len(rows)))
    at = friction.law.torque(velocity)
    for k, row in enumerate(rows):
        if row not in names:
            continue
        i, step = names.index(row), STEP * max(abs(theta[k]), STEP)
        moved = []
        for sign in (1.0, -1.0):
            numbers = values.copy()
            numbers[i] += sign * step
            law = law_with(friction.law, names, numbers)  # None beyond a bound
            moved += [(sign * step, law.torque(velocity))] if law else []
        ahead, behind = (moved[0], moved[1]) if len(moved) > 1 else (moved[0], (0.0, at))
        J[:, k] = (ahead[1] - behind[1]) / (ahead[0] - behind[0])
    return J


def _with_numbers(friction: JointFriction, rows: Sequence[str], update: Update) -> JointFriction:
    """Return a joint with other numbers and covariance; numbers of the law stay within their bounds."""
    names, numbers, low, high = law_numbers(friction.law)
    errors: dict[str, Any] = dict(friction.standard_errors)
    dynamics = dict(friction.dynamics)
    covariance = Covariance.of(rows, update.covariance)
    for row, value, variance in zip(rows, update.mean.tolist(), np.diag(update.covariance), strict=True):
        error, (name, _, index) = float(np.sqrt(variance)), row.partition("[")
        if row in dynamics:
            dynamics[row] = replace(dynamics[row], value=value, standard_error=error)
            continue
        i = names.index(row)
        numbers[i] = np.clip(value, low[i], high[i])
        if index:
            knots = list(errors.get(name, [np.nan] * sum(n.startswith(f"{name}[") for n in names)))
            knots[int(index[:-1])] = error
            errors[name] = tuple(knots)
        else:
            errors[name] = error
    law = law_with(friction.law, names, numbers)
    if law is None:
        raise InvalidInput(
            f"Joint '{friction.joint.name}': log and prior together leave the range of '{friction.law.name}'.",
            remedy="Leave the prior out.",
        )
    return replace(friction, law=law, dynamics=dynamics, standard_errors=errors, covariance=covariance)


def _after(evidence: JointEvidence, before: JointFriction, after: JointFriction) -> JointEvidence:
    """Return the evidence with curve and verdict of the combination."""
    assert after.prior is not None
    text = evidence.verdict.replace(verdict(before), verdict(after))
    curve, band = evidence.curve, []
    for one in (before, after):
        theta, C, rows = estimate(one)
        J = _jacobian(one, rows, theta, curve.velocity)
        band.append(np.sqrt(np.maximum(np.sum((J @ C) * J, axis=1), 0.0)))
    # the method's own band may be wider than its parameters tell, as below the slowest sliding
    narrower = np.divide(band[1], band[0], out=np.ones_like(band[0]), where=band[0] > 0.0)
    curve = replace(
        curve, torque=after.law.torque(curve.velocity), standard_error=curve.standard_error * narrower
    )
    return replace(evidence, curve=curve, verdict=f"{text} {after.prior.sentence}")


def _temperature(logs: Sequence[Log], joint: str) -> float | None:
    """Return the middle of a joint's temperatures in the logs [degC]; None if they hold none."""
    every = [log.select(joint).temperature for log in logs]
    known = [x[np.isfinite(x)] for x in every if x is not None]
    both = np.concatenate(known) if known else np.empty(0)
    return float(0.5 * (both.min() + both.max())) if both.size else None
