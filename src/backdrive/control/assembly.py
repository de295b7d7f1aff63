"""The kernels of loops whose joints are known: only the laws, estimators and extras that stand in their rows are compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from backdrive._assembly import assemble
from backdrive.control import loop_kernel
from backdrive.control.compensators import compensator as compensator_
from backdrive.control.compensators import dither as dither_
from backdrive.control.compensators.extras import DisturbanceObserver
from backdrive.control.estimators import external as external_
from backdrive.laws import kernels

F = TypeVar("F", bound=Callable)


def of_loop(kernel: F, compensators: np.ndarray, estimators: np.ndarray, estimates: bool) -> F:
    """Return a kernel that advances joints by `loop_kernel.joint`, for the joints of a loop.

    Args:
        kernel: general.
        compensators: their rows, (J, `compensator.ROW`).
        estimators: their rows, (J, `external.ROW`).
        estimates: whether any joint has an estimator.
    """
    return assemble(kernel, {loop_kernel.joint: of_joints(compensators, estimators, estimates)})


def of_joints(compensators: np.ndarray, estimators: np.ndarray, estimates: bool) -> Callable[..., Any]:
    """Return `loop_kernel.joint` for the joints of a loop, with the arguments of `of_loop`."""
    parts = {
        compensator_.tick: of_compensators(compensators),
        external_.tick: of_estimators(estimators) if estimates else external_.absent,
    }
    return assemble(loop_kernel.joint, parts)


def of_compensators(rows: np.ndarray) -> Callable[..., Any]:
    """Return `compensator.tick` for some rows, (J, ROW)."""
    at, extra = compensator_.FRICTION, rows[:, compensator_.EXTRA].astype(int)
    parts = kernels.parts(rows[:, at], rows[:, at + 1])
    parts[compensator_.extra] = tuple(sorted(set(extra.tolist())))
    instead = {compensator_.INSTEAD >> int(kind) & 1 for kind in extra}
    if len(instead) == 1:
        parts[compensator_.__name__, "INSTEAD"] = -instead.pop()
    if not (rows[:, compensator_.DITHER] >= 0.0).any():
        parts[dither_.tick] = dither_.absent
    if DisturbanceObserver.KIND in extra:
        parts[external_.estimate] = external_.METHODS.index("disturbance")
    return assemble(compensator_.tick, parts)


def of_estimators(rows: np.ndarray) -> Callable[..., Any]:
    """Return `external.tick` for some rows, (J, ROW)."""
    at = external_.FRICTION
    methods = tuple(sorted(set(rows[:, 0].astype(int).tolist())))
    return assemble(
        external_.tick, kernels.parts(rows[:, at], rows[:, at + 1]) | {external_.estimate: methods}
    )
