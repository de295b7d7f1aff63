"""Random draws of a joint's friction law from the identified covariance, for domain randomisation.

Parameters are drawn from a normal distribution with the stated mean and covariance. A parameter without a row in the
covariance has its standard error alone; without a standard error it is constant. A draw outside a parameter's bounds is
repeated. So the draws reproduce mean and covariance if the bounds are far, and respect the bounds if they are near.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.laws import Law
from backdrive.laws.base import Rows
from backdrive.parameters import whole

if TYPE_CHECKING:
    from backdrive.model.joint_friction import JointFriction

ROUNDS = 200  # most repetitions of draws outside the bounds
MOST = 10**7  # sets that are drawn at once


def draw_laws(friction: JointFriction, n: int, seed: int | Sequence[int] = 0) -> list[Law]:
    """Return draws of a joint's law.

    Args:
        friction: of the joint.
        n: how many.
        seed: the same one gives the same draws.

    Raises:
        InvalidInput: `n` is not from 1 to 1e7; the model knows no errors of the joint's law; bounds leave hardly any draw.
    """
    n = whole("The number of draws", n, 1, MOST)
    law = friction.law
    names, mean, low, high = law_numbers(law)
    spread = _covariance(friction, names)
    free = np.flatnonzero(np.diag(spread) > 0.0)
    if not free.size:
        raise InvalidInput(
            f"Joint '{friction.joint.name}': the model has no errors of '{law.name}' to draw from.",
            remedy="Identify it from a log; presets hold published values without errors.",
        )
    values, vectors = np.linalg.eigh(spread[np.ix_(free, free)])
    root = vectors * np.sqrt(np.clip(values, 0.0, None))
    random = np.random.default_rng(seed)
    laws: list[Law | None] = [None] * n
    missing = list(range(n))
    for _ in range(ROUNDS):
        draws = np.repeat(mean[None, :], len(missing), axis=0)
        draws[:, free] += random.standard_normal((len(missing), free.size)) @ root.T
        inside = np.all((draws >= low) & (draws <= high), axis=1)
        left: list[int] = []
        for place, numbers, kept in zip(missing, draws, inside, strict=True):
            laws[place] = law_with(law, names, numbers) if kept else None
            if laws[place] is None:
                left.append(place)
        missing = left
        if not missing:
            return [each for each in laws if each is not None]
    raise InvalidInput(
        f"Joint '{friction.joint.name}': {len(missing)} of {n} draws lay outside the bounds {ROUNDS} times.",
        remedy="The errors are larger than the bounds allow: identify from more data.",
    )


def law_numbers(law: Law) -> tuple[list[str], np.ndarray, np.ndarray, np.ndarray]:
    """Return names, values and bounds of all numbers of a law."""
    names: list[str] = []
    rows: list[tuple[float, float, float]] = []
    for part in law.parts:
        for name, parameter in part.PARAMETERS.items():
            value = getattr(part, name)
            for i, each in enumerate(value if parameter.many else (value,)):
                names.append(f"{name}[{i}]" if parameter.many else name)
                rows.append((each, parameter.lower, parameter.upper))
    mean, low, high = np.array(rows).T
    return names, mean, low, high


def _covariance(friction: JointFriction, names: list[str]) -> np.ndarray:
    """Return the covariance of a law's numbers, (k, k): 0 where it is not known."""
    spread = np.zeros((len(names), len(names)))
    for name, error in friction.standard_errors.items():
        for i, each in enumerate(np.atleast_1d(np.asarray(error, dtype=float))):
            for row in (name, f"{name}[{i}]"):
                if row in names and np.isfinite(each):
                    spread[names.index(row), names.index(row)] = each**2
    if friction.covariance is not None:
        matrix = friction.covariance.array()
        own = [i for i, row in enumerate(friction.covariance.names) if row in names]
        places = [names.index(friction.covariance.names[i]) for i in own]
        spread[np.ix_(places, places)] = matrix[np.ix_(own, own)]
    return spread


def law_with(law: Law, names: list[str], numbers: np.ndarray) -> Law | None:
    """Return the law with other parameters; None if they are invalid."""
    given: dict[str, Any] = {}
    for name, number in zip(names, numbers.tolist(), strict=True):
        indexed = re.fullmatch(r"(\w+)\[\d+\]", name)
        if indexed:
            given.setdefault(indexed[1], []).append(number)
        else:
            given[name] = number

    def part(rows: Rows) -> Any:
        return type(rows)(**{name: given[name] for name in rows.PARAMETERS})

    try:
        return Law(rate=part(law.rate), element=part(law.element), growth=law.growth and part(law.growth))
    except InvalidInput:
        return None
