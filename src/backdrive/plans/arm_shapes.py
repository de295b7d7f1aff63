"""The shapes of an arm's links by its URDF or MJCF, for self-collision: primitives, and convex hulls of a URDF's meshes.

A description may come from an untrusted source. So meshes are opened only if a folder of packages is given, and only below this
folder or beside the URDF. A hull contains its mesh, so if hulls do not touch, neither do the links. If meshes are not opened, a
capsule may replace a link. It extends from the link's joint to the next one; its thickness is that of a rod with the link's
inertia about this line.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from backdrive._files import read_whole
from backdrive.errors import InvalidInput, MissingExtra, ReadError, require
from backdrive.plans.limits import MAX_BYTES
from backdrive.robot import Robot, mjcf
from backdrive.robot.mjcf_pose import along_z
from backdrive.robot.xml import numbers, parse

MESH_BYTES = 100_000_000
MOST_SHAPES = 200
THINNEST = 0.02  # least radius of a capsule that replaces a link [m]


@dataclass(frozen=True, kw_only=True, eq=False)
class Shape:
    """A convex body that moves with a joint.

    Attributes:
        link: that it belongs to.
        joint: number of the joint that carries it in pinocchio's model, 0 for the base.
        placement: in that joint's frame, (4, 4).
        geometry: of coal.
        middle: of a ball that contains it, in the joint's frame [m], (3,).
        radius: of that ball [m].
    """

    link: str
    joint: int
    placement: np.ndarray
    geometry: Any
    middle: np.ndarray
    radius: float


def require_coal() -> Any:
    """Return coal, or hpp-fcl, as it was called before.

    Raises:
        MissingExtra: neither is installed.
    """
    try:
        return require("coal", "Self-collision needs", "arm")
    except MissingExtra:
        return require("hppfcl", "Self-collision needs", "arm")


def read_shapes(
    urdf: str | Path, robot: Robot, packages: str | Path | None = None
) -> tuple[list[Shape], list[str]]:
    """Return the shapes of all links, and the links whose meshes could not be read.

    Args:
        urdf: path of the description, URDF or MJCF.
        robot: read from it; tools may be held.
        packages: folder in which `package://` begins; None: meshes are left out.

    Raises:
        MissingExtra: coal is not installed.
        ReadError: a mesh is missing or unreadable, or a number is none.
        InvalidInput: the folder does not exist.
    """
    if packages is not None and not Path(packages).is_dir():
        raise InvalidInput(
            f"--packages {packages} is no folder.", remedy="Name the folder that holds the packages."
        )
    coal = require_coal()
    root = parse(read_whole(urdf, MAX_BYTES, remedy="Name the URDF of an arm."), str(urdf))
    frames = {f.name: f for f in robot.model.frames}
    shapes: list[Shape] = []
    without: list[str] = []
    for geom in mjcf.collision_shapes(root, str(urdf)) if root.tag == "mujoco" else ():
        if geom.body not in frames:
            continue
        if not geom.size:
            without.append(geom.body)
            continue
        joint, placed = _carrier(frames[geom.body])
        shapes.append(_shape(geom.body, joint, placed @ geom.placement, _primitive(coal, geom)))
    for link in root.findall("link"):
        name = link.get("name") or ""
        for node in link.findall("collision"):
            if name not in frames:
                continue
            geometry = _geometry(coal, node, name, Path(urdf), packages)
            if geometry is None:
                without.append(name)
                continue
            joint, placed = _carrier(frames[name])
            shapes.append(_shape(name, joint, placed @ _origin(node.find("origin"), name), geometry))
    if len(shapes) > MOST_SHAPES:
        raise InvalidInput(
            f"{urdf} has {len(shapes)} shapes.", remedy=f"Reduce them to at most {MOST_SHAPES}."
        )
    return shapes, list(dict.fromkeys(without))


def capsules(robot: Robot, links: Sequence[str]) -> tuple[list[Shape], list[str]]:
    """Return capsules that replace links, and the links with too little data for one.

    Args:
        robot: the description.
        links: names; those that move together get one.
    """
    coal, model = require_coal(), robot.model
    frames = {f.name: f for f in model.frames}
    shapes: list[Shape] = []
    without: list[str] = []
    covered: set[int] = {0}
    for link in links:
        joint = _carrier(frames[link])[0]
        body = model.inertias[joint]
        if joint in covered or not body.mass > 0.0:
            without += [link] if joint == 0 or joint not in covered else []
            continue
        covered.add(joint)
        center = np.asarray(body.lever).ravel()
        ends = [np.asarray(model.jointPlacements[k].translation).ravel() for k in _children(model, joint)]
        end = max(ends, key=np.linalg.norm) if ends else 2.0 * center
        length = float(np.linalg.norm(end))
        along = end / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
        radius = float(np.sqrt(max(2.0 * (along @ np.asarray(body.inertia) @ along) / body.mass, 0.0)))
        placement = np.eye(4)
        placement[:3, :3], placement[:3, 3] = along_z(along), 0.5 * end
        shapes.append(_shape(link, joint, placement, coal.Capsule(max(radius, THINNEST), length)))
    return shapes, without


def _children(model: Any, joint: int) -> list[int]:
    return [k for k in range(1, model.njoints) if model.parents[k] == joint]


def _carrier(frame: Any) -> tuple[int, np.ndarray]:
    """Return the joint that carries a frame, and its placement there, (4, 4)."""
    joint = int(frame.parentJoint if hasattr(frame, "parentJoint") else frame.parent)
    return joint, frame.placement.homogeneous


def _primitive(coal: Any, geom: mjcf.Geom) -> Any:
    """Return a geom as a shape of coal; MJCF states halves."""
    size = list(geom.size)
    if geom.kind == "box":
        return coal.Box(*(2.0 * x for x in size[:3]))
    if geom.kind == "sphere":
        return coal.Sphere(size[0])
    if geom.kind == "ellipsoid":
        return coal.Ellipsoid(*size[:3])
    return {"cylinder": coal.Cylinder, "capsule": coal.Capsule}[geom.kind](size[0], 2.0 * size[1])


def floor_at(height: float) -> Shape:
    """Return a slab whose top lies at a height in the base's frame [m]."""
    placement = np.eye(4)
    placement[2, 3] = height - 5.0
    return _shape("the floor", 0, placement, require_coal().Box(100.0, 100.0, 10.0))


