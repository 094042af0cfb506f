"""Journal writer: content, order, refusals."""

import asyncio
import os
import sqlite3
import subprocess
import sys
import threading
from concurrent.futures import wait

import numpy as np
import pytest
from sqlalchemy import event
from sqlalchemy.exc import OperationalError

from catseye.coordinator.journal.place import place_of, reading_engine
from catseye.coordinator.journal.reader import JournalReader
from catseye.coordinator.journal.writer import MOST_WAITING, Journal, JournalSettings
from catseye.errors import InputError
from catseye.records.night.live import Happening, LiveWeather
from catseye.simulator.clock.world_clock import ManualClock
from journal_scene import (
    MOST_WAIT,
    START,
    PostgresServer,
    plainly,
    scene_answer,
    scene_entries,
    scene_run,
    scene_shot,
    scene_site,
)
from repository import TESTS


@pytest.fixture(scope="module")
def server():
    pytest.importorskip("psycopg", reason="psycopg is not installed: the extra catseye[postgresql]")
    try:
        made = PostgresServer()
    except FileNotFoundError as problem:
        pytest.skip(str(problem))
    yield made
    made.stop()


@pytest.fixture(params=["sqlite", "postgresql"])
def place(request, tmp_path):
    """A fresh place of each kind."""
    if request.param == "sqlite":
        return str(tmp_path / "j.db")
    return request.getfixturevalue("server").database(f"j{abs(hash(tmp_path)):x}")


def opened(place, **more):
    return Journal.open(place, **{"run": scene_run(), "clock": ManualClock(START / 1e8), **more})


def stored(place, run=None, **more):
    with JournalReader(place) as reader:
        return list(reader.events(reader.run(run).run, **more))


@pytest.mark.parametrize("compress", [False, True])
def test_entries_survive_the_round_trip_in_order_to_the_last_bit(place, compress):
    entries = scene_entries(40)
    with opened(place, settings=JournalSettings(compress=compress)) as journal:
        futures = [journal.append(entry) for entry in entries]
        assert [future.result(MOST_WAIT) for future in futures] == list(range(1, len(entries) + 1))
    found = stored(place)
    assert [seq for seq, _ in found] == list(range(1, len(entries) + 1))
    assert [plainly(entry) for _, entry in found] == [plainly(entry) for entry in entries]


def test_special_numbers_survive_the_round_trip(place):
    weather = [
        LiveWeather("WX1", START, -0.0, 5e-324, 1e308),
        LiveWeather("WX1", START + 1, float("nan"), float("inf"), float("-inf")),
        LiveWeather("WX1", START + 2, 0.1 + 0.2, np.nextafter(1.0, 2.0), np.float64(1 / 3)),
    ]
    strange = Happening(START, "ZY105", "odd", "nul \0 and half a pair \ud800, ok \U0001f63a", "note", {"v": np.inf})
    with opened(place) as journal:
        journal.append(*weather, strange).result(MOST_WAIT)
    *back, text = (entry for _, entry in stored(place))
    bits = [np.array([w.temperature_c, w.pressure_hpa, w.humidity_percent]).tobytes() for w in (*weather, *back)]
    assert bits[:3] == bits[3:]
    assert text.text == "nul \\x00 and half a pair \\ud800, ok \U0001f63a"
    assert float(text.details["v"]) == np.inf
    with reading_engine(place_of(place)).connect() as connection:  # for whoever asks the database itself
        nulls = connection.exec_driver_sql("SELECT count(*) FROM weather WHERE temperature_c IS NULL").scalar()
    assert nulls == 1


