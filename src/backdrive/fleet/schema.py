"""The columns of a fleet's results, their version, and the conversion of older results."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from backdrive.errors import ModelFileError, require

if TYPE_CHECKING:
    import pyarrow as pa

VERSION = 1
KEY = b"backdrive.fleet.schema"

#: Schema version -> function that converts a table to the next version.
MIGRATIONS: Mapping[int, Callable[[Any], Any]] = {}

TEXTS = ("digest", "path", "stamp", "tag", "version", "robot", "type", "joint", "unit", "method", "law", "grade",
         "verdict", "failure", "message", "remedy")  # fmt: skip
NUMBERS = (
    "constant",
    "constant_error",
    "viscous",
    "viscous_error",
    "top_speed",
    "temperature",
    "residual",
    "rms",
)


def schema() -> pa.Schema:
    """Return the columns: one row a joint of a log, or one for a log that failed.

    `digest`, `path`, `size` [B] and `stamp` are of the log's file, `tag` of options and version; `day` is when it was recorded.
    `parameters` are of law and dynamics with standard errors, `covariance` is row by row in the order of `covariance_names`.
    `constant` [N.m or N] and `viscous` [N.m.s/rad or N.s/m] are the line through the mean of both directions up to `top_speed`
    [rad/s or m/s]. `temperature` is the log's mean [degC], and `residual` that of held-out data [%]. `failure` names the class
    of an error and is null for a result.
    """
    pa = require("pyarrow", "A fleet's results need", "fleet")
    number = pa.struct([("name", pa.string()), ("value", pa.float64()), ("error", pa.float64())])
    fields = [(name, pa.string()) for name in TEXTS[:5]]
    fields += [("size", pa.int64())]
    fields += [(name, pa.string()) for name in TEXTS[5:8]]
    fields += [("day", pa.date32())]
    fields += [(name, pa.string()) for name in TEXTS[8:11]]
    fields += [
        ("parameters", pa.list_(number)),
        ("covariance_names", pa.list_(pa.string())),
        ("covariance", pa.list_(pa.float64())),
    ]
    fields += [(name, pa.float64()) for name in NUMBERS]
    fields += [(name, pa.string()) for name in TEXTS[11:13]]
    fields += [("warnings", pa.list_(pa.string()))]
    fields += [(name, pa.string()) for name in TEXTS[13:]]
    return pa.schema(fields, metadata={KEY: str(VERSION).encode()})


def check_version(version: object, place: object) -> int:
    """Return a version of the schema that can be read.

    Raises:
        ModelFileError: it is newer, or no version at all.
    """
    if not isinstance(version, int) or isinstance(version, bool) or version < min([VERSION, *MIGRATIONS]):
        raise ModelFileError(
            f"{place} has the schema {version!r}, which is not one of a fleet's results.",
            remedy="Name the folder that `backdrive fleet ... -o` wrote.",
        )
    if version > VERSION:
        raise ModelFileError(
            f"{place} has schema {version}, newer than {VERSION}, the newest that this version reads.",
            remedy="Update backdrive, or write to another folder with -o.",
        )
    return version


def current(table: pa.Table, version: int) -> pa.Table:
    """Return a table of an older schema as one of the current schema."""
    for step in range(version, VERSION):
        table = MIGRATIONS[step](table)
    return table.select(schema().names).cast(schema())
