"""Torque given motion: one joint's stretches and terms of the dynamics, prepared for the fit of several laws."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from backdrive._catalog import lookup
from backdrive.errors import BackdriveError, NotIdentifiable
from backdrive.identification.delay import delay_signals, earlier
from backdrive.identification.dynamic import choice, directions, starts
from backdrive.identification.dynamic.attenuation import restore_inertia
from backdrive.identification.dynamic.colour import whiten_noise
from backdrive.identification.dynamic.crossing import (
    fast,
    is_bounded,
    lags_behind,
    possible,
    sliding,
    sliding_only,
    slips_too_early,
    without_build_up,
)
from backdrive.identification.dynamic.fit import Fit
from backdrive.identification.dynamic.joint_fit import Task
from backdrive.identification.dynamic.law_fit import STEPS, fit_law
from backdrive.identification.dynamic.progress import ticker
from backdrive.identification.dynamic.result import finish
from backdrive.identification.dynamic.stretch import SMOOTHED, Stretch, stretch
from backdrive.identification.dynamic.through import with_crossings
from backdrive.identification.dynamic.unknowns import LawShape
from backdrive.identification.motion import identify_motion
from backdrive.identification.motion_bins import bin_time, period_of
from backdrive.identification.options import Options
from backdrive.identification.result import JointEvidence
from backdrive.identification.signals import Signals, prepare, varies
from backdrive.identification.smoothing import FINE, smoothing
from backdrive.identification.terms import GRAVITY, RIGID, estimates
from backdrive.laws import CoulombViscous, Degressive, Rigid
from backdrive.logs.log import Log
from backdrive.logs.resolution import encoder_step
from backdrive.model import JointFriction

# largest mean squared error of the fit to all data, relative to the fit without held-out data [-]
WORSE = 1.1
# largest mean squared error in sliding of the fit to sliding alone, relative to the fit to all samples [-]
BETTER = 0.9
MOST_PULL = 100.0  # ratio of gravity to friction above which two terms cancel each other [-]
TURNS = 0.5  # least rotation that shows gravity [rad]


class TorqueTask(Task):
    """One joint's torque given its motion.

    Args:
        logs: logs to fit.
        held_out: logs to judge on; without any, every third window of the fitted logs.
        name: of the joint.
        options: options of the user.

    Raises:
        UnknownName: a known parameter is not a term of the dynamics.
        NotIdentifiable: the joint never moves, or its torque never changes.
    """

    def __init__(self, logs: Sequence[Log], held_out: Sequence[Log], name: str, options: Options):
        for term in options.known:
            lookup(term, dict.fromkeys((*RIGID, "delay"), 0), "number that a fit of torque takes as known")
        self.options, self.logs = options, logs
        info = self.info = logs[0].joints[logs[0].column(name)]
        smooth = smoothing(logs, name, options.cutoff, FINE, held_out)
        self.cutoff, self.rounding = smooth.cutoff, smooth.error
        self.remarks = (smooth.warning,) if smooth.warning else ()
        self.notes = (f"{name}: {smooth.note}",) if smooth.note else ()
        late = options.known.get("delay", 0.0)
        self.pairs = [
            pair
            for k, log in enumerate(logs)
            for pair in _stretches(log, name, smooth.cutoff, late, number=k)
        ]
        self.unseen = [
            pair for log in held_out for pair in _stretches(log, name, smooth.cutoff, late, number=-1)
        ]
        known = {term: value for term, value in options.known.items() if term != "delay"}
        delay = options.delay and "delay" not in options.known
        stretches = [s for _, s in self.pairs]
        pull = gravity_terms(stretches, info.unit, options.gravity)
        if (
            not pull
            and options.gravity is None
            and "offset" not in options.known
            and gravity_shows(logs, name)
        ):
            pull = GRAVITY
        sought = ("inertia", "offset", *pull)
        asked = dict.fromkeys((*sought, *(term for term in RIGID if term in options.bounds)))
        terms = [term for term in asked if term not in options.known]
        self.load = all(s.load.shape[0] > 1 and varies(s.load[:, 1]) for s in stretches)
        self.warm = all(s.temperature.size > 1 and varies(s.temperature) for s in stretches)
        step = max(encoder_step(log, name) for log in logs)
        counts = 1.0 / step if step > 0.0 else None
        sizes = starts.scales(stretches, terms, info.unit, counts, known)
        presliding = sizes.length * (counts or np.inf) >= 5.0
        presliding = presliding and _slow_reversals(stretches, sizes.length)
        if self.unseen:
            self.shown, self.judges, self.whole = stretches, [s for _, s in self.unseen], None
            self.masks = [np.ones(len(s.torque), dtype=bool) for s in self.judges]
        else:
            slow = period_of([s.moves for s, _ in self.pairs]) / stretches[0].dt
            self.masks = choice.windows([len(s.torque) for s in stretches], slow)
            self.shown = choice.without(stretches, self.masks)
            self.judges = self.whole = stretches
        self.asked: dict[str, Any] = {
            "unit": info.unit,
            "counts": counts,
            "terms": terms,
            "delay": delay,
            "bounds": options.bounds,
            "known": known,
            "scales": sizes,
            "loss": options.loss,
            "seed": options.seed,
        }
        asked = options.law or "auto"
        laws = choice.shortlist(asked, presliding=presliding, load=self.load, warm=self.warm)
        self.laws = directions.laws_to_try(laws, options.symmetric)
        self.others = (*RIGID, *(("delay",) if delay else ()))
        size = float(np.sqrt(np.mean(np.concatenate([s.torque for s in stretches]) ** 2)))
        self.what = ("torque", info.torque_unit, size)

    def fit(self, law: str, records: Sequence[Stretch], begin_at: Mapping[str, float] | None = None) -> Fit:
        """Return the fit of one law to stretches, from a cold start or from values by name [SI].

        Raises:
            NotIdentifiable: the law depends on a load or a temperature that does not vary.
        """
        shape = LawShape.from_name(law)
        for need, there in (("load", self.load), ("temperature", self.warm)):
            if need in shape.rate.NEEDS and not there:
                raise NotIdentifiable(
                    f"'{law}' depends on the {need}, and the log holds none that varies.",
                    remedy=f"Name the channel, for example --map {need[:4]}=COLUMN.",
                )
        warm_start = {"begin": 8, "descend": 1, "begin_at": begin_at} if begin_at else {}
        shape = directions.symmetric_shape(shape) if self.options.symmetric else shape
        asked: dict[str, Any] = self.asked | {
            "terms": directions.terms_beside(shape, self.asked["terms"], self.options)
        }
        one = fit_law(
            shape, records, tick=ticker(self.options.say, self.info.name, STEPS), **asked, **warm_start
        )
        if not shape.element.SET_VALUED or shape.rate.SMOOTH:
            return one
        best = self._of_sliding(shape, records, one, asked, warm_start)
        if not slips_too_early(best.values) or is_bounded(self.options.bounds):
            return best
        slid = sliding(records, best.values.get("delay", 0.0))
        line = starts.rest_of(slid, asked["terms"], asked["known"])[0]["coulomb"]
        asked["bounds"] = dict(self.options.bounds) | possible(best.values, line)
        return fit_law(shape, slid, tick=ticker(self.options.say, self.info.name, STEPS), **asked)

    def _of_sliding(
        self,
        shape: LawShape,
        records: Sequence[Stretch],
        one: Fit,
        asked: Mapping[str, Any],
        warm_start: Mapping[str, Any],
    ) -> Fit:
        """Return the fit of a law to sliding alone if reversals bias the fit to all samples; otherwise the latter."""
        late = one.values.get("delay", 0.0)
        slid = sliding(records, late)
        if not any(s.only_sliding for s in slid):
            return one
        line = shape.rate is CoulombViscous
        if line and not lags_behind(records, slid, one.misses(records), late):
            return one  # a straight line fits through reversals as well
        fitted = fast(records, slid, late) if line else slid
        again = {"begin": 8, "descend": 1, "begin_at": one.values} if line else warm_start
        two = fit_law(shape, fitted, tick=ticker(self.options.say, self.info.name, STEPS), **asked, **again)
        if line:
            rest = without_build_up(fitted, two.misses(fitted), two.values.get("delay", 0.0))
            if all(np.array_equal(s.judged, t.judged) for s, t in zip(fitted, rest, strict=True)):
                return two
            warm = {**again, "begin_at": two.values}
            return fit_law(shape, rest, tick=ticker(self.options.say, self.info.name, STEPS), **asked, **warm)
        if lags_behind(records, slid, two.misses(records), late):
            return two
        return (
            two if choice.training_error(two, slid)[0] < BETTER * choice.training_error(one, slid)[0] else one
        )

    def error(self, one: Fit) -> tuple[float, int]:
        """Return the mean squared error on the fitted data, rests included, and the number of samples."""
        return choice.training_error(one, self.shown)

    def judges_of(self, one: Fit) -> Sequence[Stretch]:
        """Return the stretches to judge a fit on; only sliding counts if no law of the choice describes presliding."""
        if any(LawShape.from_name(law).element is not Rigid for law in self.laws):
            return self.judges
        return sliding(self.judges, one.values.get("delay", 0.0))

    def shows(self, one: Fit) -> bool:
        """Return whether the motion shows a law's presliding, and the law is possible: it breaks away above Coulomb friction.

        A viscous part that does not flatten is that of a simpler law.
        """
        if (
            one.problem.shape.rate is Degressive
            and "exponent" in one.at_bound
            and one.values["exponent"] > 0.5
        ):
            return False
        possible = is_bounded(self.options.bounds) or not slips_too_early(one.values)
        return possible and choice.shows_presliding(one.problem.shape, one.unseen, one.at_bound)

    def differs(self, one: Fit) -> bool:
        """Return whether parameters for each direction may lower the error enough, to first order."""
        late = one.values.get("delay", 0.0)
        velocity = [earlier(s.velocity, late / s.dt)[s.judged] for s in one.problem.stretches]  # type: ignore[attr-defined]
        return directions.gain(one, np.concatenate(velocity)) > 1.0 - (1.0 - choice.WORTH) ** 2

    def explains(self, final: Fit, judged: Fit) -> bool:
        """Return whether the fit to all data explains them about as well as the fit without held-out data.

        Where one of the two is a fit to sliding, only sliding counts: what it leaves at reversals depends on its delay alone. A
        delay that ended at its bound explains nothing.
        """
        if "delay" in final.at_bound and "delay" not in judged.at_bound:
            return False
        stretches = sliding_only(final, sliding_only(judged, [s for _, s in self.pairs]))
        return (
            choice.training_error(final, stretches)[0] <= WORSE * choice.training_error(judged, stretches)[0]
        )

    def sharpen(self, final: Fit) -> Fit:
        """Return the final fit without the encoder's effect on its inertia, with its coloured noise whitened, through reversals."""
        restored = restore_inertia(final) or final
        stretches = [s for s, _ in self.pairs]
        white = whiten_noise(restored, bin_time(stretches, self.cutoff))
        through = with_crossings(white, stretches, self.rounding)
        return through if self.options.symmetric is False else directions.average_directions(through)

    def finish(self, final: Fit, judged: Fit) -> tuple[JointFriction, JointEvidence]:
        """Return friction and evidence from the final fit and from the fit without held-out data."""
        known = dict(self.options.known)
        if any(log.model_torque is not None for log in self.logs):
            known["model_torque"] = 1.0
        given = estimates({term: (value, np.nan) for term, value in known.items()}, self.info.unit)
        friction, support = finish(self.info, final, judged, self.pairs, self.unseen, self.masks, given)
        support = replace(support, verdict=" ".join(filter(None, (support.verdict, final.through))))
        return friction, support

    def settings(self, final: Fit, held_out: float) -> dict[str, Any]:
        """Return the cutoff frequency of the motion's low pass."""
        return {"cutoff": self.cutoff}


