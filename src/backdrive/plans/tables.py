"""A plan as tables: samples, CSV, NPZ and a ROS 2 JointTrajectory."""

from __future__ import annotations

import csv
import io
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.plans.arm import ArmPlan
from backdrive.plans.in_turn import InTurn

MOST_NUMBERS = 50_000_000
_SHORT = {"position": "q", "velocity": "dq", "acceleration": "ddq", "torque": "tau"}


@dataclass(frozen=True, kw_only=True, eq=False)
class Table:
    """A plan, sampled.

    Attributes:
        time: since the plan's start, uniform, until it rests [s], (n,).
        joints: names, (J,).
        units: `rad` or `m`, (J,).
        channels: `position`, `velocity` and `acceleration`, or `torque`, each (n, J).
    """

    time: np.ndarray
    joints: tuple[str, ...]
    units: tuple[str, ...]
    channels: dict[str, np.ndarray]


def sample(plan: Any, rate: float) -> Table:
    """Sample a plan from its start until it rests.

    Args:
        plan: of one joint or of several in turn.
        rate: samples per second [Hz].

    Raises:
        InvalidInput: the rate is not positive, or the table would be enormous.
    """
    if not (math.isfinite(rate) and rate > 0):
        raise InvalidInput(f"The rate is {rate!r} Hz.", remedy="Give a finite number above zero.")
    several = isinstance(plan, (ArmPlan, InTurn))
    joints = plan.joints if several else (plan.joint,)
    units = plan.units if several else (plan.unit,)
    names = ("position", "velocity", "acceleration") if plan.commands == "position" else ("torque",)
    count = math.ceil(plan.duration * rate - 1e-6) + 1
    if count * len(names) * len(joints) > MOST_NUMBERS:
        raise InvalidInput(
            f"{plan.duration:.4g} s at {rate:g} Hz are {count} samples for {len(joints)} joints.",
            remedy="Give a lower rate, or a shorter plan.",
        )
    time = np.arange(count) / rate
    channels = {n: getattr(plan, n)(plan.start + time).reshape(count, len(joints)) for n in names}
    return Table(time=time, joints=joints, units=units, channels=channels)


def csv_text(table: Table) -> str:
    """Return a table as CSV: `time`, then `JOINT.q`, `JOINT.dq` and `JOINT.ddq`, or `JOINT.tau`, in SI units."""
    stream = io.StringIO()
    header = [f"{joint}.{_SHORT[name]}" for joint in table.joints for name in table.channels]
    csv.writer(stream, lineterminator="\n").writerow(["time", *header])
    columns = np.stack(list(table.channels.values()), axis=2).reshape(table.time.size, -1)  # joint by joint
    row = ",".join(["%.12g"] * (1 + columns.shape[1])) + "\n"
    stream.writelines(
        row % tuple(line) for line in np.column_stack([table.time, _round_clean(columns)]).tolist()
    )
    return stream.getvalue()


def npz_bytes(table: Table) -> bytes:
    """Return a table as NPZ: `time` (n,), the channels (n, J), `joints` and `units` (J,)."""
    stream = io.BytesIO()
    arrays: dict[str, Any] = {"time": table.time, **table.channels}
    arrays |= {"joints": np.array(table.joints), "units": np.array(table.units)}
    np.savez_compressed(stream, **arrays)
    return stream.getvalue()


def trajectory_yaml(table: Table) -> str:
    """Return a table as a ROS 2 `trajectory_msgs/msg/JointTrajectory` in YAML.

    Every number is written with a point and, where it has one, a signed exponent: YAML 1.1 readers parse 1e-5 as text.
    """
    fields = {
        "position": "positions",
        "velocity": "velocities",
        "acceleration": "accelerations",
        "torque": "effort",
    }
    lines = [
        "# trajectory_msgs/msg/JointTrajectory",
        "header:",
        "  stamp: {sec: 0, nanosec: 0}",
        "  frame_id: ''",
        "joint_names:",
        *("- '" + name.replace("'", "''") + "'" for name in table.joints),
        "points:",
    ]
    columns = [(fields[name], _round_clean(value).tolist()) for name, value in table.channels.items()]
    for i, t in enumerate(table.time.tolist()):
        sec, nanosec = divmod(round(t * 1e9), 1_000_000_000)
        mark = "- "
        for name, rows in columns:
            lines.append(f"{mark}{name}: [{', '.join(map(yaml_number, rows[i]))}]")
            mark = "  "
        lines.append(f"  time_from_start: {{sec: {sec}, nanosec: {nanosec}}}")
    return "\n".join(lines) + "\n"


def _round_clean(value: np.ndarray) -> np.ndarray:
    """Return values to 1e-12, without rounding noise around zero and without negative zeros."""
    return np.round(value, 12) + 0.0


def yaml_number(x: float) -> str:
    """Return a finite float in a form that every YAML reader parses as a float."""
    mantissa, e, exponent = repr(float(x)).partition("e")
    if "." not in mantissa:
        mantissa += ".0"
    if not e:
        return mantissa
    return f"{mantissa}e{exponent if exponent[0] in '+-' else '+' + exponent}"
