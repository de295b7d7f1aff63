"""Plausibility rules on the torque residual, and on the recording of torque, position and time."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from backdrive.identification import lateness
from backdrive.identification.delay import LATE, correction
from backdrive.identification.design import LARGEST_SLIP
from backdrive.identification.log_set import clock_unit
from backdrive.identification.plausibility_logs import other_joints
from backdrive.identification.remark import Case, Remark
from backdrive.identification.residual import MEAN, Explanation, Residual
from backdrive.identification.reversal_lag import turning_lag
from backdrive.identification.signals import varies
from backdrive.identification.terms import GRAVITY, columns
from backdrive.laws import CoulombViscous, Rigid
from backdrive.logs import filters

CHANCE = 1e-5  # largest probability that noise explains as much as a reported cause [-]
OF_CHANGE = 1e-3  # the same for a change of the friction over the log, which coloured noise hides [-]
OF_OTHERS = (
    0.03  # time over which the residual is averaged before the motion of other joints is looked at [s]
)
KEPT = 0.8  # least share of what that motion explains that is then left [-]
STRUCTURE = 0.015  # least explained residual with a remark, relative to the friction [-]
GRAVE = 0.25  # explained residual above which the grade is lowered, relative to the friction [-]
MOST = (
    1.5  # largest plausible explained residual, relative to the friction; above, terms are not separated [-]
)
BENDS = 0.1, 0.2, 0.35  # speeds by which a bend of the friction falls, relative to the top speed [-]
BENT = 0.03  # least bend beyond a straight line that lowers the grade, relative to the friction [-]
LEFT = 0.1  # largest slow residual without a remark, relative to the friction [-]
WORTH = 0.96  # largest residual after correction of the delay for a remark, relative to that before [-]
CONTRARY = 0.3  # least delay of the other sign that contradicts one, relative to that [-]
SURE_DELAY = 3.0  # the same, by its standard error [-]
MOST_LOGS = 6  # largest number of stretches whose loads are compared
SLOWER = 0.25  # speed below which friction changes its sign, relative to the lowest speed of the curve [-]
FEWEST_PASSES, SURE_PEAK = 8, 4.0  # of slow motion, and least significance of a peak there [standard error]
HIGHER = 0.05  # least height of a peak with a remark, relative to the friction [-]
WILD = 3e-3  # largest share of outliers without a remark [-]
COARSE = 0.25  # largest step of the measured torque without a remark, relative to the friction [-]
FEW_STEPS = 0.3  # largest encoder step without a remark, relative to the travel in `MEAN` at top speed [-]


def clock(case: Case) -> Remark | None:
    """Remark on a time that is probably not in seconds."""
    sentence = "" if case.residual is None else clock_unit(1.0 / case.residual.period)
    return Remark(severity="care", sentence=sentence) if sentence else None


def delay(case: Case) -> Remark | None:
    """Remark on a delay of the torque, from how late friction turns, or from the shift at which a friction curve fits best."""
    if (res := case.residual) is None:
        return None
    return _late_turns(case, res) or _best_shift(case, res)


def _late_turns(case: Case, res: Residual) -> Remark | None:
    if not isinstance(case.friction.law.element, Rigid) or not (lag := turning_lag(res)):
        return None
    found = correction(case.friction.delay)
    beside = f"Beside the {1e3 * found:.3g} ms that the fit corrects, friction" if found else "Friction"
    return Remark(
        severity="care",
        sentence=f"{beside} turns {1e3 * abs(lag):.0f} ms {_way(lag)} than the motion, at once and at every reversal: torque comes "
        f"{1e3 * abs(found + lag):.0f} ms {_way(found + lag)}. Align the channels (`backdrive inspect`), or give it "
        f"(--known delay={found + lag:.3g}).",
    )


def _best_shift(case: Case, res: Residual) -> Remark | None:
    # in a fit of a curve over velocity alone, friction that grows with the load looks like a delay
    growing = case.friction.law.growth is not None
    others = [np.sign(res.velocity) * _static_load(case, res)] if growing else []
    found = lateness.delay(res, *others)
    if found is None or abs(found[0]) < LATE or found[1] > WORTH:
        return None
    beside = lateness.delay_beside_distance(res, *others)
    if beside is not None and abs(beside[0]) < LATE:
        return None  # friction lags by itself
    sure = beside is not None and beside[1] <= WORTH
    if beside is not None and sure:
        found = beside
    estimates = (case.value(term) for term in ("delay", "time_slip"))
    known, error = max(estimates, key=lambda one: abs(np.nan_to_num(one[0])))
    counted = (
        "time_slip" in case.friction.dynamics and abs(known) >= LATE
    )  # the residual is `in_step` with it
    late = found[0] + (known if counted else 0.0)
    told = not counted and abs(np.nan_to_num(known) - late) < 0.3 * abs(late)
    if told and abs(known) >= LARGEST_SLIP:
        return None  # `delay_range` reports it with its standard error
    if known * late < 0.0 and abs(known) > max(CONTRARY * abs(late), SURE_DELAY * error):
        return Remark(
            severity="care",
            sentence=f"By the inertia, torque comes {1e3 * abs(known):.2g} ms {_way(known)} than motion; by all terms, about "
            f"{1e3 * abs(late):.0f} ms {_way(late)}: one is a filter, or friction that builds up over a distance.",
        )
    part = (
        f", of which {1e3 * abs(known):.0f} ms were found and corrected"
        if counted and late * known > 0.0
        else ""
    )
    return Remark(
        severity="note" if told or not sure else "care",
        sentence=f"Torque comes about {1e3 * abs(late):.0f} ms {_way(late)} than motion{part}"
        + ("." if sure else ", or friction builds up over a distance: the motion does not tell which."),
    )


def _way(delay: float) -> str:
    return "later" if delay > 0.0 else "earlier"


def slow_peak(case: Case) -> Remark | None:
    """Remark on friction that is higher than the curve at speeds too slow, or passed too quickly, for the fit of the curve."""
    res, lowest = case.residual, case.friction.validity.lowest_speed
    if res is None or not lowest or case.friction.method != "motion":
        return None
    speed = np.abs(res.velocity)
    rows = np.flatnonzero(res.moving & (speed < lowest) & (speed > SLOWER * lowest))
    along = (res.torque_error * np.sign(res.velocity))[rows]
    passes = np.cumsum(np.diff(rows, prepend=-2) > 1) - 1
    count = int(passes[-1]) + 1 if rows.size else 0
    if count < FEWEST_PASSES:
        return None
    mean = float(along.mean())
    scatter = np.bincount(passes, along - mean)
    error = math.sqrt(float(scatter @ scatter) * count / (count - 1)) / rows.size
    if not mean > max(SURE_PEAK * error, HIGHER * res.size):
        return None
    return Remark(
        severity="note",
        sentence=f"Slower than {lowest:.2g} {case.friction.joint.unit}/s, where the curve was hardly fitted, friction is about "
        f"{mean:.2g} {case.unit} ({100.0 * mean / res.size:.0f} %) higher than the curve: a Stribeck peak. Add slow motion, or fit "
        "a law that has one (--law stribeck-gauss).",
    )


def torque_steps(case: Case) -> Remark | None:
    """Remark on a torque measured in large steps."""
    if case.residual is None or not case.residual.step > COARSE * case.residual.size:
        return None
    return Remark(
        severity="note",
        sentence=f"Torque is read in steps of {case.residual.step:.3g} {case.unit}, "
        f"{100.0 * case.residual.step / case.residual.size:.0f} % "
        "of the friction.",
    )


def encoder_steps(case: Case) -> Remark | None:
    """Remark on positions measured in large steps."""
    top = max(abs(v) for v in case.friction.validity.velocity)
    if case.friction.method == "ramp" or not case.count > FEW_STEPS * top * MEAN:
        return None  # on a ramp, the joint hardly moves
    return Remark(
        severity="note",
        sentence=f"The encoder's step of {case.count:.3g} {case.friction.joint.unit} lasts {1e3 * case.count / top:.2g} ms even at "
        "top speed: velocity and acceleration are coarse. Read a finer encoder, or move faster.",
    )


def wild_samples(case: Case) -> Remark | None:
    """Remark on outliers of the torque."""
    if case.residual is None or not case.residual.wild > WILD:
        return None
    return Remark(
        severity="note",
        sentence=f"{100.0 * case.residual.wild:.3g} % of the torque's samples in motion are far off their neighbours.",
    )


def structure(case: Case) -> Remark | None:
    """Remark on the variable that explains most of the residual, such as time, load or position, or else on a slow residual."""
    if case.residual is None or not case.residual.size > 0.0:
        return None
    res = case.residual.slides
    way, size = np.sign(res.velocity), case.residual.size
    load = np.abs(res.torque - res.friction)
    share, wave = (
        "{amount:.2g} {unit}, {share:.0f} % of the friction",
        "every {wave:.2g} " + case.friction.joint.unit,
    )
    static = _static_load(case, res)
    follows_load = f"Friction depends on the load, by {share}: "
    changes = f"Friction changes over the log, by {share}: warming, or changed midway."
    drifts = f"The torque drifts over the log, by {share}: warming, a bias, or a cable."
    causes: list[tuple[tuple[np.ndarray, ...], str]] = []
    for time in _times(res):
        late = np.sign(time)
        causes += [
            ((time, late), drifts),
            ((way * time, way * late), changes),
            ((way * time,), changes),
            ((res.predicted * late,), f"The torque changed midway, by {share}: its gain, or its sign."),
        ]
    along = case.friction.method == "motion"  # there a curve is as bent as the data ask for
    instead = "try --law polyline" if along else "try others (--law auto chooses among several)"
    bent = f"Friction over the speed is not that of this law, by {share}: {instead}."
    if not along or isinstance(case.friction.law.rate, CoulombViscous):
        speed = np.abs(res.velocity)
        causes += [((way * np.exp(-((speed / (part * speed.max())) ** 2)),), bent) for part in BENDS]
    causes += [((way * load,), follows_load), ((way * static,), follows_load)]
    differs = f"Inertia or gravity differs between the logs, by {share}: another load."
    if loads := _by_log(case, res):
        causes.append((loads, differs))
    explained = res.explain_each(*(columns for columns, _ in causes), smallest=STRUCTURE * size)
    highest = {changes: OF_CHANGE, follows_load: CHANCE, differs: CHANCE, bent: CHANCE}
    least = STRUCTURE * size
    tests = [
        (_lasting(res, one, columns, highest[sentence], least) if sentence in highest else one, sentence)
        for one, (columns, sentence) in zip(explained, causes, strict=True)
    ]
    # a factor for each log but one is large where that one tells no inertia: only what all logs together do not explain counts
    tests = [
        (replace(e, size=e.beyond) if e is not None and sentence == differs else e, sentence)
        for e, sentence in tests
    ]
    of_torque, of_friction = res.over_position
    tests += [
        (of_torque, f"Torque follows the position {wave}, by {share}: cogging, or a gear's ripple."),
        (of_friction, f"Friction follows the position {wave}, by {share}."),
    ]
    # the motion of other joints is slow, and costly to evaluate
    slow = filters.means(res.torque_error, max(round(OF_OTHERS / res.period), 1))
    if slow.size and float(np.sqrt(np.mean(slow**2))) > KEPT * STRUCTURE * size:
        for known, groups in other_joints(case):
            pulls = known.explain_each(*(rows for rows, _ in groups), least=STRUCTURE * size)
            tests += [  # only the part that this joint's own motion does not explain counts as coupling
                (replace(pull, size=pull.beyond), f"Torque follows {cause}, by {share}: its pull.")
                for pull, (_, cause) in zip(pulls, groups, strict=True)
                if pull is not None
            ]
    sure = [
        (e, sentence)
        for e, sentence in tests
        if e is not None
        and e.chance < highest.get(sentence, CHANCE)
        and STRUCTURE * size < e.size < MOST * size
    ]
    if not sure:
        return slow_torque(case)
    best, sentence = max(sure, key=lambda pair: pair[0].beyond)
    advice = _of_load(case, static, best.coefficients[0], sentence) if sentence == follows_load else ""
    amount = 0.5 * best.span if best.wave else best.span if sentence in (drifts, changes) else best.size
    named = (advice or sentence).format(
        amount=amount,
        unit=case.unit,
        share=100.0 * amount / size,
        wave=2.0 * np.pi / best.wave if best.wave else 0.0,
    )
    grave = best.size > GRAVE * size or (sentence == bent and best.beyond > BENT * size)
    return Remark(severity="care" if grave else "note", sentence=named)


def _lasting(
    res: Residual, found: Explanation | None, columns: tuple[np.ndarray, ...], chance: float, least: float
) -> Explanation | None:
    """Return an explanation if it is sure without the outlying means too; those beside reversals tell no slow cause."""
    if found is None or found.chance >= chance:
        return None
    again = res.near.explain_each([column[res.is_near] for column in columns])[0]
    return found if again is not None and again.chance < chance and again.size > least else None


def _by_log(case: Case, res: Residual) -> tuple[np.ndarray, ...]:
    """Return columns of a factor on inertia and one on gravity, of each log but the first of a few, (n,) each."""
    parts = np.unique(res.part)
    if len(case.logs) < 2 or not 1 < parts.size <= MOST_LOGS:
        return ()
    rows, pull = [res.acceleration], np.array([case.value(term)[0] for term in GRAVITY])
    if np.isfinite(pull).all() and np.isfinite(res.position).all():
        rows.append(pull @ columns(res, GRAVITY))
    return tuple(row * (res.part == part) for part in parts[1:] for row in rows)


def _times(res: Residual) -> list[np.ndarray]:
    """Return the normalised time of the means, from -0.5 to 0.5, over all stretches and, if there are several, in each one."""
    starts = np.flatnonzero(np.diff(res.part, prepend=-1))
    ends = np.append(starts[1:], res.part.size) - 1
    lengths = ends - starts + 1
    spans = res.time[ends] - res.time[starts] + res.period
    within = res.time - np.repeat(res.time[starts], lengths)
    over_all = (within + np.repeat(np.cumsum(spans) - spans, lengths)) / spans.sum() - 0.5
    return [over_all] if starts.size == 1 else [over_all, within / np.repeat(spans, lengths) - 0.5]


def _static_load(case: Case, res: Residual) -> np.ndarray:
    """Return the magnitude of the static load, gravity plus model torque [N.m or N], (n,)."""
    share, angle = case.value("model_torque")[0], np.isfinite(res.position).all()
    held = np.zeros_like(res.torque) if not math.isfinite(share) else share * res.known
    if angle:
        held = held + np.nan_to_num([case.value(term)[0] for term in GRAVITY]) @ columns(res, GRAVITY)
    return np.abs(held)


def _of_load(case: Case, static: np.ndarray, growth: float, what: str) -> str:
    """Return a sentence on friction that depends on the load, with the law for it only where the log tells its load.

    Friction in gears grows with the load that stands still, and by less than that. What does not is another effect of the
    acceleration.

    Args:
        case: of the joint.
        static: magnitude of the static load [N.m or N], (n,).
        growth: of the friction by the load [-].
        what: the beginning of the sentence.
    """
    if not (0.0 < growth < 1.0 and varies(static)):
        return (
            f"{what.replace('depends on the load', 'differs while the joint accelerates')}it builds up after reversals (--law "
            "lugre), or grows with the load of the inertia."
        )
    loads = [log.load if log.load is not None else log.external_torque for log in case.logs]
    columns_of = [log.column(case.friction.joint.name) for log in case.logs]
    known = [x is not None and varies(np.nan_to_num(x[:, k])) for x, k in zip(loads, columns_of, strict=True)]
    if known and all(known):
        return f"{what}use a law with load (--law m3)."
    return f"{what}a law for it needs the load in the log (--map load=COLUMN --law m3), or sweeps about several centers."


def slow_torque(case: Case) -> Remark | None:
    """Remark on a slow residual of unknown cause."""
    if case.residual is None or not case.residual.size > 0.0:
        return None
    res = case.residual.slides
    width = max(round(0.1 / res.period), 1)
    n = res.time.size // width
    if n < 10:
        return None
    means = filters.means(res.torque_error, width)
    slow = float(
        np.sqrt(max(np.mean(means[1:] * means[:-1]), 0.0))
    )  # errors of the acceleration are not alike in neighbours
    if slow <= LEFT * res.size:
        return None
    return Remark(
        severity="note",
        sentence=f"{slow:.3g} {case.unit} of slow torque remains in motion, {100.0 * slow / res.size:.0f} % of the friction: "
        f"the model lacks a torque.",
    )
