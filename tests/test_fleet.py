"""A fleet's run: what is listed, done, kept, refused; all in one process but one run on a cluster."""

import json
import logging
import os
from datetime import date
from types import SimpleNamespace

import numpy as np
import pytest

from _commands import called
from _s3 import served
from backdrive.errors import BackdriveError, InvalidInput, ModelFileError, ReadError
from backdrive.fleet import cluster as clusters
from backdrive.fleet import schema
from backdrive.fleet.batches import WORK, work_of
from backdrive.fleet.entries import LogEntry
from backdrive.fleet.run import cut, run_fleet
from backdrive.fleet.simulation import Event, FleetSimulation
from backdrive.fleet.sources import list_logs
from backdrive.fleet.status import status
from backdrive.fleet.store import Store

FLEET = FleetSimulation(
    robots=3, days=4, first=date(2026, 1, 30), events=[Event(kind="break", robot=2, day=2)], correlation=0.5
)


class Client:
    """Stands for Dask: does a task at once, in this process."""

    def ncores(self):
        return {"here": 1}

    def submit(self, function, *arguments, key, pure, retries):
        def result():
            return function(*arguments)

        future = SimpleNamespace(
            key=key, status="finished", result=None, release=lambda: None, exception=None
        )
        try:
            value = result()
            future.result = lambda: value
        except BaseException as error:
            future.status, caught = "error", error
            future.exception = lambda: caught
        return future


class Completed(list):
    add = list.append

    def __next__(self):
        return self.pop(0)


@pytest.fixture
def here(monkeypatch):
    import contextlib

    import distributed

    monkeypatch.setattr(clusters, "local_client", lambda workers: contextlib.nullcontext(Client()))
    monkeypatch.setattr(distributed, "as_completed", lambda **_: Completed())


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fleet") / "logs"
    list(FLEET.write(folder, seconds=8.0, rate=100.0))
    return folder


@pytest.fixture(scope="module")
def results(logs, tmp_path_factory):
    folder = tmp_path_factory.mktemp("results") / "results"
    run_fleet(logs, folder, workers=2, batch=3)  # on a real cluster, once
    return folder


def content(folder):
    return {p.relative_to(folder): p.read_bytes() for p in sorted((folder / "logs").rglob("*.parquet"))}


def test_a_fleet_is_done_and_its_failures_are_kept_apart(results):
    store = Store.open(results)
    table, failures = store.table(), store.table(failures=True)
    assert (table.num_rows, failures.num_rows) == (10, 2)
    assert set(failures.column("failure").to_pylist()) == {"IncompleteFile"}
    assert {p.parent.name for p in store.parts()} == {"month=2026-01", "month=2026-02"}
    row = table.to_pylist()[0]
    truth = FLEET.truth(0, 0)[0]
    assert row["robot"] == "robot000"
    assert row["day"] == date(2026, 1, 30)
    assert (row["constant"], row["viscous"]) == pytest.approx(tuple(truth), rel=0.05)
    assert row["temperature"] == pytest.approx(FLEET.temperature[0, 0])
    assert row["grade"] in ("good", "care")
    names = row["covariance_names"]
    assert len(row["covariance"]) == len(names) ** 2


def test_the_same_bytes_without_a_cluster_and_a_second_run_does_nothing(results, logs, tmp_path, here):
    outcome = run_fleet(logs, tmp_path / "r", batch=3)
    assert (outcome.done, outcome.failed) == (12, 2)
    assert content(tmp_path / "r") == content(results)
    again = run_fleet(logs, tmp_path / "r", batch=3)
    assert (again.done, again.kept) == (0, 12)


def test_shards_are_disjoint_and_whole(results, logs, tmp_path, here):
    parts = [run_fleet(logs, tmp_path / "r", shard=(i, 3)) for i in (1, 2, 3)]
    assert sum(one.done for one in parts) == 12
    assert Store.open(tmp_path / "r").table().equals(Store.open(results).table())


