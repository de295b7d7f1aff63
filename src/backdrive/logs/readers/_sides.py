"""From the motors' side to the joints': gear ratios and coupled transmissions."""

from __future__ import annotations

from collections.abc import Sequence

from backdrive.errors import InvalidInput
from backdrive.logs.log import Log

#: Name of a channel measured on the motor side, as written by the user -> the channel.
MOTOR_SIDE = {"q": "position", "dq": "velocity", "qr": "reference", "tau": "torque"}


def motor_channels(words: str | Sequence[str] | None, gear: object) -> tuple[str, ...]:
    """Return the channels that gear ratios convert to the joint side; the torque alone by default.

    Raises:
        InvalidInput: a word is no such channel, or there is no gear.
    """
    if words is None:
        return ("torque",)
    each = words.split(",") if isinstance(words, str) else list(words)
    each = [str(word).strip() for word in each]
    known = {**MOTOR_SIDE, **{channel: channel for channel in MOTOR_SIDE.values()}}
    unknown = [word for word in each if word not in known]
    if unknown or not each:
        raise InvalidInput(
            f"'{', '.join(unknown) or words}' is no channel of the motor side.",
            remedy=f"Give some of {', '.join(MOTOR_SIDE)} (--motor-side q,tau).",
        )
    if gear is None:
        raise InvalidInput(
            f"{', '.join(each)} of the motor side, and no gear ratio.",
            remedy="Give --gear (in Python gear=).",
        )
    return tuple(dict.fromkeys(known[word] for word in each))


def divide_by_gear(log: Log, channels: Sequence[str]) -> Log:
    """Return a log with positions and velocities of the motor side divided by the gear ratios of its joints."""
    moves = [c for c in channels if c != "torque" and c in log.channels]
    absent = [c for c in channels if c not in log.channels]
    if absent:
        raise InvalidInput(
            f"The motor side's {', '.join(absent)} is not in the log.",
            remedy=f"Channels: {', '.join(log.channels)}. Name it with --map, or take it out of --motor-side.",
        )
    if not moves:
        return log
    ratio = [joint.gear_ratio for joint in log.joints]
    return log.replace(**{c: log.channels[c] / ratio for c in moves}).with_note(
        f"Divided by the gear ratio, as of the motor side: {', '.join(moves)}."
    )
