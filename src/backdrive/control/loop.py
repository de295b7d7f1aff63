"""One fused tick of several joints: compensation, external force and friction from one row of encoder readings.

    q, u -> f (torque to add), tau_e (external force), tau_f (friction)

Nothing is allocated, nothing is raised. What a real loop meets is answered so that the output stays safe: a reading that is not
finite or that jumped further than the joint can move is not believed, and meanwhile the output fades, f <- f/(1 + fade T); a late
tick is run with the time that really passed; an interval that makes no sense is one more reading that is not believed. A jump
that stays longer than `patience` is taken for the encoder's new zero. Every joint has a `Status`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from backdrive._jit import jit
from backdrive.compensate import compensator as compensator_
from backdrive.compensate.compensator import Compensator
from backdrive.errors import InvalidInput
from backdrive.estimate import external as external_
from backdrive.estimate.external import ExternalForce
from backdrive.laws import REFERENCE
from backdrive.status import Status

OK, NOT_FINITE, BAD_INTERVAL = int(Status.OK), int(Status.NOT_FINITE), int(Status.BAD_INTERVAL)
SATURATED, JUMP = int(Status.SATURATED), int(Status.JUMP)
STATUSES = tuple(Status)
SLOWEST, FASTEST = 20.0, 0.05  # intervals by the nominal one that are believed

#: Rows of the table that a tick reads and writes, one number a joint.
(
    NOMINAL, BEFORE, SINCE, BEGUN, TIME, TORQUE, EXTERNAL, FRICTION, APPLIED, ERROR, SLOPE, KNOWN, MOTOR, LOAD, TEMPERATURE,
    TOP, LIMIT, FADE, PATIENCE, STALE, ELSEWHERE, ESTIMATES,
) = range(22)  # fmt: skip
TABLE = 22


@jit
def joint(c, i, p, x, s, ce, pe, xe, se, g, j, q, dt):
    """Advance one joint by one tick and return its status.

    `c[i:]`, `p`, `x`, `s`: compensator; `ce`, `pe`, `xe`, `se`: estimator; `g[:, j]`: table.
    """
    nominal = g[NOMINAL, j]
    timely = FASTEST * nominal <= dt <= SLOWEST * nominal
    g[SINCE, j] += dt if timely else nominal
    T = g[SINCE, j]
    g[TIME, j] += dt if timely else nominal
    if g[BEGUN, j] == 0.0 and np.isfinite(q):
        g[BEFORE, j], g[BEGUN, j], g[ELSEWHERE, j] = q, 1.0, q
    dp = q - g[BEFORE, j]
    code = OK
    if not timely:
        code = BAD_INTERVAL
    elif not (np.isfinite(q) and np.isfinite(g[APPLIED, j]) and np.isfinite(g[KNOWN, j])):
        code = NOT_FINITE
    elif abs(dp) > g[TOP, j] * T:
        code = JUMP
    if code != OK:
        g[STALE, j] += dt if timely else nominal
        if code == JUMP and g[STALE, j] > g[PATIENCE, j] and abs(q - g[ELSEWHERE, j]) <= g[TOP, j] * T:
            g[BEFORE, j], g[SINCE, j], g[STALE, j] = q, 0.0, 0.0  # the encoder counts from another zero
        if np.isfinite(q):
            g[ELSEWHERE, j] = q
        fading = 1.0 + g[FADE, j] * nominal
        g[TORQUE, j] /= fading
        g[EXTERNAL, j] /= fading
        return code
    load, temp = (g[MOTOR, j], g[LOAD, j]), g[TEMPERATURE, j]
    f = compensator_.tick(
        c, i, p, x, s, 0, q, dp, T, g[TIME, j], g[ERROR, j], g[SLOPE, j], g[APPLIED, j], load, temp
    )
    if g[ESTIMATES, j] > 0.0:
        tau_e, tau_f = external_.tick(ce, 0, pe, xe, se, 0, q, dp, T, g[APPLIED, j], g[KNOWN, j], load, temp)
        g[EXTERNAL, j], g[FRICTION, j] = tau_e, tau_f
    if not np.isfinite(f):
        g[TORQUE, j] /= 1.0 + g[FADE, j] * nominal
        return NOT_FINITE
    limit = g[LIMIT, j]
    if abs(f) > limit:
        f = limit if f > 0.0 else -limit
        code = SATURATED
    g[TORQUE, j] = f
    g[BEFORE, j], g[SINCE, j], g[STALE, j], g[ELSEWHERE, j] = q, 0.0, 0.0, q
    return code


@jit
def tick(C, P, X, S, CE, PE, XE, SE, g, codes, q, dt):
    """Advance every joint by one tick and return the worst status."""
    worst = OK
    fits = q.size == codes.size
    for j in range(codes.size):
        codes[j] = joint(
            C[j], 0, P[j], X[j], S[j], CE[j], PE[j], XE[j], SE[j], g, j, q[j] if fits else np.nan, dt
        )
        if codes[j] != OK and worst in (OK, SATURATED):
            worst = codes[j]
    return worst


@dataclass(frozen=True, kw_only=True)
class JointLoop:
    """What runs on one joint.

    Attributes:
        compensator: of friction.
        external: estimator of the external force; None for none.
        top_speed: faster than which the joint cannot move [rad/s or m/s].
        limit: of the compensator's output [N.m or N].
        fade: rate at which the output fades while readings are not believed [1/s].
        patience: after which a jump is taken for the encoder's new zero [s].
    """

    compensator: Compensator = field(default_factory=Compensator)
    external: ExternalForce | None = None
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
    for row, values in (
        (TOP, [j.top_speed for j in joints]),
        (LIMIT, [j.limit for j in joints]),
        (FADE, [j.fade for j in joints]),
        (PATIENCE, [j.patience for j in joints]),
        (ESTIMATES, [float(j.external is not None) for j in joints]),
    ):
        table[row] = values
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
        self._arrays = rows(self.joints, np.zeros(J), self.interval)
        self.table = self._arrays[-1]
        self.codes = np.zeros(J, dtype=np.int64)
        self.torque, self.external, self.friction = (self.table[k] for k in (TORQUE, EXTERNAL, FRICTION))
        self.error, self.slope, self.known = (self.table[k] for k in (ERROR, SLOPE, KNOWN))
        self.load, self.temperature = self.table[MOTOR : LOAD + 1].T, self.table[TEMPERATURE]
        self._applied = self.table[APPLIED]
        self.update(np.zeros(J), np.zeros(J))
        self.reset(np.zeros(J))

    def reset(self, positions: np.ndarray) -> None:
        """Return to joints at rest at these positions [rad or m], (J,), relaxed, at time 0."""
        fresh = rows(self.joints, np.asarray(positions, dtype=np.float64), self.interval)
        for mine, new in zip(self._arrays, fresh):
            mine[:] = new
        self.codes[:] = OK

    def update(self, position: np.ndarray, applied: np.ndarray, interval: float | None = None) -> Status:
        """Advance every joint by one tick; nothing is allocated and nothing is raised.

        Args:
            position: encoder readings [rad or m], float64, (J,).
            applied: torque that acted since the tick before [N.m or N], (J,).
            interval: since the tick before [s]; None: the nominal one.

        Returns:
            The worst status of the joints; those of each are in `codes`.
        """
        self._applied[:] = applied
        dt = self.interval if interval is None else 1.0 * interval  # an integer would be another kernel
        given: tuple[Any, ...] = (*self._arrays, self.codes, position, dt)
        return STATUSES[tick(*given)]
