"""Checks of a model file beyond the types of its values; each error names the place.

A model file may come from an untrusted source, and its numbers determine the torque of a motor. So impossible values are
refused: numbers beyond any machine, and line sections that are too short. Rounding errors would determine the curve beyond such
a section.
"""

from __future__ import annotations

import json
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from backdrive._documents import is_list, is_object, is_several, numbers_in
from backdrive.errors import BackdriveError, ModelFileError

if TYPE_CHECKING:
    from backdrive.model import Covariance, JointFriction

BIG = 1e12  # largest magnitude of any number but those below, in SI
MOST_ERROR = 1e100  # of a standard error or a quality; that of an undetermined value may be nearly infinite
MOST_SPEED = 1e6  # of the validity range [rad/s or m/s]
MOST_TORQUE = 1e7  # of friction at rest and in the validity range [N.m or N]
COLDEST = -273.15  # [degC]
LEAST_SECTION = 1e-6  # length of a line section, as a share of its upper end [-]
DEEPEST = 20  # levels of what `provenance.options` holds
_UNSURE = ("standard_error", "residual_percent", "residual_raw_percent", "rms", "condition", "matrix")
AGAIN = "Correct it there, or identify again."


@contextmanager
def error_place(where: str) -> Generator[None, None, None]:
    """Add the place in the file to errors that do not name it."""
    try:
        yield
    except BackdriveError as error:
        if isinstance(error, ModelFileError):
            raise
        raise ModelFileError(f"{where}: {error.message}", remedy=error.remedy) from error


def check_keys(data: bytes, plain: dict[str, Any]) -> None:
    """Refuse duplicate keys of an object, since readers differ in which one they use; and unknown keys.

    Args:
        data: a model file that has been read already.
        plain: the decoded file, as plain values.

    Raises:
        ModelFileError: names the key.
    """

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        members = dict(pairs)
        if len(members) < len(pairs):
            keys = [key for key, _ in pairs]
            twice = next(key for i, key in enumerate(keys) if key in keys[:i])
            raise ModelFileError(f"'{twice[:100]}' occurs twice in one object.", remedy=AGAIN)
        return members

    _check_read(json.loads(data, object_pairs_hook=once), plain, "$")


def _check_read(written: Any, read: Any, where: str) -> None:
    """Refuse keys of a document that were not read."""
    if is_object(written) and is_object(read):
        for key, value in written.items():
            if key not in read:
                raise ModelFileError(
                    f"{where} contains the unknown field '{key[:100]}'.",
                    remedy=f"{AGAIN} A newer backdrive may have written it: upgrade.",
                )
            _check_read(value, read[key], f"{where}.{key}")
    elif is_list(written) and is_several(read):
        for i, (value, inner) in enumerate(zip(written, read, strict=False)):
            _check_read(value, inner, f"{where}[{i}]")


def check_document(document: dict[str, Any]) -> None:
    """Refuse numbers beyond any machine, according to their place in the document.

    Args:
        document: a model file as plain values of the right types.

    Raises:
        ModelFileError: names the first such place.
    """
    for part in ("joints", "arm", "coupling"):
        for where, value in numbers_in(document[part], f"$.{part}"):
            unsure = any(where.endswith(word) or f".{word}[" in where for word in _UNSURE)
            most = MOST_ERROR if unsure else BIG
            if not abs(value) <= most:
                raise ModelFileError(f"{where} is {value:g}, beyond {most:g}.", remedy=AGAIN)
    for i, joint in enumerate(document["joints"]):
        validity, where = joint["validity"], f"$.joints[{i}].validity"
        fastest = max(abs(v) for v in validity["velocity"])
        if fastest > MOST_SPEED:
            raise ModelFileError(
                f"{where}.velocity reaches {fastest:g}, beyond {MOST_SPEED:g}.", remedy=AGAIN
            )
        if validity["temperature"] is not None and min(validity["temperature"]) < COLDEST:
            raise ModelFileError(
                f"{where}.temperature is {min(validity['temperature']):g}, below {COLDEST} degC.",
                remedy=AGAIN,
            )
        for name in ("fitted", "held_out"):
            numbers: dict[str, Any] = joint[name] or {}
            for key, number in numbers.items():
                if number is not None and number < 0:
                    raise ModelFileError(
                        f"$.joints[{i}].{name}.{key} is {number:g}, which cannot be negative.", remedy=AGAIN
                    )
    if _deeper(document["provenance"]["options"], DEEPEST):
        raise ModelFileError(
            f"$.provenance.options has more than {DEEPEST} levels.", remedy="Options are names and numbers."
        )


