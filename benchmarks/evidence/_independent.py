"""Joints that share nothing with the package: own friction, own integration, own motions, noise of any colour.

    I ddq + a sin q + b cos q + o + f = u,     f = bristle or smooth crossing of zero, Stribeck peak, viscous

A stiff servo drives the joint along a reference with steps of 0.1 ms. Logged are u, as late as wished, with noise that does not
move the joint, and the encoder's position. Two crossings of zero: `elastoplastic` (Dupont, Hayward, Armstrong & Altpeter, IEEE
Trans. Autom. Control 47, 2002; the width is the displacement to break-away) and `stribeck` (tanh(v / width), a speed).
NumPy, and numba for the integrator; nothing is imported from the package.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numba import njit

STEP = 1e-4  # of the integration [s]
SERVO = 2.0 * np.pi * 15.0  # bandwidth of the position loop [rad/s]
STUCK = 0.7  # share of the break-away displacement below which the bristle only bends [-]
TURN = 2.0 * np.pi


@dataclass(frozen=True, kw_only=True)
class Joint:
    """The truth.

    Attributes:
        inertia: [kg m^2].
        coulomb: sliding friction at rest's limit along +q [N.m].
        coulomb_negative: the same along -q [N.m]; None: equal.
        viscous: [N.m s/rad].
        peak: friction at rest above `coulomb` (Stribeck) [N.m].
        peak_speed: Stribeck speed [rad/s].
        gravity: a and b of a sin q + b cos q [N.m].
        offset: of the torque [N.m].
        crossing: `elastoplastic` or `stribeck`.
        width: displacement to break-away [rad], or speed [rad/s].
        ripple: amplitude of friction over position by its size [-], and its waves a turn.
        load_growth: friction by the size of gravity that is carried [-].
        warming: friction at the end of the log by that at its beginning, less 1 [-].
    """

    inertia: float = 0.15
    coulomb: float = 1.5
    coulomb_negative: float | None = None
    viscous: float = 0.4
    peak: float = 0.0
    peak_speed: float = 0.1
    gravity: tuple[float, float] = (0.0, 0.0)
    offset: float = 0.0
    crossing: str = "elastoplastic"
    width: float = 5e-4
    ripple: tuple[float, float] = (0.0, 1.0)
    load_growth: float = 0.0
    warming: float = 0.0

    def sliding(self, speed: np.ndarray) -> np.ndarray:
        """Return the steady friction while sliding at velocities other than zero [N.m], (n,)."""
        v = np.asarray(speed, dtype=float)
        back = self.coulomb if self.coulomb_negative is None else self.coulomb_negative
        level = np.where(v > 0.0, self.coulomb, back) + self.peak * np.exp(-((v / self.peak_speed) ** 2))
        return np.sign(v) * level + self.viscous * v

    def row(self) -> np.ndarray:
        """Return the parameters as the integrator takes them, (14,)."""
        back = self.coulomb if self.coulomb_negative is None else self.coulomb_negative
        numbers = (self.inertia, self.coulomb, back, self.viscous, self.peak, self.peak_speed, *self.gravity)
        more = (self.offset, float(self.crossing == "stribeck"), self.width, *self.ripple, self.load_growth)
        return np.array([*numbers, *more], dtype=float)


@dataclass(frozen=True, kw_only=True)
class Logger:
    """How a motion is logged.

    Attributes:
        rate: of sampling [Hz].
        noise: standard deviation of the torque's noise [N.m].
        colour: correlation of neighbouring samples of it, an AR(1) [-].
        late: torque is logged so much later than motion [s].
        counts: of the encoder a turn.
    """

    rate: float = 1000.0
    noise: float = 0.05
    colour: float = 0.0
    late: float = 0.0
    counts: float = 2.0**20


@dataclass(frozen=True, kw_only=True, eq=False)
class Record:
    """A log, and what was true at its instants.

    Attributes:
        time: [s], (n,).
        position: of the encoder [rad], (n,).
        torque: as logged [N.m], (n,).
        motion: true position, velocity and acceleration, (3, n).
        clean: torque on time and without noise [N.m], (n,).
        joint: the truth.
        logger: how it was logged.
        velocity: a channel of its own [rad/s], (n,); None: not logged.
        known: torque known from elsewhere [N.m], (n,); None: not logged.
        reference: the motion that was wanted [rad], (n,).
        other: record of another joint of the same log; None: there is none.
    """

    time: np.ndarray
    position: np.ndarray
    torque: np.ndarray
    motion: np.ndarray
    clean: np.ndarray
    joint: Joint
    logger: Logger
    velocity: np.ndarray | None = None
    known: np.ndarray | None = None
    reference: np.ndarray = field(default_factory=lambda: np.zeros(0))
    other: Record | None = None

    def rows(self, part: slice | np.ndarray) -> Record:
        """Return some of the samples."""
        names = ("time", "position", "torque", "clean", "velocity", "known", "reference")
        arrays = {k: getattr(self, k)[part] for k in names if getattr(self, k) is not None}
        return replace(self, motion=self.motion[:, part], **arrays)


@njit(error_model="numpy")
def _level(p, v, q, warm):
    """Return the sliding friction without its viscous part."""
    level = p[1] if v > 0.0 else p[2]
    level += p[4] * np.exp(-((v / p[5]) ** 2))
    level *= 1.0 + p[11] * np.sin(p[12] * q)
    return warm * (level + p[13] * abs(p[6] * np.sin(q) + p[7] * np.cos(q)))


@njit(error_model="numpy")
def _drive(p, warming, wanted, torque, servo, step, out):
    """Integrate a joint: under a servo along wanted (q, v, a), or under a torque alone where servo is 0."""
    inertia, smooth, width = p[0], p[9] > 0.5, p[10]
    q, v, z = wanted[0, 0], wanted[1, 0], 0.0
    stiffness, damping = inertia * servo**2, 2.0 * inertia * servo
    n = out.shape[1]
    for k in range(n):
        warm = 1.0 + warming * k / n
        level = _level(p, v, q, warm)
        if smooth:
            friction = level * np.tanh(v / width)
        else:
            s = z / width  # elastoplastic bristle: it slides where it is bent along the motion, near its end
            slide = 0.0
            if s * v > 0.0 and abs(s) > STUCK:
                slide = (
                    1.0
                    if abs(s) >= 1.0
                    else 0.5 + 0.5 * np.sin(np.pi * ((abs(s) - STUCK) / (1.0 - STUCK) - 0.5))
                )
            z += step * v * (1.0 - slide * abs(s))
            z = min(max(z, -width), width)
            friction = level * z / width
        held = p[6] * np.sin(q) + p[7] * np.cos(q) + p[8]
        u = torque[k]
        if servo > 0.0:
            u += stiffness * (wanted[0, k] - q) + damping * (wanted[1, k] - v) + inertia * wanted[2, k] + held
        a = (u - held - friction - p[3] * v) / inertia
        out[0, k], out[1, k], out[2, k], out[3, k] = q, v, a, u
        v += step * a
        q += step * v


def noise(n: int, sd: float, colour: float, rng: np.random.Generator) -> np.ndarray:
    """Return white noise or an AR(1) of a standard deviation, (n,)."""
    white = rng.standard_normal(n)
    if colour == 0.0:
        return sd * white
    from scipy.signal import lfilter

    first = white[0] * colour  # the state before the first sample, so that all have one variance
    series, _ = lfilter([np.sqrt(1.0 - colour**2)], [1.0, -colour], white, zi=[first])
    return sd * series


def record(
    joint: Joint,
    reference: np.ndarray,
    logger: Logger,
    rng: np.random.Generator,
    *,
    torque: np.ndarray | None = None,
    push: np.ndarray | None = None,
) -> Record:
    """Return the log of a joint along a reference, or under a torque.

    Args:
        joint: the truth.
        reference: position at every step of the integration [rad], (m,).
        logger: how it is logged.
        rng: of the noise.
        torque: drives the joint alone instead of the servo [N.m], (m,).
        push: of the environment on the joint, not logged [N.m], (m,).
    """
    v = np.gradient(reference, STEP)
    wanted = np.stack([reference, v, np.gradient(v, STEP)])
    out = np.empty((4, reference.size))
    extra = np.zeros(reference.size) if torque is None else torque
    if push is not None:
        extra = extra + push
    _drive(joint.row(), joint.warming, wanted, extra, SERVO if torque is None else 0.0, STEP, out)
    if push is not None:
        out[3] -= push
    every = round(1.0 / (logger.rate * STEP))
    at = np.arange(0, reference.size, every)
    source = np.maximum(at - round(logger.late / STEP), 0)
    count = TURN / logger.counts
    return Record(
        time=at * STEP,
        position=count * np.round(out[0, at] / count),
        torque=out[3, source] + noise(at.size, logger.noise, logger.colour, rng),
        motion=out[:3, at],
        clean=out[3, at],
        joint=joint,
        logger=logger,
        reference=reference[at],
    )


def sweep(center: float, amplitude: float, top: float, cycles: int = 12, rest: float = 0.5) -> np.ndarray:
    """Return cycles of one stroke, each faster by an equal step, up to a top speed, (m,)."""
    parts = [np.full(round(rest / STEP), center - amplitude)]
    for n in range(1, cycles + 1):
        period = TURN * amplitude * cycles / (n * top)
        t = np.arange(round(period / STEP)) * STEP
        parts.append(center - amplitude * np.cos(TURN * t / period))
    parts.append(parts[0])
    return np.concatenate(parts)


def multisine(seconds: float, top: float, rng: np.random.Generator, lowest: float = 0.07) -> np.ndarray:
    """Return a sum of sines of random phases with a top speed, led in and out, (m,)."""
    t = np.arange(round(seconds / STEP)) * STEP
    q = np.zeros(t.size)
    for k in (1.0, 2.3, 4.1, 7.7, 13.1):
        q += np.sin(TURN * lowest * k * t + rng.uniform(0.0, TURN)) / k
    q *= top / np.abs(np.gradient(q, STEP)).max()
    lead = np.clip(np.minimum(t, seconds - t) / 1.0, 0.0, 1.0)
    return q * lead * lead * (3.0 - 2.0 * lead)


def rested(q: np.ndarray, rests: int, seconds: float) -> np.ndarray:
    """Return a motion that stands still so many times at turning points of its own, (m,)."""
    turns = np.flatnonzero(np.diff(np.sign(np.diff(q))) != 0) + 1
    chosen = turns[np.linspace(0, turns.size - 1, rests + 2).astype(int)[1:-1]]
    still = round(seconds / STEP)
    return np.concatenate(
        [piece for part in np.split(q, chosen) for piece in (part, np.full(still, part[-1]))]
    )


def trapezoids(speeds: np.ndarray, seconds: float, rise: float = 0.3) -> np.ndarray:
    """Return runs there and back at each speed, with smooth rises and a short rest after each, (m,)."""
    t = np.arange(round(seconds / STEP)) * STEP
    shape = np.clip(np.minimum(t, seconds - t) / rise, 0.0, 1.0)
    shape = shape * shape * (3.0 - 2.0 * shape)
    still = np.zeros(round(0.2 / STEP))
    v = np.concatenate([piece for s in speeds for way in (1.0, -1.0) for piece in (still, way * s * shape)])
    return np.cumsum(v) * STEP


def ramps(height: float, seconds: float, count: int) -> np.ndarray:
    """Return torques that rise and fall between heights of both signs in straight lines [N.m], (m,)."""
    quarter = np.arange(round(seconds / 4 / STEP)) / round(seconds / 4 / STEP)
    one = np.concatenate([quarter, 1.0 - quarter, -quarter, quarter - 1.0])
    return height * np.tile(one, count)


def ramp_to_break_away(slope: float, most: float) -> np.ndarray:
    """Return a torque that rises in a straight line [N.m], (m,)."""
    return np.arange(round(most / slope / STEP)) * STEP * slope
