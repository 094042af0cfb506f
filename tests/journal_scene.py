"""Journals to try: entries of every kind, a site, and a PostgreSQL server of one's own where it is installed."""

import os
import shutil
import signal
import subprocess
import tempfile
import threading
from contextlib import suppress
from pathlib import Path

import numpy as np

from catseye.coordinator.journal.entries import AnsweredShot, Document, EpochSolution, Run, SentCommand
from catseye.records.night.live import Happening, LivePosture, LiveShot, LiveWeather
from catseye.records.site.folder import read_site
from process_scene import ends_with_us
from repository import ROOT

NIGHT = ROOT / "examples" / "night-01"
START = 5_288_912_500_000  # ticks
SAMPLES, CYCLES = 16, 4
MOST_WAIT = 30.0  # s for what other processes do; nothing here takes a tenth of it


def scene_site():
    return read_site(NIGHT)


def scene_run(**more):
    return Run(scene_site(), {"solve_every": 0.5, "model": "ciddor"}, **more)


def scene_shot(number, *, ranger="ZY105", target="ZEG41040L", samples=True, ticks=None, seed=0):
    """A shot with 64 codes that only it has."""
    codes = np.random.default_rng((seed, number)).integers(-32768, 32768, SAMPLES * CYCLES, dtype=np.int16)
    when = START + 200 * number if ticks is None else ticks
    taken = codes if samples else None
    return LiveShot(ranger, target, when, CYCLES, SAMPLES, 1000, 10.0 / 32768.0, taken, 1.5, 0.1 * number, number)


def scene_answer(number, **more):
    return AnsweredShot(scene_shot(number, **more), "used", "", 100.0 + 0.1 * number, 31e-6, -2e-5)


def scene_entries(count=20, seed=0):
    """A little of everything, in an order that no table has."""
    rng = np.random.default_rng(seed)
    entries = []
    for k in range(count):
        when = START + 200 * k
        covariance = np.cov(rng.standard_normal((3, 9)))
        entries += [
            LivePosture(when, 2.5 + 1e-9 * k, 0.1 + 1e-17 * k, 1e-6, -0.0),
            scene_answer(k, seed=seed),
            LiveWeather(f"WX{k % 2 + 1}", when, 11.4, float("nan") if k % 3 else 930.86, 70.4),
        ]
        if k % 3 == 0:
            entries.append(EpochSolution(when + 50, {"points": {"ZY105": [0.1 + k, 1 / 3, None]}}, covariance))
            entries.append(Happening(when, "ZY105", "blocked", "ZY105 lost µ", "warning", {"volts": 0.4, "of": "x"}))
        if k % 5 == 0:
            entries.append(SentCommand(when, "ZY105", 1000 + k, "CIL 17", "CIL 0, not homed", False))
            entries.append(Document(when, "plan", "ZY105 -> ZEG41040L\n"))
    return entries


def plainly(entry):
    """An entry as values that compare: samples and matrices as bytes, every number by its bits."""
    if isinstance(entry, LiveShot):
        entry = AnsweredShot(entry)
    if isinstance(entry, AnsweredShot):
        samples = None if entry.shot.samples is None else np.asarray(entry.shot.samples, "<i2").tobytes()
        shot = {**vars(entry.shot), "samples": samples}
        return repr((sorted(shot.items()), entry.status, entry.text, entry.range_, entry.u_range, entry.misfit))
    if isinstance(entry, EpochSolution):
        return repr((entry.ticks, entry.text, None if entry.covariance is None else entry.covariance.tobytes()))
    return repr(entry)


class PostgresServer:
    """A server in a directory of its own, our child, reached by a socket in it; it can be killed and started again."""

    def __init__(self):
        found = sorted(Path("/usr/lib/postgresql").glob("*/bin"), key=lambda path: int(path.parent.name))
        if not found or not all((found[-1] / name).exists() for name in ("initdb", "postgres")):
            raise FileNotFoundError("PostgreSQL is not installed: no /usr/lib/postgresql/*/bin/initdb")
        self.bin = found[-1]
        self.root = Path(tempfile.mkdtemp(prefix="catseye-pg-"))
        self.who = {}
        if os.getuid() == 0:  # which PostgreSQL refuses to run as
            self.who = {"user": "postgres", "group": "postgres", "extra_groups": []}
            shutil.chown(self.root, "postgres", "postgres")
        making = [self.bin / "initdb", "--auth=trust", "--username=postgres", "--no-sync", f"--pgdata={self.root}/data"]
        subprocess.run(making, check=True, capture_output=True, cwd=self.root, timeout=MOST_WAIT, **self.who)
        self.start()

    def database(self, name):
        """The URL of a new database."""
        import psycopg

        with psycopg.connect(f"host={self.root} user=postgres dbname=postgres", autocommit=True) as connection:
            connection.execute(f'CREATE DATABASE "{name}"')
        return f"postgresql://postgres@/{name}?host={self.root}"

    def start(self):
        """Until it says that it takes connections."""
        command = [self.bin / "postgres", "-D", f"{self.root}/data", "-k", str(self.root), "-c", "listen_addresses="]
        command += ["-c", "shared_buffers=16MB", "-c", "max_connections=20"]
        self.process = subprocess.Popen(
            command,
            stderr=subprocess.PIPE,
            text=True,
            cwd=self.root,
            preexec_fn=ends_with_us(signal.SIGQUIT),  # at once, and its children and shared memory with it
            **self.who,
        )
        said = []
        for line in self.process.stderr:
            said.append(line)
            if "ready to accept connections" in line:
                break
        else:
            raise RuntimeError(f"PostgreSQL did not start: {said[-3:]}")
        self.listener = threading.Thread(target=self.process.stderr.read, daemon=True)  # or its pipe fills
        self.listener.start()

    def children(self):
        """Its processes but the first: backends, writers, checkpointer."""
        found = []
        for entry in Path("/proc").iterdir():
            with suppress(OSError, ValueError, IndexError):
                if int((entry / "stat").read_text().rpartition(")")[2].split()[1]) == self.process.pid:
                    found.append(int(entry.name))
        return found

    def kill(self):
        """kill -9 of all of its processes; returns when the first is gone."""
        children = self.children()
        self.process.kill()
        for pid in children:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self.process.wait(MOST_WAIT)
        self.listener.join(MOST_WAIT)
        self.process.stderr.close()

    def kill_backends(self):
        """kill -9 of those that serve connections."""
        for pid in self.children():
            with suppress(OSError):
                if b"postgres: postgres " in Path(f"/proc/{pid}/cmdline").read_bytes():
                    os.kill(pid, signal.SIGKILL)

    def stop(self):
        if self.process.poll() is None:
            self.kill()
        shutil.rmtree(self.root, ignore_errors=True)
