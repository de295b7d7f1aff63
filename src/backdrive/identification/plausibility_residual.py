"""Plausibility rules on the torque residual, and on the recording of torque, position and time."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from backdrive.identification import lateness
from backdrive.identification.design import LARGEST_SLIP
from backdrive.identification.plausibility_logs import other_joints
from backdrive.identification.remark import Case, Remark
from backdrive.identification.residual import MEAN, Explanation, Residual
from backdrive.identification.terms import GRAVITY, columns
from backdrive.logs import filters

CHANCE = 1e-5  # noise explains a residual so well once in so many times [-]
STRUCTURE = 0.015  # share of the friction: an explained part of the residual above this gets a remark [-]
GRAVE = 0.25  # share of the friction: above this a remark lowers the grade [-]
MOST = 1.5  # share of the friction: above this, the cause is not structure but terms that the motion does not separate [-]
LEFT = 0.1  # of the friction: so much slow torque may be left [-]
LATE = 0.015  # torque that comes so much later than motion is remarked on [s]
WORTH = 0.96  # and the residual falls to less than this by it [-]
WILD = 3e-3  # share of samples that are far off [-]
COARSE = 0.25  # of the friction: a step of the torque's readings [-]
FEW_STEPS = 0.3  # of the way in a mean at top speed: a step of the encoder [-]
SLOWEST = 5.0  # sampling rate below which time is not in seconds [Hz]


def clock(case: Case) -> Remark | None:
    """Time in another unit than seconds."""
    if case.residual is None or not case.residual.period > 1.0 / SLOWEST:
        return None
    rate = 1.0 / case.residual.period
    return Remark(
        severity="care",
        sentence=f"The log has {rate:.3g} samples a second, and still the motion is smooth: its time is probably in "
        "another unit than seconds (--map t=0.001*COLUMN for milliseconds).",
    )


def delay(case: Case) -> Remark | None:
    """Torque that comes late, by the shift at which a line explains it best."""
    if (res := case.residual) is None:
        return None
    growing = (
        case.friction.law.growth is not None
    )  # friction over load looks like a delay to a curve of the velocity alone
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
    known = max(
        (abs(case.value(term)[0]) for term in ("delay", "time_slip") if term in case.friction.dynamics),
        default=0.0,
    )
    told = abs(known - abs(found[0])) < 0.3 * abs(found[0])
    if told and known >= LARGEST_SLIP:
        return None  # `delay_range` says so with its error
    way = "later" if found[0] > 0.0 else "earlier"
    return Remark(
        severity="note" if told or not sure else "care",
        sentence=f"Torque comes about {1e3 * abs(found[0]):.0f} ms {way} than motion"
        + ("." if sure else ", or friction builds up over a distance: the motion does not tell which."),
    )


def torque_steps(case: Case) -> Remark | None:
    """Torque in steps."""
    if case.residual is None or not case.residual.step > COARSE * case.residual.size:
        return None
    return Remark(
        severity="note",
        sentence=f"Torque is read in steps of {case.residual.step:.3g} {case.unit}, "
        f"{100.0 * case.residual.step / case.residual.size:.0f} % "
        "of the friction.",
    )


def encoder_steps(case: Case) -> Remark | None:
    """Positions in steps."""
    top = max(abs(v) for v in case.friction.validity.velocity)
    if not case.count > FEW_STEPS * top * MEAN:
        return None
    return Remark(
        severity="note",
        sentence=f"The encoder's step of {case.count:.3g} {case.friction.joint.unit} lasts {1e3 * case.count / top:.2g} ms even at "
        "top speed: velocity and acceleration are coarse. Read a finer encoder, or move faster.",
    )


def wild_samples(case: Case) -> Remark | None:
    """Single samples far off."""
    if case.residual is None or not case.residual.wild > WILD:
        return None
    return Remark(
        severity="note",
        sentence=f"{100.0 * case.residual.wild:.2g} % of the torque's samples in motion are far off their neighbours.",
    )


def structure(case: Case) -> Remark | None:
    """The variable that explains most of the residual: time, load or position; or a remark on a large unexplained residual."""
    if case.residual is None or not case.residual.size > 0.0:
        return None
    res = case.residual.slides
    way, size = np.sign(res.velocity), case.residual.size
    load = np.abs(res.torque - res.friction)
    share, wave = "{share:.0f} % of the friction", "every {wave:.2g} " + case.friction.joint.unit
    follows_load = f"Friction depends on the load, by {share}: use a law with load (--law m3)."
    tests: list[tuple[Explanation | None, str]] = []
    for time in _times(res):
        late = np.sign(time)
        tests += [
            (
                res.explain(time, late),
                f"The torque drifts over the log, by {share}: warming, a bias, or a cable.",
            ),
            (
                res.explain(way * time, way * late),
                f"Friction changes over the log, by {share}: warming, or changed midway.",
            ),
            (
                res.explain(res.predicted * late),
                f"The torque changed midway, by {share}: its gain, or its sign.",
            ),
        ]
    of_torque, of_friction = res.waves(np.ones_like(way), way)
    tests += [
        (res.explain(way * load), follows_load),
        (res.explain(way * _static_load(case, res)), follows_load),
        (of_torque, f"Torque follows the position {wave}, by {share}: cogging, or a gear's ripple."),
        (of_friction, f"Friction follows the position {wave}, by {share}."),
    ]
    if (
        float(np.sqrt(np.mean(res.torque_error**2))) > STRUCTURE * size
    ):  # the motion of other joints is costly to look up
        for motion, cause in other_joints(case):
            pull = res.explain(*motion.T)
            if (
                pull is not None
            ):  # the part that this joint's own motion explains does not count as a coupling torque
                tests.append(
                    (replace(pull, size=pull.beyond), f"Torque follows {cause}, by {share}: its pull.")
                )
    sure = [
        (e, sentence)
        for e, sentence in tests
        if e is not None and e.chance < CHANCE and STRUCTURE * size < e.size < MOST * size
    ]
    if not sure:
        return slow_torque(case)
    best, sentence = max(sure, key=lambda pair: pair[0].beyond)
    named = sentence.format(
        share=100.0 * best.size / size, wave=2.0 * np.pi / best.wave if best.wave else 0.0
    )
    return Remark(severity="care" if best.size > GRAVE * size else "note", sentence=named)


def _times(res: Residual) -> list[np.ndarray]:
    """Return the order of the means from -0.5 to 0.5, over all and, where there are several stretches, within each, (n,) each."""
    lengths = np.bincount(res.part)
    lengths = lengths[lengths > 0]
    every = [[res.time.size]] if lengths.size == 1 else [[res.time.size], lengths.tolist()]
    return [np.concatenate([np.linspace(-0.5, 0.5, n) for n in some]) for some in every]


def _static_load(case: Case, res: Residual) -> np.ndarray:
    """Return the size of what the joint holds without moving, gravity and torque known from elsewhere [N.m or N], (n,)."""
    share, angle = case.value("model_torque")[0], np.isfinite(res.position).all()
    held = np.zeros_like(res.torque) if not math.isfinite(share) else share * res.known
    if angle:
        held = held + np.nan_to_num([case.value(term)[0] for term in GRAVITY]) @ columns(res, GRAVITY)
    return np.abs(held)


def slow_torque(case: Case) -> Remark | None:
    """Slow torque without a cause that is known."""
    if case.residual is None or not case.residual.size > 0.0:
        return None
    res = case.residual.slides
    width = max(round(0.1 / res.period), 1)
    n = res.time.size // width
    if n < 10:
        return None
    slow = float(np.sqrt(np.mean(filters.means(res.torque_error, width) ** 2)))
    if slow <= LEFT * res.size:
        return None
    return Remark(
        severity="note",
        sentence=f"{slow:.3g} {case.unit} of slow torque remains in motion, {100.0 * slow / res.size:.0f} % of the friction: "
        f"the model lacks a torque.",
    )
