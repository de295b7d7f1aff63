"""Codes of the real-time path, where nothing may be raised."""

from __future__ import annotations

from enum import IntEnum


class Status(IntEnum):
    """What one tick of a torque loop had to say; every code has its sentence."""

    sentence: str

    def __new__(cls, code: int, sentence: str):
        """Attach the sentence to the integer."""
        member = int.__new__(cls, code)
        member._value_ = code
        member.sentence = sentence
        return member

    OK = 0, "The tick ran normally."
    NOT_FINITE = 1, "An input was NaN or infinite; the last safe output is held."
    BAD_INTERVAL = 2, "The time step was zero, negative or far from the nominal one; the last output is held."
    SATURATED = 3, "The output reached its limit."
    JUMP = (
        4,
        "The position jumped further than the joint can move; the reading was not believed and the output fades.",
    )