def test_a_changed_file_a_torn_part_and_a_forgotten_robot_are_done_again(results, logs, tmp_path, here):
    import shutil

    mine, place = tmp_path / "logs", tmp_path / "r"
    shutil.copytree(logs, mine)
    run_fleet(mine, place, batch=3)
    os.utime(mine / "robot000" / "2026-01-30.npz", (1.0, 1.0))  # a clock that goes back
    assert run_fleet(mine, place).done == 1
    part = Store.open(place).parts()[0]
    part.write_bytes(part.read_bytes()[:-30])
    outcome = run_fleet(mine, place)
    assert outcome.done > 0
    assert "torn" in outcome.sentences[0]
    assert Store.open(place).forget("robot001") == 4
    with pytest.raises(InvalidInput, match="no robot 'robot001'"):
        Store.open(place).forget("robot001")
    assert run_fleet(mine, place).done == 4
    assert run_fleet(mine, place, retry=True).done == 2
    assert Store.open(place).table().num_rows == 10


def test_copies_count_once_and_a_renamed_robot_keeps_its_history(logs, tmp_path, here):
    import shutil

    mine, place = tmp_path / "logs", tmp_path / "r"
    shutil.copytree(logs, mine)
    shutil.copy(mine / "robot000" / "2026-01-30.npz", mine / "robot000" / "again-2026-01-30.npz")
    run_fleet(mine, place)
    summary = status(place)
    assert len(summary["copies"]) == 1
    assert summary["logs"] == 10
    (mine / "robot001").rename(mine / "cell7")
    outcome = run_fleet(mine, place)
    assert outcome.sentences == ("Robot 'robot001' is called 'cell7' now: its logs are the same.",)
    robots = Store.open(place).table().column("robot").to_pylist()
    assert robots.count("cell7") == 4
    assert len(status(place)["copies"]) == 1  # those of the former name are none
    assert "robot001" not in robots


def test_a_robot_that_shares_one_copy_is_not_taken_for_a_renamed_one(logs, tmp_path, here):
    import shutil

    mine, place = tmp_path / "logs", tmp_path / "r"
    shutil.copytree(logs, mine)
    shutil.copy(mine / "robot001" / "2026-01-30.npz", mine / "robot000" / "2026-03-30.npz")
    for robot in ("robot000", "robot001"):
        (mine / robot / "2026-03-31.npz").write_bytes(b"")
    run_fleet(mine, place)
    assert Store.open(place).table(failures=True).num_rows == 4  # empty files are no copies of each other
    shutil.rmtree(mine / "robot001")
    assert run_fleet(mine, place).sentences == ()
    assert Store.open(place).names == {}


def test_of_copies_that_with_a_possible_day_counts(logs, tmp_path, here):
    import shutil

    mine, place = tmp_path / "logs", tmp_path / "r"
    shutil.copytree(logs, mine)
    shutil.copy(mine / "robot000" / "2026-01-30.npz", mine / "robot000" / "1970-01-01.npz")
    run_fleet(mine, place)
    assert len(status(place)["copies"]) == 1
    assert status(place)["copies"][0][0].endswith("2026-01-30.npz")
    assert date(2026, 1, 30) in Store.open(place).table().column("day").to_pylist()
    assert date(1970, 1, 1) not in Store.open(place).table().column("day").to_pylist()


def test_two_writers_of_one_log_leave_one_row(results, logs, tmp_path, here):
    place = tmp_path / "r"
    run_fleet(logs, place, batch=5)
    for part in Store.open(results).parts():
        target = place / "logs" / part.parent.name / part.name
        target.write_bytes(part.read_bytes())
    assert Store.open(place).raw(["path"]).num_rows == 24
    assert Store.open(place).table().equals(Store.open(results).table())
    assert Store.open(place).table(failures=True).num_rows == 2


def test_batches_depend_on_the_logs_alone(logs):
    entries = list_logs(logs)
    batches = list(cut(entries, "tag", 3))
    assert [b.name for b in batches] == [b.name for b in cut(entries, "tag", 3)]
    assert all(len({e.day.month for e in b.entries}) == 1 for b in batches)
    assert sorted(e.path for b in batches for e in b.entries) == [e.path for e in entries]


