"""An adder of nights that is killed, and two of them at once."""

import os
import signal
import subprocess
import sys
import time

from catseye.gateways.archive.files import create_archive, sole_writer
from catseye.records.archive.reading import open_archive, read_table
from catseye.records.archive.verification import verify_archive
from journal_scene import MOST_WAIT, NIGHT
from process_scene import ends_with_us
from service.archive.adding_scene import added, campaign_copy

ADD = """
import sys
from pathlib import Path
from catseye.service.archive.adding import change_archive
if __name__ == "__main__":
    directory, *sources = sys.argv[1:]
    print("begun", flush=True)
    change_archive(
        Path(directory), sources, remove=(), compact=False, processes=1, cluster=None, progress=None
    )
"""


def adder(directory, *sources):
    return subprocess.Popen(
        [sys.executable, "-c", ADD, str(directory), *map(str, sources)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        start_new_session=True,
        preexec_fn=ends_with_us(),
    )


def wait_for(condition, process):
    end = time.monotonic() + MOST_WAIT
    while not condition():
        assert time.monotonic() < end
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.002)


def test_kill_9_while_adding_leaves_an_archive_that_goes_on(tmp_path):
    """Of the whole group, once the first night is in the index and the second has its first file or begins it."""
    directory = tmp_path / "a"
    sources = [campaign_copy(tmp_path / f"night-{k}", samples=k) for k in (1, 2)]
    with adder(directory, *sources) as process:
        wait_for(lambda: len(list(directory.glob("index/*.json"))) == 1, process)
        wait_for(
            lambda: len(list(directory.glob("*/year=*/*"))) > 10 or len(list(directory.glob("index/*"))) > 1, process
        )
        os.killpg(process.pid, signal.SIGKILL)
    first = open_archive(directory)
    assert len(first.nights) >= 1
    assert verify_archive(directory).problems == ()
    assert len(read_table(first, "points", ["x"])["x"]) == 130 * len(first.nights)
    change = added(directory, *sources)
    assert [outcome.state for outcome in change.outcomes] == ["done", "done"]
    assert change.outcomes[0].value["added"] is False
    assert len(open_archive(directory).nights) == 2
    check = verify_archive(directory)
    assert (check.problems, check.strangers) == ((), ())


def test_a_second_adder_is_refused_in_one_line_while_the_first_writes(tmp_path):
    create_archive(tmp_path / "a")
    with sole_writer(tmp_path / "a"), adder(tmp_path / "a", NIGHT) as process:
        _, complaint = process.communicate(timeout=MOST_WAIT)
    assert process.returncode != 0
    assert f"process {os.getpid()} is writing to it (expected one at a time; wait until it has ended)" in complaint
    assert open_archive(tmp_path / "a").nights == ()
    assert added(tmp_path / "a", NIGHT).outcomes[0].value["added"] is True
