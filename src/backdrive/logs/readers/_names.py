"""Recognition of channels by column names, where the name is unambiguous."""

from __future__ import annotations

import re
from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from backdrive.logs.readers import units
from backdrive.logs.readers._missing import of_all


def _words(text: str) -> tuple[str, ...]:
    return tuple(text.split())


#: Names that mean a channel, the usual ones first: when several are in a file the first one is taken, and it is noted.
ALIASES: dict[str, tuple[str, ...]] = {
    "time": _words(
        "time t timestamp timestamps mt times stamp time_stamp header_stamp sec secs seconds elapsed elapsed_time zeit"
    ),
    "position": _words(
        "position q pos positions mq qm actual_q q_measured q_meas measured_q q_actual act_q joint_position "
        "joint_positions joint_pos position_actual_value position_actual_value_averaged actual_position "
        "measured_position position_actual pos_actual joint_angle joint_angles angle theta qpos observation_state "
        "istposition position_ist winkel istwinkel gelenkwinkel lage istlage"
    ),
    "velocity": _words(
        "velocity dq vel velocities mdq d_q qd qdot q_dot actual_qd dq_measured dq_meas joint_velocity joint_velocities "
        "joint_vel velocity_actual_value velocity_actual_value_averaged actual_velocity measured_velocity "
        "velocity_actual vel_actual speed omega qvel geschwindigkeit istgeschwindigkeit drehzahl winkelgeschwindigkeit"
    ),
    "torque": _words(
        "torque tau effort torques efforts mtorque m_torque tau_j tau_measured tau_meas joint_torque joint_torques "
        "joint_effort joint_efforts measured_torque actual_torque torque_actual_value torque_actual_value_averaged "
        "torque_actual motor_torque force drehmoment moment istmoment motormoment kraft"
    ),
    "reference": _words(
        "reference q_ref qref ref q_des qdes q_desired q_cmd q_command q_d target_q goal_position desired_position "
        "target_position commanded_position position_command position_reference position_demand_value setpoint action "
        "sollposition position_soll sollwinkel solllage"
    ),
    "external_torque": _words("external_torque tau_ext tau_ext_hat_filtered external_torques"),
    "model_torque": ("model_torque", "tau_model"),
    "second_encoder": ("second_encoder", "link_encoder", "secondary_position"),
    "load": ("load", "joint_load"),
    "temperature": _words(
        "temperature temp temperatures joint_temperature joint_temperatures motor_temperature motor_temperatures temperatur"
    ),
    "drive_input": ("drive_input",),
}

#: What a stated unit may measure for it to be that channel.
KINDS: dict[str, tuple[str, ...]] = {
    "time": ("time",),
    "position": ("angle", "length"),
    "reference": ("angle", "length"),
    "second_encoder": ("angle", "length"),
    "velocity": ("angle rate", "speed"),
    "torque": ("torque", "force"),
    "external_torque": ("torque", "force"),
    "model_torque": ("torque", "force"),
    "load": ("torque", "force"),
    "temperature": ("temperature",),
    "wrench": ("force", "torque"),
    "drive_input": ("raw", "torque", "force", "angle", "length", "angle rate", "speed"),
}

_CHANNEL_OF = {alias: (channel, rank) for channel, row in ALIASES.items() for rank, alias in enumerate(row)}
_NUMBERED = (
    re.compile(r"(?P<alias>.*?[^\d_])_?(?P<index>\d+)$"),
    re.compile(r"(?:joint|axis|motor|servo|j|a|m)_?(?P<index>\d+)_(?P<alias>.+)$"),
    re.compile(r"(?P<alias>.+)_(?:joint|axis|motor|servo|j|a|m)_?(?P<index>\d+)$"),
)
_NO_JOINT = frozenset(
    _words(
        "desired measured actual target command commanded cmd ref reference state states raw filtered filt meas act des goal "
        "error sim model input output present previous last next set mean max min"
    )
)


@dataclass(frozen=True, kw_only=True)
class Guess:
    """Channels recognized by column names.

    Attributes:
        columns: channel to the columns that make it up, in joint order; one column may hold several joints.
        joints: joint names or numbers, in that order; empty where the file does not say.
        units: units that the names end with, by column.
        notes: what was left out for which reason.
        doubt: why no column was used, if the names are ambiguous.
    """

    columns: Mapping[str, tuple[str, ...]] = field(default_factory=dict[str, tuple[str, ...]])
    joints: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict[str, str])
    notes: tuple[str, ...] = ()
    doubt: str = ""


@dataclass(frozen=True)
class _Hit:
    column: str
    channel: str
    rank: int
    index: int | None
    unit: str


def guess(
    widths: Mapping[str, int],
    stated: Mapping[str, str],
    settled: Container[str] = (),
    names: Iterable[str] = (),
    called: Iterable[str] = (),
) -> Guess:
    """Guess channels from names.

    Args:
        widths: number of joints a column can hold, by column name; only columns of plausible length.
        stated: units that the file states, by column name.
        settled: channels that need no guess.
        names: joints that are kept where some joint lacks a channel.
        called: names that the file gives numbered joints.
    """
    held = frozenset(c for c in ALIASES if c in settled)
    return _guess(tuple(widths.items()), tuple(stated.items()), held, tuple(names), tuple(called))


