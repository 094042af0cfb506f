"""kill -9 of the writer or the database server: nothing acknowledged is lost or doubled."""

import os
import random
import subprocess
import sys
import threading
import time
from collections import Counter
from contextlib import suppress
from pathlib import Path

import pytest

from catseye.coordinator.journal.reader import JournalReader
from catseye.coordinator.journal.writer import Journal, JournalSettings
from catseye.simulator.clock.world_clock import ManualClock
from draws import draws
from journal_scene import MOST_WAIT, PostgresServer, plainly, scene_answer, scene_run
from process_scene import ends_with_us

CHILD = Path(__file__).with_name("journal_child.py")
REOPENED = 5.0  # s, what a restarted coordinator may take


@pytest.fixture(scope="module")
def server():
    pytest.importorskip("psycopg", reason="psycopg is not installed: the extra catseye[postgresql]")
    try:
        made = PostgresServer()
    except FileNotFoundError as problem:
        pytest.skip(str(problem))
    yield made
    made.stop()


def killed_at(place, first, wanted, spin):
    """A child is killed once it acknowledged so many, and `spin` s later; its run and what it acknowledged."""
    child = subprocess.Popen(
        [sys.executable, str(CHILD), str(place), str(first)],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(CHILD.parents[1])},
        preexec_fn=ends_with_us(),
    )
    run = int(child.stdout.readline().split()[1])
    lines = [child.stdout.readline() for _ in range(wanted)]
    with suppress(subprocess.TimeoutExpired):
        child.wait(spin)  # a moment at random
    child.kill()
    lines += child.stdout.readlines()
    child.stdout.close()
    child.wait(MOST_WAIT)
    return run, [tuple(map(int, line.split())) for line in lines if line.endswith("\n")]


def assert_all_there(place, run, first, acknowledged):
    """Each acknowledged number once, at its seq; whatever else is there was appended, in order and whole."""
    with JournalReader(place) as reader:
        found = [(entry.shot.number, seq, plainly(entry)) for seq, entry in reader.shots(run)]
        assert reader.run(run).ended is None
    assert [number for number, _, _ in found] == list(range(first, first + len(found)))
    assert set(acknowledged) <= {(number, seq) for number, seq, _ in found}
    assert all(text == plainly(scene_answer(number)) for number, _, text in found)


def kill_and_look(place, times, seed):
    draw, first, runs, before = random.Random(seed), 1, [], 0
    for _ in range(times):
        run, acknowledged = killed_at(place, first, draw.randrange(1, 120), draw.uniform(0.0, 0.02))
        assert len(acknowledged) >= 1
        runs.append((run, first, acknowledged))
        since = time.monotonic()
        with Journal.open(place, run=scene_run(), clock=ManualClock(52889.2)) as journal:
            journal.append(scene_answer(0)).result(MOST_WAIT)
        assert time.monotonic() - since < REOPENED
        assert run > before
        before = journal.run
        first += 1000
    for run, began, acknowledged in runs:  # what later runs and kills did has touched none of it
        assert_all_there(place, run, began, acknowledged)


@draws(8, name="times")
def test_killed_writer_loses_and_duplicates_nothing(tmp_path, times):
    kill_and_look(tmp_path / "j.db", times, seed=1)


@pytest.mark.slow
def test_writer_killed_200_times_loses_and_duplicates_nothing(tmp_path):
    for seed in range(10):
        kill_and_look(tmp_path / f"{seed}.db", 20, seed)


@draws(3, quick=2, name="times")
def test_killed_writer_to_a_server_loses_and_duplicates_nothing(server, times):
    kill_and_look(server.database(f"killed-{times}"), times, seed=2)


def server_killed(server, name, times, seed):
    """The server and its backends are killed while shots come; the writer stays and goes on by itself."""
    draw, told = random.Random(seed), []
    ends = threading.Event()
    appended, acknowledged = [], Counter()
    free = threading.Semaphore(30)
    url = server.database(name)
    journal = Journal.open(
        url,
        run=scene_run(),
        clock=ManualClock(52889.125),
        settings=JournalSettings(group=0.001, patience=MOST_WAIT),
        on_alarm=lambda text: told.append(("alarm", text)),
        on_recovery=lambda text: told.append(("back", text)),
    )

    def done(number, future):
        if future.exception() is None:
            acknowledged[number] += 1
        free.release()

    def feed():
        while not ends.is_set():
            free.acquire()
            number = len(appended)
            appended.append(number)
            journal.append(scene_answer(number)).add_done_callback(lambda future, number=number: done(number, future))

    feeder = threading.Thread(target=feed)
    feeder.start()
    for _ in range(times):
        seen = sum(acknowledged.values()) + draw.randrange(20, 200)
        until = time.monotonic() + MOST_WAIT
        while sum(acknowledged.values()) < seen:
            assert time.monotonic() < until
            ends.wait(0.001)
        server.kill()
        server.start()
    ends.set()
    feeder.join(MOST_WAIT)
    journal.append().result(MOST_WAIT)
    assert journal.trouble is None
    journal.close()
    with JournalReader(url) as reader:
        assert [shot.shot.number for _, shot in reader.shots(1)] == appended
        assert [seq for seq, _ in reader.shots(1)] == [number + 1 for number in appended]
    assert acknowledged == Counter(appended)
    assert [kind for kind, _ in told] == ["alarm", "back"] * times
    assert all("writing failed, retrying" in text for kind, text in told if kind == "alarm")


def test_killed_server_loses_nothing(server):
    server_killed(server, "restarted", 4, seed=3)


@pytest.mark.slow
def test_often_killed_server_loses_nothing(server):
    server_killed(server, "often", 25, seed=4)


def test_killed_backend_loses_nothing(server):
    """Only the process that serves us: the postmaster then restarts all of them by itself."""
    url = server.database("backend")
    told = []
    with Journal.open(
        url,
        run=scene_run(),
        clock=ManualClock(52889.125),
        settings=JournalSettings(patience=MOST_WAIT),
        on_alarm=told.append,
    ) as journal:
        for k in range(3):
            journal.append(scene_answer(2 * k)).result(MOST_WAIT)
            server.kill_backends()
            assert journal.append(scene_answer(2 * k + 1)).result(MOST_WAIT) == 2 * k + 2
    assert len(told) == 3
    with JournalReader(url) as reader:
        assert [shot.shot.number for _, shot in reader.shots(1)] == list(range(6))
