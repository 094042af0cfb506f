"""Many units of work survive kills, full disks, Ctrl-C and a lost scheduler: the same answers, nothing half-written."""

import json
import os
import resource
import signal
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from process_scene import ends_with_us
from repository import ROOT

PROGRAM = "from service.many.many_scene import main; main()"
PATIENCE = 60.0  # s for what a busy machine does slowly
CONTRACT = 5.0  # s from a signal to the end of all processes
COUNT = 6


def place():
    """Environment by which a child finds catseye and the scenes."""
    return {**os.environ, "PYTHONPATH": f"{ROOT / 'src'}:{ROOT / 'tests'}"}


@contextmanager
def started(folder, *, count=COUNT, seconds=0.4, processes=2, cluster="", resume="", limit=None):
    """A run of its own session, killed at the block's end."""

    with_us = ends_with_us()

    def prepare():
        with_us()
        if limit is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    words = [str(folder), str(count), str(seconds), str(processes), cluster, resume]
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=place(),
        start_new_session=True,
        preexec_fn=prepare,
    )
    try:
        yield process
    finally:
        with suppress(OSError):
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


def until_done(process, number):
    """Read progress until so many units are done."""
    for line in process.stdout:
        if json.loads(line)["done"] >= number:
            return
    pytest.fail(f"it ended before: {process.stderr.read()}")


def answer(process):
    """Last line of a run, and that it ended by itself."""
    said, complaint = process.communicate(timeout=PATIENCE)
    assert (process.returncode, complaint) == (0, "")
    return json.loads(said.splitlines()[-1])


def run(folder, **options):
    with started(folder, **options) as process:
        return answer(process)


def members(session):
    """Processes of a session that run."""
    alive = []
    for entry in Path("/proc").iterdir():
        with suppress(OSError, ValueError, IndexError):
            fields = (entry / "stat").read_text().rpartition(")")[2].split()
            if entry.name.isdigit() and int(fields[3]) == session and fields[0] != "Z":
                alive.append(int(entry.name))
    return alive


def workers(session, word="spawn_main"):
    """Worker processes of a run."""
    found = []
    for pid in members(session):
        with suppress(OSError):
            if word in Path(f"/proc/{pid}/cmdline").read_text():
                found.append(pid)
    return found


def until(condition, seconds):
    """Wait for a condition; how long it took."""
    start = time.monotonic()
    while not condition():
        assert time.monotonic() - start < seconds, "in vain"
        time.sleep(0.02)
    return time.monotonic() - start


def digests(outcomes):
    return {name: digest for name, (_, digest, _) in outcomes.items()}


def half_written(folder):
    """Unfinished output, and folders that are not whole."""
    return [path.name for path in Path(folder).rglob(".catseye-*")] + [
        path.name for path in Path(folder).glob("out-*") if len(list(path.iterdir())) != 5
    ]


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """Digests of a run of one process that nothing disturbed."""
    folder = tmp_path_factory.mktemp("undisturbed")
    outcomes = run(folder, processes=1, seconds=0.0)
    assert [state for state, _, _ in outcomes.values()] == ["done"] * COUNT
    assert half_written(folder) == []
    return digests(outcomes)


@pytest.mark.parametrize("cluster", ["", pytest.param("local", marks=pytest.mark.slow)])
def test_a_killed_worker_costs_one_unit_a_second_try(tmp_path, undisturbed, cluster):
    with started(tmp_path, cluster=cluster) as process:
        until_done(process, 1)
        until(lambda: list(tmp_path.glob(".catseye-*")), PATIENCE)
        os.kill(workers(process.pid)[0], signal.SIGKILL)
        outcomes = answer(process)
    assert digests(outcomes) == undisturbed
    assert half_written(tmp_path) == []


@pytest.mark.parametrize("cluster", ["", pytest.param("local", marks=pytest.mark.slow)])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_stopped_run_ends_its_workers_in_time_and_goes_on(tmp_path, undisturbed, cluster, number):
    with started(tmp_path, cluster=cluster) as process:
        until_done(process, 2)
        until(lambda: list(tmp_path.glob(".catseye-*")), PATIENCE)
        start = time.monotonic()
        os.killpg(process.pid, number)  # as a terminal does to all of a command
        assert process.wait(PATIENCE) == 128 + number
        until(lambda: not workers(process.pid), PATIENCE)
        assert time.monotonic() - start < CONTRACT
        assert process.stderr.read() == ""
        assert half_written(tmp_path) == []
    outcomes = run(tmp_path, resume="resume", seconds=0.0)
    assert digests(outcomes) == undisturbed
    assert [state for state, _, _ in outcomes.values()].count("resumed") >= 2


