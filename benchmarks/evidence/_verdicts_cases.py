"""One log of `verdicts`: planted, identified beside its clean twin, and what was said."""

from __future__ import annotations

import re
from typing import Any, NamedTuple

import numpy as np
from _coverage_cells import to_log
from _independent import Joint, Record
from _verdicts_kinds import HIDDEN, KINDS, RIGHT, Kind
from _verdicts_scenes import MOTIONS, Scene, scene, softer, tell

from backdrive import check, identify
from backdrive.errors import BackdriveError
from backdrive.identification.quality import grade

ERRORS, SHARE, REPAIR_SHARE = 3.0, 0.05, 0.02  # stated errors; of the friction
RATES = (200.0, 500.0, 1000.0)
TOLD, DRAWS, APART = (
    6.0,
    10,
    10**7,
)  # noncentrality, draws until it is reached, and how far their seeds lie apart
PROBES = np.array([0.3, 0.6, 0.9])  # shares of the top speed at which laws are compared


class Answer(NamedTuple):
    """What one identification says.

    Attributes:
        level: of the grade; `refused` where it ended with an error.
        remarks: its warnings without numbers.
        off: largest error of Coulomb or viscous by the friction [-].
        sure: the same in stated errors [-].
        why: grade or error in words.
        text: that stands beside the curve.
    """

    level: str
    remarks: frozenset[str]
    off: float
    sure: float
    why: str
    text: str = ""


class Outcome(NamedTuple):
    """What became of one log; see `verdicts`."""

    table: str
    kind: int
    level: float
    motion: int
    refused: bool
    graded: bool
    remarked: bool
    remarks: int
    moved: bool
    told: float
    repaired: str
    away: bool
    why: str

    @property
    def caught(self) -> bool:
        """Whether the trouble did not pass for good."""
        return self.refused or self.graded or self.remarked


def draw(about: Kind, seed: int) -> tuple[int, Scene]:
    """Return motion and clean scene of the first of some seeds in which the required size shows in the residual."""
    motion = MOTIONS.index(about.motions[seed % len(about.motions)])
    rate = about.rate or RATES[seed // len(MOTIONS) % 3]
    clean = scene(seed, MOTIONS[motion], rate=rate, gravity=about.gravity)
    for again in range(1, DRAWS if about.shows and about in KINDS else 1):
        if tell(about.plant(clean, about.size), clean.logs()) >= TOLD:
            break
        clean = scene(seed + again * APART, MOTIONS[motion], rate=rate, gravity=about.gravity)
    return motion, clean


def outcome(table: str, kind: int, seed: int, level: float = 0.0) -> Outcome:
    """Return what becomes of the log of a seed, with trouble of the required size, or smaller by a level; see `Kind.at`."""
    about: Kind | None = {"kind": KINDS, "right": RIGHT, "hidden": HIDDEN}.get(table, (None,))[kind]
    if about is None:
        motion = seed % len(MOTIONS)
        clean = softer(scene(seed, MOTIONS[motion]))
        twin = planted = clean.logs()
        said = base = answer(planted, clean.joint, {})
    else:
        motion, clean = draw(about, seed)
        twin = clean.logs() if about.none is None else about.plant(clean, about.none)
        planted = about.plant(clean, about.at(level))
        options = about.options | ({"plan": about.plan(clean)} if about.plan else {})
        said = answer(planted, planted[0].joint, options)
        base = answer(twin, twin[0].joint, {} if about.none is None else options)
    joint = planted[0].joint
    repaired, away = _repaired(planted, joint, said, base)
    own = said.remarks - base.remarks
    return Outcome(
        table=table,
        kind=kind,
        level=level,
        motion=motion,
        refused=said.level == "refused",
        graded=said.level not in ("good", "refused", *(() if base is said else (base.level,))),
        remarked=bool(own) or bool(about and about.says and about.says in said.text),
        remarks=len(said.remarks),
        moved=said.off > SHARE and said.sure > ERRORS,
        told=tell(planted, twin) if about else 0.0,
        repaired=repaired,
        away=away,
        why=said.why,
    )


def answer(records: list[Record], joint: Joint, options: dict[str, Any], repair: bool = False) -> Answer:
    """Return what an identification says of logs."""
    try:
        result = identify([to_log(made) for made in records], repair=repair, **options)
    except BackdriveError as error:
        return Answer("refused", frozenset(), 0.0, 0.0, f"{type(error).__name__}: {_plain(str(error))[:160]}")
    friction = result.model.joints[0]
    said = grade(friction)
    sentences = [*result.warnings, *friction.warnings]
    off, sure = _error(result, joint)
    word = f"{said.word}; {' '.join(map(_plain, sentences))[:120]}"
    text = result.evidence[0].verdict
    return Answer(said.level, frozenset(map(_plain, sentences)), off, sure, f"{result.method}: {word}", text)


def _plain(sentence: str) -> str:
    return re.sub(r"[-+\d.e]+(?=[\s,;:%)]|$)", "N", sentence)


def _error(result: Any, joint: Joint) -> tuple[float, float]:
    """Return the largest error of the Coulomb and the viscous part, by the friction and by the stated error.

    Both are those of the straight line through the mean of both directions at three speeds; at rest where the law states it.
    """
    friction = result.model.joints[0]
    top = min(abs(v) for v in friction.validity.velocity) or max(abs(v) for v in friction.validity.velocity)
    speeds = top * PROBES
    both = np.concatenate([speeds, -speeds])
    band = result.evidence[0].curve
    order = np.argsort(band.velocity)
    stated = np.interp(both, band.velocity[order], band.standard_error[order])
    size = float(np.mean(np.abs(joint.sliding(both))))
    line = np.linalg.pinv(np.stack([np.ones(3), speeds], axis=1))
    wrong = friction.law.torque(both) - joint.sliding(both)
    parts = line @ (0.5 * (wrong[:3] - wrong[3:]))
    errors = np.sqrt((line**2) @ (0.25 * (stated[:3] ** 2 + stated[3:] ** 2)))
    off, error = np.abs(parts * (1.0, top)), np.maximum(errors * (1.0, top), 1e-12)
    if joint.peak > 0.0:  # what is stated at rest is wrong where no speed shows it
        rest = abs(float(friction.law.torque(np.array([1e-9]))[0]) - joint.coulomb - joint.peak)
        at_rest = float(np.interp(1e-9, band.velocity[order], band.standard_error[order]))
        off, error = np.append(off, rest), np.append(error, max(at_rest, 1e-12))
    worst = int(np.argmax(np.where(off > SHARE * size, off / error, 0.0)))
    return float(off[worst]) / size, float(off[worst] / error[worst])


def _repaired(records: list[Record], joint: Joint, said: Answer, base: Answer) -> tuple[str, bool]:
    """Return which repairs are offered, and whether they lead away from the truth, given what is said of logs and of their twin."""
    offered = sorted({f.name for made in records for f in check(to_log(made)) if f.repairable})
    if not offered:
        return "", False
    mended = answer(records, joint, {}, repair=True)
    if mended.level == "refused":
        return " ".join(offered), said.level != "refused"
    farther = mended.off > said.off + REPAIR_SHARE and mended.sure > ERRORS and said.level != "refused"
    wrong = mended.off > SHARE and mended.sure > ERRORS and mended.level == "good" and said.level == "refused"
    wrong = wrong and mended.off > base.off + REPAIR_SHARE  # what noise does to the twin, no repair has done
    return " ".join(offered), bool(farther or wrong)
