"""Contacts: instants at which the estimate exceeds its level in free motion, with a stated rate of false alarms.

The score is the distance of the estimate from zero, in units of the band. In motion it is |estimate| divided by half the band,
at rest the holding torque divided by the friction's interval. The threshold, by joint and state of motion, is the level that
free motion exceeds at the joint's share of the false-alarm rate (`tail`). Each state has the same rate per hour, so that all
joints together have the stated rate for any mixture of states. The threshold is at least one band, since a force within the
band cannot be detected.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from backdrive.errors import NotIdentifiable
from backdrive.external.calibrate import Calibration, period
from backdrive.external.result import STATES, Contact, ForceEstimate, JointForce, Threshold
from backdrive.external.tail import clusters, tail

APART = 0.25  # time below the threshold, after which another contact begins [s]
ACROSS = 1.0  # longest reversal between two contacts that are joined into one [s]
HOUR = 3600.0
FAR = 3.0  # threshold relative to the highest peak of free motion, above which a remark names it [-]
VAGUE = 2.0  # ratio of the ends of its interval, likewise [-]
REST, TURNS = STATES.index("rest"), STATES.index("reversing")


def score(one: JointForce) -> np.ndarray:
    """Return the distance of the estimate from zero in bands, (n,); NaN where there is no band.

    Bands without their part for abrupt changes: a contact is one.
    """
    middle = np.where(one.state == REST, one.force - one.friction, one.force)
    more = 0.0 if one.abrupt is None else one.abrupt
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(
            middle >= 0.0, middle / (middle - one.lower - more), middle / (middle - one.upper + more)
        )


def half_bands(one: JointForce) -> list[float]:
    """Return half the band of each state, at rest half the friction's interval [N.m or N]; NaN for an absent state."""
    half = 0.5 * (one.upper - one.lower)
    return [
        float(np.median(half[one.state == k])) if np.any(one.state == k) else np.nan
        for k in range(len(STATES))
    ]


def thresholds_of(calibration: Calibration, false_alarms: float) -> tuple[Threshold, ...]:
    """Return the thresholds of one joint, by state.

    Args:
        calibration: by free motion.
        false_alarms: of this joint [1/h].

    Raises:
        NotIdentifiable: the free motion has too few peaks in motion.
    """
    scores = [(score(f), f) for f in calibration.forces]
    rate = false_alarms / HOUR
    made: dict[int, Threshold] = {}
    for state, name in enumerate(STATES):
        parts = [(np.where(f.state == state, z, np.nan), f.time) for z, f in scores]
        exposure = sum(float(np.count_nonzero(f.state == state)) * period(f.time) for _, f in scores)
        try:
            of_state = tail(parts, exposure, APART)
        except NotIdentifiable:
            continue
        low, high = of_state.interval(rate)
        made[state] = Threshold(
            joint=calibration.joint,
            state=name,
            bands=max(of_state.level(rate), 1.0),
            interval=(max(low, 1.0), max(high, 1.0)),
            peaks=of_state.peaks,
            highest=of_state.highest,
            hours=exposure / HOUR,
            extrapolation=max(1.0 / (rate * exposure), 1.0),
        )
    in_motion = [made[state] for state in (0, 1) if state in made]
    if not in_motion:
        raise NotIdentifiable(
            f"Joint '{calibration.joint}': {calibration.duration:.3g} s of free motion have too few peaks for a threshold.",
            remedy="Give longer free motion (--free, which may be repeated), at best an hour or more.",
        )
    highest = max(in_motion, key=lambda t: t.bands)
    for state in (0, 1):
        made.setdefault(
            state, replace(highest, state=STATES[state], peaks=0, hours=0.0, extrapolation=np.inf)
        )
    made.setdefault(REST, _at_rest(calibration, highest))
    return tuple(made[state] for state in range(len(STATES)))


def _at_rest(calibration: Calibration, motion: Threshold) -> Threshold:
    """Return the threshold for rest if free motion contains little rest. It exceeds friction's interval by the same torque as
    the threshold in motion exceeds its band.
    """
    half = max(b.half_width for b in (calibration.moving, calibration.reversing) if b is not None)
    rests = [(f.upper - f.lower)[f.state == REST] for f in calibration.forces]
    width = float(np.median(np.concatenate([*rests, np.full(1, 2.0 * half)])))
    bands = 1.0 + (motion.bands - 1.0) * 2.0 * half / max(width, 1e-3 * half)
    return replace(
        motion, state="rest", bands=bands, interval=(1.0, bands), peaks=0, hours=0.0, extrapolation=np.inf
    )