@pytest.mark.parametrize(
    ("name", "size", "logs"),
    [("a.npz", 26_568, 24), ("a.npz", 640_968, 15), ("a.csv", 2_020_510, 13), ("a.npz", 50_000_000, 1), ("a.npz", 0, 24)],
)  # fmt: skip
def test_batches_are_of_about_equal_work(name, size, logs):
    def entry(i):
        return LogEntry(f"/l/{i:03d}/{name}", size, f"{size}:{i}", "r", "", date(2026, 3, 1))

    batches = list(cut([entry(i) for i in range(100)], "tag"))
    assert {len(b.entries) for b in batches[:-1]} == {logs}
    assert sum(len(b.entries) for b in batches) == 100
    assert max(sum(map(work_of, b.entries)) for b in batches) <= max(WORK, work_of(entry(0))) + 1e-9
    assert max(len(b.entries) for b in cut([entry(i) for i in range(100)], "tag", 7)) <= 7


def test_a_full_disk_stops_the_run(logs, tmp_path, here, monkeypatch):
    from backdrive.errors import WriteError
    from backdrive.fleet import store

    def full(*_):
        raise WriteError("Cannot write: the disk is full.", remedy="Make room.")

    monkeypatch.setattr(store, "write_rows", full)
    with pytest.raises(WriteError, match="full"):
        run_fleet(logs, tmp_path / "r")


def test_a_log_that_kills_its_worker_is_named(logs, tmp_path, here, monkeypatch):
    from backdrive.fleet import run as module

    class KilledWorker(Exception):
        pass

    def deadly(batch, options, folder):
        if any("robot001/2026-01-31" in entry.path for entry in batch.entries):
            raise KilledWorker
        return original(batch, options, folder)

    original = module.do_batch
    monkeypatch.setattr(module, "do_batch", deadly)
    outcome = run_fleet(logs, tmp_path / "r")
    assert (outcome.done, outcome.failed) == (12, 3)
    kinds = Store.open(tmp_path / "r").table(failures=True).column("failure").to_pylist()
    assert kinds.count("WorkerKilled") == 1


def test_a_second_run_on_a_folder_is_told(tmp_path):
    store = Store.open(tmp_path / "r", make=True)
    with (
        store.lock((1, 2)),
        store.lock((2, 2)),
        pytest.raises(InvalidInput, match="Another run is using"),
        store.lock(),
    ):
        pass
    with store.lock():
        pass


def test_manifests(logs, tmp_path):
    path = logs / "robot000" / "2026-01-30.npz"
    manifest = tmp_path / "m.csv"
    manifest.write_text(f"path,robot,type,day\n{path},a7,ur5,2026-05-06\n")
    (entry,) = list_logs(manifest)
    assert (entry.robot, entry.type, entry.day) == ("a7", "ur5", date(2026, 5, 6))
    for text, words in (
        (f"path,serial\n{path},1\n", "unknown columns serial"),
        (f"path,day\n{path}\n", "line 2: 1 cells under 2"),
    ):
        manifest.write_text(text)
        with pytest.raises(BackdriveError, match=words):
            list_logs(manifest)


def test_sources_without_logs_are_said(tmp_path, logs):
    for source, words in (
        (tmp_path, "holds no log"),
        (tmp_path / "x", "does not exist"),
        (f"{tmp_path}/*.npz", "no log"),
    ):
        with pytest.raises(ReadError, match=words):
            list_logs(source)
    pattern = list_logs(f"{logs}/robot00[01]/2026-01-*.npz")
    assert [e.robot for e in pattern] == ["robot000"] * 2 + ["robot001"] * 2


def test_addresses_of_clusters():
    for address in ("tcp://10.1.2.3:8786", "tcp://scheduler:8786"):
        with pytest.raises(InvalidInput, match="not encrypted"):
            clusters.check_address(address, insecure=False)
        clusters.check_address(address, insecure=True)
    clusters.check_address("tcp://127.0.0.1:8786", insecure=False)
    for address in ("scheduler", "http://a:1", "tls://", "tls://a", "tls://a:port"):
        with pytest.raises(InvalidInput, match="no address"):
            clusters.check_address(address, insecure=True)
    with (
        pytest.raises(InvalidInput, match=r"^tls://127.0.0.1:1 needs certificates"),
        clusters.remote_client("tls://127.0.0.1:1", clusters.Credentials()),
    ):
        pass
    with (
        pytest.raises(InvalidInput, match="No scheduler answers"),
        clusters.remote_client("tcp://127.0.0.1:1", clusters.Credentials()),
    ):
        pass
    assert not logging.getLogger("distributed.client").isEnabledFor(
        logging.ERROR
    )  # no traceback of a lost one


