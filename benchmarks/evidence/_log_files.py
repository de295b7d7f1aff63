"""Small valid log files of every format, for the readers' tests and for the fuzz; written by other people's libraries."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

N, J = 40, 2
NAMES = ("shoulder", "elbow")


def motion(n: int = N, joints: int = J) -> dict[str, np.ndarray]:
    """Return a small log's channels: time (n,) and position, velocity, effort (n, J)."""
    time = 0.01 * np.arange(n)
    phase = np.outer(time, 1.0 + np.arange(joints))
    return {
        "time": time,
        "position": np.sin(phase),
        "velocity": np.cos(phase),
        "effort": np.sign(np.cos(phase)) + 0.5,
    }


def write_csv(path: Path, log: dict[str, np.ndarray], variant: int = 0) -> None:
    """Write a table: 0 plain, 1 with preamble, units and ';', 2 with decimal comma in UTF-16."""
    names = [f"{c}_{j}" for c in ("position", "velocity", "effort") for j in range(log["position"].shape[1])]
    table = np.column_stack([log["time"], log["position"], log["velocity"], log["effort"]])
    cut = (",", ";", ";")[variant]
    rows = [cut.join(f"{x:.6f}" for x in row) for row in table]
    head = [cut.join(["time", *names])]
    if variant == 1:
        units = ["s"] + ["deg"] * 2 + ["deg/s"] * 2 + ["Nm"] * 2
        head = ["Recorded by;a rig", "Period;0.01", *head, cut.join(units)]
    text = "\r\n".join([*head, *rows]) + "\r\n"
    path.write_bytes(text.replace(".", ",").encode("utf-16") if variant == 2 else text.encode())


def write_npz(path: Path, log: dict[str, np.ndarray], variant: int = 0) -> None:
    """Write an archive: 0 stored, 1 compressed, 2 with single precision, Fortran order and integers."""
    if variant == 2:
        log = {**log, "position": np.asfortranarray(log["position"]), "effort": log["effort"].astype("f4")}
        log["ticks"] = np.arange(len(log["time"]))
    (np.savez_compressed if variant == 1 else np.savez)(path, **log)


def write_parquet(path: Path, log: dict[str, np.ndarray], variant: int = 0) -> None:
    """Write a table: 0 plain columns, 1 lists, 2 single-precision lists and text."""
    import pyarrow as pa
    from pyarrow import parquet

    columns = {"time": pa.array(log["time"])}
    for name in ("position", "velocity", "effort"):
        for j in range(log[name].shape[1]) if variant == 0 else ():
            columns[f"{name}_{j}"] = pa.array(log[name][:, j])
        if variant:
            kind = pa.float64() if variant == 1 else pa.float32()
            columns[name] = pa.array(log[name].tolist(), pa.list_(kind))
    if variant == 2:
        columns["task"] = pa.array(["reach"] * len(log["time"]))
    parquet.write_table(pa.table(columns), path, compression="snappy" if variant != 1 else "none")


def write_mat(path: Path, log: dict[str, np.ndarray], variant: int = 0) -> None:
    """Write a version 5 file: 0 plain, 1 compressed, 2 a struct with text and a cell beside the numbers."""
    from scipy.io import savemat

    if variant == 2:
        cell = np.empty(2, object)
        cell[:] = ["a", np.arange(3.0)]
        savemat(path, {"rec": {**log, "robot": "two joints", "cell": cell}}, do_compression=True)
    else:
        savemat(path, log, do_compression=bool(variant), oned_as="column")


def write_hdf5(path: Path, log: dict[str, np.ndarray], variant: int = 0) -> None:
    """Write HDF5: 0 plain, 1 as MATLAB 7.3 does with a struct, 2 chunked and compressed."""
    import h5py

    with h5py.File(path, "w", userblock_size=512 if variant == 1 else 0) as file:
        place = file.create_group("rec") if variant == 1 else file
        for name, value in log.items():
            if variant == 1:
                data = place.create_dataset(name, data=np.atleast_2d(value) if value.ndim == 1 else value.T)
                data.attrs["MATLAB_class"] = np.bytes_("double")
            else:
                place.create_dataset(name, data=value, **({"compression": "gzip"} if variant == 2 else {}))
    if variant == 1:
        raw = bytearray(path.read_bytes())
        raw[:124] = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124)
        path.write_bytes(raw)


