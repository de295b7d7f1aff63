"""A motion of a whole arm: a Fourier series of every joint, run at full pace, then slowly, from rest to rest.

    q_j(s) = center_j + sum_k sine_jk sin(w_k s) + cosine_jk cos(w_k s),      w_k = 2 pi k / period

The path q(s) is closed (Swevers, Ganseman, Tuekel, De Schutter, Van Brussel, IEEE Trans. Robotics and Automation 13, 1997).
The speed along the path depends on its time s alone. The pace ds/dt rises from 0 to 1 and stays there for whole periods. It
then falls to `slow`, for friction at low speed and near slow reversals, and falls to 0 where the path closes. So the plan
never leaves the path of one period.
"""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import Any, ClassVar, Literal

import numpy as np

from backdrive.errors import InvalidInput, UnknownName
from backdrive.parameters import FINITE, NOT_NEGATIVE, POSITIVE, array, number, whole
from backdrive.plans.base import PlanFace, check_name, instants

MOST_PERIODS = 1000
MOST_HARMONICS = 100


@dataclass(frozen=True)
class ArmPlan(PlanFace):
    """A motion of all joints of an arm at once.

    Attributes:
        joints: names, in column order, (J,).
        units: `rad` or `m`, (J,).
        center: about which each swings [rad or m], (J,).
        sine: amplitudes by joint and multiple of 1/period [rad or m], (J, m).
        cosine: the same of the cosines.
        period: of the path [s].
        periods: how often the path is closed before the end.
        slow: pace of the slow part, as a share of the full one [-].
        slow_time: duration of the slow part [s].
        ramp: duration of each change of pace [s].
        start: instant at which it begins, on the log's clock [s].
        noise: assumed noise of the torque below 5 Hz [N.m or N], (J,); empty: not stated.
        purpose: purposes of the plan.
    """

    joints: tuple[str, ...]
    units: tuple[Literal["rad", "m"], ...]
    center: tuple[float, ...]
    sine: tuple[tuple[float, ...], ...]
    cosine: tuple[tuple[float, ...], ...]
    period: float
    _: KW_ONLY
    periods: int = 2
    slow: float = 0.25
    slow_time: float = 10.0
    ramp: float = 2.0
    start: float = 0.0
    noise: tuple[float, ...] = ()
    purpose: tuple[str, ...] = ()

    kind: ClassVar[str] = "arm"
    commands: ClassVar[str] = "position"

    def __post_init__(self):
        for name, bound in (
            *(("period", POSITIVE), ("slow", POSITIVE), ("ramp", POSITIVE)),
            *(("slow_time", NOT_NEGATIVE), ("start", FINITE)),
        ):
            object.__setattr__(self, name, number(f"ArmPlan.{name}", getattr(self, name), bound))
        object.__setattr__(self, "periods", whole("ArmPlan.periods", self.periods, most=MOST_PERIODS))
        for name in ("joints", "units", "center", "noise", "purpose"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        for name in self.joints:
            check_name(name)
        J, m = len(self.joints), len(self.sine[0]) if self.sine else 0
        if not J or len(set(self.joints)) < J or len(self.units) != J or set(self.units) - {"rad", "m"}:
            raise InvalidInput(
                f"ArmPlan: joints {', '.join(self.joints)} with units {', '.join(self.units)}.",
                remedy="Name each joint once, with rad or m for each.",
            )
        if not 1 <= m <= MOST_HARMONICS:
            raise InvalidInput(f"ArmPlan: {m} sines a joint.", remedy=f"Give 1 to {MOST_HARMONICS}.")
        array("ArmPlan.center", self.center, (J,))
        for name in ("sine", "cosine"):
            rows = array(f"ArmPlan.{name}", [list(row) for row in getattr(self, name)], (J, m))
            object.__setattr__(self, name, tuple(map(tuple, rows.tolist())))
        if self.noise:
            array("ArmPlan.noise", self.noise, (J,), bound=POSITIVE)
        if self.slow > 1.0 or self._full < 0.0:
            raise InvalidInput(
                f"ArmPlan: {self.periods} periods of {self.period:g} s are too short for a slow part of {self.slow_time:g} s at "
                f"{self.slow:g} of the pace, and changes of {self.ramp:g} s.",
                remedy="Give a pace of at most 1, a shorter slow part, or more periods.",
            )

    @property
    def _full(self) -> float:
        """Time at full pace [s]: the part of the path without ramps and slow part."""
        return self.period * self.periods - self.ramp - self.slow * (self.ramp + self.slow_time)

    @cached_property
    def edges(self) -> np.ndarray:
        """Instants since the start at which the pace begins to change or is reached [s], (6,)."""
        return np.cumsum([0.0, self.ramp, self._full, self.ramp, self.slow_time, self.ramp])

    @property
    def duration(self) -> float:
        """From rest to rest [s]."""
        return float(self.edges[-1])

    @property
    def home(self) -> np.ndarray:
        """Where it begins and ends at rest [rad or m], (J,)."""
        return self.series(np.zeros(1), 0)[0]

    def windows(self) -> np.ndarray:
        """Return the start and end of the full pace and of the slow part on the log's clock [s], (2, 2)."""
        return self.start + self.edges[[1, 2, 3, 4]].reshape(2, 2)

    def series(self, s: np.ndarray, order: int) -> np.ndarray:
        """Return the path or a derivative of it by its own time s [s], (n, J)."""
        sine, cosine = np.array(self.sine), np.array(self.cosine)
        w = 2.0 * np.pi / self.period * np.arange(1, sine.shape[1] + 1)
        turn = np.multiply.outer(s, w) + 0.5 * np.pi * order
        value = (np.sin(turn) * w**order) @ sine.T + (np.cos(turn) * w**order) @ cosine.T
        return value + np.array(self.center) if order == 0 else value

    def pace(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the path's time [s], the pace [-] and its change [1/s] at times since the start [s], each (n,)."""
        values = np.array([0.0, 1.0, 1.0, self.slow, self.slow, 0.0])
        spans = np.diff(self.edges)
        begun = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * spans)])
        t = np.clip(t, 0.0, self.duration)
        i = np.clip(np.searchsorted(self.edges, t, side="right") - 1, 0, 4)
        span = np.where(spans[i] > 0, spans[i], 1.0)
        x, rise = (t - self.edges[i]) / span, values[i + 1] - values[i]
        done = x**4 * (2.5 - 3.0 * x + x**2)  # integral of the smooth step
        path = begun[i] + span * (values[i] * x + rise * done)
        change = rise * 30.0 * (x * (1.0 - x)) ** 2 / span
        return path, values[i] + rise * x**3 * (10.0 - 15.0 * x + 6.0 * x**2), change

    def _motion(self, t: Any, order: int) -> np.ndarray:
        t = instants(t)
        s, pace, change = self.pace(np.ravel(t) - self.start)
        if order == 0:
            result = self.series(s, 0)
        elif order == 1:
            result = self.series(s, 1) * pace[:, None]
        else:
            result = self.series(s, 2) * pace[:, None] ** 2 + self.series(s, 1) * change[:, None]
        return result.reshape(*t.shape, len(self.joints))

    def position(self, t: Any) -> np.ndarray:
        """Return the positions [rad or m] at instants t [s], the shape of t and (J,)."""
        return self._motion(t, 0)

    def velocity(self, t: Any) -> np.ndarray:
        """Return the velocities [rad/s or m/s] at instants t [s], the shape of t and (J,)."""
        return self._motion(t, 1)

    def acceleration(self, t: Any) -> np.ndarray:
        """Return the accelerations [rad/s^2 or m/s^2] at instants t [s], the shape of t and (J,)."""
        return self._motion(t, 2)

    def plan_of(self, joint: str) -> JointOfArm:
        """Return the motion of one joint.

        Raises:
            UnknownName: there is no such joint.
        """
        if joint not in self.joints:
            raise UnknownName(
                f"Joint '{joint}' does not move in this plan.",
                remedy=f"Those that do: {', '.join(self.joints)}.",
            )
        i = self.joints.index(joint)
        return JointOfArm(plan=self, column=i, joint=joint, unit=self.units[i], start=self.start)