def test_workers_end_with_a_run_that_is_killed_and_another_goes_on(tmp_path, undisturbed):
    with started(tmp_path) as process:
        until_done(process, 2)
        until(lambda: list(tmp_path.glob(".catseye-*")), PATIENCE)
        process.kill()
        process.wait(PATIENCE)
        assert until(lambda: not workers(process.pid), PATIENCE) < CONTRACT
        assert half_written(tmp_path) == []  # they undid it themselves
        outcomes = run(tmp_path, resume="resume", seconds=0.0)
    assert digests(outcomes) == undisturbed
    assert [state for state, _, _ in outcomes.values()].count("resumed") >= 2


def test_all_killed_at_once_leaves_what_the_next_run_clears(tmp_path, undisturbed):
    with started(tmp_path) as process:
        until_done(process, 2)
        until(lambda: list(tmp_path.glob(".catseye-*")), PATIENCE)
        os.killpg(process.pid, signal.SIGKILL)
        process.wait(PATIENCE)
        until(lambda: not members(process.pid), PATIENCE)
    assert half_written(tmp_path) != []
    outcomes = run(tmp_path, resume="resume", seconds=0.0)
    assert digests(outcomes) == undisturbed
    assert half_written(tmp_path) == []


@pytest.mark.parametrize("cluster", ["", pytest.param("local", marks=pytest.mark.slow)])
def test_a_full_disk_stops_the_run_and_room_lets_it_go_on(tmp_path, undisturbed, cluster):
    run(tmp_path, count=2, seconds=0.0)
    stopped = run(tmp_path, cluster=cluster, resume="resume", seconds=0.0, limit=2000)  # bytes of a file: half of one
    assert "File too large" in stopped["stopped"]
    assert stopped["stopped"].endswith("; 2 of 6 are done; resume continues from there")
    assert (stopped["done"], stopped["total"]) == (2, COUNT)
    assert half_written(tmp_path) == []
    assert digests(run(tmp_path, resume="resume", seconds=0.0)) == undisturbed


@contextmanager
def cluster_of_two(folder):
    """A dask scheduler with two workers, as a user starts them; its file and its process."""
    pytest.importorskip("distributed")
    file, common = (
        folder / "scheduler.json",
        {"env": place(), "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL},
    )
    program = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--no-dashboard", "--host", "127.0.0.1"]
    work = [sys.executable, "-m", "distributed.cli.dask_worker", "--no-dashboard", "--nthreads", "1"]
    work += ["--scheduler-file", str(file), "--local-directory", str(folder), "--death-timeout", "60"]
    scheduler = subprocess.Popen(
        [*program, "--port", "0", "--scheduler-file", str(file)], **common, preexec_fn=ends_with_us()
    )
    started_workers = []
    try:
        until(file.exists, PATIENCE)
        started_workers += [subprocess.Popen(work, **common, preexec_fn=ends_with_us()) for _ in range(2)]
        yield file, scheduler
    finally:
        for process in (*started_workers, scheduler):
            process.kill()
            process.wait()


@pytest.mark.slow
def test_a_lost_scheduler_is_an_error_that_says_what_is_done(tmp_path, undisturbed):
    (tmp_path / "out").mkdir()
    with cluster_of_two(tmp_path) as (file, scheduler), started(tmp_path / "out", cluster=str(file)) as process:
        until_done(process, 2)
        scheduler.kill()
        stopped = answer(process)
    assert stopped["stopped"].startswith("the cluster's scheduler is gone; ")
    assert 2 <= stopped["done"] < stopped["total"] == COUNT
    outcomes = run(tmp_path / "out", resume="resume", seconds=0.0)
    assert digests(outcomes) == undisturbed
    assert [state for state, _, _ in outcomes.values()].count("resumed") >= stopped["done"]
    assert half_written(tmp_path / "out") == []


@pytest.mark.slow
def test_a_cluster_at_an_address_gives_the_same(tmp_path, undisturbed):
    (tmp_path / "out").mkdir()
    with cluster_of_two(tmp_path) as (file, _):
        assert digests(run(tmp_path / "out", cluster=str(file), seconds=0.0)) == undisturbed
        address = json.loads(file.read_text())["address"]
        assert digests(run(tmp_path / "out", cluster=address, seconds=0.0)) == undisturbed
