"""Judge a model that was fitted from the drive's input on other logs, by motion: no torque is needed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from backdrive.engine import Axis, DriveModel, forward
from backdrive.errors import BackdriveError, InvalidInput
from backdrive.identification.dynamic.driven import driven, whole
from backdrive.identification.dynamic.motion_terms import OF_AXIS
from backdrive.identification.options import Options, settings_of
from backdrive.logs.log import Log
from backdrive.model import FrictionModel

LEAST_STEP = 1e-7  # of an integration that a model file may ask for [s]


@dataclass(frozen=True, kw_only=True)
class MotionQuality:
    """How well a model's motion under the recorded input is the one that was recorded.

    Attributes:
        residual: root mean square of the error by that of the position about its mean [%].
        rms: root mean square of the error [rad or m].
        samples: that were judged.
    """

    residual: float
    rms: float
    samples: int


def judge_motion(model: FrictionModel, logs: Sequence[Log]) -> dict[str, MotionQuality]:
    """Return for every joint that model and logs share how well its motion is predicted from the drive's input.

    As in the fit, a log under a controller runs from its first sample to its last, and without one in windows.

    Args:
        model: of a fit from the drive's input, whose options hold the drive.
        logs: with position and the drive's input.

    Raises:
        InvalidInput: the model holds no drive, or shares no joint with the logs.
    """
    found = {}
    for name in model.names:
        if not all(name in log.names for log in logs):
            continue
        axis, step = _axis(model, name)
        cutoff = model.options.get("cutoff")
        cutoff = float(cutoff) if isinstance(cutoff, (int, float)) and cutoff > 0 else None
        options = Options(drive=axis.drive, cutoff=cutoff)
        parts = [part for log in logs for part in driven(log, name, axis.drive, options)]
        errors, spread = [], []
        for log in whole(parts, axis.drive.controller != "open"):
            moved = forward(
                axis,
                log.drive_input,
                dt=log.dt,
                position=float(log.position[0]),
                velocity=log.launch,
                temperature=None if log.temperature is None else log.temperature[None],
                substeps=max(1, int(np.ceil(log.dt / step - 1e-6))),
            )
            errors.append(moved.position[0] - log.position)
        spread = np.concatenate([part.log.position - part.log.position.mean() for part in parts])
        error = np.concatenate(errors)
        rms, size = float(np.sqrt(np.mean(error**2))), float(np.sqrt(np.mean(spread**2)))
        residual = 100.0 * rms / size if size > 0.0 else float("nan")
        found[name] = MotionQuality(residual=residual, rms=rms, samples=error.size)
    if not found:
        raise InvalidInput(
            f"Model ({', '.join(model.names)}) and logs ({', '.join(logs[0].names)}) share no joint.",
            remedy="Name the log's joints as in the model (--names).",
        )
    return found


def _axis(model: FrictionModel, name: str) -> tuple[Axis, float]:
    """Return a joint with its drive, and the integration step that it was fitted with [s]."""
    friction = model.joint(name)
    own = settings_of(model, name)
    drive = own.get("drive")
    values: dict[str, Any] = {n: friction.dynamics[n].value for n in OF_AXIS if n in friction.dynamics}
    if not isinstance(drive, dict) or "inertia" not in values:
        raise InvalidInput(
            f"The model of joint '{name}' holds no drive, and the log no torque.",
            remedy="Map the torque (--map tau=COLUMN); only a model of `identify --drive` can be judged by motion.",
        )
    try:
        step = float(own.get("step", 1e-3))
        if not LEAST_STEP <= step <= 1.0:
            raise ValueError(f"its integration step is {step:g} s")
        return Axis(law=friction.law, drive=DriveModel(**drive), **values), step
    except (TypeError, ValueError, BackdriveError) as error:
        raise InvalidInput(
            f"The drive of joint '{name}' in the model makes no sense: {error}", remedy="Fit it again."
        ) from error