@dataclass(frozen=True, kw_only=True)
class JointOfArm:
    """One column of a plan of a whole arm.

    Attributes:
        plan: of the arm.
        column: of the joint.
        joint: its name.
        unit: `rad` or `m`.
        start: instant at which it begins, on the log's clock [s].
    """

    plan: ArmPlan
    column: int
    joint: str
    unit: Literal["rad", "m"]
    start: float

    kind: ClassVar[str] = "arm"
    commands: ClassVar[str] = "position"

    def _at(self, t: Any, order: int) -> np.ndarray:
        return self.plan._motion(instants(t) - self.start + self.plan.start, order)[..., self.column]

    def position(self, t: Any) -> np.ndarray:
        """Return the position [rad or m] at instants t [s], the shape of t."""
        return self._at(t, 0)

    def velocity(self, t: Any) -> np.ndarray:
        """Return the velocity [rad/s or m/s] at instants t [s], the shape of t."""
        return self._at(t, 1)

    def acceleration(self, t: Any) -> np.ndarray:
        """Return the acceleration [rad/s^2 or m/s^2] at instants t [s], the shape of t."""
        return self._at(t, 2)

    def windows(self) -> np.ndarray:
        """Return the start and end of the full pace and of the slow part on the log's clock [s], (2, 2)."""
        return self.plan.windows() + self.start - self.plan.start

    @property
    def duration(self) -> float:
        """From rest to rest [s]."""
        return self.plan.duration

    @property
    def home(self) -> float:
        """Where it begins and ends at rest [rad or m]."""
        return float(self.plan.home[self.column])

    @property
    def position_range(self) -> tuple[float, float]:
        """Bounds that the position does not leave [rad or m]."""
        i = self.column
        reach = float(np.hypot(self.plan.sine[i], self.plan.cosine[i]).sum())
        return self.plan.center[i] - reach, self.plan.center[i] + reach
