"""Motion given the drive's input: laws fitted to one joint through forward dynamics, its drive in the loop.

No torque is needed. What the drive must have given along the measured motion follows from its own gains; a fit to that torque
(`law_fit`) gives the start, and the motion itself decides (`motion`): the joint is let go from the measured start of every
window under the recorded input. Every third window is held out.
"""

from __future__ import annotations

import time as clock
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from backdrive._catalog import lookup
from backdrive.engine import Axis, DriveModel
from backdrive.errors import BackdriveError, NotIdentifiable
from backdrive.identification.dynamic import choice as choice_
from backdrive.identification.dynamic import starts
from backdrive.identification.dynamic.choice import Candidate
from backdrive.identification.dynamic.drive_of_log import drive_of, sought_of
from backdrive.identification.dynamic.driven import Driven, driven, split, whole
from backdrive.identification.dynamic.given_motion import gravity_terms
from backdrive.identification.dynamic.intervals import intervals
from backdrive.identification.dynamic.law_fit import fit_law
from backdrive.identification.dynamic.motion import MotionFit, fit_motion
from backdrive.identification.dynamic.motion_log import MotionLog
from backdrive.identification.dynamic.motion_problem import MotionProblem
from backdrive.identification.dynamic.motion_result import finish_motion
from backdrive.identification.dynamic.motion_terms import NAMES, OF_AXIS
from backdrive.identification.dynamic.outcome import JointFit, check_bounds, interruption
from backdrive.identification.dynamic.stopping import unless_stopped
from backdrive.identification.dynamic.unknowns import LawShape
from backdrive.identification.options import Options, describe_drive
from backdrive.laws import Coulomb, Law
from backdrive.logs.log import Drive, Joint, Log

STEP = 1e-3  # longest integration step [s]
QUICK = 0.08  # of the fastest time constant of the drive with the inertia, that a step may be [-]
FINEST = 20  # steps a sample, at most, unless a person asks for more
STARTS = (
    12  # stretches whose velocity at the start is sought too, which a low pass tells badly there, at most
)
LATEST = 0.03  # longest delay that is sought [s]
PLAIN = "coulomb-viscous"  # fitted to the drive's torque for starts of laws that need the load


