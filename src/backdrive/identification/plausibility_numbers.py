"""Plausibility rules on a result's numbers: signs, sizes, ratios, errors, and limits of ranges."""

from __future__ import annotations

import math

import numpy as np

from backdrive.identification.design import LARGEST_SLIP
from backdrive.identification.model_torque import is_gravity
from backdrive.identification.plausibility_residual import delay, structure
from backdrive.identification.remark import NO_ERRORS, ONE_WAY_ONLY, SHARE, SURE, Case, Remark
from backdrive.identification.terms import GRAVITY, columns

CANCEL = 3.0  # size of two opposing terms, relative to the torque, above which they cancel each other [-]
HALF_KNOWN = 0.5  # standard error of the model torque's factor above which it is undetermined [-]
PHASE = 0.5  # largest part of gravity that a known torque has not got, relative to either, where the two are compared [-]
KNOWN_DELAY = 0.1  # largest relative standard error of a known delay [-]
ONE_WAY = 0.05  # ratio of the directions' top speeds below which the motion has one direction only [-]
UNEQUAL = 3.0  # largest ratio of the directions' friction without a remark [-]
NOTICED = 0.01  # least delay with a remark: longer than a controller or a bus takes [s]
NOTICED_SAMPLES = (
    2.0  # the same: more than a torque that is held or averaged over an interval [sampling interval]
)
COUNTS = 2.0  # least steps of the encoder over which friction builds up, for its stiffness to be seen [-]
INSIDE = 0.95  # share of the top speed up to which a curve is not extrapolated [-]
GAP = 4.0  # ratio of two speeds between which some motion is expected [-]
FEWEST_INSIDE = 0.02  # least share of the means between them [-]
FASTEST = {"rad": 2000.0, "m": 100.0}  # highest possible speed of a joint [rad/s or m/s]


def direction(case: Case) -> Remark | None:
    """Remark on friction that drives the joint."""
    ends, unit = (
        case.friction.driving(case.friction.validity.lowest_speed or 0.0),
        f"{case.friction.joint.unit}/s",
    )
    if ends is None:
        return None
    return Remark(
        severity="poor",
        sentence=f"Friction is negative between {ends[0]:.4g} and {ends[1]:.4g} {unit}: there it adds energy "
        f"instead of dissipating it. Either the torque's sign is inverted, or the model lacks a torque.",
    )


def inertia(case: Case) -> Remark | None:
    """Remark on a negative inertia."""
    value, error = case.value("inertia")
    if not value < -2.0 * (error if math.isfinite(error) else 0.0):
        return None
    return Remark(
        severity="poor",
        sentence=f"The estimated inertia is negative ({value:.4g} {case.friction.dynamics['inertia'].unit}): torque "
        f"sign, or other "
        "axes' pull.",
    )


def speed(case: Case) -> Remark | None:
    """Remark on a speed above that of any machine."""
    top, unit = max(abs(v) for v in case.friction.validity.velocity), case.friction.joint.unit
    if not top > FASTEST[unit]:
        return None
    return Remark(
        severity="poor",
        sentence=f"The joint moves at up to {top:.3g} {unit}/s, faster than any machine: positions or time are in another unit.",
    )


def balance(case: Case) -> Remark | None:
    """Remark on gravity and an offset that cancel each other."""
    res = case.residual
    if res is None or not np.isfinite(res.position).all() or not res.size > 0.0:
        return None
    offset = case.value("offset")[0]
    pull = [case.value(term)[0] for term in GRAVITY]
    if not all(math.isfinite(x) for x in (offset, *pull)):
        return None
    gravity = np.array(pull) @ columns(res, GRAVITY)
    torque = float(np.sqrt(np.mean(res.torque**2)))
    least = min(float(np.sqrt(np.mean(gravity**2))), abs(offset))
    if least <= CANCEL * torque:
        return None
    return Remark(
        severity="poor",
        sentence=f"Gravity of {math.hypot(*pull):.3g} {case.unit} and an offset of {offset:.3g} {case.unit} cancel each "
        f"other where the joint moved; the torque is {torque:.3g} {case.unit}. Leave gravity out (--no-gravity), or move farther.",
    )


