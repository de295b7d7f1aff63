"""Folders in LeRobot's layout, versions 2 and 3: `meta/info.json` names the features, Parquet files hold the frames.

The file is `meta/info.json`. Its parts are the Parquet files in the folder `data/`; the paths and counts that the description
states are not used. Episodes stand one after the other on one clock, with a pause between.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from backdrive._documents import is_list, is_object
from backdrive._files import read_whole
from backdrive.errors import BackdriveError, FileTooLarge, ReadError
from backdrive.logs.readers import parquet
from backdrive.logs.readers.columns import Columns, ReadOptions, clean

PAUSE = 1.0  # between two episodes [s]
MOST_INFO = 1 << 22  # of the description [B]
FEATURES = {
    "observation.state": "position",
    "observation.velocity": "velocity",
    "observation.effort": "torque",
    "observation.torque": "torque",
    "action": "reference",
}
ENDINGS = {
    "pos": "position",
    "position": "position",
    "vel": "velocity",
    "velocity": "velocity",
    "effort": "torque",
    "torque": "torque",
}

prepare = parquet.prepare


def read(path: str, options: ReadOptions) -> Columns:
    """Read all episodes.

    Raises:
        ReadError: the description is no object of features, or its Parquet files do not fit together.
        FileTooLarge: together they hold more than the limits allow.
        MissingExtra: pyarrow is not installed.
    """
    notes: list[str] = []
    info = _info(path)
    features = info.get("features")
    if not is_object(features):
        raise ReadError(
            "meta/info.json names no features.", remedy="Name a Parquet file of data/ instead of the folder."
        )
    if not options.parts:
        raise ReadError(
            "The folder holds no Parquet files below data/.", remedy="Download the data set's data/ too."
        )
    arrays = _together(options, notes)
    if not arrays:
        raise ReadError("The Parquet files of data/ hold no numbers.", remedy="Copy the data set again.")
    length = len(next(iter(arrays.values())))
    frames = info.get("total_frames")
    if isinstance(frames, int) and frames != length:
        notes.append(f"meta/info.json speaks of {clean(frames, 20)} frames, the files hold {length}.")
    order, time = _clock(arrays, info.get("fps"), notes)
    arrays = {name: value[order] for name, value in arrays.items()}
    arrays["time"] = time
    channels, joints = _channels(arrays, features, notes)
    notes.append("LeRobot states no units: positions are taken as rad; if they are degrees, say --unit deg.")
    return Columns(
        arrays=arrays,
        units={"time": "s"},
        joints=joints,
        channels={"time": "time", **channels},
        notes=tuple(dict.fromkeys(notes)),
    )


def _info(path: str) -> dict[str, Any]:
    try:
        info = json.loads(read_whole(path, MOST_INFO))
    except (ValueError, UnicodeDecodeError) as error:
        raise ReadError(
            f"meta/info.json is not JSON ({error}).", remedy="Copy the data set again."
        ) from error
    if not is_object(info):
        raise ReadError("meta/info.json is no JSON object.", remedy="Copy the data set again.")
    return info


def _together(options: ReadOptions, notes: list[str]) -> dict[str, np.ndarray]:
    """Return the columns of all files, end to end."""
    files: list[Columns] = []
    total = 0
    for part in options.parts:
        place = "/".join(Path(part).parts[-2:])
        try:
            columns = parquet.read(part, replace(options, parts=()))
        except BackdriveError as error:
            raise type(error)(f"{place}: {error.message}", remedy=error.remedy) from error
        total += sum(value.nbytes for value in columns.arrays.values())
        if total > options.limits.max_bytes:
            raise FileTooLarge(
                f"The episodes hold more than the limit of {options.limits.max_bytes} bytes.",
                remedy="Name single Parquet files, or read them in Python with limits=Limits(max_bytes=...).",
            )
        shapes = {name: value.shape[1:] for name, value in columns.arrays.items()}
        if files and shapes != {name: value.shape[1:] for name, value in files[0].arrays.items()}:
            raise ReadError(
                f"{place} holds other columns than the files before it: {', '.join(shapes)}.",
                remedy="Remove it from the folder, or name the Parquet files one by one.",
            )
        files.append(columns)
        notes += columns.notes
    return {name: np.concatenate([file.arrays[name] for file in files]) for name in files[0].arrays}


def _clock(arrays: Mapping[str, np.ndarray], rate: object, notes: list[str]) -> tuple[np.ndarray, np.ndarray]:
    """Return the order of the rows by episode, and their time [s]: an episode begins a pause after the one before it."""
    length = len(next(iter(arrays.values())))
    episode = arrays.get("episode_index", np.zeros(length))
    frame = arrays.get("frame_index")
    if episode.ndim != 1 or (frame is not None and frame.ndim != 1):
        raise ReadError(
            "episode_index and frame_index are not single numbers.", remedy="Copy the data set again."
        )
    order = np.lexsort((np.arange(length) if frame is None else frame, episode))
    stamp = arrays.get("timestamp")
    if stamp is None or stamp.ndim != 1:
        if (
            not isinstance(rate, (int, float))
            or isinstance(rate, bool)
            or not 0.0 < rate < 1e6
            or frame is None
        ):
            raise ReadError(
                f"The frames carry no timestamp, and fps is {clean(rate, 40)}.",
                remedy="Correct fps in meta/info.json [Hz].",
            )
        stamp = frame / rate
        notes.append(f"The frames carry no timestamp: they are taken to be 1/{rate:g} s apart (fps).")
    stamp, episode = stamp[order].astype(np.float64), episode[order]
    begins = np.flatnonzero(np.r_[True, episode[1:] != episode[:-1]])
    ends = np.r_[begins[1:], length] - 1
    lengths = stamp[ends] - stamp[begins]
    start = np.r_[0.0, np.cumsum(lengths + PAUSE)[:-1]] - stamp[begins]
    if len(begins) > 1:
        notes.append(
            f"{len(begins)} episodes stand one after the other, with a pause of {PAUSE:g} s between."
        )
    return order, stamp + np.repeat(start, ends - begins + 1)


def _channels(
    arrays: dict[str, np.ndarray], features: Mapping[str, object], notes: list[str]
) -> tuple[dict[str, str], tuple[str, ...]]:
    """Return which column is which channel, and the joints' names; columns of a feature that mixes channels are added."""
    parts: dict[str, dict[str, np.ndarray]] = {}
    for feature, usual in FEATURES.items():
        value = arrays.get(feature)
        if value is None:
            continue
        value = value[:, None] if value.ndim == 1 else value
        names = _names(features.get(feature))
        if names and len(names) != value.shape[1]:
            notes.append(
                f"meta/info.json gives {len(names)} names for {value.shape[1]} columns of {feature}: not used."
            )
            names = ()
        for column, name in enumerate(names or [f"joint_{i + 1}" for i in range(value.shape[1])]):
            joint, _, ending = name.rpartition(".")
            channel = ENDINGS.get(ending) if joint else None
            joint = joint if channel else name
            if usual == "reference" and channel not in (None, "position"):
                continue
            channel = usual if usual == "reference" else channel or usual
            parts.setdefault(channel, {}).setdefault(joint, value[:, column])
    main = parts.get("position", parts.get("velocity", {}))
    channels: dict[str, str] = {}
    for channel, columns in parts.items():
        if set(columns) != set(main):
            notes.append(f"The {channel} is of other joints ({', '.join(list(columns)[:8])}): left out.")
            continue
        arrays[f"{channel} of joints"] = np.column_stack([columns[joint] for joint in main])
        channels[f"{channel} of joints"] = channel
    return channels, tuple(main) if any(_names(features.get(feature)) for feature in FEATURES) else ()


def _names(feature: object) -> tuple[str, ...]:
    """Return the names of a feature's columns: a list, or a list in an object (`motors`, `axes`)."""
    listed: Any = feature.get("names") if is_object(feature) else None
    if is_object(listed):
        listed = next((value for value in listed.values() if is_list(value)), None)
    if not is_list(listed):
        return ()
    names = tuple(clean(name) for name in listed if isinstance(name, str))
    return names if len(set(names)) == len(names) else ()
