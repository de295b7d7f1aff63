"""Conversion of a measured wrench to the axes of the base for comparison, with a warning if other axes or frames fit better.

A sensor has its own axes and origin. The user states its frame and the axes of its components. With the rotation
R_s and the origin p_s of a frame s, and the estimate at the origin p of another,

    f = R_s f_s,       m = R_s m_s + (p_s - p) x f

All conventions are tried: each frame of the arm, its axes or those of the base, and both signs. The convention with the
smallest unexplained part of the measured wrench, weighted by the covariance of the estimate, is compared with the stated one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from backdrive.external.wrench import WrenchEstimate
from backdrive.robot import Robot

AXES = ("frame", "base")
SAMPLES = 400  # that the conventions are compared on
SHARE = 0.5  # least unexplained share of the measured wrench before another convention is reported [-]
CLEARER = 0.5  # largest ratio of another convention's unexplained part to that of the stated one [-]


@dataclass(frozen=True, kw_only=True)
class Convention:
    """The convention of a measured wrench.

    Attributes:
        frame: at whose origin.
        axes: `frame`: along its own; `base`.
        sign: 1: of the environment on the arm; -1: of the arm on the environment.
    """

    frame: str
    axes: str
    sign: float = 1.0

    def __str__(self) -> str:
        """Describe the convention in words."""
        along = "its own axes" if self.axes == "frame" else "those of the base"
        return f"at '{self.frame}' along {along}{', its sign turned round' if self.sign < 0.0 else ''}"


def wrench_at(
    measured: np.ndarray, robot: Robot, q: np.ndarray, convention: Convention, frame: str
) -> np.ndarray:
    """Return a measured wrench at the origin of a frame, along the axes of the base [N, N.m], (n, 6).

    Args:
        measured: force and moment [N, N.m], (n, 6).
        robot: the description.
        q: positions of the joints [rad or m], (n, J).
        convention: how it was measured.
        frame: wanted.
    """
    place = robot.placement(q, convention.frame)
    force, moment = convention.sign * measured[:, :3], convention.sign * measured[:, 3:]
    if convention.axes == "frame":
        force, moment = (np.einsum("nij,nj->ni", place[:, :3, :3], x) for x in (force, moment))
    if convention.frame != frame:
        lever = place[:, :3, 3] - robot.placement(q, frame)[:, :3, 3]
        moment = moment + np.cross(lever, force)
    return np.hstack([force, moment])


def doubt(
    estimate: WrenchEstimate, measured: np.ndarray, robot: Robot, q: np.ndarray, stated: Convention
) -> str | None:
    """Return a warning if another convention fits the estimate much better than the stated one.

    Args:
        estimate: at the stated frame.
        measured: force and moment as the log has them, at the estimate's instants [N, N.m], (n, 6).
        robot: the description.
        q: positions of the joints at these instants [rad or m], (n, J).
        stated: how it was measured.
    """
    good = np.flatnonzero(np.isfinite(measured).all(axis=1) & np.any(measured != 0.0, axis=1))
    good = good[:: max(1, good.size // SAMPLES)]
    if not good.size:
        return "The log's wrench is zero or missing throughout, so it is not compared."
    at, raw, wrench = q[good], measured[good], estimate.wrench[good]
    weight = np.linalg.pinv(estimate.covariance[good])

    def size(x: np.ndarray) -> float:
        return float(np.einsum("ni,nij,nj->", x, weight, x))

    def relative_error(convention: Convention) -> float:
        known = wrench_at(raw, robot, at, convention, estimate.frame)
        return size(wrench - known) / max(size(known), 1e-300)

    own = relative_error(stated)
    if own < SHARE:
        return None
    others = [
        Convention(frame=frame, axes=axes, sign=sign)
        for frame in dict.fromkeys((stated.frame, *robot.frames))
        for axes in AXES
        for sign in (1.0, -1.0)
    ]
    shares = [relative_error(one) for one in others]
    best = int(np.argmin(shares))
    start = f"The log's wrench, taken {stated}, leaves {100 * np.sqrt(own):.0f} % of its size unexplained"
    if shares[best] > CLEARER * own:
        return f"{start}, and no frame of the description explains it much better: check its unit, its zero, the tool's weight."
    return (
        f"{start}; taken {others[best]} it leaves {100 * np.sqrt(shares[best]):.0f} %: the frame, the axes (--wrench-axes) or the "
        "sign look wrong."
    )
