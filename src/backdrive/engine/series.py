"""Friction torque along given motions, for many parameter sets at once, in one compiled call."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from backdrive._jit import jit
from backdrive.engine.cores import spread
from backdrive.errors import InvalidInput
from backdrive.laws import REFERENCE, Law, kernels

if TYPE_CHECKING:
    from backdrive.model import FrictionModel


@jit
def series(rate, element, p, x, dp, dt, load, temp, out):
    """Fill `out` with the torque of every tick of a motion; `x` is advanced in place.

    dp: position increments (n,); load: (n, 2), or (1, 2) for a constant one; temp: (n,), or (1,).
    """
    loads, temps = load.shape[0] > 1, temp.size > 1
    for k in range(dp.size):
        i = k if loads else 0
        pair = (load[i, 0], load[i, 1])
        out[k] = kernels.step(rate, element, p, x, dp[k], dt, pair, temp[k if temps else 0])


@jit
def lanes(first, last, rates, elements, P, X, motion, dp, dt, load, temp, out):
    """Run lanes first to last - 1: a lane is a parameter row on one of the motions."""
    for i in range(first, last):
        m = motion[i]
        series(rates[i], elements[i], P[i], X[i], dp[m], dt, load[m], temp[m], out[i])


class Lanes:
    """Parameter rows side by side, ready for the kernels.

    Attributes:
        rates: kind of the rate law, (L,).
        elements: kind of the element, (L,).
        rows: parameters, zero behind the end of shorter ones, (L, P).
        states: number of columns of the state.
    """

    def __init__(self, laws: Sequence[Law]):
        rows = [law.row() for law in laws]
        self.rates = np.array([law.rate.KIND for law in laws], dtype=np.int64)
        self.elements = np.array([law.element.KIND for law in laws], dtype=np.int64)
        self.rows = np.zeros((len(rows), max(r.size for r in rows)))
        for i, row in enumerate(rows):
            self.rows[i, : row.size] = row
        self.states = max(law.state().size for law in laws)

    def torque(
        self,
        motion: np.ndarray,
        dp: np.ndarray,
        dt: float,
        load: np.ndarray | None = None,
        temperature: np.ndarray | None = None,
        *,
        state: np.ndarray | None = None,
        workers: int | None = None,
    ) -> np.ndarray:
        """Return the torque of every lane.

        Args:
            motion: which motion a lane runs on, (L,).
            dp: position increments of the motions [rad or m], (M, n).
            dt: sampling time [s].
            load: motor-side and external torque [N.m or N], (M, n, 2) or (M, 1, 2).
            temperature: [degC], (M, n) or (M, 1).
            state: of the elements, advanced in place, (L, S); None: at rest and relaxed.
            workers: threads; None: one a core.

        Returns:
            tau_f [N.m or N], (L, n).
        """
        M, n = dp.shape
        load = np.zeros((M, 1, 2)) if load is None else load
        temperature = np.full((M, 1), REFERENCE) if temperature is None else temperature
        X = np.zeros((len(motion), self.states)) if state is None else state
        out = np.empty((len(motion), n))

        def work(first: int, last: int) -> None:
            lanes(
                first, last, self.rates, self.elements, self.rows, X, motion, dp, dt, load, temperature, out
            )

        spread(work, len(motion), workers)
        return out


def increments(q: np.ndarray | None, dq: np.ndarray | None, dt: float) -> np.ndarray:
    """Return position increments, (n, M), of positions or velocities of that shape, checked."""
    if (q is None) == (dq is None):
        raise InvalidInput("Give either positions q or velocities dq.", remedy="Leave one of them out.")
    if not 0.0 < dt < np.inf:
        raise InvalidInput(f"dt = {dt} s.", remedy="Give the sampling time in seconds.")
    name, motion = ("q", q) if q is not None else ("dq", dq)
    motion = np.asarray(motion, dtype=np.float64)
    if motion.ndim not in (1, 2) or motion.size == 0:
        raise InvalidInput(f"{name} has the shape {motion.shape}.", remedy="Give (n,) or (n, J), time first.")
    if not np.all(np.isfinite(motion)):
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(motion))[0])
        raise InvalidInput(
            f"{name}{list(where)} = {motion[where]}.", remedy="Mend or cut the motion: it must be finite."
        )
    motion = motion.reshape(len(motion), -1)
    return np.diff(motion, axis=0, prepend=motion[:1]) if q is not None else motion * dt


def rollout(
    model: Law | FrictionModel | Sequence[Law] | Sequence[FrictionModel],
    *,
    dt: float,
    q: np.ndarray | None = None,
    dq: np.ndarray | None = None,
    load: np.ndarray | None = None,
    temperature: float | np.ndarray | None = None,
    workers: int | None = None,
) -> np.ndarray:
    """Return the friction torque along a motion, presliding included.

    The joints start at rest and relaxed. Torque k belongs to the interval that ends at sample k.

    Args:
        model: a law, or a model with a law a joint; a sequence of them is a set of candidates.
        dt: sampling time [s].
        q: joint positions [rad or m], (n,) or (n, J); either these or `dq`.
        dq: joint velocities, held over a step [rad/s or m/s], the same shapes.
        load: motor-side and external torque, for laws that depend on load [N.m or N], (n, 2) or (n, J, 2).
        temperature: [degC], one number or (n,); 20 when not given.
        workers: threads; None: one a core. The numbers do not depend on it.

    Returns:
        tau_f [N.m or N], the shape of the motion; for a sequence of B models (B, ...).

    Raises:
        InvalidInput: shapes do not match, or a value is not finite.
    """
    dp = increments(q, dq, dt)
    n, joints = dp.shape
    shape = np.asarray(q if q is not None else dq).shape
    single = not isinstance(model, Sequence)
    sets = [model] if single else list(model)  # type: ignore[list-item, arg-type]
    if not sets:
        raise InvalidInput("There is no model in the sequence.", remedy="Give at least one law.")
    laws: list[Law] = []
    for candidate in sets:
        own = [candidate] * joints if isinstance(candidate, Law) else [j.law for j in candidate.joints]
        if len(own) != joints:
            raise InvalidInput(
                f"The model has {len(own)} joints, the motion {joints}.",
                remedy="Give one column a joint, in the model's order.",
            )
        laws += own
    out = Lanes(laws).torque(
        np.tile(np.arange(joints), len(sets)),
        np.ascontiguousarray(dp.T),
        dt,
        _load(load, n, joints),
        _temperature(temperature, n, joints),
        workers=workers,
    )
    torque = np.swapaxes(out.reshape(len(sets), joints, n), 1, 2).reshape(len(sets), *shape)
    return torque[0] if single else torque


def _load(load, n: int, joints: int) -> np.ndarray | None:
    if load is None:
        return None
    load = np.asarray(load, dtype=np.float64)
    if load.shape not in ((n, 2), (n, joints, 2)):
        raise InvalidInput(
            f"load has the shape {load.shape}.",
            remedy=f"Give motor-side and external torque: ({n}, 2) or ({n}, {joints}, 2).",
        )
    if not np.all(np.isfinite(load)):
        raise InvalidInput("A load is not finite.", remedy="Mend or cut the log.")
    load = np.broadcast_to(load[:, None] if load.ndim == 2 else load, (n, joints, 2))
    return np.ascontiguousarray(np.swapaxes(load, 0, 1))


def _temperature(temperature, n: int, joints: int) -> np.ndarray | None:
    if temperature is None:
        return None
    temperature = np.atleast_1d(np.asarray(temperature, dtype=np.float64))
    if temperature.shape not in ((1,), (n,)):
        raise InvalidInput(
            f"temperature has the shape {temperature.shape}.", remedy=f"Give one number or ({n},), in degC."
        )
    if not np.all(np.isfinite(temperature)):
        raise InvalidInput("A temperature is not finite.", remedy="Mend or cut the log.")
    return np.ascontiguousarray(np.broadcast_to(temperature, (joints, temperature.size)))
