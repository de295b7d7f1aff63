"""Distances between the links of an arm along a motion, and their gradients by the joint positions.

Links that share a joint touch by construction and are left out, and so are those that touch in nearly every posture. Distances are
signed: overlap counts below zero. With p_1 and p_2 the nearest points and n from one to the other,

    d(distance)/dq_k = n . (velocity of p_2 - velocity of p_1)  for a unit velocity of joint k
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from backdrive.plans.arm_shapes import Shape, require_coal
from backdrive.robot import Robot, require_pinocchio

POSTURES = 300  # number of random postures that show which links touch in nearly all of them
NEARLY_ALL = 0.95  # of them


@dataclass(frozen=True, kw_only=True, eq=False)
class Clearance:
    """Pairs of shapes that must keep apart.

    Attributes:
        robot: the description.
        shapes: of its links.
        pairs: of shapes, by number, (k, 2).
        needed: distance that each pair keeps [m], (k,).
        touching: links that touch in nearly every posture and are not checked, pairs of names.
    """

    robot: Robot
    shapes: tuple[Shape, ...]
    pairs: np.ndarray
    needed: np.ndarray
    touching: tuple[tuple[str, str], ...] = ()

    @classmethod
    def of(
        cls, robot: Robot, shapes: list[Shape], lower: np.ndarray, upper: np.ndarray, clearance: float
    ) -> Clearance:
        """Choose the pairs by random postures between two bounds.

        Args:
            robot: the description.
            shapes: of its links.
            lower: lowest positions [rad or m], (J,).
            upper: highest positions [rad or m], (J,).
            clearance: distance to keep [m]; neighbours that are always close keep half of their usual distance.
        """
        parents = list(robot.model.parents)
        pairs = [
            (i, j)
            for i, a in enumerate(shapes)
            for j, b in enumerate(shapes[:i])
            if a.joint != b.joint and parents[a.joint] != b.joint and parents[b.joint] != a.joint
        ]
        every = cls(
            robot=robot,
            shapes=tuple(shapes),
            pairs=np.array(pairs, dtype=int).reshape(-1, 2),
            needed=np.full(len(pairs), clearance),
        )
        if not pairs:
            return every
        q = np.random.default_rng(0).uniform(lower, upper, (POSTURES, len(robot.joints)))
        distance = every.distances(q, 2.0 * clearance)
        touch = np.mean(distance < 0.0, axis=0) > NEARLY_ALL
        usual = np.median(distance, axis=0)
        names = {tuple(sorted((shapes[i].link, shapes[j].link))) for i, j in every.pairs[touch]}
        return cls(
            robot=robot,
            shapes=tuple(shapes),
            pairs=every.pairs[~touch],
            needed=np.minimum(clearance, np.maximum(0.5 * usual, 0.0))[~touch],
            touching=tuple(sorted((a, b) for a, b in names)),
        )

    def distances(self, q: np.ndarray, near: float) -> np.ndarray:
        """Return the distance of every pair [m], (n, k); infinite where it is above `near` for certain.

        Args:
            q: positions [rad or m], (n, J).
            near: distance beyond which nothing is computed [m].
        """
        return self._along(q, near, None)

    def gradient(self, q: np.ndarray, near: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the distances, see there, and their gradients by the positions, (n, k, J), zero where nothing is computed."""
        slope = np.zeros((q.shape[0], len(self.pairs), q.shape[1]))
        return self._along(q, near, slope), slope

    def narrowest(self, q: np.ndarray) -> tuple[float, tuple[str, str]]:
        """Return the smallest distance of a pair beyond its required one [m], and the links of that pair.

        Args:
            q: positions [rad or m], (n, J).
        """
        spare = self.distances(q, float(self.needed.max(initial=0.0)) + 0.2) - self.needed
        if not spare.size or not np.isfinite(spare.min()):
            return np.inf, ("", "")
        i, j = self.pairs[np.unravel_index(np.argmin(spare), spare.shape)[1]]
        return float(spare.min()), (self.shapes[i].link, self.shapes[j].link)

    def _along(self, q: np.ndarray, near: float, slope: np.ndarray | None) -> np.ndarray:
        pin, coal = require_pinocchio(), require_coal()
        transform = getattr(coal, "Transform3s", None) or coal.Transform3f
        model, data = self.robot.model, self.robot.model.createData()
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        out = np.full((q.shape[0], len(self.pairs)), np.inf)
        if not len(self.pairs):
            return out
        radii = np.array([s.radius for s in self.shapes])
        reach = radii[self.pairs].sum(axis=1) + near
        middles, used = np.empty((len(self.shapes), 3)), {s.joint for s in self.shapes}
        for row, positions in enumerate(np.ascontiguousarray(q)):
            pin.computeJointJacobians(model, data, positions)
            jacobian = np.array(data.J)
            poses = {j: data.oMi[j].homogeneous for j in used}
            for s, shape in enumerate(self.shapes):
                pose = poses[shape.joint]
                middles[s] = pose[:3, :3] @ shape.middle + pose[:3, 3]
            apart = np.linalg.norm(middles[self.pairs[:, 0]] - middles[self.pairs[:, 1]], axis=1)
            placed: dict[int, Any] = {}
            for k in np.flatnonzero(apart < reach):
                pair = self.pairs[k]
                for s in pair:
                    if s not in placed:
                        pose = poses[self.shapes[s].joint] @ self.shapes[s].placement
                        placed[s] = transform(np.ascontiguousarray(pose[:3, :3]), pose[:3, 3])
                i, j = pair
                result.clear()
                out[row, k] = coal.distance(
                    self.shapes[i].geometry,
                    placed[i],
                    self.shapes[j].geometry,
                    placed[j],
                    request,
                    result,
                )
                if slope is not None and out[row, k] < near:
                    slope[row, k] = self._slope(jacobian, result, i, j)
        return out

    @cached_property
    def _joint_masks(self) -> np.ndarray:
        """Which joints move each shape, as 0 or 1, (shapes, J)."""
        moved = np.zeros((len(self.shapes), len(self.robot.joints)))
        for s, shape in enumerate(self.shapes):
            moved[s, [c - 1 for c in self.robot.model.supports[shape.joint] if c > 0]] = 1.0
        return moved

    def _slope(self, jacobian: np.ndarray, result: Any, i: int, j: int) -> np.ndarray:
        """Return how the distance of two shapes changes with each joint, (J,)."""
        n = np.asarray(result.normal).ravel()
        change = np.zeros(len(self.robot.joints))
        for shape, point, sign in ((i, result.getNearestPoint1(), -1.0), (j, result.getNearestPoint2(), 1.0)):
            x, y, z = np.asarray(point).ravel()
            turned = (y * n[2] - z * n[1], z * n[0] - x * n[2], x * n[1] - y * n[0])  # p x n
            change += sign * self._joint_masks[shape] * (np.array([*n, *turned]) @ jacobian)
        return change
