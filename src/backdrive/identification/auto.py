"""The choice of the method from the contents of the logs, of the joints that move, and of the logs in which each does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.identification.ramp import is_ramp
from backdrive.identification.runs import LEAST_RUNS, whole_run
from backdrive.identification.sweep_windows import find_windows
from backdrive.logs.log import Log
from backdrive.logs.quantiles import quantile
from backdrive.logs.resolution import channel_noise, channel_step, encoder_step

#: Method -> motion that it needs, in words.
METHODS: dict[str, str] = {
    "sweep": "sine sweeps of Iwatani 2017, chapter 2: one cycle a speed",
    "constant-velocity": "runs at constant velocity, both directions",
    "motion": "any motion of single axes",
    "ramp": "a torque ramp below and through break-away, for presliding",
    "arm": "any motion of a whole arm whose description is given",
    "dynamic": "any motion with reversals, or the input of a drive: a search for any law, presliding included",
}

CYCLES = 4  # least number of cycles of a sweep
IDLE = 0.02  # travel below which a joint is idle, relative to the largest travel of the same unit [-]
FAR = {
    "rad": 2.0 * np.pi,
    "m": 1.0,
}  # a larger travel counts as this one: beside a wheel, an arm's joint is not idle
STEPS, SCATTER = 3.0, 8.0  # largest travel of a still joint [encoder step] and [noise of a sample]


def moving_joints(logs: Sequence[Log], wanted: str | Sequence[str] | None) -> tuple[list[str], list[str]]:
    """Return the names of the joints to identify, and of the joints left out because they hardly move.

    Raises:
        UnknownName: a wanted joint is not in the logs.
        NotIdentifiable: no joint moves.
    """
    if wanted:
        wanted = [wanted] if isinstance(wanted, str) else wanted
        return [logs[0].names[logs[0].column(name)] for name in wanted], []
    travel = np.array([_travel(log) for log in logs]).max(axis=0)
    units = np.array([joint.unit for joint in logs[0].joints])
    moves = np.zeros(travel.size, dtype=bool)
    for unit in np.unique(units):
        same = units == unit
        moves |= same & (travel > IDLE * min(travel[same].max(), FAR[unit])) & (travel > 0)
    if not moves.any():
        raise NotIdentifiable("No joint of this log moves.", remedy="Record the joint while it moves.")
    names = logs[0].names
    return [n for n, m in zip(names, moves, strict=True) if m], [
        n for n, m in zip(names, moves, strict=True) if not m
    ]


def in_motion(logs: Sequence[Log], joint: str) -> list[Log]:
    """Return the logs but those in which a joint stands still while it moves in others, as where joints move in turn.

    A joint that stands still shows the steps and the noise of its encoder as motion.
    """
    if len(logs) < 2:
        return list(logs)
    travel = [float(_travel(log.select(joint))[0]) for log in logs]
    most = IDLE * max(travel)
    moves = [log for log, way in zip(logs, travel, strict=True) if way > most or way > _flicker(log, joint)]
    return moves or list(logs)


def standing(logs: Sequence[Log], joints: Sequence[str]) -> list[str]:
    """Return a sentence on each joint that stands still in some logs, see `in_motion`."""
    count = {joint: len(logs) - len(in_motion(logs, joint)) for joint in joints}
    return [
        f"Joint '{joint}' stands still in {n} of {len(logs)} logs, which do not count for it."
        for joint, n in count.items()
        if n
    ]


def _flicker(log: Log, joint: str) -> float:
    """Return the largest travel of a joint that stands still [rad or m]."""
    column = log.column(joint)
    channel, scale = ("position", 1.0) if log.position is not None else ("velocity", log.duration)
    step = encoder_step(log, joint) if channel == "position" else channel_step(log, channel, column)
    return scale * max(STEPS * step, SCATTER * channel_noise(log, channel, column))


def _travel(log: Log) -> np.ndarray:
    """Return the travel of each joint, without single outliers [rad or m], (J,)."""
    if log.position is not None:
        return np.array([quantile(x, 0.995) - quantile(x, 0.005) for x in map(_without_nan, log.position.T)])
    columns = map(_without_nan, np.abs(log.need("velocity")).T)
    return np.array([quantile(x, 0.99) for x in columns]) * log.duration


def _without_nan(x: np.ndarray) -> np.ndarray:
    """Return the values of a series (n,) that are not NaN."""
    lost = np.isnan(x)
    return x[~lost] if lost.any() else x


def own_turn(log: Log, joint: str) -> Log:
    """Return a log with the plan of one joint; if the joints move one after another, the log is cut to this joint's motion."""
    if log.plan is not None and log.plan.kind == "arm" and joint in getattr(log.plan, "joints", ()):
        return log.replace(plan=log.plan.plan_of(joint))
    if log.plan is None or log.plan.kind != "in-turn" or joint not in [p.joint for p in log.plan.plans]:
        return log
    plan = log.plan.plan_of(joint)
    own = log.select(joint)
    speed = np.abs(own.need("velocity") if own.position is None else np.gradient(own.position, axis=0))[:, 0]
    moving = np.flatnonzero(speed > 0.05 * np.nanpercentile(speed, 99.5))
    if not moving.size:
        return log.replace(plan=plan)
    begin, end = (float(log.time[moving[i]]) for i in (0, -1))
    middle = (
        0.5 * (begin + end) - 0.5 * plan.duration
    )  # start of the plan if its middle is the middle of the motion
    part = log.between(min(begin, middle) - 0.5, max(end, middle + plan.duration) + 0.5)
    return part.replace(plan=replace(plan, start=middle))


def choose_method(logs: Sequence[Log], joints: Sequence[str], urdf: str | None) -> tuple[str, str]:
    """Return the method that suits the logs, and the reason.

    Args:
        logs: of the same joints.
        joints: names of the joints that move.
        urdf: path of a robot description, if there is one.
    """
    if urdf is not None:
        return "arm", "a robot description was given"
    turns = [own_turn(log, joint).plan.kind for log in logs if log.plan is not None for joint in joints]
    kinds = list(dict.fromkeys(turns))
    if len(kinds) > 1:
        raise InvalidInput(
            f"The plan moves the joints in different ways ({', '.join(kinds)}).",
            remedy="Identify them one by one with --joint.",
        )
    for kind in kinds:
        if kind in ("sweep", "constant-velocity", "ramp"):
            return kind, f"the logs are linked to a plan of the kind '{kind}'"
    for log in logs:
        log.need("torque")
    of_joint = {joint: in_motion(logs, joint) for joint in joints}
    pairs = [(log, joint) for joint, own in of_joint.items() for log in own]
    many = min(map(len, of_joint.values())) >= LEAST_RUNS
    if many and all(whole_run(log, joint) for log, joint in pairs):
        return "constant-velocity", "every log keeps one velocity throughout"
    if all(is_ramp(log, joint) for log, joint in pairs):
        return "ramp", "the torque ramps in straight lines until the joint begins to slip"
    if all(_sweeps(log, joint) for log, joint in pairs):
        return "sweep", "cycles of growing frequency and equal stroke were found"
    return "motion", "the logs hold motion of no special kind"


def _sweeps(log: Log, joint: str) -> bool:
    if log.position is None:
        return False
    try:
        return len(find_windows(log, joint, CYCLES)) >= CYCLES
    except (NotIdentifiable, InvalidInput):
        return False
