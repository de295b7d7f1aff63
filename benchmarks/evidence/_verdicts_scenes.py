"""Clean scenes for `verdicts`: a random joint and one of five motions, as logs, and how surely a fault in them can be told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from _independent import STEP, Joint, Logger, Record, multisine, record, rested, sweep, trapezoids
from scipy.ndimage import gaussian_filter1d

MOTIONS = ("sines", "sweep", "sweeps", "speeds", "moves")
RATES = (100.0, 200.0, 500.0, 1000.0, 5000.0)
SECONDS = 16.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """What a log is made of.

    Attributes:
        motion: one of `MOTIONS`.
        joint: the truth.
        references: position at every step, one a log [rad].
        logger: how it is logged.
        seed: of the noise, the same for a fault and its clean twin.
        top: top speed [rad/s].
    """

    motion: str
    joint: Joint
    references: tuple[np.ndarray, ...]
    logger: Logger
    seed: int
    top: float

    def rng(self) -> np.random.Generator:
        """Return the generator of what is planted, apart from that of the noise."""
        return np.random.default_rng([14, self.seed])

    def logs(self, *, push: np.ndarray | None = None) -> list[Record]:
        """Return the logs; the environment pushes in every one."""
        rng = np.random.default_rng([15, self.seed])
        made = []
        for reference in self.references:
            force = None if push is None else np.resize(push, reference.size)
            made.append(record(self.joint, reference, self.logger, rng, push=force))
        return made

    def of(self, **changes: object) -> Scene:
        """Return the scene with another joint: attributes of `Joint`."""
        return replace(self, joint=replace(self.joint, **changes))

    def logged(self, **changes: object) -> Scene:
        """Return the scene logged otherwise: attributes of `Logger`."""
        return replace(self, logger=replace(self.logger, **changes))


def scene(seed: int, motion: str, *, rate: float | None = None, gravity: bool | None = None) -> Scene:
    """Return a clean scene.

    Args:
        seed: draws everything.
        motion: one of `MOTIONS`.
        rate: of sampling [Hz]; None: drawn.
        gravity: the joint carries some; None: drawn.
    """
    rng = np.random.default_rng([16, seed])
    top, coulomb = rng.uniform(1.0, 2.5), 10.0 ** rng.uniform(-0.3, 0.7)
    pull = coulomb * rng.uniform(0.5, 2.5)
    angle = rng.uniform(0.0, 2.0 * np.pi)
    heavy = rng.random() < 0.5 if gravity is None else gravity
    joint = Joint(
        inertia=coulomb * rng.uniform(0.05, 0.2),
        coulomb=coulomb,
        viscous=coulomb / top * rng.uniform(0.2, 0.6),
        gravity=(pull * np.cos(angle), pull * np.sin(angle)) if heavy else (0.0, 0.0),
        offset=coulomb * rng.uniform(-0.1, 0.1),
        width=10.0 ** rng.uniform(-4.0, -3.0),
    )
    drawn = float(rng.choice(RATES))
    logger = Logger(
        rate=drawn if rate is None else rate,
        noise=coulomb * rng.uniform(0.02, 0.06),
        colour=0.9 if rng.random() < 0.3 else 0.0,
    )
    return Scene(
        motion=motion,
        joint=joint,
        references=references(motion, top, rng),
        logger=logger,
        seed=seed,
        top=top,
    )


def softer(clean: Scene) -> Scene:
    """Return a scene that in three of ten cases builds its friction up over 1e-3 to 5e-3 rad."""
    rng = np.random.default_rng([17, clean.seed])
    return clean.of(width=rng.uniform(1e-3, 5e-3)) if rng.random() < 0.3 else clean


def references(motion: str, top: float, rng: np.random.Generator) -> tuple[np.ndarray, ...]:
    """Return the motion, one array of positions a log."""
    if motion == "sines":
        return (multisine(SECONDS, top, rng),)
    if motion == "sweep":
        return (sweep(rng.uniform(-1.0, 1.0), 0.3, top, 6),)
    if motion == "sweeps":
        return tuple(sweep(c, 0.3, top, 6) for c in rng.uniform(-0.3, 0.3) + np.array([-1.2, 0.0, 1.2]))
    if motion == "speeds":
        return (trapezoids(top * np.arange(1, 7) / 6.0, 1.2, 0.2),)
    return (rested(multisine(SECONDS, top, rng, 0.12), 5, 0.8),)


def tell(planted: Sequence[Record], clean: Sequence[Record]) -> float:
    """Return the noncentrality of a fault [-]: how much it changes the whitened residual of a line, inertia and gravity.

    It is the length of the difference of both residuals by the true covariance of the noise, which is the same in both logs. Where
    samples were lost, there is no such difference; it is then the square root of the increase of the residual sum of squares.
    """
    (with_fault, used), (without, as_well) = _residual(planted), _residual(clean)
    if not (np.isfinite(with_fault).all() and np.isfinite(without).all()):
        return np.inf
    if used.shape != as_well.shape:
        return float(np.sqrt(max(np.sum(with_fault**2) - np.sum(without**2), 0.0)))
    return float(np.linalg.norm((with_fault - without)[used & as_well]))


def _residual(records: Sequence[Record]) -> tuple[np.ndarray, np.ndarray]:
    """Return the whitened residual of every sample, zero where the joint hardly moves, and which do count, (n,) each."""
    masks = []
    rows, torques = [], []
    for made in records:
        period = float(np.median(np.diff(made.time)))
        if not period > 0.0:
            return np.array([np.inf]), np.array([True])
        q = gaussian_filter1d(made.position, max(0.01 / period, 1.0))
        v = np.gradient(q, period)
        a = np.gradient(v, period)
        columns = [np.sign(v), v, a, np.gradient(a, period), np.ones_like(v), np.sin(q), np.cos(q)]
        if made.known is not None:
            columns.append(made.known)
        X = np.stack(columns, axis=1)
        used = np.abs(v) > 0.05 * np.abs(v).max()
        used[1:] &= used[:-1]
        used[0] = False
        colour, scale = made.logger.colour, made.logger.noise * np.sqrt(1.0 - made.logger.colour**2)
        rows.append(((X - colour * np.roll(X, 1, axis=0)) / scale)[used])
        torques.append(((made.torque - colour * np.roll(made.torque, 1)) / scale)[used])
        masks.append(used)
    X, y = np.concatenate(rows), np.concatenate(torques)
    size = np.maximum(np.linalg.norm(X, axis=0), 1e-300)
    theta = np.linalg.lstsq(X / size, y, rcond=1e-10)[0]
    used = np.concatenate(masks)
    left = np.zeros(used.size)
    left[used] = y - X / size @ theta
    return left, used


def steps(seconds: float) -> int:
    """Return how many steps of the integration a time has."""
    return round(seconds / STEP)
