"""The logs of an identification: put in order, given their plans, and checked before any long computation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.identification.alignment import Start, with_plan
from backdrive.identification.auto import in_motion
from backdrive.logs.log import Log

SLOW = 50.0  # sampling rate below which a result is suspect [Hz]
SLOWEST = 5.0  # sampling rate below which the time is probably not in seconds [Hz]


def moments_without_drive(logs: Sequence[Log]) -> list[str]:
    """Return sentences on logs in which the drive was off at times, which a fit given the drive's input does not account for."""
    return [
        f"{note} A fit takes the drive to be on throughout: cut those stretches out."
        for log in logs
        for note in log.notes
        if "torque_enable" in note and "off" in note
    ]


def in_order(log: Log, first: Log) -> Log:
    """Return a log with its joints in the order of the first log's.

    Raises:
        InvalidInput: its joints or their units differ.
    """
    if set(log.names) != set(first.names):
        raise InvalidInput(
            f"The logs hold different joints: {', '.join(first.names)} and {', '.join(log.names)}.",
            remedy="Identify them one by one, or name the joints alike (--names).",
        )
    log = log if log.names == first.names else log.select(first.names)
    for mine, theirs in zip(log.joints, first.joints, strict=False):
        if mine.unit != theirs.unit:
            raise InvalidInput(
                f"Joint '{mine.name}' is in {theirs.unit} in one log and in {mine.unit} in another.",
                remedy="Read all of them with the same --unit.",
            )
    return log


def coupling_of(logs: Sequence[Log], names: Sequence[str]) -> dict[str, Any]:
    """Return the model's entry for the coupling matrix that converted all logs from motors to joints; empty without one.

    Joints that are not identified keep their rows, since a conversion back to the motors needs the whole matrix.

    Args:
        logs: of the same joints.
        names: of the identified joints.

    Raises:
        InvalidInput: the coupling matrices of the logs differ.
    """
    matrices = {log.coupling for log in logs}
    if len(matrices) > 1:
        raise InvalidInput(
            "The logs are of differently coupled motors.", remedy="Read all of them with the same --coupling."
        )
    if matrices == {None}:
        return {}
    rows = (*names, *(name for name in logs[0].names if name not in names))
    return {
        "coupling": logs[0].select(rows).coupling,
        "coupled": rows if len(rows) > len(names) else (),
    }


def apart(logs: Sequence[Log], held_out: Sequence[Log]) -> None:
    """Refuse a held-out file that is also fitted, and a file that is fitted twice, except files joined to several logs."""
    fitted: dict[str, str] = {}
    spans: dict[str, list[tuple[float, float]]] = {}
    for log in logs:
        begin, end = (float(log.time[0]), float(log.time[-1])) if len(log) else (0.0, 0.0)
        for source in log.sources[:1]:
            if any(begin < e and b < end for b, e in spans.get(source.sha256, [])):
                raise InvalidInput(
                    f"{source.path} and {fitted[source.sha256]} are the same log.",
                    remedy="Name it once: a copy of a log adds no information.",
                )
            fitted[source.sha256] = source.path
            spans.setdefault(source.sha256, []).append((begin, end))
    for log in held_out:
        for source in log.sources[:1]:
            if source.sha256 in fitted:
                raise InvalidInput(
                    f"{source.path} is held out and also fitted ({fitted[source.sha256]}).",
                    remedy="Hold out a log that is not fitted; without any, blocks of the fitted ones are held out in turn.",
                )


def attach_plan(logs: Sequence[Log], plan: Any, start: Start | None = None) -> list[Log]:
    """Return the logs with their plans: one for all, one per log, or None for their own.

    `start` is the start of the plan in each log; see `alignment.with_plan`.

    Raises:
        InvalidInput: the number of several plans differs from that of the logs.
    """
    if plan is None and start is None:
        return list(logs)
    plans = list(plan) if isinstance(plan, (list, tuple)) else [plan] * len(logs)
    if plan is None:
        plans = [log.plan for log in logs]
    if len(plans) != len(logs):
        raise InvalidInput(
            f"{len(plans)} plans for {len(logs)} logs.",
            remedy="Give one plan for all logs, or one for each in their order.",
        )
    for one in plans:
        if one is not None and not hasattr(one, "kind"):
            raise InvalidInput(
                f"plan is {one!r:.40}.",
                remedy="Give an object of `backdrive.plans`; `load_plan` reads a file.",
            )
    if start is not None:
        return [with_plan(log, one, start) for log, one in zip(logs, plans, strict=False)]
    return [log.replace(plan=one) for log, one in zip(logs, plans, strict=False)]


def slow_clock(logs: Sequence[Log]) -> list[str]:
    """Return sentences on logs whose sampling is too slow for differentiation, or whose time has another unit."""
    rates = [1.0 / log.period for log in logs if log.period > 0]
    if not rates or min(rates) >= SLOW:
        return []
    return [
        clock_unit(min(rates))
        or f"A log has {min(rates):.3g} samples a second: below {SLOW:g} Hz only slow motion is trustworthy. If its time is in "
        "milliseconds, read it with --map t=0.001*COLUMN."
    ]


def clock_unit(rate: float) -> str:
    """Return a sentence on a sampling rate [Hz] that a smooth motion hardly has; empty where it may have it."""
    if not rate < SLOWEST:
        return ""
    unit, factor = ("milliseconds", "0.001") if rate > 1e-3 * SLOWEST else ("microseconds", "1e-6")
    unit, factor = (unit, factor) if rate > 1e-6 * SLOWEST else ("nanoseconds", "1e-9")
    return (
        f"The log has {rate:.3g} samples a second, and still the motion is smooth: its time is probably in another unit than "
        f"seconds (--map t={factor}*COLUMN for {unit})."
    )


def external_torque_notes(logs: Sequence[Log], method: str, driven: bool = False) -> list[str]:
    """Return sentences on known torques in the logs that the method does not use.

    Args:
        logs: of the identification.
        method: of it.
        driven: motion is fitted given the drive's input, rather than torque given motion.
    """
    if (
        method == "motion"
        or (method == "dynamic" and not driven)
        or all(log.model_torque is None for log in logs)
    ):
        return []
    return [
        f"The method '{method}' does not use the torque known from elsewhere (tau_model); subtract it from the torque "
        '(--map "tau=COLUMN-MODEL"), or use --method motion.'
    ]


TOGETHER = (
    "Several joints move at once and exert torques on each other, which the single-axis model does not contain. Pass the robot's "
    "description (--urdf), or torques known from elsewhere (--map tau_model=...)."
)


def move_together(logs: Sequence[Log], names: Sequence[str]) -> bool:
    """Return whether joints move at the same time and the logs hold no model torque of their coupling."""
    together, own = 0, {name: in_motion(logs, name) for name in names} if len(names) > 1 else {}
    for log in logs:
        moving = [name for name, some in own.items() if any(log is one for one in some)]
        if len(moving) < 2 or log.model_torque is not None or len(log) < 2:
            continue
        part = log.select(moving)
        speed = np.abs(part.need("velocity") if part.position is None else np.gradient(part.position, axis=0))
        busy = speed > 0.05 * np.nanpercentile(speed, 99, axis=0)
        together += int(np.mean(busy.sum(axis=1) > 1) > 0.2)
    return together > 0