def test_results_of_another_schema(results, tmp_path, monkeypatch):
    import shutil

    import pyarrow as pa
    import pyarrow.parquet as pq

    place = tmp_path / "r"
    shutil.copytree(results, place)
    head = json.loads((place / "fleet.json").read_text())
    (place / "fleet.json").write_text(json.dumps(head | {"schema": 99}))
    with pytest.raises(ModelFileError, match="schema 99, newer"):
        Store.open(place)
    (place / "fleet.json").write_text("{")
    with pytest.raises(ModelFileError, match="damaged"):
        Store.open(place)
    (place / "fleet.json").write_text(json.dumps(head | {"schema": 0}))
    with pytest.raises(ModelFileError, match="has the schema 0"):
        Store.open(place)
    # an older one, without a column, is migrated
    empty = pa.array([None], pa.string())
    monkeypatch.setattr(
        schema,
        "MIGRATIONS",
        {0: lambda table: table.append_column("remedy", pa.chunked_array([empty] * table.num_rows))},
    )
    store = Store.open(place)
    before = store.table()
    for part in store.parts():
        old = pq.read_table(part, partitioning=None).drop_columns(["remedy"])
        pq.write_table(old.replace_schema_metadata({schema.KEY: b"0"}), part)
    assert Store.open(place).table().drop_columns(["remedy"]).equals(before.drop_columns(["remedy"]))


def test_a_folder_with_other_things_is_left_alone(logs, tmp_path):
    (tmp_path / "letter.txt").write_text("dear")
    with pytest.raises(InvalidInput, match="letter.txt"):
        run_fleet(logs, tmp_path)
    with pytest.raises(ReadError, match="no results"):
        Store.open(tmp_path)


def test_days_that_are_none_are_told(results, tmp_path):
    import shutil

    import pyarrow as pa

    from backdrive.fleet.history import histories
    from backdrive.fleet.store import encode

    place = tmp_path / "r"
    shutil.copytree(results, place)
    part = Store.open(place).parts()[0]
    table = Store.open(place).read_part(part)
    days = pa.array([date(1970, 1, 1)] * table.num_rows, pa.date32())
    part.write_bytes(encode(table.set_column(table.column_names.index("day"), "day", days)))
    summary = status(place)
    assert any("a clock that was not set" in s for s in summary["sentences"])
    assert all(one.day.min() > 10_000 for one in histories(Store.open(place).table()))


def test_sql_sees_the_tables_and_nothing_else(results, tmp_path):
    from backdrive.fleet.query import run_query

    answer = run_query(results, "SELECT robot, count(*) AS n FROM results GROUP BY robot ORDER BY robot")
    assert answer.names == ("robot", "n")
    assert answer.rows == [("robot000", 4), ("robot001", 4), ("robot002", 2)]
    assert run_query(results, "SELECT count(*) FROM failures").rows == [(2,)]
    (tmp_path / "secret.csv").write_text("a,b\n1,2\n")
    for sql in (
        f"SELECT * FROM read_csv('{tmp_path}/secret.csv')",
        f"SELECT * FROM '{tmp_path}/secret.csv'",
        f"COPY results TO '{tmp_path}/out.csv'",
        f"ATTACH '{tmp_path}/a.db'",
        "INSTALL httpfs",
        "SET enable_external_access = true",
        "SELECT 1; SELECT 2",
        "DROP TABLE results",
        "SELECT * FROM glob('/etc/*')",
        "SELECT * FROM arrow_rows",
        "SELECT * FROM store",
        "SELEC",
    ):
        with pytest.raises(InvalidInput):
            run_query(results, sql)
    assert sorted(os.listdir(tmp_path)) == ["secret.csv"]
    with pytest.raises(InvalidInput, match=r"No answer within 0.2 s"):
        run_query(results, "SELECT count(*) FROM range(1000000000) a, range(1000000000) b", seconds=0.2)


