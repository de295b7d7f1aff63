"""Parsing of untrusted XML, without document types, entities and other files."""

from __future__ import annotations

import math
from typing import Any

from backdrive.errors import ForbiddenContent, ReadError, require

MAX_JOINTS = 500


def parse(data: bytes, where: str) -> Any:
    """Return the root element of an XML document that names no other files.

    Args:
        data: the file's bytes.
        where: what to call it in messages.

    Raises:
        MissingExtra: defusedxml is not installed.
        ForbiddenContent: there is a document type or an entity.
        ReadError: it is not XML.
    """
    defused, tree = (
        require(module, "Reading a robot description needs", "arm")
        for module in ("defusedxml", "defusedxml.ElementTree")
    )
    try:
        return tree.fromstring(data, forbid_dtd=True)
    except defused.DefusedXmlException as error:
        raise ForbiddenContent(
            f"{where} declares a document type (DOCTYPE) or entities, which could name other files.",
            remedy="A robot description needs neither: remove them.",
        ) from error
    except (tree.ParseError, ValueError, LookupError) as error:
        raise ReadError(
            f"{where} is not well-formed XML: {error}.",
            remedy="Name a URDF file, with xacro expanded, or an MJCF file.",
        ) from error


def numbers(text: str, counts: tuple[int, ...], where: str) -> list[float]:
    """Return the finite numbers of an attribute.

    Args:
        text: of the attribute.
        counts: how many there may be.
        where: what to call it in messages.

    Raises:
        ReadError: another count, or something else than a finite number.
    """
    try:
        values = [float(part) for part in text.split()]
    except ValueError:
        values = []
    if len(values) not in counts or not all(math.isfinite(v) for v in values):
        many = " or ".join(str(c) for c in counts)
        raise ReadError(f"{where} is '{text[:80]}'.", remedy=f"Write {many} finite numbers there.")
    return values
