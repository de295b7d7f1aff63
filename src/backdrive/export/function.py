"""A function in C."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from backdrive.export.values import (
    REAL,
)

RESULT = "@RESULT@"  # stands for the type that a function returns


@dataclass(eq=False)
class Function:
    """A function in C.

    Attributes:
        name: in C.
        title: first sentence of the kernel's docstring.
        parameters: declaration and name of each.
        body: its lines.
        result: type, `void` for none, a structure for several.
        fields: one entry for each of several results. A result in the structure has (type, name, kind). Any other result has
            (None, ...), followed by where its value comes from: a constant, its place in a parameter's table, the index of
            an equal result, or None for the only one that is returned.
        kind: of a single result.
        effect: it changes something.
        written: parameters that it writes to.
        calls: functions that it calls.
        tables: tables of numbers that it reads.
        helpers: small functions that it needs.
        macro: by which others are defined.
    """

    name: str
    title: str = ""
    parameters: list[tuple[str, str]] = field(default_factory=list)
    body: list[str] = field(default_factory=list)
    result: str = "void"
    fields: list[Any] = field(default_factory=list)
    kind: str = REAL
    effect: bool = False
    written: frozenset[str] = frozenset()
    calls: list[Function] = field(default_factory=list)
    tables: set[str] = field(default_factory=set)
    helpers: set[str] = field(default_factory=set)
    macro: str = "static inline"

    def text(self) -> str:
        """Return the function as C."""
        head = ", ".join(f"{t}{n}" if t.endswith("*") else f"{t} {n}" for t, n in self.parameters) or "void"
        comment = f"/* {self.title} */\n" if self.title else ""
        struct = ""
        if self.result.endswith("_result"):
            members = " ".join(f"{f[0]} {f[1]};" for f in self.fields if len(f) == 3)
            struct = f"typedef struct {{ {members} }} {self.result};\n\n"
        body = "\n".join(self.body).replace(RESULT, self.result)
        return f"{struct}{comment}{self.macro} {self.result} {self.name}({head}) {{\n{body}\n}}\n"
