"""An untrusted URDF, reduced to rigid bodies: links with inertias, and joints in one tree.

Meshes are ignored. The tree is checked here because pinocchio's parser is recursive. Many files omit elements that this parser
requires. They are added: an undeclared parent called `world`, and the limits of a joint. A joint without limits gets very wide
ones, so that its position is one number, as for all other joints.
"""

from __future__ import annotations

from typing import Any

from backdrive.errors import FileTooLarge, ReadError
from backdrive.robot.bodies import Range, require_pinocchio
from backdrive.robot.xml import MAX_JOINTS, numbers

WIDE = 1e9  # limits that are none [rad or m]
WORLD = "world"
MOVING = ("revolute", "continuous", "prismatic")
#: How many numbers an attribute holds.
NUMBERS = {"xyz": 3, "rpy": 3, "value": 1} | dict.fromkeys(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), 1)
XACRO = ("include", "macro", "property", "arg", "if", "unless", "insert_block", "call")
LIMITS = ("lower", "upper", "velocity", "effort")


def build(root: Any, where: str) -> tuple[Any, dict[str, Range], list[str]]:
    """Return pinocchio's model, what each joint is allowed, and remarks.

    Args:
        root: element of the document.
        where: what to call it in messages.

    Raises:
        ReadError: it is no URDF, or its links form no single tree.
        FileTooLarge: it has more joints than any arm.
    """
    remarks: list[str] = []
    text, ranges = _bare(root, where, remarks)
    try:
        return require_pinocchio().buildModelFromXML(text), ranges, remarks
    except (ValueError, RuntimeError, IndexError) as error:
        raise ReadError(
            f"{where} is no valid URDF: {error}.", remedy="Check it with `check_urdf`."
        ) from error


def _bare(root: Any, where: str, remarks: list[str]) -> tuple[str, dict[str, Range]]:
    """Check that links and joints form one tree, and return the URDF reduced to these, and the limits."""
    from xml.etree.ElementTree import Element, SubElement, tostring

    links, joints = root.findall("link"), root.findall("joint")
    if root.tag != "robot" or not links:
        raise ReadError(
            f"{where} has no <robot> with links.",
            remedy="Name a URDF file, with xacro expanded, or an MJCF file.",
        )
    if len(joints) > MAX_JOINTS:
        raise FileTooLarge(f"{where} has {len(joints)} joints.", remedy=f"At most {MAX_JOINTS} are read.")
    bare = Element("robot", name=root.get("name") or "robot")
    names = [link.get("name") or "" for link in links]
    if WORLD not in names and any(_end(joint, "parent") == WORLD for joint in joints):
        names.append(WORLD)
        SubElement(bare, "link", name=WORLD)
    for link in links:
        copy = SubElement(bare, "link", name=link.get("name") or "")
        copy.extend(link.findall("inertial")[:1])
        _check_numbers(copy, f"{where}: link '{link.get('name')}'")
        _check_inertia(copy, f"{where}: link '{link.get('name')}'")
    parent_of: dict[str, str] = {}
    ranges: dict[str, Range] = {}
    _refuse_xacro(root, where)
    if len({joint.get("name") for joint in joints}) < len(joints):
        every = [joint.get("name") or "" for joint in joints]
        twice = next(name for name in every if every.count(name) > 1)
        raise ReadError(f"{where}: two joints are called '{twice}'.", remedy="Rename one.")
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
        name, kind = joint.get("name") or "", joint.get("type") or ""
        copy = SubElement(bare, "joint", name=name, type="revolute" if kind == "continuous" else kind)
        for tag in ("origin", "parent", "child", "axis"):
            copy.extend(joint.findall(tag)[:1])
        axis = joint.find("axis")
        if kind in MOVING and axis is not None and not any(map(float, _floats(axis.get("xyz")))):
            raise ReadError(
                f"{where}: the axis of joint '{name}' is '{axis.get('xyz')}'.",
                remedy="Give its direction, such as 0 0 1.",
            )
        if kind in MOVING and joint.find("mimic") is not None:
            remarks.append(
                f"Joint {name} follows {joint.find('mimic').get('joint')} in the description (<mimic>); here it is a joint of "
                f"its own. Make it `fixed` if it is not in the log."
            )
        if kind in MOVING:
            ranges[name] = _range(joint, f"{where}: joint '{name}'")
            wide = {"lower": -WIDE, "upper": WIDE, "velocity": WIDE, "effort": WIDE}
            SubElement(copy, "limit", {k: repr(v) for k, v in wide.items()})
        _check_numbers(copy, f"{where}: joint '{joint.get('name')}'")
    _check_tree(names, parent_of, where)
    bounded = [j.get("name") or "" for j in joints if j.get("type") in ("revolute", "prismatic")]
    open_ended = [n for n in bounded if ranges[n].upper == float("inf")]
    if open_ended:
        remarks.append(f"The description states no range of {', '.join(open_ended)}: taken as without.")
    return tostring(bare, encoding="unicode"), ranges


