"""Tables as they are found: one log of three joints, written in fourteen shapes, each with the command that reads it."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

JOINTS = ("shoulder_pan", "elbow", "wrist")
GEARS = (100.0, 80.0, 50.0)
COUNTS = 65536.0  # of the motor's encoder, a turn
COUPLING = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -0.5, 1.0]])  # q_joint = C q_motor
DEG = np.pi / 180.0
LATE = 3.7  # recording began so long before the plan [s]


class Data(NamedTuple):
    """What every table holds.

    Attributes:
        time: [s], (n,).
        position: [rad], (n, 3).
        torque: [N.m], (n, 3).
    """

    time: np.ndarray
    position: np.ndarray
    torque: np.ndarray


class Table(NamedTuple):
    """One shape of table.

    Attributes:
        name: for the report.
        write: writes it into a folder and returns the arguments of `backdrive identify`.
        names: joint names that the model must have; empty: any.
        swept: holds the sweep that was planned instead of the three joints.
    """

    name: str
    write: Callable[[Data, Path], list[str]]
    names: tuple[str, ...] = ()
    swept: bool = False


def text(path: Path, header: Sequence[str], *columns: np.ndarray, digits: int = 9) -> str:
    """Write a CSV and return its path; without a header no line of names."""
    rows = np.column_stack(columns)
    lines = [",".join(f"{x:.{digits}g}" for x in row) for row in rows]
    path.write_text("\n".join([*([",".join(header)] if header else []), *lines]) + "\n", encoding="utf-8")
    return str(path)


def _numbered(stem: str) -> list[str]:
    return [f"{stem}{i + 1}" for i in range(len(JOINTS))]


def _ranges(d: Data, at: Path) -> list[str]:
    header = ["clock", *_numbered("ang"), *_numbered("I")]
    file = text(at / "ranges.csv", header, d.time, d.position, d.torque / 2.5)
    return [file, "--map", "t=clock,q=ang1..ang3,tau=2.5*I1..I3"]


def _globs(d: Data, at: Path) -> list[str]:
    header = ["stamp", *(f"{j}_position" for j in JOINTS), *(f"{j}_moment" for j in JOINTS)]
    return [
        text(at / "globs.csv", header, d.time, d.position, d.torque),
        "--map",
        "t=stamp,q=*_position,tau=*_moment",
    ]


def _lists(d: Data, at: Path) -> list[str]:
    q, tau = d.position, d.torque
    angles = np.column_stack([q[:, 0] / DEG, -(q[:, 1] - 0.3) / DEG, 2.0 * q[:, 2]])
    currents = tau / (2.5, -1.2, 0.4)
    header = ["tick", "base", "arm", "hand", "ia", "ib", "ic"]
    file = text(at / "lists.csv", header, 1e3 * d.time, angles, currents)
    return [file, "--map", "t=tick/1000,q=deg*base,-deg*arm+0.3,hand/2,tau=(2.5,-1.2,0.4)*(ia,ib,ic)"]


def _headless(d: Data, at: Path) -> list[str]:
    file = text(at / "headless.csv", [], d.time, d.position, d.torque)
    return [file, "--map", "t=column_1,q=column_2..column_4,tau=column_5..column_7"]


def _joined(d: Data, at: Path) -> list[str]:
    later = d.time[3:-2] + 0.0017  # another clock tick
    torque = np.column_stack([np.interp(later, d.time, x) for x in d.torque.T])
    first = text(at / "positions.csv", ["time", *_numbered("q")], d.time, d.position)
    return [first, "--join", text(at / "torques.csv", ["time", *_numbered("tau")], later, torque)]


def _geared(d: Data, at: Path) -> list[str]:
    counts = np.round(d.position * GEARS * COUNTS / (2.0 * np.pi))
    header = ["time", *_numbered("enc"), *_numbered("tau")]
    file = text(at / "geared.csv", header, d.time, counts, d.torque / GEARS, digits=12)
    gear = ",".join(f"{g:g}" for g in GEARS)
    return [file, "--map", "q=turn/65536*enc1..enc3,tau=tau1..tau3", "--gear", gear, "--motor-side", "q,tau"]


def _coupled(d: Data, at: Path) -> list[str]:
    matrix = at / "coupling.csv"
    matrix.write_text("\n".join(",".join(f"{x:g}" for x in row) for row in COUPLING) + "\n", encoding="utf-8")
    motor, torque = d.position @ np.linalg.inv(COUPLING).T, d.torque @ COUPLING
    file = text(at / "coupled.csv", ["time", *_numbered("q"), *_numbered("tau")], d.time, motor, torque)
    return [file, "--coupling", str(matrix)]


def _planned(d: Data, at: Path) -> list[str]:
    file = text(at / "swept.csv", ["time", "q", "tau"], d.time + LATE, d.position[:, :1], d.torque[:, :1])
    return [file, "--plan", str(at / "plan.json"), "--start", "auto"]


def _suffixes(d: Data, at: Path) -> list[str]:
    header = ["timestamp", *(f"{j}_joint_pos" for j in JOINTS), *(f"{j}_joint_effort" for j in JOINTS)]
    return [text(at / "suffixes.csv", header, d.time, d.position, d.torque)]


def _named(d: Data, at: Path) -> list[str]:
    import pyarrow as pa
    from pyarrow import parquet

    columns = {
        "time": d.time,
        "name": [list(JOINTS)] * d.time.size,
        "position": d.position.tolist(),
        "effort": d.torque.tolist(),
    }
    parquet.write_table(pa.table(columns), at / "named.parquet")
    return [str(at / "named.parquet")]


def _lerobot(d: Data, at: Path, version: str) -> list[str]:
    """Write a folder in LeRobot's layout: two episodes of one motion, an action, named features."""
    import pyarrow as pa
    from pyarrow import parquet

    folder = at / f"lerobot_{version[:2]}"
    names = {
        "observation.state": [f"{j}.pos" for j in JOINTS],
        "observation.effort": [f"{j}.effort" for j in JOINTS],
    }
    names["action"] = names["observation.state"]
    features = {k: {"dtype": "float64", "shape": [len(v)], "names": v} for k, v in names.items()}
    features |= {k: {"dtype": "float32", "shape": [1], "names": None} for k in ("timestamp", "frame_index")}
    half = d.time.size // 2
    parts = []
    for k, rows in enumerate((slice(0, half), slice(half, None))):
        n = d.time[rows].size
        parts.append(
            pa.table(
                {
                    "observation.state": d.position[rows].tolist(),
                    "observation.effort": d.torque[rows].tolist(),
                    "action": d.position[rows].tolist(),
                    "timestamp": d.time[rows] - d.time[rows][0],
                    "frame_index": np.arange(n),
                    "episode_index": np.full(n, k),
                    "index": np.arange(n) + k * half,
                    "task_index": np.zeros(n, dtype=int),
                }
            )
        )
    data = folder / "data" / "chunk-000"
    data.mkdir(parents=True)
    (folder / "meta").mkdir()
    if version.startswith("v2"):
        path = "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet"
        for k, part in enumerate(parts):
            parquet.write_table(part, data / f"episode_{k:06d}.parquet")
    else:
        path = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
        parquet.write_table(pa.concat_tables(parts), data / "file-000.parquet")
    info = {"codebase_version": version, "robot_type": "so100", "fps": round(1.0 / (d.time[1] - d.time[0]))}
    info |= {"total_episodes": 2, "total_frames": d.time.size, "data_path": path, "features": features}
    (folder / "meta" / "info.json").write_text(json.dumps(info), encoding="utf-8")
    return [str(folder)]