def test_run_record_has_its_start(place):
    clock = ManualClock(START / 1e8)
    journal = opened(place, run=scene_run(seed=7, extra={"plan.txt": "no\r\nplan\n"}), clock=clock)
    clock.advance(86.4)
    journal.close()
    with JournalReader(place) as reader:
        run = reader.run()
        site = scene_site()
        assert (run.run, run.site, run.seed, run.settings["solve_every"]) == (1, "night-01", 7, 0.5)
        assert (run.started, run.ended) == (START, START + 100_000)  # 1e-3 day
        assert run.pid == os.getpid()
        assert run.versions["numpy"] == np.__version__
        wanted = {path: digest for path, digest in site.hashes.items() if path in run.hashes}
        assert {path: digest for path, digest in run.hashes.items() if path != "plan.txt"} == wanted
        assert len(wanted) == 4 + len(site.monuments) + len(site.mirrors) + len(site.triplets)
        assert reader.files(run.run)["plan.txt"] == "no\r\nplan\n"
        again = reader.site(run.run)
        assert {path: again.hashes[path] for path in wanted} == wanted
        assert again.rangers == site.rangers


def test_site_changed_on_disk_is_stored_as_read(tmp_path):
    import shutil

    from catseye.coordinator.journal.entries import Run
    from catseye.records.site.folder import read_site
    from journal_scene import NIGHT

    folder = tmp_path / "site"
    shutil.copytree(NIGHT, folder, ignore=shutil.ignore_patterns("frames.npy"))
    site = read_site(folder)
    text = (folder / "site.toml").read_text()
    (folder / "site.toml").write_text(text.replace("azimuth_deg = 145.3", "azimuth_deg = 99.9"))
    with opened(tmp_path / "j.db", run=Run(site)):
        pass
    with JournalReader(tmp_path / "j.db") as reader:
        assert reader.site(1).site.campaign.azimuth_deg == 145.3


def test_second_run_is_added_to_the_journal(place):
    for number in (1, 2, 3):
        with opened(place) as journal:
            assert journal.run == number
            journal.append(scene_answer(number)).result(MOST_WAIT)
    with JournalReader(place) as reader:
        assert [run.run for run in reader.runs()] == [1, 2, 3]
        assert [entry.shot.number for run in (1, 2, 3) for _, entry in reader.shots(run)] == [1, 2, 3]
        assert len(reader.files(3)) == len(reader.files(1))
        assert reader.run(reader.runs()[1].uuid[:20]).run == 2
        for missing in (0, 4, "no such"):
            with pytest.raises(InputError, match=r"names 0 runs \(it contains runs 1 to 3\)"):
                reader.run(missing)


def test_samples_can_be_left_out(tmp_path):
    with opened(tmp_path / "j.db", settings=JournalSettings(keep_buffers=False)) as journal:
        journal.append(scene_shot(3)).result(MOST_WAIT)
    ((_, taken),) = stored(tmp_path / "j.db")
    assert (taken.shot.samples, taken.shot.amplitude, taken.shot.phase) == (None, 1.5, 0.30000000000000004)
    with JournalReader(tmp_path / "j.db") as reader:
        assert reader.run().buffers is False


