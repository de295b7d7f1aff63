"""Fits: any friction law from logs, with honest uncertainty and a choice between laws."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from backdrive.errors import BackdriveError, InvalidInput, NotIdentifiable
from backdrive.fitting.choice import Candidate as Candidate
from backdrive.fitting.choice import Choice as Choice
from backdrive.fitting.law_fit import LawFit as LawFit
from backdrive.fitting.law_fit import fit_law as fit_law
from backdrive.fitting.motion import MotionFit as MotionFit
from backdrive.fitting.motion import fit_motion as fit_motion
from backdrive.fitting.motion_log import MotionLog as MotionLog
from backdrive.identification.result import Identification, JointEvidence
from backdrive.log import Log

if TYPE_CHECKING:
    from backdrive.fitting.torque import Stretch
    from backdrive.identification.signals import Signals
    from backdrive.model import JointFriction

VARIES = 0.1  # a load or temperature varies that spans this share of its size [-]


@dataclass(frozen=True, kw_only=True, eq=False)
class FitResult(Identification):
    """The outcome of `fit`: an identification, and the laws that were tried.

    Attributes:
        choices: one a joint, in the model's order.
    """

    choices: tuple[Choice, ...] = ()

    def choice(self, joint: str | int = 0) -> Choice:
        """Return the choice of one joint, by name or position."""
        name = self.model.joint(joint).joint.name
        return next(c for c in self.choices if c.joint == name)


def fit(
    logs: Log | Sequence[Log],
    law: str | Sequence[str] = "auto",
    *,
    joints: Sequence[str] | None = None,
    held_out: Sequence[Log] = (),
    gravity: bool | None = None,
    delay: bool = True,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    cutoff: float | None = None,
    loss: str = "huber",
    accept: Sequence[str] = (),
    repair: bool = False,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> FitResult:
    """Fit friction laws to every joint that moves, from torque given motion.

    Every law is fitted twice: without every third window of time, on which it is judged (or on `held_out` logs), and the
    chosen one again on everything. Inertia, a constant torque and, where asked for, gravity are sought along.

    Args:
        logs: one log, or several of the same joints, with torque and position or velocity.
        law: `auto` for a shortlist that the data can support; `rate`, `rate+element`, or several with commas between.
        joints: names of the joints wanted; None: every joint that moves.
        held_out: logs to judge on; windows of the fitted ones where there are none.
        gravity: seek gravity as sin q and cos q; None: where the joint turns.
        delay: seek the time by which torque was recorded later than motion.
        bounds: of parameters, by name [SI].
        cutoff: low pass of the motion before differentiation [Hz].
        loss: `linear`, `huber` or `absolute`.
        accept: names of health findings to accept.
        repair: mend the log where an honest repair exists; each is noted.
        seed: of the starts.
        progress: called with a sentence before every step that may take long.

    Returns:
        The model, the evidence for every joint, and the table of laws with the reason for the choice.

    Raises:
        UnhealthyLog: a finding would spoil the result.
        NotIdentifiable: no joint's friction can be fitted; where some can, the others are named in the warnings.
        InvalidInput: an argument or a log does not fit.
        UnknownName: no such law or joint.
    """
    from backdrive import __version__
    from backdrive.fitting.choice import shortlist
    from backdrive.fitting.unknowns import LawShape
    from backdrive.identification.auto import moving_joints
    from backdrive.identification.request import apart, healthy, in_order
    from backdrive.model import FrictionModel

    say = progress or (lambda sentence: None)
    logs = [logs] if isinstance(logs, Log) else list(logs)
    if not logs:
        raise InvalidInput("There is no log to fit.", remedy="Pass at least one.")
    if not (isinstance(law, str) and law == "auto"):
        for name in shortlist(law, presliding=True, load=True, warm=True):
            LawShape.named(name)
    logs = [in_order(log, logs[0]) for log in logs]
    held_out = [in_order(log, logs[0]) for log in held_out]
    apart(logs, held_out)
    say("Checking the logs")
    warnings: list[str] = []
    logs = [healthy(log, accept, repair, warnings) for log in logs]
    held_out = [healthy(log, accept, repair, warnings) for log in held_out]
    names, idle = moving_joints(logs, joints)
    warnings += [f"Joint '{name}' hardly moves and was left out." for name in idle]
    found: list[tuple[JointFriction, JointEvidence, Choice]] = []
    for name in names:
        try:
            found.append(
                _joint(
                    logs,
                    held_out,
                    name,
                    law,
                    gravity=gravity,
                    delay=delay,
                    bounds=bounds,
                    cutoff=cutoff,
                    loss=loss,
                    seed=seed,
                    say=say,
                )
            )
        except BackdriveError as error:
            if len(names) == 1:
                raise
            warnings.append(f"Joint '{name}' was left out: {error.message} {error.remedy}")
    if not found:
        raise NotIdentifiable(
            "No joint could be fitted. " + " ".join(warnings), remedy="Record a motion with reversals."
        )
    model = FrictionModel(
        joints=tuple(f for f, _, _ in found),
        sources=tuple(s for log in logs for s in log.sources),
        options={"law": law if isinstance(law, str) else list(law), "loss": loss, "seed": seed},
        version=__version__,
    )
    return FitResult(
        model=model,
        evidence=tuple(e for _, e, _ in found),
        method="fit",
        reason="torque given motion",
        warnings=tuple(warnings),
        notes=tuple(note for log in logs for note in log.notes),
        choices=tuple(c for _, _, c in found),
    )


def _joint(logs, held_out, name, law, *, gravity, delay, bounds, cutoff, loss, seed, say):
    from backdrive.fitting import choice as choice_
    from backdrive.fitting import starts
    from backdrive.fitting.result import finish
    from backdrive.laws import rate_law

    info = logs[0].joints[logs[0].column(name)]
    pairs = [pair for log in logs for pair in _stretches(log, name, cutoff)]
    unseen = [pair for log in held_out for pair in _stretches(log, name, cutoff)]
    stretches = [s for _, s in pairs]
    terms = ["inertia", "offset"]
    turns = info.unit == "rad" and all(s.position is not None for s in stretches)
    if gravity or (gravity is None and turns and _travel(stretches) > 0.5):
        terms += ["gravity_sin", "gravity_cos"]
    load = all(s.load.shape[0] > 1 and _varies(s.load[:, 1]) for s in stretches)
    warm = all(s.temperature.size > 1 and _varies(s.temperature) for s in stretches)
    sizes = starts.scales(stretches, terms, info.unit, info.encoder_counts)
    shown = sizes.length * (info.encoder_counts or np.inf) >= 5.0 and _slow_reversals(stretches, sizes.length)
    masks = [np.zeros(len(s.torque), dtype=bool) for s in stretches] if unseen else choice_.windows(stretches)
    fitted = choice_.without(stretches, masks)
    judges = [s for _, s in unseen] if unseen else stretches
    candidates: list[Candidate] = []
    failure: BackdriveError | None = None
    options = {
        "unit": info.unit,
        "counts": info.encoder_counts,
        "terms": terms,
        "delay": delay,
        "bounds": bounds,
        "scales": sizes,
        "loss": loss,
        "seed": seed,
    }
    for candidate in choice_.shortlist(law, presliding=shown, load=load, warm=warm):
        say(f"{name}: fitting {candidate}")
        begun = clock.perf_counter()
        try:
            first = candidate.partition("+")[0]
            needs = rate_law(first).NEEDS if first in choice_.RATES else ()
            for need, there in (("load", load), ("temperature", warm)):
                if need in needs and not there:
                    raise NotIdentifiable(
                        f"'{candidate}' depends on the {need}, and the log holds none that varies.",
                        remedy=f"Name the channel, for example --map {need[:4]}=COLUMN.",
                    )
            one = fit_law(candidate, fitted, tick=_ticker(say, name), **options)
        except BackdriveError as error:
            candidates.append(
                Candidate(
                    name=candidate,
                    parameters=0,
                    error=np.nan,
                    held_out=np.nan,
                    aic=np.nan,
                    seconds=clock.perf_counter() - begun,
                    remark=error.message,
                )
            )
            failure = error
            continue
        squares = choice_.judged(
            one, judges, [np.ones(len(s.torque), dtype=bool) for s in judges] if unseen else masks
        )
        seen, count = choice_.seen(one, fitted)
        candidates.append(
            Candidate(
                name=one.name,
                parameters=len(one.values),
                error=float(np.sqrt(seen)),
                held_out=float(np.sqrt(squares.mean())) if squares.size else np.nan,
                aic=count * np.log(max(seen, 1e-300)) + 2 * len(one.values),
                seconds=clock.perf_counter() - begun,
                remark=_unseen(one.unseen),
                fit=one,
                windows=squares,
            )
        )
        if one.interrupted:
            break
    if not any(np.isfinite(c.held_out) for c in candidates):
        raise failure or NotIdentifiable("No law could be judged.", remedy="Record a longer log.")
    size = float(np.sqrt(np.mean(np.concatenate([s.torque for s in stretches]) ** 2)))
    choice = choice_.choose(name, candidates, info.torque_unit, size)
    best = choice.candidate().fit
    assert best is not None
    final = best
    if not unseen and not best.interrupted:
        say(f"{name}: fitting {best.name} to everything")
        final = fit_law(best.problem.shape, stretches, begin=8, descend=1, begin_at=best.values, **options)
    friction, evidence = finish(info, final, best, choice, pairs, unseen, masks)
    return friction, evidence, choice


def _stretches(log: Log, name: str, cutoff: float | None) -> list[tuple[Signals, Stretch]]:
    """Return signals and stretches of one joint, with its load and temperature."""
    from backdrive.fitting.torque import stretch
    from backdrive.identification.signals import prepare

    own = log.select(name).on_joint_side()
    found = []
    for signals in prepare(log, name, cutoff=cutoff):
        load = temperature = None
        if own.load is not None or own.external_torque is not None:
            external = -own.load[:, 0] if own.load is not None else own.need("external_torque")[:, 0]
            load = np.column_stack([signals.torque, np.interp(signals.time, own.time, external)])
        if own.temperature is not None:
            temperature = np.interp(signals.time, own.time, own.temperature[:, 0])
        one = stretch(signals, load=load, temperature=temperature)
        if signals.model_torque is not None:
            one = replace(one, torque=one.torque - signals.model_torque)
        found.append((signals, one))
    return found


def _ticker(say, name):
    return lambda law, i, cost: say(f"{name}: fitting {law}, step {i}") if i % 5 == 0 else None


def _travel(stretches) -> float:
    return max(float(np.ptp(s.position)) for s in stretches)


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


def _unseen(names) -> str:
    plain = list(dict.fromkeys(n.partition("[")[0] for n in names))
    return f"not seen: {', '.join(plain)}" if plain else ""
