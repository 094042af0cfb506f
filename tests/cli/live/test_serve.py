"""A site as a service: its twin is started again when it dies, and SIGTERM is how it ends."""

import json
import os
import re
import signal
import subprocess
import sys
import time

import pytest

from cli.living_scene import SOON, ended, processes_with, small_site, started


def free_base():
    """Another one for each process that tests, below the ports that connections get from the system."""
    return 20_000 + 200 * (os.getpid() % 60)


def read_until(process, kind):
    while line := process.stderr.readline():
        row = json.loads(line)
        if row["kind"] == kind:
            return row
    raise AssertionError(f"it ended before {kind}: status {process.wait()}")


def test_a_twin_that_is_started_again_needs_ports_that_stay(catseye):
    status, _, err = catseye("serve", "gbt", "--twin", "--port-base", "0")
    assert status == 2
    assert "needs ports that stay" in " ".join(err.split())


def test_a_site_that_is_not_there_is_named(catseye):
    status, _, err = catseye("serve", "nowhere", "--twin")
    assert status == 1
    assert "nowhere" in err


@pytest.mark.slow
@pytest.mark.parametrize(("number", "status"), [(signal.SIGTERM, 0), (signal.SIGINT, 130)])
def test_a_twin_that_dies_comes_back_and_the_end_is_clean(tmp_path, number, status):
    words = ["serve", small_site(), "--twin", "--no-page", "--port-base", free_base(), "--port", "0", "--log-json"]
    words += ["--start", "60635.125", "--journal", tmp_path / "site.db"]
    with started(*words, home=tmp_path) as process:
        read_until(process, "listens")
        read_until(process, "epoch")
        children = [pid for pid in processes_with("--leave-with-stdin") if parent_of(pid) == process.pid]
        assert len(children) == 1
        os.kill(children[0], signal.SIGKILL)
        assert "restarting" in read_until(process, "child")["text"]
        read_until(process, "lost")
        read_until(process, "epoch")
        code, out, _ = ended(process, number)
    assert code == status
    assert re.fullmatch(rf"journal {tmp_path}/site\.db: head \d+:[0-9a-f]{{16}} of run 1\n", out)
    assert processes_with(str(tmp_path)) == []
    left = [path.name for path in tmp_path.iterdir()]
    assert "site.db" in left
    assert "site.db.writer" not in left


@pytest.mark.slow
def test_a_site_ends_within_five_seconds_beside_ten_busy_processes(tmp_path):
    """5.2 s, and by force, before its waits had shares; ten processes on two cores are a load of 10."""
    words = ["serve", small_site(), "--twin", "--no-page", "--port-base", free_base(), "--port", "0", "--log-json"]
    words += ["--start", "60635.125", "--journal", tmp_path / "site.db"]
    busy = []
    with started(*words, home=tmp_path) as process:
        read_until(process, "epoch")
        try:
            busy += [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(10)]
            time.sleep(3.0)  # the machine's scheduler is what is tested
            began = time.monotonic()
            process.send_signal(signal.SIGTERM)
            process.communicate(timeout=30.0)
            assert time.monotonic() - began < SOON
        finally:
            for each in busy:
                each.kill()
                each.wait()
    assert processes_with(str(tmp_path)) == []


def parent_of(pid):
    with open(f"/proc/{pid}/stat") as stream:
        return int(stream.read().rpartition(")")[2].split()[1])
