"""A friction law whose level is adapted to measurements; `level` contains the equations and the proofs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from backdrive._jit import jit
from backdrive.control.estimators.level import adapt
from backdrive.engine.tick import DT, TORQUE, Tick, advance
from backdrive.errors import InvalidInput
from backdrive.laws import Law
from backdrive.parameters import NOT_NEGATIVE, POSITIVE, Bound, array, check
from backdrive.status import STATUSES, Status

OK, NOT_FINITE, SATURATED = int(Status.OK), int(Status.NOT_FINITE), int(Status.SATURATED)
BAD_INTERVAL = int(Status.BAD_INTERVAL)
#: Rows of the table that a tick reads and writes, one number per joint.
TIME, FLOOR, DEAD, LOWER, UPPER, SLOWEST, BEFORE, SINCE, BEGUN, LEVEL, OUT = range(11)
FAR = 10.0  # accepted range of an interval: from the inverse of this factor to this factor, times the nominal interval [-]


@jit
def tick(P, X, S, held, dp, g, codes, q, tau, dt, nominal):  # noqa: PLR0913  (a kernel's row)
    """One tick of all joints; returns the worst status.

    `P`, `X`, `S`, `held`, `dp` are the arguments of `engine.tick.advance`; with a NaN increment, a joint keeps its state.
    `g`: settings, previous position, time since then, whether there is one, level and torque (11, J).
    """
    joints = codes.size
    worst = OK
    fits = q.size == joints and tau.size == joints
    timely = nominal / FAR <= dt <= nominal * FAR
    for j in range(joints):
        g[SINCE, j] += dt if timely else nominal
        dp[j] = np.nan
        codes[j] = OK if timely else BAD_INTERVAL
        if timely:
            if fits and np.isfinite(q[j]) and np.isfinite(tau[j]):
                dp[j] = q[j] - g[BEFORE, j] if g[BEGUN, j] > 0.0 else 0.0
                S[DT, j] = g[SINCE, j]
            else:
                codes[j] = NOT_FINITE
    advance(P, X, S, held, dp)
    for j in range(joints):
        code = codes[j]
        if code == OK:
            f = S[TORQUE, j]
            level, T = g[LEVEL, j], S[DT, j]
            if abs(dp[j]) >= g[SLOWEST, j] * T:
                level = adapt(
                    level, f, tau[j], T, g[TIME, j], g[FLOOR, j], g[DEAD, j], g[LOWER, j], g[UPPER, j]
                )
            if held[j] == OK and np.isfinite(level * f):
                g[BEFORE, j], g[SINCE, j], g[BEGUN, j] = q[j], 0.0, True
                g[LEVEL, j], g[OUT, j] = level, level * f
                if level == g[LOWER, j] or level == g[UPPER, j]:
                    code = SATURATED
            else:
                code = NOT_FINITE
            codes[j] = code
        if code != OK and worst != NOT_FINITE and (worst == OK or code != SATURATED):
            worst = code
    return worst


class AdaptiveFriction:
    """Friction torque by a law of every joint, its level adapted to what is measured.

    The law may be any of `backdrive.laws`, with its presliding state; its torque, viscous part included, is multiplied by
    `level`. After a rejected sample or interval, the next one covers the gap.

    Attributes:
        level: theta, updated in place by `tick` (J,).
        torque: friction torque theta f [N.m or N], updated in place (J,).
        codes: `Status` of every joint, updated in place (J,); SATURATED while the level is at a bound.
        load: motor-side and external torque for laws that depend on load [N.m or N], to be written before `tick` (J, 2).
        temperature: for laws that depend on it [degC], to be written before `tick` (J,).
    """

    def __init__(
        self,
        laws: Law | Sequence[Law],
        *,
        interval: float,
        time: float = 1.0,
        floor: np.ndarray | float,
        dead_zone: np.ndarray | float = 0.0,
        lower: float = 0.3,
        upper: float = 3.0,
        start: float = 1.0,
        slowest: float = 0.0,
    ):
        """Check the settings and compile the kernel, so that the first tick takes no longer than the next.

        Args:
            laws: one per joint, at level 1.
            interval: nominal time between ticks [s].
            time: T, time constant of the level while |f| is well above the floor [s].
            floor: f_0, smallest friction of the law at which the level is learned [N.m or N], one number or (J,).
            dead_zone: d, error that is attributed to noise [N.m or N], one number or (J,).
            lower: smallest level [-].
            upper: largest level [-].
            start: level at the start [-].
            slowest: speed below which nothing is learned, some encoder counts per tick [rad/s or m/s].

        Raises:
            InvalidInput: a setting is out of range.
        """
        laws = [laws] if isinstance(laws, Law) else list(laws)
        J = len(laws)
        if not J:
            raise InvalidInput("There is no law.", remedy="Give one law per joint.")
        floors = array("'floor'", floor, (), (J,), bound=POSITIVE)
        dead = array("'dead_zone'", dead_zone, (), (J,), bound=NOT_NEGATIVE)
        numbers = {
            "interval": interval,
            "time": time,
            "lower": lower,
            "upper": upper,
            "start": start,
            "slowest": slowest,
        }
        bounds = {
            "interval": POSITIVE,
            "time": POSITIVE,
            "lower": Bound(0.0, upper, open_high=True),
            "upper": POSITIVE,
            "start": Bound(lower, upper),
            "slowest": NOT_NEGATIVE,
        }
        check("AdaptiveFriction", bounds, numbers)
        self._laws = Tick(laws, dt=float(interval))
        self._table = np.zeros((11, J))
        for row, value in enumerate((time, floors, dead, lower, upper, slowest)):
            self._table[row] = value
        self._start, self._interval = float(start), float(interval)
        self.level, self.torque, self.codes = (
            self._table[LEVEL],
            self._table[OUT],
            np.zeros(J, dtype=np.int64),
        )
        self.load, self.temperature = self._laws.load, self._laws.temperature
        self._arrays = (*self._laws._arrays, np.zeros(J), self._table, self.codes)
        self.tick(np.zeros(J), np.zeros(J))
        self.reset()

    def reset(self) -> None:
        """Return to a joint at rest and relaxed, at the level of the start."""
        self._laws.reset()
        self._table[[BEFORE, SINCE, BEGUN]] = 0.0
        self.level[:], self.torque[:], self.codes[:] = self._start, 0.0, OK

    def tick(self, position: np.ndarray, torque: np.ndarray, interval: float | None = None) -> Status:
        """Advance the laws by one sample and adapt their level; rows are float64, and nothing is raised.

        Where an input is not finite, a row is not (J,), or the interval is far from the nominal one, level and torque stay as
        they are.

        Args:
            position: of the joints [rad or m], (J,).
            torque: measured friction: motor torque minus the torques of inertia, gravity and contact [N.m or N], (J,).
            interval: since the tick before [s]; None: the nominal one.

        Returns:
            The worst status of the joints; those of each are in `codes`.
        """
        dt = self._interval if interval is None else 1.0 * interval  # an integer would compile another kernel
        return STATUSES[tick(*self._arrays, position, torque, dt, self._interval)]
