"""The logs of a fleet: which ones are listed, under which names, and what becomes of those that cannot be read."""

import os
from datetime import date

import pytest

from backdrive.errors import InvalidInput
from backdrive.fleet import manifests
from backdrive.fleet.entries import LogEntry, printable
from backdrive.fleet.sources import list_logs
from backdrive.fleet.work import do_log, failure


@pytest.fixture
def logs(tmp_path):
    folder = tmp_path / "logs"
    for robot in ("a", "b"):
        (folder / robot).mkdir(parents=True)
        (folder / robot / "2026-01-05.npz").write_bytes(robot.encode())
    return folder


def test_relative_paths_are_made_absolute(logs, monkeypatch):
    monkeypatch.chdir(logs.parent)
    assert list_logs("logs") == list_logs(logs)
    assert list_logs("logs/*/*.npz") == list_logs(logs)
    assert all(os.path.isabs(entry.path) for entry in list_logs("logs"))
    (logs.parent / "m.csv").write_text("path\nlogs/a/2026-01-05.npz\n")
    assert list_logs("m.csv")[0].path == list_logs(logs)[0].path


def test_a_manifest_with_missing_files_and_days_that_are_none(logs, tmp_path):
    manifest = tmp_path / "m.csv"
    manifest.write_text(
        "path,robot,day\nlogs/a/2026-01-05.npz,a,2026-01-05\nlogs/none.npz,a,\nlogs/b/2026-01-05.npz,b,soon\n"
    )
    good, wrong, missing = list_logs(manifest)
    assert (good.robot, good.fault) == ("a", "")
    assert f"{manifest}, line 3: Cannot read" in missing.fault
    assert f"{manifest}, line 4: The day 'soon' is no date" in wrong.fault
    (row,) = do_log(missing, {})
    assert (row["failure"], row["robot"]) == ("ReadError", "a")
    assert f"{manifest}, line 3" in row["message"]
    assert not {"fault", "file"} & set(row)


@pytest.mark.parametrize("head", ["Path,Robot", "robot,path", "path;robot", '"PATH";"robot"'])
def test_headers_of_manifests_in_any_case_and_order(logs, tmp_path, head):
    cells = {"path": str(logs / "a" / "2026-01-05.npz"), "robot": "r7"}
    sign = ";" if ";" in head else ","
    names = [name.strip('"').lower() for name in head.split(sign)]
    (tmp_path / "m.csv").write_text(f"{head}\n{sign.join(cells[name] for name in names)}\n")
    assert manifests.is_manifest(str(tmp_path / "m.csv"))
    (entry,) = list_logs(tmp_path / "m.csv")
    assert entry.robot == "r7"


def test_one_robots_folder_gives_its_name(logs):
    assert [entry.robot for entry in list_logs(logs / "a")] == ["a"]
    assert [entry.robot for entry in list_logs(f"{logs}/a/*.npz")] == ["a"]
    day = logs / "2026-01-06"
    day.mkdir()
    (day / "c_2026-01-06.npz").write_bytes(b"c")
    assert [entry.robot for entry in list_logs(logs)] == ["c", "a", "b"]


def test_names_that_are_not_utf8_are_escaped(logs):
    place = os.fsencode(logs) + b"/caf\xe9"
    os.mkdir(place)
    with open(place + b"/2026-01-07.npz", "wb") as stream:
        stream.write(b"no log")
    entry = next(one for one in list_logs(logs) if "caf" in one.robot)
    assert entry.robot == "caf\\xe9"
    assert entry.path.encode().endswith(b"caf\\xe9/2026-01-07.npz")
    assert os.path.exists(entry.place)
    row = failure(entry, "ReadError", f"Cannot read {entry.place}.")
    assert row["message"] == "Cannot read 2026-01-07.npz."
    assert [value.encode() for value in row.values() if isinstance(value, str)]
    assert printable("\ud800") == "\\ud800"


def test_a_folder_that_cannot_be_read_is_told(logs, monkeypatch):
    scandir = os.scandir

    def refuse(place):
        if str(place).endswith("/b"):
            raise PermissionError(13, "Permission denied", str(place))
        return scandir(place)

    monkeypatch.setattr(os, "scandir", refuse)
    remarks = []
    assert [entry.robot for entry in list_logs(logs, remarks=remarks)] == ["a"]
    assert remarks == [f"The folder {logs}/b cannot be read (Permission denied): its logs are left out."]


def test_a_broken_link_is_a_failure(logs):
    (logs / "b" / "2026-03-01.npz").symlink_to(logs / "nowhere.npz")
    (broken,) = [entry for entry in list_logs(logs) if entry.fault]
    assert broken.robot == "b"
    assert "No such file" in broken.fault


@pytest.mark.parametrize("head", ["file,robot", "robot;logfile;day", "filename,type,robot"])
def test_a_manifest_that_calls_the_path_otherwise_is_told(tmp_path, head):
    (tmp_path / "m.csv").write_text(f"{head}\na,b\n")
    with pytest.raises(InvalidInput, match="unknown columns (file|logfile|filename)"):
        list_logs(tmp_path / "m.csv")


def test_results_within_the_source_are_no_logs(logs):
    from backdrive.fleet.store import Store

    results = logs / "results"
    Store.open(results, make=True).save()
    (results / "logs" / "month=2026-01").mkdir(parents=True)
    (results / "logs" / "month=2026-01" / "x.parquet").write_bytes(b"x")
    assert [entry.robot for entry in list_logs(logs)] == ["a", "b"]
    assert [entry.robot for entry in list_logs([f"{logs}/**/*.parquet", logs])] == ["a", "b"]


def test_a_missing_object_does_not_stop_the_others(tmp_path):
    import fsspec

    system = fsspec.filesystem("memory")
    system.pipe_file("/plant/a/2026-01-05.npz", b"x")
    (tmp_path / "m.csv").write_text(
        "path,robot\nmemory://plant/a/2026-01-05.npz,a\nmemory://plant/none.npz,b\n"
    )
    good, missing = list_logs(tmp_path / "m.csv")
    assert (good.fault, good.day) == ("", date(2026, 1, 5))
    assert "line 3: memory://plant/none.npz does not exist" in missing.fault
    assert [entry.robot for entry in list_logs("memory://plant/a")] == ["a"]


def test_messages_do_not_depend_on_the_place_of_a_copy(monkeypatch):
    import tempfile

    monkeypatch.setattr(tempfile, "gettempdir", lambda: "/tmp")
    entry = LogEntry("s3://plant/a.npz", 1, "1:x", "a", "", date(2026, 1, 5))
    message = "Cannot read /tmp/backdrive-outk3x_/a.npz: it is /tmp/backdrive-abc/a.npz."
    assert failure(entry, "ReadError", message)["message"] == "Cannot read a.npz: it is a.npz."
