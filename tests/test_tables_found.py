"""Tables as they are found: files side by side, names inside the log, LeRobot folders, hostile ones among them."""

import json

import numpy as np
import pytest

from backdrive import Log, read_log, read_logs
from backdrive.errors import FileTooLarge, MappingError, ReadError
from backdrive.logs.readers.limits import Limits

T = np.arange(60) * 0.01
Q = np.sin(T)


def table(path, header, *columns):
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="", fmt="%.16g")
    return path


def read(path, **options):
    return read_log(path, guarded=False, **options)


# ---------------------------------------------------------------------------------------- side by side


def test_columns_of_another_file_come_onto_the_first_clock(tmp_path):
    first = table(tmp_path / "q.csv", "time,q", T + 1.7e9, Q)
    late = T[5:-7] + 0.003
    log = read(
        first, join=table(tmp_path / "tau.csv", "time [ms],tau,q", 1e3 * (late + 1.7e9), 3.0 * late, late)
    )
    assert np.allclose(log.torque[:, 0], 3.0 * (log.time - 1.7e9), atol=1e-5)
    assert np.allclose(log.position[:, 0], np.sin(log.time - 1.7e9), atol=1e-6)
    assert len(log) == 47 and len(log.sources) == 2
    assert any("13 samples before, after or in a gap" in note for note in log.notes)


def test_date_times_keep_their_day_when_joined(tmp_path):
    def stamps(day, seconds):
        return [f"2024-05-{day}T10:00:{s:06.3f}" for s in seconds]

    def write(name, header, clock, values):
        rows = "\n".join(f"{c},{v:.9g}" for c, v in zip(clock, values, strict=True))
        (tmp_path / name).write_text(f"{header}\n{rows}\n")
        return tmp_path / name

    first = write("q.csv", "time,q", stamps("02", T), Q)
    log = read(first, join=write("tau.csv", "time,tau", stamps("02", T + 0.1), T))
    assert np.allclose(log.torque[:, 0], log.time - 0.1, atol=1e-6)
    with pytest.raises(MappingError, match=r"other\.csv does not overlap"):
        read(first, join=write("other.csv", "time,tau", stamps("03", T), T))


def test_joins_that_do_not_fit(tmp_path):
    first = table(tmp_path / "q.csv", "time,q", T, Q)
    far = table(tmp_path / "far.csv", "time,tau", T + 100.0, T)
    with pytest.raises(MappingError, match=r"far\.csv does not overlap .*100 to 100.59 s, and 0 to 0.59 s"):
        read(first, join=far)
    with pytest.raises(MappingError, match=r"nameless\.csv: No column has a name that means time"):
        read(first, join=table(tmp_path / "nameless.csv", "x,tau", T, T))
    with pytest.raises(ReadError, match="does not exist"):
        read(first, join=tmp_path / "absent.csv")
    with pytest.raises(ReadError, match="2 logs and a file to join"):
        read_logs([first, far], join=[far])
    hole = table(tmp_path / "hole.csv", "time,tau", np.delete(T, slice(20, 40)), np.delete(T, slice(20, 40)))
    assert len(read(first, join=hole)) == 40


def bare(path, *columns):
    np.savetxt(path, np.column_stack(columns), delimiter=",", fmt="%.16g")
    return path


@pytest.mark.parametrize(
    "map", ["tau=column_2", "t=column_1,tau=column_2", {"t": "column_1", "tau": "column_2"}]
)
def test_a_file_without_a_header_beside_one_with_a_header(tmp_path, map):
    first = table(tmp_path / "q.csv", "time,q", T, Q)
    log = read(first, join=bare(tmp_path / "tau.csv", T + 0.003, 2.0 * T), map=map)
    assert np.allclose(log.torque[:, 0], 2.0 * (log.time - 0.003), atol=1e-9) and log.names == ("joint_1",)
    guessed = [
        n for n in log.notes if "has no header: its first column increases, and was taken as the time" in n
    ]
    assert len(guessed) == (map == "tau=column_2")


def test_a_file_with_a_header_beside_one_without(tmp_path):
    first = bare(tmp_path / "q.csv", T, Q)
    log = read(first, join=table(tmp_path / "tau.csv", "time,tau", T, 3.0 * T), map="t=column_1,q=column_2")
    assert np.allclose(log.torque[:, 0], 3.0 * log.time)
    both = read(
        first, join=bare(tmp_path / "i.csv", T, 3.0 * T), map="t=column_1,q=column_2,tau=2*i/column_2"
    )
    assert np.allclose(both.torque[:, 0], 6.0 * both.time)


