"""Status codes of the real-time code, which must not raise exceptions."""

from __future__ import annotations

from enum import IntEnum


class Status(IntEnum):
    """The status of one tick of a torque loop. Every code has a sentence; of two codes, the one with the higher `severity` is
    reported.
    """

    sentence: str
    severity: int

    def __new__(cls, code: int, severity: int, sentence: str):
        """Attach severity and sentence to the integer."""
        member = int.__new__(cls, code)
        member._value_ = code
        member.severity, member.sentence = severity, sentence
        return member

    OK = 0, 0, "The tick ran normally."
    NOT_FINITE = 1, 7, "An input was NaN or infinite and was not believed; the output fades."
    BAD_INTERVAL = (
        2,
        6,
        "The interval was zero, negative or far from the period and was not believed; the output fades.",
    )
    SATURATED = 3, 3, "The output reached its limit."
    JUMP = 4, 5, "The position jumped further than the joint can move and was not believed; the output fades."
    LATE = 5, 1, "The tick came late; it was run with the time that passed."
    NO_MOTION = 6, 2, "No motion under torque: the encoder stands still, and the compensating torque fades."
    STOPPED = 7, 4, "The loop was told to stop; the output ramps down to zero and stays there."
    OVERSPEED = 8, 8, "The joint was faster than its top speed; the output goes to zero and stays there."
    LATCHED = 9, 9, "The output stays at zero after a fault, until it is acknowledged."


STATUSES = tuple(Status)  # by code
