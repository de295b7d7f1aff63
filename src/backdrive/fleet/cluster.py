"""The workers: processes of this machine, or an existing Dask scheduler.

By default, Dask sets `MALLOC_TRIM_THRESHOLD_` to 64 KiB in its workers. This switches off glibc's growing threshold for mapped
memory. Every array above 128 kB is then mapped anew with page faults, which doubles the time on joint logs. Both thresholds are
set here, and linear algebra uses one thread per worker.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import signal
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from backdrive._blas import VARIABLES
from backdrive.errors import InvalidInput, require

if TYPE_CHECKING:
    from distributed import Client

MEMORY = "1.5GiB"  # of a worker, above which it is started again
WAIT = 5.0  # for a scheduler to answer [s]
LOOPBACK = ("127.0.0.1", "localhost", "::1")
ENVIRONMENT = {
    "MALLOC_TRIM_THRESHOLD_": str(1 << 28),
    "MALLOC_MMAP_THRESHOLD_": str(1 << 28),
    "NUMBA_NUM_THREADS": "1",
    **dict.fromkeys(VARIABLES, "1"),
}
#: What Dask would do many times a second beside the work: look at the stack of its thread, at its own delay, and at the lock.
QUIET = {
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "500ms",
    "distributed.admin.tick.limit": "1h",
    "distributed.admin.system-monitor.gil.enabled": False,
}


@dataclass(frozen=True, kw_only=True)
class Credentials:
    """Files of a TLS connection (PEM).

    Attributes:
        authority: certificate of the authority that signed the scheduler's.
        certificate: of this client.
        key: of this client.
    """

    authority: str | None = None
    certificate: str | None = None
    key: str | None = None


@contextlib.contextmanager
def local_client(workers: int) -> Iterator[Client]:
    """Start worker processes here, and end them.

    Args:
        workers: number of them, a thread each.

    Raises:
        InvalidInput: the number is not positive.
    """
    if workers < 1:
        raise InvalidInput(f"{workers} workers.", remedy="Give at least one.")
    dask = _quiet()
    distributed = require("distributed", "A fleet needs", "fleet")
    with dask.config.set({"distributed.nanny.pre-spawn-environ": ENVIRONMENT, **QUIET}):
        with _without_interrupts():
            cluster = distributed.LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                host="127.0.0.1",
                dashboard_address="127.0.0.1:0",
                memory_limit=MEMORY,
                security=_security_here(distributed),
                silence_logs=logging.CRITICAL,
            )
        with cluster, distributed.Client(cluster) as client:
            yield client


@contextlib.contextmanager
def _without_interrupts() -> Iterator[None]:
    """Block Ctrl-C in this thread. Threads and processes that are started meanwhile, and those that they start, never get it:
    the workers end with this process, and print no traceback of their own.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _security_here(distributed: Any) -> Any:
    """Return certificates for this run, so that other users of the machine cannot reach the workers; none without
    `cryptography`.
    """
    try:
        return distributed.Security.temporary()
    except ImportError:
        return None


@contextlib.contextmanager
def remote_client(address: str, credentials: Credentials, *, insecure: bool = False) -> Iterator[Client]:
    """Connect to a scheduler.

    Args:
        address: of it, `tls://host:port`.
        credentials: for TLS; missing entries are taken from Dask's configuration.
        insecure: allow plain tcp to another host; anyone who can reach the port can then run any code.

    Raises:
        InvalidInput: the address is invalid or not encrypted, or no scheduler answers there.
    """
    check_address(address, insecure=insecure)
    _quiet()
    distributed = require("distributed", "A fleet needs", "fleet")
    security = distributed.Security()
    if address.startswith("tls://"):
        files = (credentials.authority, credentials.certificate, credentials.key)
        for file in files:
            if file is not None and not os.path.isfile(file):
                raise InvalidInput(
                    f"There is no file {file}.", remedy="Name PEM files with --tls-ca, --tls-cert, --tls-key."
                )
        given = dict(zip(("tls_ca_file", "tls_client_cert", "tls_client_key"), files, strict=True))
        security = distributed.Security(require_encryption=True, **{k: v for k, v in given.items() if v})
    try:
        asyncio.run(_call(distributed, address, security))
        client = distributed.Client(address, security=security, timeout=WAIT)
    except InvalidInput:
        raise
    except (
        Exception
    ) as error:  # what answers may be anything: that of a web server is read as a length of 3 EiB
        other = isinstance(error, (MemoryError, ValueError))
        why = "what answers is another program" if other else str(error)[:200] or type(error).__name__
        raise InvalidInput(
            f"No scheduler answers at {address} ({why}).",
            remedy="Start `dask scheduler` there, or check address, certificates and network.",
        ) from error
    with client:
        yield client