def _plotjuggler(d: Data, at: Path) -> list[str]:
    header = ["__time"]
    header += [f"/joint_states/{j}/position" for j in JOINTS] + [f"/joint_states/{j}/effort" for j in JOINTS]
    return [text(at / "plotjuggler.csv", header, 1.7e9 + d.time, d.position, d.torque, digits=14)]


def _indexed(d: Data, at: Path) -> list[str]:
    header = ["Zeit [ms]", *(f"position[{i}]" for i in range(3)), *(f"effort[{i}]" for i in range(3))]
    file = text(at / "indexed.csv", header, 1e3 * d.time, d.position, d.torque)
    return [file, "--map", 't=0.001*"Zeit [ms]"']


TABLES = (
    Table("ranges of columns, a factor", _ranges),
    Table("globs, joints named by what they match", _globs, JOINTS),
    Table("lists, factors and offsets a joint, division", _lists),
    Table("ranges of columns without a header", _headless),
    Table("two files side by side by time", _joined),
    Table("motor side: gears for positions, counts", _geared),
    Table("coupled motors", _coupled),
    Table("plan recorded late", _planned, swept=True),
    Table("shoulder_pan_joint_pos", _suffixes, tuple(f"{j}_joint" for j in JOINTS)),
    Table("names inside the log (list columns)", _named, JOINTS),
    Table("LeRobot v2 folder", lambda d, at: _lerobot(d, at, "v2.1"), JOINTS),
    Table("LeRobot v3 folder", lambda d, at: _lerobot(d, at, "v3.0"), JOINTS),
    Table("PlotJuggler", _plotjuggler, JOINTS),
    Table('position[1], 0.001*"Zeit [ms]"', _indexed),
)
