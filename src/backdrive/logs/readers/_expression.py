"""The grammar of `--map`: which columns, with which factors, make up which channel. Nothing is evaluated as code.

    map     = channel=columns, ...        a comma before `name=` begins the next channel
    columns = sum, ...                    joints one after another; `none` leaves the channel out
    sum     = term (+|- term)*            a number alone is an offset, (0.1,-0.2,0.3) are offsets one a joint
    term    = [factor (*|/)]... column    from the left
    column  = name | "any name" | name1..name9 | *_position | (a,b,c), optionally [i] or [i:j]
    factor  = number | deg | rpm | turn | (2.5,-1.2,0.4), one a joint | a column that holds a single number

`deg` is pi/180, `rpm` is 2 pi/60 and `turn` is 2 pi, so that `q=deg*angle` reads degrees. `index` is the sample's number.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import NoReturn

from backdrive.errors import MappingError
from backdrive.logs.readers._tokens import CONSTANTS, Names, Token, refuse, tokens

#: What a person writes on the left of `=`, and the channel of `Log` it means.
CHANNEL_OF: dict[str, str] = {
    "t": "time",
    "q": "position",
    "dq": "velocity",
    "tau": "torque",
    "qr": "reference",
    "u": "drive_input",
    "q2": "second_encoder",
    "tau_ext": "external_torque",
    "tau_model": "model_torque",
    "load": "load",
    "temp": "temperature",
    "wrench": "wrench",
}

LONGEST = 9  # digits of a column index
MOST = 4096  # columns of a range


@dataclass(frozen=True)
class Column:
    """A column of a term.

    Attributes:
        name: as written.
        index: columns of it that are meant, or None for all.
        label: what the star of a pattern stands for; empty without one.
    """

    name: str
    index: slice | None = None
    label: str = ""


@dataclass(frozen=True, kw_only=True)
class Term:
    """One summand: factors times columns side by side.

    Attributes:
        numbers: that it is multiplied by, signs as -1 and divisors as their inverse [1].
        each: factors of the columns one by one [1]; without columns, offsets one by one; empty for none.
        factors: named factors, `deg`, `rpm`, `turn` or single-number columns, each with whether it divides.
        columns: none for a constant.
    """

    numbers: tuple[float, ...] = ()
    each: tuple[float, ...] = ()
    factors: tuple[tuple[str, bool], ...] = ()
    columns: tuple[Column, ...] = ()

    @property
    def factor(self) -> float:
        """Product of the numbers [1]."""
        return math.prod(self.numbers)


Sum = tuple[Term, ...]


def parse(text: str | Mapping[str, str], columns: Collection[str] = ()) -> dict[str, tuple[Sum, ...] | None]:
    """Return the sums of every channel of a `--map`; None for a channel that is to be left out (`dq=none`).

    Args:
        text: as a person writes it.
        columns: of the file, in its order.

    Raises:
        MappingError: says where the text does not follow the grammar.
    """
    if isinstance(text, Mapping):
        text = ",".join(f"{channel}={value}" for channel, value in text.items())
    parser = _Parser(text, Names(columns))
    result: dict[str, tuple[Sum, ...] | None] = {}
    while not parser.at_end():
        channel = parser.channel()
        if channel in result:
            remedy = "Join the columns with + and -."
            if channel == "time":
                remedy = "Name one; a file beside (--join) may have its own, so that there are two."
            raise MappingError(f"--map names '{channel}' twice.", remedy=remedy)
        result[channel] = parser.sums()
    if not result:
        raise MappingError("--map is empty.", remedy="Write for example t=time,q=position,tau=effort.")
    return result


class _Parser:
    def __init__(self, text: str, names: Names):
        self.text, self.names = text, names
        self.tokens = tokens(text, names)
        self.at = 0

    def fail(self, what: str, where: int) -> NoReturn:
        refuse(self.text, what, where)

    def peek(self, ahead: int = 0) -> Token:
        at = self.at + ahead
        return self.tokens[at] if at < len(self.tokens) else ("end", "", len(self.text))

    def take(self) -> Token:
        token = self.peek()
        self.at += 1
        return token

    def takes(self, sign: str) -> bool:
        found = self.peek()[:2] == ("sign", sign)
        self.at += found
        return found

    def at_end(self) -> bool:
        return self.peek()[0] == "end"

    def channel(self) -> str:
        kind, name, where = self.take()
        known = {**CHANNEL_OF, **{channel: channel for channel in CHANNEL_OF.values()}}
        if kind != "name" or name not in known:
            self.fail(f"'{name}' is not a channel (known: {', '.join(CHANNEL_OF)})", where)
        if not self.takes("="):
            self.fail(f"'=' is missing after '{name}'", self.peek()[2])
        return known[name]

    def sums(self) -> tuple[Sum, ...] | None:
        """Return the sums of a channel, and go on to where the next channel begins."""
        if self.peek()[:2] == ("name", "none"):
            self.take()
            found = None
        else:
            found = [self.sum()]
        while not self.at_end():
            if not self.takes(","):
                self.fail(f"',' or '+' or '-' is missing before '{self.peek()[1]}'", self.peek()[2])
            begins = self.peek()[0] == "name" and self.peek(1)[:2] == ("sign", "=")
            if self.at_end() or begins or found is None:
                break
            found.append(self.sum())
        return None if found is None else tuple(found)

    def sum(self) -> Sum:
        terms = [self.term(self.takes("-") or (self.takes("+") and False))]
        while self.peek()[:2] in (("sign", "+"), ("sign", "-")):
            terms.append(self.term(self.take()[1] == "-"))
        if not any(term.columns for term in terms):
            lists = any(term.each for term in terms)
            self.fail(
                "a list of factors or offsets needs columns" if lists else "a column must follow the number",
                self.peek()[2],
            )
        return tuple(terms)

    def term(self, negative: bool) -> Term:
        numbers = [-1.0] if negative else []
        each: tuple[float, ...] = ()
        named: list[tuple[tuple[Column, ...], bool, int]] = []
        divides = False
        while True:
            while self.takes("-"):
                numbers.append(-1.0)
            where = self.peek()[2]
            operand = self.operand()
            if isinstance(operand, (int, float)):
                numbers.append(self.inverse(operand, where) if divides else operand)
            elif isinstance(operand[0], Column):
                named.append((tuple(c for c in operand if isinstance(c, Column)), divides, where))
            elif each:
                self.fail("a term has more than one list of factors", where)
            else:
                factors = [x for x in operand if isinstance(x, float)]
                each = tuple(self.inverse(x, where) if divides else x for x in factors)
            if self.takes("*"):
                divides = False
            elif self.takes("/"):
                divides = True
            else:
                return self.product(numbers, each, named)

    def product(
        self,
        numbers: list[float],
        each: tuple[float, ...],
        named: list[tuple[tuple[Column, ...], bool, int]],
    ) -> Term:
        """Return a term: the last of its names that is no divisor and no constant is its column, the others are factors."""
        free = [
            i
            for i, (columns, divides, _) in enumerate(named)
            if not divides and not (len(columns) == 1 and self.constant(columns[0]))
        ]
        chosen = free[-1] if free else None  # none: an offset, such as 30*deg
        own, where = ((), self.peek()[2]) if chosen is None else (named[chosen][0], named[chosen][2])
        if not all(map(math.isfinite, (*numbers, *each, math.prod(numbers)))):
            self.fail("a factor is not finite", where)
        factors: list[tuple[str, bool]] = []
        for i, (columns, divides, place) in enumerate(named):
            if i == chosen:
                continue
            if len(columns) > 1 or any(column.index is not None for column in columns):
                self.fail("a factor is a number or a single-number column, and no list", place)
            factors += [(column.name, divides) for column in columns]
        return Term(
            numbers=tuple(numbers),
            each=each,
            factors=tuple(factors),
            columns=own,
        )

    def constant(self, column: Column) -> bool:
        return column.name in CONSTANTS and column.name not in self.names

    def inverse(self, number: float, where: int) -> float:
        if number == 0.0:
            self.fail("a division by 0", where)
        return 1.0 / number

    def operand(self) -> float | tuple[Column | float, ...]:
        """Return a number, or a list of columns or of numbers."""
        if self.peek()[:2] != ("sign", "("):
            return self.element()
        start = self.take()[2]
        members: list[Column | float] = []
        while True:
            sign = -1.0 if self.takes("-") else 1.0
            where = self.peek()[2]
            member = self.element()
            if isinstance(member, (int, float)):
                members.append(sign * member)
            elif sign < 0:
                self.fail("a sign stands before the list, or as a factor, (1,-1)*(a,b)", where)
            else:
                members += member
            if self.takes(")"):
                break
            if not self.takes(","):
                self.fail("')' or ',' is missing in a list", self.peek()[2])
        if len({isinstance(m, float) for m in members}) > 1:
            self.fail("a list holds numbers or columns, and not both", start)
        return tuple(members)

    def element(self) -> float | tuple[Column, ...]:
        kind, value, where = self.take()
        if kind == "number":
            return float(value)
        if kind == "glob" or (kind == "quoted" and "*" in value and value[1:-1] not in self.names):
            return self.matching(value.strip('"'), where)
        if kind not in ("name", "quoted"):
            before = self.tokens[self.at - 3 : self.at - 1]
            if [token[:2] for token in before[1:]] == [("sign", "*")] and before[0][0] == "name":
                name = before[0][1]
                what = "a column itself" if name in self.names else "a factor" if name in CONSTANTS else ""
                if what:
                    self.fail(
                        f"'*' multiplies here, since '{name}' is {what}, and nothing follows it (a pattern of several columns "
                        f'stands in quotes, "{name}*")',
                        where,
                    )
            self.fail("a column is missing", where)
        first = self.column(value, kind == "quoted")
        if not self.takes(".."):
            return first
        kind, value, place = self.take()
        if kind not in ("name", "quoted"):
            self.fail("a range ends with a column, as in I1..I3", place)
        last = self.column(value, kind == "quoted")
        if len(first) + len(last) > 2 or first[0].index is not None or last[0].index is not None:
            self.fail("a range goes from one column to another, as in I1..I3", where)
        return self.range(first[0].name, last[0].name, where)

    def matching(self, pattern: str, where: int) -> tuple[Column, ...]:
        found = self.names.matching(pattern)
        if not found:
            columns = ", ".join(name[:80] for name in self.names.columns[:60])
            raise MappingError(
                f"--map: no column matches '{pattern}', at position {where + 1} of '{self.text}'.",
                remedy=f"Columns: {columns}." if columns else "The file has no columns.",
            )
        return tuple(Column(name, label=label) for name, label in found)

    def range(self, first: str, last: str, where: int) -> tuple[Column, ...]:
        """Return the columns from one number to another."""
        begin, end = re.split(r"(\d+)", first), re.split(r"(\d+)", last)
        differ = [i for i, (a, b) in enumerate(zip(begin, end, strict=False)) if a != b]
        if len(begin) != len(end) or len(begin) < 2 or len(differ) > 1 or (differ and differ[0] % 2 == 0):
            self.fail(f"'{first}' and '{last}' differ in more than one number", where)
        at = differ[0] if differ else len(begin) - 2
        if max(len(begin[at]), len(end[at])) > LONGEST:
            self.fail(f"'{end[at][:40]}' is no number of a column", where)
        low, high = int(begin[at]), int(end[at])
        if high < low:
            self.fail(f"the range from '{first}' to '{last}' runs backwards", where)
        if high - low >= MOST:
            self.fail(f"the range holds {high - low + 1} columns, more than {MOST}", where)
        width = len(begin[at]) if begin[at].startswith("0") else 0
        return tuple(
            Column("".join([*begin[:at], f"{number:0{width}d}", *begin[at + 1 :]]))
            for number in range(low, high + 1)
        )

    def column(self, value: str, quoted: bool) -> tuple[Column, ...]:
        """Return a column with its index; `name[i]` is a column itself where the file calls one so."""
        name = value[1:-1] if quoted else value
        index = self.index()
        if index is None:
            return (Column(name),)
        parts = [f"{name}[{i}]" for i in range(index.start, min(index.stop, index.start + MOST))]
        if name not in self.names and all(part in self.names for part in parts):
            return tuple(Column(part) for part in parts)
        return (Column(name, index),)

    def index(self) -> slice | None:
        if not self.takes("["):
            return None
        first = self.whole()
        last = first + 1
        if self.takes(":"):
            last = self.whole()
        if not self.takes("]") or last <= first:
            self.fail("an index is written [i] or [i:j] with j > i", self.peek()[2])
        return slice(first, last)

    def whole(self) -> int:
        kind, value, where = self.take()
        if kind != "number" or not value.isdigit() or len(value) > LONGEST:
            self.fail(f"'{value[:40]}' is not a column index", where)
        return int(value)