def with_contacts(estimate: ForceEstimate, false_alarms: float) -> ForceEstimate:
    """Return an estimate with its contacts.

    Args:
        estimate: with calibrated bands; a joint without a calibration takes no part.
        false_alarms: of all joints together [1/h].

    Raises:
        NotIdentifiable: no joint's free motion supports a threshold.
    """
    known = [j.joint.name for j in estimate.joints if j.joint.name in estimate.calibrations]
    thresholds: dict[str, tuple[Threshold, ...]] = {}
    remarks: list[str] = []
    for name in known:
        try:
            thresholds[name] = thresholds_of(estimate.calibrations[name], false_alarms / len(known))
        except NotIdentifiable as error:
            if len(known) == 1:
                raise
            remarks.append(f"{error} Contacts are not detected on it.")
    if not thresholds:
        raise NotIdentifiable(
            "The free motion of no joint is sufficient for a contact threshold.",
            remedy="Give longer free motion of the same joints (--free).",
        )
    every = tuple(t for of_joint in thresholds.values() for t in of_joint)
    lines = (*estimate.remarks, *remarks, *_support_warnings(every, false_alarms))
    return mark_contacts(replace(estimate, remarks=lines, false_alarms=false_alarms), every)


def mark_contacts(estimate: ForceEstimate, thresholds: Sequence[Threshold]) -> ForceEstimate:
    """Return an estimate with its contacts, from given thresholds; joints without a threshold are left out.

    Args:
        estimate: with the bands that the thresholds belong to.
        thresholds: by joint and state.
    """
    levels: dict[str, dict[str, float]] = {}
    for t in thresholds:
        levels.setdefault(t.joint, {})[t.state] = t.bands
    joints, spans = [], []
    for one in estimate.joints:
        if one.joint.name in levels:
            one, own = _mark(one, np.array([levels[one.joint.name][state] for state in STATES]))
            spans += own
        joints.append(one)
    return replace(estimate, joints=tuple(joints), contacts=_merge(spans), thresholds=tuple(thresholds))


def _mark(one: JointForce, levels: np.ndarray) -> tuple[JointForce, list[tuple[float, float, str, float]]]:
    """Return an estimate with the samples above its thresholds marked; and start, end, joint and largest force of each
    contact.
    """
    z = score(one) / levels[one.state]
    z = np.where(np.isfinite(z), z, 0.0)
    groups: list[list[int]] = []
    for first, last in clusters(z, one.time, 1.0, APART).tolist():
        if groups and one.time[first] - one.time[groups[-1][1] - 1] < ACROSS:
            between = one.state[groups[-1][1] : first]
            if np.all(between == TURNS):  # a hand that keeps pushing while the joint reverses
                groups[-1][1] = last
                continue
        groups.append([first, last])
    spans = []
    for first, last in groups:
        part = slice(first, last)
        peak = first + int(np.argmax(np.where(z[part] > 1.0, np.abs(one.force[part]), -1.0)))
        spans.append(
            (float(one.time[first]), float(one.time[last - 1]), one.joint.name, float(one.force[peak]))
        )
    return replace(one, contact=z > 1.0), spans


def _merge(spans: list[tuple[float, float, str, float]]) -> tuple[Contact, ...]:
    """Return contacts from start, end, joint and largest force; those of several joints at one time are one contact."""
    events: list[Contact] = []
    for begin, end, name, force in sorted(spans):
        if events and begin <= events[-1].end + APART:
            last = events[-1]
            largest = max(last.forces.get(name, 0.0), force, key=abs)
            events[-1] = replace(last, end=max(last.end, end), forces={**last.forces, name: largest})
        else:
            events.append(Contact(begin=begin, end=end, forces={name: force}))
    return tuple(events)


def _is_doubtful(t: Threshold) -> bool:
    """Return whether a threshold is far beyond the free motion, or hardly determined by it."""
    return t.bands > FAR * t.highest or t.interval[1] > VAGUE * t.interval[0]


def _interval(t: Threshold) -> str:
    """Return the interval in words; a threshold may lie above it on purpose."""
    words = f"the level itself is likely between {t.interval[0]:.3g} and {t.interval[1]:.3g}"
    return f"{words}, and the threshold deliberately above" if t.bands > t.interval[1] else words


def _support_warnings(thresholds: Sequence[Threshold], false_alarms: float) -> list[str]:
    """Return warnings on insufficient free motion: one for all joints, and one for states that it does not contain."""
    lines = []
    stretched = [t for t in thresholds if 1.0 < t.extrapolation < np.inf and t.bands > 1.0]
    if stretched:
        worst = max(stretched, key=lambda t: t.extrapolation)
        lines.append(
            f"The free motion is too short for a rate of {false_alarms:g} false alarms per hour, so thresholds are "
            f"extrapolated. The worst is joint '{worst.joint}', {worst.state}: {worst.hours * 60.0:.3g} min, "
            f"{worst.extrapolation:.3g} times too short. Its threshold is {worst.bands:.3g} bands; {_interval(worst)}."
        )
    wide = [t for t in thresholds if t.peaks and t.bands > 1.0 and _is_doubtful(t)]
    if wide:
        told = "; ".join(
            f"'{t.joint}' {t.state}: {t.bands:.3g} bands, highest peak of the free motion {t.highest:.3g}, {_interval(t)}"
            for t in wide
        )
        lines.append(
            f"The free motion hardly determines these thresholds, so contacts may be missed: joint {told}. Record more free "
            f"motion in this state, or allow more --false-alarms."
        )
    absent = [f"'{t.joint}' {t.state}" for t in thresholds if t.extrapolation == np.inf]
    if absent:
        lines.append(
            f"The free motion has too few peaks for a threshold of its own: joint {', '.join(absent)}; taken from the other states."
        )
    return lines
