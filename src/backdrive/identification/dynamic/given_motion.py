"""Torque given motion: every law of a shortlist fitted to one joint, judged, and the chosen one fitted to everything."""

from __future__ import annotations

import time as clock
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from backdrive._catalog import lookup
from backdrive.errors import BackdriveError, NotIdentifiable
from backdrive.identification.dynamic import choice as choice_
from backdrive.identification.dynamic import starts
from backdrive.identification.dynamic.choice import Candidate
from backdrive.identification.dynamic.law_fit import fit_law
from backdrive.identification.dynamic.outcome import JointFit, check_bounds, interruption
from backdrive.identification.dynamic.result import finish
from backdrive.identification.dynamic.stopping import unless_stopped
from backdrive.identification.dynamics import unit_of
from backdrive.identification.options import Options
from backdrive.identification.smoothing import smoothing
from backdrive.laws import rate_law
from backdrive.logs.log import Log
from backdrive.model import Estimate

if TYPE_CHECKING:
    from backdrive.identification.dynamic.torque import Stretch
    from backdrive.identification.signals import Signals

VARIES = 0.1  # a load or temperature varies that spans this share of its size [-]
TERMS = ("inertia", "offset", "gravity_sin", "gravity_cos")
WORSE = 1.1  # mean square of a fit to everything by that of the one that was judged, beyond which it is not taken [-]
TURNS = 0.5  # a joint that turns by less shows little of gravity [rad]


def fit_joint(logs: Sequence[Log], held_out: Sequence[Log], name: str, options: Options) -> JointFit:
    """Return the fit of one joint.

    Args:
        logs: to fit.
        held_out: to judge on; none: every third window of the fitted ones.
        name: of the joint.
        options: everything else.

    Raises:
        NotIdentifiable: no law can be fitted or judged.
    """
    for term in options.known:
        lookup(term, dict.fromkeys(TERMS, 0), "number that a fit of torque takes as known")
    info = logs[0].joints[logs[0].column(name)]
    smooth = smoothing([*logs, *held_out], name, options.cutoff)
    pairs = [pair for log in logs for pair in _stretches(log, name, smooth.cutoff)]
    unseen = [pair for log in held_out for pair in _stretches(log, name, smooth.cutoff)]
    stretches = [s for _, s in pairs]
    terms = ["inertia", "offset", *gravity_terms(stretches, info.unit, options.gravity)]
    terms += [term for term in TERMS if term in options.bounds and term not in terms]
    terms = [term for term in terms if term not in options.known]
    load = all(s.load.shape[0] > 1 and _varies(s.load[:, 1]) for s in stretches)
    warm = all(s.temperature.size > 1 and _varies(s.temperature) for s in stretches)
    sizes = starts.scales(stretches, terms, info.unit, info.encoder_counts, options.known)
    shown = sizes.length * (info.encoder_counts or np.inf) >= 5.0 and _slow_reversals(stretches, sizes.length)
    masks = (
        [np.zeros(len(s.torque), dtype=bool) for s in stretches]
        if unseen
        else choice_.windows([len(s.torque) for s in stretches])
    )
    fitted = choice_.without(stretches, masks)
    judges = [s for _, s in unseen] if unseen else stretches
    judged_on = [np.ones(len(s.torque), dtype=bool) for s in judges] if unseen else masks
    candidates: list[Candidate] = []
    failure: BackdriveError | None = None
    common: dict[str, Any] = {
        "unit": info.unit,
        "counts": info.encoder_counts,
        "terms": terms,
        "delay": options.delay,
        "known": options.known,
        "scales": sizes,
        "loss": options.loss,
        "seed": options.seed,
    }
    listed = choice_.shortlist(options.law or "auto", presliding=shown, load=load, warm=warm)
    check_bounds(options.bounds, listed, (*TERMS, *(("delay",) if options.delay else ())))
    stopped = False
    for candidate in listed:
        options.say(f"{name}: fitting {candidate}")
        begun = clock.perf_counter()
        try:
            _supported(candidate, load=load, warm=warm)
            one = fit_law(candidate, fitted, bounds=options.bounds, tick=options.ticker(name), **common)
            squares = choice_.judged(one, judges, judged_on)
            seen, count = choice_.seen(one, fitted)
        except BackdriveError as error:
            candidates.append(choice_.failed(candidate, error, clock.perf_counter() - begun))
            failure = error
            continue
        except KeyboardInterrupt:
            if not candidates:
                raise
            stopped = True
            break
        candidates.append(
            Candidate(
                name=one.name,
                parameters=len(one.problem.unknowns),
                error=float(np.sqrt(seen)),
                held_out=float(np.sqrt(squares.mean())) if squares.size else np.nan,
                aic=count * np.log(max(seen, 1e-300)) + 2 * len(one.problem.unknowns),
                seconds=clock.perf_counter() - begun,
                remark=choice_.remark(one.unseen),
                shown=choice_.is_shown(one.problem.shape, one.unseen, one.at_bound),
                fit=one,
                windows=squares,
            )
        )
        if one.interrupted:
            stopped = True
            break
    if not any(np.isfinite(c.held_out) for c in candidates):
        if stopped:
            raise KeyboardInterrupt
        raise failure or NotIdentifiable("No law could be judged.", remedy="Record a longer log.")
    size = float(np.sqrt(np.mean(np.concatenate([s.torque for s in stretches]) ** 2)))
    choice = choice_.choose(name, candidates, info.torque_unit, size)
    best = choice.candidate().fit
    assert best is not None
    final, remarks = best, [smooth.warning] if smooth.warning else []
    if not unseen and not stopped:
        options.say(f"{name}: fitting {best.name} to everything")
        again = unless_stopped(
            lambda: fit_law(
                best.problem.shape,
                stretches,
                begin=8,
                descend=1,
                begin_at=best.values,
                bounds=options.bounds,
                **common,
            )
        )
        stopped = again is None or again.interrupted
        if again is not None and choice_.seen(again, stretches)[0] <= (
            WORSE * choice_.seen(best, stretches)[0]
        ):
            final = again
        elif again is not None and not again.interrupted:
            remarks.append(
                "Fitted to everything, the law explains the log worse than without the windows that it was judged on: the "
                "numbers are those of the fit that was judged."
            )
    intervals, done = final.intervals_until_stopped(
        "covariance" if stopped else options.interval,
        seed=options.seed,
        tick=lambda number: options.say(f"{name}: profile of {number}"),
    )
    stopped = stopped or not done
    if stopped:
        remarks.append(interruption(listed, candidates, done))
    friction, evidence = finish(info, final, best, choice, pairs, unseen, masks)
    given = {
        term: Estimate(value=value, unit=unit_of(term, info), standard_error=float("nan"))
        for term, value in options.known.items()
    }
    if any(log.model_torque is not None for log in logs):
        given["model_torque"] = Estimate(value=1.0, unit="1", standard_error=float("nan"))
    friction = replace(
        friction, dynamics=dict(friction.dynamics) | given, warnings=(*remarks, *friction.warnings)
    )
    return JointFit(
        friction=friction,
        evidence=evidence,
        choice=choice,
        intervals=intervals,
        stopped=stopped,
        notes=(smooth.note,) if smooth.note else (),
        settings={"cutoff": smooth.cutoff},
    )


