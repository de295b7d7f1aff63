"""A robot from its description, URDF or MJCF, told apart by what the file holds."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np

from backdrive._files import read_whole
from backdrive.errors import ReadError
from backdrive.robot import mjcf, urdf
from backdrive.robot.bodies import Range, Robot, require_pinocchio
from backdrive.robot.xml import parse

MAX_BYTES = 20_000_000


def load_robot(path: str | Path) -> Robot:
    """Read a robot description.

    Args:
        path: of a URDF file, xacro expanded, or of an MJCF file without includes.

    Raises:
        MissingExtra: pinocchio or defusedxml are not installed.
        ReadError: the file is missing, is neither, or has a joint of more than one degree of freedom.
        ForbiddenContent: the file has a document type or entities, or includes others.
        FileTooLarge: no arm needs that many bytes or joints.
    """
    content = read_whole(path, MAX_BYTES, remedy="Name the description of an arm.")
    return parse_robot(content, str(path))


def parse_robot(content: bytes | str, where: str = "the robot description") -> Robot:
    """Build a robot from the text of a description; see `load_robot`.

    Args:
        content: the text.
        where: what to call it in messages.
    """
    require_pinocchio()
    data = content.encode() if isinstance(content, str) else content
    root = parse(data, where)
    reader = mjcf if root.tag == "mujoco" else urdf
    model, ranges, remarks = reader.build(root, where)
    names, joints = list(model.names)[1:], list(model.joints)[1:]
    wide = [name for name, j in zip(names, joints, strict=True) if j.nv != 1]
    if wide or not joints:
        raise ReadError(
            f"{where}: {'joints ' + ', '.join(wide) + ' have' if wide else 'no joint has'} one degree of freedom"
            + (" too few or too many." if wide else "."),
            remedy="Use revolute, continuous, prismatic and fixed joints only.",
        )
    robot = Robot(
        name=str(model.name),
        joints=tuple(names),
        units=tuple("m" if j.shortname().startswith("JointModelP") else "rad" for j in joints),
        sha256=hashlib.sha256(data).hexdigest(),
        model=model,
        ranges=tuple(ranges.get(name, Range()) for name in names),
        remarks=(*remarks, *massless(model)),
    )
    placements = np.array([m.homogeneous for m in model.jointPlacements])
    if not (np.all(np.isfinite(robot.parameters)) and np.all(np.isfinite(placements))):
        raise ReadError(
            f"{where} holds numbers that are not finite.", remedy="Correct its origins and inertias."
        )
    return robot


def _is_of_a_body(moments: np.ndarray) -> bool:
    """Return whether principal moments of inertia, in order of size, are those of a body."""
    return bool(moments[2] <= moments[0] + moments[1] + 1e-6 * abs(moments[2]) + 1e-12)


def massless(model) -> list[str]:
    """Return sentences on joints without mass on their link, or on it and beyond it, and on inertias that no body has."""
    names = list(model.names)
    empty = [
        names[i]
        for i in range(1, len(names))
        if not any(model.inertias[k].mass > 0.0 for k in model.subtrees[i])
    ]
    bare = [
        names[i] for i in range(1, len(names)) if names[i] not in empty and not model.inertias[i].mass > 0.0
    ]
    said = [
        f"The link that {name} moves, with what is fixed to it, has no mass in the description: only links beyond it have."
        for name in bare
    ]
    odd = [
        names[i]
        for i in range(1, len(names))
        if not _is_of_a_body(np.linalg.eigvalsh(np.array(model.inertias[i].inertia)))
    ]
    if odd:
        said.append(
            f"No body has the inertia of the link of {', '.join(odd)}: one moment exceeds the sum of the two others. Correct "
            f"it, or rely on identified bodies only."
        )
    if not empty:
        return said
    return [
        *said,
        f"No link that {', '.join(empty)} moves has an <inertial>, so the description contains no mass there; an identified "
        f"model has its own bodies.",
    ]
