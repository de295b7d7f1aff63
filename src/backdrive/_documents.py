"""Documents of plain values, as JSON holds them.

When `isinstance` has shown that a value is a list, a type checker still does not know what the list holds. After `is_list` it
does.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from os import PathLike
from typing import Any, TypeGuard


def is_object(value: object) -> TypeGuard[dict[str, Any]]:
    """Return whether a value is an object."""
    return isinstance(value, dict)


def is_list(value: object) -> TypeGuard[list[Any]]:
    """Return whether a value is a list."""
    return isinstance(value, list)


def is_several(value: object) -> TypeGuard[list[Any] | tuple[Any, ...]]:
    """Return whether a value is a list or a tuple."""
    return isinstance(value, (list, tuple))


def as_list(value: object) -> list[Any]:
    """Return the elements of a list, tuple, generator or another iterable; a list of the value itself where it has none."""
    alone = isinstance(value, (str, bytes, PathLike, Mapping)) or not isinstance(value, Iterable)
    return [value] if alone else list(value)  # type: ignore[arg-type]


def numbers_in(value: Any, where: str) -> Iterator[tuple[str, float]]:
    """Yield every number of a document and its place.

    Args:
        value: plain values, as JSON holds them.
        where: the place of the whole, such as `$`.
    """
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from numbers_in(inner, f"{where}.{key}")
    elif isinstance(value, (list, tuple)):
        for i, inner in enumerate(value):
            yield from numbers_in(inner, f"{where}[{i}]")
    elif isinstance(value, (int, float)) and not isinstance(value, bool):
        yield where, value


def plain(value: Any) -> Any:
    """Return a value in a form that JSON can hold.

    Arrays become lists, names become texts, and numbers that are not finite become None.
    """
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value


def json_schema(kind: type, title: str) -> str:
    """Return the JSON schema of a document as text.

    Args:
        kind: the msgspec structure that the document is read as; it refuses unknown keys, and so does the schema.
        title: of the schema.
    """
    import inspect
    import json

    import msgspec

    schema = msgspec.json.schema(kind)
    for part in schema["$defs"].values():
        if "description" in part:
            part["description"] = inspect.cleandoc(part["description"])  # some versions of msgspec indent
        if "properties" in part:
            part["additionalProperties"] = False
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": title}
    return json.dumps(head | schema, indent=1) + "\n"
