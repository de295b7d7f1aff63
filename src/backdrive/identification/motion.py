"""Friction of a single axis from any motion: inverse dynamics, linear in its parameters.

    tau = inertia (ddq - slip dddq) + offset + gravity + tau_model + tau_f(dq)

Torque and every regressor are averaged over the same short bins, which filters both sides alike. The curve is a polyline or
Coulomb and viscous friction, equal in both directions or not; it is chosen by blocked cross-validation. Huber's weights limit
the influence of outliers.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from backdrive.errors import NotIdentifiable
from backdrive.identification import curves, design, noise
from backdrive.identification.bends import with_bends
from backdrive.identification.block_prediction import predict_blocks
from backdrive.identification.crossing_fit import TOLD
from backdrive.identification.delay import delay_signals, sliding_in_step
from backdrive.identification.delay_bins import DelayStretch, bins_at_delay
from backdrive.identification.delay_slope import change_with_delay
from backdrive.identification.evidence import constant_beside, evidence, parts_of, sentences, without_errors
from backdrive.identification.jerk import clear_jerk
from backdrive.identification.misses import Misses, misses_of
from backdrive.identification.model_torque import LEFT_OUT, leave_out
from backdrive.identification.motion_bins import (
    BIN_TIME,
    HALF,
    LONG_ENOUGH,
    Bins,
    bin_means,
    bin_time,
    moves,
    slowest_sliding,
)
from backdrive.identification.motion_crossings import slip_at_crossings, with_crossings
from backdrive.identification.motion_friction import as_friction, warnings_of
from backdrive.identification.path import along_path, without_gravity
from backdrive.identification.quality import assess_both, assess_parts
from backdrive.identification.regression import Blocks
from backdrive.identification.remark import NO_ERRORS
from backdrive.identification.result import JointEvidence
from backdrive.identification.settling import after_build_up, build_up
from backdrive.identification.signals import SLOW, Signals, default_cutoff, prepare, prepare_each, turns
from backdrive.identification.slip import CLOSE, FEW, Slip, fix_slip, search_slip
from backdrive.identification.slip_effect import response, with_slip
from backdrive.identification.smoothing import smoothing
from backdrive.identification.user_delay import describe
from backdrive.identification.whitening import WHITE, Colour
from backdrive.identification.windows import windows_of
from backdrive.logs.log import Log
from backdrive.logs.quantiles import quantile
from backdrive.model import JointFriction

SHORT, FEW_TURNS = 4.0, 4  # least duration of motion [s] and least number of reversals without a remark
LEAST_FREEDOM = 3  # least number of degrees of freedom for standard errors
LEAST_MOVES = 6  # least number of moves for standard errors
ROUGH = ("line", "5 sections")  # curves of the candidate with which the delay is fitted, if a line is allowed
ENOUGH = 300_000  # largest number of samples for a rough delay and for the candidate with which the delay is fitted
SPAN_FOR_GRAVITY = (
    0.03  # least travel of a rotary joint for the estimation of gravity that nobody asked for [rad]
)
FORGETS = (
    0.05  # time in which the noise forgets, from which on reversals may tell more than what goes before [s]
)
NONE = np.empty(0)  # no jerk
NAMED = 0.05  # least constant beside the friction that is mentioned, relative to it [-]


def identify_motion(  # noqa: PLR0915  (the steps of one method in a row)
    logs: Sequence[Log],
    joint: str,
    *,
    held_out: Sequence[Log] = (),
    cutoff: float | None = None,
    gravity: bool | None = None,
    symmetric: bool | None = None,
    law: str | None = None,
    delay: float | None = None,
) -> tuple[JointFriction, JointEvidence]:
    """Identify one joint from arbitrary motion.

    Args:
        logs: of the same joint; each needs torque and position (or velocity).
        joint: name.
        held_out: logs to judge on; without any, blocks of the fitted logs are held out in turn.
        cutoff: low pass of the motion before differentiation [Hz]; None: from sampling rate and encoder (`smoothing`).
        gravity: estimate gravity as sin q and cos q; None: chosen by cross-validation.
        symmetric: force one curve for both directions (True) or one each (False); None: chosen by cross-validation.
        law: `coulomb-viscous` or `polyline` to allow only that; None: chosen by cross-validation.
        delay: of the torque behind the motion, if it is known [s]; None: estimated.

    Raises:
        InvalidInput: a log holds no torque.
        NotIdentifiable: the motion does not determine a curve.
    """
    smooth = smoothing(logs, joint, cutoff, held_out=held_out)
    stretches = [s for each in prepare_each(logs, joint, cutoff=smooth.cutoff) for s in each]
    about = logs[0].joints[logs[0].column(joint)]
    speeds = np.concatenate([s.velocity[s.moving] for s in stretches])
    if not speeds.size or not np.max(np.abs(speeds)) > 0:
        raise NotIdentifiable(
            f"Joint '{joint}' does not move in these logs.", remedy="Name a joint that moves."
        )
    top = quantile(np.abs(speeds), 99.9 / 100.0)
    knots = top * np.array(curves.SHARES)
    slowest = slowest_sliding(stretches, knots)
    blind = all(s.position is None for s in stretches)
    logged = stretches = along_path(stretches, about.unit == "rad" and len(logs) == 1 and not held_out)
    travel = max((float(np.ptp(s.position)) for s in stretches if s.position is not None), default=0.0)
    velocity = float(speeds.min()), float(speeds.max())
    del speeds
    slower_way = min(-velocity[0], velocity[1])
    both = slower_way > 0.05 * top
    pulls = gravity if about.unit == "rad" and (gravity or travel > SPAN_FOR_GRAVITY) else False
    others = [s.of_log(-1) for log in held_out for s in prepare(log, joint, cutoff=smooth.cutoff)]
    without = leave_out(stretches, pulls is not False, others)
    stretches = without or stretches
    given: dict[str, Any] = {
        "dynamic": True,
        "gravity": pulls,
        "model_torque": any(s.model_torque is not None for s in stretches),
        "both_directions": both,
    }
    shapes = curves.from_speed(knots, slowest)
    sections = {"": knots[list(shapes.get("5 sections", shapes["line"]))]}
    full = design.candidates(knots, sections, **given)[-1]
    made = moves(stretches)
    few = made < LEAST_MOVES  # too few data for a delay or for standard errors, so reversals are fitted too
    seconds = BIN_TIME if few else bin_time(stretches, smooth.cutoff)
    allowed = {name: knots[list(keep)] for name, keep in curves.of_law(law, shapes).items()}
    slow = float(SLOW * (slower_way if both else top))

    def delay_stretches() -> list[DelayStretch]:
        if along:
            return [each.with_sliding(s.sliding) for each, s in zip(along, slid, strict=True)]
        return [DelayStretch(s, seconds, NONE) for s in slid]

    def average(late: float) -> Bins:
        if not few:
            return at_hand[late] if late in at_hand else bins_at_delay(delay_stretches(), late, knots)
        motion = [delay_signals(s, late) for s in slid]
        return bin_means(motion, knots, seconds=seconds, reversals=True, filled=HALF)

    def simplest(slip: Slip, bins: Bins):
        return _simplest(bins, options, slip.colour, (slowest, 0.0 if few else slow), start)

    def choose(slip: Slip, raw: Bins) -> tuple[design.Choice, Bins, float, Misses]:
        candidate, bins, blocks, lowest = simplest(slip, raw)
        false = smooth.error.in_acceleration(corner, rate, width, slip.colour)
        choice = design.fit(blocks, candidate, false)
        bins = bins.map_columns(candidate.spread)
        left = bins.y - bins.X @ choice.coefficients
        missed = misses_of(replace(raw, used=bins.used), choice, lowest)
        missed = replace(missed, seen=max(lowest, bins.slowest(LONG_ENOUGH / seconds)))
        return (
            replace(
                choice, covariance=noise.covariance_of_fit(bins.X, left, bins.used, slip.colour.independent)
            ),
            bins,
            lowest,
            missed,
        )

    def with_late(slip: Slip, choice: design.Choice, bins: Bins) -> design.Choice:
        change = change_with_delay(delay_stretches(), slip.delay, choice.candidate, choice.coefficients)
        white = replace(bins, X=slip.error * change[:, None]).whiten(slip.colour).X[:, 0]
        return with_slip(choice, response(bins, white, choice.coefficients), slip)

    rate = stretches[0].rate
    corner, width = smooth.cutoff or default_cutoff(rate), max(1, round(seconds * rate))
    false_means = smooth.error.between_means(corner, rate, width)
    options = design.candidates(knots, allowed, symmetric=symmetric, **given)
    slip, coarse, slid = Slip(delay=0.0, error=np.inf, period=1.0 / rate), None, list(stretches)
    along, at_hand, timed = list[DelayStretch](), dict[float, Bins](), False  # timed at the reversals
    start: np.ndarray | None = None  # coefficients of all columns at the rough delay

    look = windows_of(stretches, ENOUGH) or stretches
    few_options = [o for o in options if o.form.name in ROUGH] if "line" in allowed else options

    def ready(some: Sequence[Signals], clear: bool = False) -> list[DelayStretch]:
        return [
            DelayStretch(s, seconds, clear_jerk(s, smooth.error, corner) if clear else None) for s in some
        ]

    def rough(
        slip: Slip, prepared: list[DelayStretch], some: Sequence[Signals]
    ) -> tuple[design.Candidate, float, Bins, np.ndarray]:
        nonlocal start
        raw = bins_at_delay(prepared, slip.delay, knots)
        equations = raw.whiten(slip.colour).equations(rounds=FEW)
        start, candidate = equations.solution(), design.simplest(equations, few_options)
        begin = equations.map_columns(candidate.spread).solution()
        distance = build_up(raw, some, slip.delay, candidate.spread, slip.colour, seconds, begin)
        return candidate, distance, raw, begin

    def at_rough(
        slip: Slip, prepared: list[DelayStretch], whole: bool
    ) -> tuple[design.Candidate, list[Signals], Bins | None, np.ndarray | None]:
        for every in (True,) if whole else (False, True):  # windows may show too little motion
            some = ready(stretches) if every and not whole else prepared
            with suppress(NotIdentifiable):
                candidate, distance, raw, begin = rough(slip, some, stretches if every else look)
                same = look is stretches and not distance > 0.0  # bins of long logs fill the memory
                return candidate, after_build_up(stretches, distance), raw if same else None, begin
        return full, list(stretches), None, None  # the choice at the final delay decides

    if delay is not None:
        slip = fix_slip(prepared := ready(stretches), knots, full, delay, false_means)
        slid = list(stretches) if few else at_rough(slip, prepared, True)[1]
        del prepared  # long logs fill the memory
    elif not few:
        slip, coarse, slid, along, near = search_slip(
            stretches, look, knots, full, ready, at_rough, false_means
        )
        at_hand = {slip.delay: near} if near else {}
        along = along if look is stretches else []  # long logs fill the memory
        if not slip.is_known and slip.error < CLOSE * slip.least:
            with suppress(NotIdentifiable):
                choice, bins, *_ = choose(slip, average(slip.delay))
                found = slip_at_crossings(slip, with_late(slip, choice, bins), stretches, smooth.error)
                slip, timed = found, found.is_known
    if not slip.is_known:
        # whitening requires a model that is valid at all frequencies, so it is not used if errors are unknown anyway
        slip = replace(slip, delay=slip.delay if slip.is_fitted(coarse) else 0.0, colour=WHITE)
    try:
        choice, bins, slowest, missed = choose(slip, average(slip.delay))
    except NotIdentifiable:  # too little is left without the build-up
        slid = list(stretches)
        choice, bins, slowest, missed = choose(slip, average(slip.delay))
    if slip.is_fitted(coarse):
        choice = with_late(slip, choice, bins)
    slow = slip.is_known and slip.colour.memory * seconds > FORGETS
    choice, through = with_crossings(choice, slip.delay, stretches, smooth.error) if slow else (choice, "")
    choice = missed.on(with_bends(design.offset_apart(choice)))
    friction = as_friction(choice, choice.coefficients, about, velocity, slip.delay)
    line = choice.candidate.form.knots.size == 2
    slowest = max(curves.past_rise(friction.law, slowest), missed.seen, missed.held if line else 0.0)
    duration = sum(float(np.count_nonzero(s.moving)) / s.rate for s in stretches)
    reversals = sum(turns(s.velocity[s.moving]).size for s in stretches)
    open_ = reasons(bins, friction, made, slip)
    del bins
    remarks = sentences(
        (smooth.warning, smooth.warning),
        (
            duration < SHORT or reversals < FEW_TURNS,
            f"Only {duration:.2g} s of motion with {reversals} reversals: too little to separate friction reliably from "
            f"the other terms.",
        ),
        (open_, f"{NO_ERRORS}{'; '.join(open_)}."),
    )
    unseen = predict_blocks(stretches, choice, slip.delay, seconds) if not held_out else None
    parts, of_others = parts_of(friction, logged, True), parts_of(friction, others, False)
    fitted, held = assess_both(parts, unseen) if unseen else (assess_parts(parts), assess_parts(of_others))
    del unseen
    load = np.concatenate([s.torque - measured for s, measured, *_ in parts])
    friction = replace(
        friction,
        warnings=(*warnings_of(choice, about, both), *remarks),
        fitted=fitted,
        held_out=held,
        validity=replace(
            friction.validity,
            lowest_speed=slowest,
            load=(float(load.min()), float(load.max())),
            nominal_load=float(np.abs(load).mean()),
        ),
    )
    k = len(choice.candidate.terms)
    of_curve = curves.error_of_curve(choice.candidate.form, choice.covariance[k:, k:])
    of_curve = missed.beside(of_curve) if line else of_curve
    if open_:
        friction, of_curve = without_errors(friction), lambda velocity: np.full(velocity.shape, np.nan)
    support = evidence(
        friction,
        parts + of_others,
        curves.widen_below(friction.law, slowest, of_curve),
        settled=[sliding_in_step(s, friction.delay) for s in slid],
    )
    constant = constant_beside(friction, NAMED) if choice.candidate.form.symmetric else ""
    fixed = "" if delay is None else describe(delay)
    known = LEFT_OUT if without and any(np.any(s.model_torque) for s in logged) else ""
    said = (support.verdict, through, TOLD if timed else "", constant, fixed, known, smooth.note)
    support = replace(support, verdict=" ".join(filter(None, said)))
    return without_gravity(friction, support, logged) if blind else (friction, support)


def _simplest(
    raw: Bins,
    options: list[design.Candidate],
    colour: Colour,
    speeds: tuple[float, float],
    start: np.ndarray | None,
) -> tuple[design.Candidate, Bins, Blocks, float]:
    """Return the chosen candidate, the bins to fit, their equations, and the slowest speed that they determine.

    Args:
        raw: bins, not whitened.
        options: candidates.
        colour: of the noise of neighbouring bins.
        speeds: slowest speed of sliding in the bins, and speed below which bins are not used for a line [rad/s or m/s].
        start: coefficients of a similar fit of all columns, which save repetitions, (p,); None: there is none.
    """
    bins, (slowest, slow) = raw.whiten(colour), speeds
    blocks, weights = bins.equations_and_weights(start)
    candidate = design.simplest(blocks, options)
    if candidate.form.knots[0] == 0.0 and slow > 0.0:
        lines = [option for option in options if option.form.knots[0] == 0.0]
        of_faster = blocks.less(bins.slower(slow, weights))
        del bins  # two of them at once fill the memory
        bins = raw.faster(slow).whiten(colour)
        if colour != WHITE:  # whitening joins other bins
            of_faster = bins.equations(blocks.solution())
        try:
            candidate = design.simplest(of_faster, lines)
            blocks, slowest = of_faster, max(slowest, slow)
        except NotIdentifiable:  # there is hardly any faster motion, so all bins are used
            bins = raw.whiten(colour)
    return candidate, bins, blocks, slowest


def reasons(bins: Bins, friction: JointFriction, count: int, slip: Slip) -> tuple[str, ...]:
    """Return the reasons why standard errors are unknown; empty if they are known.

    Args:
        bins: that were fitted.
        friction: the result.
        count: number of moves.
        slip: the delay.
    """
    unknowns = len(friction.standard_errors) + len(friction.dynamics)
    freedom, error = int(np.count_nonzero(bins.used)) - unknowns, slip.error
    if "time_slip" in friction.dynamics:
        error = max(error, friction.dynamics["time_slip"].standard_error)
    late = (
        f"is known to {1e3 * error:.2g} ms only" if np.isfinite(error) else "is not determined by the motion"
    )
    return sentences(
        (freedom < LEAST_FREEDOM, "there is hardly more data than unknowns"),
        (count < LEAST_MOVES, f"the joint made only {count} moves (record more, at more speeds)"),
        (
            error > slip.least,
            f"the delay of the torque {late}; give it where it is known (--known delay=...)",
        ),
    )
