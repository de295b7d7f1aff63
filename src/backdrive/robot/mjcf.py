"""MJCF, MuJoCo's robot description, read as a tree of rigid bodies with hinges and slides.

Only compiler, defaults, bodies, joints, inertias, shapes, frames and sites are read. Pinocchio's own MJCF parser is not used.
So no further file is opened, and any version of pinocchio that reads URDF suffices. Springs, dampers, armatures, tendons and
contacts are ignored. An identified model contains the inertia of the motor and the friction.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from backdrive.errors import FileTooLarge, ForbiddenContent, ReadError
from backdrive.robot import mjcf_inertia
from backdrive.robot.bodies import Range, require_pinocchio
from backdrive.robot.mjcf_defaults import Defaults
from backdrive.robot.mjcf_pose import Angles, about, pose, unit
from backdrive.robot.xml import MAX_JOINTS, numbers

MAX_BODIES = 2000
BRANCHES = ("composite", "flexcomp", "replicate", "attach")  # elements that generate bodies
#: Attributes of <compiler> that change the written inertias.
ALTERING = {"settotalmass": "-1", "boundmass": "0", "boundinertia": "0", "balanceinertia": "false"}


@dataclass(kw_only=True)
class Compiler:
    """The settings of `<compiler>` for angles, limits and inertias."""

    angles: Angles = field(default_factory=Angles)
    from_shapes: str = "auto"
    limited: bool = True
    groups: tuple[float, float] = (0.0, 5.0)


def collision_shapes(root: Any, where: str) -> list[Geom]:
    """Return the geoms that may touch another, planes and height fields left out; see `build`."""
    builder = Builder(root, where, shapes=True)
    builder.result()
    return builder.geoms


def build(root: Any, where: str) -> tuple[Any, dict[str, Range], list[str]]:
    """Return pinocchio's model, what each joint is allowed, and remarks.

    Args:
        root: element `<mujoco>`.
        where: what to call the file in messages.

    Raises:
        ReadError: the bodies form no tree of hinges and slides, or a mass would come from a mesh.
        ForbiddenContent: it includes another file.
        FileTooLarge: it has more joints than any arm.
    """
    if next(root.iter("include"), None) is not None:
        raise ForbiddenContent(
            f"{where} includes other files.", remedy="Save it as one file (mj_saveLastXML in MuJoCo)."
        )
    branching = next((node for node in root.iter() if node.tag in BRANCHES), None)
    if branching is not None:
        raise ReadError(
            f"{where}: <{branching.tag}> generates bodies that are not in the file.",
            remedy="Save the compiled model as one file (mj_saveLastXML in MuJoCo).",
        )
    loops = [n for e in root.findall("equality") for n in e if n.tag in ("connect", "weld")]
    if loops:
        raise ReadError(
            f"{where}: <{loops[0].tag} {loops[0].get('name') or ''}> closes a chain of bodies.",
            remedy="Loops are not supported: remove it, or make what it holds part of one body.",
        )
    for tag, most in (("joint", MAX_JOINTS), ("body", MAX_BODIES)):
        count = sum(1 for _ in root.iter(tag))
        if count > most:
            raise FileTooLarge(f"{where} has {count} <{tag}>.", remedy=f"At most {most} are read.")
    return Builder(root, where).result()


@dataclass(frozen=True, kw_only=True)
class Geom:
    """A shape of a body.

    Attributes:
        body: name.
        kind: as MJCF calls it.
        placement: in the body, (4, 4).
        size: as MJCF has it [m]; empty for a mesh.
    """

    body: str
    kind: str
    placement: np.ndarray
    size: tuple[float, ...]


class Builder:
    """Walks the bodies and adds them to pinocchio's model."""

    def __init__(self, root: Any, where: str, shapes: bool = False):
        self.pin = require_pinocchio()
        self.root, self.where = root, where
        self.compiler = compiler_of(root, where)
        self.defaults = Defaults(root, where)
        self.model = self.pin.Model()
        self.model.name = root.get("model") or "robot"
        self.ranges: dict[str, Range] = {}
        self.geoms: list[Geom] = []
        self.shapes = shapes
        self.names: dict[str, set[str]] = {"body": set(), "joint": set(), "site": set()}

    def result(self) -> tuple[Any, dict[str, Range], list[str]]:
        """Return what `build` returns."""
        for option in self.root.findall("option"):
            if option.get("gravity") is not None:
                g = numbers(option.get("gravity"), (3,), f"{self.where}: gravity")
                self.model.gravity.linear = np.array(g)
        # element, number of the joint that moves it, its placement there, the class of its children
        waiting = [(world, 0, np.eye(4), world.get("childclass")) for world in self.root.findall("worldbody")]
        while waiting:
            waiting = [*self.body(*waiting[0]), *waiting[1:]]
        unlimited = [n for n, r in self.ranges.items() if r.lower == -np.inf]
        remarks = [f"The description states no range of {', '.join(unlimited)}: taken as without."]
        remarks = remarks if unlimited else []
        tied = [n.get("joint1") or "" for e in self.root.findall("equality") for n in e if n.tag == "joint"]
        if tied:
            remarks.append(
                f"An <equality> ties {', '.join(tied)} in the description; here each is a joint of its own. Remove its joint "
                f"if it is not in the log."
            )
        return self.model, self.ranges, remarks

    def body(
        self, node: Any, parent: int, placed: np.ndarray, style: str | None
    ) -> list[tuple[Any, int, np.ndarray, str | None]]:
        """Add a body, or what a frame holds, and return what hangs on it."""
        where = f"{self.where}: body '{node.get('name') or 'without a name'}'"
        if node.tag == "body":
            for child, at, of in _flat(node, np.eye(4), style, self.compiler.angles, where):
                if child.tag in ("joint", "freejoint"):
                    parent, placed = self.joint(child, parent, placed, at, of, where)
            self.inertia(node, parent, placed, style, where)
            name = self.name(node, "body")
            kind = self.pin.FrameType.BODY
            self.model.addFrame(self.pin.Frame(name, parent, 0, self.pin.SE3(placed), kind), False)
            for child, at, of in _flat(node, np.eye(4), style, self.compiler.angles, where):
                if child.tag == "geom" and self.shapes:
                    self.geoms += self.geom(name, child, at, of, where)
        hanging = []
        for child, at, of in _flat(node, placed, style, self.compiler.angles, where):
            if child.tag == "site":
                site = self.defaults.attributes(child, of)
                there = at @ pose(site, self.compiler.angles, f"{where}: site")
                tool = self.pin.Frame(
                    self.name(child, "site"), parent, 0, self.pin.SE3(there), self.pin.FrameType.OP_FRAME
                )
                self.model.addFrame(tool, False)
            elif child.tag == "body":
                below = child.get("childclass") or of
                there = at @ pose(child.attrib, self.compiler.angles, where)
                hanging.append((child, parent, there, below))
        return hanging

    def joint(
        self, node: Any, parent: int, placed: np.ndarray, at: np.ndarray, style: str | None, where: str
    ) -> tuple[int, np.ndarray]:
        """Add a joint; return its number, and the body's placement behind it. `at`: of the joint's frame in the body."""
        x = self.defaults.attributes(node, style)
        name, kind = self.name(node, "joint"), x.get("type", "hinge")
        if node.tag == "freejoint" or kind not in ("hinge", "slide"):
            raise ReadError(
                f"{where}: joint '{name}' is {'free' if node.tag == 'freejoint' else kind}.",
                remedy="An arm's joints have one degree of freedom, hinge or slide.",
            )
        along = np.array(numbers(x.get("axis", "0 0 1"), (3,), f"{where}: axis"))
        axis = at[:3, :3] @ unit(along, f"{where}: axis of '{name}'")
        anchor = np.eye(4)
        place = np.array(numbers(x.get("pos", "0 0 0"), (3,), f"{where}: pos of '{name}'"))
        anchor[:3, 3] = at[:3, :3] @ place + at[:3, 3]
        scale = self.compiler.angles.unit if kind == "hinge" else 1.0
        reference = scale * numbers(x.get("ref", "0"), (1,), f"{where}: ref of '{name}'")[0]
        back = np.eye(4)
        if kind == "hinge":
            back[:3, :3] = about(axis, -reference)
        else:
            back[:3, 3] = -reference * axis
        there = self.pin.SE3(placed @ anchor @ back)
        number = self.model.addJoint(parent, self.moving(kind, axis), there, name)
        self.model.addJointFrame(number)
        self.ranges[name] = self.range(x, scale, f"{where}: joint '{name}'")
        return number, np.linalg.inv(anchor)

    def moving(self, kind: str, axis: np.ndarray) -> Any:
        """Return pinocchio's joint about or along an axis."""
        family = "Revolute" if kind == "hinge" else "Prismatic"
        short = "R" if kind == "hinge" else "P"
        for letter, along in zip("XYZ", np.eye(3), strict=True):
            if np.array_equal(axis, along):
                return getattr(self.pin, f"JointModel{short}{letter}")()
        return getattr(self.pin, f"JointModel{family}Unaligned")(axis)

    def range(self, x: dict[str, str], scale: float, where: str) -> Range:
        """Return the limits of a joint."""
        limits: dict[str, float] = {}
        lower, upper = numbers(x.get("range", "0 0"), (2,), f"{where}: range")
        limiting = ("true", "auto") if self.compiler.limited else ("true",)
        if lower < upper and x.get("limited", "auto") in limiting:
            limits |= {"lower": scale * lower, "upper": scale * upper}
        effort = numbers(x.get("actuatorfrcrange", "0 0"), (2,), f"{where}: actuatorfrcrange")
        most = min(-effort[0], effort[1])
        return Range(**limits, **({"effort": most} if most > 0.0 else {}))

    def inertia(self, node: Any, parent: int, placed: np.ndarray, style: str | None, where: str) -> None:
        """Add a body's mass to the joint that moves it; bodies fixed to the world are ignored."""
        if parent == 0:
            return
        written, angles = node.find("inertial"), self.compiler.angles
        if written is not None and self.compiler.from_shapes != "true":
            mass, center, about_center = mjcf_inertia.inertia_of(written.attrib, angles, where)
        else:
            parts = []
            if self.compiler.from_shapes != "false":
                for child, at, of in _flat(node, np.eye(4), style, angles, where):
                    if child.tag == "geom":
                        parts += self.shape(child, at, of, where)
            mass, center, about_center = mjcf_inertia.total(parts)
        if mass > 0.0:
            inertia = self.pin.Inertia(mass, center, 0.5 * (about_center + about_center.T))
            self.model.appendBodyToJoint(parent, inertia, self.pin.SE3(placed))

    def shape(self, node: Any, at: np.ndarray, style: str | None, where: str) -> list[mjcf_inertia.Inertia]:
        """Return a list with the inertia of a geom in its body; an empty list if it has none."""
        x = self.defaults.attributes(node, style)
        group = float(numbers(x.get("group", "0"), (1,), f"{where}: group")[0])
        if not self.compiler.groups[0] <= group <= self.compiler.groups[1]:
            return []
        part = mjcf_inertia.of_shape(x, self.compiler.angles, f"{where}: geom '{node.get('name') or ''}'")
        if part is None:
            return []
        mass, center, inertia = part
        turned = at[:3, :3]
        return [(mass, at[:3, :3] @ center + at[:3, 3], turned @ inertia @ turned.T)]

    def geom(self, body: str, node: Any, at: np.ndarray, style: str | None, where: str) -> list[Geom]:
        """Return the shape of a geom in a list, an empty one where it touches nothing."""
        x = self.defaults.attributes(node, style)
        touches = any(x.get(name, "1") != "0" for name in ("contype", "conaffinity"))
        kind = "mesh" if "mesh" in x else x.get("type", "sphere")
        if not touches or kind in mjcf_inertia.WEIGHTLESS:
            return []
        if kind not in mjcf_inertia.SIZES:
            return [Geom(body=body, kind=kind, placement=at, size=())]
        label = f"{where}: geom '{node.get('name') or ''}'"
        placed, size = mjcf_inertia.dimensions(x, self.compiler.angles, label)
        return [Geom(body=body, kind=kind, placement=at @ placed, size=tuple(size))]

    def name(self, node: Any, kind: str) -> str:
        """Return the name of an element, or one with its number where it has none.

        Raises:
            ReadError: another has the same.
        """
        names = self.names[kind]
        name = node.get("name") or f"{kind}_{len(names)}"
        if name in names:
            raise ReadError(f"{self.where}: two of <{kind}> are called '{name}'.", remedy="Rename one.")
        names.add(name)
        return name


