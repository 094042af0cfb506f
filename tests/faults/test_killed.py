"""kill -9 of coordinator, rangers and database at random moments: what was acknowledged is there, once, and replays.

Real processes: two of rangers, a coordinator, a client that notes each line pushed, a PostgreSQL server. A killed part
is started again at once; the others stay.
"""

import os
import random
import select
import signal
import subprocess
import time
from collections import Counter
from contextlib import suppress
from pathlib import Path

import pytest

from catseye.coordinator.journal.reader import JournalReader
from catseye.coordinator.journal.writer import PATIENCE as PATIENCE_OF_JOURNAL
from catseye.coordinator.journal.writer import Journal
from catseye.service.journals import checked
from catseye.simulator.clock.world_clock import ManualClock
from cli.living_scene import PATIENCE, RUN, small_site, started
from faults.system_scene import GROUPS, RANGERS, free_base, living_site, replays, stretches, told_of
from journal_scene import PostgresServer, scene_run
from process_scene import ends_with_us

UP = 5.0  # s from a coordinator's start until all rangers that stayed are ready again, the issue's


@pytest.fixture(scope="module")
def server():
    pytest.importorskip("psycopg", reason="psycopg is not installed: the extra catseye[postgresql]")
    try:
        made = PostgresServer()
    except FileNotFoundError as problem:
        pytest.skip(str(problem))
    yield made
    made.stop()


class Killer:
    """Kills one part at a moment drawn, starts it again, and waits until it measures; keeps the times, s."""

    def __init__(self, site, seed, server=None, longest=1.5):
        self.site, self.server, self.draw, self.longest = site, server, random.Random(seed), longest
        self.times = {}

    def kill(self, kind):
        getattr(self, kind)()

    def _noted(self, kind, seconds):
        self.times.setdefault(kind, []).append(seconds)

    def _a_while(self):
        """A time drawn; every second one ends just when something is acknowledged, which must be durable by then."""
        self.site.client.read(self.draw.uniform(0.0, self.longest))
        heard, have = self.site.heard[-1], len(self.site.heard[-1].lines)
        if self.draw.random() < 0.5:
            assert self.site.client.read(PATIENCE, lambda: len(heard.lines) > have)

    def coordinator(self):
        self._a_while()
        self.site.kill_coordinator()
        self.site.start_coordinator()
        self.site.connect()
        began = self.site.coordinator.began
        self._noted("listens", time.monotonic() - began)
        heard = self.site.heard[-1]
        assert self.site.client.read(PATIENCE, lambda: ready(heard) >= set(RANGERS)), heard.lines
        self._noted("ready", time.monotonic() - began)
        self._noted("processor until ready", self.site.coordinator.worked)
        assert self.site.client.read(PATIENCE, lambda: heard.shots), heard.lines
        self._noted("acknowledged", time.monotonic() - began)

    def starting_coordinator(self):
        """Once while it measures, and again while it starts: it may have a run in the journal by then, or not."""
        self._a_while()
        self.site.kill_coordinator()
        self.site.start_coordinator()
        assert self.site.coordinator.lives(self.draw.uniform(0.0, 2.5))
        self.site.kill_coordinator()
        self.site.start_coordinator()
        self.site.connect()
        assert self.site.client.read(PATIENCE, lambda: self.site.heard[-1].shots)

    def ranger(self):
        name = self.draw.choice(list(GROUPS))
        self._a_while()
        node = self.site.rangers[name]
        node.kill()
        node.start()
        assert node.heard('"rangers"')
        self._noted("ranger listens", time.monotonic() - node.began)
        self.site.measuring(GROUPS[name])
        self._noted("ranger acknowledged", time.monotonic() - node.began)

    def backup(self):
        """A copy under way: there is none under its name, or a whole one; the next one ends while shots go on."""
        copy = Path(self.site.journal).with_name("copy.db")
        words = [*RUN, "journal", "backup", str(self.site.journal), str(copy), "--quiet"]
        process = subprocess.Popen(words, preexec_fn=ends_with_us())
        with suppress(subprocess.TimeoutExpired):
            process.wait(self.draw.uniform(0.0, 2.5))
        process.kill()
        process.wait(PATIENCE)
        if copy.exists():
            assert_checks(copy)
            copy.unlink()
        since = time.monotonic()
        subprocess.run(words, check=True, timeout=PATIENCE)
        self._noted("backup", time.monotonic() - since)
        assert_checks(copy)
        copy.unlink()
        assert not list(copy.parent.glob(".copy.db*"))  # what the killed one left is gone

    def database(self):
        self._a_while()
        self.server.kill()
        since = time.monotonic()
        self.server.start()
        self._noted("database starts", time.monotonic() - since)
        self.site.measuring(RANGERS[:1])
        self._noted("database acknowledged", time.monotonic() - since)

    def outage(self):
        """Longer than the journal is patient: what waits is told not to be durable, and is written all the same."""
        self._a_while()
        self.server.kill()
        self.site.client.read(PATIENCE_OF_JOURNAL + 1.0)
        self.server.start()
        self.site.measuring(RANGERS[:1])

    def backend(self):
        self._a_while()
        self.server.kill_backends()
        since = time.monotonic()
        self.site.measuring(RANGERS[:1])
        self._noted("backend acknowledged", time.monotonic() - since)


