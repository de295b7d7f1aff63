"""The file of a tuning: a small JSON that a robot's program can load. Every number is checked when it is read."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec

from backdrive import _documents as documents
from backdrive._files import read_whole, write_whole
from backdrive.errors import BackdriveError, ModelFileError
from backdrive.laws import Growth, rate_law
from backdrive.parameters import NOT_NEGATIVE, POSITIVE, Bound, fault
from backdrive.tuning.bounds import BOUNDS
from backdrive.tuning.tuning import NAMES, Number, Tuning

FORMAT, SCHEMA = "backdrive-tuning", 2
OLDER = 1  # older schema without limits: `Tuning.loop` requires them
MAX_BYTES = 5_000_000
AGAIN = "Run `backdrive tune` again."
#: Fields stored unchanged, and fields that are tables of numbers.
PLAIN = ("joint", "unit", "goal", "top_speed", "inertia", "interval", "encoder_count", "trip_speed", "limit", "seed")  # fmt: skip
TABLES = ("scores", "margins", "region")
#: Bounds of the numbers; numbers without an entry are positive.
RANGES = {
    "share": Bound(0.0, 1.0),
    "dither_share": Bound(0.0, 1.0),
    "filter_ratio": Bound(1.0, 100.0, open_low=True),
    "admittance_viscosity": NOT_NEGATIVE,
    "position_gain": NOT_NEGATIVE,
    "velocity_gain": NOT_NEGATIVE,
}


class _Number(msgspec.Struct, forbid_unknown_fields=True):
    symbol: str
    value: float
    unit: str
    reason: str
    bound: str = ""
    limit: float | None = None


class _Rate(msgspec.Struct, forbid_unknown_fields=True):
    name: str
    parameters: dict[str, float | list[float]]


class _Joint(msgspec.Struct, forbid_unknown_fields=True):
    joint: str
    unit: Literal["rad", "m"]
    goal: Literal["backdrive", "track", "estimate", "admit"]
    rate: _Rate
    top_speed: float
    inertia: float
    interval: float
    numbers: dict[str, _Number]
    growth: dict[str, float] | None = None
    encoder_count: float | None = None
    trip_speed: float | None = None
    limit: float | None = None
    scores: dict[str, Any] = {}
    margins: dict[str, Any] = {}
    region: dict[str, Any] = {}
    notes: list[str] = []
    seed: Annotated[int, msgspec.Meta(ge=0)] = 0


class _Header(msgspec.Struct):
    format: str = ""
    schema: int = 0


class _File(msgspec.Struct, forbid_unknown_fields=True):
    format: str
    schema: int
    joints: Annotated[list[_Joint], msgspec.Meta(min_length=1)]


def plain(tuning: Tuning) -> dict[str, Any]:
    """Return a tuning as numbers and words alone."""
    found = {name: getattr(tuning, name) for name in PLAIN}
    found["rate"] = {"name": tuning.rate.NAME, "parameters": tuning.rate.values()}
    if tuning.growth is not None:
        found["growth"] = tuning.growth.values()
    found["numbers"] = {name: asdict(number) for name, number in tuning.numbers.items()}
    for name in TABLES:
        found[name] = dict(getattr(tuning, name))
    found["notes"] = list(tuning.notes)
    return documents.plain(found)


def save_tunings(tunings: Sequence[Tuning], path: str | Path) -> Path:
    """Write tunings to a JSON file, whole or not at all."""
    document = {"format": FORMAT, "schema": SCHEMA, "joints": [plain(t) for t in tunings]}
    return write_whole(path, json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n")


def schema() -> str:
    """Return the JSON schema of a tuning file, as `tuning.schema.json` holds it."""
    return documents.json_schema(_File, f"Tuning of backdrive, schema {SCHEMA}")


def load_tunings(path: str | Path) -> tuple[Tuning, ...]:
    """Read tunings from a JSON file.

    Raises:
        ModelFileError: the file is absent, damaged, of another kind or holds a number that makes no sense; the message says where.
    """
    path = Path(path)
    data = read_whole(path, MAX_BYTES, error=ModelFileError, remedy="A tuning is a few kilobytes.")
    try:
        header = msgspec.json.decode(data, type=_Header)
        if header.format != FORMAT:
            raise ModelFileError(
                f"{path} is JSON, but not a tuning.", remedy="Name a file made by `backdrive tune -o`."
            )
        if header.schema not in (OLDER, SCHEMA):
            raise ModelFileError(
                f"{path}: $.schema is {header.schema}, this version reads {SCHEMA}.",
                remedy="Upgrade backdrive, or tune again.",
            )
        joints = msgspec.json.decode(data, type=_File).joints
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError, OverflowError) as error:
        raise ModelFileError(f"{path} is damaged: {error}.", remedy=AGAIN) from error
    names = [joint.joint for joint in joints]
    for i, name in enumerate(names):
        if name in names[:i]:
            raise ModelFileError(f"{path}: $.joints[{i}]: joint '{name}' is there twice.", remedy=AGAIN)
    return tuple(_tuning(joint, f"{path}: $.joints[{i}] ('{joint.joint}')") for i, joint in enumerate(joints))


def _wrong(joint: _Joint) -> list[str]:
    """Return what is wrong with the numbers of a joint, each with its key."""
    needed = NAMES[joint.goal]
    wrong = [f"numbers.{name} is missing" for name in needed if name not in joint.numbers]
    wrong += [
        f"numbers.{name} is none of --goal {joint.goal}" for name in joint.numbers if name not in needed
    ]
    said = [fault(name, getattr(joint, name), BOUNDS[name]) for name in ("top_speed", "inertia", "interval")]
    known = {"encoder_count": POSITIVE, "trip_speed": POSITIVE, "limit": NOT_NEGATIVE}
    said += [
        fault(name, getattr(joint, name), bound)
        for name, bound in known.items()
        if getattr(joint, name) is not None
    ]
    said += [
        fault(f"numbers.{name}.value", number.value, RANGES.get(name, POSITIVE))
        for name, number in joint.numbers.items()
    ]
    return wrong + [words for words in said if words]


def _tuning(joint: _Joint, where: str) -> Tuning:
    wrong = _wrong(joint)
    if wrong:
        raise ModelFileError(f"{where}: {'; '.join(wrong)}.", remedy=AGAIN)
    kept = {
        name: Number(**{**msgspec.structs.asdict(n), "limit": math.nan if n.limit is None else n.limit})
        for name, n in joint.numbers.items()
    }
    values = {k: tuple(v) if isinstance(v, list) else v for k, v in joint.rate.parameters.items()}
    try:
        tuning = Tuning(
            **{name: getattr(joint, name) for name in (*PLAIN, *TABLES)},
            rate=rate_law(joint.rate.name)(**values),
            growth=None if joint.growth is None else Growth(**joint.growth),
            numbers=kept,
            notes=tuple(joint.notes),
        )
        _ = tuning.compensator(), tuning.external()  # each looks at its numbers
        if tuning.trip_speed is not None:
            tuning.loop()
    except BackdriveError as error:
        raise ModelFileError(f"{where}: {error.message}", remedy=error.remedy) from error
    except (TypeError, ValueError) as error:
        raise ModelFileError(f"{where}: rate: {error}.", remedy=AGAIN) from error
    return tuning
