"""Plans as JSON: written beside the files for the robot, and read again with the log."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

from backdrive._catalog import lookup
from backdrive._documents import numbers_in
from backdrive._files import read_whole, write_whole
from backdrive.errors import BackdriveError, InvalidInput, ReadError, UnknownFormat
from backdrive.parameters import NOT_NEGATIVE, POSITIVE
from backdrive.plans.arm import ArmPlan
from backdrive.plans.base import KINDS
from backdrive.plans.in_turn import Hold, InTurn

SCHEMA = 1
FORMAT = "backdrive-plan"
MAX_BYTES = 20_000_000
#: Numbers that something is divided by.
DIVISORS = ("stroke", "top_speed", "speeds", "amplitude", "frequency", "low", "high", "period", "rate")


def plan_to_dict(plan: Any) -> dict[str, Any]:
    """Return a plan as plain values that JSON can hold, with format, schema version, joint and unit."""
    return {"format": FORMAT, "schema": SCHEMA, **_plain(plan)}


def _plain(plan: Any) -> dict[str, Any]:
    if isinstance(plan, InTurn):
        return {
            "kind": plan.kind,
            "start": plan.start,
            "pause": plan.pause,
            "held": [asdict(h) for h in plan.held],
            "plans": [_plain(p) for p in plan.plans],
        }
    return {"kind": plan.kind, **asdict(plan)}


def plan_from_dict(data: Mapping[str, Any]) -> Any:
    """Return the plan that `plan_to_dict` wrote.

    Raises:
        UnknownFormat: it is not a plan, or of a schema this version does not know.
        ReadError: a field is missing, unknown, of the wrong type or out of range.
    """
    if not isinstance(data, Mapping) or data.get("format") != FORMAT:
        raise UnknownFormat(
            f'This is not a plan: its "format" is not "{FORMAT}".',
            remedy="Name a plan.json that `backdrive plan` wrote.",
        )
    if data.get("schema") != SCHEMA or isinstance(data.get("schema"), bool):
        raise UnknownFormat(
            f"The plan has schema {data.get('schema')!r}, this version reads {SCHEMA}.",
            remedy="Read it with the version that wrote it, or make it again.",
        )
    for where, number in numbers_in(data, "$"):
        key = where.rpartition(".")[2].partition("[")[0]
        bound = POSITIVE if key in DIVISORS and number else NOT_NEGATIVE
        if not bound.holds(abs(number)) and key != "seed":
            raise ReadError(
                f"{where} is {str(number)[:40]}, which is not valid in a plan.",
                remedy="Make it again with `backdrive plan`.",
            )
    return _build({k: v for k, v in data.items() if k not in ("format", "schema")}, nested=False)


def _build(data: Any, *, nested: bool) -> Any:
    import msgspec

    if not isinstance(data, Mapping) or not isinstance(data.get("kind"), str):
        raise ReadError("A plan has no kind.", remedy="Make it again with `backdrive plan`.")
    try:
        cls = lookup(data["kind"], {**KINDS, InTurn.kind: InTurn, ArmPlan.kind: ArmPlan}, "kind of plan")
        given = {k: v for k, v in data.items() if k != "kind"}
        if cls in (InTurn, ArmPlan) and nested:
            raise InvalidInput(
                "A plan in turn contains another plan of several joints.",
                remedy="Make it again with `backdrive plan`.",
            )
        unknown = sorted(set(given) - {f.name for f in fields(cls) if f.init})
        if unknown:
            raise InvalidInput(f"Unknown field '{unknown[0]}'.", remedy="The file may be of a newer version.")
        if cls is InTurn:
            plans, held = given.get("plans"), given.get("held", [])
            if not isinstance(plans, list) or not isinstance(held, list) or len(plans) + len(held) > 1000:
                raise InvalidInput("'plans' and 'held' are not lists.", remedy="Make the plan again.")
            given["plans"] = tuple(_build(p, nested=True) for p in plans)
            given["held"] = tuple(msgspec.convert(h, Hold) for h in held)
            times = msgspec.convert({k: given[k] for k in ("start", "pause") if k in given}, dict[str, float])
            return InTurn(**{**given, **times})
        return msgspec.convert(given, cls)
    except (BackdriveError, msgspec.ValidationError) as error:
        if isinstance(error, ReadError):
            raise
        raise ReadError(
            f"The plan of the kind '{data['kind'][:40]}' is damaged: {error}",
            remedy="Make it again with `backdrive plan`.",
        ) from error


def save_plan(plan: Any, path: str | Path) -> Path:
    """Write a plan as JSON, whole or not at all.

    Raises:
        InvalidInput: the file cannot be written.
    """
    return write_whole(path, json.dumps(plan_to_dict(plan), indent=2, ensure_ascii=False) + "\n")


def load_plan(path: str | Path, *, start: float | None = None) -> Any:
    """Read a plan, so that a log can be linked with it: `log.replace(plan=load_plan("plan.json", start=2.5))`.

    Args:
        path: of the JSON file.
        start: instant at which the motion began on the log's clock [s]; by default what the file says.

    Raises:
        ReadError: there is no such file, or it is damaged.
        FileTooLarge: no plan needs that many bytes.
        UnknownFormat: it is not a plan.
    """
    content = read_whole(path, MAX_BYTES, remedy="Name a plan.json.")
    try:
        data = json.loads(content)
    except (ValueError, RecursionError) as error:
        raise UnknownFormat(f"{path} is not JSON: {error}.", remedy="Name a plan.json.") from error
    try:
        plan = plan_from_dict(data)
    except RecursionError as error:
        raise UnknownFormat(f"{path} is nested too deep for a plan.", remedy="Name a plan.json.") from error
    except ReadError as error:
        raise type(error)(f"{path}: {error.message}", remedy=error.remedy) from error
    return plan if start is None else replace(plan, start=start)