def test_commands(results, logs, tmp_path):
    assert called("fleet", "status", "-o", results).stdout.startswith(
        "3 robots, 3 joints, 10 logs from 2026-01-30"
    )
    shown = called("fleet", "trend", "robot000/joint_1", "-o", results)
    assert "too short to tell" in shown.stdout
    assert called("fleet", "trend", "robot9/x", "-o", results).returncode == 2
    drifted = called("fleet", "drifted", "-o", results, "--json")
    assert json.loads(drifted.stdout)["tested"] == 0
    assert called("fleet", "drifted", "--since", "soon", "-o", results).returncode == 2
    assert (
        called("fleet", "sql", "SELECT count(*) AS n FROM results", "-o", results, "--json").stdout.count(
            '"n": 10'
        )
        == 1
    )
    page = tmp_path / "page.html"
    assert called("fleet", "page", "-o", results, "--page", page).returncode == 0
    assert "robot000" in page.read_text()
    population = tmp_path / "p.json"
    assert called("fleet", "merge", "-o", results, "--population", population).returncode == 0
    held = next(logs.rglob("*.npz"))
    twice = called("identify", held, "--prior", population)
    assert twice.returncode == 2
    assert "count twice" in " ".join(twice.stderr.split())
    without = called("fleet", "merge", "-o", results, "--population", population, "--without", "robot00")
    assert without.returncode == 2
    alone = called("fleet", "merge", "-o", results, "--population", population, "--without", "robot000")
    assert "No type in" in alone.stderr  # of three robots two are left
    assert "Did you mean 'robot00" in " ".join(without.stderr.split())
    assert called("fleet", "nosuch", "-o", tmp_path / "r").returncode == 3
    assert called("fleet", logs, "-o", tmp_path / "r", "--shard", "4/3").returncode == 2
    assert not (tmp_path / "r").exists()


def test_an_s3_bucket(logs, tmp_path, here, monkeypatch):
    s3fs = pytest.importorskip("s3fs")
    folder = logs / "robot000"
    objects = {f"logs/robot000/{path.name}": path.read_bytes() for path in folder.iterdir()}
    with served("plant", objects) as address:
        for name, value in (
            ("AWS_ENDPOINT_URL", address),
            ("AWS_ACCESS_KEY_ID", "a"),
            ("AWS_SECRET_ACCESS_KEY", "b"),
            ("AWS_DEFAULT_REGION", "us-east-1"),
        ):
            monkeypatch.setenv(name, value)
        s3fs.S3FileSystem.clear_instance_cache()
        outcome = run_fleet("s3://plant/logs", tmp_path / "r")
        assert (outcome.done, outcome.failed) == (4, 0)
        assert run_fleet("s3://plant/logs", tmp_path / "r").done == 0
        rows = Store.open(tmp_path / "r").table().to_pylist()
        assert {row["robot"] for row in rows} == {"robot000"}
        assert rows[0]["path"] == "s3://plant/logs/robot000/2026-01-30.npz"
        with pytest.raises(ReadError):
            list_logs("s3://nowhere/logs")
    with pytest.raises(ReadError, match="no object store"):
        list_logs("http://host/logs")


def test_the_generator_repeats_itself():
    one, other = FLEET.log(1, 2, seconds=2.0, rate=100.0), FLEET.log(1, 2, seconds=2.0, rate=100.0)
    assert all(np.array_equal(one[name], other[name]) for name in one)
    wear = FleetSimulation(days=60, events=[Event(kind="wear", robot=0, day=20, size=0.2, length=20)])
    assert wear.growth(0, 0)[[0, 20, 30, 40, 59]] == pytest.approx([1.0, 1.0, 1.1, 1.2, 1.2])
    assert wear.name(0, 5) == "robot000"


def test_the_public_names_of_a_fleet_can_be_imported():
    import backdrive.fleet

    assert sorted(backdrive.fleet.__all__) == sorted(backdrive.fleet._HOMES)
    assert all(hasattr(backdrive.fleet, name) for name in backdrive.fleet.__all__)
