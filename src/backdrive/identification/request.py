"""What is asked of an identification, checked before it begins: logs that fit together, options that apply."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from backdrive.errors import InvalidInput, UnhealthyLog
from backdrive.logs.log import Log


def in_order(log: Log, first: Log) -> Log:
    """Return a log with its joints in the order of the first log's.

    Raises:
        InvalidInput: it holds other joints, or the same in another unit.
    """
    if set(log.names) != set(first.names):
        raise InvalidInput(
            f"The logs hold different joints: {', '.join(first.names)} and {', '.join(log.names)}.",
            remedy="Identify them one by one, or name the joints alike (--names).",
        )
    log = log if log.names == first.names else log.select(first.names)
    for mine, theirs in zip(log.joints, first.joints):
        if mine.unit != theirs.unit:
            raise InvalidInput(
                f"Joint '{mine.name}' is in {theirs.unit} in one log and in {mine.unit} in another.",
                remedy="Read all of them with the same --unit.",
            )
    return log


def apart(logs: Sequence[Log], held_out: Sequence[Log]) -> None:
    """Refuse to judge on a file that is fitted, and to fit a part of a file twice."""
    fitted: dict[str, str] = {}
    spans: dict[str, list[tuple[float, float]]] = {}
    for log in logs:
        begin, end = (float(log.time[0]), float(log.time[-1])) if len(log) else (0.0, 0.0)
        for source in log.sources:
            if any(begin < e and b < end for b, e in spans.get(source.sha256, [])):
                raise InvalidInput(
                    f"{source.path} and {fitted[source.sha256]} are the same log.",
                    remedy="Name it once; a repetition is no new measurement.",
                )
            fitted[source.sha256] = source.path
            spans.setdefault(source.sha256, []).append((begin, end))
    for log in held_out:
        for source in log.sources:
            if source.sha256 in fitted:
                raise InvalidInput(
                    f"{source.path} is held out and also fitted ({fitted[source.sha256]}).",
                    remedy="Hold out a log that is not fitted; without any, blocks of the fitted ones are held out in turn.",
                )


def planned(logs: Sequence[Log], plan: Any) -> list[Log]:
    """Return the logs with the plan that they were recorded with: one for all, one a log, or None for their own.

    Raises:
        InvalidInput: there are several plans, and not one a log.
    """
    if plan is None:
        return list(logs)
    plans = list(plan) if isinstance(plan, (list, tuple)) else [plan] * len(logs)
    if len(plans) != len(logs):
        raise InvalidInput(
            f"{len(plans)} plans for {len(logs)} logs.",
            remedy="Give one plan for all logs, or one for each in their order.",
        )
    return [log.replace(plan=one) for log, one in zip(logs, plans)]


SLOW = 50.0  # a sampling rate below this makes a result suspect [Hz]


def slow_clock(logs: Sequence[Log]) -> list[str]:
    """Say where the sampling is too slow to differentiate, or the time in another unit."""
    rates = [1.0 / log.period for log in logs if log.period > 0]
    if not rates or min(rates) >= SLOW:
        return []
    return [
        f"A log has {min(rates):.3g} samples a second: below {SLOW:g} Hz only slow motion is trustworthy. If its time is in "
        "milliseconds, read it with --map t=0.001*COLUMN."
    ]


def unused_torque(logs: Sequence[Log], method: str) -> list[str]:
    """Say where a torque known from elsewhere is in the logs and the method does not look at it."""
    if method == "motion" or all(log.model_torque is None for log in logs):
        return []
    return [
        f"The method '{method}' does not use the torque known from elsewhere (tau_model); subtract it from the torque "
        '(--map "tau=COLUMN-MODEL"), or use --method motion.'
    ]


def move_together(logs: Sequence[Log], names: Sequence[str]) -> bool:
    """Say whether joints move at the same time and no torque known from elsewhere takes their pull away."""
    import numpy as np

    together = 0
    for log in logs:
        if len(names) < 2 or log.model_torque is not None or len(log) < 2:
            continue
        part = log.select(names)
        speed = np.abs(np.gradient(part.position, axis=0) if part.position is not None else part.velocity)
        busy = speed > 0.05 * np.nanpercentile(speed, 99, axis=0)
        together += int(np.mean(busy.sum(axis=1) > 1) > 0.2)
    return together > 0


def healthy(log: Log, accept: Sequence[str], repair: bool, warnings: list[str]) -> Log:
    """Pass a log through the health gate; what is suspect joins the warnings, and the error names its file."""
    from backdrive.logs import health

    try:
        mended, suspect = health.passed(log, accept=accept, repair=repair)
        where = f"{log.sources[0].path}: " if log.sources else ""
        warnings += [f"{where}[{f.name}] {f.sentence}" for f in suspect]
        return mended
    except UnhealthyLog as error:
        if not log.sources:
            raise
        raise UnhealthyLog(
            f"{log.sources[0].path}: {error.message}", remedy=error.remedy, **error.data
        ) from error