def test_a_time_in_ms_beside_one_in_seconds_is_refused(tmp_path):
    t = np.arange(2000) / 100.0
    first = table(tmp_path / "q.csv", "time,q", t, np.sin(t))
    other = table(tmp_path / "tau.csv", "time,tau", 1e3 * t, t)
    with pytest.raises(
        MappingError,
        match=r"tau\.csv and the first file have .* different units: 0 to 19990 s, and 0 to 19\.99 s",
    ):
        read(first, join=other)
    short = table(tmp_path / "short.csv", "time,tau", t[:200], t[:200])  # a part of one clock is no mistake
    assert len(read(first, join=short)) == 200
    assert len(read(short, join=first)) == 200


def test_each_of_two_files_has_a_time_of_its_own(tmp_path):
    first = table(tmp_path / "q.csv", "tick,q", 1e3 * T, Q)
    other = table(tmp_path / "tau.csv", "when,tau", 1e6 * (T + 0.003), 3.0 * T)
    for map in ("t=0.001*tick,t=1e-6*when,tau=tau", "t=1e-6*when, q=q, t=0.001*tick"):
        log = read(first, join=other, map=map)
        assert np.allclose(log.torque[:, 0], 3.0 * (log.time - 0.003), atol=1e-9)
        assert np.allclose(log.position[:, 0], np.sin(log.time), atol=1e-6) and len(log) == 59
    with pytest.raises(
        MappingError, match=r"t=tack.*: it is the time of no file.*tick 60, q 60; when 60, tau 60"
    ):
        read(first, join=other, map="t=tack,t=1e-6*when")
    with pytest.raises(MappingError, match=r"'time' twice.*join"):
        read(first, map="t=tick,t=q")


def test_a_time_that_only_the_second_file_names(tmp_path):
    first = table(tmp_path / "q.csv", "time,q", T, Q)
    log = read(first, join=table(tmp_path / "i.csv", "tick,tau", 1e3 * T, 3.0 * T), map="t=0.001*Tick")
    assert np.allclose(log.torque[:, 0], 3.0 * log.time)
    with pytest.raises(MappingError, match=r"still\.csv: No column has a name that means time"):
        read(first, join=bare(tmp_path / "still.csv", Q - Q, T), map="tau=column_2")


# -------------------------------------------------------------------------------- names inside the log


def test_names_beside_numbers(tmp_path):
    rows = "\n".join(f"{t:.2f},hip,knee,{t},{2 * t},{t},{t}" for t in T)
    (tmp_path / "n.csv").write_text(
        f"time,name[0],name[1],position[0],position[1],effort[0],effort[1]\n{rows}\n"
    )
    assert read(tmp_path / "n.csv").names == ("hip", "knee")
    swapped = [
        {"time": t, "name": ["a", "b"][:: 1 - 2 * (i % 2)], "position": [1.0, 2.0][:: 1 - 2 * (i % 2)]}
        for i, t in enumerate(T)
    ]
    (tmp_path / "n.json").write_text(json.dumps(swapped))
    log = read(tmp_path / "n.json")
    assert log.names == ("a", "b") and log.position[1].tolist() == [1.0, 2.0]
    swapped[3]["name"] = ["a", "c"]
    (tmp_path / "n.json").write_text(json.dumps(swapped))
    with pytest.raises(ReadError, match="Row 4 of 'name': a, c, but first a, b"):
        read(tmp_path / "n.json")


def test_joints_that_stand_before_their_channel(tmp_path):
    header = "timestamp,shoulder_pan_joint_pos_deg,elbow_joint_pos_deg,shoulder_pan_joint_effort,elbow_joint_effort"
    log = read(table(tmp_path / "s.csv", header, T, Q, Q, Q, Q))
    assert log.names == ("shoulder_pan_joint", "elbow_joint")
    assert np.allclose(log.position[:, 0], np.deg2rad(Q), atol=1e-9)
    with pytest.raises(MappingError, match="No position or velocity was found"):
        read(table(tmp_path / "w.csv", "t,target_pos,present_pos", T, Q, Q))
    assert read(table(tmp_path / "i.csv", "t,position[0],position[1]", T, Q, Q)).names == (
        "joint_0",
        "joint_1",
    )
    assert read(table(tmp_path / "p.csv", "t,position(1),position(2)", T, Q, Q)).names == (
        "joint_1",
        "joint_2",
    )


# ---------------------------------------------------------------------------------------------- LeRobot


