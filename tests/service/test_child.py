"""A supervised child process."""

import asyncio
import os
import signal
import subprocess
import sys
import time

import pytest

from catseye.errors import InputError
from catseye.service.child import LiveChild
from process_scene import ends_with_us

SPEAKS = "import sys; print('here', flush=True); sys.stdin.read()"
DEAF = (
    "import signal, sys, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); print('here', flush=True); "
    "sys.stdin.read(); time.sleep(60)"
)
DIES = "import sys; sys.stderr.write('catseye: port 5240 is taken\\n'); sys.exit(1)"


def child(text, said=None, warned=None):
    lists = [] if said is None else said, [] if warned is None else warned
    return LiveChild("twin", (), said=lists[0].append, warned=lists[1].append, program=(sys.executable, "-c", text))


def alive(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_child_runs_after_its_first_line_until_stopped():
    async def story():
        said = []
        one = child(SPEAKS, said)
        await one.start()
        pid = one.pid
        assert (said, alive(pid)) == (["here"], True)
        await one.stop()
        assert not alive(pid)
        assert one.pid is None

    asyncio.run(story())


def test_child_that_ignores_sigterm_is_killed_in_time():
    async def story():
        one = child(DEAF)
        await one.start()
        pid, since = one.pid, time.monotonic()
        await one.stop()
        assert not alive(pid)
        assert time.monotonic() - since < 4.0  # two for it to obey, and a busy machine

    asyncio.run(story())


def test_temporary_folder_of_a_killed_child_is_removed(tmp_path, monkeypatch):
    """By either way of killing; a folder of another process stays."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    other = tmp_path / "catseye-0-x"
    other.mkdir()

    async def story():
        for end in ("stop", "kill"):
            one = child(DEAF)
            await one.start()
            left = tmp_path / f"catseye-{one.pid}-x"
            (left / "deeper").mkdir(parents=True)
            if end == "kill":
                one.kill()
                assert not left.exists()
            await one.stop()
            assert not left.exists()

    asyncio.run(story())
    assert list(tmp_path.iterdir()) == [other]


def test_child_that_cannot_start_reports_its_own_message():
    async def story():
        with pytest.raises(InputError, match=r"^twin: port 5240 is taken$"):
            await child(DIES).keep()

    asyncio.run(story())


def test_patient_keep_retries_a_failed_first_start(monkeypatch):
    """As of a service: leaving would only have it started again at once, for ever."""
    monkeypatch.setattr("catseye.service.child.FIRST_WAIT", 0.05)

    async def story():
        warned = []
        one = child(DIES, warned=warned)
        task = asyncio.create_task(one.keep(patient=True))
        while sum("did not start" in line for line in warned) < 3:
            await asyncio.sleep(0.02)
        assert not task.done()
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        assert "did not start; restarting in 0.05 s" in warned

    asyncio.run(asyncio.wait_for(story(), 30.0))


def test_dead_child_is_restarted_and_ends_with_its_parent():
    async def story():
        said, warned = [], []
        one = child(SPEAKS, said, warned)
        kept = asyncio.create_task(one.keep())
        while not said:
            await asyncio.sleep(0.01)
        first = one.pid
        os.kill(first, signal.SIGKILL)
        async with asyncio.timeout(30.0):
            while len(said) < 2:
                await asyncio.sleep(0.05)
        second = one.pid
        assert second != first
        assert f"ended with status {-signal.SIGKILL}" in warned[0]
        kept.cancel()
        await asyncio.gather(kept, return_exceptions=True)
        assert not alive(second)

    asyncio.run(story())


def test_child_does_not_outlive_a_killed_parent():
    keeper = (
        "import asyncio, sys\n"
        "from catseye.service.child import LiveChild\n"
        f"one = LiveChild('twin', (), said=lambda line: print(one.pid, flush=True), warned=print, "
        f"program=(sys.executable, '-c', {SPEAKS!r}))\n"
        "asyncio.run(one.keep())\n"
    )
    program = [sys.executable, "-c", keeper]
    with subprocess.Popen(program, stdout=subprocess.PIPE, text=True, preexec_fn=ends_with_us()) as process:
        pid = int(process.stdout.readline())
        assert alive(pid)
        process.kill()
        process.communicate()
    until = time.monotonic() + 10.0
    while alive(pid) and time.monotonic() < until:  # until whoever has inherited it has taken its status, too
        time.sleep(0.01)
    assert not alive(pid)