def write_json(path: Path, log: dict[str, np.ndarray], variant: int = 0) -> None:
    """Write JSON: 0 a list a channel, 1 one object a sample, 2 as BAM does."""
    if variant == 0:
        path.write_text(json.dumps({name: value.tolist() for name, value in log.items()}))
        return
    keys = {"time": "time", "position": "position", "velocity": "velocity", "effort": "torque"}
    if variant == 1:
        path.write_text(
            json.dumps(
                [{key: log[name][i].tolist() for name, key in keys.items()} for i in range(len(log["time"]))]
            )
        )
        return
    entries = [
        {"position": float(q), "speed": float(v), "load": int(100 * u) % 65536, "temp": 29, "timestamp": float(t),
         "goal_position": 0.0, "input_volts": 7.4, "torque_enable": True}
        for t, q, v, u in zip(log["time"], log["position"][:, 0], log["velocity"][:, 0], log["effort"][:, 0], strict=False)
    ]  # fmt: skip
    path.write_text(
        json.dumps({"mass": 0.5, "length": 0.1, "kp": 100, "vin": 7.4, "motor": "servo", "entries": entries})
    )


def messages(log: dict[str, np.ndarray], kind: str) -> Iterator[tuple[int, bytes]]:
    """Yield (time of recording [ns], bytes) of a `JointState` for every sample, serialised by rosbags."""
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if kind == "ros1" else Stores.ROS2_HUMBLE)
    state, header = store.types["sensor_msgs/msg/JointState"], store.types["std_msgs/msg/Header"]
    clock = store.types["builtin_interfaces/msg/Time"]
    names = [NAMES[j] if j < len(NAMES) else f"joint_{j + 1}" for j in range(log["position"].shape[1])]
    extra = {"seq": 7} if kind == "ros1" else {}
    for i, t in enumerate(log["time"]):
        ns = 1_700_000_000_000_000_000 + round(t * 1e9)
        stamp = header(**extra, stamp=clock(sec=ns // 10**9, nanosec=ns % 10**9), frame_id="base")
        message = state(
            header=stamp,
            name=names,
            position=log["position"][i],
            velocity=log["velocity"][i],
            effort=log["effort"][i],
        )
        serialise = store.serialize_ros1 if kind == "ros1" else store.serialize_cdr
        yield ns, bytes(serialise(message, "sensor_msgs/msg/JointState"))


def write_mcap(path: Path, log: dict[str, np.ndarray], variant: int = 0) -> None:
    """Write MCAP: 0 plain chunks without checksum, 1 zstd, 2 without chunks."""
    from mcap.writer import CompressionType, Writer
    from rosbags.typesys import Stores, get_typestore

    definition, _ = get_typestore(Stores.ROS2_HUMBLE).generate_msgdef(
        "sensor_msgs/msg/JointState", ros_version=2
    )
    with open(path, "wb") as stream:
        writer = Writer(
            stream,
            chunk_size=1500 if len(log["time"]) <= 1000 else 1 << 20,
            compression=CompressionType.ZSTD if variant == 1 else CompressionType.NONE,
            use_chunking=variant != 2,
            enable_crcs=variant == 1,
        )
        writer.start("ros2", "backdrive")
        schema = writer.register_schema("sensor_msgs/msg/JointState", "ros2msg", definition.encode())
        channel = writer.register_channel("/joint_states", "cdr", schema)
        for ns, raw in messages(log, "ros2"):
            writer.add_message(channel, ns, raw, ns)
        writer.finish()


def write_db3(path: Path, log: dict[str, np.ndarray], variant: int = 0) -> None:
    """Write a rosbag2 SQLite file, with the index that rosbag2 makes."""
    import sqlite3

    path.unlink(missing_ok=True)
    base = sqlite3.connect(path)
    base.execute(
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, "
        "serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL)"
    )
    base.execute(
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB NOT NULL)"
    )
    base.execute("CREATE INDEX timestamp_idx ON messages (timestamp ASC)")
    base.execute("INSERT INTO topics VALUES(1, '/joint_states', 'sensor_msgs/msg/JointState', 'cdr', '')")
    base.executemany(
        "INSERT INTO messages(topic_id, timestamp, data) VALUES(1, ?, ?)",
        messages(log, "ros2"),
    )
    base.commit()
    base.close()


def write_bag(path: Path, log: dict[str, np.ndarray], variant: int = 0) -> None:
    """Write a ROS 1 bag: 0 plain, 1 bz2, 2 lz4."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    path.unlink(missing_ok=True)
    writer = Writer(path)
    if variant:
        writer.set_compression(Writer.CompressionFormat.BZ2 if variant == 1 else Writer.CompressionFormat.LZ4)
    with writer:
        store = get_typestore(Stores.ROS1_NOETIC)
        connection = writer.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=store)
        for ns, raw in messages(log, "ros1"):
            writer.write(connection, ns, raw)


#: Reader -> (suffix, writer, number of variants).
WRITERS: dict[str, tuple[str, Callable[..., None], int]] = {
    "csv": (".csv", write_csv, 3),
    "npz": (".npz", write_npz, 3),
    "parquet": (".parquet", write_parquet, 3),
    "mat": (".mat", write_mat, 3),
    "hdf5": (".h5", write_hdf5, 3),
    "json": (".json", write_json, 3),
    "mcap": (".mcap", write_mcap, 3),
    "db3": (".db3", write_db3, 1),
    "bag": (".bag", write_bag, 3),
}