def _deeper(value: Any, levels: int) -> bool:
    """Return whether there are lists or objects below the last level; without recursion, whose depth is limited."""
    present: list[Any] = [value]
    for _ in range(levels):
        inner: list[Any] = [v for c in present for v in (c.values() if is_object(c) else c)]
        present = [v for v in inner if isinstance(v, (dict, list, tuple))]
    return bool(present)


def check_errors(value: float | Sequence[float], error: Any, where: str) -> None:
    """Refuse standard errors that are negative or do not match their values.

    Args:
        value: one number or one a knot.
        error: its standard error, one or one a knot, or None; None in a list stands for one that is unknown.
        where: the place in the file.

    Raises:
        ModelFileError: names the place.
    """
    errors: list[Any] = error if is_list(error) else [error]
    if any(e is not None and e < 0 for e in errors):
        raise ModelFileError(f"{where}.standard_error is negative.", remedy=AGAIN)
    if is_list(error) and not (is_list(value) and len(value) == len(error)):
        raise ModelFileError(
            f"{where}: {len(error)} standard errors of {len(value) if is_list(value) else 1} values.",
            remedy="Give one of each value.",
        )


def check_law(friction: JointFriction, where: str) -> None:
    """Refuse a curve that rounding errors determine, or that is beyond any machine.

    Args:
        friction: of one joint.
        where: the joint's place in the file.

    Raises:
        ModelFileError: names the place.
    """
    knots = np.asarray(getattr(friction.law.rate, "velocity", ()), dtype=np.float64)
    if knots.size > 1:
        short = np.diff(knots) < LEAST_SECTION * knots[1:]
        if short.any():
            i = int(np.argmax(short))
            raise ModelFileError(
                f"{where}.parameters.velocity: knots {i} and {i + 1} are {knots[i + 1] - knots[i]:.3g} apart at "
                f"{knots[i + 1]:g}. So short a section does not determine the curve beyond it.",
                remedy="Merge them.",
            )
    low, high = friction.validity.velocity
    velocity = np.concatenate([np.linspace(low, high, 201), knots, -knots])
    with np.errstate(all="ignore"):
        torque = friction.law.torque(velocity[(velocity >= low) & (velocity <= high)])
        most = max(*np.abs(friction.law.coulomb()), *np.abs(torque))
    if not most <= MOST_TORQUE:
        raise ModelFileError(
            f"{where}: friction reaches {most:.3g} {friction.joint.torque_unit} at rest or in the validity range, beyond "
            f"{MOST_TORQUE:g}.",
            remedy=AGAIN,
        )


def check_rows(covariance: Covariance | None, friction: JointFriction, where: str) -> None:
    """Refuse a covariance of numbers that the joint does not have.

    Args:
        covariance: as the file has it.
        friction: of the joint, which has kept the rows of its numbers.
        where: the joint's place in the file.

    Raises:
        ModelFileError: names the row.
    """
    if covariance is not None:
        kept = () if friction.covariance is None else friction.covariance.names
        for i, name in enumerate(covariance.names):
            if name not in kept:
                raise ModelFileError(
                    f"{where}.covariance.names[{i}] is '{name[:100]}', which exists neither in the law nor in the dynamics.",
                    remedy=AGAIN,
                )
