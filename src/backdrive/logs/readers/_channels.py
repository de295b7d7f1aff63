"""Channels from columns: sums with factors, conversion to SI units, and arrays with time as the first axis."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches

import numpy as np

from backdrive.errors import MappingError
from backdrive.logs.log import AS_SI, LARGEST
from backdrive.logs.readers import units
from backdrive.logs.readers._doubts import doubtful_factor
from backdrive.logs.readers._expression import CHANNEL_OF, Column, Sum, Term
from backdrive.logs.readers._names import KINDS
from backdrive.logs.readers._shapes import orient
from backdrive.logs.readers._tokens import CONSTANTS, INDEX
from backdrive.logs.readers.columns import Columns, describe

_SHORT = {channel: short for short, channel in CHANNEL_OF.items()}
_SI = {"time": "s", "angle": "rad", "angle rate": "rad/s", "length": "m", "speed": "m/s", "torque": "N.m", "force": "N",
       "temperature": "degC"}  # fmt: skip


class Values:
    """Channels in the making.

    Attributes:
        arrays: channel to (n, J); time is (n, 1).
        settled: channels whose unit the file or the person stated.
        origin: origin of the time, if it is not 0 [s].
        labels: channel to the joints that patterns of a `--map` name, in the channel's order.
        kind: what the position, or else the velocity, was stated to measure; '' if nothing was stated.
        said: which column became which channel, in words.
        notes: what was left out, in sentences.
    """

    def __init__(self, columns: Columns, endings: Mapping[str, str], n: int, owned: bool = False):
        self.columns, self.n, self.owned = columns, n, owned
        self.stated = {**endings, **columns.units}
        self._said_by_name = set(endings)
        self.arrays: dict[str, np.ndarray] = {}
        self.settled: set[str] = set()
        self.labels: dict[str, tuple[str, ...]] = {}
        self.origin = 0.0
        self.kind = ""
        self.said: list[str] = []
        self.notes: list[str] = []
        self._converted = ""  # the last column of a sum that its unit brought to SI

    def find(self, name: str) -> np.ndarray:
        """Return a column by its name as written, or by its name without unit where that is clear.

        Raises:
            MappingError: lists the columns.
        """
        return self.columns.arrays[self.full(name)]

    def add_sums(self, channel: str, sums: Sequence[Sum]) -> None:
        """Add a channel as `--map` has it: sums of columns side by side.

        Raises:
            MappingError: a column is unknown, has another length or measures something else.
        """
        parts, written = list[np.ndarray](), list[str]()
        for terms in sums:
            parts.append(self._sum(channel, terms))
            unit = f" [{self.stated[self._converted]}]" if self._converted else ""
            written.append(" + ".join(_format_term(term) for term in terms) + unit)
        value = np.concatenate(parts, axis=1)
        if channel == "time" and value.shape[1] != 1:
            raise MappingError(
                f"Time has {value.shape[1]} columns.", remedy="Choose one, for example t=time[0]."
            )
        if channel == "time" and len(columns_of(sums)) == 1:
            self.origin = self.columns.origin.get(columns_of(sums)[0], 0.0)
        labels = [label for terms in sums for label in _labels(terms)]
        if channel != "time" and labels and len(labels) == value.shape[1]:
            self.labels[channel] = tuple(labels)
        self.arrays[channel] = value
        self.settled.add(channel)
        self.said.append(f"{channel} = {', '.join(written)}")

    def _sum(self, channel: str, terms: Sum) -> np.ndarray:
        total: np.ndarray | None = None
        self._converted = ""
        constants = [term for term in terms if not term.columns]
        for term in sorted(
            terms, key=constants.__contains__
        ):  # constants last: columns say how many joints there are
            value = self._term(channel, term)
            widths = {value.shape[1], 1 if total is None else total.shape[1]}
            if total is not None and not term.columns and term.each and widths != {total.shape[1]}:
                raise MappingError(
                    f"--map {_SHORT[channel]}: {len(term.each)} offsets for {total.shape[1]} columns.",
                    remedy="Give one offset a column, or one for all: (a,b)+(0.1,0.2), where a comma outside begins another sum.",
                )
            if total is not None and len(widths) > 1 and 1 not in widths:
                raise MappingError(
                    f"--map {_SHORT[channel]}: '{term.columns[0].name}' has {value.shape[1]} columns, the terms before it "
                    f"{total.shape[1]}.",
                    remedy="Choose columns with [i] or [i:j].",
                )
            total = value if total is None else total + value
        assert total is not None
        bare = [
            x * term.factor
            for term in constants
            if not term.factors
            for x in term.each or (1.0,)
            if x * term.factor
        ]
        if bare and self._converted:
            raise MappingError(
                f"--map {_SHORT[channel]}: '{self._converted}' is stated in {self.stated[self._converted]} and brought to SI, and "
                f"the offset {bare[0]:g} states no unit, which is ambiguous.",
                remedy="Write the unit's factor with both, for example deg*COLUMN-10*deg.",
            )
        return np.broadcast_to(total, (self.n, total.shape[1]))

    def add_columns(self, channel: str, names: Sequence[str]) -> None:
        """Add a channel by automatic names; columns that do not fit are noted and left out."""
        parts: list[np.ndarray] = []
        for name in names:
            value = orient(self.columns.arrays[name], self.n)
            if value is None:
                self.notes.append(f"'{name}' has another length than the time, so {channel} was left out.")
                return
            value, unit = self._si(name, value)
            if unit is not None and unit.kind in KINDS[channel]:
                self._settle(channel, unit.kind)
            parts.append(value)
        value = parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1)
        if len(parts) > 1:
            value.setflags(write=False)  # so that the log need not copy it
            self._release(names)
        if channel == "time":
            self.origin = self.columns.origin.get(names[0], 0.0)
        widths = [v.shape[1] for c, v in self.arrays.items() if c != "time"]
        if channel == "time":
            value = self._epoch(names[0], value)
        elif widths and value.shape[1] != widths[0]:
            self.notes.append(
                f"'{names[0]}' has {value.shape[1]} columns where {widths[0]} are due: {channel} left out."
            )
            return
        self.arrays[channel] = value
        shown = f"'{names[0]}'" if len(names) == 1 else f"'{names[0]}' to '{names[-1]}'"
        stated = self.stated.get(names[0])
        self.said.append(f"{channel} = {shown}" + (f" [{stated}]" if stated else ""))

    def _release(self, names: Sequence[str]) -> None:
        """Free copied columns that this object owns, so that a long log is not in memory twice. Shapes are kept."""
        arrays = self.columns.arrays
        if self.owned and isinstance(arrays, dict):
            for name in names:
                arrays[name] = np.broadcast_to(np.float64(0.0), arrays[name].shape)

    def full(self, name: str) -> str:
        """Return the name in the file of a column as it is written; see `find`."""
        arrays = self.columns.arrays
        if name in arrays:
            return name
        for same in (
            [full for full in arrays if units.split(full)[0] == name],
            [full for full in arrays if full.lower() == name.lower()],
        ):
            if len(same) == 1:
                return same[0]
        near = get_close_matches(name, [full for full in arrays if len(full) <= units.LONGEST], n=1)
        hint = f"Did you mean '{near[0]}'? " if near else ""
        raise MappingError(
            f"The file has no column '{name}'.",
            remedy=f"{hint}Columns: {describe(self.columns)}.",
            name=name,
        )

    def _term(self, channel: str, term: Term) -> np.ndarray:
        factor, word = term.factor, ""
        for name, divides in term.factors:
            number = self._number(channel, name)
            if name in CONSTANTS and name not in self.columns.arrays:
                word = name
            if divides and number == 0.0:
                raise MappingError(
                    f"--map {_SHORT[channel]}: '{name}' is 0, and nothing can be divided by it.",
                    remedy="Name another column, or write the number.",
                )
            factor *= 1.0 / number if divides else number
        named = term.columns[0].name if term.columns else "a number alone"
        each = np.array(term.each or (1.0,)) * factor
        if not np.abs(each).max() <= LARGEST:
            raise MappingError(
                f"--map {_SHORT[channel]}: the factor of '{named}' is {factor:g}.",
                remedy=f"Give factors between {-LARGEST:g} and {LARGEST:g}.",
            )
        if not term.columns:
            return each[None]
        parts = [self._column(channel, term, column, word) for column in term.columns]
        if word:
            self._settle(channel, "angle")
        value = parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1)
        if term.each and len(term.each) != value.shape[1]:
            raise MappingError(
                f"--map {_SHORT[channel]}: {len(term.each)} factors for {value.shape[1]} columns from '{named}' on.",
                remedy="Give one factor a column, or a single one for all.",
            )
        return value if (each == 1.0).all() else value * each

    def _number(self, channel: str, name: str) -> float:
        """Return a named factor: a constant, or the only number of a column."""
        if name in CONSTANTS and name not in self.columns.arrays:
            return CONSTANTS[name]
        single = self.find(name)
        if single.size != 1:
            raise MappingError(
                f"--map {_SHORT[channel]}: the factor '{name}' is not a single number but has shape {single.shape}.",
                remedy=f"Only numbers, {', '.join(CONSTANTS)} and single-number columns can be factors.",
            )
        return float(single.reshape(()))

    def _column(self, channel: str, term: Term, column: Column, word: str) -> np.ndarray:
        """Return one column of a term before its factors, (n, k); in SI where its unit is to be heeded."""
        if column.name == INDEX and INDEX not in self.columns.arrays:
            return np.arange(self.n, dtype=float)[:, None]
        full = self.full(column.name)
        raw = self.columns.arrays[full]
        value = raw.reshape(1, 1).astype(float) if raw.size == 1 and self.n != 1 else orient(raw, self.n)
        if value is None:
            raise MappingError(
                f"--map {_SHORT[channel]}: '{full}' has shape {raw.shape}, but the time has {self.n} samples.",
                remedy=f"Columns: {describe(self.columns)}.",
            )
        if column.index is not None:
            if column.index.stop > value.shape[1]:
                raise MappingError(
                    f"--map {_SHORT[channel]}: '{full}' has {value.shape[1]} columns, [{column.index.stop - 1}] is not there.",
                    remedy="Columns are counted from 0.",
                )
            value = value[:, column.index]
        stated = self._unit_of(channel, term, full, word)
        value = value.astype(float) if stated is None else _in_si(value, stated)
        if stated is not None and stated != units.Unit(stated.kind):
            self._converted = full
        peak = np.abs(value[np.isfinite(value)]).max(initial=0.0)
        if peak > LARGEST:
            raise MappingError(
                f"--map {_SHORT[channel]}: '{full}' holds {peak:g}, beyond the largest valid number ({LARGEST:g}).",
                remedy="Mark missing samples as NaN, or drop them.",
            )
        return value

    def _unit_of(self, channel: str, term: Term, full: str, word: str) -> units.Unit | None:
        """Return the unit by which a column is brought to SI; None where it states none, or where a factor does that.

        Raises:
            MappingError: the unit and a factor contradict each other, or both would apply.
        """
        stated = None if full in self._said_by_name else units.parse(self.stated.get(full, ""))
        if word and stated is not None and stated.kind != "raw":
            if not np.isclose(stated.factor, CONSTANTS[word], rtol=1e-12):
                raise MappingError(
                    f"--map {_SHORT[channel]}: '{full}' is stated in {self.stated[full]}, not in {word}.",
                    remedy="Columns with a stated unit are brought to SI without a factor: leave it out.",
                )
            return None
        plain = not term.factors and not term.each and abs(term.factor) == 1.0
        if stated is not None and plain and stated.kind not in KINDS[channel]:
            if 1.0 not in term.numbers:
                raise MappingError(
                    f"--map {_SHORT[channel]}: '{full}' is in {self.stated[full]}, which is not a unit of {channel}.",
                    remedy="Give the factor that makes it one (1 if the name means something else), or name another column.",
                )
            self.notes.append(
                f"'{full}' {AS_SI}, as its factor is 1, though its name says {self.stated[full]}."
            )
        if (doubt := doubtful_factor(channel, term, full)) and not word:
            self.notes.append(doubt)
        if stated is not None and stated.kind in KINDS[channel]:
            self._settle(channel, stated.kind)
        if stated is None or plain or stated == units.Unit(stated.kind):
            return stated
        if np.isclose(np.abs(term.numbers), stated.factor, rtol=1e-9).any():
            return None  # the factor is the unit's: 0.001*"time [ms]"
        if not units.split(full)[1]:
            return stated  # the file itself says so beside the name: a factor comes on top
        raise MappingError(
            f"--map {_SHORT[channel]}: '{full}' is stated in {self.stated[full]} and has a factor, which is ambiguous.",
            remedy=f"Write the unit's factor too, {stated.factor:.6g}*..., or leave all factors out.",
        )

    def _si(self, name: str, value: np.ndarray) -> tuple[np.ndarray, units.Unit | None]:
        unit = units.parse(self.stated.get(name, ""))
        if unit is None or unit == units.Unit(unit.kind):  # SI already
            return value, unit
        return _in_si(value, unit), unit

    def _settle(self, channel: str, kind: str) -> None:
        self.settled.add(channel)
        if channel == "position" or (channel == "velocity" and not self.kind):
            self.kind = kind

    def _epoch(self, name: str, value: np.ndarray) -> np.ndarray:
        """Bring integer clocks that count from 1970 to seconds; their size leaves no doubt of the unit."""
        if name in self.stated or not len(value):
            return value
        start = abs(float(value[0, 0]))
        for digits, unit, factor in ((17, "ns", 1e-9), (14, "us", 1e-6), (11, "ms", 1e-3)):
            if 8 * 10**digits < start < 5 * 10 ** (digits + 1):
                self.notes.append(f"'{name}' counts {unit} since 1970; time is in s since the first sample.")
                self.origin = float(value[0, 0]) * factor
                return (value - value[0]).astype(float) * factor
        return value


def _in_si(value: np.ndarray, unit: units.Unit) -> np.ndarray:
    """Return numbers in SI; one that overflows stays as it stands, and is refused as too large."""
    with np.errstate(over="ignore"):
        scaled = value.astype(float) * unit.factor + unit.offset
    return np.where(np.isinf(scaled), value, scaled)


def columns_of(sums: Iterable[Sum]) -> list[str]:
    """Return the names of all columns of some sums."""
    return [column.name for terms in sums for term in terms for column in term.columns]


def _labels(terms: Sum) -> list[str]:
    """Return what the stars of the first term with a pattern stand for; empty strings where there is none."""
    for term in terms:
        if any(column.label for column in term.columns):
            return [column.label for column in term.columns]
    return []


def _format_term(term: Term) -> str:
    factor = "" if term.factor == 1.0 and (term.columns or term.each) else f"{term.factor:.10g}*"
    factor += f"({','.join(f'{x:.10g}' for x in term.each)})*" if term.each else ""
    factor += "".join(f"1/{name}*" if divides else f"{name}*" for name, divides in term.factors)
    if not term.columns:
        return factor.rstrip("*")
    shown = [
        f"'{c.name}'" + ("" if c.index is None else f"[{c.index.start}:{c.index.stop}]") for c in term.columns
    ]
    return factor + (shown[0] if len(shown) == 1 else f"{shown[0]} to {shown[-1]}")