def directions(case: Case) -> Remark | None:
    """Remark on friction that is far larger in one direction."""
    low, high = case.friction.validity.velocity
    top = min(-low, high)
    if not top > 0.05 * max(-low, high):
        return None
    speeds = top * np.array([0.3, 0.6, 0.9])
    forth, back = (float(np.mean(np.abs(case.friction.law.torque(sign * speeds)))) for sign in (1.0, -1.0))
    if max(forth, back) <= UNEQUAL * min(forth, back):
        return None
    return Remark(
        severity="care",
        sentence=f"Friction is {forth:.3g} {case.unit} along +q and {back:.3g} {case.unit} along -q: so large a "
        f"difference is more likely a constant torque (gravity, a bias) than friction.",
    )


def one_way(case: Case) -> Remark | None:
    """Remark on motion in one direction, which does not separate friction from a constant torque."""
    low, high = case.friction.validity.velocity
    if case.friction.method != "motion" or min(-low, high) > ONE_WAY * max(-low, high):
        return None
    return Remark(severity="care", sentence=ONE_WAY_ONLY)


def vague_terms(case: Case) -> Remark | None:
    """Remark on terms smaller than twice their standard errors, graver if an error exceeds the whole torque."""
    res, vague, worst = case.residual, [], 0.0
    if res is None or not res.size > 0.0:
        return None
    for term, estimate in case.friction.dynamics.items():
        if term not in ("offset", "inertia", *GRAVITY):
            continue
        column = float(np.sqrt(np.mean(res.slides.acceleration**2))) if term == "inertia" else 1.0
        error = estimate.standard_error
        if abs(estimate.value) < 2.0 * error and error * column > 2.0 * SHARE * res.size:
            vague.append(f"{term} {estimate.value:.3g} ± {error:.2g} {estimate.unit}")
            worst = max(worst, error * column)
    if not vague:
        return None
    sentence = f"The data do not determine {', '.join(vague)}: the value is smaller than twice its error."
    if worst > float(np.sqrt(np.mean(res.torque**2))):
        return Remark(
            severity="care",
            sentence=f"{sentence} That is more than all torque: move farther, or use --no-gravity where the axis has none.",
        )
    return Remark(severity="note", sentence=sentence)


def certainty(case: Case) -> Remark | None:
    """Remark on a curve with large standard errors, in general or at some of its speeds."""
    curve = case.evidence.curve
    error, torque = curve.standard_error, np.abs(curve.torque)
    if not error.size or not np.isfinite(error).all() or not torque.mean() > 0.0:
        return None
    speed = np.abs(curve.velocity)
    seen = (speed >= (case.friction.validity.lowest_speed or 0.0)) & (speed <= INSIDE * speed.max())
    worst = int(np.argmax(error * seen))
    reach, most = 2.0 * float(np.median(error)), 2.0 * float(error[worst] * seen[worst])
    share, at_most = reach / float(torque.mean()), most / float(torque.mean())
    if share >= 0.5:
        return Remark(
            severity="unknown" if share > 1.0 else "care",
            sentence=f"The curve is known to ± {reach:.2g} {case.unit} ({100.0 * share:.0f} %) only: record more reversals, at "
            "more speeds.",
        )
    if at_most < 0.5:
        return None
    return Remark(
        severity="care",
        sentence=f"At {curve.velocity[worst]:.2g} {case.friction.joint.unit}/s the curve is known to ± {most:.2g} {case.unit} "
        f"({100.0 * at_most:.0f} % of the mean friction) only: record more motion at such speeds.",
    )