async def _call(distributed: Any, address: str, security: Any) -> None:
    """Ask a scheduler for its identity within `WAIT`, before a client is created, since a refused client leaves threads
    behind.
    """
    arguments = security.get_connection_args("client")
    if address.startswith("tls://") and arguments.get("ssl_context") is None:
        raise InvalidInput(
            f"{address} needs certificates.", remedy="Name PEM files with --tls-ca, --tls-cert and --tls-key."
        )
    from distributed.comm.core import connect

    comm = await asyncio.wait_for(connect(address, timeout=WAIT / 2, **arguments), WAIT)
    comm.abort()


def check_address(address: str, *, insecure: bool) -> None:
    """Refuse an invalid address of a scheduler, or plain tcp to another host.

    Raises:
        InvalidInput: as said.
    """
    parts = urlsplit(address)
    try:
        whole = parts.scheme in ("tls", "tcp") and bool(parts.hostname) and bool(parts.port)
    except ValueError:
        whole = False
    if not whole:
        raise InvalidInput(
            f"--cluster {address} is no address.", remedy="Give one such as tls://scheduler:8786."
        )
    if parts.scheme == "tcp" and parts.hostname not in LOOPBACK and not insecure:
        raise InvalidInput(
            f"--cluster {address} is not encrypted: anyone who can reach it can run any code on the workers.",
            remedy="Use tls://, or give --insecure in a network that you trust.",
        )


def check_workers(client: Any, folder: Path) -> None:
    """Refuse a cluster without workers, or with workers that lack this version or the folder of results.

    Raises:
        InvalidInput: as said.
    """
    from backdrive import __version__

    try:
        client.wait_for_workers(1, timeout=WAIT)
    except TimeoutError as error:
        raise InvalidInput(
            "The cluster has no workers.", remedy="Start `dask worker` at its scheduler."
        ) from error
    try:
        answers = client.run(probe, str(folder.resolve()), __version__)
    except Exception as error:
        raise InvalidInput(
            f"A worker cannot load backdrive ({type(error).__name__}: {str(error)[:200]}).",
            remedy='Install "backdrive[fleet]" where the workers run.',
        ) from error
    for worker, answer in sorted(answers.items()):
        if answer:
            raise InvalidInput(
                f"Worker {worker}: {answer}.", remedy="Give the workers the same version and folders."
            )


def probe(folder: str, version: str) -> str:
    """Return the reason why this worker process cannot work, or None; run by a worker.

    Args:
        folder: of the results.
        version: of the client.
    """
    from backdrive import __version__

    if version != __version__:
        return f"its backdrive is {__version__}, here is {version}"
    os.environ.update(ENVIRONMENT)
    return "" if (Path(folder) / "fleet.json").is_file() else f"it does not see {folder}"


def _quiet() -> Any:
    """Return dask, without its log messages on reconnections and dying workers; the run reports the relevant ones."""
    dask = require("dask", "A fleet needs", "fleet")
    require("distributed", "A fleet needs", "fleet")
    for name in (
        "distributed",
        "distributed.client",
        "tornado",
        "asyncio",
    ):  # the client has a level of its own
        logging.getLogger(name).setLevel(logging.CRITICAL)
    return dask
