"""A test run killed with -9: the processes it started end with it."""

import os
import select
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest

from process_scene import ends_with_us
from repository import ROOT

SOON = 10.0  # s, on a busy machine
PATIENCE = 90.0

RUN = """
import os, signal
from pathlib import Path

from cli.living_scene import small_site, started
from journal_scene import PostgresServer

def offspring(pid):
    found = [int(p) for p in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    return found + [p for each in found for p in offspring(each)]

def test_it_waits():
    words = ["--twin", "--cold", "--port-base", "0", "--json"]
    with started("zy", small_site(), "ZY101", *words) as ranger:
        assert ranger.stdout.readline()
        try:
            server = PostgresServer()
        except FileNotFoundError:  # is not installed
            server = None
        print("\\nchildren", *offspring(os.getpid()), flush=True)
        signal.pause()
"""


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="asks Linux to end children with their parent")
def test_processes_of_a_killed_test_run_end_soon(tmp_path):
    test = tmp_path / "test_it.py"
    test.write_text(RUN)
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-s",
        "-p",
        "no:cacheprovider",
        f"--rootdir={tmp_path}",
        "-c",
        os.devnull,
    ]
    command += ["-o", f"pythonpath={ROOT / 'tests'}", str(test)]
    run = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=tmp_path, preexec_fn=ends_with_us())
    try:
        said = []
        while not (said and said[-1].startswith("children")):
            said.append(run.stdout.readline())
            assert said[-1], "".join(said)
        children = [os.pidfd_open(int(pid)) for pid in said[-1].split()[1:]]
        assert len(children) >= 1
    finally:
        run.kill()
        run.wait(PATIENCE)
        run.stdout.close()
    try:
        for child in children:
            assert select.select([child], [], [], SOON)[0], "it outlives the test run"
    finally:
        for child in children:
            with suppress(ProcessLookupError):
                signal.pidfd_send_signal(child, signal.SIGKILL)
            os.close(child)