@lru_cache(maxsize=16)
def _guess(
    each: tuple[tuple[str, int], ...],
    units_of: tuple[tuple[str, str], ...],
    settled: frozenset[str],
    wanted: tuple[str, ...],
    called: tuple[str, ...],
) -> Guess:
    """Return the result of `guess`, which is kept for the next log, since the logs of a robot have the same columns."""
    widths, stated = dict(each), dict(units_of)
    scopes, notes = _places(widths, stated, settled, _split_path)
    moving = _with_motion(scopes)
    if not moving:  # elbow_joint_pos, where nothing has a usual name
        labelled, labelled_notes = _places(widths, stated, settled, _split_joint)
        if _with_motion(labelled):
            scopes, notes = labelled, labelled_notes
            moving = _with_motion(scopes)
    shared_time = [h for h in scopes.get("", []) if h.channel == "time"]
    if "" in moving or len(moving) <= 1:
        scope = "" if "" in moving or not moving else next(iter(moving))
        hits = scopes.get(scope, [])
        if scope and not any(h.channel == "time" for h in hits):
            hits = [*hits, *(shared_time or _times(scopes, scope))]
        joints, columns = _gather(hits, widths, notes, wanted, called)
        moves = columns.get("position", columns.get("velocity", ()))
        if scope and not joints and hits[-1] in shared_time and len(moves) == 1 and widths[moves[0]] == 1:
            joints = (scope.rpartition("/")[2],)  # elbow.q, elbow.tau beside a time of all
        elsewhere = [
            h.column for place, others in scopes.items() if place != scope for h in others if h not in hits
        ]
        if elsewhere:
            notes.append(f"Not used, in other places of the file: {', '.join(elsewhere[:8])}.")
    else:
        names = [prefix.rpartition("/")[2] for prefix in moving]
        outer = {prefix.rpartition("/")[0] for prefix in moving}
        one_each = all(widths[h.column] == 1 and h.index is None for hits in moving.values() for h in hits)
        if (
            not one_each
            or len(outer) > 1
            or len(set(names)) < len(names)
            or _NO_JOINT & {n.lower() for n in names}
        ):
            places = ", ".join(f"'{prefix}'" for prefix in list(moving)[:10])
            time = {"time": (min(shared_time, key=lambda h: h.rank).column,)} if shared_time else {}
            return Guess(columns=time, doubt=f"several places hold positions or velocities: {places}")
        joints, columns = _join(moving, notes, wanted)
        times = shared_time or _times(scopes, next(iter(moving)))
        columns.update({"time": (min(times, key=lambda h: h.rank).column,)} if times else {})
    found = {h.column: h.unit for hits in scopes.values() for h in hits if h.unit}
    return Guess(columns=columns, joints=joints, units=found, notes=tuple(notes))


def _places(
    widths: Iterable[str],
    stated: Mapping[str, str],
    settled: Container[str],
    split: Callable[[str], tuple[str, str]],
) -> tuple[dict[str, list[_Hit]], list[str]]:
    """Return the columns by the prefix of their names, and the columns left out with the reasons."""
    scopes: dict[str, list[_Hit]] = {}
    notes: list[str] = []
    for column in widths:
        if len(column) > units.LONGEST:
            continue
        prefix, leaf = split(column)
        hit = _hit(column, leaf, stated.get(column, ""), settled, notes)
        if hit is not None:
            scopes.setdefault(prefix, []).append(hit)
    return scopes, notes


def _with_motion(scopes: Mapping[str, list[_Hit]]) -> dict[str, list[_Hit]]:
    moves = ("position", "velocity")
    return {place: hits for place, hits in scopes.items() if any(h.channel in moves for h in hits)}


def bare(name: str) -> str:
    """Return a name as it is compared: lower case, words joined by underscores."""
    name = re.sub(r"([a-z])([A-Z])", r"\1_\2", name)
    return re.sub(r"[^0-9a-z]+", "_", name.lower()).strip("_")


def _split_path(column: str) -> tuple[str, str]:
    """Split a dotted or slashed name into its place and its last part."""
    name = units.split(column)[0]
    if bare(name) in _CHANNEL_OF:  # such as LeRobot's observation.state
        return "", name
    head, dot, leaf = re.sub(r"\[\d+\]$", "", name).replace(".", "/").rpartition("/")
    number = re.search(r"\[\d+\]$", name)
    if not dot:
        return "", name
    return head.strip("/"), leaf + (number[0] if number else "")


