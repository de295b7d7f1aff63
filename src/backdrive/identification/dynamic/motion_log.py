"""One recorded motion of one axis with the drive's input: the data of a fit through forward dynamics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from backdrive.errors import InvalidInput


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionLog:
    """One recorded motion of one axis with the drive's input.

    Attributes:
        position: measured [rad or m], (n,).
        drive_input: input of the drive: torque, position, velocity, voltage or duty cycle [SI], (n,).
        dt: sampling time [s].
        velocity: measured [rad/s or m/s], (n,); None: only the position is known.
        start: initial velocity [rad/s or m/s]; None: from the first samples.
        proportional: the drive's K_p in this log [output/rad or output/m]; None: that of the axis.
        supply: measured supply voltage [V], (n,); None: not measured.
        enabled: 0 where the drive was off, (n,).
        temperature: [degC], (n,).
        shapes: functions of time by name, (n,) each, which are added to the drive's input with estimated factors, such as the
            drift of an amplifier; `shape.<name>` is the factor.
        judged: samples that count, (n,); None: all.
        name: for messages and tables.
    """

    position: np.ndarray
    drive_input: np.ndarray
    dt: float
    velocity: np.ndarray | None = None
    start: float | None = None
    proportional: float | None = None
    supply: np.ndarray | None = None
    enabled: np.ndarray | None = None
    temperature: np.ndarray | None = None
    shapes: Mapping[str, np.ndarray] = field(default_factory=dict)
    judged: np.ndarray | None = None
    name: str = "log"

    def __post_init__(self):
        n = np.size(self.position)
        for key in ("position", "drive_input", "velocity", "supply", "enabled", "temperature"):
            value = getattr(self, key)
            if value is None:
                continue
            value = np.ascontiguousarray(value, dtype=np.float64)
            if value.shape != (n,) or n < 2 or not np.all(np.isfinite(value)):
                raise InvalidInput(
                    f"'{self.name}': {key} has the shape {value.shape}, the position {np.shape(self.position)}, "
                    f"all finite: {bool(np.all(np.isfinite(value)))}.",
                    remedy="Give series of one length, at least two samples, without gaps.",
                )
            object.__setattr__(self, key, value)
        if not 0.0 < self.dt < np.inf:
            raise InvalidInput(f"'{self.name}': dt = {self.dt} s.", remedy="Give the sampling time.")
        if self.judged is not None and np.shape(self.judged) != (n,):
            raise InvalidInput(
                f"'{self.name}': judged has the shape {np.shape(self.judged)}.", remedy=f"Give ({n},)."
            )

    @property
    def launch(self) -> float:
        """Initial velocity [rad/s or m/s]."""
        if self.start is not None:
            return self.start
        if self.velocity is not None:
            return float(self.velocity[0])
        k = min(5, len(self.position) - 1)
        return float(self.position[k] - self.position[0]) / (k * self.dt)

    @property
    def counts(self) -> np.ndarray:
        """Samples that count, (n,)."""
        return np.ones(len(self.position), dtype=bool) if self.judged is None else self.judged

    def windows(self, length: float, velocity: np.ndarray | None = None) -> list[MotionLog]:
        """Return the motion in pieces of equal length, each from its own measured initial state.

        Args:
            length: of a piece [s].
            velocity: source of the initial velocities [rad/s or m/s], (n,); None: the measured velocity.
        """
        n, size = len(self.position), max(2, round(length / self.dt))
        speed = self.velocity if velocity is None else velocity
        pieces = []
        for a in range(0, n - size // 2, size):
            at = slice(a, min(a + size, n) if n - a - size >= size // 2 else n)
            cut = {
                key: getattr(self, key)[at]
                for key in (
                    "position",
                    "drive_input",
                    "velocity",
                    "supply",
                    "enabled",
                    "temperature",
                    "judged",
                )
                if getattr(self, key) is not None
            }
            start = self.launch if a == 0 else None if speed is None else float(speed[a])
            shapes = {key: value[at] for key, value in self.shapes.items()}
            pieces.append(replace(self, **cut, shapes=shapes, start=start, name=f"{self.name}[{a}]"))
            if at.stop == n:
                break
        return pieces