def _flat(
    node: Any, placed: np.ndarray, style: str | None, angles: Angles, where: str
) -> list[tuple[Any, np.ndarray, str | None]]:
    """Return the children of a body with their placements and classes, those in frames among them."""
    children, waiting = [], [(child, placed, style) for child in node]
    while waiting:
        child, at, of = waiting.pop(0)
        if child.tag == "frame":
            inside = at @ pose(child.attrib, angles, f"{where}: frame")
            waiting = [(x, inside, child.get("childclass") or of) for x in child] + waiting
        else:
            children.append((child, at, of))
    return children


def compiler_of(root: Any, where: str) -> Compiler:
    """Return what `<compiler>` says; later ones add to earlier ones.

    Raises:
        ReadError: it changes inertias, or has an unknown setting.
    """
    x: dict[str, str] = {}
    for node in root.findall("compiler"):
        x |= node.attrib
    for key, usual in ALTERING.items():
        if x.get(key, usual) != usual and x[key] not in ("0", "false"):
            raise ReadError(
                f'{where}: <compiler {key}="{x[key]}"> changes the inertias that are written.',
                remedy="Save the compiled model as one file (mj_saveLastXML in MuJoCo).",
            )
    sequence, angle = x.get("eulerseq", "xyz"), x.get("angle", "degree")
    if len(sequence) != 3 or set(sequence.lower()) - set("xyz") or angle not in ("degree", "radian"):
        raise ReadError(
            f'{where}: <compiler angle="{angle}" eulerseq="{sequence}">.', remedy="See MuJoCo's reference."
        )
    if x.get("coordinate", "local") != "local":
        raise ReadError(f"{where}: global coordinates.", remedy="Use local ones, as MuJoCo since 2.3.4.")
    first, last = numbers(x.get("inertiagrouprange", "0 5"), (2,), f"{where}: inertiagrouprange")
    return Compiler(
        angles=Angles(unit=1.0 if angle == "radian" else np.pi / 180.0, sequence=sequence),
        from_shapes=x.get("inertiafromgeom", "auto"),
        limited=x.get("autolimits", "true") == "true",
        groups=(first, last),
    )
