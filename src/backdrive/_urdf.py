"""A URDF from anywhere, reduced to what rigid bodies need: links with inertias, and joints in one tree.

No document type, no entities, no meshes; the tree is checked here because the parser behind pinocchio recurses along it.
"""

from __future__ import annotations

import math
from typing import Any

from backdrive.errors import FileTooLarge, ForbiddenContent, ReadError, require

MAX_JOINTS = 500
#: How many numbers an attribute holds.
NUMBERS = {"xyz": 3, "rpy": 3, "value": 1} | dict.fromkeys(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), 1)


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
        require(module, "Reading a URDF needs", "arm") for module in ("defusedxml", "defusedxml.ElementTree")
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
            f"{where} is not well-formed XML: {error}.", remedy="Name a URDF file, with xacro expanded."
        ) from error


def skeleton(data: bytes, where: str) -> str:
    """Return the URDF without anything but links, inertias and joints.

    Args:
        data: the file's bytes.
        where: what to call it in messages.

    Raises:
        MissingExtra: defusedxml is not installed.
        ForbiddenContent: there is a document type or an entity.
        ReadError: it is not XML, not a URDF, or its links form no single tree.
        FileTooLarge: it has more joints than any arm.
    """
    return _bare(parse(data, where), where)


def _bare(root: Any, where: str) -> str:
    """Return the URDF reduced to links with inertias and joints, after checking that they form one tree."""
    from xml.etree.ElementTree import Element, SubElement, tostring

    links, joints = root.findall("link"), root.findall("joint")
    if root.tag != "robot" or not links:
        raise ReadError(
            f"{where} has no <robot> with links.", remedy="Name a URDF file, with xacro expanded."
        )
    if len(joints) > MAX_JOINTS:
        raise FileTooLarge(f"{where} has {len(joints)} joints.", remedy=f"At most {MAX_JOINTS} are read.")
    bare = Element("robot", name=root.get("name") or "robot")
    names = [link.get("name") or "" for link in links]
    for link in links:
        copy = SubElement(bare, "link", name=link.get("name") or "")
        copy.extend(link.findall("inertial")[:1])
        _check_numbers(copy, f"{where}: link '{link.get('name')}'")
    parent_of: dict[str, str] = {}
    for joint in joints:
        parent, child = (_end(joint, tag) for tag in ("parent", "child"))
        if parent not in names or child not in names:
            raise ReadError(
                f"{where}: joint '{joint.get('name')}' joins {parent} and {child}, which are not both links.",
                remedy="Correct its <parent> and <child>.",
            )
        if child in parent_of:
            raise ReadError(f"{where}: link '{child}' has two parents.", remedy="Loops are not supported.")
        parent_of[child] = parent
        copy = SubElement(bare, "joint", {k: joint.get(k) or "" for k in ("name", "type")})
        for tag in ("origin", "parent", "child", "axis", "limit"):
            copy.extend(joint.findall(tag)[:1])
        _check_numbers(copy, f"{where}: joint '{joint.get('name')}'")
    for name in names:
        seen = {name}
        while name in parent_of:
            name = parent_of[name]
            if name in seen:
                raise ReadError(f"{where}: the links form a ring at '{name}'.", remedy="Cut the loop.")
            seen.add(name)
    if len(set(names)) != len(names) or len(names) - len(parent_of) != 1:
        raise ReadError(
            f"{where}: {len(names)} links, {len(parent_of)} of them held by a joint; they form no single tree.",
            remedy="Name each link once and join all but one of them to a parent.",
        )
    return tostring(bare, encoding="unicode")


def _check_numbers(element: Any, where: str) -> None:
    """Refuse what the parser would pass over: it drops an inertia that it cannot read, and the link weighs nothing."""
    for node in element.iter():
        for attribute, count in NUMBERS.items():
            text = node.get(attribute)
            if text is None:
                continue
            try:
                values = [float(part) for part in text.split()]
            except ValueError:
                values = []
            if len(values) != count or not all(math.isfinite(v) for v in values):
                raise ReadError(
                    f"{where}: {attribute} is '{text}'.", remedy=f"Write {count} finite numbers there."
                )


def _end(joint: Any, tag: str) -> str:
    node = joint.find(tag)
    return "" if node is None else node.get("link") or ""
