"""Friction of a single axis from any motion: inverse dynamics, linear in its parameters.

    tau = inertia (ddq - slip dddq) + offset + gravity + tau_model + tau_f(dq)

Torque and every regressor are averaged over the same short bins, which filters both sides alike. The curve is line sections or
Coulomb and viscous, equal in both directions or not; the data choose by blocked cross-validation. Huber's weights keep single wild
samples from mattering.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from backdrive.errors import NotIdentifiable
from backdrive.identification import curves, design, regression
from backdrive.identification.dynamics import predict, rest_of_dynamics
from backdrive.identification.evidence import evidence, parts_of, sentences
from backdrive.identification.quality import assess, judge
from backdrive.identification.result import JointEvidence
from backdrive.identification.signals import Signals, prepare
from backdrive.identification.smoothing import smoothing
from backdrive.identification.terms import estimates
from backdrive.logs.log import Joint, Log
from backdrive.model import Covariance, JointFriction, Validity
from backdrive.model.covariance import errors_by_parameter

BIN_TIME = 0.01  # torque and regressors are averaged over this long [s]
BLOCK_TIME = 1.5  # aimed length of a cross-validation block [s]
BLOCKS = (8, 24)  # least and most blocks
SHORT, FEW_TURNS = 4.0, 4  # less motion [s], or fewer reversals, is remarked on
SUSTAINED = 0.1  # a joint slides where its velocity would last so long at its acceleration [s]
SPAN_FOR_GRAVITY = 0.15  # a rotary joint must travel so far before gravity is looked for [rad]
Columns = Callable[[Signals, np.ndarray, slice], np.ndarray]
CHUNK = 200_000  # samples turned into a regressor at a time


def identify_motion(
    logs: Sequence[Log],
    joint: str,
    *,
    held_out: Sequence[Log] = (),
    cutoff: float | None = None,
    gravity: bool | None = None,
    symmetric: bool | None = None,
    law: str | None = None,
) -> tuple[JointFriction, JointEvidence]:
    """Identify one joint from arbitrary motion.

    Args:
        logs: of the same joint; each needs torque and position (or velocity).
        joint: name.
        held_out: logs to judge on; without any, blocks of the fitted logs are held out in turn.
        cutoff: low pass of the motion before differentiation [Hz]; None: by sampling rate and encoder (`smoothing`).
        gravity: estimate gravity as sin q and cos q; None: where the data ask for it.
        symmetric: force one curve for both directions (True) or one each (False); None: what the data ask for.
        law: `coulomb-viscous` or `polyline` to allow only that; None: what the data ask for.

    Raises:
        InvalidInput: a log holds no torque.
        NotIdentifiable: the motion does not determine a curve.
    """
    smooth = smoothing([*logs, *held_out], joint, cutoff)
    stretches = [s for log in logs for s in prepare(log, joint, cutoff=smooth.cutoff)]
    about = logs[0].select(joint).joints[0]
    speeds = np.concatenate([s.velocity[s.moving] for s in stretches])
    if not speeds.size or not np.max(np.abs(speeds)) > 0:
        raise NotIdentifiable(
            f"Joint '{joint}' does not move in these logs.", remedy="Name a joint that moves."
        )
    top = float(np.percentile(np.abs(speeds), 99.9))
    knots = top * np.array(curves.SHARES)
    blocks = binned(stretches, knots)
    positions = [s.position for s in stretches if s.position is not None]
    travel = max((float(np.ptp(p)) for p in positions), default=0.0)
    both = bool(min(-speeds.min(), speeds.max()) > 0.05 * top)
    choice = design.choose(
        blocks,
        design.candidates(
            knots,
            {name: knots[list(keep)] for name, keep in curves.of_law(law).items()},
            dynamic=True,
            slip=True,
            gravity=gravity if about.unit == "rad" and travel > SPAN_FOR_GRAVITY else False,
            model_torque=any(s.model_torque is not None for s in stretches),
            both_directions=both,
            symmetric=symmetric,
        ),
    )
    choice = design.offset_apart(choice)
    friction = as_friction(choice, choice.coefficients, about, (float(speeds.min()), float(speeds.max())))
    friction = with_warnings(friction, choice, both)
    duration = sum(float(np.count_nonzero(s.moving)) / s.rate for s in stretches)
    turns = sum(int(np.count_nonzero(np.diff(np.sign(s.velocity[s.moving])))) for s in stretches)
    slowest = slowest_sliding(stretches, knots)
    remarks = sentences(
        (smooth.warning, smooth.warning),
        (
            duration < SHORT or turns < FEW_TURNS,
            f"Only {duration:.2g} s of motion with {turns} reversals: too little to separate friction from the rest surely.",
        ),
        (
            np.any((choice.candidate.form.knots > 0.0) & (choice.candidate.form.knots < slowest)),
            f"Below {slowest:.2g} {about.unit}/s the joint moved only while it turned round: what the curve shows there is the "
            "torque of reversals, not sliding friction.",
        ),
    )
    others = [s for log in held_out for s in prepare(log, joint, cutoff=smooth.cutoff)]
    unseen = _left_out(stretches, choice, about, friction.validity.velocity) if not held_out else None
    load = np.concatenate([rest_of_dynamics(friction, s) for s in stretches])
    friction = replace(
        friction,
        warnings=(*friction.warnings, *remarks),
        fitted=assess(friction, stretches),
        held_out=assess(friction, others) if unseen is None else judge(unseen),
        validity=replace(
            friction.validity,
            load=(float(load.min()), float(load.max())),
            nominal_load=float(np.abs(load).mean()),
            lowest_speed=slowest,
        ),
    )
    k = len(choice.candidate.terms)
    support = evidence(
        friction,
        parts_of(friction, stretches, True) + parts_of(friction, others, False),
        curves.error_of_curve(choice.candidate.form, choice.covariance[k:, k:]),
    )
    return friction, replace(support, verdict=f"{support.verdict} {smooth.note}".rstrip())


def slowest_sliding(stretches: Sequence[Signals], knots: np.ndarray) -> float:
    """Return the slowest knot near which the joint kept its velocity for a while [rad/s or m/s].

    Args:
        stretches: of one joint.
        knots: speeds, ascending from zero [rad/s or m/s], (k,).
    """
    for knot in knots[1:]:
        kept = 0.0
        for s in stretches:
            speed = np.abs(s.velocity)
            steady = np.abs(s.acceleration) * SUSTAINED < speed
            kept += float(np.count_nonzero(steady & (speed > 0.5 * knot) & (speed < 1.5 * knot))) / s.rate
        if kept >= SUSTAINED:
            return float(knot)
    return float(knots[-1])


def bins(s: Signals) -> tuple[int, int]:
    """Return the width of a bin and the number of whole bins [sample]."""
    width = max(1, round(BIN_TIME * s.rate))
    return width, s.time.size // width


def block_count(stretches: Sequence[Signals]) -> int:
    """Return how many blocks of neighbouring samples all stretches together are cut into."""
    duration = sum(s.time.size / s.rate for s in stretches)
    return int(np.clip(duration / BLOCK_TIME, *BLOCKS))


def binned(
    stretches: Sequence[Signals], knots: np.ndarray, columns: Columns = design.columns
) -> regression.Blocks:
    """Return the robustly weighted normal equations of all columns, by block of neighbouring samples.

    Args:
        stretches: of one joint.
        knots: of the curve among the columns [rad/s or m/s], (k,).
        columns: what gives the regressor of some samples of a stretch, (n, p).
    """
    parts = []
    for s in stretches:
        width, count = bins(s)
        per_chunk = max(1, CHUNK // width)
        for first in range(0, count, per_chunk):
            n = min(per_chunk, count - first)
            rows = slice(first * width, (first + n) * width)
            series = columns(s, knots, rows), s.torque[rows], s.moving[rows]
            parts.append([x.reshape(n, width, -1).mean(axis=1) for x in series])
    X, y, w = (np.concatenate(part) for part in zip(*parts))
    w = regression.robust_weights(X, y[:, 0], np.where(w > 0.5, w, 0.0)[:, 0])
    count = block_count(stretches)
    return regression.accumulate(X, y[:, 0], w, regression.block_index(len(y), count), count)


def as_friction(
    choice: design.Choice, coefficients: np.ndarray, joint: Joint, velocity: tuple[float, float]
) -> JointFriction:
    """Return the joint's friction for a vector of coefficients of the chosen candidate."""
    candidate = choice.candidate
    k = len(candidate.terms)
    law = curves.to_law(candidate.form, coefficients[k:])
    parameters, of_law = curves.sensitivity(candidate.form, law)
    terms = [("time_slip" if term == "jerk" else term) for term in candidate.terms]
    size = [
        1.0 / coefficients[candidate.terms.index("inertia")] if term == "jerk" else 1.0
        for term in candidate.terms
    ]
    spread = np.zeros((k + len(parameters), coefficients.size))
    spread[:k, :k], spread[k:, k:] = np.diag(size), of_law
    names, covariance = (*terms, *parameters), spread @ choice.covariance @ spread.T
    errors = errors_by_parameter(names, covariance)
    values = {term: (value * s, errors[term]) for term, value, s in zip(terms, coefficients, size)}
    return JointFriction(
        joint=joint,
        law=law,
        standard_errors={name: e for name, e in errors.items() if name not in terms},
        dynamics=estimates(values, joint.unit),
        covariance=Covariance.of(names, covariance),
        validity=Validity(velocity=velocity),
        method="motion",
    )