def _shape(link: str, joint: int, placement: np.ndarray, geometry: Any) -> Shape:
    geometry.computeLocalAABB()
    middle = placement[:3, :3] @ np.asarray(geometry.aabb_center).ravel() + placement[:3, 3]
    return Shape(
        link=link,
        joint=joint,
        placement=placement,
        geometry=geometry,
        middle=middle,
        radius=float(geometry.aabb_radius),
    )


def _numbers(text: str | None, count: int, link: str, usual: str = "") -> list[float]:
    return numbers(usual if text is None else text, (count,), f"A collision shape of link '{link}'")


def _origin(node: Any, link: str) -> np.ndarray:
    """Return the placement of an <origin>, (4, 4)."""
    placement = np.eye(4)
    if node is not None:
        placement[:3, 3] = _numbers(node.get("xyz"), 3, link, "0 0 0")
        (cr, cp, cy), (sr, sp, sy) = (
            f(_numbers(node.get("rpy"), 3, link, "0 0 0")) for f in (np.cos, np.sin)
        )
        placement[:3, :3] = [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    return placement


def _geometry(coal: Any, node: Any, link: str, urdf: Path, packages: str | Path | None) -> Any:
    """Return a shape of coal; None for a mesh that is not to be opened."""
    inside = node.find("geometry")
    shape = next(iter(inside), None) if inside is not None else None
    if shape is None:
        return None
    if shape.tag == "box":
        return coal.Box(*_numbers(shape.get("size"), 3, link))
    if shape.tag in ("sphere", "cylinder", "capsule"):
        radius = _numbers(shape.get("radius"), 1, link)
        length = _numbers(shape.get("length"), 1, link) if shape.tag != "sphere" else []
        return {"sphere": coal.Sphere, "cylinder": coal.Cylinder, "capsule": coal.Capsule}[shape.tag](
            *radius, *length
        )
    if shape.tag != "mesh":
        raise ReadError(
            f"Link '{link}': a collision shape <{shape.tag}>.",
            remedy="Use box, sphere, cylinder, capsule or mesh.",
        )
    if packages is None:
        return None
    return _hull(coal, _mesh_path(shape.get("filename") or "", link, urdf, Path(packages)), shape, link)


def _mesh_path(name: str, link: str, urdf: Path, packages: Path) -> Path:
    """Return where a mesh lies, below the folder of packages or that of the URDF."""
    scheme, _, rest = name.rpartition("://")
    roots = [packages] if scheme == "package" else [urdf.parent, packages]
    for folder in roots if scheme in ("", "package", "file") else []:
        path = (folder / rest.lstrip("/")).resolve()
        if path.is_relative_to(folder.resolve()) and path.is_file():
            if path.stat().st_size > MESH_BYTES:
                raise ReadError(
                    f"Link '{link}': {path} has more than {MESH_BYTES // 10**6} MB.",
                    remedy="Name a plainer mesh for collisions.",
                )
            return path
    raise ReadError(
        f"Link '{link}': there is no mesh '{name}' below {packages}.",
        remedy="Let --packages name the folder in which the path after package:// begins, or leave it out.",
    )


def _hull(coal: Any, path: Path, shape: Any, link: str) -> Any:
    """Return the convex hull of a mesh."""
    scale = np.array(_numbers(shape.get("scale"), 3, link, "1 1 1"))
    try:
        mesh = coal.MeshLoader().load(str(path), scale)
        mesh.buildConvexHull(True, "Qt")
    except (ValueError, RuntimeError) as error:
        raise ReadError(
            f"Link '{link}': the mesh {path} cannot be read: {error}.",
            remedy="Give an STL or DAE file with volume, or leave --packages out.",
        ) from error
    return mesh.convex
