"""The terms of an arm's inverse dynamics, and the rows of a fit built from them.

    tau_j = Y_j(q, dq, ddq) theta + inertia_j ddq_j + offset_j
            + s_j (F_j(dq_j) + load_friction_j |Y_j theta|),       s_j = tanh(dq_j / transition_j)

Y theta is the torque of the rigid bodies; `inertia` is that of the motor, which acts on its own joint alone. F is the friction
curve of each direction, line sections between knots and constant above the last one. `load_friction` is friction proportional
to the torque in the gear: the load-dependent loss of harmonic drives and planetary gears (Hamon, Gautier, Garrec, IROS 2010).
The smooth sign s replaces the sign of the velocity, since no encoder resolves the instant of a reversal. All but the load term
are linear in their coefficients; the load is taken from the previous iteration of the fit.

If motors drive several joints (q = C q_motor), friction and inertia act at the motors. Then tau, and dq and ddq of the last
four terms, are those of the motors. The torque of the bodies is C' Y theta. On the joints, the motors' inertia is a full matrix.

Torque and all columns then pass the same zero-phase low pass ("parallel filtering", Gautier 1997), and are thinned.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from backdrive.identification import curves
from backdrive.identification.arm_signals import ArmSignals, resting
from backdrive.identification.quality import JUDGED_BELOW
from backdrive.logs.filters import low_pass
from backdrive.robot import Robot

KNOTS = 8  # largest number of knots of a friction curve in each direction, the one at zero included
DENSER = 1.3  # exponent of the speed quantiles at the knots; above 1, knots lie closer near zero [-]
TOP_KNOT = 0.99  # quantile of speed above which the curve is constant [-]
APART = 0.01  # least distance of knots, relative to the top speed [-]
CREEP = 0.05  # share of the top speed below which reversals dominate the friction at a knot [-]
TRANSITION = 0.002  # transition speed of the smooth sign, relative to the top speed [-]
ROW_RATE = 4.0  # rate of the rows, relative to the low pass's cutoff frequency [-]
MOST_ROWS = 25_000  # largest number of rows
EDGE = 0.25  # length of a stretch's ends that are not fitted, since the filter sees only one side there [s]
CHUNK = 15_000  # number of samples per chunk of the regressor
PAD = 2.0  # overlap of a chunk on both sides, in which the filter settles [s]
KEEP = 100_000_000  # largest memory of stored regressors [byte]


@dataclass(frozen=True, kw_only=True, eq=False)
class Terms:
    """The parameters of one joint's friction columns.

    Attributes:
        knots: speeds of the curve's knots, the first at zero [rad/s or m/s], (k,).
        top: top speed of the motion [rad/s or m/s].
        transition: speed at which the smooth sign is 0.76 [rad/s or m/s].
    """

    knots: np.ndarray
    top: float
    transition: float

    @property
    def size(self) -> int:
        """Number of columns: both directions' knots, offset, inertia, load friction."""
        return 2 * self.knots.size + 3

    @property
    def sliding(self) -> np.ndarray:
        """Return a mask of the knots at which the joint slides, (k,); all knots if fewer than two lie above `CREEP`.

        At lower knots, friction that builds up after a reversal and the unknown instant of the reversal determine the result.
        It may be zero there.
        """
        fast = self.knots >= CREEP * self.top
        return fast if np.count_nonzero(fast) >= 2 else np.ones_like(fast)

    def columns(self, velocity: np.ndarray, acceleration: np.ndarray, load: np.ndarray | None) -> np.ndarray:
        """Return the columns, in the order of `size`, (n, 2 k + 3).

        Args:
            velocity: [rad/s or m/s], (n,).
            acceleration: [rad/s^2 or m/s^2], (n,).
            load: torque of the rigid bodies [N.m or N], (n,); None: not known yet.
        """
        sign = np.tanh(velocity / self.transition)[:, None]
        shapes = curves.hats(np.minimum(np.abs(velocity), self.knots[-1]), self.knots)
        rest = np.zeros((velocity.size, 3))
        rest[:, 0], rest[:, 1] = 1.0, acceleration
        if load is not None:
            rest[:, 2] = np.abs(load) * sign[:, 0]
        return np.hstack([shapes * np.maximum(sign, 0.0), shapes * np.minimum(sign, 0.0), rest])


def terms_of(speed: np.ndarray) -> Terms:
    """Return the terms of a joint, with knots at quantiles of its speed.

    Args:
        speed: absolute velocities while moving [rad/s or m/s], (n,); empty for a joint that never moved.
    """
    top = float(speed.max()) if speed.size else 0.0
    if not top > 0.0:
        return Terms(knots=np.array([0.0, 1.0]), top=1.1, transition=TRANSITION)
    shares = TOP_KNOT * (np.arange(1, KNOTS) / (KNOTS - 1)) ** DENSER
    knots = [0.0]
    for candidate in np.quantile(speed, shares):
        if candidate - knots[-1] >= APART * top:
            knots.append(float(candidate))
    return Terms(knots=np.array(knots), top=max(top, 1.001 * knots[-1]), transition=TRANSITION * top)


