"""Workers of dask.distributed, on this machine or at a scheduler's address.

Only as many units are submitted as there are workers, so that a death has one unit to blame and little to do again.
Each future is asked for its own status: a scheduler that is gone cancels them all, and iterators over futures hand
out that exception as if it were a result.
"""

import logging
import os
import queue
import shutil
import signal
import tempfile
import threading
import time
import uuid
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from catseye.errors import ArgumentError, InputError
from catseye.interruption import Unfinished, undo_on_interruption
from catseye.memory import keep_heap_small
from catseye.processors import VARIABLES
from catseye.service.many.unit import Death, LostClusterError, Unit, UnitReport
from catseye.service.many.work import perform
from catseye.service.many.worker import ONE_THREAD, hidden_main, start_tracker
from catseye.version import __version__

LOCAL = "local"
PROTOCOLS = ("tcp://", "tls://", "ws://", "wss://", "ucx://")
EXPECTED = f"expected {LOCAL}, tcp://HOST:PORT or a scheduler's file"
CONNECT = 30.0  # s until a scheduler has answered
START = 120.0  # s until the first worker is there: five on an idle machine, forty on a busy one
NO_WORKER = 60.0  # s without any worker, until the cluster is lost
LOOK = 1.0  # s between two looks at the cluster
GONE = 2.0  # s until killed workers are gone
QUIET = ("distributed", "tornado", "asyncio")  # loggers: what they say of a lost worker, one line of ours says
SETTINGS = {
    "distributed.comm.timeouts.connect": f"{START:g}s",
    "distributed.scheduler.allowed-failures": 0,  # this module counts deaths
    "distributed.scheduler.work-stealing": False,  # one unit a worker; nothing is there to steal
    "distributed.admin.low-level-log-length": 0,
    "distributed.worker.memory.terminate": False,  # units state their memory beforehand
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.target": False,
}
_ONE_AT_A_TIME = threading.Lock()  # in a worker of several threads


def perform_remotely(unit: Unit, ledger: Path | None, version: str) -> UnitReport:
    """Report on a unit, done in a worker of a cluster, with one thread of linear algebra from now on.

    version   of the run, which must be the worker's
    """
    if version != __version__:
        why = f"a worker has catseye {__version__} and the run {version} (expected the same)"
        return UnitReport("stopped", why, None, 0.0)
    from threadpoolctl import threadpool_limits

    with _ONE_AT_A_TIME:
        os.environ.update(dict.fromkeys(VARIABLES, "1"))
        threadpool_limits(limits=1, user_api="blas")
        keep_heap_small()
        return perform(unit, ledger)