def _split_joint(column: str) -> tuple[str, str]:
    """Split a name such as `shoulder_pan_joint_pos` into its joint and its channel; the joint's name is as long as can be."""
    place, leaf = _split_path(column)
    words = leaf.split("_")
    for at in range(len(words) - 1, 0, -1):
        joint, rest = "_".join(words[:at]), "_".join(words[at:])
        channel = _CHANNEL_OF.get(bare(units.split_suffix(rest)[0])) or _CHANNEL_OF.get(bare(rest))
        if not channel or channel[0] == "time" or len(rest) < 2:
            continue
        longer = "_".join(words[at - 1 :])
        if at > 1 and words[at - 1].lower() != "joint" and bare(longer) in _CHANNEL_OF:
            continue  # elbow_actual_position
        if _NO_JOINT & {word.lower() for word in words[:at]}:
            return place, leaf
        return "/".join(part for part in (place, joint) if part), rest
    return place, leaf


def _hit(column: str, leaf: str, unit: str, settled: Container[str], notes: list[str]) -> _Hit | None:
    shorter = units.split_suffix(leaf)  # tau_mNm as it stands, and tauDeg in words
    shorter = shorter if shorter[1] else units.split_suffix(bare(leaf))
    for name, ending in ((leaf, ""), shorter) if shorter[1] else ((leaf, ""),):
        known = _alias(bare(name))
        if known is None:
            continue
        channel, rank, index = known
        measured = units.parse(unit or ending) if (unit or ending) else None
        if measured is not None and measured.kind not in KINDS[channel]:
            if not ending and channel not in settled:
                notes.append(
                    f"'{column}' is in {unit}, so it was not taken as {channel}; give its factor, "
                    f'for example --map {"tau" if channel == "torque" else channel}=FACTOR*"{column}".'
                )
            continue
        return _Hit(column, channel, rank, index, ending if not unit else "")
    return None


def _alias(name: str) -> tuple[str, int, int | None] | None:
    if name in _CHANNEL_OF:
        return (*_CHANNEL_OF[name], None)
    for pattern in _NUMBERED:
        match = pattern.match(name)
        if match and match["alias"] in _CHANNEL_OF and len(match["index"]) <= 4:
            channel, rank = _CHANNEL_OF[match["alias"]]
            if channel != "time":
                return channel, rank, int(match["index"])
    return None


def _times(scopes: Mapping[str, list[_Hit]], scope: str) -> list[_Hit]:
    """Return time columns of the places around `scope`, nearest first."""
    while scope:
        scope = scope.rpartition("/")[0]
        found = [h for h in scopes.get(scope, []) if h.channel == "time"]
        if found:
            return found
    return []


def _gather(
    hits: list[_Hit],
    widths: Mapping[str, int],
    notes: list[str],
    wanted: Sequence[str],
    called: Sequence[str],
) -> tuple[tuple[str, ...], dict[str, Any]]:
    """Choose one name per channel; numbered columns are put in the order of their numbers."""
    columns: dict[str, tuple[str, ...]] = {}
    numbers: dict[str, tuple[int, ...]] = {}
    for channel in ALIASES:
        of_channel = [h for h in hits if h.channel == channel]
        if not of_channel:
            continue
        best = min(of_channel, key=lambda h: (h.rank, h.index is not None))
        if best.index is None:
            chosen = [best]
        else:
            by_number: dict[int, _Hit] = {}
            for hit in of_channel:
                if hit.rank == best.rank and hit.index is not None:
                    by_number.setdefault(hit.index, hit)
            chosen = [by_number[number] for number in sorted(by_number)]
            numbers[channel] = tuple(sorted(by_number))
        columns[channel] = tuple(h.column for h in chosen)
        others = [h.column for h in of_channel if h not in chosen]
        if others:
            notes.append(f"Also called {channel}, and not used: {', '.join(others[:8])}.")
    main = "position" if "position" in columns else "velocity"
    of_main = numbers.get(main, ())
    named = called if len(called) == len(of_main) else [f"joint_{number}" for number in of_main]
    label = dict(zip(of_main, named, strict=True))
    by_joint: dict[str, dict[str, str]] = {}
    for channel, found in numbers.items():
        if not label:
            break
        if set(found) <= set(label):
            by_joint[channel] = {label[n]: c for n, c in zip(found, columns[channel], strict=True)}
        else:
            notes.append(f"Columns of {channel} are numbered {found}, those of {main} {of_main}: left out.")
    joints, full = of_all(by_joint, tuple(label.values()), notes, wanted)
    return joints, {
        c: full.get(c, found) for c, found in columns.items() if c in full or c not in numbers or not label
    }


def _join(
    moving: Mapping[str, list[_Hit]], notes: list[str], wanted: Sequence[str]
) -> tuple[tuple[str, ...], dict[str, tuple[str, ...]]]:
    """Put the columns of joints that have a place each side by side, in the file's order."""
    by_joint: dict[str, dict[str, str]] = {}
    for channel in ALIASES:
        for place, hits in moving.items():
            best = min((h for h in hits if h.channel == channel), key=lambda h: h.rank, default=None)
            if best is not None:
                by_joint.setdefault(channel, {})[place.rpartition("/")[2]] = best.column
    return of_all(by_joint, tuple(place.rpartition("/")[2] for place in moving), notes, wanted)