@dataclass(frozen=True, kw_only=True, eq=False)
class Rows:
    """Filtered and thinned rows of all stretches, one after the other.

    Attributes:
        bodies: columns of the base parameters, (N, J, b).
        friction: columns of each joint's own terms, J arrays (N, 2 k + 3).
        torque: [N.m or N], (N, J).
        weight: 1 where a row may be fitted, 0 where the joint rests or the row is held out, (N, J).
        rate: rows per second [Hz].
    """

    bodies: np.ndarray
    friction: list[np.ndarray]
    torque: np.ndarray
    weight: np.ndarray
    rate: float


@dataclass(frozen=True, eq=False)
class Regressor:
    """Base regressors of stretches, chunk by chunk; they are stored as far as memory allows (`KEEP`).

    Attributes:
        robot: the description.
        stretches: signals between gaps.
    """

    robot: Robot
    stretches: Sequence[ArmSignals]
    _kept: dict[tuple[int, int], np.ndarray] = field(default_factory=dict)

    def chunks(self, s: int) -> Iterator[tuple[slice, slice, np.ndarray]]:
        """Yield (samples with margins, slice of the chunk within them, base columns (m, J, b))."""
        signals = self.stretches[s]
        n, pad = signals.time.size, round(PAD * signals.rate)
        for start in range(0, n, CHUNK):
            stop = min(start + CHUNK, n)
            wide = slice(max(start - pad, 0), min(stop + pad, n))
            yield wide, slice(start - wide.start, stop - wide.start), self._columns(s, wide)

    def _columns(self, s: int, wide: slice) -> np.ndarray:
        key = (s, wide.start)
        if key not in self._kept:
            x = self.stretches[s]
            rates = [x.velocity[wide], x.acceleration[wide]]
            if x.coupling is not None:
                rates = [rate @ x.coupling.T for rate in rates]
            columns = self.robot.regressor(x.position[wide], *rates)[:, :, self.robot.base.columns]
            if x.coupling is not None:  # power is the same on both sides: tau_motor = C' tau_joint
                columns = np.einsum("jm,njb->nmb", x.coupling, columns)
            columns = np.ascontiguousarray(columns)
            if sum(c.nbytes for c in self._kept.values()) + columns.nbytes > KEEP:
                return columns
            self._kept[key] = columns
        return self._kept[key]

    def bodies(self, s: int, beta: np.ndarray) -> np.ndarray:
        """Return the torque of the rigid bodies along a stretch [N.m or N], (n, J)."""
        return np.concatenate([columns[core] @ beta for _, core, columns in self.chunks(s)])


def steps_of(stretches: Sequence[ArmSignals]) -> int:
    """Return the number of samples per row."""
    total = sum(s.time.size for s in stretches)
    return max(1, int(stretches[0].rate // (ROW_RATE * JUDGED_BELOW)), -(-total // MOST_ROWS))


def build(regressor: Regressor, terms: Sequence[Terms]) -> Rows:
    """Return the rows of all stretches; the load columns are still zero."""
    step = steps_of(regressor.stretches)
    top = np.array([t.top for t in terms])
    bodies, torque, weight = [], [], []
    friction: list[list[np.ndarray]] = [[] for _ in terms]
    for s, x in enumerate(regressor.stretches):
        pick = slice(None, None, step)
        for wide, core, columns in regressor.chunks(s):
            take = _row_samples(wide, core, step)
            shape = columns.shape
            filtered = low_pass(columns.reshape(shape[0], -1), JUDGED_BELOW, x.rate)
            bodies.append(filtered[take].reshape(-1, *shape[1:]))
            for j, t in enumerate(terms):
                own = t.columns(x.velocity[wide, j], x.acceleration[wide, j], None)
                friction[j].append(low_pass(own, JUDGED_BELOW, x.rate)[take])
        torque.append(low_pass(x.torque, JUDGED_BELOW, x.rate)[pick])
        edge = round(EDGE * x.rate)
        use = x.fitted.copy()
        use[:edge] = use[x.time.size - edge :] = False
        weight.append((use[:, None] & ~resting(x.velocity, top, x.rate))[pick])
    return Rows(
        bodies=np.concatenate(bodies),
        friction=[np.concatenate(f) for f in friction],
        torque=np.concatenate(torque),
        weight=np.concatenate(weight).astype(np.float64),
        rate=regressor.stretches[0].rate / step,
    )


def fill_load(rows: Rows, regressor: Regressor, terms: Sequence[Terms], beta: np.ndarray) -> None:
    """Write the load columns of `rows` for the rigid bodies `beta`, in place."""
    step = steps_of(regressor.stretches)
    first = 0
    for s, x in enumerate(regressor.stretches):
        for wide, core, columns in regressor.chunks(s):
            load = np.abs(columns @ beta)
            sign = np.tanh(x.velocity[wide] / np.array([t.transition for t in terms]))
            filtered = low_pass(load * sign, JUDGED_BELOW, x.rate)[_row_samples(wide, core, step)]
            for j in range(len(terms)):
                rows.friction[j][first : first + filtered.shape[0], -1] = filtered[:, j]
            first += filtered.shape[0]


def _row_samples(wide: slice, core: slice, step: int) -> np.ndarray:
    """Return the indices of the samples that become rows, in a chunk with margins: every `step`-th of the stretch."""
    return np.flatnonzero((np.arange(wide.start, wide.stop) % step == 0)[core]) + core.start
