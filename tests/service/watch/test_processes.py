"""A watch of a coordinator in another process, by real sockets: stopped, continued, killed, started again."""

import asyncio
import os
import signal
import subprocess
import sys
from pathlib import Path

from catseye.api.live.watching import watch_site
from coordinator.ziy_scene import gbt
from process_scene import ends_with_us
from repository import ROOT

PATIENCE = 60.0  # s on a busy machine
CHILD = Path(__file__).with_name("watch_child.py")


def started(port=0):
    """A coordinator's process, and its port."""
    place = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT / "src"), str(ROOT / "tests"), *sys.path])}
    process = subprocess.Popen(
        [sys.executable, str(CHILD), str(port)],
        stdout=subprocess.PIPE,
        text=True,
        env=place,
        preexec_fn=ends_with_us(),
    )
    return process, int(process.stdout.readline())


async def until(done):
    """Wait for something in real time."""
    async with asyncio.timeout(PATIENCE):
        while not done():
            await asyncio.sleep(0.05)


def ended(process):
    process.kill()
    process.wait()
    process.stdout.close()


async def story(first):
    process, port = first
    watch = watch_site(gbt(), coordinator=("127.0.0.1", port))
    heard = []
    watch.listeners.append(lambda kind, item: heard.append(kind))
    watching = asyncio.ensure_future(watch.run())
    try:
        await until(lambda: watch.state()["connected"] and "shot" in heard)
        process.send_signal(signal.SIGSTOP)
        await until(lambda: not watch.state()["connected"])
        received = watch.state()["received"]
        assert watch.now() - received < 30.0 / 86_400
        process.send_signal(signal.SIGCONT)
        await until(lambda: watch.state()["connected"])
        assert watch.state()["received"] > received
        ended(process)
        await until(lambda: not watch.state()["connected"])
        heard.clear()
        process, _ = await asyncio.to_thread(started, port)
        await until(lambda: watch.state()["connected"] and "shot" in heard)
        answer = await watch.command("MODE", ["hold"], "anna")
        assert answer["values"] == ["hold"]
        assert not watching.done()
    finally:
        watching.cancel()
        await asyncio.gather(watching, return_exceptions=True)
        if process.poll() is None:
            ended(process)


def test_coordinator_stopped_killed_and_started_again():
    asyncio.run(story(started()))
