"""The grammar of `--map`: `channel=sum`, comma-separated; a sum of columns with factors. Nothing is evaluated as code.

    channel = sum        sum = term (+|- term)*        term = [factor*...] column
    factor  = number | deg | rpm | a column that holds a single number
    column  = dotted name, or "quoted" when it holds other characters, optionally [i] or [i:j]

`deg` is pi/180 and `rpm` is 2 pi/60, so that `q=deg*angle` reads degrees. `index` is the sample's number.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NoReturn

from backdrive.errors import MappingError

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
}

#: Factors by name [SI/unit].
CONSTANTS = {"deg": math.pi / 180, "rpm": 2 * math.pi / 60}

LONGEST = 9  # digits of a column index

_TOKEN = re.compile(
    r"""\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(?![\w.])
      |(?P<quoted>"[^"]*")
      |(?P<name>[^\W\d][\w]*(?:[./#]+\w+)*)
      |(?P<sign>[-+*=,:\[\]]))""",
    re.VERBOSE,
)


@dataclass(frozen=True, kw_only=True)
class Term:
    """One summand.

    Attributes:
        factor: product of sign and numbers [1].
        factors: names of factors: `deg`, `rpm`, or single-number columns.
        column: name as written.
        quoted: whether it was in quotes.
        index: columns of it that are meant, or None for all.
    """

    factor: float
    factors: tuple[str, ...]
    column: str
    quoted: bool
    index: slice | None


def parse(text: str | Mapping[str, str]) -> dict[str, tuple[Term, ...] | None]:
    """Return the terms of every channel of a `--map`; None for a channel that is to be left out (`dq=none`).

    Raises:
        MappingError: says where the text does not follow the grammar.
    """
    if isinstance(text, Mapping):
        text = ",".join(f"{channel}={value}" for channel, value in text.items())
    parser = _Parser(text)
    result: dict[str, tuple[Term, ...] | None] = {}
    while not parser.at_end():
        channel = parser.channel()
        if channel in result:
            raise MappingError(f"--map names '{channel}' twice.", remedy="Join the columns with + and -.")
        result[channel] = parser.sum()
        parser.comma()
    if not result:
        raise MappingError("--map is empty.", remedy="Write for example t=time,q=position,tau=effort.")
    return result


class _Parser:
    def __init__(self, text: str):
        self.text = text
        self.tokens: list[tuple[str, str, int]] = []
        at = 0
        while text[at:].strip():
            match = _TOKEN.match(text, at)
            if match is None:
                start = at + len(text[at:]) - len(text[at:].lstrip())
                self.fail(f"'{text[start : start + 12]}' is not understood", start)
            assert match.lastgroup is not None  # every alternative of the pattern has a name
            self.tokens.append((match.lastgroup, match[match.lastgroup], match.start(match.lastgroup)))
            at = match.end()
        self.at = 0

    def fail(self, what: str, where: int) -> NoReturn:
        raise MappingError(
            f"--map: {what}, at position {where + 1} of '{self.text}'.",
            remedy='Write channel=[factor*]column[+...], for example q=deg*angle,tau=0.5*"motor current [A]".',
        )

    def peek(self) -> tuple[str, str, int]:
        return self.tokens[self.at] if self.at < len(self.tokens) else ("end", "", len(self.text))

    def take(self) -> tuple[str, str, int]:
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

    def comma(self) -> None:
        if not self.at_end() and not self.takes(","):
            self.fail(f"',' or '+' or '-' is missing before '{self.peek()[1]}'", self.peek()[2])

    def sum(self) -> tuple[Term, ...] | None:
        if self.peek()[:2] == ("name", "none"):
            self.take()
            return None
        terms = [self.term(-1.0 if self.takes("-") else (self.takes("+"), 1.0)[1])]
        while True:
            if self.takes("+"):
                terms.append(self.term(1.0))
            elif self.takes("-"):
                terms.append(self.term(-1.0))
            else:
                return tuple(terms)

    def term(self, factor: float) -> Term:
        factors: list[str] = []
        while True:
            if self.takes("-"):
                factor = -factor
            kind, value, where = self.take()
            if kind == "number":
                factor *= float(value)
                if not self.takes("*"):
                    self.fail("a column must follow the number", self.peek()[2])
            elif kind in ("name", "quoted"):
                quoted = kind == "quoted"
                name = value[1:-1] if quoted else value
                if self.takes("*"):
                    factors.append(name)
                    continue
                if not math.isfinite(factor):
                    self.fail("a factor is not finite", where)
                return Term(
                    factor=factor, factors=tuple(factors), column=name, quoted=quoted, index=self.index()
                )
            else:
                self.fail("a column is missing", where)

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
