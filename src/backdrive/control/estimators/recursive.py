"""Recursive least squares for a torque loop, with drifting parameters and intermittent excitation.

    tau = sum theta_i phi_i(q, v, a),     phi = sat(v/v_0), v, a, sin q, cos q, 1, as chosen

sat(v/v_0) is sgn(v) outside the dead zone |v| <= v_0. Inside it friction is undetermined between its bounds, so nothing is
learned there if a Coulomb torque is among the parameters. With phi in units of torque noise and theta in units of its prior
standard deviation, one tick is

    forget:  P <- P + (1 - m)/m P phi phi' P / z,     z = phi' P phi,   m = 1 - (1 - lambda)(1 - tr P / n)
    learn:   theta <- theta + w P phi e / (1 + w z),  P <- P - w P phi phi' P / (1 + w z)

e: prediction error. w = c/(1 + (1 - c) z): its weight, with c = min(1, gate sqrt(1 + z) / |e|). This clips the error at the
gate (Huber), so no sample changes theta by more than gate sqrt(n) prior standard deviations. Forgetting affects only the
direction that the new sample excites (restricted exponential forgetting: R. Kulhavy, M. Karny, IFAC World Congress 1984;
R. Kulhavy, Automatica 23(5), 1987). It becomes weaker as the covariance grows (bounded-gain forgetting: J.-J. Slotine,
W. Li, Applied Nonlinear Control, 1991, 8.7). A sample with |phi| below 1 changes the torque by less than its noise, so it
causes no forgetting.

The covariance cannot wind up. Since |P phi|^2 <= tr(P) z, the trace after forgetting is at most tr(P)/m. With
x = tr(P)/n <= 1, this bound is n x / (lambda + (1 - lambda) x) <= n. The trace starts at n and therefore never exceeds n: the
uncertainty stays within that of the prior. Without noise, V = d' P^-1 d of the parameter error d never increases: forgetting
lowers P^-1, and learning reduces V by w e^2/(1 + w z). Hence |d|^2 <= n V(0) for any motion.
"""

from __future__ import annotations

import numpy as np

from backdrive._catalog import lookup
from backdrive._jit import jit, leaf
from backdrive.elementary import cos, sin
from backdrive.errors import InvalidInput
from backdrive.parameters import ABOVE_ZERO, POSITIVE, Bound, array, whole
from backdrive.status import STATUSES, Status

#: The regressors: number in the kernel, and unit of the parameter for a rotary joint.
REGRESSORS: dict[str, tuple[int, str]] = {
    "coulomb": (0, "N.m"),
    "coulomb_positive": (1, "N.m"),
    "coulomb_negative": (2, "N.m"),
    "viscous": (3, "N.m.s/rad"),
    "inertia": (4, "kg.m^2"),
    "gravity_sin": (5, "N.m"),
    "gravity_cos": (6, "N.m"),
    "offset": (7, "N.m"),
}

ALIKE = ({0, 1}, {0, 2}, {1, 2, 7})  # not to be combined: they may depend on each other linearly
DRY = 2  # regressors up to this one are Coulomb torques
FRICTION = 3  # regressors up to this one are friction
OK, NOT_FINITE, SATURATED = int(Status.OK), int(Status.NOT_FINITE), int(Status.SATURATED)
ROUNDING = 1e-9  # relative tolerance for two numbers that are equal for a single parameter


@leaf
def regressor(kind, q, v, a, dead_zone):  # noqa: PLR0911  (a kernel calls little)
    """One regressor at position q, velocity v and acceleration a."""
    if kind <= DRY:
        s = min(max(v / dead_zone, -1.0), 1.0)
        if kind == 1:
            return max(s, 0.0)
        if kind == 2:
            return min(s, 0.0)
        return s
    if kind == 3:
        return v
    if kind == 4:
        return a
    if kind == 5:
        return sin(q)
    if kind == 6:
        return cos(q)
    return 1.0


