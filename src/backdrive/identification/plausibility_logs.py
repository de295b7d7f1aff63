"""Plausibility rules on data other than a joint's own channels: the plan of the motion, a known delay, and other joints."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress

import numpy as np

from backdrive.errors import BackdriveError
from backdrive.identification.alignment import ALIKE, OFF, closest_lag, is_of_joint, likeness, tempo
from backdrive.identification.auto import own_turn
from backdrive.identification.delay import correction
from backdrive.identification.motion import identify_motion
from backdrive.identification.remark import Case, Remark
from backdrive.identification.residual import Residual
from backdrive.identification.reversal_lag import turning_lag
from backdrive.identification.user_delay import contradiction
from backdrive.logs import health
from backdrive.logs.log import DOUBTED, Log

OF_A_MEAN = 0.25  # standard error of a delay that reversals tell [length of a mean]
ANOTHER_UNIT = 1.5  # ratio of the strokes of motion and plan, or its inverse, that indicates another unit [-]
SCALED = 0.1  # relative deviation of the stroke from the plan above which there is a remark [-]
FLAT = 0.03  # least share of samples at an extreme of the torque with a remark [-]
APART = 0.05  # least relative difference of velocity and change of position with a remark [-]


def unit_by_name(case: Case) -> Remark | None:
    """Remark on a column that was taken as SI against what its name says."""
    doubted = (note for log in case.logs for note in log.notes if any(words in note for words in DOUBTED))
    notes = " ".join(dict.fromkeys(doubted))
    if not notes:
        return None
    return Remark(
        severity="care",
        sentence=f"{notes} All numbers may be in another unit than stated. Give the factor to SI (--map), or 1* where the name "
        "means something else.",
    )


def plan(case: Case) -> Remark | None:
    """Remark on a motion that is not that of the log's plan, or whose start, duration or stroke differs from it."""
    name = case.friction.joint.name
    for log in case.logs:
        part = own_turn(log, name)
        if part.plan is None or not is_of_joint(part, name):
            continue
        ran = tempo(part, name, part.plan)
        placed = part.plan is log.plan and log.plan.start != 0.0
        sentence = _apart(part, name, ran is None) if ran is None or placed else None
        if sentence is not None:
            return Remark(severity="note", sentence=sentence)
        if ran is None:
            continue
        if abs(ran.duration - 1.0) > OFF:
            return Remark(
                severity="note",
                sentence=f"By the log's clock the motion took {ran.duration:.3f} times as long as its plan: either the plan was "
                "run at another speed, or the clock is wrong, and all velocities with it.",
            )
        if abs(ran.stroke - 1.0) > SCALED:
            unit = ran.stroke < 0.0 or max(ran.stroke, 1.0 / ran.stroke) > ANOTHER_UNIT
            return Remark(
                severity="care" if unit else "note",
                sentence=f"Strokes are {ran.stroke:.3g} times those of the plan: positions have another unit or sign, or the "
                "plan was scaled.",
            )
    return None


def _apart(log: Log, joint: str, whole: bool) -> str | None:
    """Return a sentence on a joint that did not run its plan, or not at the start that the plan has; None if it did.

    Args:
        log: linked to the plan of the joint.
        joint: its name.
        whole: also say that it did not run it at all.
    """
    if getattr(log.plan, "commands", "") != "position" or not log.period > 0.0:
        return None
    lag, alike, _ = closest_lag(log.select(joint), log.plan)
    if not alike >= ALIKE:
        return (
            f"The joint did not move as planned: measured and planned velocity correlate by {max(alike, 0.0):.2f} at most. "
            "Another plan was run, or this is not its joint."
            if whole
            else None
        )
    start = log.plan.start - float(log.time[0])
    if not start or (stated := likeness(log, joint, log.plan)) >= ALIKE * alike:
        return None
    return (
        f"The plan began {lag:.2f} s after the first sample by the motion (correlation {alike:.2f}), not {start:.4g} s after it "
        f"(correlation {stated:.2f}): --start {lag:.2f}, or auto."
    )