def fit_joint(logs: Sequence[Log], held_out: Sequence[Log], name: str, options: Options) -> JointFit:
    """Return the fit of one joint.

    Args:
        logs: with the drive's input, to fit.
        held_out: the same, to judge on; none: every third window of the fitted ones.
        name: of the joint.
        options: everything else.

    Raises:
        InvalidInput: the drive is not known, or the logs do not fit together.
        NotIdentifiable: no law can be fitted or judged.
    """
    info = logs[0].joints[logs[0].column(name)]
    assert not isinstance(options.drive, Drive)
    template = options.drive or drive_of(logs[0], sought_of(options.bounds))
    fitted = [d for log in logs for d in driven(log, name, template, options)]
    unseen = [d for log in held_out for d in driven(log, name, template, options)]
    problem = _Problem(info, template, fitted, options)
    held = template.controller != "open"
    pieces = whole(fitted, held)
    shown, judges = (pieces, whole(unseen, held)) if unseen else split(fitted, held)
    candidates: list[Candidate] = []
    fits: dict[str, MotionFit] = {}
    failure: BackdriveError | None = None
    listed = choice_.shortlist(options.law or "auto", presliding=False, load=False, warm=False)
    check_bounds(options.bounds, listed, NAMES)
    stopped = False
    for candidate in listed:
        options.say(f"{name}: fitting {candidate}")
        begun = clock.perf_counter()
        try:
            one = problem.fit(candidate, shown, options.ticker(name))
            squares = _squares(one, judges)
        except BackdriveError as error:
            candidates.append(choice_.failed(candidate, error, clock.perf_counter() - begun))
            failure = error
            continue
        except KeyboardInterrupt:
            if not fits:
                raise
            stopped = True
            break
        fits[one.name] = one
        candidates.append(
            Candidate(
                name=one.name,
                parameters=len(one.problem.unknowns),
                error=one.rms,
                held_out=float(np.sqrt(squares.mean())),
                aic=one.samples * np.log(max(one.rms**2, 1e-300)) + 2 * len(one.problem.unknowns),
                seconds=clock.perf_counter() - begun,
                remark=choice_.remark(one.unseen),
                windows=squares,
            )
        )
        if one.interrupted:
            stopped = True
            break
    if not any(np.isfinite(c.held_out) for c in candidates):
        raise failure or NotIdentifiable("No law could be judged.", remedy="Record a longer log.")
    position = np.concatenate([d.log.position - d.log.position.mean() for d in fitted])
    size = float(np.sqrt(np.mean(position**2)))
    choice = choice_.choose(name, candidates, info.unit, size, "motion")
    best = fits[choice.chosen]
    final = best
    if not unseen and not stopped:
        options.say(f"{name}: fitting {best.name} to everything")
        again = unless_stopped(lambda: problem.fit(best.name, pieces, options.ticker(name), best.values))
        stopped = again is None or again.interrupted
        final = best if again is None or (again.interrupted and again.rms > best.rms) else again
    numbers, done = intervals(
        final.problem,
        final.found,
        final.standard_errors,
        "covariance" if stopped else options.interval,
        loss=options.loss,
        step=1e-4,
        seed=options.seed,
        tick=lambda number: options.say(f"{name}: profile of {number}"),
    )
    numbers = {n: ends for n, ends in numbers.items() if not n.startswith("start.")}
    stopped = stopped or not done
    friction, evidence = finish_motion(info, final, best, choice, fitted, unseen, options, problem.scales)
    if stopped:
        said = interruption(listed, candidates, done)
        friction = replace(friction, warnings=(said, *friction.warnings))
    judged = choice.candidate()
    return JointFit(
        friction=friction,
        evidence=evidence,
        choice=choice,
        intervals=final.problem.shape.complete(numbers),
        stopped=stopped,
        settings={
            "drive": describe_drive(final.axis.drive),
            "step": final.problem.logs[0].dt / final.problem.substeps,
            "motion": {"error": final.rms, "held_out": judged.held_out, "unit": info.unit},
        },
    )


