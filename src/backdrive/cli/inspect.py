"""`backdrive inspect`: the contents of a log and its faults."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import typer

from backdrive._catalog import lookup
from backdrive.cli import _logs
from backdrive.cli._output import console as new_console
from backdrive.cli._output import echo, print_json, print_lines, table
from backdrive.cli._progress import progress

if TYPE_CHECKING:
    from backdrive.logs.health import Finding
    from backdrive.logs.log import Log

BARS = "▁▂▃▄▅▆▇█"
PLAIN = "_.-~=+*#"
WIDTH = 32  # characters of a small plot
SMOOTH = 0.05  # largest change from sample to sample of a smooth motion [standard deviation]
FEWEST = 100  # least number of samples of one
LEFT_ALONE = "Leave it: the repair does not help this log, and --repair undoes it."
MOST = 12  # up to so many logs are shown in full; of more, only the faults


@_logs.with_reading
def command(
    logs: _logs.Logs,
    reading: _logs.Reading = _logs.USUAL,
    joint: _logs.Joints = None,
    plan: _logs.PlanFile = None,
    start: _logs.Start = None,
    accept: _logs.Accept = None,
    repair: _logs.Repair = False,
    as_json: _logs.AsJson = False,
) -> None:
    """Show a log's joints, channels, units, rate, gaps, ranges and faults. The exit code is 1 if a fault would spoil the
    result.

    Example: backdrive inspect log.csv
    """
    from backdrive.identification.repairs import apply_repairs
    from backdrive.logs.health import CHECKS, check

    accepted = {lookup(n, {c.name: c.name for c in CHECKS}, "health check") for n in accept or []}
    linked, begin = _logs.plan_from(plan), _logs.start_from(start)
    with progress(quiet=as_json) as say:
        say("Reading")
        read = reading.read(logs)
        read = [(log.select(joint) if joint else log).replace(plan=linked or log.plan) for log in read]
        if begin is not None:
            from backdrive.identification.alignment import with_plan

            read = [with_plan(log, log.plan, begin) for log in read]
        say("Checking")
        undone: list[dict[str, str]] = [{} for _ in read]
        if repair:
            read, undone = (
                list(each)
                for each in zip(*(apply_repairs(log, list(accepted)) for log in read), strict=False)
            )
        findings = [check(log) for log in read]
        repairs = [list(left.values()) for left in undone]
        for i, (log, found) in enumerate(zip(read, findings, strict=True)):
            if not repair and any(f.repairable for f in found):
                repairs[i], undone[i] = preview(log, list(accepted))
        findings = [
            [_with_remedy(f, left) for f in found] for found, left in zip(findings, undone, strict=True)
        ]
    spoiled = [f for found in findings for f in found if f.severity == "spoils" and f.name not in accepted]
    useless = [log for log in read if log.torque is None and log.drive_input is None]
    if as_json:
        print_json(
            {
                "ok": not spoiled and not useless,
                "logs": [
                    summary(log)
                    | {"findings": [f.to_dict() for f in found], "repairs": lines, "doubts": doubts(log)}
                    for log, found, lines in zip(read, findings, repairs, strict=False)
                ],
            }
        )
    else:
        title = "Of --repair:" if repair else "--repair would do this:"
        for log, found, lines in zip(read, findings, repairs, strict=False):
            _print(log, found, accepted, (title, lines), brief=len(read) > MOST)
        if len(read) > MOST:
            echo(
                f"{len(read)} logs, {sum(bool(f) for f in findings)} with findings; inspect one to see more of it."
            )
    if spoiled or useless:
        raise typer.Exit(1)


def preview(log: Log, accepted: list[str]) -> tuple[list[str], dict[str, str]]:
    """Return sentences on what --repair would do to a log, and those on the repairs it would undo, by their checks."""
    from backdrive.identification.repairs import apply_repairs

    after, undone = apply_repairs(log, accepted)
    return [*(note for note in after.notes if note not in log.notes), *undone.values()], undone


def _with_remedy(finding: Finding, undone: Collection[str]) -> Finding:
    """Return a finding whose remedy is no repair that is undone again."""
    return replace(finding, remedy=LEFT_ALONE) if finding.repairable and finding.name in undone else finding


def doubts(log: Log) -> list[str]:
    """Return sentences on why a log without faults may still be useless."""
    from backdrive.identification.log_set import clock_unit
    from backdrive.logs.health.unsorted_time import in_order
    from backdrive.logs.log import AS_SI

    found = [note for note in log.notes if AS_SI in note]
    clock = in_order(log)
    if clock.period > 0.0 and (unit := clock_unit(1.0 / clock.period)) and _is_smooth(clock):
        found.append(unit)
    if log.torque is None and log.drive_input is None:
        said = [note for note in log.notes if note.startswith("No column was taken as torque")]
        way = said[0] if said else "Map a column, for example --map tau=COLUMN."
        if log.reference is not None:
            way += (
                " If the reference is the goal of a servo, `backdrive identify --drive position,proportional=GAIN` "
                "needs no torque."
            )
        found.append(f"The log has neither torque nor drive input. {way}")
    return found


def _is_smooth(log: Log) -> bool:
    """Return whether the motion hardly changes from sample to sample, as it does where the sampling is fast."""
    import numpy as np

    motion = log.velocity if log.position is None else log.position
    if motion is None or len(log) < FEWEST:
        return False
    steps, spread = np.nanstd(np.diff(motion, axis=0), axis=0), np.nanstd(motion, axis=0)
    return bool(np.any((spread > 0.0) & (steps < SMOOTH * spread)))


def summary(log: Log) -> dict[str, Any]:
    """Return what a log holds, as plain values in SI units."""
    import numpy as np

    from backdrive.logs.health._exam import Exam
    from backdrive.logs.health.jitter import variation
    from backdrive.logs.health.unsorted_time import in_order
    from backdrive.logs.log import channel_unit

    clock = in_order(log)
    steps, period = np.diff(clock.time), clock.period
    jitter = variation(Exam(clock))[0]  # as its check sees it
    channels: dict[str, Any] = {}
    for name, values in log.channels.items():
        for column, joint in enumerate(log.joints):
            x = values[:, column]
            good = x[np.isfinite(x)]
            channels.setdefault(joint.name, {})[name] = {
                "unit": channel_unit(name, joint),
                "lowest": float(good.min()) if good.size else None,
                "highest": float(good.max()) if good.size else None,
                "mean": float(good.mean()) if good.size else None,
                "not_finite": int(x.size - good.size),
            }
    return {
        "sources": [{"path": s.path, "sha256": s.sha256} for s in log.sources],
        "samples": len(log),
        "duration": clock.duration,
        "rate": 1.0 / period if period > 0 else None,
        "jitter": jitter if np.isfinite(jitter) else None,
        "longest_interval": float(steps.max()) if steps.size else None,
        "joints": [
            {
                "name": j.name,
                "unit": j.unit,
                "torque_side": j.torque_side,
                "gear_ratio": j.gear_ratio,
                "encoder_counts": j.encoder_counts,
                "channels": channels.get(j.name, {}),
            }
            for j in log.joints
        ],
        "drive": None if log.drive is None else {"law": log.drive.law, "gains": dict(log.drive.gains)},
        "notes": list(log.notes),
    }


def small_plot(values, bars: str = BARS, width: int = WIDTH) -> str:
    """Return a channel in one line of characters: the means of equal stretches, lowest to highest.

    Args:
        values: samples [any], (n,).
        bars: characters from low to high.
        width: of the line [characters].
    """
    import numpy as np

    stretches = [part[np.isfinite(part)] for part in np.array_split(values, min(width, max(len(values), 1)))]
    means = np.array([part.mean() if part.size else np.nan for part in stretches])
    if not np.isfinite(means).any():
        return " " * len(means)
    low, high = np.nanmin(means), np.nanmax(means)
    scaled = (means - low) / (high - low) if high > low else np.full(means.size, 0.5)
    level = np.rint(scaled * (len(bars) - 1))
    return "".join(" " if not np.isfinite(i) else bars[int(i)] for i in level)


def _print(
    log: Log, findings: list[Finding], accepted: set[str], repairs: tuple[str, list[str]], *, brief: bool
) -> None:
    from rich.text import Text

    from backdrive.logs.health.unsorted_time import in_order

    unsure = doubts(log)
    if brief and not findings and not unsure:
        return
    console = new_console()
    held = summary(log)
    console.print(", ".join(s.path for s in log.sources) or "log", style="bold")
    if not brief:
        rate = f"{held['rate']:.6g} Hz" if held["rate"] else "no rate"
        jitter = (
            f", jitter {100 * held['jitter']:.3g} % of the interval" if held["jitter"] is not None else ""
        )
        longest = (
            f", longest interval {held['longest_interval']:.4g} s"
            if held["longest_interval"] is not None
            else ""
        )
        console.print(f"{held['samples']} samples, {held['duration']:.6g} s, {rate}{jitter}{longest}")
        ordered = in_order(log)
        bars = BARS if "utf" in (console.encoding or "").lower() else PLAIN
        words = ("joint", "channel", "unit", "over time")
        rows = table(*words[:3], "lowest", "highest", words[3], text=words, no_wrap=True)
        for column, about in enumerate(held["joints"]):
            for i, (name, c) in enumerate(about["channels"].items()):
                ends = [f"{x:.5g}" if x is not None else "-" for x in (c["lowest"], c["highest"])]
                drawn = small_plot(ordered.channels[name][:, column], bars)
                rows.add_row(about["name"] if i == 0 else "", name, c["unit"], *ends, drawn)
        console.print(rows)
        print_lines(
            console, (note for note in log.notes if not any(note in doubt for doubt in unsure)), style="dim"
        )
    for i, finding in enumerate(findings):
        style = {"spoils": "red", "warn": "yellow"}.get(finding.severity, "dim")
        word = "accepted" if finding.name in accepted else finding.severity
        console.print(Text.assemble((word, style), " ", (finding.name, "bold"), f": {finding.sentence}"))
        if i + 1 == len(findings) or findings[i + 1].remedy != finding.remedy:
            console.print(f"    {finding.remedy}", style="dim")
    title, lines = repairs
    if lines:
        console.print(title, style="bold")
        print_lines(console, (f"    {sentence}" for sentence in lines))
    print_lines(console, unsure, style="yellow")
    if not findings and not unsure:
        console.print("No faults found in this log.", style="green")
