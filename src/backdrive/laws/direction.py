"""A rate law that differs by direction: the same equation with separate parameters for each direction.

    hi = hi_p,   lo = lo_n,   viscous = viscous_p where v >= 0,   viscous_n where v < 0

p, n: bounds and viscous part of the rate law with the parameters for motion along +q and along -q. The names of the parameters
along -q end in `_backward`. A rate law that already has parameters for both directions (`coulomb-viscous`) is not changed.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field, make_dataclass, replace
from functools import cache
from typing import Any, ClassVar, TypeVar

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.laws.base import Rate

BEHIND = "-by-direction"  # suffix of the rate law's name
BACKWARD = "_backward"  # suffix of the name of a parameter along -q
MARK = 0.25  # added to p[0], the number of parameters before the element, if they contain the rate law's row twice

R = TypeVar("R", bound=Rate)


@dataclass(frozen=True, kw_only=True)
class ByDirection(Rate):
    """Base of the rate laws that `law_by_direction` makes.

    Attributes:
        ONE: rate law of either direction.
    """

    ONE: ClassVar[type[Rate]]
    SYMMETRIC: ClassVar[bool] = False
    MARK: ClassVar[float] = MARK

    def __post_init__(self):
        super().__post_init__()
        names = self.ONE.PARAMETERS
        ways = [self.ONE(**{n: getattr(self, n + behind) for n in names}) for behind in ("", BACKWARD)]
        object.__setattr__(self, "_ways", tuple(ways))

    def __reduce__(self):
        return by_direction, (self.forward, self.backward)

    @property
    def forward(self) -> Rate:
        """Return the rate law of motion along +q."""
        return self._ways[0]  # type: ignore[attr-defined]

    @property
    def backward(self) -> Rate:
        """Return the rate law of motion along -q."""
        return self._ways[1]  # type: ignore[attr-defined]

    def row(self) -> np.ndarray:
        """Return both rows, (2 P,)."""
        return np.concatenate([way.row() for way in self._ways])  # type: ignore[attr-defined]


@cache
def law_by_direction(kind: type[Rate]) -> type[ByDirection]:
    """Return the class of a rate law with separate parameters for each direction.

    Raises:
        InvalidInput: the law already has parameters for each direction.
    """
    if not kind.SYMMETRIC:
        raise InvalidInput(
            f"'{kind.NAME}' already has parameters for each direction.", remedy="Use it as it is, with both."
        )
    parameters, members = dict(kind.PARAMETERS), list[tuple[str, type, Any]]()
    defaults = {f.name: f for f in kind.__dataclass_fields__.values()}
    for behind in ("", BACKWARD):
        for name, parameter in kind.PARAMETERS.items():
            parameters[name + behind] = replace(parameter, symbol=parameter.symbol + ("^-" if behind else ""))
            members.append((name + behind, float, field(default=defaults[name].default, kw_only=True)))
    forces = [n for n, parameter in kind.PARAMETERS.items() if parameter.unit == "force"]
    weaker = kind.EXAMPLE | {n: 0.8 * kind.EXAMPLE[n] for n in forces if n in kind.EXAMPLE}
    example = kind.EXAMPLE | {name + BACKWARD: value for name, value in weaker.items()}
    namespace: dict[str, Any] = {
        "ONE": kind,
        "NAME": kind.NAME + BEHIND,
        "WORDS": f"{kind.WORDS or kind.NAME}, by direction",
        "KIND": kind.KIND,
        "PARAMETERS": parameters,
        "EXAMPLE": example,
        "SMOOTH": kind.SMOOTH,
        "NEEDS": kind.NEEDS,
        "TIES": {"coulomb" + BACKWARD: "coulomb"} if "coulomb" in kind.PARAMETERS else {},
        "__module__": __name__,
        "__doc__": _documentation(kind),
    }
    return make_dataclass(
        f"{kind.__name__}ByDirection",
        members,
        bases=(ByDirection,),
        namespace=namespace,
        frozen=True,
        kw_only=True,
    )


def _documentation(kind: type[Rate]) -> str:
    """Return the docstring of a law by direction, whose parameters along -q have symbols of their own."""
    first = (kind.__doc__ or kind.NAME).strip().splitlines()[0].rstrip(".")
    lines = (kind.__doc__ or "").partition("Attributes:\n")[2].rstrip().splitlines()
    backward = "\n".join(lines)
    for name, parameter in kind.PARAMETERS.items():
        backward = re.sub(
            rf"^( +){name}: ", rf"\g<1>{name}{BACKWARD}: along -q, ", backward, flags=re.MULTILINE
        )
        backward = backward.replace(f"along -q, {parameter.symbol}", f"{parameter.symbol}^-, along -q")
    return "\n".join([f"{first}, by direction.\n\n    Attributes:", *lines, backward])


def by_direction(forward: R, backward: R) -> ByDirection:
    """Return a rate law that differs by direction.

    Args:
        forward: rate law of motion along +q.
        backward: of motion along -q, of the same class.

    Raises:
        InvalidInput: the two classes differ, or the class already has parameters for each direction.

    Example:
        >>> by_direction(Coulomb(coulomb=5.0), Coulomb(coulomb=4.0)).coulomb_backward
        4.0
    """
    if type(forward) is not type(backward) or not isinstance(forward, Rate):  # pyright: ignore[reportUnnecessaryIsInstance]  (a person gives it)
        what = " and ".join(type(way).__name__ for way in (forward, backward))
        raise InvalidInput(
            f"The directions of a rate law are {what}.", remedy="Give two rate laws of the same class."
        )
    behind = {name + BACKWARD: value for name, value in backward.values().items()}
    return law_by_direction(type(forward))(**forward.values(), **behind)


def plain(name: str) -> str:
    """Return the name of a parameter without its direction."""
    return name.removesuffix(BACKWARD)
