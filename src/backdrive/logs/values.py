"""Arrays of numbers that a log may hold, and sampling intervals."""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from backdrive.errors import InvalidInput

SHORTEST = 1e-12  # median sampling interval [s]


def read_only(value: Any, name: str) -> np.ndarray:
    """Return the values as read-only float64; what already is, and cannot be written through another array, is not copied."""
    if isinstance(value, np.ndarray):
        given: np.ndarray = cast("np.ndarray", value)
        if given.dtype == np.float64 and not given.flags.writeable and _owner_is_read_only(given):
            return given
    try:
        if np.iscomplexobj(cast("Any", value)):
            raise InvalidInput(f"Log.{name} is an array of complex numbers.", remedy="Give real numbers.")
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        if isinstance(error, InvalidInput):
            raise
        raise InvalidInput(
            f"Log.{name} holds something that is not a number.", remedy="Give plain numbers."
        ) from error
    array.setflags(write=False)
    return array


def _owner_is_read_only(array: np.ndarray) -> bool:
    owner = array if array.base is None else array.base
    if not isinstance(owner, np.ndarray):  # pyright: ignore[reportUnnecessaryIsInstance]  (bytes own some; NumPy's stub omits it)
        return False
    return owner.base is None and not owner.flags.writeable


def check_period(period: float) -> float:
    """Return a sampling interval [s] after checking it.

    Raises:
        InvalidInput: it is above zero and below a picosecond.
    """
    if 0.0 < period < SHORTEST:
        raise InvalidInput(
            f"The median sampling interval is {period:g} s.",
            remedy="Bring the time to seconds, for example --map t=0.001*COLUMN.",
        )
    return period