def speed_gap(case: Case) -> Remark | None:
    """Remark on speeds between slow and fast motion at which the joint hardly moved."""
    res = case.residual
    if res is None:
        return None
    speeds = np.sort(np.abs(res.velocity[res.moving]))
    validity = case.friction.validity
    slow = validity.LOW * max(abs(v) for v in validity.velocity)  # a gap may end where the curve begins
    speeds = speeds[speeds >= max(min(validity.lowest_speed or 0.0, slow), 1e-9)]
    inside = np.searchsorted(speeds, GAP * speeds, side="left") - np.arange(speeds.size) - 1
    few = (inside < max(FEWEST_INSIDE * speeds.size, 1.0)) & (
        GAP * speeds < (speeds[-1:] if speeds.size else 0.0)
    )
    if not few.any():
        return None
    starts = speeds[few]
    below = float(starts[0])
    above = GAP * float(starts[starts <= GAP * below][-1])
    return Remark(
        severity="note",
        sentence=f"The joint hardly moved at speeds between {below:.2g} and {above:.2g} {case.friction.joint.unit}/s: there the "
        "curve joins what was measured on both sides. Add motion between them.",
    )


def unseen_presliding(case: Case) -> Remark | None:
    """Remark on a stiffness whose whole deflection is hardly a step of the encoder."""
    stiffness = float(
        np.min(getattr(case.friction.law.element, "stiffness", math.nan))
    )  # of the softest element
    if case.residual is None or not stiffness > 0.0:
        return None
    distance, unit = case.residual.size / stiffness, case.friction.joint.unit
    if not COUNTS * case.count > distance:
        return None
    return Remark(
        severity="care",
        sentence=f"Friction builds up over {distance:.2g} {unit}, and the encoder's step is {case.count:.2g} {unit}: stiffness and "
        "damping of presliding are not seen, and their errors do not hold. Read a finer encoder, or use a law without presliding.",
    )


def gravity_apart(case: Case) -> Remark | None:
    """Remark on gravity that was fitted along an integrated velocity, which a model cannot hold."""
    size = case.evidence.unplaced
    if not size > 0.0:
        return None
    return Remark(
        severity="care",
        sentence=f"The log has no position: gravity of up to {size:.3g} {case.unit} was fitted along the integrated velocity, and "
        "the model leaves it out, since it does not know the angle. Friction and inertia hold; a torque that the model predicts "
        "lacks gravity. A log with positions gives both.",
    )


def unknown_error(case: Case) -> Remark | None:
    """Remark on a curve from motion without a standard error anywhere, with the reasons that the method gave."""
    error = case.evidence.curve.standard_error
    if case.friction.method != "motion" or not error.size or not np.isnan(error).all():
        return None
    told = [sentence for sentence in case.friction.warnings if sentence.startswith(NO_ERRORS)]
    return Remark(
        severity="care",
        sentence=told[0] if told else f"{NO_ERRORS}how far off the curve may be cannot be told.",
    )


def delay_at_bound(case: Case) -> Remark | None:
    """Remark on a delay at which a search ended for want of range."""
    value, error = case.value("delay")
    if case.known_delay is not None or not (math.isnan(error) and abs(value) > 0.0):
        return None
    return Remark(
        severity="care",
        sentence=f"The delay of the torque ended at the edge of its range, {1e3 * value:.3g} ms: it may be longer, or the motion "
        "does not tell it, and friction is wrong with it. Align the channels (`backdrive inspect`), or give it (--known "
        "delay=SECONDS).",
    )


def delay_range(case: Case) -> Remark | None:
    """Remark on a delay too long for a clock offset, graver if the delay is poorly known and may be even longer."""
    value, error = case.value("time_slip")
    sure = 0.0 < error <= KNOWN_DELAY * abs(value)
    if case.known_delay is not None or (sure and case.friction.method == "sweep"):
        return (
            None  # `user_delay` compares it with the motion; a sweep tells by itself how its torque was timed
        )
    spread = 2.0 * error if math.isfinite(error) else 0.0
    long = abs(value) + spread >= LARGEST_SLIP
    samples = max((log.period for log in case.logs), default=0.0)
    if not long and not (sure and abs(value) >= max(NOTICED, NOTICED_SAMPLES * samples)):
        return None
    shift = delay(case)
    if shift is not None and shift.severity == "care":
        return None  # the rule `delay` reports another delay that fits better
    if sure:
        other = structure(case) if long else None  # what else is the matter may look like a delay
        return Remark(
            severity="note" if other is None else "care",
            sentence=f"{_correction(value, error)}{'' if other is None else ' What else is said below may look like a delay.'}",
        )
    if abs(value) < spread:
        return Remark(
            severity="care",
            sentence=f"The delay of the torque is known to ± {1e3 * spread:.2g} ms only. Align the channels (`backdrive inspect`), "
            "or give it (--known delay=SECONDS).",
        )
    if 0.0 < error < math.inf:
        return Remark(
            severity="care",
            sentence=f"The delay of the torque, {1e3 * value:.3g} ± {1e3 * error:.2g} ms, is hardly known, and friction with it. "
            "Align the channels (`backdrive inspect`), give it (--known delay=SECONDS), or look for a filter in one of them.",
        )
    return Remark(
        severity="care",
        sentence=f"The delay of the torque, {1e3 * value:.3g} ms, is at the edge of what is sought ({1e3 * LARGEST_SLIP:.3g} ms): "
        "it may be longer. Align the channels (`backdrive inspect`), or look for a filter in one of them.",
    )


