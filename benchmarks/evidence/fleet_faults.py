"""A fleet's run under faults: killed workers, schedulers and clients, full disks, torn files, clocks that go back, two clients.

A real Dask scheduler and workers are separate processes on loopback with TLS. At the end the table must be
that of an undisturbed run.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from _common import Judge, first_seed, parser

from backdrive.fleet.store import Store

KILLER = "import os\nos.kill(os.getpid(), 9)\n"
CLOCK = """import time
_time, _begin = time.time, time.time()
time.time = lambda: _time() - (3600.0 if int(_time() - _begin) % 4 >= 2 else 0.0)
"""


def write_logs(folder: Path, robots: int, days: int) -> None:
    """Write short logs of one joint; a sum of sines with Coulomb and viscous friction."""
    t = np.arange(600) / 100.0
    for robot in range(robots):
        (folder / f"r{robot}").mkdir(parents=True)
        for day in range(days):
            draws = np.random.default_rng([robot, day])
            q, dq, ddq = np.zeros((3, t.size))
            for hertz, amplitude in ((0.35, 0.8), (0.8, 0.4)):
                w, shift = 2 * np.pi * hertz, draws.uniform(0, 6)
                q += amplitude * np.sin(w * t + shift)
                dq += amplitude * w * np.cos(w * t + shift)
                ddq -= amplitude * w * w * np.sin(w * t + shift)
            tau = 0.5 * ddq + 3 * np.sign(dq) + 2 * dq + 0.05 * draws.standard_normal(t.size)
            np.savez(folder / f"r{robot}" / f"{np.datetime64('2026-01-01') + day}.npz", t=t, q=q, tau=tau)


class Plant:
    """A scheduler and two workers on loopback with TLS, each of which may be killed."""

    def __init__(self, folder: Path):
        from distributed import Security

        self.folder, folder_ = folder, Security.temporary()
        for name, text in (
            ("ca", folder_.tls_ca_file),
            ("cert", folder_.tls_client_cert),
            ("key", folder_.tls_client_key),
        ):
            (folder / f"{name}.pem").write_text(text)
        self.port = 28_000 + os.getpid() % 2000
        self.address = f"tls://127.0.0.1:{self.port}"
        self.scheduler: subprocess.Popen | None = None
        self.workers: list[subprocess.Popen] = []

    def tls(self, *, file: str = "file") -> list[str]:
        """Return the options that name the certificates."""
        pem = self.folder
        if file == "file":
            return [
                "--tls-ca-file",
                str(pem / "ca.pem"),
                "--tls-cert",
                str(pem / "cert.pem"),
                "--tls-key",
                str(pem / "key.pem"),
            ]
        return [
            "--tls-ca",
            str(pem / "ca.pem"),
            "--tls-cert",
            str(pem / "cert.pem"),
            "--tls-key",
            str(pem / "key.pem"),
        ]

    def _start(self, what: str, *options: str) -> subprocess.Popen:
        log = open(self.folder / "dask.log", "ab")  # noqa: SIM115  (the process keeps it)
        return subprocess.Popen(
            [sys.executable, "-m", "distributed.cli." + what, *options, *self.tls()], stdout=log, stderr=log
        )

    def mend(self) -> None:
        """Start what is not running."""
        if self.scheduler is None or self.scheduler.poll() is not None:
            for worker in self.workers:
                worker.kill()
                worker.wait()
            self.workers = []
            self.scheduler = self._start(
                "dask_scheduler",
                "--protocol",
                "tls",
                "--host",
                "127.0.0.1",
                "--port",
                str(self.port),
                "--no-dashboard",
            )
            time.sleep(1.0)
        self.workers = [w for w in self.workers if w.poll() is None]
        while len(self.workers) < 2:
            self.workers.append(
                self._start(
                    "dask_worker",
                    self.address,
                    "--nthreads",
                    "1",
                    "--no-nanny",
                    "--no-dashboard",
                    "--host",
                    "127.0.0.1",
                )
            )

    def end(self) -> None:
        """End all."""
        for process in [*self.workers, self.scheduler]:
            if process is not None:
                process.kill()
                process.wait()


def command(logs: Path, results: Path, *more: object) -> list[str]:
    """Return the words of a run."""
    return [
        sys.executable,
        "-m",
        "backdrive",
        "fleet",
        str(logs),
        "-o",
        str(results),
        "--batch",
        "3",
        *map(str, more),
    ]


def run(logs: Path, results: Path, *more: object, **environment: str) -> subprocess.CompletedProcess:
    """Run a fleet to its end."""
    return subprocess.run(
        command(logs, results, *more),
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | environment,
        timeout=600,
    )


def same(judge: Judge, what: str, results: Path, reference: Path) -> None:
    """Require the table of an undisturbed run, nothing lost and nothing doubled."""
    one, other = Store.open(results).table(), Store.open(reference).table()
    raw = Store.open(results).raw(["path"]).num_rows
    judge.that(
        f"{what}: {one.num_rows} of {other.num_rows} rows, equal: {one.equals(other)} ({raw} rows in files)",
        one.equals(other),
    )


def wait_for_work(client: subprocess.Popen, results: Path) -> bool:
    """Wait until a run writes a further file of results, and return whether it did before it ended."""
    before = len(list(results.glob("logs/*/*.parquet")))
    while client.poll() is None:
        if len(list(results.glob("logs/*/*.parquet"))) > before:
            return True
        time.sleep(0.05)
    return False


def kills(judge: Judge, place: Path, logs: Path, reference: Path, seed: int, count: int) -> None:
    """Kill workers, scheduler and client at random moments, most of them while logs are done, and go on until all is done."""
    draws, plant, results = np.random.default_rng(seed), Plant(place), place / "killed"
    killed: dict[str, int] = {"worker": 0, "scheduler": 0, "client": 0}
    told, silent, rounds, busy, finished = 0, 0, 0, 0, False
    try:
        while (sum(killed.values()) < count or not finished) and rounds < 4 * count + 20:
            rounds += 1
            if finished:  # all was done before all were killed: once more from nothing
                shutil.rmtree(results)
                finished = False
            plant.mend()
            client = subprocess.Popen(
                command(logs, results, "--cluster", plant.address, *plant.tls(file="")),
                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            )  # fmt: skip
            while client.poll() is None and sum(killed.values()) < count:
                works = draws.random() < 0.75 and wait_for_work(client, results)
                time.sleep(float(draws.uniform(0.0, 1.0 if works else 4.0)))
                if client.poll() is not None:
                    break
                victim = str(draws.choice(["worker", "worker", "scheduler", "client"]))
                process = {"worker": plant.workers[0], "scheduler": plant.scheduler, "client": client}[victim]
                assert process is not None
                if process.poll() is None:
                    process.send_signal(signal.SIGKILL)
                    process.wait()
                    killed[victim] += 1
                    busy += works
                if victim != "worker":
                    break
                plant.mend()
            try:
                text, _ = client.communicate(timeout=120)
            except subprocess.TimeoutExpired:
                client.kill()
                text, silent = "", silent + 1
            finished = client.returncode == 0
            if client.returncode not in (0, -signal.SIGKILL):
                told += client.returncode == 2 and text.startswith("backdrive: ")
                silent += "Traceback" in text or client.returncode == 4
                print(f"  exit {client.returncode}: {text.strip()[:160]}", flush=True)
    finally:
        plant.end()
    print(
        f"  killed: {killed}, {busy} while logs were done; {rounds} runs, {told} of them ended with a sentence"
    )
    judge.that(f"{sum(killed.values())} of {count} kills", sum(killed.values()) == count)
    judge.that(f"{silent} clients hung or ended with a traceback", silent == 0)
    judge.that("the last run ends well", finished)
    same(judge, "after the kills", results, reference)


def poison(judge: Judge, place: Path, logs: Path, reference: Path) -> None:
    """A log that kills its reader costs one log."""
    shim = place / "shim"
    shim.mkdir()
    (shim / "h5py.py").write_text(KILLER)
    mixed = place / "mixed"
    shutil.copytree(logs, mixed, copy_function=os.link)
    (mixed / "r0" / "2026-02-01.h5").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(4096))
    path = os.pathsep.join([str(shim), os.environ.get("PYTHONPATH", "")])
    outcome = run(mixed, place / "poisoned", "--workers", 2, PYTHONPATH=path)
    failures = Store.open(place / "poisoned").table(failures=True).to_pylist()
    kinds = [row["failure"] for row in failures]
    judge.that(f"a log that kills its reader: {kinds}, exit {outcome.returncode}", kinds == ["ReaderCrash"])
    count = Store.open(place / "poisoned").table().num_rows
    judge.that(f"{count} other logs are done", count == Store.open(reference).table().num_rows)


def full(judge: Judge, place: Path, logs: Path, reference: Path) -> None:
    """A disk that fills up stops the run; with room it goes on."""
    disk = place / "disk"
    disk.mkdir()
    if subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=40k", "none", disk], capture_output=True, check=False
    ).returncode:
        print("  a small disk cannot be mounted here (not root): full disk not tried")
        judge.that("full disk tried", False)
        return
    try:
        outcome = run(logs, disk / "results", "--workers", 2)
        judge.that(
            f"full disk: exit {outcome.returncode}, {outcome.stderr.strip()[-160:]}",
            outcome.returncode == 2 and "full" in outcome.stderr and "Traceback" not in outcome.stderr,
        )
        subprocess.run(["mount", "-o", "remount,size=50m", disk], check=True)
        outcome = run(logs, disk / "results", "--workers", 2)
        judge.that(f"with room: exit {outcome.returncode}", outcome.returncode == 0)
        same(judge, "after the full disk", disk / "results", reference)
    finally:
        subprocess.run(["umount", disk], check=False)


def torn(judge: Judge, place: Path, logs: Path, reference: Path) -> None:
    """A file that ends before its content does is set aside, said, and done again."""
    results = place / "torn"
    shutil.copytree(reference, results)
    part = Store.open(results).parts()[-1]
    part.write_bytes(part.read_bytes()[: part.stat().st_size // 2])
    outcome = run(logs, results, "--workers", 1)
    judge.that("a torn file is said", outcome.returncode == 0 and "torn" in outcome.stdout)
    same(judge, "after the torn file", results, reference)


def backwards(judge: Judge, place: Path, logs: Path, reference: Path) -> None:
    """A clock that jumps back an hour every other second, in client and workers."""
    shim = place / "clock"
    shim.mkdir()
    (shim / "sitecustomize.py").write_text(CLOCK)
    path = os.pathsep.join([str(shim), os.environ.get("PYTHONPATH", "")])
    outcome = run(logs, place / "backwards", "--workers", 2, PYTHONPATH=path)
    judge.that(
        f"a clock that goes back: exit {outcome.returncode} {outcome.stderr[-200:]}", outcome.returncode == 0
    )
    same(judge, "by that clock", place / "backwards", reference)


def together(judge: Judge, place: Path, logs: Path, reference: Path) -> None:
    """Two clients on one folder: one works, the other is told; two shards work side by side."""
    results = place / "together"
    several = [subprocess.Popen(command(logs, results, "--workers", 1), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
               for _ in range(2)]  # fmt: skip
    texts = [client.communicate()[1] for client in several]
    codes = sorted(client.returncode for client in several)
    judge.that(f"two clients end with {codes}", codes in ([0, 2], [0, 0]))
    judge.that("the second one is told", codes == [0, 0] or any("Another run" in text for text in texts))
    same(judge, "after two clients", results, reference)
    shards = [subprocess.Popen(command(logs, place / "shards", "--workers", 1, "--shard", f"{i}/2"), stdout=subprocess.DEVNULL)
              for i in (1, 2)]  # fmt: skip
    judge.that("two shards side by side end well", [client.wait() for client in shards] == [0, 0])
    same(judge, "after two shards", place / "shards", reference)


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--seed", type=int)
    options.add_argument("--kills", type=int, help="in the place of 30")
    given = options.parse_args()
    seed, judge = first_seed(given.seed), Judge()
    robots, days, count = (3, 6, 2) if given.short else (6, 10, 30)
    count = given.kills or count
    with tempfile.TemporaryDirectory(prefix="fleet-") as scratch:
        place = Path(scratch)
        logs, reference = place / "logs", place / "reference"
        write_logs(logs, robots, days)
        outcome = run(logs, reference, "--workers", 2)
        judge.that(f"undisturbed: exit {outcome.returncode}", outcome.returncode == 0)
        kills(judge, place, logs, reference, seed, count)
        parts = (poison, full, torn, backwards, together)
        for part in (torn, together) if given.short else parts:
            part(judge, place, logs, reference)
    judge.end()


if __name__ == "__main__":
    main()