class ClusterWorkers:
    """Places for units in a dask cluster.

    address     "local", a scheduler's address or file
    count       of the workers, for "local"
    with_main   local workers import the main module

    Raises ArgumentError for an address that is none, InputError where nothing answers or dask is not installed.
    """

    def __init__(self, address: str, count: int, ledger: Path | None, *, with_main: bool):
        dask = _distributed()
        self._ledger, self._answers = ledger, queue.SimpleQueue[Any]()
        self._running: dict[Any, int] = {}
        self._cluster: Any = None
        self._scratch, self._own = "", ExitStack()
        self._own.enter_context(_own_settings(dask, with_main=with_main))
        try:
            if address == LOCAL:
                start_tracker()
                self._scratch = tempfile.mkdtemp(prefix="catseye-dask-")
                self._own.enter_context(undo_on_interruption(Unfinished(self._scratch)))
                self._cluster = dask.LocalCluster(
                    n_workers=count,
                    threads_per_worker=1,
                    processes=True,
                    dashboard_address=None,
                    worker_dashboard_address=None,
                    scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},  # else its pages take port 8787
                    silence_logs=logging.CRITICAL,
                    memory_limit=0,
                    local_directory=self._scratch,
                    env=dict.fromkeys(ONE_THREAD, "1"),
                )
            self._client = self._connected(dask, address)
            self._client.wait_for_workers(1, timeout=START)
        except (OSError, TimeoutError, RuntimeError) as problem:
            self._end()
            raise InputError(
                f"cluster {address}: no worker answers ({' '.join(str(problem).split()) or 'in time'})"
            ) from problem
        except BaseException:
            self._end()
            raise
        self._seen = self._looked = time.monotonic()
        self.count = self._workers()

    def _connected(self, dask: Any, address: str) -> Any:
        common = {"timeout": CONNECT, "set_as_default": False}
        if self._cluster is not None:
            return dask.Client(self._cluster, **common)
        if address.startswith(PROTOCOLS):
            return dask.Client(address, **common)
        if Path(address).is_file():
            return dask.Client(scheduler_file=address, **common)
        raise ArgumentError(f"cluster = {address!r}: is no address and no file ({EXPECTED})", "cluster")

    def start(self, number: int, unit: Unit) -> None:
        """Submit a unit."""
        future = self._client.submit(
            perform_remotely, unit, self._ledger, __version__, key=f"{unit.name}-{uuid.uuid4().hex}", pure=False
        )
        self._running[future] = number
        future.add_done_callback(self._answers.put)

    def ended(self, timeout: float | None = None) -> list[tuple[int, UnitReport | Death]]:
        """Units that have ended since, by their numbers; waits for the first, at most for a time, s.

        Raises LostClusterError where scheduler or all workers are gone.
        """
        until = None if timeout is None else time.monotonic() + timeout
        while until is None or time.monotonic() < until:
            futures = self._waited(LOOK if until is None else min(LOOK, max(until - time.monotonic(), 0.0)))
            if futures:
                return sorted((self._running.pop(future), self._answer(future)) for future in futures)
            self._look()
        return []

    def _waited(self, seconds: float) -> list[Any]:
        futures = []
        with suppress(queue.Empty):
            futures.append(self._answers.get(timeout=seconds))
            while True:
                futures.append(self._answers.get_nowait())
        return futures

    def _answer(self, future: Any) -> UnitReport | Death:
        """Report of a future that has ended."""
        if future.status in ("cancelled", "lost"):
            raise LostClusterError("the cluster's scheduler is gone")
        if future.status == "error":
            problem = future.exception(timeout=CONNECT)
            if type(problem).__name__ == "KilledWorker":
                return Death()
            text = " ".join(f"{type(problem).__name__}: {problem}".split())
            if isinstance(problem, ImportError):
                return UnitReport("stopped", f"a worker has not the same catseye: {text}", None, 0.0)
            return UnitReport("failed", text, None, 0.0)
        try:
            answer = future.result(timeout=CONNECT)
        except Exception as problem:
            raise LostClusterError(f"the cluster does not give an answer ({type(problem).__name__})") from problem
        finally:
            future.release()
        return UnitReport(*answer)

    def _look(self) -> None:
        """Notice new workers, and a cluster that is gone."""
        now = time.monotonic()
        if self._client.status not in ("running", "newly-created"):
            raise LostClusterError("the cluster's scheduler is gone")
        if now - self._looked < LOOK:
            return
        self._looked = now
        try:
            count = self._workers()
        except Exception as problem:
            raise LostClusterError(f"the cluster's scheduler does not answer ({type(problem).__name__})") from problem
        if count:
            self._seen, self.count = now, count
        elif now - self._seen > NO_WORKER:
            raise LostClusterError(f"the cluster has had no worker for {NO_WORKER:g} s")

    def _workers(self) -> int:
        return len(self._client.scheduler_info()["workers"])

    def close(self) -> None:
        """End the local workers, or leave the cluster."""
        self._end()

    def kill(self) -> None:
        """End local workers at once; others end a unit that runs, and find nobody who wants it."""
        if self._cluster is None:
            return
        pids = []
        for nanny in list(self._cluster.workers.values()):
            with suppress(Exception):
                nanny.status = type(nanny.status).closing_gracefully  # it starts no other in its place
                pids.append(nanny.pid)
        for pid in filter(None, pids):
            with suppress(OSError):
                os.kill(pid, signal.SIGKILL)
        until = time.monotonic() + GONE
        while any(_alive(pid) for pid in filter(None, pids)) and time.monotonic() < until:
            time.sleep(0.02)
        shutil.rmtree(self._scratch, ignore_errors=True)

    def abandon(self) -> None:
        """Cancel what runs, end local workers at once, and let the client go."""
        if self._running and self._client.status == "running":
            with suppress(Exception):
                self._client.cancel(list(self._running), timeout=GONE)
        self.kill()
        self._end()

    def _end(self) -> None:
        client, cluster = getattr(self, "_client", None), self._cluster
        with suppress(Exception):
            if client is not None:
                client.close(timeout=GONE)
        with suppress(Exception):
            if cluster is not None:
                cluster.close(timeout=GONE)
        if self._scratch:
            shutil.rmtree(self._scratch, ignore_errors=True)
        self._own.close()


@contextmanager
def _own_settings(dask: Any, *, with_main: bool) -> Iterator[None]:
    """Set dask's configuration, its loggers and the main module for a run, and restore them with the environment."""
    loggers = [logging.getLogger(name) for name in QUIET]
    levels, environment = [logger.level for logger in loggers], dict(os.environ)
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        with dask.config.set(SETTINGS), hidden_main(with_main=with_main):
            yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)
        for name in set(os.environ) - set(environment):
            del os.environ[name]
        os.environ.update(environment)


def _distributed() -> Any:
    """Client, LocalCluster and config of dask."""
    try:
        from dask import config
        from distributed import Client, LocalCluster
    except ImportError as problem:
        expected = "expected catseye installed with its extra: pip install 'catseye[scale]'"
        raise InputError(f"cluster needs dask.distributed ({expected})") from problem
    return SimpleNamespace(Client=Client, LocalCluster=LocalCluster, config=config)


def _alive(pid: int) -> bool:
    """True for a process that runs; one that has ended and waits for its parent is none."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (OSError, IndexError):
        return False
