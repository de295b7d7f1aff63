"""Kernels for the given joints of a loop: only the laws, estimators and extras that these joints use are compiled."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np

from backdrive._assembly import assemble
from backdrive.control import loop_kernel
from backdrive.control.compensators import compensator as compensator_
from backdrive.control.compensators import dither as dither_
from backdrive.control.compensators.extras import DisturbanceObserver
from backdrive.control.estimators import external as external_
from backdrive.control.estimators import friction as friction_
from backdrive.control.table import ESTIMATES, GROWS, LEARNS
from backdrive.laws import kernels

F = TypeVar("F", bound=Callable)


def of_loop(kernel: F, rows: Sequence[np.ndarray]) -> F:
    """Return a kernel that advances joints by `loop_kernel.joint`, for the joints of a loop.

    Args:
        kernel: the general kernel.
        rows: of `joint_loop.rows`.
    """
    return assemble(kernel, {loop_kernel.joint: of_joints(rows)})


def of_joints(rows: Sequence[np.ndarray]) -> Callable[..., Any]:
    """Return `loop_kernel.joint` for the joints of a loop, with the rows of `joint_loop.rows`."""
    C, P, _, _, E, PE, _, _, table = rows
    estimating = bool((table[:, ESTIMATES] > 0.0).any())
    parts: dict[Any, Any] = {
        compensator_.tick: of_compensators(C, P),
        external_.tick: of_estimators(E, PE) if estimating else external_.absent,
    }
    for name, column in (("ESTIMATING", ESTIMATES), ("GROWING", GROWS), ("LEARNING", LEARNS)):
        if not (table[:, column] > 0.0).any():
            parts[loop_kernel.__name__, name] = False
    return assemble(loop_kernel.joint, parts)


def of_compensators(rows: np.ndarray, laws: np.ndarray) -> Callable[..., Any]:
    """Return `compensator.tick` for some rows, (J, ROW), and those of their laws, (J, P)."""
    at, extra = compensator_.FRICTION, rows[:, compensator_.EXTRA].astype(int)
    parts = of_friction(rows[:, at:], laws)
    parts[compensator_.extra] = tuple(sorted(set(extra.tolist())))
    parts[compensator_.__name__, "BEYOND"] = bool(extra.any())
    instead = {compensator_.INSTEAD >> int(kind) & 1 for kind in extra}
    if len(instead) == 1:
        parts[compensator_.__name__, "INSTEAD"] = -instead.pop()
    if not (rows[:, compensator_.DITHER] >= 0.0).any():
        parts[dither_.tick] = dither_.absent
        parts[compensator_.__name__, "DITHERED"] = False
    if DisturbanceObserver.KIND in extra:
        parts[external_.estimate] = external_.METHODS.index("disturbance")
    return assemble(compensator_.tick, parts)


def of_estimators(rows: np.ndarray, laws: np.ndarray) -> Callable[..., Any]:
    """Return `external.tick` for some rows, (J, ROW), and those of their laws, (J, P)."""
    methods = tuple(sorted(set(rows[:, 0].astype(int).tolist())))
    parts = of_friction(rows[:, external_.FRICTION :], laws)
    return assemble(external_.tick, parts | {external_.estimate: methods})


def of_friction(rows: np.ndarray, laws: np.ndarray) -> dict[Any, Any]:
    """Return the parts of `friction.tick` for some rows, (J, ROW), and those of their laws, (J, P)."""
    parts = kernels.parts(rows[:, 0], rows[:, 1], kernels.plain(laws)) | kernels.ONE_AT_A_TIME
    parts[friction_.__name__, "LITERAL"] = bool((rows[:, friction_.ROW - 1] > 0.0).any())
    return parts
