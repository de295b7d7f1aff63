"""Poses in MJCF: positions and the five notations of an orientation, as homogeneous matrices."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from backdrive.errors import ReadError
from backdrive.robot.xml import numbers

SMALLEST = 1e-12  # length of a direction


@dataclass(frozen=True, kw_only=True)
class Angles:
    """How a file writes angles: `<compiler angle eulerseq>`.

    Attributes:
        unit: of an angle [rad].
        sequence: of Euler angles; small letters turn with the body, capitals about fixed axes.
    """

    unit: float = np.pi / 180.0
    sequence: str = "xyz"


def pose(attributes: Mapping[str, str], angles: Angles, where: str) -> np.ndarray:
    """Return `pos` and orientation of an element, (4, 4).

    Args:
        attributes: of the element.
        angles: of the file.
        where: what to call it in messages.

    Raises:
        ReadError: a number is none, a direction has no length, or there are two orientations.
    """
    placed = np.eye(4)
    placed[:3, :3] = rotation(attributes, angles, where)
    if "pos" in attributes:
        placed[:3, 3] = numbers(attributes["pos"], (3,), f"{where}: pos")
    return placed


def rotation(attributes: Mapping[str, str], angles: Angles, where: str) -> np.ndarray:
    """Return the orientation of an element, (3, 3); see `pose`."""
    ways = {"quat": 4, "axisangle": 4, "euler": 3, "xyaxes": 6, "zaxis": 3}
    stated = [w for w in ways if w in attributes]
    if not stated:
        return np.eye(3)
    if len(stated) > 1:
        raise ReadError(f"{where} is oriented by {' and '.join(stated)}.", remedy="Write one orientation.")
    way = stated[0]
    x = np.array(numbers(attributes[way], (ways[way],), f"{where}: {way}"))
    if way == "quat":
        return of_quaternion(unit(x, f"{where}: quat"))
    if way == "axisangle":
        return about(unit(x[:3], f"{where}: axisangle"), angles.unit * x[3])
    if way == "zaxis":
        return along_z(unit(x, f"{where}: zaxis"))
    if way == "xyaxes":
        first = unit(x[:3], f"{where}: xyaxes")
        second = unit(x[3:] - first * (first @ x[3:]), f"{where}: xyaxes")
        return np.column_stack([first, second, np.cross(first, second)])
    turned = np.eye(3)
    for letter, angle in zip(angles.sequence, angles.unit * x, strict=True):
        one = about(np.eye(3)["xyz".index(letter.lower())], angle)
        turned = turned @ one if letter.islower() else one @ turned
    return turned


def unit(x: np.ndarray, where: str) -> np.ndarray:
    """Return a vector divided by its length.

    Raises:
        ReadError: it has none.
    """
    length = float(np.linalg.norm(x))
    if not length > SMALLEST:
        raise ReadError(f"{where} has no length.", remedy="Write a direction.")
    return x / length


def of_quaternion(x: np.ndarray) -> np.ndarray:
    """Return the rotation of a unit quaternion (w, x, y, z), (3, 3)."""
    w, v = x[0], x[1:]
    return (w * w - v @ v) * np.eye(3) + 2.0 * np.outer(v, v) + 2.0 * w * skew(v)


def about(axis: np.ndarray, angle: float) -> np.ndarray:
    """Return the rotation about a unit axis by an angle [rad], (3, 3)."""
    return of_quaternion(np.concatenate([[np.cos(0.5 * angle)], np.sin(0.5 * angle) * axis]))


def along_z(direction: np.ndarray) -> np.ndarray:
    """Return the shortest rotation that turns z into a unit direction, (3, 3)."""
    axis = np.cross([0.0, 0.0, 1.0], direction)
    size = float(np.linalg.norm(axis))
    axis = np.array([1.0, 0.0, 0.0]) if size < SMALLEST else axis / size
    return about(axis, float(np.arctan2(size, direction[2])))


def skew(v: np.ndarray) -> np.ndarray:
    """Return the matrix S with S x = v x x (cross product), (3, 3)."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
