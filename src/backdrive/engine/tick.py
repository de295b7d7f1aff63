"""One tick of several joints, each with a law of its own: friction torque in a torque loop.

For J joints with laws f_j, states x_j and increments dp_j of the period dt, every tick gives

    tau_f,j = f_j(x_j, dp_j, dt, load_j, temp_j),   x_j advanced,

without allocation: the constructor sets up the rows and compiles the kernel. A joint with an increment that is not finite
keeps its torque and its state, as if it had not moved; other joints are not affected.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from backdrive._jit import jit
from backdrive.engine.series import Lanes
from backdrive.errors import InvalidInput
from backdrive.laws import REFERENCE, Law, kernels
from backdrive.status import Status

OK, NOT_FINITE = int(Status.OK), int(Status.NOT_FINITE)


#: Rows of the table that a tick reads and writes, one number per joint. They share one table, because each further array
#: argument would cost more time than a joint.
RATE, ELEMENT, DT, MOTOR, EXTERNAL, TEMPERATURE, TORQUE = range(7)


@jit
def advance(P, X, S, codes, dp):
    """Advance every joint by one tick and write its torque into S (7, J); `P`: parameters, `X`: states."""
    joints, half = codes.size, X.shape[1] // 2
    fits = dp.size == joints
    for j in range(joints):
        codes[j] = NOT_FINITE
        if not (fits and np.isfinite(dp[j])):
            continue
        x, load = X[j], (S[MOTOR, j], S[EXTERNAL, j])
        for i in range(half):
            x[half + i] = x[i]
        torque = kernels.step(
            int(S[RATE, j]), int(S[ELEMENT, j]), P[j], x, dp[j], S[DT, j], load, S[TEMPERATURE, j]
        )
        if np.isfinite(torque):
            S[TORQUE, j] = torque
            codes[j] = OK
        else:
            for i in range(half):
                x[i] = x[half + i]


class Tick:
    """Friction torque of several joints, tick by tick.

    Attributes:
        torque: friction torque [N.m or N], updated in place (J,).
        codes: `Status` of every joint, updated in place (J,).
        load: motor-side and external torque for laws that depend on load or grow with it [N.m or N], to be written before `tick`
            (J, 2). A law that grows starts with NaN, which stands for the load under which its curve was identified.
        temperature: for laws that depend on it [degC], to be written before `tick` (J,).
    """

    def __init__(self, laws: Law | Sequence[Law], *, dt: float):
        """Set up the rows and compile the kernel, so that the first tick takes no longer than the next.

        Args:
            laws: one per joint.
            dt: period of the ticks [s].

        Raises:
            InvalidInput: there is no law, or `dt` is not a positive number.
        """
        laws = [laws] if isinstance(laws, Law) else list(laws)
        if not laws or not 0.0 < dt < np.inf:
            raise InvalidInput(
                f"{len(laws)} laws, dt = {dt} s.", remedy="Give a law for every joint and a positive period."
            )
        rows = Lanes(laws)
        S = np.zeros((7, len(laws)))
        S[RATE], S[ELEMENT], S[DT], S[TEMPERATURE] = rows.rates, rows.elements, dt, REFERENCE
        S[MOTOR : EXTERNAL + 1] = rows.usual_loads.T
        self.load, self.temperature, self.torque = S[MOTOR : EXTERNAL + 1].T, S[TEMPERATURE], S[TORQUE]
        self.codes = np.zeros(len(laws), dtype=np.int64)
        self._states = np.zeros((len(laws), rows.states))
        self._arrays = (rows.rows, self._states, S, self.codes)
        self._advance = kernels.of_kinds(advance, rows.rates, rows.elements, kernels.plain(rows.rows))
        self.tick(np.zeros(len(laws)))
        self.reset()

    def reset(self) -> None:
        """Reset all joints: at rest, with relaxed elements."""
        self._states[:], self.torque[:], self.codes[:] = 0.0, 0.0, OK

    def tick(self, increments: np.ndarray) -> np.ndarray:
        """Advance every joint by one tick; nothing is allocated and nothing is raised.

        If an increment is not finite, its joint keeps torque and state, and its code is NOT_FINITE. If `increments` does not
        have the shape (J,), this holds for all joints.

        Args:
            increments: of the positions since the tick before [rad or m], float64, contiguous (J,).

        Returns:
            tau_f [N.m or N], (J,): `torque`, the same array in every tick.
        """
        self._advance(*self._arrays, increments)
        return self.torque
