"""A living site in processes that may be killed at any time, and a client that records all."""

import os
import queue
import select
import socket
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

from catseye.clock import SystemClock
from catseye.coordinator.clients.server import PUSHED
from catseye.coordinator.journal.reader import JournalReader
from catseye.coordinator.journal.replay import replay
from catseye.coordinator.journal.sameness import Sameness
from catseye.coordinator.samplers.rings import rows_of
from catseye.ranger.addresses import ranger_addresses
from catseye.records.site.folder import read_site
from catseye.reduction.live.live import Live
from catseye.service.settings import live_settings
from cli.living_scene import PATIENCE, RUN, smallest_site
from process_scene import ends_with_us

START = 60_635.125  # MJD; night at Green Bank
GROUPS = {"feed": ("ZY101", "ZY102"), "other": ("ZY103", "ZY104")}  # one process each; the first serves the feed
RANGERS = tuple(name for names in GROUPS.values() for name in names)
STRIDE, OTHER, CLIENTS = 10, 4, 8  # ports of a base: ranger k at 10 k; the other process; the coordinator's clients
SUBSCRIBED = ("SHOT", "EPOCH", "EVENT")


class Node:
    """A command of catseye in a process of its own, started again and again; its lines go into a queue."""

    def __init__(self, *words: object):
        self.command = [*RUN, *map(str, words)]
        self.process: subprocess.Popen[str] | None = None
        self.lines: queue.Queue[str | None] = queue.Queue()
        self.said: list[str] = []

    @property
    def pid(self) -> int:
        assert self.process is not None
        return self.process.pid

    def start(self) -> None:
        self.lines, self.said, self.began = queue.Queue(), [], time.monotonic()
        self.process = subprocess.Popen(
            self.command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
            preexec_fn=ends_with_us(),
        )
        self._reader = threading.Thread(target=self._read, args=(self.process, self.lines), daemon=True)
        self._reader.start()

    @staticmethod
    def _read(process: "subprocess.Popen[str]", lines: "queue.Queue[str | None]") -> None:
        assert process.stdout is not None
        with suppress(ValueError):
            for line in process.stdout:
                lines.put(line)
        lines.put(None)

    def heard(self, text: str, timeout: float = PATIENCE) -> bool:
        """Whether a line with that text comes within the time; a process that ends instead is a mistake."""
        until = time.monotonic() + timeout
        while (left := until - time.monotonic()) > 0.0:
            try:
                line = self.lines.get(timeout=left)
            except queue.Empty:
                return False
            assert line is not None, f"{self.command[3:]} ended with {self.process.wait()}: {self.said[-3:]}"
            self.said.append(line)
            if text in line:
                return True
        return False

    def lives(self, seconds: float) -> bool:
        """Whether it is there still after so long."""
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(seconds)
        return self.process.poll() is None

    @property
    def worked(self) -> float:
        """Processor time that it has used, s: what it needs, however busy the machine is."""
        fields = Path(f"/proc/{self.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def kill(self) -> None:
        """kill -9, and wait until it is gone."""
        if self.process is not None:
            self.process.kill()
            self.process.wait(PATIENCE)
            self._reader.join(PATIENCE)
            self.process.stdout.close()
            self.process = None


@dataclass
class Heard:
    """What one coordinator process said to the client: its id, and the pushed lines, whole ones only, in order."""

    pid: int
    lines: list[tuple[str, ...]] = field(default_factory=list)

    @property
    def shots(self) -> list[tuple[str, ...]]:
        return [line for line in self.lines if line[1] == "SHOT"]


class Client:
    """A connection to the coordinator's port that has subscribed what is durable."""

    def __init__(self, port: int, heard: Heard):
        self.heard, self._rest = heard, b""
        self._socket = socket.create_connection(("127.0.0.1", port), timeout=PATIENCE)
        self._socket.sendall(b"1000\tSUBSCRIBE " + ", ".join(SUBSCRIBED).encode() + b"\n")

    def read(self, seconds: float, enough=lambda: False) -> bool:
        """Take what comes for so long, or until it is enough; whether it was. The end of the connection ends it."""
        until = time.monotonic() + seconds
        while not enough():
            left = until - time.monotonic()
            if left <= 0.0 or not select.select([self._socket], [], [], left)[0]:
                return enough()
            try:
                data = self._socket.recv(65_536)
            except ConnectionError:
                data = b""
            if not data:
                return enough()
            *whole, self._rest = (self._rest + data).split(b"\n")
            for line in whole:
                tid, _, rest = line.decode().partition("\t")
                stamp, _, body = rest.partition("\t")
                command, _, values = body.partition(" 1, ")
                if tid == "0" and command in SUBSCRIBED:
                    self.heard.lines.append((stamp, command, *values.split(", ")))
        return True

    def rest(self) -> None:
        """What the kernel has still of a coordinator that is dead."""
        self.read(PATIENCE)
        self._socket.close()


class LivingSite:
    """Two processes of rangers, and a coordinator with its journal.

    journal   file or URL
    folder    for the file of addresses
    """

    def __init__(self, journal: object, folder: Path):
        site = smallest_site()
        self.journal, self.base = journal, free_base()
        offset = SystemClock.starting_at(START).offset
        ranger_words = ("--twin", f"--start={START}", f"--clock-offset-s={offset!r}", "--json")
        self.rangers = {
            name: Node("zy", site, *names, *ranger_words, "--port-base", self.base + shift)
            for (name, names), shift in zip(GROUPS.items(), (0, OTHER), strict=True)
        }
        file = folder / "addresses.toml"
        file.write_text(addresses_toml(self.base))
        self.coordinator = Node(
            "ziy", site, "--addresses", file, "--journal", journal, "--port", self.base + CLIENTS,
            "--round-s", "5", f"--clock-offset-s={offset!r}", "--log-json",
        )  # fmt: skip
        self.heard: list[Heard] = []
        self.client: Client | None = None

    def start_coordinator(self) -> None:
        self.coordinator.start()
        self.heard.append(Heard(self.coordinator.pid))

    def connect(self) -> Client:
        """The client, once the coordinator listens."""
        assert self.coordinator.heard('"listens"')
        self.client = Client(self.base + CLIENTS, self.heard[-1])
        return self.client

    def kill_coordinator(self) -> None:
        self.coordinator.kill()
        if self.client is not None:
            self.client.rest()
            self.client = None

    def end_coordinator(self, number: int) -> int:
        """A signal that it may answer; its status."""
        self.coordinator.process.send_signal(number)
        self.client.rest()
        self.client = None
        status = self.coordinator.process.wait(PATIENCE)
        self.coordinator.kill()  # nothing is left to kill; its pipe is closed
        return status

    def measuring(self, rangers=RANGERS) -> float:
        """Until a shot of each of some rangers that is fired from now on is acknowledged; s that it took."""
        since, have = time.monotonic(), len(self.heard[-1].lines)

        def all_shot() -> bool:
            return {line[3] for line in self.heard[-1].lines[have:] if line[1] == "SHOT"} >= set(rangers)

        assert self.client.read(PATIENCE, all_shot), f"{rangers} do not measure: {self.heard[-1].lines[have:][-9:]}"
        return time.monotonic() - since

    def stop(self) -> None:
        for node in (self.coordinator, *self.rangers.values()):
            node.kill()
        if self.client is not None:
            self.client.rest()


@contextmanager
def living_site(journal: object, folder: Path) -> Iterator[LivingSite]:
    made = LivingSite(journal, folder)
    try:
        for node in made.rangers.values():
            node.start()
        for node in made.rangers.values():
            assert node.heard('"rangers"')
        made.start_coordinator()
        made.connect()
        made.measuring()
        yield made
    finally:
        made.stop()


def addresses_toml(base: int) -> str:
    """Where the coordinator finds its rangers and the feed."""
    lines = ['format = "catseye-addresses-1"', f'feed = "127.0.0.1:{base}"']
    for names, shift in zip(GROUPS.values(), (0, OTHER), strict=True):
        where = ranger_addresses(read_site(smallest_site()), base + shift)
        for name in names:
            host, *ports = where[name]
            lines += ["[[ranger]]", f'name = "{name}"', f'host = "{host}"', f"ports = {ports}"]
    return "\n".join(lines) + "\n"


def free_base() -> int:
    """A base whose ports are free, below those that the system gives to connections: they stay ours between kills."""
    for step in range(100):
        base = 10_000 + (os.getpid() * 113 + step * 200) % 20_000
        wanted = [base, base + OTHER, base + CLIENTS]
        wanted += [base + STRIDE * k + more for k in range(1, 5) for more in (0, 1, OTHER, OTHER + 1)]
        try:
            for port in wanted:
                with closing(socket.create_server(("127.0.0.1", port))):
                    pass
        except OSError:
            continue
        return base
    raise OSError("no free ports")


def told_of(reader: JournalReader, run: int) -> list[tuple[str, ...]]:
    """What a client would have been pushed of a run, had it been there all the while."""
    return [
        (stamp, PUSHED[sampler], *values)
        for _, entry in reader.events(run, buffers=False)
        for sampler, (stamp, *values) in rows_of(entry)
        if PUSHED.get(sampler) in SUBSCRIBED
    ]


def stretches(lines: list[tuple[str, ...]], of: list[tuple[str, ...]]) -> bool:
    """Whether lines stand in a list as they are, none left out between them."""
    return any(of[at : at + len(lines)] == lines for at in range(len(of) - len(lines) + 1))


class Answers(Live):
    """A reduction that keeps what it answered."""

    def __init__(self, *given):
        super().__init__(*given)
        self.said: list[tuple[str, ...]] = []

    def shot(self, shot):
        answer = super().shot(shot)
        self.said.append((str(shot.number), answer.status, answer.text, *map(repr, _numbers(answer))))
        return answer


def replays(reader: JournalReader, run: int) -> int:
    """Assert that a run's answers come out again to the last bit, behind its last epoch too; how many epochs."""
    made: list[Answers] = []

    def factory(site, stored) -> Answers:
        made.append(Answers(site, live_settings(stored.settings, "run")))
        return made[-1]

    epochs = list(replay(reader, run, factory))
    assert [each.seq for each in epochs if each.sameness is not Sameness.IDENTICAL] == []
    stored = [
        (str(entry.shot.number), entry.status, entry.text, *map(repr, _numbers(entry)))
        for _, entry in reader.shots(run, buffers=False)
        if entry.status != "refused"
    ]
    assert made[0].said == stored
    return len(epochs)


def _numbers(answer) -> tuple[float, ...]:
    return float(answer.range_), float(answer.u_range), float(answer.misfit)