def gravity_terms(stretches: Sequence[Stretch], unit: str, wanted: bool | None) -> tuple[str, ...]:
    """Return the terms of gravity that are sought: where asked for, or where the joint turns far enough to show it."""
    turns = unit == "rad" and all(s.position is not None for s in stretches)
    far = turns and max(float(np.ptp(s.position)) for s in stretches) > TURNS  # type: ignore[arg-type]
    return ("gravity_sin", "gravity_cos") if wanted or (wanted is None and far) else ()


def _supported(candidate: str, *, load: bool, warm: bool) -> None:
    first = candidate.partition("+")[0]
    needs = rate_law(first).NEEDS if first in choice_.RATES else ()
    for need, there in (("load", load), ("temperature", warm)):
        if need in needs and not there:
            raise NotIdentifiable(
                f"'{candidate}' depends on the {need}, and the log holds none that varies.",
                remedy=f"Name the channel, for example --map {need[:4]}=COLUMN.",
            )


def _stretches(log: Log, name: str, cutoff: float | None) -> list[tuple[Signals, Stretch]]:
    """Return signals and stretches of one joint, with its load and temperature; a torque known from elsewhere is taken off."""
    from backdrive.identification.dynamic.torque import SMOOTHED, stretch
    from backdrive.identification.signals import prepare

    found = []
    for signals in prepare(log, name, cutoff=cutoff):
        one = stretch(
            signals,
            load=signals.load,
            temperature=signals.temperature,
            bandwidth=SMOOTHED if cutoff is None else min(cutoff, SMOOTHED),
        )
        if signals.model_torque is not None:
            one = replace(one, torque=one.torque - signals.model_torque)
        found.append((signals, one))
    return found


def _varies(x: np.ndarray) -> bool:
    return bool(np.ptp(x) > VARIES * max(float(np.abs(x).max()), 1e-12))


def _slow_reversals(stretches, length: float) -> bool:
    """Say whether some reversals take at least five samples to cross the presliding distance."""
    count = 0
    for s in stretches:
        path = np.cumsum(np.abs(s.dp))
        turns = np.flatnonzero(np.diff(np.sign(s.velocity)) != 0)
        for k in turns:
            if k + 6 < len(path) and path[k + 5] - path[k] < 2.0 * length:
                count += 1
    return count >= 3
