"""Factors of a `--map` that contradict the unit in a column's name."""

from __future__ import annotations

import math

from backdrive.logs.log import AS_SI, DOUBTED
from backdrive.logs.readers import units
from backdrive.logs.readers._expression import Term

#: By unit the factor from which on it is doubtful, for a torque and for others: degrees are no radians, and 1 mA makes no 100 N.m.
UNLIKELY: dict[str, tuple[float, float]] = {
    "ma": (0.1, math.inf),
    "%": (math.inf, math.inf),
    "mnm": (0.5, math.inf),
    "deg": (math.inf, 0.5),
    "deg/s": (math.inf, 0.5),
    "rpm": (math.inf, 0.5),
}
NO_FACTOR, LARGE_FACTOR = DOUBTED
OF_TORQUE = ("ma", "%", "mnm")


def doubtful_factor(channel: str, term: Term, column: str) -> str:
    """Return a sentence on a factor that is none, or too large, for the unit that a column's name ends with; empty without doubt.

    Args:
        channel: that the column becomes.
        term: of the `--map`, without a named factor such as `deg`.
        column: its name in the file.
    """
    ending = units.split_suffix(column)[1]
    of_name = ending or units.split(column)[1].lower()
    if channel == "time" or of_name not in UNLIKELY or (of_name in OF_TORQUE) is not (channel == "torque"):
        return ""
    plain = not term.factors and not term.each and abs(term.factor) == 1.0
    if plain and ending:
        why = "as its factor is 1" if 1.0 in term.numbers else NO_FACTOR
        return f"'{column}' {AS_SI}, {why}, though its name ends with {ending}."
    factor = max(abs(x * term.factor) for x in term.each or (1.0,))
    if plain or term.factors or factor < UNLIKELY[of_name][channel != "torque"]:
        return ""
    return f"'{column}' {AS_SI}, times {factor:.3g}, {LARGE_FACTOR}."
