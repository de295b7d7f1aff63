"""Columns of the table that a tick of the torque loop reads and writes: one row per joint, so that its numbers lie together.

Inputs are written before the tick, outputs after it; settings are constant; the other columns are the state of the tick.
"""

from __future__ import annotations

from backdrive._jit import leaf, to_bits

(
    # time and input of the tick
    NOMINAL, PASSED, SINCE, TIME, APPLIED, ERROR, SLOPE, KNOWN, MOTOR, LOAD, TEMPERATURE,
    # output
    TORQUE, EXTERNAL, FRICTION, LEVEL, CALLS,
    # settings
    TOP, LIMIT, RATE, RAMP, LATCHING, HOLD, FADE, PATIENCE, SLACK, AWAY, SPAN, HALF_SPAN, ESTIMATES, GROWS,
    LEARNS, CREEP, SETTLE, FLOOR, DEAD, LOWER, UPPER,
    # readings: the last accepted one, the position after a jump, and the total shift of the encoder's zero
    BEGUN, BEFORE, ELSEWHERE, LEAP, SETTLED, PENDING, ZERO,
    # watch: fault time, two points of the window of speeds, the newer one's age, by how much the other is older, the age at
    # which something is due, cause of the latch, stop
    FAULTY, OLDER, NEWER, NEWER_AGE, OLDER_BY, DUE, FAST, CAUSE, STOP, CAP, BAD,
    # standing still, learning
    ANCHOR, STILL, SLID,
) = range(58)  # fmt: skip
TABLE = 58


@leaf
def is_set(flag):
    """Return whether a column that is 0 or positive is not 0; a comparison of bits costs half of one of numbers."""
    return to_bits(flag) != 0
