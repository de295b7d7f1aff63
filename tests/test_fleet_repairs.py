"""A fleet's run on results that exist: what is done again, corrected, renamed or refused. Nothing is identified here."""

import contextlib
import hashlib
import json
import signal
import threading
from datetime import date
from pathlib import Path

import distributed
import numpy as np
import pytest

from _commands import called
from backdrive.errors import InvalidInput, UnknownName
from backdrive.fleet import cluster as clusters
from backdrive.fleet import work
from backdrive.fleet.history import History
from backdrive.fleet.renames import record_renames
from backdrive.fleet.run import run_fleet
from backdrive.fleet.silence import silent_joints
from backdrive.fleet.simulation import FleetSimulation
from backdrive.fleet.status import status
from backdrive.fleet.store import Store
from backdrive.fleet.tally import Tally
from test_fleet import Client, Completed


@pytest.fixture
def logs(tmp_path, monkeypatch):
    monkeypatch.setattr(clusters, "local_client", lambda workers: contextlib.nullcontext(Client()))
    monkeypatch.setattr(distributed, "as_completed", lambda **_: Completed())

    def row(entry, options):
        if entry.fault or "bad" in entry.path:
            return [work.failure(entry, "ReadError", entry.fault or "bad")]
        with open(entry.place, "rb") as stream:
            digest = hashlib.sha256(stream.read()).hexdigest()
        return [
            work._about(entry, digest)
            | {"joint": "j1", "constant": 1.0, "viscous": 1.0, "top_speed": 1.0, "grade": "good"}
        ]

    monkeypatch.setattr(work, "do_log", row)
    for robot in ("a", "b"):
        for day in (5, 6, 7):
            place = tmp_path / "logs" / robot
            place.mkdir(parents=True, exist_ok=True)
            (place / f"2026-01-0{day}.npz").write_bytes(f"{robot}{day}".encode())
    return tmp_path / "logs"


def robots(place):
    return Store.open(place).table().column("robot").to_pylist()


def test_again_removes_nothing_before_the_workers_are_there(logs, tmp_path, monkeypatch):
    place = tmp_path / "r"
    run_fleet(logs, place)
    before = Store.open(place).raw()
    with pytest.raises(InvalidInput, match="no robot 'nosuch'"):
        run_fleet(logs, place, again=["nosuch"])
    with Store.open(place).lock(), pytest.raises(InvalidInput, match="Another run"):
        run_fleet(logs, place, again=["a"])

    def fail(workers):
        raise InvalidInput("No workers.")

    with monkeypatch.context() as patch:
        patch.setattr(clusters, "local_client", fail)
        with pytest.raises(InvalidInput, match="No workers"):
            run_fleet(logs, place, again=["a"])
    assert Store.open(place).raw().equals(before)
    assert run_fleet(logs, place, again=["a"]).done == 3
    assert robots(place) == ["a"] * 3 + ["b"] * 3


def test_renames_are_checked_and_undone(logs, tmp_path):
    place = tmp_path / "r"
    run_fleet(logs, place)
    with pytest.raises(InvalidInput, match="no robot 'c'"):
        record_renames(Store.open(place), {"c": "d"})
    with pytest.raises(InvalidInput, match="both have logs on 3 days, the first 2026-01-05"):
        record_renames(Store.open(place), {"a": "b"})
    assert record_renames(Store.open(place), {"a": "d"}) == ["a is now d."]
    assert robots(place) == ["b"] * 3 + ["d"] * 3
    assert record_renames(Store.open(place), {"d": "a"}) == ["a is no longer taken for d."]
    assert Store.open(place).names == {}


def test_a_copy_elsewhere_is_no_rename_while_the_first_path_is_there(logs, tmp_path):
    import shutil

    place = tmp_path / "r"
    run_fleet(logs, place)
    shutil.copytree(logs / "a", tmp_path / "other" / "copy")
    assert run_fleet(tmp_path / "other", place).sentences == ()
    assert Store.open(place).names == {}