def ready(heard):
    """Rangers that a coordinator has told to be ready."""
    return {line[3] for line in heard.lines if line[1:2] == ("EVENT",) and line[4] == "ready"}


def assert_checks(place, heads=(), run=None):
    """Each event of a journal is as it was written, and each head that was told is in its chain."""
    reports, _ = checked(str(place), run, heads, None, progress=lambda *_: None)
    assert [report.problems for report in reports] == [[]] * len(reports)
    assert sum(report.heads for report in reports) == len(heads)


def heads_of(heard):
    """Heads of the chain that a coordinator told behind its epochs."""
    told = [line[5] for line in heard.lines if line[1] == "EVENT" and line[4] == "journal-head"]
    return [text.split()[1] for text in told]


def assert_nothing_lost(place, heard):
    """What each coordinator pushed is in its run as it was pushed; each shot is there once and whole; runs replay, and
    their chains check, with each head that was told before a kill.

    Returns shots acknowledged, shots in the journal, runs, epochs replayed.
    """
    acknowledged = stored = epochs = 0
    with JournalReader(place) as reader:
        runs = {run.pid: run for run in reader.runs()}
        assert len(runs) == len(reader.runs())
        for each in heard:
            if each.lines:
                assert stretches(each.lines, told_of(reader, runs[each.pid].run)), f"run {runs[each.pid].run}"
                assert_checks(place, heads_of(each), runs[each.pid].run)
            acknowledged += len(each.shots)
        for run in runs.values():
            shots = [entry.shot for _, entry in reader.shots(run.run)]
            bare = {shot.ranger for shot in shots if shot.samples is None}  # killed between CMEAS and BUF, and told so
            assert bare <= {e.who for _, e in reader.events(run.run, kinds=["happenings"]) if e.kind == "no-buffer"}
            whole = [shot for shot in shots if shot.samples is not None]
            assert all(len(shot.samples) == shot.cycles * shot.samples_per_cycle > 0 for shot in whole)
            assert [shot.number for shot in shots] == list(range(1, len(shots) + 1))
            once = Counter((shot.ranger, shot.ticks, shot.target) for shot in shots)
            assert set(once.values()) <= {1}
            stored += len(shots)
            epochs += replays(reader, run.run)
    return acknowledged, stored, len(runs), epochs


def assert_another_may_write(place):
    """No lock is left, and the next run counts as the last."""
    with JournalReader(place) as reader:
        before = reader.runs()[-1].run
        assert reader.run().ended is None  # it was killed
    with Journal.open(place, run=scene_run(), clock=ManualClock(60_635.2)) as journal:
        assert journal.run > before  # PostgreSQL leaves out up to 32 numbers when it was killed


