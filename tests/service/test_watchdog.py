"""Watchdog signals to a service manager."""

import asyncio
import os
import socket
import tempfile
from pathlib import Path

import pytest

from catseye.service.watchdog import live, notify, watchdog_seconds


@pytest.fixture
def manager():
    """A socket as systemd's, and the environment that names it."""
    with tempfile.TemporaryDirectory() as folder, socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sock:
        place = str(Path(folder) / "notify")
        sock.bind(place)
        sock.setblocking(False)
        yield sock, {"NOTIFY_SOCKET": place}


def told(sock):
    found = []
    while True:
        try:
            found.append(sock.recv(100).decode())
        except BlockingIOError:
            return found


def test_without_a_manager_nothing_is_sent():
    assert not notify("READY=1", {})
    assert not notify("READY=1", {"NOTIFY_SOCKET": "/none/such"})
    assert watchdog_seconds({}) is None
    assert watchdog_seconds({"WATCHDOG_USEC": "0"}) is None
    assert watchdog_seconds({"WATCHDOG_USEC": "3000000", "WATCHDOG_PID": "1"}) is None
    assert watchdog_seconds({"WATCHDOG_USEC": "3000000", "WATCHDOG_PID": str(os.getpid())}) == 3.0


def test_watchdog_signals_are_sent_well_before_the_timeout(manager):
    sock, environment = manager
    heard = []

    async def story():
        task = asyncio.create_task(live(environment | {"WATCHDOG_USEC": "100000"}))
        for _ in range(30):
            await asyncio.sleep(0.01)
            heard.extend(told(sock))
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        heard.extend(told(sock))

    asyncio.run(story())
    assert heard[0] == "READY=1"
    assert heard[-1] == "STOPPING=1"
    assert len([text for text in heard if text == "WATCHDOG=1"]) >= 4


def test_loop_does_not_wait_for_an_unresponsive_manager(manager):
    _, environment = manager
    given = [notify("WATCHDOG=1", environment) for _ in range(2000)]
    assert given[0]
    assert not given[-1]  # its queue is full


def test_without_a_watchdog_only_readiness_is_sent(manager):
    sock, environment = manager

    async def story():
        task = asyncio.create_task(live(environment))
        await asyncio.sleep(0.05)
        assert told(sock) == ["READY=1"]
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    asyncio.run(story())
    assert told(sock) == ["STOPPING=1"]
