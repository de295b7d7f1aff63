"""From the columns of a file to a `Log`: by `--map`, by the format's own channels, and by unambiguous names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np

from backdrive._arguments import NAMES, TABLE, WORD, check_arguments, either, optional
from backdrive.errors import InvalidInput, MappingError
from backdrive.logs.log import CHANNELS, WRENCH, Joint, Log, Source, channel_unit
from backdrive.logs.readers import _expression
from backdrive.logs.readers._automatic import automatic, length, name_list
from backdrive.logs.readers._channels import Values
from backdrive.logs.readers._clocks import on_one_clock
from backdrive.logs.readers._labels import SHOWN
from backdrive.logs.readers._missing import NONE
from backdrive.logs.readers._pairing import pair_joints
from backdrive.logs.readers._sides import divide_by_gear, motor_channels
from backdrive.logs.readers.columns import Columns, describe

_POSITIONS = ("position", "reference", "second_encoder")
_DEG = np.pi / 180


ARGUMENTS = {
    "map": optional(either("a string such as 't=time,q=pos', or a dict", WORD, TABLE)),
    "names": optional(NAMES),
    "units": optional(NAMES),
    "motor_side": optional(NAMES),
    "coupling_side": optional(WORD),
}


def to_log(  # noqa: PLR0913  (its options are given by keyword)
    columns: Columns,
    *,
    map: str | Mapping[str, str] | None = None,
    names: str | Sequence[str] | None = None,
    units: str | Sequence[str] | None = None,
    gear: float | Sequence[float] | None = None,
    counts: float | Sequence[float] | None = None,
    motor_side: str | Sequence[str] | None = None,
    coupling: Sequence[Sequence[float]] | None = None,
    coupling_side: str | None = None,
    sources: tuple[Source, ...] = (),
    owned: bool = False,
) -> Log:
    """Make a log of a file's columns.

    Args:
        columns: what the reader found.
        map: channel=sum, as `--map` has it; it overrides the automatic names of the channels it mentions.
        names: joint names. Where the file names its joints they choose and order them; otherwise they are given.
        units: `rad`, `m`, or `deg` (positions and velocities that state no unit are then degrees), for all or each.
        gear: motor turns per joint turn [1]; says that torque is of the motor side, and brings it to the joint.
        counts: encoder counts per rad or m at the joint [1/rad or 1/m].
        motor_side: which of `q`, `dq`, `qr` and `tau` the gear brings to the joint; None: `tau`.
        coupling: C of q_joint = C q_motor, after the gear (J, J); the torque goes by its inverse transpose.
        coupling_side: side that the channels are of, `motor` or `joint`; None: `motor`.
        sources: files the columns came from.
        owned: the columns are not used elsewhere: the log may keep their memory, and copied columns are emptied.

    Returns:
        The log in SI units; its notes say which column became which channel.

    Raises:
        MappingError: a column is unknown or does not fit; the message lists the columns.
        InvalidInput: names, units, gear, counts, motor side or coupling do not fit the joints.
    """
    check_arguments(ARGUMENTS, locals())
    on_motor = motor_channels(motor_side, gear)
    side = _side(coupling_side, coupling)
    asked = _expression.parse(map, columns.arrays) if map is not None else {}
    found = automatic(columns, asked, names)
    columns = on_one_clock(columns, asked, found.columns)
    if owned:
        for array in columns.arrays.values():
            array.setflags(write=False)
    values = Values(columns, found.units, length(columns, asked, found), owned)
    for channel, sums in asked.items():
        if sums is not None and channel != "wrench":
            values.add_sums(channel, sums)
    for channel, names_of in found.columns.items():
        if channel not in asked:
            values.add_columns(channel, names_of)
    wrench = _wrench(values, asked.get("wrench"))
    if not {"position", "velocity"} & set(values.arrays):
        doubt = (
            found.doubt
            or " ".join(values.notes).rstrip(".")
            or "no column has a name that means position or velocity"
        )
        raise MappingError(
            f"No position or velocity was found: {doubt}.",
            remedy=f"Name the columns with --map, for example t=..., q=... or dq=..., tau=... . Columns: {describe(columns)}.",
        )
    settled = tuple(f"{NONE}{channel}:" for channel in asked)
    own = pair_joints(values, asked, found)
    notes = [note for note in found.notes if not note.startswith(settled)]
    notes += [*values.notes, *_without_zeros(values.arrays, asked)]
    width = _width(values.arrays)
    if not own and not asked and len(columns.joints) not in (0, width):
        listed = ", ".join(columns.joints[:SHOWN]) + (", ..." if len(columns.joints) > SHOWN else "")
        notes.append(
            f"{len(columns.joints)} names of joints, {listed}, were left out: the columns are of {width}."
        )
    own = own or (columns.joints if len(columns.joints) == width else found.joints)
    kind = _kinds(units, width)
    if kind is None:
        kind = ["m" if values.kind in ("length", "speed") else "rad"] * width
    notes += _from_degrees(values, kind, asked)
    labels, order = _labels(names, own, width)
    ratios, encoder = _each(gear, len(order), "gear"), _each(counts, len(order), "counts")
    joints = tuple(
        Joint(
            name=labels[i],
            unit="m" if kind[column] == "m" else "rad",
            torque_side="joint" if ratios is None or "torque" not in on_motor else "motor",
            gear_ratio=1.0 if ratios is None else ratios[i],
            encoder_counts=None if encoder is None else encoder[i],
            named=names is not None or labels[i] in own,
        )
        for i, column in enumerate(order)
    )
    notes += _without_unit(values, joints, columns)
    if "torque" not in values.arrays:
        notes = _without_torque(notes, width, columns)
    whole = order == list(range(width))
    channels: dict[str, Any] = {
        c: v if whole else v[:, order] for c, v in values.arrays.items() if c != "time"
    }
    log = Log(
        time=values.arrays["time"][:, 0],
        joints=joints,
        drive=columns.drive if "drive_input" in channels else None,
        sources=sources,
        wrench=wrench,
        notes=(*columns.notes, "Channels: " + "; ".join(values.said) + ".", *notes),
        **channels,
    )
    if motor_side is not None:
        log = divide_by_gear(log, on_motor)
    log = log.on_joint_side()
    return log if coupling is None else log.apply_coupling(coupling, side)


def _wrench(values: Values, sums: Any) -> np.ndarray | None:
    """Return the wrench that a `--map` names, (n, 6); None without one.

    Raises:
        MappingError: it is not six columns.
    """
    if sums is None:
        return None
    values.add_sums("wrench", sums)
    values.labels.pop("wrench", None)
    wrench = values.arrays.pop("wrench")
    if wrench.shape[1] != WRENCH:
        raise MappingError(
            f"--map wrench: {wrench.shape[1]} columns.",
            remedy="Name six: forces along x, y, z, then moments, as in wrench=(fx,fy,fz,mx,my,mz).",
        )
    return wrench


def _side(side: str | None, coupling: object) -> Literal["motor", "joint"]:
    """Return the side of a coupling that the channels are of.

    Raises:
        InvalidInput: it is no side, or there is no coupling.
    """
    if side is not None and coupling is None:
        raise InvalidInput("A side of a coupling, and no coupling.", remedy="Give its matrix (--coupling).")
    if side not in (None, "motor", "joint"):
        raise InvalidInput(f"The coupling's side is '{side}'.", remedy="It is motor or joint.")
    return "joint" if side == "joint" else "motor"


def _width(arrays: Mapping[str, np.ndarray]) -> int:
    widths = {channel: value.shape[1] for channel, value in arrays.items() if channel != "time"}
    if len(set(widths.values())) > 1:
        raise MappingError(
            f"The channels have different numbers of joints: {widths}.",
            remedy="Choose columns with [i] or [i:j].",
        )
    return next(iter(widths.values()))


def _without_zeros(arrays: dict[str, np.ndarray], asked: Mapping[str, Any]) -> list[str]:
    """Drop velocity, torque and temperature that are zero throughout: drivers write zeros for quantities that they do not
    measure.
    """
    notes: list[str] = []
    moves = "position" in arrays and np.ptp(arrays["position"], axis=0).max(initial=0.0) > 0
    for channel in ("velocity", "torque", "external_torque", "temperature"):
        if channel in arrays and channel not in asked and not arrays[channel].any():
            if channel == "velocity" and not moves:
                continue
            del arrays[channel]
            notes.append(f"The {channel} is exactly zero throughout: taken as not measured.")
    return notes


def _kinds(units: str | Sequence[str] | None, width: int) -> list[str] | None:
    if units is None:
        return None
    each = units.split(",") if isinstance(units, str) else list(units)
    each = [str(unit).strip() for unit in each]
    each = each * width if len(each) == 1 else each
    if len(each) != width or not set(each) <= {"rad", "m", "deg"}:
        raise InvalidInput(
            f"The units {units!r} do not fit {width} joints.", remedy="Give rad, m or deg, once or for each."
        )
    return each


def _from_degrees(values: Values, kinds: list[str], asked: Mapping[str, Any]) -> list[str]:
    """Convert positions and velocities that state no unit, for the joints that the person says are in degrees."""
    turned = np.array([kind == "deg" for kind in kinds])
    done: list[str] = []
    for channel in (*_POSITIONS, "velocity"):
        if (
            turned.any()
            and channel in values.arrays
            and channel not in values.settled
            and channel not in asked
        ):
            values.arrays[channel] = values.arrays[channel] * np.where(turned, _DEG, 1.0)
            done.append(channel)
    return [f"Converted from degrees, as asked: {', '.join(done)}."] if done else []


def _without_unit(values: Values, joints: tuple[Joint, ...], columns: Columns) -> list[str]:
    """Return a note on the assumed unit of channels without a stated unit."""
    silent = [c for c in CHANNELS if c in values.arrays and c not in values.settled and c != "drive_input"]
    if (
        columns.channels
    ):  # a joint state's own definition says rad and m, but drivers differ in what effort is
        silent = [c for c in silent if c == "torque"]
    if not silent:
        return []
    told = ", ".join(f"{channel} in {channel_unit(channel, joints[0])}" for channel in silent)
    current = " Some drivers publish motor current as torque or effort." if "torque" in silent else ""
    return [f"No unit is stated, so SI is taken: {told}.{current}"]


def _without_torque(notes: list[str], width: int, columns: Columns) -> list[str]:
    """Return notes with one on how to name a torque, and the columns that there are."""
    said = next((note for note in notes if note.startswith(f"{NONE}torque")), "")
    option = "one with --map tau=COLUMN" if width == 1 else f"{width} with --map tau=COLUMN,COLUMN..."
    told = said or f"{NONE}torque: name {option}, times a factor where it is a current or a duty."
    return [*(note for note in notes if note != said), f"{told} Columns: {describe(columns)}."]


def _labels(names: str | Sequence[str] | None, own: Sequence[str], width: int) -> tuple[list[str], list[int]]:
    """Return joint names and the columns they stand for."""
    own = list(own) if len(own) == width else []
    if names is None:
        return own or [f"joint_{i + 1}" for i in range(width)], list(range(width))
    wanted = name_list(names)
    if own and set(wanted) <= set(own):
        return wanted, [own.index(name) for name in wanted]
    if len(wanted) != width:
        known = f" The file names {', '.join(own)}." if own else ""
        raise InvalidInput(
            f"{len(wanted)} names ({', '.join(wanted)}) for {width} joints.",
            remedy=f"Give one name a joint.{known}",
        )
    return wanted, list(range(width))


def _each(value: float | Sequence[float] | None, width: int, what: str) -> list[float] | None:
    if value is None:
        return None
    try:
        each = np.atleast_1d(np.asarray(value, dtype=float))
    except (TypeError, ValueError):
        each = np.empty(0)
    each = np.repeat(each, width) if each.size == 1 else each
    if each.shape != (width,) or not np.isfinite(each).all() or (each == 0).any():
        raise InvalidInput(
            f"{what} {value!r} does not fit {width} joints.", remedy="Give one number other than 0 a joint."
        )
    for number in each:
        if not 1e-15 <= abs(number) <= 1e15:
            raise InvalidInput(
                f"{what} {number:g} is implausible.", remedy="Give a number from 1e-15 to 1e15."
            )
    return [float(number) for number in each]