@leaf
def learn(j, n, g, theta, P, phi, gain, e):
    """Forget and learn from the error e [noise] of joint j. Return False and change nothing if this would not be finite."""
    forgetting, gate = g[j, 2], g[j, 3]
    z, size, trace, reach = 0.0, 0.0, 0.0, 0.0
    for i in range(n):
        total = 0.0
        for k in range(n):
            total += P[j, i * n + k] * phi[k]
        gain[i] = total
        z += phi[i] * total
        size += phi[i] * phi[i]
        reach += total * total
        trace += P[j, i * n + i]
    if not z <= 1e200 or not abs(e) <= 1e200:
        return False
    if not z > 0.0:
        return True
    grown, m = 0.0, 1.0
    if (
        size >= 1.0 and trace < n and reach - trace * z <= ROUNDING * reach
    ):  # the last condition holds for every covariance
        m = 1.0 - (1.0 - forgetting) * (1.0 - trace / n)
        grown = (1.0 - m) / m / z
    # after forgetting: P phi = gain/m, phi' P phi = z/m
    z_m = z / m
    bound = gate * np.sqrt(1.0 + z_m)
    c = 1.0 if abs(e) <= bound else bound / abs(e)
    share = c / (1.0 + z_m)  # w/(1 + w z)
    change = grown - share / (m * m)
    for i in range(n):
        theta[j, i] += share * e * (gain[i] / m)
        for k in range(i + 1):
            value = P[j, i * n + k] + change * (gain[i] * gain[k])
            P[j, i * n + k] = value
            P[j, k * n + i] = value
    return True


@jit
def tick(kinds, g, scale, theta, P, phi, gain, q, v, a, tau, value, out, friction, codes):  # noqa: PLR0913  (a kernel's row)
    """One tick of all joints; returns the worst status.

    `theta`, `P`: estimate in units of `scale`, (J, n), and its covariance, (J, n n). `value`: estimate in SI units. `out`,
    `friction`: predicted torque, and its part that is friction, in place. `phi`, `gain`: work arrays, (n,).
    """
    joints, n = theta.shape
    worst = OK
    fits = q.size == joints and v.size == joints and a.size == joints and tau.size == joints
    for j in range(joints):
        code = OK
        if not fits or not np.isfinite(q[j] + v[j] + a[j] + tau[j]):
            codes[j] = NOT_FINITE
            worst = NOT_FINITE if worst != NOT_FINITE else worst
            continue
        noise, dead_zone, limit = g[j, 0], g[j, 1], g[j, 4]
        dry = False
        e = tau[j]
        for i in range(n):
            x = regressor(kinds[i], q[j], v[j], a[j], dead_zone)
            phi[i] = x * scale[j, i] / noise
            e -= x * value[j, i]
            dry = dry or kinds[i] <= DRY
        known = True
        if not (dry and abs(v[j]) <= dead_zone):
            known = learn(j, n, g, theta, P, phi, gain, e / noise)
        total, rubbing = 0.0, 0.0
        for i in range(n):
            value[j, i] = theta[j, i] * scale[j, i]
            part = phi[i] * noise * theta[j, i]
            total += part
            if kinds[i] <= FRICTION:
                rubbing += part
        if not known or not np.isfinite(total):
            codes[j] = NOT_FINITE
            worst = NOT_FINITE
            continue
        if abs(total) > limit:
            total = limit if total > 0.0 else -limit
            code = SATURATED
        if abs(rubbing) > limit:
            rubbing = limit if rubbing > 0.0 else -limit
            code = SATURATED
        out[j], friction[j], codes[j] = total, rubbing, code
        if code != OK and worst == OK:
            worst = code
    return worst