def test_appends_from_many_threads_are_ordered_and_not_torn(place):
    """Each thread's appends stay in its order; the pair of one append has neighbouring numbers."""
    taken, futures = {}, []

    def feed(who):
        for k in range(60):
            number = 1000 * who + k
            pair = scene_answer(number, ranger=f"ZY10{who}"), Happening(START + k, f"ZY10{who}", "n", str(number))
            future = journal.append(*pair)
            futures.append(future)
            taken[number] = future

    with opened(place) as journal:
        threads = [threading.Thread(target=feed, args=(who,)) for who in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        wait(futures, MOST_WAIT)
    entries = stored(place)
    assert [seq for seq, _ in entries] == list(range(1, 481))
    seqs = {}
    for (one, shot), (two, happening) in zip(entries[::2], entries[1::2], strict=True):
        assert two == one + 1
        assert happening.text == str(shot.shot.number)
        seqs[shot.shot.number] = two
    assert seqs == {number: future.result() for number, future in taken.items()}
    for who in range(4):
        own = [seqs[1000 * who + k] for k in range(60)]
        assert own == sorted(own)


def test_empty_append_waits_for_all_before(tmp_path):
    with opened(tmp_path / "j.db") as journal:
        first = [journal.append(entry) for entry in scene_entries(30)]
        journal.append().result(MOST_WAIT)
        assert all(future.done() for future in first)


def test_entries_arriving_together_share_a_commit(tmp_path):
    """150 appends at once in at most a few transactions, not 150: the group waits a second, or until it is full."""
    commits = []
    with opened(tmp_path / "j.db", settings=JournalSettings(group=0.2, keep_buffers=False)) as journal:
        event.listen(journal._engine, "commit", commits.append)
        wait([journal.append(scene_shot(k)) for k in range(150)], MOST_WAIT)
        together = len(commits)
    assert 1 <= together <= 3


def test_durable_can_be_awaited(tmp_path):
    async def fed(journal):
        await asyncio.gather(*(journal.durable(scene_shot(k)) for k in range(5)))

    with opened(tmp_path / "j.db") as journal:
        asyncio.run(fed(journal))
        assert sorted(entry.shot.number for _, entry in stored(tmp_path / "j.db")) == list(range(5))


def test_journal_is_readable_while_written(place):
    with opened(place) as journal, JournalReader(place) as reader:
        for k in range(30):
            seq = journal.append(scene_answer(k)).result(MOST_WAIT)
            assert reader.last(1) == seq
            ((_, entry),) = reader.events(1, after=seq - 1)
            assert entry.shot.number == k


def test_duplicate_shot_is_refused_without_cost_to_others(place):
    """The same ranger, time and target twice, in the middle of a group that is written at once."""
    with opened(place, settings=JournalSettings(group=0.2)) as journal:
        futures = [journal.append(scene_shot(k)) for k in range(5)]
        twice = journal.append(scene_shot(2, seed=1))
        futures += [journal.append(scene_shot(k)) for k in range(5, 10)]
        with pytest.raises(InputError, match="expected unique shots"):
            twice.result(MOST_WAIT)
        assert [future.result(MOST_WAIT) for future in futures] == [1, 2, 3, 4, 5, 7, 8, 9, 10, 11]
        assert journal.trouble is None
    assert [plainly(entry) for _, entry in stored(place)] == [plainly(scene_shot(k)) for k in range(10)]


def test_commit_with_a_lost_reply_is_stored_once(place, monkeypatch):
    """The database has it, we do not know: it is sent again, with what came meanwhile."""
    store, lost = Journal._store, []

    def losing(journal, batches):
        store(journal, batches)
        if len(lost) < 2:
            lost.append(len(batches))
            raise OperationalError("COMMIT", {}, ConnectionResetError("the reply was lost"))

    monkeypatch.setattr(Journal, "_store", losing)
    entries = scene_entries(10)
    with opened(place, settings=JournalSettings(patience=MOST_WAIT)) as journal:
        futures = [journal.append(entry) for entry in entries]
        assert [future.result(MOST_WAIT) for future in futures] == list(range(1, len(entries) + 1))
    assert len(lost) == 2
    assert [plainly(entry) for _, entry in stored(place)] == [plainly(entry) for entry in entries]


def test_invalid_entries_are_refused_at_once(tmp_path):
    with opened(tmp_path / "j.db") as journal:
        for bad, text in (
            ("a shot", "a str cannot be journalled"),
            (scene_shot(1, ticks=2**63), "does not fit 64 bits"),
            (Happening(START, "x", "y", "z", "note", {"k": object()}), "a detail that JSON cannot hold"),
        ):
            with pytest.raises(InputError, match=text):
                journal.append(scene_shot(1), bad)
        assert journal.append(scene_shot(1)).result(MOST_WAIT) == 1
    assert len(stored(tmp_path / "j.db")) == 1


def test_full_queue_refuses_and_recovers(tmp_path):
    """While another process holds the file, nothing is written; the line is bounded, and what it took is kept."""
    with opened(tmp_path / "j.db", settings=JournalSettings(patience=MOST_WAIT)) as journal:
        other = sqlite3.connect(tmp_path / "j.db", isolation_level=None)
        other.execute("BEGIN EXCLUSIVE")
        reads = [LiveWeather("WX1", START + k, 1.0, 2.0, 3.0) for k in range(1000)]
        took = [journal.append(*reads) for _ in range(MOST_WAITING // 1000)]
        with pytest.raises(InputError, match=f"{MOST_WAITING} rows are queued for the journal"):
            journal.append(scene_shot(1))
        other.rollback()
        other.close()
        assert took[-1].result(MOST_WAIT) == MOST_WAITING
        journal.append(scene_shot(1)).result(MOST_WAIT)
    with JournalReader(tmp_path / "j.db") as reader:
        assert reader.last(1) == MOST_WAITING + 1


def test_closed_journal_refuses_entries_and_is_one_file(tmp_path):
    journal = opened(tmp_path / "j.db")
    late = [journal.append(entry) for entry in scene_entries(20)]
    journal.close()
    journal.close()
    assert all(future.result(0) for future in late)
    assert [path.name for path in tmp_path.iterdir()] == ["j.db"]
    with pytest.raises(InputError, match="is closed"):
        journal.append(scene_shot(1))


@pytest.mark.parametrize(
    ("url", "text"),
    [
        ("mysql://u:secret@h/db", r"journal mysql://.*is unusable \(expected a file's name"),
        ("sqlite://", "is unusable"),
        ("sqlite:///:memory:", "is unusable"),
        ("postgresql://u:secret@h/", "is unusable"),
        ("://", "is not a URL"),
        ("postgresql://u:secret@[::1/db", "is not a URL"),
        ("postgresql://u:secret@127.0.0.1:1/db", "journal postgresql://u:.*@127.0.0.1:1/db: .*refused"),
    ],
)
def test_invalid_url_is_refused_in_one_line_without_its_password(url, text):
    with pytest.raises(InputError, match=text) as caught:
        opened(url)
    assert "secret" not in str(caught.value)
    assert "\n" not in str(caught.value)


def made_by_others(path, *statements):
    connection = sqlite3.connect(path)
    for statement in statements:
        connection.execute(statement)
    connection.commit()
    connection.close()


def test_foreign_files_are_refused_and_unchanged(tmp_path):
    (tmp_path / "text.db").write_text("shot,mjd_utc\n1,2\n")
    made_by_others(tmp_path / "other.db", "CREATE TABLE shots (a)", "INSERT INTO shots VALUES (1)")
    made_by_others(tmp_path / "alike.db", "CREATE TABLE journal (format TEXT, words TEXT)")
    made_by_others(
        tmp_path / "newer.db",
        "CREATE TABLE journal (format TEXT, version INT)",
        "INSERT INTO journal VALUES ('catseye-journal', 3)",
    )
    (tmp_path / "folder.db").mkdir()
    cases = {
        "text.db": "it starts with b'shot,mjd_utc",
        "other.db": "it has other tables, such as 'shots'",
        "alike.db": "it has other tables, such as 'journal'",
        "newer.db": "version 3 is newer than 2",
        "folder.db": "is not a file",
        "no/such.db": "directory .*no is missing",
    }
    for name, text in cases.items():
        before = (tmp_path / name).read_bytes() if (tmp_path / name).is_file() else None
        with pytest.raises(InputError, match=text):
            opened(tmp_path / name)
        if before is not None:
            assert (tmp_path / name).read_bytes() == before
    assert {path.name for path in tmp_path.iterdir()} == {*cases} - {"no/such.db"}


def test_database_with_other_tables_is_refused(server):
    import psycopg

    url = server.database("others")
    with psycopg.connect(url, autocommit=True) as connection:
        connection.execute("CREATE TABLE shots (a int)")
    with pytest.raises(InputError, match="it has other tables, such as 'shots'"):
        opened(url)


@pytest.mark.parametrize("does", ["SELECT RAISE(IGNORE)", "UPDATE shots SET range_m = 0"])
def test_a_file_with_triggers_is_refused(tmp_path, does):
    """Attack: a trigger ignored each shot, and its future said that it was durable."""
    with opened(tmp_path / "j.db") as journal:
        journal.append(scene_shot(1)).result(MOST_WAIT)
    connection = sqlite3.connect(tmp_path / "j.db")
    connection.execute(f"CREATE TRIGGER t BEFORE INSERT ON shots BEGIN {does}; END")
    connection.commit()
    connection.close()
    with pytest.raises(InputError, match="has a trigger, 't', which catseye never makes"):
        opened(tmp_path / "j.db")


def test_older_journal_is_converted(tmp_path, monkeypatch):
    from catseye.coordinator.journal import tables as journal_tables

    with opened(tmp_path / "j.db") as journal:
        journal.append(scene_shot(1)).result(MOST_WAIT)
    monkeypatch.setattr(journal_tables, "VERSION", 3)
    step = "CREATE TABLE added (a INTEGER)"
    monkeypatch.setattr(
        journal_tables, "STEPS", (*journal_tables.STEPS, lambda connection: connection.exec_driver_sql(step))
    )
    for _ in range(2):  # the second time there is nothing to carry
        with opened(tmp_path / "j.db"):
            pass
    with sqlite3.connect(tmp_path / "j.db") as connection:
        assert connection.execute("SELECT version FROM journal").fetchall() == [(3,)]
        assert connection.execute("SELECT * FROM added").fetchall() == []
    connection.close()
    assert len(stored(tmp_path / "j.db", 1)) == 1


def test_a_second_writer_is_refused_and_names_the_first(tmp_path):
    import socket

    with opened(tmp_path / "j.db") as journal:
        with pytest.raises(InputError, match=f"process {os.getpid()} on {socket.gethostname()} is writing to it"):
            opened(tmp_path / "j.db")
        assert journal.append(scene_shot(1)).result(MOST_WAIT) == 1
    with opened(tmp_path / "j.db") as journal:
        assert journal.run == 2


def test_lock_of_a_dead_writer_is_released(tmp_path):
    code = (
        "import os, sys\nfrom journal_scene import scene_run\nfrom catseye.coordinator.journal.writer import Journal\n"
        "from catseye.simulator.clock.world_clock import ManualClock\n"
        "Journal.open(sys.argv[1], run=scene_run(), clock=ManualClock(52889.125))\nos.kill(os.getpid(), 9)\n"
    )
    place = {**os.environ, "PYTHONPATH": str(TESTS)}
    done = subprocess.run([sys.executable, "-c", code, str(tmp_path / "j.db")], check=False, env=place)
    assert done.returncode == -9
    assert (tmp_path / "j.db.writer").exists()
    with opened(tmp_path / "j.db") as journal:
        assert journal.run == 2


@pytest.mark.skipif(os.getuid() != 0, reason="needs root to become somebody who may not write")
def test_unwritable_file_is_refused_in_one_line(tmp_path):
    """By a child that gave its rights away: root may write anything."""
    import tempfile

    code = (
        "import os, sys\nfrom journal_scene import scene_run\nfrom catseye.coordinator.journal.writer import Journal\n"
        "from catseye.simulator.clock.world_clock import ManualClock\nfrom catseye.errors import InputError\n"
        "run = scene_run()\nos.setgid(65534); os.setuid(65534)\n"
        "try:\n    Journal.open(sys.argv[1], run=run, clock=ManualClock(52889.125))\n"
        "except InputError as problem:\n    print(problem)\n"
    )
    place = {**os.environ, "PYTHONPATH": str(TESTS)}
    with tempfile.TemporaryDirectory() as folder:
        os.chmod(folder, 0o755)
        with opened(f"{folder}/j.db"):
            pass
        run = [sys.executable, "-c", code, f"{folder}/j.db"]
        done = subprocess.run(run, check=True, env=place, capture_output=True, text=True)
    assert done.stdout == f"journal {folder}/j.db: cannot be written: Permission denied\n"


def test_missing_server_driver_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "psycopg", None)
    with pytest.raises(InputError, match=r"psycopg is not installed \(expected the extra catseye\[postgresql\]\)"):
        opened("postgresql://u@h/db")
