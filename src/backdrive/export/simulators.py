"""Export of friction to robot descriptions, MJCF and URDF, with a report of the remaining errors.

Both formats contain Coulomb and viscous friction only, equal in both directions (`simple`). The largest and the RMS torque
error over the velocities of the data are written to a file beside the description. Presliding, a Stribeck peak, differences
between directions, and dependence on load and temperature are lost.
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

from backdrive._files import read_whole, write_together
from backdrive.errors import InvalidInput, ReadError, WriteError
from backdrive.export.simple import Simple, simplify, with_lugre
from backdrive.robot.xml import parse

if TYPE_CHECKING:
    from backdrive.model import FrictionModel

MARK = "backdrive"
MAX_BYTES = 20_000_000  # of a robot description
TAGS = {"mjcf": "mujoco", "urdf": "robot"}


def export_description(
    model: FrictionModel,
    robot: str | Path,
    folder: str | Path,
    *,
    joints: Sequence[str] | None = None,
    name: str | None = None,
    dcmotor: bool = False,
) -> tuple[list[Path], list[Simple]]:
    """Write a robot description with the identified friction, and a file with the effects that it cannot represent.

    Args:
        model: of friction.
        robot: URDF or MJCF file; joints are found by their names.
        folder: folder to write to, created if absent.
        joints: names; None: all of the model.
        name: of the file to write; None: that of `robot`.
        dcmotor: write LuGre as a passive `dcmotor` of MuJoCo 4, for the joints whose law is one.

    Returns:
        Files written, the description and a JSON file of `Simple`s; and these.

    Raises:
        InvalidInput: a joint is not in the description; a `dcmotor` in a URDF, or for no law that is one.
        ReadError: the description cannot be read.
        WriteError: the description itself would be overwritten, or a file exists that was not exported.
    """
    robot, folder = Path(robot), Path(folder)
    data = read_whole(robot, MAX_BYTES, error=ReadError, remedy="Name a URDF or MJCF file.")
    root = parse(data, str(robot))
    simple = [simplify(model.joint(n)) for n in joints or model.names]
    if dcmotor and root.tag == "robot":
        raise InvalidInput("URDF knows no dcmotor.", remedy="Name an MJCF file, or leave the option out.")
    if dcmotor:
        simple = [with_lugre(each, model.joint(each.joint).law) for each in simple]
        if all(each.lugre is None for each in simple):
            laws = ", ".join(sorted({model.joint(each.joint).law.name for each in simple}))
            raise InvalidInput(
                f"A dcmotor cannot run {laws}: it has Coulomb, viscous or Gauss-Stribeck friction with a LuGre bristle, the same "
                f"in both directions.",
                remedy="Export to mujoco, which runs any law, or leave the option out.",
            )
    nodes = joints_of(root)
    for each in simple:
        if each.joint not in nodes:
            raise InvalidInput(
                f"{robot} has no joint '{each.joint}'.",
                remedy=f"It has {', '.join(nodes) or 'none with a name'}.",
            )
        _write(root, nodes[each.joint], each)
    description = folder / (name or robot.name)
    beside = description.with_suffix(".friction.json")
    if description.resolve() == robot.resolve():
        raise WriteError(
            f"{description} is the description itself.", remedy="Write to another folder, or give --name."
        )
    for path in (description, beside):
        if path.exists() and MARK.encode() not in path.read_bytes()[:400]:
            raise WriteError(
                f"{path} exists and was not made by an export.", remedy="Choose another folder or --name."
            )
    folder.mkdir(parents=True, exist_ok=True)
    relocate(root, robot.parent, folder)
    text = ElementTree.tostring(root, encoding="unicode")
    comment = f"<!-- {robot.name} with friction from {MARK}; what it cannot express: {beside.name} -->\n"
    rows = {"format": f"{MARK}.friction", "joints": [asdict(each) for each in simple]}
    written = write_together(
        {
            description: f'<?xml version="1.0"?>\n{comment}{text}\n',
            beside: json.dumps(rows, indent=1, ensure_ascii=False, allow_nan=False) + "\n",
        }
    )
    return written, simple


def target_of(robot: str | Path) -> str:
    """Return `mjcf` or `urdf`, by the first element of a description.

    Raises:
        ReadError: it is neither.
    """
    path = Path(robot)
    root = parse(read_whole(path, MAX_BYTES, error=ReadError, remedy="Name a URDF or MJCF file."), str(path))
    for target, tag in TAGS.items():
        if root.tag == tag:
            return target
    raise ReadError(
        f"{path} begins with <{root.tag}>.", remedy="Name a URDF (<robot>) or MJCF (<mujoco>) file."
    )


def joints_of(root: Any) -> dict[str, Any]:
    """Return the joints of a description by name.

    Raises:
        ReadError: it is neither URDF nor MJCF.
    """
    if root.tag == "robot":
        nodes = root.findall("joint")
    elif root.tag == "mujoco":
        nodes = [node for body in root.iter("worldbody") for node in body.iter("joint")]
    else:
        raise ReadError(
            f"A description begins with <{root.tag}>.",
            remedy="Name a URDF (<robot>) or MJCF (<mujoco>) file.",
        )
    return {node.get("name"): node for node in nodes if node.get("name")}


def relocate(root: Any, old: Path, new: Path) -> None:
    """Change the paths of a description's meshes, textures and included files for another folder.

    Args:
        root: of the description, changed in place.
        old: folder that it was in.
        new: folder that it will be in.
    """
    if old.resolve() == new.resolve():
        return

    def new_path(path: str) -> str:
        return (
            path
            if os.path.isabs(path) or "://" in path
            else os.path.relpath(old.resolve() / path, new.resolve())
        )

    if root.tag == "robot":
        for mesh in root.iter("mesh"):
            mesh.set("filename", new_path(mesh.get("filename", "")))
        return
    for include in root.iter("include"):
        include.set("file", new_path(include.get("file", "")))
    needs = {"meshdir": ("mesh", "hfield", "skin"), "texturedir": ("texture",)}
    for key, tags in needs.items():
        if any(node.get("file") for tag in tags for node in root.iter(tag)):
            compilers = root.findall("compiler")
            compiler = compilers[-1] if compilers else ElementTree.SubElement(root, "compiler")
            compiler.set(key, new_path(compiler.get(key, compiler.get("assetdir", "."))))


def _write(root: Any, node: Any, simple: Simple) -> None:
    """Put the numbers into a joint's element, and a `dcmotor` beside the actuators."""
    if root.tag == "robot":
        dynamics = node.find("dynamics")
        if dynamics is None:
            dynamics = ElementTree.SubElement(node, "dynamics")
        dynamics.set("friction", repr(simple.friction))
        dynamics.set("damping", repr(simple.damping))
        return
    if simple.armature is not None:
        node.set("armature", repr(simple.armature))
    node.set("frictionloss", repr(simple.friction))
    node.set("damping", repr(simple.damping))
    if simple.lugre is None:
        return
    node.set("damping", "0")
    actuators = root.findall("actuator")
    actuator = actuators[-1] if actuators else ElementTree.SubElement(root, "actuator")
    motor = {
        "name": f"friction of {simple.joint}",
        "joint": simple.joint,
        "input": "none",
        "motorconst": "0",
        "resistance": "1",
    }
    motor |= {"damping": repr(simple.damping), "lugre": " ".join(repr(x) for x in simple.lugre)}
    ElementTree.SubElement(actuator, "dcmotor", motor)
