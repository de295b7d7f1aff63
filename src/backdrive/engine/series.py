"""Friction torque along given motions, for many parameter sets at once, in compiled loops."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from backdrive._memory import empty, transpose
from backdrive.engine import groups, loops
from backdrive.engine.cores import spread
from backdrive.errors import InvalidInput, check_type
from backdrive.laws import REFERENCE, Law, kernels
from backdrive.parameters import array, numbers

if TYPE_CHECKING:
    from backdrive.model import FrictionModel


#: Ticks of friction without a state, all lanes together, below which starting threads costs more than they give.
QUICK = 300_000

Kinds = tuple[int, int, bool, int]


def stack_rows(rows: Sequence[np.ndarray]) -> np.ndarray:
    """Return rows of different lengths as one table, zero behind the end of shorter ones."""
    table = np.zeros((len(rows), max(row.size for row in rows)))
    for i, row in enumerate(rows):
        table[i, : row.size] = row
    return table


class Lanes:
    """Parameter rows side by side, ready for the kernels.

    Attributes:
        rates: kind of the rate law, (L,).
        elements: kind of the element, (L,).
        rows: parameters, zero behind the end of shorter ones, (L, P).
        states: number of columns of the state.
        usual_loads: motor-side and external torque where no load is given [N.m or N], (L, 2).
    """

    def __init__(self, laws: Sequence[Law]):
        self.rates = np.array([law.rate.KIND for law in laws], dtype=np.int64)
        self.elements = np.array([law.element.KIND for law in laws], dtype=np.int64)
        self.rows = stack_rows([law.row() for law in laws])
        self.states = 2 * max(max(law.element.states(), 1) for law in laws)
        self.usual_loads = np.array([law.usual_load for law in laws])
        plain = self.rows[:, 0] == np.floor(self.rows[:, 0])
        sections = [law.element.sections() for law in laws]
        #: of each group: arguments of `loops.one_by_one`, its lanes, number of lanes in earlier groups, default load
        self._groups: list[tuple[Kinds, np.ndarray, int, np.ndarray]] = []
        grows, place = np.isnan(self.usual_loads[:, 1]), 0
        kinds = list(
            zip(
                self.rates.tolist(),
                self.elements.tolist(),
                plain.tolist(),
                sections,
                grows.tolist(),
                strict=True,
            )
        )
        table = np.array(kinds)
        for kind in sorted(set(kinds)):
            lanes = np.flatnonzero((table == kind).all(axis=1))
            self._groups.append((kind[:-1], lanes, place, self.usual_loads[lanes[0]]))
            place += len(lanes)

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
            motion: number of the motion of each lane, (L,).
            dp: position increments of the motions [rad or m], (M, n).
            dt: sampling time [s].
            load: motor-side and external torque [N.m or N], (M, n, 2) or (M, 1, 2); None: the usual one of each law.
            temperature: [degC], (M, n) or (M, 1).
            state: of the elements, advanced in place, (L, S); None: at rest and relaxed.
            workers: threads; None: one per core.

        Returns:
            tau_f [N.m or N], (L, n).

        Raises:
            InvalidInput: `motion` does not name one motion for every lane.
        """
        if len(motion) != len(self.rates):
            raise InvalidInput(
                f"{len(motion)} motions for {len(self.rates)} lanes.", remedy="Name one motion for each lane."
            )
        M, n = dp.shape
        temperature = np.full((M, 1), REFERENCE) if temperature is None else temperature
        X = np.zeros((len(motion), self.states)) if state is None else state
        out = empty((len(motion), n))

        motion = np.ascontiguousarray(motion, dtype=np.int64)
        fastest = 0.5 * kernels.FASTEST * dt
        # so no increment is larger; a NaN is not tame; laws without a state check each velocity, and need not read the motion twice
        asked = not all(groups.holds(kinds[1]) for kinds, *_ in self._groups)
        every = dp.reshape(-1)
        tame = asked and bool(
            np.einsum("n,n", every, every) <= fastest * fastest
        )  # BLAS would wake its threads
        parts = [
            (
                self._loop(kinds, lanes, motion, tame),
                lanes,
                place,
                np.full((M, 1, 2), usual) if load is None else load,
            )
            for kinds, lanes, place, usual in self._groups
        ]

        def work(first: int, last: int) -> None:
            for (loop, room), lanes, place, loads in parts:
                a, b = max(first - place, 0), min(last - place, len(lanes))
                if a < b:
                    loop(lanes[a:b], self.rows, X, motion, dp, dt, loads, temperature, *room(), out)

        small = workers is None and not asked and len(motion) * n < QUICK
        spread(work, len(motion), 1 if small else workers)
        return out

    def _loop(
        self, kinds: Kinds, lanes: np.ndarray, motion: np.ndarray, tame: bool
    ) -> tuple[Callable, Callable]:
        """Return the compiled loop for some lanes of one law, and the function that allocates its work arrays."""
        rate, element, plain, _ = kinds
        if groups.serves(element):
            alone = len(lanes) == 1 and not groups.holds(element)
            together = 1 if alone else groups.TOGETHER
            tame = tame and not groups.holds(element)
            return groups.in_groups(rate, element, plain, tame, together), groups.work
        wide = kernels.ROWS >> element & 1 or not plain or self.rows.shape[1] > loops.COLUMNS
        if len(lanes) < loops.FEWEST or wide:
            return loops.one_by_one(*kinds, tame), loops.work
        shared = bool((motion[lanes] == motion[lanes[0]]).all())
        return loops.lane_loop(rate, element, 1 + int(self.rows[lanes[0], 0]), tame, shared), loops.work