class _Problem:
    """What stays the same from law to law."""

    def __init__(self, info: Joint, drive: DriveModel, driven: Sequence[Driven], options: Options):
        for name in options.known:
            lookup(name, dict.fromkeys(OF_AXIS, 0), "number of an axis")
        self.info, self.drive, self.options = info, drive, options
        self.bounds: dict[str, Any] = dict(options.bounds)
        self.middle = drive.replace(
            **{
                n[6:]: _middle(r)
                for n, r in self.bounds.items()
                if n.startswith("drive.") and n != "drive.proportional_factor"
            }
        )
        self.stretches = [d.stretch(self.middle) for d in driven]
        gravity = gravity_terms(self.stretches, info.unit, options.gravity)
        sought = [t for t in ("inertia", "offset", *gravity) if t not in options.known]
        self.terms = [
            *sought,
            *(n for n in self.bounds if n in ("gravity_sin", "gravity_cos") and n not in sought),
        ]
        self.scales = starts.scales(
            self.stretches, ("inertia", "offset", *gravity), info.unit, info.encoder_counts
        )
        self.axis = Axis(
            **{"law": Law(rate=Coulomb(coulomb=0.0)), "inertia": 1.0, "drive": drive, **options.known}  # type: ignore[arg-type]
        )
        self.dt = driven[0].log.dt
        self.dampings = drive.proportional if drive.controller == "velocity" else drive.derivative
        self.stiffness = drive.proportional if drive.controller == "position" else 0.0
        if drive.actuator == "motor":
            volts = self.middle.supply * self.middle.torque_constant / self.middle.resistance
            self.dampings = self.dampings * volts + self.middle.torque_constant**2 / self.middle.resistance
            self.stiffness *= volts

    def substeps(self, inertia: float) -> int:
        """Return the integration steps a sample: short against the time in which the drive settles the inertia."""
        if self.options.step is not None:
            return max(1, int(np.ceil(self.dt / self.options.step - 1e-6)))
        rates = (self.dampings / inertia, np.sqrt(self.stiffness / inertia))
        step = min(STEP, QUICK / max(*rates, 1e-9))
        return min(max(1, int(np.ceil(self.dt / step - 1e-6))), max(FINEST, int(np.ceil(self.dt / STEP))))

    def fit(self, law: str, logs, tick, begin_at: Mapping[str, float] | None = None) -> MotionFit:
        """Return the fit of one law, begun at a fit to the drive's torque."""
        shape = LawShape.named(law).beside(self.terms)
        start = dict(begin_at) if begin_at else self._start(shape)
        free = self._free(shape, start)
        substeps = self.substeps(start.get("inertia", self.axis.inertia))
        problem = MotionProblem(
            shape, logs, self.axis, free, substeps=substeps, scales=self.scales, unit=self.info.unit
        )
        wide = bool(shape.rate.NEEDS)
        return fit_motion(
            problem,
            loss=self.options.loss,  # type: ignore[arg-type]
            begin=1 if begin_at else 64 if wide else 16,
            descend=4 if wide else 2,
            finish=2 if wide else 1,
            begin_at=start,
            seed=self.options.seed,
            tick=tick,
        )

    def _start(self, shape: LawShape) -> dict[str, float]:
        law_bounds = {
            n: r for n, r in self.bounds.items() if n in {**shape.rate.PARAMETERS, **shape.element.PARAMETERS}
        }
        found = fit_law(
            PLAIN if shape.rate.NEEDS else shape,
            self.stretches,
            unit=self.info.unit,
            counts=self.info.encoder_counts,
            terms=[t for t in self.terms if t in ("inertia", "offset", "gravity_sin", "gravity_cos")],
            delay=self.options.delay
            and self.drive.controller == "open",  # a controller's input alone is late
            bounds=None if shape.rate.NEEDS else law_bounds,
            scales=self.scales,
            begin=24,
            descend=1,
            seed=self.options.seed,
        )
        if found.interrupted:
            raise KeyboardInterrupt
        start = dict(found.values)
        start["drive.delay"] = float(np.clip(-start.pop("delay", 0.0), 0.0, LATEST))
        return start

    def _free(self, shape: LawShape, start: dict[str, float]) -> dict[str, Any]:
        """Return the ranges of everything that is sought; those asked for come before ours."""
        force = max(float(np.abs(s.torque).max()) for s in self.stretches)
        free: dict[str, Any] = {}
        for term in self.terms:
            value = start.get(term, 0.0)
            if term == "inertia":
                top = max(float(np.abs(s.acceleration).max()) for s in self.stretches)
                value = start[term] = max(value, 1e-3 * force / max(top, 1e-12))
                free[term] = (value / 20.0, 20.0 * value, value)
            else:
                reach = 2.0 * force
                free[term] = (-reach, reach, float(np.clip(value, -reach, reach)))
        if self.drive.controller != "open" and len(self.stretches) <= STARTS:
            free["start.velocity"] = (-self.scales.speed, self.scales.speed, 0.0)
        if self.options.delay:
            free["drive.delay"] = (0.0, LATEST, float(np.clip(start.get("drive.delay", 0.0), 0.0, LATEST)))
        for n, r in self.bounds.items():
            if n in shape.fixed or (n.startswith("drive.") or n in NAMES or n in self._numbers(shape)):
                free[n] = r
        for n, r in free.items():
            if n in start:
                start[n] = float(np.clip(start[n], r[0], r[1]))
        return free

    @staticmethod
    def _numbers(shape: LawShape) -> set[str]:
        return {*shape.rate.PARAMETERS, *shape.element.PARAMETERS}


def _squares(one: MotionFit, judges: Sequence[MotionLog]) -> np.ndarray:
    """Return the mean squared error of each window that is judged on [rad^2 or m^2], (W,)."""
    found = []
    for log, motion in zip(judges, one.predict(judges)):
        counts = np.ones(len(motion), dtype=bool)
        found += choice_.squares(
            (motion - log.position) ** 2, counts if log.judged is None else log.judged, counts
        )
    return np.array(found)


def _middle(given: Any) -> float:
    low, high = float(given[0]), float(given[1])
    return float(np.sqrt(low * high)) if low > 0.0 and high >= 10.0 * low else 0.5 * (low + high)
