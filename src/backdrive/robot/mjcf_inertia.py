"""Inertias of MJCF bodies: as written in `<inertial>`, or of the shapes that a body is made of.

An inertia here is a triple: mass [kg], center (3,) [m], and inertia about the center along the axes of the body (3, 3) [kg.m^2].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from backdrive.errors import ReadError
from backdrive.robot.mjcf_pose import Angles, along_z, pose, unit
from backdrive.robot.xml import numbers

Inertia = tuple[float, np.ndarray, np.ndarray]

DENSITY = 1000.0  # of a shape that states neither density nor mass [kg/m^3]
WEIGHTLESS = ("plane", "hfield")
SIZES = {"sphere": 1, "box": 3, "ellipsoid": 3, "cylinder": 2, "capsule": 2}
ENDS = ("capsule", "cylinder", "box", "ellipsoid")  # shapes that may be stated by their two ends


def inertia_of(attributes: Mapping[str, str], angles: Angles, where: str) -> Inertia:
    """Return the inertia of an `<inertial>`.

    Raises:
        ReadError: mass or inertia is missing or impossible.
    """
    if "mass" not in attributes or "pos" not in attributes:
        raise ReadError(f"{where}: <inertial> lacks its mass or pos.", remedy="State both.")
    mass = numbers(attributes["mass"], (1,), f"{where}: mass")[0]
    placed = pose(attributes, angles, where)
    if "fullinertia" in attributes:
        xx, yy, zz, xy, xz, yz = numbers(attributes["fullinertia"], (6,), f"{where}: fullinertia")
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    elif "diaginertia" in attributes:
        inertia = np.diag(numbers(attributes["diaginertia"], (3,), f"{where}: diaginertia"))
    else:
        raise ReadError(
            f"{where}: <inertial> states no inertia.", remedy="Write its diaginertia or fullinertia."
        )
    if mass < 0.0 or float(np.linalg.eigvalsh(inertia)[0]) < 0.0:
        raise ReadError(f"{where}: <inertial> has a negative mass or inertia.", remedy="Correct it.")
    turned = placed[:3, :3]
    return mass, placed[:3, 3], turned @ inertia @ turned.T


def of_shape(attributes: Mapping[str, str], angles: Angles, where: str) -> Inertia | None:
    """Return the inertia of a `<geom>`; None of one that weighs nothing.

    Raises:
        ReadError: its mass comes from a mesh, which is not read, or its size is missing.
    """
    kind = attributes.get("type", "sphere")
    mass = numbers(attributes["mass"], (1,), f"{where}: mass")[0] if "mass" in attributes else None
    density = numbers(attributes.get("density", str(DENSITY)), (1,), f"{where}: density")[0]
    if kind in WEIGHTLESS or mass == 0.0 or (mass is None and density == 0.0):
        return None
    if kind in ("mesh", "sdf") or "mesh" in attributes:
        raise ReadError(
            f"{where}: its mass would come from a mesh, and meshes are not read.",
            remedy="Write an <inertial> with pos, mass and inertia in this body.",
        )
    if kind not in SIZES or attributes.get("shellinertia", "false") != "false":
        raise ReadError(
            f"{where}: a geom of type '{kind}' has no mass that is known here.",
            remedy="Write an <inertial> in this body.",
        )
    placed, size = dimensions(attributes, angles, where)
    volume, moments = unit_shape(kind, size)
    mass = density * volume if mass is None else mass
    turned = placed[:3, :3]
    return mass, placed[:3, 3], mass * turned @ np.diag(moments) @ turned.T


def dimensions(attributes: Mapping[str, str], angles: Angles, where: str) -> tuple[np.ndarray, list[float]]:
    """Return placement of a shape of `SIZES` in its body, (4, 4), and its sizes in MJCF's convention [m].

    Raises:
        ReadError: a size is missing or no number.
    """
    kind = attributes.get("type", "sphere")
    size = [abs(x) for x in numbers(attributes.get("size", ""), (1, 2, 3), f"{where}: size of a {kind}")]
    placed = pose(attributes, angles, where)
    if "fromto" in attributes and kind in ENDS:
        ends = np.array(numbers(attributes["fromto"], (6,), f"{where}: fromto"))
        along = ends[:3] - ends[3:]
        placed[:3, :3], placed[:3, 3] = along_z(unit(along, f"{where}: fromto")), 0.5 * (ends[:3] + ends[3:])
        half = 0.5 * float(np.linalg.norm(along))
        size = [size[0], half] if SIZES[kind] == 2 else [size[0], size[0], half]
    if len(size) < SIZES[kind]:
        raise ReadError(f"{where}: a {kind} of {len(size)} sizes.", remedy=f"Write {SIZES[kind]} of them.")
    return placed, size


def unit_shape(kind: str, size: Sequence[float]) -> tuple[float, tuple[float, float, float]]:
    """Return the volume [m^3] of a shape and its principal moments of inertia by its mass [m^2]."""
    if kind == "sphere":
        r = size[0]
        return 4.0 / 3.0 * np.pi * r**3, (0.4 * r * r, 0.4 * r * r, 0.4 * r * r)
    if kind in ("box", "ellipsoid"):
        a, b, c = (x * x for x in size[:3])
        part, whole = (3.0, 8.0) if kind == "box" else (5.0, 4.0 / 3.0 * np.pi)
        return whole * size[0] * size[1] * size[2], ((b + c) / part, (a + c) / part, (a + b) / part)
    r, h = size[:2]
    tube, caps = 2.0 * np.pi * r * r * h, 4.0 / 3.0 * np.pi * r**3
    if kind == "cylinder":
        across = (3.0 * r * r + 4.0 * h * h) / 12.0
        return tube, (across, across, 0.5 * r * r)
    across = tube * (3.0 * r * r + 4.0 * h * h) / 12.0 + caps * (0.4 * r * r + h * h + 0.75 * h * r)
    about_axis = tube * 0.5 * r * r + caps * 0.4 * r * r
    volume = tube + caps
    return volume, (across / volume, across / volume, about_axis / volume)


def total(parts: Sequence[Inertia]) -> Inertia:
    """Return the inertia of several bodies held together."""
    mass = sum(m for m, _, _ in parts)
    if not mass > 0.0:
        return 0.0, np.zeros(3), np.zeros((3, 3))
    center = sum((m * c for m, c, _ in parts), np.zeros(3)) / mass
    inertia = np.zeros((3, 3))
    for m, c, about_own in parts:
        d = c - center
        inertia += about_own + m * ((d @ d) * np.eye(3) - np.outer(d, d))
    return mass, center, inertia