def _refuse_xacro(root: Any, where: str) -> None:
    """Refuse elements and expressions of xacro, which are no part of a URDF and would be ignored."""
    for node in root.iter():
        written = str(node.tag)
        of_xacro = written.startswith("{") and written.rpartition("}")[2] in XACRO
        if of_xacro or "xacro" in written or any("${" in value for value in node.attrib.values()):
            raise ReadError(
                f"{where} holds xacro (<{written.rpartition('}')[2]}>) that is not expanded.",
                remedy="Expand it: xacro FILE.xacro > FILE.urdf.",
            )


def _floats(text: str | None) -> list[str]:
    """Return the numbers of an axis as written; one that is missing or unreadable is left to later checks."""
    try:
        return [str(float(part)) for part in (text or "1").split()] or ["1"]
    except ValueError:
        return ["1"]


def _check_tree(names: list[str], parent_of: dict[str, str], where: str) -> None:
    """Refuse rings, and links that no joint holds."""
    for name in names:
        passed = {name}
        while name in parent_of:
            name = parent_of[name]
            if name in passed:
                raise ReadError(f"{where}: the links form a ring at '{name}'.", remedy="Cut the loop.")
            passed.add(name)
    if len(set(names)) != len(names) or len(names) - len(parent_of) != 1:
        raise ReadError(
            f"{where}: {len(names)} links, of which {len(parent_of)} have a joint: they do not form one tree.",
            remedy="Name each link once and join all but one of them to a parent.",
        )


def _range(joint: Any, where: str) -> Range:
    """Return the limits of a joint; limits of zero count as missing, since exporters write them for unknown limits."""
    limit = joint.find("limit")
    stated = {} if limit is None else {key: limit.get(key) for key in LIMITS if limit.get(key) is not None}
    value = {key: numbers(text, (1,), f"{where}: {key}")[0] for key, text in stated.items()}
    rest = {key: value[key] for key in ("velocity", "effort") if value.get(key, 0.0) > 0.0}
    lower, upper = value.get("lower", 0.0), value.get("upper", 0.0)
    if joint.get("type") == "continuous" or not lower < upper:
        return Range(**rest)
    return Range(lower=lower, upper=upper, **rest)


def _check_numbers(element: Any, where: str) -> None:
    """Refuse invalid numbers, since the parser ignores them: a link whose inertia is unreadable would have no mass."""
    for node in element.iter():
        for attribute, count in NUMBERS.items():
            text = node.get(attribute)
            if text is not None:
                numbers(text, (count,), f"{where}: {attribute}")


def _check_inertia(link: Any, where: str) -> None:
    """Refuse masses and moments of inertia that no body has; the parser takes them as they are."""
    for node in link.iter():
        for name in (
            ("value",) if node.tag == "mass" else ("ixx", "iyy", "izz") if node.tag == "inertia" else ()
        ):
            text = node.get(name)
            if text is not None and float(text) < 0.0:
                raise ReadError(
                    f"{where}: its {node.tag} ({name}) is {text}, less than nothing.",
                    remedy="Correct the description.",
                )


def _end(joint: Any, tag: str) -> str:
    node = joint.find(tag)
    return "" if node is None else node.get("link") or ""
