"""Forward dynamics of single axes: from the input of the drive to the motion, for many parameter sets at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np

from backdrive._documents import as_list
from backdrive._jit import jit, leaf
from backdrive._memory import empty
from backdrive.engine import axis as axis_
from backdrive.engine import drives, lockstep
from backdrive.engine.cores import spread
from backdrive.engine.drives import DriveModel
from backdrive.engine.series import Lanes
from backdrive.errors import InvalidInput, check_type
from backdrive.laws import REFERENCE, Law, kernels
from backdrive.parameters import ABOVE_ZERO, FINITE, NOT_NEGATIVE, WithBounds, array, number, numbers, whole


@leaf
def sample(j, d, rate, element, p, x, s, c, r, k, supply, on, temp, dt, substeps, out):  # noqa: PLR0913  (a kernel's row)
    """Note motor-side position, its velocity and the drive's torque at the sample k in `out` (3,), and advance to the next.

    `j`, `d`: rows of axis and drive; `s`, `c`: their states; r: input of the drive (n,); supply, on, temp: at the sample.
    """
    h = dt / substeps
    out[0], out[1] = s[0], s[1]
    for i in range(substeps):
        u = drives.torque_at(d, c, r, k + i / substeps, on, supply, s[0], s[1], h, dt)
        if i == 0:
            out[2] = u
        axis_.advance(j, s, rate, element, p, x, u, h, temp)


@jit
def lanes(first, last, J, D, rates, elements, P, X, S, C, log, r, supply, enabled, temp, dt, substeps, out):  # noqa: PLR0913  (a kernel's row)
    """Run lanes first to last - 1. A lane is one axis driven by one of the inputs."""
    supplies, switches, temps = supply.shape[1] > 1, enabled.shape[1] > 1, temp.shape[1] > 1
    for i in range(first, last):
        m = log[i]
        law = rates[i], elements[i], P[i], X[i]
        drives.begin(D[i], C[i], r[m], S[i, 0], dt)
        for k in range(r.shape[1]):
            volts, on = supply[m, k if supplies else 0], enabled[m, k if switches else 0]
            t = temp[m, k if temps else 0]
            sample(J[i], D[i], *law, S[i], C[i], r[m], k, volts, on, t, dt, substeps, out[i, k])


def loop_of(
    rates: np.ndarray, elements: np.ndarray, rows: np.ndarray, fewest: int = lockstep.WIDTH
) -> Callable[..., None]:
    """Return a compiled loop over lanes of given laws, with the arguments of `lanes`, of which it gives the numbers.

    Args:
        rates: kind of the rate law of each lane, without unit, (L,).
        elements: kind of its element, (L,).
        rows: parameters of its law, (L, P).
        fewest: least number of lanes that are worth a loop in lockstep.
    """
    kinds = {*zip(rates.tolist(), elements.tolist(), rows[:, 0].tolist(), strict=True)}
    if len(rates) < fewest or len(kinds) > 1 or not lockstep.serves(int(elements[0]), rows):
        return kernels.of_kinds(lanes, rates, elements, kernels.plain(rows))
    ((rate, element, size),) = kinds
    run = lockstep.in_lockstep(rate, element, 1 + int(size))

    def together(first, last, J, D, rates, elements, *others):
        # a search that has ended goes on with any numbers, of which the interpreter alone would warn
        with np.errstate(all="ignore"):
            run(first, last, J, D, *others, *lockstep.work())

    return together


@dataclass(frozen=True, kw_only=True)
class Axis(WithBounds):
    """One joint with its drive, for forward dynamics.

    Attributes:
        law: its friction.
        inertia: of the motor's side; of the whole axis if it is rigid and has no `load_inertia` [kg.m^2 or kg].
        drive: what turns the input into torque.
        load_inertia: of the load's side [kg.m^2 or kg]; laws that depend on the load count its inertial torque as load.
        stiffness: K_c of the transmission [N.m/rad or N/m]; infinite for a rigid one.
        damping: D_c of the transmission [N.m.s/rad or N.s/m].
        gravity_sin: a of gravity a sin q + b cos q [N.m or N].
        gravity_cos: b of the same [N.m or N].
        offset: a constant torque with the sign of friction: a positive one resists motion along +q [N.m or N].
        friction_side: which mass the friction acts on.
        load_dependence: mu, further Coulomb friction in proportion to the transmitted torque [-]. `Law.growth` instead makes the
            law itself grow, with one factor for each direction of power.
    """

    BOUNDS: ClassVar = {
        "inertia": ABOVE_ZERO,
        "load_inertia": NOT_NEGATIVE,
        "stiffness": ABOVE_ZERO,
        "damping": NOT_NEGATIVE,
        "gravity_sin": FINITE,
        "gravity_cos": FINITE,
        "offset": FINITE,
        "load_dependence": NOT_NEGATIVE,
    }
    CHOICES: ClassVar = {"friction_side": ("motor", "load")}

    law: Law
    inertia: float
    drive: DriveModel = field(default_factory=DriveModel)
    load_inertia: float = 0.0
    stiffness: float = np.inf
    damping: float = 0.0
    gravity_sin: float = 0.0
    gravity_cos: float = 0.0
    offset: float = 0.0
    friction_side: Literal["motor", "load"] = "motor"
    load_dependence: float = 0.0

    def __post_init__(self):
        super().__post_init__()
        if np.isfinite(self.stiffness) and self.load_inertia == 0.0:
            raise InvalidInput("Axis: an elastic transmission needs a load.", remedy="Give load_inertia > 0.")

    def row(self) -> np.ndarray:
        """Return the row that `engine.axis.advance` reads, (10,)."""
        rigid = bool(np.isinf(self.stiffness))
        return np.array(
            [
                self.inertia,
                self.load_inertia,
                0.0 if rigid else self.stiffness,
                self.damping,
                self.gravity_sin,
                self.gravity_cos,
                float(rigid),
                float(self.friction_side == "load"),
                self.load_dependence,
                self.offset,
            ]
        )

    def at(self, position: float, velocity: float = 0.0) -> np.ndarray:
        """Return the state of an axis at a position and a velocity, with gravity carried by its transmission, (5,)."""
        row, q = self.row(), position
        if np.isfinite(self.stiffness):
            for _ in range(50):  # fixed point of K_c (p - q) = g(q); its contraction g'/K_c is far below 1
                q = position - axis_.gravity(row, q) / self.stiffness
        return np.array([position, velocity, q, velocity, axis_.gravity(row, q)])


@dataclass(frozen=True, kw_only=True)
class Motions:
    """The motion that forward dynamics computes.

    Attributes:
        position: of the motor's side [rad or m], (L, n).
        velocity: of the motor's side [rad/s or m/s], (L, n).
        torque: of the drive [N.m or N], (L, n).
    """

    position: np.ndarray
    velocity: np.ndarray
    torque: np.ndarray


def forward(  # noqa: PLR0913  (its options are given by keyword)
    axes: Axis | Sequence[Axis],
    drive_input: np.ndarray,
    *,
    dt: float,
    position: np.ndarray | float = 0.0,
    velocity: np.ndarray | float = 0.0,
    log: np.ndarray | None = None,
    supply: np.ndarray | None = None,
    enabled: np.ndarray | None = None,
    temperature: np.ndarray | None = None,
    substeps: int = 1,
    workers: int | None = None,
) -> Motions:
    """Return the motion of axes under the inputs of their drives. Friction is implicit, so a stuck axis rests exactly.

    Args:
        axes: one for each lane, or a single one; a lane is one axis driven by one of the inputs.
        drive_input: of the drives: torque, position, velocity, voltage or duty [SI], (n,) or (M, n).
        dt: sampling time [s].
        position: where the motions start [rad or m], one number or (M,).
        velocity: with which they start [rad/s or m/s], one number or (M,).
        log: number of the input of each lane, (L,); None: lane i has input i, or all lanes share the only input.
        supply: measured supply voltage [V], (M, n); None: the drives' own.
        enabled: 0 where the drive is switched off, (M, n); None: always on.
        temperature: [degC], (M, n); None: 20.
        substeps: integration steps per sample; the controllers run in each.
        workers: threads; None: one per core. The numbers do not depend on it.

    Returns:
        Position, velocity and drive torque at every sample, (L, n) each.

    Raises:
        InvalidInput: shapes do not match, or a value is not finite.
    """
    axes = as_list(axes)
    for axis in axes:
        check_type(axis, Axis, "axis", "Give Axis(law=..., inertia=...), one or several.")
    r = np.ascontiguousarray(np.atleast_2d(numbers("drive_input", drive_input)))
    M, n = r.shape
    if not axes or n == 0 or not np.all(np.isfinite(r)):
        raise InvalidInput(
            f"{len(axes)} axes on inputs of shape {r.shape}, all finite: {bool(np.all(np.isfinite(r)))}.",
            remedy="Give at least one axis and finite inputs.",
        )
    dt, substeps = number("dt [s]", dt), whole("substeps", substeps)
    if log is None and M > 1 and len(axes) != M:
        raise InvalidInput(
            f"{len(axes)} axes and {M} inputs.",
            remedy="Give one input, one for each axis, or name the input of each axis in `log`.",
        )
    usual = np.zeros(len(axes)) if M == 1 else np.arange(len(axes))
    asked = numbers("log", usual if log is None else log)
    if not np.all(asked == np.round(asked)):
        raise InvalidInput(
            "log contains a value that is no whole number.", remedy="Give every axis the number of an input."
        )
    inputs: np.ndarray = asked.astype(np.int64)
    if inputs.shape != (len(axes),) or inputs.min() < 0 or inputs.max() >= M:
        raise InvalidInput(
            f"{len(axes)} axes, {M} inputs, and `log` of shape {inputs.shape}.",
            remedy="Name an existing input for every axis.",
        )
    supplies, switches, warmth = (
        np.full((M, 1), usual)
        if given is None
        else np.ascontiguousarray(array(name, np.atleast_2d(given), (M, n)))
        for name, given, usual in (
            ("supply", supply, np.nan),
            ("enabled", enabled, 1.0),
            ("temperature", temperature, REFERENCE),
        )
    )
    start, speed = (
        np.broadcast_to(array(name, given, (), (1,), (M,)), (M,))
        for name, given in (("position", position), ("velocity", velocity))
    )
    rows = Lanes([a.law for a in axes])
    J = np.array([a.row() for a in axes])
    D = np.array([a.drive.row() for a in axes])
    S = np.array([a.at(float(start[m]), float(speed[m])) for a, m in zip(axes, inputs, strict=True)])
    out = empty((len(axes), n, 3))
    X, C = np.zeros((len(axes), rows.states)), np.zeros((len(axes), drives.STATES))

    run = loop_of(rows.rates, rows.elements, rows.rows)
    laws = rows.rates, rows.elements, rows.rows

    def work(first: int, last: int) -> None:
        run(first, last, J, D, *laws, X, S, C, inputs, r, supplies, switches, warmth, dt, substeps, out)

    spread(work, len(axes), workers)
    return Motions(position=out[..., 0], velocity=out[..., 1], torque=out[..., 2])