def unlike(laws: Sequence[Law], motion: np.ndarray) -> tuple[list[int], list[int]]:
    """Return the lanes that differ, and for every lane the place among them of the one that is like it, (L,).

    Args:
        laws: of the lanes, all of one kind.
        motion: number of the motion of each lane, (L,).
    """
    places: dict[tuple[bytes, int], int] = {}
    keys = zip((law.row().tobytes() for law in laws), motion.tolist(), strict=True)
    alike = [places.setdefault(key, len(places)) for key in keys]
    return [alike.index(place) for place in range(len(places))], alike


def increments(q: np.ndarray | None, dq: np.ndarray | None, dt: float) -> np.ndarray:
    """Check positions or velocities, (n,) or (n, M), and return their increments in each step [rad or m], (n, M)."""
    if (q is None) == (dq is None):
        raise InvalidInput("Give either positions q or velocities dq.", remedy="Leave one of them out.")
    if not isinstance(dt, (int, float, np.integer, np.floating)) or not 0.0 < dt < np.inf:
        raise InvalidInput(f"dt = {dt!r} s.", remedy="Give the sampling time in seconds, one number.")
    name, motion = ("q", q) if q is not None else ("dq", dq)
    motion = numbers(name, motion)
    if motion.ndim not in (1, 2) or motion.size == 0:
        raise InvalidInput(f"{name} has the shape {motion.shape}.", remedy="Give (n,) or (n, J), time first.")
    if not np.all(np.isfinite(motion)):
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(motion))[0])
        raise InvalidInput(
            f"{name}{list(where)} = {motion[where]}.", remedy="Repair or cut the motion: it must be finite."
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
        model: a law, or a model with one law for each joint; a sequence of either is a set of candidates.
        dt: sampling time [s].
        q: joint positions [rad or m], (n,) or (n, J); either these or `dq`.
        dq: joint velocities, held over a step [rad/s or m/s], the same shapes.
        load: motor-side and external torque, for laws that depend on load or grow with it [N.m or N], (n, 2) or (n, J, 2).
            None: no load; for laws that grow, the load under which their curve was identified.
        temperature: [degC], one number or (n,); 20 when not given.
        workers: threads; None: one per core. The numbers do not depend on it.

    Returns:
        tau_f [N.m or N], the shape of the motion; for a sequence of B models (B, ...).

    Raises:
        InvalidInput: shapes do not match, or a value is not finite.
    """
    dp = increments(q, dq, dt)
    n, joints = dp.shape
    shape = np.asarray(q if q is not None else dq).shape
    single = not isinstance(model, Sequence) or isinstance(model, str)
    sets: list[Any] = [model] if single else list(model)  # type: ignore[list-item, arg-type]
    if not sets:
        raise InvalidInput("There is no model in the sequence.", remedy="Give at least one law.")
    laws: list[Law] = []
    for candidate in sets:
        if not hasattr(candidate, "joints"):
            check_type(
                candidate,
                Law,
                "law or friction model",
                "Give Law(rate=..., element=...), or what `load_model` returns.",
            )
        own = [candidate] * joints if isinstance(candidate, Law) else [j.law for j in candidate.joints]
        if len(own) != joints:
            raise InvalidInput(
                f"The model has {len(own)} joints, the motion {joints}.",
                remedy="Give one column per joint, in the model's order.",
            )
        laws += own
    if load is not None:
        given = array("load", load, (n, 2), (n, joints, 2))
        loads = np.broadcast_to(given[:, None] if given.ndim == 2 else given, (n, joints, 2))
        load = np.ascontiguousarray(np.swapaxes(loads, 0, 1))
    if temperature is not None:
        warm = np.atleast_1d(array("temperature", temperature, (), (1,), (n,)))
        temperature = np.ascontiguousarray(np.broadcast_to(warm, (joints, warm.size)))
    out = Lanes(laws).torque(
        np.tile(np.arange(joints), len(sets)),
        transpose(dp),
        dt,
        load,
        temperature,
        workers=workers,
    )
    torque = np.swapaxes(out.reshape(len(sets), joints, n), 1, 2).reshape(len(sets), *shape)
    return torque[0] if single else torque
