"""The friction of each joint by day, from the results: one value per day, without implausible results."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from typing import TYPE_CHECKING, Any

import numpy as np

from backdrive.fleet.merging import EARLIEST

if TYPE_CHECKING:
    import pyarrow as pa

COLUMNS = (
    "robot",
    "type",
    "joint",
    "unit",
    "day",
    "constant",
    "viscous",
    "top_speed",
    "temperature",
    "grade",
    "path",
)
AT = 0.5  # share of the median top speed at which the level is taken [-]
PARTS = ("level", "constant", "viscous")


@dataclass(frozen=True, kw_only=True, eq=False)
class History:
    """One joint over time.

    Attributes:
        robot: its name.
        type: of the robot; empty if unknown.
        joint: name of the joint.
        unit: `rad` or `m`.
        day: days since 1970-01-01, increasing, (n,).
        constant: constant part of friction [N.m or N], (n,).
        viscous: growth of friction with speed [N.m.s/rad or N.s/m], (n,).
        temperature: [degC], (n,); NaN where unknown.
        speed: at which the level is taken [rad/s or m/s].
        path: log of each day, the last of several, (n,).
        left_out: number of rows left out because the result was poor.
    """

    robot: str
    type: str
    joint: str
    unit: str
    day: np.ndarray
    constant: np.ndarray
    viscous: np.ndarray
    temperature: np.ndarray
    speed: float
    path: Sequence[str] = ()
    left_out: int = 0

    @property
    def name(self) -> str:
        """`ROBOT/JOINT`."""
        return f"{self.robot}/{self.joint}"

    @property
    def level(self) -> np.ndarray:
        """Friction at `speed` [N.m or N], (n,)."""
        return self.constant + self.viscous * self.speed

    def dates(self) -> list[date]:
        """Return the days as dates."""
        return [date_of(d) for d in self.day]


def date_of(day: float) -> date:
    """Return the date of a number of days since 1970-01-01."""
    return date.fromordinal(date(1970, 1, 1).toordinal() + round(float(day)))


def number_of(day: date) -> int:
    """Return the number of days since 1970-01-01 of a date."""
    return day.toordinal() - date(1970, 1, 1).toordinal()


def histories(table: pa.Table, *, today: int | None = None) -> list[History]:
    """Return the history of every joint, in the order of robots and joints.

    Several logs of a day are one value, their median. Poor results and impossible dates are left out.

    Args:
        table: of `Store.table`.
        today: days since 1970-01-01; later ones than tomorrow are left out. None: by the clock.
    """
    import pyarrow as pa
    import pyarrow.compute as pc

    table = table.select([name for name in COLUMNS]).sort_by(
        [(n, "ascending") for n in ("robot", "joint", "day", "path")]
    )
    if not table.num_rows:
        return []
    latest = (number_of(date.today()) if today is None else today) + 1
    day = pc.cast(table.column("day"), pa.int32()).to_numpy(zero_copy_only=False).astype(float)
    numbers = {
        name: table.column(name).to_numpy(zero_copy_only=False).astype(float)
        for name in ("constant", "viscous", "top_speed", "temperature")
    }
    robots, joints = (table.column(name).combine_chunks().dictionary_encode() for name in ("robot", "joint"))
    codes = np.column_stack([c.indices.to_numpy(zero_copy_only=False) for c in (robots, joints)])
    starts = np.concatenate(
        [[0], np.flatnonzero(np.any(np.diff(codes, axis=0) != 0, axis=1)) + 1, [len(codes)]]
    )
    poor = np.array([grade == "poor" for grade in table.column("grade").to_pylist()])
    good = ~poor & np.isfinite(numbers["constant"]) & np.isfinite(numbers["viscous"])
    good &= (day >= number_of(EARLIEST)) & (day <= latest)
    texts = {name: table.column(name).to_pylist() for name in ("type", "unit", "path")}
    result = []
    for a, b in zip(starts[:-1], starts[1:], strict=True):
        rows = a + np.flatnonzero(good[a:b])
        if not rows.size:
            continue
        first, of = np.unique(day[rows], return_inverse=True)
        last = np.searchsorted(day[rows], first, side="right") - 1
        merged = {name: _by_day(values[rows], of, first.size) for name, values in numbers.items()}
        result.append(
            History(
                robot=robots.dictionary[codes[a, 0]].as_py(),
                type=texts["type"][a] or "",
                joint=joints.dictionary[codes[a, 1]].as_py(),
                unit=texts["unit"][a] or "rad",
                day=first,
                constant=merged["constant"],
                viscous=merged["viscous"],
                temperature=merged["temperature"],
                speed=AT * float(np.nanmedian(numbers["top_speed"][rows])),
                path=[texts["path"][rows[i]] for i in last],
                left_out=int(b - a - rows.size),
            )
        )
    return result


def _by_day(values: np.ndarray, of: Any, count: int) -> np.ndarray:
    """Return the median of the values of each day."""
    if of.size == count:
        return values
    return np.array([np.median(values[of == i]) for i in range(count)])
