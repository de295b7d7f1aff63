"""Friction into robot descriptions: MJCF and URDF, with what they cannot express said in numbers.

Both know Coulomb and viscous friction alone, the same in both directions:

    tau = F sgn(v) + B v

F and B >= 0 are fitted by least squares to the identified curve over the velocities that the data covered; what is left, the
largest and the root-mean-square torque error there, is written beside the description. Presliding, a Stribeck peak, unlike
directions, growth with the load and temperature are lost.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np

from backdrive._files import read_whole, write_together
from backdrive.errors import InvalidInput, ReadError, WriteError
from backdrive.robot.xml import parse

if TYPE_CHECKING:
    from backdrive.model import FrictionModel
    from backdrive.model.joint_friction import JointFriction

MARK = "backdrive"
SPEEDS = 200  # velocities of a fit, in each direction
MAX_BYTES = 20_000_000  # of a robot description
TAGS = {"mjcf": "mujoco", "urdf": "robot"}


@dataclass(frozen=True, kw_only=True)
class Simple:
    """What a description says of a joint's friction, and what it leaves out.

    Attributes:
        joint: name.
        friction: F [N.m or N].
        damping: B [N.m.s/rad or N.s/m].
        armature: inertia of the motor as the joint sees it [kg.m^2 or kg]; None where the model does not know it.
        velocity: smallest and largest velocity of the fit [rad/s or m/s].
        largest_error: of the torque, against the identified curve [N.m or N].
        rms_error: of the same [N.m or N].
        lost: what the description cannot express, in words.
    """

    joint: str
    friction: float
    damping: float
    armature: float | None
    velocity: tuple[float, float]
    largest_error: float
    rms_error: float
    lost: tuple[str, ...]


def simplify(friction: JointFriction) -> Simple:
    """Return the Coulomb and viscous friction nearest to what was identified, over the velocities that the data covered."""
    law = friction.law
    low, high = friction.validity.velocity
    top = max(abs(low), abs(high))
    slowest = min(friction.validity.lowest_speed or 1e-3 * top, top)
    speeds = np.linspace(slowest, top, SPEEDS)
    velocity = np.concatenate([speeds, -speeds])
    torque = law.torque(velocity)
    F, B = _line(np.abs(velocity), torque * np.sign(velocity))
    error = torque - (F * np.sign(velocity) + B * velocity)
    lost = []
    if law.element.states():
        lost.append(f"presliding ('{law.element.NAME}')")
    forwards, backwards = law.torque(speeds), -law.torque(-speeds)
    if np.abs(forwards - backwards).max() > 1e-6 * np.abs(torque).max():
        lost.append("different friction in the two directions")
    if law.growth is not None or "load" in law.rate.NEEDS:
        lost.append("growth with the load")
    if "temperature" in law.rate.NEEDS:
        lost.append("change with temperature")
    actuator = friction.actuator
    return Simple(
        joint=friction.joint.name,
        friction=float(F),
        damping=float(B),
        armature=None if actuator is None else actuator.motor_inertia,
        velocity=(-top, top),
        largest_error=float(np.abs(error).max()),
        rms_error=float(np.sqrt(np.mean(error**2))),
        lost=tuple(lost),
    )


def _line(speed: np.ndarray, torque: np.ndarray) -> tuple[float, float]:
    """Return F >= 0 and B >= 0 of the line F + B v nearest to a curve, by least squares."""
    slope, intercept = np.polyfit(speed, torque, 1)
    if slope < 0.0:
        return max(float(torque.mean()), 0.0), 0.0
    if intercept < 0.0:
        return 0.0, max(float(speed @ torque / (speed @ speed)), 0.0)
    return float(intercept), float(slope)


def export_description(
    model: FrictionModel,
    robot: str | Path,
    folder: str | Path,
    *,
    joints: Sequence[str] | None = None,
    name: str | None = None,
) -> tuple[list[Path], list[Simple]]:
    """Write a robot description with the friction that was identified, and beside it what it cannot express.

    Args:
        model: of friction.
        robot: URDF or MJCF file; joints are found by their names.
        folder: to write to, made where it is not there.
        joints: names; None: all of the model.
        name: of the file to write; None: that of `robot`.

    Returns:
        Files written, the description and a JSON file of `Simple`s; and these.

    Raises:
        InvalidInput: a joint is not in the description.
        ReadError: the description cannot be read.
        WriteError: the description itself would be replaced, or a file is there that is not ours.
    """
    robot, folder = Path(robot), Path(folder)
    data = read_whole(robot, MAX_BYTES, error=ReadError, remedy="Name a URDF or MJCF file.")
    root = parse(data, str(robot))
    simple = [simplify(model.joint(n)) for n in joints or model.names]
    nodes = _joints(root, robot)
    for each in simple:
        if each.joint not in nodes:
            raise InvalidInput(
                f"{robot} has no joint '{each.joint}'.",
                remedy=f"It has {', '.join(nodes) or 'none with a name'}.",
            )
        _write(root.tag, nodes[each.joint], each)
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


def _joints(root: Any, where: Path) -> dict[str, Any]:
    """Return the joints of a description by name."""
    if root.tag == "robot":
        nodes = root.findall("joint")
    elif root.tag == "mujoco":
        nodes = [node for body in root.iter("worldbody") for node in body.iter("joint")]
    else:
        raise ReadError(
            f"{where} begins with <{root.tag}>.", remedy="Name a URDF (<robot>) or MJCF (<mujoco>) file."
        )
    return {node.get("name"): node for node in nodes if node.get("name")}


def _write(tag: str, node: Any, simple: Simple) -> None:
    """Put the numbers into a joint's element."""
    if tag == "mujoco":
        node.set("frictionloss", repr(simple.friction))
        node.set("damping", repr(simple.damping))
        if simple.armature is not None:
            node.set("armature", repr(simple.armature))
        return
    dynamics = node.find("dynamics")
    if dynamics is None:
        dynamics = ElementTree.SubElement(node, "dynamics")
    dynamics.set("friction", repr(simple.friction))
    dynamics.set("damping", repr(simple.damping))