def test_a_corrected_manifest_corrects_the_results(logs, tmp_path):
    place, manifest = tmp_path / "r", tmp_path / "m.csv"
    manifest.write_text("path,robot,type\nlogs/a/2026-01-05.npz,x,ur5\n")
    run_fleet(manifest, place)
    manifest.write_text("path,robot,type,day\nlogs/a/2026-01-05.npz,y,ur10,2026-02-03\n")
    outcome = run_fleet(manifest, place)
    assert (outcome.done, outcome.kept) == (0, 1)
    assert "1 logs have another robot" in outcome.sentences[0]
    (row,) = Store.open(place).table().to_pylist()
    assert (row["robot"], row["type"], row["day"]) == ("y", "ur10", date(2026, 2, 3))
    assert run_fleet(manifest, place).sentences == ()


def test_a_missing_file_of_a_manifest_is_a_failure_until_it_is_there(logs, tmp_path):
    place, manifest = tmp_path / "r", tmp_path / "m.csv"
    manifest.write_text("path\nlogs/a/2026-01-05.npz\nlogs/c.npz\n")
    outcome = run_fleet(manifest, place)
    assert (outcome.done, outcome.failed) == (2, 1)
    (logs / "c.npz").write_bytes(b"c")
    outcome = run_fleet(manifest, place)
    assert (outcome.done, outcome.failed) == (1, 0)
    assert Store.open(place).table(failures=True).num_rows == 0


def test_a_torn_file_blocks_neither_shards_nor_forget(logs, tmp_path):
    place = tmp_path / "r"
    for what in ("shard", "forget"):
        run_fleet(logs, place, batch=3)
        part = Store.open(place).parts()[0]
        part.write_bytes(part.read_bytes()[:-30])
        if what == "shard":
            assert sum(run_fleet(logs, place, shard=(i, 2)).done for i in (1, 2)) == 3
        else:
            left = {"a", "b"} & {
                *Store.open(place).read_part(Store.open(place).parts()[1], ["robot"])["robot"].to_pylist()
            }
            Store.open(place).forget(min(left))
        assert (place / "torn" / part.name).exists()


def test_wrong_options_are_refused_before_the_logs_are_listed(tmp_path):
    for options in (
        {"law": "nosuch"},
        {"method": "nosuch"},
        {"method": "motion", "law": "nosuch"},
        {"lw": 1},
    ):
        with pytest.raises(UnknownName):
            run_fleet(tmp_path / "none", tmp_path / "r", identification=options)
    for output in ("s3://plant/results", Path("s3://plant/results")):
        with pytest.raises(InvalidInput, match="is an address"):
            run_fleet(tmp_path / "none", output)
    assert not (tmp_path / "r").exists()


def test_a_run_in_which_every_log_fails_exits_with_1(logs, tmp_path):
    bad = logs / "bad"
    bad.mkdir()
    (bad / "2026-01-05.npz").write_bytes(b"bad")
    assert called("fleet", bad, "-o", tmp_path / "r").returncode == 1
    done = called("fleet", logs, "-o", tmp_path / "r")
    assert done.returncode == 0
    assert "6 of 6 logs" in done.stderr  # a plain line without a terminal
    assert "\n" in done.stderr


def test_numbers_out_of_bounds_are_refused_at_the_option(tmp_path):
    for words in (
        ["sql", "SELECT 1", "--most", "-5"],
        ["simulate", "--seconds", "inf"],
        ["simulate", "--seed", "-1"],
    ):
        answer = called("fleet", *words, "-o", tmp_path / "r")
        assert answer.returncode == 2
        assert words[-2] in answer.stderr


def test_a_port_that_is_no_scheduler_is_told():
    import socket

    server = socket.socket()
    server.bind(("127.0.0.1", 0))
    server.listen()

    def answer():
        connection, _ = server.accept()
        connection.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")
        connection.close()

    threading.Thread(target=answer, daemon=True).start()
    address = f"tcp://127.0.0.1:{server.getsockname()[1]}"
    with (
        pytest.raises(InvalidInput, match="No scheduler answers at .*what answers is another program"),
        clusters.remote_client(address, clusters.Credentials()),
    ):
        pass
    server.close()


