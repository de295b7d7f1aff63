"""How fast joint states come out of a ROS 2 bag: 60 s at 1 kHz, seven joints, beside rosbags' own reader.

    python benchmarks/bag_speed.py

Prints the time inside the reader, through the guarded process and as a whole `read_log`, and the ratio to rosbags
`AnyReader` in the same run; writes nothing.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent / "evidence"))
from _log_files import motion, write_db3, write_mcap

SECONDS, RATE, JOINTS = 60, 1000, 7


def _timed(what: Callable[[], object], repeats: int) -> float:
    times = []
    for _ in range(repeats):
        begun = time.perf_counter()
        what()
        times.append(time.perf_counter() - begun)
    return statistics.median(times)


def _with_rosbags(path: Path) -> np.ndarray:
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    rows = []
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as bag:
        for connection, _, raw in bag.messages(bag.connections):
            message = bag.deserialize(raw, connection.msgtype)
            rows.append(np.concatenate([message.position, message.velocity, message.effort]))
    return np.array(rows)


def main() -> int:
    """Print the table; return 1 if the two readers disagree."""
    from backdrive.logs.readers import read_log
    from backdrive.logs.readers._worker import parse
    from backdrive.logs.readers.columns import ReadOptions

    log = motion(SECONDS * RATE, JOINTS)
    with tempfile.TemporaryDirectory() as folder:
        equal = True
        for suffix, write, module in ((".mcap", write_mcap, "mcap"), (".db3", write_db3, "db3")):
            path = Path(folder) / f"bag{suffix}"
            write(path, log)
            read = read_log(path)
            inside = _timed(lambda path=path, module=module: parse(str(path), module, ReadOptions()), 5)
            whole = _timed(lambda path=path: read_log(path), 5)
            print(
                f"{suffix:6s} {path.stat().st_size / 1e6:6.1f} MB  decode {inside:.3f} s  read_log {whole:.3f} s"
            )
            if suffix == ".mcap":
                begun = time.perf_counter()
                reference = _with_rosbags(path)
                theirs = time.perf_counter() - begun
                print(
                    f"       rosbags AnyReader {theirs:.3f} s: {theirs / inside:.1f} times the decoding here"
                )
            parts = [read.channels[c] for c in ("position", "velocity", "torque")]
            equal &= bool(np.array_equal(np.concatenate(parts, axis=1), reference))
    print("the same numbers, bit for bit" if equal else "DIFFERENT NUMBERS")
    return 0 if equal else 1


if __name__ == "__main__":
    sys.exit(main())