def gravity_terms(stretches: Sequence[Stretch], unit: str, wanted: bool | None) -> tuple[str, ...]:
    """Return the terms of gravity to fit: if the user asks for them, or if the joint turns far enough to show gravity."""
    turns = unit == "rad" and all(s.position is not None for s in stretches)
    ends = [end(s.position) for s in stretches for end in (np.min, np.max) if s.position is not None]
    far = turns and max(ends) - min(ends) > TURNS
    return GRAVITY if wanted or (wanted is None and far) else ()


def gravity_shows(logs: Sequence[Log], name: str) -> bool:
    """Return whether a curve equal in both directions needs a gravity term, although the joint turns little.

    On a small stroke, neglected gravity looks like friction that differs by direction. Gravity is therefore tried first.
    """
    try:
        friction, _ = identify_motion(logs, name, symmetric=True)
    except BackdriveError:
        return False
    size = float(np.mean(np.abs(friction.law.torque(np.array(friction.validity.velocity)))))
    ends = [friction.dynamics[term] for term in GRAVITY if term in friction.dynamics]
    # over a small stroke only the slope of gravity is evidence, since a constant can replace its mean
    return bool(ends) and max(abs(e.value) for e in ends) < MOST_PULL * size


def _stretches(
    log: Log, name: str, cutoff: float | None, late: float = 0.0, number: int = 0
) -> list[tuple[Signals, Stretch]]:
    """Return signals and stretches of one joint, with load and temperature; a known model torque is subtracted.

    Args:
        log: a log of the joint.
        name: of the joint.
        cutoff: cutoff frequency of the motion's low pass [Hz].
        late: known delay of the torque [s]; the motion of the stretches is shifted by it.
        number: of the log among the fitted ones; -1: of none of them.
    """
    found = []
    for signals in prepare(log, name, cutoff=cutoff):
        then = delay_signals(signals, late)
        one = stretch(
            then,
            load=then.load,
            temperature=signals.temperature,
            bandwidth=SMOOTHED if cutoff is None else min(cutoff, SMOOTHED),
            cutoff=cutoff,
        )
        if signals.model_torque is not None:
            one = replace(one, torque=one.torque - signals.model_torque)
        found.append((signals.of_log(number), one))
    return found


def _slow_reversals(stretches, length: float) -> bool:
    """Return whether at least three reversals take five samples or more to cross the presliding distance."""
    count = 0
    for s in stretches:
        path = np.cumsum(np.abs(s.dp))
        turns = np.flatnonzero(np.diff(np.sign(s.velocity)) != 0)
        turns = turns[turns + 6 < len(path)]
        count += np.count_nonzero(path[turns + 5] - path[turns] < 2.0 * length)
    return bool(count >= 3)