def with_warnings(friction: JointFriction, choice: design.Choice, both_directions: bool) -> JointFriction:
    """Return the result with what makes it suspect said in sentences."""
    symmetric, apart = choice.candidate.form.symmetric, "offset" in choice.candidate.terms
    warnings = sentences(
        (
            not both_directions,
            "The joint moved in one direction only: friction and a constant torque cannot be told apart.",
        ),
        (
            not symmetric and apart,
            "Friction at rest was taken as equal in both directions, and the constant torque that is left as an offset: "
            "the data cannot tell the two apart.",
        ),
        (
            not symmetric and not apart,
            "A constant bias torque (cable, current offset, gravity) cannot be told from friction that differs by "
            "direction; what there is of it is in the friction.",
        ),
        (
            choice.condition > 1e4,
            f"The motion separates the terms poorly (condition number {choice.condition:.1e}).",
        ),
    )
    return replace(friction, warnings=warnings)


def _left_out(stretches, choice, joint, velocity):
    """Predict every block by the fit that did not see it."""
    bare = replace(choice, covariance=np.zeros_like(choice.covariance))  # a prediction needs no errors
    models = [as_friction(bare, theta, joint, velocity) for theta in choice.left_out]
    block = regression.block_index(sum(bins(s)[1] for s in stretches), len(models))
    first, pairs = 0, []
    for s in stretches:
        width, count = bins(s)
        of_bin = block[first : first + count] if count else np.zeros(1, dtype=int)
        first += count
        of_sample = of_bin[np.minimum(np.arange(s.time.size) // width, of_bin.size - 1)]
        edges = np.searchsorted(of_sample, np.unique(of_sample)).tolist()
        rows = [slice(a, b) for a, b in zip(edges, [*edges[1:], s.time.size])]
        predicted = [predict(models[of_sample[part.start]], s.rows(part)) for part in rows]
        pairs.append((s.torque, np.concatenate(predicted), s.rate, s.moving))
    return pairs
