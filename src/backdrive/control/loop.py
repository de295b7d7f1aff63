"""One fused tick of several joints: compensation, external force and friction from one row of encoder readings.

    q, u -> f (torque to add), tau_e (external force), tau_f (friction)

Nothing is allocated, nothing is raised. What a real loop meets is answered so that the output stays safe: a reading that is not
finite or that jumped further than the joint can move is not believed, and meanwhile the output fades, f <- f/(1 + fade T); a late
tick is run with the time that really passed; an interval that makes no sense is one more reading that is not believed. A jump
that stays longer than `patience` is taken for the encoder's new zero: everything that is a position moves along, so that neither
torque nor estimate sees it. Every joint has a `Status`.

The level of the friction that is compensated and taken off may be learned meanwhile (`Adaptation`): what is estimated as external
force in free motion is what the friction model misses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from backdrive._jit import jit, ladder
from backdrive.compensate import compensator as compensator_
from backdrive.compensate.compensator import Compensator
from backdrive.compensate.extras import BristleObserver, DisturbanceObserver
from backdrive.errors import InvalidInput
from backdrive.estimate import external as external_
from backdrive.estimate.external import ExternalForce
from backdrive.estimate.level import Adaptation, learned
from backdrive.laws import REFERENCE
from backdrive.status import Status

OK, NOT_FINITE, BAD_INTERVAL = int(Status.OK), int(Status.NOT_FINITE), int(Status.BAD_INTERVAL)
SATURATED, JUMP = int(Status.SATURATED), int(Status.JUMP)
STATUSES = tuple(Status)
SLOWEST, FASTEST = 20.0, 0.05  # intervals by the nominal one that are believed

#: Rows of the table that a tick reads and writes, one number a joint.
(
    NOMINAL, BEFORE, SINCE, BEGUN, TIME, TORQUE, EXTERNAL, FRICTION, APPLIED, ERROR, SLOPE, KNOWN, MOTOR, LOAD, TEMPERATURE,
    TOP, LIMIT, FADE, PATIENCE, STALE, ELSEWHERE, ESTIMATES, SLID, LEVEL, LEARNS, CREEP, SETTLE, FLOOR, DEAD, LOWER, UPPER,
) = range(31)  # fmt: skip
TABLE = 31


@jit
def shift(c, s, ce, se, g, j, by):
    """Move everything of a joint that is a position, and take the present reading for the one before."""
    compensator_.shift(c, 0, s, 0, by)
    external_.shift(ce, 0, se, 0, by)
    g[BEFORE, j] += by
    g[ELSEWHERE, j] = g[BEFORE, j]
    g[SINCE, j], g[STALE, j] = 0.0, 0.0


@jit
def restart(c, x, s, ce, xe, se, g, j, q):
    """Forget what a joint has run into: it rests at q."""
    for k in range(x.size):
        x[k] = 0.0
    for k in range(xe.size):
        xe[k] = 0.0
    compensator_.restart(c, 0, s, 0, q)
    external_.restart(ce, 0, se, 0, q)
    g[BEFORE, j], g[ELSEWHERE, j] = q, q
    g[SINCE, j], g[STALE, j] = 0.0, 0.0
    g[EXTERNAL, j], g[FRICTION, j] = 0.0, 0.0


@jit
def believed(c, s, ce, se, g, j, q, dt):
    """Return the status of a joint's input; where it is not OK, let the outputs fade."""
    nominal, top = g[NOMINAL, j], g[TOP, j]
    timely = FASTEST * nominal <= dt <= SLOWEST * nominal
    passed = dt if timely else nominal
    g[TIME, j] += passed
    if g[BEGUN, j] == 0.0 and np.isfinite(q):
        shift(c, s, ce, se, g, j, q - g[BEFORE, j])
        g[BEGUN, j] = 1.0
    g[SINCE, j] += passed
    inputs = q + g[APPLIED, j] + g[KNOWN, j] + g[ERROR, j] + g[SLOPE, j] + g[MOTOR, j] + g[LOAD, j]
    goes_on = abs(q - g[ELSEWHERE, j]) <= top * passed
    code = OK
    if not timely:
        code = BAD_INTERVAL
    elif not np.isfinite(inputs + g[TEMPERATURE, j]):
        code = NOT_FINITE
    elif g[ELSEWHERE, j] != g[BEFORE, j] and goes_on:
        code = JUMP  # what follows a jump
        g[STALE, j] += passed
        g[ELSEWHERE, j] = q
        if g[STALE, j] > g[PATIENCE, j]:
            shift(c, s, ce, se, g, j, q - g[BEFORE, j])
    elif not abs(q - g[BEFORE, j]) <= top * g[SINCE, j]:
        code = JUMP
        g[STALE, j], g[ELSEWHERE, j] = 0.0, q
    if code != OK:
        fading = 1.0 + g[FADE, j] * nominal
        g[TORQUE, j] /= fading
        g[EXTERNAL, j] /= fading
    return code


