"""Rigid bodies of an arm from its URDF, in plain NumPy: Newton and Euler's equations along the chain.

Nothing here comes from the package or from pinocchio. Joints that are not named are held at zero; bodies that hang on one moving
joint are one body. For body i in the frame of its joint, with velocity w, acceleration a of the origin (less gravity), turning x:

    force  = m a + x x c + w x (w x c),      moment about the origin = c x a + I x + w x (I w),      c: first moment
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np

GRAVITY = 9.81
PARAMETERS = 10  # m, c (3), Ixx, Ixy, Iyy, Ixz, Iyz, Izz


def numbers(text: str | None, usual: str) -> np.ndarray:
    return np.array([float(x) for x in (text or usual).split()])


def origin(node) -> tuple[np.ndarray, np.ndarray]:
    """Return rotation and place of an <origin>."""
    here = node.find("origin")
    if here is None:
        return np.eye(3), np.zeros(3)
    r, p, y = numbers(here.get("rpy"), "0 0 0")
    about = (
        np.array([[1, 0, 0], [0, np.cos(r), -np.sin(r)], [0, np.sin(r), np.cos(r)]]),
        np.array([[np.cos(p), 0, np.sin(p)], [0, 1, 0], [-np.sin(p), 0, np.cos(p)]]),
        np.array([[np.cos(y), -np.sin(y), 0], [np.sin(y), np.cos(y), 0], [0, 0, 1]]),
    )
    return about[2] @ about[1] @ about[0], numbers(here.get("xyz"), "0 0 0")


def cross(v: np.ndarray) -> np.ndarray:
    """Return the matrices of cross products, (..., 3, 3)."""
    out = np.zeros((*v.shape[:-1], 3, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return out


def of_inertia(v: np.ndarray) -> np.ndarray:
    """Return the matrices with I v = matrix (Ixx, Ixy, Iyy, Ixz, Iyz, Izz), (..., 3, 6)."""
    x, y, z, o = v[..., 0], v[..., 1], v[..., 2], np.zeros(v.shape[:-1])
    rows = [[x, y, o, z, o, o], [o, x, y, o, z, o], [o, o, o, x, y, z]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


class Chain:
    """A serial arm.

    Attributes:
        parameters: ten numbers a joint, (10 J,).
    """

    def __init__(self, urdf: Path, joints: tuple[str, ...]):
        """Read the chain of some revolute joints, in order from the base."""
        root = ElementTree.parse(urdf).getroot()
        links = {node.get("name"): node for node in root.findall("link")}
        children: dict[str, list] = {}
        for joint in root.findall("joint"):
            children.setdefault(joint.find("parent").get("link"), []).append(joint)
        inner = {joint.find("child").get("link") for joint in root.findall("joint")}
        base = next(name for name in links if name not in inner)
        self.joints, self.turns, self.places, self.axes = joints, [], [], []
        theta = [np.zeros(PARAMETERS) for _ in joints]

        def walk(link: str, number: int, R: np.ndarray, p: np.ndarray) -> None:
            if number >= 0:
                theta[number] += body(links[link], R, p)
            for joint in children.get(link, []):
                turn, place = origin(joint)
                turn, place = R @ turn, R @ place + p
                child = joint.find("child").get("link")
                if joint.get("name") in joints:
                    assert joints[number + 1] == joint.get("name")
                    axis = joint.find("axis")
                    self.turns.append(turn)
                    self.places.append(place)
                    self.axes.append(numbers(None if axis is None else axis.get("xyz"), "1 0 0"))
                    walk(child, number + 1, np.eye(3), np.zeros(3))
                else:
                    walk(child, number, turn, place)

        walk(base, -1, np.eye(3), np.zeros(3))
        self.parameters = np.concatenate(theta)

    def regressor(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        """Return Y with tau = Y parameters, (n, J, 10 J)."""
        n, J = q.shape
        w, x = np.zeros((n, 3)), np.zeros((n, 3))
        a = np.tile([0.0, 0.0, GRAVITY], (n, 1))
        motions, turned = [], []
        for i in range(J):
            axis, place = self.axes[i], self.places[i]
            K = cross(axis)
            own = (
                np.eye(3)
                + np.sin(q[:, i])[:, None, None] * K
                + (1 - np.cos(q[:, i]))[:, None, None] * (K @ K)
            )
            R = self.turns[i] @ own  # from this joint's frame to the one before
            a = a + np.cross(x, place) + np.cross(w, np.cross(w, place))
            w, x, a = (np.einsum("nij,ni->nj", R, v) for v in (w, x, a))
            x = x + np.outer(ddq[:, i], axis) + np.cross(w, np.outer(dq[:, i], axis))
            w = w + np.outer(dq[:, i], axis)
            motions.append((w, x, a))
            turned.append(R)
        out = np.zeros((n, J, PARAMETERS * J))
        for i, (w, x, a) in enumerate(motions):
            force, moment = np.zeros((n, 3, PARAMETERS)), np.zeros((n, 3, PARAMETERS))
            force[:, :, 0] = a
            force[:, :, 1:4] = cross(x) + cross(w) @ cross(w)
            moment[:, :, 1:4] = -cross(a)
            moment[:, :, 4:] = of_inertia(x) + cross(w) @ of_inertia(w)
            own = slice(PARAMETERS * i, PARAMETERS * (i + 1))
            for j in range(i, -1, -1):
                out[:, j, own] = np.einsum("k,nkp->np", self.axes[j], moment)
                force = np.einsum("nij,njp->nip", turned[j], force)
                moment = np.einsum("nij,njp->nip", turned[j], moment) + np.einsum(
                    "ij,njp->nip", cross(self.places[j]), force
                )
        return out

    def base(self) -> np.ndarray:
        """Return orthogonal combinations of the parameters that torque can tell, (10 J, b)."""
        q, dq, ddq = np.random.default_rng(7).uniform(-3, 3, (3, 40 * len(self.joints), len(self.joints)))
        stacked = self.regressor(q, dq, ddq).reshape(-1, self.parameters.size)
        _, size, right = np.linalg.svd(stacked, full_matrices=False)
        return right[size > 1e-9 * size[0]].T


def body(link, R: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Return the ten numbers of a link whose frame is turned by R and lies at p."""
    inertial = link.find("inertial")
    if inertial is None:
        return np.zeros(PARAMETERS)
    mass = float(inertial.find("mass").get("value"))
    turn, center = origin(inertial)
    node = inertial.find("inertia")
    xx, xy, xz, yy, yz, zz = (float(node.get(k) or 0) for k in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
    about = R @ turn @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ (R @ turn).T
    d = R @ center + p
    about = about + mass * (d @ d * np.eye(3) - np.outer(d, d))
    return np.array(
        [mass, *(mass * d), about[0, 0], about[0, 1], about[1, 1], about[0, 2], about[1, 2], about[2, 2]]
    )