def flat_torque(case: Case) -> Remark | None:
    """Remark on a torque that is flat at its extreme for a part of a log."""
    name = case.friction.joint.name
    for log in case.logs:
        if log.torque is None:
            continue
        torque = log.torque[:, log.column(name)]
        share = max(float(np.mean(torque == end)) for end in (np.nanmax(torque), np.nanmin(torque)))
        found = _findings(log, name, "saturation") if share > FLAT else []
        if found:
            return Remark(
                severity="care",
                sentence=f"Torque is flat at {found[0].value:.3g} {case.unit} for {100.0 * share:.3g} % of a log: if the sensor or "
                "the command is at its limit there, the result is wrong. Move slower, or leave those samples out.",
            )
    return None


def velocity_scale(case: Case) -> Remark | None:
    """Remark on a velocity that differs from the change of the position by a factor."""
    name = case.friction.joint.name
    for log in case.logs:
        if log.position is None or log.velocity is None:
            continue
        q, v = log.position[:, log.column(name)], log.velocity[:, log.column(name)]
        moved = 0.5 * (v[1:] + v[:-1]) * np.diff(log.time)
        counts = np.isfinite(moved) & np.isfinite(np.diff(q))
        ratio = float(np.diff(q)[counts] @ moved[counts]) / max(float(moved[counts] @ moved[counts]), 1e-300)
        found = _findings(log, name, "velocity-mismatch") if abs(ratio - 1.0) > 0.5 * APART else []
        scales = [f.value for f in found if f.severity == "warn" and f.quantity == "scale"]
        if scales and abs(scales[0] - 1.0) > APART:
            return Remark(
                severity="care",
                sentence=f"Velocity and the change of the position differ by a factor of {scales[0]:.3g}: the clock, or the scale "
                "of one of them, is wrong, and with it viscous friction, inertia or all angles.",
            )
    return None


def _findings(log: Log, joint: str, kind: str) -> list[health.Finding]:
    """Return the findings of one check on one joint of a log."""
    return [found for found in health.check(log.select(joint)) if found.name == kind]


def siblings(case: Case) -> Remark | None:
    """Remark on a log that contradicts its prior."""
    prior = case.friction.prior
    if prior is None or prior.applied:
        return None
    each = ", ".join(f"{n.name} {n.log:.4g} instead of {n.prior:.4g} {n.unit}" for n in prior.numbers[:4])
    return Remark(
        severity="note",
        sentence=f"The joint is unlike its siblings, or its former self ({prior.source}): {each}, p = {prior.p:.2g}. The prior "
        "was not used.",
    )


def other_joints(case: Case) -> Iterator[tuple[Residual, list[tuple[np.ndarray, str]]]]:
    """Yield the means in which this joint slides and another's motion is known, with groups of rows of that, (k, n), and names."""
    res = case.residual
    if res is None or case.others is None:
        return
    for about, known, series in case.others.beside(res.slides, case.friction.joint.name):
        position, velocity, acceleration = series
        groups = [
            (acceleration[None], f"the acceleration of joint '{about.name}'"),
            (np.stack([velocity, np.sign(velocity)]), f"the velocity of joint '{about.name}'"),
        ]
        if about.unit == "rad":
            angle = np.stack([np.sin(position), np.cos(position)])
            groups.append((angle, f"the position of joint '{about.name}'"))
        yield known, groups


def user_delay(case: Case) -> Remark | None:
    """Remark on a known delay that the motion contradicts."""
    if case.known_delay is None or case.friction.method == "arm" or not case.logs:
        return None
    shows = _apparent(case.logs, case.friction.joint.name)
    sentence = contradiction(case.known_delay, shows, case.logs[0].period)
    return Remark(severity="care", sentence=sentence) if sentence else None


def _apparent(logs: Sequence[Log], joint: str) -> tuple[float, float]:
    """Return the delay that the motion of a single axis shows, and its standard error [s]; NaN if it shows none."""
    with suppress(BackdriveError):
        friction, evidence = identify_motion(logs, joint)
        if (res := evidence.residual) is not None and (lag := turning_lag(res)):
            return correction(friction.delay) + lag, OF_A_MEAN * res.period
        if (slip := friction.dynamics.get("time_slip")) is not None:
            return slip.value, slip.standard_error
    return float("nan"), float("nan")