@ladder
def joint(c, i, p, x, s, ce, pe, xe, se, g, j, q, dt):
    """Advance one joint by one tick and return its status.

    `c[i:]`, `p`, `x`, `s`: compensator; `ce`, `pe`, `xe`, `se`: estimator; `g[:, j]`: table.
    """
    code = believed(c, s, ce, se, g, j, q, dt)
    if code != OK:
        return code
    T, dp, u = g[SINCE, j], q - g[BEFORE, j], g[APPLIED, j]
    load, temp = (g[MOTOR, j], g[LOAD, j]), g[TEMPERATURE, j]
    level = g[LEVEL, j]
    f = level * compensator_.tick(
        c, i, p, x, s, 0, q, dp, T, g[TIME, j], g[ERROR, j], g[SLOPE, j], u - g[KNOWN, j], load, temp
    )
    tau_e, tau_f = 0.0, 0.0
    if g[ESTIMATES, j] > 0.0:
        tau_e, tau_f = external_.tick(ce, 0, pe, xe, se, 0, q, dp, T, u, g[KNOWN, j], load, temp, level)
    if not np.isfinite(f + tau_e + tau_f):  # finite, but beyond what numbers hold
        restart(c, x, s, ce, xe, se, g, j, q)
        g[TORQUE, j] /= 1.0 + g[FADE, j] * g[NOMINAL, j]
        return NOT_FINITE
    if g[LEARNS, j] > 0.0:
        slid = g[SLID, j] + T if abs(dp) >= g[CREEP, j] * T else 0.0
        numbers = g[LEARNS, j], g[SETTLE, j], g[FLOOR, j], g[DEAD, j], g[LOWER, j], g[UPPER, j]
        g[LEVEL, j], g[SLID, j] = learned(level, tau_f / level, tau_e, slid, T, *numbers), slid
    limit = g[LIMIT, j]
    if abs(f) > limit:
        f = limit if f > 0.0 else -limit
        code = SATURATED
    g[TORQUE, j], g[EXTERNAL, j], g[FRICTION, j] = f, tau_e, tau_f
    g[BEFORE, j], g[SINCE, j], g[STALE, j], g[ELSEWHERE, j] = q, 0.0, 0.0, q
    return code


@jit
def tick(A, o, g, codes, q, dt):
    """Advance every joint by one tick and return the worst status.

    `A[j]`: what `rows` returns of a joint, one after the other, `o`: where each begins (9,), `g`: table.
    """
    worst = OK
    for j in range(codes.size):
        a = A[j]
        c, p, x, s = a[: o[1]], a[o[1] : o[2]], a[o[2] : o[3]], a[o[3] : o[4]]
        ce, pe, xe, se = a[o[4] : o[5]], a[o[5] : o[6]], a[o[6] : o[7]], a[o[7] :]
        codes[j] = joint(c, 0, p, x, s, ce, pe, xe, se, g, j, q[j], dt)
        if codes[j] != OK and worst in (OK, SATURATED):
            worst = codes[j]
    return worst


@dataclass(frozen=True, kw_only=True)
class JointLoop:
    """What runs on one joint.

    Attributes:
        compensator: of friction.
        external: estimator of the external force; None for none.
        adaptation: of the level of the friction, compensated and taken off alike; None: it stays 1.
        top_speed: faster than which the joint cannot move [rad/s or m/s].
        limit: of the compensator's output [N.m or N].
        fade: rate at which the output fades while readings are not believed [1/s].
        patience: after which a jump is taken for the encoder's new zero [s].
    """

    compensator: Compensator = field(default_factory=Compensator)
    external: ExternalForce | None = None
    adaptation: Adaptation | None = None
    top_speed: float = np.inf
    limit: float = np.inf
    fade: float = 50.0
    patience: float = 0.1

    def __post_init__(self):
        if not all(x > 0.0 for x in (self.top_speed, self.limit, self.fade, self.patience)):
            raise InvalidInput(
                f"top_speed = {self.top_speed}, limit = {self.limit}, fade = {self.fade}, patience = {self.patience}.",
                remedy="All of them are positive.",
            )
        if self.adaptation is None:
            return
        if self.external is None:
            raise InvalidInput(
                "The level of friction is learned from the estimated external force.",
                remedy="Give the loop an `ExternalForce`.",
            )
        if isinstance(self.compensator.extra, (BristleObserver, DisturbanceObserver)):
            raise InvalidInput(
                f"{type(self.compensator.extra).__name__} adapts by itself.",
                remedy="Give the loop one of both.",
            )
        self.adaptation.row(self.external.friction.law)