class RecursiveLeastSquares:
    """Estimate friction, inertia and gravity of every joint while it moves.

    Attributes:
        names: the parameters, in the order of the columns.
        estimate: their values, updated in place by `tick` (J, n).
        torque: predicted torque [N.m or N], updated in place (J,).
        friction: the share of `torque` that is Coulomb and viscous friction [N.m or N], updated in place (J,).
        codes: `Status` of every joint, updated in place (J,).
    """

    def __init__(
        self,
        regressors: tuple[str, ...],
        *,
        spread: np.ndarray | float,
        noise: np.ndarray | float,
        joints: int = 1,
        start: np.ndarray | float = 0.0,
        dead_zone: np.ndarray | float = 1e-3,
        forgetting: np.ndarray | float = 0.9995,
        gate: float = 5.0,
        limit: np.ndarray | float = np.inf,
    ):
        """Check the settings and compile the kernel, so that the first tick takes no longer than the next.

        Args:
            regressors: names out of `REGRESSORS`.
            spread: standard deviation of the parameters around `start`, in their units, one number, (n,) or (J, n). Averaged
                over the parameters, it is also the largest uncertainty of the estimate.
            noise: standard deviation of the measured torque around the model [N.m or N], one number or (J,).
            joints: J, how many.
            start: parameters at the start, in their units, one number, (n,) or (J, n).
            dead_zone: v_0, speed below which friction is not learned from [rad/s or m/s], one number or (J,).
            forgetting: lambda. Each sample updates one of n directions. So the memory is about n/(1 - lambda) samples under a
                motion that excites all directions [-].
            gate: errors beyond this many standard deviations (a contact, an outlier) get a lower weight.
            limit: largest predicted torque [N.m or N], one number or (J,).

        Raises:
            InvalidInput: a setting is out of range, or a regressor is named twice.
            UnknownName: there is no such regressor.
        """
        self.names = tuple(regressors)
        kinds = [lookup(name, REGRESSORS, "regressor")[0] for name in self.names]
        n = len(kinds)
        if n == 0 or len(set(kinds)) < n or any(same <= set(kinds) for same in ALIKE):
            raise InvalidInput(
                f"The regressors {self.names} are empty, or some of them are linearly dependent.",
                remedy="Name each once; use 'coulomb' with 'offset', or a Coulomb torque for each direction without it.",
            )
        J = whole("joints", joints)
        tables = ((), (n,), (J, n))
        self._scale = np.array(np.broadcast_to(array("'spread'", spread, *tables, bound=POSITIVE), (J, n)))
        first = np.array(np.broadcast_to(array("'start'", start, *tables), (J, n)))
        settings = (
            ("noise", noise, POSITIVE),
            ("dead_zone", dead_zone, POSITIVE),
            ("forgetting", forgetting, Bound(0.5, 1.0, open_low=True)),
            ("gate", gate, POSITIVE),
            ("limit", limit, ABOVE_ZERO),
        )
        columns = [
            np.broadcast_to(array(f"'{name}'", value, (), (J,), bound=bound), (J,))
            for name, value, bound in settings
        ]
        self._kinds = np.array(kinds, dtype=np.int64)
        self._settings = np.ascontiguousarray(np.stack(columns, axis=1))
        self._start = first
        self._theta, self._P = np.zeros((J, n)), np.zeros((J, n * n))
        self._phi, self._gain = np.zeros(n), np.zeros(n)
        self.estimate, self.torque, self.friction = np.zeros((J, n)), np.zeros(J), np.zeros(J)
        self.codes = np.zeros(J, dtype=np.int64)
        rest = np.zeros(J)
        self.tick(rest, rest, rest, rest)
        self.reset()

    def reset(self) -> None:
        """Return to the start, the covariance to the prior's."""
        n = self._kinds.size
        self._theta[:] = self._start / self._scale
        self._P[:] = np.eye(n).reshape(-1)
        self.estimate[:] = self._start
        self.torque[:], self.friction[:], self.codes[:] = 0.0, 0.0, OK

    def tick(
        self, position: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray, torque: np.ndarray
    ) -> Status:
        """Learn from one sample and predict its torque; all rows are float64, and nothing is raised.

        Where an input is not finite, or a row is not (J,), the estimate and the predicted torque stay as they are.

        Args:
            position: q [rad or m], (J,).
            velocity: v [rad/s or m/s], (J,).
            acceleration: a [rad/s^2 or m/s^2], (J,).
            torque: measured [N.m or N], (J,).

        Returns:
            The worst status of the joints; those of each are in `codes`.
        """
        return STATUSES[
            tick(
                self._kinds,
                self._settings,
                self._scale,
                self._theta,
                self._P,
                self._phi,
                self._gain,
                position,
                velocity,
                acceleration,
                torque,
                self.estimate,
                self.torque,
                self.friction,
                self.codes,
            )
        ]

    def uncertainty(self) -> np.ndarray:
        """Return standard deviations of the estimate for white torque noise of the given size, in its units, (J, n)."""
        J, n = self._theta.shape
        return np.sqrt(np.diagonal(self._P.reshape(J, n, n), axis1=1, axis2=2).clip(0.0)) * self._scale