def test_workers_do_not_get_interrupts():
    inherited = []
    with clusters._without_interrupts():
        thread = threading.Thread(
            target=lambda: inherited.append(signal.pthread_sigmask(signal.SIG_BLOCK, []))
        )
        thread.start()
        thread.join()
    assert signal.SIGINT in inherited[0]
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, [])


def test_the_time_left_counts_from_the_start_of_the_workers():
    tally = Tally(100, begun=-1e6)
    tally.start()
    tally.add(10, 0)
    assert "left" in str(tally)
    assert "h left" not in str(tally)


def test_joints_without_results_now_are_told():
    import pyarrow as pa

    def history(robot, last):
        day = np.arange(20450.0, 20450.0 + last)
        ones = np.ones(day.size)
        return History(
            robot=robot, type="", joint="j1", unit="rad", day=day, constant=ones, viscous=ones, temperature=ones, speed=1.0
        )  # fmt: skip

    failures = pa.table(
        {
            "robot": ["b", "b"],
            "day": [date(2026, 1, 20), date(2026, 1, 21)],
            "failure": ["IncompleteFile"] * 2,
        }
    )
    silent = silent_joints([history("a", 30), history("b", 15), history("c", 10), history("d", 28)], failures)
    assert list(silent) == ["b/j1", "c/j1"]
    assert silent["b/j1"] == "no result since 2026-01-11: 2 later logs failed (IncompleteFile)"
    assert silent["c/j1"].endswith("no later logs")


def test_silent_joints_are_counted_by_status_and_named_by_drifted(logs, tmp_path, monkeypatch):
    for day in range(8, 20):  # b stops on the 7th, c has damaged logs from the 8th on
        (logs / "a" / f"2026-01-{day:02d}.npz").write_bytes(f"a{day}".encode())
        (logs / "c").mkdir(exist_ok=True)
        (logs / "c" / f"2026-01-{day:02d}-bad.npz").write_bytes(b"c")
    (logs / "c" / "2026-01-06.npz").write_bytes(b"c6")
    place = tmp_path / "r"
    run_fleet(logs, place)
    told = called("fleet", "status", "-o", place)
    assert (
        f"2 joints have no recent result, while others have: backdrive fleet drifted -o {place} names them."
        in told.stdout
    )
    told = called("fleet", "drifted", "-o", place)
    assert told.returncode == 0
    assert "b/j1: no result since 2026-01-07: no later logs" in told.stdout
    assert "c/j1: no result since 2026-01-06: 12 later logs failed (ReadError)" in told.stdout
    assert "a/j1" not in told.stdout
    document = json.loads(called("fleet", "drifted", "-o", place, "--json").stdout)
    assert [(one["joint"], one["last"]) for one in document["silent"]] == [
        ("b/j1", "2026-01-07"),
        ("c/j1", "2026-01-06"),
    ]
    assert list(json.loads(called("fleet", "status", "-o", place, "--json").stdout)["silent"]) == [
        "b/j1",
        "c/j1",
    ]
    called("fleet", "page", "-o", place, "--page", tmp_path / "f.html")
    assert "2 joints have no result of the last days" in (tmp_path / "f.html").read_text()


def test_poor_results_are_told_from_absent_logs(logs, tmp_path, monkeypatch):
    whole = work.do_log

    def poor(entry, options):
        grade = {"grade": "poor"} if entry.robot == "b" and entry.day.day > 7 else {}
        return [row | grade for row in whole(entry, options)]

    monkeypatch.setattr(work, "do_log", poor)
    for robot in ("a", "b"):
        for day in range(8, 20):
            (logs / robot / f"2026-01-{day:02d}.npz").write_bytes(f"{robot}{day}".encode())
    run_fleet(logs, tmp_path / "r")
    assert status(tmp_path / "r")["silent"] == {
        "b/j1": "no result since 2026-01-07: 12 later results are poor"
    }


def test_logs_of_the_generator_hold_a_temperature_for_each_joint(tmp_path):
    from backdrive.logs.readers import read_log

    (path,) = list(FleetSimulation(robots=1, joints=2, days=1).write(tmp_path, seconds=2.0, rate=100.0))
    assert read_log(path).temperature.shape == (200, 2)