def killed(place, folder, kinds, seed, server=None, longest=1.5):
    with living_site(place, folder) as site:
        killer = Killer(site, seed, server, longest)
        for kind in kinds:
            killer.kill(kind)
        site.measuring()
    assert all(heard.shots for heard in site.heard[-1:])
    counts = assert_nothing_lost(place, site.heard)
    assert_another_may_write(place)
    return killer.times, counts


def test_killed_coordinator_and_rangers_lose_and_duplicate_nothing(tmp_path):
    times, (acknowledged, stored, runs, _) = killed(
        tmp_path / "j.db", tmp_path, ["coordinator", "ranger", "backup", "starting_coordinator"], seed=1
    )
    assert runs in (3, 4)  # the one killed while it started may have begun a run
    assert 12 <= acknowledged <= stored
    assert max(times["processor until ready"]) < UP  # by the clock on the wall it counts what others do meanwhile


@pytest.mark.slow  # the server alone is killed in test_journal_killed.py, the site with a file above
def test_killed_database_loses_and_duplicates_nothing(server, tmp_path):
    _, (acknowledged, stored, runs, _) = killed(
        server.database("system"), tmp_path, ["outage", "coordinator", "backend", "database"], seed=2, server=server
    )
    assert runs == 2
    assert 12 <= acknowledged <= stored


@pytest.mark.slow
def test_terminated_coordinator_leaves_one_complete_file(tmp_path):
    """SIGTERM, as a service's, status 0, and Ctrl-C, 130, while it measures: within the contract's five seconds."""
    (tmp_path / "out").mkdir()
    place = tmp_path / "out" / "j.db"
    with living_site(place, tmp_path) as site:
        for number, status in ((signal.SIGTERM, 0), (signal.SIGINT, 130)):
            since = time.monotonic()
            assert site.end_coordinator(number) == status
            assert (
                time.monotonic() - since < 2.0 * UP
            )  # after 4.5 s it leaves by force; on a busy machine that takes time
            assert [path.name for path in place.parent.iterdir()] == ["j.db"]
            if number == signal.SIGTERM:
                site.start_coordinator()
                site.connect()
                site.measuring()
    assert_nothing_lost(place, site.heard)
    with JournalReader(place) as reader:
        assert all(run.ended is not None for run in reader.runs())


@pytest.mark.slow
def test_killed_site_leaves_no_twin(tmp_path):
    words = ["serve", small_site(), "--twin", "--no-page", "--port-base", free_base(), "--port", "0", "--log-json"]
    with started(*words, home=tmp_path) as process:
        while "rangers and the feed listen" not in (line := process.stderr.readline()):
            assert line
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        assert len(children) == 1
        gone = os.pidfd_open(int(children[0]))
        process.kill()
        assert select.select([gone], [], [], PATIENCE)[0]
        os.close(gone)


# more than two hundred kills: one that hits a coordinator while it starts comes behind one that made it start
OF_A_FILE = {"coordinator": 25, "starting_coordinator": 20, "ranger": 35, "backup": 20}
OF_A_SERVER = {"coordinator": 10, "starting_coordinator": 5, "ranger": 10, "database": 40, "outage": 5, "backend": 25}


def mixed(moments, seed):
    """Each kind as often as it is said, in an order drawn."""
    kinds = [kind for kind, count in moments.items() for _ in range(count)]
    random.Random(seed).shuffle(kinds)
    return kinds


def assert_quick(times):
    """All by the processor's time, one by the clock on the wall, which counts what else the machine has to do."""
    assert min(times["ready"]) < UP
    assert max(times["processor until ready"]) < UP


@pytest.mark.slow
def test_file_journal_survives_a_hundred_kills(tmp_path):
    times, counts = killed(tmp_path / "j.db", tmp_path, mixed(OF_A_FILE, 3), seed=3)
    assert_quick(times)
    assert counts[0] > 1000


@pytest.mark.slow
def test_server_journal_survives_a_hundred_kills(server, tmp_path):
    kinds = mixed(OF_A_SERVER, 4)
    # A database that is down holds up what a file would have taken: longer between two kills.
    times, counts = killed(server.database("hundred"), tmp_path, kinds, seed=4, server=server, longest=6.0)
    assert_quick(times)
    assert counts[0] > 1000
