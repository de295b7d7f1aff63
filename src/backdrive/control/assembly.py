"""Kernels for the given joints of a loop: only the laws, estimators and extras that these joints use are compiled."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np

from backdrive._assembly import assemble
from backdrive.control import guard, loop_kernel, readings
from backdrive.control.compensators import compensator as compensator_
from backdrive.control.compensators import dither as dither_
from backdrive.control.compensators.extras import DisturbanceObserver
from backdrive.control.estimators import external as external_
from backdrive.control.estimators import friction as friction_
from backdrive.control.estimators.method import no_force, no_friction
from backdrive.control.table import ESTIMATES, GROWS, HOLD, LEARNS, LIMIT, PATIENCE, RAMP, RATE, TOP
from backdrive.laws import kernels

F = TypeVar("F", bound=Callable)
ABSENT = {external_.friction_of: no_friction, external_.force: no_force}


def of_loop(kernel: F, rows: Sequence[np.ndarray]) -> F:
    """Return a kernel that advances joints by `loop_kernel.joint`, for the joints of a loop.

    Args:
        kernel: the general kernel.
        rows: of `joint_loop.rows`.
    """
    return assemble(kernel, {loop_kernel.joint: of_joints(rows, shares_friction(rows))})


def of_joints(rows: Sequence[np.ndarray], sharing: bool = False) -> Callable[..., Any]:
    """Return `loop_kernel.joint` for the joints of a loop.

    Args:
        rows: of `joint_loop.rows`; of those of the laws the first number is enough.
        sharing: each joint's two friction estimators are the same (`shares_friction`).
    """
    C, P, _, _, E, PE, _, _, table = rows
    estimating = bool((table[:, ESTIMATES] > 0.0).any())
    parts: dict[Any, Any] = {compensator_.advance: of_compensators(C, P, compensator_.advance)}
    parts |= of_estimators(E, PE) if estimating else ABSENT
    parts[loop_kernel.__name__, "SHARING"] = estimating and sharing
    if not wide(C[:, compensator_.FRICTION + 1]) and not wide(E[:, external_.FRICTION + 1]):
        parts[kernels.__name__, "ROWS"] = 0
    if np.isinf(table[:, (TOP, LIMIT, RATE, RAMP, PATIENCE)]).all():
        parts[guard.__name__, "LIMITED"] = parts[readings.__name__, "LIMITED"] = False
    if np.isinf(table[:, HOLD]).all():
        parts[loop_kernel.__name__, "HOLDING"] = False
    for name, column in (("ESTIMATING", ESTIMATES), ("GROWING", GROWS), ("LEARNING", LEARNS)):
        if not (table[:, column] > 0.0).any():
            parts[loop_kernel.__name__, name] = False
    return assemble(loop_kernel.joint, parts)


def shares_friction(rows: Sequence[np.ndarray]) -> bool:
    """Return whether each joint's estimator has the friction of its compensator, with a state of one number and nothing extra.

    Args:
        rows: of `joint_loop.rows`.
    """
    C, P, _, _, E, PE, _, _, table = rows
    own = C[:, compensator_.FRICTION : compensator_.DITHER]
    alike = np.array_equal(own, E[:, external_.FRICTION :]) and np.array_equal(P, PE)
    alone = not C[:, compensator_.EXTRA].any() and not wide(own[:, 1])
    return alike and alone and bool((table[:, ESTIMATES] > 0.0).all())


def wide(kinds: np.ndarray) -> bool:
    """Return whether the state of some of these elements is more than a number."""
    return any(kernels.ROWS >> int(kind) & 1 for kind in kinds)


def of_compensators(
    rows: np.ndarray, laws: np.ndarray, kernel: Callable[..., Any] = compensator_.tick
) -> Callable[..., Any]:
    """Return `compensator.tick` or `advance` for some rows, (J, ROW), and those of their laws, (J, P)."""
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
    if not (rows[:, compensator_.DITHER] == dither_.ADAPTIVE).any():
        parts[dither_.__name__, "ADAPTS"] = False
    if DisturbanceObserver.KIND in extra:
        parts[external_.estimate] = external_.METHODS.index("disturbance")
    return assemble(kernel, parts)


def of_estimators(rows: np.ndarray, laws: np.ndarray) -> dict[Any, Any]:
    """Return the parts of `external.tick` for some rows, (J, ROW), and those of their laws, (J, P)."""
    methods = tuple(sorted(set(rows[:, 0].astype(int).tolist())))
    own = assemble(external_.friction_of, of_friction(rows[:, external_.FRICTION :], laws))
    parts = {external_.estimate: methods, (external_.__name__, "HEAVY"): bool(rows[:, 2:4].any())}
    return {external_.friction_of: own, external_.force: assemble(external_.force, parts)}


def of_friction(rows: np.ndarray, laws: np.ndarray) -> dict[Any, Any]:
    """Return the parts of `friction.tick` for some rows, (J, ROW), and those of their laws, (J, P)."""
    parts = kernels.parts(rows[:, 0], rows[:, 1], kernels.plain(laws)) | kernels.ONE_AT_A_TIME
    parts[friction_.__name__, "LITERAL"] = bool((rows[:, friction_.ROW - 1] > 0.0).any())
    return parts
