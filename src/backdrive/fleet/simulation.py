"""A simulated fleet for tests: joints wear, warm with the seasons, carry payloads, get new gears, break and change names.

The friction of a joint on a day is

    tau_f = g(day) exp(-k (T - 25)) (1 + e(day)) (F_c sign(v) + F_v v)

g is the wear: 1 before its onset, then a ramp or a step. k follows from the amplitude of the season, T is the temperature of
the day in degC, and e is an AR(1) noise from day to day. A log is a multisine with the torque of the inverse dynamics. This
module uses no identification or simulation of the package, so its numbers are an independent ground truth.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import date, timedelta
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np

from backdrive._files import write_whole
from backdrive.errors import InvalidInput

TONES = ((0.15, 0.8, 0.3), (0.35, 0.45, 1.1), (0.85, 0.15, 2.0), (1.9, 0.03, 0.7))  # Hz, rad, rad
SWING = 12.0  # of the temperature over a year, about its mean [degC]
WEATHER = 3.0  # standard deviation of the temperature from day to day [degC]
MEAN = 25.0  # temperature over the year [degC]


@dataclass(frozen=True, kw_only=True)
class Event:
    """An event in the life of a robot or of one of its joints.

    Attributes:
        kind: `wear` grows friction by `size` over `length` days, `exchange` multiplies it at once by 1 + `size`, `payload` adds
            gravity of `size` N.m, `break` damages every log from then on, `rename` gives the robot another name.
        robot: number of the robot.
        joint: number of the joint; -1 for all.
        day: number of the day on which it begins.
        size: see `kind` [-, or N.m].
        length: days over which wear grows; it stays then.
    """

    kind: Literal["wear", "exchange", "payload", "break", "rename"]
    robot: int
    joint: int = -1
    day: int
    size: float = 0.0
    length: int = 60


@dataclass(frozen=True, kw_only=True)
class FleetSimulation:
    """A simulated fleet with known parameters.

    Attributes:
        robots: number of robots, all of one type.
        joints: joints of each.
        days: length of the history.
        first: its first day.
        seed: of all random numbers.
        repeatability: standard deviation of a day's friction about its truth [-].
        correlation: of that from one day to the next [-].
        season: half of the relative decrease of friction from the coldest to the warmest time of the year [-].
        spread: standard deviation of friction from robot to robot [-].
        events: what happens.
    """

    robots: int = 6
    joints: int = 1
    days: int = 60
    first: date = date(2026, 1, 5)
    seed: int = 0
    repeatability: float = 0.02
    correlation: float = 0.6
    season: float = 0.15
    spread: float = 0.05
    events: Sequence[Event] = ()

    def __post_init__(self):
        if min(self.robots, self.joints, self.days) < 1:
            raise InvalidInput(
                f"A fleet of {self.robots} robots with {self.joints} joints over {self.days} days.",
                remedy="Give at least one of each.",
            )
        if self.seed < 0:
            raise InvalidInput(f"seed = {self.seed}.", remedy="Give 0 or a positive number.")
        if not (0.0 <= self.correlation < 1.0 and self.repeatability >= 0.0 and 0.0 <= self.season < 1.0):
            raise InvalidInput(
                f"correlation = {self.correlation}, repeatability = {self.repeatability}, season = {self.season}.",
                remedy="Give a correlation and a season below 1, none of them negative.",
            )

    def draws(self, *place: int) -> np.random.Generator:
        """Return the random generator of one part of the fleet, independent of other draws."""
        return np.random.default_rng([self.seed, *place])

    def day(self, number: int) -> date:
        """Return the date of a day by its number."""
        return self.first + timedelta(days=number)

    def name(self, robot: int, day: int) -> str:
        """Return a robot's name on a day."""
        new = any(e.kind == "rename" and e.robot == robot and day >= e.day for e in self.events)
        return f"robot{robot:03d}{'-new' if new else ''}"

    @cached_property
    def temperature(self) -> np.ndarray:
        """Temperature of every robot on every day [degC], (robots, days): the season, the weather, and the robot's location."""
        turn = np.array([2.0 * np.pi * self.day(d).timetuple().tm_yday / 365.25 for d in range(self.days)])
        weather = self.ar1_noise(self.draws(1), (self.days,), 0.7) * WEATHER
        places = self.draws(2).normal(0.0, 2.0, (self.robots, 1))
        own = self.draws(3).normal(0.0, 1.0, (self.robots, self.days))
        return MEAN - SWING * np.cos(turn) + weather + places + own

    @staticmethod
    def ar1_noise(draws: np.random.Generator, shape: tuple[int, ...], correlation: float) -> np.ndarray:
        """Return AR(1) noise of unit variance along the last axis."""
        noise = draws.normal(size=shape)
        for i in range(1, shape[-1]):
            noise[..., i] = correlation * noise[..., i - 1] + np.sqrt(1 - correlation**2) * noise[..., i]
        return noise

    def growth(self, robot: int, joint: int) -> np.ndarray:
        """Return the factor by which wear and exchanges have changed a joint's friction [-], (days,)."""
        days, factor = np.arange(self.days), np.ones(self.days)
        for e in self.events:
            if e.robot != robot or e.joint not in (-1, joint):
                continue
            if e.kind == "wear":
                factor *= 1.0 + e.size * np.clip((days - e.day) / e.length, 0.0, 1.0)
            elif e.kind == "exchange":
                factor *= np.where(days >= e.day, 1.0 + e.size, 1.0)
        return factor

    def truth(self, robot: int, joint: int) -> np.ndarray:
        """Return Coulomb [N.m] and viscous friction [N.m.s/rad] of every day, (days, 2)."""
        place = self.draws(4, robot, joint)
        base = np.array([3.0, 2.0]) * (1.0 + self.spread * place.normal())
        noise = self.ar1_noise(place, (self.days,), self.correlation) * self.repeatability
        rate = self.season / SWING
        warm = np.exp(-rate * (self.temperature[robot] - MEAN))
        return (self.growth(robot, joint) * warm * (1.0 + noise))[:, None] * base

    def payload(self, robot: int, joint: int, day: int) -> float:
        """Return the gravity of what a joint carries on a day [N.m]."""
        mine = [e for e in self.events if e.kind == "payload" and e.robot == robot and e.joint in (-1, joint)]
        return 4.0 + sum(e.size for e in mine if day >= e.day)

    def log(
        self, robot: int, day: int, *, seconds: float = 20.0, rate: float = 1000.0
    ) -> dict[str, np.ndarray]:
        """Return the columns of a log: t [s], (n,); q [rad], tau [N.m] and temp [degC], (n,) or (n, joints)."""
        t = np.arange(round(seconds * rate)) / rate
        q, tau = np.zeros((2, t.size, self.joints))
        for joint in range(self.joints):
            place = self.draws(5, robot, joint, day)
            dq, ddq = np.zeros_like(t), np.zeros_like(t)
            for hertz, amplitude, phase in TONES:
                w, shift = 2 * np.pi * hertz, phase + place.uniform(0.0, 6.0)
                q[:, joint] += amplitude * np.sin(w * t + shift)
                dq += amplitude * w * np.cos(w * t + shift)
                ddq -= amplitude * w * w * np.sin(w * t + shift)
            constant, viscous = self.truth(robot, joint)[day]
            gravity = self.payload(robot, joint, day) * np.sin(q[:, joint])
            tau[:, joint] = 0.5 * ddq + constant * np.sign(dq) + viscous * dq + gravity
            tau[:, joint] += 0.1 * place.standard_normal(t.size)
        columns = {"q": q, "tau": tau, "temp": np.full_like(q, self.temperature[robot, day])}
        return {"t": t} | {name: x[:, 0] if self.joints == 1 else x for name, x in columns.items()}

    def has_damage(self, robot: int, day: int) -> bool:
        """Return whether a robot's logs are damaged on a day."""
        return any(e.kind == "break" and e.robot == robot and day >= e.day for e in self.events)

    def write(
        self,
        folder: str | Path,
        *,
        days: Sequence[int] | None = None,
        seconds: float = 20.0,
        rate: float = 1000.0,
    ) -> Iterator[Path]:
        """Write logs as `ROBOT/YYYY-MM-DD.npz` and yield each path.

        Args:
            folder: made where it does not exist.
            days: numbers of the days; None: all.
            seconds: length of a log [s].
            rate: of its samples [Hz].
        """
        for day in range(self.days) if days is None else days:
            for robot in range(self.robots):
                place = Path(folder) / self.name(robot, day)
                place.mkdir(parents=True, exist_ok=True)
                content = io.BytesIO()
                np.savez(content, **self.log(robot, day, seconds=seconds, rate=rate))  # type: ignore[arg-type]
                whole = content.getvalue()
                if self.has_damage(robot, day):
                    whole = whole[: len(whole) // 2]
                yield write_whole(place / f"{self.day(day).isoformat()}.npz", whole)


def example(*, robots: int = 20, joints: int = 1, days: int = 120, seed: int = 0) -> FleetSimulation:
    """Return a fleet with one event of each kind: wear, a new gear, a payload, a defect and a new name."""
    third, half = days // 3, days // 2
    kinds: tuple[Event, ...] = (
        Event(kind="wear", robot=1, joint=0, day=half, size=0.2, length=max(1, days - half)),
        Event(kind="exchange", robot=2, joint=0, day=third, size=-0.2),
        Event(kind="payload", robot=3, day=half, size=3.0),
        Event(kind="break", robot=4, day=2 * third),
        Event(kind="rename", robot=5, day=half),
    )
    return FleetSimulation(
        robots=robots, joints=joints, days=days, seed=seed, events=[e for e in kinds if e.robot < robots]
    )
