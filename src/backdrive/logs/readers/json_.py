"""JSON logs: a list of samples, or a list for every channel; and what BAM writes of a servo on a pendulum.

BAM (Duclusaud et al., "Extended friction models for the physics simulation of servo actuators", 2025) records one
object a sample under `entries`. Its `load` is the drive's duty in 1/885 of full, signed 16 bit.
"""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np

from backdrive._documents import is_list, is_object
from backdrive.errors import IncompleteFile, ReadError
from backdrive.logs.log import Drive
from backdrive.logs.readers._labels import holds_names, in_order, read_list, read_names
from backdrive.logs.readers.columns import Columns, ReadOptions

_FULL_DUTY = 885.0
_COUNTS_PER_RAD = 4096 / (2 * math.pi)
_FIRMWARE_GAIN = 256.0
_BAM = {
    "timestamp": "time",
    "position": "position",
    "speed": "velocity",
    "goal_position": "reference",
    "temp": "temperature",
    "load": "drive_input",
}
#: Files of this package by their `format`, which hold no log.
OWN = {
    "backdrive-friction-model": "friction model (`backdrive show FILE`)",
    "backdrive-tuning": "tuning",
    "backdrive-plan": "plan (--plan FILE beside a log)",
    "backdrive-population": "population of robots",
}


def read(path: str, options: ReadOptions) -> Columns:
    """Read a JSON log.

    Raises:
        IncompleteFile: the text ends inside a value.
        ReadError: it is JSON, but no log.
    """
    with open(path, "rb") as stream:
        raw = stream.read()
    try:
        content = json.loads(raw)
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        if isinstance(error, json.JSONDecodeError) and error.pos >= len(error.doc.rstrip()) - 1:
            raise IncompleteFile(
                f"The text ends inside a value ({error}).", remedy="Copy or save it again."
            ) from error
        raise ReadError(
            f"This is not JSON ({error}).",
            remedy="Save it again, or say what it is: --format NAME (in Python format=).",
        ) from error
    own = content.get("format") if is_object(content) else None
    if isinstance(own, str) and own in OWN:
        raise ReadError(f"This is a {OWN[own]}, not a log.", remedy="Name a log.")
    notes: list[str] = []
    samples: Any = (
        content.get("entries", content.get("samples", content.get("data"))) if is_object(content) else content
    )
    if is_list(samples) and samples and all(isinstance(sample, dict) for sample in samples):
        table = _of_samples(samples, notes)
    elif is_object(content):
        table = content
    else:
        raise ReadError(
            "The JSON holds no samples.", remedy="Write a list of objects, or an object of lists."
        )
    options.limits.check_count(len(table), "columns")
    joints: tuple[str, ...] = ()
    order: np.ndarray | None = None
    for key in [key for key in table if holds_names(key) and is_list(table[key])]:
        once = table is content and all(isinstance(word, str) for word in table[key])
        joints, order = (
            (read_list(table[key], key, notes), None) if once else read_names(table[key], key, notes)
        )
        table = {k: v for k, v in table.items() if k != key or not joints}
    arrays: dict[str, np.ndarray] = {}
    _numbers("", table, arrays, notes, 0)
    if not arrays:
        raise ReadError(
            "The JSON holds no lists of numbers.", remedy="Write a list of objects, or an object of lists."
        )
    if (
        is_object(content)
        and {"position", "load", "goal_position", "timestamp"} <= set(arrays)
        and "kp" in content
    ):
        return _bam(content, arrays, notes)
    arrays = in_order(arrays, order, notes)
    return Columns(arrays=arrays, joints=joints, notes=tuple(notes))


def _of_samples(samples: list[dict[str, Any]], notes: list[str]) -> dict[str, list[Any]]:
    """Turn samples into columns; a key that a sample lacks is NaN there."""
    keys = list(dict.fromkeys(key for sample in samples[:1000] for key in sample))
    lacking = [key for key in keys if any(key not in sample for sample in samples)]
    if lacking:
        notes.append(f"Some samples lack {', '.join(lacking[:5])}: NaN there.")
    return {key: [sample.get(key) for sample in samples] for key in keys}


def _numbers(
    prefix: str, table: dict[str, Any], arrays: dict[str, np.ndarray], notes: list[str], depth: int
) -> None:
    for key, values in table.items():
        name = f"{prefix}{key}"
        if is_object(values) and depth < 4:
            _numbers(f"{name}.", values, arrays, notes, depth + 1)
        elif is_list(values) and values:
            try:
                first = next((v for v in values if v is not None), None)
                filler = [math.nan] * len(first) if is_list(first) else math.nan
                value = np.array([filler if v is None else v for v in values])
                if value.dtype.kind not in "biuf" or value.ndim > 2:
                    raise ValueError
                arrays[name] = value
            except (ValueError, TypeError, OverflowError):
                notes.append(f"'{name}' is not numbers of one shape and was left out.")
        elif isinstance(values, (int, float)):
            arrays[name] = np.array([float(values)])


def _bam(content: dict[str, Any], arrays: dict[str, np.ndarray], notes: list[str]) -> Columns:
    """Give BAM's numbers their meaning."""
    load = arrays["load"].astype(float)
    wrapped = load > 32767
    if wrapped.any():
        load = np.where(wrapped, load - 65536, load)
        notes.append(f"{int(wrapped.sum())} samples of load were read as the signed 16-bit numbers they are.")
    between = np.abs(load) > 1.05 * _FULL_DUTY
    if between.any():
        load = np.where(between, np.nan, load)
        notes.append(
            f"{int(between.sum())} samples of load lie beyond full duty, as resampling across a wrapped number leaves "
            "them: NaN there."
        )
    arrays["load"] = load / _FULL_DUTY
    told = [f"{key} {content[key]}" for key in ("mass", "length", "motor", "trajectory") if key in content]
    if told:
        notes.append(f"Pendulum as recorded by BAM: {', '.join(told)} (mass in kg, length in m).")
    enabled = arrays.get("torque_enable")
    if enabled is not None and not np.all(enabled):
        notes.append(f"The drive is off in {int(np.sum(enabled == 0))} samples (torque_enable).")
    gains = {
        "kp": float(content["kp"]),
        "duty_per_rad": float(content["kp"]) * _COUNTS_PER_RAD / (_FIRMWARE_GAIN * _FULL_DUTY),
    }
    if isinstance(content.get("vin"), (int, float)):
        gains["supply"] = float(content["vin"])
    channels = {name: channel for name, channel in _BAM.items() if name in arrays}
    units = {"timestamp": "s", "position": "rad", "speed": "rad/s", "goal_position": "rad", "temp": "degC"}
    return Columns(
        arrays=arrays,
        units={name: unit for name, unit in units.items() if name in arrays},
        joints=(str(content.get("motor", "joint_1")),),
        channels=channels,
        drive=Drive(law="duty", gains=gains),
        notes=tuple(notes),
    )