def _correction(value: float, error: float) -> str:
    """Return a sentence on a delay that was found and corrected, with its standard error [s]."""
    way = "later" if value > 0.0 else "earlier"
    return (
        f"The torque comes {1e3 * abs(value):.3g} ± {1e3 * error:.2g} ms {way} than the motion: this delay was estimated and "
        "corrected. Record both from one message, or look for a filter in one of them, which delays slow motion more than fast."
    )


def _gravity_share(case: Case) -> float:
    """Return how much of a known torque that is gravity the fitted gravity is [-]; NaN if it is small, or another torque."""
    res, terms = case.residual, [term for term in GRAVITY if term in case.friction.dynamics]
    if res is None or not np.isfinite(res.position).all() or not res.known.std() > SHARE * res.size:
        return math.nan
    if not is_gravity([res.position], [res.known], [res.torque]):
        return math.nan
    known = res.known - res.known.mean()
    pull = np.array([case.value(term)[0] for term in terms]) @ columns(res, terms) if terms else 0.0 * known
    share = float(known @ pull / (known @ known))
    out_of_phase = pull - pull.mean() - share * known
    return share if out_of_phase.std() <= PHASE * max(float(pull.std()), float(known.std())) else math.nan


def external_share(case: Case) -> Remark | None:
    """Remark on a factor of the model torque other than one."""
    value, error = case.value("model_torque")
    sure = math.isfinite(error)
    if not sure:  # left out or taken as one, and gravity fitted in its place or beside it
        fitted = _gravity_share(case)
        value = value if math.isnan(fitted) else fitted + (0.0 if math.isnan(value) else value)
    if sure and error > HALF_KNOWN:
        return Remark(
            severity="care",
            sentence=f"The torque known from elsewhere has a share of {value:.3g} ± {error:.2g} where 1 is meant: the motion does "
            "not tell it from the other terms. Leave gravity out (--no-gravity), or the known torque.",
        )
    if not abs(value - 1.0) > max(SURE * error if sure else 0.0, SHARE):
        return None
    share = f"{value:.3g} ± {error:.2g}" if sure else f"{value:.3g}"
    res = case.residual
    known = (
        float(np.sqrt(np.mean(res.slides.known**2))) if res is not None and res.sliding.any() else math.nan
    )
    if res is not None and known < SHARE * res.size:
        cause = f"with {known:.2g} {case.unit} it is too small to be told. Leave it out"
    elif value < 0.0:
        cause = (
            "it has the opposite sign of the measured torque. Read it with a minus (--map tau_model=-COLUMN)"
        )
        accurate = not sure or error < SHARE
        if accurate and abs(value + 1.0) <= (max(SURE * error, SHARE) if sure else SHARE):
            cause += "; the fit has corrected it, so friction is right"
        else:
            cause += (
                "; its size differs too, or the gain of the measured torque is wrong, and friction with it"
            )
    else:
        cause = "its size or the gain of the measured torque is wrong, and friction with it"
    return Remark(
        severity="care",
        sentence=f"The torque known from elsewhere has a share of {share} where 1 is meant: {cause}.",
    )