def rows(joints: Sequence[JointLoop], positions: np.ndarray, dt: float) -> tuple[np.ndarray, ...]:
    """Return what `tick` reads and writes for joints at rest: C, P, X, S, CE, PE, XE, SE and the table.

    Args:
        joints: what runs on each.
        positions: where they rest [rad or m], (J,).
        dt: nominal period [s].
    """
    J = len(joints)
    estimators = [j.external or ExternalForce(inertia=1.0) for j in joints]
    laws = [[j.compensator.friction.law for j in joints], [e.friction.law for e in estimators]]
    table = np.zeros((TABLE, J))
    table[NOMINAL], table[TEMPERATURE] = dt, REFERENCE
    table[BEFORE] = table[ELSEWHERE] = positions
    for row, values in (
        (TOP, [j.top_speed for j in joints]),
        (LIMIT, [j.limit for j in joints]),
        (FADE, [j.fade for j in joints]),
        (PATIENCE, [j.patience for j in joints]),
        (ESTIMATES, [float(j.external is not None) for j in joints]),
    ):
        table[row] = values
    table[LEVEL] = 1.0
    for k, (joint, estimator) in enumerate(zip(joints, estimators)):
        if joint.adaptation is not None:
            table[LEARNS : UPPER + 1, k] = joint.adaptation.row(estimator.friction.law)
            table[LEVEL, k] = joint.adaptation.start
    found = []
    for own, parts in zip(laws, ([j.compensator for j in joints], estimators)):
        row, state = [law.row() for law in own], [law.state() for law in own]
        P, X = np.zeros((J, max(r.size for r in row))), np.zeros((J, max(s.size for s in state)))
        for j in range(J):
            P[j, : row[j].size], X[j, : state[j].size] = row[j], state[j]
        C = np.array([part.row(dt) for part in parts])
        S = np.array([part.start(float(q)) for part, q in zip(parts, positions)])
        found += [C, P, X, S]
    return (*found, table)


class Loop:
    """Compensation and estimation of several joints, tick by tick.

    Attributes:
        torque: to add to what drives the joints [N.m or N], updated in place (J,).
        external: estimated external force [N.m or N], updated in place (J,).
        friction: estimated friction [N.m or N], updated in place (J,).
        level: of the friction, learned [-], updated in place (J,).
        codes: `Status` of every joint, updated in place (J,).
        error: how far the reference is ahead, to be written before `update` [rad or m], (J,).
        slope: its rate [rad/s or m/s], (J,).
        known: gravity and the other joints' pull, to be written before `update` [N.m or N], (J,).
        load: motor-side and external torque for laws that depend on load [N.m or N], (J, 2).
        temperature: for laws that depend on it [degC], (J,).
    """

    _arrays: tuple[Any, ...]

    def __init__(self, joints: JointLoop | Sequence[JointLoop], *, interval: float):
        """Set up the rows and compile the kernel, so that the first tick takes no longer than the next.

        Args:
            joints: what runs on each.
            interval: nominal period [s].

        Raises:
            InvalidInput: there is no joint, or the period is not positive.
        """
        self.joints = [joints] if isinstance(joints, JointLoop) else list(joints)
        if not self.joints or not 0.0 < interval < np.inf:
            raise InvalidInput(
                f"{len(self.joints)} joints, interval = {interval} s.",
                remedy="Give at least one joint and a positive period.",
            )
        self.interval = float(interval)
        J = len(self.joints)
        *parts, self.table = rows(self.joints, np.zeros(J), self.interval)
        self.codes = np.zeros(J, dtype=np.int64)
        # in one array, for an argument more costs as much as a friction law
        begins = np.cumsum([0] + [part.shape[1] for part in parts])
        self._rows = np.concatenate(parts, axis=1)
        self._arrays = (self._rows, begins, self.table, self.codes)
        self._position = np.zeros(J)
        self.torque, self.external, self.friction = (self.table[k] for k in (TORQUE, EXTERNAL, FRICTION))
        self.level = self.table[LEVEL]
        self.error, self.slope, self.known = (self.table[k] for k in (ERROR, SLOPE, KNOWN))
        self.load, self.temperature = self.table[MOTOR : LOAD + 1].T, self.table[TEMPERATURE]
        self._applied = self.table[APPLIED]
        self._tick: Any = tick
        self.update(np.zeros(J), np.zeros(J))
        self.reset(np.zeros(J))

    def reset(self, positions: np.ndarray) -> None:
        """Return to joints at rest at these positions [rad or m], (J,), relaxed, at time 0."""
        *parts, table = rows(self.joints, np.asarray(positions, dtype=np.float64), self.interval)
        self._rows[:], self.table[:] = np.concatenate(parts, axis=1), table
        self.codes[:] = OK

    def update(self, position: np.ndarray, applied: np.ndarray, interval: float | None = None) -> Status:
        """Advance every joint by one tick; nothing is allocated and nothing is raised.

        Args:
            position: encoder readings [rad or m], (J,).
            applied: torque that acted since the tick before [N.m or N], (J,).
            interval: since the tick before [s]; None: the nominal one.

        Returns:
            The worst status of the joints; those of each are in `codes`.
        """
        read, dt = self._position, self.interval
        try:
            if len(position) != len(read) or len(applied) != len(read):
                read[:] = np.nan
            else:
                read[:], self._applied[:] = position, applied
            if interval is not None:
                dt = float(interval)
        except (TypeError, ValueError, OverflowError):  # no numbers at all
            read[:] = np.nan
        return STATUSES[self._tick(*self._arrays, read, dt)]
