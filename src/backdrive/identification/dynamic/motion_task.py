"""Motion given the drive's input: one joint with its drive in the loop, prepared for the fit of several laws.

No measured torque is needed. The drive's torque along the measured motion follows from its gains; a fit to that torque
(`law_fit`) gives the starting values. The final fit compares motions (`motion`): the joint is simulated under the recorded
input, from the measured initial state of every window. Every third window is held out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from backdrive._catalog import lookup
from backdrive.engine import Axis, DriveModel
from backdrive.identification.dynamic import choice, directions, starts
from backdrive.identification.dynamic.drive_stretch import (
    DriveStretch,
    drive_of,
    drive_stretches,
    drive_unknowns,
    held_out_masks,
    split,
    whole,
)
from backdrive.identification.dynamic.fit import Fit, conclude
from backdrive.identification.dynamic.joint_fit import Task
from backdrive.identification.dynamic.law_fit import fit_law
from backdrive.identification.dynamic.motion import fit_motion
from backdrive.identification.dynamic.motion_log import MotionLog
from backdrive.identification.dynamic.motion_problem import MotionProblem
from backdrive.identification.dynamic.motion_terms import NAMES, OF_AXIS
from backdrive.identification.dynamic.progress import ticker
from backdrive.identification.dynamic.result import finish
from backdrive.identification.dynamic.search import Search
from backdrive.identification.dynamic.stretch import Stretch
from backdrive.identification.dynamic.torque import TorqueProblem
from backdrive.identification.dynamic.torque_task import gravity_terms
from backdrive.identification.dynamic.unknowns import LawShape
from backdrive.identification.options import Options, describe_drive
from backdrive.identification.result import JointEvidence
from backdrive.identification.signals import Signals
from backdrive.identification.terms import GRAVITY, RIGID, estimates
from backdrive.laws import Coulomb, Law
from backdrive.logs.log import Drive, Log
from backdrive.model import Actuator, Estimate, JointFriction

STEP = 1e-3  # longest integration step [s]
QUICK = 0.08  # longest integration step, relative to the fastest time constant of drive and inertia [-]
FINEST = 20  # largest number of steps per sample, unless `STEP` or the user requires more
STARTS = 12  # largest number of stretches with fitted initial velocities, which the low pass estimates poorly
LATEST = 0.03  # longest delay of the search [s]
PLAIN = "coulomb-viscous"  # law of the fit for starting values, if the law itself needs load or temperature


class MotionTask(Task):
    """One joint's motion given the input of its drive.

    Args:
        logs: logs to fit, with the drive's input.
        held_out: logs to judge on; without any, every third window of the fitted logs.
        name: of the joint.
        options: options of the user.

    Raises:
        InvalidInput: the drive is not known, or the logs do not fit together.
        UnknownName: a known parameter does not belong to an axis.
        NotIdentifiable: the joint never moves.
    """

    others = NAMES

    def __init__(self, logs: Sequence[Log], held_out: Sequence[Log], name: str, options: Options):
        info = self.info = logs[0].joints[logs[0].column(name)]
        assert not isinstance(options.drive, Drive)
        drive = self.drive = options.drive or drive_of(logs[0], drive_unknowns(options.bounds))
        self.fitted = [d for log in logs for d in drive_stretches(log, name, drive, options)]
        self.unseen = [d for log in held_out for d in drive_stretches(log, name, drive, options)]
        for number in options.known:
            lookup(number, dict.fromkeys(OF_AXIS, 0), "number of an axis")
        self.options, self.bounds = options, dict[str, Any](options.bounds)
        sought = {
            n[6:]: _middle(r)
            for n, r in self.bounds.items()
            if n.startswith("drive.") and n != "drive.proportional_factor"
        }
        self.middle = drive.replace(**sought)
        self.stretches = [d.stretch(self.middle) for d in self.fitted]
        gravity = gravity_terms(self.stretches, info.unit, options.gravity)
        terms = ("inertia", "offset", *gravity)
        asked = dict.fromkeys((*terms, *(n for n in self.bounds if n in GRAVITY)))
        self.terms = [term for term in asked if term not in options.known]
        self.scales = starts.scales(self.stretches, terms, info.unit, info.encoder_counts)
        self.axis = Axis(
            **{"law": Law(rate=Coulomb(coulomb=0.0)), "inertia": 1.0, "drive": drive, **options.known}  # type: ignore[arg-type]
        )
        self.held = drive.controller != "open"
        if drive.controller == "position" and any(log.drive_input is None for log in (*logs, *held_out)):
            self.notes = (f"{name}: The reference of the log is taken as the input of the drive.",)
        self.shown = self.whole = whole(self.fitted, self.held)
        if self.unseen:
            self.judges, self.whole = whole(self.unseen, self.held), None
        else:
            self.shown, self.judges = split(self.fitted, self.held)
        self.masks = [log.counts for log in self.judges]
        laws = choice.shortlist(options.law or "auto", presliding=False, load=False, warm=False)
        self.laws = directions.laws_to_try(laws, options.symmetric)
        position = np.concatenate([d.log.position - d.log.position.mean() for d in self.fitted])
        self.what = ("motion", info.unit, float(np.sqrt(np.mean(position**2))))

    def substeps(self, inertia: float) -> int:
        """Return the number of integration steps per sample, from the fastest time constant of drive and inertia."""
        dt, drive = self.fitted[0].log.dt, self.drive
        if self.options.step is not None:
            return max(1, int(np.ceil(dt / self.options.step - 1e-6)))
        damping = drive.proportional if drive.controller == "velocity" else drive.derivative
        stiffness = drive.proportional if drive.controller == "position" else 0.0
        if drive.actuator == "motor":
            volts = self.middle.supply * self.middle.torque_constant / self.middle.resistance
            damping = damping * volts + self.middle.torque_constant**2 / self.middle.resistance
            stiffness *= volts
        step = min(STEP, QUICK / max(damping / inertia, np.sqrt(stiffness / inertia), 1e-9))
        return min(max(1, int(np.ceil(dt / step - 1e-6))), max(FINEST, int(np.ceil(dt / STEP))))

    def fit(self, law: str, records: Sequence[MotionLog], begin_at: Mapping[str, float] | None = None) -> Fit:
        """Return the fit of one law to motion logs, starting from a fit to the drive's torque or from given values [SI]."""
        shape = LawShape.from_name(law)
        shape = directions.symmetric_shape(shape) if self.options.symmetric else shape
        terms = directions.terms_beside(shape, self.terms, self.options)
        shape = shape.beside(terms)
        start = dict(begin_at) if begin_at else self._start(shape, terms)
        free = self._free(shape, terms, start)
        problem = MotionProblem(
            shape,
            records,
            self.axis,
            free,
            substeps=self.substeps(start.get("inertia", self.axis.inertia)),
            scales=self.scales,
            unit=self.info.unit,
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
            tick=ticker(self.options.say, self.info.name),
        )

    def error(self, one: Fit) -> tuple[float, int]:
        """Return the mean squared error of the fitted motion, and the number of samples."""
        return float(np.mean(one.found.residual**2)), one.samples

    def explains(self, final: Fit, judged: Fit) -> bool:
        """Return whether to use the fit to all data; False if it was interrupted at a larger error than the judged fit."""
        return not (final.interrupted and final.rms > judged.rms)

    def _start(self, shape: LawShape, terms: Sequence[str]) -> dict[str, float]:
        law_bounds = {n: r for n, r in self.bounds.items() if n in numbers_of(shape)}
        found = fit_law(
            PLAIN if shape.rate.NEEDS else shape,
            self.stretches,
            unit=self.info.unit,
            counts=self.info.encoder_counts,
            terms=terms,
            delay=self.options.delay
            and not self.held,  # under a controller, the input is late but not the whole torque
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

    def _free(self, shape: LawShape, terms: Sequence[str], start: dict[str, float]) -> dict[str, Any]:
        """Return the ranges of all estimated parameters; ranges of the user replace the default ones."""
        force = max(float(np.abs(s.torque).max()) for s in self.stretches)
        free: dict[str, Any] = {}
        for term in terms:
            value = start.get(term, 0.0)
            if term == "inertia":
                top = max(float(np.abs(s.acceleration).max()) for s in self.stretches)
                value = start[term] = max(value, 1e-3 * force / max(top, 1e-12))
                free[term] = (value / 20.0, 20.0 * value, value)
            else:
                reach = 2.0 * force
                free[term] = (-reach, reach, float(np.clip(value, -reach, reach)))
        if self.held and len(self.stretches) <= STARTS:
            free["start.velocity"] = (-self.scales.speed, self.scales.speed, 0.0)
        if self.options.delay:
            free["drive.delay"] = (0.0, LATEST, float(np.clip(start.get("drive.delay", 0.0), 0.0, LATEST)))
        for n, r in self.bounds.items():
            if n in shape.fixed or (n.startswith("drive.") or n in NAMES or n in numbers_of(shape)):
                free[n] = r
        for n, r in free.items():
            if n in start:
                start[n] = float(np.clip(start[n], r[0], r[1]))
        return free

    def finish(self, final: Fit, judged: Fit) -> tuple[JointFriction, JointEvidence]:
        """Return friction and evidence in terms of the torque that the drive must have produced."""
        stretches = [d.stretch(final.axis.drive) for d in self.fitted]
        tests = [d.stretch(final.axis.drive) for d in self.unseen]
        masks = [np.ones(len(s.torque), dtype=bool) for s in tests] or held_out_masks(self.fitted, self.held)
        friction, shown = finish(
            self.info,
            self._in_torque(final, stretches),
            self._in_torque(judged, stretches),
            _torque_signals(self.fitted, stretches),
            _torque_signals(self.unseen, tests),
            masks,
            self._estimates(final),
            "motion given the drive's input",
        )
        shown = replace(shown, controller_step=self._controller_step(final))
        return replace(friction, actuator=actuator_of(final.axis)), shown

    def _controller_step(self, final: Fit) -> tuple[float, float, float] | None:
        """Return the step at which a position controller acted, if nobody gave it [s], and damping and inertia that it takes."""
        drive = final.axis.drive
        if drive.controller != "position" or self.options.step is not None:
            return None
        step = self._step(final)
        reach = 0.5 * step * force_of(drive)
        return step, reach * drive.proportional, reach * drive.derivative

    def settings(self, final: Fit, held_out: float) -> dict[str, Any]:
        """Return drive, integration step and error of the motion, with which the simulation can be repeated."""
        return {
            "drive": describe_drive(final.axis.drive),
            "step": self._step(final),
            "motion": {"error": final.rms, "held_out": held_out, "unit": self.info.unit},
        }

    def _step(self, final: Fit) -> float:
        """Return the integration step of a fit [s]."""
        assert isinstance(final.problem, MotionProblem)
        return final.problem.logs[0].dt / final.problem.substeps

    def _in_torque(self, one: Fit, stretches: Sequence[Stretch]) -> Fit:
        """Return a fit of motion as a fit of the torque that the drive must have produced."""
        values, shape = {**self.options.known, **one.values}, one.problem.shape
        terms = [t for t in RIGID if t in values and t not in numbers_of(shape)]
        problem = TorqueProblem(shape, stretches, self.scales, terms=terms)
        search = Search(problem.residuals, problem.lower, problem.upper, loss=self.options.loss)
        point = problem.point(values)
        found = search.at(point, search.evaluate(point[None])[0])
        seen = conclude(problem, found, self.options.loss)
        return replace(
            seen,
            values={n: values.get(n, v) for n, v in seen.values.items()},
            standard_errors={n: one.standard_errors.get(n, np.nan) for n in seen.values},
            covariance=one.covariance,
            at_bound=one.at_bound,
            unseen=one.unseen,
            warnings=one.warnings,
        )

    def _estimates(self, final: Fit) -> dict[str, Estimate]:
        """Return the parameters of drive and axis, known and estimated, with which the simulation can be repeated."""
        numbers = {*numbers_of(final.problem.shape), *RIGID}
        given = {
            f"drive.{n}": (v, np.nan)
            for n, v in describe_drive(final.axis.drive).items()
            if isinstance(v, float) and np.isfinite(v)
        } | {n: (v, np.nan) for n, v in self.options.known.items() if n not in numbers}
        sought = {
            n: (v, final.standard_errors[n])
            for n, v in final.values.items()
            if n.startswith("drive.") or (n in OF_AXIS and n not in numbers)
        }
        return estimates(given | sought, self.info.unit)


def actuator_of(axis: Axis) -> Actuator:
    """Return the actuator of an axis with its drive: gain of an open-loop drive, torque limit and motor inertia."""
    drive, force = axis.drive, force_of(axis.drive)
    limit = force * drive.limit
    return Actuator(
        gain=force * drive.gain if drive.controller == "open" else None,
        torque_limit=limit if np.isfinite(limit) else None,
        motor_inertia=axis.inertia if axis.load_inertia > 0.0 else None,
    )


def force_of(drive: DriveModel) -> float:
    """Return the stall torque for each unit of the controller's output [N.m or N]."""
    return drive.supply * drive.torque_constant / drive.resistance if drive.actuator == "motor" else 1.0


def numbers_of(shape: LawShape) -> set[str]:
    """Return the names of a law's parameters."""
    return {*shape.rate.PARAMETERS, *shape.element.PARAMETERS}


def _middle(given: Any) -> float:
    low, high = float(given[0]), float(given[1])
    return float(np.sqrt(low * high)) if low > 0.0 and high >= 10.0 * low else 0.5 * (low + high)


def _torque_signals(
    parts: Sequence[DriveStretch], stretches: Sequence[Stretch]
) -> list[tuple[Signals, Stretch]]:
    """Return pairs of signals and stretch; the signals hold the drive's torque in place of its input."""
    return [(replace(d.signals, torque=s.torque), s) for d, s in zip(parts, stretches, strict=True)]
