"""The torque loop of a model's tuned joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from backdrive._documents import as_list
from backdrive.control.loop import Loop
from backdrive.errors import InvalidInput, check_type
from backdrive.model import FrictionModel
from backdrive.parameters import NOT_NEGATIVE, number
from backdrive.tuning.tuning import Tuning

OF_JOINT = ("top_speed", "limit", "encoder_count")


def loop_of(
    model: FrictionModel, tunings: Tuning | Sequence[Tuning], *, period: float | None = None, **more: Any
) -> Loop:
    """Return the torque loop of one or several tuned joints, in the order of the model; see `FrictionModel.loop`.

    Raises:
        InvalidInput: a tuning is of no joint of the model, was made for another period, or has no limits.
    """
    remedy = "Give what `tune` returned, one or a list."
    several: list[Any] = as_list(tunings)
    if not several:
        raise InvalidInput("A loop needs tunings.", remedy=remedy)
    for tuning in several:
        check_type(tuning, Tuning, "tuning", remedy)
    if unknown := sorted(set(more) - set(OF_JOINT)):
        raise InvalidInput(f"A loop has no '{unknown[0]}'.", remedy=f"Give {', '.join(OF_JOINT)}.")
    by_name = {t.joint: t for t in several}
    if strange := [name for name in by_name if name not in model.names]:
        raise InvalidInput(
            f"The tuning is of joint '{strange[0]}'.", remedy=f"The model has {', '.join(model.names)}."
        )
    if len(by_name) < len(several):
        raise InvalidInput("Two tunings are of one joint.", remedy="Give one a joint.")
    intervals = {t.interval for t in several}
    interval = min(intervals) if period is None else number("The loop's period [s]", period)
    if intervals != {interval}:
        raise InvalidInput(
            f"The joints were tuned for periods of {', '.join(f'{i:g}' for i in sorted(intervals))} s, not {interval:g} s.",
            remedy="Tune them for the period of the loop: tune(..., interval=...).",
        )
    joints = []
    for name in model.names:
        if name in by_name:
            own = {key: _of_joint(key, value, name) for key, value in more.items()}
            joints.append(by_name[name].loop(**own))
    return Loop(joints, interval=interval)


def _of_joint(option: str, value: Any, name: str) -> float | None:
    """Return an option's value for a joint: a number for all, or one by name."""
    if isinstance(value, Mapping):
        if name not in value:
            raise InvalidInput(
                f"{option} holds nothing for joint '{name}'.", remedy=f"Give one for it: {{'{name}': ...}}."
            )
        value = value[name]
    return None if value is None else number(f"Joint '{name}': {option}", value, NOT_NEGATIVE)