def lerobot(folder, info=None, names=("pan.pos", "lift.pos"), **columns):
    pa, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    (folder / "meta").mkdir(parents=True)
    (folder / "data" / "chunk-000").mkdir(parents=True)
    state = np.column_stack([Q, 2 * Q])
    content = {
        "observation.state": state.tolist(),
        "action": state.tolist(),
        "timestamp": np.r_[T[:30], T[:30]],
        "episode_index": np.repeat([0, 1], 30),
        "frame_index": np.r_[np.arange(30), np.arange(30)],
        **columns,
    }
    content = {key: value for key, value in content.items() if value is not None}
    parquet.write_table(pa.table(content), folder / "data" / "chunk-000" / "file-000.parquet")
    features = {key: {"dtype": "float32", "names": list(names)} for key in ("observation.state", "action")}
    info = {"codebase_version": "v3.0", "fps": 100, "features": features} if info is None else info
    (folder / "meta" / "info.json").write_text(info if isinstance(info, str) else json.dumps(info))
    return folder


def test_episodes_stand_one_after_the_other(tmp_path):
    log = read_log(lerobot(tmp_path / "set"))
    assert log.names == ("pan", "lift") and len(log) == 60
    assert np.allclose(np.diff(log.time)[:29], 0.01) and np.diff(log.time)[29] == pytest.approx(1.0)
    assert np.array_equal(log.reference, log.position)
    assert [len(log) for log in read_logs(tmp_path)] == [60]
    assert np.allclose(read(lerobot(tmp_path / "clockless", timestamp=None)).time, log.time)
    one = read(lerobot(tmp_path / "bare", names=()))
    assert one.names == ("joint_1", "joint_2")


HOSTILE = [
    ("{", "is not JSON"),
    ("[]", "no JSON object"),
    ("[" * 100_000, "nests|not JSON|deep"),
    ('{"features": 3}', "names no features"),
    ("{}" + " " * (1 << 23), "larger|more than"),
]


@pytest.mark.parametrize(("info", "match"), HOSTILE)
def test_a_hostile_description_is_refused(tmp_path, info, match):
    with pytest.raises(ReadError, match=match):
        read_log(lerobot(tmp_path / "set", info=info))


def test_paths_and_counts_of_a_description_are_not_followed(tmp_path):
    features = {"observation.state": {"names": {"motors": ["a", "b"]}}, "action": {"names": ["x"] * 9}}
    info = {
        "features": features,
        "data_path": "../../../etc/{x.__class__}",
        "total_frames": 10**18,
        "fps": -1,
    }
    log = read_log(lerobot(tmp_path / "set", info=info))
    assert log.names == ("a", "b")
    assert any("speaks of 1000000000000000000 frames, the files hold 60" in note for note in log.notes)
    with pytest.raises(ReadError, match="fps is -1"):
        read_log(lerobot(tmp_path / "clockless", info=info, timestamp=None))


def test_folders_that_lack_or_hold_too_much(tmp_path):
    folder = lerobot(tmp_path / "set")
    with pytest.raises(FileTooLarge, match="more than the limit"):
        read(folder, limits=Limits(max_bytes=2000))
    second = folder / "data" / "chunk-000" / "file-001.parquet"
    import pyarrow as pa
    from pyarrow import parquet

    parquet.write_table(pa.table({"other": T}), second)
    with pytest.raises(ReadError, match=r"chunk-000/file-001\.parquet holds other columns"):
        read(folder)
    second.write_bytes(b"PAR1 nothing")
    with pytest.raises(ReadError, match=r"file-001\.parquet"):
        read_log(folder)
    for file in folder.glob("data/*/*"):
        file.unlink()
    with pytest.raises(ReadError, match="no Parquet files"):
        read(folder)


ORDERS = [("arm", "elbow"), ("elbow", "arm")]
NUMBERS = {"arm": 1.0, "elbow": 2.0}


def test_names_in_a_frame_match_rows_whose_order_changes():
    rows = [ORDERS[k % 2] for k in range(8)]
    log = Log.from_frame(
        {
            "time": np.arange(8.0),
            "name": np.array([*rows, None], dtype=object)[:-1],
            "position": np.array([[NUMBERS[name] for name in row] for row in rows]),
        }
    )
    assert log.names == ("arm", "elbow") and (log.position == [1.0, 2.0]).all()


def test_names_in_columns_match_rows_whose_order_changes(tmp_path):
    lines = ["time,name[0],name[1],position[0],position[1]"]
    lines += [
        f"{k},{','.join(ORDERS[k % 2])},{','.join(str(NUMBERS[name]) for name in ORDERS[k % 2])}"
        for k in range(8)
    ]
    (tmp_path / "a.csv").write_text("\n".join(lines) + "\n")
    log = read_log(tmp_path / "a.csv")
    assert log.names == ("arm", "elbow") and (log.position == [1.0, 2.0]).all()
    assert any("matched by name" in note for note in log.notes)
    lines[4] = lines[4].replace("elbow", "wrist")
    (tmp_path / "a.csv").write_text("\n".join(lines) + "\n")
    with pytest.raises(ReadError, match="Row 4"):
        read_log(tmp_path / "a.csv")
