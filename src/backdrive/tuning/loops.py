"""The torque loop of a model's tuned joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from backdrive.control.loop import Loop
from backdrive.errors import InvalidInput
from backdrive.model import FrictionModel
from backdrive.tuning.tuning import Tuning

OF_JOINT = ("top_speed", "limit", "encoder_count")


def loop_of(
    model: FrictionModel, tunings: Tuning | Sequence[Tuning], *, period: float | None = None, **more: Any
) -> Loop:
    """Return the torque loop of one or several tuned joints, in the order of the model; see `FrictionModel.loop`.

    Raises:
        InvalidInput: a tuning is of no joint of the model, was made for another period, or has no limits.
    """
    several = [tunings] if isinstance(tunings, Tuning) else list(tunings)
    if not several or not all(isinstance(t, Tuning) for t in several):
        raise InvalidInput("A loop needs tunings.", remedy="Give what `tune` returned, one or a list.")
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
    interval = min(intervals) if period is None else period
    if intervals != {interval}:
        raise InvalidInput(
            f"The joints were tuned for periods of {', '.join(f'{i:g}' for i in sorted(intervals))} s, not {interval:g} s.",
            remedy="Tune them for the period of the loop: tune(..., interval=...).",
        )
    joints = []
    for name in model.names:
        if name in by_name:
            own = {key: value[name] if isinstance(value, Mapping) else value for key, value in more.items()}
            joints.append(by_name[name].loop(**own))
    return Loop(joints, interval=interval)
